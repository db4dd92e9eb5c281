//! Corners of elements in space to corners in the square, in plain loops over arrays that the compiler turns into lanes.

use glam::{Mat3A, Vec2, Vec3A};
use hemimap::atan_unit;
use radcache::{Elements, LANES};

/// 4 / pi.
const FOUR_OVER_PI: f32 = 4.0 * std::f32::consts::FRAC_1_PI;

/// Projects the corners of all elements to the square of another point.
///
/// `rotation` turns the record's frame into that of the point, `offset` is the point relative to the record in the record's frame.
/// For corner k of element e, `u[k][e]` and `v[k][e]` get its place in the square and `z[k][e]` the cosine of its direction;
/// below the horizon, where z is negative, the place is the nearest one on the rim. Slices are `elements.padded_len()` long.
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
    for k in 0..4 {
        let (x_in, y_in, z_in) = (&elements.x[k][..len], &elements.y[k][..len], &elements.z[k][..len]);
        let finite = &elements.finite[..len];
        let (u, v, z) = (&mut u[k][..len], &mut v[k][..len], &mut z[k][..len]);
        for first in (0..len).step_by(LANES) {
            for e in first..first + LANES {
                let x = x_in[e] - offset.x * finite[e];
                let y = y_in[e] - offset.y * finite[e];
                let height = z_in[e] - offset.z * finite[e];
                let (m0, m1, m2) = (rotation.x_axis, rotation.y_axis, rotation.z_axis);
                let lx = m0.x * x + m1.x * y + m2.x * height;
                let ly = m0.y * x + m1.y * y + m2.y * height;
                let lz = m0.z * x + m1.z * y + m2.z * height;
                (u[e], v[e], z[e]) = to_square(lx, ly, lz);
            }
        }
    }
}

/// The place in the square of a direction of any length in the local frame, and its cosine; on the rim for what lies below the
/// horizon. The direction of no length maps to the centre, with cosine 0.
#[inline(always)]
fn to_square(x: f32, y: f32, z: f32) -> (f32, f32, f32) {
    let above = z.max(0.0);
    let planar_sq = x * x + y * y;
    // Never zero, so that no division needs a branch.
    const TINY: f32 = 1e-30;
    let r = (planar_sq / (planar_sq + above * above).max(TINY)).sqrt();
    let (ax, ay) = (x.abs(), y.abs());
    let steep = ay >= ax;
    let (small, large) = if steep { (ax, ay) } else { (ay, ax) };
    let angle = r * FOUR_OVER_PI * atan_unit(small / large.max(TINY));
    let (a, b) = if steep { (angle, r) } else { (r, angle) };
    let u = 0.5 + 0.5 * a.copysign(x);
    let v = 0.5 + 0.5 * b.copysign(y);
    let cos = z / (planar_sq + z * z).max(TINY).sqrt();
    (u, v, cos)
}

/// [`to_square`] for a vector.
pub(crate) fn direction_to_square(direction: Vec3A) -> Vec2 {
    let (u, v, _) = to_square(direction.x, direction.y, direction.z);
    Vec2::new(u, v)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn agrees_with_the_map(u in 0.0f32..1.0, v in 0.0f32..1.0, length in 1e-3f32..1e4) {
            let w = hemimap::square_to_cosine_hemisphere(Vec2::new(u, v));
            let (pu, pv, cos) = to_square(w.x * length, w.y * length, w.z * length);
            prop_assert!((pu - u).abs() < 1e-6 && (pv - v).abs() < 1e-6, "{} {} became {} {}", u, v, pu, pv);
            prop_assert!((cos - w.z).abs() < 1e-6);
        }

        #[test]
        fn below_the_horizon_is_on_the_rim(x in -1.0f32..1.0, y in -1.0f32..1.0, z in -1.0f32..-1e-3) {
            let (u, v, cos) = to_square(x, y, z);
            prop_assert!(cos < 0.0);
            let edge = (u - 0.5).abs().max((v - 0.5).abs());
            prop_assert!((edge - 0.5).abs() < 1e-6, "{} {}", u, v);
        }
    }

    #[test]
    fn odd_directions_have_a_place() {
        assert_eq!(to_square(0.0, 0.0, 0.0), (0.5, 0.5, 0.0), "no direction");
        assert_eq!(to_square(0.0, 0.0, 2.0), (0.5, 0.5, 1.0), "straight up");
        let (u, v, cos) = to_square(0.0, 0.0, -1.0);
        assert!(u.is_finite() && v.is_finite() && cos == -1.0, "straight down");
    }
}
