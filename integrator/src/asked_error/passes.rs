//! The pictures that are averaged, and the noise that their spread tells.

use glam::{UVec2, Vec3};
use rayon::prelude::*;
use scene::Scene;

use super::bias::{Bias, ClassBias};
use super::{ErrorEstimate, PASSES, Z_SQ, at_wanted_share, student};
use crate::allocation::neighbours;
use crate::sampler::hash_pair;
use crate::{Film, Progress, RecordPoint, Rendering, Settings, SettingsError, Statistics, metrics, render};

/// The passes so far.
pub(super) struct Passes {
    pub(super) film: Film,
    /// The records of the last pass.
    pub(super) records: Vec<RecordPoint>,
    pub(super) count: u32,
    pub(super) weight: f32,
    /// Sums over the passes of w^2, and for each pixel of w^2 x and w^2 x^2.
    weight_sq: f64,
    value: Vec<f64>,
    value_sq: Vec<f64>,
}

/// What the passes tell.
pub(super) struct Measure {
    pub(super) size: UVec2,
    pub(super) mean: Vec<f32>,
    /// The scale D of each pixel's relative error.
    pub(super) scale: Vec<f32>,
    /// The variance of each pixel's mean over D^2, averaged over 3 x 3 pixels.
    pub(super) noise_sq: Vec<f32>,
    /// Number of passes if they counted alike.
    alike: f32,
}

pub(super) fn grey(value: Vec3) -> f32 {
    value.element_sum() / 3.0
}

impl Passes {
    pub(super) fn new(size: UVec2) -> Self {
        let film = Film::new(size);
        let zeros = vec![0.0; film.pixel_count()];
        Self { film, records: Vec::new(), count: 0, weight: 0.0, weight_sq: 0.0, value: zeros.clone(), value_sq: zeros }
    }

    /// Renders and adds a round of passes of this quality. What a fit of direct light is off by, all would have in
    /// common, so each pixel has what it found itself, unless the settings say else: with that, a pixel of one picture
    /// that is fitted is about as exact, or more so.
    pub(super) fn add_round(
        &mut self,
        scene: &Scene,
        settings: &Settings,
        quality: f32,
        statistics: &mut Statistics,
        progress: &(dyn Fn(Progress) + Sync),
    ) -> Result<(), SettingsError> {
        for _ in 0..PASSES {
            let seed = hash_pair(settings.seed, u64::from(self.count));
            let mut pass = Settings { quality, seed, ..settings.clone() };
            pass.study.direct_fit.get_or_insert(false);
            let Rendering { film, statistics: of_pass, records } = render(scene, &pass, progress)?;
            self.add(&film, quality);
            statistics.add_pass(&of_pass);
            self.records = records;
        }
        Ok(())
    }

    pub(super) fn add(&mut self, film: &Film, weight: f32) {
        self.count += 1;
        self.weight += weight;
        self.film.mix(film, weight / self.weight);
        let weight_sq = f64::from(weight) * f64::from(weight);
        self.weight_sq += weight_sq;
        for (pixel, (value, value_sq)) in self.value.iter_mut().zip(&mut self.value_sq).enumerate() {
            let x = f64::from(grey(film.terms(pixel).sum()));
            *value += weight_sq * x;
            *value_sq += weight_sq * x * x;
        }
    }

    pub(super) fn measure(&self) -> Measure {
        let picture = self.film.picture();
        let size = self.film.size;
        let floor_sq = metrics::floor_sq(metrics::finite_means(&picture));
        let weight = f64::from(self.weight);
        let alike = weight * weight / self.weight_sq;
        let mean: Vec<f32> = picture.into_iter().map(grey).collect();
        let measured = mean.iter().zip(self.value.iter().zip(&self.value_sq)).map(|(&mean, (value, value_sq))| {
            let m = f64::from(mean);
            let scale_sq = m * m + floor_sq;
            let spread = (value_sq - 2.0 * m * value + m * m * self.weight_sq).max(0.0);
            let variance = spread / (weight * weight) * alike / (alike - 1.0);
            // A pixel that is not finite is as far off as can be.
            let variance = if scale_sq.is_finite() { variance } else { f64::INFINITY };
            let scale_sq = if scale_sq.is_finite() { scale_sq } else { 1.0 };
            #[expect(clippy::cast_possible_truncation, reason = "an estimate")]
            let single = (scale_sq.sqrt() as f32, (variance / scale_sq) as f32);
            single
        });
        let (scale, variance): (_, Vec<f32>) = measured.unzip();
        let noise_sq = (0..variance.len()).into_par_iter().map(|pixel| around(&variance, size, pixel)).collect();
        #[expect(clippy::cast_possible_truncation, reason = "at most the number of passes")]
        let alike = alike as f32;
        Measure { size, mean, scale, noise_sq, alike }
    }
}

impl Measure {
    /// The error with this bias.
    pub(super) fn estimate(&self, bias: &Bias, asked: f32, passes: u32) -> ErrorEstimate {
        let t_sq = self.quantile_sq();
        let relative_sq = |&noise_sq: &f32| t_sq * noise_sq + Z_SQ * bias.of(noise_sq).most(asked);
        let relative: Vec<f32> = self.noise_sq.iter().map(relative_sq).map(f32::sqrt).collect();
        let within = relative.iter().filter(|&&relative| relative <= asked).count();
        let share = within as f32 / relative.len() as f32;
        let is_reached = at_wanted_share(relative.clone()) <= asked;
        ErrorEstimate { relative, share, bias: bias.mean_sq.sqrt(), passes, is_reached }
    }

    /// How many times less noise all but 5 % of the pixels would have to have beside a bias of this mean square, which
    /// may depend on their noise; infinite where that alone is too much.
    pub(super) fn excess(&self, bias_sq: impl Fn(f32) -> f32, asked: f32) -> f32 {
        let t_sq = self.quantile_sq();
        let excess = |&noise_sq: &f32| {
            let rest = asked * asked - Z_SQ * bias_sq(noise_sq);
            if rest > 0.0 { t_sq * noise_sq / rest } else { f32::INFINITY }
        };
        at_wanted_share(self.noise_sq.iter().map(excess).collect())
    }

    /// Whether it hangs on what is not known of the bias alone if the error is reached.
    pub(super) fn is_open(&self, bias: &Bias, asked: f32) -> bool {
        let is_reached = |of: &dyn Fn(ClassBias) -> f32| self.excess(|noise_sq| of(bias.of(noise_sq)), asked) <= 1.0;
        is_reached(&|class| class.least()) && !is_reached(&|class| class.most(asked))
    }

    /// The square of the multiple of its deviation by which one pixel of 20 is off: two of the nine pixels that are
    /// averaged count as independent, for neighbours share records.
    fn quantile_sq(&self) -> f32 {
        let independent = self.mean.len().min(2) as f32;
        student(independent * (self.alike - 1.0)).powi(2)
    }
}

/// The mean of 3 x 3 pixels.
fn around(variance: &[f32], size: UVec2, pixel: usize) -> f32 {
    let width = size.x as usize;
    let others = neighbours(pixel, width, variance.len());
    let (sum, count) = others.fold((variance[pixel], 1.0), |(sum, count), other| (sum + variance[other], count + 1.0));
    sum / count
}
