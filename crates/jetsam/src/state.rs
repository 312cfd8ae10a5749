//! What changes while a world runs: particles (structure of arrays, one set for every kind) and bodies.
//!
//! Particles live in three segments of the same arrays, one per [`Kind`]; inside a segment they are sorted by
//! cell, ties by id, by the stage `cells`. Each array says which stage writes it.

mod contacts;

pub use contacts::Contacts;
pub(crate) use contacts::{FACED, LIVE, Rows, SLOT};

use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DQuat, DVec3, Vec3};
use std::ops::Range;

/// What a particle belongs to. The kind decides which laws apply (see [`crate::laws`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(usize)]
pub enum Kind {
    /// Free particles of a fluid.
    Fluid = 0,
    /// Particles of a rigid body.
    Rigid = 1,
    /// Particles of walls and static bodies.
    Static = 2,
}

impl Kind {
    /// All kinds, in the order of their segments.
    pub const ALL: [Kind; 3] = [Kind::Fluid, Kind::Rigid, Kind::Static];
    /// How many kinds there are.
    pub const COUNT: usize = 3;
}

/// What every pair of neighbours reads: 32 bytes, one load on wide machines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C, align(32))]
pub struct Record {
    /// Position (m). Written by drift.
    pub x: [f32; 3],
    /// Rest volume `V` (m^3; m^2 in 2D). Constant.
    pub volume: f32,
    /// Velocity (m/s): predicted to the step's end between drift and kick. Written by drift and kick.
    pub v: [f32; 3],
    /// Pressure share `p / D^2` (Pa). Written by pressure (fluid; DFSPH: by divergence) and boundary (bodies; 0 with implicit pressure).
    pub share: f32,
}

/// Of what the force on a particle of a body consists, contacts aside. Written by forces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Touch {
    /// Force by fluids (N).
    pub fluid: [f32; 3],
    /// Force by agents of flocks (N). Written by agents.
    pub agents: [f32; 3],
}

/// All particles. Arrays are indexed alike; `segment` tells which range belongs to a kind.
#[derive(Clone, Debug, Default)]
pub struct Particles {
    /// What pairs read. Permuted by cells.
    pub record: Vec<Record>,
    /// Fluid: acceleration (m/s^2). Bodies' particles: force (N); on the CPU without that of contacts, see [`State::forces_on_bodies`].
    /// Written by forces.
    pub push: Vec<[f32; 3]>,
    /// Acceleration of the step before (m/s^2), fluid only. Kept by cells for the kick.
    pub push_before: Vec<[f32; 3]>,
    /// Relative density `D = rho / rho_0`, fluid only. Written by density, or where it is integrated by drift and kick.
    pub density: Vec<f32>,
    /// Of what the forces on bodies' particles consist, from the first rigid particle on. Written by forces.
    pub touch: Vec<Touch>,
    /// What continuity (E1) remembers, fluid only; empty where densities are summed. `dD/dt` one and two steps ago (1/s), written by
    /// drift; with implicit pressure what the sum lacked and 1, before that is known the density it began with and 0, written by density.
    pub rate: Vec<[f32; 2]>,
    /// Velocity added by XSPH and shifting (m/s) and, last, `dD/dt` now (1/s), fluid only; empty when none of them is on.
    /// Written by forces.
    pub carry: Vec<[f32; 4]>,
    /// Colour gradient times `H` and, last, `|curl v|` (1/s), fluid only; empty where neither is asked for. Written by gradients.
    pub gradient: Vec<[f32; 4]>,
    /// `curl v` (1/s), written by gradients; then the acceleration of vorticity confinement (m/s^2), written by forces.
    /// Fluid only; empty as `gradient`.
    pub vorticity: Vec<[f32; 3]>,
    /// When a particle was born (s), fluid only; empty where no fluid has a lifetime. Written by sources, permuted by cells.
    pub born: Vec<f32>,
    /// Fluid: identity, counted over all fluids from 0. Bodies: slot in [`Bodies`]. Permuted by cells.
    pub id: Vec<u32>,
    /// Index of the fluid or of the body the particle belongs to. Permuted by cells.
    pub owner: Vec<u32>,
    /// First index of each kind's segment.
    pub first: [usize; Kind::COUNT],
    /// Living particles of each kind's segment. Fluid shrinks when particles leave (cells).
    pub count: [usize; Kind::COUNT],
}

impl Particles {
    /// The living particles of a kind.
    pub fn segment(&self, kind: Kind) -> Range<usize> {
        let first = self.first[kind as usize];
        first..first + self.count[kind as usize]
    }

    /// The first identity that no fluid particle has had, as far as the living show.
    pub fn next_id(&self) -> u32 {
        self.id[self.segment(Kind::Fluid)].iter().max().map_or(0, |id| id + 1)
    }

    /// Adds a fluid particle born at `time` (s). Where there is no place left, the segment is enlarged by half: the segments of bodies
    /// move up, and their particles must be copied anew.
    pub fn append(&mut self, record: Record, id: u32, owner: u32, time: f64) {
        let at = self.count[Kind::Fluid as usize];
        if at == self.first[Kind::Rigid as usize] {
            self.grow((at / 2).max(1024));
        }
        self.record[at] = record;
        self.id[at] = id;
        self.owner[at] = owner;
        self.push[at] = [0.0; 3];
        self.push_before[at] = [0.0; 3];
        self.density[at] = 1.0;
        if let Some(rate) = self.rate.get_mut(at) {
            *rate = [0.0, 1.0]; // what is born lacks nothing: more comes behind it
        }
        if let Some(carry) = self.carry.get_mut(at) {
            *carry = [0.0; 4];
        }
        if let Some(born) = self.born.get_mut(at) {
            *born = time as f32;
        }
        self.count[Kind::Fluid as usize] += 1;
    }

    /// Makes room for more fluid particles: the segments of bodies move up.
    pub fn grow(&mut self, more: usize) {
        let (old, total) = (self.first[Kind::Rigid as usize], self.record.len() + more);
        self.record.resize(total, Record::default());
        self.push.resize(total, [0.0; 3]);
        self.id.resize(total, 0);
        self.owner.resize(total, 0);
        let end = total - more;
        self.record.copy_within(old..end, old + more);
        self.push.copy_within(old..end, old + more);
        self.id.copy_within(old..end, old + more);
        self.owner.copy_within(old..end, old + more);
        let capacity = old + more;
        self.push_before.resize(capacity, [0.0; 3]);
        self.density.resize(capacity, 1.0);
        if !self.born.is_empty() {
            self.born.resize(capacity, 0.0);
        }
        if !self.gradient.is_empty() {
            self.gradient.resize(capacity, [0.0; 4]);
            self.vorticity.resize(capacity, [0.0; 3]);
        }
        if !self.rate.is_empty() {
            self.rate.resize(capacity, [0.0; 2]);
        }
        if !self.carry.is_empty() {
            self.carry.resize(capacity, [0.0; 4]);
        }
        self.first[Kind::Rigid as usize] += more;
        self.first[Kind::Static as usize] += more;
    }

    /// Number of living particles of all kinds.
    pub fn len(&self) -> usize {
        self.count.iter().sum()
    }

    /// Whether there is no particle.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A rigid or static body. Double precision: bodies are few, and a falling body must fall exactly.
#[derive(Clone, Debug)]
pub struct Body {
    /// Name from the scene; copies carry a number.
    pub name: String,
    /// Mass (kg; kg/m in 2D). Infinite for static bodies.
    pub mass: f64,
    /// Inverse of the inertia tensor about the centre of mass in the body's own axes (1/(kg m^2)); zero if static.
    pub inverse_inertia: DMat3,
    /// Slots of the body's particles.
    pub slots: Range<usize>,
    /// Centre of mass (m).
    pub x: DVec3,
    /// Velocity (m/s).
    pub v: DVec3,
    /// Velocity half a step before the present (m/s). Written by drift.
    pub v_half: DVec3,
    /// Orientation, body to world.
    pub q: DQuat,
    /// Angular momentum about the centre of mass, world axes (kg m^2/s).
    pub l: DVec3,
    /// Angular momentum half a step before the present. Written by drift.
    pub l_half: DVec3,
    /// Angular velocity (rad/s), `I^-1 L`.
    pub omega: DVec3,
    /// Force (N), gravity included. Written by bodies.
    pub force: DVec3,
    /// Torque about the centre of mass (N m). Written by bodies.
    pub torque: DVec3,
    /// Part of the force that fluids exert (N). Written by bodies.
    pub force_fluid: DVec3,
    /// Part of the force that other bodies and walls exert (N). Written by bodies.
    pub force_contact: DVec3,
    /// Part of the torque that fluids exert (N m). Written by bodies.
    pub torque_fluid: DVec3,
    /// Part of the torque that other bodies and walls exert (N m). Written by bodies.
    pub torque_contact: DVec3,
    /// Pairs of particles in contact with other bodies and walls. Written by bodies.
    pub contacts: u32,
    /// Contacts that share its load: the parts of its pairs, summed; 0 for what forces do not move. Written by bodies.
    pub sharers: f32,
    /// How long the body has been still (s); rises while it touches others and moves slowly. Written by kick.
    pub still: f64,
    /// Whether the body sleeps: it stays where it is until it is touched. Written by bodies and kick.
    pub asleep: bool,
    /// Whether some pair is so deep that it would pass through. Written by bodies.
    pub deep: bool,
    /// Whether fluids do not move the body, though it moves them.
    pub one_way: bool,
    /// Acceleration of a body that follows a script (m/s^2), else zero. Written by drift.
    pub acceleration: DVec3,
    /// Angular acceleration of a body that follows a script (rad/s^2), else zero. Written by drift.
    pub angular_acceleration: DVec3,
}

impl Body {
    /// Whether forces cannot move the body: it stands, or follows a script (E15).
    pub fn is_static(&self) -> bool {
        self.mass.is_infinite()
    }

    /// `I^-1` in world axes for the orientation `q`.
    pub fn inverse_inertia_at(&self, q: DQuat) -> DMat3 {
        let r = DMat3::from_quat(q);
        r * self.inverse_inertia * r.transpose()
    }
}

/// Bodies and, slot by slot, their particles: a body's slots are contiguous.
#[derive(Clone, Debug, Default)]
pub struct Bodies {
    /// Rigid bodies first, then bodies that follow scripts, static bodies after.
    pub body: Vec<Body>,
    /// Place of each slot in its body's frame, relative to the centre of mass (m). Constant.
    pub offset: Vec<DVec3>,
    /// Body of each slot. Constant.
    pub owner: Vec<u32>,
    /// What the slot's particle shows to pairs. Written by drift; rigid slots only, static ones are constant.
    pub record: Vec<Record>,
    /// Outward normal of each slot in its body's frame: length 1 inside a flat face, 2 inside a sheet, 0 elsewhere. Constant.
    pub normal: Vec<[f32; 3]>,
    /// The same in world axes. Written by drift; rigid slots only, static ones are constant.
    pub facing: Vec<[f32; 3]>,
    /// Contacts of their particles (E10-E13). Written by density and forces.
    pub contacts: Contacts,
    /// Impulse on bodies by joints to what forces do not move, in this step (N s). Written by drift and kick.
    pub joint_impulse: DVec3,
    /// Force on bodies by springs to what forces do not move (N). Written by bodies.
    pub joint_force: DVec3,
    /// Number of slots of rigid bodies; those of static bodies follow.
    pub rigid_slots: usize,
}

/// Agents of all flocks, flock by flock; inside a flock in the order of cells, ties by id.
#[derive(Clone, Debug, Default)]
pub struct Agents {
    /// Position and velocity; the other two numbers are not used. Written by agents.
    pub record: Vec<Record>,
    /// Identity, counted over all flocks from 0. Permuted by agents.
    pub id: Vec<u32>,
    /// What was decided: steering (m/s^2) of Reynolds' agents, else the velocity to come (m/s). Written by agents.
    pub next: Vec<[f32; 3]>,
    /// What rounding left over of each agent's position (m): the place is `x` less this. Written by agents.
    pub rest: Vec<[f32; 3]>,
    /// Force by fluids and bodies (N); empty where no flock has mass. Written by agents.
    pub force: Vec<[f32; 3]>,
    /// Time of each flock. Written by agents.
    pub clock: Vec<Clock>,
}

/// Time as a flock counts it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Clock {
    /// Time since the beginning (s).
    pub time: f64,
    /// Time until the next decision (s).
    pub wait: f64,
    /// Decisions made.
    pub decisions: u64,
}

/// The whole changing state of a world.
#[derive(Clone, Debug, Default)]
pub struct State {
    /// Particles of every kind.
    pub particles: Particles,
    /// Bodies.
    pub bodies: Bodies,
    /// Agents of flocks.
    pub agents: Agents,
}

impl State {
    /// Forces on the particles of bodies (N), contacts included: of rigid, then of static ones, in their order.
    pub fn forces_on_bodies(&self) -> impl Iterator<Item = [f32; 3]> {
        let (p, b) = (&self.particles, &self.bodies);
        let mut by_contacts = vec![Vec3::ZERO; b.owner.len()];
        b.contacts.push(&mut by_contacts, |slot| b.body[b.owner[slot] as usize].asleep);
        let all = p.segment(Kind::Rigid).chain(p.segment(Kind::Static));
        all.map(move |i| (Vec3::from(p.push[i]) + by_contacts[p.id[i] as usize]).to_array())
    }
}
