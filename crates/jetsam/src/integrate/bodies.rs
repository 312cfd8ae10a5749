//! Rigid bodies: the sum of forces and torques (E18), drift and kick (E20), and particles that follow (E21).

use crate::model::Model;
use crate::scene::Integrator;
use crate::state::{Bodies, Body, Record};
use glam::{DQuat, DVec3};
use rayon::prelude::*;
use std::ops::Range;

/// Slots summed as one task; partial sums are added in order (E18).
const PART: usize = 1024;
/// Rounds of the implicit midpoint rule: it converges by a factor `omega dt` a round.
const ROUNDS: usize = 6;

/// E20, first half: half a kick, drift, and velocities predicted to the end of the step.
pub fn drift(body: &mut Body, model: &Model, dt: f64) {
    if body.is_static() {
        return;
    }
    let acceleration = body.force / body.mass;
    let kick = match model.solver.integrator {
        Integrator::Leapfrog => 0.5 * dt,
        Integrator::Euler => dt,
    };
    body.v_half = body.v + kick * acceleration;
    body.l_half = body.l + kick * body.torque;
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
fn turned(body: &Body, l: DVec3, dt: f64) -> DQuat {
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
    if body.is_static() || integrator == Integrator::Euler {
        return;
    }
    body.v = body.v_half + 0.5 * dt / body.mass * body.force;
    body.l = body.l_half + 0.5 * dt * body.torque;
    body.omega = body.inverse_inertia_at(body.q) * body.l;
}

/// E21: the slots of rigid bodies take the place and velocity their body gives them.
pub fn follow(bodies: &mut Bodies, model: &Model) {
    let Bodies { body, offset, owner, record, rigid_slots } = bodies;
    let slots = offset.par_iter().zip(&*owner).with_min_len(PART);
    record[..*rigid_slots].par_iter_mut().zip(slots).for_each(|(record, (offset, &owner))| {
        place(record, &body[owner as usize], *offset, model);
    });
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
    sum: [DVec3; 2],
}

/// Cuts the slots of all bodies into parts: a huge body and many small ones spread alike over threads.
pub fn parts(bodies: &[Body]) -> Vec<Part> {
    let cut = |(body, b): (usize, &Body)| {
        let (slots, sum) = (b.slots.clone(), [DVec3::ZERO; 2]);
        slots.clone().step_by(PART).map(move |s| Part { body, slots: s..(s + PART).min(slots.end), sum })
    };
    bodies.iter().enumerate().flat_map(cut).collect()
}

/// E18: force and torque of every body from the forces on its slots (N), in the order of slots; gravity is added
/// to the whole body.
pub fn sum(bodies: &mut Bodies, parts: &mut [Part], force: impl Fn(usize) -> [f32; 3] + Sync, model: &Model) {
    let (body, offset) = (&bodies.body, &bodies.offset);
    parts.par_iter_mut().for_each(|part| {
        let q = body[part.body].q;
        part.sum = [DVec3::ZERO; 2];
        for slot in part.slots.clone() {
            let f = DVec3::from(force(slot).map(f64::from));
            part.sum[0] += f;
            part.sum[1] += (q * offset[slot]).cross(f);
        }
    });
    for body in &mut bodies.body {
        body.force = if body.is_static() { DVec3::ZERO } else { body.mass * model.gravity };
        body.torque = DVec3::ZERO;
    }
    for part in &*parts {
        let body = &mut bodies.body[part.body];
        body.force += part.sum[0];
        body.torque += part.sum[1];
    }
    if model.dimensions == 2 {
        for body in &mut bodies.body {
            body.torque = DVec3::new(0.0, body.torque.y, 0.0);
        }
    }
}
