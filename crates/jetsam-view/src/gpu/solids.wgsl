// Bodies as their meshes, agents as darts, arrows and lines.

struct Surface {
    @location(0) albedo: vec4<f32>,
    @location(1) normal: vec4<f32>,
}

struct Point {
    @builtin(position) at: vec4<f32>,
    @location(0) place: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) @interpolate(flat) color: vec4<f32>,
}

// Rotation, place and colour of each body.
struct Pose {
    turn: vec4<f32>,
    place: vec4<f32>,
    color: vec4<f32>,
}

@group(1) @binding(0) var<storage, read> record: array<vec4<f32>>;
@group(1) @binding(1) var<storage, read> push: array<vec4<f32>>;
@group(1) @binding(2) var<storage, read> tag: array<vec2<u32>>;
@group(1) @binding(3) var<storage, read> owner: array<vec4<f32>>;
@group(2) @binding(0) var<storage, read> pose: array<Pose>;

fn turned(q: vec4<f32>, v: vec3<f32>) -> vec3<f32> {
    let t = 2.0 * cross(q.xyz, v);
    return v + q.w * t + cross(q.xyz, t);
}

fn out_at(p: vec3<f32>, normal: vec3<f32>, color: vec4<f32>) -> Point {
    return Point(clip(view, local(view, p)), p, normal, color);
}

@vertex
fn mesh(@location(0) x: vec3<f32>, @location(1) n: vec3<f32>, @location(2) body: u32) -> Point {
    let p = pose[body];
    return out_at(turned(p.turn, x) + p.place.xyz, turned(p.turn, n), vec4(p.color.rgb, 1.0));
}

@fragment
fn solid(p: Point, @builtin(front_facing) front: bool) -> Surface {
    var n = normalize(p.normal);
    if dot(n, p.place - view.eye) > 0.0 {
        n = -n;
    }
    return Surface(p.color, vec4(0.5 + 0.5 * n, 1.0));
}

// A dart of eight triangles along the agent's velocity: a nose, a waist, a tail.
@vertex
fn dart(@builtin(vertex_index) v: u32, @builtin(instance_index) i: u32) -> Point {
    let corners = array<vec3<f32>, 6>(
        vec3(0.62, 0.0, 0.0),
        vec3(0.12, 0.13, 0.0), vec3(0.12, 0.0, 0.19), vec3(0.12, -0.13, 0.0), vec3(0.12, 0.0, -0.16),
        vec3(-0.45, 0.0, 0.0));
    let faces = array<u32, 24>(
        0u, 1u, 2u, 0u, 2u, 3u, 0u, 3u, 4u, 0u, 4u, 1u,
        5u, 2u, 1u, 5u, 3u, 2u, 5u, 4u, 3u, 5u, 1u, 4u);
    let velocity = record[2u * i + 1u].xyz;
    let speed = length(velocity);
    let along = select(vec3(1.0, 0.0, 0.0), velocity / speed, speed > 1e-12);
    let flat = vec3(along.y, -along.x, 0.0);
    let side = select(vec3(0.0, 1.0, 0.0), normalize(flat), dot(flat, flat) > 1e-9);
    let rise = cross(side, along);
    let flock = owner[tag[i].y];
    let x = record[2u * i].xyz;
    let face = v / 3u * 3u;
    let a = corners[faces[face]];
    let b = corners[faces[face + 1u]];
    let c = corners[faces[face + 2u]];
    let n = normalize(cross(b - a, c - a));
    let p = corners[faces[v]];
    let size = flock.w;
    return out_at(x + size * (p.x * along + p.y * side + p.z * rise), n.x * along + n.y * side + n.z * rise, vec4(flock.rgb, 1.0));
}

// Velocity or acceleration of every so many particles: a shaft and a head that face the eye.
@vertex
fn arrow(@builtin(vertex_index) v: u32, @builtin(instance_index) i: u32) -> Point {
    let t = look.arrow.x;
    let velocity = record[2u * i + 1u].xyz;
    let speed = length(velocity);
    let way = select(t * velocity, 0.5 * t * t * push[i].xyz, look.smoothing.w > 0.5);
    let length = length(way);
    let width = look.arrow.y;
    if tag[i].x % look.segment.w != 0u || length < width {
        return Point(vec4(2.0, 2.0, 0.5, 1.0), vec3(0.0), vec3(0.0), vec4(0.0));
    }
    let along = way / length;
    let start = record[2u * i].xyz;
    let side = normalize(cross(along, start - view.eye));
    let head = min(3.0 * width, 0.5 * length);
    let shaft = length - head;
    let corners = array(
        vec2(0.0, -0.35), vec2(0.0, 0.35), vec2(shaft, -0.35), vec2(shaft, -0.35), vec2(0.0, 0.35), vec2(shaft, 0.35),
        vec2(shaft, -1.1), vec2(shaft, 1.1), vec2(length, 0.0));
    let c = corners[v];
    let p = start + c.x * along + c.y * width * side;
    let color = select(colored(speed), vec3(0.75, 0.06, 0.03), look.smoothing.w > 0.5);
    var point = out_at(p, vec3(0.0), vec4(color, 0.5));
    // in front of the particle it belongs to
    point.at.z *= 1.0 + 2.0 * look.radius.x / max(point.at.w, 1e-6);
    return point;
}

// A line `width` pixels wide: both ends and its colour come as an instance.
@vertex
fn line(
    @builtin(vertex_index) v: u32,
    @location(0) from_: vec3<f32>,
    @location(1) to_: vec3<f32>,
    @location(2) color: vec4<f32>,
) -> Point {
    var a = local(view, from_);
    var b = local(view, to_);
    let near = view.near;
    if a.z < near && b.z < near {
        return Point(vec4(2.0, 2.0, 0.5, 1.0), vec3(0.0), vec3(0.0), vec4(0.0));
    }
    if a.z < near {
        a = mix(b, a, (b.z - near) / (b.z - a.z));
    }
    if b.z < near {
        b = mix(a, b, (a.z - near) / (a.z - b.z));
    }
    let p = clip(view, a);
    let q = clip(view, b);
    let along = (q.xy / q.w - p.xy / p.w) * view.size;
    let across = vec2(-along.y, along.x) / max(length(along), 1e-6);
    var at = p;
    if (v & 1u) == 1u {
        at = q;
    }
    let side = select(-1.0, 1.0, v >= 2u);
    at = vec4(at.xy + side * color.w * across / view.size * at.w, at.z, at.w);
    return Point(at, vec3(0.0), vec3(0.0), vec4(color.rgb, 0.5));
}

// Without light.
@fragment
fn plain(p: Point) -> Surface {
    return Surface(p.color, vec4(0.5));
}

@fragment
fn nothing(p: Point) {}
