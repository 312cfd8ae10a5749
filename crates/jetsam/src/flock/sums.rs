//! What an agent perceives: sums over its neighbours, sixteen at a time.
//!
//! In: an agent and a tile of candidates. Out: [`Sums`]. The laws are those of `laws/flock.wgsl`; the order of additions is fixed.

use super::model::FlockConstants;
use super::perception::Tile;
use crate::interact::lanes::{LANES, Lanes, minus, squares, sum};
use crate::laws::flock;
use crate::scene::FlockModel;
use crate::state::Record;
use fearless_simd::f32x16;
use fearless_simd::prelude::*;
use glam::Vec3;

/// Sums over neighbours.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sums {
    /// Away from those too near: pushes (Reynolds), unit vectors (Couzin).
    pub repelled: Vec3,
    /// Velocities (m/s) of those aligned with, oneself included.
    pub velocity: Vec3,
    /// Number of those aligned with, oneself included.
    pub aligned: f32,
    /// Relative places (m) of those drawn to; Couzin: unit vectors.
    pub place: Vec3,
    /// Number of those drawn to, oneself included.
    pub drawn: f32,
    /// `d / r^2` (1/m) of those fled.
    pub fled: Vec3,
    /// `d / r^2` (1/m) of those chased.
    pub chased: Vec3,
}

impl Sums {
    /// Adds what the agent itself brings, where it was not among the candidates.
    pub fn add_oneself(&mut self, me: &Record) {
        self.velocity += Vec3::from(me.v);
        self.aligned += 1.0;
        self.drawn += 1.0;
    }
}

/// The same, lane by lane.
struct Wide {
    repelled: [Lanes; 3],
    velocity: [Lanes; 3],
    aligned: Lanes,
    place: [Lanes; 3],
    drawn: Lanes,
}

impl Wide {
    #[inline(always)]
    fn new() -> Self {
        let zero = [[0.0; LANES]; 3];
        Self { repelled: zero, velocity: zero, aligned: [0.0; LANES], place: zero, drawn: [0.0; LANES] }
    }
}

#[inline(always)]
fn fold<S: Simd>(simd: S, wide: &[Lanes; 3]) -> Vec3 {
    Vec3::new(sum(simd, &wide[0]), sum(simd, &wide[1]), sum(simd, &wide[2]))
}

/// `d` and its square for sixteen candidates.
#[inline(always)]
fn apart<S: Simd>(simd: S, me: &Record, block: &[&Lanes; 6]) -> ([Lanes; 3], Lanes) {
    let d = [minus(simd, block[0], me.x[0]), minus(simd, block[1], me.x[1]), minus(simd, block[2], me.x[2])];
    let r_sq = squares(simd, &d);
    (d, r_sq)
}

/// Who of sixteen is in view.
#[inline(always)]
fn in_view(me: &Record, d: &[Lanes; 3], r_sq: &Lanes, bound: f32) -> Lanes {
    let v = me.v;
    let speed_sq = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
    let mut seen = [0.0; LANES];
    for l in 0..LANES {
        seen[l] = flock::in_view(d[0][l] * v[0] + d[1][l] * v[1] + d[2][l] * v[2], r_sq[l], speed_sq, bound);
    }
    seen
}

/// Adds `weight` times a vector, lane by lane.
#[inline(always)]
fn add(to: &mut [Lanes; 3], weight: &Lanes, vector: [&Lanes; 3]) {
    for a in 0..3 {
        for l in 0..LANES {
            to[a][l] += weight[l] * vector[a][l];
        }
    }
}

/// Adds the vectors of those whose weight is 1, not 0: the products are exact, so that fused or not it is the same number.
#[inline(always)]
fn add_those<S: Simd>(simd: S, to: &mut [Lanes; 3], weight: &Lanes, vector: [&Lanes; 3]) {
    let weight = f32x16::load_array_ref(simd, weight);
    for a in 0..3 {
        let sum = f32x16::load_array_ref(simd, &to[a]);
        weight.mul_add(f32x16::load_array_ref(simd, vector[a]), sum).store_array(&mut to[a]);
    }
}

/// Sums over those an agent schools with. `unbounded`: the tile holds topological neighbours, whatever their distance.
#[inline(always)]
pub fn school<S: Simd>(simd: S, me: &Record, rule: &FlockConstants, tile: &Tile, unbounded: bool, sums: &mut Sums) {
    let mut wide = Wide::new();
    match rule.model {
        FlockModel::Reynolds => reynolds(simd, me, rule, tile, unbounded, &mut wide),
        FlockModel::Couzin => couzin(simd, me, rule, tile, unbounded, &mut wide),
        FlockModel::Vicsek => vicsek(simd, me, rule, tile, unbounded, &mut wide),
    }
    sums.repelled += fold(simd, &wide.repelled);
    sums.velocity += fold(simd, &wide.velocity);
    sums.aligned += sum(simd, &wide.aligned);
    sums.place += fold(simd, &wide.place);
    sums.drawn += sum(simd, &wide.drawn);
}

/// Square of a radius; of topological neighbours none is too far.
#[inline(always)]
fn square(radius: f32, unbounded: bool) -> f32 {
    if unbounded { 1e30 } else { radius * radius }
}

/// E22. Compiled for each combination of what most flocks are spared: a second radius, and a field of view.
#[inline(always)]
fn reynolds<S: Simd>(simd: S, me: &Record, rule: &FlockConstants, tile: &Tile, unbounded: bool, wide: &mut Wide) {
    let alike = unbounded || rule.alignment_radius == rule.cohesion_radius;
    match (alike, rule.view) {
        (true, None) => reynolds_of::<S, true, true>(simd, me, rule, tile, unbounded, wide),
        (true, Some(_)) => reynolds_of::<S, true, false>(simd, me, rule, tile, unbounded, wide),
        (false, None) => reynolds_of::<S, false, true>(simd, me, rule, tile, unbounded, wide),
        (false, Some(_)) => reynolds_of::<S, false, false>(simd, me, rule, tile, unbounded, wide),
    }
}

/// `ALIKE`: the radii of alignment and cohesion are the same. `ALL_AROUND`: the agent sees all around.
#[inline(always)]
fn reynolds_of<S: Simd, const ALIKE: bool, const ALL_AROUND: bool>(
    simd: S,
    me: &Record,
    rule: &FlockConstants,
    tile: &Tile,
    unbounded: bool,
    wide: &mut Wide,
) {
    let near_sq = rule.separation_radius * rule.separation_radius;
    let near_limit = f32x16::splat(simd, near_sq);
    let align_sq = square(rule.alignment_radius, unbounded);
    let draw_sq = square(rule.cohesion_radius, unbounded);
    let bound = rule.view.unwrap_or(-1.0);
    let window = tile.window();
    for first in window.clone().step_by(u64::BITS as usize) {
        // where anybody is near, a bit a vector: a branch for each would be foretold badly
        let mut near = 0u64;
        for (b, block) in tile.vectors(first..window.end.min(first + u64::BITS as usize)).enumerate() {
            let (d, r_sq) = apart(simd, me, &block);
            let (mut aligned, mut drawn) = ([0.0; LANES], [0.0; LANES]);
            for l in 0..LANES {
                aligned[l] = flock::within(r_sq[l], align_sq);
                drawn[l] = if ALIKE { aligned[l] } else { flock::within(r_sq[l], draw_sq) };
            }
            if !ALL_AROUND {
                let seen = in_view(me, &d, &r_sq, bound);
                for l in 0..LANES {
                    aligned[l] *= seen[l];
                    drawn[l] *= seen[l];
                }
            }
            add_those(simd, &mut wide.velocity, &aligned, [block[3], block[4], block[5]]);
            add_those(simd, &mut wide.place, &drawn, [&d[0], &d[1], &d[2]]);
            for l in 0..LANES {
                wide.aligned[l] += aligned[l];
                if !ALIKE {
                    wide.drawn[l] += drawn[l];
                }
            }
            near |= u64::from(f32x16::load_array_ref(simd, &r_sq).simd_lt(near_limit).any_true()) << b;
        }
        while near != 0 {
            let block = tile.block(first + near.trailing_zeros() as usize);
            near &= near - 1;
            separate::<S, ALL_AROUND>(simd, me, rule, &block, near_sq, wide);
        }
    }
    if ALIKE {
        wide.drawn = wide.aligned;
    }
}

/// Pushes away from those of sixteen that are near.
#[inline(always)]
fn separate<S: Simd, const ALL_AROUND: bool>(
    simd: S,
    me: &Record,
    rule: &FlockConstants,
    block: &[&Lanes; 6],
    near_sq: f32,
    wide: &mut Wide,
) {
    let (d, r_sq) = apart(simd, me, block);
    let seen = match ALL_AROUND {
        true => [1.0; LANES],
        false => in_view(me, &d, &r_sq, rule.view.unwrap_or(-1.0)),
    };
    for l in 0..LANES {
        let weight = flock::separation(r_sq[l], rule.separation_radius) * flock::within(r_sq[l], near_sq);
        let push = -seen[l] * weight;
        wide.repelled[0][l] += push * d[0][l];
        wide.repelled[1][l] += push * d[1][l];
        wide.repelled[2][l] += push * d[2][l];
    }
}

/// E23. Speeds are equal: velocities stand for directions.
#[inline(always)]
fn couzin<S: Simd>(simd: S, me: &Record, rule: &FlockConstants, tile: &Tile, unbounded: bool, wide: &mut Wide) {
    let near_sq = rule.separation_radius * rule.separation_radius;
    let align_sq = square(rule.alignment_radius, false).max(near_sq);
    let draw_sq = square(rule.cohesion_radius, unbounded).max(align_sq);
    for block in tile.vectors(tile.window()) {
        let (d, r_sq) = apart(simd, me, &block);
        let seen = match rule.view {
            Some(bound) => in_view(me, &d, &r_sq, bound),
            None => [1.0; LANES],
        };
        let (mut repelled, mut aligned, mut drawn) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for l in 0..LANES {
            let inverse = 1.0 / r_sq[l].max(1e-30).sqrt();
            repelled[l] = -inverse * flock::within(r_sq[l], near_sq);
            aligned[l] = seen[l] * flock::between(r_sq[l], near_sq, align_sq) / rule.limits.speed;
            drawn[l] = inverse * seen[l] * flock::between(r_sq[l], align_sq, draw_sq);
        }
        add(&mut wide.repelled, &repelled, [&d[0], &d[1], &d[2]]);
        add(&mut wide.velocity, &aligned, [block[3], block[4], block[5]]);
        add(&mut wide.place, &drawn, [&d[0], &d[1], &d[2]]);
    }
}

/// E24.
#[inline(always)]
fn vicsek<S: Simd>(simd: S, me: &Record, rule: &FlockConstants, tile: &Tile, unbounded: bool, wide: &mut Wide) {
    let align_sq = square(rule.alignment_radius, unbounded);
    for block in tile.vectors(tile.window()) {
        let (d, r_sq) = apart(simd, me, &block);
        let mut aligned = [0.0; LANES];
        for l in 0..LANES {
            aligned[l] = flock::within(r_sq[l], align_sq);
        }
        if let Some(bound) = rule.view {
            let seen = in_view(me, &d, &r_sq, bound);
            for l in 0..LANES {
                aligned[l] *= seen[l];
            }
        }
        add(&mut wide.velocity, &aligned, [block[3], block[4], block[5]]);
    }
}

/// E26: sum of `d / r^2` over those in sight.
#[inline(always)]
pub fn seen<S: Simd>(simd: S, me: &Record, rule: &FlockConstants, tile: &Tile) -> Vec3 {
    let mut total = [[0.0; LANES]; 3];
    let sight_sq = rule.sight * rule.sight;
    for block in tile.vectors(tile.window()) {
        let (d, r_sq) = apart(simd, me, &block);
        let mut weight = match rule.view {
            Some(bound) => in_view(me, &d, &r_sq, bound),
            None => [1.0; LANES],
        };
        for l in 0..LANES {
            weight[l] *= flock::within(r_sq[l], sight_sq) * flock::nearness(r_sq[l]);
        }
        add(&mut total, &weight, [&d[0], &d[1], &d[2]]);
    }
    fold(simd, &total)
}
