//! GGX microfacets with separable Smith masking, sampled by their visible normals.
//!
//! ```text
//! f = D(h) G1(wo) G1(wi) / (4 cos_o cos_i)
//! D(h) = alpha^2 / (pi (alpha^2 z^2 + x^2 + y^2)^2),   h = (x, y, z)
//! G1(w) = 2 / (1 + sqrt(1 + alpha^2 tan^2))
//! ```
//!
//! # Source
//! Walter, Marschner, Li, Torrance 2007: Microfacet Models for Refraction through Rough Surfaces (D and G1). Dupuy,
//! Benyoub 2023: Sampling Visible GGX Normals with Spherical Caps.

use std::f32::consts::PI;

use glam::{Vec2, Vec3A};

/// Returns D(h) / 4: the shared factor of f and pdf.
#[inline]
fn quarter_distribution(alpha: f32, h: Vec3A) -> f32 {
    // alpha^2 z^2 + sin^2 instead of (alpha^2 - 1) z^2 + 1, which loses all digits where alpha is small.
    let alpha_sq = alpha * alpha;
    let width = alpha_sq * h.z * h.z + h.x * h.x + h.y * h.y;
    alpha_sq / (4.0 * PI * width * width)
}

/// Returns G1(w) / cos for w above the surface.
#[inline]
pub(super) fn masking_over_cosine(alpha: f32, w: Vec3A) -> f32 {
    let sin_sq = w.x * w.x + w.y * w.y;
    2.0 / (w.z + (w.z * w.z + alpha * alpha * sin_sq).sqrt())
}

/// Returns f without its reflectance, both directions above the surface, `h` the unit vector half way.
#[inline]
pub(super) fn eval(alpha: f32, wo: Vec3A, wi: Vec3A, h: Vec3A) -> f32 {
    quarter_distribution(alpha, h) * masking_over_cosine(alpha, wo) * masking_over_cosine(alpha, wi)
}

/// Returns the density of [`sample`], per steradian of wi.
#[inline]
pub(super) fn pdf(alpha: f32, wo: Vec3A, h: Vec3A) -> f32 {
    quarter_distribution(alpha, h) * masking_over_cosine(alpha, wo)
}

/// Returns the mirror direction of `wo` at a visible microfacet; it may lie below the surface.
#[inline]
pub(super) fn sample(alpha: f32, wo: Vec3A, u: Vec2) -> Vec3A {
    // In the space where the microfacets form a sphere, visible normals are half way between wo and the points of a
    // cap.
    let stretched = Vec3A::new(alpha * wo.x, alpha * wo.y, wo.z).normalize();
    let (sin_phi, cos_phi) = hemimap::sin_cos_turn(u.x);
    let z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let h = Vec3A::new(r * cos_phi, r * sin_phi, z) + stretched;
    let h = Vec3A::new(alpha * h.x, alpha * h.y, h.z.max(0.0)).normalize_or(Vec3A::Z);
    h * (2.0 * wo.dot(h)) - wo
}
