//! How many batches of samples each tile takes.

use glam::UVec2;
use rayon::prelude::*;

use super::super::direct::DirectTerm;
use super::{FIRST, SIDE, Tile, means, start};
use crate::allocation::neighbours;
use crate::metrics;
use crate::plan::LobePlan;
use crate::secondary::Secondary;
use crate::statistics::{RayCounts, map_counting};
use crate::surface_points::PixelPoints;

/// What decides how many batches of samples each tile of a picture takes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LobeAllocation {
    /// Batches for each unit of deviation.
    factor: f64,
    pub(super) floor_sq: f64,
}

impl LobeAllocation {
    /// Decides by the first batches on `pixels`, which come in blocks of so many rows of `width` pixels, a whole
    /// picture or parts from all over it: the mean noise, as much as it counts (see [`LobePlan::noise_weight`]), is to
    /// be what the plan wants. `None` where no lobes are shared. The indirect light has about the radiance `ambient`.
    pub(crate) fn new<S: Secondary>(
        direct: &DirectTerm<'_, S>,
        (width, rows): (usize, usize),
        pixels: &[PixelPoints],
        size: UVec2,
        seed: u64,
        ambient: f32,
        rays: &mut RayCounts,
    ) -> Option<Self> {
        if direct.plan.lobes.noise <= 0.0 {
            return None;
        }
        let floor_sq = metrics::floor_sq(means(pixels, ambient));
        let of_block = |block, rays: &mut RayCounts| {
            let tiles = start(direct, width, block, size, seed, ambient, floor_sq);
            tiles.iter().for_each(|tile| *rays += tile.rays);
            deviations(&tiles, width)
        };
        let deviations = map_counting(pixels.par_chunks((width * rows).max(1)), rays, of_block).concat();
        Some(Self::by(&deviations, pixels.len(), floor_sq, &direct.plan.lobes))
    }

    /// Decides by the deviations of all tiles of so many pixels.
    pub(super) fn by(deviations: &[Option<f64>], pixels: usize, floor_sq: f64, lobes: &LobePlan) -> Self {
        let sum: f64 = deviations.iter().flatten().sum();
        Self { factor: sum / (f64::from(lobes.noise) * pixels as f64), floor_sq }
    }

    /// How many batches a tile takes altogether: as many as its noise is large, by the tiles around it, so that no tile
    /// judges itself. One of which nothing is known takes the most.
    pub(super) fn batches(&self, deviation: Option<f64>, lobes: &LobePlan) -> u32 {
        let Some(deviation) = deviation else { return lobes.batches };
        let most = f64::from(lobes.batches / FIRST);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most the plan's number")]
        let doublings = (self.factor * deviation).clamp(1.0, most).log2().round() as u32;
        FIRST << doublings
    }
}

/// The deviations of tiles of rows of `width` pixels, by those around them; 0 where nothing is shared, `None` where
/// nothing is known.
pub(super) fn deviations(tiles: &[Tile<'_>], width: usize) -> Vec<Option<f64>> {
    let deviation = |tile: usize| {
        if tiles[tile].groups.is_empty() {
            return Some(0.0);
        }
        let around = neighbours(tile, width.div_ceil(SIDE), tiles.len());
        let around = around.filter(|&near| !tiles[near].groups.is_empty());
        let (sum, count) = around.fold((0.0, 0.0), |(sum, count), near| (sum + tiles[near].noise, count + 1.0));
        (count > 0.0).then(|| f64::sqrt(sum / count))
    };
    (0..tiles.len()).into_par_iter().map(deviation).collect()
}

#[cfg(test)]
mod tests {
    use super::super::group::Group;
    use super::super::tests::room;
    use super::*;
    use crate::Settings;
    use crate::plan::Plan;

    #[test]
    fn batches_go_where_tiles_around_are_noisy() {
        let tile = |noise: f64| Tile {
            groups: vec![Group { points: Vec::new(), corners: 0, guide: None, count: 2, parallax: 1.0 }],
            lights: Vec::new(),
            hits: Vec::new(),
            noise,
            rays: RayCounts::default(),
            dropped: 0,
        };
        let plan = |noise: f32| {
            let mut plan = Plan::new(&room(0.1, 0.0), &Settings::default()).lobes;
            plan.noise = noise;
            plan
        };
        let mut tiles: Vec<Tile<'_>> = (0..64).map(|_| tile(0.0)).collect();
        tiles[9].noise = 100.0;
        let pixels = 64 * SIDE * SIDE;
        let batches = |tiles: &[Tile<'_>], plan: &LobePlan| {
            let deviations = deviations(tiles, 8 * SIDE);
            let allocation = LobeAllocation::by(&deviations, pixels, 0.0, plan);
            deviations.into_iter().map(|deviation| allocation.batches(deviation, plan)).collect::<Vec<_>>()
        };
        let found = batches(&tiles, &plan(1e-2));
        assert_eq!([found[9], found[63]], [FIRST, FIRST], "neither for its own noise nor far from it");
        assert!(found[0] > FIRST && found[18] > FIRST, "beside it: {} and {}", found[0], found[18]);
        assert!(batches(&tiles, &plan(1e-9)).iter().all(|&batches| batches <= plan(1e-9).batches), "the limit");
        tiles[0].groups.clear();
        assert_eq!(batches(&tiles, &plan(1e-2))[0], FIRST, "nothing to share");
        tiles[1..].iter_mut().for_each(|tile| tile.groups.clear());
        let alone = Tile::new(vec![Group { points: Vec::new(), corners: 0, guide: None, count: 2, parallax: 1.0 }]);
        tiles[0] = alone;
        assert_eq!(batches(&tiles, &plan(1e-2))[0], plan(1e-2).batches, "nothing known");
    }
}
