// Stage `boundary`, the twin of boundary.rs: the pressure the fluid shows to particles of bodies and walls (E17).

// Acceleration of a particle of a scripted body (m/s^2): the wall's of Adami et al. 2012, eq. 27.
fn wall_acceleration(b: Body, x: vec3<f32>) -> vec3<f32> {
  if (b.x.w > 0.0) { return vec3<f32>(0.0); }
  let arm = x - b.x.xyz;
  return b.acceleration.xyz + cross(b.angular_acceleration.xyz, arm) + cross(b.omega.xyz, cross(b.omega.xyz, arm));
}

// The particle of a body that an invocation stands for, or GONE.
fn body_particle(k: u32) -> u32 {
  let i = m.count.x + k;
  if (k >= m.count.z || (k < m.count.y && i >= rigid_end())) { return GONE; }
  return i;
}

@compute @workgroup_size(128)
fn boundary(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 128u);
  if (clock.running == 0u) { return; }
  let i = body_particle(k);
  if (i == GONE) { return; }
  let own = records[i];
  let x = own.x.xyz;
  let limit = m.upper.w * m.upper.w;
  var pull = clock.gravity.xyz - wall_acceleration(bodies[info[i].y], x);
  if (!SYMMETRIC) { pull *= 0.5; }   // shares are half pressures
  var total = 0.0;
  var weight = 0.0;
  var flow = vec3<f32>(0.0);
  var near = walk(x, FLUID);
  while (next(&near)) {
    let j = near.at;
    let other = records[j];
    let d = wrap(other.x.xyz - x);
    let r_sq = dot(d, d);
    if (r_sq >= limit) { continue; }
    let w = density_w(sqrt(r_sq) * m.origin.w);
    let rho = m.fluids[info[j].y].density;
    let share = select(max(other.v.w, 0.0), other.v.w, NEGATIVE);
    total += w * pressure_at_boundary(share, rho, -dot(pull, d));
    weight += w;
    flow += w * other.v.xyz;
  }
  var share = 0.0;
  var shown = own.v.xyz;
  if (weight > 0.0) {
    share = total / weight;
    if (!NEGATIVE) { share = max(share, 0.0); }
    shown = 2.0 * shown - flow / weight;
  }
  records[i].v.w = share;
  if (NO_SLIP) { mirror[k] = vec4<f32>(shown, 0.0); }
}
