//! Rays through the tree: the nearest hit, or any.

use glam::Vec4;

use super::packet::{CUT_OUT, FORM, PRIMITIVE, ShearedRay};
use super::{Bvh, Node};
use crate::{Hit, Ray};

/// Boxes are left this much later than computed: three roundings (Ize 2013: Robust BVH Ray Traversal).
const FAR_GROWTH: f32 = 1.0 + 4.0 * f32::EPSILON;

/// Direction components below this are taken as this: their inverse stays finite, and 0 times infinity never occurs.
const MIN_COMPONENT: f32 = 1e-30;

/// Enough for small scenes; it is cleared for each ray.
const SMALL_STACK: usize = 24;
/// Enough for all but degenerate trees.
const USUAL_STACK: usize = 64;
/// Enough for a tree of depth 128.
const LARGE_STACK: usize = 400;

/// A node that waits and where the ray enters its box.
type Waiting = (u32, f32);

/// A ray in the form in which boxes want it.
struct BoxRay {
    origin: [Vec4; 3],
    inverse: [Vec4; 3],
    /// For each axis, whether the ray runs downwards: the index of the side at which it enters.
    side: [usize; 3],
}

impl BoxRay {
    #[inline]
    fn new(ray: &Ray) -> Self {
        let d = ray.direction.to_array();
        let safe = d.map(|x| if x.abs() < MIN_COMPONENT { MIN_COMPONENT.copysign(x) } else { x });
        Self {
            origin: ray.origin.to_array().map(Vec4::splat),
            inverse: safe.map(|x| Vec4::splat(1.0 / x)),
            side: d.map(|x| usize::from(x.is_sign_negative())),
        }
    }

    /// Returns where the ray enters the four boxes, and which of them it meets in (`t_min`, `t_max`).
    #[inline]
    fn meet(&self, node: &Node, t_min: f32, t_max: f32) -> (Vec4, u32) {
        let near = |axis: usize| (node.bounds[self.side[axis] & 1][axis] - self.origin[axis]) * self.inverse[axis];
        let far = |axis: usize| (node.bounds[(self.side[axis] & 1) ^ 1][axis] - self.origin[axis]) * self.inverse[axis];
        let enter = near(0).max(near(1)).max(near(2)).max(Vec4::splat(t_min));
        let leave = (far(0).min(far(1)).min(far(2)) * FAR_GROWTH).min(Vec4::splat(t_max));
        (enter, enter.cmple(leave).bitmask())
    }
}

impl Bvh {
    /// Returns the nearest hit.
    ///
    /// `form` meets a free form (its primitive index) with a ray of shortened range; `keep` decides whether a hit of a primitive with holes counts.
    #[inline]
    pub(crate) fn closest(
        &self,
        ray: &Ray,
        form: impl Fn(u32, &Ray) -> Option<Hit>,
        keep: impl Fn(&Hit) -> bool,
    ) -> Option<Hit> {
        let mut nearest = None;
        let mut range = *ray;
        self.traverse::<false>(ray, |bvh, packet, sheared| {
            if let Some(hit) = bvh.meet_packet::<false>(packet, &range, sheared, &form, &keep) {
                range.t_max = hit.t;
                nearest = Some(hit);
            }
            range.t_max
        });
        nearest
    }

    /// Whether there is any hit; the arguments are those of [`Bvh::closest`].
    #[inline]
    pub(crate) fn any(&self, ray: &Ray, form: impl Fn(u32, &Ray) -> Option<Hit>, keep: impl Fn(&Hit) -> bool) -> bool {
        let mut found = false;
        self.traverse::<true>(ray, |bvh, packet, sheared| {
            found = bvh.meet_packet::<true>(packet, ray, sheared, &form, &keep).is_some();
            if found { f32::NEG_INFINITY } else { ray.t_max }
        });
        found
    }

    /// Calls `leaf` with the packets that the ray may meet, about from near to far; `leaf` returns how far is still of interest.
    #[inline]
    fn traverse<const ANY: bool>(&self, ray: &Ray, leaf: impl FnMut(&Self, usize, &ShearedRay) -> f32) {
        if self.nodes.is_empty() || !ray.is_valid() {
            return;
        }
        let nothing = (0, 0.0);
        if self.stack_size <= SMALL_STACK {
            self.traverse_with::<ANY>(&mut [nothing; SMALL_STACK], ray, leaf);
        } else if self.stack_size <= USUAL_STACK {
            self.traverse_with::<ANY>(&mut [nothing; USUAL_STACK], ray, leaf);
        } else if self.stack_size <= LARGE_STACK {
            self.traverse_with::<ANY>(&mut [nothing; LARGE_STACK], ray, leaf);
        } else {
            // A tree that deep takes far longer than this allocation.
            self.traverse_with::<ANY>(&mut vec![nothing; self.stack_size], ray, leaf);
        }
    }

    #[inline]
    fn traverse_with<const ANY: bool>(
        &self,
        stack: &mut [Waiting],
        ray: &Ray,
        mut leaf: impl FnMut(&Self, usize, &ShearedRay) -> f32,
    ) {
        let boxes = BoxRay::new(ray);
        let sheared = ShearedRay::new(ray);
        let mut t_max = ray.t_max;
        let mut waiting = 0;
        let mut node = &self.nodes[0];
        loop {
            let (enter, mask) = boxes.meet(node, ray.t_min, t_max);
            // Leaves first: a hit there spares the rest, and nothing has to wait for it.
            let mut leaves = mask & node.leaves;
            while leaves != 0 {
                let lane = leaves.trailing_zeros() as usize & 3;
                leaves &= leaves - 1;
                if enter[lane] <= t_max {
                    t_max = leaf(self, node.children[lane] as usize, &sheared);
                }
            }
            let first = waiting;
            let mut inner = mask & !node.leaves;
            while inner != 0 {
                let lane = inner.trailing_zeros() as usize & 3;
                inner &= inner - 1;
                // Insertion keeps the nearest of this node's children on top; for any hit the order is not worth its cost: where the
                // scene is closed, to start anywhere finds one three times sooner than to search the crowded near first (measured in an atrium).
                let t = enter[lane];
                let mut at = waiting;
                while at > first && !ANY && stack[at - 1].1 < t {
                    stack[at] = stack[at - 1];
                    at -= 1;
                }
                stack[at] = (node.children[lane], t);
                waiting += 1;
            }
            node = loop {
                if waiting == 0 {
                    return;
                }
                waiting -= 1;
                let (next, t) = stack[waiting];
                if t <= t_max {
                    break &self.nodes[next as usize];
                }
            };
        }
    }

    /// Returns the nearest hit of a packet's primitives, or any one.
    #[inline]
    fn meet_packet<const ANY: bool>(
        &self,
        packet: usize,
        ray: &Ray,
        sheared: &ShearedRay,
        form: &impl Fn(u32, &Ray) -> Option<Hit>,
        keep: &impl Fn(&Hit) -> bool,
    ) -> Option<Hit> {
        let packet = &self.packets[packet];
        let lanes = packet.meet(sheared, ray.t_max);
        let mut nearest: Option<Hit> = None;
        let mut t_max = ray.t_max;
        let mut mask = lanes.mask;
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize & 3;
            mask &= mask - 1;
            let (t, barycentrics) = packet.hit(lane, &lanes, ray);
            let hit = Hit { t, primitive: packet.primitives[lane] & PRIMITIVE, barycentrics, media: ray.media };
            if t > ray.t_min && t < t_max && (packet.primitives[lane] & CUT_OUT == 0 || keep(&hit)) {
                t_max = t;
                nearest = Some(hit);
                if ANY {
                    return nearest;
                }
            }
        }
        if !self.has_forms {
            return nearest;
        }
        for lane in packet.primitives {
            if lane & FORM != 0 && lane & PRIMITIVE != PRIMITIVE {
                let primitive = lane & PRIMITIVE;
                if let Some(hit) = form(primitive, &Ray { t_max, ..*ray }) {
                    t_max = hit.t;
                    nearest = Some(hit);
                    if ANY {
                        return nearest;
                    }
                }
            }
        }
        nearest
    }
}
