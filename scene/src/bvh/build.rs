//! Building the tree: boxes, obvhs, wide nodes, packets.

use fearless_simd::Level;
use glam::{Vec3, Vec3A};
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

use super::packet::{CUT_OUT, FORM, PRIMITIVE, Packet, form_of};
use super::{Bvh, LANES, Node, median, widen};
use crate::Aabb;

/// Something to find.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Primitive {
    /// A triangle's corners, and whether it may have holes.
    Triangle { corners: [Vec3; 3], cut_out: bool },
    /// A free form's box.
    Form(Aabb),
    /// Nothing: cannot be hit, but keeps the numbers of what follows.
    Nothing,
}

/// Boxes grow by a hash of up to this share of their extent: equal boxes in a row would tie in the builder, which then
/// makes trees as deep as the row is long.
const GROWTH: f32 = 1e-4;

/// And by a hash of up to so many units in the last place, without which the growth of small boxes far from the origin
/// would be rounded off.
const ULPS: f32 = 4.0;

/// Boxes grow by this share of the scene's diagonal besides: a triangle's sheared corners are rounded by some units of
/// roundoff of their distance from the ray's origin, and a ray must enter the box of whatever triangle takes it.
const PADDING: f32 = 4e-7;

/// Deeper trees, which boxes within boxes make, are replaced by an even one. The wide tree is no deeper than the binary
/// one.
pub(super) const MAX_DEPTH: usize = 128;

impl Bvh {
    /// Builds the tree over all primitives, numbered in their order. The same primitives give the same tree.
    pub(crate) fn new(primitives: &[Primitive]) -> Self {
        let numbers: Vec<u32> =
            (0u32..).zip(primitives).filter(|(_, p)| !matches!(p, Primitive::Nothing)).map(|(i, _)| i).collect();
        let mut bvh = Self { nodes: Vec::new(), packets: Vec::new(), level: Level::new(), has_forms: false };
        if numbers.is_empty() {
            return bvh;
        }
        let boxes = boxes(primitives, &numbers);
        let binary = if clusters_badly(&boxes) { median::split(&boxes) } else { clustered(&boxes) };
        let binary = if depth(&binary) > MAX_DEPTH { median::split(&boxes) } else { binary };
        drop(boxes);
        bvh.widen(&binary, |slot| {
            let number = numbers[binary.primitive_indices[slot] as usize];
            (number, primitives[number as usize])
        });
        bvh
    }

    /// Makes the nodes of eight children and the packets from the binary tree.
    fn widen(&mut self, binary: &Bvh2, primitive: impl Fn(usize) -> (u32, Primitive)) {
        let plan = widen::Plan::new(binary, |slot| matches!(primitive(slot).1, Primitive::Form(_)));
        self.nodes.push(Node::EMPTY);
        // Wide node, and the binary one whose place it takes. A list, not recursion: some trees are deep.
        let mut todo = vec![(0, 0)];
        while let Some((node, source)) = todo.pop() {
            for (lane, &member) in plan.children(source).iter().enumerate() {
                let child = if plan.is_packet(member) {
                    self.packets.push(Packet::new(plan.primitives(member).into_iter().map(&primitive)));
                    self.nodes[node].leaves |= 1 << lane;
                    self.packets.len() - 1
                } else {
                    self.nodes.push(Node::EMPTY);
                    todo.push((self.nodes.len() - 1, member));
                    self.nodes.len() - 1
                };
                let bounds = binary.nodes[member].aabb();
                self.nodes[node].set(lane, bounds.min, bounds.max, child);
            }
        }
        let has_form = |packet: &Packet| packet.primitives.into_iter().any(|lane| form_of(lane).is_some());
        self.has_forms = self.packets.iter().any(has_form);
        self.nodes.shrink_to_fit();
        self.packets.shrink_to_fit();
    }
}

/// Returns the grown box of each primitive.
fn boxes(primitives: &[Primitive], numbers: &[u32]) -> Vec<obvhs::aabb::Aabb> {
    let tight: Vec<Aabb> = numbers.iter().map(|&i| primitives[i as usize].bounds()).collect();
    let all = tight.iter().fold(Aabb::EMPTY, |all, &b| all.union(b));
    let padding = (PADDING * (all.max - all.min).length()).max(f32::MIN_POSITIVE);
    (numbers.iter().zip(tight))
        .map(|(&number, Aabb { min, max })| {
            let spread = GROWTH * (max - min) + ULPS * f32::EPSILON * min.abs().max(max.abs());
            let grow = |side: u32| {
                Vec3::from_array([0, 1, 2].map(|axis| unit_hash(number, 3 * side + axis))) * spread + padding
            };
            obvhs::aabb::Aabb { min: Vec3A::from(min - grow(0)), max: Vec3A::from(max + grow(1)) }
        })
        .collect()
}

/// Returns a number in [0, 1) that looks random (the finaliser of MurmurHash3).
fn unit_hash(index: u32, axis: u32) -> f32 {
    let mut h = index.wrapping_mul(0x9e37_79b9) ^ axis.wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    ((h ^ (h >> 16)) >> 8) as f32 / (1u32 << 24) as f32
}

/// Builds a tree by clustering, of which nodes are tried elsewhere then.
pub(super) fn clustered(boxes: &[obvhs::aabb::Aabb]) -> Bvh2 {
    // Part of the nodes that are tried elsewhere in the tree. More of a large tree make no ray faster by more than a
    // hundredth.
    const REINSERTION: f32 = 0.1;
    // But at least so many, and of small trees all in most of the passes: clustering joins the walls of rooms to boxes
    // as large as the room, and to try all nodes elsewhere saves a fifth of the tree's instructions in a Cornell box.
    const LEAST_REINSERTION: f32 = 4000.0;
    let mut tree = joined(boxes);
    let share = REINSERTION.max(LEAST_REINSERTION / tree.nodes.len() as f32);
    ReinsertionOptimizer::default().run(&mut tree, share, None);
    tree
}

/// Joins boxes to a tree, those that lie side by side first; in one thread and so always the same.
fn joined(boxes: &[obvhs::aabb::Aabb]) -> Bvh2 {
    // On the lowest levels only direct neighbours are compared.
    const NEIGHBOUR_LEVELS: usize = 3;
    let numbers = (0u32..).take(boxes.len()).collect();
    let mut ploc = PlocBuilder::with_capacity(boxes.len());
    ploc.build(PlocSearchDistance::Medium, boxes, numbers, SortPrecision::U64, NEIGHBOUR_LEVELS)
}

/// Whether the boxes would be joined one by one, which takes quadratic time: boxes within boxes are, and so is a sample
/// of them.
fn clusters_badly(boxes: &[obvhs::aabb::Aabb]) -> bool {
    const SAMPLE: usize = 1000;
    if boxes.len() < 4 * SAMPLE {
        return false;
    }
    let sample: Vec<_> = boxes.iter().step_by(boxes.len() / SAMPLE).copied().collect();
    depth(&joined(&sample)) > MAX_DEPTH / 2
}

/// Returns the number of levels.
fn depth(tree: &Bvh2) -> usize {
    let mut todo = vec![(0, 1)];
    let mut depth = 0;
    while let Some((node, level)) = todo.pop() {
        depth = depth.max(level);
        let node = &tree.nodes[node];
        if !node.is_leaf() {
            todo.extend([0, 1].map(|i| (node.first_index as usize + i, level + 1)));
        }
    }
    depth
}

impl Primitive {
    /// Returns the smallest box around it.
    pub(crate) fn bounds(&self) -> Aabb {
        match self {
            Self::Triangle { corners, .. } => Aabb::of_points(corners),
            Self::Form(bounds) => *bounds,
            Self::Nothing => Aabb::EMPTY,
        }
    }
}

impl Node {
    const EMPTY: Self = Self {
        bounds: [[[f32::INFINITY; LANES]; 3], [[f32::NEG_INFINITY; LANES]; 3]],
        children: [0; LANES],
        leaves: 0,
    };

    fn set(&mut self, lane: usize, min: Vec3A, max: Vec3A, child: usize) {
        for axis in 0..3 {
            self.bounds[0][axis][lane] = min[axis];
            self.bounds[1][axis][lane] = max[axis];
        }
        self.children[lane] = u32::try_from(child).expect("the number of primitives is limited");
    }
}

impl Packet {
    fn new(members: impl Iterator<Item = (u32, Primitive)>) -> Self {
        let mut packet = Self::EMPTY;
        for (lane, (number, primitive)) in members.enumerate() {
            assert!(number < PRIMITIVE, "primitives are fewer than 2^30");
            packet.primitives[lane] = number;
            match primitive {
                Primitive::Triangle { corners, cut_out } => {
                    packet.set_triangle(lane, corners);
                    packet.primitives[lane] |= if cut_out { CUT_OUT } else { 0 };
                }
                Primitive::Form(_) | Primitive::Nothing => packet.primitives[lane] |= FORM,
            }
        }
        packet
    }
}
