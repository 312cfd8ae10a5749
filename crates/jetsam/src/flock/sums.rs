//! What agents perceive: sums over their neighbours, for sixteen agents at a time.
//!
//! In: up to sixteen agents of a row of cells, and a run of candidates, which all of them look at one by one. Out: [`Sums`]. The laws are
//! those of `laws/flock.wgsl`. Each agent adds in the order of the candidates, whoever looks beside it: its bits depend on nothing else.

use super::model::FlockConstants;
use crate::interact::lanes::{LANES, Lanes};
use crate::laws::flock;
use crate::scene::FlockModel;
use crate::state::Record;
use fearless_simd::f32x16;
use fearless_simd::prelude::*;
use glam::Vec3;

/// Where lanes without an agent are (m): too far for any radius, with squares that are finite.
const FAR: f32 = 1e18;

/// Up to sixteen agents, component by component.
#[derive(Clone, Copy, Debug)]
pub struct Group {
    /// Positions (m).
    pub x: [Lanes; 3],
    /// Velocities (m/s).
    pub v: [Lanes; 3],
}

impl Group {
    /// These agents.
    #[inline(always)]
    pub fn new(agents: &[Record]) -> Self {
        let mut group = Self { x: [[FAR; LANES]; 3], v: [[0.0; LANES]; 3] };
        for (l, r) in agents.iter().enumerate().take(LANES) {
            for a in 0..3 {
                (group.x[a][l], group.v[a][l]) = (r.x[a], r.v[a]);
            }
        }
        group
    }

    /// The agent of one lane alone.
    #[inline(always)]
    pub fn only(&self, lane: usize) -> Self {
        let mut alone = Self { x: [[FAR; LANES]; 3], v: self.v };
        for a in 0..3 {
            alone.x[a][lane] = self.x[a][lane];
        }
        alone
    }
}

/// Candidates on end.
#[derive(Clone, Copy, Debug)]
pub struct Run<'a> {
    /// The agents.
    pub agents: &'a [Record],
    /// What brings their periodic images into place (m).
    pub shift: [f32; 3],
}

/// Sums over neighbours, lane by lane.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sums {
    /// Away from those too near: pushes (Reynolds), unit vectors (Couzin).
    pub repelled: [Lanes; 3],
    /// Velocities (m/s) of those aligned with, oneself included.
    pub velocity: [Lanes; 3],
    /// Number of those aligned with, oneself included.
    pub aligned: Lanes,
    /// Relative places (m) of those drawn to; Couzin: unit vectors.
    pub place: [Lanes; 3],
    /// Number of those drawn to, oneself included.
    pub drawn: Lanes,
    /// `d / r^2` (1/m) of those fled.
    pub fled: [Lanes; 3],
    /// `d / r^2` (1/m) of those chased.
    pub chased: [Lanes; 3],
}

/// The vector of one lane.
#[inline(always)]
pub fn lane(of: &[Lanes; 3], l: usize) -> Vec3 {
    Vec3::new(of[0][l], of[1][l], of[2][l])
}

impl Sums {
    /// Adds what the agents themselves bring, where they were not among the candidates.
    #[inline(always)]
    pub fn add_oneself(&mut self, me: &Group) {
        for l in 0..LANES {
            for a in 0..3 {
                self.velocity[a][l] += me.v[a][l];
            }
            self.aligned[l] += 1.0;
            self.drawn[l] += 1.0;
        }
    }
}

/// The group as candidates of a run see it: moved by what would bring them into place.
#[inline(always)]
fn seen_from(me: &Group, shift: [f32; 3]) -> [Lanes; 3] {
    let mut x = me.x;
    for a in 0..3 {
        for l in 0..LANES {
            x[a][l] -= shift[a];
        }
    }
    x
}

/// `d` from each agent to a candidate, and its square.
#[inline(always)]
fn apart(x: &[Lanes; 3], candidate: &Record) -> ([Lanes; 3], Lanes) {
    let (mut d, mut r_sq) = ([[0.0; LANES]; 3], [0.0; LANES]);
    for l in 0..LANES {
        for a in 0..3 {
            d[a][l] = candidate.x[a] - x[a][l];
        }
        r_sq[l] = d[0][l] * d[0][l] + d[1][l] * d[1][l] + d[2][l] * d[2][l];
    }
    (d, r_sq)
}

/// Which agents have the candidate in view.
#[inline(always)]
fn in_view(v: &[Lanes; 3], d: &[Lanes; 3], r_sq: &Lanes, bound: f32) -> Lanes {
    let mut seen = [0.0; LANES];
    for l in 0..LANES {
        let speed_sq = v[0][l] * v[0][l] + v[1][l] * v[1][l] + v[2][l] * v[2][l];
        let along = d[0][l] * v[0][l] + d[1][l] * v[1][l] + d[2][l] * v[2][l];
        seen[l] = flock::in_view(along, r_sq[l], speed_sq, bound);
    }
    seen
}

/// Adds `weight` times a vector, lane by lane.
#[inline(always)]
fn add(to: &mut [Lanes; 3], weight: &Lanes, vector: &[Lanes; 3]) {
    for a in 0..3 {
        for l in 0..LANES {
            to[a][l] += weight[l] * vector[a][l];
        }
    }
}

/// Adds a vector where the weight is 1, not 0: the products are exact, so that fused or not it is the same number.
#[inline(always)]
fn add_those<S: Simd>(simd: S, to: &mut [Lanes; 3], weight: &Lanes, vector: &[Lanes; 3]) {
    let weight = f32x16::load_array_ref(simd, weight);
    for a in 0..3 {
        let sum = f32x16::load_array_ref(simd, &to[a]);
        weight.mul_add(f32x16::load_array_ref(simd, &vector[a]), sum).store_array(&mut to[a]);
    }
}

/// The velocity of a candidate in all lanes.
#[inline(always)]
fn velocity_of(candidate: &Record) -> [Lanes; 3] {
    [[candidate.v[0]; LANES], [candidate.v[1]; LANES], [candidate.v[2]; LANES]]
}

/// Adds those of a run that agents school with. `unbounded`: they are topological neighbours, whatever their distance.
#[inline(always)]
pub fn school<S: Simd>(simd: S, me: &Group, rule: &FlockConstants, run: Run, unbounded: bool, sums: &mut Sums) {
    match rule.model {
        FlockModel::Reynolds => reynolds(simd, me, rule, run, unbounded, sums),
        FlockModel::Couzin => couzin(me, rule, run, unbounded, sums),
        FlockModel::Vicsek => vicsek(simd, me, rule, run, unbounded, sums),
    }
}

/// Square of a radius; of topological neighbours none is too far.
#[inline(always)]
fn square(radius: f32, unbounded: bool) -> f32 {
    if unbounded { 1e30 } else { radius * radius }
}

/// E22. Compiled for each combination of what most flocks are spared: a second radius, and a field of view.
#[inline(always)]
fn reynolds<S: Simd>(simd: S, me: &Group, rule: &FlockConstants, run: Run, unbounded: bool, sums: &mut Sums) {
    let alike = unbounded || rule.alignment_radius == rule.cohesion_radius;
    match (alike, rule.view) {
        (true, None) => reynolds_of::<S, true, true>(simd, me, rule, run, unbounded, sums),
        (true, Some(_)) => reynolds_of::<S, true, false>(simd, me, rule, run, unbounded, sums),
        (false, None) => reynolds_of::<S, false, true>(simd, me, rule, run, unbounded, sums),
        (false, Some(_)) => reynolds_of::<S, false, false>(simd, me, rule, run, unbounded, sums),
    }
}

/// `ALIKE`: the radii of alignment and cohesion are the same. `ALL_AROUND`: agents see all around.
#[inline(always)]
fn reynolds_of<S: Simd, const ALIKE: bool, const ALL_AROUND: bool>(
    simd: S,
    me: &Group,
    rule: &FlockConstants,
    run: Run,
    unbounded: bool,
    sums: &mut Sums,
) {
    let near_limit = f32x16::splat(simd, rule.separation_radius * rule.separation_radius);
    let align_sq = square(rule.alignment_radius, unbounded);
    let draw_sq = square(rule.cohesion_radius, unbounded);
    let x = seen_from(me, run.shift);
    let (mut velocity, mut place) = (sums.velocity, sums.place);
    let (mut count_aligned, mut count_drawn) = (sums.aligned, sums.drawn);
    for part in run.agents.chunks(u64::BITS as usize) {
        // near somebody, a bit a candidate: a branch for each would be foretold badly
        let mut near = 0u64;
        for (b, candidate) in part.iter().enumerate() {
            let (d, r_sq) = apart(&x, candidate);
            let (mut aligned, mut drawn) = ([0.0; LANES], [0.0; LANES]);
            for l in 0..LANES {
                aligned[l] = flock::within(r_sq[l], align_sq);
                drawn[l] = if ALIKE { aligned[l] } else { flock::within(r_sq[l], draw_sq) };
            }
            if !ALL_AROUND {
                let seen = in_view(&me.v, &d, &r_sq, rule.view.unwrap_or(-1.0));
                for l in 0..LANES {
                    aligned[l] *= seen[l];
                    drawn[l] *= seen[l];
                }
            }
            add_those(simd, &mut velocity, &aligned, &velocity_of(candidate));
            add_those(simd, &mut place, &drawn, &d);
            for l in 0..LANES {
                count_aligned[l] += aligned[l];
                if !ALIKE {
                    count_drawn[l] += drawn[l];
                }
            }
            near |= u64::from(f32x16::load_array_ref(simd, &r_sq).simd_lt(near_limit).any_true()) << b;
        }
        while near != 0 {
            separate::<ALL_AROUND>(&me.v, &x, rule, &part[near.trailing_zeros() as usize], &mut sums.repelled);
            near &= near - 1;
        }
    }
    (sums.velocity, sums.place, sums.aligned) = (velocity, place, count_aligned);
    sums.drawn = if ALIKE { count_aligned } else { count_drawn };
}

/// Pushes away from a candidate that is near some of the agents.
#[inline(always)]
fn separate<const ALL_AROUND: bool>(
    v: &[Lanes; 3],
    x: &[Lanes; 3],
    rule: &FlockConstants,
    candidate: &Record,
    repelled: &mut [Lanes; 3],
) {
    let near_sq = rule.separation_radius * rule.separation_radius;
    let (d, r_sq) = apart(x, candidate);
    let mut push = [1.0; LANES];
    if !ALL_AROUND {
        push = in_view(v, &d, &r_sq, rule.view.unwrap_or(-1.0));
    }
    for l in 0..LANES {
        push[l] *= -flock::separation(r_sq[l], rule.separation_radius) * flock::within(r_sq[l], near_sq);
    }
    add(repelled, &push, &d);
}

/// E23. Speeds are equal: velocities stand for directions.
#[inline(always)]
fn couzin(me: &Group, rule: &FlockConstants, run: Run, unbounded: bool, sums: &mut Sums) {
    let near_sq = rule.separation_radius * rule.separation_radius;
    let align_sq = square(rule.alignment_radius, false).max(near_sq);
    let draw_sq = square(rule.cohesion_radius, unbounded).max(align_sq);
    let x = seen_from(me, run.shift);
    for candidate in run.agents {
        let (d, r_sq) = apart(&x, candidate);
        let mut seen = [1.0; LANES];
        if let Some(bound) = rule.view {
            seen = in_view(&me.v, &d, &r_sq, bound);
        }
        let (mut repelled, mut aligned, mut drawn) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for l in 0..LANES {
            let inverse = 1.0 / r_sq[l].max(1e-30).sqrt();
            repelled[l] = -inverse * flock::within(r_sq[l], near_sq);
            aligned[l] = seen[l] * flock::between(r_sq[l], near_sq, align_sq) / rule.limits.speed;
            drawn[l] = inverse * seen[l] * flock::between(r_sq[l], align_sq, draw_sq);
        }
        add(&mut sums.repelled, &repelled, &d);
        add(&mut sums.velocity, &aligned, &velocity_of(candidate));
        add(&mut sums.place, &drawn, &d);
    }
}

/// E24.
#[inline(always)]
fn vicsek<S: Simd>(simd: S, me: &Group, rule: &FlockConstants, run: Run, unbounded: bool, sums: &mut Sums) {
    let align_sq = square(rule.alignment_radius, unbounded);
    let x = seen_from(me, run.shift);
    for candidate in run.agents {
        let (d, r_sq) = apart(&x, candidate);
        let mut aligned = [1.0; LANES];
        if let Some(bound) = rule.view {
            aligned = in_view(&me.v, &d, &r_sq, bound);
        }
        for l in 0..LANES {
            aligned[l] *= flock::within(r_sq[l], align_sq);
        }
        add_those(simd, &mut sums.velocity, &aligned, &velocity_of(candidate));
    }
}

/// E26: adds `d / r^2` of those of a run that are in sight.
#[inline(always)]
pub fn sight(me: &Group, rule: &FlockConstants, run: Run, total: &mut [Lanes; 3]) {
    let sight_sq = rule.sight * rule.sight;
    let x = seen_from(me, run.shift);
    for candidate in run.agents {
        let (d, r_sq) = apart(&x, candidate);
        let mut weight = [1.0; LANES];
        if let Some(bound) = rule.view {
            weight = in_view(&me.v, &d, &r_sq, bound);
        }
        for l in 0..LANES {
            weight[l] *= flock::within(r_sq[l], sight_sq) * flock::nearness(r_sq[l]);
        }
        add(total, &weight, &d);
    }
}
