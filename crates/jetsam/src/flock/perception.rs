//! Which agents others look at: cells for agents, and the runs of candidates around a row of cells.
//!
//! In: agents in the order of cells. Out: runs of them, whose periodic images are shifted into place.

use crate::interact::CHUNK;
use crate::interact::cells::{Cells, Grid};
use crate::state::Record;
use rayon::prelude::*;
use std::ops::Range;

/// Most cells per agent: where agents are thin, cells grow.
const CELLS_PER_AGENT: f64 = 4.0;

/// Cells for agents: periodic axes as the domain's, the others about the agents, wherever they are; at least `width` wide (m).
pub fn grid_about(domain: &Grid, records: &[Record], dimensions: u32, width: [f64; 3]) -> Grid {
    let (low, high) = if domain.period.iter().all(|p| *p > 0.0) { ([0.0; 3], [0.0; 3]) } else { ends(records) };
    let mut grid = domain.clone();
    let length: [f64; 3] = std::array::from_fn(|a| match grid.period[a] {
        p if p > 0.0 => f64::from(p),
        _ if dimensions == 2 && a == 1 => 0.0,
        _ => f64::from((high[a] - low[a]).max(0.0)),
    });
    let most = CELLS_PER_AGENT * records.len() as f64 + 64.0;
    let mut width = width;
    let counts = |width: [f64; 3]| -> [f64; 3] {
        std::array::from_fn(|a| {
            let count = length[a] / width[a];
            if grid.period[a] > 0.0 { count.floor() } else { count.ceil() }.max(1.0)
        })
    };
    while counts(width).iter().product::<f64>() > most {
        width = width.map(|w| 1.25 * w);
    }
    let counts = counts(width);
    for a in 0..3 {
        grid.cells[a] = counts[a] as i32;
        if grid.period[a] == 0.0 {
            grid.origin[a] = if low[a].is_finite() { low[a] } else { 0.0 };
            grid.inverse[a] = (1.0 / width[a]) as f32;
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

/// A run of agents in the sorted order, and what brings them into place (m).
pub type Around = (Range<usize>, [f32; 3]);

/// The agents of a flock in the cells up to `far` cells from those between `from` and `to`, which are of one row. `first` is the flock's
/// first agent.
#[inline(always)]
pub fn around(
    grid: &Grid,
    cells: &Cells,
    first: usize,
    from: [i32; 3],
    to: i32,
    far: [i32; 3],
    runs: &mut Vec<Around>,
) {
    runs.clear();
    let last = grid.cells[0] - 1;
    let reach = |a: usize, to: i32| match grid.period[a] > 0.0 {
        true => (from[a] - far[a], to + far[a]),
        false => ((from[a] - far[a]).max(0), (to + far[a]).min(grid.cells[a] - 1)),
    };
    let ((x0, x1), (y0, y1), (z0, z1)) = (reach(0, to), reach(1, from[1]), reach(2, from[2]));
    // cells of a row are one run, or two or three where it passes a periodic side
    let parts = [(x0, x1.min(-1)), (x0.max(0), x1.min(last)), (x0.max(last + 1), x1)];
    for (z, shift_z) in (z0..=z1).filter_map(|c| grid.image(2, c)) {
        for (y, shift_y) in (y0..=y1).filter_map(|c| grid.image(1, c)) {
            for (x0, x1) in parts {
                if x0 > x1 {
                    continue;
                }
                let (Some((x0, shift_x)), Some((x1, _))) = (grid.image(0, x0), grid.image(0, x1)) else { continue };
                let row = cells.row(x0, x1, y, z);
                if !row.is_empty() {
                    runs.push((first + row.start..first + row.end, [shift_x, shift_y, shift_z]));
                }
            }
        }
    }
}
