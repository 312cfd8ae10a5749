//! What does not change while a world runs: constants derived from the scene.

use crate::flock::FlockConstants;
use crate::integrate::sources::{Drain, Source};
use crate::interact::cells::Grid;
use crate::laws::kernel::{Kernel, KernelSet};
use crate::ledger::Ledger;
use crate::scene::joint::JointModel;
use crate::scene::motion::{Path, Shake};
use crate::scene::{Damping, Density, Force, Pressure, Solver, Viscosity};
use glam::DVec3;
use std::f64::consts::PI;

/// Contacts are looked for within so many contact diameters: farther than a pair parts or meets in half a step.
pub const CONTACT_REACH: f64 = 1.5;
/// Lists of contacts reach so many contact diameters farther at most, and hold until something has moved by half of that.
pub const CONTACT_SKIN: f64 = 0.5;

/// Constants of a world.
#[derive(Clone, Debug)]
pub struct Model {
    /// 2 or 3.
    pub dimensions: u32,
    /// Particle spacing `dx` (m).
    pub spacing: f64,
    /// Radius of the kernel's support `H` (m).
    pub support: f64,
    /// Rest volume of a fluid particle, `dx^d` (m^d).
    pub volume: f64,
    /// Kernels.
    pub kernel: KernelSet,
    /// Their factors.
    pub factors: Factors,
    /// Fluids, in the order of the scene.
    pub fluids: Vec<FluidModel>,
    /// Flocks, in the order of the scene.
    pub flocks: Vec<FlockConstants>,
    /// Contact numbers of each body, in the order of [`crate::state::Bodies`].
    pub contacts: Vec<ContactModel>,
    /// Largest speed the scene can reach (m/s), from depth, drop height and velocities.
    pub largest_speed: f64,
    /// Depth of the fluids where it is largest when time begins (m): their volume in a column as wide as the support, over its base.
    pub depth: f64,
    /// Speed of sound `c_0` (m/s).
    pub sound_speed: f64,
    /// Gravity (m/s^2).
    pub gravity: DVec3,
    /// Sources of fluid (E31).
    pub sources: Vec<Source>,
    /// Sinks (E31).
    pub drains: Vec<Drain>,
    /// Seed of everything random.
    pub seed: u64,
    /// Fields besides gravity (E30).
    pub fields: Vec<Force>,
    /// Shaking of the scene, felt with gravity.
    pub shakes: Vec<Shake>,
    /// Joints of bodies, in the order of the scene.
    pub joints: Vec<JointModel>,
    /// Script of each body that has one (E15).
    pub paths: Vec<Option<Path>>,
    /// The box particles live in and its cells.
    pub grid: Grid,
    /// Contact diameter `r` (m).
    pub contact_diameter: f64,
    /// Choices and numbers of the solver, as the scene has them.
    pub solver: Solver,
    /// Bounds of the time step that do not change (s): each with its name.
    pub dt_bounds: Vec<(DtBound, f64)>,
    /// Whether walls and bodies show viscosity the fluid's velocity mirrored (Adami et al. 2012).
    pub no_slip: bool,
    /// Number of neighbours inside a full support, about: `4/3 pi (H/dx)^3`, or `pi (H/dx)^2`.
    pub full_support: f64,
    /// What was repaired or looks doubtful.
    pub warnings: Vec<String>,
}

/// Factors from the shapes of kernels to the kernels, calibrated on the lattice a fluid starts from.
#[derive(Clone, Copy, Debug)]
pub struct Factors {
    /// From the density kernel's `w(s)` to `W` (1/m^d): a resting lattice has density `rho_0` exactly.
    pub w: f32,
    /// `W` at the distance of one spacing (1/m^d).
    pub w_spacing: f32,
    /// `W` at no distance (1/m^d).
    pub w_own: f32,
    /// From the force kernel's `g(s)` to `G = (1/r) dW/dr` (1/m^(d+2)): the gradient of a linear field on a lattice
    /// is exact, and with it the Laplacian of E5.
    pub g: f32,
    /// From the viscosity kernel's shape to `nabla^2 W` (1/m^(d+2)), exact alike.
    pub laplacian: f32,
    /// Jacobi's factor in rounds of PBF (E9): 0.65 over the largest eigenvalue that a resting lattice has.
    pub relaxation: f32,
    /// What `|e|^2` sums to over the neighbours of a resting lattice, times `dx^2`: a share's answer to itself.
    pub response: f32,
    /// How much pressure over density one round of it puts against a compression of a resting lattice, times `dt^2 / dx^2`.
    pub reach: f32,
}

impl Factors {
    /// Factors for a support of `spacings` spacings, `support` metres.
    pub fn new(kernel: KernelSet, spacings: f64, support: f64, dimensions: u32) -> Self {
        let (density, force, d) = (kernel.density(), kernel.force(), dimensions as i32);
        let w = density.norm(dimensions) / support.powi(d) / density.lattice_sum(spacings, dimensions);
        let g = force.norm(dimensions) / support.powi(d + 2) / force.lattice_gradient(spacings, dimensions);
        let laplacian = Kernel::laplacian_norm(dimensions) / support.powi(d + 2);
        let laplacian = laplacian / Kernel::lattice_laplacian(spacings, dimensions);
        let at = |s: f64| w as f32 * density.w(s as f32);
        let (stiffness, own) = force.lattice_stiffness(spacings, dimensions);
        Self {
            w: w as f32,
            w_spacing: at(1.0 / spacings),
            w_own: at(0.0),
            g: g as f32,
            laplacian: laplacian as f32,
            relaxation: (CAUTION / stiffness) as f32,
            response: own as f32,
            reach: (CAUTION / stiffness / own) as f32,
        }
    }
}

/// Surface tension that a cohesion of strength 1 gives a flat, sharp surface: the work of parting two half spaces is
/// `pi / 8 H^5 int c(s) s^4 ds` in 3D and `H^4 / 3 int c(s) s^3 ds` in 2D (after Fowler 1937).
pub fn cohesion_moment(support: f64, dimensions: u32) -> f64 {
    let power = dimensions as i32 + 1;
    let factor = if dimensions == 2 { 1.0 / 3.0 } else { PI / 8.0 };
    factor * support.powi(power + 1) * moment(power)
}

/// Surface tension that a curvature term of strength 1 gives (E7). In a fluid of even density the term is the gradient of a pair
/// potential, the difference of `W` smeared over a ball of radius `H` and of `W` times the ball's volume: of such a potential
/// `u` the surface tension is the mean of `|x| u` over all space, over `2 pi` in 2D and over 8 in 3D.
pub fn curvature_moment(kernel: Kernel, support: f64, dimensions: u32) -> f64 {
    const PARTS: u32 = 64;
    let middles = || (0..PARTS).map(|k| (f64::from(k) + 0.5) / f64::from(PARTS));
    let flat = dimensions == 2;
    let (ball, shell) = if flat { (PI, 2.0 * PI) } else { (4.0 / 3.0 * PI, 4.0 * PI) };
    let shell_at = |s: f64| shell * if flat { s } else { s * s } / f64::from(PARTS);
    // mean of |x + y| over the directions of y, |x| = r and |y| = s
    let apart = |r: f64, s: f64| {
        let at = |cosine: f64| (r * r + s * s + 2.0 * r * s * cosine).max(0.0).sqrt();
        middles().map(|t| if flat { at((PI * t).cos()) } else { at(2.0 * t - 1.0) }).sum::<f64>() / f64::from(PARTS)
    };
    let mut moment = 0.0;
    for s in middles() {
        let weight = kernel.value(s, 1.0, dimensions) * shell_at(s);
        moment -= ball * weight * s;
        moment += weight * middles().map(|r| shell_at(r) * apart(r, s)).sum::<f64>();
    }
    moment * support.powi(dimensions as i32 + 2) / if flat { 2.0 * PI } else { 8.0 }
}

/// Pressure that a cohesion of strength 1 puts on the inside of a fluid, by the virial: `2 pi / 3 H^4 int c(s) s^3 ds` in 3D,
/// `pi / 2 H^3 int c(s) s^2 ds` in 2D.
pub fn cohesion_pressure(support: f64, dimensions: u32) -> f64 {
    let power = dimensions as i32;
    let factor = if dimensions == 2 { 0.5 } else { 2.0 / 3.0 } * PI;
    factor * support.powi(power + 1) * moment(power)
}

/// `int_0^1 c(s) s^power ds` of the cohesion's shape.
fn moment(power: i32) -> f64 {
    const PARTS: u32 = 1000;
    let middle = |k: u32| (f64::from(k) + 0.5) / f64::from(PARTS);
    let c = |s: f64| f64::from(crate::laws::fluid::cohesion_shape(s as f32));
    (0..PARTS).map(middle).map(|s| c(s) * s.powi(power)).sum::<f64>() / f64::from(PARTS)
}

/// Constants of a fluid.
#[derive(Clone, Debug)]
pub struct FluidModel {
    /// Name.
    pub name: String,
    /// Rest density `rho_0` (kg/m^3).
    pub density: f32,
    /// Mass of a particle, `rho_0 V` (kg; kg/m in 2D).
    pub mass: f32,
    /// Dynamic viscosity `mu` (Pa s).
    pub viscosity: f32,
    /// `c_0^2 rho_0` (Pa).
    pub stiffness: f32,
    /// `alpha rho_0 c_0 h` (Pa s), E5.
    pub artificial: f32,
    /// Strength of cohesion (N/m^(2d); E7).
    pub cohesion: f32,
    /// Strength of the curvature term (N/m^(2d); E7).
    pub curvature: f32,
    /// How long a particle lives (s); infinite unless the scene says.
    pub lifetime: f64,
    /// `delta h c_0 / stiffness` (m^2/s/Pa), E1.
    pub diffusion: f32,
}

/// Contact numbers of a body (E14).
#[derive(Clone, Debug)]
pub struct ContactModel {
    /// `1/m` (1/kg), zero for static bodies.
    pub inverse_mass: f32,
    /// Natural logarithm of the restitution.
    pub ln_restitution: f32,
    /// Number of simultaneous contacts for which stiffness and damping are shared out.
    pub shared_by: f32,
    /// Most particles in one layer: as many contacts share a load at most.
    pub face: f32,
    /// Friction, or negative where the other body's counts (E13).
    pub friction: f32,
    /// Whether a joint holds it.
    pub jointed: bool,
    /// Bodies it does not touch, for a joint holds them together.
    pub joined: Vec<u32>,
    /// Stated spring constant (N/m), or 0.
    pub stiffness: f32,
    /// Stated dashpot (N s/m), or negative.
    pub damping: f32,
}

/// What bounds the time step (E29).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum DtBound {
    /// Sound and flow crossing half a support.
    Sound,
    /// The fastest particle moves a fraction of a spacing.
    Flow,
    /// The longest step allowed.
    Longest,
    /// Largest acceleration.
    Force,
    /// Viscosity.
    Viscosity,
    /// A twentieth of a contact.
    Contact,
    /// The fastest body moves a tenth of the contact diameter.
    Travel,
    /// A quarter of the smallest radius of a flock, or its next decision.
    Flock,
    /// The scene's own `dt`.
    Scene,
    /// The end of a frame.
    Frame,
}

impl DtBound {
    /// The word used in reports.
    pub fn name(self) -> &'static str {
        match self {
            DtBound::Sound => "sound",
            DtBound::Flow => "flow",
            DtBound::Longest => "longest",
            DtBound::Force => "force",
            DtBound::Viscosity => "viscosity",
            DtBound::Contact => "contact",
            DtBound::Travel => "travel",
            DtBound::Flock => "flock",
            DtBound::Scene => "scene",
            DtBound::Frame => "frame",
        }
    }
}

/// A body moves no further between two looks at contacts than this fraction of the contact diameter: contacts see it coming.
pub const TRAVEL: f64 = 0.1;
/// Jacobi's factor times the largest eigenvalue on a resting lattice. Rounds diverge where the product with the eigenvalue there is above 1, and
/// compressed places have larger ones: with 0.9 a dam whose spacing does not fit its box is thrown apart, with 0.65 it is not.
const CAUTION: f64 = 0.65;
/// A density's response to its own share, of that on a resting lattice, below which none is believed: dams in the plane are thrown apart by
/// what is driven in among the particles of a wall with a tenth, not with a quarter or more.
const LEAST_RESPONSE: f32 = 0.5;
/// Spacings that a particle pressed by its neighbours may swing in a step of DFSPH; a tank at rest is stable up to 0.6.
const SWING: f64 = 0.35;
/// The same in a step of PBF with a small budget of rounds; a dam and a tank are stable up to 0.47. Twice that where there is room for
/// directions found anew where particles were moved: stable up to 0.96.
const SWING_PBF: f64 = 0.4;
/// With so many rounds a step there is room for that.
const ROOM: f64 = 24.0;
/// Rounds of PBF end at no larger error than this: with more, places are so wrong that particles are pushed about, and steps get shorter by it.
const LOOSE: f64 = 0.005;
/// No step is cut into more steps of bodies than this.
const MOST_SUBSTEPS: f64 = 1000.0;

/// Tangential over normal spring of a contact: both then last equally long for a ball (Schaefer, Dippel and Wolf 1996).
pub(crate) const TANGENTIAL: f32 = 2.0 / 7.0;
/// Damping ratio of the tangential spring (E13).
pub(crate) const TANGENTIAL_DAMPING: f32 = 0.3;

impl Model {
    /// Whether the pairs of fluids have no laws but pressure and viscosity (E4, E5 without Mueller's form).
    pub fn plain(&self) -> bool {
        let s = &self.solver;
        !self.integrates_density()
            && s.viscosity != Viscosity::Mueller
            && s.xsph == 0.0
            && s.shifting == 0.0
            && s.vorticity == 0.0
            && !self.tension()
    }

    /// Whether any fluid has surface tension (E7).
    pub fn tension(&self) -> bool {
        self.fluids.iter().any(|f| f.cohesion + f.curvature > 0.0)
    }

    /// Whether pressure is implicit (E9): found by iteration, in steps that the flow bounds.
    pub fn implicit(&self) -> bool {
        matches!(self.solver.pressure, Pressure::Dfsph | Pressure::Pbf)
    }

    /// Whether rates of density are summed over pairs, and integrated (E1).
    pub fn integrates_density(&self) -> bool {
        self.solver.density == Density::Continuity && !self.implicit()
    }

    /// Whether what a sum lacked when its particle began counts as there (E1): continuity under implicit pressure.
    pub fn remembers_lack(&self) -> bool {
        self.solver.density == Density::Continuity && self.implicit()
    }

    /// Pressure up to which gravity fades out between fluids and bodies (Pa; E17): that of a support's depth.
    pub fn hold_limit(&self) -> f32 {
        let rho = self.fluids.iter().map(|f| f.density).fold(0.0, f32::max);
        (rho * (self.gravity.length() * self.support) as f32).max(1e-9)
    }

    /// A particle's density is taken to answer to its own share by no less than this, times `1 / rho_0` (1/m^2; E9).
    pub fn least_response(&self) -> f32 {
        LEAST_RESPONSE * self.factors.response / (self.spacing * self.spacing) as f32
    }

    /// How far contacts are looked for (m).
    pub fn contact_reach(&self) -> f64 {
        CONTACT_REACH * self.contact_diameter
    }

    /// `1 / H`.
    pub fn inverse_support(&self) -> f32 {
        (1.0 / self.support) as f32
    }

    /// `0.01 h^2`, `h = H / 2`: keeps viscosities finite for particles that meet (m^2).
    pub fn softening(&self) -> f32 {
        (0.01 * 0.25 * self.support * self.support) as f32
    }

    /// Gravity at a time (s), with what shaking adds (m/s^2).
    pub fn gravity_at(&self, time: f64) -> DVec3 {
        self.shakes.iter().fold(self.gravity, |g, shake| g + shake.felt(time))
    }

    /// Whether forces move a body.
    #[inline]
    pub fn moves(&self, body: u32) -> bool {
        self.contacts[body as usize].inverse_mass > 0.0
    }

    /// Whether two bodies pass through each other: none of them moves by forces, or a joint holds them together.
    #[inline]
    pub fn apart(&self, a: u32, b: u32) -> bool {
        !(self.moves(a) || self.moves(b)) || self.contacts[a as usize].joined.contains(&b)
    }

    /// Whether any body rubs (E13).
    pub fn rubs(&self) -> bool {
        self.solver.damping == Damping::Normal && self.contacts.iter().any(|c| c.inverse_mass > 0.0 && c.friction > 0.0)
    }

    /// In how many steps of bodies a step of `dt` (s) is to be cut for contacts, while the fastest particle of a body moves at
    /// `body_speed` (m/s).
    pub fn substeps(&self, dt: f64, body_speed: f64) -> u32 {
        let contact = self.dt_bounds.iter().filter(|b| b.0 == DtBound::Contact).map(|b| b.1);
        let longest = contact.fold(TRAVEL * self.contact_diameter / body_speed, f64::min);
        let parts = (dt / longest - 1e-9).ceil();
        if parts.is_finite() { parts.clamp(1.0, MOST_SUBSTEPS) as u32 } else { 1 }
    }

    /// Whether colour gradients or vorticities are wanted (E7, E8).
    pub fn wants_gradients(&self) -> bool {
        self.fluids.iter().any(|f| f.curvature > 0.0) || self.solver.vorticity > 0.0
    }

    /// Spring constant (N/m) and dashpot (N s/m) of one contact between particles of bodies `a` and `b` (E14).
    /// Symmetric to the last bit.
    #[inline]
    pub fn contact_pair(&self, a: u32, b: u32) -> (f32, f32) {
        let (a, b) = (&self.contacts[a as usize], &self.contacts[b as usize]);
        let reduced_mass = 1.0 / (a.inverse_mass + b.inverse_mass);
        Self::contact_constants(
            reduced_mass,
            Self::ln_restitution(a.inverse_mass, a.ln_restitution, b.inverse_mass, b.ln_restitution),
            [a.shared_by.max(b.shared_by), 1.0],
            self.contact_rate(),
            [a.stiffness.max(b.stiffness), a.damping.max(b.damping)],
        )
    }

    /// Spring constant and dashpot between a particle of fluid `fluid` and one of body `b` (E14, E16).
    #[inline]
    pub fn coupling_pair(&self, fluid: u32, b: u32) -> (f32, f32) {
        let b = &self.contacts[b as usize];
        let reduced_mass = 1.0 / (1.0 / self.fluids[fluid as usize].mass + b.inverse_mass);
        Self::contact_constants(reduced_mass, b.ln_restitution, [1.0; 2], self.contact_rate(), [b.stiffness, b.damping])
    }

    /// Spring constant and dashpot between an agent of a mass (kg) and a particle of body `b` (E14, E28).
    #[inline]
    pub fn agent_pair(&self, mass: f32, b: u32) -> (f32, f32) {
        let b = &self.contacts[b as usize];
        let reduced_mass = 1.0 / (1.0 / mass + b.inverse_mass);
        Self::contact_constants(reduced_mass, b.ln_restitution, [1.0; 2], self.contact_rate(), [b.stiffness, b.damping])
    }

    /// Logarithm of the restitution of two bodies of inverse masses `i_a` and `i_b`: what does not move takes that of what does.
    #[inline(always)]
    pub(crate) fn ln_restitution(i_a: f32, ln_a: f32, i_b: f32, ln_b: f32) -> f32 {
        match (i_a == 0.0, i_b == 0.0) {
            (true, _) => ln_b,
            (_, true) => ln_a,
            _ => 0.5 * (ln_a + ln_b),
        }
    }

    /// Friction of two bodies (E13): where one does not say, that of the other.
    #[inline(always)]
    pub(crate) fn friction_of(a: f32, b: f32) -> f32 {
        let mean = (a * b).sqrt();
        let known = if b < 0.0 { a } else { mean };
        if a < 0.0 { b } else { known }
    }

    /// `(u / overlap)^2` of E14 (1/s^2): with it, all sharers together stop a mass at the scene's largest speed within the allowed overlap.
    #[inline]
    pub(crate) fn contact_rate(&self) -> f32 {
        let rate = self.largest_speed / (self.solver.contact_overlap * self.spacing);
        (rate * rate) as f32
    }

    /// Spring constant and dashpot of one contact (E14): of a reduced mass (kg), shared by so many by shape and by count, at a
    /// [`Model::contact_rate`], unless stated.
    #[inline(always)]
    pub(crate) fn contact_constants(mass: f32, ln_e: f32, share: [f32; 2], rate: f32, stated: [f32; 2]) -> (f32, f32) {
        use crate::laws::contact::{damping_ratio, dashpot};
        let given = mass * rate / share[0];
        let k = if stated[0] > 0.0 { stated[0] } else { given };
        let n = share[0].max(share[1]);
        let dashpot = dashpot(damping_ratio(ln_e), k * n, mass) / n;
        (k, if stated[1] >= 0.0 { stated[1] } else { dashpot })
    }

    /// Duration of a contact of body `a` with its like (s), when `sharers` contacts share the load.
    pub fn contact_time(&self, a: usize, sharers: f32) -> f64 {
        let c = &self.contacts[a];
        if c.inverse_mass == 0.0 {
            return f64::INFINITY;
        }
        let (k, _) = self.contact_pair(a as u32, a as u32);
        let mass = 0.5 / f64::from(c.inverse_mass);
        std::f64::consts::PI * (mass / (f64::from(k) * f64::from(sharers))).sqrt()
    }

    /// Takes over the flocks and what they ask of the time step: to be smooth, and not to pass a body within a step.
    pub fn add_flocks(&mut self, flocks: Vec<FlockConstants>) {
        let meet_bodies = !self.contacts.is_empty();
        let mut dt = f64::INFINITY;
        for flock in &flocks {
            dt = dt.min(flock.largest_dt());
            if meet_bodies {
                dt = dt.min(0.5 * self.spacing / f64::from(flock.limits.fastest));
            }
            if let Some(matter) = &flock.matter {
                let period = |b: usize| {
                    let mass = 1.0 / (1.0 / matter.mass + self.contacts[b].inverse_mass);
                    PI * f64::from(mass / self.agent_pair(matter.mass, b as u32).0).sqrt()
                };
                let contact = (0..self.contacts.len()).map(period).fold(f64::INFINITY, f64::min);
                if contact.is_finite() {
                    self.dt_bounds.push((DtBound::Contact, contact / 20.0));
                }
            }
        }
        if dt.is_finite() {
            self.dt_bounds.push((DtBound::Flock, dt));
        }
        self.flocks = flocks;
    }

    /// No vector of a link is longer (1/m): `V_j grad_i W_ij`, twice that to particles of bodies, which are at most a quarter larger than
    /// fluids'.
    pub fn longest_link(&self) -> f32 {
        let kernel = self.kernel.force();
        let part = |k: u16| f32::from(k) / 256.0;
        let steepest = (1..=256).map(|k| (kernel.g(part(k)) * part(k)).abs()).fold(0.0, f32::max);
        2.6 * (self.volume * self.support) as f32 * self.factors.g.abs() * steepest
    }

    /// Spacings that the fastest particle moves in a step of implicit pressure (E29).
    fn courant_flow(&self) -> f64 {
        self.solver.courant_flow.unwrap_or(if self.solver.pressure == Pressure::Pbf { 1.0 } else { 0.6 })
    }

    /// How far the fastest particle gets in a step of implicit pressure (m), and the factor by which [`Ledger::pressed`] counts as a
    /// speed (E29).
    pub(crate) fn bounds_of_flow(&self) -> [f64; 2] {
        let pressed = match self.solver.pressure {
            Pressure::Pbf if self.solver.iterations >= ROOM => 0.0,
            Pressure::Pbf => self.courant_flow() / SWING_PBF,
            _ => self.courant_flow() / SWING,
        };
        [self.courant_flow() * self.spacing, pressed]
    }

    /// How far fluids yield to PBF's pressures: compression over `p / rho_0` (s^2/m^2; E9). As little as the rounds of the budget can hold in
    /// the longest step: a fluid with a speed of sound. Without it, it would be stiffer in shorter steps, and gain energy by each step that
    /// is shortened while it is compressed.
    pub fn compliance(&self) -> f64 {
        let n = self.solver.iterations;
        let reach = 2.0 / 3.0 * n * (n + 1.0) * f64::from(self.factors.reach);
        (self.longest_step() / self.spacing).powi(2) / reach
    }

    /// Most that rounds of DFSPH for velocities may leave of compression on the whole, by `dt^2` (1/s^2; E9): half of what gravity makes of a
    /// fluid that nothing holds, `g / (2 depth)`, for then only what lies at the bottom is compressed. Infinite without gravity.
    pub fn unheld(&self) -> f64 {
        let g = self.gravity.length();
        if g > 0.0 { 0.25 * g / self.depth.max(self.spacing) } else { f64::INFINITY }
    }

    /// Whether rounds have a coarse level: not on a budget, whose fluid yields as far as its rounds alone reach.
    pub fn coarse(&self) -> bool {
        self.solver.coarse && (self.solver.pressure != Pressure::Pbf || self.solver.iterations >= ROOM)
    }

    /// Mean compression at which rounds that correct places end.
    pub fn tolerance(&self) -> f64 {
        if self.solver.pressure == Pressure::Pbf { self.solver.tolerance.min(LOOSE) } else { self.solver.tolerance }
    }

    /// The longest step of implicit pressure (s): stated, or 1/200 s with DFSPH and 1/120 s with PBF, and there no longer than
    /// what lies at the bottom bears, once it is pressed (E29).
    pub(crate) fn longest_step(&self) -> f64 {
        let pbf = self.solver.pressure == Pressure::Pbf;
        let longest = self.solver.longest_dt.unwrap_or(if pbf { 1.0 / 120.0 } else { 1.0 / 200.0 });
        let weight = self.gravity.length() * self.depth;
        if !pbf || weight == 0.0 {
            return longest;
        }
        let swing = if self.solver.iterations < ROOM { SWING_PBF } else { 2.0 * SWING_PBF };
        longest.min(swing * self.spacing / weight.sqrt())
    }

    /// The speed by which steps are bound (m/s): that of the fastest particle, and with implicit pressure that with which pressed
    /// particles swing about their places: `dt sqrt(p / rho) <= 0.35 dx` with DFSPH, which holds the directions of pairs for a step, 0.4 dx
    /// with PBF on a budget of less than 24 rounds, which has none left to find them anew. With more, PBF is bound by the weight of what lies
    /// on the bottom alone: `longest_step`.
    pub fn bounding_speed(&self, ledger: &Ledger) -> f64 {
        ledger.speed.max(self.bounds_of_flow()[1] * ledger.pressed)
    }

    /// Largest time step allowed now and what bounds it (E29), from the largest speed (m/s) and acceleration (m/s^2).
    pub fn largest_dt(&self, speed: f64, acceleration: f64) -> (f64, DtBound) {
        let s = &self.solver;
        let mut best = match s.dt {
            // implicit pressure bears no more than the flow does: there a stated step is the longest
            Some(dt) if !self.implicit() => return (dt, DtBound::Scene),
            Some(dt) => (dt, DtBound::Scene),
            None => (f64::INFINITY, DtBound::Frame),
        };
        if self.implicit() {
            let longest = self.longest_step();
            if longest < best.0 {
                best = (longest, DtBound::Longest);
            }
            // so far the fastest gets in a step, by what it has and what pulls it
            let [way, _] = self.bounds_of_flow();
            let flow = 2.0 * way / (speed + (speed * speed + 4.0 * acceleration * way).sqrt());
            if flow < best.0 {
                best = (flow, DtBound::Flow);
            }
        } else if !self.fluids.is_empty() {
            let sound = s.courant * self.support / (2.0 * (self.sound_speed + speed));
            let force = s.courant_force * (self.support / (2.0 * acceleration)).sqrt();
            for bound in [(sound, DtBound::Sound), (force, DtBound::Force)] {
                if bound.0 < best.0 {
                    best = bound;
                }
            }
        }
        for &(bound, dt) in &self.dt_bounds {
            let inside = self.implicit() && bound == DtBound::Contact; // contacts have steps of their own
            if dt < best.0 && !inside {
                best = (dt, bound);
            }
        }
        best
    }
}
