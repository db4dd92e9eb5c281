//! Which of several lights reach what the picture shows, learnt before it is made.
//!
//! What chooses a light knows its flux, distance and direction, but not what stands between: in a house most lamps
//! shine in other rooms. So some primary rays are traced beforehand, light samples with them, and the picture's tiles
//! remember for each side of the normal which lights they found:
//!
//! ```text
//! q(l) = sqrt(mean over the tile of (f L cos / p)^2 where l was chosen),   normalised
//! ```
//! p being the density of the direction alone. By itself q would have the least variance of all choices that know no
//! more. Half of the light samples choose by it, and each counts by the mean of both probabilities, so that q may be
//! wrong without a bias.
//!
//! # Source
//! As for the guide of lobes: Vorba et al. 2014, Rath et al. 2020; the balance heuristic of Veach 1997.

use std::ops::Range;

use glam::{UVec2, Vec2};
use rayon::prelude::*;
use scene::{LightDirection, Lobes, Scene, SeenLights};

use super::tiles::{self, around, tile};
use crate::sampler::{Sampler, hash_pair, in_cell};
use crate::secondary::{Shading, lights_of, unshadowed};
use crate::sky::SkySplit;
use crate::statistics::{RayCounts, map_counting};

/// Light samples of a primary ray that learns.
const LIGHT_SAMPLES: u32 = 8;
/// Most mirrors and panes before a surface that learns.
const MAX_CHAIN: usize = 8;
/// Share of the light samples that choose by what was learnt. With more, what the lessons missed is brighter, and there
/// are outliers.
const GUIDED: f32 = 0.5;
/// Keeps these random numbers apart from those of the picture.
const STREAM: u64 = 0x6c69_6768_7473;

/// The choices of all tiles.
#[derive(Debug)]
pub(crate) struct LightGuide {
    size: UVec2,
    tiles: Vec<Option<LightChoice>>,
}

/// Where a learner's sample belongs, and what it found.
#[derive(Debug, Clone, Copy)]
struct Lesson {
    tile: usize,
    light: usize,
    /// Square of what the light brought, over the probability with which it was chosen.
    moment: f32,
}

impl LightGuide {
    /// Learns from `side` x `side` primary rays of a picture of `size` pixels; `None` where they find no light on a
    /// diffuse surface.
    pub(crate) fn learn(
        scene: &Scene,
        sky: Option<&SkySplit>,
        side: u32,
        size: UVec2,
        seed: u64,
        rays: &mut RayCounts,
    ) -> Option<Self> {
        let learner = Learner { scene, sky, side, size, seed: hash_pair(seed, STREAM) };
        let found = map_counting((0..side * side).into_par_iter(), rays, |number, rays| learner.lessons(number, rays));
        let mut lessons = found.concat();
        if lessons.is_empty() {
            return None;
        }
        // Stable, so that sums are the same for any number of threads.
        lessons.par_sort_by_key(|lesson| (lesson.tile, lesson.light));
        let of_tile = ranges(&lessons);
        let choice = |tile: usize| {
            let near = around(tile).flat_map(|(near, weight)| {
                lessons[of_tile[near].clone()].iter().map(move |lesson| (lesson.light, weight * lesson.moment))
            });
            LightChoice::new(near.collect())
        };
        let tiles = (0..tiles::COUNT).into_par_iter().map(choice).collect();
        Some(Self { size, tiles })
    }

    /// The choice for a diffuse surface in the pixel at `position`.
    pub(crate) fn at(&self, position: UVec2, shading: &Shading) -> Option<&LightChoice> {
        self.tiles[tile(position.as_vec2() + 0.5, self.size, shading.surface.n)].as_ref()
    }
}

/// The stretch of each tile among lessons in their order.
fn ranges(lessons: &[Lesson]) -> Vec<Range<usize>> {
    let mut start = 0;
    (0..tiles::COUNT)
        .map(|tile| {
            let end = start + lessons[start..].partition_point(|lesson| lesson.tile <= tile);
            let range = start..end;
            start = end;
            range
        })
        .collect()
}

/// Whether the light samples of a surface are those that guides know: without gloss, whose own samples are weighted by
/// another density.
pub(crate) fn takes_guide(shading: &Shading) -> bool {
    shading.bsdf.has_diffuse() && !shading.bsdf.has_glossy()
}

struct Learner<'a> {
    scene: &'a Scene,
    sky: Option<&'a SkySplit>,
    side: u32,
    size: UVec2,
    seed: u64,
}

impl Learner<'_> {
    /// Samples lights where one primary ray ends.
    fn lessons(&self, number: u32, rays: &mut RayCounts) -> Vec<Lesson> {
        let mut lessons = Vec::new();
        let mut sampler = Sampler::new(self.seed, u64::from(number), 0);
        let film = in_cell(number, self.side, sampler.next_pair()) * self.size.as_vec2();
        let Some(shading) = self.first_diffuse(film, &mut sampler, rays) else { return lessons };
        let surface = &shading.surface;
        let tile = tile(film, self.size, surface.n);
        let mut lights = lights_of(self.scene, &shading, self.sky).seen_from(surface.p, surface.n);
        for mut sampler in sampler.split_into(LIGHT_SAMPLES) {
            let [u_choice, u, v, _] = sampler.next_4d();
            let Some((light, probability)) = lights.choose(u_choice) else { continue };
            let Some(direction) = lights.direction_to_one(light, 1.0, Vec2::new(u, v)) else { continue };
            let wi = shading.frame.to_local(direction.wi());
            if wi.z <= 0.0 || !shading.leaves(direction.wi(), wi) {
                continue;
            }
            rays.shadow += 1;
            if self.scene.occluded(&surface.shadow_ray(direction.wi(), direction.distance())) {
                continue;
            }
            let Some(sample) = direction.sample() else { continue };
            let value = unshadowed(&shading.bsdf, Lobes::DIFFUSE, shading.wo, wi, &sample, self.sky).max_element();
            let moment = value * value / probability;
            if moment > 0.0 && moment.is_finite() {
                lessons.push(Lesson { tile, light, moment });
            }
        }
        lessons
    }

    /// The surface that a pixel shows, in mirrors and behind glass too, if it takes a guide.
    fn first_diffuse(&self, film: Vec2, sampler: &mut Sampler, rays: &mut RayCounts) -> Option<Shading> {
        let mut ray = self.scene.camera_ray(film, self.size);
        rays.camera += 1;
        for _ in 0..MAX_CHAIN {
            let hit = self.scene.intersect(&ray)?;
            let shading = Shading::new(self.scene, self.scene.surface(&ray, &hit), ray.direction);
            if takes_guide(&shading) {
                return Some(shading);
            }
            if !shading.bsdf.is_delta() {
                return None;
            }
            let [u_lobe, u, v, _] = sampler.next_4d();
            let sample = shading.bsdf.sample(Lobes::SPECULAR, shading.wo, u_lobe, Vec2::new(u, v))?;
            ray = shading.surface.spawn(shading.frame.to_world(sample.wi));
            rays.path += 1;
        }
        None
    }
}

/// A choice among the lights that a tile has found, and among all.
#[derive(Debug)]
pub(crate) struct LightChoice {
    /// Indices in their order, and for each the sum of the probabilities up to it.
    lights: Vec<usize>,
    sums: Vec<f32>,
}

impl LightChoice {
    /// Makes the choice from the second moments of lights, each of which may come several times; `None` where there are
    /// none.
    fn new(mut moments: Vec<(usize, f32)>) -> Option<Self> {
        moments.sort_by_key(|moment| moment.0);
        let by_light = moments.chunk_by(|a, b| a.0 == b.0);
        let (lights, weights): (Vec<usize>, Vec<f32>) =
            by_light.map(|moments| (moments[0].0, moments.iter().map(|moment| moment.1).sum::<f32>().sqrt())).unzip();
        let total: f32 = weights.iter().sum();
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let mut below = 0.0;
        let mut sum_up = |weight: f32| {
            below += weight;
            below / total
        };
        let sums = weights.into_iter().map(&mut sum_up).collect();
        Some(Self { lights, sums })
    }

    /// Chooses a light, by what is known here or without, and a direction to it; the density is that of both ways
    /// together.
    pub(crate) fn direction<'a>(
        &self,
        lights: &mut SeenLights<'a>,
        u_choice: f32,
        u: Vec2,
    ) -> Option<LightDirection<'a>> {
        let (light, probability) = if u_choice < GUIDED {
            let u = u_choice / GUIDED;
            let place = self.sums.partition_point(|&sum| sum <= u).min(self.sums.len() - 1);
            (self.lights[place], lights.probability(self.lights[place]))
        } else {
            lights.choose((u_choice - GUIDED) / (1.0 - GUIDED))?
        };
        let both = GUIDED * self.probability(light) + (1.0 - GUIDED) * probability;
        lights.direction_to_one(light, both, u)
    }

    /// The probability with which the tile chooses a light.
    fn probability(&self, light: usize) -> f32 {
        let Ok(place) = self.lights.binary_search(&light) else { return 0.0 };
        self.sums[place] - if place == 0 { 0.0 } else { self.sums[place - 1] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rng;
    use crate::secondary::tests::square;
    use glam::{Vec3, Vec3A};
    use scene::{Camera, Description, Material, Mesh, PunctualLight};

    /// A floor under a roof at y = 2 with two lamps below it; the `hidden` ones above it shine on nothing that the
    /// camera sees.
    fn roofed(hidden: u32) -> Scene {
        let mesh = Mesh {
            positions: [square(4.0, 0.0), square(9.0, 2.0)].concat(),
            triangles: vec![[0, 2, 1], [0, 3, 2], [4, 6, 5], [4, 7, 6]],
            materials: vec![0; 4],
            ..Mesh::default()
        };
        let lamps = [(-2.0, 1.5), (2.0, 1.0)]
            .into_iter()
            .chain((0..hidden).map(|i| (-2.0 + 4.0 * i as f32 / hidden as f32, 2.5)));
        let lamp = |(x, y)| PunctualLight::Point { position: Vec3::new(x, y, 0.0), intensity: Vec3::ONE };
        let camera =
            Camera { eye: Vec3::new(0.0, 1.0, 3.0), at: Vec3::new(0.0, 0.0, 0.5), up: Vec3::Y, fov_y_degrees: 60.0 };
        Scene::new(Description {
            meshes: vec![mesh],
            materials: vec![Material::default()],
            lights: lamps.map(lamp).collect(),
            camera: Some(camera),
            ..Description::default()
        })
        .unwrap()
    }

    #[test]
    fn lamps_behind_the_roof_are_seldom_chosen_and_no_light_is_lost() {
        // Few are looked at one by one, of many a tree chooses.
        for hidden in [4, 200] {
            spares_hidden_lamps(&roofed(hidden));
        }
    }

    fn spares_hidden_lamps(scene: &Scene) {
        let size = UVec2::splat(64);
        let mut rays = RayCounts::default();
        let guide = LightGuide::learn(scene, None, 64, size, 1, &mut rays).expect("the floor is lit");
        assert!(rays.camera == 64 * 64 && rays.shadow > 0, "{rays:?}");
        let position = UVec2::new(32, 40);
        let ray = scene.camera_ray(position.as_vec2() + 0.5, size);
        let shading = Shading::new(scene, scene.surface(&ray, &scene.intersect(&ray).unwrap()), ray.direction);
        assert!(shading.surface.n.y > 0.9 && takes_guide(&shading), "the floor");
        let choice = guide.at(position, &shading).expect("tiles of the floor have learnt");
        assert_eq!(choice.lights, [0, 1], "the lamps below the roof");
        // Irradiance by the guide and without it.
        let mut lights = scene.lights().seen_from(shading.surface.p, shading.surface.n);
        let mut rng = Rng::new(2, 0);
        const COUNT: u32 = 20_000;
        let mut irradiance = |choice: Option<&LightChoice>| {
            let (mut sum, mut sum_sq) = (0.0, 0.0);
            for _ in 0..COUNT {
                let (u_choice, u) = (rng.next_1d(), rng.next_2d());
                let direction = match choice {
                    Some(choice) => choice.direction(&mut lights, u_choice, u),
                    None => lights.direction(u_choice, u),
                };
                let Some(sample) = direction.and_then(|direction| direction.sample()) else { continue };
                if !scene.occluded(&shading.surface.shadow_ray(sample.wi, sample.distance)) {
                    let value = f64::from(sample.radiance.x * sample.wi.dot(Vec3A::Y) / sample.pdf);
                    sum += value;
                    sum_sq += value * value;
                }
            }
            let mean = sum / f64::from(COUNT);
            (mean, sum_sq / f64::from(COUNT) - mean * mean)
        };
        let ((guided, noise), (blind, blind_noise)) = (irradiance(Some(choice)), irradiance(None));
        let error = ((noise + blind_noise) / f64::from(COUNT)).sqrt();
        assert!((guided - blind).abs() < 4.0 * error, "{guided} and {blind} +- {error}");
        assert!(noise < 0.4 * blind_noise, "{noise} of {blind_noise}");
    }

    #[test]
    fn probabilities_are_those_of_the_moments() {
        let choice = LightChoice::new(vec![(7, 1.0), (3, 9.0), (7, 3.0)]).unwrap();
        assert_eq!(choice.lights, [3, 7]);
        for (light, expected) in [(3, 0.6), (7, 0.4), (5, 0.0)] {
            assert!((choice.probability(light) - expected).abs() < 1e-6, "light {light}");
        }
        assert!(LightChoice::new(vec![]).is_none() && LightChoice::new(vec![(1, 0.0)]).is_none(), "no light");
        assert!(LightChoice::new(vec![(1, f32::INFINITY)]).is_none(), "no number");
    }

    #[test]
    fn every_tile_has_its_lessons() {
        let lesson = |tile, light| Lesson { tile, light, moment: 1.0 };
        let lessons = [lesson(0, 1), lesson(0, 4), lesson(3, 2), lesson(tiles::COUNT - 1, 0)];
        let found = ranges(&lessons);
        assert_eq!([&found[0], &found[1], &found[3], &found[tiles::COUNT - 1]], [&(0..2), &(2..2), &(2..3), &(3..4)]);
    }
}
