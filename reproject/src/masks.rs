//! Bit masks over the square: n rows of one machine word each, and the rasteriser that sets their bits.
//!
//! Bit i of row j stands for the texel with its centre at ((i + 1/2)/n, (j + 1/2)/n).

use glam::Vec2;
use radcache::MAX_RESOLUTION;

/// Rows of bits, row j in word j; bits and rows from n on are zero.
pub type Rows = [u64; MAX_RESOLUTION];

/// Most corners that a polygon may have here: a quadrilateral clipped by a plane has at most 6.
const MAX_CORNERS: usize = 8;

/// The masks of a reprojection.
#[derive(Debug, Clone)]
pub struct Masks {
    n: usize,
    /// What elements have filled.
    pub fill: Rows,
    /// What may hide something that the record did not see: farther layers must not fill it.
    pub unknown: Rows,
}

impl Masks {
    /// Empty masks of n rows of n bits.
    #[must_use]
    pub fn new(n: usize) -> Self {
        Self { n, fill: [0; MAX_RESOLUTION], unknown: [0; MAX_RESOLUTION] }
    }

    /// Empties them and sets the number of rows.
    pub fn reset(&mut self, n: usize) {
        self.n = n;
        self.fill = [0; MAX_RESOLUTION];
        self.unknown = [0; MAX_RESOLUTION];
    }

    /// Ends a layer: its bits become filled, and what its trails swept and nothing fills becomes unknown.
    pub fn end_layer(&mut self, layer_fill: &mut Rows, trail: &mut Rows) {
        for j in 0..self.n {
            self.fill[j] |= layer_fill[j];
            self.unknown[j] |= trail[j] & !self.fill[j];
            layer_fill[j] = 0;
            trail[j] = 0;
        }
    }

    /// Bits of row j that nothing fills: unknown ones and gaps.
    #[must_use]
    pub fn holes(&self, j: usize) -> u64 {
        full_row(self.n) & !self.fill[j]
    }

    /// Number of bits set in the first n rows.
    #[must_use]
    pub fn count(&self, rows: &Rows) -> u32 {
        rows[..self.n].iter().map(|row| row.count_ones()).sum()
    }
}

/// A row with its first n bits set.
pub(crate) fn full_row(n: usize) -> u64 {
    u64::MAX >> (MAX_RESOLUTION - n)
}

/// Calls `set(row, bits)` for each row in which the polygon covers texel centres; winding other than zero is inside.
///
/// A centre on an edge belongs to the polygon at its right, or above it: polygons that share an edge share no centre and leave
/// none out. Corners are in the square; what lies outside [0, 1] is cut off.
///
/// # Panics
/// If there are more than 8 corners.
#[inline]
pub fn polygon_rows(corners: &[Vec2], n: usize, mut set: impl FnMut(usize, u64)) {
    assert!(corners.len() <= MAX_CORNERS, "at most 8 corners");
    let scale = n as f32;
    // In units of texels, with the centres on whole numbers.
    let mut points = [Vec2::ZERO; MAX_CORNERS + 1];
    let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
    for (point, corner) in points.iter_mut().zip(corners) {
        *point = *corner * scale - 0.5;
        low = low.min(point.y);
        high = high.max(point.y);
    }
    points[corners.len()] = points[0];
    let rows = first_centre(low, n)..first_centre(high, n);
    let mut crossings = [(0.0f32, 0i32); MAX_CORNERS];
    for row in rows {
        let y = row as f32;
        let mut count = 0;
        for edge in points[..=corners.len()].windows(2) {
            let (a, b) = (edge[0], edge[1]);
            if (a.y <= y) != (b.y <= y) {
                crossings[count] = (crossing(a, b, y), if b.y > a.y { 1 } else { -1 });
                count += 1;
            }
        }
        let bits = if count == 2 {
            let (x0, x1) = (crossings[0].0, crossings[1].0);
            span(x0.min(x1), x0.max(x1), n)
        } else {
            winding_bits(&mut crossings[..count], n)
        };
        if bits != 0 {
            set(row, bits);
        }
    }
}

/// Calls `set(row, bits)` for each row of the rectangle that encloses the corners: centres in [min, max).
#[inline]
pub fn rectangle_rows(corners: &[Vec2], n: usize, mut set: impl FnMut(usize, u64)) {
    let start = (Vec2::splat(f32::INFINITY), Vec2::splat(f32::NEG_INFINITY));
    let (min, max) = corners.iter().fold(start, |(lo, hi), &c| (lo.min(c), hi.max(c)));
    let (min, max) = (min * n as f32 - 0.5, max * n as f32 - 0.5);
    let bits = span(min.x, max.x, n);
    if bits != 0 {
        for row in first_centre(min.y, n)..first_centre(max.y, n) {
            set(row, bits);
        }
    }
}

/// Where the edge crosses the line at `y`; the same bits whichever way the edge runs.
#[inline]
fn crossing(a: Vec2, b: Vec2, y: f32) -> f32 {
    let (a, b) = if a.y <= b.y { (a, b) } else { (b, a) };
    a.x + (y - a.y) * ((b.x - a.x) / (b.y - a.y))
}

/// The first of n centres at or above x, n if there is none.
#[inline]
fn first_centre(x: f32, n: usize) -> usize {
    #[expect(clippy::cast_possible_truncation, reason = "the cast saturates and NaN becomes 0")]
    let first = x.ceil() as usize;
    first.min(n)
}

/// Bits of the centres in [x0, x1).
#[inline]
fn span(x0: f32, x1: f32, n: usize) -> u64 {
    let (first, end) = (first_centre(x0, n), first_centre(x1, n));
    if first < end { full_row(end - first) << first } else { 0 }
}

/// Bits between crossings whose winding number is not zero.
#[cold]
fn winding_bits(crossings: &mut [(f32, i32)], n: usize) -> u64 {
    crossings.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let mut bits = 0;
    let mut winding = 0;
    for pair in crossings.windows(2) {
        winding += pair[0].1;
        if winding != 0 {
            bits |= span(pair[0].0, pair[1].0, n);
        }
    }
    bits
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rows(corners: &[Vec2], n: usize) -> Rows {
        let mut rows = [0; MAX_RESOLUTION];
        polygon_rows(corners, n, |j, bits| rows[j] |= bits);
        rows
    }

    /// Winding number of each centre by three nested loops.
    fn naive(corners: &[Vec2], n: usize) -> Rows {
        let mut rows = [0; MAX_RESOLUTION];
        for (j, row) in rows.iter_mut().enumerate().take(n) {
            for i in 0..n {
                let mut winding = 0;
                for k in 0..corners.len() {
                    let a = corners[k] * n as f32 - 0.5;
                    let b = corners[(k + 1) % corners.len()] * n as f32 - 0.5;
                    let y = j as f32;
                    if (a.y <= y) != (b.y <= y) && crossing(a, b, y) <= i as f32 {
                        winding += if b.y > a.y { 1 } else { -1 };
                    }
                }
                if winding != 0 {
                    *row |= 1 << i;
                }
            }
        }
        rows
    }

    fn point() -> impl Strategy<Value = Vec2> {
        let coordinate =
            prop_oneof![4 => 0.0f32..1.0, 1 => -0.5f32..1.5, 1 => (0u8..33).prop_map(|k| f32::from(k) / 32.0)];
        (coordinate.clone(), coordinate).prop_map(|(x, y)| Vec2::new(x, y))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4096))]
        #[test]
        fn mask_equals_naive_pixel_set(
            corners in prop::collection::vec(point(), 3..7),
            n in prop_oneof![Just(1usize), Just(7), Just(16), Just(32), Just(33), Just(64)],
        ) {
            prop_assert_eq!(rows(&corners, n), naive(&corners, n));
        }

        #[test]
        fn rectangle_equals_naive_pixel_set(corners in prop::array::uniform4(point()), n in 1usize..=64) {
            let mut found = [0; MAX_RESOLUTION];
            rectangle_rows(&corners, n, |j, bits| found[j] |= bits);
            let min = corners.iter().copied().reduce(Vec2::min).unwrap() * n as f32 - 0.5;
            let max = corners.iter().copied().reduce(Vec2::max).unwrap() * n as f32 - 0.5;
            for (j, row) in found.iter().enumerate().take(n) {
                for i in 0..n {
                    let (x, y) = (i as f32, j as f32);
                    let inside = x >= min.x && x < max.x && y >= min.y && y < max.y;
                    prop_assert_eq!(row >> i & 1 == 1, inside, "row {} bit {}", j, i);
                }
            }
        }

        #[test]
        fn neighbours_tile_without_gap_or_overlap(inner in prop::collection::vec(point(), 9), n in 1usize..=64) {
            // A 4 x 4 grid of quads over the square with its inner corners moved a little.
            let at = |i: usize, j: usize| {
                let base = Vec2::new(i as f32, j as f32) / 4.0;
                let edge = i % 4 == 0 || j % 4 == 0;
                if edge { base } else { base + (inner[(i - 1) * 3 + j - 1].clamp(Vec2::ZERO, Vec2::ONE) - 0.5) * 0.12 }
            };
            let mut seen = [0u64; MAX_RESOLUTION];
            for j in 0..4 {
                for i in 0..4 {
                    let quad = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                    let found = rows(&quad, n);
                    for (s, f) in seen.iter_mut().zip(found) {
                        prop_assert_eq!(*s & f, 0, "overlap");
                        *s |= f;
                    }
                }
            }
            for row in &seen[..n] {
                prop_assert_eq!(*row, full_row(n), "gap");
            }
        }

        #[test]
        fn fill_trace_unknown_obey_set_algebra(fills in prop::collection::vec((any::<u64>(), any::<u64>()), 1..6), n in 1usize..=64) {
            let mut masks = Masks::new(n);
            let (mut filled, mut unknown) = (0u64, 0u64);
            for (fill, trail) in fills {
                let fill = fill & full_row(n) & !(filled | unknown);
                let trail = trail & full_row(n);
                let (mut layer, mut swept) = ([0; MAX_RESOLUTION], [0; MAX_RESOLUTION]);
                layer[0] = fill;
                swept[0] = trail;
                masks.end_layer(&mut layer, &mut swept);
                filled |= fill;
                unknown |= trail & !filled;
                prop_assert_eq!(layer[0] | swept[0], 0, "ready for the next layer");
            }
            prop_assert_eq!((masks.fill[0], masks.unknown[0]), (filled, unknown));
            prop_assert_eq!(masks.fill[0] & masks.unknown[0], 0, "disjoint");
            prop_assert_eq!(masks.holes(0) | masks.fill[0], full_row(n), "together all");
        }
    }

    #[test]
    fn bow_ties_and_the_whole_square() {
        let whole = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
        assert!(rows(&whole, 33)[..33].iter().all(|&row| row == full_row(33)), "all bits");
        let bow_tie = [Vec2::ZERO, Vec2::ONE, Vec2::X, Vec2::Y];
        let covered: u32 = rows(&bow_tie, 32).iter().map(|row| row.count_ones()).sum();
        assert!((480..=544).contains(&covered), "two triangles of a quarter each: {covered}");
        assert_eq!(
            rows(&[Vec2::ZERO, Vec2::new(1.0, 0.01), Vec2::new(1.0, 0.012)], 32),
            [0; 64],
            "thinner than a texel"
        );
    }
}
