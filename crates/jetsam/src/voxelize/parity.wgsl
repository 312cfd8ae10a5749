// The parity rule on the GPU: twin of `fill::parity`, exact to the last bit.
//
// `toggle` runs once per triangle and slice (and band of rows): it finds the rows that pass through the triangle and flips, in each, the bit
// of the first cell beyond the crossing. `prefix` runs once per row: a running XOR turns flips into cells.
//
// Every decision is the sign of a 128-bit integer, so it does not matter how the driver rounds. Floating point only
// guesses where the sign changes; see `first_at_least`.

struct Params {
    // Cells along x and y.
    nx: u32,
    ny: u32,
    // The first slice of this pass, and how many there are.
    first: u32,
    slices: u32,
    triangles: u32,
    // Pairs of a triangle and a slice that passes through it.
    pairs: u32,
    // Words of 32 cells in a row.
    row_words: u32,
    unused: u32,
}

// The most rows for one invocation: watchdogs end kernels that run for long, and Mesa's llvmpipe leaves loops, silently,
// after 65,535 rounds counted over all loops of an invocation. A row takes about four.
const BAND = 2048u;

@group(0) @binding(0) var<uniform> params: Params;
// x, y, z of every vertex: 64-bit integers, low half first, in 2^-22 of a cell.
@group(0) @binding(1) var<storage, read> vertices: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> triangles: array<u32>;
// For every triangle, its first pair and the slice of that pair.
@group(0) @binding(3) var<storage, read> spans: array<vec2<u32>>;
// The cells, 32 to a word, row by row.
@group(0) @binding(4) var<storage, read_write> cells: array<atomic<u32>>;
// One bit per row: whether it passed through the surface an odd number of times.
@group(0) @binding(5) var<storage, read_write> odd: array<atomic<u32>>;

// ---- Integers of 128 bits: two's complement, lowest word first ------------------------------------------------------

alias Wide = vec4<u32>;

fn wide(low_high: vec2<u32>) -> Wide {
    let sign = select(0u, 0xffffffffu, low_high.y >= 0x80000000u);
    return Wide(low_high, sign, sign);
}

// The coordinate of cell `n`: n << 22.
fn at_cell(n: u32) -> Wide {
    return Wide(n << 22u, n >> 10u, 0u, 0u);
}

fn negative(a: Wide) -> bool {
    return a.w >= 0x80000000u;
}

fn plus(a: Wide, b: Wide) -> Wide {
    let sum = a + b;
    let over = vec4<u32>(sum < a);
    let y = sum.y + over.x;
    let over_y = over.y | u32(y < sum.y);
    let z = sum.z + over_y;
    let over_z = over.z | u32(z < sum.z);
    return Wide(sum.x, y, z, sum.w + over_z);
}

fn negated(a: Wide) -> Wide {
    return plus(~a, Wide(1u, 0u, 0u, 0u));
}

fn minus(a: Wide, b: Wide) -> Wide {
    return plus(a, negated(b));
}

// a << n for 0 < n < 32.
fn shifted(a: Wide, n: u32) -> Wide {
    return (a << vec4<u32>(n)) | (Wide(0u, a.xyz) >> vec4<u32>(32u - n));
}

// a * n for n < 2^16.
fn scaled(a: Wide, n: u32) -> Wide {
    let low = (a & vec4<u32>(0xffffu)) * n;
    let high = (a >> vec4<u32>(16u)) * n;
    let here = low + (high << vec4<u32>(16u));
    let over = (high >> vec4<u32>(16u)) + vec4<u32>(here < low);
    return plus(here, Wide(0u, over.xyz));
}

// a * b for |b| < 2^48, in three digits of 16 bits.
fn product(a: Wide, b: Wide) -> Wide {
    var m = b;
    if negative(b) {
        m = negated(b);
    }
    var p = scaled(a, m.y & 0xffffu);
    p = plus(shifted(p, 16u), scaled(a, m.x >> 16u));
    p = plus(shifted(p, 16u), scaled(a, m.x & 0xffffu));
    if negative(b) {
        p = negated(p);
    }
    return p;
}

// Roughly, for a >= 0.
fn magnitude(a: Wide) -> f32 {
    return dot(vec4<f32>(a), vec4<f32>(1.0, 4294967296.0, 18446744073709551616.0, 79228162514264337593543950336.0));
}

// The least i with i * step >= goal, or n if that is less; step > 0, n < 2^16. The quotient in floating point is the
// first guess, seldom wrong by more than one; exact steps lead from there to the answer, however far.
fn first_at_least(goal: Wide, step: Wide, n: u32) -> u32 {
    if negative(goal) {
        return 0u;
    }
    var i = u32(clamp(ceil(magnitude(goal) / magnitude(step)), 0.0, f32(n)));
    var ahead = minus(scaled(step, i), goal);
    while negative(ahead) && i < n {
        ahead = plus(ahead, step);
        i += 1u;
    }
    while i > 0u {
        ahead = minus(ahead, step);
        if negative(ahead) {
            break;
        }
        i -= 1u;
    }
    return i;
}

// ---- Toggles --------------------------------------------------------------------------------------------------------

struct Point {
    x: Wide,
    y: Wide,
    z: Wide,
}

fn corner(at: u32) -> Point {
    let v = 3u * triangles[at];
    return Point(wide(vertices[v]), wide(vertices[v + 1u]), wide(vertices[v + 2u]));
}

// The first row at or beyond the point where the edge passes through the slice, and whether it does.
struct End {
    row: u32,
    passes: bool,
}

fn end_of_rows(a: Point, b: Point, z: Wide) -> End {
    let a_beyond = negative(minus(z, a.z));
    if a_beyond == negative(minus(z, b.z)) {
        return End(0u, false);
    }
    var low = a;
    var high = b;
    if a_beyond {
        low = b;
        high = a;
    }
    let dz = minus(high.z, low.z);
    let goal = plus(product(low.y, dz), product(minus(high.y, low.y), minus(z, low.z)));
    return End(first_at_least(goal, shifted(dz, 22u), params.ny), true);
}

// The number of this invocation in a dispatch folded into two dimensions.
fn serial(id: vec3<u32>, groups: vec3<u32>) -> u32 {
    return id.y * groups.x * 64u + id.x;
}

@compute @workgroup_size(64)
fn toggle(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let pair = serial(id, groups);
    if pair >= params.pairs {
        return;
    }
    // The last triangle whose first pair is not beyond this one.
    var t = 0u;
    var end = params.triangles;
    while end - t > 1u {
        let middle = t + (end - t) / 2u;
        if spans[middle].x <= pair {
            t = middle;
        } else {
            end = middle;
        }
    }
    let k = spans[t].y + (pair - spans[t].x);
    let z = at_cell(k);
    let a = corner(3u * t);
    let b = corner(3u * t + 1u);
    let c = corner(3u * t + 2u);

    // Two sides pass through the slice, and the rows between them pass through the triangle.
    let ab = end_of_rows(a, b, z);
    let bc = end_of_rows(b, c, z);
    let ca = end_of_rows(c, a, z);
    var first = params.ny;
    var last = 0u;
    if ab.passes {
        first = ab.row;
        last = ab.row;
    }
    if bc.passes {
        first = min(first, bc.row);
        last = max(last, bc.row);
    }
    if ca.passes {
        first = min(first, ca.row);
        last = max(last, ca.row);
    }
    // Each layer of the dispatch takes its share of the rows.
    first = max(first, id.z * BAND);
    last = min(last, (id.z + 1u) * BAND);
    if first >= last {
        return;
    }

    // The triangle's plane, its normal turned to +x: cell i is at or beyond it where i * step >= goal.
    let uy = minus(b.y, a.y);
    let uz = minus(b.z, a.z);
    let vy = minus(c.y, a.y);
    let vz = minus(c.z, a.z);
    let ux = minus(b.x, a.x);
    let vx = minus(c.x, a.x);
    var normal_x = minus(product(uy, vz), product(uz, vy));
    var normal_y = minus(product(uz, vx), product(ux, vz));
    var normal_z = minus(product(ux, vy), product(uy, vx));
    if negative(normal_x) {
        normal_x = negated(normal_x);
        normal_y = negated(normal_y);
        normal_z = negated(normal_z);
    }
    let step = shifted(normal_x, 22u);
    let row_step = shifted(normal_y, 22u);
    var goal = minus(
        product(normal_x, a.x),
        plus(product(normal_y, minus(at_cell(first), a.y)), product(normal_z, minus(z, a.z))),
    );
    let slice = (k - params.first) * params.ny;
    for (var j = first; j < last; j += 1u) {
        let i = first_at_least(goal, step, params.nx);
        let row = slice + j;
        if i < params.nx {
            atomicXor(&cells[row * params.row_words + i / 32u], 1u << (i % 32u));
        } else {
            atomicXor(&odd[row / 32u], 1u << (row % 32u));
        }
        goal = minus(goal, row_step);
    }
}

// ---- From toggles to cells ------------------------------------------------------------------------------------------

@compute @workgroup_size(64)
fn prefix(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let row = serial(id, groups);
    if row >= params.ny * params.slices {
        return;
    }
    var carry = 0u;
    for (var w = 0u; w < params.row_words; w += 1u) {
        let at = row * params.row_words + w;
        // Bit n becomes the XOR of bits 0 to n.
        var word = atomicLoad(&cells[at]);
        word ^= word << 1u;
        word ^= word << 2u;
        word ^= word << 4u;
        word ^= word << 8u;
        word ^= word << 16u;
        word ^= carry;
        carry = select(0u, 0xffffffffu, word >= 0x80000000u);
        // Nothing lies beyond the row.
        let left = params.nx - min(params.nx, 32u * w);
        if left < 32u {
            word &= (1u << left) - 1u;
        }
        atomicStore(&cells[at], word);
    }
    // Crossings within the row; those beyond it have been counted by `toggle`.
    if carry != 0u {
        atomicXor(&odd[row / 32u], 1u << (row % 32u));
    }
}
