//! Lines where particles were: a few hundred of them, each with its past.

use crate::color::Map;
use crate::{Frame, Line};
use glam::Vec3;
use jetsam::state::Kind;
use std::collections::{HashMap, VecDeque};

/// Particles that are followed, about, and places remembered of each.
const FOLLOWED: usize = 400;
const MEMORY: usize = 48;

/// The pasts of some particles.
#[derive(Default)]
pub struct Trails {
    time: f64,
    past: HashMap<u32, VecDeque<Vec3>>,
}

impl Trails {
    /// Remembers where particles are; forgets all when time has gone back.
    pub fn note(&mut self, frame: &Frame) {
        if frame.time < self.time {
            self.past.clear();
        }
        if frame.time == self.time && !self.past.is_empty() {
            return;
        }
        self.time = frame.time;
        let fluid = frame.segment(Kind::Fluid);
        let every = (fluid.len() / FOLLOWED).max(1) as u32;
        let mut seen = HashMap::new();
        for i in fluid.filter(|&i| frame.tag[i][0].is_multiple_of(every)) {
            let id = frame.tag[i][0];
            let mut past = self.past.remove(&id).unwrap_or_default();
            past.push_back(frame.record[i].x.into());
            if past.len() > MEMORY {
                past.pop_front();
            }
            seen.insert(id, past);
        }
        self.past = seen;
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.past.clear();
    }

    /// The lines: what is longer than `jump` (m) is a particle that came back by a periodic side.
    pub fn lines(&self, jump: f32) -> Vec<Line> {
        let mut lines = Vec::new();
        for past in self.past.values() {
            for (k, (a, b)) in past.iter().zip(past.iter().skip(1)).enumerate() {
                if a.distance(*b) < jump {
                    let age = k as f32 / past.len() as f32;
                    lines.push(Line { from: *a, to: *b, color: Map::Magma.at(0.25 + 0.6 * age) });
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

    #[test]
    fn a_trail_follows_its_particle_wherever_it_is_sorted() {
        let mut trails = Trails::default();
        for k in 0..5 {
            let at = |id: u32| Record { x: [id as f32, k as f32, 0.0], ..Record::default() };
            let order = if k % 2 == 0 { [0, 1] } else { [1, 0] };
            trails.note(&Frame {
                time: f64::from(k),
                record: order.map(at).into(),
                tag: order.map(|id| [id, 0]).into(),
                count: [2, 0, 0],
                ..Frame::default()
            });
        }
        let lines = trails.lines(1.5);
        assert_eq!(lines.len(), 8);
        assert!(lines.iter().all(|l| l.from.x == l.to.x && (l.to.y - l.from.y) == 1.0));
        assert!(trails.lines(0.5).is_empty());
    }
}
