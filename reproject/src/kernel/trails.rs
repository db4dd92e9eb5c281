//! Trails in lanes: which sides leave one, and what they swept over between the record and the new point (paper, section 5.3).
//!
//! A silhouette has a margin besides. It lies somewhere in a texel, and whether that texel belongs to the near or to the far surface is what one ray there met. Where the
//! surface then retreats, new rays find what it really left free beyond its side, but if it had been given too much, nobody would look for that: it would
//! keep a sixth of a texel too much on the average. So its last texel inside is unknown too, as far as the side moved: then errors of both signs are seen
//! by rays, or neither is.

#![expect(clippy::cast_possible_truncation, reason = "elements are at most 64 x 64")]

use glam::Mat3A;
use radcache::{LANES, Sides};

use super::board::{Places, Task};
use super::lanes::{Lane, Quads, lanes};
use super::scalar::{grid_corner, margin_end, margin_texels, swept_box, to_square};
use crate::Trails;

/// Lists the sides that leave trails, in order of elements; gives their number. The list is padded with the first side.
#[inline(always)]
pub(super) fn list_trails(task: &Task<'_>, places: &mut Places) -> usize {
    let elements = task.elements;
    let Places { trails: list, marked, .. } = places;
    let mut count = 0;
    match task.settings.trails {
        Trails::Silhouettes => {
            // Without a branch on the sides, which nobody could predict.
            let mut with_sides = 0;
            for (e, sides) in elements.sides[..elements.len()].iter().enumerate() {
                marked[with_sides] = e as u16;
                with_sides += usize::from(*sides != Sides::NONE);
            }
            for &e in &marked[..with_sides] {
                let sides = elements.sides[usize::from(e)];
                for k in 0..4 {
                    list[count] = 4 * e + k;
                    count += usize::from(sides.has(usize::from(k)));
                }
            }
        }
        Trails::All => {
            for (e, &finite) in elements.finite[..elements.len()].iter().enumerate() {
                list[count] = 4 * e as u16;
                count += usize::from(finite != 0.0);
            }
        }
    }
    let end = count.next_multiple_of(LANES);
    list[count..end].fill(0);
    places.trail_count = count;
    count
}

/// What 16 trails cover: for a side what lies between where it was and where it is, else the rectangle that encloses an element at both
/// places.
#[inline(always)]
pub(super) fn trail_quads(task: &Task<'_>, places: &Places, at: usize) -> (Quads, Quads) {
    let codes = lanes(&places.trails, at);
    let (mut u, mut v) = ([[0.0; LANES]; 4], [[0.0; LANES]; 4]);
    match task.settings.trails {
        Trails::Silhouettes => {
            let turned = task.rotation != Mat3A::IDENTITY;
            for end in 0..2 {
                let corners = corners(codes, end);
                // Where this end of the side is now, and where it was.
                (u[3 - end], v[3 - end]) = now(places, &corners);
                (u[end], v[end]) = if turned { turned_corners(task, corners) } else { grid_corners(task, corners) };
            }
        }
        Trails::All => {
            for (e, &code) in codes.iter().enumerate() {
                let [low, high] = swept_box(task, places, usize::from(code / 4));
                (u[0][e], u[1][e], u[2][e], u[3][e]) = (low.x, high.x, high.x, low.x);
                (v[0][e], v[1][e], v[2][e], v[3][e]) = (low.y, low.y, high.y, high.y);
            }
        }
    }
    (u, v)
}

/// The margins of 16 sides whose trails cover `trails`.
#[inline(always)]
pub(super) fn margin_quads(task: &Task<'_>, places: &Places, at: usize, trails: &(Quads, Quads)) -> (Quads, Quads) {
    let codes = lanes(&places.trails, at);
    let texels = codes.map(|code| margin_texels(task, places, code));
    let (mut u, mut v) = ([[0.0; LANES]; 4], [[0.0; LANES]; 4]);
    for end in 0..2 {
        let (now, before) = (3 - end, end);
        let (beside_u, beside_v) = self::now(places, &corners(codes, now));
        (u[end], v[end]) = (trails.0[now], trails.1[now]);
        for e in 0..LANES {
            let at = |k: usize| [trails.0[k][e], trails.1[k][e]];
            [u[now][e], v[now][e]] = margin_end(at(now), at(before), [beside_u[e], beside_v[e]], texels[e]);
        }
    }
    (u, v)
}

/// The elements of 16 sides, and the corners that lie so many after the first of each side.
#[inline(always)]
fn corners(codes: &Lane<u16>, after: usize) -> Lane<(usize, usize)> {
    codes.map(|code| (usize::from(code / 4), (usize::from(code) + after) % 4))
}

/// Where corners are now.
#[inline(always)]
fn now(places: &Places, corners: &Lane<(usize, usize)>) -> (Lane<f32>, Lane<f32>) {
    (corners.map(|(e, k)| places.u[k][e]), corners.map(|(e, k)| places.v[k][e]))
}

/// Corners as the record saw them, in the frame of a point with the same normal.
#[inline(always)]
fn grid_corners(task: &Task<'_>, corners: Lane<(usize, usize)>) -> (Lane<f32>, Lane<f32>) {
    let n = task.n as f32;
    let grid = corners.map(|(e, k)| grid_corner(task.elements, e, k));
    (grid.map(|corner| corner.x / n), grid.map(|corner| corner.y / n))
}

/// Corners as the record saw them, in the frame of a point whose normal is another.
#[inline(always)]
fn turned_corners(task: &Task<'_>, corners: Lane<(usize, usize)>) -> (Lane<f32>, Lane<f32>) {
    let elements = task.elements;
    let x = corners.map(|(e, k)| elements.x[k][e]);
    let y = corners.map(|(e, k)| elements.y[k][e]);
    let z = corners.map(|(e, k)| elements.z[k][e]);
    let (m0, m1, m2) = (task.rotation.x_axis, task.rotation.y_axis, task.rotation.z_axis);
    let (mut u, mut v) = ([0.0; LANES], [0.0; LANES]);
    for e in 0..LANES {
        let lx = m0.x * x[e] + m1.x * y[e] + m2.x * z[e];
        let ly = m0.y * x[e] + m1.y * y[e] + m2.y * z[e];
        let lz = m0.z * x[e] + m1.z * y[e] + m2.z * z[e];
        (u[e], v[e]) = to_square(lx, ly, lz);
    }
    (u, v)
}
