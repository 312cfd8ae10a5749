//! Particles on a surface instead of in a solid: for the boundary of large static meshes.

use std::collections::HashMap;

use glam::{DVec3, I64Vec3};

use crate::mesh::Mesh;

/// Points on the mesh about `spacing` apart: no two are nearer than `spacing`, and no place on the surface is farther
/// than `spacing` from a point (a maximal Poisson-disk sample), to the density of the trial points.
///
/// Trial points are laid over every triangle, about 20 per disk, shuffled by `seed` and kept when no kept point is
/// near (dart throwing by elimination; Cline et al. 2009). Corners of the mesh are tried first, so that
/// edges and corners of a coarse mesh are covered. The same mesh, spacing and seed give the same points.
/// An empty or broken mesh, or a spacing that is not positive, gives none.
pub fn sample_surface(mesh: &Mesh, spacing: f64, seed: u64) -> Vec<DVec3> {
    let area = mesh.area();
    if mesh.check().is_err() || !(spacing.is_finite() && spacing > 0.0 && area.is_finite()) {
        return Vec::new();
    }
    let mut random = Random(seed ^ 0x5851_f42d_4c95_7f2d);
    let mut trials: Vec<DVec3> = Vec::new();
    let per_area = 20.0 / (std::f64::consts::FRAC_PI_4 * spacing * spacing);
    for t in &mesh.triangles {
        let [a, b, c] = mesh.corners(*t);
        let wanted = 0.5 * (b - a).cross(c - a).length() * per_area;
        let count = (wanted + random.unit()) as u64;
        for _ in 0..count {
            let (u, v) = (random.unit(), random.unit());
            let (u, v) = if u + v > 1.0 {
                (1.0 - u, 1.0 - v)
            } else {
                (u, v)
            };
            trials.push(a + (b - a) * u + (c - a) * v);
        }
    }
    for i in (1..trials.len()).rev() {
        trials.swap(i, (random.next() % (i as u64 + 1)) as usize);
    }
    let corners = mesh.triangles.iter().flat_map(|t| mesh.corners(*t));
    let mut kept: Vec<DVec3> = Vec::new();
    let mut cells: HashMap<I64Vec3, Vec<u32>> = HashMap::new();
    for p in corners.chain(trials) {
        let cell = (p / spacing).floor().as_i64vec3();
        let near = |offset: I64Vec3| {
            let there = cells.get(&(cell + offset)).map_or(&[][..], Vec::as_slice);
            there
                .iter()
                .any(|&q| kept[q as usize].distance_squared(p) < spacing * spacing)
        };
        let offsets = (0..27).map(|n| I64Vec3::new(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1));
        if !offsets.into_iter().any(near) {
            cells.entry(cell).or_default().push(kept.len() as u32);
            kept.push(p);
        }
    }
    kept
}

/// A small generator of even quality (SplitMix64; Steele, Lea & Flood 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// In [0, 1).
    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }
}
