//! Tiles of the picture, each with the six sides of the normal: primary rays that meet similar surfaces learn together.

use glam::{UVec2, Vec2, Vec3A};

use crate::cells::side_of;

/// Tiles along a side of the picture.
const SIDE: u32 = 16;
/// Axes of the normal, each way.
pub(super) const SIDES: usize = 6;
/// Tiles and sides altogether.
pub(super) const COUNT: usize = (SIDE * SIDE) as usize * SIDES;
/// What neighbours count, for lessons are few.
pub(super) const NEAR: [(i32, f32); 3] = [(-1, 0.5), (0, 1.0), (1, 0.5)];

/// The tile and side at a place on the film, pixels.
pub(super) fn tile(film: Vec2, size: UVec2, n: Vec3A) -> usize {
    let place = (film * SIDE as f32 / size.as_vec2()).as_uvec2().min(UVec2::splat(SIDE - 1));
    (place.y * SIDE + place.x) as usize * SIDES + side_of(n)
}

/// The tiles around one and itself, of the same side, with what they count for it.
pub(super) fn around(tile: usize) -> impl Iterator<Item = (usize, f32)> {
    let (place, side) = (tile / SIDES, tile % SIDES);
    let (x, y) = (place % SIDE as usize, place / SIDE as usize);
    NEAR.into_iter().flat_map(move |(dy, wy)| NEAR.into_iter().map(move |(dx, wx)| (dx, dy, wx * wy))).filter_map(
        move |(dx, dy, weight)| {
            let (x, y) = (inside(x, dx, SIDE as usize)?, inside(y, dy, SIDE as usize)?);
            Some(((y * SIDE as usize + x) * SIDES + side, weight))
        },
    )
}

/// A place moved by an offset, where that is one of `count`.
pub(super) fn inside(at: usize, offset: i32, count: usize) -> Option<usize> {
    at.checked_add_signed(offset as isize).filter(|&at| at < count)
}
