//! Where rows of cell centres pass through triangles, exactly.
//!
//! In: vertices in lattice units, as integers of 2^-22 of a cell. Out: for one triangle and one slice z = k, every row
//! y = j that passes through it, with the first cell beyond the crossing.
//!
//! **Half-open rule.** A cell centre (i, j, k) stands for the point (i + e, j + e², k + e³) with e > 0 as small as you
//! like (simulation of simplicity; Edelsbrunner & Mücke 1990). No such point lies on a face, an edge or a vertex, so each
//! crossing counts exactly once, whichever triangle it falls to, and a box whose faces lie on cell centres gets its
//! lower faces and not its upper ones. With e this small, "beyond the crossing" is "at or beyond" in i, then j, then
//! k: three ceilings of rational numbers, computed in floating point when that is certain and in 128-bit integers when
//! it is not.

/// Bits of the fraction of a lattice coordinate. A vertex moves by at most 1.2e-7 of a cell when it is rounded.
pub(crate) const FRACTION: u32 = 22;
/// One cell.
pub(crate) const ONE: i64 = 1 << FRACTION;
/// Cells along an axis, at most: keeps every product below in 128 bits.
pub(crate) const MAX_DIM: u32 = 1 << 15;

/// A vertex in lattice units times [`ONE`].
pub(crate) type Fixed = [i64; 3];

/// The slices a triangle passes through: from the first (inclusive) to the last (exclusive).
pub(crate) fn slices(t: [Fixed; 3], nz: u32) -> std::ops::Range<u32> {
    let ceil = |z: i64| (-(-z).div_euclid(ONE)).clamp(0, i64::from(nz)) as u32;
    let [a, b, c] = t.map(|v| v[2]);
    ceil(a.min(b).min(c))..ceil(a.max(b).max(c))
}

/// Calls `hit(j, i, up)` for every row j of slice k, 0 <= j < `ny`, that passes through the triangle: i is the first
/// cell beyond the crossing (possibly outside the grid), and `up` tells whether the winding number rises there.
/// `k` must be one of [`slices`].
pub(crate) fn crossings(t: [Fixed; 3], k: u32, ny: u32, mut hit: impl FnMut(u32, i64, bool)) {
    let z = i64::from(k) * ONE;
    // Two sides pass through the slice, and the rows between them pass through the triangle.
    let mut ends = [0; 2];
    let mut n = 0;
    for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
        if (a[2] <= z) != (b[2] <= z) && n < 2 {
            let (low, high) = if a[2] < b[2] { (a, b) } else { (b, a) };
            ends[n] = row_beyond(low, high, z);
            n += 1;
        }
    }
    let rows = ends[0].min(ends[1]).max(0)..ends[0].max(ends[1]).min(i64::from(ny));
    if n < 2 || rows.is_empty() {
        return;
    }
    let plane = Plane::new(t);
    for j in rows {
        hit(j as u32, plane.cell_beyond(j * ONE, z), plane.normal[0] < 0);
    }
}

/// The first row at or beyond the point where the edge passes through the slice.
fn row_beyond(low: Fixed, high: Fixed, z: i64) -> i64 {
    let (dy, dz, t) = (high[1] - low[1], high[2] - low[2], z - low[2]);
    let guess = (low[1] as f64 + dy as f64 * (t as f64 / dz as f64)) / ONE as f64;
    certain_ceil(guess).unwrap_or_else(|| {
        let dz = i128::from(dz);
        let numerator = i128::from(low[1]) * dz + i128::from(dy) * i128::from(t);
        ceil_ratio(numerator, dz * i128::from(ONE))
    })
}

/// A triangle's plane: normal · (p - corner) = 0.
struct Plane {
    corner: Fixed,
    normal: [i128; 3],
    /// The slopes -dx/dy and -dx/dz.
    slope: [f64; 2],
}

impl Plane {
    fn new([a, b, c]: [Fixed; 3]) -> Plane {
        let edge = |p: Fixed| [0, 1, 2].map(|i| i128::from(p[i] - a[i]));
        let (u, v) = (edge(b), edge(c));
        let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        let nx = normal[0] as f64;
        Plane { corner: a, normal, slope: [normal[1] as f64 / nx, normal[2] as f64 / nx] }
    }

    /// The first cell of the row (y, z) at or beyond the plane. The row must pass through the triangle.
    fn cell_beyond(&self, y: i64, z: i64) -> i64 {
        let (dy, dz) = (y - self.corner[1], z - self.corner[2]);
        let (by_y, by_z) = (self.slope[0] * dy as f64, self.slope[1] * dz as f64);
        // Steep planes may cancel badly: trust the sum only while its terms are small.
        let trusted = by_y.abs().max(by_z.abs()) < (1u64 << 45) as f64;
        let guess = (self.corner[0] as f64 - by_y - by_z) / ONE as f64;
        certain_ceil(guess).filter(|_| trusted).unwrap_or_else(|| {
            let [nx, ny, nz] = self.normal;
            let numerator = i128::from(self.corner[0]) * nx - ny * i128::from(dy) - nz * i128::from(dz);
            ceil_ratio(numerator, nx * i128::from(ONE))
        })
    }
}

/// The ceiling, if the number is not so close to an integer that rounding could have carried it across.
fn certain_ceil(x: f64) -> Option<i64> {
    let near = x - x.round();
    (near.abs() > 1e-5).then(|| x.ceil() as i64)
}

fn ceil_ratio(numerator: i128, denominator: i128) -> i64 {
    let (n, d) = if denominator < 0 { (-numerator, -denominator) } else { (numerator, denominator) };
    (-(-n).div_euclid(d)) as i64
}
