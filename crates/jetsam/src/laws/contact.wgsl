// E10, E11, E12: contact of two particles of different bodies (Young and Erlebacher; Harada 2007).
//   d_ij = x_j - x_i,  v_ij = v_j - v_i,  r = |d_ij|
//   diameter: contact diameter (m), k: spring (N/m), eta: dashpot (N s/m)
//   normal_only: 0 for the seed's dashpot on the full relative velocity, 1 for its projection on d_ij

// E12: force on i, zero at and beyond the contact diameter. The force on j is its exact opposite.
fn contact_force(d_ij: vec3<f32>, v_ij: vec3<f32>, r: f32, diameter: f32, k: f32, eta: f32, normal_only: f32) -> vec3<f32> {
  let touching = select(0.0, 1.0, r < diameter);
  let inverse_r = 1.0 / max(r, 1e-12);
  let spring = -k * (diameter - r) * inverse_r;                                // E10
  let along = dot(v_ij, d_ij) * inverse_r * inverse_r;
  let dashpot = v_ij * (1.0 - normal_only) + d_ij * (along * normal_only);     // E11
  return (d_ij * spring + dashpot * eta) * touching;
}

// E14: damping ratio of restitution e, from ln e.
fn damping_ratio(ln_e: f32) -> f32 {
  return -ln_e / sqrt(9.8696044 + ln_e * ln_e);
}

// E14: dashpot of a spring k between two masses of reduced mass m.
fn dashpot(zeta: f32, k: f32, m: f32) -> f32 {
  return 2.0 * zeta * sqrt(k * m);
}
