//! Pictures by the GPU.
//!
//! In: a [`Show`] (how a scene is shown), particles in the simulation's own layout, poses and agents of a [`Frame`], a [`Camera`], a
//! [`Style`]. Out: a picture in any texture. Passes, in their order:
//!
//! 1. the sun's depths, and how much water it passes through (`particles.wgsl`, `solids.wgsl`);
//! 2. what the eye sees: colour, normal, depth; particles are balls found by the lines of sight;
//! 3. light: soft shadows, crevices, sky, ground (`shade.wgsl`);
//! 4. of water: the depths of its balls, smoothed to a surface (`smooth.wgsl`), and its thickness;
//! 5. water over the rest: refraction, absorption, reflection (`compose.wgsl`);
//! 6. samples averaged to pixels, encoded as sRGB.

mod buffers;
mod clock;
mod pipelines;
mod studio;
mod targets;
mod uniforms;

pub use clock::Times;
/// Particles as the GPU reads them: a simulation on the same device hands over its own buffers.
pub use jetsam::backend::OnDevice as Particles;
pub use pipelines::Pipelines;
pub use studio::Studio;

use crate::sprite::Sprite;
use crate::style::{Fluid, STEREO, Smoothing, Style};
use crate::{Camera, Frame, Line, Show};
use buffers::{Growing, Solid, Stroke};
use clock::Clock;
use pipelines::Pipe;
use targets::{Targets, VEIL};
use uniforms::{LookUniform, ViewUniform, light};
use wgpu::BufferUsages as Usage;

/// Where a picture goes: a texture, and the rectangle in it (x, y, width, height in pixels).
#[derive(Clone, Copy, Debug)]
pub struct Place<'a> {
    /// The texture, in the format the renderer was made for.
    pub target: &'a wgpu::TextureView,
    /// The rectangle.
    pub rect: [u32; 4],
    /// Whether the rest of the texture is cleared.
    pub clear: bool,
}

/// Draws frames. Works on any device; nothing is read back.
pub struct Renderer {
    device: wgpu::Device,
    queue: wgpu::Queue,
    pipelines: Pipelines,
    show: Show,
    targets: Option<Targets>,
    /// The sun's depths, and the edge of their map in texels.
    shadow: (wgpu::TextureView, u32),
    veil: wgpu::TextureView,
    compare: wgpu::Sampler,
    filter: wgpu::Sampler,
    /// The sprite on the device, once one was drawn.
    sprite: Option<(Sprite, wgpu::BindGroup)>,
    clock: Option<Clock>,
    /// The two eyes and the sun.
    views: [wgpu::Buffer; 3],
    look: wgpu::Buffer,
    ways: [wgpu::BindGroup; 2],
    resolve: [wgpu::Buffer; 2],
    /// Particles copied from the host, while the simulation does not lend its own.
    own: [Growing; 3],
    particles: Particles,
    owners: Growing,
    agents: [Growing; 3],
    agent_count: u32,
    poses: Growing,
    solids: Vec<Solid>,
    order: Growing,
    strokes: Growing,
    stroke_count: u32,
    style_of_owners: Option<crate::style::Bodies>,
    /// Rectangle and style of the last picture.
    last: Option<([u32; 4], Style)>,
}

impl Renderer {
    /// A renderer for a scene on the device of the pipelines.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, pipelines: Pipelines, show: Show) -> Self {
        let uniform = |label, size| {
            let usage = Usage::UNIFORM | Usage::COPY_DST;
            device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
        };
        let ways = [[1i32, 0, 0, 0], [0, 1, 0, 0]].map(|along| {
            let buffer = uniform("way", 16);
            queue.write_buffer(&buffer, 0, bytemuck::bytes_of(&along));
            group(device, &pipelines.layouts.way, &[(0, buffer.as_entire_binding())])
        });
        let sampler = |compare, filter| {
            device.create_sampler(&wgpu::SamplerDescriptor {
                mag_filter: filter,
                min_filter: filter,
                mipmap_filter: wgpu::MipmapFilterMode::Linear,
                compare,
                ..Default::default()
            })
        };
        let storage = |label| Growing::new(device, label, Usage::STORAGE);
        let own = [storage("record"), storage("push"), storage("tag")];
        let particles = lent(&own, [0; 3], [0; 3]);
        let mut renderer = Self {
            targets: None,
            shadow: (targets::texture(device, "shadow", [16; 2], targets::DEPTH), 16),
            veil: targets::texture(device, "veil", [VEIL; 2], targets::WATER),
            compare: sampler(Some(wgpu::CompareFunction::Greater), wgpu::FilterMode::Linear),
            filter: sampler(None, wgpu::FilterMode::Linear),
            sprite: None,
            clock: None,
            views: [(); 3].map(|()| uniform("view", size_of::<ViewUniform>() as u64)),
            look: uniform("look", size_of::<LookUniform>() as u64),
            ways,
            resolve: [(); 2].map(|()| uniform("resolve", 16)),
            own,
            particles,
            owners: storage("owners"),
            agents: [storage("agents"), storage("flock of agents"), storage("flocks")],
            agent_count: 0,
            poses: storage("poses"),
            solids: Vec::new(),
            order: Growing::new(device, "bodies by mesh", Usage::VERTEX),
            strokes: Growing::new(device, "lines", Usage::VERTEX),
            stroke_count: 0,
            style_of_owners: None,
            last: None,
            show: show.clone(),
            device: device.clone(),
            queue: queue.clone(),
            pipelines,
        };
        renderer.set_show(show);
        renderer
    }

    /// Another scene, or the same with other bodies.
    pub fn set_show(&mut self, show: Show) {
        let (device, queue) = (&self.device, &self.queue);
        let (solids, order) = buffers::solids(device, queue, &show);
        self.solids = solids;
        self.order.fill(device, queue, &order);
        let (looks, tags) = buffers::flocks(&show);
        self.agents[1].fill(device, queue, &tags);
        self.agents[2].fill(device, queue, &looks);
        self.style_of_owners = None;
        self.agent_count = 0;
        self.particles.count = [0; 3];
        self.show = show;
    }

    /// How the scene is shown.
    pub fn show(&self) -> &Show {
        &self.show
    }

    /// A frame: its particles come from the host, unless they are lent.
    pub fn load(&mut self, frame: &Frame) {
        if let Some(lent) = &frame.lent {
            return self.borrow(lent.clone(), frame);
        }
        let (device, queue) = (&self.device, &self.queue);
        self.own[0].fill(device, queue, &frame.record);
        self.own[1].fill(device, queue, &frame.push);
        self.own[2].fill(device, queue, &frame.tag);
        self.particles = lent(&self.own, frame.first, frame.count);
        self.load_bodies(frame);
    }

    /// A frame whose particles are in the simulation's own buffers on this device: nothing is copied. Of `frame`, poses and agents
    /// are taken.
    pub fn borrow(&mut self, particles: Particles, frame: &Frame) {
        self.particles = particles;
        self.load_bodies(frame);
    }

    fn load_bodies(&mut self, frame: &Frame) {
        let (device, queue) = (&self.device, &self.queue);
        self.poses.fill(device, queue, &buffers::poses(&self.show, frame));
        self.agents[0].fill(device, queue, &frame.agents);
        let known = self.show.flocks.iter().map(|f| f.range.end).max().unwrap_or(0);
        self.agent_count = frame.agents.len().min(known) as u32;
    }

    /// Draws the loaded frame. `lines` are drawn besides the edges of the domain, two pixels wide.
    pub fn draw(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        place: Place,
        camera: &Camera,
        style: &Style,
        lines: &[Line],
    ) {
        let stereo = style.stereo > 0.0;
        let [x, y, width, height] = place.rect;
        let eye_width = if stereo { (width / 2).max(1) } else { width };
        let size = [eye_width, height].map(|s| s.div_ceil(style.coarse) * style.samples);
        if self.targets.as_ref().is_none_or(|t| t.size != size) {
            self.targets = Some(Targets::new(&self.device, size));
        }
        if self.shadow.1 != style.shadow_size {
            let texels = style.shadow_size;
            self.shadow = (targets::texture(&self.device, "shadow", [texels; 2], targets::DEPTH), texels);
        }
        self.prepare(style, lines);
        let aside = 0.5 * STEREO * style.stereo * camera.eye.distance(camera.target);
        let points = if style.fluid == Fluid::Points { 1.5 * style.samples as f32 } else { 0.0 };
        let eyes: &[f32] = if stereo { &[-1.0, 1.0] } else { &[0.0] };
        self.clock.iter().for_each(Clock::begin);
        self.sun_pass(encoder, style);
        for (k, side) in eyes.iter().enumerate() {
            let view = ViewUniform::eye(camera, size, side * aside, points);
            self.queue.write_buffer(&self.views[k], 0, bytemuck::bytes_of(&view));
            let rect = [x + k as u32 * eye_width, y, eye_width, height];
            self.eye_passes(encoder, k, style);
            self.resolve_pass(encoder, Place { rect, clear: place.clear && k == 0, ..place }, k, style);
        }
        self.clock.iter().for_each(|clock| clock.end(encoder));
        self.last = (!stereo).then(|| (place.rect, style.clone()));
    }

    /// Puts the last picture to its place once more. False when there is none of that size, or it was two pictures.
    pub fn again(&self, encoder: &mut wgpu::CommandEncoder, place: Place) -> bool {
        let Some((rect, style)) = self.last.as_ref().filter(|(rect, _)| *rect == place.rect) else { return false };
        self.resolve_pass(encoder, Place { rect: *rect, ..place }, 0, style);
        true
    }

    /// From now on passes are timed, where the device has a clock. Whether it has.
    pub fn time_passes(&mut self) -> bool {
        self.clock = self.clock.take().or_else(|| Clock::new(&self.device, &self.queue));
        self.clock.is_some()
    }

    /// How long the last picture took, once it was submitted and if passes are timed; waits for it.
    pub fn times(&self) -> Option<Times> {
        self.clock.as_ref()?.read(&self.device)
    }

    /// Writes what all passes of a picture read.
    fn prepare(&mut self, style: &Style, lines: &[Line]) {
        let (device, queue) = (&self.device, &self.queue);
        if self.style_of_owners != Some(style.bodies) {
            self.owners.fill(device, queue, &buffers::owners(&self.show, style.bodies));
            self.style_of_owners = Some(style.bodies);
        }
        let first = [self.particles.first[1], self.particles.first[2]];
        let look = LookUniform::new(&self.show, style, first);
        queue.write_buffer(&self.look, 0, bytemuck::bytes_of(&look));
        let sun = ViewUniform::sun(self.show.bounds[0], self.show.bounds[1], light(), style.shadow_size);
        queue.write_buffer(&self.views[2], 0, bytemuck::bytes_of(&sun));
        if style.fluid == Fluid::Sprites && self.sprite.as_ref().is_none_or(|(known, _)| *known != style.sprite) {
            let texels = buffers::sprite(device, queue, &style.sprite);
            let entries = [(0, texture(&texels)), (1, wgpu::BindingResource::Sampler(&self.filter))];
            self.sprite = Some((style.sprite.clone(), group(device, &self.pipelines.layouts.sprite, &entries)));
        }
        let edges: &[Line] = if style.edges { &self.show.edges } else { &[] };
        let width = 1.2 * style.samples as f32;
        let mut strokes: Vec<Stroke> = edges.iter().map(|l| Stroke::new(l, width)).collect();
        strokes.extend(lines.iter().map(|l| Stroke::new(l, width)));
        self.stroke_count = strokes.len() as u32;
        self.strokes.fill(device, queue, &strokes);
    }

    fn view_group(&self, k: usize) -> wgpu::BindGroup {
        let entries = [(0, self.views[k].as_entire_binding()), (1, self.look.as_entire_binding())];
        group(&self.device, &self.pipelines.layouts.view, &entries)
    }

    fn particle_group(&self) -> wgpu::BindGroup {
        let p = &self.particles;
        let parts = [&p.record, &p.push, &p.tag, &self.owners.buffer];
        let entries: Vec<_> = (0..).zip(parts.map(|b| b.as_entire_binding())).collect();
        group(&self.device, &self.pipelines.layouts.particles, &entries)
    }

    fn agent_group(&self) -> wgpu::BindGroup {
        let [records, tags, looks] = &self.agents;
        let parts = [&records.buffer, &records.buffer, &tags.buffer, &looks.buffer];
        let entries: Vec<_> = (0..).zip(parts.map(|b| b.as_entire_binding())).collect();
        group(&self.device, &self.pipelines.layouts.particles, &entries)
    }

    fn pose_group(&self) -> wgpu::BindGroup {
        group(&self.device, &self.pipelines.layouts.poses, &[(0, self.poses.buffer.as_entire_binding())])
    }

    /// The particles of a kind as instances.
    fn range(&self, kind: usize) -> std::ops::Range<u32> {
        let first = self.particles.first[kind];
        first..first + self.particles.count[kind]
    }

    /// Whether any particle of a kind is drawn as a ball.
    fn any_balls(&self, style: &Style, fixed: bool) -> bool {
        use crate::show::Form;
        self.show.bodies.iter().any(|look| match look.form {
            Form::Hidden => false,
            Form::Balls => look.fixed == fixed,
            Form::Mesh(_) => look.fixed == fixed && style.bodies == crate::style::Bodies::Particles,
        })
    }

    /// Balls of the kinds that are drawn so.
    fn draw_balls(&self, pass: &mut wgpu::RenderPass, pipe: Pipe, style: &Style) {
        // bodies that follow a script stand with the rigid ones
        let drawn = [
            matches!(style.fluid, Fluid::Balls | Fluid::Points),
            self.any_balls(style, false),
            self.any_balls(style, true),
        ];
        for kind in (0..3).filter(|&kind| drawn[kind]) {
            pass.set_pipeline(self.pipelines.get(pipe));
            pass.draw(0..4, self.range(kind));
        }
    }

    /// The fluid as sprites. The third group is theirs then.
    fn draw_sprites(&self, pass: &mut wgpu::RenderPass, pipe: Pipe, style: &Style) {
        if let (Fluid::Sprites, Some((_, texels))) = (style.fluid, &self.sprite) {
            pass.set_pipeline(self.pipelines.get(pipe));
            pass.set_bind_group(2, texels, &[]);
            pass.draw(0..4, self.range(0));
        }
    }

    fn draw_meshes(&self, pass: &mut wgpu::RenderPass, pipe: Pipe, style: &Style) {
        if style.bodies == crate::style::Bodies::Particles {
            return;
        }
        for solid in self.solids.iter().filter(|s| !s.is_empty()) {
            pass.set_pipeline(self.pipelines.get(pipe));
            pass.set_vertex_buffer(0, solid.vertices.slice(..));
            pass.set_vertex_buffer(1, self.order.buffer.slice(..));
            pass.draw(0..solid.count, solid.instances.clone());
        }
    }

    /// What the sun sees.
    fn sun_pass(&self, encoder: &mut wgpu::CommandEncoder, style: &Style) {
        let (view, particles) = (self.view_group(2), self.particle_group());
        {
            let mut pass = self.begin(encoder, "sun", &[], Some((&self.shadow.0, 0.0)));
            if style.shadows {
                pass.set_bind_group(0, &view, &[]);
                pass.set_bind_group(1, &particles, &[]);
                self.draw_balls(&mut pass, Pipe::ShadowBall, style);
                self.draw_sprites(&mut pass, Pipe::ShadowSprite, style);
                pass.set_bind_group(2, &self.pose_group(), &[]);
                self.draw_meshes(&mut pass, Pipe::ShadowMesh, style);
                if self.agent_count > 0 {
                    pass.set_bind_group(1, &self.agent_group(), &[]);
                    pass.set_pipeline(self.pipelines.get(Pipe::ShadowDart));
                    pass.draw(0..24, 0..self.agent_count);
                }
            }
        }
        let mut pass = self.begin(encoder, "veil", &[(&self.veil, [0.0; 4])], None);
        if style.shadows && style.fluid == Fluid::Surface {
            pass.set_bind_group(0, &view, &[]);
            pass.set_bind_group(1, &particles, &[]);
            pass.set_pipeline(self.pipelines.get(Pipe::Thickness));
            pass.draw(0..4, self.range(0));
        }
    }

    /// All that one eye sees, up to the whole picture.
    fn eye_passes(&self, encoder: &mut wgpu::CommandEncoder, eye: usize, style: &Style) {
        let t = self.targets.as_ref().expect("`draw` made them");
        let (view, particles) = (self.view_group(eye), self.particle_group());
        {
            let colors = [(&t.albedo, [0.0; 4]), (&t.normal, [0.0; 4])];
            let mut pass = self.begin(encoder, "seen", &colors, Some((&t.depth, 0.0)));
            pass.set_bind_group(0, &view, &[]);
            pass.set_bind_group(1, &particles, &[]);
            let poses = self.pose_group();
            pass.set_bind_group(2, &poses, &[]);
            // large things first: they hide much
            self.draw_meshes(&mut pass, Pipe::Mesh, style);
            self.draw_balls(&mut pass, Pipe::Ball, style);
            self.draw_sprites(&mut pass, Pipe::Sprite, style);
            pass.set_bind_group(2, &poses, &[]);
            if style.arrows > 0.0 {
                pass.set_pipeline(self.pipelines.get(Pipe::Arrow));
                pass.draw(0..9, self.range(0));
                pass.draw(0..9, self.range(1));
            }
            if self.stroke_count > 0 {
                pass.set_pipeline(self.pipelines.get(Pipe::Line));
                pass.set_vertex_buffer(0, self.strokes.buffer.slice(..));
                pass.draw(0..4, 0..self.stroke_count);
            }
            if self.agent_count > 0 {
                pass.set_bind_group(1, &self.agent_group(), &[]);
                pass.set_pipeline(self.pipelines.get(Pipe::Dart));
                pass.draw(0..24, 0..self.agent_count);
            }
        }
        let shade = group(
            &self.device,
            &self.pipelines.layouts.shade,
            &[
                (0, texture(&t.albedo)),
                (1, texture(&t.normal)),
                (2, texture(&t.depth)),
                (3, texture(&self.shadow.0)),
                (4, wgpu::BindingResource::Sampler(&self.compare)),
                (5, self.views[2].as_entire_binding()),
                (6, texture(&self.veil)),
                (7, wgpu::BindingResource::Sampler(&self.filter)),
            ],
        );
        self.picture(encoder, "shade", self.pipelines.get(Pipe::Shade), &[&view, &shade], &t.scene);
        if style.fluid == Fluid::Surface {
            self.water_passes(encoder, t, &view, &particles, style);
        }
    }

    /// Water: surface, thickness, and both over the rest.
    fn water_passes(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        t: &Targets,
        view: &wgpu::BindGroup,
        particles: &wgpu::BindGroup,
        style: &Style,
    ) {
        {
            let mut pass = self.begin(encoder, "fluid depth", &[], Some((&t.fluid_depth, 0.0)));
            pass.set_bind_group(0, view, &[]);
            pass.set_bind_group(1, particles, &[]);
            pass.set_pipeline(self.pipelines.get(Pipe::Drop));
            pass.draw(0..4, self.range(0));
        }
        {
            let mut pass = self.begin(encoder, "thickness", &[(&t.thickness, [0.0; 4])], None);
            pass.set_bind_group(0, view, &[]);
            pass.set_bind_group(1, particles, &[]);
            pass.set_pipeline(self.pipelines.get(Pipe::Thickness));
            pass.draw(0..4, self.range(0));
        }
        let linear = group(&self.device, &self.pipelines.layouts.linear, &[(0, texture(&t.fluid_depth))]);
        self.picture(encoder, "linear", self.pipelines.get(Pipe::Linear), &[view, &linear], &t.field[0]);
        let fields = [0, 1].map(|k| group(&self.device, &self.pipelines.layouts.field, &[(1, texture(&t.field[k]))]));
        let mut now = 0;
        let mut step = |pipeline: &wgpu::RenderPipeline, way: Option<&wgpu::BindGroup>| {
            let mut groups = vec![view, &fields[now]];
            groups.extend(way);
            self.picture(encoder, "smooth", pipeline, &groups, &t.field[1 - now]);
            now = 1 - now;
        };
        match style.smoothing {
            Smoothing::None => {}
            Smoothing::NarrowRange | Smoothing::Bilateral => {
                let narrow = style.smoothing == Smoothing::NarrowRange;
                let pipeline = self.pipelines.get(if narrow { Pipe::Narrow } else { Pipe::Bilateral });
                for _ in 0..style.passes {
                    self.ways.iter().for_each(|way| step(pipeline, Some(way)));
                }
                if narrow {
                    step(self.pipelines.get(Pipe::Tidy), None);
                }
            }
            // many small steps
            Smoothing::CurvatureFlow => (0..20 * style.passes).for_each(|_| step(self.pipelines.get(Pipe::Flow), None)),
        }
        let compose = group(
            &self.device,
            &self.pipelines.layouts.compose,
            &[
                (0, texture(&t.scene)),
                (1, texture(&t.field[now])),
                (2, texture(&t.thickness)),
                (3, wgpu::BindingResource::Sampler(&self.filter)),
            ],
        );
        self.picture(encoder, "compose", self.pipelines.get(Pipe::Compose), &[view, &compose], &t.whole);
    }

    /// A pass over all pixels.
    fn picture(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        label: &'static str,
        pipeline: &wgpu::RenderPipeline,
        groups: &[&wgpu::BindGroup],
        to: &wgpu::TextureView,
    ) {
        let mut pass = self.begin(encoder, label, &[(to, [0.0; 4])], None);
        pass.set_pipeline(pipeline);
        for (k, group) in (0..).zip(groups) {
            pass.set_bind_group(k, *group, &[]);
        }
        pass.draw(0..3, 0..1);
    }

    /// From samples to the pixels of the target's rectangle.
    fn resolve_pass(&self, encoder: &mut wgpu::CommandEncoder, place: Place, eye: usize, style: &Style) {
        let t = self.targets.as_ref().expect("`draw` made them");
        let [x, y, width, height] = place.rect;
        let to = [x as f32, y as f32, style.samples as f32, style.coarse as f32];
        self.queue.write_buffer(&self.resolve[eye], 0, bytemuck::bytes_of(&to));
        let whole = if style.fluid == Fluid::Surface { &t.whole } else { &t.scene };
        let entries = [(0, texture(whole)), (4, self.resolve[eye].as_entire_binding())];
        let resolve = group(&self.device, &self.pipelines.layouts.resolve, &entries);
        let load = if place.clear { wgpu::LoadOp::Clear(wgpu::Color::BLACK) } else { wgpu::LoadOp::Load };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("resolve"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: place.target,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load, store: wgpu::StoreOp::Store },
            })],
            timestamp_writes: self.clock.as_ref().and_then(|clock| clock.pass("resolve")),
            ..Default::default()
        });
        pass.set_viewport(x as f32, y as f32, width as f32, height as f32, 0.0, 1.0);
        pass.set_scissor_rect(x, y, width, height);
        pass.set_pipeline(self.pipelines.get(Pipe::Resolve));
        pass.set_bind_group(0, &self.view_group(eye), &[]);
        pass.set_bind_group(1, &resolve, &[]);
        pass.draw(0..3, 0..1);
    }

    /// Begins a pass that clears what it draws to.
    fn begin<'e>(
        &self,
        encoder: &'e mut wgpu::CommandEncoder,
        label: &'static str,
        colors: &[(&wgpu::TextureView, [f64; 4])],
        depth: Option<(&wgpu::TextureView, f32)>,
    ) -> wgpu::RenderPass<'e> {
        let attached: Vec<_> = colors
            .iter()
            .map(|&(view, [r, g, b, a])| {
                let load = wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a });
                let ops = wgpu::Operations { load, store: wgpu::StoreOp::Store };
                Some(wgpu::RenderPassColorAttachment { view, depth_slice: None, resolve_target: None, ops })
            })
            .collect();
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(label),
            color_attachments: &attached,
            depth_stencil_attachment: depth.map(|(view, clear)| wgpu::RenderPassDepthStencilAttachment {
                view,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(clear), store: wgpu::StoreOp::Store }),
                stencil_ops: None,
            }),
            timestamp_writes: self.clock.as_ref().and_then(|clock| clock.pass(label)),
            occlusion_query_set: None,
            multiview_mask: None,
        })
    }
}

/// The buffers copied from the host as if the simulation lent them.
fn lent(own: &[Growing; 3], first: [u32; 3], count: [u32; 3]) -> Particles {
    let [record, push, tag] = own.each_ref().map(|g| g.buffer.clone());
    Particles { record, push, tag, first, count }
}

fn texture(view: &wgpu::TextureView) -> wgpu::BindingResource<'_> {
    wgpu::BindingResource::TextureView(view)
}

fn group(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    entries: &[(u32, wgpu::BindingResource)],
) -> wgpu::BindGroup {
    let entries: Vec<_> = entries
        .iter()
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding: *binding, resource: resource.clone() })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}
