//! What a scene measures: `[[probe]]` blocks. [`crate::probe`] reads them off a running world.

use crate::formula::Formula;
use crate::laws::kernel::Kernel;
use crate::params::default as d;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Something that is measured while the scene runs: `of` says what, `at`, `line`, `region`, `fluid` or `body` where.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Probe {
    /// Name: expectations, formulas of other probes and `probes.csv` call it by this.
    pub name: String,
    /// What is measured.
    pub of: Of,
    /// A point (m): where pressure, velocity or density is read; the horizontal place of a height; what an angular
    /// momentum is taken about. Each coordinate may be a formula of constants.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at: Option<[Formula; 3]>,
    /// Points on a line, for pressure, velocity and density: their mean, or with `reference` their deviation from it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub line: Option<Line>,
    /// How many points on the line, both ends counted.
    #[serde(default = "d::points")]
    pub points: f64,
    /// A box: the fluid particles inside count. For a flux it has no width along one axis, and that is the way it faces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<Space>,
    /// Name of a fluid: only its particles count.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fluid: Option<String>,
    /// Name of a body, rigid or static; `walls` are the domain's walls.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Name of the other body of a contact; without it a body's like.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other: Option<String>,
    /// Name of a flock.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flock: Option<String>,
    /// Which component of a vector: by default its magnitude. `w` is for a quaternion.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub component: Option<Component>,
    /// Which end of an extent.
    #[serde(default)]
    pub end: End,
    /// How much of the particles an extent holds, counted from its other end: 99 leaves the foremost hundredth out.
    #[serde(default = "d::percentile")]
    pub percentile: f64,
    /// Whether an extent goes on for half a spacing beyond the centres of the particles.
    #[serde(default)]
    pub padding: bool,
    /// A formula of x, y, z (m) and t (s) that pressure, velocity or density should follow along the `line` or in the
    /// `region`: the probe is then the norm of the difference.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<Formula>,
    /// Which norm of the difference.
    #[serde(default)]
    pub norm: Norm,
    /// What the norm is divided by; 1 when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<Formula>,
    /// For `of = "formula"`: a formula of other probes by their names and of t (s).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub formula: Option<Formula>,
    /// For kernels: which one; the scene's when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kernel: Option<Kernel>,
    /// For kernels: radius of the support in spacings; the scene's when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub support: Option<Formula>,
    /// For kernels: 2 or 3; the scene's when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dimensions: Option<u32>,
    /// For `kernel` and `kernel-slope`: the distance, as a fraction of the support.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distance: Option<Formula>,
    /// Time between readings; 0 reads every step. When absent, at the end of every frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval: Option<f64>,
}

/// A line of points.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Line {
    /// First point (m).
    pub from: [Formula; 3],
    /// Last point (m).
    pub to: [Formula; 3],
}

/// A box whose corners may be formulas of constants.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Space {
    /// Lower corner (m).
    pub min: [Formula; 3],
    /// Upper corner (m).
    pub max: [Formula; 3],
}

/// What a probe measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Of {
    /// Pressure of the fluid (Pa): kernel-weighted mean over the particles around, each carried to the point along
    /// gravity (as in Adami et al. 2012, eq. 27); 0 where it is dry.
    Pressure,
    /// Velocity (m/s): of the fluid at a point (0 where it is dry), of a `body`, or the mean of a `fluid`.
    Velocity,
    /// Density (kg/m^3) of the fluid at a point; 0 where it is dry.
    Density,
    /// Level of the fluid along the vertical through `at` (m, from the origin): the highest place that is at least half
    /// full; what is thinner than half a spacing (spray) does not count. The floor where it is dry.
    Height,
    /// How far the particles of all fluids, of a `fluid` or of a `body` reach along the axis `component` (m).
    Extent,
    /// Volume that passes the flat `region` along its axis (m^3/s; m^2/s in 2D). Fluid is as wide as the kernel: let the
    /// region reach a support beyond the opening.
    Flux,
    /// Number of fluid particles, in the `region` or altogether.
    Count,
    /// Volume of the fluid particles at rest (m^3; m^2 in 2D), in the `region` or altogether.
    Volume,
    /// Mass (kg): of a `body`, of a `fluid`, or of everything that moves.
    Mass,
    /// Place of the centre of mass (m): of a `body`, of a `fluid`, or of everything that moves.
    Position,
    /// Angular velocity (rad/s) of a `body`, world axes.
    Spin,
    /// Angular velocity (rad/s) of a `body`, its own axes.
    BodySpin,
    /// Angle between a `body`'s own z axis and the vertical (degrees).
    Tilt,
    /// Orientation of a `body`, `component` x, y, z or w.
    Quaternion,
    /// Force on a `body` (N) without its weight: what fluids, walls, other bodies and fields do to it. For static bodies
    /// and `walls` what they have to bear.
    Force,
    /// Force on a `body` (N), its weight included.
    TotalForce,
    /// Torque on a `body` about its centre of mass (N m).
    Torque,
    /// Moment of inertia of a `body` about its own axis `component` (kg m^2).
    Inertia,
    /// The same from its particles as equal point masses (kg m^2).
    ParticleInertia,
    /// Number of particles of a `body`.
    Particles,
    /// Momentum (kg m/s) of a `body`, of a `fluid`, or of everything.
    Momentum,
    /// Sum of the magnitudes of the momenta of all particles and bodies (kg m/s).
    MomentumScale,
    /// Momentum that no impulse from outside explains, as a fraction of that scale.
    MomentumResidual,
    /// Sum of all forces less those from outside, as a fraction of the sum of their magnitudes: what action and reaction
    /// leave over in this step.
    ForceResidual,
    /// Angular momentum (kg m^2/s) about `at` (the origin when absent) of everything or of a `fluid`; of a `body` about its
    /// own centre.
    AngularMomentum,
    /// Sum of `m |r| |v|` about `at` over everything or a `fluid` (kg m^2/s).
    AngularMomentumScale,
    /// Kinetic energy (J) of a `body`, of a `fluid`, or of everything.
    KineticEnergy,
    /// Potential energy (J) in gravity, zero at the domain's lower corner, and in point fields.
    PotentialEnergy,
    /// Energy (J) stored in compressed fluid and in the springs of contacts between bodies.
    ElasticEnergy,
    /// Kinetic, potential and elastic energy together (J).
    Energy,
    /// Largest speed of any particle (m/s), or of fluid particles in the `region` or of the `fluid`.
    Speed,
    /// Mean of `|rho / rho_0 - 1|` over fluid particles with full support.
    DensityErrorMean,
    /// Largest `|rho / rho_0 - 1|` over fluid particles with full support.
    DensityErrorMax,
    /// Fluid particles that got through walls, and particles of bodies now beyond one.
    Lost,
    /// Fluid particles that passed an open side.
    Left,
    /// Steps made.
    Steps,
    /// Length that the next step may have (s).
    Dt,
    /// Distance of neighbouring particles (m).
    Spacing,
    /// Speed of sound (m/s).
    SoundSpeed,
    /// Mass of a particle of the `fluid`, or of the first fluid (kg).
    ParticleMass,
    /// A kernel `W` at `distance` (H^-d: for a support of 1).
    Kernel,
    /// `dW/dr` at `distance` (H^-(d+1)).
    KernelSlope,
    /// The slope at `distance` by a central difference of `W`.
    KernelDifference,
    /// Integral of a kernel over all space.
    KernelIntegral,
    /// `sum W dx^d` over the infinite lattice, the particle itself counted.
    KernelSum,
    /// `-sum x dW/dx dx^d` over the infinite lattice.
    KernelGradientSum,
    /// Neighbours inside the support on the infinite lattice, the particle itself not counted.
    KernelNeighbours,
    /// Spring constant of one contact of `body` and `other` (N/m).
    ContactStiffness,
    /// Dashpot of one contact of `body` and `other` (N s/m).
    ContactDamping,
    /// Length of the mean of the headings of a `flock`: 1 when all fly one way.
    Polarization,
    /// Length of the mean of `r x v` of a `flock`, both as unit vectors, r from its centre: 1 when all circle it.
    Milling,
    /// Parts of a `flock` between which nobody perceives anybody.
    Fragments,
    /// Part of a `flock` that the largest of them has.
    LargestFragment,
    /// A `formula` of other probes.
    Formula,
}

/// A component of a vector.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Component {
    /// Along x.
    X,
    /// Along y.
    Y,
    /// Along z.
    Z,
    /// The real part of a quaternion.
    W,
    /// The length of the vector.
    Magnitude,
}

/// An end of an extent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum End {
    /// The upper end.
    #[default]
    Max,
    /// The lower end.
    Min,
    /// From the lower to the upper end.
    Span,
}

/// A norm over points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Norm {
    /// Root of the mean square.
    #[default]
    L2,
    /// Mean of the magnitude.
    L1,
    /// Largest magnitude.
    Max,
}
