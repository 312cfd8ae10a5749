//! Neighbours, found once for all laws of a step.
//!
//! For each particle of a kind, the particles of each acting kind closer than the support, as indices into the
//! particle arrays, in the order of cells and places; of bodies' particles among each other those that contacts may
//! reach, out of which [`super::kept`] makes its lists. Work goes by chunks of particles and inside a chunk cell by
//! cell: the 27 cells around are packed into a tile that all particles of the cell share, and candidates are
//! tested sixteen at a time.

use super::cells::{Cells, Grid};
use super::lanes::{Block, Candidates, Indices, LANES, Whose, near, pack, padded};
use crate::state::{Kind, Record};
use fearless_simd::Simd;
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
        let length = |k| padded(self.count(k));
        let begin = self.begin as usize
            + match kind {
                Kind::Fluid => 0,
                Kind::Rigid => length(Kind::Fluid),
                Kind::Static => length(Kind::Fluid) + length(Kind::Rigid),
            };
        begin..begin + length(kind)
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
    list: Vec<u32>,
    used: usize,
    /// Runs of each particle of the chunk.
    pub runs: Vec<Runs>,
    /// Whether any particle of the chunk has neighbours: most of a wall is far from everything.
    pub found: bool,
    /// Of a chunk of fluid: runs of particles, `[begin, end]` (the end is not in it), that were searched for fluids and rigid bodies.
    pub among: Vec<[u32; 2]>,
}

/// Positions in the order of the sort, axis by axis, so that runs of cells are packed by whole vectors. Written by
/// `cells`; a vector longer than the particles, as the last run may be read beyond its end.
#[derive(Clone, Debug, Default)]
pub struct Places {
    /// Positions (m).
    pub x: [Vec<f32>; 3],
    /// Volumes of bodies' particles (m^3), fewer bytes apart than in records.
    pub volume: Vec<f32>,
}

impl Places {
    /// Places for `n` particles.
    pub fn new(n: usize) -> Self {
        Self { x: std::array::from_fn(|_| vec![0.0; n + LANES]), volume: vec![0.0; n] }
    }
}

/// Candidates around one cell, in whole vectors.
#[derive(Default)]
struct Tile {
    x: [Vec<Block>; 3],
    index: Vec<Indices>,
    owner: Vec<Indices>,
    len: usize,
}

/// A tile per acting kind, and squared distances beside the list: scratch of a thread.
#[derive(Default)]
pub struct Scratch {
    tile: [Tile; Kind::COUNT],
    r_sq: Vec<Block>,
    /// Neighbours of a chunk of fluid, until they are transposed.
    pub rows: NeighbourChunk,
    /// Numbers around a chunk, see [`super::links::Links`].
    pub places: super::links::Table,
    /// Contacts of a chunk that are near.
    pub sifted: super::contacts::Sifted,
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
    /// Their positions, axis by axis.
    pub places: &'a Places,
    /// Owners of all particles.
    pub owner: &'a [u32],
    /// Where cells begin, kind by kind.
    pub cells: [&'a Cells; Kind::COUNT],
    /// First particle of each kind's segment.
    pub first: [usize; Kind::COUNT],
    /// Whether each body sleeps: its particles look for no neighbours.
    pub asleep: &'a [bool],
    /// Whether bodies' particles look for each other; else for fluids.
    pub contacts: bool,
    /// Whether pairs of rigid bodies are found once, from the particle of the first.
    pub once: bool,
    /// How far pairs reach (m): the support, or as far as contacts are looked for.
    pub reach: f32,
}

/// Which kinds act on a particle of kind `kind`: the table of [`crate::laws`]. Contacts of bodies have lists of their own.
fn acting(kind: Kind, contacts: bool) -> &'static [Kind] {
    match (kind, contacts) {
        (Kind::Fluid, _) => &[Kind::Fluid, Kind::Rigid, Kind::Static],
        (_, false) => &[Kind::Fluid],
        (Kind::Rigid, true) => &[Kind::Rigid, Kind::Static],
        (Kind::Static, true) => &[Kind::Rigid],
    }
}

impl NeighbourChunk {
    /// All runs, one after another.
    #[inline(always)]
    pub fn list(&self) -> &[u32] {
        &self.list[..self.used]
    }

    /// Finds the neighbours of the particles `members` (indices) of kind `kind`, and calls
    /// `each_cell(members of the cell, their runs, list, r_sq)` after each cell; list and squared distances (m^2; `H^2`
    /// in the padding) are those of the cell alone and begin with the cell's first run.
    #[inline(always)]
    pub fn find<S: Simd>(
        &mut self,
        simd: S,
        scratch: &mut Scratch,
        around: Around,
        kind: Kind,
        members: Range<usize>,
        mut each_cell: impl FnMut(Range<usize>, &[Runs], &[u32], &mut [Block]),
    ) {
        self.runs.clear();
        self.among.clear();
        self.found = false;
        let mut used = 0;
        let mut from = members.start;
        while from < members.end {
            let cell = around.grid.coordinates(around.records[from].x);
            let to = members.end.min(around.first[kind as usize] + around.cells[kind as usize].end(cell));
            let asleep = |i: usize| kind == Kind::Rigid && around.asleep[around.owner[i] as usize];
            let all_asleep = (from..to).all(asleep);
            let mut candidates = 0;
            for &k in if all_asleep { &[] } else { acting(kind, around.contacts) } {
                let mut rows = [Row::default(); 27];
                let rows = around.rows(k, cell, &mut rows);
                if kind == Kind::Fluid && k != Kind::Static {
                    self.note(rows);
                }
                scratch.tile[k as usize].pack(simd, &around, rows, (kind, k) == (Kind::Rigid, Kind::Rigid));
                candidates += padded(scratch.tile[k as usize].len);
            }
            let first_run = self.runs.len();
            if candidates == 0 {
                let none = Runs { begin: used as u32, count: [0; Kind::COUNT] };
                self.runs.resize(first_run + (to - from), none);
                from = to;
                continue;
            }
            self.found = true;
            let base = used;
            let room = (to - from) * (candidates + LANES) + LANES;
            if self.list.len() < base + room {
                let more = base + room - self.list.len();
                if self.list.capacity() < base + room {
                    self.list.reserve_exact(more + (base + room) / 8); // lists are most of a particle's memory
                }
                self.list.resize(base + room, 0);
            }
            if scratch.r_sq.len() * LANES < room {
                scratch.r_sq.resize(room.div_ceil(LANES), Block::default());
            }
            for i in from..to {
                let mut runs = Runs { begin: used as u32, count: [0; Kind::COUNT] };
                for &k in if asleep(i) { &[] } else { acting(kind, around.contacts) } {
                    let tile = &scratch.tile[k as usize];
                    if tile.len == 0 {
                        continue;
                    }
                    let whose = match (kind, k) {
                        (Kind::Rigid, Kind::Rigid) if around.once => Whose::Later(around.owner[i]),
                        (Kind::Rigid, Kind::Rigid) => Whose::Others(around.owner[i]),
                        _ => Whose::Anybody,
                    };
                    let limit = around.reach * around.reach;
                    let list = &mut self.list[used..];
                    let r_sq = &mut bytemuck::cast_slice_mut(&mut scratch.r_sq)[used - base..];
                    let n = near(simd, &tile.candidates(), around.records[i].x, limit, whose, i as u32, list, r_sq);
                    runs.count[k as usize] = n as u16;
                    used += padded(n);
                }
                self.runs.push(runs);
            }
            let r_sq = &mut scratch.r_sq[..(used - base) / LANES];
            each_cell(from..to, &self.runs[first_run..], &self.list[base..used], r_sq);
            from = to;
        }
        self.used = used;
    }

    /// Notes where was searched. Rows follow one another from cell to cell, so that most join one that is there.
    #[inline(always)]
    fn note(&mut self, rows: &[Row]) {
        for row in rows {
            let [begin, end] = [row.begin as u32, (row.begin + row.len) as u32];
            match self.among.iter_mut().find(|[from, to]| begin >= *from && begin <= *to) {
                Some([_, to]) => *to = end.max(*to),
                None => self.among.push([begin, end]),
            }
        }
    }
}

/// A run of particles that stands together in the sorted order, and how far to shift it (m).
#[derive(Clone, Copy, Default)]
struct Row {
    begin: usize,
    len: usize,
    shift: [f32; 3],
}

impl Tile {
    /// Packs rows of particles; periodic images are shifted into place.
    #[inline(always)]
    fn pack<S: Simd>(&mut self, simd: S, around: &Around, rows: &[Row], owners: bool) {
        self.len = 0;
        let room = rows.iter().map(|r| r.len).sum::<usize>().div_ceil(LANES) + 1;
        if rows.is_empty() {
            return;
        }
        if self.index.len() < room {
            self.x.iter_mut().for_each(|x| x.resize(room, Block::default()));
            self.index.resize(room, Indices::default());
            self.owner.resize(room, Indices::default());
        }
        let mut at = 0;
        for row in rows {
            pack(simd, &around.places.x, row.begin, row.shift, &mut self.x, &mut self.index, at, row.len);
            if owners {
                let owner: &mut [u32] = bytemuck::cast_slice_mut(&mut self.owner);
                owner[at..at + row.len].copy_from_slice(&around.owner[row.begin..row.begin + row.len]);
            }
            at += row.len;
        }
        // far points fill the last vector: never closer than the support
        bytemuck::cast_slice_mut::<_, f32>(&mut self.x[0])[at..padded(at)].fill(f32::MAX);
        self.len = at;
    }

    #[inline(always)]
    fn candidates(&self) -> Candidates<'_> {
        let blocks = self.len.div_ceil(LANES);
        Candidates {
            x: self.x.each_ref().map(|x| &x[..blocks]),
            index: &self.index[..blocks],
            owner: &self.owner[..blocks],
        }
    }
}

impl Around<'_> {
    /// The rows of kind `kind` in the 27 cells around `cell`.
    #[inline(always)]
    fn rows<'r>(&self, kind: Kind, cell: [i32; 3], rows: &'r mut [Row; 27]) -> &'r [Row] {
        let mut count = 0;
        let (grid, cells) = (self.grid, self.cells[kind as usize]);
        if !cells.are_near(grid, cell) {
            return &[];
        }
        let first = self.first[kind as usize];
        let mut add = |from: i32, to: i32, y: i32, z: i32, shift: [f32; 3]| {
            let run = cells.row(from, to, y, z);
            if !run.is_empty() {
                rows[count] = Row { begin: first + run.start, len: run.len(), shift };
                count += 1;
            }
        };
        let reach = |a: usize| if grid.cells[a] == 1 && grid.period[a] == 0.0 { 0..=0 } else { -1..=1 };
        for dz in reach(2) {
            let Some((z, shift_z)) = grid.image(2, cell[2] + dz) else { continue };
            for dy in reach(1) {
                let Some((y, shift_y)) = grid.image(1, cell[1] + dy) else { continue };
                let (low, high, last) = (cell[0] - 1, cell[0] + 1, grid.cells[0] - 1);
                add(low.max(0), high.min(last), y, z, [0.0, shift_y, shift_z]);
                let period = grid.period[0];
                if period > 0.0 && low < 0 {
                    add(last, last, y, z, [-period, shift_y, shift_z]);
                }
                if period > 0.0 && high > last {
                    add(0, 0, y, z, [period, shift_y, shift_z]);
                }
            }
        }
        &rows[..count]
    }
}
