//! S-elements as a structure of arrays: what a reprojection reads, and nothing else.

use std::ops::{BitOr, Range};

use glam::Vec3A;
use serde::{Deserialize, Serialize};

use crate::merge::{Block, MergeSettings, merge};
use crate::outline::Outline;
use crate::samples::append_directions;
use crate::silhouette::{plane_distance, silhouettes};
use crate::{MAX_RESOLUTION, Samples, depth_layers};

/// The arrays of [`Elements`] are padded to a multiple of this, with elements of no area.
pub const LANES: usize = 16;

/// A set of sides of an element: which of them are silhouettes against something farther.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Sides(pub u8);

impl Sides {
    /// No side.
    pub const NONE: Self = Self(0);
    /// The side at smaller v.
    pub const BOTTOM: Self = Self(1);
    /// The side at larger u.
    pub const RIGHT: Self = Self(2);
    /// The side at larger v.
    pub const TOP: Self = Self(4);
    /// The side at smaller u.
    pub const LEFT: Self = Self(8);

    /// Whether side `k`, from corner k to corner k + 1, is in the set.
    #[must_use]
    pub fn has(self, k: usize) -> bool {
        self.0 >> k & 1 == 1
    }

    /// Whether the set holds all of `other`.
    #[must_use]
    pub fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }
}

impl BitOr for Sides {
    type Output = Self;
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

/// The s-elements of a record, nearest layer first, in the frame of the record and relative to its centre.
///
/// Corners run round the element: (u0, v0), (u1, v0), (u1, v1), (u0, v1). An element at infinity has `finite` 0 and
/// directions as corners. Each array is [`Self::padded_len`] long, those of corners four times as long.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Elements {
    /// x of the corners, metres: corner `k` of element `e` has the number `k * padded_len + e`.
    pub x: Vec<f32>,
    /// y of the corners, metres.
    pub y: Vec<f32>,
    /// z of the corners, metres; not negative.
    pub z: Vec<f32>,
    /// 1 for an element at a distance, 0 for one at infinity, which does not move.
    pub finite: Vec<f32>,
    /// Share of the radiance that comes from infinity, see [`Samples::background_share`].
    pub background_share: Vec<f32>,
    /// Mean radiance, W m^-2 sr^-1: red, green, blue.
    pub radiance: [Vec<f32>; 3],
    /// First column and row of its texels in the record.
    pub start: Vec<[u8; 2]>,
    /// Columns and rows of its texels in the record.
    pub size: Vec<[u8; 2]>,
    /// Sides that are silhouettes.
    pub sides: Vec<Sides>,
    /// Whether the radiance holds for the record only (see [`Samples::view_dependent`]).
    pub view_dependent: Vec<bool>,
    /// Start of each layer, and the number of elements at the end.
    pub(crate) layer_starts: Vec<u32>,
    /// What follows from all that, so that it need not be written or read.
    #[serde(skip)]
    pub(crate) outline: Outline,
}

impl Elements {
    /// Divides samples into elements in `layers` depth layers.
    pub(crate) fn new(samples: &Samples, layers: usize, settings: &MergeSettings) -> Self {
        let n = samples.resolution();
        let mut layer_of = vec![0; n * n];
        depth_layers(&samples.distance, layers, &mut layer_of);
        let grid = Grid::new(samples);
        let mut blocks = merge(samples, &grid.points, &layer_of, settings);
        // Inside a layer by height, up and down in turn: lanes draw as many rows as the highest of them has. Stable, so
        // that the rest of the order is that of the texels.
        blocks.sort_by_key(|b| (b.layer, if b.layer % 2 == 0 { b.size[1] } else { u8::MAX - b.size[1] }));
        let mut layer_starts = vec![0; layers + 1];
        for block in &blocks {
            layer_starts[usize::from(block.layer) + 1] += 1;
        }
        for layer in 0..layers {
            layer_starts[layer + 1] += layer_starts[layer];
        }
        let padded = blocks.len().next_multiple_of(LANES);
        let zeros = || vec![0.0; padded];
        let mut elements = Self {
            x: vec![0.0; 4 * padded],
            y: vec![0.0; 4 * padded],
            z: vec![0.0; 4 * padded],
            finite: vec![1.0; padded],
            background_share: zeros(),
            radiance: std::array::from_fn(|_| zeros()),
            start: vec![[0; 2]; padded],
            size: vec![[0; 2]; padded],
            sides: vec![Sides::NONE; padded],
            view_dependent: vec![false; padded],
            layer_starts,
            outline: Outline::default(),
        };
        for (e, block) in blocks.iter().enumerate() {
            elements.fill(e, block, &grid);
        }
        elements.outline = Outline::of(&elements);
        elements
    }

    /// Whether the arrays fit together, or what does not.
    pub(crate) fn check_layout(&self) -> Result<(), &'static str> {
        let starts = &self.layer_starts;
        if starts.len() < 2 || starts.len() > 257 || starts[0] != 0 || starts.windows(2).any(|w| w[0] > w[1]) {
            return Err("its layers are not in order");
        }
        if self.len() > MAX_RESOLUTION * MAX_RESOLUTION {
            return Err("it has too many elements");
        }
        let padded = self.len().next_multiple_of(LANES);
        let once = [&self.finite, &self.background_share].into_iter().chain(&self.radiance).map(Vec::len);
        let lists = [self.start.len(), self.size.len(), self.sides.len(), self.view_dependent.len()];
        let corners = [&self.x, &self.y, &self.z].map(Vec::len);
        let fits = once.chain(lists).all(|len| len == padded) && corners.iter().all(|&len| len == 4 * padded);
        if fits { Ok(()) } else { Err("its arrays of elements differ in length") }
    }

    /// Number of elements.
    #[must_use]
    pub fn len(&self) -> usize {
        self.layer_starts.last().map_or(0, |&count| count as usize)
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Length of the arrays, a multiple of [`LANES`].
    #[must_use]
    pub fn padded_len(&self) -> usize {
        self.finite.len()
    }

    /// Number of depth layers.
    #[must_use]
    pub fn layer_count(&self) -> usize {
        self.layer_starts.len() - 1
    }

    /// The elements whose nearest texel is in a layer, 0 the nearest; they may reach into farther ones.
    ///
    /// # Panics
    /// If there are fewer layers.
    #[must_use]
    pub fn layer(&self, layer: usize) -> Range<usize> {
        self.layer_starts[layer] as usize..self.layer_starts[layer + 1] as usize
    }

    /// Corner `k` of element `e`, in the frame of the record.
    #[must_use]
    pub fn corner(&self, e: usize, k: usize) -> Vec3A {
        let number = k * self.padded_len() + e;
        Vec3A::new(self.x[number], self.y[number], self.z[number])
    }

    /// Corner `k` of element `e` in the texel grid of the record: column and row.
    #[must_use]
    pub fn grid_corner(&self, e: usize, k: usize) -> [f32; 2] {
        let ([i, j], [w, h]) = (self.start[e].map(f32::from), self.size[e].map(f32::from));
        [if k == 1 || k == 2 { i + w } else { i }, if k >= 2 { j + h } else { j }]
    }

    /// Whether element `e` holds the texel of the record in this column and row.
    #[must_use]
    pub fn covers(&self, e: usize, texel: [usize; 2]) -> bool {
        (0..2).all(|axis| {
            let [start, size] = [self.start[e][axis], self.size[e][axis]].map(usize::from);
            (start..start + size).contains(&texel[axis])
        })
    }

    /// The sides that are silhouettes.
    #[must_use]
    pub fn outline(&self) -> &Outline {
        &self.outline
    }

    /// Bytes that the arrays take.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        self.padded_len() * (17 * size_of::<f32>() + 4 + size_of::<Sides>() + size_of::<bool>())
            + self.layer_starts.len() * 4
            + self.outline.memory_bytes()
    }

    fn fill(&mut self, e: usize, block: &Block, grid: &Grid) {
        let samples = grid.samples;
        let n = samples.resolution();
        let [i0, j0] = block.start.map(usize::from);
        let [w, h] = block.size.map(usize::from);
        let texels = || (j0..j0 + h).flat_map(move |j| (i0..i0 + w).map(move |i| j * n + i));
        let corners = [(i0, j0), (i0 + w, j0), (i0 + w, j0 + h), (i0, j0 + h)];
        for (k, (i, j)) in corners.into_iter().enumerate() {
            let corner = grid.corner_point(block, (i, j));
            let number = k * self.padded_len() + e;
            (self.x[number], self.y[number], self.z[number]) = corner.into();
        }
        self.finite[e] = if block.is_infinite() { 0.0 } else { 1.0 };
        let sum: glam::DVec3 = texels().map(|t| samples.radiance[t].as_dvec3()).sum();
        let mean = (sum / (w * h) as f64).as_vec3();
        let far: glam::DVec3 =
            texels().map(|t| samples.radiance[t].as_dvec3() * f64::from(samples.background_share[t])).sum();
        // A black element has no share to speak of; 0 is as good as any.
        self.background_share[e] = narrow(far.element_sum() / sum.element_sum().max(f64::MIN_POSITIVE));
        for (channel, value) in self.radiance.iter_mut().zip(mean.to_array()) {
            channel[e] = value;
        }
        self.start[e] = block.start;
        self.size[e] = block.size;
        self.view_dependent[e] = block.view_dependent;
        self.sides[e] = element_sides(&grid.sides, n, [i0, j0], [w, h]);
    }
}

#[expect(clippy::cast_possible_truncation, reason = "a share in [0, 1]")]
fn narrow(share: f64) -> f32 {
    share as f32
}

/// What the elements of a record are made of, texel by texel.
struct Grid<'a> {
    samples: &'a Samples,
    /// See [`Samples::points`].
    points: Vec<Vec3A>,
    sides: Vec<Sides>,
    /// Directions through the `(n + 1) x (n + 1)` corners of texels.
    corners: Vec<Vec3A>,
}

impl<'a> Grid<'a> {
    fn new(samples: &'a Samples) -> Self {
        let n = samples.resolution();
        let points = samples.points();
        let sides = silhouettes(samples, &points);
        let coordinates: Vec<f32> = (0..=n).map(|i| i as f32 / n as f32).collect();
        let mut corners = Vec::with_capacity((n + 1) * (n + 1));
        for &v in &coordinates {
            append_directions(&mut corners, &coordinates, &[v; MAX_RESOLUTION + 1][..=n]);
        }
        Self { samples, points, sides, corners }
    }

    /// Where the ray through a corner meets the plane of the block; the bare direction for a block at infinity.
    ///
    /// The plane of a surface that curves away, or of one seen at a grazing angle, runs far beyond it, so the distance
    /// stays within those that rays found around the corner. Elements that reach farther would cover too much once the
    /// point moves.
    fn corner_point(&self, block: &Block, (i, j): (usize, usize)) -> Vec3A {
        /// A little room for what lies between the rays.
        const STRETCH: f32 = 1.1;
        /// Metres; the square of what is farther is no number of f32, and would make none of what is computed from it.
        const FARTHEST: f32 = 1e15;
        let direction = self.corners[j * (self.samples.resolution() + 1) + i];
        if block.is_infinite() {
            return direction;
        }
        let (centre, normal) = (block.centre(), block.normal());
        let (nearest, farthest) = self.distances_around(centre, normal, (i, j), block.distances.into());
        // Where there is no normal, the element faces the record.
        let t = if normal == Vec3A::ZERO { farthest } else { plane_distance(centre, normal, direction) };
        direction * t.clamp(nearest / STRETCH, farthest * STRETCH).min(FARTHEST)
    }

    /// Widens the range of the distances of a block by those of the texels around a corner that lie on its plane.
    fn distances_around(&self, centre: Vec3A, normal: Vec3A, (i, j): (usize, usize), range: (f32, f32)) -> (f32, f32) {
        /// Off the plane by less than this share of the distance, a texel runs on from the block.
        const ON_PLANE: f32 = 0.05;
        let n = self.samples.resolution();
        let around = [(i.wrapping_sub(1), j.wrapping_sub(1)), (i, j.wrapping_sub(1)), (i.wrapping_sub(1), j), (i, j)];
        let texels = around.into_iter().filter(|&(x, y)| x < n && y < n).map(|(x, y)| y * n + x);
        texels.filter(|&texel| self.samples.distance[texel].is_finite()).fold(range, |(lo, hi), texel| {
            let distance = self.samples.distance[texel];
            let off = normal.dot(self.points[texel] - centre).abs();
            if off <= ON_PLANE * distance { (lo.min(distance), hi.max(distance)) } else { (lo, hi) }
        })
    }
}

/// A side of an element is a silhouette if it is one for any of the texels along it.
fn element_sides(texel_sides: &[Sides], n: usize, [i0, j0]: [usize; 2], [w, h]: [usize; 2]) -> Sides {
    let row = |j: usize, side| (i0..i0 + w).any(|i| texel_sides[j * n + i].contains(side));
    let column = |i: usize, side| (j0..j0 + h).any(|j| texel_sides[j * n + i].contains(side));
    let mut sides = Sides::NONE;
    let found = [
        (Sides::BOTTOM, row(j0, Sides::BOTTOM)),
        (Sides::TOP, row(j0 + h - 1, Sides::TOP)),
        (Sides::LEFT, column(i0, Sides::LEFT)),
        (Sides::RIGHT, column(i0 + w - 1, Sides::RIGHT)),
    ];
    for (side, is_silhouette) in found {
        if is_silhouette {
            sides = sides | side;
        }
    }
    sides
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn ceiling(n: usize) -> Samples {
        Samples::from_fn(n, |wi| (Vec3::new(wi.x, 1.0, 2.0), 2.0 / wi.z, Vec3A::NEG_Z))
    }

    #[test]
    fn corners_lie_on_the_plane() {
        let elements = Elements::new(&ceiling(32), 8, &MergeSettings::default());
        let mut checked = 0;
        for e in 0..elements.len() {
            for k in 0..4 {
                let c = elements.corner(e, k);
                // At the rim the plane runs off to infinity and the corner is held back.
                if c.normalize().z > 0.5 {
                    assert!((c.z - 2.0).abs() < 1e-5, "element {e} corner {k}: {c}");
                    checked += 1;
                }
            }
        }
        assert!(checked > 100, "most corners are far from the rim");
    }

    #[test]
    fn radiance_and_order_are_kept() {
        let samples = ceiling(16);
        let elements = Elements::new(&samples, 8, &MergeSettings::default());
        let mut sum = glam::DVec3::ZERO;
        for e in 0..elements.len() {
            let texels = f64::from(elements.size[e][0]) * f64::from(elements.size[e][1]);
            sum += Vec3::from_array(std::array::from_fn(|c| elements.radiance[c][e])).as_dvec3() * texels;
        }
        let whole = samples.mean_radiance().as_dvec3() * 256.0;
        assert!((sum - whole).length() < 1e-6 * whole.length(), "{sum} against {whole}");
        let mut next = 0;
        for layer in 0..elements.layer_count() {
            let range = elements.layer(layer);
            assert_eq!(range.start, next, "layers follow each other");
            next = range.end;
        }
        assert_eq!(next, elements.len(), "and hold all");
        assert_eq!(elements.padded_len() % LANES, 0, "padded");
    }

    #[test]
    fn without_a_normal_an_element_faces_the_record() {
        let samples = Samples::from_fn(8, |_| (Vec3::ONE, 3.0, Vec3A::ZERO));
        let elements = Elements::new(&samples, 4, &MergeSettings::default());
        assert_eq!(elements.len(), 64, "nothing merges");
        for e in 0..64 {
            assert!((elements.corner(e, 1).length() - 3.0).abs() < 1e-5, "at the distance of its ray");
        }
    }

    #[test]
    fn the_surroundings_are_directions() {
        let sky = Samples::from_fn(8, |wi| (Vec3::ONE, f32::INFINITY, -wi));
        let elements = Elements::new(&sky, 4, &MergeSettings::default());
        for e in 0..elements.len() {
            assert_eq!(elements.finite[e], 0.0, "at infinity");
            for k in 0..4 {
                assert!((elements.corner(e, k).length() - 1.0).abs() < 1e-5, "unit directions");
            }
        }
        assert_eq!(elements.layer(3).len(), elements.len(), "all in the last layer");
    }
}
