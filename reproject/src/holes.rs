//! Holes: one ray for each block of texels with a gap (paper, section 5.3).

use glam::Vec2;

use crate::Workspace;
use crate::masks::{Masks, full_row};

/// A block of texels that some element left open.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Hole {
    column: u8,
    row: u8,
    step: u8,
    /// Number of its texels that nothing fills.
    pub(crate) texels: u16,
}

impl Hole {
    /// Bits of row `row + j` of the block that nothing fills.
    fn open_bits(&self, masks: &Masks, j: usize) -> u64 {
        masks.holes(usize::from(self.row) + j) & (full_row(usize::from(self.step)) << self.column)
    }

    fn rows(&self, n: usize) -> usize {
        usize::from(self.step).min(n - usize::from(self.row))
    }

    /// Calls `f` with the index of each unfilled texel of the block.
    pub(crate) fn for_each_texel(&self, n: usize, masks: &Masks, mut f: impl FnMut(usize)) {
        for j in 0..self.rows(n) {
            let mut bits = self.open_bits(masks, j);
            while bits != 0 {
                f((usize::from(self.row) + j) * n + bits.trailing_zeros() as usize);
                bits &= bits - 1;
            }
        }
    }
}

impl Workspace {
    /// Lists the blocks with gaps of which any texel is `wanted`, and a direction in world space for each: uniformly
    /// through its unfilled texels, which a ray through the block's centre would not be.
    pub(crate) fn find_holes(&mut self, step: u32, seed: u64, wanted: impl Fn(usize) -> bool) {
        let n = self.n;
        let step = (step as usize).clamp(1, n);
        self.holes.clear();
        self.directions.clear();
        for row in (0..n).step_by(step) {
            for column in (0..n).step_by(step) {
                let to_u8 = |x: usize| u8::try_from(x).expect("n <= 64");
                let mut hole = Hole { column: to_u8(column), row: to_u8(row), step: to_u8(step), texels: 0 };
                let texels: u32 = (0..hole.rows(n)).map(|j| hole.open_bits(&self.masks, j).count_ones()).sum();
                if texels == 0 {
                    continue;
                }
                hole.texels = u16::try_from(texels).expect("at most 64 x 64 texels");
                let mut any = false;
                hole.for_each_texel(n, &self.masks, |texel| any |= wanted(texel));
                if !any {
                    continue;
                }
                let random = hash(seed, (row * n + column) as u64);
                let texel = pick(&hole, n, &self.masks, ((random >> 32) * u64::from(texels)) >> 32);
                let jitter = Vec2::new(unit(random), unit(random >> 16));
                let place = (Vec2::new((texel % n) as f32, (texel / n) as f32) + jitter) / n as f32;
                self.holes.push(hole);
                let wi = self.frame.to_world(hemimap::square_to_cosine_hemisphere(place));
                self.directions.push(wi);
            }
        }
    }
}

/// The unfilled texel number `index` of a block.
fn pick(hole: &Hole, n: usize, masks: &Masks, index: u64) -> usize {
    let mut left = index;
    let mut found = 0;
    hole.for_each_texel(n, masks, |texel| {
        if left == 0 {
            found = texel;
        }
        left = left.wrapping_sub(1);
    });
    found
}

/// The low 16 bits as a number in [0, 1), in the middle of its step.
fn unit(bits: u64) -> f32 {
    (f32::from((bits & 0xffff) as u16) + 0.5) / 65536.0
}

/// 64 well mixed bits from a seed and a counter (Steele, Lea, Flood 2014, "Fast splittable pseudorandom number
/// generators").
pub(crate) fn hash(seed: u64, counter: u64) -> u64 {
    let mut x = seed.wrapping_add(counter.wrapping_mul(0x9e37_79b9_7f4a_7c15)).wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_split_mix() {
        // The first outputs for the seed 1234567 (Vigna's reference code, splitmix64.c).
        let expected = [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423];
        assert_eq!([0, 1, 2].map(|counter| hash(1_234_567, counter)), expected);
    }

    #[test]
    fn unit_numbers_are_in_the_middle_of_their_steps() {
        let half = 0.5 / 65536.0;
        let expected = [half, 1.0 / 65536.0 + half, 0.5 + half, 1.0 - half, half];
        assert_eq!([0, 1, 0x8000, 0xffff, 0x1_0000].map(unit), expected);
    }

    /// The places of the rays for the holes of an empty square, in texels.
    fn places(n: usize, step: u32, seed: u64) -> Vec<Vec2> {
        let mut workspace = Workspace::new();
        workspace.n = n;
        workspace.masks = Masks::new(n);
        workspace.find_holes(step, seed, |_| true);
        let to_square = |wi: &glam::Vec3A| hemimap::cosine_hemisphere_to_square(workspace.frame.to_local(*wi));
        workspace.directions.iter().map(|wi| to_square(wi) * n as f32).collect()
    }

    #[test]
    fn rays_go_uniformly_through_their_blocks_and_each_its_own_way() {
        // By tenths of a texel along either axis: 1500 x 16 places in 40 bins.
        let mut bins = [[0u32; 40]; 2];
        for seed in 0..1500 {
            let places = places(16, 4, seed);
            for (block, place) in places.iter().enumerate() {
                let inside = *place - 4.0 * Vec2::new((block % 4) as f32, (block / 4) as f32);
                assert!(inside.min_element() > -1e-4 && inside.max_element() < 4.0001, "block {block}: {inside}");
                for axis in 0..2 {
                    bins[axis][hemimap::texel_index(inside[axis] / 4.0, 40) as usize] += 1;
                }
            }
        }
        for bins in bins {
            let chi_sq: f32 = bins.iter().map(|&count| (count as f32 - 600.0).powi(2) / 600.0).sum();
            assert!(chi_sq < 85.0, "39 degrees of freedom: {chi_sq}");
        }
        // No two blocks share their numbers.
        let jitter: Vec<Vec2> = places(16, 1, 7).iter().map(|place| place.fract()).collect();
        for (k, a) in jitter.iter().enumerate() {
            assert!(jitter[k + 1..].iter().all(|b| a.distance(*b) > 1e-5), "block {k} is not alone");
        }
    }
}
