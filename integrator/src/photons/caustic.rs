//! Irradiance by caustics: each photon spreads its flux over a disc of its own.
//!
//! ```text
//! E(p) = sum over photons i with |p - x_i| < r_i of  2 flux_i / (pi r_i^2) (1 - |p - x_i|^2 / r_i^2)
//! ```
//! where r_i is about the distance from x_i to the k-th photon next to it, so that discs are small in a focus and wide where photons are few. No
//! flux is lost or won, however the irradiance changes: all discs together hold what all photons carry, but for what hangs over an edge, which is left to the
//! caller. An estimate by the photons nearest to p does not have this property: beside a focus its radius ends at the focus, and a pool's caustic was
//! 2 % too bright in the mean.
//!
//! # Source
//!
//! Ian S. Abramson, *On Bandwidth Variation in Kernel Estimates*, 1982, for a bandwidth by the square root of the density, which in two dimensions is
//! the distance to the k-th neighbour; the kernel is Epanechnikov's.

use std::f32::consts::PI;
use std::ops::Range;

use super::map::{Irradiance, SAME_NORMAL, SAME_PLANE};
use super::shoot::Photons;
use glam::{Vec3, Vec3A};

/// The limit of a disc's radius, in medians: most photons are in a focus, and those far from it must not become specks.
const RADIUS_LIMIT: f32 = 64.0;
/// A search keeps at most so many times the neighbours that it is for, and a leaf.
const MANY: usize = 3;
/// Discs in a leaf of the tree.
const LEAF: usize = 8;

/// A photon and its disc.
#[derive(Debug, Clone, Copy)]
struct Disc {
    center: Vec3A,
    normal: Vec3A,
    /// Irradiance at the center, W m^-2.
    peak: Vec3,
    radius: f32,
}

/// A box around discs. A node's first child follows it.
#[derive(Debug, Clone, Copy)]
struct Node {
    min: Vec3,
    max: Vec3,
    /// Nodes of this subtree: where to go on if the box does not hold the point.
    size: u32,
    /// Number of the first leaf in it.
    leaf: u32,
}

/// Photons with their discs, in a tree over them.
#[derive(Debug)]
pub(super) struct CausticMap {
    discs: Vec<Disc>,
    nodes: Vec<Node>,
}

impl CausticMap {
    /// Builds the map of estimates by about `neighbours` photons within `max_radius`, or within a limit taken from the photons' density. `None` where
    /// there is no photon.
    pub(super) fn new(photons: &Photons, neighbours: u32, max_radius: Option<f32>) -> Option<Self> {
        if photons.len() == 0 {
            return None;
        }
        let mut discs: Vec<Disc> = (0..photons.len())
            .map(|i| {
                let center = Vec3A::from(photons.positions[i]);
                Disc { center, normal: photons.normals[i], peak: photons.flux[i], radius: 0.0 }
            })
            .collect();
        sort(&mut discs);
        let leaves = discs.len().div_ceil(LEAF);
        let nodes = vec![Node { min: Vec3::ZERO, max: Vec3::ZERO, size: 0, leaf: 0 }; 2 * leaves - 1];
        let mut map = Self { discs, nodes };
        bound(&map.discs, &mut map.nodes, 0);
        map.measure(neighbours.max(2) as usize, max_radius);
        spread(&mut map.discs);
        bound(&map.discs, &mut map.nodes, 0);
        Some(map)
    }

    pub(super) fn memory_bytes(&self) -> u64 {
        (self.discs.len() * size_of::<Disc>() + self.nodes.len() * size_of::<Node>()) as u64
    }

    /// Returns the irradiance at `p` on the side of the unit normal `n`, with the mean radius of the discs by what they give; 0 where there is none.
    pub(super) fn irradiance(&self, p: Vec3A, n: Vec3A) -> Irradiance {
        let mut irradiance = Vec3::ZERO;
        let (mut radius, mut total) = (0.0, 0.0);
        let q = Vec3::from(p);
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            if !(q.cmpge(node.min) & q.cmple(node.max)).all() {
                at += node.size as usize;
                continue;
            }
            at += 1;
            if node.size > 1 {
                continue;
            }
            for disc in self.leaf(node) {
                let offset = p - disc.center;
                let share = 1.0 - offset.length_squared() / (disc.radius * disc.radius);
                if share > 0.0 && disc.normal.dot(n) > SAME_NORMAL && offset.dot(n).abs() < SAME_PLANE * disc.radius {
                    let part = disc.peak * share;
                    irradiance += part;
                    radius += part.max_element() * disc.radius;
                    total += part.max_element();
                }
            }
        }
        Irradiance { irradiance, radius: if total > 0.0 { radius / total } else { 0.0 } }
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

    /// Sets the radii of a subtree's discs, by one search for each few of them: as good as one for each photon, in a third of the time or less. Of the
    /// subtrees around it that hold enough neighbours, `around` is the smallest.
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

    /// Returns the distance from `p` of neighbour number `neighbours`, counted from 0, which is no farther than that of those `around` it.
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
                let near = self.leaf(node).iter().map(|disc| disc.center.distance_squared(p));
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

    /// Returns the discs of a leaf.
    #[inline]
    fn leaf(&self, node: &Node) -> &[Disc] {
        let first = node.leaf as usize * LEAF;
        &self.discs[first..self.discs.len().min(first + LEAF)]
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

/// Spreads the flux in `peak` over the discs.
fn spread(discs: &mut [Disc]) {
    for disc in discs {
        let peak = disc.peak * (2.0 / (PI * disc.radius * disc.radius));
        // A beam without width has no irradiance.
        disc.peak = if peak.is_finite() { peak } else { Vec3::ZERO };
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rng;

    /// Photons on the plane z = 0, each of the same flux, 1 W in all.
    fn photons(positions: Vec<[f32; 3]>) -> Photons {
        let flux = Vec3::splat(1.0 / positions.len() as f32);
        Photons { normals: vec![Vec3A::Z; positions.len()], flux: vec![flux; positions.len()], positions }
    }

    /// A wide square and, of the same flux, a focus a thousandth as wide and a line in it.
    fn focused() -> Photons {
        let mut rng = Rng::new(8, 0);
        let mut u = || rng.next_1d() - 0.5;
        photons(
            (0..60_000)
                .map(|i| match i % 3 {
                    0 => [u(), u(), 0.0],
                    1 => [1e-3 * u(), 1e-3 * u(), 0.0],
                    _ => [u(), 0.2 + 1e-4 * u(), 0.0],
                })
                .collect(),
        )
    }

    /// Flux on the square of side 2 around the origin by a jittered grid that is finer in the focus and on the line.
    fn integral(irradiance: impl Fn(Vec3A) -> f32 + Sync) -> f64 {
        // Intervals that divide -1 to 1 and how many points each has.
        let across = [(-1.0, -0.01, 200), (-0.01, 0.01, 400), (0.01, 1.0, 200)];
        let along = [(-1.0, -0.01, 200), (-0.01, 0.01, 400), (0.01, 0.19, 60), (0.19, 0.21, 400), (0.21, 1.0, 160)];
        let mut rng = Rng::new(9, 0);
        let mut sum = 0.0;
        for (x0, x1, nx) in across {
            for (y0, y1, ny) in along {
                let (dx, dy) = ((x1 - x0) / nx as f32, (y1 - y0) / ny as f32);
                for i in 0..nx * ny {
                    let x = x0 + dx * ((i % nx) as f32 + rng.next_1d());
                    let y = y0 + dy * ((i / nx) as f32 + rng.next_1d());
                    sum += f64::from(irradiance(Vec3A::new(x, y, 0.0)) * dx * dy);
                }
            }
        }
        sum
    }

    #[test]
    fn a_focus_neither_gains_nor_loses_light() {
        let photons = focused();
        let map = CausticMap::new(&photons, 80, None).unwrap();
        let found = integral(|p| map.irradiance(p, Vec3A::Z).irradiance.x);
        // The grid is good to half a percent. An estimate by the nearest 80 photons has far more.
        assert!((found - 1.0).abs() < 0.015, "{found} of 1 W");
        let focus = map.irradiance(Vec3A::ZERO, Vec3A::Z).irradiance.x;
        assert!((focus / (1e6 / 3.0) - 1.0).abs() < 0.3, "{focus} in the focus");
        // No sparse photon beside it has a disc of its size: such a speck would be as bright as the focus.
        let beside = map.discs.iter().filter(|disc| disc.center.length() > 0.01 && disc.center.y < 0.15);
        let brightest = beside.map(|disc| disc.peak.x).fold(0.0, f32::max);
        assert!(brightest < 1.0, "{brightest} where the irradiance is 1/3");
    }

    #[test]
    fn even_light_has_the_noise_of_its_photons() {
        let mut rng = Rng::new(4, 0);
        let photons = photons((0..50_000).map(|_| [rng.next_1d(), rng.next_1d(), 0.0]).collect());
        for neighbours in [50u16, 400] {
            let map = CausticMap::new(&photons, u32::from(neighbours), None).unwrap();
            let values: Vec<f32> = (0..400u16)
                .map(|i| {
                    let p = Vec3A::new(0.1 + 0.042 * f32::from(i % 20), 0.1 + 0.042 * f32::from(i / 20), 0.0);
                    map.irradiance(p, Vec3A::Z).irradiance.x
                })
                .collect();
            let mean = values.iter().sum::<f32>() / 400.0;
            let spread = (values.iter().map(|x| (x - mean).powi(2)).sum::<f32>() / 399.0).sqrt();
            // By Epanechnikov's kernel, for discs of one size; the mean is good to a twentieth of that.
            let expected = (4.0 / 3.0 / f32::from(neighbours)).sqrt();
            assert!((mean - 1.0).abs() < 4.5 * expected / 20.0, "mean {mean} by {neighbours}");
            assert!((0.8..1.3).contains(&(spread / expected)), "deviation {spread} by {neighbours}");
        }
    }

    #[test]
    fn tree_agrees_with_the_sum_over_all_discs() {
        for count in [1, 7, 8, 9, 100, 1000] {
            let photons = photons(focused().positions[..count].to_vec());
            let map = CausticMap::new(&photons, 20, Some(0.3)).unwrap();
            let mut rng = Rng::new(10, 0);
            for _ in 0..200 {
                let p = Vec3A::new(1.2 * rng.next_1d() - 0.6, 1.2 * rng.next_1d() - 0.6, 0.0);
                let near = |disc: &&Disc| disc.center.distance(p) < disc.radius;
                let share = |disc: &Disc| 1.0 - (disc.center.distance(p) / disc.radius).powi(2);
                let all: f32 = map.discs.iter().filter(near).map(|disc| share(disc) * disc.peak.x).sum();
                let found = map.irradiance(p, Vec3A::Z).irradiance.x;
                assert!((found - all).abs() <= 1e-4 * all, "{count} photons: {found}, {all}");
            }
            assert_eq!(map.irradiance(Vec3A::ZERO, Vec3A::NEG_Z).irradiance, Vec3::ZERO, "the other side");
        }
    }

    #[test]
    fn few_and_coincident_photons_have_an_answer() {
        let at = [0.5, 0.5, 0.0];
        for count in [1, 2, 15] {
            let map = CausticMap::new(&photons(vec![at; count]), 80, Some(2.0)).unwrap();
            let found = map.irradiance(Vec3A::from(at), Vec3A::Z).irradiance.x;
            assert!((found * PI * 4.0 / 2.0 - 1.0).abs() < 1e-5, "{count} over the limit: {found}");
        }
        let map = CausticMap::new(&photons(vec![at; 1000]), 80, None).unwrap();
        let found = map.irradiance(Vec3A::from(at), Vec3A::Z);
        assert_eq!(found.irradiance, Vec3::ZERO, "a beam without width is not a number, nor infinite");
        assert!(CausticMap::new(&Photons::default(), 80, None).is_none(), "none at all");
    }
}
