//! What implicit solvers (E9) know of the neighbourhood of each fluid particle while they iterate.
//!
//! In: transposed neighbours, records. Out: [`Links`], the vectors `e_ij = V_j grad_i W_ij` to fluids and particles of bodies; a
//! [`Nodes`] for sixteen particles, with the sums of these vectors; for PBF, whose particles move while it iterates, densities anew ([`densities`]).
//! Walls do not answer: they are in the sums alone. Called by the stages `divergence` and `pressure`.
//!
//! Rounds wait for the links they read, and for the values of neighbours. So a link takes 8 bytes: its vector in whole numbers, and
//! where the neighbour stands among the values around the chunk, which a [`Table`] holds together.

use super::boundary::acceleration;
use super::density::weights;
use super::lanes::{LANES, Lanes, Near, axes, gather, listed, sum};
use super::neighbours::NeighbourChunk;
use super::pairs::wrap_lanes;
use super::slices::{Own, Slices, splat};
use crate::laws::implicit;
use crate::laws::kernel::{Kernel, each_kernel};
use crate::model::Model;
use crate::scene::Coupling;
use crate::state::{Body, Kind, Record};
use fearless_simd::prelude::*;
use fearless_simd::{f32x4, f32x16, i32x16};
use glam::Vec3;

/// A neighbour of each of sixteen fluid particles: 128 bytes.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub struct Link {
    /// `x` in the lower and `y` in the upper half, whole numbers of [`Links::unit`].
    xy: [i32; LANES],
    /// `z` in the upper half; in the lower the place of the neighbour in the table around the chunk.
    z_to: [i32; LANES],
}

impl Link {
    /// The vectors, in [`Links::unit`].
    #[inline(always)]
    pub fn e<S: Simd>(&self, simd: S) -> [f32x16<S>; 3] {
        let (xy, z) = (i32x16::load_array_ref(simd, &self.xy), i32x16::load_array_ref(simd, &self.z_to));
        [((xy << 16) >> 16).to_float(), (xy >> 16).to_float(), (z >> 16).to_float()]
    }

    /// Place of the neighbour of lane `l`.
    #[inline(always)]
    fn to(&self, l: usize) -> usize {
        (self.z_to[l] & 0xffff) as usize
    }

    /// Numbers of the neighbours.
    #[inline(always)]
    pub fn numbers<S: Simd>(&self, simd: S, table: &[f32; PLACES]) -> f32x16<S> {
        let four = |k: usize| {
            f32x4::load_array(
                simd,
                [table[self.to(k)], table[self.to(k + 1)], table[self.to(k + 2)], table[self.to(k + 3)]],
            )
        };
        four(0).combine(four(4)).combine(four(8).combine(four(12)))
    }

    /// Vectors of the neighbours, axis by axis.
    #[inline(always)]
    pub fn vectors<S: Simd>(&self, simd: S, table: &[[f32; 4]; PLACES]) -> [f32x16<S>; 3] {
        let row = |k: usize| f32x4::load_array_ref(simd, &table[self.to(k)]);
        let four = |k: usize| row(k).combine(row(k + 1)).combine(row(k + 2).combine(row(k + 3)));
        axes([four(0), four(4), four(8), four(12)])
    }
}

/// Links of a chunk of fluid particles, kept while a solver iterates. Their vectors are whole numbers of `unit`, the same for all
/// particles, that those of both sides of a pair stay opposite.
#[derive(Clone, Debug, Default)]
pub struct Links {
    /// What a component of a vector counts (1/m).
    pub unit: f32,
    links: Vec<Link>,
    used: usize,
    /// End of the links of each slice.
    ends: Vec<u32>,
    /// Runs of particles that the links lead to, `[begin, end]`, and what to take from an index to find its place.
    halo: Vec<[u32; 3]>,
}

/// How many places a table has. Around a chunk of 512 particles there are some 3,000 others; of more than this, hundreds of times what rest
/// would hold, the rest are taken for the last.
pub const PLACES: usize = 1 << 16;

/// Values of the particles around a chunk, those of a run one after another: scratch of a thread.
#[derive(Default)]
pub struct Table {
    numbers: Vec<f32>,
    vectors: Vec<[f32; 4]>,
}

impl Table {
    /// Numbers around a chunk.
    #[inline(always)]
    pub fn numbers(&mut self, links: &Links, of: &[f32]) -> &[f32; PLACES] {
        links.collect(of, &mut self.numbers)
    }

    /// Vectors around a chunk.
    #[inline(always)]
    pub fn vectors(&mut self, links: &Links, of: &[[f32; 4]]) -> &[[f32; 4]; PLACES] {
        links.collect(of, &mut self.vectors)
    }
}

impl Links {
    /// Forgets everything, and makes room for the links of a chunk, with vectors whose components are no larger than `largest`.
    #[inline(always)]
    fn clear(&mut self, slices: &Slices, largest: f32) {
        if self.links.len() < slices.room() {
            self.links.resize(slices.room(), Link::default());
        }
        self.unit = largest / f32::from(i16::MAX);
        self.used = 0;
        self.ends.clear();
        self.halo.clear();
        let mut places = 0;
        for &[begin, end] in slices.halo() {
            self.halo.push([begin, end, begin.wrapping_sub(places)]);
            places += end - begin;
        }
    }

    /// Adds a neighbour to each of sixteen particles, and rounds the vectors to what is kept of them.
    #[inline(always)]
    fn push(&mut self, index: &[u32; LANES], e: &mut [Lanes; 3]) {
        let mut offset = [self.halo.first().map_or(0, |run| run[2]); LANES];
        for &[begin, _, by] in self.halo.iter().skip(1) {
            for l in 0..LANES {
                offset[l] = if index[l] >= begin { by } else { offset[l] };
            }
        }
        let [x, y, z] = e;
        let inverse = 1.0 / self.unit;
        let (x, y, z) =
            (counted(x, self.unit, inverse), counted(y, self.unit, inverse), counted(z, self.unit, inverse));
        let link = &mut self.links[self.used];
        for l in 0..LANES {
            let to = index[l].wrapping_sub(offset[l]).min(PLACES as u32 - 1);
            link.xy[l] = (x[l] & 0xffff | y[l] << 16) as i32;
            link.z_to[l] = (z[l] << 16 | to) as i32;
        }
        self.used += 1;
    }

    /// The links of slice `s`, slot by slot.
    #[inline(always)]
    pub fn of(&self, s: usize) -> &[Link] {
        let begin = if s == 0 { 0 } else { self.ends[s - 1] };
        &self.links[begin as usize..self.ends[s] as usize]
    }

    /// Brings the values around the chunk together.
    #[inline(always)]
    fn collect<'t, T: Copy + Default>(&self, of: &[T], table: &'t mut Vec<T>) -> &'t [T; PLACES] {
        table.resize(PLACES, T::default());
        let mut at = 0;
        for &[begin, end, _] in &self.halo {
            let run = &of[begin as usize..end as usize];
            let fits = run.len().min(PLACES - at);
            table[at..at + fits].copy_from_slice(&run[..fits]);
            at += fits;
        }
        table.first_chunk().expect("resized above")
    }
}

/// Added to a number, leaves its nearest whole number in the last bits.
const ROUND: f32 = 12_582_912.0;

/// How often `unit` (given by its inverse) goes into sixteen numbers, in the lower 16 bits, and what that many are.
#[inline(always)]
fn counted(x: &mut Lanes, unit: f32, inverse: f32) -> [u32; LANES] {
    let mut counts = [0; LANES];
    let most = f32::from(i16::MAX);
    for l in 0..LANES {
        let shifted = (x[l] * inverse).clamp(-most, most) + ROUND;
        counts[l] = shifted.to_bits();
        x[l] = unit * (shifted - ROUND);
    }
    counts
}

/// Sums over the neighbours of sixteen fluid particles.
#[derive(Clone, Copy, Debug, Default)]
pub struct Nodes {
    /// `sum e_ij` over all neighbours (1/m), bodies and walls counted twice: they show the particle's own pressure, so they push twice, and
    /// only the transpose of what pushes makes rounds converge (docs/physics.md, E9).
    pub all: [Lanes; 3],
    /// `sum rho_i (g - a_b) . d_ib e_ib` over particles of bodies and walls (Pa/m).
    pub pull: [Lanes; 3],
    /// How much of a gradient the sum over fluids finds: 1 amid them, about a half at their surface.
    pub spread: Lanes,
    /// `1 / rho_0` (m^3/kg).
    pub inverse_rho: Lanes,
    /// How fast the particle's density is driven down by its own share (1/(Pa s^2)).
    pub response: Lanes,
}

/// What is read.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    /// Constants.
    pub model: &'a Model,
    /// All particles.
    pub records: &'a [Record],
    /// Owners of all particles.
    pub owner: &'a [u32],
    /// Bodies, for the accelerations of scripts.
    pub bodies: &'a [Body],
    /// Gravity now (m/s^2).
    pub gravity: Vec3,
}

/// What sixteen particles sum.
#[derive(Default)]
struct Sums {
    fluid: [Lanes; 3],
    solid: [Lanes; 3],
    pull: [Lanes; 3],
    pairs: Lanes,
    spread: Lanes,
}

/// Links and nodes of a chunk of fluid particles.
#[inline(always)]
pub fn chunk<S: Simd>(simd: S, input: Input, slices: &Slices, links: &mut Links, nodes: &mut [Nodes]) {
    let model = input.model;
    let least = model.least_response();
    links.clear(slices, model.longest_link());
    for ((s, _), nodes) in slices.each().zip(nodes) {
        let own = Own::slice(simd, input.records, slices, s);
        let mut rho = [model.fluids[0].density; LANES];
        if model.fluids.len() > 1 {
            for l in 0..LANES {
                rho[l] = model.fluids[input.owner[own.i[l] as usize] as usize].density;
            }
        }
        let mut sums = Sums::default();
        run::<S, true>(simd, &input, slices, s, &own, &rho, Kind::Fluid, links, &mut sums);
        for &kind in bodies(model) {
            if slices.has(s, kind) {
                run::<S, false>(simd, &input, slices, s, &own, &rho, kind, links, &mut sums);
            }
        }
        links.ends.push(links.used as u32);
        for l in 0..LANES {
            let inverse_rho = 1.0 / rho[l];
            nodes.inverse_rho[l] = inverse_rho;
            let mut all_sq = 0.0;
            for a in 0..3 {
                let all = sums.fluid[a][l] + 2.0 * sums.solid[a][l];
                (all_sq, nodes.all[a][l]) = (all_sq + all * all, all);
            }
            nodes.response[l] = implicit::response(all_sq, inverse_rho, sums.pairs[l], least);
        }
        nodes.pull = sums.pull;
        for l in 0..LANES {
            nodes.spread[l] = sums.spread[l] / model.dimensions as f32;
        }
    }
}

/// Densities (E1) of a chunk of fluid particles where they are now, amid the neighbours they had.
#[inline(always)]
pub fn densities<S: Simd>(simd: S, model: &Model, records: &[Record], slices: &Slices, density: &mut [f32]) {
    let (kernel, inverse) = (model.kernel.density(), model.inverse_support());
    let at_center = kernel.w(0.0);
    for (s, members) in slices.each() {
        let own = Own::slice(simd, records, slices, s);
        let mut sum = [0.0; LANES];
        for l in 0..LANES {
            sum[l] = at_center * own.at.volume[l];
        }
        for &kind in [Kind::Fluid].iter().chain(bodies(model)) {
            if kind != Kind::Fluid && !slices.has(s, kind) {
                continue;
            }
            for near in slices.run(records, s, kind) {
                let other = gather(simd, near);
                let (_, r_sq) = wrap_lanes(simd, model, &own.at.x, &other.x);
                let w = weights(kernel, inverse, &r_sq);
                for l in 0..LANES {
                    // the particle itself, and what fills a slot, has its part already
                    let weight = if near.index[l] == own.i[l] { 0.0 } else { w[l] };
                    sum[l] += other.volume[l] * weight;
                }
            }
        }
        for (l, k) in members.enumerate() {
            density[k] = model.factors.w * sum[l];
        }
    }
}

/// The kinds of bodies that take part in density and pressure.
pub fn bodies(model: &Model) -> &'static [Kind] {
    match model.solver.coupling {
        Coupling::Pressure => &[Kind::Rigid, Kind::Static],
        Coupling::Spring => &[Kind::Static],
    }
}

/// Links to the neighbours of one kind, and their sums.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // one caller
fn run<S: Simd, const FLUID: bool>(
    simd: S,
    input: &Input,
    slices: &Slices,
    s: usize,
    own: &Own,
    rho: &Lanes,
    kind: Kind,
    links: &mut Links,
    sums: &mut Sums,
) {
    let Input { model, records, owner, gravity, .. } = *input;
    let (inverse, factor) = (model.inverse_support(), model.factors.g);
    let mut answer = [0.0; LANES];
    for l in 0..LANES {
        answer[l] = 1.0 / rho[l];
    }
    for near in slices.run(records, s, kind) {
        let other = gather(simd, near);
        let (d, r_sq) = wrap_lanes(simd, model, &own.at.x, &other.x);
        if FLUID && model.fluids.len() > 1 {
            for l in 0..LANES {
                answer[l] = 1.0 / model.fluids[owner[near.index[l] as usize] as usize].density;
            }
        }
        let mut e = each_kernel!(model.kernel.force(), K => sixteen(K, factor, inverse, &d, &r_sq, &other.volume));
        if FLUID {
            links.push(near.index, &mut e);
        } else if kind == Kind::Rigid {
            // counted twice, see `Nodes::all`; what pushes is not rounded: `press` does not round what bodies feel
            links.push(near.index, &mut e.map(|e| e.map(|e| 2.0 * e)));
        }
        let sum = if FLUID { &mut sums.fluid } else { &mut sums.solid };
        for l in 0..LANES {
            sum[0][l] += e[0][l];
            sum[1][l] += e[1][l];
            sum[2][l] += e[2][l];
        }
        if FLUID {
            for l in 0..LANES {
                sums.pairs[l] += answer[l] * (e[0][l] * e[0][l] + e[1][l] * e[1][l] + e[2][l] * e[2][l]);
                sums.spread[l] += d[0][l] * e[0][l] + d[1][l] * e[1][l] + d[2][l] * e[2][l];
            }
        }
        if !FLUID {
            for l in 0..LANES {
                let pull = rho[l] * (gravity.x * d[0][l] + gravity.y * d[1][l] + gravity.z * d[2][l]);
                sums.pull[0][l] += pull * e[0][l];
                sums.pull[1][l] += pull * e[1][l];
                sums.pull[2][l] += pull * e[2][l];
            }
        }
        if kind == Kind::Rigid {
            scripted(input, near, &d, &e, rho, sums);
        }
    }
}

/// The vectors to sixteen neighbours, in one loop over the lanes.
#[inline(always)]
fn sixteen(kernel: Kernel, factor: f32, inverse: f32, d: &[Lanes; 3], r_sq: &Lanes, volume: &Lanes) -> [Lanes; 3] {
    let mut e = [[0.0; LANES]; 3];
    for l in 0..LANES {
        let along_d = implicit::link(volume[l], factor * kernel.g(r_sq[l].sqrt() * inverse));
        e[0][l] = along_d * d[0][l];
        e[1][l] = along_d * d[1][l];
        e[2][l] = along_d * d[2][l];
    }
    e
}

/// The part of `pull` that the accelerations of scripted bodies have.
#[inline(always)]
fn scripted(input: &Input, near: Near, d: &[Lanes; 3], e: &[Lanes; 3], rho: &Lanes, sums: &mut Sums) {
    for l in 0..LANES {
        let j = near.index[l] as usize;
        let Some(body) = input.bodies.get(input.owner[j] as usize).filter(|b| b.is_static()) else { continue };
        let a = rho[l] * acceleration(body, &input.records[j]);
        let pull = a.x * d[0][l] + a.y * d[1][l] + a.z * d[2][l];
        for axis in 0..3 {
            sums.pull[axis][l] -= pull * e[axis][l];
        }
    }
}

/// Forces by fluids' pressures on a chunk of bodies' particles (N), whose first is `first`; `share` (Pa) and `hold` are those of all
/// fluid particles.
#[inline(always)]
pub fn press<S: Simd>(
    simd: S,
    input: Input,
    share: &[f32],
    hold: &[f32],
    first: usize,
    chunk: &NeighbourChunk,
    force: &mut [[f32; 3]],
) {
    let Input { model, records, owner, bodies, gravity } = input;
    let (inverse, factor) = (model.inverse_support(), model.factors.g);
    for (k, (runs, force)) in chunk.runs.iter().zip(force).enumerate() {
        *force = [0.0; 3];
        if runs.count(Kind::Fluid) == 0 {
            continue;
        }
        let own = &records[first + k];
        let body = &bodies[owner[first + k] as usize];
        let a = if body.is_static() { acceleration(body, own) } else { Vec3::ZERO };
        let mut total = [[0.0; LANES]; 3];
        let x = splat(own.x);
        for near in listed(records, &chunk.list()[runs.padded(Kind::Fluid)]) {
            let other = gather(simd, near);
            let (d, r_sq) = wrap_lanes(simd, model, &x, &other.x);
            let mut rho = [model.fluids[0].density; LANES];
            if model.fluids.len() > 1 {
                for l in 0..LANES {
                    let fluid = owner[near.index[l] as usize] as usize;
                    rho[l] = if fluid < model.fluids.len() { model.fluids[fluid].density } else { 0.0 };
                }
            }
            // padding names the particle itself, whose G meets no distance
            let (mut p, mut held) = ([0.0; LANES], [0.0; LANES]);
            for l in 0..LANES {
                let j = near.index[l] as usize;
                if j < share.len() {
                    (p[l], held[l]) = (share[j], hold[j]);
                }
            }
            each_kernel!(model.kernel.force(), K => for l in 0..LANES {
                let g = factor * K.g(r_sq[l].sqrt() * inverse);
                // as the fluid particle sees it: from it to this one is -d
                let pull = rho[l] * (gravity - a);
                let pull = -(pull.x * d[0][l] + pull.y * d[1][l] + pull.z * d[2][l]);
                let share = implicit::share_at_boundary(p[l], held[l], pull);
                let along_d = own.volume * other.volume[l] * share * g;
                total[0][l] += along_d * d[0][l];
                total[1][l] += along_d * d[1][l];
                total[2][l] += along_d * d[2][l];
            });
        }
        *force = [sum(simd, &total[0]), sum(simd, &total[1]), sum(simd, &total[2])];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};

    #[test]
    fn counts_of_opposite_numbers_are_opposite() {
        let unit = 0.013;
        let numbers: Lanes = std::array::from_fn(|l| (l as f32 - 6.5) * 61.7);
        let (mut plus, mut minus) = (numbers, numbers.map(|x| -x));
        let (up, down) = (counted(&mut plus, unit, 1.0 / unit), counted(&mut minus, unit, 1.0 / unit));
        let (up, down) = (up.map(|c| c as i16), down.map(|c| c as i16));
        for l in 0..LANES {
            assert_eq!(up[l], -down[l]);
            assert_eq!(plus[l], -minus[l]);
            let most = f32::from(i16::MAX) * unit;
            let exact = numbers[l].clamp(-most, most);
            assert!((plus[l] - exact).abs() <= 0.5001 * unit, "{exact} became {}", plus[l]);
            assert_eq!(plus[l], unit * f32::from(up[l]));
        }
    }

    /// What is linked is found again: vectors as they were rounded, values of the neighbours named.
    #[test]
    fn links_lead_to_the_neighbours() {
        let halo = vec![[40, 90, 40], [200, 230, 150], [1000, 1100, 920]];
        let mut links = Links { unit: 0.5, links: vec![Link::default()], used: 0, ends: vec![1], halo: halo.clone() };
        let index: [u32; LANES] = std::array::from_fn(|l| [45, 89, 200, 229, 1000, 1099][l % 6]);
        let mut e: [Lanes; 3] = std::array::from_fn(|a| std::array::from_fn(|l| (l as f32 - 7.3) * (a as f32 - 0.9)));
        links.push(&index, &mut e);
        let values: Vec<f32> = (0..2000).map(|i| i as f32).collect();
        let mut table = Table::default();
        let vectors: Vec<[f32; 4]> = values.iter().map(|i| [*i, 2.0 * i, 3.0 * i, 0.0]).collect();
        let link = links.of(0)[0];
        dispatch!(Level::new(), simd => {
            let one = link.numbers(simd, table.numbers(&links, &values)).to_array();
            let [x, y, z] = link.vectors(simd, table.vectors(&links, &vectors)).map(|c| c.to_array());
            let [e_x, e_y, e_z] = link.e(simd).map(|c| c.to_array());
            for l in 0..LANES {
                let i = index[l] as f32;
                assert_eq!([one[l], x[l], y[l], z[l]], [i, i, 2.0 * i, 3.0 * i]);
                assert_eq!([e_x[l], e_y[l], e_z[l]].map(|c| 0.5 * c), [e[0][l], e[1][l], e[2][l]]);
            }
        });
    }
}
