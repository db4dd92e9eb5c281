//! The maps between the unit square and the hemisphere around +z.

use crate::disk::{from_disk, to_disk};
use glam::{Vec2, Vec3A};
use std::f32::consts::FRAC_1_PI;

/// Returns the direction that belongs to the point `u` of the unit square, with density cos(theta)/pi.
#[inline]
#[must_use]
pub fn square_to_cosine_hemisphere(u: Vec2) -> Vec3A {
    Vec3A::from_array(to_cosine(u.x, u.y))
}

/// Returns the point of the unit square that belongs to the unit direction `w`.
#[inline]
#[must_use]
pub fn cosine_hemisphere_to_square(w: Vec3A) -> Vec2 {
    Vec2::from_array(from_disk(w.x, w.y))
}

/// Returns the density of [`square_to_cosine_hemisphere`] at `w`, per steradian.
#[inline]
#[must_use]
pub fn square_to_cosine_hemisphere_pdf(w: Vec3A) -> f32 {
    w.z.max(0.0) * FRAC_1_PI
}

/// Returns the direction that belongs to the point `u` of the unit square, with density 1/(2 pi).
#[inline]
#[must_use]
pub fn square_to_uniform_hemisphere(u: Vec2) -> Vec3A {
    Vec3A::from_array(to_uniform(u.x, u.y))
}

/// Returns the point of the unit square that belongs to the unit direction `w`.
#[inline]
#[must_use]
pub fn uniform_hemisphere_to_square(w: Vec3A) -> Vec2 {
    Vec2::from_array(from_uniform(w.x, w.y, w.z))
}

/// Returns the density of [`square_to_uniform_hemisphere`] at `w`, per steradian.
#[inline]
#[must_use]
pub fn square_to_uniform_hemisphere_pdf(w: Vec3A) -> f32 {
    if w.z >= 0.0 { 0.5 * FRAC_1_PI } else { 0.0 }
}

#[inline]
pub(crate) fn to_cosine(u: f32, v: f32) -> [f32; 3] {
    let [x, y, r] = to_disk(u, v);
    [x, y, ((1.0 - r) * (1.0 + r)).sqrt()]
}

#[inline]
pub(crate) fn to_uniform(u: f32, v: f32) -> [f32; 3] {
    let [x, y, r] = to_disk(u, v);
    let s = (2.0 - r * r).sqrt();
    [x * s, y * s, (1.0 - r) * (1.0 + r)]
}

#[inline]
pub(crate) fn from_uniform(x: f32, y: f32, z: f32) -> [f32; 2] {
    let z = if z > 0.0 { z } else { 0.0 };
    let s = (1.0 + z).sqrt();
    from_disk(x / s, y / s)
}
