//! Particles on a surface instead of in a solid: for the boundary of large static meshes.
//!
//! In: a mesh and a spacing. Out: one point per spacing² of area, evenly spread. Five times as many trial points are
//! thrown on the triangles, and again and again the one that crowds its neighbours most is taken away (weighted sample
//! elimination; Yuksel 2015).

use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashMap};

use glam::{DVec3, I64Vec3};

use super::VoxelizeError;
use crate::mesh::Mesh;

/// Points a sample may have.
const MOST: u64 = 20_000_000;
/// Trial points for each point kept.
const TRIALS: f64 = 5.0;
/// Pairs nearer than this part of the densest packing's spacing count as if they were that far apart: what lies
/// nearer goes first anyway (the paper's weight limiting, 0.65 (1 - TRIALS^-1.5)).
const NEAREST: f64 = 0.592;

/// Points on the mesh, area / `spacing`² of them (at least one), evenly spread: the least distance between neighbours
/// is about two thirds of `spacing`. The same mesh, spacing and seed give the same points. Distance is
/// measured straight, so the two sides of a plate thinner than `spacing` share their points.
///
/// # Errors
/// The mesh is empty or broken, the spacing is not positive, or the points would be more than 20 million.
pub fn sample_surface(mesh: &Mesh, spacing: f64, seed: u64) -> Result<Vec<DVec3>, VoxelizeError> {
    mesh.check().map_err(VoxelizeError::Mesh)?;
    if !(spacing.is_finite() && spacing > 0.0) {
        return Err(VoxelizeError::Option { option: "spacing", value: spacing.to_string() });
    }
    let area = mesh.area();
    let wanted = area / (spacing * spacing);
    if wanted.is_nan() || wanted >= MOST as f64 {
        let fits = (area / MOST as f64).sqrt() * 1.01;
        return Err(VoxelizeError::TooManyPoints { spacing, points: wanted, limit: MOST, fits });
    }
    if area <= 0.0 {
        return Err(VoxelizeError::Point);
    }
    let wanted = (wanted.round() as usize).max(1);
    let trials = throw(mesh, wanted, area, &mut Random(seed ^ 0x5851_f42d_4c95_7f2d));
    Ok(eliminate(trials, wanted, area))
}

/// Trial points, as evenly as chance allows: triangle after triangle, each gets its share of the area so far.
fn throw(mesh: &Mesh, wanted: usize, area: f64, random: &mut Random) -> Vec<DVec3> {
    let total = (wanted as f64 * TRIALS).ceil();
    let mut points = Vec::with_capacity(total as usize + 1);
    let mut covered = 0.0;
    for t in &mesh.triangles {
        let [a, b, c] = mesh.corners(*t);
        covered += 0.5 * (b - a).cross(c - a).length();
        while (points.len() as f64 + 0.5) * area <= covered * total {
            let (u, v) = (random.unit(), random.unit());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            points.push(a + (b - a) * u + (c - a) * v);
        }
    }
    points
}

/// A trial point and how crowded it was when it was queued.
struct Crowded {
    weight: f64,
    point: u32,
}

impl Ord for Crowded {
    fn cmp(&self, other: &Self) -> Ordering {
        self.weight.total_cmp(&other.weight).then(self.point.cmp(&other.point))
    }
}
impl PartialOrd for Crowded {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl PartialEq for Crowded {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}
impl Eq for Crowded {}

/// Takes the most crowded points away until `wanted` are left.
fn eliminate(points: Vec<DVec3>, wanted: usize, area: f64) -> Vec<DVec3> {
    // The spacing of the densest packing of so many points.
    let reach = (2.0 / 3f64.sqrt() * area / wanted as f64).sqrt();
    let mut filling: HashMap<I64Vec3, Vec<u32>> = HashMap::new();
    let cell = |p: DVec3| ((p - points[0]) / reach).floor().as_i64vec3();
    for (p, i) in points.iter().zip(0..) {
        filling.entry(cell(*p)).or_default().push(i);
    }
    let cells = &filling;
    let crowding = |i: u32, j: u32| {
        let d = points[i as usize].distance(points[j as usize]) / reach;
        if d < 1.0 && i != j { (1.0 - d.max(NEAREST)).powi(8) } else { 0.0 }
    };
    let neighbours = |i: u32| {
        let home = cell(points[i as usize]);
        let offsets = (0..27).map(|n| I64Vec3::new(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1));
        let near = offsets.filter_map(move |o| cells.get(&home.saturating_add(o)));
        near.flatten().copied()
    };
    let mut weight: Vec<f64> = (0..points.len() as u32).map(|i| neighbours(i).map(|j| crowding(i, j)).sum()).collect();
    let mut queue: BinaryHeap<Crowded> =
        weight.iter().zip(0..).map(|(weight, point)| Crowded { weight: *weight, point }).collect();
    let mut gone = vec![false; points.len()];
    let mut left = points.len();
    while left > wanted {
        let Some(top) = queue.pop() else { break };
        let i = top.point;
        if top.weight > weight[i as usize] {
            // Neighbours have gone since: it is less crowded than it was.
            queue.push(Crowded { weight: weight[i as usize], point: i });
            continue;
        }
        gone[i as usize] = true;
        left -= 1;
        for j in neighbours(i).filter(|j| !gone[*j as usize]) {
            weight[j as usize] -= crowding(i, j);
        }
    }
    points.iter().zip(gone).filter(|(_, gone)| !gone).map(|(p, _)| *p).collect()
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
