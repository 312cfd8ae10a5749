// Stage `cells`, the twin of cells.rs: a counting sort of fluids and rigid particles by cell, ties by id. Which of two
// atomics lands first changes the order inside a cell for a moment only: `gather` puts it right.

// Bin of a drifted particle of a kind.
fn bin_of(x: vec3<f32>, kind: u32, moves: bool) -> u32 {
  let first = bins_of(kind);
  let inside = all(x >= m.lower.xyz) && all(x <= m.upper.xyz);
  if (inside) { return first + index_of(cell_of(x)); }
  let gone = first + m.cells.w;
  if (x.x == DRAINED) { return gone + 3u; }
  if (!(finite(x.x) && finite(x.y) && finite(x.z))) { return gone + 2u; }
  if (!moves) { return gone + 3u; }       // scripted bodies may leave
  var lost = false;
  for (var a = 0u; a < 3u; a += 1u) {
    lost = lost || ((x[a] < m.lower[a] || x[a] > m.upper[a]) && ((m.more.w >> a) & 1u) == 0u);
  }
  return gone + select(0u, 1u, lost);
}
fn kind_of(i: u32) -> u32 { return select(FLUID, RIGID, i >= m.count.x); }
fn used(i: u32) -> bool { return i < clock.live || (i >= m.count.x && i < first_static()); }
fn bin(i: u32) -> u32 {
  let kind = kind_of(i);
  let x = drifted[i].x.xyz;
  if (kind == FLUID) { return bin_of(x, kind, true); }
  return bin_of(x, kind, drifted[i].push.w > 0.0);   // 1/mass of its body
}

@compute @workgroup_size(256)
fn clear(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 256u);
  if (clock.running == 0u || k >= bins_of(STATIC)) { return; }
  let unused = select(0u, m.count.x - clock.live, k == m.cells.w + 3u);
  atomicStore(&counts[k], unused);
}

@compute @workgroup_size(256)
fn histogram(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 256u);
  if (clock.running == 0u || !used(i)) { return; }
  atomicAdd(&counts[bin(i)], 1u);
}

@compute @workgroup_size(256)
fn scatter(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 256u);
  if (clock.running == 0u || !used(i)) { return; }
  order[atomicAdd(&counts[bin(i)], 1u)] = i;
}

@compute @workgroup_size(256)
fn gather(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let p = number(g, n, l, 256u);
  if (clock.running == 0u || !used(p)) { return; }
  let i = order[p];
  let own = drifted[i];
  let b = bin(i);
  let begin = starts[b];
  var end = starts[b + 1u];
  // the last bin of fluids also counts places that are not used
  if (b == m.cells.w + 3u) { end = clock.live; }
  var rank = 0u;
  for (var k = begin; k < end; k += 1u) {
    rank += select(0u, 1u, drifted[order[k]].id < own.id);
  }
  let to = begin + rank;
  records[to] = Record(own.x, own.v);
  info[to] = vec2<u32>(own.id, own.owner);
  if (kind_of(i) == FLUID) {
    before[to] = own.push;
    push[to] = own.push;
    if (CONTINUITY || LACKS || MORTAL) { rate[to] = own.rate; }
  } else {
    slots[own.id].place = select(GONE, to, b < bins_of(RIGID) + m.cells.w);
  }
}
