//! What a hand does to a world that runs: it holds bodies, pours fluid, frightens flocks, adds bodies, changes parameters.

use glam::DVec3;
use jetsam::scene::Source;
use jetsam::world::{Grip, Mismatch};
use jetsam::{Scene, World};

fn scene(text: &str) -> Scene {
    let source = Source { name: "test".into(), text: text.into(), ..Source::default() };
    Scene::parse(source, &[]).unwrap()
}

const BLOCK: &str = "
    domain = { min = [0, 0, 0], max = [2, 1, 1], walls = ['open', 'open', 'open'] }
    resolution = { spacing = 0.05 }
    world = { gravity = [0, 0, 0] }
    [[rigid]]
    name = 'block'
    shape = { box = { min = [-0.1, -0.1, -0.1], max = [0.1, 0.1, 0.1] } }
    density = 500
    position = [0.5, 0.5, 0.5]
";

const TANK: &str = "
    domain = { min = [-0.3, -0.3, 0], max = [0.3, 0.3, 1] }
    resolution = { spacing = 0.05 }
    [[fluid]]
    name = 'water'
    shape = { box = { min = [-0.3, -0.3, 0], max = [0.3, 0.3, 0.2] } }
";

#[test]
fn a_held_body_comes_to_the_hand_and_keeps_its_speed_when_let_go() {
    let mut world = World::from_scene(&scene(BLOCK)).unwrap();
    let to = DVec3::new(0.8, 0.6, 0.5);
    world.grip(Some(Grip { body: 0, at: DVec3::ZERO, to }));
    world.advance(2.0, |_, step| step.trouble.is_none());
    let body = &world.state().bodies.body[0];
    // many times the time in which the distance falls to 1/e
    assert!(body.x.distance(to) < 1e-3 * to.distance(DVec3::splat(0.5)), "{}", body.x);
    assert!(world.momentum_residual() < 1e-9 || body.v.length() < 1e-4, "{}", world.momentum_residual());

    // drawn along x: let go half way, it flies on by Newton's first law
    world.grip(Some(Grip { body: 0, at: DVec3::ZERO, to: to + DVec3::X }));
    world.advance(2.3, |_, step| step.trouble.is_none());
    world.grip(None);
    let (before, time) = (world.state().bodies.body[0].clone(), world.time());
    assert!(before.v.x > 0.3, "{}", before.v);
    world.advance(2.4, |_, step| step.trouble.is_none());
    let after = &world.state().bodies.body[0];
    assert!((after.x - before.x - (world.time() - time) * before.v).length() < 1e-9, "{}", after.x);
    assert!(world.momentum_residual() < 1e-9, "{}", world.momentum_residual());
}

#[test]
fn a_body_held_at_its_side_hangs_below_the_hand() {
    let mut heavy = scene(&BLOCK.replace("gravity = [0, 0, 0]", "gravity = [0, 0, -9.81]"));
    heavy.run.seconds = 3.0;
    let mut world = World::from_scene(&heavy).unwrap();
    let (at, to) = (DVec3::new(0.1, 0.0, 0.0), DVec3::new(0.6, 0.5, 0.5));
    world.grip(Some(Grip { body: 0, at, to }));
    world.advance(4.0, |_, step| step.trouble.is_none());
    let body = &world.state().bodies.body[0];
    let below = (body.x - to).normalize();
    assert!(below.dot(DVec3::NEG_Z) > 0.98, "the centre is at {} of the hand", body.x - to);
    assert!(((body.x + body.q * at) - to).length() < 0.02, "{}", body.x + body.q * at);
}

#[test]
fn a_static_body_is_not_moved() {
    let mut world = World::from_scene(&scene(TANK)).unwrap();
    world.grip(Some(Grip { body: 0, at: DVec3::ZERO, to: DVec3::ONE }));
    let before = world.state().bodies.body[0].x;
    world.advance(0.02, |_, step| step.trouble.is_none());
    assert_eq!(world.state().bodies.body[0].x, before);
}

#[test]
fn a_hose_gives_what_its_speed_and_its_disc_say() {
    let scene = scene(TANK);
    let mut world = World::from_scene(&scene).unwrap();
    let n = world.fluid().count();
    let hose = |x: f64, time: f64| scene.hose(DVec3::new(x, 0.0, 0.6), DVec3::NEG_Z, 0.1, 1.0, time).unwrap();
    world.pour(Some(hose(0.0, 0.0)));
    let disc = world.model().sources[0].points.len();
    world.advance(0.1, |_, step| step.trouble.is_none());
    // moved while it runs: the rhythm of a layer every spacing / speed = 0.05 s goes on
    world.pour(Some(hose(0.05, 0.1)));
    assert_eq!(world.model().sources.len(), 1);
    world.advance(0.22, |_, step| step.trouble.is_none());
    let layers = (world.fluid().count() - n) as f64 / disc as f64;
    assert!((4.0..=5.0).contains(&layers), "{layers} layers in 0.22 s");
    world.pour(None);
    let poured = world.fluid().count();
    world.advance(0.4, |_, step| step.trouble.is_none());
    assert_eq!(world.fluid().count(), poured);
    let mut ids: Vec<u32> = world.state().particles.id[..poured].to_vec();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), poured, "identities are unique");
    assert!(scene.hose(DVec3::new(0.0, 0.0, 3.0), DVec3::NEG_Z, 0.1, 1.0, 0.0).is_err());
}

#[test]
fn agents_that_are_frightened_flee_from_the_place() {
    let text = "
        domain = { min = [-1, -1, -1], max = [1, 1, 1] }
        resolution = { spacing = 0.05 }
        world = { gravity = [0, 0, 0] }
        [[flock]]
        name = 'birds'
        count = 60
        shape = { sphere = { center = [0, 0, 0], radius = 0.3 } }
        radius = 0.2
        speed = 0.5
    ";
    let mut world = World::from_scene(&scene(text)).unwrap();
    let mean = |w: &World| w.state().agents.record.iter().map(|r| glam::Vec3::from(r.x).length()).sum::<f32>() / 60.0;
    let before = mean(&world);
    assert_eq!(world.scare(DVec3::splat(5.0), 0.5), 0);
    assert_eq!(world.scare(DVec3::ZERO, 1.0), 60);
    world.advance(0.3, |_, step| step.trouble.is_none());
    // they flee at up to 0.75 m/s, and turn back to 0.5 m/s
    let fled = mean(&world) - before;
    assert!((0.1..=0.23).contains(&fled), "on the mean they fled {fled} m");
}

#[test]
fn a_new_body_falls_into_a_running_tank() {
    let first = scene(TANK);
    let mut world = World::from_scene(&first).unwrap();
    world.advance(0.1, |_, step| step.trouble.is_none());
    let (n, time) = (world.fluid().count(), world.time());
    let ball = "
        [[rigid]]
        name = 'ball'
        shape = { sphere = { center = [0, 0, 0], radius = 0.1 } }
        density = 500
        position = [0, 0, 0.6]
    ";
    let both = scene(&format!("{TANK}{ball}"));
    world.take_over(both.assemble().unwrap()).map_err(|e| e.0).unwrap();
    assert_eq!((world.fluid().count(), world.time()), (n, time));
    assert_eq!(world.state().bodies.body[0].name, "ball");
    world.advance(0.3, |_, step| step.trouble.is_none());
    // it has fallen freely for 0.2 s
    let fall = 0.6 - world.state().bodies.body[0].x.z;
    assert!((fall - 0.5 * 9.81 * 0.2 * 0.2).abs() < 1e-3, "{fall}");
    world.advance(1.0, |_, step| step.trouble.is_none());
    assert!(world.ledger().lost == 0 && world.momentum_residual() < 1e-2, "{}", world.momentum_residual());

    // where a body stands there is no room for another
    let at = world.state().bodies.body[0].x;
    let twice = format!("{TANK}{ball}{}", ball.replace("[0, 0, 0.6]", &format!("[{}, {}, {}]", at.x, at.y, at.z)));
    let refused = world.take_over(scene(&twice).assemble().unwrap()).map_err(|e| e.0);
    assert_eq!(refused, Err(Mismatch::Room));
}

#[test]
fn parameters_change_while_the_world_runs() {
    let first = scene(TANK);
    let mut world = World::from_scene(&first).unwrap();
    world.advance(0.05, |_, step| step.trouble.is_none());
    let places: Vec<_> = world.fluid().map(|r| r.x).collect();
    for change in ["world.gravity=[1, 0, -4]", "fluid.0.viscosity=2", "solver.xsph=0.3", "solver.density=continuity"] {
        let changed = first.with(&[change.into()]).unwrap();
        world.take_over(changed.assemble().unwrap()).map_err(|e| e.0).unwrap();
        let mut now: Vec<_> = world.fluid().map(|r| r.x).collect();
        let mut before = places.clone();
        now.sort_by(|a, b| a.partial_cmp(b).unwrap());
        before.sort_by(|a, b| a.partial_cmp(b).unwrap());
        assert_eq!(now, before, "{change}: no particle has moved");
        let mut copy = World::from_scene(&changed).unwrap();
        copy.advance(0.01, |_, step| step.trouble.is_none());
    }
    let tilted = first.with(&["world.gravity=[1, 0, -4]".into()]).unwrap();
    world.take_over(tilted.assemble().unwrap()).map_err(|e| e.0).unwrap();
    let mass = world.ledger().fluid;
    world.advance(world.time() + 0.02, |_, step| step.trouble.is_none());
    assert!(mass > 0 && world.ledger().external_force.x > 0.0 || world.ledger().momentum.x > 0.0);
    let finer = first.with(&["resolution.spacing=0.06".into()]).unwrap();
    assert_eq!(world.take_over(finer.assemble().unwrap()).map_err(|e| e.0), Err(Mismatch::Space));
}

#[test]
fn taking_over_the_same_scene_changes_nothing() {
    let ball = "
        [[rigid]]
        shape = { sphere = { center = [0, 0, 0], radius = 0.1 } }
        density = 500
        position = [0, 0, 0.32]
    ";
    let scene = scene(&format!("{TANK}{ball}"));
    let run = |interrupted: bool| {
        let mut world = World::from_scene(&scene).unwrap();
        world.advance(0.1, |_, step| step.trouble.is_none());
        if interrupted {
            world.take_over(scene.assemble().unwrap()).map_err(|e| e.0).unwrap();
        }
        world.advance(0.15, |_, step| step.trouble.is_none());
        let places: Vec<_> = world.fluid().map(|r| r.x).collect();
        let ids = world.state().particles.id[..places.len()].to_vec();
        let mut all: Vec<_> = ids.into_iter().zip(places).collect();
        all.sort_by_key(|p| p.0);
        (all, world.state().bodies.body[0].x, world.ledger().kinetic)
    };
    let ((a, body_a, energy_a), (b, body_b, energy_b)) = (run(false), run(true));
    let apart = a.iter().zip(&b).map(|(a, b)| {
        assert_eq!(a.0, b.0);
        glam::Vec3::from(a.1).distance(b.1.into())
    });
    let apart = apart.fold(0.0, f32::max);
    assert!(apart < 1e-5 && body_a.distance(body_b) < 1e-6, "{apart} m");
    assert!((energy_a - energy_b).abs() < 1e-4 * energy_a);
}

#[test]
fn a_heavier_body_keeps_its_motion() {
    let first = scene(&format!("{BLOCK}velocity = [0.5, 0, 0]\nspin = [0, 2, 1]"));
    let mut world = World::from_scene(&first).unwrap();
    world.advance(0.1, |_, step| step.trouble.is_none());
    let before = world.state().bodies.body[0].clone();
    let heavier = first.with(&["rigid.0.density=1500".into()]).unwrap();
    world.take_over(heavier.assemble().unwrap()).map_err(|e| e.0).unwrap();
    world.advance(0.2, |_, step| step.trouble.is_none());
    let after = &world.state().bodies.body[0];
    assert!((after.mass - 3.0 * before.mass).abs() < 1e-9 * before.mass);
    assert!((after.v - before.v).length() < 1e-12 && (after.omega - before.omega).length() < 1e-6);
    assert!((after.x - before.x - 0.1 * before.v).length() < 1e-9);
}

#[test]
fn a_saved_scene_is_the_same_scene() {
    let folder = std::env::temp_dir().join(format!("jetsam-save-{}", std::process::id()));
    let changed =
        Scene::open("monkey-splash", &["rigid.0.density=321".into(), "solver.sound_speed=40".into()]).unwrap();
    assert_eq!(changed.value("rigid.0.density").and_then(|v| v.as_float()), Some(321.0));
    let path = folder.join("mine.toml");
    changed.save(&path).unwrap();
    let read = Scene::load(&path, &[]).unwrap();
    assert_eq!(read.to_toml().unwrap(), changed.to_toml().unwrap());
    let (a, b) = (read.assemble().unwrap(), changed.assemble().unwrap());
    assert_eq!(jetsam::state_hash(&a.state), jetsam::state_hash(&b.state));
    let derived = changed.with(&["solver.sound_speed=".into()]).unwrap();
    assert_eq!(derived.solver.sound_speed, None);
    std::fs::remove_dir_all(folder).unwrap();
}
