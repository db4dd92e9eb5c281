//! Where to aim photons: a density over the numbers from which a light makes them, learned from pilot photons.
//!
//! [`Lights::emit_to`](scene::Lights::emit_to) turns five uniform numbers (choice of the light, position, direction)
//! into a photon. Of all of the cube [0, 1)^5 often a small part alone leads to glass, or through a window. The cube is
//! therefore cut in cells, as a k-d tree, wherever the pilots show that the useful ones are not spread evenly.
//!
//! Were the density of a cell the mean of the useful flux f in it, as is often done, then the rare useful photon of a
//! cell that is mostly useless would weigh a hundred times as much as others, and be seen as a blot. The density for
//! the least variance is
//!
//! ```text
//! p = sqrt(mean of f^2)
//! ```
//! which for a share q of useful photons is sqrt(q). A small part of a useful pilot is added to each cell: so a cell
//! that few pilots tried is tried again. A share of all photons goes everywhere alike, so no density is 0 and every
//! estimate stays unbiased.
//!
//! A lamp may have a thousandth of the flux of the sky and all of the caustics. So the lights are parts of the cube
//! from the start (groups of weak ones, where there are many), and the first pilots are dealt half by flux, half evenly
//! to these.
//!
//! The photons of a cell follow each other, as many as their share is but for rounding, and their numbers are a
//! low-discrepancy set of their own: were cells chosen at random, what lands in one place would be as uneven as
//! unrelated numbers are.
//!
//! # Source
//!
//! The idea of splitting the space of random numbers: Thomas Müller, Markus Gross, Jan Novák, *Practical Path Guiding
//! for Efficient Light-Transport Simulation*, 2017; here with an even simpler rule and for emission alone.

use crate::{Rng, Sampler, hash_pair};

/// Numbers that make a photon: the light, position (2) and direction (2).
pub(super) const DIMENSIONS: usize = 5;

/// The share of photons that goes everywhere alike.
const DEFENSIVE_SHARE: f32 = 0.1;
/// Bins by which a cell is tested for an uneven spread.
const BINS: usize = 8;
/// Chi-squared with BINS - 1 = 7 degrees exceeds this once in 1,000: less is noise, and to split it would only add
/// more.
const UNEVEN: f64 = 24.3;
/// A cell is split while it holds the worth of so many pilots of equal score; of half as many in a part where fewer
/// than `FEW` were of use, for a rare way to glass is to be found at all before it is sampled well.
const MIN_PILOTS: f64 = 16.0;
const FEW: usize = 1024;
/// Lights of less than this share of the choice are put together in groups, each of no more than this share of the
/// lights.
const GROUP_SHARE: f64 = 1.0 / 64.0;
/// The part of a useful pilot that is added to each cell.
const PRIOR: f64 = 1.0 / 256.0;
/// Keeps the numbers by which photons are dealt apart from those by which they go on, and the one that all have in
/// common from those.
const JITTER: u64 = 0x006a_6974_7465_7220;
const SHIFT: u64 = u64::MAX;
/// Cells are split at most so often: 2^-40 of the cube is less than any light needs.
const MAX_DEPTH: u32 = 40;

/// A pilot photon.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pilot {
    /// The numbers that made it.
    pub(super) u: [f32; DIMENSIONS],
    /// The useful flux that it carried, over the density of `u`; 0 if it was of no use.
    pub(super) score: f64,
    /// The density of `u`.
    pub(super) density: f32,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Cell {
    min: [f32; DIMENSIONS],
    size: [f32; DIMENSIONS],
    /// Density of the numbers in it; 1 is uniform.
    density: f32,
}

/// A density over the cube of numbers, constant in each of its cells.
#[derive(Debug, Clone)]
pub(super) struct Guide {
    cells: Vec<Cell>,
    /// Running sum of the probabilities of the cells.
    cumulative: Vec<f64>,
}

/// A given number of photons, dealt to the cells of a guide.
pub(super) struct Aim<'a> {
    guide: &'a Guide,
    /// The number of the first photon behind those of each cell.
    ends: Vec<u32>,
    seed: u64,
    jitter_seed: u64,
}

const WHOLE: Cell = Cell { min: [0.0; DIMENSIONS], size: [1.0; DIMENSIONS], density: 1.0 };

/// The parts of the cube that make photons of one light, or of a group of weak ones, from the ends of the lights'
/// shares of the choice.
pub(super) fn parts(choice_ends: &[f64]) -> Vec<Cell> {
    let most = (choice_ends.len() as f64 * GROUP_SHARE).ceil();
    let (mut parts, mut in_group, mut start) = (Vec::new(), 0.0, 0.0);
    let mut close = |end: f64| {
        let (min, size) = (single(start), single(end) - single(start));
        // Shares that f32 cannot tell from nothing are left to the next part.
        if size > 0.0 {
            let mut part = WHOLE;
            (part.min[0], part.size[0], start) = (min, size, end);
            parts.push(part);
        }
    };
    let mut before = 0.0;
    for &end in choice_ends {
        let is_strong = end - before >= GROUP_SHARE;
        if is_strong {
            close(before);
        }
        in_group = if is_strong { most } else { in_group + 1.0 };
        if in_group >= most {
            close(end);
            in_group = 0.0;
        }
        before = end;
    }
    close(1.0);
    parts
}

impl Guide {
    /// Returns the density with which a half is dealt evenly to the parts, the other half everywhere alike.
    pub(super) fn even(parts: &[Cell]) -> Self {
        let share = 0.5 / parts.len() as f32;
        Self::new(parts.iter().map(|part| Cell { density: 0.5 + share / part.size[0], ..*part }).collect())
    }

    /// Learns a density from pilots, the useless ones included; it is that of [`Guide::even`] where none was of use.
    pub(super) fn learn(parts: &[Cell], pilots: &mut [Pilot]) -> Self {
        let useful_volume: f64 = useful(pilots).map(|pilot| 1.0 / f64::from(pilot.density)).sum();
        let mean_sq = useful(pilots).map(Pilot::square).sum::<f64>() / useful_volume;
        if !(mean_sq > 0.0 && mean_sq.is_finite()) {
            return Self::even(parts);
        }
        let count = pilots.len() as f64;
        pilots.sort_by(|a, b| a.u[0].total_cmp(&b.u[0]));
        let (mut cells, mut rest) = (Vec::new(), pilots);
        for part in parts {
            let end = part.min[0] + part.size[0];
            let (within, behind) = rest.split_at_mut(rest.partition_point(|pilot| pilot.u[0] < end));
            let min_pilots = if useful(within).count() < FEW { 0.5 * MIN_PILOTS } else { MIN_PILOTS };
            divide(within, *part, &Learning { count, mean_sq, min_pilots }, 0, &mut cells);
            rest = behind;
        }
        let total: f64 = cells.iter().map(|cell| f64::from(cell.density) * volume(cell)).sum();
        for cell in &mut cells {
            cell.density = DEFENSIVE_SHARE + (1.0 - DEFENSIVE_SHARE) * single(f64::from(cell.density) / total);
        }
        Self::new(cells)
    }

    fn new(cells: Vec<Cell>) -> Self {
        let mut sum = 0.0;
        let add = |cell: &Cell| {
            sum += f64::from(cell.density) * volume(cell);
            sum
        };
        let cumulative = cells.iter().map(add).collect();
        Self { cells, cumulative }
    }

    /// Deals `count` photons to the cells; another seed gives other numbers.
    pub(super) fn aim(&self, count: u32, seed: u64) -> Aim<'_> {
        // All are moved by the same part of one, so that each cell has in expectation what it should have.
        let jitter_seed = hash_pair(seed, JITTER);
        let shift = f64::from(Rng::new(jitter_seed, SHIFT).next_1d());
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to count")]
        let mut ends: Vec<u32> =
            self.cumulative.iter().map(|sum| (sum * f64::from(count) + shift).min(f64::from(count)) as u32).collect();
        // The sum may be 1 but for rounding.
        if let Some(end) = ends.last_mut() {
            *end = count;
        }
        Aim { guide: self, ends, seed, jitter_seed }
    }
}

/// Returns the pilots that were of use.
pub(super) fn useful(pilots: &[Pilot]) -> impl Iterator<Item = &Pilot> {
    pilots.iter().filter(|pilot| pilot.score > 0.0)
}

/// Splits a cell until its pilots are spread evenly or are too few to tell. The density is not yet scaled.
fn divide(pilots: &mut [Pilot], cell: Cell, learning: &Learning, depth: u32, cells: &mut Vec<Cell>) {
    if depth < MAX_DEPTH
        && let Some(axis) = most_uneven(pilots, &cell, learning.min_pilots)
    {
        let half = 0.5 * cell.size[axis];
        let middle = cell.min[axis] + half;
        pilots.sort_by_key(|pilot| pilot.u[axis] >= middle);
        let (low, high) = pilots.split_at_mut(pilots.partition_point(|pilot| pilot.u[axis] < middle));
        let mut child = cell;
        child.size[axis] = half;
        divide(low, child, learning, depth + 1, cells);
        child.min[axis] = middle;
        divide(high, child, learning, depth + 1, cells);
    } else {
        let of_cell = 1.0 / (volume(&cell) * learning.count);
        let found = pilots.iter().map(Pilot::square).sum::<f64>() * of_cell;
        // It stands for as much as the others of this cell do.
        let prior = PRIOR * learning.mean_sq / (pilots.len() as f64 + PRIOR);
        cells.push(Cell { density: single((found + prior).sqrt()), ..cell });
    }
}

impl Aim<'_> {
    /// Returns the five numbers of photon number `index`, and their density.
    pub(super) fn numbers(&self, index: u32) -> ([f32; DIMENSIONS], f32) {
        let number = self.ends.partition_point(|&end| end <= index);
        let (start, end) = (number.checked_sub(1).map_or(0, |before| self.ends[before]), self.ends[number]);
        let place = index - start;
        // The first two are stratified best, which counts most for directions: lamps are mostly small.
        let [z, w, x, y] = Sampler::new(self.seed, number as u64, place).next_4d();
        // In order: with the other four, five dimensions are stratified together (Hammersley's set).
        let jitter = f64::from(Rng::new(self.jitter_seed, u64::from(index)).next_1d());
        let choice = single((f64::from(place) + jitter) / f64::from(end - start));
        let cell = &self.guide.cells[number];
        let within = [choice, x, y, z, w];
        // Rounding must not reach 1, nor leave the cell.
        let at = |d: usize| (cell.min[d] + within[d] * cell.size[d]).min((cell.min[d] + cell.size[d]).next_down());
        (std::array::from_fn(at), cell.density)
    }
}

/// What the cells of a part have in common while the guide learns.
struct Learning {
    /// Number of pilots.
    count: f64,
    /// Mean of f^2 over the useful pilots.
    mean_sq: f64,
    /// The worth of pilots that a cell needs to be split.
    min_pilots: f64,
}

impl Pilot {
    /// Returns f^2 over the density.
    fn square(&self) -> f64 {
        self.score * self.score * f64::from(self.density)
    }
}

/// Returns the axis along which the scores are spread most unevenly; `None` where all might be noise.
fn most_uneven(pilots: &[Pilot], cell: &Cell, min_pilots: f64) -> Option<usize> {
    let sum: f64 = pilots.iter().map(|pilot| pilot.score).sum();
    let sum_sq: f64 = pilots.iter().map(|pilot| pilot.score * pilot.score).sum();
    if sum_sq == 0.0 || sum * sum < min_pilots * sum_sq {
        return None;
    }
    let even = sum / BINS as f64;
    let chi_squared = |axis: usize| {
        let mut bins = [0.0; BINS];
        for pilot in pilots {
            let place = (pilot.u[axis] - cell.min[axis]) / cell.size[axis] * BINS as f32;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place in [0, BINS)")]
            let bin = (place as usize).min(BINS - 1);
            bins[bin] += pilot.score;
        }
        bins.iter().map(|bin| (bin - even).powi(2)).sum::<f64>() * BINS as f64 / sum_sq
    };
    // Cells whose numbers f32 can no longer tell apart stay whole.
    let divisible = |axis: &usize| cell.min[*axis] + 0.5 * cell.size[*axis] / BINS as f32 > cell.min[*axis];
    let (axis, most) =
        (0..DIMENSIONS).filter(divisible).map(|axis| (axis, chi_squared(axis))).max_by(|a, b| a.1.total_cmp(&b.1))?;
    (most > UNEVEN).then_some(axis)
}

fn volume(cell: &Cell) -> f64 {
    cell.size.iter().map(|&size| f64::from(size)).product()
}

#[expect(clippy::cast_possible_truncation, reason = "densities are f32")]
const fn single(x: f64) -> f32 {
    x as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pilots(guide: &Guide, count: u32, useful: impl Fn(&[f32; DIMENSIONS]) -> bool) -> Vec<Pilot> {
        let aim = guide.aim(count, 1);
        let pilot = |index| {
            let (u, density) = aim.numbers(index);
            Pilot { u, density, score: f64::from(u8::from(useful(&u))) / f64::from(density) }
        };
        (0..count).map(pilot).collect()
    }

    /// Learns in three rounds, as photons are aimed.
    fn learned(count: u32, useful: impl Fn(&[f32; DIMENSIONS]) -> bool) -> Guide {
        (0..3).fold(Guide::even(&[WHOLE]), |guide, _| Guide::learn(&[WHOLE], &mut pilots(&guide, count, &useful)))
    }

    /// Returns the share of useful samples, and the mean of 1 / density over all and over the useful ones.
    fn statistics(guide: &Guide, useful: impl Fn(&[f32; DIMENSIONS]) -> bool) -> (f64, f64, f64) {
        let aim = guide.aim(200_000, 2);
        let (mut share, mut volume, mut useful_volume) = (0.0, 0.0, 0.0);
        for index in 0..200_000 {
            let (u, density) = aim.numbers(index);
            assert!(u.iter().all(|x| (0.0..1.0).contains(x)), "in the cube: {u:?}");
            let hit = f64::from(u8::from(useful(&u)));
            share += hit / 2e5;
            volume += 1.0 / f64::from(density) / 2e5;
            useful_volume += hit / f64::from(density) / 2e5;
        }
        (share, volume, useful_volume)
    }

    #[test]
    fn photons_of_a_cell_are_stratified_and_as_many_as_it_should_have() {
        let guide = learned(50_000, |u| u[3] < 0.25 && u[4] > 0.5);
        let aim = guide.aim(100_000, 3);
        let mut start = 0;
        for (cell, &end) in guide.cells.iter().zip(&aim.ends) {
            let share = f64::from(cell.density) * volume(cell) * 1e5;
            assert!((f64::from(end - start) - share).abs() < 1.01, "{} photons of {share}", end - start);
            // Of 256 directions from a multiple of 256 on each of 16 x 16 places has one.
            for first in (start..end).step_by(256).filter(|first| end - first >= 256) {
                let mut places = [[0; 16]; 16];
                for index in first..first + 256 {
                    let (u, density) = aim.numbers(index);
                    assert_eq!(density, cell.density);
                    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place in [0, 16)")]
                    let place = |d: usize| ((u[d] - cell.min[d]) / cell.size[d] * 16.0) as usize;
                    places[place(3).min(15)][place(4).min(15)] += 1;
                }
                assert_eq!(places, [[1; 16]; 16], "from {first} on");
            }
            start = end;
        }
        assert_eq!(start, 100_000, "all are dealt");
    }

    #[test]
    fn even_pilots_leave_it_uniform() {
        let guide = Guide::learn(&[WHOLE], &mut pilots(&Guide::even(&[WHOLE]), 50_000, |_| true));
        assert_eq!(guide.cells.len(), 1, "no spread to learn");
        assert_eq!(
            Guide::learn(&[WHOLE], &mut pilots(&Guide::even(&[WHOLE]), 50_000, |_| false)).cells.len(),
            1,
            "nothing useful at all"
        );
    }

    #[test]
    fn a_ball_in_the_middle_is_found_and_its_volume_kept() {
        // Symmetric about every halving plane, which a test of halves alone would not see.
        let useful = |u: &[f32; DIMENSIONS]| (u[3] - 0.5).powi(2) + (u[4] - 0.5).powi(2) < 0.0025;
        let guide = learned(50_000, useful);
        let (share, volume, useful_volume) = statistics(&guide, useful);
        // pi 0.05^2 = 0.00785 of the cube; 4.5 deviations of 200,000 samples are 0.5 % of it at the density found.
        assert!(share > 0.4, "share {share}");
        assert!((volume - 1.0).abs() < 0.05, "the densities integrate to one: {volume}");
        assert!((useful_volume / 0.007_854 - 1.0).abs() < 0.02, "unbiased: {useful_volume}");
    }

    #[test]
    fn one_light_of_a_thousand_is_found() {
        let useful = |u: &[f32; DIMENSIONS]| (0.513..0.514).contains(&u[0]) && u[3] > 0.7;
        let guide = learned(300_000, useful);
        let (share, _, useful_volume) = statistics(&guide, useful);
        assert!(share > 0.15, "share {share}");
        assert!((useful_volume / 0.000_3 - 1.0).abs() < 0.03, "unbiased: {useful_volume}");
    }

    #[test]
    fn strong_lights_are_parts_and_weak_ones_are_grouped() {
        let ends = |parts: &[Cell]| -> Vec<f32> { parts.iter().map(|part| part.min[0] + part.size[0]).collect() };
        assert_eq!(ends(&parts(&[1.0])), [1.0], "one");
        assert_eq!(ends(&parts(&[0.001, 0.001, 1.0])), [0.001, 1.0], "a weak one, one without flux and a strong one");
        assert_eq!(ends(&parts(&[0.999, 1.0])), [0.999, 1.0], "few weak ones are by themselves");
        let equal: Vec<f64> = (1..=6400).map(|i| f64::from(i) / 12_800.0).chain([1.0]).collect();
        let found = parts(&equal);
        assert!((64..=66).contains(&found.len()), "{} parts", found.len());
        assert_eq!((found.last().unwrap().min[0], found.last().unwrap().size[0]), (0.5, 0.5), "the strong one");
        let whole: f32 = found.iter().map(|part| part.size[0]).sum();
        assert!((whole - 1.0).abs() < 1e-5, "they fill the cube: {whole}");
    }

    #[test]
    fn a_weak_lamp_under_a_strong_sky_is_found() {
        // The lamp has 0.4 % of the flux and sends 1 % of that to the glass, the sky 3 of 100,000.
        let useful = |u: &[f32; DIMENSIONS]| {
            if u[0] < 0.004 {
                u[3] < 0.1 && u[4] < 0.1
            } else {
                (u[1] - 0.5).abs() < 0.003 && (u[2] - 0.5).abs() < 0.0025
            }
        };
        let parts = parts(&[0.004, 1.0]);
        let guide =
            (0..3).fold(Guide::even(&parts), |guide, _| Guide::learn(&parts, &mut pilots(&guide, 1 << 19, useful)));
        let (share, _, useful_volume) = statistics(&guide, useful);
        assert!(share > 0.01, "share {share}");
        assert!((useful_volume / 7e-5 - 1.0).abs() < 0.05, "unbiased: {useful_volume}");
    }
}
