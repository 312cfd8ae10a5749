//! Pressure, velocity and density: at points, as kernel-weighted means over the fluid around, and of the particles in a box.

use super::meter::{Meter, Place, Subject, component};
use super::sums;
use crate::interact::pressure::of_particle;
use crate::scene::{Norm, Of};
use crate::state::Kind;
use crate::world::World;
use glam::DVec3;

/// A point counts as dry where the kernel finds less than this fraction of a full support.
const DRY: f64 = 0.05;

/// Sums over the particles around a point, each weighted by `V W`; the kernel is not calibrated: a mean over places is exact.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Around {
    /// Of fluid: the fraction of the kernel that is filled.
    pub(super) fluid: f64,
    /// Of walls and bodies.
    pub(super) solid: f64,
    /// Of the pressure, carried to the point along gravity (Pa).
    pub(super) pressure: f64,
    /// Of the density (kg/m^3).
    pub(super) density: f64,
    /// Of the velocity (m/s).
    pub(super) velocity: DVec3,
}

/// From one place to another by the shortest way (m).
pub(super) fn way(world: &World, from: DVec3, to: DVec3) -> DVec3 {
    let grid = &world.model().grid;
    let mut d = to - from;
    for a in 0..3 {
        let period = f64::from(grid.period[a]);
        if period > 0.0 {
            d[a] -= period * (d[a] / period).round();
        }
    }
    if world.model().dimensions == 2 {
        d.y = 0.0;
    }
    d
}

/// What is around each of some points.
pub(super) fn around(world: &World, subject: Subject, points: &[DVec3], solids: bool) -> Vec<Around> {
    let model = world.model();
    let p = &world.state().particles;
    let (kernel, support, dimensions) = (model.kernel.density(), model.support, model.dimensions);
    let (min, max) = points.iter().fold((DVec3::MAX, DVec3::MIN), |(a, b), x| (a.min(*x), b.max(*x)));
    let (middle, reach) = (0.5 * (min + max), 0.5 * (max - min) + support);
    let mut all = vec![Around::default(); points.len()];
    let kinds: &[Kind] = if solids { &Kind::ALL } else { &[Kind::Fluid] };
    for &kind in kinds {
        for i in p.segment(kind) {
            let r = &p.record[i];
            let x = DVec3::from(r.x.map(f64::from));
            if way(world, middle, x).abs().cmpgt(reach).any() {
                continue;
            }
            let owner = p.owner[i];
            if kind == Kind::Fluid && matches!(subject, Subject::Fluid(f) if f != owner as usize) {
                continue;
            }
            for (point, sum) in points.iter().zip(&mut all) {
                let d = way(world, *point, x);
                let weight = f64::from(r.volume) * kernel.value(d.length(), support, dimensions);
                if weight <= 0.0 {
                    continue;
                }
                if kind != Kind::Fluid {
                    sum.solid += weight;
                    continue;
                }
                let relative = p.density[i];
                let density = f64::from(relative) * f64::from(model.fluids[owner as usize].density);
                let here = f64::from(of_particle(model, p, i));
                sum.fluid += weight;
                sum.pressure += weight * (here - density * model.gravity.dot(d));
                sum.density += weight * density;
                sum.velocity += weight * DVec3::from(r.v.map(f64::from));
            }
        }
    }
    all
}

/// The quantity at points.
fn at(meter: &Meter, world: &World, points: &[DVec3]) -> Vec<f64> {
    let value = |a: &Around| {
        if a.fluid < DRY {
            return 0.0;
        }
        match meter.of {
            Of::Pressure => a.pressure / a.fluid,
            Of::Density => a.density / a.fluid,
            _ => component(a.velocity / a.fluid, meter.component),
        }
    };
    around(world, meter.subject, points, false).iter().map(value).collect()
}

/// The mean, or the norm of the deviation from the reference.
pub(super) fn read(meter: &Meter, world: &World) -> f64 {
    let (points, values): (Vec<DVec3>, Vec<f64>) = match &meter.place {
        Place::Points(points) => (points.clone(), at(meter, world, points)),
        _ => {
            let value = |p: sums::Particle| match meter.of {
                Of::Pressure => p.pressure,
                Of::Density => p.density,
                _ => component(p.v, meter.component),
            };
            sums::particles(meter, world).map(|p| (p.x, value(p))).unzip()
        }
    };
    let n = values.len().max(1) as f64;
    let Some(reference) = &meter.reference else { return values.iter().sum::<f64>() / n };
    let error = |(x, v): (&DVec3, &f64)| (v - reference.eval(&[x.x, x.y, x.z, world.time()])).abs();
    let errors = points.iter().zip(&values).map(error);
    let norm = match meter.norm {
        Norm::L2 => (errors.map(|e| e * e).sum::<f64>() / n).sqrt(),
        Norm::L1 => errors.sum::<f64>() / n,
        Norm::Max => errors.fold(0.0, f64::max),
    };
    norm / meter.scale
}

/// Way along the line (m), reading, reference.
pub(super) fn profile(meter: &Meter, world: &World, points: &[DVec3]) -> Vec<[f64; 3]> {
    let reference = |x: &DVec3| match &meter.reference {
        Some(f) => f.eval(&[x.x, x.y, x.z, world.time()]),
        None => f64::NAN,
    };
    let values = at(meter, world, points);
    points.iter().zip(values).map(|(x, v)| [x.distance(points[0]), v, reference(x)]).collect()
}
