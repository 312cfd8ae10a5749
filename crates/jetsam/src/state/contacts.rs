//! Contacts of particles of different bodies, over steps: which may touch, how far each has slipped, its force.

use crate::interact::CHUNK;
use glam::Vec3;

/// Set in [`Rows::with`] for a pair of which one has a face: it is felt beside the normal, and so from farther off.
pub(crate) const FACED: u32 = 1 << 31;
/// Set for a pair that was felt at the last step: it has a force, or has slipped.
pub(crate) const LIVE: u32 = 1 << 30;
/// What is left is the slot.
pub(crate) const SLOT: u32 = LIVE - 1;

/// Pairs of slots of different bodies that may touch, each once: in the row of the lower slot, but of two of which only that one sleeps
/// in the row of the other. Written by density (which pairs there are) and forces.
#[derive(Clone, Debug, Default)]
pub struct Contacts {
    /// Chunk by chunk of rigid slots.
    pub(crate) rows: Vec<Rows>,
}

/// Contacts of a chunk of slots, row by row, in the order of the other's slot.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    /// Where the row of each slot begins, and where the last one ends.
    pub begin: Vec<u32>,
    /// Slot of the other, and [`FACED`], [`LIVE`].
    pub with: Vec<u32>,
    /// Slip (m) of the other relative to the row's particle (E13): how far friction holds.
    pub slip: Vec<[f32; 3]>,
    /// Force on the row's particle (N); the other feels the opposite.
    pub force: Vec<[f32; 3]>,
    /// Whether some pair stands in the row of its higher slot.
    pub turned: bool,
}

impl Rows {
    /// Forgets all.
    pub fn clear(&mut self) {
        self.begin.clear();
        self.with.clear();
        self.slip.clear();
        self.force.clear();
        self.turned = false;
    }

    /// Adds a pair to the last row.
    pub fn push(&mut self, with: u32, slip: [f32; 3]) {
        self.with.push(with);
        self.slip.push(slip);
        self.force.push([0.0; 3]);
    }

    /// The row of the chunk's slot number `k`.
    #[inline(always)]
    pub fn row(&self, k: usize) -> std::ops::Range<usize> {
        match self.begin.get(k..k + 2) {
            Some(ends) => ends[0] as usize..ends[1] as usize,
            None => 0..0,
        }
    }

    /// Where the pair with a slot stands, if it was felt.
    pub fn find(&self, k: usize, other: u32) -> Option<usize> {
        self.row(k).find(|&at| self.with[at] & SLOT == other && self.with[at] & LIVE != 0)
    }
}

impl Contacts {
    /// Contacts of so many rigid slots that have slipped, each once: slots, and the slip (m) of the second relative to the first.
    pub fn new(slots: usize, slipped: impl IntoIterator<Item = ([u32; 2], [f32; 3])>) -> Self {
        let lower = |(slots, slip): ([u32; 2], [f32; 3])| match slots {
            [a, b] if a < b => ([a, b], slip),
            [a, b] => ([b, a], slip.map(|x| -x)),
        };
        let mut all: Vec<_> = slipped.into_iter().map(lower).collect();
        all.sort_unstable_by_key(|(slots, _)| *slots);
        let mut all = all.into_iter().peekable();
        let chunk = |c: usize| {
            let mut rows = Rows::default();
            for slot in c * CHUNK..slots.min((c + 1) * CHUNK) {
                rows.begin.push(rows.with.len() as u32);
                while let Some(([_, other], slip)) = all.next_if(|([own, _], _)| *own as usize == slot) {
                    rows.push(other | LIVE, slip);
                }
            }
            rows.begin.push(rows.with.len() as u32);
            rows
        };
        Self { rows: (0..slots.div_ceil(CHUNK)).map(chunk).collect() }
    }

    /// All contacts that have slipped: slots, the lower first, and the slip (m) of the higher relative to the lower.
    pub fn slipped(&self) -> impl Iterator<Item = ([u32; 2], [f32; 3])> {
        self.all().filter(|(_, rows, at)| rows.with[*at] & LIVE != 0 && rows.slip[*at] != [0.0; 3]).map(
            |(own, rows, at)| {
                let (other, slip) = (rows.with[at] & SLOT, rows.slip[at]);
                if own < other { ([own, other], slip) } else { ([other, own], slip.map(|x| -x)) }
            },
        )
    }

    /// Slots of all pairs that feel each other, the lower first.
    pub fn touching(&self) -> impl Iterator<Item = [u32; 2]> {
        self.all().filter(|(_, rows, at)| rows.force[*at] != [0.0; 3]).map(|(own, rows, at)| {
            let other = rows.with[at] & SLOT;
            [own.min(other), own.max(other)]
        })
    }

    /// The slip (m) of the particle in slot `b` relative to that in slot `a`, if they are in contact.
    pub fn slip(&self, a: u32, b: u32) -> Option<[f32; 3]> {
        let seen = |own: u32, other: u32| {
            let rows = self.rows.get(own as usize / CHUNK)?;
            rows.find(own as usize % CHUNK, other).map(|at| rows.slip[at])
        };
        seen(a, b).or_else(|| seen(b, a).map(|slip| slip.map(|x| -x)))
    }

    /// Adds the forces (N) to those on the particles of both bodies, slot by slot; `asleep` ones feel nothing.
    pub(crate) fn push(&self, force: &mut [Vec3], asleep: impl Fn(usize) -> bool) {
        for (own, rows, at) in self.all() {
            let f = Vec3::from(rows.force[at]);
            let pair = [own as usize, (rows.with[at] & SLOT) as usize];
            let [a, b] = pair.map(&asleep);
            if !(a && b) {
                force[pair[0]] += if a { Vec3::ZERO } else { f };
                force[pair[1]] -= if b { Vec3::ZERO } else { f };
            }
        }
    }

    /// All pairs: slot of the row, chunk, place there.
    fn all(&self) -> impl Iterator<Item = (u32, &Rows, usize)> {
        self.rows.iter().enumerate().flat_map(|(c, rows)| {
            let slots = rows.begin.len().saturating_sub(1);
            (0..slots).flat_map(move |k| rows.row(k).map(move |at| ((c * CHUNK + k) as u32, rows, at)))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What was told of slips is told back, whoever asks.
    #[test]
    fn slips_have_two_sides() {
        let told = [([7, 3], [1.0, 0.0, 0.0]), ([3, 900], [0.0, 2.0, 0.0]), ([600, 4000], [0.0, 0.0, 3.0])];
        let contacts = Contacts::new(1000, told);
        for ([a, b], slip) in told {
            assert_eq!(contacts.slip(a, b), Some(slip));
            assert_eq!(contacts.slip(b, a), Some(slip.map(|x| -x)));
        }
        assert_eq!((contacts.slip(3, 8), contacts.slip(4000, 5000)), (None, None));
        let again = Contacts::new(1000, contacts.slipped());
        assert!(again.slipped().eq(contacts.slipped()));
        assert_eq!(again.slipped().map(|(slots, _)| slots).collect::<Vec<_>>(), [[3, 7], [3, 900], [600, 4000]]);
    }
}
