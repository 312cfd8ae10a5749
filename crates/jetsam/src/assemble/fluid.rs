//! Fluids filled and carved, and the constants derived from a scene: speeds, stiffness, contacts, time step.

use super::bodies::NewBody;
use super::near::Near;
use crate::error::Result;
use crate::integrate::sources::Source;
use crate::interact::cells::Grid;
use crate::model::{
    ContactModel, DtBound, Factors, FluidModel, Model, cohesion_moment, cohesion_pressure, curvature_moment,
};
use crate::scene::joint::{JointKind, JointModel};
use crate::scene::{Coupling, Density, EquationOfState, Force, Pressure, PressureForce, Scene, Solver, Start};
use glam::DVec3;
use std::collections::BTreeMap;

/// Reynolds number of a spacing below which walls show a mirrored velocity to viscosity: above, the layer that does not slip
/// is thinner than particles can show.
const NO_SLIP_BELOW: f64 = 1000.0;

/// Tag of fluids among what takes room.
const FLUID: u32 = 1;

/// A fluid particle on its way into the state.
pub(super) struct Drop {
    /// Place (m).
    pub(super) x: DVec3,
    /// Velocity (m/s).
    pub(super) v: DVec3,
    /// Index of its fluid.
    pub(super) fluid: u32,
    /// Relative density `D`.
    pub(super) density: f64,
}

impl Scene {
    /// Constants, and the fluid: place, velocity, index of its fluid.
    #[allow(clippy::too_many_arguments)] // one caller
    pub(super) fn derive(
        &self,
        grid: Grid,
        volume: f64,
        support: f64,
        bodies: &[NewBody],
        joints: Vec<JointModel>,
        mut carver: Near,
        warnings: &mut Vec<String>,
    ) -> Result<(Model, Vec<Drop>)> {
        let gravity = DVec3::from(self.world.gravity);
        let spacing = self.resolution.spacing;
        let mut fluid: Vec<Drop> = Vec::new();
        let starts = self.starts()?;
        let (mut carved, mut outside) = (0, 0);
        let mut taken = Near::new(support);
        for (index, f) in self.fluid.iter().enumerate() {
            let key = format!("fluid.{index}.shape");
            let Some(shape) = &f.shape else { continue };
            let solid = self.solid(shape, &key)?;
            warnings.extend(solid.warnings.iter().cloned());
            let before = fluid.len();
            for p in solid.points {
                let p = starts.displaced(self, index, p, &grid)?;
                let within = (0..3)
                    .all(|a| self.world.dimensions == 2 && a == 1 || (p[a] >= grid.min[a] && p[a] <= grid.max[a]));
                if !within {
                    outside += 1;
                } else if carver.has(p, None) {
                    carved += 1;
                    if carver.has(p, Some(FLUID)) {
                        taken.insert(p);
                    }
                } else {
                    fluid.push(Drop { x: p, v: DVec3::ZERO, fluid: index as u32, density: 1.0 });
                }
            }
            if fluid.len() == before {
                let message = format!("`{key}` holds no particle inside the domain that no body or other fluid takes");
                return Err(self.error(&key, message, "move or enlarge the shape, or choose a smaller spacing"));
            }
            for drop in &fluid[before..] {
                carver.insert_tagged(drop.x, FLUID);
            }
        }
        if carved > 0 {
            warnings.push(format!("{carved} fluid particles were carved away where bodies or other fluids stand"));
        }
        if outside > 0 {
            warnings.push(format!("{outside} fluid particles outside the domain were left out"));
        }

        let gaps = self.gaps(&fluid, bodies, &taken);
        starts.jitter(self, &mut fluid, &grid);
        let sources = self.sources()?;
        starts.set_velocities(self, &mut fluid)?;
        let largest_speed = self.largest_speed(&fluid, bodies, &sources, gravity, &grid);
        let sound_speed = self.solver.sound_speed.unwrap_or(10.0 * largest_speed);
        self.squeeze(&mut fluid, gravity, sound_speed);
        fluid.iter_mut().zip(gaps).for_each(|(drop, gap)| drop.density *= 1.0 - gap);
        let cohesion = cohesion_moment(support, self.world.dimensions);
        let curvature = curvature_moment(self.solver.kernel.force(), support, self.world.dimensions);
        let fluids: Vec<FluidModel> = self
            .fluid
            .iter()
            .map(|f| FluidModel {
                name: f.name.clone().unwrap_or_else(|| "fluid".into()),
                density: f.density as f32,
                mass: (f.density * volume) as f32,
                viscosity: f.viscosity as f32,
                stiffness: (sound_speed * sound_speed * f.density) as f32,
                artificial: (self.solver.artificial_viscosity * f.density * sound_speed * 0.5 * support) as f32,
                cohesion: ((1.0 - self.solver.curvature) * f.surface_tension / cohesion) as f32,
                curvature: (self.solver.curvature * f.surface_tension / curvature) as f32,
                lifetime: f.lifetime.unwrap_or(f64::INFINITY),
                diffusion: (self.solver.density_diffusion * 0.5 * support / (sound_speed * f.density)) as f32,
            })
            .collect();
        let contacts = bodies
            .iter()
            .enumerate()
            .map(|(index, b)| ContactModel {
                jointed: joints.iter().any(|j| j.a == index || j.b == Some(index)),
                joined: self.joined(&joints, index),
                inverse_mass: (1.0 / b.mass) as f32,
                ln_restitution: b.restitution.ln() as f32,
                // a body of n particles rests on about n^(1/3) of them
                shared_by: if b.mass.is_infinite() { 1.0 } else { (b.offset.len() as f64).cbrt() as f32 },
                face: largest_face(b, spacing),
                friction: b.friction.unwrap_or(-1.0) as f32,
                stiffness: b.stiffness.unwrap_or(0.0) as f32,
                damping: b.damping.unwrap_or(-1.0) as f32,
            })
            .collect();
        let mut model = Model {
            dimensions: self.world.dimensions,
            spacing,
            support,
            volume,
            kernel: self.solver.kernel,
            factors: Factors::new(self.solver.kernel, self.solver.support, support, self.world.dimensions),
            fluids,
            flocks: Vec::new(),
            contacts,
            largest_speed,
            depth: self.depth(&fluid, gravity),
            sound_speed,
            gravity,
            sources,
            drains: self.drains()?,
            seed: self.world.seed,
            fields: self.force.iter().filter(|f| !matches!(f, Force::Shake(_))).cloned().collect(),
            shakes: self
                .force
                .iter()
                .filter_map(|f| if let Force::Shake(s) = f { Some(s.clone()) } else { None })
                .collect(),
            joints,
            paths: bodies.iter().map(|b| b.path.clone()).collect(),
            grid,
            contact_diameter: self.solver.contact_diameter * spacing,
            solver: Solver { pressure: self.pressure_solver()?, ..self.solver.clone() },
            dt_bounds: Vec::new(),
            no_slip: !self.solver.walls_slip
                && self.fluid.iter().any(|f| f.density * largest_speed * spacing < NO_SLIP_BELOW * f.viscosity),
            full_support: if self.world.dimensions == 3 {
                4.0 / 3.0 * std::f64::consts::PI * self.solver.support.powi(3)
            } else {
                std::f64::consts::PI * self.solver.support.powi(2)
            },
            warnings: Vec::new(),
        };
        model.dt_bounds = self.dt_bounds(&model);
        Ok((model, fluid))
    }

    /// The solver of pressure that the scene asks for.
    fn pressure_solver(&self) -> Result<Pressure> {
        let s = &self.solver;
        let chosen = match s.pressure {
            Pressure::Auto => Pressure::Wcsph,
            stated => stated,
        };
        if chosen == Pressure::Wcsph {
            return Ok(chosen);
        }
        let only = |what: &str, key: &str| {
            let message = format!("{what} goes with pressure = \"wcsph\" alone");
            self.error(key, message, "leave it out, or state pressure = \"wcsph\"")
        };
        if s.pressure_force == PressureForce::Mueller {
            return Err(only("pressure_force = \"mueller\"", "solver.pressure_force"));
        }
        if s.negative_pressure {
            return Err(only("negative_pressure", "solver.negative_pressure"));
        }
        Ok(chosen)
    }

    /// Bodies that a body does not touch, for a joint holds them together.
    fn joined(&self, joints: &[JointModel], body: usize) -> Vec<u32> {
        let held = joints.iter().zip(&self.joint).filter(|(_, said)| !said.collide).map(|(joint, _)| joint);
        let partner = |j: &JointModel| match j.b {
            Some(b) if j.a == body => Some(b as u32),
            Some(b) if b == body => Some(j.a as u32),
            _ => None,
        };
        held.filter_map(partner).collect()
    }

    /// Depth of the fluids where it is largest (m): their volume in a column as wide as the support, over its base.
    fn depth(&self, fluid: &[Drop], gravity: DVec3) -> f64 {
        let Some(down) = gravity.try_normalize() else { return 0.0 };
        let (dx, d) = (self.resolution.spacing, self.world.dimensions as i32);
        let wide = self.solver.support * dx;
        let (a, b) = down.any_orthonormal_pair();
        let mut columns = BTreeMap::new();
        for drop in fluid {
            let column = [a, b].map(|axis| (drop.x.dot(axis) / wide).floor() as i64);
            *columns.entry(column).or_insert(0u32) += 1;
        }
        f64::from(columns.into_values().max().unwrap_or(0)) * dx.powi(d) / wide.powi(d - 1)
    }

    /// Largest speed the scene can reach (m/s): from depth, drop height and velocities given.
    fn largest_speed(
        &self,
        fluid: &[Drop],
        bodies: &[NewBody],
        sources: &[Source],
        gravity: DVec3,
        grid: &Grid,
    ) -> f64 {
        let g = gravity.length();
        let mut speed: f64 = 0.0;
        if g > 0.0 {
            let up = -gravity / g;
            let height = |p: DVec3| p.dot(up);
            let corner = |far: bool| {
                DVec3::new(
                    if (up.x > 0.0) == far { grid.max.x } else { grid.min.x },
                    if (up.y > 0.0) == far { grid.max.y } else { grid.min.y },
                    if (up.z > 0.0) == far { grid.max.z } else { grid.min.z },
                )
            };
            let lowest_fluid = fluid.iter().map(|f| height(f.x)).fold(f64::INFINITY, f64::min);
            let top = fluid.iter().map(|f| height(f.x)).fold(f64::NEG_INFINITY, f64::max);
            let floor = if bodies.iter().any(|b| b.mass.is_infinite()) { height(corner(false)) } else { lowest_fluid };
            if top.is_finite() {
                speed = (2.0 * g * (top - floor).max(0.0)).sqrt();
            }
            for source in sources {
                let top = source.points.iter().map(|&p| height(p)).fold(f64::NEG_INFINITY, f64::max);
                let drop = (top - height(corner(false))).max(0.0);
                speed = speed.max((2.0 * g * drop + source.velocity.length_squared()).sqrt());
            }
            // bodies fall onto the fluid, or onto the floor where there is none
            let ground = if top.is_finite() { top } else { height(corner(false)) };
            for body in bodies.iter().filter(|b| b.mass.is_finite()) {
                let drop = (height(body.x) - ground).max(0.0);
                speed = speed.max((2.0 * g * drop + body.v.length_squared()).sqrt());
            }
        }
        speed = fluid.iter().map(|f| f.v.length()).fold(speed, f64::max);
        for f in &self.fluid {
            // cohesion squeezes a fluid: the speed that its pressure would drive it at
            let (support, d) = (self.solver.support * self.resolution.spacing, self.world.dimensions);
            let cohesion = (1.0 - self.solver.curvature) * f.surface_tension / cohesion_moment(support, d);
            let pressure = cohesion * cohesion_pressure(support, d);
            speed = speed.max((pressure / f.density).sqrt());
        }
        for source in sources {
            speed = speed.max(source.velocity.length());
        }
        for f in self.flock.iter().filter(|f| f.mass.is_some()) {
            speed = speed.max(f.speed_max.unwrap_or(1.5 * f.speed));
        }
        for body in bodies {
            let reach = body.offset.iter().map(|o| o.length()).fold(0.0, f64::max);
            if let Some(path) = &body.path {
                speed = speed.max(path.largest_speed(reach, self.run.seconds));
            } else {
                speed = speed.max(body.v.length() + body.spin.length() * reach);
            }
        }
        // a scene in which nothing moves still needs a scale: a spacing in a tenth of a second
        if speed > 0.0 { speed } else { 10.0 * self.resolution.spacing }
    }

    /// Where fluid was carved away for bodies: by how much the density of each particle is less than in a full lattice. Lattices
    /// that do not match leave gaps; an integrated density would never know of them, and bodies would displace too much. A
    /// summed one sees for itself.
    fn gaps(&self, fluid: &[Drop], bodies: &[NewBody], taken: &Near) -> Vec<f64> {
        if self.solver.density != Density::Continuity || taken.is_empty() {
            return vec![0.0; fluid.len()];
        }
        let (spacing, dimensions) = (self.resolution.spacing, self.world.dimensions);
        let support = self.solver.support * spacing;
        let kernel = self.solver.kernel.density();
        let w = |r: f64| kernel.value(r, support, dimensions);
        let full = kernel.lattice_sum(self.solver.support, dimensions);
        let volume = spacing.powi(dimensions as i32);
        let mut volumes = Vec::new();
        let mut put = Near::new(support);
        for body in bodies {
            for (p, v) in body.points().zip(&body.particle_volume) {
                // of bodies, what stands where fluid was
                if taken.sum(p, |r| f64::from(r < spacing)) > 0.0 {
                    put.insert_tagged(p, volumes.len() as u32);
                    volumes.push(*v);
                }
            }
        }
        let gap = |drop: &Drop| {
            let before = volume * taken.sum(drop.x, w);
            if before == 0.0 {
                return 0.0;
            }
            let mut now = 0.0;
            put.around(drop.x, |d, k| {
                if d.length() < support {
                    now += volumes[k as usize] * w(d.length());
                }
            });
            ((before - now) / full).max(0.0)
        };
        fluid.iter().map(gap).collect()
    }

    /// Squeezes fluids that start hydrostatic: the equation of state then holds up what stands above.
    fn squeeze(&self, fluid: &mut [Drop], gravity: DVec3, sound_speed: f64) {
        let g = gravity.length();
        if g == 0.0 || matches!(self.solver.pressure, Pressure::Dfsph | Pressure::Pbf) {
            return;
        }
        let up = -gravity / g;
        for (index, f) in self.fluid.iter().enumerate() {
            if f.start != Start::Hydrostatic {
                continue;
            }
            let own = || fluid.iter().filter(|p| p.fluid == index as u32).map(|p| p.x.dot(up));
            let half = 0.5 * self.resolution.spacing;
            let (bottom, top) =
                (own().fold(f64::INFINITY, f64::min) - half, own().fold(f64::NEG_INFINITY, f64::max) + half);
            let depth = top - bottom;
            let c_sq = sound_speed * sound_speed;
            // height y above the bottom at rest -> height under its own weight: integral of rho_0 / rho
            let squeezed = |y: f64| match self.solver.equation_of_state {
                // rho / rho_0 = 1 + g (depth - y) / c^2, to first order
                EquationOfState::Linear => y - g * (depth * y - 0.5 * y * y) / c_sq,
                // rho / rho_0 = (1 + 7 g (depth - y) / c^2)^(1/7) in present heights, to first order the same
                EquationOfState::Tait => {
                    let a = 7.0 * g / c_sq;
                    let power = |u: f64| (1.0 + a * u).powf(6.0 / 7.0);
                    (power(depth) - power(depth - y)) / (a * 6.0 / 7.0)
                }
            };
            for p in fluid.iter_mut().filter(|p| p.fluid == index as u32) {
                let y = p.x.dot(up) - bottom;
                let now = squeezed(y);
                p.x += (now - y) * up;
                let above = g * (squeezed(depth) - now).max(0.0) / c_sq;
                p.density = match self.solver.equation_of_state {
                    EquationOfState::Linear => above.exp(),
                    EquationOfState::Tait => (1.0 + 6.0 * above).powf(1.0 / 6.0),
                };
            }
        }
    }

    /// Bounds of the time step that do not change (E29).
    fn dt_bounds(&self, model: &Model) -> Vec<(DtBound, f64)> {
        let s = &self.solver;
        let mut bounds = Vec::new();
        let mut viscous = f64::INFINITY;
        for f in &self.fluid {
            if f.viscosity > 0.0 {
                viscous = viscous.min(s.courant_viscous * model.support.powi(2) * f.density / (4.0 * f.viscosity));
            }
        }
        if model.implicit() {
            // the artificial viscosity is bound to sound, which bounds no step now; as eta / 2 (d + 2) it acts on the pairs that approach
            let half = 0.5 * model.support;
            for f in &model.fluids {
                let mu = f64::from(f.artificial) / (2.0 * (model.dimensions as f64 + 2.0));
                viscous = viscous.min(2.0 * s.courant_viscous * half * half * f64::from(f.density) / mu);
            }
        }
        // capillary waves (Brackbill et al. 1992), in the same class as viscosity
        for f in self.fluid.iter().filter(|f| f.surface_tension > 0.0) {
            let wave =
                (f.density * (0.5 * model.support).powi(3) / (2.0 * std::f64::consts::PI * f.surface_tension)).sqrt();
            viscous = viscous.min(s.courant_force * wave);
        }
        let mut contact = f64::INFINITY;
        for joint in model.joints.iter().filter(|j| j.kind == JointKind::Spring) {
            let inverse = |body: usize| f64::from(model.contacts[body].inverse_mass);
            let rate = joint.stiffness * (inverse(joint.a) + joint.b.map_or(0.0, inverse));
            contact = contact.min(std::f64::consts::PI / rate.sqrt() / 20.0);
        }
        for a in 0..model.contacts.len() {
            let c = &model.contacts[a];
            contact = contact.min(model.contact_time(a, c.shared_by) / 20.0).min(model.contact_time(a, c.face) / 8.0);
        }
        if s.coupling == Coupling::Spring && !self.rigid.is_empty() {
            for (index, _) in self.fluid.iter().enumerate() {
                for b in (0..model.contacts.len()).filter(|&b| model.contacts[b].inverse_mass > 0.0) {
                    let (k, _) = model.coupling_pair(index as u32, b as u32);
                    let mass = 1.0 / f64::from(1.0 / model.fluids[index].mass + model.contacts[b].inverse_mass);
                    contact = contact.min(std::f64::consts::PI * (mass / f64::from(k)).sqrt() / 20.0);
                }
            }
        }
        for (bound, dt) in [(DtBound::Viscosity, viscous), (DtBound::Contact, contact)] {
            if dt.is_finite() {
                bounds.push((bound, dt));
            }
        }
        bounds
    }
}

/// Most particles of a body in a layer one spacing thick: as many contacts share a load at most.
fn largest_face(body: &NewBody, spacing: f64) -> f32 {
    if body.mass.is_infinite() {
        return 1.0;
    }
    let mut most = 1;
    for n in -1..=1 {
        for m in -1..=1 {
            for axis in [DVec3::new(1.0, m.into(), n.into()), DVec3::new(0.0, 1.0, n.into()), DVec3::Z] {
                let axis = axis.normalize();
                let mut layers = std::collections::BTreeMap::new();
                for o in &body.offset {
                    let count = layers.entry((o.dot(axis) / spacing).round() as i64).or_insert(0);
                    *count += 1;
                    most = most.max(*count);
                }
            }
        }
    }
    most as f32
}
