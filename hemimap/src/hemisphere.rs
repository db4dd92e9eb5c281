//! The maps between the unit square and the hemisphere around +z: the concentric disk, lifted.
//!
//! ```text
//! cosine:   z = sqrt((1 - r)(1 + r)),  x, y as on the disk             pdf = z/pi
//! uniform:  z = (1 - r)(1 + r),        x, y times sqrt(2 - r^2)        pdf = 1/(2 pi)
//! ```
//!
//! Straight up is (1/2, 1/2), the horizon is the edge of the square. Equal areas of the square are equal projected
//! solid angles (cosine) or equal solid angles (uniform).

use crate::disk::{from_disk, to_disk};
use glam::{Vec2, Vec3A};
use std::f32::consts::FRAC_1_PI;

/// Returns the direction that belongs to the point `u` of the unit square; uniform points give the density
/// cos(theta)/pi.
///
/// Local frame, z is the normal. `u` lies in [0, 1] x [0, 1]; z >= 0 and, on the edge, z = 0.
///
/// # Accuracy
/// Each coordinate within 1.4e-7, the length within 2.1e-7 of 1. The bits are the same on every system.
///
/// # Source
/// Malley's lift of the disk of Shirley and Chiu 1997. z comes from the distance to the edge of the square, not
/// from x and y: 1 - x^2 - y^2 can fall below 0.
#[inline]
#[must_use]
pub fn square_to_cosine_hemisphere(u: Vec2) -> Vec3A {
    Vec3A::from_array(to_cosine(u.x, u.y))
}

/// Returns the point of the unit square that belongs to the unit direction `w`: the inverse of
/// [`square_to_cosine_hemisphere`].
///
/// Local frame. Both coordinates lie in [0, 1], both ends taken: see [`texel_index`](crate::texel_index). z is not
/// read: a direction from below the horizon gives the point of its mirror image, and one that rounding has put there
/// does no harm.
///
/// # Accuracy
/// A point of the square comes back within 1.8e-7. A direction comes back within 3e-7 in x and y, in z within 3e-7/z,
/// for z = sqrt(1 - r^2) is steep at the horizon: 5e-4 there.
#[inline]
#[must_use]
pub fn cosine_hemisphere_to_square(w: Vec3A) -> Vec2 {
    Vec2::from_array(from_disk(w.x, w.y))
}

/// Returns the density of [`square_to_cosine_hemisphere`] at the unit direction `w`, per steradian: cos(theta)/pi, and
/// 0 at or below the horizon.
#[inline]
#[must_use]
pub fn square_to_cosine_hemisphere_pdf(w: Vec3A) -> f32 {
    w.z.max(0.0) * FRAC_1_PI
}

/// Returns the direction that belongs to the point `u` of the unit square; uniform points give the density 1/(2 pi).
///
/// Local frame, z is the normal. `u` lies in [0, 1] x [0, 1]; z >= 0 and, on the edge, z = 0.
///
/// # Accuracy
/// Each coordinate within 2e-7, the length within 2.1e-7 of 1. The bits are the same on every system.
///
/// # Source
/// Shirley and Chiu 1997, section 3: the disk's r becomes r sqrt(2 - r^2).
#[inline]
#[must_use]
pub fn square_to_uniform_hemisphere(u: Vec2) -> Vec3A {
    Vec3A::from_array(to_uniform(u.x, u.y))
}

/// Returns the point of the unit square that belongs to the unit direction `w`: the inverse of
/// [`square_to_uniform_hemisphere`].
///
/// Local frame. Both coordinates lie in [0, 1], both ends taken. The sign of z is not read:
/// a direction from below the horizon gives the point of its mirror image.
///
/// # Accuracy
/// A point of the square comes back within 2.4e-7.
#[inline]
#[must_use]
pub fn uniform_hemisphere_to_square(w: Vec3A) -> Vec2 {
    Vec2::from_array(from_uniform(w.x, w.y, w.z))
}

/// Returns the density of [`square_to_uniform_hemisphere`] at the unit direction `w`, per steradian: 1/(2 pi), and 0
/// below the horizon.
#[inline]
#[must_use]
pub fn square_to_uniform_hemisphere_pdf(w: Vec3A) -> f32 {
    if w.z >= 0.0 { 0.5 * FRAC_1_PI } else { 0.0 }
}

/// (1 - r)(1 + r), where 1 - r is 2u, 2v, 2 (1 - u) or 2 (1 - v): none of them is rounded, and r itself is.
#[inline]
fn rim_factor(u: f32, v: f32) -> f32 {
    let rim = 2.0 * least(least(u, 1.0 - u), least(v, 1.0 - v));
    rim * (2.0 - rim)
}

/// The lesser of two numbers, none of which is NaN: one instruction.
#[inline]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline]
pub(crate) fn to_cosine(u: f32, v: f32) -> [f32; 3] {
    let [x, y, _] = to_disk(u, v);
    [x, y, rim_factor(u, v).sqrt()]
}

#[inline]
pub(crate) fn to_uniform(u: f32, v: f32) -> [f32; 3] {
    let [x, y, r] = to_disk(u, v);
    let stretch = (2.0 - r * r).sqrt();
    [x * stretch, y * stretch, rim_factor(u, v)]
}

#[inline]
pub(crate) fn from_uniform(x: f32, y: f32, z: f32) -> [f32; 2] {
    // 2 - r^2 = 1 + z: no digits are lost, at the pole or at the horizon.
    let stretch = (1.0 + z.abs()).sqrt();
    from_disk(x / stretch, y / stretch)
}
