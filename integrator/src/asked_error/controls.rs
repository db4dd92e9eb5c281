//! Paths that verify some pixels of a picture: they share nothing with the cache, and so tell its bias.

use glam::{DVec3, UVec2};
use rayon::prelude::*;
use scene::{LightChoice, Scene};

use super::bias::{Bias, Term};
use super::passes::Measure;
use crate::path::learn_lights;
use crate::sampler::{Sampler, hash_pair};
use crate::{PathTracer, RayCounts, Settings, Statistics};

/// Pixels along a side of the grid of those that paths verify.
const CONTROL_SIDE: u32 = 16;
/// Paths of one group, which are stratified; the spread of the groups tells the error of their mean.
pub(super) const GROUP: u32 = 16;
/// Groups at first: of fewer, hardly anything is known of their own noise.
const MIN_GROUPS: u64 = 16;
/// Then they double as long as they are needed, up to this share of the rays of the passes.
pub(super) const CONTROL_SHARE: f64 = 0.25;
/// The same where all hangs on what they find.
pub(super) const OPEN_SHARE: f64 = 0.5;

/// Pixels at which paths verify the picture.
pub(super) struct Controls {
    settings: Settings,
    seed: u64,
    groups: u64,
    rays: RayCounts,
    pixels: Vec<Control>,
    /// How paths choose lights, where that was learnt.
    light_choice: Option<LightChoice>,
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
        Self {
            settings: settings.clone(),
            seed,
            groups: 0,
            rays: RayCounts::default(),
            pixels: pixels.collect(),
            light_choice: None,
        }
    }

    /// Measures the bias of the picture: traces more paths as long as they take at most the share of the rays of the
    /// passes that it is `worth` to know it better.
    pub(super) fn verify(
        &mut self,
        scene: &Scene,
        measure: &Measure,
        statistics: &mut Statistics,
        worth: impl Fn(&Bias) -> f64,
    ) -> Bias {
        loop {
            if self.groups > 0 {
                let bias = self.bias(measure);
                let of_passes = statistics.rays.total() - self.rays.total();
                if 2.0 * self.rays.total() as f64 > worth(&bias) * of_passes as f64 {
                    return bias;
                }
            }
            self.trace(scene, measure.size, self.groups.max(MIN_GROUPS), statistics);
        }
    }

    /// Traces so many more groups of paths for each pixel.
    fn trace(&mut self, scene: &Scene, size: UVec2, groups: u64, statistics: &mut Statistics) {
        if self.groups == 0 {
            let mut rays = RayCounts::default();
            self.light_choice = learn_lights(scene, &self.settings, self.seed, &mut rays);
            self.rays += rays;
            statistics.rays += rays;
        }
        let (seed, first, light_choice) = (self.seed, self.groups, self.light_choice.as_ref());
        self.groups += groups;
        let tracers: Vec<PathTracer<'_>> = self
            .pixels
            .par_iter_mut()
            .enumerate()
            .map(|(number, control)| {
                let mut tracer = PathTracer::new(scene).with_light_choice(light_choice);
                for group in first..first + groups {
                    let key = hash_pair(group, number as u64);
                    let mean = group_mean(&mut tracer, scene, size, control.position, seed, key).element_sum() / 3.0;
                    control.sum += mean;
                    control.sum_sq += mean * mean;
                }
                tracer
            })
            .collect();
        for tracer in &tracers {
            self.rays += tracer.rays;
            statistics.add_paths(tracer);
        }
    }

    /// What the difference from the paths has beyond the noise of both.
    fn bias(&self, measure: &Measure) -> Bias {
        let groups = self.groups as f64;
        let term = |control: &Control| {
            let pixel = (control.position.y * measure.size.x + control.position.x) as usize;
            let scale_sq = f64::from(measure.scale[pixel]).powi(2);
            let mean = control.sum / groups;
            let of_paths = (control.sum_sq / groups - mean * mean).max(0.0) / (groups - 1.0) / scale_sq;
            let noise_sq = measure.noise_sq[pixel];
            let difference_sq = (mean - f64::from(measure.mean[pixel])).powi(2) / scale_sq;
            Term { noise_sq, bias_sq: difference_sq - of_paths - f64::from(noise_sq) }
        };
        Bias::new(self.pixels.iter().map(term).collect())
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
