//! Flocks on both backends.

use crate::common::scene;
use crate::texts::TANK;
use crate::{Test, on_gpu};
use glam::Vec3;
use jetsam::World;

/// The tests of this file.
pub const TESTS: &[Test] =
    &tests![steering_flocks_agree, noisy_flocks_agree, topological_flocks_agree, fish_agree_in_water];

/// The largest distance between an agent on one backend and on the other, and the number of agents.
fn agents_apart(text: &str, steps: u32) -> (f32, f32, usize) {
    let (mut cpu, mut gpu) = (World::from_scene(&scene(text)).unwrap(), on_gpu(text));
    for _ in 0..steps {
        cpu.step(f64::INFINITY);
        gpu.step(f64::INFINITY);
    }
    assert!(gpu.fault().is_none(), "{:?}", gpu.fault());
    assert!((cpu.time() - gpu.time()).abs() < 1e-5 * cpu.time(), "{} {}", cpu.time(), gpu.time());
    let by_id = |w: &World| {
        let a = &w.state().agents;
        let mut all: Vec<_> = a.id.iter().zip(&a.record).map(|(id, r)| (*id, r.x, r.v)).collect();
        all.sort_by_key(|a| a.0);
        all
    };
    let (a, b) = (by_id(&cpu), by_id(&gpu));
    assert_eq!(a.len(), b.len());
    let far = |a: [f32; 3], b: [f32; 3]| (Vec3::from(a) - Vec3::from(b)).length();
    let worst = a.iter().zip(&b).map(|(a, b)| (far(a.1, b.1), far(a.2, b.2)));
    let (x, v) = worst.fold((0.0, 0.0), |w: (f32, f32), d| (w.0.max(d.0), w.1.max(d.1)));
    (x, v, a.len())
}

/// E22, E26: birds, one that hunts them, one that they follow, a goal, a wall of solids to keep clear of, a limited view.
fn steering_flocks_agree() {
    let text = r#"
[domain]
min = [0, 0, 0]
max = [20, 20, 20]
walls = ["solid", "open", "solid"]
[resolution]
spacing = 0.5
[[static]]
shape = { box = { min = [12, 4, 4], max = [14, 16, 16] } }
[[flock]]
name = "birds"
count = 600
shape = { sphere = { center = [8, 10, 10], radius = 3.5 } }
heading = [1, 0.1, 0]
radius = 1.5
speed = 4
field_of_view = 270
wander = 0.3
goal = [16, 10, 10]
seek = 0.2
avoid = 2.0
sight = 4
turn = 400
meets = { hawk = "flee" }
[[flock]]
name = "hawk"
count = 1
shape = { points = [[5, 10, 10.5]] }
heading = [1, 0, 0]
radius = 2
speed = 6
sight = 8
meets = { birds = "chase" }
[[flock]]
name = "tail"
count = 20
shape = { sphere = { center = [4, 6, 10], radius = 1 } }
heading = [1, 0, 0]
radius = 1.5
speed = 4
leader = "hawk"
follow = 1.0
meets = { birds = "ignore", hawk = "ignore" }
"#;
    let (x, v, n) = agents_apart(text, 25);
    println!("{n} agents: {x} m, {v} m/s apart");
    assert!(n == 621 && x < 2e-4 && v < 2e-3, "{x} {v}");
}

/// E23 and E24 with their noise: the same random numbers on both.
fn noisy_flocks_agree() {
    let couzin = r#"
[domain]
min = [-9, -9, -9]
max = [9, 9, 9]
walls = ["open", "open", "open"]
[resolution]
spacing = 0.5
[[flock]]
count = 200
model = "couzin"
shape = { sphere = { center = [0, 0, 0], radius = 3 } }
speed = 3
separation_radius = 1
alignment_radius = 2
radius = 6
noise = 0.05
turn = 40
field_of_view = 270
"#;
    let vicsek = r#"
[world]
dimensions = 2
[domain]
min = [0, 0, 0]
max = [7, 0, 7]
walls = ["periodic", "periodic", "periodic"]
[resolution]
spacing = 0.5
[[flock]]
count = 300
model = "vicsek"
shape = { box = { min = [0, 0, 0], max = [7, 0, 7] } }
speed = 0.03
radius = 1
noise = 1.0
"#;
    for (text, steps) in [(couzin, 12), (vicsek, 12)] {
        let (x, v, n) = agents_apart(text, steps);
        println!("{n} agents: {x} m, {v} m/s apart");
        assert!(x < 1e-3 && v < 1e-2, "{x} {v}");
    }
}

/// E25: the nearest twenty, however far.
fn topological_flocks_agree() {
    let text = r#"
[domain]
min = [0, 0, 0]
max = [20, 20, 20]
walls = ["periodic", "open", "open"]
[resolution]
spacing = 0.5
[[flock]]
count = 400
neighbours = 20
shape = { box = { min = [0, 6, 6], max = [20, 14, 14] } }
radius = 2
speed = 4
"#;
    let (x, v, n) = agents_apart(text, 4);
    println!("{n} agents: {x} m, {v} m/s apart");
    assert!(x < 2e-4 && v < 2e-3, "{x} {v}");
}

/// E27, E28: fish of mass in water with a body: what they push pushes back, on both alike.
fn fish_agree_in_water() {
    let text = format!(
        "{TANK}[[flock]]\nname = \"fish\"\ncount = 60\nshape = {{ box = {{ min = [0.3, 0.05, 0.05], max = [0.55, 0.35, 0.25] }} }}\n\
         heading = [-1, 0.2, 0]\nradius = 0.1\nseparation_radius = 0.05\nspeed = 0.4\nsize = 0.01\nmass = 0.02\n\
         meets = {{ bodies = \"flee\", fluids = \"school\" }}\n"
    );
    let (mut cpu, mut gpu) = (World::from_scene(&scene(&text)).unwrap(), on_gpu(&text));
    for _ in 0..30 {
        cpu.step(2e-4);
        gpu.step(2e-4);
    }
    let (a, b) = (cpu.ledger(), gpu.ledger());
    println!("{a:?}\n{b:?}\nresiduals {:e} {:e}", cpu.momentum_residual(), gpu.momentum_residual());
    assert!((a.momentum - b.momentum).length() < 1e-4 * a.momentum_scale, "{} {}", a.momentum, b.momentum);
    assert!((a.kinetic - b.kinetic).abs() < 1e-3 * a.kinetic, "{} {}", a.kinetic, b.kinetic);
    assert!(gpu.momentum_residual() < 1e-4 + 2.0 * cpu.momentum_residual(), "{}", gpu.momentum_residual());
    let (x, v, n) = agents_apart(&text, 30);
    println!("{n} fish: {x} m, {v} m/s apart");
    assert!(x < 1e-4 && v < 5e-3, "{x} {v}");
}
