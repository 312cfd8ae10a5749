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

/// Sum of the lanes in a fixed order: halves onto each other.
#[inline(always)]
pub fn sum(a: &Lanes) -> f32 {
    let mut v = *a;
    for half in [8, 4, 2, 1] {
        for l in 0..half {
            v[l] += v[l + half];
        }
    }
    v[0]
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
    let row = |l: usize| -> f32x8<S> {
        f32x8::from_slice(simd, bytemuck::cast_ref::<Record, [f32; 8]>(&records[list[l] as usize]))
    };
    let pair = |l: usize| -> f32x16<S> { row(2 * l).combine(row(2 * l + 1)) };
    let rows = [pair(0), pair(1), pair(2), pair(3), pair(4), pair(5), pair(6), pair(7)];
    let unzip4 = |a: &[f32x16<S>; 8]| {
        (
            [
                a[0].unzip_low(a[1]),
                a[2].unzip_low(a[3]),
                a[4].unzip_low(a[5]),
                a[6].unzip_low(a[7]),
            ],
            [
                a[0].unzip_high(a[1]),
                a[2].unzip_high(a[3]),
                a[4].unzip_high(a[5]),
                a[6].unzip_high(a[7]),
            ],
        )
    };
    let unzip2 = |a: &[f32x16<S>; 4]| {
        (
            [a[0].unzip_low(a[1]), a[2].unzip_low(a[3])],
            [a[0].unzip_high(a[1]), a[2].unzip_high(a[3])],
        )
    };
    // component c = 4 c2 + 2 c1 + c0: the first round splits by c0, the second by c1, the third by c2
    let (even, odd) = unzip4(&rows);
    let (c04, c26) = unzip2(&even);
    let (c15, c37) = unzip2(&odd);
    let low = |a: [f32x16<S>; 2]| a[0].unzip_low(a[1]).to_array();
    let high = |a: [f32x16<S>; 2]| a[0].unzip_high(a[1]).to_array();
    Transposed {
        x: [low(c04), low(c15), low(c26)],
        volume: low(c37),
        v: [high(c04), high(c15), high(c26)],
        share: high(c37),
    }
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
