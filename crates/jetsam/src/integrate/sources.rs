//! Fluid that is born and drained while a world runs: hoses, bursts, sinks, lifetimes (E31).
//!
//! In: the time at both ends of a step, particles after their drift. Out: new particles at the end of the fluid's segment, old
//! ones marked for the sort to take out. Inside a hose, a support long, particles go on at its speed whatever pushes them: so the
//! stream has fluid behind it where it comes out. What comes when depends on time alone.

use crate::interact::CHUNK;
use crate::interact::cells::DRAINED;
use crate::model::Model;
use crate::random;
use crate::state::{Kind, Particles, Record};
use glam::DVec3;
use rayon::prelude::*;
use std::ops::Range;

/// A source made ready to run.
#[derive(Clone, Debug)]
pub struct Source {
    /// Index of its fluid.
    pub fluid: u32,
    /// Places of the particles of one layer or burst (m): of a hose where they are born, a support behind the disc.
    pub points: Vec<DVec3>,
    /// Velocity of the particles (m/s).
    pub velocity: DVec3,
    /// Time between two layers or bursts (s); infinite for a single one.
    pub period: f64,
    /// First and last time of birth (s).
    pub span: [f64; 2],
    /// Most particles it gives.
    pub count: u64,
    /// Displacement at random (m).
    pub jitter: f64,
    /// The inside of a hose; nothing for a burst.
    pub bore: Option<Bore>,
    /// Stream of random numbers.
    pub stream: u64,
}

/// The inside of a hose: a cylinder.
#[derive(Clone, Copy, Debug)]
pub struct Bore {
    /// Where particles are born, on the axis (m).
    pub start: DVec3,
    /// Unit vector along the stream.
    pub axis: DVec3,
    /// Length (m).
    pub length: f64,
    /// Radius (m).
    pub radius: f64,
}

/// A sink made ready to run.
#[derive(Clone, Copy, Debug)]
pub struct Drain {
    /// What it takes in.
    pub region: DrainRegion,
    /// When it is open (s).
    pub span: [f64; 2],
}

/// What a sink takes in.
#[derive(Clone, Copy, Debug)]
pub enum DrainRegion {
    /// A box.
    Box {
        /// Lower corner (m).
        min: DVec3,
        /// Upper corner (m).
        max: DVec3,
    },
    /// A ball.
    Ball {
        /// Centre (m).
        center: DVec3,
        /// Radius (m).
        radius: f64,
    },
    /// A cylinder.
    Cylinder(Bore),
}

impl Bore {
    fn holds(&self, x: DVec3) -> bool {
        let d = x - self.start;
        let along = d.dot(self.axis);
        (0.0..=self.length).contains(&along) && (d - along * self.axis).length_squared() <= self.radius * self.radius
    }
}

impl Drain {
    fn takes(&self, x: DVec3, time: f64) -> bool {
        (self.span[0]..=self.span[1]).contains(&time)
            && match self.region {
                DrainRegion::Box { min, max } => x.cmpge(min).all() && x.cmple(max).all(),
                DrainRegion::Ball { center, radius } => x.distance_squared(center) <= radius * radius,
                DrainRegion::Cylinder(bore) => bore.holds(x),
            }
    }
}

impl Source {
    /// Stream of random numbers of the hose that a hand holds.
    pub const HAND: u64 = u64::MAX;

    /// The births in `(from, to]`, and at `from` itself when that is the source's first: numbers of layers or bursts.
    fn births(&self, from: f64, to: f64, first_step: bool) -> Range<u64> {
        let index = |t: f64| if t < self.span[0] { 0 } else { 1 + ((t - self.span[0]) / self.period) as u64 };
        let end = index(to.min(self.span[1]));
        let begin = if first_step && from <= self.span[0] { 0 } else { index(from.min(self.span[1])) };
        begin.min(end)..end
    }

    /// Particles given by the births before `number`.
    fn given(&self, number: u64) -> u64 {
        number.saturating_mul(self.points.len() as u64)
    }
}

/// A particle to be born.
#[derive(Clone, Copy, Debug)]
pub struct Birth {
    /// When (s).
    pub time: f64,
    /// Where (m).
    pub x: DVec3,
    /// Velocity (m/s).
    pub v: DVec3,
    /// Its fluid.
    pub fluid: u32,
    /// Whether inside a hose: nothing else is asked for room then.
    pub in_hose: bool,
}

/// All births in `(from, to]`, source by source in the order of time; at the very beginning those at `from` too.
pub fn births(model: &Model, from: f64, to: f64) -> impl Iterator<Item = Birth> + '_ {
    model.sources.iter().flat_map(move |source| {
        source.births(from, to, from == 0.0).flat_map(move |birth| {
            let time = source.span[0] + if birth == 0 { 0.0 } else { birth as f64 * source.period };
            let first = source.given(birth);
            let left = source.count.saturating_sub(first).min(source.points.len() as u64) as usize;
            source.points[..left].iter().zip(first..).map(move |(&point, number)| {
                let shift = [0, 1, 2].map(|a| 2.0 * random::uniform(model.seed, source.stream, 3 * number + a) - 1.0);
                let mut x = point + source.jitter * DVec3::from(shift);
                if model.dimensions == 2 {
                    x.y = 0.0;
                }
                Birth { time, x, v: source.velocity, fluid: source.fluid, in_hose: source.bore.is_some() }
            })
        })
    })
}

/// Fluid born in the step from `time` to `time + dt`, appended to the fluid's segment, which grows where it must.
/// Returns its momentum (kg m/s).
pub fn bear(p: &mut Particles, model: &Model, time: f64, dt: f64, next_id: &mut u32) -> DVec3 {
    let mut momentum = DVec3::ZERO;
    for birth in births(model, time, time + dt) {
        let x = birth.x + birth.v * (time + dt - birth.time);
        if birth.in_hose || has_room(p, model, x) {
            let mut x = x.as_vec3().to_array();
            model.grid.wrap(&mut x);
            let v = birth.v.as_vec3().to_array();
            p.append(Record { x, volume: model.volume as f32, v, share: 0.0 }, *next_id, birth.fluid, time + dt);
            *next_id += 1;
            momentum += f64::from(model.fluids[birth.fluid as usize].mass) * birth.v;
        }
    }
    momentum
}

/// Whether nothing stands within 0.85 spacings of a place.
fn has_room(p: &Particles, model: &Model, x: DVec3) -> bool {
    let x = x.as_vec3();
    let limit = (0.85 * model.spacing) as f32;
    let near = |r: &Record| glam::Vec3::from(r.x).distance_squared(x) < limit * limit;
    Kind::ALL.into_iter().all(|kind| !p.record[p.segment(kind)].iter().any(near))
}

/// Marks fluid that is in an open sink or has outlived its fluid's lifetime.
pub fn drain(p: &mut Particles, model: &Model, time: f64) {
    if model.drains.is_empty() && p.born.is_empty() {
        return;
    }
    let n = p.count[Kind::Fluid as usize];
    let (owner, born) = (&p.owner, &p.born);
    p.record[..n].par_iter_mut().with_min_len(CHUNK).enumerate().for_each(|(i, record)| {
        let x = DVec3::from(record.x.map(f64::from));
        let old = born.get(i).is_some_and(|&b| time - f64::from(b) > model.fluids[owner[i] as usize].lifetime);
        if old || model.drains.iter().any(|d| d.takes(x, time)) {
            record.x[0] = DRAINED;
        }
    });
}

/// What holds fluid inside hoses to their speed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Held {
    /// Instead of the forces that were there (N).
    pub force: DVec3,
    /// For what pressure had done to velocities already (N s).
    pub impulse: DVec3,
}

/// Particles inside hoses go on at the hose's speed: what pushes them is taken away. Returns what does so.
pub fn hold(p: &mut Particles, model: &Model) -> Held {
    let mut held = Held::default();
    let n = p.count[Kind::Fluid as usize];
    for source in &model.sources {
        let Some(bore) = source.bore else { continue };
        let mass = f64::from(model.fluids[source.fluid as usize].mass);
        let records = &p.record;
        let inside: Vec<Vec<usize>> = (0..n.div_ceil(CHUNK))
            .into_par_iter()
            .map(|c| {
                let members = c * CHUNK..((c + 1) * CHUNK).min(n);
                members.filter(|&i| bore.holds(DVec3::from(records[i].x.map(f64::from)))).collect()
            })
            .collect();
        for i in inside.into_iter().flatten().filter(|&i| p.owner[i] == source.fluid) {
            held.force -= mass * DVec3::from(p.push[i].map(f64::from));
            held.impulse += mass * (source.velocity - DVec3::from(p.record[i].v.map(f64::from)));
            p.push[i] = [0.0; 3];
            p.push_before[i] = [0.0; 3];
            p.record[i].v = source.velocity.as_vec3().to_array();
            if let Some(carry) = p.carry.get_mut(i) {
                *carry = [0.0; 4];
            }
        }
    }
    held
}
