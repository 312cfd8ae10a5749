//! Streamlines: curves that follow the velocity of a fluid at one instant. In: a moment of a world. Out: lines coloured by speed.
//!
//! 1. Velocities of particles are laid on a grid by trilinear weights, beside the sum of the weights ([`Field::of`]).
//! 2. Between the nodes both are interpolated; their ratio is the velocity, and where the weight is small there is no fluid.
//! 3. From some particles, the same ones every time, the direction of the velocity is followed forward and back by the
//!    Runge-Kutta method of fourth order, in steps of half a cell.

use crate::lines::every;
use crate::style::ColorBy;
use crate::{Frame, Line, Show, Style};
use glam::Vec3;
use jetsam::state::Kind;

/// Edge of a cell in spacings.
const CELL: f32 = 2.0;
/// Nodes of the grid, at most: where there would be more, cells are larger.
const NODES: f32 = 4e6;
/// Share of the weight inside of a fluid that a place has to have: on a flat surface there is one half, and this much a spacing
/// farther out.
const THIN: f32 = 0.3;
/// Length of a step in cells, and most steps forward and back.
const STEP: f32 = 0.5;
const STEPS: usize = 64;
/// Fluid slower than this share of the fastest speed shown rests.
const REST: f32 = 2e-3;

/// The lines of a moment whose particles are on the host.
pub fn streamlines(show: &Show, frame: &Frame, style: &Style) -> Vec<Line> {
    let Some(field) = Field::of(show, frame) else { return Vec::new() };
    let [low, high] = if style.color == ColorBy::Speed { style.scale(show) } else { [0.0, show.fast] };
    let color = |v: Vec3| {
        let t = (v.length() - low) / (high - low).max(1e-12);
        style.map.at(t.clamp(0.0, 1.0).powf(crate::paint::SLOW))
    };
    let fluid = frame.segment(Kind::Fluid);
    let every = every(fluid.len());
    let mut lines = Vec::new();
    for i in fluid.filter(|&i| frame.tag[i][0].is_multiple_of(every)) {
        let seed = Vec3::from(frame.record[i].x);
        let mut closed = false;
        for way in [1.0, -1.0] {
            let mut x = seed;
            for step in 0..if closed { 0 } else { STEPS } {
                let Some((to, v)) = field.follow(x, way, REST * show.fast) else { break };
                lines.push(Line { from: x, to, color: color(v) });
                x = field.inside(to);
                // once around
                closed = step > 4 && x.distance(seed) < 0.6 * STEP * field.cell.min_element();
                if closed {
                    lines.push(Line { from: x, to: seed, color: color(v) });
                    break;
                }
            }
        }
    }
    lines
}

/// The velocity of the fluids of a moment.
struct Field {
    /// The node of index 0 (m).
    low: Vec3,
    /// Edges of a cell (m).
    cell: Vec3,
    count: [usize; 3],
    /// Lengths of the domain along axes that are periodic (m), else infinite.
    period: Vec3,
    corner: Vec3,
    /// Sums of weight times velocity, and of weights as a share of those inside of a fluid.
    sums: Vec<(Vec3, f32)>,
}

impl Field {
    /// Lays the particles of fluids on a grid that covers them. Nothing where there are none.
    fn of(show: &Show, frame: &Frame) -> Option<Self> {
        let records = &frame.record[frame.segment(Kind::Fluid)];
        let places = records.iter().map(|r| Vec3::from(r.x)).filter(|x| x.is_finite());
        let (min, max) = places.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        if !min.is_finite() {
            return None;
        }
        let mut field = Self::covering(show, [min, max]);
        let flat = show.dimensions == 2;
        let volume = if flat { field.cell.x * field.cell.z } else { field.cell.element_product() };
        let share = show.spacing.powi(show.dimensions as i32) / volume;
        for r in records.iter().filter(|r| Vec3::from(r.x).is_finite()) {
            let v = Vec3::from(r.v);
            for (node, weight) in field.around(r.x.into()) {
                let (sum, weights) = &mut field.sums[node];
                *sum += share * weight * v;
                *weights += share * weight;
            }
        }
        Some(field)
    }

    /// An empty grid over the particles, whose nodes stay in their places when particles move.
    fn covering(show: &Show, [min, max]: [Vec3; 2]) -> Self {
        let [corner, end] = show.bounds;
        let extent = end - corner;
        let mut edge = CELL * show.spacing;
        loop {
            let (mut low, mut cell, mut period, mut count) = (corner, Vec3::splat(edge), Vec3::INFINITY, [1; 3]);
            for a in (0..3).filter(|&a| extent[a] > 0.0) {
                if show.periodic[a] {
                    count[a] = (extent[a] / edge).round().max(1.0) as usize;
                    (cell[a], period[a]) = (extent[a] / count[a] as f32, extent[a]);
                } else {
                    low[a] += edge * ((min[a] - corner[a]) / edge).floor();
                    count[a] = ((max[a] - low[a]) / edge) as usize + 2;
                }
            }
            let nodes = count.iter().map(|&n| n as f32).product::<f32>();
            if nodes <= NODES {
                let sums = vec![(Vec3::ZERO, 0.0); count.iter().product()];
                return Self { low, cell, count, period, corner, sums };
            }
            edge *= 1.3;
        }
    }

    /// The nodes around a place, and their weights; those outside of the grid are left out.
    fn around(&self, x: Vec3) -> impl Iterator<Item = (usize, f32)> + use<> {
        let at = (x - self.low) / self.cell;
        let (count, period) = (self.count, self.period);
        (0..8).filter_map(move |k| {
            let (mut node, mut weight) = (0, 1.0);
            for a in (0..3).rev() {
                let upper = k >> a & 1;
                let part = at[a] - at[a].floor();
                let mut index = at[a].floor() as i64 + upper;
                let n = count[a] as i64;
                if n == 1 {
                    // all there is along this axis
                    index = 0;
                } else if period[a].is_finite() {
                    index = index.rem_euclid(n);
                }
                if !(0..n).contains(&index) {
                    return None;
                }
                weight *= if upper == 1 { part } else { 1.0 - part };
                node = node * count[a] + index as usize;
            }
            Some((node, weight))
        })
    }

    /// The velocity at a place in the fluid (m/s).
    fn velocity(&self, x: Vec3) -> Option<Vec3> {
        let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
        for (node, weight) in self.around(x) {
            let (v, w) = self.sums[node];
            sum += weight * v;
            weights += weight * w;
        }
        (weights >= THIN).then(|| sum / weights)
    }

    /// A step from a place along the velocity or, with `way` -1, against it: where it leads, and the velocity where it began.
    /// None at the end of the fluid, or where it is slower than `rest` (m/s).
    fn follow(&self, x: Vec3, way: f32, rest: f32) -> Option<(Vec3, Vec3)> {
        let h = way * STEP * self.cell.min_element();
        let direction = |x: Vec3| self.velocity(x).filter(|v| v.length() > rest).map(Vec3::normalize);
        let v = self.velocity(x)?;
        let a = direction(x)?;
        let b = direction(x + 0.5 * h * a)?;
        let c = direction(x + 0.5 * h * b)?;
        let d = direction(x + h * c)?;
        let to = x + h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
        self.velocity(to).map(|_| (to, v))
    }

    /// The place in the domain that is the same by its periodic sides.
    fn inside(&self, x: Vec3) -> Vec3 {
        let mut x = x;
        for a in (0..3).filter(|&a| self.period[a].is_finite()) {
            x[a] = self.corner[a] + (x[a] - self.corner[a]).rem_euclid(self.period[a]);
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use jetsam::state::Record;
    use jetsam::{Scene, World};

    const DX: f32 = 0.05;

    /// A box of 2 m, or a square in the plane y = 0, with nothing in it but what a test puts there.
    fn show(dimensions: u32, periodic: [bool; 3]) -> Show {
        let scene = Scene::open("dam-break", &["resolution.spacing=0.1".into()]).unwrap();
        let show = Show::new(&scene, &World::from_scene(&scene).unwrap(), 1.0);
        let half = if dimensions == 2 { Vec3::new(1.0, 0.0, 1.0) } else { Vec3::ONE };
        Show { bounds: [-half, half], periodic, dimensions, spacing: DX, fast: 1.0, ..show }
    }

    /// Fluid on the lattice of the domain where a rule says so, with velocities by a formula.
    fn fluid(show: &Show, inside: impl Fn(Vec3) -> bool, velocity: impl Fn(Vec3) -> Vec3) -> Frame {
        let n = (2.0 / DX).round() as usize;
        let axis = |k: usize| (k as f32 + 0.5) * DX - 1.0;
        let layers = if show.dimensions == 2 { 1 } else { n };
        let place = |k: usize| {
            let y = if layers == 1 { 0.0 } else { axis(k / n / n) };
            Vec3::new(axis(k % n), y, axis(k / n % n))
        };
        let places: Vec<Vec3> = (0..n * n * layers).map(place).filter(|x| inside(*x)).collect();
        let record = |x: &Vec3| Record { x: x.to_array(), v: velocity(*x).to_array(), ..Record::default() };
        let count = places.len() as u32;
        Frame {
            record: places.iter().map(record).collect(),
            tag: (0..count).map(|id| [id, 0]).collect(),
            count: [count, 0, 0],
            ..Frame::default()
        }
    }

    #[test]
    fn of_a_uniform_flow_they_are_straight() {
        let v = Vec3::new(0.5, 0.2, -0.1);
        let show = show(3, [false; 3]);
        let block = |x: Vec3| x.abs().max_element() < 0.6;
        let lines = streamlines(&show, &fluid(&show, block, |_| v), &Style::default());
        assert!(lines.len() > 1000);
        for line in &lines {
            assert!((line.to - line.from).normalize().dot(v.normalize()).abs() > 1.0 - 1e-6);
            // a spacing beyond the last particles' skins, and no farther
            assert!(line.to.abs().max_element() < 0.6 + 1.5 * DX, "{line:?}");
        }
        // they go all the way through: from the middle both ends of the block are reached
        let reach = lines.iter().map(|l| l.to.x.abs().max(l.from.x.abs())).fold(0.0, f32::max);
        assert!(reach > 0.6 - DX, "{reach}");
        let color = Vec3::from(Style::default().map.at(v.length().powf(crate::paint::SLOW)));
        assert!(lines.iter().all(|l| Vec3::from(l.color).distance(color) < 1e-3));
    }

    #[test]
    fn of_a_rotation_they_are_closed_circles() {
        for dimensions in [2, 3] {
            let show = show(dimensions, [false; 3]);
            let disc = |x: Vec3| x.x.hypot(x.z) < 0.8;
            let mut frame = fluid(&show, disc, |x| Vec3::new(x.z, 0.0, -x.x));
            // one line alone
            let seed = (0..frame.tag.len()).find(|&i| {
                let x = Vec3::from(frame.record[i].x);
                (x.x.hypot(x.z) - 0.45).abs() < 0.5 * DX && x.y.abs() < DX
            });
            let seed = seed.unwrap();
            frame.tag.iter_mut().enumerate().for_each(|(i, tag)| tag[0] = u32::from(i != seed));
            let lines = streamlines(&show, &frame, &Style::default());
            let x = Vec3::from(frame.record[seed].x);
            let radius = x.x.hypot(x.z);
            for line in &lines {
                let r = line.to.x.hypot(line.to.z);
                assert!((r - radius).abs() < 2e-3 * radius, "{dimensions}D: {r} on a circle of {radius}");
                assert!((line.to.y - x.y).abs() < 1e-5);
            }
            let length: f32 = lines.iter().map(|l| l.from.distance(l.to)).sum();
            let circle = std::f32::consts::TAU * radius;
            assert!((length - circle).abs() < 0.02 * circle, "{dimensions}D: {length} m around, {circle} expected");
            assert_eq!(lines.last().unwrap().to, x, "it ends where it began");
        }
    }

    #[test]
    fn periodic_sides_are_passed() {
        let show = show(2, [true, false, false]);
        let mut frame = fluid(&show, |x| x.z.abs() < 0.9, |_| Vec3::X);
        frame.tag.iter_mut().enumerate().for_each(|(i, tag)| tag[0] = u32::from(i != 25));
        let lines = streamlines(&show, &frame, &Style::default());
        // around the domain, 2 m, back to the seed
        let length: f32 = lines.iter().map(|l| l.from.distance(l.to)).sum();
        assert!((length - 2.0).abs() < 1e-3, "{length}");
        assert!(lines.iter().all(|l| l.from.distance(l.to) < 2.0 * DX && l.from.x.abs() <= 1.0));
    }

    #[test]
    fn there_are_none_without_fluid_or_motion() {
        let show = show(3, [false; 3]);
        assert!(streamlines(&show, &Frame::default(), &Style::default()).is_empty());
        let still = fluid(&show, |x| x.z < 0.0, |_| Vec3::ZERO);
        assert!(streamlines(&show, &still, &Style::default()).is_empty());
        // of single drops none: they are not fluid enough
        let spray =
            fluid(&show, |x| ((x / DX - 0.5).round().as_ivec3() % 4).cmpeq(glam::IVec3::ZERO).all(), |_| Vec3::X);
        assert!(streamlines(&show, &spray, &Style::default()).is_empty());
    }
}
