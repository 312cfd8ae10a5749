//! Whatever the bytes, a mesh file gives a mesh or an error; and whatever the mesh, so does the voxelizer.
//! `cargo +nightly fuzz run mesh_bytes`. The first byte picks the format.
#![no_main]

use jetsam::mesh::{Mesh, MeshFormat};
use jetsam::voxelize::{Align, Resolution, Rule, VoxelizeOptions, sample_surface, voxelize};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((&pick, bytes)) = data.split_first() else { return };
    let formats = [MeshFormat::Obj, MeshFormat::Stl, MeshFormat::Ply, MeshFormat::Gltf];
    let Ok(mesh) = Mesh::from_bytes(formats[usize::from(pick % 4)], bytes) else { return };
    let report = mesh.report();
    assert_eq!(report.triangles, mesh.triangles.len());
    let bits = |n: u8| pick >> n & 1 == 1;
    let options = VoxelizeOptions {
        rule: if bits(2) { Rule::Parity } else { Rule::Winding },
        align: if bits(3) { Align::World } else { Align::Body },
        resolution: if bits(4) { Resolution::Particles(50) } else { Resolution::Across(9) },
        thin: bits(5),
        shell: bits(6).then_some(0.5),
        max_cells: 100_000,
        ..VoxelizeOptions::default()
    };
    if let Ok(voxels) = voxelize(&mesh, &options) {
        assert_eq!(voxels.points().len(), voxels.len());
    }
    if bits(7) && let Some((lo, hi)) = mesh.bounds() {
        let _ = sample_surface(&mesh, (hi - lo).length() / 8.0, 1).map(|points| assert!(points.len() < 1_000_000));
    }
});
