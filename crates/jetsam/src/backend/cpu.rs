//! The CPU: threads by rayon, wide instructions chosen at run time.
//!
//! Work is cut into chunks of fixed size whose results do not depend on who computes them, and sums over chunks
//! are made in their order: the same bits for any number of threads.

mod coarse;
mod contacts;
mod crew;
mod implicit;
mod parts;

use super::Backend;
use crate::flock::{Crowd, Surroundings};
use crate::integrate::sleep;
use crate::integrate::{Advance, bodies, joints, particles, sources};
use crate::interact::cells::{Cells, Grid};
use crate::interact::contacts::Surfaces;
use crate::interact::neighbours::{Around, NeighbourChunk, Places, with_scratch};
use crate::interact::slices::Slices;
use crate::interact::{CHUNK, boundary, density, forces, gradients, pressure};
use crate::ledger::Ledger;
use crate::model::Model;
use crate::scene::Pressure;
use crate::stage::Stage;
use crate::state::{Body, Kind, Record, State};
use fearless_simd::{Level, dispatch};
use glam::DVec3;
use implicit::Implicit;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// The CPU backend.
pub struct Cpu {
    level: Level,
    state: State,
    cells: [Cells; Kind::COUNT],
    /// Neighbours of fluids.
    slices: Vec<Slices>,
    /// Neighbours of rigid and static bodies' particles; the first is empty.
    neighbours: [Vec<NeighbourChunk>; Kind::COUNT],
    /// The other half of the double buffers of `cells`.
    spare: Spare,
    places: Places,
    /// Where the particle of each rigid or static slot stands.
    place: Vec<AtomicU32>,
    share: Vec<f32>,
    /// Velocities that bodies' particles show to viscosity (m/s), all particles; empty where they show their own.
    mirror: Vec<[f32; 4]>,
    /// Summed densities where they are integrated; else empty.
    summed: Vec<f32>,
    parts: Vec<bodies::Part>,
    contacts: contacts::Contacts,
    particle_mass: Vec<f32>,
    /// Which bodies sleep, and which were touched by what moves.
    asleep: Vec<bool>,
    stirred: Vec<AtomicBool>,
    sums: Vec<Ledger>,
    ledger: Ledger,
    static_copies: u32,
    next_id: u32,
    /// Force that holds fluid inside hoses to their speed (N).
    held: DVec3,
    crowd: Crowd,
    /// Radius of each body about its centre of mass (m).
    body_radius: Vec<f32>,
    implicit: Implicit,
    /// Force from outside (N) on fluids and on bodies at the last evaluation, for the ledger of implicit solvers.
    outside_fluids: DVec3,
    outside_bodies: DVec3,
}

/// Arrays that `cells` writes while it reads their twins.
#[derive(Default)]
struct Spare {
    record: Vec<Record>,
    id: Vec<u32>,
    owner: Vec<u32>,
    density: Vec<f32>,
    rate: Vec<[f32; 2]>,
    born: Vec<f32>,
}

impl Default for Cpu {
    fn default() -> Self {
        Self {
            level: Level::new(),
            state: State::default(),
            cells: Default::default(),
            slices: Vec::new(),
            neighbours: Default::default(),
            spare: Spare::default(),
            places: Places::default(),
            place: Vec::new(),
            share: Vec::new(),
            mirror: Vec::new(),
            summed: Vec::new(),
            parts: Vec::new(),
            contacts: Default::default(),
            particle_mass: Vec::new(),
            asleep: Vec::new(),
            stirred: Vec::new(),
            sums: Vec::new(),
            ledger: Ledger::default(),
            static_copies: 0,
            next_id: 0,
            held: DVec3::ZERO,
            crowd: Crowd::default(),
            body_radius: Vec::new(),
            implicit: Implicit::default(),
            outside_fluids: DVec3::ZERO,
            outside_bodies: DVec3::ZERO,
        }
    }
}

impl Backend for Cpu {
    fn name(&self) -> &'static str {
        "cpu"
    }

    fn upload(&mut self, _model: &Model, state: State) {
        let p = &state.particles;
        let ledger = self.ledger.counts();
        let spare = Spare {
            record: p.record.clone(),
            id: p.id.clone(),
            owner: p.owner.clone(),
            density: if p.rate.is_empty() { Vec::new() } else { p.density.clone() },
            rate: p.rate.clone(),
            born: p.born.clone(),
        };
        let bodies = &state.bodies;
        let mass = |b: &Body| (b.mass / b.slots.len().max(1) as f64) as f32;
        let far = |b: &Body| bodies.offset[b.slots.clone()].iter().map(|o| o.length()).fold(0.0, f64::max) as f32;
        *self = Self {
            spare,
            ledger,
            place: bodies.owner.iter().map(|_| AtomicU32::new(0)).collect(),
            places: Places::new(p.record.len()),
            share: vec![0.0; p.record.len()],
            parts: bodies::parts(&bodies.body),
            stirred: bodies.body.iter().map(|_| AtomicBool::new(false)).collect(),
            particle_mass: bodies.body.iter().map(mass).collect(),
            next_id: p.next_id(),
            body_radius: bodies.body.iter().map(far).collect(),
            implicit: Implicit::of(bodies.body.len()),
            contacts: self.contacts.anew(),
            state,
            ..Self::default()
        };
    }

    fn edit(&mut self, _model: &Model, change: &mut dyn FnMut(&mut State)) {
        change(&mut self.state);
        self.contacts.forget();
    }

    fn run(&mut self, stages: &[Stage], model: &Model, advance: Advance) -> Vec<Duration> {
        let p = &self.state.particles;
        let chunks = p.count.iter().map(|n| n.div_ceil(CHUNK)).sum();
        crew::together(chunks, || {
            let mut run = |stage: &Stage| {
                let start = Instant::now();
                self.work(*stage, model, advance);
                start.elapsed()
            };
            stages.iter().map(&mut run).collect()
        })
    }

    fn download(&self) -> &State {
        &self.state
    }

    fn ledger(&self) -> &Ledger {
        &self.ledger
    }
}

/// Place of a body's particle that is outside the domain.
const GONE: u32 = u32::MAX;

/// Chunks of an array over a range.
macro_rules! chunks_mut {
    ($array:expr, $range:expr) => {
        $array[$range].par_chunks_mut(CHUNK)
    };
}

impl Cpu {
    /// Runs a stage.
    fn work(&mut self, stage: Stage, model: &Model, advance: Advance) {
        let solver = model.solver.pressure;
        match stage {
            Stage::Drift if model.implicit() => self.glide(model, advance),
            Stage::Kick if model.implicit() => self.push(advance),
            Stage::Bodies if model.implicit() => self.end_step(model, advance),
            Stage::Divergence => self.solve_velocities(model, advance),
            Stage::Pressure if solver == Pressure::Dfsph => self.solve_places(model, advance),
            Stage::Pressure if solver == Pressure::Pbf => self.correct(model, advance),
            Stage::Drift => self.drift(model, advance),
            Stage::Sources => self.sources(model, advance),
            Stage::Cells => self.sort(model, advance),
            Stage::Density => self.density(model),
            Stage::Pressure => self.pressure(model),
            Stage::Boundary => self.boundary(model, advance),
            Stage::Gradients => self.gradients(model),
            Stage::Forces => {
                let part = Advance { dt: advance.part(), ..advance };
                self.forces(model, part);
                let held = sources::hold(&mut self.state.particles, model);
                self.held = held.force;
                if model.implicit() {
                    self.implicit.impulse += held.impulse;
                }
            }
            Stage::Agents => self.agents(model, advance),
            Stage::Bodies => self.bodies(model, advance, true),
            Stage::Kick => self.kick(model, advance),
            Stage::Ledger => self.tally(model, advance),
        }
    }

    fn drift(&mut self, model: &Model, advance: Advance) {
        let State { particles: p, bodies: b, .. } = &mut self.state;
        let fluid = p.segment(Kind::Fluid);
        let carry = &p.carry;
        chunks_mut!(p.record, fluid.clone()).zip(p.push[fluid].par_chunks(CHUNK)).enumerate().for_each(
            |(c, (records, push))| {
                let carry = carry.get(c * CHUNK..).unwrap_or(&[]);
                particles::drift(model.solver.integrator, advance, &model.grid, records, push, carry);
            },
        );
        if !p.rate.is_empty() {
            let n = p.count[Kind::Fluid as usize];
            chunks_mut!(p.density, ..n)
                .zip(chunks_mut!(p.rate, ..n))
                .zip(p.carry[..n].par_chunks(CHUNK))
                .for_each(|((density, rate), carry)| particles::predict(advance, density, rate, carry));
        }
        if advance.drag == 0.0 {
            bodies::advance(b, model, advance);
        }
    }

    /// Fluid is born and drained (E31). Where the fluid's segment has to grow, bodies' particles move up.
    fn sources(&mut self, model: &Model, advance: Advance) {
        self.ledger.crossed = DVec3::ZERO;
        if advance.drag > 0.0 {
            return;
        }
        let p = &mut self.state.particles;
        let (before, id) = (p.first, self.next_id);
        self.ledger.crossed += sources::bear(p, model, advance.time, advance.dt, &mut self.next_id);
        self.ledger.born += u64::from(self.next_id - id);
        if p.first != before {
            let total = p.record.len();
            self.spare.record.resize(total, Record::default());
            self.spare.id.resize(total, 0);
            self.spare.owner.resize(total, 0);
            self.spare.density.resize(p.density.len(), 1.0);
            self.spare.rate.resize(p.rate.len(), [0.0; 2]);
            self.spare.born.resize(p.born.len(), 0.0);
            self.places = Places::new(total);
            self.share.resize(total, 0.0);
            self.static_copies = 0;
            self.contacts.forget();
        }
        sources::drain(p, model, advance.time + advance.dt);
    }

    /// Sorts every kind. Fluids change places for good; particles of bodies are copied from their slots.
    fn sort(&mut self, model: &Model, advance: Advance) {
        if !model.fluids.is_empty() {
            self.sort_fluids(model);
        }
        self.sort_bodies(model, advance);
        // static particles stay where they are: once into each half of the double buffer
        if self.static_copies < 2 {
            self.copy_bodies(&model.grid, Kind::Static);
            self.cells[Kind::Static as usize].map(&model.grid);
            self.static_copies += 1;
        }
    }

    fn sort_fluids(&mut self, model: &Model) {
        let grid = &model.grid;
        let p = &mut self.state.particles;
        let from = &mut self.spare;
        let fluid = p.segment(Kind::Fluid);
        let cells = &mut self.cells[Kind::Fluid as usize];
        let living = cells.sort(grid, &p.record[fluid.clone()], Some(&p.id[fluid.clone()]));
        self.ledger.left += cells.left as u64;
        self.ledger.lost += cells.lost as u64;
        self.ledger.nonfinite += cells.nonfinite as u64;
        self.ledger.drained += cells.drained as u64;
        std::mem::swap(&mut p.record, &mut from.record);
        std::mem::swap(&mut p.id, &mut from.id);
        std::mem::swap(&mut p.owner, &mut from.owner);
        let n = fluid.len();
        let [x, y, z] = &mut self.places.x;
        chunks_mut!(p.record, ..n)
            .zip(chunks_mut!(p.push_before, ..n))
            .zip(chunks_mut!(p.id, ..n))
            .zip(chunks_mut!(p.owner, ..n))
            .zip(chunks_mut!(x, ..n).zip(chunks_mut!(y, ..n)).zip(chunks_mut!(z, ..n)))
            .zip(cells.order[..n].par_chunks(CHUNK))
            .for_each(|(((((record, push), id), owner), ((x, y), z)), order)| {
                for (k, place) in order.iter().enumerate() {
                    let place = place.load(Relaxed) as usize;
                    record[k] = from.record[place];
                    [x[k], y[k], z[k]] = record[k].x;
                    push[k] = p.push[place];
                    id[k] = from.id[place];
                    owner[k] = from.owner[place];
                }
            });
        for k in living..n {
            let momentum = model.fluids[p.owner[k] as usize].mass * glam::Vec3::from(p.record[k].v);
            if momentum.is_finite() {
                self.ledger.crossed -= momentum.as_dvec3();
            }
        }
        if !p.born.is_empty() {
            std::mem::swap(&mut p.born, &mut from.born);
            chunks_mut!(p.born, ..n).zip(cells.order[..n].par_chunks(CHUNK)).for_each(|(born, order)| {
                born.iter_mut().zip(order).for_each(|(b, place)| *b = from.born[place.load(Relaxed) as usize]);
            });
        }
        if !p.rate.is_empty() {
            std::mem::swap(&mut p.density, &mut from.density);
            std::mem::swap(&mut p.rate, &mut from.rate);
            chunks_mut!(p.density, ..n).zip(chunks_mut!(p.rate, ..n)).zip(cells.order[..n].par_chunks(CHUNK)).for_each(
                |((density, rate), order)| {
                    for (k, place) in order.iter().enumerate() {
                        let place = place.load(Relaxed) as usize;
                        density[k] = from.density[place];
                        rate[k] = from.rate[place];
                    }
                },
            );
        }
        p.count[Kind::Fluid as usize] = living;
        self.implicit.sort_places(&cells.order[..living]);
    }

    /// Sorts the slots of a kind of body and copies them to their places.
    fn copy_bodies(&mut self, grid: &Grid, kind: Kind) {
        let State { particles: p, bodies: b, .. } = &mut self.state;
        let slots = match kind {
            Kind::Rigid => 0..b.rigid_slots,
            _ => b.rigid_slots..b.record.len(),
        };
        let cells = &mut self.cells[kind as usize];
        let inside = cells.sort(grid, &b.record[slots.clone()], None);
        let range = p.segment(kind);
        let range = range.start..range.start + slots.len();
        p.count[kind as usize] = inside;
        let (order, place, base) = (&cells.order, &self.place, range.start);
        let Places { x: [x, y, z], volume } = &mut self.places;
        chunks_mut!(p.record, range.clone())
            .zip(chunks_mut!(p.id, range.clone()))
            .zip(chunks_mut!(p.owner, range.clone()))
            .zip(chunks_mut!(x, range.clone()).zip(chunks_mut!(y, range.clone())).zip(chunks_mut!(z, range.clone())))
            .zip(chunks_mut!(volume, range))
            .zip(order[..slots.len()].par_chunks(CHUNK))
            .enumerate()
            .for_each(|(c, (((((record, id), owner), ((x, y), z)), volume), order))| {
                for (k, from) in order.iter().enumerate() {
                    let slot = slots.start + from.load(Relaxed) as usize;
                    record[k] = b.record[slot];
                    [x[k], y[k], z[k]] = record[k].x;
                    volume[k] = record[k].volume;
                    id[k] = slot as u32;
                    owner[k] = b.owner[slot];
                    let at = c * CHUNK + k;
                    place[slot].store(if at < inside { (base + at) as u32 } else { GONE }, Relaxed);
                }
            });
    }

    fn density(&mut self, model: &Model) {
        let n = self.state.particles.count[Kind::Fluid as usize];
        let summed = model.integrates_density();
        let mut slices = std::mem::take(&mut self.slices);
        let mut density = std::mem::take(if summed { &mut self.summed } else { &mut self.state.particles.density });
        slices.resize_with(n.div_ceil(CHUNK), Slices::default);
        density.resize(n.max(density.len()), 1.0);
        let (around, level) = (self.around(model, false), self.level);
        slices.par_iter_mut().zip(chunks_mut!(density, ..n)).with_max_len(1).enumerate().for_each(|(c, (slices, density))| {
            let members = c * CHUNK..((c + 1) * CHUNK).min(n);
            with_scratch(|scratch| {
                dispatch!(level, simd => density::fluid_chunk(simd, scratch, model, around, members, slices, density));
            });
        });
        if model.remembers_lack() {
            let chunks = chunks_mut!(density, ..n).zip(chunks_mut!(self.state.particles.rate, ..n));
            chunks.for_each(|(density, memory)| density::remember(density, memory));
        }
        self.slices = slices;
        *(if summed { &mut self.summed } else { &mut self.state.particles.density }) = density;
        self.find_bodies(model);
    }

    /// What a search for neighbours reads: with `contacts` of bodies' particles among each other, or else of all for fluids.
    fn around<'a>(&'a self, model: &'a Model, contacts: bool) -> Around<'a> {
        let p = &self.state.particles;
        Around {
            grid: &model.grid,
            records: &p.record,
            places: &self.places,
            owner: &p.owner,
            cells: self.cells.each_ref(),
            first: p.first,
            asleep: &self.asleep,
            contacts,
            // what sleeps does not search
            once: contacts && !self.asleep.contains(&true),
            reach: if contacts { self.contacts.list_reach().faces } else { model.support } as f32,
        }
    }

    fn pressure(&mut self, model: &Model) {
        let p = &mut self.state.particles;
        let fluid = p.segment(Kind::Fluid);
        // where fluids bear tension, a density that lags behind pulls them back by itself
        if model.integrates_density() && !model.solver.negative_pressure {
            let summed = self.summed[fluid.clone()].par_chunks(CHUNK);
            chunks_mut!(p.density, fluid.clone()).zip(summed).for_each(|(d, s)| pressure::hold(d, s));
        }
        chunks_mut!(p.record, fluid.clone())
            .zip(p.density[fluid.clone()].par_chunks(CHUNK))
            .zip(p.owner[fluid].par_chunks(CHUNK))
            .for_each(|((records, density), owner)| pressure::chunk(model, records, density, owner));
    }

    fn boundary(&mut self, model: &Model, advance: Advance) {
        let State { particles: p, bodies: b, .. } = &mut self.state;
        let (level, gravity) = (self.level, model.gravity_at(advance.end()).as_vec3());
        if model.implicit() && !model.no_slip {
            return; // pairs see to pressures themselves
        }
        if model.no_slip {
            self.mirror.resize(p.record.len(), [0.0; 4]);
        }
        if model.fluids.is_empty() {
            return;
        }
        for kind in [Kind::Rigid, Kind::Static] {
            let segment = p.segment(kind);
            let (records, owner, first) = (&p.record, &p.owner, segment.start);
            let neighbours = &self.neighbours[kind as usize];
            let work = |c: usize, share: &mut [f32], chunk: &NeighbourChunk, mirror: &mut [[f32; 4]]| {
                if !chunk.found {
                    share.fill(0.0);
                    return mirror.fill([0.0; 4]);
                }
                dispatch!(level, simd => {
                    boundary::chunk(simd, model, records, owner, &b.body, gravity, first + c * CHUNK, chunk, share, mirror);
                });
            };
            let chunks = chunks_mut!(self.share, segment.clone()).zip(neighbours).with_max_len(1).enumerate();
            if model.no_slip {
                let mirror = chunks_mut!(self.mirror, segment.clone());
                chunks.zip(mirror).for_each(|((c, (share, chunk)), mirror)| work(c, share, chunk, mirror));
            } else {
                chunks.for_each(|(c, (share, chunk))| work(c, share, chunk, &mut []));
            }
            let records = p.record[segment.clone()].par_iter_mut().with_min_len(CHUNK);
            records.zip(&self.share[segment]).for_each(|(record, share)| record.share = *share);
        }
    }

    fn gradients(&mut self, model: &Model) {
        let p = &mut self.state.particles;
        if p.gradient.is_empty() {
            return;
        }
        let (records, owner, level) = (&p.record, &p.owner, self.level);
        let n = p.count[Kind::Fluid as usize];
        chunks_mut!(p.gradient, ..n).zip(chunks_mut!(p.vorticity, ..n)).zip(&self.slices).with_max_len(1).for_each(
            |((gradient, vorticity), slices)| {
                dispatch!(level, simd => {
                    gradients::chunk(simd, model, records, owner, slices, gradient, vorticity);
                });
            },
        );
    }

    /// Forces on fluids, then on bodies' particles.
    fn forces(&mut self, model: &Model, advance: Advance) {
        self.calm();
        let State { particles: p, .. } = &mut self.state;
        let surfaces = Surfaces { solid: &self.contacts.solid, stirred: &self.stirred };
        let input = forces::Input {
            model,
            records: &p.record,
            mirror: &self.mirror,
            gradient: &p.gradient,
            owner: &p.owner,
            first: 0,
            particle_mass: &self.particle_mass,
            surfaces,
            gravity: model.gravity_at(advance.end()).as_vec3(),
            dt: advance.dt as f32,
            fastest: self.ledger.speed as f32,
        };
        let level = self.level;
        let push = &mut p.push[..p.count[Kind::Fluid as usize]];
        // what nobody asks for is empty
        let (mut carry, mut vorticity) = (p.carry.chunks_mut(CHUNK), p.vorticity.chunks_mut(CHUNK));
        let out = push.chunks_mut(CHUNK).map(|push| forces::OnFluids {
            push,
            carry: carry.next().unwrap_or_default(),
            vorticity: vorticity.next().unwrap_or_default(),
        });
        let chunks = out.collect::<Vec<_>>().into_par_iter().zip(&self.slices).with_max_len(1).enumerate();
        chunks.for_each(|(c, (out, slices))| {
            let input = forces::Input { first: c * CHUNK, ..input };
            dispatch!(level, simd => forces::fluids(simd, input, slices, out));
        });
        for kind in [Kind::Rigid, Kind::Static] {
            self.push_slots(model, advance, kind, true);
        }
        if model.solver.pressure == Pressure::Pbf {
            self.look_at_bodies(model, advance.part()); // they were moved since they were sorted
        }
        self.touch(model, advance.dt);
    }

    fn agents(&mut self, model: &Model, advance: Advance) {
        let State { particles, bodies, agents } = &mut self.state;
        let cells = [&self.cells[0], &self.cells[1], &self.cells[2]];
        let world = Surroundings { model, particles, cells, bodies: &bodies.body, radius: &self.body_radius };
        self.crowd.run(self.level, &world, agents, advance);
        self.crowd.give_back(model, particles, &self.stirred);
        self.ledger.nonfinite += self.crowd.nonfinite as u64;
    }

    fn kick(&mut self, model: &Model, advance: Advance) {
        let State { particles: p, .. } = &mut self.state;
        let integrator = model.solver.integrator;
        let fluid = p.segment(Kind::Fluid);
        chunks_mut!(p.record, fluid.clone())
            .zip(p.push[fluid.clone()].par_chunks(CHUNK))
            .zip(p.push_before[fluid].par_chunks(CHUNK))
            .for_each(|((records, push), before)| {
                particles::kick(integrator, advance, records, push, before);
            });
        if !p.rate.is_empty() {
            let n = p.count[Kind::Fluid as usize];
            chunks_mut!(p.density, ..n)
                .zip(p.rate[..n].par_chunks(CHUNK))
                .zip(p.carry[..n].par_chunks(CHUNK))
                .for_each(|((density, rate), carry)| particles::correct(advance, density, rate, carry));
        }
        if advance.drag == 0.0 {
            self.kick_bodies(model, advance.dt);
        }
    }

    /// The second half of the kick, joints, and who falls asleep or wakes up.
    fn kick_bodies(&mut self, model: &Model, dt: f64) {
        let b = &mut self.state.bodies;
        let (integrator, sleeps) = (model.solver.integrator, sleep::possible(model));
        let kick = |body: &mut Body| bodies::kick(body, integrator, dt);
        let doze = |body: &mut Body, jointed: bool, stirred: &mut AtomicBool| {
            if sleeps {
                sleep::update(body, model, jointed, *stirred.get_mut(), dt);
            }
        };
        if model.joints.is_empty() {
            let all = b.body.par_iter_mut().zip(&mut self.stirred).with_min_len(64);
            return all.for_each(|(body, stirred)| {
                kick(body);
                doze(body, false, stirred);
            });
        }
        b.body.par_iter_mut().with_min_len(64).for_each(kick);
        joints::kick(b, model);
        for (body, (stirred, contact)) in b.body.iter_mut().zip(self.stirred.iter_mut().zip(&model.contacts)) {
            doze(body, contact.jointed, stirred);
        }
    }

    fn tally(&mut self, model: &Model, advance: Advance) {
        let gravity = model.gravity_at(advance.end());
        let State { particles: p, bodies: b, agents: a } = &self.state;
        let fluid = p.segment(Kind::Fluid);
        let n = fluid.len();
        self.sums.resize_with(n.div_ceil(CHUNK), Ledger::default);
        let slices = &self.slices;
        self.sums.par_iter_mut().with_max_len(1).enumerate().for_each(|(c, sum)| {
            let range = c * CHUNK..((c + 1) * CHUNK).min(n);
            *sum = Ledger::default();
            let part = Part {
                records: &p.record[range.clone()],
                push: &p.push[range.clone()],
                density: &p.density[range.clone()],
                owner: &p.owner[range.clone()],
                confined: p.vorticity.get(range).filter(|_| model.solver.vorticity > 0.0),
                slices: &slices[c],
                gravity,
            };
            part.tally(model, sum);
        });
        let mut total = Ledger {
            left: self.ledger.left,
            born: self.ledger.born,
            drained: self.ledger.drained,
            crossed: self.ledger.crossed,
            lost: self.ledger.lost,
            nonfinite: self.ledger.nonfinite,
            fast_contacts: self.ledger.fast_contacts,
            put_back: self.ledger.put_back,
            external_force: self.held + b.joint_force,
            external_impulse: if model.implicit() { self.implicit.impulse } else { b.joint_impulse }
                + self.crowd.impulse,
            pressure: self.implicit.pressure,
            divergence: self.implicit.divergence,
            fluid: n,
            rigid_lost: self.cells[Kind::Rigid as usize].lost.saturating_sub(self.scripted_outside(model)),
            ..Ledger::default()
        };
        let mut full = 0.0;
        for s in &self.sums {
            total.add(s);
            full += s.fluid as f64;
        }
        total.density_error_mean /= f64::max(full, 1.0);
        total.neighbours /= f64::max(n as f64, 1.0);
        total.pressed = (3.0 * total.pressed / f64::max(n as f64, 1.0)).powf(0.25);
        self.outside_fluids = total.external_force - b.joint_force;
        for (body, [added, _]) in b.body.iter().zip(&self.implicit.added) {
            if body.is_static() || body.one_way {
                self.outside_fluids -= body.force_fluid - *added;
            }
            // what bodies got by implicit pressure, fluids lost
            total.total_force -= *added;
            total.force_scale += added.length();
        }
        let of_bodies: Vec<Ledger> = b.body.par_chunks(CHUNK).map(|part| tally_bodies(model, part, gravity)).collect();
        of_bodies.iter().for_each(|s| total.add(s));
        for flock in &model.flocks {
            let Some(matter) = &flock.matter else { continue };
            let mass = f64::from(matter.mass);
            for (r, force) in a.record[flock.range()].iter().zip(&a.force[flock.range()]) {
                let (v, force) = (DVec3::from(r.v.map(f64::from)), DVec3::from(force.map(f64::from)));
                total.momentum += mass * v;
                total.momentum_scale += mass * v.length();
                total.total_force += force;
                total.force_scale += force.length();
                total.kinetic += 0.5 * mass * v.length_squared();
            }
        }
        total.external_force += self.fields_on_bodies(model);
        let speeds = b.record[..b.rigid_slots].par_iter().with_min_len(CHUNK);
        let fastest = speeds.map(|r| glam::Vec3::from(r.v).length_squared()).reduce(|| 0.0, f32::max);
        total.body_speed = f64::from(fastest.sqrt());
        total.speed = total.speed.max(total.body_speed);
        self.ledger = total;
    }

    /// What fields do to rigid bodies (N).
    fn fields_on_bodies(&self, model: &Model) -> DVec3 {
        let b = &self.state.bodies;
        if model.fields.is_empty() {
            return DVec3::ZERO;
        }
        let slots = b.record[..b.rigid_slots].iter().zip(&b.owner).filter(|(_, owner)| model.moves(**owner));
        let force = |(record, owner): (&Record, &u32)| {
            f64::from(self.particle_mass[*owner as usize]) * forces::fields(model, record).as_dvec3()
        };
        slots.map(force).sum()
    }

    /// Particles of scripted bodies that are now beyond a solid wall: they may.
    fn scripted_outside(&self, model: &Model) -> usize {
        if self.cells[Kind::Rigid as usize].lost == 0 {
            return 0;
        }
        let b = &self.state.bodies;
        let outside = |slot: &usize| self.place[*slot].load(Relaxed) == GONE;
        (0..b.rigid_slots).filter(|&slot| !model.moves(b.owner[slot])).filter(outside).count()
    }
}

/// What the ledger says of some bodies.
fn tally_bodies(model: &Model, bodies: &[Body], gravity: DVec3) -> Ledger {
    let mut total = Ledger::default();
    for body in bodies {
        if body.is_static() {
            total.external_force -= body.force;
            continue;
        }
        total.momentum += body.mass * body.v;
        total.momentum_scale += body.mass * body.v.length();
        total.external_force += body.mass * gravity;
        if body.one_way {
            total.external_force -= body.force_fluid;
        }
        total.total_force += body.force;
        total.kinetic += 0.5 * (body.mass * body.v.length_squared() + body.l.dot(body.omega));
        total.potential -= body.mass * model.gravity.dot(body.x - model.grid.min);
        total.force_scale += body.force.length();
        if !(body.x.is_finite() && body.v.is_finite() && body.l.is_finite()) {
            total.nonfinite += 1;
        }
    }
    total
}

/// What the ledger reads of one chunk.
struct Part<'a> {
    records: &'a [Record],
    push: &'a [[f32; 3]],
    density: &'a [f32],
    owner: &'a [u32],
    confined: Option<&'a [[f32; 3]]>,
    slices: &'a Slices,
    gravity: DVec3,
}

impl Part<'_> {
    /// Sums; `fluid` counts the particles with full support.
    fn tally(&self, model: &Model, sum: &mut Ledger) {
        let mut density_error = 0.0;
        for (k, r) in self.records.iter().enumerate() {
            let mass = f64::from(model.fluids[self.owner[k] as usize].mass);
            let v = DVec3::from(r.v.map(f64::from));
            let a = DVec3::from(self.push[k].map(f64::from));
            let speed = v.length();
            if model.implicit() {
                let share = f64::from(r.share / model.fluids[self.owner[k] as usize].density);
                sum.pressed += share * share;
            }
            sum.speed = sum.speed.max(speed);
            sum.acceleration = sum.acceleration.max(a.length());
            sum.momentum += mass * v;
            sum.momentum_scale += mass * speed;
            sum.total_force += mass * a;
            sum.force_scale += mass * a.length();
            let mut outside = self.gravity;
            if !model.fields.is_empty() {
                outside += forces::fields(model, r).as_dvec3();
            }
            if let Some(confined) = self.confined {
                outside += DVec3::from(confined[k].map(f64::from));
            }
            sum.external_force += mass * outside;
            sum.kinetic += 0.5 * mass * speed * speed;
            let x = DVec3::from(r.x.map(f64::from));
            sum.potential -= mass * model.gravity.dot(x - model.grid.min);
            let fluid = self.slices.count(k, Kind::Fluid) as f64 - 1.0;
            sum.neighbours += fluid;
            let all: usize = Kind::ALL.iter().map(|&kind| self.slices.count(k, kind)).sum();
            if all as f64 >= 0.8 * model.full_support {
                let error = f64::from((self.density[k] - 1.0).abs());
                density_error += error;
                sum.density_error_max = sum.density_error_max.max(error);
                sum.fluid += 1;
            }
        }
        sum.density_error_mean = density_error;
    }
}
