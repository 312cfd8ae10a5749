// The coarse level of implicit pressure (E9), the twin of coarse.rs: the smooth part of the shares, found at once. Its kernels stand after
// every other round and do nothing unless `judge` has said that the level is due. No sum depends on who comes first: particles are summed in
// their order, nodes gather from elements and bodies, and what bodies' particles do to nodes is added in whole numbers.

// Numbers of an element: a triangle of its matrix, then what is left at its corners. Corner `c` is at the end `c >> a & 1` of axis `a`.
const CORNERS: u32 = 8u;
const TRIANGLE: u32 = 36u;
const NUMBERS: u32 = 44u;
// Numbers of a node: its row of the matrix (nodes around it, the lowest first); vectors of nodes.
const ROW: i32 = 27;
const SHARE: u32 = 0u;
const LEFT: u32 = 1u;
const DIAGONAL: u32 = 2u;
const WAY: u32 = 3u;
const ANSWER: u32 = 4u;
// The largest force of a body's particle, in whole numbers: nodes have room for sums of two thousand such.
const FINE: f32 = 1048576.0;

fn coarse_due() -> bool { return in_round() && solve.due != 0u; }

// Elements and nodes over the occupied cells.
struct Lattice { first: vec3<i32>, cells: vec3<i32>, elements: vec3<i32>, nodes: vec3<i32> }
fn lattice_now() -> Lattice {
  let low = vec3<i32>(atomicLoad(&solve.low[0]), atomicLoad(&solve.low[1]), atomicLoad(&solve.low[2]));
  let high = vec3<i32>(atomicLoad(&solve.high[0]), atomicLoad(&solve.high[1]), atomicLoad(&solve.high[2]));
  let cells = high - low + 1;
  let elements = (cells + SIDE - 1) / SIDE;
  let all = vec3<i32>(m.cells.xyz);
  let ring = (all == vec3<i32>(1)) | ((m.period.xyz > vec3<f32>(0.0)) & (cells == all));
  return Lattice(low, cells, elements, elements + select(vec3<i32>(1), vec3<i32>(0), ring));
}
fn volume_of(n: vec3<i32>) -> u32 { return u32(n.x * n.y * n.z); }
fn place_in(k: u32, n: vec3<i32>) -> vec3<i32> {
  let i = i32(k);
  return vec3<i32>(i % n.x, i / n.x % n.y, i / n.x / n.y);
}
fn number_in(at: vec3<i32>, n: vec3<i32>) -> u32 { return u32((at.z * n.y + at.y) * n.x + at.x); }
fn corner(c: u32) -> vec3<i32> { return vec3<i32>(i32(c & 1u), i32((c >> 1u) & 1u), i32(c >> 2u)); }
// The node at a corner of an element.
fn node_at(t: Lattice, at: vec3<i32>, c: u32) -> u32 { return number_in((at + corner(c)) % t.nodes, t.nodes); }

// Where an element begins on each axis (m), and how often it goes into a metre.
struct Ends { begin: vec3<f32>, per_metre: vec3<f32> }
fn ends_of(t: Lattice, at: vec3<i32>) -> Ends {
  let there = m.per_cell.xyz > vec3<f32>(0.0);
  let inverse = select(vec3<f32>(1.0), m.per_cell.xyz, there);
  // the last may be narrow where its end is the beginning of the first
  let wide = select(vec3<i32>(SIDE), min(vec3<i32>(SIDE), t.cells - SIDE * at), t.nodes == t.elements);
  let begin = m.origin.xyz + vec3<f32>(t.first + SIDE * at) / inverse;
  let nothing = vec3<f32>(0.0);
  return Ends(select(nothing, begin, there), select(nothing, inverse / vec3<f32>(wide), there));
}
// The element that holds a place, or is next to it.
fn element_of(t: Lattice, x: vec3<f32>) -> vec3<i32> {
  let cell = vec3<i32>((x - m.origin.xyz) * m.per_cell.xyz) - t.first;
  return min(max(cell, vec3<i32>(0)) / SIDE, t.elements - 1);
}
fn parts_way(x: vec3<f32>, e: Ends) -> vec3<f32> {
  return vec3<f32>(part_way(x.x, e.begin.x, e.per_metre.x), part_way(x.y, e.begin.y, e.per_metre.y),
                   part_way(x.z, e.begin.z, e.per_metre.z));
}
fn corner_parts(way: vec3<f32>, c: u32) -> vec3<f32> { return select(1.0 - way, way, corner(c) == vec3<i32>(1)); }

// The cells that fluids occupy, before the rounds of a step.
var<workgroup> lowest: array<atomic<i32>, 3>;
var<workgroup> highest: array<atomic<i32>, 3>;
@compute @workgroup_size(256)
fn coarse_window(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 256u);
  if (l < 3u) {
    atomicStore(&lowest[l], 2147483647);
    atomicStore(&highest[l], -1);
  }
  workgroupBarrier();
  if (clock.running != 0u && k < m.cells.w && starts[k + 1u] > starts[k]) {
    let at = place_in(k, vec3<i32>(m.cells.xyz));
    for (var a = 0u; a < 3u; a += 1u) {
      atomicMin(&lowest[a], at[a]);
      atomicMax(&highest[a], at[a]);
    }
  }
  workgroupBarrier();
  if (l < 3u && atomicLoad(&highest[l]) >= 0) {
    atomicMin(&solve.low[l], atomicLoad(&lowest[l]));
    atomicMax(&solve.high[l], atomicLoad(&highest[l]));
  }
}

// Rows of cells on x in an element, one behind the other: where their particles stand, and how many there are up to the end of each.
struct Rows { begin: array<u32, SIDE * SIDE>, end: array<u32, SIDE * SIDE> }
fn rows_of(t: Lattice, at: vec3<i32>) -> Rows {
  var these = Rows();
  let low = t.first + SIDE * at;
  let high = t.first + min(SIDE * at + SIDE, t.cells);
  var total = 0u;
  for (var r = 0; r < SIDE * SIDE; r += 1) {
    let y = low.y + r % SIDE;
    let z = low.z + r / SIDE;
    if (y < high.y && z < high.z) {
      let row = (u32(z) * m.cells.y + u32(y)) * m.cells.x;
      these.begin[r] = starts[row + u32(low.x)];
      total += starts[row + u32(high.x)] - these.begin[r];
    }
    these.end[r] = total;
  }
  return these;
}
// Elements that hold particles. Which comes first is chance, but nothing depends on it.
@compute @workgroup_size(256)
fn coarse_occupied(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 256u);
  if (clock.running == 0u || live_fluid() == 0u) { return; }
  let t = lattice_now();
  let count = volume_of(t.elements);
  if (k >= count) { return; }
  let these = rows_of(t, place_in(k, t.elements));
  var seat = GONE;
  if (these.end[SIDE * SIDE - 1] > 0u) {
    seat = atomicAdd(&solve.occupied, 1u);
    seats[count + seat] = k;
  }
  seats[k] = seat;
}

// 1 for a particle whose share takes part, else 0.
fn takes_part(i: u32) -> f32 { return select(0.0, 1.0, work[i].w + work[i].x > 0.0 || remains[i] > NOISE * solve.residual); }

// Accelerations of fluids by shares that are 1; w: how much of a gradient the sum over fluids finds, 1 amid them.
@compute @workgroup_size(128)
fn coarse_push(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  if (!coarse_due() || i >= live_fluid()) { return; }
  let x = spot[i].xyz;
  let limit = m.upper.w * m.upper.w;
  var total = vec3<f32>(0.0);
  var spread = 0.0;
  var near = around(i, x, FLUID);
  while (next_around(&near)) {
    let d = wrap(spot[near.at].xyz - x);
    let r_sq = dot(d, d);
    if (r_sq >= limit) { continue; }
    let e = link_to(d, r_sq, m.per_cell.w);
    total += takes_part(near.at) * e;
    spread += dot(d, e);
  }
  let own = takes_part(i);
  let node = nodes[i];
  total += own * node.all.xyz;
  flow[i] = vec4<f32>(-node.pull.w * total, own * spread / select(3.0, 2.0, FLAT));
}

// What the particles between eight nodes sum, in their order: 64 of them are laid out at once, and each number of the element is one
// invocation's.
var<workgroup> idle: u32;
var<workgroup> laid: array<vec4<f32>, 512>;     // by particle and corner: what answers on each axis, the corner's part
var<workgroup> softs: array<vec2<f32>, 64>;     // how far the particle yields, what it has left
@compute @workgroup_size(64)
fn coarse_elements(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  if (l == 0u) { idle = select(0u, atomicLoad(&solve.occupied), coarse_due()); }
  let occupied = workgroupUniformLoad(&idle);
  for (var seat = g.y * n.x + g.x; seat < occupied; seat += n.x * n.y) { sum_element(seat, l); }
}
fn sum_element(seat: u32, l: u32) {
  let t = lattice_now();
  let at = place_in(seats[volume_of(t.elements) + seat], t.elements);
  var these = rows_of(t, at);
  if (l == 0u) { idle = these.end[SIDE * SIDE - 1]; }
  let all = workgroupUniformLoad(&idle);
  let e = ends_of(t, at);
  let scale = clock.dt * clock.dt;
  // the number this invocation sums
  var a = 0u;
  var b = l;
  while (a < CORNERS && b >= CORNERS - a) { b -= CORNERS - a; a += 1u; }
  b += a;
  var sum = 0.0;
  for (var done = 0u; done < all; done += 64u) {
    let p = done + l;
    if (p < all) {
      var r = 0u;
      while (p >= these.end[r]) { r += 1u; }
      var behind = 0u;
      if (r > 0u) { behind = these.end[r - 1u]; }
      lay(these.begin[r] + p - behind, l, e, scale);
    }
    workgroupBarrier();
    for (var q = 0u; q < min(64u, all - done); q += 1u) {
      if (l < TRIANGLE) {
        let one = laid[CORNERS * q + a];
        let other = laid[CORNERS * q + b];
        sum += dot(one.xyz, other.xyz) + softs[q].x * (one.w * other.w);
      } else if (l < NUMBERS) {
        sum += laid[CORNERS * q + l - TRIANGLE].w * softs[q].y;
      }
    }
    workgroupBarrier();
  }
  if (l < NUMBERS) { elements[NUMBERS * seat + l] = sum; }
}
fn lay(i: u32, l: u32, e: Ends, scale: f32) {
  let push = flow[i];
  let inverse_rho = nodes[i].pull.w;
  let way = parts_way(spot[i].xyz, e);
  let slope = by_slope(push.w, inverse_rho, scale) * e.per_metre;
  let value = vec3<f32>(by_value(push.x, inverse_rho, scale), by_value(push.y, inverse_rho, scale), by_value(push.z, inverse_rho, scale));
  for (var c = 0u; c < CORNERS; c += 1u) {
    let part = corner_parts(way, c);
    let sign = vec3<f32>(2 * corner(c) - 1);
    let all = part.x * part.y * part.z;
    let steep = sign * vec3<f32>(part.y * part.z, part.x * part.z, part.x * part.y);
    laid[CORNERS * l + c] = vec4<f32>(all * value + steep * slope, all);
  }
  softs[l] = vec2<f32>(takes_part(i) * m.relax.y * inverse_rho, remains[i]);
}
// Number of a matrix's entry in the triangle.
fn entry(c: u32, d: u32) -> u32 {
  let a = min(c, d);
  return a * CORNERS - a * (a + 1u) / 2u + max(c, d);
}

// Bodies that answer: the nodes they may reach, how they move.
fn answering() -> u32 { return select(0u, m.movers.x, COUPLED_BY_PRESSURE && clock.drag == 0.0); }
@compute @workgroup_size(64)
fn coarse_bodies(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = g.y * n.x + g.x;
  if (!coarse_due() || k >= m.movers.x) { return; }
  let b = bodies[k];
  let t = lattice_now();
  let far = b.shape.x + BEYOND * m.lower.w;
  let whole = (t.nodes == t.elements) | (m.period.xyz > vec3<f32>(0.0));
  let low = select(element_of(t, b.x.xyz - far), vec3<i32>(0), whole);
  let size = select(element_of(t, b.x.xyz + far) + 2 - low, t.nodes, whole);
  for (var e = l; e < 6u * volume_of(size); e += 64u) { atomicStore(&reach[6u * giving[k].first + e], 0); }
  if (l != 0u) { return; }
  // a fluid particle gains by what its body gives way: as often as bodies count in rates
  let factor = clock.dt * clock.dt / m.per_cell.w;
  giving[k].low = vec4<i32>(low, 0);
  giving[k].size = vec4<i32>(size, 0);
  giving[k].turn_x = vec4<f32>(factor * spin(b, b.q, vec3<f32>(1.0, 0.0, 0.0)), factor * b.x.w);
  giving[k].turn_y = vec4<f32>(factor * spin(b, b.q, vec3<f32>(0.0, 1.0, 0.0)), max(b.shape.x, m.lower.w));
  giving[k].turn_z = vec4<f32>(factor * spin(b, b.q, vec3<f32>(0.0, 0.0, 1.0)), select(0.0, 1.0, yields(b)));
  atomicStore(&giving[k].largest, 0u);
}
// Force of shares that are 1 on bodies' particles (N), and the largest on each body.
@compute @workgroup_size(128)
fn coarse_press(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 128u);
  let i = m.count.x + k;
  if (!coarse_due() || answering() == 0u || i >= rigid_end()) { return; }
  let own = spot[i];
  let limit = m.upper.w * m.upper.w;
  var total = vec3<f32>(0.0);
  var near = walk(own.xyz, FLUID);
  while (next(&near)) {
    let d = wrap(spot[near.at].xyz - own.xyz);
    let r_sq = dot(d, d);
    if (r_sq >= limit) { continue; }
    let share = share_at_boundary(takes_part(near.at), 0.0, 0.0);
    total += (own.w * m.per_cell.w * share * m.kernel.y * force_g(sqrt(r_sq) * m.origin.w)) * d;
  }
  squeezed[k] = vec4<f32>(total, 0.0);
  let size = length(total);
  if (size > 0.0 && finite(size)) { atomicMax(&giving[info[i].y].largest, bitcast<u32>(size)); }
}
// What a body may be counted in: newtons, newton metres.
fn units(k: u32) -> vec2<f32> {
  let force = bitcast<f32>(atomicLoad(&giving[k].largest)) / FINE;
  return vec2<f32>(force, force * giving[k].turn_y.w);
}
// Force and torque on bodies by shares of 1 on nodes.
@compute @workgroup_size(128)
fn coarse_reach(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let s = number(g, n, l, 128u);
  if (!coarse_due() || answering() == 0u || s >= m.count.y || slots[s].place == GONE) { return; }
  let k = slots[s].owner;
  let own = slots[s].place;
  let force = squeezed[own - m.count.x].xyz;
  let size = length(force);
  if (!(size > 0.0) || !finite(size) || giving[k].turn_z.w == 0.0) { return; }
  let per = 1.0 / units(k);
  let torque = cross(turn(bodies[k].q, slots[s].offset.xyz), force);
  let t = lattice_now();
  // in the fluid that pushes it
  let x = spot[own].xyz - m.lower.w / size * force;
  let at = element_of(t, x);
  let way = parts_way(x, ends_of(t, at));
  let low = giving[k].low.xyz;
  let box_size = giving[k].size.xyz;
  for (var c = 0u; c < CORNERS; c += 1u) {
    let part = corner_parts(way, c);
    let w = part.x * part.y * part.z;
    let to = (at + corner(c)) % t.nodes - low;
    if (any(to < vec3<i32>(0)) || any(to >= box_size)) { continue; }
    let e = 6u * (giving[k].first + number_in(to, box_size));
    for (var a = 0u; a < 3u; a += 1u) {
      atomicAdd(&reach[e + a], i32(round(w * per.x * force[a])));
      atomicAdd(&reach[e + 3u + a], i32(round(w * per.y * torque[a])));
    }
  }
}
// Whether a body feels a node, and where that stands among its own.
fn reaches(k: u32, node: vec3<i32>) -> i32 {
  if (atomicLoad(&giving[k].largest) == 0u || giving[k].turn_z.w == 0.0) { return -1; }
  let size = giving[k].size.xyz;
  let to = node - giving[k].low.xyz;
  if (any(to < vec3<i32>(0)) || any(to >= size)) { return -1; }
  return i32(giving[k].first + number_in(to, size));
}
// Force and torque on a body by a share of 1.
fn reach_at(e: u32, unit: vec2<f32>) -> mat2x3<f32> {
  let k = 6u * e;
  let force = vec3<f32>(f32(atomicLoad(&reach[k])), f32(atomicLoad(&reach[k + 1u])), f32(atomicLoad(&reach[k + 2u])));
  let torque = vec3<f32>(f32(atomicLoad(&reach[k + 3u])), f32(atomicLoad(&reach[k + 4u])), f32(atomicLoad(&reach[k + 5u])));
  return mat2x3<f32>(unit.x * force, unit.y * torque);
}
// What force and torque make of a body, times what both count in rates.
fn moved_by(k: u32, by: mat2x3<f32>) -> mat2x3<f32> {
  let x = giving[k].turn_x;
  return mat2x3<f32>(x.w * by[0], x.xyz * by[1].x + giving[k].turn_y.xyz * by[1].y + giving[k].turn_z.xyz * by[1].z);
}
fn both_dot(a: mat2x3<f32>, b: mat2x3<f32>) -> f32 { return dot(a[0], b[0]) + dot(a[1], b[1]); }

// Rows of the matrix, its diagonal, and what is left on nodes.
@compute @workgroup_size(128)
fn coarse_nodes(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  if (!coarse_due()) { return; }
  let t = lattice_now();
  let count = volume_of(t.nodes);
  if (i >= count) { return; }
  let at = place_in(i, t.nodes);
  let ring = t.nodes == t.elements;
  var row = array<f32, 27>();
  var diagonal = 0.0;
  var rest = 0.0;
  for (var o = 0u; o < CORNERS; o += 1u) {
    // of this element the node is corner `c`
    let c = CORNERS - 1u - o;
    var of_element = at - corner(c);
    of_element = select(of_element, (of_element + t.elements) % t.elements, ring);
    if (any(of_element < vec3<i32>(0)) || any(of_element >= t.elements)) { continue; }
    let seat = seats[number_in(of_element, t.elements)];
    if (seat == GONE) { continue; }
    let k = NUMBERS * seat;
    rest += elements[k + TRIANGLE + c];
    diagonal += elements[k + entry(c, c)];
    for (var d = 0u; d < CORNERS; d += 1u) {
      let way = corner(d) - corner(c) + 1;
      row[(way.z * 3 + way.y) * 3 + way.x] += elements[k + entry(c, d)];
    }
  }
  for (var k = 0u; k < answering(); k += 1u) {
    let e = reaches(k, at);
    if (e < 0) { continue; }
    let force = reach_at(u32(e), units(k));
    diagonal += both_dot(moved_by(k, force), force);
  }
  for (var k = 0; k < ROW; k += 1) { rows[u32(k) * count + i] = row[k]; }
  lattice[SHARE * count + i] = 0.0;
  lattice[LEFT * count + i] = rest;
  lattice[DIAGONAL * count + i] = diagonal;
  lattice[WAY * count + i] = 0.0;
}

var<workgroup> combined: array<f32, 256>;
fn sum_of_all(l: u32, own: f32) -> f32 {
  combined[l] = own;
  workgroupBarrier();
  for (var reach = 128u; reach > 0u; reach /= 2u) {
    if (l < reach) { combined[l] += combined[l + reach]; }
    workgroupBarrier();
  }
  return workgroupUniformLoad(&combined[0]);
}
fn largest_of_all(l: u32, own: f32) -> f32 {
  combined[l] = own;
  workgroupBarrier();
  for (var reach = 128u; reach > 0u; reach /= 2u) {
    if (l < reach) { combined[l] = max(combined[l], combined[l + reach]); }
    workgroupBarrier();
  }
  return workgroupUniformLoad(&combined[0]);
}

// Bodies that feel something, in their order: their number.
var<workgroup> feeling: u32;
fn list_bodies(l: u32, count: u32) -> u32 {
  var listed = 0u;
  for (var k = 0u; k < count; k += 256u) {
    var own = 0u;
    if (k + l < count && atomicLoad(&giving[k + l].largest) > 0u && giving[k + l].turn_z.w > 0.0) { own = 1u; }
    let sum = scan_group(l, own);
    if (own == 1u) { giving[listed + sum.x].size.w = i32(k + l); }
    listed += sum.y;
  }
  if (l == 0u) { feeling = listed; }
  storageBarrier();
  return workgroupUniformLoad(&feeling);
}

// How bodies move by shares `way` on nodes: a team of invocations for each.
var<workgroup> felt: array<mat2x3<f32>, 256>;
fn move_bodies(l: u32, t: Lattice, count: u32, listed: u32) {
  var teams = 1u;
  while (teams < listed && teams < 32u) { teams *= 2u; }
  let team = 256u / teams;
  let lane = l % team;
  for (var base = 0u; base < listed; base += teams) {
    let b = base + l / team;
    var own = mat2x3<f32>();
    var k = 0u;
    if (b < listed) {
      k = u32(giving[b].size.w);
      let unit = units(k);
      let low = giving[k].low.xyz;
      let size = giving[k].size.xyz;
      for (var e = lane; e < volume_of(size); e += team) {
        let node = low + place_in(e, size);
        own += lattice[WAY * count + number_in(node, t.nodes)] * reach_at(giving[k].first + e, unit);
      }
    }
    felt[l] = own;
    workgroupBarrier();
    for (var reach = team / 2u; reach > 0u; reach /= 2u) {
      if (lane < reach) { felt[l] += felt[l + reach]; }
      workgroupBarrier();
    }
    if (lane == 0u && b < listed) {
      let moved = moved_by(k, felt[l]);
      giving[k].moved = vec4<f32>(moved[0], 0.0);
      giving[k].turned = vec4<f32>(moved[1], 0.0);
    }
    workgroupBarrier();
  }
  storageBarrier();
}

// What a node answers to shares `way`.
fn answer_of(i: u32, t: Lattice, count: u32, listed: u32) -> f32 {
  let at = place_in(i, t.nodes);
  let ring = t.nodes == t.elements;
  let before = select(max(at - 1, vec3<i32>(0)), (at - 1 + t.nodes) % t.nodes, ring);
  let after = select(min(at + 1, t.nodes - 1), (at + 1) % t.nodes, ring);
  let x = vec3<i32>(before.x, at.x, after.x);
  let y = vec3<i32>(before.y, at.y, after.y);
  let z = vec3<i32>(before.z, at.z, after.z);
  var sum = 0.0;
  // where nothing answers, the row is empty
  let begin = select(0, ROW, lattice[DIAGONAL * count + i] == 0.0);
  for (var k = begin; k < ROW; k += 1) {
    let other = number_in(vec3<i32>(x[k % 3], y[k / 3 % 3], z[k / 9]), t.nodes);
    sum += rows[u32(k) * count + i] * lattice[WAY * count + other];
  }
  for (var b = 0u; b < listed; b += 1u) {
    let k = u32(giving[b].size.w);
    let e = reaches(k, at);
    if (e < 0) { continue; }
    sum += both_dot(mat2x3<f32>(giving[k].moved.xyz, giving[k].turned.xyz), reach_at(u32(e), units(k)));
  }
  return sum;
}

// Conjugate gradients with the diagonal as preconditioner.
@compute @workgroup_size(256)
fn coarse_solve(@builtin(local_invocation_index) l: u32) {
  if (l == 0u) { idle = select(1u, 0u, coarse_due()); }
  if (workgroupUniformLoad(&idle) != 0u) { return; }
  let t = lattice_now();
  let count = volume_of(t.nodes);
  let listed = list_bodies(l, answering());
  var own = 0.0;
  for (var i = l; i < count; i += 256u) { own = max(own, lattice[DIAGONAL * count + i]); }
  let least = STIFFNESS * largest_of_all(l, own);
  var last = 0.0;
  var first = 0.0;
  for (var round = 0u; round < COARSE_ROUNDS; round += 1u) {
    own = 0.0;
    for (var i = l; i < count; i += 256u) {
      let r = lattice[LEFT * count + i];
      own += r * r / (lattice[DIAGONAL * count + i] + least);
    }
    let now = sum_of_all(l, own);
    if (round == 0u) { first = now; }
    if (now <= ENOUGH * first || !finite(now)) { break; }
    let goes_on = select(now / last, 0.0, round == 0u);
    for (var i = l; i < count; i += 256u) {
      let by = lattice[LEFT * count + i] / (lattice[DIAGONAL * count + i] + least);
      lattice[WAY * count + i] = by + goes_on * lattice[WAY * count + i];
    }
    storageBarrier();
    workgroupBarrier();
    if (listed > 0u) { move_bodies(l, t, count, listed); }
    own = 0.0;
    for (var i = l; i < count; i += 256u) {
      let way = lattice[WAY * count + i];
      let answer = (least + STIFFNESS * lattice[DIAGONAL * count + i]) * way + answer_of(i, t, count, listed);
      lattice[ANSWER * count + i] = answer;
      own += way * answer;
    }
    let curvature = sum_of_all(l, own);
    if (curvature <= 0.0) { break; }
    let by = now / curvature;
    for (var i = l; i < count; i += 256u) {
      lattice[SHARE * count + i] += by * lattice[WAY * count + i];
      lattice[LEFT * count + i] -= by * lattice[ANSWER * count + i];
    }
    last = now;
  }
}

// The smooth part is added to the shares.
@compute @workgroup_size(128)
fn coarse_add(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  if (!coarse_due() || i >= live_fluid()) { return; }
  let t = lattice_now();
  let own = spot[i];
  let at = element_of(t, own.xyz);
  let way = parts_way(own.xyz, ends_of(t, at));
  let count = volume_of(t.nodes);
  var between = 0.0;
  for (var c = 0u; c < CORNERS; c += 1u) {
    let part = corner_parts(way, c);
    between += part.x * part.y * part.z * lattice[SHARE * count + node_at(t, at, c)];
  }
  let now = max(own.w + takes_part(i) * between, -work[i].w);
  work[i].x += now - own.w;   // what rounds have gone is theirs alone
  spot[i].w = now;
}
