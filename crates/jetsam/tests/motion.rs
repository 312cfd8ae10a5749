//! Scripted bodies and shaken scenes (E15).

mod common;

use common::world;
use glam::{DQuat, DVec3};
use jetsam::scene::motion::{Keyframe, Motion, Oscillation, Path};

/// Largest differences between the velocities and accelerations of a path and its differences in time.
fn derivatives(path: &Path, times: &[f64]) -> f64 {
    let h = 1e-5;
    let mut worst = 0.0f64;
    for &t in times {
        let (a, p, b) = (path.at(t - h), path.at(t), path.at(t + h));
        worst = worst.max(((b.x - a.x) / (2.0 * h) - p.v).length());
        worst = worst.max(((b.v - a.v) / (2.0 * h) - p.a).length());
        let turn = (b.q * a.q.inverse()).to_scaled_axis();
        worst = worst.max((turn / (2.0 * h) - p.omega).length());
        worst = worst.max(((b.omega - a.omega) / (2.0 * h) - p.alpha).length());
        assert!((p.q.length() - 1.0).abs() < 1e-12);
    }
    worst
}

#[test]
fn velocities_and_accelerations_are_those_of_the_places() {
    let (x, q) = (DVec3::new(0.3, -0.2, 0.5), DQuat::from_rotation_z(0.4));
    let key = |time: f64, position: [f64; 3], rotation: [f64; 4]| Keyframe { time, position, rotation };
    let motions = [
        Motion::Translation { velocity: [1.0, 2.0, 3.0], start: 0.0, stop: None },
        Motion::Rotation { axis: [1.0, 2.0, 2.0], center: [0.1, 0.0, 0.0], rate: 3.0, start: 0.0, stop: None },
        Motion::Oscillation(Oscillation {
            amplitude: [0.03, 0.0, 0.01],
            angle: 20.0,
            axis: [0.0, 1.0, 1.0],
            center: [0.0, 0.1, 0.0],
            period: 1.3,
            phase: 30.0,
            start: 0.0,
            stop: None,
        }),
        Motion::Keyframes(vec![
            key(0.0, [0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]),
            key(0.5, [0.1, 0.0, 0.2], [0.0, 1.0, 0.0, 60.0]),
            key(1.2, [0.3, 0.1, 0.2], [1.0, 1.0, 0.0, 100.0]),
            key(2.0, [0.3, 0.1, 0.0], [0.0, 1.0, 0.0, 170.0]),
        ]),
    ];
    for motion in motions {
        let path = Path::new(motion.clone(), x, q, DVec3::new(0.05, 0.02, 0.1));
        let worst = derivatives(&path, &[0.11, 0.37, 0.52, 0.91, 1.5, 1.93]);
        assert!(worst < 1e-4, "{motion:?}: off by {worst}");
    }
}

#[test]
fn keyframes_are_met_and_joined_with_a_continuous_velocity() {
    let w = world(
        "[domain]\nmin = [-1, -1, -1]\nmax = [1, 1, 1]\nwalls = [\"open\", \"open\", \"open\"]\n[resolution]\nspacing = 0.05\n\
         [[rigid]]\nshape = { points = [[0, 0, 0.9]] }\nmass = 1.0\n\
         [[static]]\nshape = { box = { min = [0, 0, 0], max = [0.2, 0.2, 0.2] } }\n\
         motion = { keyframes = [{ time = 0, position = [0, 0, 0] }, { time = 1, position = [0.4, 0, 0], rotation = [0, 0, 1, 90] },\n\
         { time = 2, position = [0.4, 0.3, 0] , rotation = [0, 0, 1, 90] }] }\n",
    );
    let path = w.model().paths[1].as_ref().unwrap();
    // the centre of mass is (0.1, 0.1, 0.1) in the shape's frame; 90 degrees about z turn it to (-0.1, 0.1, 0.1)
    assert!((path.at(0.0).x - DVec3::splat(0.1)).length() < 1e-12);
    assert!((path.at(1.0).x - DVec3::new(0.3, 0.1, 0.1)).length() < 1e-12);
    assert!((path.at(5.0).x - DVec3::new(0.3, 0.4, 0.1)).length() < 1e-12);
    for t in [0.0, 1.0, 2.0] {
        let (before, after) = (path.at(t - 1e-9), path.at(t + 1e-9));
        assert!((before.v - after.v).length() < 1e-6 && (before.omega - after.omega).length() < 1e-6);
    }
}

#[test]
fn a_moving_floor_carries_a_body_with_its_friction() {
    // a table moves on at 0.2 m/s: the block on it slides until it moves alike, after v / (mu g)
    let mut w = world(
        "[domain]\nmin = [-0.5, -0.2, -0.1]\nmax = [1, 0.2, 0.5]\nwalls = [\"open\", \"open\", \"open\"]\n[resolution]\nspacing = 0.02\n\
         [[rigid]]\nshape = { box = { min = [-0.05, -0.05, 0], max = [0.05, 0.05, 0.06] } }\ndensity = 1000\nfriction = 0.3\n\
         [[static]]\nshape = { box = { min = [-0.2, -0.1, -0.04], max = [0.2, 0.1, 0] } }\n\
         motion = { translation = { velocity = [0.2, 0, 0] } }\n",
    );
    let mut late = 0.0;
    w.advance(0.3, |w, _| {
        if w.state().bodies.body[0].v.x < 0.19 {
            late = w.time();
        }
        true
    });
    let expected = 0.19 / (0.3 * 9.81);
    println!("{late:.4} s, {expected:.4} expected");
    assert!((late / expected - 1.0).abs() < 0.1, "{late} {expected}");
    let b = &w.state().bodies.body;
    println!("{} {}", b[0].v.x, b[1].x.x);
    assert!((b[0].v.x - 0.2).abs() < 1e-3 && (b[1].x.x - 0.06).abs() < 1e-9);
    // what the table feels is what the block feels, reversed; it bears the weight
    assert!((b[1].force_contact + b[0].force_contact).length() < 1e-4 * b[0].mass * 9.81);
    assert!((b[0].force_contact.z / (b[0].mass * 9.81) - 1.0).abs() < 0.02 && b[0].contacts > 0);
}

#[test]
fn a_tank_that_sways_feels_like_one_that_is_shaken() {
    // the same free body, seen from a swaying frame: x - A sin(w t)
    let text = |extra: &str| {
        format!(
            "[world]\ngravity = [0, 0, 0]\n[domain]\nmin = [-1, -1, -1]\nmax = [1, 1, 1]\nwalls = [\"open\", \"open\", \"open\"]\n\
             [resolution]\nspacing = 0.05\n[solver]\ndt = 1e-3\n[[rigid]]\nshape = {{ points = [[0, 0, 0]] }}\nmass = 2.0\n{extra}"
        )
    };
    let mut w = world(&text("[[force]]\nshake = { amplitude = [0.032, 0, 0], period = 1.3 }\n"));
    w.advance(1.0, |_, _| true);
    // starts at rest in the frame, that is with velocity A w in the room
    let rate = std::f64::consts::TAU / 1.3;
    let expected = 0.032 * (rate - rate.sin());
    let x = w.state().bodies.body[0].x.x;
    assert!((x - expected).abs() < 1e-5, "{x} {expected}");
    assert!(w.momentum_residual() < 1e-5, "{}", w.momentum_residual());
}

#[test]
fn water_in_a_tank_that_accelerates_leans_back() {
    // free surface under constant acceleration a: slope a / g; here by a moving vessel against shaken gravity
    let a = 2.0;
    // 2D vessel, accelerated evenly by a long oscillation about its turning point: x = A (cos(w t) - 1), a = -A w^2
    let period = 40.0f64;
    let amplitude = a / (std::f64::consts::TAU / period).powi(2);
    let mut w = world(&format!(
        "[world]\ndimensions = 2\n[domain]\nmin = [-0.5, 0, -0.2]\nmax = [3.0, 0, 0.6]\nwalls = [\"open\", \"open\", \"open\"]\n\
         [resolution]\nspacing = 0.02\n[solver]\nartificial_viscosity = 0.3\n\
         [[fluid]]\nshape = {{ box = {{ min = [0, 0, 0], max = [0.6, 0, 0.2] }} }}\n\
         [[static]]\nname = \"vessel\"\nshape = {{ difference = {{ from = {{ box = {{ min = [-0.06, 0, -0.06], max = [0.66, 0, 0.4] }} }},\n\
         cut = [{{ box = {{ min = [0, 0, 0], max = [0.6, 0, 1] }} }}] }} }}\n\
         motion = {{ oscillation = {{ amplitude = [{}, 0, 0], period = {period}, phase = 90 }} }}\n",
        -amplitude
    ));
    w.advance(1.2, |_, r| r.trouble.is_none());
    let x_0 = w.state().bodies.body[0].x.x - 0.3;
    // the moments of the water say how it leans: mean of x z over the triangle, here by the centre of mass:
    // a body of liquid with surface z = h + s (x - L/2) has its centre at x = L/2 + s L^2 / (12 h)
    let n = w.fluid().count() as f64;
    let mean = w.fluid().map(|p| f64::from(p.x[0])).sum::<f64>() / n - x_0;
    let slope = (mean - 0.3) * 12.0 * 0.2 / 0.36;
    println!("slope {slope:.4}, {:.4} expected", -a / 9.81);
    assert!((slope / (-a / 9.81) - 1.0).abs() < 0.15, "{slope}");
    assert_eq!((w.ledger().lost, w.ledger().left, w.ledger().nonfinite), (0, 0, 0));
}
