//! Rays through the tree: the nearest hit, or any.

use super::Bvh;
use super::lane_ray::LaneRay;
use super::packet::{CUT_OUT, FORM, PRIMITIVE, Packet};
use crate::{Hit, Ray};

/// Enough for small scenes; it is cleared for each ray.
const SMALL_STACK: usize = 24;
/// Enough for all but degenerate trees.
const USUAL_STACK: usize = 64;
/// Enough for a tree of depth 128.
const LARGE_STACK: usize = 400;

/// A node that waits and where the ray enters its box.
type Waiting = (u32, f32);

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
        self.traverse::<false>(ray, |bvh, packet, lanes| {
            if let Some(hit) = bvh.meet_packet::<false>(packet, &range, lanes, &form, &keep) {
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
        self.traverse::<true>(ray, |bvh, packet, lanes| {
            found = bvh.meet_packet::<true>(packet, ray, lanes, &form, &keep).is_some();
            if found { f32::NEG_INFINITY } else { ray.t_max }
        });
        found
    }

    /// Calls `leaf` with the packets that the ray may meet, about from near to far; `leaf` returns how far is still of interest.
    #[inline]
    fn traverse<const ANY: bool>(&self, ray: &Ray, leaf: impl FnMut(&Self, usize, &LaneRay) -> f32) {
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
        mut leaf: impl FnMut(&Self, usize, &LaneRay) -> f32,
    ) {
        let lanes = LaneRay::new(ray);
        let mut t_max = ray.t_max;
        let mut waiting = 0;
        let mut node = &self.nodes[0];
        loop {
            let (enter, mask) = lanes.meet(node, ray.t_min, t_max);
            // Lanes of an array are loads; those of a vector are a jump that nobody can predict.
            let enter = enter.to_array();
            // Leaves first: a hit there spares the rest, and nothing has to wait for it.
            let mut leaves = mask & node.leaves;
            while leaves != 0 {
                let lane = leaves.trailing_zeros() as usize & 3;
                leaves &= leaves - 1;
                if enter[lane] <= t_max {
                    t_max = leaf(self, node.children[lane] as usize, &lanes);
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
        lanes: &LaneRay,
        form: &impl Fn(u32, &Ray) -> Option<Hit>,
        keep: &impl Fn(&Hit) -> bool,
    ) -> Option<Hit> {
        let packet = &self.packets[packet];
        let met = packet.meet(lanes, ray.t_max);
        let mut nearest: Option<Hit> = None;
        let mut t_max = ray.t_max;
        let mut mask = met.mask;
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize & 3;
            mask &= mask - 1;
            if packet.primitives[lane] & !CUT_OUT == ray.from {
                continue;
            }
            let (t, barycentrics) = packet.hit(lane, &met, ray);
            let hit = Hit { t, primitive: packet.primitives[lane] & PRIMITIVE, barycentrics, media: ray.media };
            if t > ray.t_min && t < t_max && (packet.primitives[lane] & CUT_OUT == 0 || keep(&hit)) {
                t_max = t;
                nearest = Some(hit);
                if ANY {
                    return nearest;
                }
            }
        }
        if self.has_forms { meet_forms::<ANY>(packet, ray, form, nearest) } else { nearest }
    }
}

/// Returns the nearest hit of a packet's free forms or the `nearest` so far, or any one.
fn meet_forms<const ANY: bool>(
    packet: &Packet,
    ray: &Ray,
    form: &impl Fn(u32, &Ray) -> Option<Hit>,
    mut nearest: Option<Hit>,
) -> Option<Hit> {
    let mut t_max = nearest.map_or(ray.t_max, |hit| hit.t);
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
