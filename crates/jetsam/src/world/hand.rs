//! What a hand does to a world that runs: it holds a body, pours fluid, frightens agents, changes what the scene says.
//!
//! In: places in the scene's coordinates. Called between steps, by the window. What is done is counted as impulse from outside, so
//! that the momentum ledger stays true.

use super::World;
use crate::assemble::Assembly;
use crate::integrate::bodies;
use crate::integrate::sources::Source;
use crate::model::Model;
use crate::scene::FlockModel;
use crate::state::{Bodies, Body, Contacts, Kind, Particles, State};
use glam::{DMat3, DVec3, Vec3};

/// A body held at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grip {
    /// Index of the body.
    pub body: usize,
    /// The point in the body's frame about its centre of mass (m).
    pub at: DVec3,
    /// Where it is drawn to (m).
    pub to: DVec3,
}

/// The point held comes this much nearer to where it is drawn, by 1/e (s).
const PULL: f64 = 0.06;
/// The point held takes the velocity of the pull in this time (s).
const HOLD: f64 = 0.015;
/// A held body stops spinning, by 1/e (s).
const STEADY: f64 = 0.3;
/// Fluid closer to a new body's particle than this many spacings makes room.
const CARVE: f64 = 0.85;

/// Why a world cannot go on with another scene's constants.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Mismatch {
    /// Spacing, dimensions, domain or support differ.
    #[error("the space or its particles differ")]
    Space,
    /// A body is missing or has other particles.
    #[error("a body is missing or has another shape")]
    Bodies,
    /// There are other fluids or flocks.
    #[error("the fluids or the flocks differ")]
    Species,
    /// A new body would stand in another.
    #[error("there is no room for the body")]
    Room,
}

impl World {
    /// Holds a body at a point from now on, or lets go. What is held follows at no more than the largest speed of the scene.
    /// Bodies that forces do not move stay.
    pub fn grip(&mut self, grip: Option<Grip>) {
        let moves = |g: &Grip| self.model.contacts.get(g.body).is_some_and(|c| c.inverse_mass > 0.0);
        self.grip = grip.filter(moves);
    }

    /// The impulse of the hand in a step of `dt`, before it: the velocity of the point held approaches that of the pull.
    pub(super) fn hold(&mut self, dt: f64) {
        let Some(grip) = self.grip else { return };
        let (fastest, flat) = (self.model.largest_speed, self.model.dimensions == 2);
        let mut impulse = DVec3::ZERO;
        self.backend.edit(&self.model, &mut |state| {
            let body = &mut state.bodies.body[grip.body];
            impulse = pulled(body, grip, fastest, flat, dt);
            body.asleep = false;
            body.still = 0.0;
        });
        self.momentum.impulse += impulse;
    }

    /// Fluid comes from a hose from now on ([`crate::Scene::hose`]), or no longer. A hose that is moved goes on in its rhythm.
    pub fn pour(&mut self, hose: Option<Source>) {
        let sources = &mut self.model.sources;
        let before = sources.iter().position(|s| s.stream == Source::HAND).map(|k| sources.remove(k));
        if let Some(mut hose) = hose {
            if let Some(before) = before {
                hose.span = before.span;
            }
            sources.push(hose);
        }
        self.backend.sources_changed(&self.model, self.time);
    }

    /// Frightens all agents within `radius` (m) of a place: they dart away from it at their largest speed. Returns how many.
    pub fn scare(&mut self, center: DVec3, radius: f64) -> usize {
        let (model, mut count, mut impulse) = (&self.model, 0, DVec3::ZERO);
        self.backend.edit(model, &mut |state| {
            let agents = &mut state.agents;
            for flock in &model.flocks {
                for i in flock.range() {
                    let mut away = Vec3::from(agents.record[i].x) - center.as_vec3();
                    if model.dimensions == 2 {
                        away.y = 0.0;
                    }
                    if f64::from(away.length()) > radius {
                        continue;
                    }
                    let before = Vec3::from(agents.record[i].v);
                    let after = flock.limits.fastest * away.try_normalize().unwrap_or(Vec3::X);
                    agents.record[i].v = after.to_array();
                    if flock.model != FlockModel::Reynolds {
                        agents.next[i] = after.to_array();
                    }
                    impulse += flock.matter.map_or(0.0, |m| f64::from(m.mass)) * (after - before).as_dvec3();
                    count += 1;
                }
            }
        });
        self.momentum.impulse += impulse;
        count
    }

    /// Goes on with the constants and the bodies of another assembly of about the same scene: particles stay where they are, bodies
    /// that are known by name and shape keep their motion, new ones begin as they stand there, and fluid makes room for them. The
    /// momentum ledger begins anew.
    ///
    /// # Errors
    /// What keeps the two apart; the world is as before, and the assembly comes back.
    pub fn take_over(&mut self, assembly: Assembly) -> Result<(), (Mismatch, Box<Assembly>)> {
        let twins = match twins(&self.model, self.state(), &assembly) {
            Ok(twins) => twins,
            Err(mismatch) => return Err((mismatch, assembly.into())),
        };
        let Assembly { mut model, mut state, meshes } = assembly;
        let hand = self.model.sources.iter().find(|s| s.stream == Source::HAND);
        model.sources.extend(hand.cloned());
        carry_over(self.state(), &mut state, &twins, &model, self.time);
        self.grip = None;
        (self.model, self.meshes) = (model, meshes);
        self.backend.upload(&self.model, state);
        self.evaluate();
        self.begin_ledger();
        Ok(())
    }
}

/// The hand's impulse on a body (N s), given to it.
fn pulled(body: &mut Body, grip: Grip, fastest: f64, flat: bool, dt: f64) -> DVec3 {
    let arm = body.q * grip.at;
    let mut away = grip.to - (body.x + arm);
    if flat {
        away.y = 0.0;
    }
    let wanted = (away / PULL).clamp_length_max(fastest);
    let missing = wanted - (body.v + body.omega.cross(arm));
    // K of the point: what an impulse there does to its velocity
    let inverse_inertia = body.inverse_inertia_at(body.q);
    let cross = DMat3::from_cols(
        DVec3::new(0.0, arm.z, -arm.y),
        DVec3::new(-arm.z, 0.0, arm.x),
        DVec3::new(arm.y, -arm.x, 0.0),
    );
    let k = DMat3::from_diagonal(DVec3::splat(1.0 / body.mass)) + cross.transpose() * inverse_inertia * cross;
    let mut impulse = (1.0 - (-dt / HOLD).exp()) * (k.inverse() * missing);
    if flat {
        impulse.y = 0.0;
    }
    body.v += impulse / body.mass;
    body.l = (-dt / STEADY).exp() * body.l + arm.cross(impulse);
    body.omega = inverse_inertia * body.l;
    impulse
}

/// For each body of the assembly the body of the world that it is.
fn twins(model: &Model, state: &State, new: &Assembly) -> Result<Vec<Option<usize>>, Mismatch> {
    let (a, b) = (&model.grid, &new.model.grid);
    let same = model.dimensions == new.model.dimensions
        && model.spacing == new.model.spacing
        && (a.min, a.max, a.walls, a.cells) == (b.min, b.max, b.walls, b.cells);
    if !same {
        return Err(Mismatch::Space);
    }
    let fluids = |m: &Model| m.fluids.iter().map(|f| f.name.clone()).collect::<Vec<_>>();
    let flocks = |m: &Model| m.flocks.iter().map(|f| (f.name.clone(), f.count)).collect::<Vec<_>>();
    if fluids(model) != fluids(&new.model) || flocks(model) != flocks(&new.model) {
        return Err(Mismatch::Species);
    }
    let old = &state.bodies.body;
    let mut taken = vec![false; old.len()];
    let mut twin = |body: &Body| {
        let is = |k: &usize| {
            let o = &old[*k];
            !taken[*k] && o.name == body.name && o.slots.len() == body.slots.len() && o.is_static() == body.is_static()
        };
        let found = (0..old.len()).find(is);
        found.into_iter().for_each(|k| taken[k] = true);
        found
    };
    let twins: Vec<_> = new.state.bodies.body.iter().map(&mut twin).collect();
    if taken.contains(&false) {
        return Err(Mismatch::Bodies);
    }
    if blocked(model, state, &twins, &new.state) { Err(Mismatch::Room) } else { Ok(twins) }
}

/// Whether a particle of a new body stands within a contact diameter of a body's.
fn blocked(model: &Model, state: &State, twins: &[Option<usize>], new: &State) -> bool {
    let square = (model.contact_diameter * model.contact_diameter) as f32;
    let close = |x: Vec3| state.bodies.record.iter().any(|r| Vec3::from(r.x).distance_squared(x) < square);
    let fresh = new.bodies.body.iter().zip(twins).filter(|(_, twin)| twin.is_none());
    fresh.flat_map(|(body, _)| body.slots.clone()).any(|slot| close(new.bodies.record[slot].x.into()))
}

/// Puts the fluid, the agents and the motion of bodies of `old` into `new`.
fn carry_over(old: &State, new: &mut State, twins: &[Option<usize>], model: &Model, time: f64) {
    for (index, twin) in twins.iter().enumerate() {
        let Some(before) = twin.map(|k| &old.bodies.body[k]) else { continue };
        let body = &mut new.bodies.body[index];
        let (mass, slots) = (body.mass / before.mass, body.slots.clone());
        let (inverse_inertia, now, name) = (body.inverse_inertia, body.mass, std::mem::take(&mut body.name));
        *body = Body { mass: now, inverse_inertia, name, slots: slots.clone(), asleep: false, ..before.clone() };
        if mass.is_finite() {
            // the same shape: inertia grows with the mass
            body.l *= mass;
            body.l_half *= mass;
        }
        new.bodies.record[slots].copy_from_slice(&old.bodies.record[before.slots.clone()]);
    }
    carry_slips(&old.bodies, &mut new.bodies, twins);
    bodies::follow(&mut new.bodies, model);
    let room = new.particles.first[Kind::Rigid as usize];
    new.particles.record[room..].copy_from_slice(&new.bodies.record);
    let fresh = fresh_places(new, twins);
    pour_over(&old.particles, &mut new.particles, &fresh, model, time);
    if new.agents.record.len() == old.agents.record.len() {
        let force = std::mem::take(&mut new.agents.force);
        new.agents = old.agents.clone();
        if force.len() != new.agents.force.len() {
            new.agents.force = force;
        }
    }
}

/// Slips of the contacts between bodies that are in both, under their new slots.
fn carry_slips(old: &Bodies, new: &mut Bodies, twins: &[Option<usize>]) {
    let mut heir = vec![None; old.body.len()];
    twins.iter().enumerate().for_each(|(index, twin)| twin.iter().for_each(|&k| heir[k] = Some(index)));
    let moved = |slot: u32| {
        let body = old.owner[slot as usize] as usize;
        let index: usize = heir[body]?;
        Some((new.body[index].slots.start + slot as usize - old.body[body].slots.start) as u32)
    };
    let still = old.contacts.slipped().filter_map(|([a, b], slip)| Some(([moved(a)?, moved(b)?], slip)));
    new.contacts = Contacts::new(new.rigid_slots, still);
}

/// Particles of the bodies that are new.
fn fresh_places(new: &State, twins: &[Option<usize>]) -> Vec<Vec3> {
    let fresh = new.bodies.body.iter().zip(twins).filter(|(_, twin)| twin.is_none());
    fresh.flat_map(|(body, _)| body.slots.clone()).map(|slot| new.bodies.record[slot].x.into()).collect()
}

/// Puts the fluid of `old` into `new`, but for what stands where a new body is.
fn pour_over(old: &Particles, new: &mut Particles, fresh: &[Vec3], model: &Model, time: f64) {
    let square = (CARVE * CARVE * model.spacing * model.spacing) as f32;
    let (low, high) = fresh.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
    let margin = Vec3::splat(model.spacing as f32);
    new.count[Kind::Fluid as usize] = 0;
    for i in old.segment(Kind::Fluid) {
        let x = Vec3::from(old.record[i].x);
        let within = x.cmpge(low - margin).all() && x.cmple(high + margin).all();
        if within && fresh.iter().any(|p| p.distance_squared(x) < square) {
            continue;
        }
        let at = new.count[Kind::Fluid as usize];
        new.append(old.record[i], old.id[i], old.owner[i], time);
        new.density[at] = old.density[i];
        new.push[at] = old.push[i];
        new.push_before[at] = old.push_before[i];
        if let (Some(to), Some(from)) = (new.rate.get_mut(at), old.rate.get(i)) {
            *to = *from;
        }
        if let (Some(to), Some(from)) = (new.carry.get_mut(at), old.carry.get(i)) {
            *to = *from;
        }
        if let (Some(to), Some(from)) = (new.born.get_mut(at), old.born.get(i)) {
            *to = *from;
        }
    }
}
