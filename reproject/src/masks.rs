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
    /// What may hide something that the record did not see: farther layers must not fill it.
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

    /// Ends a layer: its bits become filled, and what its trails swept and nothing fills becomes unknown.
    pub fn end_layer(&mut self, layer_fill: &mut Rows, trail: &mut Rows) {
        for j in 0..self.n {
            self.fill[j] |= layer_fill[j];
            self.unknown[j] |= trail[j] & !self.fill[j];
            layer_fill[j] = 0;
            trail[j] = 0;
        }
    }

    /// Bits of row j that are closed to farther layers.
    #[inline]
    pub(crate) fn closed(&self, j: usize) -> u64 {
        self.fill[j] | self.unknown[j]
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn fill_trace_unknown_obey_set_algebra(fills in prop::collection::vec((any::<u64>(), any::<u64>()), 1..6), n in 1usize..=64) {
            let mut masks = Masks::new(n);
            let (mut filled, mut unknown) = (0u64, 0u64);
            for (fill, trail) in fills {
                let fill = fill & full_row(n) & !(filled | unknown);
                let trail = trail & full_row(n);
                let (mut layer, mut swept) = ([0; MAX_RESOLUTION], [0; MAX_RESOLUTION]);
                layer[0] = fill;
                swept[0] = trail;
                masks.end_layer(&mut layer, &mut swept);
                filled |= fill;
                unknown |= trail & !filled;
                prop_assert_eq!(layer[0] | swept[0], 0, "ready for the next layer");
            }
            prop_assert_eq!((masks.fill[0], masks.unknown[0]), (filled, unknown));
            prop_assert_eq!(masks.fill[0] & masks.unknown[0], 0, "disjoint");
            prop_assert_eq!(masks.holes(0) | masks.fill[0], full_row(n), "together all");
        }
    }
}
