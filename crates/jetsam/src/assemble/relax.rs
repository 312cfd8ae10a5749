//! Bodies that overlap at the beginning are pushed apart before time begins: springs would throw them instead.

use super::bodies::NewBody;
use super::near::Near;
use crate::scene::joint::JointModel;
use glam::DVec3;

/// Overlap, as a fraction of the contact diameter, that calls for it: lattices that touch overlap less.
const DEEP: f64 = 0.12;
/// The same where both know their springs: whoever states them may mean to start in contact.
const DEEP_STATED: f64 = 0.5;
/// Overlap that may be left.
const LEFT: f64 = 0.02;
/// Rounds at most.
const ROUNDS: usize = 400;

/// Pushes bodies apart that overlap deeply, and those they meet on the way; says so. `up` is where a body goes that is
/// pushed from all sides alike.
pub(super) fn relax(
    bodies: &mut [NewBody],
    joints: &[JointModel],
    diameter: f64,
    dimensions: u32,
    up: DVec3,
    warnings: &mut Vec<String>,
) {
    let mut fixed = Near::new(diameter);
    for (index, body) in bodies.iter().enumerate().filter(|(_, b)| b.mass.is_infinite()) {
        body.points().for_each(|p| fixed.insert_tagged(p, index as u32));
    }
    let joined = |a: usize, b: usize| joints.iter().any(|j| (j.a, j.b) == (a, Some(b)) || (j.a, j.b) == (b, Some(a)));
    let begin: Vec<DVec3> = bodies.iter().map(|b| b.x).collect();
    let mut stirred = vec![false; bodies.len()];
    let mut deepest = 0.0;
    for round in 0..ROUNDS {
        let mut free = Near::new(diameter);
        for (index, body) in bodies.iter().enumerate().filter(|(_, b)| b.mass.is_finite()) {
            body.points().for_each(|p| free.insert_tagged(p, index as u32));
        }
        let mut moves = vec![DVec3::ZERO; bodies.len()];
        for a in (0..bodies.len()).filter(|&a| bodies[a].mass.is_finite()) {
            let limit = match (round, bodies[a].stiffness) {
                (0, None) => DEEP,
                (0, Some(_)) => DEEP_STATED,
                _ => LEFT,
            };
            let mut pushes: std::collections::BTreeMap<usize, (DVec3, f64)> = Default::default();
            for p in bodies[a].points() {
                let mut meet = |d: DVec3, tag: u32| {
                    let (b, overlap) = (tag as usize, diameter - d.length());
                    if b != a && overlap > limit * diameter && !joined(a, b) {
                        let push = pushes.entry(b).or_default();
                        push.0 -= d.normalize_or_zero() * overlap;
                        push.1 = push.1.max(overlap);
                    }
                };
                free.around(p, &mut meet);
                fixed.around(p, &mut meet);
            }
            for (b, (push, overlap)) in pushes {
                if round == 0 {
                    deepest = f64::max(deepest, overlap);
                } else if !stirred[a] && !stirred[b] {
                    continue; // what merely touches stays as it was placed
                }
                (stirred[a], stirred[b]) = (true, true);
                let away = if a < b { up } else { -up };
                let away = if bodies[b].mass.is_infinite() { up } else { away };
                let mut push = push.try_normalize().unwrap_or(away);
                if dimensions == 2 {
                    push.y = 0.0;
                }
                let share = 1.0 / (1.0 + bodies[a].mass / bodies[b].mass);
                moves[a] += push * (overlap * share.max(0.05));
            }
        }
        if moves.iter().all(|m| *m == DVec3::ZERO) {
            break;
        }
        for (body, step) in bodies.iter_mut().zip(moves) {
            body.x += step.clamp_length_max(diameter);
        }
    }
    let moved: Vec<f64> = bodies.iter().zip(&begin).map(|(b, x)| b.x.distance(*x)).filter(|&s| s > 0.0).collect();
    if !moved.is_empty() {
        warnings.push(format!(
            "{} bodies were moved by up to {:.4} m before time begins: some overlapped by {deepest:.4} m",
            moved.len(),
            moved.iter().copied().fold(0.0, f64::max)
        ));
    }
}
