//! Sums over SPH pairs, sixteen at a time: those of sixteen particles with one neighbour each, or of one with sixteen. E4, E5, and where they are asked for the
//! rate of density (E1), XSPH (E6), surface tension (E7), the growth of vorticity (E8) and shifting.
//!
//! In: the particles on whose side is summed, lists of neighbours, records. Out: force, rate, velocity they are carried by, lane by lane. Called by
//! [`super::forces`].

use super::density::weights;
use super::forces::Input;
use super::lanes::{LANES, Lanes, Near, gather, minus, squares, sum};
use super::slices::Own;
use crate::laws::fluid;
use crate::laws::kernel::{Kernel, each_kernel};
use crate::model::Model;
use crate::scene::Viscosity;
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
pub fn wrap_lanes<S: Simd>(simd: S, model: &Model, x: &[Lanes; 3], other: &[Lanes; 3]) -> ([Lanes; 3], Lanes) {
    let mut d = [[0.0; LANES]; 3];
    for a in 0..3 {
        d[a] = minus(simd, &other[a], &x[a]);
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
    pub cohesion: Lanes,
    /// Strength of the curvature term, alike.
    pub curvature: Lanes,
}

impl Terms {
    /// Pairs with nothing but pressure and viscosity `mu_i + mu_j` (Pa s).
    #[inline(always)]
    pub fn bare(mu_sum: Lanes) -> Self {
        let zero = [0.0; LANES];
        Self { mu_sum, eta: zero, same: zero, cohesion: zero, curvature: zero }
    }
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

/// The sums of sixteen lanes.
pub struct Pairs<'a> {
    model: &'a Model,
    mirror: &'a [[f32; 4]],
    gradient: &'a [[f32; 4]],
    own: Own,
    own_share: Lanes,
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

/// Constants of density diffusion for the fluid of each lane.
#[derive(Clone, Copy)]
struct Diffusion {
    rate: Lanes,
    stiffness: Lanes,
    density: Lanes,
    gravity: Vec3,
}

impl<'a> Pairs<'a> {
    /// Sums for fluid particles, or else one of a body.
    #[inline(always)]
    pub fn new(input: &Input<'a>, own: Own, fluid: bool) -> Self {
        let Input { model, mirror, gradient, owner, .. } = *input;
        let solver = &model.solver;
        let continuity = (fluid && model.integrates_density()).then(|| {
            let mut diffusion = Diffusion {
                rate: [0.0; LANES],
                stiffness: [0.0; LANES],
                density: [0.0; LANES],
                gravity: input.gravity,
            };
            for l in 0..LANES {
                let f = &model.fluids[owner[own.i[l] as usize] as usize];
                (diffusion.rate[l], diffusion.stiffness[l]) = (f.diffusion, f.stiffness);
                diffusion.density[l] = f.density;
            }
            diffusion
        });
        let floor = if solver.negative_pressure { f32::NEG_INFINITY } else { 0.0 };
        // implicit pressure has pushed already
        let ceiling = if model.implicit() { 0.0 } else { f32::INFINITY };
        let mut own_share = own.at.share;
        for l in 0..LANES {
            own_share[l] = own_share[l].max(floor).min(ceiling);
        }
        Self {
            model,
            mirror,
            gradient,
            own,
            own_share,
            kernel: model.kernel.force(),
            g_factor: model.factors.g,
            inverse: model.inverse_support(),
            softening: model.softening(),
            floor,
            ceiling,
            mueller: (solver.viscosity == Viscosity::Mueller).then_some(model.factors.laplacian),
            continuity,
            shift: fluid && solver.shifting > 0.0,
            xsph: fluid && solver.xsph > 0.0,
            force: [[0.0; LANES]; 3],
            rate: [0.0; LANES],
            carry: [[0.0; LANES]; 3],
            drive: [[0.0; LANES]; 3],
            full: [0.0; LANES],
            growth: [[0.0; LANES]; 3],
        }
    }

    /// Adds sixteen pairs. `PLAIN`: nothing but E4 and E5 is asked for.
    #[inline(always)]
    pub fn add<S: Simd, const PLAIN: bool>(&mut self, simd: S, near: Near, ends: Ends, terms: &Terms) {
        let other = gather(simd, near);
        let (d, r_sq) = wrap_lanes(simd, self.model, &self.own.at.x, &other.x);
        let mut v = [[0.0; LANES]; 3];
        for a in 0..3 {
            v[a] = minus(simd, &other.v[a], &self.own.at.v[a]);
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
                let volumes = self.own.at.volume[l] * other.volume[l];
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
        if ends == Ends::Fluids && self.model.tension() {
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
        let (own, own_share) = (&self.own.at.volume, &self.own_share);
        let laminar = if !PLAIN && self.mueller.is_some() { 0.0 } else { 1.0 };
        let mut out = [0.0; LANES];
        for l in 0..LANES {
            let g = self.g_factor * kernel.g(r_sq[l].sqrt() * self.inverse);
            let volumes = own[l] * volume[l];
            let v_dot_d = v[0][l] * d[0][l] + v[1][l] * d[1][l] + v[2][l] * d[2][l];
            let inverse_sq = fluid::softened_inverse(r_sq[l], self.softening);
            let along_d = fluid::pressure_force(volumes, own_share[l], share[l].max(self.floor).min(self.ceiling), g)
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
        let Diffusion { rate, stiffness, density, gravity } = diffusion;
        for l in 0..LANES {
            let weight = density[l] * (gravity.x * d[0][l] + gravity.y * d[1][l] + gravity.z * d[2][l]);
            let rate = rate[l] * terms.same[l];
            let own = self.own.at.share[l];
            self.rate[l] += fluid::density_diffusion(volume[l], own, share[l], weight, rate, stiffness[l], g[l]);
        }
    }

    /// E7: cohesion and curvature.
    #[inline(always)]
    fn add_tension(&mut self, list: &[u32; LANES], terms: &Terms, pairs: &Sixteen) {
        let Sixteen { volume, d, r_sq, .. } = pairs;
        let own = &self.own.at.volume;
        for l in 0..LANES {
            let r = r_sq[l].sqrt();
            let along_d = fluid::cohesion(own[l] * volume[l], terms.cohesion[l] * terms.same[l], r * self.inverse, r);
            for a in 0..3 {
                self.force[a][l] += along_d * d[a][l];
            }
        }
        if self.gradient.is_empty() {
            return;
        }
        for l in 0..LANES {
            let factor = fluid::curvature(own[l] * volume[l], terms.curvature[l] * terms.same[l]);
            let (own, other) = (self.gradient[self.own.i[l] as usize], self.gradient[list[l] as usize]);
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
                self.full[l] += if list[l] == self.own.i[l] { 0.0 } else { volume[l] * w[l] }; // padding is the particle
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
        for l in 0..LANES {
            if list[l] == self.own.i[l] {
                continue; // padding
            }
            for a in 0..3 {
                v[a][l] = match ends {
                    Ends::OnFluid => self.mirror[list[l] as usize][a] - self.own.at.v[a][l],
                    Ends::OnBody => other[a][l] - self.mirror[self.own.i[l] as usize][a],
                    Ends::Fluids => other[a][l] - self.own.at.v[a][l],
                };
            }
        }
        v
    }

    /// Where vorticity grows, in a lane.
    #[inline(always)]
    pub fn growth(&self, l: usize) -> Vec3 {
        lane(&self.growth, l)
    }

    /// Force (N) in a lane.
    #[inline(always)]
    pub fn force(&self, l: usize) -> Vec3 {
        lane(&self.force, l)
    }

    /// Sum of the forces of all lanes (N): those of one particle.
    #[inline(always)]
    pub fn total<S: Simd>(&self, simd: S) -> Vec3 {
        Vec3::new(sum(simd, &self.force[0]), sum(simd, &self.force[1]), sum(simd, &self.force[2]))
    }

    /// `dD/dt` (1/s) in a lane; zero where densities are summed.
    #[inline(always)]
    pub fn rate(&self, l: usize) -> f32 {
        if self.continuity.is_some() { self.rate[l] } else { 0.0 }
    }

    /// Velocity added to a lane's particle's own when it drifts (m/s). `fastest` is the largest speed (m/s).
    #[inline(always)]
    pub fn carry(&self, l: usize, fastest: f32) -> Vec3 {
        let mut carry = if self.xsph { lane(&self.carry, l) } else { Vec3::ZERO };
        // only inside a fluid: at a free surface the gap would draw particles out
        let inner = SHIFTED_ABOVE - self.model.factors.w_own * self.model.volume as f32;
        if self.shift && self.full[l] > inner {
            let drive = self.model.solver.shifting as f32 * fastest * lane(&self.drive, l);
            carry += drive.clamp_length_max(0.5 * fastest);
        }
        carry
    }
}

/// One lane of a vector.
#[inline(always)]
fn lane(of: &[Lanes; 3], l: usize) -> Vec3 {
    Vec3::new(of[0][l], of[1][l], of[2][l])
}

/// Particles with at least this much of a full neighbourhood `sum V_j W_ij` are shifted.
pub(crate) const SHIFTED_ABOVE: f32 = 0.93;
