// Rounds of implicit pressure (E9), the twin of implicit.rs and of backend/cpu/implicit.rs. As many rounds are queued as steps before
// needed; once a solve is done, the rest of them do nothing. Where they do not suffice `close` halts the queue, and the host adds more.

// solve.phase: rounds are made; no more are needed; what follows them is made; nothing is left to do.
const ROUNDS: u32 = 0u;
const DONE: u32 = 1u;
const ENDING: u32 = 2u;
const OVER: u32 = 3u;
// solve.number of DFSPH; that of PBF is its turn.
const VELOCITIES: u32 = 0u;
const PLACES: u32 = 1u;

fn in_round() -> bool { return clock.running != 0u && solve.phase == ROUNDS; }
fn ended() -> bool { return clock.running != 0u && solve.phase == ENDING; }
fn pushes() -> bool { return in_round() || ended(); }

fn begin(number: u32) {
  solve.number = number;
  solve.iterations = 0u;
  solve.residual = 0.0;
  solve.since = 0.0;
  solve.best = 3.4e38;
  solve.smoothed = 3.4e38;
  solve.due = 0u;
  solve.omega = m.relax.x;
  solve.phase = select(OVER, ROUNDS, live_fluid() > 0u && clock.dt > 0.0);
}

fn forget_window() {
  for (var a = 0u; a < 3u; a += 1u) {
    atomicStore(&solve.low[a], 2147483647);
    atomicStore(&solve.high[a], -1);
  }
  atomicStore(&solve.occupied, 0u);
}

// A solve begins: of velocities, of places, of the turns of PBF.
@compute @workgroup_size(1)
fn begin_velocities() {
  if (clock.running == 0u) { return; }
  solve.said = vec4<f32>(0.0);
  solve.phase = ENDING;   // links are made now
  forget_window();
}
@compute @workgroup_size(1)
fn velocities() { if (clock.running != 0u) { begin(VELOCITIES); } }
@compute @workgroup_size(1)
fn begin_places() { if (clock.running != 0u) { begin(PLACES); } }
@compute @workgroup_size(1)
fn begin_turns() {
  if (clock.running == 0u) { return; }
  solve.said = vec4<f32>(0.0);
  solve.turn = 0u;
  solve.phase = ENDING;
  forget_window();
}

var<workgroup> judged: array<vec3<f32>, 256>;
// Sum of what all workgroups said.
fn all_said(l: u32) -> vec3<f32> {
  var sum = vec3<f32>(0.0);
  for (var k = l; k < (live_fluid() + 127u) / 128u; k += 256u) { sum += said[k].xyz; }
  judged[l] = sum;
  workgroupBarrier();
  for (var reach = 128u; reach > 0u; reach /= 2u) {
    if (l < reach) { judged[l] += judged[l + reach]; }
    workgroupBarrier();
  }
  return judged[0];
}

// Whether a turn of PBF is needed.
@compute @workgroup_size(256)
fn begin_turn(@builtin(local_invocation_index) l: u32) {
  let above = all_said(l).x;
  if (l != 0u || !ended()) { return; }
  let turn = solve.turn;
  if (turn > 0u) {
    solve.said.y = above / f32(live_fluid());
    if (solve.said.y <= m.rounds.x || solve.said.x >= m.rounds.z || turn == TURNS) { solve.phase = OVER; return; }
  }
  begin(turn);
  if (solve.phase == ROUNDS) { solve.turn = turn + 1u; }
}

// Velocities of bodies' particles as the present forces but contacts will have made them when the step is over.
@compute @workgroup_size(128)
fn flow_of_bodies(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let s = number(g, n, l, 128u);
  if (!ended() || s >= m.count.y || slots[s].place == GONE) { return; }
  let b = bodies[slots[s].owner];
  var v = b.v.xyz;
  var omega = b.omega.xyz;
  if (yields(b)) {
    v += clock.dt * b.x.w * (b.force.xyz - b.force_contact.xyz);
    omega = spin(b, b.q, b.l.high.xyz + clock.dt * (b.torque.xyz - b.torque_contact.xyz));
  } else if (clock.drag > 0.0) {
    v = vec3<f32>(0.0);
    omega = v;
  }
  let at = slots[s].place;
  flow[at] = vec4<f32>(v + cross(omega, turn(b.q, slots[s].offset.xyz)), 0.0);
}
// Whether fluids move a body now: not while a scene settles.
fn yields(b: Body) -> bool { return clock.drag == 0.0 && moves(b) && b.stated.w == 0.0; }

// How velocities (or accelerations) compress: sum (u_i - u_j) . e_ij, bodies and walls counted twice.
fn rate_of(i: u32) -> f32 {
  let x = spot[i].xyz;
  let limit = m.upper.w * m.upper.w;
  var total = dot(nodes[i].all.xyz, flow[i].xyz);
  for (var kind = FLUID; kind <= RIGID; kind += 1u) {
    if (kind == RIGID && !COUPLED_BY_PRESSURE) { continue; }
    var near = around(i, x, kind);
    while (next_around(&near)) {
      let other = spot[near.at];
      let d = wrap(other.xyz - x);
      let r_sq = dot(d, d);
      if (r_sq >= limit) { continue; }
      let volume = select(2.0 * other.w, m.per_cell.w, kind == FLUID);
      total -= dot(flow[near.at].xyz, link_to(d, r_sq, volume));
    }
  }
  return total;
}

// What is wrong without the shares, in compression by the end of the step.
@compute @workgroup_size(128)
fn errors_of_velocities(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  if (!ended() || i >= live_fluid()) { return; }
  work[i].y = clock.dt * rate_of(i) + min(push[i].w - 1.0, 0.0);
}
// Places begin with what velocities have left, and with shares of the last step, which `glide` has handed on.
@compute @workgroup_size(128)
fn errors_of_places(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  if (clock.running == 0u || i >= first_static()) { return; }
  flow[i] = vec4<f32>(0.0);
  if (i >= live_fluid()) { return; }
  let share = begun(before[i].x, nodes[i].all.w, clock.dt);
  work[i] = vec4<f32>(share, work[i].y + max(push[i].w - 1.0, 0.0), 0.0, 0.0);
  spot[i].w = share;
}

// A round: accelerations of fluids by the shares of all.
@compute @workgroup_size(128)
fn accelerate(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  if (!pushes() || i >= live_fluid()) { return; }
  let own = spot[i];
  let limit = m.upper.w * m.upper.w;
  var total = vec3<f32>(0.0);
  var near = around(i, own.xyz, FLUID);
  while (next_around(&near)) {
    let other = spot[near.at];
    let d = wrap(other.xyz - own.xyz);
    let r_sq = dot(d, d);
    if (r_sq >= limit) { continue; }
    total += other.w * link_to(d, r_sq, m.per_cell.w);
  }
  let node = nodes[i];
  total += own.w * node.all.xyz + hold_more(work[i].w, own.w, m.contact.w) * node.pull.xyz;
  flow[i] = vec4<f32>(-node.pull.w * total, 0.0);
}

// A round: force and torque of the shares on bodies, part by part in a fixed order.
var<workgroup> thrusts: array<mat2x3<f32>, PART>;
@compute @workgroup_size(128)
fn thrust_parts(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let s = number(g, n, l, PART);
  var own = mat2x3<f32>();
  var part = Part();
  if (s < m.count.z && pushes()) {
    part = parts[slots[s].part];
    if (slots[s].place != GONE) {
      let f = squeezed[slots[s].place - m.count.x].xyz;
      own = mat2x3<f32>(f, cross(turn(bodies[part.body].q, slots[s].offset.xyz), f));
    }
  }
  thrusts[l] = own;
  workgroupBarrier();
  for (var reach = 1u; reach < PART; reach *= 2u) {
    let joins = s + reach < part.end;
    if (joins) { own += thrusts[l + reach]; }
    workgroupBarrier();
    if (joins) { thrusts[l] = own; }
    workgroupBarrier();
  }
  if (s == part.first && s < part.end) {
    part_sums[slots[s].part].force = vec4<f32>(own[0], 0.0);
    part_sums[slots[s].part].torque = vec4<f32>(own[1], 0.0);
  }
}

@compute @workgroup_size(64)
fn thrust_bodies(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 64u);
  if (!pushes() || k >= select(m.movers.x, m.count.w, solve.phase == ENDING)) { return; }
  let b = bodies[k];
  var thrust = vec4<f32>(0.0);
  var twist = vec4<f32>(0.0);
  for (var p = b.counts.z; p < b.counts.z + b.counts.w; p += 1u) {
    thrust += part_sums[p].force;
    twist += part_sums[p].torque;
  }
  if (FLAT) { twist = vec4<f32>(0.0, twist.y, 0.0, 0.0); }
  swept[k].thrust = thrust;
  swept[k].twist = twist;
  let give = yields(b) && COUPLED_BY_PRESSURE;
  swept[k].push = select(vec4<f32>(0.0), b.x.w * thrust, give);
  swept[k].spin = select(vec4<f32>(0.0), vec4<f32>(spin(b, b.q, twist.xyz), 0.0), give);
}

// A round: bodies' particles as their bodies are pushed.
@compute @workgroup_size(128)
fn push_bodies(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let s = number(g, n, l, 128u);
  if (!pushes() || s >= m.count.y || slots[s].place == GONE) { return; }
  let by = swept[slots[s].owner];
  let arm = turn(bodies[slots[s].owner].q, slots[s].offset.xyz);
  flow[slots[s].place] = vec4<f32>(by.push.xyz + cross(by.spin.xyz, arm), 0.0);
}

// A round: the rates of accelerations, and all shares relaxed by them.
@compute @workgroup_size(128)
fn relax(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  var own = vec3<f32>(0.0);
  if (in_round() && i < live_fluid()) { own = relax_one(i); }
  judged[l] = own;
  workgroupBarrier();
  for (var reach = 64u; reach > 0u; reach /= 2u) {
    if (l < reach) { judged[l] += judged[l + reach]; }
    workgroupBarrier();
  }
  if (l == 0u && in_round()) { said[g.y * n.x + g.x] = vec4<f32>(judged[0], 0.0); }
}
fn relax_one(i: u32) -> vec3<f32> {
  let rate = rate_of(i);
  let w = work[i];
  let share = spot[i].w;
  let scale = clock.dt * clock.dt;
  let compliance = m.relax.y * nodes[i].pull.w;
  let left = w.y + scale * rate - compliance * (w.w + share);
  let by = solve.omega / (scale * nodes[i].all.w + compliance);
  // what the share should still change by, in compression: of particles without pressure only the excess counts
  let plain = relaxed(share, left, by, 0.0, -w.w);
  let signed = (plain - share) / by;
  let now = relaxed(share, left, stride(solve.since) * by, carried(solve.since) * (share - w.x), -w.w);
  work[i] = vec4<f32>(share, w.y, rate, w.w);
  spot[i].w = now;
  if (COARSE) { remains[i] = signed; }
  return vec3<f32>(abs(signed), left * (share - now), signed);
}

fn tolerance() -> f32 {
  // vectors are not the same when particles have moved: what they find then is to be small too
  if (PBF) { return FIRST * m.rounds.x; }
  return select(m.rounds.x, m.rounds.y, solve.number == VELOCITIES);
}

// A round: whether it was the last, and how fast the next goes on.
@compute @workgroup_size(256)
fn judge(@builtin(local_invocation_index) l: u32) {
  let sum = all_said(l);
  if (l != 0u || !in_round()) { return; }
  solve.since = select(solve.since + 1.0, 0.0, sum.y > 0.0);
  let residual = sum.x / f32(live_fluid());
  if (residual > WORSE * solve.best) {
    // a body too light, or places too odd, for steps so long
    solve.since = 0.0;
    solve.omega *= 0.5;
    solve.best = residual;
  }
  solve.best = min(solve.best, residual);
  solve.iterations += 1u;
  solve.residual = residual;
  if (!PBF && solve.number == VELOCITIES) { solve.said = vec4<f32>(solve.said.xy, f32(solve.iterations), residual); }
  else if (PBF) { solve.said.x += 1.0; }
  else { solve.said = vec4<f32>(f32(solve.iterations), residual, solve.said.zw); }
  clock.rounds[solve.number] = max(clock.rounds[solve.number], solve.iterations);
  // the turns of PBF share its budget
  let rounds = select(f32(solve.iterations), solve.said.x, PBF);
  let weight = f32(live_fluid()) * m.relax.z * clock.dt * clock.dt;
  let held = PBF || solve.number != VELOCITIES || abs(sum.z) <= weight;
  solve.small = select(0u, 1u, residual <= tolerance() && held);
  solve.due = 0u;
  if (solve.small == 1u || rounds >= m.rounds.z) { solve.phase = DONE; return; }
  let least = select(OF_ONE_SIGN * sum.x, weight, !PBF && m.relax.z < 1e30);
  let worth = residual < WORTH * solve.smoothed && abs(sum.z) > least;
  if (COARSE && worth && solve.iterations % EVERY == 1u && (PBF || solve.number == VELOCITIES)) {
    solve.due = 1u;
    solve.smoothed = residual;
    solve.since = 0.0;
  }
}

// After the rounds that were queued: on, or halt for more.
@compute @workgroup_size(1)
fn close() {
  if (clock.running == 0u) { return; }
  if (solve.phase == DONE) { solve.phase = ENDING; }
  if (solve.phase == ROUNDS) {
    clock.running = 0u;
    clock.halted = 1u + solve.number;
  }
}

@compute @workgroup_size(128)
fn finish(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  if (!ended() || i >= live_fluid()) { return; }
  let w = work[i];
  // where the shares that pushed are good enough they stay
  let share = select(spot[i].w, w.x, solve.small == 1u);
  spot[i].w = share;
  work[i] = vec4<f32>(share, w.y + clock.dt * clock.dt * w.z, 0.0, w.w);
}

// DFSPH: velocities that do not compress.
@compute @workgroup_size(128)
fn take_velocities(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  if (!ended() || i >= live_fluid()) { return; }
  records[i].v = vec4<f32>(records[i].v.xyz + clock.dt * flow[i].xyz, spot[i].w);
}
// Bodies are pushed so throughout the step.
@compute @workgroup_size(64)
fn load_bodies(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 64u);
  if (!ended() || k >= m.count.w) { return; }
  let by = swept[k];
  swept[k].added = by.thrust;
  swept[k].added_torque = by.twist;
  bodies[k].force_fluid += by.thrust;
  bodies[k].torque_fluid += by.twist;
  if (bodies[k].stated.w == 0.0) {
    bodies[k].force += by.thrust;
    bodies[k].torque += by.twist;
  }
  if (!moves(bodies[k]) || bodies[k].stated.w > 0.0) { swept[k].impulse -= clock.dt * by.thrust; }
}

// PBF: particles moved by a turn's accelerations, bodies by its thrusts.
@compute @workgroup_size(128)
fn shift_fluid(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  if (!ended() || i >= live_fluid()) { return; }
  let dv = clock.dt * flow[i].xyz;
  let r = records[i];
  records[i] = Record(vec4<f32>(home_all(r.x.xyz + clock.dt * dv), r.x.w), vec4<f32>(r.v.xyz + dv, r.v.w));
  work[i].w += work[i].x;
}
@compute @workgroup_size(64)
fn shift_bodies(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 64u);
  if (!ended() || k >= m.count.w) { return; }
  let dt = clock.dt;
  var b = bodies[k];
  let by = swept[k];
  swept[k].added += by.thrust;
  swept[k].added_torque += by.twist;
  if (!moves(b) || b.stated.w > 0.0) { swept[k].impulse -= dt * by.thrust; }
  if (!yields(b) || !COUPLED_BY_PRESSURE) { return; }
  bodies[k].p_half = pushed_on(b.p_half, by.thrust.xyz, dt);
  bodies[k].l_half = pushed_on(b.l_half, by.twist.xyz, dt);
  take_place(k, pushed_on(Wide(b.x, b.x_low), by.push.xyz, dt * dt));
  let turned = wide_times(wide_turn_by(wide_vector(dt * dt * by.spin.xyz)), Wide(b.q, b.q_low));
  take_orientation(k, wide_unit(turned));
  take_momenta(k, pushed_on(b.p, by.thrust.xyz, dt), pushed_on(b.l, by.twist.xyz, dt));
}
// Slots follow their bodies where those are in the midst of a solve.
@compute @workgroup_size(128)
fn shift_slots(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let s = number(g, n, l, 128u);
  if (ended() && s < m.count.y && clock.drag == 0.0) { follow_in_place(s); }
}
