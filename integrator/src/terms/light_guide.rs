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
use scene::{LightChoice, LightLesson, Lobes, Scene};

use super::behind_glass::LampBehind;
use super::tiles::{self, around, tile};
use crate::light_lessons::lessons;
use crate::sampler::{Sampler, hash_pair, in_cell};
use crate::secondary::Shading;
use crate::sky::SkySplit;
use crate::statistics::{RayCounts, map_counting};

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

/// What samples of one light have found in a tile.
#[derive(Debug, Clone, Copy)]
struct Lesson {
    tile: usize,
    learnt: LightLesson,
}

impl LightGuide {
    /// Learns from `side` x `side` primary rays of a picture of `size` pixels; `None` where there is nothing to choose,
    /// and where they find no surface that takes a guide.
    pub(crate) fn learn(
        scene: &Scene,
        sky: Option<&SkySplit>,
        side: u32,
        size: UVec2,
        seed: u64,
        rays: &mut RayCounts,
    ) -> Option<Self> {
        let lights = sky.map_or(scene.lights(), SkySplit::lights);
        if !lights.has_choice() {
            return None;
        }
        let learner = Learner { scene, sky, side, size, seed: hash_pair(seed, STREAM) };
        let found = map_counting((0..side * side).into_par_iter(), rays, |number, rays| learner.lessons(number, rays));
        let mut lessons = found.concat();
        if lessons.is_empty() {
            return None;
        }
        // Stable, so that sums are the same for any number of threads.
        lessons.par_sort_by_key(|lesson| (lesson.tile, lesson.learnt.light));
        lessons.dedup_by(|next, lesson| {
            let same = (next.tile, next.learnt.light) == (lesson.tile, lesson.learnt.light);
            if same {
                lesson.learnt.samples += next.learnt.samples;
                lesson.learnt.count += next.learnt.count;
                lesson.learnt.moment += next.learnt.moment;
            }
            same
        });
        let of_tile = ranges(&lessons);
        let choice = |tile: usize| {
            let mut learnt = Vec::new();
            for (near, weight) in around(tile) {
                learnt.extend(lessons[of_tile[near].clone()].iter().map(|&Lesson { learnt, .. }| LightLesson {
                    samples: weight * learnt.samples,
                    count: weight * learnt.count,
                    moment: weight * learnt.moment,
                    ..learnt
                }));
            }
            lights.learnt_choice(&learnt)
        };
        let tiles = (0..tiles::COUNT).into_par_iter().map(choice).collect();
        Some(Self { size, tiles })
    }

    /// The choice for a surface in the pixel at `position`, which takes guides.
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

/// Whether the lights of a surface are those that guides know: where textures carry the soft part of the sky, that is
/// not so for gloss, which sees all of it.
pub(crate) fn takes_guide(shading: &Shading, sky: Option<&SkySplit>) -> bool {
    if shading.bsdf.has_glossy() { sky.is_none() } else { shading.bsdf.has_diffuse() }
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
        let mut sampler = Sampler::new(self.seed, u64::from(number), 0);
        let film = in_cell(number, self.side, sampler.next_pair()) * self.size.as_vec2();
        let Some(shading) = self.first_lit(film, &mut sampler, rays) else { return Vec::new() };
        let tile = tile(film, self.size, shading.surface.n);
        let looks_on = LampBehind::is_wanted(self.scene, &shading);
        let learnt = lessons(self.scene, self.sky, &shading, looks_on, &mut sampler, rays);
        learnt.map(|learnt| Lesson { tile, learnt }).collect()
    }

    /// The surface that a pixel shows, in mirrors and behind glass too, if it takes a guide.
    fn first_lit(&self, film: Vec2, sampler: &mut Sampler, rays: &mut RayCounts) -> Option<Shading> {
        let mut ray = self.scene.camera_ray(film, self.size);
        rays.camera += 1;
        for _ in 0..MAX_CHAIN {
            let hit = self.scene.intersect(&ray)?;
            let shading = Shading::new(self.scene, self.scene.surface(&ray, &hit), ray.direction);
            if takes_guide(&shading, self.sky) {
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
    use crate::plan::Plan;
    use crate::secondary::tests::square;
    use crate::terms::direct::DirectTerm;
    use crate::terms::reuse::tests::{mean, variance};
    use crate::{NoSecondary, Rng, Settings};
    use glam::{Vec3, Vec3A};
    use scene::{Camera, Description, Material, Mesh, PunctualLight, SpecularKind, Surface};

    /// A floor under a roof at y = 2 with two lamps below it; the `hidden` ones above it shine on nothing that the
    /// camera sees.
    fn roofed(hidden: u32, intensity: f32) -> Scene {
        let mesh = Mesh {
            positions: [square(4.0, 0.0), square(9.0, 2.0)].concat(),
            triangles: vec![[0, 2, 1], [0, 3, 2], [4, 6, 5], [4, 7, 6]],
            materials: vec![0; 4],
            ..Mesh::default()
        };
        let hidden = (0..hidden).map(|i| (-2.0 + 4.0 * i as f32 / hidden as f32, 2.5, intensity));
        let lamps = [(-2.0, 1.5, 1.0), (2.0, 1.0, 1.0)].into_iter().chain(hidden);
        let lamp = |(x, y, intensity)| PunctualLight::Point {
            position: Vec3::new(x, y, 0.0),
            intensity: Vec3::splat(intensity),
        };
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
            spares_hidden_lamps(&roofed(hidden, 1.0));
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
        assert!(shading.surface.n.y > 0.9 && takes_guide(&shading, None), "the floor");
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
    fn a_lamp_is_found_beside_a_hidden_one_that_is_much_stronger() {
        let scene = roofed(1, 1e5);
        let size = UVec2::splat(64);
        let guide = LightGuide::learn(&scene, None, 48, size, 1, &mut RayCounts::default()).expect("the floor is lit");
        let positions = (0..16).map(|x| UVec2::new(4 * x + 2, 50));
        for position in positions {
            let ray = scene.camera_ray(position.as_vec2() + 0.5, size);
            let shading = Shading::new(&scene, scene.surface(&ray, &scene.intersect(&ray).unwrap()), ray.direction);
            let Surface { p, n, .. } = shading.surface;
            assert!(n.y > 0.9, "the floor");
            let hidden = |choice| scene.lights().seen_by(p, n, choice).probability(2);
            let choice = guide.at(position, &shading).expect("every tile of the floor has learnt");
            assert!(hidden(None) > 0.999 && hidden(Some(choice)) < 0.95, "{position}: {}", hidden(Some(choice)));
        }
    }

    #[test]
    fn gloss_that_meets_lamps_by_chance_knows_how_they_are_chosen() {
        // A glossy floor mirrors the lamp below a roof, which its lobe finds about as well as light samples do. Of the
        // lamps above the roof nothing is seen.
        let lamp = |x: f32, y: f32| square(0.8, y).map(|p| p + Vec3::new(x, 0.0, -2.0));
        let lamps = [lamp(0.0, 1.9), lamp(-2.0, 2.4), lamp(-1.0, 2.5), lamp(1.0, 2.6), lamp(2.0, 2.7)];
        let floor_and_roof = [square(4.0, 0.0), square(9.0, 2.0)];
        let mesh = Mesh {
            positions: [floor_and_roof.concat(), lamps.concat()].concat(),
            triangles: (0..7).flat_map(|i| [[4 * i, 4 * i + 1, 4 * i + 2], [4 * i, 4 * i + 2, 4 * i + 3]]).collect(),
            materials: [vec![0; 4], vec![1; 10]].concat(),
            ..Mesh::default()
        };
        let specular = SpecularKind::Ggx { alpha: 0.2, reflectance: Vec3::splat(0.5), schlick: false };
        let plastic = Material { diffuse: Vec3::splat(0.4), specular, ..Material::default() };
        let lit = Material { diffuse: Vec3::ZERO, emission: Vec3::ONE, ..Material::default() };
        let eye = Vec3::new(0.0, 1.0, 1.1);
        let camera = Camera { eye, at: Vec3::ZERO, up: Vec3::Y, fov_y_degrees: 60.0 };
        let scene = Scene::new(Description {
            meshes: vec![mesh],
            materials: vec![plastic, lit],
            camera: Some(camera),
            ..Description::default()
        })
        .unwrap();
        let (size, position) = (UVec2::splat(32), UVec2::splat(16));
        let mut rays = RayCounts::default();
        let guide = LightGuide::learn(&scene, None, 64, size, 1, &mut rays).expect("the floor is lit");
        let ray = scene.camera_ray(position.as_vec2() + 0.5, size);
        let shading = Shading::new(&scene, scene.surface(&ray, &scene.intersect(&ray).unwrap()), ray.direction);
        assert!(guide.at(position, &shading).is_some() && takes_guide(&shading, None), "gloss learns, too");
        let plan = Plan::new(&scene, &Settings::default());
        let found = |light_guide: Option<&LightGuide>| {
            let direct =
                DirectTerm { scene: &scene, plan: &plan, secondary: &NoSecondary, sky: None, guide: None, light_guide };
            let mut rays = RayCounts::default();
            let values: Vec<f64> = (0..4000)
                .map(|pixel| {
                    let mut sampler = Sampler::new(1, pixel, 0);
                    f64::from(direct.sample(&shading, position, Some(1.0), None, &mut sampler, &mut rays).0.direct.x)
                })
                .collect();
            (mean(&values), variance(&values))
        };
        let ((guided, noise), (blind, blind_noise)) = (found(Some(&guide)), found(None));
        let error = ((noise + blind_noise) / 4000.0).sqrt();
        assert!(error < 0.01 * blind && (guided - blind).abs() < 4.0 * error, "{guided} and {blind} +- {error}");
        assert!(noise < 0.7 * blind_noise, "{noise} of {blind_noise}");
    }

    #[test]
    fn every_tile_has_its_lessons() {
        let lesson =
            |tile, light| Lesson { tile, learnt: LightLesson { light, samples: 1.0, count: 1.0, moment: 1.0 } };
        let lessons = [lesson(0, 1), lesson(0, 4), lesson(3, 2), lesson(tiles::COUNT - 1, 0)];
        let found = ranges(&lessons);
        assert_eq!([&found[0], &found[1], &found[3], &found[tiles::COUNT - 1]], [&(0..2), &(2..2), &(2..3), &(3..4)]);
    }
}
