//! Mesh to bits, slice by slice: the two rules.
//!
//! In: a [`Shape`], the mesh in lattice units. Out: a [`BitGrid`]. Every slice is filled by itself from the crossings
//! of its rows ([`super::raster`]), so the result is the same for any number of threads and any order of triangles.
//!
//! - [`parity`], the rule of the article: passing through the surface turns cells on, passing through again turns them
//!   off. A toggle is one XOR of a bit, and a running XOR along the row turns toggles into cells.
//! - [`winding`], the rule that forgives: signed crossings add up to the winding number, plus the part of the rim
//!   ([`super::rim`]) where the mesh is open; a cell is solid where the number is nearer to a whole number other than 0.

use std::sync::atomic::{AtomicI32, Ordering};

use rayon::prelude::*;

use super::bits::{BitGrid, set_run};
use super::raster::{Fixed, crossings, slices};
use super::rim::{Offset, Rim};

/// A mesh in lattice units, its triangles welded, without degenerate ones, and turned right side out.
#[derive(Default)]
pub(crate) struct Shape {
    pub vertices: Vec<Fixed>,
    pub triangles: Vec<[u32; 3]>,
}

impl Shape {
    pub fn corners(&self, t: u32) -> [Fixed; 3] {
        self.triangles[t as usize].map(|v| self.vertices[v as usize])
    }

    /// For every slice the triangles that pass through it: start indices and triangle indices.
    fn by_slice(&self, nz: u32) -> (Vec<u32>, Vec<u32>) {
        let mut start = vec![0u32; nz as usize + 2];
        let ranges = || (0..self.triangles.len() as u32).map(|t| (t, slices(self.corners(t), nz)));
        for (_, range) in ranges() {
            for k in range {
                start[k as usize + 2] += 1;
            }
        }
        for k in 2..start.len() {
            start[k] += start[k - 1];
        }
        let mut list = vec![0u32; start[nz as usize + 1] as usize];
        for (t, range) in ranges() {
            for k in range {
                let slot = &mut start[k as usize + 1];
                list[*slot as usize] = t;
                *slot += 1;
            }
        }
        start.pop();
        (start, list)
    }
}

/// Fills `grid` by parity. Returns the rows (slice · ny + row) that passed through the surface an odd number of times:
/// through a hole. Their cells are not to be trusted.
pub(crate) fn parity(shape: &Shape, grid: &mut BitGrid) -> Vec<u64> {
    let [nx, ny, nz] = grid.dims();
    let (start, list) = shape.by_slice(nz);
    let per_row = grid.row_words();
    let fill = |(k, slice): (usize, &mut [u64])| {
        let mut odd = vec![0u64; ny.div_ceil(64) as usize];
        for &t in &list[start[k] as usize..start[k + 1] as usize] {
            crossings(shape.corners(t), k as u32, ny, |j, i, _| {
                odd[j as usize / 64] ^= 1 << (j % 64);
                let i = i.max(0) as u64;
                if i < u64::from(nx) {
                    slice[j as usize * per_row + (i / 64) as usize] ^= 1 << (i % 64);
                }
            });
        }
        for row in slice.chunks_mut(per_row) {
            let mut carry = 0;
            for word in row.iter_mut() {
                *word = running_xor(*word) ^ carry;
                carry = if *word >> 63 == 1 { !0 } else { 0 };
            }
            if nx % 64 != 0 {
                row[per_row - 1] &= !0 >> (64 - nx % 64);
            }
        }
        let rows = odd.iter().zip(0..).flat_map(|(w, at)| super::bits::ones(*w).map(move |bit| at * 64 + bit));
        rows.map(|j| k as u64 * u64::from(ny) + u64::from(j)).collect::<Vec<_>>()
    };
    grid.par_slices().map(fill).flatten_iter().collect()
}

/// Bit n of the result is the XOR of bits 0 to n.
fn running_xor(mut word: u64) -> u64 {
    for shift in [1, 2, 4, 8, 16, 32] {
        word ^= word << shift;
    }
    word
}

/// Fills `grid` by winding number; with `only`, a sorted list of rows, just those. Returns the largest number of times
/// the surface goes round a cell: more than one where parts overlap.
pub(crate) fn winding(shape: &Shape, rim: &Rim, grid: &mut BitGrid, only: Option<&[u64]>) -> i32 {
    let [nx, ny, nz] = grid.dims();
    let parts = [shape, &rim.caps].map(|part| (part, part.by_slice(nz)));
    let per_row = grid.row_words();
    let most = AtomicI32::new(0);
    grid.par_slices().for_each(|(k, slice)| {
        let mut events = Vec::new();
        for ((part, (start, list)), cap) in parts.iter().zip([false, true]) {
            for &t in &list[start[k] as usize..start[k + 1] as usize] {
                crossings(part.corners(t), k as u32, ny, |j, i, up| {
                    let i = i.clamp(0, i64::from(nx)) as u32;
                    events.push(Crossing { j, i, up, cap });
                });
            }
        }
        events.sort_unstable();
        let mut rest = &events[..];
        let mut highest = 0;
        for (j, row) in slice.chunks_mut(per_row).enumerate() {
            let mine = rest.partition_point(|e| e.j == j as u32);
            let (here, after) = rest.split_at(mine);
            rest = after;
            if only.is_some_and(|rows| rows.binary_search(&(k as u64 * u64::from(ny) + j as u64)).is_err()) {
                continue;
            }
            row.fill(0);
            highest = highest.max(match rim.is_empty() {
                true => closed_row(here, row, nx),
                false => open_row(here, row, nx, |i, c| rim.offset([i, j as u32, k as u32], c)),
            });
        }
        most.fetch_max(highest, Ordering::Relaxed);
    });
    most.into_inner()
}

/// Where a row passes through a triangle.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Crossing {
    j: u32,
    /// The first cell beyond.
    i: u32,
    /// Whether the winding number rises there.
    up: bool,
    /// Whether the triangle is a cap of the rim's.
    cap: bool,
}

impl Crossing {
    fn step(&self) -> i32 {
        if self.up { 1 } else { -1 }
    }
}

/// The winding number is whole: a cell is solid where the crossings do not add up to zero.
fn closed_row(events: &[Crossing], row: &mut [u64], nx: u32) -> i32 {
    let (mut number, mut from, mut highest) = (0i32, 0, 0);
    for event in events {
        let at = event.i;
        if number != 0 {
            set_run(row, from, at);
            highest = highest.max(if at > from { number.abs() } else { 0 });
        }
        number += event.step();
        from = at;
    }
    if number != 0 {
        set_run(row, from, nx);
    }
    highest
}

/// The winding number is whole but for the rim's part, which is asked for as seldom as its bound allows.
fn open_row(events: &[Crossing], row: &mut [u64], nx: u32, offset: impl Fn(u32, i32) -> Offset) -> i32 {
    let (mut number, mut caps, mut next, mut at, mut highest) = (0, 0, 0, 0, 0);
    let pass = |upto: u32, next: &mut usize, number: &mut i32, caps: &mut i32| {
        while let Some(event) = events.get(*next).filter(|e| e.i <= upto) {
            *number += event.step();
            *caps += if event.cap { event.step() } else { 0 };
            *next += 1;
        }
    };
    while at < nx {
        pass(at, &mut next, &mut number, &mut caps);
        let rim = offset(at, caps);
        let outside = -rim.value.round() as i32;
        if (f64::from(number) + rim.value).abs() > 0.5 + 1e-9 {
            set_run(row, at, at + 1);
            highest = highest.max((number - outside).abs());
        }
        let end = at.saturating_add(rim.ahead).saturating_add(1).min(nx);
        at += 1;
        while at < end {
            pass(at, &mut next, &mut number, &mut caps);
            let to = events.get(next).map_or(end, |e| e.i.min(end));
            if number != outside {
                set_run(row, at, to);
                highest = highest.max((number - outside).abs());
            }
            at = to;
        }
    }
    highest
}
