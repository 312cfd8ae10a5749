//! Each stage of a step by itself: `cargo bench -p jetsam`, and with a word in its name only those, as in `cargo bench -p jetsam -- dfsph/density`.
//!
//! Stages that evaluate what is there run again and again on one state. Those that move particles do so by a step of a nanosecond.
//! Implicit pressure would find nothing left to do: of it whole steps are made, and its own time in them counts.

use criterion::{Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use jetsam::backend::{Choice, open};
use jetsam::integrate::Advance;
use jetsam::scene::Pressure;
use jetsam::stage::Stage;
use jetsam::{Scene, World};
use std::hint::black_box;
use std::time::Duration;

/// A step that moves nothing (s).
const STILL: f64 = 1e-9;

/// Scenes, what is overridden in them, and steps until all their stages have something to do.
const CASES: [(&str, &str, &[&str], usize); 5] = [
    ("dam/wcsph", "bench-dam", &["resolution.spacing=0.035", "solver.pressure=wcsph"], 100),
    ("dam/dfsph", "bench-dam", &["resolution.spacing=0.035", "solver.pressure=dfsph"], 20),
    ("dam/pbf", "bench-dam", &["resolution.spacing=0.035", "solver.pressure=pbf"], 20),
    ("bricks", "bench-bricks", &[], 20),
    ("flock", "bench-flock", &[], 2),
];

fn world(scene: &str, overrides: &[&str], steps: usize) -> World {
    let overrides: Vec<String> = overrides.iter().map(|o| o.to_string()).collect();
    let scene = Scene::builtin(scene, &overrides).expect("comes with the program").expect("is valid");
    let mut world = World::from_scene(&scene).expect("has room");
    for _ in 0..steps {
        world.step(f64::INFINITY);
    }
    world
}

fn stages(c: &mut Criterion) {
    for (name, scene, overrides, steps) in CASES {
        let mut whole = world(scene, overrides, steps);
        let model = whole.model().clone();
        let solver = model.solver.pressure;
        let (mut backend, _) = open(Choice::Cpu, &model, None).expect("the processor is there");
        backend.upload(&model, whole.state().clone());
        let time = whole.time();
        let still = Advance { time, dt: STILL, dt_before: STILL, drag: 0.0, parts: 1 };
        let evaluate: Vec<_> = Stage::order(solver).iter().copied().filter(|stage| stage.evaluates(solver)).collect();
        backend.run(&evaluate, &model, still);
        let mut group = c.benchmark_group(name);
        group.sample_size(10).sampling_mode(SamplingMode::Flat);
        group.warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(2));
        let count = whole.state().particles.count;
        let agents = whole.state().agents.record.len();
        group.throughput(Throughput::Elements((count[0] + count[1] + agents) as u64));
        for &stage in Stage::order(solver) {
            let rounds = matches!(stage, Stage::Divergence | Stage::Pressure) && solver != Pressure::Wcsph;
            if rounds {
                group.bench_function(stage.name(), |b| b.iter_custom(|steps| in_steps(&mut whole, stage, steps)));
            } else {
                group.bench_function(stage.name(), |b| b.iter(|| backend.run(&[black_box(stage)], &model, still)));
            }
        }
        group.finish();
    }
}

/// Time that a stage takes in so many steps.
fn in_steps(world: &mut World, stage: Stage, steps: u64) -> Duration {
    let so_far = |world: &World| world.timers().filter(|(s, _)| *s == stage).map(|(_, time)| time).sum::<Duration>();
    let before = so_far(world);
    for _ in 0..steps {
        world.step(f64::INFINITY);
    }
    so_far(world) - before
}

criterion_group!(benches, stages);
criterion_main!(benches);
