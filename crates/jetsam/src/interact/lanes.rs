//! Sixteen lanes: the only vector primitives the pair loops need besides plain loops `for l in 0..16`, which
//! the compiler turns into full-width instructions under run-time dispatch.
//!
//! The width is 16 on every machine, so that all of them add in the same order and give the same bits.

use crate::state::Record;
use fearless_simd::prelude::*;
use fearless_simd::{f32x8, f32x16};

/// Lanes handled at once.
pub const LANES: usize = 16;
/// Sixteen numbers.
pub type Lanes = [f32; LANES];

/// Rounds a length up to whole vectors.
#[inline(always)]
pub fn padded(n: usize) -> usize {
    n.next_multiple_of(LANES)
}

/// Sum of the lanes in a fixed order: halves onto each other. By hand, as the compiler would not unroll it.
#[inline(always)]
pub fn sum<S: Simd>(simd: S, a: &Lanes) -> f32 {
    let (low, high) = f32x16::load_array_ref(simd, a).split();
    let (low, high) = (low + high).split();
    let v = (low + high).to_array();
    (v[0] + v[2]) + (v[1] + v[3])
}

/// Sixteen records side by side.
pub struct Transposed {
    /// Positions (m).
    pub x: [Lanes; 3],
    /// Rest volumes.
    pub volume: Lanes,
    /// Velocities (m/s).
    pub v: [Lanes; 3],
    /// Pressure shares (Pa).
    pub share: Lanes,
}

/// Loads the records named by 16 indices: 16 whole-record loads and three rounds of unzipping.
#[inline(always)]
pub fn gather<S: Simd>(simd: S, records: &[Record], list: &[u32; LANES]) -> Transposed {
    let r = [
        pair(simd, records, list[0], list[1]),
        pair(simd, records, list[2], list[3]),
        pair(simd, records, list[4], list[5]),
        pair(simd, records, list[6], list[7]),
        pair(simd, records, list[8], list[9]),
        pair(simd, records, list[10], list[11]),
        pair(simd, records, list[12], list[13]),
        pair(simd, records, list[14], list[15]),
    ];
    // component c = 4 c2 + 2 c1 + c0: the first round splits by c0, the second by c1, the third by c2
    let (a0, b0) = unzip(r[0], r[1]);
    let (a1, b1) = unzip(r[2], r[3]);
    let (a2, b2) = unzip(r[4], r[5]);
    let (a3, b3) = unzip(r[6], r[7]);
    let (c04, c26) = (unzip(a0, a1), unzip(a2, a3));
    let (c15, c37) = (unzip(b0, b1), unzip(b2, b3));
    let (c0, c4) = unzip(c04.0, c26.0);
    let (c2, c6) = unzip(c04.1, c26.1);
    let (c1, c5) = unzip(c15.0, c37.0);
    let (c3, c7) = unzip(c15.1, c37.1);
    Transposed {
        x: [c0.to_array(), c1.to_array(), c2.to_array()],
        volume: c3.to_array(),
        v: [c4.to_array(), c5.to_array(), c6.to_array()],
        share: c7.to_array(),
    }
}

/// Two records in one vector.
#[inline(always)]
fn pair<S: Simd>(simd: S, records: &[Record], a: u32, b: u32) -> f32x16<S> {
    row(simd, records, a).combine(row(simd, records, b))
}

#[inline(always)]
fn row<S: Simd>(simd: S, records: &[Record], index: u32) -> f32x8<S> {
    f32x8::load_array_ref(simd, bytemuck::cast_ref::<Record, [f32; 8]>(&records[index as usize]))
}

/// Even and odd elements of two vectors on end.
#[inline(always)]
fn unzip<S: Simd>(a: f32x16<S>, b: f32x16<S>) -> (f32x16<S>, f32x16<S>) {
    (a.unzip_low(b), a.unzip_high(b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};

    #[test]
    fn gather_transposes() {
        let records: Vec<Record> = (0..40)
            .map(|i| bytemuck::cast::<[f32; 8], Record>(std::array::from_fn(|c| (100 * i + c) as f32)))
            .collect();
        let list: [u32; LANES] = std::array::from_fn(|l| (l * 7 % 40) as u32);
        let t = dispatch!(Level::new(), simd => gather(simd, &records, &list));
        for (l, &j) in list.iter().enumerate() {
            let r = records[j as usize];
            assert_eq!([t.x[0][l], t.x[1][l], t.x[2][l]], r.x);
            assert_eq!([t.v[0][l], t.v[1][l], t.v[2][l]], r.v);
            assert_eq!((t.volume[l], t.share[l]), (r.volume, r.share));
        }
    }
}
