//! Stage `cells`: sorts the particles of a kind into cells as wide as interactions reach.
//!
//! In: records in any order. Out: a permutation sorted by cell (x fastest), ties by id, and where each cell
//! begins. A stable counting sort in parallel; its result does not depend on the number of threads. Particles
//! outside the domain or not finite come last and are counted out.

use super::CHUNK;
use crate::scene::Wall;
use crate::state::Record;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// The box particles live in, cut into cells at least as wide as interactions reach.
#[derive(Clone, Debug)]
pub struct Grid {
    /// Lower corner of the domain (m).
    pub min: DVec3,
    /// Upper corner of the domain (m).
    pub max: DVec3,
    /// What is at the sides of each axis.
    pub walls: [Wall; 3],
    /// Lower corner of the first cell (m).
    pub origin: [f32; 3],
    /// Cells per metre on each axis.
    pub inverse: [f32; 3],
    /// Number of cells on each axis.
    pub cells: [i32; 3],
    /// Length of each periodic axis (m), 0 for the others.
    pub period: [f32; 3],
    /// Where particles may be (m): the domain, and inside solid walls as deep as their particles go.
    pub lower: [f32; 3],
    /// The upper end of where particles may be (m).
    pub upper: [f32; 3],
}

/// Why a particle is no longer part of the simulation.
const LEFT: u32 = 1;
const LOST: u32 = 2;
const NONFINITE: u32 = 3;
const OUT: u32 = 4;
/// The first coordinate of a fluid particle that a sink has taken.
pub const DRAINED: f32 = f32::MAX;

impl Grid {
    /// Cells `reach` wide (m) for a domain. `wall` is how deep solid walls reach outside the domain (m).
    pub fn new(min: DVec3, max: DVec3, walls: [Wall; 3], dimensions: u32, reach: f64, wall: f64) -> Self {
        let mut grid = Self {
            min,
            max,
            walls,
            origin: [0.0; 3],
            inverse: [0.0; 3],
            cells: [1; 3],
            period: [0.0; 3],
            lower: [f32::MIN; 3],
            upper: [f32::MAX; 3],
        };
        for a in 0..3 {
            if dimensions == 2 && a == 1 {
                grid.walls[a] = Wall::Open;
                continue;
            }
            let pad = if walls[a] == Wall::Solid { wall } else { 0.0 };
            let (low, high) = (min[a] - pad, max[a] + pad);
            let count = match walls[a] {
                Wall::Periodic => ((high - low) / reach).floor().max(1.0),
                _ => ((high - low) / reach).ceil().max(1.0),
            };
            let width = if walls[a] == Wall::Periodic { (high - low) / count } else { reach };
            grid.origin[a] = low as f32;
            grid.inverse[a] = (1.0 / width) as f32;
            grid.cells[a] = count as i32;
            grid.lower[a] = low as f32;
            grid.upper[a] = high as f32;
            if walls[a] == Wall::Periodic {
                grid.period[a] = (high - low) as f32;
            }
        }
        grid
    }

    /// Cell coordinates of a place, clamped to the grid.
    #[inline]
    pub fn coordinates(&self, x: [f32; 3]) -> [i32; 3] {
        std::array::from_fn(|a| {
            let c = ((x[a] - self.origin[a]) * self.inverse[a]) as i32; // saturates; NaN becomes 0
            c.clamp(0, self.cells[a] - 1)
        })
    }

    /// Index of a cell of the grid.
    #[inline(always)]
    fn index(&self, c: [i32; 3]) -> usize {
        (c[2] as usize * self.cells[1] as usize + c[1] as usize) * self.cells[0] as usize + c[0] as usize
    }

    /// The cell on axis `a` that stands at coordinate `c`, and how far what is in it is to be shifted (m); none beyond a side that is not
    /// periodic.
    #[inline(always)]
    pub fn image(&self, a: usize, c: i32) -> Option<(i32, f32)> {
        let n = self.cells[a];
        match c {
            _ if (0..n).contains(&c) => Some((c, 0.0)),
            _ if self.period[a] == 0.0 => None,
            _ if c < 0 => Some((c + n, -self.period[a])),
            _ => Some((c - n, self.period[a])),
        }
    }

    /// Brings a position on periodic axes back into the domain.
    #[inline]
    pub fn wrap(&self, x: &mut [f32; 3]) {
        for a in 0..3 {
            let period = self.period[a];
            if period > 0.0 {
                if x[a] >= self.upper[a] {
                    x[a] -= period;
                }
                if x[a] < self.lower[a] {
                    x[a] += period;
                    // a tiny negative offset rounds up to the far side, which is the near side
                    if x[a] >= self.upper[a] {
                        x[a] = self.lower[a];
                    }
                }
            }
        }
    }

    /// A difference of places across periodic axes, the short way (m).
    pub fn nearest(&self, mut d: DVec3) -> DVec3 {
        for a in 0..3 {
            let period = f64::from(self.period[a]);
            if period > 0.0 {
                d[a] -= period * (d[a] / period).round();
            }
        }
        d
    }

    /// Whether a particle at `x` is part of the simulation.
    pub fn holds(&self, x: [f32; 3]) -> bool {
        self.gone(x) == 0
    }

    /// Why a particle at `x` is no longer part of the simulation; 0 if it is.
    #[inline(always)]
    fn gone(&self, x: [f32; 3]) -> u32 {
        let inside = (0..3).fold(true, |inside, a| inside & (x[a] >= self.lower[a]) & (x[a] <= self.upper[a]));
        if inside { 0 } else { self.why_gone(x) }
    }

    #[cold]
    fn why_gone(&self, x: [f32; 3]) -> u32 {
        if !x.iter().all(|c| c.is_finite()) {
            return NONFINITE;
        }
        if x[0] == DRAINED {
            return OUT;
        }
        let mut gone = 0;
        for a in 0..3 {
            if x[a] < self.lower[a] || x[a] > self.upper[a] {
                gone = gone.max(if self.walls[a] == Wall::Open { LEFT } else { LOST });
            }
        }
        gone
    }
}

/// The box of cells that a kind of particle occupies: cost goes with it, not with the whole domain.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Window {
    /// First cell on each axis.
    pub min: [i32; 3],
    /// Number of cells on each axis.
    pub cells: [i32; 3],
}

impl Window {
    const EMPTY: Self = Self { min: [i32::MAX; 3], cells: [0; 3] };

    /// The box of cells that holds all records inside the domain.
    fn of(grid: &Grid, records: &[Record]) -> Self {
        let chunks = records.par_chunks(CHUNK).map(|chunk| {
            let mut ends = Ends::NONE;
            chunk.iter().filter(|r| grid.gone(r.x) == 0).for_each(|r| ends = ends.with(r.x, r.x));
            ends
        });
        let Ends([low, high]) = chunks.reduce(|| Ends::NONE, |a, b| a.with(b.0[0], b.0[1]));
        if (0..3).any(|a| low[a] > high[a]) {
            return Self::EMPTY;
        }
        let (min, max) = (grid.coordinates(low), grid.coordinates(high));
        Self { min, cells: std::array::from_fn(|a| max[a] - min[a] + 1) }
    }

    fn len(&self) -> usize {
        self.cells.iter().map(|&c| c as usize).product()
    }

    /// Index of a cell inside the window.
    #[inline(always)]
    fn index(&self, c: [i32; 3]) -> usize {
        let [x, y, z] = [c[0] - self.min[0], c[1] - self.min[1], c[2] - self.min[2]];
        ((z * self.cells[1] + y) * self.cells[0] + x) as usize
    }
}

/// Lower and upper ends of a set of places (m).
#[derive(Clone, Copy)]
struct Ends([[f32; 3]; 2]);

impl Ends {
    const NONE: Self = Self([[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]]);

    #[inline(always)]
    fn with(self, low: [f32; 3], high: [f32; 3]) -> Self {
        Self([
            std::array::from_fn(|a| if low[a] < self.0[0][a] { low[a] } else { self.0[0][a] }),
            std::array::from_fn(|a| if high[a] > self.0[1][a] { high[a] } else { self.0[1][a] }),
        ])
    }
}

/// Where each cell of a kind begins, and the scratch of its sort.
#[derive(Debug, Default)]
pub struct Cells {
    /// The cells that are occupied.
    window: Window,
    /// `start[c]..start[c + 1]` are the places of cell `c` of the window in the sorted order.
    start: Vec<u32>,
    /// For each place in the sorted order, where its particle stands in the input.
    pub order: Vec<AtomicU32>,
    /// Particles that passed an open side, at this sort.
    pub left: usize,
    /// Particles that passed a solid wall, at this sort.
    pub lost: usize,
    /// Particles whose position was not finite, at this sort.
    pub nonfinite: usize,
    /// A bit for each cell of the grid: whether there are particles in the cells around. Empty if not mapped.
    map: Vec<u64>,
    /// Particles that a sink has taken, at this sort.
    pub drained: usize,
    keys: Vec<u32>,
    counts: Vec<Vec<u32>>,
}

impl Cells {
    /// Sorts `records`; ties are put in the order of `id`, or stay in input order without. Returns how many
    /// particles are still inside.
    pub fn sort(&mut self, grid: &Grid, records: &[Record], id: Option<&[u32]>) -> usize {
        let n = records.len();
        self.window = Window::of(grid, records);
        let (window, cells) = (self.window, self.window.len());
        let bins = cells + OUT as usize;
        self.start.resize(bins + 1, 0);
        self.keys.resize(n, 0);
        if self.order.len() < n {
            self.order.resize_with(n, AtomicU32::default);
        }
        // the sort is stable, so the number of parts changes the speed alone
        let parts = rayon::current_num_threads().clamp(1, n.div_ceil(CHUNK).max(1));
        let part = n.div_ceil(parts).max(1);
        self.counts.resize_with(parts, Vec::new);
        self.counts.par_iter_mut().zip(self.keys.par_chunks_mut(part)).zip(records.par_chunks(part)).for_each(
            |((count, keys), records)| {
                count.clear();
                count.resize(bins, 0);
                for (key, record) in keys.iter_mut().zip(records) {
                    *key = match grid.gone(record.x) {
                        0 => window.index(grid.coordinates(record.x)) as u32,
                        gone => cells as u32 + gone - 1,
                    };
                    count[*key as usize] += 1;
                }
            },
        );
        for count in self.counts.iter_mut().skip(n.div_ceil(part)) {
            count.clear();
            count.resize(bins, 0);
        }
        let mut sum = 0;
        for bin in 0..bins {
            self.start[bin] = sum;
            for count in &mut self.counts {
                sum += std::mem::replace(&mut count[bin], sum);
            }
        }
        self.start[bins] = sum;
        let order = &self.order;
        self.counts.par_iter_mut().zip(self.keys.par_chunks(part)).enumerate().for_each(|(p, (next, keys))| {
            for (i, &key) in keys.iter().enumerate() {
                let place = &mut next[key as usize];
                order[*place as usize].store((p * part + i) as u32, Relaxed);
                *place += 1;
            }
        });
        if let Some(id) = id {
            self.start.par_windows(2).with_min_len(CHUNK).for_each(|cell| {
                by_id(&order[cell[0] as usize..cell[1] as usize], id);
            });
        }
        self.left = (self.start[cells + 1] - self.start[cells]) as usize;
        self.lost = (self.start[cells + 2] - self.start[cells + 1]) as usize;
        self.nonfinite = (self.start[cells + 3] - self.start[cells + 2]) as usize;
        self.drained = (self.start[cells + 4] - self.start[cells + 3]) as usize;
        n - self.left - self.lost - self.nonfinite - self.drained
    }
}

impl Cells {
    /// Where cell `c`, of a particle that was sorted, ends in the sorted order.
    #[inline(always)]
    pub fn end(&self, c: [i32; 3]) -> usize {
        self.start[self.window.index(c) + 1] as usize
    }

    /// Where cell `c` begins in the sorted order.
    #[inline(always)]
    pub fn start(&self, c: [i32; 3]) -> usize {
        self.start[self.window.index(c)] as usize
    }

    /// The cells that are occupied.
    pub fn window(&self) -> Window {
        self.window
    }

    /// Whether there may be particles in the 27 cells around `c`: exact where the cells have been mapped.
    #[inline(always)]
    pub fn are_near(&self, grid: &Grid, c: [i32; 3]) -> bool {
        if !self.map.is_empty() {
            let at = grid.index(c);
            return self.map[at / 64] >> (at % 64) & 1 == 1;
        }
        let w = &self.window;
        w.cells[0] > 0
            && (0..3).all(|a| {
                let within = c[a] + 1 >= w.min[a] && c[a] <= w.min[a] + w.cells[a];
                within || grid.period[a] > 0.0 && (c[a] == 0 || c[a] == grid.cells[a] - 1)
            })
    }

    /// Maps where particles are near, for a kind that stays where it is.
    pub fn map(&mut self, grid: &Grid) {
        self.map.clear();
        self.map.resize(grid.cells.iter().map(|&n| n as usize).product::<usize>().div_ceil(64), 0);
        let w = self.window;
        for (cell, bounds) in self.start[..=w.len()].windows(2).enumerate() {
            if bounds[0] == bounds[1] {
                continue;
            }
            let (x, yz) = (cell as i32 % w.cells[0], cell as i32 / w.cells[0]);
            let c = [x, yz % w.cells[1], yz / w.cells[1]];
            for k in 0..27 {
                let around = [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1];
                let c = std::array::from_fn(|a| {
                    let c = w.min[a] + c[a] + around[a];
                    if grid.period[a] > 0.0 { c.rem_euclid(grid.cells[a]) } else { c }
                });
                if (0..3).all(|a| (0..grid.cells[a]).contains(&c[a])) {
                    let at = grid.index(c);
                    self.map[at / 64] |= 1 << (at % 64);
                }
            }
        }
    }

    /// Places, in the sorted order, of the particles in cells `from..=to` of the row at `y`, `z`.
    #[inline(always)]
    pub fn row(&self, from: i32, to: i32, y: i32, z: i32) -> std::ops::Range<usize> {
        let w = &self.window;
        let outside = |c: i32, a: usize| c < w.min[a] || c >= w.min[a] + w.cells[a];
        let (from, to) = (from.max(w.min[0]), to.min(w.min[0] + w.cells[0] - 1));
        if from > to || outside(y, 1) || outside(z, 2) {
            return 0..0;
        }
        self.start[w.index([from, y, z])] as usize..self.start[w.index([to, y, z]) + 1] as usize
    }
}

/// Insertion sort of one cell: few members, nearly in order.
fn by_id(cell: &[AtomicU32], id: &[u32]) {
    for i in 1..cell.len() {
        let moving = cell[i].load(Relaxed);
        let key = id[moving as usize];
        let mut j = i;
        while j > 0 {
            let before = cell[j - 1].load(Relaxed);
            if id[before as usize] <= key {
                break;
            }
            cell[j].store(before, Relaxed);
            j -= 1;
        }
        cell[j].store(moving, Relaxed);
    }
}
