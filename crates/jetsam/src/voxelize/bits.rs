//! A grid of bits, one per cell: rows run along x in words of 64, then y, then z.

use rayon::prelude::*;

/// One bit per cell of a box of cells. The bits of the last word of a row beyond the row are always zero.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BitGrid {
    dims: [u32; 3],
    words: Vec<u64>,
}

impl BitGrid {
    /// An empty grid of `dims` cells along x, y, z.
    pub fn new(dims: [u32; 3]) -> BitGrid {
        BitGrid {
            dims,
            words: vec![0; BitGrid::words_for(dims) as usize],
        }
    }

    /// How many words of 8 bytes a grid takes.
    pub fn words_for([nx, ny, nz]: [u32; 3]) -> u64 {
        u64::from(nx.div_ceil(64))
            .saturating_mul(u64::from(ny))
            .saturating_mul(u64::from(nz))
    }

    /// Cells along x, y, z.
    pub fn dims(&self) -> [u32; 3] {
        self.dims
    }

    /// Words in one row.
    pub fn row_words(&self) -> usize {
        self.dims[0].div_ceil(64) as usize
    }

    /// Words in one slice of constant z.
    pub fn slice_words(&self) -> usize {
        self.row_words() * self.dims[1] as usize
    }

    /// All words.
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// Takes all words anew.
    pub(crate) fn set_words(&mut self, words: impl Iterator<Item = u64>) {
        self.words
            .iter_mut()
            .zip(words)
            .for_each(|(word, new)| *word = new);
    }

    /// The row of cells with the given y and z index.
    pub fn row(&self, j: u32, k: u32) -> &[u64] {
        let start = self.slice_words() * k as usize + self.row_words() * j as usize;
        &self.words[start..start + self.row_words()]
    }

    /// The slices in order of z, for filling in parallel: index and words.
    pub fn par_slices(&mut self) -> impl IndexedParallelIterator<Item = (usize, &mut [u64])> {
        let size = self.slice_words().max(1);
        self.words.par_chunks_mut(size).enumerate()
    }

    /// Whether the cell is set; false outside.
    pub fn get(&self, i: i64, j: i64, k: i64) -> bool {
        let inside = [i, j, k]
            .iter()
            .zip(self.dims)
            .all(|(c, n)| (0..i64::from(n)).contains(c));
        inside && self.row(j as u32, k as u32)[i as usize / 64] >> (i % 64) & 1 == 1
    }

    /// How many cells are set.
    pub fn count(&self) -> u64 {
        self.words
            .par_iter()
            .map(|w| u64::from(w.count_ones()))
            .sum()
    }

    /// The indices of all set cells, x fastest.
    pub fn iter(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        let [_, ny, _] = self.dims;
        let per_row = self.row_words();
        self.words
            .iter()
            .enumerate()
            .filter(|(_, w)| **w != 0)
            .flat_map(move |(at, &word)| {
                let (row, first) = (at / per_row, (at % per_row) as u32 * 64);
                let (j, k) = (row as u32 % ny, row as u32 / ny);
                ones(word).map(move |bit| [first + bit, j, k])
            })
    }

    /// `self`, `other` -> op(self, other), word by word. Both of the same size.
    pub fn combine(&mut self, other: &BitGrid, op: impl Fn(u64, u64) -> u64 + Sync) {
        self.words
            .par_iter_mut()
            .zip(&other.words)
            .for_each(|(a, b)| *a = op(*a, *b));
    }

    /// The grid in which a cell is set if any cell at an offset in `reach` is set here. Row by row: `reach` lists,
    /// for each row offset (dj, dk), how far along x to look both ways. Cells beyond the grid count as `beyond`.
    pub fn dilated(&self, reach: &[(i32, i32, u32)], beyond: bool) -> BitGrid {
        let [nx, ny, nz] = self.dims;
        let mut out = BitGrid::new(self.dims);
        let per_row = self.row_words();
        let ghost = vec![if beyond { !0 } else { 0 }; per_row];
        out.par_slices().for_each(|(k, slice)| {
            let mut spread = vec![0; per_row];
            for (j, row) in slice.chunks_mut(per_row).enumerate() {
                for &(dj, dk, m) in reach {
                    let (y, z) = (j as i64 + i64::from(dj), k as i64 + i64::from(dk));
                    let inside = (0..i64::from(ny)).contains(&y) && (0..i64::from(nz)).contains(&z);
                    spread.copy_from_slice(if inside {
                        self.row(y as u32, z as u32)
                    } else {
                        &ghost
                    });
                    spread_row(&mut spread, m, nx, beyond);
                    row.iter_mut().zip(&spread).for_each(|(a, b)| *a |= b);
                }
                mask_row(row, nx);
            }
        });
        out
    }

    /// Sets every cell that is clear and clears every cell that is set.
    pub fn invert(&mut self) {
        let (nx, per_row) = (self.dims[0], self.row_words().max(1));
        self.words.par_chunks_mut(per_row).for_each(|row| {
            row.iter_mut().for_each(|w| *w = !*w);
            mask_row(row, nx);
        });
    }
}

/// The positions of the ones of a word, ascending.
pub(crate) fn ones(mut word: u64) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        let bit = word.trailing_zeros();
        word &= word.wrapping_sub(1);
        (bit < 64).then_some(bit)
    })
}

/// Sets the cells from `from` (inclusive) to `to` (exclusive) of a row.
pub(crate) fn set_run(row: &mut [u64], from: u32, to: u32) {
    let mut at = from;
    while at < to {
        let (word, bit) = ((at / 64) as usize, at % 64);
        let n = (64 - bit).min(to - at);
        row[word] |= (!0 >> (64 - n)) << bit;
        at += n;
    }
}

/// Clears what lies beyond the `nx` cells of a row.
fn mask_row(row: &mut [u64], nx: u32) {
    if let Some(last) = row.last_mut().filter(|_| !nx.is_multiple_of(64)) {
        *last &= !0 >> (64 - nx % 64);
    }
}

/// ORs a row with itself shifted by up to `m` cells both ways.
fn spread_row(row: &mut [u64], m: u32, nx: u32, beyond: bool) {
    for _ in 0..m {
        if let Some(last) = row.last_mut().filter(|_| beyond && !nx.is_multiple_of(64)) {
            *last |= !0 << (nx % 64);
        }
        let mut left = u64::from(beyond);
        for w in 0..row.len() {
            let right = row.get(w + 1).map_or(u64::from(beyond), |next| next & 1);
            let word = row[w];
            row[w] = word | word << 1 | left | word >> 1 | right << 63;
            left = word >> 63;
        }
    }
}
