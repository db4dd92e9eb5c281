//! The sRGB curve (IEC 61966-2-1), by which pictures hold light.

/// Returns the linear light of an sRGB value in [0, 1].
pub(crate) fn linear_from_srgb(x: f32) -> f32 {
    if x <= 0.040_45 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}
