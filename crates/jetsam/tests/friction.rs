//! Friction of bodies (E13): inclines, rolling, and what friction may not do.

mod common;

use common::world;
use jetsam::World;

const G: f64 = 9.81;

/// A plane of 30 degrees: gravity leans, the floor is level. `body` stands at height `z`, `speed` along x.
fn incline(shape: &str, z: f64, mu: f64, speed: f64) -> World {
    incline_of(&format!("shape = {{ {shape} }}"), z, mu, speed)
}

fn incline_of(body: &str, z: f64, mu: f64, speed: f64) -> World {
    let (gx, gz) = (G * 0.5, -G * 30f64.to_radians().cos());
    world(&format!(
        "[world]\ngravity = [{gx}, 0, {gz}]\n[domain]\nmin = [-0.2, -0.2, 0]\nmax = [1.0, 0.2, 0.4]\n\
         walls = [\"open\", \"open\", \"solid\"]\n[resolution]\nspacing = 0.02\n\
         [[rigid]]\n{body}\ndensity = 1000\nposition = [0, 0, {z}]\nfriction = {mu}\nvelocity = [{speed}, 0, 0]\n\
         restitution = 0.1\n"
    ))
}

const BLOCK: &str = "box = { min = [-0.06, -0.06, -0.04], max = [0.06, 0.06, 0.04] }";

/// Mean acceleration along x between two times.
fn acceleration(w: &mut World, from: f64, to: f64) -> f64 {
    w.advance(from, |_, r| r.trouble.is_none());
    let v = w.state().bodies.body[0].v.x;
    w.advance(to, |_, r| r.trouble.is_none());
    (w.state().bodies.body[0].v.x - v) / (to - from)
}

#[test]
fn a_block_slides_down_an_incline_as_coulomb_says() {
    // B6: a = g (sin - mu cos): 4.905 without friction, 3.2059 at 0.2, 1.0819 at 0.45
    for (mu, expected) in [(0.0, 4.905), (0.2, 3.2059), (0.45, 1.0819)] {
        let mut w = incline(BLOCK, 0.04, mu, 0.0);
        let a = acceleration(&mut w, 0.1, 0.4);
        println!("mu {mu}: {a:.4} m/s^2, {expected} expected");
        assert!((a / expected - 1.0).abs() <= 0.02, "mu {mu}: {a} {expected}");
    }
}

#[test]
fn a_block_sticks_above_the_angle_of_friction() {
    // B6: sticks for mu >= tan 30 degrees = 0.57735; creep at most 1e-4 m/s
    let mut w = incline(BLOCK, 0.04, 0.6, 0.0);
    w.advance(0.5, |_, r| r.trouble.is_none());
    let x = w.state().bodies.body[0].x.x;
    w.advance(1.5, |_, r| r.trouble.is_none());
    let creep = (w.state().bodies.body[0].x.x - x) / 1.0;
    println!("creep {creep:.2e} m/s");
    assert!(creep.abs() <= 1e-4, "{creep}");
}

/// A ball of particles on a sphere, radius 8 spacings to their rims.
fn ball() -> String {
    let (n, radius) = (1200, 0.15);
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let points: Vec<String> = (0..n)
        .map(|k| {
            let z = 1.0 - 2.0 * (f64::from(k) + 0.5) / f64::from(n);
            let (r, a) = ((1.0 - z * z).sqrt() * radius, golden * f64::from(k));
            format!("[{:.6}, {:.6}, {:.6}]", r * a.cos(), r * a.sin(), z * radius)
        })
        .collect();
    format!("points = [{}]", points.join(", "))
}

#[test]
fn a_ball_rolls_without_slipping() {
    // a thin shell of radius R = 0.15 + dx / 2 rolls: a = g sin / (1 + I / (m R^2)); within 10 % for its bumps, on which it
    // rolls like a polygon: its rim is 3 % at most slower than the ground
    let mut w = incline(&ball(), 0.16, 0.6, 0.0);
    let b = &w.state().bodies.body[0];
    let inertia = 1.0 / b.inverse_inertia.y_axis.y;
    let radius = 0.16;
    let expected = G * 0.5 / (1.0 + inertia / (b.mass * radius * radius));
    let a = acceleration(&mut w, 0.1, 0.5);
    let b = &w.state().bodies.body[0];
    let slip = 1.0 - b.omega.y * radius / b.v.x;
    println!("rolls with {a:.4} m/s^2, {expected:.4} expected; slip {slip:.4}");
    assert!((a / expected - 1.0).abs() <= 0.1, "{a} {expected}");
    assert!(slip.abs() < 0.03, "slips by {slip}");
}

#[test]
fn a_ball_of_one_particle_skids_until_it_rolls() {
    // B6: v_0 = 1 m/s, mu = 0.3: rolls after 2/7 v_0 / (mu g) = 0.097083 s with 5/7 v_0, 0.083214 m on. Its moment of
    // inertia is m dx^2 / 6, which is 2/5 m R^2 of the radius R = d / 2 for a contact diameter d^2 = 5/3 dx^2
    let d = 0.1 * (5f64 / 3.0).sqrt();
    // whatever damps the contact, and whether it stands above a particle of the floor or between
    for (damping, x) in [(60, 0.05), (600, 0.02)] {
        let mut w = world(&format!(
            "[domain]\nmin = [-1, -1, 0]\nmax = [1, 1, 0.5]\nwalls = [\"open\", \"open\", \"solid\"]\n[resolution]\nspacing = 0.1\n\
             [solver]\ncontact_diameter = {}\n[[rigid]]\nshape = {{ points = [[0, 0, 0]] }}\nmass = 1\nposition = [{x}, 0, {}]\n\
             velocity = [1, 0, 0]\nstiffness = 1e6\ndamping = {damping}\nfriction = 0.3\n",
            d / 0.1,
            d - 0.05
        ));
        w.advance(0.097083, |_, r| r.trouble.is_none());
        let way = w.state().bodies.body[0].x.x - x;
        w.advance(0.2, |_, r| r.trouble.is_none());
        let b = &w.state().bodies.body[0];
        println!("way {way:.5} m, then {:.4} m/s, slip {:.1e}", b.v.x, 1.0 - b.omega.y * 0.5 * d / b.v.x);
        assert!((way / 0.083214 - 1.0).abs() <= 0.02, "{way}");
        assert!((b.v.x * 7.0 / 5.0 - 1.0).abs() <= 0.02, "{}", b.v.x);
    }
}

/// Three discs, two on the floor and one above between them.
fn pyramid(mu: f64) -> World {
    let disc = |x: f64, z: f64| {
        format!(
            "[[rigid]]\nshape = {{ points = [[0, 0, 0]] }}\nmass = 0.1\nposition = [{x}, 0, {z}]\nstiffness = 1e5\nfriction = {mu}\n"
        )
    };
    world(&format!(
        "[world]\ndimensions = 2\n[domain]\nmin = [-0.2, 0, 0]\nmax = [0.2, 0, 0.2]\nwalls = [\"open\", \"open\", \"solid\"]\n\
         [resolution]\nspacing = 0.02\n[solver]\nsleep = 0\n{}{}{}",
        disc(-0.01001, 0.01),
        disc(0.01001, 0.01),
        disc(0.0, 0.0273)
    ))
}

#[test]
fn a_particle_holds_contacts_that_slip_in_different_directions() {
    // each disc below is held by two contacts that turn it opposite ways. Balance of moments: both bear the same friction; of
    // forces: it is tan 15 degrees = 0.268 of the normal force above, where that is least
    for (mu, stands) in [(0.3, true), (0.25, false)] {
        let mut w = pyramid(mu);
        w.advance(0.4, |_, r| r.trouble.is_none());
        let z = w.state().bodies.body[2].x.z;
        w.advance(0.7, |_, r| r.trouble.is_none());
        let b = &w.state().bodies.body;
        println!("mu {mu}: top at {:.6}, creep {:.1e} m/s", b[2].x.z, (z - b[2].x.z) / 0.3);
        assert_eq!(b[2].x.z > 0.02, stands, "{}", b[2].x.z);
        if !stands {
            continue;
        }
        assert!((b[2].x.z - z).abs() / 0.3 < 1e-6, "{z} {}", b[2].x.z);
        // the disc above leans on those below with f = m g / 2 tan 15 degrees of friction, in opposite directions
        let k_t = 2.0 / 7.0 * 1e5;
        let friction = 0.1 * G / 2.0 * 15f64.to_radians().tan();
        for (slot, side) in [(0, 1.0), (1, -1.0)] {
            let slip = w.state().bodies.contacts.slip(slot, 2).unwrap().map(|s| f64::from(s) * k_t);
            assert!((slip[0].hypot(slip[2]) / friction - 1.0).abs() < 0.01, "{slip:?} {friction}");
            assert!(side * slip[0] > 0.0);
        }
    }
}

#[test]
fn a_slip_turns_with_its_contact() {
    // two balls in contact that turn as one: the slip turns with them and keeps its length. Here by small steps to 90 degrees, about
    // an axis that is neither the normal nor across it
    let axis = glam::Vec3::new(0.6, 0.0, 0.8);
    let (n, slip) = (glam::Vec3::X, glam::Vec3::new(0.0, 2e-5, -1e-5));
    let (steps, quarter) = (2000, std::f32::consts::FRAC_PI_2);
    let step = quarter / steps as f32;
    let mut carried = slip;
    for k in 0..steps {
        let now = glam::Quat::from_axis_angle(axis, step * (k + 1) as f32) * n;
        let s = jetsam::laws::contact::slip_carried(carried.to_array(), now.to_array(), step * axis.dot(now));
        carried = glam::Vec3::new(s.x, s.y, s.z);
    }
    let expected = glam::Quat::from_axis_angle(axis, quarter) * slip;
    println!("{carried} {expected}");
    assert!((carried - expected).length() < 2e-3 * slip.length(), "{carried} {expected}");
    assert!((carried.length() / slip.length() - 1.0).abs() < 1e-4);
}

#[test]
fn slips_outlive_other_constants_and_another_body() {
    // a block sticks to a slope; another body comes: the block stays where it is
    let text = |more: &str| {
        format!(
            "[world]\ngravity = [4.905, 0, -8.4957]\n[domain]\nmin = [-0.2, -0.2, 0]\nmax = [1.0, 0.2, 0.4]\n\
             walls = [\"open\", \"open\", \"solid\"]\n[resolution]\nspacing = 0.02\n[solver]\nsleep = 0\n{more}\
             [[rigid]]\nname = \"block\"\nshape = {{ {BLOCK} }}\ndensity = 1000\nposition = [0, 0, 0.04]\nfriction = 0.6\nrestitution = 0.1\n"
        )
    };
    let other =
        "[[rigid]]\nname = \"other\"\nshape = { points = [[0, 0, 0]] }\nmass = 0.01\nposition = [0.8, 0, 0.3]\n";
    let mut w = world(&text(""));
    w.advance(0.4, |_, r| r.trouble.is_none());
    let x = w.state().bodies.body[0].x.x;
    w.take_over(common::scene(&text(other)).assemble().unwrap()).map_err(|e| e.0).unwrap();
    w.advance(0.45, |_, r| r.trouble.is_none());
    let b = w.state().bodies.body.iter().find(|b| b.name == "block").unwrap();
    println!("moved by {:.1e} m", b.x.x - x);
    assert!((b.x.x - x).abs() < 1e-7, "{}", b.x.x - x);
}

#[test]
fn the_articles_preset_has_no_friction_and_creeps() {
    // seed law: the full dashpot alone holds a block back: it reaches v = m g sin / (n eta) and never sticks
    let text = "[world]\ngravity = [4.905, 0, -8.4957]\n[domain]\nmin = [-0.2, -0.2, 0]\nmax = [1.0, 0.2, 0.4]\n\
         walls = [\"open\", \"open\", \"solid\"]\n[resolution]\nspacing = 0.02\n[solver]\npreset = \"article\"\n\
         [[rigid]]\nshape = { points = [[0, 0, 0]] }\nmass = 1.0\nposition = [0.01, 0.01, 0.01]\nstiffness = 1e5\ndamping = 50\n";
    let scene = common::scene(text);
    assert_eq!(scene.rigid[0].friction, 0.0);
    assert_eq!(scene.solver.damping, jetsam::scene::Damping::Full);
    assert_eq!(scene.solver.surface, jetsam::scene::Surface::Spheres);
    assert_eq!(scene.solver.coupling, jetsam::scene::Coupling::Spring);
    // what the scene says wins
    let other = common::scene(&text.replace("preset = \"article\"", "preset = \"article\"\ndamping = \"normal\""));
    assert_eq!(other.solver.damping, jetsam::scene::Damping::Normal);
}

#[test]
fn balls_and_cylinders_in_shells_roll() {
    // B6, 16 particles across: a = 5/7 g sin for a ball, 2/3 g sin for a cylinder; within 5 %, as neighbours on the outermost shell are
    // 8 degrees apart, and what rolls over such an edge loses 1.4 % of its energy. A lattice is 18 to 22 % slow: its facets are 26
    // degrees apart
    let ball = "shape = { sphere = { center = [0, 0, 0], radius = 0.16 } }\nfill = \"shells\"";
    let rod = "shape = { cylinder = { center = [0, 0, 0], axis = [0, 1, 0], radius = 0.16, height = 0.08 } }\nfill = \"shells\"";
    for (body, part) in [(ball, 5.0 / 7.0), (rod, 2.0 / 3.0)] {
        let mut w = incline_of(body, 0.16, 0.6, 0.0);
        let (a, expected) = (acceleration(&mut w, 0.05, 0.3), part * G * 0.5);
        let b = &w.state().bodies.body[0];
        let slip = 1.0 - b.omega.y * 0.16 / b.v.x;
        println!("{a:.4} m/s^2, {expected:.4} expected; slip {slip:.4}");
        assert!((a / expected - 1.0).abs() < 0.05, "{a} {expected}");
        assert!(slip.abs() < 0.05, "{slip}");
    }
}
