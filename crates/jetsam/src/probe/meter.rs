//! One probe: what its keys mean, and how it is read.

use super::{constant, find, level, places, sums};
use crate::error::Result;
use crate::flock::Order;
use crate::formula::{Expression, Scope};
use crate::scene::{Component, End, Norm, Of, Probe, Scene};
use crate::world::World;
use glam::DVec3;

/// Where a probe looks.
#[derive(Clone, Debug)]
pub(super) enum Place {
    /// Everywhere.
    All,
    /// At points.
    Points(Vec<DVec3>),
    /// At the particles in a box.
    Region(Space),
}

/// A box (m).
#[derive(Clone, Copy, Debug)]
pub(super) struct Space {
    pub(super) min: DVec3,
    pub(super) max: DVec3,
}

impl Space {
    /// Whether a point is inside; in 2D y does not count.
    pub(super) fn holds(&self, x: DVec3, dimensions: u32) -> bool {
        (0..3).all(|a| dimensions == 2 && a == 1 || (self.min[a]..=self.max[a]).contains(&x[a]))
    }
}

/// Whom a probe looks at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Subject {
    All,
    Fluid(usize),
    Body(usize),
    Flock(usize),
}

/// A probe with every name and formula resolved.
#[derive(Clone, Debug)]
pub(super) struct Meter {
    pub(super) of: Of,
    pub(super) subject: Subject,
    pub(super) component: Component,
    pub(super) place: Place,
    /// What angular momenta are taken about (m).
    pub(super) about: DVec3,
    pub(super) end: End,
    pub(super) percentile: f64,
    /// Half a spacing, or nothing (m).
    pub(super) padding: f64,
    pub(super) reference: Option<Expression>,
    pub(super) norm: Norm,
    pub(super) scale: f64,
    /// The reading, where it cannot change.
    constant: f64,
}

impl Meter {
    pub(super) fn new(scene: &Scene, scope: &Scope, world: &World, index: usize) -> Result<Self> {
        let p = &scene.probe[index];
        let path = |key: &str| format!("probe.{index}.{key}");
        let flat = world.model().dimensions == 2;
        let vector = |key: &str, f| {
            let x = scope.vector(scene, &path(key), f)?;
            Ok::<_, Box<crate::Error>>(if flat { DVec3::new(x.x, 0.0, x.z) } else { x })
        };
        let mut place = Place::All;
        let mut about = DVec3::ZERO;
        if let Some(at) = &p.at {
            about = vector("at", at)?;
            place = Place::Points(vec![about]);
        }
        if let Some(line) = &p.line {
            let (from, to) = (vector("line.from", &line.from)?, vector("line.to", &line.to)?);
            let n = p.points.round() as usize;
            let part = |k: usize| k as f64 / (n.max(2) - 1) as f64;
            place = Place::Points((0..n).map(|k| from.lerp(to, part(k))).collect());
        }
        if let Some(region) = &p.region {
            let space = Space { min: vector("region.min", &region.min)?, max: vector("region.max", &region.max)? };
            if !space.max.cmpge(space.min).all() {
                let help = "make every component of max at least min's";
                return Err(scene.error(&path("region"), "the region is empty", help));
            }
            place = Place::Region(space);
        }
        if p.of == Of::Flux && level::facing(&place, flat).is_none() {
            let message = "a flux needs a region that has no width along exactly one axis";
            return Err(scene.error(&path("region"), message, "make min and max equal along the axis it faces"));
        }
        let reference =
            p.reference.as_ref().map(|f| scope.compile(scene, &path("reference"), f, &["x", "y", "z", "t"]));
        let scale = p.scale.as_ref().map_or(Ok(1.0), |f| scope.number(scene, &path("scale"), f))?;
        if scale == 0.0 {
            return Err(scene.error(&path("scale"), "the scale is 0", "give the size of what is measured"));
        }
        Ok(Self {
            of: p.of,
            subject: subject(scene, world, p, index)?,
            component: p.component.unwrap_or(Component::Magnitude),
            place,
            about,
            end: p.end,
            percentile: p.percentile,
            padding: if p.padding { 0.5 * scene.resolution.spacing } else { 0.0 },
            reference: reference.transpose()?,
            norm: p.norm,
            scale,
            constant: constant::value(scene, scope, world, index)?,
        })
    }

    /// The reading now.
    pub(super) fn read(&self, world: &World) -> f64 {
        let ledger = world.ledger();
        let state = world.state();
        let body = || match self.subject {
            Subject::Body(b) => Some(&state.bodies.body[b]),
            _ => None,
        };
        let vector = |v: DVec3| component(v, self.component);
        match self.of {
            Of::Pressure | Of::Density => places::read(self, world),
            Of::Velocity if !matches!(self.place, Place::All) => places::read(self, world),
            Of::Velocity => match body() {
                Some(b) => vector(b.v),
                None => vector(sums::momentum(self, world) / sums::mass(self, world)),
            },
            Of::Height => level::height(self, world),
            Of::Extent => sums::extent(self, world),
            Of::Flux => level::flux(self, world),
            Of::Count => sums::particles(self, world).count() as f64,
            Of::Volume => sums::particles(self, world).map(|p| p.mass / p.rest_density).sum(),
            Of::Mass => sums::mass(self, world),
            Of::Position => match body() {
                Some(b) => vector(b.x),
                None => vector(sums::center(self, world)),
            },
            Of::Momentum => vector(sums::momentum(self, world)),
            Of::AngularMomentum => match body() {
                Some(b) => vector(b.l),
                None => vector(sums::angular_momentum(self, world).0),
            },
            Of::AngularMomentumScale => sums::angular_momentum(self, world).1,
            Of::MomentumScale => ledger.momentum_scale,
            Of::MomentumResidual => world.momentum_residual(),
            Of::ForceResidual => {
                (ledger.total_force - ledger.external_force).length() / ledger.force_scale.max(f64::MIN_POSITIVE)
            }
            Of::KineticEnergy => sums::kinetic(self, world),
            Of::PotentialEnergy => sums::potential(world),
            Of::ElasticEnergy => sums::elastic(world),
            Of::Energy => sums::kinetic(self, world) + sums::potential(world) + sums::elastic(world),
            Of::Speed if self.subject == Subject::All && matches!(self.place, Place::All) => ledger.speed,
            Of::Speed => sums::particles(self, world).map(|p| p.v.length()).fold(0.0, f64::max),
            Of::DensityErrorMean => ledger.density_error_mean,
            Of::DensityErrorMax => ledger.density_error_max,
            Of::Lost => (ledger.lost + ledger.rigid_lost as u64) as f64,
            Of::Left => ledger.left as f64,
            Of::Polarization | Of::Milling | Of::Fragments | Of::LargestFragment => match self.subject {
                Subject::Flock(f) => order(self.of, &world.flock_order(f)),
                _ => f64::NAN,
            },
            Of::Steps => world.steps() as f64,
            Of::Dt => world.model().largest_dt(world.model().bounding_speed(ledger), ledger.acceleration).0,
            Of::Spin
            | Of::BodySpin
            | Of::Tilt
            | Of::Quaternion
            | Of::Force
            | Of::TotalForce
            | Of::Torque
            | Of::Inertia
            | Of::ParticleInertia
            | Of::Particles => body().map_or(f64::NAN, |b| sums::of_body(self, world, b)),
            _ => self.constant,
        }
    }

    pub(super) fn profile(&self, world: &World) -> Vec<[f64; 3]> {
        match &self.place {
            Place::Points(points) if points.len() > 1 => places::profile(self, world, points),
            _ => Vec::new(),
        }
    }
}

/// An order parameter.
fn order(of: Of, order: &Order) -> f64 {
    match of {
        Of::Polarization => order.polarization,
        Of::Milling => order.milling,
        Of::LargestFragment => order.largest,
        _ => order.fragments as f64,
    }
}

/// A component of a vector.
pub(super) fn component(v: DVec3, component: Component) -> f64 {
    match component {
        Component::X => v.x,
        Component::Y => v.y,
        Component::Z => v.z,
        Component::W | Component::Magnitude => v.length(),
    }
}

fn subject(scene: &Scene, world: &World, p: &Probe, index: usize) -> Result<Subject> {
    if let Some(name) = &p.body {
        let names = world.state().bodies.body.iter().map(|b| b.name.as_str());
        return Ok(Subject::Body(find(scene, &format!("probe.{index}.body"), "body", name, names)?));
    }
    if let Some(name) = &p.fluid {
        let names = world.model().fluids.iter().map(|f| f.name.as_str());
        return Ok(Subject::Fluid(find(scene, &format!("probe.{index}.fluid"), "fluid", name, names)?));
    }
    if let Some(name) = &p.flock {
        let names = world.model().flocks.iter().map(|f| f.name.as_str());
        return Ok(Subject::Flock(find(scene, &format!("probe.{index}.flock"), "flock", name, names)?));
    }
    Ok(Subject::All)
}

/// Keys that a probe has to have one of, and those it may have.
fn keys(of: Of) -> (&'static [&'static str], &'static [&'static str]) {
    const PLACES: &[&str] = &["at", "line", "region"];
    const KERNEL: &[&str] = &["kernel", "support", "dimensions"];
    match of {
        Of::Pressure | Of::Density => {
            (PLACES, &["at", "line", "points", "region", "fluid", "reference", "norm", "scale"])
        }
        Of::Velocity => (
            &["at", "line", "region", "fluid", "body"],
            &["at", "line", "points", "region", "fluid", "body", "component", "reference", "norm", "scale"],
        ),
        Of::Height => (&["at"], &["at", "fluid"]),
        Of::Extent => (&["component"], &["component", "fluid", "body", "region", "end", "percentile", "padding"]),
        Of::Flux => (&["region"], &["region", "fluid"]),
        Of::Count | Of::Volume | Of::Speed => (&[], &["region", "fluid"]),
        Of::Mass | Of::KineticEnergy => (&[], &["fluid", "body"]),
        Of::Position | Of::Momentum => (&[], &["fluid", "body", "component"]),
        Of::Quaternion | Of::Inertia | Of::ParticleInertia => (&["component"], &["body", "component"]),
        Of::Spin | Of::BodySpin | Of::Force | Of::TotalForce | Of::Torque => (&["body"], &["body", "component"]),
        Of::Tilt | Of::Particles => (&["body"], &["body"]),
        Of::AngularMomentum => (&[], &["at", "fluid", "body", "component"]),
        Of::AngularMomentumScale => (&[], &["at", "fluid"]),
        Of::ParticleMass => (&[], &["fluid"]),
        Of::Kernel | Of::KernelSlope | Of::KernelDifference => {
            (&["distance"], &["kernel", "support", "dimensions", "distance"])
        }
        Of::KernelIntegral | Of::KernelSum | Of::KernelGradientSum | Of::KernelNeighbours => (&[], KERNEL),
        Of::ContactStiffness | Of::ContactDamping => (&["body"], &["body", "other"]),
        Of::Polarization | Of::Milling | Of::Fragments | Of::LargestFragment => (&["flock"], &["flock"]),
        Of::Formula => (&["formula"], &["formula"]),
        _ => (&[], &[]),
    }
}

/// Every key that the probe gives can be used, and none that it needs is missing.
pub(super) fn check_keys(scene: &Scene, index: usize, p: &Probe) -> Result<()> {
    let all = [
        ("at", p.at.is_some()),
        ("line", p.line.is_some()),
        ("region", p.region.is_some()),
        ("points", p.points != crate::params::default::points()),
        ("fluid", p.fluid.is_some()),
        ("body", p.body.is_some()),
        ("other", p.other.is_some()),
        ("flock", p.flock.is_some()),
        ("component", p.component.is_some()),
        ("end", p.end != End::Max),
        ("percentile", p.percentile != crate::params::default::percentile()),
        ("padding", p.padding),
        ("reference", p.reference.is_some()),
        ("norm", p.norm != Norm::L2),
        ("scale", p.scale.is_some()),
        ("formula", p.formula.is_some()),
        ("kernel", p.kernel.is_some()),
        ("support", p.support.is_some()),
        ("dimensions", p.dimensions.is_some()),
        ("distance", p.distance.is_some()),
    ];
    let word = serde_json::to_value(p.of).ok().and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default();
    let given = |key: &str| all.iter().any(|(k, is)| *k == key && *is);
    let (needed, allowed) = keys(p.of);
    let path = format!("probe.{index}");
    if let Some((key, _)) = all.iter().find(|(k, is)| *is && !allowed.contains(k)) {
        let message = format!("probe `{}`: `{key}` means nothing for of = \"{word}\"", p.name);
        let help = match allowed {
            [] => "leave it out".into(),
            _ => format!("it may have: {}", allowed.join(", ")),
        };
        return Err(scene.error(&format!("{path}.{key}"), message, help));
    }
    if !needed.is_empty() && !needed.iter().any(|k| given(k)) {
        let message = format!("probe `{}`: of = \"{word}\" needs `{}`", p.name, needed.join("` or `"));
        return Err(scene.error(&path, message, "add it; `jetsam schema` says what each key means"));
    }
    let needs_body = allowed.contains(&"body") && !allowed.contains(&"fluid");
    if needs_body && !given("body") {
        let message = format!("probe `{}`: of = \"{word}\" needs `body`", p.name);
        return Err(scene.error(&path, message, "name a rigid or static body, or \"walls\""));
    }
    let places = ["at", "line", "region"].iter().filter(|k| given(k)).count();
    if places > 1 || given("body") && (given("fluid") || places > 0 && p.of != Of::AngularMomentum) {
        let message = format!("probe `{}` looks at more than one place", p.name);
        return Err(scene.error(&path, message, "give one of at, line, region, body"));
    }
    if p.of == Of::AngularMomentum && given("body") && given("at") {
        let message = format!("probe `{}`: a body's angular momentum is about its own centre", p.name);
        return Err(scene.error(&format!("{path}.at"), message, "leave out `at`, or `body`"));
    }
    let deviates = given("line") || given("region");
    if p.reference.is_some() && !deviates || p.reference.is_none() && (given("norm") || given("scale")) {
        let message =
            format!("probe `{}`: a `reference` goes with `line` or `region`, `norm` and `scale` with it", p.name);
        return Err(scene.error(&path, message, "give both, or neither"));
    }
    if p.component == Some(Component::W) && p.of != Of::Quaternion {
        let message = "only a quaternion has a component w";
        return Err(scene.error(&format!("{path}.component"), message, "give x, y, z or magnitude"));
    }
    let axis = matches!(p.of, Of::Extent | Of::Inertia | Of::ParticleInertia);
    if axis && p.component == Some(Component::Magnitude) {
        return Err(scene.error(&format!("{path}.component"), "an axis is needed", "give x, y or z"));
    }
    Ok(())
}
