//! **jetsam** drops meshes into water.
pub mod assemble;
pub mod backend;
pub mod error;
pub mod gpu;
pub mod integrate;
pub mod interact;
pub mod laws;
pub mod ledger;
pub mod mesh;
pub mod model;
pub mod params;
pub mod random;
pub mod report;
pub mod scene;
pub mod stage;
pub mod state;
pub mod voxelize;
pub mod world;

pub use error::{Error, Result};
pub use report::{FrameStats, Recorder, Summary, state_hash};
pub use scene::Scene;
pub use world::{StepReport, World};
