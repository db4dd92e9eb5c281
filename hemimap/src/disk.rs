//! The concentric map between the unit square and the unit disk.

use crate::{atan::atan_unit, sincos::sin_cos_eighth_turn};
use glam::Vec2;
use std::f32::consts::FRAC_PI_4;

/// Returns the point of the unit disk that belongs to the point `u` of the unit square.
#[inline]
#[must_use]
pub fn square_to_disk(u: Vec2) -> Vec2 {
    let [x, y, _] = to_disk(u.x, u.y);
    Vec2::new(x, y)
}

/// Returns the point of the unit square that belongs to the point `p` of the unit disk.
#[inline]
#[must_use]
pub fn disk_to_square(p: Vec2) -> Vec2 {
    Vec2::from_array(from_disk(p.x, p.y))
}

/// Returns the index of the texel that holds the coordinate `u`, of `n` texels.
#[inline]
#[must_use]
#[expect(
    clippy::cast_possible_truncation,
    reason = "truncation is the purpose; the cast saturates"
)]
#[expect(clippy::cast_sign_loss, reason = "the cast saturates at 0")]
#[expect(clippy::cast_precision_loss, reason = "n is below 2^24")]
pub fn texel_index(u: f32, n: u32) -> u32 {
    ((u * n as f32) as u32).min(n.saturating_sub(1))
}

/// x, y and the radius.
#[inline]
pub(crate) fn to_disk(u: f32, v: f32) -> [f32; 3] {
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    let horizontal = a.abs() > b.abs();
    let (r, q) = if horizontal { (a, b) } else { (b, a) };
    let (sin, cos) = sin_cos_eighth_turn(q / nonzero(r));
    let (major, minor) = (r * cos, r * sin);
    let (x, y) = if horizontal {
        (major, minor)
    } else {
        (minor, major)
    };
    [x, y, r.abs()]
}

/// u and v.
#[inline]
pub(crate) fn from_disk(x: f32, y: f32) -> [f32; 2] {
    let horizontal = x.abs() > y.abs();
    let (major, minor) = if horizontal { (x, y) } else { (y, x) };
    let r = (x * x + y * y).sqrt();
    let r = if r < 1.0 { r } else { 1.0 };
    let r = r.copysign(major);
    let q = r * (atan_unit(minor / nonzero(major)) * (1.0 / FRAC_PI_4));
    let (a, b) = if horizontal { (r, q) } else { (q, r) };
    [0.5 * a + 0.5, 0.5 * b + 0.5]
}

/// A divisor that is safe at the centre.
#[inline]
fn nonzero(x: f32) -> f32 {
    if x == 0.0 { 1.0 } else { x }
}
