//! What the simulation says of itself: numbers, bars of stages, graphs over time.

use super::sim::Numbers;
use egui::{Color32, Pos2, Rect, Sense, Shape, Stroke, Ui, pos2, vec2};
use std::collections::VecDeque;

/// Moments remembered.
const MEMORY: usize = 600;

/// Name of a quantity, and where it is read.
type Quantity = (&'static str, fn(&Numbers) -> f64);

/// Quantities that have a graph.
const GRAPHS: [Quantity; 5] = [
    ("real-time factor", |n| n.real_time_factor),
    ("step (ms)", |n| n.step_ms),
    ("density error (%)", |n| 100.0 * n.ledger.density_error_mean),
    ("kinetic energy (J)", |n| n.ledger.kinetic),
    ("momentum residual", |n| n.momentum_residual),
];

/// The past of the graphs.
#[derive(Default)]
pub struct History {
    values: [VecDeque<(f64, f64)>; GRAPHS.len()],
    /// Time a picture takes (ms).
    pub picture_ms: f64,
    /// Pictures a second.
    pub pictures: f64,
}

impl History {
    /// Remembers a moment; forgets all when time has gone back.
    pub fn note(&mut self, n: &Numbers) {
        for (values, (_, of)) in self.values.iter_mut().zip(GRAPHS) {
            if values.back().is_some_and(|last| n.time < last.0) {
                values.clear();
            }
            if n.step_ms > 0.0 && values.back().is_none_or(|last| n.time > last.0) {
                values.push_back((n.time, of(n)));
            }
            if values.len() > MEMORY {
                values.pop_front();
            }
        }
    }

    /// The overlay.
    pub fn ui(&self, ui: &mut Ui, n: &Numbers) {
        let bound = n.bound.map_or("", |b| b.name());
        let rows = [
            ("time", format!("{:.3} s", n.time)),
            ("real-time factor", format!("{:.3}", n.real_time_factor)),
            ("picture", format!("{:.1} ms, {:.0}/s", self.picture_ms, self.pictures)),
            ("step", format!("{:.2} ms of {:.3} ms ({bound})", n.step_ms, 1e3 * n.dt)),
            ("fluid", format!("{} particles", n.fluid)),
            ("bodies", format!("{} particles, {} of walls", n.rigid, n.fixed)),
            ("bodies, agents", format!("{}, {}", n.bodies, n.agents)),
            (
                "density error",
                format!(
                    "{:.2} %, max {:.1} %",
                    100.0 * n.ledger.density_error_mean,
                    100.0 * n.ledger.density_error_max
                ),
            ),
            ("lost", format!("{} (left {})", n.ledger.lost + n.ledger.rigid_lost as u64, n.ledger.left)),
            ("momentum residual", format!("{:.1e}", n.momentum_residual)),
            ("backend", n.backend.to_owned()),
        ];
        egui::Grid::new("numbers").num_columns(2).spacing([10.0, 2.0]).show(ui, |ui| {
            for (name, value) in rows {
                ui.label(name);
                ui.monospace(value);
                ui.end_row();
            }
        });
        ui.separator();
        stages(ui, n);
        ui.separator();
        for (values, (name, _)) in self.values.iter().zip(GRAPHS) {
            graph(ui, name, values);
        }
    }
}

/// A bar for each stage of the step.
fn stages(ui: &mut Ui, n: &Numbers) {
    let total: f64 = n.stage_ms.0.iter().map(|s| s.1).sum();
    for (stage, ms) in &n.stage_ms.0 {
        ui.horizontal(|ui| {
            let (rect, _) = ui.allocate_exact_size(vec2(310.0, 15.0), Sense::hover());
            let share = if total > 0.0 { (ms / total) as f32 } else { 0.0 };
            let bar = Rect::from_min_size(rect.min + vec2(74.0, 2.0), vec2(170.0 * share, 10.0));
            ui.painter().rect_filled(bar, 1.0, Color32::from_rgb(70, 130, 200));
            let text = ui.visuals().text_color();
            let font = egui::FontId::proportional(11.0);
            let left = egui::Align2::LEFT_CENTER;
            ui.painter().text(rect.left_center(), left, stage.name(), font.clone(), text);
            let at = rect.left_center() + vec2(250.0, 0.0);
            ui.painter().text(at, left, format!("{ms:.2} ms"), font, text);
        });
    }
}

fn graph(ui: &mut Ui, name: &str, values: &VecDeque<(f64, f64)>) {
    let (rect, _) = ui.allocate_exact_size(vec2(310.0, 48.0), Sense::hover());
    let painter = ui.painter_at(rect);
    painter.rect_filled(rect, 2.0, ui.visuals().extreme_bg_color);
    let font = egui::FontId::proportional(10.0);
    let color = ui.visuals().weak_text_color();
    painter.text(rect.min + vec2(3.0, 1.0), egui::Align2::LEFT_TOP, name, font.clone(), color);
    let (Some(first), Some(last)) = (values.front(), values.back()) else { return };
    let high = values.iter().map(|v| v.1).filter(|v| v.is_finite()).fold(0.0, f64::max);
    painter.text(rect.right_top() + vec2(-3.0, 1.0), egui::Align2::RIGHT_TOP, super::number(high), font, color);
    if last.0 <= first.0 || high <= 0.0 {
        return;
    }
    let place = |&(t, v): &(f64, f64)| -> Pos2 {
        let x = (t - first.0) / (last.0 - first.0);
        let y = if v.is_finite() { v / high } else { 1.0 };
        pos2(rect.left() + rect.width() * x as f32, rect.bottom() - 1.0 - (rect.height() - 14.0) * y as f32)
    };
    let line = values.iter().map(place).collect();
    painter.add(Shape::line(line, Stroke::new(1.2, Color32::from_rgb(90, 160, 230))));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn history_is_bounded_and_begins_anew_with_the_world() {
        let mut history = History::default();
        let at = |time| Numbers { time, step_ms: 1.0, ..Numbers::default() };
        (0..2000).for_each(|k| history.note(&at(f64::from(k))));
        assert!(history.values.iter().all(|v| v.len() == MEMORY && v.back().unwrap().0 == 1999.0));
        history.note(&at(0.5));
        assert!(history.values.iter().all(|v| v.len() == 1));
    }
}
