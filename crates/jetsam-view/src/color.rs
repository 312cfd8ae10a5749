//! Colours from numbers and names. A colour is linear light in [0, 1] of the sRGB primaries.

/// The colour with lightness `l` in [0, 1], chroma `c` (0 is grey, 0.3 vivid) and hue `h` in turns in the OKLCH space, in which equal
/// steps look equal; clamped to what a screen can show.
pub fn oklch(l: f32, c: f32, h: f32) -> [f32; 3] {
    let (b, a) = (std::f32::consts::TAU * h).sin_cos();
    let (a, b) = (c * a, c * b);
    let cones = [
        l + 0.396_337_78 * a + 0.215_803_76 * b,
        l - 0.105_561_346 * a - 0.063_854_17 * b,
        l - 0.089_484_18 * a - 1.291_485_5 * b,
    ];
    let [l, m, s] = cones.map(|x| x * x * x);
    [
        4.076_741_7 * l - 3.307_711_6 * m + 0.230_969_94 * s,
        -1.268_438 * l + 2.609_757_4 * m - 0.341_319_38 * s,
        -0.004_196_086_3 * l - 0.703_418_6 * m + 1.707_614_7 * s,
    ]
    .map(|x| x.clamp(0.0, 1.0))
}

/// The colour of water at `t` in [0, 1] of the fastest speed shown: deep blue at rest, through turquoise, to white spray. Lightness
/// grows evenly with `t`.
pub fn water(t: f32) -> [f32; 3] {
    let t = if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) };
    oklch(0.45 + 0.52 * t, 0.145 - 0.11 * t * t, 0.705 - 0.13 * t)
}

/// A scale of colours for numbers: lightness grows evenly along it, or falls evenly to both sides of its middle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Map {
    /// [`water`].
    #[default]
    Water,
    /// Purple through green to yellow (matplotlib's; van der Walt and Smith).
    Viridis,
    /// Black through magenta to pale yellow (the same authors).
    Magma,
    /// Blue below, pale in the middle, red above.
    Balance,
}

impl Map {
    /// All maps.
    pub const ALL: [Map; 4] = [Map::Water, Map::Viridis, Map::Magma, Map::Balance];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Map::Water => "water",
            Map::Viridis => "viridis",
            Map::Magma => "magma",
            Map::Balance => "balance",
        }
    }

    /// The colour at `t` in [0, 1].
    pub fn at(self, t: f32) -> [f32; 3] {
        let t = if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) };
        match self {
            Map::Water => water(t),
            Map::Viridis => between(&VIRIDIS, t),
            Map::Magma => between(&MAGMA, t),
            Map::Balance => {
                let side = (2.0 * t - 1.0).abs();
                let hue = if t < 0.5 { 0.70 } else { 0.08 };
                oklch(0.95 - 0.45 * side, 0.16 * side, hue)
            }
        }
    }
}

/// Ten equal steps of viridis, sRGB bytes.
const VIRIDIS: [[u8; 3]; 10] = [
    [68, 1, 84],
    [72, 40, 120],
    [62, 74, 137],
    [49, 104, 142],
    [38, 130, 142],
    [31, 158, 137],
    [53, 183, 121],
    [109, 205, 89],
    [180, 222, 44],
    [253, 231, 37],
];

/// Ten equal steps of magma, sRGB bytes.
const MAGMA: [[u8; 3]; 10] = [
    [0, 0, 4],
    [24, 15, 62],
    [69, 16, 119],
    [114, 31, 129],
    [159, 47, 127],
    [205, 64, 113],
    [241, 96, 93],
    [253, 149, 103],
    [254, 201, 141],
    [252, 253, 191],
];

fn between(steps: &[[u8; 3]; 10], t: f32) -> [f32; 3] {
    let at = 9.0 * t;
    let k = (at as usize).min(8);
    std::array::from_fn(|c| {
        let mix = f32::from(steps[k][c]) + (at - k as f32) * (f32::from(steps[k + 1][c]) - f32::from(steps[k][c]));
        linear(mix / 255.0)
    })
}

/// Linear light of a value in [0, 1] that is encoded in sRGB.
pub fn linear(x: f32) -> f32 {
    if x <= 0.040_45 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

/// The sRGB byte that shows linear light `x`.
pub fn byte(x: f32) -> u8 {
    let x = x.clamp(0.0, 1.0);
    let encoded = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    (255.0 * encoded + 0.5) as u8
}

/// The colour of the body called `name`, the same in every run: warm, so that it stands out from water.
///
/// The name without the number at its end picks a hue, and the number steps on from there by the golden ratio: numbered copies
/// differ most from their neighbours.
pub fn of_name(name: &str) -> [f32; 3] {
    let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
    let number =
        name[stem.len()..].bytes().fold(0u32, |n, digit| n.wrapping_mul(10).wrapping_add((digit - b'0').into()));
    let hash = stem.bytes().fold(0x811c_9dc5u32, |h, byte| (h ^ u32::from(byte)).wrapping_mul(0x0100_0193)); // FNV-1a
    // Fractions of 2^32; the multiplication is by the golden ratio, the remainder wraps.
    let turn = hash.wrapping_mul(0x9e37_79b1).wrapping_add(number.wrapping_mul(0x9e37_79b9));
    let t = (turn >> 8) as f32 / (1 << 24) as f32;
    // From pink through red, orange and yellow to green; every other number a little darker, yellow lighter lest it be olive.
    let h = -0.08 + 0.50 * t;
    let l = if number.is_multiple_of(2) { 0.72 } else { 0.64 };
    oklch(l + 0.10 * (-100.0 * (h - 0.28) * (h - 0.28)).exp(), 0.17, h)
}

/// The byte that shows a linear value of `x` / 4096 for each index `x`, by the sRGB transfer function.
pub(crate) fn srgb_table() -> Vec<u8> {
    (0..=4096).map(|x| byte(x as f32 / 4096.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance.
    fn luminance([r, g, b]: [f32; 3]) -> f32 {
        0.2126 * r + 0.7152 * g + 0.0722 * b
    }

    #[test]
    fn water_grows_lighter_with_speed() {
        let y: Vec<f32> = (0..=100).map(|i| luminance(water(i as f32 / 100.0))).collect();
        assert!(y.windows(2).all(|pair| pair[0] < pair[1]), "{y:?}");
        assert_eq!(water(f32::NAN), water(0.0));
        assert_eq!(water(7.0), water(1.0));
    }

    #[test]
    fn maps_grow_lighter_and_the_balance_is_lightest_in_its_middle() {
        for map in [Map::Water, Map::Viridis, Map::Magma] {
            let y: Vec<f32> = (0..=90).map(|i| luminance(map.at(i as f32 / 90.0))).collect();
            assert!(y.windows(2).all(|pair| pair[0] < pair[1]), "{}: {y:?}", map.name());
        }
        let y: Vec<f32> = (0..=90).map(|i| luminance(Map::Balance.at(i as f32 / 90.0))).collect();
        assert!(y[..46].windows(2).all(|p| p[0] < p[1]) && y[45..].windows(2).all(|p| p[0] > p[1]), "{y:?}");
    }

    #[test]
    fn bytes_and_light_are_inverse() {
        for b in 0..=255u8 {
            assert_eq!(byte(linear(f32::from(b) / 255.0)), b);
        }
    }

    #[test]
    fn oklch_without_chroma_is_grey_of_cubed_lightness() {
        for l in [0.0f32, 0.3, 0.7, 1.0] {
            for x in oklch(l, 0.0, 0.3) {
                assert!((x - l * l * l).abs() < 1e-5, "lightness {l} gives {x}");
            }
        }
    }

    #[test]
    fn numbered_names_have_distinct_colours() {
        let colors: Vec<_> = (1..=10).map(|i| of_name(&format!("monkey-{i}"))).collect();
        for (i, a) in colors.iter().enumerate() {
            for b in &colors[..i] {
                let apart: f32 = (0..3).map(|k| (a[k] - b[k]).abs()).sum();
                assert!(apart > 0.04, "{a:?} is close to {b:?}");
            }
        }
        assert_ne!(of_name("boat"), of_name("crate"));
        assert_eq!(of_name("boat"), of_name("boat"));
    }
}
