//! The two uniforms of `common.wgsl`, filled from camera, scene and style.

use crate::camera::View;
use crate::paint::{RADIUS, SHEER};
use crate::style::{Arrows, ColorBy, Fluid, Lines, Smoothing, Style};
use crate::{Camera, Show};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// `View` of `common.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub struct ViewUniform {
    eye: [f32; 3],
    near: f32,
    right: [f32; 3],
    tan_x: f32,
    up: [f32; 3],
    tan_y: f32,
    forward: [f32; 3],
    shift: f32,
    size: [f32; 2],
    far: f32,
    least: f32,
}

/// Nearest depth drawn, as a fraction of the distance to what is looked at.
const NEAR: f32 = 0.01;

impl ViewUniform {
    /// The eye of a camera, moved `aside` to the right (m) and looking at the same target.
    pub fn eye(camera: &Camera, size: [u32; 2], aside: f32, points: f32) -> Self {
        let view = View::new(camera, size[0] as f32, size[1] as f32);
        let distance = camera.eye.distance(camera.target).max(1e-6);
        let tan_y = (0.5 * camera.fov_y).tan();
        Self {
            eye: (view.eye + aside * view.right).to_array(),
            near: NEAR * distance,
            right: view.right.to_array(),
            tan_x: tan_y * size[0] as f32 / size[1] as f32,
            up: view.up.to_array(),
            tan_y,
            forward: view.forward.to_array(),
            shift: -aside / distance,
            size: size.map(|s| s as f32),
            far: 0.0,
            least: points,
        }
    }

    /// The sun, which sees the whole box from `min` to `max` (m) in `size` texels.
    pub fn sun(min: Vec3, max: Vec3, light: Vec3, size: u32) -> Self {
        let middle = 0.5 * (min + max);
        let camera = Camera { eye: middle + light, target: middle, up: Vec3::Z, fov_y: 1.0 };
        let view = View::new(&camera, 1.0, 1.0);
        let mut reach = Vec3::splat(1e-6);
        for corner in 0..8 {
            let pick = Vec3::from_array([1, 2, 4].map(|bit| f32::from(u8::from(corner & bit != 0))));
            let d = min + pick * (max - min) - middle;
            reach = reach.max(Vec3::new(d.dot(view.right), d.dot(view.up), d.dot(view.forward)).abs());
        }
        Self {
            eye: (middle - reach.z * view.forward).to_array(),
            near: 0.0,
            right: view.right.to_array(),
            tan_x: 1.02 * reach.x,
            up: view.up.to_array(),
            tan_y: 1.02 * reach.y,
            forward: view.forward.to_array(),
            shift: 0.0,
            size: [size as f32; 2],
            far: 2.0 * reach.z,
            least: 0.0,
        }
    }
}

/// `Look` of `common.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub struct LookUniform {
    light: [f32; 3],
    soft: f32,
    above: [f32; 3],
    ground: f32,
    below: [f32; 3],
    grounded: f32,
    absorb: [f32; 3],
    refract: f32,
    scatter: [f32; 3],
    grain: f32,
    quantity: u32,
    low: f32,
    high: f32,
    gamma: f32,
    segment: [u32; 4],
    radius: [f32; 4],
    arrow: [f32; 4],
    smoothing: [f32; 4],
    map: [[f32; 4]; 64],
}

/// Towards the sun; the same as on the CPU.
pub fn light() -> Vec3 {
    crate::Options::default().light.normalize()
}

/// Radius of the balls that make thickness, in spacings: large enough that the lattice does not show.
/// `THIN` of `particles.wgsl` goes with it.
const BLUR: f32 = 1.1;

/// Radius of a ball in spacings where there are lines between them.
const SPECK: f32 = 0.07;

impl LookUniform {
    /// `first` are the first rigid and the first static particle.
    pub fn new(show: &Show, style: &Style, first: [u32; 2]) -> Self {
        let options = crate::Options::default();
        let dx = show.spacing;
        let [low, high] = style.scale(show);
        // a typical depth: a quarter of the domain's diagonal
        let depth = 0.25 * (show.bounds[1] - show.bounds[0]).length();
        let murk = style.murk / depth;
        let usual = match style.fluid {
            Fluid::Balls | Fluid::Sprites if style.lines != Lines::None => SPECK,
            Fluid::Balls | Fluid::Sprites if show.swimmers => SHEER,
            _ => RADIUS,
        };
        let quantity = ColorBy::ALL.iter().position(|c| c.0 == style.color).unwrap_or(0) as u32;
        let strong = if style.smoothing == Smoothing::CurvatureFlow { 0.9 } else { 2.4 };
        Self {
            light: light().to_array(),
            soft: 2.2e-3 * style.shadow_size as f32,
            above: options.above,
            ground: show.ground.unwrap_or(0.0),
            below: options.below,
            grounded: f32::from(u8::from(show.ground.is_some())),
            absorb: [2.4 * murk, 0.85 * murk, 0.5 * murk],
            refract: 0.35,
            scatter: [0.010, 0.135, 0.24],
            grain: RADIUS * dx,
            quantity,
            low,
            high: if high > low { high } else { low + 1.0 },
            gamma: style.gamma(),
            segment: [first[0], first[1], show.fluids.len() as u32, style.arrow_every.max(1)],
            radius: [
                if style.fluid == Fluid::Points { 0.02 } else { style.radius.unwrap_or(usual) } * dx,
                RADIUS * dx,
                1.05 * dx,
                BLUR * dx,
            ],
            arrow: [style.arrows, 0.14 * dx, if style.shadows { 1.0 } else { 0.0 }, style.crevices as f32],
            smoothing: [strong * dx, 0.8 * dx, 0.22, f32::from(u8::from(style.arrows_of == Arrows::Force))],
            map: std::array::from_fn(|k| {
                let [r, g, b] = style.map.at(k as f32 / 63.0);
                [r, g, b, 1.0]
            }),
        }
    }
}
