//! Whole steps: runs on both backends, and of one twice.

use crate::common::scene;
use crate::texts::{FLAT, TANK};
use crate::{Test, gpu_world, on_gpu};
use glam::DVec3;
use jetsam::backend::{Backend, OnGpu};
use jetsam::integrate::Advance;
use jetsam::stage::Stage;
use jetsam::world::Grip;
use jetsam::{Scene, Trouble, World, state_hash};

/// The tests of this file.
pub const TESTS: &[Test] = &tests![
    a_hundred_steps_agree,
    same_bits_from_run_to_run,
    queued_steps_are_steps,
    sources_and_sinks_agree,
    scripts_are_followed,
    slow_turns_are_not_rounded_away,
    bodies_turn_as_in_double_precision,
    a_lost_device_is_said,
    steps_add_up_to_a_frame,
    scenes_agree,
    a_hand_is_felt_alike
];

/// After 100 steps of equal length: centre of mass, energies and bodies within 1e-4.
fn a_hundred_steps_agree() {
    for text in [TANK, FLAT] {
        let mut cpu = World::from_scene(&scene(text)).unwrap();
        let mut gpu = on_gpu(text);
        let dt = 0.8 * cpu.model().largest_dt(cpu.ledger().speed, cpu.ledger().acceleration).0;
        for _ in 0..100 {
            cpu.step(dt);
            gpu.step(dt);
        }
        let (a, b) = (cpu.ledger(), gpu.ledger());
        assert_eq!((a.fluid, a.lost, b.lost), (b.fluid, 0, 0));
        for (what, x, y) in [("kinetic", a.kinetic, b.kinetic), ("potential", a.potential, b.potential)] {
            assert!((x - y).abs() <= 1e-4 * (a.kinetic + a.potential), "{what}: {x} and {y}");
        }
        assert!((a.momentum - b.momentum).length() <= 1e-4 * a.momentum_scale, "{} {}", a.momentum, b.momentum);
        for (a, b) in cpu.state().bodies.body.iter().zip(&gpu.state().bodies.body) {
            let size = 1.0; // the domain's
            assert!((a.x - b.x).length() < 1e-4 * size, "{}: {} and {}", a.name, a.x, b.x);
        }
        println!("residuals {:e} {:e}", cpu.momentum_residual(), gpu.momentum_residual());
        assert!(gpu.momentum_residual() < 1e-4);
    }
}

fn same_bits_from_run_to_run() {
    let hash = || {
        let mut w = on_gpu(TANK);
        assert_eq!(w.run_to(0.02), None);
        (state_hash(w.state()), w.steps())
    };
    let first = hash();
    assert!(first.1 > 20, "{} steps", first.1);
    assert_eq!(first, hash());
}

/// A frame queued without waiting ends where it was asked to, with steps that obey E29.
fn queued_steps_are_steps() {
    let (mut queued, mut single) = (on_gpu(TANK), on_gpu(TANK));
    assert_eq!(queued.run_to(0.01), None);
    single.advance(0.01, |_, r| r.trouble.is_none());
    assert_eq!(queued.time(), 0.01);
    assert_eq!((queued.steps(), single.steps()), (single.steps(), queued.steps()));
    let (a, b) = (queued.ledger(), single.ledger());
    assert!((a.kinetic - b.kinetic).abs() < 1e-5 * a.kinetic, "{} {}", a.kinetic, b.kinetic);
    let (dt, _) = queued.model().largest_dt(a.speed, a.acceleration);
    assert!(0.01 / queued.steps() as f64 <= 1.05 * dt, "{dt}");
}

/// A hose, bursts, a sink and a lifetime.
const SOURCES: &str = r#"
[world]
gravity = [0, 0, 0]
[domain]
min = [0, 0, 0]
max = [1, 0.4, 0.4]
walls = ["open", "solid", "solid"]
[resolution]
spacing = 0.03
[[fluid]]
name = "water"
density = 1000
[[fluid]]
name = "mist"
density = 500
lifetime = 0.04
[[emitter]]
fluid = "water"
outlet.hose = { center = [0.2, 0.2, 0.2], axis = [1, 0, 0], radius = 0.09, speed = 2 }
[[emitter]]
fluid = "mist"
outlet.burst = { shape = { box = { min = [0.6, 0.1, 0.1], max = [0.75, 0.3, 0.3] } }, period = 0.03 }
[[sink]]
shape = { box = { min = [0.3, 0, 0], max = [0.4, 0.4, 0.4] } }
"#;

/// E31 on both: what comes and goes when depends on time alone; room has to be made for it on the way.
fn sources_and_sinks_agree() {
    let (mut cpu, mut gpu) = (World::from_scene(&scene(SOURCES)).unwrap(), on_gpu(SOURCES));
    for frame in 1..=5 {
        let until = 0.02 * f64::from(frame);
        cpu.run_to(until);
        assert_eq!(gpu.run_to(until), None, "{:?}", gpu.fault());
        let (a, b) = (cpu.ledger(), gpu.ledger());
        println!("{} {} born, {} {} drained, {} {} alive", a.born, b.born, a.drained, b.drained, a.fluid, b.fluid);
        assert_eq!((a.born, a.drained, a.fluid, a.left), (b.born, b.drained, b.fluid, b.left), "frame {frame}");
        assert!((a.momentum - b.momentum).length() < 1e-3 * a.momentum_scale, "{} {}", a.momentum, b.momentum);
    }
    assert!(gpu.ledger().born > 100 && gpu.ledger().drained > 50, "{:?}", gpu.ledger());
    assert!(gpu.momentum_residual() < 1e-4, "{}", gpu.momentum_residual());
    let alive = gpu.state().particles.count[0] as u64;
    assert_eq!(gpu.ledger().born, alive + gpu.ledger().drained + gpu.ledger().left);
}

/// E15: a paddle that swings pushes the water as it does on the CPU.
fn scripts_are_followed() {
    let text = format!(
        "{TANK}[[static]]\nname = \"paddle\"\nshape = {{ box = {{ min = [0.45, 0.05, 0.05], max = [0.5, 0.35, 0.6] }} }}\n\
         motion = {{ rotation = {{ center = [0.475, 0.2, 0.05], axis = [0, 1, 0], rate = 12 }} }}\n"
    );
    let (mut cpu, mut gpu) = (World::from_scene(&scene(&text)).unwrap(), on_gpu(&text));
    cpu.run_to(0.02);
    assert_eq!(gpu.run_to(0.02), None, "{:?}", gpu.fault());
    let (a, b) = (cpu.ledger(), gpu.ledger());
    assert!((a.momentum - b.momentum).length() < 2e-4 * a.momentum_scale, "{} {}", a.momentum, b.momentum);
    let paddle = |w: &World| w.state().bodies.body.iter().find(|b| b.name == "paddle").unwrap().q;
    assert!(paddle(&cpu).angle_between(paddle(&gpu)) < 1e-5);
}

/// A cube turns by omega t, though each step turns it by less than the last digit of its orientation.
fn slow_turns_are_not_rounded_away() {
    let text = "[world]\ngravity = [0, 0, 0]\n[domain]\nmin = [-1, -1, -1]\nmax = [1, 1, 1]\nwalls = [\"open\", \"open\", \"open\"]\n\
                [resolution]\nspacing = 0.1\n[solver]\ndt = 1e-3\n[[rigid]]\nname = \"cube\"\ndensity = 1000\nspin = [1e-5, 2e-5, 0]\n\
                shape = { box = { min = [-0.2, -0.2, -0.2], max = [0.2, 0.2, 0.2] } }\n\
                copies = { count = 1, random = { min = [-0.5, -0.5, -0.5], max = [0.5, 0.5, 0.5] }, tumble = true }\n";
    let mut w = on_gpu(text);
    let q = |w: &World| w.state().bodies.body[0].q;
    let begin = q(&w);
    assert_eq!(w.run_to(0.2), None, "{:?}", w.fault());
    let turned = (q(&w) * begin.conjugate()).xyz() * 2.0;
    let expected = 0.2 * glam::DVec3::new(1e-5, 2e-5, 0.0);
    assert!((turned - expected).length() < 1e-3 * expected.length(), "{turned}, not {expected}");
}

/// E20: a box thrown about its middle axis, with nothing acting on it. Whatever a step rounds away such a turn makes much of.
fn bodies_turn_as_in_double_precision() {
    let text = "[world]\ngravity = [0, 0, 0]\n[domain]\nmin = [-1, -1, -1]\nmax = [1, 1, 1]\nwalls = [\"open\", \"open\", \"open\"]\n\
                [resolution]\nspacing = 0.1\n[[rigid]]\nname = \"box\"\ndensity = 1000\nspin = [-0.01, 5, 0.01]\nvelocity = [0.1, 0.2, -0.3]\n\
                shape = { box = { min = [-0.1, -0.15, -0.3], max = [0.1, 0.15, 0.3] } }\n";
    let (mut cpu, mut gpu) = (World::from_scene(&scene(text)).unwrap(), on_gpu(text));
    for _ in 0..512 {
        let dt = 1.0 / 512.0; // the same in single precision
        cpu.step(dt);
        gpu.step(dt);
    }
    let (a, b) = (&cpu.state().bodies.body[0], &gpu.state().bodies.body[0]);
    let q = a.q.to_array().iter().zip(b.q.to_array()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    println!("x {:e}, q {q:e}, omega {:e}", (a.x - b.x).length(), (a.omega - b.omega).length());
    assert!((a.x - b.x).length() < 1e-12 && q < 1e-10 && (a.omega - b.omega).length() < 1e-9, "{a:?} {b:?}");
    assert!((a.l - b.l).length() < 1e-12 * a.l.length());
    assert!((cpu.ledger().kinetic - gpu.ledger().kinetic).abs() < 1e-11 * cpu.ledger().kinetic);
}

/// A device that is taken out ends a run with an error that names a remedy, not the program.
fn a_lost_device_is_said() {
    let assembly = scene(TANK).assemble().unwrap();
    let model = assembly.model.clone();
    let mut gpu = OnGpu::open(false).unwrap_or_else(|e| panic!("{e}"));
    gpu.upload(&model, assembly.state);
    gpu.lose();
    gpu.run(&[Stage::Ledger], &model, Advance::default());
    let fault = gpu.fault().expect("a fault");
    assert!(fault.to_string().contains("lost"), "{fault}");
    gpu.run(&[Stage::Density], &model, Advance::default());
    assert_eq!(Trouble::Device.to_string(), "the device failed");
}

/// Many short steps: a body thrown is where the parabola has it, for time does not get lost in rounding.
fn steps_add_up_to_a_frame() {
    let text = r#"
[domain]
min = [-1, -1, -9]
max = [4, 1, 9]
walls = ["open", "open", "open"]
[resolution]
spacing = 0.1
[solver]
dt = 3e-5
[[rigid]]
shape = { sphere = { center = [0, 0, 0], radius = 0.2 } }
density = 1000
velocity = [3, 0, 4]
"#;
    let mut w = on_gpu(text);
    for frame in 1..=4 {
        assert_eq!(w.run_to(0.05 * f64::from(frame)), None);
    }
    let t = 0.2;
    let body = &w.state().bodies.body[0];
    let expected = DVec3::new(3.0 * t, 0.0, 4.0 * t - 0.5 * 9.81 * t * t);
    println!("{} steps: off by {}", w.steps(), body.x - expected);
    assert!((body.x - expected).length() < 2e-6, "{} and {expected}", body.x);
    assert!((body.v.z - (4.0 - 9.81 * t)).abs() < 2e-6, "{}", body.v);
}

/// The built-in scenes, coarse, for twenty steps.
fn scenes_agree() {
    for (name, spacing) in [("monkey-splash", 0.045), ("mountain-slide", 0.06), ("dam-break", 0.06), ("school", 0.05)] {
        let scene = Scene::builtin(name, &[format!("resolution.spacing={spacing}"), "solver.pressure=wcsph".into()])
            .unwrap()
            .unwrap();
        let mut cpu = World::from_scene(&scene).unwrap();
        let mut gpu = gpu_world(scene.assemble().unwrap());
        let dt = 0.8 * cpu.model().largest_dt(cpu.ledger().speed, cpu.ledger().acceleration).0;
        for _ in 0..20 {
            cpu.step(dt);
            gpu.step(dt);
        }
        assert!(gpu.fault().is_none(), "{name}: {:?}", gpu.fault());
        let (a, b) = (cpu.ledger(), gpu.ledger());
        assert_eq!((a.fluid, b.lost, b.nonfinite), (b.fluid, 0, 0), "{name}");
        let energy = a.kinetic.abs().max(1e-3 * a.potential.abs());
        assert!((a.kinetic - b.kinetic).abs() < 1e-3 * energy, "{name}: {} {}", a.kinetic, b.kinetic);
        assert!((a.potential - b.potential).abs() < 1e-4 * a.potential.abs(), "{name}");
        let error = (a.momentum - b.momentum).length() / a.momentum_scale;
        println!("{name}: {} particles, momentum differs by {error:e}", cpu.state().particles.len());
        assert!(error < 1e-4, "{name}: {} {}", a.momentum, b.momentum);
    }
}

/// A body held, fluid poured and the hose moved, another gravity: on both backends the same comes of it.
fn a_hand_is_felt_alike() {
    let scene = scene(TANK);
    let hose = |x: f64, time: f64| scene.hose(DVec3::new(x, 0.2, 0.7), DVec3::NEG_Z, 0.06, 1.0, time).unwrap();
    let run = |mut world: World| {
        let on = |world: &mut World, until: f64| world.advance(until, |_, step| step.trouble.is_none());
        let to = world.state().bodies.body[0].x + DVec3::new(-0.05, 0.05, 0.1);
        world.grip(Some(Grip { body: 0, at: DVec3::new(0.02, 0.0, 0.0), to }));
        on(&mut world, 0.06);
        world.grip(None);
        world.pour(Some(hose(0.45, world.time())));
        on(&mut world, 0.15);
        world.pour(Some(hose(0.4, world.time())));
        on(&mut world, 0.24);
        world.pour(None);
        let calmer = scene.with(&["world.gravity=[0, 0, -2]".into()]).unwrap();
        world.take_over(calmer.assemble().unwrap()).map_err(|e| e.0).unwrap();
        on(&mut world, 0.28);
        assert!(world.fault().is_none(), "{:?}", world.fault());
        let body = world.state().bodies.body[0].clone();
        let poured = world.fluid().count();
        (body.x, poured, world.ledger().lost, world.ledger().born, world.momentum_residual())
    };
    let (cpu, gpu) = (run(World::from_scene(&scene).unwrap()), run(on_gpu(TANK)));
    assert!(cpu.0.distance(gpu.0) < 0.01, "{} {}", cpu.0, gpu.0);
    assert_eq!((cpu.1, cpu.2, cpu.3), (gpu.1, gpu.2, gpu.3));
    assert!(cpu.3 > 0 && gpu.4 < 0.02, "{cpu:?} {gpu:?}");
}
