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
        BitGrid { dims, words: vec![0; BitGrid::words_for(dims) as usize] }
    }

    /// How many words of 8 bytes a grid takes.
    pub fn words_for([nx, ny, nz]: [u32; 3]) -> u64 {
        u64::from(nx.div_ceil(64)).saturating_mul(u64::from(ny)).saturating_mul(u64::from(nz))
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

    /// All words, to be filled. The last word of a row must keep its zeros.
    #[cfg(feature = "gpu")]
    pub(crate) fn words_mut(&mut self) -> &mut [u64] {
        &mut self.words
    }

    /// Takes all words anew.
    pub(crate) fn set_words(&mut self, words: impl Iterator<Item = u64>) {
        self.words.iter_mut().zip(words).for_each(|(word, new)| *word = new);
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
        let inside = [i, j, k].iter().zip(self.dims).all(|(c, n)| (0..i64::from(n)).contains(c));
        inside && self.row(j as u32, k as u32)[i as usize / 64] >> (i % 64) & 1 == 1
    }

    /// How many cells are set.
    pub fn count(&self) -> u64 {
        self.words.par_iter().map(|w| u64::from(w.count_ones())).sum()
    }

    /// The indices of all set cells, x fastest.
    pub fn iter(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        let [_, ny, _] = self.dims;
        let per_row = self.row_words();
        self.words.iter().enumerate().filter(|(_, w)| **w != 0).flat_map(move |(at, &word)| {
            let (row, first) = (at / per_row, (at % per_row) as u32 * 64);
            let (j, k) = (row as u32 % ny, row as u32 / ny);
            ones(word).map(move |bit| [first + bit, j, k])
        })
    }

    /// `self`, `other` -> op(self, other), word by word. Both of the same size.
    pub fn combine(&mut self, other: &BitGrid, op: impl Fn(u64, u64) -> u64 + Sync) {
        self.words.par_iter_mut().zip(&other.words).for_each(|(a, b)| *a = op(*a, *b));
    }

    /// The grid in which a cell is set if any cell at an offset in `reach` is set here. Row by row: `reach` lists,
    /// for each row offset (dj, dk), how far along x to look both ways. Cells beyond the grid count as `beyond`.
    pub fn dilated(&self, reach: &[(i32, i32, u32)], beyond: bool) -> BitGrid {
        let [nx, ny, nz] = self.dims;
        let mut out = BitGrid::new(self.dims);
        let per_row = self.row_words();
        out.par_slices().for_each(|(k, slice)| {
            for (j, row) in slice.chunks_mut(per_row).enumerate() {
                let place = |&(dj, dk, m): &(i32, i32, u32)| {
                    let (y, z) = (j as i64 + i64::from(dj), k as i64 + i64::from(dk));
                    let inside = (0..i64::from(ny)).contains(&y) && (0..i64::from(nz)).contains(&z);
                    inside.then_some((y as u32, z as u32, m))
                };
                if beyond && reach.iter().any(|r| place(r).is_none()) {
                    set_run(row, 0, nx);
                    continue;
                }
                for (y, z, m) in reach.iter().filter_map(place) {
                    for (from, to) in runs(self.row(y, z), nx) {
                        set_run(row, from.saturating_sub(m), to.saturating_add(m).min(nx));
                    }
                    if beyond {
                        set_run(row, 0, m.min(nx));
                        set_run(row, nx.saturating_sub(m), nx);
                    }
                }
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

/// The maximal runs of set cells of a row of `nx` cells: first (inclusive) and last (exclusive).
fn runs(row: &[u64], nx: u32) -> impl Iterator<Item = (u32, u32)> + '_ {
    // The first cell at or after `at` that is set, or clear.
    let next = move |at: u32, set: bool| {
        let word = |w: usize| if set { row[w] } else { !row[w] };
        let mut w = (at / 64) as usize;
        let mut here = word(w) & (!0 << (at % 64));
        while here == 0 && w + 1 < row.len() {
            w += 1;
            here = word(w);
        }
        (w as u32 * 64 + here.trailing_zeros()).min(nx)
    };
    let mut at = 0;
    std::iter::from_fn(move || {
        let from = if at < nx { next(at, true) } else { nx };
        at = if from < nx { next(from, false) } else { nx };
        (from < nx).then_some((from, at))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dilation_reaches_as_far_as_asked() {
        let mut grid = BitGrid::new([200, 3, 3]);
        let seeds = [(0u32, 1u32), (63, 1), (64, 1), (130, 1), (199, 1)];
        for (i, j) in seeds {
            let start = grid.slice_words() + grid.row_words() * j as usize;
            set_run(&mut grid.words[start..], i, i + 1);
        }
        for m in [0, 1, 5, 64, 70] {
            let wide = grid.dilated(&[(0, 0, m), (1, 0, 0)], false);
            for i in 0..200i64 {
                let near = |far: u32| seeds.iter().any(|s| (i - i64::from(s.0)).abs() <= i64::from(far));
                assert_eq!(wide.get(i, 1, 1), near(m), "{i} within {m}");
                assert_eq!(wide.get(i, 0, 1), near(0), "{i} in the row below");
                assert!(!wide.get(i, 2, 1) && !wide.get(i, 1, 0));
            }
            let rimmed = BitGrid::new([200, 3, 3]).dilated(&[(0, 0, m)], true);
            assert_eq!(rimmed.count(), u64::from((2 * m).min(200)) * 9);
        }
        let mut inverse = grid.clone();
        inverse.invert();
        assert_eq!(inverse.count() + grid.count(), 200 * 9);
    }
}
