//! A ray in the form in which the tree wants it: each number in four lanes.

use glam::{Vec3A, Vec4};

use super::Node;
use crate::Ray;

/// Boxes are left this much later than computed: three roundings (Ize 2013: Robust BVH Ray Traversal).
const FAR_GROWTH: f32 = 1.0 + 4.0 * f32::EPSILON;

/// Direction components below this are taken as this: their inverse stays finite, and 0 times infinity never occurs.
const MIN_COMPONENT: f32 = 1e-30;

/// What boxes and triangles ask of a ray.
#[derive(Debug, Clone, Copy)]
pub(super) struct LaneRay {
    pub(super) origin: [Vec4; 3],
    /// One over the direction.
    inverse: [Vec4; 3],
    /// For each axis, whether the ray runs downwards: the index of the side at which it enters.
    side: [usize; 3],
    /// For triangles: axes of which z is the one along which the ray is longest...
    pub(super) axes: [usize; 3],
    /// ... and the shear by which it becomes the z axis.
    pub(super) shear: [Vec4; 3],
}

impl LaneRay {
    #[inline]
    pub(super) fn new(ray: &Ray) -> Self {
        let Ray { origin, direction, .. } = *ray;
        let length = direction.abs();
        let is_tiny = length.cmplt(Vec3A::splat(MIN_COMPONENT));
        let safe = Vec3A::select(is_tiny, Vec3A::splat(MIN_COMPONENT).copysign(direction), direction);
        let inverse = (1.0 / safe).to_array();
        let z = length.max_position();
        let x = if z == 2 { 0 } else { z + 1 };
        let y = if x == 2 { 0 } else { x + 1 };
        let z_inverse = inverse[z];
        let sheared = (direction * z_inverse).to_array();
        let downwards = direction.is_negative_bitmask() as usize;
        Self {
            origin: origin.to_array().map(Vec4::splat),
            inverse: inverse.map(Vec4::splat),
            side: [downwards & 1, downwards >> 1 & 1, downwards >> 2 & 1],
            axes: [x, y, z],
            shear: [sheared[x], sheared[y], z_inverse].map(Vec4::splat),
        }
    }

    /// Returns where the ray enters the four boxes of a node, and which of them it meets in (`t_min`, `t_max`).
    #[inline]
    pub(super) fn meet(&self, node: &Node, t_min: f32, t_max: f32) -> (Vec4, u32) {
        let near = |axis: usize| (node.bounds[self.side[axis] & 1][axis] - self.origin[axis]) * self.inverse[axis];
        let far = |axis: usize| (node.bounds[(self.side[axis] & 1) ^ 1][axis] - self.origin[axis]) * self.inverse[axis];
        let enter = near(0).max(near(1)).max(near(2)).max(Vec4::splat(t_min));
        let leave = (far(0).min(far(1)).min(far(2)) * FAR_GROWTH).min(Vec4::splat(t_max));
        (enter, enter.cmple(leave).bitmask())
    }
}
