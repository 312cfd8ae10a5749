//! Sources and sinks of a scene made ready to run (E31).

use crate::error::Result;
use crate::integrate::sources::{Bore, Drain, DrainRegion, Source};
use crate::scene::{Emitter, Outlet, Region, Scene, Shape};
use glam::DVec3;

/// First stream of random numbers of emitters; each takes one.
const STREAM: u64 = 1 << 32;

impl Scene {
    pub(super) fn sources(&self) -> Result<Vec<Source>> {
        self.emitter.iter().enumerate().map(|(index, emitter)| self.source(index, emitter)).collect()
    }

    /// A hose that a hand holds ([`crate::World::pour`]): the scene's first fluid comes out of a disc of `radius` (m) about `center` (m)
    /// along `axis` at `speed` (m/s), from `time` (s) on.
    ///
    /// # Errors
    /// A scene without fluid, or a hose that begins outside the domain.
    pub fn hose(&self, center: DVec3, axis: DVec3, radius: f64, speed: f64, time: f64) -> Result<Source> {
        let (center, axis) = (center.to_array(), axis.to_array());
        let emitter = Emitter {
            name: None,
            fluid: None,
            outlet: Outlet::Hose { center, axis, radius, speed: Some(speed), rate: None },
            start: time,
            stop: None,
            count: 1e9,
            jitter: 0.0,
        };
        Ok(Source { stream: Source::HAND, ..self.source(self.emitter.len(), &emitter)? })
    }

    fn source(&self, index: usize, emitter: &Emitter) -> Result<Source> {
        let key = format!("emitter.{index}");
        let fluid = match &emitter.fluid {
            None if self.fluid.is_empty() => None,
            None => Some(0),
            Some(name) => self.fluid.iter().position(|f| f.name.as_ref() == Some(name)),
        };
        let Some(fluid) = fluid else {
            let message = format!("`{key}` gives a fluid that the scene does not have");
            return Err(self.error(
                &format!("{key}.fluid"),
                message,
                "name a [[fluid]] of the scene; it needs no shape",
            ));
        };
        let dx = self.resolution.spacing;
        let flat = self.world.dimensions == 2;
        let (points, velocity, period, bore) = match &emitter.outlet {
            Outlet::Hose { center, axis, radius, speed, rate } => {
                let mut axis = DVec3::from(*axis);
                if flat {
                    axis.y = 0.0;
                }
                let Some(axis) = axis.try_normalize() else {
                    let message = format!("`{key}`: the axis of a hose has no length");
                    return Err(self.error(&format!("{key}.outlet"), message, "give axis = [x, y, z]"));
                };
                let length = self.solver.support * dx;
                let bore = Bore { start: DVec3::from(*center) - axis * length, axis, length, radius: *radius };
                let points = disc(bore, dx, flat);
                let speed = match (speed, rate) {
                    (Some(speed), None) => *speed,
                    (None, Some(rate)) => rate / (points.len() as f64 * dx.powi(self.world.dimensions as i32 - 1)),
                    _ => {
                        let message = format!("`{key}` needs either a speed or a rate");
                        let help = "add speed = ... (m/s) or rate = ... (m^3/s) to the hose";
                        return Err(self.error(&format!("{key}.outlet"), message, help));
                    }
                };
                (points, axis * speed, dx / speed, Some(bore))
            }
            Outlet::Burst { shape, velocity, period } => {
                let points = self.solid(shape, &format!("{key}.outlet"))?.points;
                (points, DVec3::from(*velocity), period.unwrap_or(f64::INFINITY), None)
            }
        };
        let inside = |p: &DVec3| {
            let (min, max) = (self.domain.min, self.domain.max);
            (0..3).all(|a| flat && a == 1 || (min[a]..=max[a]).contains(&p[a]))
        };
        if !points.iter().all(inside) {
            let message = format!("`{key}` gives fluid outside the domain");
            let help = "move it inwards; a hose also needs room for one support of the kernel behind its disc";
            return Err(self.error(&format!("{key}.outlet"), message, help));
        }
        Ok(Source {
            fluid: fluid as u32,
            points,
            velocity,
            period,
            span: [emitter.start, emitter.stop.unwrap_or(f64::INFINITY)],
            count: emitter.count as u64,
            jitter: emitter.jitter * dx,
            bore,
            stream: STREAM + index as u64,
        })
    }

    pub(super) fn drains(&self) -> Result<Vec<Drain>> {
        let drain = |(index, sink): (usize, &crate::scene::Sink)| {
            let region = match &sink.shape {
                Shape::Box(Region { min, max }) => DrainRegion::Box { min: DVec3::from(*min), max: DVec3::from(*max) },
                Shape::Sphere { center, radius } => DrainRegion::Ball { center: DVec3::from(*center), radius: *radius },
                Shape::Cylinder { center, axis, radius, height } => {
                    let axis = DVec3::from(*axis).normalize_or(DVec3::Z);
                    let start = DVec3::from(*center) - 0.5 * height * axis;
                    DrainRegion::Cylinder(Bore { start, axis, length: *height, radius: *radius })
                }
                _ => {
                    let message = format!("`sink.{index}` is neither a box nor a ball nor a cylinder");
                    return Err(self.error(&format!("sink.{index}.shape"), message, "use one of these, or several"));
                }
            };
            Ok(Drain { region, span: [sink.start, sink.stop.unwrap_or(f64::INFINITY)] })
        };
        self.sink.iter().enumerate().map(drain).collect()
    }
}

/// Points of a square lattice on the disc where a hose's particles are born (in 2D, of a row).
fn disc(bore: Bore, dx: f64, flat: bool) -> Vec<DVec3> {
    let across = if flat { bore.axis.cross(DVec3::Y) } else { bore.axis.any_orthonormal_vector() };
    let up = if flat { DVec3::ZERO } else { bore.axis.cross(across) };
    let n = (bore.radius / dx).ceil() as i64;
    let mut points = Vec::new();
    for j in if flat { 0..1 } else { -n..n } {
        for i in -n..n {
            let (u, v) = ((i as f64 + 0.5) * dx, if flat { 0.0 } else { (j as f64 + 0.5) * dx });
            if u.hypot(v) <= bore.radius {
                points.push(bore.start + u * across + v * up);
            }
        }
    }
    if points.is_empty() {
        points.push(bore.start);
    }
    points
}
