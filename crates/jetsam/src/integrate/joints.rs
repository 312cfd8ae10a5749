//! Joints (E32): impulses that keep bodies together, as RATTLE does (Andersen 1983): drift corrects the half-step momenta so
//! that the places at its end fit, kick corrects the velocities so that they do too. Both ends of a joint receive
//! opposite impulses at one point: momentum is kept, and leapfrog stays of second order.
//!
//! In: bodies after the half kick, or after the kick. Out: their momenta corrected. Joints are solved one after another,
//! in the order of the scene, there and back, until all fit.

use super::bodies::turned;
use crate::model::Model;
use crate::scene::joint::{JointKind, JointModel};
use crate::state::{Bodies, Body};
use glam::{DMat3, DQuat, DVec3};

/// Sweeps over all joints at most.
const SWEEPS: usize = 200;
/// Misfit that counts as none, as a fraction of a spacing, or in rad.
const FIT: f64 = 1e-10;

/// One end of a joint: what impulses do to it.
struct End {
    arm: DVec3,
    inverse_mass: f64,
    inverse_inertia: DMat3,
}

impl End {
    fn new(body: Option<&Body>, anchor: DVec3) -> Self {
        match body {
            Some(b) if !b.is_static() => {
                Self { arm: b.q * anchor, inverse_mass: 1.0 / b.mass, inverse_inertia: b.inverse_inertia_at(b.q) }
            }
            _ => Self { arm: DVec3::ZERO, inverse_mass: 0.0, inverse_inertia: DMat3::ZERO },
        }
    }

    /// Velocity of the anchor by a unit impulse at it.
    fn compliance(&self) -> DMat3 {
        let r = self.arm;
        let cross =
            DMat3::from_cols(DVec3::new(0.0, r.z, -r.y), DVec3::new(-r.z, 0.0, r.x), DVec3::new(r.y, -r.x, 0.0));
        DMat3::from_diagonal(DVec3::splat(self.inverse_mass)) - cross * self.inverse_inertia * cross
    }
}

/// The momenta that a stage corrects.
#[derive(Clone, Copy, PartialEq)]
enum Momenta {
    Half,
    Full,
}

/// Corrects half-step momenta so that the joints fit after a drift of `dt`.
pub fn drift(bodies: &mut Bodies, model: &Model, dt: f64) {
    bodies.joint_impulse = DVec3::ZERO;
    if dt == 0.0 {
        return;
    }
    let place = |body: &Body| {
        if body.is_static() { (body.x, body.q) } else { (body.x + dt * body.v_half, turned(body, body.l_half, dt)) }
    };
    sweep(model, |joint| {
        let (a, b) = (&bodies.body[joint.a], joint.b.map(|b| &bodies.body[b]));
        let (x_a, q_a) = place(a);
        let (x_b, q_b) = b.map_or((DVec3::ZERO, DQuat::IDENTITY), place);
        let gap = x_b + q_b * joint.anchor[1] - (x_a + q_a * joint.anchor[0]);
        let misfit = turn_misfit(joint, q_a, q_b);
        let (p, turn) = impulses(model, joint, a, b, gap / dt, misfit.map(|m| m / dt));
        apply(bodies, joint, p, turn, Momenta::Half);
        (gap.length() / model.spacing).max(misfit.map_or(0.0, DVec3::length))
    });
}

/// Corrects velocities so that the joints' ends move alike.
pub fn kick(bodies: &mut Bodies, model: &Model) {
    let scale = model.largest_speed;
    sweep(model, |joint| {
        let (a, b) = (&bodies.body[joint.a], joint.b.map(|b| &bodies.body[b]));
        let motion = |body: &Body, anchor| (body.v + body.omega.cross(body.q * anchor), body.omega);
        let (v_a, w_a) = motion(a, joint.anchor[0]);
        let (v_b, w_b) = b.map_or((DVec3::ZERO, DVec3::ZERO), |b| motion(b, joint.anchor[1]));
        let (gap, spin) = (v_b - v_a, w_b - w_a);
        let misfit = match joint.kind {
            JointKind::Fixed => Some(spin),
            JointKind::Hinge => {
                let axis = a.q * joint.axis[0];
                let mut m = spin - axis * spin.dot(axis);
                // a stop takes what would turn the hinge further
                let q_b = b.map_or(DQuat::IDENTITY, |b| b.q);
                let beyond = past_limit(joint, a.q, q_b);
                if beyond != 0.0 && -spin.dot(axis) * beyond > 0.0 {
                    m = spin;
                }
                Some(m)
            }
            _ => None,
        };
        let (p, turn) = impulses(model, joint, a, b, gap, misfit);
        apply(bodies, joint, p, turn, Momenta::Full);
        gap.length().max(misfit.map_or(0.0, DVec3::length) * model.spacing) / scale
    });
}

/// Solves all joints but springs, there and back, until the worst misfit is none.
fn sweep(model: &Model, mut solve: impl FnMut(&JointModel) -> f64) {
    for n in 0..SWEEPS {
        let mut worst = 0.0f64;
        let mut one = |joint: &JointModel| {
            if joint.kind != JointKind::Spring {
                worst = worst.max(solve(joint));
            }
        };
        if n % 2 == 0 {
            model.joints.iter().for_each(&mut one);
        } else {
            model.joints.iter().rev().for_each(&mut one);
        }
        if worst < FIT {
            break;
        }
    }
}

/// The rotation (rad) that `a` lacks, where the joint asks for one.
fn turn_misfit(joint: &JointModel, q_a: DQuat, q_b: DQuat) -> Option<DVec3> {
    match joint.kind {
        JointKind::Fixed => {
            let lack = q_b * joint.turn * q_a.inverse();
            Some(if lack.w < 0.0 { -lack } else { lack }.to_scaled_axis())
        }
        JointKind::Hinge => {
            let (axis_a, axis_b) = (q_a * joint.axis[0], q_b * joint.axis[1]);
            Some(axis_a.cross(axis_b) - axis_b * past_limit(joint, q_a, q_b))
        }
        _ => None,
    }
}

/// How far a hinge has turned past a limit (rad): positive beyond the largest angle.
fn past_limit(joint: &JointModel, q_a: DQuat, q_b: DQuat) -> f64 {
    let Some([low, high]) = joint.limits else { return 0.0 };
    let (u_a, u_b, axis) = (q_a * joint.across[0], q_b * joint.across[1], q_b * joint.axis[1]);
    let angle = axis.dot(u_b.cross(u_a)).atan2(u_b.dot(u_a));
    if angle > high { angle - high } else { (angle - low).min(0.0) }
}

/// Impulse at the anchor and angular impulse on `a` that make up for differences of velocities.
fn impulses(
    model: &Model,
    joint: &JointModel,
    a: &Body,
    b: Option<&Body>,
    v: DVec3,
    omega: Option<DVec3>,
) -> (DVec3, DVec3) {
    let (end_a, end_b) = (End::new(Some(a), joint.anchor[0]), End::new(b, joint.anchor[1]));
    let p = (end_a.compliance() + end_b.compliance()).inverse() * v;
    let Some(omega) = omega.filter(|w| *w != DVec3::ZERO) else { return (p, DVec3::ZERO) };
    let k = end_a.inverse_inertia + end_b.inverse_inertia;
    if model.dimensions == 2 {
        return (p, DVec3::Y * (omega.y / k.y_axis.y));
    }
    if joint.kind == JointKind::Fixed {
        return (p, k.inverse() * omega);
    }
    // across the axis, and along it for a stop alone
    let axis = a.q * joint.axis[0];
    let (t, s) = axis.any_orthonormal_pair();
    let [tt, ts, ss] = [t.dot(k * t), t.dot(k * s), s.dot(k * s)];
    let (u, w) = (omega.dot(t), omega.dot(s));
    let det = tt * ss - ts * ts;
    let across = t * ((ss * u - ts * w) / det) + s * ((tt * w - ts * u) / det);
    (p, across + axis * (omega.dot(axis) / axis.dot(k * axis)))
}

/// Gives `a` the impulses and `b` their opposites.
fn apply(bodies: &mut Bodies, joint: &JointModel, p: DVec3, turn: DVec3, momenta: Momenta) {
    let mut push = |index: usize, anchor: DVec3, p: DVec3, turn: DVec3| {
        let body = &mut bodies.body[index];
        if body.is_static() {
            return false;
        }
        let l = (body.q * anchor).cross(p) + turn;
        if momenta == Momenta::Half {
            body.v_half += p / body.mass;
            body.l_half += l;
        } else {
            body.v += p / body.mass;
            body.l += l;
            body.omega = body.inverse_inertia_at(body.q) * body.l;
        }
        true
    };
    push(joint.a, joint.anchor[0], p, turn);
    let inside = joint.b.is_some_and(|b| push(b, joint.anchor[1], -p, -turn));
    if !inside {
        bodies.joint_impulse += p;
    }
}

/// Adds the forces of springs to the bodies.
pub fn springs(bodies: &mut Bodies, model: &Model) {
    bodies.joint_force = DVec3::ZERO;
    for joint in model.joints.iter().filter(|j| j.kind == JointKind::Spring) {
        let end = |body: Option<&Body>, anchor: DVec3| match body {
            Some(b) => (b.x + b.q * anchor, b.v + b.omega.cross(b.q * anchor)),
            None => (anchor, DVec3::ZERO),
        };
        let (x_a, v_a) = end(Some(&bodies.body[joint.a]), joint.anchor[0]);
        let (x_b, v_b) = end(joint.b.map(|b| &bodies.body[b]), joint.anchor[1]);
        let (d, v) = (x_b - x_a, v_b - v_a);
        let Some(n) = d.try_normalize() else { continue };
        let f = n * (joint.stiffness * (d.length() - joint.length) + joint.damping * v.dot(n));
        for (index, at, f) in [(Some(joint.a), x_a, f), (joint.b, x_b, -f)] {
            match index.map(|i| &mut bodies.body[i]) {
                Some(body) if !body.is_static() => {
                    body.force += f;
                    body.torque += (at - body.x).cross(f);
                }
                _ => bodies.joint_force -= f,
            }
        }
    }
}
