//! The stages of a step and their order, written once: backends run them, timers and tests use their names.

use serde::Serialize;

/// One stage of the step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Stage {
    /// Half a kick and the drift of every particle and body; velocities are predicted to the step's end.
    Drift,
    /// Fluid born and drained (E31).
    Sources,
    /// Particles sorted into cells as wide as the support.
    Cells,
    /// Neighbours found once for all laws; densities of fluids (E1).
    Density,
    /// Equation of state (E3).
    Pressure,
    /// Pressures the fluid shows to the particles of bodies (E17).
    Boundary,
    /// Colour gradients and vorticities, where surface tension or vorticity ask for them (E7, E8).
    Gradients,
    /// Forces on every particle (E4-E6, E10-E12, E16, E30).
    Forces,
    /// Agents of flocks move, push and decide (E22-E28).
    Agents,
    /// Force and torque summed per body (E18).
    Bodies,
    /// The second half of the kick.
    Kick,
    /// Statistics: momentum, energies, extremes that bound the next step.
    Ledger,
}

impl Stage {
    /// The order of a step of weakly compressible SPH.
    pub const WCSPH: [Stage; 12] = [
        Stage::Drift,
        Stage::Sources,
        Stage::Cells,
        Stage::Density,
        Stage::Pressure,
        Stage::Boundary,
        Stage::Gradients,
        Stage::Forces,
        Stage::Agents,
        Stage::Bodies,
        Stage::Kick,
        Stage::Ledger,
    ];

    /// The name used by timers and reports.
    pub fn name(self) -> &'static str {
        match self {
            Stage::Drift => "drift",
            Stage::Sources => "sources",
            Stage::Cells => "cells",
            Stage::Density => "density",
            Stage::Pressure => "pressure",
            Stage::Boundary => "boundary",
            Stage::Gradients => "gradients",
            Stage::Forces => "forces",
            Stage::Agents => "agents",
            Stage::Bodies => "bodies",
            Stage::Kick => "kick",
            Stage::Ledger => "ledger",
        }
    }

    /// Whether the stage evaluates forces at the present positions: what has to run once before the first step.
    pub fn evaluates(self) -> bool {
        !matches!(self, Stage::Drift | Stage::Sources | Stage::Kick)
    }
}
