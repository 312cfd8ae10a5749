// E3, E4, E5, E6: the fluid's laws. A law receives particles' own numbers and the kernel's W or G, never arrays.
//   V    rest volume of a particle (m^3; m^2 in a 2D scene): mass = rho_0 V
//   D    rho / rho_0, the sum of V_j W_ij
//   G    (1/r) dW/dr, so that grad_i W_ij = -G d_ij
//   d_ij = x_j - x_i,  v_ij = v_j - v_i

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

// E5, artificial (Monaghan 1992), only for approaching pairs: factor of d_ij.
// eta = alpha rho_0 c_0 h (Pa s), softening = 0.01 h^2.
fn viscosity_artificial(volumes: f32, eta: f32, v_dot_d: f32, r_sq: f32, softening: f32, G: f32) -> f32 {
  return -volumes * eta * min(v_dot_d, 0.0) / (r_sq + softening) * G;
}

// E5, laminar (Morris et al. 1997): factor of v_ij. mu_sum = mu_i + mu_j (Pa s).
fn viscosity_laminar(volumes: f32, mu_sum: f32, r_sq: f32, softening: f32, G: f32) -> f32 {
  return -volumes * mu_sum * G * r_sq / (r_sq + softening);
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
