//! What implicit solvers (E9) know of the neighbourhood of each fluid particle while they iterate.
//!
//! In: transposed neighbours, records. Out: [`Links`], the vectors `e_ij = V_j grad_i W_ij` to fluids and particles of bodies; a
//! [`Nodes`] for sixteen particles, with the sums of these vectors; for PBF, whose particles move while it iterates, densities anew ([`densities`]).
//! Walls do not answer: they are in the sums alone. Called by the stages `divergence` and `pressure`.
//!
//! Rounds wait for the links they read, and for the values of neighbours. So a link takes 8 bytes: its vector in whole numbers, and
//! where the neighbour stands among the values around the chunk, which a [`Table`] holds together.

use super::boundary::acceleration;
use super::density::weigh;
use super::lanes::{Block, Indices, LANES, Lanes, Near, Transposed, axes, gather, listed, sum};
use super::neighbours::NeighbourChunk;
use super::pairs::wrap_lanes;
use super::slices::{Own, Slices, splat};
use crate::laws::implicit;
use crate::laws::kernel::each_kernel;
use crate::model::Model;
use crate::scene::Coupling;
use crate::state::{Body, Kind, Record};
use fearless_simd::prelude::*;
use fearless_simd::{f32x4, f32x16, i32x16, u32x16};
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
    pub fn vectors<S: Simd>(&self, simd: S, table: &[[f32; 4]; PLACES]) -> [f32x16<S>; 4] {
        vectors_at(simd, table, |l| self.to(l))
    }
}

/// Vectors at the places `to` of sixteen lanes, axis by axis.
#[inline(always)]
fn vectors_at<S: Simd>(simd: S, table: &[[f32; 4]; PLACES], to: impl Fn(usize) -> usize) -> [f32x16<S>; 4] {
    let row = |l: usize| f32x4::load_array_ref(simd, &table[to(l)]);
    let four = |l: usize| row(l).combine(row(l + 1)).combine(row(l + 2).combine(row(l + 3)));
    axes([four(0), four(4), four(8), four(12)])
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
    slots: Slots,
}

/// Neighbours of sixteen particles, slot by slot. The kernel is evaluated over all of them at once: of short loops over
/// sixteen lanes the compiler makes scalars.
#[derive(Default)]
struct Slots {
    /// To the particle from its neighbour (m), axis by axis.
    d: Vec<[Block; 3]>,
    /// Its square, and then what the kernel makes of it.
    r_sq: Vec<Block>,
    /// Volumes of the neighbours (m^3).
    volume: Vec<Block>,
    /// Places of the neighbours, 0 for those of walls.
    to: Vec<Indices>,
}

impl Slots {
    #[inline(always)]
    fn clear(&mut self) {
        self.d.clear();
        self.r_sq.clear();
        self.volume.clear();
        self.to.clear();
    }

    /// Adds neighbours of particles at `x`, at `[x, y, z]` with a volume.
    #[inline(always)]
    fn push<S: Simd>(&mut self, simd: S, model: &Model, own: &Own, other: [Lanes; 4], to: [u32; LANES]) {
        let [x, y, z, volume] = other;
        let (d, r_sq) = wrap_lanes(simd, model, &own.at.x, &[x, y, z]);
        self.d.push(d.map(Block));
        self.r_sq.push(Block(r_sq));
        self.volume.push(Block(volume));
        self.to.push(Indices(to));
    }

    /// All squares, and volumes beside them.
    #[inline(always)]
    fn flat(&mut self) -> (&mut [f32], &[f32]) {
        (bytemuck::cast_slice_mut(&mut self.r_sq), bytemuck::cast_slice(&self.volume))
    }
}

/// Positions and volumes of sixteen particles of walls.
#[inline(always)]
fn of_walls<S: Simd>(simd: S, near: Near) -> [Lanes; 4] {
    let Transposed { x: [x, y, z], volume, .. } = gather(simd, near);
    [x, y, z, volume]
}

impl Table {
    /// Numbers around a chunk.
    #[inline(always)]
    pub fn numbers(&mut self, links: &Links, of: &[f32]) -> &[f32; PLACES] {
        links.collect(of, |x| *x, &mut self.numbers)
    }

    /// Vectors around a chunk.
    #[inline(always)]
    pub fn vectors(&mut self, links: &Links, of: &[[f32; 4]]) -> &[[f32; 4]; PLACES] {
        links.collect(of, |u| *u, &mut self.vectors)
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

    /// Places of fluid or rigid particles.
    #[inline(always)]
    fn places(&self, index: &[u32; LANES]) -> [u32; LANES] {
        let mut offset = [self.halo.first().map_or(0, |run| run[2]); LANES];
        for &[begin, _, by] in self.halo.iter().skip(1) {
            for l in 0..LANES {
                offset[l] = if index[l] >= begin { by } else { offset[l] };
            }
        }
        let mut to = [0; LANES];
        for l in 0..LANES {
            to[l] = index[l].wrapping_sub(offset[l]).min(PLACES as u32 - 1);
        }
        to
    }

    /// Adds a neighbour to each of sixteen particles; returns the vectors as they are kept, in whole numbers of the unit.
    #[inline(always)]
    fn push<S: Simd>(&mut self, simd: S, to: &[u32; LANES], e: [f32x16<S>; 3]) -> [f32x16<S>; 3] {
        let (unit, most) = (f32x16::splat(simd, self.unit), f32x16::splat(simd, f32::from(i16::MAX)));
        let inverse = f32x16::splat(simd, 1.0 / self.unit);
        let zero = f32x16::splat(simd, 0.0);
        let (mut count, mut kept) = ([i32x16::splat(simd, 0); 3], [zero; 3]);
        for a in 0..3 {
            let times = (e[a] * inverse).max(zero - most).min(most).round_ties_even();
            (count[a], kept[a]) = (times.to_int(), unit * times);
        }
        let (link, low) = (&mut self.links[self.used], i32x16::splat(simd, 0xffff));
        let to: u32x16<S> = u32x16::load_array_ref(simd, to);
        ((count[0] & low) | (count[1] << 16)).store_array(&mut link.xy);
        ((count[2] << 16) | to.bitcast::<i32x16<S>>()).store_array(&mut link.z_to);
        self.used += 1;
        kept
    }

    /// Positions (m) and rest volumes (m^3) around the chunk.
    #[inline(always)]
    fn points<'t>(&self, records: &[Record], table: &'t mut Vec<[f32; 4]>) -> &'t [[f32; 4]; PLACES] {
        self.collect(records, |Record { x: [x, y, z], volume, .. }| [*x, *y, *z, *volume], table)
    }

    /// The links of slice `s`, slot by slot.
    #[inline(always)]
    pub fn of(&self, s: usize) -> &[Link] {
        let begin = if s == 0 { 0 } else { self.ends[s - 1] };
        &self.links[begin as usize..self.ends[s] as usize]
    }

    /// Brings the values around the chunk together.
    #[inline(always)]
    fn collect<'t, T, U: Copy + Default>(
        &self,
        of: &[T],
        part: impl Fn(&T) -> U,
        table: &'t mut Vec<U>,
    ) -> &'t [U; PLACES] {
        table.resize(PLACES, U::default());
        let mut at = 0;
        for &[begin, end, _] in &self.halo {
            let run = &of[begin as usize..end as usize];
            let fits = run.len().min(PLACES - at);
            table[at..at + fits].iter_mut().zip(run).for_each(|(to, from)| *to = part(from));
            at += fits;
        }
        table.first_chunk().expect("resized above")
    }
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
struct Sums<S: Simd> {
    fluid: [f32x16<S>; 3],
    solid: [f32x16<S>; 3],
    pull: [f32x16<S>; 3],
    pairs: f32x16<S>,
    spread: f32x16<S>,
}

/// Links and nodes of a chunk of fluid particles.
#[inline(always)]
pub fn chunk<S: Simd>(
    simd: S,
    table: &mut Table,
    input: Input,
    slices: &Slices,
    links: &mut Links,
    nodes: &mut [Nodes],
) {
    let Input { model, records, owner, .. } = input;
    let (inverse, factor) = (model.inverse_support(), model.factors.g);
    let least = model.least_response();
    links.clear(slices, model.longest_link());
    let Table { vectors, slots, .. } = table;
    let around = links.points(records, vectors);
    for ((s, _), nodes) in slices.each().zip(nodes) {
        let own = Own::slice(simd, records, slices, s);
        let mut rho = [model.fluids[0].density; LANES];
        if model.fluids.len() > 1 {
            for l in 0..LANES {
                rho[l] = model.fluids[owner[own.i[l] as usize] as usize].density;
            }
        }
        slots.clear();
        for kind in kinds(model) {
            for near in slices.run(records, s, kind) {
                if kind == Kind::Static {
                    slots.push(simd, model, &own, of_walls(simd, near), [0; LANES]);
                } else {
                    let to = links.places(near.index);
                    let other = vectors_at(simd, around, |l| to[l] as usize).map(|c| c.to_array());
                    slots.push(simd, model, &own, other, to);
                }
            }
        }
        let (along_d, volume) = slots.flat();
        each_kernel!(model.kernel.force(), K => for (r_sq, volume) in along_d.iter_mut().zip(volume) {
            *r_sq = implicit::link(*volume, factor * K.g(r_sq.sqrt() * inverse));
        });
        let Sums { fluid, solid, pull, pairs, spread } = sums(simd, &input, slices, s, &rho, slots, links);
        links.ends.push(links.used as u32);
        let (pairs, spread) = (pairs.to_array(), spread.to_array());
        let (fluid, solid) = (fluid.map(|f| f.to_array()), solid.map(|f| f.to_array()));
        for l in 0..LANES {
            let inverse_rho = 1.0 / rho[l];
            nodes.inverse_rho[l] = inverse_rho;
            let mut all_sq = 0.0;
            for a in 0..3 {
                let all = fluid[a][l] + 2.0 * solid[a][l];
                (all_sq, nodes.all[a][l]) = (all_sq + all * all, all);
            }
            nodes.response[l] = implicit::response(all_sq, inverse_rho, pairs[l], least);
            nodes.spread[l] = spread[l] / model.dimensions as f32;
        }
        nodes.pull = pull.map(|p| p.to_array());
    }
}

/// Densities (E1) of a chunk of fluid particles where they are now, amid the neighbours they had.
#[inline(always)]
pub fn densities<S: Simd>(
    simd: S,
    table: &mut Table,
    model: &Model,
    records: &[Record],
    slices: &Slices,
    links: &Links,
    density: &mut [f32],
) {
    let kernel = model.kernel.density();
    let at_center = f32x16::splat(simd, kernel.w(0.0));
    // where a kernel is nothing
    let far = f32x16::splat(simd, 4.0 * (model.support * model.support) as f32);
    let Table { vectors, slots, .. } = table;
    let around = links.points(records, vectors);
    for (s, members) in slices.each() {
        let own = Own::slice(simd, records, slices, s);
        slots.clear();
        let place = links.places(&own.i);
        for link in links.of(s) {
            let mut to = [0; LANES];
            for l in 0..LANES {
                to[l] = link.to(l) as u32;
            }
            slots.push(simd, model, &own, link.vectors(simd, around).map(|c| c.to_array()), to);
        }
        // the particle itself, and what fills a slot, has its part already
        let place = u32x16::load_array_ref(simd, &place);
        for (r_sq, to) in slots.r_sq.iter_mut().zip(&slots.to) {
            let itself = u32x16::load_array_ref(simd, &to.0).simd_eq(place);
            itself.select(far, f32x16::load_array_ref(simd, &r_sq.0)).store_array(&mut r_sq.0);
        }
        let place = u32x16::load_array_ref(simd, &own.i);
        for near in slices.run(records, s, Kind::Static) {
            slots.push(simd, model, &own, of_walls(simd, near), [0; LANES]);
            let itself = u32x16::load_array_ref(simd, near.index).simd_eq(place);
            let r_sq = &mut slots.r_sq.last_mut().expect("pushed above").0;
            itself.select(far, f32x16::load_array_ref(simd, r_sq)).store_array(r_sq);
        }
        weigh(kernel, model.inverse_support(), slots.flat().0);
        let mut sum = at_center * f32x16::load_array_ref(simd, &own.at.volume);
        for (w, volume) in slots.r_sq.iter().zip(&slots.volume) {
            sum += f32x16::load_array_ref(simd, &volume.0) * f32x16::load_array_ref(simd, &w.0);
        }
        let sum = sum.to_array();
        for (l, k) in members.enumerate() {
            density[k] = model.factors.w * sum[l];
        }
    }
}

/// Fluids, and the kinds of bodies that take part in density and pressure.
fn kinds(model: &Model) -> impl Iterator<Item = Kind> {
    std::iter::once(Kind::Fluid).chain(bodies(model).iter().copied())
}

/// The kinds of bodies that take part in density and pressure.
pub fn bodies(model: &Model) -> &'static [Kind] {
    match model.solver.coupling {
        Coupling::Pressure => &[Kind::Rigid, Kind::Static],
        Coupling::Spring => &[Kind::Static],
    }
}

/// Links to the neighbours in `slots`, of which `along_d` is known, and their sums.
#[inline(always)]
fn sums<S: Simd>(
    simd: S,
    input: &Input,
    slices: &Slices,
    s: usize,
    rho: &Lanes,
    slots: &Slots,
    links: &mut Links,
) -> Sums<S> {
    let Input { model, records, owner, gravity, .. } = *input;
    let zero = f32x16::splat(simd, 0.0);
    let read = |lanes: &Lanes| f32x16::load_array_ref(simd, lanes);
    let gravity = [gravity.x, gravity.y, gravity.z].map(|g| f32x16::splat(simd, g));
    let own_rho = read(rho);
    let mut answer = f32x16::splat(simd, 1.0) / own_rho;
    let mut sums = Sums { fluid: [zero; 3], solid: [zero; 3], pull: [zero; 3], pairs: zero, spread: zero };
    let mut slot = slots.d.iter().zip(&slots.r_sq).zip(&slots.to);
    for kind in kinds(model) {
        for (near, ((d, along_d), to)) in slices.run(records, s, kind).zip(&mut slot) {
            let (along_d, mut e) = (read(&along_d.0), [zero; 3]);
            for a in 0..3 {
                e[a] = along_d * read(&d[a].0);
            }
            if kind == Kind::Fluid {
                if model.fluids.len() > 1 {
                    let rho = |l: usize| model.fluids[owner[near.index[l] as usize] as usize].density;
                    answer = f32x16::from_fn(simd, |l| 1.0 / rho(l));
                }
                let e = links.push(simd, &to.0, e);
                for a in 0..3 {
                    sums.fluid[a] += e[a];
                }
                sums.pairs += answer * (e[0] * e[0] + e[1] * e[1] + e[2] * e[2]);
                sums.spread += read(&d[0].0) * e[0] + read(&d[1].0) * e[1] + read(&d[2].0) * e[2];
                continue;
            }
            if kind == Kind::Rigid {
                // counted twice, see `Nodes::all`; what pushes is not rounded: `press` does not round what bodies feel
                links.push(simd, &to.0, [e[0] + e[0], e[1] + e[1], e[2] + e[2]]);
            }
            let pull = own_rho * (gravity[0] * read(&d[0].0) + gravity[1] * read(&d[1].0) + gravity[2] * read(&d[2].0));
            for a in 0..3 {
                sums.solid[a] += e[a];
                sums.pull[a] += pull * e[a];
            }
            if kind == Kind::Rigid {
                scripted(simd, input, near, d, e, rho, &mut sums.pull);
            }
        }
    }
    sums
}

/// The part of `pull` that the accelerations of scripted bodies have.
#[inline(always)]
fn scripted<S: Simd>(
    simd: S,
    input: &Input,
    near: Near,
    d: &[Block; 3],
    e: [f32x16<S>; 3],
    rho: &Lanes,
    to: &mut [f32x16<S>; 3],
) {
    let body = |l: usize| input.bodies.get(input.owner[near.index[l] as usize] as usize).filter(|b| b.is_static());
    if (0..LANES).all(|l| body(l).is_none()) {
        return;
    }
    let mut pull = [0.0; LANES];
    for l in 0..LANES {
        let Some(body) = body(l) else { continue };
        let a = rho[l] * acceleration(body, &input.records[near.index[l] as usize]);
        pull[l] = a.x * d[0].0[l] + a.y * d[1].0[l] + a.z * d[2].0[l];
    }
    let pull = f32x16::load_array(simd, pull);
    for a in 0..3 {
        to[a] -= pull * e[a];
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
    fn vectors_of_both_sides_stay_opposite() {
        let unit = 0.013;
        let halo = vec![[0, 10, 0]];
        let mut links = Links { unit, links: vec![Link::default(); 2], used: 0, ends: vec![2], halo };
        let numbers: Lanes = std::array::from_fn(|l| (l as f32 - 6.5) * 61.7);
        dispatch!(Level::new(), simd => {
            let x = f32x16::load_array(simd, numbers);
            let zero = f32x16::splat(simd, 0.0);
            let plus = links.push(simd, &[0; LANES], [x; 3])[1].to_array();
            let minus = links.push(simd, &[0; LANES], [zero - x; 3])[1].to_array();
            let [up, down] = [0, 1].map(|k| links.of(0)[k].e(simd).map(|e| e.to_array()));
            for l in 0..LANES {
                assert_eq!(plus[l], -minus[l]);
                let most = f32::from(i16::MAX) * unit;
                let exact = numbers[l].clamp(-most, most);
                assert!((plus[l] - exact).abs() <= 0.5001 * unit, "{exact} became {}", plus[l]);
                for a in 0..3 {
                    assert_eq!(up[a][l], -down[a][l]);
                    assert_eq!(plus[l], unit * up[a][l]);
                }
            }
        });
    }

    /// What is linked is found again: vectors as they were rounded, values of the neighbours named.
    #[test]
    fn links_lead_to_the_neighbours() {
        let halo = vec![[40, 90, 40], [200, 230, 150], [1000, 1100, 920]];
        let mut links = Links { unit: 0.5, links: vec![Link::default()], used: 0, ends: vec![1], halo: halo.clone() };
        let index: [u32; LANES] = std::array::from_fn(|l| [45, 89, 200, 229, 1000, 1099][l % 6]);
        let e: [Lanes; 3] = std::array::from_fn(|a| std::array::from_fn(|l| (l as f32 - 7.3) * (a as f32 - 0.9)));
        let values: Vec<f32> = (0..2000).map(|i| i as f32).collect();
        let mut table = Table::default();
        let vectors: Vec<[f32; 4]> = values.iter().map(|i| [*i, 2.0 * i, 3.0 * i, 0.0]).collect();
        dispatch!(Level::new(), simd => {
            let to = links.places(&index);
            let e = links.push(simd, &to, e.map(|e| f32x16::load_array(simd, e))).map(|e| e.to_array());
            let link = links.of(0)[0];
            let one = link.numbers(simd, table.numbers(&links, &values)).to_array();
            let [x, y, z, _] = link.vectors(simd, table.vectors(&links, &vectors)).map(|c| c.to_array());
            let [e_x, e_y, e_z] = link.e(simd).map(|c| c.to_array());
            for l in 0..LANES {
                let i = index[l] as f32;
                assert_eq!([one[l], x[l], y[l], z[l]], [i, i, 2.0 * i, 3.0 * i]);
                assert_eq!([e_x[l], e_y[l], e_z[l]].map(|c| 0.5 * c), [e[0][l], e[1][l], e[2][l]]);
            }
        });
    }
}
