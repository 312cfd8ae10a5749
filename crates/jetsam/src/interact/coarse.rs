//! The coarse level of implicit pressure (E9): the smooth part of the shares, at which rounds are slow, found at once.
//!
//! In: what a round has left, and how particles and bodies answer to shares that are the same everywhere. Out: shares on the nodes of a
//! lattice twice as wide as the cells; between nodes they are interpolated linearly on each axis. The operator is that of the rounds for such
//! shares (Galerkin's), but that the sum over neighbours of what a share is above the particle's own is its gradient. Called by the rounds of
//! `backend/cpu/coarse.rs`.

use super::cells::{Cells, Grid};
use super::lanes::LANES;
use super::links::Nodes;
use crate::laws::implicit::{by_slope, by_value, part_way};
use crate::state::Record;
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x8};
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use std::ops::Range;

/// Cells along the side of an element.
pub const SIDE: i32 = 2;
/// Corners of an element; bit `a` of a corner's number says at which end of axis `a` it is.
const CORNERS: usize = 8;
type Corners = [f32; CORNERS];
/// At least so many elements are summed as one job, and at most twice as many.
const JOB: usize = 8;
/// Errors so much smaller than their mean may be those of rounding: in water that begins to fall these would say who takes part.
pub const NOISE: f32 = 0.01;
/// Most rounds of conjugate gradients.
pub const ROUNDS: u32 = 40;
/// The part of the residual's square they end at.
pub const ENOUGH: f64 = 1e-3;
/// Part of the diagonal by which nodes answer more than they do, and of the largest: what a few particles answer is not trusted.
pub const STIFFNESS: f32 = 1e-3;

/// Shares on nodes, and what they answer to.
#[derive(Default)]
pub struct Coarse {
    axis: [Axis; 3],
    element: Vec<Element>,
    body: Vec<Mover>,
    /// Of each body in turn: a node, and force and torque on the body by a share of 1 there.
    reach: Vec<(u32, [f32; 6])>,
    /// Place of each node among those of a body, while they are collected.
    found: Vec<u32>,
    share: Vec<f32>,
    left: Vec<f32>,
    diagonal: Vec<f32>,
    way: Vec<f32>,
    answer: Vec<f32>,
}

/// How an axis is cut into elements.
#[derive(Clone, Copy, Default)]
struct Axis {
    /// First cell.
    first: i32,
    /// Number of cells.
    cells: i32,
    elements: i32,
    /// Number of nodes: of elements where both ends are one, else one more.
    nodes: i32,
    /// Where the first cell of the domain begins (m), and cells a metre; 0 without cells.
    origin: f32,
    inverse: f32,
}

/// What the particles between eight nodes sum.
#[derive(Clone, Copy, Default)]
struct Element {
    matrix: [Corners; CORNERS],
    corner: [u32; CORNERS],
}

/// A body that answers.
struct Mover {
    reach: Range<usize>,
    inverse_mass: f32,
    inverse_inertia: [[f32; 3]; 3],
}

/// What is read of fluids.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    /// The domain.
    pub grid: &'a Grid,
    /// Where the fluid particles of each cell stand.
    pub cells: &'a Cells,
    /// All particles.
    pub records: &'a [Record],
    /// Their sums over neighbours.
    pub nodes: &'a [Nodes],
    /// 1 for each particle whose share takes part, else 0.
    pub active: &'a [f32],
    /// Accelerations (m/s^2) by these as shares (Pa).
    pub push: &'a [[f32; 4]],
    /// From rates of acceleration to what the error counts, see [`super::implicit::Round`].
    pub scale: f32,
    /// How far fluids yield, alike.
    pub compliance: f32,
}

/// A body that answers, and what its particles feel (N) where shares are 1 Pa everywhere.
pub struct Felt<'a> {
    /// Inverse of its mass (1/kg).
    pub inverse_mass: f64,
    /// Inverse of its inertia tensor in world axes (1/(kg m^2)).
    pub inverse_inertia: DMat3,
    /// What a force and an acceleration count together: `scale` by the volume of a fluid particle.
    pub factor: f64,
    /// For each particle: a place (m) in the fluid that pushes it, its arm (m), the force (N).
    pub particles: &'a mut dyn Iterator<Item = ([f32; 3], DVec3, DVec3)>,
}

impl Coarse {
    /// Lays elements where fluid is, and sums what their particles answer.
    pub fn assemble(&mut self, level: Level, input: Input) {
        let Input { grid, cells, .. } = input;
        let window = cells.window();
        for a in 0..3 {
            let (first, count) = (window.min[a], window.cells[a]);
            let elements = (count + SIDE - 1) / SIDE;
            let ring = grid.cells[a] == 1 || grid.period[a] > 0.0 && count == grid.cells[a];
            let nodes = if ring { elements } else { elements + 1 };
            let (origin, inverse) = (grid.origin[a], grid.inverse[a]);
            self.axis[a] = Axis { first, cells: count, elements, nodes, origin, inverse };
        }
        let count = |of: fn(&Axis) -> i32| self.axis.iter().map(|axis| of(axis) as usize).product();
        let (elements, nodes) = (count(|a| a.elements), count(|a| a.nodes));
        self.element.resize(elements, Element::default());
        let axis = self.axis;
        self.element.par_iter_mut().with_min_len(JOB).with_max_len(2 * JOB).enumerate().for_each(|(k, element)| {
            let at = place(&axis, k);
            *element = Element { corner: corners(&axis, at), ..Element::default() };
            dispatch!(level, simd => element.sum(simd, &axis, at, &input));
        });
        for of in [&mut self.share, &mut self.left, &mut self.diagonal, &mut self.way, &mut self.answer] {
            of.clear();
            of.resize(nodes, 0.0);
        }
        for element in &self.element {
            for c in 0..CORNERS {
                self.diagonal[element.corner[c] as usize] += element.matrix[c][c];
            }
        }
        self.body.clear();
        self.reach.clear();
        self.found.clear();
        self.found.resize(nodes, u32::MAX);
    }

    /// Adds a body.
    pub fn answer(&mut self, felt: Felt) {
        let begin = self.reach.len();
        for (x, arm, force) in felt.particles {
            let (k, weight) = self.weights(x);
            let torque = arm.cross(force);
            let both = [force.x, force.y, force.z, torque.x, torque.y, torque.z];
            for (node, w) in self.element[k].corner.into_iter().zip(weight) {
                let found = &mut self.found[node as usize];
                if *found == u32::MAX {
                    *found = self.reach.len() as u32;
                    self.reach.push((node, [0.0; 6]));
                }
                let sum = &mut self.reach[*found as usize].1;
                both.iter().zip(sum).for_each(|(f, sum)| *sum += *f as f32 * w);
            }
        }
        let reach = begin..self.reach.len();
        let inertia = (felt.factor * felt.inverse_inertia).as_mat3();
        let inverse_inertia = inertia.transpose().to_cols_array_2d();
        let mover =
            Mover { reach: reach.clone(), inverse_mass: (felt.factor * felt.inverse_mass) as f32, inverse_inertia };
        for (node, force) in &self.reach[reach] {
            self.found[*node as usize] = u32::MAX;
            self.diagonal[*node as usize] += dot(&mover.accelerate(force), force);
        }
        self.body.push(mover);
    }

    /// The element that a place is in, and the weights of its corners there.
    fn weights(&self, x: [f32; 3]) -> (usize, Corners) {
        let mut at = [0; 3];
        for a in 0..3 {
            at[a] = self.axis[a].element(x[a]);
        }
        let [ends_x, ends_y, ends_z] = ends(&self.axis, at);
        let t = [ends_x, ends_y, ends_z];
        let mut weight = [1.0; CORNERS];
        for (c, weight) in weight.iter_mut().enumerate() {
            for a in 0..3 {
                let part = part_way(x[a], t[a][0], t[a][1]);
                *weight *= if c >> a & 1 == 1 { part } else { 1.0 - part };
            }
        }
        (self.index(at), weight)
    }

    #[inline(always)]
    fn index(&self, at: [i32; 3]) -> usize {
        ((at[2] * self.axis[1].elements + at[1]) * self.axis[0].elements + at[0]) as usize
    }

    /// Finds the shares on nodes that leave nothing of `left`, what a round has left of each particle.
    pub fn solve(&mut self, level: Level, cells: &Cells, records: &[Record], left: &[f32]) {
        let axis = self.axis;
        let sums: Vec<Corners> = (0..self.element.len())
            .into_par_iter()
            .with_min_len(JOB)
            .with_max_len(2 * JOB)
            .map(|k| dispatch!(level, simd => restrict(simd, &axis, place(&axis, k), cells, records, left)))
            .collect();
        self.left.fill(0.0);
        for (element, sum) in self.element.iter().zip(&sums) {
            for c in 0..CORNERS {
                self.left[element.corner[c] as usize] += sum[c];
            }
        }
        dispatch!(level, simd => self.iterate(simd));
    }

    /// Conjugate gradients with the diagonal as preconditioner.
    #[inline(always)]
    fn iterate<S: Simd>(&mut self, simd: S) {
        let n = self.share.len();
        let largest = self.diagonal.iter().fold(0.0, |most: f32, d| most.max(*d));
        let least = STIFFNESS * largest;
        self.share.fill(0.0);
        self.way.fill(0.0);
        let (mut before, mut begin) = (0.0, 0.0);
        for round in 0..ROUNDS {
            let mut now = 0.0;
            for i in 0..n {
                now += f64::from(self.left[i] * self.left[i] / (self.diagonal[i] + least));
            }
            if round == 0 {
                begin = now;
            }
            if now <= ENOUGH * begin || !now.is_finite() {
                break;
            }
            let kept = if round == 0 { 0.0 } else { (now / before) as f32 };
            for i in 0..n {
                self.way[i] = self.left[i] / (self.diagonal[i] + least) + kept * self.way[i];
            }
            self.apply(simd, least);
            let mut curvature = 0.0;
            for i in 0..n {
                curvature += f64::from(self.way[i] * self.answer[i]);
            }
            if curvature <= 0.0 {
                break;
            }
            let by = (now / curvature) as f32;
            for i in 0..n {
                self.share[i] += by * self.way[i];
                self.left[i] -= by * self.answer[i];
            }
            before = now;
        }
    }

    /// What nodes answer to shares `way`.
    #[inline(always)]
    fn apply<S: Simd>(&mut self, simd: S, least: f32) {
        for i in 0..self.way.len() {
            self.answer[i] = (least + STIFFNESS * self.diagonal[i]) * self.way[i];
        }
        for element in &self.element {
            let mut sum = f32x8::splat(simd, 0.0);
            for c in 0..CORNERS {
                let way = self.way[element.corner[c] as usize];
                sum += f32x8::load_array_ref(simd, &element.matrix[c]) * way;
            }
            let sum = sum.to_array();
            for c in 0..CORNERS {
                self.answer[element.corner[c] as usize] += sum[c];
            }
        }
        for body in &self.body {
            let mut felt = [0.0; 6];
            for (node, force) in &self.reach[body.reach.clone()] {
                let way = self.way[*node as usize];
                for k in 0..6 {
                    felt[k] += force[k] * way;
                }
            }
            let moved = body.accelerate(&felt);
            for (node, force) in &self.reach[body.reach.clone()] {
                self.answer[*node as usize] += dot(&moved, force);
            }
        }
    }

    /// Shares at the places of a chunk of fluid particles.
    #[inline(always)]
    pub fn interpolate<S: Simd>(&self, simd: S, records: &[Record], out: &mut [f32]) {
        let corners = Ends::new(simd);
        let (mut last, mut to) = ([-1; 3], [[0.0; 2]; 3]);
        let mut share = f32x8::splat(simd, 0.0);
        for (record, out) in records.iter().zip(out) {
            let mut at = [0; 3];
            for a in 0..3 {
                at[a] = self.axis[a].element(record.x[a]);
            }
            if at != last {
                let element = &self.element[self.index(at)];
                let mut of = [0.0; CORNERS];
                for c in 0..CORNERS {
                    of[c] = self.share[element.corner[c] as usize];
                }
                (last, to, share) = (at, ends(&self.axis, at), f32x8::load_array_ref(simd, &of));
            }
            let parts = corners.parts(&to, record.x);
            let all = (parts[0] * parts[1] * parts[2] * share).to_array();
            *out = ((all[0] + all[1]) + (all[2] + all[3])) + ((all[4] + all[5]) + (all[6] + all[7]));
        }
    }
}

impl Axis {
    /// The element that holds `x`, or is next to it.
    #[inline(always)]
    fn element(&self, x: f32) -> i32 {
        let cell = (((x - self.origin) * self.inverse) as i32).saturating_sub(self.first);
        (cell.max(0) / SIDE).min(self.elements - 1)
    }

    /// Cells of element `e`.
    #[inline(always)]
    fn cells(&self, e: i32) -> Range<i32> {
        self.first + e * SIDE..self.first + (e * SIDE + SIDE).min(self.cells)
    }
}

/// Where an element begins on each axis (m), and how often it goes into a metre.
#[inline(always)]
fn ends(axis: &[Axis; 3], at: [i32; 3]) -> [[f32; 2]; 3] {
    let mut ends = [[0.0; 2]; 3];
    for a in 0..3 {
        let of = &axis[a];
        if of.inverse > 0.0 {
            let cells = of.cells(at[a]);
            // the last may be narrow where its end is the beginning of the first
            let wide = if of.nodes == of.elements { cells.len() as i32 } else { SIDE };
            ends[a] = [of.origin + cells.start as f32 / of.inverse, of.inverse / wide as f32];
        }
    }
    ends
}

/// Where element `k` stands.
#[inline(always)]
fn place(axis: &[Axis; 3], k: usize) -> [i32; 3] {
    let (k, [x, y, _]) = (k as i32, axis);
    [k % x.elements, k / x.elements % y.elements, k / x.elements / y.elements]
}

/// The nodes at the corners of an element.
fn corners(axis: &[Axis; 3], at: [i32; 3]) -> [u32; CORNERS] {
    let node = |c: usize, a: usize| (at[a] + (c >> a & 1) as i32) % axis[a].nodes;
    std::array::from_fn(|c| ((node(c, 2) * axis[1].nodes + node(c, 1)) * axis[0].nodes + node(c, 0)) as u32)
}

/// At which end of each axis corners are: 1 at the upper one, and the sign that goes with it.
struct Ends<S: Simd> {
    lower: [f32x8<S>; 3],
    sign: [f32x8<S>; 3],
}

impl<S: Simd> Ends<S> {
    #[inline(always)]
    fn new(simd: S) -> Self {
        let (mut lower, mut sign) = ([f32x8::splat(simd, 0.0); 3], [f32x8::splat(simd, 0.0); 3]);
        for a in 0..3 {
            let (mut low, mut up) = ([0.0; CORNERS], [0.0; CORNERS]);
            for c in 0..CORNERS {
                let upper = (c >> a & 1) as f32;
                (low[c], up[c]) = (1.0 - upper, 2.0 * upper - 1.0);
            }
            (lower[a], sign[a]) = (f32x8::load_array(simd, low), f32x8::load_array(simd, up));
        }
        Self { lower, sign }
    }

    /// The part that corners have on each axis.
    #[inline(always)]
    fn parts(&self, to: &[[f32; 2]; 3], x: [f32; 3]) -> [f32x8<S>; 3] {
        let mut parts = self.lower;
        for a in 0..3 {
            parts[a] += self.sign[a] * part_way(x[a], to[a][0], to[a][1]);
        }
        parts
    }
}

impl Element {
    /// Adds what the particles in the element answer.
    #[inline(always)]
    fn sum<S: Simd>(&mut self, simd: S, axis: &[Axis; 3], at: [i32; 3], input: &Input) {
        let (corners, to) = (Ends::new(simd), ends(axis, at));
        let mut matrix = [f32x8::splat(simd, 0.0); CORNERS];
        for z in axis[2].cells(at[2]) {
            for y in axis[1].cells(at[1]) {
                let x = axis[0].cells(at[0]);
                for i in input.cells.start([x.start, y, z])..input.cells.end([x.end - 1, y, z]) {
                    let (node, l) = (&input.nodes[i / LANES], i % LANES);
                    let (active, push) = (input.active[i], input.push[i]);
                    let [x, y, z] = corners.parts(&to, input.records[i].x);
                    let n = x * y * z;
                    let slope = [corners.sign[0] * y * z, corners.sign[1] * x * z, corners.sign[2] * x * y];
                    let inverse_rho = node.inverse_rho[l];
                    let by_slope = by_slope(active * node.spread[l], inverse_rho, input.scale);
                    let mut of = [n; 3];
                    for a in 0..3 {
                        let by_value = by_value(push[a], inverse_rho, input.scale);
                        of[a] = n * by_value + slope[a] * (by_slope * to[a][1]);
                    }
                    let soft = n * (active * input.compliance * inverse_rho);
                    let rows = [of[0].to_array(), of[1].to_array(), of[2].to_array(), n.to_array()];
                    for c in 0..CORNERS {
                        matrix[c] += of[0] * rows[0][c] + of[1] * rows[1][c] + of[2] * rows[2][c] + soft * rows[3][c];
                    }
                }
            }
        }
        for c in 0..CORNERS {
            self.matrix[c] = matrix[c].to_array();
        }
    }
}

/// What is left of the particles in an element, by corners.
#[inline(always)]
fn restrict<S: Simd>(
    simd: S,
    axis: &[Axis; 3],
    at: [i32; 3],
    cells: &Cells,
    records: &[Record],
    left: &[f32],
) -> Corners {
    let (corners, to) = (Ends::new(simd), ends(axis, at));
    let mut sum = f32x8::splat(simd, 0.0);
    for z in axis[2].cells(at[2]) {
        for y in axis[1].cells(at[1]) {
            let x = axis[0].cells(at[0]);
            for i in cells.start([x.start, y, z])..cells.end([x.end - 1, y, z]) {
                let [x, y, z] = corners.parts(&to, records[i].x);
                sum += x * y * z * left[i];
            }
        }
    }
    sum.to_array()
}

impl Mover {
    /// What force and torque make of the body, times what both count in rates.
    #[inline(always)]
    fn accelerate(&self, by: &[f32; 6]) -> [f32; 6] {
        let mut out = [0.0; 6];
        for a in 0..3 {
            out[a] = self.inverse_mass * by[a];
            let row = &self.inverse_inertia[a];
            out[3 + a] = row[0] * by[3] + row[1] * by[4] + row[2] * by[5];
        }
        out
    }
}

#[inline(always)]
fn dot(a: &[f32; 6], b: &[f32; 6]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Wall;

    /// In a periodic box full of fluid what answers to a wave is `scale / rho k^2` times it.
    #[test]
    fn a_wave_is_found() {
        let (n, dx, scale, inverse_rho) = (32, 0.1, 1e-4, 1e-3);
        let length = f64::from(n) * dx;
        let grid = Grid::new(DVec3::ZERO, DVec3::splat(length), [Wall::Periodic; 3], 3, 2.0 * dx, 0.0);
        let at = |i: i32| ((f64::from(i) + 0.5) * dx) as f32;
        let all = (0..n * n * n).map(|k| [at(k % n), at(k / n % n), at(k / n / n)]);
        let mut records: Vec<Record> = all.map(|x| Record { x, ..Record::default() }).collect();
        let mut cells = Cells::default();
        assert_eq!(cells.sort(&grid, &records, None), records.len());
        let order = cells.order.iter().map(|o| o.load(std::sync::atomic::Ordering::Relaxed) as usize);
        records = order.map(|o| records[o]).collect();
        let node = Nodes { spread: [1.0; LANES], inverse_rho: [inverse_rho; LANES], ..Nodes::default() };
        let nodes = vec![node; records.len() / LANES];
        let (active, push) = (vec![1.0; records.len()], vec![[0.0; 4]; records.len()]);
        let (cells, records, nodes) = (&cells, &records[..], &nodes[..]);
        let input = Input { grid: &grid, cells, records, nodes, active: &active, push: &push, scale, compliance: 0.0 };
        let (level, mut coarse) = (Level::new(), Coarse::default());
        coarse.assemble(level, input);
        for axis in 0..3 {
            let k = std::f64::consts::TAU / length;
            let wave: Vec<f32> = records.iter().map(|r| (k * f64::from(r.x[axis])).sin() as f32).collect();
            coarse.solve(level, cells, records, &wave);
            let mut found = vec![0.0; records.len()];
            dispatch!(level, simd => coarse.interpolate(simd, records, &mut found));
            let answer = scale * inverse_rho * (k * k) as f32;
            for (found, wave) in found.iter().zip(&wave) {
                assert!((found * answer - wave).abs() < 0.1, "axis {axis}: {} for {wave}", found * answer);
            }
        }
    }

    /// A body that hangs between nodes and weighs nothing but what it has: shares of 1 all around push it with the sum of what its particles
    /// feel, and what it answers is that by its mass.
    #[test]
    fn a_body_answers_by_its_mass_and_inertia() {
        let felt = [([0.3; 3], DVec3::X, DVec3::new(0.0, 0.0, 2.0)), ([0.9; 3], -DVec3::X, DVec3::new(0.0, 0.0, 3.0))];
        let axis = Axis { first: 0, cells: 4, elements: 2, nodes: 3, origin: 0.0, inverse: 2.0 };
        let mut coarse = Coarse { axis: [axis; 3], ..Coarse::default() };
        let element = |k| Element { corner: corners(&coarse.axis, place(&coarse.axis, k)), ..Element::default() };
        coarse.element = (0..8).map(element).collect();
        (coarse.diagonal, coarse.found) = (vec![0.0; 27], vec![u32::MAX; 27]);
        (coarse.way, coarse.answer) = (vec![1.0; 27], vec![0.0; 27]);
        let (inverse_mass, inverse_inertia) = (0.5, DMat3::from_diagonal(DVec3::new(1.0, 0.25, 1.0)));
        coarse.answer(Felt { inverse_mass, inverse_inertia, factor: 10.0, particles: &mut felt.into_iter() });
        dispatch!(Level::new(), simd => coarse.apply(simd, 0.0));
        // F = 5 N, torque y = -2 + 3 = 1 N m: F^2 / M + T^2 / I
        let energy: f32 = coarse.answer.iter().sum::<f32>() - STIFFNESS * coarse.diagonal.iter().sum::<f32>();
        assert!((energy - 10.0 * (0.5 * 25.0 + 0.25 * 1.0)).abs() < 1e-3, "{energy}");
    }
}
