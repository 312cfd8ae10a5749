//! From a scene to constants and a state: shapes are filled, bodies placed, walls built, numbers derived.
//!
//! Everything that can be wrong with a scene as a whole is found here: bodies outside the domain, periodic axes
//! too short, more memory than there is. What is repaired (fluid carved where bodies stand) is said in the
//! model's warnings.

use crate::error::Result;
use crate::interact::cells::Grid;
use crate::mesh::Mesh;
use crate::model::{ContactModel, DtBound, Factors, FluidModel, Model};
use crate::random;
use crate::scene::solid::Solid;
use crate::scene::{Coupling, EquationOfState, Rigid, Scene, Start, Wall};
use crate::state::{Bodies, Body, Kind, Particles, Record, State};
use glam::{DMat3, DQuat, DVec3};
use std::collections::HashMap;
use std::sync::Arc;

/// Bytes a particle takes, neighbour lists included, at about 30 neighbours; for the check before memory is taken.
const BYTES_PER_PARTICLE: f64 = 600.0;
/// Bytes a cell takes (three kinds, counters of two threads).
const BYTES_PER_CELL: f64 = 24.0;
/// Fluid closer to a body's particle than this many spacings is carved away.
const CARVE: f64 = 0.85;

/// A scene made ready to run.
#[derive(Debug)]
pub struct Assembly {
    /// Constants.
    pub model: Model,
    /// State at the beginning.
    pub state: State,
    /// Mesh of each body that was given as one, in the body's frame about the centre of mass; shared by copies.
    pub meshes: Vec<Option<(Arc<Mesh>, DVec3)>>,
}

impl Scene {
    /// Makes the scene ready to run.
    ///
    /// # Errors
    /// Whatever is wrong with the scene, with place and remedy.
    pub fn assemble(&self) -> Result<Assembly> {
        self.check_whole()?;
        let mut warnings = Vec::new();
        let spacing = self.resolution.spacing;
        let dimensions = self.world.dimensions;
        let support = self.solver.support * spacing;
        let volume = spacing.powi(dimensions as i32);
        let layers = (self.solver.support - 1e-9).ceil().max(1.0);
        let grid = self.grid(support, layers * spacing);
        self.check_memory(&grid)?;

        let mut bodies = self.rigid_bodies(&grid, volume, &mut warnings)?;
        let rigid_count = bodies.len();
        bodies.extend(self.static_bodies(&grid, volume, layers as usize, &mut warnings)?);
        let mut carver = Near::new(CARVE * spacing);
        for body in &bodies {
            for p in body.points() {
                carver.insert(p);
            }
        }
        warn_of_overlap(&bodies[..], spacing, &mut warnings);
        let (mut model, fluid) = self.derive(grid, volume, support, &bodies, carver, &mut warnings)?;
        model.warnings = warnings;
        let meshes = bodies.iter().map(|b| b.mesh.clone()).collect();
        let state = join(fluid, bodies, rigid_count, &model);
        let particles = state.particles.len() as f64;
        check_available(particles * BYTES_PER_PARTICLE).map_err(|(need, have)| {
            let message = format!("{particles} particles need {need:.1} GB of memory, and {have:.1} GB are available");
            self.error("resolution.spacing", message, "choose a larger [resolution] spacing")
        })?;
        Ok(Assembly { model, state, meshes })
    }

    fn check_whole(&self) -> Result<()> {
        if !(2..=3).contains(&self.world.dimensions) {
            let message = format!("`world.dimensions` = {} is neither 2 nor 3", self.world.dimensions);
            return Err(self.error("world.dimensions", message, "give 2 (the x-z plane) or 3"));
        }
        for a in (0..3).filter(|&a| !(self.world.dimensions == 2 && a == 1)) {
            if self.domain.max[a] <= self.domain.min[a] {
                let message = format!("the domain is empty along {}", ["x", "y", "z"][a]);
                return Err(self.error("domain.max", message, "make every component of max larger than min's"));
            }
        }
        if self.world.dimensions == 2 && (self.world.gravity[1] != 0.0) {
            let message = "a 2D scene lies in the x-z plane, but gravity has a y component";
            return Err(self.error("world.gravity", message, "give gravity = [x, 0, z]"));
        }
        if self.fluid.is_empty() && self.rigid.is_empty() {
            return Err(self.error(
                "",
                "the scene has neither fluid nor rigid bodies",
                "add a [[fluid]] or a [[rigid]]",
            ));
        }
        let support = self.solver.support * self.resolution.spacing;
        for a in 0..3 {
            let length = self.domain.max[a] - self.domain.min[a];
            let flat = self.world.dimensions == 2 && a == 1;
            if self.domain.walls[a] == Wall::Periodic && !flat && length < 3.0 * support {
                let message =
                    format!("a periodic axis of {length} m is shorter than three supports ({:.4} m)", 3.0 * support);
                return Err(self.error("domain.walls", message, "lengthen the domain or choose a smaller spacing"));
            }
        }
        Ok(())
    }

    fn grid(&self, support: f64, wall: f64) -> Grid {
        let (min, max) = (DVec3::from(self.domain.min), DVec3::from(self.domain.max));
        Grid::new(min, max, self.domain.walls, self.world.dimensions, support, wall)
    }

    fn check_memory(&self, grid: &Grid) -> Result<()> {
        let cells: f64 = grid.cells.iter().map(|&c| f64::from(c)).product();
        let flat = self.world.dimensions == 2;
        let reach = |shape: &crate::scene::Shape| match shape {
            crate::scene::Shape::Box(r) => {
                let s = DVec3::from(r.max) - DVec3::from(r.min);
                s.x * s.z * if flat { 1.0 } else { s.y }
            }
            _ => 0.0,
        };
        let cell = self.resolution.spacing.powi(self.world.dimensions as i32);
        let particles: f64 = self.fluid.iter().map(|f| reach(&f.shape).max(0.0)).sum::<f64>() / cell;
        let need = cells * BYTES_PER_CELL + particles * BYTES_PER_PARTICLE;
        let too_many = cells >= f64::from(i32::MAX) || particles >= f64::from(i32::MAX);
        if too_many || check_available(need).is_err() {
            let have = available_gigabytes();
            let message = format!(
                "a spacing of {} m needs {cells:.2e} cells and {particles:.2e} fluid particles, {:.1} GB of memory; {have:.1} GB are available",
                self.resolution.spacing,
                need / 1e9
            );
            return Err(self.error("resolution.spacing", message, "choose a larger spacing or a smaller domain"));
        }
        Ok(())
    }

    fn rigid_bodies(&self, grid: &Grid, volume: f64, warnings: &mut Vec<String>) -> Result<Vec<NewBody>> {
        let mut all = Vec::new();
        for (index, rigid) in self.rigid.iter().enumerate() {
            let key = format!("rigid.{index}");
            let solid = self.solid(&rigid.shape, &format!("{key}.shape"))?;
            warnings.extend(solid.warnings.iter().cloned());
            let mass = match (rigid.density, rigid.mass) {
                (Some(d), None) => d * solid.volume,
                (None, Some(m)) => m,
                _ => {
                    let message = format!("`{key}` needs either a density or a mass");
                    return Err(self.error(&key, message, "add density = ... (kg/m^3) or mass = ... (kg)"));
                }
            };
            for (place, turn, number) in self.copies(rigid, index, &solid, &key)? {
                let name = rigid.name.clone().unwrap_or_else(|| "rigid".into());
                let name = number.map_or(name.clone(), |n| format!("{name}-{n}"));
                let mut body = NewBody::new(name, &solid, place, turn, self.world.dimensions);
                body.mass = mass;
                let inertia = solid.inertia * (mass / solid.volume);
                body.inverse_inertia = if self.world.dimensions == 2 {
                    DMat3::from_diagonal(DVec3::Y / inertia.y_axis.y)
                } else {
                    inertia.inverse()
                };
                body.v = DVec3::from(rigid.velocity);
                body.spin = DVec3::from(rigid.spin);
                if self.world.dimensions == 2 {
                    body.v.y = 0.0;
                    body.spin = DVec3::Y * body.spin.y;
                }
                body.restitution = rigid.restitution;
                body.stiffness = rigid.stiffness;
                body.damping = rigid.damping;
                // the particles together displace the exact volume, as far as that is a small correction
                let share = solid.volume / solid.points.len() as f64;
                body.particle_volume = vec![share.clamp(0.8 * volume, 1.25 * volume); solid.points.len()];
                self.check_inside(&body, grid, &key)?;
                all.push(body);
            }
        }
        Ok(all)
    }

    /// Place, rotation and number of each copy of a rigid body.
    fn copies(
        &self,
        rigid: &Rigid,
        index: usize,
        solid: &Solid,
        key: &str,
    ) -> Result<Vec<(DVec3, DQuat, Option<u32>)>> {
        let position = DVec3::from(rigid.position);
        let turn = axis_angle(rigid.rotation);
        let Some(copies) = &rigid.copies else { return Ok(vec![(position, turn, None)]) };
        let key = format!("{key}.copies");
        let particles = f64::from(copies.count) * solid.points.len() as f64;
        if particles >= f64::from(i32::MAX) || check_available(particles * BYTES_PER_PARTICLE).is_err() {
            let message = format!("`{key}`: {} copies of {} particles are too many", copies.count, solid.points.len());
            return Err(self.error(&key, message, "ask for fewer copies, or choose a larger [resolution] spacing"));
        }
        let (seed, stream) = (self.world.seed, index as u64);
        let turned = |n: u32| if copies.tumble { random::rotation(seed, 2 * stream, n.into()) * turn } else { turn };
        match (&copies.grid, &copies.random) {
            (Some(grid), None) => {
                let [nx, ny] = grid.columns.map(|c| c.max(1));
                Ok((0..copies.count)
                    .map(|n| {
                        let at = [n % nx, n / nx % ny, n / (nx * ny)].map(f64::from);
                        (position + DVec3::from(at) * DVec3::from(grid.step), turned(n), Some(n))
                    })
                    .collect())
            }
            (None, Some(region)) => {
                // a ball about the centre of mass that holds the body in any orientation
                let radius =
                    solid.points.iter().map(|p| p.distance(solid.center)).fold(0.0, f64::max) + self.resolution.spacing;
                let (min, max) = (DVec3::from(region.min) + radius, DVec3::from(region.max) - radius);
                let mut placed: Vec<DVec3> = Vec::new();
                let mut draw = 0;
                while placed.len() < copies.count as usize {
                    let [x, y, z] = [0, 1, 2].map(|a| random::uniform(seed, 2 * stream + 1, 3 * draw + a));
                    draw += 1;
                    let mut c = min + (max - min) * DVec3::new(x, y, z);
                    if self.world.dimensions == 2 {
                        c.y = 0.0;
                    }
                    if placed.iter().all(|p| p.distance(c) > 2.0 * radius) {
                        placed.push(c);
                    }
                    if draw > 1000 * u64::from(copies.count) + 1000 || !(max - min).cmpge(DVec3::ZERO).all() {
                        let message =
                            format!("`{key}`: only {} of {} copies fit into the box", placed.len(), copies.count);
                        return Err(self.error(&key, message, "enlarge the box, or ask for fewer copies"));
                    }
                }
                let numbered = placed.into_iter().zip(0..);
                Ok(numbered.map(|(c, n)| (c - turned(n) * solid.center, turned(n), Some(n))).collect())
            }
            _ => {
                let message = format!("`{key}` needs either `grid` or `random`");
                Err(self.error(
                    &key,
                    message,
                    "add grid = { columns = [..], step = [..] } or random = { min = .., max = .. }",
                ))
            }
        }
    }

    fn check_inside(&self, body: &NewBody, grid: &Grid, key: &str) -> Result<()> {
        let slack = 0.26 * self.resolution.spacing;
        for p in body.points() {
            for a in 0..3 {
                if self.world.dimensions == 2 && a == 1 || grid.walls[a] == Wall::Periodic {
                    continue;
                }
                if p[a] < grid.min[a] - slack || p[a] > grid.max[a] + slack {
                    let message = format!(
                        "body `{}` reaches {} = {:.4} m, outside the domain [{}, {}]",
                        body.name,
                        ["x", "y", "z"][a],
                        p[a],
                        grid.min[a],
                        grid.max[a]
                    );
                    return Err(self.error(
                        &format!("{key}.position"),
                        message,
                        "move or shrink the body, or enlarge the domain",
                    ));
                }
            }
        }
        Ok(())
    }

    fn static_bodies(
        &self,
        grid: &Grid,
        volume: f64,
        layers: usize,
        warnings: &mut Vec<String>,
    ) -> Result<Vec<NewBody>> {
        let mut all = Vec::new();
        let walls = self.wall_points(grid, layers as i64);
        let mut taken = Near::new(0.5 * self.resolution.spacing);
        if !walls.is_empty() {
            for &p in &walls {
                taken.insert(p);
            }
            all.push(NewBody::fixed("walls".into(), walls));
        }
        for (index, fixed) in self.statics.iter().enumerate() {
            let key = format!("static.{index}");
            let solid = self.solid(&fixed.shape, &format!("{key}.shape"))?;
            warnings.extend(solid.warnings.iter().cloned());
            let name = fixed.name.clone().unwrap_or_else(|| "static".into());
            let turn = axis_angle(fixed.rotation);
            let mut body = NewBody::new(name, &solid, DVec3::from(fixed.position), turn, self.world.dimensions);
            let skin = skin(&solid.points, self.resolution.spacing, layers as i64, self.world.dimensions);
            let inside =
                |p: DVec3| (0..3).all(|a| (f64::from(grid.lower[a])..=f64::from(grid.upper[a])).contains(&p[a]));
            let kept = skin.into_iter().map(|k| body.offset[k]).filter(|&o| {
                let p = body.x + body.q * o;
                inside(p) && !taken.has(p, None)
            });
            body.offset = kept.collect();
            body.mass = f64::INFINITY;
            body.inverse_inertia = DMat3::ZERO;
            if body.offset.is_empty() {
                warnings.push(format!("static body `{}` has no part in the domain", body.name));
            }
            for p in body.points() {
                taken.insert(p);
            }
            all.push(body);
        }
        // E1: a particle's volume is 1 / sum W over the static particles around (Akinci et al. 2012, eq. 4), but never
        // more than its place in a full lattice, for behind the skin the body goes on
        let support = self.solver.support * self.resolution.spacing;
        let kernel = self.solver.kernel.density();
        let mut near = Near::new(support);
        for body in &all {
            for p in body.points() {
                near.insert(p);
            }
        }
        for body in &mut all {
            let full = kernel.lattice_sum(self.solver.support, self.world.dimensions);
            let sum = |p: DVec3| near.sum(p, |r| kernel.value(r, support, self.world.dimensions)) / full;
            body.particle_volume = body.points().map(|p| volume.min(1.0 / sum(p))).collect();
        }
        Ok(all)
    }

    /// Particles of the domain's solid walls: `layers` deep, on the lattice that continues the domain.
    fn wall_points(&self, grid: &Grid, layers: i64) -> Vec<DVec3> {
        let dx = self.resolution.spacing;
        let axis = |a: usize| -> Vec<(f64, bool)> {
            if self.world.dimensions == 2 && a == 1 {
                return vec![(0.0, false)];
            }
            let (min, max) = (grid.min[a], grid.max[a]);
            let n = ((max - min) / dx).round().max(1.0);
            let step = (max - min) / n;
            let inner = (0..n as i64).map(|i| (min + (i as f64 + 0.5) * step, false));
            if grid.walls[a] != Wall::Solid {
                return inner.collect();
            }
            let below = (0..layers).rev().map(|i| (min - (i as f64 + 0.5) * dx, true));
            let above = (0..layers).map(|i| (max + (i as f64 + 0.5) * dx, true));
            below.chain(inner).chain(above).collect()
        };
        let (xs, ys, zs) = (axis(0), axis(1), axis(2));
        let mut points = Vec::new();
        for z in &zs {
            for y in &ys {
                for x in &xs {
                    if x.1 || y.1 || z.1 {
                        points.push(DVec3::new(x.0, y.0, z.0));
                    }
                }
            }
        }
        points
    }

    /// Constants, and the fluid: place, velocity, index of its fluid.
    fn derive(
        &self,
        grid: Grid,
        volume: f64,
        support: f64,
        bodies: &[NewBody],
        mut carver: Near,
        warnings: &mut Vec<String>,
    ) -> Result<(Model, Vec<(DVec3, DVec3, u32)>)> {
        let gravity = DVec3::from(self.world.gravity);
        let spacing = self.resolution.spacing;
        let mut fluid: Vec<(DVec3, DVec3, u32)> = Vec::new();
        let (mut carved, mut outside) = (0, 0);
        for (index, f) in self.fluid.iter().enumerate() {
            let key = format!("fluid.{index}.shape");
            let solid = self.solid(&f.shape, &key)?;
            warnings.extend(solid.warnings.iter().cloned());
            let before = fluid.len();
            for p in solid.points {
                let within = (0..3)
                    .all(|a| self.world.dimensions == 2 && a == 1 || (p[a] >= grid.min[a] && p[a] <= grid.max[a]));
                if !within {
                    outside += 1;
                } else if carver.has(p, None) {
                    carved += 1;
                } else {
                    let mut v = DVec3::from(f.velocity);
                    if self.world.dimensions == 2 {
                        v.y = 0.0;
                    }
                    fluid.push((p, v, index as u32));
                }
            }
            if fluid.len() == before {
                let message = format!("`{key}` holds no particle inside the domain that no body or other fluid takes");
                return Err(self.error(&key, message, "move or enlarge the shape, or choose a smaller spacing"));
            }
            for (p, ..) in &fluid[before..] {
                carver.insert(*p);
            }
        }
        if carved > 0 {
            warnings.push(format!("{carved} fluid particles were carved away where bodies or other fluids stand"));
        }
        if outside > 0 {
            warnings.push(format!("{outside} fluid particles outside the domain were left out"));
        }

        let largest_speed = self.largest_speed(&fluid, bodies, gravity, &grid);
        let sound_speed = self.solver.sound_speed.unwrap_or(10.0 * largest_speed);
        self.squeeze(&mut fluid, gravity, sound_speed);
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
            })
            .collect();
        let contacts = bodies
            .iter()
            .map(|b| ContactModel {
                inverse_mass: (1.0 / b.mass) as f32,
                ln_restitution: b.restitution.ln() as f32,
                // a body of n particles rests on about n^(1/3) of them
                shared_by: if b.mass.is_infinite() { 1.0 } else { (b.offset.len() as f64).cbrt() as f32 },
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
            contacts,
            largest_speed,
            sound_speed,
            gravity,
            fields: self.force.clone(),
            grid,
            contact_diameter: self.solver.contact_diameter * spacing,
            solver: self.solver.clone(),
            dt_bounds: Vec::new(),
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

    /// Largest speed the scene can reach (m/s): from depth, drop height and velocities given.
    fn largest_speed(&self, fluid: &[(DVec3, DVec3, u32)], bodies: &[NewBody], gravity: DVec3, grid: &Grid) -> f64 {
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
            let lowest_fluid = fluid.iter().map(|f| height(f.0)).fold(f64::INFINITY, f64::min);
            let top = fluid.iter().map(|f| height(f.0)).fold(f64::NEG_INFINITY, f64::max);
            let floor = if bodies.iter().any(|b| b.mass.is_infinite()) { height(corner(false)) } else { lowest_fluid };
            if top.is_finite() {
                speed = (2.0 * g * (top - floor).max(0.0)).sqrt();
            }
            // bodies fall onto the fluid, or onto the floor where there is none
            let ground = if top.is_finite() { top } else { height(corner(false)) };
            for body in bodies.iter().filter(|b| b.mass.is_finite()) {
                let drop = (height(body.x) - ground).max(0.0);
                speed = speed.max((2.0 * g * drop + body.v.length_squared()).sqrt());
            }
        }
        for f in &self.fluid {
            speed = speed.max(DVec3::from(f.velocity).length());
        }
        for body in bodies {
            let reach = body.offset.iter().map(|o| o.length()).fold(0.0, f64::max);
            speed = speed.max(body.v.length() + body.spin.length() * reach * f64::from(body.mass.is_finite() as u8));
        }
        // a scene in which nothing moves still needs a scale: a spacing in a tenth of a second
        if speed > 0.0 { speed } else { 10.0 * self.resolution.spacing }
    }

    /// Squeezes fluids that start hydrostatic: the equation of state then holds up what stands above.
    fn squeeze(&self, fluid: &mut [(DVec3, DVec3, u32)], gravity: DVec3, sound_speed: f64) {
        let g = gravity.length();
        if g == 0.0 {
            return;
        }
        let up = -gravity / g;
        for (index, f) in self.fluid.iter().enumerate() {
            if f.start != Start::Hydrostatic {
                continue;
            }
            let own = || fluid.iter().filter(|p| p.2 == index as u32).map(|p| p.0.dot(up));
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
            for p in fluid.iter_mut().filter(|p| p.2 == index as u32) {
                let y = p.0.dot(up) - bottom;
                p.0 += (squeezed(y) - y) * up;
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
        let mut contact = f64::INFINITY;
        for a in 0..model.contacts.len() {
            contact = contact.min(model.contact_time(a) / 20.0);
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
        if let Some(dt) = s.dt {
            // a stated step is the step: it replaces what is derived
            bounds.clear();
            bounds.push((DtBound::Scene, dt));
        }
        bounds
    }
}

/// A body on its way into the state.
struct NewBody {
    name: String,
    offset: Vec<DVec3>,
    particle_volume: Vec<f64>,
    x: DVec3,
    q: DQuat,
    v: DVec3,
    spin: DVec3,
    mass: f64,
    inverse_inertia: DMat3,
    restitution: f64,
    stiffness: Option<f64>,
    damping: Option<f64>,
    mesh: Option<(Arc<Mesh>, DVec3)>,
}

impl NewBody {
    fn new(name: String, solid: &Solid, place: DVec3, turn: DQuat, dimensions: u32) -> Self {
        let turn = if dimensions == 2 {
            // keep the part of the rotation that stays in the plane
            let (axis, angle) = turn.to_axis_angle();
            DQuat::from_rotation_y(angle * axis.y)
        } else {
            turn
        };
        let mut x = place + turn * solid.center;
        if dimensions == 2 {
            x.y = 0.0;
        }
        Self {
            name,
            offset: solid.points.iter().map(|p| *p - solid.center).collect(),
            particle_volume: Vec::new(),
            x,
            q: turn,
            v: DVec3::ZERO,
            spin: DVec3::ZERO,
            mass: f64::INFINITY,
            inverse_inertia: DMat3::ZERO,
            restitution: 1.0,
            stiffness: None,
            damping: None,
            mesh: solid.mesh.clone().map(|m| (m, solid.center)),
        }
    }

    fn fixed(name: String, points: Vec<DVec3>) -> Self {
        Self {
            name,
            offset: points,
            particle_volume: Vec::new(),
            x: DVec3::ZERO,
            q: DQuat::IDENTITY,
            v: DVec3::ZERO,
            spin: DVec3::ZERO,
            mass: f64::INFINITY,
            inverse_inertia: DMat3::ZERO,
            restitution: 1.0,
            stiffness: None,
            damping: None,
            mesh: None,
        }
    }

    fn points(&self) -> impl Iterator<Item = DVec3> + '_ {
        self.offset.iter().map(|o| self.x + self.q * *o)
    }
}

/// Rotation from axis x, y, z and degrees.
fn axis_angle([x, y, z, degrees]: [f64; 4]) -> DQuat {
    match DVec3::new(x, y, z).try_normalize() {
        Some(axis) => DQuat::from_axis_angle(axis, degrees.to_radians()),
        None => DQuat::IDENTITY,
    }
}

/// Indices of the points of a lattice that have an empty place within `depth` steps: what a fluid outside can see.
fn skin(points: &[DVec3], dx: f64, depth: i64, dimensions: u32) -> Vec<usize> {
    let Some(&origin) = points.first() else { return vec![] };
    let key = |p: DVec3| ((p - origin) / dx).round().as_i64vec3().to_array();
    let full: std::collections::HashSet<[i64; 3]> = points.iter().map(|&p| key(p)).collect();
    let deep_y = if dimensions == 2 { 0 } else { depth };
    let visible = |p: DVec3| {
        let c = key(p);
        for k in -depth..=depth {
            for j in -deep_y..=deep_y {
                for i in -depth..=depth {
                    if !full.contains(&[c[0] + i, c[1] + j, c[2] + k]) {
                        return true;
                    }
                }
            }
        }
        false
    };
    (0..points.len()).filter(|&k| visible(points[k])).collect()
}

fn warn_of_overlap(bodies: &[NewBody], spacing: f64, warnings: &mut Vec<String>) {
    let mut near = Near::new(0.5 * spacing);
    for (index, body) in bodies.iter().enumerate() {
        if body.mass.is_infinite() {
            continue;
        }
        for p in body.points() {
            near.insert_tagged(p, index as u32);
        }
    }
    for (index, body) in bodies.iter().enumerate() {
        let deep = body.points().filter(|&p| near.has(p, Some(index as u32))).count();
        if deep > 0 {
            warnings.push(format!(
                "body `{}` overlaps another by {deep} particles: contacts will push them apart",
                body.name
            ));
        }
    }
}

/// Points found by place: for the beginning of a run only.
struct Near {
    radius: f64,
    cells: HashMap<[i64; 3], Vec<(DVec3, u32)>>,
}

impl Near {
    fn new(radius: f64) -> Self {
        Self { radius, cells: HashMap::new() }
    }

    fn key(&self, p: DVec3) -> [i64; 3] {
        (p / self.radius).floor().as_i64vec3().to_array()
    }

    fn insert(&mut self, p: DVec3) {
        self.insert_tagged(p, 0);
    }

    fn insert_tagged(&mut self, p: DVec3, tag: u32) {
        self.cells.entry(self.key(p)).or_default().push((p, tag));
    }

    /// Whether a point is closer than the radius; `except` skips points of that tag.
    fn has(&self, p: DVec3, except: Option<u32>) -> bool {
        let mut found = false;
        self.each(p, |r, tag| found |= r < self.radius && except != Some(tag));
        found
    }

    /// Sum of a function of the distance over the points within the radius, in order of insertion.
    fn sum(&self, p: DVec3, f: impl Fn(f64) -> f64) -> f64 {
        let mut total = 0.0;
        self.each(p, |r, _| {
            if r < self.radius {
                total += f(r);
            }
        });
        total
    }

    fn each(&self, p: DVec3, mut f: impl FnMut(f64, u32)) {
        let c = self.key(p);
        for k in -1..=1 {
            for j in -1..=1 {
                for i in -1..=1 {
                    for &(q, tag) in self.cells.get(&[c[0] + i, c[1] + j, c[2] + k]).into_iter().flatten() {
                        f(p.distance(q), tag);
                    }
                }
            }
        }
    }
}

/// Puts fluid and bodies into one state.
fn join(fluid: Vec<(DVec3, DVec3, u32)>, new: Vec<NewBody>, rigid_count: usize, model: &Model) -> State {
    let mut bodies = Bodies::default();
    for (index, b) in new.into_iter().enumerate() {
        let slots = bodies.offset.len()..bodies.offset.len() + b.offset.len();
        let mut body = Body {
            name: b.name,
            mass: b.mass,
            inverse_inertia: b.inverse_inertia,
            slots,
            ln_restitution: b.restitution.ln(),
            stiffness: b.stiffness,
            damping: b.damping,
            x: b.x,
            v: b.v,
            v_half: b.v,
            q: b.q,
            l: DVec3::ZERO,
            l_half: DVec3::ZERO,
            omega: b.spin,
            force: DVec3::ZERO,
            torque: DVec3::ZERO,
        };
        if b.mass.is_finite() {
            let inertia_world = if model.dimensions == 2 {
                DMat3::from_diagonal(DVec3::Y / b.inverse_inertia.y_axis.y)
            } else {
                body.inverse_inertia_at(body.q).inverse()
            };
            body.l = inertia_world * b.spin;
            body.l_half = body.l;
        }
        for (offset, volume) in b.offset.into_iter().zip(b.particle_volume) {
            let mut record = Record { volume: volume as f32, ..Record::default() };
            crate::integrate::bodies::place(&mut record, &body, offset, model);
            bodies.offset.push(offset);
            bodies.owner.push(index as u32);
            bodies.record.push(record);
        }
        bodies.body.push(body);
        if index + 1 == rigid_count {
            bodies.rigid_slots = bodies.offset.len();
        }
    }
    let n = fluid.len();
    let total = n + bodies.record.len();
    let mut p = Particles {
        record: Vec::with_capacity(total),
        push: vec![[0.0; 3]; total],
        push_before: vec![[0.0; 3]; n],
        density: vec![1.0; n],
        carry: if model.solver.xsph > 0.0 { vec![[0.0; 3]; n] } else { Vec::new() },
        id: (0..n as u32).chain(0..bodies.record.len() as u32).collect(),
        owner: fluid.iter().map(|f| f.2).chain(bodies.owner.iter().copied()).collect(),
        first: [0, n, n + bodies.rigid_slots],
        count: [n, bodies.rigid_slots, bodies.record.len() - bodies.rigid_slots],
    };
    for (x, v, _) in fluid {
        let (mut x, v) = (x.as_vec3().to_array(), v.as_vec3().to_array());
        model.grid.wrap(&mut x);
        p.record.push(Record { x, volume: model.volume as f32, v, share: 0.0 });
    }
    p.record.extend_from_slice(&bodies.record);
    debug_assert_eq!(p.len(), p.segment(Kind::Static).end);
    State { particles: p, bodies }
}

/// Memory left on this machine (GB); infinite where the system does not say.
fn available_gigabytes() -> f64 {
    let text = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let line = text.lines().find_map(|l| l.strip_prefix("MemAvailable:"));
    let kilobytes = line.and_then(|l| l.trim().trim_end_matches(" kB").trim().parse::<f64>().ok());
    kilobytes.map_or(f64::INFINITY, |k| k * 1024.0 / 1e9)
}

/// Whether so many bytes can be had; else what is needed and what there is, in GB.
fn check_available(bytes: f64) -> std::result::Result<(), (f64, f64)> {
    let have = available_gigabytes();
    if bytes / 1e9 <= 0.9 * have { Ok(()) } else { Err((bytes / 1e9, have)) }
}
