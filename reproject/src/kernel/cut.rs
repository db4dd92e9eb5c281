//! Elements that reach below the horizon of the point, where a corner has no place in the square that would do:
//! straight edges to it would fold back into the disk.

use glam::Vec3A;

use super::board::{HORIZON, Places, Task, kind};
use super::scalar::direction_to_square;
use crate::clip::crossing;

/// The corners of element `e` as seen from the point, in its frame.
pub(super) fn space(task: &Task<'_>, e: usize) -> [Vec3A; 4] {
    let offset = task.offset * task.elements.finite[e];
    [0, 1, 2, 3].map(|k| task.rotation * (task.elements.corner(e, k) - offset))
}

/// Lifts the corners of element `e` that are below the horizon to where its edges cross it, as long as four corners do:
/// so unless one is below between two that are not. Gives its [`kind`]: of an element that is cut otherwise, or wholly
/// below, or of any.
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

#[cfg(test)]
mod tests {
    use glam::{Mat3A, Vec3};
    use hemimap::Frame;
    use radcache::{Record, RecordSettings, Samples, Validity};

    use super::*;
    use crate::kernel::Board;
    use crate::{Settings, Workspace};

    /// The kinds of the elements of a ball of radius 1 that a point at its centre sees with a normal turned by `angle`,
    /// by how many corners are below its horizon.
    fn kinds(angle: f32) -> [Vec<u8>; 5] {
        let samples = Samples::from_fn(16, |wi| (Vec3::ONE, 1.0, -wi));
        let frame = Frame::from_normal(Vec3A::Z);
        let record = Record::new(Vec3A::ZERO, frame, samples, &RecordSettings::default(), &Validity::default());
        let rotation = Mat3A::from_rotation_y(angle);
        let task =
            Task { elements: record.elements(), rotation, offset: Vec3A::ZERO, n: 16, settings: Settings::default() };
        let mut kinds: [Vec<u8>; 5] = Default::default();
        let mut board = Board::<u32>::default();
        board.reset(&task, Workspace::new().masks());
        for e in 0..record.elements().len() {
            let below = space(&task, e).iter().filter(|corner| corner.z < -HORIZON * corner.length()).count();
            kinds[below].push(lift(&task, &mut board.places, e));
        }
        kinds
    }

    #[test]
    fn elements_keep_four_corners_but_where_one_or_two_across_are_below() {
        let kinds = kinds(0.7);
        assert!(kinds.iter().all(|kinds| !kinds.is_empty()), "all cases occur: {kinds:?}");
        let only = |below: usize, allowed: &[u8]| kinds[below].iter().all(|kind| allowed.contains(kind));
        assert!(only(0, &[0]) && only(1, &[kind::CUT]) && only(2, &[0, kind::CUT]), "{kinds:?}");
        assert!(only(3, &[0]) && only(4, &[kind::BELOW]), "{kinds:?}");
        assert!(kinds[2].contains(&0), "{kinds:?}");
    }
}
