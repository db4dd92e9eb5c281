//! The specification: one element after another. And the map of corners in space to the square, which all kernels
//! share.

#![expect(clippy::cast_possible_truncation, reason = "elements are at most 64 x 64, rows at most 64")]

use glam::{Mat3A, Vec2, Vec3A};
use hemimap::atan_unit;
use radcache::{Elements, LANES};

use super::board::{Board, KEPT, LOW, Task, Word, kind, word};
use super::cut::lift;
use super::trails::{list_trails, trail_polygon};
use crate::clip::signed_area;
use crate::raster::polygon_rows;
use crate::{Coverage, Masks, Rows};

/// 4 / pi.
const FOUR_OVER_PI: f32 = 4.0 * std::f32::consts::FRAC_1_PI;

/// Projects the corners of all elements to the square of another point.
///
/// `rotation` turns the record's frame into that of the point, `offset` is the point relative to the record in the
/// record's frame. For corner k of element e, `u[k][e]` and `v[k][e]` get its place in the square and `z[k][e]` its
/// height above the tangent plane; below the horizon, where z is negative, the place is the nearest one on the rim, straight below the centre.
/// Slices are `elements.padded_len()` long.
///
/// # Panics
/// If an output is shorter than that.
pub fn project_corners(
    elements: &Elements,
    rotation: &Mat3A,
    offset: Vec3A,
    u: &mut [Vec<f32>; 4],
    v: &mut [Vec<f32>; 4],
    z: &mut [Vec<f32>; 4],
) {
    let len = elements.padded_len();
    let (m0, m1, m2) = (rotation.x_axis, rotation.y_axis, rotation.z_axis);
    let finite = elements.finite.as_chunks::<LANES>().0;
    for k in 0..4 {
        let corners = k * len..(k + 1) * len;
        let input = [&elements.x, &elements.y, &elements.z].map(|axis| axis[corners.clone()].as_chunks::<LANES>().0);
        let u = u[k][..len].as_chunks_mut::<LANES>().0;
        let v = v[k][..len].as_chunks_mut::<LANES>().0;
        let z = z[k][..len].as_chunks_mut::<LANES>().0;
        for (chunk, finite) in finite.iter().enumerate() {
            let [x_in, y_in, z_in] = input.map(|axis| &axis[chunk]);
            let (u, v, z) = (&mut u[chunk], &mut v[chunk], &mut z[chunk]);
            for e in 0..LANES {
                let x = x_in[e] - offset.x * finite[e];
                let y = y_in[e] - offset.y * finite[e];
                let height = z_in[e] - offset.z * finite[e];
                let lx = m0.x * x + m1.x * y + m2.x * height;
                let ly = m0.y * x + m1.y * y + m2.y * height;
                let lz = m0.z * x + m1.z * y + m2.z * height;
                (u[e], v[e]) = to_square(lx, ly, lz);
                z[e] = lz;
            }
        }
    }
}

/// The place in the square of a direction of any length in the local frame; on the rim for what lies below the horizon.
/// The direction of no length maps to the centre.
#[inline(always)]
pub(super) fn to_square(x: f32, y: f32, z: f32) -> (f32, f32) {
    place_in_square(x, y, quotients(x, y, z))
}

/// The divisions of [`to_square`]: the square of the sine of the angle to the normal, and the lesser of |x| and |y|
/// over the greater.
#[inline(always)]
pub(super) fn quotients(x: f32, y: f32, z: f32) -> (f32, f32) {
    // By comparison, for it is one instruction; `f32::max` is more.
    let above = if z > 0.0 { z } else { 0.0 };
    let planar_sq = x * x + y * y;
    // Never zero, so that no division needs a branch.
    const TINY: f32 = 1e-30;
    let length_sq = planar_sq + above * above;
    let (ax, ay) = (x.abs(), y.abs());
    let (small, large) = if ay >= ax { (ax, ay) } else { (ay, ax) };
    (planar_sq / if length_sq > TINY { length_sq } else { TINY }, small / if large > TINY { large } else { TINY })
}

/// The rest of [`to_square`].
#[inline(always)]
pub(super) fn place_in_square(x: f32, y: f32, (sin_sq, ratio): (f32, f32)) -> (f32, f32) {
    let r = sin_sq.sqrt();
    let angle = r * FOUR_OVER_PI * atan_unit(ratio);
    let (a, b) = if y.abs() >= x.abs() { (angle, r) } else { (r, angle) };
    let u = 0.5 + 0.5 * a.copysign(x);
    let v = 0.5 + 0.5 * b.copysign(y);
    (u, v)
}

/// [`to_square`] for a vector.
pub(crate) fn direction_to_square(direction: Vec3A) -> Vec2 {
    to_square(direction.x, direction.y, direction.z).into()
}

/// One reprojection, element by element.
pub(super) fn project<W: Word>(task: &Task<'_>, masks: &mut Masks, board: &mut Board<W>) -> [f32; 7] {
    board.reset(task, masks);
    let Board { places, grid, .. } = board;
    for e in 0..task.elements.len() {
        let mut kinds = 0;
        for k in 0..4 {
            let corner = task.rotation * (task.elements.corner(e, k) - task.offset * task.elements.finite[e]);
            let number = k * task.elements.padded_len() + e;
            (places.u[number], places.v[number]) = to_square(corner.x, corner.y, corner.z);
            kinds |= if corner.z >= 0.0 { 0 } else { kind::CUT };
        }
        if kinds & kind::CUT != 0 {
            kinds = lift(task, places, e);
        }
        let quad = places.quad(e);
        let area = signed_area(&quad);
        places.area[e] = area;
        let fills = area > 0.0 && !task.elements.view_dependent[e];
        kinds |= if fills { 0 } else { kind::HOLLOW };
        let quad = match task.settings.coverage {
            Coverage::Quad => quad,
            Coverage::Rectangle => {
                let low = quad.into_iter().reduce(Vec2::min).expect("four corners");
                let high = quad.into_iter().reduce(Vec2::max).expect("four corners");
                [low, Vec2::new(high.x, low.y), high, Vec2::new(low.x, high.y)]
            }
        };
        let (first, tall) = keep::<W>(&quad, task.n, &mut grid.drawn[e / LANES], e % LANES);
        kinds |= tall;
        places.first[e] = first;
        places.kind[e] = kinds;
        if kind::is_slow(kinds) {
            places.slow.push(e as u16);
        } else if kinds & !kind::HIGH == 0 && (0..KEPT / W::ROWS).all(|k| word::<W>(&grid.drawn, e, k) == 0) {
            places.small.push(e as u16);
        }
    }
    for t in 0..list_trails(task, places) {
        let polygon = trail_polygon(task, places, t);
        let drawn = &mut grid.drawn_trails[t / LANES];
        (places.trail_first[t], places.trail_kind[t]) = keep::<W>(&polygon, task.n, drawn, t % LANES);
    }
    super::fill::fill(task, board);
    board.show(masks);
    super::sums::sum(task, &board.places)
}

/// Keeps the first rows of a polygon in a lane; tells which was the first, and whether there were more.
fn keep<W: Word>(polygon: &[Vec2; 4], n: usize, drawn: &mut W::Drawn, lane: usize) -> (u8, u8) {
    let mut bits: Rows = [0; radcache::MAX_RESOLUTION];
    let rows = polygon_rows(polygon, n, &mut bits);
    let first = rows.start;
    let tall = if rows.len() > KEPT { kind::TALL } else { 0 } | if rows.len() > LOW { kind::HIGH } else { 0 };
    let mut kept = [W::default(); KEPT];
    for (kept, row) in kept.iter_mut().zip(&bits[rows]) {
        *kept = W::narrow(*row);
    }
    for (k, words) in drawn.as_mut().iter_mut().enumerate() {
        words[lane] = W::load(&kept, k);
    }
    (first as u8, tall)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn agrees_with_the_map(u in 0.0f32..1.0, v in 0.0f32..1.0, length in 1e-3f32..1e4) {
            let w = hemimap::square_to_cosine_hemisphere(Vec2::new(u, v));
            let (pu, pv) = to_square(w.x * length, w.y * length, w.z * length);
            prop_assert!((pu - u).abs() < 1e-6 && (pv - v).abs() < 1e-6, "{} {} became {} {}", u, v, pu, pv);
        }

        #[test]
        fn below_the_horizon_is_on_the_rim(x in -1.0f32..1.0, y in -1.0f32..1.0, z in -1.0f32..-1e-3) {
            let (u, v) = to_square(x, y, z);
            let edge = (u - 0.5).abs().max((v - 0.5).abs());
            prop_assert!((edge - 0.5).abs() < 1e-6, "{} {}", u, v);
        }
    }

    proptest! {
        /// From another place and turned about any axis, under a roof that covers half of the sky.
        #[test]
        fn corners_go_where_the_map_puts_their_directions(
            axis in prop::array::uniform3(-1f32..1.0), angle in -1f32..1.0, to in prop::array::uniform3(-0.3f32..0.3),
        ) {
            let samples = radcache::Samples::from_fn(7, |wi| {
                (glam::Vec3::ONE, if wi.x > 0.0 { f32::INFINITY } else { 1.0 / wi.z }, Vec3A::NEG_Z)
            });
            let frame = hemimap::Frame::from_normal(Vec3A::Z);
            let record = radcache::Record::new(Vec3A::ZERO, frame, samples, &Default::default(), &Default::default());
            let elements = record.elements();
            let rotation = Mat3A::from_axis_angle(glam::Vec3::from(axis).normalize_or(glam::Vec3::X), angle);
            let offset = Vec3A::from(to);
            let [mut u, mut v, mut z] = [(); 3].map(|()| [(); 4].map(|()| vec![0.0; elements.padded_len()]));
            project_corners(elements, &rotation, offset, &mut u, &mut v, &mut z);
            for e in 0..elements.len() {
                for k in 0..4 {
                    let moved = elements.corner(e, k) - if elements.finite[e] == 1.0 { offset } else { Vec3A::ZERO };
                    let seen = glam::Mat3::from(rotation).as_dmat3() * moved.as_dvec3();
                    let up = seen.with_z(seen.z.max(0.0)).normalize();
                    let place = hemimap::double::cosine_hemisphere_to_square(up).as_vec2();
                    prop_assert!(place.distance(Vec2::new(u[k][e], v[k][e])) < 3e-6, "corner {} of {}", k, e);
                    prop_assert!((f64::from(z[k][e]) - seen.z).abs() < 1e-5 * seen.length(), "height");
                }
            }
        }
    }

    #[test]
    fn odd_directions_have_a_place() {
        assert_eq!(to_square(0.0, 0.0, 0.0), (0.5, 0.5), "no direction");
        assert_eq!(to_square(0.0, 0.0, 2.0), (0.5, 0.5), "straight up");
        let (u, v) = to_square(0.0, 0.0, -1.0);
        assert!(u.is_finite() && v.is_finite(), "straight down");
    }
}
