// What implicit solvers (E9) know of the neighbourhood of each fluid particle, the twin of links.rs: sums of the vectors
// e_ij = V_j grad_i W_ij, which rounds make anew from places; and what shares do to particles of bodies.

// all: sum of e over all neighbours (1/m), bodies and walls counted twice, as pressures push; w: response. pull: sum of rho (g - a_b) . d e
// over bodies and walls; w: 1/rho_0.
struct Node { all: vec4<f32>, pull: vec4<f32> }

fn link_to(d: vec3<f32>, r_sq: f32, volume: f32) -> vec3<f32> {
  return link(volume, m.kernel.y * force_g(sqrt(r_sq) * m.origin.w)) * d;
}

var<workgroup> over: array<f32, 128>;

// Nodes where particles are now; in a turn of PBF after the first densities too, and what of them is above 1.
@compute @workgroup_size(128)
fn links(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  var above = 0.0;
  if (clock.running != 0u && solve.phase == ENDING && i < live_fluid()) { above = link_one(i); }
  over[l] = above;
  workgroupBarrier();
  for (var reach = 64u; reach > 0u; reach /= 2u) {
    if (l < reach) { over[l] += over[l + reach]; }
    workgroupBarrier();
  }
  if (l == 0u && clock.running != 0u) { said[g.y * n.x + g.x] = vec4<f32>(over[0], 0.0, 0.0, 0.0); }
}

fn link_one(i: u32) -> f32 {
  let own = records[i];
  let x = own.x.xyz;
  let limit = m.upper.w * m.upper.w;
  let rho = m.fluids[info[i].y].density;
  let again = PBF && solve.turn > 0u;
  var all = vec3<f32>(0.0);
  var pairs = 0.0;
  var weight = 0.0;
  var near = around(i, x, FLUID);
  while (next_around(&near)) {
    let d = wrap(records[near.at].x.xyz - x);
    let r_sq = dot(d, d);
    if (r_sq >= limit) { continue; }
    let e = link_to(d, r_sq, m.per_cell.w);
    var answer = 1.0 / rho;
    if (FLUIDS > 1u) { answer = 1.0 / m.fluids[info[near.at].y].density; }
    all += e;
    pairs += answer * dot(e, e);
    if (again) { weight += m.per_cell.w * density_w(sqrt(r_sq) * m.origin.w); }
  }
  var solid = vec3<f32>(0.0);
  var pull = vec3<f32>(0.0);
  for (var kind = RIGID; kind <= STATIC; kind += 1u) {
    if (kind == RIGID && !COUPLED_BY_PRESSURE) { continue; }
    near = around(i, x, kind);
    while (next_around(&near)) {
      let other = records[near.at].x;
      let d = wrap(other.xyz - x);
      let r_sq = dot(d, d);
      if (r_sq >= limit) { continue; }
      let e = link_to(d, r_sq, other.w);
      var a = clock.gravity.xyz;
      if (kind == RIGID) { a -= wall_acceleration(bodies[info[near.at].y], other.xyz); }
      solid += e;
      pull += (rho * dot(a, d)) * e;
      if (again) { weight += other.w * density_w(sqrt(r_sq) * m.origin.w); }
    }
  }
  all += 2.0 * solid;
  nodes[i] = Node(vec4<f32>(all, response(dot(all, all), 1.0 / rho, pairs, m.relax.w)), vec4<f32>(pull, 1.0 / rho));
  if (again) {
    push[i].w = m.kernel.x * weight;
    if (LACKS) { push[i].w += rate[i].x; }
  }
  return max(push[i].w - 1.0, 0.0);
}

// Places, and where shares begin: from those of the step before. DFSPH begins with velocities.
@compute @workgroup_size(128)
fn seat(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  if (clock.running == 0u || solve.phase == OVER) { return; }
  if (i < live_fluid()) {
    var share = records[i].v.w;
    if (PBF) { share *= select(recalled(clock.dt_before, clock.dt), 0.0, solve.turn > 1u); }
    spot[i] = vec4<f32>(records[i].x.xyz, share);
    work[i] = vec4<f32>(share, push[i].w - 1.0, 0.0, select(0.0, work[i].w, solve.turn > 1u));
    flow[i] = vec4<f32>(records[i].v.xyz, 0.0);
  } else if (i >= m.count.x && i < rigid_end()) {
    spot[i] = records[i].x;
  }
}

// Force of fluids' shares on a body's particle (N).
fn squeeze(i: u32) -> vec3<f32> {
  let own = records[i].x;
  let limit = m.upper.w * m.upper.w;
  let pull = clock.gravity.xyz - wall_acceleration(bodies[info[i].y], own.xyz);
  var total = vec3<f32>(0.0);
  var near = walk(own.xyz, FLUID);
  while (next(&near)) {
    let other = spot[near.at];
    let d = wrap(other.xyz - own.xyz);
    let r_sq = dot(d, d);
    if (r_sq >= limit) { continue; }
    var rho = m.fluids[0].density;
    if (FLUIDS > 1u) { rho = m.fluids[info[near.at].y].density; }
    let G = m.kernel.y * force_g(sqrt(r_sq) * m.origin.w);
    // as the fluid particle sees it: from it to this one is -d
    let held = hold_more(work[near.at].w, other.w, m.contact.w);
    let share = share_at_boundary(other.w, held, -rho * dot(pull, d));
    total += (own.w * m.per_cell.w * share * G) * d;
  }
  return total;
}

@compute @workgroup_size(128)
fn press_rigid(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 128u);
  let i = m.count.x + k;
  if (!pushes() || i >= rigid_end()) { return; }
  squeezed[k] = vec4<f32>(squeeze(i), 0.0);
}

// The same at the end of a solve, of walls too.
@compute @workgroup_size(128)
fn press_all(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 128u);
  if (!ended()) { return; }
  let i = body_particle(k);
  if (i == GONE) { return; }
  var force = vec3<f32>(0.0);
  if (k >= m.count.y || COUPLED_BY_PRESSURE) { force = squeeze(i); }
  squeezed[k] = vec4<f32>(force, 0.0);
}
