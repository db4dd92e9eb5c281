//! Which of several lights reach what the picture shows, learnt before it is made.
//!
//! What chooses a light knows its flux, distance and direction, but not what stands between: in a house most lamps
//! shine in other rooms. So some primary rays are traced beforehand, light samples with them, and the picture's tiles
//! remember for each side of the normal what samples of each light found. By that lights are chosen there
//! ([`Lights::learnt_choice`](scene::Lights::learnt_choice)), all of them still, so that a wrong lesson costs noise and
//! no bias.

use std::ops::Range;

use glam::{UVec2, Vec2};
use rayon::prelude::*;
use scene::{LightChoice, LightDirection, LightLesson, Lobes, Scene};

use super::tiles::{self, around, tile};
use crate::sampler::{Sampler, hash_pair, in_cell};
use crate::secondary::{Shading, lights_of, unshadowed};
use crate::sky::SkySplit;
use crate::statistics::{RayCounts, map_counting};

/// Light samples of a primary ray that learns.
const LIGHT_SAMPLES: u32 = 8;
/// Most mirrors and panes before a surface that learns.
const MAX_CHAIN: usize = 8;
/// Keeps these random numbers apart from those of the picture.
const STREAM: u64 = 0x6c69_6768_7473;

/// How lights are chosen in each tile.
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
    /// Square of what the sample counts: 0 where something stands between.
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
        let lights = sky.map_or(scene.lights(), SkySplit::lights);
        let choice = |tile: usize| {
            let mut learnt = Vec::new();
            for (near, weight) in around(tile) {
                learnt.extend(lessons[of_tile[near].clone()].iter().map(|lesson| LightLesson {
                    light: lesson.light,
                    count: weight,
                    moment: weight * lesson.moment,
                }));
            }
            lights.learnt_choice(&learnt)
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
            let direction = lights.direction_to_one(light, probability, Vec2::new(u, v));
            let value = direction.map_or(0.0, |direction| self.value(&shading, &direction, rays));
            let moment = value * value;
            if moment.is_finite() {
                lessons.push(Lesson { tile, light, moment });
            }
        }
        lessons
    }

    /// What a light sample counts.
    fn value(&self, shading: &Shading, direction: &LightDirection<'_>, rays: &mut RayCounts) -> f32 {
        let wi = shading.frame.to_local(direction.wi());
        if wi.z <= 0.0 || !shading.leaves(direction.wi(), wi) {
            return 0.0;
        }
        rays.shadow += 1;
        if self.scene.occluded(&shading.surface.shadow_ray(direction.wi(), direction.distance())) {
            return 0.0;
        }
        let Some(sample) = direction.sample() else { return 0.0 };
        unshadowed(&shading.bsdf, Lobes::DIFFUSE, shading.wo, wi, &sample, self.sky).max_element()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rng;
    use crate::secondary::tests::square;
    use glam::{Vec3, Vec3A};
    use scene::{Camera, Description, Material, Mesh, PunctualLight, Surface};

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
        let Surface { p, n, .. } = shading.surface;
        let seen_by = |choice: Option<&'_ LightChoice>| scene.lights().seen_by(p, n, choice).probability(0);
        assert!(seen_by(Some(choice)) > 1.2 * seen_by(None), "a lamp below the roof");
        // Irradiance by the guide and without it.
        const COUNT: u32 = 20_000;
        let irradiance = |choice: Option<&LightChoice>| {
            let (mut lights, mut rng) = (scene.lights().seen_by(p, n, choice), Rng::new(2, 0));
            let (mut sum, mut sum_sq) = (0.0, 0.0);
            for _ in 0..COUNT {
                let Some(sample) = lights.sample(rng.next_1d(), rng.next_2d()) else { continue };
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
    fn every_tile_has_its_lessons() {
        let lesson = |tile, light| Lesson { tile, light, moment: 1.0 };
        let lessons = [lesson(0, 1), lesson(0, 4), lesson(3, 2), lesson(tiles::COUNT - 1, 0)];
        let found = ranges(&lessons);
        assert_eq!([&found[0], &found[1], &found[3], &found[tiles::COUNT - 1]], [&(0..2), &(2..2), &(2..3), &(3..4)]);
    }
}
