//! E31: fluid that comes and goes while a world runs. References: volumes and momenta counted by hand.

mod common;

use common::scene;
use jetsam::World;
use jetsam::state::Kind;

const SPACING: f64 = 0.02;

fn text(walls: &str, extra: &str) -> String {
    format!(
        "[world]\ngravity = [0, 0, 0]\n[domain]\nmin = [0, 0, 0]\nmax = [1, 0.4, 0.4]\n\
         walls = [\"{walls}\", \"{walls}\", \"{walls}\"]\n[resolution]\nspacing = {SPACING}\n{extra}"
    )
}

fn hose(extra: &str) -> String {
    format!(
        "[[fluid]]\ndensity = 1000\n[[emitter]]\n{extra}outlet.hose = {{ center = [0.1, 0.2, 0.2], axis = [1, 0, 0], radius = 0.06, speed = 2 }}\n"
    )
}

#[test]
fn a_hose_gives_its_rate_at_its_speed() {
    let mut world = World::from_scene(&scene(&text("open", &hose("")))).unwrap();
    let layer = world.model().sources[0].points.len() as f64;
    // points of a square lattice in a disc of radius 3 spacings: the disc's area within a fifth
    let area = std::f64::consts::PI * 9.0;
    assert!((layer / area - 1.0).abs() < 0.2, "{layer} points in a layer");
    world.advance(0.3, |_, report| report.trouble.is_none());
    // one layer at the beginning, one for every spacing of travel after
    let layers = 1.0 + (0.3f64 * 2.0 / SPACING).floor();
    assert_eq!(world.ledger().born as f64, layers * layer);
    assert_eq!(world.ledger().fluid as f64, layers * layer);
    // a stream in the open moves on as it came
    for r in world.fluid().filter(|r| r.x[0] > 0.15 && r.x[0] < 0.55) {
        assert!((f64::from(r.v[0]) - 2.0).abs() < 0.02, "{:?} at {:?}", r.v, r.x);
    }
    // what the hose brought in and what it took to hold the stream inside is all there is
    assert!(world.momentum_residual() < 1e-4, "{}", world.momentum_residual());
}

#[test]
fn a_rate_is_a_volume_per_second() {
    let rate = 2e-3;
    let text = text("open", &hose("").replace("speed = 2", &format!("rate = {rate}")));
    let mut world = World::from_scene(&scene(&text)).unwrap();
    let first = world.model().sources[0].points.len() as f64;
    world.advance(0.2, |_, report| report.trouble.is_none());
    let volume = (world.ledger().born as f64 - first) * world.model().volume;
    let layer = first * world.model().volume;
    assert!((volume - rate * 0.2).abs() <= layer, "{volume} for {}", rate * 0.2);
}

#[test]
fn particles_and_momentum_are_accounted_for() {
    // a hose against a wall, a sink at the far end, a body in between: everything born is alive, drained or left
    let extra = format!(
        "{}[[sink]]\nshape = {{ box = {{ min = [0.8, 0, 0], max = [1, 0.4, 0.4] }} }}\n\
         [[rigid]]\nshape = {{ sphere = {{ center = [0.5, 0.2, 0.2], radius = 0.05 }} }}\ndensity = 800\n",
        hose("stop = 0.4\n")
    );
    let mut world = World::from_scene(&scene(&text("solid", &extra))).unwrap();
    let capacity = world.state().particles.first[Kind::Rigid as usize];
    world.advance(0.6, |w, report| {
        let l = w.ledger();
        assert_eq!(l.born, l.fluid as u64 + l.drained + l.left + l.lost + l.nonfinite);
        report.trouble.is_none()
    });
    let ledger = world.ledger();
    assert!(ledger.drained > 0 && ledger.lost == 0, "{} drained, {} lost", ledger.drained, ledger.lost);
    assert!(world.state().particles.first[Kind::Rigid as usize] > capacity, "the fluid's segment did not grow");
    assert!(world.momentum_residual() < 1e-3, "{}", world.momentum_residual());
    assert!(world.fluid().all(|r| r.x[0] < 0.82));
}

#[test]
fn lifetime_ends() {
    let text = text("open", &hose("").replace("density = 1000", "density = 1000\nlifetime = 0.1"));
    let mut world = World::from_scene(&scene(&text)).unwrap();
    let layer = world.model().sources[0].points.len();
    world.advance(0.3, |_, report| report.trouble.is_none());
    // a spacing takes 0.01 s, so that 10 or 11 layers live
    let alive = world.ledger().fluid;
    assert!(alive == 10 * layer || alive == 11 * layer, "{alive} of layers of {layer}");
    assert_eq!(world.ledger().born, alive as u64 + world.ledger().drained);
}

#[test]
fn a_burst_fills_its_shape_again_where_there_is_room() {
    let burst = |period: &str| {
        format!(
            "[[fluid]]\ndensity = 1000\n[[emitter]]\nstart = 0.05\noutlet.burst = {{ shape = {{ box = {{ min = [0.4, 0.1, 0.1], \
             max = [0.5, 0.2, 0.2] }} }}{period} }}\n"
        )
    };
    let mut world = World::from_scene(&scene(&text("open", &burst(", period = 0.1")))).unwrap();
    world.advance(0.04, |_, report| report.trouble.is_none());
    assert_eq!(world.ledger().born, 0);
    world.advance(0.12, |_, report| report.trouble.is_none());
    assert_eq!(world.ledger().born, 125);
    world.advance(0.28, |_, report| report.trouble.is_none());
    // the block rests where it was: nothing fits a second time
    assert_eq!(world.ledger().born, 125);
    let moving = burst(", velocity = [1.5, 0, 0], period = 0.1");
    let mut world = World::from_scene(&scene(&text("open", &moving))).unwrap();
    world.advance(0.28, |_, report| report.trouble.is_none());
    assert_eq!(world.ledger().born, 375);
}

#[test]
fn the_same_bits_for_any_number_of_threads() {
    let extra = format!(
        "{}[[sink]]\nshape = {{ sphere = {{ center = [0.5, 0.2, 0.2], radius = 0.05 }} }}\n",
        hose("jitter = 0.2\n")
    );
    let hash = |threads: usize| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
            let mut world = World::from_scene(&scene(&text("solid", &extra))).unwrap();
            world.advance(0.2, |_, report| report.trouble.is_none());
            jetsam::report::state_hash(world.state())
        })
    };
    assert_eq!(hash(1), hash(3));
}

#[test]
fn mistakes_are_explained() {
    for (extra, word) in [
        (
            "[[emitter]]\noutlet.hose = { center = [0.5, 0.2, 0.2], axis = [1, 0, 0], radius = 0.05, speed = 1 }\n[[rigid]]\nshape = { sphere = { center = [0.5, 0.2, 0.2], radius = 0.05 } }\ndensity = 800\n",
            "fluid",
        ),
        (
            "[[fluid]]\n[[emitter]]\noutlet.hose = { center = [0.5, 0.2, 0.2], axis = [1, 0, 0], radius = 0.05 }\n",
            "speed",
        ),
        (
            "[[fluid]]\n[[emitter]]\noutlet.hose = { center = [0.01, 0.2, 0.2], axis = [1, 0, 0], radius = 0.05, speed = 1 }\n",
            "outside",
        ),
        ("[[fluid]]\n[[sink]]\nshape = { points = [[0, 0, 0]] }\n", "sink"),
    ] {
        let error = scene(&text("solid", extra)).assemble().unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
}
