//! Lists of contacts, kept over steps (Verlet 1967).
//!
//! In: bodies, and their particles sorted into cells. Out: the pairs of slots of different bodies that may come within reach of contacts
//! before anything has moved by half the skin ([`crate::state::Contacts`]), and which of them are between the same two bodies ([`Runs`]).
//! Made by the backend after a sort, read by the stages `forces` and `bodies`.
//!
//! Lists name slots, in their order, so that they outlive sorts; those that come within reach are the same, and are
//! added in the same order, however old the lists are: results do not depend on it.

use super::CHUNK;
use super::cells::Grid;
use super::lanes::Block;
use super::neighbours::NeighbourChunk;
use super::pairs::wrap;
use crate::model::Model;
use crate::scene::Surface;
use crate::state::{Bodies, Body, FACED, Kind, LIVE, Particles, Rows, SLOT};
use glam::{DQuat, DVec3, Vec3};
use rayon::prelude::*;

/// Where a body stood when lists were made.
#[derive(Clone, Copy, Debug)]
struct Pose {
    x: DVec3,
    q: DQuat,
    asleep: bool,
}

/// How near pairs matter (m).
#[derive(Clone, Copy, Debug, Default)]
pub struct Reach {
    /// Pairs of balls.
    pub balls: f64,
    /// Pairs of which one has a face.
    pub faces: f64,
}

impl Reach {
    /// How far apart particles may be that touch, or meet in half a step of `dt` (s) while nothing moves faster than `fastest` (m/s).
    pub fn new(model: &Model, fastest: f64, dt: f64) -> Self {
        let balls = model.contact_diameter + 1.01 * fastest * dt;
        // beside a face's normal a particle is felt as far as a spacing
        let smooth = model.solver.surface == Surface::Smooth;
        let faces = if smooth { balls.hypot(model.spacing) } else { balls };
        let most = model.contact_reach();
        Self { balls: (1.001 * balls).min(most), faces: (1.001 * faces).min(most) }
    }

    /// The same, farther by `skin` (m).
    pub fn and(self, skin: f64) -> Self {
        Self { balls: self.balls + skin, faces: self.faces + skin }
    }
}

/// Contacts of a chunk of slots, two bodies at a time: their sums are all that bodies feel of contacts.
#[derive(Debug, Default)]
pub struct Runs {
    /// Which run each pair of the chunk's rows is of.
    pub of: Vec<u32>,
    /// What each is: in the order of the first, then of the second body.
    pub run: Vec<Run>,
    /// What laws ask of the two bodies, beside the pair's own numbers.
    pub law: Vec<Block>,
    /// What contacts gave.
    pub sum: Vec<Sum>,
    /// Whether they gave anything.
    pub felt: bool,
}

/// Contacts of one body with another.
#[derive(Clone, Copy, Debug)]
pub struct Run {
    /// The bodies: whose rows they stand in, and the other.
    pub body: [u32; 2],
    /// Slots of one pair of particles.
    pub slot: [u32; 2],
    /// Which of the other's images across periodic axes they touch, when the lists were made.
    image: [i8; 3],
}

/// What the first body of a run feels of the second.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sum {
    /// Force (N), parts of contacts, torque about its centre of mass (N m), contacts that are deep, contacts.
    pub felt: [f64; 9],
    /// From its centre of mass to the second's (m).
    pub apart: DVec3,
}

/// What a body feels of contacts.
#[derive(Clone, Copy, Debug, Default)]
pub struct Felt {
    /// Force (N).
    pub force: DVec3,
    /// Torque about its centre of mass (N m).
    pub torque: DVec3,
    /// Contacts.
    pub contacts: u32,
    /// Their parts, summed: beside each other the particles of a face share one contact.
    pub sharers: f64,
    /// Contacts so deep that the particles would pass through.
    pub deep: u32,
}

/// A run as a body finds it.
#[derive(Clone, Copy, Debug)]
struct Link {
    chunk: u32,
    run: u32,
    second: bool,
}

/// The lists, and where bodies stood when they were made.
#[derive(Debug, Default)]
pub struct Kept {
    /// Chunk by chunk of rigid slots.
    pub runs: Vec<Runs>,
    /// Runs that each body is in, and where those of each begin.
    links: Vec<Link>,
    begin: Vec<u32>,
    /// The lists before.
    old: Vec<Rows>,
    /// Whether the particle of each slot was inside the domain.
    inside: Vec<bool>,
    /// Whether each slot has a face: constant.
    faced: Vec<bool>,
    poses: Vec<Pose>,
    reach: Reach,
}

impl Kept {
    /// How far particles of a body have moved at most since lists were made (m); infinitely far if it has woken up since, or passed the
    /// ends of the domain. `radius` is the body's about its centre of mass (m).
    pub fn moved(&self, bodies: &Bodies, number: usize, radius: f32, grid: &Grid) -> f64 {
        let (body, radius) = (&bodies.body[number], f64::from(radius));
        let Some(then) = self.poses.get(number) else { return f64::INFINITY };
        if then.asleep && !body.asleep || !self.as_before(bodies, body, radius, grid) {
            return f64::INFINITY;
        }
        let turned = (body.q * then.q.conjugate()).xyz().length(); // sine of half the angle
        grid.nearest(body.x - then.x).length() + 2.0 * radius * turned
    }

    /// Whether lists still hold all pairs within `reach`, when particles have moved so far at most (m).
    pub fn hold(&self, moved: f64, reach: Reach) -> bool {
        let left = f64::min(self.reach.balls - reach.balls, self.reach.faces - reach.faces);
        moved <= 0.49 * left // a little less than half: places are single precision
    }

    /// Whether the particles of a body are inside and outside the domain as they were.
    fn as_before(&self, bodies: &Bodies, body: &Body, radius: f64, grid: &Grid) -> bool {
        let far = |a: usize| {
            let ends = [f64::from(grid.lower[a]), f64::from(grid.upper[a])];
            grid.period[a] > 0.0 || (body.x[a] - radius > ends[0] && body.x[a] + radius < ends[1])
        };
        let same = |slot: usize| grid.holds(bodies.record[slot].x) == self.inside[slot];
        (0..3).all(far) || body.slots.start >= bodies.rigid_slots || body.slots.clone().all(same)
    }

    /// What body number `k` feels: run by run, in their order.
    pub fn felt(&self, k: usize) -> Felt {
        let mut felt = Felt::default();
        let Some(ends) = self.begin.get(k..k + 2) else { return felt };
        for link in &self.links[ends[0] as usize..ends[1] as usize] {
            let Sum { felt: [x, y, z, sharers, along_x, along_y, along_z, deep, contacts], apart } =
                self.runs[link.chunk as usize].sum[link.run as usize];
            let (force, torque) = (DVec3::new(x, y, z), DVec3::new(along_x, along_y, along_z));
            if link.second {
                felt.force -= force;
                felt.torque += apart.cross(force) - torque;
            } else {
                felt.force += force;
                felt.torque += torque;
            }
            felt.contacts += contacts as u32;
            felt.sharers += sharers;
            felt.deep += deep as u32;
        }
        felt
    }

    /// Takes new lists out of what was found among sorted rigid particles, chunk by chunk, slips with them. `place` tells where the
    /// particle of a rigid slot stands: its chunk, and its number there; none outside the domain.
    #[allow(clippy::too_many_arguments)] // one caller
    pub fn renew(
        &mut self,
        model: &Model,
        reach: Reach,
        bodies: &mut Bodies,
        particles: &Particles,
        found: &[NeighbourChunk],
        asleep: &[bool],
        place: impl Fn(usize) -> Option<(usize, usize)> + Sync,
    ) {
        if self.faced.len() != bodies.normal.len() {
            let smooth = model.solver.surface == Surface::Smooth;
            self.faced = bodies.normal.iter().map(|n| smooth && *n != [0.0; 3]).collect();
        }
        std::mem::swap(&mut self.old, &mut bodies.contacts.rows);
        let mut rows = std::mem::take(&mut bodies.contacts.rows);
        let chunks = bodies.rigid_slots.div_ceil(CHUNK);
        rows.resize_with(chunks, Rows::default);
        self.runs.resize_with(chunks, Runs::default);
        self.inside.resize(bodies.rigid_slots, false);
        let turned = self.old.iter().any(|rows| rows.turned);
        let (old, faced) = (&self.old[..], &self.faced[..]);
        let new = New { model, reach, bodies, particles, found, asleep, faced, old, turned };
        let each =
            rows.par_iter_mut().zip(&mut self.runs).zip(self.inside.par_chunks_mut(CHUNK)).with_max_len(1).enumerate();
        each.for_each(|(c, ((rows, runs), inside))| {
            new.rows(c * CHUNK, &place, rows, inside);
            new.runs(c * CHUNK, rows, runs);
        });
        bodies.contacts.rows = rows;
        self.link(bodies.body.len());
        self.reach = reach;
        self.poses.clear();
        self.poses.extend(bodies.body.iter().map(|b| Pose { x: b.x, q: b.q, asleep: b.asleep }));
    }

    /// Notes which runs each body is in, in their order.
    fn link(&mut self, bodies: usize) {
        self.begin.clear();
        self.begin.resize(bodies + 1, 0);
        let Self { runs, begin, links, .. } = self;
        for run in runs.iter().flat_map(|runs| &runs.run) {
            run.body.iter().for_each(|&body| begin[body as usize] += 1);
        }
        let mut sum = 0;
        for begin in begin.iter_mut() {
            sum += *begin;
            *begin = sum;
        }
        links.resize(sum as usize, Link { chunk: 0, run: 0, second: false });
        // from the last to the first
        for (c, runs) in runs.iter().enumerate().rev() {
            for (r, run) in runs.run.iter().enumerate().rev() {
                for second in [true, false] {
                    let to = &mut begin[run.body[usize::from(second)] as usize];
                    *to -= 1;
                    links[*to as usize] = Link { chunk: c as u32, run: r as u32, second };
                }
            }
        }
    }
}

/// From the centre of mass of the first body of a pair of slots to that of the second (m), across periodic axes the way the particles see
/// each other.
pub fn apart(model: &Model, bodies: &Bodies, slot: [u32; 2]) -> DVec3 {
    let [a, b] = slot.map(|slot| &bodies.body[bodies.owner[slot as usize] as usize]);
    let mut apart = b.x - a.x;
    if model.grid.period != [0.0; 3] {
        let [i, j] = slot.map(|slot| Vec3::from(bodies.record[slot as usize].x));
        let [arm_a, arm_b] = [(a, slot[0]), (b, slot[1])].map(|(body, slot)| body.q * bodies.offset[slot as usize]);
        let seen = arm_a + wrap(model, j - i).as_dvec3() - arm_b;
        for axis in 0..3 {
            let period = f64::from(model.grid.period[axis]);
            if period > 0.0 {
                apart[axis] += period * ((seen[axis] - apart[axis]) / period).round();
            }
        }
    }
    apart
}

/// What new lists are made of.
struct New<'a> {
    model: &'a Model,
    reach: Reach,
    bodies: &'a Bodies,
    particles: &'a Particles,
    found: &'a [NeighbourChunk],
    /// Which bodies sleep, and which slots have a face.
    asleep: &'a [bool],
    faced: &'a [bool],
    old: &'a [Rows],
    /// Whether old lists may hold pairs in the row of the higher slot.
    turned: bool,
}

impl New<'_> {
    fn asleep(&self, slot: u32) -> bool {
        self.asleep[self.bodies.owner[slot as usize] as usize]
    }

    /// The rows of a chunk of slots from `first` on.
    fn rows(
        &self,
        first: usize,
        place: impl Fn(usize) -> Option<(usize, usize)>,
        rows: &mut Rows,
        inside: &mut [bool],
    ) {
        let (model, b, p) = (self.model, self.bodies, self.particles);
        let periodic = model.grid.period != [0.0; 3];
        rows.clear();
        let near = (self.reach.balls * self.reach.balls) as f32;
        let mut row: Vec<u32> = Vec::new();
        for (k, inside) in inside.iter_mut().enumerate() {
            rows.begin.push(rows.with.len() as u32);
            let own = (first + k) as u32;
            let place = place(first + k);
            *inside = place.is_some();
            let Some((chunk, at)) = place else { continue };
            if self.asleep(own) {
                self.keep(own, rows);
                continue;
            }
            row.clear();
            let (body, x) = (b.owner[own as usize], Vec3::from(b.record[own as usize].x));
            let found = &self.found[chunk];
            for kind in [Kind::Rigid, Kind::Static] {
                for &j in &found.list()[found.runs[at].exact(kind)] {
                    let (other, theirs) = (p.id[j as usize], p.owner[j as usize]);
                    if other < own && !self.asleep[theirs as usize] {
                        continue; // it stands in the other's row
                    }
                    let faced = self.faced[own as usize] || self.faced[other as usize];
                    let mut d = Vec3::from(p.record[j as usize].x) - x;
                    if periodic {
                        d = wrap(model, d);
                    }
                    if (faced || d.length_squared() < near) && !model.apart(body, theirs) {
                        row.push(if faced { other | FACED } else { other });
                    }
                }
            }
            row.sort_unstable_by_key(|with| with & SLOT);
            for &with in &row {
                rows.turned |= with & SLOT < own;
                match self.slip(own, with & SLOT) {
                    Some(slip) => rows.push(with | LIVE, slip),
                    None => rows.push(with, [0.0; 3]),
                }
            }
        }
        rows.begin.push(rows.with.len() as u32);
    }

    /// What sleeps keeps what it knew of those that do not move either.
    fn keep(&self, own: u32, rows: &mut Rows) {
        let Some(old) = self.old.get(own as usize / CHUNK) else { return };
        for at in old.row(own as usize % CHUNK) {
            let other = old.with[at] & SLOT;
            if other as usize >= self.bodies.rigid_slots || self.asleep(other) {
                rows.push(old.with[at], old.slip[at]);
                rows.turned |= other < own;
            }
        }
    }

    /// The slip of a pair that was felt before.
    fn slip(&self, own: u32, other: u32) -> Option<[f32; 3]> {
        let seen = |own: u32, other: u32| {
            let old = self.old.get(own as usize / CHUNK)?;
            old.find(own as usize % CHUNK, other).map(|at| old.slip[at])
        };
        let theirs = || if self.turned || other < own { seen(other, own).map(|s| s.map(|x| -x)) } else { None };
        seen(own, other).or_else(theirs)
    }

    /// Tells which pairs of a chunk's rows are between the same bodies.
    fn runs(&self, first: usize, rows: &Rows, runs: &mut Runs) {
        let (b, periodic) = (self.bodies, self.model.grid.period != [0.0; 3]);
        runs.of.clear();
        runs.run.clear();
        let mut begin = 0; // of the runs of this body
        for k in 0..rows.begin.len() - 1 {
            let own = (first + k) as u32;
            let body = b.owner[own as usize];
            if runs.run.get(begin).is_some_and(|run| run.body[0] != body) {
                begin = runs.run.len();
            }
            for at in rows.row(k) {
                let other = rows.with[at] & SLOT;
                let pair = [body, b.owner[other as usize]];
                let image = if periodic { self.image([own, other]) } else { [0; 3] };
                let known = runs.run[begin..].iter().rposition(|run| run.body == pair && run.image == image);
                runs.of.push(known.map_or(runs.run.len(), |k| begin + k) as u32);
                if known.is_none() {
                    runs.run.push(Run { body: pair, slot: [own, other], image });
                }
            }
        }
        // in an order that does not depend on how far the lists reach
        let mut order: Vec<u32> = (0..runs.run.len() as u32).collect();
        let key = |run: &u32| (runs.run[*run as usize].body, runs.run[*run as usize].image);
        order.sort_unstable_by_key(key);
        let mut rank = vec![0; order.len()];
        order.iter().zip(0..).for_each(|(&run, k)| rank[run as usize] = k);
        runs.of.iter_mut().for_each(|run| *run = rank[*run as usize]);
        runs.run = order.iter().map(|&run| runs.run[run as usize]).collect();
        runs.law.resize(runs.run.len(), Block::default());
        runs.felt = false;
        runs.sum.clear();
        runs.sum.resize(runs.run.len(), Sum::default());
    }

    /// Which image of the second body the first one's particle sees.
    fn image(&self, slot: [u32; 2]) -> [i8; 3] {
        let [a, b] = slot.map(|slot| self.bodies.body[self.bodies.owner[slot as usize] as usize].x);
        let across = apart(self.model, self.bodies, slot) - (b - a);
        std::array::from_fn(|axis| match f64::from(self.model.grid.period[axis]) {
            period if period > 0.0 => (across[axis] / period).round() as i8,
            _ => 0,
        })
    }
}
