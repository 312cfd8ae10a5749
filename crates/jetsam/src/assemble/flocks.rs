//! Flocks checked and placed: `[[flock]]` becomes constants and agents.

use super::bodies::NewBody;
use super::near::Near;
use crate::error::Result;
use crate::flock::{FlockConstants, name, unit_vector};
use crate::interact::cells::Grid;
use crate::random::uniform;
use crate::scene::{Flock, FlockModel, Region, Relation, Scene, Shape, Wall};
use crate::state::{Agents, Clock, Record};
use glam::{DVec3, IVec3};
use std::collections::HashSet;

/// Random numbers: purpose of a stream. Decisions have the streams below.
const PLACE: u64 = 100;
const HEADING: u64 = 110;
/// Draws per agent before its shape counts as full.
const DRAWS: u64 = 1000;

impl Scene {
    /// Constants of all flocks.
    pub(super) fn flock_constants(&self) -> Result<Vec<FlockConstants>> {
        let names: Vec<String> = self.flock.iter().map(name).collect();
        let mut all = Vec::new();
        let mut first = 0;
        for (index, flock) in self.flock.iter().enumerate() {
            let key = format!("flock.{index}");
            if names[..index].contains(&names[index]) {
                let message = format!("two flocks are called `{}`", names[index]);
                return Err(self.error(&key, message, "give each [[flock]] a name of its own"));
            }
            let find = |wanted: &str| names.iter().position(|n| n == wanted);
            let mut relations = vec![Relation::Ignore; names.len()];
            relations[index] = Relation::School;
            for (other, &relation) in &flock.meets {
                self.check_meeting(flock, &key, other, relation, &names)?;
                if let Some(j) = find(other) {
                    relations[j] = relation;
                }
            }
            let leader = match &flock.leader {
                None => None,
                Some(leader) => Some(find(leader).ok_or_else(|| {
                    let message = format!("`{key}.leader` = \"{leader}\" is no flock of this scene");
                    self.error(&format!("{key}.leader"), message, format!("flocks are called {}", names.join(", ")))
                })?),
            };
            self.check_flock(flock, &key)?;
            all.push(FlockConstants::new(
                flock,
                index,
                first,
                relations,
                leader,
                self.world.dimensions,
                self.world.seed,
            ));
            first += flock.count as usize;
        }
        let reaches = all.iter().flat_map(|f| (0..all.len()).map(|j| f64::from(f.reach(j))));
        let reach = reaches.fold(0.0, f64::max);
        for a in (0..3).filter(|&a| self.domain.walls[a] == Wall::Periodic) {
            let length = self.domain.max[a] - self.domain.min[a];
            if length < 2.0 * reach && !(self.world.dimensions == 2 && a == 1) {
                let message =
                    format!("a periodic axis of {length} m is shorter than twice the {reach} m that agents see");
                return Err(self.error("domain.walls", message, "lengthen the domain or lower the flock's radii"));
            }
        }
        Ok(all)
    }

    /// Particles of bodies, as far away from them as agents have to stay.
    pub(super) fn obstacles(&self, flocks: &[FlockConstants], bodies: &[NewBody]) -> Near {
        let (spacing, overlap) = (self.resolution.spacing, self.solver.contact_overlap);
        let clear = flocks.iter().map(|f| f.contact(spacing, overlap)).fold(0.0, f64::max);
        let mut near = Near::new(clear.max(self.resolution.spacing));
        if !flocks.is_empty() {
            bodies.iter().flat_map(NewBody::points).for_each(|p| near.insert(p));
        }
        near
    }

    fn check_meeting(&self, flock: &Flock, key: &str, other: &str, relation: Relation, names: &[String]) -> Result<()> {
        let place = format!("{key}.meets");
        let things = ["bodies", "fluids"].contains(&other);
        if !things && !names.iter().any(|n| n == other) {
            let message = format!("`{place}`: `{other}` is no flock of this scene");
            let help = format!("name one of {}, bodies, fluids", names.join(", "));
            return Err(self.error(&place, message, help));
        }
        let possible = match other {
            "fluids" => !matches!(relation, Relation::Chase),
            "bodies" => matches!(relation, Relation::Flee | Relation::Ignore),
            _ => true,
        };
        if !possible {
            let message = format!("`{place}`: bodies can be fled or ignored, fluids also be schooled with (stayed in)");
            return Err(self.error(&place, message, "write \"flee\" or \"ignore\""));
        }
        let steers = matches!(relation, Relation::Flee | Relation::Chase) || things && relation == Relation::School;
        if steers && flock.model != FlockModel::Reynolds {
            let message = format!("`{place}`: fleeing and chasing are rules of the model \"reynolds\"");
            return Err(self.error(&place, message, "choose model = \"reynolds\", or \"school\" or \"ignore\" here"));
        }
        Ok(())
    }

    fn check_flock(&self, flock: &Flock, key: &str) -> Result<()> {
        let reynolds = flock.model == FlockModel::Reynolds;
        for (field, given) in [
            ("goal", flock.goal.is_some()),
            ("leader", flock.leader.is_some()),
            ("speed_min", flock.speed_min.is_some()),
            ("speed_max", flock.speed_max.is_some()),
            ("acceleration", flock.acceleration.is_some()),
            ("mass", flock.mass.is_some()),
        ] {
            if given && !reynolds {
                let message =
                    format!("`{key}.{field}` has no meaning in this model: its agents have one speed and no steering");
                return Err(self.error(
                    &format!("{key}.{field}"),
                    message,
                    "leave it out, or choose model = \"reynolds\"",
                ));
            }
        }
        if flock.drag != crate::params::default::flock_drag() && flock.mass.is_none() {
            let message = format!("`{key}.drag` has no meaning without a mass: nothing pushes these agents");
            return Err(self.error(&format!("{key}.drag"), message, "give the agents a mass, or leave drag out"));
        }
        if flock.mass.is_some() && flock.size == 0.0 {
            let message = format!("`{key}.mass`: agents that push need a size");
            return Err(self.error(&format!("{key}.mass"), message, "give their radius as size"));
        }
        if reynolds && flock.noise > 0.0 {
            let message = format!("`{key}.noise` is a number of Couzin's and Vicsek's models");
            return Err(self.error(
                &format!("{key}.noise"),
                message,
                "leave it out; `wander` makes Reynolds' agents stray",
            ));
        }
        if !reynolds && flock.tau == Some(0.0) {
            let message = format!("`{key}.tau` = 0: this model decides at intervals");
            return Err(self.error(&format!("{key}.tau"), message, "give a tau above 0 s"));
        }
        if flock.speed_min.unwrap_or(0.5 * flock.speed) > flock.speed_max.unwrap_or(1.5 * flock.speed) {
            let message = format!("`{key}`: the smallest speed is above the largest");
            return Err(self.error(&format!("{key}.speed_min"), message, "make speed_min at most speed_max"));
        }
        Ok(())
    }

    /// Agents of all flocks at the beginning. `taken` knows the particles of bodies, `clear` how far from them agents stay (m).
    pub(super) fn agents(&self, flocks: &[FlockConstants], grid: &Grid, taken: &Near) -> Result<Agents> {
        let mut agents = Agents { clock: vec![Clock::default(); flocks.len()], ..Agents::default() };
        for (index, (flock, constants)) in self.flock.iter().zip(flocks).enumerate() {
            let places = self.places(flock, index, constants, grid, taken)?;
            for (k, x) in places.into_iter().enumerate() {
                let u = [0, 1].map(|s| uniform(constants.seed, HEADING + s, k as u64));
                let mut heading = match flock.heading {
                    Some(h) => DVec3::from(h),
                    None => unit_vector(u[0], u[1], self.world.dimensions).as_dvec3(),
                };
                if self.world.dimensions == 2 {
                    heading.y = 0.0;
                }
                let Some(heading) = heading.try_normalize() else {
                    let place = format!("flock.{index}.heading");
                    return Err(self.error(
                        &place,
                        format!("`{place}` is no direction"),
                        "give a vector that is not 0",
                    ));
                };
                let v = (heading * flock.speed).as_vec3().to_array();
                let mut x = x.as_vec3().to_array();
                grid.wrap(&mut x);
                agents.record.push(Record { x, v, ..Record::default() });
                agents.next.push(if constants.model == FlockModel::Reynolds { [0.0; 3] } else { v });
            }
        }
        agents.id = (0..agents.record.len() as u32).collect();
        agents.rest = vec![[0.0; 3]; agents.id.len()];
        if flocks.iter().any(|f| f.matter.is_some()) {
            agents.force = vec![[0.0; 3]; agents.id.len()];
        }
        Ok(agents)
    }

    /// Places of a flock's agents (m).
    fn places(
        &self,
        flock: &Flock,
        index: usize,
        constants: &FlockConstants,
        grid: &Grid,
        taken: &Near,
    ) -> Result<Vec<DVec3>> {
        let key = format!("flock.{index}.shape");
        let flat = self.world.dimensions == 2;
        let within = |p: DVec3| {
            (0..3).all(|a| {
                let size = if grid.walls[a] == Wall::Solid { f64::from(constants.size) } else { 0.0 };
                flat && a == 1 || (grid.min[a] + size..=grid.max[a] - size).contains(&p[a])
            }) && !taken.has(p, None)
        };
        if let Shape::Points(points) = &flock.shape {
            if points.len() != flock.count as usize {
                let message = format!("`{key}` has {} points for {} agents", points.len(), flock.count);
                return Err(self.error(&key, message, "give one point an agent"));
            }
            let points: Vec<DVec3> =
                points.iter().map(|p| DVec3::new(p[0], if flat { 0.0 } else { p[1] }, p[2])).collect();
            if let Some(p) = points.iter().find(|p| !within(**p)) {
                let message = format!("`{key}`: the point {p} is outside the domain or in a body");
                return Err(self.error(&key, message, "move it"));
            }
            return Ok(points);
        }
        let region = self.region(&flock.shape, &key)?;
        let mut places = Vec::with_capacity(flock.count as usize);
        for k in 0..u64::from(flock.count) {
            let found = (0..DRAWS).find_map(|draw| {
                let u = [0, 1, 2].map(|a| uniform(constants.seed, PLACE + a, (draw << 32) | k));
                let mut p = region.min + (region.max - region.min) * DVec3::from(u);
                if flat {
                    p.y = 0.0;
                }
                (region.holds(p) && within(p)).then_some(p)
            });
            let Some(p) = found else {
                let message = format!("`{key}`: no free place inside the domain was found for agent {k}");
                return Err(self.error(&key, message, "enlarge or move the shape, away from bodies"));
            };
            places.push(p);
        }
        Ok(places)
    }

    /// A shape as a box with a test.
    fn region(&self, shape: &Shape, key: &str) -> Result<Space> {
        let flat = self.world.dimensions == 2;
        let space = match shape {
            Shape::Box(Region { min, max }) => {
                Space { min: DVec3::from(*min), max: DVec3::from(*max), inside: Box::new(|_| true) }
            }
            Shape::Sphere { center, radius } => {
                let (mut c, r) = (DVec3::from(*center), *radius);
                if flat {
                    c.y = 0.0;
                }
                Space { min: c - r, max: c + r, inside: Box::new(move |p| p.distance(c) < r) }
            }
            Shape::Cylinder { center, axis, radius, height } => {
                let (c, r, h) = (DVec3::from(*center), *radius, *height);
                let Some(axis) = DVec3::from(*axis).try_normalize() else {
                    return Err(self.error(
                        key,
                        format!("`{key}`: the axis has no direction"),
                        "give a vector that is not 0",
                    ));
                };
                let reach = r.hypot(0.5 * h);
                let inside = move |p: DVec3| {
                    let z = (p - c).dot(axis);
                    (flat || z.abs() < 0.5 * h) && (p - c - z * axis).length() < r
                };
                Space { min: c - reach, max: c + reach, inside: Box::new(inside) }
            }
            Shape::Points(points) => {
                let points = points.clone();
                let holds = move |p: DVec3| points.iter().any(|q| DVec3::from(*q) == p);
                Space { min: DVec3::ZERO, max: DVec3::ZERO, inside: Box::new(holds) }
            }
            _ => {
                let dx = self.resolution.spacing;
                let points = self.solid(shape, key)?.points;
                let (min, max) =
                    points.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
                // whole cubes about the points, which are a lattice
                let base = points.first().copied().unwrap_or_default();
                let cube = move |p: DVec3| ((p - base) / dx).round().as_ivec3();
                let filled: HashSet<IVec3> = points.iter().map(|&p| cube(p)).collect();
                let half = DVec3::splat(0.5 * dx);
                Space { min: min - half, max: max + half, inside: Box::new(move |p| filled.contains(&cube(p))) }
            }
        };
        let size = space.max - space.min;
        if !(size.x > 0.0 && size.z > 0.0 && (flat || size.y > 0.0)) {
            return Err(self.error(key, format!("`{key}` is empty"), "give extents above 0"));
        }
        Ok(space)
    }
}

/// A box and a part of it.
struct Space {
    min: DVec3,
    max: DVec3,
    inside: Box<dyn Fn(DVec3) -> bool>,
}

impl Space {
    fn holds(&self, p: DVec3) -> bool {
        (self.inside)(p)
    }
}
