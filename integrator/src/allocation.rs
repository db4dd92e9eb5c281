//! How many primary samples each pixel takes: many where they differ, at edges, in half shadows and in gloss, few where
//! all are alike.
//!
//! Every pixel takes some samples first. What they tell of the noise around a pixel, without its own samples, decides
//! how many it takes altogether: its count depends on nothing that enters its mean, so that the mean stays without bias
//! (a pixel that judges itself keeps too often what it found too dark: Kirk and Arvo 1991). With s the deviation of the
//! samples in the pixels around and m their mean,
//!
//! ```text
//! samples = k (s / D)^(4/5),     D^2 = m^2 + 0.01 (bright / 0.8)^2
//! ```
//!
//! has the least noise for its number of samples, where that is s^2 / (D^2 samples^(3/2)), as it is for stratified
//! samples of the edge of a body or of a shadow. D is the denominator of relMSE, `bright` the 90th percentile of the
//! picture (of what is not black, where that is). Edges between two pixels count in s, too, for a light that a pixel's
//! few samples missed may be seen by its neighbours'. Counts are the first one times a power of two, for which Sobol's
//! points are stratified best. Of s^2 there, what the light samples of a primary sample differ by counts in full, the
//! rest a fifth: the noise of edges, which all samples of a pixel cut at the same places, falls faster. How many there
//! are altogether, the mean of s^2 / (D^2 samples) decides: the noise of independent samples, which is a good deal more
//! than the true one.
//!
//! # Source
//! Mitchell 1996: Consequences of Stratified Sampling in Graphics.

use glam::{DVec2, Vec3};
use rayon::prelude::*;

use crate::metrics;

/// What decides the number of samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Budget {
    /// The mean number of samples, by the rays that the first ones took.
    Mean(u32),
    /// The noise: the mean square of the relative error, as of independent samples; but no more than this mean number.
    Noise(f32, u32),
}

/// No pixel takes more than so many times what the mean may be.
const MOST: u32 = 64;
/// The binary logarithm of k lies in this interval, which is halved so many times.
const RANGE: (f32, f32) = (-32.0, 64.0);
const HALVINGS: u32 = 16;
/// What the part of s^2 counts that light samples do not tell: pictures with 0.05 are as good, those with 1 take a
/// tenth to a quarter longer.
const EDGES: f64 = 0.2;
/// Pixels that one thread sums up.
const CHUNK: usize = 1 << 12;

/// What the samples of a pixel tell of their noise.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct SampleNoise {
    count: u32,
    /// Sums over the samples of the light that they found, mean of R, G and B, and of the light that they would reflect
    /// of an even radiance of 1.
    sum: DVec2,
    /// Sums of the squares, and of the products of both.
    sum_sq: DVec2,
    product: f64,
    /// Sum of the variances by their light samples.
    of_light: f64,
}

impl SampleNoise {
    /// Adds a sample: the light that it found, the albedo by which it will reflect what it does not know yet, and the
    /// variance by its light samples.
    pub(crate) fn add(&mut self, light: Vec3, diffuse: Vec3, variance: f32) {
        let value = DVec2::new(f64::from(light.element_sum()), f64::from(diffuse.element_sum())) / 3.0;
        self.count += 1;
        self.sum += value;
        self.sum_sq += value * value;
        self.product += value.x * value.y;
        self.of_light += f64::from(variance);
    }

    fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.sum += other.sum;
        self.sum_sq += other.sum_sq;
        self.product += other.product;
        self.of_light += other.of_light;
    }

    /// Mean of a sample in an even radiance of `ambient`.
    pub(crate) fn mean(&self, ambient: f64) -> f64 {
        (self.sum.x + ambient * self.sum.y) / f64::from(self.count.max(1))
    }

    /// Variance of a sample, and how much of it counts for the number of samples.
    fn variance(&self, ambient: f64) -> [f64; 2] {
        let sum_sq = self.sum_sq.x + ambient * (2.0 * self.product + ambient * self.sum_sq.y);
        let mean = self.mean(ambient);
        let all = (sum_sq - mean * mean * f64::from(self.count)).max(0.0) / f64::from(self.count.max(2) - 1);
        let of_light = (self.of_light / f64::from(self.count.max(1))).min(all);
        [all, of_light + EDGES * (all - of_light)]
    }
}

/// The first samples of one pixel.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct FirstSamples {
    pub(crate) noise: SampleNoise,
    /// Rays that they took.
    pub(crate) rays: u64,
}

/// What decides how many samples each pixel of a picture takes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Allocation {
    /// About the radiance of the indirect light, which samples do not know: by it edges count that are seen in no
    /// other.
    ambient: f64,
    floor_sq: f64,
    /// The binary logarithm of k, in units of the first samples.
    k: f32,
    most_doublings: f32,
}

impl Allocation {
    /// Decides by the `first` samples of `pixels`, which come in blocks of so many rows of `width` pixels: a whole
    /// picture, or parts from all over it.
    pub(crate) fn new(
        (width, rows): (usize, usize),
        first: u32,
        budget: Budget,
        pixels: &[FirstSamples],
        ambient: f32,
    ) -> Self {
        let ambient = f64::from(ambient);
        let floor_sq = metrics::floor_sq(pixels.par_iter().map(|pixel| pixel.noise.mean(ambient)).collect());
        let (Budget::Mean(most) | Budget::Noise(_, most)) = budget;
        // Where the first samples are all that there are, as for pixels that are to be alike, none has more.
        let is_spent = matches!(budget, Budget::Mean(most) if most <= first);
        // A lone pixel takes all that there may be, for there is no other to ask.
        let times = if pixels.len() == 1 { 1 } else { MOST };
        let most_doublings = if is_spent { 0.0 } else { ((times * most / first) as f32).log2().floor() };
        let unsolved = Self { ambient, floor_sq, k: RANGE.0, most_doublings };
        let (noise, needs): (Vec<f32>, Vec<f32>) = pixels
            .par_chunks((width * rows).max(1))
            .flat_map(|block| (0..block.len()).into_par_iter().map(move |pixel| unsolved.noise(pixel, width, block)))
            .unzip();
        let first_rays: u64 = pixels.iter().map(|pixel| pixel.rays).sum();
        let is_too_much = |k: f32| {
            let tried = Self { k, ..unsolved };
            let of_chunk = |(needs, (noise, pixels)): (&[f32], (&[f32], &[FirstSamples]))| {
                let (mut rays, mut sum) = (0.0, 0.0);
                for (need, (noise, pixel)) in needs.iter().zip(noise.iter().zip(pixels)) {
                    let factor = tried.doublings(*need).exp2();
                    rays += f64::from(factor) * pixel.rays as f64;
                    sum += f64::from(noise / factor);
                }
                (rays, sum)
            };
            let chunks = needs.par_chunks(CHUNK).zip(noise.par_chunks(CHUNK).zip(pixels.par_chunks(CHUNK)));
            let sums: Vec<(f64, f64)> = chunks.map(of_chunk).collect();
            let (rays, sum) = sums.iter().fold((0.0, 0.0), |(rays, sum), chunk| (rays + chunk.0, sum + chunk.1));
            let is_good = match budget {
                Budget::Mean(_) => false,
                Budget::Noise(wanted, _) => sum <= f64::from(wanted) * f64::from(first) * pixels.len() as f64,
            };
            is_good || rays * f64::from(first) > first_rays as f64 * f64::from(most)
        };
        let (mut low, mut high) = RANGE;
        for _ in 0..HALVINGS {
            let middle = f32::midpoint(low, high);
            if is_too_much(middle) { high = middle } else { low = middle }
        }
        Self { k: low, ..unsolved }
    }

    /// Returns for each pixel of a band of `width` pixels, row by row, how many times its first samples it takes
    /// altogether.
    pub(crate) fn factors(&self, width: usize, pixels: &[FirstSamples]) -> Vec<u32> {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most the number of doublings")]
        let factor = |pixel: usize| 1 << self.doublings(self.noise(pixel, width, pixels).1) as u32;
        (0..pixels.len()).into_par_iter().map(factor).collect()
    }

    /// s^2 / D^2 of a pixel, and the binary logarithm of its number of samples for k = 1; -inf where there is no noise,
    /// inf for a lone pixel.
    #[expect(clippy::cast_possible_truncation, reason = "estimates")]
    fn noise(&self, pixel: usize, width: usize, pixels: &[FirstSamples]) -> (f32, f32) {
        if pixels.len() == 1 {
            return (0.0, f32::INFINITY);
        }
        let mut around = SampleNoise::default();
        neighbours(pixel, width, pixels.len()).for_each(|neighbour| around.merge(&pixels[neighbour].noise));
        let unit = around.mean(self.ambient).powi(2) + self.floor_sq;
        let [all, counts] = around.variance(self.ambient).map(|variance| variance / unit);
        (all as f32, 0.4 * counts.log2() as f32)
    }

    fn doublings(&self, need: f32) -> f32 {
        (need + self.k).round().clamp(0.0, self.most_doublings)
    }
}

/// The pixels, or texels, around one of `count` in rows of `width`, itself left out.
pub(crate) fn neighbours(pixel: usize, width: usize, count: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (pixel % width, pixel / width);
    let rows = y.saturating_sub(1)..(y + 2).min(count / width);
    let columns = move || x.saturating_sub(1)..(x + 2).min(width);
    rows.flat_map(move |row| columns().map(move |column| row * width + column)).filter(move |&other| other != pixel)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rng;

    const SIDE: usize = 64;
    const FIRST: u32 = 4;

    /// The first samples of a grey picture whose columns from 40 on have this deviation.
    fn picture(seed: u64, deviation: f32) -> Vec<FirstSamples> {
        let mut rng = Rng::new(seed, 7);
        let pixel = |index: usize| {
            let mut noise = SampleNoise::default();
            let is_noisy = index % SIDE >= 40;
            for _ in 0..FIRST {
                let light = if is_noisy { deviation * (2.0 * rng.next_1d() - 1.0) } else { 0.0 };
                noise.add(Vec3::splat(light), Vec3::ONE, 0.0);
            }
            FirstSamples { noise, rays: u64::from(2 * FIRST) }
        };
        (0..SIDE * SIDE).map(pixel).collect()
    }

    /// The counts of a whole picture, decided by itself.
    fn allocate(width: usize, first: u32, budget: Budget, pixels: &[FirstSamples], ambient: f32) -> Vec<u32> {
        Allocation::new((width, pixels.len() / width), first, budget, pixels, ambient).factors(width, pixels)
    }

    #[test]
    fn parts_of_a_picture_decide_as_the_whole() {
        let pixels = picture(6, 0.5);
        // Every other block of 8 x 8.
        let blocks = (0..SIDE / 8).flat_map(|y| (0..SIDE / 8).map(move |x| (x, y))).filter(|(x, y)| (x + y) % 2 == 0);
        let part: Vec<FirstSamples> = blocks
            .flat_map(|(x, y)| (0..64).map(move |i| (8 * y + i / 8) * SIDE + 8 * x + i % 8))
            .map(|pixel| pixels[pixel])
            .collect();
        for budget in [Budget::Mean(16), Budget::Noise(0.004, 64)] {
            let whole = mean(&allocate(SIDE, FIRST, budget, &pixels, 1.0));
            let by_part = mean(&Allocation::new((8, 8), FIRST, budget, &part, 1.0).factors(SIDE, &pixels));
            assert!((by_part / whole - 1.0).abs() < 0.2, "{by_part} by a part, {whole} by all");
        }
    }

    fn mean(factors: &[u32]) -> f32 {
        factors.iter().sum::<u32>() as f32 * FIRST as f32 / factors.len() as f32
    }

    #[test]
    fn samples_go_where_the_noise_is_and_are_as_many_as_asked() {
        let factors = allocate(SIDE, FIRST, Budget::Mean(16), &picture(1, 0.5), 1.0);
        assert!((12.0..=16.0).contains(&mean(&factors)), "mean {}", mean(&factors));
        let of = |column: usize| factors[20 * SIDE + column];
        assert_eq!([of(0), of(38)], [1, 1], "nothing to gain");
        assert!(of(39) > 1 && of(50) >= 8, "noise, and next to it: {} {}", of(39), of(50));
    }

    #[test]
    fn samples_grow_with_the_power_four_fifths_of_the_deviation() {
        let mut rng = Rng::new(4, 0);
        let pixel = |index: usize| {
            let deviation = if index % SIDE < SIDE / 2 { 0.01 } else { 0.32 };
            let mut noise = SampleNoise::default();
            (0..FIRST)
                .for_each(|_| noise.add(Vec3::splat(1.0 + deviation * (2.0 * rng.next_1d() - 1.0)), Vec3::ONE, 0.0));
            FirstSamples { noise, rays: u64::from(FIRST) }
        };
        let pixels: Vec<FirstSamples> = (0..SIDE * SIDE).map(pixel).collect();
        let factors = allocate(SIDE, FIRST, Budget::Mean(64), &pixels, 0.0);
        let median = |column: usize| {
            let mut factors: Vec<u32> = (0..SIDE).map(|row| factors[row * SIDE + column]).collect();
            *factors.select_nth_unstable(SIDE / 2).1
        };
        // 32 times the deviation: 2^4.
        assert_eq!(median(SIDE * 3 / 4), 16 * median(SIDE / 4));
    }

    #[test]
    fn noise_of_light_samples_counts_more_than_that_of_edges() {
        let mut pixels = picture(5, 0.5);
        for pixel in &mut pixels[SIDE * SIDE / 2..] {
            // In the lower half all of the noise: more than the samples can show by chance.
            pixel.noise.of_light = f64::from(FIRST);
        }
        let factors = allocate(SIDE, FIRST, Budget::Mean(64), &pixels, 1.0);
        let sum = |rows: std::ops::Range<usize>| {
            let noisy = rows.flat_map(|row| (42..SIDE - 2).map(move |column| row * SIDE + column));
            f64::from(noisy.map(|pixel| factors[pixel]).sum::<u32>())
        };
        // 5^0.4 = 1.9 times as many.
        let ratio = sum(34..62) / sum(2..30);
        assert!((1.7..2.2).contains(&ratio), "{ratio}");
    }

    #[test]
    fn noise_decides_up_to_a_limit() {
        let with =
            |noise, deviation| mean(&allocate(SIDE, FIRST, Budget::Noise(noise, 64), &picture(2, deviation), 1.0));
        assert_eq!(with(1e-3, 0.0), FIRST as f32, "no noise: no more samples");
        // A uniform deviation of 0.5 has the variance 1/12, in three eighths of the picture; D^2 is 1 + 0.01 / 0.64.
        let known = 0.375 / 12.0 / 1.0156 / 0.004 * 0.375 + 0.625 * FIRST as f32;
        let found = with(0.004, 0.5);
        assert!((0.7 * known..1.5 * known).contains(&found), "{found} samples, not {known}");
        assert!(with(1e-6, 0.5) <= 64.0, "the limit");
    }

    #[test]
    fn a_lone_pixel_takes_what_is_asked_and_spent_budgets_give_no_more() {
        let pixels = picture(7, 0.5);
        for lone in [&pixels[..1], &pixels[50..51]] {
            assert_eq!(allocate(1, FIRST, Budget::Mean(64), lone, 1.0), [16], "64, whatever its own noise");
            assert_eq!(allocate(1, FIRST, Budget::Noise(0.01, 32), lone, 1.0), [8], "up to the limit");
        }
        // The part that decides may be without noise.
        let pixels = picture(8, 0.5);
        let part: Vec<FirstSamples> = picture(8, 0.0)[..64].to_vec();
        let even = Allocation::new((8, 8), FIRST, Budget::Mean(FIRST), &part, 1.0).factors(SIDE, &pixels);
        assert_eq!(even, vec![1; SIDE * SIDE], "as many for each");
    }

    #[test]
    fn a_pixel_does_not_judge_itself() {
        let mut pixels = picture(3, 0.5);
        let before = allocate(SIDE, FIRST, Budget::Noise(0.004, 64), &pixels, 1.0);
        let lonely = 20 * SIDE + 20;
        pixels[lonely].noise.add(Vec3::splat(50.0), Vec3::ONE, 0.0);
        let after = allocate(SIDE, FIRST, Budget::Noise(0.004, 64), &pixels, 1.0);
        assert_eq!(after[lonely], 1, "its own bright sample");
        assert!(after[lonely + 1] > before[lonely + 1] && after[lonely - SIDE] > 1, "but its neighbours look closer");
    }

    #[test]
    fn edges_in_the_dark_count_by_what_they_will_reflect() {
        let mut pixels = vec![FirstSamples { rays: 8, ..FirstSamples::default() }; SIDE * SIDE];
        for (index, pixel) in pixels.iter_mut().enumerate() {
            let albedo = if index % SIDE < 30 { 0.2 } else { 0.8 };
            (0..FIRST).for_each(|_| pixel.noise.add(Vec3::ZERO, Vec3::splat(albedo), 0.0));
        }
        let factors = allocate(SIDE, FIRST, Budget::Noise(1e-3, 64), &pixels, 2.0);
        assert!(factors[10 * SIDE + 30] > 1 && factors[10 * SIDE + 29] > 1, "on both sides of the edge");
        assert_eq!([factors[10 * SIDE + 20], factors[10 * SIDE + 40]], [1, 1], "and nowhere else");
    }

    #[test]
    fn odd_pictures_have_counts() {
        for (width, count) in [(1, 1), (1, 5), (5, 5), (3, 6)] {
            let black = vec![FirstSamples { rays: 1, ..FirstSamples::default() }; count];
            for budget in [Budget::Mean(9), Budget::Noise(1e-3, 9)] {
                // A lone pixel takes as many as it may: 8 of 9.
                let expected = if count == 1 { 2 } else { 1 };
                assert_eq!(allocate(width, FIRST, budget, &black, 0.0), vec![expected; count], "{width}, {count}");
            }
        }
    }
}
