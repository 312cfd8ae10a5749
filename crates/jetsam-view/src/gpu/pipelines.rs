//! The render pipelines, one a shader entry point. In: a device. Out: pipelines for the passes of `mod.rs`.

use super::targets::{ALBEDO, DEPTH, FIELD, LIGHT, NORMAL, WATER};
use crate::style::{Fluid, Style};
use std::sync::OnceLock;
use wgpu::{BindingType as Type, ShaderStages as Stages};

const COMMON: &str = include_str!("common.wgsl");

/// The shaders, by name, as they are compiled.
pub const SHADERS: [(&str, &str); 5] = [
    ("particles", include_str!("particles.wgsl")),
    ("solids", include_str!("solids.wgsl")),
    ("shade", include_str!("shade.wgsl")),
    ("smooth", include_str!("smooth.wgsl")),
    ("compose", include_str!("compose.wgsl")),
];

/// Groups of bindings, in the order of their numbers.
pub struct Layouts {
    pub view: wgpu::BindGroupLayout,
    pub particles: wgpu::BindGroupLayout,
    pub poses: wgpu::BindGroupLayout,
    pub sprite: wgpu::BindGroupLayout,
    pub shade: wgpu::BindGroupLayout,
    pub linear: wgpu::BindGroupLayout,
    pub field: wgpu::BindGroupLayout,
    pub way: wgpu::BindGroupLayout,
    pub compose: wgpu::BindGroupLayout,
    pub resolve: wgpu::BindGroupLayout,
}

/// A pipeline, named by what it draws.
#[derive(Clone, Copy, Debug)]
pub enum Pipe {
    Ball,
    Drop,
    Thickness,
    ShadowBall,
    Sprite,
    ShadowSprite,
    Mesh,
    ShadowMesh,
    Dart,
    ShadowDart,
    Arrow,
    Line,
    Shade,
    Linear,
    Narrow,
    Tidy,
    Bilateral,
    Flow,
    Compose,
    // the last: see `PIPES`
    Resolve,
}

const PIPES: usize = Pipe::Resolve as usize + 1;

/// All pipelines, each compiled when it is first asked for: a picture needs a third of them.
pub struct Pipelines {
    device: wgpu::Device,
    pub(super) layouts: Layouts,
    target: wgpu::TextureFormat,
    modules: [OnceLock<wgpu::ShaderModule>; SHADERS.len()],
    made: [OnceLock<wgpu::RenderPipeline>; PIPES],
}

fn layout(device: &wgpu::Device, label: &str, stages: Stages, entries: &[(u32, Type)]) -> wgpu::BindGroupLayout {
    let entries: Vec<_> = entries
        .iter()
        .map(|&(binding, ty)| wgpu::BindGroupLayoutEntry { binding, visibility: stages, ty, count: None })
        .collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}

const UNIFORM: Type =
    Type::Buffer { ty: wgpu::BufferBindingType::Uniform, has_dynamic_offset: false, min_binding_size: None };
const STORAGE: Type = Type::Buffer {
    ty: wgpu::BufferBindingType::Storage { read_only: true },
    has_dynamic_offset: false,
    min_binding_size: None,
};

const fn image(sample_type: wgpu::TextureSampleType) -> Type {
    Type::Texture { sample_type, view_dimension: wgpu::TextureViewDimension::D2, multisampled: false }
}

const COLOR: Type = image(wgpu::TextureSampleType::Float { filterable: false });
const SMOOTH: Type = image(wgpu::TextureSampleType::Float { filterable: true });
const DEPTHS: Type = image(wgpu::TextureSampleType::Depth);

impl Layouts {
    pub fn new(device: &wgpu::Device) -> Self {
        let both = Stages::VERTEX_FRAGMENT;
        let (vertex, fragment) = (Stages::VERTEX, Stages::FRAGMENT);
        let compare = Type::Sampler(wgpu::SamplerBindingType::Comparison);
        let filtering = Type::Sampler(wgpu::SamplerBindingType::Filtering);
        let make = |label, stages, entries: &[(u32, Type)]| layout(device, label, stages, entries);
        Self {
            view: make("view", both, &[(0, UNIFORM), (1, UNIFORM)]),
            particles: make("particles", vertex, &[(0, STORAGE), (1, STORAGE), (2, STORAGE), (3, STORAGE)]),
            poses: make("poses", vertex, &[(0, STORAGE)]),
            sprite: make("sprite", fragment, &[(0, SMOOTH), (1, filtering)]),
            shade: make(
                "shade",
                fragment,
                &[
                    (0, COLOR),
                    (1, COLOR),
                    (2, DEPTHS),
                    (3, DEPTHS),
                    (4, compare),
                    (5, UNIFORM),
                    (6, SMOOTH),
                    (7, filtering),
                ],
            ),
            linear: make("linear", fragment, &[(0, DEPTHS)]),
            field: make("field", fragment, &[(1, COLOR)]),
            way: make("way", fragment, &[(0, UNIFORM)]),
            compose: make("compose", fragment, &[(0, COLOR), (1, COLOR), (2, SMOOTH), (3, filtering)]),
            resolve: make("resolve", fragment, &[(0, COLOR), (4, UNIFORM)]),
        }
    }
}

/// What a pipeline is made of.
struct Recipe<'a> {
    module: usize,
    vertex: &'a str,
    fragment: &'a str,
    groups: &'a [&'a wgpu::BindGroupLayout],
    strip: bool,
    colors: &'a [(wgpu::TextureFormat, Option<wgpu::BlendState>)],
    depth: bool,
    buffers: &'a [Option<wgpu::VertexBufferLayout<'a>>],
}

const ADD: wgpu::BlendState = {
    let add = wgpu::BlendComponent {
        src_factor: wgpu::BlendFactor::One,
        dst_factor: wgpu::BlendFactor::One,
        operation: wgpu::BlendOperation::Add,
    };
    wgpu::BlendState { color: add, alpha: add }
};

impl Pipelines {
    /// For pictures in the format `target`, whose values are written as sRGB by the renderer itself: choose one without `Srgb` in its
    /// name.
    pub fn new(device: &wgpu::Device, target: wgpu::TextureFormat) -> Self {
        let layouts = Layouts::new(device);
        Self { device: device.clone(), layouts, target, modules: Default::default(), made: Default::default() }
    }

    /// One of them.
    pub(super) fn get(&self, pipe: Pipe) -> &wgpu::RenderPipeline {
        self.made[pipe as usize].get_or_init(|| self.make(pipe))
    }

    /// Compiles what a picture of a style needs, so that the first one need not wait for it.
    pub fn prepare(&self, style: &Style) {
        use Pipe::{Ball, Compose, Drop, Line, Linear, Mesh, Resolve, Shade, ShadowBall, ShadowMesh, Sprite};
        let fluid: &[Pipe] = match style.fluid {
            Fluid::Balls | Fluid::Points => &[Ball, ShadowBall],
            Fluid::Surface => &[Drop, Pipe::Thickness, Linear, Compose],
            Fluid::Sprites => &[Sprite, Pipe::ShadowSprite],
            Fluid::Hidden => &[],
        };
        [Mesh, ShadowMesh, Line, Shade, Resolve].iter().chain(fluid).for_each(|pipe| {
            self.get(*pipe);
        });
    }

    fn module(&self, index: usize) -> &wgpu::ShaderModule {
        let (label, text) = SHADERS[index];
        self.modules[index].get_or_init(|| {
            self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(label),
                source: wgpu::ShaderSource::Wgsl(format!("{COMMON}\n{text}").into()),
            })
        })
    }

    fn make(&self, pipe: Pipe) -> wgpu::RenderPipeline {
        let l = &self.layouts;
        let make = |recipe: Recipe| build(&self.device, self.module(recipe.module), &recipe);
        let surface = [(ALBEDO, None), (NORMAL, None)];
        let mesh_buffers = [
            Some(vertex_buffer(24, wgpu::VertexStepMode::Vertex, &MESH_VERTEX)),
            Some(vertex_buffer(4, wgpu::VertexStepMode::Instance, &MESH_INSTANCE)),
        ];
        let line_buffer = [Some(vertex_buffer(40, wgpu::VertexStepMode::Instance, &LINE))];
        let ball = |vertex, fragment, colors, depth| {
            let groups = &[&l.view, &l.particles];
            make(Recipe { module: 0, vertex, fragment, groups, strip: true, colors, depth, buffers: &[] })
        };
        let sprite = |fragment, colors| {
            let (vertex, groups) = ("square", &[&l.view, &l.particles, &l.sprite]);
            make(Recipe { module: 0, vertex, fragment, groups, strip: true, colors, depth: true, buffers: &[] })
        };
        let solid = |vertex, fragment, colors, strip, buffers| {
            let groups = &[&l.view, &l.particles, &l.poses];
            make(Recipe { module: 1, vertex, fragment, groups, strip, colors, depth: true, buffers })
        };
        let picture = |module, fragment, groups: &[&wgpu::BindGroupLayout], format| {
            let colors = &[(format, None)];
            let vertex = "picture";
            make(Recipe { module, vertex, fragment, groups, strip: false, colors, depth: false, buffers: &[] })
        };
        match pipe {
            Pipe::Ball => ball("ball", "shown", &surface, true),
            Pipe::Drop => ball("drop", "depth_alone", &[], true),
            Pipe::Thickness => ball("share", "thickness", &[(WATER, Some(ADD))], false),
            Pipe::ShadowBall => ball("ball", "disc", &[], true),
            Pipe::Sprite => sprite("textured", &surface),
            Pipe::ShadowSprite => sprite("silhouette", &[]),
            Pipe::Mesh => solid("mesh", "solid", &surface, false, &mesh_buffers),
            Pipe::ShadowMesh => solid("mesh", "nothing", &[], false, &mesh_buffers),
            Pipe::Dart => solid("dart", "solid", &surface, false, &[]),
            Pipe::ShadowDart => solid("dart", "nothing", &[], false, &[]),
            Pipe::Arrow => solid("arrow", "plain", &surface, false, &[]),
            Pipe::Line => solid("line", "plain", &surface, true, &line_buffer),
            Pipe::Shade => picture(2, "shade", &[&l.view, &l.shade], LIGHT),
            Pipe::Linear => picture(3, "linear", &[&l.view, &l.linear], FIELD),
            Pipe::Narrow => picture(3, "narrow", &[&l.view, &l.field, &l.way], FIELD),
            Pipe::Tidy => picture(3, "tidy", &[&l.view, &l.field], FIELD),
            Pipe::Bilateral => picture(3, "bilateral", &[&l.view, &l.field, &l.way], FIELD),
            Pipe::Flow => picture(3, "flow", &[&l.view, &l.field], FIELD),
            Pipe::Compose => picture(4, "compose", &[&l.view, &l.compose], LIGHT),
            Pipe::Resolve => picture(4, "resolve", &[&l.view, &l.resolve], self.target),
        }
    }
}

const MESH_VERTEX: [wgpu::VertexAttribute; 2] = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3];
const MESH_INSTANCE: [wgpu::VertexAttribute; 1] = wgpu::vertex_attr_array![2 => Uint32];
const LINE: [wgpu::VertexAttribute; 3] = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x4];

fn vertex_buffer(
    array_stride: u64,
    step_mode: wgpu::VertexStepMode,
    attributes: &[wgpu::VertexAttribute],
) -> wgpu::VertexBufferLayout<'_> {
    wgpu::VertexBufferLayout { array_stride, step_mode, attributes }
}

fn build(device: &wgpu::Device, module: &wgpu::ShaderModule, r: &Recipe) -> wgpu::RenderPipeline {
    let groups: Vec<_> = r.groups.iter().map(|g| Some(*g)).collect();
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(r.fragment),
        bind_group_layouts: &groups,
        immediate_size: 0,
    });
    let target = |&(format, blend): &(wgpu::TextureFormat, Option<wgpu::BlendState>)| {
        Some(wgpu::ColorTargetState { format, blend, write_mask: wgpu::ColorWrites::ALL })
    };
    let targets: Vec<_> = r.colors.iter().map(target).collect();
    let topology = if r.strip { wgpu::PrimitiveTopology::TriangleStrip } else { wgpu::PrimitiveTopology::TriangleList };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(r.fragment),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(r.vertex),
            compilation_options: Default::default(),
            buffers: r.buffers,
        },
        primitive: wgpu::PrimitiveState { topology, ..Default::default() },
        depth_stencil: r.depth.then(|| wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(r.fragment),
            compilation_options: Default::default(),
            targets: &targets,
        }),
        multiview_mask: None,
        cache: None,
    })
}
