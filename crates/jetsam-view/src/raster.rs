//! Which shape is nearest along each line of sight: balls and facets in, depths out. Used for the eye and for the light.
//!
//! Shapes are sorted front to back and listed per tile of the raster they touch; a tile is done at the first shape that lies behind
//! all it shows. Ties go to the lower index, so the order in which threads work leaves no trace.

use crate::camera::View;
use crate::{Ball, Camera, Facet};
use fearless_simd::{Level, dispatch};
use glam::{Vec2, Vec3, vec2};
use rayon::prelude::*;
use std::ops::Range;

/// Edge of a tile in samples.
const TILE: usize = 64;
const SIDE: u32 = TILE as u32;
/// What a sample shows when it shows nothing at all.
pub const NOTHING: u32 = u32::MAX;
/// What a sample shows when it shows the ground.
pub const GROUND: u32 = u32::MAX - 1;

/// What each sample of a picture shows, tile by tile and within a tile row by row: 8 bytes a sample.
pub struct Raster {
    pub view: View,
    pub width: usize,
    pub height: usize,
    /// Tiles per row of tiles.
    across: usize,
    /// m along the line of sight, infinite where there is nothing; one more, infinite, stands for what is beside the raster.
    depth: Vec<f32>,
    /// Index of a shape, or [`NOTHING`] or [`GROUND`].
    shows: Vec<u32>,
}

/// The part of a raster that one thread draws.
struct Tile<'a> {
    depth: &'a mut [f32],
    shows: &'a mut [u32],
}

/// A shape in the camera's axes, and where in the raster it may appear.
struct Splat {
    shape: Shape,
    index: u32,
    /// A depth that no point of it comes before, m.
    nearest: f32,
    columns: Range<usize>,
    rows: Range<usize>,
}

enum Shape {
    Ball {
        center: Vec3,
        radius: f32,
    },
    /// Slopes of the lines of sight to the corners, counter-clockwise, and one over the corners' depths.
    Facet {
        corners: [Vec2; 3],
        nearness: [f32; 3],
    },
}

impl Raster {
    /// Balls count from 0, facets go on from there; `ground` is a height (z) in m.
    pub fn new(
        balls: &[Ball],
        facets: &[Facet],
        ground: Option<f32>,
        camera: &Camera,
        width: usize,
        height: usize,
    ) -> Raster {
        let size = [width, height];
        let view = View::new(camera, width as f32, height as f32);
        let first = balls.len();
        let round = balls.par_iter().enumerate().filter_map(|(i, ball)| Splat::ball(ball, i, &view, size));
        let flat = facets.par_iter().enumerate().filter_map(|(i, facet)| Splat::facet(facet, first + i, &view, size));
        let mut splats: Vec<Splat> = round.chain(flat).collect();
        splats.par_sort_unstable_by(|a, b| a.nearest.total_cmp(&b.nearest).then(a.index.cmp(&b.index)));

        // Counting sort of (tile, splat) pairs by tile: front to back within each.
        let (across, down) = (width.div_ceil(TILE), height.div_ceil(TILE));
        let touched = |s: &Splat| {
            let columns = s.columns.start / TILE..(s.columns.end - 1) / TILE + 1;
            let rows = s.rows.start / TILE..(s.rows.end - 1) / TILE + 1;
            rows.flat_map(move |row| columns.clone().map(move |column| row * across + column))
        };
        let mut ends = vec![0usize; across * down + 1];
        splats.iter().flat_map(touched).for_each(|tile| ends[tile + 1] += 1);
        (1..ends.len()).for_each(|tile| ends[tile] += ends[tile - 1]);
        let mut list = vec![0u32; ends[across * down]];
        let mut next = ends.clone();
        for (i, splat) in splats.iter().enumerate() {
            for tile in touched(splat) {
                list[next[tile]] = i as u32;
                next[tile] += 1;
            }
        }

        let samples = across * down * TILE * TILE;
        let (mut depth, mut shows) = (vec![f32::INFINITY; samples + 1], vec![NOTHING; samples]);
        let level = Level::new();
        let tiles = depth[..samples].par_chunks_mut(TILE * TILE).zip(shows.par_chunks_mut(TILE * TILE));
        tiles.with_max_len(1).enumerate().for_each(|(t, (depth, shows))| {
            let splats = list[ends[t]..ends[t + 1]].iter().map(|i| &splats[*i as usize]);
            let corner = [t % across * TILE, t / across * TILE];
            dispatch!(level, _simd => Tile { depth, shows }.draw(splats, &view, corner, ground));
        });
        Raster { view, width, height, across, depth, shows }
    }

    fn index(&self, x: usize, y: usize) -> usize {
        (y / TILE * self.across + x / TILE) * (TILE * TILE) + y % TILE * TILE + x % TILE
    }

    /// Depth (m) and shape at a sample.
    pub fn at(&self, x: usize, y: usize) -> (f32, u32) {
        let i = self.index(x, y);
        (self.depth[i], self.shows[i])
    }

    /// Depths (m) at samples given by column and row, infinite where there is nothing and beside the raster.
    #[inline(always)]
    pub fn depths<const N: usize>(&self, columns: &[f32; N], rows: &[f32; N]) -> [f32; N] {
        let (width, height, across) = (self.width as u32, self.height as u32, self.across as u32);
        let beside = self.depth.len() as u32 - 1;
        let mut index = [0; N];
        for k in 0..N {
            // a negative one becomes huge
            let (x, y) = (columns[k] as i32 as u32, rows[k] as i32 as u32);
            let tile = (y / SIDE * across + x / SIDE).wrapping_mul(SIDE * SIDE);
            index[k] = if x < width && y < height { tile + (y % SIDE * SIDE + x % SIDE) } else { beside };
        }
        let mut depths = [0.0; N];
        for k in 0..N {
            depths[k] = self.depth[index[k] as usize];
        }
        depths
    }
}

impl Splat {
    /// None for a ball that cannot be seen.
    fn ball(ball: &Ball, index: usize, view: &View, size: [usize; 2]) -> Option<Splat> {
        let (c, r) = (view.local(ball.center), ball.radius);
        if !(c.is_finite() && r.is_finite() && r > 0.0 && c.z > 1.01 * r) {
            return None;
        }
        // The two planes through the eye that hold a camera axis and touch the sphere: their slopes bound its outline.
        let square = (c.z - r) * (c.z + r);
        let reach = |x: f32| r * (x * x + square).sqrt() / square;
        let (middle, reach) = (c.truncate() * c.z / square, vec2(reach(c.x), reach(c.y)));
        let shape = Shape::Ball { center: c, radius: r };
        Splat::new(shape, index, c.z - r, middle - reach, middle + reach, view, size)
    }

    /// None for a facet that cannot be seen or reaches behind the eye.
    fn facet(facet: &Facet, index: usize, view: &View, size: [usize; 2]) -> Option<Splat> {
        let mut corners = facet.corners.map(|p| view.local(p));
        let nearest = corners[0].z.min(corners[1].z).min(corners[2].z);
        if !corners.iter().all(|p| p.is_finite() && p.z > 1e-6) {
            return None;
        }
        let slope = |p: Vec3| p.truncate() / p.z;
        let [a, b, c] = corners.map(slope);
        if (b - a).perp_dot(c - a) < 0.0 {
            corners.swap(1, 2);
        }
        let shape = Shape::Facet { corners: corners.map(slope), nearness: corners.map(|p| 1.0 / p.z) };
        Splat::new(shape, index, nearest, a.min(b).min(c), a.max(b).max(c), view, size)
    }

    /// A shape seen between the slopes `low` and `high`; None when no sample lies there.
    fn new(
        shape: Shape,
        index: usize,
        nearest: f32,
        low: Vec2,
        high: Vec2,
        view: &View,
        size: [usize; 2],
    ) -> Option<Splat> {
        // Samples lie in the middle of raster cells; upward is towards lower rows.
        let cut = |p: f32, size: usize| (p + 0.5).clamp(0.0, size as f32) as usize;
        let (left, right) = (view.middle.x + low.x * view.focal, view.middle.x + high.x * view.focal);
        let (top, bottom) = (view.middle.y - high.y * view.focal, view.middle.y - low.y * view.focal);
        let columns = cut(left, size[0])..cut(right, size[0]);
        let rows = cut(top, size[1])..cut(bottom, size[1]);
        let seen = !columns.is_empty() && !rows.is_empty();
        seen.then_some(Splat { shape, index: index as u32, nearest, columns, rows })
    }
}

impl Tile<'_> {
    /// Draws the splats, which come front to back, into the tile whose first sample is `corner`.
    #[inline(always)]
    fn draw<'a>(self, splats: impl Iterator<Item = &'a Splat>, view: &View, corner: [usize; 2], ground: Option<f32>) {
        let middle = |k: usize, i: usize| (corner[k] + i) as f32 + 0.5;
        let slope_x: [f32; TILE] = std::array::from_fn(|x| view.slope(vec2(middle(0, x), 0.0)).x);
        let slope_y: [f32; TILE] = std::array::from_fn(|y| view.slope(vec2(0.0, middle(1, y))).y);
        if let Some(z) = ground {
            for i in 0..TILE * TILE {
                let t = (z - view.eye.z) / view.ray(vec2(slope_x[i % TILE], slope_y[i / TILE])).z;
                if t > 0.0 && t < 1e6 {
                    (self.depth[i], self.shows[i]) = (t, GROUND);
                }
            }
        }

        for (count, splat) in splats.enumerate() {
            // Now and then: is the tile full, and nearer than all that comes?
            if count % 32 == 31 && self.depth.iter().fold(0.0f32, |most, depth| most.max(*depth)) < splat.nearest {
                break;
            }
            let within = |range: &Range<usize>, from: usize| range.start.max(from) - from..(range.end - from).min(TILE);
            let columns = within(&splat.columns, corner[0]);
            let sx = &slope_x[columns.clone()];
            for y in within(&splat.rows, corner[1]) {
                let row = y * TILE + columns.start..y * TILE + columns.end;
                let (depth, shows) = (&mut self.depth[row.clone()], &mut self.shows[row]);
                match splat.shape {
                    Shape::Ball { center, radius } => {
                        draw(depth, shows, sx, splat.index, |x| ball_depth(center, radius, x, slope_y[y]));
                    }
                    Shape::Facet { corners, nearness } => {
                        draw(depth, shows, sx, splat.index, |x| facet_depth(corners, nearness, x, slope_y[y]));
                    }
                }
            }
        }
    }
}

/// Draws a shape into a row of samples: `at` tells its depth along the line of sight of a sample, infinite beside the shape.
#[inline(always)]
fn draw(depth: &mut [f32], shows: &mut [u32], slopes: &[f32], index: u32, at: impl Fn(f32) -> f32) {
    for ((depth, shows), slope) in depth.iter_mut().zip(shows).zip(slopes) {
        let t = at(*slope);
        let hit = t < *depth;
        *depth = if hit { t } else { *depth };
        *shows = if hit { index } else { *shows };
    }
}

/// Depth at which the line of sight t (x, y, 1) enters a sphere.
///
/// The line comes closest to the centre at t = `closest`, missing it by `miss`. Subtracting squares of distances to the eye instead
/// would lose small balls to rounding.
#[inline(always)]
fn ball_depth(c: Vec3, radius: f32, x: f32, y: f32) -> f32 {
    let square = 1.0 / (x * x + y * y + 1.0);
    let closest = (x * c.x + y * c.y + c.z) * square;
    let miss = Vec3::new(c.x - closest * x, c.y - closest * y, c.z - closest);
    let half = (radius * radius - (miss.x * miss.x + miss.y * miss.y + miss.z * miss.z)) * square;
    if half > 0.0 { closest - half.sqrt() } else { f32::INFINITY }
}

/// Depth at which the line of sight t (x, y, 1) meets a facet: 1 / depth is linear in the slopes.
#[inline(always)]
fn facet_depth(p: [Vec2; 3], nearness: [f32; 3], x: f32, y: f32) -> f32 {
    let side = |a: Vec2, b: Vec2| (b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x);
    let (a, b, c) = (side(p[1], p[2]), side(p[2], p[0]), side(p[0], p[1]));
    let area = a + b + c;
    // Neighbours overlap by a hair: no light through the seams.
    let inside = a.min(b).min(c) >= -1e-5 * area;
    if inside && area > 0.0 { area / (a * nearness[0] + b * nearness[1] + c * nearness[2]) } else { f32::INFINITY }
}
