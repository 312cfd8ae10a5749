//! Steps and stages recorded as commands: rounds of implicit pressure as many as steps before needed, parts of bodies' steps, timers.
//!
//! In: kernels made for a scene. Out: commands, and what the device says of time. Called by the backend's `run` and `queue`.

use super::kernels::Times;
use super::layout::{Clock, Sums};
use super::program::Kernelet;
use super::transfer::{Buffers, Home, arrive};
use super::{OnGpu, Ready, SOLVES, SUBMITTED};
use crate::gpu::{Gpu, GpuError};
use crate::integrate::Advance;
use crate::model::Model;
use crate::stage::Stage;
use std::time::Duration;

/// Timestamps round each stage of one step.
pub(super) struct Timers {
    ticks: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    stages: usize,
}

/// Where the results of a frame come home: with one wait.
pub(super) struct Results {
    clock: Home,
    log: Home,
    ticks: Option<Home>,
}

/// What a frame left behind: its clock, what each step said, time of each stage in one step.
pub(super) struct Frame {
    pub clock: Clock,
    pub sums: Vec<Sums>,
    pub ticks: Vec<Duration>,
}

impl Results {
    pub(super) fn new(gpu: &Gpu, buffers: &Buffers, timers: Option<&Timers>) -> Self {
        let size = size_of::<Sums>() as u64;
        Self {
            clock: Home::new(gpu, buffers.clock(), 0, size_of::<Clock>() as u64),
            log: Home::new(gpu, buffers.log(), size, buffers.log().size() - size),
            ticks: timers.map(|t| Home::new(gpu, &t.resolved, 0, t.resolved.size())),
        }
    }

    /// Sends them, of so many steps at most.
    fn send(&self, commands: &mut wgpu::CommandEncoder, steps: usize) {
        self.clock.send(commands, size_of::<Clock>() as u64);
        self.log.send(commands, (steps * size_of::<Sums>()) as u64);
        if let Some(ticks) = &self.ticks {
            ticks.send(commands, ticks.bytes());
        }
    }

    /// Waits for them.
    fn receive(&self, gpu: &Gpu, timers: Option<&Timers>) -> Result<Frame, GpuError> {
        let homes: Vec<&Home> = [&self.clock, &self.log].into_iter().chain(&self.ticks).collect();
        arrive(gpu, &homes)?;
        let clock = self.clock.read::<Clock>(gpu, 1)?[0];
        let sums = self.log.read(gpu, clock.step as usize)?;
        let ticks = match (&self.ticks, timers) {
            (Some(ticks), Some(timers)) => timers.spans(gpu, &ticks.read(gpu, 2 * timers.stages)?),
            _ => Vec::new(),
        };
        Ok(Frame { clock, sums, ticks })
    }
}

impl OnGpu {
    /// Queues so many steps, and waits for their results. Where the rounds of a solve did not suffice the device has stopped in the midst of a
    /// step, and is told to go on with more.
    pub(super) fn queue_steps(&mut self, model: &Model, steps: usize, parts: usize) -> Option<Frame> {
        let at_once = if model.implicit() { 1 } else { SUBMITTED };
        let (mut done, mut from, mut measured) = (0, None, false);
        loop {
            let rounds = self.rounds;
            let frame = self.attempt(|gpu, ready| {
                let mut made = done;
                while made < steps {
                    let mut commands = gpu.device.create_command_encoder(&Default::default());
                    for step in made..(made + at_once).min(steps) {
                        let begin = from.filter(|_| step == done);
                        let timers = ready.timers.as_ref().filter(|_| step == 0 && !measured);
                        ready.step(&mut commands, begin, rounds, parts, timers);
                    }
                    made += at_once;
                    if made >= steps {
                        ready.results.send(&mut commands, steps);
                    }
                    gpu.queue.submit([commands.finish()]);
                }
                ready.results.receive(gpu, ready.timers.as_ref())
            })?;
            measured = true;
            done = frame.clock.step as usize;
            from = self.resume(model, frame.clock);
            if from.is_none() {
                return Some(frame);
            }
        }
    }

    /// Rounds to queue from now on. Where a solve stands still for want of rounds it is told to go on: returns its number.
    fn resume(&mut self, model: &Model, clock: Clock) -> Option<usize> {
        let budget = model.solver.iterations.ceil() as usize;
        let stands = (clock.halted as usize).checked_sub(1);
        for (number, rounds) in self.rounds.iter_mut().enumerate() {
            let needed = clock.rounds[number] as usize;
            *rounds = if stands == Some(number) { *rounds * 2 } else { needed + needed / 4 + 2 }.min(budget);
        }
        if stands.is_some() {
            let running = bytemuck::offset_of!(Clock, running) as u64;
            let halted = bytemuck::offset_of!(Clock, halted) as u64;
            self.attempt(|gpu, ready| {
                gpu.queue.write_buffer(ready.buffers.clock(), running, bytemuck::bytes_of(&1u32));
                gpu.queue.write_buffer(ready.buffers.clock(), halted, bytemuck::bytes_of(&0u32));
                Ok(())
            });
        }
        stands
    }

    /// One stage of a step whose length the host has chosen, with all the rounds that its solves need.
    pub(super) fn run_stage(&mut self, stage: Stage, model: &Model, advance: Advance) {
        let Some(k) = Stage::order(model.solver.pressure).iter().position(|s| *s == stage) else { return };
        let solves = matches!(stage, Stage::Divergence | Stage::Pressure) && model.implicit();
        if stage == Stage::Drift {
            return self.run_drift(k, model, advance);
        }
        let mut from = None;
        loop {
            let rounds = self.rounds;
            let clock = self.attempt(|gpu, ready| {
                ready.submit(gpu, |pass| ready.stage(pass, k, &mut from, rounds, 1));
                let clock = || ready.buffers.fetch::<Clock>(gpu, ready.buffers.clock(), 0, 1);
                if solves { clock().map(|c| c.first().copied()) } else { Ok(None) }
            });
            from = clock.flatten().and_then(|clock| self.resume(model, clock));
            if from.is_none() {
                return;
            }
        }
    }

    /// The drift, part by part: scripts and shaking are known to the host alone.
    fn run_drift(&mut self, k: usize, model: &Model, advance: Advance) {
        let sections = self.ready.as_ref().map_or(0, |r| r.stages[k].1.len());
        for section in 0..sections {
            let times = self.ready.as_ref().map(|r| r.stages[k].1[section].0);
            let parts =
                if times == Some(Times::Parts) { 0..advance.parts - 1 } else { advance.parts - 1..advance.parts };
            for part in parts {
                if times == Some(Times::Parts) || section + 1 == sections {
                    self.scripts(model, advance.nth_part(part));
                }
                self.attempt(|gpu, ready| {
                    ready.submit(gpu, |pass| run_all(pass, &ready.stages[k].1[section].1));
                    Ok(())
                });
            }
        }
    }
}

impl Ready {
    fn submit(&self, gpu: &Gpu, record: impl FnOnce(&mut wgpu::ComputePass)) {
        let mut commands = gpu.device.create_command_encoder(&Default::default());
        record(&mut commands.begin_compute_pass(&Default::default()));
        gpu.queue.submit([commands.finish()]);
    }

    /// Records a step, or what is left of it `from` a solve on.
    fn step(
        &self,
        commands: &mut wgpu::CommandEncoder,
        mut from: Option<usize>,
        rounds: [usize; SOLVES],
        parts: usize,
        timers: Option<&Timers>,
    ) {
        if from.is_none() {
            run_one(&mut commands.begin_compute_pass(&Default::default()), &self.choose, [1, 1]);
        }
        for k in 0..self.stages.len() {
            let timestamp_writes = timers.map(|timers| timers.of(k as u32));
            let pass = wgpu::ComputePassDescriptor { label: None, timestamp_writes };
            self.stage(&mut commands.begin_compute_pass(&pass), k, &mut from, rounds, parts);
        }
        if let Some(timers) = timers {
            timers.resolve(commands);
        }
    }

    /// Records a stage; what stands before the solve `from` is left out.
    fn stage(
        &self,
        pass: &mut wgpu::ComputePass,
        k: usize,
        from: &mut Option<usize>,
        rounds: [usize; SOLVES],
        parts: usize,
    ) {
        for (times, kernels) in &self.stages[k].1 {
            if from.is_some_and(|number| *times == Times::Rounds(number)) {
                *from = None;
            }
            let times = match times {
                _ if from.is_some() => 0,
                Times::Once => 1,
                Times::Rounds(number) => rounds[*number].div_ceil(2),
                Times::Parts => parts - 1,
            };
            (0..times).for_each(|_| run_all(pass, kernels));
        }
    }
}

fn run_all(pass: &mut wgpu::ComputePass, kernels: &[(Kernelet, [u32; 2])]) {
    kernels.iter().for_each(|(kernel, groups)| run_one(pass, kernel, *groups));
}

fn run_one(pass: &mut wgpu::ComputePass, kernel: &Kernelet, [x, y]: [u32; 2]) {
    pass.set_pipeline(&kernel.pipeline);
    pass.set_bind_group(0, &kernel.bound, &[]);
    pass.dispatch_workgroups(x, y, 1);
}

impl Timers {
    pub(super) fn new(gpu: &Gpu, stages: u32) -> Option<Self> {
        let count = 2 * stages;
        gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY).then(|| Self {
            ticks: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("stages"),
                ty: wgpu::QueryType::Timestamp,
                count,
            }),
            resolved: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("ticks"),
                size: 8 * u64::from(count),
                usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            }),
            stages: stages as usize,
        })
    }

    /// Round the stage number `k`.
    fn of(&self, k: u32) -> wgpu::ComputePassTimestampWrites<'_> {
        wgpu::ComputePassTimestampWrites {
            query_set: &self.ticks,
            beginning_of_pass_write_index: Some(2 * k),
            end_of_pass_write_index: Some(2 * k + 1),
        }
    }

    fn resolve(&self, commands: &mut wgpu::CommandEncoder) {
        commands.resolve_query_set(&self.ticks, 0..(self.resolved.size() / 8) as u32, &self.resolved, 0);
    }

    /// Time of each stage in the step that was measured.
    fn spans(&self, gpu: &Gpu, ticks: &[u64]) -> Vec<Duration> {
        let period = f64::from(gpu.queue.get_timestamp_period());
        let span = |t: &[u64]| Duration::from_nanos((t[1].saturating_sub(t[0]) as f64 * period) as u64);
        ticks.chunks_exact(2).map(span).collect()
    }
}
