//! Free particles: drift and kick of a chunk of fluid (E20).

use super::Advance;
use crate::interact::cells::Grid;
use crate::scene::Integrator;
use crate::state::Record;

/// Drift: `x += v dt + a dt^2 / 2` (+ XSPH), and the velocity predicted, `v + a dt`.
pub fn drift(
    integrator: Integrator,
    advance: Advance,
    grid: &Grid,
    records: &mut [Record],
    push: &[[f32; 3]],
    carry: &[[f32; 4]],
) {
    let dt = advance.dt as f32;
    let half = match integrator {
        Integrator::Leapfrog => 0.5 * dt,
        Integrator::Euler => dt, // the whole kick first
    };
    for (k, (r, a)) in records.iter_mut().zip(push).enumerate() {
        for c in 0..3 {
            let carried = carry.get(k).map_or(0.0, |v| v[c]);
            r.x[c] += dt * (r.v[c] + half * a[c] + carried);
            r.v[c] += dt * a[c];
        }
        grid.wrap(&mut r.x);
    }
}

/// Kick: the prediction corrected by half the change of acceleration.
pub fn kick(integrator: Integrator, advance: Advance, records: &mut [Record], push: &[[f32; 3]], before: &[[f32; 3]]) {
    let half = 0.5 * advance.dt as f32;
    let keep = (-advance.drag * advance.dt).exp() as f32;
    for ((r, a), b) in records.iter_mut().zip(push).zip(before) {
        for c in 0..3 {
            if integrator == Integrator::Leapfrog {
                r.v[c] += half * (a[c] - b[c]);
            }
            r.v[c] *= keep;
        }
    }
}

/// With implicit pressure (E9): the kick by all forces but pressure.
pub fn push(advance: Advance, records: &mut [Record], push: &[[f32; 3]]) {
    let dt = advance.dt as f32;
    let keep = (-advance.drag * advance.dt).exp() as f32;
    for (r, a) in records.iter_mut().zip(push) {
        for c in 0..3 {
            r.v[c] = keep * (r.v[c] + dt * a[c]);
        }
    }
}

/// With implicit pressure: drift at the velocity found (+ XSPH), and by accelerations that move places alone.
pub fn glide(advance: Advance, grid: &Grid, records: &mut [Record], carry: &[[f32; 4]], places: &[[f32; 4]]) {
    let dt = advance.dt as f32;
    for (k, r) in records.iter_mut().enumerate() {
        let of = |all: &[[f32; 4]], c: usize| all.get(k).map_or(0.0, |v| v[c]);
        for c in 0..3 {
            r.x[c] += dt * (r.v[c] + of(carry, c) + dt * of(places, c));
        }
        grid.wrap(&mut r.x);
    }
}

/// E1 where density is integrated: `D` predicted to the end of the step (Adams-Bashforth) from the rates one and two
/// steps ago. With [`correct`] the pair is of second order, and stable for sound as long as `omega dt < 0.6`.
pub fn predict(advance: Advance, density: &mut [f32], rate: &mut [[f32; 2]], carry: &[[f32; 4]]) {
    let dt = advance.dt as f32;
    let ahead = advance.ahead();
    for ((d, rate), carry) in density.iter_mut().zip(rate).zip(carry) {
        *rate = [carry[3], rate[0]];
        *d += dt * (rate[0] + ahead * (rate[0] - rate[1]));
    }
}

/// The prediction replaced by the mean of the rates at both ends of the step.
pub fn correct(advance: Advance, density: &mut [f32], rate: &[[f32; 2]], carry: &[[f32; 4]]) {
    let dt = advance.dt as f32;
    let ahead = advance.ahead();
    for ((d, rate), carry) in density.iter_mut().zip(rate).zip(carry) {
        *d += dt * (0.5 * (carry[3] - rate[0]) - ahead * (rate[0] - rate[1]));
    }
}
