//! Lamps that gloss sees through glass: a bulb in its shell, a lamp beyond a pane.
//!
//! Samples of a lobe meet such a lamp as seldom as it is small, and then find all of its light: dots. Light samples end
//! at the glass. So those of a glossy surface that do look on along their direction, as a sample of the lobe does, and
//! the two share what they find by the power heuristic. For light samples the direction is that of the straight line,
//! as if glass did not bend it. Of a lamp behind thin glass both find nearly all; what thick glass throws aside is left
//! to the lobe.

use glam::{Vec3, Vec3A};
use scene::{Scene, SeenLights, Specular, Surface};

use crate::secondary::mis_weight;
use crate::statistics::RayCounts;

/// A lamp on a straight line through glass.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LampBehind {
    /// Density with which light samples take this direction, per steradian.
    pub(crate) pdf: f32,
    /// Metres.
    pub(crate) distance: f32,
}

/// Boundaries of glass before a lamp, at most.
const MAX_BOUNDARIES: usize = 16;

impl LampBehind {
    /// Looks from a surface along the unit vector `wi`, as `lights` are seen from there; `None` where the first thing
    /// behind glass is no lamp that is sampled, or there is no glass.
    pub(crate) fn new(
        scene: &Scene,
        surface: &Surface,
        wi: Vec3A,
        lights: &SeenLights<'_>,
        rays: &mut RayCounts,
    ) -> Option<Self> {
        let (mut from, mut distance) = (*surface, 0.0);
        for boundaries in 0..=MAX_BOUNDARIES {
            let ray = from.spawn(wi);
            rays.shadow += 1;
            let met = scene.surface(&ray, &scene.intersect(&ray)?);
            distance += met.t;
            if scene.emission(&met) != Vec3::ZERO {
                let pdf = if boundaries > 0 { lights.pdf_surface(wi, &met) } else { 0.0 };
                return (pdf > 0.0).then_some(Self { pdf, distance });
            }
            if !matches!(scene.bsdf(&met).specular, Specular::Dielectric { .. }) {
                return None;
            }
            from = met;
        }
        None
    }

    /// Whether it is the one at the end of a light sample.
    pub(crate) fn is_at(&self, distance: f32) -> bool {
        /// Rays start off surfaces.
        const TOLERANCE: f32 = 1e-3;
        (self.distance - distance).abs() <= TOLERANCE * distance
    }
}

/// What a sample of a lobe of density `pdf` counts of a lamp that it sees through glass, beside light samples: that
/// lamp is not where they look, or it is this one.
pub(crate) fn lobe_share(lamp: Option<LampBehind>, pdf: f32) -> f32 {
    lamp.map_or(1.0, |lamp| mis_weight(pdf, lamp.pdf))
}

#[cfg(test)]
mod tests {
    use glam::UVec2;
    use scene::{Description, Lobes, Material, Mesh, Ray, SpecularKind};

    use super::*;
    use crate::plan::Plan;
    use crate::sampler::Sampler;
    use crate::secondary::Shading;
    use crate::secondary::tests::square;
    use crate::terms::direct::tests::term;
    use crate::terms::reuse::tests::{mean, variance};
    use crate::{Rng, Settings};

    /// A floor of metal under a pane, whose upper face is at a height of 0.7 m, and that under a lamp of 0.2 m at 1 m.
    fn lamp_over_pane(thickness: f32) -> Scene {
        let kind = SpecularKind::Dielectric { ior: 1.5, tint: Vec3::ONE, absorption: Vec3::ZERO, priority: 0 };
        let glass = Material { diffuse: Vec3::ZERO, specular: kind, ..Material::default() };
        let gloss = SpecularKind::Ggx { alpha: 0.25, reflectance: Vec3::splat(0.5), schlick: false };
        let floor = Material { diffuse: Vec3::splat(0.3), specular: gloss, ..Material::default() };
        let lit = Material { diffuse: Vec3::ZERO, emission: Vec3::ONE, ..Material::default() };
        let squares = [square(5.0, 0.0), square(5.0, 0.7 - thickness), square(5.0, 0.7), square(0.1, 1.0)];
        let up = |first: u32| [[first, first + 2, first + 1], [first, first + 3, first + 2]];
        let down = |first: u32| [[first, first + 1, first + 2], [first, first + 2, first + 3]];
        let mesh = Mesh {
            positions: squares.concat(),
            triangles: [up(0), down(4), up(8), down(12)].concat(),
            materials: vec![0, 0, 1, 1, 1, 1, 2, 2],
            ..Mesh::default()
        };
        let materials = vec![floor, glass, lit];
        Scene::new(Description { meshes: vec![mesh], materials, ..Description::default() }).unwrap()
    }

    /// The floor where an eye sees the lamp mirrored.
    fn floor(scene: &Scene) -> Shading {
        let ray = Ray::new(Vec3A::new(1.04, 0.3, 0.0), Vec3A::new(-0.4, -0.5, 0.0).normalize());
        Shading::new(scene, scene.surface(&ray, &scene.intersect(&ray).unwrap()), ray.direction)
    }

    #[test]
    fn gloss_finds_a_lamp_behind_glass_by_light_samples_too() {
        // Thick glass throws the lamp aside by half of its width.
        for thickness in [0.01, 0.3] {
            let scene = lamp_over_pane(thickness);
            let (plan, shading) = (Plan::new(&scene, &Settings::default()), floor(&scene));
            let (term, mut rays) = (term(&scene, &plan), RayCounts::default());
            let both: Vec<f64> = (0..20_000)
                .map(|pixel| {
                    let mut sampler = Sampler::new(1, pixel, 0);
                    let (light, _) = term.sample(&shading, UVec2::ZERO, Some(1.0), None, &mut sampler, &mut rays);
                    assert_eq!(light.direct, Vec3::ZERO, "all of it comes by glass");
                    f64::from(light.specular.x)
                })
                .collect();
            let count = u64::from(plan.lobes.rays(&shading, 1.0));
            let alone: Vec<f64> = (0..20_000)
                .map(|pixel| {
                    let looks = (0..count).filter_map(|number| {
                        let mut sampler = Sampler::new(2, pixel * count + number, 0);
                        let way = term.lobe_way(&shading, &mut sampler)?;
                        let sight = term.look_along(&shading, way.wi, &mut sampler, &mut rays);
                        Some(f64::from((way.weight * sight.reflected()).x) / count as f64)
                    });
                    looks.sum()
                })
                .collect();
            let error = ((variance(&both) + variance(&alone)) / 20_000.0).sqrt();
            let (found, expected) = (mean(&both), mean(&alone));
            assert!(error < 0.03 * expected, "{expected} +- {error} says nothing");
            assert!((found - expected).abs() < 4.0 * error, "{thickness}: {found}, {expected} by the lobe, +- {error}");
            let ratio = variance(&both) / variance(&alone);
            assert!(ratio < if thickness < 0.1 { 0.1 } else { 0.9 }, "{thickness}: {ratio} of the variance");
        }
    }

    #[test]
    fn lobes_and_light_samples_tell_of_the_same_lamp() {
        let scene = lamp_over_pane(0.01);
        let Shading { surface, frame, wo, bsdf } = floor(&scene);
        let (mut rng, mut met, mut rays) = (Rng::new(3, 0), 0, RayCounts::default());
        let mut lights = scene.lights().seen_from(surface.p, surface.n);
        for _ in 0..2000 {
            let light = lights.direction(rng.next_1d(), rng.next_2d()).expect("the only lamp");
            let (wi, distance, pdf) = (light.wi(), light.distance(), light.sample().expect("it shines").pdf);
            let lamp = LampBehind::new(&scene, &surface, wi, &lights, &mut rays).expect("behind the pane");
            assert!(lamp.is_at(distance) && (lamp.pdf / pdf - 1.0).abs() < 1e-3, "{lamp:?}, {distance} m, {pdf}");
            // Directions of the lobe that miss the lamp have no other technique.
            let Some(sample) = bsdf.sample(Lobes::SPECULAR, wo, 0.5, rng.next_2d()) else { continue };
            let lamp = LampBehind::new(&scene, &surface, frame.to_world(sample.wi), &lights, &mut rays);
            met += u32::from(lamp.is_some());
            let share = lobe_share(lamp, sample.pdf);
            assert!(if lamp.is_some() { share < 0.01 } else { share == 1.0 }, "{share}");
        }
        assert!((1..200).contains(&met), "{met} of 2000");
    }
}
