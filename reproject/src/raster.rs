//! The rasteriser: which texel centres a polygon covers, as rows of bits.
//!
//! A centre is covered where a ray to it from the left crosses the edges an odd number of times. For a quadrilateral
//! that is the same as a winding number other than zero, for four edges, of less than half a turn each, cannot wind
//! round a point twice. So each row is the exclusive or of one word for each edge: no sorting, and no branch but that
//! on the number of rows.

use std::ops::Range;

use glam::{Vec2, Vec4};
use radcache::MAX_RESOLUTION;

use crate::Rows;

/// Most corners that a polygon may have here: a quadrilateral clipped by a plane has at most 6.
const MAX_CORNERS: usize = 8;

/// Sets rows to the texel centres that the polygon covers, and tells which rows: the others keep what they had.
///
/// A centre on an edge belongs to one of the polygons that share it: they share no centre and leave none out. Corners
/// are in the square; what lies outside [0, 1] is cut off. Corners that are not numbers cover nothing sensible but do
/// no harm.
///
/// # Panics
/// If there are more than 8 corners, or n is above 64.
#[inline]
pub fn polygon_rows(corners: &[Vec2], n: usize, rows: &mut Rows) -> Range<usize> {
    assert!(corners.len() <= MAX_CORNERS, "at most 8 corners");
    let Some(&last) = corners.last() else {
        return 0..0;
    };
    // Missing corners repeat the last one: edges without height cross nothing.
    let corner = |k: usize| corners.get(k).copied().unwrap_or(last);
    if corners.len() <= 4 {
        rows_of(std::array::from_fn::<_, 4, _>(corner), n, rows)
    } else {
        rows_of(std::array::from_fn::<_, MAX_CORNERS, _>(corner), n, rows)
    }
}

/// Four edges at a time.
#[inline(always)]
fn rows_of<const E: usize>(corners: [Vec2; E], n: usize, rows: &mut Rows) -> Range<usize> {
    assert!(n <= MAX_RESOLUTION, "at most 64 rows");
    let scale = Vec4::splat(n as f32);
    // In units of texels, with the centres of rows on whole numbers.
    let lanes = |at: usize| {
        let [a, b, c, d] = [corners[at % E], corners[(at + 1) % E], corners[(at + 2) % E], corners[(at + 3) % E]];
        (Vec4::new(a.x, b.x, c.x, d.x) * scale, Vec4::new(a.y, b.y, c.y, d.y) * scale - 0.5)
    };
    let mut edges = [Edges::default(); MAX_CORNERS / 4];
    let edges = &mut edges[..E / 4];
    let (mut low, mut high) = (Vec4::INFINITY, Vec4::NEG_INFINITY);
    for (group, edges) in edges.iter_mut().enumerate() {
        let ((x, y), (x_next, y_next)) = (lanes(4 * group), lanes(4 * group + 1));
        // Each edge from its lower end up, so that it has the same bits whichever way it runs.
        *edges = Edges {
            x_low: Vec4::select(y.cmple(y_next), x, x_next),
            y_low: y.min(y_next),
            y_high: y.max(y_next),
            slope: (x_next - x) / (y_next - y),
        };
        low = low.min(edges.y_low);
        high = high.max(edges.y_high);
    }
    let ends = Vec4::new(low.min_element(), high.max_element(), 0.0, 0.0);
    let [first, end, ..] = first_centres(ends, scale);
    if first >= end {
        return 0..0;
    }
    for (row, out) in rows[first..end].iter_mut().enumerate() {
        let centre = Vec4::splat((first + row) as f32);
        let mut bits = 0;
        for edges in edges.iter() {
            let crossing = edges.x_low + (centre - edges.y_low) * edges.slope;
            // Level edges cross no row, which also keeps their slopes out.
            let crosses = edges.y_low.cmple(centre) & centre.cmplt(edges.y_high);
            let [a, b, c, d] = nearest_wholes(Vec4::select(crosses, crossing, Vec4::ZERO), scale);
            bits ^= BELOW[a] ^ BELOW[b] ^ BELOW[c] ^ BELOW[d];
        }
        *out = bits;
    }
    first..end
}

/// Four edges, lower ends first.
#[derive(Clone, Copy, Default)]
struct Edges {
    x_low: Vec4,
    y_low: Vec4,
    y_high: Vec4,
    slope: Vec4,
}

/// Sets rows to the centres in the rectangle that encloses the corners, [min, max), and tells which rows.
///
/// # Panics
/// If n is above 64.
#[inline]
pub fn rectangle_rows(corners: &[Vec2], n: usize, rows: &mut Rows) -> Range<usize> {
    assert!(n <= MAX_RESOLUTION, "at most 64 rows");
    let start = (Vec2::splat(f32::INFINITY), Vec2::splat(f32::NEG_INFINITY));
    let (min, max) = corners.iter().fold(start, |(lo, hi), &c| (lo.min(c), hi.max(c)));
    let scale = n as f32;
    let ends = Vec4::new(min.x, max.x, min.y, max.y) * scale - 0.5;
    let [left, right, first, end] = first_centres(ends, Vec4::splat(scale));
    let bits = BELOW[right] & !BELOW[left];
    if first >= end {
        return 0..0;
    }
    rows[first..end].fill(bits);
    first..end
}

/// The bits below each of 0 to 64, and more so that 7 bits are an index.
static BELOW: [u64; 128] = {
    let mut below = [u64::MAX; 128];
    let mut k = 0;
    while k < MAX_RESOLUTION {
        below[k] = (1 << k) - 1;
        k += 1;
    }
    below
};

/// Beyond 2^23 neighbouring numbers are 1 apart, so adding it rounds to a whole number and leaves that in the low bits.
/// The functions that round cost a call where the processor need not have SSE4.
const ROUND: f32 = 8_388_608.0;

/// The whole number in [0, scale] that is nearest to each x: so many of the centres lie at its left. 0 for what is not
/// a number.
#[inline(always)]
fn nearest_wholes(x: Vec4, scale: Vec4) -> [usize; 4] {
    low_bits(x.max(Vec4::ZERO).min(scale) + ROUND)
}

/// The first of `scale` whole numbers at or above each x, `scale` if there is none, 0 for what is not a number: the
/// ceiling.
#[inline(always)]
fn first_centres(x: Vec4, scale: Vec4) -> [usize; 4] {
    let x = x.max(Vec4::ZERO).min(scale);
    let shifted = x + ROUND;
    let up = Vec4::select((shifted - ROUND).cmplt(x), Vec4::ONE, Vec4::ZERO);
    low_bits(shifted + up)
}

/// At most 64; the mask only proves that the table is long enough.
#[inline(always)]
fn low_bits(shifted: Vec4) -> [usize; 4] {
    shifted.to_array().map(|x| (x.to_bits() & 0x7f) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::masks::full_row;
    use proptest::prelude::*;

    fn rows(corners: &[Vec2], n: usize) -> Rows {
        let mut rows = [0; MAX_RESOLUTION];
        polygon_rows(corners, n, &mut rows);
        rows
    }

    /// Where the edge crosses the line at `y`; the same bits whichever way the edge runs.
    fn crossing(a: Vec2, b: Vec2, y: f32) -> f32 {
        let (a, b) = if a.y <= b.y { (a, b) } else { (b, a) };
        a.x + (y - a.y) * ((b.x - a.x) / (b.y - a.y))
    }

    /// By three nested loops: winding number of each centre where there are four corners, number of crossings where
    /// there are more.
    fn naive(corners: &[Vec2], n: usize) -> Rows {
        let mut rows = [0; MAX_RESOLUTION];
        for (j, row) in rows.iter_mut().enumerate().take(n) {
            for i in 0..n {
                let (mut winding, mut crossings) = (0, 0);
                for k in 0..corners.len() {
                    // Centres lie at whole y, and half between whole x; of one on an edge rounding decides.
                    let a = corners[k] * n as f32 - Vec2::new(0.0, 0.5);
                    let b = corners[(k + 1) % corners.len()] * n as f32 - Vec2::new(0.0, 0.5);
                    let y = j as f32;
                    if (a.y <= y) != (b.y <= y) && crossing(a, b, y).round_ties_even() <= i as f32 {
                        winding += if b.y > a.y { 1 } else { -1 };
                        crossings += 1;
                    }
                }
                if if corners.len() <= 4 { winding != 0 } else { crossings % 2 == 1 } {
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

    #[test]
    fn first_centre_is_the_ceiling_and_the_nearest_whole_rounds() {
        let first = |x: f32, n: u8| first_centres(Vec4::splat(x), Vec4::splat(f32::from(n)))[3];
        for k in -200..=2000i16 {
            let x = f32::from(k) / 16.0;
            for x in [x.next_down(), x, x.next_up()] {
                for n in [1u8, 7, 32, 64] {
                    assert_eq!(first(x, n) as f32, x.ceil().clamp(0.0, f32::from(n)), "of {x} among {n}");
                }
            }
        }
        let nearest = |x: f32, n: u8| nearest_wholes(Vec4::splat(x), Vec4::splat(f32::from(n)))[3];
        for k in -200..=2000i16 {
            let x = f32::from(k) / 16.0;
            for x in [x.next_down(), x, x.next_up()] {
                assert_eq!(nearest(x, 64) as f32, x.clamp(0.0, 64.0).round_ties_even(), "of {x}");
            }
        }
        assert_eq!(nearest(f32::NAN, 64), 0);
        assert_eq!(first(f32::INFINITY, 64), 64);
        assert_eq!(first(f32::NEG_INFINITY, 64), 0);
        assert_eq!(first(f32::NAN, 64), 0);
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
            rectangle_rows(&corners, n, &mut found);
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
                let edge = [0, 4].contains(&i) || [0, 4].contains(&j);
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
