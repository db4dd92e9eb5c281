//! How many primary samples and light samples a picture takes.

use scene::Scene;

use super::{learners, noise, power_of_two, round};
use crate::Settings;
use crate::allocation::Budget;

/// What direct light takes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SamplePlan {
    /// Primary samples that each pixel takes before more are given to those that need them, and what decides how many.
    pub(crate) first_spp: u32,
    pub(crate) budget: Budget,
    /// Light samples a primary sample.
    pub(crate) light_samples: u32,
    /// Primary rays along a side of the picture by which is learnt which lights reach what it shows; 0 where there is
    /// one at most.
    pub(crate) light_learners: u32,
    /// Whether pixels ask which lights nothing hides.
    pub(crate) clear_lights: bool,
    /// Whether direct light, if there is any, is fitted over neighbouring pixels.
    pub(crate) fits_direct: bool,
}

/// From so many lights on, more of them are sampled.
const MANY_LIGHTS: usize = 8;
/// Most samples a pixel at quality 1, in the mean, where that cannot be had; half of them where each takes eight light
/// samples.
const MOST_SPP: f32 = 48.0;

impl SamplePlan {
    pub(super) fn new(scene: &Scene, settings: &Settings) -> Self {
        let light_count = scene.lights().count();
        let light_samples = settings.study.light_samples.unwrap_or(match light_count {
            // Which of many is taken is most of the noise, and another one costs less than another primary ray. A lamp
            // of many triangles counts as many, surroundings as one.
            MANY_LIGHTS.. => 8,
            0 | 1 if scene.lights().are_punctual() => 1,
            _ => 4,
        });
        let (first_spp, budget) = primary_samples(settings, light_count >= MANY_LIGHTS);
        let is_learnt = light_count > 1 && settings.study.light_guide != Some(false);
        let light_learners = if is_learnt { learners(settings) } else { 0 };
        let clear_lights = settings.study.clear_lights != Some(false);
        let has_direct = light_count > 0 || scene.features().emissive_unsampled;
        let fits_direct = has_direct && settings.study.direct_fit != Some(false);
        Self { first_spp, budget, light_samples, light_learners, clear_lights, fits_direct }
    }
}

/// The samples that every pixel takes, and what decides how many more there are.
fn primary_samples(settings: &Settings, has_many_lights: bool) -> (u32, Budget) {
    let Settings { spp, quality, .. } = *settings;
    if settings.study.even_samples == Some(true) {
        let spp = spp.unwrap_or_else(|| round(16.0 * quality, 2.0, 65_536.0));
        return (spp, Budget::Mean(spp));
    }
    match spp {
        // A pixel without noise takes a quarter of the mean.
        Some(spp) => (power_of_two(spp as f32 / 4.0).max(2).min(spp), Budget::Mean(spp)),
        None => {
            let most = if has_many_lights { 0.5 * MOST_SPP } else { MOST_SPP };
            // Two tell too little of where the noise is.
            let first = power_of_two(8.0 * quality.cbrt()).max(2);
            (first, Budget::Noise(noise(quality), round(most * quality, 8.0, 65_536.0)))
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use scene::{Description, PunctualLight};

    use super::*;
    use crate::secondary::tests::lamp_over_metal;

    #[test]
    fn one_point_of_light_is_asked_once() {
        let suns = |count: usize| {
            let sun = PunctualLight::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::ONE };
            Scene::new(Description { lights: vec![sun; count], ..Description::default() }).unwrap()
        };
        let samples = |scene: &Scene| SamplePlan::new(scene, &Settings::default()).light_samples;
        assert_eq!([0, 1, 2, 8].map(|count| samples(&suns(count))), [1, 1, 4, 8]);
        assert_eq!(samples(&lamp_over_metal(0.1)), 4, "a lamp has many points");
    }
}
