//! Worlds for tests.

#![allow(dead_code)] // each test file uses some

pub mod oracle;

use jetsam::scene::Source;
use jetsam::{Scene, World};

/// A scene from its text.
pub fn scene(text: &str) -> Scene {
    let source = Source { name: "test".into(), text: text.into(), ..Source::default() };
    Scene::parse(source, &[]).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// A world from a scene's text.
pub fn world(text: &str) -> World {
    World::from_scene(&scene(text)).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// An open cube of edge `2 half` without gravity, with a spacing and a step.
pub fn space(half: f64, spacing: f64, dt: f64) -> String {
    format!(
        "[world]\ngravity = [0, 0, 0]\n[domain]\nmin = [-{half}, -{half}, -{half}]\nmax = [{half}, {half}, {half}]\n\
         walls = [\"open\", \"open\", \"open\"]\n[resolution]\nspacing = {spacing}\n[solver]\ndt = {dt}\n"
    )
}
