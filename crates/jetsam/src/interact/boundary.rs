//! Stage `boundary`: the pressure the fluid shows to particles of bodies and walls (E17; Adami et al. 2012).
//!
//! In: neighbour runs of bodies' particles, pressure shares of fluids. Out: pressure shares of bodies' particles,
//! extrapolated from the fluid around with the weight of the layer between, and never negative unless pressures may be;
//! where walls do not slip, the velocity they show to viscosity: the fluid's, mirrored at the wall.

use super::lanes::{LANES, Lanes, Listed, gather, sum};
use super::neighbours::NeighbourChunk;
use super::pairs::wrap_lanes;
use crate::laws::fluid;
use crate::laws::kernel::each_kernel;
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
    mirror: &mut [[f32; 4]],
) {
    let kernel = model.kernel.density();
    let inverse = model.inverse_support();
    let limit = (model.support * model.support) as f32;
    let pull = match model.solver.pressure_force {
        PressureForce::Symmetric => model.gravity_f32(),
        PressureForce::Mueller => 0.5 * model.gravity_f32(), // its shares are half pressures
    };
    let floor = if model.solver.negative_pressure { f32::NEG_INFINITY } else { 0.0 };
    let listed = Listed::new(simd, records, chunk.list());
    for (k, (runs, share)) in chunk.runs.iter().zip(share).enumerate() {
        *share = 0.0;
        let own = &records[first + k];
        if let Some(mirror) = mirror.get_mut(k) {
            *mirror = [own.v[0], own.v[1], own.v[2], 0.0];
        }
        if runs.count(Kind::Fluid) == 0 {
            continue;
        }
        let (mut total, mut weight): (Lanes, Lanes) = ([0.0; LANES], [0.0; LANES]);
        let mut flow: [Lanes; 3] = [[0.0; LANES]; 3];
        for near in listed.run(runs.padded(Kind::Fluid)) {
            let list = near.index;
            let other = gather(simd, near);
            let (d, mut r_sq) = wrap_lanes(simd, model, own.x, &other.x);
            for l in 0..LANES {
                // padding names the particle itself: it goes where W is zero
                r_sq[l] = if list[l] as usize == first + k { limit } else { r_sq[l] };
            }
            let rho: Lanes = if model.fluids.len() == 1 {
                [model.fluids[0].density; LANES]
            } else {
                std::array::from_fn(|l| model.fluids.get(owner[list[l] as usize] as usize).map_or(0.0, |f| f.density))
            };
            let mut w = [0.0; LANES];
            each_kernel!(kernel, K => for l in 0..LANES {
                w[l] = K.w(r_sq[l].sqrt() * inverse);
                // from the fluid particle to this one: -d
                let pull_dot_d = -(pull.x * d[0][l] + pull.y * d[1][l] + pull.z * d[2][l]);
                total[l] += w[l] * fluid::pressure_at_boundary(other.share[l].max(floor), rho[l], pull_dot_d);
                weight[l] += w[l];
            });
            if !mirror.is_empty() {
                for a in 0..3 {
                    for l in 0..LANES {
                        flow[a][l] += w[l] * other.v[a][l];
                    }
                }
            }
        }
        let weight = sum(simd, &weight);
        if weight > 0.0 {
            *share = (sum(simd, &total) / weight).max(floor);
            if let Some(mirror) = mirror.get_mut(k) {
                for a in 0..3 {
                    mirror[a] = 2.0 * own.v[a] - sum(simd, &flow[a]) / weight;
                }
            }
        }
    }
}
