//! `bodies.csv`: place, orientation, velocities, force and torque of every rigid body, a line a body and frame.

use super::{Writer, at, create};
use jetsam::state::Body;
use jetsam::{FrameStats, World};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

const HEADER: &str = "time,body,name,x,y,z,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz,fx,fy,fz,tx,ty,tz";

/// The open file.
pub struct BodiesCsv {
    path: PathBuf,
    file: BufWriter<File>,
}

impl BodiesCsv {
    /// Opens it and writes the header.
    pub fn create(folder: &Path) -> miette::Result<Self> {
        let path = folder.join("bodies.csv");
        let mut file = create(&path)?;
        writeln!(file, "{HEADER}").map_err(at(&path))?;
        Ok(Self { path, file })
    }
}

impl Writer for BodiesCsv {
    fn write(&mut self, world: &World, _: &FrameStats) -> miette::Result<()> {
        let bodies = world.state().bodies.body.iter().enumerate().filter(|(_, b)| !b.is_static());
        for (index, body) in bodies {
            line(&mut self.file, world.time(), index, body).map_err(at(&self.path))?;
        }
        Ok(self.file.flush().map_err(at(&self.path))?)
    }

    fn finish(&mut self) -> miette::Result<()> {
        Ok(())
    }
}

fn line(file: &mut impl Write, time: f64, index: usize, b: &Body) -> io::Result<()> {
    write!(file, "{time},{index},{}", quoted(&b.name))?;
    let turn = [b.q.w, b.q.x, b.q.y, b.q.z];
    let vectors = [b.v, b.omega, b.force, b.torque];
    for number in b.x.to_array().into_iter().chain(turn).chain(vectors.into_iter().flat_map(|v| v.to_array())) {
        write!(file, ",{number}")?;
    }
    writeln!(file)
}

/// A name as RFC 4180 wants it.
pub(super) fn quoted(name: &str) -> String {
    if name.contains([',', '"', '\n', '\r']) { format!("\"{}\"", name.replace('"', "\"\"")) } else { name.to_owned() }
}
