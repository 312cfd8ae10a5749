//! Contacts of particles of different bodies (E10-E13), each pair once; called by the stage `forces`.
//!
//! In: the lists of slots that may touch, surface normals, slips of contacts, what contacts know of bodies. Out: force and slip of each
//! contact, and for each two bodies that may touch what the first feels ([`Runs`]).
//!
//! Those of a list that come near enough are gathered, sixteen pairs of whatever particles at a time: 32 numbers of each are laid side by
//! side and transposed, the laws are worked out in lanes, without branches, and what comes out is transposed back and added pair by pair,
//! in the order of lists.

use super::kept::{Reach, Runs, apart};
use super::lanes::{Block, Indices, LANES, Lanes, transpose};
use super::pairs::wrap;
use crate::integrate::sleep::{self, Rest};
use crate::laws::contact;
use crate::model::{ContactModel, Model, TANGENTIAL, TANGENTIAL_DAMPING};
use crate::scene::{Damping, Surface};
use crate::state::{Bodies, Body, FACED, LIVE, Rows, SLOT};
use fearless_simd::Simd;
use glam::{DMat3, DVec3, Vec3};
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
    /// Centre of mass (m).
    x: DVec3,
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
            x: body.x,
            rest: sleep::rest(body),
        }
    }
}

/// Bodies as those see them that touch them.
#[derive(Clone, Copy)]
pub struct Surfaces<'a> {
    /// What contacts know of them.
    pub solid: &'a [Solid],
    /// Set for bodies that something restless touches.
    pub stirred: &'a [AtomicBool],
}

impl Surfaces<'_> {
    /// Notes that bodies `a` and `b` touch: what is restless keeps the other awake.
    fn stir(&self, a: u32, b: u32) {
        for (one, other) in [(a as usize, b as usize), (b as usize, a as usize)] {
            if self.solid[one].rest == Rest::Restless && self.solid[other].rest != Rest::Restless {
                self.stirred[other].store(true, Relaxed);
            }
        }
    }

    /// Whether a body sleeps.
    #[inline(always)]
    fn asleep(&self, body: u32) -> bool {
        self.solid[body as usize].rest == Rest::Asleep
    }

    /// Notes that fluid is near body `b`.
    #[inline(always)]
    pub fn wet(&self, b: u32) {
        if self.asleep(b) {
            self.stirred[b as usize].store(true, Relaxed);
        }
    }
}

/// What contacts read.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    /// Constants.
    pub model: &'a Model,
    /// Bodies and their slots.
    pub bodies: &'a Bodies,
    /// What contacts know of bodies.
    pub surfaces: Surfaces<'a>,
    /// Pairs farther apart neither touch nor meet in half a step.
    pub reach: Reach,
    /// Length of the step (s).
    pub dt: f32,
}

/// Overlap (as a fraction of the contact diameter) from which on a pair is looked at that could pass through (E12).
pub(crate) const DEEP: f32 = 0.5;
/// It is stopped if its kinetic energy is so many times what the springs may still take.
pub(crate) const HELD: f32 = 1.05;

/// Contacts of a chunk of slots from `first` on.
#[inline(always)]
pub fn chunk<S: Simd>(simd: S, input: &Input, first: usize, scratch: &mut Sifted, rows: &mut Rows, runs: &mut Runs) {
    let count = sift(input, first, rows, scratch);
    if count == 0 && !runs.felt {
        return;
    }
    meet(input, runs);
    runs.felt = count > 0;
    match (input.model.solver.surface == Surface::Smooth, input.model.solver.damping == Damping::Full) {
        (true, false) => particles::<S, true, false>(simd, input, scratch, count, rows, runs),
        (false, false) => particles::<S, false, false>(simd, input, scratch, count, rows, runs),
        (true, true) => particles::<S, true, true>(simd, input, scratch, count, rows, runs),
        (false, true) => particles::<S, false, true>(simd, input, scratch, count, rows, runs),
    }
    for (run, sum) in runs.run.iter().zip(&runs.sum) {
        if sum.felt[8] > 0.0 {
            input.surfaces.stir(run.body[0], run.body[1]);
        }
    }
}

/// Numbers of the two bodies of a pair, as they stand in the second half of its row; before them the rest of a normal.
const SPIN: [usize; 2] = [LANES + 2, LANES + 5];
const MASS: usize = LANES + 8;
const LN_RESTITUTION: usize = LANES + 9;
const SHARED_BY: usize = LANES + 10;
const FACE: usize = LANES + 11;
const RUBS: usize = LANES + 12;
const STIFFNESS: usize = LANES + 13;
const DAMPING: usize = LANES + 14;
const COUNTED: usize = LANES + 15;
/// The pair's own numbers.
const D: usize = 0;
const V: usize = 3;
const SLIP: usize = 6;
const ARM: usize = 9;
const FACING: [usize; 2] = [12, 15];

/// Lays out what laws ask of each two bodies.
#[inline(always)]
fn meet(input: &Input, runs: &mut Runs) {
    let (solid, periodic) = (input.surfaces.solid, input.model.grid.period != [0.0; 3]);
    for ((run, law), sum) in runs.run.iter().zip(&mut runs.law).zip(&mut runs.sum) {
        let [a, b] = run.body.map(|body| &solid[body as usize]);
        let law = &mut law.0;
        law[SPIN[0] - LANES..][..3].copy_from_slice(&a.spin.to_array());
        law[SPIN[1] - LANES..][..3].copy_from_slice(&b.spin.to_array());
        law[MASS - LANES] = 1.0 / (a.inverse_mass + b.inverse_mass);
        law[LN_RESTITUTION - LANES] =
            Model::ln_restitution(a.inverse_mass, a.ln_restitution, b.inverse_mass, b.ln_restitution);
        law[SHARED_BY - LANES] = a.shared_by.max(b.shared_by);
        law[FACE - LANES] = a.face.max(b.face);
        law[RUBS - LANES] = Model::friction_of(a.friction, b.friction);
        law[STIFFNESS - LANES] = a.stiffness.max(b.stiffness);
        law[DAMPING - LANES] = a.damping.max(b.damping);
        law[COUNTED - LANES] = a.sharers.max(b.sharers);
        sum.felt = [0.0; 9];
        sum.apart = if periodic { apart(input.model, input.bodies, run.slot) } else { b.x - a.x };
    }
}

/// Pairs of a chunk that are near: scratch of a thread.
#[derive(Default)]
pub struct Sifted {
    own: Vec<Own>,
    pair: Vec<Pair>,
}

/// A pair that is near.
#[derive(Clone, Copy, Default)]
struct Pair {
    /// Where it stands in the rows.
    at: u32,
    /// Which of those that have rows looks.
    own: u32,
    /// Slot of the other.
    other: u32,
    /// From the one to the other (m).
    d: Vec3,
    /// Normal of the other.
    facing: [f32; 3],
}

/// Finds the pairs of a chunk that are near, and says how many: a loop of its own, as it waits for memory.
#[inline(always)]
fn sift(input: &Input, first: usize, rows: &Rows, to: &mut Sifted) -> usize {
    let (model, b) = (input.model, input.bodies);
    let periodic = model.grid.period != [0.0; 3];
    let [balls, faces] = [input.reach.balls, input.reach.faces].map(|reach| (reach * reach) as f32);
    let (mut body, mut axes, mut asleep) = (u32::MAX, DMat3::IDENTITY, false);
    if to.pair.len() <= rows.with.len() {
        to.pair.resize(rows.with.len() + 1, Pair::default());
    }
    to.own.clear();
    let mut count = 0;
    for k in 0..rows.begin.len() - 1 {
        let (row, slot) = (rows.row(k), first + k);
        if row.is_empty() {
            continue;
        }
        if b.owner[slot] != body {
            body = b.owner[slot];
            axes = DMat3::from_quat(b.body[body as usize].q);
            asleep = input.surfaces.asleep(body);
        }
        let own = &b.record[slot];
        let x = Vec3::from(own.x);
        for at in row {
            let with = rows.with[at];
            let other = (with & SLOT) as usize;
            let mut d = Vec3::from(b.record[other].x) - x;
            if periodic {
                d = wrap(model, d);
            }
            // which are near is not to be foretold: all are noted, and those that are not are written over
            let facing = b.facing[other];
            to.pair[count] = Pair { at: at as u32, own: to.own.len() as u32, other: other as u32, d, facing };
            let limit = if with & FACED != 0 { faces } else { balls };
            // what sleeps feels nothing new of what sleeps
            let idle = asleep && input.surfaces.asleep(b.owner[other]);
            count += usize::from(((d.length_squared() < limit) | (with & LIVE != 0)) & !idle);
        }
        let arm = (axes * b.offset[slot]).as_vec3();
        to.own.push(Own { v: own.v.into(), facing: b.facing[slot], arm });
    }
    count
}

#[inline(always)]
fn particles<S: Simd, const SMOOTH: bool, const FULL: bool>(
    simd: S,
    input: &Input,
    sifted: &Sifted,
    count: usize,
    rows: &mut Rows,
    runs: &mut Runs,
) {
    let mut batch = Batch::default();
    for pair in &sifted.pair[..count] {
        batch.add(input.bodies, rows, runs, &sifted.own[pair.own as usize], pair);
        if batch.len == LANES {
            batch.end::<S, SMOOTH, FULL>(simd, input, rows, runs);
        }
    }
    if batch.len > 0 {
        batch.end::<S, SMOOTH, FULL>(simd, input, rows, runs);
    }
}

/// A particle that looks at others.
#[derive(Clone, Copy, Default)]
struct Own {
    v: Vec3,
    facing: [f32; 3],
    /// From its body's centre of mass (m).
    arm: Vec3,
}

/// Sixteen pairs, and what laws ask of them.
#[derive(Default)]
struct Batch {
    len: usize,
    /// Where each stands in the rows, and its run.
    at: [usize; LANES],
    run: [usize; LANES],
    /// Pair by pair; transposed before the laws are applied.
    numbers: [[Indices; LANES]; 2],
}

impl Batch {
    #[inline(always)]
    fn add(&mut self, bodies: &Bodies, rows: &Rows, runs: &Runs, own: &Own, pair: &Pair) {
        let (l, at) = (self.len % LANES, pair.at as usize);
        let run = runs.of[at] as usize;
        (self.at[l], self.run[l]) = (at, run);
        let v = Vec3::from(bodies.record[pair.other as usize].v) - own.v;
        let [x, y, z] = pair.facing;
        let first: &mut Lanes = bytemuck::cast_mut(&mut self.numbers[0][l].0);
        first[D..D + 3].copy_from_slice(&pair.d.to_array());
        first[V..V + 3].copy_from_slice(&v.to_array());
        first[SLIP..SLIP + 3].copy_from_slice(&rows.slip[at]);
        first[ARM..ARM + 3].copy_from_slice(&own.arm.to_array());
        first[FACING[0]..FACING[0] + 3].copy_from_slice(&own.facing);
        first[FACING[1]] = x;
        let second: &mut Lanes = bytemuck::cast_mut(&mut self.numbers[1][l].0);
        *second = runs.law[run].0;
        (second[0], second[1]) = (y, z);
        self.len += 1;
    }

    /// Works out the laws, and adds what was found.
    #[inline(always)]
    fn end<S: Simd, const SMOOTH: bool, const FULL: bool>(
        &mut self,
        simd: S,
        input: &Input,
        rows: &mut Rows,
        runs: &mut Runs,
    ) {
        transpose(simd, &mut self.numbers[0]);
        transpose(simd, &mut self.numbers[1]);
        let numbers: &[[Lanes; LANES]; 2] = bytemuck::cast_ref(&self.numbers);
        let mut found = law::<SMOOTH, FULL>(input, numbers.as_flattened());
        transpose(simd, &mut found);
        for l in 0..self.len.min(LANES) {
            let found: &Lanes = bytemuck::cast_ref(&found[l].0);
            let (at, sum) = (self.at[l], &mut runs.sum[self.run[l]].felt);
            for c in 0..9 {
                sum[c] += f64::from(found[c]);
            }
            rows.force[at] = [found[0], found[1], found[2]];
            rows.slip[at] = [found[9], found[10], found[11]];
            let live = if found[12] > 0.0 { LIVE } else { 0 };
            rows.with[at] = rows.with[at] & !LIVE | live;
        }
        self.len = 0;
    }
}

/// What laws make of sixteen pairs, number by number: force on the first of each pair (N), its part in the contact of faces where they
/// touch, torque about the centre of mass of the first's body (N m), 1 where they would pass through each other, 1 where they touch, slip that
/// friction holds (m), part.
type Found = [Indices; LANES];

#[inline(always)]
fn three(of: &[Lanes], c: usize, l: usize) -> Vec3 {
    Vec3::new(of[c][l], of[c + 1][l], of[c + 2][l])
}

/// E10-E13 in lanes: one loop with everything in it, without branches.
#[inline(always)]
fn law<const SMOOTH: bool, const FULL: bool>(input: &Input, of: &[Lanes]) -> Found {
    let (model, dt) = (input.model, input.dt);
    let diameter = model.contact_diameter as f32;
    let spacing = model.spacing as f32;
    let rate = model.contact_rate();
    let mut found = [Block::default(); LANES];
    assert!(of.len() == 2 * LANES);
    for l in 0..LANES {
        let d = three(of, D, l);
        let r = d.length();
        let (mut n, mut along, mut s, mut part) = (d * (1.0 / r.max(1e-12)), d, r, 1.0);
        // where they touch, seen from i: midway, or where a ball stands on a face
        let mut arm = 0.5 * d;
        if SMOOTH {
            let (a, b) = (three(of, FACING[0], l), three(of, FACING[1], l));
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
        let mut v = three(of, V, l);
        let (spin_a, spin_b) = (three(of, SPIN[0], l), three(of, SPIN[1], l));
        if !FULL {
            // velocities where the bodies touch
            v -= spin_a.cross(arm) + spin_b.cross(d - arm);
        }
        let counted = of[COUNTED][l];
        let mass = of[MASS][l];
        let share = [of[SHARED_BY][l], counted];
        let stated = [of[STIFFNESS][l], of[DAMPING][l]];
        let (k, eta) = Model::contact_constants(mass, of[LN_RESTITUTION][l], share, rate, stated);
        let only = if FULL { 0.0 } else { 1.0 };
        let f = contact::contact_force(along.to_array(), v.to_array(), s, diameter, k, eta, only, dt);
        let mut f = Vec3::new(f.x, f.y, f.z) * part;
        let speed = v.dot(n);
        let overlap = diameter - s;
        let held = counted.max(1.0) * k * (diameter * diameter - overlap * overlap);
        let deep = near & (overlap > DEEP * diameter) & (speed < 0.0) & (mass * speed * speed > HELD * held);
        let stop = if dt > 0.0 { mass / (dt * of[FACE][l]) } else { 0.0 };
        f += n * if deep { speed * part * stop } else { 0.0 };
        let touching = near & (s < diameter);
        let mut couple = Vec3::ZERO;
        if !FULL {
            let mu = of[RUBS][l];
            let rubs = touching & (mu > 0.0);
            let load = (-f.dot(n)).max(0.0);
            let v = v - n * speed;
            let k_t = TANGENTIAL * (k * part);
            let shared = share[0].max(share[1]);
            let eta_t = part * contact::dashpot(TANGENTIAL_DAMPING, k_t / part * shared, mass) / shared;
            let turn = 0.5 * dt * (spin_a + spin_b).dot(n);
            let slip = contact::slip_carried(three(of, SLIP, l).to_array(), n.to_array(), turn);
            let slip = Vec3::new(slip.x, slip.y, slip.z) + v * dt;
            let limit = mu * load;
            let spring = contact::friction((k_t * slip).to_array(), limit);
            let spring = Vec3::new(spring.x, spring.y, spring.z);
            let total = contact::friction((spring + eta_t * v).to_array(), limit);
            f = if rubs { f + Vec3::new(total.x, total.y, total.z) } else { f };
            let slip = spring / k_t;
            for c in 0..3 {
                found[9 + c].0[l] = if rubs & (k_t > 0.0) { slip[c] } else { 0.0 };
            }
            couple = arm.cross(f);
        }
        f = if near { f } else { Vec3::ZERO };
        let torque = three(of, ARM, l).cross(f) + if near { couple } else { Vec3::ZERO };
        for c in 0..3 {
            found[c].0[l] = f[c];
            found[4 + c].0[l] = torque[c];
        }
        found[3].0[l] = if touching { part } else { 0.0 };
        found[7].0[l] = if touching & deep { 1.0 } else { 0.0 };
        found[8].0[l] = if touching { 1.0 } else { 0.0 };
        found[12].0[l] = if near { 1.0 } else { 0.0 };
    }
    bytemuck::cast(found)
}
