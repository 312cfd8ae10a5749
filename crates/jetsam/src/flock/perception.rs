//! Agents sorted into cells, flock by flock, and those around a row of cells packed side by side.
//!
//! In: agents in any order. Out: [`Sorted`], agents in the order of cells, ties by id, as separate arrays; [`Tile`], all agents of a
//! flock around a row of cells.

use crate::interact::CHUNK;
use crate::interact::cells::{Cells, Grid};
use crate::interact::lanes::{Block, LANES, Lanes, pack, padded};
use crate::state::Record;
use fearless_simd::Simd;
use rayon::prelude::*;
use std::ops::Range;

/// Most cells per agent: where agents are thin, cells grow.
const CELLS_PER_AGENT: f64 = 4.0;
/// Where the padding of a tile is (m): too far for any radius, with squares that are finite.
const FAR: f32 = 1e18;

/// Cells for agents: periodic axes as the domain's, the others about the agents, wherever they are; at least `width` wide (m).
pub fn grid_about(domain: &Grid, records: &[Record], dimensions: u32, width: f64) -> Grid {
    let (low, high) = if domain.period.iter().all(|p| *p > 0.0) { ([0.0; 3], [0.0; 3]) } else { ends(records) };
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

/// The corners of the box that agents are in (m).
fn ends(records: &[Record]) -> ([f32; 3], [f32; 3]) {
    records
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
        )
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
        self.lines.iter_mut().for_each(|line| line.resize(records.len() + LANES, 0.0));
        let [x, y, z, u, v, w] = self.lines.each_mut().map(|line| line.par_chunks_mut(CHUNK));
        let lines = x.zip(y).zip(z).zip(u.zip(v).zip(w));
        lines.zip(records.par_chunks(CHUNK)).for_each(|((((x, y), z), ((u, v), w)), records)| {
            for (k, r) in records.iter().enumerate() {
                [x[k], y[k], z[k]] = r.x;
                [u[k], v[k], w[k]] = r.v;
            }
        });
    }
}

/// Agents side by side, those of a flock around a row of cells: slab by slab, a slab being all of one x. Who stands in a cell of the row
/// looks at a few slabs on end. The last vector is filled with far ones.
#[derive(Default)]
pub struct Tile {
    lines: [Vec<Block>; 6],
    len: usize,
    /// Rows of cells around: y, z, and the shift of their agents.
    rows: Vec<[(i32, f32); 2]>,
    /// Where each slab begins.
    slabs: Vec<usize>,
    /// The vectors that are looked at.
    window: Range<usize>,
}

/// What a tile is packed from.
#[derive(Clone, Copy)]
pub struct Source<'a> {
    /// Cells of agents.
    pub grid: &'a Grid,
    /// Where those of the flock begin.
    pub cells: &'a Cells,
    /// Its first agent.
    pub first: usize,
    /// All agents.
    pub sorted: &'a Sorted,
}

impl Tile {
    /// The vectors of sixteen that are looked at.
    #[inline(always)]
    pub fn window(&self) -> Range<usize> {
        self.window.clone()
    }

    /// Sixteen agents: x, y, z, vx, vy, vz.
    #[inline(always)]
    pub fn block(&self, b: usize) -> [&Lanes; 6] {
        let l = &self.lines;
        [&l[0][b].0, &l[1][b].0, &l[2][b].0, &l[3][b].0, &l[4][b].0, &l[5][b].0]
    }

    /// Vectors of the window.
    #[inline(always)]
    pub fn vectors(&self, range: Range<usize>) -> impl Iterator<Item = [&Lanes; 6]> {
        let [x, y, z, u, v, w] = &self.lines;
        let (begin, end) = (range.start, range.end);
        let places = x[begin..end].iter().zip(&y[begin..end]).zip(&z[begin..end]);
        let velocities = u[begin..end].iter().zip(&v[begin..end]).zip(&w[begin..end]);
        places.zip(velocities).map(|(((x, y), z), ((u, v), w))| [&x.0, &y.0, &z.0, &u.0, &v.0, &w.0])
    }

    #[inline(always)]
    fn reserve(&mut self, len: usize) {
        let blocks = padded(len) / LANES;
        if self.lines[0].len() < blocks {
            for line in &mut self.lines {
                line.resize(2 * blocks, Block::default());
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
        let [x, y, z] = shift;
        pack(simd, &sorted.lines, row.start, [x, y, z, 0.0, 0.0, 0.0], &mut self.lines, None, at, n);
    }

    #[inline(always)]
    fn end(&mut self) {
        for c in 0..6 {
            let line = bytemuck::cast_slice_mut::<Block, f32>(&mut self.lines[c]);
            line[self.len..padded(self.len)].fill(if c == 0 { FAR } else { 0.0 });
        }
        self.window = 0..padded(self.len) / LANES;
    }

    /// Packs single agents, each with its shift, and looks at all of them.
    #[inline(always)]
    pub fn pick<S: Simd>(&mut self, simd: S, sorted: &Sorted, agents: impl Iterator<Item = (usize, [f32; 3])>) {
        self.len = 0;
        for (i, shift) in agents {
            self.append(simd, sorted, i..i + 1, shift);
        }
        self.end();
    }

    /// Packs the agents in the cells up to `far` cells from those between `from` and `to`, which are of one row; periodic images are
    /// shifted into place.
    #[inline(always)]
    pub fn pack<S: Simd>(&mut self, simd: S, source: Source, from: [i32; 3], to: i32, far: [i32; 3]) {
        let Source { grid, cells, first, sorted } = source;
        self.len = 0;
        self.rows.clear();
        self.slabs.clear();
        let reach = |a: usize, to: i32| match grid.period[a] > 0.0 {
            true => from[a] - far[a]..=to + far[a],
            false => (from[a] - far[a]).max(0)..=(to + far[a]).min(grid.cells[a] - 1),
        };
        for (z, shift_z) in reach(2, from[2]).filter_map(|c| grid.image(2, c)) {
            for (y, shift_y) in reach(1, from[1]).filter_map(|c| grid.image(1, c)) {
                if !cells.row(0, grid.cells[0] - 1, y, z).is_empty() {
                    self.rows.push([(y, shift_y), (z, shift_z)]);
                }
            }
        }
        for cx in from[0] - far[0]..=to + far[0] {
            self.slabs.push(self.len);
            let Some((x, shift_x)) = grid.image(0, cx) else { continue };
            for r in 0..self.rows.len() {
                let [(y, shift_y), (z, shift_z)] = self.rows[r];
                let row = cells.row(x, x, y, z);
                self.append(simd, sorted, first + row.start..first + row.end, [shift_x, shift_y, shift_z]);
            }
        }
        self.slabs.push(self.len);
        self.end();
    }

    /// Looks at the slabs `range`, counted from the first that was packed. Those beside them that share a vector are seen too: they are
    /// too far away to count.
    #[inline(always)]
    pub fn look(&mut self, range: Range<usize>) {
        self.window = self.slabs[range.start] / LANES..padded(self.slabs[range.end]) / LANES;
    }
}
