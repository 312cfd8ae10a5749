// What every shader sees: the eye (or the sun, a parallel eye), and how things look.

struct View {
    eye: vec3<f32>,
    near: f32,
    right: vec3<f32>,
    // half the width of the picture per unit of depth; of a parallel eye in m
    tan_x: f32,
    up: vec3<f32>,
    tan_y: f32,
    forward: vec3<f32>,
    // slope of the middle of the picture to the right: the other eye sees it from the side
    shift: f32,
    size: vec2<f32>,
    // farthest depth of a parallel eye (m); 0 for perspective
    far: f32,
    // smallest radius of a ball in pixels
    least: f32,
}

struct Look {
    light: vec3<f32>,
    // how soft shadows are, in texels of the shadow map
    soft: f32,
    above: vec3<f32>,
    // height of the ground (m)
    ground: f32,
    below: vec3<f32>,
    // 1 if there is a ground
    grounded: f32,
    // red, green, blue absorbed per metre
    absorb: vec3<f32>,
    // how far a ray is bent: m per m of water
    refract: f32,
    scatter: vec3<f32>,
    // reach of crevices (m)
    grain: f32,
    // what colours show: 0 speed, 1 density, 2 pressure, 3 kind, 4 owner
    quantity: u32,
    low: f32,
    high: f32,
    // exponent: below 1 small values are told apart better
    gamma: f32,
    // first rigid, first static particle, number of fluids, every so many particles has an arrow
    segment: vec4<u32>,
    // radii of balls: fluid, bodies, fluid as its surface, fluid as thickness (m)
    radius: vec4<f32>,
    // time of arrows (s), width of arrows (m), strength of shadows, looks at the surroundings
    arrow: vec4<f32>,
    // radius of smoothing (m), its range (m), step; 1 where arrows are accelerations
    smoothing: vec4<f32>,
    map: array<vec4<f32>, 64>,
}

// A point in the axes of the eye: right, up, depth.
fn local(view: View, p: vec3<f32>) -> vec3<f32> {
    let d = p - view.eye;
    return vec3(dot(d, view.right), dot(d, view.up), dot(d, view.forward));
}

// Depth is reversed: near / depth, 0 at the horizon; of a parallel eye 1 - depth / far.
fn clip(view: View, l: vec3<f32>) -> vec4<f32> {
    if view.far > 0.0 {
        return vec4(l.x / view.tan_x, l.y / view.tan_y, 1.0 - l.z / view.far, 1.0);
    }
    return vec4((l.x - view.shift * l.z) / view.tan_x, l.y / view.tan_y, view.near, l.z);
}

// Slope of the line of sight through a pixel: right and up per unit of depth.
fn slope(view: View, pixel: vec2<f32>) -> vec2<f32> {
    let ndc = vec2(2.0, -2.0) * pixel / view.size + vec2(-1.0, 1.0);
    return ndc * vec2(view.tan_x, view.tan_y) + vec2(view.shift, 0.0);
}

// One unit of depth along a line of sight.
fn ray(view: View, s: vec2<f32>) -> vec3<f32> {
    return view.forward + s.x * view.right + s.y * view.up;
}

fn colored(value: f32) -> vec3<f32> {
    let t = clamp((value - look.low) / (look.high - look.low), 0.0, 1.0);
    let at = 63.0 * pow(t, look.gamma);
    let k = min(u32(at), 62u);
    return mix(look.map[k].rgb, look.map[k + 1u].rgb, at - f32(k));
}

fn sky(direction: vec3<f32>) -> vec3<f32> {
    let rise = normalize(direction).z;
    return mix(look.below, look.above, smoothstep(-0.35, 0.30, rise));
}

// A triangle that covers the picture.
fn cover(v: u32) -> vec4<f32> {
    return vec4(f32(v & 1u) * 4.0 - 1.0, f32(v >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> look: Look;
