//! Order parameters of a flock: polarization, milling, fragments.

use super::model::FlockConstants;
use super::nearest::{Among, nearest};
use super::perception::grid_about;
use crate::interact::cells::{Cells, Grid};
use crate::model::Model;
use crate::state::{Agents, Record};
use glam::DVec3;
use std::f64::consts::TAU;
use std::sync::atomic::Ordering::Relaxed;

/// How ordered a flock is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Order {
    /// Agents.
    pub n: usize,
    /// `|sum of unit velocities| / n`: 1 when all fly one way.
    pub polarization: f64,
    /// `|sum of r x v, both unit vectors, r from the centre| / n`: 1 when all circle the centre.
    pub milling: f64,
    /// Parts between which nobody perceives anybody.
    pub fragments: usize,
    /// Part of the flock that its largest fragment has.
    pub largest: f64,
}

impl Order {
    /// Of the flock number `index`.
    pub fn of(model: &Model, agents: &Agents, index: usize) -> Self {
        let flock = &model.flocks[index];
        let range = flock.range();
        // in the order of ids, so that sums do not depend on cells
        let mut by_id: Vec<(u32, Record)> =
            agents.id[range.clone()].iter().copied().zip(agents.record[range].iter().copied()).collect();
        by_id.sort_unstable_by_key(|a| a.0);
        let records: Vec<Record> = by_id.into_iter().map(|a| a.1).collect();
        let n = records.len() as f64;
        let single = |v: [f32; 3]| DVec3::from(v.map(f64::from));
        let center = center(model, &records);
        let (mut along, mut around) = (DVec3::ZERO, DVec3::ZERO);
        for r in &records {
            let v = single(r.v).normalize_or_zero();
            let mut arm = single(r.x) - center;
            for a in 0..3 {
                let period = f64::from(model.grid.period[a]);
                if period > 0.0 {
                    arm[a] -= period * (arm[a] / period).round();
                }
            }
            along += v;
            around += arm.normalize_or_zero().cross(v);
        }
        let (fragments, largest) = fragments(model, flock, &records);
        let (polarization, milling) = (along.length() / n, around.length() / n);
        Self { n: records.len(), polarization, milling, fragments, largest: largest as f64 / n }
    }
}

/// Centre of the flock (m); on periodic axes the circular mean.
fn center(model: &Model, records: &[Record]) -> DVec3 {
    let mut center = DVec3::ZERO;
    for a in 0..3 {
        let period = f64::from(model.grid.period[a]);
        if period > 0.0 {
            let (mut s, mut c) = (0.0, 0.0);
            for r in records {
                let angle = TAU * f64::from(r.x[a]) / period;
                s += angle.sin();
                c += angle.cos();
            }
            center[a] = s.atan2(c) / TAU * period;
        } else {
            center[a] = records.iter().map(|r| f64::from(r.x[a])).sum::<f64>() / records.len() as f64;
        }
    }
    center
}

/// Number of connected parts and size of the largest: metric agents are linked within their radius, topological ones with their nearest.
fn fragments(model: &Model, flock: &FlockConstants, records: &[Record]) -> (usize, usize) {
    let near = Within::new(model, flock, records);
    let inside = near.sorted.len();
    let mut sets = Sets::new(inside);
    let mut found = Vec::new();
    for i in 0..inside {
        if flock.neighbours > 0 {
            let flocks = &[(&near.cells, 0)];
            let among = Among { grid: &near.grid, flocks, records: &near.sorted, id: &near.order };
            nearest(among, i, flock.neighbours, None, &mut found);
            found.iter().for_each(|n| sets.join(i, n.index));
        } else {
            near.each(i, |j| sets.join(i, j));
        }
    }
    let mut sizes = vec![0; inside];
    (0..inside).for_each(|i| sizes[sets.root(i)] += 1);
    let largest = sizes.into_iter().max().unwrap_or(1);
    (sets.count + (records.len() - inside), largest)
}

/// Mean number of others within the radius of an agent; of topological neighbours, their number.
pub fn neighbours(model: &Model, agents: &Agents, index: usize) -> f64 {
    let flock = &model.flocks[index];
    if flock.neighbours > 0 {
        return flock.neighbours.min(flock.count - 1) as f64;
    }
    let near = Within::new(model, flock, &agents.record[flock.range()]);
    let mut pairs = 0usize;
    (0..near.sorted.len()).for_each(|i| near.each(i, |_| pairs += 1));
    2.0 * pairs as f64 / flock.count as f64
}

/// Agents of one flock in cells as wide as its radius.
struct Within {
    grid: Grid,
    cells: Cells,
    order: Vec<u32>,
    sorted: Vec<Record>,
    radius_sq: f32,
}

impl Within {
    fn new(model: &Model, flock: &FlockConstants, records: &[Record]) -> Self {
        let grid = grid_about(&model.grid, records, model.dimensions, [1.0001 * f64::from(flock.radius); 3]);
        let mut cells = Cells::default();
        let inside = cells.sort(&grid, records, None);
        let order: Vec<u32> = cells.order[..inside].iter().map(|o| o.load(Relaxed)).collect();
        let sorted = order.iter().map(|&o| records[o as usize]).collect();
        Self { grid, cells, order, sorted, radius_sq: flock.radius * flock.radius }
    }

    /// Calls `f(j)` for every agent `j < i` within the radius of agent `i`.
    fn each(&self, i: usize, mut f: impl FnMut(usize)) {
        let (grid, own) = (&self.grid, &self.sorted[i]);
        let cell = grid.coordinates(own.x);
        let wrapped = |a: usize, c: i32| if grid.period[a] > 0.0 { c.rem_euclid(grid.cells[a]) } else { c };
        // on a periodic axis of fewer than three cells none is met twice
        let few = |a: usize| grid.period[a] > 0.0 && grid.cells[a] < 3;
        let range = |a: usize| if few(a) { 0..=grid.cells[a] - 1 } else { -1..=1 };
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    let c = [wrapped(0, cell[0] + x), wrapped(1, cell[1] + y), wrapped(2, cell[2] + z)];
                    for j in self.cells.row(c[0], c[0], c[1], c[2]).filter(|&j| j < i) {
                        let mut r_sq = 0.0;
                        for a in 0..3 {
                            let mut d = self.sorted[j].x[a] - own.x[a];
                            let period = grid.period[a];
                            if period > 0.0 {
                                d -= period * (d / period).round();
                            }
                            r_sq += d * d;
                        }
                        if r_sq < self.radius_sq {
                            f(j);
                        }
                    }
                }
            }
        }
    }
}

/// Disjoint sets.
struct Sets {
    parent: Vec<usize>,
    count: usize,
}

impl Sets {
    fn new(n: usize) -> Self {
        Self { parent: (0..n).collect(), count: n }
    }

    fn root(&mut self, mut i: usize) -> usize {
        while self.parent[i] != i {
            self.parent[i] = self.parent[self.parent[i]];
            i = self.parent[i];
        }
        i
    }

    fn join(&mut self, i: usize, j: usize) {
        let (i, j) = (self.root(i), self.root(j));
        if i != j {
            self.parent[i.max(j)] = i.min(j);
            self.count -= 1;
        }
    }
}
