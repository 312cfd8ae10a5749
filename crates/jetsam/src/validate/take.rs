//! Numbers taken from the course of a probe.
//!
//! In: readings in the order of time. Out: one number; `NaN` where the course holds none (no crest, no crossing).

use crate::probe::Series;
use crate::scene::Take;

/// What a [`Take`] may want to know besides the course.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wants {
    /// The level of crossings.
    pub level: Option<f64>,
    /// Which crest, counted from 1.
    pub nth: usize,
    /// How far the course must fall on either side of a crest.
    pub prominence: Option<f64>,
}

/// The value at a time, between readings on a straight line; `NaN` outside them. A single reading holds for all times.
pub fn at(s: &Series, t: f64) -> f64 {
    let (Some(&first), Some(&last)) = (s.time.first(), s.time.last()) else { return f64::NAN };
    if s.time.len() == 1 {
        return s.value[0];
    }
    let slack = 1e-9 * (last - first).abs();
    if !(first - slack..=last + slack).contains(&t) {
        return f64::NAN;
    }
    let k = s.time.partition_point(|x| *x < t).clamp(1, s.time.len() - 1);
    let (a, b) = (s.time[k - 1], s.time[k]);
    if b <= a {
        return s.value[k];
    }
    let part = ((t - a) / (b - a)).clamp(0.0, 1.0);
    s.value[k - 1] + part * (s.value[k] - s.value[k - 1])
}

/// The course from one time to another, its ends interpolated.
pub fn clip(s: &Series, from: f64, to: f64) -> Series {
    if s.time.len() < 2 {
        return s.clone();
    }
    let mut cut = Series::default();
    let mut push = |t: f64, v: f64| {
        if v.is_finite() {
            cut.time.push(t);
            cut.value.push(v);
        }
    };
    push(from, at(s, from));
    for (&t, &v) in s.time.iter().zip(&s.value).filter(|(t, _)| from < **t && **t < to) {
        push(t, v);
    }
    push(to, at(s, to));
    cut
}

/// The number taken from a course.
pub fn take(s: &Series, what: Take, wants: Wants) -> f64 {
    let v = &s.value;
    let (Some(&first), Some(&last)) = (v.first(), v.last()) else { return f64::NAN };
    let (min, max) = v.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
    let level = wants.level.unwrap_or(0.0);
    match what {
        Take::Final => last,
        Take::First => first,
        Take::Mean => mean(s, |x| x),
        Take::Min => min,
        Take::Max => max,
        Take::Largest => max.abs().max(min.abs()),
        Take::Rms => mean(s, |x| x * x).sqrt(),
        Take::Noise => {
            let middle = mean(s, |x| x);
            mean(s, |x| (x - middle) * (x - middle)).sqrt()
        }
        Take::Spread => max - min,
        Take::Integral => integral(s, |x| x),
        Take::Slope => slope(s),
        Take::Drift => last - first,
        Take::Period => period(s, wants.level.unwrap_or_else(|| mean(s, |x| x))),
        Take::FirstAbove => first_above(s, level),
        Take::FirstBelow => first_above(&negative(s), -level),
        Take::TimeAbove => time_above(s, level),
        Take::CrestTime => crest(s, wants).0,
        Take::CrestHeight => crest(s, wants).1,
        Take::MaxError | Take::MeanError | Take::RmsError => f64::NAN,
    }
}

/// Integral by the trapezium rule.
fn integral(s: &Series, f: impl Fn(f64) -> f64) -> f64 {
    let pair = |k: usize| 0.5 * (s.time[k + 1] - s.time[k]) * (f(s.value[k]) + f(s.value[k + 1]));
    (0..s.time.len().saturating_sub(1)).map(pair).sum()
}

/// Mean over time.
fn mean(s: &Series, f: impl Fn(f64) -> f64) -> f64 {
    let length = s.time[s.time.len() - 1] - s.time[0];
    if length > 0.0 { integral(s, f) / length } else { f(s.value[0]) }
}

/// Slope of the line of least squares.
fn slope(s: &Series) -> f64 {
    let n = s.time.len() as f64;
    let (t, v) = (s.time.iter().sum::<f64>() / n, s.value.iter().sum::<f64>() / n);
    let pairs = || s.time.iter().zip(&s.value);
    pairs().map(|(a, b)| (a - t) * (b - v)).sum::<f64>() / pairs().map(|(a, _)| (a - t) * (a - t)).sum::<f64>()
}

fn negative(s: &Series) -> Series {
    Series { time: s.time.clone(), value: s.value.iter().map(|v| -v).collect() }
}

/// When the course is first above a level.
fn first_above(s: &Series, level: f64) -> f64 {
    match s.value.iter().position(|v| *v > level) {
        None => f64::NAN,
        Some(0) => s.time[0],
        Some(k) => s.time[k - 1] + part_before(s, k - 1, level) * (s.time[k] - s.time[k - 1]),
    }
}

/// Part of the way from reading `k` to the next at which a straight line meets the level.
fn part_before(s: &Series, k: usize, level: f64) -> f64 {
    ((level - s.value[k]) / (s.value[k + 1] - s.value[k])).clamp(0.0, 1.0)
}

/// How long the course is above a level.
fn time_above(s: &Series, level: f64) -> f64 {
    let pair = |k: usize| {
        let above = |k: usize| s.value[k] > level;
        let part = match (above(k), above(k + 1)) {
            (true, true) => 1.0,
            (false, false) => 0.0,
            (false, true) => 1.0 - part_before(s, k, level),
            (true, false) => part_before(s, k, level),
        };
        part * (s.time[k + 1] - s.time[k])
    };
    (0..s.time.len().saturating_sub(1)).map(pair).sum()
}

/// Mean time between upward passages.
fn period(s: &Series, level: f64) -> f64 {
    let passes: Vec<f64> = (0..s.time.len().saturating_sub(1))
        .filter(|&k| s.value[k] <= level && s.value[k + 1] > level)
        .map(|k| passage(s, k, level))
        .collect();
    match passes.as_slice() {
        [first, .., last] => (last - first) / (passes.len() - 1) as f64,
        _ => f64::NAN,
    }
}

/// When the cubic through four readings passes the level between readings `k` and `k + 1`: sharp even for few readings a
/// period.
fn passage(s: &Series, k: usize, level: f64) -> f64 {
    let from = k.saturating_sub(1);
    let nodes = from..(k + 3).min(s.time.len());
    let value = |t: f64| {
        let term = |i: usize| {
            let others = nodes.clone().filter(|&j| j != i);
            s.value[i] * others.map(|j| (t - s.time[j]) / (s.time[i] - s.time[j])).product::<f64>()
        };
        nodes.clone().map(term).sum::<f64>() - level
    };
    let (mut a, mut b) = (s.time[k], s.time[k + 1]);
    for _ in 0..60 {
        let middle = 0.5 * (a + b);
        if value(middle) <= 0.0 { a = middle } else { b = middle }
    }
    0.5 * (a + b)
}

/// Time and height of the n-th crest that stands out far enough on both sides.
fn crest(s: &Series, wants: Wants) -> (f64, f64) {
    let (min, max) = s.value.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
    let prominence = wants.prominence.unwrap_or(0.1 * (max - min));
    let (mut low, mut high, mut found) = (s.value[0], None::<usize>, 0);
    for (k, &v) in s.value.iter().enumerate() {
        match high {
            None => {
                low = low.min(v);
                if v > low + prominence {
                    high = Some(k);
                }
            }
            Some(h) if v > s.value[h] => high = Some(k),
            Some(h) if v < s.value[h] - prominence => {
                found += 1;
                if found == wants.nth.max(1) {
                    return (s.time[h], s.value[h]);
                }
                (low, high) = (v, None);
            }
            _ => {}
        }
    }
    (f64::NAN, f64::NAN)
}

/// How far a course is from a curve whose times are moved by `shift`: largest, mean or root mean square over the
/// curve's points. Points beyond the course count as infinitely far.
pub fn distance(s: &Series, curve: &[[f64; 2]], shift: f64, what: Take) -> f64 {
    let error = |p: &[f64; 2]| {
        let e = (at(s, p[0] + shift) - p[1]).abs();
        if e.is_nan() { f64::INFINITY } else { e }
    };
    let n = curve.len() as f64;
    match what {
        Take::MeanError => curve.iter().map(error).sum::<f64>() / n,
        Take::RmsError => (curve.iter().map(error).map(|e| e * e).sum::<f64>() / n).sqrt(),
        _ => curve.iter().map(error).fold(0.0, f64::max),
    }
}

/// The shift within `most` either way for which the distance is least, and that distance.
pub fn best_shift(s: &Series, curve: &[[f64; 2]], most: f64, what: Take) -> (f64, f64) {
    const TRIES: i32 = 200;
    let mut best = (0.0, distance(s, curve, 0.0, what));
    let (mut middle, mut width) = (0.0, most);
    for _ in 0..2 {
        for k in -TRIES..=TRIES {
            let shift: f64 = (middle + width * f64::from(k) / f64::from(TRIES)).clamp(-most, most);
            let d = distance(s, curve, shift, what);
            if d < best.1 {
                best = (shift, d);
            }
        }
        (middle, width) = (best.0, width / f64::from(TRIES));
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{PI, TAU};

    /// `f` at `n + 1` times from 0 to `end`.
    fn course(end: f64, n: usize, f: impl Fn(f64) -> f64) -> Series {
        let time: Vec<f64> = (0..=n).map(|k| end * k as f64 / n as f64).collect();
        Series { value: time.iter().map(|t| f(*t)).collect(), time }
    }

    fn near(a: f64, b: f64, tolerance: f64) {
        assert!((a - b).abs() <= tolerance, "{a} is not {b}");
    }

    #[test]
    fn means_and_integrals_are_those_of_closed_forms() {
        let s = course(3.0, 3000, |t| 2.0 + 3.0 * (TAU * t).sin());
        let of = |t| take(&s, t, Wants::default());
        near(of(Take::Mean), 2.0, 1e-6);
        near(of(Take::Integral), 6.0, 1e-5);
        near(of(Take::Noise), 3.0 / 2f64.sqrt(), 1e-5);
        near(of(Take::Rms), (4.0 + 4.5f64).sqrt(), 1e-5);
        near(of(Take::Min), -1.0, 1e-5);
        near(of(Take::Max), 5.0, 1e-5);
        near(of(Take::Largest), 5.0, 1e-5);
        near(of(Take::Spread), 6.0, 1e-5);
        near(of(Take::First), 2.0, 0.0);
        near(of(Take::Final), 2.0, 1e-9);
        near(of(Take::Drift), 0.0, 1e-9);
        let line = course(2.0, 7, |t| 1.0 - 0.5 * t);
        near(take(&line, Take::Slope, Wants::default()), -0.5, 1e-12);
        near(take(&line, Take::Drift, Wants::default()), -1.0, 1e-12);
    }

    #[test]
    fn levels_are_crossed_where_the_closed_form_says() {
        let s = course(2.0, 400, |t| (PI * t).sin());
        let wants = Wants { level: Some(0.5), nth: 1, prominence: None };
        near(take(&s, Take::FirstAbove, wants), 1.0 / 6.0, 1e-4);
        near(take(&s, Take::TimeAbove, wants), 2.0 / 3.0, 1e-4);
        let wants = Wants { level: Some(-0.5), ..wants };
        near(take(&s, Take::FirstBelow, wants), 7.0 / 6.0, 1e-4);
        assert!(take(&s, Take::FirstAbove, Wants { level: Some(2.0), ..wants }).is_nan());
    }

    #[test]
    fn a_period_is_sharp_with_ten_readings_a_period() {
        let s = course(100.0, 1000, |t| 0.3 + (TAU * t / 1.003 + 0.4).cos());
        near(take(&s, Take::Period, Wants { level: Some(0.3), ..Wants::default() }), 1.003, 2e-5);
    }

    #[test]
    fn crests_are_counted_past_noise() {
        let s = course(5.0, 5000, |t| (0.2 * t).exp() * (TAU * t).sin() + 0.02 * (97.0 * t).sin());
        for n in [1, 3] {
            let wants = Wants { nth: n, ..Wants::default() };
            near(take(&s, Take::CrestTime, wants), n as f64 - 0.75, 0.03);
            near(take(&s, Take::CrestHeight, wants), (0.2 * (n as f64 - 0.75)).exp(), 0.04);
        }
        assert!(take(&s, Take::CrestTime, Wants { nth: 9, ..Wants::default() }).is_nan());
    }

    #[test]
    fn windows_end_between_readings() {
        let s = course(10.0, 10, |t| t);
        let cut = clip(&s, 2.5, 3.5);
        assert_eq!((cut.time.as_slice(), cut.value.as_slice()), (&[2.5, 3.0, 3.5][..], &[2.5, 3.0, 3.5][..]));
        near(take(&cut, Take::Integral, Wants::default()), 3.0, 1e-12);
        assert!(at(&s, 11.0).is_nan() && clip(&s, 11.0, 12.0).time.is_empty());
    }

    #[test]
    fn a_curve_is_met_after_a_shift_and_no_further_than_allowed() {
        let s = course(4.0, 4000, |t| (t - 0.15) * (t - 0.15));
        let curve: Vec<[f64; 2]> = (4..8).map(|k| [0.4 * f64::from(k), (0.4 * f64::from(k)).powi(2)]).collect();
        near(distance(&s, &curve, 0.0, Take::MaxError), 2.8 * 2.8 - 2.65 * 2.65, 1e-3);
        let (shift, rest) = best_shift(&s, &curve, 0.2, Take::MaxError);
        near(shift, 0.15, 1e-4);
        near(rest, 0.0, 1e-3);
        near(best_shift(&s, &curve, 0.1, Take::RmsError).0, 0.1, 1e-9);
        assert_eq!(distance(&s, &[[5.0, 0.0]], 0.0, Take::MeanError), f64::INFINITY);
    }
}
