//! A reference picture that knows its own noise, so that no other picture is blamed for it.
//!
//! ```text
//! own relMSE = mean over pixels and channels of e^2 Var(R) / ((e R)^2 + 0.01)
//! ```
//!
//! A perfect picture has this relMSE against the reference, in expectation: it is to be subtracted from what is
//! measured, and nothing much smaller can be measured at all.

use glam::{DVec3, UVec2, Vec3};

use super::rel_mse::{EPSILON, summary};
use super::{Image, MetricsError, RelMse, exposure};

/// A converged picture, and the variance of its numbers where that is known.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    size: UVec2,
    pixels: Vec<Vec3>,
    variance: Option<Vec<Vec3>>,
}

impl Reference {
    /// Takes a picture of `size`, linear RGB with rows from the top, and for each of its numbers the variance, where
    /// known.
    ///
    /// # Errors
    /// When there is no pixel, or there are not width times height pixels or variances.
    pub fn new(size: UVec2, pixels: Vec<Vec3>, variance: Option<Vec<Vec3>>) -> Result<Self, MetricsError> {
        Image::new(size, &pixels)?;
        if let Some(variance) = &variance {
            Image::new(size, variance)?;
        }
        Ok(Self { size, pixels, variance })
    }

    /// Width and height in pixels.
    #[must_use]
    pub fn size(&self) -> UVec2 {
        self.size
    }

    /// The picture as the measures take it.
    #[must_use]
    pub fn image(&self) -> Image<'_> {
        Image { size: self.size, pixels: &self.pixels }
    }

    /// The variance of each number of the picture, where it is known.
    #[must_use]
    pub fn variance(&self) -> Option<&[Vec3]> {
        self.variance.as_deref()
    }

    /// Returns the relMSE that a perfect picture is expected to have against this one; `None` where the variance is not
    /// known.
    ///
    /// The robust figure leaves out the 0.1 % of the pixels that are least certain. Pixels that are not finite are left
    /// out of both.
    ///
    /// # Errors
    /// When no pixel is finite.
    pub fn own_rel_mse(&self) -> Result<Option<RelMse>, MetricsError> {
        let Some(variance) = &self.variance else { return Ok(None) };
        let exposure = exposure(&self.image())?;
        let errors: Vec<f64> = (self.pixels.iter().zip(variance))
            .filter(|(pixel, variance)| pixel.is_finite() && variance.is_finite())
            .map(|(pixel, variance)| {
                let exposed = pixel.as_dvec3() * exposure;
                (variance.as_dvec3() * exposure * exposure / (exposed * exposed + EPSILON)).element_sum() / 3.0
            })
            .collect();
        let not_finite = self.pixels.len() - errors.len();
        let (plain, robust) = summary(errors)?;
        Ok(Some(RelMse { plain, robust, exposure, not_finite }))
    }

    /// Returns the reference of a smaller film, each of whose pixels takes the place of a block of these: with a box
    /// filter, the mean of the block is what the larger pixel shows. `None` unless both sides shrink by one whole
    /// number.
    #[must_use]
    pub fn shrunk(&self, size: UVec2) -> Option<Self> {
        let block = self.size.checked_div(size)?;
        if block.x != block.y || block.x == 0 || block * size != self.size {
            return None;
        }
        let count = f64::from(block.x) * f64::from(block.y);
        // A mean of independent numbers has their mean variance over their count.
        let of_blocks = |numbers: &[Vec3], divisor: f64| -> Vec<Vec3> {
            (0..size.x as usize * size.y as usize)
                .map(|pixel| {
                    let (x, y) = (pixel % size.x as usize, pixel / size.x as usize);
                    let side = block.x as usize;
                    let rows = (y * side..(y + 1) * side).map(|row| row * self.size.x as usize + x * side);
                    let sum: DVec3 = rows.flat_map(|start| &numbers[start..start + side]).map(|v| v.as_dvec3()).sum();
                    (sum / divisor).as_vec3()
                })
                .collect()
        };
        Some(Self {
            size,
            pixels: of_blocks(&self.pixels, count),
            variance: self.variance.as_ref().map(|variance| of_blocks(variance, count * count)),
        })
    }
}

/// Joins independent pictures of the same scene into one reference; their spread gives its variance.
#[derive(Debug, Clone)]
pub struct Batches {
    size: UVec2,
    count: u32,
    sums: Vec<DVec3>,
    squares: Vec<DVec3>,
}

impl Batches {
    /// No picture yet, of `size`.
    #[must_use]
    pub fn new(size: UVec2) -> Self {
        let pixels = size.x as usize * size.y as usize;
        Self { size, count: 0, sums: vec![DVec3::ZERO; pixels], squares: vec![DVec3::ZERO; pixels] }
    }

    /// Adds a picture, made with as many samples as the others and random numbers of its own.
    ///
    /// # Errors
    /// When it is not of the same size.
    pub fn add(&mut self, picture: &Image) -> Result<(), MetricsError> {
        if picture.size != self.size {
            return Err(MetricsError::SizesDiffer { image: picture.size, reference: self.size });
        }
        self.count += 1;
        for ((sum, square), pixel) in self.sums.iter_mut().zip(&mut self.squares).zip(picture.pixels) {
            let value = pixel.as_dvec3();
            *sum += value;
            *square += value * value;
        }
        Ok(())
    }

    /// Returns the mean of the pictures, with the variance of that mean where there are at least two.
    ///
    /// # Errors
    /// When there is no picture or it has no pixels.
    pub fn mean(&self) -> Result<Reference, MetricsError> {
        if self.count == 0 {
            return Err(MetricsError::Empty);
        }
        let n = f64::from(self.count);
        let pixels = self.sums.iter().map(|sum| (sum / n).as_vec3()).collect();
        let variance = (self.count > 1).then(|| {
            let of_pixel = |(sum, square): (&DVec3, &DVec3)| {
                // Rounding may leave a little less than nothing.
                (((square - sum * sum / n) / ((n - 1.0) * n)).max(DVec3::ZERO)).as_vec3()
            };
            self.sums.iter().zip(&self.squares).map(of_pixel).collect()
        });
        Reference::new(self.size, pixels, variance)
    }
}

#[cfg(test)]
mod tests {
    use super::super::rel_mse;
    use super::*;
    use crate::Rng;

    #[test]
    fn the_mean_of_batches_and_its_variance_by_hand() {
        let size = UVec2::new(1, 1);
        let mut batches = Batches::new(size);
        assert_eq!(batches.mean().unwrap_err(), MetricsError::Empty, "nothing yet");
        for value in [1.0, 2.0, 6.0] {
            batches.add(&Image::new(size, &[Vec3::new(value, 4.0, 0.0)]).unwrap()).unwrap();
        }
        let found = batches.mean().unwrap();
        assert_eq!(found.image().pixels(), [Vec3::new(3.0, 4.0, 0.0)], "means");
        // (4 + 1 + 9) / 2 is the variance of one, a third of that the variance of the mean of three.
        assert!((found.variance().unwrap()[0] - Vec3::new(7.0 / 3.0, 0.0, 0.0)).length() < 1e-6, "its variance");
        let two = [Vec3::ONE; 2];
        assert!(batches.add(&Image::new(UVec2::new(2, 1), &two).unwrap()).is_err(), "another size");
    }

    #[test]
    fn a_perfect_picture_is_measured_as_far_off_as_the_reference_says() {
        let (size, mut rng) = (UVec2::splat(64), Rng::new(7, 1));
        let truth: Vec<Vec3> =
            (0..64 * 64).map(|k| Vec3::new(0.05, 0.3, 0.8) * (0.2 + (k % 64) as f32 / 64.0)).collect();
        let mut batches = Batches::new(size);
        for _ in 0..4 {
            let mut noise = || 1.0 + 0.2 * (rng.next_1d() - 0.5);
            let noisy: Vec<Vec3> = truth.iter().map(|&t| t * Vec3::new(noise(), noise(), noise())).collect();
            batches.add(&Image::new(size, &noisy).unwrap()).unwrap();
        }
        let reference = batches.mean().unwrap();
        let measured = rel_mse(&Image::new(size, &truth).unwrap(), &reference.image()).unwrap();
        let own = reference.own_rel_mse().unwrap().unwrap();
        // 12,288 numbers, each variance from four: 5 % is three standard errors.
        assert!((own.plain / measured.plain - 1.0).abs() < 0.05, "{own:?} and {measured:?}");
        assert!(own.robust < own.plain && own.robust > 0.95 * own.plain, "four pixels of 4096 are left out: {own:?}");
    }

    #[test]
    fn a_smaller_film_sees_the_means_of_blocks() {
        let pixels: Vec<Vec3> = (0..8).map(|k| Vec3::splat(k as f32)).collect();
        let reference = Reference::new(UVec2::new(4, 2), pixels, Some(vec![Vec3::splat(0.4); 8])).unwrap();
        let half = reference.shrunk(UVec2::new(2, 1)).unwrap();
        assert_eq!(half.image().pixels(), [Vec3::splat(2.5), Vec3::splat(4.5)], "means of two by two");
        assert!((half.variance().unwrap()[1].x - 0.1).abs() < 1e-7, "a quarter of the variance");
        assert_eq!(reference.shrunk(UVec2::new(4, 2)).unwrap(), reference, "the same size");
        for size in [UVec2::new(3, 2), UVec2::new(2, 2), UVec2::new(8, 4), UVec2::ZERO] {
            assert!(reference.shrunk(size).is_none(), "{size}");
        }
    }

    #[test]
    fn without_a_variance_the_own_error_is_not_known() {
        let reference = Reference::new(UVec2::ONE, vec![Vec3::ONE], None).unwrap();
        assert_eq!(reference.own_rel_mse().unwrap(), None, "unknown");
        assert!(Reference::new(UVec2::ONE, vec![Vec3::ONE], Some(Vec::new())).is_err(), "a variance for each pixel");
    }
}
