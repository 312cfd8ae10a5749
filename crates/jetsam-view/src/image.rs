//! A finished picture and its way to a file.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// A picture of 8-bit sRGB pixels, rows from top to bottom.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Red, green, blue and alpha of each pixel: `width * height * 4` bytes.
    pub rgba: Vec<u8>,
}

/// A picture that could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write the picture {path:?}: {source}")]
pub struct ImageError {
    path: PathBuf,
    source: png::EncodingError,
}

impl Image {
    /// Red, green, blue and alpha of the pixel in column `x` from the left and row `y` from the top.
    ///
    /// Panics outside the picture.
    pub fn pixel(&self, x: usize, y: usize) -> [u8; 4] {
        assert!(x < self.width && y < self.height, "no pixel ({x}, {y})");
        let at = 4 * (y * self.width + x);
        std::array::from_fn(|k| self.rgba[at + k])
    }

    /// Writes the picture as a PNG file; its folder must exist.
    pub fn save_png(&self, path: impl AsRef<Path>) -> Result<(), ImageError> {
        let path = path.as_ref();
        self.write_png(path).map_err(|source| ImageError { path: path.into(), source })
    }

    fn write_png(&self, path: &Path) -> Result<(), png::EncodingError> {
        let file = BufWriter::new(File::create(path)?);
        let mut encoder = png::Encoder::new(file, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        encoder.set_compression(png::Compression::Fast);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.rgba)?;
        writer.finish()
    }
}
