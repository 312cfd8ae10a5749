//! Implicit pressure on the CPU (E9): the rounds of DFSPH and PBF, and bodies that answer in each of them.
//!
//! Shares push fluids and bodies; a body's velocity follows within the round, so that light bodies and deep water agree
//! about where they go. What fluids gain bodies and walls lose, pair by pair.

use super::coarse::Level;
use super::{CHUNK, Cpu, GONE};
use crate::integrate::{Advance, bodies};
use crate::interact::cells::DRAINED;
use crate::interact::implicit::{self, EVERY, FIRST, OF_ONE_SIGN, Round, Said, Shares, TURNS, WORSE, WORTH};
use crate::interact::lanes::LANES;
use crate::interact::links::{self, Links, Nodes};
use crate::interact::neighbours::with_scratch;
use crate::laws::implicit::{begun, hold_more, recalled};
use crate::ledger::Solve;
use crate::model::Model;
use crate::scene::Wall;
use crate::state::{Body, Kind, Record, State};
use fearless_simd::dispatch;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// What the solvers keep between rounds, and from one step to the next.
#[derive(Default)]
pub(super) struct Implicit {
    pub(super) links: Vec<Links>,
    pub(super) nodes: Vec<Nodes>,
    pub(super) share: Vec<f32>,
    pub(super) hold: Vec<f32>,
    pub(super) before: Vec<f32>,
    /// Shares of PBF's turns before, whose pushes are in the places already; else 0.
    pub(super) base: Vec<f32>,
    /// What the shares of a round have left (compression), for the coarse level.
    pub(super) left: Vec<f32>,
    pub(super) coarse: Level,
    /// Shares (Pa) with which DFSPH corrected places at the last step, in the order of today.
    places: Vec<f32>,
    /// Accelerations, or velocities (m/s), of fluids and rigid bodies' particles.
    pub(super) flow: Vec<[f32; 4]>,
    error: Vec<f32>,
    rate: Vec<f32>,
    said: Vec<Said>,
    /// Forces on bodies' particles (N), from the first rigid one on.
    pub(super) force: Vec<[f32; 3]>,
    /// Force (N) and torque (N m) on each body by the shares of a round.
    thrust: Vec<[DVec3; 2]>,
    /// Force and torque by fluids on each body for which this step of bodies stands.
    pub(super) steady: Vec<[DVec3; 2]>,
    /// What is in the force and torque of each body besides what `forces` found.
    pub(super) added: Vec<[DVec3; 2]>,
    /// Impulses of this step from outside (N s).
    pub(super) impulse: DVec3,
    /// How the last solves went.
    pub(super) pressure: Solve,
    pub(super) divergence: Solve,
}

impl Implicit {
    /// Of a state with so many bodies, in which no step was made.
    pub(super) fn of(bodies: usize) -> Self {
        Self { added: vec![[DVec3::ZERO; 2]; bodies], ..Self::default() }
    }

    /// Shares that corrected places go with their particles when fluids change places: from where each comes.
    pub(super) fn sort_places(&mut self, order: &[AtomicU32]) {
        if !self.places.is_empty() {
            let old = std::mem::take(&mut self.places);
            let from = |place: &AtomicU32| old.get(place.load(Relaxed) as usize).copied().unwrap_or(0.0);
            self.places = order.par_iter().with_min_len(CHUNK).map(from).collect();
        }
    }
}

/// What one solve is about.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Aim {
    /// Velocities that do not compress.
    Velocities,
    /// Places where nothing is compressed when the drift is over.
    Places,
    /// Places now, and the velocities that lead there.
    Both,
}

impl Cpu {
    /// Whether fluids move bodies now: not while a scene settles.
    pub(super) fn movable(body: &Body, advance: Advance) -> bool {
        advance.drag == 0.0 && !body.is_static() && !body.asleep && !body.one_way
    }

    /// Links and nodes where particles are now.
    fn link(&mut self, model: &Model, gravity: DVec3) {
        let State { particles: p, bodies: b, .. } = &self.state;
        let n = p.count[Kind::Fluid as usize];
        let Implicit { links, nodes, .. } = &mut self.implicit;
        links.resize_with(n.div_ceil(CHUNK), Links::default);
        nodes.resize(n.div_ceil(LANES), Nodes::default());
        let gravity = gravity.as_vec3();
        let input = links::Input { model, records: &p.record, owner: &p.owner, bodies: &b.body, gravity };
        let level = self.level;
        let chunks = links.par_iter_mut().zip(nodes.par_chunks_mut(CHUNK / LANES)).zip(&self.slices);
        chunks.with_max_len(1).for_each(|((links, nodes), slices)| {
            with_scratch(|scratch| {
                let table = &mut scratch.places;
                dispatch!(level, simd => links::chunk(simd, table, input, slices, links, nodes));
            });
        });
    }

    /// Mean of what densities are above that of rest where particles have been moved to.
    fn compressed(&mut self, model: &Model) -> f64 {
        let (p, level) = (&mut self.state.particles, self.level);
        let n = p.count[Kind::Fluid as usize];
        let (records, density, lack) = (&p.record[..], &mut p.density[..n], &p.rate[..]);
        let links = self.slices.par_iter().zip(&self.implicit.links);
        let chunks = density.par_chunks_mut(CHUNK).zip(links).with_max_len(1).enumerate().map(
            |(c, (density, (slices, links)))| {
                with_scratch(|scratch| {
                    let table = &mut scratch.places;
                    dispatch!(level, simd => links::densities(simd, table, model, records, slices, links, density));
                });
                density.iter_mut().zip(lack.get(c * CHUNK..).unwrap_or_default()).for_each(|(d, lack)| *d += lack[0]);
                density.iter().map(|d| f64::from((d - 1.0).max(0.0))).sum()
            },
        );
        chunks.collect::<Vec<f64>>().iter().sum::<f64>() / n as f64
    }

    /// Accelerations by the present shares, of fluids and of the bodies that answer.
    fn accelerate(&mut self, model: &Model, advance: Advance, gravity: DVec3, aim: Aim) {
        self.push_fluids();
        if self.answers(model, aim) {
            self.press(model, Kind::Rigid, gravity);
            self.push_bodies(advance);
        } else {
            self.still_bodies();
        }
    }

    /// Whether there are bodies that answer in rounds.
    pub(super) fn answers(&self, model: &Model, aim: Aim) -> bool {
        let near = self.neighbours[Kind::Rigid as usize].iter().any(|c| c.found);
        aim != Aim::Places && near && links::bodies(model).contains(&Kind::Rigid)
    }

    /// Accelerations of fluids by the shares.
    pub(super) fn push_fluids(&mut self) {
        let Implicit { links, nodes, share, hold, flow, .. } = &mut self.implicit;
        let (share, hold, level) = (&share[..], &hold[..], self.level);
        let fluids = flow[..hold.len()].par_chunks_mut(CHUNK);
        let chunks = fluids.zip(nodes.par_chunks(CHUNK / LANES)).zip(links).enumerate();
        chunks.with_max_len(1).for_each(|(c, ((flow, nodes), links))| {
            with_scratch(|scratch| {
                let table = &mut scratch.places;
                dispatch!(level, simd => implicit::accelerate(simd, table, links, nodes, share, hold, c * CHUNK, flow));
            });
        });
    }

    /// Force and torque of the shares on every body of a kind.
    pub(super) fn press(&mut self, model: &Model, kind: Kind, gravity: DVec3) {
        let State { particles: p, bodies: b, .. } = &self.state;
        let Implicit { share, hold, force, thrust, .. } = &mut self.implicit;
        let (first, segment, level) = (p.first[Kind::Rigid as usize], p.segment(kind), self.level);
        let gravity = gravity.as_vec3();
        let input = links::Input { model, records: &p.record, owner: &p.owner, bodies: &b.body, gravity };
        let (share, hold) = (&share[..hold.len()], &hold[..]);
        let out = force[segment.start - first..segment.end - first].par_chunks_mut(CHUNK);
        out.zip(&self.neighbours[kind as usize]).with_max_len(1).enumerate().for_each(|(c, (force, chunk))| {
            if !chunk.found {
                return force.fill([0.0; 3]);
            }
            let at = segment.start + c * CHUNK;
            dispatch!(level, simd => links::press(simd, input, share, hold, at, chunk, force));
        });
        let (place, force) = (&self.place, &*force);
        let felt = |slot: usize| match place[slot].load(Relaxed) {
            GONE => None,
            at => Some(&force[at as usize - first]),
        };
        let slots = if kind == Kind::Rigid { 0..b.rigid_slots } else { b.rigid_slots..b.record.len() };
        bodies::thrust(b, &mut self.parts, slots, felt, model.dimensions, thrust);
    }

    /// Accelerations of bodies' particles by the thrusts of this round.
    fn push_bodies(&mut self, advance: Advance) {
        let Implicit { flow, thrust, .. } = &mut self.implicit;
        let (b, place) = (&self.state.bodies, &self.place);
        for (body, [force, torque]) in b.body.iter().zip(thrust).filter(|(body, _)| !body.is_static()) {
            let still = !Self::movable(body, advance) || (*force == DVec3::ZERO && *torque == DVec3::ZERO);
            let (a, alpha) = match still {
                true => (DVec3::ZERO, DVec3::ZERO),
                false => (*force / body.mass, body.inverse_inertia_at(body.q) * *torque),
            };
            for slot in body.slots.clone() {
                let at = place[slot].load(Relaxed);
                if at != GONE {
                    let u = if still { DVec3::ZERO } else { a + alpha.cross(body.q * b.offset[slot]) };
                    flow[at as usize] = u.as_vec3().extend(0.0).to_array();
                }
            }
        }
    }

    /// Velocities of bodies' particles (m/s) as the present forces but contacts will have made them when the step is over.
    fn flow_of_bodies(&mut self, advance: Advance) {
        let (b, place, flow, dt) = (&self.state.bodies, &self.place, &mut self.implicit.flow, advance.dt);
        for body in b.body.iter().filter(|body| body.slots.start < b.rigid_slots) {
            let (v, omega) = match Self::movable(body, advance) {
                true => {
                    let v = body.v + dt / body.mass * (body.force - body.force_contact);
                    let l = body.l + dt * (body.torque - body.torque_contact);
                    (v, body.inverse_inertia_at(body.q) * l)
                }
                false if advance.drag == 0.0 => (body.v, body.omega),
                false => (DVec3::ZERO, DVec3::ZERO),
            };
            for slot in body.slots.clone() {
                let at = place[slot].load(Relaxed);
                if at != GONE {
                    flow[at as usize] = (v + omega.cross(body.q * b.offset[slot])).as_vec3().extend(0.0).to_array();
                }
            }
        }
    }

    /// Bodies' particles stand still, or their accelerations do not count.
    fn still_bodies(&mut self) {
        let segment = self.state.particles.segment(Kind::Rigid);
        self.implicit.flow[segment].fill([0.0; 4]);
    }

    /// One round: the rates of what `flow` holds, and all shares relaxed by them.
    fn relax(&mut self, round: Round) -> Said {
        let level = self.level;
        let Implicit { links, nodes, flow, share, hold, before, left, base, error, rate, said, .. } =
            &mut self.implicit;
        said.resize(links.len(), Said::default());
        let flow = &flow[..];
        let shares = share.par_chunks_mut(CHUNK).zip(hold.par_chunks_mut(CHUNK));
        let shares = shares.zip(before.par_chunks_mut(CHUNK).zip(left.par_chunks_mut(CHUNK)));
        let read = nodes
            .par_chunks(CHUNK / LANES)
            .zip(error.par_chunks(CHUNK).zip(base.par_chunks(CHUNK)))
            .zip(links.par_iter());
        let all = said.par_iter_mut().zip(rate.par_chunks_mut(CHUNK)).zip(shares.zip(read)).enumerate();
        all.with_max_len(1).for_each(|(c, ((said, rate), (((share, hold), (before, left)), ((nodes, (error, base)), links))))| {
            with_scratch(|scratch| {
                let table = &mut scratch.places;
                dispatch!(level, simd => {
                    implicit::rates(simd, table, links, nodes, flow, c * CHUNK, rate);
                    *said = implicit::relax(simd, round, nodes, error, rate, Shares { share, hold, before, left, base });
                });
            });
        });
        said.iter().fold(Said::default(), |sum, s| Said {
            error: sum.error + s.error,
            against: sum.against + s.against,
            bias: sum.bias + s.bias,
        })
    }

    /// Makes room for arrays of all particles; shares begin where `warm` says.
    fn prepare(&mut self, model: &Model, warm: impl Fn(usize) -> f32 + Sync) {
        let p = &self.state.particles;
        let (n, total) = (p.count[Kind::Fluid as usize], p.record.len());
        let limit = model.hold_limit();
        let s = &mut self.implicit;
        s.share.resize(total, 0.0);
        s.share[n..].fill(0.0); // links name bodies' particles too
        s.hold.resize(n, 0.0);
        s.before.resize(n, 0.0);
        s.left.resize(n, 0.0);
        s.base.clear();
        s.base.resize(n, 0.0);
        s.error.resize(n, 0.0);
        s.rate.resize(n, 0.0);
        s.flow.resize(total, [0.0; 4]);
        s.force.resize(total - p.first[Kind::Rigid as usize], [0.0; 3]);
        s.thrust.clear();
        s.thrust.resize(self.state.bodies.body.len(), [DVec3::ZERO; 2]);
        s.added.resize(self.state.bodies.body.len(), [DVec3::ZERO; 2]);
        let all =
            s.share[..n].par_iter_mut().zip(s.hold.par_iter_mut()).zip(s.before.par_iter_mut()).with_min_len(CHUNK);
        all.enumerate().for_each(|(i, ((share, hold), before))| {
            *share = warm(i);
            *before = *share;
            *hold = crate::laws::implicit::hold(*share, limit);
        });
    }

    /// Stage `divergence` of DFSPH: shares by which velocities compress no longer what is dense already. They push bodies
    /// throughout the step.
    pub(super) fn solve_velocities(&mut self, model: &Model, advance: Advance) {
        let p = &self.state.particles;
        let warm: Vec<f32> = p.record[p.segment(Kind::Fluid)].par_iter().map(|r| r.share).collect();
        self.prepare(model, |i| warm[i]);
        let gravity = model.gravity_at(advance.end());
        self.link(model, gravity);
        // what all but fluids' pressures and contacts make of bodies
        self.flow_of_bodies(advance);
        self.implicit.divergence = self.solve(model, advance, Aim::Velocities, model.solver.iterations);
        if links::bodies(model).contains(&Kind::Static) {
            self.press(model, Kind::Static, gravity);
        }
        let (thrust, added) = (&self.implicit.thrust, &mut self.implicit.added);
        for ((body, thrust), added) in self.state.bodies.body.iter_mut().zip(thrust).zip(added) {
            *added = *thrust;
            body.force_fluid += thrust[0];
            body.torque_fluid += thrust[1];
            if !body.one_way {
                body.force += thrust[0];
                body.torque += thrust[1];
            }
            if body.is_static() || body.one_way {
                self.implicit.impulse -= advance.dt * thrust[0];
            }
        }
        let Implicit { hold, share, flow, .. } = &self.implicit;
        let records = self.state.particles.record[..hold.len()].par_iter_mut().with_min_len(CHUNK);
        records.zip(share).zip(flow).for_each(|((r, share), a)| {
            r.share = *share;
            (0..3).for_each(|c| r.v[c] += advance.dt as f32 * a[c]);
        });
    }

    /// Stage `pressure` of DFSPH: accelerations by which the drift leaves no density above that of rest. They move places alone:
    /// a velocity would stay, and heat the fluid.
    pub(super) fn solve_places(&mut self, model: &Model, advance: Advance) {
        let Implicit { places, nodes, hold, .. } = &self.implicit;
        let begun = |i: usize| {
            let before = places.get(i).copied().unwrap_or(0.0);
            begun(before, nodes[i / LANES].response[i % LANES], advance.dt as f32)
        };
        let warm: Vec<f32> = (0..hold.len()).into_par_iter().with_min_len(CHUNK).map(begun).collect();
        self.prepare(model, |i| warm[i]);
        self.implicit.pressure = self.solve(model, advance, Aim::Places, model.solver.iterations);
        let Implicit { places, share, hold, .. } = &mut self.implicit;
        places.clear();
        places.extend_from_slice(&share[..hold.len()]);
    }

    /// The particles of rigid bodies show the velocities that their slots have.
    fn copy_velocities(&mut self) {
        let State { particles: p, bodies: b, .. } = &mut self.state;
        for (slot, record) in b.record[..b.rigid_slots].iter().enumerate() {
            let at = self.place[slot].load(Relaxed);
            if at != GONE {
                p.record[at as usize] = Record { share: p.record[at as usize].share, ..*record };
            }
        }
    }

    /// Rounds until the mean error is small, at `most` so many; `flow` is then what the shares do, and `thrust` what they do to rigid bodies.
    fn solve(&mut self, model: &Model, advance: Advance, aim: Aim, most: f64) -> Solve {
        let gravity = model.gravity_at(advance.end());
        let (n, dt) = (self.implicit.hold.len(), advance.dt as f32);
        if n == 0 || dt == 0.0 {
            return Solve::default();
        }
        self.errors(dt, aim);
        let tolerance = match aim {
            Aim::Velocities => model.solver.divergence_tolerance,
            Aim::Places => model.tolerance(),
            // vectors are not the same when particles have moved: what they find then is to be small too
            Aim::Both => FIRST * model.tolerance(),
        };
        let unheld = if aim == Aim::Velocities { model.unheld() * advance.dt.powi(2) } else { f64::INFINITY };
        let scale = dt * dt;
        let limit = model.hold_limit();
        let compliance = if aim == Aim::Both { model.compliance() as f32 } else { 0.0 };
        let omega = model.factors.relaxation;
        let mut round = Round { omega, scale, compliance, number: 0.0, limit };
        let (mut said, mut best, mut smoothed) = (Solve::default(), f64::INFINITY, f64::INFINITY);
        let small = loop {
            self.accelerate(model, advance, gravity, aim);
            let Said { error, against, bias } = self.relax(round);
            round.number = if against > 0.0 { 0.0 } else { round.number + 1.0 };
            said.iterations += 1;
            said.residual = error / n as f64;
            if said.residual > WORSE * best {
                // a body too light, or places too odd, for steps so long
                (round.number, round.omega, best) = (0.0, 0.5 * round.omega, said.residual);
            }
            best = best.min(said.residual);
            let small = said.residual <= tolerance && bias.abs() <= n as f64 * unheld;
            if small || f64::from(said.iterations) >= most {
                break small;
            }
            let least = if unheld.is_finite() { n as f64 * unheld } else { OF_ONE_SIGN * error };
            let worth = said.residual < WORTH * smoothed && bias.abs() > least;
            if worth && said.iterations % EVERY == 1 && aim != Aim::Places && model.coarse() {
                (smoothed, round.number) = (said.residual, 0.0);
                self.smooth(model, advance, round, aim, said.residual);
            }
        };
        let Implicit { share, hold, before, base, error, rate, .. } = &mut self.implicit;
        let all = share.par_iter_mut().zip(hold).zip(before.par_iter().zip(base)).with_min_len(CHUNK);
        all.zip(error).zip(rate).for_each(|((((share, hold), (before, base)), error), rate)| {
            // where the shares that pushed are good enough they stay
            if small {
                *share = *before;
                *hold = hold_more(*base, *before, limit);
            }
            *error += scale * *rate;
        });
        if !small {
            self.accelerate(model, advance, gravity, aim);
        }
        said
    }

    /// What is wrong without the shares, in compression by the end of the step. For velocities `flow` holds those of bodies; places begin
    /// with what velocities have left.
    fn errors(&mut self, dt: f32, aim: Aim) {
        let (level, p) = (self.level, &self.state.particles);
        let Implicit { links, nodes, flow, error, rate, .. } = &mut self.implicit;
        let n = error.len();
        if aim == Aim::Velocities {
            let flow = flow[..n].par_iter_mut().with_min_len(CHUNK);
            flow.zip(&p.record).for_each(|(u, r)| *u = [r.v[0], r.v[1], r.v[2], 0.0]);
        }
        let flow = &flow[..];
        let read = nodes.par_chunks(CHUNK / LANES).zip(p.density[..n].par_chunks(CHUNK)).zip(links.par_iter());
        let all = error.par_chunks_mut(CHUNK).zip(rate.par_chunks_mut(CHUNK)).zip(read).with_max_len(1).enumerate();
        all.for_each(|(c, ((error, rate), ((nodes, density), links)))| {
            if aim == Aim::Velocities {
                with_scratch(|scratch| {
                    let table = &mut scratch.places;
                    dispatch!(level, simd => implicit::rates(simd, table, links, nodes, flow, c * CHUNK, rate));
                });
            }
            for ((error, rate), density) in error.iter_mut().zip(rate).zip(density) {
                *error = match aim {
                    Aim::Velocities => dt * *rate + (density - 1.0).min(0.0),
                    Aim::Places => *error + (density - 1.0).max(0.0),
                    Aim::Both => density - 1.0,
                };
                *rate = 0.0;
            }
        });
    }

    /// Stage `pressure` of PBF: particles moved until no density is above that of rest. Rounds are made for the vectors to neighbours
    /// as they are; once particles have moved these are found anew, and what is still wrong is corrected in turn.
    pub(super) fn correct(&mut self, model: &Model, advance: Advance) {
        let p = &self.state.particles;
        let n = p.count[Kind::Fluid as usize];
        let warm: Vec<f32> = p.record[..n].par_iter().map(|r| r.share).collect();
        let kept = recalled(advance.dt_before as f32, advance.dt as f32);
        self.prepare(model, |i| kept * warm[i]);
        let gravity = model.gravity_at(advance.end());
        let mut said = Solve::default();
        let mut total = vec![[DVec3::ZERO; 2]; self.state.bodies.body.len()];
        for turn in 0..=TURNS {
            if n == 0 || advance.dt == 0.0 {
                break;
            }
            if turn > 0 {
                said.residual = self.compressed(model);
                let budget = f64::from(said.iterations) >= model.solver.iterations;
                if said.residual <= model.tolerance() || budget || turn == TURNS {
                    break;
                }
                self.begin_again();
            }
            self.link(model, gravity);
            let left = model.solver.iterations - f64::from(said.iterations);
            said.iterations += self.solve(model, advance, Aim::Both, left).iterations;
            if links::bodies(model).contains(&Kind::Static) {
                self.press(model, Kind::Static, gravity);
            }
            self.shift(model, advance, &mut total);
        }
        self.ledger.put_back += self.keep_inside(model, DEEP);
        self.implicit.pressure = said;
        self.implicit.added = total;
        let Implicit { base, share, .. } = &self.implicit;
        let records = self.state.particles.record[..n].par_iter_mut().with_min_len(CHUNK);
        records.zip(base).zip(share).for_each(|((record, base), share)| record.share = base + share);
    }

    /// A turn of PBF after the first: its shares are what those so far are changed by.
    fn begin_again(&mut self) {
        let Implicit { base, share, hold, before, .. } = &mut self.implicit;
        let all = base.par_iter_mut().zip(share).zip(hold.par_iter_mut().zip(before)).with_min_len(CHUNK);
        all.for_each(|((base, share), (hold, before))| {
            *base += *share;
            (*share, *hold, *before) = (0.0, 0.0, 0.0);
        });
    }

    /// Moves particles by this round's accelerations, and bodies by its thrusts, which are added to `total`.
    fn shift(&mut self, model: &Model, advance: Advance, total: &mut [[DVec3; 2]]) {
        let dt = advance.dt;
        let flow = &self.implicit.flow[..self.implicit.hold.len()];
        let records = self.state.particles.record[..flow.len()].par_iter_mut().with_min_len(CHUNK);
        records.zip(flow).for_each(|(r, a)| {
            for c in 0..3 {
                r.v[c] += dt as f32 * a[c];
                r.x[c] += dt as f32 * (dt as f32 * a[c]);
            }
            model.grid.wrap(&mut r.x);
        });
        let mut moved = false;
        let bodies = self.state.bodies.body.iter_mut().zip(&self.implicit.thrust).zip(total);
        for ((body, [force, torque]), total) in bodies {
            *total = [total[0] + *force, total[1] + *torque];
            if body.is_static() || body.one_way {
                self.implicit.impulse -= dt * *force;
            }
            if Self::movable(body, advance) && (*force != DVec3::ZERO || *torque != DVec3::ZERO) {
                body.x += dt * dt / body.mass * *force;
                let turn = dt * dt * (body.inverse_inertia_at(body.q) * *torque);
                body.q = (glam::DQuat::from_scaled_axis(turn) * body.q).normalize();
                give(body, &[dt * *force, dt * *torque]); // its spin is that of where it is now
                moved = true;
            }
        }
        if moved {
            bodies::follow(&mut self.state.bodies, model);
            self.copy_velocities();
        }
    }
}

/// A fluid particle is kept from going deeper into a solid side of the domain than this many spacings: there the wall's own
/// particles stand.
pub(super) const DEEP: f64 = 0.5;
/// The same before PBF has had a say: what stands among a wall's particles it could not move well.
pub(super) const SHALLOW: f64 = 0.1;

impl Cpu {
    /// What a step has driven into solid sides of the domain deeper than so many spacings is put back, and loses its velocity into the wall;
    /// the impulse goes into the ledger. Pressure holds what comes at its own pace; this is for what is thrown. Says how many were put back.
    pub(super) fn keep_inside(&mut self, model: &Model, deep: f64) -> u64 {
        let p = &mut self.state.particles;
        let fluid = p.segment(Kind::Fluid);
        let (grid, deep) = (&model.grid, deep * model.spacing);
        let solid = |a: usize| grid.walls[a] == Wall::Solid && grid.period[a] == 0.0;
        let sides: Vec<_> = (0..3).filter(|&a| solid(a)).collect();
        let ends = |a: usize| ((grid.min[a] - deep) as f32, (grid.max[a] + deep) as f32);
        let chunks = p.record[fluid.clone()].par_chunks_mut(CHUNK).zip(p.owner[fluid].par_chunks(CHUNK));
        let put_back = chunks.map(|(records, owner)| {
            let (mut count, mut impulse) = (0, DVec3::ZERO);
            for (r, owner) in records.iter_mut().zip(owner) {
                for &a in &sides {
                    let (low, high) = ends(a);
                    if r.x[a] >= low && r.x[a] <= high || !r.x[a].is_finite() || r.x[0] == DRAINED {
                        continue;
                    }
                    let out = if r.x[a] < low { -1.0 } else { 1.0 };
                    r.x[a] = r.x[a].clamp(low, high);
                    count += 1;
                    if r.v[a] * out > 0.0 {
                        impulse[a] -= f64::from(model.fluids[*owner as usize].mass * r.v[a]);
                        r.v[a] = 0.0;
                    }
                }
            }
            (count, impulse)
        });
        put_back.collect::<Vec<(u64, DVec3)>>().into_iter().fold(0, |sum, (count, impulse)| {
            self.implicit.impulse += impulse;
            sum + count
        })
    }
}

/// An impulse (N s) and an angular one (N m s), in the midst of a step.
fn give(body: &mut Body, [impulse, angular]: &[DVec3; 2]) {
    body.v += *impulse / body.mass;
    body.v_half += *impulse / body.mass;
    body.l += *angular;
    body.l_half += *angular;
    body.omega = body.inverse_inertia_at(body.q) * body.l;
}
