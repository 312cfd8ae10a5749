//! Agents among fluids and bodies: drag (E27), contact (E28), and what becomes of momentum.

mod common;

use common::world;
use glam::{DVec3, Vec3};
use jetsam::World;
use jetsam::state::Record;

/// A periodic box of still water with one agent that nothing steers but `rule`: 10 g, `C_d A rho / 2 = 0.01 kg/m`, 1 m/s.
fn swimmer(rule: &str) -> World {
    // C_d = 2: size = sqrt(0.01 / (rho pi))
    let size = (0.01f64 / (1000.0 * std::f64::consts::PI)).sqrt();
    world(&format!(
        "[world]\ngravity = [0, 0, 0]\n[domain]\nmin = [0, 0, 0]\nmax = [1, 1, 1]\nwalls = [\"periodic\", \"periodic\", \"periodic\"]\n\
         [resolution]\nspacing = 0.1\n[[fluid]]\nshape = {{ box = {{ min = [0, 0, 0], max = [1, 1, 1] }} }}\n\
         [[flock]]\ncount = 1\nshape = {{ points = [[0.31, 0.52, 0.43]] }}\nheading = [1, 0.6, 0.3]\nradius = 0.3\nspeed = 1\nspeed_min = 0\n\
         mass = 0.01\ndrag = 2\nsize = {size}\n{rule}\n"
    ))
}

fn speed(w: &World) -> f64 {
    f64::from(Vec3::from(w.state().agents.record[0].v).length())
}

#[test]
fn drag_slows_an_agent_as_the_closed_form_has_it() {
    // m v' = -k v^2: v = v0 / (1 + k v0 t / m)
    let mut w = swimmer("cruise = 0");
    for t in [0.5, 1.0, 2.0] {
        w.advance(t, |_, _| true);
        let expected = 1.0 / (1.0 + t);
        println!("{t} s: {:.5} m/s, closed form {expected:.5}", speed(&w));
        assert!((speed(&w) - expected).abs() < 1e-3 * expected, "{} m/s at {t} s, not {expected}", speed(&w));
    }
}

#[test]
fn an_agent_cruises_where_drag_holds_its_thrust() {
    // rate (U - v) = k v^2 / m, with k / m = 1 / m and rate = U / R
    let mut w = swimmer("cruise = 1");
    w.advance(3.0, |_, _| true);
    let rate = 1.0 / 0.3;
    let expected = 0.5 * (-rate + f64::sqrt(rate * rate + 4.0 * rate));
    println!("{:.5} m/s, closed form {expected:.5}", speed(&w));
    assert!((speed(&w) - expected).abs() < 1e-3 * expected, "{} m/s, not {expected}", speed(&w));
}

#[test]
fn what_agents_lose_the_fluid_gets() {
    let mut w = world(
        "[world]\ngravity = [0, 0, 0]\nseed = 3\n[domain]\nmin = [0, 0, 0]\nmax = [1, 1, 1]\nwalls = [\"periodic\", \"periodic\", \"periodic\"]\n\
         [resolution]\nspacing = 0.1\n[[fluid]]\nshape = { box = { min = [0, 0, 0], max = [1, 1, 1] } }\n\
         [[flock]]\ncount = 60\nshape = { box = { min = [0, 0, 0], max = [1, 1, 1] } }\nradius = 0.3\nspeed = 1\nheading = [1, 0, 0]\n\
         mass = 2\nsize = 0.05\nwander = 0.5\n",
    );
    let mut worst = 0.0f64;
    for _ in 0..200 {
        w.step(f64::INFINITY);
        let l = w.ledger();
        worst = worst.max((l.total_force - l.external_force).length() / l.force_scale);
    }
    let water: DVec3 = w.fluid().map(|r| 1.0 * Vec3::from(r.v).as_dvec3()).sum();
    println!("force {worst:.1e}, momentum {:.1e} of the scale; the water has {water}", w.momentum_residual());
    assert!(worst < 1e-6, "action and reaction differ by {worst}");
    assert!(w.momentum_residual() < 1e-6, "{}", w.momentum_residual());
    assert!(water.x > 5.0, "the agents drag the water along: {water}");
}

#[test]
fn what_agents_lose_a_body_gets() {
    let mut w = world(
        "[world]\ngravity = [0, 0, 0]\n[domain]\nmin = [-2, -2, -2]\nmax = [2, 2, 2]\nwalls = [\"open\", \"open\", \"open\"]\n\
         [resolution]\nspacing = 0.05\n[[rigid]]\nshape = { box = { min = [-0.2, -0.2, -0.2], max = [0.2, 0.2, 0.2] } }\nmass = 5\n\
         [[flock]]\ncount = 40\nshape = { box = { min = [-0.9, -0.3, -0.25], max = [-0.4, 0.2, 0.2] } }\nradius = 0.2\nspeed = 1\n\
         heading = [1, 0, 0]\nmass = 0.1\nsize = 0.02\navoid = 0\ncohesion = 0\n",
    );
    let mut worst = 0.0f64;
    while w.time() < 1.0 {
        w.step(1.0 - w.time());
        let l = w.ledger();
        worst = worst.max((l.total_force - l.external_force).length() / l.force_scale.max(1e-3));
    }
    let body = &w.state().bodies.body[0];
    println!(
        "force {worst:.1e}, momentum {:.1e}; the body flies at {}, spin {}",
        w.momentum_residual(),
        body.v,
        body.omega
    );
    assert!(worst < 1e-6, "action and reaction differ by {worst}");
    assert!(w.momentum_residual() < 1e-6, "{}", w.momentum_residual());
    assert!(body.v.x > 0.1 && body.omega.length() > 1e-3, "{} {}", body.v, body.omega);
}

#[test]
fn an_agent_bounces_off_a_body_by_its_restitution() {
    // head-on against the middle of a face of a free block, restitution 1: v' = v (m - M) / (m + M), V = 2 m v / (m + M)
    let mut w = world(
        "[world]\ngravity = [0, 0, 0]\n[domain]\nmin = [-2, -2, -2]\nmax = [2, 2, 2]\nwalls = [\"open\", \"open\", \"open\"]\n\
         [resolution]\nspacing = 0.05\n[[rigid]]\nshape = { box = { min = [-0.2, -0.2, -0.2], max = [0.2, 0.2, 0.2] } }\nmass = 3\nrestitution = 1\n\
         [[flock]]\ncount = 1\nshape = { points = [[-0.6, 0, 0]] }\nradius = 0.2\nspeed = 1\nspeed_min = 0\nheading = [1, 0, 0]\nmass = 1\n\
         size = 0.02\navoid = 0\ncruise = 0\n",
    );
    w.advance(0.8, |_, _| true);
    let (v, body) = (w.state().agents.record[0].v[0], w.state().bodies.body[0].v.x);
    println!("agent {v:.4} m/s, body {body:.4} m/s");
    assert!((v + 0.5).abs() < 0.02 && (body - 0.5).abs() < 0.02, "agent {v}, body {body}");
}

#[test]
fn a_swarm_pushes_a_floating_crate() {
    let run = |count: u32| {
        let mut w = world(&format!(
            "[world]\ndimensions = 2\n[domain]\nmin = [0, 0, 0]\nmax = [1.2, 0, 0.6]\n[resolution]\nspacing = 0.02\n\
             [solver]\nsound_speed = 15\n[[fluid]]\nshape = {{ box = {{ min = [0, 0, 0], max = [1.2, 0, 0.2] }} }}\n\
             [[rigid]]\nname = \"crate\"\nshape = {{ box = {{ min = [-0.06, 0, -0.06], max = [0.06, 0, 0.06] }} }}\ndensity = 500\n\
             position = [0.4, 0, 0.2]\n\
             [[flock]]\ncount = {count}\nshape = {{ box = {{ min = [0.05, 0, 0.14], max = [0.25, 0, 0.22] }} }}\nradius = 0.1\n\
             separation_radius = 0.03\nspeed = 0.5\nheading = [1, 0, 0]\ngoal = [1.5, 0, 0.2]\nmass = 0.5\nsize = 0.01\navoid = 0\n"
        ));
        w.advance(1.5, |_, r| r.trouble.is_none());
        // water at rest has next to no momentum: what single precision loses shows against the impulse of its weight
        let missing = w.momentum_residual() * w.ledger().momentum_scale;
        let impulse = 9.81 * 1.5 * 1000.0 * 1.2 * 0.2;
        println!("{missing:.1e} N s missing, {:.1e} of the impulse of the weight", missing / impulse);
        assert!(missing < 1e-6 * impulse, "{missing} N s of {impulse}");
        w.state().bodies.body[0].x.x - 0.4
    };
    let (alone, pushed) = (run(1), run(12));
    println!("one agent moves the crate by {alone:.3} m, twelve by {pushed:.3} m");
    assert!(pushed > 0.1 && pushed > 2.0 * alone, "{pushed} m, by one {alone} m");
}

#[test]
fn birds_scatter_from_spray() {
    let wet = |meets: &str| {
        let mut w = world(&format!(
            "[domain]\nmin = [-1, -1, 0]\nmax = [1, 1, 2]\n[resolution]\nspacing = 0.05\n\
             [[fluid]]\nshape = {{ sphere = {{ center = [0, 0, 1.6], radius = 0.2 }} }}\n\
             [[flock]]\ncount = 200\nshape = {{ sphere = {{ center = [0, 0, 0.8], radius = 0.4 }} }}\nradius = 0.3\nseparation_radius = 0.1\n\
             speed = 0.5\nspeed_max = 4\nsight = 0.6\nflee = 15\nmargin = 0.1\n{meets}\n"
        ));
        // agents with water within 0.1 m, all steps until it passed
        let mut wet = 0.0;
        while w.time() < 0.5 {
            let dt = w.step(0.5 - w.time()).dt;
            let near = |r: &&Record| w.fluid().any(|f| Vec3::from(f.x).distance(Vec3::from(r.x)) < 0.1);
            wet += w.state().agents.record.iter().filter(near).count() as f64 * dt;
        }
        wet
    };
    let (fleeing, careless) = (wet("meets = { fluids = \"flee\" }"), wet(""));
    println!("agent-seconds near water: {fleeing:.3} fleeing, {careless:.3} not");
    assert!(fleeing < 0.3 * careless, "{fleeing}, careless {careless}");
}

#[test]
fn agents_in_water_with_bodies_have_the_same_bits_for_any_number_of_threads() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut w = world(
                "[domain]\nmin = [0, 0, 0]\nmax = [1, 0.6, 0.8]\n[resolution]\nspacing = 0.04\n[solver]\nsound_speed = 20\n\
                 [[fluid]]\nshape = { box = { min = [0, 0, 0], max = [1, 0.6, 0.3] } }\n\
                 [[rigid]]\nshape = { sphere = { center = [0, 0, 0], radius = 0.1 } }\ndensity = 500\nposition = [0.5, 0.3, 0.42]\n\
                 [[flock]]\ncount = 700\nshape = { box = { min = [0.1, 0.1, 0.1], max = [0.9, 0.5, 0.35] } }\nradius = 0.15\n\
                 separation_radius = 0.05\nspeed = 0.6\nwander = 0.5\nmass = 0.05\nsize = 0.01\n\
                 goal = [0.5, 0.3, 0.3]\nseek = 0.3\nmeets = { fluids = \"school\" }\n",
            );
            w.advance(0.15, |_, _| true);
            jetsam::state_hash(w.state())
        })
    };
    let one = run(1);
    for threads in [2, 4] {
        assert_eq!(one, run(threads), "{threads} threads");
    }
}

#[test]
fn a_school_flees_a_falling_body() {
    let close = |meets: &str| {
        let mut w = world(&format!(
            "[domain]\nmin = [-1, -1, 0]\nmax = [1, 1, 2]\n[resolution]\nspacing = 0.05\n\
             [[rigid]]\nshape = {{ sphere = {{ center = [0, 0, 0], radius = 0.15 }} }}\ndensity = 500\nposition = [0, 0, 1.6]\n\
             [[flock]]\ncount = 200\nshape = {{ sphere = {{ center = [0, 0, 0.6], radius = 0.4 }} }}\nradius = 0.3\nseparation_radius = 0.1\n\
             speed = 0.5\nspeed_max = 4\nsight = 0.9\nflee = 15\nmargin = 0.1\navoid = 0\n{meets}\n"
        ));
        // agents closer than 0.1 m to the surface, all steps until it passed
        let mut close = 0.0;
        while w.time() < 0.5 {
            let dt = w.step(0.5 - w.time()).dt;
            let ball = w.state().bodies.body[0].x.as_vec3();
            let near = w.state().agents.record.iter().filter(|r| Vec3::from(r.x).distance(ball) < 0.25).count();
            close += near as f64 * dt;
        }
        close
    };
    let (fleeing, careless) = (close("meets = { bodies = \"flee\" }"), close(""));
    println!("agent-seconds near the ball: {fleeing:.3} fleeing, {careless:.3} not");
    assert!(fleeing < 0.3 * careless, "{fleeing}, careless {careless}");
}
