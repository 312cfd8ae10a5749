//! PBF on a budget of rounds (E9): a fluid that yields as far as is stated, gains no energy, does not clump, and loses nothing.

mod common;

use common::world;
use jetsam::{Scene, World};

/// Kinetic and potential energy (J).
fn energy(w: &World) -> f64 {
    w.ledger().kinetic + w.ledger().potential
}

/// Largest and mean compression.
fn compressed(w: &World) -> [f64; 2] {
    let p = &w.state().particles;
    let all = p.density[..p.count[0]].iter().map(|d| f64::from((d - 1.0).max(0.0)));
    [all.clone().fold(0.0, f64::max), all.sum::<f64>() / p.count[0] as f64]
}

/// Runs a world, which loses nothing on its way and never has more energy than at first, by so small a fraction; returns the largest
/// compression ever, and the mean over time of the mean.
fn watch(w: &mut World, until: f64, slack: f64, what: &str) -> [f64; 2] {
    let (fluid, start, begin) = (w.ledger().fluid, energy(w), w.time());
    let (mut largest, mut mean) = (0.0f64, 0.0);
    w.advance(until, |w, step| {
        let [most, now] = compressed(w);
        (largest, mean) = (largest.max(most), mean + now * step.dt);
        let gained = energy(w) / start - 1.0;
        assert!(gained <= slack, "{what}: {gained} of its energy gained at {} s", w.time());
        step.trouble.is_none()
    });
    assert!((w.time() - until).abs() < 1e-9, "{what}: stopped at {} s", w.time());
    let l = w.ledger();
    assert_eq!((l.fluid, l.lost, l.rigid_lost, l.nonfinite), (fluid, 0, 0, 0), "{what}");
    [largest, mean / (until - begin)]
}

/// What a column of a fluid yields to its weight at the bottom where pressure has so many rounds: `0.16 / reach`, as the step is bound
/// by `dt sqrt(g H) <= 0.4 dx`, and Chebyshev's rounds reach `2/3 n (n + 1)` as far as one of Jacobi's.
fn yields(w: &World, rounds: f64) -> f64 {
    0.16 / (2.0 / 3.0 * rounds * (rounds + 1.0) * f64::from(w.model().factors.reach))
}

#[test]
fn a_tank_at_rest_yields_as_far_as_its_rounds_reach() {
    for rounds in [2.0, 4.0, 8.0] {
        let mut w = world(&format!(
            "[world]\ndimensions = 2\n[domain]\nmin = [0, 0, 0]\nmax = [0.5, 0, 1]\n[resolution]\nspacing = 0.0125\n\
             [[fluid]]\nshape = {{ box = {{ min = [0, 0, 0], max = [0.5, 0, 0.3] }} }}\n\
             [solver]\npressure = \"pbf\"\niterations = {rounds}\n"
        ));
        watch(&mut w, 1.0, 1e-3, &format!("{rounds} rounds"));
        let [most, mean] = watch(&mut w, 1.5, 1e-3, &format!("{rounds} rounds"));
        let stated = yields(&w, rounds);
        println!(
            "{rounds} rounds: {mean} {most}, stated {}; {} m/s, E_k {}",
            0.5 * stated,
            w.ledger().speed,
            w.ledger().kinetic
        );
        assert!(mean < stated, "{rounds} rounds: compressed by {mean}, half of {stated} stated");
        assert!(most < 0.3, "{rounds} rounds: a particle is compressed by {most}");
        // at rest: less than would lift all by a tenth of a spacing
        let hop = w.ledger().kinetic / (9.81 * 1000.0 * 0.15);
        assert!(hop < 0.1 * 0.0125, "{rounds} rounds: enough heat to lift all by {hop} m");
    }
}

#[test]
fn a_dam_that_collapses_gains_no_energy() {
    for (rounds, bar) in [(2, 0.06), (4, 0.02), (8, 0.01)] {
        let mut w = world(&format!(
            "[domain]\nmin = [0, 0, 0]\nmax = [1.6, 0.25, 1]\n[resolution]\nspacing = 0.03125\n\
             [[fluid]]\nshape = {{ box = {{ min = [0, 0, 0], max = [0.5, 0.25, 0.75] }} }}\n\
             [solver]\npressure = \"pbf\"\niterations = {rounds}\n"
        ));
        let [most, mean] = watch(&mut w, 1.0, 1e-3, &format!("{rounds} rounds"));
        println!("{rounds} rounds: {mean} {most} {}", energy(&w));
        assert!(mean < bar && most < 1.0, "{rounds} rounds: compressed by {mean}, at most by {most}");
    }
}

#[test]
fn a_drop_of_ten_metres_is_borne() {
    for rounds in [2, 4, 8] {
        let mut w = world(&format!(
            "[world]\ndimensions = 2\n[domain]\nmin = [0, 0, 0]\nmax = [2, 0, 24]\n[resolution]\nspacing = 0.05\n\
             [solver]\npressure = \"pbf\"\niterations = {rounds}\n\
             [[fluid]]\nshape = {{ box = {{ min = [0, 0, 0], max = [2, 0, 0.5] }} }}\n\
             [[fluid]]\nshape = {{ box = {{ min = [0.2, 0, 10], max = [0.8, 0, 10.6] }} }}\n\
             [[rigid]]\nshape = {{ box = {{ min = [-0.25, 0, -0.25], max = [0.25, 0, 0.25] }} }}\ndensity = 300\n\
             position = [1.4, 0, 10.5]\n"
        ));
        let [most, mean] = watch(&mut w, 2.5, 1e-2, &format!("{rounds} rounds"));
        println!("{rounds} rounds: {mean} {most} {}", energy(&w));
        assert!(most < 3.0, "{rounds} rounds: compressed by {most}");
    }
}

#[test]
fn ten_heads_splash_on_few_rounds() {
    for rounds in [2, 4] {
        let set = ["resolution.spacing=0.04", "solver.pressure=pbf", &format!("solver.iterations={rounds}")];
        let scene = Scene::builtin("monkey-splash", &set.map(String::from)).unwrap().unwrap();
        let mut w = World::from_scene(&scene).unwrap();
        let [most, mean] = watch(&mut w, 1.0, 1e-2, &format!("{rounds} rounds"));
        println!("{rounds} rounds: {mean} {most} {}", energy(&w));
        assert!(mean < 0.06 && most < 1.0, "{rounds} rounds: compressed by {mean}, at most by {most}");
    }
}
