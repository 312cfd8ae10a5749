//! What the user asks of the voxelizer, and how that can fail.

use glam::{DQuat, DVec3};
use miette::Diagnostic;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::gpu::GpuError;
use crate::mesh::MeshFault;

/// When a cell is solid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Rule {
    /// Where the surface is passed an odd number of times on the way in (the article's XOR). Overlapping parts leave
    /// cavities. Rows that pass through a hole are noticed and decided by winding number.
    Parity,
    /// Where the surface goes round the cell: |generalised winding number| > 1/2. Forgives holes, flipped faces,
    /// duplicate and overlapping parts.
    #[default]
    Winding,
}

/// How fine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Resolution {
    /// Distance between neighbouring particles, in mesh units.
    Spacing(f64),
    /// Cells across the longest side of the mesh's box.
    Across(u32),
    /// Wanted number of particles. Met within 2 % where some lattice gives such a number; the report warns where
    /// none was found.
    Particles(u64),
}

/// What the lattice's axes follow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Align {
    /// The mesh's own axes; the lattice is centred on the mesh and turns with it.
    #[default]
    Body,
    /// The world's axes: cell centres at odd multiples of half the spacing, wherever the mesh is.
    World,
}

/// What does the work. The cells are the same to the last bit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Backend {
    /// The processor.
    #[default]
    Cpu,
    /// The parity rule on a GPU, or on a software driver where there is no other; an error where there is neither.
    Gpu,
    /// The parity rule on a GPU if there is one in fact; else the processor.
    Auto,
}

/// Options of [`super::voxelize`].
#[derive(Clone, Debug, PartialEq)]
pub struct VoxelizeOptions {
    /// When a cell is solid. Default: winding.
    pub rule: Rule,
    /// How fine. Default: 32 cells across.
    pub resolution: Resolution,
    /// Where the mesh's origin goes, after the rotation. Default: zero.
    pub offset: DVec3,
    /// How the mesh is turned about its origin. Default: not.
    pub rotation: DQuat,
    /// What the lattice's axes follow. Default: the body.
    pub align: Align,
    /// Keep what is thinner than two cells: where no block of 2x2x2 solid cells is near, all cells the surface touches
    /// become solid. Default: no.
    pub thin: bool,
    /// Keep only a shell of this thickness under the surface, in mesh units. Default: the whole solid.
    pub shell: Option<f64>,
    /// The largest number of cells a grid may have. One grid of one bit a cell (rows rounded up to 64) is held, two
    /// more with `shell`, three more with `thin`. Default: 2^33, one gibibyte a grid.
    pub max_cells: u64,
}

impl Default for VoxelizeOptions {
    fn default() -> Self {
        VoxelizeOptions {
            rule: Rule::default(),
            resolution: Resolution::Across(32),
            offset: DVec3::ZERO,
            rotation: DQuat::IDENTITY,
            align: Align::default(),
            thin: false,
            shell: None,
            max_cells: 1 << 33,
        }
    }
}

impl VoxelizeOptions {
    /// Whether every number makes sense.
    pub(super) fn check(&self) -> Result<(), VoxelizeError> {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        let bad = |option, value: String| Err(VoxelizeError::Option { option, value });
        match self.resolution {
            Resolution::Spacing(h) if !positive(h) => return bad("spacing", h.to_string()),
            Resolution::Across(0) => return bad("resolution", "0".into()),
            Resolution::Particles(0) => return bad("particles", "0".into()),
            _ => {}
        }
        match self.shell {
            Some(t) if !positive(t) => bad("shell", t.to_string()),
            _ if !self.offset.is_finite() => bad("offset", self.offset.to_string()),
            _ if !(self.rotation.is_finite() && self.rotation.length() > 0.0) => {
                bad("rotation", self.rotation.to_string())
            }
            _ => Ok(()),
        }
    }
}

/// Why a mesh was not turned into particles.
#[derive(Clone, Debug, Error, Diagnostic, PartialEq)]
pub enum VoxelizeError {
    /// The mesh cannot be used.
    #[error("the mesh {0}")]
    #[diagnostic(
        code(jetsam::voxelize::mesh),
        help("`jetsam voxelize --json` on the file tells more; export it again")
    )]
    Mesh(MeshFault),
    /// The GPU asked for did not do it.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Gpu(GpuError),
    /// All triangles lie in one point.
    #[error("the mesh has no extent")]
    #[diagnostic(code(jetsam::voxelize::point), help("check the mesh's scale: all its vertices lie in one point"))]
    Point,
    /// An option is out of range.
    #[error("{option} = {value} must be positive and finite")]
    #[diagnostic(code(jetsam::voxelize::option))]
    Option {
        /// Its name.
        option: &'static str,
        /// What was given.
        value: String,
    },
    /// The grid would be too large.
    #[error("a spacing of {spacing} needs {cells:.0} cells, more than the {limit} allowed")]
    #[diagnostic(code(jetsam::voxelize::memory), help("a spacing of {fits:.3e} fits"))]
    TooManyCells {
        /// The spacing asked for.
        spacing: f64,
        /// The cells it needs.
        cells: f64,
        /// The cells allowed.
        limit: u64,
        /// A spacing that needs no more than that.
        fits: f64,
    },
    /// A surface sample would be too large.
    #[error("a spacing of {spacing} needs {points:.0} points, more than the {limit} allowed")]
    #[diagnostic(code(jetsam::voxelize::memory), help("a spacing of {fits:.3e} fits"))]
    TooManyPoints {
        /// The spacing asked for.
        spacing: f64,
        /// The points it needs.
        points: f64,
        /// The points allowed.
        limit: u64,
        /// A spacing that needs no more than that.
        fits: f64,
    },
}
