//! Mesh files to [`Mesh`]: OBJ, STL (text and binary), PLY (text and binary), glTF and GLB.
//!
//! The readers are well-kept crates; what this file adds are limits that are checked before memory is taken, one
//! check of indices and coordinates at the end, and errors that name the file and the remedy. Polygons are cut into
//! fans. Materials, normals and texture coordinates are ignored. [`super::gltf`] has a chapter of its own.

use std::io::Cursor;
use std::path::Path;

use glam::DVec3;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};

use super::{Mesh, MeshError, MeshFault, gltf};

/// The most a mesh file may hold.
pub mod limits {
    /// Bytes of the file.
    pub const BYTES: u64 = 2 << 30;
    /// Vertices.
    pub const VERTICES: u64 = 100_000_000;
    /// Triangles.
    pub const TRIANGLES: u64 = 100_000_000;
}

/// A mesh file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshFormat {
    /// Wavefront OBJ, polygons and negative indices included.
    Obj,
    /// STL, text or binary.
    Stl,
    /// PLY, text or binary of either byte order.
    Ply,
    /// glTF 2.0, as JSON or as GLB.
    Gltf,
}

impl MeshFormat {
    /// The format a file name stands for, by its extension.
    pub fn of(path: &Path) -> Result<MeshFormat, MeshFault> {
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        match extension.as_str() {
            "obj" => Ok(MeshFormat::Obj),
            "stl" => Ok(MeshFormat::Stl),
            "ply" => Ok(MeshFormat::Ply),
            "gltf" | "glb" => Ok(MeshFormat::Gltf),
            _ => Err(MeshFault::UnknownFormat(extension)),
        }
    }
}

impl Mesh {
    /// Reads a mesh file; the extension says the format.
    ///
    /// # Errors
    /// The file cannot be read, is larger than [`limits`] allow, is not what its extension says, has no triangles,
    /// an index out of range or a coordinate that is not finite.
    pub fn load(path: &Path) -> Result<Mesh, MeshError> {
        let read = || {
            let format = MeshFormat::of(path)?;
            let unreadable = |e: std::io::Error| MeshFault::Unreadable(e.to_string());
            at_most("bytes", std::fs::metadata(path).map_err(unreadable)?.len(), limits::BYTES)?;
            let bytes = std::fs::read(path).map_err(unreadable)?;
            parse(format, &bytes, path.parent())
        };
        read().map_err(|fault| fault.of(path.display().to_string()))
    }

    /// Reads a mesh from the bytes of a file. Never panics, whatever the bytes.
    ///
    /// # Errors
    /// As [`Mesh::load`]; also a glTF that keeps its buffers in other files.
    pub fn from_bytes(format: MeshFormat, bytes: &[u8]) -> Result<Mesh, MeshError> {
        at_most("bytes", bytes.len() as u64, limits::BYTES)
            .and_then(|()| parse(format, bytes, None))
            .map_err(|fault| fault.of("<bytes>"))
    }
}

fn parse(format: MeshFormat, bytes: &[u8], folder: Option<&Path>) -> Result<Mesh, MeshFault> {
    let mesh = match format {
        MeshFormat::Obj => obj(bytes)?,
        MeshFormat::Stl => stl(bytes)?,
        MeshFormat::Ply => ply(bytes)?,
        MeshFormat::Gltf => gltf::read(bytes, folder)?,
    };
    at_most("vertices", mesh.vertices.len() as u64, limits::VERTICES)?;
    at_most("triangles", mesh.triangles.len() as u64, limits::TRIANGLES)?;
    mesh.check()?;
    Ok(mesh)
}

pub(super) fn at_most(what: &'static str, count: u64, limit: u64) -> Result<(), MeshFault> {
    if count > limit { Err(MeshFault::TooLarge { what, count, limit }) } else { Ok(()) }
}

pub(super) fn malformed(format: &'static str) -> impl Fn(String) -> MeshFault {
    move |what| MeshFault::Malformed { format, what }
}

fn obj(bytes: &[u8]) -> Result<Mesh, MeshFault> {
    let options =
        tobj::LoadOptions { triangulate: true, ignore_points: true, ignore_lines: true, ..Default::default() };
    let no_materials = |_: &Path| Ok(Default::default());
    let (models, _) = tobj::load_obj_buf(&mut Cursor::new(bytes), &options, no_materials)
        .map_err(|e| malformed("OBJ")(e.to_string()))?;
    let mut mesh = Mesh::default();
    for tobj::Model { mesh: part, .. } in models {
        let base = mesh.vertices.len() as u32;
        mesh.vertices.extend(part.positions.as_chunks::<3>().0.iter().map(|p| DVec3::from_array(p.map(f64::from))));
        mesh.triangles.extend(part.indices.as_chunks::<3>().0.iter().map(|t| t.map(|v| v.saturating_add(base))));
    }
    Ok(mesh)
}

fn stl(bytes: &[u8]) -> Result<Mesh, MeshFault> {
    // Many binary files begin with the word that marks text: the length tells them apart.
    let count = bytes.get(80..84).map_or(0, |n| u64::from(u32::from_le_bytes([n[0], n[1], n[2], n[3]])));
    let mut owned = Vec::new();
    let mut data = bytes;
    if bytes.len() as u64 == 84 + 50 * count && bytes.starts_with(b"solid") {
        owned.extend_from_slice(bytes);
        owned[..5].fill(b' ');
        data = &owned;
    }
    let read = stl_io::read_stl(&mut Cursor::new(data)).map_err(|e| malformed("STL")(e.to_string()))?;
    Ok(Mesh {
        vertices: read.vertices.iter().map(|v| DVec3::from_array(v.0.map(f64::from))).collect(),
        triangles: read.faces.iter().map(|f| f.vertices.map(|v| v as u32)).collect(),
    })
}

/// What is kept of one line of a PLY file: a position, or a polygon.
#[derive(Default)]
struct PlyItem {
    position: [f64; 3],
    polygon: Vec<u32>,
}

impl PropertyAccess for PlyItem {
    fn new() -> Self {
        PlyItem::default()
    }

    fn set_property(&mut self, key: &str, property: Property) -> PropertyAccessResult {
        let number = || match property {
            Property::Char(v) => f64::from(v),
            Property::UChar(v) => f64::from(v),
            Property::Short(v) => f64::from(v),
            Property::UShort(v) => f64::from(v),
            Property::Int(v) => f64::from(v),
            Property::UInt(v) => f64::from(v),
            Property::Float(v) => f64::from(v),
            Property::Double(v) => v,
            _ => f64::NAN,
        };
        match key {
            "x" => self.position[0] = number(),
            "y" => self.position[1] = number(),
            "z" => self.position[2] = number(),
            // A negative index becomes one that is out of range, and is refused with the others.
            "vertex_indices" | "vertex_index" => {
                self.polygon = match property {
                    Property::ListInt(v) => v.into_iter().map(|i| i as u32).collect(),
                    other => other.to_u32_list().unwrap_or_default(),
                }
            }
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

fn ply(bytes: &[u8]) -> Result<Mesh, MeshFault> {
    let fault = malformed("PLY");
    let parser = Parser::<PlyItem>::new();
    let mut reader = Reader::new(Cursor::new(bytes));
    let header = parser.read_header(&mut reader).map_err(|e| fault(e.to_string()))?;
    for (name, element) in &header.elements {
        // Every element takes at least a byte, so a count beyond the file's length is a lie.
        if element.count > bytes.len() || element.properties.is_empty() && element.count > 0 {
            return Err(fault(format!("{} elements {name:?} in {} bytes", element.count, bytes.len())));
        }
    }
    for (name, property) in [("vertex", "x"), ("vertex", "y"), ("vertex", "z"), ("face", "vertex_ind")] {
        let found = header.elements.get(name).is_some_and(|e| e.properties.keys().any(|k| k.starts_with(property)));
        if !found {
            return Err(fault(format!("element {name:?} has no property {property:?}")));
        }
    }
    let payload = parser.read_payload(&mut reader, &header).map_err(|e| fault(e.to_string()))?;
    let of = |name: &str| payload.get(name).map_or(&[][..], Vec::as_slice);
    let vertices = of("vertex").iter().map(|v| DVec3::from_array(v.position)).collect();
    let fan = |p: &PlyItem| {
        let p = p.polygon.clone();
        (2..p.len()).map(move |i| [p[0], p[i - 1], p[i]])
    };
    Ok(Mesh { vertices, triangles: of("face").iter().flat_map(fan).collect() })
}
