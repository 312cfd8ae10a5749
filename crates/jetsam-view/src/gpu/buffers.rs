//! What is drawn, in GPU memory: particles in the simulation's own layout, meshes, poses, agents, lines.

use crate::show::{Form, Show};
use crate::sprite::Sprite;
use crate::style::Bodies;
use crate::{Facet, Frame, Line};
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;
use wgpu::BufferUsages as Usage;

/// A buffer that grows.
pub struct Growing {
    label: &'static str,
    usage: Usage,
    pub buffer: wgpu::Buffer,
}

impl Growing {
    pub fn new(device: &wgpu::Device, label: &'static str, usage: Usage) -> Self {
        Self { label, usage, buffer: make(device, label, usage, 256) }
    }

    /// Replaces the contents. Whether there is a new buffer, which has to be bound anew.
    pub fn fill<T: Pod>(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, items: &[T]) -> bool {
        let bytes: &[u8] = bytemuck::cast_slice(items);
        let grown = bytes.len() as u64 > self.buffer.size();
        if grown {
            self.buffer = make(device, self.label, self.usage, (bytes.len() as u64).next_power_of_two());
        }
        if !bytes.is_empty() {
            queue.write_buffer(&self.buffer, 0, bytes);
        }
        grown
    }
}

fn make(device: &wgpu::Device, label: &str, usage: Usage, size: u64) -> wgpu::Buffer {
    let usage = usage | Usage::COPY_DST;
    device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
}

/// `Pose` of `solids.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub struct Pose {
    turn: [f32; 4],
    place: [f32; 4],
    color: [f32; 4],
}

/// A line as the GPU reads it; the width is in pixels.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Stroke {
    from: [f32; 3],
    to: [f32; 3],
    color: [f32; 3],
    width: f32,
}

impl Stroke {
    pub fn new(line: &Line, width: f32) -> Self {
        Self { from: line.from.to_array(), to: line.to.to_array(), color: line.color, width }
    }
}

/// A mesh, and which vertices of the instance buffer are the bodies that have it.
pub struct Solid {
    facets: Arc<Vec<Facet>>,
    pub vertices: wgpu::Buffer,
    pub count: u32,
    pub instances: std::ops::Range<u32>,
}

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Vertex {
    x: [f32; 3],
    n: [f32; 3],
}

/// The meshes of a scene, each once, and the bodies that have them in the order in which they are drawn.
pub fn solids(device: &wgpu::Device, queue: &wgpu::Queue, show: &Show) -> (Vec<Solid>, Vec<u32>) {
    let mut solids: Vec<(Arc<Vec<Facet>>, Vec<u32>)> = Vec::new();
    for (body, look) in show.bodies.iter().enumerate() {
        let Form::Mesh(facets) = &look.form else { continue };
        match solids.iter_mut().find(|(known, _)| Arc::ptr_eq(known, facets)) {
            Some((_, bodies)) => bodies.push(body as u32),
            None => solids.push((facets.clone(), vec![body as u32])),
        }
    }
    let mut order = Vec::new();
    let upload = |(facets, bodies): (Arc<Vec<Facet>>, Vec<u32>)| {
        let vertex = |f: &Facet, k: usize| Vertex { x: f.corners[k].to_array(), n: f.normals[k].to_array() };
        let vertices: Vec<Vertex> = facets.iter().flat_map(|f| [0, 1, 2].map(|k| vertex(f, k))).collect();
        let mut buffer = Growing::new(device, "mesh", Usage::VERTEX);
        buffer.fill(device, queue, &vertices);
        let first = order.len() as u32;
        order.extend(bodies);
        let instances = first..order.len() as u32;
        Solid { facets, vertices: buffer.buffer, count: vertices.len() as u32, instances }
    };
    let solids = solids.into_iter().map(upload).collect();
    (solids, order)
}

impl Solid {
    /// Whether anything is to be drawn.
    pub fn is_empty(&self) -> bool {
        self.facets.is_empty()
    }
}

/// Colour of each fluid and of each body; the last number says whether its particles are drawn.
pub fn owners(show: &Show, bodies: Bodies) -> Vec<[f32; 4]> {
    let fluids = show.fluids.iter().map(|&[r, g, b]| [r, g, b, 1.0]);
    let rest = show.bodies.iter().map(|look| {
        let [r, g, b] = look.color;
        let drawn = match &look.form {
            Form::Hidden => false,
            Form::Balls => true,
            Form::Mesh(_) => bodies == Bodies::Particles,
        };
        [r, g, b, f32::from(u8::from(drawn))]
    });
    let all: Vec<_> = fluids.chain(rest).collect();
    if all.is_empty() { vec![[0.0; 4]] } else { all }
}

/// Colour of each flock and length of its agents, and the flock of each agent.
pub fn flocks(show: &Show) -> (Vec<[f32; 4]>, Vec<[u32; 2]>) {
    let looks = show.flocks.iter().map(|f| [f.color[0], f.color[1], f.color[2], f.length]).collect();
    let tags = show.flocks.iter().enumerate().flat_map(|(k, f)| f.range.clone().map(move |i| [i as u32, k as u32]));
    (looks, tags.collect())
}

/// A sprite as a texture, with all its levels.
pub fn sprite(device: &wgpu::Device, queue: &wgpu::Queue, sprite: &Sprite) -> wgpu::TextureView {
    let levels = sprite.levels();
    let extent = |level: &crate::Image| wgpu::Extent3d {
        width: level.width as u32,
        height: level.height as u32,
        depth_or_array_layers: 1,
    };
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("sprite"),
        size: extent(&levels[0]),
        mip_level_count: levels.len() as u32,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba8UnormSrgb,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    for (k, level) in (0..).zip(&levels) {
        let to = wgpu::TexelCopyTextureInfo { mip_level: k, ..texture.as_image_copy() };
        let bytes_per_row = Some(4 * level.width as u32);
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row, rows_per_image: None };
        queue.write_texture(to, &level.rgba, layout, extent(level));
    }
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// Poses of all bodies.
pub fn poses(show: &Show, frame: &Frame) -> Vec<Pose> {
    let pose = |((place, turn), look): (&(glam::DVec3, glam::DQuat), &crate::show::Look)| {
        let (x, [r, g, b]) = (place.as_vec3(), look.color);
        Pose { turn: turn.as_quat().to_array(), place: [x.x, x.y, x.z, 1.0], color: [r, g, b, 1.0] }
    };
    frame.poses.iter().zip(&show.bodies).map(pose).collect()
}
