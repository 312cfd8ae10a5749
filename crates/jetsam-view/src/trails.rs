//! Lines where things were: a few hundred particles of fluid and agents, each with its past.

use crate::color::Map;
use crate::lines::every;
use crate::{Frame, Line, Show};
use glam::Vec3;
use jetsam::state::Kind;
use std::collections::{BTreeMap, VecDeque};

/// Places remembered of each.
const MEMORY: usize = 48;

/// The pasts of some particles and agents.
#[derive(Debug, Default)]
pub struct Trails {
    time: f64,
    /// By whether it is an agent, and its identity.
    past: BTreeMap<(bool, u32), VecDeque<Vec3>>,
}

impl Trails {
    /// Remembers where things are; forgets all when time has gone back.
    pub fn note(&mut self, frame: &Frame) {
        if frame.time < self.time {
            self.past.clear();
        }
        if frame.time == self.time && !self.past.is_empty() {
            return;
        }
        self.time = frame.time;
        let fluid = frame.segment(Kind::Fluid);
        let particle = every(fluid.len());
        let particles = fluid.map(|i| ((false, frame.tag[i][0]), Vec3::from(frame.record[i].x)));
        let agent = every(frame.agents.len());
        let agents = frame.agent_id.iter().zip(&frame.agents).map(|(id, r)| ((true, *id), Vec3::from(r.x)));
        let followed = particles.filter(|((_, id), _)| id.is_multiple_of(particle));
        let mut seen = BTreeMap::new();
        for (who, place) in followed.chain(agents.filter(|((_, id), _)| id.is_multiple_of(agent))) {
            let mut past = self.past.remove(&who).unwrap_or_default();
            past.push_back(place);
            if past.len() > MEMORY {
                past.pop_front();
            }
            seen.insert(who, past);
        }
        self.past = seen;
    }

    /// The lines, brighter the younger. Where something came back by a periodic side there is a gap.
    pub fn lines(&self, show: &Show) -> Vec<Line> {
        let half = 0.5 * (show.bounds[1] - show.bounds[0]);
        let passed = |a: Vec3, b: Vec3| (0..3).any(|k| show.periodic[k] && (b[k] - a[k]).abs() > half[k]);
        let mut lines = Vec::new();
        for past in self.past.values() {
            for (k, (&a, &b)) in past.iter().zip(past.iter().skip(1)).enumerate() {
                if !passed(a, b) {
                    let age = k as f32 / past.len() as f32;
                    lines.push(Line { from: a, to: b, color: Map::Magma.at(0.25 + 0.6 * age) });
                }
            }
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use jetsam::state::Record;
    use jetsam::{Scene, World};

    #[test]
    fn a_trail_follows_its_particle_wherever_it_is_sorted() {
        let scene = Scene::open("dam-break", &["resolution.spacing=0.1".into()]).unwrap();
        let show = Show::new(&scene, &World::from_scene(&scene).unwrap(), 1.0);
        let show = Show { bounds: [Vec3::ZERO, Vec3::splat(4.5)], periodic: [false, true, false], ..show };
        let mut trails = Trails::default();
        for k in 0..6 {
            // in the last moment they are back at the beginning
            let at = |id: u32| Record { x: [id as f32, (k % 5) as f32, 0.0], ..Record::default() };
            let order = if k % 2 == 0 { [0, 1] } else { [1, 0] };
            trails.note(&Frame {
                time: f64::from(k),
                record: order.map(at).into(),
                tag: order.map(|id| [id, 0]).into(),
                count: [2, 0, 0],
                agents: order.map(at).into(),
                agent_id: order.into(),
                ..Frame::default()
            });
        }
        let lines = trails.lines(&show);
        assert_eq!(lines.len(), 16);
        assert!(lines.iter().all(|l| l.from.x == l.to.x && (l.to.y - l.from.y) == 1.0));
        assert_eq!(trails.lines(&Show { periodic: [false; 3], ..show }).len(), 20);
    }
}
