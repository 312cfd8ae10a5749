//! The stages of a step and their order, written once: backends run them, timers and tests use their names.

use crate::scene::Pressure;
use serde::Serialize;

/// One stage of the step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Stage {
    /// The drift of every particle and body, with half a kick before where that is leapfrog's; velocities are predicted to the
    /// step's end.
    Drift,
    /// Fluid born and drained (E31).
    Sources,
    /// Particles sorted into cells as wide as the support.
    Cells,
    /// Neighbours found once for all laws; densities of fluids (E1).
    Density,
    /// Velocities made free of compression (E9, DFSPH).
    Divergence,
    /// Equation of state (E3), or the implicit pressure of E9.
    Pressure,
    /// Pressures the fluid shows to the particles of bodies (E17), and velocities where they do not slip (E5).
    Boundary,
    /// Colour gradients and vorticities, where surface tension or vorticity ask for them (E7, E8).
    Gradients,
    /// Forces on every particle (E4-E6, E10-E12, E16, E30).
    Forces,
    /// Agents of flocks move, push and decide (E22-E28).
    Agents,
    /// Force and torque summed per body (E18).
    Bodies,
    /// The second half of the kick; with implicit pressure the whole kick by all other forces.
    Kick,
    /// Statistics: momentum, energies, extremes that bound the next step.
    Ledger,
}

impl Stage {
    /// How many stages there are.
    pub const COUNT: usize = 13;

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

    /// The order of a step of DFSPH: what the forces have made of velocities is made free of compression, then the drift is
    /// corrected for what is compressed already.
    pub const DFSPH: &[Stage] = &[
        Stage::Kick,
        Stage::Divergence,
        Stage::Pressure,
        Stage::Drift,
        Stage::Sources,
        Stage::Cells,
        Stage::Density,
        Stage::Boundary,
        Stage::Gradients,
        Stage::Forces,
        Stage::Agents,
        Stage::Bodies,
        Stage::Ledger,
    ];

    /// The order of a step of PBF: pressures correct the places where the drift would leave particles.
    pub const PBF: &[Stage] = &[
        Stage::Kick,
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
        Stage::Ledger,
    ];

    /// The order of a step with a solver.
    pub fn order(solver: Pressure) -> &'static [Stage] {
        match solver {
            Pressure::Auto | Pressure::Wcsph => &Self::WCSPH,
            Pressure::Dfsph => Self::DFSPH,
            Pressure::Pbf => Self::PBF,
        }
    }

    /// The name used by timers and reports.
    pub fn name(self) -> &'static str {
        match self {
            Stage::Drift => "drift",
            Stage::Sources => "sources",
            Stage::Cells => "cells",
            Stage::Density => "density",
            Stage::Divergence => "divergence",
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

    /// Whether the stage evaluates the present places and velocities: what has to run once before the first step.
    pub fn evaluates(self, solver: Pressure) -> bool {
        match self {
            Stage::Drift | Stage::Sources | Stage::Kick | Stage::Divergence => false,
            Stage::Pressure => matches!(solver, Pressure::Auto | Pressure::Wcsph),
            _ => true,
        }
    }
}
