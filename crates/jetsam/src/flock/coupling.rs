//! Agents of mass are pushed by what they meet, and push it back: drag in fluids (E27), contact with bodies (E28).
//!
//! In: agents where they are at the end of the step, and the particles around, forces on them known. Out: the force on each agent, the
//! rest of its kick, and the opposite forces, added to the particles' `push` and `touch`. Those are kept agent by agent and added
//! one after another, so that sums do not depend on threads.

use super::model::{FlockConstants, Matter};
use super::obstacles::each_near;
use super::stage::World;
use crate::interact::CHUNK;
use crate::laws::{contact, flock};
use crate::model::Model;
use crate::state::{Agents, Kind, Particles, Record};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Below this part of its support filled with fluid an agent is dry.
const DRY: f32 = 1e-6;
/// From this part on it is all wet.
const WET: f32 = 0.9;

/// What one particle gets from one agent (N).
#[derive(Clone, Copy, Debug)]
struct Push {
    particle: usize,
    fluid: bool,
    force: Vec3,
}

/// Forces between agents and what is around them.
#[derive(Default)]
pub struct Coupling {
    /// By flock and chunk of agents.
    pushes: Vec<Vec<Push>>,
}

impl Coupling {
    /// Forces on all agents of mass. `first` is the part of the step (s) that was kicked before the drift: velocities still lack the
    /// rest, and get it.
    pub fn feel(&mut self, world: &World, agents: &mut Agents, dt: f64, first: f64) {
        let mut used = 0;
        for flock in &world.model.flocks {
            let Some(matter) = &flock.matter else { continue };
            let chunks = flock.count.div_ceil(CHUNK);
            self.pushes.resize_with(self.pushes.len().max(used + chunks), Vec::new);
            let pushes = self.pushes[used..used + chunks].par_iter_mut();
            let records = agents.record[flock.range()].par_chunks_mut(CHUNK);
            let forces = agents.force[flock.range()].par_chunks_mut(CHUNK);
            let kick = (dt - first) as f32 / matter.mass;
            pushes.zip(records).zip(forces).for_each(|((pushes, records), forces)| {
                pushes.clear();
                for (r, force) in records.iter_mut().zip(forces) {
                    let predicted = Vec3::from(r.v) + kick * Vec3::from(*force);
                    let felt = felt(world, flock, matter, r, predicted, dt as f32, pushes);
                    *force = felt.to_array();
                    r.v = (Vec3::from(r.v) + kick * felt).to_array();
                }
            });
            used += chunks;
        }
        self.pushes.truncate(used);
    }

    /// Adds the opposite forces to what they act on; bodies that are touched are `stirred`.
    pub fn give_back(&self, model: &Model, particles: &mut Particles, stirred: &[AtomicBool]) {
        let bodies_first = particles.first[Kind::Rigid as usize];
        for p in self.pushes.iter().flatten() {
            let owner = particles.owner[p.particle];
            let push = &mut particles.push[p.particle];
            if p.fluid {
                *push = (Vec3::from(*push) + p.force / model.fluids[owner as usize].mass).to_array();
            } else {
                let touch = &mut particles.touch[p.particle - bodies_first];
                *push = (Vec3::from(*push) + p.force).to_array();
                touch.agents = (Vec3::from(touch.agents) + p.force).to_array();
                stirred[owner as usize].store(true, Relaxed);
            }
        }
    }
}

/// Force on one agent (N); the opposites go to `pushes`.
fn felt(
    world: &World,
    rule: &FlockConstants,
    matter: &Matter,
    me: &Record,
    v: Vec3,
    dt: f32,
    pushes: &mut Vec<Push>,
) -> Vec3 {
    let begun = pushes.len();
    if !world.model.fluids.is_empty() {
        drag(world, matter, me, v, dt, pushes);
    }
    if world.has_bodies() {
        touch(world, rule, matter, me, v, dt, pushes);
    }
    // what it feels is what it gives, to rounding
    -pushes[begun..].iter().map(|p| p.force.as_dvec3()).sum::<DVec3>().as_vec3()
}

/// E27.
fn drag(world: &World, matter: &Matter, me: &Record, v: Vec3, dt: f32, pushes: &mut Vec<Push>) {
    let (model, p) = (world.model, world.particles);
    let begun = pushes.len();
    let kernel = model.kernel.density();
    let (support, inverse) = (model.support as f32, model.inverse_support());
    let (mut mass, mut momentum, mut filled) = (0.0, Vec3::ZERO, 0.0);
    each_near(world, Kind::Fluid, me.x, support, |j, d| {
        let fluid = &model.fluids[p.owner[j] as usize];
        let weight = fluid.mass * model.factors.w * kernel.w(d.length() * inverse);
        mass += weight;
        momentum += weight * Vec3::from(p.record[j].v);
        filled += weight / fluid.density;
        pushes.push(Push { particle: j, fluid: true, force: Vec3::splat(weight) });
    });
    if filled <= DRY {
        return pushes.truncate(begun);
    }
    let around = &mut pushes[begun..];
    // how easily the fluid around is moved: the change of its mean velocity by a unit impulse
    let yields = around
        .iter_mut()
        .map(|push| {
            push.force /= mass;
            push.force.x * push.force.x / model.fluids[p.owner[push.particle] as usize].mass
        })
        .sum::<f32>();
    let u = v - momentum / mass;
    let density = mass / filled.max(WET);
    let f = flock::drag(u.to_array(), density, matter.half_area, dt * (1.0 / matter.mass + yields));
    let f = Vec3::new(f.x, f.y, f.z);
    around.iter_mut().for_each(|push| push.force *= -f);
}

/// E28: the contact law between an agent and the particles of bodies and walls.
fn touch(world: &World, rule: &FlockConstants, matter: &Matter, me: &Record, v: Vec3, dt: f32, pushes: &mut Vec<Push>) {
    let (model, p) = (world.model, world.particles);
    let diameter = rule.contact(model.spacing, model.solver.contact_overlap) as f32;
    for kind in [Kind::Rigid, Kind::Static] {
        // a pair that meets within half a step counts for a part of it
        each_near(world, kind, me.x, 1.25 * diameter, |j, d| {
            let other = &p.record[j];
            let (k, eta) = model.agent_pair(matter.mass, p.owner[j]);
            let w = Vec3::from(other.v) - v;
            let f = contact::contact_force(d.to_array(), w.to_array(), d.length(), diameter, k, eta, 1.0, dt);
            let force = -Vec3::new(f.x, f.y, f.z);
            if force != Vec3::ZERO {
                pushes.push(Push { particle: j, fluid: false, force });
            }
        });
    }
}
