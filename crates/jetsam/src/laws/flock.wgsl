// E22-E27: flocks. d = x_j - x_i from the agent that perceives to the one perceived; v_i, v_j velocities.
// Weights are pure numbers; the caller brings a speed U and a radius R, and T = R / U makes rates of them.

fn unit(v: vec3<f32>) -> vec3<f32> {
  return v / max(length(v), 1e-30);
}

// 1 inside a radius, else 0. The agent itself is inside.
fn within(r_sq: f32, radius_sq: f32) -> f32 {
  return select(0.0, 1.0, r_sq < radius_sq);
}

// 1 between two radii, the agent itself (r = 0) not counted, else 0.
fn between(r_sq: f32, inner_sq: f32, outer_sq: f32) -> f32 {
  return select(0.0, 1.0, r_sq >= inner_sq && r_sq < outer_sq && r_sq > 0.0);
}

// Field of view: 1 where the angle between v_i and d is at most half of it. bound = cos(half) |cos(half)|.
fn in_view(v_dot_d: f32, r_sq: f32, speed_sq: f32, bound: f32) -> f32 {
  return select(0.0, 1.0, v_dot_d * abs(v_dot_d) >= bound * r_sq * speed_sq);
}

// E22 separation: factor of -d, so that the push is R/r - r/R along it: 1/r close by (Reynolds 1999), nothing at R.
fn separation(r_sq: f32, radius: f32) -> f32 {
  return max(radius / max(r_sq, 1e-30) - 1.0 / radius, 0.0);
}

// E26: factor of d for one that is fled or chased; the nearest counts most.
fn nearness(r_sq: f32) -> f32 {
  return 1.0 / max(r_sq, 1e-30);
}

// E22 alignment: approach to the mean velocity of those seen and oneself. rate = weight / T.
fn alignment(v: vec3<f32>, mean: vec3<f32>, rate: f32) -> vec3<f32> {
  return (mean - v) * rate;
}

// E22 cohesion: towards the mean place of those seen, `mean` relative to oneself. rate_sq = weight / T^2.
fn cohere(mean: vec3<f32>, rate_sq: f32) -> vec3<f32> {
  return mean * rate_sq;
}

// Return to the speed at which the agent cruises.
fn cruise(v: vec3<f32>, speed: f32, rate: f32) -> vec3<f32> {
  return v * ((speed / max(length(v), 1e-30) - 1.0) * rate);
}

// E22 seek (Reynolds 1999): steer for the velocity that leads to d away at full speed; arrive: slower inside `slow`.
fn seek(v: vec3<f32>, d: vec3<f32>, speed: f32, slow: f32, rate: f32) -> vec3<f32> {
  let ramp = min(length(d) / max(slow, 1e-30), 1.0);
  return (unit(d) * (speed * ramp) - v) * rate;
}

// E22 flee: away along the unit vector `away`; `closeness` is 1 near and 0 at the edge of sight.
fn flee(v: vec3<f32>, away: vec3<f32>, speed: f32, closeness: f32, rate: f32) -> vec3<f32> {
  return (away * speed - v) * (rate * closeness);
}

// A side of the domain: how far inside its margin an agent is, 0 to 1.
fn side(distance: f32, margin: f32) -> f32 {
  return clamp(1.0 - distance / max(margin, 1e-30), 0.0, 1.0);
}

// Steering is limited in size.
fn limited(a: vec3<f32>, largest: f32) -> vec3<f32> {
  let size = length(a);
  return a * min(largest / max(size, 1e-30), 1.0);
}

// Direction `to` (unit), but turned away from `from` (unit) by no more than the angle with this cosine and sine.
// Without branches, for many agents at once: a weight of 0 or 1 chooses.
fn turned(unit_from: vec3<f32>, unit_to: vec3<f32>, cosine: f32, sine: f32) -> vec3<f32> {
  let along = dot(unit_from, unit_to);
  let across = unit_to - unit_from * along;
  let size = length(across);
  let behind = size < 1e-6;   // straight behind: no side to turn to
  let bent = unit_from * select(cosine, 1.0, behind) + across * select(sine / max(size, 1e-6), 0.0, behind);
  let free = select(0.0, 1.0, along >= cosine);
  return unit_to * free + bent * (1.0 - free);
}

// E22: velocity after a step, with turn and speed limits. An agent at rest may turn anywhere; one that stops keeps its direction.
fn moved(v: vec3<f32>, a: vec3<f32>, dt: f32, cosine: f32, sine: f32, slowest: f32, fastest: f32) -> vec3<f32> {
  let wanted = v + a * dt;
  let speed = length(wanted);
  let heading = unit(v);
  let stops = select(0.0, 1.0, speed < 1e-12);
  let to = wanted / max(speed, 1e-12) * (1.0 - stops) + heading * stops;
  return turned(heading, to, select(cosine, -2.0, dot(heading, heading) < 0.5), sine) * clamp(speed, slowest, fastest);
}

// E23 (Couzin et al. 2002): direction wanted, from the sums over the zones of repulsion, orientation and attraction.
fn couzin(repelled: vec3<f32>, oriented: vec3<f32>, attracted: vec3<f32>, heading: vec3<f32>) -> vec3<f32> {
  let near = dot(repelled, repelled);
  let far = unit(oriented) + unit(attracted);
  if (near > 1e-12) { return unit(repelled); }
  if (dot(far, far) > 1e-12) { return unit(far); }
  return heading;
}

// E27: drag on an agent that moves at u through fluid of this density. half_area = C_d A / 2; time = dt (1 / m + 1 / M), the step and the
// masses of agent and fluid, which together must not turn round: beyond what a step can take the force is cut, to second order.
fn drag(u: vec3<f32>, density: f32, half_area: f32, time: f32) -> vec3<f32> {
  let rate = half_area * density * length(u);
  let part = rate * time;
  return u * (-rate / (1.0 + part * part));
}

// E23, E24: a unit direction turned by an angle (given by its cosine and sine) towards the unit vector `axis`, which is normal to it.
fn swung(direction: vec3<f32>, axis: vec3<f32>, cosine: f32, sine: f32) -> vec3<f32> {
  return direction * cosine + axis * sine;
}
