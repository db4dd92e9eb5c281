//! Polygons in the square: the part of a quadrilateral above the horizon, and area.

use glam::{Vec2, Vec3A};

use crate::kernel::direction_to_square;

/// A quadrilateral that need not be convex, clipped by a plane, has at most 6 corners.
pub(crate) const MAX_CLIPPED: usize = 6;

/// Clips a quadrilateral in space at z = 0 and maps it to the square; gives the number of corners. Unclipped corners
/// below the horizon would fold back into the disk.
pub(crate) fn clip_at_horizon(space: &[Vec3A; 4], polygon: &mut [Vec2; MAX_CLIPPED]) -> usize {
    let mut count = 0;
    for k in 0..4 {
        let (a, b) = (space[k], space[(k + 1) % 4]);
        if a.z >= 0.0 {
            polygon[count] = direction_to_square(a);
            count += 1;
        }
        if (a.z >= 0.0) != (b.z >= 0.0) {
            let (below, above) = if a.z < 0.0 { (a, b) } else { (b, a) };
            polygon[count] = direction_to_square(crossing(below, above));
            count += 1;
        }
    }
    count
}

/// Where the line between a point below the horizon, z < 0, and one that is not crosses it. The latter counts as at the
/// horizon if rounding put it below.
pub(crate) fn crossing(below: Vec3A, above: Vec3A) -> Vec3A {
    (below + (above - below) * (below.z / (below.z - above.z.max(0.0)))).with_z(0.0)
}

/// Area of a polygon, positive if it runs counter-clockwise.
#[inline]
pub(crate) fn signed_area(polygon: &[Vec2]) -> f32 {
    let Some(&origin) = polygon.first() else {
        return 0.0;
    };
    let twice: f32 = polygon.windows(2).map(|edge| (edge[0] - origin).perp_dot(edge[1] - origin)).sum();
    0.5 * twice
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Share of the cosine-weighted hemisphere that a polygon above the horizon covers (Lambert).
    fn lambert(corners: &[Vec3A]) -> f32 {
        let edge = |k: usize| {
            let (a, b) = (corners[k].normalize(), corners[(k + 1) % corners.len()].normalize());
            a.cross(b).normalize_or_zero().z * a.angle_between(b)
        };
        (0..corners.len()).map(edge).sum::<f32>() / std::f32::consts::TAU
    }

    #[test]
    fn a_crossing_lies_between_its_points_whatever_was_rounded() {
        let below = Vec3A::new(0.05, 0.0, -1e-7);
        for z in [1.0, 1e-7, 0.0, -1e-9, -1e-7, -2e-7] {
            let at = crossing(below, Vec3A::new(0.5, 0.0, z));
            assert!((0.05..=0.5).contains(&at.x) && at.z == 0.0, "the other at {z}: {at}");
        }
    }

    proptest! {
        /// What is left above the horizon has the area of its own form factor, up to the bend of straight edges.
        #[test]
        fn clipped_area_is_the_form_factor(azimuth in -3.0f32..3.0, height in -0.12f32..0.12, tilt in -0.5f32..0.5) {
            let (sin, cos) = azimuth.sin_cos();
            let out = Vec3A::new(cos, sin, 0.0);
            let (s, t) = (Vec3A::new(-sin, cos, tilt) * 0.1, Vec3A::new(0.0, 0.0, 0.1));
            let centre = out + Vec3A::Z * height;
            let quad = [centre - s - t, centre - s + t, centre + s + t, centre + s - t];
            let mut polygon = [Vec2::ZERO; MAX_CLIPPED];
            let corners = clip_at_horizon(&quad, &mut polygon);
            // The same by many small pieces, each above or below as a whole.
            const PIECES: u8 = 50;
            let at = |i: u8, j: u8| {
                let [i, j] = [i, j].map(|k| f32::from(k) / f32::from(PIECES) * 2.0 - 1.0);
                centre + s * j + t * i
            };
            let mut expected = 0.0;
            for i in 0..PIECES {
                for j in 0..PIECES {
                    let piece = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                    if piece.iter().map(|c| c.z).sum::<f32>() > 0.0 {
                        expected += lambert(&piece.map(|c| c.with_z(c.z.max(0.0))));
                    }
                }
            }
            let area = signed_area(&polygon[..corners]);
            // Most of it in the corners of the square, where an edge along the horizon turns by a right angle.
            prop_assert!((area.abs() - expected.abs()).abs() < 3e-3, "{} for {}", area, expected);
            prop_assert!(polygon[..corners].iter().all(|p| p.cmpge(Vec2::ZERO).all() && p.cmple(Vec2::ONE).all()));
        }
    }

    #[test]
    fn edges_are_cut_where_they_cross_either_way() {
        let [a, b] = [Vec3A::new(2.0, 0.0, 1.0), Vec3A::new(0.0, 2.0, -1.0)];
        let [c, d] = [Vec3A::new(-2.0, -1.0, -3.0), Vec3A::new(0.0, -2.0, 1.0)];
        let mut polygon = [Vec2::ZERO; MAX_CLIPPED];
        let count = clip_at_horizon(&[a, b, c, d], &mut polygon);
        let expected = [a, Vec3A::new(1.0, 1.0, 0.0), Vec3A::new(-0.5, -1.75, 0.0), d].map(direction_to_square);
        let is_near = |(found, expected): (&Vec2, &Vec2)| found.distance(*expected) < 1e-6;
        assert!(polygon[..count].iter().zip(&expected).all(is_near), "{:?} for {expected:?}", &polygon[..count]);
        assert_eq!(count, expected.len());
    }

    #[test]
    fn what_is_wholly_above_or_below_is_kept_or_dropped() {
        let quad = [Vec3A::new(1.0, 0.0, 1.0), Vec3A::new(1.0, 1.0, 1.0), Vec3A::new(0.0, 1.0, 1.0), Vec3A::Z];
        let mut polygon = [Vec2::ZERO; MAX_CLIPPED];
        assert_eq!(clip_at_horizon(&quad, &mut polygon), 4);
        assert_eq!(polygon[..4], quad.map(direction_to_square));
        assert_eq!(clip_at_horizon(&quad.map(|c| -c), &mut polygon), 0);
        // A bow of which every other corner is above has the most corners.
        let bow = [quad[0], -quad[1], quad[2], -quad[3]];
        assert_eq!(clip_at_horizon(&bow, &mut polygon), MAX_CLIPPED);
        assert_eq!(signed_area(&[]), 0.0);
    }
}
