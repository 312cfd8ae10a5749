// What all kernels share: constants, buffers, the domain, and the walk over the particles around a place.
// The text before this one, made for each scene, holds its choices as constants (backend/gpu/program.rs).

struct Fluid {
  density: f32, mass: f32, viscosity: f32, stiffness: f32,
  artificial: f32, cohesion: f32, curvature: f32, diffusion: f32,
  lifetime: f32, unused_a: f32, unused_b: f32, unused_c: f32,
}

// E30. kind: 0 point gravity, 1 wind, 2 vortex.
struct Field { place: vec4<f32>, axis: vec4<f32>, kind: u32, strength: f32, core: f32, rate: f32 }

// E31. Inside of a hose: start and length, axis and radius, velocity and number of the fluid.
struct Hose { start: vec4<f32>, axis: vec4<f32>, velocity: vec4<f32> }
// What a sink takes in. kind 0: box (low, high); 1: ball (centre, radius); 2: cylinder (start, length; axis, radius).
struct Drain { low: vec4<f32>, high: vec4<f32>, begin: f32, end: f32, kind: u32, unused: u32 }
// A particle to be born. x.w: when (s since the frame began); v.w: number of the fluid, negative less one inside a hose.
struct Birth { x: vec4<f32>, v: vec4<f32>, room: vec4<u32> }
// What holds a fluid particle inside a hose: force (N), and impulse for what implicit pressure had done already (N s).
struct Hold { force: vec4<f32>, impulse: vec4<f32> }

struct Constants {
  lower: vec4<f32>,       // where particles may be (m); w: spacing (m)
  upper: vec4<f32>,       // w: radius of the support H (m)
  origin: vec4<f32>,      // lower corner of the first cell (m); w: 1/H
  per_cell: vec4<f32>,    // cells per metre; w: rest volume (m^d)
  period: vec4<f32>,      // length of periodic axes (m), 0 for others; w: contact diameter (m)
  gravity: vec4<f32>,     // without shaking (m/s^2); w: speed of sound (m/s)
  corner: vec4<f32>,      // where potential energy is zero (m); w: neighbours of a full support
  far_corner: vec4<f32>,  // the other end of the domain (m); w: longest step of implicit pressure (s)
  kernel: vec4<f32>,      // factors of W, of G; W at one spacing, W at no distance
  tune: vec4<f32>,        // factor of the Laplacian; softening (m^2); XSPH; shifting
  contact: vec4<f32>,     // square of the rate (1/s^2) that makes springs of masses; vorticity times spacing (m); unused;
                          // pressure up to which gravity fades out between fluids and bodies (Pa)
  step: vec4<f32>,        // courant, courant_force (implicit pressure: way of a step (m), factor of `pressed`), bound that does not
                          // change (s), stated dt (s) or 0
  rounds: vec4<f32>,      // implicit pressure: tolerances of places and of velocities, most rounds, dt of contacts (s)
  relax: vec4<f32>,       // the same: Jacobi's factor, compliance (s^2/m^2), most compression that velocities keep on the whole (1/s^2),
                          // least response of a density to its own share, times rho_0 (1/m^2)
  cells: vec4<u32>,       // cells on each axis; w: their number
  count: vec4<u32>,       // capacity of fluids, slots of rigid bodies, slots of all bodies, bodies
  more: vec4<u32>,        // parts of bodies, blocks of the scan, groups of the ledger, axes that are open (bits)
  movers: vec4<u32>,      // bodies that have rigid slots; neighbours that a list has room for; w: 0, which no compiler knows
  fluids: array<Fluid, FLUIDS>,
  fields: array<Field, FIELDS>,
  hoses: array<Hose, HOSES>,
  drains: array<Drain, DRAINS>,
  joined: array<vec4<u32>, JOINED>,     // pairs of bodies that a joint holds together, so that they pass through each other
}

// As `state::Record`: place and volume, velocity and pressure share.
struct Record { x: vec4<f32>, v: vec4<f32> }

// A particle after its drift, before the sort. push: acceleration and D of fluids, (0, 0, 0, 1/mass of its body) of bodies' particles.
// rate: rates of density one and two steps ago, and when the particle was born (s).
struct Drifted { x: vec4<f32>, v: vec4<f32>, push: vec4<f32>, rate: vec4<f32>, id: u32, owner: u32, unused: vec2<u32> }

struct Body {
  x: vec4<f32>,           // centre of mass (m); w: 1/mass as forces feel it, 0 if they do not move it
  x_low: vec4<f32>,       // what rounding left over of both
  q: vec4<f32>,           // orientation
  v: vec4<f32>,
  omega: vec4<f32>,
  acceleration: vec4<f32>,            // of scripts, else 0
  angular_acceleration: vec4<f32>,
  q_low: vec4<f32>,       // what rounding left over of q, and of omega
  omega_low: vec4<f32>,
  p: Wide,                // momentum: sums of what bodies exchange cancel to the last bit; w: mass (kg), 0 if forces do not move it
  p_half: Wide,
  l: Wide,
  l_half: Wide,
  inertia_x: Wide,        // columns of the inverse inertia in the body's axes
  inertia_y: Wide,
  inertia_z: Wide,
  force: vec4<f32>,       // w: contacts that share its load
  torque: vec4<f32>,
  force_fluid: vec4<f32>,
  force_contact: vec4<f32>,
  torque_fluid: vec4<f32>,
  torque_contact: vec4<f32>,
  law: vec4<f32>,         // ln of restitution, shared_by, face, friction
  stated: vec4<f32>,      // stiffness (or 0), damping (or negative), mass of a particle, 1 if one-way
  shape: vec4<f32>,       // radius about the centre of mass (m), how long it has been still (s), 1 if a joint holds it
  counts: vec4<u32>,      // contacts, what it is (bits, below), first part, parts
}

struct Slot { offset: vec4<f32>, normal: vec4<f32>, facing: vec4<f32>, owner: u32, place: u32, part: u32, unused: u32 }

// Of what the force on a body's particle consists.
struct Touch { fluid: vec4<f32>, contact: vec4<f32>, couple: vec4<f32> }

// Slips of the contacts of a slot, as bits; w: slot of the other, GONE behind the last.
struct Slips { held: array<vec4<u32>, 8> }

// Bits of `Body.counts.y`: some pair is so deep that it would pass through; newly so; it sleeps; something restless touches it.
const NEAR_THROUGH: u32 = 1u;
const NEWLY: u32 = 2u;
const ASLEEP: u32 = 4u;
const STIRRED: u32 = 8u;

// Sums over a part of a body; w: contacts, sharers, deep, stirred.
struct PartSum { force: vec4<f32>, fluid: vec4<f32>, contact: vec4<f32>, torque: vec4<f32>, torque_fluid: vec4<f32>, torque_contact: vec4<f32> }
// Slots of one body among the 128 that a workgroup sums.
struct Part { body: u32, first: u32, end: u32, unused: u32 }

// Time, and what the last step left behind for this one.
struct Clock {
  dt: f32, dt_before: f32, left: f32, drag: f32,
  gravity: vec4<f32>,      // now, shaking included; w: what rounding left over of `left`
  fastest: f32,            // largest speed of any particle
  running: u32,            // 0 once the frame is over: kernels then do nothing
  step: u32,               // steps of this frame so far
  live: u32,               // fluid particles before the sort
  bound: u32, own: u32,    // own: 1 where kernels choose dt, 0 where the host has
  time: f32, elapsed: f32, // when the frame began (s), and how long ago that was
  births: u32, born: u32,  // births behind us in the list, and particles ever born from it
  listed: u32, next_id: u32,
  crossed: vec4<f32>,      // momentum of what was born in this step
  part: f32, parts: u32,   // bodies make a step in so many parts, of such a length (s): one, unless pressure is implicit
  at: u32, most_parts: u32,// the part they are in, and how many can be queued
  mid: u32,                // 1 in parts before the last
  idle: u32,               // 1 once there is no such part any more: their kernels then do nothing
  halted: u32,             // 1 + the number of the solve that needs more rounds than were queued, else 0
  stray: f32,              // how far particles of bodies have gone since they were sorted (m)
  rounds: vec4<u32>,       // most rounds of each solve of a step in this frame
  joint_impulse: vec4<f32>,// of this step on bodies by joints to what does not move
  joint_force: vec4<f32>,  // the same of springs (N)
}

// How far implicit pressure is (E9): see interact/implicit.wgsl.
struct Solve {
  omega: f32,              // Jacobi's factor
  since: f32,              // rounds since the acceleration began
  best: f32,
  small: u32,              // 1 if the last round left little
  residual: f32, iterations: u32, phase: u32, number: u32,
  said: vec4<f32>,         // rounds and residual of places, of velocities
  turn: u32, stray: atomic<u32>,
  due: u32,                // 1 if the coarse level follows on this round
  smoothed: f32,           // residual at its last solve
  low: array<atomic<i32>, 3>,   // the cells that fluids occupy
  high: array<atomic<i32>, 3>,
  occupied: atomic<u32>,   // elements that hold particles
}
// What implicit pressure does to a body, and what it got from outside in this step. thrust: by the shares of a round; push: the
// accelerations by it; steady: by fluids, as it stands for all parts of a step; added: what is in the force besides what was summed.
struct Swept {
  thrust: vec4<f32>, twist: vec4<f32>, push: vec4<f32>, spin: vec4<f32>, steady: vec4<f32>, steady_torque: vec4<f32>,
  added: vec4<f32>, added_torque: vec4<f32>, outside: vec4<f32>, impulse: vec4<f32>,
}

// A body under the coarse level: the nodes it may reach; w of size: in the list of those that feel something, who stands at this place.
struct Giving {
  low: vec4<i32>, size: vec4<i32>,
  turn_x: vec4<f32>,       // columns of the inverse inertia, times what motions count in rates; w: inverse mass, alike
  turn_y: vec4<f32>,       // w: radius (m)
  turn_z: vec4<f32>,       // w: 1 if fluids move it
  moved: vec4<f32>, turned: vec4<f32>,
  largest: atomic<u32>,    // largest force on one of its particles (N, as bits)
  first: u32,              // where its nodes begin in `reach`
}

// What a step leaves behind, as `ledger::Ledger`.
struct Sums {
  step: vec4<f32>,         // dt, bound (as bits), largest speed, largest acceleration
  energy: vec4<f32>,       // kinetic, potential, sum of |force|, largest speed of a body's particle
  energy_low: vec4<f32>,   // what rounding left over of the sums in it
  momentum: vec4<f32>,     // w: sum of |p|
  outer: vec4<f32>,     // w: sum of density errors
  total: vec4<f32>,        // w: largest density error
  crossed: vec4<f32>,      // w: sum of neighbours
  count: vec4<u32>,        // fluid alive, left, lost, not finite
  more: vec4<u32>,         // drained, rigid lost, with full support, fast contacts
  impulse: vec4<f32>,      // from outside, besides what `outer` gives in time; w: particles put back
  fluids: vec4<f32>,       // the part of `outer` that fluids have; w: sum of (p / rho)^2
  said: vec4<f32>,         // as in Solve
}

@group(0) @binding(0) var<uniform> m: Constants;
@group(0) @binding(1) var<storage, read_write> clock: Clock;
@group(0) @binding(2) var<storage, read_write> records: array<Record>;      // sorted: fluid, rigid, static
@group(0) @binding(3) var<storage, read_write> info: array<vec2<u32>>;      // sorted: id or slot, owner
@group(0) @binding(4) var<storage, read_write> push: array<vec4<f32>>;      // sorted: acceleration or force; w: D of fluids, of bodies' particles 1 if stirred
@group(0) @binding(5) var<storage, read_write> before: array<vec4<f32>>;    // acceleration a step ago
@group(0) @binding(6) var<storage, read_write> drifted: array<Drifted>;
@group(0) @binding(7) var<storage, read_write> starts: array<u32>;          // where cells begin, kind by kind
@group(0) @binding(8) var<storage, read_write> counts: array<atomic<u32>>;
@group(0) @binding(9) var<storage, read_write> order: array<u32>;
@group(0) @binding(10) var<storage, read_write> blocks: array<u32>;
@group(0) @binding(11) var<storage, read_write> bodies: array<Body>;
@group(0) @binding(12) var<storage, read_write> slots: array<Slot>;
@group(0) @binding(13) var<storage, read_write> touch: array<Touch>;        // sorted, from the first rigid particle on
@group(0) @binding(14) var<storage, read_write> mirror: array<vec4<f32>>;   // as touch
@group(0) @binding(15) var<storage, read_write> parts: array<Part>;
@group(0) @binding(16) var<storage, read_write> part_sums: array<PartSum>;
@group(0) @binding(17) var<storage, read_write> carry: array<vec4<f32>>;    // fluid
@group(0) @binding(18) var<storage, read_write> rate: array<vec4<f32>>;     // fluid: see Drifted
@group(0) @binding(19) var<storage, read_write> gradient: array<vec4<f32>>; // fluid
@group(0) @binding(20) var<storage, read_write> vorticity: array<vec4<f32>>;// fluid
@group(0) @binding(21) var<storage, read_write> sums: array<Sums>;          // groups of the ledger
@group(0) @binding(22) var<storage, read_write> history: array<Sums>;           // 0: the last step; then one a step

@group(0) @binding(23) var<storage, read_write> births: array<Birth>;
@group(0) @binding(24) var<storage, read_write> held: array<Hold>;          // what holds fluid inside hoses
@group(0) @binding(25) var<storage, read_write> agents: array<Agent>;
@group(0) @binding(26) var<storage, read_write> strewn: array<Agent>;       // before the sort
@group(0) @binding(27) var<storage, read_write> agent_starts: array<u32>;
@group(0) @binding(28) var<storage, read_write> agent_counts: array<atomic<u32>>;
@group(0) @binding(29) var<storage, read_write> agent_order: array<u32>;
@group(0) @binding(30) var<storage, read_write> agent_blocks: array<u32>;
@group(0) @binding(31) var<storage, read_write> crowd: Crowd;
@group(0) @binding(32) var<storage, read_write> slips: array<Slips>;        // by slot of rigid bodies; then as found in this step
@group(0) @binding(33) var<storage, read_write> solve: Solve;
@group(0) @binding(34) var<storage, read_write> swept: array<Swept>;
@group(0) @binding(35) var<storage, read_write> spot: array<vec4<f32>>;     // sorted: place; w: share of fluids, volume of bodies' particles
@group(0) @binding(36) var<storage, read_write> flow: array<vec4<f32>>;     // sorted: accelerations by shares, or velocities
@group(0) @binding(37) var<storage, read_write> nodes: array<Node>;         // fluid
@group(0) @binding(38) var<storage, read_write> work: array<vec4<f32>>;     // fluid: share that pushed, error, rate, sum of the shares of turns before
@group(0) @binding(39) var<storage, read_write> said: array<vec4<f32>>;     // by workgroups of 128 fluid particles
@group(0) @binding(40) var<storage, read_write> squeezed: array<vec4<f32>>; // force of shares on bodies' particles (N), as touch
@group(0) @binding(41) var<storage, read_write> joints: array<Joint>;
@group(0) @binding(42) var<storage, read_write> remains: array<f32>;        // fluid: what shares have left (compression)
@group(0) @binding(43) var<storage, read_write> elements: array<f32>;       // coarse level: what particles sum, element by element of those that hold any
@group(0) @binding(44) var<storage, read_write> rows: array<f32>;           // number by number of all nodes
@group(0) @binding(45) var<storage, read_write> lattice: array<f32>;        // vector by vector of all nodes
@group(0) @binding(46) var<storage, read_write> giving: array<Giving>;      // bodies that have rigid slots
@group(0) @binding(47) var<storage, read_write> reach: array<atomic<i32>>;  // force and torque on each by shares on nodes, in whole numbers
@group(0) @binding(48) var<storage, read_write> seats: array<u32>;          // by element: which it is of those, or GONE; then which those are
@group(0) @binding(49) var<storage, read_write> lists: array<u32>;          // row by row of all fluid: how many neighbours of each kind, then their places

// A flock: as flock::FlockConstants, and its clock. lead: place and velocity of its first agent.
struct Rule {
  lead_x: vec4<f32>, lead_v: vec4<f32>,
  goal: vec4<f32>,      // w: distance of slowing down, negative without a goal
  radii: vec4<f32>,     // separation, alignment, cohesion, the largest
  limits: vec4<f32>,    // speed, slowest, fastest, acceleration
  pull: vec4<f32>,      // weights: separation, alignment, cohesion, cruise
  drive: vec4<f32>,     // wander, its time, seek, follow
  fear: vec4<f32>,      // flee, chase, avoid, noise
  sense: vec4<f32>,     // sight, view (2 all around), rate of turning, look-ahead
  body: vec4<f32>,      // size, clearance, contact diameter, margin of solid sides
  matter: vec4<f32>,    // mass (0: none), half_area, margin of open sides, distance behind the leader
  time: vec4<f32>,      // now, until the next decision, between decisions
  kind: vec4<u32>,      // 0 Reynolds, 1 Couzin, 2 Vicsek; first agent; agents
  who: vec4<u32>,       // leader or GONE; 1 keeps to fluids, 2 flees bodies, 4 flees fluids; seed
  count: vec4<u32>,     // decisions, due, topological neighbours
  relations: vec4<u32>, // two bits a flock
}
struct Agent {
  x: vec4<f32>,         // w: id (bits)
  v: vec4<f32>,         // w: flock (bits)
  next: vec4<f32>,
  rest: vec4<f32>,
  force: vec4<f32>,
  drag: vec4<f32>,      // force of fluids; w: 1 over the mass of fluid felt
  own: vec4<f32>,       // momentum it took by itself in this step
  felt: vec4<f32>,      // velocity at which it felt what is around
}
struct Crowd {
  origin: vec4<f32>,    // of the agents' cells; w: width wished for (m), 0 for topological neighbours
  per_cell: vec4<f32>,  // w: the smallest side of a cell (m)
  cells: vec4<u32>,     // w: cells of one flock
  number: vec4<u32>,    // agents, flocks, most cells, groups of the ledger
  low: array<atomic<u32>, 4>,
  high: array<atomic<u32>, 4>,
  rules: array<Rule>,
}

const GONE: u32 = 0xffffffffu;
// Bins behind the cells of a kind: left, lost, not finite, drained or not used.
const BINS: u32 = 4u;
const DRAINED: f32 = 3.4028235e38;
const FLUID: u32 = 0u;
const RIGID: u32 = 1u;
const STATIC: u32 = 2u;

// The number of this invocation, where one dimension does not hold all workgroups.
fn number(group: vec3<u32>, groups: vec3<u32>, local: u32, size: u32) -> u32 {
  return (group.y * groups.x + group.x) * size + local;
}

fn live_fluid() -> u32 { return starts[m.cells.w]; }
fn first_static() -> u32 { return m.count.x + m.count.y; }
// The first bin of a kind.
fn bins_of(kind: u32) -> u32 { return kind * (m.cells.w + BINS); }
// End of the particles of rigid bodies inside the domain.
fn rigid_end() -> u32 { return starts[bins_of(RIGID) + m.cells.w]; }

fn finite(x: f32) -> bool { return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u; }

// A difference of places, by the shortest way on periodic axes.
fn shortest(d: f32, period: f32) -> f32 {
  let half = 0.5 * period;
  return d - select(0.0, period, d > half) + select(0.0, period, d < -half);
}
fn wrap(d: vec3<f32>) -> vec3<f32> {
  if (!PERIODIC) { return d; }
  return vec3<f32>(shortest(d.x, m.period.x), shortest(d.y, m.period.y), shortest(d.z, m.period.z));
}

// A place brought back into the domain along one periodic axis.
fn home(x: f32, lower: f32, upper: f32, period: f32) -> f32 {
  if (period == 0.0) { return x; }
  var at = x;
  if (at >= upper) { at -= period; }
  if (at < lower) {
    at += period;
    if (at >= upper) { at = lower; }
  }
  return at;
}
// What brings a place back into the domain: a period, exactly.
fn way_home(x: vec3<f32>) -> vec3<f32> {
  if (!PERIODIC) { return vec3<f32>(0.0); }
  return m.period.xyz * (vec3<f32>(x < m.lower.xyz) - vec3<f32>(x >= m.upper.xyz));
}
fn home_all(x: vec3<f32>) -> vec3<f32> {
  if (!PERIODIC) { return x; }
  return vec3<f32>(home(x.x, m.lower.x, m.upper.x, m.period.x), home(x.y, m.lower.y, m.upper.y, m.period.y),
                   home(x.z, m.lower.z, m.upper.z, m.period.z));
}

fn cell_of(x: vec3<f32>) -> vec3<i32> {
  return clamp(vec3<i32>((x - m.origin.xyz) * m.per_cell.xyz), vec3<i32>(0), vec3<i32>(m.cells.xyz) - 1);
}
fn index_of(c: vec3<i32>) -> u32 {
  return (u32(c.z) * m.cells.y + u32(c.y)) * m.cells.x + u32(c.x);
}

// Walks over the particles of one kind in the cells around a place, in the order in which they stand.
struct Walk { cell: vec3<i32>, bins: u32, run: i32, at: u32, end: u32 }

fn walk(x: vec3<f32>, kind: u32) -> Walk { return Walk(cell_of(x), bins_of(kind), -1, 0u, 0u); }

// The cell `k` (0, 1, 2) of three along an axis, or -1 where there is none. A periodic axis of fewer cells has each once.
fn along(c: i32, k: i32, cells: i32, periodic: bool) -> i32 {
  var at = c + k - 1;
  if (periodic) {
    if (cells < 3) { return select(-1, k, k < cells); }
    at = select(at, at + cells, at < 0);
    return select(at, at - cells, at >= cells);
  }
  return select(at, -1, at >= cells);
}

// Places of the particles in run `r`: three cells side by side on x, or the one across a periodic side.
fn run_of(w: Walk, r: i32) -> vec2<u32> {
  let row = r / SPLIT;
  let n = vec3<i32>(m.cells.xyz);
  let y = select(along(w.cell.y, row % 3, n.y, m.period.y > 0.0), 0, FLAT);
  let z = along(w.cell.z, select(row / 3, row, FLAT), n.z, m.period.z > 0.0);
  if (y < 0 || z < 0) { return vec2<u32>(0u); }
  var low = max(w.cell.x - 1, 0);
  var high = min(w.cell.x + 1, n.x - 1);
  if (r % SPLIT == 1) {
    if (n.x < 3) { return vec2<u32>(0u); }
    if (w.cell.x == 0) { low = n.x - 1; high = low; }
    else if (w.cell.x == n.x - 1) { low = 0; high = 0; }
    else { return vec2<u32>(0u); }
  }
  let base = w.bins + (u32(z) * m.cells.y + u32(y)) * m.cells.x;
  return vec2<u32>(starts[base + u32(low)], starts[base + u32(high) + 1u]);
}

// Steps to the next particle, `at`; false where there is none.
fn next(w: ptr<function, Walk>) -> bool {
  (*w).at += 1u;
  while ((*w).at >= (*w).end) {
    (*w).run += 1;
    if ((*w).run >= RUNS) { return false; }
    let run = run_of(*w, (*w).run);
    (*w).at = run.x;
    (*w).end = run.y;
  }
  return true;
}

// Lists of neighbours, which `density` makes of each fluid particle in the order of a walk. Where one has no room for all, they are
// walked to anew. Who has moved since is judged where it is.
struct Counted { fluids: u32, rigid: u32, standing: u32 }
const FROM_LIST: i32 = -2;   // in place of a run
fn counted(i: u32) -> Counted {
  let all = lists[i];
  return Counted(all & 0xfffu, (all >> 12u) & 0x3ffu, all >> 22u);
}
fn all_of(c: Counted) -> u32 { return c.fluids + c.rigid + c.standing; }
fn row_of(k: u32) -> u32 { return (1u + k) * m.count.x; }

// The neighbours of one kind around a fluid particle.
fn around(i: u32, x: vec3<f32>, kind: u32) -> Walk {
  let c = counted(i);
  if (all_of(c) > m.movers.y) { return walk(x, kind); }
  var first = 0u;
  var count = c.fluids;
  if (kind == RIGID) { first = c.fluids; count = c.rigid; }
  if (kind == STATIC) { first = c.fluids + c.rigid; count = c.standing; }
  return Walk(vec3<i32>(0), row_of(first) + i, FROM_LIST, 0u, row_of(first + count) + i);
}
fn next_around(w: ptr<function, Walk>) -> bool {
  if ((*w).run != FROM_LIST) { return next(w); }
  if ((*w).bins == (*w).end) { return false; }
  (*w).at = lists[(*w).bins];
  (*w).bins += m.count.x;
  return true;
}

// E30, gravity aside (m/s^2).
fn fields_at(x: vec3<f32>, v: vec3<f32>) -> vec3<f32> {
  var total = vec3<f32>(0.0);
  for (var k = 0u; k < HAS_FIELDS; k += 1u) {
    let f = m.fields[k];
    if (f.kind == 0u) { total += point_gravity(wrap(x - f.place.xyz), f.strength, f.core); }
    else if (f.kind == 1u) { total += wind(v, f.place.xyz, f.rate); }
    else { total += vortex(wrap(x - f.place.xyz), v, f.axis.xyz, f.strength, f.core, f.rate); }
  }
  if (FLAT) { total.y = 0.0; }
  return total;
}

// Sums over a workgroup of 256: of all invocations before this one, and of all.
const SCANNED: u32 = 8u;
var<workgroup> scan_sums: array<u32, 256>;
fn scan_group(l: u32, own: u32) -> vec2<u32> {
  scan_sums[l] = own;
  workgroupBarrier();
  for (var reach = 1u; reach < 256u; reach *= 2u) {
    var left = 0u;
    if (l >= reach) { left = scan_sums[l - reach]; }
    workgroupBarrier();
    scan_sums[l] += left;
    workgroupBarrier();
  }
  let result = vec2<u32>(scan_sums[l] - own, scan_sums[255]);
  workgroupBarrier();
  return result;
}

// What has been rounded, and no compiler sees through it: see wide.wgsl.
fn rounded(x: vec4<f32>) -> vec4<f32> { return bitcast<vec4<f32>>(bitcast<vec4<u32>>(x) ^ vec4<u32>(m.movers.w)); }

// A sum and what rounding left over of it (Kahan 1965).
struct Kept { sum: vec3<f32>, rest: vec3<f32> }
fn kept(sum: vec3<f32>, rest: vec3<f32>, more: vec3<f32>) -> Kept {
  let y = more - rest;
  let t = rounded(vec4<f32>(sum + y, 0.0)).xyz;
  return Kept(t, (t - sum) - y);
}

// Quaternions, the real part last.
fn turn(q: vec4<f32>, v: vec3<f32>) -> vec3<f32> {
  let t = 2.0 * cross(q.xyz, v);
  return v + q.w * t + cross(q.xyz, t);
}
fn times(a: vec4<f32>, b: vec4<f32>) -> vec4<f32> {
  return vec4<f32>(a.w * b.xyz + b.w * a.xyz + cross(a.xyz, b.xyz), a.w * b.w - dot(a.xyz, b.xyz));
}
// The turn by a vector (rad).
fn turn_by(angle: vec3<f32>) -> vec4<f32> {
  let size = length(angle);
  return vec4<f32>(angle * select(sin(0.5 * size) / size, 0.5, size < 1e-6), cos(0.5 * size));
}
