//! A tree of solids in ranges of values, where parts that say nothing are left out.
//!
//! Where one function is above another by the width of the blend, the union is the first, to the last digit, and the
//! other is silent: it is not asked again within that stretch of a ray, or that part of space.

use crate::{
    Operation, Psi,
    psi::{Slope, Valued},
    range::{Range, RangeSlope},
    tree::{Join, Token},
};

/// What a blend is evaluated in, if it can tell that one function is above another all along.
pub(crate) trait Compared: Valued {
    /// Whether the union of the two is `self`, whatever the other.
    fn hides(&self, psi: Psi, other: &Self) -> bool;
}

impl Compared for Range {
    fn hides(&self, psi: Psi, other: &Self) -> bool {
        let gap = match psi {
            Psi::Maximum => 0.0,
            Psi::Blend { width } => width,
            // It adds something of both everywhere.
            Psi::RFunction => return false,
        };
        self.lo >= (other.hi + gap).next_up()
    }
}

impl Compared for RangeSlope {
    fn hides(&self, psi: Psi, other: &Self) -> bool {
        self.value.hides(psi, &other.value)
    }
}

impl Compared for Slope {
    fn hides(&self, _: Psi, _: &Self) -> bool {
        false
    }
}

/// Tokens whose subtrees say nothing on a stretch and on all parts of it: a stack of bit sets, one for each stretch
/// that is open.
#[derive(Debug, Clone)]
pub(crate) struct Silent {
    words: Vec<u64>,
    /// Words of one set.
    size: usize,
}

impl Silent {
    pub(crate) fn none(tokens: usize) -> Self {
        let size = tokens.div_ceil(64);
        Self { words: vec![0; size], size }
    }

    /// Starts anew from one set.
    pub(crate) fn reset(&mut self, set: &[u64]) {
        self.words.clear();
        self.words.extend_from_slice(set);
    }

    /// Returns the set of the stretch at hand.
    pub(crate) fn top(&self) -> &[u64] {
        &self.words[self.words.len() - self.size..]
    }

    /// Opens a part of the stretch.
    pub(crate) fn push(&mut self) {
        self.words.extend_from_within(self.words.len() - self.size..);
    }

    pub(crate) fn pop(&mut self) {
        self.words.truncate(self.words.len() - self.size);
    }

    pub(crate) fn holds(&self, token: usize) -> bool {
        self.top()[token / 64] >> (token % 64) & 1 == 1
    }

    pub(crate) fn add(&mut self, token: usize) {
        let top = self.words.len() - self.size;
        self.words[top + token / 64] |= 1 << (token % 64);
    }
}

/// One look at the function; it calls itself once a level.
pub(crate) struct Evaluation<'a, F> {
    pub(crate) tokens: &'a [Token],
    pub(crate) silent: &'a mut Silent,
    /// Whether silent parts are noted.
    pub(crate) marks: bool,
    /// Gives the value of the form at a token.
    pub(crate) leaf: F,
}

impl<F> Evaluation<'_, F> {
    /// Returns the value of the whole, which is never silent.
    pub(crate) fn whole<V: Compared>(mut self) -> V
    where
        F: Fn(usize) -> V,
    {
        self.subtree(&mut 0).expect("the whole is never silent")
    }

    /// Returns the value of the subtree at `token`, which is left behind it; `None` where that is silent.
    #[inline(always)]
    fn subtree<V: Compared>(&mut self, token: &mut usize) -> Option<V>
    where
        F: Fn(usize) -> V,
    {
        let start = *token;
        let is_silent = self.silent.holds(start);
        match self.tokens[start] {
            Token::Form => {
                *token += 1;
                (!is_silent).then(|| (self.leaf)(start))
            }
            Token::Join(join) if is_silent => {
                *token += 1 + join.length as usize;
                None
            }
            Token::Join(join) => self.join(join, token),
        }
    }

    /// Returns the value of the operation at `token`, which is left behind it; `None` where all parts are silent.
    fn join<V: Compared>(&mut self, Join { operation, psi, parts, .. }: Join, token: &mut usize) -> Option<V>
    where
        F: Fn(usize) -> V,
    {
        let start = *token;
        *token += 1;
        // Every operation but the union is the complement of a union of parts or of their complements.
        let mut sum: Option<V> = None;
        for index in 0..parts {
            let part_start = *token;
            let Some(part) = self.subtree::<V>(token) else { continue };
            let flips = match operation {
                Operation::Union | Operation::Complement => false,
                Operation::Difference => index == 0,
                Operation::Intersection => true,
            };
            let part = if flips { part.complement() } else { part };
            sum = Some(match sum {
                None => part,
                Some(sum) if sum.hides(psi, &part) => {
                    if self.marks {
                        self.silent.add(part_start);
                    }
                    sum
                }
                Some(sum) if part.hides(psi, &sum) => {
                    if self.marks {
                        (start + 1..part_start).for_each(|token| self.silent.add(token));
                    }
                    part
                }
                Some(sum) => V::union(psi, sum, part),
            });
        }
        sum.map(|sum| if operation == Operation::Union { sum } else { sum.complement() })
    }
}
