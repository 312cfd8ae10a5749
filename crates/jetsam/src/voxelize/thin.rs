//! Solids that are mostly surface: plates thinner than a cell, and hollow shells.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::DVec3;
use rayon::prelude::*;

use super::bits::BitGrid;
use super::fill::Shape;
use super::rim::in_cells;

/// Adds the cells the surface touches wherever the solid is thinner than two cells, so that no plate is lost or torn.
///
/// Thick is what a block of 2x2x2 solid cells covers. Touched cells with a thick cell among their 26 neighbours are left
/// out: a body of two cells and more stays as it is, but for its sharpest corners. Where thin meets thick, two more
/// rings of touched cells join them.
pub(super) fn rescue(shape: &Shape, solid: &mut BitGrid) {
    let touched = touched(shape, solid.dims());
    let ring: Vec<_> = (-1..=1).flat_map(|k| (-1..=1).map(move |j| (j, k, 1))).collect();
    let mut added = thick(solid).dilated(&ring, false);
    added.combine(&touched, |near, touched| touched & !near);
    for _ in 0..2 {
        added = added.dilated(&ring, false);
        added.combine(&touched, |a, b| a & b);
    }
    solid.combine(&added, |a, b| a | b);
}

/// Keeps the solid cells whose centre lies within `thickness` cells of the surface: those with an empty cell no farther
/// than half a cell more. Cost: rows of the grid times thickness squared.
pub(super) fn hollow(solid: &mut BitGrid, thickness: f64) {
    let radius = thickness + 0.5;
    let most = solid.dims().into_iter().max().unwrap_or(0) as f64;
    if radius >= most {
        return;
    }
    // One row beyond the grid stands for all rows beyond it.
    let [_, rows, slices] = solid.dims().map(|n| n.min(radius as u32) as i32);
    let mut reach = Vec::new();
    for dk in -slices..=slices {
        for dj in -rows..=rows {
            let left = radius * radius - f64::from(dj).powi(2) - f64::from(dk).powi(2);
            if left >= 0.0 {
                reach.push((dj, dk, left.sqrt() as u32));
            }
        }
    }
    let mut empty = solid.clone();
    empty.invert();
    let near = empty.dilated(&reach, true);
    solid.combine(&near, |a, b| a & b);
}

/// The cells covered by blocks of 2x2x2 solid cells.
fn thick(solid: &BitGrid) -> BitGrid {
    let [_, ny, nz] = solid.dims();
    let per_row = solid.row_words();
    let mut out = BitGrid::new(solid.dims());
    // Bit i of a block row: cells i and i+1 of rows j, j+1 and slices k, k+1 are all solid.
    let block = |w: usize, j: u32, k: u32| {
        let square = |w: usize| {
            let rows = [(j, k), (j + 1, k), (j, k + 1), (j + 1, k + 1)];
            rows.iter().fold(!0, |all, &(j, k)| all & solid.row(j, k)[w])
        };
        let here = square(w);
        let next = if w + 1 < per_row { square(w + 1) } else { 0 };
        here & (here >> 1 | next << 63)
    };
    out.par_slices().for_each(|(k, slice)| {
        for (j, row) in slice.chunks_mut(per_row).enumerate() {
            for (w, word) in row.iter_mut().enumerate() {
                for (dj, dk) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    let (Some(j), Some(k)) = ((j as u32).checked_sub(dj), (k as u32).checked_sub(dk)) else {
                        continue;
                    };
                    if j + 1 < ny && k + 1 < nz {
                        let here = block(w, j, k);
                        let before = if w > 0 { block(w - 1, j, k) } else { 0 };
                        *word |= here | here << 1 | before >> 63;
                    }
                }
            }
        }
    });
    out
}

/// All cells whose cube touches a triangle. Cost: the cells in the box around each triangle.
fn touched(shape: &Shape, dims: [u32; 3]) -> BitGrid {
    let grid = BitGrid::new(dims);
    let words: Vec<AtomicU64> = grid.words().iter().map(|_| AtomicU64::new(0)).collect();
    let (per_row, per_slice) = (grid.row_words(), grid.slice_words());
    (0..shape.triangles.len() as u32).into_par_iter().for_each(|t| {
        let t = shape.corners(t).map(in_cells);
        let (lo, hi) = (t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2]));
        let range = |axis: usize| {
            let last = i64::from(dims[axis]) - 1;
            let first = ((lo[axis] - 0.5).ceil() as i64).clamp(0, last);
            first..=((hi[axis] + 0.5).floor() as i64).clamp(0, last)
        };
        for k in range(2) {
            for j in range(1) {
                for i in range(0) {
                    if touches(t.map(|v| v - DVec3::new(i as f64, j as f64, k as f64))) {
                        let word = k as usize * per_slice + j as usize * per_row + i as usize / 64;
                        words[word].fetch_or(1 << (i % 64), Ordering::Relaxed);
                    }
                }
            }
        }
    });
    let mut grid = grid;
    grid.set_words(words.into_iter().map(AtomicU64::into_inner));
    grid
}

/// Whether a triangle touches the cube of side 1 about the origin (separating axes; Akenine-Möller 2001). The cube is
/// closed and a hair larger, so that touching counts.
fn touches(t: [DVec3; 3]) -> bool {
    let half = 0.5 + 1e-9;
    let edges = [t[1] - t[0], t[2] - t[1], t[0] - t[2]];
    let normal = edges[0].cross(edges[1]);
    let apart = |axis: DVec3| {
        let [a, b, c] = t.map(|v| v.dot(axis));
        let radius = half * axis.abs().element_sum() + 1e-12;
        a.min(b).min(c) > radius || a.max(b).max(c) < -radius
    };
    let crossed = edges.iter().flat_map(|e| [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis.cross(*e)));
    !([DVec3::X, DVec3::Y, DVec3::Z, normal].into_iter().chain(crossed).any(apart))
}
