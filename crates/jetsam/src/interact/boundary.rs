//! Stage `boundary`: the pressure the fluid shows to particles of bodies and walls (E17; Adami et al. 2012).
//!
//! In: neighbour runs of bodies' particles, pressure shares of fluids. Out: pressure shares of bodies' particles,
//! extrapolated from the fluid around with the weight of the layer between, and never negative.

use super::lanes::{LANES, Lanes, gather, sum};
use super::neighbours::NeighbourChunk;
use super::{density::weights, forces::wrap_lanes};
use crate::laws::fluid;
use crate::model::Model;
use crate::scene::PressureForce;
use crate::state::{Kind, Record};
use fearless_simd::Simd;

/// Pressure shares of a chunk of bodies' particles. `records` are all particles; `first` is the chunk's first.
#[inline(always)]
pub fn chunk<S: Simd>(
    simd: S,
    model: &Model,
    records: &[Record],
    owner: &[u32],
    first: usize,
    chunk: &NeighbourChunk,
    share: &mut [f32],
) {
    let kernel = model.kernel.density();
    let inverse = model.inverse_support();
    let limit = (model.support * model.support) as f32;
    let pull = match model.solver.pressure_force {
        PressureForce::Symmetric => model.gravity_f32(),
        PressureForce::Mueller => 0.5 * model.gravity_f32(), // its shares are half pressures
    };
    for (k, (runs, share)) in chunk.runs.iter().zip(share).enumerate() {
        *share = 0.0;
        if runs.count(Kind::Fluid) == 0 {
            continue;
        }
        let own = &records[first + k];
        let (mut total, mut weight): (Lanes, Lanes) = ([0.0; LANES], [0.0; LANES]);
        for list in chunk.list()[runs.padded(Kind::Fluid)].as_chunks::<LANES>().0 {
            let other = gather(simd, records, list);
            let (d, mut r_sq) = wrap_lanes(model, own.x, &other.x);
            for l in 0..LANES {
                // padding names the particle itself: it goes where W is zero
                r_sq[l] = if list[l] as usize == first + k { limit } else { r_sq[l] };
            }
            let w = weights(kernel, inverse, &r_sq);
            let rho: Lanes = if model.fluids.len() == 1 {
                [model.fluids[0].density; LANES]
            } else {
                std::array::from_fn(|l| model.fluids.get(owner[list[l] as usize] as usize).map_or(0.0, |f| f.density))
            };
            for l in 0..LANES {
                // from the fluid particle to this one: -d
                let pull_dot_d = -(pull.x * d[0][l] + pull.y * d[1][l] + pull.z * d[2][l]);
                total[l] += w[l] * fluid::pressure_at_boundary(other.share[l], rho[l], pull_dot_d);
                weight[l] += w[l];
            }
        }
        let weight = sum(simd, &weight);
        if weight > 0.0 {
            *share = (sum(simd, &total) / weight).max(0.0);
        }
    }
}
