//! Validation: a scene runs, its probes are compared with what the scene expects.
//!
//! In: a scene with `[[probe]]` and `[[expect]]` blocks, and perhaps `[[variant]]`s. Out: a [`Report`] with a [`Row`] for
//! every expectation, the course of the probes, and a plot. No case has Rust of its own. Called by `jetsam validate` and by
//! the test `validation`.

pub mod cases;
mod curve;
mod judge;
mod plot;
mod report;
mod svg;
pub mod take;

pub use report::{Report, Row, Verdict, markdown, short};

use crate::backend::Choice;
use crate::error::Result;
use crate::formula::Scope;
use crate::gpu::GpuError;
use crate::probe::{Probes, Sampler, Series};
use crate::scene::{Expect, Scene, Source};
use crate::world::World;
use judge::Judge;
use std::time::Instant;

/// One run of a case.
#[derive(Debug)]
pub struct Run {
    /// Name of the variant; empty where the scene has none.
    pub variant: String,
    /// Readings of every probe, in the order of the scene.
    pub series: Vec<Series>,
    /// Readings along lines at the times when they are judged.
    profiles: Vec<Profile>,
    /// Wall-clock time (s).
    pub seconds: f64,
    /// Particles of all kinds.
    pub particles: usize,
    /// What went wrong, if anything.
    pub trouble: Option<String>,
    /// Whether the backend asked for can run the scene at all; else `trouble` says why not.
    pub ran: bool,
}

/// A probe's readings along its line at one time.
#[derive(Debug)]
struct Profile {
    probe: usize,
    time: f64,
    /// Way along the line (m), reading, reference.
    points: Vec<[f64; 3]>,
}

/// One variant of a case, ready to run.
struct Variant {
    name: String,
    scene: Scene,
    scope: Scope,
}

/// Runs a case and judges it. `overrides` are `key=value` pairs as of `--set`; `progress` hears the variant and the part of
/// the whole case that is done; the runs are made on `backend`.
///
/// # Errors
/// Whatever is wrong with the scene, found before the first run where it can be. A run that goes wrong is no error but a row
/// that fails.
pub fn run(
    name: &str,
    source: &Source,
    overrides: &[String],
    backend: Choice,
    progress: &mut dyn FnMut(&str, f64),
) -> Result<Report> {
    let base = Scene::parse(source.clone(), overrides)?;
    let variants = variants(&base, source, overrides)?;
    check(&base, &variants)?;
    let mut runs = Vec::new();
    for (k, variant) in variants.iter().enumerate() {
        let n = variants.len() as f64;
        runs.push(simulate(variant, backend, &mut |part| progress(&variant.name, (k as f64 + part) / n))?);
    }
    let rows = rows(name, &base, &variants, &runs)?;
    let plot = plot::plot(&base, &variants, &runs)?;
    let (id, notes) = base.validation.clone().map_or((String::new(), String::new()), |v| (v.id, v.notes));
    let probes = base.probe.iter().map(|p| p.name.clone()).collect();
    Ok(Report { name: name.into(), id, title: base.title.clone(), notes, rows, runs, plot, probes })
}

/// The scene as each variant has it, or as it stands.
fn variants(base: &Scene, source: &Source, overrides: &[String]) -> Result<Vec<Variant>> {
    let ready = |name: &str, scene: Scene| -> Result<Variant> {
        Ok(Variant { name: name.into(), scope: Scope::of(&scene)?, scene })
    };
    if base.variant.is_empty() {
        return Ok(vec![ready("", base.clone())?]);
    }
    let mut all: Vec<Variant> = Vec::new();
    for (index, v) in base.variant.iter().enumerate() {
        if all.iter().any(|a| a.name == v.name) {
            let message = format!("two variants are named `{}`", v.name);
            return Err(base.error(&format!("variant.{index}.name"), message, "give each a name of its own"));
        }
        let set: Vec<String> = v.set.iter().chain(overrides).cloned().collect();
        all.push(ready(&v.name, Scene::parse(source.clone(), &set)?)?);
    }
    Ok(all)
}

/// Expectations of a scene that hold for every variant, and then those of one variant, with their paths.
fn expectations<'a>(scene: &'a Scene, variant: &str) -> impl Iterator<Item = (String, &'a Expect)> {
    let all = scene.expect.iter().enumerate().map(|(i, e)| (format!("expect.{i}"), e));
    let name = variant.to_owned();
    let wanted =
        move |(_, e): &(String, &Expect)| e.compare.is_none() && (e.variants.is_empty() || e.variants.contains(&name));
    let own = scene.variant.iter().enumerate().filter(move |(_, v)| v.name == variant);
    let own =
        own.flat_map(|(k, v)| v.expect.iter().enumerate().map(move |(i, e)| (format!("variant.{k}.expect.{i}"), e)));
    all.filter(wanted).chain(own.collect::<Vec<_>>())
}

/// Every expectation can be judged: found out before anything runs.
fn check(base: &Scene, variants: &[Variant]) -> Result<()> {
    let mut count = 0;
    for v in variants {
        for (path, e) in expectations(&v.scene, &v.name) {
            Judge::new(&v.scene, &v.scope, &path, e)?;
            count += 1;
        }
    }
    let scope = Scope::of(base)?;
    for (i, e) in base.expect.iter().enumerate() {
        if e.compare.is_some() {
            Judge::new(base, &scope, &format!("expect.{i}"), e)?;
            count += 1;
        }
        if let Some(missing) = e.variants.iter().find(|n| !base.variant.iter().any(|v| v.name == **n)) {
            let message = format!("there is no variant `{missing}`");
            return Err(base.error(&format!("expect.{i}.variants"), message, "name variants of this scene"));
        }
    }
    if let Some((k, _)) = base.variant.iter().enumerate().find(|(_, v)| v.expect.iter().any(|e| e.compare.is_some())) {
        let message = "a comparison stands inside one variant";
        return Err(base.error(&format!("variant.{k}.expect"), message, "write it as an [[expect]] of the scene"));
    }
    if count == 0 {
        let help = "add [[probe]] and [[expect]] blocks; docs/scene.md shows how";
        return Err(base.error("", "the scene expects nothing: there is nothing to judge", help));
    }
    Ok(())
}

/// Runs one variant from its beginning to its end.
fn simulate(variant: &Variant, backend: Choice, progress: &mut dyn FnMut(f64)) -> Result<Run> {
    let start = Instant::now();
    let scene = &variant.scene;
    let mut world = match World::choose(backend, scene.assemble()?) {
        Ok((world, _)) => world,
        Err(why) => {
            let ran = !matches!(why, GpuError::Scene { .. } | GpuError::Limit { .. });
            let trouble = Some(if ran { format!("not run: {why}") } else { why.to_string() });
            let (series, profiles) = (vec![Series::default(); scene.probe.len()], Vec::new());
            return Ok(Run {
                variant: variant.name.clone(),
                series,
                profiles,
                seconds: 0.0,
                particles: 0,
                trouble,
                ran,
            });
        }
    };
    let mut sampler = Sampler::new(scene, &world)?;
    let mut waiting = profile_times(variant)?;
    let mut profiles = Vec::new();
    let mut trouble = None;
    let (end, rate) = (scene.run.seconds, scene.run.frames_per_second);
    let frames = (end * rate - 1e-9).ceil().max(0.0) as u64;
    for frame in 0..=frames {
        let until = (frame as f64 / rate).min(end);
        if sampler.looks_between() {
            world.advance(until, |world, step| {
                sampler.step(world);
                trouble = step.trouble;
                trouble.is_none()
            });
        } else {
            trouble = world.run_to(until);
        }
        if frame > 0 {
            sampler.frame(&world);
        }
        let due = |(_, t): &(usize, f64)| *t <= world.time() * (1.0 + 1e-9);
        for (probe, _) in waiting.extract_if(.., |w| due(w)) {
            profiles.push(Profile { probe, time: world.time(), points: sampler.probes().profile(&world, probe) });
        }
        progress((frame + 1) as f64 / (frames + 1) as f64);
        if trouble.is_some() {
            break;
        }
    }
    let ledger = world.ledger();
    let lost = ledger.lost + ledger.rigid_lost as u64;
    let mut wrong = trouble.map(|t| format!("stopped at {} s: {t}", short(world.time())));
    if wrong.is_none() && lost as f64 > scene.run.lost_allowed {
        wrong = Some(format!("{lost} particles were lost, {} are allowed", scene.run.lost_allowed));
    }
    let particles = world.state().particles.len();
    let seconds = start.elapsed().as_secs_f64();
    Ok(Run {
        variant: variant.name.clone(),
        series: sampler.into_series(),
        profiles,
        seconds,
        particles,
        trouble: wrong,
        ran: true,
    })
}

/// Probes on lines that are judged at some time, with the time.
fn profile_times(variant: &Variant) -> Result<Vec<(usize, f64)>> {
    let mut times = Vec::new();
    for (path, e) in expectations(&variant.scene, &variant.name) {
        let judge = Judge::new(&variant.scene, &variant.scope, &path, e)?;
        if variant.scene.probe[judge.probe].line.is_some() {
            times.push((judge.probe, judge.time().unwrap_or(variant.scene.run.seconds)));
        }
    }
    times.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    times.dedup();
    Ok(times)
}

/// A verdict on every expectation.
fn rows(name: &str, base: &Scene, variants: &[Variant], runs: &[Run]) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    for (v, run) in variants.iter().zip(runs) {
        for (path, e) in expectations(&v.scene, &v.name) {
            let judge = Judge::new(&v.scene, &v.scope, &path, e)?;
            let reached = judge.reached(run);
            rows.push(Row::new(name, &v.name, &judge, reached.number, reached.note, run.seconds, run.ran));
        }
    }
    let scope = Scope::of(base)?;
    for (i, e) in base.expect.iter().enumerate() {
        let Some(compare) = &e.compare else { continue };
        let path = format!("expect.{i}");
        let overall = Judge::new(base, &scope, &path, e)?;
        let (mut numbers, mut notes, mut seconds, mut ran) = (Vec::new(), Vec::new(), 0.0, true);
        for wanted in &compare.of {
            let k = variants.iter().position(|v| v.name == *wanted).unwrap_or(0);
            let judge = Judge::new(&variants[k].scene, &variants[k].scope, &path, &variants[k].scene.expect[i])?;
            let reached = judge.reached(&runs[k]);
            notes.push(format!("{wanted}: {}", short(reached.number)));
            numbers.push(reached.number);
            seconds += runs[k].seconds;
            ran &= runs[k].ran;
        }
        let number = overall.compared(compare.by, &numbers);
        rows.push(Row::new(name, "", &overall, number, notes.join(", "), seconds, ran));
    }
    Ok(rows)
}

/// Checks that the probes and expectations of a scene can be read, without running it.
///
/// # Errors
/// As [`run`].
pub fn check_scene(scene: &Scene, world: &World) -> Result<()> {
    Probes::new(scene, world)?;
    if scene.expect.is_empty() && scene.variant.is_empty() {
        return Ok(());
    }
    check(scene, &variants(scene, &scene.source, &[])?)
}
