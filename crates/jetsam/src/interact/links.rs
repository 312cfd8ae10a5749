//! What implicit solvers (E9) know of the neighbourhood of each fluid particle while they iterate.
//!
//! In: neighbour runs, records. Out: [`Links`], the vectors `e_ij = V_j grad_i W_ij` to fluids and particles of bodies; a
//! [`Node`] for each particle, with the sums of these vectors; for PBF, whose particles move while it iterates, densities anew.
//! Walls do not answer: they are in the sums alone. Called by the stages `divergence` and `pressure`.

use super::boundary::acceleration;
use super::density::weights;
use super::lanes::{LANES, Lanes, Links, Listed, Near, counted, gather, sum};
use super::neighbours::{NeighbourChunk, Runs};
use super::pairs::wrap_lanes;
use crate::laws::implicit;
use crate::laws::kernel::{Kernel, each_kernel};
use crate::model::Model;
use crate::scene::Coupling;
use crate::state::{Body, Kind, Record};
use fearless_simd::Simd;
use glam::Vec3;

/// Sums over the neighbours of one fluid particle.
#[derive(Clone, Copy, Debug, Default)]
pub struct Node {
    /// `sum e_ij` over all neighbours (1/m).
    pub all: Vec3,
    /// `sum e_ib` over particles of bodies and walls (1/m).
    pub solid: Vec3,
    /// `sum rho_i (g - a_b) . d_ib e_ib`, alike (Pa/m).
    pub pull: Vec3,
    /// `1 / rho_0` (m^3/kg).
    pub inverse_rho: f32,
    /// How fast the particle's density is driven down by its own share (1/(Pa s^2)).
    pub response: f32,
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

/// What one run of neighbours adds.
#[derive(Clone, Copy, Default)]
struct Part {
    e: Vec3,
    pull: Vec3,
    pairs: f32,
    weight: f32,
}

/// Links and nodes of a chunk of fluid particles; `first` is the chunk's first. With `DENSITY` their densities too.
#[inline(always)]
pub fn chunk<S: Simd, const DENSITY: bool>(
    simd: S,
    input: Input,
    first: usize,
    chunk: &NeighbourChunk,
    links: &mut Links,
    nodes: &mut [Node],
    density: &mut [f32],
) {
    let model = input.model;
    let listed = Listed::new(simd, input.records, chunk.list());
    let floor = 1e-4 / (model.spacing * model.spacing) as f32;
    links.clear(chunk.list().len(), model.longest_link());
    for (k, (runs, node)) in chunk.runs.iter().zip(nodes).enumerate() {
        links.begin();
        let fluid = run::<S, DENSITY, true>(simd, &input, listed, first + k, runs, Kind::Fluid, links);
        links.end_fluids();
        let mut solid = Part::default();
        for &kind in bodies(model) {
            if runs.count(kind) > 0 {
                let part = run::<S, DENSITY, false>(simd, &input, listed, first + k, runs, kind, links);
                solid.e += part.e;
                solid.pull += part.pull;
                solid.weight += part.weight;
            }
        }
        links.end();
        let inverse_rho = 1.0 / model.fluids[input.owner[first + k] as usize].density;
        let all = fluid.e + solid.e;
        let own = (all + solid.e).dot(all);
        let response = implicit::response(own, all.length_squared(), inverse_rho, fluid.pairs);
        *node = Node { all, solid: solid.e, pull: solid.pull, inverse_rho, response: response + floor * inverse_rho };
        if DENSITY {
            density[k] = model.factors.w * (fluid.weight + solid.weight);
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
fn run<S: Simd, const DENSITY: bool, const FLUID: bool>(
    simd: S,
    input: &Input,
    listed: Listed,
    i: usize,
    runs: &Runs,
    kind: Kind,
    links: &mut Links,
) -> Part {
    let Input { model, records, owner, .. } = *input;
    let own = &records[i];
    let rho = model.fluids[owner[i] as usize].density;
    let (inverse, factor) = (model.inverse_support(), model.factors.g);
    let pull = rho * input.gravity;
    let (unit, per_unit) = (links.unit, 1.0 / links.unit);
    let mut sums = Sums::default();
    let mut answer = [1.0 / rho; LANES];
    for near in listed.run(runs.padded(kind)) {
        let other = gather(simd, near);
        let (d, r_sq) = wrap_lanes(simd, model, own.x, &other.x);
        if FLUID && model.fluids.len() > 1 {
            for l in 0..LANES {
                answer[l] = 1.0 / model.fluids[owner[near.index[l] as usize] as usize].density;
            }
        }
        let mut e = each_kernel!(model.kernel.force(), K => sixteen(K, factor, inverse, &d, &r_sq, &other.volume));
        if kind != Kind::Static {
            let [x, y, z] = &mut e;
            let counts = [counted(x, unit, per_unit), counted(y, unit, per_unit), counted(z, unit, per_unit)];
            links.push(simd, near.index, &counts);
        }
        for l in 0..LANES {
            sums.e[0][l] += e[0][l];
            sums.e[1][l] += e[1][l];
            sums.e[2][l] += e[2][l];
            sums.pairs[l] += answer[l] * (e[0][l] * e[0][l] + e[1][l] * e[1][l] + e[2][l] * e[2][l]);
        }
        if !FLUID {
            for l in 0..LANES {
                let pull = pull.x * d[0][l] + pull.y * d[1][l] + pull.z * d[2][l];
                sums.pull[0][l] += pull * e[0][l];
                sums.pull[1][l] += pull * e[1][l];
                sums.pull[2][l] += pull * e[2][l];
            }
        }
        if kind == Kind::Rigid {
            scripted(input, near, &d, &e, rho, &mut sums);
        }
        if DENSITY {
            let w = weights(model.kernel.density(), inverse, &r_sq);
            for l in 0..LANES {
                sums.weight[l] += other.volume[l] * w[l];
            }
        }
    }
    // padding is the particle itself: e is zero, W is not
    let padding = (runs.padded(kind).len() - runs.count(kind)) as f32;
    let at_center = if DENSITY { model.kernel.density().w(0.0) * own.volume } else { 0.0 };
    Part {
        e: total(simd, &sums.e),
        pull: if FLUID { Vec3::ZERO } else { total(simd, &sums.pull) },
        pairs: sum(simd, &sums.pairs),
        weight: if DENSITY { sum(simd, &sums.weight) - padding * at_center } else { 0.0 },
    }
}

/// Sums of the lanes of a vector.
#[inline(always)]
fn total<S: Simd>(simd: S, of: &[Lanes; 3]) -> Vec3 {
    Vec3::new(sum(simd, &of[0]), sum(simd, &of[1]), sum(simd, &of[2]))
}

#[derive(Default)]
struct Sums {
    e: [Lanes; 3],
    pull: [Lanes; 3],
    pairs: Lanes,
    weight: Lanes,
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
fn scripted(input: &Input, near: Near, d: &[Lanes; 3], e: &[Lanes; 3], rho: f32, sums: &mut Sums) {
    for l in 0..LANES {
        let j = near.index[l] as usize;
        let Some(body) = input.bodies.get(input.owner[j] as usize).filter(|b| b.is_static()) else { continue };
        let a = rho * acceleration(body, &input.records[j]);
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
    let listed = Listed::new(simd, records, chunk.list());
    for (k, (runs, force)) in chunk.runs.iter().zip(force).enumerate() {
        *force = [0.0; 3];
        if runs.count(Kind::Fluid) == 0 {
            continue;
        }
        let own = &records[first + k];
        let body = &bodies[owner[first + k] as usize];
        let a = if body.is_static() { acceleration(body, own) } else { Vec3::ZERO };
        let mut total = [[0.0; LANES]; 3];
        for near in listed.run(runs.padded(Kind::Fluid)) {
            let other = gather(simd, near);
            let (d, r_sq) = wrap_lanes(simd, model, own.x, &other.x);
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
        *force = self::total(simd, &total).to_array();
    }
}
