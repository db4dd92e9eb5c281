//! Merging of neighbouring texels into s-elements, in alternating passes along rows and columns (paper, section 5.2).
//!
//! The paper merges within a depth layer. But layers are there to tell what hides what, and the more of them the
//! better, while a wall that runs through many of them is cut into slivers: so blocks may span layers, and belong to
//! the nearest of theirs. What limits their depth instead is how much they change their shape when the point moves.

use glam::Vec3A;

use crate::Samples;

/// How deep a block of texels may be.
///
/// ```
/// use glam::{Vec3, Vec3A};
/// use radcache::{DepthRange, MergeSettings, Record, RecordSettings, Samples, Validity};
///
/// // A ceiling recedes through many layers towards the horizon.
/// let count = |depth| {
///     let samples = Samples::from_fn(32, |wi| (Vec3::ONE, 2.0 / wi.z, Vec3A::NEG_Z));
///     let settings = RecordSettings { layers: 32, merge: MergeSettings { depth, ..MergeSettings::default() } };
///     let frame = hemimap::Frame::from_normal(Vec3A::Z);
///     Record::new(Vec3A::ZERO, frame, samples, &settings, &Validity::default()).elements().len()
/// };
/// assert!(count(DepthRange::Parallax(0.3)) < count(DepthRange::Layer));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DepthRange {
    /// One depth layer, as in the paper.
    Layer,
    /// Largest difference of 1 / distance between its texels, in units of 1 / harmonic mean distance of the record. A
    /// point that is `d` away from the record sees a texel at the distance `t` turned by about `d / t`, so this bounds
    /// by how much more one end of a block moves than the other.
    Parallax(f32),
}

/// When two neighbouring blocks of texels may become one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MergeSettings {
    /// Largest number of texels along a side of a block; 1 switches merging off. Long straight edges bend when they are
    /// projected, and the error grows with the square of their length.
    pub max_side: u8,
    /// Whether the largest side is half as long nearer than two thirds of the harmonic mean distance: near things are
    /// magnified, and edges bend the more the farther they move. With a `max_side` of 2 or 3 nothing merges there.
    pub adaptive: bool,
    /// Smallest cosine between the normals.
    pub min_normal_cos: f32,
    /// Largest distance of one block's centre from the plane of the other, as a share of its distance from the record.
    pub plane_tolerance: f32,
    /// How deep a block may be.
    pub depth: DepthRange,
    /// Largest contrast of radiance, |a - b| / (a + b) by the means of the channels. Above 1 it never hinders a merge,
    /// which is enough where only irradiance is wanted; a glossy lobe sees the mean of an element and wants less.
    pub max_contrast: f32,
}

impl MergeSettings {
    /// The largest side of a block whose nearest texel is so far away, metres.
    fn max_side_at(&self, distance: f32, harmonic_distance: f32) -> u8 {
        /// Near is what has its distance so many times in the harmonic mean distance of the record.
        const NEAR: f32 = 1.5;
        let is_near = NEAR * distance < harmonic_distance;
        if self.adaptive && is_near { self.max_side / 2 } else { self.max_side }
    }
}

impl Default for MergeSettings {
    /// Sides of up to 4 texels, 2 where they are near, normals within 10 degrees, planes within 2 % of the distance, a
    /// parallax of 0.3, any contrast.
    fn default() -> Self {
        Self {
            max_side: 4,
            adaptive: true,
            min_normal_cos: 0.985,
            plane_tolerance: 0.02,
            depth: DepthRange::Parallax(0.3),
            max_contrast: 2.0,
        }
    }
}

/// A rectangle of texels on one plane: the seed of an s-element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Block {
    /// First column and row.
    pub(crate) start: [u8; 2],
    /// Number of columns and rows.
    pub(crate) size: [u8; 2],
    /// Nearest depth layer of its texels.
    pub(crate) layer: u8,
    /// The farthest one.
    last_layer: u8,
    /// Least and greatest distance of its texels, metres.
    pub(crate) distances: [f32; 2],
    /// Sum of the hit points, in the frame of the record.
    pub(crate) point_sum: Vec3A,
    /// Sum of the normals.
    pub(crate) normal_sum: Vec3A,
    /// Sum of the means of the channels.
    brightness_sum: f32,
    infinite: bool,
    pub(crate) view_dependent: bool,
}

impl Block {
    fn count(&self) -> f32 {
        f32::from(self.size[0]) * f32::from(self.size[1])
    }

    /// Mean hit point, in the frame of the record.
    pub(crate) fn centre(&self) -> Vec3A {
        self.point_sum / self.count()
    }

    /// Mean normal; zero where the normals cancel.
    pub(crate) fn normal(&self) -> Vec3A {
        self.normal_sum.normalize_or_zero()
    }

    /// Whether it lies at infinity.
    pub(crate) fn is_infinite(&self) -> bool {
        self.infinite
    }

    /// Layers and distances of both together.
    fn depth_with(&self, other: &Self) -> ([u8; 2], [f32; 2]) {
        let layers = [self.layer.min(other.layer), self.last_layer.max(other.last_layer)];
        let [near, far] = [self.distances, other.distances];
        (layers, [near[0].min(far[0]), near[1].max(far[1])])
    }

    fn agrees(&self, other: &Self, settings: &MergeSettings, harmonic_distance: f32) -> bool {
        let kind = |block: &Self| (block.infinite, block.view_dependent);
        if kind(self) != kind(other) {
            return false;
        }
        let (la, lb) = (self.brightness_sum / self.count(), other.brightness_sum / other.count());
        if (la - lb).abs() > settings.max_contrast * (la + lb) {
            return false;
        }
        if self.infinite {
            return true;
        }
        let (layers, distances) = self.depth_with(other);
        let is_flat = match settings.depth {
            DepthRange::Layer => layers[0] == layers[1],
            DepthRange::Parallax(most) => harmonic_distance * (1.0 / distances[0] - 1.0 / distances[1]) <= most,
        };
        if !is_flat {
            return false;
        }
        let (ca, cb) = (self.centre(), other.centre());
        let (na, nb) = (self.normal(), other.normal());
        let limit = settings.plane_tolerance * ca.length().min(cb.length());
        na.dot(nb) >= settings.min_normal_cos && na.dot(cb - ca).abs() <= limit && nb.dot(cb - ca).abs() <= limit
    }

    fn absorb(&mut self, other: &Self, axis: usize) {
        ([self.layer, self.last_layer], self.distances) = self.depth_with(other);
        self.size[axis] += other.size[axis];
        self.point_sum += other.point_sum;
        self.normal_sum += other.normal_sum;
        self.brightness_sum += other.brightness_sum;
    }
}

/// Divides the texels into blocks: each texel is in exactly one. `points` and `layers` hold what each texel met and its
/// depth layer.
///
/// A pass along the rows merges each block with its right neighbour of the same rows, once; then a pass along the
/// columns does the same downwards. Sides so about double from pass to pass and blocks stay compact. Ends when neither
/// pass merges anything.
pub(crate) fn merge(samples: &Samples, points: &[Vec3A], layers: &[u8], settings: &MergeSettings) -> Vec<Block> {
    let n = samples.resolution();
    let harmonic_distance = samples.harmonic_distance();
    let mut blocks: Vec<Block> = (0..n * n).map(|texel| single(samples, points, layers, texel)).collect();
    // The block that holds each texel.
    let mut owner: Vec<u16> = (0..n * n).map(|texel| u16::try_from(texel).expect("n <= 64")).collect();
    let mut dead = vec![false; n * n];
    let mut idle = 0;
    let mut axis = 0;
    while idle < 2 {
        let merged = pass(&mut blocks, &mut owner, &mut dead, n, axis, settings, harmonic_distance);
        idle = if merged { 0 } else { idle + 1 };
        axis = 1 - axis;
    }
    let mut alive = dead.iter().map(|d| !d);
    blocks.retain(|_| alive.next().unwrap_or(false));
    blocks
}

fn single(samples: &Samples, points: &[Vec3A], layers: &[u8], texel: usize) -> Block {
    let n = samples.resolution();
    let to_u8 = |x: usize| u8::try_from(x).expect("n <= 64");
    let l = samples.radiance[texel];
    Block {
        start: [to_u8(texel % n), to_u8(texel / n)],
        size: [1, 1],
        layer: layers[texel],
        last_layer: layers[texel],
        distances: [samples.distance[texel]; 2],
        point_sum: points[texel],
        normal_sum: samples.normal[texel].into(),
        brightness_sum: (l.x + l.y + l.z) / 3.0,
        infinite: samples.distance[texel].is_infinite(),
        view_dependent: samples.view_dependent[texel],
    }
}

/// One pass along rows (`axis` 0) or columns (1); tells whether anything was merged.
fn pass(
    blocks: &mut [Block],
    owner: &mut [u16],
    dead: &mut [bool],
    n: usize,
    axis: usize,
    settings: &MergeSettings,
    harmonic_distance: f32,
) -> bool {
    let mut merged = false;
    for first in 0..blocks.len() {
        if dead[first] {
            continue;
        }
        let a = blocks[first];
        // A block that grew in this pass already waits for the next one, so that sides grow evenly.
        let mut corner = [usize::from(a.start[0]), usize::from(a.start[1])];
        corner[axis] += usize::from(a.size[axis]);
        if corner[axis] >= n {
            continue;
        }
        let second = usize::from(owner[corner[1] * n + corner[0]]);
        let b = blocks[second];
        let fits = a.start[1 - axis] == b.start[1 - axis]
            && a.size[1 - axis] == b.size[1 - axis]
            && a.size[axis] + b.size[axis]
                <= settings.max_side_at(a.distances[0].min(b.distances[0]), harmonic_distance);
        if !(fits && a.agrees(&b, settings, harmonic_distance)) {
            continue;
        }
        blocks[first].absorb(&b, axis);
        dead[second] = true;
        for j in 0..usize::from(b.size[1]) {
            for i in 0..usize::from(b.size[0]) {
                let texel = (usize::from(b.start[1]) + j) * n + usize::from(b.start[0]) + i;
                owner[texel] = u16::try_from(first).expect("n <= 64");
            }
        }
        merged = true;
    }
    merged
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// A wall beside the record, and a roof.
    fn wall_and_roof(n: usize) -> Samples {
        Samples::from_fn(n, |wi| {
            let wall = if wi.x > 0.4 { 1.0 / wi.x } else { f32::INFINITY };
            let roof = 2.0 / wi.z;
            if wall < roof { (Vec3::X, wall, Vec3A::NEG_X) } else { (Vec3::Y, roof, Vec3A::NEG_Z) }
        })
    }

    /// The blocks of samples in 32 layers, and the layer of each texel.
    fn blocks_of(samples: &Samples, depth: DepthRange) -> (Vec<Block>, Vec<u8>) {
        let mut layers = vec![0; samples.distance.len()];
        crate::depth_layers(&samples.distance, 32, &mut layers);
        let settings = MergeSettings { depth, ..MergeSettings::default() };
        (merge(samples, &samples.points(), &layers, &settings), layers)
    }

    fn texels_of(block: &Block, n: usize) -> impl Iterator<Item = usize> {
        let ([i, j], [w, h]) = (block.start.map(usize::from), block.size.map(usize::from));
        (j..j + h).flat_map(move |j| (i..i + w).map(move |i| j * n + i))
    }

    #[test]
    fn every_texel_is_in_exactly_one_block() {
        for (n, depth) in
            [1, 7, 16, 33].into_iter().flat_map(|n| [(n, DepthRange::Layer), (n, DepthRange::Parallax(0.3))])
        {
            let (blocks, layers) = blocks_of(&wall_and_roof(n), depth);
            let mut covered = vec![0; n * n];
            for block in &blocks {
                texels_of(block, n).for_each(|texel| covered[texel] += 1);
                let nearest = texels_of(block, n).map(|texel| layers[texel]).min();
                assert_eq!(nearest, Some(block.layer), "a block belongs to its nearest layer");
            }
            assert!(covered.iter().all(|&c| c == 1), "n = {n}");
            assert!(n < 16 || blocks.len() * 4 < n * n * 3, "planes merge: {} of {}", blocks.len(), n * n);
        }
    }

    #[test]
    fn blocks_are_no_deeper_than_is_allowed() {
        let n = 32;
        let samples = wall_and_roof(n);
        let (in_layers, layers) = blocks_of(&samples, DepthRange::Layer);
        for block in &in_layers {
            assert!(texels_of(block, n).all(|texel| layers[texel] == block.layer), "one layer a block");
        }
        let mut counts = vec![in_layers.len()];
        for most in [0.1, 0.3, 1.0] {
            let (blocks, _) = blocks_of(&samples, DepthRange::Parallax(most));
            for block in &blocks {
                let inverse = || texels_of(block, n).map(|texel| samples.harmonic_distance() / samples.distance[texel]);
                let (low, high) = inverse().fold((f32::INFINITY, 0.0f32), |(low, high), x| (low.min(x), high.max(x)));
                assert!(high - low <= most * 1.001, "{high} and {low} differ by more than {most}");
            }
            counts.push(blocks.len());
        }
        assert!(counts.is_sorted_by(|more, less| more > less), "the deeper they may be, the fewer: {counts:?}");
        assert!(2 * counts[2] < counts[0], "layers cut them into more than twice as many: {counts:?}");
    }

    #[test]
    fn blocks_are_compact() {
        let samples = Samples::from_fn(32, |wi| (Vec3::ONE, 5.0, -wi));
        let layers = vec![0; 32 * 32];
        let open =
            MergeSettings { adaptive: false, min_normal_cos: -1.0, plane_tolerance: 10.0, ..MergeSettings::default() };
        let blocks = merge(&samples, &samples.points(), &layers, &open);
        assert_eq!(blocks.len(), 64, "32 x 32 texels in blocks of 4 x 4");
        assert!(blocks.iter().all(|b| b.size == [4, 4]), "square blocks");
    }

    #[test]
    fn near_blocks_are_finer() {
        let n = 32;
        // Three walls of constant distance: 1, 2 and 8 m. The harmonic mean of a seventh, a half and the rest is 2.3 m.
        let samples = Samples::from_fn(n, |wi| {
            let distance = if wi.x < -0.6 {
                1.0
            } else if wi.x < 0.2 {
                2.0
            } else {
                8.0
            };
            (Vec3::ONE, distance, -wi)
        });
        let sides = |adaptive: bool| {
            let settings = MergeSettings {
                adaptive,
                min_normal_cos: -1.0,
                plane_tolerance: 10.0,
                depth: DepthRange::Parallax(0.01),
                ..MergeSettings::default()
            };
            let blocks = merge(&samples, &samples.points(), &vec![0; n * n], &settings);
            [1.0, 2.0, 8.0].map(|distance| {
                let there = blocks.iter().filter(|block| block.distances[0] == distance);
                there.map(|block| block.size[0].max(block.size[1])).max().unwrap()
            })
        };
        assert_eq!((sides(true), sides(false)), ([2, 4, 4], [4, 4, 4]), "texels along the longest side, by distance");
    }

    #[test]
    fn contrast_keeps_blocks_apart() {
        let samples = Samples::from_fn(8, |wi| (Vec3::splat(if wi.x > 0.0 { 1.0 } else { 0.1 }), f32::INFINITY, -wi));
        let blocks = |max_contrast| {
            let settings = MergeSettings { max_contrast, max_side: 8, ..MergeSettings::default() };
            merge(&samples, &samples.points(), &[0; 64], &settings)
        };
        let across = |blocks: &[Block]| blocks.iter().filter(|b| b.start[0] < 4 && b.start[0] + b.size[0] > 4).count();
        let (strict, lax) = (blocks(0.2), blocks(2.0));
        assert!(across(&strict) == 0 && across(&lax) > 0, "{} and {}", across(&strict), across(&lax));
        assert!(strict.len() < 32, "what is evenly bright merges: {} blocks", strict.len());
    }
}
