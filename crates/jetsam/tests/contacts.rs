//! Contacts of bodies: restitution of the linear spring-dashpot (closed forms of a damped oscillator).

mod common;

use common::{space, world};
use glam::DVec3;
use jetsam::World;
use jetsam::state::Kind;
use std::f64::consts::PI;

/// A one-particle body.
fn ball(x: f64, z: f64, v: [f64; 2], mass: f64, constants: &str) -> String {
    format!(
        "[[rigid]]\nshape = {{ points = [[0, 0, 0]] }}\nmass = {mass}\nposition = [{x}, 0, {z}]\n\
         velocity = [{}, 0, {}]\nfriction = 0\n{constants}\n",
        v[0], v[1]
    )
}

fn stated(k: f64, eta: f64) -> String {
    format!("stiffness = {k}\ndamping = {eta}")
}

/// The seed's law: the dashpot takes the full relative velocity.
fn seed_law(half: f64, spacing: f64, dt: f64) -> String {
    space(half, spacing, dt) + "damping = \"full\"\n"
}

/// Outcome of a collision of bodies 0 and 1.
struct Collision {
    restitution: f64,
    overlap: f64,
    duration: f64,
    momentum: f64,
}

fn collide(world: &mut World, diameter: f64, dt: f64, steps: usize) -> Collision {
    let body = |w: &World, i: usize| (w.state().bodies.body[i].x, w.state().bodies.body[i].v);
    let speed = (body(world, 1).1 - body(world, 0).1).length();
    let (mut overlap, mut first, mut last) = (0.0f64, f64::NAN, f64::NAN);
    for _ in 0..steps {
        world.step(dt);
        let gap = (body(world, 1).0 - body(world, 0).0).length();
        overlap = overlap.max(diameter - gap);
        if gap < diameter {
            first = if first.is_nan() { world.time() } else { first };
            last = world.time();
        }
    }
    let after = (body(world, 1).1 - body(world, 0).1).length();
    let momentum = world.momentum_residual();
    Collision { restitution: after / speed, overlap, duration: last - first, momentum }
}

/// Mean and largest error of the restitution over the phases of a step in which contact can begin, and one collision.
fn restitution(masses: [f64; 2], eta: f64, v: f64, dt: f64) -> (f64, f64, Collision) {
    let (r, k) = (0.1, 1e5);
    let m = masses[0] * masses[1] / (masses[0] + masses[1]);
    let zeta = eta / (2.0 * (k * m).sqrt());
    let e = (-PI * zeta / (1.0 - zeta * zeta).sqrt()).exp();
    let contact = PI * (m / k).sqrt();
    let collisions: Vec<Collision> = (0..8)
        .map(|phase| {
            let gap = r + v * dt * (2.0 + f64::from(phase) / 8.0);
            let text = seed_law(1.0, r, dt)
                + &ball(-0.5 * gap, 0.0, [0.5 * v, 0.0], masses[0], &stated(k, eta))
                + &ball(0.5 * gap, 0.0, [-0.5 * v, 0.0], masses[1], &stated(k, eta));
            collide(&mut world(&text), r, dt, (2.0 * contact / dt) as usize + 10)
        })
        .collect();
    let error = |c: &Collision| c.restitution - e;
    let mean = collisions.iter().map(error).sum::<f64>() / 8.0;
    let worst = collisions.iter().map(|c| error(c).abs()).fold(0.0, f64::max);
    println!("e = {e:.6}, dt = t_c / {:.0}: mean error {mean:+.5}, worst {worst:.5}", contact / dt);
    (mean, worst, collisions.into_iter().last().unwrap())
}

#[test]
fn two_equal_balls_have_the_restitution_of_their_reduced_mass() {
    // m = 1, 1 kg, k = 1e5, eta = 50, v = 1: m* = 0.5, zeta = 0.111803, e = 0.702256, t_c = 7.06914e-3 s,
    // overlap 1.89761e-3 m
    let t_c = 7.06914e-3;
    let (_, worst, c) = restitution([1.0, 1.0], 50.0, 1.0, t_c / 20.0);
    assert!(worst <= 0.02, "{worst}");
    assert!(c.momentum < 1e-6, "{}", c.momentum);
    let (_, worst, c) = restitution([1.0, 1.0], 50.0, 1.0, t_c / 50.0);
    assert!(worst <= 0.007, "{worst}");
    assert!((c.overlap / 1.89761e-3 - 1.0).abs() < 0.01, "{}", c.overlap);
    assert!((c.duration - t_c).abs() < 2.0 * t_c / 50.0, "{}", c.duration);
}

#[test]
fn a_heavy_and_a_light_ball_do_too() {
    // m = 1, 0.1 kg, eta = 20, v = 2: e = 0.717975, t_c = 3.01200e-3 s, overlap 1.63381e-3 m
    let t_c = 3.01200e-3;
    let (_, worst, c) = restitution([1.0, 0.1], 20.0, 2.0, t_c / 50.0);
    assert!(worst <= 0.007, "{worst}");
    assert!((c.overlap / 1.63381e-3 - 1.0).abs() < 0.01, "{}", c.overlap);
    assert!((c.duration - t_c).abs() < 2.0 * t_c / 50.0, "{}", c.duration);
}

/// A body that falls on something fixed: its restitution and the lowest point of its centre.
fn bounce(text: &str, dt: f64, steps: usize) -> (f64, f64) {
    let mut world = world(text);
    let before = world.state().bodies.body[0].v;
    let mut lowest = f64::INFINITY;
    for _ in 0..steps {
        world.step(dt);
        lowest = lowest.min(world.state().bodies.body[0].x.z);
    }
    let e = world.state().bodies.body[0].v.z / -before.z;
    println!("e = {e:.6}, lowest {lowest:.6e}");
    (e, lowest)
}

#[test]
fn a_wall_has_infinite_mass() {
    // m* = 1 kg: zeta = 0.079057, e = 0.779467, t_c = 9.96578e-3 s, overlap 2.80947e-3 m
    let t_c = 9.96578e-3;
    for (per, tolerance) in [(20.0, 0.02), (50.0, 0.007)] {
        let dt = t_c / per;
        let text = seed_law(1.0, 0.1, dt)
            + &ball(0.0, 1.3 * dt, [0.0, -1.0], 1.0, &stated(1e5, 50.0))
            + "[[static]]\nshape = { points = [[0, 0, -0.1]] }\n";
        let (e, lowest) = bounce(&text, dt, 3 * per as usize);
        assert!((e - 0.779467).abs() <= tolerance, "{e}");
        assert!((-lowest / 2.80947e-3 - 1.0).abs() < 0.02, "{lowest}");
    }
}

#[test]
fn a_face_of_many_contacts_is_as_many_springs() {
    // 8 x 8 particles of a face on fixed mirror particles, m = 8 kg, k = 1e4, eta = 5 each:
    // zeta = 0.070711, e = 0.800354, t_c = 1.11351e-2 s
    let (t_c, r) = (1.11351e-2, 0.01);
    let dt = t_c / 50.0;
    let grid = |z: f64| {
        let point = |n: i32| format!("[{}, {}, {z}]", (f64::from(n % 8) - 3.5) * r, (f64::from(n / 8) - 3.5) * r);
        (0..64).map(point).collect::<Vec<_>>().join(", ")
    };
    let text = seed_law(1.0, r, dt)
        + &format!(
            "[[rigid]]\nshape = {{ points = [{}] }}\nmass = 8.0\nposition = [0, 0, {}]\nvelocity = [0, 0, -0.1]\n{}\n\
             [[static]]\nshape = {{ points = [{}] }}\n",
            grid(0.0),
            0.13 * dt,
            stated(1e4, 5.0),
            grid(-r)
        );
    let (e, _) = bounce(&text, dt, 150);
    assert!((e - 0.800354).abs() <= 0.007, "{e}");
}

/// Fraction of the relative velocity across the line of centres that a grazing contact leaves.
fn grazing(damping: &str) -> f64 {
    // balls far larger than their overlap: the line of centres then does not turn noticeably
    let (r, t_c, v, vt) = (2.0, 7.06914e-3, 1.0, 1e-3);
    let dt = t_c / 200.0;
    let gap = r + 1.5 * v * dt;
    let text = space(4.0, r, dt)
        + &format!("damping = \"{damping}\"\n")
        + &ball(-0.5 * gap, 0.0, [0.5 * v, 0.5 * vt], 1.0, &stated(1e5, 50.0))
        + &ball(0.5 * gap, 0.0, [-0.5 * v, -0.5 * vt], 1.0, &stated(1e5, 50.0));
    let mut world = world(&text);
    for _ in 0..400 {
        world.step(dt);
    }
    let b = &world.state().bodies.body;
    (b[1].v.z - b[0].v.z) / -vt
}

#[test]
fn the_full_dashpot_damps_the_tangent_too_and_the_normal_one_does_not() {
    // E11: v_t' / v_t = e^2 = 0.493164 for the full relative velocity; 1 for its projection
    let full = grazing("full");
    assert!((full - 0.493164).abs() < 0.01, "{full}");
    let normal = grazing("normal");
    assert!((normal - 1.0).abs() < 0.01, "{normal}");
}

#[test]
fn without_damping_all_comes_back() {
    // e = 1 holds to 1e-3 at a tenth of the contact time
    let t_c = PI * (0.5f64 / 1e5).sqrt();
    let (_, worst, _) = restitution([1.0, 1.0], 0.0, 1.0, t_c / 10.0);
    assert!(worst < 1e-3, "{worst}");
}

#[test]
fn derived_constants_give_the_restitution_asked_for() {
    // E14 from e and an overlap instead of k and eta, at the step the model derives
    for e in [0.9, 0.5] {
        let r = 0.1;
        let constants = format!("restitution = {e}");
        let text = space(1.0, r, 1.0).replace("dt = 1\n", "damping = \"full\"\n")
            + &ball(-0.06, 0.0, [0.5, 0.0], 1.0, &constants)
            + &ball(0.06, 0.0, [-0.5, 0.0], 1.0, &constants);
        let mut world = world(&text);
        let (dt, _) = world.model().largest_dt(0.0, 0.0);
        let c = collide(&mut world, r, dt, (0.6 / dt) as usize);
        assert!((c.restitution - e).abs() <= 0.02, "{} for {e}", c.restitution);
        // they meet at 1 m/s, twice the largest speed of any one: twice the overlap allowed at most
        assert!(c.overlap < 2.0 * world.model().solver.contact_overlap * r, "{}", c.overlap);
    }
}

#[test]
fn what_a_body_feels_is_what_its_particles_feel() {
    // forces without friction act along the lines of centres: torques are those of the forces on particles, also on a bar that
    // reaches round more than half of a periodic axis and is touched from both sides
    let mut w = world(
        "[domain]\nmin = [0, 0, 0]\nmax = [0.4, 0.3, 0.6]\nwalls = [\"periodic\", \"solid\", \"solid\"]\n[resolution]\nspacing = 0.02\n\
         [solver]\nsurface = \"spheres\"\nsleep = 0\n\
         [[rigid]]\nname = \"bar\"\nshape = { box = { min = [-0.15, -0.03, -0.03], max = [0.15, 0.03, 0.03] } }\ndensity = 500\nfriction = 0\n\
         position = [0.3, 0.15, 0.06]\n\
         [[rigid]]\nname = \"brick\"\nshape = { box = { min = [-0.03, -0.03, -0.03], max = [0.03, 0.03, 0.03] } }\ndensity = 500\nfriction = 0\n\
         position = [0.05, 0.05, 0.2]\ncopies = { count = 24, grid = { columns = [4, 3], step = [0.1, 0.1, 0.1] }, tumble = true }\n",
    );
    let (mut touched, mut far) = (0, false);
    for _ in 0..8 {
        w.advance(w.time() + 0.05, |_, _| true);
        let s = w.state();
        let mut felt = vec![[DVec3::ZERO; 2]; s.bodies.body.len()];
        let slots =
            s.particles.segment(Kind::Rigid).chain(s.particles.segment(Kind::Static)).map(|i| s.particles.id[i]);
        for (slot, f) in slots.zip(s.forces_on_bodies()) {
            let (slot, f) = (slot as usize, DVec3::from(f.map(f64::from)));
            let k = s.bodies.owner[slot] as usize;
            felt[k][0] += f;
            felt[k][1] += (s.bodies.body[k].q * s.bodies.offset[slot]).cross(f);
        }
        for (body, [force, torque]) in s.bodies.body.iter().zip(felt).filter(|(b, _)| !b.is_static()) {
            let size = body.force_contact.length();
            assert!(
                (force - body.force_contact).length() <= 1e-5 * size,
                "{}: {force} {}",
                body.name,
                body.force_contact
            );
            let off = (torque - body.torque_contact).length();
            assert!(off <= 1e-5 * (0.2 * size + torque.length()), "{}: {torque} {}", body.name, body.torque_contact);
            touched += body.contacts;
        }
        // some touch the bar across the seam, farther from its centre than half the period
        let x = |slot: u32| f64::from(s.bodies.record[slot as usize].x[0]);
        let bar = &s.bodies.body[0];
        let across = |[a, b]: [u32; 2]| {
            let between = bar.slots.contains(&(a as usize)) && (b as usize) < s.bodies.rigid_slots;
            between && (x(b) - bar.x.x).abs() > 0.2
        };
        far |= s.bodies.contacts.touching().any(across);
    }
    assert!(touched > 100 && far, "{touched} contacts");
}
