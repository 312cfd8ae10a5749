//! `flocks.csv`: order parameters, a line a flock and frame.

use super::{Writer, at, create};
use jetsam::{FrameStats, World};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

const HEADER: &str = "time,flock,n,polarization,milling";

/// The open file.
pub struct FlocksCsv {
    path: PathBuf,
    file: BufWriter<File>,
}

impl FlocksCsv {
    /// Opens it and writes the header.
    pub fn create(folder: &Path) -> miette::Result<Self> {
        let path = folder.join("flocks.csv");
        let mut file = create(&path)?;
        writeln!(file, "{HEADER}").map_err(at(&path))?;
        Ok(Self { path, file })
    }
}

impl Writer for FlocksCsv {
    fn write(&mut self, world: &World, _: &FrameStats) -> miette::Result<()> {
        for flock in 0..world.model().flocks.len() {
            let o = world.flock_order(flock);
            let line = writeln!(self.file, "{},{flock},{},{},{}", world.time(), o.n, o.polarization, o.milling);
            line.map_err(at(&self.path))?;
        }
        Ok(self.file.flush().map_err(at(&self.path))?)
    }

    fn finish(&mut self) -> miette::Result<()> {
        Ok(())
    }
}
