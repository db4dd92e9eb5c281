//! How noisy the caustics of a picture are, by which it gets as many photons as it needs.
//!
//! The noise of photons does not fall with the number of samples, for all ask the same photons. Where caustics are most of the light, as at the bottom of a pool, it
//! is nearly all of the noise; where few are seen, more photons would be for nothing. So before the picture is made, some primary rays look how much of the light
//! caustics are. A sum over discs of k photons each has a variance of at most 4 / (3 k) of its square where light is even (by Epanechnikov's kernel):
//!
//! ```text
//! noise <= 4 / (3 k)  mean over the picture of  c^2 / (R^2 + e)
//! ```
//! where R is the radiance as far as the light at secondary hits tells it, c the part by caustics, and e as in [`crate::metrics::rel_mse`]. The photons of a lamp without
//! width are stratified, and may have a fiftieth of that. What they really have, as many others tell, which are to be shot anyway where it might be too much:
//! half of the mean square of what two maps differ by.

use glam::{UVec2, Vec2, Vec3};
use rayon::prelude::*;
use scene::Scene;

use crate::PhotonMaps;
use crate::delta_ways::delta_ways;
use crate::metrics;
use crate::sampler::{Sampler, hash_pair, in_cell};
use crate::secondary::{Secondary, Shading};
use crate::statistics::RayCounts;

/// Mirrors and panes before a surface, at most.
const MAX_CHAIN: usize = 8;
/// Keeps these random numbers apart from those of the picture.
const STREAM: u64 = 0x6361_7573_7469_6373;

/// Asks primary rays for the share of caustics.
pub(crate) struct CausticNeed<'a, S> {
    pub(crate) scene: &'a Scene,
    pub(crate) maps: &'a PhotonMaps,
    pub(crate) secondary: &'a S,
    /// Pixels of the picture, and rays along a side of it.
    pub(crate) size: UVec2,
    pub(crate) side: u32,
    pub(crate) seed: u64,
}

/// What a ray found: mean of R, G and B of all light, of that by caustics, and of what it is by other photons.
#[derive(Debug, Clone, Copy, Default)]
struct Seen {
    radiance: f32,
    caustic: f32,
    other: f32,
}

impl<S: Secondary> CausticNeed<'_, S> {
    /// Returns the most noise that caustics may have, in relMSE, if their discs hold `neighbours` photons.
    pub(crate) fn most_noise(&self, neighbours: u32, rays: &mut RayCounts) -> f32 {
        4.0 / (3.0 * neighbours as f32) * self.mean(None, rays, |seen| seen.caustic.powi(2))
    }

    /// Returns the noise that they have, in relMSE, by other photons of the same kind and number.
    pub(crate) fn noise(&self, other: &PhotonMaps, rays: &mut RayCounts) -> f32 {
        self.mean(Some(other), rays, |seen| 0.5 * (seen.caustic - seen.other).powi(2))
    }

    /// The mean over the rays of some square, relative to their radiance.
    fn mean(&self, other: Option<&PhotonMaps>, rays: &mut RayCounts, square: impl Fn(&Seen) -> f32) -> f32 {
        let found: Vec<(Seen, RayCounts)> =
            (0..self.side * self.side).into_par_iter().map(|number| self.look(number, other)).collect();
        let floor_sq = metrics::floor_sq(found.iter().map(|(seen, _)| f64::from(seen.radiance)).collect());
        let mut sum = 0.0;
        for (seen, counts) in &found {
            sum += f64::from(square(seen)) / (f64::from(seen.radiance).powi(2) + floor_sq).max(f64::MIN_POSITIVE);
            *rays += *counts;
        }
        #[expect(clippy::cast_possible_truncation, reason = "an estimate")]
        let mean = (sum / found.len() as f64) as f32;
        mean
    }

    /// What one ray finds; nothing where that is no number.
    fn look(&self, number: u32, other: Option<&PhotonMaps>) -> (Seen, RayCounts) {
        let mut rays = RayCounts::default();
        let mut sampler = Sampler::new(hash_pair(self.seed, STREAM), number.into(), 0);
        let film = in_cell(number, self.side, sampler.next_pair()) * self.size.as_vec2();
        let found = self.follow(film, other, &mut sampler, &mut rays).map(|light| light.element_sum() / 3.0);
        let [known, caustic, other] = if found.iter().all(|light| light.is_finite()) { found } else { [0.0; 3] };
        // Secondary light may be blurred.
        (Seen { radiance: known.max(caustic), caustic, other }, rays)
    }

    /// Follows a primary ray by mirrors and glass, one way at each, to the first other surface.
    fn follow(&self, film: Vec2, other: Option<&PhotonMaps>, sampler: &mut Sampler, rays: &mut RayCounts) -> [Vec3; 3] {
        let Self { scene, maps, secondary, .. } = *self;
        let (mut radiance, mut caustics) = (Vec3::ZERO, [Vec3::ZERO; 2]);
        let (mut ray, mut beta, mut radiance_scale) = (scene.camera_ray(film, self.size), Vec3::ONE, 1.0);
        rays.camera += 1;
        for bounce in 1..=MAX_CHAIN {
            let Some(hit) = scene.intersect(&ray) else {
                radiance += beta * scene.background(ray.direction);
                break;
            };
            let surface = scene.surface(&ray, &hit);
            beta *= scene.transmittance(&surface);
            radiance += beta * scene.emission(&surface);
            let shading = Shading::new(scene, surface, ray.direction);
            if shading.bsdf.has_diffuse() {
                let reflected = beta * shading.bsdf.diffuse * std::f32::consts::FRAC_1_PI;
                let irradiance = |maps: &PhotonMaps| maps.quick_caustic_irradiance(surface.p, surface.ng);
                caustics[0] += reflected * irradiance(maps);
                caustics[1] += reflected * other.map_or(Vec3::ZERO, irradiance);
                let known = secondary.irradiance(&surface);
                radiance +=
                    known.map_or(Vec3::ZERO, |known| reflected * (known.direct.unwrap_or_default() + known.indirect));
            }
            if !shading.bsdf.is_delta() {
                break;
            }
            sampler.start_bounce(u32::try_from(bounce).expect("a short chain"));
            let ways = delta_ways(&shading, beta, radiance_scale, false, |_| 1.0, sampler);
            let Some(way) = ways.first() else { break };
            (ray, beta, radiance_scale) = (way.ray, way.beta, way.radiance_scale);
            rays.path += 1;
        }
        [radiance, caustics[0], caustics[1]]
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3A;
    use scene::{Camera, Description, Material, Mesh, PunctualLight, SpecularKind, Surface};

    use super::*;
    use crate::secondary::Known;
    use crate::secondary::tests::square;
    use crate::{PhotonSettings, Rng};

    /// Knows caustics, and an even light besides.
    struct Even<'a>(&'a PhotonMaps, f32);

    impl Secondary for Even<'_> {
        fn irradiance(&self, surface: &Surface) -> Option<Known> {
            let indirect = self.caustic_irradiance(surface);
            Some(Known { direct: Some(Vec3::splat(self.1)), indirect, resolution: 0.0 })
        }

        fn caustic_irradiance(&self, surface: &Surface) -> Vec3 {
            self.0.quick_caustic_irradiance(surface.p, surface.ng)
        }
    }

    /// A floor, of which the camera sees the middle, and a mirror far above it that sends the light of a lamp back evenly.
    fn mirrored() -> Scene {
        let mesh = Mesh {
            positions: [square(2.0, 0.0), square(20.0, 10.0)].concat(),
            triangles: vec![[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]],
            materials: vec![0, 0, 1, 1],
            ..Mesh::default()
        };
        let specular = SpecularKind::Mirror { reflectance: Vec3::ONE };
        let mirror = Material { diffuse: Vec3::ZERO, specular, ..Material::default() };
        let eye = Vec3::new(0.0, 2.0, 0.0);
        Scene::new(Description {
            meshes: vec![mesh],
            materials: vec![Material::default(), mirror],
            lights: vec![PunctualLight::Point { position: Vec3::Y, intensity: Vec3::ONE }],
            camera: Some(Camera { eye, at: Vec3::ZERO, up: Vec3::X, fov_y_degrees: 40.0 }),
            ..Description::default()
        })
        .unwrap()
    }

    fn need<'a>(scene: &'a Scene, maps: &'a PhotonMaps, secondary: &'a Even<'a>) -> CausticNeed<'a, Even<'a>> {
        CausticNeed { scene, maps, secondary, size: UVec2::splat(64), side: 64, seed: 1 }
    }

    #[test]
    fn noise_is_that_of_two_maps_and_no_more_than_foretold() {
        let scene = mirrored();
        let settings = PhotonSettings { global: false, caustic_count: 100_000, ..PhotonSettings::default() };
        let [maps, other] = [1, 2].map(|seed| PhotonMaps::shoot(&scene, &PhotonSettings { seed, ..settings.clone() }));
        let rays = &mut RayCounts::default();
        // As from a lamp 19 m above.
        let irradiance = 1.0 / 361.0;
        // The brightest tenth of what is even has a radiance of 0.8, so e is 0.0156 of the square of all.
        let alone = need(&scene, &maps, &Even(&maps, 0.0)).most_noise(80, rays);
        assert!((alone * 60.0 * 1.0156 - 1.0).abs() < 0.01, "{alone}");
        let quarter = need(&scene, &maps, &Even(&maps, 3.0 * irradiance)).most_noise(80, rays);
        assert!((quarter * 960.0 * 1.0156 - 1.0).abs() < 0.02, "{quarter}");
        assert_eq!(rays.camera, 2 * 64 * 64, "rays are counted");

        let mut rng = Rng::new(3, 0);
        let differences = (0..4000).map(|_| {
            let p = Vec3A::new(rng.next_1d() - 0.5, 0.0, rng.next_1d() - 0.5);
            let [a, b] = [&maps, &other].map(|maps| maps.quick_caustic_irradiance(p, Vec3A::Y).x / irradiance);
            (a - b).powi(2) / 2.0
        });
        let expected = differences.sum::<f32>() / 4000.0 / 1.0156;
        let found = need(&scene, &maps, &Even(&maps, 0.0)).noise(&other, rays);
        assert!((found / expected - 1.0).abs() < 0.2, "{found}, by places on the floor {expected}");
        assert!(found < 0.1 * alone, "photons of a point are stratified: {found} of {alone}");
    }

    #[test]
    fn what_is_not_seen_has_no_noise() {
        let scene = mirrored();
        let maps =
            PhotonMaps::shoot(&scene, &PhotonSettings { global: false, caustic: false, ..PhotonSettings::default() });
        for even in [0.0, 1.0] {
            let (secondary, rays) = (Even(&maps, even), &mut RayCounts::default());
            let need = need(&scene, &maps, &secondary);
            assert_eq!(
                [need.most_noise(80, rays), need.noise(&maps, rays)],
                [0.0; 2],
                "no photons, and light of {even}"
            );
        }
    }
}
