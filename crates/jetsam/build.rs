//! Lists the validation cases: a file put into `scenes/validation/` is a case, with nothing else to edit.

use std::fmt::Write;
use std::path::{Path, PathBuf};

fn main() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/validation");
    let mut files = Vec::new();
    gather(&folder, &mut files);
    files.sort();
    let with = |extension: &'static str| files.iter().filter(move |f| f.extension().is_some_and(|e| e == extension));
    let mut text = String::from("const CASES: &[Builtin] = &[\n");
    for file in with("toml") {
        let name = file.file_stem().unwrap_or_default();
        writeln!(text, "Builtin {{ name: {name:?}, text: include_str!({file:?}) }},").expect("writing to memory");
    }
    text += "];\nconst DATA: &[(&str, &str)] = &[\n";
    for file in with("csv") {
        let name = file.strip_prefix(&folder).unwrap_or(file).to_string_lossy().replace('\\', "/");
        writeln!(text, "({name:?}, include_str!({file:?})),").expect("writing to memory");
    }
    text += "];\n";
    let out = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets OUT_DIR")).join("validation.rs");
    std::fs::write(&out, text).unwrap_or_else(|e| panic!("{}: {e}", out.display()));
}

fn gather(folder: &Path, files: &mut Vec<PathBuf>) {
    println!("cargo::rerun-if-changed={}", folder.display());
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() { gather(&path, files) } else { files.push(path) }
    }
}
