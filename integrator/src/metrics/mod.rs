//! How far a picture is from its reference: relMSE, LDR-FLIP, the ratio of means, and a picture of the difference.
//!
//! Every measure takes two [`Image`]s of linear RGB of the same size. Pixels with a value that is not finite in either
//! of them are left out of sums and counted, see [`RelMse::not_finite`]; they are never hidden in a mean.

mod difference;
mod flip;
mod ratio;
mod reference;
mod rel_mse;

use glam::{UVec2, Vec3};

pub use difference::{DIFFERENCE_RANGE, signed_difference};
pub use flip::{DEFAULT_PIXELS_PER_DEGREE, Flip, ldr_flip};
pub use ratio::{RatioOfMeans, ratio_of_means};
pub use reference::{Batches, Reference};
pub use rel_mse::{RelMse, exposure, rel_mse};
pub(crate) use rel_mse::{finite_means, floor_sq};

/// A borrowed picture: linear RGB, rows from the top, `size.x * size.y` pixels.
#[derive(Debug, Clone, Copy)]
pub struct Image<'a> {
    size: UVec2,
    pixels: &'a [Vec3],
}

impl<'a> Image<'a> {
    /// Borrows `pixels` as a picture of `size`.
    ///
    /// # Errors
    /// When there is no pixel, or their number is not width times height.
    pub fn new(size: UVec2, pixels: &'a [Vec3]) -> Result<Self, MetricsError> {
        if size.x == 0 || size.y == 0 {
            return Err(MetricsError::Empty);
        }
        if u64::from(size.x) * u64::from(size.y) != pixels.len() as u64 {
            return Err(MetricsError::Length { size, found: pixels.len() });
        }
        Ok(Self { size, pixels })
    }

    /// Width and height in pixels.
    #[must_use]
    pub fn size(&self) -> UVec2 {
        self.size
    }

    /// The pixels, rows from the top.
    #[must_use]
    pub fn pixels(&self) -> &'a [Vec3] {
        self.pixels
    }
}

/// Why two pictures cannot be compared.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MetricsError {
    /// Width or height is 0.
    #[error("the picture has no pixels")]
    Empty,
    /// Pixels and size are at odds.
    #[error("a picture of {} x {} cannot have {found} pixels", size.x, size.y)]
    Length {
        /// Stated size.
        size: UVec2,
        /// Number of pixels.
        found: usize,
    },
    /// The two sizes differ.
    #[error("the pictures differ in size: {} x {} and {} x {}", image.x, image.y, reference.x, reference.y)]
    SizesDiffer {
        /// Size of the picture.
        image: UVec2,
        /// Size of the reference.
        reference: UVec2,
    },
    /// Every pixel is left out.
    #[error("no pixel is finite in both pictures")]
    NothingFinite,
    /// A number that a measure needs is zero, negative or not finite.
    #[error("{0} must be positive and finite")]
    NotPositive(&'static str),
}

fn same_size(image: &Image, reference: &Image) -> Result<(), MetricsError> {
    if image.size == reference.size {
        Ok(())
    } else {
        Err(MetricsError::SizesDiffer { image: image.size, reference: reference.size })
    }
}

/// Pairs (picture, reference) of the pixels that are finite in both.
fn finite_pairs(image: &Image, reference: &Image) -> impl Iterator<Item = (Vec3, Vec3)> {
    image.pixels.iter().copied().zip(reference.pixels.iter().copied()).filter(|(i, r)| i.is_finite() && r.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn size_and_length_must_agree() {
        let pixels = [Vec3::ONE; 6];
        assert!(Image::new(UVec2::new(3, 2), &pixels).is_ok(), "six pixels are three by two");
        let wrong = Image::new(UVec2::new(4, 2), &pixels).unwrap_err();
        assert_eq!(wrong.to_string(), "a picture of 4 x 2 cannot have 6 pixels", "the message names both");
        assert_eq!(Image::new(UVec2::new(0, 2), &[]).unwrap_err(), MetricsError::Empty, "no width");
        // 2^32 * 2^32 pixels wrap to 0 in 64 bits only when multiplied carelessly.
        assert!(Image::new(UVec2::splat(u32::MAX), &pixels).is_err(), "a size whose product is large");
    }

    #[test]
    fn every_measure_refuses_sizes_that_differ() {
        let pixels = [Vec3::ONE; 6];
        let a = Image::new(UVec2::new(3, 2), &pixels).unwrap();
        let b = Image::new(UVec2::new(2, 3), &pixels).unwrap();
        let error = MetricsError::SizesDiffer { image: a.size(), reference: b.size() };
        assert_eq!(rel_mse(&a, &b).unwrap_err(), error, "relMSE");
        assert_eq!(ratio_of_means(&a, &b).unwrap_err(), error, "ratio of means");
        assert_eq!(ldr_flip(&a, &b, 1.0, DEFAULT_PIXELS_PER_DEGREE).unwrap_err(), error, "FLIP");
        assert_eq!(signed_difference(&a, &b).unwrap_err(), error, "difference");
    }

    #[test]
    fn pixels_that_are_not_finite_are_counted_once() {
        let a = [Vec3::ONE, Vec3::new(f32::NAN, 0.0, 0.0), Vec3::ONE, Vec3::new(f32::INFINITY, f32::NAN, 1.0)];
        let b = [Vec3::ONE, Vec3::NAN, Vec3::NEG_INFINITY, Vec3::ONE];
        let size = UVec2::new(2, 2);
        let error = rel_mse(&Image::new(size, &a).unwrap(), &Image::new(size, &b).unwrap()).unwrap();
        assert_eq!(error.not_finite, 3, "all but the first");
    }
}
