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

const WIDTH: usize = 1280;
const HEIGHT: usize = 720;

/// Draws every frame.
pub struct Pictures {
    folder: Option<PathBuf>,
    video: Option<Video>,
    animation: Option<(PathBuf, Animation)>,
    painter: Painter,
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
        let name = folder.file_name().unwrap_or("video".as_ref());
        let path = folder.join(name);
        let rate = scene.run.frames_per_second;
        let [width, height] = pictures.size;
        let wants = |kind| save.contains(&kind);
        let video = wants(Save::Mp4).then(|| Video::create(path.with_extension("mp4"), width, height, rate));
        let mut animation = None;
        if wants(Save::Apng) {
            let path = path.with_extension("apng");
            let opened = Animation::create(&path, width, height, rate).map_err(at(&path))?;
            animation = Some((path, opened));
        }
        let show = Show::new(scene, world, width as f32 / height as f32);
        Ok(Self {
            folder: wants(Save::Png).then(|| folder.into()),
            video: video.transpose()?,
            animation,
            painter: Painter::new(artist, show, pictures)?,
        })
    }
}

impl Writer for Pictures {
    fn write(&mut self, world: &World, stats: &FrameStats) -> miette::Result<()> {
        let image = self.painter.paint(world)?;
        if let Some(folder) = &self.folder {
            image.save_png(frame_path(folder, stats.frame, "png")).into_diagnostic()?;
        }
        if let Some((path, animation)) = &mut self.animation {
            animation.add(&image).map_err(at(path))?;
        }
        self.video.as_mut().map_or(Ok(()), |video| video.write(&image))
    }

    fn finish(&mut self) -> miette::Result<()> {
        if let Some((path, animation)) = &mut self.animation {
            animation.finish().map_err(at(path))?;
        }
        self.video.as_mut().map_or(Ok(()), Video::finish)
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

/// Draws moments of a world.
enum Painter {
    Cpu {
        show: Box<Show>,
        size: [usize; 2],
        style: Style,
        legend: bool,
        frame: Frame,
    },
    #[cfg(feature = "gpu")]
    Gpu {
        studio: Box<jetsam_view::gpu::Studio>,
        style: Style,
        legend: bool,
        frame: Frame,
        curves: jetsam_view::Curves,
    },
}

impl Painter {
    fn new(artist: Artist, show: Show, pictures: &PictureArgs) -> miette::Result<Self> {
        let (size, frame, style, legend) = (pictures.size, Frame::default(), artist.style, pictures.legend);
        match artist.gpu {
            #[cfg(feature = "gpu")]
            Some(gpu) => {
                let [width, height] = size.map(|s| s as u32);
                let studio = jetsam_view::gpu::Studio::new(gpu, show, width, height)?.into();
                Ok(Self::Gpu { studio, style, legend, frame, curves: Default::default() })
            }
            _ => Ok(Self::Cpu { show: show.into(), size, style, legend, frame }),
        }
    }

    fn paint(&mut self, world: &World) -> miette::Result<Image> {
        match self {
            Self::Cpu { show, size: [width, height], style, legend: wanted, frame } => {
                frame.take(world);
                let mut image = paint(show, frame, *width, *height);
                if *wanted {
                    jetsam_view::legend(&mut image, show, style);
                }
                Ok(image)
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
                Ok(image)
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
