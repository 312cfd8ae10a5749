// E9: pressures that keep densities from rising, found by iteration (DFSPH, PBF).
//   e_ij = V_j grad_i W_ij = -V_j G d_ij      share s = p / D^2, the multiplier of D_i <= 1 over V_i
//   Forces are those of E4, so that densities answer to shares by the transpose of what shares push with.

// Factor of d_ij in e_ij.
fn link(V_j: f32, G: f32) -> f32 {
  return -V_j * G;
}

// How fast, per unit of its own share, the density of i is driven down (1/(Pa s^2)); alpha of Bender and Koschier 2015,
// eq. 8. all_sq = |sum e_ij|^2, with bodies and walls as often as in what pushes and in the rates; pairs = sum |e_ij|^2 / rho_j over fluids.
// Never below least (1/m^2), a part of what it is on a resting lattice: of a particle driven in among those of a wall both sums are next to
// nothing, and an error over a response so small would throw it out (the relaxation of Macklin and Mueller 2013, eq. 11).
fn response(all_sq: f32, inverse_rho: f32, pairs: f32, least: f32) -> f32 {
  return max(all_sq * inverse_rho + pairs, least * inverse_rho);
}

// A share after one more round. error = what D is above 1, or its rate above 0; went = what the last round changes it by still; least:
// fluids bear no tension, so 0, or the opposite of what the particle has been pushed with before.
fn relaxed(share: f32, error: f32, rate: f32, went: f32, least: f32) -> f32 {
  return max(share + error * rate + went, least);
}

// Of round k = 0, 1, 2, ..: the part of the last change that is kept, and the factor of Jacobi's step. Residuals then are Chebyshev
// polynomials of the fourth kind: of all polynomials of so few rounds those that leave least of what is slow (Lottes 2023, alg. 3).
fn carried(k: f32) -> f32 {
  return max(2.0 * k - 1.0, 0.0) / (2.0 * k + 3.0);
}
fn stride(k: f32) -> f32 {
  return (8.0 * k + 4.0) / (2.0 * k + 3.0);
}

// The part of the shares of the last step, of dt_before, with which PBF begins: what corrected places in a shorter step would move them
// farther in a longer one. Shares that errors are added to step after step control places by their integral: whatever rounds leave then
// grows, unless at least half of them is forgotten.
fn recalled(dt_before: f32, dt: f32) -> f32 {
  let ratio = dt_before / max(dt, 1e-30);
  return 0.5 * min(ratio * ratio, 1.0);
}

// Where the share that corrects a place begins: at half of what it was at the last step (Bender and Koschier 2015), but with no more than
// moves the density by 3 % in a step dt, so that what was thrown together does not throw on.
fn begun(before: f32, response: f32, dt: f32) -> f32 {
  return min(0.5 * before, 0.03 / (response * dt * dt));
}

// E17, pair by pair: a body's particle shows the pressure of the fluid's, p_i + rho_i (g - a_b) . d_ib. The part of gravity
// fades out with p_i, so that no pair pulls: factor of the second term in the sum of both shares.
fn hold(share: f32, limit: f32) -> f32 {
  return min(2.0 * share / limit, 1.0);
}

// What more of it a share brings to one that has pushed already.
fn hold_more(base: f32, share: f32, limit: f32) -> f32 {
  return hold(base + share, limit) - hold(base, limit);
}

// Sum of the shares of a fluid particle and a body's.
fn share_at_boundary(share: f32, hold: f32, pull_dot_d: f32) -> f32 {
  return 2.0 * share + hold * pull_dot_d;
}

// The coarse level: shares at nodes, linear on each axis between them. Where x is between two nodes: 0 at the first, 1 at the second.
fn part_way(x: f32, first: f32, per_metre: f32) -> f32 {
  return clamp((x - first) * per_metre, 0.0, 1.0);
}

// What shares with the value s and the gradient g at a particle push it by, sum_i s_i e_ki + s (all) = s b + K g: b by shares that are 1
// everywhere, as accelerations push = -b / rho; K = sum d e in the mean of all directions. Factors of s and of g; their squares are in
// compression by Pa^2.
fn by_value(push: f32, inverse_rho: f32, scale: f32) -> f32 {
  return -push * sqrt(scale / inverse_rho);
}
fn by_slope(spread: f32, inverse_rho: f32, scale: f32) -> f32 {
  return spread * sqrt(scale * inverse_rho);
}
