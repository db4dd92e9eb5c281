//! Which sides of a texel are silhouettes: edges with something farther and discontinuous beside them.
//!
//! Only there can something that the record did not see come into view when the point moves. A floor that runs through
//! several layers has no silhouette inside; marking the trail of every element instead calls three times as much
//! unknown.

use glam::Vec3A;

use crate::{Samples, Sides};

/// How far two planes may be apart, as a share of the distance, before their edge counts as a jump. As tight as the
/// texel grid allows: jitter of the rays and curvature inside a texel stay below it.
const JUMP: f32 = 0.05;

/// The silhouette sides of each texel, `n x n` as in [`Samples`], whose `points` these are.
pub(crate) fn silhouettes(samples: &Samples, points: &[Vec3A]) -> Vec<Sides> {
    let n = samples.resolution();
    let mut sides = vec![Sides::NONE; n * n];
    let mut edge = |near: usize, far: usize, side: Sides| {
        if hides(samples, points, near, far) {
            sides[near] = sides[near] | side;
        }
    };
    for j in 0..n {
        for i in 0..n {
            let a = j * n + i;
            if i + 1 < n {
                edge(a, a + 1, Sides::RIGHT);
                edge(a + 1, a, Sides::LEFT);
            }
            if j + 1 < n {
                edge(a, a + n, Sides::TOP);
                edge(a + n, a, Sides::BOTTOM);
            }
        }
    }
    sides
}

/// Whether texel `near` hides something behind it at its border with texel `far`: `far` is farther and neither surface
/// runs on into the other.
fn hides(samples: &Samples, points: &[Vec3A], near: usize, far: usize) -> bool {
    let (dn, df) = (samples.distance[near], samples.distance[far]);
    if !dn.is_finite() || df <= dn * (1.0 + JUMP) {
        return false;
    }
    if df.is_infinite() {
        return true;
    }
    let (pn, pf) = (points[near], points[far]);
    let along_near = plane_distance(pn, samples.normal[near].into(), pf / df);
    let along_far = plane_distance(pf, samples.normal[far].into(), pn / dn);
    let near_runs_on = (along_near - df).abs() <= JUMP * df;
    let far_runs_on = (along_far - dn).abs() <= JUMP * dn;
    !(near_runs_on || far_runs_on)
}

/// Distance from the origin along `direction` to the plane through `point`; infinite where it never meets it.
pub(crate) fn plane_distance(point: Vec3A, normal: Vec3A, direction: Vec3A) -> f32 {
    let t = normal.dot(point) / normal.dot(direction);
    if t > 0.0 { t } else { f32::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn floors_have_no_silhouettes_and_edges_have_one_side() {
        let slanted = Samples::from_fn(32, |wi| {
            let normal = Vec3A::new(-0.6, 0.0, -0.8);
            let t = plane_distance(normal * -3.0, normal, wi);
            (Vec3::ONE, t, normal)
        });
        let marked = silhouettes(&slanted, &slanted.points());
        let inside = (0..32 * 32).filter(|&t| slanted.distance[t].is_finite() && marked[t] != Sides::NONE);
        for t in inside {
            // Only where the plane ends at infinity may a side be marked.
            let (i, j) = (t % 32, t / 32);
            let open = [(i.wrapping_sub(1), j), (i + 1, j), (i, j.wrapping_sub(1)), (i, j + 1)]
                .iter()
                .any(|&(i, j)| i < 32 && j < 32 && slanted.distance[j * 32 + i].is_infinite());
            assert!(open, "texel {i} {j} lies inside the plane");
        }
        // A near half-plane x < 0 at height 1 before a far ceiling at 4: the edge runs up the middle.
        let edge = Samples::from_fn(32, |wi| (Vec3::ONE, if wi.x < 0.0 { 1.0 } else { 4.0 } / wi.z, Vec3A::NEG_Z));
        let marked = silhouettes(&edge, &edge.points());
        for (t, &found) in marked.iter().enumerate() {
            let expected = if t % 32 == 15 { Sides::RIGHT } else { Sides::NONE };
            assert_eq!(found, expected, "texel {t}");
        }
    }
}
