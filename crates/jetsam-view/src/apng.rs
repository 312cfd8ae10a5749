//! An animated PNG, written picture by picture (APNG 1.0): chunks of whole PNGs, renamed and numbered.

use crate::Image;
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

/// An animation being made. Until [`Animation::finish`] it holds no picture.
pub struct Animation {
    file: BufWriter<File>,
    size: [u32; 2],
    /// Time of a picture as a fraction (s).
    delay: [u16; 2],
    pictures: u32,
    /// Number of the next control or data chunk.
    sequence: u32,
}

const SIGNATURE: [u8; 8] = [0x89, b'P', b'N', b'G', b'\r', b'\n', 0x1a, b'\n'];
/// Where the number of pictures stands: after the signature and the header.
const CONTROL: u64 = 8 + 25;

impl Animation {
    /// Opens a file for pictures of `width` by `height` pixels, `rate` of them a second.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn create(path: &Path, width: usize, height: usize, rate: f64) -> io::Result<Self> {
        let size = [width as u32, height as u32];
        let mut file = BufWriter::new(File::create(path)?);
        file.write_all(&SIGNATURE)?;
        let [w, h] = size.map(u32::to_be_bytes);
        // 8 bits, red, green and blue
        chunk(&mut file, b"IHDR", &[&w[..], &h, &[8, 2, 0, 0, 0]].concat())?;
        let mut animation = Self { file, size, delay: delay(rate), pictures: 0, sequence: 0 };
        animation.control()?;
        Ok(animation)
    }

    /// Adds a picture.
    ///
    /// # Errors
    /// A file that cannot be written, or a picture of another size.
    pub fn add(&mut self, image: &Image) -> io::Result<()> {
        if [image.width as u32, image.height as u32] != self.size {
            return Err(io::Error::other("the picture's size is not the animation's"));
        }
        let [w, h] = self.size.map(u32::to_be_bytes);
        let [num, den] = self.delay.map(u16::to_be_bytes);
        let number = self.next();
        // at the upper left corner, replacing what was there
        let frame = [&number[..], &w, &h, &[0; 8], &num, &den, &[0, 0]].concat();
        chunk(&mut self.file, b"fcTL", &frame)?;
        for data in compressed(image)? {
            if self.pictures == 0 {
                chunk(&mut self.file, b"IDAT", &data)?;
            } else {
                let number = self.next();
                chunk(&mut self.file, b"fdAT", &[&number[..], &data].concat())?;
            }
        }
        self.pictures += 1;
        Ok(())
    }

    /// Completes the file.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn finish(&mut self) -> io::Result<()> {
        chunk(&mut self.file, b"IEND", &[])?;
        self.file.seek(SeekFrom::Start(CONTROL))?;
        self.control()?;
        self.file.flush()
    }

    /// Number of pictures, and that they are played for ever.
    fn control(&mut self) -> io::Result<()> {
        let data = [self.pictures.to_be_bytes(), [0; 4]].concat();
        chunk(&mut self.file, b"acTL", &data)
    }

    fn next(&mut self) -> [u8; 4] {
        self.sequence += 1;
        (self.sequence - 1).to_be_bytes()
    }
}

/// The time of a picture as a fraction of 16-bit numbers.
fn delay(rate: f64) -> [u16; 2] {
    if rate.fract() == 0.0 && (1.0..=65535.0).contains(&rate) {
        return [1, rate as u16];
    }
    let milliseconds = (1000.0 / rate).round();
    [milliseconds.clamp(0.0, 65535.0) as u16, 1000]
}

/// The data chunks of a picture as a PNG of its own.
fn compressed(image: &Image) -> io::Result<Vec<Vec<u8>>> {
    let rgb: Vec<u8> = image.rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    let mut whole = Vec::new();
    let mut encoder = png::Encoder::new(&mut whole, image.width as u32, image.height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header().map_err(io::Error::other)?;
    writer.write_image_data(&rgb).map_err(io::Error::other)?;
    writer.finish().map_err(io::Error::other)?;
    let mut data = Vec::new();
    let mut rest = &whole[SIGNATURE.len()..];
    while let [a, b, c, d, tail @ ..] = rest {
        let length = u32::from_be_bytes([*a, *b, *c, *d]) as usize;
        let (name, body) = tail.split_at(4);
        if name == b"IDAT" {
            data.push(body[..length].to_vec());
        }
        rest = &body[length + 4..];
    }
    Ok(data)
}

fn chunk(file: &mut impl Write, name: &[u8; 4], data: &[u8]) -> io::Result<()> {
    file.write_all(&(data.len() as u32).to_be_bytes())?;
    file.write_all(name)?;
    file.write_all(data)?;
    let crc = data.iter().fold(name.iter().fold(u32::MAX, |c, b| crc(c, *b)), |c, b| crc(c, *b));
    file.write_all(&(!crc).to_be_bytes())
}

/// One byte more of the check sum that PNG uses (CRC-32, ISO 3309).
fn crc(sum: u32, byte: u8) -> u32 {
    TABLE[((sum ^ u32::from(byte)) & 0xff) as usize] ^ (sum >> 8)
}

const TABLE: [u32; 256] = {
    let mut table = [0; 256];
    let mut n = 0;
    while n < 256 {
        let mut c = n as u32;
        let mut bit = 0;
        while bit < 8 {
            c = if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 };
            bit += 1;
        }
        table[n] = c;
        n += 1;
    }
    table
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reader_finds_every_picture() {
        let path = std::env::temp_dir().join(format!("jetsam-animation-{}.apng", std::process::id()));
        let picture = |shade: u8| Image { width: 6, height: 4, rgba: [shade, 2 * shade, 7, 255].repeat(24) };
        let mut animation = Animation::create(&path, 6, 4, 25.0).unwrap();
        for shade in 0..5 {
            animation.add(&picture(20 * shade)).unwrap();
        }
        animation.finish().unwrap();
        let file = io::BufReader::new(File::open(&path).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let control = reader.info().animation_control.unwrap();
        assert_eq!((control.num_frames, control.num_plays), (5, 0));
        let mut buffer = vec![0; reader.output_buffer_size().unwrap()];
        for shade in 0..5u8 {
            reader.next_frame(&mut buffer).unwrap();
            let frame = reader.info().frame_control.unwrap();
            assert_eq!((frame.delay_num, frame.delay_den, frame.width, frame.height), (1, 25, 6, 4));
            assert_eq!(buffer, [20 * shade, 40 * shade, 7].repeat(24), "picture {shade}");
        }
        assert!(reader.next_frame(&mut buffer).is_err());
        std::fs::remove_file(&path).unwrap();
    }

    #[test]
    fn delays_are_fractions() {
        assert_eq!([delay(50.0), delay(62.5), delay(0.5)], [[1, 50], [16, 1000], [2000, 1000]]);
    }
}
