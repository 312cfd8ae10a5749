//! Surface normals of the particles of a body (E12): which of them lie inside a flat face, and where it looks.

use super::near::Near;
use crate::scene::solid::Solid;
use glam::DVec3;

/// Neighbours count within this many spacings: faces and edges of a cell, not its corners.
const REACH: f64 = 1.5;
/// Neighbours this close to the tangent plane (sine of the angle) are in it.
const IN_PLANE: f64 = 0.3;
/// Largest angle between neighbours in the plane of a particle inside a face (rad).
const GAP: f64 = 1.8;

/// For each point of a lattice the outward normal: length 1 inside a flat face, 2 inside a sheet (one layer, two sides),
/// 0 at edges, on curved surfaces, which shells are, and inside the body.
pub(super) fn normals(solid: &Solid, dx: f64, dimensions: u32) -> Vec<[f32; 3]> {
    let points = &solid.points;
    if solid.shells {
        return vec![[0.0; 3]; points.len()];
    }
    let near = Near::of(REACH * dx, points.iter().copied());
    let one = |&p: &DVec3| {
        let mut around: Vec<DVec3> = Vec::new();
        near.around(p, |d, _| {
            let r = d.length();
            if r > 1e-6 * dx && r < REACH * dx {
                around.push(d / dx);
            }
        });
        normal(&around, dimensions).as_vec3().to_array()
    };
    points.iter().map(one).collect()
}

/// Normal of a particle with the neighbours `around` (in spacings).
fn normal(around: &[DVec3], dimensions: u32) -> DVec3 {
    let full = if dimensions == 2 { 8 } else { 18 };
    if around.len() >= full {
        return DVec3::ZERO;
    }
    let out = -around.iter().sum::<DVec3>();
    if out.length() > 0.5 {
        let n = out.normalize();
        // nothing stands above, and the plane is closed all around
        let above = around.iter().any(|d| d.dot(n) > IN_PLANE * d.length());
        return if !above && closed(around, n, dimensions) { n } else { DVec3::ZERO };
    }
    // as many on one side as on the other: a sheet, if some direction is free of neighbours
    let thin = |n: &DVec3| around.iter().all(|d| d.dot(*n).abs() <= IN_PLANE * d.length());
    let cross = |a: &DVec3| around.iter().map(|b| a.cross(*b)).max_by(|p, q| p.length().total_cmp(&q.length()));
    let candidate = match (dimensions, around.first()) {
        (_, None) => return DVec3::ZERO,
        (2, Some(a)) => a.cross(DVec3::Y),
        (_, Some(a)) => cross(a).unwrap_or_default(),
    };
    match candidate.try_normalize().filter(thin) {
        Some(n) if closed(around, n, dimensions) => 2.0 * n,
        _ => DVec3::ZERO,
    }
}

/// Whether neighbours in the plane across `n` leave no wide gap.
fn closed(around: &[DVec3], n: DVec3, dimensions: u32) -> bool {
    let t = if dimensions == 2 { n.cross(DVec3::Y) } else { n.any_orthonormal_vector() };
    let b = n.cross(t);
    let plane = around.iter().filter(|d| d.dot(n).abs() <= IN_PLANE * d.length());
    if dimensions == 2 {
        let along: Vec<f64> = plane.map(|d| d.dot(t)).collect();
        return along.iter().any(|&a| a > 0.0) && along.iter().any(|&a| a < 0.0);
    }
    let mut angles: Vec<f64> = plane.map(|d| d.dot(b).atan2(d.dot(t))).collect();
    angles.sort_by(f64::total_cmp);
    let Some(&first) = angles.first() else { return false };
    let ends = angles.iter().copied().skip(1).chain([first + std::f64::consts::TAU]);
    angles.iter().zip(ends).all(|(a, b)| b - a <= GAP)
}
