//! What can be written on the command line: help, completions and man page derive from here.

use clap::{ArgGroup, Parser, Subcommand, ValueEnum};
use jetsam::Scene;
use jetsam::voxelize::Rule;
use jetsam_view::style;
use std::path::PathBuf;

/// Meshes dropped into water: a particle simulator of rigid bodies and fluids.
///
/// Without a command, opens the scene `monkey-splash` in a window; where there is no display, runs it and writes pictures and numbers
/// to out/monkey-splash/.
#[derive(Parser)]
#[command(name = "jetsam", version, max_term_width = 100)]
pub struct Args {
    #[command(subcommand)]
    pub command: Option<Command>,
}

#[derive(Subcommand)]
pub enum Command {
    /// Simulate a scene; write pictures and numbers.
    Run(Run),
    /// Open a scene in a window, and put a hand in it.
    View(View),
    /// Read a scene and say what it amounts to: particles, time step, stability margins, warnings.
    Check(Check),
    /// Turn a mesh into particles and say how well they fill it.
    Voxelize(Voxelize),
    /// Measure the speed of scenes; one JSON object or one line a case.
    Bench(Bench),
    /// Run validation cases and compare them with what they expect; exit status 1 if one fails.
    Validate(Validate),
    /// List the built-in scenes.
    Scenes(Scenes),
    /// List the compute adapters that were found.
    Devices(Devices),
    /// Print the JSON schema of the scene file.
    Schema,
    /// Print completions for a shell.
    Completions { shell: clap_complete::Shell },
    /// Print the man page.
    #[command(hide = true)]
    Man,
}

/// Which scene, and what to change in it.
#[derive(clap::Args, Clone, Default)]
pub struct Input {
    /// Name of a built-in scene (see `jetsam scenes`) or path of a scene file.
    pub scene: String,
    /// Override a value of the scene by its dotted path, e.g. resolution.spacing=0.02 or rigid.0.density=300.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}

impl Input {
    /// Reads the scene.
    pub fn open(&self) -> miette::Result<Scene> {
        Ok(Scene::open(&self.scene, &self.set).map_err(|e| *e)?)
    }
}

/// What computes.
#[derive(Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub enum Backend {
    /// A graphics processor where there is one in fact and the scene can run on it, else the processor.
    #[default]
    Auto,
    /// The processor.
    Cpu,
    /// A graphics processor, or a software driver where there is no other.
    Gpu,
}

impl From<Backend> for jetsam::Choice {
    fn from(backend: Backend) -> Self {
        match backend {
            Backend::Auto => Self::Auto,
            Backend::Cpu => Self::Cpu,
            Backend::Gpu => Self::Gpu,
        }
    }
}

#[derive(clap::Args, Clone)]
pub struct Run {
    #[command(flatten)]
    pub input: Input,
    /// What computes.
    #[arg(long, value_enum, default_value_t)]
    pub backend: Backend,
    /// Simulated seconds; by default the scene's own length.
    #[arg(long, conflicts_with = "frames", value_parser = not_negative, allow_negative_numbers = true)]
    pub seconds: Option<f64>,
    /// Frames after frame 0, which is the beginning.
    #[arg(long)]
    pub frames: Option<u64>,
    /// Open no window.
    #[arg(long)]
    pub headless: bool,
    /// Folder to write to; by default out/ and the scene's name.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// What to write besides stats.jsonl.
    #[arg(long, value_enum, value_delimiter = ',', default_values = ["png", "csv"])]
    pub save: Vec<Save>,
    /// Threads to compute with; by default one a core. Results do not depend on it.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
    /// Seed of everything random in the scene.
    #[arg(long)]
    pub seed: Option<u32>,
    #[command(flatten)]
    pub pictures: PictureArgs,
}

#[derive(clap::Args, Clone)]
pub struct View {
    #[command(flatten)]
    pub input: Input,
    /// What computes; a graphics processor is the one that draws.
    #[arg(long, value_enum, default_value_t)]
    pub backend: Backend,
    /// Wait for the space bar.
    #[arg(long)]
    pub paused: bool,
    /// Threads to compute with; by default one a core.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
    #[command(flatten)]
    pub style: StyleArgs,
}

/// Who draws pictures.
#[derive(Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub enum Renderer {
    /// A graphics processor where there is one, or where only it can draw what is asked for.
    #[default]
    Auto,
    /// A graphics processor, if only a software one.
    Gpu,
    /// The processor.
    Cpu,
}

/// How pictures look.
#[derive(clap::Args, Clone)]
#[command(next_help_heading = "Pictures")]
pub struct PictureArgs {
    /// Who draws.
    #[arg(long, value_enum, default_value_t)]
    pub renderer: Renderer,
    /// Width and height in pixels.
    #[arg(long, value_parser = size, default_value = "1280x720", value_name = "WIDTHxHEIGHT")]
    pub size: [usize; 2],
    /// Draw the scale of colours into the picture.
    #[arg(long)]
    pub legend: bool,
    #[command(flatten)]
    pub style: StyleArgs,
}

/// How a world looks.
#[derive(clap::Args, Clone)]
#[command(next_help_heading = "Looks")]
pub struct StyleArgs {
    /// How fluids are drawn.
    #[arg(long, value_parser = one_of(&style::Fluid::ALL), default_value = "balls", value_name = "balls|points|surface|sprites|hidden")]
    pub fluid: style::Fluid,
    /// What stands for a particle with --fluid sprites: a PNG file, in place of a drop. Multiplied with its colour; clear where the alpha
    /// is below one half.
    #[arg(long, value_name = "FILE")]
    pub sprite: Option<PathBuf>,
    /// How the surface of a fluid is smoothed.
    #[arg(long, value_parser = one_of(&style::Smoothing::ALL), default_value = "narrow-range", value_name = "narrow-range|bilateral|curvature-flow|none")]
    pub smoothing: style::Smoothing,
    /// Draw bodies as their particles.
    #[arg(long)]
    pub body_particles: bool,
    /// What colours show.
    #[arg(long, value_parser = color_by, default_value = "speed", value_name = "speed|density|pressure|kind|owner")]
    pub color: style::ColorBy,
    /// The scale of colours.
    #[arg(long, value_parser = map, default_value = "water", value_name = "water|viridis|magma|balance")]
    pub map: jetsam_view::color::Map,
    /// Ends of the scale of colours, in the unit of what is shown.
    #[arg(long, value_parser = numbers::<2>, value_name = "LOW,HIGH", allow_hyphen_values = true)]
    pub range: Option<[f64; 2]>,
    /// Draw arrows, as long as the way of a particle in this many seconds.
    #[arg(long, value_parser = not_negative, default_value = "0", value_name = "SECONDS")]
    pub arrows: f64,
    /// What arrows show: the velocity, or the force over the mass.
    #[arg(long, value_parser = one_of(&style::Arrows::ALL), default_value = "velocity", value_name = "velocity|force")]
    pub arrows_of: style::Arrows,
    /// Lines: where particles and agents were, or along the velocity of the fluid at this instant.
    #[arg(long, value_parser = one_of(&style::Lines::ALL), default_value = "none", value_name = "none|trails|streamlines")]
    pub lines: style::Lines,
    /// Two pictures side by side, one for each eye.
    #[arg(long)]
    pub stereo: bool,
    /// Samples of a pixel along each side.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=4))]
    pub samples: u32,
}

impl StyleArgs {
    /// The choices for the GPU's renderer.
    ///
    /// # Errors
    /// A sprite that cannot be read, or that nothing is drawn as.
    pub fn style(&self) -> miette::Result<style::Style> {
        Ok(style::Style {
            fluid: self.fluid,
            sprite: self.sprite()?,
            lines: self.lines,
            smoothing: self.smoothing,
            bodies: if self.body_particles { style::Bodies::Particles } else { style::Bodies::Meshes },
            color: self.color,
            map: self.map,
            range: self.range.map(|r| r.map(|x| x as f32)),
            arrows: self.arrows as f32,
            arrows_of: self.arrows_of,
            stereo: if self.stereo { 1.0 } else { 0.0 },
            samples: self.samples,
            ..style::Style::default()
        })
    }

    fn sprite(&self) -> miette::Result<jetsam_view::Sprite> {
        let Some(path) = &self.sprite else { return Ok(jetsam_view::Sprite::default()) };
        if self.fluid != style::Fluid::Sprites {
            return Err(miette::miette!(help = "add --fluid sprites", "--sprite: nothing is drawn as sprites"));
        }
        jetsam_view::Sprite::open(path).map_err(|e| {
            let help = "a sprite is a PNG file of at most 1024 x 1024 pixels; without --sprite a drop is drawn";
            miette::miette!(help = help, "{e}")
        })
    }
}

impl Command {
    /// What plain `jetsam` does.
    pub fn default_scene(display: bool) -> Self {
        let name = jetsam::scene::builtin::SCENES[0].name;
        let command = if display { "view" } else { "run" };
        Args::parse_from(["jetsam", command, name]).command.expect("a command was given")
    }
}

/// A kind of file a run can write.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Save {
    /// A picture a frame.
    Png,
    /// A video of the pictures (needs ffmpeg).
    Mp4,
    /// The pictures as an animated PNG, which browsers play (needs nothing).
    Apng,
    /// The particles of a frame, binary PLY.
    Ply,
    /// The particles of a frame, legacy VTK.
    Vtk,
    /// The bodies' motion and what probes read: bodies.csv, probes.csv.
    Csv,
}

impl Save {
    /// Whether it is made of pictures.
    pub fn is_picture(self) -> bool {
        matches!(self, Self::Png | Self::Mp4 | Self::Apng)
    }
}

#[derive(clap::Args)]
pub struct Check {
    #[command(flatten)]
    pub input: Input,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// What a lattice follows.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Align {
    /// The mesh's own axes.
    Body,
    /// The world's axes.
    World,
}

impl From<Align> for jetsam::voxelize::Align {
    fn from(align: Align) -> Self {
        match align {
            Align::Body => Self::Body,
            Align::World => Self::World,
        }
    }
}

/// What fills a mesh.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Filler {
    /// A graphics processor where there is one, else the processor.
    Auto,
    /// The processor.
    Cpu,
    /// A graphics processor.
    Gpu,
}

impl From<Filler> for jetsam::voxelize::Backend {
    fn from(filler: Filler) -> Self {
        match filler {
            Filler::Auto => Self::Auto,
            Filler::Cpu => Self::Cpu,
            Filler::Gpu => Self::Gpu,
        }
    }
}

#[derive(clap::Args)]
#[command(group = ArgGroup::new("fineness").required(true).args(["spacing", "resolution", "particles"]))]
pub struct Voxelize {
    /// Mesh: OBJ, STL, PLY, glTF or GLB.
    pub mesh: PathBuf,
    /// Distance between neighbouring particles, in mesh units.
    #[arg(long, allow_negative_numbers = true)]
    pub spacing: Option<f64>,
    /// Particles across the longest side.
    #[arg(long)]
    pub resolution: Option<u32>,
    /// Number of particles wanted.
    #[arg(long)]
    pub particles: Option<u64>,
    /// When a place is inside: where the surface is crossed an odd number of times, or where it winds around.
    #[arg(long, value_parser = rule, default_value = "winding", value_name = "parity|winding")]
    pub rule: Rule,
    /// What fills the mesh: the parity rule has a GPU twin, equal to the last cell.
    #[arg(long, value_enum, default_value = "cpu")]
    pub backend: Filler,
    /// Keep parts thinner than two particles.
    #[arg(long)]
    pub thin: bool,
    /// What the lattice follows: the mesh as it is turned, or the world's axes.
    #[arg(long, value_enum, default_value = "body")]
    pub align: Align,
    /// Keep only a shell of this thickness under the surface, in mesh units.
    #[arg(long, value_name = "THICKNESS", allow_negative_numbers = true)]
    pub shell: Option<f64>,
    /// Where the mesh's origin goes.
    #[arg(long, value_parser = numbers::<3>, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub offset: Option<[f64; 3]>,
    /// Rotation about the mesh's origin: axis and degrees.
    #[arg(long, value_parser = numbers::<4>, value_name = "AX,AY,AZ,DEG", allow_hyphen_values = true)]
    pub rotate: Option<[f64; 4]>,
    /// Write the particles to this PLY file (with --series: pictures into this folder).
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Draw this many pictures, each with twice the particles of the last.
    #[arg(long, requires = "out", value_name = "K", value_parser = clap::value_parser!(u8).range(1..=24))]
    pub series: Option<u8>,
    /// Print one JSON object (with --series: one a picture).
    #[arg(long)]
    pub json: bool,
}

#[derive(clap::Args)]
pub struct Devices {
    /// Print a JSON array.
    #[arg(long)]
    pub json: bool,
}

#[derive(clap::Args)]
pub struct Bench {
    /// Name of a built-in scene or path of a scene file; by default every built-in scene.
    #[arg(conflicts_with = "list")]
    pub scene: Option<String>,
    /// List what is measured by default.
    #[arg(long)]
    pub list: bool,
    /// Choose the spacing so that there are about this many fluid particles; may be repeated.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    pub particles: Vec<u64>,
    /// Compare the solvers of pressure: speed beside density error, for a dam break and for monkey-splash or a scene given.
    #[arg(long, conflicts_with_all = ["list", "particles", "steps"])]
    pub solvers: bool,
    /// Measure pictures in place of steps: how long the GPU's renderer takes for each style, pass by pass, after so many steps.
    #[arg(long, conflicts_with = "solvers")]
    pub pictures: bool,
    /// With --pictures: width and height in pixels.
    #[arg(long, requires = "pictures", value_parser = size, default_value = "1280x720", value_name = "WIDTHxHEIGHT")]
    pub size: [usize; 2],
    /// With --solvers: simulate so long, in place of what is usual for the scene (s).
    #[arg(long, requires = "solvers", value_parser = not_negative)]
    pub seconds: Option<f64>,
    /// What computes.
    #[arg(long, value_enum, default_value_t)]
    pub backend: Backend,
    /// Steps to measure, after a fifth as many to warm up.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..))]
    pub steps: u64,
    /// Override a value of the scene by its dotted path.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Threads to compute with; by default one a core.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
    /// Print one JSON object a case.
    #[arg(long)]
    pub json: bool,
}

#[derive(clap::Args)]
pub struct Validate {
    /// Names of cases, their beginnings (A5), groups (A), or paths of scene files; by default every case.
    pub cases: Vec<String>,
    /// List the cases.
    #[arg(long)]
    pub list: bool,
    /// What computes.
    #[arg(long, value_enum, default_value_t)]
    pub backend: Backend,
    /// Folder for plots (SVG), readings (CSV) and the whole table (validation.md).
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Override a value of every case by its dotted path.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Threads to compute with; by default one a core.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
    /// Print one JSON object a row.
    #[arg(long)]
    pub json: bool,
}

#[derive(clap::Args)]
pub struct Scenes {
    /// Print a JSON array.
    #[arg(long)]
    pub json: bool,
}

fn not_negative(text: &str) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if number >= 0.0 && number.is_finite() { Ok(number) } else { Err("must be finite and not negative".into()) }
}

fn size(text: &str) -> Result<[usize; 2], String> {
    let parts = text.split_once('x').ok_or("write WIDTHxHEIGHT, e.g. 1920x1080")?;
    let side = |part: &str| match part.parse::<usize>() {
        Ok(n) if (16..=8192).contains(&n) && n % 2 == 0 => Ok(n),
        _ => Err(format!("{part} is not an even number from 16 to 8192")),
    };
    Ok([side(parts.0)?, side(parts.1)?])
}

/// Reads a choice by its name, written with hyphens.
fn one_of<T: Copy + Send + Sync>(
    all: &'static [(T, &'static str)],
) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync {
    move |text| {
        let found = all.iter().find(|(_, name)| name.replace(' ', "-") == text);
        let names = || all.iter().map(|(_, name)| name.replace(' ', "-")).collect::<Vec<_>>().join(", ");
        found.map(|(choice, _)| *choice).ok_or_else(|| format!("choose one of {}", names()))
    }
}

fn color_by(text: &str) -> Result<style::ColorBy, String> {
    let found = style::ColorBy::ALL.iter().find(|(_, name, _)| *name == text);
    found.map(|(choice, ..)| *choice).ok_or_else(|| "choose speed, density, pressure, kind or owner".into())
}

fn map(text: &str) -> Result<jetsam_view::color::Map, String> {
    let found = jetsam_view::color::Map::ALL.into_iter().find(|m| m.name() == text);
    found.ok_or_else(|| "choose water, viridis, magma or balance".into())
}

fn rule(text: &str) -> Result<Rule, String> {
    match text {
        "parity" => Ok(Rule::Parity),
        "winding" => Ok(Rule::Winding),
        _ => Err("parity or winding".into()),
    }
}

fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let all: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse::<f64>()).collect();
    let all = all.map_err(|_| format!("{N} numbers separated by commas are needed"))?;
    all.try_into().map_err(|_| format!("{N} numbers separated by commas are needed"))
}
