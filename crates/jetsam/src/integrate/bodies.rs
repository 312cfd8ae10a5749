//! Rigid bodies: the sum of forces and torques (E18), drift and kick (E20), and particles that follow (E21).

use crate::model::Model;
use crate::scene::Integrator;
use crate::scene::motion::Path;
use crate::state::{Bodies, Body, Record, Touch};
use glam::{DQuat, DVec3, Vec3};
use rayon::prelude::*;
use std::ops::Range;

/// Slots summed as one task; partial sums are added in order (E18).
const PART: usize = 1024;
/// Rounds of the implicit midpoint rule: it converges by a factor `omega dt` a round.
const ROUNDS: usize = 6;

/// Length of the kick before the drift (s).
pub(crate) fn first_kick(integrator: Integrator, dt: f64) -> f64 {
    match integrator {
        Integrator::Leapfrog => 0.5 * dt,
        Integrator::Euler => dt,
    }
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
    body.omega = body.inverse_inertia_at(body.q) * body.l;
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
    let mut middle = body.q;
    for _ in 0..ROUNDS {
        let omega = body.inverse_inertia_at(middle) * l;
        middle = DQuat::from_scaled_axis(0.5 * dt * omega) * body.q;
    }
    let omega = body.inverse_inertia_at(middle) * l;
    (DQuat::from_scaled_axis(dt * omega) * body.q).normalize()
}

/// E20, second half: the kick with the new force.
pub fn kick(body: &mut Body, integrator: Integrator, dt: f64) {
    if body.is_static() || body.asleep || integrator == Integrator::Euler {
        return;
    }
    body.v = body.v_half + 0.5 * dt / body.mass * body.force;
    body.l = body.l_half + 0.5 * dt * body.torque;
    body.omega = body.inverse_inertia_at(body.q) * body.l;
}

/// E21: the slots of rigid bodies take the place and velocity their body gives them.
pub fn follow(bodies: &mut Bodies, model: &Model) {
    let Bodies { body, offset, owner, record, normal, facing, rigid_slots, .. } = bodies;
    let slots = offset.par_iter().zip(&*owner).zip(&*normal).with_min_len(PART);
    let out = record[..*rigid_slots].par_iter_mut().zip(facing);
    out.zip(slots).for_each(|((record, facing), ((offset, &owner), normal))| {
        let body = &body[owner as usize];
        place(record, body, *offset, model);
        *facing = face(body, *normal);
    });
}

/// Outward normal of a slot in world axes.
pub fn face(body: &Body, normal: [f32; 3]) -> [f32; 3] {
    if normal == [0.0; 3] {
        return normal;
    }
    (body.q.as_quat() * Vec3::from(normal)).to_array()
}

/// E15: a body that follows a script, at a time (s).
pub fn script(body: &mut Body, path: &Path, time: f64) {
    let pose = path.at(time);
    (body.x, body.q, body.v, body.omega) = (pose.x, pose.q, pose.v, pose.omega);
    (body.acceleration, body.angular_acceleration) = (pose.a, pose.alpha);
}

/// E21 for one particle.
pub fn place(record: &mut Record, body: &Body, offset: DVec3, model: &Model) {
    let arm = body.q * offset;
    let mut x = (body.x + arm).as_vec3().to_array();
    model.grid.wrap(&mut x);
    record.x = x;
    record.v = (body.v + body.omega.cross(arm)).as_vec3().to_array();
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
    contacts: u32,
    sharers: f64,
    deep: u32,
}

/// Cuts the slots of all bodies into parts: a huge body and many small ones spread alike over threads.
pub fn parts(bodies: &[Body]) -> Vec<Part> {
    let cut = |(body, b): (usize, &Body)| {
        let (slots, sum) = (b.slots.clone(), Sum::default());
        slots.clone().step_by(PART).map(move |s| Part { body, slots: s..(s + PART).min(slots.end), sum })
    };
    bodies.iter().enumerate().flat_map(cut).collect()
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
    let within = |part: &&mut Part| slots.contains(&part.slots.start);
    parts.par_iter_mut().filter(within).for_each(|part| {
        let q = body[part.body].q;
        let mut sum = Sum::default();
        for slot in part.slots.clone() {
            let Some(f) = felt(slot).filter(|f| **f != [0.0; 3]) else { continue };
            let f = DVec3::from(f.map(f64::from));
            sum.force[0] += f;
            sum.torque[0] += (q * offset[slot]).cross(f);
        }
        part.sum = sum;
    });
    for part in parts.iter().filter(|part| slots.contains(&part.slots.start)) {
        let thrust = &mut thrust[part.body];
        if part.slots.start == body[part.body].slots.start {
            *thrust = [DVec3::ZERO; 2];
        }
        let [force, torque] = [part.sum.force[0], part.sum.torque[0]];
        *thrust = [thrust[0] + force, thrust[1] + if dimensions == 2 { DVec3::Y * torque.y } else { torque }];
    }
}

/// E18: force and torque of every body that has slots in a range from what they feel, in the order of slots; gravity (m/s^2) is added to
/// the whole body.
pub fn sum<'a>(
    bodies: &mut Bodies,
    parts: &mut [Part],
    slots: Range<usize>,
    felt: impl Fn(usize) -> Option<(&'a [f32; 3], &'a Touch)> + Sync,
    gravity: DVec3,
    dimensions: u32,
) {
    let (body, offset) = (&bodies.body, &bodies.offset);
    let double = |f: [f32; 3]| DVec3::from(f.map(f64::from));
    let within = |part: &&mut Part| slots.contains(&part.slots.start);
    parts.par_iter_mut().filter(within).for_each(|part| {
        let q = body[part.body].q;
        let mut sum = Sum::default();
        for slot in part.slots.clone() {
            let Some((push, touch)) = felt(slot) else { continue };
            let arm = q * offset[slot];
            for (k, f) in [*push, touch.fluid, touch.contact].into_iter().map(double).enumerate() {
                sum.force[k] += f;
                sum.torque[k] += arm.cross(f);
            }
            sum.torque[0] += double(touch.couple);
            sum.torque[2] += double(touch.couple);
            sum.contacts += touch.contacts;
            sum.sharers += f64::from(touch.sharers);
            sum.deep += touch.deep;
        }
        part.sum = sum;
    });
    let mut total = vec![Sum::default(); bodies.body.len()];
    for part in parts.iter().filter(|part| slots.contains(&part.slots.start)) {
        let (to, from) = (&mut total[part.body], &part.sum);
        for k in 0..3 {
            to.force[k] += from.force[k];
            to.torque[k] += from.torque[k];
        }
        to.contacts += from.contacts;
        to.sharers += from.sharers;
        to.deep += from.deep;
    }
    for (body, mut sum) in bodies.body.iter_mut().zip(total) {
        // what it felt last still holds one that sleeps
        if body.asleep || !slots.contains(&body.slots.start) {
            continue;
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
            body.sharers = sum.sharers as f32;
        }
        body.contacts = sum.contacts;
        body.deep = sum.deep > 0;
    }
}
