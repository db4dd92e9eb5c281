//! Trails: what an element swept over between the record and the new point (paper, section 5.3).

use glam::{Mat3A, Vec2};
use radcache::{Elements, Sides};

use crate::kernel::direction_to_square;
use crate::masks::Rows;
use crate::raster::{polygon_rows, rectangle_rows};

/// Where corner `k` of element `e` was, seen from the record but in the frame of the new point: a corner of the texel grid of n x n,
/// unless the frame turned.
fn before(elements: &Elements, e: usize, k: usize, rotation: &Mat3A, n: usize) -> Vec2 {
    if *rotation == Mat3A::IDENTITY {
        let [i, j] = elements.start[e].map(f32::from);
        let [w, h] = elements.size[e].map(f32::from);
        let (right, top) = (k == 1 || k == 2, k >= 2);
        Vec2::new(if right { i + w } else { i }, if top { j + h } else { j }) / n as f32
    } else {
        direction_to_square(*rotation * elements.corner(e, k))
    }
}

/// Adds the trail of the silhouette sides of element `e`: between where the edge was and where it is.
pub(crate) fn sweep_silhouettes(
    elements: &Elements,
    e: usize,
    rotation: &Mat3A,
    n: usize,
    now: &[Vec2; 4],
    bits: &mut Rows,
    trail: &mut Rows,
) {
    let sides = elements.sides[e];
    if sides == Sides::NONE {
        return;
    }
    for a in (0..4).filter(|&k| sides.has(k)) {
        let b = (a + 1) % 4;
        let before = |k| before(elements, e, k, rotation, n);
        for j in polygon_rows(&[before(a), before(b), now[b], now[a]], n, bits) {
            trail[j] |= bits[j];
        }
    }
}

/// Adds the rectangle that encloses the old and the new place of element `e`.
pub(crate) fn sweep_all(
    elements: &Elements,
    e: usize,
    rotation: &Mat3A,
    n: usize,
    now: &[Vec2; 4],
    bits: &mut Rows,
    trail: &mut Rows,
) {
    if elements.finite[e] == 0.0 {
        return;
    }
    let corners: [Vec2; 8] =
        std::array::from_fn(|k| if k < 4 { now[k] } else { before(elements, e, k - 4, rotation, n) });
    for j in rectangle_rows(&corners, n, bits) {
        trail[j] |= bits[j];
    }
}
