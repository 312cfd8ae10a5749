// Rigid bodies, the twin of bodies.rs: drift and kick (E20), forces and torques summed (E18).

// A vector turned by q and made |q|^2 times as long: what is missing of |q| = 1 must not bend it.
fn turned_evenly(q: vec4<f32>, v: vec3<f32>) -> vec3<f32> {
  return v * (q.w * q.w - dot(q.xyz, q.xyz)) + 2.0 * (q.w * cross(q.xyz, v) + q.xyz * dot(q.xyz, v));
}
// I^-1 L in world axes for the orientation q: in single precision, and as bodies are integrated.
fn spin(b: Body, q: vec4<f32>, l: vec3<f32>) -> vec3<f32> {
  let own = turned_evenly(vec4<f32>(-q.xyz, q.w), l);
  return turned_evenly(q, b.inertia_x.high.xyz * own.x + b.inertia_y.high.xyz * own.y + b.inertia_z.high.xyz * own.z);
}
fn wide_spin(b: Body, q: Wide, l: Wide) -> Wide {
  let own = wide_turned(inverse_turn(q), l);
  let x = wide_product(b.inertia_x, Wide(own.high.xxxx, own.low.xxxx));
  let y = wide_product(b.inertia_y, Wide(own.high.yyyy, own.low.yyyy));
  let z = wide_product(b.inertia_z, Wide(own.high.zzzz, own.low.zzzz));
  return wide_turned(q, wide_sum(x, wide_sum(y, z)));
}
fn velocity(b: Body, p: Wide) -> Wide {
  let v = wide_product(p, Wide(b.x.wwww, b.x_low.wwww));
  return Wide(vec4<f32>(v.high.xyz, 0.0), vec4<f32>(v.low.xyz, 0.0));
}

// Whether bodies make a part of a step now.
fn moving() -> bool { return clock.running != 0u && clock.idle == 0u; }
// The bodies that take part in it: all at a step's end.
fn movers() -> u32 { return select(m.count.w, m.movers.x, clock.mid != 0u); }
fn moves(b: Body) -> bool { return b.x.w > 0.0 && !asleep(b); }
fn first_kick() -> f32 { return select(clock.part, 0.5 * clock.part, LEAPFROG); }

// Momenta after a force and a torque have acted for a while.
fn pushed_on(p: Wide, push: vec3<f32>, time: f32) -> Wide {
  return wide_sum(p, exact_product(vec4<f32>(push, 0.0), vec4<f32>(time)));
}
// A body takes momenta, and the velocities that belong to them.
fn take_momenta(k: u32, p: Wide, l: Wide) {
  let b = bodies[k];
  let omega = wide_spin(b, Wide(b.q, b.q_low), l);
  bodies[k].p = p;
  bodies[k].v = velocity(b, p).high;
  bodies[k].l = l;
  bodies[k].omega = omega.high;
  bodies[k].omega_low = omega.low;
}
// A body takes a place.
fn take_place(k: u32, x: Wide) {
  let at = wide_sum(x, wide_vector(way_home(x.high.xyz)));
  bodies[k].x = at.high;
  bodies[k].x_low = at.low;
}
fn take_orientation(k: u32, q: Wide) {
  bodies[k].q = q.high;
  bodies[k].q_low = q.low;
}

// E20: half a kick.
fn half_kick(k: u32) {
  bodies[k].p_half = pushed_on(bodies[k].p, bodies[k].force.xyz, first_kick());
  bodies[k].l_half = pushed_on(bodies[k].l, bodies[k].torque.xyz, first_kick());
}
@compute @workgroup_size(64)
fn half_kick_bodies(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 64u);
  if (!moving() || k >= movers() || clock.drag > 0.0 || !moves(bodies[k])) { return; }
  half_kick(k);
}

// The angular velocity half-way through a free turn with constant angular momentum: implicit midpoint rule.
fn spin_midway(b: Body, l_half: vec3<f32>, dt: f32) -> vec3<f32> {
  var w = spin(b, b.q, l_half);
  for (var round = 0; round < 6; round += 1) { w = spin(b, times(turn_by(0.5 * dt * w), b.q), l_half); }
  return w;
}
// Orientation after the turn. Each round brings the angular velocity nearer by a factor of omega dt / 2: single precision comes first.
fn turned_body(b: Body, l_half: Wide, dt: f32) -> Wide {
  let q = Wide(b.q, b.q_low);
  var w = wide_vector(spin_midway(b, l_half.high.xyz, dt));
  for (var round = 0; round < 2; round += 1) { w = wide_spin(b, wide_times(wide_turn_by(scaled(w, 0.5 * dt)), q), l_half); }
  return wide_unit(wide_times(wide_turn_by(scaled(w, dt)), q));
}

@compute @workgroup_size(64)
fn drift_bodies(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 64u);
  if (!moving() || k >= movers() || clock.drag > 0.0 || !moves(bodies[k])) { return; }
  if (HAS_JOINTS == 0u) { half_kick(k); }   // else joints have corrected it meanwhile
  let b = bodies[k];
  let dt = clock.part;
  let rest = dt - first_kick();
  take_place(k, wide_sum(Wide(b.x, b.x_low), scaled(velocity(b, b.p_half), dt)));
  take_orientation(k, turned_body(b, b.l_half, dt));
  take_momenta(k, pushed_on(b.p_half, b.force.xyz, rest), pushed_on(b.l_half, b.torque.xyz, rest));
  if (IMPLICIT) { swept[k].impulse += first_kick() * swept[k].outside; }
}

const PART: u32 = 128u;
var<workgroup> tree: array<PartSum, PART>;

fn plus(a: PartSum, b: PartSum) -> PartSum {
  return PartSum(a.force + b.force, a.fluid + b.fluid, a.contact + b.contact, a.torque + b.torque,
                 a.torque_fluid + b.torque_fluid, a.torque_contact + b.torque_contact);
}

// A slot takes over the slips of its contacts; none where it is outside the domain.
fn take_slips(s: u32, inside: bool) {
  for (var k = 0u; k < 8u; k += 1u) {
    var held = vec4<u32>(0u, 0u, 0u, GONE);
    if (inside) { held = slips[m.count.y + s].held[k]; }
    slips[s].held[k] = held;
    if (held.w == GONE) { break; }
  }
}

// One workgroup sums 128 slots, those of each part by themselves and in a fixed order (a segmented reduction), and each slot takes over
// the slips of its contacts.
@compute @workgroup_size(128)
fn sum_parts(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let s = number(g, n, l, PART);
  var own = PartSum();
  var part = Part();
  if (s < m.count.z && moving()) {
    part = parts[slots[s].part];
    let at = slots[s].place;
    if (at != GONE) {
      let f = push[at].xyz;
      let t = touch[at - m.count.x];
      let arm = turn(bodies[part.body].q, slots[s].offset.xyz);
      own.force = vec4<f32>(f, t.contact.w);
      own.fluid = vec4<f32>(t.fluid.xyz, t.fluid.w);
      own.contact = vec4<f32>(t.contact.xyz, t.couple.w);
      own.torque = vec4<f32>(cross(arm, f) + t.couple.xyz, push[at].w);
      own.torque_fluid = vec4<f32>(cross(arm, t.fluid.xyz), 0.0);
      own.torque_contact = vec4<f32>(cross(arm, t.contact.xyz) + t.couple.xyz, 0.0);
    }
    // one that sleeps remembers what it knew before
    if (RUBS && s < m.count.y && !asleep(bodies[part.body])) { take_slips(s, at != GONE); }
  }
  tree[l] = own;
  workgroupBarrier();
  for (var reach = 1u; reach < PART; reach *= 2u) {
    let joins = s + reach < part.end;
    if (joins) { own = plus(own, tree[l + reach]); }
    workgroupBarrier();
    if (joins) { tree[l] = own; }
    workgroupBarrier();
  }
  if (s == part.first && s < part.end) { part_sums[slots[s].part] = own; }
}

@compute @workgroup_size(64)
fn sum_bodies(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 64u);
  if (!moving() || k >= movers()) { return; }
  let b = bodies[k];
  var s = PartSum();
  for (var p = b.counts.z; p < b.counts.z + b.counts.w; p += 1u) { s = plus(s, part_sums[p]); }
  if (FLAT) {
    s.torque = vec4<f32>(0.0, s.torque.y, 0.0, s.torque.w);
    s.torque_fluid = vec4<f32>(0.0, s.torque_fluid.y, 0.0, 0.0);
    s.torque_contact = vec4<f32>(0.0, s.torque_contact.y, 0.0, 0.0);
  }
  let stirred = select(0u, STIRRED, s.torque.w > 0.0);
  if (asleep(b)) {
    // what it felt last still holds
    bodies[k].counts.y = (b.counts.y & (NEAR_THROUGH | ASLEEP)) | stirred;
    return;
  }
  var force = s.force.xyz;
  var torque = s.torque.xyz;
  if (b.stated.w > 0.0) {
    force -= s.fluid.xyz;
    torque -= s.torque_fluid.xyz;
  }
  let pushed = moves(b);
  if (pushed) { force += b.p.high.w * clock.gravity.xyz; }
  let contacts = u32(s.force.w);
  let far = contacts > 0u && length(b.v.xyz) * clock.part > 0.5 * m.period.w;
  let deep = pushed && (s.contact.w > 0.0 || far);
  bodies[k].force = vec4<f32>(force, select(0.0, s.fluid.w, pushed));
  bodies[k].torque = vec4<f32>(torque, 0.0);
  bodies[k].force_fluid = vec4<f32>(s.fluid.xyz, 0.0);
  bodies[k].force_contact = vec4<f32>(s.contact.xyz, 0.0);
  bodies[k].torque_fluid = vec4<f32>(s.torque_fluid.xyz, 0.0);
  bodies[k].torque_contact = vec4<f32>(s.torque_contact.xyz, 0.0);
  let fresh = deep && (b.counts.y & NEAR_THROUGH) == 0u;
  let bits = select(0u, NEAR_THROUGH, deep) | select(0u, NEWLY, fresh) | stirred;
  bodies[k].counts = vec4<u32>(contacts, bits, b.counts.z, b.counts.w);
}

// E20: the kick that ends a step.
@compute @workgroup_size(64)
fn kick_bodies(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 64u);
  if (clock.running == 0u || k >= m.count.w || clock.drag > 0.0) { return; }
  if (moves(bodies[k])) { kick_body(k, bodies[k].force.xyz, bodies[k].torque.xyz); }
  doze(k);
}
fn kick_body(k: u32, force: vec3<f32>, torque: vec3<f32>) {
  if (!LEAPFROG) { return; }
  let half = 0.5 * clock.part;
  take_momenta(k, pushed_on(bodies[k].p_half, force, half), pushed_on(bodies[k].l_half, torque, half));
}
