//! The step on the GPU against the CPU: stage by stage from one state, whole scenes, and itself from run to run.
//!
//! Needs a device, if only Mesa's software driver; without one the tests show as ignored, and with `JETSAM_REQUIRE_GPU=1` in
//! the environment they fail.

mod common;

use common::{oracle, scene, space, stirred_assembly};
use glam::{DVec3, Vec3};
use jetsam::assemble::Assembly;
use jetsam::backend::{Backend, Choice, Cpu, OnGpu};
use jetsam::gpu::devices;
use jetsam::integrate::{Advance, bodies::follow};
use jetsam::scene::Pressure;
use jetsam::stage::Stage;
use jetsam::state::{Kind, Slips, State};
use jetsam::world::Grip;
use jetsam::{Scene, Trouble, World, state_hash};
use libtest_mimic::{Arguments, Trial, run};
use std::process::ExitCode;

fn main() -> ExitCode {
    let tests: [(&str, fn()); 34] = [
        ("stages_agree_in_a_tank_with_bodies", stages_agree_in_a_tank_with_bodies),
        ("stages_agree_with_every_law", stages_agree_with_every_law),
        ("stages_agree_in_two_dimensions", stages_agree_in_two_dimensions),
        ("stages_agree_in_a_heap", stages_agree_in_a_heap),
        ("a_hundred_steps_agree", a_hundred_steps_agree),
        ("same_bits_from_run_to_run", same_bits_from_run_to_run),
        ("queued_steps_are_steps", queued_steps_are_steps),
        ("sources_and_sinks_agree", sources_and_sinks_agree),
        ("scripts_are_followed", scripts_are_followed),
        ("slow_turns_are_not_rounded_away", slow_turns_are_not_rounded_away),
        ("a_hand_is_felt_alike", a_hand_is_felt_alike),
        ("a_lost_device_is_said", a_lost_device_is_said),
        ("steps_add_up_to_a_frame", steps_add_up_to_a_frame),
        ("scenes_agree", scenes_agree),
        ("steering_flocks_agree", steering_flocks_agree),
        ("noisy_flocks_agree", noisy_flocks_agree),
        ("topological_flocks_agree", topological_flocks_agree),
        ("fish_agree_in_water", fish_agree_in_water),
        ("implicit_stages_agree", implicit_stages_agree),
        ("a_hundred_implicit_steps_agree", a_hundred_implicit_steps_agree),
        (
            "implicit_rounds_end_at_the_tolerance_or_at_the_budget",
            implicit_rounds_end_at_the_tolerance_or_at_the_budget,
        ),
        ("implicit_momentum_is_exchanged_and_kept", implicit_momentum_is_exchanged_and_kept),
        ("implicit_momentum_is_impulse", implicit_momentum_is_impulse),
        ("an_implicit_tank_weighs_what_its_water_weighs", an_implicit_tank_weighs_what_its_water_weighs),
        ("implicit_steps_have_the_same_bits", implicit_steps_have_the_same_bits),
        ("the_default_scene_agrees", the_default_scene_agrees),
        ("joints_swing_and_hold", joints_swing_and_hold),
        ("a_chain_agrees", a_chain_agrees),
        ("oracle: a disturbed block in the open", || oracle::a_disturbed_block_in_the_open(gpu_world)),
        ("oracle: a periodic box", || oracle::a_periodic_box(gpu_world)),
        ("oracle: a box with walls and a body", || oracle::a_box_with_walls_and_a_body(gpu_world)),
        ("oracle: density integrated", || oracle::density_integrated(gpu_world)),
        ("oracle: neighbours on faces of cells and at the edge of the support", || {
            oracle::neighbours_on_faces_of_cells_and_at_the_edge_of_the_support(gpu_world)
        }),
        ("oracle: all particles in one cell", || oracle::all_particles_in_one_cell(gpu_world)),
    ];
    let absent = devices().is_empty();
    let required = std::env::var("JETSAM_REQUIRE_GPU").is_ok_and(|v| v == "1");
    let trial = |(name, test): (&'static str, fn())| {
        Trial::test(name, move || {
            test();
            Ok(())
        })
        .with_ignored_flag(absent && !required)
    };
    run(&Arguments::from_args(), tests.into_iter().map(trial).collect()).exit_code()
}

/// Water with boxes in it, that touch each other and the floor.
const TANK: &str = r#"
[domain]
min = [0, 0, 0]
max = [0.6, 0.4, 0.8]
[resolution]
spacing = 0.04
[[fluid]]
name = "water"
density = 1000
viscosity = 0.1
shape = { box = { min = [0, 0, 0], max = [0.6, 0.4, 0.3] } }
velocity = [0.3, 0.1, -0.2]
[[rigid]]
name = "light"
density = 400
shape = { box = { min = [0.1, 0.1, 0.1], max = [0.26, 0.26, 0.22] } }
spin = [1, 2, 3]
friction = 0.5
[[rigid]]
name = "on it"
density = 2000
shape = { box = { min = [0.14, 0.1, 0.225], max = [0.3, 0.26, 0.34] } }
velocity = [0.2, 0, -0.5]
friction = 0.3
"#;

/// Balls and bricks that lie on each other and rub.
const HEAP: &str = r#"
[domain]
min = [0, 0, 0]
max = [0.3, 0.16, 0.3]
[resolution]
spacing = 0.02
[solver]
sleep = 0
[[rigid]]
name = "ball"
shape = { points = [[0, 0, 0]] }
mass = 0.01
position = [0.02, 0.013, 0.011]
velocity = [0.3, 0.2, -0.1]
stiffness = 2000
copies = { count = 40, grid = { columns = [5, 4], step = [0.0217, 0.0193, 0.0195] } }
[[rigid]]
name = "brick"
shape = { box = { min = [0, 0, 0], max = [0.06, 0.06, 0.04] } }
density = 1500
position = [0.15, 0.03, 0.0]
velocity = [-0.3, 0.1, -0.1]
copies = { count = 3, grid = { columns = [1, 1], step = [0.05, 0.02, 0.041] } }
"#;

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

/// Periodic water and oil with everything that can be asked of pairs.
const LAWS: &str = r#"
[domain]
min = [0, 0, 0]
max = [0.4, 0.4, 0.6]
walls = ["periodic", "solid", "open"]
[resolution]
spacing = 0.04
[solver]
density = "continuity"
shifting = 1.0
xsph = 0.2
vorticity = 0.05
settle = 0.0
[[fluid]]
name = "water"
density = 1000
viscosity = 0.5
surface_tension = 0.07
shape = { box = { min = [0, 0, 0.1], max = [0.4, 0.4, 0.3] } }
velocity = [0.4, 0.1, -0.2]
[[fluid]]
name = "oil"
density = 800
viscosity = 2
surface_tension = 0.03
shape = { box = { min = [0, 0, 0.3], max = [0.4, 0.4, 0.4] } }
velocity = [-0.4, 0.1, 0.2]
[[force]]
vortex = { center = [0.2, 0.2, 0.2], axis = [0, 0, 1], speed = 1.0, core = 0.1, rate = 2.0 }
[[force]]
point = { center = [0.2, 0.2, 0.5], strength = 0.1, core = 0.2 }
"#;

const FLAT: &str = r#"
[world]
dimensions = 2
[domain]
min = [0, 0, 0]
max = [1.0, 0, 0.8]
[resolution]
spacing = 0.025
[[fluid]]
name = "water"
viscosity = 0.1
shape = { box = { min = [0, 0, 0], max = [0.5, 0, 0.4] } }
[[rigid]]
name = "box"
density = 500
shape = { box = { min = [0.6, 0, 0.001], max = [0.8, 0, 0.2] } }
spin = [0, 2, 0]
"#;

/// The largest difference of vectors, as a fraction of the largest size.
fn apart(a: &[[f32; 3]], b: &[[f32; 3]]) -> f32 {
    let size = a.iter().map(|v| Vec3::from(*v).length()).fold(1e-20, f32::max);
    a.iter().zip(b).map(|(a, b)| (Vec3::from(*a) - Vec3::from(*b)).length()).fold(0.0, f32::max) / size
}

/// The same for numbers.
fn apart_numbers(a: &[f32], b: &[f32]) -> f32 {
    let size = a.iter().map(|v| v.abs()).fold(1e-20, f32::max);
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) / size
}

/// Compares what a stage writes; bars are fractions of the largest value of a field.
fn compare(stage: Stage, cpu: &State, gpu: &State, bar: f32) {
    let (a, b) = (&cpu.particles, &gpu.particles);
    assert_eq!(a.count, b.count, "{stage:?}: counts");
    let of = |kinds: &[Kind], what: &dyn Fn(&State, usize) -> [f32; 3]| {
        for &kind in kinds {
            let range = a.segment(kind);
            let pick = |state: &State| range.clone().map(|k| what(state, k)).collect::<Vec<_>>();
            let d = apart(&pick(cpu), &pick(gpu));
            assert!(d <= bar, "{stage:?}: {kind:?} differ by {d} of the largest");
        }
    };
    let fluid = a.segment(Kind::Fluid);
    match stage {
        Stage::Cells => {
            for kind in Kind::ALL {
                let range = a.segment(kind);
                if kind != Kind::Static {
                    assert_eq!(a.id[range.clone()], b.id[range.clone()], "{stage:?}: order of {kind:?}");
                    assert_eq!(a.owner[range.clone()], b.owner[range.clone()], "{stage:?}");
                }
            }
            of(&Kind::ALL[..2], &|s, k| s.particles.record[k].x);
            of(&Kind::ALL[..2], &|s, k| s.particles.record[k].v);
        }
        Stage::Pressure | Stage::Boundary => {
            let d = apart_numbers(&a.density[fluid.clone()], &b.density[fluid]);
            assert!(d <= bar, "densities differ by {d}");
            let kinds = if stage == Stage::Pressure { &Kind::ALL[..1] } else { &Kind::ALL[1..] };
            // pressures are small differences of densities: c^2 makes much of little
            let size = a.record.iter().map(|r| r.share.abs()).fold(1e-20, f32::max);
            for &kind in kinds {
                for k in a.segment(kind) {
                    let d = (a.record[k].share - b.record[k].share).abs() / size;
                    assert!(d <= 100.0 * bar, "{stage:?}: {kind:?} {k} differ by {d}");
                }
            }
        }
        Stage::Gradients if !a.gradient.is_empty() => {
            of(&Kind::ALL[..1], &|s, k| s.particles.vorticity[k]);
            of(&Kind::ALL[..1], &|s, k| [0, 1, 2].map(|c| s.particles.gradient[k][c]));
        }
        Stage::Forces => {
            for &kind in &Kind::ALL {
                let range = a.segment(kind);
                let d = apart(&a.push[range.clone()], &b.push[range]);
                assert!(d <= 200.0 * bar, "forces on {kind:?} differ by {d} of the largest");
            }
            if !a.carry.is_empty() {
                let of = |s: &State| fluid.clone().map(|k| s.particles.carry[k][3]).collect::<Vec<_>>();
                assert!(apart_numbers(&of(cpu), &of(gpu)) <= 100.0 * bar, "rates of density");
                let of =
                    |s: &State| fluid.clone().map(|k| [0, 1, 2].map(|c| s.particles.carry[k][c])).collect::<Vec<_>>();
                assert!(apart(&of(cpu), &of(gpu)) <= 100.0 * bar, "carried velocities");
            }
        }
        Stage::Bodies => {
            let scale =
                cpu.bodies.body.iter().filter(|b| !b.is_static()).map(|b| b.force.length()).fold(1e-20, f64::max);
            for (a, b) in cpu.bodies.body.iter().zip(&gpu.bodies.body) {
                assert_eq!(a.contacts, b.contacts, "contacts of {}", a.name);
                let bar = 200.0 * f64::from(bar) * if a.is_static() { a.force.length().max(scale) } else { scale };
                for (what, a, b) in [("force", a.force, b.force), ("fluid", a.force_fluid, b.force_fluid)] {
                    assert!((a - b).length() <= bar, "{what}: {a} and {b}, {bar}");
                }
                assert!((a.torque - b.torque).length() <= bar, "torque: {} and {}", a.torque, b.torque);
            }
            let slips = cpu.bodies.slips.iter().flat_map(|s| s.slip).map(|s| Vec3::from(s).length());
            let longest = slips.fold(1e-20, f32::max);
            for (a, b) in cpu.bodies.slips.iter().zip(&gpu.bodies.slips) {
                for k in (0..a.with.len()).filter(|&k| a.with[k] != Slips::NONE) {
                    let theirs = b.of(a.with[k]).unwrap_or_else(|| panic!("no slip is kept for slot {}", a.with[k]));
                    let apart = (Vec3::from(a.slip[k]) - Vec3::from(theirs)).length();
                    assert!(apart <= 200.0 * bar * longest, "slips differ by {apart} of {longest}");
                }
                assert_eq!(a.with.contains(&Slips::NONE), b.with.contains(&Slips::NONE));
            }
        }
        Stage::Kick | Stage::Drift => {
            for (a, b) in cpu.bodies.body.iter().zip(&gpu.bodies.body).filter(|(a, _)| !a.is_static()) {
                assert!((a.x - b.x).length() < 1e-6 && (a.v - b.v).length() < 1e-4, "{}: {} {}", a.name, a.v, b.v);
                assert!((a.omega - b.omega).length() < 1e-3 * (1.0 + a.omega.length()), "{} {}", a.omega, b.omega);
            }
            if stage == Stage::Kick {
                of(&Kind::ALL[..1], &|s, k| s.particles.record[k].v);
            }
        }
        _ => {}
    }
}

/// Runs `before` steps on the CPU, then one step on both from the state reached, stage by stage.
fn stages_agree(text: &str, before: usize) {
    let mut world = World::from_scene(&scene(text)).unwrap();
    let mut dt = 0.0;
    for _ in 0..before {
        dt = world.step(f64::INFINITY).dt;
    }
    let model = world.model().clone();
    let mut start = world.state().clone();
    follow(&mut start.bodies, &model);
    let mut cpu = Cpu::default();
    let mut gpu = OnGpu::open(false).unwrap_or_else(|e| panic!("{e}"));
    cpu.upload(&model, start.clone());
    gpu.upload(&model, start);
    // both begin by evaluating forces where they stand; then the step
    let rest = Advance { time: world.time(), ..Advance::default() };
    let step = Advance { time: world.time(), dt, dt_before: dt, drag: 0.0, parts: 1 };
    for (advance, evaluates) in [(rest, true), (step, false)] {
        for stage in Stage::WCSPH.into_iter().filter(|s| !evaluates || s.evaluates(Pressure::Wcsph)) {
            cpu.run(stage, &model, advance);
            gpu.run(stage, &model, advance);
            assert!(gpu.fault().is_none(), "{:?}", gpu.fault());
            if stage != Stage::Drift || !evaluates {
                compare(stage, cpu.download(), gpu.download(), 5e-6);
            }
        }
        let (a, b) = (cpu.ledger(), gpu.ledger());
        let near = |what: &str, a: f64, b: f64, scale: f64| {
            assert!((a - b).abs() <= 1e-4 * scale.abs().max(1e-12), "{what}: {a} and {b}");
        };
        assert_eq!((a.fluid, a.lost, a.left, a.nonfinite), (b.fluid, b.lost, b.left, b.nonfinite));
        near("speed", a.speed, b.speed, a.speed);
        near("body speed", a.body_speed, b.body_speed, a.body_speed);
        near("acceleration", a.acceleration, b.acceleration, 10.0 * a.acceleration);
        near("kinetic", a.kinetic, b.kinetic, a.kinetic);
        near("potential", a.potential, b.potential, a.potential);
        near("neighbours", a.neighbours, b.neighbours, a.neighbours);
        near("density error", a.density_error_mean, b.density_error_mean, 0.01);
        let vectors = [
            ("momentum", a.momentum, b.momentum, a.momentum_scale),
            ("total force", a.total_force, b.total_force, a.force_scale),
            ("external force", a.external_force, b.external_force, a.force_scale),
        ];
        for (what, a, b, scale) in vectors {
            near(what, DVec3::distance(a, b), 0.0, 10.0 * scale);
        }
    }
}

fn stages_agree_in_a_tank_with_bodies() {
    stages_agree(TANK, 40);
}

fn stages_agree_with_every_law() {
    stages_agree(LAWS, 10);
}

fn stages_agree_in_two_dimensions() {
    stages_agree(FLAT, 60);
}

fn stages_agree_in_a_heap() {
    stages_agree(HEAP, 150);
}

fn gpu_world(assembly: Assembly) -> World {
    World::choose(Choice::Gpu, assembly).unwrap_or_else(|e| panic!("{e}")).0
}

fn on_gpu(text: &str) -> World {
    gpu_world(scene(text).assemble().unwrap())
}

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

/// A device that is taken out ends a run with an error that names a remedy, not the program.
fn a_lost_device_is_said() {
    let assembly = scene(TANK).assemble().unwrap();
    let model = assembly.model.clone();
    let mut gpu = OnGpu::open(false).unwrap_or_else(|e| panic!("{e}"));
    gpu.upload(&model, assembly.state);
    gpu.lose();
    gpu.run(Stage::Ledger, &model, Advance::default());
    let fault = gpu.fault().expect("a fault");
    assert!(fault.to_string().contains("lost"), "{fault}");
    gpu.run(Stage::Density, &model, Advance::default());
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

const IMPLICIT: [&str; 2] = ["dfsph", "pbf"];

/// A scene with a solver that makes so many rounds, no more and no less.
fn with_rounds(text: &str, solver: &str, rounds: u32) -> String {
    format!(
        "{text}\n[solver]\npressure = \"{solver}\"\niterations = {rounds}\ntolerance = 1e-6\ndivergence_tolerance = 1e-6\n"
    )
}

/// E9, stage by stage from one state, with as many rounds on both.
fn implicit_stages_agree() {
    for (text, solver, before) in [(TANK, "dfsph", 12), (TANK, "pbf", 12), (FLAT, "dfsph", 20), (FLAT, "pbf", 20)] {
        implicit_stages_agree_in(&with_rounds(text, solver, 10), before);
    }
}

fn implicit_stages_agree_in(text: &str, before: usize) {
    let mut world = World::from_scene(&scene(text)).unwrap();
    let mut dt = 0.0;
    for _ in 0..before {
        dt = world.step(f64::INFINITY).dt;
    }
    let model = world.model().clone();
    let mut start = world.state().clone();
    follow(&mut start.bodies, &model);
    let mut cpu = Cpu::default();
    let mut gpu = OnGpu::open(false).unwrap_or_else(|e| panic!("{e}"));
    cpu.upload(&model, start.clone());
    gpu.upload(&model, start);
    let rest = Advance { time: world.time(), ..Advance::default() };
    let parts = model.substeps(dt, world.ledger().body_speed);
    assert!(parts > 1, "bodies have steps of their own");
    let step = Advance { time: world.time(), dt, dt_before: dt, drag: 0.0, parts };
    let solver = model.solver.pressure;
    for (advance, evaluates) in [(rest, true), (step, false)] {
        for &stage in Stage::order(solver).iter().filter(|s| !evaluates || s.evaluates(solver)) {
            cpu.run(stage, &model, advance);
            gpu.run(stage, &model, advance);
            assert!(gpu.fault().is_none(), "{:?}", gpu.fault());
            compare_implicit(stage, cpu.download(), gpu.download());
        }
        let (a, b) = (cpu.ledger(), gpu.ledger());
        assert_eq!(a.pressure.iterations, b.pressure.iterations);
        assert_eq!(a.divergence.iterations, b.divergence.iterations);
        assert_eq!((a.fluid, a.lost, a.left, a.put_back), (b.fluid, b.lost, b.left, b.put_back));
        // of PBF's turns the CPU keeps the lists of neighbours, the GPU looks anew
        let bar = if solver == Pressure::Pbf { 1e-3 } else { 1e-4 };
        let near = |what: &str, a: f64, b: f64, scale: f64| {
            assert!((a - b).abs() <= bar * scale.abs().max(1e-12), "{what}: {a} and {b}");
        };
        near("residual of places", a.pressure.residual, b.pressure.residual, 0.1);
        near("residual of velocities", a.divergence.residual, b.divergence.residual, 0.1);
        near("speed by pressure", a.pressed, b.pressed, 10.0 * a.pressed);
        near("speed", a.speed, b.speed, 10.0 * a.speed);
        near("kinetic", a.kinetic, b.kinetic, a.kinetic);
        near("potential", a.potential, b.potential, a.potential);
        for (what, a, b, scale) in [
            ("momentum", a.momentum, b.momentum, a.momentum_scale),
            ("impulse from outside", a.external_impulse, b.external_impulse, a.momentum_scale),
        ] {
            near(what, DVec3::distance(a, b), 0.0, scale);
        }
    }
}

/// Fluids and bodies after a stage of implicit pressure; bars are fractions of the largest value of a field. The CPU keeps vectors to
/// neighbours in sixteen bits while it iterates, the GPU makes them anew.
fn compare_implicit(stage: Stage, cpu: &State, gpu: &State) {
    let (a, b) = (&cpu.particles, &gpu.particles);
    assert_eq!(a.count, b.count, "{stage:?}: counts");
    let fluid = a.segment(Kind::Fluid);
    let of = |what: &str, bar: f32, pick: &dyn Fn(&State, usize) -> [f32; 3]| {
        let all = |s: &State| fluid.clone().map(|k| pick(s, k)).collect::<Vec<_>>();
        let d = apart(&all(cpu), &all(gpu));
        assert!(d <= bar, "{stage:?}: {what} differ by {d} of the largest");
    };
    match stage {
        Stage::Kick | Stage::Divergence => of("velocities", 1e-3, &|s, k| s.particles.record[k].v),
        Stage::Cells => {
            assert_eq!(a.id[fluid.clone()], b.id[fluid.clone()], "order");
            of("places", 1e-5, &|s, k| s.particles.record[k].x);
        }
        Stage::Pressure => {
            of("places", 1e-5, &|s, k| s.particles.record[k].x);
            of("velocities", 1e-3, &|s, k| s.particles.record[k].v);
            of("shares", 1e-2, &|s, k| [s.particles.record[k].share, 0.0, 0.0]);
        }
        // after PBF has moved particles the CPU keeps its lists of neighbours, the GPU looks anew
        Stage::Forces => of("forces", 2e-2, &|s, k| s.particles.push[k]),
        _ => {}
    }
    if matches!(stage, Stage::Kick | Stage::Divergence | Stage::Pressure | Stage::Drift | Stage::Bodies) {
        let moving = cpu.bodies.body.iter().zip(&gpu.bodies.body).filter(|(a, _)| !a.is_static());
        for (a, b) in moving {
            assert!((a.x - b.x).length() < 1e-5, "{stage:?}, {}: at {} and {}", a.name, a.x, b.x);
            assert!((a.v - b.v).length() < 1e-3, "{stage:?}, {}: {} and {} m/s", a.name, a.v, b.v);
            assert!((a.omega - b.omega).length() < 5e-3 * (1.0 + a.omega.length()), "{stage:?}, {}", a.name);
            let scale = a.force_fluid.length().max(a.mass * 9.81);
            let d = (a.force_fluid - b.force_fluid).length();
            assert!(d < 5e-3 * scale, "{stage:?}, {}: {} and {} N by fluids", a.name, a.force_fluid, b.force_fluid);
        }
    }
}

/// A hundred steps of equal length and rounds: energies, momentum and bodies. PBF's particles hop at random: of it fewer.
fn a_hundred_implicit_steps_agree() {
    for (solver, steps) in [("dfsph", 100), ("pbf", 30)] {
        let text = with_rounds(FLAT, solver, 8);
        let (mut cpu, mut gpu) = (World::from_scene(&scene(&text)).unwrap(), on_gpu(&text));
        for step in 1..=steps {
            cpu.step(1e-3);
            gpu.step(1e-3);
            if step % 10 == 0 {
                let (a, b) = (cpu.ledger(), gpu.ledger());
                println!("{solver} {step}: {:e}", (a.momentum - b.momentum).length() / a.momentum_scale);
            }
        }
        let (a, b) = (cpu.ledger(), gpu.ledger());
        assert_eq!((a.fluid, a.lost, b.lost), (b.fluid, 0, 0));
        for (what, x, y) in [("kinetic", a.kinetic, b.kinetic), ("potential", a.potential, b.potential)] {
            assert!((x - y).abs() <= 1e-4 * (a.kinetic + a.potential), "{solver}, {what}: {x} and {y}");
        }
        assert!(
            (a.momentum - b.momentum).length() <= 1e-3 * a.momentum_scale,
            "{solver}: {} {}",
            a.momentum,
            b.momentum
        );
        let (a, b) = (&cpu.state().bodies.body[0], &gpu.state().bodies.body[0]);
        assert!((a.x - b.x).length() < 1e-4, "{solver}: {} and {}", a.x, b.x);
        assert!(gpu.momentum_residual() < 1e-4, "{solver}: {}", gpu.momentum_residual());
    }
}

/// More rounds than were queued are asked for, and made; no more than the budget.
fn implicit_rounds_end_at_the_tolerance_or_at_the_budget() {
    for solver in IMPLICIT {
        let dam = |more: &str| {
            on_gpu(&format!(
                "[world]\ndimensions = 2\n[domain]\nmin = [0, 0, 0]\nmax = [1, 0, 1]\n[resolution]\nspacing = 0.05\n\
                 [solver]\npressure = \"{solver}\"\n{more}\n\
                 [[fluid]]\nshape = {{ box = {{ min = [0, 0, 0], max = [0.5, 0, 0.5] }} }}\n"
            ))
        };
        let mut w = dam("iterations = 1000\ntolerance = 0.0005\ndivergence_tolerance = 0.0005");
        let mut most = 0;
        w.advance(0.05, |w, _| {
            let (p, d) = (w.ledger().pressure, w.ledger().divergence);
            let slack = if solver == "pbf" { 1.1 } else { 1.0 };
            assert!(p.residual <= slack * 0.0005 && d.residual <= 0.0005, "{solver}: {p:?} {d:?}");
            most = most.max(p.iterations).max(d.iterations);
            true
        });
        assert!(most > 8 && most < 1000, "{solver}: {most} rounds");
        let mut w = dam("iterations = 2\ntolerance = 1e-6\ndivergence_tolerance = 1e-6");
        w.advance(0.05, |w, _| {
            let (p, d) = (w.ledger().pressure, w.ledger().divergence);
            assert!(p.iterations <= 2 && d.iterations <= 2, "{solver}: {p:?} {d:?}");
            true
        });
        assert_eq!((w.ledger().lost, w.fault().is_none()), (0, true));
    }
}

/// C9: what fluids gain bodies lose.
fn implicit_momentum_is_exchanged_and_kept() {
    for solver in IMPLICIT {
        let mut w = gpu_world(stirred_assembly(2, &format!("pressure = \"{solver}\"")));
        let (start, scale) = (w.ledger().momentum, w.ledger().momentum_scale);
        let before: Vec<DVec3> = w.state().bodies.body.iter().map(|b| b.v).collect();
        for _ in 0..20 {
            w.step(f64::INFINITY);
        }
        let drift = (w.ledger().momentum - start).length() / scale;
        println!("{solver}: momentum drifts by {drift:e}, residual {:e}", w.momentum_residual());
        assert!(drift <= 1e-5 && w.momentum_residual() <= 1e-5, "{solver}: {drift} {}", w.momentum_residual());
        let pushed = w.state().bodies.body.iter().zip(&before).all(|(b, v)| (b.v - *v).length() > 1e-3);
        assert!(pushed, "{solver}: the bodies feel nothing");
    }
}

/// C9 with gravity, walls and a body that floats.
fn implicit_momentum_is_impulse() {
    for solver in IMPLICIT {
        let mut w = on_gpu(&format!(
            "[domain]\nmin = [0, 0, 0]\nmax = [0.6, 0.3, 0.5]\n[resolution]\nspacing = 0.05\n\
             [solver]\npressure = \"{solver}\"\n\
             [[fluid]]\nshape = {{ box = {{ min = [0, 0, 0], max = [0.25, 0.3, 0.3] }} }}\n\
             [[rigid]]\nshape = {{ sphere = {{ center = [0, 0, 0], radius = 0.08 }} }}\ndensity = 700\nposition = [0.45, 0.15, 0.1]\n"
        ));
        w.advance(0.2, |_, _| true);
        println!("{solver}: residual {:e} after {} steps", w.momentum_residual(), w.steps());
        assert!(w.momentum_residual() <= 1e-5, "{solver}: {}", w.momentum_residual());
        assert_eq!((w.ledger().lost, w.ledger().rigid_lost), (0, 0));
    }
}

/// The floor of a tank at rest bears the weight of its water.
fn an_implicit_tank_weighs_what_its_water_weighs() {
    for solver in IMPLICIT {
        let mut w = on_gpu(&format!(
            "[world]\ndimensions = 2\n[domain]\nmin = [0, 0, 0]\nmax = [0.5, 0, 1]\n[resolution]\nspacing = 0.025\n\
             [solver]\npressure = \"{solver}\"\n\
             [[fluid]]\nshape = {{ box = {{ min = [0, 0, 0], max = [0.5, 0, 0.3] }} }}\n"
        ));
        w.run_to(0.5);
        let (walls, mut force, begin) = (w.state().bodies.body.len() - 1, 0.0, w.time());
        w.advance(0.9, |w, step| {
            force += step.dt * w.state().bodies.body[walls].force_fluid.z;
            true
        });
        let (force, weight) = (force / (w.time() - begin), 9.81 * 1000.0 * 0.5 * 0.3);
        println!("{solver}: {force} N, {weight} N expected");
        assert!((force / weight + 1.0).abs() < 0.02, "{solver}: {force} N on the floor, not {weight}");
        assert!(w.ledger().density_error_mean < 0.01 && w.ledger().lost == 0, "{solver}: {:?}", w.ledger());
    }
}

fn implicit_steps_have_the_same_bits() {
    for solver in IMPLICIT {
        let text = format!("{TANK}\n[solver]\npressure = \"{solver}\"\n");
        let hash = || {
            let mut w = on_gpu(&text);
            assert_eq!(w.run_to(0.03), None);
            (state_hash(w.state()), w.steps())
        };
        assert_eq!(hash(), hash(), "{solver}");
    }
}

/// The scene that a plain `jetsam run` makes, as it is but coarse.
fn the_default_scene_agrees() {
    let scene = Scene::builtin("monkey-splash", &["resolution.spacing=0.045".into()]).unwrap().unwrap();
    let mut cpu = World::from_scene(&scene).unwrap();
    assert!(cpu.model().implicit());
    let mut gpu = gpu_world(scene.assemble().unwrap());
    cpu.run_to(0.04);
    assert_eq!(gpu.run_to(0.04), None, "{:?}", gpu.fault());
    let (a, b) = (cpu.ledger(), gpu.ledger());
    println!("{} and {} steps, {:?} {:?}", cpu.steps(), gpu.steps(), cpu.solves(), gpu.solves());
    assert_eq!((a.fluid, b.lost, b.nonfinite), (b.fluid, 0, 0));
    assert!((a.kinetic - b.kinetic).abs() < 2e-3 * a.kinetic, "{} {}", a.kinetic, b.kinetic);
    assert!((a.potential - b.potential).abs() < 1e-4 * a.potential, "{} {}", a.potential, b.potential);
    assert!((a.momentum - b.momentum).length() < 2e-3 * a.momentum_scale, "{} {}", a.momentum, b.momentum);
    assert!(gpu.momentum_residual() < 1e-4, "{}", gpu.momentum_residual());
}

/// E32: a bar let go level from a ball joint or a hinge swings as the CPU's does, keeps its energy and its end.
fn joints_swing_and_hold() {
    for kind in ["ball", "hinge"] {
        let text = space(0.6, 0.05, 1e-3).replace("[0, 0, 0]", "[0, 0, -9.81]")
            + &format!(
                "[[rigid]]\nname = \"bar\"\nshape = {{ box = {{ min = [0, -0.05, -0.05], max = [0.4, 0.05, 0.05] }} }}\ndensity = 1000\n\
                 [[joint]]\nkind = \"{kind}\"\na = \"bar\"\nanchor = [0, 0, 0]\naxis = [0, 1, 0]\n"
            );
        let (mut cpu, mut gpu) = (World::from_scene(&scene(&text)).unwrap(), on_gpu(&text));
        let energy = |w: &World| w.ledger().kinetic + w.ledger().potential;
        let scale = gpu.state().bodies.body[0].mass * 9.81 * 0.2;
        let begin = energy(&gpu);
        for quarter in 1..=4 {
            cpu.run_to(0.25 * f64::from(quarter));
            assert_eq!(gpu.run_to(0.25 * f64::from(quarter)), None);
            let (a, b) = (&cpu.state().bodies.body[0], &gpu.state().bodies.body[0]);
            let gap = (b.x + b.q * DVec3::new(-0.2, 0.0, 0.0)).length();
            let drift = (energy(&gpu) - begin).abs() / scale;
            println!("{kind}: {} m apart, gap {gap:e} m, energy {drift:e}", (a.x - b.x).length());
            assert!((a.x - b.x).length() < 1e-4 && gap < 1e-6 && drift < 1e-4, "{kind}: {} {}", a.x, b.x);
        }
        assert!(gpu.momentum_residual() < 1e-3, "{}", gpu.momentum_residual());
    }
}

/// E32: a chain in space of all kinds of joints keeps its momenta and its links; a stop of a hinge holds; springs pull.
fn a_chain_agrees() {
    let mut text = space(1.4, 0.1, 1e-3);
    for k in 0..5 {
        let v = if k == 4 { "velocity = [0.3, 0.5, 1.0]\nspin = [1, 2, 3]" } else { "" };
        text += &format!(
            "[[rigid]]\nname = \"link{k}\"\nshape = {{ box = {{ min = [-0.1, -0.05, -0.05], max = [0.1, 0.05, 0.05] }} }}\n\
             density = 500\nposition = [{}, 0, 0]\n{v}\n",
            0.2 * f64::from(k)
        );
    }
    for k in 0..4 {
        let kind = ["ball", "hinge", "ball", "fixed"][k];
        text += &format!(
            "[[joint]]\nkind = \"{kind}\"\na = \"link{k}\"\nb = \"link{}\"\nanchor = [{}, 0, 0]\naxis = [0, 1, 0]\nlimits = [-5, 5]\n",
            k + 1,
            0.2 * k as f64 + 0.1
        );
    }
    text += "[[joint]]\nkind = \"spring\"\na = \"link0\"\nb = \"link2\"\nanchor = [0, 0, 0.05]\nanchor_b = [0.4, 0, 0.05]\n\
             stiffness = 5\ndamping = 0.1\nlength = 0.3\n";
    let (mut cpu, mut gpu) = (World::from_scene(&scene(&text)).unwrap(), on_gpu(&text));
    let momenta = |w: &World| {
        let b = &w.state().bodies.body;
        let p: DVec3 = b.iter().map(|b| b.mass * b.v).sum();
        (p, b.iter().map(|b| b.l + b.x.cross(b.mass * b.v)).sum::<DVec3>())
    };
    gpu.step(1e-3);
    let (p_0, l_0) = momenta(&gpu);
    assert_eq!(gpu.run_to(0.4), None);
    cpu.run_to(0.4);
    let (p, l) = momenta(&gpu);
    println!("momentum {:e}, angular {:e}", (p - p_0).length() / p_0.length(), (l - l_0).length() / l_0.length());
    assert!((p - p_0).length() < 1e-5 * p_0.length() && (l - l_0).length() < 1e-4 * l_0.length());
    let (a, b) = (&cpu.state().bodies.body, &gpu.state().bodies.body);
    for k in 0..4 {
        let ends = b[k].x + b[k].q * (0.1 * DVec3::X) - (b[k + 1].x - b[k + 1].q * (0.1 * DVec3::X));
        println!("joint {k}: gap {:e}; {:e} m apart", ends.length(), (a[k].x - b[k].x).length());
        assert!(ends.length() < 2e-6, "joint {k} opens by {}", ends.length());
        assert!((a[k].x - b[k].x).length() < 1e-3, "{} {}", a[k].x, b[k].x);
    }
    assert!((b[1].q * DVec3::Y).cross(b[2].q * DVec3::Y).length() < 1e-5);
    assert!((b[3].q.inverse() * b[4].q).to_scaled_axis().length() < 1e-5);
}
