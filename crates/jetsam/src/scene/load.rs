//! Reading a scene: text to [`Scene`], `--set` overrides, ranges; and the JSON schema.

use super::{Preset, Scene};
use crate::error::{Error, Result};
use crate::params::{self, PARAMS};
use miette::NamedSource;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::de::{DeTable, DeValue};
use toml::{Table, Value};

/// Largest scene file read (bytes).
const LARGEST_FILE: u64 = 16 << 20;

/// The text a scene came from.
#[derive(Clone, Debug, Default)]
pub struct Source {
    /// Name shown in messages: a path, or a built-in scene's name. Empty for a scene made in code.
    pub name: String,
    /// The whole text.
    pub text: String,
    /// Folder that paths in the scene are relative to.
    pub folder: PathBuf,
    /// Whether the scene came with the program, and its meshes with it.
    pub builtin: bool,
}

impl Scene {
    /// Reads a scene file. `overrides` are `key=value` pairs with dotted keys (`solver.support=2.4`, `rigid.0.density=300`).
    ///
    /// # Errors
    /// A missing or unreadable file, a syntax error, an unknown key, a value of the wrong type or out of its
    /// range: each with line and remedy.
    pub fn load(path: &Path, overrides: &[String]) -> Result<Self> {
        Self::parse(Source::read(path)?, overrides)
    }

    /// Reads a scene from text. See [`Scene::load`].
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn parse(source: Source, overrides: &[String]) -> Result<Self> {
        let mut scene: Scene = toml::from_str(&source.text).map_err(|e| source.syntax(&e))?;
        let asks = |s: &Scene| s.solver.preset == Preset::Article;
        if !overrides.is_empty() || asks(&scene) {
            let mut table: Table = toml::from_str(&source.text).map_err(|e| source.syntax(&e))?;
            for one in overrides {
                set(&mut table, one).map_err(|(message, help)| source.error("", message, help))?;
            }
            let read = |table: Table| {
                Scene::deserialize_table(table)
                    .map_err(|e| source.error("", format!("--set: {}", e.message()), hint(e.message())))
            };
            scene = read(table.clone())?;
            if asks(&scene) {
                article(&mut table);
                scene = read(table)?;
            }
        }
        scene.source = source;
        scene.check_ranges()?;
        Ok(scene)
    }

    /// The scene with other values: `key=value` pairs as for [`Scene::load`]; `key=` without a value takes the key away.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn with(&self, overrides: &[String]) -> Result<Self> {
        let fault = |e: &toml::ser::Error| self.error("", e.to_string(), "report this");
        let mut table = Table::try_from(self).map_err(|e| fault(&e))?;
        for one in overrides {
            set(&mut table, one).map_err(|(message, help)| self.error("", message, help))?;
        }
        let mut scene =
            Self::deserialize_table(table).map_err(|e| self.error("", e.message().to_owned(), hint(e.message())))?;
        scene.source = self.source.clone();
        scene.check_ranges()?;
        Ok(scene)
    }

    /// The value at a dotted path, if the scene says one.
    pub fn value(&self, path: &str) -> Option<Value> {
        let whole = Value::try_from(self).ok()?;
        path.split('.').try_fold(whole, |at, part| match at {
            Value::Table(mut t) => t.remove(part),
            Value::Array(mut a) => part.parse::<usize>().ok().filter(|i| *i < a.len()).map(|i| a.swap_remove(i)),
            _ => None,
        })
    }

    fn deserialize_table(table: Table) -> std::result::Result<Self, toml::de::Error> {
        use serde::Deserialize as _;
        Scene::deserialize(table)
    }

    /// An error about the value at a dotted path (`rigid.0.position`), shown with its line when it is known.
    pub fn error(&self, path: &str, message: impl Into<String>, help: impl Into<String>) -> Box<Error> {
        self.source.error(path, message, help)
    }

    fn check_ranges(&self) -> Result<()> {
        let value = Value::try_from(self).map_err(|e| self.error("", e.to_string(), "report this"))?;
        self.check_value(&value, &mut Vec::new())
    }

    /// Every number is finite, and inside its range if the table of parameters knows it.
    fn check_value(&self, value: &Value, path: &mut Vec<String>) -> Result<()> {
        match value {
            Value::Table(table) => {
                for (key, value) in table {
                    path.push(key.clone());
                    self.check_value(value, path)?;
                    path.pop();
                }
            }
            Value::Array(items) => {
                for (index, value) in items.iter().enumerate() {
                    path.push(index.to_string());
                    self.check_value(value, path)?;
                    path.pop();
                }
            }
            Value::Float(_) | Value::Integer(_) => {
                let number = value.as_float().unwrap_or_else(|| value.as_integer().unwrap_or(0) as f64);
                let plain: Vec<&str> =
                    path.iter().map(String::as_str).filter(|p| p.parse::<usize>().is_err()).collect();
                let place = path.join(".");
                if !number.is_finite() {
                    return Err(self.error(&place, format!("`{place}` is {number}"), "give a finite number"));
                }
                if let Some(p) = params::find(&plain.join("."))
                    && !(p.min..=p.max).contains(&number)
                {
                    let message = format!("`{place}` = {number} is out of range");
                    let help = format!("give a value from {} to {} ({})", p.min, p.max, p.unit);
                    return Err(self.error(&place, message, help));
                }
            }
            _ => {}
        }
        Ok(())
    }
}

impl Source {
    /// Reads the text of a scene file.
    ///
    /// # Errors
    /// A file that is missing, unreadable or too large.
    pub fn read(path: &Path) -> Result<Self> {
        let io = |source| Box::new(Error::Io { path: path.display().to_string(), source });
        let size = std::fs::metadata(path).map_err(io)?.len();
        if size > LARGEST_FILE {
            return Err(io(std::io::Error::other(format!("{size} bytes are too many for a scene file"))));
        }
        let text = std::fs::read_to_string(path).map_err(io)?;
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        Ok(Self { name: path.display().to_string(), text, folder, builtin: false })
    }

    /// An error about the value at a dotted path.
    pub fn error(&self, path: &str, message: impl Into<String>, help: impl Into<String>) -> Box<Error> {
        let span = if path.is_empty() { None } else { self.locate(path) };
        self.error_at(span, message.into(), help.into())
    }

    fn syntax(&self, error: &toml::de::Error) -> Box<Error> {
        self.error_at(error.span(), error.message().to_owned(), hint(error.message()))
    }

    fn error_at(&self, span: Option<Range<usize>>, message: String, help: String) -> Box<Error> {
        let span = span.filter(|s| s.end <= self.text.len());
        let place = match &span {
            Some(s) => format!("{}:{}: ", self.name, 1 + self.text[..s.start].matches('\n').count()),
            None if self.name.is_empty() => String::new(),
            None => format!("{}: ", self.name),
        };
        let source_code = span.as_ref().map(|_| NamedSource::new(&self.name, self.text.clone()));
        Box::new(Error::Scene { place, message, help, source_code, span: span.map(Into::into) })
    }

    /// Byte range of the value at a dotted path, or of its nearest parent that is written down.
    fn locate(&self, path: &str) -> Option<Range<usize>> {
        let document = DeTable::parse(&self.text).ok()?;
        let mut parts = path.split('.');
        let first = document.get_ref().get(parts.next()?)?;
        let (mut value, mut span) = (first.get_ref(), first.span());
        for part in parts {
            let next = match value {
                DeValue::Table(table) => table.get(part),
                DeValue::Array(array) => part.parse::<usize>().ok().and_then(|i| array.get(i)),
                _ => None,
            };
            let Some(next) = next else { break };
            (value, span) = (next.get_ref(), next.span());
        }
        Some(span)
    }
}

/// Adds the choices of the article where the scene says nothing else.
fn article(table: &mut Table) {
    let choose = |table: &mut Value, key: &str, value: Value| {
        if let Value::Table(t) = table {
            t.entry(key).or_insert(value);
        }
    };
    if let Some(solver) = table.get_mut("solver") {
        for (key, word) in [
            ("coupling", "spring"),
            ("damping", "full"),
            ("surface", "spheres"),
            ("kernel", "mueller"),
            ("viscosity", "mueller"),
            ("pressure_force", "mueller"),
        ] {
            choose(solver, key, word.into());
        }
    }
    if let Some(Value::Array(rigid)) = table.get_mut("rigid") {
        rigid.iter_mut().for_each(|body| choose(body, "friction", Value::Float(0.0)));
    }
}

/// A remedy for a message of the parser: the nearest known key if it names an unknown one.
fn hint(message: &str) -> String {
    let mut quoted = message.split('`').skip(1).step_by(2);
    let nearest = quoted.next().and_then(|wrong| {
        let known: Vec<&str> = quoted.collect();
        let score = |k: &&&str| (strsim::jaro_winkler(wrong, k) * 1e6) as u64;
        known.iter().max_by_key(score).copied().filter(|k| strsim::jaro_winkler(wrong, k) > 0.7)
    });
    match nearest {
        Some(key) => format!("did you mean `{key}`?"),
        None => "`jetsam schema` prints everything a scene file may hold".into(),
    }
}

/// Puts `key=value` into a table. The value is read as TOML; a bare word counts as a string.
fn set(table: &mut Table, one: &str) -> std::result::Result<(), (String, String)> {
    let usage = "write --set key=value, e.g. --set solver.support=2.4 or --set rigid.0.density=300";
    let (key, text) = one.split_once('=').ok_or((format!("--set {one}: no `=`"), usage.into()))?;
    let value = match toml::from_str::<Table>(&format!("v = {text}")) {
        Ok(mut parsed) => parsed.remove("v").unwrap_or(Value::String(text.into())),
        Err(_) => Value::String(text.trim().into()),
    };
    let parts: Vec<&str> = key.trim().split('.').collect();
    let (last, parents) =
        parts.split_last().filter(|(l, _)| !l.is_empty()).ok_or((format!("--set {one}: no key"), usage.to_owned()))?;
    let mut root = Value::Table(std::mem::take(table));
    let mut at = &mut root;
    for part in parents {
        at = step_into(at, part).ok_or((format!("--set {key}: there is no `{part}`"), usage.to_owned()))?;
    }
    match at {
        Value::Table(t) if text.trim().is_empty() => {
            t.remove(*last);
        }
        Value::Table(t) => {
            t.insert((*last).into(), value);
        }
        Value::Array(a) => {
            let n = a.len();
            let slot = last.parse::<usize>().ok().and_then(|i| a.get_mut(i));
            *slot.ok_or((format!("--set {key}: `{last}` is not an index below {n}"), usage.to_owned()))? = value;
        }
        _ => return Err((format!("--set {key}: `{last}` is below a plain value"), usage.into())),
    }
    if let Value::Table(t) = root {
        *table = t;
    }
    Ok(())
}

fn step_into<'a>(value: &'a mut Value, part: &str) -> Option<&'a mut Value> {
    match value {
        Value::Table(t) => Some(t.entry(part).or_insert_with(|| Value::Table(Table::new()))),
        Value::Array(a) => match part.parse::<usize>() {
            Ok(i) => a.get_mut(i),
            // an element by its name: rigid.monkey.density
            Err(_) => a.iter_mut().find(|v| v.get("name").and_then(Value::as_str) == Some(part)),
        },
        _ => None,
    }
}

/// JSON schema of the scene file, with unit, default and range of every parameter.
pub fn schema() -> serde_json::Value {
    let mut schema = schemars::schema_for!(Scene).to_value();
    for p in PARAMS {
        let Some(place) = schema_place(&schema, p.path) else { continue };
        let field = schema.pointer_mut(&place).expect("the place was found");
        field["unit"] = p.unit.into();
        let target = if field.get("items").is_some() { &mut field["items"] } else { field };
        target["minimum"] = p.min.into();
        target["maximum"] = p.max.into();
    }
    schema
}

/// JSON pointer to the field of a dotted path (`fluid.density`, `emitter.outlet.hose.speed`) in the schema.
pub fn schema_place(schema: &serde_json::Value, path: &str) -> Option<String> {
    let parts: Vec<&str> = path.split('.').collect();
    walk(schema, String::new(), &parts)
}

/// Looks below `at` for a field: through references, elements of arrays and the alternatives of a choice.
fn walk(schema: &serde_json::Value, at: String, path: &[&str]) -> Option<String> {
    let Some((key, rest)) = path.split_first() else { return Some(at) };
    let node = schema.pointer(&at)?;
    if let Some(to) = node.get("$ref").and_then(|r| r.as_str()) {
        return walk(schema, to.strip_prefix('#')?.into(), path);
    }
    if node.get("properties").and_then(|p| p.get(key)).is_some() {
        return walk(schema, format!("{at}/properties/{key}"), rest);
    }
    if node.get("items").is_some() {
        return walk(schema, format!("{at}/items"), path);
    }
    ["oneOf", "anyOf", "allOf"].into_iter().find_map(|choice| {
        let n = node.get(choice)?.as_array()?.len();
        (0..n).find_map(|k| walk(schema, format!("{at}/{choice}/{k}"), path))
    })
}

impl Scene {
    /// The scene as TOML text.
    ///
    /// # Errors
    /// None in practice: every scene can be written.
    pub fn to_toml(&self) -> std::result::Result<String, toml::ser::Error> {
        toml::to_string_pretty(self)
    }
}
