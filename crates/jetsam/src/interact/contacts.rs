//! Contacts of particles of different bodies (E10-E13), seen from one of them; called by the stage `forces`.
//!
//! In: the neighbours of a body's particle, surface normals, tangential slips, spins. Out: a [`Touch`]: force, the couple
//! of forces that act where two particles touch, the slip that friction remembers, what was counted.

use super::forces::Input;
use super::pairs::wrap;
use crate::integrate::sleep::Rest;
use crate::laws::contact;
use crate::model::Model;
use crate::scene::{Damping, Surface};
use crate::state::Touch;
use glam::Vec3;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// What contacts know of bodies besides their particles' records.
#[derive(Clone, Copy)]
pub struct Surfaces<'a> {
    /// Slot of each particle of a body, by particle.
    pub slot: &'a [u32],
    /// Outward normals in world axes, by slot: see [`crate::state::Bodies::facing`].
    pub facing: &'a [[f32; 3]],
    /// Tangential slips (m), by slot.
    pub slip: &'a [[f32; 3]],
    /// Contacts that shared the load at the last step, by body.
    pub sharers: &'a [f32],
    /// Whether each body moves, is still, or sleeps.
    pub rest: &'a [Rest],
    /// Set for bodies that something restless touches.
    pub stirred: &'a [AtomicBool],
    /// Angular velocities (rad/s), by body.
    pub spin: &'a [[f32; 3]],
}

impl Surfaces<'_> {
    /// Notes that bodies `a` and `b` touch: what is restless keeps the other awake.
    #[inline(always)]
    fn stir(&self, a: u32, b: u32) {
        for (one, other) in [(a as usize, b as usize), (b as usize, a as usize)] {
            if self.rest[one] == Rest::Restless && self.rest[other] != Rest::Restless {
                self.stirred[other].store(true, Relaxed);
            }
        }
    }

    /// Notes that fluid is near body `b`.
    #[inline(always)]
    pub fn wet(&self, b: u32) {
        if self.rest[b as usize] == Rest::Asleep {
            self.stirred[b as usize].store(true, Relaxed);
        }
    }
}

/// Overlap (as a fraction of the contact diameter) from which on a pair is looked at that could pass through (E12).
pub(crate) const DEEP: f32 = 0.5;
/// It is stopped if its kinetic energy is so many times what the springs may still take.
pub(crate) const HELD: f32 = 1.05;

/// Adds the contacts with the particles in `list` to `touch`; `friction` collects what the slip is derived from.
#[inline(always)]
pub fn add(input: &Input, i: usize, list: &[u32], touch: &mut Touch, friction: &mut Friction) {
    let (model, surfaces) = (input.model, &input.surfaces);
    let own = &input.records[i];
    let owner = input.owner[i];
    let diameter = model.contact_diameter as f32;
    let full = model.solver.damping == Damping::Full;
    let smooth = model.solver.surface == Surface::Smooth;
    // farther than any pair that touches or meets in half a step
    let reach = if smooth { (1.5 * diameter).hypot(model.spacing as f32) } else { 1.5 * diameter };
    let slot = surfaces.slot[i] as usize;
    for &j in list {
        let other = &input.records[j as usize];
        let d = wrap(model, Vec3::from(other.x) - Vec3::from(own.x));
        let r = d.length();
        if r >= reach {
            continue;
        }
        let body = input.owner[j as usize];
        if model.apart(owner, body) {
            continue;
        }
        let other_slot = surfaces.slot[j as usize] as usize;
        let (mut n, mut along, mut s, mut part) = (d * (1.0 / r.max(1e-12)), d, r, 1.0);
        let (a, b) = (surfaces.facing[slot], surfaces.facing[other_slot]);
        // where they touch, seen from i: midway, or where a ball stands on a face
        let mut arm = 0.5 * d;
        if smooth && (a, b) != ([0.0; 3], [0.0; 3]) {
            let normal = contact::contact_normal(d.to_array(), r, a, b);
            let normal = Vec3::new(normal.x, normal.y, normal.z);
            if normal != n {
                (n, s) = (normal, d.dot(normal));
                along = n * s;
                part = contact::contact_part((d - along).length() / model.spacing as f32);
                if b == [0.0; 3] {
                    arm = d - 0.5 * along;
                } else if a == [0.0; 3] {
                    arm = 0.5 * along;
                }
            }
        }
        if s >= 1.5 * diameter || part <= 0.0 {
            continue;
        }
        let mut v = Vec3::from(other.v) - Vec3::from(own.v);
        if !full {
            // velocities where the bodies touch
            let spin = |body: u32| Vec3::from(surfaces.spin[body as usize]);
            v -= spin(owner).cross(arm) + spin(body).cross(d - arm);
        }
        let counted = surfaces.sharers[owner as usize].max(surfaces.sharers[body as usize]);
        let (k, eta) = model.contact_pair_of(owner, body, counted);
        let f = contact::contact_force(along.to_array(), v.to_array(), s, diameter, k, eta, f32::from(!full), input.dt);
        let mut f = Vec3::new(f.x, f.y, f.z) * part;
        let speed = v.dot(n);
        let overlap = diameter - s;
        let held = counted.max(1.0) * k * (diameter * diameter - overlap * overlap);
        let mass = model.reduced_mass(owner, body);
        if overlap > DEEP * diameter && speed < 0.0 && mass * speed * speed > HELD * held {
            f += n * (speed * part * model.stop(owner, body, input.dt));
            touch.deep += 1;
        }
        if s < diameter {
            touch.contacts += 1;
            surfaces.stir(owner, body);
            touch.sharers += part;
            if !full {
                let slip = Vec3::from(surfaces.slip[slot]) - Vec3::from(surfaces.slip[other_slot]);
                let springs = model.friction_pair(owner, body, k * part, part, counted);
                f += friction.pair(
                    model,
                    [owner, body],
                    springs,
                    slip,
                    v - n * speed,
                    (-f.dot(n)).max(0.0),
                    n,
                    input.dt,
                );
            }
        }
        touch.contact = (Vec3::from(touch.contact) + f).to_array();
        if !full {
            touch.couple = (Vec3::from(touch.couple) + arm.cross(f)).to_array();
        }
    }
}

/// Friction of one particle over all its contacts (E13; Cundall and Strack 1979).
#[derive(Default)]
pub struct Friction {
    pull: Vec3,
    stiffness: f32,
}

impl Friction {
    /// Tangential force of a pair. `slip` and `v` are those of the other particle relative to this one, `load` the
    /// normal force; the springs are those of [`Model::friction_pair`].
    #[inline(always)]
    #[allow(clippy::too_many_arguments)] // one caller
    fn pair(
        &mut self,
        model: &Model,
        pair: [u32; 2],
        (k_t, eta_t, mu): (f32, f32, f32),
        slip: Vec3,
        v: Vec3,
        load: f32,
        n: Vec3,
        dt: f32,
    ) -> Vec3 {
        if mu <= 0.0 {
            return Vec3::ZERO;
        }
        // both particles remember the slip of a pair of moving bodies
        let share = if model.moves(pair[0]) && model.moves(pair[1]) { 0.5 } else { 1.0 };
        let slip = share * (slip - n * slip.dot(n)) + v * dt;
        let limit = mu * load;
        let spring = contact::friction((k_t * slip).to_array(), limit);
        let spring = Vec3::new(spring.x, spring.y, spring.z);
        let total = contact::friction((spring + eta_t * v).to_array(), limit);
        self.pull += spring;
        self.stiffness += k_t;
        Vec3::new(total.x, total.y, total.z)
    }

    /// The slip to remember (m): what the springs of all contacts stand for together.
    #[inline(always)]
    pub fn slip(&self) -> [f32; 3] {
        if self.stiffness > 0.0 { (self.pull / self.stiffness).to_array() } else { [0.0; 3] }
    }
}
