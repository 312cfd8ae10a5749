//! The stage `agents`: agents move, are sorted, and decide.

use super::coupling::Coupling;
use super::decide::{self, View, with_scratch};
use super::model::FlockConstants;
use super::motion::{self, Part};
use super::perception::grid_about;
use crate::integrate::{Advance, bodies};
use crate::interact::CHUNK;
use crate::interact::cells::{Cells, Grid};
use crate::model::Model;
use crate::state::{Agents, Body, Kind, Particles, Record};
use fearless_simd::{Level, dispatch};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

/// What is around the agents.
#[derive(Clone, Copy)]
pub struct World<'a> {
    /// Constants.
    pub model: &'a Model,
    /// Fluids and bodies, sorted.
    pub particles: &'a Particles,
    /// Their cells.
    pub cells: [&'a Cells; Kind::COUNT],
    /// Bodies.
    pub bodies: &'a [Body],
    /// Radius of each body about its centre of mass (m).
    pub radius: &'a [f32],
}

impl<'a> World<'a> {
    /// Whether there is anything to run into.
    pub fn has_bodies(&self) -> bool {
        self.particles.count[Kind::Rigid as usize] + self.particles.count[Kind::Static as usize] > 0
    }

    /// Bodies that move, with their radii (m).
    pub fn rigid(&self) -> impl Iterator<Item = (&'a Body, f32)> {
        self.bodies.iter().zip(self.radius.iter().copied()).filter(|(b, _)| !b.is_static())
    }

    /// From one place to another by the shortest way on periodic axes (m).
    pub fn apart(&self, from: [f32; 3], to: [f32; 3]) -> Vec3 {
        let mut d = Vec3::from(to) - Vec3::from(from);
        for (a, &period) in self.model.grid.period.iter().enumerate() {
            if period > 0.0 {
                d[a] -= period * (d[a] / period).round();
            }
        }
        d
    }
}

/// Scratch of the stage; the agents themselves are in the state.
#[derive(Default)]
pub struct Crowd {
    cells: Vec<Cells>,
    inside: Vec<usize>,
    grid: Option<Grid>,
    coupling: Coupling,
    spare: Agents,
    /// Momentum that agents took by themselves in this step (kg m/s).
    pub impulse: DVec3,
    /// Agents whose position was not finite, at the last sort.
    pub nonfinite: usize,
}

/// A decision that is due in less than this fraction of `tau` is due now.
const SOON: f64 = 1e-6;

impl Crowd {
    /// The stage. A step of length 0 decides only, as a run begins with it.
    pub fn run(&mut self, level: Level, world: &World, agents: &mut Agents, advance: Advance) {
        let flocks = &world.model.flocks;
        self.impulse = DVec3::ZERO;
        if flocks.is_empty() {
            return;
        }
        if advance.drag > 0.0 {
            // while fluids settle nothing else moves
            self.coupling = Coupling::default();
            return agents.force.fill([0.0; 3]);
        }
        let first = bodies::first_kick(world.model.solver.integrator, advance.dt);
        if advance.dt > 0.0 {
            self.impulse = travel(level, world, agents, advance.dt, first);
        }
        self.coupling.feel(world, agents, advance.dt, first);
        let due: Vec<bool> = flocks.iter().zip(&agents.clock).map(|(f, c)| c.wait <= SOON * f.tau).collect();
        if due.contains(&true) {
            take_over(flocks, &due, agents);
            self.sort(world, agents);
            self.decide(level, world, agents, &due);
        }
    }

    /// Sorts every flock.
    fn sort(&mut self, world: &World, agents: &mut Agents) {
        let model = world.model;
        let grid = grid_about(&model.grid, &agents.record, model.dimensions, self.width(model, agents));
        self.cells.resize_with(model.flocks.len(), Cells::default);
        self.inside.clear();
        self.nonfinite = 0;
        let spare = &mut self.spare;
        spare.record.resize(agents.record.len(), Record::default());
        spare.id.resize(agents.id.len(), 0);
        spare.next.resize(agents.next.len(), [0.0; 3]);
        spare.rest.resize(agents.rest.len(), [0.0; 3]);
        spare.force.resize(agents.force.len(), [0.0; 3]);
        for (flock, cells) in model.flocks.iter().zip(&mut self.cells) {
            let range = flock.range();
            self.inside.push(cells.sort(&grid, &agents.record[range.clone()], Some(&agents.id[range.clone()])));
            self.nonfinite += cells.nonfinite;
            arrange(agents, spare, range, &cells.order[..flock.count]);
        }
        std::mem::swap(&mut spare.record, &mut agents.record);
        std::mem::swap(&mut spare.id, &mut agents.id);
        std::mem::swap(&mut spare.next, &mut agents.next);
        std::mem::swap(&mut spare.rest, &mut agents.rest);
        std::mem::swap(&mut spare.force, &mut agents.force);
        self.grid = Some(grid);
    }

    /// Adds what agents do to the particles around (E27, E28); bodies that are touched are `stirred`.
    pub fn give_back(&self, model: &Model, particles: &mut Particles, stirred: &[AtomicBool]) {
        self.coupling.give_back(model, particles, stirred);
    }

    /// Decides for the flocks that are due.
    fn decide(&mut self, level: Level, world: &World, agents: &mut Agents, due: &[bool]) {
        let flocks = &world.model.flocks;
        let led = flocks.iter().any(|f| f.leader.is_some());
        let leaders: Vec<Record> = flocks.iter().filter(|_| led).map(|f| first(f, agents)).collect();
        let Some(grid) = &self.grid else { return };
        let view = View {
            world,
            grid,
            width: sides(grid),
            cells: &self.cells,
            records: &agents.record,
            id: &agents.id,
            leaders: &leaders,
            clock: &agents.clock,
        };
        for (own, flock) in flocks.iter().enumerate().filter(|(own, _)| due[*own]) {
            let inside = flock.first..flock.first + self.inside[own];
            agents.next[inside.clone()].par_chunks_mut(CHUNK).with_max_len(1).enumerate().for_each(|(c, next)| {
                let begin = inside.start + c * CHUNK;
                let members = begin..begin + next.len();
                with_scratch(|scratch| {
                    dispatch!(level, simd => decide::chunk(simd, scratch, view, own, members, next));
                });
            });
        }
    }

    /// Sides of the cells (m): as far as those of the largest flock perceive each other, half of it along rows, which groups of sixteen share.
    /// For topological neighbours, two a cell.
    fn width(&self, model: &Model, agents: &Agents) -> [f64; 3] {
        let largest = model.flocks.iter().max_by_key(|f| f.count);
        let reach = largest.filter(|f| f.neighbours == 0).map_or(0.0, |f| 1.0001 * f64::from(f.radius));
        if reach > 0.0 && reach.is_finite() {
            return [0.5 * reach, reach, reach];
        }
        let mut extent = [f32::INFINITY, f32::NEG_INFINITY];
        for r in &agents.record {
            for a in 0..3 {
                extent = [extent[0].min(r.x[a]), extent[1].max(r.x[a])];
            }
        }
        let per_axis = (agents.record.len() as f64 / 2.0).powf(1.0 / f64::from(model.dimensions)).max(1.0);
        let width = f64::from(extent[1] - extent[0]) / per_axis;
        [if width.is_finite() && width > 0.0 { width } else { 1.0 }; 3]
    }
}

/// Sides of a cell (m), infinite where there is one layer.
fn sides(grid: &Grid) -> [f32; 3] {
    // a rounding error may put an agent into the next cell
    grid.inverse.map(|i| 0.99995 / i)
}

/// Puts the agents `range` into a new order, in one pass: `to` has arrays of the same lengths.
fn arrange(from: &Agents, to: &mut Agents, range: Range<usize>, order: &[AtomicU32]) {
    let first = range.start;
    let record = to.record[range.clone()].par_chunks_mut(CHUNK).zip(to.id[range.clone()].par_chunks_mut(CHUNK));
    let next = to.next[range.clone()].par_chunks_mut(CHUNK).zip(to.rest[range.clone()].par_chunks_mut(CHUNK));
    order.par_chunks(CHUNK).zip(record.zip(next)).for_each(|(order, ((record, id), (next, rest)))| {
        for (k, at) in order.iter().enumerate() {
            let at = first + at.load(Relaxed) as usize;
            (record[k], id[k], next[k], rest[k]) = (from.record[at], from.id[at], from.next[at], from.rest[at]);
        }
    });
    if !from.force.is_empty() {
        let force = to.force[range].par_chunks_mut(CHUNK).zip(order.par_chunks(CHUNK));
        force.for_each(|(to, order)| {
            to.iter_mut().zip(order).for_each(|(to, at)| *to = from.force[first + at.load(Relaxed) as usize]);
        });
    }
}

/// Moves all agents, after a kick of `first` (s) by what they met; returns the momentum that they took by themselves (kg m/s).
fn travel(level: Level, world: &World, agents: &mut Agents, dt: f64, first: f64) -> DVec3 {
    let mut impulse = DVec3::ZERO;
    let Agents { record, next, rest, force, clock, .. } = agents;
    for (flock, clock) in world.model.flocks.iter().zip(clock) {
        let range = flock.range();
        let forces = &force[if force.is_empty() { 0..0 } else { range.clone() }];
        let record = record[range.clone()].par_chunks_mut(CHUNK);
        let arrays = record.zip(next[range.clone()].par_chunks_mut(CHUNK)).zip(rest[range].par_chunks_mut(CHUNK));
        let moved = arrays.enumerate().map(|(c, ((record, next), rest))| {
            let force = forces.get(c * CHUNK..).unwrap_or(&[]);
            let part = Part { record, next, rest, force };
            dispatch!(level, simd => motion::chunk(simd, world, flock, dt, first, part))
        });
        if flock.matter.is_some() {
            // in the order of chunks
            impulse += moved.collect::<Vec<DVec3>>().into_iter().sum::<DVec3>();
        } else {
            moved.for_each(|_| {});
        }
        clock.time += dt;
        clock.wait -= dt;
    }
    impulse
}

/// The clocks of flocks that are due go on, and Vicsek's agents take over what they decided last (E24).
fn take_over(flocks: &[FlockConstants], due: &[bool], agents: &mut Agents) {
    for (own, flock) in flocks.iter().enumerate().filter(|(own, _)| due[*own]) {
        let clock = &mut agents.clock[own];
        let begun = clock.decisions > 0;
        clock.decisions += 1;
        clock.wait = flock.tau;
        if begun && flock.model == crate::scene::FlockModel::Vicsek {
            let range = flock.range();
            for (r, next) in agents.record[range.clone()].iter_mut().zip(&agents.next[range]) {
                r.v = *next;
            }
        }
    }
}

/// The agent of a flock with the lowest id.
fn first(flock: &FlockConstants, agents: &Agents) -> Record {
    let range = flock.range();
    let at = agents.id[range.clone()].iter().position(|&id| id as usize == flock.first);
    agents.record[range.start + at.unwrap_or(0)]
}
