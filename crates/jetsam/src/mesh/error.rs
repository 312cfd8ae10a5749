//! What can be wrong with a mesh file, and what to do about it.

use miette::Diagnostic;
use thiserror::Error;

/// A mesh that cannot be used: which file, what is wrong, and the remedy (miette `help`).
#[derive(Debug, Error, Diagnostic)]
#[error("mesh {name}: {fault}")]
#[diagnostic(code(jetsam::mesh))]
pub struct MeshError {
    /// The path of the file, or `<bytes>`.
    pub name: String,
    /// What is wrong.
    pub fault: MeshFault,
    /// What to do about it.
    #[help]
    pub help: String,
}

/// What is wrong with a mesh.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum MeshFault {
    /// The file could not be read.
    #[error("cannot be read: {0}")]
    Unreadable(String),
    /// The extension is none of obj, stl, ply, gltf, glb.
    #[error("format {0:?} is not known")]
    UnknownFormat(String),
    /// The bytes are not what the format says.
    #[error("is not well-formed {format}: {what}")]
    Malformed {
        /// Name of the format.
        format: &'static str,
        /// What the reader tripped over, with its position where known.
        what: String,
    },
    /// More bytes, vertices or triangles than [`super::limits`] allow.
    #[error("has {count} {what}, the limit is {limit}")]
    TooLarge {
        /// What was counted.
        what: &'static str,
        /// How many there are.
        count: u64,
        /// How many are allowed.
        limit: u64,
    },
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} is not finite")]
    NotFinite {
        /// Index of the first such vertex, from 0.
        vertex: usize,
    },
    /// A triangle names a vertex that is not there.
    #[error("triangle {triangle} names a vertex beyond the {vertices} there are")]
    IndexOutOfRange {
        /// Index of the first such triangle, from 0.
        triangle: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// There is no triangle.
    #[error("has no triangles")]
    Empty,
}

impl MeshFault {
    /// The error for the mesh called `name`.
    pub fn of(self, name: impl Into<String>) -> MeshError {
        MeshError { name: name.into(), help: self.remedy(), fault: self }
    }

    /// What the user can do about it.
    pub fn remedy(&self) -> String {
        match self {
            MeshFault::Unreadable(_) => {
                "check the path (paths in a scene are relative to the scene file) and its permissions".into()
            }
            MeshFault::UnknownFormat(_) => "export the model as OBJ, STL, PLY, glTF or GLB, with that extension".into(),
            MeshFault::Malformed { .. } => {
                "export the model again; a text editor shows whether a download was cut short".into()
            }
            MeshFault::TooLarge { .. } => "decimate the model, or split it into several files".into(),
            MeshFault::NotFinite { .. } => "delete the broken vertices in a modeller and export again".into(),
            MeshFault::IndexOutOfRange { .. } => "the file is damaged or cut short: export the model again".into(),
            MeshFault::Empty => {
                "export faces, not only points, lines or curves (apply modifiers, convert curves to a mesh)".into()
            }
        }
    }
}
