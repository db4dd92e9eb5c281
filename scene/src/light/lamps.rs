//! Lamps as their choice sees them: side by side, so that several are looked at in the time of one.

use fearless_simd::{Level, Select, Simd, SimdBase, SimdFloat, dispatch, f32x8};
use glam::Vec3A;

use super::tree::{Emitter, Node, Shape};

/// Most groups of lamps. To look at all of them takes no longer than a way through a tree of as many lamps, and leaves
/// half of the noise.
pub(super) const MOST_GROUPS: usize = 128;

/// Groups that are looked at together: a block.
pub(super) const LANES: usize = 8;

/// Most blocks.
pub(super) const MOST_BLOCKS: usize = MOST_GROUPS / LANES;

/// Share of the root of a lamp's area that is added to heights over its plane.
const LIFT: f32 = 0.2;

/// A number for each of some groups.
pub(super) type Lanes = [f32; LANES];

/// Lamps, and branches of a tree of them, each a group: first the lamps, then from the next full block on the branches.
#[derive(Debug, Clone)]
pub(super) struct Lamps {
    single: Vec<Block<Single>>,
    branches: Vec<Block<Branch>>,
    level: Level,
}

/// Where the lamps are, and what they are like.
#[derive(Debug, Clone)]
struct Block<T> {
    centre: [Lanes; 3],
    like: T,
}

/// One lamp a lane.
#[derive(Debug, Clone)]
struct Single {
    /// Zero where it shines to all sides.
    normal: [Lanes; 3],
    /// Added to the height; infinite where it shines to all sides.
    lift: Lanes,
    /// Intensity towards the brightest side, summed over the channels.
    intensity: Lanes,
    /// Added to the squared distance.
    softening: Lanes,
}

/// Several lamps a lane: see [`Shape`].
#[derive(Debug, Clone)]
struct Branch {
    axis: [Lanes; 3],
    cosine: Lanes,
    sine: Lanes,
    radius_sq: Lanes,
    intensity: Lanes,
}

impl Lamps {
    /// Up to [`MOST_BLOCKS`] of both.
    pub(super) fn new(lamps: &[Emitter], branches: &[Node]) -> Self {
        let single: Vec<_> = lamps.chunks(LANES).map(Block::of_lamps).collect();
        let branches: Vec<_> = branches.chunks(LANES).map(Block::of_branches).collect();
        assert!(single.len() + branches.len() <= MOST_BLOCKS, "no lamp may be left out");
        Self { single, branches, level: Level::new() }
    }

    /// Returns the irradiance that the groups of each block may bring to `p` together, summed over the channels.
    #[inline]
    pub(super) fn irradiance(&self, p: Vec3A) -> [f32; MOST_BLOCKS] {
        dispatch!(self.level, simd => {
            let mut sums = [0.0; MOST_BLOCKS];
            let (of_single, of_branches) = sums.split_at_mut(self.single.len());
            for (sum, block) in of_single.iter_mut().zip(&self.single) {
                *sum = sum_of(block.irradiance(simd, p));
            }
            for (sum, block) in of_branches.iter_mut().zip(&self.branches) {
                *sum = sum_of(block.irradiance(p));
            }
            sums
        })
    }

    /// Returns the irradiance that each group of a block may bring to `p`.
    #[inline]
    pub(super) fn irradiance_of(&self, block: usize, p: Vec3A) -> Lanes {
        dispatch!(self.level, simd => match self.single.get(block) {
            Some(lamps) => lamps.irradiance(simd, p),
            None => self.branches[block - self.single.len()].irradiance(p),
        })
    }

    pub(super) fn memory_bytes(&self) -> usize {
        self.single.capacity() * size_of::<Block<Single>>() + self.branches.capacity() * size_of::<Block<Branch>>()
    }
}

/// Returns what [`LANES`] of them have of something; 0 where there is none.
fn lanes<T>(items: &[T], value: impl Fn(&T) -> f32) -> Lanes {
    std::array::from_fn(|i| items.get(i).map_or(0.0, &value))
}

/// The same of vectors.
fn vectors<T>(items: &[T], value: impl Fn(&T) -> [f32; 3]) -> [Lanes; 3] {
    [0, 1, 2].map(|axis| lanes(items, |item| value(item)[axis]))
}

/// Returns the sum: halves first, which takes fewer instructions than one after the other.
#[inline(always)]
fn sum_of(lanes: Lanes) -> f32 {
    let half: [f32; 4] = std::array::from_fn(|i| lanes[i] + lanes[i + 4]);
    (half[0] + half[2]) + (half[1] + half[3])
}

impl<T> Block<T> {
    #[inline(always)]
    fn offset(&self, p: Vec3A, lane: usize) -> [f32; 3] {
        let p = p.to_array();
        [0, 1, 2].map(|axis| p[axis] - self.centre[axis][lane])
    }
}

impl Block<Single> {
    /// Up to [`LANES`] of them; the rest is dark.
    fn of_lamps(emitters: &[Emitter]) -> Self {
        use std::f32::consts::FRAC_1_PI;
        let is_flat = |emitter: &Emitter| emitter.normal.is_some();
        let like = Single {
            normal: vectors(emitters, |emitter| emitter.normal.map_or([0.0; 3], |normal| normal.to_array())),
            lift: lanes(emitters, |emitter| if is_flat(emitter) { LIFT * emitter.area.sqrt() } else { f32::INFINITY }),
            intensity: lanes(emitters, |emitter| emitter.flux * FRAC_1_PI),
            softening: lanes(emitters, |emitter| emitter.area * FRAC_1_PI * if is_flat(emitter) { 1.0 } else { 0.25 }),
        };
        Self { centre: vectors(emitters, |emitter| emitter.centre.to_array()), like }
    }

    /// Returns the irradiance that each may bring to `p`.
    #[inline(always)]
    fn irradiance<S: Simd>(&self, simd: S, p: Vec3A) -> Lanes {
        let Single { normal, lift, intensity, softening } = &self.like;
        let lanes = |values: &Lanes| f32x8::load_array_ref(simd, values);
        let offset = |axis: usize| f32x8::splat(simd, p[axis]) - lanes(&self.centre[axis]);
        let [x, y, z] = [offset(0), offset(1), offset(2)];
        let height = x * lanes(&normal[0]) + y * lanes(&normal[1]) + z * lanes(&normal[2]);
        let distance_sq = x * x + y * y + z * z + f32::MIN_POSITIVE;
        let distance = distance_sq.sqrt();
        let lift = lanes(lift);
        let lifted = (height + lift).min(distance);
        let irradiance = lanes(intensity) * lifted / (distance * (distance_sq + lanes(softening)));
        // There is no bound at a point light itself.
        let is_lit = height.simd_gt(0.0) | lift.simd_eq(f32::INFINITY);
        (is_lit & irradiance.simd_lt(f32::MAX)).select(irradiance, f32x8::splat(simd, 0.0)).to_array()
    }
}

impl Block<Branch> {
    /// Up to [`LANES`] of them; the rest is dark.
    fn of_branches(nodes: &[Node]) -> Self {
        let like = Branch {
            axis: vectors(nodes, |node| node.shape.axis),
            cosine: lanes(nodes, |node| node.shape.cosine),
            sine: lanes(nodes, |node| node.shape.sine),
            radius_sq: lanes(nodes, |node| node.shape.radius_sq),
            intensity: lanes(nodes, |node| node.flux * std::f32::consts::FRAC_1_PI),
        };
        Self { centre: vectors(nodes, |node| node.centre.to_array()), like }
    }

    /// Returns about the irradiance that each may bring to `p`.
    #[inline(always)]
    fn irradiance(&self, p: Vec3A) -> Lanes {
        let Branch { axis, cosine, sine, radius_sq, intensity } = &self.like;
        std::array::from_fn(|i| {
            let axis = [0, 1, 2].map(|k| axis[k][i]);
            let shape = Shape { radius_sq: radius_sq[i], axis, sine: sine[i], cosine: cosine[i] };
            let irradiance = intensity[i] * shape.importance(self.offset(p, i));
            // A lane without a branch has 0 times infinity at the origin.
            if irradiance < f32::MAX { irradiance } else { 0.0 }
        })
    }
}
