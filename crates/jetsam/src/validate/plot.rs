//! The plot of a case: every probe that is judged, reference against simulation.

use super::judge::Judge;
use super::svg::{Mark, Panel, Set, document};
use super::{Run, Variant, expectations};
use crate::error::Result;
use crate::scene::{Scene, Take};

/// Panels of one case at most.
const MOST: usize = 16;

/// Draws a case.
pub(super) fn plot(base: &Scene, variants: &[Variant], runs: &[Run]) -> Result<String> {
    let mut panels = Vec::new();
    for (probe, p) in base.probe.iter().enumerate() {
        let profiles = profile_panel(probe, &p.name, runs);
        let drawn = !profiles.sets.is_empty();
        if drawn {
            panels.push(profiles);
        }
        if let Some(panel) = course_panel(base, probe, variants, runs)?.filter(|_| !drawn) {
            panels.push(panel);
        }
    }
    panels.truncate(MOST);
    if let Some(panel) = numbers_panel(variants, runs)? {
        panels.push(panel);
    }
    Ok(document(&panels))
}

/// The course of a probe that is judged, in every run.
fn course_panel(base: &Scene, probe: usize, variants: &[Variant], runs: &[Run]) -> Result<Option<Panel>> {
    let name = &base.probe[probe].name;
    let mut panel = Panel { title: name.clone(), x: "time (s)".into(), sets: Vec::new() };
    let mut judged = base.expect.iter().any(|e| e.probe == *name && e.compare.is_some());
    for (color, (v, run)) in variants.iter().zip(runs).enumerate() {
        let series = &run.series[probe];
        if series.time.len() < 2 {
            continue;
        }
        let points = series.time.iter().zip(&series.value).map(|(t, v)| [*t, *v]).collect();
        panel.sets.push(Set { name: run.variant.clone(), mark: Mark::Line, color, points });
        let ends = [series.time[0], series.time[series.time.len() - 1]];
        for (path, e) in expectations(&v.scene, &v.name) {
            let judge = Judge::new(&v.scene, &v.scope, &path, e)?;
            if judge.probe != probe {
                continue;
            }
            judged = true;
            // what runs are compared with has their colour, or one of its own beside a single run
            panel.sets.extend(reference(&judge, ends, if variants.len() == 1 { 1 } else { color }));
        }
    }
    panel.sets.dedup_by(|a, b| a.mark != Mark::Line && a.mark == b.mark && a.points == b.points);
    Ok((judged && !panel.sets.is_empty()).then_some(panel))
}

/// What is expected of a course: a curve, a point, a level, or nothing that can be drawn.
fn reference(judge: &Judge, ends: [f64; 2], color: usize) -> Option<Set> {
    let set = |mark, points| Some(Set { name: String::new(), mark, color, points });
    if !judge.curve.is_empty() {
        return set(Mark::Rings, judge.curve.clone());
    }
    let value = judge.value()?;
    if let Some(t) = judge.time() {
        return set(Mark::Rings, vec![[t, value]]);
    }
    let [a, b] = judge.window().unwrap_or(ends);
    match judge.expect.take {
        None | Some(Take::Final) => set(Mark::Rings, vec![[b, value]]),
        Some(Take::Mean | Take::Min | Take::Max | Take::CrestHeight) => set(Mark::Dashes, vec![[a, value], [b, value]]),
        _ => None,
    }
}

/// Readings along a line, with their reference.
fn profile_panel(probe: usize, name: &str, runs: &[Run]) -> Panel {
    let mut panel = Panel { title: name.into(), x: "along the line (m)".into(), sets: Vec::new() };
    for run in runs {
        for profile in run.profiles.iter().filter(|p| p.probe == probe) {
            let color = panel.sets.len();
            let column = |c: usize| profile.points.iter().map(|p| [p[0], p[c]]).collect::<Vec<_>>();
            let name = format!("{} {} s", run.variant, super::short(profile.time));
            panel.sets.push(Set { name: name.trim().into(), mark: Mark::Dots, color, points: column(1) });
            panel.sets.push(Set { name: String::new(), mark: Mark::Dashes, color, points: column(2) });
        }
    }
    panel
}

/// Numbers that have no course, expected and reached, side by side.
fn numbers_panel(variants: &[Variant], runs: &[Run]) -> Result<Option<Panel>> {
    let (mut reached, mut expected) = (Vec::new(), Vec::new());
    for (v, run) in variants.iter().zip(runs) {
        for (path, e) in expectations(&v.scene, &v.name) {
            let judge = Judge::new(&v.scene, &v.scope, &path, e)?;
            let (Some(value), true) = (judge.value(), run.series[judge.probe].time.len() < 2 || drawn_nowhere(e.take))
            else {
                continue;
            };
            let size = if value == 0.0 { 1.0 } else { value };
            expected.push([expected.len() as f64 + 1.0, value / size]);
            reached.push([expected.len() as f64, judge.reached(run).number / size]);
        }
    }
    if expected.is_empty() {
        return Ok(None);
    }
    let set = |name: &str, mark, color, points| Set { name: name.into(), mark, color, points };
    let sets = vec![set("reached", Mark::Dots, 0, reached), set("expected", Mark::Rings, 1, expected)];
    Ok(Some(Panel { title: "numbers over their reference".into(), x: "row of the table".into(), sets }))
}

/// Whether a number cannot be seen in the plot of its course.
fn drawn_nowhere(take: Option<Take>) -> bool {
    matches!(
        take,
        Some(Take::Period | Take::Slope | Take::Integral | Take::TimeAbove | Take::FirstAbove | Take::FirstBelow)
    )
}
