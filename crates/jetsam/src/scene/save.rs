//! Writing a scene that was changed: TOML beside its meshes.

use super::Scene;
use crate::error::{Error, Result};
use std::path::Path;
use toml::{Table, Value};

impl Scene {
    /// Writes the scene to a file from which it can be read again: meshes that came with the program are written beside it, paths
    /// of others become absolute. Comments of the file it was read from are not kept.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn save(&self, path: &Path) -> Result<()> {
        let fault = |e: &dyn std::fmt::Display| self.error("", e.to_string(), "report this");
        let mut table = Table::try_from(self).map_err(|e| fault(&e))?;
        let mut meshes = Vec::new();
        table.iter_mut().for_each(|(_, value)| each_mesh(value, &mut |given| meshes.push(given.clone())));
        let folder = path.parent().unwrap_or(Path::new(""));
        for given in &meshes {
            if let Some((_, bytes)) = super::builtin::mesh(given).filter(|_| self.source.builtin) {
                write(&folder.join(given), bytes)?;
            }
        }
        let absolute = |given: &mut String| {
            let whole = self.source.folder.join(&*given);
            let builtin = self.source.builtin && super::builtin::mesh(given).is_some();
            if let Some(found) = whole.canonicalize().ok().filter(|_| !builtin) {
                *given = found.display().to_string();
            }
        };
        table.iter_mut().for_each(|(_, value)| each_mesh(value, &mut { absolute }));
        let text = toml::to_string(&table).map_err(|e| fault(&e))?;
        write(path, text.as_bytes())
    }
}

/// Calls `f` with the path of every mesh.
fn each_mesh(value: &mut Value, f: &mut impl FnMut(&mut String)) {
    match value {
        Value::Table(table) => {
            if let Some(Value::Table(mesh)) = table.get_mut("mesh")
                && let Some(Value::String(path)) = mesh.get_mut("path")
            {
                f(path);
            }
            table.iter_mut().for_each(|(_, v)| each_mesh(v, f));
        }
        Value::Array(items) => items.iter_mut().for_each(|v| each_mesh(v, f)),
        _ => {}
    }
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let io = |source| Box::new(Error::Io { path: path.display().to_string(), source });
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(io)?;
    }
    std::fs::write(path, bytes).map_err(io)
}
