//! The mouse in the picture: what it points at, and what it does there.

use crate::camera::View;
use crate::show::{Form, Show};
use crate::{Camera, Frame};
use glam::{Vec2, Vec3};
use jetsam::state::Kind;
use jetsam::world::Grip;

/// What the left button does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tool {
    /// Grabs a body, or turns the camera where there is none.
    #[default]
    Grab,
    /// Pours fluid.
    Pour,
    /// Frightens agents.
    Scare,
}

impl Tool {
    /// All of them, with their names.
    pub const ALL: [(Tool, &str); 3] = [(Tool::Grab, "grab"), (Tool::Pour, "pour"), (Tool::Scare, "scare")];
}

/// A line of sight: from the eye, of unit length.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    pub from: Vec3,
    pub along: Vec3,
}

impl Ray {
    /// Through a place in a picture of a size, both in the same unit, from the upper left corner.
    pub fn through(camera: &Camera, place: Vec2, size: Vec2) -> Self {
        let view = View::new(camera, size.x, size.y);
        Self { from: view.eye, along: view.ray(view.slope(place)).normalize() }
    }

    pub fn at(&self, distance: f32) -> Vec3 {
        self.from + distance * self.along
    }

    /// Distance to where it enters a ball.
    fn meets(&self, center: Vec3, radius: f32) -> Option<f32> {
        let d = center - self.from;
        let closest = d.dot(self.along);
        let miss = (d - closest * self.along).length_squared();
        let half = radius * radius - miss;
        (half > 0.0 && closest > 0.0).then(|| closest - half.sqrt())
    }

    /// Distance to a plane through a point.
    pub fn plane(&self, point: Vec3, normal: Vec3) -> Option<f32> {
        let t = (point - self.from).dot(normal) / self.along.dot(normal);
        (t.is_finite() && t > 0.0).then_some(t)
    }
}

/// What a line of sight meets first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Met {
    pub distance: f32,
    pub kind: Kind,
    /// Index of the fluid or body.
    pub owner: u32,
}

/// The first particle on a line of sight, of those that `wanted` lets through; walls are never met.
pub fn pick(frame: &Frame, show: &Show, ray: Ray, wanted: impl Fn(Kind) -> bool) -> Option<Met> {
    let mut nearest: Option<Met> = None;
    if frame.lent.is_some() {
        // the particles are not at hand: bodies as balls
        let bodies = frame.poses.iter().zip(&show.bodies).enumerate();
        for (k, ((x, _), look)) in bodies.filter(|(_, (_, look))| !look.fixed && wanted(Kind::Rigid)) {
            let met = ray.meets(x.as_vec3(), 0.8 * look.radius);
            if let Some(distance) = met.filter(|t| nearest.is_none_or(|n| *t < n.distance)) {
                nearest = Some(Met { distance, kind: Kind::Rigid, owner: k as u32 });
            }
        }
    }
    for kind in Kind::ALL.into_iter().filter(|k| wanted(*k)) {
        for i in frame.segment(kind) {
            let owner = frame.tag[i][1];
            let hidden =
                kind == Kind::Static && show.bodies.get(owner as usize).is_none_or(|b| matches!(b.form, Form::Hidden));
            let met = ray.meets(frame.record[i].x.into(), 0.7 * show.spacing).filter(|_| !hidden);
            if let Some(distance) = met.filter(|t| nearest.is_none_or(|n| *t < n.distance)) {
                nearest = Some(Met { distance, kind, owner });
            }
        }
    }
    nearest
}

/// Where a line of sight meets matter, else the ground, else the middle of the domain's depth.
pub fn pointed(frame: &Frame, show: &Show, ray: Ray) -> Vec3 {
    let matter = pick(frame, show, ray, |_| true).map(|m| m.distance);
    let ground = show.ground.and_then(|z| ray.plane(Vec3::Z * z, Vec3::Z));
    let middle = 0.5 * (show.bounds[0] + show.bounds[1]);
    let distance = matter.or(ground).or_else(|| ray.plane(middle, ray.along)).unwrap_or(1.0);
    ray.at(distance).clamp(show.bounds[0], show.bounds[1])
}

/// The agent nearest to a line of sight.
pub fn nearest_agent(frame: &Frame, ray: Ray) -> Option<Vec3> {
    let off = |x: &Vec3| {
        let d = *x - ray.from;
        (d - d.dot(ray.along) * ray.along).length_squared()
    };
    frame.agents.iter().map(|r| Vec3::from(r.x)).min_by(|a, b| off(a).total_cmp(&off(b)))
}

/// A body in the hand.
#[derive(Clone, Copy, Debug)]
pub struct Held {
    grip: Grip,
    /// The plane in which it is moved: a point and the line of sight when it was grabbed.
    plane: [Vec3; 2],
}

impl Held {
    /// Grabs the rigid body that is pointed at, if there is one before anything else but fluid.
    pub fn grab(frame: &Frame, show: &Show, camera: &Camera, ray: Ray) -> Option<Self> {
        let met = pick(frame, show, ray, |kind| kind != Kind::Fluid)?;
        if met.kind != Kind::Rigid {
            return None;
        }
        let body = met.owner as usize;
        let place = ray.at(met.distance);
        let (center, turn) = *frame.poses.get(body)?;
        let at = turn.inverse() * (place.as_dvec3() - center);
        let forward = (camera.target - camera.eye).normalize_or(Vec3::Y);
        Some(Self { grip: Grip { body, at, to: place.as_dvec3() }, plane: [place, forward] })
    }

    /// Drawn to where another line of sight meets the plane, inside the domain.
    pub fn drawn(&mut self, show: &Show, ray: Ray) -> Grip {
        if let Some(t) = ray.plane(self.plane[0], self.plane[1]) {
            let margin = Vec3::splat(show.spacing).min(0.4 * (show.bounds[1] - show.bounds[0]));
            self.grip.to = ray.at(t).clamp(show.bounds[0] + margin, show.bounds[1] - margin).as_dvec3();
        }
        self.grip
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DQuat, DVec3, vec2};
    use jetsam::state::Record;

    fn frame() -> (Frame, Show) {
        let scene = jetsam::Scene::open("dam-break", &["resolution.spacing=0.1".into()]).unwrap();
        let show = Show::new(&scene, &jetsam::World::from_scene(&scene).unwrap(), 1.0);
        let at = |x: [f32; 3]| Record { x, ..Record::default() };
        let frame = Frame {
            record: vec![at([0.0, 5.0, 0.0]), at([0.0, 7.0, 0.0])],
            push: vec![[0.0; 4]; 2],
            tag: vec![[0, 0], [0, 0]],
            first: [0, 1, 2],
            count: [1, 1, 0],
            poses: vec![(DVec3::new(0.0, 7.0, 0.0), DQuat::IDENTITY)],
            ..Frame::default()
        };
        (frame, Show { spacing: 0.1, bounds: [Vec3::splat(-9.0), Vec3::splat(9.0)], ..show })
    }

    #[test]
    fn the_mouse_finds_the_body_behind_the_water() {
        let (frame, show) = frame();
        let camera = Camera { eye: Vec3::ZERO, target: Vec3::Y, up: Vec3::Z, fov_y: 1.0 };
        let ray = Ray::through(&camera, vec2(50.0, 50.0), vec2(100.0, 100.0));
        let first = pick(&frame, &show, ray, |_| true).unwrap();
        assert!(first.kind == Kind::Fluid && (first.distance - 4.93).abs() < 1e-4, "{first:?}");
        let mut held = Held::grab(&frame, &show, &camera, ray).unwrap();
        // a quarter of the picture's height aside, at a depth of 6.93: tan(0.5) / 2 of it
        let aside = Ray::through(&camera, vec2(75.0, 50.0), vec2(100.0, 100.0));
        let to = held.drawn(&show, aside).to;
        let x = 6.93 * f64::from((0.5f32).tan()) * 0.5;
        assert!(to.distance(DVec3::new(x, 6.93, 0.0)) < 1e-3, "{to}");
        let past = Ray::through(&camera, vec2(5.0, 5.0), vec2(100.0, 100.0));
        assert!(Held::grab(&frame, &show, &camera, past).is_none());
    }
}
