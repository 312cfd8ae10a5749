//! Every stage alone against the CPU, from one state.

use crate::Test;
use crate::common::scene;
use crate::texts::{FLAT, HEAP, LAWS, TANK};
use glam::{DVec3, Vec3};
use jetsam::backend::{Backend, Cpu, OnGpu};
use jetsam::integrate::{Advance, bodies::follow};
use jetsam::scene::Pressure;
use jetsam::stage::Stage;
use jetsam::state::{Kind, Particles, State};
use jetsam::{World, state_hash};

/// The tests of this file.
pub const TESTS: &[Test] = &tests![
    stages_agree_in_a_tank_with_bodies,
    stages_agree_with_every_law,
    stages_agree_in_two_dimensions,
    stages_agree_in_a_heap,
    lists_without_room_are_walked
];

/// The largest difference of vectors, as a fraction of the largest size.
pub fn apart(a: &[[f32; 3]], b: &[[f32; 3]]) -> f32 {
    let size = a.iter().map(|v| Vec3::from(*v).length()).fold(1e-20, f32::max);
    a.iter().zip(b).map(|(a, b)| (Vec3::from(*a) - Vec3::from(*b)).length()).fold(0.0, f32::max) / size
}

/// The same for numbers.
pub fn apart_numbers(a: &[f32], b: &[f32]) -> f32 {
    let size = a.iter().map(|v| v.abs()).fold(1e-20, f32::max);
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) / size
}

/// The velocity of a fluid particle without what its accelerations of this step and of the one before have `added`.
fn less(p: &Particles, k: usize, added: impl Fn(Vec3, Vec3) -> Vec3) -> [f32; 3] {
    (Vec3::from(p.record[k].v) - added(p.push[k].into(), p.push_before[k].into())).to_array()
}

/// Compares what a stage of a step of `dt` (s) writes; bars are fractions of the largest value of a field. Accelerations have a bar of
/// their own, as pressures are small differences of densities: of velocities, what they add is left out, on both sides.
fn compare(stage: Stage, cpu: &State, gpu: &State, dt: f32, bar: f32) {
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
            of(&Kind::ALL[..1], &|s, k| less(&s.particles, k, |_, before| dt * before));
            of(&Kind::ALL[1..2], &|s, k| s.particles.record[k].v);
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
                let [a, b] = [cpu, gpu].map(|s| forces(s, kind));
                let d = apart(&a, &b);
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
            let longest = cpu.bodies.contacts.slipped().map(|s| Vec3::from(s.1).length()).fold(1e-20, f32::max);
            for (one, other) in [(cpu, gpu), (gpu, cpu)] {
                for ([a, b], slip) in one.bodies.contacts.slipped() {
                    let theirs = other.bodies.contacts.slip(a, b).unwrap_or_default();
                    let apart = (Vec3::from(slip) - Vec3::from(theirs)).length();
                    assert!(apart <= 200.0 * bar * longest, "slips of {a} and {b} differ by {apart} of {longest}");
                }
            }
        }
        Stage::Kick | Stage::Drift => {
            for (a, b) in cpu.bodies.body.iter().zip(&gpu.bodies.body).filter(|(a, _)| !a.is_static()) {
                assert!((a.x - b.x).length() < 1e-6 && (a.v - b.v).length() < 1e-4, "{}: {} {}", a.name, a.v, b.v);
                assert!((a.omega - b.omega).length() < 1e-3 * (1.0 + a.omega.length()), "{} {}", a.omega, b.omega);
            }
            if stage == Stage::Kick {
                of(&Kind::ALL[..1], &|s, k| less(&s.particles, k, |now, before| 0.5 * dt * (now + before)));
            }
        }
        _ => {}
    }
}

/// Forces on the particles of a kind (N; of fluids m/s^2), contacts included.
fn forces(s: &State, kind: Kind) -> Vec<[f32; 3]> {
    let all = s.forces_on_bodies();
    match kind {
        Kind::Fluid => s.particles.push[s.particles.segment(kind)].to_vec(),
        Kind::Rigid => all.take(s.particles.segment(kind).len()).collect(),
        Kind::Static => all.skip(s.particles.segment(Kind::Rigid).len()).collect(),
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
            cpu.run(&[stage], &model, advance);
            gpu.run(&[stage], &model, advance);
            assert!(gpu.fault().is_none(), "{:?}", gpu.fault());
            if stage != Stage::Drift || !evaluates {
                // some eighty roundings: sums of thirty pairs, in orders of their own
                compare(stage, cpu.download(), gpu.download(), advance.dt as f32, 5e-6);
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

/// Lists save a search and no more: without room in them, or with room for some particles' neighbours alone, every bit is the same.
fn lists_without_room_are_walked() {
    let implicit = format!("{TANK}\n[solver]\npressure = \"dfsph\"\n");
    for text in [TANK, FLAT, LAWS, &implicit] {
        let mut world = World::from_scene(&scene(text)).unwrap();
        let dt = (0..12).map(|_| world.step(f64::INFINITY).dt).last().unwrap();
        let (model, solver) = (world.model().clone(), world.model().solver.pressure);
        let hash = |room: Option<u32>| {
            let mut gpu = OnGpu::open(false).unwrap_or_else(|e| panic!("{e}"));
            room.into_iter().for_each(|room| gpu.allow_lists_of(room));
            gpu.upload(&model, world.state().clone());
            for _ in 0..3 {
                gpu.run(Stage::order(solver), &model, Advance { dt, dt_before: dt, ..Advance::default() });
            }
            assert!(gpu.fault().is_none(), "{:?}", gpu.fault());
            (state_hash(gpu.download()), gpu.ledger().neighbours)
        };
        let listed = hash(None);
        println!("{listed:?}");
        for room in [0, 10, 24] {
            assert_eq!(listed, hash(Some(room)), "room for {room}");
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
