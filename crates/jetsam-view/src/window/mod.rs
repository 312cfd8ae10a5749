//! The live window: a simulation on its own thread, its picture, panels around it, a hand in it.
//!
//! [`open`] runs until the window is closed. One device serves picture and panels. While nothing changes, nothing is drawn.

mod fields;
mod fly;
mod graphs;
mod hand;
mod panels;
mod sim;

use crate::gpu::{Pipelines, Place, Renderer};
use crate::style::{ColorBy, Fluid};
use crate::{Camera, Curves, Frame, Style};
use egui_wgpu::{RendererOptions, ScreenDescriptor};
use glam::{Vec2, Vec3, vec2};
use hand::{Held, Ray, Tool};
use jetsam::Scene;
use jetsam::gpu::{Gpu, GpuError, instance};
use panels::{Panels, Wish, opened};
use sim::{Order, Sim};
use std::collections::HashSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};
use winit::application::ApplicationHandler;
use winit::event::{ElementState, MouseButton, MouseScrollDelta, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::keyboard::{KeyCode, PhysicalKey};
use winit::window::{Window, WindowId};

/// What the window begins with.
#[derive(Clone, Debug)]
pub struct Options {
    /// Name of the scene.
    pub name: String,
    /// The scene.
    pub scene: Scene,
    /// Whether it runs at once.
    pub playing: bool,
    /// What computes. A GPU is the one that draws.
    pub backend: jetsam::Choice,
    /// How it looks.
    pub style: Style,
}

/// Why there is no window.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum WindowError {
    /// No display, or one that refuses.
    #[error("no window could be opened: {0}")]
    #[diagnostic(help("a window needs a display (X11, Wayland, macOS or Windows); `jetsam run` needs none"))]
    Display(String),
    /// No device that can draw in it.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Gpu(#[from] GpuError),
}

/// Whether there is a display to open a window on.
pub fn has_display() -> bool {
    let named = |name| std::env::var_os(name).is_some_and(|v| !v.is_empty());
    cfg!(any(windows, target_os = "macos")) || named("DISPLAY") || named("WAYLAND_DISPLAY")
}

/// Opens the window; returns when it is closed. With `JETSAM_TIMES` in the environment, stderr says when window, device,
/// pipelines, world and the first picture were there.
///
/// # Errors
/// No display, or no device that can draw in its window.
pub fn open(options: Options) -> Result<(), WindowError> {
    let refused = |e: &dyn std::fmt::Display| WindowError::Display(e.to_string());
    let event_loop = EventLoop::<()>::with_user_event().build().map_err(|e| refused(&e))?;
    let proxy = event_loop.create_proxy();
    let mut app = App { start: Instant::now(), proxy, options: Some(options), live: None, failed: None };
    event_loop.run_app(&mut app).map_err(|e| refused(&e))?;
    app.failed.map_or(Ok(()), Err)
}

/// A number with three digits that count.
fn number(x: f64) -> String {
    crate::number(x as f32)
}

/// How long something took since the start, for those who asked for times.
fn tell_time(what: &str, start: Instant) {
    if std::env::var_os("JETSAM_TIMES").is_some() {
        eprintln!("{what} after {:.2} s", start.elapsed().as_secs_f64());
    }
}

struct App {
    start: Instant,
    proxy: EventLoopProxy<()>,
    options: Option<Options>,
    live: Option<Live>,
    failed: Option<WindowError>,
}

impl ApplicationHandler<()> for App {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        let Some(options) = self.options.take() else { return };
        match Live::new(event_loop, self.proxy.clone(), options, self.start) {
            Ok(live) => self.live = Some(live),
            Err(e) => {
                self.failed = Some(e);
                event_loop.exit();
            }
        }
    }

    fn user_event(&mut self, _: &ActiveEventLoop, (): ()) {
        self.live.iter_mut().for_each(|live| live.stale = true);
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(live) = &mut self.live else { return };
        match event {
            WindowEvent::CloseRequested => event_loop.exit(),
            WindowEvent::RedrawRequested => {
                if let Err(e) = live.redraw() {
                    self.failed = Some(e);
                    event_loop.exit();
                }
            }
            event => live.event(event),
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        if let Some(live) = &mut self.live {
            event_loop.set_control_flow(live.next());
        }
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        self.live = None;
    }
}

/// The open window.
struct Live {
    start: Instant,
    window: Arc<Window>,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    gpu: Gpu,
    renderer: Option<Renderer>,
    /// Those of the first style, compiled while the world is built.
    pipelines: Option<Pipelines>,
    /// The simulation begins to run once its first moment is seen: until then the processor has enough to do.
    begin: bool,
    egui: egui_winit::State,
    paint: egui_wgpu::Renderer,
    sim: Sim,
    panels: Panels,
    frame: Frame,
    serial: u64,
    camera: Camera,
    curves: Curves,
    /// Whether the simulation was asked to bring the particles home.
    at_home: bool,
    mouse: Mouse,
    keys: HashSet<KeyCode>,
    control: bool,
    /// The panels are out of date.
    fresh: bool,
    /// So is the picture: there is something new from the simulation, or it is seen in another way.
    stale: bool,
    egui_wants: Option<Instant>,
    /// When a fine picture is drawn, unless something happens before; whether the next one is.
    fine: Option<Instant>,
    resting: bool,
    pacer: Pacer,
    flown: Instant,
    title: String,
}

/// The mouse over the picture.
#[derive(Default)]
struct Mouse {
    /// In pixels of the window.
    place: Vec2,
    drag: Option<Drag>,
    held: Option<Held>,
    /// The picture in the window, in pixels.
    rect: [u32; 4],
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Drag {
    Orbit,
    Look,
    Pan,
    Hold,
    Pour,
    Scare,
}

/// Lets pictures take no more than half the time where they are drawn by the processor that also simulates, and draws less where
/// pictures are late.
struct Pacer {
    drawing: Arc<AtomicBool>,
    took_us: Arc<AtomicU64>,
    began: Instant,
    /// Rate of pictures.
    counted: (Instant, u32),
    /// 0 everything, 3 least.
    thrift: u32,
    late: u32,
}

/// A picture that takes longer than this (ms) is late; much less than it is early.
const LATE: f64 = 45.0;

/// All is quiet when nothing has happened for about this long.
const QUIET: Duration = Duration::from_millis(250);

impl Pacer {
    fn new(software: bool) -> Self {
        Self {
            drawing: Arc::default(),
            took_us: Arc::default(),
            began: Instant::now(),
            counted: (Instant::now(), 0),
            thrift: if software { 2 } else { 0 },
            late: 0,
        }
    }

    fn took(&self) -> Duration {
        Duration::from_micros(self.took_us.load(Relaxed))
    }

    /// When the next picture may begin.
    fn ready(&self) -> Instant {
        let took = self.took();
        self.began + if took > Duration::from_millis(20) { 2 * took } else { took }
    }

    fn begin(&mut self, queue: &wgpu::Queue, picture: bool, rests: bool) {
        let (drawing, took_us, began) = (self.drawing.clone(), self.took_us.clone(), Instant::now());
        drawing.store(true, Relaxed);
        if !picture {
            return queue.on_submitted_work_done(move || drawing.store(false, Relaxed));
        }
        self.began = began;
        self.counted.1 += 1;
        queue.on_submitted_work_done(move || {
            took_us.store(began.elapsed().as_micros() as u64, Relaxed);
            drawing.store(false, Relaxed);
        });
        let ms = 1e3 * self.took().as_secs_f64();
        if rests {
            return;
        }
        self.late = if ms > LATE { self.late + 1 } else { 0 };
        if self.late > 2 && self.thrift < 3 {
            (self.thrift, self.late) = (self.thrift + 1, 0);
        }
    }

    /// The style with less of what costs most. Of a world that rests there is time for a fine picture.
    fn thrifty(&self, style: &Style, rests: bool) -> Style {
        let mut style = style.clone();
        if rests {
            // but it must not keep the user waiting
            if self.took() > Duration::from_millis(150) {
                (style.samples, style.shadow_size) = (1, 1024);
            }
            return style;
        }
        if self.thrift >= 1 {
            style.samples = 1;
        }
        if self.thrift >= 2 {
            (style.crevices, style.shadow_size) = (0, 1024);
        }
        if self.thrift >= 3 {
            style.coarse = 2;
        }
        style
    }
}

impl Live {
    fn new(
        event_loop: &ActiveEventLoop,
        proxy: EventLoopProxy<()>,
        options: Options,
        start: Instant,
    ) -> Result<Self, WindowError> {
        let refused = |e: &dyn std::fmt::Display| WindowError::Display(e.to_string());
        // the world is built while the window opens
        let wake = move || {
            let _ = proxy.send_event(());
        };
        let (device, received) = std::sync::mpsc::channel();
        let on = (options.backend, received);
        let sim = Sim::start(options.name, options.scene, false, on, wake).map_err(|e| refused(&e))?;
        let size = winit::dpi::LogicalSize::new(1440.0, 860.0);
        let attributes = Window::default_attributes().with_title("jetsam").with_inner_size(size);
        let window = Arc::new(event_loop.create_window(attributes).map_err(|e| refused(&e))?);
        tell_time("window", start);
        let instance = instance();
        let surface = instance.create_surface(window.clone()).map_err(|e| refused(&e))?;
        let (gpu, capabilities) = Gpu::open_for(&instance, &surface)?;
        tell_time("device", start);
        // one that computes nothing does not listen
        let _ = device.send(gpu.clone());
        let plain = capabilities.formats.iter().find(|f| !f.is_srgb() && f.components() == 4);
        let format = *plain.unwrap_or(&capabilities.formats[0]);
        let size = window.inner_size();
        let mut config = wgpu::SurfaceConfiguration {
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
            format,
            color_space: Default::default(),
            width: size.width.max(1),
            height: size.height.max(1),
            present_mode: wgpu::PresentMode::AutoVsync,
            desired_maximum_frame_latency: 2,
            alpha_mode: capabilities.alpha_modes[0],
            view_formats: Vec::new(),
        };
        config.alpha_mode = wgpu::CompositeAlphaMode::Auto;
        let pipelines = gpu.attempt(|| {
            surface.configure(&gpu.device, &config);
            let pipelines = Pipelines::new(&gpu.device, format);
            pipelines.prepare(&options.style);
            Ok(Some(pipelines))
        })?;
        tell_time("pipelines", start);
        let context = egui::Context::default();
        let side = gpu.device.limits().max_texture_dimension_2d as usize;
        let egui = egui_winit::State::new(context, egui::ViewportId::ROOT, &window, None, None, Some(side));
        let paint = egui_wgpu::Renderer::new(&gpu.device, format, RendererOptions::default());
        let camera = Camera { eye: Vec3::NEG_Y, target: Vec3::ZERO, up: Vec3::Z, fov_y: 0.6 };
        let pacer = Pacer::new(!gpu.info.is_hardware());
        let mut panels = Panels::new();
        panels.style = options.style;
        Ok(Self {
            start,
            window,
            surface,
            config,
            gpu,
            renderer: None,
            pipelines,
            begin: options.playing,
            egui,
            paint,
            sim,
            panels,
            frame: Frame::default(),
            serial: 0,
            camera,
            curves: Curves::default(),
            at_home: false,
            mouse: Mouse::default(),
            keys: HashSet::new(),
            control: false,
            fresh: true,
            stale: true,
            egui_wants: None,
            fine: None,
            resting: false,
            pacer,
            flown: Instant::now(),
            title: String::new(),
        })
    }

    /// When to wake up next; asks for a redraw when one is due. Panels are redrawn at once, pictures when the pacer lets them.
    fn next(&mut self) -> ControlFlow {
        let _ = self.gpu.device.poll(wgpu::PollType::Poll);
        let now = Instant::now();
        if self.pacer.drawing.load(Relaxed) {
            return ControlFlow::WaitUntil(now + Duration::from_millis(2));
        }
        self.stale |= self.flying();
        let due = |at: Instant| at <= now;
        let fine = self.fine.filter(|_| !self.panels.playing && !self.stale);
        self.resting = fine.is_some_and(due);
        let picture = self.stale && due(self.pacer.ready());
        if self.fresh || picture || self.resting || self.egui_wants.is_some_and(due) {
            self.window.request_redraw();
            return ControlFlow::Wait;
        }
        let ready = self.stale.then(|| self.pacer.ready());
        match ready.into_iter().chain(self.egui_wants).chain(fine).min() {
            Some(at) => ControlFlow::WaitUntil(at),
            None => ControlFlow::Wait,
        }
    }

    fn flying(&self) -> bool {
        use KeyCode::{KeyA, KeyD, KeyE, KeyQ, KeyS, KeyW};
        self.panels.fly && [KeyA, KeyD, KeyE, KeyQ, KeyS, KeyW].iter().any(|k| self.keys.contains(k))
    }

    /// Takes the newest moment from the simulation.
    fn look(&mut self) {
        let mut shown = self.sim.shown();
        self.panels.note(&shown);
        if let Some(scene) = shown.scene.take() {
            let search = std::mem::take(&mut self.panels.fields.search);
            self.panels.fields = fields::Fields::of(&scene, search);
        }
        if let Some((show, home)) = shown.show.take() {
            if home {
                self.camera = show.camera;
            }
            self.mouse.held = None;
            self.curves.clear();
            match &mut self.renderer {
                Some(renderer) => renderer.set_show(show),
                None => {
                    tell_time("world", self.start);
                    let (device, queue) = (&self.gpu.device, &self.gpu.queue);
                    let pipelines = self.pipelines.take();
                    let pipelines = pipelines.unwrap_or_else(|| Pipelines::new(device, self.config.format));
                    self.renderer = Some(Renderer::new(device, queue, pipelines, show));
                }
            }
        } else if shown.serial == self.serial {
            return;
        }
        self.serial = shown.serial;
        std::mem::swap(&mut self.frame, &mut shown.frame);
        drop(shown);
        if let Some(renderer) = &mut self.renderer {
            renderer.load(&self.frame);
        }
        self.curves.note(&self.frame, &self.panels.style);
    }

    fn redraw(&mut self) -> Result<(), WindowError> {
        self.fresh = false;
        let look = self.resting || self.stale && Instant::now() >= self.pacer.ready();
        if look {
            self.look();
            self.fly();
            // a coarse picture is followed by a fine one when all is quiet
            let soon = Instant::now() + 2 * self.pacer.took().max(QUIET);
            self.fine = (!self.resting && self.pacer.thrift > 0).then_some(soon);
            self.stale = false;
        } else {
            let shown = self.sim.shown();
            self.panels.note(&shown);
        }
        let input = self.egui.take_egui_input(&self.window);
        let context = self.egui.egui_ctx().clone();
        let (mut orders, mut wish, mut rect) = (Vec::new(), None, egui::Rect::NOTHING);
        let style = self.panels.style.clone();
        let (panels, renderer) = (&mut self.panels, &self.renderer);
        let output = context.run_ui(input, |ui| {
            wish = panels.ui(ui, &mut orders);
            rect = ui.available_rect_before_wrap();
            if let Some(renderer) = renderer {
                panels::legend(ui, rect, renderer.show(), &panels.style);
                panels::headline(ui, rect, panels);
            }
        });
        if self.panels.style.at_home() != self.at_home {
            self.at_home = !self.at_home;
            orders.push(Order::Home(self.at_home));
        }
        orders.into_iter().for_each(|order| self.sim.order(order));
        if let (Some(Wish::Home), Some(renderer)) = (wish, &self.renderer) {
            self.camera = renderer.show().camera;
            self.stale = true;
        }
        self.egui.handle_platform_output(&self.window, output.platform_output);
        let wait = output.viewport_output.get(&egui::ViewportId::ROOT).map(|v| v.repaint_delay);
        self.egui_wants = wait.and_then(|delay| Instant::now().checked_add(delay));
        let scale = output.pixels_per_point;
        let rect = self.picture_rect(rect, scale);
        // of another place or look the picture is drawn at once
        let changed = rect != self.mouse.rect || style != self.panels.style;
        self.mouse.rect = rect;
        let primitives = context.tessellate(output.shapes, scale);
        self.present(&primitives, &output.textures_delta, scale, look || changed)?;
        if self.renderer.is_some() && std::mem::take(&mut self.begin) {
            self.sim.order(Order::Play(true));
        }
        self.tell_title();
        Ok(())
    }

    /// The picture's rectangle in pixels, inside the window.
    fn picture_rect(&self, rect: egui::Rect, scale: f32) -> [u32; 4] {
        let (width, height) = (self.config.width, self.config.height);
        let x = ((rect.left() * scale).max(0.0) as u32).min(width - 1);
        let y = ((rect.top() * scale).max(0.0) as u32).min(height - 1);
        let w = ((rect.width() * scale).max(1.0) as u32).min(width - x).max(1);
        let h = ((rect.height() * scale).max(1.0) as u32).min(height - y).max(1);
        [x, y, w, h]
    }

    /// Draws picture and panels into the window.
    fn present(
        &mut self,
        primitives: &[egui::ClippedPrimitive],
        textures: &egui::TexturesDelta,
        scale: f32,
        picture: bool,
    ) -> Result<(), WindowError> {
        use wgpu::CurrentSurfaceTexture as Current;
        let (device, queue) = (&self.gpu.device, &self.gpu.queue);
        for (id, deltas) in &textures.set {
            deltas.iter().for_each(|delta| self.paint.update_texture(device, queue, *id, delta));
        }
        let texture = match self.surface.get_current_texture() {
            Current::Success(texture) | Current::Suboptimal(texture) => texture,
            Current::Outdated | Current::Lost => {
                self.surface.configure(device, &self.config);
                (self.fresh, self.stale) = (true, true);
                return Ok(());
            }
            _ => return Ok(()),
        };
        let gpu = self.gpu.clone();
        gpu.attempt(|| {
            let view = texture.texture.create_view(&wgpu::TextureViewDescriptor::default());
            let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            let place = Place { target: &view, rect: self.mouse.rect, clear: true };
            let drawn = self.renderer.is_some();
            if let Some(renderer) = &mut self.renderer {
                let style = self.pacer.thrifty(&self.panels.style, self.resting);
                if picture || !renderer.again(&mut encoder, place) {
                    let lines = self.curves.lines(renderer.show(), &self.frame, &style);
                    renderer.draw(&mut encoder, place, &self.camera, &style, &lines);
                }
            }
            let size_in_pixels = [self.config.width, self.config.height];
            let screen = ScreenDescriptor { size_in_pixels, pixels_per_point: scale };
            let mut commands = self.paint.update_buffers(device, queue, &mut encoder, primitives, &screen);
            {
                let ground = wgpu::Color { r: 0.85, g: 0.87, b: 0.89, a: 1.0 };
                let load = if drawn { wgpu::LoadOp::Load } else { wgpu::LoadOp::Clear(ground) };
                let mut pass = encoder
                    .begin_render_pass(&wgpu::RenderPassDescriptor {
                        label: Some("panels"),
                        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                            view: &view,
                            depth_slice: None,
                            resolve_target: None,
                            ops: wgpu::Operations { load, store: wgpu::StoreOp::Store },
                        })],
                        ..Default::default()
                    })
                    .forget_lifetime();
                self.paint.render(&mut pass, primitives, &screen);
            }
            commands.push(encoder.finish());
            queue.submit(commands);
            self.pacer.begin(queue, picture, self.resting);
            queue.present(texture);
            Ok(())
        })?;
        textures.free.iter().for_each(|id| self.paint.free_texture(id));
        self.count();
        Ok(())
    }

    /// Pictures a second.
    fn count(&mut self) {
        let (since, pictures) = &self.pacer.counted;
        let seconds = since.elapsed().as_secs_f64();
        if seconds > 1.0 {
            self.panels.history.pictures = f64::from(*pictures) / seconds;
            self.pacer.counted = (Instant::now(), 0);
        }
        self.panels.history.picture_ms = 1e3 * self.pacer.took().as_secs_f64();
    }

    /// The window's title says what it shows, for those who cannot see it.
    fn tell_title(&mut self) {
        let p = &self.panels;
        let state = match (p.busy, p.playing) {
            (Some(what), _) => what,
            (None, true) => "running",
            (None, false) => "paused",
        };
        let title = format!("jetsam - {} - {:.2} s - {state}", p.name, p.numbers.time);
        if title != self.title {
            self.window.set_title(&title);
            if self.title.is_empty() && self.renderer.is_some() {
                tell_time("first picture", self.start);
            }
            if self.renderer.is_some() {
                self.title = title;
            }
        }
    }

    fn event(&mut self, event: WindowEvent) {
        let answer = self.egui.on_window_event(&self.window, &event);
        self.fresh |= answer.repaint;
        match event {
            WindowEvent::Resized(size) => {
                (self.config.width, self.config.height) = (size.width.max(1), size.height.max(1));
                self.surface.configure(&self.gpu.device, &self.config);
                (self.fresh, self.stale) = (true, true);
            }
            WindowEvent::DroppedFile(path) => {
                let over = self.pointed();
                self.sim.order(opened(path, over));
            }
            WindowEvent::CursorMoved { position, .. } => {
                let place = vec2(position.x as f32, position.y as f32);
                let by = place - self.mouse.place;
                self.mouse.place = place;
                self.dragged(by);
            }
            WindowEvent::MouseInput { state, button, .. } => self.button(state, button),
            WindowEvent::MouseWheel { delta, .. } if self.over_picture() => {
                let lines = match delta {
                    MouseScrollDelta::LineDelta(_, y) => y,
                    MouseScrollDelta::PixelDelta(p) => p.y as f32 / 40.0,
                };
                fly::zoom(&mut self.camera, 0.9f32.powf(lines));
                self.stale = true;
            }
            WindowEvent::ModifiersChanged(modifiers) => self.control = modifiers.state().control_key(),
            WindowEvent::Focused(false) => self.keys.clear(),
            WindowEvent::KeyboardInput { event, .. } => {
                let PhysicalKey::Code(code) = event.physical_key else { return };
                if event.state == ElementState::Released {
                    self.keys.remove(&code);
                } else if !self.egui.egui_ctx().egui_wants_keyboard_input() {
                    let again = !self.keys.insert(code);
                    self.key(code, again);
                }
            }
            _ => {}
        }
    }

    fn over_picture(&self) -> bool {
        let [x, y, w, h] = self.mouse.rect.map(|v| v as f32);
        let p = self.mouse.place - vec2(x, y);
        (0.0..w).contains(&p.x) && (0.0..h).contains(&p.y) && !self.egui.egui_ctx().is_pointer_over_egui()
    }

    fn ray(&self) -> Ray {
        let [x, y, w, h] = self.mouse.rect.map(|v| v as f32);
        let (mut size, mut place) = (vec2(w, h), self.mouse.place - vec2(x, y));
        if self.panels.style.stereo > 0.0 {
            size.x *= 0.5;
            place.x %= size.x;
        }
        Ray::through(&self.camera, place, size)
    }

    /// The place that is pointed at.
    fn pointed(&self) -> Option<Vec3> {
        let renderer = self.renderer.as_ref()?;
        Some(hand::pointed(&self.frame, renderer.show(), self.ray()))
    }

    fn button(&mut self, state: ElementState, button: MouseButton) {
        if state == ElementState::Released {
            match self.mouse.drag.take() {
                Some(Drag::Hold) => self.sim.order(Order::Grip(None)),
                Some(Drag::Pour) => self.sim.order(Order::Pour(None)),
                _ => {}
            }
            self.mouse.held = None;
            return;
        }
        if !self.over_picture() {
            return;
        }
        let shift = self.keys.contains(&KeyCode::ShiftLeft);
        let drag = match button {
            MouseButton::Left if shift => Drag::Pan,
            MouseButton::Left => match self.panels.tool {
                Tool::Grab => self.grab(),
                Tool::Pour => Drag::Pour,
                Tool::Scare => Drag::Scare,
            },
            MouseButton::Right => {
                if self.panels.fly {
                    Drag::Look
                } else {
                    Drag::Orbit
                }
            }
            _ => Drag::Pan,
        };
        self.mouse.drag = Some(drag);
        self.dragged(Vec2::ZERO);
    }

    fn grab(&mut self) -> Drag {
        let ray = self.ray();
        let show = self.renderer.as_ref().map(Renderer::show);
        self.mouse.held = show.and_then(|show| Held::grab(&self.frame, show, &self.camera, ray));
        match self.mouse.held {
            Some(_) => Drag::Hold,
            None if self.panels.fly => Drag::Look,
            None => Drag::Orbit,
        }
    }

    /// The mouse has moved by so many pixels.
    fn dragged(&mut self, by: Vec2) {
        let Some(drag) = self.mouse.drag else { return };
        let height = self.mouse.rect[3] as f32;
        match drag {
            Drag::Orbit => fly::orbit(&mut self.camera, 4.0 / height * by),
            Drag::Look => fly::look(&mut self.camera, 2.0 / height * by * vec2(1.0, -1.0)),
            Drag::Pan => fly::pan(&mut self.camera, by / height),
            Drag::Hold => {
                let ray = self.ray();
                if let (Some(held), Some(renderer)) = (&mut self.mouse.held, &self.renderer) {
                    self.sim.order(Order::Grip(Some(held.drawn(renderer.show(), ray))));
                }
            }
            Drag::Pour => self.sim.order(Order::Pour(self.pointed())),
            Drag::Scare => {
                let place = hand::nearest_agent(&self.frame, self.ray());
                place.into_iter().for_each(|place| self.sim.order(Order::Scare(place)));
            }
        }
        self.stale = true;
    }

    fn key(&mut self, code: KeyCode, again: bool) {
        (self.fresh, self.stale) = (true, true);
        let p = &mut self.panels;
        match code {
            KeyCode::KeyN => self.sim.order(Order::Step),
            _ if again => {}
            KeyCode::Space => {
                p.playing = !p.playing;
                self.sim.order(Order::Play(p.playing));
            }
            KeyCode::KeyS if self.control => self.sim.order(Order::Save(p.save_as.clone().into())),
            KeyCode::KeyR => self.sim.order(Order::Reset),
            KeyCode::Digit1 => p.tool = Tool::Grab,
            KeyCode::Digit2 => p.tool = Tool::Pour,
            KeyCode::Digit3 => p.tool = Tool::Scare,
            KeyCode::KeyV => p.style.fluid = after(&Fluid::ALL.map(|f| f.0), p.style.fluid),
            KeyCode::KeyC => p.style.color = after(&ColorBy::ALL.map(|c| c.0), p.style.color),
            KeyCode::KeyF => p.fly = !p.fly,
            KeyCode::Home => {
                if let Some(renderer) = &self.renderer {
                    self.camera = renderer.show().camera;
                }
            }
            KeyCode::Tab => p.bare = !p.bare,
            _ => {}
        }
    }

    /// Flies on while keys are held.
    fn fly(&mut self) {
        // after a pause a tenth of a second counts
        let seconds = self.flown.elapsed().as_secs_f32().min(0.1);
        self.flown = Instant::now();
        if !self.flying() {
            return;
        }
        let held = |k| f32::from(u8::from(self.keys.contains(&k)));
        let by = Vec3::new(
            held(KeyCode::KeyD) - held(KeyCode::KeyA),
            held(KeyCode::KeyW) - held(KeyCode::KeyS),
            held(KeyCode::KeyE) - held(KeyCode::KeyQ),
        );
        fly::fly(&mut self.camera, 0.6 * seconds * by);
    }
}

/// The choice after another, round and round.
fn after<T: Copy + PartialEq>(all: &[T], now: T) -> T {
    let k = all.iter().position(|t| *t == now).unwrap_or(0);
    all[(k + 1) % all.len()]
}
