//! Rigid and static bodies: shapes placed, copied, checked; walls of the domain; skins of static bodies.

use super::memory::{BYTES_PER_PARTICLE, check_available};
use super::near::Near;
use super::surface::normals;
use crate::error::Result;
use crate::interact::cells::Grid;
use crate::mesh::Mesh;
use crate::random;
use crate::scene::motion::{Motion, Path};
use crate::scene::solid::Solid;
use crate::scene::{Rigid, Scene, Wall, axis_angle};
use glam::{DMat3, DQuat, DVec3};
use std::sync::Arc;

impl Scene {
    pub(super) fn rigid_bodies(&self, grid: &Grid, volume: f64, warnings: &mut Vec<String>) -> Result<Vec<NewBody>> {
        let mut all = Vec::new();
        let dx = self.resolution.spacing;
        for (index, rigid) in self.rigid.iter().enumerate() {
            let key = format!("rigid.{index}");
            let solid = self.body_solid(&rigid.shape, rigid.fill, &key)?;
            warnings.extend(solid.warnings.iter().cloned());
            let normals = normals(&solid, dx, self.world.dimensions);
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
                body.normal = normals.clone();
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
                body.friction = Some(rigid.friction);
                body.one_way = rigid.one_way;
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

    pub(super) fn static_bodies(
        &self,
        grid: &Grid,
        volume: f64,
        layers: usize,
        warnings: &mut Vec<String>,
    ) -> Result<Vec<NewBody>> {
        let mut all = Vec::new();
        // flocks alone are held by the sides themselves
        let flocks_only = self.fluid.is_empty() && self.rigid.is_empty();
        let (walls, facing) =
            if flocks_only { (Vec::new(), Vec::new()) } else { self.wall_points(grid, layers as i64) };
        let mut taken = Near::new(0.5 * self.resolution.spacing);
        if !walls.is_empty() {
            for &p in &walls {
                taken.insert(p);
            }
            all.push(NewBody { normal: facing, ..NewBody::fixed("walls".into(), walls) });
        }
        for (index, fixed) in self.statics.iter().enumerate() {
            let key = format!("static.{index}");
            let solid = self.body_solid(&fixed.shape, fixed.fill, &key)?;
            warnings.extend(solid.warnings.iter().cloned());
            let name = fixed.name.clone().unwrap_or_else(|| "static".into());
            let turn = axis_angle(fixed.rotation);
            let mut body = NewBody::new(name, &solid, DVec3::from(fixed.position), turn, self.world.dimensions);
            let skin = skin(&solid, self.resolution.spacing, layers as i64, self.world.dimensions);
            let normals = normals(&solid, self.resolution.spacing, self.world.dimensions);
            self.check_motion(&fixed.motion, &format!("{key}.motion"))?;
            let moves = fixed.motion != Motion::None;
            let inside =
                |p: DVec3| (0..3).all(|a| (f64::from(grid.lower[a])..=f64::from(grid.upper[a])).contains(&p[a]));
            let kept: Vec<usize> = skin
                .into_iter()
                .filter(|&k| {
                    let p = body.x + body.q * body.offset[k];
                    moves || (inside(p) && !taken.has(p, None))
                })
                .collect();
            body.normal = kept.iter().map(|&k| normals[k]).collect();
            body.core = body.offset.clone();
            body.offset = kept.iter().map(|&k| body.offset[k]).collect();
            body.friction = fixed.friction;
            if body.offset.is_empty() {
                warnings.push(format!("static body `{}` has no part in the domain", body.name));
            }
            if moves {
                let path = Path::new(fixed.motion.clone(), body.x, body.q, solid.center);
                let pose = path.at(0.0);
                (body.x, body.q, body.v, body.spin, body.path) = (pose.x, pose.q, pose.v, pose.omega, Some(path));
            } else {
                for p in body.points() {
                    taken.insert(p);
                }
            }
            all.push(body);
        }
        // those that move stand with the rigid bodies
        all.sort_by_key(|b| b.path.is_none());
        // E1: a particle's volume is 1 / sum W over the static particles around (Akinci et al. 2012, eq. 4), but never
        // more than its place in a full lattice, for behind the skin the body goes on
        let support = self.solver.support * self.resolution.spacing;
        let kernel = self.solver.kernel.density();
        let still = all.iter().filter(|b| b.path.is_none());
        let together = Near::of(support, still.flat_map(NewBody::points));
        for body in &mut all {
            let alone;
            let near = if body.path.is_some() {
                alone = Near::of(support, body.points());
                &alone
            } else {
                &together
            };
            let full = kernel.lattice_sum(self.solver.support, self.world.dimensions);
            let sum = |p: DVec3| near.sum(p, |r| kernel.value(r, support, self.world.dimensions)) / full;
            body.particle_volume = body.points().map(|p| volume.min(1.0 / sum(p))).collect();
        }
        Ok(all)
    }

    /// Particles of the domain's solid walls: `layers` deep, on the lattice that continues the domain; and their normals.
    fn wall_points(&self, grid: &Grid, layers: i64) -> (Vec<DVec3>, Vec<[f32; 3]>) {
        let dx = self.resolution.spacing;
        // place on an axis, and layer: -1, 1 look inwards, deeper ones count on
        let axis = |a: usize| -> Vec<(f64, f64)> {
            if self.world.dimensions == 2 && a == 1 {
                return vec![(0.0, 0.0)];
            }
            let (min, max) = (grid.min[a], grid.max[a]);
            let n = ((max - min) / dx).round().max(1.0);
            let step = (max - min) / n;
            let inner = (0..n as i64).map(|i| (min + (i as f64 + 0.5) * step, 0.0));
            if grid.walls[a] != Wall::Solid {
                return inner.collect();
            }
            let below = (0..layers).rev().map(|i| (min - (i as f64 + 0.5) * dx, i as f64 + 1.0));
            let above = (0..layers).map(|i| (max + (i as f64 + 0.5) * dx, -1.0 - i as f64));
            below.chain(inner).chain(above).collect()
        };
        let (xs, ys, zs) = (axis(0), axis(1), axis(2));
        let (mut points, mut facing) = (Vec::new(), Vec::new());
        for z in &zs {
            for y in &ys {
                for x in &xs {
                    let layer = DVec3::new(x.1, y.1, z.1);
                    if layer != DVec3::ZERO {
                        points.push(DVec3::new(x.0, y.0, z.0));
                        let face = layer.length_squared() == 1.0;
                        facing.push(if face { layer.as_vec3().to_array() } else { [0.0; 3] });
                    }
                }
            }
        }
        (points, facing)
    }
}

/// A body on its way into the state.
pub(super) struct NewBody {
    pub(super) name: String,
    pub(super) offset: Vec<DVec3>,
    /// Particles of the whole shape, where `offset` is its skin alone: no fluid begins inside.
    pub(super) core: Vec<DVec3>,
    pub(super) particle_volume: Vec<f64>,
    pub(super) x: DVec3,
    pub(super) q: DQuat,
    pub(super) v: DVec3,
    pub(super) spin: DVec3,
    pub(super) mass: f64,
    pub(super) inverse_inertia: DMat3,
    pub(super) restitution: f64,
    pub(super) stiffness: Option<f64>,
    pub(super) damping: Option<f64>,
    pub(super) friction: Option<f64>,
    pub(super) one_way: bool,
    /// Outward normal of each particle, as [`crate::state::Bodies::normal`].
    pub(super) normal: Vec<[f32; 3]>,
    pub(super) path: Option<Path>,
    pub(super) mesh: Option<(Arc<Mesh>, DVec3)>,
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
        let offset = solid.points.iter().map(|p| *p - solid.center).collect();
        let mesh = solid.mesh.clone().map(|m| (m, solid.center));
        Self { x, q: turn, mesh, ..Self::fixed(name, offset) }
    }

    fn fixed(name: String, points: Vec<DVec3>) -> Self {
        Self {
            name,
            offset: points,
            core: Vec::new(),
            particle_volume: Vec::new(),
            x: DVec3::ZERO,
            q: DQuat::IDENTITY,
            v: DVec3::ZERO,
            spin: DVec3::ZERO,
            mass: f64::INFINITY,
            inverse_inertia: DMat3::ZERO,
            restitution: crate::params::default::rigid_restitution(),
            stiffness: None,
            damping: None,
            friction: None,
            one_way: false,
            normal: Vec::new(),
            path: None,
            mesh: None,
        }
    }

    pub(super) fn points(&self) -> impl Iterator<Item = DVec3> + '_ {
        self.offset.iter().map(|o| self.x + self.q * *o)
    }

    /// Where no fluid can begin: the particles, and what stands behind the skin.
    pub(super) fn takes(&self) -> impl Iterator<Item = DVec3> + '_ {
        self.points().chain(self.core.iter().map(|o| self.x + self.q * *o))
    }
}

/// Indices of the points of a lattice that have an empty place within `depth` steps: what a fluid outside can see. Of shells, all.
fn skin(solid: &Solid, dx: f64, depth: i64, dimensions: u32) -> Vec<usize> {
    let points = &solid.points;
    if solid.shells {
        return (0..points.len()).collect();
    }
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
