//! Meshes built in code, for scenes, tests and benches: facing outward, vertices shared, and closed where not said otherwise.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use super::Mesh;

impl Mesh {
    /// An axis-aligned box from `lo` to `hi`: 8 vertices, 12 triangles.
    pub fn cuboid(lo: DVec3, hi: DVec3) -> Mesh {
        let pick = |bit: usize, l: f64, h: f64| if bit == 0 { l } else { h };
        let vertices = (0..8)
            .map(|i| DVec3::new(pick(i & 1, lo.x, hi.x), pick(i & 2, lo.y, hi.y), pick(i & 4, lo.z, hi.z)))
            .collect();
        let quads: [[u32; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        Mesh { vertices, triangles }
    }

    /// A regular octahedron with its corners at distance `radius` on the axes.
    pub fn octahedron(center: DVec3, radius: f64) -> Mesh {
        let axes = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
        Mesh {
            vertices: axes.iter().map(|a| center + *a * radius).collect(),
            triangles: vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]],
        }
    }

    /// An icosahedron whose faces are split in four `levels` times and pushed onto the sphere: 20·4^levels
    /// triangles. Inscribed: its volume is a little less than the sphere's.
    pub fn ball(center: DVec3, radius: f64, levels: u32) -> Mesh {
        let g = (1.0 + 5f64.sqrt()) / 2.0;
        let mut unit: Vec<DVec3> = [
            [-1.0, g, 0.0],
            [1.0, g, 0.0],
            [-1.0, -g, 0.0],
            [1.0, -g, 0.0],
            [0.0, -1.0, g],
            [0.0, 1.0, g],
            [0.0, -1.0, -g],
            [0.0, 1.0, -g],
            [g, 0.0, -1.0],
            [g, 0.0, 1.0],
            [-g, 0.0, -1.0],
            [-g, 0.0, 1.0],
        ]
        .map(|v| DVec3::from_array(v).normalize())
        .to_vec();
        let mut triangles: Vec<[u32; 3]> = vec![
            [0, 11, 5],
            [0, 5, 1],
            [0, 1, 7],
            [0, 7, 10],
            [0, 10, 11],
            [1, 5, 9],
            [5, 11, 4],
            [11, 10, 2],
            [10, 7, 6],
            [7, 1, 8],
            [3, 9, 4],
            [3, 4, 2],
            [3, 2, 6],
            [3, 6, 8],
            [3, 8, 9],
            [4, 9, 5],
            [2, 4, 11],
            [6, 2, 10],
            [8, 6, 7],
            [9, 8, 1],
        ];
        for _ in 0..levels {
            let mut middles = HashMap::new();
            let mut middle = |a: u32, b: u32| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    unit.push((unit[a as usize] + unit[b as usize]).normalize());
                    unit.len() as u32 - 1
                })
            };
            triangles = triangles
                .iter()
                .flat_map(|&[a, b, c]| {
                    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                    [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
                })
                .collect();
        }
        Mesh { vertices: unit.iter().map(|v| center + *v * radius).collect(), triangles }
    }

    /// A closed cylinder along z from z = 0 to `height`, of `segments` sides.
    pub fn cylinder(radius: f64, height: f64, segments: u32) -> Mesh {
        let n = segments.max(3);
        let mut vertices = vec![DVec3::ZERO, DVec3::Z * height];
        let mut triangles = Vec::with_capacity(4 * n as usize);
        for i in 0..n {
            let rim = DVec2::from_angle(TAU * f64::from(i) / f64::from(n)) * radius;
            vertices.extend([rim.extend(0.0), rim.extend(height)]);
            let (a, b) = (2 + 2 * i, 2 + 2 * ((i + 1) % n));
            triangles.extend([[0, b, a], [1, a + 1, b + 1], [a, b, b + 1], [a, b + 1, a + 1]]);
        }
        Mesh { vertices, triangles }
    }

    /// A torus about z: the tube of radius `minor` runs along a circle of radius `major`.
    pub fn torus(major: f64, minor: f64, around: u32, across: u32) -> Mesh {
        tube(around, across, minor, |t| {
            let radial = DVec2::from_angle(TAU * t).extend(0.0);
            (radial * major, radial, DVec3::Z)
        })
    }

    /// A (p, q) torus knot: a tube of radius `minor` about a curve that winds `p` times about z while it winds `q`
    /// times about the circle of radius `major`, at 0.4 `major` from it. 2 · `around` · `across` triangles.
    pub fn torus_knot(p: u32, q: u32, major: f64, minor: f64, around: u32, across: u32) -> Mesh {
        let (p, q) = (f64::from(p), f64::from(q));
        let curve = |t: f64| {
            let ring = major * (1.0 + 0.4 * (TAU * q * t).cos());
            (DVec2::from_angle(TAU * p * t) * ring).extend(0.4 * major * (TAU * q * t).sin())
        };
        tube(around, across, minor, |t| {
            let (x, d) = (curve(t), 1e-4);
            let tangent = (curve(t + d) - curve(t - d)).normalize();
            // The direction out of the carrying torus turns with the knot and closes on itself.
            let out = x - (DVec2::from_angle(TAU * p * t) * major).extend(0.0);
            let normal = (out - tangent * out.dot(tangent)).normalize();
            (x, normal, normal.cross(tangent))
        })
    }

    /// A ball about the origin with a round hole about +z, of polar angle `open` (radians): `rings` rings of `segments`
    /// quads. `open` = π/2 leaves a hemisphere. Not closed.
    pub fn open_ball(radius: f64, open: f64, rings: u32, segments: u32) -> Mesh {
        let (rings, n) = (rings.max(2), segments.max(3));
        let at = |r: u32, s: u32| {
            let theta = open + (PI - open) * f64::from(r) / f64::from(rings);
            (DVec2::from_angle(TAU * f64::from(s) / f64::from(n)) * theta.sin()).extend(theta.cos()) * radius
        };
        let mut vertices: Vec<DVec3> =
            (0..rings).flat_map(|r| (0..n).map(move |s| (r, s))).map(|(r, s)| at(r, s)).collect();
        vertices.push(DVec3::NEG_Z * radius);
        let (id, pole) = (|r: u32, s: u32| r * n + s % n, rings * n);
        let mut triangles = Vec::new();
        for s in 0..n {
            for r in 0..rings - 1 {
                let (a, b, c, d) = (id(r, s), id(r, s + 1), id(r + 1, s), id(r + 1, s + 1));
                triangles.extend([[a, c, d], [a, d, b]]);
            }
            triangles.push([id(rings - 1, s), pole, id(rings - 1, s + 1)]);
        }
        Mesh { vertices, triangles }
    }

    /// The same triangles with no vertex shared: a soup.
    pub fn unwelded(&self) -> Mesh {
        Mesh {
            vertices: self.triangles.iter().flat_map(|t| self.corners(*t)).collect(),
            triangles: (0..self.triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        }
    }
}

/// A closed tube of radius `radius` about a closed curve. `frame(t)`, t in [0, 1), gives the point and two unit
/// vectors u, v across the curve, with u x v pointing against it.
fn tube(around: u32, across: u32, radius: f64, frame: impl Fn(f64) -> (DVec3, DVec3, DVec3)) -> Mesh {
    let (around, across) = (around.max(3), across.max(3));
    let mut mesh = Mesh::default();
    for i in 0..around {
        let (x, u, v) = frame(f64::from(i) / f64::from(around));
        for j in 0..across {
            let (sin, cos) = (TAU * f64::from(j) / f64::from(across)).sin_cos();
            mesh.vertices.push(x + (u * cos + v * sin) * radius);
            let id = |i: u32, j: u32| (i % around) * across + j % across;
            let (a, b, c, d) = (id(i, j), id(i + 1, j), id(i, j + 1), id(i + 1, j + 1));
            mesh.triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    mesh
}
