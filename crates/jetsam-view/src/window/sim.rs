//! The simulation on a thread of its own. In: orders. Out: the newest moment of the world, its numbers, the scene.

use crate::{Frame, Show};
use glam::{DVec3, Vec3};
use jetsam::assemble::Assembly;
use jetsam::gpu::Gpu;
use jetsam::ledger::Ledger;
use jetsam::model::DtBound;
use jetsam::report::StageMillis;
use jetsam::scene::{Rigid, Scene, Shape};
use jetsam::world::{Grip, Mismatch};
use jetsam::{Choice, Trouble, World};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// What the window asks for.
pub enum Order {
    /// Run, or hold still.
    Play(bool),
    /// One step.
    Step,
    /// Back to the beginning.
    Reset,
    /// Simulated seconds a second, at most.
    Pace(f64),
    /// Values of the scene: `key=value`.
    Set(Vec<String>),
    /// Another scene, by name or path.
    Open(String),
    /// A mesh file that falls into the world over a place.
    Drop(PathBuf, Option<Vec3>),
    /// A body is held, or let go.
    Grip(Option<Grip>),
    /// Fluid is poured from above onto a place, or no longer.
    Pour(Option<Vec3>),
    /// Agents about a place are frightened.
    Scare(Vec3),
    /// The scene is written to a file.
    Save(PathBuf),
    /// Whether particles come home from the device with each moment, besides being drawn there.
    Home(bool),
}

/// Numbers of the newest moment.
#[derive(Clone, Debug, Default)]
pub struct Numbers {
    pub time: f64,
    pub steps: u64,
    pub dt: f64,
    pub bound: Option<DtBound>,
    pub real_time_factor: f64,
    /// Wall-clock time of a step (ms), and of its stages.
    pub step_ms: f64,
    pub stage_ms: StageMillis,
    pub ledger: Ledger,
    pub momentum_residual: f64,
    pub fluid: u32,
    pub rigid: u32,
    pub fixed: u32,
    pub bodies: usize,
    pub agents: usize,
    pub backend: &'static str,
}

/// What the window sees.
#[derive(Default)]
pub struct Shown {
    /// Counts moments.
    pub serial: u64,
    pub frame: Frame,
    pub numbers: Numbers,
    /// Another scene or other bodies: how they are shown, until the window has taken it. Whether the camera is the scene's anew.
    pub show: Option<(Show, bool)>,
    pub scene: Option<Arc<Scene>>,
    /// Name of the scene.
    pub name: String,
    pub playing: bool,
    /// What is being done that takes its time.
    pub busy: Option<&'static str>,
    /// The last message, and whether it is bad news.
    pub message: Option<(String, bool)>,
}

/// The window's end of the thread.
pub struct Sim {
    orders: Option<Sender<Order>>,
    shown: Arc<Mutex<Shown>>,
    thread: Option<JoinHandle<()>>,
}

impl Sim {
    /// Starts the thread with a scene on a backend of a choice, on the device that the window sends as soon as it has one; `wake` is
    /// called whenever there is something new.
    pub fn start(
        name: String,
        scene: Scene,
        playing: bool,
        on: (Choice, Receiver<Gpu>),
        wake: impl Fn() + Send + 'static,
    ) -> std::io::Result<Self> {
        let (orders, inbox) = channel();
        let shown = Arc::new(Mutex::new(Shown { playing, name: name.clone(), ..Shown::default() }));
        let theirs = shown.clone();
        let run = move || {
            let (choice, device) = on;
            // the processor need not wait for a device
            let gpu = if choice == Choice::Cpu { None } else { device.recv().ok() };
            let wake = Box::new(wake);
            let (shown, world) = (theirs, None);
            let mut worker =
                Worker { shown, wake, playing, pace: 1.0, scene, name, world, choice, gpu, at_home: false };
            worker.open(true);
            worker.run(&inbox);
        };
        let thread = std::thread::Builder::new().name("simulation".into()).spawn(run)?;
        Ok(Self { orders: Some(orders), shown, thread: Some(thread) })
    }

    /// Gives an order.
    pub fn order(&self, order: Order) {
        // a thread that has ended says so by its last message
        let _ = self.orders.as_ref().map(|orders| orders.send(order));
    }

    /// What there is to see.
    pub fn shown(&self) -> MutexGuard<'_, Shown> {
        self.shown.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Sim {
    fn drop(&mut self) {
        self.orders = None;
        // it ends after the step it is in
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// A moment is shown this long, if steps are short enough.
const MOMENT: Duration = Duration::from_millis(16);
/// Steps between two moments take no longer than this.
const LONGEST: Duration = Duration::from_millis(40);

struct Worker {
    shown: Arc<Mutex<Shown>>,
    wake: Box<dyn Fn() + Send>,
    playing: bool,
    pace: f64,
    scene: Scene,
    name: String,
    world: Option<World>,
    choice: Choice,
    gpu: Option<Gpu>,
    at_home: bool,
}

impl Worker {
    fn run(&mut self, inbox: &Receiver<Order>) {
        loop {
            let mut orders = Vec::new();
            if !self.playing || self.world.is_none() {
                let Ok(first) = inbox.recv() else { return };
                orders.push(first);
            }
            loop {
                match inbox.try_recv() {
                    Ok(order) => orders.push(order),
                    Err(std::sync::mpsc::TryRecvError::Empty) => break,
                    Err(std::sync::mpsc::TryRecvError::Disconnected) => return,
                }
            }
            self.obey(merged(orders));
            if self.playing {
                self.moment();
            }
        }
    }

    /// Steps up to the next moment.
    fn moment(&mut self) {
        let Some(world) = &mut self.world else { return };
        let (start, began, first) = (Instant::now(), world.time(), world.steps());
        let timers: Vec<Duration> = world.timers().map(|t| t.1).collect();
        let until = began + self.pace * MOMENT.as_secs_f64();
        let (mut trouble, mut last) = (None, None);
        if world.on_device().is_some() {
            // without waiting for each step
            trouble = world.run_to(until);
        } else {
            world.advance(until, |_, step| {
                trouble = step.trouble;
                last = Some(step);
                trouble.is_none() && start.elapsed() < LONGEST
            });
        }
        let wall = start.elapsed();
        let steps = (world.steps() - first).max(1) as f64;
        let mut stages = StageMillis::since(&timers, world);
        stages.0.iter_mut().for_each(|(_, ms)| *ms /= steps);
        let step_ms = 1e3 * wall.as_secs_f64() / steps;
        let seconds = world.time() - began;
        if let Some(trouble) = trouble {
            self.playing = false;
            let what = match trouble {
                Trouble::NotFinite => "values are not finite".into(),
                Trouble::Stalled => "the time step has collapsed".into(),
                Trouble::Device => world.fault().map_or("the device failed".into(), ToString::to_string),
            };
            self.say(format!("stopped: {what}; reset, or change what you changed last"), true);
        }
        let rest = MOMENT.saturating_sub(wall);
        self.publish(|numbers| {
            (numbers.step_ms, numbers.stage_ms) = (step_ms, stages);
            numbers.real_time_factor = seconds / wall.max(rest + wall).as_secs_f64();
            numbers.dt = seconds / steps;
            if let Some(step) = last {
                (numbers.dt, numbers.bound) = (step.dt, Some(step.bound));
            }
        });
        std::thread::sleep(rest);
    }

    fn obey(&mut self, orders: Vec<Order>) {
        for order in orders {
            match order {
                Order::Play(on) => {
                    self.playing = on;
                    self.publish(|_| ());
                }
                Order::Step => {
                    self.playing = false;
                    if let Some(world) = &mut self.world {
                        let report = world.step(f64::INFINITY);
                        self.publish(|n| (n.dt, n.bound) = (report.dt, Some(report.bound)));
                    }
                }
                Order::Reset => self.open(false),
                Order::Pace(pace) => self.pace = pace,
                Order::Set(values) => self.set(&values),
                Order::Open(name) => match Scene::open(&name, &[]) {
                    Ok(scene) => {
                        let stem = Path::new(&name).file_stem().map(|s| s.to_string_lossy().into_owned());
                        (self.scene, self.name) = (scene, stem.unwrap_or(name));
                        self.world = None;
                        self.open(true);
                    }
                    Err(e) => self.complain(&*e),
                },
                Order::Drop(path, over) => self.drop_mesh(&path, over),
                Order::Grip(grip) => self.world.iter_mut().for_each(|w| w.grip(grip)),
                Order::Pour(onto) => self.pour(onto),
                Order::Scare(place) => {
                    let radius = 0.2 * self.extent().length();
                    self.world.iter_mut().for_each(|w| {
                        w.scare(place.as_dvec3(), radius);
                    });
                }
                Order::Home(at_home) => {
                    self.at_home = at_home;
                    self.publish(|_| ());
                }
                Order::Save(path) => match self.scene.save(&path) {
                    Ok(()) => self.say(format!("saved to {}", path.display()), false),
                    Err(e) => self.complain(&*e),
                },
            }
        }
    }

    /// Builds the world of the scene anew.
    fn open(&mut self, camera: bool) {
        self.busy("building the world");
        match self.scene.assemble() {
            Ok(assembly) => {
                self.world = self.world_of(assembly);
                let Some(world) = &self.world else { return };
                let doubt = world.model().warnings.first().map(|w| (format!("note: {w}"), false));
                self.shown().message = doubt;
                self.show(camera);
            }
            Err(e) => self.complain(&*e),
        }
    }

    /// A world on the chosen backend.
    fn world_of(&self, assembly: Assembly) -> Option<World> {
        match World::choose_with(self.choice, self.gpu.as_ref(), assembly) {
            Ok((world, _)) => Some(world),
            Err(e) => {
                self.complain(&e);
                None
            }
        }
    }

    /// Tells how the scene is shown, and its first moment.
    fn show(&mut self, camera: bool) {
        let Some(world) = &self.world else { return };
        let show = Show::new(&self.scene, world, 1.6);
        let (scene, name) = (Arc::new(self.scene.clone()), self.name.clone());
        let mut shown = self.shown();
        let camera = camera || shown.show.as_ref().is_some_and(|(_, camera)| *camera);
        shown.show = Some((show, camera));
        (shown.scene, shown.name) = (Some(scene), name);
        drop(shown);
        self.publish(|n| *n = Numbers::default());
    }

    /// Changes values of the scene; the world goes on with them where it can, else it begins anew.
    fn set(&mut self, values: &[String]) {
        let changed = match self.scene.with(values) {
            Ok(scene) => scene,
            Err(e) => return self.complain(&*e),
        };
        if values.iter().all(|v| v.starts_with("camera.") || v.starts_with("run.")) {
            self.scene = changed;
            return self.show(values.iter().any(|v| v.starts_with("camera.")));
        }
        self.busy("taking over the change");
        match changed.assemble() {
            Ok(assembly) => {
                self.scene = changed;
                let world = self.world.take();
                let what = values.join(", ");
                let (world, told) = match world {
                    Some(mut world) => match world.take_over(assembly) {
                        Ok(()) => (Some(world), what),
                        Err((_, assembly)) => (self.world_of(*assembly), format!("{what}: the world begins anew")),
                    },
                    None => (self.world_of(assembly), what),
                };
                if world.is_none() {
                    return;
                }
                self.world = world;
                self.show(false);
                self.say(told, false);
            }
            Err(e) => self.complain(&*e),
        }
    }

    /// A mesh file becomes a body that stands over a place, as high as there is room.
    fn drop_mesh(&mut self, path: &Path, over: Option<Vec3>) {
        self.busy("turning the mesh into particles");
        let changed = match self.dropped(path, over) {
            Ok(scene) => scene,
            Err(problem) => return self.say(problem, true),
        };
        let Some(world) = &mut self.world else { return };
        match changed.assemble() {
            Ok(assembly) => match world.take_over(assembly) {
                Ok(()) => {
                    self.scene = changed;
                    self.show(false);
                    self.say(format!("{} falls in", path.display()), false);
                }
                Err((Mismatch::Room, _)) => self.say("there is no room for it there".into(), true),
                Err((why, _)) => self.say(format!("{}: {why}; save, and open the scene anew", path.display()), true),
            },
            Err(e) => self.complain(&*e),
        }
    }

    fn dropped(&self, path: &Path, over: Option<Vec3>) -> Result<Scene, String> {
        let mesh = jetsam::mesh::Mesh::load(path).map_err(|e| format!("{e}; {}", e.help))?;
        let (low, high) =
            mesh.vertices.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        let extent = self.extent();
        // a quarter of the narrower side of the domain, but no fewer than six particles
        let side = (0.25 * extent.x.min(extent.y)).max(6.0 * self.scene.resolution.spacing);
        let scale = side / (high - low).max_element().max(1e-300);
        let (min, max) = (DVec3::from(self.scene.domain.min), DVec3::from(self.scene.domain.max));
        let (half, middle) = (0.5 * scale * (high - low), 0.5 * scale * (high + low));
        let margin = DVec3::splat(self.scene.resolution.spacing);
        let (room_min, room_max) = (min + half + margin, max - half - margin);
        if !room_min.cmple(room_max).all() {
            return Err("the domain is too small for a body".into());
        }
        let wish = over.map_or(0.5 * (min + max), Vec3::as_dvec3).with_z(f64::INFINITY);
        let place = wish.clamp(room_min, room_max) - middle;
        let stem = path.file_stem().map_or("body".into(), |s| s.to_string_lossy().into_owned());
        // unlike the names of copies
        let name = format!("{stem} dropped");
        let known = self.scene.rigid.iter().filter(|r| r.name.as_ref().is_some_and(|n| n.starts_with(&name))).count();
        let absolute = path.canonicalize().unwrap_or_else(|_| path.into());
        let text = toml::toml! { shape = { points = [] } };
        let mut body: Rigid = text.try_into().map_err(|e: toml::de::Error| e.to_string())?;
        body.name = Some(format!("{name} {}", known + 1));
        body.shape = Shape::Mesh { path: absolute.display().to_string(), scale };
        body.density = Some(500.0);
        body.position = place.to_array();
        let mut scene = self.scene.clone();
        scene.rigid.push(body);
        Ok(scene)
    }

    fn pour(&mut self, onto: Option<Vec3>) {
        let extent = self.extent();
        let dx = self.scene.resolution.spacing;
        let Some(world) = &mut self.world else { return };
        let Some(onto) = onto else { return world.pour(None) };
        let (min, max) = (DVec3::from(self.scene.domain.min), DVec3::from(self.scene.domain.max));
        let radius = (0.05 * extent.x.min(extent.y)).max(2.0 * dx);
        let behind = self.scene.solver.support * dx;
        let margin = DVec3::new(radius + dx, radius + dx, behind + dx);
        let high = onto.as_dvec3() + DVec3::Z * (0.3 * extent.z + 4.0 * dx);
        let center = high.max(min + margin).min(max - margin);
        let speed = (world.model().gravity.length() * extent.z).sqrt().max(10.0 * dx) * 0.5;
        match self.scene.hose(center, DVec3::NEG_Z, radius, speed, world.time()) {
            Ok(hose) => world.pour(Some(hose)),
            Err(e) => {
                world.pour(None);
                self.complain(&*e);
            }
        }
    }

    fn extent(&self) -> DVec3 {
        let d = &self.scene.domain;
        let extent = DVec3::from(d.max) - DVec3::from(d.min);
        if self.scene.world.dimensions == 2 { extent.with_y(extent.x) } else { extent }
    }

    fn publish(&self, fill: impl FnOnce(&mut Numbers)) {
        let mut shown = self.shown();
        let shown = &mut *shown;
        shown.playing = self.playing;
        shown.busy = None;
        shown.serial += 1;
        let n = &mut shown.numbers;
        fill(n);
        if let Some(world) = &self.world {
            if self.at_home {
                shown.frame.take(world)
            } else {
                shown.frame.borrow(world)
            }
            (n.time, n.steps, n.ledger) = (world.time(), world.steps(), world.ledger().clone());
            n.momentum_residual = world.momentum_residual();
            let count = shown.frame.lent.as_ref().map_or(shown.frame.count, |lent| lent.count);
            [n.fluid, n.rigid, n.fixed] = count;
            n.bodies = world.model().contacts.iter().filter(|c| c.inverse_mass > 0.0).count();
            n.agents = shown.frame.agents.len();
            n.backend = world.backend();
        }
        (self.wake)();
    }

    fn shown(&self) -> MutexGuard<'_, Shown> {
        self.shown.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn busy(&self, with: &'static str) {
        self.shown().busy = Some(with);
        (self.wake)();
    }

    fn say(&self, message: String, bad: bool) {
        let mut shown = self.shown();
        (shown.message, shown.busy, shown.playing) = (Some((message, bad)), None, self.playing);
        drop(shown);
        (self.wake)();
    }

    fn complain(&self, error: &dyn miette::Diagnostic) {
        let help = error.help().map_or(String::new(), |h| format!(" ({h})"));
        self.say(format!("{error}{help}"), true);
    }
}

/// Orders to change the scene that come together are one: what they build is built once. Of places that follow the mouse the
/// last counts.
fn merged(orders: Vec<Order>) -> Vec<Order> {
    let mut kept: Vec<Order> = Vec::new();
    for order in orders {
        match (kept.last_mut(), order) {
            (Some(Order::Set(values)), Order::Set(more)) => {
                let key = |v: &str| v.split('=').next().unwrap_or("").to_owned();
                values.retain(|v| more.iter().all(|m| key(m) != key(v)));
                values.extend(more);
            }
            (Some(Order::Grip(grip)), Order::Grip(next)) => *grip = next,
            (Some(Order::Pour(place)), Order::Pour(next)) => *place = next,
            (_, order) => kept.push(order),
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_that_come_together_are_made_once() {
        let set = |v: &[&str]| Order::Set(v.iter().map(|s| (*s).to_owned()).collect());
        let orders = vec![set(&["a=1"]), set(&["b=2"]), set(&["a=3"]), Order::Step, set(&["a=4"])];
        let kept = merged(orders);
        assert_eq!(kept.len(), 3);
        assert!(matches!(&kept[0], Order::Set(v) if v == &["b=2", "a=3"]));
    }

    /// Waits until something is shown, for at most half a minute.
    fn wait(sim: &Sim, until: impl Fn(&Shown) -> bool) {
        let start = Instant::now();
        while !until(&sim.shown()) {
            assert!(start.elapsed() < Duration::from_secs(30), "{:?}", sim.shown().message);
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    #[test]
    fn the_thread_obeys() {
        let scene = Scene::open("dam-break", &["resolution.spacing=0.1".into()]).unwrap();
        let (_, device) = channel();
        let sim = Sim::start("dam-break".into(), scene, false, (Choice::Cpu, device), || ()).unwrap();
        wait(&sim, |s| s.show.is_some() && s.serial > 0);
        assert_eq!(sim.shown().numbers.steps, 0);
        assert!(!sim.shown().playing);
        sim.order(Order::Step);
        wait(&sim, |s| s.numbers.steps == 1);
        sim.order(Order::Play(true));
        wait(&sim, |s| s.numbers.time > 0.05);
        sim.order(Order::Set(vec!["world.gravity=[0, 0, -3]".into()]));
        wait(&sim, |s| s.scene.as_ref().is_some_and(|s| s.world.gravity[2] == -3.0));
        assert!(sim.shown().numbers.time > 0.05, "the world went on");
        sim.order(Order::Set(vec!["solver.courant=7".into()]));
        wait(&sim, |s| s.message.as_ref().is_some_and(|m| m.1 && m.0.contains("courant")));
        sim.order(Order::Play(false));
        sim.order(Order::Reset);
        wait(&sim, |s| s.numbers.time == 0.0 && !s.playing);
    }
}
