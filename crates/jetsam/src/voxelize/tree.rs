//! The generalised winding number of any set of triangles, at any point.
//!
//! w(p) is the sum of the signed solid angles of all triangles seen from p, over 4π (Jacobson, Kavan & Sorkine-Hornung
//! 2013): 1 inside a closed surface, 0 outside, and something between near holes. [`winding_number`] sums all of them;
//! [`WindingTree`] sums near triangles exactly and far clusters by the first three terms of their expansion
//! (Barill, Dickson, Schmidt, Levin & Jacobson 2018).

use std::f64::consts::PI;

use glam::{DMat3, DVec3};

use crate::mesh::{Mesh, outer};

/// Solid angle, in steradians, of a triangle seen from the origin (Van Oosterom & Strackee 1983): positive where its
/// corners run counter-clockwise seen from the far side.
pub fn solid_angle(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let [numerator, denominator, _] = half_tangent(a, b, c);
    2.0 * numerator.atan2(denominator)
}

/// Numerator and denominator of the tangent of half the solid angle, and their scale.
fn half_tangent(a: DVec3, b: DVec3, c: DVec3) -> [f64; 3] {
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let scale = la * lb * lc;
    [a.dot(b.cross(c)), scale + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb, scale]
}

/// The generalised winding number of the mesh at `p`, triangle by triangle.
pub fn winding_number(mesh: &Mesh, p: DVec3) -> f64 {
    let angles = mesh.triangles.iter().map(|t| {
        let [a, b, c] = mesh.corners(*t).map(|v| v - p);
        solid_angle(a, b, c)
    });
    angles.sum::<f64>() / (4.0 * PI)
}

/// A hierarchy of clusters of triangles.
pub struct WindingTree {
    triangles: Vec<[DVec3; 3]>,
    nodes: Vec<Node>,
}

struct Node {
    center: DVec3,
    /// No corner is farther from the centre.
    radius: f64,
    /// Sum of area times normal.
    normal: DVec3,
    /// Sum of (area · normal)(centroid - center)ᵀ.
    moment: DMat3,
    /// For each component of the normal, the integral of it times d dᵀ, with d from the centre.
    second: [DMat3; 3],
    area: f64,
    first: u32,
    count: u32,
    /// Index of the other child; one follows its parent. Zero: a leaf.
    other: u32,
}

impl Node {
    /// The cluster's solid angle seen from -d, at distance r: the field d/r³ and its first two derivatives, against
    /// the moments of the normals.
    fn far(&self, d: DVec3, r: f64) -> f64 {
        let (i2, i3) = (1.0 / (r * r), 1.0 / (r * r * r));
        let trace = |m: &DMat3| m.x_axis.x + m.y_axis.y + m.z_axis.z;
        let first = trace(&self.moment) - 3.0 * i2 * d.dot(self.moment * d);
        let (mut mixed, mut full, mut traces) = (0.0, 0.0, 0.0);
        for (i, m) in self.second.iter().enumerate() {
            let along = *m * d;
            mixed += along[i];
            full += d[i] * d.dot(along);
            traces += trace(m) * d[i];
        }
        let second = i2 * (7.5 * i2 * full - 1.5 * (2.0 * mixed + traces));
        i3 * (self.normal.dot(d) + first + second)
    }
}

/// A bound of a gradient that grows where something comes nearer.
#[derive(Clone, Copy)]
pub(crate) struct Bound {
    /// At the point itself.
    pub rate: f64,
    /// How near that something is, or nearer.
    pub distance: f64,
}

impl Bound {
    pub const NONE: Bound = Bound { rate: 0.0, distance: f64::INFINITY };

    /// Adds a source whose field is `rate` here.
    pub fn add(&mut self, rate: f64, distance: f64) {
        self.rate += rate / (4.0 * PI);
        self.distance = self.distance.min(distance);
    }

    /// How far the value can be followed before it has changed by `margin`, for a gradient that grows as the
    /// `power` of the distance: s · rate / (1 - s/d)^power <= margin holds for this s.
    pub fn reach(&self, margin: f64, power: f64) -> f64 {
        margin / (self.rate + power * margin / self.distance)
    }
}

/// A winding number and how fast it can change, away from the surface.
pub(crate) struct Sample {
    pub winding: f64,
    /// As the field of the triangles: Σ 2 area / distance³. Not even this holds beyond a triangle.
    pub sheet: Bound,
    /// Whether the point lies on a triangle, or next to nothing from it.
    pub touching: bool,
}

const LEAF: usize = 8;

impl WindingTree {
    /// A tree over the triangles of a mesh, O(n log n).
    pub fn new(mesh: &Mesh) -> WindingTree {
        WindingTree::of(mesh.triangles.iter().map(|t| mesh.corners(*t)).collect())
    }

    pub(crate) fn of(mut triangles: Vec<[DVec3; 3]>) -> WindingTree {
        let mut nodes = Vec::with_capacity(triangles.len() / 2);
        if !triangles.is_empty() {
            build(&mut triangles, 0, &mut nodes);
        }
        WindingTree { triangles, nodes }
    }

    /// The winding number at `p`. Clusters farther than `beta` of their radii are expanded; `beta` = 2 is right to
    /// about 0.01, more is better and slower.
    pub fn winding(&self, p: DVec3, beta: f64) -> f64 {
        self.sample(p, beta).winding
    }

    pub(crate) fn sample(&self, p: DVec3, beta: f64) -> Sample {
        let (mut angle, mut sheet) = (0.0, Bound::NONE);
        let mut touching = false;
        let mut at = 0;
        let mut pending = [0u32; 64];
        let mut depth = 0;
        while let Some(node) = self.nodes.get(at) {
            let d = node.center - p;
            let r2 = d.length_squared();
            if r2 > (beta * node.radius).powi(2) {
                let r = r2.sqrt();
                angle += node.far(d, r);
                let near = r - node.radius;
                sheet.add(2.0 * node.area / near.powi(3), near);
            } else if node.other > 0 {
                pending[depth] = node.other;
                depth += 1;
                at += 1;
                continue;
            } else {
                let near = (r2.sqrt() - node.radius).max(0.0);
                sheet.add(2.0 * node.area / near.powi(3), near);
                for i in node.first as usize..(node.first + node.count) as usize {
                    let [a, b, c] = self.triangles[i].map(|v| v - p);
                    let [numerator, denominator, scale] = half_tangent(a, b, c);
                    angle += 2.0 * numerator.atan2(denominator);
                    touching |= numerator.abs() <= 1e-6 * scale && denominator <= 1e-6 * scale;
                }
            }
            if depth == 0 {
                break;
            }
            depth -= 1;
            at = pending[depth] as usize;
        }
        let winding = angle / (4.0 * PI);
        Sample { winding, sheet, touching }
    }
}

/// Distance from the origin to a segment.
pub(crate) fn segment_distance(a: DVec3, b: DVec3) -> f64 {
    let ab = b - a;
    let along = (-a.dot(ab) / ab.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    (a + ab * along).length()
}

fn build(items: &mut [[DVec3; 3]], first: u32, nodes: &mut Vec<Node>) {
    let (mut area, mut weighted, mut normal) = (0.0, DVec3::ZERO, DVec3::ZERO);
    let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let parts = |t: &[DVec3; 3]| (0.5 * (t[1] - t[0]).cross(t[2] - t[0]), (t[0] + t[1] + t[2]) / 3.0);
    for t in items.iter() {
        let (n, centroid) = parts(t);
        area += n.length();
        weighted += centroid * n.length();
        normal += n;
        (lo, hi) = (lo.min(centroid), hi.max(centroid));
    }
    let center = if area > 0.0 { weighted / area } else { 0.5 * (lo + hi) };
    let (mut radius, mut moment, mut second) = (0.0f64, DMat3::ZERO, [DMat3::ZERO; 3]);
    for t in items.iter() {
        let (n, centroid) = parts(t);
        radius = t.iter().fold(radius, |r, v| r.max(v.distance(center)));
        moment += outer(n, centroid - center);
        let [a, b, c] = t.map(|v| v - center);
        let sum = a + b + c;
        let square = (outer(a, a) + outer(b, b) + outer(c, c) + outer(sum, sum)) * (1.0 / 12.0);
        (0..3).for_each(|i| second[i] += square * n[i]);
    }
    let at = nodes.len();
    nodes.push(Node { center, radius, normal, moment, area, first, count: items.len() as u32, second, other: 0 });
    if items.len() > LEAF {
        let axis = (hi - lo).max_position();
        let middle = items.len() / 2;
        let key = |t: &[DVec3; 3]| t[0][axis] + t[1][axis] + t[2][axis];
        items.sort_by(|a, b| key(a).total_cmp(&key(b)));
        let (left, right) = items.split_at_mut(middle);
        build(left, first, nodes);
        nodes[at].other = nodes.len() as u32;
        build(right, first + middle as u32, nodes);
    }
}
