// Steps of bodies inside a step of implicit pressure, the twin of backend/cpu/parts.rs. Cells are those of the step before: contacts
// look so much farther as the farthest particle of a body has gone since (`solve.stray`).

// Stage `kick`: all forces but pressure push fluids, and what was found in the step before is forgotten.
@compute @workgroup_size(128)
fn push_fluid(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  if (clock.running == 0u || i >= live_fluid()) { return; }
  let v = exp(-clock.drag * clock.dt) * (records[i].v.xyz + clock.dt * push[i].xyz);
  records[i].v = vec4<f32>(v, records[i].v.w);
}
@compute @workgroup_size(64)
fn unload_bodies(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 64u);
  if (clock.running == 0u || k >= m.count.w) { return; }
  let by = swept[k];
  let fluid = bodies[k].force_fluid - by.added;
  bodies[k].force_fluid = fluid;
  bodies[k].torque_fluid -= by.added_torque;
  if (bodies[k].stated.w == 0.0) {
    bodies[k].force -= by.added;
    bodies[k].torque -= by.added_torque;
  }
  swept[k].added = vec4<f32>(0.0);
  swept[k].added_torque = vec4<f32>(0.0);
  let outside = !moves(bodies[k]) || bodies[k].stated.w > 0.0;
  swept[k].impulse = select(vec4<f32>(0.0), -clock.dt * fluid, outside);
}

// A fluid particle is kept from going deeper into a solid side of the domain than half a spacing: there the wall's own particles
// stand. What a step has driven there is put back, and loses its velocity into the wall.
struct Put { x: vec3<f32>, v: vec3<f32>, said: vec4<f32> }
fn kept_inside(at: vec3<f32>, v: vec3<f32>, mass: f32, deep: f32) -> Put {
  var p = Put(at, v, vec4<f32>(0.0));
  for (var a = 0u; a < 3u; a += 1u) {
    let low = m.corner[a] - deep;
    let high = m.far_corner[a] + deep;
    let x = p.x[a];
    if (((SOLID >> a) & 1u) == 0u || m.period[a] > 0.0 || (x >= low && x <= high) || !finite(x)) { continue; }
    p.x[a] = clamp(x, low, high);
    p.said.w += 1.0;
    if (v[a] * select(1.0, -1.0, x < low) > 0.0) {
      p.said[a] -= mass * v[a];
      p.v[a] = 0.0;
    }
  }
  return p;
}
fn say_put(group: u32, l: u32, own: vec4<f32>) {
  puts[l] = own;
  workgroupBarrier();
  for (var reach = 64u; reach > 0u; reach /= 2u) {
    if (l < reach) { puts[l] += puts[l + reach]; }
    workgroupBarrier();
  }
  if (l == 0u && clock.running != 0u) { said[group] = puts[0]; }
}
var<workgroup> puts: array<vec4<f32>, 128>;

// Stage `drift`: fluids at one go.
@compute @workgroup_size(128)
fn glide(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  var own = vec4<f32>(0.0);
  if (clock.running != 0u && i < clock.live) {
    let r = records[i];
    var u = r.v.xyz;
    if (CARRIED) { u += carry[i].xyz; }
    if (!PBF) { u += clock.dt * flow[i].xyz; }
    var p = Put(home_all(r.x.xyz + clock.dt * u), r.v.xyz, own);
    // PBF has had no say yet, but what stands among the particles of a wall it could not move well: what walls took waits for its end
    p = kept_inside(p.x, p.v, m.fluids[info[i].y].mass, select(0.5, 0.1, PBF) * m.lower.w);
    if (!PBF) { own = p.said; }
    var rates = vec4<f32>(0.0);
    if (LACKS || MORTAL) { rates = rate[i]; }
    // forces are found anew: in their place goes the share by which places begin at the next step
    let a = vec4<f32>(select(vec3<f32>(spot[i].w, 0.0, 0.0), p.said.xyz, PBF), push[i].w);
    drifted[i] = Drifted(vec4<f32>(p.x, r.x.w), vec4<f32>(p.v, r.v.w), a, rates, info[i].x, info[i].y, vec2<u32>(0u));
  }
  say_put(g.y * n.x + g.x, l, own);
}
// PBF: the same after its turns; shares are kept for the next step.
@compute @workgroup_size(128)
fn keep_inside(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  var own = vec4<f32>(0.0);
  if (clock.running != 0u && i < live_fluid()) {
    let r = records[i];
    let p = kept_inside(r.x.xyz, r.v.xyz, m.fluids[info[i].y].mass, 0.5 * m.lower.w);
    records[i] = Record(vec4<f32>(p.x, r.x.w), vec4<f32>(p.v, select(r.v.w, work[i].w, solve.turn > 0u)));
    own = p.said + vec4<f32>(push[i].xyz, 0.0);
  }
  say_put(g.y * n.x + g.x, l, own);
}

// A part begins: the parts before the last are as many as were queued, or fewer.
@compute @workgroup_size(1)
fn part() {
  if (clock.running == 0u) { return; }
  clock.at += 1u;
  clock.mid = 1u;
  clock.idle = select(0u, 1u, clock.at >= clock.parts || clock.drag > 0.0);
}
// The last part begins: after it particles are sorted anew.
@compute @workgroup_size(1)
fn last_part() {
  if (clock.running == 0u) { return; }
  clock.mid = 0u;
  clock.idle = 0u;
  atomicStore(&solve.stray, 0u);
  clock.stray = 0.0;
}
// How far particles of bodies have gone since they were sorted.
@compute @workgroup_size(1)
fn straying() {
  if (clock.running != 0u) { clock.stray = bitcast<f32>(atomicLoad(&solve.stray)); }
}
// Fluids push as they did when the parts began.
@compute @workgroup_size(64)
fn steady_bodies(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 64u);
  if (clock.running == 0u || k >= m.count.w) { return; }
  swept[k].steady = bodies[k].force_fluid;
  swept[k].steady_torque = bodies[k].torque_fluid;
}

// A slot follows its body, and its particle stays in the cell in which it was.
fn follow_in_place(s: u32) {
  let slot = slots[s];
  let b = bodies[slot.owner];
  let arm = turn(b.q, slot.offset.xyz);
  let x = home_all(b.x.xyz + arm);
  slots[s].facing = vec4<f32>(turn(b.q, slot.normal.xyz), 0.0);
  if (slot.place == GONE) { return; }
  records[slot.place] = Record(vec4<f32>(x, slot.offset.w), vec4<f32>(b.v.xyz + cross(b.omega.xyz, arm), 0.0));
  let way = length(wrap(x - drifted[m.count.x + s].x.xyz));
  if (bitcast<f32>(atomicLoad(&solve.stray)) < way) { atomicMax(&solve.stray, bitcast<u32>(way)); }
}
@compute @workgroup_size(128)
fn follow_part(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let s = number(g, n, l, 128u);
  if (!moving() || s >= m.count.y) { return; }
  follow_in_place(s);
}

// The kick that ends a part, after contacts were summed. At the step's end the force on a body is what is said of it: that of fluids
// as they pushed in this step.
@compute @workgroup_size(64)
fn end_part(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 64u);
  if (!moving() || k >= movers()) { return; }
  let by = swept[k];
  let fluid = bodies[k].force_fluid;
  let fluid_torque = bodies[k].torque_fluid;
  let way = select(1.0, 0.0, bodies[k].stated.w > 0.0);
  let outside = select(vec4<f32>(0.0), bodies[k].force - way * fluid, moves(bodies[k]));
  swept[k].outside = vec4<f32>(outside.xyz, 0.0);
  if (clock.drag > 0.0 || clock.dt == 0.0) {
    // nothing is in the force but what was summed
    swept[k].added = vec4<f32>(0.0);
    swept[k].added_torque = vec4<f32>(0.0);
    return;
  }
  if (asleep(bodies[k])) { doze(k); return; }
  let force = bodies[k].force + way * (by.steady - fluid);
  let torque = bodies[k].torque + way * (by.steady_torque - fluid_torque);
  if (moves(bodies[k])) { kick_body(k, force.xyz, torque.xyz); }
  swept[k].impulse += (clock.part - first_kick()) * swept[k].outside;
  let last = clock.mid == 0u;
  let now = select(by.steady, fluid + by.added, last);
  let now_torque = select(by.steady_torque, fluid_torque + by.added_torque, last);
  bodies[k].force = vec4<f32>((force + way * (now - by.steady)).xyz, bodies[k].force.w);
  bodies[k].torque = torque + way * (now_torque - by.steady_torque);
  bodies[k].force_fluid = now;
  bodies[k].torque_fluid = now_torque;
  doze(k);
}
