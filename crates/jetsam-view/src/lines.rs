//! Lines that show how things move. In: moments of a world. Out: the lines a style asks for. Called by the window and by runs.

use crate::style::Lines;
use crate::trails::Trails;
use crate::{Frame, Line, Show, Style, streamlines};

/// Makes lines from the moments of one world. The particles have to be on the host: see [`Style::at_home`].
#[derive(Debug, Default)]
pub struct Curves(Trails);

impl Curves {
    /// Takes note of a moment.
    pub fn note(&mut self, frame: &Frame, style: &Style) {
        match style.lines {
            Lines::Trails => self.0.note(frame),
            Lines::None | Lines::Streamlines => self.clear(),
        }
    }

    /// Forgets all moments.
    pub fn clear(&mut self) {
        self.0 = Trails::default();
    }

    /// The lines at the last of them.
    pub fn lines(&self, show: &Show, frame: &Frame, style: &Style) -> Vec<Line> {
        match style.lines {
            Lines::None => Vec::new(),
            Lines::Trails => self.0.lines(show),
            Lines::Streamlines => streamlines(show, frame, style),
        }
    }
}

/// Every so many of `count` things has a line: few hundred have. A power of two, so that most stay when there are more or fewer.
pub(crate) fn every(count: usize) -> u32 {
    /// Lines, about.
    const LINES: usize = 300;
    (count / LINES).max(1).next_power_of_two() as u32
}
