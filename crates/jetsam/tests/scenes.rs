//! Scenes: the built-in ones, the table of parameters, what the sides of a domain do.

mod common;

use common::{scene, world};
use jetsam::params::PARAMS;
use jetsam::scene::builtin::SCENES;
use jetsam::state::Kind;
use jetsam::{Scene, World};

#[test]
fn every_parameter_is_a_field_with_its_range_in_the_schema() {
    let schema = jetsam::scene::schema();
    for p in PARAMS {
        let place = jetsam::scene::schema_place(&schema, p.path);
        let place = place.unwrap_or_else(|| panic!("`{}` is no field of a scene", p.path));
        let field = schema.pointer(&place).unwrap();
        assert_eq!(field["unit"], p.unit, "{}", p.path);
        assert!(field["description"].as_str().is_some_and(|d| !d.is_empty()), "{} says nothing", p.path);
        let number = field.get("items").unwrap_or(field);
        assert_eq!(number["minimum"].as_f64(), Some(p.min), "{}", p.path);
        assert_eq!(number["maximum"].as_f64(), Some(p.max), "{}", p.path);
        if let Some(default) = p.default {
            assert!((p.min..=p.max).contains(&default), "{} has a default out of its range", p.path);
            assert_eq!(field["default"].as_f64(), Some(default), "{}", p.path);
        }
    }
}

#[test]
fn built_in_scenes_assemble_without_a_warning() {
    for builtin in SCENES {
        let assembly = Scene::builtin(builtin.name, &[]).unwrap().unwrap().assemble().unwrap();
        let doubtful: Vec<&String> = assembly.model.warnings.iter().filter(|w| !w.contains("carved")).collect();
        assert!(doubtful.is_empty(), "{}: {doubtful:?}", builtin.name);
    }
    let splash = Scene::builtin("monkey-splash", &[]).unwrap().unwrap().assemble().unwrap();
    let fluid = splash.state.particles.count[Kind::Fluid as usize];
    assert!((27_000..=33_000).contains(&fluid), "{fluid} fluid particles");
    let heads = splash.state.bodies.body.iter().filter(|b| !b.is_static()).count();
    assert_eq!(heads, 10);
    assert!(splash.meshes.iter().flatten().count() == 10);
}

#[test]
fn the_spacing_may_change_by_four_with_no_other_edit() {
    for factor in [4.0, 0.5] {
        let spacing = format!("resolution.spacing={}", 0.04 * factor);
        let mut w = World::from_scene(&Scene::builtin("dam-break", &[spacing]).unwrap().unwrap()).unwrap();
        for _ in 0..10 {
            assert!(w.step(f64::INFINITY).trouble.is_none());
        }
        assert_eq!(w.ledger().lost, 0);
    }
}

/// Particles in a 2D box that all fly to the right.
fn flying(walls: &str) -> String {
    format!(
        "[world]\ndimensions = 2\ngravity = [0, 0, 0]\n[domain]\nmin = [0, 0, 0]\nmax = [1, 0, 1]\nwalls = [{walls}]\n\
         [resolution]\nspacing = 0.1\n[[fluid]]\nshape = {{ box = {{ min = [0.6, 0, 0.3], max = [0.9, 0, 0.6] }} }}\n\
         velocity = [1, 0, 0]\n"
    )
}

#[test]
fn what_passes_an_open_side_has_left_and_is_not_lost() {
    let mut w = world(&flying("\"open\", \"open\", \"open\""));
    let before = w.ledger().fluid;
    w.advance(1.0, |_, _| true);
    let l = w.ledger();
    assert!(l.left > 0 && l.lost == 0 && l.fluid + l.left as usize == before, "{l:?}");
}

#[test]
fn periodic_sides_are_one() {
    let mut w = world(&flying("\"periodic\", \"open\", \"periodic\""));
    let (before, momentum) = (w.ledger().fluid, w.ledger().momentum);
    w.advance(1.0, |_, _| true);
    assert_eq!((w.ledger().fluid, w.ledger().left, w.ledger().lost), (before, 0, 0));
    assert!((w.ledger().momentum - momentum).length() < 1e-5 * momentum.length());
    assert!(w.fluid().all(|p| (0.0..1.0).contains(&p.x[0])));
    // one period later the block is where it was
    let mean = w.fluid().map(|p| f64::from(p.x[0])).sum::<f64>() / before as f64;
    assert!((mean - 0.75).abs() < 1e-3, "{mean}");
}

#[test]
fn solid_sides_hold_and_a_flat_scene_stays_flat() {
    let mut w = world(&flying("\"solid\", \"solid\", \"solid\""));
    w.advance(2.0, |_, _| true);
    assert_eq!((w.ledger().lost, w.ledger().left), (0, 0));
    assert!(w.fluid().all(|p| p.x[1] == 0.0 && p.v[1] == 0.0 && (0.0..=1.0).contains(&p.x[0])));
}

#[test]
fn a_fast_block_of_the_seed_authors_kernels_stays_in_its_tank() {
    // poly6, spiky, Mueller's pressure force and viscosity, XSPH: the laws of the article together
    let mut w = world(
        "[domain]\nmin = [0, 0, 0]\nmax = [0.6, 0.3, 0.6]\n[resolution]\nspacing = 0.03\n\
         [solver]\nkernel = \"mueller\"\npressure_force = \"mueller\"\nviscosity = \"mueller\"\nequation_of_state = \"linear\"\n\
         xsph = 0.1\ncoupling = \"spring\"\ndamping = \"full\"\n\
         [[fluid]]\nviscosity = 1.0\nshape = { box = { min = [0, 0, 0], max = [0.3, 0.3, 0.3] } }\nvelocity = [1, 0, 0]\n\
         [[rigid]]\nshape = { sphere = { center = [0, 0, 0], radius = 0.08 } }\ndensity = 500\nposition = [0.45, 0.15, 0.2]\n",
    );
    w.advance(0.6, |_, step| step.trouble.is_none());
    let l = w.ledger();
    assert_eq!((l.lost, l.rigid_lost, l.nonfinite), (0, 0, 0));
    assert!((w.time() - 0.6).abs() < 1e-9 && l.speed < 4.0, "{l:?}");
    assert!(w.momentum_residual() < 1e-5);
}

#[test]
fn frames_end_when_they_should() {
    let mut w = world(&flying("\"open\", \"open\", \"open\""));
    let mut longest = 0.0f64;
    for frame in 1..=7 {
        let end = f64::from(frame) * 0.013;
        w.advance(end, |_, step| {
            longest = longest.max(step.dt);
            true
        });
        assert_eq!(w.time(), end);
    }
    assert!(longest <= 0.013);
}

#[test]
fn bodies_meet_their_place_and_copies_their_number() {
    let text = "[domain]\nmin = [0, 0, 0]\nmax = [2, 2, 2]\n[resolution]\nspacing = 0.05\n\
         [[rigid]]\nname = \"b\"\nshape = { sphere = { center = [0, 0, 0], radius = 0.1 } }\ndensity = 500\n\
         position = [0.2, 0.2, 0.3]\ncopies = { count = 5, grid = { columns = [2, 2], step = [0.5, 0.6, 0.7] } }\n";
    let assembly = scene(text).assemble().unwrap();
    let bodies: Vec<_> = assembly.state.bodies.body.iter().filter(|b| !b.is_static()).collect();
    assert_eq!(bodies.len(), 5);
    let expected = [[0.2, 0.2, 0.3], [0.7, 0.2, 0.3], [0.2, 0.8, 0.3], [0.7, 0.8, 0.3], [0.2, 0.2, 1.0]];
    for (body, place) in bodies.iter().zip(expected) {
        assert!((body.x - glam::DVec3::from(place)).length() < 1e-12, "{}", body.x);
        // mass of the exact ball, not of its particles
        let mass = 500.0 * 4.0 / 3.0 * std::f64::consts::PI * 1e-3;
        assert!((body.mass / mass - 1.0).abs() < 1e-12);
    }
}
