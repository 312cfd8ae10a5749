//! A world: constants, state and the step.

mod hand;

pub use hand::{Grip, Mismatch};

use crate::assemble::Assembly;
use crate::backend::{self, Backend, Batch, Choice, Cpu, Request};
use crate::error::Result;
use crate::flock::Order;
use crate::gpu::{Gpu, GpuError};
use crate::integrate::Advance;
use crate::ledger::Ledger;
use crate::mesh::Mesh;
use crate::model::{DtBound, Model, TRAVEL};
use crate::scene::Scene;
use crate::stage::Stage;
use crate::state::{Kind, Record, State};
use glam::DVec3;
use std::sync::Arc;
use std::time::Duration;

/// A world that runs.
pub struct World {
    model: Model,
    backend: Box<dyn Backend>,
    meshes: Vec<Option<(Arc<Mesh>, DVec3)>>,
    time: f64,
    steps: u64,
    dt_before: f64,
    timers: [Duration; Stage::COUNT],
    bound_by: Vec<(DtBound, u64)>,
    momentum: MomentumLedger,
    grip: Option<Grip>,
    solves: Solves,
}

/// How implicit pressure was found (E9), summed over steps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Solves {
    /// Rounds for places.
    pub pressure: u64,
    /// Sum of the residuals of places.
    pub pressure_residual: f64,
    /// Rounds for velocities (DFSPH).
    pub divergence: u64,
    /// Sum of the residuals of velocities.
    pub divergence_residual: f64,
}

/// What one step did.
#[derive(Clone, Copy, Debug)]
pub struct StepReport {
    /// Length of the step (s).
    pub dt: f64,
    /// What bounded it.
    pub bound: DtBound,
    /// What has gone wrong, if anything.
    pub trouble: Option<Trouble>,
}

/// What can go wrong inside a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Trouble {
    /// A position or velocity is not finite.
    #[error("values are not finite; try a smaller solver.courant, or more solver.artificial_viscosity")]
    NotFinite,
    /// The device does not work any more: [`World::fault`] says why.
    #[error("the device failed")]
    Device,
    /// The step has become so short that time stands still.
    #[error("the time step has collapsed; look for bodies that overlap, or raise solver.artificial_viscosity")]
    Stalled,
}

/// A step shorter than this fraction of the step at rest means that time stands still.
const STALLED: f64 = 1e-4;

/// Momentum against the impulse from outside (E12, C9): what is missing is the residual.
#[derive(Clone, Copy, Debug, Default)]
struct MomentumLedger {
    start: DVec3,
    impulse: DVec3,
    force: DVec3,
}

impl World {
    /// Builds the world of a scene on the CPU, lets it settle if the scene asks for it, and evaluates the forces
    /// at time zero.
    ///
    /// # Errors
    /// Whatever is wrong with the scene, with place and remedy.
    pub fn from_scene(scene: &Scene) -> Result<Self> {
        Ok(Self::new(scene.assemble()?))
    }

    /// Runs an assembled scene on the CPU.
    pub fn new(assembly: Assembly) -> Self {
        Self::on(Box::new(Cpu::default()), assembly)
    }

    /// Runs an assembled scene on the backend of a choice; says why not on a GPU, where the choice was open.
    ///
    /// # Errors
    /// A GPU was asked for, and there is none, or it cannot run the scene.
    pub fn choose(choice: Choice, assembly: Assembly) -> std::result::Result<(Self, Option<String>), GpuError> {
        Self::choose_with(choice, None, assembly)
    }

    /// The same on a device that pictures are drawn on too, where a device is chosen.
    ///
    /// # Errors
    /// As [`World::choose`].
    pub fn choose_with(
        choice: Choice,
        shared: Option<&Gpu>,
        assembly: Assembly,
    ) -> std::result::Result<(Self, Option<String>), GpuError> {
        let (backend, why) = backend::open(choice, &assembly.model, shared)?;
        let world = Self::on(backend, assembly);
        match world.fault() {
            None => Ok((world, why)),
            Some(fault) => Err(fault.clone()),
        }
    }

    pub(crate) fn on(mut backend: Box<dyn Backend>, assembly: Assembly) -> Self {
        let Assembly { model, state, meshes } = assembly;
        backend.upload(&model, state);
        let mut world = Self {
            model,
            backend,
            meshes,
            time: 0.0,
            steps: 0,
            dt_before: 0.0,
            timers: Default::default(),
            bound_by: Vec::new(),
            momentum: MomentumLedger::default(),
            grip: None,
            solves: Solves::default(),
        };
        world.evaluate();
        world.settle();
        world.begin_ledger();
        world.timers = Default::default();
        world
    }

    /// One step, no longer than `longest` (s).
    pub fn step(&mut self, longest: f64) -> StepReport {
        if let Some(report) = self.queue(longest, 1) {
            return report;
        }
        let (dt, bound) = self.next_dt(longest);
        self.hold(dt);
        let advance = Advance { time: self.time, dt, dt_before: self.dt_before, drag: 0.0, parts: self.parts(dt) };
        let stages = self.backend.run(self.order(), &self.model, advance);
        self.order().iter().zip(stages).for_each(|(stage, time)| self.timers[*stage as usize] += time);
        self.dt_before = dt;
        self.time += dt;
        self.steps += 1;
        let ledger = self.backend.ledger().clone();
        self.record(dt, bound, &ledger)
    }

    /// Steps to `until` (s) exactly: the rest of the way is cut into whole, equal steps, anew after each. Calls
    /// `each` after every step, which may end the advance by returning `false`.
    pub fn advance(&mut self, until: f64, mut each: impl FnMut(&Self, StepReport) -> bool) {
        while self.time < until {
            let left = until - self.time;
            let report = self.step(left);
            if (until - self.time).abs() <= 1e-9 * report.dt {
                self.time = until;
            }
            if !each(self, report) {
                break;
            }
        }
    }

    /// Steps to `until` (s) exactly, as [`World::advance`] does, but with nobody looking between the steps: what a GPU does
    /// without waiting.
    pub fn run_to(&mut self, until: f64) -> Option<Trouble> {
        while self.time < until {
            let left = until - self.time;
            let report = self.queue(left, usize::MAX).unwrap_or_else(|| self.step(left));
            if (until - self.time).abs() <= 1e-9 * report.dt {
                self.time = until;
            }
            if report.trouble.is_some() {
                return report.trouble;
            }
        }
        None
    }

    /// So many steps with nobody looking between them.
    pub fn run_steps(&mut self, count: u64) -> Option<Trouble> {
        let end = self.steps + count;
        while self.steps < end {
            let most = (end - self.steps) as usize;
            let report = self.queue(f64::INFINITY, most).unwrap_or_else(|| self.step(f64::INFINITY));
            if report.trouble.is_some() {
                return report.trouble;
            }
        }
        None
    }

    /// Steps that the backend makes by itself, at most so long (s) and so many; reports the last.
    fn queue(&mut self, longest: f64, most: usize) -> Option<StepReport> {
        let request = Request { time: self.time, left: longest, dt_before: self.dt_before, drag: 0.0, most };
        if self.grip.is_some() {
            return None; // the hand is felt step by step
        }
        let Batch { steps, stages } = self.backend.queue(&self.model, request)?;
        self.order().iter().zip(stages).for_each(|(stage, time)| self.timers[*stage as usize] += time);
        let end = self.time + longest;
        let mut last = None;
        for (dt, bound, ledger) in steps {
            self.dt_before = dt;
            self.time += dt;
            self.steps += 1;
            let report = self.record(dt, bound, &ledger);
            let worse = last.and_then(|l: StepReport| l.trouble);
            last = Some(StepReport { trouble: worse.or(report.trouble), ..report });
        }
        // single precision does not add up to the end to the last bit, but the backend knows that it is there
        if last.is_some_and(|l| l.bound == DtBound::Frame) {
            self.time = end;
        }
        last
    }

    /// Length of the next step and what bounds it (E29).
    fn next_dt(&self, longest: f64) -> (f64, DtBound) {
        let ledger = self.backend.ledger();
        let (mut dt, mut bound) = self.model.largest_dt(self.model.bounding_speed(ledger), ledger.acceleration);
        let travel = TRAVEL * self.model.contact_diameter / ledger.body_speed;
        if travel < dt && self.model.solver.dt.is_none() && !self.model.implicit() {
            (dt, bound) = (travel, DtBound::Travel);
        }
        let (longest, end) = self.next_end(longest);
        if dt >= longest {
            return (longest, end);
        }
        if longest == f64::INFINITY {
            return (dt, bound);
        }
        // whole steps: what is left is cut evenly, so that no sliver of a step remains, nor one more for a rounding error
        (longest / (longest / dt * (1.0 - 1e-9)).ceil(), bound)
    }

    /// Where a step has to end at the latest: at the end of what was asked, or where a flock decides.
    fn next_end(&self, longest: f64) -> (f64, DtBound) {
        if self.model.flocks.is_empty() {
            return (longest, DtBound::Frame);
        }
        let clocks = self.state().agents.clock.iter().zip(&self.model.flocks);
        let waits = clocks.filter(|(_, flock)| flock.tau > 0.0).map(|(clock, _)| clock.wait);
        match waits.fold(f64::INFINITY, f64::min) {
            wait if wait < longest => (wait, DtBound::Flock),
            _ => (longest, DtBound::Frame),
        }
    }

    /// The stages of a step, in their order.
    fn order(&self) -> &'static [Stage] {
        Stage::order(self.model.solver.pressure)
    }

    /// In how many parts bodies make a step of `dt`.
    fn parts(&self, dt: f64) -> u32 {
        if self.model.implicit() { self.model.substeps(dt, self.backend.ledger().body_speed) } else { 1 }
    }

    /// Runs the stages that evaluate forces.
    fn evaluate(&mut self) {
        let solver = self.model.solver.pressure;
        let stages: Vec<_> = self.order().iter().copied().filter(|s| s.evaluates(solver)).collect();
        self.backend.run(&stages, &self.model, Advance { time: self.time, ..Advance::default() });
    }

    /// Before time begins: fluids come to rest under drag while bodies stand still.
    fn settle(&mut self) {
        let end = self.model.solver.settle;
        if end == 0.0 || self.model.fluids.is_empty() {
            return;
        }
        // in parts of what is critical for the slowest sound wave between a floor and a surface, omega = pi c / (2 height): a tenth, so
        // that particles find their places; through the last two periods, or the second half, a half: by then sound is dead
        let height = (self.model.grid.max - self.model.grid.min).abs().max_element();
        let critical = std::f64::consts::PI * self.model.sound_speed / height;
        let last = f64::min(8.0 * std::f64::consts::PI / critical, 0.5 * end);
        let mut time = 0.0;
        while time < end {
            let (dt, _) = self.next_dt(end - time);
            let drag = critical * if end - time > last { 0.1 } else { 0.5 };
            let advance = Advance { time: 0.0, dt, dt_before: self.dt_before, drag, parts: 1 };
            self.backend.run(self.order(), &self.model, advance);
            self.dt_before = dt;
            time += dt;
        }
    }

    /// From now on the change of momentum is compared with the impulse from outside.
    fn begin_ledger(&mut self) {
        let ledger = self.backend.ledger();
        self.momentum = MomentumLedger { start: ledger.momentum, impulse: DVec3::ZERO, force: ledger.external_force };
    }

    fn record(&mut self, dt: f64, bound: DtBound, ledger: &Ledger) -> StepReport {
        match self.bound_by.iter_mut().find(|b| b.0 == bound) {
            Some((_, n)) => *n += 1,
            None => self.bound_by.push((bound, 1)),
        }
        if !self.model.implicit() {
            self.momentum.impulse += 0.5 * dt * (self.momentum.force + ledger.external_force);
        }
        self.momentum.impulse += ledger.crossed + ledger.external_impulse;
        self.momentum.force = ledger.external_force;
        self.solves.pressure += u64::from(ledger.pressure.iterations);
        self.solves.pressure_residual += ledger.pressure.residual;
        self.solves.divergence += u64::from(ledger.divergence.iterations);
        self.solves.divergence_residual += ledger.divergence.residual;
        let (at_rest, _) = self.model.largest_dt(0.0, 0.0);
        let trouble = if self.backend.fault().is_some() {
            Some(Trouble::Device)
        } else if ledger.nonfinite > 0 || !dt.is_finite() {
            Some(Trouble::NotFinite)
        } else if !matches!(bound, DtBound::Frame | DtBound::Flock) && dt < STALLED * at_rest {
            Some(Trouble::Stalled)
        } else {
            None
        };
        StepReport { dt, bound, trouble }
    }

    /// Constants.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The present state.
    pub fn state(&self) -> &State {
        self.backend.download()
    }

    /// The living particles of all fluids: place (m), velocity (m/s) and, between pairs, volume and pressure share.
    pub fn fluid(&self) -> impl Iterator<Item = &Record> {
        let particles = &self.state().particles;
        particles.record[particles.segment(Kind::Fluid)].iter()
    }

    /// How ordered the flock number `flock` is.
    pub fn flock_order(&self, flock: usize) -> Order {
        Order::of(&self.model, &self.state().agents, flock)
    }

    /// Mean number of others within the radius of an agent of the flock number `flock`; of topological neighbours their number.
    pub fn flock_neighbours(&self, flock: usize) -> f64 {
        crate::flock::neighbours(&self.model, &self.state().agents, flock)
    }

    /// What the last step left behind.
    pub fn ledger(&self) -> &Ledger {
        self.backend.ledger()
    }

    /// Name of the backend.
    pub fn backend(&self) -> &'static str {
        self.backend.name()
    }

    /// The particles where they are, when they are on a device that pictures can be drawn on.
    #[cfg(feature = "gpu")]
    pub fn on_device(&self) -> Option<backend::OnDevice> {
        self.backend.on_device()
    }

    /// Bodies and agents alone, where they come home faster than the whole state.
    pub fn movers(&self) -> Option<(Vec<crate::state::Body>, Vec<Record>)> {
        self.backend.movers()
    }

    /// Name of the device, where it is not the processor.
    pub fn device(&self) -> Option<String> {
        self.backend.device()
    }

    /// What went wrong with the device, if anything.
    pub fn fault(&self) -> Option<&GpuError> {
        self.backend.fault()
    }

    /// Mesh of each body that was given as one, and the centre of mass in its coordinates (m).
    pub fn meshes(&self) -> &[Option<(Arc<Mesh>, DVec3)>] {
        &self.meshes
    }

    /// Simulated time (s).
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Steps made.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Wall-clock time spent in each stage since the beginning.
    pub fn timers(&self) -> impl Iterator<Item = (Stage, Duration)> + '_ {
        self.order().iter().map(|&stage| (stage, self.timers[stage as usize]))
    }

    /// How implicit pressure was found so far.
    pub fn solves(&self) -> Solves {
        self.solves
    }

    /// What bounded the steps so far, and how often.
    pub fn bounds(&self) -> &[(DtBound, u64)] {
        &self.bound_by
    }

    /// What is missing between the change of momentum and the impulse from outside, as a fraction of the sum of
    /// the magnitudes of momenta (C9).
    pub fn momentum_residual(&self) -> f64 {
        let ledger = self.backend.ledger();
        let missing = ledger.momentum - self.momentum.start - self.momentum.impulse;
        if ledger.momentum_scale > 0.0 { missing.length() / ledger.momentum_scale } else { 0.0 }
    }
}
