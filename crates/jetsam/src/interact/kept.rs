//! Lists of contacts, kept over steps (Verlet 1967).
//!
//! In: bodies, and their particles sorted into cells. Out: for each slot the slots of other bodies that may come within reach of
//! contacts before anything has moved by half the skin. Made by the backend after a sort, read by the stage `forces`.
//!
//! Lists name slots, in their order, so that they outlive sorts; those that come within reach are the same, and are
//! added in the same order, however old the lists are: results do not depend on it.

use super::CHUNK;
use super::cells::Grid;
use super::neighbours::NeighbourChunk;
use super::pairs::wrap;
use crate::model::Model;
use crate::scene::Surface;
use crate::state::{Bodies, Body, Kind};
use glam::{DQuat, DVec3, Vec3};
use rayon::prelude::*;
use std::ops::Range;

/// Where the list of a slot stands.
#[derive(Clone, Copy, Debug)]
struct Span {
    chunk: u32,
    begin: u32,
    count: u32,
}

impl Span {
    const NONE: Self = Self { chunk: 0, begin: 0, count: 0 };
    /// Of a particle that was outside the domain.
    const GONE: Self = Self { chunk: u32::MAX, begin: 0, count: 0 };
}

/// Where a body stood when lists were made.
#[derive(Clone, Copy, Debug)]
struct Pose {
    x: DVec3,
    q: DQuat,
    asleep: bool,
}

/// Set in a list for a pair of which one has a face: it is felt beside the normal, and so from farther off.
pub const FACED: u32 = 1 << 31;

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

/// The lists, and where bodies stood when they were made.
#[derive(Debug, Default)]
pub struct Kept {
    lists: Vec<List>,
    spans: Vec<Span>,
    /// Slots that have a list.
    busy: Vec<bool>,
    poses: Vec<Pose>,
    reach: Reach,
}

impl Kept {
    /// The slots that may touch a slot, some of them [`FACED`].
    #[inline(always)]
    pub fn of(&self, slot: usize) -> &[u32] {
        match self.spans[slot] {
            Span { count: 0, .. } => &[],
            Span { chunk, begin, count } => &self.lists[chunk as usize].slots[begin as usize..(begin + count) as usize],
        }
    }

    /// Whether a slot may touch any.
    #[inline(always)]
    pub fn busy(&self, slot: usize) -> bool {
        self.busy[slot]
    }

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
        let same = |slot: usize| grid.holds(bodies.record[slot].x) == (self.spans[slot].chunk != u32::MAX);
        (0..3).all(far) || body.slots.start >= bodies.rigid_slots || body.slots.clone().all(same)
    }

    /// Takes new lists out of what was found among sorted particles: chunk by chunk of rigid, then of static ones. `slot` is that of each
    /// particle, `segment` the particles of both kinds, `place` where the particle of a slot stands: its chunk among all, and its number there; none outside the domain.
    #[allow(clippy::too_many_arguments)] // one caller
    pub fn renew(
        &mut self,
        model: &Model,
        reach: Reach,
        bodies: &Bodies,
        found: [&[NeighbourChunk]; 2],
        slot: &[u32],
        segment: [Range<usize>; 2],
        place: impl Fn(usize) -> Option<(usize, usize)> + Sync,
    ) {
        self.lists.resize_with(found[0].len() + found[1].len(), List::default);
        let chunks = found[0].par_iter().chain(found[1]);
        let own = slot[segment[0].clone()].par_chunks(CHUNK).chain(slot[segment[1].clone()].par_chunks(CHUNK));
        self.lists.par_iter_mut().zip(own.zip(chunks)).for_each(|(list, (own, chunk))| {
            list.take(model, reach, bodies, own, chunk, slot);
        });
        let lists = &self.lists;
        let span = |slot: usize| match place(slot) {
            None => Span::GONE,
            Some((chunk, k)) => lists[chunk].span(chunk, k),
        };
        self.spans.resize(bodies.record.len(), Span::NONE);
        self.spans.par_iter_mut().with_min_len(4096).enumerate().for_each(|(slot, to)| *to = span(slot));
        self.busy.resize(bodies.record.len(), false);
        self.busy.par_iter_mut().zip(&self.spans).with_min_len(4096).for_each(|(busy, span)| *busy = span.count > 0);
        self.reach = reach;
        self.poses.clear();
        self.poses.extend(bodies.body.iter().map(|b| Pose { x: b.x, q: b.q, asleep: b.asleep }));
    }
}

/// The lists of a chunk of particles, one after another.
#[derive(Debug, Default)]
struct List {
    slots: Vec<u32>,
    /// Where the list of each particle begins, and where the last one ends.
    begin: Vec<u32>,
}

impl List {
    /// Takes over what was found and is within reach: slots instead of particles, in their order, but for pairs that pass through each
    /// other.
    fn take(
        &mut self,
        model: &Model,
        reach: Reach,
        bodies: &Bodies,
        own: &[u32],
        chunk: &NeighbourChunk,
        slot: &[u32],
    ) {
        self.slots.clear();
        self.begin.clear();
        let smooth = model.solver.surface == Surface::Smooth;
        let faced = |slot: u32| smooth && bodies.normal[slot as usize] != [0.0; 3];
        let x = |slot: u32| Vec3::from(bodies.record[slot as usize].x);
        let near = (reach.balls * reach.balls) as f32;
        for (&own, runs) in own.iter().zip(&chunk.runs) {
            let begin = self.slots.len();
            self.begin.push(begin as u32);
            let body = bodies.owner[own as usize];
            for kind in [Kind::Rigid, Kind::Static] {
                for &j in &chunk.list()[runs.exact(kind)] {
                    let other = slot[j as usize];
                    let faced = faced(own) || faced(other);
                    let within = faced || wrap(model, x(other) - x(own)).length_squared() < near;
                    if within && !model.apart(body, bodies.owner[other as usize]) {
                        self.slots.push(if faced { other | FACED } else { other });
                    }
                }
            }
            self.slots[begin..].sort_unstable_by_key(|slot| slot & !FACED);
        }
        self.begin.push(self.slots.len() as u32);
    }

    fn span(&self, chunk: usize, k: usize) -> Span {
        let (begin, end) = (self.begin[k], self.begin[k + 1]);
        Span { chunk: chunk as u32, begin, count: end - begin }
    }
}
