//! Reference curves: in the scene itself, or in CSV files beside it.

use crate::error::Result;
use crate::formula::Scope;
use crate::scene::{Expect, Scene};

/// The curve of an expectation in SI units; empty if it has none.
pub(super) fn read(scene: &Scene, scope: &Scope, path: &str, e: &Expect) -> Result<Vec<[f64; 2]>> {
    let at = |key: &str| format!("{path}.{key}");
    let mut curve = match &e.file {
        Some(_) if !e.curve.is_empty() => {
            return Err(scene.error(&at("file"), "a curve and a file are both given", "give one of them"));
        }
        Some(file) => from_file(scene, &at("file"), file, e.columns)?,
        None => e.curve.clone(),
    };
    if e.scale.is_empty() {
        return Ok(curve);
    }
    let mut factors = [1.0, 1.0, 0.0, 0.0];
    if e.scale.len() > factors.len() {
        let help = "give factors on time and value, then offsets: [ft, fv, ot, ov]";
        return Err(scene.error(&at("scale"), "there are more than four numbers", help));
    }
    for (k, f) in e.scale.iter().enumerate() {
        factors[k] = scope.number(scene, &format!("{path}.scale.{k}"), f)?;
    }
    for p in &mut curve {
        *p = [factors[0] * p[0] + factors[2], factors[1] * p[1] + factors[3]];
    }
    Ok(curve)
}

fn from_file(scene: &Scene, path: &str, file: &str, columns: [f64; 2]) -> Result<Vec<[f64; 2]>> {
    let text = match super::cases::data(file).filter(|_| scene.source.builtin) {
        Some(text) => text.to_owned(),
        None => std::fs::read_to_string(scene.source.folder.join(file))
            .map_err(|e| scene.error(path, format!("`{file}`: {e}"), "give a path relative to the scene file"))?,
    };
    if columns.iter().any(|c| !(1.0..=100.0).contains(c)) {
        return Err(scene.error(path, "columns are counted from 1", "give columns = [1, 2]"));
    }
    let mut curve = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let cells: Vec<&str> = line.split([',', ';', '\t']).map(str::trim).collect();
        let cell = |c: f64| cells.get(c as usize - 1).and_then(|s| s.parse::<f64>().ok()).filter(|x| x.is_finite());
        match (cell(columns[0]), cell(columns[1])) {
            (Some(t), Some(v)) => curve.push([t, v]),
            _ if curve.is_empty() => {} // the header
            _ => {
                let message = format!("`{file}`, line {}: `{line}` does not hold two numbers", number + 1);
                return Err(scene.error(path, message, "mend the line, mark it as a comment with #, or give columns"));
            }
        }
    }
    if curve.is_empty() {
        return Err(scene.error(path, format!("`{file}` holds no points"), "give lines of two numbers"));
    }
    Ok(curve)
}
