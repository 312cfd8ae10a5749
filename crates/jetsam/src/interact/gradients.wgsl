// Stage `gradients`, the twin of gradients.rs: colour gradient (E7) and vorticity (E8) of fluids, where they are asked for.

@compute @workgroup_size(128)
fn gradients(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  if (clock.running == 0u || i >= live_fluid()) { return; }
  let own = records[i];
  let owner = info[i].y;
  let limit = m.upper.w * m.upper.w;
  var color = vec3<f32>(0.0);
  var curl = vec3<f32>(0.0);
  var near = around(i, own.x.xyz, FLUID);
  while (next_around(&near)) {
    let j = near.at;
    let other = records[j];
    let d = wrap(other.x.xyz - own.x.xyz);
    let r_sq = dot(d, d);
    if (r_sq >= limit) { continue; }
    let slope = -m.kernel.y * force_g(sqrt(r_sq) * m.origin.w) * other.x.w;   // grad_i W = -G d_ij
    color += select(0.0, slope, info[j].y == owner) * d;
    curl += slope * cross(d, other.v.xyz - own.v.xyz);
  }
  gradient[i] = vec4<f32>(m.upper.w * color, length(curl));
  vorticity[i] = vec4<f32>(curl, 0.0);
}

// E8: acceleration of confinement (m/s^2), `growth` the direction in which |omega| grows.
fn confinement(growth: vec3<f32>, omega: vec3<f32>) -> vec3<f32> {
  let size = length(growth);
  if (size == 0.0) { return vec3<f32>(0.0); }
  return m.contact.y * cross(growth / size, omega);
}
