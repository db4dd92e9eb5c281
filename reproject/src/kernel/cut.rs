//! Elements that reach below the horizon of the point, where a corner has no place in the square that would do: straight edges to it would fold back into the disk.

use glam::Vec3A;

use super::board::{HORIZON, Places, Task, kind};
use super::scalar::direction_to_square;

/// The corners of element `e` as seen from the point, in its frame.
pub(super) fn space(task: &Task<'_>, e: usize) -> [Vec3A; 4] {
    let offset = task.offset * task.elements.finite[e];
    [0, 1, 2, 3].map(|k| task.rotation * (task.elements.corner(e, k) - offset))
}

/// Lifts the corners of element `e` that are below the horizon to where its edges cross it, as long as four corners do: so unless one is below between two that are not. Gives its
/// [`kind`]: of an element that is cut otherwise, or wholly below, or of any.
#[cold]
pub(super) fn lift(task: &Task<'_>, places: &mut Places, e: usize) -> u8 {
    let space = space(task, e);
    let is_below =
        space.map(|corner| corner.z < 0.0 && corner.z * corner.z > HORIZON * HORIZON * corner.length_squared());
    let beside = |k: usize| [(k + 1) % 4, (k + 3) % 4];
    match is_below {
        [false, false, false, false] => return 0,
        [true, true, true, true] => {
            places.counts[e] = [0; 2];
            return kind::BELOW;
        }
        [true, false, _, false] | [false, true, false, _] | [_, false, true, false] | [false, _, false, true] => {
            return kind::CUT;
        }
        _ => {}
    }
    let mut quad = places.quad(e);
    let mut between_others = None;
    for k in (0..4).filter(|&k| is_below[k]) {
        match beside(k).into_iter().find(|&other| !is_below[other]) {
            Some(other) => quad[k] = direction_to_square(crossing(space[k], space[other])),
            None => between_others = Some(k),
        }
    }
    if let Some(k) = between_others {
        quad[k] = quad[(k + 1) % 4];
    }
    places.set_quad(e, &quad);
    0
}

/// Where the line between a point below the horizon and one that is not crosses it.
pub(super) fn crossing(below: Vec3A, above: Vec3A) -> Vec3A {
    (below + (above - below) * (below.z / (below.z - above.z))).with_z(0.0)
}
