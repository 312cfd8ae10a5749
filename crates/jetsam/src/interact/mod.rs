//! Chapter 2, interaction: cells, neighbours and density, pressure, boundary pressure, forces, contacts of bodies.
//!
//! Each file is one stage; [`crate::backend::Cpu`] calls them in the order of [`crate::stage`].

pub mod boundary;
pub mod cells;
pub mod coarse;
pub mod contacts;
pub mod density;
pub mod forces;
pub mod gradients;
pub mod implicit;
pub mod kept;
pub mod lanes;
pub mod links;
pub mod neighbours;
pub mod pairs;
pub mod pressure;
pub mod slices;

/// Particles handled as one parallel task. Fixed: sums over tasks are added in task order, so that no result
/// depends on the number of threads.
pub const CHUNK: usize = 512;
