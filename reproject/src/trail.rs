//! Trails: what an element swept over between the record and the new point (paper, section 5.3).

use glam::{Mat3A, Vec2};
use radcache::{Elements, Sides};

use crate::kernel::direction_to_square;
use crate::masks::{Rows, polygon_rows, rectangle_rows};

/// Adds the trail of the silhouette sides of element `e`: between where the edge was, seen from the record but in the frame of
/// the new point, and where it is.
pub(crate) fn sweep_silhouettes(
    elements: &Elements,
    e: usize,
    rotation: &Mat3A,
    n: usize,
    u: &[Vec<f32>; 4],
    v: &[Vec<f32>; 4],
    trail: &mut Rows,
) {
    let sides = elements.sides[e];
    if sides == Sides::NONE {
        return;
    }
    for a in (0..4).filter(|&k| sides.has(k)) {
        let b = (a + 1) % 4;
        let before = |k: usize| direction_to_square(*rotation * elements.corner(e, k));
        let now = |k: usize| Vec2::new(u[k][e], v[k][e]);
        polygon_rows(&[before(a), before(b), now(b), now(a)], n, |j, bits| trail[j] |= bits);
    }
}

/// Adds the rectangle that encloses the old and the new place of element `e`.
pub(crate) fn sweep_all(
    elements: &Elements,
    e: usize,
    rotation: &Mat3A,
    n: usize,
    u: &[Vec<f32>; 4],
    v: &[Vec<f32>; 4],
    trail: &mut Rows,
) {
    if elements.finite[e] == 0.0 {
        return;
    }
    let corners: [Vec2; 8] = std::array::from_fn(|k| {
        if k < 4 { Vec2::new(u[k][e], v[k][e]) } else { direction_to_square(*rotation * elements.corner(e, k - 4)) }
    });
    rectangle_rows(&corners, n, |j, bits| trail[j] |= bits);
}
