//! Rays through the tree: the nearest hit, or any.

use arrayvec::ArrayVec;
use fearless_simd::{Simd, SimdBase, dispatch};

use super::build::MAX_DEPTH;
use super::lane_ray::LaneRay;
use super::packet::{CUT_OUT, PRIMITIVE, Packet, form_of};
use super::{Bvh, LANES};
use crate::{Hit, Ray};

/// Each node on a path, which is as long as the tree is deep, leaves all but one of its children behind.
const STACK: usize = (LANES - 1) * MAX_DEPTH + 1;

impl Bvh {
    /// Returns the nearest hit.
    ///
    /// `form` meets a free form (its primitive index) with a ray of shortened range; `keep` decides whether a hit of a
    /// primitive with holes counts.
    #[inline]
    pub(crate) fn closest(
        &self,
        ray: &Ray,
        form: impl Fn(u32, &Ray) -> Option<Hit>,
        keep: impl Fn(&Hit) -> bool,
    ) -> Option<Hit> {
        dispatch!(self.level, simd => {
            // Within the function of wide instructions, where it need not be kept in memory.
            let mut nearest = None;
            let mut range = *ray;
            self.traverse::<_, false>(simd, ray, #[inline(always)] |packet, lanes| {
                if let Some(hit) = self.meet_packet::<_, false>(packet, &range, lanes, &form, &keep) {
                    range.t_max = hit.t;
                    nearest = Some(hit);
                }
                range.t_max
            });
            nearest
        })
    }

    /// Whether there is any hit; the arguments are those of [`Bvh::closest`].
    #[inline]
    pub(crate) fn any(&self, ray: &Ray, form: impl Fn(u32, &Ray) -> Option<Hit>, keep: impl Fn(&Hit) -> bool) -> bool {
        let mut found = false;
        dispatch!(self.level, simd => self.traverse::<_, true>(simd, ray, #[inline(always)] |packet, lanes| {
            found = self.meet_packet::<_, true>(packet, ray, lanes, &form, &keep).is_some();
            if found { f32::NEG_INFINITY } else { ray.t_max }
        }));
        found
    }

    /// Calls `leaf` with the packets that the ray may meet, about from near to far; `leaf` returns how far is still of
    /// interest.
    #[inline(always)]
    fn traverse<S: Simd, const ANY: bool>(
        &self,
        simd: S,
        ray: &Ray,
        mut leaf: impl FnMut(&Packet, &LaneRay<S>) -> f32,
    ) {
        if self.nodes.is_empty() || !ray.is_valid() {
            return;
        }
        let lanes = LaneRay::new(simd, ray);
        let mut t_max = ray.t_max;
        // Nodes that wait and where the ray enters their boxes.
        let mut stack = ArrayVec::<(u32, f32), STACK>::new();
        let mut node = &self.nodes[0];
        loop {
            let (enter, mask) = lanes.meet(node, ray.t_min, t_max);
            // Lanes of an array are loads; those of a vector are a jump that nobody can predict.
            let enter = enter.to_array();
            // Leaves first: a hit there spares the rest, and nothing has to wait for it.
            let mut leaves = mask & node.leaves;
            while leaves != 0 {
                let lane = leaves.trailing_zeros() as usize % LANES;
                leaves &= leaves - 1;
                if enter[lane] <= t_max {
                    t_max = leaf(&self.packets[node.children[lane] as usize], &lanes);
                }
            }
            let first = stack.len();
            let mut inner = mask & !node.leaves;
            while inner != 0 {
                let lane = inner.trailing_zeros() as usize % LANES;
                inner &= inner - 1;
                let t = enter[lane];
                let mut at = stack.len();
                stack.push((node.children[lane], t));
                // Insertion keeps the nearest of this node's children on top; for any hit the order is not worth its
                // cost: where the scene is closed, to start anywhere finds one three times sooner than to search the
                // crowded near first (measured in an atrium).
                while at > first && !ANY && stack[at - 1].1 < t {
                    stack.swap(at, at - 1);
                    at -= 1;
                }
            }
            node = loop {
                let Some((next, t)) = stack.pop() else { return };
                if t <= t_max {
                    break &self.nodes[next as usize];
                }
            };
        }
    }

    /// Returns the nearest hit of a packet's primitives, or any one.
    #[inline(always)]
    fn meet_packet<S: Simd, const ANY: bool>(
        &self,
        packet: &Packet,
        ray: &Ray,
        lanes: &LaneRay<S>,
        form: &impl Fn(u32, &Ray) -> Option<Hit>,
        keep: &impl Fn(&Hit) -> bool,
    ) -> Option<Hit> {
        let met = packet.meet(lanes, ray.t_max);
        let mut nearest: Option<Hit> = None;
        let mut t_max = ray.t_max;
        let mut mask = met.mask;
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize % LANES;
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
    for primitive in packet.primitives.into_iter().filter_map(form_of) {
        if let Some(hit) = form(primitive, &Ray { t_max, ..*ray }) {
            t_max = hit.t;
            nearest = Some(hit);
            if ANY {
                return nearest;
            }
        }
    }
    nearest
}
