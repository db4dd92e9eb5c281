//! Lamps that gloss sees through glass: a bulb in its shell, a lamp beyond a pane.
//!
//! Samples of a lobe meet such a lamp as seldom as it is small, and then find all of its light: dots. Light samples end
//! at the glass. So those of a glossy surface that do look on along their direction, as a sample of the lobe does, and
//! the two share what they find by the power heuristic. For light samples the direction is that of the straight line,
//! as if glass did not bend it. Of a lamp behind thin glass both find nearly all; what thick glass throws aside is left
//! to the lobe.

use glam::{Vec3, Vec3A};
use scene::{Scene, SeenLights, Specular, Surface};

use crate::secondary::{Shading, mis_weight};
use crate::statistics::RayCounts;

/// A lamp on a straight line through glass.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LampBehind {
    /// Density with which light samples take this direction, per steradian.
    pub(crate) pdf: f32,
    /// Which of the lights it is.
    pub(crate) light: usize,
    /// Where the line meets glass first.
    pub(crate) glass: Surface,
}

/// Boundaries of glass before a lamp, at most.
const MAX_BOUNDARIES: usize = 16;

impl LampBehind {
    /// Whether light samples of a surface look on through glass.
    pub(crate) fn is_wanted(scene: &Scene, shading: &Shading) -> bool {
        let features = scene.features();
        features.transmissive && features.area_lights && shading.bsdf.has_glossy()
    }

    /// Looks from a surface along the unit vector `wi`, as `lights` are seen from there; `None` where the first thing
    /// behind glass is no lamp that is sampled, or there is no glass.
    pub(crate) fn new(
        scene: &Scene,
        surface: &Surface,
        wi: Vec3A,
        lights: &SeenLights<'_>,
        rays: &mut RayCounts,
    ) -> Option<Self> {
        let (mut from, mut glass) = (*surface, None);
        for _ in 0..=MAX_BOUNDARIES {
            let ray = from.spawn(wi);
            rays.shadow += 1;
            let met = scene.surface(&ray, &scene.intersect(&ray)?);
            if scene.emission(&met) != Vec3::ZERO {
                let (glass, (light, pdf)) = glass.zip(lights.light_at(wi, &met))?;
                return (pdf > 0.0).then_some(Self { pdf, light, glass });
            }
            if !matches!(scene.bsdf(&met).specular, Specular::Dielectric { .. }) {
                return None;
            }
            glass = glass.or(Some(met));
            from = met;
        }
        None
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
    use scene::{Description, Environment, Lobes, Material, Mesh, PunctualLight, Ray, SpecularKind};

    use super::*;
    use crate::plan::Plan;
    use crate::sampler::Sampler;
    use crate::secondary::tests::square;
    use crate::terms::direct::tests::term;
    use crate::terms::reuse::tests::{mean, variance};
    use crate::{Rng, Settings};

    /// A floor of metal under a pane, whose upper face is at a height of 0.7 m, and that under a lamp of 0.2 m at 1 m.
    /// With `others`, a second lamp hangs beside it, and there are a sky and a sun behind the lamp.
    fn lamp_over_pane(thickness: f32, others: bool) -> Scene {
        let kind = SpecularKind::Dielectric { ior: 1.5, tint: Vec3::ONE, absorption: Vec3::ZERO, priority: 0 };
        let glass = Material { diffuse: Vec3::ZERO, specular: kind, ..Material::default() };
        let gloss = SpecularKind::Ggx { alpha: 0.25, reflectance: Vec3::splat(0.5), schlick: false };
        let floor = Material { diffuse: Vec3::splat(0.3), specular: gloss, ..Material::default() };
        let lit = Material { diffuse: Vec3::ZERO, emission: Vec3::ONE, ..Material::default() };
        let blue = Material { emission: Vec3::new(0.0, 0.5, 2.0), ..lit.clone() };
        let second = square(0.15, 1.1).map(|p| p + Vec3::new(0.3, 0.0, 0.1));
        let squares = [square(5.0, 0.0), square(5.0, 0.7 - thickness), square(5.0, 0.7), square(0.1, 1.0), second];
        let up = |first: u32| [[first, first + 2, first + 1], [first, first + 3, first + 2]];
        let down = |first: u32| [[first, first + 1, first + 2], [first, first + 2, first + 3]];
        let mesh = Mesh {
            positions: squares.concat(),
            triangles: [up(0), down(4), up(8), down(12), down(16)][..if others { 5 } else { 4 }].concat(),
            materials: vec![0, 0, 1, 1, 1, 1, 2, 2, 3, 3][..if others { 10 } else { 8 }].to_vec(),
            ..Mesh::default()
        };
        let sun = PunctualLight::Directional { direction: Vec3::new(0.8, -1.0, 0.0), irradiance: Vec3::ONE };
        Scene::new(Description {
            meshes: vec![mesh],
            materials: vec![floor, glass, lit, blue],
            lights: if others { vec![sun] } else { vec![] },
            environment: others.then(|| Environment::constant(Vec3::splat(0.5))),
            ..Description::default()
        })
        .unwrap()
    }

    /// The floor where an eye sees the lamp mirrored.
    fn floor(scene: &Scene) -> Shading {
        let ray = Ray::new(Vec3A::new(1.04, 0.3, 0.0), Vec3A::new(-0.4, -0.5, 0.0).normalize());
        Shading::new(scene, scene.surface(&ray, &scene.intersect(&ray).unwrap()), ray.direction)
    }

    #[test]
    fn gloss_finds_a_lamp_behind_glass_by_light_samples_too() {
        // Thick glass throws the lamp aside by half of its width.
        for (thickness, others, most) in [(0.01, false, 0.1), (0.3, false, 0.9), (0.01, true, 0.9)] {
            let scene = lamp_over_pane(thickness, others);
            let (plan, shading) = (Plan::new(&scene, &Settings::default()), floor(&scene));
            let (term, mut rays) = (term(&scene, &plan), RayCounts::default());
            let both: Vec<f64> = (0..20_000)
                .map(|pixel| {
                    let mut sampler = Sampler::new(1, pixel, 0);
                    let (light, _) = term.sample(&shading, UVec2::ZERO, Some(1.0), None, &mut sampler, &mut rays);
                    assert!(others || light.direct == Vec3::ZERO, "all of it comes by glass");
                    f64::from(light.specular.element_sum())
                })
                .collect();
            let count = u64::from(plan.lobes.rays(&shading, 1.0));
            let alone: Vec<f64> = (0..20_000)
                .map(|pixel| {
                    let looks = (0..count).filter_map(|number| {
                        let mut sampler = Sampler::new(2, pixel * count + number, 0);
                        let way = term.lobe_way(&shading, &mut sampler)?;
                        let sight = term.look_along(&shading, way.wi, &mut sampler, &mut rays);
                        Some(f64::from((way.weight * sight.reflected()).element_sum()) / count as f64)
                    });
                    looks.sum()
                })
                .collect();
            let error = ((variance(&both) + variance(&alone)) / 20_000.0).sqrt();
            let (found, expected) = (mean(&both), mean(&alone));
            assert!(error < 0.03 * expected, "{expected} +- {error} says nothing");
            assert!((found - expected).abs() < 4.0 * error, "{thickness}: {found}, {expected} by the lobe, +- {error}");
            let ratio = variance(&both) / variance(&alone);
            assert!(ratio < most, "{thickness}, {others}: {ratio} of the variance");
        }
    }

    #[test]
    fn lobes_and_light_samples_tell_of_the_same_lamp() {
        let scene = lamp_over_pane(0.01, false);
        let Shading { surface, frame, wo, bsdf } = floor(&scene);
        let (mut rng, mut met, mut rays) = (Rng::new(3, 0), 0, RayCounts::default());
        let mut lights = scene.lights().seen_from(surface.p, surface.n);
        for _ in 0..2000 {
            let light = lights.direction(rng.next_1d(), rng.next_2d()).expect("the only lamp");
            let (wi, pdf) = (light.wi(), light.sample().expect("it shines").pdf);
            let lamp = LampBehind::new(&scene, &surface, wi, &lights, &mut rays).expect("behind the pane");
            assert!(lamp.light == light.light() && (lamp.pdf / pdf - 1.0).abs() < 1e-3, "{lamp:?}, {pdf}");
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
