//! Worlds for tests.

#![allow(dead_code)] // each test file uses some

pub mod oracle;

use jetsam::assemble::Assembly;
use jetsam::scene::Source;
use jetsam::state::Kind;
use jetsam::{Scene, World, random};

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

/// A periodic box of stirred fluid with two bodies in it; `solver` are keys of `[solver]`, without gravity.
pub fn stirred(dimensions: u32, solver: &str) -> World {
    World::new(stirred_assembly(dimensions, solver))
}

/// The same, to be run by any backend.
pub fn stirred_assembly(dimensions: u32, solver: &str) -> Assembly {
    let text = format!(
        "[world]\ndimensions = {dimensions}\ngravity = [0, 0, 0]\n[domain]\nmin = [0, 0, 0]\nmax = [1, 1, 1]\n\
         walls = [\"periodic\", \"periodic\", \"periodic\"]\n[resolution]\nspacing = 0.0625\n\
         [solver]\n{solver}\n\
         [[fluid]]\nshape = {{ box = {{ min = [0, 0, 0], max = [1, 1, 1] }} }}\nviscosity = 0.5\n\
         [[rigid]]\nshape = {{ sphere = {{ center = [0, 0, 0], radius = 0.2 }} }}\ndensity = 400\nposition = [0.3, 0.3, 0.3]\n\
         velocity = [0.5, 0.2, 0.7]\nspin = [0, 3, 0]\n\
         [[rigid]]\nshape = {{ box = {{ min = [-0.15, -0.15, -0.15], max = [0.15, 0.15, 0.15] }} }}\ndensity = 2000\n\
         position = [0.7, 0.7, 0.7]\nvelocity = [-0.5, 0.0, -0.6]\n"
    );
    let mut assembly = scene(&text).assemble().unwrap();
    let n = assembly.state.particles.count[Kind::Fluid as usize];
    for (i, r) in assembly.state.particles.record[..n].iter_mut().enumerate() {
        for a in (0..3).filter(|&a| dimensions == 3 || a != 1) {
            r.v[a] = (2.0 * random::uniform(3, a as u64, i as u64) - 1.0) as f32;
        }
    }
    assembly
}
