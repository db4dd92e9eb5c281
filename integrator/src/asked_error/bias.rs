//! The relative bias of the pixels of a picture, by classes of their noise.
//!
//! Pixels in which the passes agree to the last bits show sources or nothing, and mostly have no bias either; of the
//! others the quieter half and the noisier half are told apart. In each class all pixels that paths verify count alike:
//! weights by their noise would favour those that have no bias, and those whose paths missed what is bright.

use super::{CAUTION, Z_SQ};

/// What paths found at one pixel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Term {
    /// Relative variance of the picture there, by its passes.
    pub(super) noise_sq: f32,
    /// Estimate of the square of the relative bias, without a bias of its own: often negative.
    pub(super) bias_sq: f64,
}

/// The bias of all pixels.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Bias {
    /// The relative variance beyond which the noisier half begins.
    median: f32,
    classes: [ClassBias; 3],
    /// Its mean square over the picture.
    pub(super) mean_sq: f32,
}

/// The bias of the pixels of one class.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct ClassBias {
    /// Mean square of the relative bias.
    pub(super) sq: f32,
    /// Standard error of that.
    pub(super) error: f32,
}

/// A relative variance that is about that of rounding.
const ROUNDING_SQ: f32 = 1e-12;

impl Bias {
    /// Returns what `terms`, of pixels from all over the picture, tell; those that are not finite tell nothing.
    pub(super) fn new(mut terms: Vec<Term>) -> Self {
        terms.retain(|term| term.noise_sq.is_finite() && term.bias_sq.is_finite());
        let mut noisy: Vec<f32> = terms.iter().map(|term| term.noise_sq).filter(|&noise| noise > ROUNDING_SQ).collect();
        noisy.sort_unstable_by(f32::total_cmp);
        let median = noisy.get(noisy.len() / 2).copied().unwrap_or(ROUNDING_SQ);
        let mut bias = Self { median, ..Self::default() };
        let all = ClassBias::new(terms.iter().map(|term| term.bias_sq));
        for class in 0..bias.classes.len() {
            let of_class = terms.iter().filter(|term| bias.class(term.noise_sq) == class).map(|term| term.bias_sq);
            bias.classes[class] = if of_class.clone().next().is_some() {
                ClassBias::new(of_class)
            } else {
                // What no path verifies may be as bad as the rest, or as the quieter half.
                if class == 2 { bias.classes[1] } else { all }
            };
        }
        bias.mean_sq = all.sq;
        bias
    }

    /// The bias of a pixel of this relative variance.
    pub(super) fn of(&self, noise_sq: f32) -> ClassBias {
        self.classes[self.class(noise_sq)]
    }

    /// The largest standard error of the mean square of any class.
    pub(super) fn error(&self) -> f32 {
        self.classes.iter().map(|class| class.error).fold(0.0, f32::max)
    }

    fn class(&self, noise_sq: f32) -> usize {
        usize::from(noise_sq > ROUNDING_SQ) + usize::from(noise_sq > self.median)
    }
}

impl ClassBias {
    /// Mean and its standard error, by the spread of the terms.
    fn new(terms: impl Iterator<Item = f64>) -> Self {
        let (count, sum, sum_sq) =
            terms.fold((0.0, 0.0, 0.0), |(count, sum, sum_sq), term| (count + 1.0, sum + term, sum_sq + term * term));
        let mean: f64 = sum / count;
        // One tells nothing of its own error; it may be as large as itself.
        let variance = if count > 1.0 { (sum_sq / count - mean * mean).max(0.0) / (count - 1.0) } else { sum_sq };
        #[expect(clippy::cast_possible_truncation, reason = "estimates")]
        let single = Self { sq: mean.max(0.0) as f32, error: variance.sqrt() as f32 };
        single
    }

    /// What the mean square may well be, that and one standard error; but what is hardly known is not to keep the error
    /// from being reached that was `asked`.
    pub(super) fn most(&self, asked: f32) -> f32 {
        self.sq + self.error.min(CAUTION * asked * asked / Z_SQ)
    }

    /// What it is at least, in all likelihood.
    pub(super) fn least(&self) -> f32 {
        (self.sq - self.error).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rng;

    fn terms(seed: u64, term: impl Fn(u32, f64) -> Term) -> Bias {
        let mut rng = Rng::new(seed, 5);
        // Twelve uniform numbers less 6 have the variance 1.
        let mut normal = || (0..12).map(|_| f64::from(rng.next_1d())).sum::<f64>() - 6.0;
        Bias::new((0..256).map(|number| term(number, normal())).collect())
    }

    #[test]
    fn pixels_without_noise_do_not_hide_the_bias_of_others() {
        // Three quarters of a picture are black; the rest has a bias of 0.03 and noise of 0.02, as it is known.
        let bias = terms(1, |number, normal| {
            if number % 4 > 0 {
                return Term { noise_sq: 0.0, bias_sq: 0.0 };
            }
            let difference = 0.03 + 0.02 * normal;
            Term {
                noise_sq: if number.is_multiple_of(8) { 5e-4 } else { 4e-4 },
                bias_sq: difference * difference - 4e-4,
            }
        });
        assert_eq!((bias.of(0.0).sq, bias.of(0.0).error), (0.0, 0.0));
        for noise_sq in [1e-6, 4e-4, 6e-4] {
            let ClassBias { sq, error } = bias.of(noise_sq);
            assert!((sq - 9e-4).abs() < 3.0 * error && (5e-5..4e-4).contains(&error), "{sq} +- {error}");
        }
        assert!((bias.mean_sq - 0.25 * 9e-4).abs() < 1e-4, "{}", bias.mean_sq);
    }

    #[test]
    fn one_pixel_is_not_certain() {
        let bias = terms(3, |number, _| {
            if number == 7 { Term { noise_sq: 1e-4, bias_sq: -2e-4 } } else { Term { noise_sq: 0.0, bias_sq: 0.0 } }
        });
        assert!((bias.of(1e-4).error / 2e-4 - 1.0).abs() < 1e-6 && bias.of(1e-4).sq == 0.0, "{bias:?}");
    }

    #[test]
    fn a_class_that_no_path_verifies_is_as_bad_as_the_rest() {
        let bias = terms(2, |_, normal| Term { noise_sq: 1e-4, bias_sq: 1e-4 * normal * normal });
        assert_eq!(bias.of(0.0).sq, bias.mean_sq);
        assert!((bias.mean_sq / 1e-4 - 1.0).abs() < 0.3 && bias.mean_sq > 0.0);
    }
}
