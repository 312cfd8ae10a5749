//! Stage `boundary`: the pressure the fluid shows to particles of bodies and walls (E17; Adami et al. 2012).
//!
//! In: neighbour runs of bodies' particles, pressure shares of fluids. Out: pressure shares of bodies' particles,
//! extrapolated from the fluid around with the weight of the layer between, and never negative unless pressures may be;
//! where walls do not slip, the velocity they show to viscosity: the fluid's, mirrored at the wall.

use super::lanes::{LANES, Lanes, gather, listed, sum};
use super::neighbours::NeighbourChunk;
use super::pairs::wrap_lanes;
use super::slices::splat;
use crate::laws::fluid;
use crate::laws::kernel::each_kernel;
use crate::model::Model;
use crate::scene::PressureForce;
use crate::state::{Body, Kind, Record};
use fearless_simd::Simd;
use glam::{DVec3, Vec3};

/// Pressure shares of a chunk of bodies' particles. `records` are all particles; `first` is the chunk's first.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // one caller
pub fn chunk<S: Simd>(
    simd: S,
    model: &Model,
    records: &[Record],
    owner: &[u32],
    bodies: &[Body],
    gravity: Vec3,
    first: usize,
    chunk: &NeighbourChunk,
    share: &mut [f32],
    mirror: &mut [[f32; 4]],
) {
    let kernel = model.kernel.density();
    let inverse = model.inverse_support();
    let limit = (model.support * model.support) as f32;
    let half = match model.solver.pressure_force {
        PressureForce::Symmetric => 1.0,
        PressureForce::Mueller => 0.5, // its shares are half pressures
    };
    let floor = if model.solver.negative_pressure { f32::NEG_INFINITY } else { 0.0 };
    for (k, (runs, share)) in chunk.runs.iter().zip(share).enumerate() {
        *share = 0.0;
        let own = &records[first + k];
        if let Some(mirror) = mirror.get_mut(k) {
            *mirror = [own.v[0], own.v[1], own.v[2], 0.0];
        }
        if runs.count(Kind::Fluid) == 0 {
            continue;
        }
        let pull = half * (gravity - acceleration(&bodies[owner[first + k] as usize], own));
        let (mut total, mut weight): (Lanes, Lanes) = ([0.0; LANES], [0.0; LANES]);
        let mut flow: [Lanes; 3] = [[0.0; LANES]; 3];
        let x = splat(own.x);
        for near in listed(records, &chunk.list()[runs.padded(Kind::Fluid)]) {
            let list = near.index;
            let other = gather(simd, near);
            let (d, mut r_sq) = wrap_lanes(simd, model, &x, &other.x);
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

/// Acceleration of a particle of a scripted body (m/s^2): the wall's of Adami et al. 2012, eq. 27.
#[inline(always)]
pub(super) fn acceleration(body: &Body, own: &Record) -> Vec3 {
    let (a, alpha) = (body.acceleration, body.angular_acceleration);
    if a == DVec3::ZERO && alpha == DVec3::ZERO && (body.omega == DVec3::ZERO || !body.is_static()) {
        return Vec3::ZERO;
    }
    let arm = DVec3::from(own.x.map(f64::from)) - body.x;
    (a + alpha.cross(arm) + body.omega.cross(body.omega.cross(arm))).as_vec3()
}
