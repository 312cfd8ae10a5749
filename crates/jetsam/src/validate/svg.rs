//! A small writer of plots as SVG: panels with axes, lines, points and a legend.

use super::short;
use std::fmt::Write;

/// Size of one panel (px) and of its margins.
const WIDTH: f64 = 520.0;
const HEIGHT: f64 = 320.0;
const MARGIN: [f64; 4] = [68.0, 34.0, 16.0, 44.0]; // left, top, right, bottom
/// Panels side by side.
const ACROSS: usize = 2;
/// Colours that the colour-blind tell apart (Okabe and Ito 2008).
const COLORS: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#555555"];
/// A line is thinned to this many points.
const MOST: usize = 2000;

/// How a set of points is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Mark {
    /// What was simulated.
    Line,
    /// Simulated values that have no order.
    Dots,
    /// What was expected.
    Rings,
    /// What was expected, as a line.
    Dashes,
}

/// Points with a name.
#[derive(Clone, Debug)]
pub(super) struct Set {
    pub(super) name: String,
    pub(super) mark: Mark,
    /// Index of the colour; sets of one colour belong together.
    pub(super) color: usize,
    pub(super) points: Vec<[f64; 2]>,
}

/// One plot.
#[derive(Clone, Debug)]
pub(super) struct Panel {
    pub(super) title: String,
    pub(super) x: String,
    pub(super) sets: Vec<Set>,
}

/// Panels as one SVG document.
pub(super) fn document(panels: &[Panel]) -> String {
    let across = panels.len().clamp(1, ACROSS);
    let rows = panels.len().div_ceil(across).max(1);
    let (w, h) = (WIDTH * across as f64, HEIGHT * rows as f64);
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" height=\"{h}\" \
         font-family=\"sans-serif\" font-size=\"11\" fill=\"#222\">\n<rect width=\"{w}\" height=\"{h}\" fill=\"#fff\"/>\n"
    );
    for (k, panel) in panels.iter().enumerate() {
        let (x, y) = (WIDTH * (k % across) as f64, HEIGHT * (k / across) as f64);
        writeln!(text, "<g transform=\"translate({x} {y})\">{}</g>", draw(panel)).expect("writing to memory");
    }
    text + "</svg>\n"
}

/// An axis: from a range of values to a range of pixels.
struct Axis {
    min: f64,
    max: f64,
    from: f64,
    to: f64,
}

impl Axis {
    fn of(values: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let finite = values.filter(|v| v.is_finite());
        let (mut min, mut max) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        if min > max {
            (min, max) = (0.0, 1.0);
        }
        let size = (max - min).max(1e-6 * max.abs().max(min.abs()));
        let size = if size == 0.0 { 1.0 } else { size }; // nothing but zeros
        Self { min: min - 0.04 * size, max: max + 0.04 * size, from, to }
    }

    fn at(&self, v: f64) -> f64 {
        self.from + (v - self.min) / (self.max - self.min) * (self.to - self.from)
    }

    /// Round values on the axis.
    fn ticks(&self) -> Vec<f64> {
        let raw = (self.max - self.min) / 5.0;
        let power = 10f64.powf(raw.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|s| *s >= raw).unwrap_or(10.0 * power);
        let (first, last) = ((self.min / step).ceil() as i64, (self.max / step).floor() as i64);
        (first..=last.min(first + 20)).map(|k| k as f64 * step).collect()
    }
}

fn draw(panel: &Panel) -> String {
    let [left, top, right, bottom] = MARGIN;
    let points = || panel.sets.iter().flat_map(|s| &s.points);
    let x = Axis::of(points().map(|p| p[0]), left, WIDTH - right);
    let y = Axis::of(points().map(|p| p[1]), HEIGHT - bottom, top);
    let mut text = String::new();
    let mut add = |s: String| text.push_str(&s);
    for t in x.ticks() {
        let px = x.at(t);
        add(format!("<path d=\"M{px:.1} {:.1}V{:.1}\" stroke=\"#ddd\"/>", y.from, y.to));
        add(format!("<text x=\"{px:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>", y.from + 15.0, short(t)));
    }
    for t in y.ticks() {
        let py = y.at(t);
        add(format!("<path d=\"M{:.1} {py:.1}H{:.1}\" stroke=\"#ddd\"/>", x.from, x.to));
        add(format!("<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>", x.from - 5.0, py + 4.0, short(t)));
    }
    let title = escape(&panel.title);
    add(format!("<text x=\"{:.1}\" y=\"18\" text-anchor=\"middle\" font-size=\"13\">{title}</text>", 0.5 * WIDTH));
    let label = escape(&panel.x);
    add(format!("<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{label}</text>", 0.5 * WIDTH, HEIGHT - 10.0));
    for set in &panel.sets {
        add(draw_set(set, &x, &y));
    }
    for (k, set) in panel.sets.iter().filter(|s| !s.name.is_empty()).take(10).enumerate() {
        let (px, py) = (x.to - 8.0, y.to + 12.0 + 13.0 * k as f64);
        let color = COLORS[set.color % COLORS.len()];
        let sign = match set.mark {
            Mark::Line => "—",
            Mark::Dots => "●",
            Mark::Rings => "○",
            Mark::Dashes => "- -",
        };
        let name = escape(&set.name);
        add(format!("<text x=\"{px:.1}\" y=\"{py:.1}\" text-anchor=\"end\" fill=\"{color}\">{name} {sign}</text>"));
    }
    text
}

fn draw_set(set: &Set, x: &Axis, y: &Axis) -> String {
    let color = COLORS[set.color % COLORS.len()];
    let every = set.points.len().div_ceil(MOST).max(1);
    let last = set.points.len().saturating_sub(1);
    let kept = set
        .points
        .iter()
        .enumerate()
        .filter(|(k, p)| (k % every == 0 || *k == last) && p.iter().all(|v| v.is_finite()));
    let places = kept.map(|(_, p)| (x.at(p[0]), y.at(p[1])));
    match set.mark {
        Mark::Line | Mark::Dashes => {
            let path: Vec<String> = places.map(|(a, b)| format!("{a:.1} {b:.1}")).collect();
            if path.is_empty() {
                return String::new();
            }
            let dashes = if set.mark == Mark::Dashes { " stroke-dasharray=\"6 4\"" } else { "" };
            format!("<path d=\"M{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"1.5\"{dashes}/>", path.join("L"))
        }
        Mark::Dots => {
            places.map(|(a, b)| format!("<circle cx=\"{a:.1}\" cy=\"{b:.1}\" r=\"2.5\" fill=\"{color}\"/>")).collect()
        }
        Mark::Rings => places
            .map(|(a, b)| format!("<circle cx=\"{a:.1}\" cy=\"{b:.1}\" r=\"4.5\" fill=\"none\" stroke=\"{color}\"/>"))
            .collect(),
    }
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
