//! The step on the GPU against the CPU: stage by stage from one state, whole scenes, and itself from run to run.
//!
//! Needs a device, if only Mesa's software driver; without one the tests show as ignored, and with `JETSAM_REQUIRE_GPU=1` in
//! the environment they fail.

#[path = "../common/mod.rs"]
mod common;

/// A test and its name.
type Test = (&'static str, fn());

/// Functions with their names.
macro_rules! tests {
    ($($name:ident),* $(,)?) => { [$((stringify!($name), $name as fn())),*] };
}

mod flocks;
mod implicit;
mod joints;
mod sleep;
mod stages;
mod steps;
mod texts;
mod wide;

use common::{oracle, scene};
use jetsam::World;
use jetsam::assemble::Assembly;
use jetsam::backend::Choice;
use jetsam::gpu::devices;
use libtest_mimic::{Arguments, Trial, run};
use std::process::ExitCode;

/// The pairs of `tests/oracle.rs`, on the GPU.
const ORACLE: [Test; 6] = [
    ("oracle: a disturbed block in the open", || oracle::a_disturbed_block_in_the_open(gpu_world)),
    ("oracle: a periodic box", || oracle::a_periodic_box(gpu_world)),
    ("oracle: a box with walls and a body", || oracle::a_box_with_walls_and_a_body(gpu_world)),
    ("oracle: density integrated", || oracle::density_integrated(gpu_world)),
    ("oracle: neighbours on faces of cells and at the edge of the support", || {
        oracle::neighbours_on_faces_of_cells_and_at_the_edge_of_the_support(gpu_world)
    }),
    ("oracle: all particles in one cell", || oracle::all_particles_in_one_cell(gpu_world)),
];

fn main() -> ExitCode {
    let tests = [
        &ORACLE,
        stages::TESTS,
        steps::TESTS,
        flocks::TESTS,
        implicit::TESTS,
        joints::TESTS,
        sleep::TESTS,
        wide::TESTS,
    ]
    .concat();
    let absent = devices().is_empty();
    let required = std::env::var("JETSAM_REQUIRE_GPU").is_ok_and(|v| v == "1");
    let trial = |(name, test): Test| {
        Trial::test(name, move || {
            test();
            Ok(())
        })
        .with_ignored_flag(absent && !required)
    };
    run(&Arguments::from_args(), tests.into_iter().map(trial).collect()).exit_code()
}

fn gpu_world(assembly: Assembly) -> World {
    World::choose(Choice::Gpu, assembly).unwrap_or_else(|e| panic!("{e}")).0
}

fn on_gpu(text: &str) -> World {
    gpu_world(scene(text).assemble().unwrap())
}
