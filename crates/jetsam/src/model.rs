//! What does not change while a world runs: constants derived from the scene.

use crate::interact::cells::Grid;
use crate::laws::kernel::{Kernel, KernelSet};
use crate::scene::joint::JointModel;
use crate::scene::motion::{Path, Shake};
use crate::scene::{Force, Solver};
use glam::DVec3;

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
    /// Contact numbers of each body, in the order of [`crate::state::Bodies`].
    pub contacts: Vec<ContactModel>,
    /// Largest speed the scene can reach (m/s), from depth, drop height and velocities.
    pub largest_speed: f64,
    /// Speed of sound `c_0` (m/s).
    pub sound_speed: f64,
    /// Gravity (m/s^2).
    pub gravity: DVec3,
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
    /// From the force kernel's `g(s)` to `G = (1/r) dW/dr` (1/m^(d+2)): the gradient of a linear field on a lattice
    /// is exact, and with it the Laplacian of E5.
    pub g: f32,
    /// From the viscosity kernel's shape to `nabla^2 W` (1/m^(d+2)), exact alike.
    pub laplacian: f32,
}

impl Factors {
    /// Factors for a support of `spacings` spacings, `support` metres.
    pub fn new(kernel: KernelSet, spacings: f64, support: f64, dimensions: u32) -> Self {
        let (density, force, d) = (kernel.density(), kernel.force(), dimensions as i32);
        let w = density.norm(dimensions) / support.powi(d) / density.lattice_sum(spacings, dimensions);
        let g = force.norm(dimensions) / support.powi(d + 2) / force.lattice_gradient(spacings, dimensions);
        let laplacian = Kernel::laplacian_norm(dimensions) / support.powi(d + 2);
        let laplacian = laplacian / Kernel::lattice_laplacian(spacings, dimensions);
        Self { w: w as f32, g: g as f32, laplacian: laplacian as f32 }
    }
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
    /// Largest acceleration.
    Force,
    /// Viscosity.
    Viscosity,
    /// A twentieth of a contact.
    Contact,
    /// The fastest body moves a tenth of the contact diameter.
    Travel,
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
            DtBound::Force => "force",
            DtBound::Viscosity => "viscosity",
            DtBound::Contact => "contact",
            DtBound::Travel => "travel",
            DtBound::Scene => "scene",
            DtBound::Frame => "frame",
        }
    }
}

/// Tangential over normal spring of a contact: both then last equally long for a ball (Schaefer, Dippel and Wolf 1996).
const TANGENTIAL: f32 = 2.0 / 7.0;
/// Damping ratio of the tangential spring (E13).
const TANGENTIAL_DAMPING: f32 = 0.3;

impl Model {
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

    /// Reduced mass of bodies `a` and `b` (kg).
    #[inline]
    pub fn reduced_mass(&self, a: u32, b: u32) -> f32 {
        1.0 / (self.contacts[a as usize].inverse_mass + self.contacts[b as usize].inverse_mass)
    }

    /// Dashpot (N s/m) that takes the speed of approach of bodies `a` and `b` within a step if as many contacts as a
    /// face has particles share it, and never more (E12).
    #[inline]
    pub fn stop(&self, a: u32, b: u32, dt: f32) -> f32 {
        let mass = self.reduced_mass(a, b);
        let (a, b) = (&self.contacts[a as usize], &self.contacts[b as usize]);
        if dt > 0.0 { mass / (dt * a.face.max(b.face)) } else { 0.0 }
    }

    /// Tangential spring (N/m), its dashpot (N s/m) and friction of one contact of bodies `a` and `b` with the normal
    /// spring `k` times `part`, while `counted` contacts share the load (E13). Symmetric to the last bit.
    #[inline]
    pub fn friction_pair(&self, a: u32, b: u32, k: f32, part: f32, counted: f32) -> (f32, f32, f32) {
        let (a, b) = (&self.contacts[a as usize], &self.contacts[b as usize]);
        let mu = match (a.friction < 0.0, b.friction < 0.0) {
            (true, _) => b.friction,
            (_, true) => a.friction,
            _ => (a.friction * b.friction).sqrt(),
        };
        let mass = 1.0 / (a.inverse_mass + b.inverse_mass);
        let n = a.shared_by.max(b.shared_by).max(counted);
        let k_t = TANGENTIAL * k;
        let eta_t = part * crate::laws::contact::dashpot(TANGENTIAL_DAMPING, k_t / part * n, mass) / n;
        (k_t, eta_t, mu)
    }

    /// Spring constant (N/m) and dashpot (N s/m) of one contact between particles of bodies `a` and `b` (E14).
    /// Symmetric to the last bit.
    #[inline]
    pub fn contact_pair(&self, a: u32, b: u32) -> (f32, f32) {
        self.contact_pair_of(a, b, 1.0)
    }

    /// The same while `counted` contacts share the load: the dashpot's part is the smaller.
    #[inline]
    pub fn contact_pair_of(&self, a: u32, b: u32, counted: f32) -> (f32, f32) {
        let (a, b) = (&self.contacts[a as usize], &self.contacts[b as usize]);
        let reduced_mass = 1.0 / (a.inverse_mass + b.inverse_mass);
        self.contact_constants(
            reduced_mass,
            match (a.inverse_mass == 0.0, b.inverse_mass == 0.0) {
                (true, _) => b.ln_restitution, // what does not move takes the restitution of what does
                (_, true) => a.ln_restitution,
                _ => 0.5 * (a.ln_restitution + b.ln_restitution),
            },
            a.shared_by.max(b.shared_by),
            counted,
            a.stiffness.max(b.stiffness),
            a.damping.max(b.damping),
        )
    }

    /// Spring constant and dashpot between a particle of fluid `fluid` and one of body `b` (E14, E16).
    #[inline]
    pub fn coupling_pair(&self, fluid: u32, b: u32) -> (f32, f32) {
        let b = &self.contacts[b as usize];
        let reduced_mass = 1.0 / (1.0 / self.fluids[fluid as usize].mass + b.inverse_mass);
        self.contact_constants(reduced_mass, b.ln_restitution, 1.0, 1.0, b.stiffness, b.damping)
    }

    #[inline]
    fn contact_constants(
        &self,
        mass: f32,
        ln_e: f32,
        shared_by: f32,
        counted: f32,
        stated_k: f32,
        stated_eta: f32,
    ) -> (f32, f32) {
        use crate::laws::contact::{damping_ratio, dashpot};
        let k = if stated_k > 0.0 {
            stated_k
        } else {
            // all sharers together stop the mass at the scene's largest speed within the allowed overlap
            let rate = self.largest_speed / (self.solver.contact_overlap * self.spacing);
            mass * (rate * rate) as f32 / shared_by
        };
        let n = shared_by.max(counted);
        let eta = if stated_eta >= 0.0 { stated_eta } else { dashpot(damping_ratio(ln_e), k * n, mass) / n };
        (k, eta)
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

    /// Largest time step allowed now and what bounds it (E29), from the largest speed (m/s) and acceleration (m/s^2).
    pub fn largest_dt(&self, speed: f64, acceleration: f64) -> (f64, DtBound) {
        let s = &self.solver;
        if let Some(dt) = s.dt {
            return (dt, DtBound::Scene);
        }
        let mut best = (f64::INFINITY, DtBound::Frame);
        if !self.fluids.is_empty() {
            let sound = s.courant * self.support / (2.0 * (self.sound_speed + speed));
            let force = s.courant_force * (self.support / (2.0 * acceleration)).sqrt();
            for bound in [(sound, DtBound::Sound), (force, DtBound::Force)] {
                if bound.0 < best.0 {
                    best = bound;
                }
            }
        }
        for &(bound, dt) in &self.dt_bounds {
            if dt < best.0 {
                best = (dt, bound);
            }
        }
        best
    }
}
