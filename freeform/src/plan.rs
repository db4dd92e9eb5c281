//! What rays need to know of a tree of solids: its units, how their sides make the side of the whole, and where each of
//! them matters.
//!
//! A unit is a free form, or a subtree under a blend, which has no meaning as a set operation. Along a ray each unit is
//! a set of intervals, found by itself; all other operations are those of sets. A node counts those of its parts that
//! the ray is in, and is inside or not by that count alone.
//!
//! A unit matters in the box of its inside, and there only where no operation above it is decided by another part: what
//! is taken away matters in the box of what it is taken from.

use std::sync::OnceLock;

use crate::{
    FreeForm, Operation,
    bounds::Extent,
    boxes::Boxes,
    cells::Cells,
    tree::{self, Join, Place, Token},
};

/// The count of a difference whose first part the ray is in, and no other.
const FIRST: i64 = 1 << 32;

/// A free form or a blend of several.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Unit {
    /// Where its subtree begins.
    pub(crate) place: Place,
    /// The place of its cells, if it is a blend.
    cells: Option<u32>,
    /// Whether the whole is inside where the unit is not: under an odd number of complements.
    pub(crate) flipped: bool,
    /// The operation that it is a part of, if any, and what it adds to the count of that.
    pub(crate) parent: Option<u32>,
    pub(crate) share: i64,
}

/// A set operation.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Node {
    rule: Rule,
    pub(crate) parent: Option<u32>,
    pub(crate) share: i64,
}

/// When a node is inside, by the count of its parts.
#[derive(Debug, Clone, Copy)]
enum Rule {
    Least(i64),
    Just(i64),
}

impl Node {
    pub(crate) fn is_inside(&self, count: i64) -> bool {
        match self.rule {
            Rule::Least(least) => count >= least,
            Rule::Just(just) => count == just,
        }
    }
}

/// See the head of the file.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    pub(crate) units: Vec<Unit>,
    pub(crate) nodes: Vec<Node>,
    /// Counts of the nodes where the ray is in no unit.
    pub(crate) rest: Vec<i64>,
    /// Whether all is one union of units.
    pub(crate) is_union: bool,
    /// Where each unit matters.
    pub(crate) boxes: Boxes,
    /// Where each blend has its surface; found when the first ray asks, for most trees are parts of others before.
    cells: Vec<OnceLock<Cells>>,
}

/// What is handed down to a part.
#[derive(Clone, Copy)]
struct Context {
    parent: Option<u32>,
    share: i64,
    flipped: bool,
    extent: Extent,
}

impl Plan {
    pub(crate) fn new(tokens: &[Token], forms: &[FreeForm]) -> Self {
        let mut plan = Self {
            units: Vec::new(),
            nodes: Vec::new(),
            rest: Vec::new(),
            is_union: false,
            boxes: Boxes::default(),
            cells: Vec::new(),
        };
        let mut extents = Vec::new();
        let top = Context { parent: None, share: 1, flipped: false, extent: Extent::ALL };
        plan.add(tokens, forms, &mut Place::default(), top, &mut extents);
        plan.is_union = plan.nodes.len() == 1 && matches!(plan.nodes[0].rule, Rule::Least(1));
        plan.boxes = Boxes::new(extents);
        // Parts stand behind what they are parts of.
        plan.rest = vec![0; plan.nodes.len()];
        for index in (0..plan.nodes.len()).rev() {
            let node = plan.nodes[index];
            if let Some(parent) = node.parent.filter(|_| node.is_inside(plan.rest[index])) {
                plan.rest[parent as usize] += node.share;
            }
        }
        plan
    }

    /// Whether the whole is inside where the ray is in no unit.
    pub(crate) fn rests_inside(&self) -> bool {
        self.nodes.first().is_some_and(|top| top.is_inside(self.rest[0]))
    }

    /// Returns the cells of a blend, given all tokens and forms of the solid.
    pub(crate) fn cells(&self, unit: u32, tokens: &[Token], forms: &[FreeForm]) -> Option<&Cells> {
        let Unit { place, cells, .. } = self.units[unit as usize];
        let cut = || {
            let end = place.after(tokens);
            Cells::new(&tokens[place.token..end.token], &forms[place.form..end.form], self.boxes.extent(unit))
        };
        cells.map(|cells| self.cells[cells as usize].get_or_init(cut))
    }

    /// Returns the memory held, bytes. Cells that no ray has asked for are not there: cutting them only to weigh them
    /// would take both time and that memory.
    pub(crate) fn memory_bytes(&self) -> usize {
        size_of_val(&self.units[..])
            + size_of_val(&self.nodes[..])
            + size_of_val(&self.rest[..])
            + self.boxes.memory_bytes()
            + size_of_val(&self.cells[..])
            + self.cells.iter().filter_map(OnceLock::get).map(Cells::heap_bytes).sum::<usize>()
    }

    /// Adds the subtree at `place`, which is left behind it.
    fn add(
        &mut self,
        tokens: &[Token],
        forms: &[FreeForm],
        place: &mut Place,
        context: Context,
        extents: &mut Vec<Extent>,
    ) {
        let start = *place;
        let whole = |mut place: Place| tree::extent(tokens, forms, &mut place, 0.0);
        let Context { parent, share, flipped, extent } = context;
        let Join { operation, parts, .. } = match tokens[start.token] {
            Token::Join(join) if !join.psi.blends() => join,
            token => {
                let extent = extent.intersection(&whole(start));
                *place = start.after(tokens);
                let cells = (token != Token::Form).then(|| {
                    self.cells.push(OnceLock::new());
                    u32::try_from(self.cells.len() - 1).expect("tokens are numbered in 32 bits")
                });
                extents.push(extent);
                self.units.push(Unit { place: start, cells, flipped, parent, share });
                return;
            }
        };
        place.next(tokens);
        let rule = match operation {
            Operation::Union => Rule::Least(1),
            Operation::Intersection => Rule::Just(i64::from(parts)),
            Operation::Difference => Rule::Just(FIRST),
            Operation::Complement => Rule::Just(0),
        };
        // A union in a union is the same union: its parts count where it would.
        let merged = parent.filter(|&parent| {
            operation == Operation::Union && share == 1 && matches!(self.nodes[parent as usize].rule, Rule::Least(1))
        });
        let node = merged.unwrap_or_else(|| {
            self.nodes.push(Node { rule, parent, share });
            u32::try_from(self.nodes.len() - 1).expect("tokens are numbered in 32 bits")
        });
        let inner = match operation {
            // Outside of the box of the whole, parts decide nothing.
            Operation::Intersection | Operation::Difference => extent.intersection(&whole(start)),
            Operation::Union | Operation::Complement => extent,
        };
        for index in 0..parts {
            let taken = operation == Operation::Complement || (operation == Operation::Difference && index > 0);
            let share = if operation == Operation::Difference && index == 0 { FIRST } else { 1 };
            let context = Context { parent: Some(node), share, flipped: flipped != taken, extent: inner };
            self.add(tokens, forms, place, context, extents);
        }
    }
}
