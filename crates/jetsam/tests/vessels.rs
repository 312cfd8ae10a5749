//! Vessels of particles hold water: filled, carried, tipped, emptied.

mod common;

use common::world;
use glam::DVec3;
use jetsam::World;

/// A cup: outer radius 0.1 m, walls of two spacings, 0.2 m high, with `extra` lines of its table.
fn cup(kind: &str, extra: &str) -> String {
    format!(
        "[[{kind}]]\nname = \"cup\"\nshape = {{ difference = {{\n\
         from = {{ cylinder = {{ center = [0, 0, 0.1], axis = [0, 0, 1], radius = 0.1, height = 0.2 }} }},\n\
         cut = [{{ cylinder = {{ center = [0, 0, 0.13], axis = [0, 0, 1], radius = 0.07, height = 0.2 }} }}] }} }}\n{extra}"
    )
}

/// Fluid particles inside the cup's hollow, as it stands now.
fn inside(w: &World) -> usize {
    let b = w.state().bodies.body.iter().find(|b| b.name == "cup").unwrap();
    let within = |p: &&jetsam::state::Record| {
        let d = b.q.inverse() * (DVec3::from(p.x.map(f64::from)) - b.x);
        d.truncate().length() < 0.085 && (-0.12..0.14).contains(&d.z)
    };
    w.fluid().filter(within).count()
}

const ROOM: &str = "[domain]\nmin = [-0.25, -0.15, -0.2]\nmax = [0.55, 0.15, 0.5]\nwalls = [\"open\", \"open\", \"open\"]\n\
     [resolution]\nspacing = 0.015\n[run]\nseconds = 2.0\n[solver]\nsound_speed = 20\nartificial_viscosity = 0.1\n\
     [[fluid]]\nshape = { cylinder = { center = [0, 0, 0.08], axis = [0, 0, 1], radius = 0.068, height = 0.096 } }\n";

#[test]
fn a_cup_is_carried_and_tipped_without_a_leak() {
    let w = &mut world(
        &(ROOM.to_owned()
            + &cup(
                "static",
                "motion = { keyframes = [\n\
                 { time = 0.2, position = [0, 0, 0] },\n\
                 { time = 0.7, position = [0.15, 0, 0.15] },\n\
                 { time = 1.0, position = [0.25, 0, 0.15] },\n\
                 { time = 1.5, position = [0.25, 0, 0.3], rotation = [0, 1, 0, 150] }] }\n",
            )),
    );
    let n = w.fluid().count();
    w.advance(1.0, |_, r| r.trouble.is_none());
    println!("{} of {n} in the cup after the way", inside(w));
    assert_eq!(w.ledger().left, 0);
    assert_eq!(inside(w), n, "it leaks on the way");
    w.advance(2.0, |_, r| r.trouble.is_none());
    let left = inside(w);
    println!("{left} of {n} in the cup after it was tipped");
    assert!(left <= n / 50, "{left} of {n} are still in it");
    assert_eq!((w.ledger().lost, w.ledger().nonfinite), (0, 0));
}

#[test]
fn a_free_cup_of_water_stands_on_the_floor() {
    // a rigid vessel, its water and the floor: nothing leaks, and the floor bears both
    let text = ROOM.replace("[\"open\", \"open\", \"open\"]", "[\"open\", \"open\", \"solid\"]").replace("-0.2]", "0]");
    let mut w = world(&(text + &cup("rigid", "density = 2000\n")));
    let n = w.fluid().count();
    w.advance(0.8, |_, r| r.trouble.is_none());
    let (mut weight, mut samples) = (0.0, 0.0);
    w.advance(1.0, |w, _| {
        let walls = w.state().bodies.body.iter().find(|b| b.name == "walls").unwrap();
        weight -= walls.force_contact.z;
        samples += 1.0;
        true
    });
    let b = &w.state().bodies.body[0];
    let expected = 9.81 * (b.mass + n as f64 * f64::from(w.model().fluids[0].mass));
    println!(
        "floor bears {:.4} of the weight; {} of {n} in the cup; tilt {:.1e}",
        weight / samples / expected,
        inside(&w),
        (b.q * DVec3::Z - DVec3::Z).length()
    );
    assert!((weight / samples / expected - 1.0).abs() < 0.03, "{}", weight / samples / expected);
    assert_eq!(inside(&w), n);
}

#[test]
fn a_wall_one_particle_thick_holds_water() {
    // a plate across a tank: water on one side stays there
    let points: Vec<String> = (0..12).map(|k| format!("[0, 0, {}]", 0.0125 + 0.025 * f64::from(k))).collect();
    let mut w = world(&format!(
        "[world]\ndimensions = 2\n[domain]\nmin = [-0.3, 0, 0]\nmax = [0.3, 0, 0.4]\n[resolution]\nspacing = 0.025\n\
         [[fluid]]\nshape = {{ box = {{ min = [-0.3, 0, 0], max = [-0.0125, 0, 0.2] }} }}\n\
         [[static]]\nshape = {{ points = [{}] }}\n",
        points.join(", ")
    ));
    w.advance(1.5, |_, r| r.trouble.is_none());
    let through = w.fluid().filter(|p| p.x[0] > 0.0).count();
    assert_eq!(through, 0, "{through} particles are through");
}

#[test]
fn a_one_way_body_moves_water_and_is_not_moved() {
    let mut w = world(
        "[world]\ndimensions = 2\n[domain]\nmin = [-0.3, 0, 0]\nmax = [0.3, 0, 0.6]\n[resolution]\nspacing = 0.025\n\
         [[fluid]]\nshape = { box = { min = [-0.3, 0, 0], max = [0.3, 0, 0.25] } }\n\
         [[rigid]]\nshape = { sphere = { center = [0, 0, 0], radius = 0.08 } }\ndensity = 100\none_way = true\nposition = [0, 0, 0.35]\n",
    );
    let t = 0.15;
    w.advance(t, |_, r| r.trouble.is_none());
    let b = &w.state().bodies.body[0];
    assert!((b.v.z + 9.81 * t).abs() < 1e-6, "a free fall, {}", b.v.z);
    assert!(b.force_fluid.z > 0.0 && w.momentum_residual() < 1e-5, "{}", w.momentum_residual());
}
