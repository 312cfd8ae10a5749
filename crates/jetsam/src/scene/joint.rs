//! Joints: what the user writes of a connection of two bodies, or of a body and the world.

use super::Scene;
use crate::error::Result;
use crate::params::default as d;
use glam::{DQuat, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A connection of two bodies, or of a body and the world.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    /// What it leaves free.
    pub kind: JointKind,
    /// Name of a rigid body; copies carry a number: `link-3`.
    pub a: String,
    /// Name of another body, rigid or static; the world when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub b: Option<String>,
    /// Where they are joined at the beginning (m).
    pub anchor: [f64; 3],
    /// Spring: where its other end is fixed to `b` at the beginning (m); `anchor` when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub anchor_b: Option<[f64; 3]>,
    /// Hinge: direction of its axis at the beginning.
    #[serde(default = "z_axis")]
    pub axis: [f64; 3],
    /// Hinge: smallest and largest angle (degrees) that `a` may turn about the axis, seen from `b`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limits: Option<[f64; 2]>,
    /// Spring constant.
    #[serde(default = "d::joint_stiffness")]
    pub stiffness: f64,
    /// Dashpot along the spring.
    #[serde(default)]
    pub damping: f64,
    /// Length at which the spring is at rest; that at the beginning when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length: Option<f64>,
    /// Whether the two bodies still touch each other.
    #[serde(default)]
    pub collide: bool,
}

fn z_axis() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

/// What a joint leaves free.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum JointKind {
    /// All rotations about a point.
    Ball,
    /// The rotation about an axis.
    Hinge,
    /// Nothing: two bodies are one.
    Fixed,
    /// Everything: a spring and a dashpot pull along the line of two points.
    Spring,
}

/// A joint between bodies of a world.
#[derive(Clone, Debug)]
pub struct JointModel {
    /// What it leaves free.
    pub kind: JointKind,
    /// Index of the first body.
    pub a: usize,
    /// Index of the second; `None` for the world.
    pub b: Option<usize>,
    /// Anchors in the bodies' frames about their centres of mass (m), or in the world.
    pub anchor: [DVec3; 2],
    /// Axis of a hinge in both frames.
    pub axis: [DVec3; 2],
    /// A direction across it in both frames, the same at the beginning.
    pub across: [DVec3; 2],
    /// Orientation of `a` seen from `b` at the beginning.
    pub turn: DQuat,
    /// Smallest and largest angle of a hinge (rad).
    pub limits: Option<[f64; 2]>,
    /// Spring constant (N/m).
    pub stiffness: f64,
    /// Dashpot (N s/m).
    pub damping: f64,
    /// Rest length (m).
    pub length: f64,
}

impl Scene {
    /// The joints, between bodies given by name, place and orientation; `moves` tells whether forces move a body.
    pub(crate) fn joints(&self, bodies: &[(&str, DVec3, DQuat, bool)]) -> Result<Vec<JointModel>> {
        let mut all = Vec::new();
        for (index, joint) in self.joint.iter().enumerate() {
            let key = format!("joint.{index}");
            let find = |field: &str, name: &str| {
                bodies.iter().position(|b| b.0 == name).ok_or_else(|| {
                    let known: Vec<&str> = bodies.iter().map(|b| b.0).take(12).collect();
                    let message = format!("`{key}.{field}`: there is no body `{name}`");
                    self.error(&format!("{key}.{field}"), message, format!("the bodies are {}", known.join(", ")))
                })
            };
            let a = find("a", &joint.a)?;
            let b = joint.b.as_deref().map(|name| find("b", name)).transpose()?;
            if !bodies[a].3 || b == Some(a) {
                let message = format!("`{key}`: `{}` must be a rigid body, and not joined to itself", joint.a);
                return Err(self.error(&format!("{key}.a"), message, "name a rigid body as `a`, another one as `b`"));
            }
            let axis = DVec3::from(joint.axis);
            if axis.length() == 0.0 {
                let message = format!("`{key}.axis` has no direction");
                return Err(self.error(&format!("{key}.axis"), message, "give an axis, e.g. [0, 1, 0]"));
            }
            if joint.limits.is_some_and(|[low, high]| low > 0.0 || high < 0.0 || low < -180.0 || high > 180.0) {
                let message = format!("`{key}.limits` must hold 0, where the hinge begins, within [-180, 180]");
                return Err(self.error(&format!("{key}.limits"), message, "give e.g. limits = [-30, 90]"));
            }
            let frame =
                |body: Option<usize>| body.map_or((DVec3::ZERO, DQuat::IDENTITY), |i| (bodies[i].1, bodies[i].2));
            let ((x_a, q_a), (x_b, q_b)) = (frame(Some(a)), frame(b));
            let (end_a, end_b) = (DVec3::from(joint.anchor), DVec3::from(joint.anchor_b.unwrap_or(joint.anchor)));
            let axis = if self.world.dimensions == 2 { DVec3::Y } else { axis.normalize() };
            let across = axis.any_orthonormal_vector();
            let both = |v: DVec3| [q_a.inverse() * v, q_b.inverse() * v];
            all.push(JointModel {
                kind: joint.kind,
                a,
                b,
                anchor: [q_a.inverse() * (end_a - x_a), q_b.inverse() * (end_b - x_b)],
                axis: both(axis),
                across: both(across),
                turn: q_b.inverse() * q_a,
                limits: joint.limits.map(|l| l.map(f64::to_radians)),
                stiffness: joint.stiffness,
                damping: joint.damping,
                length: joint.length.unwrap_or((end_b - end_a).length()),
            });
        }
        Ok(all)
    }
}
