// E30: acceleration at a point by fields that are not particles. d = x - centre.

// Point gravity with a softened core (Plummer): strength = G M (m^3/s^2), core (m).
fn point_gravity(d: vec3<f32>, strength: f32, core: f32) -> vec3<f32> {
  let s = dot(d, d) + core * core;
  return d * (-strength / (s * sqrt(s)));
}

// Drag towards a wind of velocity u: rate (1/s).
fn wind(v: vec3<f32>, u: vec3<f32>, rate: f32) -> vec3<f32> {
  return (u - v) * rate;
}

// Drag towards a vortex about the unit axis a: the swirl is solid inside the core and falls as 1/r outside
// (Rankine). speed (m/s) is reached at the core's radius.
fn vortex(d: vec3<f32>, v: vec3<f32>, a: vec3<f32>, speed: f32, core: f32, rate: f32) -> vec3<f32> {
  let radial = d - a * dot(d, a);
  let r_sq = dot(radial, radial);
  let u = cross(a, radial) * (speed * core / max(r_sq, core * core));
  return (u - v) * rate;
}

