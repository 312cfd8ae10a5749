//! One file of particles a frame: what is written, whatever the format.

use super::{Writer, at, create, frame_path};
use jetsam::interact::pressure::of_particle;
use jetsam::state::{Kind, State};
use jetsam::{FrameStats, World};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// One particle in a file.
pub struct Row {
    /// Position (m) and velocity (m/s), then density (kg/m^3) and pressure (Pa); the latter two are 0 for bodies.
    pub numbers: [f32; 8],
    /// 0 fluid, 1 rigid.
    pub kind: u8,
    /// Index of the fluid or of the body.
    pub owner: u32,
    /// Identity inside the kind.
    pub id: u32,
}

/// Names of [`Row::numbers`].
pub const NUMBERS: [&str; 8] = ["x", "y", "z", "vx", "vy", "vz", "density", "pressure"];

type Format = fn(&mut BufWriter<File>, &[Row], f64) -> io::Result<()>;

/// Writes a file a frame.
pub struct Particles {
    folder: PathBuf,
    extension: &'static str,
    format: Format,
}

impl Particles {
    /// Files with this extension, in this format.
    pub fn new(folder: &Path, extension: &'static str, format: Format) -> Self {
        Self { folder: folder.into(), extension, format }
    }
}

impl Writer for Particles {
    fn write(&mut self, world: &World, stats: &FrameStats) -> miette::Result<()> {
        let path = frame_path(&self.folder, stats.frame, self.extension);
        let mut file = create(&path)?;
        (self.format)(&mut file, &rows(world), stats.time).and_then(|()| file.flush()).map_err(at(&path))?;
        Ok(())
    }

    fn finish(&mut self) -> miette::Result<()> {
        Ok(())
    }
}

/// Fluid and rigid particles in the order of their ids.
fn rows(world: &World) -> Vec<Row> {
    let State { particles: p, .. } = world.state();
    let mut all = Vec::new();
    for kind in [Kind::Fluid, Kind::Rigid] {
        let mut order: Vec<usize> = p.segment(kind).collect();
        order.sort_unstable_by_key(|&i| p.id[i]);
        all.extend(order.into_iter().map(|i| {
            let r = &p.record[i];
            let (mut density, mut pressure) = (0.0, 0.0);
            if kind == Kind::Fluid {
                density = p.density[i] * world.model().fluids[p.owner[i] as usize].density;
                pressure = of_particle(world.model(), p, i);
            }
            let ([x, y, z], [vx, vy, vz]) = (r.x, r.v);
            Row { numbers: [x, y, z, vx, vy, vz, density, pressure], kind: kind as u8, owner: p.owner[i], id: p.id[i] }
        }));
    }
    all
}
