//! The scale of colours drawn into a picture: a bar, its ends, what it shows.

use crate::color::byte;
use crate::style::ColorBy;
use crate::{Image, Show, Style};

/// Glyphs of 5 by 7 pixels, a row a number whose bits are pixels, the leftmost the highest.
const GLYPHS: [(char, [u8; 7]); 41] = [
    ('0', [14, 17, 19, 21, 25, 17, 14]),
    ('1', [4, 12, 4, 4, 4, 4, 14]),
    ('2', [14, 17, 1, 2, 4, 8, 31]),
    ('3', [31, 2, 4, 2, 1, 17, 14]),
    ('4', [2, 6, 10, 18, 31, 2, 2]),
    ('5', [31, 16, 30, 1, 1, 17, 14]),
    ('6', [6, 8, 16, 30, 17, 17, 14]),
    ('7', [31, 1, 2, 4, 8, 8, 8]),
    ('8', [14, 17, 17, 14, 17, 17, 14]),
    ('9', [14, 17, 17, 15, 1, 2, 12]),
    ('.', [0, 0, 0, 0, 0, 12, 12]),
    ('-', [0, 0, 0, 31, 0, 0, 0]),
    ('/', [0, 1, 2, 4, 8, 16, 0]),
    ('_', [0, 0, 0, 0, 0, 0, 31]),
    (' ', [0; 7]),
    ('a', [0, 0, 14, 1, 15, 17, 15]),
    ('b', [16, 16, 22, 25, 17, 17, 30]),
    ('c', [0, 0, 14, 16, 16, 17, 14]),
    ('d', [1, 1, 13, 19, 17, 17, 15]),
    ('e', [0, 0, 14, 17, 31, 16, 14]),
    ('f', [6, 9, 8, 28, 8, 8, 8]),
    ('g', [0, 15, 17, 17, 15, 1, 14]),
    ('h', [16, 16, 22, 25, 17, 17, 17]),
    ('i', [4, 0, 12, 4, 4, 4, 14]),
    ('k', [16, 16, 18, 20, 24, 20, 18]),
    ('l', [12, 4, 4, 4, 4, 4, 14]),
    ('m', [0, 0, 26, 21, 21, 17, 17]),
    ('n', [0, 0, 22, 25, 17, 17, 17]),
    ('o', [0, 0, 14, 17, 17, 17, 14]),
    ('p', [0, 0, 30, 17, 30, 16, 16]),
    ('r', [0, 0, 22, 25, 16, 16, 16]),
    ('s', [0, 0, 14, 16, 14, 1, 30]),
    ('t', [8, 8, 28, 8, 8, 9, 6]),
    ('u', [0, 0, 17, 17, 17, 19, 13]),
    ('v', [0, 0, 17, 17, 17, 10, 4]),
    ('w', [0, 0, 17, 17, 21, 21, 10]),
    ('x', [0, 0, 17, 10, 4, 10, 17]),
    ('y', [0, 0, 17, 17, 15, 1, 14]),
    ('z', [0, 0, 31, 2, 4, 8, 31]),
    ('P', [30, 17, 17, 30, 16, 16, 16]),
    ('+', [0, 4, 4, 31, 4, 4, 0]),
];

/// A number with three digits that count.
pub fn number(x: f32) -> String {
    let size = x.abs();
    if size == 0.0 {
        "0".into()
    } else if !(1e-2..1e5).contains(&size) {
        format!("{x:.1e}")
    } else if size >= 100.0 {
        format!("{x:.0}")
    } else {
        format!("{x:.2}")
    }
}

/// Draws the scale of `style` into the lower left corner of a picture.
pub fn legend(image: &mut Image, show: &Show, style: &Style) {
    let (name, unit) = style.color.text();
    if matches!(style.color, ColorBy::Kind | ColorBy::Owner) {
        return;
    }
    let [low, high] = style.scale(show);
    let scale = (image.height / 360).max(1);
    let (left, bottom) = (12 * scale, image.height.saturating_sub(14 * scale));
    let (width, height) = (120 * scale, 8 * scale);
    if image.width < left + width + 8 * scale || bottom < 3 * height {
        return;
    }
    for x in 0..width {
        let t = (x as f32 + 0.5) / width as f32;
        let color = style.map.at(t.powf(style.gamma())).map(byte);
        for y in 0..height {
            set(image, left + x, bottom - height + y, color);
        }
    }
    let title = format!("{name}  {unit}");
    write(image, title.trim_end(), left, bottom - height - 10 * scale, scale);
    write(image, &number(low), left, bottom + 3 * scale, scale);
    let end = number(high);
    write(image, &end, left + width - 6 * scale * end.len(), bottom + 3 * scale, scale);
}

fn set(image: &mut Image, x: usize, y: usize, [r, g, b]: [u8; 3]) {
    if x < image.width && y < image.height {
        let at = 4 * (y * image.width + x);
        image.rgba[at..at + 4].copy_from_slice(&[r, g, b, 255]);
    }
}

fn write(image: &mut Image, text: &str, x: usize, y: usize, scale: usize) {
    for (k, letter) in text.chars().enumerate() {
        let Some((_, rows)) = GLYPHS.iter().find(|(c, _)| *c == letter) else { continue };
        for (row, bits) in rows.iter().enumerate() {
            for column in (0..5).filter(|c| bits >> (4 - c) & 1 == 1) {
                for i in 0..scale * scale {
                    let at = (x + (6 * k + column) * scale + i % scale, y + row * scale + i / scale);
                    set(image, at.0, at.1, [40, 44, 50]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_legend_says_can_be_written() {
        let mut texts: Vec<String> = [0.0, -1.5, 23.0, 4567.0, 1.2e7, -3.4e-5].map(number).into();
        texts.extend(ColorBy::ALL.iter().map(|(_, name, unit)| format!("{name} {unit}")));
        for letter in texts.iter().flat_map(|t| t.chars()) {
            assert!(GLYPHS.iter().any(|(c, _)| *c == letter), "no glyph for {letter:?}");
        }
        assert_eq!([number(0.98), number(123.4), number(2e6)], ["0.98", "123", "2.0e6"]);
    }
}
