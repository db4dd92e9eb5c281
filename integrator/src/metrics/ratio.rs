//! The ratio of two pictures' means: the bias that noise does not hide.

use glam::DVec3;

use super::{Image, MetricsError, finite_pairs, same_size};

/// The result of [`ratio_of_means`]. A ratio is 1 where both means are 0 and infinite where the reference's alone is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RatioOfMeans {
    /// Mean over pixels and channels of the picture over that of the reference.
    pub overall: f64,
    /// The same for red, green and blue.
    pub channels: [f64; 3],
    /// Means of the picture's channels.
    pub image: [f64; 3],
    /// Means of the reference's channels.
    pub reference: [f64; 3],
}

/// Returns the mean of `image` over the mean of `reference`, from the pixels that are finite in both. Sums are in
/// `f64`.
///
/// # Errors
/// When the sizes differ or no pixel is finite in both.
pub fn ratio_of_means(image: &Image, reference: &Image) -> Result<RatioOfMeans, MetricsError> {
    same_size(image, reference)?;
    let (mut i_sum, mut r_sum, mut count) = (DVec3::ZERO, DVec3::ZERO, 0_usize);
    for (i, r) in finite_pairs(image, reference) {
        i_sum += i.as_dvec3();
        r_sum += r.as_dvec3();
        count += 1;
    }
    if count == 0 {
        return Err(MetricsError::NothingFinite);
    }
    Ok(RatioOfMeans {
        overall: ratio(i_sum.element_sum(), r_sum.element_sum()),
        channels: [0, 1, 2].map(|channel| ratio(i_sum[channel], r_sum[channel])),
        image: (i_sum / count as f64).to_array(),
        reference: (r_sum / count as f64).to_array(),
    })
}

/// Nothing is as much as nothing.
fn ratio(image: f64, reference: f64) -> f64 {
    if image == reference { 1.0 } else { image / reference }
}

#[cfg(test)]
mod tests {
    use glam::{UVec2, Vec3};

    use super::*;

    #[test]
    fn means_and_their_ratios_by_hand() {
        let image = [Vec3::new(1.0, 2.0, 0.0), Vec3::new(3.0, 2.0, 0.0), Vec3::NAN];
        let reference = [Vec3::new(1.0, 1.0, 0.0), Vec3::new(1.0, 3.0, 2.0), Vec3::ONE];
        let size = UVec2::new(3, 1);
        let image = Image::new(size, &image).unwrap();
        let reference = Image::new(size, &reference).unwrap();
        let found = ratio_of_means(&image, &reference).unwrap();
        assert_eq!(found.image, [2.0, 2.0, 0.0], "means of the picture");
        assert_eq!(found.reference, [1.0, 2.0, 1.0], "means of the reference");
        assert_eq!(found.channels, [2.0, 1.0, 0.0], "ratios a channel");
        assert_eq!(found.overall, 1.0, "8 over 8");
    }

    #[test]
    fn black_is_as_much_as_black() {
        let black = [Vec3::ZERO];
        let black = Image::new(UVec2::ONE, &black).unwrap();
        assert_eq!(ratio_of_means(&black, &black).unwrap().overall, 1.0, "nothing over nothing");
    }
}
