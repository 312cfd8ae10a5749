// Light on what the eye sees: sun with soft shadows, sky with crevices, ground.

@group(1) @binding(0) var albedo: texture_2d<f32>;
@group(1) @binding(1) var normals: texture_2d<f32>;
@group(1) @binding(2) var depths: texture_depth_2d;
@group(1) @binding(3) var shadow: texture_depth_2d;
@group(1) @binding(4) var compare: sampler_comparison;
@group(1) @binding(5) var<uniform> sun: View;
@group(1) @binding(6) var veil: texture_2d<f32>;
@group(1) @binding(7) var smooth_sampler: sampler;

@vertex
fn picture(@builtin(vertex_index) v: u32) -> @builtin(position) vec4<f32> {
    return cover(v);
}

const GOLDEN: f32 = 2.3999632;

// Share of the sun that reaches a point, coloured where it comes through water.
fn sunshine(point: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    let bias = 1.5 * look.grain * normal;
    let l = local(sun, point + bias);
    let c = clip(sun, l);
    let uv = vec2(0.5, -0.5) * c.xy + 0.5;
    if any(uv < vec2(0.0)) || any(uv > vec2(1.0)) || c.z <= 0.0 {
        return vec3(1.0);
    }
    var sum = 0.0;
    for (var k = 0; k < 12; k++) {
        let r = sqrt((f32(k) + 0.5) / 12.0);
        let tap = r * vec2(cos(GOLDEN * f32(k)), sin(GOLDEN * f32(k)));
        sum += textureSampleCompareLevel(shadow, compare, uv + look.soft * tap / sun.size, c.z);
    }
    let water = textureSampleLevel(veil, smooth_sampler, uv, 0.0).r;
    return sum / 12.0 * exp(-0.8 * look.absorb * water - 0.12 * min(water / look.grain, 3.0));
}

// Share of the sky that reaches a point past its surroundings.
fn openness(pixel: vec2<f32>, z: f32, normal: vec3<f32>) -> f32 {
    let taps = i32(look.arrow.w);
    if taps == 0 {
        return 1.0;
    }
    let range = 5.0 * look.grain;
    let reach = min(range / z / (2.0 * view.tan_y) * view.size.y, 64.0);
    if reach < 1.0 {
        return 1.0;
    }
    let n = vec3(dot(normal, view.right), dot(normal, view.up), dot(normal, view.forward));
    let origin = z * vec3(slope(view, pixel), 1.0);
    let last = vec2<i32>(view.size) - 1;
    var blocked = 0.0;
    for (var k = 0; k < taps; k++) {
        let r = reach * sqrt((f32(k) + 0.5) / f32(taps));
        let at = vec2<i32>(pixel + r * vec2(cos(GOLDEN * f32(k)), sin(GOLDEN * f32(k))));
        let d = textureLoad(depths, clamp(at, vec2(0), last), 0);
        if d > 0.0 {
            let away = view.near / d * vec3(slope(view, vec2<f32>(at) + 0.5), 1.0) - origin;
            let square = dot(away, away);
            let fade = max(1.0 - square / (range * range), 0.0);
            let rise = dot(away, n) / sqrt(square + 0.01 * look.grain * look.grain);
            blocked += fade * max(rise - 0.1, 0.0);
        }
    }
    return max(1.0 - 2.0 * blocked / f32(taps), 0.0);
}

fn lit(color: vec3<f32>, point: vec3<f32>, normal: vec3<f32>, pixel: vec2<f32>, z: f32) -> vec3<f32> {
    let back = normalize(view.eye - point);
    let open = openness(pixel, z, normal);
    let facing = max(dot(normal, look.light), 0.0);
    var bright = vec3(0.0);
    if facing > 0.0 {
        bright = mix(vec3(1.0), sunshine(point, normal), look.arrow.z);
    }
    let around = mix(0.30, 0.62, 0.5 + 0.5 * normal.z) * (0.25 + 0.75 * open);
    let half = normalize(look.light + back);
    let gloss = 0.22 * pow(max(dot(normal, half), 0.0), 40.0);
    return color * (around + 0.75 * facing * bright) + gloss * facing * bright;
}

struct Shaded {
    @location(0) color: vec4<f32>,
}

// Sky, or the ground with the shadows on it.
fn background(pixel: vec2<f32>, direction: vec3<f32>) -> vec4<f32> {
    let air = sky(direction);
    let t = (look.ground - view.eye.z) / direction.z;
    if look.grounded == 0.0 || !(t > 0.0) || t > 1e5 {
        return vec4(air, 1e9);
    }
    let point = view.eye + t * direction;
    let bright = mix(vec3(1.0), sunshine(point, vec3(0.0, 0.0, 1.0)), look.arrow.z);
    let open = openness(pixel, t, vec3(0.0, 0.0, 1.0));
    let base = mix(look.below, vec3(0.62, 0.60, 0.57), 0.35);
    let color = base * (0.35 + 0.65 * open) * (0.5 + 0.5 * bright);
    let haze = 1.0 - exp(-t * length(direction) / (60.0 * sun.tan_x));
    return vec4(mix(color, air, haze), t);
}

@fragment
fn shade(@builtin(position) at: vec4<f32>) -> Shaded {
    let pixel = vec2<i32>(at.xy);
    let direction = ray(view, slope(view, at.xy));
    let d = textureLoad(depths, pixel, 0);
    if d == 0.0 {
        return Shaded(background(at.xy, direction));
    }
    let z = view.near / d;
    let point = view.eye + z * direction;
    if look.grounded > 0.0 && point.z < look.ground - 0.5 * look.grain && view.eye.z > look.ground {
        return Shaded(background(at.xy, direction));
    }
    let color = textureLoad(albedo, pixel, 0);
    if color.a < 0.75 {
        return Shaded(vec4(color.rgb, z));
    }
    let normal = normalize(2.0 * textureLoad(normals, pixel, 0).xyz - 1.0);
    return Shaded(vec4(lit(color.rgb, point, normal, at.xy, z), z));
}
