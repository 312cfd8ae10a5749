//! Sixteen lanes: the only vector primitives the pair loops need besides plain loops `for l in 0..16`, which
//! the compiler turns into full-width instructions under run-time dispatch.
//!
//! The width is 16 on every machine, so that all of them add in the same order and give the same bits.
//!
//! The only file with `unsafe`: the two innermost loops of a step, the search and the gather, store and load at
//! places that depend on data. A bounds check for each costs a tenth of the stage; here room and indices are
//! asserted once for whole loops and whole vectors.
#![allow(unsafe_code)]

use crate::state::Record;
use bytemuck::{Pod, Zeroable};
use fearless_simd::prelude::*;
use fearless_simd::{f32x4, f32x8, f32x16, u32x16};

/// Lanes handled at once.
pub const LANES: usize = 16;
/// Sixteen numbers.
pub type Lanes = [f32; LANES];

/// Rounds a length up to whole vectors.
#[inline(always)]
pub fn padded(n: usize) -> usize {
    n.next_multiple_of(LANES)
}

/// Sixteen values on a cache line of their own: a load that straddles two lines costs twice.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C, align(64))]
pub struct Block(pub Lanes);

/// Sixteen indices, alike.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C, align(64))]
pub struct Indices(pub [u32; LANES]);

/// Copies `len` numbers of each axis from `begin` on, moved by its `shift`, to `at`, and where they came from to `index`: by whole
/// vectors, so that up to fifteen numbers beyond `len` are read and written.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn pack<S: Simd>(
    simd: S,
    from: &[Vec<f32>; 3],
    begin: usize,
    shift: [f32; 3],
    to: &mut [Vec<Block>; 3],
    index: &mut [Indices],
    at: usize,
    len: usize,
) {
    let (read, write) = (begin + padded(len), at + padded(len));
    assert!(from.iter().all(|x| read <= x.len()) && to.iter().all(|x| write <= LANES * x.len()));
    assert!(write <= LANES * index.len());
    // loops: the compiler calls a map, for the plain machine
    let (mut source, mut target) = ([std::ptr::null(); 3], [std::ptr::null_mut(); 3]);
    let mut by = [f32x16::splat(simd, 0.0); 3];
    for a in 0..3 {
        source[a] = from[a].as_ptr();
        target[a] = to[a].as_mut_ptr().cast::<f32>();
        by[a] = f32x16::splat(simd, shift[a]);
    }
    let index = index.as_mut_ptr().cast::<u32>();
    let mut next = u32x16::from_fn(simd, |l| l as u32) + u32x16::splat(simd, begin as u32);
    for k in (0..len).step_by(LANES) {
        // SAFETY: k + 16 <= padded(len), and the ends are asserted above
        unsafe {
            for a in 0..3 {
                let x = f32x16::load_array_ref(simd, &*source[a].add(begin + k).cast());
                (x + by[a]).store_array(&mut *target[a].add(at + k).cast());
            }
            next.store_array(&mut *index.add(at + k).cast());
        }
        next += u32x16::splat(simd, LANES as u32);
    }
}

/// Points to search, in whole vectors; all slices are equally long.
#[derive(Clone, Copy)]
pub struct Candidates<'a> {
    /// Positions (m), axis by axis.
    pub x: [&'a [Block]; 3],
    /// What is listed of a point that is near.
    pub index: &'a [Indices],
    /// Whose the points are.
    pub owner: &'a [Indices],
}

/// Appends to `list` the indices of the candidates closer to `x` than the root of `limit`, in their order, and to
/// `r_sq` their squared distances; fills up whole vectors with `pad` at the distance of the limit. Returns how many
/// are near. Points of the owner `not` are passed over. Both lists need room for all candidates and a vector more.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn near<S: Simd>(
    simd: S,
    candidates: &Candidates,
    x: [f32; 3],
    limit: f32,
    not: Option<u32>,
    pad: u32,
    list: &mut [u32],
    r_sq: &mut [f32],
) -> usize {
    let Candidates { x: [tile_x, tile_y, tile_z], index, owner } = *candidates;
    let room = LANES * (tile_x.len() + 1);
    assert!(list.len() >= room && r_sq.len() >= room);
    let (list, r_sq) = (list.as_mut_ptr(), r_sq.as_mut_ptr());
    let [x, y, z] = x.map(|c| f32x16::splat(simd, c));
    let limit = f32x16::splat(simd, limit);
    let mut n = 0;
    for ((((tile_x, tile_y), tile_z), index), owner) in tile_x.iter().zip(tile_y).zip(tile_z).zip(index).zip(owner) {
        let d_x = f32x16::load_array_ref(simd, &tile_x.0) - x;
        let d_y = f32x16::load_array_ref(simd, &tile_y.0) - y;
        let d_z = f32x16::load_array_ref(simd, &tile_z.0) - z;
        let r = d_x * d_x + d_y * d_y + d_z * d_z;
        let mut near = r.simd_lt(limit);
        if let Some(own) = not {
            near &= !u32x16::load_array_ref(simd, &owner.0).simd_eq(u32x16::splat(simd, own));
        }
        let index = u32x16::load_array_ref(simd, &index.0);
        // SAFETY: after k vectors n <= 16 k, and there is room for all of them and one more
        unsafe {
            simd.compress_u32x16(index, near).store_array(&mut *list.add(n).cast());
            simd.compress_f32x16(r, near).store_array(&mut *r_sq.add(n).cast());
        }
        n += simd.to_bitmask_mask32x16(near).count_ones() as usize;
    }
    // SAFETY: as above; this is the one more
    unsafe {
        u32x16::splat(simd, pad).store_array(&mut *list.add(n).cast());
        limit.store_array(&mut *r_sq.add(n).cast());
    }
    n
}

/// Sum of the lanes in a fixed order: halves onto each other. By hand, as the compiler would not unroll it.
#[inline(always)]
pub fn sum<S: Simd>(simd: S, a: &Lanes) -> f32 {
    let (low, high) = f32x16::load_array_ref(simd, a).split();
    let (low, high) = (low + high).split();
    let v = (low + high).to_array();
    (v[0] + v[2]) + (v[1] + v[3])
}

/// `a - b` lane by lane.
#[inline(always)]
pub fn minus<S: Simd>(simd: S, a: &Lanes, b: f32) -> Lanes {
    (f32x16::load_array_ref(simd, a) - f32x16::splat(simd, b)).to_array()
}

/// `x^2 + y^2 + z^2` lane by lane.
#[inline(always)]
pub fn squares<S: Simd>(simd: S, [x, y, z]: &[Lanes; 3]) -> Lanes {
    let [x, y, z] = [x, y, z].map(|c| f32x16::load_array_ref(simd, c));
    (x * x + y * y + z * z).to_array()
}

/// Values of particles, records unless said otherwise, and a list of indices into them, which are checked once for all.
#[derive(Clone, Copy)]
pub struct Listed<'a, T = Record> {
    values: &'a [T],
    list: &'a [u32],
}

/// Sixteen neighbours out of a checked list.
#[derive(Clone, Copy)]
pub struct Near<'a, T = Record> {
    values: &'a [T],
    /// Their indices.
    pub index: &'a [u32; LANES],
}

impl<'a, T> Listed<'a, T> {
    /// A list of whole vectors.
    ///
    /// # Panics
    /// If an index is not below the number of values: a defect of the search.
    #[inline(always)]
    pub fn new<S: Simd>(simd: S, values: &'a [T], list: &'a [u32]) -> Self {
        let mut largest = u32x16::splat(simd, 0);
        for block in list.as_chunks().0 {
            largest = largest.max(u32x16::load_array_ref(simd, block));
        }
        let inside = largest.simd_lt(u32x16::splat(simd, values.len() as u32));
        assert!(list.is_empty() || list.len().is_multiple_of(LANES) && simd.to_bitmask_mask32x16(inside) == 0xffff);
        Self { values, list }
    }

    /// Part of the list as it is.
    #[inline(always)]
    pub fn indices(self, run: std::ops::Range<usize>) -> &'a [u32] {
        &self.list[run]
    }

    /// Part of the list, vector by vector.
    #[inline(always)]
    pub fn run(self, run: std::ops::Range<usize>) -> impl Iterator<Item = Near<'a, T>> {
        self.list[run].as_chunks().0.iter().map(move |index| Near { values: self.values, index })
    }
}

/// Sixteen whole numbers of 16 bits each.
pub type Counts = [i16; LANES];

/// Sixteen neighbours of a particle and a vector to each: 160 bytes.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
struct Link {
    index: [u32; LANES],
    e: [Counts; 3],
}

/// Neighbours of a chunk of particles with a vector to each, kept while a solver iterates: one stream to read, which rounds wait for. So
/// the vectors are whole numbers of `unit`, the same for all particles, that those of both sides of a pair stay opposite.
#[derive(Clone, Debug, Default)]
pub struct Links {
    /// What a component of a vector counts (1/m).
    pub unit: f32,
    blocks: Vec<Link>,
    used: usize,
    /// Begin of a particle's blocks, end of those of fluids, end of all.
    spans: Vec<[u32; 3]>,
    largest: [u32; LANES],
}

impl Links {
    /// Forgets everything, and makes room for the links of a list so long, with vectors whose components are no larger than `largest`.
    #[inline(always)]
    pub fn clear(&mut self, list: usize, largest: f32) {
        if self.blocks.len() < list / LANES {
            self.blocks.resize(list / LANES, Link { index: [0; LANES], e: [[0; LANES]; 3] });
        }
        self.unit = largest / f32::from(i16::MAX);
        self.used = 0;
        self.spans.clear();
        self.largest = [0; LANES];
    }

    /// Begins the next particle.
    #[inline(always)]
    pub fn begin(&mut self) {
        self.spans.push([self.used as u32; 3]);
    }

    /// Ends the particle's fluids.
    #[inline(always)]
    pub fn end_fluids(&mut self) {
        if let Some(span) = self.spans.last_mut() {
            *span = [span[0], self.used as u32, self.used as u32];
        }
    }

    /// Ends the particle's neighbours.
    #[inline(always)]
    pub fn end(&mut self) {
        if let Some(span) = self.spans.last_mut() {
            span[2] = self.used as u32;
        }
    }

    /// Adds sixteen neighbours of the particle begun last.
    #[inline(always)]
    pub fn push<S: Simd>(&mut self, simd: S, index: &[u32; LANES], e: &[Counts; 3]) {
        self.largest = u32x16::load_array_ref(simd, &self.largest).max(u32x16::load_array_ref(simd, index)).to_array();
        self.blocks[self.used] = Link { index: *index, e: *e };
        self.used += 1;
    }

    /// The links together with values of all particles.
    ///
    /// # Panics
    /// If a neighbour has no value: a defect of the search.
    #[inline(always)]
    pub fn with<'a, T>(&'a self, values: &'a [T]) -> Linked<'a, T> {
        assert!(self.largest.iter().all(|&l| (l as usize) < values.len().max(1)));
        assert!(self.used == 0 || !values.is_empty());
        Linked { links: self, values }
    }
}

/// Links and values of the neighbours, which are checked to be there.
#[derive(Clone, Copy)]
pub struct Linked<'a, T> {
    links: &'a Links,
    values: &'a [T],
}

impl<'a, T> Linked<'a, T> {
    /// The fluids linked to particle `k` of the chunk, and the vectors to them.
    #[inline(always)]
    pub fn fluids(self, k: usize) -> impl Iterator<Item = (Near<'a, T>, &'a [Counts; 3])> {
        let [begin, end, _] = self.links.spans[k];
        self.blocks(begin, end)
    }

    /// All that are linked to particle `k` of the chunk.
    #[inline(always)]
    pub fn all(self, k: usize) -> impl Iterator<Item = (Near<'a, T>, &'a [Counts; 3])> {
        let [begin, _, end] = self.links.spans[k];
        self.blocks(begin, end)
    }

    #[inline(always)]
    fn blocks(self, begin: u32, end: u32) -> impl Iterator<Item = (Near<'a, T>, &'a [Counts; 3])> {
        let blocks = &self.links.blocks[begin as usize..end as usize];
        blocks.iter().map(move |b| (Near { values: self.values, index: &b.index }, &b.e))
    }
}

/// Added to a number, leaves its nearest whole number in the last bits.
const ROUND: f32 = 12_582_912.0;

/// How often `unit` (given by its inverse) goes into sixteen numbers, and what that many are.
#[inline(always)]
pub fn counted(x: &mut Lanes, unit: f32, inverse: f32) -> Counts {
    let mut counts = [0; LANES];
    let most = f32::from(i16::MAX);
    for l in 0..LANES {
        let shifted = (x[l] * inverse).clamp(-most, most) + ROUND;
        counts[l] = shifted.to_bits() as i16;
        x[l] = unit * (shifted - ROUND);
    }
    counts
}

/// Sixteen records side by side.
pub struct Transposed {
    /// Positions (m).
    pub x: [Lanes; 3],
    /// Rest volumes.
    pub volume: Lanes,
    /// Velocities (m/s).
    pub v: [Lanes; 3],
    /// Pressure shares (Pa).
    pub share: Lanes,
}

/// Loads sixteen records: 16 whole-record loads and three rounds of unzipping.
#[inline(always)]
pub fn gather<S: Simd>(simd: S, near: Near) -> Transposed {
    let r = [
        pair(simd, near, 0),
        pair(simd, near, 2),
        pair(simd, near, 4),
        pair(simd, near, 6),
        pair(simd, near, 8),
        pair(simd, near, 10),
        pair(simd, near, 12),
        pair(simd, near, 14),
    ];
    // component c = 4 c2 + 2 c1 + c0: the first round splits by c0, the second by c1, the third by c2
    let (a0, b0) = unzip(r[0], r[1]);
    let (a1, b1) = unzip(r[2], r[3]);
    let (a2, b2) = unzip(r[4], r[5]);
    let (a3, b3) = unzip(r[6], r[7]);
    let (c04, c26) = (unzip(a0, a1), unzip(a2, a3));
    let (c15, c37) = (unzip(b0, b1), unzip(b2, b3));
    let (c0, c4) = unzip(c04.0, c26.0);
    let (c2, c6) = unzip(c04.1, c26.1);
    let (c1, c5) = unzip(c15.0, c37.0);
    let (c3, c7) = unzip(c15.1, c37.1);
    Transposed {
        x: [c0.to_array(), c1.to_array(), c2.to_array()],
        volume: c3.to_array(),
        v: [c4.to_array(), c5.to_array(), c6.to_array()],
        share: c7.to_array(),
    }
}

/// Two records in one vector.
#[inline(always)]
fn pair<S: Simd>(simd: S, near: Near, k: usize) -> f32x16<S> {
    row(simd, near, k).combine(row(simd, near, k + 1))
}

#[inline(always)]
fn row<S: Simd>(simd: S, near: Near, k: usize) -> f32x8<S> {
    // SAFETY: `Listed::new` has compared the indices with the number of these very records
    let record = unsafe { near.values.get_unchecked(near.index[k] as usize) };
    f32x8::load_array_ref(simd, bytemuck::cast_ref::<Record, [f32; 8]>(record))
}

/// Loads sixteen numbers.
#[inline(always)]
pub fn gather_one(near: Near<f32>) -> Lanes {
    let mut out = [0.0; LANES];
    for l in 0..LANES {
        // SAFETY: `Listed::new` or `Links::with` has compared the indices with the number of these very values
        out[l] = unsafe { *near.values.get_unchecked(near.index[l] as usize) };
    }
    out
}

/// Loads sixteen vectors, whose fourth number is left out.
#[inline(always)]
pub fn gather_vectors<S: Simd>(simd: S, near: Near<[f32; 4]>) -> [Lanes; 3] {
    let r = [four(simd, near, 0), four(simd, near, 4), four(simd, near, 8), four(simd, near, 12)];
    let (a0, b0) = unzip(r[0], r[1]);
    let (a1, b1) = unzip(r[2], r[3]);
    let (x, z) = unzip(a0, a1);
    [x.to_array(), b0.unzip_low(b1).to_array(), z.to_array()]
}

/// Four vectors of four numbers in one.
#[inline(always)]
fn four<S: Simd>(simd: S, near: Near<[f32; 4]>, k: usize) -> f32x16<S> {
    // SAFETY: as above
    let row = |k: usize| unsafe { near.values.get_unchecked(near.index[k] as usize) };
    let pair = |k: usize| f32x4::load_array_ref(simd, row(k)).combine(f32x4::load_array_ref(simd, row(k + 1)));
    pair(k).combine(pair(k + 2))
}

/// Even and odd elements of two vectors on end.
#[inline(always)]
fn unzip<S: Simd>(a: f32x16<S>, b: f32x16<S>) -> (f32x16<S>, f32x16<S>) {
    (a.unzip_low(b), a.unzip_high(b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};

    #[test]
    fn counts_of_opposite_numbers_are_opposite() {
        let unit = 0.013;
        let numbers: Lanes = std::array::from_fn(|l| (l as f32 - 6.5) * 61.7);
        let (mut plus, mut minus) = (numbers, numbers.map(|x| -x));
        let (up, down) = (counted(&mut plus, unit, 1.0 / unit), counted(&mut minus, unit, 1.0 / unit));
        for l in 0..LANES {
            assert_eq!(up[l], -down[l]);
            assert_eq!(plus[l], -minus[l]);
            let most = f32::from(i16::MAX) * unit;
            let exact = numbers[l].clamp(-most, most);
            assert!((plus[l] - exact).abs() <= 0.5001 * unit, "{exact} became {}", plus[l]);
            assert_eq!(plus[l], unit * f32::from(up[l]));
        }
    }

    #[test]
    fn gather_transposes() {
        let records: Vec<Record> = (0..40)
            .map(|i| bytemuck::cast::<[f32; 8], Record>(std::array::from_fn(|c| (100 * i + c) as f32)))
            .collect();
        let list: [u32; LANES] = std::array::from_fn(|l| (l * 7 % 40) as u32);
        let t = dispatch!(Level::new(), simd => {
            let listed = Listed::new(simd, &records, &list);
            gather(simd, listed.run(0..LANES).next().unwrap())
        });
        for (l, &j) in list.iter().enumerate() {
            let r = records[j as usize];
            assert_eq!([t.x[0][l], t.x[1][l], t.x[2][l]], r.x);
            assert_eq!([t.v[0][l], t.v[1][l], t.v[2][l]], r.v);
            assert_eq!((t.volume[l], t.share[l]), (r.volume, r.share));
        }
    }
}
