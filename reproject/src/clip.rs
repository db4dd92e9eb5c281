//! Polygons in the square: the part of a quadrilateral above the horizon, and area.

use glam::{Vec2, Vec3A};

use crate::kernel::direction_to_square;

/// A quadrilateral that need not be convex, clipped by a plane, has at most 6 corners.
pub(crate) const MAX_CLIPPED: usize = 6;

/// Clips a quadrilateral in space at z = 0 and maps it to the square; gives the number of corners. Unclipped corners below the
/// horizon would fold back into the disk.
pub(crate) fn clip_at_horizon(space: &[Vec3A; 4], polygon: &mut [Vec2; MAX_CLIPPED]) -> usize {
    let mut count = 0;
    for k in 0..4 {
        let (a, b) = (space[k], space[(k + 1) % 4]);
        if a.z >= 0.0 {
            polygon[count] = direction_to_square(a);
            count += 1;
        }
        if (a.z >= 0.0) != (b.z >= 0.0) {
            let mut at = a + (b - a) * (a.z / (a.z - b.z));
            at.z = 0.0;
            polygon[count] = direction_to_square(at);
            count += 1;
        }
    }
    count
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
