// Joints (E32), the twin of joints.rs: impulses that keep bodies together (RATTLE), and springs. Joints are few and solved in their order:
// by one invocation.

const BALL: u32 = 0u;
const HINGE: u32 = 1u;
const FIXED: u32 = 2u;
const SPRING: u32 = 3u;
const SWEEPS: u32 = 200u;
// Misfit that counts as none, as a fraction of a spacing, or in rad; single precision cannot do better where sweeps no longer help.
const FIT: f32 = 2e-6;
const NEAR_FIT: f32 = 2e-4;

struct Joint {
  anchor_a: vec4<f32>, anchor_b: vec4<f32>,   // in the bodies' frames about their centres of mass (m), or in the world
  axis_a: vec4<f32>, axis_b: vec4<f32>, across_a: vec4<f32>, across_b: vec4<f32>,
  turn: vec4<f32>,        // orientation of a seen from b at the beginning
  law: vec4<f32>,         // spring constant (N/m), dashpot (N s/m), rest length (m), largest speed of the scene (m/s)
  limits: vec4<f32>,      // of a hinge (rad); z: 1 where there are any
  who: vec4<u32>,         // kind, body a, body b or GONE
}

// One end of a joint. x and x_low: place and what rounding left over of it.
struct End { x: vec3<f32>, x_low: vec3<f32>, q: vec4<f32>, arm: vec3<f32>, v: vec3<f32>, omega: vec3<f32>, moves: bool, body: u32 }

fn world_end(anchor: vec3<f32>) -> End {
  return End(anchor, vec3<f32>(0.0), vec4<f32>(0.0, 0.0, 0.0, 1.0), vec3<f32>(0.0), vec3<f32>(0.0), vec3<f32>(0.0), false, GONE);
}
// As it is now, in the midst of a step of which the velocities are known.
fn end_now(k: u32, anchor: vec3<f32>) -> End {
  if (k == GONE) { return world_end(anchor); }
  let b = bodies[k];
  return End(b.x.xyz, b.x_low.xyz, b.q, turn(b.q, anchor), b.v.xyz, b.omega.xyz, moves(b), k);
}
// As the drift will leave it; the arm is that before it, at which impulses act.
fn end_later(k: u32, anchor: vec3<f32>) -> End {
  var e = end_now(k, anchor);
  if (e.moves) {
    let b = bodies[k];
    e.q = times(turn_by(clock.part * spin_midway(b, b.l_half.high.xyz, clock.part)), b.q);
    e.v = velocity(b, b.p_half).high.xyz;
  } else { e.v = vec3<f32>(0.0); }
  return e;
}

fn inverse_of(a: mat3x3<f32>) -> mat3x3<f32> {
  let x = cross(a[1], a[2]);
  let y = cross(a[2], a[0]);
  let z = cross(a[0], a[1]);
  return transpose(mat3x3<f32>(x, y, z) * (1.0 / dot(a[0], x)));
}
fn inverse_inertia(k: u32) -> mat3x3<f32> {
  let b = bodies[k];
  return mat3x3<f32>(spin(b, b.q, vec3<f32>(1.0, 0.0, 0.0)), spin(b, b.q, vec3<f32>(0.0, 1.0, 0.0)), spin(b, b.q, vec3<f32>(0.0, 0.0, 1.0)));
}
// Velocity of the anchor by a unit impulse at it.
fn compliance(e: End) -> mat3x3<f32> {
  if (!e.moves) { return mat3x3<f32>(); }
  let r = e.arm;
  let c = mat3x3<f32>(0.0, r.z, -r.y, -r.z, 0.0, r.x, r.y, -r.x, 0.0);
  let w = bodies[e.body].x.w;
  return mat3x3<f32>(w, 0.0, 0.0, 0.0, w, 0.0, 0.0, 0.0, w) - c * inverse_inertia(e.body) * c;
}
fn turning(e: End) -> mat3x3<f32> {
  if (!e.moves) { return mat3x3<f32>(); }
  return inverse_inertia(e.body);
}

struct Impulses { push: vec3<f32>, turn: vec3<f32> }
// Impulse at the anchor and angular impulse on a that make up for differences of velocities.
fn impulses(j: Joint, a: End, b: End, q_a: vec4<f32>, v: vec3<f32>, omega: vec3<f32>) -> Impulses {
  let push = inverse_of(compliance(a) + compliance(b)) * v;
  if (all(omega == vec3<f32>(0.0))) { return Impulses(push, omega); }
  let k = turning(a) + turning(b);
  if (FLAT) { return Impulses(push, vec3<f32>(0.0, omega.y / k[1].y, 0.0)); }
  if (j.who.x == FIXED) { return Impulses(push, inverse_of(k) * omega); }
  // across the axis, and along it for a stop alone
  let axis = turn(q_a, j.axis_a.xyz);
  let s = turn(q_a, j.across_a.xyz);
  let t = cross(s, axis);
  let tt = dot(t, k * t);
  let ts = dot(t, k * s);
  let ss = dot(s, k * s);
  let u = dot(omega, t);
  let w = dot(omega, s);
  let det = tt * ss - ts * ts;
  let across = t * ((ss * u - ts * w) / det) + s * ((tt * w - ts * u) / det);
  return Impulses(push, across + axis * (dot(omega, axis) / dot(axis, k * axis)));
}

// How far a hinge has turned past a limit (rad): positive beyond the largest angle.
fn past_limit(j: Joint, q_a: vec4<f32>, q_b: vec4<f32>) -> f32 {
  if (j.limits.z == 0.0) { return 0.0; }
  let u_a = turn(q_a, j.across_a.xyz);
  let u_b = turn(q_b, j.across_b.xyz);
  let angle = atan2(dot(turn(q_b, j.axis_b.xyz), cross(u_b, u_a)), dot(u_b, u_a));
  if (angle > j.limits.y) { return angle - j.limits.y; }
  return min(angle - j.limits.x, 0.0);
}
// The rotation (rad) that a lacks, where the joint asks for one.
fn turn_misfit(j: Joint, q_a: vec4<f32>, q_b: vec4<f32>) -> vec3<f32> {
  if (j.who.x == FIXED) {
    var lack = times(times(q_b, j.turn), vec4<f32>(-q_a.xyz, q_a.w));
    if (lack.w < 0.0) { lack = -lack; }
    let size = length(lack.xyz);
    if (size < 1e-4) { return 2.0 * lack.xyz; }
    return lack.xyz * (2.0 * atan2(size, lack.w) / size);
  }
  if (j.who.x == HINGE) {
    let axis_b = turn(q_b, j.axis_b.xyz);
    return cross(turn(q_a, j.axis_a.xyz), axis_b) - axis_b * past_limit(j, q_a, q_b);
  }
  return vec3<f32>(0.0);
}

// Gives a the impulses and b their opposites.
fn give_one(e: End, push: vec3<f32>, turn: vec3<f32>, half: bool) {
  let b = bodies[e.body];
  let twist = cross(e.arm, push) + turn;
  if (half) {
    bodies[e.body].p_half = wide_sum(b.p_half, wide_vector(push));
    bodies[e.body].l_half = wide_sum(b.l_half, wide_vector(twist));
  } else {
    take_momenta(e.body, wide_sum(b.p, wide_vector(push)), wide_sum(b.l, wide_vector(twist)));
  }
}
fn give_both(a: End, b: End, i: Impulses, half: bool) {
  if (a.moves) { give_one(a, i.push, i.turn, half); }
  if (b.moves) { give_one(b, -i.push, -i.turn, half); }
  else { clock.joint_impulse += vec4<f32>(i.push, 0.0); }
}

// Corrects half-step momenta so that a joint fits after the drift; returns its misfit.
fn fit_place(j: Joint) -> f32 {
  let a = end_later(j.who.y, j.anchor_a.xyz);
  let b = end_later(j.who.z, j.anchor_b.xyz);
  let dt = clock.part;
  var tip_b = vec3<f32>(0.0);
  if (j.who.z != GONE) { tip_b = turn(b.q, j.anchor_b.xyz); }
  let gap = ((b.x - a.x) + (b.x_low - a.x_low)) + dt * (b.v - a.v) + (tip_b - turn(a.q, j.anchor_a.xyz));
  let misfit = turn_misfit(j, a.q, b.q);
  give_both(a, b, impulses(j, a, b, bodies[j.who.y].q, gap / dt, misfit / dt), true);
  return max(length(gap) / m.lower.w, length(misfit));
}
// Corrects velocities so that a joint's ends move alike; returns by how much they did not.
fn fit_velocity(j: Joint) -> f32 {
  let a = end_now(j.who.y, j.anchor_a.xyz);
  let b = end_now(j.who.z, j.anchor_b.xyz);
  let gap = (b.v + cross(b.omega, b.arm)) - (a.v + cross(a.omega, a.arm));
  let spun = b.omega - a.omega;
  var misfit = vec3<f32>(0.0);
  if (j.who.x == FIXED) { misfit = spun; }
  if (j.who.x == HINGE) {
    let axis = turn(a.q, j.axis_a.xyz);
    misfit = spun - axis * dot(spun, axis);
    // a stop takes what would turn the hinge further
    let beyond = past_limit(j, a.q, b.q);
    if (beyond != 0.0 && -dot(spun, axis) * beyond > 0.0) { misfit = spun; }
  }
  give_both(a, b, impulses(j, a, b, a.q, gap, misfit), false);
  return max(length(gap), length(misfit) * m.lower.w) / j.law.w;
}

// Solves all joints but springs, there and back, until the worst misfit is none.
fn sweep(places: bool) {
  var last = 3.4e38;
  var before_last = 3.4e38;
  for (var n = 0u; n < SWEEPS; n += 1u) {
    var worst = 0.0;
    for (var k = 0u; k < HAS_JOINTS; k += 1u) {
      let j = joints[select(k, HAS_JOINTS - 1u - k, n % 2u == 1u)];
      if (j.who.x == SPRING) { continue; }
      if (places) { worst = max(worst, fit_place(j)); } else { worst = max(worst, fit_velocity(j)); }
    }
    if (worst < FIT || (worst < NEAR_FIT && worst > 0.9 * before_last)) { break; }
    before_last = last;
    last = worst;
  }
}

@compute @workgroup_size(1)
fn joints_drift() {
  if (moving() && clock.drag == 0.0 && clock.part > 0.0) { sweep(true); }
}
@compute @workgroup_size(1)
fn joints_kick() {
  if (moving() && clock.drag == 0.0 && clock.part > 0.0) { sweep(false); }
}

// Adds the forces of springs to the bodies.
@compute @workgroup_size(1)
fn joints_pull() {
  if (!moving()) { return; }
  var outside = vec3<f32>(0.0);
  for (var k = 0u; k < HAS_JOINTS; k += 1u) {
    let j = joints[k];
    if (j.who.x != SPRING) { continue; }
    let a = end_now(j.who.y, j.anchor_a.xyz);
    let b = end_now(j.who.z, j.anchor_b.xyz);
    let d = ((b.x - a.x) + (b.x_low - a.x_low)) + (b.arm - a.arm);
    let v = (b.v + cross(b.omega, b.arm)) - (a.v + cross(a.omega, a.arm));
    let size = length(d);
    if (size == 0.0) { continue; }
    let along = d / size;
    let f = along * (j.law.x * (size - j.law.z) + j.law.y * dot(v, along));
    if (a.moves) { pull_one(a, f); } else { outside -= f; }
    if (b.moves) { pull_one(b, -f); } else { outside += f; }
  }
  clock.joint_force = vec4<f32>(outside, 0.0);
}
fn pull_one(e: End, f: vec3<f32>) {
  bodies[e.body].force += vec4<f32>(f, 0.0);
  bodies[e.body].torque += vec4<f32>(cross(e.arm, f), 0.0);
}
