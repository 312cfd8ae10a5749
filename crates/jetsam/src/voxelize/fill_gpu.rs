//! The parity rule on the GPU, twin of [`super::fill::parity`]: the same bits.
//!
//! In: a [`Shape`]. Out: a [`BitGrid`] and the rows that passed through the surface an odd number of times, for the CPU to
//! settle by winding number. Called by [`super::Voxelizer`].
//!
//! **How.** `parity.wgsl` has two kernels. `toggle` runs once per triangle and slice and flips, with an atomic XOR, the
//! first cell beyond each crossing; `prefix` turns flips into cells with a running XOR along each row. XOR does not care
//! about order, so any schedule gives the same grid.
//!
//! **Exact.** Where a row meets a triangle is a ceiling of a rational number of 128 bits. A GPU has neither `f64` nor
//! wide integers, and may round `f32` as it likes, so that bounds for a filter would have to be taken on trust, and what the
//! filter leaves would have to come back to the CPU between the kernels. The kernels need neither: a ceiling is the place
//! where i·step - goal changes its sign, both are integers, and along a row the goal advances by a constant. So a
//! crossing costs one guess in `f32` and about three additions of four words each, and the guess can be as wrong as it
//! likes: it costs time, not bits.
//!
//! **Size.** The grid is done in passes of as many slices as fit into 32 MiB, so the device holds twice that and the mesh.

use std::time::Duration;

use super::bits::{BitGrid, ones};
use super::fill::Shape;
use super::raster::slices;
use crate::gpu::{Gpu, GpuError};

/// Bytes of the grid in one pass, unless one slice takes more.
const PASS_BYTES: u64 = 32 << 20;
/// Pairs of a triangle and a slice in one pass, unless one slice has more: leaves room to number the invocations of a
/// dispatch that is folded into two dimensions.
const MOST_PAIRS: u32 = 1 << 31;
/// Invocations in a workgroup of the kernels.
const GROUP: u32 = 64;
/// Rows for one invocation of `toggle`, at most: `BAND` of the kernels.
const BAND: u32 = 2048;

/// How long a finished device may take to say so.
const PATIENCE: Duration = Duration::from_secs(10);

/// The two kernels on an open device.
pub(crate) struct FillGpu {
    gpu: Gpu,
    layout: wgpu::BindGroupLayout,
    toggle: wgpu::ComputePipeline,
    prefix: wgpu::ComputePipeline,
}

/// What a fill has found.
pub(crate) struct Filled {
    /// The rows (slice · ny + row) whose cells are not to be trusted, ascending.
    pub odd: Vec<u64>,
    /// Time of the kernels, where the device has a clock.
    pub kernel_millis: Option<f64>,
}

/// `Params` of the kernels.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Params {
    nx: u32,
    ny: u32,
    first: u32,
    slices: u32,
    triangles: u32,
    pairs: u32,
    row_words: u32,
    unused: u32,
}

impl FillGpu {
    /// Builds the kernels.
    pub fn new(gpu: Gpu) -> Result<FillGpu, GpuError> {
        let (layout, toggle, prefix) = gpu.attempt(|| {
            let device = &gpu.device;
            let module = device.create_shader_module(wgpu::include_wgsl!("parity.wgsl"));
            let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
                binding,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
                count: None,
            };
            let storage = |read_only| wgpu::BufferBindingType::Storage { read_only };
            let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some("parity"),
                entries: &[
                    entry(0, wgpu::BufferBindingType::Uniform),
                    entry(1, storage(true)),
                    entry(2, storage(true)),
                    entry(3, storage(true)),
                    entry(4, storage(false)),
                    entry(5, storage(false)),
                ],
            });
            let whole = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("parity"),
                bind_group_layouts: &[Some(&layout)],
                immediate_size: 0,
            });
            let kernel = |name| {
                device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                    label: Some(name),
                    layout: Some(&whole),
                    module: &module,
                    entry_point: Some(name),
                    compilation_options: Default::default(),
                    cache: None,
                })
            };
            let (toggle, prefix) = (kernel("toggle"), kernel("prefix"));
            Ok((layout, toggle, prefix))
        })?;
        Ok(FillGpu { gpu, layout, toggle, prefix })
    }

    /// For reports: `gpu: name (api)`.
    pub fn name(&self) -> String {
        format!("gpu: {} ({})", self.gpu.info.name, self.gpu.info.api)
    }

    /// As if the device were taken out.
    pub fn lose(&self) {
        self.gpu.device.destroy();
    }

    /// Fills an empty grid.
    pub fn parity(&self, shape: &Shape, grid: &mut BitGrid) -> Result<Filled, GpuError> {
        let mut filled = Filled { odd: Vec::new(), kernel_millis: Some(0.0) };
        let [_, ny, nz] = grid.dims();
        let triangles = shape.triangles.len() as u32;
        if triangles == 0 {
            return Ok(filled);
        }
        let (vertices, corners) = self.gpu.attempt(|| {
            let vertices = self.input("vertices", bytemuck::cast_slice(&shape.vertices))?;
            let corners = self.input("triangles", bytemuck::cast_slice(&shape.triangles))?;
            Ok((vertices, corners))
        })?;
        let per_slice = grid.slice_words();
        let fit = (PASS_BYTES / (8 * per_slice as u64)).min(u64::from(MOST_PAIRS / triangles));
        let step = fit.clamp(1, u64::from(nz)) as u32;
        for first in (0..nz).step_by(step as usize) {
            let (spans, pairs) = spans(shape, nz, first..(first + step).min(nz));
            if pairs == 0 {
                continue;
            }
            let params = Params {
                nx: grid.dims()[0],
                ny,
                first,
                slices: step.min(nz - first),
                triangles,
                pairs,
                row_words: 2 * grid.row_words() as u32,
                unused: 0,
            };
            let from = first as usize * per_slice;
            let words = &mut grid.words_mut()[from..from + params.slices as usize * per_slice];
            self.gpu.attempt(|| {
                let spans = self.input("spans of triangles", bytemuck::cast_slice(&spans))?;
                self.pass(params, [&vertices, &corners, &spans], words, &mut filled)
            })?;
        }
        Ok(filled)
    }

    /// Runs both kernels over some slices, and brings the cells home.
    fn pass(
        &self,
        params: Params,
        mesh: [&wgpu::Buffer; 3],
        words: &mut [u64],
        filled: &mut Filled,
    ) -> Result<(), GpuError> {
        use wgpu::BufferUsages as Usage;
        let device = &self.gpu.device;
        let rows = params.ny * params.slices;
        let sizes = [words.len() as u64 * 8, u64::from(rows.div_ceil(32)) * 4];
        self.gpu.info.holds("the cells of a pass", sizes[0])?;
        let settings = self.buffer("parameters", 32, Usage::UNIFORM | Usage::COPY_DST);
        self.gpu.queue.write_buffer(&settings, 0, bytemuck::bytes_of(&params));
        // wgpu hands out buffers full of zeros.
        let cells = self.buffer("cells", sizes[0], Usage::STORAGE | Usage::COPY_SRC);
        let odd = self.buffer("odd rows", sizes[1], Usage::STORAGE | Usage::COPY_SRC);
        let clock = Clock::new(&self.gpu);
        let home = self.buffer("read back", sizes[0] + sizes[1] + 16, Usage::MAP_READ | Usage::COPY_DST);
        let [vertices, triangles, spans] = mesh;
        let entries = [&settings, vertices, triangles, spans, &cells, &odd];
        let bound = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("parity"),
            layout: &self.layout,
            entries: &[0, 1, 2, 3, 4, 5]
                .map(|n| wgpu::BindGroupEntry { binding: n, resource: entries[n as usize].as_entire_binding() }),
        });
        let mut commands = device.create_command_encoder(&Default::default());
        {
            let mut pass = commands.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("parity"),
                timestamp_writes: clock.as_ref().map(Clock::writes),
            });
            pass.set_bind_group(0, &bound, &[]);
            let bands = params.ny.div_ceil(BAND);
            for (kernel, count, layers) in [(&self.toggle, params.pairs, bands), (&self.prefix, rows, 1)] {
                let [x, y] = self.fold(count.div_ceil(GROUP));
                pass.set_pipeline(kernel);
                pass.dispatch_workgroups(x, y, layers);
            }
        }
        commands.copy_buffer_to_buffer(&cells, 0, &home, 0, sizes[0]);
        commands.copy_buffer_to_buffer(&odd, 0, &home, sizes[0], sizes[1]);
        if let Some(clock) = &clock {
            clock.stop(&mut commands, &home, sizes[0] + sizes[1]);
        }
        self.gpu.queue.submit([commands.finish()]);
        let view = self.read(&home)?;
        let (grid_bytes, rest) = view.split_at(sizes[0] as usize);
        let (odd_bytes, ticks) = rest.split_at(sizes[1] as usize);
        for (word, bytes) in words.iter_mut().zip(grid_bytes.chunks_exact(8)) {
            *word = bytemuck::pod_read_unaligned(bytes);
        }
        let before = u64::from(params.first) * u64::from(params.ny);
        for (at, bytes) in (0u64..).zip(odd_bytes.chunks_exact(4)) {
            let word: u32 = bytemuck::pod_read_unaligned(bytes);
            let bits = ones(u64::from(word)).map(|bit| before + 32 * at + u64::from(bit));
            filled.odd.extend(bits);
        }
        let [start, end]: [u64; 2] = bytemuck::pod_read_unaligned(ticks);
        let millis = end.wrapping_sub(start) as f64 * f64::from(self.gpu.queue.get_timestamp_period());
        filled.kernel_millis = filled.kernel_millis.filter(|_| clock.is_some()).map(|sum| sum + millis * 1e-6);
        Ok(())
    }

    /// Workgroups in two dimensions, where one does not hold them all.
    fn fold(&self, groups: u32) -> [u32; 2] {
        let most = self.gpu.device.limits().max_compute_workgroups_per_dimension;
        let x = groups.min(most);
        [x, groups.div_ceil(x)]
    }

    fn buffer(&self, label: &str, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size,
            usage,
            mapped_at_creation: false,
        })
    }

    /// A buffer with these bytes, for kernels to read.
    fn input(&self, what: &'static str, bytes: &[u8]) -> Result<wgpu::Buffer, GpuError> {
        self.gpu.info.holds(what, bytes.len() as u64)?;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let buffer = self.buffer(what, bytes.len() as u64, usage);
        self.gpu.queue.write_buffer(&buffer, 0, bytes);
        Ok(buffer)
    }

    /// Waits for the device and maps a buffer.
    fn read(&self, buffer: &wgpu::Buffer) -> Result<wgpu::BufferView, GpuError> {
        let (sender, receiver) = std::sync::mpsc::channel();
        buffer.map_async(wgpu::MapMode::Read, .., move |outcome| {
            // No one listens once the wait below has failed.
            let _ = sender.send(outcome);
        });
        let refused = |e: &dyn std::fmt::Display| self.gpu.refused(e);
        self.gpu.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| refused(&e))?;
        // Another thread that waits for the same device may be the one to call back, a moment later.
        match receiver.recv_timeout(PATIENCE) {
            Ok(outcome) => outcome.map_err(|e| refused(&e))?,
            Err(e) => return Err(refused(&e)),
        }
        buffer.get_mapped_range(..).map_err(|e| refused(&e))
    }
}

/// For every triangle, its first pair and the slice of that pair; and the number of pairs. A pair is a triangle and one of
/// the given slices that passes through it.
fn spans(shape: &Shape, nz: u32, pass: std::ops::Range<u32>) -> (Vec<[u32; 2]>, u32) {
    let mut pairs = 0;
    let span = |t| {
        let all = slices(shape.corners(t), nz);
        let from = all.start.max(pass.start);
        let start = pairs;
        pairs += all.end.min(pass.end).saturating_sub(from);
        [start, from]
    };
    let spans = (0..shape.triangles.len() as u32).map(span).collect();
    (spans, pairs)
}

/// Two timestamps round a pass.
struct Clock {
    ticks: wgpu::QuerySet,
    resolved: wgpu::Buffer,
}

impl Clock {
    fn new(gpu: &Gpu) -> Option<Clock> {
        let has = gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        has.then(|| Clock {
            ticks: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: None,
                ty: wgpu::QueryType::Timestamp,
                count: 2,
            }),
            resolved: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("ticks"),
                size: 16,
                usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            }),
        })
    }

    fn writes(&self) -> wgpu::ComputePassTimestampWrites<'_> {
        wgpu::ComputePassTimestampWrites {
            query_set: &self.ticks,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: Some(1),
        }
    }

    fn stop(&self, commands: &mut wgpu::CommandEncoder, home: &wgpu::Buffer, at: u64) {
        commands.resolve_query_set(&self.ticks, 0..2, &self.resolved, 0);
        commands.copy_buffer_to_buffer(&self.resolved, 0, home, at, 16);
    }
}
