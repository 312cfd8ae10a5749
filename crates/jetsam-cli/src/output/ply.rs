//! Points as binary little-endian PLY: particles of a frame, or of a voxelized mesh.

use super::particles::{NUMBERS, Row};
use glam::DVec3;
use std::io::{self, Write};

/// The particles of a frame.
pub fn write_particles(file: &mut impl Write, rows: &[Row], time: f64) -> io::Result<()> {
    writeln!(file, "ply\nformat binary_little_endian 1.0\ncomment time {time} s\nelement vertex {}", rows.len())?;
    for name in NUMBERS {
        writeln!(file, "property float {name}")?;
    }
    writeln!(file, "property uchar kind\nproperty uint owner\nproperty uint id\nend_header")?;
    for row in rows {
        for number in row.numbers {
            file.write_all(&number.to_le_bytes())?;
        }
        file.write_all(&[row.kind])?;
        file.write_all(&row.owner.to_le_bytes())?;
        file.write_all(&row.id.to_le_bytes())?;
    }
    Ok(())
}

/// Bare points.
pub fn write_points(file: &mut impl Write, points: &[DVec3]) -> io::Result<()> {
    writeln!(file, "ply\nformat binary_little_endian 1.0\nelement vertex {}", points.len())?;
    writeln!(file, "property float x\nproperty float y\nproperty float z\nend_header")?;
    for number in points.iter().flat_map(|p| p.as_vec3().to_array()) {
        file.write_all(&number.to_le_bytes())?;
    }
    Ok(())
}
