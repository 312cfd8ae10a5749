// Stage `sources`, the twin of sources.rs (E31): fluid born and drained. The host lists what is to be born in a frame, in the
// order of time; kernels take from the list what a step covers.

fn inside(x: vec3<f32>, start: vec4<f32>, axis: vec4<f32>) -> bool {
  let d = x - start.xyz;
  let along = dot(d, axis.xyz);
  let off = d - along * axis.xyz;
  return along >= 0.0 && along <= start.w && dot(off, off) <= axis.w * axis.w;
}

// Whether nothing stands within 0.85 spacings of a place.
fn has_room(x: vec3<f32>) -> bool {
  let limit = 0.85 * m.lower.w;
  for (var kind = FLUID; kind <= STATIC; kind += 1u) {
    var near = walk(x, kind);
    while (next(&near)) {
      // found where they were before the drift, judged where they are
      var at = records[near.at].x.xyz;
      if (kind == FLUID) { at = drifted[near.at].x.xyz; }
      if (kind == RIGID) { at = drifted[m.count.x + info[near.at].x].x.xyz; }
      let d = wrap(at - x);
      if (dot(d, d) < limit * limit) { return false; }
    }
  }
  return true;
}
// Steps do not add up to the end of a frame to the last bit: what is due then is not left for the next.
fn due(k: u32) -> bool { return k < clock.listed && births[k].x.w <= clock.elapsed + 1.0001 * clock.dt; }
fn place(k: u32) -> vec3<f32> {
  let b = births[k];
  return home_all(b.x.xyz + b.v.xyz * (clock.elapsed + clock.dt - b.x.w));
}

@compute @workgroup_size(64)
fn room(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = clock.births + number(g, n, l, 64u);
  if (clock.running == 0u || clock.drag > 0.0 || !due(k)) { return; }
  let in_hose = births[k].v.w < 0.0;
  births[k].room.x = select(0u, 1u, in_hose || has_room(place(k)));
}

@compute @workgroup_size(256)
fn bear(@builtin(local_invocation_index) l: u32) {
  let begin = clock.births;
  let live = clock.live;
  let running = clock.running != 0u && clock.drag == 0.0;
  let limit = clock.elapsed + clock.dt;
  var made = 0u;
  var done = 0u;
  var crossed = vec3<f32>(0.0);
  for (var first = begin; first < clock.listed; first += 256u) {
    let k = first + l;
    let mine = running && due(k);
    let born = mine && births[k].room.x == 1u;
    let all = scan_group(l, select(0u, 1u, mine));
    let place_of = scan_group(l, select(0u, 1u, born));
    let at = live + made + place_of.x;
    if (born && at < m.count.x) {
      let b = births[k];
      let fluid = u32(select(b.v.w, -b.v.w - 1.0, b.v.w < 0.0));
      let density = vec4<f32>(0.0, 0.0, 0.0, 1.0);   // where it is not found anew
      drifted[at] = Drifted(vec4<f32>(place(k), m.per_cell.w), vec4<f32>(b.v.xyz, 0.0), density,
                            vec4<f32>(0.0, 1.0, clock.time + limit, 0.0), clock.next_id + made + place_of.x, fluid, vec2<u32>(0u));
    }
    if (l == 0u && running) {
      for (var j = first; j < first + all.y; j += 1u) {
        let b = births[j];
        let fluid = u32(select(b.v.w, -b.v.w - 1.0, b.v.w < 0.0));
        if (b.room.x == 1u) { crossed += m.fluids[fluid].mass * b.v.xyz; }
      }
    }
    made += place_of.y;
    done += all.y;
    if (all.y < 256u) { break; }
  }
  workgroupBarrier();
  if (l == 0u && running) {
    clock.live = live + made;
    clock.births = begin + done;
    clock.born += made;
    clock.next_id += made;
    clock.crossed = vec4<f32>(crossed, 0.0);
  }
}

@compute @workgroup_size(128)
fn drain(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  if (clock.running == 0u || clock.drag > 0.0 || i >= clock.live) { return; }
  let p = drifted[i];
  let x = p.x.xyz;
  let now = clock.time + clock.elapsed + clock.dt;
  var taken = MORTAL && now - p.rate.z > m.fluids[p.owner].lifetime;
  for (var k = 0u; k < HAS_DRAINS; k += 1u) {
    let d = m.drains[k];
    if (now < d.begin || now > d.end) { continue; }
    let r = x - d.low.xyz;
    if (d.kind == 0u) { taken = taken || (all(x >= d.low.xyz) && all(x <= d.high.xyz)); }
    else if (d.kind == 1u) { taken = taken || dot(r, r) <= d.low.w * d.low.w; }
    else { taken = taken || inside(x, d.low, d.high); }
  }
  if (taken) { drifted[i].x.x = DRAINED; }
}

// Particles inside hoses go on at the hose's speed: what pushes them is taken away.
@compute @workgroup_size(128)
fn hold_hoses(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  if (clock.running == 0u || i >= live_fluid()) { return; }
  let x = records[i].x.xyz;
  let owner = info[i].y;
  var force = vec3<f32>(0.0);
  var impulse = vec3<f32>(0.0);
  for (var k = 0u; k < HAS_HOSES; k += 1u) {
    let h = m.hoses[k];
    if (u32(h.velocity.w) != owner || !inside(x, h.start, h.axis)) { continue; }
    force -= m.fluids[owner].mass * push[i].xyz;
    impulse += m.fluids[owner].mass * (h.velocity.xyz - records[i].v.xyz);
    push[i] = vec4<f32>(0.0, 0.0, 0.0, push[i].w);
    before[i] = vec4<f32>(0.0);
    records[i].v = vec4<f32>(h.velocity.xyz, records[i].v.w);
    if (CARRIED) { carry[i] = vec4<f32>(0.0); }
  }
  held[i] = Hold(vec4<f32>(force, 0.0), vec4<f32>(impulse, 0.0));
}
