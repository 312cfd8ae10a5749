//! Triangle meshes: what the voxelizer eats.
//!
//! In: a file ([`Mesh::load`]), its bytes ([`Mesh::from_bytes`]) or a shape built in code ([`Mesh::ball`] and its like).
//! Out: vertices and triangles in the file's own units, a [`MeshReport`] that says what is wrong with them
//! ([`Mesh::report`]), and exact volume, centre of mass and inertia ([`Mesh::mass_properties`]).
//! Called by the scene (bodies, fluids and statics of shape `mesh`) and by [`crate::voxelize`].

mod error;
mod gltf;
mod load;
mod mass;
mod shapes;
pub(crate) mod topology;

use glam::{DAffine3, DVec3};

pub use error::{MeshError, MeshFault};
pub use load::{MeshFormat, limits};
pub use mass::MassProperties;
pub(crate) use mass::outer;
pub use topology::MeshReport;

/// A triangle mesh. Corners run counter-clockwise seen from outside.
///
/// Nothing is promised beyond the types: holes, flipped faces, overlapping parts, duplicate and zero-area triangles
/// are all allowed; [`Mesh::report`] names them and [`crate::voxelize`] copes with them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Corner positions, in the unit of the file (metres in a scene).
    pub vertices: Vec<DVec3>,
    /// Three indices into `vertices` each.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Lower and upper corner of the box around all triangles; `None` for a mesh without triangles.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let mut corners = self.triangles.iter().flat_map(|t| self.corners(*t));
        let first = corners.next()?;
        Some(corners.fold((first, first), |(lo, hi), v| (lo.min(v), hi.max(v))))
    }

    /// The same mesh with every vertex mapped by `map`. A mirroring map also swaps two corners of each
    /// triangle, so that outside stays outside.
    pub fn transformed(&self, map: DAffine3) -> Mesh {
        let mirrored = map.matrix3.determinant() < 0.0;
        Mesh {
            vertices: self.vertices.iter().map(|v| map.transform_point3(*v)).collect(),
            triangles: self.triangles.iter().map(|&[a, b, c]| if mirrored { [a, c, b] } else { [a, b, c] }).collect(),
        }
    }

    /// Both meshes as one.
    pub fn merged(mut self, other: &Mesh) -> Mesh {
        let base = self.vertices.len() as u32;
        self.vertices.extend_from_slice(&other.vertices);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + base)));
        self
    }

    /// The same surface with every triangle turned inside out.
    pub fn inverted(&self) -> Mesh {
        Mesh { vertices: self.vertices.clone(), triangles: self.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect() }
    }

    /// Total area of the triangles.
    pub fn area(&self) -> f64 {
        self.triangles
            .iter()
            .map(|&t| {
                let [a, b, c] = self.corners(t);
                0.5 * (b - a).cross(c - a).length()
            })
            .sum()
    }

    /// The three corner positions of a triangle.
    pub(crate) fn corners(&self, t: [u32; 3]) -> [DVec3; 3] {
        t.map(|v| self.vertices[v as usize])
    }

    /// Whether all indices are in range and all vertices finite; the fault otherwise.
    pub fn check(&self) -> Result<(), MeshFault> {
        let vertices = self.vertices.len();
        if let Some(vertex) = self.vertices.iter().position(|v| !v.is_finite()) {
            return Err(MeshFault::NotFinite { vertex });
        }
        match self.triangles.iter().position(|t| t.iter().any(|&v| v as usize >= vertices)) {
            Some(triangle) => Err(MeshFault::IndexOutOfRange { triangle, vertices }),
            None if self.triangles.is_empty() => Err(MeshFault::Empty),
            None => Ok(()),
        }
    }
}
