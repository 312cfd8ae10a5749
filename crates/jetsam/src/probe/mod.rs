//! Reading a scene's probes off a running world.
//!
//! In: the `[[probe]]` blocks of a scene and its [`World`]. Out: numbers, and with a [`Sampler`] their course in time.
//! Called by whoever drives a world: `jetsam run` for `probes.csv`, [`crate::validate`] for its verdicts. Probes only
//! look: a run is the same to the last bit with and without them.

mod constant;
mod level;
mod meter;
mod places;
mod sampler;
mod sums;

pub use sampler::{Sampler, Series};

use crate::error::Result;
use crate::formula::{Expression, Scope, nearest};
use crate::scene::{Of, Scene};
use crate::world::World;
use meter::Meter;

/// The probes of a scene, ready to be read.
#[derive(Debug)]
pub struct Probes {
    names: Vec<String>,
    intervals: Vec<Option<f64>>,
    meters: Vec<Reader>,
    /// Formula probes after what they use.
    order: Vec<usize>,
}

/// How one probe is read.
#[derive(Debug)]
enum Reader {
    Meter(Box<Meter>),
    /// A formula of `t` and of the probes' readings, in their order.
    Formula(Expression),
}

impl Probes {
    /// Makes the probes of a scene ready to be read off its world.
    ///
    /// # Errors
    /// A probe that lacks what it needs, has what it cannot use, or names what is not there: with place and remedy.
    pub fn new(scene: &Scene, world: &World) -> Result<Self> {
        let scope = Scope::of(scene)?;
        let names: Vec<String> = scene.probe.iter().map(|p| p.name.clone()).collect();
        for (i, name) in names.iter().enumerate() {
            if names[..i].contains(name) || name == "t" || scene.constants.contains_key(name) {
                let message = format!("there is something else named `{name}`");
                return Err(scene.error(&format!("probe.{i}.name"), message, "choose another name"));
            }
        }
        let free: Vec<&str> = ["t"].into_iter().chain(names.iter().map(String::as_str)).collect();
        let mut meters = Vec::new();
        for (index, probe) in scene.probe.iter().enumerate() {
            meter::check_keys(scene, index, probe)?;
            meters.push(match (&probe.of, &probe.formula) {
                (Of::Formula, Some(f)) => {
                    Reader::Formula(scope.compile(scene, &format!("probe.{index}.formula"), f, &free)?)
                }
                _ => Reader::Meter(Box::new(Meter::new(scene, &scope, world, index)?)),
            });
        }
        let order = order(scene, &meters)?;
        let intervals = scene.probe.iter().map(|p| p.interval).collect();
        Ok(Self { names, intervals, meters, order })
    }

    /// Names of the probes, in the order of the scene.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Reads the probes that are `wanted`, and whatever their formulas need; the others are `NaN`.
    pub fn read(&self, world: &World, wanted: &[bool]) -> Vec<f64> {
        let mut needed = wanted.to_vec();
        for &i in self.order.iter().rev().filter(|&&i| matches!(self.meters[i], Reader::Formula(_))) {
            if let (true, Reader::Formula(f)) = (needed[i], &self.meters[i]) {
                f.uses().filter(|&u| u > 0).for_each(|u| needed[u - 1] = true);
            }
        }
        // the time, then every probe: what formulas see
        let mut values = vec![f64::NAN; 1 + self.meters.len()];
        values[0] = world.time();
        for &i in self.order.iter().filter(|&&i| needed[i]) {
            values[i + 1] = match &self.meters[i] {
                Reader::Meter(meter) => meter.read(world),
                Reader::Formula(f) => f.eval(&values),
            };
        }
        values.split_off(1)
    }

    /// Values along the line of a probe that has one (m along it, reading, reference), for plots.
    pub fn profile(&self, world: &World, probe: usize) -> Vec<[f64; 3]> {
        match &self.meters[probe] {
            Reader::Meter(meter) => meter.profile(world),
            Reader::Formula(_) => Vec::new(),
        }
    }
}

/// Every probe after those its formula uses.
fn order(scene: &Scene, meters: &[Reader]) -> Result<Vec<usize>> {
    let mut order = Vec::new();
    let mut done = vec![false; meters.len()];
    while order.len() < meters.len() {
        let before = order.len();
        for (i, meter) in meters.iter().enumerate() {
            let ready = match meter {
                Reader::Meter(_) => true,
                Reader::Formula(f) => f.uses().all(|u| u == 0 || done[u - 1]),
            };
            if ready && !done[i] {
                done[i] = true;
                order.push(i);
            }
        }
        if order.len() == before {
            let i = done.iter().position(|d| !d).unwrap_or(0);
            let message = format!("the formula of probe `{}` needs its own value", scene.probe[i].name);
            return Err(scene.error(&format!("probe.{i}.formula"), message, "break the circle"));
        }
    }
    Ok(order)
}

/// Index of a name among others.
fn find<'a>(
    scene: &Scene,
    path: &str,
    what: &str,
    name: &str,
    known: impl Iterator<Item = &'a str> + Clone,
) -> Result<usize> {
    let mut found = known.clone().enumerate().filter(|(_, n)| *n == name).map(|(i, _)| i);
    match (found.next(), found.next()) {
        (Some(i), None) => Ok(i),
        (Some(_), Some(_)) => {
            let message = format!("more than one {what} is named `{name}`");
            Err(scene.error(path, message, "give each a name of its own"))
        }
        (None, _) => {
            let help = match nearest(name, known.clone()) {
                Some(n) => format!("did you mean `{n}`?"),
                None => format!("there are: {}", known.collect::<Vec<_>>().join(", ")),
            };
            Err(scene.error(path, format!("there is no {what} `{name}`"), help))
        }
    }
}
