//! The concentric map between the unit square and the unit disk: area stays in proportion (everywhere pi to 1),
//! neighbours stay neighbours, and rings of the square become rings of the disk.
//!
//! ```text
//! a = 2u - 1,  b = 2v - 1
//! |a| > |b|:  r = a,  phi = pi/4 b/a
//! else:       r = b,  phi = pi/2 - pi/4 a/b          x = r cos phi,  y = r sin phi
//!
//! r = |(x, y)|
//! |x| > |y|:  a = sgn(x) r,  b = 4/pi a atan(y/x)
//! else:       b = sgn(y) r,  a = 4/pi b atan(x/y)    u = (a + 1)/2,  v = (b + 1)/2
//! ```
//!
//! Both cases are one computation with the coordinates exchanged, so that the code selects instead of branching.

use crate::{atan::atan_unit, sincos::sin_cos_eighth_turn};
use glam::Vec2;
use std::f32::consts::FRAC_PI_4;

/// Returns the point of the unit disk that belongs to the point `u` of the unit square.
///
/// `u` lies in [0, 1] x [0, 1]; (1/2, 1/2) gives the centre and the edge of the square gives the rim. Areas grow by pi
/// everywhere, so that uniform points stay uniform. The map is continuous; its derivative jumps on the two diagonals.
///
/// # Accuracy
/// Each coordinate is within 1.4e-7 of the exact value for the same `u`; the bits are the same on every system.
///
/// # Source
/// Shirley and Chiu 1997, "A Low Distortion Map Between Disk and Square"; two cases in place of their four.
#[inline]
#[must_use]
pub fn square_to_disk(u: Vec2) -> Vec2 {
    let [x, y, _] = to_disk(u.x, u.y);
    Vec2::new(x, y)
}

/// Returns the point of the unit square that belongs to the point `p` of the unit disk: the inverse of
/// [`square_to_disk`].
///
/// Both coordinates lie in [0, 1], both ends taken: see [`texel_index`]. The centre gives (1/2, 1/2), and a finite
/// point outside the disk is moved to the rim first.
///
/// # Accuracy
/// A point of the square comes back within 1.8e-7 (1.5 `f32::EPSILON`) from [`square_to_disk`]; of that, the polynomial
/// arctangent has a share of at most 0.8e-7.
#[inline]
#[must_use]
pub fn disk_to_square(p: Vec2) -> Vec2 {
    Vec2::from_array(from_disk(p.x, p.y))
}

/// Returns which of `n` equal cells of [0, 1] holds the coordinate `u`, from 0 to `n` - 1.
///
/// The maps back to the square reach 1 on the rim, where `u * n` alone would name cell `n`. What lies outside [0, 1]
/// goes to the nearest cell, NaN to cell 0. `n` is at least 1 and below 2^24.
///
/// ```
/// assert_eq!(hemimap::texel_index(0.5, 32), 16);
/// assert_eq!(hemimap::texel_index(1.0, 32), 31);
/// ```
#[inline]
#[must_use]
pub fn texel_index(u: f32, n: u32) -> u32 {
    debug_assert!((1..1 << 24).contains(&n), "{n} cells");
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "n is exact below 2^24, and the cast back rounds down and saturates, as wanted"
    )]
    let cell = (u * n as f32) as u32;
    cell.min(n.saturating_sub(1))
}

/// x, y and the radius.
#[inline]
pub(crate) fn to_disk(u: f32, v: f32) -> [f32; 3] {
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    let lies = a.abs() > b.abs();
    let (r, q) = if lies { (a, b) } else { (b, a) };
    let (sin, cos) = sin_cos_eighth_turn(q / nonzero(r));
    let (along, across) = (r * cos, r * sin);
    let (x, y) = if lies { (along, across) } else { (across, along) };
    [x, y, r.abs()]
}

/// u and v.
#[inline]
pub(crate) fn from_disk(x: f32, y: f32) -> [f32; 2] {
    let lies = x.abs() > y.abs();
    let (along, across) = if lies { (x, y) } else { (y, x) };
    let length = (x * x + y * y).sqrt();
    // Not `f32::min`: its rule for NaN costs more than the one instruction that this is.
    let length = if length < 1.0 { length } else { 1.0 };
    let r = length.copysign(along);
    let q = r * (atan_unit(across / nonzero(along)) * (1.0 / FRAC_PI_4));
    let (a, b) = if lies { (r, q) } else { (q, r) };
    [0.5 * a + 0.5, 0.5 * b + 0.5]
}

/// A divisor that keeps the centre from 0/0: there the dividend is 0 as well, and any angle is right.
#[inline]
fn nonzero(x: f32) -> f32 {
    if x == 0.0 { 1.0 } else { x }
}
