//! Neighbours of fluids with sixteen particles in the lanes: slot after slot, the next neighbour of each.
//!
//! In: neighbours of a chunk, particle by particle, as the search lists them. Out: the same, transposed. Sums over the neighbours of a particle
//! then stay in its lane, and only the most neighbours of the sixteen count, not whole vectors for each of them. What a lane has not
//! is filled with its own particle, at no distance from itself. Written by the stage `density`, read by all that follow.

use super::lanes::{Indices, LANES, Lanes, Near, Transposed, gather, transpose};
use super::neighbours::NeighbourChunk;
use crate::state::{Kind, Record};
use fearless_simd::Simd;
use std::ops::Range;

/// Neighbours of a chunk of fluid particles. Kept from step to step, so that nothing is allocated once sizes settle.
#[derive(Clone, Debug, Default)]
pub struct Slices {
    list: Vec<Indices>,
    used: usize,
    slices: Vec<Slice>,
    counts: Vec<[u16; Kind::COUNT]>,
    halo: Vec<[u32; 2]>,
    first: usize,
}

/// Where the neighbours of sixteen particles stand: begin, and end of each kind's.
#[derive(Clone, Copy, Debug)]
struct Slice([u32; Kind::COUNT + 1]);

impl Slices {
    /// Transposes the neighbours of particles from `first` on.
    #[inline(always)]
    pub fn set<S: Simd>(&mut self, simd: S, rows: &NeighbourChunk, first: usize) {
        let n = rows.runs.len();
        (self.used, self.first) = (0, first);
        self.slices.clear();
        self.counts.clear();
        self.counts.extend(rows.runs.iter().map(|runs| Kind::ALL.map(|kind| runs.count(kind) as u16)));
        for begin in (0..n).step_by(LANES) {
            let end = n.min(begin + LANES);
            let mut slice = Slice([self.used as u32; Kind::COUNT + 1]);
            for kind in Kind::ALL {
                let most = self.counts[begin..end].iter().map(|c| c[kind as usize]).max().unwrap_or(0) as usize;
                let room = self.used + most.next_multiple_of(LANES);
                if self.list.len() < room {
                    self.list.reserve_exact(room - self.list.len() + room / 32); // lists are most of a particle's memory
                    self.list.resize(room, Indices::default());
                }
                for from in (0..most).step_by(LANES) {
                    let block = self.list[self.used + from..].first_chunk_mut().expect("room made above");
                    for l in 0..LANES {
                        let k = (begin + l).min(end - 1);
                        let run = rows.runs[k].padded(kind);
                        block[l] = match rows.list()[run][..].as_chunks().0.get(from / LANES) {
                            Some(next) if begin + l < end => Indices(*next),
                            _ => Indices([(first + k) as u32; LANES]),
                        };
                    }
                    transpose(simd, block);
                }
                self.used += most;
                slice.0[kind as usize + 1] = self.used as u32;
            }
            self.slices.push(slice);
        }
        merge(&rows.among, &mut self.halo);
    }

    /// Number of neighbours that particle `k` of the chunk has; among fluids it counts itself.
    #[inline(always)]
    pub fn count(&self, k: usize, kind: Kind) -> usize {
        self.counts[k][kind as usize] as usize
    }

    /// Neighbours of particle `k` of the chunk, one by one.
    #[inline(always)]
    pub fn exact(&self, k: usize, kind: Kind) -> impl Iterator<Item = u32> + '_ {
        let begin = self.slices[k / LANES].0[kind as usize] as usize;
        self.list[begin..begin + self.count(k, kind)].iter().map(move |block| block.0[k % LANES])
    }

    /// Whether any of slice `s` has neighbours of a kind.
    #[inline(always)]
    pub fn has(&self, s: usize, kind: Kind) -> bool {
        !self.slots(s, kind).is_empty()
    }

    /// Slots of slice `s` for a kind.
    #[inline(always)]
    fn slots(&self, s: usize, kind: Kind) -> Range<usize> {
        let Slice(ends) = self.slices[s];
        ends[kind as usize] as usize..ends[kind as usize + 1] as usize
    }

    /// Slots of the chunk in all.
    pub fn room(&self) -> usize {
        self.used
    }

    /// Runs of particles, `[begin, end]` (the end is not in it), in their order, that hold all neighbours of fluids and rigid bodies.
    pub fn halo(&self) -> &[[u32; 2]] {
        &self.halo
    }

    /// Neighbours of a kind of slice `s`, slot by slot.
    #[inline(always)]
    pub fn run<'a>(&'a self, records: &'a [Record], s: usize, kind: Kind) -> impl Iterator<Item = Near<'a>> {
        self.list[self.slots(s, kind)].iter().map(move |block| Near { records, index: &block.0 })
    }

    /// Slices with the particles of the chunk that each is about.
    #[inline(always)]
    pub fn each(&self) -> impl Iterator<Item = (usize, Range<usize>)> + '_ {
        (0..self.slices.len()).map(|s| (s, LANES * s..self.counts.len().min(LANES * s + LANES)))
    }

    /// Indices of the particles of slice `s`; lanes that are left over repeat the last.
    #[inline(always)]
    pub fn members(&self, s: usize) -> [u32; LANES] {
        let mut out = [0; LANES];
        for l in 0..LANES {
            out[l] = (self.first + (LANES * s + l).min(self.counts.len() - 1)) as u32;
        }
        out
    }
}

/// Runs sorted and joined.
fn merge(runs: &[[u32; 2]], out: &mut Vec<[u32; 2]>) {
    out.clear();
    out.extend_from_slice(runs);
    out.sort_unstable();
    let mut last = 0;
    for k in 1..out.len() {
        if out[k][0] <= out[last][1] {
            out[last][1] = out[last][1].max(out[k][1]);
        } else {
            last += 1;
            out[last] = out[k];
        }
    }
    out.truncate(last + 1);
}

/// The particles on whose side pairs are summed: sixteen of a slice, or one in all lanes.
pub struct Own {
    /// Their indices.
    pub i: [u32; LANES],
    /// Their records.
    pub at: Transposed,
}

impl Own {
    /// The particles of a slice.
    #[inline(always)]
    pub fn slice<S: Simd>(simd: S, records: &[Record], slices: &Slices, s: usize) -> Self {
        let i = slices.members(s);
        let at = gather(simd, Near { records, index: &i });
        Self { i, at }
    }

    /// One particle.
    #[inline(always)]
    pub fn one(records: &[Record], i: usize) -> Self {
        let Record { x, volume, v, share } = records[i];
        let at = Transposed { x: splat(x), volume: [volume; LANES], v: splat(v), share: [share; LANES] };
        Self { i: [i as u32; LANES], at }
    }
}

/// A vector in all lanes.
#[inline(always)]
pub fn splat([x, y, z]: [f32; 3]) -> [Lanes; 3] {
    [[x; LANES], [y; LANES], [z; LANES]]
}
