//! Sums over the SPH pairs of one particle, sixteen neighbours at a time: E4, E5, and where they are asked for the
//! rate of density (E1), XSPH (E6), surface tension (E7), the growth of vorticity (E8) and shifting.
//!
//! In: a particle, lists of neighbours, records. Out: force, rate, velocity it is carried by. Called by [`super::forces`].

use super::density::weights;
use super::forces::Input;
use super::lanes::{LANES, Lanes, Near, gather, minus, squares, sum};
use crate::laws::fluid;
use crate::laws::kernel::{Kernel, each_kernel};
use crate::model::Model;
use crate::scene::{Density, Viscosity};
use crate::state::Record;
use fearless_simd::Simd;
use glam::Vec3;

/// A difference of places, by the shortest way on periodic axes.
#[inline(always)]
pub fn wrap(model: &Model, mut d: Vec3) -> Vec3 {
    for a in 0..3 {
        let period = model.grid.period[a];
        if period > 0.0 {
            d[a] = shortest(d[a], period);
        }
    }
    d
}

#[inline(always)]
fn shortest(d: f32, period: f32) -> f32 {
    let half = 0.5 * period;
    let over = if d > half { period } else { 0.0 };
    let under = if d < -half { period } else { 0.0 };
    d - over + under
}

/// `d_ij` and its square for sixteen neighbours, by the shortest way on periodic axes.
#[inline(always)]
pub fn wrap_lanes<S: Simd>(simd: S, model: &Model, x: [f32; 3], other: &[Lanes; 3]) -> ([Lanes; 3], Lanes) {
    let mut d = [[0.0; LANES]; 3];
    for a in 0..3 {
        d[a] = minus(simd, &other[a], x[a]);
        let period = model.grid.period[a];
        if period > 0.0 {
            for l in 0..LANES {
                d[a][l] = shortest(d[a][l], period);
            }
        }
    }
    let r_sq = squares(simd, &d);
    (d, r_sq)
}

/// Which ends of the pairs are bodies.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Ends {
    /// Fluid among fluids.
    Fluids,
    /// A fluid particle and particles of bodies.
    OnFluid,
    /// A body's particle and fluid particles.
    OnBody,
}

/// Numbers of sixteen pairs that depend on who the two are.
pub struct Terms {
    /// `mu_i + mu_j` (Pa s).
    pub mu_sum: Lanes,
    /// `alpha rho_0 c_0 h` (Pa s).
    pub eta: Lanes,
    /// 1 where both are of one fluid, else 0.
    pub same: Lanes,
    /// Strength of cohesion (N/m^(2d)); 0 between fluids and towards bodies.
    pub cohesion: f32,
    /// Strength of the curvature term, alike.
    pub curvature: f32,
}

/// Sixteen pairs, lane by lane.
struct Sixteen<'a> {
    volume: &'a Lanes,
    share: &'a Lanes,
    d: &'a [Lanes; 3],
    r_sq: &'a Lanes,
    v: &'a [Lanes; 3],
    /// Relative velocities that viscosity sees.
    seen: &'a [Lanes; 3],
}

/// The sums of one particle.
pub struct Pairs<'a> {
    model: &'a Model,
    mirror: &'a [[f32; 4]],
    gradient: &'a [[f32; 4]],
    i: u32,
    own: &'a Record,
    kernel: Kernel,
    g_factor: f32,
    inverse: f32,
    softening: f32,
    floor: f32,
    ceiling: f32,
    mueller: Option<f32>,
    continuity: Option<Diffusion>,
    shift: bool,
    xsph: bool,
    force: [Lanes; 3],
    rate: Lanes,
    carry: [Lanes; 3],
    drive: [Lanes; 3],
    full: Lanes,
    growth: [Lanes; 3],
}

/// Constants of density diffusion for the fluid of one particle.
#[derive(Clone, Copy)]
struct Diffusion {
    rate: f32,
    stiffness: f32,
    pull: Vec3,
}

impl<'a> Pairs<'a> {
    /// Sums for particle `i`, of fluid `fluid` if it is fluid.
    #[inline(always)]
    pub fn new(input: &Input<'a>, i: usize, fluid: Option<u32>) -> Self {
        let Input { model, records, mirror, gradient, .. } = *input;
        let solver = &model.solver;
        let continuity = fluid.filter(|_| solver.density == Density::Continuity).map(|f| {
            let f = &model.fluids[f as usize];
            Diffusion { rate: f.diffusion, stiffness: f.stiffness, pull: f.density * input.gravity }
        });
        Self {
            model,
            mirror,
            gradient,
            i: i as u32,
            own: &records[i],
            kernel: model.kernel.force(),
            g_factor: model.factors.g,
            inverse: model.inverse_support(),
            softening: model.softening(),
            floor: if solver.negative_pressure { f32::NEG_INFINITY } else { 0.0 },
            // implicit pressure has pushed already
            ceiling: if model.implicit() { 0.0 } else { f32::INFINITY },
            mueller: (solver.viscosity == Viscosity::Mueller).then_some(model.factors.laplacian),
            continuity,
            shift: fluid.is_some() && solver.shifting > 0.0,
            xsph: fluid.is_some() && solver.xsph > 0.0,
            force: [[0.0; LANES]; 3],
            rate: [0.0; LANES],
            carry: [[0.0; LANES]; 3],
            drive: [[0.0; LANES]; 3],
            full: [0.0; LANES],
            growth: [[0.0; LANES]; 3],
        }
    }

    /// Adds sixteen neighbours. `PLAIN`: nothing but E4 and E5 is asked for.
    #[inline(always)]
    pub fn add<S: Simd, const PLAIN: bool>(&mut self, simd: S, near: Near, ends: Ends, terms: &Terms) {
        let other = gather(simd, near);
        let (d, r_sq) = wrap_lanes(simd, self.model, self.own.x, &other.x);
        let mut v = [[0.0; LANES]; 3];
        for a in 0..3 {
            v[a] = minus(simd, &other.v[a], self.own.v[a]);
        }
        let mirrored = !PLAIN && ends != Ends::Fluids && !self.mirror.is_empty();
        let seen = if mirrored { self.slipless(near.index, ends, &other.v) } else { v };
        let pairs = Sixteen { volume: &other.volume, share: &other.share, d: &d, r_sq: &r_sq, v: &v, seen: &seen };
        let g = each_kernel!(self.kernel, K => self.add_forces::<PLAIN>(K, &pairs, terms));
        if PLAIN {
            return;
        }
        if let Some(factor) = self.mueller {
            for l in 0..LANES {
                let volumes = self.own.volume * other.volume[l];
                let laplacian = Kernel::Viscosity.g(r_sq[l].sqrt() * self.inverse);
                let along_v = fluid::viscosity_mueller(volumes, terms.mu_sum[l], factor * laplacian);
                for a in 0..3 {
                    self.force[a][l] += along_v * seen[a][l];
                }
            }
        }
        if let Some(diffusion) = self.continuity {
            self.add_rate(ends, &pairs, &g, terms, diffusion);
        }
        if ends == Ends::Fluids && terms.cohesion + terms.curvature > 0.0 {
            self.add_tension(near.index, terms, &pairs);
        }
        if ends == Ends::Fluids && self.model.solver.vorticity > 0.0 {
            for l in 0..LANES {
                let slope = -g[l] * other.volume[l] * self.gradient[near.index[l] as usize][3];
                for a in 0..3 {
                    self.growth[a][l] += slope * d[a][l];
                }
            }
        }
        if self.xsph && ends == Ends::Fluids || self.shift {
            self.add_carry(near.index, ends, &pairs, &g);
        }
    }

    /// E4 and E5; returns `G`. All in one loop over the lanes, a copy for each kernel: of short loops, and of choices
    /// inside, the compiler makes scalars.
    #[inline(always)]
    fn add_forces<const PLAIN: bool>(&mut self, kernel: Kernel, pairs: &Sixteen, terms: &Terms) -> Lanes {
        let Sixteen { volume, share, d, r_sq, v, seen } = pairs;
        let (own, own_share) = (self.own, self.own.share.max(self.floor).min(self.ceiling));
        let laminar = if !PLAIN && self.mueller.is_some() { 0.0 } else { 1.0 };
        let mut out = [0.0; LANES];
        for l in 0..LANES {
            let g = self.g_factor * kernel.g(r_sq[l].sqrt() * self.inverse);
            let volumes = own.volume * volume[l];
            let v_dot_d = v[0][l] * d[0][l] + v[1][l] * d[1][l] + v[2][l] * d[2][l];
            let inverse_sq = fluid::softened_inverse(r_sq[l], self.softening);
            let along_d = fluid::pressure_force(volumes, own_share, share[l].max(self.floor).min(self.ceiling), g)
                + fluid::viscosity_artificial(volumes, terms.eta[l], v_dot_d, inverse_sq, g);
            let along_v = fluid::viscosity_laminar(volumes, laminar * terms.mu_sum[l], r_sq[l], inverse_sq, g);
            self.force[0][l] += along_d * d[0][l] + along_v * seen[0][l];
            self.force[1][l] += along_d * d[1][l] + along_v * seen[1][l];
            self.force[2][l] += along_d * d[2][l] + along_v * seen[2][l];
            out[l] = g;
        }
        out
    }

    /// E1, the rate of density.
    #[inline(always)]
    fn add_rate(&mut self, ends: Ends, pairs: &Sixteen, g: &Lanes, terms: &Terms, diffusion: Diffusion) {
        let Sixteen { volume, share, d, v, .. } = pairs;
        for l in 0..LANES {
            let v_dot_d = v[0][l] * d[0][l] + v[1][l] * d[1][l] + v[2][l] * d[2][l];
            self.rate[l] += fluid::density_rate(volume[l], v_dot_d, g[l]);
        }
        if ends != Ends::Fluids {
            return;
        }
        let Diffusion { rate, stiffness, pull } = diffusion;
        for l in 0..LANES {
            let weight = pull.x * d[0][l] + pull.y * d[1][l] + pull.z * d[2][l];
            let rate = rate * terms.same[l];
            self.rate[l] +=
                fluid::density_diffusion(volume[l], self.own.share, share[l], weight, rate, stiffness, g[l]);
        }
    }

    /// E7: cohesion and curvature.
    #[inline(always)]
    fn add_tension(&mut self, list: &[u32; LANES], terms: &Terms, pairs: &Sixteen) {
        let Sixteen { d, r_sq, .. } = pairs;
        let volumes = self.own.volume * self.own.volume; // of one fluid, all alike
        for l in 0..LANES {
            let r = r_sq[l].sqrt();
            let along_d = fluid::cohesion(volumes, terms.cohesion * terms.same[l], r * self.inverse, r);
            for a in 0..3 {
                self.force[a][l] += along_d * d[a][l];
            }
        }
        if terms.curvature == 0.0 {
            return;
        }
        let own = self.gradient[self.i as usize];
        for l in 0..LANES {
            let factor = fluid::curvature(volumes, terms.curvature * terms.same[l]);
            let other = self.gradient[list[l] as usize];
            for a in 0..3 {
                self.force[a][l] += factor * (other[a] - own[a]);
            }
        }
    }

    /// E6, and the sums of shifting.
    #[inline(always)]
    fn add_carry(&mut self, list: &[u32; LANES], ends: Ends, pairs: &Sixteen, g: &Lanes) {
        let Sixteen { volume, d, r_sq, v, .. } = pairs;
        let model = self.model;
        let mut w = weights(model.kernel.density(), self.inverse, r_sq);
        for l in 0..LANES {
            w[l] *= model.factors.w;
        }
        if self.xsph && ends == Ends::Fluids {
            let epsilon = model.solver.xsph as f32;
            for a in 0..3 {
                for l in 0..LANES {
                    self.carry[a][l] += fluid::xsph(epsilon, volume[l], w[l]) * v[a][l];
                }
            }
        }
        if self.shift {
            let reach = model.support as f32;
            for l in 0..LANES {
                self.full[l] += if list[l] == self.i { 0.0 } else { volume[l] * w[l] }; // padding is the particle
                let factor = fluid::shifting(volume[l], w[l], model.factors.w_spacing, reach, g[l]);
                for a in 0..3 {
                    self.drive[a][l] += factor * d[a][l];
                }
            }
        }
    }

    /// Relative velocities where bodies do not slip: those of the mirrored fluid (Adami et al. 2012).
    #[inline(always)]
    fn slipless(&self, list: &[u32; LANES], ends: Ends, other: &[Lanes; 3]) -> [Lanes; 3] {
        let mut v = [[0.0; LANES]; 3];
        let own = if ends == Ends::OnBody {
            self.mirror[self.i as usize]
        } else {
            let [x, y, z] = self.own.v;
            [x, y, z, 0.0]
        };
        for l in 0..LANES {
            if list[l] == self.i {
                continue; // padding
            }
            for a in 0..3 {
                let seen = if ends == Ends::OnFluid { self.mirror[list[l] as usize][a] } else { other[a][l] };
                v[a][l] = seen - own[a];
            }
        }
        v
    }

    /// Where vorticity grows.
    #[inline(always)]
    pub fn growth<S: Simd>(&self, simd: S) -> Vec3 {
        Vec3::new(sum(simd, &self.growth[0]), sum(simd, &self.growth[1]), sum(simd, &self.growth[2]))
    }

    /// Sum of the forces (N).
    #[inline(always)]
    pub fn force<S: Simd>(&self, simd: S) -> Vec3 {
        Vec3::new(sum(simd, &self.force[0]), sum(simd, &self.force[1]), sum(simd, &self.force[2]))
    }

    /// `dD/dt` (1/s); zero where densities are summed.
    #[inline(always)]
    pub fn rate<S: Simd>(&self, simd: S) -> f32 {
        if self.continuity.is_some() { sum(simd, &self.rate) } else { 0.0 }
    }

    /// Velocity added to the particle's own when it drifts (m/s). `fastest` is the largest speed (m/s).
    #[inline(always)]
    pub fn carry<S: Simd>(&self, simd: S, fastest: f32) -> Vec3 {
        let mut carry = Vec3::ZERO;
        if self.xsph {
            carry = Vec3::new(sum(simd, &self.carry[0]), sum(simd, &self.carry[1]), sum(simd, &self.carry[2]));
        }
        // only inside a fluid: at a free surface the gap would draw particles out
        let inner = SHIFTED_ABOVE - self.model.factors.w_own * self.model.volume as f32;
        if self.shift && sum(simd, &self.full) > inner {
            let drive = Vec3::new(sum(simd, &self.drive[0]), sum(simd, &self.drive[1]), sum(simd, &self.drive[2]));
            carry += (self.model.solver.shifting as f32 * fastest * drive).clamp_length_max(0.5 * fastest);
        }
        carry
    }
}

/// Particles with at least this much of a full neighbourhood `sum V_j W_ij` are shifted.
pub(crate) const SHIFTED_ABOVE: f32 = 0.93;
