//! Sleep: a body that lies still on others costs nothing until something touches it.
//!
//! A body that has been slow for `solver.sleep` seconds, touching others and no fluid, falls asleep, unless what it touches
//! moves. Asleep it keeps its place, has no velocity, and its particles look for no neighbours. Whatever moves and touches
//! it, body or fluid, wakes it; if it then moves, it wakes others in turn. Nothing is known of piles as a whole. Its twin is
//! sleep.wgsl.

use crate::model::Model;
use crate::state::Body;
use glam::DVec3;

/// What a body is to those that touch it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rest {
    /// It moves: it wakes what it touches. Whoever wakes is not restless before it moves, or waking would go round a pile.
    #[default]
    Restless,
    /// It is still, or stands for good.
    Drowsy,
    /// It sleeps.
    Asleep,
}

/// A body slower than this, as a fraction of the speed of a fall by one spacing, is still.
const SLOW: f64 = 5e-3;

/// Whether bodies sleep in a world: not without weight, nor while gravity changes.
pub fn possible(model: &Model) -> bool {
    model.solver.sleep > 0.0 && model.gravity != DVec3::ZERO && model.shakes.is_empty() && model.fields.is_empty()
}

/// Speed below which a body is still (m/s).
pub fn slow(model: &Model) -> f64 {
    SLOW * (model.gravity.length() * model.spacing).sqrt()
}

/// What a body is to those that touch it.
pub fn rest(body: &Body) -> Rest {
    if body.asleep {
        Rest::Asleep
    } else if body.is_static() {
        let still = body.v == DVec3::ZERO && body.omega == DVec3::ZERO;
        if still { Rest::Drowsy } else { Rest::Restless }
    } else if body.still > 0.0 {
        Rest::Drowsy
    } else {
        Rest::Restless
    }
}

/// After a kick of a step of `dt`: how long the body has been still, and whether it falls asleep. `joined` bodies do not;
/// `stirred` says that something restless touches it.
pub fn update(body: &mut Body, model: &Model, joined: bool, stirred: bool, dt: f64) {
    if body.is_static() || joined {
        return;
    }
    if body.asleep {
        if stirred {
            (body.asleep, body.still) = (false, dt);
        }
        return;
    }
    // speed of the farthest particle, by the radius of gyration: l = I omega
    let spin = body.l.dot(body.omega) / body.mass;
    let speed = (body.v.length_squared() + spin).sqrt();
    let held = body.contacts > 0 && body.force_fluid == DVec3::ZERO;
    body.still = if held && speed < slow(model) { body.still + dt } else { 0.0 };
    if body.still >= model.solver.sleep && !stirred {
        body.asleep = true;
        (body.v, body.v_half) = (DVec3::ZERO, DVec3::ZERO);
        (body.l, body.l_half, body.omega) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        (body.force, body.torque) = (DVec3::ZERO, DVec3::ZERO);
    }
}
