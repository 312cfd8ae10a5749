//! Neighbours, found once for all laws of a step.
//!
//! For each particle of a kind, the particles of each acting kind closer than the support, as indices into the
//! particle arrays, in the order of cells and places. Work goes by chunks of particles and inside a chunk cell by
//! cell: the 27 cells around are packed into a tile that all particles of the cell share, and candidates are
//! tested sixteen at a time.

use super::cells::{Cells, Grid};
use super::lanes::{LANES, padded};
use crate::state::{Kind, Record};
use fearless_simd::prelude::*;
use fearless_simd::{f32x16, u32x16};
use std::cell::RefCell;
use std::ops::Range;

/// Neighbours of one particle: a run per kind in its chunk's list, each padded to whole vectors with the
/// particle itself.
#[derive(Clone, Copy, Debug, Default)]
pub struct Runs {
    begin: u32,
    count: [u16; Kind::COUNT],
}

impl Runs {
    /// Number of neighbours of a kind; for a fluid particle among fluids this includes itself.
    #[inline(always)]
    pub fn count(&self, kind: Kind) -> usize {
        self.count[kind as usize] as usize
    }

    /// Where the run of a kind stands in the chunk's list, padding included.
    #[inline(always)]
    pub fn padded(&self, kind: Kind) -> Range<usize> {
        let mut begin = self.begin as usize;
        for k in 0..kind as usize {
            begin += padded(self.count[k] as usize);
        }
        begin..begin + padded(self.count[kind as usize] as usize)
    }

    /// Where the run of a kind stands in the chunk's list, neighbours only.
    #[inline(always)]
    pub fn exact(&self, kind: Kind) -> Range<usize> {
        let begin = self.padded(kind).start;
        begin..begin + self.count(kind)
    }
}

/// Neighbours of a chunk of particles. Kept from step to step, so that nothing is allocated once sizes settle.
#[derive(Clone, Debug, Default)]
pub struct NeighbourChunk {
    /// All runs, one after another.
    pub list: Vec<u32>,
    /// Runs of each particle of the chunk.
    pub runs: Vec<Runs>,
}

/// Candidates around one cell.
#[derive(Default)]
struct Tile {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    index: Vec<u32>,
    owner: Vec<u32>,
    len: usize,
}

/// A tile per acting kind, and squared distances beside the list: scratch of a thread.
#[derive(Default)]
pub struct Scratch {
    tile: [Tile; Kind::COUNT],
    /// Squared distances (m^2) of the cell's runs, indexed from the first of them; `H^2` in the padding.
    pub r_sq: Vec<f32>,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

/// Lends the thread's scratch to `work`. Dispatch to wide instructions belongs inside of `work`: what is called
/// through a thread-local is compiled for the plain machine.
pub fn with_scratch(work: impl FnOnce(&mut Scratch)) {
    let mut scratch = SCRATCH.take();
    work(&mut scratch);
    SCRATCH.set(scratch);
}

/// What the search reads.
#[derive(Clone, Copy)]
pub struct Around<'a> {
    /// Cells of the domain.
    pub grid: &'a Grid,
    /// All particles.
    pub records: &'a [Record],
    /// Owners of all particles.
    pub owner: &'a [u32],
    /// Where cells begin, kind by kind.
    pub cells: [&'a Cells; Kind::COUNT],
    /// First particle of each kind's segment.
    pub first: [usize; Kind::COUNT],
    /// Whether each body sleeps: its particles look for no neighbours.
    pub asleep: &'a [bool],
    /// Support radius (m).
    pub support: f32,
}

/// Which kinds act on a particle of kind `kind`: the table of [`crate::laws`].
fn acting(kind: Kind) -> &'static [Kind] {
    match kind {
        Kind::Fluid | Kind::Rigid => &[Kind::Fluid, Kind::Rigid, Kind::Static],
        Kind::Static => &[Kind::Fluid, Kind::Rigid],
    }
}

impl NeighbourChunk {
    /// Finds the neighbours of the particles `members` (indices) of kind `kind`, and calls
    /// `each_cell(members of the cell, their runs, list, r_sq, base)` after each cell, where the squared
    /// distance of list entry `k` is `r_sq[k - base]`.
    #[inline(always)]
    pub fn find<S: Simd>(
        &mut self,
        simd: S,
        scratch: &mut Scratch,
        around: Around,
        kind: Kind,
        members: Range<usize>,
        mut each_cell: impl FnMut(Range<usize>, &[Runs], &[u32], &[f32], usize),
    ) {
        self.runs.clear();
        let mut used = 0;
        let mut from = members.start;
        while from < members.end {
            let cell = around.grid.coordinates(around.records[from].x);
            let mut to = from + 1;
            while to < members.end && around.grid.coordinates(around.records[to].x) == cell {
                to += 1;
            }
            let asleep = |i: usize| kind == Kind::Rigid && around.asleep[around.owner[i] as usize];
            if (from..to).all(asleep) {
                self.runs.extend((from..to).map(|_| Runs { begin: used as u32, ..Runs::default() }));
                from = to;
                continue;
            }
            let mut candidates = 0;
            for &k in acting(kind) {
                scratch.tile[k as usize].pack(&around, k, cell);
                candidates += padded(scratch.tile[k as usize].len);
            }
            let base = used;
            let room = (to - from) * (candidates + LANES);
            if self.list.len() < base + room {
                self.list.resize(base + room, 0);
            }
            if scratch.r_sq.len() < room {
                scratch.r_sq.resize(room, 0.0);
            }
            let first_run = self.runs.len();
            for i in from..to {
                let mut runs = Runs { begin: used as u32, count: [0; Kind::COUNT] };
                for &k in if asleep(i) { &[] } else { acting(kind) } {
                    let tile = &scratch.tile[k as usize];
                    if tile.len == 0 {
                        continue;
                    }
                    let not = if kind == Kind::Rigid && k == Kind::Rigid { Some(around.owner[i]) } else { None };
                    let (list, r_sq) = (&mut self.list[used..], &mut scratch.r_sq[used - base..]);
                    let n = tile.search(simd, around.records[i].x, not, around.support, list, r_sq);
                    for pad in n..padded(n) {
                        list[pad] = i as u32;
                        r_sq[pad] = around.support * around.support;
                    }
                    runs.count[k as usize] = n as u16;
                    used += padded(n);
                }
                self.runs.push(runs);
            }
            each_cell(from..to, &self.runs[first_run..], &self.list, &scratch.r_sq, base);
            from = to;
        }
    }
}

impl Tile {
    /// Packs the particles of kind `kind` in the 27 cells around `cell`; periodic images are shifted into place.
    #[inline(always)]
    fn pack(&mut self, around: &Around, kind: Kind, cell: [i32; 3]) {
        self.len = 0;
        let grid = around.grid;
        let cells = around.cells[kind as usize];
        let reach = |a: usize| if grid.cells[a] == 1 && grid.period[a] == 0.0 { 0..=0 } else { -1..=1 };
        for dz in reach(2) {
            let Some((z, shift_z)) = image(grid, 2, cell[2] + dz) else { continue };
            for dy in reach(1) {
                let Some((y, shift_y)) = image(grid, 1, cell[1] + dy) else { continue };
                let row = [y, z];
                let (low, high, last) = (cell[0] - 1, cell[0] + 1, grid.cells[0] - 1);
                let shift = [0.0, shift_y, shift_z];
                self.append(around, cells, kind, row, low.max(0), high.min(last), shift);
                let period = grid.period[0];
                if period > 0.0 && low < 0 {
                    self.append(around, cells, kind, row, last, last, [-period, shift_y, shift_z]);
                }
                if period > 0.0 && high > last {
                    self.append(around, cells, kind, row, 0, 0, [period, shift_y, shift_z]);
                }
            }
        }
        // far points fill the last vector: never closer than the support
        let end = padded(self.len);
        self.reserve(end);
        for l in self.len..end {
            self.x[l] = f32::MAX;
            self.y[l] = 0.0;
            self.z[l] = 0.0;
            self.index[l] = 0;
            self.owner[l] = u32::MAX;
        }
    }

    #[inline(always)]
    fn reserve(&mut self, len: usize) {
        if self.x.len() < len {
            for a in [&mut self.x, &mut self.y, &mut self.z] {
                a.resize(len, 0.0);
            }
            self.index.resize(len, 0);
            self.owner.resize(len, 0);
        }
    }

    /// Packs the cells `from..=to` of a row.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)] // one caller, three calls
    fn append(
        &mut self,
        around: &Around,
        cells: &Cells,
        kind: Kind,
        [y, z]: [i32; 2],
        from: i32,
        to: i32,
        shift: [f32; 3],
    ) {
        let first = around.first[kind as usize];
        let row = cells.row(from, to, y, z);
        let (begin, end) = (first + row.start, first + row.end);
        let (at, n) = (self.len, end - begin);
        if n == 0 {
            return;
        }
        self.len += n;
        self.reserve(padded(self.len));
        let (x, y, z) = (&mut self.x[at..at + n], &mut self.y[at..at + n], &mut self.z[at..at + n]);
        let (index, owner) = (&mut self.index[at..at + n], &mut self.owner[at..at + n]);
        let (records, owners) = (&around.records[begin..end], &around.owner[begin..end]);
        for k in 0..n {
            let r = &records[k];
            x[k] = r.x[0] + shift[0];
            y[k] = r.x[1] + shift[1];
            z[k] = r.x[2] + shift[2];
            index[k] = (begin + k) as u32;
            owner[k] = owners[k];
        }
    }

    /// Appends to `list` the candidates closer than `support` to `x` (of another owner than `not`), with their
    /// squared distances; returns how many.
    #[inline(always)]
    fn search<S: Simd>(
        &self,
        simd: S,
        x: [f32; 3],
        not: Option<u32>,
        support: f32,
        list: &mut [u32],
        r_sq: &mut [f32],
    ) -> usize {
        let [xi, yi, zi] = x.map(|c| f32x16::splat(simd, c));
        let limit = f32x16::splat(simd, support * support);
        let mut n = 0;
        for at in (0..padded(self.len)).step_by(LANES) {
            let d_x = f32x16::from_slice(simd, &self.x[at..at + LANES]) - xi;
            let d_y = f32x16::from_slice(simd, &self.y[at..at + LANES]) - yi;
            let d_z = f32x16::from_slice(simd, &self.z[at..at + LANES]) - zi;
            let r = d_x * d_x + d_y * d_y + d_z * d_z;
            let mut near = r.simd_lt(limit);
            if let Some(own) = not {
                let owner = u32x16::from_slice(simd, &self.owner[at..at + LANES]);
                near &= !owner.simd_eq(u32x16::splat(simd, own));
            }
            let index = u32x16::from_slice(simd, &self.index[at..at + LANES]);
            simd.compress_u32x16(index, near).store_slice(&mut list[n..n + LANES]);
            simd.compress_f32x16(r, near).store_slice(&mut r_sq[n..n + LANES]);
            n += simd.to_bitmask_mask32x16(near).count_ones() as usize;
        }
        n
    }
}

/// The cell on axis `a` that stands at coordinate `c`, and how far its particles are to be shifted.
#[inline(always)]
fn image(grid: &Grid, a: usize, c: i32) -> Option<(i32, f32)> {
    let n = grid.cells[a];
    match c {
        _ if (0..n).contains(&c) => Some((c, 0.0)),
        _ if grid.period[a] == 0.0 => None,
        _ if c < 0 => Some((c + n, -grid.period[a])),
        _ => Some((c - n, grid.period[a])),
    }
}
