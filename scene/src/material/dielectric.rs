//! A smooth boundary between two dielectrics.
//!
//! ```text
//! R = {[(c - n ct) / (c + n ct)]^2 + [(n c - ct) / (n c + ct)]^2} / 2,   ct = sqrt(1 - (1 - c^2) / n^2)
//! ```
//! Polarisation is not tracked: R is the mean of both states.

use glam::{Vec3, Vec3A};

use super::{BsdfSample, mirrored};

/// Returns the share of unpolarised light that is reflected, for the cosine of incidence in [0, 1] and `eta`, the index
/// beyond the surface over that before it; 1 from the critical angle on.
///
/// # Source
/// Born, Wolf 1999: Principles of Optics, 1.5.2.
#[inline]
#[must_use]
pub fn fresnel_dielectric(cosine: f32, eta: f32) -> f32 {
    let cosine_beyond_sq = 1.0 - (1.0 - cosine * cosine) / (eta * eta);
    if cosine_beyond_sq <= 0.0 {
        return 1.0;
    }
    fresnel(cosine, cosine_beyond_sq.sqrt(), eta)
}

#[inline]
fn fresnel(cosine: f32, cosine_beyond: f32, eta: f32) -> f32 {
    let across = (cosine - eta * cosine_beyond) / (cosine + eta * cosine_beyond);
    let along = (eta * cosine - cosine_beyond) / (eta * cosine + cosine_beyond);
    0.5 * (across * across + along * along)
}

/// Returns reflection and, below the critical angle, refraction, with their shares of the radiance as weights.
#[inline]
pub(super) fn branches(eta: f32, tint: Vec3, wo: Vec3A) -> (BsdfSample, Option<BsdfSample>) {
    // sin^2 from x and y: 1 - z^2 loses digits near the normal, where glass is seen most.
    let sin_sq = (wo.x * wo.x + wo.y * wo.y).min(1.0);
    let cosine_beyond_sq = 1.0 - sin_sq / (eta * eta);
    if cosine_beyond_sq <= 0.0 {
        return (mirrored(wo, Vec3::ONE), None);
    }
    let cosine_beyond = cosine_beyond_sq.sqrt();
    let reflectance = fresnel(wo.z, cosine_beyond, eta);
    // Radiance over the square of the index is what refraction keeps.
    let radiance_scale = 1.0 / (eta * eta);
    let refracted = BsdfSample {
        wi: Vec3A::new(-wo.x / eta, -wo.y / eta, -cosine_beyond).normalize(),
        weight: tint * ((1.0 - reflectance) * radiance_scale),
        pdf: 0.0,
        delta: true,
        transmitted: true,
        radiance_scale,
    };
    (mirrored(wo, Vec3::splat(reflectance)), Some(refracted))
}
