//! Rounds of implicit pressure (E9): shares that keep densities, or their rates, from rising. DFSPH (Bender and Koschier 2015) makes them
//! for velocities and for the places of the drift, PBF (Macklin and Mueller 2013) for places that the drift has led to.
//!
//! A round has two passes. [`accelerate`]: shares become accelerations of fluids, by the laws of E4 and E17.
//! [`rates`] and [`relax`]: accelerations become rates of density, by the same vectors transposed, and shares are relaxed. The
//! relaxation is Jacobi's, accelerated by Chebyshev polynomials of the fourth kind (Lottes 2023), begun anew whenever it runs against the
//! descent. Called by the stages `divergence` and `pressure`.

use super::lanes::{LANES, Lanes, axes, load, store, vectors};
use super::links::{Links, Nodes, Table};
use crate::laws::implicit;
use fearless_simd::f32x16;
use fearless_simd::prelude::*;

/// How often PBF finds the vectors to neighbours anew in a step.
pub const TURNS: u32 = 3;
/// The part of the tolerance at which its rounds end before.
pub const FIRST: f64 = 0.7;
/// An error so many times the least so far says that rounds do not converge.
pub const WORSE: f64 = 10.0;
/// Rounds from one solve of the coarse level to the next.
pub const EVERY: u32 = 2;
/// The next is made if less than this part is left of what was before the last,
pub const WORTH: f64 = 0.8;
/// and if a weight is not held yet or, of places, if so much of the error is of one sign: errors that cancel are for rounds.
pub const OF_ONE_SIGN: f64 = 0.05;

/// Accelerations of a chunk of fluid particles (m/s^2) by the shares (Pa) of all, which are 0 for particles of bodies; `first` is the
/// chunk's first. `hold` is the part of gravity that pairs with bodies have, see [`implicit::hold`].
#[inline(always)]
#[allow(clippy::too_many_arguments)] // one caller
pub fn accelerate<S: Simd>(
    simd: S,
    table: &mut Table,
    links: &Links,
    nodes: &[Nodes],
    share: &[f32],
    hold: &[f32],
    first: usize,
    out: &mut [[f32; 4]],
) {
    let around = table.numbers(links, share);
    let (share, hold) = (&share[first..first + out.len()], &hold[first..first + out.len()]);
    let unit = f32x16::splat(simd, links.unit);
    for (s, nodes) in nodes.iter().enumerate() {
        let zero = f32x16::splat(simd, 0.0);
        let mut sum = [zero, zero, zero];
        for link in links.of(s) {
            let other = link.numbers(simd, around);
            let e = link.e(simd);
            for a in 0..3 {
                sum[a] += other * e[a];
            }
        }
        let (own, hold) = (load(simd, share, LANES * s), load(simd, hold, LANES * s));
        let inverse_rho = lanes(simd, &nodes.inverse_rho);
        for a in 0..3 {
            let fluids = unit * sum[a] + own * lanes(simd, &nodes.all[a]);
            sum[a] = zero - inverse_rho * (fluids + hold * lanes(simd, &nodes.pull[a]));
        }
        let rows = vectors(simd, sum);
        let out = out[LANES * s..].as_flattened_mut();
        for k in 0..rows.len() {
            if LANES * k < out.len() {
                store(rows[k], out, LANES * k);
            }
        }
    }
}

/// `sum (u_i - u_j) . e_ij` of a chunk: the rate at which velocities `u` (m/s) compress (1/s), or accelerations alike.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // as above
pub fn rates<S: Simd>(
    simd: S,
    table: &mut Table,
    links: &Links,
    nodes: &[Nodes],
    u: &[[f32; 4]],
    first: usize,
    out: &mut [f32],
) {
    let around = table.vectors(links, u);
    let own = u[first..first + out.len()].as_flattened();
    let unit = f32x16::splat(simd, links.unit);
    for (s, nodes) in nodes.iter().enumerate() {
        let mut sum = f32x16::splat(simd, 0.0);
        for link in links.of(s) {
            let other = link.vectors(simd, around);
            let e = link.e(simd);
            sum += other[0] * e[0] + other[1] * e[1] + other[2] * e[2];
        }
        let mut rows = [f32x16::splat(simd, 0.0); 4];
        for k in 0..rows.len() {
            rows[k] = load(simd, own, own.len().min(4 * LANES * s + LANES * k));
        }
        let own = axes(rows);
        let mut all = f32x16::splat(simd, 0.0);
        for a in 0..3 {
            all += lanes(simd, &nodes.all[a]) * own[a];
        }
        store(all - unit * sum, out, LANES * s);
    }
}

/// Sixteen numbers.
#[inline(always)]
fn lanes<S: Simd>(simd: S, of: &Lanes) -> f32x16<S> {
    f32x16::load_array_ref(simd, of)
}

/// How shares are relaxed in one round.
#[derive(Clone, Copy, Debug)]
pub struct Round {
    /// Jacobi's factor.
    pub omega: f32,
    /// From rates of acceleration to what the error counts (s^2; 1 for the divergence).
    pub scale: f32,
    /// How far fluids yield: compression by a pressure of their own rest density times 1 m^2/s^2 (s^2/m^2).
    pub compliance: f32,
    /// The number of the round since the acceleration began.
    pub number: f32,
    /// Pressure up to which gravity fades out between fluids and bodies (Pa).
    pub limit: f32,
}

/// Shares of a chunk (Pa).
pub struct Shares<'a> {
    /// Those that push.
    pub share: &'a mut [f32],
    /// Their [`implicit::hold`].
    pub hold: &'a mut [f32],
    /// Those that pushed in the round before.
    pub before: &'a mut [f32],
    /// What pushed before they did, below the opposite of which none may fall: no sum is negative.
    pub base: &'a [f32],
    /// Receives what the shares that pushed have left, in compression; of particles without pressure only the excess.
    pub left: &'a mut [f32],
}

/// What a round says of a chunk.
#[derive(Clone, Copy, Debug, Default)]
pub struct Said {
    /// Sum of the errors that the shares left which pushed.
    pub error: f64,
    /// Whether the change of shares runs against the descent, if positive.
    pub against: f64,
    /// Sum of the errors with their signs.
    pub bias: f64,
}

/// Relaxes the shares of a chunk. `error` is what is wrong without pressure, `rate` what the shares do about it; `share`
/// holds the shares that pushed and receives those to push with next, `before` those of the round before and those that pushed.
#[inline(always)]
pub fn relax<S: Simd>(simd: S, round: Round, nodes: &[Nodes], error: &[f32], rate: &[f32], shares: Shares) -> Said {
    let Shares { share, hold, before, base, left: rest } = shares;
    let (kept, stride) = (implicit::carried(round.number), implicit::stride(round.number));
    let mut sums = [[0.0; LANES]; 3];
    for (s, nodes) in nodes.iter().enumerate() {
        let at = LANES * s;
        let read = |from: &[f32]| load(simd, from, at).to_array();
        let (error, rate, own, last, base) = (read(error), read(rate), read(share), read(before), read(base));
        let (mut now, mut held) = ([0.0; LANES], [0.0; LANES]);
        let (mut signed, mut against) = ([0.0; LANES], [0.0; LANES]);
        for l in 0..LANES {
            let compliance = round.compliance * nodes.inverse_rho[l];
            let left = error[l] + round.scale * rate[l] - compliance * (base[l] + own[l]);
            let answer = round.scale * nodes.response[l] + compliance;
            let by = round.omega / answer;
            // what the share should still change by, in compression: of particles without pressure only the excess counts
            let plain = implicit::relaxed(own[l], left, by, 0.0, -base[l]);
            signed[l] = (plain - own[l]) * answer / round.omega;
            now[l] = implicit::relaxed(own[l], left, stride * by, kept * (own[l] - last[l]), -base[l]);
            against[l] = left * (own[l] - now[l]);
            held[l] = implicit::hold_more(base[l], now[l], round.limit);
        }
        let members = LANES.min(share.len() - at);
        for l in 0..members {
            sums[0][l] += f64::from(signed[l].abs());
            sums[1][l] += f64::from(against[l]);
            sums[2][l] += f64::from(signed[l]);
        }
        for (to, from) in [(&mut *before, own), (&mut *share, now), (&mut *hold, held), (&mut *rest, signed)] {
            store(f32x16::load_array(simd, from), to, at);
        }
    }
    let [error, against, bias] = sums.map(|lanes| lanes.iter().sum());
    Said { error, against, bias }
}
