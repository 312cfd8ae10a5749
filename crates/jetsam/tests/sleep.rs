//! Bodies at rest sleep, and wake when something touches them.

mod common;

use common::world;
use jetsam::World;

fn asleep(w: &World) -> usize {
    w.state().bodies.body.iter().filter(|b| b.asleep).count()
}

/// A wall of 3 x 4 bricks on a floor; `extra` is added.
fn bricks(sleep: f64, extra: &str) -> World {
    world(&format!(
        "[domain]\nmin = [-0.4, -0.2, 0]\nmax = [0.4, 0.2, 1.2]\n[resolution]\nspacing = 0.02\n[solver]\nsleep = {sleep}\n\
         [[rigid]]\nname = \"brick\"\nshape = {{ box = {{ min = [-0.06, -0.04, 0], max = [0.06, 0.04, 0.06] }} }}\ndensity = 1000\n\
         position = [-0.14, 0.01, 0]\ncopies = {{ count = 12, grid = {{ columns = [3, 1], step = [0.14, 0, 0.06] }} }}\n{extra}"
    ))
}

#[test]
fn a_wall_of_bricks_falls_asleep_and_the_floor_still_bears_it() {
    let mut w = bricks(0.3, "");
    let weight: f64 = w.state().bodies.body.iter().filter(|b| !b.is_static()).map(|b| b.mass * 9.81).sum();
    w.advance(1.2, |_, r| r.trouble.is_none());
    for b in &w.state().bodies.body {
        println!(
            "{} v {:.1e} w {:.1e} contacts {} still {:.2}",
            b.name,
            b.v.length(),
            b.omega.length(),
            b.contacts,
            b.still
        );
    }
    assert_eq!(asleep(&w), 12);
    let before: Vec<_> = w.state().bodies.body.iter().map(|b| b.x).collect();
    w.advance(1.6, |_, r| r.trouble.is_none());
    assert!(w.state().bodies.body.iter().zip(&before).all(|(b, x)| b.x == *x), "they lie still");
    let floor = w.state().bodies.body.iter().find(|b| b.name == "walls").unwrap();
    println!(
        "floor bears {:.4} of the weight, residual {:.1e}",
        -floor.force_contact.z / weight,
        w.momentum_residual()
    );
    assert!((-floor.force_contact.z / weight - 1.0).abs() < 0.01);
    // nothing to do for them: no neighbour was looked for
    let sleepers = w.state().particles.segment(jetsam::state::Kind::Rigid).len();
    assert!(w.state().forces_on_bodies().take(sleepers).all(|f| f == [0.0; 3]));
    // and without sleep nobody sleeps
    let mut awake = bricks(0.0, "");
    awake.advance(1.2, |_, r| r.trouble.is_none());
    assert_eq!(asleep(&awake), 0);
}

#[test]
fn a_body_that_falls_on_a_sleeping_pile_wakes_it() {
    // the ball arrives after the wall has fallen asleep
    let ball = "[[rigid]]\nname = \"ball\"\nshape = { sphere = { center = [0, 0, 0], radius = 0.07 } }\ndensity = 3000\nposition = [0.03, 0, 1.05]\n\
                velocity = [0, 0, 3.9]\n";
    let mut w = bricks(0.2, &ball.replace("[0, 0, 3.9]", "[0, 0, 0]"));
    // let it fall only later: nobody holds it, so measure the pile before it lands, t = sqrt(2 (1.05 - 0.31) / g) = 0.388 s
    w.advance(0.37, |_, r| r.trouble.is_none());
    let sleepers = asleep(&w);
    w.advance(0.6, |_, r| r.trouble.is_none());
    println!("{sleepers} slept before the ball came, {} after", asleep(&w));
    assert!(sleepers >= 6, "{sleepers} asleep");
    assert!(asleep(&w) < sleepers);
}

#[test]
fn water_wakes_a_sleeping_body() {
    let mut w = world(
        "[domain]\nmin = [0, 0, 0]\nmax = [1.2, 0.2, 0.5]\n[resolution]\nspacing = 0.025\n[solver]\nsleep = 0.1\n\
         [[fluid]]\nshape = { box = { min = [0, 0, 0], max = [0.25, 0.2, 0.3] } }\n\
         [[rigid]]\nshape = { box = { min = [-0.05, -0.05, 0], max = [0.05, 0.05, 0.1] } }\ndensity = 300\nposition = [1.0, 0.1, 0]\n",
    );
    w.advance(0.25, |_, r| r.trouble.is_none());
    assert_eq!(asleep(&w), 1);
    w.advance(0.8, |_, r| r.trouble.is_none());
    let b = &w.state().bodies.body[0];
    println!("the block is at {:.3} m", b.x.x);
    assert!(b.x.x > 1.05 || b.v.x.abs() > 0.1, "the wave takes it along: {} {}", b.x, b.v);
}
