// Sleep, the twin of sleep.rs. Here the particles of a body that sleeps do look around, but only for what may wake it, each for itself.

fn asleep(b: Body) -> bool { return SLEEPS && (b.counts.y & ASLEEP) != 0u; }

// Whether a body wakes what it touches: it moves.
fn restless(b: Body) -> bool {
  if (asleep(b)) { return false; }
  if (b.x.w == 0.0) { return any(b.v.xyz != vec3<f32>(0.0)) || any(b.omega.xyz != vec3<f32>(0.0)); }
  return b.shape.y == 0.0;
}

// Whether fluid is so near that it wakes what sleeps.
fn is_wet(x: vec3<f32>) -> bool {
  var near = walk(x, FLUID);
  while (next(&near)) {
    let d = wrap(records[near.at].x.xyz - x);
    if (dot(d, d) < m.upper.w * m.upper.w) { return true; }
  }
  return false;
}

// After a kick: how long a body has been still, and whether it falls asleep.
fn doze(k: u32) {
  let b = bodies[k];
  if (!SLEEPS || b.x.w == 0.0 || b.shape.z > 0.0) { return; }
  let stirred = (b.counts.y & STIRRED) != 0u;
  if (asleep(b)) {
    if (stirred) {
      bodies[k].counts.y = b.counts.y & ~ASLEEP;
      bodies[k].shape.y = clock.part;
    }
    return;
  }
  let speed = sqrt(dot(b.v.xyz, b.v.xyz) + dot(b.l.high.xyz, b.omega.xyz) * b.x.w);
  let held = b.counts.x > 0u && all(b.force_fluid.xyz == vec3<f32>(0.0));
  let still = select(0.0, b.shape.y + clock.part, held && speed < SLOW);
  bodies[k].shape.y = still;
  if (still < SLEEP || stirred) { return; }
  let nothing = wide(vec4<f32>(0.0));
  let at_rest = Wide(vec4<f32>(0.0, 0.0, 0.0, b.p.high.w), vec4<f32>(0.0, 0.0, 0.0, b.p.low.w));
  bodies[k].counts.y = b.counts.y | ASLEEP;
  bodies[k].p = at_rest;
  bodies[k].p_half = at_rest;
  bodies[k].v = nothing.high;
  bodies[k].l = nothing;
  bodies[k].l_half = nothing;
  bodies[k].omega = nothing.high;
  bodies[k].omega_low = nothing.high;
  bodies[k].force = vec4<f32>(0.0, 0.0, 0.0, b.force.w);
  bodies[k].torque = nothing.high;
}
