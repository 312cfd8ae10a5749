//! Stage `gradients`: of each fluid particle the colour gradient (E7) and the vorticity (E8), where they are asked for.
//!
//! In: neighbour runs, records. Out: `[n_x, n_y, n_z, |omega|]`, `n = H sum_j V_j grad_i W_ij` over its own fluid, and
//! `omega = curl v`.

use super::lanes::{LANES, Lanes, Listed, gather, sum};
use super::neighbours::NeighbourChunk;
use super::pairs::wrap_lanes;
use crate::laws::kernel::each_kernel;
use crate::model::Model;
use crate::state::{Kind, Record};
use fearless_simd::Simd;
use glam::Vec3;

/// Gradients of a chunk of fluid particles; `first` is the chunk's first.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // one caller
pub fn chunk<S: Simd>(
    simd: S,
    model: &Model,
    records: &[Record],
    owner: &[u32],
    first: usize,
    chunk: &NeighbourChunk,
    gradient: &mut [[f32; 4]],
    vorticity: &mut [[f32; 3]],
) {
    let inverse = model.inverse_support();
    let listed = Listed::new(simd, records, chunk.list());
    for (k, runs) in chunk.runs.iter().enumerate() {
        let own = &records[first + k];
        let (mut color, mut curl): ([Lanes; 3], [Lanes; 3]) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        for near in listed.run(runs.padded(Kind::Fluid)) {
            let other = gather(simd, near);
            let (d, r_sq) = wrap_lanes(simd, model, own.x, &other.x);
            let same = near.index.map(|j| if owner[j as usize] == owner[first + k] { 1.0 } else { 0.0 });
            each_kernel!(model.kernel.force(), K => for l in 0..LANES {
                // grad_i W = -G d_ij
                let slope = -model.factors.g * K.g(r_sq[l].sqrt() * inverse) * other.volume[l];
                let same = same[l] * slope;
                let [v_x, v_y, v_z] = [0, 1, 2].map(|a| other.v[a][l] - own.v[a]);
                for a in 0..3 {
                    color[a][l] += same * d[a][l];
                }
                curl[0][l] += slope * (d[1][l] * v_z - d[2][l] * v_y);
                curl[1][l] += slope * (d[2][l] * v_x - d[0][l] * v_z);
                curl[2][l] += slope * (d[0][l] * v_y - d[1][l] * v_x);
            });
        }
        let [x, y, z] = color.map(|c| model.support as f32 * sum(simd, &c));
        let omega = Vec3::from(curl.map(|c| sum(simd, &c)));
        gradient[k] = [x, y, z, omega.length()];
        vorticity[k] = omega.to_array();
    }
}

/// E8, vorticity confinement (Macklin and Mueller 2013, after Fedkiw et al. 2001): acceleration `eps dx N x omega`, `N` the
/// direction in which `|omega|` grows.
#[inline(always)]
pub fn confinement(model: &Model, growth: Vec3, omega: Vec3) -> Vec3 {
    (model.solver.vorticity * model.spacing) as f32 * growth.normalize_or_zero().cross(omega)
}
