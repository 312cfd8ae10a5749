//! **jetsam** drops meshes into water: one world of particles for rigid bodies, fluids and flocks, every kind
//! acting on every other.
//!
//! It takes up the system of Young and Erlebacher, "Particle Systems for Real-Time Rigid-body, Fluid, and Flocking
//! simulations": a triangle mesh becomes particles ([`voxelize`]), forces act between particles ([`interact`]) and are
//! summed per body, and everything is integrated by leapfrog ([`integrate`]). Every law is written once, in [`laws`].
//!
//! ```
//! use jetsam::{Scene, World};
//!
//! let scene = Scene::open("dam-break", &["resolution.spacing=0.1".into()])?;
//! let mut world = World::from_scene(&scene)?;
//! world.advance(0.2, |_, step| step.trouble.is_none());
//! let front = world.fluid().map(|p| p.x[0]).fold(0.0, f32::max);
//! println!("after {} steps the front is at {front:.2} m", world.steps());
//! assert!(front > 1.0 && world.ledger().lost == 0);
//! # Ok::<(), Box<jetsam::Error>>(())
//! ```
//!
//! # The step
//!
//! [`World::step`] chooses a time step (E29) and runs the stages in the order that [`stage`] holds:
//!
//! | stage | what it does | where |
//! |---|---|---|
//! | drift | half a kick; particles and bodies move (E20, E21) | [`integrate`] |
//! | sources | fluid born and drained (E31) | [`integrate::sources`] |
//! | cells | particles sorted into cells as wide as the support | [`interact::cells`] |
//! | density | neighbours, found once; densities (E1) | [`interact::density`] |
//! | pressure | equation of state (E3) | [`interact::pressure`] |
//! | boundary | what fluids show to bodies and walls (E17) | [`interact::boundary`] |
//! | gradients | colour gradients and vorticities, where asked for (E7, E8) | [`interact::gradients`] |
//! | forces | all pairs (E4-E8, E10-E13, E16, E30) | [`interact::forces`] |
//! | agents | flocks move and decide (E22-E28) | [`mod@flock`] |
//! | bodies | force and torque of each body (E18) | [`integrate::bodies`] |
//! | kick | the second half of the kick (E20) | [`integrate`] |
//! | ledger | momentum, energy, what was lost, what bounds the next step | [`ledger`] |
//!
//! The numbers E1.. are those of `docs/physics.md`. Units are SI, z points up.

pub mod assemble;
pub mod backend;
pub mod error;
pub mod flock;
pub mod formula;
pub mod gpu;
pub mod integrate;
pub mod interact;
pub mod laws;
pub mod ledger;
pub mod mesh;
pub mod model;
pub mod params;
pub mod probe;
pub mod random;
pub mod report;
pub mod scene;
pub mod stage;
pub mod state;
pub mod validate;
pub mod voxelize;
pub mod world;

/// The README's example, kept true.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;

pub use backend::Choice;
pub use error::{Error, Result};
pub use report::{FrameStats, Recorder, Summary, state_hash};
pub use scene::Scene;
pub use world::{StepReport, Trouble, World};
