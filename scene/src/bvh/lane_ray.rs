//! A ray in the form in which the tree wants it: each number in all lanes.

use fearless_simd::{Simd, SimdBase, SimdMask, f32x8};
use glam::Vec3A;

use super::{LANES, Node};
use crate::Ray;

/// Boxes are left this much later than computed: three roundings (Ize 2013: Robust BVH Ray Traversal).
const FAR_GROWTH: f32 = 1.0 + 4.0 * f32::EPSILON;

/// Direction components below this are taken as this: their inverse stays finite, and 0 times infinity never occurs.
const MIN_COMPONENT: f32 = 1e-30;

/// What boxes and triangles ask of a ray.
#[derive(Clone, Copy)]
pub(super) struct LaneRay<S: Simd> {
    pub(super) simd: S,
    pub(super) origin: [f32x8<S>; 3],
    /// One over the direction.
    inverse: [f32x8<S>; 3],
    /// For each axis, whether the ray runs downwards: the index of the side at which it enters.
    side: [usize; 3],
    /// For triangles: axes of which z is the one along which the ray is longest...
    pub(super) axes: [usize; 3],
    /// ... and the shear by which it becomes the z axis.
    pub(super) shear: [f32x8<S>; 3],
}

impl<S: Simd> LaneRay<S> {
    #[inline(always)]
    pub(super) fn new(simd: S, ray: &Ray) -> Self {
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
            simd,
            origin: splat(simd, origin.to_array()),
            inverse: splat(simd, inverse),
            side: [downwards & 1, downwards >> 1 & 1, downwards >> 2 & 1],
            axes: [x, y, z],
            shear: splat(simd, [sheared[x], sheared[y], z_inverse]),
        }
    }

    /// Returns coordinates along an axis as seen from where the ray starts.
    #[inline(always)]
    pub(super) fn offset(&self, coordinates: &[f32; LANES], axis: usize) -> f32x8<S> {
        f32x8::load_array_ref(self.simd, coordinates) - self.origin[axis]
    }

    /// Returns where the ray passes the sides of a node's boxes on which it enters them or leaves them.
    #[inline(always)]
    fn pass<const LEAVE: usize>(&self, node: &Node, axis: usize) -> f32x8<S> {
        self.offset(&node.bounds[(self.side[axis] & 1) ^ LEAVE][axis], axis) * self.inverse[axis]
    }

    /// Returns where the ray enters the boxes of a node, and which of them it meets in (`t_min`, `t_max`).
    #[inline(always)]
    pub(super) fn meet(&self, node: &Node, t_min: f32, t_max: f32) -> (f32x8<S>, u64) {
        let enter = self.pass::<0>(node, 0).max(self.pass::<0>(node, 1)).max(self.pass::<0>(node, 2)).max(t_min);
        let leave = self.pass::<1>(node, 0).min(self.pass::<1>(node, 1)).min(self.pass::<1>(node, 2));
        (enter, enter.simd_le((leave * FAR_GROWTH).min(t_max)).to_bitmask())
    }
}

#[inline(always)]
fn splat<S: Simd>(simd: S, [x, y, z]: [f32; 3]) -> [f32x8<S>; 3] {
    [f32x8::splat(simd, x), f32x8::splat(simd, y), f32x8::splat(simd, z)]
}
