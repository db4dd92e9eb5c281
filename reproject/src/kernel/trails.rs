//! Trails in lanes: which sides leave one, and what they swept over between the record and the new point (paper, section 5.3).

#![expect(clippy::cast_possible_truncation, reason = "elements are at most 64 x 64")]

use glam::Mat3A;
use radcache::{LANES, Sides};

use super::board::{Places, Task};
use super::lanes::{Lane, Quads, lanes};
use super::scalar::{grid_corner, swept_box, to_square};
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
                let corners = codes.map(|code| (usize::from(code / 4), (usize::from(code) + end) % 4));
                // Where this end of the side is now, and where it was.
                (u[3 - end], v[3 - end]) = (corners.map(|(e, k)| places.u[k][e]), corners.map(|(e, k)| places.v[k][e]));
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
