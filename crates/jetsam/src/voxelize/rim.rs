//! How the winding number of an open mesh varies along a row of cells.
//!
//! A mesh has a **rim** where its triangles' sides do not cancel: around holes, along cuts, beside faces turned the wrong
//! way. Extrude the rim to x = +∞ and mesh and strips together are closed: their winding number at a cell is the whole
//! number c of signed crossings met on the way from x = -∞, for no strip is ever crossed along x. So
//!
//! > w = c + Σ Ω(a, b, +x) / 4π  over the sides a -> b of the rim,
//!
//! exactly, with one solid angle per side of the rim and none per triangle (the observation behind the one-shot method of
//! Martens & Bessmeltsev 2025). The sum is smooth along a row; its gradient is the Biot-Savart field of the rim, at most
//! Σ length / (4π distance²), which tells how many cells ahead the rounding of w cannot change.
//!
//! A long rim is cut into loops, each is closed by a **cap**, a fan of triangles, and the caps are put into a
//! [`WindingTree`]. With its caps the mesh is closed, so that w = n - (winding number of the caps), n the signed
//! crossings of mesh and caps. Caps are small where holes are, so the tree is small, and far from holes its field is weak.

use std::collections::HashMap;
use std::f64::consts::PI;

use glam::DVec3;

use super::fill::Shape;
use super::raster::{Fixed, ONE};
use super::tree::{Bound, WindingTree, segment_distance};

/// Sides of a rim that are still summed one by one.
const SHORT: usize = 400;
/// Clusters nearer than this many radii are opened: at first, and where that leaves a doubt.
const BETA: [f64; 2] = [2.0, 4.0];
/// What the tree may be wrong by at that.
const TREE_ERROR: [f64; 2] = [0.01, 0.001];

/// A side of the rim, in lattice units, counted `weight` times.
#[derive(Clone, Copy)]
pub(crate) struct Side {
    pub a: Fixed,
    pub b: Fixed,
    pub weight: i32,
}

/// The rim of a mesh, ready to be asked.
pub(crate) struct Rim {
    sides: Vec<Side>,
    tree: Option<WindingTree>,
    /// Triangles whose crossings count along with the mesh's.
    pub caps: Shape,
}

/// What is known at one cell.
pub(crate) struct Offset {
    /// Winding number minus crossings, of mesh and caps, on the way from x = -∞.
    pub value: f64,
    /// The rounding stays the same for so many more cells along the row.
    pub ahead: u32,
}

/// A lattice point as a vector in cells.
pub(crate) fn in_cells(p: Fixed) -> DVec3 {
    DVec3::new(p[0] as f64, p[1] as f64, p[2] as f64) / ONE as f64
}

impl Rim {
    /// Of the given sides. Their order does not matter: they are sorted here, so that sums come out the same for any
    /// order of the file.
    pub fn new(mut sides: Vec<Side>) -> Rim {
        sides.sort_unstable_by_key(|s| (s.a, s.b, s.weight));
        let mut caps = Shape::default();
        if sides.len() > SHORT {
            loops(&sides).iter().for_each(|path| cap(&mut caps, path));
        }
        let corners = |t: u32| caps.corners(t).map(in_cells);
        let tree =
            (sides.len() > SHORT).then(|| WindingTree::of((0..caps.triangles.len() as u32).map(corners).collect()));
        Rim { sides, tree, caps }
    }

    /// Whether there is no rim: every winding number is whole.
    pub fn is_empty(&self) -> bool {
        self.sides.is_empty()
    }

    /// At cell (i, j, k), after `passed` signed crossings of caps from x = -∞.
    pub fn offset(&self, cell: [u32; 3], passed: i32) -> Offset {
        let p = cell.map(|c| i64::from(c) * ONE);
        let (value, error, bound, power) = match &self.tree {
            None => {
                let (value, bound) = self.sum(p);
                (value, 1e-9, bound, 1.0)
            }
            Some(tree) => {
                let at = in_cells(p);
                let doubt = |w: f64, error: f64| (w.abs().fract() - 0.5).abs() < error;
                let (mut near, mut error) = (tree.sample(at, BETA[0]), TREE_ERROR[0]);
                if doubt(near.winding, error) {
                    (near, error) = (tree.sample(at, BETA[1]), TREE_ERROR[1]);
                }
                // On a cap itself the half-open rule decides, and only the sum knows it.
                let value = if near.touching || doubt(near.winding, error) {
                    self.sum(p).0 - f64::from(passed)
                } else {
                    -near.winding
                };
                (value, error, near.sheet, 3.0)
            }
        };
        let margin = 0.5 - (value - value.round()).abs() - error;
        let ahead = if margin > 0.0 { bound.reach(margin, power).min(1e6) as u32 } else { 0 };
        Offset { value, ahead }
    }

    /// The sum of the module's head, and its gradient's bound.
    fn sum(&self, p: Fixed) -> (f64, Bound) {
        let (mut angle, mut bound) = (0.0, Bound::NONE);
        for side in &self.sides {
            let weight = f64::from(side.weight);
            angle += weight * strip_angle(side, p);
            let (a, b) = (relative(side.a, p), relative(side.b, p));
            let d = segment_distance(a, b);
            bound.add(weight.abs() * (b - a).length() / (d * d), d);
        }
        (angle / (4.0 * PI), bound)
    }
}

fn relative(a: Fixed, p: Fixed) -> DVec3 {
    in_cells([0, 1, 2].map(|i| a[i] - p[i]))
}

/// Solid angle of the strip from a side to x = +∞, seen from p. Where p lies in the strip, the half-open rule of
/// [`super::raster`] decides on which side it is.
fn strip_angle(side: &Side, p: Fixed) -> f64 {
    let (a, b) = (relative(side.a, p), relative(side.b, p));
    // An end straight behind p: the half-open rule puts it at (-e², -e³) in y and z, and only directions are left.
    let behind = |v: Fixed| v[1] == p[1] && v[2] == p[2] && v[0] < p[0];
    let sign = |x: f64| f64::MIN_POSITIVE.copysign(x);
    let or_tie = |x: f64, tie: f64| if x == 0.0 { sign(tie) } else { x };
    match (behind(side.a), behind(side.b)) {
        (true, true) => return 0.0,
        (true, false) => return 2.0 * or_tie(-b.z, b.y).atan2(-b.y),
        (false, true) => return 2.0 * or_tie(a.z, -a.y).atan2(-a.y),
        (false, false) => {}
    }
    let (la, lb) = (a.length(), b.length());
    let denominator = la * lb + a.dot(b) + a.x * lb + b.x * la;
    let (left, right) = (a.y * b.z, a.z * b.y);
    let mut numerator = left - right;
    if numerator.abs() <= 1e-14 * (left.abs() + right.abs()) {
        let exact = |i: usize| (i128::from(side.a[i] - p[i]), i128::from(side.b[i] - p[i]));
        let ((ay, by), (az, bz)) = (exact(1), exact(2));
        let whole = ay * bz - az * by;
        numerator = match whole {
            0 if az != bz => (az - bz).signum() as f64 * f64::MIN_POSITIVE,
            0 => (by - ay).signum() as f64 * f64::MIN_POSITIVE,
            _ => whole as f64 / (ONE as f64 * ONE as f64),
        };
    }
    2.0 * numerator.atan2(denominator)
}

/// Cuts a rim into simple loops. As many sides begin at a corner as end there, so a walk always goes on until it
/// meets itself; then the loop it closed is taken off.
fn loops(sides: &[Side]) -> Vec<Vec<Fixed>> {
    let repeated = |s: &Side| std::iter::repeat_n((s.a, s.b), s.weight.unsigned_abs() as usize);
    let edges: Vec<(Fixed, Fixed)> = sides.iter().flat_map(repeated).collect();
    let mut next: HashMap<Fixed, usize> = HashMap::new();
    for (i, (a, _)) in edges.iter().enumerate() {
        next.entry(*a).or_insert(i);
    }
    let mut follow = |at: Fixed| {
        let slot = next.get_mut(&at)?;
        let (_, end) = edges.get(*slot).filter(|e| e.0 == at)?;
        *slot += 1;
        Some(*end)
    };
    let mut found = Vec::new();
    for &(start, _) in &edges {
        let (mut path, mut place) = (vec![start], HashMap::from([(start, 0)]));
        while let Some(end) = path.last().and_then(|at| follow(*at)) {
            if let Some(&from) = place.get(&end) {
                found.push(path[from..].to_vec());
                for v in path.drain(from + 1..) {
                    place.remove(&v);
                }
            } else {
                place.insert(end, path.len());
                path.push(end);
            }
        }
    }
    found
}

/// Adds the fan of triangles that closes a loop: its sides run against the rim, and it meets in the loop's middle.
fn cap(caps: &mut Shape, path: &[Fixed]) {
    let (n, first) = (path.len() as u32, caps.vertices.len() as u32);
    let mean = |axis: usize| path.iter().map(|v| i128::from(v[axis])).sum::<i128>() / i128::from(n);
    caps.vertices.extend_from_slice(path);
    if n == 3 {
        caps.triangles.push([first + 2, first + 1, first]);
        return;
    }
    caps.vertices.push([0, 1, 2].map(|axis| mean(axis) as i64));
    caps.triangles.extend((0..n).map(|i| [first + (i + 1) % n, first + i, first + n]));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::voxelize::raster::crossings;
    use crate::voxelize::tree::solid_angle;

    /// Crossings plus the rim's part equal the sum of all solid angles, also for cells in line with corners and edges.
    #[test]
    fn rim_and_crossings_make_the_winding_number() {
        // Three faces of a box with corners on cell centres, one with its sides on rows of cells.
        let (o, x, y, z) = ([2, 2, 2], [6, 2, 2], [2, 6, 2], [2, 2, 6]);
        let triangles = [[o, y, x], [o, x, z], [o, z, y]].map(|t| t.map(|p: [i64; 3]| p.map(|c| c * ONE)));
        let sides =
            [[y, x], [x, z], [z, y]].map(|[a, b]| Side { a: a.map(|c| c * ONE), b: b.map(|c| c * ONE), weight: 1 });
        let rim = Rim::new(sides.to_vec());
        for cell in (0..729u32).map(|n| [n % 9, n / 9 % 9, n / 81]) {
            // A hair off the cell, as the half-open rule has it.
            let p = in_cells(cell.map(|c| i64::from(c) * ONE)) + DVec3::new(1e-5, 1e-7, 1e-9);
            let angle = |t: &[Fixed; 3]| {
                let [a, b, c] = t.map(|v| in_cells(v) - p);
                solid_angle(a, b, c)
            };
            let expected = triangles.iter().map(angle).sum::<f64>() / (4.0 * PI);
            let mut passed = 0;
            for t in triangles {
                if super::super::raster::slices(t, 9).contains(&cell[2]) {
                    crossings(t, cell[2], 9, |j, i, up| {
                        passed += i32::from(j == cell[1] && i <= i64::from(cell[0])) * if up { 1 } else { -1 };
                    });
                }
            }
            let found = f64::from(passed) + rim.offset(cell, 0).value;
            // On a face, edge or corner itself the number jumps: there only nearness to some side of the jump is asked.
            let on = cell.contains(&2) && cell.iter().sum::<u32>() <= 10;
            assert!((found - expected).abs() < 1e-4 || on, "{cell:?}: {found} instead of {expected}");
        }
    }
}
