//! Stage `density`: neighbours of every particle, and `D = rho / rho_0` of the fluids (E1).
//!
//! In: sorted records. Out: neighbour runs; `density`. Volumes weigh the sum, so that walls, bodies and fluids of
//! any rest density stand in it side by side: `D_i = sum_j V_j W_ij`.

use super::lanes::{Block, LANES, Lanes, sum};
use super::neighbours::{Around, NeighbourChunk, Scratch};
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
                        total += sum_vw(simd, &w[run(kind)], &list[run(kind)], around.records);
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
    chunk.find(simd, scratch, around, kind, members, |_, _, _, _| {});
}

/// Squared distances become `w(s)`. One flat loop for each kernel: of short loops over sixteen lanes the compiler
/// makes scalars.
#[inline(always)]
fn weigh(kernel: Kernel, inverse: f32, r_sq: &mut [f32]) {
    macro_rules! flat {
        ($($kernel:ident),*) => {
            match kernel {
                $(Kernel::$kernel => {
                    for r in r_sq {
                        *r = Kernel::$kernel.w(r.sqrt() * inverse);
                    }
                })*
            }
        };
    }
    flat!(Cubic, WendlandC2, WendlandC4, Quintic, Poly6, Spiky, Viscosity)
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
fn sum_vw<S: Simd>(simd: S, w: &[Block], list: &[[u32; LANES]], records: &[Record]) -> f32 {
    let mut total: Lanes = [0.0; LANES];
    for (w, j) in w.iter().zip(list) {
        for l in 0..LANES {
            total[l] += w.0[l] * records[j[l] as usize].volume;
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
