//! Chapter 3, integration: free particles and bodies, kick-drift-kick (E20).
//!
//! Drift applies the first half of the kick and moves everything; velocities are then predicted to the end of
//! the step, because viscosity and dashpots need them there. Kick corrects the prediction with the new forces.

pub mod bodies;
pub mod joints;
pub mod particles;
pub mod sleep;
pub mod sources;

/// How a step advances time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Advance {
    /// Time at the beginning of the step (s).
    pub time: f64,
    /// Length of the step (s).
    pub dt: f64,
    /// Length of the step before (s); 0 at the beginning.
    pub dt_before: f64,
    /// Drag on fluids (1/s): not zero only while a scene settles, and then bodies stand still.
    pub drag: f64,
    /// In how many parts bodies make the step; one with a pressure that is not implicit.
    pub parts: u32,
}

impl Advance {
    /// How far rates are extrapolated from the last two steps: half a step in units of the step before.
    fn ahead(&self) -> f32 {
        if self.dt_before > 0.0 { (0.5 * self.dt / self.dt_before) as f32 } else { 0.0 }
    }
}

impl Advance {
    /// Length of a part of the step (s): that for which contacts stand.
    pub fn part(&self) -> f64 {
        self.dt / f64::from(self.parts.max(1))
    }

    /// Part `k` of the step, as a step.
    pub fn nth_part(&self, k: u32) -> Self {
        let dt = self.part();
        Self { time: self.time + f64::from(k) * dt, dt, dt_before: dt, drag: self.drag, parts: 1 }
    }

    /// Time at the end of the step (s).
    pub fn end(&self) -> f64 {
        self.time + self.dt
    }
}
