//! Sums over fluids and bodies: mass, momenta, energies, extents; and what a body says of itself.

use super::meter::{Meter, Place, Subject, component};
use super::places::way;
use crate::interact::pressure::of_particle;
use crate::scene::{Component, End, EquationOfState, Force, Of};
use crate::state::{Body, Kind, Record};
use crate::world::World;
use glam::DVec3;
use std::collections::HashMap;

/// A fluid particle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Particle {
    pub(super) x: DVec3,
    pub(super) v: DVec3,
    pub(super) mass: f64,
    pub(super) rest_density: f64,
    pub(super) density: f64,
    pub(super) pressure: f64,
}

/// The fluid particles a probe looks at: none where it looks at a body.
pub(super) fn particles<'a>(meter: &'a Meter, world: &'a World) -> impl Iterator<Item = Particle> + 'a {
    let model = world.model();
    let p = &world.state().particles;
    p.segment(Kind::Fluid).filter_map(move |i| {
        let owner = p.owner[i];
        match meter.subject {
            Subject::Fluid(f) if f != owner as usize => return None,
            Subject::Body(_) | Subject::Flock(_) => return None,
            _ => {}
        }
        let r = &p.record[i];
        let x = DVec3::from(r.x.map(f64::from));
        if matches!(meter.place, Place::Region(space) if !space.holds(x, model.dimensions)) {
            return None;
        }
        let fluid = &model.fluids[owner as usize];
        let rest_density = f64::from(fluid.density);
        Some(Particle {
            x,
            v: DVec3::from(r.v.map(f64::from)),
            mass: f64::from(fluid.mass),
            rest_density,
            density: rest_density * f64::from(p.density[i]),
            pressure: f64::from(of_particle(model, p, i)),
        })
    })
}

/// The moving bodies a probe looks at.
fn bodies<'a>(meter: &Meter, world: &'a World) -> impl Iterator<Item = &'a Body> + 'a {
    let subject = meter.subject;
    let all = world.state().bodies.body.iter().enumerate();
    let looked_at = all.filter(move |(i, _)| match subject {
        Subject::All => true,
        Subject::Fluid(_) | Subject::Flock(_) => false,
        Subject::Body(b) => b == *i,
    });
    looked_at.map(|(_, b)| b).filter(|b| !b.is_static())
}

/// Agents of mass (kg), where a probe looks at everything.
fn agents<'a>(meter: &Meter, world: &'a World) -> impl Iterator<Item = (f64, &'a Record)> + 'a {
    let all = meter.subject == Subject::All;
    let flocks = world.model().flocks.iter().filter(move |_| all);
    flocks
        .filter_map(|f| Some((f64::from(f.matter.as_ref()?.mass), f.range())))
        .flat_map(|(mass, range)| world.state().agents.record[range].iter().map(move |r| (mass, r)))
}

fn double(v: [f32; 3]) -> DVec3 {
    DVec3::from(v.map(f64::from))
}

/// Mass (kg).
pub(super) fn mass(meter: &Meter, world: &World) -> f64 {
    particles(meter, world).map(|p| p.mass).sum::<f64>()
        + bodies(meter, world).map(|b| b.mass).sum::<f64>()
        + agents(meter, world).map(|(mass, _)| mass).sum::<f64>()
}

/// Momentum (kg m/s).
pub(super) fn momentum(meter: &Meter, world: &World) -> DVec3 {
    let fluid = particles(meter, world).fold(DVec3::ZERO, |s, p| s + p.mass * p.v);
    let agents = agents(meter, world).fold(fluid, |s, (mass, r)| s + mass * double(r.v));
    bodies(meter, world).fold(agents, |s, b| s + b.mass * b.v)
}

/// Centre of mass (m).
pub(super) fn center(meter: &Meter, world: &World) -> DVec3 {
    let fluid = particles(meter, world).fold(DVec3::ZERO, |s, p| s + p.mass * p.x);
    let agents = agents(meter, world).fold(fluid, |s, (mass, r)| s + mass * double(r.x));
    bodies(meter, world).fold(agents, |s, b| s + b.mass * b.x) / mass(meter, world)
}

/// Angular momentum about the probe's point, and the sum of `m |r| |v|` (kg m^2/s).
pub(super) fn angular_momentum(meter: &Meter, world: &World) -> (DVec3, f64) {
    let mut sum = (DVec3::ZERO, 0.0);
    for p in particles(meter, world) {
        let r = p.x - meter.about;
        sum.0 += p.mass * r.cross(p.v);
        sum.1 += p.mass * r.length() * p.v.length();
    }
    for b in bodies(meter, world) {
        let r = b.x - meter.about;
        sum.0 += b.mass * r.cross(b.v) + b.l;
        sum.1 += b.mass * r.length() * b.v.length() + b.l.length();
    }
    for (mass, a) in agents(meter, world) {
        let (r, v) = (double(a.x) - meter.about, double(a.v));
        sum.0 += mass * r.cross(v);
        sum.1 += mass * r.length() * v.length();
    }
    sum
}

/// Kinetic energy (J).
pub(super) fn kinetic(meter: &Meter, world: &World) -> f64 {
    let fluid: f64 = particles(meter, world).map(|p| 0.5 * p.mass * p.v.length_squared()).sum();
    let turning = |b: &Body| 0.5 * (b.mass * b.v.length_squared() + b.l.dot(b.omega));
    let agents: f64 = agents(meter, world).map(|(mass, r)| 0.5 * mass * double(r.v).length_squared()).sum();
    fluid + agents + bodies(meter, world).map(turning).sum::<f64>()
}

/// Potential energy in gravity and in point fields (J).
pub(super) fn potential(world: &World) -> f64 {
    let model = world.model();
    let mut energy = world.ledger().potential;
    let p = &world.state().particles;
    let bodies = &world.state().bodies;
    for field in &model.fields {
        let Force::Point { center, strength, core } = field else { continue };
        let well = |x: [f32; 3]| {
            let d = DVec3::from(*center) - DVec3::from(x.map(f64::from));
            -strength / (d.length_squared() + core * core).sqrt()
        };
        for i in p.segment(Kind::Fluid) {
            energy += f64::from(model.fluids[p.owner[i] as usize].mass) * well(p.record[i].x);
        }
        for (slot, r) in bodies.record[..bodies.rigid_slots].iter().enumerate() {
            let body = &bodies.body[bodies.owner[slot] as usize];
            energy += body.mass / body.slots.len() as f64 * well(r.x);
        }
    }
    energy
}

/// Elastic energy of compressed fluid and of contacts between bodies (J).
pub(super) fn elastic(world: &World) -> f64 {
    compression(world) + springs(world)
}

/// `sum V integral p / D^2 dD`, times the ratio of the calibrations of `W` and its gradient, with which E1 and E4
/// conserve it.
fn compression(world: &World) -> f64 {
    let model = world.model();
    let p = &world.state().particles;
    let (support, dimensions) = (model.solver.support, model.dimensions);
    let (w, g) = (model.kernel.density(), model.kernel.force());
    let calibration = w.lattice_sum(support, dimensions) / g.lattice_gradient(support, dimensions);
    let energy = |i: usize| {
        let d = f64::from(p.density[i]);
        if d < 1.0 && !model.solver.negative_pressure {
            return 0.0;
        }
        let stiffness = f64::from(model.fluids[p.owner[i] as usize].stiffness);
        match model.solver.equation_of_state {
            EquationOfState::Linear => stiffness * (d.ln() + 1.0 / d - 1.0),
            EquationOfState::Tait => stiffness / 7.0 * ((d.powi(6) - 1.0) / 6.0 + 1.0 / d - 1.0),
        }
    };
    calibration * model.volume * p.segment(Kind::Fluid).map(energy).sum::<f64>()
}

/// `k overlap^2 / 2` over all pairs of particles of different bodies in contact (E10).
fn springs(world: &World) -> f64 {
    let model = world.model();
    let bodies = &world.state().bodies;
    let r = model.contact_diameter;
    let place = |slot: usize| DVec3::from(bodies.record[slot].x.map(f64::from));
    let cell = |x: DVec3| (x / r).floor().as_i64vec3().to_array();
    if bodies.rigid_slots == 0 {
        return 0.0;
    }
    let mut cells: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    for slot in 0..bodies.record.len() {
        cells.entry(cell(place(slot))).or_default().push(slot);
    }
    let mut energy = 0.0;
    for i in 0..bodies.rigid_slots {
        let c = cell(place(i));
        for k in 0..27 {
            let at = [c[0] + k % 3 - 1, c[1] + k / 3 % 3 - 1, c[2] + k / 9 - 1];
            for &j in cells.get(&at).into_iter().flatten() {
                let (a, b) = (bodies.owner[i], bodies.owner[j]);
                let overlap = r - way(world, place(i), place(j)).length();
                if a == b || overlap <= 0.0 {
                    continue;
                }
                let share = if j < bodies.rigid_slots { 0.5 } else { 1.0 }; // pairs of rigid bodies are met twice
                energy += share * 0.5 * f64::from(model.contact_pair(a, b).0) * overlap * overlap;
            }
        }
    }
    energy
}

/// How far particles reach along an axis (m).
pub(super) fn extent(meter: &Meter, world: &World) -> f64 {
    let mut places: Vec<f64> = match meter.subject {
        Subject::Body(b) => {
            let body = &world.state().bodies.body[b];
            let offsets = &world.state().bodies.offset[body.slots.clone()];
            offsets.iter().map(|o| component(body.x + body.q * *o, meter.component)).collect()
        }
        _ => particles(meter, world).map(|p| component(p.x, meter.component)).collect(),
    };
    if places.is_empty() {
        return 0.0;
    }
    places.sort_by(f64::total_cmp);
    let last = (places.len() - 1) as f64;
    let rank = |percent: f64| places[(percent / 100.0 * last).round() as usize];
    let (low, high) = (rank(100.0 - meter.percentile) - meter.padding, rank(meter.percentile) + meter.padding);
    match meter.end {
        End::Max => high,
        End::Min => low,
        End::Span => high - low,
    }
}

/// What a body says of itself.
pub(super) fn of_body(meter: &Meter, world: &World, b: &Body) -> f64 {
    let model = world.model();
    let vector = |v: DVec3| component(v, meter.component);
    let axis = match meter.component {
        Component::X => 0,
        Component::Y => 1,
        _ => 2,
    };
    let weight = if b.is_static() { DVec3::ZERO } else { b.mass * model.gravity };
    match meter.of {
        Of::Spin => vector(b.omega),
        Of::BodySpin => vector(b.q.conjugate() * b.omega),
        Of::Tilt => {
            let up = (-model.gravity).try_normalize().unwrap_or(DVec3::Z);
            (b.q * DVec3::Z).angle_between(up).to_degrees()
        }
        Of::Quaternion => match meter.component {
            Component::W => b.q.w,
            Component::Magnitude => b.q.length(),
            _ => b.q.to_array()[axis],
        },
        Of::Force => vector(b.force - weight),
        Of::TotalForce => vector(b.force),
        Of::Torque => vector(b.torque),
        Of::Particles => b.slots.len() as f64,
        Of::Inertia if model.dimensions == 2 => 1.0 / b.inverse_inertia.y_axis.y,
        Of::Inertia => b.inverse_inertia.inverse().col(axis)[axis],
        _ => {
            let offsets = &world.state().bodies.offset[b.slots.clone()];
            let arm = |o: &DVec3| o.length_squared() - o[axis] * o[axis];
            b.mass / b.slots.len() as f64 * offsets.iter().map(arm).sum::<f64>()
        }
    }
}
