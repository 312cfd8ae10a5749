//! Who runs the stages. A backend owns the changing state while a world runs.

mod cpu;
#[cfg(feature = "gpu")]
mod gpu;

pub use cpu::Cpu;
#[cfg(feature = "gpu")]
pub use gpu::OnGpu;

use crate::gpu::{Gpu, GpuError};
use crate::integrate::Advance;
use crate::ledger::Ledger;
use crate::model::{DtBound, Model};
use crate::stage::Stage;
use crate::state::{Body, Record, State};
use std::time::Duration;

/// A device that runs the stages of a step.
pub trait Backend: Send {
    /// Name for reports: `cpu`, `gpu`.
    fn name(&self) -> &'static str;
    /// Name of the device, where it is not the processor.
    fn device(&self) -> Option<String> {
        None
    }
    /// Takes over a state; what the ledger counts since the beginning goes on.
    fn upload(&mut self, model: &Model, state: State);
    /// Changes the motion of bodies and agents between two steps.
    fn edit(&mut self, model: &Model, change: &mut dyn FnMut(&mut State));
    /// Sources were added, moved or taken away at a time (s).
    fn sources_changed(&mut self, _model: &Model, _time: f64) {}
    /// The particles where they are, on a device that pictures can be drawn on.
    #[cfg(feature = "gpu")]
    fn on_device(&self) -> Option<OnDevice> {
        None
    }
    /// Bodies and agents alone, where they come home faster than the whole state.
    fn movers(&self) -> Option<(Vec<Body>, Vec<Record>)> {
        None
    }
    /// Runs stages, one after another; says how long each took.
    fn run(&mut self, stages: &[Stage], model: &Model, advance: Advance) -> Vec<Duration>;
    /// Runs whole steps without the host between them; nothing where the backend or the scene does not allow that.
    fn queue(&mut self, _model: &Model, _request: Request) -> Option<Batch> {
        None
    }
    /// The present state.
    fn download(&self) -> &State;
    /// What the stage `ledger` found.
    fn ledger(&self) -> &Ledger;
    /// What went wrong with the device, if anything. It does nothing any more then.
    fn fault(&self) -> Option<&GpuError> {
        None
    }
}

/// Particles in the memory of a device, as the kernels have them: kind by kind, with gaps between the kinds.
#[cfg(feature = "gpu")]
#[derive(Clone, Debug)]
pub struct OnDevice {
    /// [`Record`]s.
    pub record: wgpu::Buffer,
    /// Acceleration (m/s^2) of fluids, force (N) on bodies' particles, and relative density: four `f32`.
    pub push: wgpu::Buffer,
    /// Identity, and index of the fluid or body: two `u32`.
    pub tag: wgpu::Buffer,
    /// First particle of each kind.
    pub first: [u32; 3],
    /// Particles of each kind.
    pub count: [u32; 3],
}

/// Steps that a backend is to make by itself.
#[derive(Clone, Copy, Debug)]
pub struct Request {
    /// Time now (s).
    pub time: f64,
    /// Time to go (s).
    pub left: f64,
    /// Length of the step before (s).
    pub dt_before: f64,
    /// Drag on fluids while a scene settles (1/s), else 0.
    pub drag: f64,
    /// Most steps.
    pub most: usize,
}

/// Steps that a backend made by itself.
#[derive(Clone, Debug, Default)]
pub struct Batch {
    /// Length (s), what bounded it, and what it left behind, step by step.
    pub steps: Vec<(f64, DtBound, Ledger)>,
    /// Time on the device by stage, in the order of a step.
    pub stages: Vec<Duration>,
}

/// Which backend a world runs on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// A GPU in fact, where there is one and the scene can run on it; else the processor.
    #[default]
    Auto,
    /// The processor.
    Cpu,
    /// A GPU, or a software driver where there is no other.
    Gpu,
}

/// Opens the backend of a choice for a scene, on a device that is `shared` with others where there is one, and says why it is not a GPU where `Auto` had to choose.
///
/// # Errors
/// `Gpu` where there is no device, or the scene cannot run on it.
pub fn open(
    choice: Choice,
    model: &Model,
    shared: Option<&Gpu>,
) -> Result<(Box<dyn Backend>, Option<String>), GpuError> {
    let why = match choice {
        Choice::Cpu => None,
        Choice::Gpu => return Ok((on_gpu(model, false, shared)?, None)),
        Choice::Auto => match on_gpu(model, true, shared) {
            Ok(backend) => return Ok((backend, None)),
            Err(why) => Some(why.to_string()),
        },
    };
    Ok((Box::new(Cpu::default()), why))
}

#[cfg(feature = "gpu")]
fn on_gpu(model: &Model, only_hardware: bool, shared: Option<&Gpu>) -> Result<Box<dyn Backend>, GpuError> {
    if let Some(what) = gpu::unsupported(model) {
        return Err(GpuError::Scene { what });
    }
    match shared {
        Some(gpu) if only_hardware && !gpu.info.is_hardware() => Err(GpuError::NoAdapter),
        Some(gpu) => Ok(Box::new(OnGpu::on(gpu.clone()))),
        None => Ok(Box::new(OnGpu::open(only_hardware)?)),
    }
}

#[cfg(not(feature = "gpu"))]
fn on_gpu(_model: &Model, _only_hardware: bool, _shared: Option<&Gpu>) -> Result<Box<dyn Backend>, GpuError> {
    Err(GpuError::NotBuilt)
}
