//! The body of the wide kernels: plain loops over 16 lanes, which the compiler makes as wide as the function that they
//! are inlined into allows.

#![expect(clippy::cast_possible_truncation, reason = "elements are at most 64 x 64, rows at most 64")]
#![expect(clippy::needless_range_loop, reason = "one index for many arrays")]

use radcache::{Elements, LANES};

use super::board::{Board, HORIZON, KEPT, LOW, Lane, Places, Task, Word, kind};
use super::cut::lift;
use super::scalar::{place_in_square, quotients};
use super::trails::{list_trails, trail_quads};
use crate::Coverage;

/// Four corners of 16 quadrilaterals.
pub(super) type Quads = [Lane<f32>; 4];

/// Corners to places, and places to rows of bits, of all elements and trails.
#[inline(always)]
pub(super) fn draw<W: Word>(task: &Task<'_>, board: &mut Board<W>) {
    let elements = task.elements;
    let padded = elements.padded_len();
    let scale = task.n as f32;
    let Board { places, grid, .. } = board;
    for chunk in 0..padded / LANES {
        let at = chunk * LANES;
        let (mut u, mut v) = ([[0.0; LANES]; 4], [[0.0; LANES]; 4]);
        let mut kinds = [0u32; LANES];
        if task.is_turned() {
            corners::<true>(task, at, &mut u, &mut v, &mut kinds);
        } else {
            corners::<false>(task, at, &mut u, &mut v, &mut kinds);
        }
        for k in 0..4 {
            *lanes_mut(&mut places.u, k * padded + at) = u[k];
            *lanes_mut(&mut places.v, k * padded + at) = v[k];
        }
        if any(&kinds, kind::CUT.into()) {
            lift_lanes(task, places, at, &mut u, &mut v, &mut kinds);
        }
        let area = lanes_mut(&mut places.area, at);
        let view_dependent = lanes(&elements.view_dependent, at);
        for e in 0..LANES {
            // As the sum over a fan of triangles from the first corner.
            let [x1, x2, x3] = [u[1][e] - u[0][e], u[2][e] - u[0][e], u[3][e] - u[0][e]];
            let [y1, y2, y3] = [v[1][e] - v[0][e], v[2][e] - v[0][e], v[3][e] - v[0][e]];
            area[e] = 0.5 * ((x1 * y2 - y1 * x2) + (x2 * y3 - y2 * x3));
            let has_area = area[e] > 0.0;
            let hollow = u32::from(!has_area) | u32::from(view_dependent[e]);
            kinds[e] |= hollow * u32::from(kind::HOLLOW);
        }
        if task.settings.coverage == Coverage::Rectangle {
            (u, v) = rectangles(&u, &v);
        }
        let is_empty = spans::<W>(&u, &v, scale, lanes_mut(&mut places.first, at), &mut kinds, &mut grid.drawn[chunk]);
        let kinds = kinds.map(|kind| kind as u8);
        *lanes_mut(&mut places.kind, at) = kinds;
        if is_empty.into_iter().fold(false, |any, empty| any | empty) {
            let small = (at..elements.len()).zip(is_empty.iter().zip(kinds));
            let small = small.filter(|(_, (is_empty, kind))| **is_empty && kind & !kind::HIGH == 0);
            places.small.extend(small.map(|(e, _)| e as u16));
        }
        // Seldom any, so one question for all of them.
        if kinds.into_iter().fold(0, |all, kind| all | kind) & !kind::HIGH != 0 {
            let slow = (at..elements.len()).zip(kinds).filter(|(_, kind)| kind::is_slow(*kind));
            places.slow.extend(slow.map(|(e, _)| e as u16));
        }
    }
    for chunk in 0..list_trails(task, places).div_ceil(LANES) {
        let at = chunk * LANES;
        let (u, v) = trail_quads(task, places, at);
        let mut kinds = [0u32; LANES];
        let first = lanes_mut(&mut places.trail_first, at);
        spans::<W>(&u, &v, scale, first, &mut kinds, &mut grid.drawn_trails[chunk]);
        *lanes_mut(&mut places.trail_kind, at) = kinds.map(|kind| kind as u8);
    }
}

#[inline(always)]
pub(super) fn lanes<T>(list: &[T], at: usize) -> &Lane<T> {
    list[at..].first_chunk().expect("lists are padded")
}

#[inline(always)]
fn lanes_mut<T>(list: &mut [T], at: usize) -> &mut Lane<T> {
    list[at..].first_chunk_mut().expect("lists are padded")
}

/// Lifts the elements that reach below the horizon, see [`lift`].
#[cold]
fn lift_lanes(task: &Task<'_>, places: &mut Places, at: usize, u: &mut Quads, v: &mut Quads, kinds: &mut Lane<u32>) {
    for (lane, kind) in kinds.iter_mut().enumerate().take(task.elements.len() - at) {
        if *kind & u32::from(kind::CUT) != 0 {
            *kind = lift(task, places, at + lane).into();
        }
    }
    for k in 0..4 {
        let number = k * task.elements.padded_len() + at;
        (u[k], v[k]) = (*lanes(&places.u, number), *lanes(&places.v, number));
    }
}

/// Whether any number has one of these bits.
#[inline(always)]
fn any(numbers: &Lane<u32>, bits: u32) -> bool {
    numbers.iter().fold(0, |all, number| all | number) & bits != 0
}

/// The corners of 16 elements in the square, and which elements reach below the horizon; the frame turns, or does not.
#[inline(always)]
fn corners<const TURNS: bool>(task: &Task<'_>, at: usize, u: &mut Quads, v: &mut Quads, kinds: &mut Lane<u32>) {
    let Elements { x, y, z, .. } = task.elements;
    let finite = lanes(&task.elements.finite, at);
    let (m0, m1, m2) = (task.rotation.x_axis, task.rotation.y_axis, task.rotation.z_axis);
    let offset = task.offset;
    // Divisions first: one after another, each with what waits for it, would fill the queues of the processor.
    let (mut right, mut up) = ([[0.0; LANES]; 4], [[0.0; LANES]; 4]);
    for k in 0..4 {
        let number = k * task.elements.padded_len() + at;
        let (x, y, z) = (lanes(x, number), lanes(y, number), lanes(z, number));
        for e in 0..LANES {
            let (x, y, z) = (x[e] - offset.x * finite[e], y[e] - offset.y * finite[e], z[e] - offset.z * finite[e]);
            let (lx, ly, lz) = if TURNS {
                let lx = m0.x * x + m1.x * y + m2.x * z;
                let ly = m0.y * x + m1.y * y + m2.y * z;
                let lz = m0.z * x + m1.z * y + m2.z * z;
                (lx, ly, lz)
            } else {
                (x, y, z)
            };
            (right[k][e], up[k][e]) = (lx, ly);
            (u[k][e], v[k][e]) = quotients(lx, ly, lz);
            // Those that lie so little below the horizon that they count as on it need no look.
            let low = if lz < 0.0 { lz } else { 0.0 };
            let limit = (0.5 * HORIZON * HORIZON) * (lx * lx + ly * ly + lz * lz);
            kinds[e] |= u32::from(low * low > limit) * u32::from(kind::CUT);
        }
    }
    for k in 0..4 {
        for e in 0..LANES {
            (u[k][e], v[k][e]) = place_in_square(right[k][e], up[k][e], (u[k][e], v[k][e]));
        }
    }
}

/// The rectangles that enclose 16 quadrilaterals.
#[inline(always)]
fn rectangles(u: &Quads, v: &Quads) -> (Quads, Quads) {
    let (mut lo, mut hi) = ([u[0], v[0]], [u[0], v[0]]);
    for k in 1..4 {
        for e in 0..LANES {
            for (axis, value) in [u[k][e], v[k][e]].into_iter().enumerate() {
                lo[axis][e] = min(lo[axis][e], value);
                hi[axis][e] = max(hi[axis][e], value);
            }
        }
    }
    ([lo[0], hi[0], hi[0], lo[0]], [lo[1], lo[1], hi[1], hi[1]])
}

#[inline(always)]
pub(super) fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
pub(super) fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The first centre at or above x: its ceiling in [0, scale].
#[inline(always)]
fn first_centre(x: f32, scale: f32) -> u32 {
    let x = min(max(x, 0.0), scale);
    let shifted = x + ROUND;
    let up = u32::from(shifted - ROUND < x);
    (shifted.to_bits() + up) & 0x7f
}

/// The whole number nearest to a crossing with an edge in the square, in texels: as many centres lie at its left. It is
/// at most rounding outside of the square, so that nothing need be cut off.
#[inline(always)]
fn nearest_whole(x: f32) -> u32 {
    (x + ROUND).to_bits() & 0x7f
}

/// From 2^23 to 2^24 neighbouring numbers are 1 apart, so adding a number amid them rounds to a whole number, also
/// below 0, and leaves that in the low bits.
const ROUND: f32 = 12_582_912.0;

/// The rows of 16 quadrilaterals with corners in the square, from the first row of each on; tells which cover nothing,
/// as far as that was drawn.
#[inline(always)]
fn spans<W: Word>(
    u: &Quads,
    v: &Quads,
    scale: f32,
    first: &mut Lane<u8>,
    kinds: &mut Lane<u32>,
    drawn: &mut W::Drawn,
) -> Lane<bool> {
    let (mut x_low, mut y_low, mut y_high, mut slope) =
        ([[0.0; LANES]; 4], [[0.0; LANES]; 4], [[0.0; LANES]; 4], [[0.0; LANES]; 4]);
    let mut start = [0f32; LANES];
    let (mut starts, mut heights) = ([0u32; LANES], [0u32; LANES]);
    for e in 0..LANES {
        // In units of texels, with the centres of rows on whole numbers.
        let x: [f32; 4] = [u[0][e] * scale, u[1][e] * scale, u[2][e] * scale, u[3][e] * scale];
        let y: [f32; 4] = [v[0][e] * scale - 0.5, v[1][e] * scale - 0.5, v[2][e] * scale - 0.5, v[3][e] * scale - 0.5];
        for k in 0..4 {
            let next = (k + 1) % 4;
            // Each edge from its lower end up, so that it has the same bits whichever way it runs.
            x_low[k][e] = if y[k] <= y[next] { x[k] } else { x[next] };
            y_low[k][e] = min(y[k], y[next]);
            y_high[k][e] = max(y[k], y[next]);
            slope[k][e] = (x[next] - x[k]) / (y[next] - y[k]);
        }
        let low = min(min(y[0], y[1]), min(y[2], y[3]));
        let high = max(max(y[0], y[1]), max(y[2], y[3]));
        let (from, to) = (first_centre(low, scale), first_centre(high, scale));
        start[e] = from as f32;
        starts[e] = from;
        heights[e] = to.saturating_sub(from);
        let (high, tall) = (u32::from(heights[e] > LOW as u32), u32::from(heights[e] > KEPT as u32));
        kinds[e] |= high * u32::from(kind::HIGH) + tall * u32::from(kind::TALL);
    }
    *first = starts.map(|start| start as u8);
    let tallest = heights.into_iter().fold(0, |a, b| if a > b { a } else { b }) as usize;
    let drawn = drawn.as_mut();
    let mut all = [0u64; LANES];
    for k in 0..tallest.min(KEPT).div_ceil(W::ROWS) {
        let mut rows = [[W::default(); LANES]; 2];
        for (r, row) in rows.iter_mut().enumerate().take(W::ROWS) {
            let r = (k * W::ROWS + r) as f32;
            for e in 0..LANES {
                let centre = start[e] + r;
                let mut bits = W::default();
                for k in 0..4 {
                    let crossing = x_low[k][e] + (centre - y_low[k][e]) * slope[k][e];
                    // Level edges cross no row, which also keeps their slopes out.
                    let crosses = (y_low[k][e] <= centre) & (centre < y_high[k][e]);
                    bits = bits ^ if crosses { W::from_bit(nearest_whole(crossing)) } else { W::default() };
                }
                row[e] = bits;
            }
        }
        drawn[k] = W::pack(&rows);
        for e in 0..LANES {
            all[e] |= drawn[k][e];
        }
    }
    // Nobody asks for more than the first rows unless one is high.
    let asked = if tallest > LOW { KEPT } else { LOW } / W::ROWS;
    for words in drawn.iter_mut().take(asked).skip(tallest.min(KEPT).div_ceil(W::ROWS)) {
        *words = [0; LANES];
    }
    all.map(|bits| bits == 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_centre_is_the_ceiling() {
        for k in -8..=64 * 16i16 {
            let x = f32::from(k) / 16.0;
            for x in [x.next_down(), x, x.next_up()] {
                assert_eq!(first_centre(x, 64.0) as f32, x.clamp(0.0, 64.0).ceil(), "of {x}");
            }
        }
    }

    #[test]
    fn nearest_whole_rounds_also_what_rounding_puts_outside() {
        for k in -7..=64 * 16 + 7i16 {
            let x = f32::from(k) / 16.0;
            for x in [x.next_down(), x, x.next_up()] {
                assert_eq!(nearest_whole(x) as f32, x.round_ties_even().abs(), "of {x}");
            }
        }
    }
}
