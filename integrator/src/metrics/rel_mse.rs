//! Relative mean squared error, plain and robust, of exposed pictures.
//!
//! ```text
//! e      = 0.8 / (90th percentile over the reference's pixels of (r + g + b) / 3), see exposure()
//! relMSE = mean over pixels and channels of (e I - e R)^2 / ((e R)^2 + 0.01)
//! ```

use glam::Vec3;

use super::{Image, MetricsError, finite_pairs, same_size};

/// Keeps black pixels from ruling the mean: a tenth of full scale, squared.
pub(super) const EPSILON: f64 = 0.01;
/// The share of pixels that the robust figure leaves out: fireflies, which a viewer would remove.
const WORST_SHARE: f64 = 0.001;
/// What the 90th percentile is brought to.
const TARGET: f64 = 0.8;
const PERCENTILE: f64 = 0.9;

/// The result of [`rel_mse`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RelMse {
    /// Mean over all finite pixels and their channels.
    pub plain: f64,
    /// The same without the worst 0.1 % of the pixels (rounded down), ranked by their mean over channels.
    pub robust: f64,
    /// The factor that both pictures were multiplied by, see [`exposure`].
    pub exposure: f64,
    /// Pixels left out because a value was not finite.
    pub not_finite: usize,
}

/// Returns relMSE of `image` against `reference`, both exposed by the reference's [`exposure`]. Sums are in `f64`.
///
/// # Errors
/// When the sizes differ or no pixel is finite in both.
pub fn rel_mse(image: &Image, reference: &Image) -> Result<RelMse, MetricsError> {
    same_size(image, reference)?;
    let exposure = exposure(reference)?;
    let errors: Vec<f64> = finite_pairs(image, reference)
        .map(|(i, r)| {
            let (i, r) = (i.as_dvec3() * exposure, r.as_dvec3() * exposure);
            ((i - r) * (i - r) / (r * r + EPSILON)).element_sum() / 3.0
        })
        .collect();
    let not_finite = image.pixels().len() - errors.len();
    let (plain, robust) = summary(errors)?;
    Ok(RelMse { plain, robust, exposure, not_finite })
}

/// The mean of the errors of pixels, and that without the worst 0.1 %.
pub(super) fn summary(mut errors: Vec<f64>) -> Result<(f64, f64), MetricsError> {
    if errors.is_empty() {
        return Err(MetricsError::NothingFinite);
    }
    let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len() as f64;
    let plain = mean(&errors);
    #[expect(clippy::cast_possible_truncation, reason = "a share of a length")]
    let kept = errors.len() - (errors.len() as f64 * WORST_SHARE) as usize;
    if kept < errors.len() {
        errors.select_nth_unstable_by(kept, f64::total_cmp);
    }
    Ok((plain, mean(&errors[..kept])))
}

/// Returns 0.8 divided by the 90th percentile over the finite pixels of `reference` of (r + g + b) / 3. Where that is
/// not positive, in a picture that is black almost everywhere, it is the percentile of what is positive, so that errors
/// stay relative; the exposure is 1 where nothing is.
///
/// # Errors
/// When no pixel is finite.
pub fn exposure(reference: &Image) -> Result<f64, MetricsError> {
    exposure_of(finite_means(reference.pixels())).ok_or(MetricsError::NothingFinite)
}

/// The means of R, G and B of the finite pixels.
pub(crate) fn finite_means(pixels: &[Vec3]) -> Vec<f64> {
    pixels.iter().filter(|pixel| pixel.is_finite()).map(|pixel| pixel.as_dvec3().element_sum() / 3.0).collect()
}

/// What keeps dark pixels from ruling relative errors, in the units of finite pixels with these means m of R, G and B:
/// m^2 and this are the denominator of relMSE.
pub(crate) fn floor_sq(means: Vec<f64>) -> f64 {
    let exposure = exposure_of(means).unwrap_or(1.0);
    EPSILON / (exposure * exposure)
}

/// The exposure of pixels with these means of R, G and B; `None` without a pixel.
fn exposure_of(mut means: Vec<f64>) -> Option<f64> {
    if means.is_empty() {
        return None;
    }
    let bright = percentile(&mut means, PERCENTILE);
    if bright > 0.0 {
        return Some(TARGET / bright);
    }
    means.retain(|&mean| mean > 0.0);
    Some(if means.is_empty() { 1.0 } else { TARGET / percentile(&mut means, PERCENTILE) })
}

/// The `q`-th quantile by linear interpolation between the two nearest of the sorted values, as numpy's default.
fn percentile(values: &mut [f64], q: f64) -> f64 {
    let position = q * (values.len() - 1) as f64;
    #[expect(clippy::cast_possible_truncation, reason = "between 0 and the length")]
    let below = position as usize;
    let (_, &mut low, above) = values.select_nth_unstable_by(below, f64::total_cmp);
    let high = above.iter().copied().min_by(f64::total_cmp).unwrap_or(low);
    low + (high - low) * (position - below as f64)
}

#[cfg(test)]
mod tests {
    use glam::{UVec2, Vec3};

    use super::*;

    fn row(pixels: &[Vec3]) -> Image<'_> {
        let width = u32::try_from(pixels.len()).unwrap();
        Image::new(UVec2::new(width, 1), pixels).unwrap()
    }

    #[test]
    fn percentile_interpolates_as_numpy() {
        // numpy.percentile([3, 1, 2, 10], 90) = 3 + 0.7 * 7
        assert!((percentile(&mut [3.0, 1.0, 2.0, 10.0], 0.9) - 7.9).abs() < 1e-12, "between the upper two");
        assert!((percentile(&mut [5.0], 0.9) - 5.0).abs() < 1e-12, "one value");
        assert!((percentile(&mut [1.0, 2.0, 3.0], 0.5) - 2.0).abs() < 1e-12, "the median");
    }

    #[test]
    fn two_pixels_by_hand() {
        // Means 1 and 2: the percentile is 1.9, e = 0.8 / 1.9. The first pixel is off by 0.5 in red.
        let reference = [Vec3::ONE, Vec3::splat(2.0)];
        let image = [Vec3::new(1.5, 1.0, 1.0), Vec3::splat(2.0)];
        let found = rel_mse(&row(&image), &row(&reference)).unwrap();
        let e = 0.8 / 1.9;
        let expected = (0.5 * e) * (0.5 * e) / (e * e + 0.01) / 6.0;
        assert!((found.exposure - e).abs() < 1e-12, "exposure {}", found.exposure);
        assert!((found.plain - expected).abs() < 1e-12, "plain {} is not {expected}", found.plain);
        assert!((found.robust - expected).abs() < 1e-12, "of two pixels none is left out: {}", found.robust);
    }

    #[test]
    fn the_robust_figure_leaves_out_one_pixel_in_a_thousand() {
        let reference = vec![Vec3::splat(0.8); 2000]; // exposure 1
        let mut image = reference.clone();
        image[5] = Vec3::splat(1000.0);
        image[1005] = Vec3::splat(-1000.0);
        image[1500] = Vec3::splat(0.9);
        let found = rel_mse(&row(&image), &row(&reference)).unwrap();
        let small = 0.01 / 0.65 / 1998.0;
        assert!((found.robust - small).abs() < 1e-6 * small, "robust {} is not {small}", found.robust);
        assert!(found.plain > 1000.0, "plain {} keeps the fireflies", found.plain);

        // One pixel fewer, and only one may go: 1999 * 0.001 rounds down.
        let found = rel_mse(&row(&image[..1999]), &row(&reference[..1999])).unwrap();
        assert!(found.robust > 500.0, "the second firefly stays: {}", found.robust);
    }

    #[test]
    fn pixels_that_are_not_finite_are_left_out_and_counted() {
        let reference = [Vec3::ONE, Vec3::NAN, Vec3::ONE];
        let image = [Vec3::ONE, Vec3::ONE, Vec3::INFINITY];
        let found = rel_mse(&row(&image), &row(&reference)).unwrap();
        assert_eq!((found.plain, found.not_finite), (0.0, 2), "one pixel remains, and it is right");
        let nothing = rel_mse(&row(&image[1..]), &row(&reference[1..])).unwrap_err();
        assert_eq!(nothing, MetricsError::NothingFinite, "no pixel remains");
    }

    #[test]
    fn errors_of_what_is_small_on_black_are_relative() {
        let mut reference = [Vec3::ZERO; 40];
        let mut image = reference;
        let of = |light: f32, reference: &mut [Vec3; 40], image: &mut [Vec3; 40]| {
            (reference[7], image[7]) = (Vec3::splat(light), Vec3::splat(1.1 * light));
            rel_mse(&row(&*image), &row(&*reference)).unwrap()
        };
        let [bright, dim] = [1.0, 1e-3].map(|light| of(light, &mut reference, &mut image));
        assert!((bright.exposure - 0.8).abs() < 1e-12, "exposure {}", bright.exposure);
        assert!((dim.plain / bright.plain - 1.0).abs() < 1e-5, "{} and {}", dim.plain, bright.plain);
    }

    #[test]
    fn a_black_reference_is_not_exposed() {
        let found = rel_mse(&row(&[Vec3::splat(0.1)]), &row(&[Vec3::ZERO])).unwrap();
        assert!((found.exposure - 1.0).abs() < 1e-12, "exposure {}", found.exposure);
        assert!((found.plain - 1.0).abs() < 1e-6, "0.1^2 / 0.01 = 1, not {}", found.plain);
    }
}
