//! Flocks: the rules one by one (D3), ordered motion (D1, D2), topological cohesion (D4), obstacles, threads.

mod common;

use common::{scene, world};
use glam::{DQuat, DVec3, Vec3};
use jetsam::World;
use jetsam::assemble::Assembly;
use jetsam::state::Record;

/// A scene of flocks alone in an open or periodic box.
fn sky(dimensions: u32, walls: &str, size: f64, extra: &str) -> String {
    format!(
        "[world]\ndimensions = {dimensions}\nseed = 1\n[domain]\nmin = [0, 0, 0]\nmax = [{size}, {size}, {size}]\n\
         walls = [\"{walls}\", \"{walls}\", \"{walls}\"]\n[resolution]\nspacing = {}\n{extra}",
        size / 20.0
    )
}

/// Agents by id.
fn agents(w: &World) -> Vec<Record> {
    let a = &w.state().agents;
    let mut all: Vec<(u32, Record)> = a.id.iter().copied().zip(a.record.iter().copied()).collect();
    all.sort_unstable_by_key(|a| a.0);
    all.into_iter().map(|a| a.1).collect()
}

fn x(r: &Record) -> Vec3 {
    Vec3::from(r.x)
}

fn v(r: &Record) -> Vec3 {
    Vec3::from(r.v)
}

/// Two agents a third of a metre apart with one rule only; `R = 1 m`, `U = 1 m/s`, so that weights are rates.
fn pair(rule: &str, weight: f64, velocities: [[f32; 3]; 2]) -> World {
    let mut text = sky(
        3,
        "open",
        20.0,
        "[solver]\ndt = 0.05\n[[flock]]\ncount = 2\nshape = { points = [[9.8, 10, 10], [10.1, 10, 10]] }\nradius = 1\n\
         separation_radius = 0.8\nspeed = 1\nspeed_min = 0\nspeed_max = 100\ncruise = 0\n",
    );
    for key in ["separation", "alignment", "cohesion"] {
        text += &format!("{key} = {}\n", if key == rule { weight } else { 0.0 });
    }
    let mut assembly = scene(&text).assemble().unwrap();
    for (r, v) in assembly.state.agents.record.iter_mut().zip(velocities) {
        r.v = v;
    }
    World::new(assembly)
}

#[test]
fn separation_alone_drives_two_apart() {
    let mut w = pair("separation", 1.0, [[0.0; 3], [0.0; 3]]);
    let mut before = 0.0;
    for _ in 0..50 {
        let a = agents(&w);
        let distance = x(&a[0]).distance(x(&a[1]));
        assert!(distance > before, "{distance} after {before}");
        before = distance;
        w.step(f64::INFINITY);
    }
    assert!(before > 0.8, "{before}: still inside the radius of separation");
}

#[test]
fn cohesion_alone_makes_two_meet() {
    let mut w = pair("cohesion", 0.2, [[0.0; 3], [0.0; 3]]);
    let start = {
        let a = agents(&w);
        x(&a[0]).distance(x(&a[1]))
    };
    let mut nearest = start;
    for _ in 0..100 {
        w.step(f64::INFINITY);
        let a = agents(&w);
        nearest = nearest.min(x(&a[0]).distance(x(&a[1])));
        let middle = 0.5 * (x(&a[0]) + x(&a[1]));
        assert!((middle - Vec3::new(9.95, 10.0, 10.0)).length() < 1e-5, "the middle moved to {middle}");
    }
    assert!(nearest < 0.1 * start, "{nearest} of {start}");
}

#[test]
fn alignment_alone_converges_by_the_power_of_its_rate() {
    // deviation from the mean: (1 - w dt)^n, exactly
    let (weight, dt) = (2.0, 0.05);
    let mut w = pair("alignment", weight, [[0.02, 0.01, 0.0], [-0.01, 0.03, 0.02]]);
    let mean = 0.5 * (v(&agents(&w)[0]) + v(&agents(&w)[1]));
    let start = v(&agents(&w)[0]) - mean;
    for n in 1..=40 {
        w.step(f64::INFINITY);
        let expected = mean + start * (1.0 - weight * dt).powi(n) as f32;
        let got = v(&agents(&w)[0]);
        assert!((got - expected).length() < 1e-6 * start.length(), "step {n}: {got}, not {expected}");
    }
}

#[test]
fn one_alone_flies_straight() {
    for model in ["reynolds", "couzin", "vicsek"] {
        let mut w = world(&sky(
            3,
            "open",
            1000.0,
            &format!(
                "[[flock]]\ncount = 1\nmodel = \"{model}\"\nshape = {{ points = [[1, 2, 3]] }}\nradius = 1\nspeed = 2\nheading = [1, 2, 2]\n"
            ),
        ));
        w.advance(30.0, |_, _| true);
        let a = agents(&w)[0];
        let expected = Vec3::new(1.0, 2.0, 3.0) + 60.0 * Vec3::new(1.0, 2.0, 2.0) / 3.0;
        assert!((x(&a) - expected).length() < 1e-6 * 60.0, "{model}: {}", x(&a));
    }
}

/// Many agents with every rule.
const CROWD: &str = "[[flock]]\ncount = 300\nshape = { sphere = { center = [10, 10, 10], radius = 3 } }\nradius = 1.5\nspeed = 1\n\
                     speed_max = 1.2\nspeed_min = 0.9\nfield_of_view = 270\nacceleration = 20\n";

#[test]
fn speeds_stay_within_their_limits() {
    let mut w = world(&sky(3, "open", 20.0, CROWD));
    for _ in 0..200 {
        w.step(f64::INFINITY);
        for r in agents(&w) {
            let speed = v(&r).length();
            assert!((0.9 - 1e-6..=1.2 + 1e-6).contains(&speed), "{speed}");
        }
    }
}

/// Runs the crowd for ten steps after a change of its beginning.
fn changed(change: impl Fn(&mut Assembly)) -> Vec<Record> {
    let text = sky(3, "open", 20.0, CROWD).replace("[10, 10, 10]", "[0, 0, 0]");
    let mut assembly = scene(&text.replace("min = [0, 0, 0]", "min = [-10, -10, -10]")).assemble().unwrap();
    change(&mut assembly);
    let mut w = World::new(assembly);
    for _ in 0..5 {
        w.step(f64::INFINITY);
    }
    agents(&w)
}

#[test]
fn turning_moving_or_renumbering_a_flock_changes_nothing_else() {
    let plain = changed(|_| {});
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 1.0).as_quat();
    let turned = changed(|a| {
        for r in &mut a.state.agents.record {
            r.x = (turn * Vec3::from(r.x)).to_array();
            r.v = (turn * Vec3::from(r.v)).to_array();
        }
    });
    let by = Vec3::new(0.5, -0.25, 0.125);
    let moved = changed(|a| {
        a.state.agents.record.iter_mut().for_each(|r| r.x = (Vec3::from(r.x) + by).to_array());
    });
    let reversed = changed(|a| a.state.agents.record.reverse());
    for (k, p) in plain.iter().enumerate() {
        let error = |r: &Record, place: Vec3, velocity: Vec3| (x(r) - place).length().max((v(r) - velocity).length());
        // a millionth of the three metres that the flock reaches
        let e = error(&turned[k], turn * x(p), turn * v(p));
        assert!(e < 3e-6, "turned: {k} is off by {e}");
        let e = error(&moved[k], x(p) + by, v(p));
        assert!(e < 3e-6, "moved: {k} is off by {e}");
        let e = error(&reversed[plain.len() - 1 - k], x(p), v(p));
        assert!(e < 3e-6, "renumbered: {k} is off by {e}");
    }
}

#[test]
fn the_same_bits_for_any_number_of_threads() {
    let text = sky(
        3,
        "periodic",
        20.0,
        &(CROWD.replace("300", "2000")
            + "name = \"prey\"\nwander = 0.5\nmeets = { hunters = \"flee\" }\n\
               [[flock]]\nname = \"hunters\"\ncount = 5\nshape = { box = { min = [0, 0, 0], max = [20, 20, 20] } }\nradius = 3\nspeed = 1.5\n\
               meets = { prey = \"chase\" }\n\
               [[flock]]\nname = \"zones\"\nmodel = \"couzin\"\nnoise = 0.1\ncount = 700\nturn = 40\nradius = 3\nseparation_radius = 0.5\n\
               alignment_radius = 1\nspeed = 1\nshape = { box = { min = [0, 0, 0], max = [20, 20, 20] } }\n\
               [[flock]]\nname = \"nearest\"\nneighbours = 7\ncount = 700\nradius = 1\nspeed = 1\n\
               shape = { box = { min = [0, 0, 0], max = [20, 20, 20] } }\n"),
    );
    let run = |threads: usize| {
        let pool = rayon_pool(threads);
        pool.install(|| {
            let mut w = world(&text);
            w.advance(2.0, |_, _| true);
            jetsam::state_hash(w.state())
        })
    };
    let one = run(1);
    for threads in [2, 5] {
        assert_eq!(one, run(threads), "{threads} threads");
    }
}

fn rayon_pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap()
}

/// Mean polarization of Vicsek's agents over `steps` after `warm` (D1), and its standard error from ten blocks.
fn vicsek(n: usize, size: f64, noise: f64, warm: u32, steps: u32) -> (f64, f64) {
    let mut w = world(&sky(
        2,
        "periodic",
        size,
        &format!(
            "[[flock]]\nmodel = \"vicsek\"\ncount = {n}\nradius = 1\nspeed = 0.03\nnoise = {noise}\n\
             shape = {{ box = {{ min = [0, 0, 0], max = [{size}, {size}, {size}] }} }}\n"
        ),
    ));
    for _ in 0..warm {
        assert_eq!(w.step(f64::INFINITY).dt, 1.0);
    }
    let blocks: Vec<f64> = (0..10)
        .map(|_| {
            let sum: f64 = (0..steps / 10)
                .map(|_| {
                    w.step(f64::INFINITY);
                    agents(&w).iter().map(v).sum::<Vec3>().length() as f64 / (0.03 * n as f64)
                })
                .sum();
            sum / f64::from(steps / 10)
        })
        .collect();
    let mean = blocks.iter().sum::<f64>() / 10.0;
    let variance = blocks.iter().map(|b| (b - mean).powi(2)).sum::<f64>() / 9.0;
    (mean, (variance / 10.0).sqrt())
}

/// D1: noise, and the order parameter (Vicsek et al. 1995; for 40 agents; reference computed from the exact rule).
const VICSEK: [(f64, f64); 3] = [(1.0, 0.9576), (2.0, 0.8354), (std::f64::consts::TAU, 0.1403)];

#[test]
fn vicsek_order_falls_with_noise() {
    for (noise, reference) in VICSEK {
        let (got, error) = vicsek(40, 3.1, noise, 500, 20_000);
        println!("eta {noise:.3}: {got:.4} +- {error:.4}, reference {reference}");
        assert!((got - reference).abs() < f64::max(0.01, 3.0 * error), "{noise}: {got}, not {reference}");
    }
}

#[test]
fn vicsek_without_noise_ends_in_full_order() {
    let (got, _) = vicsek(100, 5.0, 0.0, 400, 100);
    assert!(got > 1.0 - 1e-5, "{got}");
}

/// Mean polarization and milling of Couzin's agents (D2), and their fragments at the end.
fn couzin(orientation: f64, attraction: f64, seed: u64, steps: u32) -> (f64, f64, usize) {
    let (ro, ra) = (1.0 + orientation, 1.0 + orientation + attraction);
    let text = sky(
        3,
        "open",
        20.0,
        &format!(
            "[[flock]]\nmodel = \"couzin\"\ncount = 100\nradius = {ra}\nseparation_radius = 1\nalignment_radius = {ro}\n\
             speed = 3\nturn = 40\nfield_of_view = 270\nnoise = 0.05\nshape = {{ sphere = {{ center = [10, 10, 10], radius = 5 }} }}\n"
        ),
    );
    let mut w = world(&text.replace("seed = 1", &format!("seed = {seed}")));
    for _ in 0..steps {
        w.step(f64::INFINITY);
    }
    let (mut p, mut m) = (0.0, 0.0);
    for _ in 0..1000 {
        w.step(f64::INFINITY);
        let order = w.flock_order(0);
        p += order.polarization / 1000.0;
        m += order.milling / 1000.0;
    }
    (p, m, w.flock_order(0).fragments)
}

#[test]
fn couzin_swarms_mill_and_fly_parallel() {
    // means of four runs, as one of a torus wavers by 0.026; the tolerances are those of D2
    for (orientation, p, m) in [(1.0, Some(0.095), Some(0.882)), (6.0, Some(0.999), None)] {
        let runs: Vec<_> = (1..=4).map(|seed| couzin(orientation, 14.0, seed, 4000)).collect();
        let mean = |of: fn(&(f64, f64, usize)) -> f64| runs.iter().map(of).sum::<f64>() / 4.0;
        let (got_p, got_m) = (mean(|r| r.0), mean(|r| r.1));
        println!("orientation {orientation}: p {got_p:.3} m {got_m:.3}");
        assert!(p.is_none_or(|p: f64| (got_p - p).abs() < 0.03), "{orientation}: p = {got_p}");
        assert!(m.is_none_or(|m: f64| (got_m - m).abs() < 0.05), "{orientation}: m = {got_m}");
    }
}

#[test]
fn agents_begin_all_over_a_shape_made_of_particles() {
    // spread evenly, places have no memory of the lattice of particles: the mean of exp(2 pi i x / spacing) is 1 / sqrt(n) in size
    let shape = "shape = { torus = { center = [10, 10, 10], axis = [1, 2, 1], radius = 6, tube = 3 } }";
    let n = 4000;
    let w = world(&sky(3, "open", 20.0, &format!("[[flock]]\ncount = {n}\nradius = 1\nspeed = 1\n{shape}\n")));
    for axis in 0..3 {
        let angles = agents(&w).into_iter().map(|r| std::f32::consts::TAU * r.x[axis]);
        let (s, c) = angles.fold((0.0, 0.0), |(s, c), a| (s + a.sin(), c + a.cos()));
        let mean = s.hypot(c) / n as f32;
        assert!(mean < 4.0 / (n as f32).sqrt(), "axis {axis}: {mean}");
    }
}

/// Shapes of obstacles in a box of four metres: centre, and half extents of a box or the radius of a ball.
const BOX: ([f32; 3], [f32; 3]) = ([1.5, 2.0, 1.0], [0.3, 0.4, 1.0]);
const BALL: ([f32; 3], f32) = ([2.8, 2.2, 2.0], 0.5);

/// Flies a thousand agents among obstacles; returns the deepest place inside any of them (m), and how many passed a side.
fn among_obstacles(steps: u32) -> (f32, usize) {
    let (b, h) = BOX;
    let (low, high): ([f32; 3], [f32; 3]) =
        (std::array::from_fn(|a| b[a] - h[a]), std::array::from_fn(|a| b[a] + h[a]));
    let mut w = world(&format!(
        "[domain]\nmin = [0, 0, 0]\nmax = [4, 4, 4]\n[resolution]\nspacing = 0.1\n\
         [[static]]\nshape = {{ box = {{ min = {low:?}, max = {high:?} }} }}\n\
         [[static]]\nshape = {{ sphere = {{ center = {:?}, radius = {} }} }}\n\
         [[flock]]\ncount = 1000\nshape = {{ box = {{ min = [0, 0, 0], max = [4, 4, 4] }} }}\nradius = 0.5\nspeed = 1\nwander = 0.5\n",
        BALL.0, BALL.1
    ));
    let (mut deepest, mut outside) = (f32::MIN, 0);
    for _ in 0..steps {
        let step = w.step(f64::INFINITY);
        assert!(step.dt * 1.5 < 0.25 * 0.5, "a step carries agents farther than a quarter of their radius");
        for r in &w.state().agents.record {
            let d: [f32; 3] = std::array::from_fn(|a| h[a] - (r.x[a] - b[a]).abs());
            deepest = deepest.max(d[0].min(d[1]).min(d[2]));
            deepest = deepest.max(BALL.1 - x(r).distance(Vec3::from(BALL.0)));
            outside += usize::from(!r.x.iter().all(|c| (0.0..=4.0).contains(c)));
        }
    }
    (deepest, outside)
}

#[test]
fn agents_enter_no_obstacle() {
    let (deepest, outside) = among_obstacles(10_000);
    println!("nearest to a surface: {:.4} m", -deepest);
    assert!(deepest < 0.0 && outside == 0, "{deepest} m deep, {outside} outside");
}
