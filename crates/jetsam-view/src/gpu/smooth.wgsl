// The depths of a fluid's balls become a surface, by one of three filters: narrow range (Truong and Yuksel 2018), bilateral, or
// curvature flow (van der Laan et al. 2009). Texels hold depth (m), 0 where there is no fluid.

@group(1) @binding(0) var depths: texture_depth_2d;
@group(1) @binding(1) var field: texture_2d<f32>;

struct Way {
    along: vec2<i32>,
}
@group(2) @binding(0) var<uniform> way: Way;

@vertex
fn picture(@builtin(vertex_index) v: u32) -> @builtin(position) vec4<f32> {
    return cover(v);
}

// From the depth buffer to depth in m.
@fragment
fn linear(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let d = textureLoad(depths, vec2<i32>(at.xy), 0);
    return vec4(select(0.0, view.near / d, d > 0.0), 0.0, 0.0, 0.0);
}

fn depth_at(p: vec2<i32>) -> f32 {
    return textureLoad(field, clamp(p, vec2(0), vec2<i32>(view.size) - 1), 0).r;
}

// Pixels of a length at a depth, no more than 24.
fn pixels(length: f32, z: f32) -> f32 {
    return min(length / z / (2.0 * view.tan_y) * view.size.y, 24.0);
}

// One pass of a separable filter along `way`.
@fragment
fn narrow(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let p = vec2<i32>(at.xy);
    let z = depth_at(p);
    if z == 0.0 {
        return vec4(0.0);
    }
    let radius = pixels(look.smoothing.x, z);
    let n = i32(ceil(radius));
    let sigma = max(0.5 * radius, 0.5);
    let delta = look.smoothing.y;
    // the range grows with what is let in: steep surfaces stay whole
    var low = z - delta;
    var high = z + delta;
    var sum = z;
    var weight = 1.0;
    for (var k = 1; k <= n; k++) {
        let g = exp(-0.5 * f32(k * k) / (sigma * sigma));
        var a = depth_at(p + k * way.along);
        var b = depth_at(p - k * way.along);
        var wa = g;
        var wb = g;
        // behind or beyond the range: left out, its mirror image with it
        if a == 0.0 || a > high || b == 0.0 || b > high {
            wa = 0.0;
            wb = 0.0;
        }
        // before the range: held a little before this pixel
        a = select(a, z - 0.2 * delta, a < low);
        b = select(b, z - 0.2 * delta, b < low);
        if wa > 0.0 {
            low = min(low, min(a, b) - delta);
            high = max(high, max(a, b) + delta);
        }
        sum += wa * a + wb * b;
        weight += wa + wb;
    }
    return vec4(sum / weight, 0.0, 0.0, 0.0);
}

// The last pass of the narrow-range filter, in two dimensions: what separable passes leave of rows and columns goes.
@fragment
fn tidy(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let p = vec2<i32>(at.xy);
    let z = depth_at(p);
    if z == 0.0 {
        return vec4(0.0);
    }
    var sum = 0.0;
    var weight = 0.0;
    for (var y = -2; y <= 2; y++) {
        for (var x = -2; x <= 2; x++) {
            let a = depth_at(p + vec2(x, y));
            if a != 0.0 && abs(a - z) < look.smoothing.y {
                let g = exp(-0.25 * f32(x * x + y * y));
                sum += g * a;
                weight += g;
            }
        }
    }
    return vec4(sum / weight, 0.0, 0.0, 0.0);
}

@fragment
fn bilateral(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let p = vec2<i32>(at.xy);
    let z = depth_at(p);
    if z == 0.0 {
        return vec4(0.0);
    }
    let radius = pixels(look.smoothing.x, z);
    let n = i32(ceil(radius));
    let sigma = max(0.5 * radius, 0.5);
    var sum = z;
    var weight = 1.0;
    for (var k = 1; k <= n; k++) {
        for (var side = -1; side <= 1; side += 2) {
            let a = depth_at(p + side * k * way.along);
            let off = (a - z) / look.smoothing.y;
            let w = select(exp(-0.5 * f32(k * k) / (sigma * sigma) - 0.5 * off * off), 0.0, a == 0.0);
            sum += w * a;
            weight += w;
        }
    }
    return vec4(sum / weight, 0.0, 0.0, 0.0);
}

// A step of the flow that makes the surface's mean curvature smaller.
@fragment
fn flow(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let p = vec2<i32>(at.xy);
    let z = depth_at(p);
    if z == 0.0 {
        return vec4(0.0);
    }
    let e = depth_at(p + vec2(1, 0));
    let w = depth_at(p - vec2(1, 0));
    let n = depth_at(p + vec2(0, 1));
    let s = depth_at(p - vec2(0, 1));
    let ne = depth_at(p + vec2(1, 1));
    let nw = depth_at(p + vec2(-1, 1));
    let se = depth_at(p + vec2(1, -1));
    let sw = depth_at(p - vec2(1, 1));
    let limit = 4.0 * look.smoothing.y;
    let far = max(max(abs(e - z), abs(w - z)), max(abs(n - z), abs(s - z)));
    if min(min(e, w), min(n, s)) == 0.0 || min(min(ne, nw), min(se, sw)) == 0.0 || far > limit {
        return vec4(z, 0.0, 0.0, 0.0);
    }
    let zx = 0.5 * (e - w);
    let zy = 0.5 * (n - s);
    let zxx = e - 2.0 * z + w;
    let zyy = n - 2.0 * z + s;
    let zxy = 0.25 * (ne - nw - se + sw);
    let cx = 2.0 * view.tan_x / view.size.x;
    let cy = 2.0 * view.tan_y / view.size.y;
    let d = cy * cy * zx * zx + cx * cx * zy * zy + cx * cx * cy * cy * z * z;
    let dx = 2.0 * (cy * cy * zx * zxx + cx * cx * zy * zxy + cx * cx * cy * cy * z * zx);
    let dy = 2.0 * (cy * cy * zx * zxy + cx * cx * zy * zyy + cx * cx * cy * cy * z * zy);
    let ex = 0.5 * zx * dx - zxx * d;
    let ey = 0.5 * zy * dy - zyy * d;
    let h = 0.5 * (cy * ex + cx * ey) / (d * sqrt(d));
    // over a flat surface h is half the Laplacian in pixels over the size of a pixel: this step is one of diffusion, stable below 1/4
    let step = 2.0 * look.smoothing.z * cx * z;
    return vec4(z - clamp(step * h, -0.5 * look.smoothing.y, 0.5 * look.smoothing.y), 0.0, 0.0, 0.0);
}
