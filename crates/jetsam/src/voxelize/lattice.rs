//! Where the cells lie: spacing, number and place of the lattice for a mesh.
//!
//! In: the mesh and the options. Out: a [`Lattice`], checked against the limit before any grid is made.

use glam::{DAffine3, DVec3};

use super::raster::{Fixed, MAX_DIM, ONE};
use super::{Align, BitGrid, VoxelizeError, VoxelizeOptions};
use crate::mesh::Mesh;

/// A box of cells. Cell (i, j, k) has its centre at `frame` · (`origin` + `spacing` · (i, j, k)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lattice {
    pub spacing: f64,
    pub origin: DVec3,
    pub dims: [u32; 3],
}

/// The mesh as the lattice sees it, and the map from there to the world.
pub(crate) struct Placed {
    /// Mesh coordinates to lattice coordinates.
    pub to_lattice: DAffine3,
    /// Lattice coordinates to world coordinates.
    pub frame: DAffine3,
    pub lo: DVec3,
    pub hi: DVec3,
}

impl Placed {
    pub fn new(mesh: &Mesh, options: &VoxelizeOptions) -> Placed {
        let placement = DAffine3::from_rotation_translation(options.rotation.normalize(), options.offset);
        let (to_lattice, frame) = match options.align {
            Align::World => (placement, DAffine3::IDENTITY),
            Align::Body => (DAffine3::IDENTITY, placement),
        };
        let corners = mesh.triangles.iter().flatten().map(|v| to_lattice.transform_point3(mesh.vertices[*v as usize]));
        let (lo, hi) = corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
        Placed { to_lattice, frame, lo, hi }
    }

    /// The lattice of the given spacing around the mesh. In the world, cell centres lie at odd multiples of half the
    /// spacing, wherever the mesh is. On a body, the lattice is centred on the body's box, with as many cells
    /// along each side as fit best; `shift` asks for one cell more or less along x, y, z (bits 1, 2, 4).
    pub fn lattice(&self, spacing: f64, shift: u8, options: &VoxelizeOptions) -> Result<Lattice, VoxelizeError> {
        let margin = u32::from(options.thin);
        let (mut origin, mut dims) = ([0.0; 3], [0.0; 3]);
        for axis in 0..3 {
            let (lo, hi) = (self.lo[axis], self.hi[axis]);
            let (first, count) = match options.align {
                Align::World => {
                    let first = (lo / spacing).floor();
                    ((first + 0.5) * spacing, (hi / spacing).floor() - first + 1.0)
                }
                Align::Body => {
                    let across = (hi - lo) / spacing;
                    let mut count = across.round().max(1.0);
                    if shift >> axis & 1 == 1 {
                        count = if across >= count { count + 1.0 } else { (count - 1.0).max(1.0) };
                    }
                    (0.5 * (lo + hi) - 0.5 * (count - 1.0) * spacing, count)
                }
            };
            origin[axis] = first - f64::from(margin) * spacing;
            dims[axis] = count + 2.0 * f64::from(margin);
        }
        let cells: f64 = dims.iter().product();
        let row_bits = dims[0].div_euclid(64.0) * 64.0 + 64.0;
        let most = f64::from(MAX_DIM);
        if cells > options.max_cells as f64
            || row_bits * dims[1] * dims[2] > 64.0 * options.max_cells as f64
            || dims.iter().any(|d| *d > most)
        {
            let longest = (self.hi - self.lo).max_element();
            let shrink = (cells / options.max_cells as f64).cbrt().max(1.0);
            let fits = (spacing * shrink * 1.05).max(longest / (most - 4.0));
            return Err(VoxelizeError::TooManyCells { spacing, cells, limit: options.max_cells, fits });
        }
        Ok(Lattice { spacing, origin: origin.into(), dims: dims.map(|d| d as u32) })
    }
}

impl Lattice {
    /// The vertices of the mesh in lattice units, rounded to 2^-22 of a cell.
    pub fn snap(&self, mesh: &Mesh, placed: &Placed) -> Vec<Fixed> {
        let scale = 1.0 / self.spacing;
        let snap = |v: &DVec3| {
            let p = (placed.to_lattice.transform_point3(*v) - self.origin) * scale * ONE as f64;
            p.round().to_array().map(|x| x as i64)
        };
        mesh.vertices.iter().map(snap).collect()
    }

    /// An empty grid of these dimensions.
    pub fn grid(&self) -> BitGrid {
        BitGrid::new(self.dims)
    }
}
