//! Contacts of particles of different bodies (E10-E13), seen from one of them; called by the stage `forces`.
//!
//! In: the neighbours of a body's particle, surface normals, slips of contacts, spins. Out: a [`Touch`]: force, the couple
//! of forces that act where two particles touch, what was counted; and [`Slips`], what friction remembers of each contact.

use super::forces::Input;
use super::pairs::wrap;
use crate::integrate::sleep::Rest;
use crate::laws::contact;
use crate::scene::{Damping, Surface};
use crate::state::{HELD_CONTACTS, Slips, Touch};
use glam::Vec3;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// What contacts know of bodies besides their particles' records.
#[derive(Clone, Copy)]
pub struct Surfaces<'a> {
    /// Slot of each particle of a body, by particle.
    pub slot: &'a [u32],
    /// Outward normals in world axes, by slot: see [`crate::state::Bodies::facing`].
    pub facing: &'a [[f32; 3]],
    /// Slips of contacts, by slot of rigid bodies; empty where no body rubs.
    pub slips: &'a [Slips],
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

    /// Whether the first of a pair is the one that remembers its slip. One that sleeps remembers what it knew before.
    #[inline(always)]
    fn keeps(&self, pair: Pair) -> bool {
        pair.slot[0] < pair.slot[1] || self.asleep(pair.body[1])
    }

    #[inline(always)]
    fn asleep(&self, body: u32) -> bool {
        self.rest[body as usize] == Rest::Asleep
    }

    /// The slip of a contact up to now (m), seen from the first of the pair: the exact opposite of what the other sees.
    #[inline(always)]
    fn slip(&self, pair: Pair) -> [f32; 3] {
        let of = |one: usize, other: usize| self.slips.get(one).and_then(|s| s.of(other as u32));
        let [own, other] = pair.slot;
        let mine = if self.keeps(pair) { of(own, other) } else { None };
        let theirs = || of(other, own).filter(|_| own > other || self.asleep(pair.body[1])).map(|s| s.map(|x| -x));
        mine.or_else(theirs).unwrap_or_default()
    }

    /// Notes that fluid is near body `b`.
    #[inline(always)]
    pub fn wet(&self, b: u32) {
        if self.asleep(b) {
            self.stirred[b as usize].store(true, Relaxed);
        }
    }
}

/// Overlap (as a fraction of the contact diameter) from which on a pair is looked at that could pass through (E12).
pub(crate) const DEEP: f32 = 0.5;
/// It is stopped if its kinetic energy is so many times what the springs may still take.
pub(crate) const HELD: f32 = 1.05;

/// Adds the contacts with the particles in `list` to `touch`; `friction` remembers their slips.
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
                let springs = model.friction_pair(owner, body, k * part, part, counted);
                let pair = Pair { slot: [slot, other_slot], body: [owner, body] };
                f += friction.pair(input, pair, springs, v - n * speed, (-f.dot(n)).max(0.0), n);
            }
        }
        touch.contact = (Vec3::from(touch.contact) + f).to_array();
        if !full {
            touch.couple = (Vec3::from(touch.couple) + arm.cross(f)).to_array();
        }
    }
}

/// Friction of one particle at all its contacts (E13; Cundall and Strack 1979; Luding 2008): what it goes on remembering of them.
#[derive(Default)]
pub struct Friction {
    slips: Slips,
    load: [f32; HELD_CONTACTS],
    /// Contacts for whose slip there was no place.
    pub forgotten: u32,
}

/// Who touches whom: slots and bodies of this particle and of the other.
#[derive(Clone, Copy)]
struct Pair {
    slot: [usize; 2],
    body: [u32; 2],
}

impl Friction {
    /// Tangential force of a pair with the springs of [`Model::friction_pair`]. `v`: tangential velocity of the other relative to
    /// this one, `load`: the normal force, `n`: the normal towards the other.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)] // one caller
    fn pair(
        &mut self,
        input: &Input,
        pair: Pair,
        (k_t, eta_t, mu): (f32, f32, f32),
        v: Vec3,
        load: f32,
        n: Vec3,
    ) -> Vec3 {
        if mu <= 0.0 {
            return Vec3::ZERO;
        }
        let (surfaces, dt) = (&input.surfaces, input.dt);
        let spin = pair.body.map(|body| Vec3::from(surfaces.spin[body as usize]));
        let turn = 0.5 * dt * (spin[0] + spin[1]).dot(n);
        let slip = contact::slip_carried(surfaces.slip(pair), n.to_array(), turn);
        let slip = Vec3::new(slip.x, slip.y, slip.z) + v * dt;
        let limit = mu * load;
        let spring = contact::friction((k_t * slip).to_array(), limit);
        let spring = Vec3::new(spring.x, spring.y, spring.z);
        if surfaces.keeps(pair) && k_t > 0.0 {
            self.keep(pair.slot[1] as u32, (spring / k_t).to_array(), load);
        }
        let total = contact::friction((spring + eta_t * v).to_array(), limit);
        Vec3::new(total.x, total.y, total.z)
    }

    /// Remembers the slip of a contact; where there are too many, the one that bears least is forgotten.
    #[inline(always)]
    fn keep(&mut self, with: u32, slip: [f32; 3], load: f32) {
        let mut weakest = 0;
        for k in 0..HELD_CONTACTS {
            if self.slips.with[k] == Slips::NONE {
                (self.slips.with[k], self.slips.slip[k], self.load[k]) = (with, slip, load);
                return;
            }
            if self.load[k] < self.load[weakest] {
                weakest = k;
            }
        }
        self.forgotten += 1;
        if load > self.load[weakest] {
            (self.slips.with[weakest], self.slips.slip[weakest], self.load[weakest]) = (with, slip, load);
        }
    }

    /// What is remembered.
    #[inline(always)]
    pub fn slips(&self) -> Option<Slips> {
        (!self.slips.is_empty()).then_some(self.slips)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of more contacts than a particle remembers those that bear most stay, and the others are counted.
    #[test]
    fn forgotten_slips_are_counted() {
        let mut friction = Friction::default();
        let loads = [3.0, 1.0, 5.0, 2.0, 9.0, 7.0, 4.0, 6.0, 8.0, 0.5];
        for (with, load) in (0..).zip(loads) {
            friction.keep(with, [load, 0.0, 0.0], load);
        }
        let slips = friction.slips().expect("eight slips");
        assert_eq!(friction.forgotten as usize, loads.len() - HELD_CONTACTS);
        // the ninth took the place of the one that bore least, the tenth bears less than any
        assert_eq!((slips.of(8), slips.of(1), slips.of(9)), (Some([8.0, 0.0, 0.0]), None, None));
    }
}
