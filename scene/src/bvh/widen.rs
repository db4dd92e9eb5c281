//! Which nodes of the binary tree become wide nodes and which become packets, at the least expected cost of a ray.
//!
//! # Source
//! Ylitie, Karras, Laine 2017: Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs, section 3.1. We depart in the cost of a leaf:
//! a packet costs the same however many of its lanes are in use.

use obvhs::bvh2::Bvh2;

use super::LANES;

/// Cost of meeting the boxes of a wide node, in units of that of meeting a packet. From 0.2 to 1 rays took the same time.
const NODE_COST: f32 = 0.5;

/// What each node of a binary tree becomes.
pub(super) struct Plan<'a> {
    binary: &'a Bvh2,
    choices: Vec<Choice>,
}

/// What becomes of the part of the tree below a binary node.
#[derive(Clone, Copy, Default)]
struct Choice {
    /// As a single tree: a packet or a wide node.
    is_packet: bool,
    /// As up to i + 1 trees: how many of them are to its left, or 0 where one tree fewer costs the same. For i = 0, how many of the
    /// children of its wide node are.
    left: [u8; LANES],
}

/// The cost of a part of the tree.
struct Part {
    /// As up to i + 1 trees: the expected cost times the area of a box.
    costs: [f32; LANES],
    primitives: usize,
}

impl<'a> Plan<'a> {
    pub(super) fn new(binary: &'a Bvh2) -> Self {
        let mut plan = Self { binary, choices: vec![Choice::default(); binary.nodes.len()] };
        plan.weigh(0);
        plan
    }

    /// Decides upon the part of the tree below a node. Recursion goes as deep as the tree, whose depth is limited.
    #[expect(clippy::cast_possible_truncation, reason = "trees are at most LANES")]
    fn weigh(&mut self, node: usize) -> Part {
        let source = &self.binary.nodes[node];
        let area = source.aabb().half_area();
        let Some([left, right]) = self.sides(node) else {
            self.choices[node].is_packet = true;
            return Part { costs: [area; LANES], primitives: source.prim_count as usize };
        };
        let (left, right) = (self.weigh(left), self.weigh(right));
        // The least cost as two to LANES trees, and how many of them are to the left.
        let share = |trees: usize| {
            let cost = |&k: &usize| left.costs[k - 1] + right.costs[trees - k - 1];
            let k = (1..trees).min_by(|i, j| cost(i).total_cmp(&cost(j))).unwrap_or(1);
            (cost(&k), k as u8)
        };
        let primitives = left.primitives + right.primitives;
        let (below, k) = share(LANES);
        let wide = NODE_COST * area + below;
        let is_packet = primitives <= LANES && area <= wide;
        let mut choice = Choice { is_packet, left: [0; LANES] };
        choice.left[0] = k;
        let mut costs = [if is_packet { area } else { wide }; LANES];
        for i in 1..LANES {
            let (cost, k) = share(i + 1);
            if cost < costs[i - 1] {
                choice.left[i] = k;
            }
            costs[i] = cost.min(costs[i - 1]);
        }
        self.choices[node] = choice;
        Part { costs, primitives }
    }

    /// Whether a binary node becomes a packet.
    pub(super) fn is_packet(&self, node: usize) -> bool {
        self.choices[node].is_packet
    }

    /// Returns the binary nodes that become the children of the wide node in the place of this one.
    pub(super) fn children(&self, node: usize) -> Vec<usize> {
        let mut children = Vec::with_capacity(LANES);
        if self.is_packet(node) {
            children.push(node);
            return children;
        }
        // Nodes, and up to how many trees they become.
        let mut todo = self.shares(node, LANES, self.choices[node].left[0]);
        while let Some((node, trees)) = todo.pop() {
            match (1..trees).rev().find(|&i| self.choices[node].left[i] > 0) {
                Some(i) => todo.extend(self.shares(node, i + 1, self.choices[node].left[i])),
                None => children.push(node),
            }
        }
        children
    }

    /// Returns the sides of a node, each with its share of so many trees.
    fn shares(&self, node: usize, trees: usize, left: u8) -> Vec<(usize, usize)> {
        let left = usize::from(left);
        self.sides(node).into_iter().flatten().zip([left, trees - left]).collect()
    }

    /// Returns the places of the primitives below a binary node.
    pub(super) fn primitives(&self, node: usize) -> Vec<usize> {
        let mut places = Vec::with_capacity(LANES);
        let mut todo = vec![node];
        while let Some(node) = todo.pop() {
            let source = &self.binary.nodes[node];
            match self.sides(node) {
                Some(sides) => todo.extend(sides),
                None => places.extend((source.first_index as usize..).take(source.prim_count as usize)),
            }
        }
        places
    }

    /// Returns the two nodes below one, if it is not a leaf.
    fn sides(&self, node: usize) -> Option<[usize; 2]> {
        let source = &self.binary.nodes[node];
        let first = source.first_index as usize;
        (!source.is_leaf()).then_some([first, first + 1])
    }
}
