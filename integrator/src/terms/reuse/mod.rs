//! What the samples of glossy lobes find is shared among neighbours.
//!
//! The lobes of neighbouring points of a surface see about the same things, and a ray costs a hundred times as much as
//! to ask what a lobe makes of a thing that is known. So each point of a tile of pixels traces a few rays, and all
//! points of the tile take light from all that these met: with N samples for each point q and their densities p_q over
//! the surfaces that are met,
//!
//! ```text
//! L_s(p) = sum over all samples x that p sees of   f_s(p, x) G(p, x) L(x) / (N sum_q p_q(x)),   q that see x
//! ```
//! which is the balance heuristic (Veach 1997) between the points. What x gives off itself counts at p as much as light
//! sampling at p leaves of it. Light that x reflects by gloss is weighed anew for each point. This has no bias as far
//! as it is known which points see x, and where cells or photons know the light on x: of gloss over a diffuse part that
//! they do not know, light samples keep the MIS weight of the one point, and beside a highlight that is a bias. All are
//! taken to, but where something is so near that it moves within a lobe from point to point: there shadow rays tell.
//! What absorbs light on the way is taken to be the same for all. Mirrors and glass, and gloss of which the points see
//! quite different parts of the lobe, are for their own point.
//!
//! A point stands for all samples of its pixel on a surface, each batch at another place in the pixel. On curved
//! surfaces those share whose normals are alike; what is seen in mirrors takes no part.
//!
//! # Source
//! Bekaert, Sbert, Halton 2002: Accelerating Path Tracing by Re-Using Paths.

mod batches;
mod group;

use std::iter::zip;
use std::ops::Range;

use glam::{IVec2, UVec2, Vec3, Vec3A};
use rayon::prelude::*;

pub(crate) use self::batches::LobeAllocation;
use self::batches::deviations;
use self::group::Group;
use super::direct::{DirectTerm, Light};
use crate::film::Terms;
use crate::metrics;
use crate::plan::LobePlan;
use crate::sampler::hash_pair;
use crate::secondary::{Secondary, Shading};
use crate::statistics::RayCounts;
use crate::surface_points::{PixelPoints, SurfacePoint, same_surface};

/// Pixels along a side of a tile.
const SIDE: usize = 4;
/// Batches of samples that every tile takes.
const FIRST: u32 = 2;
/// Most samples of a batch for each point.
const BATCH: u32 = 8;
/// Keeps these random numbers apart from those of the picture.
const STREAM: u64 = 0x0072_6575_7365;

/// A tile after its first batches.
struct Tile<'a> {
    groups: Vec<Group<'a>>,
    /// Sums over the batches of the light of the points of each group.
    lights: Vec<Vec<Light>>,
    /// What the first batch met, by which later ones know what is near: a batch that judged itself would take nothing
    /// to be hidden where it happened to meet nothing near.
    hits: Vec<Vec<Vec3A>>,
    /// Relative noise of the mean of the first batches, summed over the pixels, by squares, each times its
    /// [`LobePlan::noise_weight`].
    noise: f64,
    rays: RayCounts,
    /// Samples that were not finite.
    dropped: u64,
}

/// Adds the light of shared lobes to the pixels of a band of a picture of `size`, in which the indirect light has about
/// the radiance `ambient`. The band decides for itself how many samples it takes unless that was decided for the whole
/// picture.
pub(crate) fn share_lobes<S: Secondary>(
    direct: &DirectTerm<'_, S>,
    pixels: &mut [PixelPoints],
    size: UVec2,
    seed: u64,
    ambient: f32,
    whole: Option<LobeAllocation>,
) {
    if direct.plan.lobes.noise <= 0.0 {
        return;
    }
    let floor_sq = whole.map_or_else(|| metrics::floor_sq(means(pixels, ambient)), |whole| whole.floor_sq);
    let width = size.x as usize;
    let mut tiles = start(direct, width, pixels, size, seed, ambient, floor_sq);
    let deviations = deviations(&tiles, width);
    let allocation =
        whole.unwrap_or_else(|| LobeAllocation::by(&deviations, pixels.len(), floor_sq, &direct.plan.lobes));
    let batches: Vec<u32> =
        deviations.into_iter().map(|deviation| allocation.batches(deviation, &direct.plan.lobes)).collect();
    let seed = hash_pair(seed, STREAM);
    tiles.par_iter_mut().zip(&batches).for_each(|(tile, batches)| tile.take(direct, size, FIRST..*batches, seed));
    let found: Vec<_> =
        tiles.iter().zip(batches).map(|(tile, batches)| (tile.terms(batches), tile.rays, tile.dropped)).collect();
    for (found, rays, dropped) in found {
        if let Some((pixel, _)) = found.first() {
            pixels[*pixel].rays += rays;
            pixels[*pixel].dropped += dropped;
        }
        for (pixel, terms) in found {
            let pixel = &mut pixels[pixel];
            if terms.is_finite() {
                pixel.sum.add_terms(&terms);
            } else {
                pixel.dropped += 1;
            }
        }
    }
}

/// About the means of pixels in an even radiance of `ambient`.
fn means(pixels: &[PixelPoints], ambient: f32) -> Vec<f64> {
    pixels.iter().map(|pixel| pixel.noise.mean(f64::from(ambient))).collect()
}

/// The tiles of rows of `width` pixels after their first batches.
fn start<'a, S: Secondary>(
    direct: &DirectTerm<'a, S>,
    width: usize,
    pixels: &'a [PixelPoints],
    size: UVec2,
    seed: u64,
    ambient: f32,
    floor_sq: f64,
) -> Vec<Tile<'a>> {
    let seed = hash_pair(seed, STREAM);
    let (columns, rows) = (width.div_ceil(SIDE), (pixels.len() / width).div_ceil(SIDE));
    let known = |pixel: usize| (pixels[pixel].samples, pixels[pixel].noise.mean(f64::from(ambient)));
    (0..columns * rows)
        .into_par_iter()
        .map(|number| {
            let corner = [number % columns * SIDE, number / columns * SIDE];
            let mut tile = Tile::new(groups(direct, pixels, width, corner));
            let first = tile.start(direct, size, seed);
            tile.noise = tile.noise_by(&first, known, floor_sq);
            tile
        })
        .collect()
}

/// The points of a tile that share their lobes, by their surfaces.
fn groups<'a, S: Secondary>(
    direct: &DirectTerm<'a, S>,
    pixels: &'a [PixelPoints],
    width: usize,
    [left, top]: [usize; 2],
) -> Vec<Group<'a>> {
    /// Points may lie so many times farther from each other's plane than samples of a pixel.
    const TOLERANCE: f32 = SIDE as f32;
    let (right, bottom) = ((left + SIDE).min(width), (top + SIDE).min(pixels.len() / width));
    let in_tile = (top..bottom).flat_map(|y| (left..right).map(move |x| y * width + x));
    let points = in_tile.flat_map(|pixel| pixels[pixel].points.iter().map(move |point| (pixel, point)));
    let mut groups: Vec<Vec<(usize, &SurfacePoint)>> = Vec::new();
    for (pixel, point) in points.filter(|(_, point)| point.lobe_weight != Vec3::ZERO) {
        let Shading { surface, .. } = &point.shading;
        let same = groups.iter_mut().find(|group| {
            let (_, first) = group[0];
            // Where black texels of the diffuse part make the one lobe traced and the other not, they have nothing in
            // common.
            let both = [first, point].map(|point| direct.plan.lobes.traces(&point.shading));
            // Normals that differ by more than the width of the lobe see other things.
            let is_level = first.shading.surface.n.dot(surface.n) >= 1.0 - 0.5 * first.shading.lobe_alpha().powi(2);
            both[0] == both[1] && is_level && same_surface(&first.shading.surface, surface, TOLERANCE * surface.t)
        });
        match same {
            Some(group) => group.push((pixel, point)),
            None => groups.push(vec![(pixel, point)]),
        }
    }
    let group = |mut points: Vec<(usize, &'a SurfacePoint)>| {
        let lobes = &direct.plan.lobes;
        // As many as the point needs that needs most: a texture may make others nearly black.
        let count = points.iter().map(|(_, point)| lobes.rays(&point.shading, 1.0)).max().unwrap_or(1);
        let (_, first) = points[0];
        let guide = direct.guide.filter(|_| lobes.guides(&first.shading, count));
        Group {
            corners: corners_first(&mut points, |(_, point)| point.position),
            points,
            guide: guide.and_then(|guide| guide.at(first.position, first.shading.surface.n)),
            count: count.next_power_of_two().clamp(2, BATCH),
            parallax: lobes.parallax,
        }
    };
    groups.into_iter().map(group).collect()
}

/// Puts the points first that lie farthest towards the corners of the tile, and returns how many these are.
fn corners_first<T>(points: &mut [T], position: impl Fn(&T) -> UVec2) -> usize {
    let mut count = 0;
    for corner in [IVec2::new(-1, -1), IVec2::new(1, 1), IVec2::new(1, -1), IVec2::new(-1, 1)] {
        let towards = |&number: &usize| position(&points[number]).as_ivec2().dot(corner);
        let farthest = (0..points.len()).max_by_key(towards).unwrap_or(0);
        if farthest >= count {
            points.swap(count, farthest);
            count += 1;
        }
    }
    count
}

impl<'a> Tile<'a> {
    /// A tile without light yet.
    fn new(groups: Vec<Group<'a>>) -> Self {
        let lights = groups.iter().map(|group| vec![Light::default(); group.points.len()]).collect();
        Self { groups, lights, hits: Vec::new(), noise: 0.0, rays: RayCounts::default(), dropped: 0 }
    }

    /// Takes the first two batches, each judged by what the other found; gives the light after one of them.
    fn start<S: Secondary>(&mut self, direct: &DirectTerm<'_, S>, size: UVec2, seed: u64) -> Vec<Vec<Light>> {
        let mut after_one = Vec::new();
        for (group, lights) in self.groups.iter().zip(&mut self.lights) {
            let mut trace = |batch| group.trace(direct, size, batch, seed, &mut self.rays, &mut self.dropped);
            let (first, second) = (trace(0), trace(1));
            let hits = first.hits();
            group.share(direct, &first, &second.hits(), lights, &mut self.rays);
            after_one.push(lights.clone());
            group.share(direct, &second, &hits, lights, &mut self.rays);
            self.hits.push(hits);
        }
        after_one
    }

    /// The noise by the light after the first of two batches, the number of samples and about the mean of each pixel,
    /// and what keeps dark pixels from ruling.
    fn noise_by(&self, first: &[Vec<Light>], pixel: impl Fn(usize) -> (u32, f64), floor_sq: f64) -> f64 {
        let mut noise = 0.0;
        for (group, (first, both)) in zip(&self.groups, zip(first, &self.lights)) {
            for ((number, point), (first, both)) in zip(&group.points, zip(first, both)) {
                let (samples, mean) = pixel(*number);
                let [first, both] = [first, both].map(|light| {
                    let light = point.lobe_weight * (light.direct + light.specular);
                    f64::from(light.element_sum()) / f64::from(3 * samples)
                });
                let weight = f64::from(LobePlan::noise_weight(&point.shading));
                noise += weight * (first - 0.5 * both).powi(2) / (mean * mean + floor_sq);
            }
        }
        noise
    }

    /// Takes more batches.
    fn take<S: Secondary>(&mut self, direct: &DirectTerm<'_, S>, size: UVec2, batches: Range<u32>, seed: u64) {
        for ((group, lights), hits) in self.groups.iter().zip(&mut self.lights).zip(&self.hits) {
            for batch in batches.clone() {
                let found = group.trace(direct, size, batch, seed, &mut self.rays, &mut self.dropped);
                group.share(direct, &found, hits, lights, &mut self.rays);
            }
        }
    }

    /// The light of the points after so many batches, with their pixels.
    fn terms(&self, batches: u32) -> Vec<(usize, Terms)> {
        let mut found = Vec::new();
        for (group, lights) in self.groups.iter().zip(&self.lights) {
            for ((pixel, point), light) in group.points.iter().zip(lights) {
                let weight = point.lobe_weight / batches as f32;
                let (direct, specular) = (weight * light.direct, weight * light.specular);
                found.push((*pixel, Terms { direct, specular, ..Terms::default() }));
            }
        }
        found
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use scene::{Camera, Description, Material, Mesh, NO_INDEX, Scene, SpecularKind};

    use super::*;
    use crate::secondary::tests::square;
    use crate::{Settings, Study, render};

    /// A floor of metal of this roughness, whose normals lean apart by `bend` at its corners, under a lamp, with a
    /// white wall that stands on it and a black plate before that, seen from above.
    pub(super) fn room(alpha: f32, bend: f32) -> Scene {
        walled_room(alpha, bend, Material { diffuse: Vec3::splat(0.7), ..Material::default() })
    }

    fn gloss(alpha: f32) -> SpecularKind {
        SpecularKind::Ggx { alpha, reflectance: Vec3::splat(0.8), schlick: false }
    }

    /// The same with a wall of this.
    fn walled_room(alpha: f32, bend: f32, wall_material: Material) -> Scene {
        let wall = |half: f32, height: f32, z: f32| {
            [(-half, 0.0), (half, 0.0), (half, height), (-half, height)].map(|(x, y)| Vec3::new(x, y, z))
        };
        let mesh = Mesh {
            positions: [square(2.0, 0.0), square(0.3, 2.0), wall(2.0, 2.0, -1.0), wall(0.3, 0.4, -0.6)].concat(),
            triangles: [
                [0, 2, 1],
                [0, 3, 2],
                [4, 5, 6],
                [4, 6, 7],
                [8, 9, 10],
                [8, 10, 11],
                [12, 13, 14],
                [12, 14, 15],
            ]
            .to_vec(),
            normals: square(bend, 1.0).to_vec(),
            normal_indices: [vec![[0, 2, 1], [0, 3, 2]], vec![[NO_INDEX; 3]; 6]].concat(),
            materials: vec![0, 0, 1, 1, 2, 2, 3, 3],
            ..Mesh::default()
        };
        let black = Material { diffuse: Vec3::ZERO, ..Material::default() };
        let metal = Material { specular: gloss(alpha), ..black.clone() };
        let lamp = Material { emission: Vec3::splat(5.0), ..black.clone() };
        let camera =
            Camera { eye: Vec3::new(0.3, 1.2, 1.8), at: Vec3::new(0.0, 0.0, -0.4), up: Vec3::Y, fov_y_degrees: 40.0 };
        let description = Description {
            meshes: vec![mesh],
            materials: vec![metal, lamp, wall_material, black],
            camera: Some(camera),
            ..Description::default()
        };
        Scene::new(description).unwrap()
    }

    /// What gloss reflects in several pictures: light straight from lamps, and other light.
    struct Reflected {
        /// Means over pictures, and variances of one picture, of each pixel.
        means: [Vec<f64>; 2],
        variances: [Vec<f64>; 2],
        /// Variances of the means of `means`.
        errors: [f64; 2],
        /// Rays of a picture.
        rays: f64,
    }

    pub(crate) fn mean(values: &[f64]) -> f64 {
        values.iter().sum::<f64>() / values.len() as f64
    }

    pub(crate) fn variance(values: &[f64]) -> f64 {
        let mean = mean(values);
        values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64
    }

    fn reflected(scene: &Scene, reuse: bool, size: u32, count: u8) -> Reflected {
        let study = Study { lobe_reuse: Some(reuse), ..Study::default() };
        let settings = Settings { size: UVec2::splat(size), quality: 0.1, study, ..Settings::default() };
        let mut rays = Vec::new();
        let mut pictures = [Vec::new(), Vec::new()];
        for seed in 0..count {
            let rendering =
                render(scene, &Settings { seed: seed.into(), ..settings.clone() }, &|_| ()).expect("valid settings");
            rays.push(rendering.statistics.rays.total() as f64);
            let film = &rendering.film;
            let (direct, specular): (Vec<f64>, Vec<f64>) = (0..film.pixel_count())
                .map(|pixel| film.terms(pixel))
                .map(|terms| (f64::from(terms.direct.y), f64::from(terms.specular.y)))
                .unzip();
            pictures[0].push(direct);
            pictures[1].push(specular);
        }
        let by_pixel = |pictures: &[Vec<f64>], what: fn(&[f64]) -> f64| -> Vec<f64> {
            let pixel = |pixel: usize| pictures.iter().map(|picture| picture[pixel]).collect::<Vec<f64>>();
            (0..pictures[0].len()).map(|number| what(&pixel(number))).collect()
        };
        Reflected {
            means: pictures.each_ref().map(|pictures| by_pixel(pictures, mean)),
            variances: pictures.each_ref().map(|pictures| by_pixel(pictures, variance)),
            errors: pictures.each_ref().map(|pictures| {
                variance(&pictures.iter().map(|picture| mean(picture)).collect::<Vec<f64>>()) / f64::from(count)
            }),
            rays: mean(&rays),
        }
    }

    #[test]
    fn shared_lobes_have_the_light_of_lobes_alone_and_less_noise_for_their_rays() {
        const SEEDS: u8 = 4;
        for (alpha, bend) in [(0.1, 0.0), (0.3, 0.0), (0.3, 0.5)] {
            let scene = room(alpha, bend);
            let [alone, shared] = [false, true].map(|reuse| reflected(&scene, reuse, 96, SEEDS));
            for (term, name) in ["direct", "specular"].into_iter().enumerate() {
                let [mean_alone, mean_shared] = [&alone, &shared].map(|found| mean(&found.means[term]));
                let error = (alone.errors[term] + shared.errors[term]).sqrt();
                assert!(mean_alone > 0.005, "alpha {alpha}, bend {bend}, {name}: there is light, {mean_alone}");
                assert!(
                    (mean_alone - mean_shared).abs() < 4.0 * error + 0.003 * mean_alone,
                    "alpha {alpha}, bend {bend}, {name}: {mean_shared} instead of {mean_alone} +- {error}"
                );
            }
            let [cost_alone, cost_shared] = [&alone, &shared].map(|found| mean(&found.variances[1]) * found.rays);
            assert!(
                cost_shared < 0.4 * cost_alone,
                "alpha {alpha}, bend {bend}: {cost_shared} instead of {cost_alone}"
            );
        }
    }

    #[test]
    fn what_stands_near_hides_things_from_some_points_of_a_tile_alone() {
        const SEEDS: u8 = 16;
        let white = Material { diffuse: Vec3::splat(0.7), ..Material::default() };
        let metal = Material { diffuse: Vec3::ZERO, specular: gloss(0.1), ..Material::default() };
        let lamp = Material { diffuse: Vec3::ZERO, emission: Vec3::ONE, ..Material::default() };
        // Coarse pixels at the foot of the plate.
        for (wall, term, name) in [(white, 1, "white"), (metal, 1, "metal"), (lamp, 0, "lamp")] {
            let scene = walled_room(0.1, 0.0, wall);
            let [alone, shared] = [false, true].map(|reuse| reflected(&scene, reuse, 24, SEEDS));
            let apart: Vec<f64> = zip(&alone.means[term], &shared.means[term]).map(|(a, b)| (a - b).powi(2)).collect();
            let noise = (mean(&alone.variances[term]) + mean(&shared.variances[term])) / f64::from(SEEDS);
            // Without shadow rays it is three times the noise before the white wall, fifteen times before metal that
            // sends all points the same.
            assert!(mean(&apart) < 1.5 * noise, "{name}: {} is not the noise, {noise}", mean(&apart));
        }
    }

    #[test]
    fn corners_of_a_tile_come_first() {
        let corners = |points: &[[u32; 2]]| {
            let mut points = points.to_vec();
            let count = corners_first(&mut points, |&point| UVec2::from_array(point));
            points.truncate(count);
            points.sort_unstable();
            points
        };
        let points: Vec<[u32; 2]> = (0..16).map(|i| [40 + i % 4, 80 + i / 4]).collect();
        assert_eq!(corners(&points), [[40, 80], [40, 83], [43, 80], [43, 83]]);
        assert_eq!(corners(&points[4..7]), [[40, 81], [42, 81]], "of a row");
        assert_eq!(corners(&points[5..6]), [[41, 81]]);
    }
}
