//! Every number a user can set, once: path in the scene file, unit, default and range.
//!
//! The scene's defaults, its checks, `--set`, the JSON schema and (later) sliders are derived from this table;
//! what a parameter means is the doc comment of its field in [`crate::scene`].

use serde::Serialize;

/// One number of the scene file. A vector's components obey the same range.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Param {
    /// Dotted path; a table of an array of tables is named without index: `fluid.density`.
    pub path: &'static str,
    /// Unit, SI; `dx` stands for the particle spacing, `1` for a pure number.
    pub unit: &'static str,
    /// Value when the scene says nothing; `None` where it is derived or required.
    pub default: Option<f64>,
    /// Smallest value allowed.
    pub min: f64,
    /// Largest value allowed.
    pub max: f64,
}

macro_rules! params {
    (@default $value:literal) => { Some($value) };
    (@default $value:tt) => { None };
    (@function $name:ident $value:literal) => { pub(crate) fn $name() -> f64 { $value } };
    (@function $name:ident $value:tt) => {};
    ($( $name:ident: $path:literal, $unit:literal, $default:tt, $min:expr, $max:expr; )*) => {
        /// The table.
        pub const PARAMS: &[Param] = &[
            $( Param { path: $path, unit: $unit, default: params!(@default $default), min: $min, max: $max }, )*
        ];

        /// Defaults, named for serde.
        pub(crate) mod default {
            $( params!(@function $name $default); )*
        }
    };
}

// `_` marks a number that is required or derived.
params! {
    gravity: "world.gravity", "m/s^2", _, -1e4, 1e4;
    spacing: "resolution.spacing", "m", _, 1e-7, 1e3;
    seconds: "run.seconds", "s", 2.0, 0.0, 1e6;
    frames_per_second: "run.frames_per_second", "1/s", 50.0, 1e-3, 1e9;
    lost_allowed: "run.lost_allowed", "1", 0.0, 0.0, 1e12;
    support: "solver.support", "dx", 2.0, 1.5, 4.0;
    sound_speed: "solver.sound_speed", "m/s", _, 1e-9, 1e6;
    artificial_viscosity: "solver.artificial_viscosity", "1", 0.05, 0.0, 10.0;
    xsph: "solver.xsph", "1", 0.0, 0.0, 1.0;
    dt: "solver.dt", "s", _, 1e-12, 1e3;
    courant: "solver.courant", "1", 0.4, 1e-3, 1.0;
    courant_force: "solver.courant_force", "1", 0.25, 1e-3, 1.0;
    courant_viscous: "solver.courant_viscous", "1", 0.5, 1e-3, 1.0;
    contact_overlap: "solver.contact_overlap", "dx", 0.5, 1e-4, 1.0;
    contact_diameter: "solver.contact_diameter", "dx", 1.0, 0.1, 1.5;
    sleep: "solver.sleep", "s", 0.5, 0.0, 1e9;
    settle: "solver.settle", "s", 0.0, 0.0, 1e3;
    fluid_density: "fluid.density", "kg/m^3", 1000.0, 1e-6, 1e6;
    fluid_viscosity: "fluid.viscosity", "Pa s", 0.001, 0.0, 1e6;
    fluid_velocity: "fluid.velocity", "m/s", _, -1e5, 1e5;
    rigid_density: "rigid.density", "kg/m^3", _, 1e-6, 1e6;
    rigid_mass: "rigid.mass", "kg", _, 1e-12, 1e12;
    rigid_velocity: "rigid.velocity", "m/s", _, -1e5, 1e5;
    rigid_spin: "rigid.spin", "rad/s", _, -1e5, 1e5;
    rigid_restitution: "rigid.restitution", "1", 0.3, 0.001, 1.0;
    rigid_stiffness: "rigid.stiffness", "N/m", _, 1e-9, 1e15;
    rigid_damping: "rigid.damping", "N s/m", _, 0.0, 1e12;
    rigid_friction: "rigid.friction", "1", 0.4, 0.0, 10.0;
    static_friction: "static.friction", "1", _, 0.0, 10.0;
    joint_stiffness: "joint.stiffness", "N/m", 1000.0, 0.0, 1e15;
    joint_damping: "joint.damping", "N s/m", _, 0.0, 1e12;
    joint_length: "joint.length", "m", _, 0.0, 1e6;
    fov: "camera.fov", "degrees", 35.0, 1.0, 170.0;
}

/// The parameter at a path written without indices.
pub fn find(path: &str) -> Option<&'static Param> {
    PARAMS.iter().find(|p| p.path == path)
}
