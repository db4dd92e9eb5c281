//! Whether pictures keep to the errors that they state.

use glam::Vec3;
use integrator::ErrorEstimate;
use integrator::metrics::{self, Reference};

/// The pixels whose true error exceeds what was estimated, of a picture with a known reference.
#[derive(Debug, Clone)]
pub struct Exceeded {
    /// For each pixel, row by row.
    pub is_beyond: Vec<bool>,
    /// Root mean square of the relative error of the reference by its own noise.
    pub reference_noise: f64,
    width: usize,
}

/// Blocks along a side of which one pixel each is judged: neighbours share records, and fail together.
const BLOCKS: usize = 20;

impl Exceeded {
    /// Compares `picture` with a reference whose noise is allowed for: the mean of R, G and B, relative as in relMSE.
    ///
    /// # Panics
    /// If the sizes differ, or the reference does not know its variance.
    #[must_use]
    pub fn new(picture: &[Vec3], estimate: &ErrorEstimate, reference: &Reference) -> Self {
        let image = reference.image();
        let variance = reference.variance().expect("a reference of several batches");
        assert!(picture.len() == variance.len() && estimate.relative.len() == variance.len(), "pictures of one size");
        let exposure = metrics::exposure(&image).expect("a finite picture");
        let grey = |value: Vec3| f64::from(value.element_sum() / 3.0);
        let scale_sq = |known: f64| known * known + 0.01 / exposure.powi(2);
        // All channels of a reference are off at once.
        let noise_sq = |pixel: usize| grey(variance[pixel]);
        let is_beyond = (0..picture.len()).map(|pixel| {
            let known = grey(image.pixels()[pixel]);
            let stated_sq = f64::from(estimate.relative[pixel]).powi(2) * scale_sq(known);
            (grey(picture[pixel]) - known).powi(2) > stated_sq + 4.0 * noise_sq(pixel)
        });
        let relative_sq = (0..picture.len()).map(|pixel| noise_sq(pixel) / scale_sq(grey(image.pixels()[pixel])));
        let reference_noise = (relative_sq.sum::<f64>() / picture.len() as f64).sqrt();
        Self { is_beyond: is_beyond.collect(), reference_noise, width: reference.size().x as usize }
    }

    /// Returns how many of 400 pixels exceed their estimates, one in each of 20 x 20 blocks.
    #[must_use]
    pub fn of_400(&self) -> usize {
        let height = self.is_beyond.len() / self.width;
        let middle = |block: usize, side: usize| (2 * block + 1) * side / (2 * BLOCKS);
        let blocks = (0..BLOCKS * BLOCKS)
            .map(|block| middle(block / BLOCKS, height) * self.width + middle(block % BLOCKS, self.width));
        blocks.filter(|&pixel| self.is_beyond[pixel]).count()
    }

    /// Returns the share of all pixels.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.is_beyond.iter().filter(|&&is_beyond| is_beyond).count() as f64 / self.is_beyond.len() as f64
    }
}
