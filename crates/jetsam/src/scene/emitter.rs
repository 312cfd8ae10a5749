//! Where fluid comes from and where it goes: hoses, bursts, sinks (E31).

use super::Shape;
use crate::params::default as d;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A source of fluid.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Emitter {
    /// Name; `emitter` when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Name of the fluid it gives; the first one when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fluid: Option<String>,
    /// How the fluid comes out.
    pub outlet: Outlet,
    /// When it begins.
    #[serde(default = "d::emitter_start")]
    pub start: f64,
    /// When it ends; never when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stop: Option<f64>,
    /// Most particles it gives.
    #[serde(default = "d::emitter_count")]
    pub count: f64,
    /// How far particles are displaced at random.
    #[serde(default = "d::emitter_jitter")]
    pub jitter: f64,
}

/// How fluid comes out of an emitter.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Outlet {
    /// A steady stream from a disc (in 2D a slit). Give either its speed or its rate.
    Hose {
        /// Centre of the disc (m).
        center: [f64; 3],
        /// Direction of the stream.
        axis: [f64; 3],
        /// Radius (m).
        radius: f64,
        /// Speed (m/s).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        speed: Option<f64>,
        /// Volume per second (m^3/s; m^2/s in 2D).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        rate: Option<f64>,
    },
    /// A shape filled at once, and again after each period where there is room.
    Burst {
        /// The shape.
        shape: Shape,
        /// Velocity of the particles (m/s).
        #[serde(default)]
        velocity: [f64; 3],
        /// Time until it is filled again (s); once when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        period: Option<f64>,
    },
}

/// A place where fluid vanishes.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sink {
    /// A box, a ball or a cylinder.
    pub shape: Shape,
    /// When it opens.
    #[serde(default = "d::sink_start")]
    pub start: f64,
    /// When it closes; never when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stop: Option<f64>,
}
