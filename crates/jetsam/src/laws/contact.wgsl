// E10, E11, E12: contact of two particles of different bodies (Young and Erlebacher; Harada 2007).
//   d_ij = x_j - x_i,  v_ij = v_j - v_i,  r = |d_ij|
//   diameter: contact diameter (m), k: spring (N/m), eta: dashpot (N s/m)
//   normal_only: 0 for the seed's dashpot on the full relative velocity, 1 for its projection on d_ij
//   dt: length of the step (s) that this force stands for

// Part of the step about now in which the pair is in contact, by the overlap now and the speed along n_ij. The
// dashpot begins and ends with a jump; weighted so, a sum over steps meets the jump to second order.
fn contact_fraction(overlap: f32, speed: f32, dt: f32) -> f32 {
  let travel = abs(speed) * dt;
  let now = select(0.0, 1.0, overlap > 0.0);
  let part = clamp(0.5 + overlap / max(travel, 1e-30), 0.0, 1.0);
  return select(now, part, travel > 0.0);
}

// Mean overlap over the same part of the step: the spring sets in with a kink, met to second order alike.
fn contact_overlap(overlap: f32, speed: f32, dt: f32) -> f32 {
  let half = 0.5 * abs(speed) * dt;
  let ramp = (overlap + half) * (overlap + half) / max(4.0 * half, 1e-30);
  return select(max(overlap, 0.0), ramp, abs(overlap) < half);
}

// E12: force on i. The force on j is its exact opposite.
fn contact_force(d_ij: vec3<f32>, v_ij: vec3<f32>, r: f32, diameter: f32, k: f32, eta: f32, normal_only: f32, dt: f32) -> vec3<f32> {
  let inverse_r = 1.0 / max(r, 1e-12);
  let overlap = diameter - r;
  let speed = dot(v_ij, d_ij) * inverse_r;
  let spring = -k * contact_overlap(overlap, speed, dt) * inverse_r;                     // E10
  let dashpot = v_ij * (1.0 - normal_only) + d_ij * (speed * inverse_r * normal_only);   // E11
  return d_ij * spring + dashpot * (eta * contact_fraction(overlap, speed, dt));
}

// E14: damping ratio of restitution e, from ln e.
fn damping_ratio(ln_e: f32) -> f32 {
  return -ln_e / sqrt(9.8696044 + ln_e * ln_e);
}

// E14: dashpot of a spring k between two masses of reduced mass m.
fn dashpot(zeta: f32, k: f32, m: f32) -> f32 {
  return 2.0 * zeta * sqrt(k * m);
}

// Unit normal of a contact, from i towards j. A particle inside a flat face carries the face's outward normal (length 1,
// or 2 where the face is a sheet with two sides), others carry zero. Faces are planes, not rows of balls; where no
// face is there, or the pair stands beside it, the line of centres counts. Antisymmetric in i and j.
fn contact_normal(d_ij: vec3<f32>, r: f32, facing_i: vec3<f32>, facing_j: vec3<f32>) -> vec3<f32> {
  let line = d_ij * (1.0 / max(r, 1e-12));
  let sum = facing_towards(facing_i, line) - facing_towards(facing_j, -line);
  let size = length(sum);
  let normal = sum * (1.0 / max(size, 1e-12));
  if (size > 0.5 && dot(normal, line) > 0.25) {
    return normal;
  }
  return line;
}

// A sheet shows the side that looks along a direction; a face has one side.
fn facing_towards(facing: vec3<f32>, direction: vec3<f32>) -> vec3<f32> {
  if (dot(facing, facing) < 2.0) {
    return facing;
  }
  return facing * (0.5 * sign(dot(facing, direction)));
}

// Part that a particle of a face has in a contact beside it at a distance of `aside` spacings along the face. On a lattice of
// spacing 1 the parts of all particles sum to 1 (2 % at most off), so that a face is even.
fn contact_part(aside: f32) -> f32 {
  let s = min(aside, 1.0);
  return (1.0 - s) * (1.0 + 0.5 * s - s * s);
}

// E13: the tangential pull of spring and dashpot, no stronger than friction allows.
fn friction(pull: vec3<f32>, limit: f32) -> vec3<f32> {
  return pull * min(1.0, limit / max(length(pull), 1e-30));
}

// E13: the slip of a contact, carried along as the contact turns: about its normal by `turn` (rad) and with the tangent plane, as
// long as it was (Luding 2008).
fn slip_carried(slip: vec3<f32>, n: vec3<f32>, turn: f32) -> vec3<f32> {
  let size = length(slip);
  let turned = slip + cross(n, slip) * turn;
  let flat = turned - n * dot(turned, n);
  return flat * min(size / max(length(flat), 1e-30), 4.0);
}
