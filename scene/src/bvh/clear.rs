//! Whether the tree has anything within a shaft.

use arrayvec::ArrayVec;
use fearless_simd::{Simd, SimdBase, SimdMask, dispatch, f32x8};

use super::packet::{Packet, form_of};
use super::{Bvh, LANES, Node};
use crate::shaft::Shaft;

/// A corner of a shaft is in the plane of a triangle if its height is so small a share of the terms that it is the sum
/// of: so the neighbours of a triangle in its plane hide nothing from it.
const IN_PLANE: f32 = 16.0 * f32::EPSILON;

/// Least sine of the angle at the first corner of a triangle, about, for its normal to be known as well.
const LEAST_SINE: f32 = 1.0 / 16.0;

/// A shaft that meets the boxes of more nodes is hardly ever clear.
const MOST_NODES: usize = 24;

impl Bvh {
    /// Whether nothing is within a shaft, as far as a quick search can tell. `misses` tells whether a free form is
    /// outside.
    pub(crate) fn is_clear(&self, shaft: &Shaft, misses: impl Fn(u32) -> bool) -> bool {
        dispatch!(self.level, simd => self.is_clear_by(simd, shaft, &misses))
    }

    #[inline(always)]
    fn is_clear_by<S: Simd>(&self, simd: S, shaft: &Shaft, misses: &impl Fn(u32) -> bool) -> bool {
        let mut stack = ArrayVec::<u32, { (LANES - 1) * MOST_NODES + 1 }>::new();
        let Some(mut node) = self.nodes.first() else { return true };
        for _ in 0..MOST_NODES {
            let met = boxes(simd, shaft, node);
            let mut leaves = met & node.leaves;
            while leaves != 0 {
                let lane = leaves.trailing_zeros() as usize % LANES;
                leaves &= leaves - 1;
                let packet = &self.packets[node.children[lane] as usize];
                let has_form = || self.has_forms && !packet.primitives.into_iter().filter_map(form_of).all(misses);
                if has_triangle(simd, shaft, packet) || has_form() {
                    return false;
                }
            }
            let mut inner = met & !node.leaves;
            while inner != 0 {
                let lane = inner.trailing_zeros() as usize % LANES;
                inner &= inner - 1;
                stack.push(node.children[lane]);
            }
            let Some(next) = stack.pop() else { return true };
            node = &self.nodes[next as usize];
        }
        false
    }
}

/// Returns which of the boxes of a node may have something within a shaft.
#[inline(always)]
fn boxes<S: Simd>(simd: S, shaft: &Shaft, node: &Node) -> u64 {
    let bound = |side: usize, axis: usize| f32x8::load_array_ref(simd, &node.bounds[side][axis]);
    // Absent children have boxes that are inside out.
    let mut met = bound(0, 0).simd_le(bound(1, 0));
    for plane in &shaft.planes {
        let mut height = f32x8::splat(simd, plane.w);
        for axis in 0..3 {
            let n = plane[axis];
            height += bound(usize::from(n < 0.0), axis) * n;
        }
        met &= !height.simd_gt(0.0);
    }
    met.to_bitmask()
}

/// Whether any triangle of a packet may have something within a shaft.
#[inline(always)]
fn has_triangle<S: Simd>(simd: S, shaft: &Shaft, packet: &Packet) -> bool {
    let lanes = |corner: usize| [0, 1, 2].map(|axis| f32x8::load_array_ref(simd, &packet.corners[corner][axis]));
    let corners = [lanes(0), lanes(1), lanes(2)];
    // Lanes without a triangle are NaN.
    let mut met = corners[0][0].simd_eq(corners[0][0]);
    for plane in &shaft.planes {
        let height = |[x, y, z]: [f32x8<S>; 3]| x * plane.x + y * plane.y + z * plane.z + plane.w;
        let lowest = height(corners[0]).min(height(corners[1])).min(height(corners[2]));
        met &= !lowest.simd_gt(0.0);
    }
    if !met.any_true() {
        return false;
    }
    // All of the shaft may be on one side of the plane of a triangle.
    let [a, b, c] = corners;
    let minus = |[x, y, z]: [f32x8<S>; 3], [u, v, w]: [f32x8<S>; 3]| [x - u, y - v, z - w];
    let (b, c) = (minus(b, a), minus(c, a));
    let n = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
    let sum = |[x, y, z]: [f32x8<S>; 3]| x.abs() + y.abs() + z.abs();
    let size = sum(n);
    // Of a needle the normal is little but rounding.
    let is_known = size.simd_gt(sum(b) * sum(c) * LEAST_SINE);
    let n = n.map(|n| n / size);
    let (mut lowest, mut highest) = (f32x8::splat(simd, f32::INFINITY), f32x8::splat(simd, f32::NEG_INFINITY));
    for corner in &shaft.corners {
        let along = |axis: usize| (f32x8::splat(simd, corner[axis]) - a[axis] * corner.w) * n[axis];
        let along = [along(0), along(1), along(2)];
        let (height, slack) = (along[0] + along[1] + along[2], sum(along) * IN_PLANE);
        lowest = lowest.min(height + slack);
        highest = highest.max(height - slack);
    }
    let is_beside = is_known & (lowest.simd_ge(0.0) | highest.simd_le(0.0));
    (met & !is_beside).any_true()
}
