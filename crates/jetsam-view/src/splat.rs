//! Balls and facets in, a shaded picture out: a small splatter with depth buffer for machines without a GPU.
//!
//! 1. The eye finds the nearest shape and its exact depth along 2 x 2 lines of sight a pixel ([`Raster`]).
//! 2. The light looks at the same shapes in the same way: its depths give the shadows.
//! 3. Each pixel shades what its samples see, with ambient occlusion from the depths around it.
//! 4. Lines are drawn over it, hidden where the samples are nearer.
//!
//! Memory: 36 bytes a pixel, 8 MB for the light, some 60 bytes a shape.

use crate::raster::{GROUND, NOTHING, Raster};
use crate::{Camera, Image, color};
use fearless_simd::{Level, dispatch};
use glam::{FloatExt, Vec2, Vec3, vec2};
use rayon::prelude::*;

/// One particle as it is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Centre, m.
    pub center: Vec3,
    /// Radius, m. Balls without extent or with a coordinate that is not finite are not drawn, nor those around the eye.
    pub radius: f32,
    /// Linear red, green and blue in [0, 1]; see [`color`].
    pub color: [f32; 3],
}

/// A triangle of a mesh, seen from both sides; [`facets`] makes them. Those that reach behind the eye are not drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facet {
    /// Corners, m.
    pub corners: [Vec3; 3],
    /// Direction of the surface at each corner, any length: smooths the shading.
    pub normals: [Vec3; 3],
    /// Linear red, green and blue in [0, 1].
    pub color: [f32; 3],
}

/// The facets of a mesh, shaded smoothly except over creases sharper than 60 degrees.
///
/// Panics when a triangle names a vertex that is not there.
pub fn facets(vertices: &[Vec3], triangles: &[[u32; 3]], color: [f32; 3]) -> Vec<Facet> {
    let corners = |triangle: &[u32; 3]| triangle.map(|v| vertices[v as usize]);
    let across = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a);
    let mut smooth = vec![Vec3::ZERO; vertices.len()];
    for triangle in triangles {
        triangle.iter().for_each(|v| smooth[*v as usize] += across(corners(triangle)));
    }
    let facet = |triangle: &[u32; 3]| {
        let flat = across(corners(triangle));
        let normal = |v: u32| {
            if smooth[v as usize].angle_between(flat) < 1.05 { smooth[v as usize] } else { flat }
        };
        Facet { corners: corners(triangle), normals: triangle.map(|v| normal(v).normalize_or_zero()), color }
    };
    triangles.iter().map(facet).collect()
}

impl Facet {
    /// Unit normal at a point of the facet, on the side that looks towards `back`.
    fn normal(&self, point: Vec3, back: Vec3) -> Vec3 {
        let [a, b, c] = self.corners;
        let across = (b - a).cross(c - a);
        let share = |p: Vec3, q: Vec3| (p - point).cross(q - point).dot(across).max(0.0);
        let [l, m, n] = self.normals;
        let normal = (share(b, c) * l + share(c, a) * m + share(a, b) * n).try_normalize();
        let normal = normal.unwrap_or_else(|| across.normalize_or(back));
        if across.dot(back) < 0.0 { -normal } else { normal }
    }
}

/// A straight line, about one pixel wide, hidden behind what is nearer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// One end, m.
    pub from: Vec3,
    /// The other end, m.
    pub to: Vec3,
    /// Linear red, green and blue in [0, 1].
    pub color: [f32; 3],
}

/// What belongs to the picture besides the balls; the default is a bare background. Colours are linear red, green and blue in [0, 1].
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// Meshes drawn among the balls; see [`facets`].
    pub facets: &'a [Facet],
    /// Lines drawn, for instance [`box_edges`].
    pub lines: &'a [Line],
    /// Height (z) of a ground that is seen only by the shadows on it, m.
    pub ground: Option<f32>,
    /// Direction towards the light, any length.
    pub light: Vec3,
    /// Background at the upper edge.
    pub above: [f32; 3],
    /// Background at the lower edge.
    pub below: [f32; 3],
}

impl Default for Options<'_> {
    fn default() -> Self {
        Options {
            facets: &[],
            lines: &[],
            ground: None,
            light: Vec3::new(-0.45, -0.5, 1.0),
            above: [0.70, 0.79, 0.87],
            below: [0.93, 0.93, 0.91],
        }
    }
}

/// The twelve edges of the box from `min` to `max` (m).
pub fn box_edges(min: Vec3, max: Vec3, color: [f32; 3]) -> [Line; 12] {
    let corner = |i: usize| Vec3::from_array(std::array::from_fn(|k| if i >> k & 1 == 0 { min[k] } else { max[k] }));
    std::array::from_fn(|edge| {
        let (axis, others) = (edge / 4, edge % 4);
        let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
        let from = (others & 1) << j | (others >> 1) << k;
        Line { from: corner(from), to: corner(from | 1 << axis), color }
    })
}

/// Draws the balls into a picture of `width` by `height` pixels. The result is the same, bit for bit, for any number of threads.
pub fn render(balls: &[Ball], camera: &Camera, width: usize, height: usize, options: &Options) -> Image {
    let scene = Scene::new(balls, camera, width, height, options);
    let srgb = color::srgb_table();
    let mut rgba = vec![255; width * height * 4];
    let level = Level::new();
    rgba.par_chunks_mut((width * 4).max(1)).enumerate().for_each(|(y, row)| {
        dispatch!(level, _simd => scene.shade_row(y, row, &srgb));
    });
    let mut image = Image { width, height, rgba };
    for line in options.lines {
        scene.draw(line, &srgb, &mut image);
    }
    image
}

/// Taps into depths, for shadows and for the sky: loops over as many become vector instructions.
const TAPS: usize = 16;
/// Samples of a pixel along each side.
const FINE: usize = 2;
/// Edge of the light's raster.
const LIGHT: usize = 1024;

/// All that shading looks at.
struct Scene<'a> {
    balls: &'a [Ball],
    options: &'a Options<'a>,
    seen: Raster,
    lit: Raster,
    /// Unit direction towards the light.
    light: Vec3,
    /// Mean radius of a ball, m: how soft shadows on the ground and on meshes are.
    grain: f32,
    /// Columns and rows of taps on the unit disc.
    taps: [[f32; TAPS]; 2],
}

impl<'a> Scene<'a> {
    fn new(balls: &'a [Ball], camera: &Camera, width: usize, height: usize, options: &'a Options<'a>) -> Scene<'a> {
        let facets = options.facets;
        let sound = || balls.iter().filter(|ball| ball.center.is_finite() && ball.radius.is_finite());
        let corners = facets.iter().flat_map(|facet| facet.corners).filter(|p| p.is_finite());
        let tips = sound().flat_map(|ball| [ball.center - ball.radius, ball.center + ball.radius]).chain(corners);
        // A particle lost at the end of the world must not cost the others their shadows.
        let far = 2.0 * camera.eye.distance(camera.target);
        let tips = tips.filter(|p| p.distance(camera.target) < far);
        let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let (low, high) = tips.fold(empty, |(low, high), p| (low.min(p), high.max(p)));
        let (low, high) = if low.is_finite() { (low, high) } else { (Vec3::ZERO, Vec3::ONE) };
        let light = options.light.try_normalize().unwrap_or(Vec3::Z);
        let lamp = Camera::framing(low, high, light, 0.2, 1.0);
        let mean_radius = sound().map(|ball| ball.radius).sum::<f32>() / sound().count() as f32;
        Scene {
            balls,
            options,
            seen: Raster::new(balls, facets, options.ground, camera, width * FINE, height * FINE),
            lit: Raster::new(balls, facets, None, &lamp, LIGHT, LIGHT),
            light,
            grain: if mean_radius > 0.0 { mean_radius } else { 0.01 * (high - low).length() },
            taps: spiral(),
        }
    }

    /// Colours row `y` of the picture.
    #[inline(always)]
    fn shade_row(&self, y: usize, row: &mut [u8], srgb: &[u8]) {
        for (x, pixel) in row.chunks_exact_mut(4).enumerate() {
            let linear = self.shade(x, y).clamp(Vec3::ZERO, Vec3::ONE);
            for k in 0..3 {
                pixel[k] = srgb[(linear[k] * 4096.0 + 0.5) as usize];
            }
        }
    }

    /// Linear colour of a pixel: the mean of its samples. Samples that show the same thing are shaded once, in their middle.
    #[inline(always)]
    fn shade(&self, x: usize, y: usize) -> Vec3 {
        let samples: [_; FINE * FINE] = std::array::from_fn(|i| {
            let (x, y) = (FINE * x + i % FINE, FINE * y + i / FINE);
            (vec2(x as f32 + 0.5, y as f32 + 0.5), self.seen.at(x, y))
        });
        let mut sum = Vec3::ZERO;
        for (i, (_, (_, shows))) in samples.iter().enumerate() {
            if samples[..i].iter().any(|(_, (_, before))| before == shows) {
                continue;
            }
            let same = || samples.iter().filter(|(_, (_, other))| other == shows);
            let count = same().count() as f32;
            let place = same().map(|(place, _)| *place).sum::<Vec2>() / count;
            let depth = same().map(|(_, (depth, _))| depth).sum::<f32>() / count;
            sum += count * self.color(place, depth, *shows);
        }
        sum / (FINE * FINE) as f32
    }

    /// Linear colour of what is shown at a raster position.
    #[inline(always)]
    fn color(&self, place: Vec2, depth: f32, shows: u32) -> Vec3 {
        let fall = place.y / self.seen.height as f32;
        let background = Vec3::from(self.options.above).lerp(self.options.below.into(), fall);
        if shows == NOTHING {
            return background;
        }
        let view = &self.seen.view;
        let ray = view.ray(view.slope(place));
        let point = view.eye + depth * ray;
        if shows == GROUND {
            let open = self.openness(place, depth, Vec3::Z, self.grain);
            return background * (0.35 + 0.65 * open) * (0.55 + 0.45 * self.sunshine(point, self.grain));
        }

        let (normal, grain, color) = match self.balls.get(shows as usize) {
            Some(ball) => ((point - ball.center).normalize(), ball.radius, ball.color),
            None => {
                let facet = &self.options.facets[shows as usize - self.balls.len()];
                (facet.normal(point, -ray), self.grain, facet.color)
            }
        };
        let (open, sun) = (self.openness(place, depth, normal, grain), self.sunshine(point, grain));
        let facing = normal.dot(self.light).max(0.0);
        let sky = Vec3::new(0.30, 0.29, 0.28).lerp(Vec3::new(0.50, 0.54, 0.60), 0.5 + 0.5 * normal.z);
        let sunlight = Vec3::new(1.0, 0.96, 0.90) * (0.80 * facing * sun);
        let halfway = (self.light - ray.normalize()).normalize_or_zero();
        let gloss = 0.10 * normal.dot(halfway).max(0.0).powi(32) * sun;
        Vec3::from(color) * (sky * open + sunlight) + gloss
    }

    /// Share of the light's rays that reach a point, softened over about the distance `grain`: 0 in shadow, 1 in the sun.
    #[inline(always)]
    fn sunshine(&self, point: Vec3, grain: f32) -> f32 {
        let view = &self.lit.view;
        let local = view.local(point);
        let (_, _, depths) = self.tap(&self.lit, view.pixel(local), 2.0 * grain * view.focal / local.z);
        // Shapes shade what lies two radii behind them: a surface of balls does not shade itself.
        let mut free = [0.0; TAPS];
        for t in 0..TAPS {
            free[t] = if depths[t] > local.z - 2.0 * grain { 1.0 } else { 0.0 };
        }
        sum(free) / TAPS as f32
    }

    /// Share of the sky that reaches a point past its surroundings within a few `grain`: 1 in the open, towards 0 in a crevice.
    #[inline(always)]
    fn openness(&self, place: Vec2, depth: f32, normal: Vec3, grain: f32) -> f32 {
        let view = &self.seen.view;
        let range = 5.0 * grain;
        let (columns, rows, depths) = self.tap(&self.seen, place, (range * view.focal / depth).min(96.0));
        let origin = (depth * view.slope(place)).extend(depth);
        let normal = Vec3::new(normal.dot(view.right), normal.dot(view.up), normal.dot(view.forward));
        let (inverse, closest) = (1.0 / view.focal, 0.01 * grain * grain);
        let mut blocked = [0.0; TAPS];
        for t in 0..TAPS {
            // Without branches, which would be mispredicted: an infinite depth comes to a fade of nought.
            let x = depths[t] * (columns[t] + 0.5 - view.middle.x) * inverse - origin.x;
            let y = depths[t] * (view.middle.y - rows[t] - 0.5) * inverse - origin.y;
            let z = depths[t] - origin.z;
            let square = x * x + y * y + z * z;
            let fade = (1.0 - square / (range * range)).max(0.0);
            let rise = (x * normal.x + y * normal.y + z * normal.z) / (square + closest).sqrt();
            blocked[t] = fade * (rise - 0.1).max(0.0);
        }
        (1.0 - 2.0 * sum(blocked) / TAPS as f32).max(0.0)
    }

    /// Columns, rows and depths (m) of the samples around a place of a raster, up to `reach` samples away.
    #[inline(always)]
    fn tap(&self, raster: &Raster, place: Vec2, reach: f32) -> ([f32; TAPS], [f32; TAPS], [f32; TAPS]) {
        let (mut columns, mut rows) = ([0.0; TAPS], [0.0; TAPS]);
        for t in 0..TAPS {
            columns[t] = (place.x + reach * self.taps[0][t]).floor();
            rows[t] = (place.y + reach * self.taps[1][t]).floor();
        }
        (columns, rows, raster.depths(&columns, &rows))
    }

    /// Blends a line into the picture. Each step along its longer direction covers the two or three pixels across it.
    fn draw(&self, line: &Line, srgb: &[u8], image: &mut Image) {
        let view = &self.seen.view;
        let (mut a, mut b) = (view.local(line.from), view.local(line.to));
        if !(a.is_finite() && b.is_finite()) {
            return;
        }
        if a.z < b.z {
            std::mem::swap(&mut a, &mut b);
        }
        let near = 1e-3 * a.z.abs();
        if a.z <= near {
            return;
        }
        if b.z < near {
            b = a.lerp(b, (a.z - near) / (a.z - b.z));
        }
        let (p, q) = (view.pixel(a) / FINE as f32, view.pixel(b) / FINE as f32);
        let (along, across) = if (q - p).x.abs() > (q - p).y.abs() { (0, 1) } else { (1, 0) };
        let size = [image.width as f32, image.height as f32];
        let (from, to) = (p[along].min(q[along]).max(0.0), p[along].max(q[along]).min(size[along]));
        let color = line.color.map(|x| f32::from(srgb[(x.clamp(0.0, 1.0) * 4096.0 + 0.5) as usize]));
        for step in from.round() as usize..to.round().max(0.0) as usize {
            let t = (step as f32 + 0.5 - p[along]) / (q[along] - p[along]);
            let (place, depth) = (p.lerp(q, t)[across], 1.0 / (1.0 / a.z).lerp(1.0 / b.z, t)); // 1/depth is linear in the picture
            for side in (place - 1.5).floor().max(0.0) as usize..(place + 1.5).clamp(0.0, size[across]) as usize {
                let cover = (1.2 - (side as f32 + 0.5 - place).abs()).clamp(0.0, 1.0);
                let (x, y) = if along == 0 { (step, side) } else { (side, step) };
                let free = |i: usize| self.seen.at(FINE * x + i % FINE, FINE * y + i / FINE).0 > 0.9999 * depth;
                let share = cover * (0..FINE * FINE).filter(|i| free(*i)).count() as f32 / (FINE * FINE) as f32;
                let at = 4 * (y * image.width + x);
                for (byte, color) in image.rgba[at..at + 3].iter_mut().zip(color) {
                    *byte = f32::from(*byte).lerp(color, share).round() as u8;
                }
            }
        }
    }
}

/// Columns and rows of points spread evenly over the unit disc, on a spiral of golden angles.
fn spiral() -> [[f32; TAPS]; 2] {
    let point = |i: usize| ((i as f32 + 0.5) / TAPS as f32).sqrt() * Vec2::from_angle(2.399_963_2 * i as f32);
    [std::array::from_fn(|i| point(i).x), std::array::from_fn(|i| point(i).y)]
}

/// Sum, in an order that suits vectors.
#[inline(always)]
fn sum(mut x: [f32; TAPS]) -> f32 {
    let mut half = TAPS / 2;
    while half > 0 {
        for t in 0..half {
            x[t] += x[t + half];
        }
        half /= 2;
    }
    x[0]
}
