//! Sculpts the monkey head: `cargo run --release --example sculpt_monkey [OUT.obj]` writes `scenes/meshes/monkey.obj`.
//!
//! The head is a signed-distance sculpture: round shapes melted together and scooped out of each other, polygonised by
//! surface nets, then relaxed along the surface and pushed onto the exact zero set. One unit wide from ear to ear,
//! up is +z, the face looks to -y, the origin lies in the middle of the skull.

#[path = "support/solid.rs"]
mod solid;

use fast_surface_nets::ndshape::{RuntimeShape, Shape};
use fast_surface_nets::{SurfaceNetsBuffer, surface_nets};
use glam::{DVec2, DVec3, dvec2, dvec3};
use solid::Solid;

/// Edge of a sampling cell in the middle of the head: gives about 8,000 triangles.
const CELL: f64 = 0.0316;
/// Half the extent of the sampled box.
const HALF: f64 = 0.62;

/// Approximate signed distance to a sphere stretched to `radii`.
fn ellipsoid(p: DVec3, center: DVec3, radii: DVec3) -> f64 {
    let q = (p - center) / radii;
    let stretched = (q / radii).length();
    if stretched < 1e-9 { -radii.min_element() } else { q.length() * (q.length() - 1.0) / stretched }
}

fn sphere(p: DVec3, center: DVec3, radius: f64) -> f64 {
    p.distance(center) - radius
}

/// A disc with round rim: `axis` is its unit normal, `half` its half thickness, `radius` its outer radius.
fn pill(p: DVec3, center: DVec3, axis: DVec3, radius: f64, half: f64) -> f64 {
    let along = (p - center).dot(axis);
    let outward = (p - center - along * axis).length() - (radius - half);
    dvec2(outward.max(0.0), along).length() - half
}

/// Union of two shapes, melted together over about the width `k`.
fn melt(a: f64, b: f64, k: f64) -> f64 {
    let h = (k - (a - b).abs()).max(0.0) / k;
    a.min(b) - h * h * k / 4.0
}

/// The shape `a` without the shape `b`, the edge rounded over about the width `k`.
fn scoop(a: f64, b: f64, k: f64) -> f64 {
    -melt(-a, b, k)
}

/// Distance in the plane to the arc of a circle about `center`, symmetric to the downward direction, `half_angle` to each side.
fn arc(p: DVec2, center: DVec2, radius: f64, half_angle: f64) -> f64 {
    let q = dvec2((p.x - center.x).abs(), center.y - p.y);
    let end = radius * dvec2(half_angle.sin(), half_angle.cos());
    if q.x.atan2(q.y) <= half_angle { (q.length() - radius).abs() } else { q.distance(end) }
}

/// The monkey head: negative inside.
fn monkey(p: DVec3) -> f64 {
    let p = dvec3(p.x.abs(), p.y, p.z); // both halves at once

    // The skull, with a tuft of three locks on it.
    let skull = ellipsoid(p, dvec3(0.0, 0.07, 0.07), dvec3(0.315, 0.30, 0.30));
    let lock = ellipsoid(p, dvec3(0.0, -0.02, 0.375), dvec3(0.05, 0.06, 0.085));
    let side = ellipsoid(p, dvec3(0.075, 0.0, 0.35), dvec3(0.045, 0.055, 0.07));
    let skull = melt(skull, melt(lock, side, 0.02), 0.05);

    // The ears: thick discs that look forward and outward, hollow in front.
    let ear_axis = dvec3(0.42, -0.90, 0.10).normalize();
    let ear_center = dvec3(0.354, 0.05, 0.09);
    let ear = pill(p, ear_center, ear_axis, 0.152, 0.085);
    let hollow = sphere(p, ear_center + 0.14 * ear_axis, 0.105);
    let head = melt(skull, scoop(ear, hollow, 0.03), 0.05);

    // The face: a heart of two brow discs above a broad muzzle and a chin.
    let brow = ellipsoid(p, dvec3(0.12, -0.12, 0.13), dvec3(0.17, 0.155, 0.165));
    let muzzle = ellipsoid(p, dvec3(0.0, -0.19, -0.115), dvec3(0.235, 0.205, 0.155));
    let chin = ellipsoid(p, dvec3(0.0, -0.18, -0.21), dvec3(0.14, 0.14, 0.10));
    let muzzle = melt(muzzle, chin, 0.08);
    let bridge = ellipsoid(p, dvec3(0.0, -0.21, 0.03), dvec3(0.045, 0.09, 0.13));
    let head = melt(melt(head, brow, 0.04), melt(muzzle, bridge, 0.06), 0.05);

    // The eyes: balls in shallow sockets under a ridge, dimples for pupils.
    let eye = dvec3(0.128, -0.2, 0.115);
    let ridge = ellipsoid(p, dvec3(0.125, -0.215, 0.235), dvec3(0.115, 0.06, 0.04));
    let head = melt(head, ridge, 0.05);
    let head = scoop(head, sphere(p, eye + dvec3(0.0, -0.095, 0.0), 0.1), 0.04);
    let pupil = sphere(p, eye + dvec3(-0.012, -0.112, -0.005), 0.055);
    let ball = scoop(sphere(p, eye, 0.09), pupil, 0.018);
    let head = melt(head, ball, 0.018);

    // A button nose with nostrils, cheeks, and a wide smile cut along the muzzle.
    let nose = ellipsoid(p, dvec3(0.0, -0.355, -0.025), dvec3(0.095, 0.06, 0.055));
    let head = melt(head, nose, 0.03);
    let head = scoop(head, sphere(p, dvec3(0.043, -0.405, -0.035), 0.032), 0.02);
    let cheek = sphere(p, dvec3(0.185, -0.26, -0.075), 0.045);
    let head = melt(head, cheek, 0.05);
    let line = arc(dvec2(p.x, p.z), dvec2(0.0, 0.06), 0.225, 0.85);
    let smile = dvec2(line, head).length() - 0.036;
    scoop(head, smile.max(p.y + 0.18), 0.045)
}

/// Tapers the sampling box towards the face, so that the cells are finest where the detail is.
fn taper(p: DVec3) -> DVec3 {
    let scale = 0.9 + 0.6 * p.y;
    dvec3(scale * p.x, (0.9 + 0.3 * p.y) * p.y, scale * p.z)
}

/// Gradient of the sculpture by central differences.
fn slope(p: DVec3) -> DVec3 {
    let d = 1e-4;
    let along = |e: DVec3| (monkey(p + d * e) - monkey(p - d * e)) / (2.0 * d);
    dvec3(along(DVec3::X), along(DVec3::Y), along(DVec3::Z))
}

/// The nearest point of the surface, by a few Newton steps.
fn settle(mut p: DVec3) -> DVec3 {
    for _ in 0..6 {
        let g = slope(p);
        p -= (monkey(p) / g.length_squared().max(0.25) * g).clamp_length_max(0.5 * CELL);
    }
    p
}

/// Moves each vertex part of the way to the middle of its neighbours, along the surface: evens out the triangles.
fn relax(solid: &mut Solid, share: f64) {
    let mut sums = vec![(DVec3::ZERO, 0.0); solid.vertices.len()];
    for [a, b, c] in &solid.triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let sum = &mut sums[*from as usize];
            *sum = (sum.0 + solid.vertices[*to as usize], sum.1 + 1.0);
        }
    }
    for (v, (sum, count)) in solid.vertices.iter_mut().zip(sums) {
        *v = settle(*v + share * (sum / count - *v));
    }
}

/// Polygonises the sculpture with sampling cells of edge `cell` (before the taper).
fn polygonise(cell: f64) -> Solid {
    let n = (2.0 * HALF / cell) as u32 + 1;
    let point = |index: [f64; 3]| taper((DVec3::from(index) - 0.5 * (n - 1) as f64) * cell);
    let grid = RuntimeShape::<u32, 3>::new([n; 3]);
    let field: Vec<f32> = (0..grid.size()).map(|i| monkey(point(grid.delinearize(i).map(f64::from))) as f32).collect();
    let mut net = SurfaceNetsBuffer::default();
    surface_nets(&field, &grid, [0; 3], [n - 1; 3], &mut net);
    let mut solid = Solid {
        vertices: net.positions.iter().map(|v| settle(point(v.map(f64::from)))).collect(),
        triangles: net.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
    };
    for _ in 0..12 {
        relax(&mut solid, 0.5);
    }
    solid
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/meshes/monkey.obj");
    let path = std::env::args().nth(1).unwrap_or(default.into());

    // Surface nets pinch two sheets into one edge where both pass through one cell, which happens now and then in a
    // crease: take the first of a few cell sizes for which it does not.
    let solid = (0..40)
        .map(|k| CELL * 0.998f64.powi(k))
        .map(polygonise)
        .find(|solid| solid.check().is_ok())
        .ok_or("no cell size gave a manifold")?;
    let off = solid.vertices.iter().map(|v| monkey(*v).abs()).fold(0.0, f64::max);
    println!("largest distance of a vertex from the sculpture: {off:.1e}");
    let title = "jetsam's monkey head: 1 unit from ear to ear, up +z, face to -y; made by sculpt_monkey.rs";
    solid.save_obj(&path, title, 4)
}
