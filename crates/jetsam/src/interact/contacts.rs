//! Contacts of particles of different bodies (E10-E13), seen from one of them; called by the stage `forces`.
//!
//! In: the lists of slots that may touch, surface normals, slips of contacts, what contacts know of bodies. Out: a [`Touch`]
//! for each particle: force, the couple of forces that act where two particles touch, what was counted; and [`Slips`], what
//! friction remembers of each contact.
//!
//! Those of a list that come near enough are gathered, sixteen pairs of whatever particles at a time, and the laws are worked
//! out in lanes; what comes out is added particle by particle, in the order of lists.

use super::forces::Input;
use super::kept::{FACED, Kept, Reach};
use super::lanes::{LANES, Lanes};
use super::pairs::wrap;
use crate::integrate::sleep::{self, Rest};
use crate::laws::contact;
use crate::model::{ContactModel, Model, TANGENTIAL, TANGENTIAL_DAMPING};
use crate::scene::{Damping, Surface};
use crate::state::{Body, HELD_CONTACTS, Record, Slips, Touch};
use fearless_simd::Simd;
use glam::Vec3;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// What contacts know of a body.
#[derive(Clone, Copy, Debug, Default)]
pub struct Solid {
    inverse_mass: f32,
    ln_restitution: f32,
    shared_by: f32,
    face: f32,
    friction: f32,
    stiffness: f32,
    damping: f32,
    /// Contacts that shared the load at the last step.
    sharers: f32,
    /// Angular velocity (rad/s).
    spin: Vec3,
    rest: Rest,
}

impl Solid {
    /// What they know of a body as it moves now.
    pub fn of(body: &Body, contact: &ContactModel) -> Self {
        Self {
            inverse_mass: contact.inverse_mass,
            ln_restitution: contact.ln_restitution,
            shared_by: contact.shared_by,
            face: contact.face,
            friction: contact.friction,
            stiffness: contact.stiffness,
            damping: contact.damping,
            sharers: body.sharers,
            spin: body.omega.as_vec3(),
            rest: sleep::rest(body),
        }
    }
}

/// What contacts read.
#[derive(Clone, Copy)]
pub struct Surfaces<'a> {
    /// Slot of each particle of a body, by particle.
    pub slot: &'a [u32],
    /// Slots that may touch.
    pub kept: &'a Kept,
    /// What particles show to pairs, by slot.
    pub record: &'a [Record],
    /// Body of each slot.
    pub owner: &'a [u32],
    /// Outward normals in world axes, by slot: see [`crate::state::Bodies::facing`].
    pub facing: &'a [[f32; 3]],
    /// Slips of contacts, by slot of rigid bodies; empty where no body rubs.
    pub slips: &'a [Slips],
    /// Whether there are any, slot by slot.
    pub held: &'a [bool],
    /// Bodies.
    pub solid: &'a [Solid],
    /// Set for bodies that something restless touches.
    pub stirred: &'a [AtomicBool],
    /// Pairs farther apart neither touch nor meet in half a step.
    pub reach: Reach,
}

impl Surfaces<'_> {
    /// Notes that bodies `a` and `b` touch: what is restless keeps the other awake.
    #[inline(always)]
    fn stir(&self, a: u32, b: u32) {
        for (one, other) in [(a as usize, b as usize), (b as usize, a as usize)] {
            if self.solid[one].rest == Rest::Restless && self.solid[other].rest != Rest::Restless {
                self.stirred[other].store(true, Relaxed);
            }
        }
    }

    /// Whether the first of a pair is the one that remembers its slip. One that sleeps remembers what it knew before.
    #[inline(always)]
    fn keeps(&self, pair: Pair) -> bool {
        pair.slot[0] < pair.slot[1] || self.asleep(pair.body[1])
    }

    /// Whether a body sleeps.
    #[inline(always)]
    pub fn asleep(&self, body: u32) -> bool {
        self.solid[body as usize].rest == Rest::Asleep
    }

    /// The slip of a contact up to now (m), seen from the first of the pair: the exact opposite of what the other sees.
    #[inline(always)]
    fn slip(&self, pair: Pair) -> [f32; 3] {
        let of = |one: usize, other: usize| match self.held.get(one) {
            Some(true) => self.slips[one].of(other as u32),
            _ => None,
        };
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

/// Pairs of one particle looked at together.
const NEAR: usize = 32;

/// Contacts of the particles from `input.first` on that may touch any, and the slips of those that rub; [`Touch::slips`] tells whose.
#[inline(always)]
pub fn chunk<S: Simd>(_simd: S, input: &Input, touch: &mut [Touch], slips: &mut Vec<Slips>) {
    match (input.model.solver.surface == Surface::Smooth, input.model.solver.damping == Damping::Full) {
        (true, false) => particles::<true, false>(input, touch, slips),
        (false, false) => particles::<false, false>(input, touch, slips),
        (true, true) => particles::<true, true>(input, touch, slips),
        (false, true) => particles::<false, true>(input, touch, slips),
    }
}

#[inline(always)]
fn particles<const SMOOTH: bool, const FULL: bool>(input: &Input, touch: &mut [Touch], slips: &mut Vec<Slips>) {
    let (model, surfaces) = (input.model, &input.surfaces);
    slips.clear();
    let [balls, faces] = [surfaces.reach.balls, surfaces.reach.faces].map(|reach| (reach * reach) as f32);
    let mut batch = Batch::default();
    let mut friction = Friction::default();
    for k in 0..touch.len() {
        let slot = surfaces.slot[input.first + k] as usize;
        if !surfaces.kept.busy(slot) {
            continue;
        }
        touch[k] = Touch::default();
        // what sleeps feels nothing new
        if surfaces.asleep(surfaces.owner[slot]) {
            continue;
        }
        let own = Vec3::from(surfaces.record[slot].x);
        for listed in surfaces.kept.of(slot).chunks(NEAR) {
            // which are near is not to be foretold: all are noted, and those that are not are written over
            let (mut near, mut count) = ([(0, Vec3::ZERO); NEAR], 0);
            for &listed in listed {
                let other = (listed & !FACED) as usize;
                let d = wrap(model, Vec3::from(surfaces.record[other].x) - own);
                near[count % NEAR] = (other, d);
                let limit = if listed & FACED != 0 { faces } else { balls };
                count += usize::from(d.length_squared() < limit);
            }
            for &(other, d) in &near[..count.min(NEAR)] {
                batch.add(surfaces, k, [slot, other], d);
                if batch.len == LANES {
                    let found = law::<SMOOTH, FULL>(input, &batch);
                    give::<FULL>(input, &batch, &found, touch, &mut friction, slips);
                    batch.len = 0;
                }
            }
        }
    }
    if batch.len > 0 {
        let found = law::<SMOOTH, FULL>(input, &batch);
        give::<FULL>(input, &batch, &found, touch, &mut friction, slips);
    }
    friction.end(input, touch, slips);
}

/// Sixteen pairs, and what laws ask of them.
#[derive(Default)]
struct Batch {
    len: usize,
    /// Particle of the chunk.
    k: [usize; LANES],
    slot: [[usize; 2]; LANES],
    d: [Lanes; 3],
    v: [Lanes; 3],
    facing: [[Lanes; 3]; 2],
    spin: [[Lanes; 3]; 2],
    inverse_mass: [Lanes; 2],
    friction: [Lanes; 2],
    ln_restitution: Lanes,
    shared_by: Lanes,
    face: Lanes,
    stiffness: Lanes,
    damping: Lanes,
    counted: Lanes,
    slip: [Lanes; 3],
}

impl Batch {
    #[inline(always)]
    fn add(&mut self, surfaces: &Surfaces, k: usize, slot: [usize; 2], d: Vec3) {
        let l = self.len % LANES;
        let body = slot.map(|slot| surfaces.owner[slot]);
        let [a, b] = body.map(|body| &surfaces.solid[body as usize]);
        let [own, other] = slot.map(|slot| surfaces.record[slot].v);
        let facing = slot.map(|slot| surfaces.facing[slot]);
        let slip = if surfaces.slips.is_empty() { [0.0; 3] } else { surfaces.slip(Pair { slot, body }) };
        (self.k[l], self.slot[l]) = (k, slot);
        for c in 0..3 {
            self.d[c][l] = d[c];
            self.v[c][l] = other[c] - own[c];
            self.slip[c][l] = slip[c];
            self.facing[0][c][l] = facing[0][c];
            self.facing[1][c][l] = facing[1][c];
            self.spin[0][c][l] = a.spin[c];
            self.spin[1][c][l] = b.spin[c];
        }
        self.inverse_mass[0][l] = a.inverse_mass;
        self.inverse_mass[1][l] = b.inverse_mass;
        self.friction[0][l] = a.friction;
        self.friction[1][l] = b.friction;
        self.ln_restitution[l] =
            Model::ln_restitution(a.inverse_mass, a.ln_restitution, b.inverse_mass, b.ln_restitution);
        self.shared_by[l] = a.shared_by.max(b.shared_by);
        self.face[l] = a.face.max(b.face);
        self.stiffness[l] = a.stiffness.max(b.stiffness);
        self.damping[l] = a.damping.max(b.damping);
        self.counted[l] = a.sharers.max(b.sharers);
        self.len += 1;
    }
}

/// What laws make of sixteen pairs.
struct Found {
    /// Force on the first of each pair (N), and its couple (N m).
    force: [Lanes; 3],
    couple: [Lanes; 3],
    /// The pair's part in a contact of faces.
    part: Lanes,
    /// 1 where they touch, and where they would pass through each other.
    touching: Lanes,
    deep: Lanes,
    /// Slip that friction holds (m) and the load that it bears (N), 0 where nothing is to be remembered.
    slip: [Lanes; 3],
    load: Lanes,
    springs: Lanes,
}

#[inline(always)]
fn three(of: &[Lanes; 3], l: usize) -> Vec3 {
    Vec3::new(of[0][l], of[1][l], of[2][l])
}

/// E10-E13 in lanes: one loop with everything in it, without branches.
#[inline(always)]
fn law<const SMOOTH: bool, const FULL: bool>(input: &Input, batch: &Batch) -> Found {
    let (model, dt) = (input.model, input.dt);
    let diameter = model.contact_diameter as f32;
    let spacing = model.spacing as f32;
    let rate = model.contact_rate();
    let zero = [0.0; LANES];
    let mut out = Found {
        force: [zero; 3],
        couple: [zero; 3],
        part: zero,
        touching: zero,
        deep: zero,
        slip: [zero; 3],
        load: zero,
        springs: zero,
    };
    for l in 0..LANES {
        let d = three(&batch.d, l);
        let r = d.length();
        let (mut n, mut along, mut s, mut part) = (d * (1.0 / r.max(1e-12)), d, r, 1.0);
        // where they touch, seen from i: midway, or where a ball stands on a face
        let mut arm = 0.5 * d;
        if SMOOTH {
            let (a, b) = (three(&batch.facing[0], l), three(&batch.facing[1], l));
            let normal = contact::contact_normal(d.to_array(), r, a.to_array(), b.to_array());
            let normal = Vec3::new(normal.x, normal.y, normal.z);
            let (a, b) = (a.length_squared() > 0.0, b.length_squared() > 0.0);
            let faced = (a | b) & ((normal.x != n.x) | (normal.y != n.y) | (normal.z != n.z));
            let across = d.dot(normal);
            let on = normal * across;
            let beside = contact::contact_part((d - on).length() / spacing);
            (s, part) = if faced { (across, beside) } else { (s, part) };
            n = if faced { normal } else { n };
            along = if faced { on } else { along };
            arm = if faced & !b { d - 0.5 * along } else { arm };
            arm = if faced & b & !a { 0.5 * along } else { arm };
        }
        let near = (s < 1.5 * diameter) & (part > 0.0);
        let mut v = three(&batch.v, l);
        let (spin_a, spin_b) = (three(&batch.spin[0], l), three(&batch.spin[1], l));
        if !FULL {
            // velocities where the bodies touch
            v -= spin_a.cross(arm) + spin_b.cross(d - arm);
        }
        let counted = batch.counted[l];
        let (i_a, i_b) = (batch.inverse_mass[0][l], batch.inverse_mass[1][l]);
        let mass = 1.0 / (i_a + i_b);
        let share = [batch.shared_by[l], counted];
        let (k, eta) = Model::contact_constants(
            mass,
            batch.ln_restitution[l],
            share,
            rate,
            [batch.stiffness[l], batch.damping[l]],
        );
        let only = if FULL { 0.0 } else { 1.0 };
        let f = contact::contact_force(along.to_array(), v.to_array(), s, diameter, k, eta, only, dt);
        let mut f = Vec3::new(f.x, f.y, f.z) * part;
        let speed = v.dot(n);
        let overlap = diameter - s;
        let held = counted.max(1.0) * k * (diameter * diameter - overlap * overlap);
        let deep = near & (overlap > DEEP * diameter) & (speed < 0.0) & (mass * speed * speed > HELD * held);
        let stop = if dt > 0.0 { mass / (dt * batch.face[l]) } else { 0.0 };
        f += n * if deep { speed * part * stop } else { 0.0 };
        let touching = near & (s < diameter);
        if !FULL {
            let mu = Model::friction_of(batch.friction[0][l], batch.friction[1][l]);
            let rubs = touching & (mu > 0.0);
            let load = (-f.dot(n)).max(0.0);
            let v = v - n * speed;
            let k_t = TANGENTIAL * (k * part);
            let shared = share[0].max(share[1]);
            let eta_t = part * contact::dashpot(TANGENTIAL_DAMPING, k_t / part * shared, mass) / shared;
            let turn = 0.5 * dt * (spin_a + spin_b).dot(n);
            let slip = contact::slip_carried(three(&batch.slip, l).to_array(), n.to_array(), turn);
            let slip = Vec3::new(slip.x, slip.y, slip.z) + v * dt;
            let limit = mu * load;
            let spring = contact::friction((k_t * slip).to_array(), limit);
            let spring = Vec3::new(spring.x, spring.y, spring.z);
            let total = contact::friction((spring + eta_t * v).to_array(), limit);
            f = if rubs { f + Vec3::new(total.x, total.y, total.z) } else { f };
            let slip = spring / k_t;
            (out.slip[0][l], out.slip[1][l], out.slip[2][l]) = (slip.x, slip.y, slip.z);
            out.load[l] = load;
            out.springs[l] = if rubs { k_t } else { 0.0 };
            let couple = arm.cross(f);
            (out.couple[0][l], out.couple[1][l], out.couple[2][l]) = (couple.x, couple.y, couple.z);
        }
        (out.force[0][l], out.force[1][l], out.force[2][l]) = (f.x, f.y, f.z);
        out.part[l] = if near { part } else { 0.0 };
        out.touching[l] = if touching { 1.0 } else { 0.0 };
        out.deep[l] = if deep { 1.0 } else { 0.0 };
    }
    out
}

/// Adds what was found to the particles.
#[inline(always)]
fn give<const FULL: bool>(
    input: &Input,
    batch: &Batch,
    found: &Found,
    touch: &mut [Touch],
    friction: &mut Friction,
    slips: &mut Vec<Slips>,
) {
    let surfaces = &input.surfaces;
    for l in 0..batch.len.min(LANES) {
        if found.part[l] <= 0.0 {
            continue;
        }
        if batch.k[l] != friction.k {
            friction.end(input, touch, slips);
            friction.k = batch.k[l];
        }
        let touch = &mut touch[batch.k[l]];
        for c in 0..3 {
            touch.contact[c] += found.force[c][l];
            if !FULL {
                touch.couple[c] += found.couple[c][l];
            }
        }
        if found.touching[l] > 0.0 {
            let slot = batch.slot[l];
            let pair = Pair { slot, body: slot.map(|slot| surfaces.owner[slot]) };
            touch.contacts += 1;
            touch.sharers += found.part[l];
            touch.deep += found.deep[l] as u32;
            surfaces.stir(pair.body[0], pair.body[1]);
            if !FULL && found.springs[l] > 0.0 && surfaces.keeps(pair) {
                friction.keep(slot[1] as u32, three(&found.slip, l).to_array(), found.load[l]);
            }
        }
    }
}

/// What friction of one particle remembers of its contacts (E13; Cundall and Strack 1979; Luding 2008).
#[derive(Default)]
struct Friction {
    /// Particle of the chunk.
    k: usize,
    slips: Slips,
    load: [f32; HELD_CONTACTS],
    /// Contacts for whose slip there was no place.
    forgotten: u32,
}

/// Who touches whom: slots and bodies of this particle and of the other.
#[derive(Clone, Copy)]
struct Pair {
    slot: [usize; 2],
    body: [u32; 2],
}

impl Friction {
    /// Notes what the particle goes on remembering, and makes room for the next.
    #[inline(always)]
    fn end(&mut self, input: &Input, touch: &mut [Touch], slips: &mut Vec<Slips>) {
        if self.slips.is_empty() {
            return;
        }
        let owner = input.surfaces.owner[input.surfaces.slot[input.first + self.k] as usize];
        let touch = &mut touch[self.k];
        touch.forgotten = self.forgotten;
        if input.model.moves(owner) {
            slips.push(self.slips);
            touch.slips = slips.len() as u32;
        }
        *self = Self::default();
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
        let slips = friction.slips;
        assert_eq!(friction.forgotten as usize, loads.len() - HELD_CONTACTS);
        // the ninth took the place of the one that bore least, the tenth bears less than any
        assert_eq!((slips.of(8), slips.of(1), slips.of(9)), (Some([8.0, 0.0, 0.0]), None, None));
    }
}
