//! Fluid and bodies: Archimedes.

mod common;

use common::world;
use jetsam::state::Kind;

#[test]
fn a_ball_of_half_the_density_floats_half_submerged_and_comes_to_rest() {
    // sphere of diameter D, s = 0.5: depth / D = 0.5 below the level corrected for what it displaces; D = 8 dx
    let (dx, d) = (0.025, 0.2);
    let mut w = world(
        "[domain]\nmin = [-0.4, -0.4, 0]\nmax = [0.4, 0.4, 0.5]\n[resolution]\nspacing = 0.025\n\
         [solver]\nsound_speed = 17\nartificial_viscosity = 0.1\n\
         [[fluid]]\nshape = { box = { min = [-0.4, -0.4, 0], max = [0.4, 0.4, 0.3] } }\n\
         [[rigid]]\nshape = { sphere = { center = [0, 0, 0], radius = 0.1 } }\ndensity = 500\nposition = [0, 0, 0.33]\n",
    );
    let water = w.ledger().fluid as f64 * w.model().volume;
    // while it falls the water cannot know: at the beginning only its lowest part is wet
    w.advance(2.0, |_, r| r.trouble.is_none());
    let (mut height, mut lift, mut samples, mut fastest) = (0.0, 0.0, 0.0, 0.0f64);
    while w.time() < 2.8 {
        w.step(2.8 - w.time());
        let b = &w.state().bodies.body[0];
        height += b.x.z;
        lift += 1.0 + b.force.z / (b.mass * 9.81);
        fastest = fastest.max(b.v.length());
        samples += 1.0;
    }
    let (height, lift) = (height / samples, lift / samples);
    // undisturbed level plus what half a ball displaces, over the area of the tank
    let half_ball = std::f64::consts::PI * d * d * d / 12.0;
    let level = (water + half_ball) / (0.8 * 0.8);
    let draft = level - (height - 0.5 * d);
    println!(
        "draft {:.4} D, off by {:.2} dx; lift {lift:.4} of the weight; speed {fastest:.3} m/s",
        draft / d,
        (draft - 0.5 * d) / dx
    );
    assert!((draft - 0.5 * d).abs() <= 1.0 * dx, "draft {} of the diameter", draft / d);
    assert!((lift - 1.0).abs() <= 0.02, "lift {lift}");
    assert!(fastest < 0.1, "still moves at {fastest} m/s");
    let b = &w.state().bodies.body[0];
    assert!(b.x.x.abs().max(b.x.y.abs()) <= 0.05 * d, "drifts to {}", b.x);
    assert_eq!((w.ledger().lost, w.ledger().nonfinite), (0, 0));
}

#[test]
fn spring_coupling_carries_a_body_too() {
    // the article's coupling (E16): a flat log of half the density stays at the surface of a flat tank
    let mut w = world(
        "[world]\ndimensions = 2\n[domain]\nmin = [-0.5, 0, 0]\nmax = [0.5, 0, 0.8]\n[resolution]\nspacing = 0.025\n\
         [solver]\nsound_speed = 20\ncoupling = \"spring\"\n\
         [[fluid]]\nshape = { box = { min = [-0.5, 0, 0], max = [0.5, 0, 0.4] } }\n\
         [[rigid]]\nshape = { box = { min = [-0.15, 0, -0.05], max = [0.15, 0, 0.05] } }\ndensity = 500\nposition = [0, 0, 0.42]\n",
    );
    w.advance(2.5, |_, r| r.trouble.is_none());
    let z = w.state().bodies.body[0].x.z;
    let level = 0.4 + 0.3 * 0.1 * 0.5 / 1.0;
    assert!((z - level).abs() < 2.0 * 0.025, "floats at {z}, level {level}");
    assert_eq!((w.ledger().lost, w.ledger().nonfinite), (0, 0));
}

#[test]
fn fluid_is_carved_where_bodies_stand() {
    let w = world(
        "[domain]\nmin = [0, 0, 0]\nmax = [0.5, 0.5, 0.5]\n[resolution]\nspacing = 0.025\n\
         [[fluid]]\nshape = { box = { min = [0, 0, 0], max = [0.5, 0.5, 0.3] } }\n\
         [[rigid]]\nshape = { sphere = { center = [0, 0, 0], radius = 0.1 } }\ndensity = 500\nposition = [0.25, 0.25, 0.15]\n",
    );
    assert!(w.model().warnings.iter().any(|w| w.contains("carved")), "{:?}", w.model().warnings);
    let p = &w.state().particles;
    let center = glam::Vec3::new(0.25, 0.25, 0.15);
    assert!(p.segment(Kind::Fluid).all(|i| (glam::Vec3::from(p.record[i].x) - center).length() > 0.095));
}

#[test]
fn no_fluid_begins_inside_a_static_body_behind_its_skin() {
    // only a skin of a body that does not move has particles: two of the eight layers here
    let w = world(
        "[world]\ndimensions = 2\n[domain]\nmin = [0, 0, 0]\nmax = [0.5, 0, 0.5]\n[resolution]\nspacing = 0.0125\n\
         [[fluid]]\nshape = { box = { min = [0, 0, 0], max = [0.5, 0, 0.4] } }\n\
         [[static]]\nshape = { sphere = { center = [0, 0, 0], radius = 0.1 } }\nposition = [0.25, 0, 0.2]\n",
    );
    let p = &w.state().particles;
    let center = glam::Vec3::new(0.25, 0.0, 0.2);
    assert!(p.segment(Kind::Fluid).all(|i| (glam::Vec3::from(p.record[i].x) - center).length() > 0.095));
}

#[test]
fn an_integrated_density_begins_with_the_gaps_round_a_body() {
    // a disc whose particles stand between those of the water: what was carved away for it and what stands there now differ. Inside the
    // water the integrated density is then the summed one, as far as that is below the density of rest
    let densities = |kind: &str| {
        let w = world(&format!(
            "[world]\ndimensions = 2\ngravity = [0, 0, 0]\n[domain]\nmin = [0, 0, 0]\nmax = [0.8, 0, 0.8]\n[resolution]\nspacing = 0.02\n\
             [solver]\ndensity = \"{kind}\"\nsound_speed = 10\nkernel = \"quintic\"\nsupport = 3\n\
             [[fluid]]\nshape = {{ box = {{ min = [0, 0, 0], max = [0.8, 0, 0.8] }} }}\n\
             [[rigid]]\nshape = {{ sphere = {{ center = [0, 0, 0], radius = 0.1 }} }}\ndensity = 500\nposition = [0.409, 0, 0.406]\n"
        ));
        let p = &w.state().particles;
        let mut all: Vec<_> = (0..p.count[0]).map(|k| (p.id[k], p.record[k].x, p.density[k])).collect();
        all.sort_by_key(|p| p.0);
        all
    };
    let (integrated, summed) = (densities("continuity"), densities("summation"));
    assert_eq!(integrated.len(), summed.len());
    let mut lowest = 1f32;
    for (a, b) in integrated.iter().zip(&summed) {
        assert!((a.2 - b.2.min(1.0)).abs() < 2e-3, "at {:?}: {} and {}", a.1, a.2, b.2);
        lowest = lowest.min(a.2);
    }
    println!("lowest density {lowest}");
    assert!(lowest < 0.97, "{lowest}");
}
