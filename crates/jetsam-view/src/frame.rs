//! What a picture shows of a world at one moment: plain copies, so that the world may run on.

use glam::{DQuat, DVec3};
use jetsam::World;
use jetsam::state::{Kind, Record};

/// A moment of a world. Particle arrays are indexed alike, kind by kind, without gaps, in the layout that the GPU reads.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    /// Simulated time (s).
    pub time: f64,
    /// Place, volume, velocity and pressure share of each living particle.
    pub record: Vec<Record>,
    /// Acceleration (m/s^2): force on the particle over its mass; and, last, relative density (1 for bodies).
    pub push: Vec<[f32; 4]>,
    /// Identity, and index of the fluid or body.
    pub tag: Vec<[u32; 2]>,
    /// First particle of each kind.
    pub first: [u32; Kind::COUNT],
    /// Particles of each kind.
    pub count: [u32; Kind::COUNT],
    /// Centre of mass (m) and orientation of each body.
    pub poses: Vec<(DVec3, DQuat)>,
    /// Agents, flock by flock.
    pub agents: Vec<Record>,
    /// Identity of each agent; empty where particles are lent.
    pub agent_id: Vec<u32>,
    /// The particles, where they are on a device already: the arrays above are empty then.
    #[cfg(feature = "gpu")]
    pub lent: Option<jetsam::backend::OnDevice>,
}

impl Frame {
    /// The present moment of a world.
    pub fn of(world: &World) -> Self {
        let mut frame = Self::default();
        frame.take(world);
        frame
    }

    /// The present moment as far as it has to come home: particles stay on the device where they are on one.
    #[cfg(feature = "gpu")]
    pub fn borrow(&mut self, world: &World) {
        let (Some(lent), Some((bodies, agents))) = (world.on_device(), world.movers()) else {
            return self.take(world);
        };
        self.time = world.time();
        self.record.clear();
        self.push.clear();
        self.tag.clear();
        (self.first, self.count) = ([0; 3], [0; 3]);
        self.poses = bodies.iter().map(|b| (b.x, b.q)).collect();
        self.agents = agents;
        self.agent_id.clear();
        self.lent = Some(lent);
    }

    /// The same as [`Frame::of`], in the memory of an earlier moment.
    pub fn take(&mut self, world: &World) {
        #[cfg(feature = "gpu")]
        {
            self.lent = None;
        }
        let state = world.state();
        let p = &state.particles;
        self.time = world.time();
        self.record.clear();
        self.push.clear();
        self.tag.clear();
        let mut forces = state.forces_on_bodies();
        for kind in Kind::ALL {
            let range = p.segment(kind);
            self.first[kind as usize] = self.record.len() as u32;
            self.count[kind as usize] = range.len() as u32;
            self.record.extend_from_slice(&p.record[range.clone()]);
            let bodies = &state.bodies.body;
            self.push.extend(range.clone().map(|i| {
                if kind == Kind::Fluid {
                    let [x, y, z] = p.push[i];
                    return [x, y, z, p.density[i]];
                }
                // force over the particle's part of the body's mass
                let body = &bodies[p.owner[i] as usize];
                let share = (body.slots.len() as f64 / body.mass) as f32;
                let [x, y, z] = forces.next().unwrap_or_default().map(|f| share * f);
                [x, y, z, 1.0]
            }));
            self.tag.extend(range.map(|i| [p.id[i], p.owner[i]]));
        }
        self.poses.clear();
        self.poses.extend(state.bodies.body.iter().map(|b| (b.x, b.q)));
        self.agents.clone_from(&state.agents.record);
        self.agent_id.clone_from(&state.agents.id);
    }

    /// Range of a kind in the particle arrays.
    pub fn segment(&self, kind: Kind) -> std::ops::Range<usize> {
        let first = self.first[kind as usize] as usize;
        first..first + self.count[kind as usize] as usize
    }
}
