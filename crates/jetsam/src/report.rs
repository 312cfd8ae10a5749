//! What a run says about itself: the numbers of a frame, of a whole run, and a hash of the state.
//!
//! In: a [`World`] after each frame. Out: one [`FrameStats`] a frame (a line of `stats.jsonl`), a [`Summary`] at the
//! end, and [`state_hash`], by which two runs are told apart to the last bit. Called by whoever drives a world.

use crate::model::DtBound;
use crate::stage::Stage;
use crate::state::{Kind, State};
use crate::world::World;
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};
use std::time::Duration;

/// What happened in one frame, and how the world stands at its end. Frame 0 is the beginning: no step was made yet.
#[derive(Clone, Debug, Serialize)]
pub struct FrameStats {
    /// Number of the frame.
    pub frame: u64,
    /// Simulated time at its end (s).
    pub time: f64,
    /// Steps made in this frame.
    pub steps: u64,
    /// Mean length of those steps (s); in a frame without steps the length the next one may have.
    pub dt: f64,
    /// What bounded most of those steps.
    pub dt_bound: DtBound,
    /// Fluid particles alive.
    pub fluid: usize,
    /// Particles of rigid bodies.
    pub rigid_particles: usize,
    /// Rigid bodies; static ones do not count.
    pub bodies: usize,
    /// Agents of flocks.
    pub agents: usize,
    /// Fluid particles that got through a solid wall since the beginning, and particles of bodies that are now beyond one.
    pub lost: u64,
    /// Particles and bodies found with a value that is not finite, since the beginning.
    pub nonfinite: u64,
    /// Mean of `|rho / rho_0 - 1|` over fluid particles with full support.
    pub density_error_mean: f64,
    /// Largest `|rho / rho_0 - 1|` over fluid particles with full support.
    pub density_error_max: f64,
    /// Momentum of fluids and rigid bodies (kg m/s).
    pub momentum: [f64; 3],
    /// Momentum that no impulse from outside explains, as a fraction of the sum of magnitudes.
    pub momentum_residual: f64,
    /// Kinetic energy (J).
    pub kinetic_energy: f64,
    /// Potential energy in the gravity vector, zero at the domain's lower corner (J).
    pub potential_energy: f64,
    /// Wall-clock time the frame's steps took; pictures and files do not count.
    pub wall_ms: f64,
    /// Simulated time over that wall-clock time; 0 in a frame without steps.
    pub real_time_factor: f64,
    /// Wall-clock time of this frame's steps by stage.
    pub stage_ms: StageMillis,
}

/// Wall-clock milliseconds of each stage, in the order of the step. Written as a table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StageMillis(pub Vec<(Stage, f64)>);

impl StageMillis {
    /// The world's timers, less what they showed `before`.
    pub fn since(before: &[Duration], world: &World) -> Self {
        let earlier = before.iter().copied().chain(std::iter::repeat(Duration::ZERO));
        Self(world.timers().zip(earlier).map(|((stage, now), then)| (stage, millis(now - then))).collect())
    }
}

impl Serialize for StageMillis {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (stage, ms) in &self.0 {
            map.serialize_entry(stage.name(), ms)?;
        }
        map.end()
    }
}

/// Turns a world's counters, which run from the beginning, into numbers of frames and of the whole run.
#[derive(Clone, Debug, Default)]
pub struct Recorder {
    frames: u64,
    time: f64,
    steps: u64,
    timers: Vec<Duration>,
    bounds: Vec<(DtBound, u64)>,
    wall: Duration,
    density_error_sum: f64,
    density_error_max: f64,
    momentum_residual: f64,
}

impl Recorder {
    /// The frame that ends now; its steps took `wall`.
    pub fn frame(&mut self, world: &World, wall: Duration) -> FrameStats {
        let ledger = world.ledger();
        let (steps, seconds) = (world.steps() - self.steps, world.time() - self.time);
        let (mut dt, mut dt_bound) =
            world.model().largest_dt(world.model().bounding_speed(ledger), ledger.acceleration);
        if steps > 0 {
            (dt, dt_bound) = (seconds / steps as f64, most(world.bounds(), &self.bounds).unwrap_or(dt_bound));
        }
        let stats = FrameStats {
            frame: self.frames,
            time: world.time(),
            steps,
            dt: if dt.is_finite() { dt } else { 0.0 },
            dt_bound,
            fluid: ledger.fluid,
            rigid_particles: world.state().bodies.rigid_slots,
            bodies: rigid_bodies(world.state()),
            agents: world.state().agents.record.len(),
            lost: ledger.lost + ledger.rigid_lost as u64,
            nonfinite: ledger.nonfinite,
            density_error_mean: ledger.density_error_mean,
            density_error_max: ledger.density_error_max,
            momentum: ledger.momentum.to_array(),
            momentum_residual: world.momentum_residual(),
            kinetic_energy: ledger.kinetic,
            potential_energy: ledger.potential,
            wall_ms: millis(wall),
            real_time_factor: factor(seconds, wall),
            stage_ms: StageMillis::since(&self.timers, world),
        };
        self.frames += 1;
        (self.time, self.steps) = (world.time(), world.steps());
        self.timers = world.timers().map(|t| t.1).collect();
        self.bounds = world.bounds().to_vec();
        self.wall += wall;
        self.density_error_sum += stats.density_error_mean;
        self.density_error_max = self.density_error_max.max(stats.density_error_max);
        self.momentum_residual = self.momentum_residual.max(stats.momentum_residual);
        stats
    }

    /// The run so far.
    pub fn summary(&self, world: &World) -> Summary {
        let (ledger, solves, steps) = (world.ledger(), world.solves(), world.steps().max(1) as f64);
        Summary {
            frames: self.frames,
            time: world.time(),
            steps: world.steps(),
            dt: world.time() / world.steps().max(1) as f64,
            dt_bound: most(world.bounds(), &[]),
            fluid: ledger.fluid,
            rigid_particles: world.state().bodies.rigid_slots,
            bodies: rigid_bodies(world.state()),
            agents: world.state().agents.record.len(),
            left: ledger.left,
            lost: ledger.lost + ledger.rigid_lost as u64,
            fast_contacts: ledger.fast_contacts,
            nonfinite: ledger.nonfinite,
            put_back: ledger.put_back,
            density_error_mean: self.density_error_sum / self.frames.max(1) as f64,
            density_error_max: self.density_error_max,
            momentum_residual: self.momentum_residual,
            pressure_iterations: solves.pressure as f64 / steps,
            pressure_residual: solves.pressure_residual / steps,
            divergence_iterations: solves.divergence as f64 / steps,
            divergence_residual: solves.divergence_residual / steps,
            wall_s: self.wall.as_secs_f64(),
            real_time_factor: factor(world.time(), self.wall),
            state_hash: format!("{:016x}", state_hash(world.state())),
        }
    }
}

/// A run at its end.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Frames, the one at time zero included.
    pub frames: u64,
    /// Simulated time (s).
    pub time: f64,
    /// Steps made.
    pub steps: u64,
    /// Mean length of a step (s).
    pub dt: f64,
    /// What bounded most steps; nothing when there was none.
    pub dt_bound: Option<DtBound>,
    /// Fluid particles alive.
    pub fluid: usize,
    /// Particles of rigid bodies.
    pub rigid_particles: usize,
    /// Rigid bodies; static ones do not count.
    pub bodies: usize,
    /// Agents of flocks.
    pub agents: usize,
    /// Fluid particles that passed an open side.
    pub left: u64,
    /// As in [`FrameStats`].
    pub lost: u64,
    /// As in [`FrameStats`].
    pub fast_contacts: u64,
    /// As in [`FrameStats`].
    pub nonfinite: u64,
    /// Times implicit pressure did not keep a fluid particle out of a solid side of the domain, so that it was put back.
    pub put_back: u64,
    /// Mean over the frames of their mean density error.
    pub density_error_mean: f64,
    /// Largest density error at the end of any frame.
    pub density_error_max: f64,
    /// Largest momentum residual at the end of any frame.
    pub momentum_residual: f64,
    /// Mean number of rounds a step in which implicit pressure corrected places (E9); 0 with WCSPH.
    pub pressure_iterations: f64,
    /// Mean compression these left.
    pub pressure_residual: f64,
    /// Mean number of rounds a step in which velocities were made free of compression (E9, DFSPH).
    pub divergence_iterations: f64,
    /// Mean compression a step that these left in velocities.
    pub divergence_residual: f64,
    /// Wall-clock time the steps took (s).
    pub wall_s: f64,
    /// Simulated time over that wall-clock time.
    pub real_time_factor: f64,
    /// [`state_hash`] in hexadecimal.
    pub state_hash: String,
}

/// A hash (FNV-1a, 64 bits) of the bits of every fluid particle's and agent's position and velocity in the order of their ids, and of
/// every body's place, velocity, orientation and angular velocity: equal when two states are the same to the last bit.
pub fn state_hash(state: &State) -> u64 {
    let p = &state.particles;
    let mut order: Vec<(u32, usize)> = p.segment(Kind::Fluid).map(|i| (p.id[i], i)).collect();
    order.sort_unstable();
    let mut hash = 0xcbf2_9ce4_8422_2325;
    for (id, i) in order {
        add(&mut hash, &id.to_le_bytes());
        let r = &p.record[i];
        r.x.iter().chain(&r.v).for_each(|x| add(&mut hash, &x.to_bits().to_le_bytes()));
    }
    for body in &state.bodies.body {
        let numbers = [body.x.to_array(), body.v.to_array(), body.omega.to_array()];
        numbers.iter().flatten().chain(&body.q.to_array()).for_each(|x| add(&mut hash, &x.to_bits().to_le_bytes()));
    }
    let a = &state.agents;
    let mut order: Vec<(u32, usize)> = a.id.iter().copied().zip(0..).collect();
    order.sort_unstable();
    for (_, i) in order {
        a.record[i].x.iter().chain(&a.record[i].v).for_each(|x| add(&mut hash, &x.to_bits().to_le_bytes()));
    }
    hash
}

fn add(hash: &mut u64, bytes: &[u8]) {
    for &byte in bytes {
        *hash = (*hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    }
}

/// The bound that was met most often between two readings of [`World::bounds`].
fn most(now: &[(DtBound, u64)], before: &[(DtBound, u64)]) -> Option<DtBound> {
    let earlier = |bound| before.iter().find(|b| b.0 == bound).map_or(0, |b| b.1);
    now.iter().map(|&(bound, n)| (n - earlier(bound), bound)).max().map(|b| b.1)
}

fn rigid_bodies(state: &State) -> usize {
    state.bodies.body.iter().filter(|b| !b.is_static()).count()
}

fn factor(seconds: f64, wall: Duration) -> f64 {
    if wall.is_zero() { 0.0 } else { seconds / wall.as_secs_f64() }
}

fn millis(time: Duration) -> f64 {
    1e3 * time.as_secs_f64()
}
