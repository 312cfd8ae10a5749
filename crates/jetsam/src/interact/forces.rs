//! Stage `forces`: every law of pairs, evaluated from both ends of each pair (E4-E8, E10-E12, E16, E17, E30).
//!
//! In: neighbour runs, records with pressure shares. Out: `push`, an acceleration (m/s^2) for fluids and a force
//! (N) for the particles of bodies; `touch`, of what that force consists; `carry` for XSPH, shifting and the rate of density. Sums over SPH pairs are in [`super::pairs`], contacts of
//! bodies in [`super::contacts`].

use super::contacts::Surfaces;
use super::gradients::confinement;
use super::lanes::{LANES, listed};
use super::neighbours::{NeighbourChunk, Runs};
use super::pairs::{Ends, Pairs, Terms, wrap};
use super::slices::{Own, Slices};
use crate::laws::{contact, field};
use crate::model::{CONTACT_REACH, Model};
use crate::scene::{Coupling, Damping, Force};
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
    /// Bodies as those see them that touch them.
    pub surfaces: Surfaces<'a>,
    /// Gravity now (m/s^2), shaking of the scene included.
    pub gravity: Vec3,
    /// Length of the step (s).
    pub dt: f32,
    /// Largest speed of any particle (m/s), for shifting.
    pub fastest: f32,
}

/// What the stage writes of a chunk of fluid. What nobody asks for is empty.
pub struct OnFluids<'a> {
    /// Acceleration (m/s^2).
    pub push: &'a mut [[f32; 3]],
    /// Velocity by which fluids are carried besides their own (m/s), and `dD/dt` (1/s).
    pub carry: &'a mut [[f32; 4]],
    /// In: `curl v` (1/s). Out: the acceleration of confinement (m/s^2).
    pub vorticity: &'a mut [[f32; 3]],
}

/// What the stage writes of a chunk of bodies' particles.
pub struct OnBodies<'a> {
    /// Force (N).
    pub push: &'a mut [[f32; 3]],
    /// Of what the forces consist.
    pub touch: &'a mut [Touch],
}

/// Forces on a chunk of fluid particles.
#[inline(always)]
pub fn fluids<S: Simd>(simd: S, input: Input, slices: &Slices, out: OnFluids) {
    // most scenes ask for no more than pressure and viscosity: the rest is then not even compiled in
    if input.model.plain() && input.mirror.is_empty() {
        on_fluids::<S, true>(simd, input, slices, out);
    } else {
        on_fluids::<S, false>(simd, input, slices, out);
    }
}

/// Forces on a chunk of particles of bodies, contacts aside.
#[inline(always)]
pub fn bodies<S: Simd>(simd: S, input: Input, kind: Kind, chunk: &NeighbourChunk, out: OnBodies) {
    out.touch.fill(Touch::default());
    if input.model.plain() && input.mirror.is_empty() {
        on_bodies::<S, true>(simd, input, kind, chunk, out);
    } else {
        on_bodies::<S, false>(simd, input, kind, chunk, out);
    }
}

#[inline(always)]
fn on_bodies<S: Simd, const PLAIN: bool>(simd: S, input: Input, kind: Kind, chunk: &NeighbourChunk, out: OnBodies) {
    for (k, (push, touch)) in out.push.iter_mut().zip(out.touch).enumerate() {
        let runs = chunk.runs.get(k).copied().unwrap_or_default();
        *push = on_body::<S, PLAIN>(simd, &input, kind, chunk.list(), &runs, input.first + k, touch);
    }
}

#[inline(always)]
fn on_fluids<S: Simd, const PLAIN: bool>(simd: S, input: Input, slices: &Slices, out: OnFluids) {
    let OnFluids { push, carry, vorticity } = out;
    let model = input.model;
    for (s, members) in slices.each() {
        let pairs = pairs_of::<S, PLAIN>(simd, &input, slices, s);
        for (l, k) in members.enumerate() {
            let i = input.first + k;
            let own = &input.records[i];
            let owner = input.owner[i];
            let mut contacts = Vec3::ZERO;
            if slices.has(s, Kind::Rigid) || slices.has(s, Kind::Static) {
                contacts = springs_on(&input, slices, k, own, owner);
            }
            let force = pairs.force(l) + contacts;
            let mut total = force / model.fluids[owner as usize].mass + input.gravity + fields(model, own);
            if !PLAIN && model.solver.vorticity > 0.0 {
                let confined = confinement(model, pairs.growth(l), Vec3::from(vorticity[k]));
                total += confined;
                vorticity[k] = confined.to_array();
            }
            push[k] = total.to_array();
            if let Some(carry) = carry.get_mut(k) {
                let [x, y, z] = pairs.carry(l, input.fastest).to_array();
                *carry = [x, y, z, pairs.rate(l)];
            }
        }
    }
}

/// Sums over the pairs of sixteen fluid particles.
#[inline(always)]
fn pairs_of<'a, S: Simd, const PLAIN: bool>(simd: S, input: &Input<'a>, slices: &Slices, s: usize) -> Pairs<'a> {
    let model = input.model;
    let own = Own::slice(simd, input.records, slices, s);
    let mut owner = [0; LANES];
    let mut me = [&model.fluids[0]; LANES];
    if model.fluids.len() > 1 {
        for l in 0..LANES {
            owner[l] = input.owner[own.i[l] as usize];
            me[l] = &model.fluids[owner[l] as usize];
        }
    }
    let mut terms = Terms::bare([2.0 * me[0].viscosity; LANES]);
    (terms.eta, terms.same) = ([me[0].artificial; LANES], [1.0; LANES]);
    if !PLAIN {
        for l in 0..LANES {
            (terms.cohesion[l], terms.curvature[l]) = (me[l].cohesion, me[l].curvature);
        }
    }
    let mut pairs = Pairs::new(input, own, true);
    for near in slices.run(input.records, s, Kind::Fluid) {
        if model.fluids.len() > 1 {
            for l in 0..LANES {
                let other = input.owner[near.index[l] as usize];
                terms.same[l] = if other == owner[l] { 1.0 } else { 0.0 };
                let other = &model.fluids[other as usize];
                terms.mu_sum[l] = me[l].viscosity + other.viscosity;
                terms.eta[l] = 0.5 * (me[l].artificial + other.artificial);
            }
        }
        pairs.add::<S, PLAIN>(simd, near, Ends::Fluids, &terms);
    }
    // walls: the fluid's own viscosity acts (unless they are free of it), the artificial one does not
    let mut mu = [0.0; LANES];
    if !model.solver.walls_slip {
        for l in 0..LANES {
            mu[l] = 2.0 * me[l].viscosity;
        }
    }
    let terms = Terms::bare(mu);
    for near in slices.run(input.records, s, Kind::Static) {
        pairs.add::<S, PLAIN>(simd, near, Ends::OnFluid, &terms);
    }
    if model.solver.coupling == Coupling::Pressure {
        for near in slices.run(input.records, s, Kind::Rigid) {
            pairs.add::<S, PLAIN>(simd, near, Ends::OnFluid, &terms);
        }
    }
    pairs
}

/// Force of springs of bodies' particles on a fluid particle (N); bodies that sleep are told that it is there.
#[inline(always)]
fn springs_on(input: &Input, slices: &Slices, k: usize, own: &Record, owner: u32) -> Vec3 {
    for j in slices.exact(k, Kind::Rigid) {
        input.surfaces.wet(input.owner[j as usize]);
    }
    let mut contacts = Vec3::ZERO;
    for kind in [Kind::Rigid, Kind::Static] {
        if springs(input.model, kind, own) {
            let constants = |_: &Record, body| Some(input.model.coupling_pair(owner, body));
            contacts += sum_contacts(input, own, slices.exact(k, kind), constants);
        }
    }
    contacts
}

/// Force on a particle of a body; that of fluids is noted.
#[inline(always)]
fn on_body<S: Simd, const PLAIN: bool>(
    simd: S,
    input: &Input,
    kind: Kind,
    list: &[u32],
    runs: &Runs,
    i: usize,
    touch: &mut Touch,
) -> [f32; 3] {
    let model = input.model;
    let own = &input.records[i];
    let owner = input.owner[i];
    let mut force = Vec3::ZERO;
    let wet = runs.count(Kind::Fluid) > 0;
    if wet && (kind == Kind::Static || model.solver.coupling == Coupling::Pressure) {
        let mut pairs = Pairs::new(input, Own::one(input.records, i), false);
        let mut terms = Terms::bare([0.0; LANES]);
        for near in listed(input.records, &list[runs.padded(Kind::Fluid)]) {
            if !model.solver.walls_slip {
                for l in 0..LANES {
                    // padding names the particle itself, whose owner is a body
                    let fluid = if model.fluids.len() == 1 { 0 } else { input.owner[near.index[l] as usize] };
                    terms.mu_sum[l] = model.fluids.get(fluid as usize).map_or(0.0, |f| 2.0 * f.viscosity);
                }
            }
            pairs.add::<S, PLAIN>(simd, near, Ends::OnBody, &terms);
        }
        force += pairs.total(simd);
    }
    if any_springs(model, kind) {
        let fluids = list[runs.exact(Kind::Fluid)].iter().copied();
        force += sum_contacts(input, own, fluids, |other, fluid| {
            springs(model, kind, other).then(|| model.coupling_pair(fluid, owner))
        });
    }
    touch.fluid = force.to_array();
    if model.moves(owner) {
        force += fields(model, own) * input.particle_mass[owner as usize];
    }
    force.to_array()
}

/// Whether a fluid particle meets particles of bodies of a kind by springs (E16): where that is the coupling, and
/// where the fluid particle has no pressure (spray), as nothing else would hold it outside; implicit pressure does.
#[inline(always)]
fn springs(model: &Model, kind: Kind, fluid: &Record) -> bool {
    any_springs(model, kind) && (fluid.share <= 0.0 || always_springs(model, kind))
}

/// Whether any may.
#[inline(always)]
fn any_springs(model: &Model, kind: Kind) -> bool {
    always_springs(model, kind) || !model.implicit()
}

/// Whether all do.
#[inline(always)]
fn always_springs(model: &Model, kind: Kind) -> bool {
    kind == Kind::Rigid && model.solver.coupling == Coupling::Spring
}

/// Sum of the forces (E12) of springs between a fluid's particle and bodies'. `constants` gives spring and dashpot for the other and its owner, or
/// `None` where there is no contact.
#[inline(always)]
fn sum_contacts(
    input: &Input,
    own: &Record,
    list: impl Iterator<Item = u32>,
    constants: impl Fn(&Record, u32) -> Option<(f32, f32)>,
) -> Vec3 {
    let model = input.model;
    let diameter = model.contact_diameter as f32;
    let normal_only = if model.solver.damping == Damping::Normal { 1.0 } else { 0.0 };
    let mut total = Vec3::ZERO;
    for j in list {
        let other = &input.records[j as usize];
        let d = wrap(model, Vec3::from(other.x) - Vec3::from(own.x));
        let r = d.length();
        if r >= CONTACT_REACH as f32 * diameter {
            continue; // farther than a pair parts or meets in half a step
        }
        let v = Vec3::from(other.v) - Vec3::from(own.v);
        let Some((k, eta)) = constants(other, input.owner[j as usize]) else { continue };
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
