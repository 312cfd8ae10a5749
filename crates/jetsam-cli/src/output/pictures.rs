//! Pictures of a world: `frame_00000.png` and so on, and the video made of them.

use super::video::Video;
use super::{Writer, at, frame_path};
use crate::args::{PictureArgs, Renderer, Save};
use crate::terminal::say;
use glam::{DVec3, Vec3};
use jetsam::gpu::{Gpu, GpuError, devices};
use jetsam::{FrameStats, Scene, World};
use jetsam_view::{Animation, Ball, Camera, Frame, Image, Options, Show, Style, color, paint, render};
use miette::{IntoDiagnostic, miette};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::JoinHandle;

const WIDTH: usize = 1280;
const HEIGHT: usize = 720;

/// Draws every frame. The run goes on meanwhile: of two processors one is idle at times in either.
pub struct Pictures {
    painter: Painter,
    desk: Desk,
}

impl Pictures {
    /// Pictures as files, as a video, as an animation, or several of these.
    pub fn create(
        folder: &Path,
        save: &[Save],
        (pictures, artist): (&PictureArgs, Artist),
        scene: &Scene,
        world: &World,
    ) -> miette::Result<Self> {
        let [width, height] = pictures.size;
        let binder = Binder::create(folder, save, pictures.size, scene.run.frames_per_second)?;
        let show = Show::new(scene, world, width as f32 / height as f32);
        Ok(Self { painter: Painter::new(artist, show, pictures)?, desk: Desk::open(binder) })
    }
}

impl Writer for Pictures {
    fn write(&mut self, world: &World, stats: &FrameStats) -> miette::Result<()> {
        let sheet = self.painter.sheet(world)?;
        self.desk.lay(stats.frame, sheet)
    }

    fn finish(&mut self) -> miette::Result<()> {
        self.desk.close()
    }
}

/// Where pictures go.
struct Binder {
    folder: Option<PathBuf>,
    video: Option<Video>,
    animation: Option<(PathBuf, Animation)>,
}

impl Binder {
    fn create(folder: &Path, save: &[Save], [width, height]: [usize; 2], rate: f64) -> miette::Result<Self> {
        let path = folder.join(folder.file_name().unwrap_or("video".as_ref()));
        let wants = |kind| save.contains(&kind);
        let video = wants(Save::Mp4).then(|| Video::create(path.with_extension("mp4"), width, height, rate));
        let mut animation = None;
        if wants(Save::Apng) {
            let path = path.with_extension("apng");
            let opened = Animation::create(&path, width, height, rate).map_err(at(&path))?;
            animation = Some((path, opened));
        }
        Ok(Self { folder: wants(Save::Png).then(|| folder.into()), video: video.transpose()?, animation })
    }

    fn add(&mut self, number: u64, image: &Image) -> miette::Result<()> {
        if let Some(folder) = &self.folder {
            image.save_png(frame_path(folder, number, "png")).into_diagnostic()?;
        }
        if let Some((path, animation)) = &mut self.animation {
            animation.add(image).map_err(at(path))?;
        }
        self.video.as_mut().map_or(Ok(()), |video| video.write(image))
    }

    fn finish(&mut self) -> miette::Result<()> {
        if let Some((path, animation)) = &mut self.animation {
            animation.finish().map_err(at(path))?;
        }
        self.video.as_mut().map_or(Ok(()), Video::finish)
    }
}

/// What is laid on the desk: a picture, or what is left to do to have one.
type Sheet = Box<dyn FnOnce() -> Image + Send>;

/// A thread of its own that draws and writes, sheet by sheet; one may wait while another is in work.
struct Desk {
    sheets: Option<SyncSender<(u64, Sheet)>>,
    work: Option<JoinHandle<miette::Result<()>>>,
}

impl Desk {
    fn open(mut binder: Binder) -> Self {
        let (sheets, laid) = sync_channel::<(u64, Sheet)>(1);
        let work = std::thread::spawn(move || {
            for (number, sheet) in laid {
                binder.add(number, &sheet())?;
            }
            binder.finish()
        });
        Self { sheets: Some(sheets), work: Some(work) }
    }

    /// Hands over a sheet; says so if one before could not be written.
    fn lay(&mut self, number: u64, sheet: Sheet) -> miette::Result<()> {
        match self.sheets.as_ref().map(|sheets| sheets.send((number, sheet))) {
            Some(Err(_)) => self.close(),
            _ => Ok(()),
        }
    }

    /// Waits until everything is written.
    fn close(&mut self) -> miette::Result<()> {
        self.sheets = None;
        match self.work.take().map(JoinHandle::join) {
            Some(Ok(outcome)) => outcome,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
            None => Ok(()),
        }
    }
}

impl Drop for Desk {
    /// A run that ends early leaves the pictures it has made.
    fn drop(&mut self) {
        self.sheets = None;
        if let Some(work) = self.work.take() {
            // what went wrong has been said, or the run ends for a reason of its own
            let _ = work.join();
        }
    }
}

/// Who draws the pictures of a run. Chosen before the world is built: a simulation on a GPU then runs on the device that draws, and its
/// particles are drawn where they are.
pub struct Artist {
    gpu: Option<Gpu>,
    style: Style,
}

impl Artist {
    /// Software adapters draw balls more slowly than the processor does: they are taken only when asked for, or for what the
    /// processor cannot draw.
    ///
    /// # Errors
    /// Only a GPU can draw what is asked for, and there is none, or it may not; a sprite that cannot be read.
    pub fn of(save: &[Save], pictures: &PictureArgs) -> miette::Result<Self> {
        let style = pictures.style.style()?;
        let special = style != Style::default();
        let any = save.iter().any(|kind| kind.is_picture());
        let on_gpu = match pictures.renderer {
            Renderer::Gpu => any,
            Renderer::Auto => any && (special || devices().iter().any(|d| d.is_hardware())),
            Renderer::Cpu if special => {
                return Err(miette!(
                    help = "leave out --renderer cpu, or the options of pictures but --size",
                    "the processor draws fluid as balls coloured by speed, and nothing else"
                ));
            }
            Renderer::Cpu => false,
        };
        let gpu = match on_gpu.then(open) {
            Some(Err(problem)) if pictures.renderer == Renderer::Auto && !special => {
                say(&format!("warning: pictures are drawn by the processor: {problem}"));
                None
            }
            opened => opened.transpose()?,
        };
        Ok(Self { gpu, style })
    }

    /// The device that draws.
    pub fn gpu(&self) -> Option<&Gpu> {
        self.gpu.as_ref()
    }
}

#[cfg(feature = "gpu")]
fn open() -> Result<Gpu, GpuError> {
    Gpu::open(false)
}

#[cfg(not(feature = "gpu"))]
fn open() -> Result<Gpu, GpuError> {
    Err(GpuError::NotBuilt)
}

/// Who draws moments of a world.
enum Painter {
    /// The processor, at the desk.
    Processor { show: Arc<Show>, size: [usize; 2], legend: Option<Style> },
    #[cfg(feature = "gpu")]
    Gpu {
        studio: Box<jetsam_view::gpu::Studio>,
        style: Style,
        legend: bool,
        frame: Box<Frame>,
        curves: jetsam_view::Curves,
    },
}

impl Painter {
    fn new(artist: Artist, show: Show, pictures: &PictureArgs) -> miette::Result<Self> {
        let (size, style, legend) = (pictures.size, artist.style, pictures.legend);
        match artist.gpu {
            #[cfg(feature = "gpu")]
            Some(gpu) => {
                let [width, height] = size.map(|s| s as u32);
                let studio = jetsam_view::gpu::Studio::new(gpu, show, width, height)?.into();
                Ok(Self::Gpu { studio, style, legend, frame: Box::default(), curves: Default::default() })
            }
            _ => Ok(Self::Processor { show: show.into(), size, legend: legend.then_some(style) }),
        }
    }

    fn sheet(&mut self, world: &World) -> miette::Result<Sheet> {
        match self {
            Self::Processor { show, size: [width, height], legend } => {
                let (frame, show, legend) = (Frame::of(world), Arc::clone(show), legend.clone());
                let [width, height] = [*width, *height];
                Ok(Box::new(move || {
                    let mut image = paint(&show, &frame, width, height);
                    if let Some(style) = &legend {
                        jetsam_view::legend(&mut image, &show, style);
                    }
                    image
                }))
            }
            #[cfg(feature = "gpu")]
            Self::Gpu { studio, style, legend: wanted, frame, curves } => {
                if style.at_home() {
                    frame.take(world)
                } else {
                    frame.borrow(world)
                }
                curves.note(frame, style);
                let lines = curves.lines(studio.show(), frame, style);
                let mut image = studio.picture(frame, style, &lines)?;
                if *wanted {
                    jetsam_view::legend(&mut image, studio.show(), style);
                }
                Ok(Box::new(|| image))
            }
        }
    }
}

/// A picture of a solid made of points, for `voxelize --series`.
pub fn of_points(points: &[DVec3], spacing: f64) -> Image {
    let radius = (0.5 * spacing) as f32;
    let tips = points.iter().map(|p| p.as_vec3());
    let (min, max) = tips.clone().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)));
    let (min, max) = if points.is_empty() { (Vec3::ZERO, Vec3::ONE) } else { (min - radius, max + radius) };
    let margin = 0.05 * (max - min);
    let camera =
        Camera::framing(min - margin, max + margin, Vec3::new(0.5, -1.0, 0.35), 0.5, WIDTH as f32 / HEIGHT as f32);
    let balls: Vec<Ball> = tips.map(|center| Ball { center, radius, color: color::of_name("mesh") }).collect();
    render(&balls, &camera, WIDTH, HEIGHT, &Options { ground: Some(min.z), ..Options::default() })
}
