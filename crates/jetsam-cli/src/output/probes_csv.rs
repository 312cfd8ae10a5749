//! `probes.csv`: what the scene's probes read, a line a reading.

use super::{Writer, at, create};
use jetsam::probe::Sampler;
use jetsam::{FrameStats, Scene, World};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// The open file and the probes.
pub struct ProbesCsv {
    path: PathBuf,
    file: BufWriter<File>,
    sampler: Sampler,
    /// Readings written so far, probe by probe.
    written: Vec<usize>,
}

impl ProbesCsv {
    /// Opens it, writes the header, and reads every probe for the first time.
    pub fn create(folder: &Path, scene: &Scene, world: &World) -> miette::Result<Self> {
        let path = folder.join("probes.csv");
        let mut file = create(&path)?;
        writeln!(file, "time,probe,value").map_err(at(&path))?;
        let sampler = Sampler::new(scene, world).map_err(|e| *e)?;
        let written = vec![0; scene.probe.len()];
        Ok(Self { path, file, sampler, written })
    }
}

impl Writer for ProbesCsv {
    fn looks_between(&self) -> bool {
        self.sampler.looks_between()
    }

    fn step(&mut self, world: &World) {
        self.sampler.step(world);
    }

    fn write(&mut self, world: &World, stats: &FrameStats) -> miette::Result<()> {
        if stats.frame > 0 {
            self.sampler.frame(world);
        }
        let mut fresh = Vec::new();
        for (probe, series) in self.sampler.series().iter().enumerate() {
            for k in self.written[probe]..series.time.len() {
                fresh.push((series.time[k], probe, series.value[k]));
            }
            self.written[probe] = series.time.len();
        }
        fresh.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (time, probe, value) in fresh {
            let name = super::bodies_csv::quoted(&self.sampler.probes().names()[probe]);
            writeln!(self.file, "{time},{name},{value}").map_err(at(&self.path))?;
        }
        Ok(self.file.flush().map_err(at(&self.path))?)
    }

    fn finish(&mut self) -> miette::Result<()> {
        Ok(())
    }
}
