//! Merging of neighbouring texels into s-elements, in alternating passes along rows and columns (paper, section 5.2).

use glam::Vec3A;

use crate::Samples;

/// When two neighbouring blocks of texels may become one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MergeSettings {
    /// Largest number of texels along a side of a block; 1 switches merging off. Long straight edges bend when they are
    /// projected, and the error grows with the square of their length.
    pub max_side: u8,
    /// Smallest cosine between the normals.
    pub min_normal_cos: f32,
    /// Largest distance of one block's centre from the plane of the other, as a share of its distance from the record.
    pub plane_tolerance: f32,
    /// Largest contrast of radiance, |a - b| / (a + b) by luminance. Above 1 it never hinders a merge, which is enough where
    /// only irradiance is wanted; a glossy lobe sees the mean of an element and wants less.
    pub max_contrast: f32,
}

impl Default for MergeSettings {
    /// Sides of up to 4 texels, normals within 10 degrees, planes within 2 % of the distance, any contrast.
    fn default() -> Self {
        Self { max_side: 4, min_normal_cos: 0.985, plane_tolerance: 0.02, max_contrast: 2.0 }
    }
}

/// A rectangle of texels on one plane: the seed of an s-element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Block {
    /// First column and row.
    pub start: [u8; 2],
    /// Number of columns and rows.
    pub size: [u8; 2],
    /// Depth layer of all its texels.
    pub layer: u8,
    /// Sum of the hit points, in the frame of the record.
    pub(crate) point_sum: Vec3A,
    /// Sum of the normals.
    pub(crate) normal_sum: Vec3A,
    /// Sum of the luminances.
    luminance_sum: f32,
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

    fn agrees(&self, other: &Self, settings: &MergeSettings) -> bool {
        let kind = |block: &Self| (block.layer, block.infinite, block.view_dependent);
        if kind(self) != kind(other) {
            return false;
        }
        let (la, lb) = (self.luminance_sum / self.count(), other.luminance_sum / other.count());
        if (la - lb).abs() > settings.max_contrast * (la + lb) {
            return false;
        }
        if self.infinite {
            return true;
        }
        let (ca, cb) = (self.centre(), other.centre());
        let (na, nb) = (self.normal(), other.normal());
        let limit = settings.plane_tolerance * ca.length().min(cb.length());
        na.dot(nb) >= settings.min_normal_cos && na.dot(cb - ca).abs() <= limit && nb.dot(cb - ca).abs() <= limit
    }

    fn absorb(&mut self, other: &Self, axis: usize) {
        self.size[axis] += other.size[axis];
        self.point_sum += other.point_sum;
        self.normal_sum += other.normal_sum;
        self.luminance_sum += other.luminance_sum;
    }
}

/// Divides the texels into blocks: each texel is in exactly one. `points` and `layers` hold what each texel met and its depth layer.
///
/// A pass along the rows merges each block with its right neighbour of the same rows, once; then a pass along the columns does
/// the same downwards. Sides so double from pass to pass and blocks stay compact. Ends when neither pass merges anything.
pub(crate) fn merge(samples: &Samples, points: &[Vec3A], layers: &[u8], settings: &MergeSettings) -> Vec<Block> {
    let n = samples.resolution();
    let mut blocks: Vec<Block> = (0..n * n).map(|texel| single(samples, points, layers, texel)).collect();
    // The block that holds each texel.
    let mut owner: Vec<u16> = (0..n * n).map(|texel| u16::try_from(texel).expect("n <= 64")).collect();
    let mut dead = vec![false; n * n];
    let mut idle = 0;
    let mut axis = 0;
    while idle < 2 {
        let merged = pass(&mut blocks, &mut owner, &mut dead, n, axis, settings);
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
        point_sum: points[texel],
        normal_sum: samples.normal[texel].into(),
        luminance_sum: (l.x + l.y + l.z) / 3.0,
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
            && a.size[axis] == b.size[axis]
            && a.size[axis] + b.size[axis] <= settings.max_side;
        if !(fits && a.agrees(&b, settings)) {
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

    #[test]
    fn every_texel_is_in_exactly_one_block() {
        for n in [1, 7, 16, 33] {
            let samples = Samples::from_fn(n, |wi| {
                let wall = if wi.x > 0.4 { 1.0 / wi.x } else { f32::INFINITY };
                let roof = 2.0 / wi.z;
                if wall < roof { (Vec3::X, wall, Vec3A::NEG_X) } else { (Vec3::Y, roof, Vec3A::NEG_Z) }
            });
            let mut layers = vec![0; n * n];
            crate::depth_layers(&samples.distance, 8, &mut layers);
            let blocks = merge(&samples, &samples.points(), &layers, &MergeSettings::default());
            let mut covered = vec![0; n * n];
            for b in &blocks {
                for j in 0..b.size[1] {
                    for i in 0..b.size[0] {
                        let texel = usize::from(b.start[1] + j) * n + usize::from(b.start[0] + i);
                        covered[texel] += 1;
                        assert_eq!(layers[texel], b.layer, "one layer a block");
                    }
                }
            }
            assert!(covered.iter().all(|&c| c == 1), "n = {n}");
            assert!(n < 16 || blocks.len() * 3 < n * n * 2, "planes merge: {} of {}", blocks.len(), n * n);
        }
    }

    #[test]
    fn blocks_are_compact() {
        let samples = Samples::from_fn(32, |wi| (Vec3::ONE, 5.0, -wi));
        let layers = vec![0; 32 * 32];
        let open = MergeSettings { min_normal_cos: -1.0, plane_tolerance: 10.0, ..MergeSettings::default() };
        let blocks = merge(&samples, &samples.points(), &layers, &open);
        assert_eq!(blocks.len(), 64, "32 x 32 texels in blocks of 4 x 4");
        assert!(blocks.iter().all(|b| b.size == [4, 4]), "square blocks");
    }

    #[test]
    fn contrast_keeps_blocks_apart() {
        let samples = Samples::from_fn(8, |wi| (Vec3::splat(if wi.x > 0.0 { 1.0 } else { 0.1 }), f32::INFINITY, -wi));
        let strict = MergeSettings { max_contrast: 0.2, max_side: 8, ..MergeSettings::default() };
        let blocks = merge(&samples, &samples.points(), &[0; 64], &strict);
        for b in &blocks {
            assert!(b.start[0] >= 4 || b.start[0] + b.size[0] <= 4, "no block across the edge of light");
        }
    }
}
