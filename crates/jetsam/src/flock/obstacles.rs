//! Bodies in the way: seen ahead and steered round (E26), and never entered.
//!
//! Bodies and walls are known by their particles, which lie up to half a spacing below the surface and a spacing apart: what comes no
//! closer to any of them than 1.25 spacings is outside.

use super::model::FlockConstants;

use super::stage::World;
use crate::state::{Kind, Record};
use glam::Vec3;

/// Most places looked at along the way ahead.
const GLANCES: f32 = 16.0;
/// Rounds of pushing an agent out of all it touches.
const ROUNDS: usize = 8;

/// Calls `f(index of the particle, d from x to it)` for the particles of a kind closer than `radius` to `x`.
#[inline]
pub fn each_near(world: &World, kind: Kind, x: [f32; 3], radius: f32, mut f: impl FnMut(usize, Vec3)) {
    let (grid, cells) = (&world.model.grid, world.cells[kind as usize]);
    let p = world.particles;
    let first = p.first[kind as usize];
    if p.count[kind as usize] == 0 {
        return;
    }
    let cell = |a: usize, side: f32| {
        let c = ((x[a] + side * radius - grid.origin[a]) * grid.inverse[a]).floor() as i32;
        if grid.period[a] > 0.0 { c } else { c.clamp(0, grid.cells[a] - 1) }
    };
    let (low, high): ([i32; 3], [i32; 3]) =
        (std::array::from_fn(|a| cell(a, -1.0)), std::array::from_fn(|a| cell(a, 1.0)));
    let mut row = |range: std::ops::Range<usize>, shift: [f32; 3]| {
        for j in first + range.start..first + range.end {
            let d = Vec3::from(p.record[j].x) + Vec3::from(shift) - Vec3::from(x);
            if d.length_squared() < radius * radius {
                f(j, d);
            }
        }
    };
    for cz in low[2]..=high[2] {
        let Some((z, shift_z)) = grid.image(2, cz) else { continue };
        for cy in low[1]..=high[1] {
            let Some((y, shift_y)) = grid.image(1, cy) else { continue };
            if grid.period[0] == 0.0 {
                row(cells.row(low[0], high[0], y, z), [0.0, shift_y, shift_z]);
                continue;
            }
            for cx in low[0]..=high[0] {
                let Some((x, shift_x)) = grid.image(0, cx) else { continue };
                row(cells.row(x, x, y, z), [shift_x, shift_y, shift_z]);
            }
        }
    }
}

/// Where to steer so as to stay in a fluid: towards the middle of the fluid within two supports, 1 at its surface.
pub fn into_fluid(world: &World, x: [f32; 3]) -> Vec3 {
    let radius = 2.0 * world.model.support as f32;
    let (mut sum, mut count) = (Vec3::ZERO, 0.0);
    each_near(world, Kind::Fluid, x, radius, |_, d| {
        sum += d;
        count += 1.0;
    });
    // the middle of half a ball is 3/8 of its radius away
    if count > 0.0 { (sum / (0.375 * radius * count)).clamp_length_max(1.0) } else { Vec3::ZERO }
}

/// Where to steer because of what stands ahead: a direction across the heading, longer the nearer it is, at most 1.
pub fn ahead(world: &World, rule: &FlockConstants, me: &Record) -> Vec3 {
    let v = Vec3::from(me.v);
    let speed = v.length();
    let Some(heading) = v.try_normalize() else { return Vec3::ZERO };
    let clear = rule.clearance(world.model.spacing as f32);
    let reach = speed * rule.look_ahead + clear;
    let step = clear.max(reach / GLANCES);
    let radius = clear.max(0.75 * step);
    let mut way = 0.0;
    while way < reach {
        let p = Vec3::from(me.x) + (way + 0.5 * step) * heading;
        let mut away = Vec3::ZERO;
        for kind in [Kind::Rigid, Kind::Static] {
            each_near(world, kind, p.to_array(), radius, |_, d| away -= d * (1.0 - d.length() / radius));
        }
        if away != Vec3::ZERO {
            let across = away - away.dot(heading) * heading;
            return side_step(world, across, away, heading) * (1.0 - way / reach);
        }
        way += step;
    }
    Vec3::ZERO
}

/// Unit vector across the heading, on the side that is free; to the right of a face met head-on.
fn side_step(world: &World, across: Vec3, away: Vec3, heading: Vec3) -> Vec3 {
    if across.length() > 0.05 * away.length() {
        return across.normalize();
    }
    if world.model.dimensions == 2 {
        return Vec3::new(heading.z, 0.0, -heading.x);
    }
    heading.cross(Vec3::Z).try_normalize().unwrap_or(Vec3::X)
}

/// Holds an agent that came from `before` out of bodies; returns the normal of what it met. An agent that finds no place stays where it
/// was.
pub fn hold(world: &World, rule: &FlockConstants, before: [f32; 3], x: &mut [f32; 3]) -> Option<Vec3> {
    let mut met = Vec3::ZERO;
    for _ in 0..ROUNDS {
        let Some(push) = deepest(world, rule, *x) else {
            return met.try_normalize();
        };
        *x = (Vec3::from(*x) + push).to_array();
        super::motion::inside(&world.model.grid, rule.size, x);
        met += push;
    }
    if deepest(world, rule, *x).is_some() {
        met = Vec3::from(before) - Vec3::from(*x);
        *x = before;
    }
    met.try_normalize()
}

/// The push out of the particle that an agent is deepest in.
fn deepest(world: &World, rule: &FlockConstants, x: [f32; 3]) -> Option<Vec3> {
    let clear = rule.clearance(world.model.spacing as f32);
    let mut most = (0.0, Vec3::ZERO);
    for kind in [Kind::Rigid, Kind::Static] {
        let radius = clear;
        each_near(world, kind, x, 0.999 * radius, |_, d| {
            let r = d.length();
            if radius - r > most.0 {
                most = (radius - r, if r > 0.0 { d * ((r - radius) / r) } else { Vec3::Z * radius });
            }
        });
    }
    (most.0 > 0.0).then_some(most.1)
}
