//! Bodies on the CPU: the lists of their contacts, what their particles feel, and its sum over each body.
//!
//! Lists are kept while they hold ([`Kept`]). Where nothing but contacts asks for the order of bodies' particles, that stays
//! too, and a step neither sorts nor searches.

use super::{Cpu, GONE};
use crate::integrate::{Advance, bodies, joints};
use crate::interact::contacts::{self, Solid, Surfaces};
use crate::interact::kept::{Kept, Reach};
use crate::interact::neighbours::{NeighbourChunk, with_scratch};
use crate::interact::{CHUNK, density, forces};
use crate::model::{CONTACT_SKIN, Model};
use crate::state::{Kind, State, Touch};
use fearless_simd::dispatch;
use rayon::prelude::*;
use std::sync::atomic::Ordering::Relaxed;

/// Contacts of bodies, over steps.
#[derive(Debug)]
pub(super) struct Contacts {
    kept: Kept,
    /// Whether the lists hold for the bodies as they stand.
    hold: bool,
    /// How much farther than contacts the lists reach at most, in contact diameters.
    pub skin: f64,
    /// How much farther new ones are to reach (m).
    farther: f64,
    found: Vec<NeighbourChunk>,
    /// What contacts know of each body, and how near those are that matter now (m).
    pub solid: Vec<Solid>,
    pub reach: Reach,
    /// Chunks of rigid and static particles in which nothing but contacts is felt, and of how many particles.
    clean: [(usize, Vec<bool>); 2],
}

/// Lists are to last so many steps, and reach as much farther for it; so many contact diameters at least.
const LASTING: f64 = 40.0;
const LEAST_SKIN: f64 = 0.05;

impl Default for Contacts {
    fn default() -> Self {
        Self {
            kept: Kept::default(),
            hold: false,
            skin: CONTACT_SKIN,
            farther: 0.0,
            found: Default::default(),
            solid: Vec::new(),
            reach: Reach::default(),
            clean: Default::default(),
        }
    }
}

impl Contacts {
    /// The same for another state.
    pub fn anew(&self) -> Self {
        Self { skin: self.skin, ..Self::default() }
    }

    /// How far lists reach that are made now.
    pub fn list_reach(&self) -> Reach {
        self.reach.and(self.farther)
    }

    /// What stands in the state was changed from outside.
    pub fn forget(&mut self) {
        self.clean = Default::default();
    }
}

/// Rigid and static: the kinds that have slots.
const KINDS: [Kind; 2] = [Kind::Rigid, Kind::Static];

/// Whether nothing but contacts asks where bodies' particles stand in the order of cells.
fn alone(model: &Model) -> bool {
    model.fluids.is_empty() && model.flocks.is_empty()
}

/// Whether particles of bodies that touch nothing may feel something.
fn wet(model: &Model) -> bool {
    !alone(model) || !model.fields.is_empty()
}

impl Cpu {
    /// Part of the stage `cells`: sorts the particles of rigid bodies, or lets them take their new places in the old order.
    pub(super) fn sort_bodies(&mut self, model: &Model, advance: Advance) {
        self.look_at_bodies(model, advance.part());
        if self.contacts.hold && alone(model) {
            let State { particles: p, bodies: b, .. } = &mut self.state;
            let range = p.first[Kind::Rigid as usize]..p.first[Kind::Rigid as usize] + b.rigid_slots;
            let id = p.id[range.clone()].par_chunks(CHUNK);
            p.record[range].par_chunks_mut(CHUNK).zip(id).for_each(|(records, id)| {
                records.iter_mut().zip(id).for_each(|(record, &slot)| *record = b.record[slot as usize]);
            });
        } else {
            self.copy_bodies(&model.grid, Kind::Rigid);
        }
    }

    /// Looks at bodies as they are now, for contacts in a step of `dt` (s): what laws ask of them, how near pairs matter, and whether the
    /// lists still hold.
    pub(super) fn look_at_bodies(&mut self, model: &Model, dt: f64) {
        let Contacts { kept, solid, reach, hold, skin, farther, .. } = &mut self.contacts;
        let b = &self.state.bodies;
        solid.resize(b.body.len(), Solid::default());
        let all = b.body.par_iter().zip(&model.contacts).zip(&self.body_radius).zip(solid).with_min_len(64).enumerate();
        let seen = all.map(|(k, (((body, contact), radius), solid))| {
            *solid = Solid::of(body, contact);
            // of what moves, the speed of points of contact
            let speed = body.v.length() + body.omega.length() * (f64::from(*radius) + model.contact_reach());
            [speed, kept.moved(b, k, *radius, &model.grid)]
        });
        let [fastest, moved] = seen.reduce(|| [0.0; 2], |a, b| [a[0].max(b[0]), a[1].max(b[1])]);
        *reach = Reach::new(model, fastest, dt);
        *hold = kept.hold(moved, *reach);
        // what hardly moves needs few candidates
        *farther =
            (2.0 * LASTING * fastest * dt).max(LEAST_SKIN * model.contact_diameter).min(*skin * model.contact_diameter);
    }

    /// Part of the stage `density`: fluid neighbours of bodies' particles, and lists of contacts where the old ones do not hold.
    pub(super) fn find_bodies(&mut self, model: &Model) {
        self.asleep.clear();
        self.asleep.extend(self.state.bodies.body.iter().map(|b| b.asleep));
        if !model.fluids.is_empty() {
            let mut found = std::mem::take(&mut self.neighbours);
            for kind in KINDS {
                self.search(model, kind, false, &mut found[kind as usize]);
            }
            self.neighbours = found;
        }
        if !self.contacts.hold {
            self.find_contacts(model);
        }
    }

    /// Lists of contacts of bodies that have just been sorted.
    fn find_contacts(&mut self, model: &Model) {
        let mut found = std::mem::take(&mut self.contacts.found);
        self.search(model, Kind::Rigid, true, &mut found);
        let State { particles: p, bodies: b, .. } = &mut self.state;
        let first = p.first[Kind::Rigid as usize];
        let place = |slot: usize| match self.place[slot].load(Relaxed) {
            GONE => None,
            at => Some(((at as usize - first) / CHUNK, (at as usize - first) % CHUNK)),
        };
        let reach = self.contacts.list_reach();
        self.contacts.kept.renew(model, reach, b, p, &found, &self.asleep, place);
        self.contacts.found = found;
        self.contacts.hold = true;
    }

    /// Neighbours of bodies' particles of a kind: each other for `contacts`, or else fluids.
    fn search(&self, model: &Model, kind: Kind, contacts: bool, chunks: &mut Vec<NeighbourChunk>) {
        let (around, level) = (self.around(model, contacts), self.level);
        let segment = self.state.particles.segment(kind);
        chunks.resize_with(segment.len().div_ceil(CHUNK), NeighbourChunk::default);
        chunks.par_iter_mut().with_max_len(1).enumerate().for_each(|(c, chunk)| {
            let first = segment.start + c * CHUNK;
            let members = first..(first + CHUNK).min(segment.end);
            with_scratch(|scratch| {
                dispatch!(level, simd => density::body_chunk(simd, scratch, around, kind, members, chunk));
            });
        });
    }

    /// Contacts of bodies as they stand now, without fluids: for the parts of a step.
    pub(super) fn touch_in_part(&mut self, model: &Model, part: Advance) {
        self.look_at_bodies(model, part.dt);
        if !self.contacts.hold {
            self.asleep.clear();
            self.asleep.extend(self.state.bodies.body.iter().map(|b| b.asleep));
            self.copy_bodies(&model.grid, Kind::Rigid);
            self.find_contacts(model);
        }
        self.calm();
        if !model.fields.is_empty() {
            self.push_slots(model, part, Kind::Rigid, false);
        }
        self.touch(model, part.dt);
    }

    /// Part of the stage `forces`: contacts of bodies in a step of `dt` (s).
    pub(super) fn touch(&mut self, model: &Model, dt: f64) {
        let b = &mut self.state.bodies;
        let Contacts { kept, solid, reach, .. } = &mut self.contacts;
        let mut rows = std::mem::take(&mut b.contacts.rows);
        let surfaces = Surfaces { solid, stirred: &self.stirred };
        let (bodies, level) = (&*b, self.level);
        let input = contacts::Input { model, bodies, surfaces, reach: *reach, dt: dt as f32 };
        let chunks = rows.par_iter_mut().zip(&mut kept.runs).with_max_len(1).enumerate();
        chunks.filter(|(_, (rows, _))| !rows.with.is_empty()).for_each(|(c, (rows, runs))| {
            with_scratch(|scratch| {
                let sifted = &mut scratch.sifted;
                dispatch!(level, simd => contacts::chunk(simd, &input, c * CHUNK, sifted, rows, runs));
            });
        });
        b.contacts.rows = rows;
    }

    /// Part of the stage `forces`: what the particles of a kind of body feel of fields and, with `fluids`, of fluids.
    pub(super) fn push_slots(&mut self, model: &Model, advance: Advance, kind: Kind, fluids: bool) {
        let p = &mut self.state.particles;
        let Contacts { solid, clean, .. } = &mut self.contacts;
        let (rigid_first, first) = (p.first[Kind::Rigid as usize], p.first[kind as usize]);
        let segment = first..first + p.count[kind as usize];
        let (of, clean) = &mut clean[usize::from(kind == Kind::Static)];
        if *of != segment.len() || !model.flocks.is_empty() {
            clean.clear();
        }
        *of = segment.len();
        clean.resize(segment.len().div_ceil(CHUNK), false);
        let input = forces::Input {
            model,
            records: &p.record,
            mirror: &self.mirror,
            gradient: &p.gradient,
            owner: &p.owner,
            first,
            particle_mass: &self.particle_mass,
            surfaces: Surfaces { solid, stirred: &self.stirred },
            gravity: model.gravity_at(advance.end()).as_vec3(),
            dt: advance.dt as f32,
            fastest: self.ledger.speed as f32,
        };
        let (level, dry) = (self.level, NeighbourChunk::default());
        let neighbours = if fluids && !model.fluids.is_empty() { &self.neighbours[kind as usize][..] } else { &[] };
        let fields = kind == Kind::Rigid && !model.fields.is_empty();
        let push = p.push[segment.clone()].par_chunks_mut(CHUNK);
        let touch = p.touch[segment.start - rigid_first..segment.end - rigid_first].par_chunks_mut(CHUNK);
        push.zip(touch).zip(clean).with_max_len(1).enumerate().for_each(|(c, ((push, touch), clean))| {
            let chunk = neighbours.get(c).unwrap_or(&dry);
            let first = first + c * CHUNK;
            if chunk.found || fields {
                *clean = false;
                let out = forces::OnBodies { push, touch };
                let input = forces::Input { first, ..input };
                dispatch!(level, simd => forces::bodies(simd, input, kind, chunk, out));
            } else if !*clean {
                push.fill([0.0; 3]);
                touch.fill(Touch::default());
                *clean = true;
            }
        });
    }

    /// Nobody is known yet to be touched by what moves.
    pub(super) fn calm(&mut self) {
        self.stirred.iter_mut().for_each(|s| *s.get_mut() = false);
    }

    /// Sums what bodies feel; unless `all`, rigid ones alone, who then feel contacts and fields alone.
    pub(super) fn bodies(&mut self, model: &Model, advance: Advance, all: bool) {
        let State { particles: p, bodies: b, .. } = &mut self.state;
        let kept = &self.contacts.kept;
        let (place, push, touch, first) = (&self.place, &p.push, &p.touch, p.first[Kind::Rigid as usize]);
        let anywhere = if all { wet(model) } else { !model.fields.is_empty() };
        let felt = anywhere.then_some(|slot: usize| match place[slot].load(Relaxed) {
            GONE => None,
            at => {
                let touch = &touch[at as usize - first];
                Some([push[at as usize], touch.fluid, touch.agents])
            }
        });
        let slots = 0..if all { b.record.len() } else { b.rigid_slots };
        let (gravity, contacts) = (model.gravity_at(advance.end()), |k: usize| kept.felt(k));
        // counted: those that begin to be so deep in others, or so fast, that they could pass
        self.ledger.fast_contacts +=
            bodies::sum(b, &mut self.parts, slots, felt, contacts, gravity, model.dimensions, |body, before| {
                let far = body.contacts > 0 && body.v.length() * advance.dt > 0.5 * model.contact_diameter;
                body.deep |= far && !body.is_static();
                u64::from(body.deep && !before && !body.is_static())
            });
        joints::springs(b, model);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Source;
    use crate::{Scene, World, state_hash};

    /// A heap of bricks that falls and falls asleep, a paddle that turns in it, a periodic axis, and a ball that is shot into it.
    const HEAP: &str = "[domain]\nmin = [0, 0, 0]\nmax = [0.6, 0.3, 0.8]\nwalls = [\"solid\", \"periodic\", \"solid\"]\n\
        [resolution]\nspacing = 0.02\n\
        [[rigid]]\nshape = { box = { min = [-0.03, -0.03, -0.03], max = [0.03, 0.03, 0.03] } }\ndensity = 500\n\
        position = [0.1, 0.05, 0.1]\ncopies = { count = 36, grid = { columns = [6, 3], step = [0.08, 0.08, 0.08] }, tumble = true }\n\
        [[rigid]]\nshape = { points = [[0, 0, 0]] }\nmass = 0.3\nposition = [0.05, 0.15, 0.6]\nvelocity = [9, 1, -8]\n\
        [[static]]\nshape = { box = { min = [0.2, 0.13, 0.2], max = [0.4, 0.17, 0.24] } }\n\
        motion = { rotation = { axis = [0, 1, 0], center = [0.3, 0.15, 0.22], rate = 3 } }\n";

    /// Bits of the state after so many steps with lists that reach farther by so many contact diameters.
    fn hash(text: &str, skin: f64, steps: usize) -> u64 {
        let source = Source { name: "heap".into(), text: text.into(), ..Source::default() };
        let cpu = Cpu { contacts: Contacts { skin, ..Contacts::default() }, ..Cpu::default() };
        let mut world = World::on(Box::new(cpu), Scene::parse(source, &[]).unwrap().assemble().unwrap());
        for _ in 0..steps {
            world.step(f64::INFINITY);
        }
        assert!(world.state().bodies.body.iter().any(|b| b.contacts > 0));
        state_hash(world.state())
    }

    /// Lists made for each step and lists that are kept as long as they hold tell the same to the last bit.
    #[test]
    fn kept_lists_miss_nothing() {
        let pond = |solver: &str| {
            format!(
                "{HEAP}[[fluid]]\nshape = {{ box = {{ min = [0, 0, 0], max = [0.6, 0.3, 0.06] }} }}\n[solver]\npressure = \"{solver}\"\n"
            )
        };
        let dry = format!("{HEAP}[solver]\nsleep = 0.05\n");
        for (text, steps) in [(dry, 600), (pond("wcsph"), 60), (pond("dfsph"), 30), (pond("pbf"), 30)] {
            let anew = hash(&text, 0.0, steps);
            for skin in [0.05, CONTACT_SKIN] {
                assert_eq!(hash(&text, skin, steps), anew, "a skin of {skin} changes results");
            }
        }
    }
}
