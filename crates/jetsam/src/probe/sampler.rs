//! The course of probes in time.

use super::Probes;
use crate::error::Result;
use crate::scene::Scene;
use crate::world::World;

/// Readings of one probe, in the order of time.
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// Times (s).
    pub time: Vec<f64>,
    /// Readings.
    pub value: Vec<f64>,
}

/// Reads the probes of a scene when they are due and keeps what they read.
#[derive(Debug)]
pub struct Sampler {
    probes: Probes,
    due: Vec<f64>,
    series: Vec<Series>,
}

impl Sampler {
    /// Reads every probe of the scene for the first time.
    ///
    /// # Errors
    /// As [`Probes::new`].
    pub fn new(scene: &Scene, world: &World) -> Result<Self> {
        let probes = Probes::new(scene, world)?;
        let n = probes.names().len();
        let mut sampler = Self { probes, due: vec![world.time(); n], series: vec![Series::default(); n] };
        sampler.take(world, vec![true; n]);
        Ok(sampler)
    }

    /// Whether some probe is read between frames: [`Sampler::step`] has then to be called after every step.
    pub fn looks_between(&self) -> bool {
        self.probes.intervals.iter().any(Option::is_some)
    }

    /// After every step: reads the probes whose interval is over.
    pub fn step(&mut self, world: &World) {
        let due = |(interval, due): (&Option<f64>, &f64)| interval.is_some() && world.time() >= *due;
        let wanted: Vec<bool> = self.probes.intervals.iter().zip(&self.due).map(due).collect();
        if wanted.contains(&true) {
            self.take(world, wanted);
        }
    }

    /// At the end of every frame: reads the probes that have no interval.
    pub fn frame(&mut self, world: &World) {
        let wanted: Vec<bool> = self.probes.intervals.iter().map(Option::is_none).collect();
        if wanted.contains(&true) {
            self.take(world, wanted);
        }
    }

    fn take(&mut self, world: &World, wanted: Vec<bool>) {
        let time = world.time();
        let values = self.probes.read(world, &wanted);
        for (i, value) in values.into_iter().enumerate().filter(|(i, _)| wanted[*i]) {
            self.series[i].time.push(time);
            self.series[i].value.push(value);
            // the first step at or after each whole interval, a rounding error early if need be
            let interval = self.probes.intervals[i].unwrap_or(0.0);
            if interval > 0.0 {
                self.due[i] = ((time / interval + 1e-6).floor() + 1.0) * interval * (1.0 - 1e-9);
            }
        }
    }

    /// The probes.
    pub fn probes(&self) -> &Probes {
        &self.probes
    }

    /// What was read so far, in the order of the probes.
    pub fn series(&self) -> &[Series] {
        &self.series
    }

    /// What was read, at the end.
    pub fn into_series(self) -> Vec<Series> {
        self.series
    }
}
