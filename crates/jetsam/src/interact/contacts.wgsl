// Contacts of particles of different bodies, the twin of contacts.rs and of the pair constants in model.rs (E10-E14).

// Spring (N/m) and dashpot (N s/m) of a mass that `shared_by` contacts carry, `counted` of them now.
fn contact_constants(mass: f32, ln_e: f32, shared_by: f32, counted: f32, stated_k: f32, stated_eta: f32) -> vec2<f32> {
  let k = select(mass * m.contact.x / shared_by, stated_k, stated_k > 0.0);
  let number = max(shared_by, counted);
  let eta = dashpot(damping_ratio(ln_e), k * number, mass) / number;
  return vec2<f32>(k, select(eta, stated_eta, stated_eta >= 0.0));
}

fn coupling_pair(fluid_mass: f32, body: u32) -> vec2<f32> {
  let law = bodies[body].law;
  let stated = bodies[body].stated;
  return contact_constants(1.0 / (1.0 / fluid_mass + bodies[body].x.w), law.x, 1.0, 1.0, stated.x, stated.y);
}

// What a particle feels by contacts.
struct Felt { force: vec3<f32>, contacts: f32, couple: vec3<f32>, sharers: f32, deep: f32, stirred: f32, held: u32, load: array<f32, 8> }

// The slip of a contact up to now (m), as slot `keeper` remembers it; w: 1 if it does.
fn remembered(keeper: u32, partner: u32) -> vec4<f32> {
  for (var k = 0u; k < 8u; k += 1u) {
    let held = slips[keeper].held[k];
    if (held.w == GONE) { break; }
    if (held.w == partner) { return vec4<f32>(bitcast<vec3<f32>>(held.xyz), 1.0); }
  }
  return vec4<f32>(0.0);
}
// The same seen from slot `own`: the lower of two slots keeps it, and whoever is awake where the other is not; what that one knew before
// it fell asleep still counts.
fn slip_between(own: u32, other: u32, dozes: bool) -> vec3<f32> {
  if (own < other || dozes) {
    let mine = remembered(own, other);
    if (mine.w > 0.0) { return mine.xyz; }
  }
  if (own > other || dozes) { return -remembered(other, own).xyz; }
  return vec3<f32>(0.0);
}

// Remembers the slip of a contact; where there are too many, the one that bears least is forgotten.
fn keep(felt: ptr<function, Felt>, own: u32, other: u32, slip: vec3<f32>, load: f32) {
  var at = (*felt).held;
  if (at == 8u) {
    at = 0u;
    for (var k = 1u; k < 8u; k += 1u) {
      if ((*felt).load[k] < (*felt).load[at]) { at = k; }
    }
    if (load <= (*felt).load[at]) { return; }
  } else {
    (*felt).held += 1u;
  }
  (*felt).load[at] = load;
  slips[m.count.y + own].held[at] = vec4<u32>(bitcast<vec3<u32>>(slip), other);
}

// Tangential force of a pair (E13; Cundall and Strack 1979; Luding 2008); `pair`: slots of this one and of the other.
fn rub(felt: ptr<function, Felt>, a: Body, b: Body, pair: vec2<u32>, k: f32, part: f32, counted: f32, v: vec3<f32>, load: f32, n: vec3<f32>) -> vec3<f32> {
  var mu = sqrt(max(a.law.w * b.law.w, 0.0));
  if (a.law.w < 0.0) { mu = b.law.w; } else if (b.law.w < 0.0) { mu = a.law.w; }
  if (mu <= 0.0) { return vec3<f32>(0.0); }
  let mass = 1.0 / (a.x.w + b.x.w);
  let number = max(max(a.law.y, b.law.y), counted);
  let k_t = TANGENTIAL * k;
  let eta_t = part * dashpot(TANGENTIAL_DAMPING, k_t / part * number, mass) / number;
  let turn = 0.5 * clock.part * dot(a.omega.xyz + b.omega.xyz, n);
  let slip = slip_carried(slip_between(pair.x, pair.y, asleep(b)), n, turn) + v * clock.part;
  let limit = mu * load;
  let held = friction(k_t * slip, limit);
  if ((pair.x < pair.y || asleep(b)) && k_t > 0.0) { keep(felt, pair.x, pair.y, held / k_t, load); }
  return friction(held + eta_t * v, limit);
}

// Whether two bodies pass through each other, as a joint holds them together.
fn joined(a: u32, b: u32) -> bool {
  for (var k = 0u; k < HAS_JOINED; k += 1u) {
    let pair = m.joined[k];
    if ((pair.x == a && pair.y == b) || (pair.x == b && pair.y == a)) { return true; }
  }
  return false;
}

fn add_contacts(felt: ptr<function, Felt>, i: u32, x: vec3<f32>, owner: u32, kind: u32) {
  let diameter = m.period.w;
  let spacing = m.lower.w;
  var reach_sq = REACH * REACH * diameter * diameter;
  if (SMOOTH) { reach_sq += spacing * spacing; }
  let own_slot = info[i].x;
  let a = bodies[owner];
  if (kind == STATIC && a.x.w == 0.0) { return; }
  // particles of bodies may have gone on since they were sorted
  var near = region(x, sqrt(reach_sq) + clock.stray, kind);
  while (region_next(&near)) {
    let j = near.at;
    let body = info[j].y;
    let d = wrap(records[j].x.xyz - x);
    let r_sq = dot(d, d);
    if (r_sq >= reach_sq || body == owner) { continue; }
    let inverse_mass = a.x.w + bodies[body].x.w;
    if (inverse_mass == 0.0 || joined(owner, body)) { continue; }
    let b = bodies[body];
    let stirs = SLEEPS && restless(b) && !restless(a);
    if (asleep(a) && !stirs) { continue; }
    let r = sqrt(r_sq);
    let other_slot = info[j].x;
    var n = d / max(r, 1e-12);
    var along = d;
    var s = r;
    var part = 1.0;
    var arm = 0.5 * d;   // where they touch, seen from i: midway, or where a ball stands on a face
    if (SMOOTH) {
      let f_a = slots[own_slot].facing.xyz;
      let f_b = slots[other_slot].facing.xyz;
      let normal = contact_normal(d, r, f_a, f_b);
      if (any(normal != n) && (any(f_a != vec3<f32>(0.0)) || any(f_b != vec3<f32>(0.0)))) {
        n = normal;
        s = dot(d, n);
        along = n * s;
        part = contact_part(length(d - along) / spacing);
        if (all(f_b == vec3<f32>(0.0))) { arm = d - 0.5 * along; }
        else if (all(f_a == vec3<f32>(0.0))) { arm = 0.5 * along; }
      }
    }
    if (s >= REACH * diameter || part <= 0.0) { continue; }
    var v = records[j].v.xyz - records[i].v.xyz;
    if (!FULL_DAMPING) { v -= cross(a.omega.xyz, arm) + cross(b.omega.xyz, d - arm); }
    let counted = max(a.force.w, b.force.w);
    var ln_e = 0.5 * (a.law.x + b.law.x);
    if (a.x.w == 0.0) { ln_e = b.law.x; } else if (b.x.w == 0.0) { ln_e = a.law.x; }
    let mass = 1.0 / inverse_mass;
    let k = contact_constants(mass, ln_e, max(a.law.y, b.law.y), counted, max(a.stated.x, b.stated.x), max(a.stated.y, b.stated.y));
    var f = part * contact_force(along, v, s, diameter, k.x, k.y, NORMAL_ONLY, clock.part);
    let speed = dot(v, n);
    let overlap = diameter - s;
    let held = max(counted, 1.0) * k.x * (diameter * diameter - overlap * overlap);
    if (overlap > DEEP * diameter && speed < 0.0 && mass * speed * speed > HELD * held) {
      // taken within a step if as many contacts as a face has particles share it
      let stop = select(0.0, mass / (clock.part * max(a.law.z, b.law.z)), clock.part > 0.0);
      f += n * (speed * part * stop);
      (*felt).deep += 1.0;
    }
    if (s < diameter) {
      (*felt).contacts += 1.0;
      (*felt).sharers += part;
      if (stirs) { (*felt).stirred = 1.0; }
      if (RUBS) {
        let pair = vec2<u32>(own_slot, other_slot);
        f += rub(felt, a, b, pair, k.x * part, part, counted, v - n * speed, max(-dot(f, n), 0.0), n);
      }
    }
    (*felt).force += f;
    if (!FULL_DAMPING) { (*felt).couple += cross(arm, f); }
  }
}
