//! Where the picture is taken from.

use glam::{Vec2, Vec3, vec2};

/// A perspective camera. Lengths are metres, up is usually +z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Where it stands, m.
    pub eye: Vec3,
    /// What is in the middle of the picture, m.
    pub target: Vec3,
    /// The direction that is upward in the picture; any length, not along the line of sight.
    pub up: Vec3,
    /// Angle between the picture's lower and upper edge, radians.
    pub fov_y: f32,
}

impl Camera {
    /// The camera that looks at the middle of the box from `min` to `max` (m) from the direction `from` (any length), just far
    /// enough away for the whole box to be in a picture of the given `aspect` (width / height). Up is +z, or +y seen along z.
    pub fn framing(min: Vec3, max: Vec3, from: Vec3, fov_y: f32, aspect: f32) -> Camera {
        let target = 0.5 * (min + max);
        let back = from.try_normalize().unwrap_or(Vec3::NEG_Y);
        let up = if back.truncate().length() > 1e-3 { Vec3::Z } else { Vec3::Y };
        let camera = Camera { eye: target + back, target, up, fov_y };
        let view = View::new(&camera, 2.0, 2.0);
        let tangent = vec2(aspect, 1.0) * (0.5 * fov_y).tan();
        let distance = (0..8)
            .map(|corner| {
                let pick = Vec3::from_array([1, 2, 4].map(|bit| ((corner & bit) != 0) as u8 as f32));
                let p = view.local(min + pick * (max - min)) - Vec3::Z;
                (p.truncate().abs() / tangent).max_element() - p.z
            })
            .fold(0.0, f32::max);
        Camera { eye: target + back * distance.max(1e-3), ..camera }
    }

    /// Where the point (m) appears in a picture of `width` by `height` pixels: column, row (from the top left corner) and depth along
    /// the line of sight, m. None when it is not in front of the camera.
    pub fn project(&self, point: Vec3, width: usize, height: usize) -> Option<Vec3> {
        let view = View::new(self, width as f32, height as f32);
        let p = view.local(point);
        (p.z > 0.0).then(|| view.pixel(p).extend(p.z))
    }
}

/// A camera made ready for a raster: its axes, its focal length, and where its line of sight meets the raster.
pub(crate) struct View {
    pub eye: Vec3,
    pub right: Vec3,
    pub up: Vec3,
    pub forward: Vec3,
    /// Focal length in raster cells.
    pub focal: f32,
    pub middle: Vec2,
}

impl View {
    pub fn new(camera: &Camera, width: f32, height: f32) -> View {
        let forward = (camera.target - camera.eye).try_normalize().unwrap_or(Vec3::Y);
        let right = forward.cross(camera.up).try_normalize().unwrap_or_else(|| forward.any_orthonormal_vector());
        View {
            eye: camera.eye,
            right,
            up: right.cross(forward),
            forward,
            focal: 0.5 * height / (0.5 * camera.fov_y).tan(),
            middle: 0.5 * vec2(width, height),
        }
    }

    /// The point in the camera's axes: right, up, depth.
    pub fn local(&self, point: Vec3) -> Vec3 {
        let d = point - self.eye;
        Vec3::new(d.dot(self.right), d.dot(self.up), d.dot(self.forward))
    }

    /// The raster position of a point given in the camera's axes.
    pub fn pixel(&self, local: Vec3) -> Vec2 {
        self.middle + self.focal / local.z * vec2(local.x, -local.y)
    }

    /// Slope of the line of sight through a raster position: right and up per unit of depth.
    pub fn slope(&self, pixel: Vec2) -> Vec2 {
        vec2(pixel.x - self.middle.x, self.middle.y - pixel.y) / self.focal
    }

    /// The world direction of a line of sight, one unit of depth long.
    pub fn ray(&self, slope: Vec2) -> Vec3 {
        self.forward + slope.x * self.right + slope.y * self.up
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn framing_touches_the_edges_and_crosses_none() {
        let (min, max) = (Vec3::new(-1.0, 0.0, 2.0), Vec3::new(3.0, 1.0, 2.5));
        for from in [Vec3::new(1.0, -2.0, 0.7), Vec3::NEG_Y, Vec3::Z, Vec3::ZERO] {
            let camera = Camera::framing(min, max, from, 0.6, 1.5);
            let mut reach = 0.0f32;
            for corner in 0..8 {
                let pick = Vec3::from_array([1, 2, 4].map(|bit| f32::from(corner & bit != 0)));
                let p = camera.project(min + pick * (max - min), 300, 200).unwrap();
                reach = reach.max((p.truncate() / vec2(150.0, 100.0) - 1.0).abs().max_element());
            }
            assert!((reach - 1.0).abs() < 1e-4, "corners reach {reach} of the way to the edge seen from {from}");
        }
    }
}
