//! Steps of bodies inside a step of implicit pressure: contacts want shorter ones than the flow.
//!
//! What fluids do to bodies stands still meanwhile; places, contacts and joints are found anew in each part. The last part
//! ends in the stage `bodies`, where all forces are there anyway.

use super::implicit::{DEEP, SHALLOW};
use super::{Cpu, sleep};
use crate::integrate::bodies::{self, first_kick};
use crate::integrate::{Advance, joints, particles};
use crate::interact::CHUNK;
use crate::model::Model;
use crate::scene::Pressure;
use crate::state::{Kind, State};
use glam::DVec3;
use rayon::prelude::*;

impl Cpu {
    /// Stage `kick` with implicit pressure: all forces but pressure push fluids, and what was found in the step before is forgotten.
    pub(super) fn push(&mut self, advance: Advance) {
        let State { particles: p, bodies: b, .. } = &mut self.state;
        self.implicit.added.resize(b.body.len(), [DVec3::ZERO; 2]);
        for (body, added) in b.body.iter_mut().zip(&mut self.implicit.added) {
            let [force, torque] = std::mem::take(added);
            body.force_fluid -= force;
            body.torque_fluid -= torque;
            if !body.one_way {
                body.force -= force;
                body.torque -= torque;
            }
        }
        let fluid = p.segment(Kind::Fluid);
        let push = p.push[fluid.clone()].par_chunks(CHUNK);
        p.record[fluid]
            .par_chunks_mut(CHUNK)
            .zip(push)
            .for_each(|(records, push)| particles::push(advance, records, push));
        self.implicit.impulse = advance.dt * self.outside_fluids;
    }

    /// Stage `drift` with implicit pressure: fluids at one go, bodies part by part.
    pub(super) fn glide(&mut self, model: &Model, advance: Advance) {
        let p = &mut self.state.particles;
        let (fluid, carry) = (p.segment(Kind::Fluid), &p.carry);
        let places = if model.solver.pressure == Pressure::Dfsph { &self.implicit.flow[..] } else { &[] };
        p.record[fluid].par_chunks_mut(CHUNK).enumerate().for_each(|(c, records)| {
            let carry = carry.get(c * CHUNK..).unwrap_or(&[]);
            particles::glide(advance, &model.grid, records, carry, places.get(c * CHUNK..).unwrap_or(&[]));
        });
        if model.solver.pressure == Pressure::Dfsph {
            self.ledger.put_back += self.keep_inside(model, DEEP);
        } else {
            // PBF has had no say yet, but what stands among the particles of a wall it could not move well
            self.keep_inside(model, SHALLOW);
        }
        let b = &self.state.bodies.body;
        self.implicit.steady = b.iter().map(|body| [body.force_fluid, body.torque_fluid]).collect();
        if advance.drag > 0.0 || b.is_empty() {
            return;
        }
        for k in 0..advance.parts {
            let part = Self::part(advance, k);
            self.move_bodies(model, part);
            if k + 1 < advance.parts {
                self.touch_in_part(model, part);
                self.bodies(model, part, false);
                let outside = self.outside_seen_by_bodies(model, part);
                self.end_part(model, part, outside, false);
            }
        }
    }

    /// Stage `bodies` with implicit pressure: the last part's end. Afterwards the force on a body is what is said of it: that of
    /// fluids as they pushed in this step.
    pub(super) fn end_step(&mut self, model: &Model, advance: Advance) {
        self.bodies(model, advance, true);
        let outside = self.outside(model, advance);
        if advance.drag == 0.0 && advance.dt > 0.0 {
            self.end_part(model, Self::part(advance, advance.parts - 1), outside, true);
        } else {
            // nothing is in the forces but what was summed
            self.outside_bodies = outside;
            self.implicit.added.fill([DVec3::ZERO; 2]);
        }
    }

    /// Part `k` of a step.
    fn part(advance: Advance, k: u32) -> Advance {
        let dt = advance.part();
        Advance { time: advance.time + f64::from(k) * dt, dt, dt_before: dt, drag: 0.0, parts: 1 }
    }

    /// Half a kick, drift.
    fn move_bodies(&mut self, model: &Model, part: Advance) {
        let b = &mut self.state.bodies;
        self.implicit.impulse += first_kick(model.solver.integrator, part.dt) * self.outside_bodies;
        bodies::advance(b, model, part);
    }

    /// The kick that ends a part, after contacts were summed: fluids push as they did at the step's beginning.
    fn end_part(&mut self, model: &Model, part: Advance, outside: DVec3, last: bool) {
        let rest = part.dt - first_kick(model.solver.integrator, part.dt);
        self.outside_bodies = outside;
        self.implicit.impulse += rest * self.outside_bodies;
        let b = &mut self.state.bodies;
        let Self { implicit, stirred, .. } = self;
        implicit.added.resize(b.body.len(), [DVec3::ZERO; 2]);
        let fresh: Vec<_> = b.body.iter().map(|body| [body.force_fluid, body.torque_fluid]).collect();
        let one_way = |way: bool| if way { 0.0 } else { 1.0 };
        for (body, (steady, fresh)) in b.body.iter_mut().zip(implicit.steady.iter().zip(&fresh)) {
            if !body.asleep {
                body.force += one_way(body.one_way) * (steady[0] - fresh[0]);
                body.torque += one_way(body.one_way) * (steady[1] - fresh[1]);
            }
        }
        b.body.par_iter_mut().with_min_len(CHUNK).for_each(|body| bodies::kick(body, model.solver.integrator, part.dt));
        joints::kick(b, model);
        implicit.impulse += b.joint_impulse;
        for (body, ((steady, fresh), added)) in
            b.body.iter_mut().zip(implicit.steady.iter().zip(fresh).zip(&implicit.added))
        {
            if !body.asleep {
                let now = if last { [fresh[0] + added[0], fresh[1] + added[1]] } else { *steady };
                body.force += one_way(body.one_way) * (now[0] - steady[0]);
                body.torque += one_way(body.one_way) * (now[1] - steady[1]);
                [body.force_fluid, body.torque_fluid] = now;
            }
        }
        if sleep::possible(model) {
            for (body, (stirred, contact)) in b.body.iter_mut().zip(stirred.iter_mut().zip(&model.contacts)) {
                sleep::update(body, model, contact.jointed, *stirred.get_mut(), part.dt);
            }
        }
    }

    /// The same while what stands is left out: between bodies that move contact forces cancel.
    fn outside_seen_by_bodies(&self, model: &Model, advance: Advance) -> DVec3 {
        let gravity = model.gravity_at(advance.end());
        let b = &self.state.bodies;
        let moving = b.body.iter().filter(|body| !body.is_static());
        moving.map(|body| body.mass * gravity + body.force_contact).sum::<DVec3>()
            + b.joint_force
            + self.fields_on_bodies(model)
    }

    /// Force from outside on bodies (N): gravity, fields, what stands, springs.
    fn outside(&self, model: &Model, advance: Advance) -> DVec3 {
        let gravity = model.gravity_at(advance.end());
        let b = &self.state.bodies;
        let of = |body: &crate::state::Body| match body.is_static() {
            true => -body.force_contact,
            false => body.mass * gravity,
        };
        b.body.iter().map(of).sum::<DVec3>() + b.joint_force + self.fields_on_bodies(model)
    }
}
