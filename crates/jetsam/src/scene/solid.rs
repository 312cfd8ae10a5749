//! A shape becomes particles with the mass properties of the exact shape (E19).

use super::shells::shells;
use super::{Fill, Region, Scene, Shape};
use crate::error::Result;
use crate::mesh::Mesh;
use crate::voxelize::{Resolution, VoxelizeOptions, voxelize};
use glam::{DAffine3, DMat3, DVec3};
use std::f64::consts::PI;
use std::sync::Arc;

/// A shape as particles, in the shape's own frame.
#[derive(Clone, Debug)]
pub struct Solid {
    /// Places of the particles (m).
    pub points: Vec<DVec3>,
    /// Exact volume (m^3; area in 2D).
    pub volume: f64,
    /// Centre of mass (m).
    pub center: DVec3,
    /// Inertia about the centre of mass for unit density (m^5; in 2D its yy entry is the polar moment, m^4).
    pub inertia: DMat3,
    /// The mesh the shape was given as, scaled.
    pub mesh: Option<Arc<Mesh>>,
    /// Whether the particles stand in shells, not on a lattice.
    pub shells: bool,
    /// What looks doubtful.
    pub warnings: Vec<String>,
}

/// Most particles one shape may have.
const MOST: f64 = 2e8;

impl Scene {
    /// Fills the shape of a body as it asks. `key` is the path of the body in the scene, for messages.
    ///
    /// # Errors
    /// Those of [`Scene::solid`]; shells of a shape that has none.
    pub fn body_solid(&self, shape: &Shape, fill: Fill, key: &str) -> Result<Solid> {
        let solid = self.solid(shape, &format!("{key}.shape"))?;
        if fill == Fill::Lattice || matches!(shape, Shape::Box(_)) {
            return Ok(solid);
        }
        match shells(shape, self.resolution.spacing, self.world.dimensions == 2) {
            Some(points) => Ok(Solid { points, shells: true, ..solid }),
            None => {
                let message = format!("`{key}`: only balls, cylinders and tori can be filled in shells");
                Err(self.error(&format!("{key}.fill"), message, "leave `fill` out: a lattice fills any shape"))
            }
        }
    }

    /// Fills a shape with particles on a lattice. `key` is the shape's path in the scene, for messages.
    ///
    /// # Errors
    /// Extents that are not positive, a mesh that cannot be read or used, too many particles.
    pub fn solid(&self, shape: &Shape, key: &str) -> Result<Solid> {
        let dx = self.resolution.spacing;
        let flat = self.world.dimensions == 2;
        let positive = |name: &str, value: f64| {
            if value > 0.0 {
                return Ok(());
            }
            Err(self.error(key, format!("`{key}`: {name} = {value} is not positive"), format!("give a {name} above 0")))
        };
        let fits = |volume: f64| {
            let count = volume / if flat { dx * dx } else { dx.powi(3) };
            if count <= MOST {
                return Ok(());
            }
            let message = format!("`{key}` needs {count:.2e} particles at a spacing of {dx} m");
            Err(self.error(key, message, "choose a larger [resolution] spacing or a smaller shape"))
        };
        match shape {
            Shape::Box(Region { min, max }) => {
                let (min, max) = (DVec3::from(*min), DVec3::from(*max));
                let mut size = max - min;
                for (a, name) in ["max[0] - min[0]", "max[1] - min[1]", "max[2] - min[2]"].into_iter().enumerate() {
                    if !(flat && a == 1) {
                        positive(name, size[a])?;
                    }
                }
                if flat {
                    size.y = 1.0;
                }
                let volume = size.x * size.y * size.z;
                fits(volume)?;
                let s = size * size / 12.0;
                let inertia = if flat {
                    DMat3::from_diagonal(DVec3::Y * (s.x + s.z)) * volume
                } else {
                    DMat3::from_diagonal(DVec3::new(s.y + s.z, s.x + s.z, s.x + s.y)) * volume
                };
                let mut center = 0.5 * (min + max);
                if flat {
                    center.y = 0.0;
                }
                // a whole number of layers: the lattice is stretched to the box
                let count = (size / dx).round().max(DVec3::ONE);
                let step = size / count;
                let count = count.as_uvec3();
                let mut points = Vec::with_capacity((count.x * count.z) as usize);
                for k in 0..count.z {
                    for j in 0..if flat { 1 } else { count.y } {
                        for i in 0..count.x {
                            let mut p = min + step * (DVec3::new(i.into(), j.into(), k.into()) + 0.5);
                            if flat {
                                p.y = 0.0;
                            }
                            points.push(p);
                        }
                    }
                }
                Ok(Solid { points, volume, center, inertia, mesh: None, shells: false, warnings: vec![] })
            }
            Shape::Sphere { center, radius } => {
                positive("radius", *radius)?;
                let (r, mut center) = (*radius, DVec3::from(*center));
                let (volume, inertia) = if flat {
                    center.y = 0.0;
                    (PI * r * r, DMat3::from_diagonal(DVec3::Y) * (0.5 * PI * r.powi(4)))
                } else {
                    (4.0 / 3.0 * PI * r.powi(3), DMat3::IDENTITY * (8.0 / 15.0 * PI * r.powi(5)))
                };
                fits(volume)?;
                let points = lattice(center, DVec3::splat(r), dx, flat, |p| p.length_squared() < r * r);
                Ok(Solid { points, volume, center, inertia, mesh: None, shells: false, warnings: vec![] })
            }
            Shape::Cylinder { center, axis, radius, height } => {
                positive("radius", *radius)?;
                positive("height", *height)?;
                let axis = DVec3::from(*axis);
                positive("length of the axis", axis.length())?;
                let (axis, r, h, mut center) = (axis.normalize(), *radius, *height, DVec3::from(*center));
                if flat {
                    if axis.y.abs() < 0.999 {
                        let message = format!("`{key}`: in a 2D scene a cylinder's axis must be y");
                        return Err(self.error(key, message, "give axis = [0, 1, 0], or use a box"));
                    }
                    center.y = 0.0;
                    let volume = PI * r * r;
                    fits(volume)?;
                    let inertia = DMat3::from_diagonal(DVec3::Y) * (0.5 * PI * r.powi(4));
                    let points = lattice(center, DVec3::splat(r), dx, true, |p| p.length_squared() < r * r);
                    return Ok(Solid { points, volume, center, inertia, mesh: None, shells: false, warnings: vec![] });
                }
                let volume = PI * r * r * h;
                fits(volume)?;
                let (along, across) = (0.5 * r * r * volume, (r * r / 4.0 + h * h / 12.0) * volume);
                let outer = DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
                let inertia = DMat3::IDENTITY * across + outer * (along - across);
                let reach = DVec3::splat(r.hypot(0.5 * h));
                let points = lattice(center, reach, dx, false, |p| {
                    let z = p.dot(axis);
                    z.abs() < 0.5 * h && (p - axis * z).length_squared() < r * r
                });
                Ok(Solid { points, volume, center, inertia, mesh: None, shells: false, warnings: vec![] })
            }
            Shape::Torus { center, axis, radius, tube } => {
                let (axis, center) = (DVec3::from(*axis), DVec3::from(*center));
                positive("length of the axis", axis.length())?;
                positive("tube", *tube)?;
                positive("radius - tube", radius - tube)?;
                if flat {
                    let message = format!("`{key}`: a torus needs a 3D scene");
                    return Err(self.error(key, message, "set [world] dimensions = 3, or use a sphere"));
                }
                let (axis, big, small) = (axis.normalize(), *radius, *tube);
                let volume = 2.0 * PI * PI * big * small * small;
                fits(volume)?;
                let along = volume * (big * big + 0.75 * small * small);
                let across = volume * (0.5 * big * big + 0.625 * small * small);
                let outer = DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
                let inertia = DMat3::IDENTITY * across + outer * (along - across);
                let points = lattice(center, DVec3::splat(big + small), dx, false, |p| {
                    let z = p.dot(axis);
                    ((p - axis * z).length() - big).hypot(z) < small
                });
                Ok(Solid { points, volume, center, inertia, mesh: None, shells: false, warnings: vec![] })
            }
            Shape::Mesh { path, scale } => self.mesh_solid(path, *scale, key),
            Shape::Difference { from, cut } => self.difference(from, cut, key),
            Shape::Points(points) => {
                if points.is_empty() {
                    return Err(self.error(key, format!("`{key}` has no points"), "give at least one"));
                }
                let points: Vec<DVec3> =
                    points.iter().map(|&p| if flat { DVec3::new(p[0], 0.0, p[2]) } else { DVec3::from(p) }).collect();
                let cell = if flat { dx * dx } else { dx.powi(3) };
                let n = points.len() as f64;
                let center = points.iter().sum::<DVec3>() / n;
                // point masses, each with the inertia of its own cell
                let own = DMat3::IDENTITY * (dx * dx / 6.0);
                let each = |p: &DVec3| {
                    let d = *p - center;
                    let outer = DMat3::from_cols(d * d.x, d * d.y, d * d.z);
                    own + DMat3::IDENTITY * d.length_squared() - outer
                };
                let mut inertia = points.iter().map(each).fold(DMat3::ZERO, |s, i| s + i) * cell;
                if flat {
                    inertia = DMat3::from_diagonal(DVec3::Y * inertia.y_axis.y);
                }
                Ok(Solid { points, volume: n * cell, center, inertia, mesh: None, shells: false, warnings: vec![] })
            }
        }
    }

    /// A shape less others. Mass properties come from the particles that are left, with the cells of the whole.
    fn difference(&self, from: &Shape, cut: &[Shape], key: &str) -> Result<Solid> {
        let whole = self.solid(from, &format!("{key}.difference.from"))?;
        for (index, shape) in cut.iter().enumerate() {
            if !shape.is_plain() {
                let message = format!("`{key}`: a torus, a mesh or points cannot be cut out");
                return Err(self.error(
                    &format!("{key}.difference.cut.{index}"),
                    message,
                    "cut boxes, balls, cylinders, or differences of these",
                ));
            }
        }
        let flat = self.world.dimensions == 2;
        let all = whole.points.len() as f64;
        let left = whole.points.into_iter().filter(|&p| !cut.iter().any(|c| c.contains(p, flat)));
        let points: Vec<[f64; 3]> = left.map(|p| p.to_array()).collect();
        if points.is_empty() {
            let message = format!("`{key}`: nothing is left of the shape");
            return Err(self.error(key, message, "cut less, or choose a smaller [resolution] spacing"));
        }
        let share = points.len() as f64 / all;
        let mut solid = self.solid(&Shape::Points(points), key)?;
        let scale = whole.volume * share / solid.volume;
        (solid.volume, solid.inertia) = (solid.volume * scale, solid.inertia * scale);
        solid.warnings = whole.warnings;
        Ok(solid)
    }

    fn mesh_solid(&self, path: &str, scale: f64, key: &str) -> Result<Solid> {
        if self.world.dimensions == 2 {
            let message = format!("`{key}`: a mesh needs a 3D scene");
            return Err(self.error(key, message, "set [world] dimensions = 3, or use a box or a sphere"));
        }
        if !(scale > 0.0 && scale.is_finite()) {
            return Err(self.error(key, format!("`{key}`: scale = {scale} is not positive"), "give a scale above 0"));
        }
        let mesh = self.load_mesh(path, key)?.transformed(DAffine3::from_scale(DVec3::splat(scale)));
        let dx = self.resolution.spacing;
        let options =
            VoxelizeOptions { resolution: Resolution::Spacing(dx), max_cells: 1 << 32, ..VoxelizeOptions::default() };
        let voxels = voxelize(&mesh, &options).map_err(|e| {
            self.error(key, format!("`{key}` ({path}): {e}"), "choose another [resolution] spacing or scale")
        })?;
        if voxels.is_empty() {
            let message = format!("`{key}` ({path}) is smaller than one particle of {dx} m");
            return Err(self.error(key, message, "choose a smaller [resolution] spacing or a larger scale"));
        }
        let points = voxels.points();
        let r = &voxels.report;
        let mut warnings: Vec<String> = r.warnings.iter().map(|w| format!("{key} ({path}): {w}")).collect();
        let m = mesh.mass_properties();
        let (mut volume, mut center, mut inertia) = (m.volume, m.com, m.inertia);
        if !(r.watertight && m.volume > 0.0) {
            // an open surface encloses nothing exactly: the particles say what the solid is
            warnings.push(format!("{key} ({path}): the mesh is open; mass properties come from the particles"));
            let given: Vec<[f64; 3]> = points.iter().map(|p| p.to_array()).collect();
            let solid = self.solid(&Shape::Points(given), key)?;
            (volume, center, inertia) = (solid.volume, solid.center, solid.inertia);
        }
        Ok(Solid { points, volume, center, inertia, mesh: Some(Arc::new(mesh)), shells: false, warnings })
    }

    fn load_mesh(&self, path: &str, key: &str) -> Result<Mesh> {
        if let Some((format, bytes)) = super::builtin::mesh(path).filter(|_| self.source.builtin) {
            return Mesh::from_bytes(format, bytes).map_err(|e| self.error(key, e.to_string(), e.help));
        }
        Mesh::load(&self.source.folder.join(path)).map_err(|e| self.error(key, e.to_string(), e.help))
    }
}

impl Shape {
    /// Whether [`Shape::contains`] knows the shape.
    fn is_plain(&self) -> bool {
        match self {
            Shape::Box(_) | Shape::Sphere { .. } | Shape::Cylinder { .. } => true,
            Shape::Difference { from, cut } => from.is_plain() && cut.iter().all(Shape::is_plain),
            Shape::Torus { .. } | Shape::Mesh { .. } | Shape::Points(_) => false,
        }
    }

    /// Whether a point is inside; in a flat scene y does not count.
    fn contains(&self, p: DVec3, flat: bool) -> bool {
        match self {
            Shape::Box(Region { min, max }) => (0..3).all(|a| (flat && a == 1) || (min[a]..=max[a]).contains(&p[a])),
            Shape::Sphere { center, radius } => {
                let mut d = p - DVec3::from(*center);
                d.y = if flat { 0.0 } else { d.y };
                d.length() < *radius
            }
            Shape::Cylinder { center, axis, radius, height } => {
                let (mut d, axis) = (p - DVec3::from(*center), DVec3::from(*axis).normalize_or_zero());
                d.y = if flat { 0.0 } else { d.y };
                let along = d.dot(axis);
                (flat || along.abs() < 0.5 * height) && (d - axis * along).length() < *radius
            }
            Shape::Difference { from, cut } => from.contains(p, flat) && !cut.iter().any(|c| c.contains(p, flat)),
            Shape::Torus { .. } | Shape::Mesh { .. } | Shape::Points(_) => false,
        }
    }
}

/// Points of a lattice centred on `center` with `inside(point - center)`, x fastest, then y, then z.
fn lattice(center: DVec3, reach: DVec3, dx: f64, flat: bool, inside: impl Fn(DVec3) -> bool) -> Vec<DVec3> {
    let n = (reach / dx).ceil().as_ivec3();
    let mut points = Vec::new();
    for k in -n.z..n.z {
        for j in if flat { 0..1 } else { -n.y..n.y } {
            for i in -n.x..n.x {
                let mut p = dx * (DVec3::new(i.into(), j.into(), k.into()) + 0.5);
                if flat {
                    p.y = 0.0;
                }
                if inside(p) {
                    points.push(center + p);
                }
            }
        }
    }
    points
}
