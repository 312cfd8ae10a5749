//! Stage `density`: neighbours of every particle, and `D = rho / rho_0` of the fluids (E1).
//!
//! In: sorted records. Out: neighbour runs; `density`. Volumes weigh the sum, so that walls, bodies and fluids of
//! any rest density stand in it side by side: `D_i = sum_j V_j W_ij`.

use super::lanes::{Block, LANES, Lanes, sum};
use super::neighbours::{Around, NeighbourChunk, Scratch};
use super::slices::Slices;
use crate::laws::fluid;
use crate::laws::kernel::{Kernel, each_kernel};
use crate::model::Model;
use crate::scene::Coupling;
use crate::state::Kind;
use fearless_simd::Simd;
use std::ops::Range;

/// Neighbours of a chunk of fluid particles, and their densities.
#[inline(always)]
pub fn fluid_chunk<S: Simd>(
    simd: S,
    scratch: &mut Scratch,
    model: &Model,
    around: Around,
    members: Range<usize>,
    slices: &mut Slices,
    density: &mut [f32],
) {
    let kernel = model.kernel.density();
    let factor = model.factors.w;
    let volume = model.volume as f32;
    let inverse = model.inverse_support();
    let bodies: &[Kind] = match model.solver.coupling {
        Coupling::Pressure => &[Kind::Rigid, Kind::Static],
        Coupling::Spring => &[Kind::Static],
    };
    let start = members.start;
    let mut rows = std::mem::take(&mut scratch.rows);
    rows.find(
        simd,
        scratch,
        around,
        Kind::Fluid,
        members,
        #[inline(always)]
        |cell, runs, list, r_sq| {
            weigh(kernel, inverse, bytemuck::cast_slice_mut(r_sq));
            let (w, list) = (&*r_sq, list.as_chunks::<LANES>().0);
            let base = runs[0].padded(Kind::Fluid).start;
            for (i, runs) in cell.zip(runs) {
                let run = |kind| {
                    let run = runs.padded(kind);
                    (run.start - base) / LANES..(run.end - base) / LANES
                };
                let mut total = volume * sum_w(simd, &w[run(Kind::Fluid)]);
                for &kind in bodies {
                    if runs.count(kind) > 0 {
                        total += sum_vw(simd, &w[run(kind)], &list[run(kind)], &around.places.volume);
                    }
                }
                density[i - start] = factor * total;
            }
        },
    );
    slices.set(simd, &rows, start);
    scratch.rows = rows;
}

/// Neighbours of a chunk of bodies' particles.
#[inline(always)]
pub fn body_chunk<S: Simd>(
    simd: S,
    scratch: &mut Scratch,
    around: Around,
    kind: Kind,
    members: Range<usize>,
    chunk: &mut NeighbourChunk,
) {
    chunk.find(simd, scratch, around, kind, members, |_, _, _, _| {});
}

/// Sums of fluids that remember what theirs lacked become densities. `memory` is `[D, 0]` of a particle that begins with `D`, and then
/// `[what its sum lacked, 1]`.
pub fn remember(density: &mut [f32], memory: &mut [[f32; 2]]) {
    for (d, memory) in density.iter_mut().zip(memory) {
        if memory[1] == 0.0 {
            *memory = [fluid::lacking(memory[0], *d), 1.0];
        }
        *d += memory[0];
    }
}

/// Squared distances become `w(s)`, in one flat loop: of short loops over sixteen lanes the compiler makes scalars.
#[inline(always)]
pub fn weigh(kernel: Kernel, inverse: f32, r_sq: &mut [f32]) {
    each_kernel!(kernel, K => {
        for r in r_sq {
            *r = K.w(r.sqrt() * inverse);
        }
    });
}

/// `sum w(s)` over a run of equal volumes.
#[inline(always)]
fn sum_w<S: Simd>(simd: S, w: &[Block]) -> f32 {
    let mut total: Lanes = [0.0; LANES];
    for w in w {
        for l in 0..LANES {
            total[l] += w.0[l];
        }
    }
    sum(simd, &total)
}

/// `sum V_j w(s)` over a run.
#[inline(always)]
fn sum_vw<S: Simd>(simd: S, w: &[Block], list: &[[u32; LANES]], volume: &[f32]) -> f32 {
    let mut total: Lanes = [0.0; LANES];
    for (w, j) in w.iter().zip(list) {
        for l in 0..LANES {
            total[l] += w.0[l] * volume[j[l] as usize];
        }
    }
    sum(simd, &total)
}

/// `w(s)` of sixteen squared distances.
#[inline(always)]
pub fn weights(kernel: Kernel, inverse: f32, r_sq: &Lanes) -> Lanes {
    let mut w = *r_sq;
    weigh(kernel, inverse, &mut w);
    w
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a sum lacked at first is added to every later one; what it had too much is not taken off.
    #[test]
    fn lack_is_remembered_but_not_excess() {
        let mut memory = [[1.0, 0.0], [1.0, 0.0], [0.75, 0.0], [0.0, 1.0]];
        let mut density = [0.5, 1.25, 0.5, 0.5];
        remember(&mut density, &mut memory);
        assert_eq!(density, [1.0, 1.25, 0.75, 0.5]);
        density = [0.75, 1.0, 0.25, 1.0];
        remember(&mut density, &mut memory);
        assert_eq!(density, [1.25, 1.0, 0.5, 1.0]);
    }
}
