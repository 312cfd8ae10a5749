//! Makes the mountain: `cargo run --release --example make_mountain [OUT.obj]` writes `scenes/meshes/mountain.obj`.
//!
//! A closed terrain for the scene `mountain-slide`, in metres: x in [0, 2], y in [0, 1], flat bottom at z = -0.1. From
//! z = 0.9 at x = 0 a smooth chute runs down along y = 0.5, between rocky ridges, to the flat floor z = 0 of the water
//! tank, which begins at x = 1.

#[path = "support/solid.rs"]
mod solid;

use glam::{DVec2, IVec2, dvec2};
use solid::Solid;

/// Quads along x and y.
const QUADS: [u32; 2] = [104, 52];
/// Extent along x and y, m.
const EXTENT: DVec2 = DVec2::new(2.0, 1.0);
/// Height of the flat bottom, m.
const BOTTOM: f64 = -0.1;

/// A value in [-1, 1) that depends on the lattice point alone.
fn hash(p: IVec2) -> f64 {
    let mut h = (p.x as u32).wrapping_mul(0x9e37_79b1) ^ (p.y as u32).wrapping_mul(0x85eb_ca77);
    for _ in 0..2 {
        h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d);
    }
    (h ^ (h >> 16)) as f64 / 2f64.powi(31) - 1.0
}

/// 0 below `from`, 1 above `to`, smooth between.
fn ramp(x: f64, from: f64, to: f64) -> f64 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Value noise in [-1, 1] on the unit lattice.
fn noise(p: DVec2) -> f64 {
    let corner = p.floor();
    let (i, t) = (corner.as_ivec2(), p - corner);
    let (u, v) = (ramp(t.x, 0.0, 1.0), ramp(t.y, 0.0, 1.0));
    let row = |dy| (1.0 - u) * hash(i + IVec2::new(0, dy)) + u * hash(i + IVec2::new(1, dy));
    (1.0 - v) * row(0) + v * row(1)
}

/// Ridged fractal noise, about 0 to 1: sharp crests, each octave finer, weaker and turned against the last.
fn crags(mut p: DVec2) -> f64 {
    let (mut sum, mut weight) = (0.0, 0.5);
    for _ in 0..4 {
        sum += weight * (1.0 - 2.0 * noise(p).abs());
        p = 2.03 * DVec2::from_angle(0.6).rotate(p) + dvec2(7.3, 3.1);
        weight *= 0.5;
    }
    sum
}

/// Height of the middle of the chute, m: from 0.9 at x = 0 down a plane of 44 degrees, run out flat between x = 0.84 and 1.
fn chute(x: f64) -> f64 {
    let (steepness, round) = (0.98, 0.08);
    let plane = 0.9 - steepness * x;
    let h = (1.0 - plane.abs() / round).max(0.0);
    plane.max(0.0) + 0.25 * round * h * h
}

/// Height of the terrain, m.
fn height(p: DVec2) -> f64 {
    let floor = chute(p.x);
    let aside = (p.y - 0.5).abs();
    // The slope's walls: a bowl of the heads' size in the middle, then rock. Both fade out towards the tank.
    let fade = 1.0 - ramp(p.x, 0.72, 1.0);
    let bowl = 0.20 * ramp(aside, 0.10, 0.34);
    let rock = ramp(aside, 0.20, 0.36) * (0.33 * crags(dvec2(3.1, 4.3) * p + dvec2(11.7, 5.2)) - 0.03);
    floor + fade * (bowl + rock)
}

/// The terrain's top, the flat bottom under it, and the skirt between.
fn mountain() -> Solid {
    let [nx, ny] = QUADS;
    let (columns, layer) = (nx + 1, (nx + 1) * (ny + 1));
    let at = |x: u32, y: u32| y * columns + x;

    let places =
        || (0..=ny).flat_map(|y| (0..=nx).map(move |x| EXTENT * dvec2(x as f64 / nx as f64, y as f64 / ny as f64)));
    let top = places().map(|p| p.extend(height(p)));
    let bottom = places().map(|p| p.extend(BOTTOM));
    let vertices = top.chain(bottom).collect();

    let mut triangles = Vec::new();
    let mut quad = |[a, b, c, d]: [u32; 4]| triangles.extend([[a, b, c], [a, c, d]]);
    for y in 0..ny {
        for x in 0..nx {
            let q = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
            quad(q);
            quad([q[0], q[3], q[2], q[1]].map(|v| v + layer));
        }
    }
    let mut skirt = |a: u32, b: u32| quad([a + layer, b + layer, b, a]);
    for x in 0..nx {
        skirt(at(x, 0), at(x + 1, 0));
        skirt(at(x + 1, ny), at(x, ny));
    }
    for y in 0..ny {
        skirt(at(nx, y), at(nx, y + 1));
        skirt(at(0, y + 1), at(0, y));
    }
    Solid { vertices, triangles }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/meshes/mountain.obj");
    let path = std::env::args().nth(1).unwrap_or(default.into());
    mountain().save_obj(&path, "jetsam's mountain: a slide into a tank, in metres, up +z; made by make_mountain.rs", 4)
}
