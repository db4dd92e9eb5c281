//! How a solid is put together: set operations over free forms, written one after the other.
//!
//! The list is in prefix order, each operation before its parts, and an operation knows how many tokens it spans. So
//! trees are joined by appending lists, and subtrees are slices.

use crate::{
    DEPTH_LIMIT, FormError, FreeForm, Psi,
    bounds::Extent,
    psi::Valued,
    slabs::{self, Slab},
};

/// A set operation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Operation {
    /// What is in any part.
    Union,
    /// What is in all parts.
    Intersection,
    /// What is in the first part and in no other.
    Difference,
    /// What is not in the one part.
    Complement,
}

impl Operation {
    /// Returns the name of the operation in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Union => "union",
            Self::Intersection => "intersection",
            Self::Difference => "difference",
            Self::Complement => "complement",
        }
    }
}

/// An operation or a leaf of a tree in prefix order; the leaves are the forms in their order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Token {
    Form,
    Join(Join),
}

/// An operation in a tree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Join {
    pub(crate) operation: Operation,
    pub(crate) psi: Psi,
    /// Number of parts.
    pub(crate) parts: u32,
    /// Tokens of all parts together.
    pub(crate) length: u32,
}

/// A place in a tree: the next token, and the next form.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Place {
    pub(crate) token: usize,
    pub(crate) form: usize,
}

impl Place {
    /// Returns the token here and steps over it.
    pub(crate) fn next(&mut self, tokens: &[Token]) -> Token {
        let token = tokens[self.token];
        self.token += 1;
        self.form += usize::from(token == Token::Form);
        token
    }

    /// Returns the place behind the subtree that begins here.
    pub(crate) fn after(self, tokens: &[Token]) -> Self {
        let length = match tokens[self.token] {
            Token::Form => 1,
            Token::Join(join) => 1 + join.length as usize,
        };
        let end = self.token + length;
        let forms = tokens[self.token..end].iter().filter(|token| **token == Token::Form).count();
        Self { token: end, form: self.form + forms }
    }
}

/// Returns where the forms stand among the tokens, in their order.
pub(crate) fn form_tokens(tokens: &[Token]) -> impl Iterator<Item = usize> {
    tokens.iter().enumerate().filter(|(_, token)| **token == Token::Form).map(|(token, _)| token)
}

/// Checks an operation on `counts.len()` parts of so many tokens each.
pub(crate) fn join(operation: Operation, psi: Psi, counts: impl Iterator<Item = usize>) -> Result<Join, FormError> {
    let psi = psi.checked()?;
    let (mut parts, mut length) = (0_u32, 0_usize);
    for count in counts {
        parts += 1;
        length += count;
    }
    if parts == 0 {
        return Err(FormError::Empty(operation.name()));
    }
    Ok(Join { operation, psi, parts, length: u32::try_from(length).map_err(|_| FormError::TooMany)? })
}

/// Evaluates the subtree at `place`, which is left behind it; `leaf` gives the value of form k.
///
/// It calls itself once a level: trees are at most [`DEPTH_LIMIT`] deep.
pub(crate) fn evaluate<V: Valued>(tokens: &[Token], place: &mut Place, leaf: &mut impl FnMut(usize) -> V) -> V {
    let form = place.form;
    match place.next(tokens) {
        Token::Form => leaf(form),
        Token::Join(Join { operation, psi, parts, .. }) => {
            let first = evaluate(tokens, place, leaf);
            if operation == Operation::Complement {
                return first.complement();
            }
            (1..parts).fold(first, |sum, _| {
                let part = evaluate(tokens, place, leaf);
                match operation {
                    Operation::Union => V::union(psi, sum, part),
                    Operation::Difference => V::union(psi, sum.complement(), part).complement(),
                    Operation::Intersection | Operation::Complement => {
                        V::union(psi, sum.complement(), part.complement()).complement()
                    }
                }
            })
        }
    }
}

/// Returns a box around the places of the subtree at `place` where its function is `-depth` or more.
pub(crate) fn extent(tokens: &[Token], forms: &[FreeForm], place: &mut Place, depth: f64) -> Extent {
    let (start, form) = (*place, place.form);
    match place.next(tokens) {
        Token::Form => forms[form].extent_at(depth),
        Token::Join(Join { operation, psi, parts, .. }) => {
            let below = if operation == Operation::Union { psi.depth_below(depth, parts as usize) } else { depth };
            let first = extent(tokens, forms, place, below);
            match operation {
                Operation::Union => (1..parts).fold(first, |sum, _| sum.union(&extent(tokens, forms, place, below))),
                // The intersection by any psi is nowhere more than its least part.
                Operation::Intersection => {
                    let each = (1..parts).fold(first, |sum, _| sum.intersection(&extent(tokens, forms, place, below)));
                    let mut slabs = Vec::new();
                    let mut again = start;
                    find_slabs(tokens, forms, &mut again, depth, &mut slabs);
                    each.intersection(&slabs::extent(&slabs))
                }
                Operation::Difference => {
                    (1..parts).for_each(|_| *place = place.after(tokens));
                    first
                }
                Operation::Complement => Extent::ALL,
            }
        }
    }
}

/// Slabs that one intersection is looked through for at most: all triples of them are tried.
const SLABS_MAX: usize = 12;

/// Finds slabs in which all of the subtree at `place` lies where its function is `-depth` or more: forms that are parts
/// of intersections alone.
fn find_slabs(tokens: &[Token], forms: &[FreeForm], place: &mut Place, depth: f64, slabs: &mut Vec<Slab>) {
    let (start, form) = (*place, place.form);
    match place.next(tokens) {
        Token::Form if slabs.len() < SLABS_MAX => slabs.extend(Slab::of_form(&forms[form], depth)),
        Token::Join(Join { operation: Operation::Intersection, parts, .. }) => {
            (0..parts).for_each(|_| find_slabs(tokens, forms, place, depth, slabs));
        }
        Token::Form | Token::Join(_) => *place = start.after(tokens),
    }
}

/// Returns how many operations are inside each other.
pub(crate) fn depth(tokens: &[Token]) -> usize {
    // Ends of the operations that are open.
    let mut open = [0_usize; DEPTH_LIMIT + 1];
    let (mut now, mut most) = (0, 0);
    for (index, token) in tokens.iter().enumerate() {
        while now > 0 && open[now - 1] <= index {
            now -= 1;
        }
        if let Token::Join(join) = token {
            if now > DEPTH_LIMIT {
                return now;
            }
            open[now] = index + 1 + join.length as usize;
            now += 1;
            most = most.max(now);
        }
    }
    most
}
