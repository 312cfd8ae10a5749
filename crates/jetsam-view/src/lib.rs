//! Pictures of jetsam worlds.
//!
//! A [`Show`] says how a scene is shown, a [`Frame`] is a moment of its world. [`paint`] draws it on the CPU: no window, no GPU, the
//! same bits for any number of threads. [`gpu::Renderer`] draws it on a graphics processor. [`color`] turns numbers and names into colours.
//!
//! ```
//! use glam::Vec3;
//! use jetsam_view::{Ball, Camera, Options, color, render};
//!
//! let balls = [Ball { center: Vec3::ZERO, radius: 0.1, color: color::of_name("monkey-1") }];
//! let camera = Camera::framing(Vec3::splat(-0.2), Vec3::splat(0.2), Vec3::new(1.0, -2.0, 1.0), 0.7, 4.0 / 3.0);
//! let image = render(&balls, &camera, 160, 120, &Options::default());
//! assert_eq!(image.rgba.len(), 160 * 120 * 4);
//! ```
#![forbid(unsafe_code)]

mod apng;
mod camera;
pub mod color;
mod frame;
#[cfg(feature = "gpu")]
pub mod gpu;
mod image;
mod legend;
mod lines;
mod paint;
mod raster;
pub mod show;
mod splat;
mod sprite;
mod streamlines;
pub mod style;
mod trails;
#[cfg(feature = "window")]
pub mod window;

pub use apng::Animation;
pub use camera::Camera;
pub use frame::Frame;
pub use image::{Image, ImageError};
pub use legend::{legend, number};
pub use lines::Curves;
pub use paint::paint;
pub use show::Show;
pub use splat::{Ball, Facet, Line, Options, box_edges, facets, render};
pub use sprite::{Sprite, SpriteError};
pub use streamlines::streamlines;
pub use style::Style;
