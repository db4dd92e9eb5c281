//! A tree of lights: one of very many below a branch is chosen by what it may contribute at a point, in logarithmic
//! time.
//!
//! ```text
//! importance = flux max(0, cos(theta - theta_o - theta_b)) / (d^2 + r^2 / 20)
//!              flux 2 / (d^2 + r^2 / 20)                                          inside of the sphere
//! ```
//!
//! d is the distance to the centre of the sphere around a node's lights and r its radius; theta the angle between the
//! axis of their normals and the direction to the point, theta_o that within which these normals lie, theta_b half of
//! that under which the sphere is seen. From a branch on, one of two children is taken in proportion to it, so that
//! what cannot shine to the point is never taken. The normal at the point is left out: a ray that meets a light by
//! chance must know the density with no more than the point it came from.
//!
//! # Source
//! Conty Estevez, Kulla 2018: Importance Sampling of Many Lights with Adaptive Tree Splitting. The walk from a light to
//! the root is that of Pharr, Jakob, Humphreys 2023: Physically Based Rendering, 4th edition, 12.6.3. We depart in that
//! nothing is split: one light is taken; and in the denominator, which is max(d, r)^2 there: with 10,000 lamps in a
//! hall that let a sample deviate by 2.8 times the mean, and ours by 1.0, for the one lamp beside the point is found
//! only if the large nodes around it weigh more than those without.

use std::f32::consts::{FRAC_PI_2, PI};
use std::ops::Range;

use glam::Vec3A;

use crate::Aabb;

/// A light that is not at infinity, as far as its choice goes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Emitter {
    pub(super) bounds: Aabb,
    /// The middle of its surface, and the area of that.
    pub(super) centre: Vec3A,
    pub(super) area: f32,
    /// Flux, summed over the channels; a quarter of it for a light to all sides, whose intensity is so much less.
    pub(super) flux: f32,
    /// Unit normal; `None` where it shines to all sides.
    pub(super) normal: Option<Vec3A>,
}

/// A binary tree with a light in each leaf.
#[derive(Debug, Clone)]
pub(super) struct LightTree {
    /// The root is the first; of each pair of children the second follows the first.
    nodes: Vec<Node>,
    /// The leaf of each light.
    leaves: Vec<u32>,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Node {
    /// Of the sphere around the box of its lights.
    pub(super) centre: Vec3A,
    pub(super) flux: f32,
    pub(super) shape: Shape,
    /// Number of lights below it, and the place of the first in the order of the tree.
    pub(super) count: u32,
    start: u32,
    parent: u32,
    /// First of two children, or of a leaf the light.
    pub(super) child: u32,
}

/// How far the lights of a node may be from its centre, and to where they may shine.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shape {
    pub(super) radius_sq: f32,
    /// Their normals are within an angle to this unit vector.
    pub(super) axis: [f32; 3],
    pub(super) sine: f32,
    pub(super) cosine: f32,
}

/// Directions about an axis, such as normals.
#[derive(Debug, Clone, Copy)]
struct Cone {
    /// Unit vector.
    axis: Vec3A,
    cosine: f32,
}

/// Candidates for a cut are the borders of so many slabs.
const BINS: usize = 12;

/// Nearer than this, metres squared, a light without extent counts as so far away: no importance may be infinite.
const LEAST_DISTANCE_SQ: f32 = 1e-12;

/// The share of the squared radius by which a squared distance is softened. Without, a point near the centre of a node
/// looks for lights only there.
const SOFTENING: f32 = 0.05;

/// Added to the cosine of the importance, so that rounding never leaves out a light that shines, seen edge on.
const SLACK: f32 = 1e-3;

impl LightTree {
    /// Builds the tree; at least one light.
    pub(super) fn new(emitters: &[Emitter]) -> Self {
        let mut order: Vec<u32> = (0u32..).take(emitters.len()).collect();
        let mut tree = Self { nodes: Vec::with_capacity(2 * emitters.len()), leaves: vec![0; emitters.len()] };
        let all = Cluster::of(&order, emitters);
        tree.nodes.push(Node::new(&all, 0..order.len(), 0));
        // Node, its stretch of `order`. A list, not recursion: cuts may be uneven.
        let mut todo = vec![(0usize, 0..order.len(), all)];
        while let Some((index, range, cluster)) = todo.pop() {
            let lights = &mut order[range.clone()];
            if let [light] = *lights {
                tree.nodes[index].child = light;
                tree.leaves[light as usize] = number(index);
                continue;
            }
            let middle = cut(lights, emitters, &cluster);
            let child = tree.nodes.len();
            tree.nodes[index].child = number(child);
            let middle = range.start + middle;
            for (i, part) in [range.start..middle, middle..range.end].into_iter().enumerate() {
                let cluster = Cluster::of(&order[part.clone()], emitters);
                tree.nodes.push(Node::new(&cluster, part.clone(), number(index)));
                todo.push((child + i, part, cluster));
            }
        }
        tree
    }

    /// Splits those of some branches that are worth most, until there are `most` of them or no worth is above 0.
    pub(super) fn split(&self, branches: &mut Vec<usize>, most: usize, worth: impl Fn(&Node) -> f32) {
        let worth = |&branch: &usize| {
            let node = &self.nodes[branch];
            if node.count > 1 { worth(node) } else { 0.0 }
        };
        let mut worths: Vec<f32> = branches.iter().map(worth).collect();
        while branches.len() < most {
            let best = (0..worths.len()).max_by(|&a, &b| worths[a].total_cmp(&worths[b]));
            let Some(place) = best.filter(|&place| worths[place] > 0.0) else { return };
            let child = self.nodes[branches[place]].child as usize;
            let children = [child, child + 1];
            branches.splice(place..=place, children);
            worths.splice(place..=place, children.map(|child| worth(&child)));
        }
    }

    /// Returns a node.
    #[inline]
    pub(super) fn node(&self, index: usize) -> &Node {
        &self.nodes[index]
    }

    /// Returns the place of a light in the order of the tree, in which those below a node follow each other.
    #[inline]
    pub(super) fn place(&self, light: usize) -> u32 {
        self.nodes[self.leaves[light] as usize].start
    }

    /// Returns the light below a `branch` that `u` in [0, 1) chooses for the point `p`, and its probability among
    /// these; `None` where none shines to it.
    ///
    /// In f64 the remainder of `u` keeps its digits over all levels.
    #[inline]
    pub(super) fn sample(&self, branch: usize, p: Vec3A, mut u: f64) -> Option<(usize, f32)> {
        let mut probability = 1.0;
        let mut node = &self.nodes[branch];
        while node.count > 1 {
            let first = self.share(node, p)?;
            let child = node.child as usize;
            if u < f64::from(first) {
                u /= f64::from(first);
                probability *= first;
                node = &self.nodes[child];
            } else {
                u = (u - f64::from(first)) / (1.0 - f64::from(first));
                probability *= 1.0 - first;
                node = &self.nodes[child + 1];
            }
        }
        (probability > 0.0).then_some((node.child as usize, probability))
    }

    /// Returns the probability with which [`LightTree::sample`] chooses a light below a `branch` for the point `p`.
    #[inline]
    pub(super) fn probability(&self, branch: usize, p: Vec3A, light: usize) -> f32 {
        let mut probability = 1.0;
        let mut index = self.leaves[light] as usize;
        while index != branch {
            debug_assert!(index != 0, "the light is below the branch");
            let parent = &self.nodes[self.nodes[index].parent as usize];
            let Some(first) = self.share(parent, p) else { return 0.0 };
            probability *= if index == parent.child as usize { first } else { 1.0 - first };
            index = self.nodes[index].parent as usize;
        }
        probability
    }

    /// Returns the probability of the first child; `None` where neither shines to `p`.
    #[inline]
    fn share(&self, node: &Node, p: Vec3A) -> Option<f32> {
        let child = node.child as usize;
        let (first, second) = (self.nodes[child].importance(p), self.nodes[child + 1].importance(p));
        let sum = first + second;
        (sum > 0.0).then(|| first / sum)
    }

    /// Returns the memory held, bytes.
    pub(super) fn memory_bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<Node>() + self.leaves.capacity() * size_of::<u32>()
    }
}

impl Node {
    fn new(cluster: &Cluster, range: Range<usize>, parent: u32) -> Self {
        let Aabb { min, max } = cluster.bounds;
        let centre = Vec3A::from(min.midpoint(max));
        let radius_sq = (0.25 * (max - min).length_squared()).max(LEAST_DISTANCE_SQ);
        let Cone { axis, cosine } = cluster.cone;
        let sine = ((1.0 - cosine) * (1.0 + cosine)).max(0.0).sqrt();
        let shape = Shape { radius_sq, axis: axis.to_array(), sine, cosine };
        let (start, count) = (number(range.start), number(range.len()));
        Self { centre, flux: cluster.flux, shape, count, start, parent, child: 0 }
    }

    /// Returns it as if its flux were multiplied.
    pub(super) fn weighted(&self, weight: f32) -> Self {
        Self { flux: self.flux * weight, ..*self }
    }

    /// Returns the places of the lights below it.
    pub(super) fn places(&self) -> Range<u32> {
        self.start..self.start + self.count
    }

    #[inline]
    fn importance(&self, p: Vec3A) -> f32 {
        let Self { centre, shape, flux, .. } = self;
        flux * shape.importance((p - *centre).to_array())
    }
}

impl Shape {
    /// Returns the importance of a flux of 1 at an offset from the centre.
    #[inline(always)]
    pub(super) fn importance(self, offset: [f32; 3]) -> f32 {
        let Self { radius_sq, axis, sine, cosine } = self;
        let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let distance_sq = dot(offset, offset);
        let weight = 1.0 / (distance_sq + SOFTENING * radius_sq);
        // The least angle to any normal of the cone, from any point of the sphere.
        let cosine_to_axis = dot(axis, offset) / distance_sq.sqrt();
        let sine_to_axis = ((1.0 - cosine_to_axis) * (1.0 + cosine_to_axis)).max(0.0).sqrt();
        let sine_b_sq = radius_sq / distance_sq;
        let bound = (sine_b_sq.sqrt(), (1.0 - sine_b_sq).sqrt());
        let (_, least) = less(less((sine_to_axis, cosine_to_axis), (sine, cosine)), bound);
        if distance_sq <= radius_sq { 2.0 * weight } else { weight * (least + SLACK).max(0.0) }
    }
}

pub(super) fn number(x: usize) -> u32 {
    u32::try_from(x).expect("the number of primitives is limited")
}

/// Returns sine and cosine of the difference of two angles in [0, pi], or of 0 where the second is larger.
#[inline]
fn less(a: (f32, f32), b: (f32, f32)) -> (f32, f32) {
    if a.1 >= b.1 { (0.0, 1.0) } else { (a.0 * b.1 - a.1 * b.0, a.1 * b.1 + a.0 * b.0) }
}

/// What is known of some lights together.
#[derive(Debug, Clone, Copy)]
struct Cluster {
    bounds: Aabb,
    /// Of the lights' middles.
    centres: Aabb,
    flux: f32,
    cone: Cone,
}

impl Cluster {
    fn of(lights: &[u32], emitters: &[Emitter]) -> Self {
        let of = |&light: &u32| Self::from(&emitters[light as usize]);
        lights.iter().map(of).reduce(Self::union).expect("a node has lights")
    }

    fn union(self, other: Self) -> Self {
        Self {
            bounds: self.bounds.union(other.bounds),
            centres: self.centres.union(other.centres),
            flux: self.flux + other.flux,
            cone: self.cone.union(other.cone),
        }
    }

    /// Returns what a part costs (the orientation heuristic of the source, eq. 1): flux times area times solid angle to
    /// which it shines.
    fn cost(&self) -> f32 {
        let size = self.bounds.max - self.bounds.min;
        let area = size.x * size.y + size.y * size.z + size.z * size.x;
        let theta_o = self.cone.cosine.clamp(-1.0, 1.0).acos();
        let theta_w = (theta_o + FRAC_PI_2).min(PI);
        let sine = theta_o.sin();
        let beyond = 2.0 * theta_w * sine - (theta_o - 2.0 * theta_w).cos() - 2.0 * theta_o * sine + theta_o.cos();
        self.flux * area * (2.0 * PI * (1.0 - theta_o.cos()) + FRAC_PI_2 * beyond)
    }
}

impl From<&Emitter> for Cluster {
    fn from(emitter: &Emitter) -> Self {
        let centre = emitter.bounds.centre();
        let cone = emitter.normal.map_or(Cone::ALL, |axis| Cone { axis, cosine: 1.0 });
        Self { bounds: emitter.bounds, centres: Aabb { min: centre, max: centre }, flux: emitter.flux, cone }
    }
}

impl Cone {
    const ALL: Self = Self { axis: Vec3A::Z, cosine: -1.0 };

    /// Returns a cone around both.
    fn union(self, other: Self) -> Self {
        let (wide, narrow) = if self.cosine <= other.cosine { (self, other) } else { (other, self) };
        let [theta_w, theta_n] = [wide.cosine, narrow.cosine].map(|cosine| cosine.clamp(-1.0, 1.0).acos());
        let between = wide.axis.dot(narrow.axis).clamp(-1.0, 1.0).acos();
        if (between + theta_n).min(PI) <= theta_w {
            return wide;
        }
        let half = 0.5 * (theta_w + between + theta_n);
        let Some(towards) = (narrow.axis - wide.axis * wide.axis.dot(narrow.axis)).try_normalize() else {
            return Self::ALL;
        };
        if half >= PI {
            return Self::ALL;
        }
        let (sine, cosine) = (half - theta_w).sin_cos();
        Self { axis: wide.axis * cosine + towards * sine, cosine: half.cos() }
    }
}

/// Orders the lights along their longest side so that a good cut is at the returned place, with lights on both sides.
fn cut(lights: &mut [u32], emitters: &[Emitter], cluster: &Cluster) -> usize {
    let Aabb { min, max } = cluster.centres;
    let size = max - min;
    let axis = size.max_position();
    if size[axis] <= 0.0 {
        return lights.len() / 2;
    }
    let bin = |light: u32| {
        let share = (emitters[light as usize].bounds.centre()[axis] - min[axis]) / size[axis] * BINS as f32;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of the bins, limited below"
        )]
        let bin = share as usize;
        bin.min(BINS - 1)
    };
    let mut bins: [Option<Cluster>; BINS] = [None; BINS];
    for &light in &*lights {
        bins[bin(light)] = join(bins[bin(light)], Some(Cluster::from(&emitters[light as usize])));
    }
    let mut above = [None; BINS];
    for i in (1..BINS).rev() {
        above[i - 1] = join(bins[i], above[i]);
    }
    let (mut below, mut best) = (None, (f32::INFINITY, 0));
    for i in 0..BINS - 1 {
        below = join(below, bins[i]);
        if let (Some(a), Some(b)) = (below, above[i]) {
            let cost = a.cost() + b.cost();
            // The first and the last bin have lights, so there is a cut even where no cost is finite.
            if cost < best.0 || best.0 == f32::INFINITY {
                best = (cost, i);
            }
        }
    }
    lights.sort_by_key(|&light| bin(light));
    lights.partition_point(|&light| bin(light) <= best.1)
}

fn join(a: Option<Cluster>, b: Option<Cluster>) -> Option<Cluster> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.union(b)),
        _ => a.or(b),
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    /// Small triangles' boxes in a room of 10 metres, some facing down, some sideways, and a few lights without a
    /// normal.
    fn emitters(count: u32) -> Vec<Emitter> {
        let hash = |i: u32, k: u32| {
            let x = i.wrapping_mul(0x9e37_79b9) ^ k.wrapping_mul(0x85eb_ca6b);
            let x = (x ^ (x >> 16)).wrapping_mul(0xc2b2_ae35);
            ((x ^ (x >> 13)) >> 8) as f32 / (1u32 << 24) as f32
        };
        let emitter = |i: u32| {
            let corner = Vec3::new(hash(i, 0), hash(i, 1), hash(i, 2)) * 10.0;
            let normal = Vec3A::new(hash(i, 3) - 0.5, hash(i, 4) - 0.5, -0.5).normalize();
            Emitter {
                bounds: Aabb { min: corner, max: corner + 0.05 },
                centre: (corner + 0.025).into(),
                area: 0.0025,
                flux: 0.1 + hash(i, 5),
                normal: (!i.is_multiple_of(7)).then_some(normal),
            }
        };
        (0..count).map(emitter).collect()
    }

    #[test]
    fn probabilities_are_those_of_the_samples_and_few_are_lost() {
        let emitters = emitters(1000);
        let tree = LightTree::new(&emitters);
        for p in [Vec3A::new(5.0, 5.0, 0.0), Vec3A::new(-20.0, 3.0, 4.0), Vec3A::new(2.0, 8.0, 6.0)] {
            let sum: f64 = (0..emitters.len()).map(|light| f64::from(tree.probability(0, p, light))).sum();
            let mut found = 0.0;
            for i in 0..4096 {
                let Some((light, probability)) = tree.sample(0, p, (f64::from(i) + 0.5) / 4096.0) else { continue };
                found += 1.0 / 4096.0;
                let again = tree.probability(0, p, light);
                assert!((probability / again - 1.0).abs() < 1e-5, "{p}, light {light}: {probability} is not {again}");
            }
            // What is left goes to nodes whose lights turn out to face away; a gap of the samples has two ends.
            assert!((found - sum).abs() < 50.0 / 4096.0 && sum > 0.85 && sum < 1.0 + 1e-5, "{p}: {sum}, {found}");
        }
    }

    #[test]
    fn whatever_shines_to_a_point_has_a_probability() {
        let emitters = emitters(500);
        let tree = LightTree::new(&emitters);
        for p in [Vec3A::new(5.0, 5.0, -1.0), Vec3A::new(0.0, 0.0, 30.0), Vec3A::new(9.0, 1.0, 5.0)] {
            for (light, emitter) in emitters.iter().enumerate() {
                let Aabb { min, max } = emitter.bounds;
                let corner = |i: usize| Vec3A::from_array([0, 1, 2].map(|axis| [min, max][i >> axis & 1][axis]));
                let shines = emitter.normal.is_none_or(|n| (0..8).any(|i| n.dot(p - corner(i)) > 0.0));
                assert!(!shines || tree.probability(0, p, light) > 0.0, "{p}: light {light} is left out");
            }
        }
    }

    #[test]
    fn lights_in_one_place_are_all_found() {
        let bounds = Aabb { min: Vec3::ONE, max: Vec3::ONE };
        let one = Emitter { bounds, centre: Vec3A::ONE, area: 0.0, flux: 1.0, normal: None };
        let tree = LightTree::new(&[one; 5]);
        for light in 0..5 {
            assert!(tree.probability(0, Vec3A::ZERO, light) > 0.05, "light {light}");
        }
    }
}
