//! Rust's side of the structures of `common.wgsl`: constants from a model, bodies and slots to and from a state.

use super::program::{fields, hoses, joined};
use crate::flock::FlockConstants;
use crate::integrate::sources::DrainRegion;
use crate::interact::coarse::SIDE;
use crate::model::{DtBound, Model};
use crate::scene::joint::JointModel;
use crate::scene::{Force, Pressure, Wall};
use crate::state::{Body, Contacts, State};
use bytemuck::{Pod, Zeroable};
use glam::{DQuat, DVec3};

/// Slots that a workgroup sums: of parts of a body, or of several bodies.
pub const PART: usize = 128;
/// Cells of one block of the scan.
pub const BLOCK: u32 = 2048;
/// Bins behind the cells of a kind.
pub const BINS: u32 = 4;
/// Most flocks: two bits for each in a rule.
pub const FLOCKS: usize = 64;
/// A particle of a body that is outside the domain.
pub const GONE: u32 = u32::MAX;

type V = [f32; 4];

/// `Constants` without its arrays.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Constants {
    pub lower: V,
    pub upper: V,
    pub origin: V,
    pub per_cell: V,
    pub period: V,
    pub gravity: V,
    pub corner: V,
    pub far_corner: V,
    pub kernel: V,
    pub tune: V,
    pub contact: V,
    pub step: V,
    pub rounds: V,
    pub relax: V,
    pub cells: [u32; 4],
    pub count: [u32; 4],
    pub more: [u32; 4],
    pub movers: [u32; 4],
}

/// A particle after its drift.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Drifted {
    pub x: V,
    pub v: V,
    pub push: V,
    pub rate: V,
    pub id: u32,
    pub owner: u32,
    pub unused: [u32; 2],
}

/// Numbers of two floats, as in `wide.wgsl`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Wide {
    pub high: V,
    pub low: V,
}

impl Wide {
    /// The nearest to four numbers.
    fn of(numbers: [f64; 4]) -> Self {
        let high = numbers.map(|n| n as f32);
        Self { high, low: std::array::from_fn(|k| (numbers[k] - f64::from(high[k])) as f32) }
    }

    fn vector(v: DVec3, w: f64) -> Self {
        Self::of([v.x, v.y, v.z, w])
    }
}

/// Four numbers from what is left of them after rounding, and what rounding left over.
fn whole(high: V, low: V) -> [f64; 4] {
    std::array::from_fn(|k| f64::from(high[k]) + f64::from(low[k]))
}

/// The first three.
fn whole_vector(high: V, low: V) -> DVec3 {
    let [x, y, z, _] = whole(high, low);
    DVec3::new(x, y, z)
}

/// A body.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct GpuBody {
    pub pose: Pose,
    pub q_low: V,
    pub omega_low: V,
    pub p: Wide,
    pub p_half: Wide,
    pub l: Wide,
    pub l_half: Wide,
    pub inertia: [Wide; 3],
    pub force: V,
    pub torque: V,
    pub force_fluid: V,
    pub force_contact: V,
    pub torque_fluid: V,
    pub torque_contact: V,
    pub law: V,
    pub stated: V,
    pub shape: V,
    pub counts: [u32; 4],
}

/// What a script writes of a body: the beginning of [`GpuBody`].
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Pose {
    pub x: V,
    pub x_low: V,
    pub q: V,
    pub v: V,
    pub omega: V,
    pub acceleration: V,
    pub angular_acceleration: V,
}

/// A particle of a body.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Slot {
    pub offset: V,
    pub normal: V,
    pub facing: V,
    pub owner: u32,
    pub place: u32,
    pub part: u32,
    pub unused: u32,
}

/// Of what the force on a body's particle consists.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Touch {
    pub fluid: V,
    pub contact: V,
    pub couple: V,
}

/// Contacts whose slip one particle remembers there: those that bear most.
pub const HELD_CONTACTS: usize = 8;

/// Slips of the contacts of a slot, as bits; last the slot of the other.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Slips {
    pub held: [[u32; 4]; HELD_CONTACTS],
}

/// Time.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Clock {
    pub dt: f32,
    pub dt_before: f32,
    pub left: f32,
    pub drag: f32,
    pub gravity: V,
    pub fastest: f32,
    pub running: u32,
    pub step: u32,
    pub live: u32,
    pub bound: u32,
    pub own: u32,
    pub time: f32,
    pub elapsed: f32,
    pub births: u32,
    pub born: u32,
    pub listed: u32,
    pub next_id: u32,
    pub crossed: V,
    pub part: f32,
    pub parts: u32,
    pub at: u32,
    pub most_parts: u32,
    pub mid: u32,
    pub idle: u32,
    pub halted: u32,
    pub stray: f32,
    pub rounds: [u32; 4],
    pub joint_impulse: V,
    pub joint_force: V,
}

/// A particle to be born.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Birth {
    pub x: V,
    pub v: V,
    pub room: [u32; 4],
}

/// What a step leaves behind.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Sums {
    pub step: V,
    pub energy: V,
    pub energy_low: V,
    pub momentum: V,
    pub outer: V,
    pub total: V,
    pub crossed: V,
    pub count: [u32; 4],
    pub more: [u32; 4],
    pub impulse: V,
    pub fluids: V,
    pub said: V,
}

/// How far implicit pressure is: kernels alone read it.
pub const SOLVE_BYTES: usize = 96;
/// `Swept`.
pub const SWEPT_BYTES: usize = 160;
/// `Node`.
pub const NODE_BYTES: usize = 32;

/// `Giving`: a body under the coarse level. Kernels write all of it but where its nodes begin, at this offset.
pub const GIVING_BYTES: usize = 128;
/// See there.
pub const GIVING_FIRST: usize = 116;
/// Numbers of an element, of a node's row, vectors of nodes; what a body feels of a node.
pub const ELEMENT: usize = 44;
/// See there.
pub const ROW: usize = 27;
/// See there.
pub const VECTORS: usize = 5;
/// See there.
pub const FELT: usize = 6;
/// How far beyond its radius a body may reach nodes (spacings).
pub const BEYOND: f64 = 2.0;

/// A joint.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Joint {
    pub anchor_a: V,
    pub anchor_b: V,
    pub axis_a: V,
    pub axis_b: V,
    pub across_a: V,
    pub across_b: V,
    pub turn: V,
    pub law: V,
    pub limits: V,
    pub who: [u32; 4],
}

/// Joints, in the order of the scene.
pub fn joints(model: &Model) -> Vec<Joint> {
    let joint = |j: &JointModel| {
        let [low, high] = j.limits.unwrap_or_default();
        Joint {
            anchor_a: single(j.anchor[0], 0.0),
            anchor_b: single(j.anchor[1], 0.0),
            axis_a: single(j.axis[0], 0.0),
            axis_b: single(j.axis[1], 0.0),
            across_a: single(j.across[0], 0.0),
            across_b: single(j.across[1], 0.0),
            turn: j.turn.as_quat().to_array(),
            law: [j.stiffness, j.damping, j.length, model.largest_speed].map(|n| n as f32),
            limits: [low as f32, high as f32, f32::from(j.limits.is_some()), 0.0],
            who: [j.kind as u32, j.a as u32, j.b.map_or(GONE, |b| b as u32), 0],
        }
    };
    model.joints.iter().map(joint).collect()
}

/// Three numbers and a fourth.
pub fn with(v: impl Into<[f32; 3]>, w: f32) -> V {
    let [x, y, z] = v.into();
    [x, y, z, w]
}

/// Three numbers in single precision.
pub fn single(v: DVec3, w: f32) -> V {
    with(v.as_vec3(), w)
}

/// The first three numbers.
pub fn three(v: V) -> [f32; 3] {
    [v[0], v[1], v[2]]
}

/// The first three numbers in double precision.
pub fn double(v: V) -> DVec3 {
    DVec3::from(three(v).map(f64::from))
}

/// Sizes that the constants also hold.
#[derive(Clone, Copy, Debug)]
pub struct Sizes {
    /// Places for fluid particles.
    pub fluids: u32,
    /// Slots of rigid bodies.
    pub rigid: u32,
    /// Slots of all bodies.
    pub slots: u32,
    /// Slots that remember slips: those of rigid bodies, where any rubs.
    pub slipping: u32,
    /// Bodies.
    pub bodies: u32,
    /// Those that have rigid slots: they move, or follow scripts.
    pub movers: u32,
    /// Parts of bodies.
    pub parts: u32,
    /// Cells of the grid.
    pub cells: u32,
    /// Groups of the ledger.
    pub groups: u32,
    /// Agents.
    pub agents: u32,
    /// Most cells of agents, all flocks together.
    pub agent_cells: u32,
    /// Most elements of the coarse level, of those that hold particles, and nodes.
    pub elements: u32,
    /// See there.
    pub occupied: u32,
    /// See there.
    pub nodes: u32,
    /// Neighbours that the list of a fluid particle has room for.
    pub room: u32,
}

impl Sizes {
    /// Bins of fluids and rigid particles.
    pub fn bins(self) -> u32 {
        2 * (self.cells + BINS)
    }

    /// Blocks of the scan over the bins.
    pub fn blocks(self) -> u32 {
        self.bins().div_ceil(BLOCK)
    }
}

/// The constants of a scene as bytes of the uniform buffer.
pub fn constants(model: &Model, sizes: Sizes) -> Vec<u8> {
    let (s, g, f) = (&model.solver, &model.grid, &model.factors);
    let rate = model.largest_speed / (s.contact_overlap * model.spacing);
    let open = (0..3).filter(|&a| g.walls[a] == Wall::Open).map(|a| 1 << a).sum();
    let (contact, others): (Vec<_>, Vec<_>) =
        model.dt_bounds.iter().partition(|b| model.implicit() && b.0 == DtBound::Contact);
    let least = |bounds: &[&(DtBound, f64)]| bounds.iter().map(|b| b.1).fold(f64::from(f32::MAX), f64::min) as f32;
    let steps = if model.implicit() { model.bounds_of_flow() } else { [s.courant, s.courant_force] };
    let [x, y, z] = g.cells.map(|c| c as u32);
    let base = Constants {
        lower: with(g.lower, model.spacing as f32),
        upper: with(g.upper, model.support as f32),
        origin: with(g.origin, model.inverse_support()),
        per_cell: with(g.inverse, model.volume as f32),
        period: with(g.period, model.contact_diameter as f32),
        gravity: single(model.gravity, model.sound_speed as f32),
        corner: single(g.min, model.full_support as f32),
        far_corner: single(g.max, model.longest_step() as f32),
        kernel: [f.w, f.g, f.w_spacing, f.w_own],
        tune: [f.laplacian, model.softening(), s.xsph as f32, s.shifting as f32],
        contact: [(rate * rate) as f32, (s.vorticity * model.spacing) as f32, 0.0, model.hold_limit()],
        step: [steps[0] as f32, steps[1] as f32, least(&others), s.dt.unwrap_or(0.0) as f32],
        rounds: [
            model.tolerance() as f32,
            s.divergence_tolerance as f32,
            model.solver.iterations as f32,
            least(&contact),
        ],
        relax: [
            f.relaxation,
            if s.pressure == Pressure::Pbf { model.compliance() as f32 } else { 0.0 },
            model.unheld().min(1e30) as f32,
            model.least_response(),
        ],
        cells: [x, y, z, sizes.cells],
        count: [sizes.fluids, sizes.rigid, sizes.slots, sizes.bodies],
        more: [sizes.parts, sizes.blocks(), sizes.groups, open],
        movers: [sizes.movers, sizes.room, 0, 0],
    };
    let mut bytes = bytemuck::bytes_of(&base).to_vec();
    for f in &model.fluids {
        let numbers = [f.density, f.mass, f.viscosity, f.stiffness, f.artificial, f.cohesion, f.curvature, f.diffusion];
        bytes.extend(bytemuck::bytes_of(&numbers));
        bytes.extend(bytemuck::bytes_of(&[f.lifetime.min(f64::from(f32::MAX)) as f32, 0.0, 0.0, 0.0]));
    }
    if model.fluids.is_empty() {
        bytes.extend([0; 48]);
    }
    let mut any = false;
    for field in fields(model) {
        any = true;
        let (place, axis, kind, numbers) = match *field {
            Force::Point { center, strength, core } => (center, [0.0; 3], 0u32, [strength, core, 0.0]),
            Force::Wind { velocity, rate } => (velocity, [0.0; 3], 1, [0.0, 0.0, rate]),
            Force::Vortex { center, axis, speed, core, rate } => {
                (center, DVec3::from(axis).normalize_or_zero().to_array(), 2, [speed, core, rate])
            }
            Force::Shake(_) => continue,
        };
        bytes.extend(bytemuck::bytes_of(&single(place.into(), 0.0)));
        bytes.extend(bytemuck::bytes_of(&single(axis.into(), 0.0)));
        bytes.extend(kind.to_ne_bytes());
        bytes.extend(bytemuck::bytes_of(&numbers.map(|n| n as f32)));
    }
    if !any {
        bytes.extend([0; 48]);
    }
    for (bore, velocity, fluid) in hoses(model) {
        bytes.extend(bytemuck::bytes_of(&single(bore.start, bore.length as f32)));
        bytes.extend(bytemuck::bytes_of(&single(bore.axis, bore.radius as f32)));
        bytes.extend(bytemuck::bytes_of(&single(velocity, fluid as f32)));
    }
    if hoses(model).next().is_none() {
        bytes.extend([0; 48]);
    }
    for drain in &model.drains {
        let (low, high, kind) = match drain.region {
            DrainRegion::Box { min, max } => (single(min, 0.0), single(max, 0.0), 0u32),
            DrainRegion::Ball { center, radius } => (single(center, radius as f32), [0.0; 4], 1),
            DrainRegion::Cylinder(b) => (single(b.start, b.length as f32), single(b.axis, b.radius as f32), 2),
        };
        bytes.extend(bytemuck::bytes_of(&[low, high]));
        bytes.extend(bytemuck::bytes_of(&drain.span.map(|t| t.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32)));
        bytes.extend(bytemuck::bytes_of(&[kind, 0]));
    }
    if model.drains.is_empty() {
        bytes.extend([0; 48]);
    }
    for [a, b] in joined(model) {
        bytes.extend(bytemuck::bytes_of(&[a, b, 0, 0]));
    }
    if joined(model).next().is_none() {
        bytes.extend([0; 16]);
    }
    bytes
}

/// Neighbours that lists have room for, half as many more than a full support holds; none where the device cannot hold as many as that.
pub fn room(model: &Model, fluids: u32, most_bytes: u64) -> u32 {
    let rows = most_bytes / (4 * u64::from(fluids.max(1)));
    let room = (1.5 * model.full_support) as u64 + 8;
    if rows > model.full_support as u64 { room.min(rows - 1) as u32 } else { 0 }
}

/// Most elements and nodes of the coarse level: those over the whole domain.
pub fn lattice(model: &Model) -> [u64; 2] {
    let cells = model.grid.cells;
    let elements = |a: usize| (cells[a] as u64).div_ceil(SIDE as u64);
    [(0..3).map(elements).product(), (0..3).map(|a| elements(a) + u64::from(cells[a] > 1)).product()]
}

/// Where the nodes begin that each moving body may reach, and at last their number: those of a box around it; on periodic axes all.
pub fn reaches(model: &Model, state: &State, movers: u32) -> Vec<u64> {
    let grid = &model.grid;
    let nodes = |body: &Body| {
        let far = radius(state, body) + BEYOND * model.spacing;
        let along = |a: usize| {
            let all = (grid.cells[a] as u64).div_ceil(SIDE as u64) + u64::from(grid.cells[a] > 1);
            let spans = (2.0 * far * f64::from(grid.inverse[a]) / f64::from(SIDE) + 0.001) as u64;
            if grid.period[a] > 0.0 { all } else { all.min(spans + 3) }
        };
        (0..3).map(along).product::<u64>()
    };
    let mut first = vec![0];
    for body in &state.bodies.body[..movers as usize] {
        first.push(first[first.len() - 1] + nodes(body));
    }
    first
}

/// How far the farthest particle of a body is from its centre of mass (m).
fn radius(state: &State, body: &Body) -> f64 {
    state.bodies.offset[body.slots.clone()].iter().map(|o| o.length()).fold(0.0, f64::max)
}

/// The pose of a body.
pub fn pose(body: &Body) -> Pose {
    let x = Wide::vector(body.x, if body.is_static() { 0.0 } else { 1.0 / body.mass });
    Pose {
        x: x.high,
        x_low: x.low,
        q: body.q.as_quat().to_array(),
        v: single(body.v, 0.0),
        omega: single(body.omega, 0.0),
        acceleration: single(body.acceleration, 0.0),
        angular_acceleration: single(body.angular_acceleration, 0.0),
    }
}

/// Bodies with the parts that `first` and `count` tell.
pub fn bodies(model: &Model, state: &State, parts: &[[u32; 4]]) -> Vec<GpuBody> {
    let body = |(k, b): (usize, &Body)| {
        let c = &model.contacts[k];
        let inertia = b.inverse_inertia;
        let first = parts.partition_point(|p| (p[1] as usize) < b.slots.start);
        let count = parts[first..].iter().take_while(|p| p[0] == k as u32).count();
        let radius = radius(state, b);
        let mass = if b.is_static() { 0.0 } else { b.mass };
        let particle = if b.is_static() { 0.0 } else { b.mass / b.slots.len().max(1) as f64 };
        GpuBody {
            pose: pose(b),
            q_low: Wide::of(b.q.to_array()).low,
            omega_low: Wide::vector(b.omega, 0.0).low,
            p: Wide::vector(mass * b.v, mass),
            p_half: Wide::vector(mass * b.v_half, mass),
            l: Wide::vector(b.l, 0.0),
            l_half: Wide::vector(b.l_half, 0.0),
            inertia: [inertia.x_axis, inertia.y_axis, inertia.z_axis].map(|column| Wide::vector(column, 0.0)),
            force: single(b.force, b.sharers),
            torque: single(b.torque, 0.0),
            force_fluid: single(b.force_fluid, 0.0),
            force_contact: single(b.force_contact, 0.0),
            torque_fluid: single(b.torque_fluid, 0.0),
            torque_contact: single(b.torque_contact, 0.0),
            law: [c.ln_restitution, c.shared_by, c.face, c.friction],
            stated: [c.stiffness, c.damping, particle as f32, f32::from(b.one_way)],
            shape: [radius as f32, b.still as f32, f32::from(c.jointed), 0.0],
            counts: [b.contacts, u32::from(b.deep) | u32::from(b.asleep) << 2, first as u32, count as u32],
        }
    };
    state.bodies.body.iter().enumerate().map(body).collect()
}

/// Brings a body home.
pub fn to_body(from: &GpuBody, body: &mut Body) {
    let p = &from.pose;
    if !body.is_static() {
        body.x = whole_vector(p.x, p.x_low);
        body.q = DQuat::from_array(whole(p.q, from.q_low));
        body.v = whole_vector(from.p.high, from.p.low) / body.mass;
        body.v_half = whole_vector(from.p_half.high, from.p_half.low) / body.mass;
        body.l = whole_vector(from.l.high, from.l.low);
        body.l_half = whole_vector(from.l_half.high, from.l_half.low);
        body.omega = whole_vector(p.omega, from.omega_low);
        body.sharers = from.force[3];
        (body.still, body.asleep) = (f64::from(from.shape[1]), from.counts[1] & 4 != 0);
    }
    (body.force, body.torque) = (double(from.force), double(from.torque));
    (body.force_fluid, body.force_contact) = (double(from.force_fluid), double(from.force_contact));
    (body.torque_fluid, body.torque_contact) = (double(from.torque_fluid), double(from.torque_contact));
    body.contacts = from.counts[0];
    body.deep = from.counts[1] & 1 != 0;
}

/// Parts of bodies, in the order of slots: body, first slot, end; cut where a workgroup ends.
pub fn parts(state: &State) -> Vec<[u32; 4]> {
    let cut = |(body, b): (usize, &Body)| {
        let slots = b.slots.clone();
        let groups = slots.start / PART..slots.end.div_ceil(PART);
        groups.map(move |g| [body, slots.start.max(g * PART), slots.end.min((g + 1) * PART), 0].map(|n| n as u32))
    };
    state.bodies.body.iter().enumerate().filter(|(_, b)| !b.slots.is_empty()).flat_map(cut).collect()
}

/// Slots; `place` of each, where it is known.
pub fn slots(state: &State, parts: &[[u32; 4]], place: impl Fn(usize) -> u32) -> Vec<Slot> {
    let b = &state.bodies;
    let part = |s: usize| parts.partition_point(|p| p[2] as usize <= s) as u32;
    let slot = |s: usize| Slot {
        offset: single(b.offset[s], b.record[s].volume),
        normal: with(b.normal[s], 0.0),
        facing: with(b.facing[s], 0.0),
        owner: b.owner[s],
        place: place(s),
        part: part(s),
        unused: 0,
    };
    (0..b.offset.len()).map(slot).collect()
}

/// An agent.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Agent {
    pub x: V,
    pub v: V,
    pub next: V,
    pub rest: V,
    pub force: V,
    pub drag: V,
    pub own: V,
    pub felt: V,
}

/// A flock: as [`FlockConstants`], and its clock.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Rule {
    pub lead_x: V,
    pub lead_v: V,
    pub goal: V,
    pub radii: V,
    pub limits: V,
    pub pull: V,
    pub drive: V,
    pub fear: V,
    pub sense: V,
    pub body: V,
    pub matter: V,
    pub time: V,
    pub kind: [u32; 4],
    pub who: [u32; 4],
    pub count: [u32; 4],
    pub relations: [u32; 4],
}

/// `Crowd` without its rules.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Crowd {
    pub origin: V,
    pub per_cell: V,
    pub cells: [u32; 4],
    pub number: [u32; 4],
    pub low: [u32; 4],
    pub high: [u32; 4],
}

/// Agents, flock by flock.
pub fn agents(model: &Model, state: &State) -> Vec<Agent> {
    let a = &state.agents;
    let agent = |(f, i): (u32, usize)| Agent {
        x: with(a.record[i].x, f32::from_bits(a.id[i])),
        v: with(a.record[i].v, f32::from_bits(f)),
        next: with(a.next[i], 0.0),
        rest: with(a.rest[i], 0.0),
        force: with(a.force.get(i).copied().unwrap_or_default(), 0.0),
        ..Agent::default()
    };
    let all = model.flocks.iter().enumerate().flat_map(|(f, flock)| flock.range().map(move |i| (f as u32, i)));
    all.map(agent).collect()
}

/// Brings agents home.
pub fn to_agents(from: &[Agent], rules: &[Rule], state: &mut State) {
    let to = &mut state.agents;
    for (i, a) in from.iter().enumerate() {
        to.id[i] = a.x[3].to_bits();
        (to.record[i].x, to.record[i].v) = (three(a.x), three(a.v));
        (to.next[i], to.rest[i]) = (three(a.next), three(a.rest));
        if let Some(force) = to.force.get_mut(i) {
            *force = three(a.force);
        }
    }
    for (clock, rule) in to.clock.iter_mut().zip(rules) {
        clock.time = f64::from(rule.time[0]);
        clock.wait = f64::from(rule.time[1]);
        clock.decisions = u64::from(rule.count[0]);
    }
}

/// What is known of the crowd, and the rules of its flocks.
pub fn crowd(model: &Model, state: &State, sizes: Sizes) -> Vec<u8> {
    let largest = model.flocks.iter().max_by_key(|f| f.count);
    let width = largest.filter(|f| f.neighbours == 0).map_or(0.0, |f| 1.0001 * f.radius);
    let flocks = model.flocks.len() as u32;
    let groups = sizes.agents.div_ceil(128);
    let head = Crowd {
        origin: [0.0, 0.0, 0.0, width],
        number: [sizes.agents, flocks, sizes.agent_cells / flocks.max(1), groups],
        ..Crowd::default()
    };
    let mut bytes = bytemuck::bytes_of(&head).to_vec();
    for (f, clock) in model.flocks.iter().zip(&state.agents.clock) {
        bytes.extend(bytemuck::bytes_of(&rule(model, f, clock)));
    }
    bytes
}

fn rule(model: &Model, f: &FlockConstants, clock: &crate::state::Clock) -> Rule {
    let (u, w) = (&f.limits, &f.weights);
    let mut relations = [0; 4];
    for (k, relation) in f.relations.iter().enumerate().take(FLOCKS) {
        relations[k / 16] |= (*relation as u32) << (2 * (k % 16));
    }
    let flags = u32::from(f.keep_to_fluids) | u32::from(f.flee_bodies) << 1 | u32::from(f.flee_fluids) << 2;
    let matter = f.matter.map_or([0.0; 2], |m| [m.mass, m.half_area]);
    Rule {
        goal: f.goal.map_or([0.0, 0.0, 0.0, -1.0], |(goal, slow)| with(goal, slow)),
        radii: [f.separation_radius, f.alignment_radius, f.cohesion_radius, f.radius],
        limits: [u.speed, u.slowest, u.fastest, u.acceleration],
        pull: [w.separation, w.alignment, w.cohesion, w.cruise],
        drive: [w.wander, w.wander_time as f32, w.seek, w.follow],
        fear: [w.flee, w.chase, w.avoid, f.noise as f32],
        sense: [f.sight, f.view.unwrap_or(2.0), u.turn.min(1e30) as f32, f.look_ahead],
        body: [
            f.size,
            f.clearance(model.spacing as f32),
            f.contact(model.spacing, model.solver.contact_overlap) as f32,
            f.margin[0],
        ],
        matter: [matter[0], matter[1], f.margin[1], f.leader.map_or(0.0, |l| l.1)],
        time: [clock.time as f32, clock.wait as f32, f.tau as f32, 0.0],
        kind: [f.model as u32, f.first as u32, f.count as u32, 0],
        who: [f.leader.map_or(GONE, |l| l.0 as u32), flags, f.seed as u32, (f.seed >> 32) as u32],
        count: [clock.decisions as u32, 0, f.neighbours as u32, 0],
        relations,
        ..Rule::default()
    }
}

/// As in `state::Touch`; the forces of contacts, those of agents among them, are part of all forces there.
pub fn to_touch(from: &Touch) -> crate::state::Touch {
    crate::state::Touch { fluid: three(from.fluid), agents: [0.0; 3] }
}

/// Slips of contacts there, by rigid slot: where a slot has more than there is room for, those that have slipped farthest.
pub fn slips(from: &Contacts, slots: usize) -> Vec<Slips> {
    let mut held = vec![Vec::new(); slots];
    for ([own, other], slip) in from.slipped() {
        held.get_mut(own as usize).into_iter().for_each(|held: &mut Vec<_>| held.push((slip, other)));
    }
    let size = |slip: [f32; 3]| slip.iter().map(|x| x * x).sum::<f32>();
    let slips = |mut of: Vec<([f32; 3], u32)>| {
        of.sort_by(|a, b| size(b.0).total_cmp(&size(a.0)));
        let mut slips = Slips { held: [[0, 0, 0, GONE]; HELD_CONTACTS] };
        for (to, (slip, with)) in slips.held.iter_mut().zip(of) {
            let [x, y, z] = slip.map(f32::to_bits);
            *to = [x, y, z, with];
        }
        slips
    };
    held.into_iter().map(slips).collect()
}

/// Slips of contacts home.
pub fn to_contacts(from: &[Slips]) -> Contacts {
    let of = |(own, slips): (usize, &Slips)| {
        let held = slips.held.into_iter().take_while(|held| held[3] != GONE);
        held.map(move |[x, y, z, with]| ([own as u32, with], [x, y, z].map(f32::from_bits)))
    };
    Contacts::new(from.len(), from.iter().enumerate().flat_map(of))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::gpu::program;
    use std::mem::{offset_of, size_of};
    use wgpu::naga::{Module, TypeInner};

    fn layout(module: &Module, name: &str) -> (Vec<(String, u32)>, u32) {
        let found = module.types.iter().find(|(_, t)| t.name.as_deref() == Some(name));
        let Some((_, naga_type)) = found else { panic!("{name} is not in the text") };
        let TypeInner::Struct { members, span } = &naga_type.inner else { panic!("{name} is no structure") };
        (members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset)).collect(), *span)
    }

    /// Both sides put every number in the same place, as naga tells.
    #[test]
    fn both_sides_agree_on_offsets() {
        let text = "[domain]\nmin = [0, 0, 0]\nmax = [1, 1, 1]\n[resolution]\nspacing = 0.1\n\
                    [[fluid]]\nshape = { box = { min = [0, 0, 0], max = [0.5, 0.5, 0.5] } }\n";
        let scene = crate::Scene::parse(crate::scene::Source { text: text.into(), ..Default::default() }, &[])
            .unwrap_or_else(|e| panic!("{e}"));
        let model = scene.assemble().unwrap_or_else(|e| panic!("{e}")).model;
        let (module, _) = program::parsed(&program::text(&model)).unwrap_or_else(|e| panic!("{e}"));
        macro_rules! same {
            ($wgsl:literal, $rust:ty, $($field:ident),*) => {{
                let (members, span) = layout(&module, $wgsl);
                $(
                    let there = members.iter().find(|m| m.0 == stringify!($field)).map(|m| m.1);
                    assert_eq!(there, Some(offset_of!($rust, $field) as u32), "{}.{}", $wgsl, stringify!($field));
                )*
                assert_eq!(span as usize, size_of::<$rust>(), "{}", $wgsl);
            }};
        }
        same!("Wide", Wide, high, low);
        same!("Drifted", Drifted, x, v, push, rate, id, owner);
        same!("Birth", Birth, x, v, room);
        same!("Slot", Slot, offset, normal, facing, owner, place, part);
        same!("Touch", Touch, fluid, contact, couple);
        same!("Slips", Slips, held);
        same!(
            "Clock",
            Clock,
            dt,
            dt_before,
            left,
            drag,
            gravity,
            fastest,
            running,
            step,
            live,
            bound,
            own,
            time,
            elapsed,
            births,
            born,
            listed,
            next_id,
            crossed,
            part,
            parts,
            at,
            most_parts,
            mid,
            idle,
            halted,
            stray,
            rounds,
            joint_impulse,
            joint_force
        );
        same!("Joint", Joint, anchor_a, anchor_b, axis_a, axis_b, across_a, across_b, turn, law, limits, who);
        for (name, bytes) in
            [("Solve", SOLVE_BYTES), ("Swept", SWEPT_BYTES), ("Node", NODE_BYTES), ("Giving", GIVING_BYTES)]
        {
            assert_eq!(layout(&module, name).1 as usize, bytes, "{name}");
        }
        same!(
            "Sums", Sums, step, energy, energy_low, momentum, outer, total, crossed, count, more, impulse, fluids, said
        );
        same!("Agent", Agent, x, v, next, rest, force, drag, own, felt);
        same!(
            "Rule", Rule, lead_x, lead_v, goal, radii, limits, pull, drive, fear, sense, body, matter, time, kind, who,
            count, relations
        );
        same!(
            "Body",
            GpuBody,
            q_low,
            omega_low,
            p,
            p_half,
            l,
            l_half,
            force,
            torque,
            force_fluid,
            force_contact,
            torque_fluid,
            torque_contact,
            law,
            stated,
            shape,
            counts
        );
        let (giving, _) = layout(&module, "Giving");
        assert!(giving.contains(&("first".into(), GIVING_FIRST as u32)));
        let (body, _) = layout(&module, "Body");
        let at = |name: &str| body.iter().find(|m| m.0 == name).map(|m| m.1 as usize);
        assert_eq!(at("angular_acceleration"), Some(offset_of!(Pose, angular_acceleration)));
        assert_eq!(at("inertia_x"), Some(offset_of!(GpuBody, inertia)));
        let (constants, _) = layout(&module, "Constants");
        let at = |name: &str| constants.iter().find(|m| m.0 == name).map(|m| m.1 as usize);
        assert_eq!(at("step"), Some(offset_of!(Constants, step)));
        assert_eq!(at("more"), Some(offset_of!(Constants, more)));
        assert_eq!(at("fluids"), Some(size_of::<Constants>()));
    }
}
