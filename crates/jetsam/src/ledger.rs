//! What a step leaves behind in numbers: extremes that bound the next step, what was lost, momentum, energies.

use glam::DVec3;

/// Sums over the particles and bodies of a state, made in a fixed order.
#[derive(Clone, Debug, Default)]
pub struct Ledger {
    /// Largest speed of any particle (m/s).
    pub speed: f64,
    /// Largest speed of any particle of a rigid body (m/s).
    pub body_speed: f64,
    /// Largest acceleration of any fluid particle (m/s^2).
    pub acceleration: f64,
    /// Momentum of fluids, rigid bodies and agents of mass (kg m/s).
    pub momentum: DVec3,
    /// Sum of the magnitudes of the momenta of particles and bodies (kg m/s).
    pub momentum_scale: f64,
    /// Momentum of fluid that came in by sources, less that of fluid that left or was drained, in this step (kg m/s).
    pub crossed: DVec3,
    /// Force from outside: walls, static bodies, gravity, fields (N).
    pub external_force: DVec3,
    /// Impulse of this step by joints to what does not move, and of agents by themselves (N s).
    pub external_impulse: DVec3,
    /// Sum of all forces on fluids, rigid bodies and agents (N): equals `external_force` up to rounding (E12, C9).
    pub total_force: DVec3,
    /// Sum of the magnitudes of the forces on fluids' and bodies' particles (N).
    pub force_scale: f64,
    /// How implicit pressure was found in the last step (E9).
    pub pressure: Solve,
    /// How velocities were made free of compression (E9, DFSPH).
    pub divergence: Solve,
    /// The speed that pressure could give: `sqrt(p / rho)` of the root mean square of pressures, times `3^(1/4)`, which is the largest in a
    /// tank at rest (m/s); 0 with WCSPH.
    pub pressed: f64,
    /// Times implicit pressure did not keep a fluid particle out of a solid side of the domain, so that it was put back, since the
    /// beginning.
    pub put_back: u64,
    /// Kinetic energy (J).
    pub kinetic: f64,
    /// Potential energy in the gravity vector, zero at the domain's lower corner (J).
    pub potential: f64,
    /// Mean of `|D - 1|` over fluid particles with full support.
    pub density_error_mean: f64,
    /// Largest `|D - 1|` over fluid particles with full support.
    pub density_error_max: f64,
    /// Mean number of neighbours of a fluid particle, itself not counted.
    pub neighbours: f64,
    /// Fluid particles alive.
    pub fluid: usize,
    /// Fluid particles that passed an open side, since the beginning.
    pub left: u64,
    /// Fluid particles given by sources, since the beginning.
    pub born: u64,
    /// Fluid particles taken by sinks or the end of their lifetime, since the beginning.
    pub drained: u64,
    /// Fluid particles that got through a solid wall, since the beginning.
    pub lost: u64,
    /// Particles of rigid bodies that are now beyond a solid wall.
    pub rigid_lost: usize,
    /// Times a body came so deep into another, or moved so far in a step while touching one, that it could have passed
    /// through, since the beginning (E12).
    pub fast_contacts: u64,
    /// Particles found with a position that is not finite, since the beginning.
    pub nonfinite: u64,
}

impl Ledger {
    /// Adds what was summed of a part of the particles or bodies. Means and [`Ledger::pressed`] are sums still; counts since the
    /// beginning are left alone.
    pub(crate) fn add(&mut self, part: &Self) {
        self.speed = self.speed.max(part.speed);
        self.acceleration = self.acceleration.max(part.acceleration);
        self.momentum += part.momentum;
        self.momentum_scale += part.momentum_scale;
        self.external_force += part.external_force;
        self.total_force += part.total_force;
        self.force_scale += part.force_scale;
        self.pressed += part.pressed;
        self.kinetic += part.kinetic;
        self.potential += part.potential;
        self.density_error_mean += part.density_error_mean;
        self.density_error_max = self.density_error_max.max(part.density_error_max);
        self.neighbours += part.neighbours;
        self.nonfinite += part.nonfinite;
    }

    /// What was counted since the beginning, and nothing else.
    pub fn counts(&self) -> Self {
        Self {
            left: self.left,
            born: self.born,
            drained: self.drained,
            lost: self.lost,
            fast_contacts: self.fast_contacts,
            nonfinite: self.nonfinite,
            put_back: self.put_back,
            ..Self::default()
        }
    }
}

/// How the iterations of a solve went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Solve {
    /// Rounds made.
    pub iterations: u32,
    /// Mean compression left, as a fraction of the rest density: of densities, or what velocities bring in a step.
    pub residual: f64,
}
