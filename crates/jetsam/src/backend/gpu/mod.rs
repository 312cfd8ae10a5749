//! The GPU: every stage of the step as kernels in WGSL, the twins of the CPU's loops with the same laws.
//!
//! State stays on the device. Steps of a frame are queued without waiting: kernels choose their length, and what the ledger
//! found of each comes home when the frame is over. Only when someone asks for the state is it fetched.

mod kernels;
mod layout;
mod program;
mod queue;
mod transfer;

use super::{Backend, Batch, Request};
use crate::gpu::{Gpu, GpuError};
use crate::integrate::Advance;
use crate::integrate::sources::{self, Birth};
use crate::ledger::{Ledger, Solve};
use crate::model::{DtBound, Model};
use crate::stage::Stage;
use crate::state::{Body, Record, State};
use kernels::{Over, Times};
use layout::{Clock, GpuBody, Pose, Sizes, Sums, double};
use program::{BOUNDS, Kernelet, Program};
use queue::{Results, Timers};
use std::cell::RefCell;
use std::collections::{HashMap, VecDeque};
use std::mem::size_of;
use std::sync::OnceLock;
use std::time::{Duration, Instant};
use transfer::Buffers;

/// Most steps whose statistics are kept until they come home.
const LOGGED: usize = 512;
/// Most births that are listed at once.
const LISTED: usize = 1 << 16;
/// Steps in one submission: a display must not wait for long.
const SUBMITTED: usize = 8;
/// Solves of implicit pressure in a step at most.
const SOLVES: usize = 3;

/// The GPU backend.
pub struct OnGpu {
    gpu: Gpu,
    /// What is constant of the state, and the rest as it was when it came.
    start: State,
    /// The present state, once someone has asked for it.
    present: OnceLock<State>,
    ready: Option<Ready>,
    ledger: Ledger,
    clock: Clock,
    /// Births to come, in the order of time, and until when they are known (s).
    coming: VecDeque<Birth>,
    known: f64,
    /// A drift was made since the last sort.
    drifted: bool,
    fault: OnceLock<GpuError>,
    /// What the last step left behind, for the length of the next.
    last: Sums,
    flows: Flows,
    /// Rounds that are queued for each solve of a step: a little more than steps before needed.
    rounds: [usize; SOLVES],
    /// Most neighbours that lists may have room for.
    most_room: u32,
}

/// Of the model's sources, what buffers and kernels were made for.
#[derive(Clone, Copy, Default, PartialEq)]
struct Flows {
    any: bool,
    hoses: usize,
}

impl Flows {
    fn of(model: &Model) -> Self {
        Self { any: !model.sources.is_empty(), hoses: program::hoses(model).count() }
    }
}

/// Kernels in their order, each with its workgroups.
type Kernels = Vec<(Kernelet, [u32; 2])>;

/// What a scene needs on the device.
struct Ready {
    sizes: Sizes,
    buffers: Buffers,
    stages: Vec<(Stage, Vec<(Times, Kernels)>)>,
    choose: Kernelet,
    timers: Option<Timers>,
    results: Results,
}

/// Why a scene cannot run on a GPU yet, in words.
pub fn unsupported(model: &Model) -> Option<&'static str> {
    (model.flocks.len() > layout::FLOCKS).then_some("more than sixty-four flocks")
}

impl OnGpu {
    /// Opens the most welcome device; only hardware if so asked.
    ///
    /// # Errors
    /// [`GpuError`] where there is none.
    pub fn open(only_hardware: bool) -> Result<Self, GpuError> {
        Ok(Self::on(Gpu::open(only_hardware)?))
    }

    /// On a device that is open already.
    pub fn on(gpu: Gpu) -> Self {
        Self {
            gpu,
            start: State::default(),
            present: OnceLock::new(),
            ready: None,
            ledger: Ledger::default(),
            clock: Clock::default(),
            coming: VecDeque::new(),
            known: 0.0,
            drifted: false,
            fault: OnceLock::new(),
            last: Sums::default(),
            flows: Flows::default(),
            rounds: [4; SOLVES],
            most_room: u32::MAX,
        }
    }

    /// Its name and how it is reached.
    pub fn device(&self) -> String {
        format!("{} ({})", self.gpu.info.name, self.gpu.info.api)
    }

    /// As if the device had room for lists of so many neighbours of a particle only. Before anything comes to it.
    #[doc(hidden)]
    pub fn allow_lists_of(&mut self, neighbours: u32) {
        self.most_room = neighbours;
    }

    /// As if the device were taken out.
    #[doc(hidden)]
    pub fn lose(&self) {
        self.gpu.device.destroy();
    }

    fn prepare(&mut self, model: &Model, state: &State) -> Result<(), GpuError> {
        let (gpu, solver, most_room) = (&self.gpu, model.solver.pressure, self.most_room);
        let ready = gpu.attempt(|| {
            let program = Program::new(gpu, model)?;
            let most = gpu.device.limits().max_storage_buffers_per_shader_stage;
            if most < program.most_buffers() {
                let reason = format!("kernels use {} buffers, it allows {most}", program.most_buffers());
                return Err(gpu.refused(reason));
            }
            let (buffers, sizes) =
                Buffers::new(gpu, model, state, LOGGED, if model.sources.is_empty() { 0 } else { LISTED }, most_room)?;
            let groups = |over| folded(gpu, groups(over, sizes));
            // rounds name the same kernels many times
            let made = RefCell::new(HashMap::new());
            let stage = |stage: Stage| {
                let wanted = |name| kernels::wanted(name, model, sizes.bodies > 0);
                let runs = |&&(name, over): &&(&'static str, Over)| wanted(name) && groups(over)[0] > 0;
                let kernel = |&(name, over): &(&'static str, Over)| {
                    let mut made = made.borrow_mut();
                    let kernel = made.entry(name).or_insert_with(|| program.kernel(gpu, name, &buffers.all));
                    (kernel.clone(), groups(over))
                };
                let sections = kernels::sections(stage, solver).iter();
                let sections =
                    sections.map(|(times, kernels)| (*times, kernels.iter().filter(runs).map(kernel).collect()));
                (stage, sections.collect())
            };
            let timers = Timers::new(gpu, Stage::order(solver).len() as u32);
            Ok(Ready {
                sizes,
                stages: Stage::order(solver).iter().copied().map(stage).collect(),
                choose: program.kernel(gpu, "choose", &buffers.all),
                results: Results::new(gpu, &buffers, timers.as_ref()),
                timers,
                buffers,
            })
        })?;
        self.ready = Some(ready);
        Ok(())
    }

    /// Does some work unless something went wrong before, and notes what goes wrong.
    fn attempt<T>(&mut self, work: impl FnOnce(&Gpu, &Ready) -> Result<T, GpuError>) -> Option<T> {
        let ready = self.ready.as_ref().filter(|_| self.fault().is_none())?;
        match self.gpu.attempt(|| work(&self.gpu, ready)) {
            Ok(value) => Some(value),
            Err(fault) => {
                self.fail(fault);
                None
            }
        }
    }

    /// Notes what went wrong; the first fault counts.
    fn fail(&self, fault: GpuError) {
        self.fault.get_or_init(|| fault);
    }

    fn write_clock(&mut self, clock: Clock) {
        self.clock = clock;
        self.attempt(|gpu, ready| {
            gpu.queue.write_buffer(ready.buffers.clock(), 0, bytemuck::bytes_of(&clock));
            Ok(())
        });
    }

    /// Takes over what steps left behind.
    fn take(&mut self, model: &Model, sums: &[Sums]) {
        for s in sums {
            self.ledger = to_ledger(s, &self.ledger);
            self.ledger.external_force = double(s.outer);
            if model.fluids.is_empty() {
                self.ledger.acceleration = 0.0;
            }
        }
        if let Some(last) = sums.last() {
            self.last = *last;
            self.clock.live = last.count[0];
            self.clock.fastest = last.step[2];
        }
    }

    fn run_one(&mut self, stage: Stage, model: &Model, advance: Advance) {
        self.present = OnceLock::new();
        let advance = Advance { parts: advance.parts.max(1), ..advance };
        let order = Stage::order(model.solver.pressure);
        if Some(&stage) == order.first() || (stage == Stage::Cells && !self.drifted) {
            let gravity = layout::single(model.gravity_at(advance.end()), 0.0);
            let (dt, drag) = (advance.dt as f32, advance.drag as f32);
            let listed = self.list_births(model, advance.time, advance.end());
            let dt_before = advance.dt_before as f32;
            let (parts, part) = (advance.parts, advance.part() as f32);
            let clock = Clock { dt, dt_before, drag, gravity, running: 1, own: 0, part, parts, at: 0, ..listed };
            self.write_clock(clock);
        }
        // what is sorted is what has drifted: without a drift, all stay where they are
        if stage == Stage::Cells && !self.drifted && self.clock.dt == 0.0 {
            self.run_stage(Stage::Drift, model, Advance { dt: 0.0, ..advance });
        }
        self.drifted = stage == Stage::Drift || (self.drifted && stage != Stage::Cells);
        self.run_stage(stage, model, advance);
        if stage != Stage::Ledger {
            return;
        }
        let found = self.attempt(|gpu, ready| {
            let sums = ready.buffers.fetch::<Sums>(gpu, ready.buffers.log(), 0, 1)?;
            Ok((sums, ready.buffers.fetch::<Clock>(gpu, ready.buffers.clock(), 0, 1)?))
        });
        if let Some((sums, clock)) = found {
            self.take(model, &sums);
            self.settle_births(clock[0]);
        }
    }
}

impl Backend for OnGpu {
    fn name(&self) -> &'static str {
        "gpu"
    }

    fn device(&self) -> Option<String> {
        Some(OnGpu::device(self))
    }

    fn upload(&mut self, model: &Model, state: State) {
        self.present = OnceLock::new();
        self.ledger = self.ledger.counts();
        self.flows = Flows::of(model);
        self.drifted = false;
        if let Err(fault) = self.prepare(model, &state) {
            self.fail(fault);
        }
        let live = state.particles.count[0] as u32;
        (self.coming, self.known) = (VecDeque::new(), 0.0);
        self.write_clock(Clock {
            live,
            next_id: state.particles.next_id(),
            gravity: layout::single(model.gravity, 0.0),
            ..Clock::default()
        });
        self.start = state;
    }

    fn edit(&mut self, model: &Model, change: &mut dyn FnMut(&mut State)) {
        let mut state = self.download().clone();
        change(&mut state);
        let (bodies, agents) = (layout::bodies(model, &state, &layout::parts(&state)), layout::agents(model, &state));
        self.attempt(|gpu, ready| {
            ready.buffers.write_movers(gpu, &bodies, &agents);
            Ok(())
        });
        self.present = OnceLock::new();
    }

    fn sources_changed(&mut self, model: &Model, time: f64) {
        if Flows::of(model) != self.flows {
            let state = self.download().clone();
            (self.coming, self.known, self.flows) = (VecDeque::new(), time, Flows::of(model));
            self.rebuild(model, state);
            return;
        }
        // what was to come is listed anew
        (self.coming, self.known) = (VecDeque::new(), time);
        self.attempt(|gpu, ready| {
            let constants = layout::constants(model, ready.sizes);
            gpu.queue.write_buffer(&ready.buffers.all[0], 0, &constants);
            Ok(())
        });
    }

    fn on_device(&self) -> Option<super::OnDevice> {
        let Ready { buffers, sizes, .. } = self.ready.as_ref()?;
        let [record, tag, push] = [2, 3, 4].map(|k: usize| buffers.all[k].clone());
        let first = [0, sizes.fluids, sizes.fluids + sizes.rigid];
        let count = [self.clock.live, sizes.rigid, sizes.slots - sizes.rigid];
        Some(super::OnDevice { record, push, tag, first, count })
    }

    fn movers(&self) -> Option<(Vec<Body>, Vec<Record>)> {
        let ready = self.ready.as_ref()?;
        let fetched = self.gpu.attempt(|| ready.buffers.movers(&self.gpu, ready.sizes)).ok()?;
        let mut bodies = self.start.bodies.body.clone();
        bodies.iter_mut().zip(&fetched.0).for_each(|(body, from)| layout::to_body(from, body));
        let record = |a: &layout::Agent| Record { x: layout::three(a.x), v: layout::three(a.v), ..Record::default() };
        Some((bodies, fetched.1.iter().map(record).collect()))
    }

    fn run(&mut self, stages: &[Stage], model: &Model, advance: Advance) -> Vec<Duration> {
        let mut run = |stage: &Stage| {
            let start = Instant::now();
            self.run_one(*stage, model, advance);
            start.elapsed()
        };
        stages.iter().map(&mut run).collect()
    }

    fn queue(&mut self, model: &Model, request: Request) -> Option<Batch> {
        if model.paths.iter().any(Option::is_some) || !model.shakes.is_empty() || self.fault().is_some() {
            return None;
        }
        self.present = OnceLock::new();
        let last = &self.ledger;
        let (guess, _) = model.largest_dt(model.bounding_speed(last), last.acceleration);
        let (one, body_speed) = (request.most == 1, last.body_speed);
        let wanted = (request.left / guess * 1.02).ceil() + 1.0;
        let steps = (wanted.min(LOGGED as f64 - 1.0) as usize).min(request.most);
        let ahead = (1.5 * guess * steps as f64).min(request.left);
        // steps grow, and bodies get faster, until the host looks again
        let (longest, faster) = if one { (guess.min(request.left), 1.0) } else { (1.25 * guess, 1.25) };
        let most_parts = if model.implicit() { model.substeps(longest, faster * body_speed) } else { 1 };
        let listed = self.list_births(model, request.time, request.time + ahead);
        self.write_clock(Clock {
            left: request.left.min(f64::from(f32::MAX)) as f32,
            dt_before: request.dt_before as f32,
            drag: request.drag as f32,
            running: 1,
            own: 1,
            most_parts,
            rounds: [0; 4],
            ..listed
        });
        let queue::Frame { clock, sums, ticks } = self.queue_steps(model, steps, most_parts as usize)?;
        self.settle_births(clock);
        let mut batch = Batch::default();
        for s in &sums {
            self.take(model, std::slice::from_ref(s));
            let bound = BOUNDS.get(s.step[1].to_bits() as usize).copied().unwrap_or(DtBound::Frame);
            batch.steps.push((f64::from(s.step[0]), bound, self.ledger.clone()));
        }
        batch.stages = ticks.into_iter().map(|tick| tick * sums.len() as u32).collect();
        Some(batch)
    }

    fn download(&self) -> &State {
        self.present.get_or_init(|| {
            let mut state = self.start.clone();
            if let Some(ready) = self.ready.as_ref().filter(|_| self.fault().is_none())
                && let Err(fault) = self.gpu.attempt(|| ready.buffers.download(&self.gpu, ready.sizes, &mut state))
            {
                self.fail(fault);
            }
            state
        })
    }

    fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    fn fault(&self) -> Option<&GpuError> {
        self.fault.get()
    }
}

impl OnGpu {
    /// Lists what is born from `from` to `to` (s) for the kernels, and makes room for it. Returns the clock of a frame that
    /// begins at `from`.
    fn list_births(&mut self, model: &Model, from: f64, to: f64) -> Clock {
        let clock = Clock { time: from as f32, elapsed: 0.0, births: 0, born: 0, listed: 0, step: 0, ..self.clock };
        if model.sources.is_empty() || to <= from {
            return clock;
        }
        // at the beginning `known` is 0, and so is `from`
        let mut fresh: Vec<Birth> = sources::births(model, self.known.max(from), to).collect();
        fresh.sort_by(|a, b| a.time.total_cmp(&b.time));
        self.coming.extend(fresh);
        self.known = to.max(self.known);
        let listed = self.coming.len().min(LISTED);
        let room = self.ready.as_ref().map_or(0, |r| r.sizes.fluids as usize);
        if self.clock.live as usize + listed > room {
            self.grow(model, listed.max(room / 2));
        }
        let births: Vec<layout::Birth> = self.coming.iter().take(listed).map(|b| listed_birth(b, from)).collect();
        self.attempt(|gpu, ready| {
            gpu.queue.write_buffer(ready.buffers.births(), 0, bytemuck::cast_slice(&births));
            Ok(())
        });
        Clock { listed: listed as u32, ..clock }
    }

    /// Takes what was born off the list.
    fn settle_births(&mut self, clock: Clock) {
        self.coming.drain(..(clock.births as usize).min(self.coming.len()));
        self.ledger.born += u64::from(clock.born);
        self.clock.next_id = clock.next_id;
    }

    /// Makes room for more fluid: the state goes home and comes back.
    fn grow(&mut self, model: &Model, more: usize) {
        let mut state = self.download().clone();
        state.particles.grow(more);
        self.rebuild(model, state);
    }

    /// Other buffers for a state; what the last step left behind goes on.
    fn rebuild(&mut self, model: &Model, state: State) {
        let swept = self.attempt(|gpu, ready| {
            let swept = ready.buffers.swept();
            ready.buffers.fetch::<u8>(gpu, swept, 0, swept.size() as usize)
        });
        if let Err(fault) = self.prepare(model, &state) {
            self.fail(fault);
        }
        let (last, clock) = (self.last, self.clock);
        self.attempt(|gpu, ready| {
            gpu.queue.write_buffer(ready.buffers.log(), 0, bytemuck::bytes_of(&last));
            gpu.queue.write_buffer(ready.buffers.clock(), 0, bytemuck::bytes_of(&clock));
            gpu.queue.write_buffer(ready.buffers.swept(), 0, &swept.unwrap_or_default());
            Ok(())
        });
        self.start = state;
    }

    /// Bodies that follow scripts take the poses of the end of a step (E15), or of a part of it; so does shaking.
    fn scripts(&mut self, model: &Model, advance: Advance) {
        if advance.drag > 0.0 || advance.dt == 0.0 {
            return;
        }
        if !model.shakes.is_empty() {
            let gravity = layout::single(model.gravity_at(advance.end()), 0.0);
            let at = bytemuck::offset_of!(Clock, gravity) as u64;
            self.attempt(|gpu, ready| {
                gpu.queue.write_buffer(ready.buffers.clock(), at, bytemuck::bytes_of(&gravity));
                Ok(())
            });
        }
        if model.paths.iter().all(Option::is_none) {
            return;
        }
        let mut moved: Vec<(usize, Pose)> = Vec::new();
        let bodies = self.start.bodies.body.iter_mut().zip(&model.paths).enumerate();
        for (k, (body, path)) in bodies.filter_map(|(k, (b, p))| p.as_ref().map(|p| (k, (b, p)))) {
            crate::integrate::bodies::script(body, path, advance.end());
            moved.push((k, layout::pose(body)));
        }
        self.attempt(|gpu, ready| {
            for (k, pose) in &moved {
                let at = (k * size_of::<GpuBody>()) as u64;
                gpu.queue.write_buffer(ready.buffers.bodies(), at, bytemuck::bytes_of(pose));
            }
            Ok(())
        });
    }
}

/// A birth as kernels read it, in a frame that begins at `from` (s).
fn listed_birth(b: &Birth, from: f64) -> layout::Birth {
    let fluid = b.fluid as f32;
    let x = layout::single(b.x, (b.time - from) as f32);
    layout::Birth { x, v: layout::single(b.v, if b.in_hose { -fluid - 1.0 } else { fluid }), room: [0; 4] }
}

/// Workgroups of a kernel.
fn groups(over: Over, s: Sizes) -> u32 {
    match over {
        Over::Fluids(size) => s.fluids.div_ceil(size),
        Over::BodyParticles(size) => s.slots.div_ceil(size),
        Over::Slots(size) => s.rigid.div_ceil(size),
        Over::Moving(size) => (s.fluids + s.rigid).div_ceil(size),
        Over::Cells(size) => s.bins().div_ceil(size),
        Over::Blocks => s.blocks(),
        Over::Bodies(size) => s.bodies.div_ceil(size),
        Over::Movers(size) => s.movers.div_ceil(size),
        Over::Parts => s.slots.div_ceil(layout::PART as u32),
        Over::RigidParts => s.rigid.div_ceil(layout::PART as u32),
        Over::Groups => s.groups,
        Over::Agents(size) => s.agents.div_ceil(size),
        Over::AgentCells(size) => (s.agent_cells + 2).div_ceil(size),
        Over::Particles(size) => (s.fluids + s.slots).div_ceil(size),
        Over::Births(size) => (LISTED as u32).div_ceil(size),
        Over::Elements(size) => s.elements.div_ceil(size),
        Over::Occupied => s.occupied.min(4096),
        Over::Nodes(size) => s.nodes.div_ceil(size),
        Over::EachMover => s.movers,
        Over::One => 1,
    }
}

/// Workgroups in two dimensions, where one does not hold them all.
fn folded(gpu: &Gpu, groups: u32) -> [u32; 2] {
    let most = gpu.device.limits().max_compute_workgroups_per_dimension;
    let x = groups.min(most);
    [x, groups.div_ceil(x.max(1))]
}

/// A ledger from the sums of a step and the ledger before.
fn to_ledger(s: &Sums, before: &Ledger) -> Ledger {
    let [fluid, left, lost, nonfinite] = s.count;
    let [drained, rigid_lost, full, fast] = s.more;
    let number = f64::from;
    Ledger {
        speed: number(s.step[2]),
        acceleration: number(s.step[3]),
        body_speed: number(s.energy[3]),
        momentum: double(s.momentum),
        momentum_scale: number(s.momentum[3]),
        crossed: double(s.crossed),
        external_force: double(s.outer),
        external_impulse: double(s.impulse),
        total_force: double(s.total),
        force_scale: number(s.energy[2]),
        kinetic: number(s.energy[0]) + number(s.energy_low[0]),
        potential: number(s.energy[1]) + number(s.energy_low[1]),
        density_error_mean: number(s.outer[3]) / f64::from(full.max(1)),
        density_error_max: number(s.total[3]),
        neighbours: number(s.crossed[3]) / f64::from(fluid.max(1)),
        fluid: fluid as usize,
        left: before.left + u64::from(left),
        born: before.born,
        drained: before.drained + u64::from(drained),
        lost: before.lost + u64::from(lost),
        rigid_lost: rigid_lost as usize,
        fast_contacts: before.fast_contacts + u64::from(fast),
        nonfinite: before.nonfinite + u64::from(nonfinite),
        put_back: before.put_back + s.impulse[3] as u64,
        pressed: (3.0 * number(s.fluids[3]) / f64::from(fluid.max(1))).powf(0.25),
        pressure: Solve { iterations: s.said[0] as u32, residual: number(s.said[1]) },
        divergence: Solve { iterations: s.said[2] as u32, residual: number(s.said[3]) },
    }
}
