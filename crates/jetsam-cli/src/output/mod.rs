//! What a run leaves behind: one writer a kind of file, each called once a frame.

mod bodies_csv;
mod flocks_csv;
mod particles;
pub mod pictures;
pub mod ply;
mod probes_csv;
mod stats;
mod video;
mod vtk;

use crate::args::{PictureArgs, Save};
use jetsam::{Error, FrameStats, Scene, World};
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

/// Something that takes note of every frame.
trait Writer {
    /// A step has ended.
    fn step(&mut self, _: &World) {}
    /// Whether it has to be called after every step.
    fn looks_between(&self) -> bool {
        false
    }
    /// A frame has ended.
    fn write(&mut self, world: &World, stats: &FrameStats) -> miette::Result<()>;
    /// The run has ended.
    fn finish(&mut self) -> miette::Result<()>;
}

/// All writers of a run.
pub struct Outputs(Vec<Box<dyn Writer>>);

impl Outputs {
    /// Makes the folder and opens what was asked for in it; of pictures, how they look and who draws them.
    pub fn create(
        folder: &Path,
        save: &[Save],
        pictures: (&PictureArgs, pictures::Artist),
        scene: &Scene,
        world: &World,
    ) -> miette::Result<Self> {
        std::fs::create_dir_all(folder).map_err(at(folder))?;
        let wants = |kind| save.contains(&kind);
        let mut all: Vec<Box<dyn Writer>> = vec![Box::new(stats::Stats::create(folder)?)];
        if wants(Save::Csv) {
            all.push(Box::new(bodies_csv::BodiesCsv::create(folder)?));
            if !scene.probe.is_empty() {
                all.push(Box::new(probes_csv::ProbesCsv::create(folder, scene, world)?));
            }
            if !world.model().flocks.is_empty() {
                all.push(Box::new(flocks_csv::FlocksCsv::create(folder)?));
            }
        }
        if save.iter().any(|kind| kind.is_picture()) {
            all.push(Box::new(pictures::Pictures::create(folder, save, pictures, scene, world)?));
        }
        if wants(Save::Ply) {
            all.push(Box::new(particles::Particles::new(folder, "ply", ply::write_particles)));
        }
        if wants(Save::Vtk) {
            all.push(Box::new(particles::Particles::new(folder, "vtk", vtk::write_particles)));
        }
        Ok(Self(all))
    }

    /// Whether [`Outputs::step`] has to be called after every step.
    pub fn look_between(&self) -> bool {
        self.0.iter().any(|w| w.looks_between())
    }

    /// A step has been made.
    pub fn step(&mut self, world: &World) {
        self.0.iter_mut().for_each(|w| w.step(world));
    }

    /// A frame has ended.
    pub fn write(&mut self, world: &World, stats: &FrameStats) -> miette::Result<()> {
        self.0.iter_mut().try_for_each(|w| w.write(world, stats))
    }

    /// The run has ended.
    pub fn finish(&mut self) -> miette::Result<()> {
        self.0.iter_mut().try_for_each(|w| w.finish())
    }
}

/// Opens a file for writing.
pub fn create(path: &Path) -> miette::Result<BufWriter<File>> {
    Ok(BufWriter::new(File::create(path).map_err(at(path))?))
}

/// Says of an error of the system which path it is about.
pub fn at(path: &Path) -> impl Fn(io::Error) -> Error {
    move |source| Error::Io { path: path.display().to_string(), source }
}

/// How many files of frames from this one on there are without a gap: those of an earlier, longer run.
pub fn frames_from(folder: &Path, frame: u64) -> usize {
    let files = |extension| (frame..).take_while(|f| frame_path(folder, *f, extension).exists()).count();
    ["png", "ply", "vtk"].into_iter().map(files).sum()
}

/// `frame_00042.png`
fn frame_path(folder: &Path, frame: u64, extension: &str) -> PathBuf {
    folder.join(format!("frame_{frame:05}.{extension}"))
}
