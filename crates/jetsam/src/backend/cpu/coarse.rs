//! The coarse level of implicit pressure on the CPU (E9): between two rounds the smooth part of what is left is solved at once.

use super::implicit::{Aim, Implicit};
use super::{CHUNK, Cpu, GONE};
use crate::integrate::Advance;
use crate::interact::coarse::{Coarse, Felt, Input, NOISE};
use crate::interact::implicit::Round;
use crate::laws::implicit::hold_more;
use crate::model::Model;
use crate::state::Kind;
use fearless_simd::dispatch;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::atomic::Ordering::Relaxed;

/// The coarse level, and what it is made from.
#[derive(Default)]
pub(super) struct Level {
    coarse: Coarse,
    /// 1 for each particle whose share takes part, else 0; no part of gravity with these (see `hold`).
    active: Vec<f32>,
    none: Vec<f32>,
    /// Shares between nodes (Pa).
    between: Vec<f32>,
}

impl Cpu {
    /// Solves the smooth part of what a round has left, and adds it to the shares.
    pub(super) fn smooth(&mut self, model: &Model, advance: Advance, round: Round, aim: Aim, residual: f64) {
        self.lay(model, advance, round, aim, residual);
        let (level, p) = (self.level, &self.state.particles);
        let Implicit { coarse, share, hold, before, base, left, .. } = &mut self.implicit;
        let Level { coarse, active, between, .. } = coarse;
        coarse.solve(level, &self.cells[Kind::Fluid as usize], &p.record, left);
        let coarse = &*coarse;
        let shares = share.par_chunks_mut(CHUNK).zip(hold.par_chunks_mut(CHUNK)).zip(before.par_chunks_mut(CHUNK));
        let read = p.record.par_chunks(CHUNK).zip(active.par_chunks(CHUNK)).zip(base.par_chunks(CHUNK));
        between.par_chunks_mut(CHUNK).zip(read).zip(shares).for_each(|((between, ((record, active), base)), all)| {
            dispatch!(level, simd => coarse.interpolate(simd, record, between));
            let ((share, hold), before) = all;
            for i in 0..between.len() {
                let now = (share[i] + active[i] * between[i]).max(-base[i]);
                before[i] += now - share[i]; // what rounds have gone is theirs alone
                share[i] = now;
                hold[i] = hold_more(base[i], now, round.limit);
            }
        });
    }

    /// What fluids and bodies answer to smooth shares.
    fn lay(&mut self, model: &Model, advance: Advance, round: Round, aim: Aim, residual: f64) {
        let noise = NOISE * residual as f32;
        let n = self.implicit.hold.len();
        let Implicit { coarse: Level { active, none, between, .. }, share, before, base, left, .. } =
            &mut self.implicit;
        active.clear();
        active.resize(share.len(), 0.0);
        none.resize(n, 0.0);
        between.resize(n, 0.0);
        let takes_part = |pushed: f32, left: f32| if pushed > 0.0 || left > noise { 1.0 } else { 0.0 };
        let all = active[..n].par_iter_mut().zip(before).zip(base).zip(left).with_min_len(CHUNK);
        all.for_each(|(((active, before), base), left)| *active = takes_part(*base + *before, *left));
        self.borrow_shares();
        self.push_fluids();
        let bodies = self.answers(model, aim);
        if bodies {
            self.press(model, Kind::Rigid, DVec3::ZERO);
        }
        self.borrow_shares();
        let p = &self.state.particles;
        let Implicit { coarse: Level { coarse, active, .. }, nodes, flow, force, .. } = &mut self.implicit;
        let input = Input {
            grid: &model.grid,
            cells: &self.cells[Kind::Fluid as usize],
            records: &p.record,
            nodes,
            active,
            push: flow,
            scale: round.scale,
            compliance: round.compliance,
        };
        coarse.assemble(self.level, input);
        if !bodies {
            return;
        }
        // a fluid particle gains by what its body gives way
        let fluid = &model.fluids[0];
        let factor = f64::from(round.scale) * fluid.density as f64 / fluid.mass as f64;
        let (b, first) = (&self.state.bodies, p.first[Kind::Rigid as usize]);
        for body in b.body.iter().filter(|body| Self::movable(body, advance)) {
            let mut particles = body.slots.clone().filter_map(|slot| {
                let at = self.place[slot].load(Relaxed);
                let f = if at == GONE { [0.0; 3] } else { force[at as usize - first] };
                let f = DVec3::from(f.map(f64::from));
                let push = f.length();
                (push > 0.0).then(|| {
                    let x = glam::Vec3::from(p.record[at as usize].x) - (model.spacing / push * f).as_vec3();
                    (x.to_array(), body.q * b.offset[slot], f)
                })
            });
            let (inverse_mass, inverse_inertia) = (1.0 / body.mass, body.inverse_inertia_at(body.q));
            coarse.answer(Felt { inverse_mass, inverse_inertia, factor, particles: &mut particles });
        }
    }

    /// Puts shares of 1 in the place of those that there are, and these back again.
    fn borrow_shares(&mut self) {
        let Implicit { coarse: Level { active, none, .. }, share, hold, .. } = &mut self.implicit;
        std::mem::swap(active, share);
        std::mem::swap(none, hold);
    }
}
