//! Which element fills a texel: found when asked, for most results need no owner.

use std::ops::Range;

use radcache::MAX_RESOLUTION;

use super::board::{Board, KEPT, LOW, Special, Word, kind, word};

/// No element.
pub(crate) const NOBODY: u16 = u16::MAX;

impl<W: Word> Board<W> {
    /// The element that fills the texel in column `i` of row `j`: the first of its layer that covers it.
    pub(crate) fn owner(&self, i: usize, j: usize) -> Option<usize> {
        let bit = W::bit(i);
        let has = |rows: &[W]| rows[j] & bit != W::default();
        let layer = self.grid.history.iter().position(|filled| has(filled))?.checked_sub(1)?;
        let range = self.layer(layer);
        let covers = |e: &usize| {
            let row = j.wrapping_sub(usize::from(self.places.first[*e]));
            row < self.kept(*e) && self.row(*e, row) & bit != W::default()
        };
        let plain = range.clone().find(covers);
        let special =
            self.specials(&range).find(|special| has(&special.rows)).map(|special| usize::from(special.element));
        plain.into_iter().chain(special).min()
    }

    /// The owners of all texels, n x n.
    pub(crate) fn owners(&self, n: usize, owners: &mut Vec<u16>) {
        owners.clear();
        owners.resize(n * n, NOBODY);
        let Self { places, grid, .. } = self;
        for layer in 0..grid.layer_ends.len() {
            let range = self.layer(layer);
            // What the layer filled and no element before has taken.
            let mut rest = [W::default(); MAX_RESOLUTION + KEPT];
            for (j, rest) in rest[..n].iter_mut().enumerate() {
                *rest = grid.history[layer + 1][j] & !grid.history[layer][j];
            }
            let mut specials = self.specials(&range).peekable();
            for e in range.clone() {
                let number = u16::try_from(e).expect("at most 64 x 64 elements");
                let special = specials.next_if(|special| special.element == number);
                let (first, count) = special.map_or((usize::from(places.first[e]), self.kept(e)), |_| (0, n));
                for (j, rest) in (first..first + count).zip(&mut rest[first..]) {
                    let row = special.map_or_else(|| self.row(e, j - first), |special| special.rows[j]);
                    let take = row & *rest;
                    *rest &= !take;
                    let mut bits = take.widen();
                    while bits != 0 {
                        owners[j * n + bits.trailing_zeros() as usize] = number;
                        bits &= bits - 1;
                    }
                }
            }
        }
    }

    /// A row of an element, counted from its first.
    fn row(&self, e: usize, row: usize) -> W {
        W::unpack(word::<W>(&self.grid.drawn, e, row / W::ROWS), row % W::ROWS)
    }

    /// The number of rows that are kept of an element.
    fn kept(&self, e: usize) -> usize {
        match self.places.kind[e] {
            0 => LOW,
            kind::HIGH => KEPT,
            _ => 0,
        }
    }

    fn layer(&self, layer: usize) -> Range<usize> {
        let ends = &self.grid.layer_ends;
        let start = if layer == 0 { 0 } else { ends[layer - 1] };
        usize::from(start)..usize::from(ends[layer])
    }

    fn specials(&self, range: &Range<usize>) -> impl Iterator<Item = &Special<W>> {
        let special = &self.grid.special;
        let from = special.partition_point(|special| usize::from(special.element) < range.start);
        special[from..].iter().take_while(move |special| usize::from(special.element) < range.end)
    }
}
