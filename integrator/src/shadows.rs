//! Which lights nothing hides from the planes that a pixel shows: found once for all of its samples, which need no
//! shadow rays then.

use arrayvec::ArrayVec;
use glam::{UVec2, Vec2, Vec3};
use scene::{LightDirection, Patch, Scene, Surface};

use crate::RayCounts;

/// The planes that a pixel shows.
#[derive(Debug)]
pub(crate) struct Shadows<'a> {
    scene: &'a Scene,
    size: UVec2,
    /// Two corners of the pixel, of which no sample lies outside.
    film: [Vec2; 2],
    planes: ArrayVec<Plane, MOST_PLANES>,
}

/// One of the planes that a pixel shows.
#[derive(Debug)]
pub(crate) struct Plane {
    patch: Patch,
    /// A bit for each light: whether it was asked if nothing hides it, and whether that is so.
    asked: u8,
    clear: u8,
}

/// Where a pixel shows more, as of a fine mesh, the rest has few samples on each.
const MOST_PLANES: usize = 2;
/// As many as a byte has bits.
const MOST_LIGHTS: usize = 8;

impl<'a> Shadows<'a> {
    /// Nothing is known yet of the pixel at `position` of a picture of this size. `None` where it does not pay: of many
    /// lights each has few samples, and surroundings are never all to be seen.
    pub(crate) fn new(scene: &'a Scene, position: UVec2, size: UVec2) -> Option<Self> {
        /// More than places on the film are rounded by.
        const MARGIN: f32 = 0.01;
        let count = scene.lights().count();
        let corner = position.as_vec2();
        let film = [corner - MARGIN, corner + (1.0 + MARGIN)];
        let pays = count <= MOST_LIGHTS && count > usize::from(scene.features().environment);
        pays.then(|| Self { scene, size, film, planes: ArrayVec::new() })
    }

    /// Returns the plane of a surface that a ray from the eye met in the pixel.
    #[inline]
    pub(crate) fn plane(&mut self, surface: &Surface) -> Option<&mut Plane> {
        let number = match self.planes.iter().position(|plane| plane.patch.holds(surface)) {
            Some(number) => number,
            None if self.planes.is_full() => return None,
            None => {
                let patch = self.scene.patch(surface, self.film, self.size)?;
                self.planes.push(Plane { patch, asked: 0, clear: 0 });
                self.planes.len() - 1
            }
        };
        Some(&mut self.planes[number])
    }
}

impl Plane {
    /// Whether it is known that nothing hides a light.
    #[inline]
    pub(crate) fn is_clear(&self, light: usize) -> bool {
        self.clear & 1 << light != 0
    }

    /// Returns the irradiance of an only lamp on a surface in the plane in closed form, where it is known that nothing
    /// hides any of it.
    #[inline]
    pub(crate) fn irradiance(&self, scene: &Scene, surface: &Surface) -> Option<Vec3> {
        let lights = scene.lights();
        let is_known = self.is_clear(0) && lights.count() == 1 && surface.media.is_empty();
        is_known.then(|| lights.irradiance(0, surface.p, surface.n)).flatten()
    }

    /// Learns of a light to which a ray came through.
    #[inline]
    fn learn(&mut self, scene: &Scene, light: usize) {
        let bit = 1 << light;
        if self.asked & bit == 0 {
            self.asked |= bit;
            if scene.is_clear(&self.patch, light) {
                self.clear |= bit;
            }
        }
    }
}

/// Whether something stands between a surface, which lies in `plane` if that is known, and a light.
#[inline]
pub(crate) fn is_hidden(
    scene: &Scene,
    surface: &Surface,
    light: &LightDirection<'_>,
    plane: Option<&mut Plane>,
    rays: &mut RayCounts,
) -> bool {
    if plane.as_ref().is_some_and(|plane| plane.is_clear(light.light())) {
        return false;
    }
    rays.shadow += 1;
    let is_hidden = scene.occluded(&surface.shadow_ray(light.wi(), light.distance()));
    if let Some(plane) = plane.filter(|_| !is_hidden) {
        plane.learn(scene, light.light());
    }
    is_hidden
}

#[cfg(test)]
mod tests {
    use scene::{Camera, Description, Material, Mesh, PunctualLight};

    use super::*;
    use crate::plan::Plan;
    use crate::secondary::Shading;
    use crate::secondary::tests::square;
    use crate::terms::direct::tests::term;
    use crate::{Sampler, Settings};

    const SIZE: UVec2 = UVec2::splat(16);

    /// A lamp of 1 m x 1 m over a floor, and between them a plate of this half width to one side.
    fn scene(plate: f32) -> Scene {
        let plate = square(plate, 0.5).map(|p| p + 0.4 * Vec3::X);
        let mesh = Mesh {
            positions: [square(5.0, 0.0), square(0.5, 2.0), plate].concat(),
            triangles: vec![[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [8, 10, 9], [8, 11, 10]],
            materials: vec![0, 0, 1, 1, 0, 0],
            ..Mesh::default()
        };
        let floor = Material { diffuse: Vec3::splat(0.5), ..Material::default() };
        let lamp = Material { emission: Vec3::ONE, ..Material::default() };
        let camera = Camera { eye: Vec3::new(0.0, 1.5, 4.0), at: Vec3::ZERO, up: Vec3::Y, fov_y_degrees: 30.0 };
        let materials = vec![floor, lamp];
        Scene::new(Description { meshes: vec![mesh], materials, camera: Some(camera), ..Description::default() })
            .unwrap()
    }

    /// Mean light of samples of a pixel, and what they find of its variance and rays.
    fn light(scene: &Scene, position: UVec2, mut shadows: Option<Shadows<'_>>) -> (f32, f32, u64) {
        const SAMPLES: u16 = 1024;
        let plan = Plan::new(scene, &Settings::default());
        let (mut sum, mut variance, mut rays) = (0.0, 0.0, RayCounts::default());
        for number in 0..SAMPLES {
            let mut sampler = Sampler::new(1, 0, number.into());
            let ray = scene.camera_ray(position.as_vec2() + sampler.next_pair(), SIZE);
            let shading = Shading::new(scene, scene.surface(&ray, &scene.intersect(&ray).unwrap()), ray.direction);
            let plane = shadows.as_mut().and_then(|shadows| shadows.plane(&shading.surface));
            let found = term(scene, &plan).sample(&shading, position, None, plane, &mut sampler, &mut rays);
            sum += found.0.direct.x / f32::from(SAMPLES);
            variance += found.1.unwrap_or(0.0) / f32::from(SAMPLES);
        }
        (sum, variance, rays.shadow)
    }

    #[test]
    fn what_sees_all_of_a_lamp_takes_one_shadow_ray_and_has_no_noise() {
        let scene = scene(0.3);
        let position = UVec2::new(4, 8);
        let (with, no_variance, rays) = light(&scene, position, Shadows::new(&scene, position, SIZE));
        let (without, variance, all) = light(&scene, position, None);
        assert_eq!([rays, all], [1, 4 * 1024]);
        assert!((with / without - 1.0).abs() < 1e-4, "{with}, {without} by rays");
        assert!(no_variance == 0.0 && variance > 0.0, "{no_variance}, {variance} by rays");
    }

    #[test]
    fn half_shadows_are_as_without() {
        let scene = scene(0.3);
        let mut shaded = 0;
        for x in 4..16 {
            let position = UVec2::new(x, 8);
            let with = light(&scene, position, Shadows::new(&scene, position, SIZE));
            let without = light(&scene, position, None);
            if with.2 == without.2 {
                assert_eq!(with, without, "pixel {x}");
                shaded += 1;
            }
        }
        assert!((2..11).contains(&shaded), "{shaded} of 12 in the half shadow");
    }

    #[test]
    fn where_nothing_is_to_be_gained_nothing_is_asked() {
        let with = |count: usize, environment| {
            let lamp = PunctualLight::Point { position: Vec3::Y, intensity: Vec3::ONE };
            let lights = vec![lamp; count];
            Scene::new(Description { lights, environment, ..Description::default() }).unwrap()
        };
        let asks = |scene: &Scene| Shadows::new(scene, UVec2::ZERO, SIZE).is_some();
        let sky = Some(scene::Environment::sky());
        assert_eq!([0, 1, 8, 9].map(|count| asks(&with(count, None))), [false, true, true, false]);
        assert_eq!([0, 1].map(|count| asks(&with(count, sky.clone()))), [false, true]);
    }
}
