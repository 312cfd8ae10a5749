//! Where the fluid stands and what flows: height along the vertical, flux through a rectangle.

use super::meter::{Meter, Place};
use super::places::around;
use crate::world::World;
use glam::DVec3;

/// Points a spacing along the vertical.
const FINE: f64 = 4.0;
/// What is thinner than this is spray (spacings).
const THIN: f64 = 0.5;
/// Inside a body hardly anything is left to be filled: below this fraction it counts as this much.
const LEAST_ROOM: f64 = 0.2;

/// Level along the vertical (m). Half of what neither walls nor bodies take of the kernel must be filled.
pub(super) fn height(meter: &Meter, world: &World) -> f64 {
    let model = world.model();
    let up = (-model.gravity).try_normalize().unwrap_or(DVec3::Z);
    let (low, high) = (model.grid.min, model.grid.max);
    let corner = |far: bool| {
        let pick = |a: usize| if (up[a] > 0.0) == far { high[a] } else { low[a] };
        up.dot(DVec3::new(pick(0), pick(1), pick(2)))
    };
    let flat = meter.about - up * up.dot(meter.about);
    let (floor, roof) = (corner(false), corner(true));
    let n = ((roof - floor) / model.spacing * FINE).ceil().max(1.0);
    let step = (roof - floor) / n;
    let at = |k: f64| floor + k * step;
    let points: Vec<DVec3> = (0..=n as usize).map(|k| flat + up * at(k as f64)).collect();
    let filled: Vec<f64> =
        around(world, meter.subject, &points, true).iter().map(|a| a.fluid / (1.0 - a.solid).max(LEAST_ROOM)).collect();
    // runs of points that are half full, from the roof down
    let mut top: Option<f64> = None;
    for k in (0..filled.len()).rev() {
        if filled[k] >= 0.5 {
            if top.is_none() {
                let beyond = filled.get(k + 1).map_or(0.0, |next| (filled[k] - 0.5) / (filled[k] - next));
                top = Some(at(k as f64 + beyond.min(1.0)));
            }
            if k == 0 {
                return top.unwrap_or(floor);
            }
        } else if let Some(level) = top {
            let beyond = (filled[k + 1] - 0.5) / (filled[k + 1] - filled[k]);
            if level - at(k as f64 + 1.0 - beyond) >= THIN * model.spacing {
                return level;
            }
            top = None;
        }
    }
    floor
}

/// The axis a flat region faces.
pub(super) fn facing(place: &Place, flat: bool) -> Option<usize> {
    let Place::Region(space) = place else { return None };
    let size = space.max - space.min;
    let mut thin = (0..3).filter(|&a| size[a] == 0.0 && !(flat && a == 1));
    let axis = thin.next()?;
    thin.next().is_none().then_some(axis)
}

/// Volume that passes a flat region (m^3/s; m^2/s in 2D): the sum of `V v W` over a lattice of points on it.
pub(super) fn flux(meter: &Meter, world: &World) -> f64 {
    let model = world.model();
    let Place::Region(space) = &meter.place else { return f64::NAN };
    let Some(axis) = facing(&meter.place, model.dimensions == 2) else { return f64::NAN };
    let size = space.max - space.min;
    let flat = |a: usize| a == axis || model.dimensions == 2 && a == 1;
    let count: [usize; 3] =
        std::array::from_fn(|a| if flat(a) { 1 } else { (size[a] / model.spacing).ceil().max(1.0) as usize });
    let part = |a: usize, k: usize| space.min[a] + size[a] * (k as f64 + 0.5) / count[a] as f64;
    let mut points = Vec::with_capacity(count.iter().product());
    for k in 0..count[2] {
        for j in 0..count[1] {
            for i in 0..count[0] {
                points.push(DVec3::new(part(0, i), part(1, j), part(2, k)));
            }
        }
    }
    let area: f64 = (0..3).filter(|&a| !flat(a)).map(|a| size[a]).product();
    let sum: f64 = around(world, meter.subject, &points, false).iter().map(|a| a.velocity[axis]).sum();
    sum * area / points.len() as f64
}
