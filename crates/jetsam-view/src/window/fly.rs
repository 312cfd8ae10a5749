//! The camera in the user's hands: orbit, pan, zoom, fly.

use crate::Camera;
use crate::camera::View;
use glam::{Quat, Vec2, Vec3};

/// Steepest angle to the horizon at which it orbits (radians).
const STEEPEST: f32 = 1.54;

/// Turns about the target by angles (radians) to the right and up.
pub fn orbit(camera: &mut Camera, by: Vec2) {
    camera.eye = camera.target + turned(camera.eye - camera.target, camera.up, -by);
}

/// Turns the line of sight where it stands.
pub fn look(camera: &mut Camera, by: Vec2) {
    camera.target = camera.eye + turned(camera.target - camera.eye, camera.up, Vec2::new(-by.x, by.y));
}

/// A direction turned about `up` by `by.x`, and towards it by `by.y`, but never over it.
fn turned(d: Vec3, up: Vec3, by: Vec2) -> Vec3 {
    let up = up.normalize_or(Vec3::Z);
    let around = Quat::from_axis_angle(up, by.x) * d;
    let side = around.cross(up).try_normalize().unwrap_or_else(|| up.any_orthonormal_vector());
    let rise = (around.dot(up) / around.length().max(1e-20)).clamp(-1.0, 1.0).asin();
    let to = (rise + by.y).clamp(-STEEPEST, STEEPEST);
    Quat::from_axis_angle(side, to - rise) * around
}

/// Moves eye and target: what was under the mouse stays under it. `by` is in heights of the picture.
pub fn pan(camera: &mut Camera, by: Vec2) {
    let view = View::new(camera, 1.0, 1.0);
    let height = 2.0 * (0.5 * camera.fov_y).tan() * camera.eye.distance(camera.target);
    let d = height * (-by.x * view.right + by.y * view.up);
    camera.eye += d;
    camera.target += d;
}

/// Comes nearer by a factor.
pub fn zoom(camera: &mut Camera, factor: f32) {
    camera.eye = camera.target + factor * (camera.eye - camera.target);
}

/// Flies: to the right, forward and up in the camera's axes, in distances to the target.
pub fn fly(camera: &mut Camera, by: Vec3) {
    let view = View::new(camera, 1.0, 1.0);
    let d = camera.eye.distance(camera.target) * (by.x * view.right + by.y * view.forward + by.z * view.up);
    camera.eye += d;
    camera.target += d;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera { eye: Vec3::new(0.0, -4.0, 1.0), target: Vec3::new(0.0, 0.0, 1.0), up: Vec3::Z, fov_y: 0.8 }
    }

    #[test]
    fn orbits_keep_their_distance_and_do_not_tip_over() {
        let mut c = camera();
        orbit(&mut c, Vec2::new(std::f32::consts::FRAC_PI_2, 0.0));
        assert!(c.eye.distance(Vec3::new(-4.0, 0.0, 1.0)) < 1e-5, "{}", c.eye);
        for _ in 0..100 {
            orbit(&mut c, Vec2::new(0.01, -0.1));
        }
        let d = c.eye - c.target;
        assert!((d.length() - 4.0).abs() < 1e-3 && d.z.abs() < 4.0 && d.truncate().length() > 0.05, "{d}");
    }

    #[test]
    fn what_is_dragged_stays_under_the_mouse() {
        let mut c = camera();
        let point = Vec3::new(0.3, 0.0, 1.2);
        let before = c.project(point, 800, 600).unwrap();
        pan(&mut c, Vec2::new(0.25, -0.125));
        let after = c.project(point, 800, 600).unwrap();
        assert!((after - before).truncate().distance(600.0 * Vec2::new(0.25, -0.125)) < 1e-2, "{}", after - before);
        zoom(&mut c, 0.5);
        assert!((c.eye.distance(c.target) - 2.0).abs() < 1e-5);
        fly(&mut c, Vec3::new(0.0, 0.5, 0.0));
        assert!((c.eye.y + 1.0).abs() < 1e-5 && (c.eye.distance(c.target) - 2.0).abs() < 1e-5, "{}", c.eye);
    }
}
