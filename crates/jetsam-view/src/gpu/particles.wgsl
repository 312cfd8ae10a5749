// Particles as balls: the picture's pixels find them by their lines of sight. Bound straight to the simulation's arrays.

// place and volume, velocity and pressure share: two vectors a particle
@group(1) @binding(0) var<storage, read> record: array<vec4<f32>>;
// acceleration, relative density
@group(1) @binding(1) var<storage, read> push: array<vec4<f32>>;
// id, owner
@group(1) @binding(2) var<storage, read> tag: array<vec2<u32>>;
// colour and whether to draw, of each fluid, then of each body
@group(1) @binding(3) var<storage, read> owner: array<vec4<f32>>;

fn kind_of(i: u32) -> u32 {
    return select(0u, 1u, i >= look.segment.x) + select(0u, 1u, i >= look.segment.y);
}

// Colour, and 0 where the particle is not drawn.
fn look_of(i: u32) -> vec4<f32> {
    let kind = kind_of(i);
    let own = owner[tag[i].y + select(look.segment.z, 0u, kind == 0u)];
    let v = record[2u * i + 1u];
    if look.quantity == 3u {
        let kinds = array(vec3(0.05, 0.28, 0.75), vec3(0.85, 0.30, 0.06), vec3(0.35, 0.32, 0.28));
        return vec4(kinds[kind], own.w);
    }
    if look.quantity == 2u && kind < 2u {
        let density = select(1.0, push[i].w, kind == 0u);
        return vec4(colored(v.w * density * density), own.w);
    }
    if kind == 0u && look.quantity == 0u {
        return vec4(colored(length(v.xyz)), own.w);
    }
    if kind == 0u && look.quantity == 1u {
        return vec4(colored(push[i].w), own.w);
    }
    return own;
}

struct Ball {
    @builtin(position) at: vec4<f32>,
    // slope of the line of sight; seen by the sun, the place on the disc
    @location(0) slope: vec2<f32>,
    @location(1) @interpolate(flat) center: vec4<f32>,
    @location(2) @interpolate(flat) color: vec3<f32>,
}

fn hidden() -> Ball {
    return Ball(vec4(2.0, 2.0, 0.5, 1.0), vec2(0.0), vec4(0.0), vec3(0.0));
}

// The rectangle around a ball's outline, at the depth of its nearest point.
fn outline(v: u32, place: vec3<f32>, given: f32, color: vec3<f32>) -> Ball {
    let c = local(view, place);
    let corner = vec2(f32(v & 1u) * 2.0 - 1.0, f32(v >> 1u) * 2.0 - 1.0);
    if view.far > 0.0 {
        return Ball(clip(view, c + vec3(corner * given, 0.0)), corner, vec4(c, given), color);
    }
    let r = max(given, view.least * c.z * 2.0 * view.tan_y / view.size.y);
    if !(c.z > 1.01 * r) {
        return hidden();
    }
    let square = (c.z - r) * (c.z + r);
    let reach = r * sqrt(c.xy * c.xy + square) / square;
    let s = c.xy * c.z / square + corner * reach;
    let ndc = (s - vec2(view.shift, 0.0)) / vec2(view.tan_x, view.tan_y);
    return Ball(vec4(ndc, view.near / (c.z - r), 1.0), s, vec4(c, r), color);
}

@vertex
fn ball(@builtin(vertex_index) v: u32, @builtin(instance_index) i: u32) -> Ball {
    let own = look_of(i);
    if own.w == 0.0 {
        return hidden();
    }
    let r = select(look.radius.y, look.radius.x, kind_of(i) == 0u);
    return outline(v, record[2u * i].xyz, r, own.rgb);
}

// A square that faces the eye, through the centre.
struct Square {
    @builtin(position) at: vec4<f32>,
    // place in the sprite
    @location(0) uv: vec2<f32>,
    @location(1) @interpolate(flat) color: vec3<f32>,
}

@vertex
fn square(@builtin(vertex_index) v: u32, @builtin(instance_index) i: u32) -> Square {
    let corner = vec2(f32(v & 1u) * 2.0 - 1.0, f32(v >> 1u) * 2.0 - 1.0);
    let c = local(view, record[2u * i].xyz) + vec3(corner * look.radius.x, 0.0);
    return Square(clip(view, c), vec2(0.5, -0.5) * corner + 0.5, look_of(i).rgb);
}

// The fluid for its surface.
@vertex
fn drop(@builtin(vertex_index) v: u32, @builtin(instance_index) i: u32) -> Ball {
    return outline(v, record[2u * i].xyz, look.radius.z, vec3(0.0));
}

// The fluid for its thickness: balls so large that the lattice does not show.
@vertex
fn share(@builtin(vertex_index) v: u32, @builtin(instance_index) i: u32) -> Ball {
    return outline(v, record[2u * i].xyz, look.radius.w, vec3(0.0));
}

// Where a line of sight enters a ball: depth; negative where it passes by. `half` is half the chord per unit of depth.
struct Hit {
    depth: f32,
    half: f32,
}

fn hit(s: vec2<f32>, ball: vec4<f32>) -> Hit {
    let square = 1.0 / (dot(s, s) + 1.0);
    let closest = (dot(s, ball.xy) + ball.z) * square;
    let miss = ball.xyz - closest * vec3(s, 1.0);
    let half = (ball.w * ball.w - dot(miss, miss)) * square;
    if half <= 0.0 {
        return Hit(-1.0, 0.0);
    }
    return Hit(closest - sqrt(half), sqrt(half));
}

struct Surface {
    @location(0) albedo: vec4<f32>,
    @location(1) normal: vec4<f32>,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn shown(b: Ball) -> Surface {
    let h = hit(b.slope, b.center);
    if h.depth <= 0.0 {
        discard;
    }
    let n = (h.depth * vec3(b.slope, 1.0) - b.center.xyz) / b.center.w;
    let normal = n.x * view.right + n.y * view.up + n.z * view.forward;
    return Surface(vec4(b.color, 1.0), vec4(0.5 + 0.5 * normal, 1.0), view.near / h.depth);
}

@fragment
fn depth_alone(b: Ball) -> @builtin(frag_depth) f32 {
    let h = hit(b.slope, b.center);
    if h.depth <= 0.0 {
        discard;
    }
    return view.near / h.depth;
}

// Seen by the sun: a disc through the centre.
@fragment
fn disc(b: Ball) {
    if dot(b.slope, b.slope) > 1.0 {
        discard;
    }
}

@group(2) @binding(0) var sprite: texture_2d<f32>;
@group(2) @binding(1) var sprite_sampler: sampler;

struct Flat {
    @location(0) albedo: vec4<f32>,
    @location(1) normal: vec4<f32>,
}

// Without light: a sprite brings its own.
@fragment
fn textured(s: Square) -> Flat {
    let texel = textureSample(sprite, sprite_sampler, s.uv);
    if texel.a < 0.5 {
        discard;
    }
    return Flat(vec4(texel.rgb * s.color, 0.5), vec4(0.5));
}

@fragment
fn silhouette(s: Square) {
    if textureSample(sprite, sprite_sampler, s.uv).a < 0.5 {
        discard;
    }
}

// Volume of a particle over that of its ball for thickness, whose radius is 1.1 spacings.
const THIN: f32 = 0.179362;

// Length of water along the line of sight (m).
@fragment
fn thickness(b: Ball) -> @location(0) vec4<f32> {
    if view.far > 0.0 {
        let inside = 1.0 - dot(b.slope, b.slope);
        return vec4(THIN * 2.0 * b.center.w * sqrt(max(inside, 0.0)), 0.0, 0.0, 0.0);
    }
    let h = hit(b.slope, b.center);
    if h.depth <= 0.0 {
        discard;
    }
    return vec4(THIN * 2.0 * h.half * sqrt(dot(b.slope, b.slope) + 1.0), 0.0, 0.0, 0.0);
}
