//! `NAME.mp4`: pictures piped into ffmpeg.

use super::at;
use jetsam_view::Image;
use miette::miette;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

/// A video being made.
pub struct Video {
    path: PathBuf,
    ffmpeg: Child,
}

impl Video {
    /// Starts ffmpeg.
    pub fn create(path: PathBuf, width: usize, height: usize, rate: f64) -> miette::Result<Self> {
        let input = [
            "-f",
            "rawvideo",
            "-pix_fmt",
            "rgba",
            "-s",
            &format!("{width}x{height}"),
            "-r",
            &rate.to_string(),
            "-i",
            "-",
        ]
        .map(str::to_owned);
        let ffmpeg = Command::new("ffmpeg")
            .args(["-y", "-loglevel", "error"])
            .args(input)
            .args(["-pix_fmt", "yuv420p", "-crf", "18", "-movflags", "+faststart"])
            .arg(&path)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()
            .map_err(|e| {
                miette!(help = "install ffmpeg and put it on the PATH, or use --save apng", "mp4 needs ffmpeg: {e}")
            })?;
        Ok(Self { path, ffmpeg })
    }

    /// Adds a picture.
    pub fn write(&mut self, image: &Image) -> miette::Result<()> {
        let mut pipe = self.ffmpeg.stdin.as_ref().expect("the pipe is open until the end");
        Ok(pipe.write_all(&image.rgba).map_err(at(&self.path))?)
    }

    /// Waits for ffmpeg to end.
    pub fn finish(&mut self) -> miette::Result<()> {
        drop(self.ffmpeg.stdin.take());
        let status = self.ffmpeg.wait().map_err(at(&self.path))?;
        if status.success() {
            return Ok(());
        }
        Err(miette!(help = "its own message is above; --save apng works without it", "ffmpeg ended with {status}"))
    }
}
