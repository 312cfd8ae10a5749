//! Stage `pressure`: equation of state (E3).
//!
//! In: `density`. Out: the records' pressure share and, for Mueller's form of E4, their present volume.

use crate::laws::fluid;
use crate::model::Model;
use crate::scene::{EquationOfState, PressureForce};
use crate::state::{Particles, Record};

/// Pressure (Pa) at relative density `d` of fluid `owner`.
#[inline]
pub fn pressure(model: &Model, owner: u32, d: f32) -> f32 {
    let p = of_state(model, owner, d);
    if model.solver.negative_pressure { p } else { p.max(0.0) }
}

/// Pressure of a fluid particle as it stands (Pa), whatever the solver.
pub fn of_particle(model: &Model, p: &Particles, i: usize) -> f32 {
    match model.implicit() {
        true => p.record[i].share,
        false => pressure(model, p.owner[i], p.density[i]),
    }
}

/// Pressure of either sign (Pa), as the equation of state gives it.
#[inline]
fn of_state(model: &Model, owner: u32, d: f32) -> f32 {
    let stiffness = model.fluids[owner as usize].stiffness;
    match model.solver.equation_of_state {
        EquationOfState::Linear => fluid::pressure_linear(d, stiffness),
        EquationOfState::Tait => fluid::pressure_tait(d, stiffness),
    }
}

/// How far an integrated density may be below the summed one.
pub(crate) const BELOW_SUM: f32 = 0.03;

/// An integrated density (E1) is held above the summed one less a little. Spray that has parted and joins again remembers
/// a density far below one and would be packed without resistance; in a flow that holds together this does nothing.
pub fn hold(density: &mut [f32], summed: &[f32]) {
    density.iter_mut().zip(summed).for_each(|(d, s)| *d = d.max(s - BELOW_SUM));
}

/// Pressure shares of a chunk of fluid particles. Where densities are integrated shares keep their sign, for density diffusion;
/// pairs cut them off.
pub fn chunk(model: &Model, records: &mut [Record], density: &[f32], owner: &[u32]) {
    let integrated = model.integrates_density();
    for ((r, &d), &owner) in records.iter_mut().zip(density).zip(owner) {
        let p = if integrated { of_state(model, owner, d) } else { pressure(model, owner, d) };
        match model.solver.pressure_force {
            PressureForce::Symmetric => r.share = fluid::pressure_share(p, d),
            PressureForce::Mueller => {
                r.share = 0.5 * p;
                r.volume = model.volume as f32 / d;
            }
        }
    }
}
