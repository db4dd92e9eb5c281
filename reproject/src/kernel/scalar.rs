//! Corners of elements in space to corners in the square, in plain loops over arrays that the compiler turns into lanes.

use glam::{Mat3A, Vec2, Vec3A};
use hemimap::atan_unit;
use radcache::{Elements, LANES};

/// 4 / pi.
const FOUR_OVER_PI: f32 = 4.0 * std::f32::consts::FRAC_1_PI;

/// Projects the corners of all elements to the square of another point.
///
/// `rotation` turns the record's frame into that of the point, `offset` is the point relative to the record in the record's frame.
/// For corner k of element e, `u[k][e]` and `v[k][e]` get its place in the square and `z[k][e]` its height above the tangent plane;
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
    let (m0, m1, m2) = (rotation.x_axis, rotation.y_axis, rotation.z_axis);
    let finite = elements.finite.as_chunks::<LANES>().0;
    for k in 0..4 {
        let input = [&elements.x[k], &elements.y[k], &elements.z[k]].map(|axis| axis[..len].as_chunks::<LANES>().0);
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

/// The place in the square of a direction of any length in the local frame; on the rim for what lies below the horizon. The
/// direction of no length maps to the centre.
#[inline(always)]
fn to_square(x: f32, y: f32, z: f32) -> (f32, f32) {
    // By comparison, for it is one instruction; `f32::max` is more.
    let above = if z > 0.0 { z } else { 0.0 };
    let planar_sq = x * x + y * y;
    // Never zero, so that no division needs a branch.
    const TINY: f32 = 1e-30;
    let length_sq = planar_sq + above * above;
    let r = (planar_sq / if length_sq > TINY { length_sq } else { TINY }).sqrt();
    let (ax, ay) = (x.abs(), y.abs());
    let steep = ay >= ax;
    let (small, large) = if steep { (ax, ay) } else { (ay, ax) };
    let angle = r * FOUR_OVER_PI * atan_unit(small / if large > TINY { large } else { TINY });
    let (a, b) = if steep { (angle, r) } else { (r, angle) };
    let u = 0.5 + 0.5 * a.copysign(x);
    let v = 0.5 + 0.5 * b.copysign(y);
    (u, v)
}

/// [`to_square`] for a vector.
pub(crate) fn direction_to_square(direction: Vec3A) -> Vec2 {
    to_square(direction.x, direction.y, direction.z).into()
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

    #[test]
    fn odd_directions_have_a_place() {
        assert_eq!(to_square(0.0, 0.0, 0.0), (0.5, 0.5), "no direction");
        assert_eq!(to_square(0.0, 0.0, 2.0), (0.5, 0.5), "straight up");
        let (u, v) = to_square(0.0, 0.0, -1.0);
        assert!(u.is_finite() && v.is_finite(), "straight down");
    }
}
