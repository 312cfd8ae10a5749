//! The panels: transport, scenes, tools, looks, parameters, numbers. In: what the simulation shows. Out: what the user wants.

use super::fields::Fields;
use super::graphs::History;
use super::hand::Tool;
use super::sim::{Numbers, Order, Shown};
use crate::Style;
use crate::color::Map;
use crate::style::{Bodies, ColorBy, Fluid, Lines, Smoothing};
use egui::{Align2, Color32, ComboBox, Panel, RichText, Slider, Ui};
use jetsam::scene::builtin::SCENES;
use std::path::PathBuf;

/// What the user has chosen, and what is shown of the simulation in words.
#[derive(Default)]
pub struct Panels {
    pub style: Style,
    pub tool: Tool,
    pub fields: Fields,
    pub history: History,
    /// Everything but the picture is hidden.
    pub bare: bool,
    pub fly: bool,
    pub pace: f64,
    pub name: String,
    pub playing: bool,
    pub numbers: Numbers,
    pub message: Option<(String, bool)>,
    pub busy: Option<&'static str>,
    /// Where the scene is saved, and which scene or mesh is opened.
    pub save_as: String,
    pub open: String,
    pub numbers_shown: bool,
}

/// What the user wants besides orders to the simulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// The scene's own camera.
    Home,
}

impl Panels {
    pub fn new() -> Self {
        Self { pace: 1.0, ..Self::default() }
    }

    /// Takes note of the newest moment.
    pub fn note(&mut self, shown: &Shown) {
        (self.playing, self.busy) = (shown.playing, shown.busy);
        self.message.clone_from(&shown.message);
        self.numbers = shown.numbers.clone();
        if self.name != shown.name {
            self.name.clone_from(&shown.name);
            self.save_as = format!("{}-changed.toml", self.name);
        }
        self.history.note(&shown.numbers);
    }

    /// Draws all panels around the picture.
    pub fn ui(&mut self, ui: &mut Ui, orders: &mut Vec<Order>) -> Option<Wish> {
        if self.bare {
            return None;
        }
        let mut wish = None;
        Panel::bottom("message").show(ui, |ui| self.message_line(ui));
        Panel::left("controls").default_size(236.0).resizable(false).show(ui, |ui| {
            egui::ScrollArea::vertical().show(ui, |ui| {
                wish = self.controls(ui, orders);
            });
        });
        Panel::right("numbers and parameters").default_size(330.0).show(ui, |ui| {
            ui.add_space(4.0);
            ui.horizontal(|ui| {
                let parameters = format!("parameters ({})", self.fields.len());
                ui.selectable_value(&mut self.numbers_shown, false, parameters);
                ui.selectable_value(&mut self.numbers_shown, true, "numbers");
            });
            ui.separator();
            egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                if self.numbers_shown {
                    return self.history.ui(ui, &self.numbers);
                }
                let changes = self.fields.ui(ui);
                if !changes.is_empty() {
                    orders.push(Order::Set(changes));
                }
            });
        });
        wish
    }

    fn message_line(&self, ui: &mut Ui) {
        let keys = "space play  n step  r reset  1 2 3 hand  v fluid  c colours  f fly (wasd qe)  tab panels";
        ui.horizontal(|ui| match (&self.busy, &self.message) {
            // nothing that moves: panels are not drawn again and again while there is work to do
            (Some(what), _) => {
                ui.label(format!("{what} ..."));
            }
            (None, Some((text, bad))) => {
                let color = if *bad { Color32::from_rgb(230, 90, 70) } else { ui.visuals().text_color() };
                ui.label(RichText::new(text).color(color));
            }
            _ => {
                ui.label(RichText::new(keys).weak());
            }
        });
    }

    fn controls(&mut self, ui: &mut Ui, orders: &mut Vec<Order>) -> Option<Wish> {
        ui.add_space(4.0);
        ui.horizontal(|ui| {
            if ui.button(if self.playing { "pause" } else { "play" }).clicked() {
                self.playing = !self.playing;
                orders.push(Order::Play(self.playing));
            }
            if ui.button("step").clicked() {
                orders.push(Order::Step);
            }
            if ui.button("reset").clicked() {
                orders.push(Order::Reset);
            }
        });
        let pace = Slider::new(&mut self.pace, 0.01..=10.0).logarithmic(true).text("speed");
        if ui.add(pace).on_hover_text("simulated seconds a second, if the machine is fast enough").changed() {
            orders.push(Order::Pace(self.pace));
        }
        ui.separator();
        self.scenes(ui, orders);
        ui.separator();
        ui.label("left button");
        ui.horizontal(|ui| {
            for (tool, name) in Tool::ALL {
                ui.selectable_value(&mut self.tool, tool, name);
            }
        });
        ui.separator();
        let wish = self.camera(ui);
        ui.separator();
        self.looks(ui);
        wish
    }

    fn scenes(&mut self, ui: &mut Ui, orders: &mut Vec<Order>) {
        ComboBox::from_label("scene").width(150.0).selected_text(&self.name).show_ui(ui, |ui| {
            for scene in SCENES {
                if ui.selectable_label(self.name == scene.name, scene.name).clicked() {
                    orders.push(Order::Open(scene.name.into()));
                }
            }
        });
        ui.horizontal(|ui| {
            ui.add(egui::TextEdit::singleline(&mut self.open).hint_text("scene or mesh file").desired_width(140.0));
            if ui.button("open").on_hover_text("a mesh falls in; files can also be dropped here").clicked() {
                orders.push(opened(PathBuf::from(self.open.trim()), None));
            }
        });
        ui.horizontal(|ui| {
            ui.add(egui::TextEdit::singleline(&mut self.save_as).desired_width(140.0));
            if ui.button("save").on_hover_text("ctrl-s").clicked() {
                orders.push(Order::Save(self.save_as.clone().into()));
            }
        });
    }

    fn camera(&mut self, ui: &mut Ui) -> Option<Wish> {
        let mut wish = None;
        ui.horizontal(|ui| {
            if ui.button("camera home").clicked() {
                wish = Some(Wish::Home);
            }
            ui.checkbox(&mut self.fly, "fly");
        });
        let mut stereo = self.style.stereo > 0.0;
        if ui.checkbox(&mut stereo, "two pictures, for two eyes").changed() {
            self.style.stereo = f32::from(u8::from(stereo));
        }
        wish
    }

    fn looks(&mut self, ui: &mut Ui) {
        let s = &mut self.style;
        choose(ui, "fluid", &mut s.fluid, &Fluid::ALL);
        if s.fluid == Fluid::Surface {
            choose(ui, "smoothing", &mut s.smoothing, &Smoothing::ALL);
            ui.add(Slider::new(&mut s.passes, 0..=6).text("passes"));
            ui.add(Slider::new(&mut s.murk, 0.0..=5.0).text("murk"));
        }
        let mut particles = s.bodies == Bodies::Particles;
        ui.checkbox(&mut particles, "bodies as particles");
        s.bodies = if particles { Bodies::Particles } else { Bodies::Meshes };
        let before = s.color;
        choose(ui, "colours", &mut s.color, &ColorBy::ALL.map(|(c, name, _)| (c, name)));
        if s.color != before {
            s.range = None;
            s.map = if s.color == ColorBy::Density { Map::Balance } else { Map::Water };
        }
        choose(ui, "scale", &mut s.map, &Map::ALL.map(|m| (m, m.name())));
        let mut arrows = s.arrows > 0.0;
        choose(ui, "lines", &mut s.lines, &Lines::ALL);
        ui.horizontal(|ui| {
            if ui.checkbox(&mut arrows, "arrows").changed() {
                s.arrows = if arrows { 0.05 } else { 0.0 };
            }
            ui.checkbox(&mut s.shadows, "shadows");
            ui.checkbox(&mut s.edges, "edges");
        });
    }
}

/// A file that was given: scenes are opened, anything else is a mesh.
pub fn opened(path: PathBuf, over: Option<glam::Vec3>) -> Order {
    let is_scene = path.extension().is_none_or(|e| e.eq_ignore_ascii_case("toml"));
    if is_scene { Order::Open(path.display().to_string()) } else { Order::Drop(path, over) }
}

fn choose<T: Copy + PartialEq>(ui: &mut Ui, label: &str, value: &mut T, all: &[(T, &str)]) {
    let name = all.iter().find(|(t, _)| t == value).map_or("", |(_, name)| name);
    ComboBox::from_label(label).width(130.0).selected_text(name).show_ui(ui, |ui| {
        for (choice, name) in all {
            ui.selectable_value(value, *choice, *name);
        }
    });
}

/// The most important numbers, in the upper left corner of the picture.
pub fn headline(ui: &Ui, rect: egui::Rect, panels: &Panels) {
    let (n, h) = (&panels.numbers, &panels.history);
    let text = format!(
        "{:.2} s   real time x {:.3}   step {:.2} ms   picture {:.0} ms   {} particles",
        n.time,
        n.real_time_factor,
        n.step_ms,
        h.picture_ms,
        n.fluid + n.rigid + n.fixed
    );
    let (font, color) = (egui::FontId::proportional(12.0), Color32::from_rgb(40, 44, 50));
    ui.painter_at(rect).text(rect.left_top() + egui::vec2(14.0, 8.0), Align2::LEFT_TOP, text, font, color);
}

/// The scale of colours, in the lower left corner of the picture.
pub fn legend(ui: &Ui, rect: egui::Rect, show: &crate::Show, style: &Style) {
    let (name, unit) = style.color.text();
    if matches!(style.color, ColorBy::Kind | ColorBy::Owner) || style.fluid == Fluid::Surface {
        return;
    }
    let [low, high] = style.scale(show);
    let painter = ui.painter_at(rect);
    let corner = rect.left_bottom() + egui::vec2(14.0, -34.0);
    for k in 0..120 {
        let t = (k as f32 + 0.5) / 120.0;
        let [r, g, b] = style.map.at(t.powf(style.gamma())).map(crate::color::byte);
        let bar = egui::Rect::from_min_size(corner + egui::vec2(1.5 * k as f32, 0.0), egui::vec2(1.5, 10.0));
        painter.rect_filled(bar, 0.0, Color32::from_rgb(r, g, b));
    }
    let font = egui::FontId::proportional(12.0);
    let color = Color32::from_rgb(40, 44, 50);
    let text = |at: egui::Vec2, align, text: String| {
        painter.text(corner + at, align, text, font.clone(), color);
    };
    text(egui::vec2(0.0, -3.0), Align2::LEFT_BOTTOM, format!("{name} {unit}"));
    text(egui::vec2(0.0, 12.0), Align2::LEFT_TOP, super::number(f64::from(low)));
    text(egui::vec2(180.0, 12.0), Align2::RIGHT_TOP, super::number(f64::from(high)));
}
