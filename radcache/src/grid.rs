//! Which balls may hold a point: a grid of cells for each power of two of the radius.

use std::collections::HashMap;

use glam::{IVec3, Vec3A};

/// Numbered balls in space, such as what records of radiance or irradiance reach.
///
/// A ball of radius r is entered at the level whose cells are at least r wide, in the up to 27 cells that it touches,
/// so a search looks at one cell a level: with radii spread over a factor of 1000 that is eleven look-ups at most. In
/// cells twice as wide each ball would stand in a third as many, but a search on a surface would look at twice as many
/// balls. Balls are found in the order in which they were entered, level by level, so the answer depends on the order
/// of the calls alone.
///
/// ```
/// # use glam::Vec3A;
/// let mut grid = radcache::BallGrid::default();
/// grid.insert(7, Vec3A::ZERO, 1.0);
/// grid.insert(8, Vec3A::X * 40.0, 0.5);
/// assert_eq!(grid.near(Vec3A::splat(0.3)).collect::<Vec<_>>(), [7]);
/// ```
#[derive(Debug, Default)]
pub struct BallGrid {
    /// Largest cells first.
    levels: Vec<Level>,
}

/// The balls of about one radius.
#[derive(Debug)]
struct Level {
    /// Exponent of the cell width.
    exponent: i32,
    /// The balls that reach into each cell.
    cells: HashMap<IVec3, Vec<u32>, CellHasher>,
}

impl BallGrid {
    /// Enters a ball; one without a radius is nowhere, and one without an end everywhere.
    pub fn insert(&mut self, number: u32, centre: Vec3A, radius: f32) {
        if radius <= 0.0 || radius.is_nan() {
            return;
        }
        let radius = radius.clamp(NARROWEST, WIDEST);
        let exponent = level_exponent(radius);
        let width = cell_width(exponent);
        let cells = self.level(exponent);
        let (low, high) = (cell(centre - radius, width), cell(centre + radius, width));
        for x in low.x..=high.x {
            for y in low.y..=high.y {
                for z in low.z..=high.z {
                    cells.entry(IVec3::new(x, y, z)).or_default().push(number);
                }
            }
        }
    }

    /// The numbers of all balls that hold `p`, and of some that do not.
    pub fn near(&self, p: Vec3A) -> impl Iterator<Item = u32> {
        let lists = self.levels.iter().filter_map(move |level| level.cells.get(&cell(p, cell_width(level.exponent))));
        lists.flatten().copied()
    }

    /// Bytes that it takes, about.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        let lists = self.levels.iter().flat_map(|level| level.cells.values());
        lists.map(|list| size_of::<(IVec3, Vec<u32>)>() + list.capacity() * size_of::<u32>()).sum()
    }

    fn level(&mut self, exponent: i32) -> &mut HashMap<IVec3, Vec<u32>, CellHasher> {
        let place = match self.levels.binary_search_by(|level| exponent.cmp(&level.exponent)) {
            Ok(found) => found,
            Err(place) => {
                self.levels.insert(place, Level { exponent, cells: HashMap::default() });
                place
            }
        };
        &mut self.levels[place].cells
    }
}

/// Metres beyond which no scene goes, and below which nothing is told apart: cells have a width.
const WIDEST: f32 = 1e30;
const NARROWEST: f32 = 1e-30;

/// Smallest exponent e with 2^e >= radius.
fn level_exponent(radius: f32) -> i32 {
    #[expect(clippy::cast_possible_truncation, reason = "an f32 exponent")]
    let exponent = radius.log2().ceil() as i32;
    exponent
}

fn cell_width(exponent: i32) -> f32 {
    2f32.powi(exponent)
}

/// The cell of a point. Very far points share the outermost cell: the cast saturates.
fn cell(p: Vec3A, width: f32) -> IVec3 {
    (p / width).floor().as_ivec3()
}

/// A multiplicative hash of three cell numbers; the default one costs more than the search.
#[derive(Debug, Clone, Copy, Default)]
struct CellHasher;

impl std::hash::BuildHasher for CellHasher {
    type Hasher = CellHash;
    fn build_hasher(&self) -> CellHash {
        CellHash(0)
    }
}

#[derive(Debug)]
struct CellHash(u64);

impl std::hash::Hasher for CellHash {
    fn finish(&self) -> u64 {
        self.0 ^ self.0 >> 32
    }
    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.write_i32(i32::from(byte));
        }
    }
    fn write_i32(&mut self, value: i32) {
        // The golden ratio in 64 bits, as in Fibonacci hashing.
        self.0 = (self.0.rotate_left(21) ^ u64::from(value.cast_unsigned())).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn balls_of_all_radii_are_found_where_they_are() {
        let radii = [f32::from_bits(1), 1e-30, 1e-3, 0.7, 1.0, 5.0, 1e20, f32::INFINITY];
        for centre in [Vec3A::ZERO, Vec3A::new(1.0 - f32::EPSILON, -3.0, 1e6)] {
            let mut grid = BallGrid::default();
            for (number, radius) in (0..).zip(radii) {
                grid.insert(number, centre, radius);
            }
            let mut found: Vec<u32> = grid.near(centre).collect();
            found.sort_unstable();
            assert_eq!(found, [0, 1, 2, 3, 4, 5, 6, 7], "around {centre}");
            for side in [Vec3A::X, Vec3A::NEG_Y, Vec3A::ONE.normalize()] {
                assert!(grid.near(centre + 4.9 * side).any(|number| number == 5), "off {centre} along {side}");
            }
        }
        let mut grid = BallGrid::default();
        for radius in [0.0, -1.0, f32::NAN] {
            grid.insert(0, Vec3A::ZERO, radius);
        }
        assert_eq!(grid.near(Vec3A::ZERO).next(), None, "without a radius");
    }
}
