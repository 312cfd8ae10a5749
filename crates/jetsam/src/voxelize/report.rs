//! The report of a voxelization: what was wrong with the mesh, how well the particles fill it.

use std::time::Instant;

use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::lattice::Placed;
use super::{Resolution, Rule, Solid, VoxelizeOptions};
use crate::mesh::{MassProperties, Mesh, outer};

/// What `jetsam voxelize --json` prints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VoxelReport {
    /// Number of particles: solid cells.
    pub particles: u64,
    /// Distance between neighbouring particles, in mesh units.
    pub spacing: f64,
    /// Triangles of the mesh.
    pub triangles: usize,
    /// Volume of the mesh by the divergence theorem, faces turned as in the file.
    pub volume_mesh: f64,
    /// Particles times spacing cubed.
    pub volume_particles: f64,
    /// Centre of mass in the world.
    pub com: [f64; 3],
    /// Inertia about the centre of mass, world axes, unit density: xx, yy, zz, xy, xz, yz. From the mesh, exactly,
    /// where that is closed and simple; else from the particles, each a cube, and `warnings` says so.
    pub inertia: [f64; 6],
    /// Whether every edge has an even number of triangles.
    pub watertight: bool,
    /// Edges with one triangle.
    pub boundary_edges: usize,
    /// Edges with more than two triangles.
    pub nonmanifold_edges: usize,
    /// Closed shells that are inside out, walls of cavities not counted.
    pub flipped_shells: usize,
    /// The rule used.
    pub rule: Rule,
    /// Wall time of the whole voxelization.
    pub millis: f64,
    /// What did the work: `cpu`, or `gpu: ` and the device.
    pub backend: String,
    /// Time of the GPU's kernels, where it has a clock.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kernel_millis: Option<f64>,
    /// What the user should know, one sentence each; empty when all is well.
    pub warnings: Vec<String>,
}

/// Writes the report of a filled lattice.
pub(super) fn write(
    mesh: &Mesh,
    placed: &Placed,
    options: &VoxelizeOptions,
    solid: &mut Solid,
    started: Instant,
) -> VoxelReport {
    let spacing = solid.lattice.spacing;
    let volume_particles = solid.count as f64 * spacing.powi(3);
    let of_mesh = mesh.mass_properties();
    let simple = solid.watertight
        && solid.nonmanifold_edges + solid.flipped_triangles + solid.flipped_shells == 0
        && solid.overlap <= 1
        && options.shell.is_none()
        && of_mesh.volume.abs() > 0.0;
    let mass = if simple {
        let sign = of_mesh.volume.signum();
        let upright = MassProperties { volume: of_mesh.volume.abs(), inertia: of_mesh.inertia * sign, ..of_mesh };
        moved(upright, placed.frame * placed.to_lattice)
    } else {
        moved(of_particles(solid), placed.frame)
    };
    let mut warnings = Vec::new();
    let mut warn = |condition: bool, text: String| {
        if condition {
            warnings.push(text);
        }
    };
    warn(!simple, "mass, centre of mass and inertia are taken from the particles".into());
    warn(solid.boundary_edges > 0, format!("the mesh is open: {} edges have one triangle only", solid.boundary_edges));
    warn(solid.flipped_triangles > 0, format!("{} triangles were turned the wrong way", solid.flipped_triangles));
    warn(solid.flipped_shells > 0, format!("{} shells were inside out", solid.flipped_shells));
    warn(solid.overlap > 1, format!("parts overlap, up to {} times; the overlap counts once", solid.overlap));
    warn(
        solid.mended_rows > 0,
        format!("{} rows passed through a hole and were decided by winding number", solid.mended_rows),
    );
    warn(solid.count == 0, "no cell is solid: use a smaller spacing, or `thin`".into());
    warn(solid.ran.instead.is_some(), solid.ran.instead.take().unwrap_or_default());
    let ratio = volume_particles / of_mesh.volume.abs();
    warn(
        solid.watertight && options.shell.is_none() && !(0.75..=1.25).contains(&ratio),
        format!("the particles' volume is {:.0} % of the mesh's: use a smaller spacing, or `thin`", 100.0 * ratio),
    );
    if let Resolution::Particles(wanted) = options.resolution {
        let off = solid.count as f64 / wanted as f64 - 1.0;
        warn(off.abs() > 0.02, format!("no lattice with {wanted} particles was found; this one has {}", solid.count));
    }
    VoxelReport {
        particles: solid.count,
        spacing,
        triangles: mesh.triangles.len(),
        volume_mesh: of_mesh.volume,
        volume_particles,
        com: mass.com.to_array(),
        inertia: mass.inertia6(),
        watertight: solid.watertight,
        boundary_edges: solid.boundary_edges,
        nonmanifold_edges: solid.nonmanifold_edges,
        flipped_shells: solid.flipped_shells,
        rule: options.rule,
        millis: started.elapsed().as_secs_f64() * 1e3,
        backend: solid.ran.device.take().unwrap_or_else(|| "cpu".into()),
        kernel_millis: solid.ran.kernel_millis,
        warnings,
    }
}

/// The same solid after a rigid motion.
fn moved(mass: MassProperties, by: DAffine3) -> MassProperties {
    let turn = by.matrix3;
    MassProperties {
        volume: mass.volume,
        com: by.transform_point3(mass.com),
        inertia: turn * mass.inertia * turn.transpose(),
    }
}

/// Of the solid cells as cubes, in lattice axes. Sums of whole numbers: the same for any number of threads.
fn of_particles(solid: &Solid) -> MassProperties {
    let [_, ny, nz] = solid.bits.dims();
    let zero = || (0u64, [0u128; 3], [0u128; 6]);
    let slice = |k: u32| {
        let (mut n, mut s, mut q) = zero();
        for j in 0..ny {
            let row = solid.bits.row(j, k);
            let bits = row.iter().zip(0u32..).flat_map(|(w, at)| super::bits::ones(*w).map(move |b| at * 64 + b));
            let (mut m, mut x, mut xx) = (0u64, 0u64, 0u64);
            for i in bits.map(u64::from) {
                m += 1;
                x += i;
                xx += i * i;
            }
            let (j, k) = (u64::from(j), u64::from(k));
            n += m;
            for (sum, term) in s.iter_mut().zip([x, m * j, m * k]) {
                *sum += u128::from(term);
            }
            for (sum, term) in q.iter_mut().zip([xx, m * j * j, m * k * k, x * j, x * k, m * j * k]) {
                *sum += u128::from(term);
            }
        }
        (n, s, q)
    };
    let add = |mut a: (u64, [u128; 3], [u128; 6]), b: (u64, [u128; 3], [u128; 6])| {
        a.0 += b.0;
        (0..3).for_each(|i| a.1[i] += b.1[i]);
        (0..6).for_each(|i| a.2[i] += b.2[i]);
        a
    };
    let (n, s, q) = (0..nz).into_par_iter().map(slice).reduce(zero, add);
    if n == 0 {
        return MassProperties { volume: 0.0, com: solid.lattice.origin, inertia: DMat3::ZERO };
    }
    let h = solid.lattice.spacing;
    let count = n as f64;
    let mean = DVec3::from_array(s.map(|v| v as f64)) / count;
    let [xx, yy, zz, xy, xz, yz] = q.map(|v| v as f64 / count);
    let second = DMat3::from_cols(DVec3::new(xx, xy, xz), DVec3::new(xy, yy, yz), DVec3::new(xz, yz, zz));
    // A cube of side h has second moments h²/12 of its own.
    let central = second - outer(mean, mean) + DMat3::from_diagonal(DVec3::splat(1.0 / 12.0));
    let volume = count * h.powi(3);
    MassProperties::from_moments(solid.lattice.origin + mean * h, volume, DVec3::ZERO, central * (volume * h * h))
}
