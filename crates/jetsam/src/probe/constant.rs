//! Constants of the model: kernels and their sums over lattices, masses, contacts.

use super::find;
use crate::error::Result;
use crate::formula::Scope;
use crate::laws::kernel::Kernel;
use crate::scene::{Of, Scene};
use crate::world::World;
use std::f64::consts::PI;

/// Half the way of a central difference, as a fraction of the support.
const DIFFERENCE: f64 = 1e-3;
/// Intervals of Simpson's rule.
const INTERVALS: usize = 2000;

/// The reading of a probe that cannot change; 0 for the others.
pub(super) fn value(scene: &Scene, scope: &Scope, world: &World, index: usize) -> Result<f64> {
    let (probe, model) = (&scene.probe[index], world.model());
    let path = |key: &str| format!("probe.{index}.{key}");
    let number = |key: &str, f: &Option<crate::scene::Formula>, default: f64| {
        f.as_ref().map_or(Ok(default), |f| scope.number(scene, &path(key), f))
    };
    Ok(match probe.of {
        Of::Spacing => model.spacing,
        Of::SoundSpeed => model.sound_speed,
        Of::ParticleMass => {
            let names = model.fluids.iter().map(|f| f.name.as_str());
            let fluid = match &probe.fluid {
                Some(name) => find(scene, &path("fluid"), "fluid", name, names)?,
                None => 0,
            };
            model.fluids.get(fluid).map_or(0.0, |f| f64::from(f.mass))
        }
        Of::ContactStiffness | Of::ContactDamping => {
            let names = || world.state().bodies.body.iter().map(|b| b.name.as_str());
            let name = probe.body.as_deref().unwrap_or_default();
            let body = find(scene, &path("body"), "body", name, names())? as u32;
            let other = match &probe.other {
                Some(name) => find(scene, &path("other"), "body", name, names())? as u32,
                None => body,
            };
            if [body, other].iter().all(|&b| model.contacts[b as usize].inverse_mass == 0.0) {
                let message = format!("probe `{}`: neither of the two bodies can move", probe.name);
                return Err(scene.error(&path("body"), message, "name a rigid body as `body` or `other`"));
            }
            let (k, eta) = model.contact_pair(body, other);
            f64::from(if probe.of == Of::ContactStiffness { k } else { eta })
        }
        Of::Kernel
        | Of::KernelSlope
        | Of::KernelDifference
        | Of::KernelIntegral
        | Of::KernelSum
        | Of::KernelGradientSum
        | Of::KernelNeighbours => {
            let kernel = probe.kernel.unwrap_or(model.kernel.density());
            let dimensions = probe.dimensions.unwrap_or(model.dimensions);
            if !(2..=3).contains(&dimensions) {
                let message = format!("`{}` = {dimensions} is neither 2 nor 3", path("dimensions"));
                return Err(scene.error(&path("dimensions"), message, "give 2 or 3"));
            }
            let support = number("support", &probe.support, model.solver.support)?;
            if !(0.5..=20.0).contains(&support) {
                let message = format!("`{}` = {support} is out of range", path("support"));
                return Err(scene.error(&path("support"), message, "give a value from 0.5 to 20 (dx)"));
            }
            let s = number("distance", &probe.distance, 0.0)?;
            if !(0.0..=10.0).contains(&s) {
                let message = format!("`{}` = {s} is out of range", path("distance"));
                return Err(scene.error(&path("distance"), message, "give a value from 0 to 10 (supports)"));
            }
            of_kernel(probe.of, kernel, dimensions, support, s)
        }
        _ => 0.0,
    })
}

fn of_kernel(of: Of, kernel: Kernel, dimensions: u32, support: f64, s: f64) -> f64 {
    let w = |s: f64| kernel.value(s.abs(), 1.0, dimensions);
    match of {
        Of::Kernel => w(s),
        Of::KernelSlope => kernel.slope(s, 1.0, dimensions),
        Of::KernelDifference => (w(s + DIFFERENCE) - w(s - DIFFERENCE)) / (2.0 * DIFFERENCE),
        Of::KernelIntegral => {
            let shell = |s: f64| if dimensions == 3 { 4.0 * PI * s * s } else { 2.0 * PI * s };
            let term = |k: usize| {
                let s = k as f64 / INTERVALS as f64;
                let weight = if k == 0 || k == INTERVALS { 1.0 } else { 2.0 + 2.0 * (k % 2) as f64 };
                weight * shell(s) * w(s)
            };
            (0..=INTERVALS).map(term).sum::<f64>() / (3.0 * INTERVALS as f64)
        }
        Of::KernelSum => kernel.lattice_sum(support, dimensions),
        Of::KernelGradientSum => kernel.lattice_gradient(support, dimensions),
        _ => {
            let n = support.ceil() as i64;
            let depth = if dimensions == 3 { n } else { 0 };
            let mut count = -1.0;
            for i in -n..=n {
                for j in -depth..=depth {
                    for k in -n..=n {
                        let inside = ((i * i + j * j + k * k) as f64) < support * support * (1.0 - 1e-12);
                        count += f64::from(u8::from(inside));
                    }
                }
            }
            count
        }
    }
}
