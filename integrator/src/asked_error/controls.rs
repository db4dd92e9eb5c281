//! Paths that verify some pixels of a picture: they share nothing with the cache, and so tell its bias.

use glam::{DVec3, UVec2};
use rayon::prelude::*;
use scene::Scene;

use super::passes::Measure;
use crate::sampler::{Sampler, hash_pair};
use crate::{PathTracer, RayCounts, Settings};

/// Pixels along a side of the grid of those that paths verify.
const CONTROL_SIDE: u32 = 16;
/// Paths of one group, which are stratified; the spread of the groups tells the error of their mean.
pub(super) const GROUP: u32 = 16;
/// Groups of a round, at least; more for the rays that the passes took: one ray of paths for so many of passes, at about so many rays a path.
const MIN_GROUPS: u64 = 4;
const CONTROL_SHARE: u64 = 8;
const RAYS_OF_PATH: u64 = 10;

/// Pixels at which paths verify the picture.
pub(super) struct Controls {
    seed: u64,
    groups: u64,
    pixels: Vec<Control>,
}

/// One of them: its place, and sums over the groups of paths.
#[derive(Clone, Copy)]
struct Control {
    position: UVec2,
    sum: f64,
    sum_sq: f64,
}

impl Controls {
    pub(super) fn new(settings: &Settings) -> Self {
        let seed = hash_pair(settings.seed, CONTROL_STREAM);
        let cells = (0..CONTROL_SIDE * CONTROL_SIDE).map(|cell| UVec2::new(cell % CONTROL_SIDE, cell / CONTROL_SIDE));
        let pixels = cells.map(|cell| {
            let mut sampler = Sampler::new(seed, u64::from(cell.x), cell.y);
            let place = (cell.as_vec2() + sampler.next_pair()) / CONTROL_SIDE as f32 * settings.size.as_vec2();
            Control { position: place.as_uvec2().min(settings.size - 1), sum: 0.0, sum_sq: 0.0 }
        });
        Self { seed, groups: 0, pixels: pixels.collect() }
    }

    /// Traces more paths, as many as the rays so far allow.
    pub(super) fn trace(&mut self, scene: &Scene, size: UVec2, rays: &mut RayCounts) {
        let allowed = rays.total() / (CONTROL_SHARE * RAYS_OF_PATH * self.pixels.len() as u64 * u64::from(GROUP));
        let groups = self.groups..allowed.max(self.groups + MIN_GROUPS);
        let (seed, first) = (self.seed, groups.start);
        self.groups = groups.end;
        let counts: Vec<RayCounts> = self
            .pixels
            .par_iter_mut()
            .enumerate()
            .map(|(number, control)| {
                let mut tracer = PathTracer::new(scene);
                for group in first..groups.end {
                    let key = hash_pair(group, number as u64);
                    let mean = group_mean(&mut tracer, scene, size, control.position, seed, key).element_sum() / 3.0;
                    control.sum += mean;
                    control.sum_sq += mean * mean;
                }
                tracer.rays
            })
            .collect();
        for count in counts {
            *rays += count;
        }
    }

    /// The mean square of the picture's relative bias: what the difference from the paths has beyond the noise of both; and the standard error of that.
    /// Pixels where that noise is large beside the error asked for count little.
    pub(super) fn bias_sq(&self, measure: &Measure, asked: f32) -> [f32; 2] {
        /// Variance that is about that of rounding: a picture of nothing but sky has none, and yet its pixels have a weight.
        const LEAST_NOISE: f64 = 1e-12;
        let groups = self.groups as f64;
        let (mut sum, mut total, mut variance) = (0.0, 0.0, 0.0);
        for control in &self.pixels {
            let pixel = (control.position.y * measure.size.x + control.position.x) as usize;
            let scale_sq = f64::from(measure.scale[pixel]).powi(2);
            let mean = control.sum / groups;
            let of_paths = (control.sum_sq / groups - mean * mean).max(0.0) / (groups - 1.0) / scale_sq;
            let noise = of_paths + f64::from(measure.around(pixel));
            let difference_sq = (mean - f64::from(measure.mean[pixel])).powi(2) / scale_sq;
            let weight = (noise + f64::from(0.25 * asked * asked)).max(LEAST_NOISE).powi(-2);
            sum += weight * (difference_sq - noise);
            total += weight;
            // As if the noise were normal.
            variance += 2.0 * (weight * noise).powi(2);
        }
        #[expect(clippy::cast_possible_truncation, reason = "an estimate")]
        [(sum / total).max(0.0), variance.sqrt() / total].map(|square| square as f32)
    }
}

/// Keeps the random numbers of controls apart from those of pictures.
const CONTROL_STREAM: u64 = 0x0063_6f6e_7472_6f6c;

/// The mean light of a pixel by one group of paths, which has this key.
pub(super) fn group_mean(
    tracer: &mut PathTracer<'_>,
    scene: &Scene,
    size: UVec2,
    pixel: UVec2,
    seed: u64,
    key: u64,
) -> DVec3 {
    let paths = (0..GROUP).map(|path| {
        let mut sampler = Sampler::new(seed, key, path);
        let film = pixel.as_vec2() + sampler.next_pair();
        tracer.trace(&scene.camera_ray(film, size), &mut sampler).terms.sum().as_dvec3()
    });
    paths.sum::<DVec3>() / f64::from(GROUP)
}
