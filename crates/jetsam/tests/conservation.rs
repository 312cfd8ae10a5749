//! What is conserved, step by step, and what does not depend on threads.

mod common;

use common::{scene, stirred, world};
use glam::DVec3;
use jetsam::World;
use jetsam::state::Kind;

#[test]
fn action_is_reaction_at_every_step() {
    for (dimensions, steps) in [(2, 400), (3, 150)] {
        for coupling in ["pressure", "spring"] {
            let mut w = stirred(dimensions, &format!("sound_speed = 20\ncoupling = \"{coupling}\""));
            let start = w.ledger().momentum;
            for step in 0..steps {
                w.step(f64::INFINITY);
                let l = w.ledger();
                let sum = l.total_force.length() / l.force_scale;
                assert!(sum <= 1e-6, "{dimensions}D {coupling}, step {step}: forces sum to {sum}");
                assert!(l.force_scale > 0.0 && l.nonfinite == 0);
            }
            let l = w.ledger();
            let drift = (l.momentum - start).length() / l.momentum_scale;
            assert!(drift <= 1e-5, "{dimensions}D {coupling}: momentum drifts by {drift}");
            assert!(w.momentum_residual() <= 1e-5);
        }
    }
}

#[test]
fn forces_between_fluid_and_bodies_cancel() {
    // C9: force on the fluid by the bodies + force on the bodies by the fluid = 0; fluid-fluid pairs cancel alone
    let mut w = stirred(3, "sound_speed = 20");
    for _ in 0..20 {
        w.step(f64::INFINITY);
        let s = w.state();
        let mass = f64::from(w.model().fluids[0].mass);
        let on_fluid: DVec3 =
            s.particles.segment(Kind::Fluid).map(|i| mass * DVec3::from(s.particles.push[i].map(f64::from))).sum();
        let on_bodies: DVec3 = s.bodies.body.iter().map(|b| b.force).sum();
        let scale: f64 = s.bodies.body.iter().map(|b| b.force.length()).sum();
        assert!(scale > 1.0, "the bodies feel nothing");
        assert!((on_fluid + on_bodies).length() <= 1e-6 * w.ledger().force_scale);
    }
}

#[test]
fn momentum_is_impulse_with_gravity_and_walls() {
    // d(P)/dt = sum of wall forces + M g, to 1e-5 of the sum of |p|
    let mut w = world(
        "[domain]\nmin = [0, 0, 0]\nmax = [0.6, 0.3, 0.5]\n[resolution]\nspacing = 0.025\n\
         [[fluid]]\nshape = { box = { min = [0, 0, 0], max = [0.25, 0.3, 0.3] } }\n\
         [[rigid]]\nshape = { sphere = { center = [0, 0, 0], radius = 0.06 } }\ndensity = 700\nposition = [0.45, 0.15, 0.1]\n",
    );
    w.advance(0.3, |_, _| true);
    assert!(w.momentum_residual() <= 1e-5, "{}", w.momentum_residual());
    assert_eq!((w.ledger().lost, w.ledger().rigid_lost), (0, 0));
}

#[test]
fn the_same_bits_for_any_number_of_threads() {
    for (solver, steps) in [("wcsph", 300), ("dfsph", 60), ("pbf", 60)] {
        same_bits(solver, steps);
    }
}

fn same_bits(solver: &str, steps: usize) {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut w = world(&format!(
                "[domain]\nmin = [0, 0, 0]\nmax = [0.6, 0.3, 0.6]\n[resolution]\nspacing = 0.025\n\
                 [solver]\nxsph = 0.1\npressure = \"{solver}\"\n\
                 [[fluid]]\nshape = {{ box = {{ min = [0, 0, 0], max = [0.3, 0.3, 0.3] }} }}\n\
                 [[rigid]]\nshape = {{ box = {{ min = [-0.05, -0.05, -0.05], max = [0.05, 0.05, 0.05] }} }}\ndensity = 500\n\
                 position = [0.1, 0.1, 0.42]\ncopies = {{ count = 4, grid = {{ columns = [4, 1], step = [0.13, 0, 0] }}, tumble = true }}\n"
            ));
            for _ in 0..steps {
                w.step(f64::INFINITY);
            }
            let s = w.state();
            let fluid: Vec<[u32; 6]> = s
                .particles
                .segment(Kind::Fluid)
                .map(|i| {
                    let r = s.particles.record[i];
                    [r.x[0], r.x[1], r.x[2], r.v[0], r.v[1], r.v[2]].map(f32::to_bits)
                })
                .collect();
            let bodies: Vec<[u64; 6]> = s
                .bodies
                .body
                .iter()
                .map(|b| [b.x.x, b.x.y, b.x.z, b.l.x, b.l.y, b.l.z].map(f64::to_bits))
                .collect();
            (fluid, bodies, w.ledger().momentum.x.to_bits(), w.ledger().kinetic.to_bits())
        })
    };
    let one = run(1);
    for threads in [2, 4] {
        assert!(one == run(threads), "{solver}: {threads} threads give other bits");
    }
}

/// Positions of a drop stretched by u = (-A x, A z) after `time`, in steps of `dt`, by id.
fn stretched(dt: f64, time: f64) -> Vec<DVec3> {
    let text = format!(
        "[world]\ndimensions = 2\ngravity = [0, 0, 0]\n[domain]\nmin = [-3, 0, -3]\nmax = [3, 0, 3]\n\
         walls = [\"open\", \"open\", \"open\"]\n[resolution]\nspacing = 0.1\n\
         [solver]\nsound_speed = 14\nsupport = 2.6\nnegative_pressure = true\nartificial_viscosity = 0\ndt = {dt}\n\
         [[fluid]]\nshape = {{ sphere = {{ center = [0, 0, 0], radius = 1 }} }}\nviscosity = 0\n"
    );
    let mut assembly = scene(&text).assemble().unwrap();
    let n = assembly.state.particles.count[0];
    for r in &mut assembly.state.particles.record[..n] {
        r.v = [-r.x[0], 0.0, r.x[2]];
    }
    let mut w = World::new(assembly);
    for _ in 0..(time / dt).round() as usize {
        w.step(dt);
    }
    let p = &w.state().particles;
    let mut places = vec![DVec3::ZERO; n];
    for i in p.segment(Kind::Fluid) {
        places[p.id[i] as usize] = DVec3::from(p.record[i].x.map(f64::from));
    }
    places
}

#[test]
fn fluids_are_integrated_to_second_order() {
    // a stretching drop (Monaghan 1994), inviscid: slope of log error against log dt
    let time = 0.08;
    let exact = stretched(time / 1024.0, time);
    let error = |steps: f64| {
        let places = stretched(time / steps, time);
        let sum: f64 = places.iter().zip(&exact).map(|(a, b)| (*a - *b).length_squared()).sum();
        (sum / exact.len() as f64).sqrt()
    };
    let (coarse, fine) = (error(32.0), error(128.0));
    let order = (coarse / fine).log2() / 2.0;
    println!("order {order:.3}: errors {coarse:e} {fine:e}");
    assert!((1.8..=2.2).contains(&order), "order {order}: errors {coarse:e} {fine:e}");
}
