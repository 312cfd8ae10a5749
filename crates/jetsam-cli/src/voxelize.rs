//! `jetsam voxelize`: a mesh becomes particles.

use crate::output::{self, pictures, ply};
use crate::terminal::{print, print_json, say, table};
use crate::{Outcome, args};
use glam::{DQuat, DVec3};
use jetsam::mesh::Mesh;
use jetsam::voxelize::{Resolution, VoxelReport, VoxelizeOptions, Voxelizer};
use miette::IntoDiagnostic;
use std::io::Write;
use std::path::Path;

/// Fills a mesh, once or in a series.
pub fn voxelize(args: &args::Voxelize) -> miette::Result<Outcome> {
    let mesh = Mesh::load(&args.mesh)?;
    let mut options = options(args)?;
    let voxelizer = Voxelizer::new(args.backend.into())?;
    let Some(count) = args.series else {
        let voxels = voxelizer.voxelize(&mesh, &options)?;
        if let Some(path) = &args.out {
            let mut file = output::create(path)?;
            ply::write_points(&mut file, &voxels.points()).and_then(|()| file.flush()).map_err(output::at(path))?;
        }
        show(&voxels.report, args.json);
        return Ok(Outcome::Fine);
    };
    let folder = args.out.as_deref().unwrap_or(Path::new("out"));
    std::fs::create_dir_all(folder).map_err(output::at(folder))?;
    for step in 0..u32::from(count) {
        let voxels = voxelizer.voxelize(&mesh, &options)?;
        let image = pictures::of_points(&voxels.points(), voxels.spacing);
        image.save_png(folder.join(format!("series_{step:02}.png"))).into_diagnostic()?;
        show(&voxels.report, args.json);
        let first = voxels.report.particles.max(1) >> step;
        options.resolution = Resolution::Particles(first.max(1) << (step + 1));
    }
    Ok(Outcome::Fine)
}

fn options(args: &args::Voxelize) -> miette::Result<VoxelizeOptions> {
    let resolution = match (args.spacing, args.resolution, args.particles) {
        (Some(spacing), ..) => Resolution::Spacing(spacing),
        (_, Some(across), _) => Resolution::Across(across),
        (.., Some(particles)) => Resolution::Particles(particles),
        _ => {
            return Err(miette::miette!("one of --spacing, --resolution, --particles is needed"));
        }
    };
    let rotation = match args.rotate {
        None => DQuat::IDENTITY,
        Some([x, y, z, degrees]) => {
            let axis = DVec3::new(x, y, z).try_normalize();
            let axis = axis.ok_or_else(|| {
                miette::miette!(help = "e.g. --rotate 0,0,1,90", "--rotate: the axis has no direction")
            })?;
            DQuat::from_axis_angle(axis, degrees.to_radians())
        }
    };
    Ok(VoxelizeOptions {
        rule: args.rule,
        resolution,
        offset: args.offset.map_or(DVec3::ZERO, DVec3::from),
        rotation,
        thin: args.thin,
        align: args.align.into(),
        shell: args.shell,
        ..VoxelizeOptions::default()
    })
}

fn show(r: &VoxelReport, json: bool) {
    if json {
        return print_json(r);
    }
    let [x, y, z] = r.com;
    print(&table(&[
        ("particles", format!("{} at a spacing of {:.6}", r.particles, r.spacing)),
        ("triangles", r.triangles.to_string()),
        ("volume", format!("{:.6e} by particles, {:.6e} by the mesh", r.volume_particles, r.volume_mesh)),
        ("centre of mass", format!("{x:.6}, {y:.6}, {z:.6}")),
        ("surface", surface(r)),
        ("time", format!("{:.1} ms", r.millis)),
    ]));
    r.warnings.iter().for_each(|w| say(&format!("warning: {w}")));
}

fn surface(r: &VoxelReport) -> String {
    if r.watertight {
        return "watertight".into();
    }
    format!("open: {} boundary edges, {} shared by more than two triangles", r.boundary_edges, r.nonmanifold_edges)
}
