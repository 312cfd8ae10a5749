//! Scripted motion (E15): what the user writes of a body that moves as told, and its place and velocity at any time.
//!
//! In: the scene's `motion`, where the body stands at the beginning. Out: a [`Path`]; the stage `drift` asks it for a
//! [`Pose`] each step. Velocities are continuous, but for the jump with which a rotation or translation begins.

use super::no_rotation;
use glam::{DQuat, DVec3, DVec4};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// How a body moves that nothing can stop.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Motion {
    /// It stands.
    #[default]
    None,
    /// It moves on.
    Translation {
        /// Velocity (m/s).
        velocity: [f64; 3],
        /// When it begins (s).
        #[serde(default)]
        start: f64,
        /// When it ends (s).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        stop: Option<f64>,
    },
    /// It turns about an axis.
    Rotation {
        /// Direction of the axis.
        axis: [f64; 3],
        /// A point on the axis (m).
        center: [f64; 3],
        /// Angular velocity (rad/s).
        rate: f64,
        /// When it begins (s).
        #[serde(default)]
        start: f64,
        /// When it ends (s).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        stop: Option<f64>,
    },
    /// It swings: `sin(2 pi t / period + phase)` less its value at the start. A phase of 90 degrees starts from rest.
    Oscillation(Oscillation),
    /// It passes through places at given times, with a continuous velocity, at rest before the first and after the last.
    Keyframes(Vec<Keyframe>),
}

/// A swing, of the place, of the angle, or of both.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Oscillation {
    /// Amplitude of the place (m).
    #[serde(default)]
    pub amplitude: [f64; 3],
    /// Amplitude of the angle (degrees) about `axis` through `center`.
    #[serde(default)]
    pub angle: f64,
    /// Direction of the axis of the angle.
    #[serde(default = "y_axis")]
    pub axis: [f64; 3],
    /// A point on that axis (m).
    #[serde(default)]
    pub center: [f64; 3],
    /// Period.
    pub period: f64,
    /// Phase at the start (degrees).
    #[serde(default)]
    pub phase: f64,
    /// When it begins (s).
    #[serde(default)]
    pub start: f64,
    /// When it ends (s).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stop: Option<f64>,
}

fn y_axis() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

/// Where a body is at one time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Keyframe {
    /// Time (s).
    pub time: f64,
    /// Where the origin of the shape's frame is (m).
    pub position: [f64; 3],
    /// Rotation about that origin: axis x, y, z and an angle in degrees; the shorter way is taken to the next.
    #[serde(default = "no_rotation")]
    pub rotation: [f64; 4],
}

/// Shaking of the whole scene: what is felt in a tank that sways. The tank stands still in the scene's frame, and
/// gravity changes by the opposite of its acceleration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Shake {
    /// Amplitude (m): the tank is displaced by `amplitude sin(2 pi t / period + phase)`.
    pub amplitude: [f64; 3],
    /// Period.
    pub period: f64,
    /// Phase at the start (degrees).
    #[serde(default)]
    pub phase: f64,
    /// When it begins (s).
    #[serde(default)]
    pub start: f64,
    /// When it ends (s).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stop: Option<f64>,
}

impl Shake {
    /// What is added to gravity at a time (m/s^2).
    pub fn felt(&self, time: f64) -> DVec3 {
        if time < self.start || self.stop.is_some_and(|s| time >= s) {
            return DVec3::ZERO;
        }
        let rate = TAU / self.period;
        let angle = rate * (time - self.start) + self.phase.to_radians();
        DVec3::from(self.amplitude) * (rate * rate * angle.sin())
    }
}

/// Place, velocity and acceleration of a scripted body at one time.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    /// Place of the centre of mass (m).
    pub x: DVec3,
    /// Orientation.
    pub q: DQuat,
    /// Velocity (m/s).
    pub v: DVec3,
    /// Angular velocity (rad/s).
    pub omega: DVec3,
    /// Acceleration (m/s^2).
    pub a: DVec3,
    /// Angular acceleration (rad/s^2).
    pub alpha: DVec3,
}

/// The motion of one body.
#[derive(Clone, Debug)]
pub struct Path {
    motion: Motion,
    /// Centre of mass and orientation at the beginning.
    x: DVec3,
    q: DQuat,
    /// Centre of mass in the shape's frame (m).
    center: DVec3,
}

/// A sine that starts at zero: value, first and second derivative at a time.
fn swing(o: &Oscillation, time: f64) -> [f64; 3] {
    let (t, moving) = clock(time, o.start, o.stop);
    let (rate, phase) = (TAU / o.period, o.phase.to_radians());
    let angle = rate * t + phase;
    let on = if moving { 1.0 } else { 0.0 };
    [angle.sin() - phase.sin(), on * rate * angle.cos(), -on * rate * rate * angle.sin()]
}

/// Time since the start, no longer than until the stop, and whether the motion is on.
fn clock(time: f64, start: f64, stop: Option<f64>) -> (f64, bool) {
    let stop = stop.unwrap_or(f64::INFINITY);
    (time.min(stop).max(start) - start, time >= start && time <= stop)
}

impl Path {
    /// The motion of a body that begins with its centre of mass, `center` in the shape's frame, at `x`, turned by `q`.
    pub fn new(motion: Motion, x: DVec3, q: DQuat, center: DVec3) -> Self {
        Self { motion, x, q, center }
    }

    /// Where the body is at a time (s).
    pub fn at(&self, time: f64) -> Pose {
        let rest =
            Pose { x: self.x, q: self.q, v: DVec3::ZERO, omega: DVec3::ZERO, a: DVec3::ZERO, alpha: DVec3::ZERO };
        match &self.motion {
            Motion::None => rest,
            Motion::Translation { velocity, start, stop } => {
                let (t, moving) = clock(time, *start, *stop);
                let v = DVec3::from(*velocity);
                Pose { x: self.x + t * v, v: if moving { v } else { DVec3::ZERO }, ..rest }
            }
            Motion::Rotation { axis, center, rate, start, stop } => {
                let (t, moving) = clock(time, *start, *stop);
                let on = if moving { 1.0 } else { 0.0 };
                self.turned(DVec3::from(*axis), DVec3::from(*center), [rate * t, on * rate, 0.0])
            }
            Motion::Oscillation(o) => {
                let s = swing(o, time);
                let turned =
                    self.turned(DVec3::from(o.axis), DVec3::from(o.center), s.map(|s| s * o.angle.to_radians()));
                let along = DVec3::from(o.amplitude);
                Pose { x: turned.x + s[0] * along, v: turned.v + s[1] * along, a: turned.a + s[2] * along, ..turned }
            }
            Motion::Keyframes(keys) => self.between(keys, time),
        }
    }

    /// The body turned from its beginning; `angle` with its two derivatives.
    fn turned(&self, axis: DVec3, center: DVec3, angle: [f64; 3]) -> Pose {
        let axis = axis.normalize_or_zero();
        let turn = DQuat::from_axis_angle(axis, angle[0]);
        let arm = turn * (self.x - center);
        let (omega, alpha) = (axis * angle[1], axis * angle[2]);
        let v = omega.cross(arm);
        Pose { x: center + arm, q: turn * self.q, v, omega, a: alpha.cross(arm) + omega.cross(v), alpha }
    }

    /// Cubic Hermite curves through places and quaternions, with the tangents of Catmull and Rom.
    fn between(&self, keys: &[Keyframe], time: f64) -> Pose {
        let place = |k: usize| DVec3::from(keys[k].position).extend(0.0);
        let mut turns: Vec<DVec4> = Vec::with_capacity(keys.len());
        for key in keys {
            let q = DVec4::from_array(super::axis_angle(key.rotation).to_array());
            let shorter = turns.last().is_none_or(|before| before.dot(q) >= 0.0);
            turns.push(if shorter { q } else { -q });
        }
        let times: Vec<f64> = keys.iter().map(|k| k.time).collect();
        let [x, v, a] = hermite(&times, place, time).map(DVec4::truncate);
        let [p, p_1, p_2] = hermite(&times, |k| turns[k], time);
        // the unit quaternion along the curve, and its derivatives
        let length = p.length();
        let q = p / length;
        let along = q.dot(p_1) / length;
        let q_1 = p_1 / length - q * along;
        let q_2 = p_2 / length - 2.0 * along * q_1 - q * (q.dot(p_2) / length + q_1.dot(p_1) / length - along * along);
        let quat = |v: DVec4| DQuat::from_array(v.to_array());
        let inverse = quat(q).conjugate();
        let vector = |q: DQuat| DVec3::new(q.x, q.y, q.z);
        // omega = 2 q' q^-1; alpha = its derivative, without the part along q
        let omega = 2.0 * vector(quat(q_1).mul_quat(inverse));
        let alpha = 2.0 * vector(quat(q_2).mul_quat(inverse));
        let q = quat(q);
        let arm = q * self.center;
        let v_arm = omega.cross(arm);
        Pose { x: x + arm, q, v: v + v_arm, omega, a: a + alpha.cross(arm) + omega.cross(v_arm), alpha }
    }

    /// Largest speed of any point closer than `reach` to the centre of mass (m/s), until a time (s).
    pub fn largest_speed(&self, reach: f64, until: f64) -> f64 {
        let at = |n: i32| self.at(until * f64::from(n) / 1000.0);
        (0..=1000).map(at).map(|p| p.v.length() + p.omega.length() * reach).fold(0.0, f64::max)
    }
}

/// Value and two derivatives of the curve through `value(k)` at `times[k]`, at rest outside.
fn hermite(times: &[f64], value: impl Fn(usize) -> DVec4, time: f64) -> [DVec4; 3] {
    let last = times.len() - 1;
    if time <= times[0] || time >= times[last] {
        return [value(if time <= times[0] { 0 } else { last }), DVec4::ZERO, DVec4::ZERO];
    }
    let tangent = |k: usize| {
        if k == 0 || k == last { DVec4::ZERO } else { (value(k + 1) - value(k - 1)) / (times[k + 1] - times[k - 1]) }
    };
    let k = times.partition_point(|&t| t <= time) - 1;
    let h = times[k + 1] - times[k];
    let s = (time - times[k]) / h;
    let (a, b, m, n) = (value(k), value(k + 1), tangent(k) * h, tangent(k + 1) * h);
    let (c_2, c_3) = (3.0 * (b - a) - 2.0 * m - n, 2.0 * (a - b) + m + n);
    [
        a + s * (m + s * (c_2 + s * c_3)),
        (m + s * (2.0 * c_2 + 3.0 * s * c_3)) / h,
        (2.0 * c_2 + 6.0 * s * c_3) / (h * h),
    ]
}

impl super::Scene {
    /// A period above zero.
    pub(crate) fn check_period(&self, period: f64, key: &str) -> crate::error::Result<()> {
        if period > 0.0 {
            return Ok(());
        }
        Err(self.error(key, format!("`{key}`: period = {period} is not positive"), "give a period above 0 s"))
    }

    /// What is wrong with a motion, if anything: `key` is its path in the scene.
    pub(crate) fn check_motion(&self, motion: &Motion, key: &str) -> crate::error::Result<()> {
        let flat = self.world.dimensions == 2;
        let (axis, path): ([f64; 3], [f64; 3]) = match motion {
            Motion::None => return Ok(()),
            Motion::Translation { velocity, .. } => (y_axis(), *velocity),
            Motion::Rotation { axis, .. } => (*axis, [0.0; 3]),
            Motion::Oscillation(o) => {
                self.check_period(o.period, key)?;
                (o.axis, o.amplitude)
            }
            Motion::Keyframes(keys) => {
                if keys.len() < 2 || keys.windows(2).any(|w| w[1].time <= w[0].time) {
                    let message = format!("`{key}` needs at least two keyframes, each later than the one before");
                    return Err(self.error(key, message, "sort the keyframes by time, and give at least two"));
                }
                let wrong = |k: &Keyframe| k.position[1] != 0.0 || k.rotation[0] != 0.0 || k.rotation[2] != 0.0;
                let turned = |k: &Keyframe| k.rotation[3] != 0.0;
                if flat && keys.iter().any(|k| k.position[1] != 0.0 || (turned(k) && wrong(k))) {
                    (y_axis(), [0.0, 1.0, 0.0])
                } else {
                    (y_axis(), [0.0; 3])
                }
            }
        };
        if DVec3::from(axis).length() == 0.0 {
            return Err(self.error(key, format!("`{key}`: the axis has no direction"), "give an axis, e.g. [0, 1, 0]"));
        }
        if flat && (path[1] != 0.0 || axis[0] != 0.0 || axis[2] != 0.0) {
            let message = format!("`{key}` leaves the x-z plane of a 2D scene");
            return Err(self.error(key, message, "move along x and z only, and turn about y"));
        }
        Ok(())
    }
}
