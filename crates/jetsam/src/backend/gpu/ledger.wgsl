// Stage `ledger` and the length of the next step (E29): sums in a fixed order, group by group, then over groups.

const GROUP: u32 = 128u;
var<workgroup> partial: array<Sums, 64>;

// The sums of energy in it.
fn energies(s: Sums) -> Wide { return Wide(vec4<f32>(s.energy.xyz, 0.0), s.energy_low); }

fn both(a: Sums, b: Sums) -> Sums {
  let energy = wide_sum(energies(a), energies(b));
  return Sums(
    vec4<f32>(0.0, 0.0, max(a.step.z, b.step.z), max(a.step.w, b.step.w)),
    vec4<f32>(energy.high.xyz, max(a.energy.w, b.energy.w)), energy.low,
    a.momentum + b.momentum, a.outer + b.outer,
    vec4<f32>(a.total.xyz + b.total.xyz, max(a.total.w, b.total.w)),
    a.crossed + b.crossed, a.count + b.count, a.more + b.more, a.impulse + b.impulse, a.fluids + b.fluids, a.said + b.said);
}

fn of_fluid(i: u32) -> Sums {
  var s = Sums();
  let r = records[i];
  let fluid = m.fluids[info[i].y];
  let a = push[i];
  let speed = length(r.v.xyz);
  s.step = vec4<f32>(0.0, 0.0, speed, length(a.xyz));
  s.momentum = fluid.mass * vec4<f32>(r.v.xyz, speed);
  s.total = vec4<f32>(fluid.mass * a.xyz, 0.0);
  var outside = clock.gravity.xyz + fields_at(r.x.xyz, r.v.xyz);
  if (VORTICITY) { outside += vorticity[i].xyz; }
  s.outer = vec4<f32>(fluid.mass * outside, 0.0);
  if (HAS_HOSES > 0u) {
    s.outer += held[i].force;
    if (IMPLICIT) { s.impulse = held[i].impulse; }
  }
  if (IMPLICIT) {
    let head = r.v.w / fluid.density;
    s.fluids = vec4<f32>(s.outer.xyz, head * head);
  }
  s.energy = vec4<f32>(0.5 * fluid.mass * speed * speed, -fluid.mass * dot(m.gravity.xyz, r.x.xyz - m.corner.xyz), fluid.mass * s.step.w, 0.0);
  let near = counted(i);
  s.crossed.w = f32(near.fluids) - 1.0;
  if (f32(all_of(near)) >= 0.8 * m.corner.w) {
    let error = abs(a.w - 1.0);
    s.outer.w = error;
    s.total.w = error;
    s.more.z = 1u;
  }
  return s;
}

fn of_body(k: u32) -> Sums {
  var s = Sums();
  let b = bodies[k];
  if (IMPLICIT) {
    // what bodies got by implicit pressure, fluids lost
    let added = swept[k].added.xyz;
    s.total = vec4<f32>(-added, 0.0);
    s.energy.z = length(added);
    s.impulse = swept[k].impulse;
  }
  if (b.x.w == 0.0) {
    s.outer = vec4<f32>(-b.force.xyz, 0.0);
    return s;
  }
  let mass = b.p.high.w;
  let speed = length(b.v.xyz);
  s.momentum = mass * vec4<f32>(b.v.xyz, speed);
  s.total += vec4<f32>(b.force.xyz, 0.0);
  var outside = mass * clock.gravity.xyz;
  if (b.stated.w > 0.0) { outside -= b.force_fluid.xyz; }
  s.outer = vec4<f32>(outside, 0.0);
  let kinetic = scaled(wide_sum(wide_dot(b.p, velocity(b, b.p)), wide_dot(b.l, Wide(b.omega, b.omega_low))), 0.5);
  let weight = wide_product(wide_vector(-m.gravity.xyz), Wide(b.p.high.wwww, b.p.low.wwww));
  let potential = wide_dot(weight, wide_sum(Wide(b.x, b.x_low), wide_vector(-m.corner.xyz)));
  s.energy += vec4<f32>(kinetic.high.x, potential.high.x, length(b.force.xyz), 0.0);
  s.energy_low = vec4<f32>(kinetic.low.x, potential.low.x, 0.0, 0.0);
  let l = b.l.high.xyz;
  if (!(finite(b.x.x + b.x.y + b.x.z) && finite(speed) && finite(l.x + l.y + l.z))) { s.count.w = 1u; }
  s.more.w = select(0u, 1u, (b.counts.y & NEWLY) != 0u);
  return s;
}

fn of_slot(at: u32) -> Sums {
  var s = Sums();
  let r = records[at];
  s.energy.w = length(r.v.xyz);
  s.step.z = s.energy.w;
  let b = bodies[info[at].y].x.w;
  if (HAS_FIELDS > 0u && b > 0.0) { s.outer = vec4<f32>(bodies[info[at].y].stated.z * fields_at(r.x.xyz, r.v.xyz), 0.0); }
  return s;
}

// Sum over the invocations of a workgroup, in the first one.
fn in_group(l: u32, own: Sums) -> Sums {
  var sum = own;
  for (var reach = GROUP / 2u; reach > 0u; reach /= 2u) {
    if (l >= reach && l < 2u * reach) { partial[l - reach] = sum; }
    workgroupBarrier();
    if (l < reach) { sum = both(sum, partial[l]); }
    workgroupBarrier();
  }
  return sum;
}

@compute @workgroup_size(128)
fn tally(@builtin(workgroup_id) g: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let stride = m.more.z * GROUP;
  var sum = Sums();
  if (clock.running != 0u) {
    for (var i = g.x * GROUP + l; i < live_fluid(); i += stride) { sum = both(sum, of_fluid(i)); }
  }
  let all = in_group(l, sum);
  if (l == 0u) { sums[g.x] = all; }
}

@compute @workgroup_size(128)
fn tally_bodies(@builtin(workgroup_id) g: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let stride = m.more.z * GROUP;
  var sum = Sums();
  if (clock.running != 0u) {
    for (var k = g.x * GROUP + l; k < m.count.w; k += stride) { sum = both(sum, of_body(k)); }
    for (var at = m.count.x + g.x * GROUP + l; at < rigid_end(); at += stride) { sum = both(sum, of_slot(at)); }
  }
  let all = in_group(l, sum);
  if (l == 0u) { sums[g.x] = both(sums[g.x], all); }
}

@compute @workgroup_size(128)
fn total(@builtin(local_invocation_index) l: u32) {
  var sum = Sums();
  var groups = m.more.z;
  if (HAS_FLOCKS) { groups += crowd.number.w; }
  for (var k = l; k < groups; k += GROUP) { sum = both(sum, sums[k]); }
  // momentum of fluid that left in this step, in the order of bins
  let live = live_fluid();
  if (clock.running != 0u && l == 0u) {
    for (var i = live; i < clock.live; i += 1u) {
      let p = m.fluids[info[i].y].mass * records[i].v.xyz;
      if (finite(p.x + p.y + p.z)) { sum.crossed -= vec4<f32>(p, 0.0); }
    }
    sum.crossed += vec4<f32>(clock.crossed.xyz, 0.0);
    clock.crossed = vec4<f32>(0.0);
  }
  if (IMPLICIT && clock.running != 0u) {
    // what a step has driven into walls was put back
    for (var k = l; k < (clock.live + GROUP - 1u) / GROUP; k += GROUP) { sum.impulse += said[k]; }
  }
  var all = in_group(l, sum);
  if (l != 0u || clock.running == 0u) { return; }
  if (IMPLICIT) {
    all.impulse += vec4<f32>(clock.dt * history[0].fluids.xyz, 0.0);
    all.said = solve.said;
  }
  all.impulse += clock.joint_impulse;
  all.outer += clock.joint_force;
  clock.joint_impulse = vec4<f32>(0.0);
  let c = m.cells.w;
  let r = bins_of(RIGID) + c;
  all.step.x = clock.dt;
  all.step.y = bitcast<f32>(clock.bound);
  all.count = vec4<u32>(live, starts[c + 1u] - live, starts[c + 2u] - starts[c + 1u], all.count.w + starts[c + 3u] - starts[c + 2u]);
  all.more.x = clock.live - starts[c + 3u];
  all.more.y = starts[r + 2u] - starts[r + 1u];
  history[0] = all;
  history[1u + clock.step] = all;
  clock.live = live;
  clock.fastest = all.step.z;
  clock.dt_before = clock.dt;
  clock.step += 1u;
  // thousands of steps would not add up to a frame: what rounding leaves over is kept (Kahan 1965)
  let left = kept(vec3<f32>(clock.left), vec3<f32>(clock.gravity.w), vec3<f32>(-clock.dt));
  clock.gravity.w = left.rest.x;
  clock.left = select(left.sum.x, 0.0, clock.bound == BY_FRAME);
  clock.elapsed += clock.dt;
}

// The length of the next step, where kernels choose it: the twin of `World::next_dt` and `Model::largest_dt`.
@compute @workgroup_size(1)
fn choose() {
  if (clock.own == 0u || clock.running == 0u) { return; }
  var left = clock.left - clock.gravity.w;
  if (clock.left <= 0.0) { clock.running = 0u; return; }
  var end = BY_FRAME;
  if (HAS_FLOCKS) {
    // a step ends where a decision is due
    for (var f = 0u; f < crowd.number.y; f += 1u) {
      let t = crowd.rules[f].time;
      if (t.z > 0.0 && t.y < left) { left = t.y; end = BY_FLOCK; }
    }
  }
  let last = history[0];
  var dt = m.step.w;
  var bound = BY_SCENE;
  var part = 1e30;
  if (IMPLICIT) {
    let by_flow = flow_step(last);
    dt = by_flow.x;
    bound = u32(by_flow.y);
    // contacts have steps of their own, as many as were queued at most
    part = min(m.rounds.w, TRAVEL * m.period.w / max(last.energy.w, 1e-30));
    if (part * f32(clock.most_parts) < dt) { dt = part * f32(clock.most_parts); bound = BY_CONTACT; }
  } else if (dt == 0.0) {
    dt = m.step.z;
    bound = BY_CONSTANT;
    if (HAS_FLUIDS) {
      let sound = m.step.x * m.upper.w / (2.0 * (m.gravity.w + last.step.z));
      let force = m.step.y * sqrt(m.upper.w / (2.0 * max(last.step.w, 1e-30)));
      if (sound < dt) { dt = sound; bound = BY_SOUND; }
      if (force < dt) { dt = force; bound = BY_FORCE; }
    }
    let travel = TRAVEL * m.period.w / max(last.energy.w, 1e-30);
    if (travel < dt) { dt = travel; bound = BY_TRAVEL; }
  }
  if (dt >= left) {
    dt = left;
    bound = end;
  } else if (left < 1e30) {
    // whole steps: what is left is cut evenly
    let steps = ceil(left / dt * 0.999999);
    dt = left;
    if (steps > 1.0) { dt = left / steps; }
  }
  clock.dt = dt;
  clock.bound = bound;
  clock.parts = u32(clamp(ceil(dt / part * 0.999999), 1.0, f32(max(clock.most_parts, 1u))));
  clock.part = dt / f32(clock.parts);
  clock.at = 0u;
}

// With implicit pressure: the step that the flow allows, and what bounds it.
fn flow_step(last: Sums) -> vec2<f32> {
  var dt = select(1e30, m.step.w, m.step.w > 0.0);
  var bound = BY_SCENE;
  if (m.far_corner.w < dt) { dt = m.far_corner.w; bound = BY_LONGEST; }
  let pressed = pow(3.0 * last.fluids.w / max(f32(last.count.x), 1.0), 0.25);
  let speed = max(last.step.z, m.step.y * pressed);
  let way = 2.0 * m.step.x / (speed + sqrt(speed * speed + 4.0 * last.step.w * m.step.x) + 1e-30);
  if (way < dt) { dt = way; bound = BY_FLOW; }
  if (m.step.z < dt) { dt = m.step.z; bound = BY_CONSTANT; }
  return vec2<f32>(dt, f32(bound));
}
