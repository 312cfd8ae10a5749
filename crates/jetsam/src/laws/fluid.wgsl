// E1, E3 - E7: the fluid's laws. A law receives particles' own numbers and the kernel's W or G, never arrays.
//   V    rest volume of a particle (m^3; m^2 in a 2D scene): mass = rho_0 V
//   D    rho / rho_0, the sum of V_j W_ij
//   G    (1/r) dW/dr, so that grad_i W_ij = -G d_ij
//   d_ij = x_j - x_i,  v_ij = v_j - v_i

// E1, continuity: what a neighbour adds to dD_i/dt = sum_j V_j (v_i - v_j) . grad_i W_ij (1/s).
fn density_rate(V_j: f32, v_dot_d: f32, G: f32) -> f32 {
  return V_j * v_dot_d * G;
}

// E1, density diffusion (Antuono et al. 2012): what a neighbour adds to dD_i/dt, from the shares' difference less what
// rest under gravity makes of it (Fourtakas et al. 2019). rate = delta h c_0 / stiffness; weight = rho_0 g . d_ij, the
// difference of pressures at rest; its last factor is d(p / D^2)/dp at rest to first order.
fn density_diffusion(V_j: f32, share_i: f32, share_j: f32, weight: f32, rate: f32, stiffness: f32, G: f32) -> f32 {
  let squeezed = 0.5 * (share_i + share_j) / stiffness;
  return -2.0 * rate * V_j * G * (share_j - share_i - weight * (1.0 - 3.0 * squeezed));
}

// E1, continuity under implicit pressure, whose steps are too long for rates: sums grow by the integral of the rates, so D is the sum
// and what that lacked where the particle began, but no more than it lacked.
fn lacking(D: f32, sum: f32) -> f32 {
  return max(D - sum, 0.0);
}

// E3, linear: p = c^2 (rho - rho_0).  stiffness = c_0^2 rho_0 (Pa).
fn pressure_linear(D: f32, stiffness: f32) -> f32 {
  return stiffness * (D - 1.0);
}

// E3, Tait: p = B (D^7 - 1), B = c_0^2 rho_0 / 7.
fn pressure_tait(D: f32, stiffness: f32) -> f32 {
  let D_cu = D * D * D;
  return stiffness * 0.14285715 * (D_cu * D_cu * D - 1.0);
}

// E4, symmetric: what a particle brings to each of its pairs, p / D^2.
fn pressure_share(p: f32, D: f32) -> f32 {
  return p / (D * D);
}

// E4: factor of d_ij in the force on i, volumes = V_i V_j. Equal bits for (i, j) and (j, i).
fn pressure_force(volumes: f32, share_i: f32, share_j: f32, G: f32) -> f32 {
  return volumes * (share_i + share_j) * G;
}

// E5: 1 / (r^2 + softening), softening = 0.01 h^2; once for both viscosities.
fn softened_inverse(r_sq: f32, softening: f32) -> f32 {
  return 1.0 / (r_sq + softening);
}

// E5, artificial (Monaghan 1992), only for approaching pairs: factor of d_ij.
// eta = alpha rho_0 c_0 h (Pa s), inverse_sq = 1 / (r^2 + softening).
fn viscosity_artificial(volumes: f32, eta: f32, v_dot_d: f32, inverse_sq: f32, G: f32) -> f32 {
  return -volumes * eta * min(v_dot_d, 0.0) * inverse_sq * G;
}

// E5, laminar (Morris et al. 1997): factor of v_ij. mu_sum = mu_i + mu_j (Pa s).
fn viscosity_laminar(volumes: f32, mu_sum: f32, r_sq: f32, inverse_sq: f32, G: f32) -> f32 {
  return -volumes * mu_sum * G * (r_sq * inverse_sq);
}

// E5, Mueller et al. 2003: factor of v_ij. laplacian = nabla^2 W_ij of the viscosity kernel.
fn viscosity_mueller(volumes: f32, mu_sum: f32, laplacian: f32) -> f32 {
  return volumes * 0.5 * mu_sum * laplacian;
}

// E17 (Adami et al. 2012, eq. 27): the pressure a fluid particle f shows to a boundary particle b,
// p_f + rho_f (g - a_b) . (x_b - x_f).
fn pressure_at_boundary(p: f32, rho: f32, pull_dot_d: f32) -> f32 {
  return p + rho * pull_dot_d;
}

// E6, XSPH (Monaghan 1989): factor of v_ij in the velocity by which i is carried.
fn xsph(epsilon: f32, V_j: f32, W: f32) -> f32 {
  return epsilon * V_j * W;
}

// Particle shifting (Sun et al. 2017): factor of d_ij in the velocity, as a multiple of the largest speed, by which i
// is carried from where particles are dense. W_dx = W at the distance of one spacing; reach = H (m).
fn shifting(V_j: f32, W: f32, W_dx: f32, reach: f32, G: f32) -> f32 {
  let q = W / W_dx;
  let q_sq = q * q;
  return reach * V_j * (1.0 + 0.2 * q_sq * q_sq) * G;
}

// E7, cohesion (Akinci et al. 2013, eq. 2): shape of the attraction of a pair, repulsive when close; zero beyond s = 1.
fn cohesion_shape(s: f32) -> f32 {
  let t = max(1.0 - s, 0.0);
  let a = t * t * t * s * s * s;
  return select(2.0 * a - 0.015625, a, s > 0.5);
}

// E7, cohesion: factor of d_ij. strength = surface tension over the moment of the shape (N/m^d per m^d).
fn cohesion(volumes: f32, strength: f32, s: f32, r: f32) -> f32 {
  return volumes * strength * cohesion_shape(s) / max(r, 1e-12);
}

// E7, curvature (Akinci et al. 2013, eq. 5): factor of n_j - n_i, the colour gradients times H.
fn curvature(volumes: f32, strength: f32) -> f32 {
  return volumes * strength;
}
