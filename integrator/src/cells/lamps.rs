//! More samples of lamps where few cells decide how much light there is.
//!
//! A patch of sun on a floor may be the light of a whole room, and lie in four cells. A cell of which the patch takes a
//! fifth is 25 % off with the 64 points that stand for it, and so is the room. So cells get samples by what is at stake,
//! their light's standard deviation times how often they are met (Neyman 1934), until the error of all light is small
//! enough; in most scenes it is so from the start. What is at stake is told by samples that do not count themselves.

use std::iter::zip;

use glam::{DVec3, Vec2, Vec3};
use hemimap::Frame;
use rayon::prelude::*;
use scene::{LightChoice, Lobes, Ray, Surface};

use super::probe::{FoundCell, SIGHT_HEIGHT, sight, spread};
use super::solve::Row;
use super::{CellBuilder, Cells, white};
use crate::light_lessons::{few, lessons};
use crate::sampler::{Sampler, hash_pair};
use crate::secondary::{LightWays, Shading, direct_light};
use crate::sky::{SkySplit, luminance};
use crate::statistics::{RayCounts, map_counting};

/// The relative variance of all light that is small enough, times the rays for links: 0.8 % of error with 400,000 rays.
const VARIANCE: f64 = 25.0;

/// At most so many cells learn which lights reach them, one for so many rays for links.
const LEARNERS: usize = 2048;
const LINKS_PER_LEARNER: usize = 64;

/// Samples in each cell that tell where others are wanted: one for so many rays for links, between these bounds.
const LINKS_PER_PILOT: f64 = 4.0;
const PILOTS: [f64; 2] = [4.0, 64.0];

/// Steps from one of the points that stand for a cell to one that is sampled, and their length, at most, along each
/// axis, as a share of the width of the cell.
const STEPS: u32 = 2;
const STEP: f32 = 0.5;

/// Samples of the light of lamps in a cell, W m^-2.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct LampSamples {
    count: u32,
    sum: DVec3,
    /// Of the squares of luminances.
    sum_sq: f64,
}

impl LampSamples {
    pub(super) fn add(&mut self, irradiance: Vec3) {
        self.count += 1;
        self.sum += irradiance.as_dvec3();
        self.sum_sq += f64::from(luminance(irradiance)).powi(2);
    }

    pub(super) fn mean(&self) -> Vec3 {
        (self.sum / self.count()).as_vec3()
    }

    fn count(&self) -> f64 {
        f64::from(self.count.max(1))
    }

    /// The standard deviation of the luminance of one sample, times how often the cell is met.
    fn stake(&self, cell: &FoundCell) -> f64 {
        let mean_sq = f64::from(luminance(self.mean())).powi(2);
        (self.sum_sq / self.count() - mean_sq).max(0.0).sqrt() * cell.hits as f64
    }
}

impl CellBuilder<'_> {
    /// How lights are chosen in all cells, by what samples in some of them find; `None` where there is nothing to
    /// choose, or too much.
    pub(super) fn light_choice(
        &self,
        sky: Option<&SkySplit>,
        found: &[FoundCell],
        rays: &mut RayCounts,
    ) -> Option<LightChoice> {
        let lights = sky.map_or(self.scene.lights(), SkySplit::lights);
        if !self.learns_lights || !lights.has_choice() || few(lights).is_none() {
            return None;
        }
        let learners: Vec<&FoundCell> =
            spread(found, LEARNERS.min(self.ray_budget as usize / LINKS_PER_LEARNER)).collect();
        let learnt = map_counting(learners.into_par_iter(), rays, |cell, rays| {
            let mut sampler = Sampler::new(self.seed, hash_pair(cell.key, 3), 0);
            lessons(self.scene, sky, &white(&cell.points[0]), false, &mut sampler, rays).collect::<Vec<_>>()
        });
        lights.learnt_choice(&learnt.concat())
    }

    /// Irradiance by one sample of a lamp, W m^-2.
    pub(super) fn lamp_light(
        &self,
        choice: Option<&LightChoice>,
        white: &Shading,
        sampler: &mut Sampler,
        rays: &mut RayCounts,
    ) -> Vec3 {
        let ways = LightWays { count: 1, choice, sky: self.sky };
        let u = sampler.next_4d_for(self.scene.lights().has_choice());
        // A white surface reflects irradiance / pi.
        direct_light(self.scene, white, Lobes::DIFFUSE, ways, u, rays) * std::f32::consts::PI
    }

    /// Takes more samples of lamps in the cells where it counts, if it does in any.
    pub(super) fn add_lamp_samples(
        &self,
        cells: &Cells,
        found: &[FoundCell],
        choice: Option<&LightChoice>,
        rows: &[Row],
        lamps: &mut [LampSamples],
        rays: &mut RayCounts,
    ) {
        let of_sources = |((cell, row), lamps): ((&FoundCell, &Row), &LampSamples)| {
            cell.hits as f64 * f64::from(luminance(row.direct + row.source + row.caustic + lamps.mean()))
        };
        let light: f64 = zip(zip(found, rows), &*lamps).map(of_sources).sum();
        let budget = f64::from(self.ray_budget);
        let allowed = VARIANCE / budget * light * light;
        let noise: f64 = zip(found, &*lamps).map(|(cell, lamps)| lamps.stake(cell).powi(2) / lamps.count()).sum();
        if !light.is_finite() || !noise.is_finite() || noise <= allowed {
            return;
        }
        let pilots = (budget / (LINKS_PER_PILOT * found.len() as f64)).clamp(PILOTS[0], PILOTS[1]);
        let sample = |(cell, lamps): (&FoundCell, &mut LampSamples), stream: u64, count: f64, rays: &mut RayCounts| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most the budget of rays")]
            for i in 0..count as u32 {
                let mut sampler = Sampler::new(self.seed, hash_pair(cell.key, stream), i);
                let start = cell.points[i as usize % cell.points.len()];
                let point =
                    (0..STEPS).fold(start, |point, _| self.moved(cells, cell, &point, sampler.next_pair(), rays));
                lamps.add(self.lamp_light(choice, &white(&point), &mut sampler, rays));
            }
        };
        // Samples that decide how many others there are do not count themselves: light that they miss by chance, and so
        // would never get more, would be lost.
        let stakes = map_counting(found.par_iter(), rays, |cell, rays| {
            let mut lamps = LampSamples::default();
            sample((cell, &mut lamps), 2, pilots, rays);
            lamps.stake(cell)
        });
        let all: f64 = stakes.iter().sum();
        if all == 0.0 || !all.is_finite() {
            return;
        }
        let share = (all / allowed).min(budget / all);
        map_counting(found.par_iter().zip(lamps).zip(stakes), rays, |(at, stake), rays| {
            sample(at, 4, share * stake, rays);
        });
    }

    /// A point of the same cell near another; the same one if that is out of its sight or of the cell. On a flat cell the
    /// way back is as likely, so that points which lie evenly over it still do (Metropolis et al. 1953).
    fn moved(&self, cells: &Cells, cell: &FoundCell, from: &Surface, u: Vec2, rays: &mut RayCounts) -> Surface {
        let frame = Frame::from_normal(from.ng);
        let step = (2.0 * u - 1.0) * STEP * cell.width;
        let height = SIGHT_HEIGHT * cell.width;
        let lifted = from.p + height * from.ng;
        let over = lifted + step.x * frame.s + step.y * frame.t;
        let Ray { media, .. } = from.spawn(from.ng);
        rays.path += 1;
        if self.scene.occluded(&Ray { media, ..sight(lifted, over) }) {
            return *from;
        }
        rays.path += 1;
        let down = Ray { t_max: 2.0 * height, media, ..Ray::new(over, -from.ng) };
        let Some(hit) = self.scene.intersect(&down) else { return *from };
        let surface = self.scene.surface(&down, &hit);
        let is_in_cell = cells.cell_of(&surface) == cells.table.find(cell.key);
        let has_diffuse = || Shading::new(self.scene, surface, down.direction).bsdf.has_diffuse();
        if is_in_cell && has_diffuse() { surface } else { *from }
    }
}
