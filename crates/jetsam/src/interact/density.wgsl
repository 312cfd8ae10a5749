// Stages `density` and `pressure`, the twins of density.rs (E1) and pressure.rs (E3). The first makes lists of neighbours for the others.

@compute @workgroup_size(128)
fn density(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  if (clock.running == 0u || i >= live_fluid()) { return; }
  let x = records[i].x.xyz;
  let limit = m.upper.w * m.upper.w;
  var sum = 0.0;
  var found = array<u32, 3>();
  var all = 0u;
  for (var kind = FLUID; kind <= STATIC; kind += 1u) {
    let counted = kind != RIGID || COUPLED_BY_PRESSURE;
    var near = walk(x, kind);
    while (next(&near)) {
      let other = records[near.at].x;
      let d = wrap(other.xyz - x);
      let r_sq = dot(d, d);
      if (r_sq >= limit) { continue; }
      if (all < m.movers.y) { lists[row_of(all) + i] = near.at; }
      all += 1u;
      found[kind] += 1u;
      let volume = select(other.w, m.per_cell.w, kind == FLUID);
      if (counted) { sum += volume * density_w(sqrt(r_sq) * m.origin.w); }
    }
  }
  let D = m.kernel.x * sum;
  if (CONTINUITY) {
    // an integrated density is held above the summed one less a little: see pressure.rs
    push[i].w = max(push[i].w, D - BELOW_SUM);
  } else {
    push[i].w = D;
  }
  if (LACKS) {
    var memory = rate[i];
    if (memory.y == 0.0) {
      memory = vec4<f32>(lacking(memory.x, D), 1.0, memory.zw);
      rate[i] = memory;
    }
    push[i].w = D + memory.x;
  }
  lists[i] = min(found[0], 0xfffu) | (min(found[1], 0x3ffu) << 12u) | (min(found[2], 0x3ffu) << 22u);
}

@compute @workgroup_size(128)
fn pressure(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  if (clock.running == 0u || i >= live_fluid()) { return; }
  let D = push[i].w;
  let stiffness = m.fluids[info[i].y].stiffness;
  var p = 0.0;
  if (TAIT) { p = pressure_tait(D, stiffness); } else { p = pressure_linear(D, stiffness); }
  if (!(NEGATIVE || CONTINUITY)) { p = max(p, 0.0); }
  if (SYMMETRIC) {
    records[i].v.w = pressure_share(p, D);
  } else {
    records[i].v.w = 0.5 * p;
    records[i].x.w = m.per_cell.w / D;
  }
}
