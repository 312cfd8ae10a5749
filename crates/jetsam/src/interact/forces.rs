//! Stage `forces`: every law of pairs, evaluated from both ends of each pair (E4-E6, E10-E12, E16, E17, E30).
//!
//! In: neighbour runs, records with pressure shares. Out: `push`, an acceleration (m/s^2) for fluids and a force
//! (N) for the particles of bodies, `touch`, of what that force consists, and `carry` for XSPH.

use super::contacts::{self, Friction, Surfaces};
use super::density::{each_lane, weights};
use super::lanes::{LANES, Lanes, gather, sum};
use super::neighbours::{NeighbourChunk, Runs};
use crate::laws::{contact, field, fluid, kernel::Kernel};
use crate::model::Model;
use crate::scene::{Coupling, Damping, Force, Viscosity};
use crate::state::{Kind, Record, Touch};
use fearless_simd::Simd;
use glam::{DVec3, Vec3};

/// What the stage reads.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    /// Constants.
    pub model: &'a Model,
    /// All particles.
    pub records: &'a [Record],
    /// Owners of all particles.
    pub owner: &'a [u32],
    /// First index of the chunk.
    pub first: usize,
    /// Mass of the particles of each body (kg), for fields.
    pub particle_mass: &'a [f32],
    /// What contacts know of bodies.
    pub surfaces: Surfaces<'a>,
    /// Gravity now (m/s^2), shaking of the scene included.
    pub gravity: Vec3,
    /// Length of the step (s).
    pub dt: f32,
}

/// Forces on a chunk of particles of one kind.
#[inline(always)]
pub fn chunk<S: Simd>(
    simd: S,
    input: Input,
    kind: Kind,
    chunk: &NeighbourChunk,
    push: &mut [[f32; 3]],
    carry: &mut [[f32; 3]],
    touch: &mut [Touch],
) {
    for (k, runs) in chunk.runs.iter().enumerate() {
        let i = input.first + k;
        if kind == Kind::Fluid {
            let (force, carried) = on_fluid(simd, &input, chunk, runs, i);
            push[k] = force.to_array();
            if let Some(c) = carry.get_mut(k) {
                *c = carried.to_array();
            }
        } else {
            (push[k], touch[k]) = on_body(simd, &input, kind, chunk, runs, i);
        }
    }
}

/// Acceleration of a fluid particle, and its XSPH velocity.
#[inline(always)]
fn on_fluid<S: Simd>(simd: S, input: &Input, chunk: &NeighbourChunk, runs: &Runs, i: usize) -> (Vec3, Vec3) {
    let model = input.model;
    let own = &input.records[i];
    let owner = input.owner[i];
    let me = &model.fluids[owner as usize];
    let mut pairs = Pairs::new(model, own);
    let run = |kind| chunk.list[runs.padded(kind)].as_chunks::<LANES>().0;
    for list in run(Kind::Fluid) {
        let (mu_sum, eta) = if model.fluids.len() == 1 {
            ([2.0 * me.viscosity; LANES], [me.artificial; LANES])
        } else {
            let other = |l: usize| &model.fluids[input.owner[list[l] as usize] as usize];
            (
                std::array::from_fn(|l| me.viscosity + other(l).viscosity),
                std::array::from_fn(|l| 0.5 * (me.artificial + other(l).artificial)),
            )
        };
        pairs.add(simd, input.records, list, &mu_sum, &eta, model.solver.xsph);
    }
    // walls: no slip by the fluid's own viscosity, none by the artificial one
    let mu_sum = [2.0 * me.viscosity; LANES];
    for list in run(Kind::Static) {
        pairs.add(simd, input.records, list, &mu_sum, &[0.0; LANES], 0.0);
    }
    for &j in &chunk.list[runs.exact(Kind::Rigid)] {
        input.surfaces.wet(input.owner[j as usize]);
    }
    if model.solver.coupling == Coupling::Pressure {
        for list in run(Kind::Rigid) {
            pairs.add(simd, input.records, list, &mu_sum, &[0.0; LANES], 0.0);
        }
    }
    let mut contacts = Vec3::ZERO;
    for kind in [Kind::Rigid, Kind::Static] {
        if springs(model, kind, own) {
            let list = &chunk.list[runs.exact(kind)];
            contacts += sum_contacts(input, own, list, |(_, body)| Some(model.coupling_pair(owner, body)));
        }
    }
    let mut acceleration = (pairs.force(simd) + contacts) / me.mass + input.gravity;
    acceleration += fields(model, own);
    (acceleration, pairs.carry(simd))
}

/// Force on a particle of a body, and of what it consists.
#[inline(always)]
fn on_body<S: Simd>(
    simd: S,
    input: &Input,
    kind: Kind,
    chunk: &NeighbourChunk,
    runs: &Runs,
    i: usize,
) -> ([f32; 3], Touch) {
    let model = input.model;
    let own = &input.records[i];
    let owner = input.owner[i];
    let mut force = Vec3::ZERO;
    if kind == Kind::Static || model.solver.coupling == Coupling::Pressure {
        let mut pairs = Pairs::new(model, own);
        for list in chunk.list[runs.padded(Kind::Fluid)].as_chunks::<LANES>().0 {
            let mu_sum = if model.fluids.len() == 1 {
                [2.0 * model.fluids[0].viscosity; LANES]
            } else {
                // padding names the particle itself, whose owner is a body
                std::array::from_fn(|l| {
                    model.fluids.get(input.owner[list[l] as usize] as usize).map_or(0.0, |f| 2.0 * f.viscosity)
                })
            };
            pairs.add(simd, input.records, list, &mu_sum, &[0.0; LANES], 0.0);
        }
        force += pairs.force(simd);
    }
    let fluids = &chunk.list[runs.exact(Kind::Fluid)];
    force += sum_contacts(input, own, fluids, |(other, fluid)| {
        springs(model, kind, other).then(|| model.coupling_pair(fluid, owner))
    });
    let mut touch = Touch { fluid: force.to_array(), ..Touch::default() };
    let mut friction = Friction::default();
    for other in [Kind::Rigid, Kind::Static] {
        contacts::add(input, i, &chunk.list[runs.exact(other)], &mut touch, &mut friction);
    }
    force += Vec3::from(touch.contact);
    if model.moves(owner) {
        touch.slip = friction.slip();
        force += fields(model, own) * input.particle_mass[owner as usize];
    }
    (force.to_array(), touch)
}

/// Whether a fluid particle meets particles of bodies of a kind by springs (E16): where that is the coupling, and
/// where the fluid particle has no pressure (spray), as nothing else would hold it outside.
#[inline(always)]
fn springs(model: &Model, kind: Kind, fluid: &Record) -> bool {
    (kind == Kind::Rigid && model.solver.coupling == Coupling::Spring) || fluid.share <= 0.0
}

/// Sum of the forces (E12) of springs between a fluid's particle and bodies'. `constants` gives spring and dashpot for the other and its owner, or
/// `None` where there is no contact.
#[inline(always)]
fn sum_contacts(
    input: &Input,
    own: &Record,
    list: &[u32],
    constants: impl Fn((&Record, u32)) -> Option<(f32, f32)>,
) -> Vec3 {
    let model = input.model;
    let diameter = model.contact_diameter as f32;
    let normal_only = if model.solver.damping == Damping::Normal { 1.0 } else { 0.0 };
    let mut total = Vec3::ZERO;
    for &j in list {
        let other = &input.records[j as usize];
        let d = wrap(model, Vec3::from(other.x) - Vec3::from(own.x));
        let r = d.length();
        if r >= 1.5 * diameter {
            continue; // farther than a pair parts or meets in half a step
        }
        let v = Vec3::from(other.v) - Vec3::from(own.v);
        let Some((k, eta)) = constants((other, input.owner[j as usize])) else { continue };
        let f = contact::contact_force(d.to_array(), v.to_array(), r, diameter, k, eta, normal_only, input.dt);
        total += Vec3::new(f.x, f.y, f.z);
    }
    total
}

/// Fields at a particle (m/s^2), gravity aside (E30).
pub fn fields(model: &Model, own: &Record) -> Vec3 {
    let mut total = Vec3::ZERO;
    let single = |v: [f64; 3]| DVec3::from(v).as_vec3();
    for force in &model.fields {
        let away = |center: [f64; 3]| wrap(model, Vec3::from(own.x) - single(center)).to_array();
        let a = match *force {
            Force::Point { center, strength, core } => field::point_gravity(away(center), strength as f32, core as f32),
            Force::Wind { velocity, rate } => field::wind(own.v, single(velocity).to_array(), rate as f32),
            Force::Shake(_) => continue, // part of gravity
            Force::Vortex { center, axis, speed, core, rate } => {
                let axis = single(axis).normalize_or_zero().to_array();
                field::vortex(away(center), own.v, axis, speed as f32, core as f32, rate as f32)
            }
        };
        total += Vec3::new(a.x, a.y, a.z);
    }
    if model.dimensions == 2 {
        total.y = 0.0;
    }
    total
}

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
pub fn wrap_lanes(model: &Model, x: [f32; 3], other: &[Lanes; 3]) -> ([Lanes; 3], Lanes) {
    let mut d = [[0.0; LANES]; 3];
    for a in 0..3 {
        for l in 0..LANES {
            d[a][l] = other[a][l] - x[a];
        }
        let period = model.grid.period[a];
        if period > 0.0 {
            for l in 0..LANES {
                d[a][l] = shortest(d[a][l], period);
            }
        }
    }
    let mut r_sq = [0.0; LANES];
    for l in 0..LANES {
        r_sq[l] = d[0][l] * d[0][l] + d[1][l] * d[1][l] + d[2][l] * d[2][l];
    }
    (d, r_sq)
}

/// Sum of SPH pair forces on one particle (E4, E5) and of its XSPH velocity (E6), lane by lane.
struct Pairs<'a> {
    model: &'a Model,
    own: &'a Record,
    kernel: Kernel,
    g_factor: f32,
    w_factor: f32,
    inverse: f32,
    softening: f32,
    mueller: Option<f32>,
    force: [Lanes; 3],
    carry: [Lanes; 3],
}

impl<'a> Pairs<'a> {
    #[inline(always)]
    fn new(model: &'a Model, own: &'a Record) -> Self {
        let kernel = model.kernel.force();
        Self {
            model,
            own,
            kernel,
            g_factor: model.factors.g,
            w_factor: model.factors.w,
            inverse: model.inverse_support(),
            softening: model.softening(),
            mueller: (model.solver.viscosity == Viscosity::Mueller).then_some(model.factors.laplacian),
            force: [[0.0; LANES]; 3],
            carry: [[0.0; LANES]; 3],
        }
    }

    /// Adds sixteen neighbours. `mu_sum = mu_i + mu_j` and `eta` (Pa s) per lane.
    #[inline(always)]
    fn add<S: Simd>(
        &mut self,
        simd: S,
        records: &[Record],
        list: &[u32; LANES],
        mu_sum: &Lanes,
        eta: &Lanes,
        xsph: f64,
    ) {
        let own = self.own;
        let other = gather(simd, records, list);
        let (d, r_sq) = wrap_lanes(self.model, own.x, &other.x);
        let mut v = [[0.0; LANES]; 3];
        for a in 0..3 {
            for l in 0..LANES {
                v[a][l] = other.v[a][l] - own.v[a];
            }
        }
        let mut s = [0.0; LANES];
        for l in 0..LANES {
            s[l] = r_sq[l].sqrt() * self.inverse;
        }
        let shape = each_lane(
            self.kernel,
            &s,
            #[inline(always)]
            |k, s| k.g(s),
        );
        let (mut along_d, mut along_v) = ([0.0; LANES], [0.0; LANES]);
        for l in 0..LANES {
            let g = self.g_factor * shape[l];
            let volumes = own.volume * other.volume[l];
            let v_dot_d = v[0][l] * d[0][l] + v[1][l] * d[1][l] + v[2][l] * d[2][l];
            along_d[l] = fluid::pressure_force(volumes, own.share, other.share[l], g)
                + fluid::viscosity_artificial(volumes, eta[l], v_dot_d, r_sq[l], self.softening, g);
            along_v[l] = fluid::viscosity_laminar(volumes, mu_sum[l], r_sq[l], self.softening, g);
        }
        if let Some(factor) = self.mueller {
            let laplacian = each_lane(
                Kernel::Viscosity,
                &s,
                #[inline(always)]
                |k, s| k.g(s),
            );
            for l in 0..LANES {
                let volumes = own.volume * other.volume[l];
                along_v[l] = fluid::viscosity_mueller(volumes, mu_sum[l], factor * laplacian[l]);
            }
        }
        for a in 0..3 {
            for l in 0..LANES {
                self.force[a][l] += along_d[l] * d[a][l] + along_v[l] * v[a][l];
            }
        }
        if xsph > 0.0 {
            let w = weights(self.model.kernel.density(), self.inverse, &r_sq);
            for a in 0..3 {
                for l in 0..LANES {
                    let share = fluid::xsph(xsph as f32, other.volume[l], self.w_factor * w[l]);
                    self.carry[a][l] += share * v[a][l];
                }
            }
        }
    }

    #[inline(always)]
    fn force<S: Simd>(&self, simd: S) -> Vec3 {
        Vec3::new(sum(simd, &self.force[0]), sum(simd, &self.force[1]), sum(simd, &self.force[2]))
    }

    #[inline(always)]
    fn carry<S: Simd>(&self, simd: S) -> Vec3 {
        Vec3::new(sum(simd, &self.carry[0]), sum(simd, &self.carry[1]), sum(simd, &self.carry[2]))
    }
}
