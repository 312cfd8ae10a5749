// Rigid bodies, the twin of bodies.rs: drift and kick (E20), forces and torques summed (E18).

// I^-1 L in world axes for the orientation q.
fn spin(b: Body, q: vec4<f32>, l: vec3<f32>) -> vec3<f32> {
  let own = turn(vec4<f32>(-q.xyz, q.w), l);
  return turn(q, b.inertia_x.xyz * own.x + b.inertia_y.xyz * own.y + b.inertia_z.xyz * own.z);
}

@compute @workgroup_size(64)
fn drift_bodies(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 64u);
  if (clock.running == 0u || k >= m.count.w || clock.drag > 0.0) { return; }
  var b = bodies[k];
  if (b.x.w == 0.0) { return; }
  let dt = clock.dt;
  let kick = select(dt, 0.5 * dt, LEAPFROG);
  let a = b.force.xyz * b.x.w;
  let kicked_v = kept(b.v.xyz, b.v_rest.xyz, kick * a);
  let kicked_l = kept(b.l.xyz, b.l_rest.xyz, kick * b.torque.xyz);
  let v_half = kicked_v.sum;
  let l_half = kicked_l.sum;
  let moved_x = kept(b.x.xyz, b.rest.xyz, dt * v_half);
  // a free turn with constant angular momentum: implicit midpoint rule
  var middle = b.q;
  for (var round = 0; round < 6; round += 1) {
    middle = times(turned_by(0.5 * dt * spin(b, middle, l_half)), b.q);
  }
  let q = normalize(times(turned_by(dt * spin(b, middle, l_half)), b.q));
  let now = l_half + (dt - kick) * b.torque.xyz;
  bodies[k].x = vec4<f32>(home_all(moved_x.sum), b.x.w);
  bodies[k].rest = vec4<f32>(moved_x.rest, b.rest.w);
  bodies[k].q = q;
  bodies[k].v_rest = vec4<f32>(kicked_v.rest, 0.0);
  bodies[k].l_rest = vec4<f32>(kicked_l.rest, 0.0);
  bodies[k].v_half = vec4<f32>(v_half, 0.0);
  bodies[k].l_half = vec4<f32>(l_half, 0.0);
  bodies[k].v = vec4<f32>(v_half + (dt - kick) * a, 0.0);
  bodies[k].l = vec4<f32>(now, 0.0);
  bodies[k].omega = vec4<f32>(spin(b, q, now), 0.0);
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
  if (k < m.more.x && clock.running != 0u) {
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
  if (l == 0u && k < m.more.x && clock.running != 0u) { part_sums[k] = tree[0]; }
}

@compute @workgroup_size(64)
fn sum_bodies(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 64u);
  if (clock.running == 0u || k >= m.count.w) { return; }
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
  let moves = b.x.w > 0.0;
  if (moves) { force += b.rest.w * clock.gravity.xyz; }
  let contacts = u32(s.force.w);
  let far = contacts > 0u && length(b.v.xyz) * clock.dt > 0.5 * m.period.w;
  let deep = moves && (s.contact.w > 0.0 || far);
  bodies[k].force = vec4<f32>(force, select(0.0, s.fluid.w, moves));
  bodies[k].torque = vec4<f32>(torque, 0.0);
  bodies[k].force_fluid = vec4<f32>(s.fluid.xyz, 0.0);
  bodies[k].force_contact = vec4<f32>(s.contact.xyz, 0.0);
  bodies[k].torque_fluid = vec4<f32>(s.torque_fluid.xyz, 0.0);
  bodies[k].torque_contact = vec4<f32>(s.torque_contact.xyz, 0.0);
  // bit 0: deep now; bit 1: newly so
  let fresh = deep && (b.counts.y & 1u) == 0u;
  bodies[k].counts = vec4<u32>(contacts, select(0u, 1u, deep) | select(0u, 2u, fresh), b.counts.z, b.counts.w);
}

@compute @workgroup_size(64)
fn kick_bodies(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 64u);
  if (clock.running == 0u || k >= m.count.w || clock.drag > 0.0 || !LEAPFROG) { return; }
  let b = bodies[k];
  if (b.x.w == 0.0) { return; }
  let v = kept(b.v_half.xyz, b.v_rest.xyz, 0.5 * clock.dt * b.x.w * b.force.xyz);
  let l_now = kept(b.l_half.xyz, b.l_rest.xyz, 0.5 * clock.dt * b.torque.xyz);
  let now = l_now.sum;
  bodies[k].v_rest = vec4<f32>(v.rest, 0.0);
  bodies[k].l_rest = vec4<f32>(l_now.rest, 0.0);
  bodies[k].v = vec4<f32>(v.sum, 0.0);
  bodies[k].l = vec4<f32>(now, 0.0);
  bodies[k].omega = vec4<f32>(spin(b, b.q, now), 0.0);
}
