//! Which nodes of the binary tree become wide nodes and which become packets, at the least expected cost of a ray.
//!
//! # Source
//! Ylitie, Karras, Laine 2017: Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs. We depart in
//! the cost of a leaf: its triangles are met at once, so that a packet of them costs the same however many of its lanes
//! are in use, and its free forms one after the other.

use std::ops::Range;

use arrayvec::ArrayVec;
use obvhs::bvh2::Bvh2;

use super::LANES;

/// Cost of meeting the boxes of a wide node, in units of that of meeting the triangles of a packet. From 0.2 to 1 rays
/// took the same time.
const NODE_COST: f32 = 0.5;

/// Cost of meeting a free form in a packet, in the same units.
const FORM_COST: f32 = 4.0;

/// What each node of a binary tree becomes.
pub(super) struct Plan<'a> {
    binary: &'a Bvh2,
    cuts: Vec<Cut>,
}

/// How the part of the tree below a binary node is cut into wide nodes and packets.
#[derive(Debug, Clone, Copy, Default)]
struct Cut {
    /// Whether it is a packet where it is a single tree, or a wide node...
    is_packet: bool,
    /// ... of whose children so many are to the left.
    children_left: u8,
    /// Where it is up to i + 2 trees, so many of them are to the left: 0 where one tree fewer costs the same.
    trees_left: [u8; LANES - 1],
}

/// What is below a binary node.
struct Part {
    /// Its expected cost as up to i + 1 trees, times the area of the scene's box.
    costs: [f32; LANES],
    primitives: usize,
    forms: usize,
}

impl<'a> Plan<'a> {
    /// Finds the cheapest cuts; `is_form` tells which of the primitives, by their places in the tree, are free forms.
    pub(super) fn new(binary: &'a Bvh2, is_form: impl Fn(usize) -> bool) -> Self {
        let mut plan = Self { binary, cuts: vec![Cut::default(); binary.nodes.len()] };
        plan.weigh(0, &is_form);
        plan
    }

    /// Decides upon the part of the tree below a node. Recursion goes as deep as the tree: at most `MAX_DEPTH`.
    #[expect(clippy::cast_possible_truncation, reason = "trees are at most LANES")]
    fn weigh(&mut self, node: usize, is_form: &impl Fn(usize) -> bool) -> Part {
        let area = self.binary.nodes[node].aabb().half_area();
        let packet = |forms: usize| area * (1.0 + FORM_COST * forms as f32);
        let Some([left, right]) = self.sides(node) else {
            self.cuts[node].is_packet = true;
            let places = self.places(node);
            let (primitives, forms) = (places.len(), places.filter(|&place| is_form(place)).count());
            return Part { costs: [packet(forms); LANES], primitives, forms };
        };
        let (left, right) = (self.weigh(left, is_form), self.weigh(right, is_form));
        let (primitives, forms) = (left.primitives + right.primitives, left.forms + right.forms);
        // The least cost as i + 2 trees, and how many of them are to the left.
        let shares: [(f32, u8); LANES - 1] = std::array::from_fn(|i| {
            let cost = |&k: &usize| left.costs[k] + right.costs[i - k];
            let k = (0..=i).min_by(|a, b| cost(a).total_cmp(&cost(b))).unwrap_or(0);
            (cost(&k), k as u8 + 1)
        });
        let (below, children_left) = shares[LANES - 2];
        let wide = NODE_COST * area + below;
        let is_packet = primitives <= LANES && packet(forms) <= wide;
        let mut costs = [if is_packet { packet(forms) } else { wide }; LANES];
        let mut trees_left = [0; LANES - 1];
        for (i, (cost, k)) in shares.into_iter().enumerate() {
            if cost < costs[i] {
                trees_left[i] = k;
            }
            costs[i + 1] = cost.min(costs[i]);
        }
        self.cuts[node] = Cut { is_packet, children_left, trees_left };
        Part { costs, primitives, forms }
    }

    /// Whether a binary node becomes a packet.
    pub(super) fn is_packet(&self, node: usize) -> bool {
        self.cuts[node].is_packet
    }

    /// Returns the binary nodes that become the children of the wide node in the place of this one.
    pub(super) fn children(&self, node: usize) -> ArrayVec<usize, LANES> {
        let mut children = ArrayVec::new();
        if self.is_packet(node) {
            children.push(node);
            return children;
        }
        // Nodes, and up to how many trees they become.
        let mut todo: ArrayVec<(usize, usize), LANES> =
            self.share(node, LANES, self.cuts[node].children_left).collect();
        while let Some((node, trees)) = todo.pop() {
            let left = &self.cuts[node].trees_left;
            match (2..=trees).rev().find(|trees| left[trees - 2] > 0) {
                Some(trees) => todo.extend(self.share(node, trees, left[trees - 2])),
                None => children.push(node),
            }
        }
        children
    }

    /// Returns the sides of a node, each with its share of so many trees.
    fn share(&self, node: usize, trees: usize, left: u8) -> impl Iterator<Item = (usize, usize)> + use<> {
        let left = usize::from(left);
        self.sides(node).into_iter().flatten().zip([left, trees - left])
    }

    /// Returns the places of the primitives below a binary node that becomes a packet.
    pub(super) fn primitives(&self, node: usize) -> ArrayVec<usize, LANES> {
        let mut places = ArrayVec::new();
        let mut todo = ArrayVec::<usize, LANES>::new();
        todo.push(node);
        while let Some(node) = todo.pop() {
            match self.sides(node) {
                Some(sides) => todo.extend(sides),
                None => places.extend(self.places(node)),
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

    /// Returns the places of a leaf's primitives.
    fn places(&self, leaf: usize) -> Range<usize> {
        let source = &self.binary.nodes[leaf];
        let first = source.first_index as usize;
        first..first + source.prim_count as usize
    }
}

#[cfg(test)]
mod tests {
    use glam::{Vec3, Vec3A};
    use obvhs::aabb::Aabb;

    use super::super::build::clustered;
    use super::*;
    use crate::bvh::tests::Random;

    fn places_below(plan: &Plan<'_>, node: usize) -> Vec<usize> {
        let below = |sides: [usize; 2]| sides.map(|side| places_below(plan, side)).concat();
        plan.sides(node).map_or_else(|| plan.places(node).collect(), below)
    }

    fn packet(plan: &Plan<'_>, node: usize, is_form: fn(usize) -> bool) -> f32 {
        let forms = places_below(plan, node).into_iter().filter(|&place| is_form(place)).count();
        plan.binary.nodes[node].aabb().half_area() * (1.0 + FORM_COST * forms as f32)
    }

    /// The least cost as at most so many trees, by trying all cuts.
    fn naive(plan: &Plan<'_>, node: usize, trees: usize, is_form: fn(usize) -> bool) -> f32 {
        let places = places_below(plan, node).len();
        let single = if places <= LANES { packet(plan, node, is_form) } else { f32::INFINITY };
        let Some([left, right]) = plan.sides(node) else { return single };
        let cut = |trees: usize| {
            let cost = |k| naive(plan, left, k, is_form) + naive(plan, right, trees - k, is_form);
            (1..trees).map(cost).fold(f32::INFINITY, f32::min)
        };
        let wide = NODE_COST * plan.binary.nodes[node].aabb().half_area() + cut(LANES);
        (2..=trees).map(cut).fold(single.min(wide), f32::min)
    }

    fn cost(plan: &Plan<'_>, node: usize, is_form: fn(usize) -> bool) -> f32 {
        if plan.is_packet(node) {
            return packet(plan, node, is_form);
        }
        let below: f32 = plan.children(node).into_iter().map(|child| cost(plan, child, is_form)).sum();
        NODE_COST * plan.binary.nodes[node].aabb().half_area() + below
    }

    fn primitives(plan: &Plan<'_>, node: usize) -> Vec<usize> {
        if plan.is_packet(node) {
            return plan.primitives(node).to_vec();
        }
        plan.children(node).into_iter().flat_map(|child| primitives(plan, child)).collect()
    }

    fn random_boxes(count: usize, random: &mut Random) -> Vec<Aabb> {
        let size =
            |random: &mut Random| random.vector() * random.vector() * if random.next() < 0.3 { 1.0 } else { 0.1 };
        (0..count)
            .map(|_| {
                let min = random.vector();
                Aabb { min: Vec3A::from(min), max: Vec3A::from(min + size(random) + Vec3::splat(1e-3)) }
            })
            .collect()
    }

    #[test]
    fn plans_are_the_cheapest() {
        let mut random = Random(9);
        for is_form in [|_| false, |place| place % 3 == 0] {
            for count in [1, 2, 3, 5, 8, 9, 10].repeat(6) {
                let binary = clustered(&random_boxes(count, &mut random));
                let plan = Plan::new(&binary, is_form);
                let (expected, found) = (naive(&plan, 0, 1, is_form), cost(&plan, 0, is_form));
                assert!((found - expected).abs() <= 1e-5 * expected, "{count} boxes: {found} is not {expected}");
            }
        }
    }

    #[test]
    fn each_primitive_is_in_one_packet() {
        let mut random = Random(2);
        for count in [1, 7, 8, 9, 64, 65, 1000] {
            let binary = clustered(&random_boxes(count, &mut random));
            let mut found = primitives(&Plan::new(&binary, |_| false), 0);
            found.sort_unstable();
            assert_eq!(found, Vec::from_iter(0..count), "{count} boxes");
        }
    }
}
