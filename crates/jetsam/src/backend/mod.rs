//! Who runs the stages. A backend owns the changing state while a world runs.

mod cpu;

pub use cpu::Cpu;

use crate::integrate::Advance;
use crate::ledger::Ledger;
use crate::model::Model;
use crate::stage::Stage;
use crate::state::State;

/// A device that runs the stages of a step.
pub trait Backend: Send {
    /// Name for reports: `cpu`.
    fn name(&self) -> &'static str;
    /// Takes over a state.
    fn upload(&mut self, state: State);
    /// Runs one stage.
    fn run(&mut self, stage: Stage, model: &Model, advance: Advance);
    /// The present state.
    fn download(&self) -> &State;
    /// What the stage `ledger` found.
    fn ledger(&self) -> &Ledger;
}
