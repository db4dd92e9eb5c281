//! A picture of where two pictures differ, with its sign.

use glam::{DVec3, Vec3};

use super::{Image, MetricsError, exposure, same_size};

/// The relative difference that [`signed_difference`] shows in full colour.
pub const DIFFERENCE_RANGE: f64 = 0.5;

/// Keeps the relative difference bounded in the dark: the root of relMSE's constant.
const FLOOR: f64 = 0.1;
/// White: no difference. Red: the picture is too bright. Blue: too dark. Yellow: not finite.
const EQUAL: Vec3 = Vec3::new(247.0, 247.0, 247.0);
const BRIGHTER: Vec3 = Vec3::new(178.0, 24.0, 43.0);
const DARKER: Vec3 = Vec3::new(33.0, 102.0, 172.0);
const NOT_FINITE: [u8; 3] = [255, 220, 0];

/// Returns one 8-bit sRGB colour a pixel: white where the pictures agree, towards red where `image` is brighter,
/// towards blue where it is darker, yellow where either is not finite.
///
/// Shown is the mean over channels of (e I - e R) / (|e R| + 0.1), e being the reference's [`exposure`]; full colour is
/// reached at [`DIFFERENCE_RANGE`].
///
/// # Errors
/// When the sizes differ or the reference has no finite pixel.
pub fn signed_difference(image: &Image, reference: &Image) -> Result<Vec<[u8; 3]>, MetricsError> {
    same_size(image, reference)?;
    let exposure = exposure(reference)?;
    let pixels = image.pixels().iter().zip(reference.pixels());
    Ok(pixels.map(|(i, r)| colour(i.as_dvec3() * exposure, r.as_dvec3() * exposure)).collect())
}

fn colour(i: DVec3, r: DVec3) -> [u8; 3] {
    if !(i.is_finite() && r.is_finite()) {
        return NOT_FINITE;
    }
    let relative = ((i - r) / (r.abs() + FLOOR)).element_sum() / 3.0;
    #[expect(clippy::cast_possible_truncation, reason = "clamped to [-1, 1]")]
    let shown = (relative / DIFFERENCE_RANGE).clamp(-1.0, 1.0) as f32;
    let end = if shown > 0.0 { BRIGHTER } else { DARKER };
    let rgb = EQUAL.lerp(end, shown.abs()).round();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between two colours of 8 bits")]
    let bytes = rgb.to_array().map(|value| value as u8);
    bytes
}

#[cfg(test)]
mod tests {
    use glam::UVec2;

    use super::*;

    #[test]
    fn sign_strength_and_bad_pixels_have_their_colours() {
        // All but the last pixel of the reference are 0.8: the percentile too, so the exposure is 1.
        let reference = [Vec3::splat(0.8); 5];
        let image = [Vec3::splat(0.8), Vec3::splat(1.25), Vec3::splat(0.8 - 0.225), Vec3::ZERO, Vec3::NAN];
        let size = UVec2::new(5, 1);
        let shown =
            signed_difference(&Image::new(size, &image).unwrap(), &Image::new(size, &reference).unwrap()).unwrap();
        assert_eq!(shown[0], [247, 247, 247], "equal");
        assert_eq!(shown[1], [178, 24, 43], "brighter by 0.45 / 0.9, the full range");
        assert_eq!(shown[2], [140, 175, 210], "darker by half the range: the mean of white and blue");
        assert_eq!(shown[3], [33, 102, 172], "beyond the range");
        assert_eq!(shown[4], NOT_FINITE, "not a number");
    }
}
