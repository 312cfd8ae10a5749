//! Rigid bodies: the sum of forces and torques (E18), drift and kick (E20), and particles that follow (E21).

use super::{Advance, joints};
use crate::interact::kept::Felt;
use crate::model::Model;
use crate::scene::Integrator;
use crate::scene::motion::Path;
use crate::state::{Bodies, Body, Record};
use glam::{DMat3, DQuat, DVec3, Mat3, Vec3};
use rayon::prelude::*;
use std::ops::Range;

/// Slots summed as one task; partial sums are added in order (E18).
const PART: usize = 1024;
/// Rounds of the implicit midpoint rule: it converges by a factor `omega dt` a round.
const ROUNDS: usize = 6;
/// It has converged when a round turns by no more than this (rad).
const SETTLED: f64 = 1e-17;

/// Length of the kick before the drift (s).
pub(crate) fn first_kick(integrator: Integrator, dt: f64) -> f64 {
    match integrator {
        Integrator::Leapfrog => 0.5 * dt,
        Integrator::Euler => dt,
    }
}

/// E15 and E20, first half: scripts, half a kick, joints, drift, and particles that follow.
pub fn advance(bodies: &mut Bodies, model: &Model, advance: Advance) {
    let kick = |body: &mut Body, path: &Option<Path>| match path {
        Some(path) => script(body, path, advance.end()),
        None => half_kick(body, model, advance.dt),
    };
    let each = bodies.body.par_iter_mut().zip(&model.paths).with_min_len(64);
    if model.joints.is_empty() {
        each.for_each(|(body, path)| {
            kick(body, path);
            drift(body, model, advance.dt);
        });
    } else {
        each.for_each(|(body, path)| kick(body, path));
        joints::drift(bodies, model, advance.dt);
        bodies.body.par_iter_mut().with_min_len(64).for_each(|body| drift(body, model, advance.dt));
    }
    follow(bodies, model);
}

/// E20, first half: half a kick.
pub fn half_kick(body: &mut Body, model: &Model, dt: f64) {
    if body.is_static() || body.asleep {
        return;
    }
    let kick = first_kick(model.solver.integrator, dt);
    body.v_half = body.v + kick / body.mass * body.force;
    body.l_half = body.l + kick * body.torque;
}

/// E20: drift, and velocities predicted to the end of the step.
pub fn drift(body: &mut Body, model: &Model, dt: f64) {
    if body.is_static() || body.asleep {
        return;
    }
    let acceleration = body.force / body.mass;
    let kick = first_kick(model.solver.integrator, dt);
    body.x += dt * body.v_half;
    body.q = turned(body, body.l_half, dt);
    let rest = dt - kick;
    body.v = body.v_half + rest * acceleration;
    body.l = body.l_half + rest * body.torque;
    body.omega = spin(body, body.q, body.l);
    for a in 0..3 {
        let period = f64::from(model.grid.period[a]);
        if period > 0.0 {
            let from = model.grid.min[a];
            body.x[a] = from + (body.x[a] - from).rem_euclid(period);
        }
    }
}

/// Orientation after a free turn of `dt` with constant angular momentum: implicit midpoint rule, symmetric in
/// time and of second order, so that energy does not drift.
pub(super) fn turned(body: &Body, l: DVec3, dt: f64) -> DQuat {
    let mut omega = spin(body, body.q, l);
    for _ in 0..if round(body).is_some() { 0 } else { ROUNDS } {
        let next = spin(body, turn(0.5 * dt * omega) * body.q, l);
        let change = dt * (next - omega);
        omega = next;
        if change.length_squared() < SETTLED * SETTLED {
            break;
        }
    }
    (turn(dt * omega) * body.q).normalize()
}

/// Angular velocity (rad/s) for the orientation `q` and angular momentum `l`.
fn spin(body: &Body, q: DQuat, l: DVec3) -> DVec3 {
    if let Some(inverse) = round(body) {
        return inverse * l;
    }
    let r = DMat3::from_quat(q);
    r * (body.inverse_inertia * (r.transpose() * l))
}

/// The inverse of the moment of inertia, if it is the same about all axes: balls and cubes.
fn round(body: &Body) -> Option<f64> {
    let inverse = body.inverse_inertia.x_axis.x;
    (body.inverse_inertia == DMat3::from_diagonal(DVec3::splat(inverse))).then_some(inverse)
}

/// The turn by a vector (rad); small ones by their series, exact to the last bit but one.
fn turn(by: DVec3) -> DQuat {
    let square = 0.25 * by.length_squared();
    if square > 1e-3 {
        return DQuat::from_scaled_axis(by);
    }
    let sine = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0)));
    let cosine = 1.0 - square / 2.0 * (1.0 - square / 12.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0)));
    let axis = 0.5 * sine * by;
    DQuat::from_xyzw(axis.x, axis.y, axis.z, cosine)
}

/// E20, second half: the kick with the new force.
pub fn kick(body: &mut Body, integrator: Integrator, dt: f64) {
    if body.is_static() || body.asleep || integrator == Integrator::Euler {
        return;
    }
    body.v = body.v_half + 0.5 * dt / body.mass * body.force;
    body.l = body.l_half + 0.5 * dt * body.torque;
    body.omega = spin(body, body.q, body.l);
}

/// E21: the slots of rigid bodies take the place and velocity their body gives them.
pub fn follow(bodies: &mut Bodies, model: &Model) {
    let Bodies { body, offset, owner, record, normal, facing, rigid_slots, .. } = bodies;
    let given = offset.par_chunks(PART).zip(owner.par_chunks(PART)).zip(normal.par_chunks(PART));
    let taken = record[..*rigid_slots].par_chunks_mut(PART).zip(facing.par_chunks_mut(PART));
    taken.zip(given).for_each(|((record, facing), ((offset, owner), normal))| {
        let mut k = 0;
        while k < record.len() {
            let same = owner[k..record.len()].iter().take_while(|&&o| o == owner[k]).count();
            let frame = Frame::of(&body[owner[k] as usize]);
            let run = k..k + same;
            for (record, offset) in record[run.clone()].iter_mut().zip(&offset[run.clone()]) {
                frame.place(record, *offset, model);
            }
            for (facing, normal) in facing[run.clone()].iter_mut().zip(&normal[run]) {
                *facing = frame.face(*normal);
            }
            k += same;
        }
    });
}

/// What a body gives its particles.
pub struct Frame {
    x: DVec3,
    v: DVec3,
    /// From the body's axes to those of the world, and to velocities by its spin (1/s).
    axes: DMat3,
    swing: DMat3,
    normals: Mat3,
}

impl Frame {
    /// That of a body as it is now.
    pub fn of(body: &Body) -> Self {
        let axes = DMat3::from_quat(body.q);
        let swing = DMat3::from_cols(
            body.omega.cross(axes.x_axis),
            body.omega.cross(axes.y_axis),
            body.omega.cross(axes.z_axis),
        );
        Self { x: body.x, v: body.v, axes, swing, normals: axes.as_mat3() }
    }

    /// E21 for one particle.
    #[inline]
    pub fn place(&self, record: &mut Record, offset: DVec3, model: &Model) {
        let mut x = (self.x + self.axes * offset).as_vec3().to_array();
        model.grid.wrap(&mut x);
        record.x = x;
        record.v = (self.v + self.swing * offset).as_vec3().to_array();
    }

    /// Outward normal of a slot in world axes.
    #[inline]
    pub fn face(&self, normal: [f32; 3]) -> [f32; 3] {
        if normal == [0.0; 3] { normal } else { (self.normals * Vec3::from(normal)).to_array() }
    }
}

/// E15: a body that follows a script, at a time (s).
pub fn script(body: &mut Body, path: &Path, time: f64) {
    let pose = path.at(time);
    (body.x, body.q, body.v, body.omega) = (pose.x, pose.q, pose.v, pose.omega);
    (body.acceleration, body.angular_acceleration) = (pose.a, pose.alpha);
}

/// Slots of one body that one task sums (E18).
#[derive(Clone, Debug)]
pub struct Part {
    body: usize,
    slots: Range<usize>,
    sum: Sum,
}

/// Sums over slots.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    force: [DVec3; 3],
    torque: [DVec3; 3],
}

impl Sum {
    fn add(&mut self, other: &Self) {
        for k in 0..3 {
            self.force[k] += other.force[k];
            self.torque[k] += other.torque[k];
        }
    }
}

/// Cuts the slots of bodies that have many into parts: a huge body and many small ones spread alike over threads.
pub fn parts(bodies: &[Body]) -> Vec<Part> {
    let cut = |(body, b): (usize, &Body)| {
        let (slots, sum) = (b.slots.clone(), Sum::default());
        slots.clone().step_by(PART).map(move |s| Part { body, slots: s..(s + PART).min(slots.end), sum })
    };
    bodies.iter().enumerate().filter(|(_, b)| b.slots.len() > PART).flat_map(cut).collect()
}

/// Sums over the slots of bodies, in their order.
struct Sums<'a, F> {
    parts: &'a [Part],
    of: F,
}

impl<'a, F: Fn(&Body, Range<usize>) -> Sum + Sync> Sums<'a, F> {
    /// Sums the parts of big bodies that have slots in a range.
    fn new(bodies: &[Body], parts: &'a mut [Part], slots: &Range<usize>, of: F) -> Self {
        let within = |part: &&mut Part| slots.contains(&part.slots.start);
        parts.par_iter_mut().filter(within).for_each(|part| part.sum = of(&bodies[part.body], part.slots.clone()));
        Self { parts, of }
    }

    /// The sum over body number `k`.
    fn over(&self, k: usize, body: &Body) -> Sum {
        if body.slots.len() <= PART {
            return (self.of)(body, body.slots.clone());
        }
        let first = self.parts.partition_point(|part| part.body < k);
        let mut sum = Sum::default();
        self.parts[first..].iter().take_while(|part| part.body == k).for_each(|part| sum.add(&part.sum));
        sum
    }
}

/// E18 for one force alone: force and torque of the bodies that have slots in a range, in the order of slots; `thrust` has a
/// place for every body.
pub fn thrust<'a>(
    bodies: &Bodies,
    parts: &mut [Part],
    slots: Range<usize>,
    felt: impl Fn(usize) -> Option<&'a [f32; 3]> + Sync,
    dimensions: u32,
    thrust: &mut [[DVec3; 2]],
) {
    let (body, offset) = (&bodies.body, &bodies.offset);
    let sums = Sums::new(body, parts, &slots, |body, slots| {
        let mut sum = Sum::default();
        for slot in slots {
            let Some(f) = felt(slot).filter(|f| **f != [0.0; 3]) else { continue };
            let f = DVec3::from(f.map(f64::from));
            sum.force[0] += f;
            sum.torque[0] += (body.q * offset[slot]).cross(f);
        }
        sum
    });
    body.par_iter().zip(thrust).with_min_len(16).enumerate().for_each(|(k, (body, thrust))| {
        if slots.contains(&body.slots.start) {
            let Sum { force: [force, ..], torque: [torque, ..], .. } = sums.over(k, body);
            *thrust = [force, if dimensions == 2 { DVec3::Y * torque.y } else { torque }];
        }
    });
}

/// E18: force and torque of every body that has slots in a range from what its particles feel, in the order of slots, and from its contacts;
/// gravity (m/s^2) is added to the whole body. `felt` tells of a slot the whole force (N) but that of contacts, the part of it that fluids
/// exert, and that of agents. `after` is given each of these bodies, and whether it was [`Body::deep`] before; what it returns is added.
#[allow(clippy::too_many_arguments)] // one caller
pub fn sum(
    bodies: &mut Bodies,
    parts: &mut [Part],
    slots: Range<usize>,
    felt: Option<impl Fn(usize) -> Option<[[f32; 3]; 3]> + Sync>,
    contacts: impl Fn(usize) -> Felt + Sync,
    gravity: DVec3,
    dimensions: u32,
    after: impl Fn(&mut Body, bool) -> u64 + Sync,
) -> u64 {
    let offset = &bodies.offset;
    let sums = Sums::new(&bodies.body, parts, &slots, |body, slots| {
        let mut sum = Sum::default();
        let Some(felt) = &felt else { return sum };
        let axes = DMat3::from_quat(body.q);
        for slot in slots {
            let Some(felt) = felt(slot).filter(|felt| *felt != [[0.0; 3]; 3]) else { continue };
            let arm = axes * offset[slot];
            for (k, f) in felt.into_iter().map(|f| DVec3::from(f.map(f64::from))).enumerate() {
                sum.force[k] += f;
                sum.torque[k] += arm.cross(f);
            }
        }
        sum
    });
    let each = bodies.body.par_iter_mut().with_min_len(64).enumerate().map(|(k, body)| {
        let before = body.deep;
        // what it felt last still holds one that sleeps
        if body.asleep || !slots.contains(&body.slots.start) {
            return after(body, before);
        }
        let (mut sum, contacts) = (sums.over(k, body), contacts(k));
        for part in [0, 2] {
            sum.force[part] += contacts.force;
            sum.torque[part] += contacts.torque;
        }
        if dimensions == 2 {
            sum.torque = sum.torque.map(|t| DVec3::new(0.0, t.y, 0.0));
        }
        [body.force, body.force_fluid, body.force_contact] = sum.force;
        [body.torque, body.torque_fluid, body.torque_contact] = sum.torque;
        if body.one_way {
            body.force -= body.force_fluid;
            body.torque -= body.torque_fluid;
        }
        if !body.is_static() {
            body.force += body.mass * gravity;
            body.sharers = contacts.sharers as f32;
        }
        body.contacts = contacts.contacts;
        body.deep = contacts.deep > 0;
        after(body, before)
    });
    each.sum()
}
