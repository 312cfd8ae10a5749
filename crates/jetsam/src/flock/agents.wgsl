// Stage `agents`, first half, the twin of motion.rs, coupling.rs and the sort of stage.rs: agents move, feel, push, are sorted.

const REYNOLDS: u32 = 0u;
const COUZIN: u32 = 1u;
const VICSEK: u32 = 2u;
const SCHOOL: u32 = 0u;
const FLEE: u32 = 2u;
const CHASE: u32 = 3u;

fn flock_of(a: u32) -> u32 { return bitcast<u32>(agents[a].v.w); }
fn has_bodies() -> bool { return m.count.z > 0u; }
fn direction_of(v: vec3<f32>) -> vec3<f32> {
  let size = length(v);
  return select(vec3<f32>(0.0), v / max(size, 1e-30), size > 0.0);
}
fn apart(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> { return wrap(b - a); }

// Particles of a kind, or agents of a flock, in the cells that a ball touches: see backend/gpu/region.wgsl.
struct Region { low: vec3<i32>, size: vec3<i32>, bins: u32, run: i32, at: u32, end: u32 }

fn span(x: f32, radius: f32, origin: f32, inverse: f32, cells: i32, period: f32) -> vec2<i32> {
  let low = i32(floor((x - radius - origin) * inverse));
  let high = i32(floor((x + radius - origin) * inverse));
  if (period > 0.0) {
    if (high - low + 1 >= cells) { return vec2<i32>(0, cells); }
    return vec2<i32>(low, high - low + 1);
  }
  let first = clamp(low, 0, cells - 1);
  return vec2<i32>(first, clamp(high, 0, cells - 1) - first + 1);
}
fn wrapped(c: i32, n: i32) -> i32 { return select(select(c, c + n, c < 0), c - n, c >= n); }

// Cosine and sine of an angle that a turn may reach; none is too large from half a turn on.
fn turn_of(angle: f32) -> vec2<f32> {
  if (angle >= 3.1415927) { return vec2<f32>(-2.0, 0.0); }
  return vec2<f32>(cos(angle), sin(angle));
}

// A place brought inside the solid sides; on which axis it had passed which.
struct Inside { x: vec3<f32>, sides: vec3<f32> }
fn inside_sides(at: vec3<f32>, size: f32) -> Inside {
  var r = Inside(at, vec3<f32>(0.0));
  for (var a = 0u; a < 3u; a += 1u) {
    if (((SOLID >> a) & 1u) == 0u) { continue; }
    let low = m.corner[a] + size;
    let high = m.far_corner[a] - size;
    if (r.x[a] < low) { r.x[a] = min(2.0 * low - r.x[a], high); r.sides[a] = 1.0; }
    else if (r.x[a] > high) { r.x[a] = max(2.0 * high - r.x[a], low); r.sides[a] = -1.0; }
  }
  return r;
}
fn bounced(v: vec3<f32>, sides: vec3<f32>) -> vec3<f32> { return select(v, sides * abs(v), sides != vec3<f32>(0.0)); }
fn mirrored(v: vec3<f32>, normal: vec3<f32>) -> vec3<f32> { return v - 2.0 * min(dot(v, normal), 0.0) * normal; }

// The push out of the particle that an agent is deepest in; w: how deep.
fn deepest(clear: f32, x: vec3<f32>) -> vec4<f32> {
  var most = vec4<f32>(0.0);
  for (var kind = RIGID; kind <= STATIC; kind += 1u) {
    var near = region(x, clear, kind);
    while (region_next(&near)) {
      let d = apart(x, records[near.at].x.xyz);
      let r = length(d);
      if (r >= 0.999 * clear || clear - r <= most.w) { continue; }
      most = vec4<f32>(select(vec3<f32>(0.0, 0.0, clear), d * ((r - clear) / max(r, 1e-30)), r > 0.0), clear - r);
    }
  }
  return most;
}

struct Held { x: vec3<f32>, normal: vec3<f32> }
// An agent held out of bodies; where it finds no place it stays where it was.
fn hold_out(rule: Rule, before_move: vec3<f32>, at: vec3<f32>) -> Held {
  var x = at;
  var met = vec3<f32>(0.0);
  for (var round = 0; round < 8; round += 1) {
    let push = deepest(rule.body.y, x);
    if (push.w <= 0.0) { return Held(x, direction_of(met)); }
    x = inside_sides(x + push.xyz, rule.body.x).x;
    met += push.xyz;
  }
  if (deepest(rule.body.y, x).w > 0.0) {
    met = before_move - x;
    x = before_move;
  }
  return Held(x, direction_of(met));
}

// Velocity after a step of Reynolds' agents.
fn kicked(rule: Rule, v: vec3<f32>, steering: vec3<f32>, dt: f32) -> vec3<f32> {
  let speed = length(v);
  var slowest = rule.limits.y;
  var fastest = rule.limits.z;
  if (rule.matter.x > 0.0) { slowest = min(slowest, speed); fastest = max(fastest, speed); }
  let t = turn_of(rule.sense.z * dt);
  return moved(v, steering, dt, t.x, t.y, slowest, fastest);
}

// Agents move, and those of mass feel what is around them.
@compute @workgroup_size(64)
fn travel(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 64u);
  if (clock.running == 0u || i >= crowd.number.x) { return; }
  var a = agents[i];
  a.own = vec4<f32>(0.0);
  if (clock.drag > 0.0) {
    // while fluids settle nothing else moves
    agents[i].force = vec4<f32>(0.0);
    agents[i].drag = vec4<f32>(0.0);
    agents[i].own = a.own;
    return;
  }
  let rule = crowd.rules[bitcast<u32>(a.v.w)];
  let mass = rule.matter.x;
  let dt = clock.dt;
  let first = select(dt, 0.5 * dt, LEAPFROG);
  if (dt > 0.0) {
    var v = a.v.xyz;
    if (mass > 0.0) { v += first / mass * a.force.xyz; }
    let by_others = v;
    var going = a.next.xyz;
    if (rule.kind.x == REYNOLDS) { v = kicked(rule, v, going, dt); }
    if (rule.kind.x == COUZIN) { v = going; }
    // what rounding left over is carried on (Kahan 1965)
    let carried = kept(a.x.xyz, a.rest.xyz, dt * v);
    var x = carried.sum;
    a.rest = vec4<f32>(carried.rest, 0.0);
    let in_sides = inside_sides(x, rule.body.x);
    x = in_sides.x;
    v = bounced(v, in_sides.sides);
    if (rule.kind.x != REYNOLDS) { going = bounced(going, in_sides.sides); }
    if (has_bodies()) {
      let held_out = hold_out(rule, a.x.xyz, x);
      x = held_out.x;
      if (any(held_out.normal != vec3<f32>(0.0))) {
        v = mirrored(v, held_out.normal);
        if (rule.kind.x != REYNOLDS) { going = mirrored(going, held_out.normal); }
      }
    }
    a.x = vec4<f32>(home_all(x), a.x.w);
    a.v = vec4<f32>(v, a.v.w);
    a.next = vec4<f32>(going, 0.0);
    a.own = vec4<f32>(mass * (v - by_others), 0.0);
  }
  if (mass > 0.0) {
    let kick = (dt - first) / mass;
    let v = a.v.xyz + kick * a.force.xyz;
    a.felt = vec4<f32>(v, 0.0);
    a.drag = feel_drag(rule, a.x.xyz, v);
    let f = a.drag.xyz + feel_contacts(rule, a.x.xyz, v);
    a.force = vec4<f32>(f, 0.0);
    a.v = vec4<f32>(a.v.xyz + kick * f, a.v.w);
  }
  agents[i] = a;
}

// Weight of a fluid particle around an agent (kg times W).
fn weight_of(fluid: u32, r_sq: f32) -> f32 {
  return m.fluids[fluid].mass * m.kernel.x * density_w(sqrt(r_sq) * m.origin.w);
}

// E27: drag; w: 1 over the mass (kg times W) around.
fn feel_drag(rule: Rule, x: vec3<f32>, v: vec3<f32>) -> vec4<f32> {
  if (!HAS_FLUIDS) { return vec4<f32>(0.0); }
  let limit = m.upper.w * m.upper.w;
  var around = 0.0;
  var flow = vec3<f32>(0.0);
  var filled = 0.0;
  var yields = 0.0;
  var near = region(x, m.upper.w, FLUID);
  while (region_next(&near)) {
    let d = apart(x, records[near.at].x.xyz);
    let r_sq = dot(d, d);
    if (r_sq >= limit) { continue; }
    let fluid = info[near.at].y;
    let w = weight_of(fluid, r_sq);
    around += w;
    flow += w * records[near.at].v.xyz;
    filled += w / m.fluids[fluid].density;
    yields += w * w / m.fluids[fluid].mass;
  }
  if (filled <= 1e-6) { return vec4<f32>(0.0); }
  let u = v - flow / around;
  let f = drag(u, around / max(filled, 0.9), rule.matter.y, clock.dt * (1.0 / rule.matter.x + yields / (around * around)));
  return vec4<f32>(f, 1.0 / around);
}

// E28: force on an agent by one particle of a body or wall. d: from the agent to it.
fn contact_of(rule: Rule, d: vec3<f32>, v: vec3<f32>, other: vec3<f32>, body: u32) -> vec3<f32> {
  let law = bodies[body].law;
  let stated = bodies[body].stated;
  let k = contact_constants(1.0 / (1.0 / rule.matter.x + bodies[body].x.w), law.x, 1.0, 1.0, stated.x, stated.y);
  return contact_force(d, other - v, length(d), rule.body.z, k.x, k.y, 1.0, clock.dt);
}
fn feel_contacts(rule: Rule, x: vec3<f32>, v: vec3<f32>) -> vec3<f32> {
  var total = vec3<f32>(0.0);
  if (!has_bodies()) { return total; }
  let reach = 1.25 * rule.body.z;
  for (var kind = RIGID; kind <= STATIC; kind += 1u) {
    var near = region(x, reach, kind);
    while (region_next(&near)) {
      let d = apart(x, records[near.at].x.xyz);
      if (dot(d, d) < reach * reach) { total += contact_of(rule, d, v, records[near.at].v.xyz, info[near.at].y); }
    }
  }
  return total;
}

// The clocks of flocks go on, and who is due decides.
@compute @workgroup_size(1)
fn crowd_clock() {
  if (clock.running == 0u) { return; }
  for (var f = 0u; f < crowd.number.y; f += 1u) {
    var t = crowd.rules[f].time;
    if (clock.drag == 0.0) {
      t.x += clock.dt;
      t.y -= clock.dt;
    }
    let due_now = clock.drag == 0.0 && t.y <= 1e-6 * t.z;
    if (due_now) {
      crowd.rules[f].count.x += 1u;
      t.y = t.z;
    }
    crowd.rules[f].count.y = select(0u, 1u, due_now);
    crowd.rules[f].time = t;
  }
  for (var a = 0u; a < 4u; a += 1u) {
    atomicStore(&crowd.low[a], 0xffffffffu);
    atomicStore(&crowd.high[a], 0u);
  }
}

// Floats as integers that compare alike.
fn ordered(x: f32) -> u32 {
  let bits = bitcast<u32>(x);
  return select(bits | 0x80000000u, ~bits, (bits & 0x80000000u) != 0u);
}
fn unordered(x: u32) -> f32 { return bitcast<f32>(select(~x, x & 0x7fffffffu, (x & 0x80000000u) != 0u)); }

// Vicsek's agents take over what they decided last (E24); the box around all agents.
@compute @workgroup_size(256)
fn agent_bounds(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 256u);
  if (clock.running == 0u || i >= crowd.number.x) { return; }
  let f = flock_of(i);
  let c = crowd.rules[f].count;
  if (crowd.rules[f].kind.x == VICSEK && c.y == 1u && c.x > 1u) { agents[i].v = vec4<f32>(agents[i].next.xyz, agents[i].v.w); }
  let x = agents[i].x.xyz;
  for (var a = 0u; a < 3u; a += 1u) {
    if (finite(x[a])) {
      atomicMin(&crowd.low[a], ordered(x[a]));
      atomicMax(&crowd.high[a], ordered(x[a]));
    }
  }
}

fn cells_on(extent: f32, width: f32, periodic: bool) -> f32 {
  if (periodic) { return max(floor(extent / width), 1.0); }
  return max(ceil(extent / width), 1.0);
}

// Cells for agents: periodic axes as the domain's, the others about the agents.
@compute @workgroup_size(1)
fn agent_grid() {
  if (clock.running == 0u) { return; }
  var low = vec3<f32>(0.0);
  var extent = vec3<f32>(0.0);
  var widest = 0.0;
  for (var a = 0u; a < 3u; a += 1u) {
    low[a] = unordered(atomicLoad(&crowd.low[a]));
    extent[a] = max(unordered(atomicLoad(&crowd.high[a])) - low[a], 0.0);
    if (!(finite(low[a]) && finite(extent[a]))) { low[a] = 0.0; extent[a] = 0.0; }
    widest = max(widest, extent[a]);
    if (m.period[a] > 0.0) { low[a] = m.origin[a]; extent[a] = m.period[a]; }
  }
  if (FLAT) { extent.y = 0.0; }
  var width = crowd.origin.w;
  let dimensions = select(3.0, 2.0, FLAT);
  if (width == 0.0) { width = widest / max(pow(f32(crowd.number.x) / 2.0, 1.0 / dimensions), 1.0); }
  if (!(width > 0.0)) { width = 1.0; }
  let most = f32(crowd.number.z);
  var count = vec3<f32>(1.0);
  for (var k = 0; k < 200; k += 1) {
    for (var a = 0u; a < 3u; a += 1u) { count[a] = cells_on(extent[a], width, m.period[a] > 0.0); }
    if (count.x * count.y * count.z <= most) { break; }
    width *= 1.25;
  }
  var inverse = vec3<f32>(1.0 / width);
  for (var a = 0u; a < 3u; a += 1u) {
    if (m.period[a] > 0.0) { inverse[a] = count[a] / m.period[a]; }
  }
  let cells = vec3<u32>(count);
  crowd.origin = vec4<f32>(low, crowd.origin.w);
  crowd.per_cell = vec4<f32>(inverse, 0.99995 / max(inverse.x, max(inverse.y, inverse.z)));
  crowd.cells = vec4<u32>(cells, cells.x * cells.y * cells.z);
}

fn agent_total() -> u32 { return crowd.cells.w * crowd.number.y + 2u; }
fn agent_bin(a: Agent) -> u32 {
  let x = a.x.xyz;
  if (!(finite(x.x) && finite(x.y) && finite(x.z))) { return crowd.cells.w * crowd.number.y; }
  let c = clamp(vec3<i32>((x - crowd.origin.xyz) * crowd.per_cell.xyz), vec3<i32>(0), vec3<i32>(crowd.cells.xyz) - 1);
  return bitcast<u32>(a.v.w) * crowd.cells.w + (u32(c.z) * crowd.cells.y + u32(c.y)) * crowd.cells.x + u32(c.x);
}

@compute @workgroup_size(256)
fn agent_clear(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 256u);
  if (clock.running == 0u || k >= agent_total()) { return; }
  atomicStore(&agent_counts[k], 0u);
}

@compute @workgroup_size(256)
fn agent_histogram(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 256u);
  if (clock.running == 0u || i >= crowd.number.x) { return; }
  let a = agents[i];
  strewn[i] = a;
  atomicAdd(&agent_counts[agent_bin(a)], 1u);
}

@compute @workgroup_size(256)
fn agent_scatter(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 256u);
  if (clock.running == 0u || i >= crowd.number.x) { return; }
  agent_order[atomicAdd(&agent_counts[agent_bin(strewn[i])], 1u)] = i;
}

@compute @workgroup_size(256)
fn agent_gather(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let p = number(g, n, l, 256u);
  if (clock.running == 0u || p >= crowd.number.x) { return; }
  let a = strewn[agent_order[p]];
  let b = agent_bin(a);
  let begin = agent_starts[b];
  let id = bitcast<u32>(a.x.w);
  var rank = 0u;
  for (var k = begin; k < agent_starts[b + 1u]; k += 1u) {
    rank += select(0u, 1u, bitcast<u32>(strewn[agent_order[k]].x.w) < id);
  }
  agents[begin + rank] = a;
  let f = bitcast<u32>(a.v.w);
  if (crowd.rules[f].kind.y == id) {
    crowd.rules[f].lead_x = a.x;
    crowd.rules[f].lead_v = a.v;
  }
}

// What agents do to the particles around (E27, E28): each particle looks for agents of mass.
@compute @workgroup_size(128)
fn give(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  if (clock.running == 0u || clock.drag > 0.0) { return; }
  let fluid = i < m.count.x;
  if (fluid && i >= live_fluid()) { return; }
  if (!fluid && body_particle(i - m.count.x) == GONE) { return; }
  let x = records[i].x.xyz;
  let owner = info[i].y;
  var total = vec3<f32>(0.0);
  for (var f = 0u; f < crowd.number.y; f += 1u) {
    let rule = crowd.rules[f];
    if (rule.matter.x == 0.0) { continue; }
    let reach = select(1.25 * rule.body.z, m.upper.w, fluid);
    var near = agent_region(x, reach, f);
    while (agent_region_next(&near)) {
      let a = agents[near.at];
      let d = apart(a.x.xyz, x);
      let r_sq = dot(d, d);
      if (r_sq >= reach * reach) { continue; }
      if (fluid) { total -= a.drag.xyz * (a.drag.w * weight_of(owner, r_sq)); }
      else { total -= contact_of(rule, d, a.felt.xyz, records[i].v.xyz, owner); }
    }
  }
  if (fluid) {
    push[i] = vec4<f32>(push[i].xyz + total / m.fluids[owner].mass, push[i].w);
  } else if (any(total != vec3<f32>(0.0))) {
    push[i] = vec4<f32>(push[i].xyz + total, 1.0);
    touch[i - m.count.x].contact = vec4<f32>(touch[i - m.count.x].contact.xyz + total, touch[i - m.count.x].contact.w);
  }
}

// The agents' part of the ledger: those of mass.
@compute @workgroup_size(128)
fn tally_agents(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  var s = Sums();
  let i = number(g, n, l, 128u);
  if (clock.running != 0u && i < crowd.number.x) {
    let a = agents[i];
    let mass = crowd.rules[bitcast<u32>(a.v.w)].matter.x;
    let speed = length(a.v.xyz);
    s.momentum = mass * vec4<f32>(a.v.xyz, speed);
    s.total = vec4<f32>(a.force.xyz, 0.0);
    s.energy = vec4<f32>(0.5 * mass * speed * speed, 0.0, length(a.force.xyz), 0.0);
    s.impulse = a.own;
    if (!(finite(a.x.x + a.x.y + a.x.z) && finite(speed))) { s.count.w = 1u; }
  }
  let all = in_group(l, s);
  let k = g.y * n.x + g.x;
  if (l == 0u) { sums[m.more.z + k] = all; }
}
