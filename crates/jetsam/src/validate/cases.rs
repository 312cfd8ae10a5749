//! The validation cases that come with the program: every file of `scenes/validation/`, found by the build script.

use crate::error::Result;
use crate::formula::nearest;
use crate::scene::Source;
use crate::scene::builtin::Builtin;
use std::path::Path;

include!(concat!(env!("OUT_DIR"), "/validation.rs"));

/// Cases that come with the program, by name: the first letter is their group.
pub fn builtin() -> &'static [Builtin] {
    CASES
}

/// A data file of the built-in cases, by its path relative to them.
pub(super) fn data(path: &str) -> Option<&'static str> {
    DATA.iter().find(|(name, _)| *name == path).map(|(_, text)| *text)
}

/// Cases by name, by the beginning of a name (`A5`), by group (`A`) or by the path of a scene file; all when nothing is
/// asked for.
///
/// # Errors
/// A word that is none of these; a file that cannot be read.
pub fn select(words: &[String]) -> Result<Vec<(String, Source)>> {
    let source = |b: &Builtin| {
        let source = Source { name: b.name.into(), text: b.text.into(), builtin: true, ..Source::default() };
        (b.name.to_owned(), source)
    };
    if words.is_empty() {
        return Ok(CASES.iter().map(source).collect());
    }
    let mut all: Vec<(String, Source)> = Vec::new();
    for word in words {
        let path = Path::new(word);
        let found: Vec<_> = CASES.iter().filter(|c| answers(c.name, word)).map(source).collect();
        if !found.is_empty() {
            let known: Vec<String> = all.iter().map(|c| c.0.clone()).collect();
            all.extend(found.into_iter().filter(|c| !known.contains(&c.0)));
        } else if path.extension().is_some() || path.is_file() {
            let name = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
            all.push((name, Source::read(path)?));
        } else {
            let help = match nearest(word, CASES.iter().map(|c| c.name)) {
                Some(name) => format!("did you mean `{name}`? `jetsam validate --list` lists the cases"),
                None => "`jetsam validate --list` lists the cases; a file is given by its path".into(),
            };
            return Err(Source::default().error("", format!("there is no validation case `{word}`"), help));
        }
    }
    Ok(all)
}

/// Whether a case is meant: its name, its number, its group.
fn answers(name: &str, word: &str) -> bool {
    let number = name.split('-').next().unwrap_or(name);
    let group = number.trim_end_matches(|c: char| c.is_ascii_digit() || c.is_ascii_lowercase());
    let whole_number = |rest: &str| !rest.starts_with(|c: char| c.is_ascii_digit());
    name == word || group == word || word.len() > 1 && name.strip_prefix(word).is_some_and(whole_number)
}
