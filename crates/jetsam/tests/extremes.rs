//! What is tall, fast or falls far: nothing bursts, nothing is lost, no energy comes from nowhere.
//!
//! In a closed tank the sum of kinetic, potential and elastic energy can only fall.

mod common;

use common::{scene, world};
use jetsam::probe::Probes;

/// Runs a scene of water, with every way to find its density, and looks at it all along. `energy` is what there is to be spent (J per metre).
fn check(text: &str, seconds: f64, energy: f64) {
    for density in ["summation", "continuity"] {
        let text = format!(
            "[world]\ndimensions = 2\n[solver]\ndensity = \"{density}\"\n{text}[[probe]]\nname = \"energy\"\nof = \"energy\"\n"
        );
        let (s, mut w) = (scene(&text), world(&text));
        let probes = Probes::new(&s, &w).unwrap_or_else(|e| panic!("{e}"));
        let read = |w: &_| probes.read(w, &[true])[0];
        let (start, count) = (read(&w), w.ledger().fluid);
        let frames = 40;
        for frame in 1..=frames {
            w.advance(seconds / f64::from(frames), |_, report| {
                assert!(report.trouble.is_none(), "{density}: {:?}", report.trouble);
                true
            });
            let gained = (read(&w) - start) / energy;
            assert!(
                gained < 0.01,
                "{density}: after frame {frame} there is {gained} of the energy more than at the start"
            );
        }
        let l = w.ledger();
        assert_eq!((l.lost, l.left, l.nonfinite, l.fluid), (0, 0, 0, count), "{density}");
        assert!(w.momentum_residual() < 1e-4, "{density}: {}", w.momentum_residual());
    }
}

#[test]
fn a_tall_column_collapses() {
    // 5 m high and 0.25 m wide: sixteen times as high as the water will stand
    let text = "[domain]\nmin = [0, 0, 0]\nmax = [4, 0, 8]\n[resolution]\nspacing = 0.05\n\
                [[fluid]]\nshape = { box = { min = [0, 0, 0], max = [0.25, 0, 5] } }\n";
    check(text, 2.5, 0.25 * 5.0 * 1000.0 * 9.81 * 2.5);
}

#[test]
fn a_fast_jet_meets_a_wall() {
    // 30 m/s, 3 cm from the wall at the start
    let text = "[domain]\nmin = [0, 0, 0]\nmax = [2, 0, 2]\n[resolution]\nspacing = 0.02\n\
                [[fluid]]\nshape = { box = { min = [1.17, 0, 0.9], max = [1.97, 0, 1.1] } }\nvelocity = [30, 0, 0]\n";
    check(text, 0.2, 0.8 * 0.2 * 1000.0 * 0.5 * 900.0);
}

#[test]
fn a_drop_falls_ten_metres_into_a_pool() {
    let text = "[domain]\nmin = [0, 0, 0]\nmax = [2, 0, 12]\n[resolution]\nspacing = 0.05\n\
                [[fluid]]\nname = \"pool\"\nshape = { box = { min = [0, 0, 0], max = [2, 0, 0.5] } }\n\
                [[fluid]]\nname = \"drop\"\nshape = { sphere = { center = [1, 0, 10.5], radius = 0.25 } }\n";
    check(text, 2.0, std::f64::consts::PI * 0.0625 * 1000.0 * 9.81 * 10.0);
}
