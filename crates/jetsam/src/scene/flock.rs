//! `[[flock]]`: what the user writes about a flock.

use super::Shape;
use crate::params::default as d;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A flock: agents of one species.
///
/// Weights are pure numbers. With the speed `U` and the radius `R` of the flock, `T = R / U` makes accelerations of them: a weight
/// of 1 acts within the time an agent takes to cross its radius.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Flock {
    /// Name of the species; `flock` when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// How many agents.
    pub count: u32,
    /// Where they are at the beginning: at random in the shape, or one at each of its points.
    pub shape: Shape,
    /// Direction they fly in at the beginning; at random when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heading: Option<[f64; 3]>,
    /// The laws they follow.
    #[serde(default)]
    pub model: FlockModel,
    /// How far they perceive each other, `R`. Of Couzin's zones the outermost, of Vicsek's law the radius.
    pub radius: f64,
    /// Below it they keep apart; `0.4 R` when absent (`R` when the zones are Couzin's).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub separation_radius: Option<f64>,
    /// Below it they align; `R` when absent. Couzin: outer radius of the zone of orientation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub alignment_radius: Option<f64>,
    /// Below it they draw together; `R` when absent. Couzin: outer radius of the zone of attraction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cohesion_radius: Option<f64>,
    /// How far they see what they flee or chase; `R` when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sight: Option<f64>,
    /// Whole angle of perception about the heading. Keeping apart in Couzin's model is blind to it.
    #[serde(default = "d::flock_field_of_view")]
    pub field_of_view: f64,
    /// Topological neighbours (E25): so many nearest, however far; 0 for all within the radii.
    #[serde(default)]
    pub neighbours: u32,
    /// Speed `U` at the beginning, and at which they cruise; Couzin, Vicsek: their speed.
    pub speed: f64,
    /// Never slower; half the speed when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_min: Option<f64>,
    /// Never faster; one and a half times the speed when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_max: Option<f64>,
    /// Largest rate of turning; unlimited when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turn: Option<f64>,
    /// Largest steering; unlimited when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub acceleration: Option<f64>,
    /// Weight of keeping apart.
    #[serde(default = "d::flock_separation")]
    pub separation: f64,
    /// Weight of flying as the others do.
    #[serde(default = "d::flock_alignment")]
    pub alignment: f64,
    /// Weight of drawing together.
    #[serde(default = "d::flock_cohesion")]
    pub cohesion: f64,
    /// Weight of returning to the speed `U`.
    #[serde(default = "d::flock_cruise")]
    pub cruise: f64,
    /// Weight of a drift that wanders, a new direction about every `T`.
    #[serde(default = "d::flock_wander")]
    pub wander: f64,
    /// A place (m) they seek.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goal: Option<[f64; 3]>,
    /// Weight of seeking the goal.
    #[serde(default = "d::flock_seek")]
    pub seek: f64,
    /// Closer to the goal than this they slow down, so as to arrive; 0 to pass through.
    #[serde(default = "d::flock_arrive")]
    pub arrive: f64,
    /// Name of the flock whose first agent they follow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub leader: Option<String>,
    /// Weight of following the leader.
    #[serde(default = "d::flock_follow")]
    pub follow: f64,
    /// How far behind the leader they stay, and ahead of it they give way; `R` when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub follow_distance: Option<f64>,
    /// What they do about other flocks, by name; also about `bodies` (flee) and `fluids` (flee, or school: stay in them). Their own
    /// kind they school with, all else they ignore.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub meets: BTreeMap<String, Relation>,
    /// Weight of fleeing.
    #[serde(default = "d::flock_flee")]
    pub flee: f64,
    /// Weight of chasing.
    #[serde(default = "d::flock_chase")]
    pub chase: f64,
    /// Weight of steering round bodies and walls ahead. Whatever it is, they never enter them.
    #[serde(default = "d::flock_avoid")]
    pub avoid: f64,
    /// How far ahead in time they look for bodies and walls; `T` when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub look_ahead: Option<f64>,
    /// Closer to a side of the domain than this they steer back; when absent `R` at solid sides and 0 at open ones, which they
    /// then pass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub margin: Option<f64>,
    /// Vicsek: full width of the uniform angle added each `tau`. Couzin: standard deviation of the angle.
    #[serde(default = "d::flock_noise")]
    pub noise: f64,
    /// Time between decisions; when absent 1 s for Vicsek, 0.1 s for Couzin, every step for Reynolds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tau: Option<f64>,
    /// Mass of an agent. Agents that have one are dragged by fluids (E27) and pushed by bodies (E28), and push them; they carry their own
    /// weight. The others only look.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass: Option<f64>,
    /// Coefficient of drag `C_d` of agents that have a mass.
    #[serde(default = "d::flock_drag")]
    pub drag: f64,
    /// Radius of an agent: how close its centre comes to walls and bodies, and with `mass` its cross-section.
    #[serde(default = "d::flock_size")]
    pub size: f64,
}

/// The laws a flock follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum FlockModel {
    /// E22: weighted steering (Reynolds 1987, 1999).
    #[default]
    Reynolds,
    /// E23: zones of repulsion, orientation and attraction (Couzin et al. 2002).
    Couzin,
    /// E24: the mean direction and noise (Vicsek et al. 1995).
    Vicsek,
}

/// What agents do about those of another kind (E26).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Relation {
    /// Treat them as their own.
    School,
    /// Take no notice.
    Ignore,
    /// Get away.
    Flee,
    /// Go after them.
    Chase,
}
