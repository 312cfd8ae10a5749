//! Stage `forces`: every law of pairs, evaluated from both ends of each pair (E4-E8, E10-E12, E16, E17, E30).
//!
//! In: neighbour runs, records with pressure shares. Out: `push`, an acceleration (m/s^2) for fluids and a force
//! (N) for the particles of bodies; `touch`, of what that force consists; `carry` for XSPH, shifting and the rate of density. Sums over SPH pairs are in [`super::pairs`], contacts of
//! bodies in [`super::contacts`].

use super::contacts::{self, Friction, Surfaces};
use super::gradients::confinement;
use super::lanes::{LANES, Listed};
use super::neighbours::{NeighbourChunk, Runs};
use super::pairs::{Ends, Pairs, Terms, wrap};
use crate::laws::{contact, field};
use crate::model::{CONTACT_REACH, Model};
use crate::scene::{Coupling, Damping, Force};
use crate::state::{Kind, Record, Slips, Touch};
use fearless_simd::Simd;
use glam::{DVec3, Vec3};

/// What the stage reads.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    /// Constants.
    pub model: &'a Model,
    /// All particles.
    pub records: &'a [Record],
    /// Velocities that bodies' particles show to viscosity (m/s); empty where they show their own.
    pub mirror: &'a [[f32; 4]],
    /// Colour gradients and vorticities of fluids; empty where they are not asked for.
    pub gradient: &'a [[f32; 4]],
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
    /// Largest speed of any particle (m/s), for shifting.
    pub fastest: f32,
}

/// What the stage writes of a chunk. What a kind has not, or nobody asks for, is empty.
pub struct Output<'a> {
    /// Acceleration of fluids (m/s^2), force on bodies' particles (N).
    pub push: &'a mut [[f32; 3]],
    /// Velocity by which fluids are carried besides their own (m/s), and `dD/dt` (1/s).
    pub carry: &'a mut [[f32; 4]],
    /// In: `curl v` of fluids (1/s). Out: the acceleration of confinement (m/s^2).
    pub vorticity: &'a mut [[f32; 3]],
    /// Of what the forces on bodies' particles consist.
    pub touch: &'a mut [Touch],
    /// Slips of the contacts of those that rub, in their order; [`Touch::slips`] tells whose.
    pub slips: &'a mut Vec<Slips>,
}

/// Forces on a chunk of particles of one kind.
#[inline(always)]
pub fn chunk<S: Simd>(simd: S, input: Input, kind: Kind, chunk: &NeighbourChunk, out: Output) {
    // most scenes ask for no more than pressure and viscosity: the rest is then not even compiled in
    if input.model.plain() && input.mirror.is_empty() {
        particles::<S, true>(simd, input, kind, chunk, out);
    } else {
        particles::<S, false>(simd, input, kind, chunk, out);
    }
}

#[inline(always)]
fn particles<S: Simd, const PLAIN: bool>(simd: S, input: Input, kind: Kind, chunk: &NeighbourChunk, out: Output) {
    let Output { push, carry, vorticity, touch, slips } = out;
    slips.clear();
    let listed = Listed::new(simd, input.records, chunk.list());
    for (k, runs) in chunk.runs.iter().enumerate() {
        let i = input.first + k;
        if kind != Kind::Fluid {
            (push[k], touch[k]) = on_body::<S, PLAIN>(simd, &input, kind, listed, runs, i, slips);
            continue;
        }
        let (pairs, mut total) = on_fluid::<S, PLAIN>(simd, &input, listed, runs, i);
        if input.model.solver.vorticity > 0.0 {
            let confined = confinement(input.model, pairs.growth(simd), Vec3::from(vorticity[k]));
            total += confined;
            vorticity[k] = confined.to_array();
        }
        push[k] = total.to_array();
        if let Some(carry) = carry.get_mut(k) {
            let [x, y, z] = pairs.carry(simd, input.fastest).to_array();
            *carry = [x, y, z, pairs.rate(simd)];
        }
    }
}

/// Sums over the pairs of a fluid particle, and its acceleration.
#[inline(always)]
fn on_fluid<'a, S: Simd, const PLAIN: bool>(
    simd: S,
    input: &Input<'a>,
    listed: Listed<'a>,
    runs: &Runs,
    i: usize,
) -> (Pairs<'a>, Vec3) {
    let model = input.model;
    let own = &input.records[i];
    let owner = input.owner[i];
    let me = &model.fluids[owner as usize];
    let mut pairs = Pairs::new(input, i, Some(owner));
    let run = |kind| listed.run(runs.padded(kind));
    let mut terms = Terms {
        mu_sum: [2.0 * me.viscosity; LANES],
        eta: [me.artificial; LANES],
        same: [1.0; LANES],
        cohesion: me.cohesion,
        curvature: me.curvature,
    };
    for near in run(Kind::Fluid) {
        if model.fluids.len() > 1 {
            for l in 0..LANES {
                let other = input.owner[near.index[l] as usize];
                terms.same[l] = if other == owner { 1.0 } else { 0.0 };
                let other = &model.fluids[other as usize];
                terms.mu_sum[l] = me.viscosity + other.viscosity;
                terms.eta[l] = 0.5 * (me.artificial + other.artificial);
            }
        }
        pairs.add::<S, PLAIN>(simd, near, Ends::Fluids, &terms);
    }
    // walls: the fluid's own viscosity acts (unless they are free of it), the artificial one does not
    let mu = if model.solver.walls_slip { 0.0 } else { 2.0 * me.viscosity };
    let terms = Terms { mu_sum: [mu; LANES], eta: [0.0; LANES], same: [0.0; LANES], cohesion: 0.0, curvature: 0.0 };
    for near in run(Kind::Static) {
        pairs.add::<S, PLAIN>(simd, near, Ends::OnFluid, &terms);
    }
    for &j in listed.indices(runs.exact(Kind::Rigid)) {
        input.surfaces.wet(input.owner[j as usize]);
    }
    if model.solver.coupling == Coupling::Pressure {
        for near in run(Kind::Rigid) {
            pairs.add::<S, PLAIN>(simd, near, Ends::OnFluid, &terms);
        }
    }
    let mut contacts = Vec3::ZERO;
    for kind in [Kind::Rigid, Kind::Static] {
        if springs(model, kind, own) {
            let list = listed.indices(runs.exact(kind));
            contacts += sum_contacts(input, own, list, |(_, body)| Some(model.coupling_pair(owner, body)));
        }
    }
    let push = (pairs.force(simd) + contacts) / me.mass + input.gravity + fields(model, own);
    (pairs, push)
}

/// Force on a particle of a body, and of what it consists.
#[inline(always)]
fn on_body<S: Simd, const PLAIN: bool>(
    simd: S,
    input: &Input,
    kind: Kind,
    listed: Listed,
    runs: &Runs,
    i: usize,
    slips: &mut Vec<Slips>,
) -> ([f32; 3], Touch) {
    let model = input.model;
    let own = &input.records[i];
    let owner = input.owner[i];
    let mut force = Vec3::ZERO;
    if kind == Kind::Static || model.solver.coupling == Coupling::Pressure {
        let mut pairs = Pairs::new(input, i, None);
        let mut terms =
            Terms { mu_sum: [0.0; LANES], eta: [0.0; LANES], same: [0.0; LANES], cohesion: 0.0, curvature: 0.0 };
        for near in listed.run(runs.padded(Kind::Fluid)) {
            if !model.solver.walls_slip {
                for l in 0..LANES {
                    // padding names the particle itself, whose owner is a body
                    let fluid = if model.fluids.len() == 1 { 0 } else { input.owner[near.index[l] as usize] };
                    terms.mu_sum[l] = model.fluids.get(fluid as usize).map_or(0.0, |f| 2.0 * f.viscosity);
                }
            }
            pairs.add::<S, PLAIN>(simd, near, Ends::OnBody, &terms);
        }
        force += pairs.force(simd);
    }
    let fluids = listed.indices(runs.exact(Kind::Fluid));
    force += sum_contacts(input, own, fluids, |(other, fluid)| {
        springs(model, kind, other).then(|| model.coupling_pair(fluid, owner))
    });
    let mut touch = Touch { fluid: force.to_array(), ..Touch::default() };
    let mut friction = Friction::default();
    for other in [Kind::Rigid, Kind::Static] {
        contacts::add(input, i, listed.indices(runs.exact(other)), &mut touch, &mut friction);
    }
    force += Vec3::from(touch.contact);
    touch.forgotten = friction.forgotten;
    if model.moves(owner) {
        if let Some(held) = friction.slips() {
            slips.push(held);
            touch.slips = slips.len() as u32;
        }
        force += fields(model, own) * input.particle_mass[owner as usize];
    }
    (force.to_array(), touch)
}

/// Whether a fluid particle meets particles of bodies of a kind by springs (E16): where that is the coupling, and
/// where the fluid particle has no pressure (spray), as nothing else would hold it outside; implicit pressure does.
#[inline(always)]
fn springs(model: &Model, kind: Kind, fluid: &Record) -> bool {
    (kind == Kind::Rigid && model.solver.coupling == Coupling::Spring) || fluid.share <= 0.0 && !model.implicit()
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
        if r >= CONTACT_REACH as f32 * diameter {
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
