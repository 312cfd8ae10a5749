//! `jetsam bench --solvers`: what each solver of pressure costs for the density error it leaves, as one table.
//!
//! Every scene is run from its beginning, once for each solver and each density error aimed at. What was reached stands
//! beside what it cost; times are those of the steps alone.

use crate::run::set_threads;
use crate::terminal::{print, print_json, progress};
use crate::{Outcome, args};
use jetsam::scene::Pressure;
use jetsam::{Scene, World};
use serde::Serialize;
use std::time::Instant;

/// Scenes of the table, and how long they are run (s): the dam until its front has crossed the bed, the heads until all have
/// fallen.
const SCENES: [(&str, f64); 2] = [("bench-dam", 0.5), ("monkey-splash", 1.0)];
/// How often the density error is read (1/s): as often as a window draws.
const READINGS: f64 = 60.0;

/// One line of the table.
#[derive(Serialize)]
struct Row {
    scene: String,
    solver: Pressure,
    aim: f64,
    particles: usize,
    seconds: f64,
    steps: u64,
    dt: f64,
    /// Mean over the run of the mean of `|rho / rho_0 - 1|`.
    density_error_mean: f64,
    /// The same of compressions alone.
    compression_mean: f64,
    iterations: f64,
    lost: u64,
    simulated_s_per_wall_s: f64,
    /// Where the system counts it: work of all threads, which other programs do not disturb.
    cpu_s_per_simulated_s: Option<f64>,
    threads: usize,
}

/// Runs the table.
pub fn table(args: &args::Bench) -> miette::Result<Outcome> {
    set_threads(args.threads)?;
    let scenes: Vec<(&str, f64)> = match &args.scene {
        Some(scene) => vec![(scene.as_str(), f64::INFINITY)],
        None => SCENES.to_vec(),
    };
    let mut finite = true;
    if !args.json {
        print(
            "scene            solver  aim      reached   compr.    steps   dt (ms)  rounds  lost  simulated s/wall s  CPU s/simulated s",
        );
    }
    for (name, seconds) in scenes {
        for aim in [0.01, 0.001] {
            for solver in [Pressure::Wcsph, Pressure::Dfsph, Pressure::Pbf] {
                let mut scene = Scene::open(name, &args.set).map_err(|e| *e)?;
                aim_at(&mut scene, solver, aim)?;
                let until = args.seconds.unwrap_or(seconds).min(scene.run.seconds);
                let row = measure(name, &scene, aim, until, &mut finite)?;
                if args.json { print_json(&row) } else { print(&line(&row)) }
            }
        }
    }
    Ok(if finite { Outcome::Fine } else { Outcome::WentWrong })
}

/// Sets a scene up for a mean density error. That of a weakly compressible fluid goes with the square of speed over sound, and is a
/// quarter of a per cent at ten times the largest speed; the others stop where they are told to.
fn aim_at(scene: &mut Scene, solver: Pressure, aim: f64) -> miette::Result<()> {
    let coarse = aim >= 0.005;
    let s = &mut scene.solver;
    s.pressure = solver;
    match solver {
        Pressure::Dfsph | Pressure::Auto => {
            (s.tolerance, s.divergence_tolerance) =
                if coarse { (0.5 * aim, 0.04 * aim) } else { (0.7 * aim, 0.1 * aim) };
            s.courant_flow = Some(if coarse { 1.0 } else { 0.4 });
            s.longest_dt = Some(1.0 / 120.0);
        }
        Pressure::Pbf => {
            s.tolerance = if coarse { 0.5 * aim } else { 0.8 * aim };
        }
        Pressure::Wcsph => {
            let speed = scene.assemble().map_err(|e| *e)?.model.largest_speed;
            scene.solver.sound_speed = Some(10.0 * (0.0025 / aim).sqrt() * speed);
        }
    }
    Ok(())
}

fn measure(name: &str, scene: &Scene, aim: f64, until: f64, finite: &mut bool) -> miette::Result<Row> {
    let mut world = World::from_scene(scene).map_err(|e| *e)?;
    let readings = (until * READINGS).ceil() as u64;
    let bar = progress(readings, name);
    let (mut error, mut compression, mut wall) = (0.0, 0.0, 0.0);
    let before = cpu_seconds();
    for reading in 1..=readings {
        let start = Instant::now();
        world.advance(until * reading as f64 / readings as f64, |_, step| {
            *finite &= step.trouble.is_none();
            step.trouble.is_none()
        });
        wall += start.elapsed().as_secs_f64();
        error += world.ledger().density_error_mean;
        compression += compressed(&world);
        bar.inc(1);
    }
    bar.finish_and_clear();
    let (solves, steps, count) = (world.solves(), world.steps().max(1), world.state().particles.count);
    Ok(Row {
        scene: name.into(),
        solver: scene.solver.pressure,
        aim,
        particles: count[0] + count[1],
        seconds: world.time(),
        steps,
        dt: world.time() / steps as f64,
        density_error_mean: error / readings as f64,
        compression_mean: compression / readings as f64,
        iterations: (solves.pressure + solves.divergence) as f64 / steps as f64,
        lost: world.ledger().lost + world.ledger().rigid_lost as u64,
        simulated_s_per_wall_s: world.time() / wall,
        cpu_s_per_simulated_s: before.zip(cpu_seconds()).map(|(before, now)| (now - before) / world.time()),
        threads: rayon::current_num_threads(),
    })
}

/// Mean of what densities are above that of rest.
fn compressed(world: &World) -> f64 {
    let p = &world.state().particles;
    let all = &p.density[..p.count[0]];
    all.iter().map(|d| f64::from((d - 1.0).max(0.0))).sum::<f64>() / all.len().max(1) as f64
}

/// Processor time of this program (s), where the system says it in the usual hundredths.
fn cpu_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/stat").ok()?;
    let mut fields = text.rsplit(')').next()?.split_whitespace().skip(11);
    let mut next = || fields.next()?.parse::<f64>().ok();
    Some((next()? + next()?) / 100.0)
}

fn line(r: &Row) -> String {
    let solver = match r.solver {
        Pressure::Auto => "auto",
        Pressure::Wcsph => "wcsph",
        Pressure::Dfsph => "dfsph",
        Pressure::Pbf => "pbf",
    };
    format!(
        "{:16} {:6}  {:4.1} %  {:7.3} %  {:7.3} %  {:6}  {:7.3}  {:6.1}  {:4}  {:18.4}  {:17.1}",
        r.scene,
        solver,
        100.0 * r.aim,
        100.0 * r.density_error_mean,
        100.0 * r.compression_mean,
        r.steps,
        1e3 * r.dt,
        r.iterations,
        r.lost,
        r.simulated_s_per_wall_s,
        r.cpu_s_per_simulated_s.unwrap_or(f64::NAN)
    )
}
