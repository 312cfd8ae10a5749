// Stage `agents`, second half, the twin of decide.rs, sums.rs and obstacles.rs: what agents perceive and decide (E22-E26).

// Sixty-four bits as two words, the low one first; the mixer is that of random.rs.
fn times_wide(a: u32, b: u32) -> vec2<u32> {
  let low = (a & 0xffffu) * (b & 0xffffu);
  let cross_a = (a >> 16u) * (b & 0xffffu);
  let cross_b = (a & 0xffffu) * (b >> 16u);
  let middle = (low >> 16u) + (cross_a & 0xffffu) + (cross_b & 0xffffu);
  let high = (a >> 16u) * (b >> 16u) + (cross_a >> 16u) + (cross_b >> 16u) + (middle >> 16u);
  return vec2<u32>((low & 0xffffu) | (middle << 16u), high);
}
fn times_word(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
  let low = times_wide(a.x, b.x);
  return vec2<u32>(low.x, low.y + a.x * b.y + a.y * b.x);
}
fn plus_word(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
  let low = a.x + b.x;
  return vec2<u32>(low, a.y + b.y + select(0u, 1u, low < a.x));
}
fn shifted(a: vec2<u32>, by: u32) -> vec2<u32> { return vec2<u32>((a.x >> by) | (a.y << (32u - by)), a.y >> by); }
fn mixed(z: vec2<u32>, word: vec2<u32>) -> vec2<u32> {
  var y = plus_word(z ^ word, vec2<u32>(0x7f4a7c15u, 0x9e3779b9u));
  y = times_word(y ^ shifted(y, 30u), vec2<u32>(0x1ce4e5b9u, 0xbf58476du));
  y = times_word(y ^ shifted(y, 27u), vec2<u32>(0x133111ebu, 0x94d049bbu));
  return y ^ shifted(y, 31u);
}
// Uniform in [0, 1) by seed, stream and index.
fn uniform_of(seed: vec2<u32>, stream: u32, index: vec2<u32>) -> f32 {
  let z = mixed(mixed(mixed(vec2<u32>(0u), seed), vec2<u32>(stream, 0u)), index);
  return f32(z.y >> 8u) * 5.9604645e-8;
}
const SWING: u32 = 0u;
const AXIS: u32 = 2u;
const WANDER: u32 = 5u;
const TAU: f32 = 6.2831853;

// A random unit vector, even over the sphere (2D: the circle).
fn random_direction(seed: vec2<u32>, stream: u32, index: vec2<u32>, flat: bool) -> vec3<f32> {
  let a = TAU * uniform_of(seed, stream, index);
  if (flat) { return vec3<f32>(cos(a), 0.0, sin(a)); }
  let z = 2.0 * uniform_of(seed, stream + 1u, index) - 1.0;
  let r = sqrt(max(1.0 - z * z, 0.0));
  return vec3<f32>(r * cos(a), r * sin(a), z);
}

// Where an agent wanders: a random direction that changes smoothly.
fn wander(rule: Rule, id: u32) -> vec3<f32> {
  let seed = rule.who.zw;
  let t = rule.time.x / rule.drive.y + uniform_of(seed, WANDER, vec2<u32>(id, 0u));
  let knot = u32(t);
  let part = t - floor(t);
  let blend = part * part * (3.0 - 2.0 * part);
  let a = random_direction(seed, WANDER + 1u, vec2<u32>(id, knot), FLAT);
  let b = random_direction(seed, WANDER + 1u, vec2<u32>(id, knot + 1u), FLAT);
  return a + (b - a) * blend;
}

// Sums over neighbours: see sums.rs.
struct Perceived {
  repelled: vec3<f32>, aligned: f32, velocity: vec3<f32>, drawn: f32, place: vec3<f32>, fled: vec3<f32>, chased: vec3<f32>,
}

fn seen_by(rule: Rule, v: vec3<f32>, d: vec3<f32>, r_sq: f32) -> f32 {
  if (rule.sense.y >= 2.0) { return 1.0; }
  return in_view(dot(v, d), r_sq, dot(v, v), rule.sense.y);
}

fn school_with(s: ptr<function, Perceived>, rule: Rule, v: vec3<f32>, other: vec3<f32>, d: vec3<f32>, r_sq: f32, itself: bool, unbounded: bool) {
  let near_sq = rule.radii.x * rule.radii.x;
  let align_sq = select(rule.radii.y * rule.radii.y, 1e30, unbounded && rule.kind.x != COUZIN);
  let draw_sq = select(rule.radii.z * rule.radii.z, 1e30, unbounded);
  let seen = seen_by(rule, v, d, r_sq);
  if (rule.kind.x == REYNOLDS) {
    let aligned = seen * within(r_sq, align_sq);
    let drawn = seen * within(r_sq, draw_sq);
    (*s).velocity += aligned * other;
    (*s).aligned += aligned;
    (*s).place += drawn * d;
    (*s).drawn += drawn;
    if (!itself) { (*s).repelled -= (seen * separation(r_sq, rule.radii.x) * within(r_sq, near_sq)) * d; }
  } else if (rule.kind.x == COUZIN) {
    let outer = max(align_sq, near_sq);
    let inverse = 1.0 / sqrt(max(r_sq, 1e-30));
    (*s).repelled -= (inverse * within(r_sq, near_sq)) * d;
    (*s).velocity += (seen * between(r_sq, near_sq, outer) / rule.limits.x) * other;
    (*s).place += (inverse * seen * between(r_sq, outer, max(draw_sq, outer))) * d;
  } else {
    (*s).velocity += (seen * within(r_sq, align_sq)) * other;
  }
}

// What a flock is to another.
fn relation_to(rule: Rule, f: u32) -> u32 { return (rule.relations[f / 16u] >> (2u * (f % 16u))) & 3u; }

fn perceive(i: u32, own: u32) -> Perceived {
  let rule = crowd.rules[own];
  let x = agents[i].x.xyz;
  let v = agents[i].v.xyz;
  var s = Perceived();
  for (var f = 0u; f < crowd.number.y; f += 1u) {
    let relation = relation_to(rule, f);
    if (relation == 1u || (relation == SCHOOL && rule.count.z > 0u)) { continue; }
    let reach = select(rule.sense.x, rule.radii.w, relation == SCHOOL);
    var near = agent_region(x, reach, f);
    while (agent_region_next(&near)) {
      let other = agents[near.at];
      let d = apart(x, other.x.xyz);
      let r_sq = dot(d, d);
      if (relation == SCHOOL) {
        school_with(&s, rule, v, other.v.xyz, d, r_sq, near.at == i, false);
      } else {
        let w = seen_by(rule, v, d, r_sq) * within(r_sq, reach * reach) * nearness(r_sq);
        if (relation == FLEE) { s.fled += w * d; } else { s.chased += w * d; }
      }
    }
  }
  if (rule.count.z > 0u) { add_nearest(&s, i, rule); }
  return s;
}

// E25: the nearest few of those schooled with, however far; ties go to the lower id.
fn add_nearest(s: ptr<function, Perceived>, i: u32, rule: Rule) {
  let x = agents[i].x.xyz;
  let v = agents[i].v.xyz;
  let k = min(rule.count.z, NEAREST);
  var r_sqs = array<f32, NEAREST>();
  var whos = array<u32, NEAREST>();
  var found = 0u;
  // radii doubled until as many are inside: all who are nearer are then known
  var reach = 1.5 * crowd.per_cell.w;
  for (var round = 0; round < 40; round += 1) {
    found = 0u;
    var all = 0u;
    for (var f = 0u; f < crowd.number.y; f += 1u) {
      if (relation_to(rule, f) != SCHOOL) { continue; }
      all += crowd.rules[f].kind.z;
      var near = agent_region(x, reach, f);
      while (agent_region_next(&near)) {
        let j = near.at;
        let d = apart(x, agents[j].x.xyz);
        let r_sq = dot(d, d);
        if (j == i || r_sq >= reach * reach || seen_by(rule, v, d, r_sq) == 0.0) { continue; }
        var at = found;
        let id = bitcast<u32>(agents[j].x.w);
        while (at > 0u) {
          let other = whos[at - 1u];
          let nearer = r_sqs[at - 1u] < r_sq || (r_sqs[at - 1u] == r_sq && bitcast<u32>(agents[other].x.w) < id);
          if (nearer) { break; }
          if (at < k) { r_sqs[at] = r_sqs[at - 1u]; whos[at] = other; }
          at -= 1u;
        }
        if (at < k) { r_sqs[at] = r_sq; whos[at] = j; found = min(found + 1u, k); }
      }
    }
    let widest = length(vec3<f32>(crowd.cells.xyz) / crowd.per_cell.xyz);
    if (found >= k || reach > widest || found + 1u >= all) { break; }
    reach *= 2.0;
  }
  for (var n = 0u; n < found; n += 1u) {
    let other = agents[whos[n]];
    school_with(s, rule, v, other.v.xyz, apart(x, other.x.xyz), r_sqs[n], false, true);
  }
  // what the agent itself brings
  (*s).velocity += v;
  (*s).aligned += 1.0;
  (*s).drawn += 1.0;
}

// Fleeing along -toward.
fn flee_from(rule: Rule, v: vec3<f32>, toward: vec3<f32>, closeness: f32) -> vec3<f32> {
  return flee(v, -direction_of(toward), rule.limits.z, closeness, rule.fear.x);
}

fn escape(rule: Rule, x: vec3<f32>, v: vec3<f32>, s: Perceived) -> vec3<f32> {
  var total = vec3<f32>(0.0);
  let sight = rule.sense.x;
  if (any(s.fled != vec3<f32>(0.0))) { total += flee_from(rule, v, s.fled, max(side(1.0 / length(s.fled), sight), 0.1)); }
  if ((rule.who.y & 2u) != 0u) {
    for (var b = 0u; b < m.count.w; b += 1u) {
      if (bodies[b].x.w == 0.0) { continue; }
      let d = apart(x, bodies[b].x.xyz);
      let gap = length(d) - bodies[b].shape.x;
      if (gap < sight) { total += flee_from(rule, v, d, side(max(gap, 0.0), sight)); }
    }
  }
  if ((rule.who.y & 4u) != 0u) {
    var sum = vec3<f32>(0.0);
    var nearest = 1e30;
    var near = region(x, sight, FLUID);
    while (region_next(&near)) {
      let d = apart(x, records[near.at].x.xyz);
      let r_sq = dot(d, d);
      if (r_sq >= sight * sight) { continue; }
      sum += d * nearness(r_sq);
      nearest = min(nearest, sqrt(r_sq));
    }
    if (any(sum != vec3<f32>(0.0))) { total += flee_from(rule, v, sum, side(nearest, sight)); }
  }
  return total;
}

// Leader following (Reynolds 1999): arrive behind the leader, and give way to it.
fn follow_leader(rule: Rule, x: vec3<f32>, v: vec3<f32>) -> vec3<f32> {
  let lead = crowd.rules[rule.who.x];
  let heading = direction_of(lead.lead_v.xyz);
  let behind = rule.matter.w;
  let d = apart(x, lead.lead_x.xyz);
  if (all(d == vec3<f32>(0.0))) { return d; }
  var a = seek(v, d - behind * heading, rule.limits.z, behind, rule.drive.w);
  let before_it = d + behind * heading;
  if (length(before_it) < behind) {
    a += flee(v, -direction_of(before_it), rule.limits.z, side(length(before_it), behind), rule.drive.w);
  }
  return a;
}

fn keep_in(rule: Rule, x: vec3<f32>) -> vec3<f32> {
  var total = vec3<f32>(0.0);
  for (var a = 0u; a < 3u; a += 1u) {
    if (m.period[a] > 0.0 || (FLAT && a == 1u)) { continue; }
    let margin = select(rule.matter.z, rule.body.w, ((SOLID >> a) & 1u) == 1u);
    if (margin > 0.0) { total[a] = side(x[a] - m.corner[a], margin) - side(m.far_corner[a] - x[a], margin); }
  }
  return total;
}

// Where to steer so as to stay in a fluid.
fn into_fluid(x: vec3<f32>) -> vec3<f32> {
  let radius = 2.0 * m.upper.w;
  var sum = vec3<f32>(0.0);
  var count = 0.0;
  var near = region(x, radius, FLUID);
  while (region_next(&near)) {
    let d = apart(x, records[near.at].x.xyz);
    if (dot(d, d) < radius * radius) { sum += d; count += 1.0; }
  }
  if (count == 0.0) { return sum; }
  let way = sum / (0.375 * radius * count);
  return way / max(length(way), 1.0);
}

// Where to steer because of what stands ahead.
fn look_ahead(rule: Rule, x: vec3<f32>, v: vec3<f32>) -> vec3<f32> {
  let speed = length(v);
  if (speed == 0.0) { return vec3<f32>(0.0); }
  let heading = v / speed;
  let clear = rule.body.y;
  let reach = speed * rule.sense.w + clear;
  let step = max(clear, reach / 16.0);
  let radius = max(clear, 0.75 * step);
  for (var way = 0.0; way < reach; way += step) {
    let at = x + (way + 0.5 * step) * heading;
    var away = vec3<f32>(0.0);
    for (var kind = RIGID; kind <= STATIC; kind += 1u) {
      var near = region(at, radius, kind);
      while (region_next(&near)) {
        let d = apart(at, records[near.at].x.xyz);
        let r = length(d);
        if (r < radius) { away -= d * (1.0 - r / radius); }
      }
    }
    if (any(away != vec3<f32>(0.0))) {
      let across = away - dot(away, heading) * heading;
      var aside = vec3<f32>(heading.z, 0.0, -heading.x);
      if (length(across) > 0.05 * length(away)) { aside = normalize(across); }
      else if (!FLAT) {
        aside = direction_of(cross(heading, vec3<f32>(0.0, 0.0, 1.0)));
        if (all(aside == vec3<f32>(0.0))) { aside = vec3<f32>(1.0, 0.0, 0.0); }
      }
      return aside * (1.0 - way / reach);
    }
  }
  return vec3<f32>(0.0);
}

// E22, E26: all steering of a Reynolds agent (m/s^2).
fn steer(rule: Rule, i: u32, s: Perceived) -> vec3<f32> {
  let x = agents[i].x.xyz;
  let v = agents[i].v.xyz;
  var a = rule.pull.x * s.repelled;
  a += alignment(v, s.velocity / s.aligned, rule.pull.y);
  if (s.drawn > 1.0) { a += cohere(s.place / (s.drawn - 1.0), rule.pull.z); }
  a += cruise(v, rule.limits.x, rule.pull.w);
  if (rule.goal.w >= 0.0) { a += seek(v, apart(x, rule.goal.xyz), rule.limits.z, rule.goal.w, rule.drive.z); }
  if (rule.drive.x > 0.0) { a += rule.drive.x * wander(rule, bitcast<u32>(agents[i].x.w)); }
  if (rule.who.x != GONE) { a += follow_leader(rule, x, v); }
  a += escape(rule, x, v, s);
  if (any(s.chased != vec3<f32>(0.0))) { a += seek(v, s.chased, rule.limits.z, 0.0, rule.fear.y); }
  a += rule.fear.z * keep_in(rule, x);
  if ((rule.who.y & 1u) != 0u) { a += rule.fear.z * into_fluid(x); }
  if (rule.fear.z > 0.0 && has_bodies()) { a += rule.fear.z * look_ahead(rule, x, v); }
  if (FLAT) { a.y = 0.0; }
  return limited(a, rule.limits.w);
}

// A direction turned by an angle: in the plane, or about a random axis.
fn swing(rule: Rule, way: vec3<f32>, angle: f32, count: vec2<u32>) -> vec3<f32> {
  var axis = vec3<f32>(-way.z, 0.0, way.x);
  if (!FLAT) {
    let random = random_direction(rule.who.zw, AXIS, count, false);
    axis = direction_of(random - dot(random, way) * way);
  }
  return swung(way, axis, cos(angle), sin(angle));
}

@compute @workgroup_size(64)
fn decide(@builtin(workgroup_id) g: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>, @builtin(local_invocation_index) l: u32) {
  let i = number(g, n, l, 64u);
  if (clock.running == 0u || i >= crowd.number.x) { return; }
  let own = flock_of(i);
  let rule = crowd.rules[own];
  let x = agents[i].x.xyz;
  if (rule.count.y == 0u || !(finite(x.x) && finite(x.y) && finite(x.z))) { return; }
  let s = perceive(i, own);
  if (rule.kind.x == REYNOLDS) {
    agents[i].next = vec4<f32>(steer(rule, i, s), 0.0);
    return;
  }
  let heading = direction_of(agents[i].v.xyz);
  let seed = rule.who.zw;
  let count = vec2<u32>(bitcast<u32>(agents[i].x.w), rule.count.x);
  var wanted = heading;
  if (rule.kind.x == COUZIN) {
    wanted = couzin(s.repelled, s.velocity, s.place, heading);
    if (rule.fear.w > 0.0) {
      // Box and Muller
      let size = sqrt(-2.0 * log(1.0 - uniform_of(seed, SWING, count)));
      wanted = swing(rule, wanted, rule.fear.w * size * cos(TAU * uniform_of(seed, SWING + 1u, count)), count);
    }
  } else {
    if (length(s.velocity) > 0.0) { wanted = direction_of(s.velocity); }
    wanted = swing(rule, wanted, rule.fear.w * (uniform_of(seed, SWING, count) - 0.5), count);
  }
  let t = turn_of(rule.sense.z * rule.time.z);
  agents[i].next = vec4<f32>(direction_of(turned(heading, wanted, t.x, t.y)) * rule.limits.x, 0.0);
}
