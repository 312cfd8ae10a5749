//! Many bodies: what is conserved, stacks, cradles, fast bodies, heaps, overlaps at the beginning (B5, B7, B9, B10).

mod common;

use common::{scene, space, world};
use glam::DVec3;
use jetsam::{World, random};

/// Momentum, angular momentum about the origin, sum of the magnitudes of the momenta and of their moments.
fn momenta(w: &World) -> (DVec3, DVec3, f64, f64) {
    let b = &w.state().bodies.body;
    let p = b.iter().map(|b| b.mass * b.v).sum();
    let l = b.iter().map(|b| b.l + b.x.cross(b.mass * b.v)).sum();
    let scale = b.iter().map(|b| b.mass * b.v.length()).sum();
    (p, l, scale, b.iter().map(|b| b.l.length() + (b.x.cross(b.mass * b.v)).length()).sum())
}

#[test]
fn many_bodies_keep_their_momenta() {
    // B5, smaller: no walls, no gravity: |dP| <= 1e-5 of the sum of |p|, angular momentum <= 1e-4, with friction and spin
    let mut assembly = scene(
        "[world]\ngravity = [0, 0, 0]\n[domain]\nmin = [-1, -1, -1]\nmax = [1, 1, 1]\nwalls = [\"open\", \"open\", \"open\"]\n\
         [resolution]\nspacing = 0.04\n[solver]\ndt = 2e-4\n\
         [[rigid]]\nshape = { box = { min = [-0.04, -0.04, -0.04], max = [0.04, 0.04, 0.04] } }\ndensity = 1000\nvelocity = [1, 0, 0]\n\
         copies = { count = 216, grid = { columns = [6, 6], step = [0.12, 0.12, 0.12] }, tumble = true }\nposition = [-0.3, -0.3, -0.3]\n",
    )
    .assemble()
    .unwrap();
    for (i, b) in assembly.state.bodies.body.iter_mut().enumerate() {
        let draw = |k| 2.0 * random::uniform(5, k, i as u64) - 1.0;
        // they fly inwards, and spin
        b.v = 0.3 * DVec3::new(draw(0), draw(1), draw(2)) - b.x;
        let spin = 5.0 * DVec3::new(draw(3), draw(4), draw(5));
        b.l = b.inverse_inertia_at(b.q).inverse() * spin;
        b.omega = spin;
    }
    let mut w = World::new(assembly);
    let (p_0, l_0, p_scale, l_scale) = momenta(&w);
    let (mut worst_p, mut worst_l, mut touched) = (0.0f64, 0.0f64, 0);
    for _ in 0..3000 {
        w.step(f64::INFINITY);
        touched += w.state().bodies.body.iter().filter(|b| b.contacts > 0).count();
        if w.steps().is_multiple_of(100) {
            let (p, l, _, _) = momenta(&w);
            worst_p = worst_p.max((p - p_0).length() / p_scale);
            worst_l = worst_l.max((l - l_0).length() / l_scale);
        }
    }
    println!("momentum off by {worst_p:.1e}, angular momentum by {worst_l:.1e}, {touched} bodies touched");
    assert!(touched > 10_000, "they hardly meet");
    assert!(worst_p <= 1e-5 && worst_l <= 1e-4, "{worst_p} {worst_l}");
    assert_eq!(w.ledger().nonfinite, 0);
}

#[test]
fn a_stack_rests_on_its_overlaps() {
    // B7: overlap at contact i from the top = i m g / (n k); 10 cubes of 3 x 3 x 3 particles, n = 9; then it stays
    let (dx, k, m) = (0.02, 1e5, 0.2);
    let mut text = String::from(
        "[domain]\nmin = [-0.1, -0.1, 0]\nmax = [0.1, 0.1, 0.7]\nwalls = [\"open\", \"open\", \"solid\"]\n[resolution]\nspacing = 0.02\n",
    );
    for i in 0..10 {
        text += &format!(
            "[[rigid]]\nshape = {{ box = {{ min = [-0.03, -0.03, 0], max = [0.03, 0.03, 0.06] }} }}\nmass = {m}\nposition = [0.01, 0.01, {}]\n\
             stiffness = {k}\ndamping = 60\nfriction = 0.5\n",
            0.06 * f64::from(i)
        );
    }
    let mut w = world(&text);
    w.advance(1.0, |_, r| r.trouble.is_none());
    let height = |w: &World, i: usize| w.state().bodies.body[i].x.z;
    let mut sunk = 0.0;
    for i in 0..10 {
        sunk += (10 - i) as f64 * m * 9.81 / (9.0 * k);
        let expected = 0.03 + 0.06 * i as f64 - sunk;
        let off = (height(&w, i) - expected).abs() / sunk;
        assert!(off <= 0.01, "cube {i} at {}, expected {expected}: off by {off} of the overlaps", height(&w, i));
    }
    let kinetic = w.ledger().kinetic;
    println!("kinetic energy {:.1e} m g r", kinetic / (m * 9.81 * dx));
    assert!(kinetic < 1e-8 * m * 9.81 * dx, "{kinetic}");
    let before: Vec<DVec3> = w.state().bodies.body.iter().map(|b| b.x).collect();
    w.advance(3.0, |_, r| r.trouble.is_none());
    let drift = w.state().bodies.body.iter().zip(&before).map(|(b, x)| (b.x - *x).length()).fold(0.0, f64::max);
    println!("drift {:.1e} r in 2 s", drift / dx);
    assert!(drift < 1e-3 * dx, "drifts by {drift}");
}

/// A body of 4 particles at `times` the speed that the springs stop, against a wall one particle thick.
fn shot(times: f64) -> (f64, f64, World) {
    // r = 0.02 m, k = 1e5 N/m, four contacts, m = 2 kg: four times m* = 0.5 kg on one; v = r sqrt(k / m*) = 8.94 m/s
    let limit = 0.02 * (1e5f64 / 0.5).sqrt();
    let points = |n: i32, z: f64| {
        let one = |k: i32| {
            format!(
                "[{}, {}, {z}]",
                0.02 * f64::from(k % n) - 0.01 * f64::from(n - 1),
                0.02 * f64::from(k / n) - 0.01 * f64::from(n - 1)
            )
        };
        (0..n * n).map(one).collect::<Vec<_>>().join(", ")
    };
    let mut w = world(&format!(
        "[world]\ngravity = [0, 0, 0]\n[domain]\nmin = [-1, -1, -1]\nmax = [1, 1, 1]\nwalls = [\"open\", \"open\", \"open\"]\n[resolution]\nspacing = 0.02\n\
         [[rigid]]\nshape = {{ points = [{}] }}\nmass = 2.0\nposition = [0, 0, 0.05]\nvelocity = [0, 0, {}]\nstiffness = 1e5\ndamping = 0\n\
         [[static]]\nshape = {{ points = [{}] }}\n",
        points(2, 0.0),
        -times * limit,
        points(10, 0.0)
    ));
    w.advance(0.15 / (times * limit), |_, r| r.trouble.is_none());
    let b = &w.state().bodies.body[0];
    (b.x.z, b.v.z / (times * limit), w)
}

#[test]
fn springs_stop_what_they_can_and_say_what_they_cannot() {
    // B9: below the limit a body bounces elastically; above, it is stopped all the same, and counted
    for times in [0.5, 0.9] {
        let (z, e, w) = shot(times);
        println!("{times} x: at {z:.4} m with {e:.3} of its speed, {} fast", w.ledger().fast_contacts);
        assert!(z > 0.0 && (e - 1.0).abs() < 0.02 && w.ledger().fast_contacts == 0, "{times}: {z} {e}");
    }
    for times in [2.0, 10.0] {
        let (z, e, w) = shot(times);
        println!("{times} x: at {z:.4} m with {e:.3} of its speed, {} fast", w.ledger().fast_contacts);
        assert!(w.ledger().fast_contacts > 0, "{times}: not counted");
        assert!(z > 0.0 && (0.0..=1.0).contains(&e), "{times}: through to {z}");
    }
}

#[test]
fn a_cradle_passes_its_speed_on() {
    // B10: five balls with gaps of 0.01 r, elastic: the last one leaves with 0.99 of the speed
    let r = 0.1;
    let mut text = space(2.0, r, 2e-5);
    for i in 0..5 {
        let x = 1.01 * r * f64::from(i) - if i == 0 { 0.05 } else { 0.0 };
        let v = if i == 0 { 1.0 } else { 0.0 };
        text += &format!(
            "[[rigid]]\nshape = {{ points = [[0, 0, 0]] }}\nmass = 1.0\nposition = [{x}, 0, 0]\nvelocity = [{v}, 0, 0]\nstiffness = 1e7\ndamping = 0\n"
        );
    }
    let mut w = world(&text);
    w.advance(0.1, |_, _| true);
    let b = &w.state().bodies.body;
    println!("last ball {:.4}", b[4].v.x);
    assert!(b[4].v.x >= 0.99, "{}", b[4].v.x);
}

#[test]
fn bodies_that_overlap_are_moved_apart_before_time_begins() {
    let body = |x: f64, z: f64| {
        format!(
            "[[rigid]]\nshape = {{ box = {{ min = [-0.05, -0.05, -0.05], max = [0.05, 0.05, 0.05] }} }}\ndensity = 500\nposition = [{x}, 0, {z}]\n"
        )
    };
    // two boxes half inside each other, two at the same place, one sunk into the floor
    let text =
        "[world]\ngravity = [0, 0, -1e-6]\n[domain]\nmin = [-1, -1, 0]\nmax = [1, 1, 1]\n[resolution]\nspacing = 0.02\n"
            .to_owned()
            + &body(0.0, 0.5)
            + &body(0.045, 0.52)
            + &body(0.5, 0.5)
            + &body(0.5, 0.5) + &body(-0.5, 0.048);
    let mut w = world(&text);
    let said = w.model().warnings.iter().find(|s| s.contains("overlapped")).cloned();
    println!("{said:?}");
    assert!(said.is_some_and(|s| s.starts_with("4 bodies")), "{:?}", w.model().warnings);
    assert_eq!(w.state().bodies.body[4].x.z, 0.048, "an overlap that springs hold stays");
    w.advance(0.2, |_, r| r.trouble.is_none());
    for b in &w.state().bodies.body[..4] {
        assert!(b.v.length() < 0.02, "{} thrown with {} m/s", b.name, b.v.length());
    }
}

#[test]
fn a_heap_comes_to_rest_on_the_floor() {
    // 200 bodies dropped into a box: energy decays, nothing is lost, none is below the floor
    let mut w = world(
        "[domain]\nmin = [0, 0, 0]\nmax = [0.4, 0.4, 1.6]\n[resolution]\nspacing = 0.02\n\
         [[rigid]]\nshape = { box = { min = [-0.03, -0.03, -0.03], max = [0.03, 0.03, 0.03] } }\ndensity = 1000\nfriction = 0.5\n\
         position = [0.06, 0.06, 0.1]\n\
         copies = { count = 144, grid = { columns = [4, 4], step = [0.09, 0.09, 0.11] }, tumble = true }\n",
    );
    let begin = w.ledger().kinetic + w.ledger().potential;
    let mut last = f64::INFINITY;
    for _ in 0..4 {
        let until = w.time() + 0.5;
        w.advance(until, |_, r| r.trouble.is_none());
        let l = w.ledger();
        let now = l.kinetic + l.potential;
        println!(
            "{:.2} s: energy {:.4} of the first, kinetic {:.2e} J, fast {}",
            w.time(),
            now / begin,
            l.kinetic,
            l.fast_contacts
        );
        assert!(now <= last * 1.001, "energy grows: {now} after {last}");
        last = now;
    }
    let l = w.ledger();
    assert_eq!((l.lost, l.rigid_lost, l.nonfinite), (0, 0, 0));
    let rest =
        (2.0 * l.kinetic / w.state().bodies.body.iter().filter(|b| !b.is_static()).map(|b| b.mass).sum::<f64>()).sqrt();
    println!("mean speed {rest:.2e} m/s");
    assert!(rest < 0.01, "still moves at {rest} m/s");
    for b in w.state().bodies.body.iter().filter(|b| !b.is_static()) {
        assert!(b.x.min_element() > 0.0 && b.x.x < 0.4 && b.x.y < 0.4, "{} at {}", b.name, b.x);
    }
}
