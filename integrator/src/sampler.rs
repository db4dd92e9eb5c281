//! Uniform numbers: an Owen-scrambled Sobol sequence for a pixel's samples, and a small generator where no structure is
//! wanted.
//!
//! A path uses an unbounded number of dimensions. Each bounce therefore draws blocks of the first two or four Sobol
//! dimensions, every block shuffled and scrambled by a seed of its own ("padding", Burley 2020): within a block the
//! samples of a pixel are stratified, between blocks they are independent.
//!
//! # Source
//!
//! Brent Burley, *Practical Hash-based Owen Scrambling*, JCGT 9(4), 2020. Melissa O'Neill, *PCG: A Family of Simple
//! Fast Space-Efficient Statistically Good Algorithms for Random Number Generation*, 2014.

use glam::{UVec2, Vec2};
use sobol_burley::parts::owen_scramble_rev;

/// The sequence repeats after so many points; beyond, another scramble takes over.
const SEQUENCE_LENGTH: u32 = 1 << 16;

/// Mixes a number so that neighbouring ones become unrelated (the finaliser of SplitMix64, Steele et al. 2014).
#[must_use]
pub const fn hash(x: u64) -> u64 {
    let mut x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Mixes two numbers; the order matters.
#[must_use]
pub const fn hash_pair(a: u64, b: u64) -> u64 {
    hash(hash(a) ^ b)
}

/// Returns the upper half, the better mixed one.
const fn upper(x: u64) -> u32 {
    (x >> 32) as u32
}

/// Returns the number in [0, 1) of the 24 highest bits.
const fn unit_interval(bits: u64) -> f32 {
    (bits >> 40) as f32 * (1.0 / 16_777_216.0)
}

/// Low-discrepancy numbers of one sample of one pixel, all in [0, 1).
#[derive(Debug, Clone)]
pub struct Sampler {
    /// Pixel, seed and which stretch of 65,536 samples.
    key: u64,
    /// `key` and the bounce, hashed once more: the first half of [`hash_pair`].
    bounce_hash: u64,
    /// The sample within its stretch.
    index: u32,
    /// Its bits in reverse.
    reversed_index: u32,
    /// Blocks drawn in this bounce.
    block: u32,
    values: [f32; 4],
    used: usize,
    /// Whether there are no other samples to be stratified with.
    is_alone: bool,
}

impl Sampler {
    /// Starts the numbers of sample number `sample` of `pixel`, at bounce 0. A pixel may be any thing that has samples,
    /// such as the index of a record; another `seed` gives independent numbers. There is no limit to the number of
    /// samples.
    #[must_use]
    pub const fn new(seed: u64, pixel: u64, sample: u32) -> Self {
        let key = hash_pair(hash_pair(seed, pixel), (sample / SEQUENCE_LENGTH) as u64);
        Self::with_key(key, sample % SEQUENCE_LENGTH)
    }

    /// Starts the numbers of the only sample of `pixel`: unrelated ones, for they are cheaper and there is nothing to
    /// stratify.
    #[must_use]
    pub const fn alone(seed: u64, pixel: u64) -> Self {
        Self { is_alone: true, ..Self::new(seed, pixel, 0) }
    }

    /// Jumps to the numbers of a bounce, so that they are the same dimensions however many the bounces before have
    /// used.
    pub const fn start_bounce(&mut self, bounce: u32) {
        self.bounce_hash = hash(if bounce == 0 { self.key } else { hash_pair(self.key, bounce as u64) });
        self.block = 0;
        self.used = 4;
    }

    /// Starts numbers of their own for a path that branches off here.
    #[must_use]
    pub const fn split(&self) -> Self {
        const BRANCH: u64 = 0x6272_616e_6368;
        let key = hash_pair(hash(self.bounce_hash ^ BRANCH), self.block as u64);
        Self { is_alone: self.is_alone, ..Self::with_key(key, self.index) }
    }

    /// Starts numbers of their own for `count` paths that branch off here, stratified over all of them and all samples
    /// of the pixel.
    pub fn split_into(&mut self, count: u32) -> impl Iterator<Item = Self> + use<> {
        let parent = self.split();
        self.block += 1;
        self.used = 4;
        (0..count).map(move |number| {
            let index = u64::from(parent.index) * u64::from(count) + u64::from(number);
            let length = u64::from(SEQUENCE_LENGTH);
            let key = hash_pair(parent.key, index / length);
            #[expect(clippy::cast_possible_truncation, reason = "below the length")]
            let index = (index % length) as u32;
            Self::with_key(key, index)
        })
    }

    /// Returns the next four numbers, stratified together, and gives up what is left of the block before.
    pub fn next_4d(&mut self) -> [f32; 4] {
        let seed = self.next_block();
        if self.is_alone {
            let more = hash(seed);
            return [seed, seed << 32, more, more << 32].map(unit_interval);
        }
        let seed = upper(seed);
        sobol_burley::sample_4d(self.index, 0, seed)
    }

    /// Returns a pair between two numbers of which a choice is made: these are 1/2 where there is no `choice`, and the
    /// pair costs less then.
    pub(crate) fn next_4d_for(&mut self, choice: bool) -> [f32; 4] {
        if choice {
            return self.next_4d();
        }
        let pair = self.next_pair();
        [0.5, pair.x, pair.y, 0.5]
    }

    /// Returns a pair of its own, stratified as well as two numbers can be: of 2^k samples from a multiple of 2^k on,
    /// each elementary interval of the square holds its share (a (0, 2)-sequence). Costs half of [`Sampler::next_4d`].
    pub fn next_pair(&mut self) -> Vec2 {
        if self.is_alone {
            let [x, y, ..] = self.next_4d();
            return Vec2::new(x, y);
        }
        let seed = self.next_block();
        let index = owen_scramble_rev(self.reversed_index, upper(seed)).reverse_bits();
        let more = hash(seed);
        // The first dimension of Sobol's sequence reverses the digits of the index, the second one sums them by
        // Pascal's triangle first. Both are reversed as one number of 64 bits, which puts the second one above.
        let x = owen_scramble_rev(index, upper(more));
        let y = owen_scramble_rev(pascal(index), upper(more << 32));
        let both = (u64::from(x) << 32 | u64::from(y)).reverse_bits();
        Vec2::new(unit_interval(both << 32), unit_interval(both))
    }

    const fn with_key(key: u64, index: u32) -> Self {
        Self {
            key,
            bounce_hash: hash(key),
            index,
            reversed_index: index.reverse_bits(),
            block: 0,
            values: [0.0; 4],
            used: 4,
            is_alone: false,
        }
    }

    /// Returns the key of the next block, and gives up what is left of the one before.
    const fn next_block(&mut self) -> u64 {
        let key = hash(self.bounce_hash ^ self.block as u64);
        self.block += 1;
        self.used = 4;
        key
    }

    /// Returns the next number.
    pub fn next_1d(&mut self) -> f32 {
        if self.used == 4 {
            self.values = self.next_4d();
            self.used = 0;
        }
        self.used += 1;
        self.values[self.used - 1]
    }
}

/// Returns the place of `u` in cell `number`, row by row, of the `side` x `side` ones that the unit square is cut into,
/// in [0, 1)^2 as `u` is.
pub(crate) fn in_cell(number: u32, side: u32, u: Vec2) -> Vec2 {
    const BELOW_ONE: Vec2 = Vec2::splat(1.0 - 0.5 * f32::EPSILON);
    ((UVec2::new(number % side, number / side).as_vec2() + u) / side as f32).min(BELOW_ONE)
}

/// Returns the number whose bit i is the sum, modulo 2, of the bits j with C(j, i) odd: by Lucas those j that have all
/// bits of i.
const fn pascal(x: u32) -> u32 {
    let x = x ^ ((x >> 1) & 0x5555_5555);
    let x = x ^ ((x >> 2) & 0x3333_3333);
    let x = x ^ ((x >> 4) & 0x0f0f_0f0f);
    let x = x ^ ((x >> 8) & 0x00ff_00ff);
    x ^ (x >> 16)
}

/// A stream of unrelated numbers: PCG32, 16 bytes and a multiplication a number.
#[derive(Debug, Clone)]
pub struct Rng {
    state: u64,
    increment: u64,
}

impl Rng {
    /// Starts stream number `stream`: each is a sequence of its own.
    #[must_use]
    pub const fn new(seed: u64, stream: u64) -> Self {
        Self { state: hash_pair(seed, stream), increment: hash(stream) | 1 }
    }

    /// Returns 32 uniform bits.
    pub const fn next_u32(&mut self) -> u32 {
        let old = self.state;
        self.state = old.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(self.increment);
        #[expect(clippy::cast_possible_truncation, reason = "PCG's output keeps 32 bits")]
        let word = (((old >> 18) ^ old) >> 27) as u32;
        word.rotate_right((old >> 59) as u32)
    }

    /// Returns a number in [0, 1), a multiple of 2^-24.
    pub const fn next_1d(&mut self) -> f32 {
        unit_interval((self.next_u32() as u64) << 32)
    }

    /// Returns a pair of numbers in [0, 1).
    pub const fn next_2d(&mut self) -> Vec2 {
        let x = self.next_1d();
        Vec2::new(x, self.next_1d())
    }
}

#[cfg(test)]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "cells of numbers in [0, 1)")]
mod tests {
    use super::*;

    #[test]
    fn sample_65536_differs_from_sample_0() {
        let first = |sample| Sampler::new(7, 3, sample).next_4d();
        assert_ne!(first(0), first(65_536), "the sequence must not repeat where sobol_burley ends");
        assert_ne!(first(65_535), first(131_071), "nor in its last point");
        assert_eq!(first(65_536), first(65_536), "but each sample is always the same");
    }

    #[test]
    fn sixteen_samples_fall_in_sixteen_strata() {
        // Base-2 nets: any 16 consecutive points from a multiple of 16 have one point in each of 16 rows, columns and 4
        // x 4 cells.
        for pixel in 0..50 {
            for bounce in [0, 1, 9] {
                let mut cells = [0u32; 3];
                for sample in 64..80 {
                    let mut sampler = Sampler::new(1, pixel, sample);
                    sampler.start_bounce(bounce);
                    let u = sampler.next_pair();
                    let cell = |x: f32, n: f32| (x * n) as u32;
                    cells[0] |= 1 << cell(u.x, 16.0);
                    cells[1] |= 1 << cell(u.y, 16.0);
                    cells[2] |= 1 << (4 * cell(u.y, 4.0) + cell(u.x, 4.0));
                }
                assert_eq!(cells, [0xffff; 3], "pixel {pixel}, bounce {bounce}");
            }
        }
    }

    #[test]
    fn branches_of_all_samples_are_stratified_together() {
        let mut rows = 0_u64;
        for sample in 0..16 {
            let mut parent = Sampler::new(5, 2, sample);
            let before = parent.clone().next_1d();
            for mut branch in parent.split_into(4) {
                rows |= 1 << (branch.next_pair().x * 64.0) as u32;
                assert_ne!(branch.next_1d(), before, "numbers of their own");
            }
        }
        assert_eq!(rows, u64::MAX, "64 branches in 64 rows");
        let firsts =
            |sampler: &mut Sampler| sampler.split_into(2).map(|mut branch| branch.next_1d()).collect::<Vec<_>>();
        let mut parent = Sampler::new(5, 2, 65_535);
        assert_ne!(firsts(&mut parent), firsts(&mut parent), "and others the second time");
    }

    #[test]
    fn pairs_fall_in_every_elementary_interval() {
        // 64 samples: one in each cell of every grid of 2^a x 2^(6 - a) cells.
        for pixel in 0..50 {
            let points: Vec<Vec2> = (128..192).map(|sample| Sampler::new(1, pixel, sample).next_pair()).collect();
            for a in 0..=6 {
                let (columns, rows) = (1u32 << a, 1u32 << (6 - a));
                let cell = |u: &Vec2| (u.y * rows as f32) as u32 * columns + (u.x * columns as f32) as u32;
                let met = points.iter().fold(0u64, |met, u| met | 1 << cell(u));
                assert_eq!(met, u64::MAX, "pixel {pixel}, {columns} x {rows}");
            }
        }
    }

    #[test]
    fn no_choice_leaves_the_pair() {
        let sampler = Sampler::new(1, 2, 3);
        let pair = sampler.clone().next_pair();
        assert_eq!(sampler.clone().next_4d_for(false), [0.5, pair.x, pair.y, 0.5]);
        assert_eq!(sampler.clone().next_4d_for(true), sampler.clone().next_4d());
        let alone = Sampler::alone(1, 2);
        let [x, y, ..] = alone.clone().next_4d();
        assert_eq!(alone.clone().next_pair(), Vec2::new(x, y), "which one alone has the cheap way");
    }

    #[test]
    fn pairs_are_those_of_sobol() {
        for index in [1u32, 2, 3, 5, 1000, 65_535] {
            let known = sobol_burley::parts::sobol_rev(index.reverse_bits(), 1);
            assert_eq!(pascal(index), known, "index {index}");
        }
    }

    #[test]
    fn a_bounce_has_its_numbers_whatever_was_used_before() {
        let mut a = Sampler::new(1, 2, 3);
        let mut b = a.clone();
        a.next_1d();
        a.next_pair();
        a.next_4d();
        a.start_bounce(1);
        b.start_bounce(1);
        let values = (0..5).map(|_| a.next_1d()).collect::<Vec<_>>();
        assert_eq!(values, (0..5).map(|_| b.next_1d()).collect::<Vec<_>>(), "bounce 1");
        a.start_bounce(2);
        assert_ne!(values[0], a.next_1d(), "bounces differ");
    }

    #[test]
    fn numbers_of_one_alone_are_uniform_and_unrelated() {
        const COUNT: u64 = 4096;
        let (mut means, mut sums) = ([0.0; 4], [[0.0; 2]; 4]);
        for pixel in 0..COUNT {
            let mut sampler = Sampler::alone(3, pixel);
            let first = sampler.next_4d();
            sampler.start_bounce(1);
            let second = sampler.next_4d();
            assert!(first.iter().chain(&second).all(|u| (0.0..1.0).contains(u)), "{first:?} {second:?}");
            for axis in 0..4 {
                let share = |x: f32| f64::from(x) / COUNT as f64;
                means[axis] += share(12.0_f32.sqrt() * (first[axis] - 0.5));
                for (sum, others) in sums[axis].iter_mut().zip([first, second]) {
                    *sum += share(12.0 * (first[axis] - 0.5) * (others[(axis + 1) % 4] - 0.5));
                }
            }
        }
        // As below: within a block, and between two.
        assert!(means.iter().all(|mean| mean.abs() < 4.5 / 64.0), "means {means:?}");
        assert!(sums.iter().flatten().all(|sum| sum.abs() < 4.5 / 64.0), "correlations {sums:?}");
    }

    #[test]
    fn seeds_and_pixels_are_uncorrelated() {
        // Correlation of n = 4096 pairs of uniform numbers has deviation 1/64; 4.5 of them.
        for (da, db) in [(1, 0), (0, 1)] {
            let mut sum = 0.0;
            for pixel in 0..4096 {
                let x = Sampler::new(5, pixel, 0).next_1d() - 0.5;
                let y = Sampler::new(5 + da, pixel + db, 0).next_1d() - 0.5;
                sum += f64::from(12.0 * x * y) / 4096.0;
            }
            assert!(sum.abs() < 4.5 / 64.0, "correlation {sum}");
        }
    }

    #[test]
    fn streams_are_uniform() {
        // 16 cells of 65,536 / 16 expected: chi-squared with 15 degrees exceeds 44.3 once in 10^4.
        for stream in 0..8 {
            let mut rng = Rng::new(11, stream);
            let mut cells = [0.0f64; 16];
            for _ in 0..65_536 {
                let u = rng.next_2d();
                assert!(u.cmplt(Vec2::ONE).all() && u.cmpge(Vec2::ZERO).all(), "range: {u}");
                cells[(u.x * 4.0) as usize * 4 + (u.y * 4.0) as usize] += 1.0;
            }
            let chi2: f64 = cells.iter().map(|n| (n - 4096.0).powi(2) / 4096.0).sum();
            assert!(chi2 < 44.3, "stream {stream}: {chi2}");
        }
    }
}
