//! How noisy the caustics of a picture are, by which it gets as many photons as it needs.
//!
//! The noise of photons does not fall with the number of samples, for all ask the same photons. Where caustics are most
//! of the light, as at the bottom of a pool, it is nearly all of the noise; where few are seen, more photons would be
//! for nothing. So before the picture is made, some primary rays look how much of the light caustics are. A sum over
//! discs of k photons each has a variance of at most 4 / (3 k) of its square where light is even (by Epanechnikov's
//! kernel):
//!
//! ```text
//! noise <= 4 / (3 k)  mean over the picture of  c^2 / (R^2 + e)
//! ```
//! where R is the radiance as far as the light at secondary hits tells it, c the part by caustics, and e as in
//! [`crate::metrics::rel_mse`]. The photons of a lamp without width are stratified, and may have a fiftieth of that.
//! What they really have, as many others tell, which are to be shot anyway where it might be too much: half of the mean
//! square of what two maps differ by.

use glam::{UVec2, Vec3, Vec3A};
use rayon::prelude::*;
use scene::{Ray, Scene};

use crate::PhotonMaps;
use crate::delta_ways::delta_ways;
use crate::metrics;
use crate::sampler::{Sampler, hash_pair, in_cell};
use crate::secondary::{Secondary, Shading};
use crate::statistics::{RayCounts, map_counting};

/// Mirrors and panes before a surface, at most.
const MAX_CHAIN: usize = 8;
/// Keeps these random numbers apart from those of the picture.
const STREAM: u64 = 0x6361_7573_7469_6373;

/// What primary rays see of surfaces on which caustics may lie.
pub(crate) struct CausticNeed {
    views: Vec<View>,
}

/// What one ray sees, by mirrors and glass.
#[derive(Debug, Clone, Copy, Default)]
struct View {
    /// All light that is known, mean of R, G and B.
    radiance: f32,
    /// Radiance by the irradiance of the diffuse surface at its end.
    reflected: Vec3,
    /// Place and geometric normal there.
    p: Vec3A,
    n: Vec3A,
}

impl CausticNeed {
    /// Traces `side` x `side` rays of a picture of `size` pixels.
    pub(crate) fn new(
        scene: &Scene,
        secondary: &impl Secondary,
        size: UVec2,
        side: u32,
        seed: u64,
        rays: &mut RayCounts,
    ) -> Self {
        let views = map_counting((0..side * side).into_par_iter(), rays, |number, rays| {
            let mut sampler = Sampler::new(hash_pair(seed, STREAM), number.into(), 0);
            let film = in_cell(number, side, sampler.next_pair()) * size.as_vec2();
            View::new(scene, secondary, scene.camera_ray(film, size), &mut sampler, rays)
        });
        Self { views }
    }

    /// Returns the most noise that the caustics of maps may have, in relMSE, if their discs hold `neighbours` photons.
    pub(crate) fn most_noise(&self, maps: &PhotonMaps, neighbours: u32) -> f32 {
        4.0 / (3.0 * neighbours as f32) * self.mean(maps, |_, caustic| caustic.powi(2))
    }

    /// Returns the noise that they have, in relMSE, by other photons of the same kind and number.
    pub(crate) fn noise(&self, maps: &PhotonMaps, other: &PhotonMaps) -> f32 {
        self.mean(maps, |view, caustic| 0.5 * (caustic - view.caustic(other)).powi(2))
    }

    /// The mean over the rays of some square by what they see of caustics, relative to all that they see.
    fn mean(&self, maps: &PhotonMaps, square: impl Fn(&View, f32) -> f32 + Sync) -> f32 {
        let seen = |view: &View| {
            let caustic = view.caustic(maps);
            // The light that is known may be blurred.
            (f64::from(view.radiance.max(caustic)), f64::from(square(view, caustic)))
        };
        let seen: Vec<(f64, f64)> = self.views.par_iter().map(seen).collect();
        let floor_sq = metrics::floor_sq(seen.iter().map(|(radiance, _)| *radiance).collect());
        let relative = |(radiance, square): &(f64, f64)| square / (radiance.powi(2) + floor_sq);
        #[expect(clippy::cast_possible_truncation, reason = "an estimate")]
        let mean = (seen.iter().map(relative).sum::<f64>() / seen.len() as f64) as f32;
        mean
    }
}

impl View {
    /// Follows a primary ray by mirrors and glass, one way at each, to the first other surface. Sees nothing if that is
    /// no number.
    fn new(scene: &Scene, secondary: &impl Secondary, ray: Ray, sampler: &mut Sampler, rays: &mut RayCounts) -> Self {
        let (mut radiance, mut view) = (Vec3::ZERO, Self::default());
        let (mut ray, mut beta, mut radiance_scale) = (ray, Vec3::ONE, 1.0);
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
            if !shading.bsdf.is_delta() {
                let reflected = beta * shading.bsdf.diffuse * std::f32::consts::FRAC_1_PI;
                let known = secondary.irradiance(&surface);
                let irradiance = known.map_or(Vec3::ZERO, |known| known.direct.unwrap_or_default() + known.indirect);
                radiance += reflected * irradiance;
                view = Self { reflected, p: surface.p, n: surface.ng, ..view };
                break;
            }
            sampler.start_bounce(u32::try_from(bounce).expect("a short chain"));
            let ways = delta_ways(&shading, beta, radiance_scale, false, |_| 1.0, sampler);
            let Some(way) = ways.first() else { break };
            (ray, beta, radiance_scale) = (way.ray, way.beta, way.radiance_scale);
            rays.path += 1;
        }
        view.radiance = radiance.element_sum() / 3.0;
        if view.radiance.is_finite() && view.reflected.is_finite() { view } else { Self::default() }
    }

    /// The light that it sees of caustics, mean of R, G and B.
    fn caustic(&self, maps: &PhotonMaps) -> f32 {
        if self.reflected == Vec3::ZERO {
            return 0.0;
        }
        let caustic = (self.reflected * maps.quick_caustic_irradiance(self.p, self.n)).element_sum() / 3.0;
        if caustic.is_finite() { caustic } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
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

    /// A floor, of which the camera sees the middle, and a mirror far above it that sends the light of a lamp back
    /// evenly.
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

    fn need(scene: &Scene, secondary: &Even<'_>, rays: &mut RayCounts) -> CausticNeed {
        CausticNeed::new(scene, secondary, UVec2::splat(64), 64, 1, rays)
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
        let alone = need(&scene, &Even(&maps, 0.0), rays).most_noise(&maps, 80);
        assert!((alone * 60.0 * 1.0156 - 1.0).abs() < 0.01, "{alone}");
        let quarter = need(&scene, &Even(&maps, 3.0 * irradiance), rays).most_noise(&maps, 80);
        assert!((quarter * 960.0 * 1.0156 - 1.0).abs() < 0.02, "{quarter}");
        assert_eq!(rays.camera, 2 * 64 * 64, "rays are counted");

        let mut rng = Rng::new(3, 0);
        let differences = (0..4000).map(|_| {
            let p = Vec3A::new(rng.next_1d() - 0.5, 0.0, rng.next_1d() - 0.5);
            let [a, b] = [&maps, &other].map(|maps| maps.quick_caustic_irradiance(p, Vec3A::Y).x / irradiance);
            (a - b).powi(2) / 2.0
        });
        let expected = differences.sum::<f32>() / 4000.0 / 1.0156;
        let found = need(&scene, &Even(&maps, 0.0), rays).noise(&maps, &other);
        assert!((found / expected - 1.0).abs() < 0.2, "{found}, by places on the floor {expected}");
        assert!(found < 0.1 * alone, "photons of a point are stratified: {found} of {alone}");
    }

    #[test]
    fn what_is_not_seen_has_no_noise() {
        let scene = mirrored();
        let maps =
            PhotonMaps::shoot(&scene, &PhotonSettings { global: false, caustic: false, ..PhotonSettings::default() });
        for even in [0.0, 1.0] {
            let need = need(&scene, &Even(&maps, even), &mut RayCounts::default());
            assert_eq!(
                [need.most_noise(&maps, 80), need.noise(&maps, &maps)],
                [0.0; 2],
                "no photons, and light of {even}"
            );
        }
    }
}
