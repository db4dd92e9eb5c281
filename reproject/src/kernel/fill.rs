//! The masks, layer by layer from front to back.

use std::ops::Range;

use glam::Vec2;
use radcache::{LANES, MAX_RESOLUTION};

use super::board::{Board, Grid, KEPT, LOW, Mask, Places, Special, TURNS, Task, Word, kind};
use super::cut::space;
use super::trails::trail_polygon;
use crate::clip::{MAX_CLIPPED, clip_at_horizon, signed_area};
use crate::raster::{polygon_rows, rectangle_rows};
use crate::{AreaWeights, Coverage, Rows, Trails};

/// Fills the masks with what was drawn, nearest layer first, and counts what each element takes.
#[inline(always)]
pub(super) fn fill<W: Word>(task: &Task<'_>, board: &mut Board<W>) {
    let Board { places, grid } = board;
    let silhouettes = task.settings.trails != Trails::All;
    let by_area = task.settings.weights == AreaWeights::Analytic;
    let (mut small, mut trail) = (0, 0);
    for layer in 0..task.elements.layer_count() {
        let range = task.elements.layer(layer);
        if range.is_empty() {
            grid.history[layer + 1] = grid.history[layer];
            grid.layer_ends[layer] = narrow(range.end);
            continue;
        }
        if silhouettes {
            // Before the layer itself fills anything: what was uncovered is not seen through the surface that uncovered
            // it.
            let trails = trails_before(places, trail, task.elements.outline().layer(layer).end);
            trail = trails.end;
            if !trails.is_empty() {
                sweep(task, places, grid, trails);
                close(grid);
            }
        }
        elements(places, grid, range.start, range.end);
        let mut swept = !silhouettes;
        // Rare, and no matter of order, so they come after the others of their layer.
        while let Some(&e) = places.slow.get(grid.special.len()).filter(|e| usize::from(**e) < range.end) {
            let e = usize::from(e);
            let fills = special(task, places, grid, e);
            swept |= !fills;
            if by_area && fills && places.counts[e] == [0; 2] {
                count_small(places, grid, task.n, layer, e);
            }
        }
        if by_area {
            while let Some(&e) = places.small.get(small).filter(|e| usize::from(**e) < range.end) {
                count_small(places, grid, task.n, layer, usize::from(e));
                small += 1;
            }
        }
        if !silhouettes {
            let trails = trails_before(places, trail, range.end);
            trail = trails.end;
            sweep(task, places, grid, trails);
        }
        end_layer(grid, layer, swept);
        grid.layer_ends[layer] = narrow(range.end);
    }
}

/// The number of an element, of which there are at most 64 x 64, or of texels.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "at most 4096")]
fn narrow(number: usize) -> u16 {
    number as u16
}

/// The elements of a layer that are done in lanes.
#[inline(always)]
fn elements<W: Word>(places: &mut Places, grid: &mut Grid<W>, start: usize, end: usize) {
    let kinds = &places.kind[start..end];
    let firsts = &places.first[start..end];
    let counts = &mut places.counts[start..end];
    for (e, ((kind, first), count)) in (start..end).zip(kinds.iter().zip(firsts).zip(counts)) {
        let (drawn, fill) = (&grid.drawn[e / LANES], &mut grid.layer_fill[e % TURNS]);
        *count = match *kind {
            0 => take::<W, LOW>(drawn, e % LANES, *first, &grid.closed, fill),
            kind::HIGH => take::<W, KEPT>(drawn, e % LANES, *first, &grid.closed, fill),
            _ => continue,
        };
    }
}

/// Counts a texel for element `e` of layer number `layer`, which covers no texel's centre, if its own middle is open,
/// so that it weighs by its area. Else light would be lost where elements shrink on their way: of those smaller than a
/// texel, only the few that meet a centre would weigh, by that area. It closes nothing, for the few that meet a centre
/// close on average what all of them cover.
#[inline(always)]
fn count_small<W: Word>(places: &mut Places, grid: &Grid<W>, n: usize, layer: usize, e: usize) {
    /// What so many layers before have filled closes no middle: it is mostly the same surface, whose elements each
    /// cover a part of the texel. Without this a room of plain walls would lose 1 % of its light (by 16 layers).
    const SAME_SURFACE: usize = 4;
    let middle = places.quad(e).into_iter().sum::<Vec2>() / 4.0;
    #[expect(clippy::cast_possible_truncation, reason = "n <= 64")]
    let [i, j] = middle.to_array().map(|x| hemimap::texel_index(x, n as u32) as usize);
    let closed = grid.history[layer.saturating_sub(SAME_SURFACE)][j] | grid.unknown[j];
    places.counts[e] = if closed & W::bit(i) == W::default() { [1; 2] } else { [0; 2] };
}

/// Fills at most `R` rows from `first` on where they are open; counts the bits, and those that it fills.
#[inline(always)]
fn take<W: Word, const R: usize>(
    drawn: &W::Drawn,
    lane: usize,
    first: u8,
    closed: &Mask<W>,
    fill: &mut Mask<W>,
) -> [u16; 2] {
    let (closed, fill) = (from_row::<W, R>(closed, first), from_row_mut::<W, R>(fill, first));
    let mut counts = [0; 2];
    for (k, words) in drawn.as_ref().iter().take(R / W::ROWS).enumerate() {
        let covered = words[lane];
        let open = covered & !W::load(closed, k);
        W::add(fill, k, open);
        counts[0] += covered.count_ones();
        counts[1] += open.count_ones();
    }
    counts.map(|count| narrow(count as usize))
}

/// The rows of a mask from `first` on.
#[inline(always)]
fn from_row<W, const R: usize>(mask: &Mask<W>, first: u8) -> &[W; R] {
    mask[usize::from(first) % MAX_RESOLUTION..].first_chunk().expect("masks have room for a polygon in the last row")
}

/// As [`from_row`], to write.
#[inline(always)]
fn from_row_mut<W, const R: usize>(mask: &mut Mask<W>, first: u8) -> &mut [W; R] {
    mask[usize::from(first) % MAX_RESOLUTION..]
        .first_chunk_mut()
        .expect("masks have room for a polygon in the last row")
}

/// The listed trails from number `from` on that sides or elements before `end` leave.
#[inline(always)]
fn trails_before(places: &Places, from: usize, end: usize) -> Range<usize> {
    let rest = &places.trails[from..places.trail_count];
    from..from + rest.iter().take_while(|number| usize::from(**number) < end).count()
}

/// Adds the bits of trails to the masks of the layer.
#[inline(always)]
fn sweep<W: Word>(task: &Task<'_>, places: &Places, grid: &mut Grid<W>, trails: Range<usize>) {
    let kinds = &places.trail_kind[trails.clone()];
    let firsts = &places.trail_first[trails.clone()];
    for (t, (kind, first)) in trails.zip(kinds.iter().zip(firsts)) {
        let (drawn, trail) = (&grid.drawn_trails[t / LANES], &mut grid.trail[t % TURNS]);
        match *kind {
            0 => sweep_rows::<W, LOW>(drawn, t % LANES, *first, trail),
            kind::HIGH => sweep_rows::<W, KEPT>(drawn, t % LANES, *first, trail),
            _ => sweep_tall(&trail_polygon(task, places, t), task.n, trail),
        }
    }
}

/// Makes unknown what the silhouettes of a layer swept and nothing nearer fills.
#[inline(always)]
fn close<W: Word>(grid: &mut Grid<W>) {
    for j in 0..W::BITS {
        let swept = joined(&mut grid.trail, j);
        grid.unknown[j] |= swept & !grid.closed[j];
        grid.closed[j] |= swept;
    }
}

/// Row `j` of masks that elements or sides took in turn, which are cleared.
#[inline(always)]
fn joined<W: Word>(masks: &mut [Mask<W>; TURNS], j: usize) -> W {
    let all = masks[0][j] | masks[1][j] | masks[2][j] | masks[3][j];
    for mask in masks {
        mask[j] = W::default();
    }
    all
}

/// At most `R` rows of a trail.
#[inline(always)]
fn sweep_rows<W: Word, const R: usize>(drawn: &W::Drawn, lane: usize, first: u8, trail: &mut Mask<W>) {
    let trail = from_row_mut::<W, R>(trail, first);
    for (k, words) in drawn.as_ref().iter().take(R / W::ROWS).enumerate() {
        W::add(trail, k, words[lane]);
    }
}

#[cold]
fn sweep_tall<W: Word>(polygon: &[Vec2; 4], n: usize, trail: &mut Mask<W>) {
    let mut bits: Rows = [0; MAX_RESOLUTION];
    for j in polygon_rows(polygon, n, &mut bits) {
        trail[j] |= W::narrow(bits[j]);
    }
}

/// Ends a layer: its bits become filled, and what was `swept` behind it and nothing fills becomes unknown.
#[inline(always)]
fn end_layer<W: Word>(grid: &mut Grid<W>, layer: usize, swept: bool) {
    let (before, after) = grid.history.split_at_mut(layer + 1);
    let (before, after) = (&before[layer], &mut after[0]);
    if swept {
        for j in 0..W::BITS {
            after[j] = before[j] | joined(&mut grid.layer_fill, j);
            grid.unknown[j] |= joined(&mut grid.trail, j) & !after[j];
            grid.closed[j] = after[j] | grid.unknown[j];
        }
    } else {
        for j in 0..W::BITS {
            after[j] = before[j] | joined(&mut grid.layer_fill, j);
            grid.closed[j] = after[j] | grid.unknown[j];
        }
    }
}

/// Draws an element that is cut by the horizon, tall, or fills nothing; whether it fills or makes unknown what it
/// covers.
#[cold]
fn special<W: Word>(task: &Task<'_>, places: &mut Places, grid: &mut Grid<W>, e: usize) -> bool {
    let mut bits: Rows = [0; MAX_RESOLUTION];
    let mut special = Special { element: narrow(e), rows: [W::default(); MAX_RESOLUTION] };
    let place = places.quad(e);
    let mut clipped = [Vec2::ZERO; MAX_CLIPPED];
    let is_cut = places.kind[e] & kind::CUT != 0;
    let polygon = if is_cut {
        let corners = clip_at_horizon(&space(task, e), &mut clipped);
        &clipped[..corners]
    } else {
        &place[..]
    };
    let area = signed_area(polygon);
    places.area[e] = area;
    let rows = match task.settings.coverage {
        Coverage::Quad => polygon_rows(polygon, task.n, &mut bits),
        Coverage::Rectangle => rectangle_rows(polygon, task.n, &mut bits),
    };
    let (mut covered, mut taken) = (0, 0);
    // An area that is not a number fills nothing either.
    let fills = area > 0.0 && !task.elements.view_dependent[e];
    for j in rows {
        let bits = W::narrow(bits[j]);
        if fills {
            let open = bits & !grid.closed[j];
            special.rows[j] = bits;
            grid.layer_fill[0][j] |= open;
            covered += bits.ones();
            taken += open.ones();
        } else {
            grid.trail[0][j] |= bits;
        }
    }
    places.counts[e] = [covered, taken].map(|count| narrow(count as usize));
    grid.special.push(special);
    fills
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn fill_trail_unknown_obey_set_algebra(
            layers in prop::collection::vec((any::<[u64; 2]>(), any::<[bool; 2]>(), any::<u64>(), 0..TURNS), 1..6),
        ) {
            let mut grid = Grid::<u64>::default();
            grid.history.resize(layers.len() + 1, [0; MAX_RESOLUTION + KEPT]);
            let (mut filled, mut unknown) = (0u64, 0u64);
            for (layer, ([uncovered, hidden], [retreats, hides], fill, turn)) in layers.into_iter().enumerate() {
                // What silhouettes uncover is closed before the layer fills anything...
                if retreats {
                    grid.trail[TURNS - 1 - turn][3] = uncovered;
                    close(&mut grid);
                    unknown |= uncovered & !filled;
                }
                let open = fill & !grid.closed[3];
                grid.layer_fill[turn][3] = open;
                filled |= fill & !(filled | unknown);
                // ... and what its elements hide is closed after it.
                if hides {
                    grid.trail[turn][3] = hidden;
                    unknown |= hidden & !filled;
                }
                end_layer(&mut grid, layer, hides);
                prop_assert!(grid.layer_fill.iter().chain(&grid.trail).flatten().all(|row| *row == 0), "ready for the next layer");
                let found = (grid.history[layer + 1][3], grid.unknown[3], grid.closed[3]);
                prop_assert_eq!(found, (filled, unknown, filled | unknown));
                prop_assert_eq!(filled & unknown, 0, "disjoint");
            }
        }
    }
}
