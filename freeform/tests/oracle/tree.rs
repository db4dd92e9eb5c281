//! Trees of set operations as a test knows them.

use freeform::{FreeForm, Operation, Psi, Solid};

/// A tree over numbered forms; one form may stand in several places.
#[derive(Debug)]
pub(crate) enum RawTree {
    Leaf(usize),
    Node(Operation, Psi, Vec<Self>),
}

impl RawTree {
    /// Returns a tree over the first `forms` forms: `below(n)` is a random number less than n, `psi` a random psi.
    pub(crate) fn random(
        forms: usize,
        depth: usize,
        below: &mut impl FnMut(usize) -> usize,
        psi: &mut impl FnMut() -> Psi,
    ) -> Self {
        if depth == 0 || below(4) == 0 {
            return Self::Leaf(below(forms));
        }
        let operation =
            [Operation::Union, Operation::Intersection, Operation::Difference, Operation::Complement][below(4)];
        let parts = if operation == Operation::Complement { 1 } else { 2 + below(2) };
        let of_node = psi();
        Self::Node(operation, of_node, (0..parts).map(|_| Self::random(forms, depth - 1, below, psi)).collect())
    }

    /// Returns the tree as the crate has it.
    pub(crate) fn solid(&self, forms: &[FreeForm]) -> Solid {
        match self {
            Self::Leaf(form) => forms[*form].clone().into(),
            Self::Node(operation, psi, parts) => {
                let parts = parts.iter().map(|part| part.solid(forms)).collect();
                Solid::join(*operation, *psi, parts).expect("sound")
            }
        }
    }

    /// Returns whether a point is inside, of which is known in which forms it is; nothing for blends.
    pub(crate) fn holds(&self, inside: &[bool]) -> bool {
        let (operation, parts) = match self {
            Self::Leaf(form) => return inside[*form],
            Self::Node(operation, _, parts) => (operation, parts),
        };
        let mut parts = parts.iter().map(|part| part.holds(inside));
        match operation {
            Operation::Union => parts.any(|part| part),
            Operation::Intersection => parts.all(|part| part),
            Operation::Difference => parts.next() == Some(true) && !parts.any(|part| part),
            Operation::Complement => parts.next() == Some(false),
        }
    }
}
