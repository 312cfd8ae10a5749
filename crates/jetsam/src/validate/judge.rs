//! Verdicts: what an expectation takes from a run, what it should be, and whether it is.

use super::take::{self, Wants};
use super::{Run, Series};
use crate::error::Result;
use crate::formula::{Scope, nearest};
use crate::scene::{By, Expect, Formula, Scene, Take};

/// An expectation with every name and formula resolved for one variant.
pub(super) struct Judge<'a> {
    pub(super) expect: &'a Expect,
    pub(super) probe: usize,
    take: Option<Take>,
    window: Option<[f64; 2]>,
    time: Option<f64>,
    wants: Wants,
    pub(super) curve: Vec<[f64; 2]>,
    shift: f64,
    bounds: Bounds,
    exact: Option<f64>,
}

/// What a number is judged by.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Bounds {
    pub(super) value: Option<f64>,
    pub(super) tolerance: Option<f64>,
    at_most: Option<f64>,
    at_least: Option<f64>,
}

/// What came out.
pub(super) struct Reached {
    pub(super) number: f64,
    pub(super) note: String,
}

impl<'a> Judge<'a> {
    /// Resolves an expectation that stands at `path` in the scene.
    pub(super) fn new(scene: &Scene, scope: &Scope, path: &str, e: &'a Expect) -> Result<Self> {
        let at = |key: &str| format!("{path}.{key}");
        let names = || scene.probe.iter().map(|p| p.name.as_str());
        let Some(probe) = names().position(|n| n == e.probe) else {
            let help = match nearest(&e.probe, names()) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("there are: {}", names().collect::<Vec<_>>().join(", ")),
            };
            return Err(scene.error(&at("probe"), format!("there is no probe `{}`", e.probe), help));
        };
        let number = |key: &str, f: &Option<Formula>| f.as_ref().map(|f| scope.number(scene, &at(key), f)).transpose();
        let window = match &e.window {
            Some([a, b]) => {
                let w = [scope.number(scene, &at("window.0"), a)?, scope.number(scene, &at("window.1"), b)?];
                if w[0] > w[1] {
                    return Err(scene.error(&at("window"), "the window ends before it begins", "give [from, to]"));
                }
                Some(w)
            }
            None => None,
        };
        let curve = super::curve::read(scene, scope, path, e)?;
        let value = number("value", &e.value)?;
        let largest = curve.iter().map(|p| p[1].abs()).fold(0.0, f64::max);
        let size = value.map_or(largest, f64::abs);
        let tolerance = number("tolerance", &e.tolerance)?.or(e.relative.map(|r| r * size));
        let wants = Wants {
            level: number("level", &e.level)?,
            nth: e.nth.round() as usize,
            prominence: number("prominence", &e.prominence)?,
        };
        let bounds = Bounds {
            value,
            tolerance,
            at_most: number("at_most", &e.at_most)?,
            at_least: number("at_least", &e.at_least)?,
        };
        let judge = Self {
            expect: e,
            probe,
            take: e.take,
            window,
            time: number("time", &e.time)?,
            wants,
            curve,
            shift: number("shift", &e.shift)?.unwrap_or(0.0).abs(),
            bounds,
            exact: number("compare.exact", &e.compare.as_ref().and_then(|c| c.exact.clone()))?,
        };
        judge.check(scene, path)?;
        Ok(judge)
    }

    /// Nothing is missing and nothing means nothing.
    fn check(&self, scene: &Scene, path: &str) -> Result<()> {
        let e = self.expect;
        let refuse = |key: &str, message: &str, help: &str| {
            let message = format!("the expectation of `{}`: {message}", e.probe);
            Err(scene.error(&format!("{path}.{key}"), message, help))
        };
        if e.source.trim().is_empty() {
            return refuse("source", "its source is empty", "say where the expected value comes from");
        }
        if e.tolerance.is_some() && e.relative.is_some() {
            return refuse("relative", "tolerance and relative are both given", "give one of them");
        }
        let curved = !self.curve.is_empty();
        let of_curve = matches!(e.take, Some(Take::MaxError | Take::MeanError | Take::RmsError));
        if of_curve && !curved {
            return refuse("take", "there is no curve to compare with", "give curve = [[time, value], ..] or a file");
        }
        if curved && (self.time.is_some() || self.window.is_some() || e.value.is_some() || e.compare.is_some()) {
            return refuse("curve", "a curve stands for itself", "leave out time, window, value and compare");
        }
        if curved && e.take.is_some() && !of_curve {
            return refuse("take", "of a curve only errors can be taken", "give max-error, mean-error or rms-error");
        }
        if !curved && (e.shift.is_some() || !e.scale.is_empty()) {
            return refuse("shift", "shift and scale belong to a curve", "leave them out");
        }
        if self.time.is_some() && (self.take.is_some() || self.window.is_some()) {
            return refuse("time", "time says what is taken already", "leave out take and window, or time");
        }
        let needs_level = matches!(e.take, Some(Take::FirstAbove | Take::FirstBelow | Take::TimeAbove));
        if needs_level && e.level.is_none() {
            return refuse("take", "it needs a level", "add level = ...");
        }
        let b = &self.bounds;
        if (b.value.is_some() || curved) && b.tolerance.is_none() && e.gate {
            let help = "add tolerance = ... or relative = ..., or gate = false to report it only";
            return refuse("value", "nothing says how far it may be off", help);
        }
        if e.gate && b.value.is_none() && !curved && b.at_most.is_none() && b.at_least.is_none() {
            let help = "add value with tolerance or relative, or at_most, or at_least, or gate = false";
            return refuse("probe", "nothing is expected", help);
        }
        if let Some(c) = &e.compare {
            let known = |name: &String| scene.variant.iter().any(|v| v.name == *name);
            if let Some(missing) = c.of.iter().find(|n| !known(n)) {
                return refuse("compare", &format!("there is no variant `{missing}`"), "name variants of this scene");
            }
            let enough = match c.by {
                By::Order if c.exact.is_none() => c.of.len() == 3,
                By::Spread | By::Mean | By::Median => c.of.len() >= 2,
                _ => c.of.len() == 2,
            };
            if !enough {
                let help = "difference, ratio and order need two variants, an order without `exact` three";
                return refuse("compare", "that many variants cannot be compared so", help);
            }
        }
        Ok(())
    }

    /// What the table calls it.
    pub(super) fn what(&self) -> String {
        if let Some(what) = &self.expect.what {
            return what.clone();
        }
        let short = super::report::short;
        let mut text = self.expect.probe.clone();
        match (self.time, self.take) {
            (Some(t), _) => text += &format!(" at {} s", short(t)),
            (None, Some(take)) => text = format!("{} of {text}", take.word()),
            (None, None) if !self.curve.is_empty() => text = format!("max-error of {text}"),
            (None, None) => {}
        }
        if let Some([a, b]) = self.window {
            text += &format!(" in {}..{} s", short(a), short(b));
        }
        if let Some(c) = &self.expect.compare {
            text += &format!(", {:?} of {}", c.by, c.of.join(", ")).to_lowercase();
        }
        text
    }

    /// The number, taken from one run.
    pub(super) fn reached(&self, run: &Run) -> Reached {
        let series = &run.series[self.probe];
        let mut note = String::new();
        let number = if !self.curve.is_empty() {
            let take = self.take.unwrap_or(Take::MaxError);
            let (shift, number) = if self.shift > 0.0 {
                take::best_shift(series, &self.curve, self.shift, take)
            } else {
                (0.0, take::distance(series, &self.curve, 0.0, take))
            };
            if self.shift > 0.0 {
                note = format!("shifted by {} s", super::report::short(shift));
            }
            number
        } else if let Some(t) = self.time {
            take::at(series, t)
        } else {
            let cut = match self.window {
                Some([a, b]) => take::clip(series, a, b),
                None => Series::clone(series),
            };
            take::take(&cut, self.take.unwrap_or(Take::Final), self.wants)
        };
        if let Some(trouble) = &run.trouble {
            // what was read before the end may look right: the run is not
            return Reached { number: f64::NAN, note: trouble.clone() };
        }
        if number.is_nan() {
            note = "the run holds no such value".into();
        }
        Reached { number, note }
    }

    /// One number of those of several runs.
    pub(super) fn compared(&self, by: By, numbers: &[f64]) -> f64 {
        let exact = self.exact.unwrap_or(0.0);
        let n: Vec<f64> = numbers.iter().map(|x| x - exact).collect();
        let (min, max) = n.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
        match by {
            By::Difference => n[0] - n[1],
            By::Ratio => n[0] / n[1],
            By::Spread | By::Median if n.iter().any(|x| x.is_nan()) => f64::NAN,
            By::Spread => max - min,
            By::Mean => n.iter().sum::<f64>() / n.len() as f64,
            By::Median => {
                let mut n = n.to_vec();
                n.sort_by(f64::total_cmp);
                0.5 * (n[(n.len() - 1) / 2] + n[n.len() / 2])
            }
            By::Order => {
                let ratio = if self.exact.is_none() { (n[0] - n[1]) / (n[1] - n[2]) } else { n[0] / n[1] };
                ratio.abs().ln() / self.expect.refinement.ln()
            }
        }
    }

    /// What is expected, and how far it may be off, as the table says it.
    pub(super) fn expected(&self) -> (String, String) {
        let short = super::report::short;
        let b = &self.bounds;
        let mut reference = b.value.map_or(String::new(), short);
        if !self.curve.is_empty() {
            reference = format!("curve of {} points", self.curve.len());
        }
        let mut tolerance = Vec::new();
        tolerance.extend(b.tolerance.map(|t| format!("± {}", short(t))));
        tolerance.extend(b.at_most.map(|t| format!("≤ {}", short(t))));
        tolerance.extend(b.at_least.map(|t| format!("≥ {}", short(t))));
        (reference, tolerance.join(", "))
    }

    /// The value expected, if it is one number.
    pub(super) fn value(&self) -> Option<f64> {
        self.bounds.value
    }

    /// The time at which the value is taken, if it is one.
    pub(super) fn time(&self) -> Option<f64> {
        self.time
    }

    /// The window in which the value is taken, if there is one.
    pub(super) fn window(&self) -> Option<[f64; 2]> {
        self.window
    }

    /// Whether a number is what it should be.
    pub(super) fn holds(&self, number: f64) -> bool {
        let b = &self.bounds;
        // the last bit of a sum must not decide
        let within = |error: f64, t: f64| error <= t * (1.0 + 1e-12);
        let target = if self.curve.is_empty() { b.value } else { Some(0.0) };
        number.is_finite()
            && target.is_none_or(|v| within((number - v).abs(), b.tolerance.unwrap_or(f64::INFINITY)))
            && b.at_most.is_none_or(|m| number <= m)
            && b.at_least.is_none_or(|m| number >= m)
    }
}
