//! Stage `gradients`: of each fluid particle the colour gradient (E7) and the vorticity (E8), where they are asked for.
//!
//! In: neighbour runs, records. Out: `[n_x, n_y, n_z, |omega|]`, `n = H sum_j V_j grad_i W_ij` over its own fluid, and
//! `omega = curl v`.

use super::lanes::{LANES, Lanes, gather};
use super::pairs::wrap_lanes;
use super::slices::{Own, Slices};
use crate::laws::kernel::each_kernel;
use crate::model::Model;
use crate::state::{Kind, Record};
use fearless_simd::Simd;
use glam::Vec3;

/// Gradients of a chunk of fluid particles.
#[inline(always)]
pub fn chunk<S: Simd>(
    simd: S,
    model: &Model,
    records: &[Record],
    owner: &[u32],
    slices: &Slices,
    gradient: &mut [[f32; 4]],
    vorticity: &mut [[f32; 3]],
) {
    let inverse = model.inverse_support();
    for (s, members) in slices.each() {
        let own = Own::slice(simd, records, slices, s);
        let (mut color, mut curl): ([Lanes; 3], [Lanes; 3]) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        for near in slices.run(records, s, Kind::Fluid) {
            let other = gather(simd, near);
            let (d, r_sq) = wrap_lanes(simd, model, &own.at.x, &other.x);
            let mut same = [1.0; LANES];
            if model.fluids.len() > 1 {
                for l in 0..LANES {
                    let alike = owner[near.index[l] as usize] == owner[own.i[l] as usize];
                    same[l] = if alike { 1.0 } else { 0.0 };
                }
            }
            each_kernel!(model.kernel.force(), K => for l in 0..LANES {
                // grad_i W = -G d_ij
                let slope = -model.factors.g * K.g(r_sq[l].sqrt() * inverse) * other.volume[l];
                let same = same[l] * slope;
                let [v_x, v_y, v_z] = [0, 1, 2].map(|a| other.v[a][l] - own.at.v[a][l]);
                for a in 0..3 {
                    color[a][l] += same * d[a][l];
                }
                curl[0][l] += slope * (d[1][l] * v_z - d[2][l] * v_y);
                curl[1][l] += slope * (d[2][l] * v_x - d[0][l] * v_z);
                curl[2][l] += slope * (d[0][l] * v_y - d[1][l] * v_x);
            });
        }
        for (l, k) in members.enumerate() {
            let [x, y, z] = [0, 1, 2].map(|a| model.support as f32 * color[a][l]);
            let omega = Vec3::new(curl[0][l], curl[1][l], curl[2][l]);
            gradient[k] = [x, y, z, omega.length()];
            vorticity[k] = omega.to_array();
        }
    }
}

/// E8, vorticity confinement (Macklin and Mueller 2013, after Fedkiw et al. 2001): acceleration `eps dx N x omega`, `N` the
/// direction in which `|omega|` grows.
#[inline(always)]
pub fn confinement(model: &Model, growth: Vec3, omega: Vec3) -> Vec3 {
    (model.solver.vorticity * model.spacing) as f32 * growth.normalize_or_zero().cross(omega)
}
