//! Bit masks over the square: n rows of one machine word each.
//!
//! Bit i of row j stands for the texel with its centre at ((i + 1/2)/n, (j + 1/2)/n).

use radcache::MAX_RESOLUTION;

/// Rows of bits, row j in word j; bits and rows from n on are zero.
pub type Rows = [u64; MAX_RESOLUTION];

/// The masks of a reprojection.
#[derive(Debug, Clone)]
pub struct Masks {
    n: usize,
    /// What elements have filled.
    pub fill: Rows,
    /// What may hide something that the record did not see: its own layer and farther ones must not fill it.
    pub unknown: Rows,
}

impl Masks {
    /// Empty masks of n rows of n bits.
    ///
    /// # Panics
    /// If n is 0 or above [`MAX_RESOLUTION`].
    #[must_use]
    pub fn new(n: usize) -> Self {
        assert!((1..=MAX_RESOLUTION).contains(&n), "resolution must lie in 1..=64");
        Self { n, fill: [0; MAX_RESOLUTION], unknown: [0; MAX_RESOLUTION] }
    }

    /// Empties them and sets the number of rows.
    ///
    /// # Panics
    /// As [`Self::new`].
    pub fn reset(&mut self, n: usize) {
        *self = Self::new(n);
    }

    /// Bits of row j that nothing fills: unknown ones and gaps.
    #[must_use]
    pub fn holes(&self, j: usize) -> u64 {
        full_row(self.n) & !self.fill[j]
    }

    /// Number of bits set in the first n rows.
    #[must_use]
    pub fn count(&self, rows: &Rows) -> u32 {
        rows[..self.n].iter().map(|row| row.count_ones()).sum()
    }
}

/// A row with its first n bits set.
pub(crate) fn full_row(n: usize) -> u64 {
    u64::MAX >> (MAX_RESOLUTION - n)
}
