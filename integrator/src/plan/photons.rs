//! How many photons there are.

use scene::Scene;

use super::{noise, round, sample_quality};
use crate::{SecondaryKind, Settings};

/// What photon maps take.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PhotonPlan {
    /// Photons to shoot into the global map.
    pub(crate) global: u32,
    /// Photons to shoot into the caustic map, 0 where nothing refracts or mirrors.
    pub(crate) caustic: u32,
    /// Photons in the disc over which each of them spreads its flux.
    pub(crate) neighbours: u32,
    /// What decides whether there should be more of them.
    pub(crate) need: Option<CausticBudget>,
}

/// Photons of the global map at quality 1.
const GLOBAL: f32 = 400_000.0;
/// Photons of the caustic map at quality 1, and those in the disc of each, where no more are needed.
const CAUSTIC: f32 = 200_000.0;
const NEIGHBOURS: f32 = 60.0;
/// Most caustic photons a pixel at quality 1: beyond, they would take more time than all else. And most altogether: a
/// million takes 140 MB while discs are made.
const MOST_A_PIXEL: f32 = 32.0;
const MOST: f32 = 4e6;
/// The noise of caustics, as a share of that of primary samples.
const CAUSTIC_NOISE: f32 = 0.1;

impl PhotonPlan {
    pub(super) fn new(scene: &Scene, settings: &Settings, secondary: SecondaryKind) -> Self {
        let features = scene.features();
        let Settings { quality, study, .. } = settings;
        let lit = !scene.lights().is_empty();
        // The noise of caustics is that of the number in a disc, their blur that of its size: above quality 1 both grow
        // less, about alike.
        let finer = quality.max(1.0).sqrt();
        let shot =
            |photons: f32| study.photons.unwrap_or_else(|| round(photons * quality.sqrt(), 20_000.0, 10_000_000.0));
        let is_global = lit && features.diffuse && secondary == SecondaryKind::Photons;
        let most = (MOST_A_PIXEL * settings.size.element_product() as f32).min(MOST) * quality.powf(0.75);
        Self {
            global: if is_global { shot(GLOBAL) } else { 0 },
            caustic: if lit && features.delta { shot(CAUSTIC * finer) } else { 0 },
            neighbours: round(NEIGHBOURS * finer.powf(4.0 / 3.0), NEIGHBOURS, 400.0),
            need: (study.photons.is_none() && secondary == SecondaryKind::Cells).then(|| CausticBudget {
                side: round(64.0 * quality.sqrt().sqrt(), 32.0, 128.0),
                noise: CAUSTIC_NOISE * noise(sample_quality(settings)),
                most: round(most, 20_000.0, 10_000_000.0),
            }),
        }
    }
}

/// What decides how many photons a caustic map gets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CausticBudget {
    /// Primary rays along a side of the picture that look for caustics.
    pub(crate) side: u32,
    /// The noise that is wanted.
    pub(crate) noise: f32,
    /// Most photons, whatever the noise.
    pub(crate) most: u32,
}

impl CausticBudget {
    /// Returns how many photons there should be, and how many of them in a disc, if the caustics of the picture have
    /// this `noise` by `photons` with `neighbours` in a disc. Noise and blur are to fall alike, the one by the number
    /// in a disc, the other by its size.
    pub(crate) fn refined(&self, photons: u32, neighbours: u32, noise: f32) -> (u32, u32) {
        /// Less is not worth to spread all of them again.
        const WORTH: f32 = 1.25;
        let wanted = (noise / self.noise).powf(1.5).min(self.most as f32 / photons as f32);
        if wanted < WORTH {
            return (photons, neighbours);
        }
        Self::times(photons, neighbours, wanted)
    }

    /// So many times the photons, and as many more in a disc as keep noise and blur in step.
    pub(crate) fn times(photons: u32, neighbours: u32, factor: f32) -> (u32, u32) {
        let times = |number: u32, factor: f32| round(number as f32 * factor, 1.0, 20_000_000.0);
        (times(photons, factor), times(neighbours, factor.powf(2.0 / 3.0)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photons_are_as_many_as_noise_asks_for() {
        let budget = CausticBudget { side: 64, noise: 1e-4, most: 8_000_000 };
        assert_eq!(budget.refined(400_000, 80, 0.9e-4), (400_000, 80), "enough");
        assert_eq!(budget.refined(400_000, 80, 1.1e-4), (400_000, 80), "hardly too few");
        assert_eq!(
            budget.refined(400_000, 80, 4e-4),
            (3_200_000, 320),
            "a quarter of the noise by four times the photons in a disc"
        );
        assert_eq!(budget.refined(400_000, 80, 1.0).0, 8_000_000, "the limit");
        assert_eq!(budget.refined(9_000_000, 80, 1.0), (9_000_000, 80), "above it already");
    }
}
