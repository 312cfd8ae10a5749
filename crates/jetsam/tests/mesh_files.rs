//! Mesh files in all formats: the same box comes out of each, and what is wrong with a file is named.

use std::path::Path;

use glam::{DAffine3, DVec3};
use jetsam::mesh::{Mesh, MeshFault, MeshFormat};

fn cuboid() -> Mesh {
    Mesh::cuboid(DVec3::new(-1.0, 0.0, 0.5), DVec3::new(1.0, 1.5, 2.0))
}

fn is_the_box(mesh: &Mesh) {
    assert_eq!(mesh.triangles.len(), 12);
    let report = mesh.report();
    assert!(report.watertight && report.boundary_edges == 0 && report.shells == 1, "{report:?}");
    let mass = mesh.mass_properties();
    assert!((mass.volume - 4.5).abs() < 1e-12, "{}", mass.volume);
    assert!(mass.com.distance(DVec3::new(0.0, 0.75, 1.25)) < 1e-12);
}

fn fault(format: MeshFormat, bytes: &[u8]) -> MeshFault {
    Mesh::from_bytes(format, bytes).expect_err("a broken file").fault
}

fn obj(mesh: &Mesh) -> String {
    let v: String = mesh.vertices.iter().map(|v| format!("v {} {} {}\n", v.x, v.y, v.z)).collect();
    let f = mesh.triangles.iter().map(|t| format!("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1));
    v + &f.collect::<String>()
}

fn stl_text(mesh: &Mesh) -> String {
    let corner = |v: &u32| {
        let v = mesh.vertices[*v as usize];
        format!("vertex {} {} {}\n", v.x, v.y, v.z)
    };
    let facet = |t: &[u32; 3]| {
        let corners: String = t.iter().map(corner).collect();
        format!("facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n")
    };
    format!("solid box\n{}endsolid box\n", mesh.triangles.iter().map(facet).collect::<String>())
}

fn stl_binary(mesh: &Mesh, header: &[u8]) -> Vec<u8> {
    let mut bytes = header.to_vec();
    bytes.resize(80, 0);
    bytes.extend((mesh.triangles.len() as u32).to_le_bytes());
    for t in &mesh.triangles {
        bytes.extend([0; 12]);
        for x in t.iter().flat_map(|v| mesh.vertices[*v as usize].to_array()) {
            bytes.extend((x as f32).to_le_bytes());
        }
        bytes.extend([0; 2]);
    }
    bytes
}

fn ply(mesh: &Mesh, encoding: &str) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat {encoding} 1.0\ncomment a box\nelement vertex {}\nproperty float x\nproperty double y\n\
         property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.vertices.len(),
        mesh.triangles.len()
    )
    .into_bytes();
    let big = encoding == "binary_big_endian";
    let ascii = encoding == "ascii";
    for v in &mesh.vertices {
        if ascii {
            bytes.extend(format!("{} {} {}\n", v.x, v.y, v.z).bytes());
            continue;
        }
        let (x, y, z) = (v.x as f32, v.y, v.z as f32);
        bytes.extend(if big { x.to_be_bytes() } else { x.to_le_bytes() });
        bytes.extend(if big { y.to_be_bytes() } else { y.to_le_bytes() });
        bytes.extend(if big { z.to_be_bytes() } else { z.to_le_bytes() });
    }
    for t in &mesh.triangles {
        if ascii {
            bytes.extend(format!("3 {} {} {}\n", t[0], t[1], t[2]).bytes());
            continue;
        }
        bytes.push(3);
        for v in t.map(|v| v as i32) {
            bytes.extend(if big { v.to_be_bytes() } else { v.to_le_bytes() });
        }
    }
    bytes
}

/// A GLB whose mesh is moved into place by two nodes, one of them mirroring if asked.
fn glb(mesh: &Mesh, nodes: &str) -> Vec<u8> {
    let mut bin: Vec<u8> = Vec::new();
    bin.extend(mesh.vertices.iter().flat_map(|v| v.to_array()).flat_map(|x| (x as f32).to_le_bytes()));
    let indices = bin.len();
    bin.extend(mesh.triangles.iter().flatten().flat_map(|v| (*v as u16).to_le_bytes()));
    while !bin.len().is_multiple_of(4) {
        bin.push(0);
    }
    let n = mesh.vertices.len();
    let m = 3 * mesh.triangles.len();
    let mut json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":{nodes},
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "buffers":[{{"byteLength":{}}}],
        "bufferViews":[{{"buffer":0,"byteOffset":0,"byteLength":{indices}}},
                       {{"buffer":0,"byteOffset":{indices},"byteLength":{}}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":{n},"type":"VEC3","min":[-9,-9,-9],"max":[9,9,9]}},
                     {{"bufferView":1,"componentType":5123,"count":{m},"type":"SCALAR"}}]}}"#,
        bin.len(),
        2 * m
    )
    .into_bytes();
    while !json.len().is_multiple_of(4) {
        json.push(b' ');
    }
    let mut bytes = b"glTF".to_vec();
    for word in [2, (12 + 8 + json.len() + 8 + bin.len()) as u32, json.len() as u32, 0x4e4f_534a] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.extend(json);
    bytes.extend((bin.len() as u32).to_le_bytes());
    bytes.extend(0x004e_4942u32.to_le_bytes());
    bytes.extend(bin);
    bytes
}

#[test]
fn the_same_box_from_every_format() {
    let mesh = cuboid();
    is_the_box(&mesh);
    let half = mesh.transformed(DAffine3::from_scale(DVec3::splat(0.5)));
    let nodes = r#"[{"children":[1],"scale":[2,2,2]},{"mesh":0}]"#;
    let files = [
        (MeshFormat::Obj, obj(&mesh).into_bytes()),
        (MeshFormat::Stl, stl_text(&mesh).into_bytes()),
        (MeshFormat::Stl, stl_binary(&mesh, b"a box")),
        (MeshFormat::Stl, stl_binary(&mesh, b"solid although it is binary")),
        (MeshFormat::Ply, ply(&mesh, "ascii")),
        (MeshFormat::Ply, ply(&mesh, "binary_little_endian")),
        (MeshFormat::Ply, ply(&mesh, "binary_big_endian")),
        (MeshFormat::Gltf, glb(&half, nodes)),
    ];
    for (format, bytes) in files {
        is_the_box(&Mesh::from_bytes(format, &bytes).expect("a good file"));
    }
}

#[test]
fn a_mirrored_node_keeps_outside_outside() {
    let nodes = r#"[{"children":[1],"scale":[-1,1,1]},{"mesh":0}]"#;
    let mesh = Mesh::from_bytes(MeshFormat::Gltf, &glb(&cuboid(), nodes)).expect("a good file");
    assert!((mesh.mass_properties().volume - 4.5).abs() < 1e-6, "{}", mesh.mass_properties().volume);
}

#[test]
fn polygons_negative_indices_and_groups() {
    let text = "o a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
                f 4 3 2 1\nf -4 -3 -2 -1\ng other\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\nl 1 2\n";
    let mesh = Mesh::from_bytes(MeshFormat::Obj, text.as_bytes()).expect("a good file");
    assert_eq!(mesh.triangles.len(), 12);
    assert!((mesh.mass_properties().volume - 1.0).abs() < 1e-12 && mesh.report().watertight);
}

#[test]
fn files_are_found_by_extension_and_errors_name_them() {
    let folder = std::env::temp_dir().join(format!("jetsam-mesh-files-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let path = folder.join("box.OBJ");
    std::fs::write(&path, obj(&cuboid())).expect("a file");
    is_the_box(&Mesh::load(&path).expect("a good file"));

    let broken = folder.join("broken.obj");
    std::fs::write(&broken, "v 0 0 0\nv 1 0 0\nf 1 2 9\n").expect("a file");
    let error = Mesh::load(&broken).expect_err("a broken file");
    assert!(error.to_string().contains("broken.obj") && !error.help.is_empty(), "{error}");
    std::fs::remove_dir_all(&folder).expect("the folder goes");

    let missing = Mesh::load(Path::new("no/such/mesh.stl")).expect_err("no file");
    assert!(matches!(missing.fault, MeshFault::Unreadable(_)) && missing.to_string().contains("no/such/mesh.stl"));
    let strange = Mesh::load(Path::new("mesh.fbx")).expect_err("no format");
    assert_eq!(strange.fault, MeshFault::UnknownFormat("fbx".into()));
}

#[test]
fn broken_bytes_are_errors() {
    use MeshFormat::*;
    for format in [Obj, Stl, Ply, Gltf] {
        for bytes in [&b""[..], b"solid", b"ply\n", b"glTF", b"\xff\xfe\x00\x01", &[0; 200]] {
            fault(format, bytes);
        }
    }
    assert_eq!(fault(Obj, b"v 0 0 0\n"), MeshFault::Empty);
    assert_eq!(fault(Obj, b"v 0 0 0\nv 1 nan 0\nv 1 1 0\nf 1 2 3\n"), MeshFault::NotFinite { vertex: 1 });
    // Cut short, and counts that lie.
    let mesh = cuboid();
    for (format, bytes) in [
        (Stl, stl_binary(&mesh, b"")),
        (Ply, ply(&mesh, "ascii")),
        (Ply, ply(&mesh, "binary_little_endian")),
        (Gltf, glb(&mesh, r#"[{"mesh":0}]"#)),
    ] {
        for cut in [2, 10, 90] {
            fault(format, &bytes[..bytes.len() - cut]);
        }
    }
    let mut lie = stl_binary(&mesh, b"");
    lie[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    fault(Stl, &lie);
    for count in ["4000000000", "18446744073709551615", "-1"] {
        let text = String::from_utf8(ply(&mesh, "ascii")).expect("text").replace("face 12", &format!("face {count}"));
        fault(Ply, text.as_bytes());
        let empty = format!("ply\nformat binary_little_endian 1.0\nelement thing {count}\nend_header\n");
        fault(Ply, empty.as_bytes());
    }
    let text = String::from_utf8(ply(&mesh, "ascii")).expect("text");
    let negative = text.replace("3 0 4 6\n", "3 0 -4 6\n");
    assert_ne!(text, negative);
    assert_eq!(fault(Ply, negative.as_bytes()), MeshFault::IndexOutOfRange { triangle: 0, vertices: 8 });
    // A glTF that asks for other files, or whose nodes run in a circle.
    for uri in ["../../secret.bin", "/etc/passwd", "file:///etc/passwd", "a%FFb.bin", "x.bin"] {
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[]}}],"buffers":[{{"byteLength":4,"uri":"{uri}"}}]}}"#
        );
        assert!(fault(Gltf, json.as_bytes()).to_string().contains("buffer"), "{uri}");
    }
    fault(Gltf, &glb(&mesh, r#"[{"mesh":0,"children":[1]},{"children":[0]}]"#));
}

#[test]
fn what_fuzzing_found_in_glb() {
    let good = glb(&cuboid(), r#"[{"mesh":0}]"#);
    is_the_box(&Mesh::from_bytes(MeshFormat::Gltf, &good).expect("a good file"));
    // A header whose length is shorter than the header, and a version from nowhere.
    for (at, value) in [(8, 4u32), (4, 1), (12, u32::MAX), (16, 0)] {
        let mut bytes = good.clone();
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        let read = Mesh::from_bytes(MeshFormat::Gltf, &bytes);
        assert!(read.is_err() || at == 8, "word {at}");
    }
    // Accessors, views, meshes and nodes that are not there. The key is misspelt so that the list is empty.
    for key in ["accessors", "bufferViews", "buffers", "meshes", "scenes"] {
        let from = format!("\"{key}\"").into_bytes();
        let at = good.windows(from.len()).position(|w| w == from).expect("the key");
        let mut bytes = good.clone();
        bytes[at + 1] = b'#';
        fault(MeshFormat::Gltf, &bytes);
    }
    fault(MeshFormat::Gltf, &glb(&cuboid(), r#"[{"children":[7]}]"#));
}
