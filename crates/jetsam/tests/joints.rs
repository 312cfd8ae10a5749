//! Joints (E32): pendulums against their closed form, what is conserved, what stays in place.

mod common;

use common::{space, world};
use glam::DVec3;
use jetsam::World;

/// Complete elliptic integral of the first kind, by the arithmetic-geometric mean; `k` is the modulus.
fn elliptic_k(k: f64) -> f64 {
    let (mut a, mut b) = (1.0, (1.0 - k * k).sqrt());
    for _ in 0..40 {
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    std::f64::consts::PI / (2.0 * a)
}

/// A bar 0.4 m long that hangs from its end by a joint, let go level.
fn pendulum(kind: &str, dt: f64) -> World {
    world(
        &(space(2.0, 0.05, dt).replace("[0, 0, 0]", "[0, 0, -9.81]")
            + &format!(
                "[[rigid]]\nname = \"bar\"\nshape = {{ box = {{ min = [0, -0.05, -0.05], max = [0.4, 0.05, 0.05] }} }}\ndensity = 1000\n\
                 [[joint]]\nkind = \"{kind}\"\na = \"bar\"\nanchor = [0, 0, 0]\naxis = [0, 1, 0]\n"
            )),
    )
}

#[test]
fn a_bar_swings_with_the_period_of_a_physical_pendulum() {
    // T = 4 K(sin(theta / 2)) sqrt(I / (m g l)), theta = 90 degrees, I = I_c + m l^2
    for kind in ["ball", "hinge"] {
        let dt = 1e-3;
        let mut w = pendulum(kind, dt);
        let b = &w.state().bodies.body[0];
        let (m, l) = (b.mass, 0.2);
        let inertia = 1.0 / b.inverse_inertia.y_axis.y + m * l * l;
        let period = 4.0 * elliptic_k(std::f64::consts::FRAC_1_SQRT_2) * (inertia / (m * 9.81 * l)).sqrt();
        let energy = |w: &World| {
            let b = &w.state().bodies.body[0];
            0.5 * (m * b.v.length_squared() + b.l.dot(b.omega)) + m * 9.81 * b.x.z
        };
        let e_0 = energy(&w);
        let (mut before, mut crossings, mut drift, mut gap) = (0.0, Vec::new(), 0.0f64, 0.0f64);
        while w.time() < 5.2 * period {
            w.step(dt);
            let b = &w.state().bodies.body[0];
            let now = b.x.x;
            if now * before < 0.0 {
                crossings.push(w.time() - dt * now / (now - before));
            }
            before = now;
            gap = gap.max((b.x + b.q * DVec3::new(-0.2, 0.0, 0.0)).length());
            drift = drift.max((energy(&w) - e_0).abs() / (m * 9.81 * l));
        }
        let n = crossings.len() - 1;
        let measured = 2.0 * (crossings[n] - crossings[0]) / n as f64;
        println!("{kind}: period {measured:.6} s, {period:.6} expected; energy {drift:.1e}, gap {gap:.1e} m");
        assert!((measured / period - 1.0).abs() < 1e-4, "{measured} {period}");
        assert!(drift < 1e-4, "energy drifts by {drift}");
        assert!(gap < 1e-8, "the joint opens by {gap} m");
        assert!(w.momentum_residual() < 1e-3, "{}", w.momentum_residual());
    }
}

#[test]
fn a_jointed_bar_is_integrated_to_second_order() {
    let at = |steps: f64| {
        let mut w = pendulum("ball", 0.5 / steps);
        for _ in 0..steps as usize {
            w.step(0.5 / steps);
        }
        w.state().bodies.body[0].x
    };
    let exact = at(4096.0);
    let order = ((at(64.0) - exact).length() / (at(256.0) - exact).length()).log2() / 2.0;
    println!("order {order:.3}");
    assert!((1.8..=2.2).contains(&order), "order {order}");
}

#[test]
fn a_free_chain_keeps_its_momenta() {
    // five links in space, the last one thrown: momentum and angular momentum stay, the links stay together
    let dt = 1e-3;
    let mut text = space(6.0, 0.05, dt);
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
            "[[joint]]\nkind = \"{kind}\"\na = \"link{k}\"\nb = \"link{}\"\nanchor = [{}, 0, 0]\naxis = [0, 1, 0]\n",
            k + 1,
            0.2 * k as f64 + 0.1
        );
    }
    let mut w = world(&text);
    let momenta = |w: &World| {
        let b = &w.state().bodies.body;
        let p: DVec3 = b.iter().map(|b| b.mass * b.v).sum();
        let l: DVec3 = b.iter().map(|b| b.l + b.x.cross(b.mass * b.v)).sum();
        (p, l, b.iter().map(|b| 0.5 * (b.mass * b.v.length_squared() + b.l.dot(b.omega))).sum::<f64>())
    };
    w.step(dt); // the throw is shared: inelastic
    let (p_0, l_0, e_0) = momenta(&w);
    let mut worst = 0.0f64;
    for _ in 0..2000 {
        w.step(dt);
        let (_, _, e) = momenta(&w);
        worst = worst.max((e / e_0 - 1.0).abs());
    }
    let (p, l, _) = momenta(&w);
    println!(
        "momentum off by {:.1e}, angular by {:.1e}, energy by {worst:.1e}",
        (p - p_0).length() / p_0.length(),
        (l - l_0).length() / l_0.length()
    );
    assert!((p - p_0).length() < 1e-9 * p_0.length());
    assert!((l - l_0).length() < 1e-6 * l_0.length());
    assert!(worst < 1e-2, "energy drifts by {worst}");
    let b = &w.state().bodies.body;
    for k in 0..4 {
        let ends = b[k].x + b[k].q * (0.1 * DVec3::X) - (b[k + 1].x - b[k + 1].q * (0.1 * DVec3::X));
        assert!(ends.length() < 1e-6, "joint {k} opens by {}", ends.length());
    }
    // the hinge between 1 and 2 keeps its axis; 3 and 4 keep their orientation
    assert!((b[1].q * DVec3::Y).cross(b[2].q * DVec3::Y).length() < 1e-6);
    assert!((b[3].q.inverse() * b[4].q).to_scaled_axis().length() < 1e-6);
}

#[test]
fn two_bodies_fixed_together_turn_as_one() {
    // two halves of a bar, pushed at one end, against the whole bar: same motion
    let dt = 1e-3;
    let half = |name: &str, x: f64| {
        format!(
            "[[rigid]]\nname = \"{name}\"\nshape = {{ box = {{ min = [-0.1, -0.05, -0.05], max = [0.1, 0.05, 0.05] }} }}\n\
             density = 1000\nposition = [{x}, 0, 0]\n"
        )
    };
    let spring = |name: &str| {
        format!(
            "[[joint]]\nkind = \"spring\"\na = \"{name}\"\nanchor = [0.2, 0.05, 0]\nanchor_b = [0.2, 0.5, 0.1]\nstiffness = 40\nlength = 0.1\n"
        )
    };
    let mut two = world(
        &(space(2.0, 0.05, dt)
            + &half("left", -0.1)
            + &half("right", 0.1)
            + "[[joint]]\nkind = \"fixed\"\na = \"left\"\nb = \"right\"\nanchor = [0, 0, 0]\n"
            + &spring("right")),
    );
    let mut one = world(
        &(space(2.0, 0.05, dt)
            + "[[rigid]]\nname = \"bar\"\nshape = { box = { min = [-0.2, -0.05, -0.05], max = [0.2, 0.05, 0.05] } }\ndensity = 1000\n"
            + &spring("bar")),
    );
    for _ in 0..1500 {
        two.step(dt);
        one.step(dt);
    }
    let (halves, bar) = (&two.state().bodies.body, &one.state().bodies.body[0]);
    let middle = 0.5 * (halves[0].x + halves[1].x);
    println!("apart by {:.1e} m after moving {:.3} m", (middle - bar.x).length(), bar.x.length());
    assert!(bar.x.length() > 0.05, "the spring pulls");
    assert!((middle - bar.x).length() < 1e-4 && (halves[1].q.inverse() * bar.q).to_scaled_axis().length() < 1e-3);
}

#[test]
fn a_hinge_stops_at_its_limit() {
    let mut w = world(
        &(space(2.0, 0.05, 1e-3).replace("[0, 0, 0]", "[0, 0, -9.81]")
            + "[[rigid]]\nname = \"door\"\nshape = { box = { min = [0, -0.05, -0.05], max = [0.4, 0.05, 0.05] } }\ndensity = 1000\n\
               [[joint]]\nkind = \"hinge\"\na = \"door\"\nanchor = [0, 0, 0]\naxis = [0, 1, 0]\nlimits = [-10, 40]\n"),
    );
    w.advance(2.0, |_, _| true);
    let b = &w.state().bodies.body[0];
    let angle = (-b.x.z).atan2(b.x.x).to_degrees();
    println!("stops at {angle:.4} degrees");
    assert!((angle - 40.0).abs() < 0.1, "{angle}");
}

#[test]
fn joints_that_make_no_sense_are_refused() {
    let body = "[[rigid]]\nname = \"bar\"\nshape = { points = [[0, 0, 0]] }\nmass = 1.0\n";
    for (joint, word) in [
        ("kind = \"ball\"\na = \"bra\"\nanchor = [0, 0, 0]\n", "no body `bra`"),
        ("kind = \"ball\"\na = \"bar\"\nb = \"bar\"\nanchor = [0, 0, 0]\n", "not joined to itself"),
        ("kind = \"hinge\"\na = \"bar\"\nanchor = [0, 0, 0]\naxis = [0, 0, 0]\n", "no direction"),
        ("kind = \"hinge\"\na = \"bar\"\nanchor = [0, 0, 0]\nlimits = [10, 20]\n", "must hold 0"),
    ] {
        let scene = common::scene(&(space(1.0, 0.1, 1e-3) + body + "[[joint]]\n" + joint));
        let error = World::from_scene(&scene).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
}
