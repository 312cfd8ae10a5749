//! Sleep of bodies on both backends: the contracts of `tests/sleep.rs`.

use crate::common::scene;
use crate::{Test, on_gpu};
use jetsam::{World, state_hash};

/// The tests of this file.
pub const TESTS: &[Test] = &tests![
    bricks_fall_asleep_and_the_floor_bears_them,
    what_moves_wakes_them,
    without_sleep_none_sleeps,
    water_wakes_a_sleeping_brick,
    implicit_pressure_lets_bodies_sleep
];

fn asleep(w: &World) -> usize {
    w.state().bodies.body.iter().filter(|b| b.asleep).count()
}

/// Three bricks on each other; `extra` is added.
fn bricks(sleep: f64, extra: &str) -> String {
    format!(
        "[domain]\nmin = [-0.4, -0.4, 0]\nmax = [0.4, 0.4, 1.2]\n[resolution]\nspacing = 0.05\n[solver]\nsleep = {sleep}\n\
         [[rigid]]\nname = \"brick\"\nshape = {{ box = {{ min = [-0.15, -0.1, 0], max = [0.15, 0.1, 0.1] }} }}\ndensity = 1000\n\
         friction = 0.5\ncopies = {{ count = 3, grid = {{ columns = [1, 1], step = [0, 0, 0.1] }} }}\n{extra}"
    )
}

fn bricks_fall_asleep_and_the_floor_bears_them() {
    let text = bricks(0.2, "");
    let (mut cpu, mut gpu) = (World::from_scene(&scene(&text)).unwrap(), on_gpu(&text));
    let weight: f64 = gpu.state().bodies.body.iter().filter(|b| !b.is_static()).map(|b| b.mass * 9.81).sum();
    cpu.run_to(0.95);
    assert_eq!(gpu.run_to(0.95), None, "{:?}", gpu.fault());
    assert_eq!((asleep(&cpu), asleep(&gpu)), (3, 3), "after {} steps", gpu.steps());
    for (a, b) in cpu.state().bodies.body.iter().zip(&gpu.state().bodies.body).filter(|(a, _)| !a.is_static()) {
        // a step earlier or later (1.7e-3 s), at no more than 5e-3 sqrt(g spacing) = 3.5e-3 m/s
        println!("{:e} m, {} and {} s", (a.x - b.x).length(), a.still, b.still);
        assert!((a.x - b.x).length() < 6e-6 && (a.still - b.still).abs() < 2e-3, "{}", a.name);
    }
    let before: Vec<_> = gpu.state().bodies.body.iter().map(|b| (b.x, b.q)).collect();
    assert_eq!(gpu.run_to(1.0), None);
    assert!(gpu.state().bodies.body.iter().zip(&before).all(|(b, then)| (b.x, b.q) == *then), "they lie still");
    cpu.run_to(1.0);
    let borne = |w: &World| {
        let floor = w.state().bodies.body.iter().find(|b| b.name == "walls").unwrap();
        -floor.force_contact.z / weight
    };
    println!("borne {} and {}, residual {:e}", borne(&cpu), borne(&gpu), gpu.momentum_residual());
    // asleep they keep the overlaps they had, and those swing a little until then
    assert!((borne(&gpu) - 1.0).abs() < 0.03 && (borne(&cpu) - borne(&gpu)).abs() < 1e-5);
    let sleepers = gpu.state().particles.segment(jetsam::state::Kind::Rigid).len();
    assert!(gpu.state().forces_on_bodies().take(sleepers).all(|f| f == [0.0; 3]), "nothing is felt");
}

/// A ball that falls on them arrives after they have fallen asleep, and wakes them; the same bits come of it twice.
fn what_moves_wakes_them() {
    // t = sqrt(2 (0.9 - 0.1 - 0.3) / g) = 0.32 s
    let text = bricks(
        0.05,
        "[[rigid]]\nname = \"ball\"\nshape = { sphere = { center = [0, 0, 0], radius = 0.1 } }\ndensity = 3000\nposition = [0, 0, 0.9]\n",
    );
    let run = || {
        let mut w = on_gpu(&text);
        w.run_to(0.3);
        let before = asleep(&w);
        w.run_to(0.34);
        (before, asleep(&w), state_hash(w.state()))
    };
    let first = run();
    assert_eq!((first.0, first.1), (3, 0));
    assert_eq!(first, run());
}

fn without_sleep_none_sleeps() {
    let mut w = on_gpu(&bricks(0.0, ""));
    w.run_to(0.3);
    assert_eq!(asleep(&w), 0);
}

const WET: &str = "[domain]\nmin = [0, 0, 0]\nmax = [1.0, 0.2, 0.5]\n[resolution]\nspacing = 0.05\n\
    [[fluid]]\nshape = { box = { min = [0, 0, 0], max = [0.3, 0.2, 0.4] } }\n\
    [[rigid]]\nshape = { box = { min = [-0.05, -0.05, 0], max = [0.05, 0.05, 0.1] } }\ndensity = 300\nposition = [0.7, 0.1, 0]\n";

fn water_wakes_a_sleeping_brick() {
    for solver in ["wcsph", "dfsph"] {
        let mut w = on_gpu(&format!("{WET}[solver]\nsleep = 0.05\npressure = \"{solver}\"\n"));
        w.run_to(0.12);
        assert_eq!(asleep(&w), 1, "{solver}");
        w.run_to(0.4);
        let b = &w.state().bodies.body[0];
        println!("{solver}: at {:.3} m, {:.2} m/s", b.x.x, b.v.x);
        assert!(!b.asleep && (b.x.x > 0.75 || b.v.x.abs() > 0.1), "{solver}: the wave takes it along: {b:?}");
    }
}

/// Inside a step bodies make parts of it, and sleep in those.
fn implicit_pressure_lets_bodies_sleep() {
    let text = format!("{WET}[solver]\nsleep = 0.05\npressure = \"dfsph\"\n");
    let (mut cpu, mut gpu) = (World::from_scene(&scene(&text)).unwrap(), on_gpu(&text));
    for until in [0.04, 0.08, 0.12] {
        cpu.run_to(until);
        gpu.run_to(until);
        assert_eq!(asleep(&cpu), asleep(&gpu), "at {until} s");
        assert!(gpu.momentum_residual() < 1e-5, "{}", gpu.momentum_residual());
    }
}
