//! What an agent does about what it perceives: E22-E26.
//!
//! In: sorted agents. Out: `next`, steering (m/s^2) of Reynolds' agents, the velocity to come of the others.

use super::model::FlockConstants;
use super::motion::turn;
use super::nearest::{Among, Near, nearest};
use super::obstacles;
use super::perception::{Around, around};
use super::stage::World;
use super::sums::{self, Group, Run, Sums, lane};
use crate::interact::cells::{Cells, Grid};
use crate::interact::lanes::LANES;
use crate::laws::flock;
use crate::random::uniform;
use crate::scene::{FlockModel, Relation, Wall};
use crate::state::{Clock, Kind, Record};
use fearless_simd::Simd;
use glam::Vec3;
use std::cell::RefCell;
use std::f64::consts::TAU;
use std::ops::Range;

/// What deciding reads.
#[derive(Clone, Copy)]
pub struct View<'a> {
    /// Fluids, bodies, constants.
    pub world: &'a World<'a>,
    /// Cells of agents.
    pub grid: &'a Grid,
    /// Sides of a cell (m), infinite where there is one layer.
    pub width: [f32; 3],
    /// Where they begin, flock by flock.
    pub cells: &'a [Cells],
    /// All agents.
    pub records: &'a [Record],
    /// Their ids.
    pub id: &'a [u32],
    /// The first agent of each flock, if any follows one.
    pub leaders: &'a [Record],
    /// Time of each flock.
    pub clock: &'a [Clock],
}

/// Scratch of a thread.
#[derive(Default)]
pub struct Scratch {
    runs: Vec<Around>,
    nearest: Vec<Near>,
    neighbours: Vec<Record>,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

/// Lends the thread's scratch to `work`; dispatch belongs inside (see [`crate::interact::neighbours::with_scratch`]).
pub fn with_scratch(work: impl FnOnce(&mut Scratch)) {
    let mut scratch = SCRATCH.take();
    work(&mut scratch);
    SCRATCH.set(scratch);
}

/// Random numbers: purpose of a stream.
const SWING: u64 = 0;
const AXIS: u64 = 2;
const WANDER: u64 = 5;

/// Decides for the agents `members` of flock `own`, sixteen of a row of cells at a time.
#[inline(always)]
pub fn chunk<S: Simd>(
    simd: S,
    scratch: &mut Scratch,
    view: View,
    own: usize,
    members: Range<usize>,
    next: &mut [[f32; 3]],
) {
    let rule = &view.world.model.flocks[own];
    let errands = has_errands(view, rule);
    let mut begin = members.start;
    while begin < members.end {
        let cell = view.grid.coordinates(view.records[begin].x);
        let row = view.cells[own].row(cell[0], view.grid.cells[0] - 1, cell[1], cell[2]);
        let group = begin..members.end.min(begin + LANES).min(rule.first + row.end);
        let me = Group::new(&view.records[group.clone()]);
        let sums = perceive(simd, scratch, view, own, &me, cell, group.clone());
        let next = &mut next[group.start - members.start..group.end - members.start];
        begin = group.end;
        match rule.model {
            FlockModel::Reynolds => steer(view, own, &me, group, &sums, errands, next),
            FlockModel::Couzin => {
                for (l, (i, next)) in group.zip(next).enumerate() {
                    *next = zones(view, rule, own, i, &sums, l).to_array();
                }
            }
            FlockModel::Vicsek => {
                for (l, (i, next)) in group.zip(next).enumerate() {
                    *next = noisy_mean(view, rule, own, i, &sums, l).to_array();
                }
            }
        }
    }
}

/// Whether agents look for those of flock `other` within a radius.
#[inline(always)]
fn looks_at(rule: &FlockConstants, other: usize) -> bool {
    match rule.relations[other] {
        Relation::School => rule.neighbours == 0,
        Relation::Flee | Relation::Chase => true,
        Relation::Ignore => false,
    }
}

/// How many cells away those of flock `other` can be that matter.
#[inline(always)]
fn far(view: View, rule: &FlockConstants, other: usize) -> [i32; 3] {
    let (reach, [x, y, z]) = (rule.reach(other), view.width);
    [(reach / x).ceil() as i32, (reach / y).ceil() as i32, (reach / z).ceil() as i32]
}

/// Sums over all that the agents `group` of flock `own` perceive, of whom the first is in `cell`.
#[inline(always)]
fn perceive<S: Simd>(
    simd: S,
    scratch: &mut Scratch,
    view: View,
    own: usize,
    me: &Group,
    cell: [i32; 3],
    group: Range<usize>,
) -> Sums {
    let flocks = &view.world.model.flocks;
    let rule = &flocks[own];
    let mut sums = Sums::default();
    let last = view.grid.coordinates(view.records[group.end - 1].x)[0];
    for j in (0..flocks.len()).filter(|&j| looks_at(rule, j)) {
        around(view.grid, &view.cells[j], flocks[j].first, cell, last, far(view, rule, j), &mut scratch.runs);
        for (range, shift) in &scratch.runs {
            let run = Run { agents: &view.records[range.clone()], shift: *shift };
            match rule.relations[j] {
                Relation::School => sums::school(simd, me, rule, run, false, &mut sums),
                Relation::Flee => sums::sight(me, rule, run, &mut sums.fled),
                Relation::Chase => sums::sight(me, rule, run, &mut sums.chased),
                Relation::Ignore => {}
            }
        }
    }
    if rule.neighbours > 0 {
        for (l, i) in group.enumerate() {
            pick_nearest(view, own, i, scratch);
            let run = Run { agents: &scratch.neighbours, shift: [0.0; 3] };
            sums::school(simd, &me.only(l), rule, run, true, &mut sums);
        }
        sums.add_oneself(me);
    }
    sums
}

/// The topological neighbours of agent `i` (E25), shifted into place.
fn pick_nearest(view: View, own: usize, i: usize, scratch: &mut Scratch) {
    let flocks = &view.world.model.flocks;
    let rule = &flocks[own];
    let schools = rule.relations.iter().zip(view.cells).zip(flocks);
    let among: Vec<(&Cells, usize)> =
        schools.filter(|((r, _), _)| **r == Relation::School).map(|((_, c), f)| (c, f.first)).collect();
    let among = Among { grid: view.grid, flocks: &among, records: view.records, id: view.id };
    nearest(among, i, rule.neighbours, rule.view, &mut scratch.nearest);
    scratch.neighbours.clear();
    scratch.neighbours.extend(scratch.nearest.iter().map(|n| {
        let r = view.records[n.index];
        Record { x: (Vec3::from(r.x) + Vec3::from(n.shift)).to_array(), ..r }
    }));
}

/// A vector of the laws as glam's.
macro_rules! vec3 {
    ($v:expr) => {{
        let v = $v;
        Vec3::new(v.x, v.y, v.z)
    }};
}

/// E22: steering (m/s^2) of the Reynolds agents `group`.
#[inline(always)]
fn steer(view: View, own: usize, me: &Group, group: Range<usize>, sums: &Sums, errands: bool, next: &mut [[f32; 3]]) {
    let rule = &view.world.model.flocks[own];
    let (w, u) = (&rule.weights, &rule.limits);
    let mut total = [[0.0; LANES]; 3];
    if errands {
        for (l, i) in group.enumerate() {
            [total[0][l], total[1][l], total[2][l]] = errand(view, own, i, sums, l).to_array();
        }
    }
    let plane = view.world.model.dimensions == 2;
    for l in 0..LANES {
        let v = [me.v[0][l], me.v[1][l], me.v[2][l]];
        let aligned = sums.aligned[l].max(1.0);
        // oneself is no place to be drawn to
        let drawn = (sums.drawn[l] - 1.0).max(1.0);
        let mean = [sums.velocity[0][l] / aligned, sums.velocity[1][l] / aligned, sums.velocity[2][l] / aligned];
        let place = [sums.place[0][l] / drawn, sums.place[1][l] / drawn, sums.place[2][l] / drawn];
        let align = flock::alignment(v, mean, w.alignment);
        let cohere = flock::cohere(place, w.cohesion);
        let cruise = flock::cruise(v, u.speed, w.cruise);
        let x = total[0][l] + w.separation * sums.repelled[0][l] + align.x + cohere.x + cruise.x;
        let y = total[1][l] + w.separation * sums.repelled[1][l] + align.y + cohere.y + cruise.y;
        let z = total[2][l] + w.separation * sums.repelled[2][l] + align.z + cohere.z + cruise.z;
        let a = flock::limited([x, if plane { 0.0 } else { y }, z], u.acceleration);
        (total[0][l], total[1][l], total[2][l]) = (a.x, a.y, a.z);
    }
    for (l, next) in next.iter_mut().enumerate() {
        *next = [total[0][l], total[1][l], total[2][l]];
    }
}

/// Whether Reynolds agents have more to do than to school.
fn has_errands(view: View, rule: &FlockConstants) -> bool {
    let w = &rule.weights;
    rule.goal.is_some()
        || rule.leader.is_some()
        || rule.keep_to_fluids
        || rule.flee_bodies
        || rule.flee_fluids
        || w.wander > 0.0
        || w.avoid > 0.0 && (view.world.has_bodies() || view.grid.period.contains(&0.0))
        || rule.relations.iter().any(|r| matches!(r, Relation::Flee | Relation::Chase))
}

/// E22, E26: steering of a Reynolds agent (m/s^2) that has nothing to do with those it schools with; `l` is its lane.
fn errand(view: View, own: usize, i: usize, sums: &Sums, l: usize) -> Vec3 {
    let rule = &view.world.model.flocks[own];
    let me = &view.records[i];
    let (w, v, u) = (&rule.weights, me.v, &rule.limits);
    let mut a = Vec3::ZERO;
    if let Some((goal, slow)) = rule.goal {
        let d = view.world.apart(me.x, goal.to_array());
        a += vec3!(flock::seek(v, d.to_array(), u.fastest, slow, w.seek));
    }
    if w.wander > 0.0 {
        a += w.wander * wander(view, rule, own, view.id[i]);
    }
    if let Some((leader, behind)) = rule.leader {
        a += follow(view, rule, leader, behind, me);
    }
    a += escape(view, rule, me, lane(&sums.fled, l));
    let chased = lane(&sums.chased, l);
    if chased != Vec3::ZERO {
        a += vec3!(flock::seek(v, chased.to_array(), u.fastest, 0.0, w.chase));
    }
    a += w.avoid * keep_in(view, rule, me);
    if rule.keep_to_fluids {
        a += w.avoid * obstacles::into_fluid(view.world, me.x);
    }
    if w.avoid > 0.0 && view.world.has_bodies() {
        a += w.avoid * obstacles::ahead(view.world, rule, me);
    }
    a
}

/// Fleeing from other flocks, bodies and fluids (m/s^2).
#[inline(always)]
fn escape(view: View, rule: &FlockConstants, me: &Record, fled: Vec3) -> Vec3 {
    let mut total = Vec3::ZERO;
    let mut from = |toward: Vec3, closeness: f32| {
        let away = -toward.normalize_or_zero();
        total += vec3!(flock::flee(me.v, away.to_array(), rule.limits.fastest, closeness, rule.weights.flee));
    };
    if fled != Vec3::ZERO {
        // 1 / r of the nearest is at most the size of the sum
        from(fled, flock::side(1.0 / fled.length(), rule.sight).max(0.1));
    }
    if rule.flee_bodies {
        for (body, radius) in view.world.rigid() {
            let d = view.world.apart(me.x, body.x.as_vec3().to_array());
            let gap = d.length() - radius;
            if gap < rule.sight {
                from(d, flock::side(gap.max(0.0), rule.sight));
            }
        }
    }
    if rule.flee_fluids {
        let (mut sum, mut nearest) = (Vec3::ZERO, f32::INFINITY);
        obstacles::each_near(view.world, Kind::Fluid, me.x, rule.sight, |_, d| {
            sum += d * flock::nearness(d.length_squared());
            nearest = nearest.min(d.length());
        });
        if sum != Vec3::ZERO {
            from(sum, flock::side(nearest, rule.sight));
        }
    }
    total
}

/// Leader following (Reynolds 1999): arrive behind the leader, and give way to it.
#[inline(always)]
fn follow(view: View, rule: &FlockConstants, leader: usize, behind: f32, me: &Record) -> Vec3 {
    let lead = &view.leaders[leader];
    let heading = Vec3::from(lead.v).normalize_or_zero();
    let d = view.world.apart(me.x, lead.x);
    if d == Vec3::ZERO {
        return Vec3::ZERO; // the leader itself
    }
    let (v, w) = (me.v, &rule.weights);
    let mut a = vec3!(flock::seek(v, (d - behind * heading).to_array(), rule.limits.fastest, behind, w.follow));
    let ahead = d + behind * heading;
    if ahead.length() < behind {
        let closeness = flock::side(ahead.length(), behind);
        let away = (-ahead).normalize_or_zero().to_array();
        a += vec3!(flock::flee(v, away, rule.limits.fastest, closeness, w.follow));
    }
    a
}

/// Away from the sides of the domain, 0 to 1 an axis.
#[inline(always)]
fn keep_in(view: View, rule: &FlockConstants, me: &Record) -> Vec3 {
    let grid = &view.world.model.grid;
    let mut total = Vec3::ZERO;
    for a in 0..3 {
        let margin = match grid.walls[a] {
            Wall::Solid => rule.margin[0],
            Wall::Open => rule.margin[1],
            Wall::Periodic => 0.0,
        };
        if margin > 0.0 && !(view.world.model.dimensions == 2 && a == 1) {
            let x = me.x[a];
            total[a] = flock::side(x - grid.min[a] as f32, margin) - flock::side(grid.max[a] as f32 - x, margin);
        }
    }
    total
}

/// Where an agent wanders: a random direction that changes smoothly, the same whoever asks and for any time step.
fn wander(view: View, rule: &FlockConstants, own: usize, id: u32) -> Vec3 {
    let t = view.clock[own].time / rule.weights.wander_time + uniform(rule.seed, WANDER, id.into());
    let (knot, part) = (t.floor(), t.fract() as f32);
    let blend = part * part * (3.0 - 2.0 * part);
    let at = |knot: f64| direction(rule, WANDER + 1, counter(id, knot as u64), view.world.model.dimensions);
    at(knot).lerp(at(knot + 1.0), blend)
}

/// Counter of agent and decision.
fn counter(id: u32, decision: u64) -> u64 {
    (decision << 32) | u64::from(id)
}

/// A random unit vector.
fn direction(rule: &FlockConstants, stream: u64, index: u64, dimensions: u32) -> Vec3 {
    unit_vector(uniform(rule.seed, stream, index), uniform(rule.seed, stream + 1, index), dimensions)
}

/// The unit vector of two numbers in [0, 1), even over the sphere (2D: the circle).
pub fn unit_vector(a: f64, b: f64, dimensions: u32) -> Vec3 {
    let (s, c) = (TAU * a).sin_cos();
    if dimensions == 2 {
        return Vec3::new(c as f32, 0.0, s as f32);
    }
    let z = 2.0 * b - 1.0;
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new((r * c) as f32, (r * s) as f32, z as f32)
}

/// A direction turned by an angle: in the plane, or about a random axis.
fn swung(view: View, rule: &FlockConstants, direction_of: Vec3, angle: f64, count: u64) -> Vec3 {
    let dimensions = view.world.model.dimensions;
    let axis = if dimensions == 2 {
        Vec3::new(-direction_of.z, 0.0, direction_of.x)
    } else {
        let random = direction(rule, AXIS, count, 3);
        (random - random.dot(direction_of) * direction_of).normalize_or_zero()
    };
    let (sine, cosine) = angle.sin_cos();
    vec3!(flock::swung(direction_of.to_array(), axis.to_array(), cosine as f32, sine as f32))
}

/// E23, for the agent of lane `l`.
fn zones(view: View, rule: &FlockConstants, own: usize, i: usize, sums: &Sums, l: usize) -> Vec3 {
    let heading = Vec3::from(view.records[i].v).normalize_or_zero();
    let [r, o, a] = [&sums.repelled, &sums.velocity, &sums.place].map(|v| lane(v, l).to_array());
    let mut wanted = vec3!(flock::couzin(r, o, a, heading.to_array()));
    if rule.noise > 0.0 {
        let count = counter(view.id[i], view.clock[own].decisions);
        // Box and Muller
        let size = (-2.0 * (1.0 - uniform(rule.seed, SWING, count)).ln()).sqrt();
        let angle = rule.noise * size * (TAU * uniform(rule.seed, SWING + 1, count)).cos();
        wanted = swung(view, rule, wanted, angle, count);
    }
    let (cosine, sine) = turn(rule.limits.turn * rule.tau);
    let new = vec3!(flock::turned(heading.to_array(), wanted.to_array(), cosine, sine));
    new.normalize_or_zero() * rule.limits.speed
}

/// E24, for the agent of lane `l`.
fn noisy_mean(view: View, rule: &FlockConstants, own: usize, i: usize, sums: &Sums, l: usize) -> Vec3 {
    let heading = Vec3::from(view.records[i].v).normalize_or_zero();
    let mean = lane(&sums.velocity, l).try_normalize().unwrap_or(heading);
    let count = counter(view.id[i], view.clock[own].decisions);
    let angle = rule.noise * (uniform(rule.seed, SWING, count) - 0.5);
    let wanted = swung(view, rule, mean, angle, count);
    let (cosine, sine) = turn(rule.limits.turn * rule.tau);
    let new = vec3!(flock::turned(heading.to_array(), wanted.to_array(), cosine, sine));
    new.normalize_or_zero() * rule.limits.speed
}
