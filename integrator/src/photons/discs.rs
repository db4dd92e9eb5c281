//! Photons' discs, and the tree over them: how far each photon spreads its flux.
//!
//! Discs are sorted by medians of their centers into leaves of a few, and those into a tree of boxes. While the boxes
//! hold the centers alone, the tree finds the k-th photon next to some of them, which tells the radii around; then its
//! boxes grow to hold the discs.

use std::ops::Range;

use glam::{Vec3, Vec3A};

use super::shoot::Photons;

/// The limit of a disc's radius, in medians: most photons are in a focus, and those far from it must not become specks.
const RADIUS_LIMIT: f32 = 64.0;
/// A search keeps at most so many times the neighbours that it is for, and a leaf.
const MANY: usize = 3;
/// Discs in a leaf of the tree.
pub(super) const LEAF: usize = 8;

/// A photon and the disc over which it spreads its flux.
#[derive(Debug, Clone, Copy)]
pub(super) struct Disc {
    pub(super) center: Vec3A,
    pub(super) normal: Vec3A,
    /// W.
    pub(super) flux: Vec3,
    /// Metres.
    pub(super) radius: f32,
}

/// A box around discs. A node's first child follows it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Node {
    pub(super) min: Vec3,
    pub(super) max: Vec3,
    /// Nodes of this subtree: where to go on if the box does not hold the point.
    pub(super) size: u32,
    /// Number of the first leaf in it.
    pub(super) leaf: u32,
}

/// Discs in the order of the leaves, each of which is full but the last, and the tree over them.
pub(super) struct Tree {
    pub(super) discs: Vec<Disc>,
    pub(super) nodes: Vec<Node>,
}

impl Tree {
    /// Builds the tree of discs of about `neighbours` photons each within `max_radius`, or within a limit taken from
    /// the photons' density. `None` where there is no photon.
    pub(super) fn new(photons: &Photons, neighbours: u32, max_radius: Option<f32>) -> Option<Self> {
        if photons.len() == 0 {
            return None;
        }
        let disc = |i: usize| Disc {
            center: photons.positions[i].into(),
            normal: photons.normals[i],
            flux: photons.flux[i],
            radius: 0.0,
        };
        let mut discs: Vec<Disc> = (0..photons.len()).map(disc).collect();
        sort(&mut discs);
        let leaves = discs.len().div_ceil(LEAF);
        let nodes = vec![Node { min: Vec3::ZERO, max: Vec3::ZERO, size: 0, leaf: 0 }; 2 * leaves - 1];
        let mut tree = Self { discs, nodes };
        bound(&tree.discs, &mut tree.nodes, 0);
        tree.measure(neighbours.max(2) as usize, max_radius);
        bound(&tree.discs, &mut tree.nodes, 0);
        Some(tree)
    }

    /// Gives discs their radii, while boxes hold their centers alone.
    fn measure(&mut self, neighbours: usize, max_radius: Option<f32>) {
        let mut radii = vec![0.0; self.discs.len()];
        let all = 0..self.discs.len();
        self.measure_near(&mut radii, all.clone(), all, neighbours);
        // Where there are not as many photons, they fill what they may.
        if self.discs.len() <= neighbours
            && let Some(limit) = max_radius
        {
            radii.fill(limit);
        }
        let limit = max_radius.unwrap_or_else(|| {
            let middle = radii.len() / 2;
            RADIUS_LIMIT * *radii.clone().select_nth_unstable_by(middle, f32::total_cmp).1
        });
        for (disc, radius) in self.discs.iter_mut().zip(radii) {
            disc.radius = radius.min(limit);
        }
    }

    /// Sets the radii of a subtree's discs, by one search for each few of them: as good as one for each photon, in a
    /// third of the time or less. Of the subtrees around it that hold enough neighbours, `around` is the smallest.
    fn measure_near(&self, radii: &mut [f32], range: Range<usize>, around: Range<usize>, neighbours: usize) {
        // The photon itself is the first that is found.
        let around = if range.len() > neighbours { range.clone() } else { around };
        // More leaves to a search for more neighbours, so that the work hardly grows with their number.
        if let Some(middle) = middle(range.len())
            && range.len() > neighbours / 10
        {
            let (left, right) = radii.split_at_mut(middle);
            let middle = range.start + middle;
            rayon::join(
                || self.measure_near(left, range.start..middle, around.clone(), neighbours),
                || self.measure_near(right, middle..range.end, around.clone(), neighbours),
            );
            return;
        }
        let pilot = self.discs[range.start + range.len() / 2].center;
        let radius = self.distance_of(pilot, neighbours, around);
        for (out, disc) in radii.iter_mut().zip(&self.discs[range]) {
            // Photons beside a focus that holds the pilot are spread as far as they are from it.
            *out = radius.max(disc.center.distance(pilot) - radius);
        }
    }

    /// Returns the distance from `p` of neighbour number `neighbours`, counted from 0, which is no farther than that of
    /// those `around` it.
    fn distance_of(&self, p: Vec3A, neighbours: usize, around: Range<usize>) -> f32 {
        let mut squares: Vec<f32> = self.discs[around].iter().map(|disc| disc.center.distance_squared(p)).collect();
        let mut bound = select(&mut squares, neighbours);
        squares.clear();
        let q = Vec3::from(p);
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            if q.distance_squared(q.clamp(node.min, node.max)) > bound {
                at += node.size as usize;
                continue;
            }
            at += 1;
            if node.size == 1 {
                let first = node.leaf as usize * LEAF;
                let leaf = first..self.discs.len().min(first + LEAF);
                let near = self.discs[leaf].iter().map(|disc| disc.center.distance_squared(p));
                squares.extend(near.filter(|square| *square <= bound));
                // A focus may hold thousands of them.
                if squares.len() > MANY * neighbours {
                    bound = select(&mut squares, neighbours);
                    squares.truncate(neighbours + 1);
                }
            }
        }
        select(&mut squares, neighbours).sqrt()
    }
}

/// Returns number `number` of the sorted values, or the greatest; reorders them.
fn select(values: &mut [f32], number: usize) -> f32 {
    let last = values.len() - 1;
    *values.select_nth_unstable_by(number.min(last), f32::total_cmp).1
}

/// Sorts discs into the order of the leaves, by the medians of their centers.
fn sort(discs: &mut [Disc]) {
    let Some(middle) = middle(discs.len()) else { return };
    let (min, max) = discs
        .iter()
        .fold((Vec3A::INFINITY, Vec3A::NEG_INFINITY), |(min, max), disc| (min.min(disc.center), max.max(disc.center)));
    let axis = (max - min).max_position();
    discs.select_nth_unstable_by(middle, |a, b| a.center[axis].total_cmp(&b.center[axis]));
    let (left, right) = discs.split_at_mut(middle);
    rayon::join(|| sort(left), || sort(right));
}

/// Returns where a subtree of so many discs is divided, between leaves; `None` for a leaf.
fn middle(discs: usize) -> Option<usize> {
    (discs > LEAF).then(|| discs.div_ceil(LEAF) / 2 * LEAF)
}

/// Makes the nodes of the tree over sorted discs, whose leaves are numbered from `leaf` on.
fn bound(discs: &[Disc], nodes: &mut [Node], leaf: u32) {
    let number = |count: usize| u32::try_from(count).expect("fewer photons than 2^32");
    let size = number(nodes.len());
    let (node, rest) = nodes.split_first_mut().expect("a tree has a node");
    let boxed = |min: Vec3A, max: Vec3A| Node { min: min.into(), max: max.into(), size, leaf };
    let Some(middle) = middle(discs.len()) else {
        let (min, max) = discs.iter().fold((Vec3A::INFINITY, Vec3A::NEG_INFINITY), |(min, max), disc| {
            (min.min(disc.center - disc.radius), max.max(disc.center + disc.radius))
        });
        *node = boxed(min, max);
        return;
    };
    let (left, right) = discs.split_at(middle);
    let left_leaves = middle / LEAF;
    let (left_nodes, right_nodes) = rest.split_at_mut(2 * left_leaves - 1);
    rayon::join(|| bound(left, left_nodes, leaf), || bound(right, right_nodes, leaf + number(left_leaves)));
    *node = Node {
        min: left_nodes[0].min.min(right_nodes[0].min),
        max: left_nodes[0].max.max(right_nodes[0].max),
        size,
        leaf,
    };
}
