//! What the user writes: the scene file (TOML), nothing derived.
//!
//! A [`Scene`] is plain data; [`load`](Scene::load) reads it with every mistake reported by file, line and
//! remedy. Numbers have their unit, default and range in [`crate::params`]. Lengths are in metres, z points up.

pub mod builtin;
mod emitter;
mod expect;
mod flock;
pub mod joint;
mod load;
pub mod motion;
mod probe;
mod save;
mod shells;
pub mod solid;

pub use crate::formula::Formula;
pub use emitter::{Emitter, Outlet, Sink};
pub use expect::{By, Compare, Expect, Take, Validation, Variant};
pub use flock::{Flock, FlockModel, Relation};
pub use load::{Source, schema, schema_place};
pub use probe::{Component, End, Line, Norm, Of, Probe, Space};

use crate::laws::kernel::KernelSet;
use crate::params::default as d;
use glam::{DQuat, DVec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A whole scene.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// One line that says what is seen.
    #[serde(default)]
    pub title: String,
    /// The space and what pulls in it.
    #[serde(default)]
    pub world: World,
    /// The box in which particles live.
    pub domain: Domain,
    /// How fine the scene is.
    pub resolution: Resolution,
    /// Laws and numbers of the solver.
    #[serde(default)]
    pub solver: Solver,
    /// Length of a run and its frames.
    #[serde(default)]
    pub run: Run,
    /// Where pictures are taken from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<Camera>,
    /// Fluids.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fluid: Vec<Fluid>,
    /// Rigid bodies.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rigid: Vec<Rigid>,
    /// Bodies that do not move: obstacles, terrain.
    #[serde(default, rename = "static", skip_serializing_if = "Vec::is_empty")]
    pub statics: Vec<Static>,
    /// Joints between bodies.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joint: Vec<joint::Joint>,
    /// Sources of fluid.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub emitter: Vec<Emitter>,
    /// Places where fluid vanishes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sink: Vec<Sink>,
    /// Flocks.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub flock: Vec<Flock>,
    /// Fields that pull on everything.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub force: Vec<Force>,
    /// Named numbers, or formulas of each other, for use in formulas.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub constants: BTreeMap<String, Formula>,
    /// What is measured.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub probe: Vec<Probe>,
    /// What should come out: `jetsam validate` judges it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub expect: Vec<Expect>,
    /// Runs with other values, in place of one run as the scene stands.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub variant: Vec<Variant>,
    /// What kind of case the scene is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub validation: Option<Validation>,
    /// The text this scene was read from, for error messages.
    #[serde(skip)]
    pub source: Source,
}

/// The space and what pulls in it.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct World {
    /// 3, or 2 for a scene in the x-z plane (y is ignored; masses are per metre of depth).
    pub dimensions: u32,
    /// Acceleration of gravity.
    pub gravity: [f64; 3],
    /// Seed of everything random.
    pub seed: u64,
}

impl Default for World {
    fn default() -> Self {
        Self { dimensions: 3, gravity: [0.0, 0.0, -9.81], seed: 0 }
    }
}

/// The box in which particles live.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Domain {
    /// Lower corner (m).
    pub min: [f64; 3],
    /// Upper corner (m).
    pub max: [f64; 3],
    /// What is at the sides, one word per axis: x, y, z.
    #[serde(default)]
    pub walls: [Wall; 3],
}

/// What is at the two sides of the domain on one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Wall {
    /// Solid walls.
    #[default]
    Solid,
    /// The two sides are one: what leaves here enters there.
    Periodic,
    /// Nothing: what passes the side has left the scene.
    Open,
}

/// How fine the scene is.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Resolution {
    /// Distance of neighbouring particles, `dx`: the one number from which masses, support, stiffness and time step derive.
    pub spacing: f64,
}

/// Laws and numbers of the solver.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Solver {
    /// How pressure is found.
    #[serde(default)]
    pub pressure: Pressure,
    /// Mean compression, as a fraction of the rest density, at which the iterations of implicit pressure end (E9); with PBF 0.005 at most.
    #[serde(default = "d::tolerance")]
    pub tolerance: f64,
    /// The same for the compression that velocities bring in a step (E9, DFSPH).
    #[serde(default = "d::divergence_tolerance")]
    pub divergence_tolerance: f64,
    /// Whether implicit pressure finds its smooth part on a coarse lattice between rounds (E9). Without, rounds bring it through deep water bit by
    /// bit: to compare by.
    #[serde(default = "yes")]
    pub coarse: bool,
    /// Most iterations of implicit pressure in a step, of each kind (E9): a budget for real time. On one below 24 fluids yield under PBF:
    /// 4 leave about 1.3 % of compression, 8 about 0.4 %.
    #[serde(default = "d::iterations")]
    pub iterations: f64,
    /// How density is found (E1).
    #[serde(default)]
    pub density: Density,
    /// `delta` of density diffusion (E1), where density is integrated with WCSPH. 0 turns it off.
    #[serde(default = "d::density_diffusion")]
    pub density_diffusion: f64,
    /// Equation of state (E3).
    #[serde(default)]
    pub equation_of_state: EquationOfState,
    /// Whether pressure may be negative (E3). With a density that is summed, a free surface then pulls itself in.
    #[serde(default)]
    pub negative_pressure: bool,
    /// Form of the pressure force (E4).
    #[serde(default)]
    pub pressure_force: PressureForce,
    /// Smoothing kernel (E2).
    #[serde(default)]
    pub kernel: KernelSet,
    /// Radius of the kernel's support; about 30 neighbours at 2, 57 at 2.4.
    #[serde(default = "d::support")]
    pub support: f64,
    /// Speed of sound `c_0` (E3). When absent, ten times the largest speed the scene can reach.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sound_speed: Option<f64>,
    /// Law of the fluids' own viscosity (E5).
    #[serde(default)]
    pub viscosity: Viscosity,
    /// Monaghan's alpha (E5): damps approaching pairs, keeps the fluid orderly. 0 turns it off.
    #[serde(default = "d::artificial_viscosity")]
    pub artificial_viscosity: f64,
    /// XSPH (E6): how much particles are carried with their neighbours. 0 turns it off.
    #[serde(default = "d::xsph")]
    pub xsph: f64,
    /// Values of all choices at once; what is written besides wins.
    #[serde(default)]
    pub preset: Preset,
    /// Shifting (Sun et al. 2017), as a multiple of theirs: inside a fluid, particles are carried from where they are
    /// dense to where they are sparse. 0 turns it off.
    #[serde(default = "d::shifting")]
    pub shifting: f64,
    /// Part of the surface tension that the curvature term carries, the rest is cohesion's (E7). Cohesion alone lets drops freeze
    /// before they are round; the curvature term alone does not hold threads together.
    #[serde(default = "d::curvature")]
    pub curvature: f64,
    /// Vorticity confinement (E8): gives back swirl that is lost to viscosity between particles. 0 turns it off.
    #[serde(default = "d::vorticity")]
    pub vorticity: f64,
    /// Whether fluids slip along walls and bodies as if they had no viscosity there.
    #[serde(default)]
    pub walls_slip: bool,
    /// What acts between fluid and rigid bodies.
    #[serde(default)]
    pub coupling: Coupling,
    /// Dashpot of contacts (E11).
    #[serde(default)]
    pub damping: Damping,
    /// What the particles of bodies are to each other.
    #[serde(default)]
    pub surface: Surface,
    /// Contact diameter `r` of two particles of different bodies (E10).
    #[serde(default = "d::contact_diameter")]
    pub contact_diameter: f64,
    /// Largest overlap of bodies that meet at the scene's largest speed (E14): sets contact stiffness where none is stated.
    #[serde(default = "d::contact_overlap")]
    pub contact_overlap: f64,
    /// Time integration (E20).
    #[serde(default)]
    pub integrator: Integrator,
    /// Time step, in place of what E29 derives; only the end of a frame may shorten it. With implicit pressure the longest step, which
    /// the flow may shorten.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dt: Option<f64>,
    /// `C_a` of E29: fraction of the time sound takes through half a support.
    #[serde(default = "d::courant")]
    pub courant: f64,
    /// `C_f` of E29: bound by the largest acceleration.
    #[serde(default = "d::courant_force")]
    pub courant_force: f64,
    /// `C_v` of E29: bound by viscosity.
    #[serde(default = "d::courant_viscous")]
    pub courant_viscous: f64,
    /// Spacings that the fastest particle moves in a step of implicit pressure (E29). When absent, 0.6 with DFSPH and 1 with PBF.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub courant_flow: Option<f64>,
    /// Longest step of implicit pressure (E29). When absent, 1/200 s with DFSPH and 1/120 s with PBF.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub longest_dt: Option<f64>,
    /// How long a body lies still on others before it sleeps, and costs nothing until something touches it. 0: never.
    #[serde(default = "d::sleep")]
    pub sleep: f64,
    /// Before time begins, let the fluid come to rest under strong drag for this long (bodies stand still). Sound dies
    /// at the end, in two periods of the slowest wave: eight times as long as it takes through the domain.
    #[serde(default = "d::settle")]
    pub settle: f64,
}

fn yes() -> bool {
    true
}

impl Default for Solver {
    fn default() -> Self {
        toml::from_str("").expect("every key of [solver] has a default")
    }
}

/// How pressure is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Pressure {
    /// By purpose, which `jetsam check` says: weakly compressible SPH, the one that is validated throughout. The others are for
    /// pictures and play, and are stated.
    #[default]
    Auto,
    /// Weakly compressible SPH: pressure from density by an equation of state (E3). Steps are bound by the speed of sound.
    Wcsph,
    /// Divergence-free SPH (E9; Bender and Koschier 2015): pressures iterated until densities do not rise. Steps are bound by the
    /// flow.
    Dfsph,
    /// Position based fluids (E9; Macklin and Mueller 2013): places iterated until densities are those of rest. Robust at any step.
    Pbf,
}

/// E1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Density {
    /// Summed anew each step over the neighbours: cannot drift; a free surface looks thin to it.
    #[default]
    Summation,
    /// Integrated from the divergence of the flow: smooth pressures, for gauges and waves. With WCSPH there is density diffusion
    /// (delta-SPH; Antuono et al. 2012). With implicit pressure integrals are exact: sums, and what these lacked at the start; surfaces
    /// lie still.
    Continuity,
}

/// E3.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum EquationOfState {
    /// `p = c_0^2 (rho - rho_0)`.
    Linear,
    /// `p = B ((rho / rho_0)^7 - 1)`.
    #[default]
    Tait,
}

/// E4.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum PressureForce {
    /// `p_i / rho_i^2 + p_j / rho_j^2`.
    #[default]
    Symmetric,
    /// `(p_i + p_j) / (2 rho_j)` (Mueller et al. 2003; the seed authors).
    Mueller,
}

/// E5.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Viscosity {
    /// Morris et al. 1997.
    #[default]
    Laminar,
    /// Mueller et al. 2003.
    Mueller,
}

/// What acts between fluid and rigid bodies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Coupling {
    /// E17: the bodies' particles take part in density and pressure.
    #[default]
    Pressure,
    /// E16, the article's: spring and dashpot between a fluid and a rigid particle.
    Spring,
}

/// E11.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Damping {
    /// Only the relative velocity along the line of centres.
    #[default]
    Normal,
    /// The full relative velocity, as in the article.
    Full,
}

/// Values of all choices at once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// The defaults.
    #[default]
    Default,
    /// The laws of the article by Young and Erlebacher: springs between fluid and bodies, the full dashpot, balls without
    /// friction, Mueller's kernels and forces.
    Article,
}

/// What the particles of bodies are to each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Surface {
    /// Faces are planes: contacts push along their normals.
    #[default]
    Smooth,
    /// Balls, as in the article: contacts push along the line of centres, and faces are bumpy.
    Spheres,
}

/// E20.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Integrator {
    /// Kick-drift-kick, second order.
    #[default]
    Leapfrog,
    /// Semi-implicit Euler, first order.
    Euler,
}

/// Length of a run and its frames.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Run {
    /// How long to simulate unless the command says otherwise.
    #[serde(default = "d::seconds")]
    pub seconds: f64,
    /// Frames per simulated second.
    #[serde(default = "d::frames_per_second")]
    pub frames_per_second: f64,
    /// Particles that may be lost before the run counts as gone wrong.
    #[serde(default = "d::lost_allowed")]
    pub lost_allowed: f64,
}

impl Default for Run {
    fn default() -> Self {
        toml::from_str("").expect("every key of [run] has a default")
    }
}

/// Where pictures are taken from.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Position of the eye (m).
    pub eye: [f64; 3],
    /// Point looked at (m).
    pub target: [f64; 3],
    /// Vertical angle of view.
    #[serde(default = "d::fov")]
    pub fov: f64,
}

/// A body of fluid.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fluid {
    /// Name; `fluid` when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Where it stands at the beginning; absent for a fluid that only comes from emitters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape: Option<Shape>,
    /// Rest density `rho_0`.
    #[serde(default = "d::fluid_density")]
    pub density: f64,
    /// Dynamic viscosity `mu`.
    #[serde(default = "d::fluid_viscosity")]
    pub viscosity: f64,
    /// Surface tension against the air (E7). 0 turns it off.
    #[serde(default = "d::fluid_surface_tension")]
    pub surface_tension: f64,
    /// Velocity at the beginning: three numbers, or formulas of x, y, z (m).
    #[serde(default = "at_rest")]
    pub velocity: [Formula; 3],
    /// How the particles stand at the beginning.
    #[serde(default)]
    pub start: Start,
    /// How far each particle is moved at random from there, at most, along each axis.
    #[serde(default = "d::jitter")]
    pub jitter: f64,
    /// How far particles are moved from there (m): three formulas of x, y, z, as for the surface of a standing wave.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub displace: Option<[Formula; 3]>,
    /// How long a particle lives; for ever when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lifetime: Option<f64>,
}

fn at_rest() -> [Formula; 3] {
    [0.0; 3].map(Formula::Number)
}

/// How a fluid's particles stand at the beginning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Start {
    /// On a lattice, squeezed along gravity as far as the weight of the fluid above asks for: no first shock.
    #[default]
    Hydrostatic,
    /// On an even lattice, without pressure.
    Lattice,
}

/// A rigid body, or several copies of it.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rigid {
    /// Name; `rigid` when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Its shape in its own frame.
    pub shape: Shape,
    /// How its particles stand.
    #[serde(default)]
    pub fill: Fill,
    /// Density; either this or `mass`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub density: Option<f64>,
    /// Mass (per metre of depth in 2D); either this or `density`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass: Option<f64>,
    /// Where the origin of the shape's frame is put (m).
    #[serde(default)]
    pub position: [f64; 3],
    /// Rotation about that origin: axis x, y, z and an angle in degrees.
    #[serde(default = "no_rotation")]
    pub rotation: [f64; 4],
    /// Velocity of the centre of mass.
    #[serde(default)]
    pub velocity: [f64; 3],
    /// Angular velocity, world axes.
    #[serde(default)]
    pub spin: [f64; 3],
    /// Restitution `e` of contacts (E14); of two bodies the geometric mean counts.
    #[serde(default = "d::rigid_restitution")]
    pub restitution: f64,
    /// Spring constant of one contact of two particles; wins over `contact_overlap` (E14).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<f64>,
    /// Dashpot of one contact of two particles; wins over `restitution` (E14).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping: Option<f64>,
    /// Friction `mu` (E13); of two bodies the geometric mean counts.
    #[serde(default = "d::rigid_friction")]
    pub friction: f64,
    /// Whether fluids do not move the body, though it moves them.
    #[serde(default)]
    pub one_way: bool,
    /// Copies in place of one body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub copies: Option<Copies>,
}

fn no_rotation() -> [f64; 4] {
    [0.0, 0.0, 1.0, 0.0]
}

/// How the particles of a body stand. Mass, centre and inertia are the exact shape's either way (E19).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Fill {
    /// On a lattice: flat faces are even, round surfaces are stairs and facets.
    #[default]
    Lattice,
    /// In shells that follow a round surface, the outermost half a spacing inside: balls and cylinders roll, and fluids slip along
    /// them. For balls, cylinders and tori; a box is the same either way.
    Shells,
}

/// Copies of a rigid body.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Copies {
    /// How many.
    pub count: u32,
    /// On a grid about `position`; either this or `random`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grid: Option<Grid>,
    /// At random in a box (m, absolute), no two touching; either this or `grid`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub random: Option<Region>,
    /// Whether each copy gets a random orientation.
    #[serde(default)]
    pub tumble: bool,
}

/// A grid of places, x running fastest, then y, then z.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Number of places along x and y; z goes on as far as the count asks for.
    pub columns: [u32; 2],
    /// Distance of neighbouring places (m).
    pub step: [f64; 3],
}

/// A box.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Lower corner (m).
    pub min: [f64; 3],
    /// Upper corner (m).
    pub max: [f64; 3],
}

/// A body that nothing moves: it stands, or moves as told (E15).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Static {
    /// Name; `static` when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Its shape in its own frame.
    pub shape: Shape,
    /// How its particles stand.
    #[serde(default)]
    pub fill: Fill,
    /// Where the origin of the shape's frame is put (m).
    #[serde(default)]
    pub position: [f64; 3],
    /// Rotation about that origin: axis x, y, z and an angle in degrees.
    #[serde(default = "no_rotation")]
    pub rotation: [f64; 4],
    /// Friction `mu` (E13); when absent, that of the body it meets counts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<f64>,
    /// How it moves.
    #[serde(default)]
    pub motion: motion::Motion,
}

/// A shape. In a 2D scene its section with the x-z plane counts.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Shape {
    /// A box along the axes.
    Box(Region),
    /// A ball (in 2D a disc).
    Sphere {
        /// Centre (m).
        center: [f64; 3],
        /// Radius (m).
        radius: f64,
    },
    /// A cylinder. In 2D its axis must be y.
    Cylinder {
        /// Middle of the axis (m).
        center: [f64; 3],
        /// Direction of the axis.
        axis: [f64; 3],
        /// Radius (m).
        radius: f64,
        /// Length of the axis (m).
        height: f64,
    },
    /// A ring: the torus about `center` whose tube of radius `tube` runs at distance `radius` from the axis. 3D scenes only.
    Torus {
        /// Centre (m).
        center: [f64; 3],
        /// Direction of the axis.
        axis: [f64; 3],
        /// Radius of the ring (m).
        radius: f64,
        /// Radius of the tube (m).
        tube: f64,
    },
    /// A triangle mesh: OBJ, STL, PLY, glTF or GLB. 3D scenes only.
    Mesh {
        /// File, relative to the scene file.
        path: String,
        /// Factor on its coordinates.
        #[serde(default = "one")]
        scale: f64,
    },
    /// A shape less others: a cup is a cylinder less a narrower one.
    Difference {
        /// The shape.
        from: std::boxed::Box<Shape>,
        /// What is cut out of it: boxes, balls, cylinders, and differences of these.
        cut: Vec<Shape>,
    },
    /// The particles themselves (m).
    Points(Vec<[f64; 3]>),
}

/// Rotation from axis x, y, z and degrees.
pub(crate) fn axis_angle([x, y, z, degrees]: [f64; 4]) -> DQuat {
    match DVec3::new(x, y, z).try_normalize() {
        Some(axis) => DQuat::from_axis_angle(axis, degrees.to_radians()),
        None => DQuat::IDENTITY,
    }
}

fn one() -> f64 {
    1.0
}

/// A field that pulls on everything (E30).
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Force {
    /// A point that attracts.
    Point {
        /// Its place (m).
        center: [f64; 3],
        /// `G M` (m^3/s^2).
        strength: f64,
        /// Radius inside which the pull is softened (m).
        core: f64,
    },
    /// An even wind that drags.
    Wind {
        /// Velocity of the wind (m/s).
        velocity: [f64; 3],
        /// Rate at which velocities approach the wind's (1/s).
        rate: f64,
    },
    /// Shaking of the whole scene.
    Shake(motion::Shake),
    /// A vortex that drags.
    Vortex {
        /// A point on its axis (m).
        center: [f64; 3],
        /// Direction of its axis.
        axis: [f64; 3],
        /// Largest speed (m/s), reached at the radius of the core.
        speed: f64,
        /// Radius of the core (m).
        core: f64,
        /// Rate at which velocities approach the vortex's (1/s).
        rate: f64,
    },
}
