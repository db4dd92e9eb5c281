//! The pictures that are averaged, and the noise that their spread tells.

use glam::{UVec2, Vec3};
use rayon::prelude::*;
use scene::Scene;

use super::{ErrorEstimate, PASSES, WANTED_SHARE, student};
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
    /// The scale D of each pixel's relative error, and the variance of its mean divided by D^2.
    pub(super) scale: Vec<f32>,
    variance: Vec<f32>,
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

    /// Renders and adds a round of passes of this quality.
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
            let pass = Settings { quality, seed, ..settings.clone() };
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
            #[expect(clippy::cast_possible_truncation, reason = "an estimate")]
            let single = (scale_sq.sqrt() as f32, (variance / scale_sq) as f32);
            single
        });
        let (scale, variance) = measured.unzip();
        #[expect(clippy::cast_possible_truncation, reason = "at most the number of passes")]
        let alike = alike as f32;
        Measure { size, mean, scale, variance, alike }
    }
}

impl Measure {
    /// The error with this mean square of the relative bias.
    pub(super) fn estimate(&self, bias_sq: f32, asked: f32, passes: u32) -> ErrorEstimate {
        // Two of the nine pixels that are averaged count as independent: neighbours share records.
        let t = student(2.0 * (self.alike - 1.0));
        let relative: Vec<f32> =
            (0..self.mean.len()).into_par_iter().map(|pixel| t * (self.around(pixel) + bias_sq).sqrt()).collect();
        let within = relative.iter().filter(|&&relative| relative <= asked).count();
        let share = within as f32 / relative.len() as f32;
        ErrorEstimate { relative, share, bias: bias_sq.sqrt(), passes, is_reached: share >= WANTED_SHARE }
    }

    /// The relative variance around a pixel, the mean of 3 x 3.
    pub(super) fn around(&self, pixel: usize) -> f32 {
        let (width, height) = (self.size.x as usize, self.size.y as usize);
        let (x, y) = (pixel % width, pixel / width);
        let (mut sum, mut count) = (0.0, 0.0);
        for row in y.saturating_sub(1)..(y + 2).min(height) {
            for column in x.saturating_sub(1)..(x + 2).min(width) {
                sum += self.variance[row * width + column];
                count += 1.0;
            }
        }
        sum / count
    }
}

impl ErrorEstimate {
    /// How many times the error asked for is exceeded by all but 5 % of the pixels.
    pub(super) fn excess(&self, asked: f32) -> f32 {
        let mut sorted = self.relative.clone();
        sorted.sort_unstable_by(f32::total_cmp);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below the length")]
        let place = (WANTED_SHARE * (sorted.len() - 1) as f32).ceil() as usize;
        sorted[place] / asked
    }
}
