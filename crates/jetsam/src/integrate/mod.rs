//! Chapter 3, integration: free particles and bodies, kick-drift-kick (E20).
//!
//! Drift applies the first half of the kick and moves everything; velocities are then predicted to the end of
//! the step, because viscosity and dashpots need them there. Kick corrects the prediction with the new forces.

pub mod bodies;
pub mod joints;
pub mod particles;
pub mod sleep;

/// How a step advances time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Advance {
    /// Length of the step (s).
    pub dt: f64,
    /// Simulated time at its end (s).
    pub time: f64,
    /// Drag on fluids (1/s): not zero only while a scene settles, and then bodies stand still.
    pub drag: f64,
}
