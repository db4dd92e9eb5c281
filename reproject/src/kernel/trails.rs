//! Trails: what something unknown may have come into view in, between the record and the new point (paper, section
//! 5.3).
//!
//! A silhouette that retreats leaves what it uncovers, and a margin besides. It lies somewhere in a texel, and whether
//! that texel belongs to the near or to the far surface is what one ray there met. Where the surface then retreats, new
//! rays find what it really left free beyond its side, but if it had been given too much, nobody would look for that:
//! it would keep a sixth of a texel too much on the average. So what the side has just left behind it is unknown as far
//! inside as the trail is wide, up to a texel: then errors of both signs are seen by rays, or neither is. A silhouette
//! that advances covers its trail itself.

#![expect(clippy::cast_possible_truncation, reason = "at most 4 x 64 x 64 sides")]
#![expect(clippy::needless_range_loop, reason = "one index for many arrays")]

use glam::{Vec2, Vec3A};
use radcache::{Elements, LANES};

use super::board::{Lane, Places, Task};
use super::lanes::{Quads, lanes, max, min};
use super::scalar::{direction_to_square, to_square};
use crate::Trails;

/// Lists what leaves a trail, in order: sides that retreat, or elements that move. Gives their number; the list is
/// padded to whole chunks of lanes with the first side or element.
#[inline(always)]
pub(super) fn list_trails(task: &Task<'_>, places: &mut Places) -> usize {
    let list = &mut places.trails;
    let mut count = 0;
    // Each is written, and stays if it is counted: no branch, which nobody could predict.
    match task.settings.trails {
        Trails::Silhouettes | Trails::Uncovered => {
            let outline = task.elements.outline();
            for at in (0..outline.len()).step_by(LANES) {
                let [x, y, z] =
                    [&outline.normals[0], &outline.normals[1], &outline.normals[2]].map(|axis| lanes(axis, at));
                let mut retreats = [0; LANES];
                for side in 0..LANES {
                    let step_inwards = task.offset.x * x[side] + task.offset.y * y[side] + task.offset.z * z[side];
                    retreats[side] = usize::from(step_inwards < 0.0);
                }
                for side in 0..LANES {
                    list[count] = (at + side) as u16;
                    count += retreats[side];
                }
            }
        }
        Trails::All => {
            for (e, &finite) in task.elements.finite[..task.elements.len()].iter().enumerate() {
                list[count] = e as u16;
                count += usize::from(finite != 0.0);
            }
        }
    }
    list[count..count.next_multiple_of(LANES)].fill(0);
    places.trail_count = count;
    count
}

/// What 16 of the listed trails cover: for a side what it left, else the rectangle that encloses an element at both
/// places.
#[inline(always)]
pub(super) fn trail_quads(task: &Task<'_>, places: &Places, at: usize) -> (Quads, Quads) {
    let numbers = lanes(&places.trails, at);
    let (mut u, mut v) = ([[0.0; LANES]; 4], [[0.0; LANES]; 4]);
    match task.settings.trails {
        Trails::Silhouettes | Trails::Uncovered => {
            let outline = task.elements.outline();
            let mut now = [([0.0; LANES], [0.0; LANES]); 2];
            for end in 0..2 {
                let corners = pick(&outline.ends[end], numbers);
                now[end] = (pick(&places.u, &corners), pick(&places.v, &corners));
                (u[end], v[end]) = if task.is_turned() {
                    turned_corners(task, &corners)
                } else {
                    (pick(&outline.u[end], numbers), pick(&outline.v[end], numbers))
                };
            }
            let (margin, behind) = (pick(&outline.margin, numbers), pick(&outline.behind, numbers));
            for e in 0..LANES {
                let ends = [[now[0].0[e], now[0].1[e]], [now[1].0[e], now[1].1[e]]];
                for end in 0..2 {
                    let before = follow([u[end][e], v[end][e]], ends[end], task.behind(behind[e]));
                    [u[end][e], v[end][e]] = before;
                    [u[3 - end][e], v[3 - end][e]] = left_behind(before, ends[end], ends, task.margin(margin[e]));
                }
            }
        }
        Trails::All => {
            for (lane, &number) in numbers.iter().enumerate() {
                let [low, high] = swept_box(task, places, number.into());
                (u[0][lane], u[1][lane], u[2][lane], u[3][lane]) = (low.x, high.x, high.x, low.x);
                (v[0][lane], v[1][lane], v[2][lane], v[3][lane]) = (low.y, low.y, high.y, high.y);
            }
        }
    }
    (u, v)
}

/// Number `t` of the listed trails.
pub(super) fn trail_polygon(task: &Task<'_>, places: &Places, t: usize) -> [Vec2; 4] {
    let t = usize::from(places.trails[t]);
    match task.settings.trails {
        Trails::Silhouettes | Trails::Uncovered => {
            let outline = task.elements.outline();
            let numbers = [0, 1].map(|end| usize::from(outline.ends[end][t]));
            let before = [0, 1].map(|end| {
                if task.is_turned() {
                    let Elements { x, y, z, .. } = task.elements;
                    let [x, y, z] = [x, y, z].map(|axis| axis[numbers[end]]);
                    direction_to_square(task.rotation * Vec3A::new(x, y, z)).to_array()
                } else {
                    [outline.u[end][t], outline.v[end][t]]
                }
            });
            let now = numbers.map(|number| [places.u[number], places.v[number]]);
            let before = [0, 1].map(|end| follow(before[end], now[end], task.behind(outline.behind[t])));
            let inner = [0, 1].map(|end| left_behind(before[end], now[end], now, task.margin(outline.margin[t])));
            [before[0], before[1], inner[1], inner[0]].map(Vec2::from)
        }
        Trails::All => {
            let [low, high] = swept_box(task, places, t);
            [low, Vec2::new(high.x, low.y), high, Vec2::new(low.x, high.y)]
        }
    }
}

/// Where what the record saw behind a silhouette has gone, while the silhouette came from `before` to `now`.
#[inline(always)]
fn follow(before: [f32; 2], now: [f32; 2], share: f32) -> [f32; 2] {
    [0, 1].map(|axis| before[axis] + share * (now[axis] - before[axis]))
}

/// How far a trail reaches at one end of a side that runs between `ends`, with its element on the left: from where the
/// trail starts, `before`, to where that end is `now`, and as far again on the same line, but at most by the margin:
/// sides that meet there agree, and leave no gap between their trails. Nowhere if it went outwards; a side that shrank
/// to nothing leaves all from its start on.
#[inline(always)]
fn left_behind(before: [f32; 2], now: [f32; 2], ends: [[f32; 2]; 2], margin: f32) -> [f32; 2] {
    /// So that no division needs a branch.
    const TINY: f32 = 1e-30;
    let [x, y] = [ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]];
    let way = [now[0] - before[0], now[1] - before[1]];
    // The way inwards, times the length of the side.
    let moved = x * way[1] - y * way[0];
    let more = min(1.0, margin / max(way[0] * way[0] + way[1] * way[1], TINY).sqrt());
    let outer = if x * x + y * y > TINY { before } else { now };
    let end = |axis: usize| if moved > 0.0 { min(max(now[axis] + more * way[axis], 0.0), 1.0) } else { outer[axis] };
    [end(0), end(1)]
}

/// The rectangle that encloses the old and the new place of element `e`.
fn swept_box(task: &Task<'_>, places: &Places, e: usize) -> [Vec2; 2] {
    let before = |k: usize| {
        if task.is_turned() {
            direction_to_square(task.rotation * task.elements.corner(e, k))
        } else {
            Vec2::from(task.elements.grid_corner(e, k)) / task.n as f32
        }
    };
    let corners = places.quad(e).into_iter().chain((0..4).map(before));
    let start = [Vec2::splat(f32::INFINITY), Vec2::splat(f32::NEG_INFINITY)];
    corners.fold(start, |[low, high], corner| [low.min(corner), high.max(corner)])
}

/// What is at 16 places of a list. In a loop, for the compiler makes calls of the closures of arrays.
#[inline(always)]
fn pick<T: Copy + Default>(list: &[T], numbers: &Lane<u16>) -> Lane<T> {
    let mut picked = [T::default(); LANES];
    for lane in 0..LANES {
        picked[lane] = list[usize::from(numbers[lane])];
    }
    picked
}

/// Corners as the record saw them, in the frame of a point whose normal is another.
#[inline(always)]
fn turned_corners(task: &Task<'_>, corners: &Lane<u16>) -> (Lane<f32>, Lane<f32>) {
    let Elements { x, y, z, .. } = task.elements;
    let (x, y, z) = (pick(x, corners), pick(y, corners), pick(z, corners));
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
