// Rigid bodies, the twin of bodies.rs: drift and kick (E20), forces and torques summed (E18).

// A vector turned by q and made |q|^2 times as long: what is missing of |q| = 1 must not bend it.
fn turned_evenly(q: vec4<f32>, v: vec3<f32>) -> vec3<f32> {
  return v * (q.w * q.w - dot(q.xyz, q.xyz)) + 2.0 * (q.w * cross(q.xyz, v) + q.xyz * dot(q.xyz, v));
}
// I^-1 L in world axes for the orientation q.
fn spin(b: Body, q: vec4<f32>, l: vec3<f32>) -> vec3<f32> {
  let own = turned_evenly(vec4<f32>(-q.xyz, q.w), l);
  return turned_evenly(q, b.inertia_x.xyz * own.x + b.inertia_y.xyz * own.y + b.inertia_z.xyz * own.z);
}

// Whether bodies make a part of a step now.
fn moving() -> bool { return clock.running != 0u && clock.idle == 0u; }
// The bodies that take part in it: all at a step's end.
fn movers() -> u32 { return select(m.count.w, m.movers.x, clock.mid != 0u); }
fn moves(b: Body) -> bool { return b.x.w > 0.0; }
fn first_kick() -> f32 { return select(clock.part, 0.5 * clock.part, LEAPFROG); }

// E20: half a kick.
fn half_kicked(b: Body) -> Body {
  var now = b;
  let p = kept(b.p.xyz, b.p_rest.xyz, first_kick() * b.force.xyz);
  let l = kept(b.l.xyz, b.l_rest.xyz, first_kick() * b.torque.xyz);
  now.p_half = vec4<f32>(p.sum, 0.0);
  now.p_rest = vec4<f32>(p.rest, 0.0);
  now.l_half = vec4<f32>(l.sum, 0.0);
  now.l_rest = vec4<f32>(l.rest, 0.0);
  return now;
}
@compute @workgroup_size(64)
fn half_kick_bodies(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 64u);
  if (!moving() || k >= movers() || clock.drag > 0.0 || !moves(bodies[k])) { return; }
  let b = half_kicked(bodies[k]);
  bodies[k].p_half = b.p_half;
  bodies[k].p_rest = b.p_rest;
  bodies[k].l_half = b.l_half;
  bodies[k].l_rest = b.l_rest;
}

// Orientation after a free turn with constant angular momentum: implicit midpoint rule.
fn turned_body(b: Body, l_half: vec3<f32>, dt: f32) -> Orientation {
  var w = spin(b, b.q, l_half);
  for (var round = 0; round < 6; round += 1) {
    w = spin(b, b.q + (times(turned_more(0.5 * dt * w), b.q) - b.q_rest), l_half);
  }
  return turned_on(b.q, b.q_rest, dt * w);
}

@compute @workgroup_size(64)
fn drift_bodies(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 64u);
  if (!moving() || k >= movers() || clock.drag > 0.0 || !moves(bodies[k])) { return; }
  var b = bodies[k];
  if (HAS_JOINTS == 0u) { b = half_kicked(b); }   // else joints have corrected it meanwhile
  let dt = clock.part;
  let rest = dt - first_kick();
  let moved_x = kept(b.x.xyz, b.rest.xyz, dt * b.p_half.xyz / b.rest.w);
  let turned = turned_body(b, b.l_half.xyz, dt);
  let now = b.l_half.xyz + rest * b.torque.xyz;
  bodies[k].x = vec4<f32>(home_all(moved_x.sum), b.x.w);
  bodies[k].rest = vec4<f32>(moved_x.rest, b.rest.w);
  bodies[k].q = turned.q;
  bodies[k].q_rest = turned.rest;
  bodies[k].p_rest = b.p_rest;
  bodies[k].l_rest = b.l_rest;
  bodies[k].p_half = b.p_half;
  bodies[k].l_half = b.l_half;
  let p = b.p_half.xyz + rest * b.force.xyz;
  bodies[k].p = vec4<f32>(p, 0.0);
  bodies[k].v = vec4<f32>(p / b.rest.w, 0.0);
  bodies[k].l = vec4<f32>(now, 0.0);
  bodies[k].omega = vec4<f32>(spin(b, turned.q, now), 0.0);
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

// One workgroup sums the slots of a part of a body in a fixed order, and each slot takes over the slips of its contacts.
@compute @workgroup_size(128)
fn sum_parts(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = g.y * n.x + g.x;
  var own = PartSum();
  if (k < m.more.x && moving()) {
    let part = parts[k];
    let s = part.first + l;
    if (s < part.end) {
      let at = slots[s].place;
      if (at != GONE) {
        let f = push[at].xyz;
        let t = touch[at - m.count.x];
        let arm = turn(bodies[part.body].q, slots[s].offset.xyz);
        own.force = vec4<f32>(f, t.contact.w);
        own.fluid = vec4<f32>(t.fluid.xyz, t.fluid.w);
        own.contact = vec4<f32>(t.contact.xyz, t.couple.w);
        own.torque = vec4<f32>(cross(arm, f) + t.couple.xyz, 0.0);
        own.torque_fluid = vec4<f32>(cross(arm, t.fluid.xyz), 0.0);
        own.torque_contact = vec4<f32>(cross(arm, t.contact.xyz) + t.couple.xyz, 0.0);
      }
      if (RUBS && s < m.count.y) { take_slips(s, at != GONE); }
    }
  }
  tree[l] = own;
  workgroupBarrier();
  for (var reach = PART / 2u; reach > 0u; reach /= 2u) {
    if (l < reach) { tree[l] = plus(tree[l], tree[l + reach]); }
    workgroupBarrier();
  }
  if (l == 0u && k < m.more.x && moving()) { part_sums[k] = tree[0]; }
}

@compute @workgroup_size(64)
fn sum_bodies(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 64u);
  if (!moving() || k >= movers()) { return; }
  let b = bodies[k];
  var s = PartSum();
  for (var p = b.counts.z; p < b.counts.z + b.counts.w; p += 1u) { s = plus(s, part_sums[p]); }
  if (FLAT) {
    s.torque = vec4<f32>(0.0, s.torque.y, 0.0, 0.0);
    s.torque_fluid = vec4<f32>(0.0, s.torque_fluid.y, 0.0, 0.0);
    s.torque_contact = vec4<f32>(0.0, s.torque_contact.y, 0.0, 0.0);
  }
  var force = s.force.xyz;
  var torque = s.torque.xyz;
  if (b.stated.w > 0.0) {
    force -= s.fluid.xyz;
    torque -= s.torque_fluid.xyz;
  }
  let pushed = moves(b);
  if (pushed) { force += b.rest.w * clock.gravity.xyz; }
  let contacts = u32(s.force.w);
  let far = contacts > 0u && length(b.v.xyz) * clock.part > 0.5 * m.period.w;
  let deep = pushed && (s.contact.w > 0.0 || far);
  bodies[k].force = vec4<f32>(force, select(0.0, s.fluid.w, pushed));
  bodies[k].torque = vec4<f32>(torque, 0.0);
  bodies[k].force_fluid = vec4<f32>(s.fluid.xyz, 0.0);
  bodies[k].force_contact = vec4<f32>(s.contact.xyz, 0.0);
  bodies[k].torque_fluid = vec4<f32>(s.torque_fluid.xyz, 0.0);
  bodies[k].torque_contact = vec4<f32>(s.torque_contact.xyz, 0.0);
  // bit 0: deep now; bit 1: newly so
  let fresh = deep && (b.counts.y & 1u) == 0u;
  bodies[k].counts = vec4<u32>(contacts, select(0u, 1u, deep) | select(0u, 2u, fresh), b.counts.z, b.counts.w);
}

// E20: the kick that ends a step.
@compute @workgroup_size(64)
fn kick_bodies(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 64u);
  if (clock.running == 0u || k >= m.count.w || clock.drag > 0.0 || !moves(bodies[k])) { return; }
  kick_body(k, bodies[k].force.xyz, bodies[k].torque.xyz);
}
fn kick_body(k: u32, force: vec3<f32>, torque: vec3<f32>) {
  if (!LEAPFROG) { return; }
  let b = bodies[k];
  let p = kept(b.p_half.xyz, b.p_rest.xyz, 0.5 * clock.part * force);
  let l = kept(b.l_half.xyz, b.l_rest.xyz, 0.5 * clock.part * torque);
  bodies[k].p_rest = vec4<f32>(p.rest, 0.0);
  bodies[k].l_rest = vec4<f32>(l.rest, 0.0);
  bodies[k].p = vec4<f32>(p.sum, 0.0);
  bodies[k].v = vec4<f32>(p.sum / b.rest.w, 0.0);
  bodies[k].l = vec4<f32>(l.sum, 0.0);
  bodies[k].omega = vec4<f32>(spin(b, b.q, l.sum), 0.0);
}
