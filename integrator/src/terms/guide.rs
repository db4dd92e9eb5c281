//! Where the light comes from that glossy surfaces reflect, learnt before the picture is made.
//!
//! A lamp that is seen by way of two glossy surfaces fills a small part of the first one's lobe, wherever the lobe
//! alone says little of it: few samples find it, and those are bright. So some primary rays are traced beforehand, lobe
//! samples with them, and the picture's tiles remember from where light came: for each side of the normal a density
//! that is constant in the cells of the square of the area-preserving map,
//!
//! ```text
//! q = sqrt(mean over the cell of (f L cos / (cos / pi))^2),   normalised
//! ```
//! which has the least variance of all such densities. Half of the lobe's samples then follow q, weighted by the
//! balance heuristic (Veach 1997) between both, so that q may be wrong without a bias.
//!
//! # Source
//! Vorba et al. 2014, "On-line learning of parametric mixture models for light transport simulation", for guides learnt
//! beforehand; Rath et al. 2020, "Variance-aware path guiding", for the root of the second moment.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::{USizeVec2, UVec2, Vec2, Vec3A};
use rayon::prelude::*;

use super::direct::DirectTerm;
use super::tiles::{self, NEAR, around, inside, tile};
use crate::sampler::{Sampler, hash_pair, in_cell};
use crate::secondary::{Secondary, Shading};
use crate::statistics::{RayCounts, map_counting};

/// Cells along a side of the square of directions.
const BINS: usize = 8;
/// Lobe samples of a primary ray that learns.
const LOBE_SAMPLES: u32 = 16;
/// Keeps these random numbers apart from those of the picture.
const STREAM: u64 = 0x0067_7569_6465;

/// The guides of all tiles.
#[derive(Debug)]
pub(crate) struct LobeGuide {
    size: UVec2,
    tiles: Vec<Option<Guide>>,
}

/// Where a learner's sample went, and what it found.
struct Lesson {
    tile: usize,
    bin: usize,
    /// Square of what it counts, times its density over the square.
    moment: f32,
}

impl LobeGuide {
    /// Learns from primary rays of a picture of `size` pixels; `None` where no lobe is seen that asks for it.
    pub(crate) fn learn<S: Secondary>(
        direct: &DirectTerm<'_, S>,
        size: UVec2,
        seed: u64,
        rays: &mut RayCounts,
    ) -> Option<Self> {
        let learners = (0..direct.plan.lobes.learners.pow(2)).into_par_iter();
        let seed = hash_pair(seed, STREAM);
        let found = map_counting(learners, rays, |number, rays| learner(direct, size, seed, number, rays));
        let lessons: Vec<Lesson> = found.into_iter().flatten().collect();
        let mut cells = vec![[0.0f32; BINS * BINS]; tiles::COUNT];
        for lesson in &lessons {
            cells[lesson.tile][lesson.bin] += lesson.moment;
        }
        let tiles: Vec<Option<Guide>> =
            (0..cells.len()).into_par_iter().map(|tile| Guide::new(&blurred(&cells, tile))).collect();
        tiles.iter().any(Option::is_some).then_some(Self { size, tiles })
    }

    /// The guide for a surface of normal `n` in the pixel at `position`.
    pub(crate) fn at(&self, position: UVec2, n: Vec3A) -> Option<&Guide> {
        self.tiles[tile(position.as_vec2() + 0.5, self.size, n)].as_ref()
    }
}

/// Follows the lobe samples of one primary ray.
fn learner<S: Secondary>(
    direct: &DirectTerm<'_, S>,
    size: UVec2,
    seed: u64,
    number: u32,
    rays: &mut RayCounts,
) -> Vec<Lesson> {
    let mut lessons = Vec::new();
    let mut sampler = Sampler::new(seed, u64::from(number), 0);
    let film = in_cell(number, direct.plan.lobes.learners, sampler.next_pair()) * size.as_vec2();
    let ray = direct.scene.camera_ray(film, size);
    rays.camera += 1;
    let Some(hit) = direct.scene.intersect(&ray) else { return lessons };
    let shading = Shading::new(direct.scene, direct.scene.surface(&ray, &hit), ray.direction);
    let lobes = &direct.plan.lobes;
    if !lobes.guides(&shading, lobes.rays(&shading, 1.0)) {
        return lessons;
    }
    let tile = tile(film, size, shading.surface.n);
    for mut sampler in sampler.split_into(LOBE_SAMPLES) {
        let Some(way) = direct.lobe_way(&shading, &mut sampler) else { continue };
        let light = direct.along_lobe(&shading, film.as_uvec2(), &way, &mut sampler, rays);
        let value = (light.direct + light.specular).max_element();
        let moment = value * value * (way.pdf * PI / way.wi.z);
        if moment > 0.0 && moment.is_finite() {
            lessons.push(Lesson { tile, bin: bin(way.wi), moment });
        }
    }
    lessons
}

/// The cell of a local direction.
fn bin(wi: Vec3A) -> usize {
    let place = (hemimap::cosine_hemisphere_to_square(wi) * BINS as f32).as_usizevec2();
    let place = place.min(USizeVec2::splat(BINS - 1));
    place.y * BINS + place.x
}

/// What the tiles around one have learnt on the same side, farther ones and neighbouring cells counting less: for
/// lessons are few.
fn blurred(cells: &[[f32; BINS * BINS]], tile: usize) -> [f32; BINS * BINS] {
    let mut sum = [0.0; BINS * BINS];
    for (near, weight) in around(tile) {
        (0..BINS * BINS).for_each(|bin| sum[bin] += weight * cells[near][bin]);
    }
    let mut blurred = [0.0; BINS * BINS];
    for (bin, value) in blurred.iter_mut().enumerate() {
        for (dy, wy) in NEAR {
            for (dx, wx) in NEAR {
                if let (Some(x), Some(y)) = (inside(bin % BINS, dx, BINS), inside(bin / BINS, dy, BINS)) {
                    *value += wx * wy * sum[y * BINS + x];
                }
            }
        }
    }
    blurred
}

/// A density over the directions of a hemisphere that is constant in the cells of its square.
#[derive(Debug)]
pub(crate) struct Guide {
    /// Sums of the probabilities of the rows up to each, and of its cells within each row.
    rows: [f32; BINS],
    cells: [[f32; BINS]; BINS],
    /// Density in each cell over the projected hemisphere, whose area is pi.
    density: [f32; BINS * BINS],
}

impl Guide {
    /// Makes the density from the second moments of cells; `None` where there are none.
    fn new(moments: &[f32; BINS * BINS]) -> Option<Self> {
        let weights = moments.map(f32::sqrt);
        let total: f32 = weights.iter().sum();
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let mut guide = Self {
            rows: [0.0; BINS],
            cells: [[0.0; BINS]; BINS],
            density: weights.map(|weight| weight / total * ((BINS * BINS) as f32 * FRAC_1_PI)),
        };
        let mut below = 0.0;
        for (row, weights) in weights.chunks_exact(BINS).enumerate() {
            let of_row: f32 = weights.iter().sum();
            below += of_row;
            guide.rows[row] = below / total;
            let mut left = 0.0;
            for (cell, weight) in guide.cells[row].iter_mut().zip(weights) {
                left += weight;
                *cell = left / of_row.max(f32::MIN_POSITIVE);
            }
        }
        Some(guide)
    }

    /// Returns the direction, local frame, that belongs to a point of the unit square.
    pub(crate) fn sample(&self, u: Vec2) -> Vec3A {
        let (row, y) = choose(&self.rows, u.y);
        let (column, x) = choose(&self.cells[row], u.x);
        let place = Vec2::new(column as f32 + x, row as f32 + y);
        hemimap::square_to_cosine_hemisphere(place / BINS as f32)
    }

    /// Returns the density of `sample` at a local direction, per steradian.
    pub(crate) fn pdf(&self, wi: Vec3A) -> f32 {
        self.density[bin(wi)] * wi.z.max(0.0)
    }
}

/// Chooses an interval by sums of probabilities, and returns where in it `u` lies, from 0 to 1.
fn choose(sums: &[f32; BINS], u: f32) -> (usize, f32) {
    let last = BINS - 1;
    let chosen = sums.iter().position(|&sum| u < sum).unwrap_or(last);
    let below = if chosen == 0 { 0.0 } else { sums[chosen - 1] };
    let share = sums[chosen] - below;
    (chosen, if share > 0.0 { ((u - below) / share).clamp(0.0, 1.0) } else { 0.5 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rng;
    use tiles::SIDES;

    fn guide(seed: u64) -> Guide {
        let mut rng = Rng::new(seed, 0);
        let mut moments = [0.0; BINS * BINS];
        for moment in &mut moments {
            let u = rng.next_1d();
            // Some cells have seen nothing, some a lamp.
            *moment = if u < 0.5 { 0.0 } else { (20.0 * (u - 0.5)).exp() };
        }
        Guide::new(&moments).unwrap()
    }

    #[test]
    fn samples_follow_the_density() {
        let guide = guide(1);
        let over_square = guide.density.map(|density| density * PI);
        let mean = over_square.iter().sum::<f32>() / (BINS * BINS) as f32;
        assert!((mean - 1.0).abs() < 1e-5, "a density, {mean}");
        let mut counts = [0u32; BINS * BINS];
        let side = 512;
        for number in 0..side * side {
            let u = (Vec2::new((number % side) as f32, (number / side) as f32) + 0.5) / side as f32;
            let wi = guide.sample(u);
            counts[bin(wi)] += 1;
            let pdf = over_square[bin(wi)] * wi.z / PI;
            assert!(pdf > 0.0 && (guide.pdf(wi) / pdf - 1.0).abs() < 1e-5, "nowhere that it cannot know of: {wi}");
        }
        for (count, density) in counts.iter().zip(over_square) {
            let share = *count as f32 / (side * side) as f32 * (BINS * BINS) as f32;
            // Points on the borders of cells may be counted in the next one.
            assert!((share - density).abs() < 0.02 * density + 0.02, "{share} instead of {density}");
        }
    }

    #[test]
    fn half_by_the_guide_is_without_bias() {
        // The integral of cos^3 over the hemisphere, pi / 2, by samples of the density cos / pi and of the guide.
        let guide = guide(2);
        let mut rng = Rng::new(3, 0);
        let count = 200_000;
        let mut sum = 0.0;
        for number in 0..count {
            let u = rng.next_2d();
            let wi = if number % 2 == 0 { hemimap::square_to_cosine_hemisphere(u) } else { guide.sample(u) };
            sum += f64::from(wi.z.powi(3) / (0.5 * (wi.z / PI + guide.pdf(wi))));
        }
        let mean = sum / f64::from(count) * 2.0 / std::f64::consts::PI;
        // The deviation of one sample is about 1.
        assert!((mean - 1.0).abs() < 0.01, "{mean} of the integral");
    }

    #[test]
    fn nothing_seen_is_no_guide() {
        assert!(Guide::new(&[0.0; BINS * BINS]).is_none(), "no light");
        assert!(Guide::new(&[f32::INFINITY; BINS * BINS]).is_none(), "no number");
        let mut cells = vec![[0.0; BINS * BINS]; tiles::COUNT];
        cells[7][9] = 4.0;
        let near = blurred(&cells, 7 + SIDES);
        assert_eq!(
            [near[9], near[8], near[10 + BINS], near[11]],
            [2.0, 1.0, 0.5, 0.0],
            "the next tile, and cells around"
        );
        assert_eq!(blurred(&cells, 8), [0.0; BINS * BINS], "another side of the normal");
    }
}
