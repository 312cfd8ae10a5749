//! `jetsam bench`: how fast scenes run here, with what it costs in density error.

use crate::run::set_threads;
use crate::terminal::{print, print_json, progress};
use crate::{MEMORY, Outcome, args};
use jetsam::report::StageMillis;
use jetsam::scene::Shape;
use jetsam::scene::builtin::SCENES;
use jetsam::state::Kind;
use jetsam::{Scene, World, state_hash};
use serde::Serialize;
use std::time::{Duration, Instant};

const HEADER: &str = "scene            particles  neighbours  ms/step  Mparticle-steps/s  real-time  density err  rounds  peak MB  state hash\n                 milliseconds a step by stage";

/// What is said of a case.
#[derive(Serialize)]
struct Case {
    scene: String,
    backend: &'static str,
    device: String,
    /// Fluid and rigid particles, and agents.
    particles: usize,
    /// Agents of flocks among them.
    agents: usize,
    /// Mean number of fluid neighbours of a fluid particle; where there is none, of neighbours an agent of the first flock perceives.
    neighbours: f64,
    steps: u64,
    ms_per_step: f64,
    particle_steps_per_s: f64,
    real_time_factor: f64,
    density_error_mean: f64,
    /// Rounds of implicit pressure a step, of all its solves; 0 where pressure is not implicit.
    rounds: f64,
    /// Most memory held at once since the case began (MB).
    peak_mb: f64,
    threads: usize,
    /// Milliseconds a step by stage.
    stage_ms: StageMillis,
    state_hash: String,
}

/// Measures scene after scene, size after size.
pub fn bench(args: &args::Bench) -> miette::Result<Outcome> {
    if args.solvers {
        return crate::solvers::table(args);
    }
    if args.pictures {
        return crate::drawing::pictures(args);
    }
    let names = match &args.scene {
        Some(scene) => vec![scene.as_str()],
        None => SCENES.iter().map(|s| s.name).collect(),
    };
    if args.list {
        print(&names.join("\n"));
        return Ok(Outcome::Fine);
    }
    set_threads(args.threads)?;
    let mut finite = true;
    let mut cases = 0;
    for name in names {
        let scene = Scene::open(name, &args.set).map_err(|e| *e)?;
        let sizes = match args.particles.as_slice() {
            [] => vec![scene.clone()],
            wanted => wanted.iter().map(|&n| sized(&scene, n)).collect::<miette::Result<_>>()?,
        };
        for scene in sizes {
            let case = measure(name, &scene, args, &mut finite)?;
            if cases == 0 && !args.json {
                print(HEADER);
            }
            cases += 1;
            if args.json { print_json(&case) } else { print(&line(&case)) }
        }
    }
    Ok(if finite { Outcome::Fine } else { Outcome::WentWrong })
}

/// The scene with a spacing that gives about so many fluid particles (bodies' where there is no fluid); with flocks alone, so many
/// agents of as many neighbours as before.
pub fn sized(scene: &Scene, wanted: u64) -> miette::Result<Scene> {
    let mut scene = scene.clone();
    if scene.fluid.is_empty() && scene.rigid.is_empty() {
        return Ok(crowded(scene, wanted));
    }
    // once to scale, once more for the grain of the lattice
    for _ in 0..2 {
        let [fluid, rigid, _] = scene.assemble().map_err(|e| *e)?.state.particles.count;
        let ratio = if fluid > 0 { fluid } else { rigid }.max(1) as f64 / wanted as f64;
        if (ratio - 1.0).abs() < 0.02 {
            break;
        }
        scene.resolution.spacing *= ratio.powf(1.0 / f64::from(scene.world.dimensions));
    }
    Ok(scene)
}

/// Flocks of so many agents in all, in the same space: radii shrink, so that each perceives as many as before.
fn crowded(mut scene: Scene, wanted: u64) -> Scene {
    let now: f64 = scene.flock.iter().map(|f| f64::from(f.count)).sum();
    let ratio = wanted as f64 / now;
    let factor = ratio.powf(-1.0 / f64::from(scene.world.dimensions));
    for f in scene.flock.iter_mut().filter(|f| f.count > 1 && !matches!(f.shape, Shape::Points(_))) {
        f.count = (f64::from(f.count) * ratio).round().max(1.0) as u32;
        f.radius *= factor;
        let radii = [&mut f.separation_radius, &mut f.alignment_radius, &mut f.cohesion_radius];
        radii.into_iter().flatten().for_each(|r| *r *= factor);
    }
    scene
}

/// Steps between two looks at the progress: a GPU makes them without waiting.
const UNWATCHED: u64 = 100;

fn measure(name: &str, scene: &Scene, args: &args::Bench, finite: &mut bool) -> miette::Result<Case> {
    MEMORY.reset_peak_usage();
    let steps = args.steps;
    let (mut world, _) = World::choose(args.backend.into(), scene.assemble().map_err(|e| *e)?)?;
    let bar = progress(steps + steps.div_ceil(5), name);
    let run = |world: &mut World, count: u64| {
        let mut fine = true;
        for first in (0..count).step_by(UNWATCHED as usize) {
            let part = UNWATCHED.min(count - first);
            fine &= world.run_steps(part).is_none();
            bar.inc(part);
        }
        fine
    };
    run(&mut world, steps.div_ceil(5));
    let timers: Vec<Duration> = world.timers().map(|t| t.1).collect();
    let rounds = |world: &World| world.solves().pressure + world.solves().divergence;
    let (begin, before, start) = (world.time(), rounds(&world), Instant::now());
    *finite &= run(&mut world, steps);
    let wall = start.elapsed().as_secs_f64();
    bar.finish_and_clear();
    let count = world.state().particles.count;
    let agents = world.state().agents.record.len();
    let particles = count[Kind::Fluid as usize] + count[Kind::Rigid as usize] + agents;
    let mut stage_ms = StageMillis::since(&timers, &world);
    stage_ms.0.iter_mut().for_each(|s| s.1 /= steps as f64);
    Ok(Case {
        scene: name.into(),
        backend: world.backend(),
        device: world.device().unwrap_or_else(device),
        particles,
        agents,
        neighbours: if count[Kind::Fluid as usize] > 0 || agents == 0 {
            world.ledger().neighbours
        } else {
            world.flock_neighbours(0)
        },
        steps,
        ms_per_step: 1e3 * wall / steps as f64,
        particle_steps_per_s: particles as f64 * steps as f64 / wall,
        real_time_factor: (world.time() - begin) / wall,
        density_error_mean: world.ledger().density_error_mean,
        rounds: (rounds(&world) - before) as f64 / steps as f64,
        peak_mb: f64::from(MEMORY.peak_usage_as_mb()),
        threads: rayon::current_num_threads(),
        stage_ms,
        state_hash: format!("{:016x}", state_hash(world.state())),
    })
}

fn line(c: &Case) -> String {
    let stages = c.stage_ms.0.iter().filter(|s| s.1 >= 5e-4);
    let stages: Vec<String> = stages.map(|(stage, ms)| format!("{} {ms:.2}", stage.name())).collect();
    format!(
        "{:16} {:9}  {:10.1}  {:7.2}  {:17.2}  {:9.4}  {:9.3} %  {:6.1}  {:7.0}  {}\n{:17}{}",
        c.scene,
        c.particles,
        c.neighbours,
        c.ms_per_step,
        1e-6 * c.particle_steps_per_s,
        c.real_time_factor,
        100.0 * c.density_error_mean,
        c.rounds,
        c.peak_mb,
        c.state_hash,
        "",
        stages.join(" ")
    )
}

/// What the processor calls itself, where the system says so; else its architecture.
fn device() -> String {
    let cpuinfo = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpuinfo.lines().find_map(|l| l.strip_prefix("model name")?.split_once(": "));
    let named = model.map(|(_, name)| name.trim().to_owned()).or_else(|| std::env::var("PROCESSOR_IDENTIFIER").ok());
    named.unwrap_or_else(|| std::env::consts::ARCH.into())
}
