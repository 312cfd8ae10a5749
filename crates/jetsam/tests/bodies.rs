//! Rigid bodies against mechanics: free fall, torque-free rotation, order of time integration.

mod common;

use common::{space, world};
use glam::DVec3;
use jetsam::World;

#[test]
fn free_fall_is_exact() {
    // kick-drift-kick integrates a constant acceleration exactly: z = v t - g t^2 / 2 to 1e-6 after 1e4 steps
    let mut w = world(
        &(space(10.0, 0.05, 1e-4).replace("[0, 0, 0]", "[0, 0, -9.81]")
            + "[[rigid]]\nshape = { sphere = { center = [0, 0, 0], radius = 0.12 } }\ndensity = 500\n\
               velocity = [0.25, 0, 1.5]\n"),
    );
    for _ in 0..10_000 {
        w.step(1e-4);
    }
    let body = &w.state().bodies.body[0];
    let t = w.time();
    assert!((t - 1.0).abs() < 1e-9);
    let expected = 1.5 * t - 0.5 * 9.81 * t * t;
    println!("fall off by {:.1e}", body.x.z / expected - 1.0);
    assert!((body.x.z / expected - 1.0).abs() < 1e-6, "{} {expected}", body.x.z);
    assert!((body.x.x / (0.25 * t) - 1.0).abs() < 1e-6);
    assert!((body.v.z / (1.5 - 9.81 * t) - 1.0).abs() < 1e-6);
    // its particles are where the body is (E21)
    let records = &w.state().bodies.record;
    let mean = records.iter().map(|r| DVec3::from(r.x.map(f64::from))).sum::<DVec3>() / records.len() as f64;
    assert!((mean - body.x).length() < 1e-5);
}

/// A free box of edges x, y, z (m), 1000 kg/m^3, spun with `omega` (rad/s).
fn spinning(size: [f64; 3], omega: [f64; 3], dt: f64) -> World {
    let [x, y, z] = size.map(|s| 0.5 * s);
    let [a, b, c] = omega;
    world(
        &(space(4.0, size[0] / 2.0, dt)
            + &format!(
                "[[rigid]]\nshape = {{ box = {{ min = [-{x}, -{y}, -{z}], max = [{x}, {y}, {z}] }} }}\ndensity = 1000\n\
                 spin = [{a}, {b}, {c}]\n"
            )),
    )
}

/// Times at which the body-frame angular velocity about y changes sign, and the largest relative drifts of the
/// angular momentum and of the energy.
fn flips(w: &mut World, dt: f64, until: f64) -> (Vec<f64>, f64, f64) {
    let read = |w: &World| {
        let b = &w.state().bodies.body[0];
        ((b.q.inverse() * b.omega).y, b.l, 0.5 * b.l.dot(b.omega), (b.q.length() - 1.0).abs())
    };
    let (mut before, l_0, e_0, _) = read(w);
    let (mut times, mut worst_l, mut worst_e) = (Vec::new(), 0.0f64, 0.0f64);
    while w.time() < until {
        w.step(dt);
        let (now, l, e, q) = read(w);
        if now * before < 0.0 {
            times.push(w.time() - dt * now / (now - before));
        }
        before = now;
        worst_l = worst_l.max((l - l_0).length() / l_0.length());
        worst_e = worst_e.max((e / e_0 - 1.0).abs());
        assert!(q < 1e-6);
    }
    println!("flips at {times:.5?}, drift of L {worst_l:.1e}, of E {worst_e:.1e}");
    (times, worst_l, worst_e)
}

#[test]
fn a_box_flips_about_its_middle_axis_with_the_period_of_euler() {
    // box 0.2 x 0.3 x 0.6 m of 1000 kg/m^3: inertia 1.35, 1.2, 0.39 kg m^2 about x, y, z; the middle axis is y.
    // omega = (0.01, 5, 0.01) on the axes of smallest, middle, largest inertia, z, y, -x (right-handed): T = 4 K(m) / n = 12.90124600 s,
    // omega_2 = 0 at 3.683444 and 10.134095 s
    let period = 12.901246;
    let dt = period / 2e4;
    let mut w = spinning([0.2, 0.3, 0.6], [-0.01, 5.0, 0.01], dt);
    let b = &w.state().bodies.body[0];
    let inertia = b.inverse_inertia.inverse();
    assert!((inertia.z_axis.z - 0.39).abs() < 1e-9 && (inertia.y_axis.y - 1.2).abs() < 1e-9);
    assert!((b.l.length() - 6.00001645).abs() < 1e-6);
    let (times, l, e) = flips(&mut w, dt, 5.1 * period);
    assert!(times.len() >= 10, "{times:?}");
    assert!((times[0] - 3.683444).abs() < 1e-4 * period && (times[1] - 10.134095).abs() < 1e-4 * period, "{times:?}");
    let measured = times[2] - times[0];
    assert!((measured / period - 1.0).abs() < 1e-4, "{measured}");
    assert!(l <= 1e-6, "angular momentum drifts by {l}");
    assert!(e <= 1e-5, "energy drifts by {e}");
}

#[test]
fn a_larger_box_too() {
    // box 1 x 2 x 3 m: inertia (2500, 5000, 6500) m^2 kg; omega = (0.001, 1, 0) on the axes of smallest, middle,
    // largest inertia: T = 67.86402871 s, omega_2 = 0 at 16.966168 and 50.898149 s
    let period = 67.86402871;
    let dt = period / 2e4;
    let mut w = spinning([1.0, 2.0, 3.0], [0.0, 1.0, 0.001], dt);
    let (times, l, e) = flips(&mut w, dt, 60.0);
    assert!((times[0] - 16.966168).abs() < 1e-4 * period && (times[1] - 50.898149).abs() < 1e-4 * period, "{times:?}");
    assert!(l <= 1e-6 && e <= 1e-5, "{l} {e}");
}

/// Where a ball of two ends up in the middle of an elastic, glancing contact.
fn flyby(dt: f64) -> DVec3 {
    let body = |x: f64, z: f64, v: f64| {
        format!(
            "[[rigid]]\nshape = {{ points = [[0, 0, 0]] }}\nmass = 1.0\nposition = [{x}, 0, {z}]\nvelocity = [{v}, 0, 0]\n\
             stiffness = 200.0\ndamping = 0.0\n"
        )
    };
    // in contact from beginning to end: the law is smooth there, as a measure of order needs
    let mut w = world(&(space(8.0, 1.0, dt) + &body(-0.3, -0.2, 0.5) + &body(0.3, 0.2, -0.5)));
    for _ in 0..(0.06 / dt).round() as usize {
        w.step(dt);
    }
    w.state().bodies.body[1].x
}

#[test]
fn leapfrog_is_of_second_order() {
    // slope of log error against log dt; the reference is the same motion at a far smaller step
    let exact = flyby(0.06 / 8192.0);
    let error = |steps: f64| (flyby(0.06 / steps) - exact).length();
    let (coarse, fine) = (error(2.0), error(8.0));
    let order = (coarse / fine).log2() / 2.0;
    println!("order {order:.3}");
    assert!((1.8..=2.2).contains(&order), "order {order}: {coarse} {fine}");
}

#[test]
fn semi_implicit_euler_is_of_first_order() {
    // a fall with integrator = "euler" is off by g dt t / 2
    let mut w = world(
        &(space(10.0, 0.05, 1e-2).replace("[0, 0, 0]", "[0, 0, -9.81]")
            + "integrator = \"euler\"\n[[rigid]]\nshape = { sphere = { center = [0, 0, 0], radius = 0.12 } }\n\
               density = 500\n"),
    );
    for _ in 0..100 {
        w.step(1e-2);
    }
    let z = w.state().bodies.body[0].x.z;
    let expected = -0.5 * 9.81 - 0.5 * 9.81 * 1e-2;
    assert!((z - expected).abs() < 1e-6, "{z} {expected}");
}

#[test]
fn an_oscillator_has_the_period_of_leapfrog() {
    // a body on a spring to a fixed particle: T_num / T = (w dt / 2) / asin(w dt / 2)
    for (per, expected) in [(20.0, 0.995859), (50.0, 0.999341)] {
        let period = std::f64::consts::TAU / 100.0; // m = 1 kg, k = 1e4 N/m
        let dt = period / per;
        let mut w = world(
            &(space(1.0, 0.1, dt).replace("[0, 0, 0]", "[0, 0, -9.81]")
                + "[[rigid]]\nshape = { points = [[0, 0, 0]] }\nmass = 1.0\nposition = [0, 0, 0.0995]\nstiffness = 1e4\n\
                   damping = 0.0\n[[static]]\nshape = { points = [[0, 0, 0]] }\n"),
        );
        // at rest it overlaps by m g / k = 9.81e-4 m; it starts 4.81e-4 m above that, and stays in contact
        let height = |w: &World| w.state().bodies.body[0].x.z - (0.1 - 9.81e-4);
        let (mut before, mut crossings) = (height(&w), Vec::new());
        for _ in 0..100 * per as usize {
            w.step(dt);
            let now = height(&w);
            if before > 0.0 && now <= 0.0 {
                crossings.push(w.time() - dt * now / (now - before));
            }
            before = now;
        }
        let measured = (crossings[crossings.len() - 1] - crossings[0]) / (crossings.len() - 1) as f64;
        assert!((measured / period - expected).abs() < 2e-5, "{}", measured / period);
    }
}
