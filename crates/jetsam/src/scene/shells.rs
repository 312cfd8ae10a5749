//! Round shapes filled in shells that follow their surface, in place of a lattice (`fill = "shells"`).
//!
//! In: a shape and the spacing. Out: places of particles. Called by [`super::solid`] for bodies that ask for it. The outermost
//! shell lies half a spacing inside the surface, the next a spacing deeper. Each holds as many particles as its volume
//! takes, spread evenly over it: rings are cut into equal arcs, spheres follow a spiral of equal areas (Vogel 1979).

use super::Shape;
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Angle between neighbours on the spiral (rad): the golden one.
const GOLDEN: f64 = 2.399963229728653;

/// Places of the particles of a round shape (m), `None` where it is not round: the lattice of a box follows its faces.
pub(super) fn shells(shape: &Shape, dx: f64, flat: bool) -> Option<Vec<DVec3>> {
    match shape {
        Shape::Sphere { center, radius } if flat => Some(disc(DVec3::from(*center).with_y(0.0), *radius, dx, DVec3::Y)),
        Shape::Cylinder { center, radius, .. } if flat => {
            Some(disc(DVec3::from(*center).with_y(0.0), *radius, dx, DVec3::Y))
        }
        Shape::Sphere { center, radius } => Some(ball(DVec3::from(*center), *radius, dx)),
        Shape::Cylinder { center, axis, radius, height } => {
            let (center, axis) = (DVec3::from(*center), DVec3::from(*axis).normalize_or_zero());
            let (count, step) = layers(*height, dx);
            let along = (0..count).map(|k| (k as f64 + 0.5) * step - 0.5 * height);
            Some(along.flat_map(|z| disc(center + axis * z, *radius, dx, axis)).collect())
        }
        Shape::Torus { center, axis, radius, tube } => {
            Some(torus(DVec3::from(*center), DVec3::from(*axis).normalize_or_zero(), *radius, *tube, dx))
        }
        Shape::Box(_) | Shape::Mesh { .. } | Shape::Difference { .. } | Shape::Points(_) => None,
    }
}

/// A whole number of layers, and their thickness.
fn layers(width: f64, dx: f64) -> (u32, f64) {
    let count = (width / dx).round().max(1.0);
    (count as u32, width / count)
}

/// `count` particles on a circle about `center`; shells take turns in where they begin.
fn ring(center: DVec3, u: DVec3, v: DVec3, radius: f64, count: u32, begin: f64) -> impl Iterator<Item = DVec3> {
    (0..count).map(move |i| {
        let (s, c) = ((f64::from(i) + begin) * TAU / f64::from(count)).sin_cos();
        center + radius * (c * u + s * v)
    })
}

/// Two directions across an axis.
fn across(axis: DVec3) -> (DVec3, DVec3) {
    let u = axis.any_orthonormal_vector();
    (u, axis.cross(u))
}

fn disc(center: DVec3, radius: f64, dx: f64, axis: DVec3) -> Vec<DVec3> {
    let (u, v) = across(axis);
    let (count, step) = layers(radius, dx);
    let shell = |k: u32| {
        let r = (f64::from(k) + 0.5) * step;
        let number = (TAU * r * step / (dx * dx)).round().max(1.0);
        ring(center, u, v, r, number as u32, 0.5 * f64::from(k % 2))
    };
    (0..count).flat_map(shell).collect()
}

fn ball(center: DVec3, radius: f64, dx: f64) -> Vec<DVec3> {
    let (count, step) = layers(radius, dx);
    let shell = |k: u32| {
        let inner = f64::from(k) * step;
        let volume = 4.0 / 3.0 * PI * ((inner + step).powi(3) - inner.powi(3));
        let number = (volume / dx.powi(3)).round().max(1.0);
        (0..number as u32).map(move |i| {
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / number;
            let (s, c) = (f64::from(i) * GOLDEN + f64::from(k)).sin_cos();
            let flat = (1.0 - z * z).sqrt();
            center + (inner + 0.5 * step) * DVec3::new(flat * c, flat * s, z)
        })
    };
    (0..count).flat_map(shell).collect()
}

/// Shells of the tube, each of rings about the axis.
fn torus(center: DVec3, axis: DVec3, radius: f64, tube: f64, dx: f64) -> Vec<DVec3> {
    let (u, v) = across(axis);
    let (count, step) = layers(tube, dx);
    let mut points = Vec::new();
    for k in 0..count {
        let r = (f64::from(k) + 0.5) * step;
        let rings = (TAU * r * step / (dx * dx)).round().max(1.0) as u32;
        for j in 0..rings {
            let (s, c) = ((f64::from(j) + 0.5 * f64::from(k % 2)) * TAU / f64::from(rings)).sin_cos();
            let around = radius + r * c;
            let number = (TAU * around / dx).round().max(1.0) as u32;
            points.extend(ring(center + r * s * axis, u, v, around, number, 0.5 * f64::from(j % 2)));
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body(toml: &str) -> Shape {
        toml::from_str(toml).expect("a shape")
    }

    /// The outermost particles lie half a spacing inside the surface, they stand for the whole volume, and none is much
    /// nearer to another, nor further from the next, than on a lattice.
    #[test]
    fn shells_follow_the_surface_and_fill_the_volume() {
        let (dx, axis) = (0.1, DVec3::new(1.0, 2.0, 2.0) / 3.0);
        let ball = body("sphere = { center = [1, 2, 3], radius = 0.8 }");
        let rod = body("cylinder = { center = [0, 0, 0], axis = [1, 2, 2], radius = 0.8, height = 0.6 }");
        let ring = body("torus = { center = [0, 0, 0], axis = [1, 2, 2], radius = 1.0, tube = 0.4 }");
        let across = |p: DVec3| (p - axis * p.dot(axis)).length();
        // signed distance from the surface, and the volume
        let of_ball = |p: DVec3| p.distance(DVec3::new(1.0, 2.0, 3.0)) - 0.8;
        let of_rod = |p: DVec3| (across(p) - 0.8).max(p.dot(axis).abs() - 0.3);
        let of_ring = |p: DVec3| (across(p) - 1.0).hypot(p.dot(axis)) - 0.4;
        type Distance<'a> = &'a dyn Fn(DVec3) -> f64;
        let cases: [(Shape, Distance, f64); 3] = [
            (ball, &of_ball, 4.0 / 3.0 * PI * 0.512),
            (rod, &of_rod, PI * 0.64 * 0.6),
            (ring, &of_ring, 2.0 * PI * PI * 0.16),
        ];
        for (shape, distance, volume) in cases {
            let points = shells(&shape, dx, false).expect("a round shape");
            let deep = points.iter().map(|&p| distance(p)).fold(f64::NEG_INFINITY, f64::max);
            assert!((deep + 0.5 * dx).abs() < 1e-9, "outermost at {deep}");
            let filled = points.len() as f64 * dx.powi(3);
            assert!((filled / volume - 1.0).abs() < 0.02, "{filled} of {volume}");
            let outer: Vec<DVec3> = points.iter().copied().filter(|&p| distance(p) > -0.6 * dx).collect();
            for &p in &outer {
                let near = outer.iter().filter(|&&q| q != p).map(|q| q.distance(p)).fold(f64::INFINITY, f64::min);
                assert!((0.6 * dx..1.3 * dx).contains(&near), "neighbour at {near}");
            }
        }
    }
}
