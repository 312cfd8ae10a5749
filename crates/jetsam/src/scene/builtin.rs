//! Scenes and meshes that come with the program: the files of `scenes/`, compiled in.

use super::{Scene, Source};
use crate::error::Result;
use crate::mesh::MeshFormat;

/// A scene that comes with the program.
#[derive(Clone, Copy, Debug)]
pub struct Builtin {
    /// Name on the command line.
    pub name: &'static str,
    /// The scene file.
    pub text: &'static str,
}

/// All scenes that come with the program; the first is the default.
pub const SCENES: &[Builtin] = &[
    Builtin { name: "monkey-splash", text: include_str!("../../../../scenes/monkey-splash.toml") },
    Builtin { name: "mountain-slide", text: include_str!("../../../../scenes/mountain-slide.toml") },
    Builtin { name: "dam-break", text: include_str!("../../../../scenes/dam-break.toml") },
];

/// Meshes of the built-in scenes, by the path the scenes use.
pub(crate) fn mesh(path: &str) -> Option<(MeshFormat, &'static [u8])> {
    match path {
        "meshes/monkey.obj" => Some((MeshFormat::Obj, include_bytes!("../../../../scenes/meshes/monkey.obj"))),
        "meshes/mountain.obj" => Some((MeshFormat::Obj, include_bytes!("../../../../scenes/meshes/mountain.obj"))),
        _ => None,
    }
}

impl Scene {
    /// A built-in scene by name, with `key=value` overrides; `None` if there is none of that name.
    ///
    /// # Errors
    /// An override that does not fit (see [`Scene::load`]).
    pub fn builtin(name: &str, overrides: &[String]) -> Option<Result<Self>> {
        let scene = SCENES.iter().find(|s| s.name == name)?;
        let source = Source { name: name.into(), text: scene.text.into(), builtin: true, ..Source::default() };
        Some(Self::parse(source, overrides))
    }
}
