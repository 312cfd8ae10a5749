//! A picture that stands for a particle. In: a PNG file, or nothing. Out: texels, for the GPU's renderer.

use crate::Image;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};

/// Longest side of a sprite in texels.
pub const LARGEST: u32 = 1024;

/// A picture that stands for a particle: where its alpha is below one half nothing is drawn, elsewhere its colour is multiplied with
/// that of the particle. Two are equal if they are the very same.
#[derive(Clone, Debug)]
pub struct Sprite(Arc<Image>);

/// A sprite that could not be read.
#[derive(Debug, thiserror::Error)]
pub enum SpriteError {
    /// The file cannot be opened.
    #[error("cannot read the sprite {0:?}: {1}")]
    File(PathBuf, std::io::Error),
    /// It is no PNG file, or a damaged one.
    #[error("the sprite {0:?} is not a PNG file that can be read: {1}")]
    Format(PathBuf, png::DecodingError),
    /// It is too large.
    #[error("the sprite {0:?} has {1} x {2} pixels; at most {LARGEST} x {LARGEST} are allowed")]
    Size(PathBuf, u32, u32),
    /// There is nothing to draw.
    #[error("the sprite {0:?} would never be seen: its alpha is below one half everywhere")]
    Clear(PathBuf),
}

impl Sprite {
    /// Reads a PNG file of any colour type.
    ///
    /// # Errors
    /// No such file, no PNG file, one that is too large, or one of which nothing would be seen.
    pub fn open(path: &Path) -> Result<Self, SpriteError> {
        let format = |e| SpriteError::Format(path.into(), e);
        let file = File::open(path).map_err(|e| SpriteError::File(path.into(), e))?;
        // colours, profiles and texts beside the picture may be large too
        let limits = png::Limits { bytes: 32 << 20 };
        let mut decoder = png::Decoder::new_with_limits(BufReader::new(file), limits);
        decoder.set_transformations(png::Transformations::normalize_to_color8() | png::Transformations::ALPHA);
        let mut reader = decoder.read_info().map_err(format)?;
        let (width, height) = reader.info().size();
        if width.max(height) > LARGEST {
            return Err(SpriteError::Size(path.into(), width, height));
        }
        let size = reader.output_buffer_size().unwrap_or(0);
        let mut bytes = vec![0; size];
        let info = reader.next_frame(&mut bytes).map_err(format)?;
        let rgba: Vec<u8> = match info.color_type.samples() {
            2 => bytes.chunks_exact(2).flat_map(|p| [p[0], p[0], p[0], p[1]]).collect(),
            _ => bytes,
        };
        if rgba.chunks_exact(4).all(|p| p[3] < 128) {
            return Err(SpriteError::Clear(path.into()));
        }
        Ok(Self(Arc::new(Image { width: width as usize, height: height as usize, rgba })))
    }

    /// A sprite of a picture in memory.
    pub fn of(image: Image) -> Self {
        Self(Arc::new(image))
    }

    /// Its texels.
    pub fn image(&self) -> &Image {
        &self.0
    }

    /// The texels, and again at half the size, down to one: each texel the mean of four, of colours as light.
    pub fn levels(&self) -> Vec<Image> {
        let mut levels = vec![Image::clone(&self.0)];
        while let Some(last) = levels.last().filter(|i| i.width.max(i.height) > 1) {
            levels.push(halved(last));
        }
        levels
    }
}

impl PartialEq for Sprite {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Default for Sprite {
    /// A drop of water: a disc, dark at its rim, with a highlight.
    fn default() -> Self {
        static DROP: LazyLock<Sprite> = LazyLock::new(|| Sprite::of(drop(64)));
        DROP.clone()
    }
}

/// The drop, `n` texels wide.
fn drop(n: usize) -> Image {
    let texel = |k: usize| {
        let [x, y] = [k % n, k / n].map(|i| (2.0 * (i as f32 + 0.5) / n as f32) - 1.0);
        let square = x * x + y * y;
        // as a ball lit from above on the left, and the sun in it
        let light = 0.3 + 0.5 * (1.0 - square).max(0.0).sqrt() - 0.12 * y - 0.08 * x;
        let sun = (-((x + 0.35).powi(2) + (y + 0.4).powi(2)) / 0.04).exp();
        let tone = crate::color::byte(light.clamp(0.0, 1.0).max(sun));
        [tone, tone, tone, if square <= 1.0 { 255 } else { 0 }]
    };
    Image { width: n, height: n, rgba: (0..n * n).flat_map(texel).collect() }
}

/// A picture at half the size. What is clear lends no colour.
fn halved(image: &Image) -> Image {
    let (width, height) = ((image.width / 2).max(1), (image.height / 2).max(1));
    let mut rgba = Vec::with_capacity(4 * width * height);
    for y in 0..height {
        for x in 0..width {
            let (mut light, mut weight) = ([0.0f32; 3], 0.0);
            for k in 0..4 {
                let at = |i: usize, bit: usize, n: usize| (2 * i + (k >> bit & 1)).min(n - 1);
                let p = image.pixel(at(x, 0, image.width), at(y, 1, image.height));
                let alpha = f32::from(p[3]) / 255.0;
                (0..3).for_each(|c| light[c] += alpha * crate::color::linear(f32::from(p[c]) / 255.0));
                weight += alpha;
            }
            rgba.extend(light.map(|l| crate::color::byte(l / weight.max(1e-6))));
            rgba.push((255.0 * weight / 4.0 + 0.5) as u8);
        }
    }
    Image { width, height, rgba }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_halve_down_to_the_mean() {
        // a row of four: white, black, red, clear
        let texels = [[255, 255, 255, 255], [0, 0, 0, 255], [255, 0, 0, 255], [0, 255, 0, 0]];
        let sprite = Sprite::of(Image { width: 4, height: 1, rgba: texels.concat() });
        let levels = sprite.levels();
        assert_eq!(levels.iter().map(|l| (l.width, l.height)).collect::<Vec<_>>(), [(4, 1), (2, 1), (1, 1)]);
        // half of white's light is byte 188 of sRGB; the clear texel's green does not show
        assert_eq!(levels[1].pixel(0, 0), [188, 188, 188, 255]);
        assert_eq!(levels[1].pixel(1, 0), [255, 0, 0, 128]);
    }

    #[test]
    fn grey_pictures_are_read_and_large_or_damaged_ones_are_not() {
        let folder = std::env::temp_dir().join(format!("jetsam-sprites-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("sprite.png");
        let write = |width: u32, height: u32, bytes: &[u8]| {
            let mut encoder = png::Encoder::new(File::create(&path).unwrap(), width, height);
            encoder.set_color(png::ColorType::Grayscale);
            encoder.write_header().unwrap().write_image_data(bytes).unwrap();
        };
        write(2, 1, &[7, 200]);
        assert_eq!(Sprite::open(&path).unwrap().image().rgba, [7, 7, 7, 255, 200, 200, 200, 255]);
        write(LARGEST + 1, 1, &vec![0; LARGEST as usize + 1]);
        assert!(matches!(Sprite::open(&path), Err(SpriteError::Size(_, 1025, 1))));
        std::fs::write(&path, b"GIF89a").unwrap();
        assert!(matches!(Sprite::open(&path), Err(SpriteError::Format(..))));
        Image { width: 1, height: 1, rgba: vec![9, 9, 9, 127] }.save_png(&path).unwrap();
        assert!(matches!(Sprite::open(&path), Err(SpriteError::Clear(_))));
        assert!(matches!(Sprite::open(&folder.join("none.png")), Err(SpriteError::File(..))));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
