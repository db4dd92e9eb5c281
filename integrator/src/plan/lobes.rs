//! How glossy lobes find their light.

use scene::{Lobes, Scene};

use super::{learners, noise, power_of_two, sample_quality, wanted_texture_alpha};
use crate::Settings;
use crate::secondary::Shading;

/// What gloss takes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LobePlan {
    /// Narrowest lobe that reads its light from a texture; narrower ones are traced.
    texture_alpha: f32,
    /// Most rays that are traced through a lobe for a primary sample, where neighbours do not share them.
    most_rays: u32,
    /// Mean square of the relative error that is wanted of lobes whose samples are shared by neighbours, of wide ones
    /// less, see [`Self::noise_weight`]; 0 where none are.
    pub(crate) noise: f32,
    /// Most batches of their samples that a tile of the picture takes; a power of two.
    pub(crate) batches: u32,
    /// Things that move farther within a lobe from the middle of these neighbours to their ends may hide others from
    /// some of them: in widths of the lobe.
    pub(crate) parallax: f32,
    /// Primary rays along a side of the picture by which lobes learn from where their light comes; 0 where they do not.
    pub(crate) learners: u32,
}

/// The noise of shared lobes, as a share of that of primary samples, which are better stratified.
const SHARED_NOISE: f32 = 0.06;

impl LobePlan {
    /// What lobes take beside textures of `n x n` texels.
    pub(super) fn new(scene: &Scene, settings: &Settings, n: usize) -> Self {
        let has_gloss = scene.features().glossy;
        let study = &settings.study;
        let quality = sample_quality(settings);
        let is_shared = has_gloss && study.lobe_reuse != Some(false);
        let is_learnt = has_gloss && study.lobe_guide != Some(false);
        Self {
            texture_alpha: wanted_texture_alpha(settings).max(3.0 / n as f32),
            most_rays: study.lobe_rays.unwrap_or(12),
            noise: if is_shared { SHARED_NOISE * noise(quality) } else { 0.0 },
            batches: power_of_two(64.0 * quality.max(quality.sqrt())),
            parallax: 0.75 * settings.quality.max(1.0).sqrt().recip(),
            learners: if is_learnt { learners(settings) } else { 0 },
        }
    }

    /// Whether the glossy lobe of a point is traced, not read from a texture. Where there is a diffuse part too, a
    /// texture would serve the lobe alone, for that part is interpolated.
    pub(crate) fn traces(&self, shading: &Shading) -> bool {
        shading.bsdf.has_glossy() && (shading.bsdf.has_diffuse() || shading.lobe_alpha() < self.texture_alpha)
    }

    /// Whether a point takes its glossy part from a texture.
    pub(crate) fn reads_texture(&self, shading: &Shading) -> bool {
        shading.bsdf.has_glossy() && !self.traces(shading)
    }

    /// Whether a primary sample that met no mirror before leaves its lobe to the points of its tile.
    pub(crate) fn shares(&self, shading: &Shading) -> bool {
        /// Narrower lobes see too little that is the same.
        const MIN_ALPHA: f32 = 0.04;
        self.noise > 0.0 && self.traces(shading) && shading.lobe_alpha() >= MIN_ALPHA
    }

    /// How many times the noise of a shared lobe counts: wide ones see so much that is the same that a few more rays
    /// take much of it away. In a Cornell box with metal, time times noise is least with 1 to 1.5 at alpha = 0.2 and
    /// with 1.5 to 4 at 0.4; and so the widest that are traced take about as long as the narrowest that read textures.
    pub(crate) fn noise_weight(shading: &Shading) -> f32 {
        /// Lobes that are not wider count once.
        const NARROW: f32 = 0.2;
        (shading.lobe_alpha() / NARROW).max(1.0)
    }

    /// How many rays a primary sample traces through its glossy lobe: fewer where the lobe is a small part of the
    /// reflected light, or so narrow that it sees about the same everywhere, and of these a `share` for a sample of
    /// which little comes to the eye; one for the lamps alone where a texture has the rest.
    pub(crate) fn rays(&self, shading: &Shading, share: f32) -> u32 {
        /// From this width on a lobe takes its full number.
        const FULL_ALPHA: f32 = 0.1;
        if !self.traces(shading) {
            return 1;
        }
        let needed =
            shading.bsdf.specular_probability(Lobes::ALL, shading.wo) * (shading.lobe_alpha() / FULL_ALPHA).min(1.0);
        // A power of two, for samples of a pixel are stratified together where they take the same number.
        let share = share.min(1.0).log2().ceil().exp2();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most the plan's number")]
        let count = (self.most_rays as f32 * needed * share).ceil() as u32;
        count.max(1)
    }

    /// Whether a glossy lobe is traced with so many rays, see [`Self::rays`], that it shares them with a guide, and is
    /// wide enough for its cells.
    pub(crate) fn guides(&self, shading: &Shading, rays: u32) -> bool {
        /// About half the width of a cell, radians.
        const MIN_ALPHA: f32 = 0.08;
        const MIN_RAYS: u32 = 4;
        self.learners > 0 && shading.lobe_alpha() >= MIN_ALPHA && rays >= MIN_RAYS
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3A;
    use scene::Ray;

    use super::*;
    use crate::secondary::tests::lamp_over_metal;

    #[test]
    fn noise_of_wide_lobes_counts_more() {
        let weight = |alpha| {
            let scene = lamp_over_metal(alpha);
            let ray = Ray::new(Vec3A::new(2.0, 1.0, 0.0), Vec3A::NEG_Y);
            let surface = scene.surface(&ray, &scene.intersect(&ray).expect("the floor"));
            LobePlan::noise_weight(&Shading::new(&scene, surface, ray.direction))
        };
        assert_eq!([0.05, 0.2, 0.4].map(weight), [1.0, 1.0, 2.0]);
    }

    #[test]
    fn low_qualities_bound_what_hopeless_tiles_take() {
        let scene = lamp_over_metal(0.1);
        let batches = |quality| {
            let settings = Settings { quality, ..Settings::default() };
            LobePlan::new(&scene, &settings, 32).batches
        };
        assert_eq!([0.001, 0.0625, 1.0, 4.0].map(batches), [2, 16, 64, 256]);
    }
}
