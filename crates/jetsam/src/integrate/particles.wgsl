// Stages `drift` and `kick` of free particles, the twin of particles.rs (E20), and of slots that follow their bodies (E21).

// How far rates are extrapolated from the last two steps: half a step in units of the step before.
fn ahead() -> f32 { return select(0.0, 0.5 * clock.dt / clock.dt_before, clock.dt_before > 0.0); }

@compute @workgroup_size(128)
fn drift_fluid(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  if (clock.running == 0u || i >= clock.live) { return; }
  let r = records[i];
  var a = push[i];
  let dt = clock.dt;
  let half = select(dt, 0.5 * dt, LEAPFROG);
  var u = r.v.xyz + half * a.xyz;
  var rates = vec4<f32>(0.0);
  if (CARRIED) { u += carry[i].xyz; }
  if (CONTINUITY) {
    let old = rate[i];
    rates = select(old, vec4<f32>(carry[i].w, old.x, old.z, 0.0), dt > 0.0);   // a sort without a step changes nothing
    a.w += dt * (rates.x + ahead() * (rates.x - rates.y));
  }
  if (MORTAL && !CONTINUITY) { rates = rate[i]; }
  let x = home_all(r.x.xyz + dt * u);
  let own = info[i];
  drifted[i] = Drifted(vec4<f32>(x, r.x.w), vec4<f32>(r.v.xyz + dt * a.xyz, r.v.w), a, rates, own.x, own.y, vec2<u32>(0u));
}

@compute @workgroup_size(128)
fn follow(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let s = number(g, n, l, 128u);
  if (clock.running == 0u || s >= m.count.y) { return; }
  let slot = slots[s];
  let b = bodies[slot.owner];
  let arm = turn(b.q, slot.offset.xyz);
  let i = m.count.x + s;
  drifted[i].x = vec4<f32>(home_all(b.x.xyz + arm), slot.offset.w);
  drifted[i].v = vec4<f32>(b.v.xyz + cross(b.omega.xyz, arm), 0.0);
  drifted[i].push = vec4<f32>(0.0, 0.0, 0.0, b.x.w);
  drifted[i].id = s;
  drifted[i].owner = slot.owner;
  slots[s].facing = vec4<f32>(turn(b.q, slot.normal.xyz), 0.0);
}

@compute @workgroup_size(128)
fn kick_fluid(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  if (clock.running == 0u || i >= live_fluid()) { return; }
  var v = records[i].v.xyz;
  if (LEAPFROG) { v += 0.5 * clock.dt * (push[i].xyz - before[i].xyz); }
  v *= exp(-clock.drag * clock.dt);
  records[i].v = vec4<f32>(v, records[i].v.w);
  if (CONTINUITY) {
    let old = rate[i];
    push[i].w += clock.dt * (0.5 * (carry[i].w - old.x) - ahead() * (old.x - old.y));
  }
}
