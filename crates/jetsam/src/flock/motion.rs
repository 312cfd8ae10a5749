//! Agents move: steering becomes velocity, velocity becomes place; sides of the domain and bodies hold.
//!
//! Reynolds' agents are kicked first and carried by the new velocity; Couzin's take the decided velocity at once; Vicsek's keep the old
//! one until the next decision, as their law has it.

use super::model::FlockConstants;
use super::obstacles;
use super::stage::World;
use crate::interact::cells::Grid;
use crate::interact::lanes::LANES;
use crate::laws::flock;
use crate::scene::{FlockModel, Wall};
use crate::state::Record;
use fearless_simd::Simd;
use glam::{DVec3, Vec3};

/// Cosine and sine of an angle that a turn may reach; none is too large from half a turn on.
pub fn turn(angle: f64) -> (f32, f32) {
    if angle >= std::f64::consts::PI { (-2.0, 0.0) } else { (angle.cos() as f32, angle.sin() as f32) }
}

/// Chunks of the arrays of agents, all of one flock.
pub struct Part<'a> {
    pub record: &'a mut [Record],
    pub next: &'a mut [[f32; 3]],
    pub rest: &'a mut [[f32; 3]],
    pub force: &'a [[f32; 3]],
}

/// Moves a chunk of agents of one flock by `dt` (s), after a kick of `first` (s) with the forces of the step before. Returns the momentum
/// (kg m/s) that they take by themselves: by steering, and at sides and bodies that turn them round. For any machine `_simd`.
#[inline(always)]
pub fn chunk<S: Simd>(_simd: S, world: &World, rule: &FlockConstants, dt: f64, first: f64, part: Part) -> DVec3 {
    let Part { record, next, rest, force } = part;
    let mut own = DVec3::ZERO;
    let turn = turn(rule.limits.turn * dt);
    let obstacles = world.has_bodies();
    let blocks = record.chunks_mut(LANES).zip(next.chunks_mut(LANES)).zip(rest.chunks_mut(LANES));
    for (b, ((record, next), rest)) in blocks.enumerate() {
        if let Some(matter) = &rule.matter {
            let force = &force[LANES * b..];
            for (r, force) in record.iter_mut().zip(force) {
                r.v = (Vec3::from(r.v) + first as f32 / matter.mass * Vec3::from(*force)).to_array();
                own -= f64::from(matter.mass) * Vec3::from(r.v).as_dvec3();
            }
        }
        match rule.model {
            FlockModel::Reynolds => kick(rule, record, next, dt as f32, turn),
            FlockModel::Couzin => record.iter_mut().zip(&*next).for_each(|(r, next)| r.v = *next),
            FlockModel::Vicsek => {}
        }
        for ((r, next), rest) in record.iter_mut().zip(next).zip(rest) {
            let before = r.x;
            for a in 0..3 {
                // what rounding left over is carried on (Kahan)
                let step = dt as f32 * r.v[a] - rest[a];
                r.x[a] += step;
                rest[a] = (r.x[a] - before[a]) - step;
            }
            let sides = inside(&world.model.grid, rule.size, &mut r.x);
            for a in 0..3 {
                bounce(&mut r.v[a], sides[a]);
                if rule.model != FlockModel::Reynolds {
                    bounce(&mut next[a], sides[a]);
                }
            }
            if obstacles && let Some(normal) = obstacles::hold(world, rule, before, &mut r.x) {
                mirror(&mut r.v, normal);
                if rule.model != FlockModel::Reynolds {
                    mirror(next, normal);
                }
            }
            world.model.grid.wrap(&mut r.x);
        }
        if let Some(matter) = &rule.matter {
            own += f64::from(matter.mass) * record.iter().map(|r| Vec3::from(r.v).as_dvec3()).sum::<DVec3>();
        }
    }
    own
}

/// Velocities after a step of up to sixteen of Reynolds' agents.
#[inline(always)]
fn kick(rule: &FlockConstants, record: &mut [Record], steering: &[[f32; 3]], dt: f32, turn: (f32, f32)) {
    let (mut v, mut a) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
    for (l, (r, steering)) in record.iter().zip(steering).enumerate() {
        for c in 0..3 {
            (v[c][l], a[c][l]) = (r.v[c], steering[c]);
        }
    }
    let (slowest, fastest, pushed) = (rule.limits.slowest, rule.limits.fastest, rule.matter.is_some());
    for l in 0..LANES {
        let (v_l, a_l) = ([v[0][l], v[1][l], v[2][l]], [a[0][l], a[1][l], a[2][l]]);
        // limits hold for what agents do themselves: one that is pushed beyond them is not brought back at once
        let speed = (v_l[0] * v_l[0] + v_l[1] * v_l[1] + v_l[2] * v_l[2]).sqrt();
        let (least, most) = if pushed { (slowest.min(speed), fastest.max(speed)) } else { (slowest, fastest) };
        let new = flock::moved(v_l, a_l, dt, turn.0, turn.1, least, most);
        (v[0][l], v[1][l], v[2][l]) = (new.x, new.y, new.z);
    }
    for (l, r) in record.iter_mut().enumerate() {
        r.v = [v[0][l], v[1][l], v[2][l]];
    }
}

/// Brings a place inside the solid sides, as far as the agent's size asks; says on which axis it had passed which.
pub fn inside(grid: &Grid, size: f32, x: &mut [f32; 3]) -> [f32; 3] {
    let mut sides = [0.0; 3];
    for a in (0..3).filter(|&a| grid.walls[a] == Wall::Solid) {
        let (low, high) = (grid.min[a] as f32 + size, grid.max[a] as f32 - size);
        if x[a] < low {
            (x[a], sides[a]) = ((2.0 * low - x[a]).min(high), 1.0);
        } else if x[a] > high {
            (x[a], sides[a]) = ((2.0 * high - x[a]).max(low), -1.0);
        }
    }
    sides
}

/// A velocity component turned inward where a side was passed.
fn bounce(v: &mut f32, side: f32) {
    if side != 0.0 {
        *v = side * v.abs();
    }
}

/// A velocity mirrored by what it runs into.
fn mirror(v: &mut [f32; 3], normal: Vec3) {
    let u = Vec3::from(*v);
    *v = (u - 2.0 * u.dot(normal).min(0.0) * normal).to_array();
}
