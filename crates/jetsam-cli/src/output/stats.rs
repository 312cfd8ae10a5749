//! `stats.jsonl`: one JSON object a frame.

use super::{Writer, at, create};
use jetsam::{FrameStats, World};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// The open file.
pub struct Stats {
    path: PathBuf,
    file: BufWriter<File>,
}

impl Stats {
    /// Opens it.
    pub fn create(folder: &Path) -> miette::Result<Self> {
        let path = folder.join("stats.jsonl");
        Ok(Self { file: create(&path)?, path })
    }
}

impl Writer for Stats {
    fn write(&mut self, _: &World, stats: &FrameStats) -> miette::Result<()> {
        let line = serde_json::to_string(stats).expect("statistics are plain");
        // at once, so that a run can be watched
        Ok(writeln!(self.file, "{line}").and_then(|()| self.file.flush()).map_err(at(&self.path))?)
    }

    fn finish(&mut self) -> miette::Result<()> {
        Ok(())
    }
}
