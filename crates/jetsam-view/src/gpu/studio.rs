//! Pictures without a window: a renderer, a texture to draw to, and the way back to the host.

use super::{Particles, Pipelines, Place, Renderer, Times};
use crate::{Frame, Image, Line, Show, Style};
use jetsam::gpu::{Gpu, GpuError};

/// Takes pictures of frames on a device.
pub struct Studio {
    gpu: Gpu,
    renderer: Renderer,
    texture: wgpu::Texture,
    back: wgpu::Buffer,
    size: [u32; 2],
}

const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

impl Studio {
    /// A studio for pictures of `width` by `height` pixels.
    ///
    /// # Errors
    /// A device that refuses, or has too little memory.
    pub fn new(gpu: Gpu, show: Show, width: u32, height: u32) -> Result<Self, GpuError> {
        let (renderer, texture, back) = gpu.attempt(|| {
            let renderer = Renderer::new(&gpu.device, &gpu.queue, Pipelines::new(&gpu.device, FORMAT), show);
            let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some("picture"),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: FORMAT,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            });
            let back = gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("picture on its way back"),
                size: u64::from(row(width)) * u64::from(height),
                usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
                mapped_at_creation: false,
            });
            Ok((renderer, texture, back))
        })?;
        Ok(Self { gpu, renderer, texture, back, size: [width, height] })
    }

    /// How the scene is shown.
    pub fn show(&self) -> &Show {
        self.renderer.show()
    }

    /// A picture of a frame by the scene's own camera.
    ///
    /// # Errors
    /// A device that refuses, is lost, or has too little memory.
    pub fn picture(&mut self, frame: &Frame, style: &Style, lines: &[Line]) -> Result<Image, GpuError> {
        self.take(|renderer| renderer.load(frame), style, lines)
    }

    /// The same of particles in the simulation's own buffers: see [`Renderer::borrow`].
    ///
    /// # Errors
    /// As [`Studio::picture`].
    pub fn picture_of(
        &mut self,
        particles: Particles,
        frame: &Frame,
        style: &Style,
        lines: &[Line],
    ) -> Result<Image, GpuError> {
        self.take(|renderer| renderer.borrow(particles, frame), style, lines)
    }

    /// How long such a picture takes on the device, which it does not leave; nothing where the device has no clock.
    ///
    /// # Errors
    /// As [`Studio::picture`].
    pub fn times(&mut self, frame: &Frame, style: &Style, lines: &[Line]) -> Result<Option<Times>, GpuError> {
        let Self { gpu, renderer, texture, size: [width, height], .. } = self;
        gpu.attempt(|| {
            if !renderer.time_passes() {
                return Ok(None);
            }
            renderer.load(frame);
            let target = texture.create_view(&wgpu::TextureViewDescriptor::default());
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            let place = Place { target: &target, rect: [0, 0, *width, *height], clear: true };
            let camera = renderer.show().camera;
            renderer.draw(&mut encoder, place, &camera, style, lines);
            gpu.queue.submit([encoder.finish()]);
            Ok(renderer.times())
        })
    }

    fn take(&mut self, load: impl FnOnce(&mut Renderer), style: &Style, lines: &[Line]) -> Result<Image, GpuError> {
        let Self { gpu, renderer, texture, back, size } = self;
        let [width, height] = *size;
        gpu.attempt(|| {
            load(renderer);
            let target = texture.create_view(&wgpu::TextureViewDescriptor::default());
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            let place = Place { target: &target, rect: [0, 0, width, height], clear: true };
            let camera = renderer.show().camera;
            renderer.draw(&mut encoder, place, &camera, style, lines);
            let layout =
                wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row(width)), rows_per_image: None };
            encoder.copy_texture_to_buffer(
                texture.as_image_copy(),
                wgpu::TexelCopyBufferInfo { buffer: back, layout },
                wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            );
            gpu.queue.submit([encoder.finish()]);
            read(gpu, back, width as usize, height as usize)
        })
    }
}

/// Bytes of a row of pixels on its way back.
fn row(width: u32) -> u32 {
    (4 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT)
}

fn read(gpu: &Gpu, buffer: &wgpu::Buffer, width: usize, height: usize) -> Result<Image, GpuError> {
    buffer.slice(..).map_async(wgpu::MapMode::Read, |_| {});
    gpu.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| gpu.refused(e))?;
    let mut rgba = Vec::with_capacity(4 * width * height);
    {
        let bytes = buffer.slice(..).get_mapped_range().map_err(|e| gpu.refused(e))?;
        for line in bytes.chunks(row(width as u32) as usize) {
            rgba.extend_from_slice(&line[..4 * width]);
        }
    }
    buffer.unmap();
    Ok(Image { width, height, rgba })
}
