//! Particles as legacy VTK, binary (big-endian): opens in ParaView and VisIt.

use super::particles::Row;
use std::io::{self, Write};

/// The particles of a frame.
pub fn write_particles(file: &mut impl Write, rows: &[Row], time: f64) -> io::Result<()> {
    let n = rows.len();
    writeln!(file, "# vtk DataFile Version 3.0\njetsam, time {time} s\nBINARY\nDATASET POLYDATA")?;
    writeln!(file, "POINTS {n} float")?;
    floats(file, rows, 0..3)?;
    writeln!(file, "\nVERTICES {n} {}", 2 * n)?;
    for i in 0..n as u32 {
        file.write_all(&1u32.to_be_bytes())?;
        file.write_all(&i.to_be_bytes())?;
    }
    writeln!(file, "\nPOINT_DATA {n}\nVECTORS velocity float")?;
    floats(file, rows, 3..6)?;
    for (name, at) in [("density", 6), ("pressure", 7)] {
        writeln!(file, "\nSCALARS {name} float 1\nLOOKUP_TABLE default")?;
        floats(file, rows, at..at + 1)?;
    }
    for (name, which) in [("kind", 0), ("owner", 1), ("id", 2)] {
        writeln!(file, "\nSCALARS {name} unsigned_int 1\nLOOKUP_TABLE default")?;
        for row in rows {
            let value = [row.kind.into(), row.owner, row.id][which];
            file.write_all(&value.to_be_bytes())?;
        }
    }
    writeln!(file)
}

fn floats(file: &mut impl Write, rows: &[Row], which: std::ops::Range<usize>) -> io::Result<()> {
    for number in rows.iter().flat_map(|row| &row.numbers[which.clone()]) {
        file.write_all(&number.to_be_bytes())?;
    }
    Ok(())
}
