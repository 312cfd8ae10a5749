// Water over what is behind it; then pixels of the screen.

@group(1) @binding(0) var scene: texture_2d<f32>;
@group(1) @binding(1) var field: texture_2d<f32>;
@group(1) @binding(2) var thickness: texture_2d<f32>;
@group(1) @binding(3) var smooth_sampler: sampler;

@vertex
fn picture(@builtin(vertex_index) v: u32) -> @builtin(position) vec4<f32> {
    return cover(v);
}

fn depth_at(p: vec2<i32>) -> f32 {
    return textureLoad(field, clamp(p, vec2(0), vec2<i32>(view.size) - 1), 0).r;
}

fn place(p: vec2<i32>, z: f32) -> vec3<f32> {
    return z * vec3(slope(view, vec2<f32>(p) + 0.5), 1.0);
}

// The smaller of two one-sided differences: no normals across an edge.
fn across(p: vec2<i32>, z: f32, way: vec2<i32>) -> vec3<f32> {
    let here = place(p, z);
    let a = depth_at(p + way);
    let b = depth_at(p - way);
    let ahead = place(p + way, a) - here;
    let back = here - place(p - way, b);
    if a == 0.0 || (b != 0.0 && abs(back.z) < abs(ahead.z)) {
        return back;
    }
    return ahead;
}

@fragment
fn compose(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let p = vec2<i32>(at.xy);
    let behind = textureLoad(scene, p, 0);
    let z = depth_at(p);
    if z == 0.0 || z > behind.a {
        return behind;
    }
    let n = normalize(cross(across(p, z, vec2(1, 0)), across(p, z, vec2(0, 1))));
    let local_normal = select(n, -n, n.z > 0.0);
    let normal = local_normal.x * view.right + local_normal.y * view.up + local_normal.z * view.forward;
    let direction = normalize(ray(view, slope(view, at.xy)));

    // what the bent ray meets, unless that is before the water
    let water = textureSampleLevel(thickness, smooth_sampler, at.xy / view.size, 0.0).r;
    let bend = look.refract * min(water, 4.0 * look.grain) * local_normal.xy * vec2(1.0, -1.0);
    let shift = bend / z / (2.0 * view.tan_y) * view.size.y;
    let q = clamp(vec2<i32>(at.xy + shift), vec2(0), vec2<i32>(view.size) - 1);
    var through = textureLoad(scene, q, 0);
    if through.a < z {
        through = behind;
    }
    // no more water than there is before what is seen through it
    let path = min(water, max(through.a - z, 0.0) * 1.2);
    let clear = exp(-look.absorb * path);
    let facing = max(dot(normal, look.light), 0.0);
    let glow = look.scatter * (0.55 + 0.45 * facing);
    let inside = mix(glow, through.rgb, clear);

    let cosine = clamp(-dot(normal, direction), 0.0, 1.0);
    let fresnel = 0.02 + 0.98 * pow(1.0 - cosine, 5.0);
    let mirrored = sky(reflect(direction, normal));
    let half = normalize(look.light - direction);
    // of a single drop little is seen
    let whole = 1.0 - exp(-3.0 * water / look.grain);
    let gloss = 1.2 * whole * pow(max(dot(normal, half), 0.0), 220.0);
    return vec4(mix(inside, mirrored, whole * fresnel) + gloss, z);
}

@group(1) @binding(4) var<uniform> resolve_to: vec4<f32>;

// Averages `resolve_to.z` squared samples, which are `resolve_to.w` pixels wide, and encodes sRGB. The picture begins at `resolve_to.xy` of the target.
@fragment
fn resolve(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let n = i32(resolve_to.z);
    let corner = vec2<i32>((at.xy - resolve_to.xy) / resolve_to.w) * n;
    var sum = vec3(0.0);
    for (var y = 0; y < n; y++) {
        for (var x = 0; x < n; x++) {
            sum += min(textureLoad(scene, corner + vec2(x, y), 0).rgb, vec3(1.0));
        }
    }
    let c = clamp(sum / f32(n * n), vec3(0.0), vec3(1.0));
    let encoded = select(1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, 12.92 * c, c <= vec3(0.0031308));
    return vec4(encoded, 1.0);
}
