//! Rounds of implicit pressure (E9): shares that keep densities, or their rates, from rising. DFSPH (Bender and Koschier 2015) makes them
//! for velocities and for the places of the drift, PBF (Macklin and Mueller 2013) for places that the drift has led to.
//!
//! A round has two passes. [`accelerate`]: shares become accelerations of fluids, by the laws of E4 and E17.
//! [`rates`] and [`relax`]: accelerations become rates of density, by the same vectors transposed, and shares are relaxed. The
//! relaxation is Jacobi's with Nesterov's momentum, begun anew whenever it runs against the descent. Called by the stages
//! `divergence` and `pressure`.

use super::lanes::{LANES, Lanes, Linked, Links, gather_one, gather_vectors, sum};
use super::links::Node;
use crate::laws::implicit;
use fearless_simd::Simd;
use glam::Vec3;

/// Accelerations of a chunk of fluid particles (m/s^2) by the shares (Pa) of all; `first` is the chunk's first. `hold` is the part
/// of gravity that pairs with bodies have, see [`implicit::hold`].
#[inline(always)]
pub fn accelerate<S: Simd>(
    simd: S,
    links: &Links,
    nodes: &[Node],
    share: &[f32],
    hold: &[f32],
    first: usize,
    out: &mut [[f32; 4]],
) {
    let linked = links.with(share);
    for (k, (node, out)) in nodes.iter().zip(out).enumerate() {
        let own = share[first + k];
        let mut total = [[0.0; LANES]; 3];
        for (near, e) in linked.fluids(k) {
            let other = gather_one(near);
            for l in 0..LANES {
                let both = own + other[l];
                total[0][l] += both * f32::from(e[0][l]);
                total[1][l] += both * f32::from(e[1][l]);
                total[2][l] += both * f32::from(e[2][l]);
            }
        }
        let fluids = links.unit * Vec3::new(sum(simd, &total[0]), sum(simd, &total[1]), sum(simd, &total[2]));
        let solids = 2.0 * own * node.solid + hold[first + k] * node.pull;
        let a = -node.inverse_rho * (fluids + solids);
        *out = [a.x, a.y, a.z, 0.0];
    }
}

/// `sum (u_i - u_j) . e_ij` of a chunk: the rate at which velocities `u` (m/s) compress (1/s), or accelerations alike.
#[inline(always)]
pub fn rates<S: Simd>(simd: S, links: &Links, nodes: &[Node], u: &[[f32; 4]], first: usize, out: &mut [f32]) {
    let linked: Linked<[f32; 4]> = links.with(u);
    for (k, (node, out)) in nodes.iter().zip(out).enumerate() {
        let [x, y, z, _] = u[first + k];
        let mut total: Lanes = [0.0; LANES];
        for (near, e) in linked.all(k) {
            let other = gather_vectors(simd, near);
            for l in 0..LANES {
                let [x, y, z] = [e[0][l], e[1][l], e[2][l]].map(f32::from);
                total[l] += other[0][l] * x + other[1][l] * y + other[2][l] * z;
            }
        }
        *out = node.all.dot(Vec3::new(x, y, z)) - links.unit * sum(simd, &total);
    }
}

/// How shares are relaxed in one round.
#[derive(Clone, Copy, Debug)]
pub struct Round {
    /// Jacobi's factor over the square of time for which accelerations act (1/s^2).
    pub omega: f32,
    /// From rates of acceleration to what the error counts (s^2; 1 for the divergence).
    pub scale: f32,
    /// Nesterov's momentum.
    pub momentum: f32,
    /// Pressure up to which gravity fades out between fluids and bodies (Pa).
    pub limit: f32,
    /// Whether nothing pushes yet, so that there are no rates.
    pub first: bool,
}

/// Shares of a chunk (Pa).
pub struct Shares<'a> {
    /// Those that push.
    pub share: &'a mut [f32],
    /// Their [`implicit::hold`].
    pub hold: &'a mut [f32],
    /// What a round came to.
    pub found: &'a mut [f32],
}

/// What a round says of a chunk.
#[derive(Clone, Copy, Debug, Default)]
pub struct Said {
    /// Sum of what is left of the errors.
    pub error: f64,
    /// Whether momentum runs against the descent, if positive.
    pub against: f64,
}

/// Relaxes the shares of a chunk. `error` is what is wrong without pressure, `rate` what the shares do about it; `share`
/// holds the shares that pushed and receives those to push with next, `found` the last round's result and this one's.
#[inline(always)]
pub fn relax(round: Round, nodes: &[Node], error: &[f32], rate: &[f32], shares: Shares) -> Said {
    let mut said = Said::default();
    let Shares { share, hold, found } = shares;
    for (k, node) in nodes.iter().enumerate() {
        let left = error[k] + round.scale * rate[k];
        let before = found[k];
        let now = implicit::relaxed(share[k], left, round.omega / node.response);
        // what the share should still change by, in compression: of particles without pressure only the excess counts
        said.error += f64::from((now - share[k]).abs() * node.response / round.omega);
        said.against += f64::from((share[k] - now) * (now - before) * node.response);
        found[k] = now;
        share[k] = (now + round.momentum * (now - before)).max(0.0);
        hold[k] = implicit::hold(share[k], round.limit);
    }
    said
}
