//! Scenes and meshes that come with the program: the files of `scenes/`, compiled in.

use super::{Scene, Source};
use crate::error::Result;
use crate::mesh::MeshFormat;
use std::path::Path;

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
    Builtin { name: "bench-dam", text: include_str!("../../../../scenes/bench-dam.toml") },
    Builtin { name: "bench-bricks", text: include_str!("../../../../scenes/bench-bricks.toml") },
    Builtin { name: "bench-balls", text: include_str!("../../../../scenes/bench-balls.toml") },
    Builtin { name: "bench-flock", text: include_str!("../../../../scenes/bench-flock.toml") },
    Builtin { name: "bench-floats", text: include_str!("../../../../scenes/bench-floats.toml") },
    Builtin { name: "dam-break", text: include_str!("../../../../scenes/dam-break.toml") },
    Builtin { name: "cup", text: include_str!("../../../../scenes/cup.toml") },
    Builtin { name: "school", text: include_str!("../../../../scenes/school.toml") },
    Builtin { name: "murmuration", text: include_str!("../../../../scenes/murmuration.toml") },
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
    /// A scene by the name of a built-in one or by the path of its file, with `key=value` overrides.
    ///
    /// # Errors
    /// A name that is neither, answered with the nearest known one; else as [`Scene::load`].
    pub fn open(name_or_path: &str, overrides: &[String]) -> Result<Self> {
        if let Some(scene) = Self::builtin(name_or_path, overrides) {
            return scene;
        }
        let path = Path::new(name_or_path);
        let is_path = path.extension().is_some() || path.components().count() > 1 || path.is_file();
        if is_path {
            return Self::load(path, overrides);
        }
        let near = |s: &&Builtin| (strsim::jaro_winkler(name_or_path, s.name) * 1e6) as u64;
        let nearest = SCENES.iter().max_by_key(near).filter(|s| near(s) > 700_000);
        let help = match nearest {
            Some(scene) => {
                format!("did you mean `{}`? A scene file is given by its path, as in ./{name_or_path}.toml", scene.name)
            }
            None => "`jetsam scenes` lists the built-in scenes; a scene file is given by its path".into(),
        };
        Err(Source::default().error("", format!("there is no built-in scene `{name_or_path}`"), help))
    }

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
