//! `jetsam run`: a scene from its beginning to its end, frame by frame.

use crate::args::Run;
use crate::output::pictures::Artist;
use crate::output::{Outputs, frames_from};
use crate::terminal::{progress, say, seconds, table};
use crate::{Outcome, terminal};
use jetsam::{Recorder, Scene, Summary, Trouble, World};
use std::ffi::OsStr;
use std::path::Path;
use std::time::{Duration, Instant};

/// Runs a scene and writes what was asked for.
pub fn run(args: &Run) -> miette::Result<Outcome> {
    set_threads(args.threads)?;
    let mut input = args.input.clone();
    input.set.extend(args.seed.map(|seed| format!("world.seed={seed}")));
    let scene = input.open()?;
    let folder = args.out.clone().unwrap_or_else(|| Path::new("out").join(name_of(&input.scene)));
    let artist = Artist::of(&args.save, &args.pictures)?;
    let assembly = scene.assemble().map_err(|e| *e)?;
    let (mut world, why) = World::choose_with(args.backend.into(), artist.gpu(), assembly)?;
    if let Some(why) = why {
        say(&format!("on the processor: {why}"));
    }
    for warning in &world.model().warnings {
        say(&format!("warning: {warning}"));
    }
    let mut outputs = Outputs::create(&folder, &args.save, (&args.pictures, artist), &scene, &world)?;
    let times = Frames::of(&scene, args);
    let bar = progress(times.count, &name_of(&input.scene).to_string_lossy());
    let mut recorder = Recorder::default();
    let (mut trouble, mut next) = (None, 1);
    outputs.write(&world, &recorder.frame(&world, Duration::ZERO))?;
    for frame in 1..=times.count {
        let start = Instant::now();
        if outputs.look_between() {
            world.advance(times.at(frame), |world, step| {
                outputs.step(world);
                trouble = step.trouble;
                trouble.is_none()
            });
        } else {
            trouble = world.run_to(times.at(frame));
        }
        let stats = recorder.frame(&world, start.elapsed());
        outputs.write(&world, &stats)?;
        next = frame + 1;
        bar.set_message(format!("real-time factor {:.3}", stats.real_time_factor));
        bar.inc(1);
        if trouble.is_some() {
            break;
        }
    }
    bar.finish_and_clear();
    outputs.finish()?;
    let summary = recorder.summary(&world);
    let old = frames_from(&folder, next);
    if old > 0 {
        say(&format!("note: {old} files from frame_{next:05} on are of an earlier run into {}", folder.display()));
    }
    let drawn = args.save.iter().any(|kind| kind.is_picture());
    say(&describe(&summary, &folder, drawn));
    if let Some(fault) = world.fault() {
        return Err(fault.clone().into());
    }
    Ok(judge(&scene, &summary, trouble))
}

/// Sets how many threads compute; before anything is computed.
pub fn set_threads(threads: Option<u16>) -> miette::Result<()> {
    if let Some(n) = threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n.into()).build_global();
        pool.map_err(|e| miette::miette!("{n} threads cannot be started: {e}"))?;
    }
    Ok(())
}

/// When frames end: whole frame lengths, and the last at the end of the run.
struct Frames {
    count: u64,
    rate: f64,
    end: f64,
}

impl Frames {
    fn of(scene: &Scene, args: &Run) -> Self {
        let rate = scene.run.frames_per_second;
        match args.frames {
            Some(count) => Self { count, rate, end: f64::INFINITY },
            None => {
                let end = args.seconds.unwrap_or(scene.run.seconds);
                Self { count: (end * rate - 1e-9).ceil().max(0.0) as u64, rate, end }
            }
        }
    }

    fn at(&self, frame: u64) -> f64 {
        (frame as f64 / self.rate).min(self.end)
    }
}

/// A scene's name: that of its file, where it is a path.
fn name_of(scene: &str) -> &OsStr {
    Path::new(scene).file_stem().unwrap_or(scene.as_ref())
}

fn describe(s: &Summary, folder: &Path, drawn: bool) -> String {
    let bound = s.dt_bound.map_or(String::new(), |b| format!(", bounded by {}", b.name()));
    let bodies = match s.bodies {
        0 => String::new(),
        n => format!(", {n} bodies of {} particles", s.rigid_particles),
    };
    let agents = if s.agents > 0 { format!(", {} agents", s.agents) } else { String::new() };
    let (places, velocities) = (s.pressure_iterations, s.divergence_iterations);
    let iterations = format!(
        "pressure {places:.1} a step, {:.2} % left; divergence {velocities:.1}, {:.3} % left",
        100.0 * s.pressure_residual,
        100.0 * s.divergence_residual
    );
    let back = if s.put_back > 0 { format!(" ({} put back from walls)", s.put_back) } else { String::new() };
    let left = if s.left > 0 { format!(" ({} left through open sides)", s.left) } else { String::new() };
    let drawn = if drawn { ", pictures drawn meanwhile" } else { "" };
    let wall = format!("{} in {}{drawn}", seconds(s.time), seconds(s.wall_s));
    let mut rows = vec![
        ("real-time factor", format!("{:.3}  ({wall})", s.real_time_factor)),
        ("steps", format!("{}, mean {}{bound}", s.steps, seconds(s.dt))),
        ("particles", format!("{} fluid{bodies}{agents}", s.fluid)),
        (
            "density error",
            format!("mean {:.2} %, max {:.2} %", 100.0 * s.density_error_mean, 100.0 * s.density_error_max),
        ),
        ("lost particles", format!("{}{left}{back}", s.lost)),
        ("fast contacts", s.fast_contacts.to_string()),
        ("momentum residual", format!("{:.1e}", s.momentum_residual)),
        ("state hash", s.state_hash.clone()),
        ("output", folder.display().to_string()),
    ];
    if places + velocities > 0.0 {
        rows.insert(4, ("iterations", iterations));
    }
    table(&rows)
}

/// Whether the run can be believed.
fn judge(scene: &Scene, summary: &Summary, trouble: Option<Trouble>) -> Outcome {
    let mut outcome = Outcome::Fine;
    let mut blame = |message: String, help: &str| {
        terminal::say(&format!("error: {message}\nhelp: {help}"));
        outcome = Outcome::WentWrong;
    };
    if let Some(trouble) = trouble {
        let message = format!("the run was stopped at {:.4} s: {trouble}", summary.time);
        blame(message, "`jetsam check` shows the stability margins; remove a stated dt, stiffness or sound_speed");
    }
    if summary.lost as f64 > scene.run.lost_allowed {
        let message = format!("{} particles were lost, {} are allowed", summary.lost, scene.run.lost_allowed);
        blame(
            message,
            "lower solver.courant or raise solver.sound_speed; [run] lost_allowed states how many may be lost",
        );
    }
    outcome
}
