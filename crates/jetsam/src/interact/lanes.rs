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
use fearless_simd::{f32x8, f32x16, u32x16};

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

/// Whose points are searched.
#[derive(Clone, Copy)]
pub enum Whose {
    /// All.
    Anybody,
    /// Those of any but this owner.
    Others(u32),
    /// Those of owners after this one.
    Later(u32),
}

/// Appends to `list` the indices of the candidates of `whose` owners closer to `x` than the root of `limit`, in their order, and to
/// `r_sq` their squared distances; fills up whole vectors with `pad` at the distance of the limit. Returns how many
/// are near. Both lists need room for all candidates and a vector more.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn near<S: Simd>(
    simd: S,
    candidates: &Candidates,
    x: [f32; 3],
    limit: f32,
    whose: Whose,
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
        match whose {
            Whose::Anybody => {}
            Whose::Others(own) => near &= !u32x16::load_array_ref(simd, &owner.0).simd_eq(u32x16::splat(simd, own)),
            Whose::Later(own) => near &= u32x16::load_array_ref(simd, &owner.0).simd_gt(u32x16::splat(simd, own)),
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

/// Sixteen numbers from `at` on; lanes beyond the end are 0.
#[inline(always)]
pub fn load<S: Simd>(simd: S, from: &[f32], at: usize) -> f32x16<S> {
    let mut part = [0.0; LANES];
    match from[at..].first_chunk() {
        Some(full) => return f32x16::load_array_ref(simd, full),
        None => part.iter_mut().zip(&from[at..]).for_each(|(lane, x)| *lane = *x),
    }
    f32x16::load_array(simd, part)
}

/// Stores sixteen numbers from `at` on; lanes beyond the end are left out.
#[inline(always)]
pub fn store<S: Simd>(x: f32x16<S>, to: &mut [f32], at: usize) {
    match to[at..].first_chunk_mut() {
        Some(full) => x.store_array(full),
        None => to[at..].iter_mut().zip(x.to_array()).for_each(|(x, lane)| *x = lane),
    }
}

/// Sixteen vectors of four numbers, axis by axis.
#[inline(always)]
pub fn axes<S: Simd>([r0, r1, r2, r3]: [f32x16<S>; 4]) -> [f32x16<S>; 4] {
    let (xz0, y0) = (r0.unzip_low(r1), r0.unzip_high(r1));
    let (xz1, y1) = (r2.unzip_low(r3), r2.unzip_high(r3));
    [xz0.unzip_low(xz1), y0.unzip_low(y1), xz0.unzip_high(xz1), y0.unzip_high(y1)]
}

/// The reverse of [`axes`] for vectors of three numbers: the fourth is 0.
#[inline(always)]
pub fn vectors<S: Simd>(simd: S, [x, y, z]: [f32x16<S>; 3]) -> [f32x16<S>; 4] {
    let zero = f32x16::splat(simd, 0.0);
    let (xz0, xz1) = (x.zip_low(z), x.zip_high(z));
    let (y0, y1) = (y.zip_low(zero), y.zip_high(zero));
    [xz0.zip_low(y0), xz0.zip_high(y0), xz1.zip_low(y1), xz1.zip_high(y1)]
}

/// `a - b` lane by lane.
#[inline(always)]
pub fn minus<S: Simd>(simd: S, a: &Lanes, b: &Lanes) -> Lanes {
    (f32x16::load_array_ref(simd, a) - f32x16::load_array_ref(simd, b)).to_array()
}

/// `x^2 + y^2 + z^2` lane by lane.
#[inline(always)]
pub fn squares<S: Simd>(simd: S, [x, y, z]: &[Lanes; 3]) -> Lanes {
    let [x, y, z] = [x, y, z].map(|c| f32x16::load_array_ref(simd, c));
    (x * x + y * y + z * z).to_array()
}

/// Sixteen neighbours, by their indices.
#[derive(Clone, Copy)]
pub struct Near<'a> {
    /// Records of all particles.
    pub records: &'a [Record],
    /// Which of them.
    pub index: &'a [u32; LANES],
}

/// A list of neighbours in whole vectors, one vector after another.
#[inline(always)]
pub fn listed<'a>(records: &'a [Record], list: &'a [u32]) -> impl Iterator<Item = Near<'a>> {
    list.as_chunks().0.iter().map(move |index| Near { records, index })
}

/// Transposes sixteen rows of sixteen numbers: four perfect shuffles of the upper eight rows into the lower.
#[inline(always)]
pub fn transpose<S: Simd>(simd: S, rows: &mut [Indices; LANES]) {
    let mut from = [u32x16::splat(simd, 0); LANES];
    for k in 0..LANES {
        from[k] = u32x16::load_array_ref(simd, &rows[k].0);
    }
    for _ in 0..4 {
        let mut to = from;
        for k in 0..LANES / 2 {
            to[2 * k] = from[k].zip_low(from[k + LANES / 2]);
            to[2 * k + 1] = from[k].zip_high(from[k + LANES / 2]);
        }
        from = to;
    }
    for k in 0..LANES {
        from[k].store_array(&mut rows[k].0);
    }
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
///
/// # Panics
/// If there are not so many records: a defect of the search.
#[inline(always)]
pub fn gather<S: Simd>(simd: S, near: Near) -> Transposed {
    let inside = u32x16::load_array_ref(simd, near.index).simd_lt(u32x16::splat(simd, near.records.len() as u32));
    assert!(simd.to_bitmask_mask32x16(inside) == 0xffff);
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
    // SAFETY: `gather`, the only caller, has compared the indices with the number of records
    let record = unsafe { near.records.get_unchecked(near.index[k] as usize) };
    f32x8::load_array_ref(simd, bytemuck::cast_ref::<Record, [f32; 8]>(record))
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
    fn gather_transposes() {
        let records: Vec<Record> = (0..40)
            .map(|i| bytemuck::cast::<[f32; 8], Record>(std::array::from_fn(|c| (100 * i + c) as f32)))
            .collect();
        let list: [u32; LANES] = std::array::from_fn(|l| (l * 7 % 40) as u32);
        let t = dispatch!(Level::new(), simd => {
            gather(simd, Near { records: &records, index: &list })
        });
        for (l, &j) in list.iter().enumerate() {
            let r = records[j as usize];
            assert_eq!([t.x[0][l], t.x[1][l], t.x[2][l]], r.x);
            assert_eq!([t.v[0][l], t.v[1][l], t.v[2][l]], r.v);
            assert_eq!((t.volume[l], t.share[l]), (r.volume, r.share));
        }
    }

    #[test]
    fn rows_become_columns() {
        let mut rows: [Indices; LANES] =
            std::array::from_fn(|r| Indices(std::array::from_fn(|c| (100 * r + c) as u32)));
        dispatch!(Level::new(), simd => transpose(simd, &mut rows));
        for r in 0..LANES {
            for c in 0..LANES {
                assert_eq!(rows[r].0[c], (100 * c + r) as u32);
            }
        }
    }

    #[test]
    #[should_panic]
    fn nothing_is_read_beyond_the_records() {
        let records = [Record::default(); 20];
        let mut list = [3; LANES];
        list[11] = 20;
        dispatch!(Level::new(), simd => gather(simd, Near { records: &records, index: &list }));
    }

    #[test]
    fn vectors_and_axes_are_each_others_reverse() {
        let x: [Lanes; 3] = std::array::from_fn(|a| std::array::from_fn(|l| (100 * a + l) as f32));
        dispatch!(Level::new(), simd => {
            let rows = vectors(simd, x.map(|c| f32x16::load_array(simd, c)));
            for l in 0..LANES {
                assert_eq!(rows[l / 4].to_array()[4 * (l % 4)..][..4], [x[0][l], x[1][l], x[2][l], 0.0]);
            }
            assert_eq!(axes(rows).map(|c| c.to_array()), [x[0], x[1], x[2], [0.0; LANES]]);
        });
    }

    #[test]
    fn what_is_beyond_the_end_is_zero_and_stays() {
        let numbers: Vec<f32> = (1..=20).map(|i| i as f32).collect();
        let mut out = vec![0.0; 20];
        dispatch!(Level::new(), simd => {
            for at in [0, 16] {
                store(load(simd, &numbers, at), &mut out, at);
            }
            assert_eq!(load(simd, &numbers, 16).to_array()[3..6], [20.0, 0.0, 0.0]);
        });
        assert_eq!(out, numbers);
    }
}
