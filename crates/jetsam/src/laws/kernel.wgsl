// E2: smoothing kernels as functions of s = r / H, H the support radius.
//   W(r) = norm / H^d  w(s)          (1/r) dW/dr = norm / H^(d+2)  g(s),   g(s) = w'(s) / s
// Norms depend on the dimension d and are passed in by the caller (laws/kernel.rs has the table).
// Every function is zero at and beyond s = 1. Names must not end in a digit (they become Rust too).

fn cubic_w(s: f32) -> f32 {                       // Monaghan 1992, q = 2 s
  let t = max(1.0 - s, 0.0);
  let u = max(0.5 - s, 0.0);
  return 2.0 * t * t * t - 8.0 * u * u * u;
}
fn cubic_g(s: f32) -> f32 {
  let t = max(1.0 - s, 0.0);
  let u = max(0.5 - s, 0.0);
  let near = -12.0 + 18.0 * s;                    // finite at s = 0
  let far = -6.0 * t * t / max(s, 0.25);
  if (u > 0.0) { return near; }
  return far;
}

fn wendland_quintic_w(s: f32) -> f32 {            // C2, Wendland 1995
  let t = max(1.0 - s, 0.0);
  let t_sq = t * t;
  return t_sq * t_sq * (4.0 * s + 1.0);
}
fn wendland_quintic_g(s: f32) -> f32 {
  let t = max(1.0 - s, 0.0);
  return -20.0 * t * t * t;
}

fn wendland_sextic_w(s: f32) -> f32 {             // C4, Wendland 1995
  let t = max(1.0 - s, 0.0);
  let t_cu = t * t * t;
  return t_cu * t_cu * ((11.666667 * s + 6.0) * s + 1.0);
}
fn wendland_sextic_g(s: f32) -> f32 {
  let t = max(1.0 - s, 0.0);
  let t_sq = t * t;
  return -18.666667 * t_sq * t_sq * t * (5.0 * s + 1.0);
}

fn quintic_w(s: f32) -> f32 {                     // Morris 1997, q = 3 s
  let a = max(1.0 - s, 0.0);
  let b = max(0.6666667 - s, 0.0);
  let c = max(0.33333334 - s, 0.0);
  let a_sq = a * a;
  let b_sq = b * b;
  let c_sq = c * c;
  return 243.0 * (a_sq * a_sq * a - 6.0 * b_sq * b_sq * b + 15.0 * c_sq * c_sq * c);
}
fn quintic_g(s: f32) -> f32 {
  let a = max(1.0 - s, 0.0);
  let b = max(0.6666667 - s, 0.0);
  let a_sq = a * a;
  let b_sq = b * b;
  let far = -1215.0 * (a_sq * a_sq - 6.0 * b_sq * b_sq) / max(s, 0.1);
  let near = -1080.0 + s * s * (9720.0 - 12150.0 * s);  // the polynomial of the inner third, divided by s
  if (s < 0.33333334) { return near; }
  return far;
}

fn poly_six_w(s: f32) -> f32 {                    // Mueller 2003
  let t = max(1.0 - s * s, 0.0);
  return t * t * t;
}
fn poly_six_g(s: f32) -> f32 {
  let t = max(1.0 - s * s, 0.0);
  return -6.0 * t * t;
}

fn spiky_w(s: f32) -> f32 {                       // Mueller 2003; its slope does not vanish at s = 0
  let t = max(1.0 - s, 0.0);
  return t * t * t;
}
fn spiky_g(s: f32) -> f32 {
  let t = max(1.0 - s, 0.0);
  return -3.0 * t * t / max(s, 1e-4);
}

fn viscosity_w(s: f32) -> f32 {                   // Mueller 2003, three dimensions; singular at s = 0
  let q = clamp(s, 1e-4, 1.0);
  return -0.5 * q * q * q + q * q + 0.5 / q - 1.0;
}
fn viscosity_laplacian(s: f32) -> f32 {           // H^2 nabla^2 W, up to its norm: linear, positive
  return max(1.0 - s, 0.0);
}
