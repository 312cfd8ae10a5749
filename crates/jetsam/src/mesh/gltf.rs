//! glTF 2.0 and GLB to [`Mesh`]: all triangles of the scene, with their nodes' transforms, joined.
//!
//! The crate `gltf` reads the JSON and decodes embedded buffers. Its checked front door trusts the file's indices
//! while it checks them, so everything here goes by index and asks whether the thing is there.

use std::path::{Component, Path};

use ::gltf::Semantic;
use ::gltf::buffer::{Data, Source};
use ::gltf::json::accessor::{ComponentType, Type};
use ::gltf::json::mesh::{Mode, Primitive};
use ::gltf::json::scene::Node;
use ::gltf::json::validation::Checked::Valid;
use ::gltf::json::{Accessor, Index, Root, deserialize};
use glam::{DMat4, DQuat, DVec3, Mat4, Quat, Vec3};

use super::load::{at_most, limits, malformed};
use super::{Mesh, MeshFault};

/// Reads the bytes of a file. Buffers may lie in it, or in `folder`.
pub(super) fn read(bytes: &[u8], folder: Option<&Path>) -> Result<Mesh, MeshFault> {
    let fault = malformed("glTF");
    let (json, mut blob) = match bytes.starts_with(b"glTF") {
        true => chunks(bytes).ok_or_else(|| fault("the GLB container is damaged".into()))?,
        false => (bytes, None),
    };
    let root: Root = deserialize::from_slice(json).map_err(|e| fault(e.to_string()))?;
    let mut buffers = Vec::new();
    for buffer in &root.buffers {
        let source = buffer.uri.as_deref().map_or(Source::Bin, Source::Uri);
        if let Source::Uri(uri) = source {
            check_uri(uri, folder).map_err(&fault)?;
        }
        let data = Data::from_source_and_blob(source, folder, &mut blob);
        buffers.push(data.map_err(|e| fault(e.to_string()))?.0);
    }
    let mut mesh = Mesh::default();
    let mut visited = vec![false; root.nodes.len()];
    let scene = root.scene.map_or(0, |s| s.value());
    let tops = root.scenes.get(scene).map_or(&[][..], |s| &s.nodes);
    let mut pending: Vec<(Index<Node>, DMat4)> = tops.iter().map(|n| (*n, DMat4::IDENTITY)).collect();
    while let Some((index, parent)) = pending.pop() {
        let at = index.value();
        let node = root.nodes.get(at).ok_or_else(|| fault(format!("node {at} is not there")))?;
        if std::mem::replace(&mut visited[at], true) {
            return Err(fault(format!("node {at} has two parents or is its own ancestor")));
        }
        let world = parent * transform(node);
        pending.extend(node.children.iter().flatten().map(|child| (*child, world)));
        if let Some(index) = node.mesh {
            let part = root.meshes.get(index.value());
            let part = part.ok_or_else(|| fault(format!("mesh {} is not there", index.value())))?;
            for primitive in &part.primitives {
                add(&mut mesh, &root, primitive, &buffers, world).map_err(&fault)?;
            }
        }
        at_most("vertices", mesh.vertices.len() as u64, limits::VERTICES)?;
        at_most("triangles", mesh.triangles.len() as u64, limits::TRIANGLES)?;
    }
    Ok(mesh)
}

/// The JSON chunk of a GLB, and the binary one if there is one.
fn chunks(bytes: &[u8]) -> Option<(&[u8], Option<Vec<u8>>)> {
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
    let chunk = |at: usize| {
        let data = bytes.get(at + 8..)?.get(..word(at)? as usize)?;
        Some((word(at + 4)?, data))
    };
    let (kind, json) = chunk(12)?;
    if word(4)? != 2 || kind != u32::from_le_bytes(*b"JSON") {
        return None;
    }
    let binary = 20 + json.len().next_multiple_of(4);
    let blob = match chunk(binary) {
        Some((kind, data)) if kind == u32::from_le_bytes(*b"BIN\0") => Some(data.to_vec()),
        None if binary < bytes.len() => return None,
        _ => None,
    };
    Some((json, blob))
}

/// Buffers may lie in the file itself or beside it, nowhere else.
fn check_uri(uri: &str, folder: Option<&Path>) -> Result<(), String> {
    let plain = |c| matches!(c, Component::Normal(_));
    let beside = || !uri.contains([':', '%']) && Path::new(uri).components().all(plain);
    match uri.starts_with("data:") || folder.is_some() && beside() {
        true => Ok(()),
        false => {
            Err(format!("buffer {uri:.60?} is neither embedded nor a plain file name beside the mesh; export as GLB"))
        }
    }
}

fn transform(node: &Node) -> DMat4 {
    if let Some(matrix) = &node.matrix {
        return Mat4::from_cols_array(matrix).as_dmat4();
    }
    let vector = |v: Option<[f32; 3]>, default: DVec3| v.map_or(default, |v| Vec3::from_array(v).as_dvec3());
    let rotation = node.rotation.map_or(DQuat::IDENTITY, |q| Quat::from_array(q.0).as_dquat());
    let (scale, translation) = (vector(node.scale, DVec3::ONE), vector(node.translation, DVec3::ZERO));
    DMat4::from_translation(translation) * DMat4::from_quat(rotation) * DMat4::from_scale(scale)
}

/// Appends the triangles of a primitive. Points and lines are passed over.
fn add(mesh: &mut Mesh, root: &Root, part: &Primitive, buffers: &[Vec<u8>], world: DMat4) -> Result<(), String> {
    let Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) = part.mode else {
        return Ok(());
    };
    let positions = part.attributes.get(&Valid(Semantic::Positions)).ok_or("a primitive has no positions")?;
    let (base, first) = (mesh.vertices.len() as u32, mesh.triangles.len());
    let (kind, items) = items(root, *positions, Type::Vec3, buffers)?;
    if kind != ComponentType::F32 {
        return Err("positions are not floats".into());
    }
    for item in items {
        let number = |at: usize| f64::from(f32::from_le_bytes([item[at], item[at + 1], item[at + 2], item[at + 3]]));
        mesh.vertices.push(world.transform_point3(DVec3::new(number(0), number(4), number(8))));
    }
    let count = mesh.vertices.len() as u32 - base;
    let indices: Vec<u32> = match part.indices {
        None => (0..count).collect(),
        Some(accessor) => {
            let (_, items) = self::items(root, accessor, Type::Scalar, buffers)?;
            items.map(|item| item.iter().rev().fold(0, |n, byte| n << 8 | u32::from(*byte))).collect()
        }
    };
    if indices.iter().any(|i| *i >= count) {
        return Err(format!("an index is beyond the {count} vertices of its primitive"));
    }
    let corner = |i: usize| base + indices[i];
    let n = indices.len();
    match mode {
        Mode::Triangles => mesh.triangles.extend((0..n / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2].map(corner))),
        Mode::TriangleFan => mesh.triangles.extend((2..n).map(|i| [0, i - 1, i].map(corner))),
        _ => mesh.triangles.extend((2..n).map(|i| [i - 2, i - 1 + i % 2, i - i % 2].map(corner))),
    }
    if world.determinant() < 0.0 {
        mesh.triangles[first..].iter_mut().for_each(|t| t.swap(1, 2));
    }
    Ok(())
}

/// The type and the raw items of an accessor, after checking that its view and its buffer hold them.
fn items<'a>(
    root: &Root,
    accessor: Index<Accessor>,
    shape: Type,
    buffers: &'a [Vec<u8>],
) -> Result<(ComponentType, impl Iterator<Item = &'a [u8]> + use<'a>), String> {
    let accessor = root.accessors.get(accessor.value()).ok_or("an accessor is not there")?;
    let (Valid(kind), Valid(found)) = (accessor.component_type, accessor.type_) else {
        return Err("an accessor has an unknown type".into());
    };
    let whole = matches!(kind.0, ComponentType::U8 | ComponentType::U16 | ComponentType::U32);
    if found != shape || shape == Type::Scalar && !whole {
        return Err("an accessor has an unexpected type".into());
    }
    if accessor.sparse.is_some() {
        return Err("sparse accessors are not supported".into());
    }
    let view = accessor.buffer_view.ok_or("an accessor has no buffer view (is the mesh compressed?)")?;
    let view = root.buffer_views.get(view.value()).ok_or("a buffer view is not there")?;
    let short = || String::from("a buffer is shorter than its accessors say");
    let number = |n: u64| usize::try_from(n).map_err(|_| short());
    let size = kind.0.size() * if shape == Type::Vec3 { 3 } else { 1 };
    let stride = view.byte_stride.map_or(size, |s| s.0);
    let from = number(view.byte_offset.map_or(0, |o| o.0))?;
    let to = from.checked_add(number(view.byte_length.0)?).ok_or_else(short)?;
    let offset = number(accessor.byte_offset.map_or(0, |o| o.0))?;
    let data = buffers.get(view.buffer.value()).and_then(|b| b.get(from..to)?.get(offset..)).ok_or_else(short)?;
    let count = number(accessor.count.0)?;
    let needed = count.checked_sub(1).map_or(Some(0), |last| last.checked_mul(stride)?.checked_add(size));
    match needed {
        Some(bytes) if bytes <= data.len() && stride >= size => {
            Ok((kind.0, (0..count).map(move |i| &data[i * stride..i * stride + size])))
        }
        _ => Err(short()),
    }
}
