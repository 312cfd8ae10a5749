//! How long the passes of a picture take on the device, by its own timestamps. In: passes, as they begin. Out: milliseconds.

use std::cell::RefCell;

/// Passes that are timed in one picture, at most; curvature flow alone has forty.
const MOST: u32 = 128;

/// Times the passes of one picture after another.
pub struct Clock {
    set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    back: wgpu::Buffer,
    /// Milliseconds a tick.
    tick: f64,
    labels: RefCell<Vec<&'static str>>,
}

/// Milliseconds from the beginning of the first pass to the end of the last, and of each kind of pass in the order of the first of
/// its kind.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Times {
    /// The whole picture.
    pub ms: f64,
    /// Its passes.
    pub passes: Vec<(&'static str, f64)>,
}

impl Clock {
    /// A clock, where the device has one.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Option<Self> {
        if !device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return None;
        }
        let buffer = |label, usage| {
            let size = u64::from(2 * MOST) * 8;
            device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
        };
        Some(Self {
            set: device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("times"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * MOST,
            }),
            resolved: buffer("times", wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
            back: buffer("times on their way back", wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST),
            tick: 1e-6 * f64::from(queue.get_timestamp_period()),
            labels: RefCell::default(),
        })
    }

    /// A new picture begins.
    pub fn begin(&self) {
        self.labels.borrow_mut().clear();
    }

    /// Where a pass writes when it began and when it ended; nothing once there have been too many.
    pub fn pass(&self, label: &'static str) -> Option<wgpu::RenderPassTimestampWrites<'_>> {
        let mut labels = self.labels.borrow_mut();
        let k = labels.len() as u32;
        if k == MOST {
            return None;
        }
        labels.push(label);
        Some(wgpu::RenderPassTimestampWrites {
            query_set: &self.set,
            beginning_of_pass_write_index: Some(2 * k),
            end_of_pass_write_index: Some(2 * k + 1),
        })
    }

    /// The picture is complete.
    pub fn end(&self, encoder: &mut wgpu::CommandEncoder) {
        let count = 2 * self.labels.borrow().len() as u32;
        encoder.resolve_query_set(&self.set, 0..count, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.back, 0, u64::from(count) * 8);
    }

    /// Reads the times of a picture that was submitted; waits for it. Nothing from a device that is lost.
    pub fn read(&self, device: &wgpu::Device) -> Option<Times> {
        let labels = self.labels.borrow();
        let slice = self.back.slice(..16 * labels.len() as u64);
        slice.map_async(wgpu::MapMode::Read, |_| {});
        device.poll(wgpu::PollType::wait_indefinitely()).ok()?;
        let mut times = Times::default();
        {
            let bytes = slice.get_mapped_range().ok()?;
            let ticks: Vec<u64> = bytes.chunks_exact(8).map(bytemuck::pod_read_unaligned).collect();
            let ms = |from: u64, to: u64| self.tick * to.saturating_sub(from) as f64;
            for (label, pass) in labels.iter().zip(ticks.chunks_exact(2)) {
                let spent = ms(pass[0], pass[1]);
                match times.passes.iter_mut().find(|(known, _)| known == label) {
                    Some((_, sum)) => *sum += spent,
                    None => times.passes.push((label, spent)),
                }
            }
            times.ms = ticks.last().map_or(0.0, |last| ms(ticks[0], *last));
        }
        self.back.unmap();
        Some(times)
    }
}
