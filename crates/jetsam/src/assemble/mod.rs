//! From a scene to constants and a state: shapes are filled, bodies placed, walls built, numbers derived.
//!
//! Everything that can be wrong with a scene as a whole is found here: bodies outside the domain, periodic axes
//! too short, more memory than there is. What is repaired (fluid carved where bodies stand) is said in the
//! model's warnings.

mod bodies;
mod flocks;
mod fluid;
mod memory;
mod near;
mod relax;
mod sources;
mod start;
mod surface;

use crate::error::Result;
use crate::interact::cells::Grid;
use crate::mesh::Mesh;
use crate::model::{CONTACT_REACH, CONTACT_SKIN, Model};
use crate::scene::{Density, Force, Scene, Shape, Wall};
use crate::state::{Bodies, Body, Particles, Record, State, Touch};
use bodies::NewBody;
use fluid::Drop;
use glam::{DMat3, DVec3};
use memory::{BYTES_PER_CELL, BYTES_PER_PARTICLE, available_gigabytes, check_available};
use near::Near;
use relax::relax;
use std::sync::Arc;

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
        let contacts = (CONTACT_REACH + CONTACT_SKIN) * self.solver.contact_diameter * spacing;
        let grid = self.grid(support.max(contacts), layers * spacing);
        self.check_memory(&grid)?;

        let mut bodies = self.rigid_bodies(&grid, volume, &mut warnings)?;
        bodies.extend(self.static_bodies(&grid, volume, layers as usize, &mut warnings)?);
        let rigid_count = bodies.iter().filter(|b| b.mass.is_finite() || b.path.is_some()).count();
        let named: Vec<_> = bodies.iter().map(|b| (b.name.as_str(), b.x, b.q, b.mass.is_finite())).collect();
        let mut joints = self.joints(&named)?;
        let gravity = DVec3::from(self.world.gravity);
        let up = (-gravity).try_normalize().unwrap_or(DVec3::Z);
        let diameter = self.solver.contact_diameter * spacing;
        relax(&mut bodies, &joints, diameter, dimensions, up, &mut warnings);
        if !joints.is_empty() {
            let named: Vec<_> = bodies.iter().map(|b| (b.name.as_str(), b.x, b.q, b.mass.is_finite())).collect();
            joints = self.joints(&named)?;
        }
        let mut carver = Near::new(CARVE * spacing);
        for body in &bodies {
            for p in body.takes() {
                carver.insert(p);
            }
        }
        let flocks = self.flock_constants()?;
        let agents = self.agents(&flocks, &grid, &self.obstacles(&flocks, &bodies))?;
        let (mut model, fluid) = self.derive(grid, volume, support, &bodies, joints, carver, &mut warnings)?;
        model.add_flocks(flocks);
        model.warnings = warnings;
        let meshes = bodies.iter().map(|b| b.mesh.clone()).collect();
        let state = State { agents, ..join(fluid, bodies, rigid_count, &model) };
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
        for (index, force) in self.force.iter().enumerate() {
            if let Force::Shake(shake) = force {
                self.check_period(shake.period, &format!("force.{index}.shake"))?;
            }
        }
        if self.fluid.is_empty() && self.rigid.is_empty() && self.flock.is_empty() {
            return Err(self.error(
                "",
                "the scene has neither fluid nor rigid bodies nor flocks",
                "add a [[fluid]], a [[rigid]] or a [[flock]]",
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

    fn grid(&self, width: f64, wall: f64) -> Grid {
        let (min, max) = (DVec3::from(self.domain.min), DVec3::from(self.domain.max));
        Grid::new(min, max, self.domain.walls, self.world.dimensions, width, wall)
    }

    fn check_memory(&self, grid: &Grid) -> Result<()> {
        let cells: f64 = grid.cells.iter().map(|&c| f64::from(c)).product();
        let flat = self.world.dimensions == 2;
        let reach = |shape: &Shape| match shape {
            Shape::Box(r) => {
                let s = DVec3::from(r.max) - DVec3::from(r.min);
                s.x * s.z * if flat { 1.0 } else { s.y }
            }
            _ => 0.0,
        };
        let cell = self.resolution.spacing.powi(self.world.dimensions as i32);
        let volume: f64 = self.fluid.iter().filter_map(|f| f.shape.as_ref()).map(|s| reach(s).max(0.0)).sum();
        let particles = volume / cell;
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
}

/// Puts fluid and bodies into one state.
fn join(fluid: Vec<Drop>, new: Vec<NewBody>, rigid_count: usize, model: &Model) -> State {
    let mut bodies = Bodies::default();
    for (index, b) in new.into_iter().enumerate() {
        let slots = bodies.offset.len()..bodies.offset.len() + b.offset.len();
        let mut body = Body {
            name: b.name,
            mass: b.mass,
            inverse_inertia: b.inverse_inertia,
            slots,
            x: b.x,
            v: b.v,
            v_half: b.v,
            q: b.q,
            l: DVec3::ZERO,
            l_half: DVec3::ZERO,
            omega: b.spin,
            force: DVec3::ZERO,
            torque: DVec3::ZERO,
            force_fluid: DVec3::ZERO,
            force_contact: DVec3::ZERO,
            torque_fluid: DVec3::ZERO,
            torque_contact: DVec3::ZERO,
            contacts: 0,
            sharers: 0.0,
            still: 0.0,
            asleep: false,
            deep: false,
            one_way: b.one_way,
            acceleration: DVec3::ZERO,
            angular_acceleration: DVec3::ZERO,
        };
        if let Some(path) = &b.path {
            crate::integrate::bodies::script(&mut body, path, 0.0);
        }
        if b.mass.is_finite() {
            let inertia_world = if model.dimensions == 2 {
                DMat3::from_diagonal(DVec3::Y / b.inverse_inertia.y_axis.y)
            } else {
                body.inverse_inertia_at(body.q).inverse()
            };
            body.l = inertia_world * b.spin;
            body.l_half = body.l;
        }
        let frame = crate::integrate::bodies::Frame::of(&body);
        for ((offset, volume), normal) in b.offset.into_iter().zip(b.particle_volume).zip(b.normal) {
            let mut record = Record { volume: volume as f32, ..Record::default() };
            frame.place(&mut record, offset, model);
            bodies.offset.push(offset);
            bodies.normal.push(normal);
            bodies.facing.push(frame.face(normal));
            bodies.owner.push(index as u32);
            bodies.record.push(record);
        }
        bodies.body.push(body);
        if index + 1 == rigid_count {
            bodies.rigid_slots = bodies.offset.len();
        }
    }
    let n = fluid.len();
    // the fluid's segment has places for fluid to come
    let room = n + if model.sources.is_empty() { 0 } else { n / 2 + 1024 };
    let total = room + bodies.record.len();
    let continuity = model.solver.density == Density::Continuity;
    let carried = model.integrates_density() || model.solver.xsph > 0.0 || model.solver.shifting > 0.0;
    let mortal = model.fluids.iter().any(|f| f.lifetime.is_finite());
    let mut p = Particles {
        record: vec![Record::default(); total],
        push: vec![[0.0; 3]; total],
        push_before: vec![[0.0; 3]; room],
        density: vec![1.0; room],
        touch: vec![Touch::default(); total - room],
        rate: vec![[0.0; 2]; if continuity { room } else { 0 }],
        carry: vec![[0.0; 4]; if carried { room } else { 0 }],
        gradient: vec![[0.0; 4]; if model.wants_gradients() { room } else { 0 }],
        vorticity: vec![[0.0; 3]; if model.wants_gradients() { room } else { 0 }],
        born: vec![0.0; if mortal { room } else { 0 }],
        id: (0..room as u32).chain(0..bodies.record.len() as u32).collect(),
        owner: vec![0; room].into_iter().chain(bodies.owner.iter().copied()).collect(),
        first: [0, room, room + bodies.rigid_slots],
        count: [n, bodies.rigid_slots, bodies.record.len() - bodies.rigid_slots],
    };
    for (i, drop) in fluid.into_iter().enumerate() {
        let (mut x, v) = (drop.x.as_vec3().to_array(), drop.v.as_vec3().to_array());
        model.grid.wrap(&mut x);
        p.record[i] = Record { x, volume: model.volume as f32, v, share: 0.0 };
        p.density[i] = drop.density as f32;
        if model.remembers_lack() {
            p.rate[i] = [drop.density as f32, 0.0];
        }
        p.owner[i] = drop.fluid;
    }
    p.record[room..].copy_from_slice(&bodies.record);
    State { particles: p, bodies, ..State::default() }
}
