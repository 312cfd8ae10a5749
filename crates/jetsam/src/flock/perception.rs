//! Agents sorted into cells, flock by flock, and those around a cell packed side by side.
//!
//! In: agents in any order. Out: [`Sorted`], agents in the order of cells, ties by id, as separate arrays; [`Tile`], all agents of a
//! flock in the 27 cells around one.

use crate::interact::CHUNK;
use crate::interact::cells::{Cells, Grid};
use crate::interact::lanes::{LANES, padded};
use crate::state::Record;
use bytemuck::{Pod, Zeroable};
use fearless_simd::f32x16;
use fearless_simd::prelude::*;
use rayon::prelude::*;
use std::ops::Range;

/// Most cells per agent: where agents are thin, cells grow.
const CELLS_PER_AGENT: f64 = 4.0;
/// Where the padding of a tile is (m): too far for any radius, with squares that are finite.
const FAR: f32 = 1e18;

/// Cells for agents: periodic axes as the domain's, the others about the agents, wherever they are; at least `width` wide (m).
pub fn grid_about(domain: &Grid, records: &[Record], dimensions: u32, width: f64) -> Grid {
    let (low, high) = records
        .par_chunks(CHUNK)
        .map(|chunk| {
            let mut b = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
            for r in chunk.iter().filter(|r| r.x.iter().all(|c| c.is_finite())) {
                for a in 0..3 {
                    b.0[a] = b.0[a].min(r.x[a]);
                    b.1[a] = b.1[a].max(r.x[a]);
                }
            }
            b
        })
        .reduce(
            || ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]),
            |a, b| (std::array::from_fn(|k| a.0[k].min(b.0[k])), std::array::from_fn(|k| a.1[k].max(b.1[k]))),
        );
    let mut grid = domain.clone();
    let length: [f64; 3] = std::array::from_fn(|a| match grid.period[a] {
        p if p > 0.0 => f64::from(p),
        _ if dimensions == 2 && a == 1 => 0.0,
        _ => f64::from((high[a] - low[a]).max(0.0)),
    });
    let most = CELLS_PER_AGENT * records.len() as f64 + 64.0;
    let mut width = width;
    let counts = |width: f64| -> [f64; 3] {
        std::array::from_fn(|a| {
            if grid.period[a] > 0.0 { (length[a] / width).floor() } else { (length[a] / width).ceil() }.max(1.0)
        })
    };
    while counts(width).iter().product::<f64>() > most {
        width *= 1.25;
    }
    let counts = counts(width);
    for a in 0..3 {
        grid.cells[a] = counts[a] as i32;
        if grid.period[a] == 0.0 {
            grid.origin[a] = if low[a].is_finite() { low[a] } else { 0.0 };
            grid.inverse[a] = (1.0 / width) as f32;
            (grid.lower[a], grid.upper[a]) = (f32::NEG_INFINITY, f32::INFINITY);
        } else {
            grid.inverse[a] = (counts[a] / length[a]) as f32;
        }
    }
    grid
}

/// Positions and velocities of all agents in sorted order, each component by itself, and room for a vector at the end.
#[derive(Default)]
pub struct Sorted {
    /// x, y, z, vx, vy, vz (SI).
    pub lines: [Vec<f32>; 6],
}

impl Sorted {
    /// Takes over records.
    pub fn fill(&mut self, records: &[Record]) {
        for (c, line) in self.lines.iter_mut().enumerate() {
            line.resize(records.len() + LANES, 0.0);
            line.par_chunks_mut(8 * CHUNK).zip(records.par_chunks(8 * CHUNK)).for_each(|(line, records)| {
                for (to, r) in line.iter_mut().zip(records) {
                    *to = if c < 3 { r.x[c] } else { r.v[c - 3] };
                }
            });
        }
    }
}

/// Sixteen numbers on a cache line.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, align(64))]
struct Line([f32; LANES]);

/// Agents side by side, the last vector filled with far ones.
#[derive(Default)]
pub struct Tile {
    lines: [Vec<Line>; 6],
    len: usize,
}

impl Tile {
    /// Number of vectors of sixteen.
    #[inline(always)]
    pub fn blocks(&self) -> usize {
        self.len.div_ceil(LANES)
    }

    /// Sixteen agents: x, y, z, vx, vy, vz.
    #[inline(always)]
    pub fn block(&self, b: usize) -> [&[f32; LANES]; 6] {
        let l = &self.lines;
        [&l[0][b].0, &l[1][b].0, &l[2][b].0, &l[3][b].0, &l[4][b].0, &l[5][b].0]
    }

    /// Up to `n` vectors from number `first` on.
    #[inline(always)]
    pub fn vectors(&self, first: usize, n: usize) -> impl Iterator<Item = [&[f32; LANES]; 6]> {
        let end = self.blocks().min(first + n);
        let [x, y, z, u, v, w] = self.lines.each_ref().map(|line| line[first..end].iter());
        let places = x.zip(y).zip(z);
        places.zip(u.zip(v).zip(w)).map(|(((x, y), z), ((u, v), w))| [&x.0, &y.0, &z.0, &u.0, &v.0, &w.0])
    }

    #[inline(always)]
    fn begin(&mut self) {
        self.len = 0;
    }

    #[inline(always)]
    fn reserve(&mut self, len: usize) {
        let lines = padded(len) / LANES;
        if self.lines[0].len() < lines {
            for line in &mut self.lines {
                line.resize(lines, Line([0.0; LANES]));
            }
        }
    }

    /// Appends the agents `row` of the sorted order, shifted.
    #[inline(always)]
    fn append<S: Simd>(&mut self, simd: S, sorted: &Sorted, row: Range<usize>, shift: [f32; 3]) {
        let (at, n) = (self.len, row.len());
        if n == 0 {
            return;
        }
        // whole vectors: what is too much is overwritten by what comes next
        self.reserve(at + n + LANES);
        self.len += n;
        for c in 0..6 {
            let shift = f32x16::splat(simd, if c < 3 { shift[c] } else { 0.0 });
            let to = &mut bytemuck::cast_slice_mut::<Line, f32>(&mut self.lines[c])[at..];
            let from = &sorted.lines[c][row.start..];
            for k in (0..n).step_by(LANES) {
                let v = f32x16::from_slice(simd, &from[k..k + LANES]);
                (v + shift).store_slice(&mut to[k..k + LANES]);
            }
        }
    }

    #[inline(always)]
    fn end(&mut self) {
        for c in 0..6 {
            let line = bytemuck::cast_slice_mut::<Line, f32>(&mut self.lines[c]);
            line[self.len..padded(self.len)].fill(if c == 0 { FAR } else { 0.0 });
        }
    }

    /// Packs single agents, each with its shift.
    #[inline(always)]
    pub fn pick<S: Simd>(&mut self, simd: S, sorted: &Sorted, agents: impl Iterator<Item = (usize, [f32; 3])>) {
        self.begin();
        for (i, shift) in agents {
            self.append(simd, sorted, i..i + 1, shift);
        }
        self.end();
    }

    /// Packs the agents of a flock (its cells, its first agent) in the cells up to `far` cells from `cell`; periodic images are shifted
    /// into place.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)] // one caller
    pub fn pack<S: Simd>(
        &mut self,
        simd: S,
        grid: &Grid,
        cells: &Cells,
        first: usize,
        sorted: &Sorted,
        cell: [i32; 3],
        far: i32,
    ) {
        self.begin();
        let reach = |a: usize| match grid.period[a] > 0.0 {
            true => cell[a] - far..=cell[a] + far,
            false => (cell[a] - far).max(0)..=(cell[a] + far).min(grid.cells[a] - 1),
        };
        let (low, high, last) = (cell[0] - far, cell[0] + far, grid.cells[0] - 1);
        for cz in reach(2) {
            let Some((z, shift_z)) = image(grid, 2, cz) else { continue };
            for cy in reach(1) {
                let Some((y, shift_y)) = image(grid, 1, cy) else { continue };
                let place = |r: Range<usize>| first + r.start..first + r.end;
                let shift = [0.0, shift_y, shift_z];
                self.append(simd, sorted, place(cells.row(low.max(0), high.min(last), y, z)), shift);
                let period = grid.period[0];
                if period > 0.0 && low < 0 {
                    self.append(
                        simd,
                        sorted,
                        place(cells.row(low + last + 1, last, y, z)),
                        [-period, shift_y, shift_z],
                    );
                }
                if period > 0.0 && high > last {
                    self.append(simd, sorted, place(cells.row(0, high - last - 1, y, z)), [period, shift_y, shift_z]);
                }
            }
        }
        self.end();
    }
}

/// The cell on axis `a` that stands at coordinate `c`, and how far its agents are to be shifted.
#[inline(always)]
pub fn image(grid: &Grid, a: usize, c: i32) -> Option<(i32, f32)> {
    let n = grid.cells[a];
    match c {
        _ if (0..n).contains(&c) => Some((c, 0.0)),
        _ if grid.period[a] == 0.0 => None,
        _ if c < 0 => Some((c + n, -grid.period[a])),
        _ => Some((c - n, grid.period[a])),
    }
}
