// Stage `forces`, the twin of forces.rs and pairs.rs (E4-E8, E16, E17, E30): every pair from both of its ends.

// Sums over the SPH pairs of one particle.
struct Pairs { force: vec3<f32>, rate: f32, carry: vec3<f32>, full: f32, drive: vec3<f32>, growth: vec3<f32> }
// Numbers of a pair that depend on who the two are: see pairs.rs.
struct Terms { mu_sum: f32, eta: f32, same: f32, cohesion: f32, curvature: f32 }
// One pair. `seen`: relative velocity that viscosity sees.
struct Pair { volume: f32, share: f32, other_share: f32, other_volume: f32, d: vec3<f32>, r_sq: f32, v: vec3<f32>, seen: vec3<f32> }

// Implicit pressure has pushed already.
fn cut(share: f32) -> f32 {
  if (IMPLICIT) { return 0.0; }
  return select(max(share, 0.0), share, NEGATIVE);
}

// E4 and E5; returns G.
fn add_pair(sum: ptr<function, Pairs>, p: Pair, t: Terms) -> f32 {
  let s = sqrt(p.r_sq) * m.origin.w;
  let G = m.kernel.y * force_g(s);
  let volumes = p.volume * p.other_volume;
  let inverse_sq = softened_inverse(p.r_sq, m.tune.y);
  let along_d = pressure_force(volumes, cut(p.share), cut(p.other_share), G)
              + viscosity_artificial(volumes, t.eta, dot(p.v, p.d), inverse_sq, G);
  var along_v = 0.0;
  if (MUELLER) { along_v = viscosity_mueller(volumes, t.mu_sum, m.tune.x * viscosity_laplacian(s)); }
  else { along_v = viscosity_laminar(volumes, t.mu_sum, p.r_sq, inverse_sq, G); }
  (*sum).force += along_d * p.d + along_v * p.seen;
  return G;
}

// E1, the rate of density; diffusion among fluids alone.
fn add_rate(sum: ptr<function, Pairs>, p: Pair, t: Terms, G: f32, fluid: Fluid, among_fluids: bool) {
  (*sum).rate += density_rate(p.other_volume, dot(p.v, p.d), G);
  if (among_fluids) {
    let weight = fluid.density * dot(clock.gravity.xyz, p.d);
    (*sum).rate += density_diffusion(p.other_volume, p.share, p.other_share, weight, fluid.diffusion * t.same, fluid.stiffness, G);
  }
}

// E6, and the sums of shifting.
fn add_carry(sum: ptr<function, Pairs>, p: Pair, G: f32, among_fluids: bool) {
  let W = m.kernel.x * density_w(sqrt(p.r_sq) * m.origin.w);
  if (XSPH && among_fluids) { (*sum).carry += xsph(m.tune.z, p.other_volume, W) * p.v; }
  if (SHIFTING) {
    (*sum).full += p.other_volume * W;
    (*sum).drive += shifting(p.other_volume, W, m.kernel.z, m.upper.w, G) * p.d;
  }
}

// Springs between a particle of a fluid and one of a body (E16).
fn springs(kind: u32, fluid_share: f32) -> bool { return (kind == RIGID && !COUPLED_BY_PRESSURE) || (fluid_share <= 0.0 && !IMPLICIT); }
fn spring(d: vec3<f32>, v: vec3<f32>, r_sq: f32, fluid: u32, body: u32) -> vec3<f32> {
  let diameter = m.period.w;
  if (r_sq >= REACH * REACH * diameter * diameter) { return vec3<f32>(0.0); }
  let k = coupling_pair(m.fluids[fluid].mass, body);
  return contact_force(d, v, sqrt(r_sq), diameter, k.x, k.y, NORMAL_ONLY, clock.part);
}

@compute @workgroup_size(128)
fn forces_fluid(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 128u);
  if (clock.running == 0u || i >= live_fluid()) { return; }
  let own = records[i];
  let x = own.x.xyz;
  let owner = info[i].y;
  let me = m.fluids[owner];
  let limit = m.upper.w * m.upper.w;
  var sum = Pairs();
  var t = Terms(2.0 * me.viscosity, me.artificial, 1.0, me.cohesion, me.curvature);
  var near = around(i, x, FLUID);
  while (next_around(&near)) {
    let j = near.at;
    let other = records[j];
    let d = wrap(other.x.xyz - x);
    let r_sq = dot(d, d);
    if (r_sq >= limit || j == i) { continue; }
    if (FLUIDS > 1u) {
      let theirs = info[j].y;
      t.same = select(0.0, 1.0, theirs == owner);
      t.mu_sum = me.viscosity + m.fluids[theirs].viscosity;
      t.eta = 0.5 * (me.artificial + m.fluids[theirs].artificial);
    }
    let v = other.v.xyz - own.v.xyz;
    let p = Pair(own.x.w, own.v.w, other.v.w, other.x.w, d, r_sq, v, v);
    let G = add_pair(&sum, p, t);
    if (CONTINUITY) { add_rate(&sum, p, t, G, me, true); }
    if (TENSION) {
      let volumes = own.x.w * own.x.w;   // of one fluid, all alike
      let r = sqrt(r_sq);
      sum.force += cohesion(volumes, t.cohesion * t.same, r * m.origin.w, r) * d;
      sum.force += curvature(volumes, t.curvature * t.same) * (gradient[j].xyz - gradient[i].xyz);
    }
    if (VORTICITY) { sum.growth += (-G * other.x.w * gradient[j].w) * d; }
    if (XSPH || SHIFTING) { add_carry(&sum, p, G, true); }
  }
  // walls: the fluid's own viscosity acts (unless they are free of it), the artificial one does not
  t = Terms(select(2.0 * me.viscosity, 0.0, WALLS_SLIP), 0.0, 0.0, 0.0, 0.0);
  var pushed = vec3<f32>(0.0);
  for (var kind = RIGID; kind <= STATIC; kind += 1u) {
    let by_springs = springs(kind, own.v.w);
    near = around(i, x, kind);
    while (next_around(&near)) {
      let j = near.at;
      let other = records[j];
      let d = wrap(other.x.xyz - x);
      let r_sq = dot(d, d);
      if (r_sq >= limit) { continue; }
      let v = other.v.xyz - own.v.xyz;
      if (kind == STATIC || COUPLED_BY_PRESSURE) {
        var seen = v;
        if (NO_SLIP) { seen = mirror[j - m.count.x].xyz - own.v.xyz; }
        let p = Pair(own.x.w, own.v.w, other.v.w, other.x.w, d, r_sq, v, seen);
        let G = add_pair(&sum, p, t);
        if (CONTINUITY) { add_rate(&sum, p, t, G, me, false); }
        if (SHIFTING) { add_carry(&sum, p, G, false); }
      }
      if (by_springs) { pushed += spring(d, v, r_sq, owner, info[j].y); }
    }
  }
  var a = (sum.force + pushed) / me.mass + clock.gravity.xyz + fields_at(x, own.v.xyz);
  if (VORTICITY) {
    let confined = confinement(sum.growth, vorticity[i].xyz);
    a += confined;
    vorticity[i] = vec4<f32>(confined, 0.0);
  }
  push[i] = vec4<f32>(a, push[i].w);
  if (CARRIED) {
    var c = sum.carry;
    // only inside a fluid: at a free surface the gap would draw particles out
    if (SHIFTING && sum.full > SHIFTED_ABOVE - m.kernel.w * m.per_cell.w) {
      let drive = m.tune.w * clock.fastest * sum.drive;
      let size = length(drive);
      c += drive * min(1.0, 0.5 * clock.fastest / max(size, 1e-30));
    }
    carry[i] = vec4<f32>(c, sum.rate);
  }
}

@compute @workgroup_size(128)
fn forces_body(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 128u);
  if (clock.running == 0u) { return; }
  let i = body_particle(k);
  if (i == GONE) { return; }
  let kind = select(RIGID, STATIC, k >= m.count.y);
  let own = records[i];
  let x = own.x.xyz;
  let owner = info[i].y;
  if (asleep(bodies[owner])) {
    felt_by(i, k, vec3<f32>(0.0));
    if (is_wet(x)) { push[i].w = 1.0; }
    return;
  }
  let limit = m.upper.w * m.upper.w;
  var sum = Pairs();
  var pushed = vec3<f32>(0.0);
  var near = walk(x, FLUID);
  while (next(&near)) {
    let j = near.at;
    let other = records[j];
    let d = wrap(other.x.xyz - x);
    let r_sq = dot(d, d);
    if (r_sq >= limit) { continue; }
    let fluid = info[j].y;
    let v = other.v.xyz - own.v.xyz;
    if (kind == STATIC || COUPLED_BY_PRESSURE) {
      var seen = v;
      if (NO_SLIP) { seen = other.v.xyz - mirror[k].xyz; }
      let mu = select(2.0 * m.fluids[fluid].viscosity, 0.0, WALLS_SLIP);
      add_pair(&sum, Pair(own.x.w, own.v.w, other.v.w, other.x.w, d, r_sq, v, seen), Terms(mu, 0.0, 0.0, 0.0, 0.0));
    }
    if (springs(kind, other.v.w)) { pushed += spring(d, v, r_sq, fluid, owner); }
  }
  felt_by(i, k, sum.force + pushed);
}

// What a body's particle feels by fluids, and by contacts as bodies are now.
fn felt_by(i: u32, k: u32, by_fluid: vec3<f32>) {
  let x = records[i].x.xyz;
  let owner = info[i].y;
  var felt = Felt();
  add_contacts(&felt, i, x, owner, RIGID);
  if (asleep(bodies[owner])) {
    // nothing new, but for what wakes it
    push[i] = vec4<f32>(0.0, 0.0, 0.0, felt.stirred);
    touch[k] = Touch();
    return;
  }
  add_contacts(&felt, i, x, owner, STATIC);
  var force = by_fluid + felt.force;
  if (RUBS && k < m.count.y && felt.held < 8u) { slips[m.count.y + info[i].x].held[felt.held].w = GONE; }
  if (bodies[owner].x.w > 0.0) {
    force += bodies[owner].stated.z * fields_at(x, records[i].v.xyz);
  }
  push[i] = vec4<f32>(force, felt.stirred);
  touch[k] = Touch(vec4<f32>(by_fluid, felt.sharers), vec4<f32>(felt.force, felt.contacts),
                   vec4<f32>(felt.couple, felt.deep));
}

// Contacts of bodies alone, in a part of a step of implicit pressure.
@compute @workgroup_size(128)
fn touch_bodies(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let k = number(g, n, l, 128u);
  let i = m.count.x + k;
  if (!moving() || i >= rigid_end()) { return; }
  felt_by(i, k, vec3<f32>(0.0));
}
