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
    shifting: "solver.shifting", "1", 0.0, 0.0, 5.0;
    curvature: "solver.curvature", "1", 0.9, 0.0, 1.0;
    vorticity: "solver.vorticity", "1/s", 0.0, 0.0, 1e3;
    density_diffusion: "solver.density_diffusion", "1", 0.1, 0.0, 1.0;
    dt: "solver.dt", "s", _, 1e-12, 1e3;
    courant: "solver.courant", "1", 0.4, 1e-3, 1.0;
    courant_force: "solver.courant_force", "1", 0.25, 1e-3, 1.0;
    courant_viscous: "solver.courant_viscous", "1", 0.125, 1e-3, 1.0;
    courant_flow: "solver.courant_flow", "1", _, 1e-3, 4.0;
    longest_dt: "solver.longest_dt", "s", _, 1e-9, 1.0;
    tolerance: "solver.tolerance", "1", 0.001, 1e-6, 0.5;
    divergence_tolerance: "solver.divergence_tolerance", "1", 0.0001, 1e-6, 0.5;
    iterations: "solver.iterations", "1", 100.0, 1.0, 10000.0;
    contact_overlap: "solver.contact_overlap", "dx", 0.5, 1e-4, 1.0;
    contact_diameter: "solver.contact_diameter", "dx", 1.0, 0.1, 1.5;
    sleep: "solver.sleep", "s", 0.5, 0.0, 1e9;
    settle: "solver.settle", "s", 0.0, 0.0, 1e3;
    fluid_density: "fluid.density", "kg/m^3", 1000.0, 1e-6, 1e6;
    fluid_viscosity: "fluid.viscosity", "Pa s", 0.001, 0.0, 1e6;
    fluid_surface_tension: "fluid.surface_tension", "N/m", 0.0, 0.0, 1e3;
    fluid_velocity: "fluid.velocity", "m/s", _, -1e5, 1e5;
    fluid_lifetime: "fluid.lifetime", "s", _, 1e-6, 1e6;
    emitter_start: "emitter.start", "s", 0.0, 0.0, 1e6;
    emitter_stop: "emitter.stop", "s", _, 0.0, 1e6;
    emitter_count: "emitter.count", "1", 1e9, 1.0, 1e9;
    emitter_jitter: "emitter.jitter", "dx", 0.0, 0.0, 0.5;
    emitter_speed: "emitter.outlet.hose.speed", "m/s", _, 1e-9, 1e5;
    emitter_rate: "emitter.outlet.hose.rate", "m^3/s", _, 1e-18, 1e9;
    emitter_radius: "emitter.outlet.hose.radius", "m", _, 1e-9, 1e3;
    emitter_velocity: "emitter.outlet.burst.velocity", "m/s", _, -1e5, 1e5;
    emitter_period: "emitter.outlet.burst.period", "s", _, 1e-6, 1e6;
    sink_start: "sink.start", "s", 0.0, 0.0, 1e6;
    sink_stop: "sink.stop", "s", _, 0.0, 1e6;
    jitter: "fluid.jitter", "dx", 0.0, 0.0, 0.5;
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
    points: "probe.points", "1", 50.0, 1.0, 10000.0;
    percentile: "probe.percentile", "%", 100.0, 50.0, 100.0;
    interval: "probe.interval", "s", _, 0.0, 1e6;
    crest: "expect.nth", "1", 1.0, 1.0, 1e6;
    columns: "expect.columns", "1", _, 1.0, 100.0;
    relative: "expect.relative", "1", _, 0.0, 1e6;
    refinement: "expect.refinement", "1", 2.0, 1.001, 1000.0;
    flock_count: "flock.count", "1", _, 1.0, 1e8;
    flock_radius: "flock.radius", "m", _, 1e-9, 1e6;
    flock_separation_radius: "flock.separation_radius", "m", _, 0.0, 1e6;
    flock_alignment_radius: "flock.alignment_radius", "m", _, 0.0, 1e6;
    flock_cohesion_radius: "flock.cohesion_radius", "m", _, 0.0, 1e6;
    flock_sight: "flock.sight", "m", _, 0.0, 1e6;
    flock_field_of_view: "flock.field_of_view", "degrees", 360.0, 1.0, 360.0;
    flock_neighbours: "flock.neighbours", "1", _, 0.0, 64.0;
    flock_speed: "flock.speed", "m/s", _, 1e-9, 1e5;
    flock_speed_min: "flock.speed_min", "m/s", _, 0.0, 1e5;
    flock_speed_max: "flock.speed_max", "m/s", _, 0.0, 1e5;
    flock_turn: "flock.turn", "degrees/s", _, 0.0, 1e9;
    flock_acceleration: "flock.acceleration", "m/s^2", _, 0.0, 1e9;
    flock_separation: "flock.separation", "1", 1.0, 0.0, 1e4;
    flock_alignment: "flock.alignment", "1", 1.0, 0.0, 1e4;
    flock_cohesion: "flock.cohesion", "1", 1.0, 0.0, 1e4;
    flock_cruise: "flock.cruise", "1", 1.0, 0.0, 1e4;
    flock_wander: "flock.wander", "1", 0.0, 0.0, 1e4;
    flock_seek: "flock.seek", "1", 1.0, 0.0, 1e4;
    flock_arrive: "flock.arrive", "m", 0.0, 0.0, 1e6;
    flock_follow: "flock.follow", "1", 1.0, 0.0, 1e4;
    flock_follow_distance: "flock.follow_distance", "m", _, 0.0, 1e6;
    flock_flee: "flock.flee", "1", 4.0, 0.0, 1e4;
    flock_chase: "flock.chase", "1", 2.0, 0.0, 1e4;
    flock_avoid: "flock.avoid", "1", 4.0, 0.0, 1e4;
    flock_look_ahead: "flock.look_ahead", "s", _, 0.0, 1e6;
    flock_margin: "flock.margin", "m", _, 0.0, 1e6;
    flock_noise: "flock.noise", "rad", 0.0, 0.0, 100.0;
    flock_tau: "flock.tau", "s", _, 0.0, 1e6;
    flock_size: "flock.size", "m", 0.0, 0.0, 1e4;
    flock_mass: "flock.mass", "kg", _, 1e-12, 1e9;
    flock_drag: "flock.drag", "1", 0.5, 0.0, 1e3;
    fov: "camera.fov", "degrees", 35.0, 1.0, 170.0;
}

/// The parameter at a path written without indices.
pub fn find(path: &str) -> Option<&'static Param> {
    PARAMS.iter().find(|p| p.path == path)
}
