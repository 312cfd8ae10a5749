//! Buffers of a world on the device, and the ways of a state there and back.

use super::layout::{
    self, Agent, BINS, BLOCK, Birth, Crowd, Drifted, ELEMENT, FELT, GIVING_BYTES, GIVING_FIRST, GONE, GpuBody, Joint,
    NODE_BYTES, ROW, Rule, SOLVE_BYTES, SWEPT_BYTES, Sizes, Slot, Sums, Touch, VECTORS, three, with,
};
use super::program::{hoses, mortal};
use crate::gpu::{Gpu, GpuError};
use crate::interact::cells::Grid;
use crate::model::Model;
use crate::scene::Density;
use crate::state::{Kind, Record, State};
use bytemuck::Pod;
use std::mem::size_of;
use std::time::Duration;

/// How long a callback may keep us waiting after the device is done.
const PATIENCE: Duration = Duration::from_secs(10);
/// Groups of the ledger at most.
const GROUPS: u32 = 256;

/// All buffers, by the number of their binding in `common.wgsl`.
pub struct Buffers {
    pub all: Vec<wgpu::Buffer>,
}

/// Static particles sorted by cell: slots in their order, and where cells begin.
struct Walls {
    slots: Vec<usize>,
    starts: Vec<u32>,
    place: Vec<u32>,
}

impl Walls {
    fn sort(grid: &Grid, state: &State, first: u32, cells: u32) -> Self {
        let b = &state.bodies;
        let n = b.record.len() - b.rigid_slots;
        let key = |slot: usize| {
            let x = b.record[slot].x;
            let inside = (0..3).all(|a| x[a] >= grid.lower[a] && x[a] <= grid.upper[a]);
            if !inside {
                return cells;
            }
            let [x, y, z] = grid.coordinates(x).map(|c| c as u32);
            (z * grid.cells[1] as u32 + y) * grid.cells[0] as u32 + x
        };
        let mut keyed: Vec<(u32, usize)> = (0..n).map(|k| (key(b.rigid_slots + k), b.rigid_slots + k)).collect();
        keyed.sort_unstable();
        let mut starts = vec![0; (cells + BINS) as usize];
        for (key, _) in &keyed {
            starts[*key as usize] += 1;
        }
        let mut at = first;
        for start in &mut starts {
            at += std::mem::replace(start, at);
        }
        let mut place = vec![GONE; n];
        for (k, (key, slot)) in keyed.iter().enumerate() {
            if *key < cells {
                place[slot - b.rigid_slots] = first + k as u32;
            }
        }
        Self { slots: keyed.into_iter().map(|(_, slot)| slot).collect(), starts, place }
    }
}

impl Buffers {
    /// Makes the buffers of a world and fills them.
    pub fn new(
        gpu: &Gpu,
        model: &Model,
        state: &State,
        logged: usize,
        listed: usize,
        most_room: u32,
    ) -> Result<(Self, Sizes), GpuError> {
        let p = &state.particles;
        let parts = layout::parts(state);
        let cells: u64 = model.grid.cells.iter().map(|&c| c as u64).product();
        gpu.info.holds("cells of the domain", 12 * cells)?;
        let fluids = p.first[Kind::Rigid as usize] as u32;
        let rigid = state.bodies.rigid_slots as u32;
        let slots = state.bodies.record.len() as u32;
        let agents = state.agents.record.len() as u32;
        let movers = state.bodies.body.iter().filter(|b| b.slots.start < state.bodies.rigid_slots).count() as u32;
        let coarse = model.implicit() && model.coarse();
        let [elements, nodes] = if coarse { layout::lattice(model) } else { [0; 2] };
        let occupied = elements.min(u64::from(fluids));
        gpu.info.holds_all("elements of implicit pressure", occupied, occupied * (4 * ELEMENT) as u64)?;
        gpu.info.holds_all("nodes of implicit pressure", nodes, nodes * (4 * ROW) as u64)?;
        let reaches = if coarse { layout::reaches(model, state, movers) } else { vec![0] };
        let reached = reaches[reaches.len() - 1];
        gpu.info.holds_all("nodes that bodies reach", reached, reached * (4 * FELT) as u64)?;
        let sizes = Sizes {
            elements: elements as u32,
            occupied: occupied as u32,
            nodes: nodes as u32,
            room: layout::room(model, fluids, gpu.info.max_buffer_bytes).min(most_room),
            fluids,
            rigid,
            slots,
            slipping: if model.rubs() { rigid } else { 0 },
            bodies: state.bodies.body.len() as u32,
            movers,
            parts: parts.len() as u32,
            cells: cells as u32,
            groups: (fluids + rigid).div_ceil(512).clamp(1, GROUPS),
            agents,
            agent_cells: (4 * agents + 64) * model.flocks.len() as u32,
        };
        let walls = Walls::sort(&model.grid, state, fluids + rigid, sizes.cells);
        let all = (fluids + slots) as usize;
        let fluid_or = |wanted: bool| if wanted { fluids as usize } else { 0 };
        let continuity = model.solver.density == Density::Continuity;
        let carried = model.solver.xsph > 0.0 || model.solver.shifting > 0.0 || model.integrates_density();
        let mirrored = if model.no_slip { slots as usize } else { 0 };
        let rounds = |count: u32| if model.implicit() { count as usize } else { 0 };
        let make = |what: &'static str, count: usize, size: usize| storage(gpu, what, count, size);
        let buffers = vec![
            uniform(gpu, &layout::constants(model, sizes))?,
            make("time", 1, size_of::<layout::Clock>())?,
            make("particles", all, size_of::<Record>())?,
            make("identities", all, 8)?,
            make("forces", all, 16)?,
            make("forces of the step before", fluids as usize, 16)?,
            make("drifted particles", (fluids + rigid) as usize, size_of::<Drifted>())?,
            make("cells", sizes.bins() as usize + walls.starts.len(), 4)?,
            make("counts of cells", sizes.bins() as usize, 4)?,
            make("order of particles", (fluids + rigid) as usize, 4)?,
            make("blocks of cells", sizes.blocks() as usize, 4)?,
            make("bodies", sizes.bodies as usize, size_of::<GpuBody>())?,
            make("slots of bodies", slots as usize, size_of::<Slot>())?,
            make("contacts of bodies", slots as usize, size_of::<Touch>())?,
            make("mirrored velocities", mirrored, 16)?,
            make("parts of bodies", parts.len(), 16)?,
            make("sums of parts", parts.len(), 96)?,
            make("carried velocities", fluid_or(carried), 16)?,
            make("rates of density", fluid_or(continuity || mortal(model)), 16)?,
            make("gradients", fluid_or(model.wants_gradients()), 16)?,
            make("vorticities", fluid_or(model.wants_gradients()), 16)?,
            make("sums of groups", (sizes.groups + agents.div_ceil(128)) as usize, size_of::<Sums>())?,
            make("statistics", logged + 1, size_of::<Sums>())?,
            make("births", listed, size_of::<Birth>())?,
            make("forces of hoses", fluid_or(hoses(model).next().is_some()), 32)?,
            make("agents", sizes.agents as usize, size_of::<Agent>())?,
            make("agents before the sort", sizes.agents as usize, size_of::<Agent>())?,
            make("cells of agents", sizes.agent_cells as usize + 2, 4)?,
            make("counts of cells of agents", sizes.agent_cells as usize + 2, 4)?,
            make("order of agents", sizes.agents as usize, 4)?,
            make("blocks of cells of agents", ((sizes.agent_cells + 2).div_ceil(BLOCK)) as usize, 4)?,
            make("flocks", 1, size_of::<Crowd>() + model.flocks.len() * size_of::<Rule>())?,
            make("slips of contacts", 2 * sizes.slipping as usize, size_of::<layout::Slips>())?,
            make("implicit pressure", 1, SOLVE_BYTES)?,
            make("bodies under implicit pressure", rounds(sizes.bodies), SWEPT_BYTES)?,
            make("places in rounds", rounds(fluids + rigid), 16)?,
            make("accelerations in rounds", rounds(fluids + rigid), 16)?,
            make("nodes", rounds(fluids), NODE_BYTES)?,
            make("shares", rounds(fluids), 16)?,
            make("sums of rounds", rounds(fluids.div_ceil(128)), 16)?,
            make("forces of shares", rounds(slots), 16)?,
            make("joints", model.joints.len(), size_of::<Joint>())?,
            make("what shares have left", if coarse { fluids as usize } else { 0 }, 4)?,
            make("elements of implicit pressure", sizes.occupied as usize * ELEMENT, 4)?,
            make("nodes of implicit pressure", sizes.nodes as usize * ROW, 4)?,
            make("vectors of implicit pressure", sizes.nodes as usize * VECTORS, 4)?,
            make("bodies that give way", reaches.len() - 1, GIVING_BYTES)?,
            make("nodes that bodies reach", reached as usize * FELT, 4)?,
            make("places of elements", (sizes.elements + sizes.occupied) as usize, 4)?,
            make("lists of neighbours", fluids as usize * (1 + sizes.room as usize), 4)?,
        ];
        let buffers = Self { all: buffers };
        buffers.fill(gpu, model, state, &walls, &parts, sizes);
        for (k, first) in reaches.iter().enumerate().take(reaches.len() - 1) {
            let at = (k * GIVING_BYTES + GIVING_FIRST) as u64;
            gpu.queue.write_buffer(&buffers.all[46], at, bytemuck::bytes_of(&(*first as u32)));
        }
        Ok((buffers, sizes))
    }

    fn fill(&self, gpu: &Gpu, model: &Model, state: &State, walls: &Walls, parts: &[[u32; 4]], sizes: Sizes) {
        let (p, b) = (&state.particles, &state.bodies);
        let n = p.count[Kind::Fluid as usize];
        let write = |binding: usize, at: usize, bytes: &[u8]| {
            if !bytes.is_empty() {
                gpu.queue.write_buffer(&self.all[binding], at as u64, bytes);
            }
        };
        let base = (sizes.fluids + sizes.rigid) as usize;
        let standing: Vec<Record> = walls.slots.iter().map(|&s| b.record[s]).collect();
        write(2, 0, bytemuck::cast_slice(&p.record[..n]));
        write(2, base * size_of::<Record>(), bytemuck::cast_slice(&standing));
        let pair = |k: usize| [p.id[k], p.owner[k]];
        write(3, 0, bytemuck::cast_slice(&(0..n).map(pair).collect::<Vec<_>>()));
        let pair = |&s: &usize| [s as u32, b.owner[s]];
        write(3, base * 8, bytemuck::cast_slice(&walls.slots.iter().map(pair).collect::<Vec<_>>()));
        let push: Vec<_> = (0..n).map(|k| with(p.push[k], p.density[k])).collect();
        write(4, 0, bytemuck::cast_slice(&push));
        write(7, sizes.bins() as usize * 4, bytemuck::cast_slice(&walls.starts));
        write(11, 0, bytemuck::cast_slice(&layout::bodies(model, state, parts)));
        let place = |s: usize| s.checked_sub(b.rigid_slots).map_or(GONE, |k| walls.place[k]);
        write(12, 0, bytemuck::cast_slice(&layout::slots(state, parts, place)));
        write(15, 0, bytemuck::cast_slice(parts));
        write(25, 0, bytemuck::cast_slice(&layout::agents(model, state)));
        write(41, 0, bytemuck::cast_slice(&layout::joints(model)));
        write(31, 0, &layout::crowd(model, state, sizes));
        write(32, 0, bytemuck::cast_slice(&layout::slips(&b.contacts, sizes.slipping as usize)));
        if !p.carry.is_empty() {
            write(17, 0, bytemuck::cast_slice(&p.carry[..n]));
        }
        if !(p.rate.is_empty() && p.born.is_empty()) {
            let pair = |k: usize| p.rate.get(k).copied().unwrap_or_default();
            let rates: Vec<_> =
                (0..n).map(|k| [pair(k)[0], pair(k)[1], p.born.get(k).copied().unwrap_or(0.0), 0.0]).collect();
            write(18, 0, bytemuck::cast_slice(&rates));
        }
    }

    /// Brings the state home, all of it at once.
    pub fn download(&self, gpu: &Gpu, sizes: Sizes, state: &mut State) -> Result<(), GpuError> {
        let (cap, cells) = (sizes.fluids as usize, sizes.cells as usize);
        let all = cap + sizes.slots as usize;
        let fluid_or = |wanted: bool| if wanted { cap } else { 0 };
        let p = &state.particles;
        let aged = !(p.rate.is_empty() && p.born.is_empty());
        let crowd_bytes = size_of::<Crowd>() + state.agents.clock.len() * size_of::<Rule>();
        let wanted = [
            (7, sizes.bins() as usize * 4),
            (1, size_of::<layout::Clock>()),
            (2, all * size_of::<Record>()),
            (3, all * 8),
            (4, all * 16),
            (5, cap * 16),
            (13, sizes.slots as usize * size_of::<Touch>()),
            (12, sizes.slots as usize * size_of::<Slot>()),
            (11, sizes.bodies as usize * size_of::<GpuBody>()),
            (17, fluid_or(!p.carry.is_empty()) * 16),
            (18, fluid_or(aged) * 16),
            (19, fluid_or(!p.gradient.is_empty()) * 16),
            (20, fluid_or(!p.gradient.is_empty()) * 16),
            (25, sizes.agents as usize * size_of::<Agent>()),
            (31, if sizes.agents > 0 { crowd_bytes } else { 0 }),
            (32, sizes.slipping as usize * size_of::<layout::Slips>()),
        ];
        let homes = wanted.map(|(binding, bytes)| Home::new(gpu, &self.all[binding], 0, bytes as u64));
        send_and_wait(gpu, &homes)?;
        let [
            starts,
            clock,
            records,
            info,
            push,
            before,
            touch,
            slots,
            bodies,
            carry,
            rates,
            gradient,
            curls,
            agents,
            crowd,
            slips,
        ] = &homes;
        let starts: Vec<u32> = starts.read(gpu, sizes.bins() as usize)?;
        let clock: Vec<layout::Clock> = clock.read(gpu, 1)?;
        let live = if clock[0].step > 0 || starts[cells] > 0 { starts[cells] as usize } else { clock[0].live as usize };
        let rigid = (starts[2 * cells + BINS as usize] as usize).saturating_sub(cap);
        let records: Vec<Record> = records.read(gpu, all)?;
        let info: Vec<[u32; 2]> = info.read(gpu, all)?;
        let push: Vec<[f32; 4]> = push.read(gpu, all)?;
        let before: Vec<[f32; 4]> = before.read(gpu, cap)?;
        let touch: Vec<Touch> = touch.read(gpu, sizes.slots as usize)?;
        let slots: Vec<Slot> = slots.read(gpu, sizes.slots as usize)?;
        let bodies: Vec<GpuBody> = bodies.read(gpu, sizes.bodies as usize)?;
        let p = &mut state.particles;
        p.count = [live, rigid, (sizes.slots - sizes.rigid) as usize];
        let segments = Kind::ALL.into_iter().flat_map(|kind| p.segment(kind));
        for k in segments.collect::<Vec<_>>() {
            p.record[k] = records[k];
            [p.id[k], p.owner[k]] = info[k];
            p.push[k] = three(push[k]);
        }
        for k in 0..live {
            p.density[k] = push[k][3];
            p.push_before[k] = three(before[k]);
        }
        for (to, from) in p.touch.iter_mut().zip(&touch) {
            *to = layout::to_touch(from);
        }
        if !p.carry.is_empty() {
            p.carry[..live].copy_from_slice(&carry.read(gpu, live)?);
        }
        if aged {
            let rates: Vec<[f32; 4]> = rates.read(gpu, live)?;
            p.rate.iter_mut().zip(&rates).for_each(|(to, r)| *to = [r[0], r[1]]);
            p.born.iter_mut().zip(&rates).for_each(|(to, r)| *to = r[2]);
        }
        if !p.gradient.is_empty() {
            p.gradient[..live].copy_from_slice(&gradient.read(gpu, live)?);
            let curls: Vec<[f32; 4]> = curls.read(gpu, live)?;
            p.vorticity.iter_mut().zip(curls).for_each(|(to, from)| *to = three(from));
        }
        if sizes.agents > 0 {
            let agents: Vec<Agent> = agents.read(gpu, sizes.agents as usize)?;
            let crowd: Vec<u32> = crowd.read(gpu, crowd_bytes / 4)?;
            let rules: &[Rule] = bytemuck::cast_slice(&crowd[size_of::<Crowd>() / 4..]);
            layout::to_agents(&agents, rules, state);
        }
        let slips: Vec<layout::Slips> = slips.read(gpu, sizes.slipping as usize)?;
        let b = &mut state.bodies;
        b.contacts = layout::to_contacts(&slips);
        for (body, from) in b.body.iter_mut().zip(&bodies) {
            layout::to_body(from, body);
        }
        for (s, slot) in slots.iter().enumerate().take(b.rigid_slots) {
            b.facing[s] = three(slot.facing);
            if slot.place != GONE {
                b.record[s] = records[slot.place as usize];
            }
        }
        Ok(())
    }

    /// Writes bodies and agents anew.
    pub fn write_movers(&self, gpu: &Gpu, bodies: &[GpuBody], agents: &[Agent]) {
        gpu.queue.write_buffer(&self.all[11], 0, bytemuck::cast_slice(bodies));
        gpu.queue.write_buffer(&self.all[25], 0, bytemuck::cast_slice(agents));
    }

    /// Brings bodies and agents home.
    pub fn movers(&self, gpu: &Gpu, sizes: Sizes) -> Result<(Vec<GpuBody>, Vec<Agent>), GpuError> {
        let (bodies, agents) = (sizes.bodies as usize, sizes.agents as usize);
        let wanted = [(11, bodies * size_of::<GpuBody>()), (25, agents * size_of::<Agent>())];
        let homes = wanted.map(|(binding, bytes): (usize, usize)| Home::new(gpu, &self.all[binding], 0, bytes as u64));
        send_and_wait(gpu, &homes)?;
        Ok((homes[0].read(gpu, bodies)?, homes[1].read(gpu, agents)?))
    }

    /// The clock.
    pub fn clock(&self) -> &wgpu::Buffer {
        &self.all[1]
    }

    /// Bodies.
    pub fn bodies(&self) -> &wgpu::Buffer {
        &self.all[11]
    }

    /// What implicit pressure does to bodies.
    pub fn swept(&self) -> &wgpu::Buffer {
        &self.all[34]
    }

    /// Statistics of steps: the last, then one a step.
    pub fn log(&self) -> &wgpu::Buffer {
        &self.all[22]
    }

    /// The list of births.
    pub fn births(&self) -> &wgpu::Buffer {
        &self.all[23]
    }

    /// Waits for the device and reads `count` items of a buffer, from number `first` on.
    pub fn fetch<T: Pod>(
        &self,
        gpu: &Gpu,
        from: &wgpu::Buffer,
        first: usize,
        count: usize,
    ) -> Result<Vec<T>, GpuError> {
        let home = Home::new(gpu, from, (first * size_of::<T>()) as u64, (count * size_of::<T>()) as u64);
        send_and_wait(gpu, std::slice::from_ref(&home))?;
        home.read(gpu, count)
    }
}

/// A piece of a buffer, and room for it on the host's side.
pub struct Home {
    from: wgpu::Buffer,
    at: u64,
    bytes: u64,
    room: wgpu::Buffer,
}

impl Home {
    /// Makes room.
    pub fn new(gpu: &Gpu, from: &wgpu::Buffer, at: u64, bytes: u64) -> Self {
        let room = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("at home"),
            size: bytes.max(4),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        Self { from: from.clone(), at, bytes, room }
    }

    /// How many bytes there are.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Sends the first so many bytes on their way.
    pub fn send(&self, commands: &mut wgpu::CommandEncoder, bytes: u64) {
        if bytes > 0 {
            commands.copy_buffer_to_buffer(&self.from, self.at, &self.room, 0, bytes);
        }
    }

    /// The first so many items, once they have arrived. They can then be sent anew.
    pub fn read<T: Pod>(&self, gpu: &Gpu, count: usize) -> Result<Vec<T>, GpuError> {
        let view = self.room.get_mapped_range(..).map_err(|e| gpu.refused(e))?;
        let items = view.chunks_exact(size_of::<T>()).take(count).map(bytemuck::pod_read_unaligned).collect();
        drop(view);
        self.room.unmap();
        Ok(items)
    }
}

/// Brings pieces home, all at once.
fn send_and_wait(gpu: &Gpu, homes: &[Home]) -> Result<(), GpuError> {
    let mut commands = gpu.device.create_command_encoder(&Default::default());
    homes.iter().for_each(|home| home.send(&mut commands, home.bytes));
    gpu.queue.submit([commands.finish()]);
    arrive(gpu, &homes.iter().collect::<Vec<_>>())
}

/// Waits for the device, once for all that was sent.
pub fn arrive(gpu: &Gpu, homes: &[&Home]) -> Result<(), GpuError> {
    let (sender, receiver) = std::sync::mpsc::channel();
    for home in homes {
        let sender = sender.clone();
        home.room.map_async(wgpu::MapMode::Read, .., move |outcome| {
            // No one listens once the wait below has failed.
            let _ = sender.send(outcome);
        });
    }
    gpu.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| gpu.refused(e))?;
    for _ in homes {
        receiver.recv_timeout(PATIENCE).map_err(|e| gpu.refused(e))?.map_err(|e| gpu.refused(e))?;
    }
    Ok(())
}

/// A buffer for kernels to read and write; never empty, and full of zeros.
fn storage(gpu: &Gpu, what: &'static str, count: usize, size: usize) -> Result<wgpu::Buffer, GpuError> {
    let bytes = (count * size) as u64;
    gpu.info.holds_all(what, count as u64, bytes)?;
    Ok(gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(what),
        size: bytes.max(size as u64).max(512),
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    }))
}

fn uniform(gpu: &Gpu, bytes: &[u8]) -> Result<wgpu::Buffer, GpuError> {
    let limit = gpu.device.limits().max_uniform_buffer_binding_size;
    if bytes.len() as u64 > limit {
        let device = gpu.info.name.clone();
        return Err(GpuError::Limit {
            what: "constants of the scene",
            count: 0,
            needs: bytes.len() as u64,
            limit,
            device,
        });
    }
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("constants"),
        size: bytes.len() as u64,
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    gpu.queue.write_buffer(&buffer, 0, bytes);
    Ok(buffer)
}
