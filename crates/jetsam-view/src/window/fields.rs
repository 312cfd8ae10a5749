//! Every number of the scene as a slider or field: found by walking the scene along the paths of `params.rs`.

use egui::{DragValue, Slider, Ui};
use jetsam::params::{PARAMS, Param};
use jetsam::scene::{Scene, schema, schema_place};
use toml::Value;

/// A number, or a vector of numbers, of the scene.
#[derive(Clone, Debug)]
pub struct Field {
    /// Its path in the scene with indices: `rigid.0.density`.
    pub path: String,
    /// Unit, default and range.
    pub param: &'static Param,
    /// What it means.
    doc: String,
    /// What the scene says: nothing where the number is derived.
    value: Option<Value>,
}

/// All fields, table by table of the scene.
#[derive(Clone, Debug, Default)]
pub struct Fields {
    groups: Vec<(String, Vec<Field>)>,
    /// Only paths that hold this text are shown.
    pub search: String,
}

impl Fields {
    /// All fields of a scene.
    pub fn of(scene: &Scene, search: String) -> Self {
        let schema = schema();
        let Ok(whole) = Value::try_from(scene) else { return Self::default() };
        let mut groups: Vec<(String, Vec<Field>)> = Vec::new();
        for param in PARAMS {
            let place = schema_place(&schema, param.path);
            let doc = place.and_then(|at| schema.pointer(&at)?.get("description")?.as_str().map(str::to_owned));
            let parts: Vec<&str> = param.path.split('.').collect();
            let mut found = Vec::new();
            walk(&whole, String::new(), &parts, &mut found);
            for (path, value) in found {
                let group = group(&whole, &path);
                let field = Field { path, param, doc: doc.clone().unwrap_or_default(), value };
                match groups.iter_mut().find(|g| g.0 == group) {
                    Some((_, fields)) => fields.push(field),
                    None => groups.push((group, vec![field])),
                }
            }
        }
        Self { groups, search }
    }

    /// Number of fields.
    pub fn len(&self) -> usize {
        self.groups.iter().map(|g| g.1.len()).sum()
    }

    /// Draws the fields; returns what was changed as `key=value`.
    pub fn ui(&mut self, ui: &mut Ui) -> Vec<String> {
        let Self { groups, search } = self;
        ui.horizontal(|ui| {
            ui.label("find");
            ui.text_edit_singleline(search);
        });
        let mut changes = Vec::new();
        for (name, fields) in groups.iter_mut() {
            let shown = |f: &Field| search.is_empty() || f.path.contains(search.as_str());
            if !fields.iter().any(shown) {
                continue;
            }
            let first = ["world", "solver"].contains(&name.as_str());
            egui::CollapsingHeader::new(name.as_str())
                .id_salt(name.as_str())
                .default_open(first)
                .open((!search.is_empty()).then_some(true))
                .show(ui, |ui| {
                    egui::Grid::new(name.as_str()).num_columns(2).spacing([8.0, 4.0]).show(ui, |ui| {
                        for field in fields.iter_mut().filter(|f| shown(f)) {
                            if let Some(text) = field.ui(ui) {
                                changes.push(format!("{}={text}", field.path));
                            }
                            ui.end_row();
                        }
                    });
                });
        }
        changes
    }
}

impl Field {
    /// A row: name, then slider or fields with the unit. Returns the new value as TOML, or nothing to take it away.
    fn ui(&mut self, ui: &mut Ui) -> Option<String> {
        let short = self.path.rsplit('.').next().unwrap_or(&self.path);
        ui.label(short).on_hover_text(self.hint());
        ui.horizontal(|ui| match self.value.clone() {
            None => {
                let given = ui.small_button("derived").on_hover_text("give it a value");
                given.clicked().then(|| {
                    let start = self.param.default.unwrap_or(1.0).clamp(self.param.min, self.param.max);
                    // a number, or a vector where the table of parameters knows it as one
                    number(start)
                })
            }
            Some(Value::Array(items)) => self.vector(ui, items),
            Some(Value::String(text)) => self.text(ui, text),
            Some(value) => self.scalar(ui, &value),
        })
        .inner
    }

    fn hint(&self) -> String {
        let p = self.param;
        let default = p.default.map_or("derived or required".into(), |d| d.to_string());
        format!("{}\n\n{}\nunit {}   default {default}   from {} to {}", self.path, self.doc, p.unit, p.min, p.max)
    }

    fn scalar(&mut self, ui: &mut Ui, value: &Value) -> Option<String> {
        let p = self.param;
        let mut x = value.as_float().or_else(|| value.as_integer().map(|i| i as f64))?;
        let whole = value.is_integer();
        let before = x;
        ui.spacing_mut().slider_width = 110.0;
        let (low, high, log) = span(p, x);
        let slider = Slider::new(&mut x, low..=high)
            .logarithmic(log)
            .smallest_positive(low.max(high * 1e-6))
            .clamping(egui::SliderClamping::Edits)
            .custom_formatter(|x, _| short(x))
            .suffix(unit(p));
        let slider = if whole { slider.integer() } else { slider };
        ui.add(slider).on_hover_text(self.hint());
        let mut reset = false;
        if p.default.is_some_and(|d| d != x) {
            reset = ui.small_button("<").on_hover_text("back to the default").clicked();
        } else if p.default.is_none() && self.may_be_derived() {
            reset = ui.small_button("x").on_hover_text("derive it").clicked();
        }
        if reset {
            match p.default {
                Some(default) => x = default,
                None => {
                    self.value = None;
                    return Some(String::new());
                }
            }
        }
        if x == before || !x.is_finite() {
            return None;
        }
        let x = x.clamp(p.min, p.max);
        self.value = Some(if whole { Value::Integer(x as i64) } else { Value::Float(x) });
        Some(if whole { format!("{}", x as i64) } else { number(x) })
    }

    /// Optional numbers can be taken out of the scene; of required ones the scene would be incomplete.
    fn may_be_derived(&self) -> bool {
        !["resolution.spacing", "flock.count", "flock.radius", "flock.speed"].contains(&self.param.path)
            && !self.param.path.contains("outlet")
            && !["rigid.density", "rigid.mass"].contains(&self.param.path)
    }

    fn vector(&mut self, ui: &mut Ui, mut items: Vec<Value>) -> Option<String> {
        let p = self.param;
        let mut changed = false;
        for item in &mut items {
            match item {
                Value::String(text) => {
                    let edit = egui::TextEdit::singleline(text).desired_width(70.0);
                    changed |= ui.add(edit).lost_focus();
                }
                other => {
                    let mut x = other.as_float().or_else(|| other.as_integer().map(|i| i as f64)).unwrap_or(0.0);
                    let speed = 0.01 * x.abs().max(0.1);
                    let drag = DragValue::new(&mut x).speed(speed).range(p.min..=p.max);
                    if ui.add(drag.custom_formatter(|x, _| short(x))).on_hover_text(self.hint()).changed() {
                        (*other, changed) = (Value::Float(x), true);
                    }
                }
            }
        }
        ui.label(p.unit);
        self.value = Some(Value::Array(items.clone()));
        changed.then(|| {
            let texts: Vec<String> = items.iter().map(Value::to_string).collect();
            format!("[{}]", texts.join(", "))
        })
    }

    /// A formula.
    fn text(&mut self, ui: &mut Ui, mut text: String) -> Option<String> {
        let done = ui.add(egui::TextEdit::singleline(&mut text).desired_width(160.0)).lost_focus();
        self.value = Some(Value::String(text.clone()));
        done.then(|| Value::String(text).to_string())
    }
}

/// Ends of a slider: the range where it is narrow, else two decades about the value.
fn span(p: &Param, x: f64) -> (f64, f64, bool) {
    if p.max - p.min <= 10.0 {
        return (p.min, p.max, false);
    }
    let about = [x.abs(), p.default.unwrap_or(0.0).abs(), 1e-3].into_iter().fold(0.0, f64::max);
    let (low, high) = ((about / 100.0).max(p.min), (about * 100.0).min(p.max));
    if p.min < 0.0 { (-high, high, false) } else { (if p.min == 0.0 { 0.0 } else { low }, high, true) }
}

fn unit(p: &Param) -> String {
    if p.unit == "1" { String::new() } else { format!(" {}", p.unit) }
}

/// Four digits that count.
fn short(x: f64) -> String {
    let size = x.abs();
    if size != 0.0 && !(1e-3..1e5).contains(&size) {
        return format!("{x:.3e}");
    }
    let text = format!("{x:.*}", (3 - size.max(1e-3).log10().floor() as i32).clamp(0, 6) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A number as TOML: it keeps its point.
fn number(x: f64) -> String {
    Value::Float(x).to_string()
}

/// The table a field belongs to: its path without the last part, and the name given there.
fn group(whole: &Value, path: &str) -> String {
    let (parent, _) = path.rsplit_once('.').unwrap_or(("", path));
    let mut at = Some(whole);
    let mut named = None;
    for part in parent.split('.') {
        at = at.and_then(|v| match v {
            Value::Table(t) => t.get(part),
            Value::Array(a) => part.parse::<usize>().ok().and_then(|i| a.get(i)),
            _ => None,
        });
        named = at.and_then(|v| v.get("name")?.as_str()).or(named);
    }
    named.map_or(parent.to_owned(), |name| format!("{parent} {name}"))
}

/// Follows the parts of a path through tables and all elements of arrays of tables. The last part may be missing.
fn walk(at: &Value, path: String, parts: &[&str], found: &mut Vec<(String, Option<Value>)>) {
    let join = |part: &str| if path.is_empty() { part.to_owned() } else { format!("{path}.{part}") };
    match (at, parts) {
        (Value::Array(items), _) => {
            for (index, item) in items.iter().enumerate() {
                walk(item, join(&index.to_string()), parts, found);
            }
        }
        (Value::Table(table), [last]) => found.push((join(last), table.get(*last).cloned())),
        (Value::Table(table), [first, rest @ ..]) => {
            if let Some(next) = table.get(*first) {
                walk(next, join(first), rest, found);
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_parameter_of_a_scene_has_a_field_and_takes_a_change() {
        let scene = Scene::open("monkey-splash", &[]).unwrap();
        let fields = Fields::of(&scene, String::new());
        let all: Vec<&Field> = fields.groups.iter().flat_map(|g| &g.1).collect();
        let tables = ["world", "resolution", "run", "solver", "fluid", "rigid", "camera"];
        for p in PARAMS.iter().filter(|p| tables.contains(&p.path.split('.').next().unwrap_or(""))) {
            let field = all.iter().find(|f| f.param.path == p.path);
            let field = field.unwrap_or_else(|| panic!("{} has no field", p.path));
            assert!(!field.doc.is_empty(), "{} is not explained", p.path);
            let value = field.value.clone().unwrap_or(Value::Float(p.default.unwrap_or(1.0).clamp(p.min, p.max)));
            // a mass beside a density would be one too many, but reading the scene does not look
            let change = format!("{}={value}", field.path);
            let changed = scene.with(std::slice::from_ref(&change)).unwrap_or_else(|e| panic!("{change}: {e}"));
            assert!(changed.value(&field.path).is_some(), "{change} is not kept");
        }
        assert_eq!(fields.len(), all.len());
        assert!(fields.groups.iter().any(|g| g.0 == "rigid.0 monkey"));
    }

    #[test]
    fn numbers_are_short_and_sliders_span_what_is_allowed() {
        assert_eq!(
            [short(0.0), short(1000.0), short(0.05), short(-9.81), short(2e7)],
            ["0", "1000", "0.05", "-9.81", "2.000e7"]
        );
        for p in PARAMS {
            let x = p.default.unwrap_or(p.min.max(1.0).min(p.max));
            let (low, high, _) = span(p, x);
            assert!(low < high && low >= p.min.min(-1e9) && high <= p.max && (low..=high).contains(&x), "{}", p.path);
        }
        assert_eq!(number(3.0), "3.0");
    }
}
