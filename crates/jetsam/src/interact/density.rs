//! Stage `density`: neighbours of every particle, and `D = rho / rho_0` of the fluids (E1).
//!
//! In: sorted records. Out: neighbour runs; `density`. Volumes weigh the sum, so that walls, bodies and fluids of
//! any rest density stand in it side by side: `D_i = sum_j V_j W_ij`.

use super::lanes::{LANES, Lanes, sum};
use super::neighbours::{Around, NeighbourChunk, Runs, Scratch};
use crate::laws::kernel::Kernel;
use crate::model::Model;
use crate::scene::Coupling;
use crate::state::{Kind, Record};
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
    chunk: &mut NeighbourChunk,
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
    chunk.find(
        simd,
        scratch,
        around,
        Kind::Fluid,
        members,
        #[inline(always)]
        |cell, runs, list, r_sq, base| {
            for (i, runs) in cell.zip(runs) {
                let mut total = volume * sum_w(simd, kernel, inverse, r_sq, shifted(runs, Kind::Fluid, base));
                for &kind in bodies {
                    if runs.count(kind) > 0 {
                        total += sum_vw(simd, kernel, inverse, r_sq, list, runs.padded(kind), base, around.records);
                    }
                }
                density[i - start] = factor * total;
            }
        },
    );
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
    chunk.find(simd, scratch, around, kind, members, |_, _, _, _, _| {});
}

#[inline(always)]
fn shifted(runs: &Runs, kind: Kind, base: usize) -> Range<usize> {
    let r = runs.padded(kind);
    r.start - base..r.end - base
}

/// `sum w(s)` over a run of equal volumes.
#[inline(always)]
fn sum_w<S: Simd>(simd: S, kernel: Kernel, inverse: f32, r_sq: &[f32], run: Range<usize>) -> f32 {
    let mut total: Lanes = [0.0; LANES];
    for block in r_sq[run].as_chunks::<LANES>().0 {
        let w = weights(kernel, inverse, block);
        for l in 0..LANES {
            total[l] += w[l];
        }
    }
    sum(simd, &total)
}

/// `sum V_j w(s)` over a run.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn sum_vw<S: Simd>(
    simd: S,
    kernel: Kernel,
    inverse: f32,
    r_sq: &[f32],
    list: &[u32],
    run: Range<usize>,
    base: usize,
    records: &[Record],
) -> f32 {
    let mut total: Lanes = [0.0; LANES];
    let blocks = list[run.clone()].as_chunks::<LANES>().0;
    for (block, j) in r_sq[run.start - base..run.end - base].as_chunks::<LANES>().0.iter().zip(blocks) {
        let w = weights(kernel, inverse, block);
        for l in 0..LANES {
            total[l] += w[l] * records[j[l] as usize].volume;
        }
    }
    sum(simd, &total)
}

/// `w(s)` of sixteen squared distances.
#[inline(always)]
pub fn weights(kernel: Kernel, inverse: f32, r_sq: &Lanes) -> Lanes {
    let mut s = [0.0; LANES];
    for l in 0..LANES {
        s[l] = r_sq[l].sqrt() * inverse;
    }
    each_lane(
        kernel,
        &s,
        #[inline(always)]
        |k, s| k.w(s),
    )
}

/// A kernel function on sixteen lanes: the choice of kernel is made outside the lane loop.
#[inline(always)]
pub fn each_lane(kernel: Kernel, s: &Lanes, f: impl Fn(Kernel, f32) -> f32) -> Lanes {
    macro_rules! lanes {
        ($kernel:expr) => {{
            let mut out = [0.0; LANES];
            for l in 0..LANES {
                out[l] = f($kernel, s[l]);
            }
            out
        }};
    }
    match kernel {
        Kernel::Cubic => lanes!(Kernel::Cubic),
        Kernel::WendlandC2 => lanes!(Kernel::WendlandC2),
        Kernel::WendlandC4 => lanes!(Kernel::WendlandC4),
        Kernel::Quintic => lanes!(Kernel::Quintic),
        Kernel::Poly6 => lanes!(Kernel::Poly6),
        Kernel::Spiky => lanes!(Kernel::Spiky),
        Kernel::Viscosity => lanes!(Kernel::Viscosity),
    }
}
