//! **jetsam** drops meshes into water.
#![forbid(unsafe_op_in_unsafe_fn)]

pub mod mesh;
pub mod voxelize;
