//! What this scene needs, and what each method spends at a given quality. What is absent is never allocated or traced.

use radcache::{MergeSettings, RecordSettings, Validity};
use scene::Scene;

use crate::allocation::Budget;
use crate::{Method, SecondaryKind, Settings};

/// The decisions of a rendering by the four-term methods.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Plan {
    /// Where gather rays take their light from.
    pub(crate) secondary: SecondaryKind,
    /// Primary samples that each pixel takes before more are given to those that need them, and what decides how many.
    pub(crate) first_spp: u32,
    pub(crate) budget: Budget,
    /// Light samples a primary sample.
    pub(crate) light_samples: u32,
    /// Resolution of a gather that becomes a record, and of one that does not, see [`Plan::look_n_at`].
    pub(crate) n: usize,
    pub(crate) look_n: usize,
    /// Side of a square picture of as many pixels.
    pub(crate) side: f32,
    /// Size of the scene, metres.
    pub(crate) scene_size: f32,
    /// How records are made.
    pub(crate) record: RecordSettings,
    /// Reach of records, as a share of the harmonic mean distance.
    pub(crate) spacing: f32,
    /// Error that a record of irradiance may sum to over its ellipse, relative to its irradiance and to the picture: 1 is an error of 100 % on
    /// all of it. Of one that is gathered, and of one that is reprojected.
    pub(crate) error: f32,
    pub(crate) reprojected_error: f32,
    /// Whether records of irradiance reach as far as the Hessian says.
    pub(crate) by_hessian: bool,
    /// Whether they know the gradients, stop at walls, reach little farther than their neighbours and leave gaps to others.
    pub(crate) gradients: bool,
    pub(crate) walls: bool,
    pub(crate) clamp: bool,
    pub(crate) gaps: bool,
    /// How far any record reaches, as a share of the scene, and of what the picture shows there.
    pub(crate) max_share: f32,
    /// Whether texels between bright and dark, and at the rim of the sky, are divided.
    pub(crate) divide: bool,
    /// Whether highlights are traced anew.
    pub(crate) highlights: bool,
    /// How reprojections are made.
    pub(crate) reproject: reproject::Settings,
    /// Texels along a side of the largest blocks of holes for which one ray stands.
    pub(crate) hole_step: u32,
    /// Verification rays along a side.
    pub(crate) verify_side: u32,
    /// Photons to shoot into the global map.
    pub(crate) global_photons: u32,
    /// Photons to shoot into the caustic map, 0 where nothing refracts or mirrors.
    pub(crate) caustic_photons: u32,
    /// Photons in the disc over which each of them spreads its flux.
    pub(crate) caustic_neighbours: u32,
    /// What decides whether there should be more of them.
    pub(crate) caustic_need: Option<CausticBudget>,
    /// Rays to spend on the links of cells, 0 where there are none.
    pub(crate) cell_rays: u32,
    /// Gather rays of each probe that finds cells.
    pub(crate) probe_rays: u32,
    /// Narrowest glossy lobe that reads its light from a texture; narrower ones are traced.
    pub(crate) texture_alpha: f32,
    /// Rays that are traced through a glossy lobe for each primary sample, where neighbours do not share them.
    pub(crate) lobe_rays: u32,
    /// Mean square of the relative error that is wanted of lobes whose samples are shared by neighbours; 0 where none are.
    pub(crate) lobe_noise: f32,
    /// Most batches of their samples that a tile of the picture takes; a power of two.
    pub(crate) lobe_batches: u32,
    /// Things that move farther within a lobe from the middle of these neighbours to their ends may hide others from some of them: in widths of the lobe.
    pub(crate) lobe_parallax: f32,
    /// Primary rays along a side of the picture by which glossy lobes learn from where their light comes; 0 where they do not.
    pub(crate) learners: u32,
    /// The same by which is learnt which lights reach what the picture shows; 0 where there is one at most.
    pub(crate) light_learners: u32,
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
    /// Returns how many photons there should be, and how many of them in a disc, if the caustics of the picture have this `noise` by `photons` with `neighbours` in a
    /// disc. Noise and blur are to fall alike, the one by the number in a disc, the other by its size.
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

impl Plan {
    pub(crate) fn new(scene: &Scene, settings: &Settings) -> Self {
        let features = scene.features();
        let quality = settings.quality;
        let study = &settings.study;
        let secondary = study.secondary.unwrap_or_default();
        let texture_alpha = study.texture_alpha.unwrap_or(0.5);
        let has_textures = features.widest_metal >= texture_alpha.max(f32::MIN_POSITIVE);
        // The rim of a window in the sky and a lobe need more texels than irradiance does. Where a point may look for itself instead, by which it sees more for
        // the same time, records of radiance reach less far: least where a look is cheap, as it is not with the rim of a sky in it. Without sky and textures
        // reprojection takes no less time than the rays of a look, so that only points close to a record ask it.
        let (record_n, look_n, spacing) = match (features.environment, has_textures) {
            (true, _) => (48.0, 24.0, 0.15),
            (false, true) => (40.0, 20.0, 0.2),
            (false, false) => (32.0, 20.0, 0.03),
        };
        // With a cache, twice the time is shared by the number of records and by their rays.
        let with_cache = |base: f32| round(base * quality.sqrt().sqrt(), 8.0, 64.0);
        let alone = round(GATHER_RESOLUTION * quality.sqrt(), 4.0, 64.0);
        let (n, look_n) = match settings.method {
            Method::Reproject => (with_cache(record_n), with_cache(look_n)),
            Method::CacheOnly => (with_cache(look_n), with_cache(look_n)),
            Method::Gather | Method::Path => (alone, alone),
        };
        let n = study.resolution.unwrap_or(n);
        let (n, look_n) = (n as usize, look_n.min(n) as usize);
        let light_count = scene.lights().count();
        let light_samples = study.light_samples.unwrap_or(match light_count {
            // Which of many is taken is most of the noise, and another one costs less than another primary ray. A lamp of many triangles counts as many,
            // surroundings as one.
            MANY_LIGHTS.. => 8,
            0 | 1 if scene.lights().are_punctual() => 1,
            _ => 4,
        });
        let (first_spp, budget) = primary_samples(settings, light_count >= MANY_LIGHTS);
        // The noise of caustics is that of the number in a disc, their blur that of its size: above quality 1 both grow less, about alike.
        let finer = quality.max(1.0).sqrt();
        let shot =
            |photons: f32| study.photons.unwrap_or_else(|| round(photons * quality.sqrt(), 20_000.0, 10_000_000.0));
        let lit = !scene.lights().is_empty();
        let error = study.error.unwrap_or(1e-4 / quality);
        // Links that end in a window, or at a lamp by way of gloss, are few and bright.
        let links = if features.glossy || features.environment { 500_000.0 } else { 250_000.0 };
        let learners = round(128.0 * quality.sqrt().sqrt(), 48.0, 256.0).min(settings.size.max_element());
        // About the quality that takes so many samples.
        let lobe_quality = settings.spp.map_or(quality, |spp| spp as f32 / 16.0);
        // A glossy lobe sees single elements, so these must not blur light; irradiance does not care.
        let max_contrast = if has_textures { 0.1 } else { 2.0 };
        Self {
            secondary,
            first_spp,
            budget,
            light_samples,
            n,
            look_n,
            side: (settings.size.element_product() as f32).sqrt(),
            scene_size: 2.0 * scene.bounds().radius(),
            record: RecordSettings {
                layers: study.layers.unwrap_or(16) as usize,
                merge: MergeSettings { max_contrast, ..study.merge_settings() },
            },
            spacing: study.spacing.unwrap_or(spacing),
            // The sky between near things ends more sharply than the Hessian of so few texels tells.
            error: if settings.method == Method::Reproject && features.environment { 0.5 * error } else { error },
            // They cost less, so there are more of them.
            reprojected_error: 0.5 * error,
            by_hessian: study.by_distance != Some(true),
            gradients: study.gradients != Some(false),
            walls: study.walls != Some(false),
            clamp: study.clamp != Some(false),
            gaps: study.gaps != Some(false),
            max_share: if study.limit == Some(false) { f32::MAX } else { MAX_SHARE },
            divide: study.divide != Some(false),
            highlights: study.highlights != Some(false),
            reproject: reproject::Settings {
                coverage: study.coverage(),
                trails: study.trails.unwrap_or_default(),
                weights: study.weights(),
                margins: study.margins != Some(false),
                doubt: study.doubt != Some(false),
            },
            // One lobe sees so few holes that the noise of each ray counts, and a ray that meets gloss may find a highlight.
            hole_step: study.step.unwrap_or(if features.glossy { 1 } else { 2 }),
            verify_side: study.verify.unwrap_or(2),
            global_photons: if lit && features.diffuse && secondary == SecondaryKind::Photons {
                shot(GLOBAL_PHOTONS)
            } else {
                0
            },
            caustic_photons: if lit && features.delta { shot(CAUSTIC_PHOTONS * finer) } else { 0 },
            caustic_need: (study.photons.is_none() && secondary == SecondaryKind::Cells).then(|| CausticBudget {
                side: round(64.0 * quality.sqrt().sqrt(), 32.0, 128.0),
                noise: CAUSTIC_NOISE * noise(lobe_quality),
                most: round(
                    (PIXEL_PHOTONS * settings.size.element_product() as f32).min(MOST_PHOTONS) * quality.powf(0.75),
                    20_000.0,
                    10_000_000.0,
                ),
            }),
            caustic_neighbours: round(NEIGHBOURS * finer.powf(4.0 / 3.0), NEIGHBOURS, 400.0),
            cell_rays: if features.diffuse && secondary == SecondaryKind::Cells {
                round(links * quality.powf(0.75), 50_000.0, 50_000_000.0)
            } else {
                0
            },
            probe_rays: round(24.0 * quality.sqrt(), 8.0, 96.0),
            texture_alpha: texture_alpha.max(3.0 / n as f32),
            lobe_rays: study.lobe_rays.unwrap_or(12),
            lobe_noise: if features.glossy && study.lobe_reuse != Some(false) {
                LOBE_NOISE * noise(lobe_quality)
            } else {
                0.0
            },
            lobe_batches: power_of_two(64.0 * lobe_quality.max(1.0)),
            lobe_parallax: 0.75 * quality.max(1.0).sqrt().recip(),
            learners: if features.glossy && study.lobe_guide != Some(false) { learners } else { 0 },
            light_learners: if light_count > 1 && study.light_guide != Some(false) { learners } else { 0 },
        }
    }

    /// Resolution of a look from a point that was asked on the lattice of this stride, where there are records of radiance. Points that are asked late and
    /// have no record lie in reliefs and corners, and serve few others.
    pub(crate) fn look_n_at(&self, stride: usize) -> usize {
        let share = match stride {
            1 if self.look_n < self.n => 2.0 / 3.0,
            2 if self.look_n < self.n => 5.0 / 6.0,
            _ => 1.0,
        };
        round(self.look_n as f32 * share, 1.0, 64.0) as usize
    }

    /// The reach of records where a pixel is `footprint` metres wide at the surface.
    pub(crate) fn validity(&self, footprint: f32) -> Validity {
        let min_radius = MIN_PIXELS * (self.n as f32 / self.look_n as f32) * footprint;
        Validity {
            spacing: self.spacing,
            min_radius,
            max_radius: self.max_reach(footprint).max(min_radius),
            touching_distance: TOUCHING_SHARE * self.scene_size,
            ..Validity::default()
        }
    }

    /// The farthest that any record reaches there, metres.
    pub(crate) fn max_reach(&self, footprint: f32) -> f32 {
        self.max_share * self.scene_size.min(footprint * self.side)
    }
}

/// From so many lights on, more of them are sampled.
const MANY_LIGHTS: usize = 8;
/// Texels along a side of a gather that serves its own point alone, at quality 1.
const GATHER_RESOLUTION: f32 = 16.0;
/// Records reach at least so many pixels for each time that their side is longer than that of a look: what reaches less serves fewer points
/// than could be gathered for its rays.
const MIN_PIXELS: f32 = 1.0;
/// And at most this share of the scene, and of what the picture shows of it there: farther than that, things that a gather has missed come between, and a record far out on a
/// wide floor has no texel for the bodies of a close-up.
const MAX_SHARE: f32 = 0.25;
/// Hits nearer than this share of the scene mean that a point lies in a seam.
const TOUCHING_SHARE: f32 = 1e-5;

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

/// Mean square of the relative error of primary samples, as if they were independent. The noise of samples falls faster than their number rises, that of records
/// more slowly, most of all where samples are few: so this balances both.
fn noise(quality: f32) -> f32 {
    NOISE * quality.powf(if quality < 1.0 { -0.55 } else { -0.75 })
}

/// Mean square of the relative error of primary samples at quality 1, as if they were independent: stratified ones have a twentieth to a half of it.
const NOISE: f32 = 6e-4;
/// The same of shared lobes, as a share of that of primary samples, which are better stratified.
const LOBE_NOISE: f32 = 0.06;
/// The same of caustics.
const CAUSTIC_NOISE: f32 = 0.1;
/// Photons of the global map at quality 1.
const GLOBAL_PHOTONS: f32 = 400_000.0;
/// Photons of the caustic map at quality 1, and those in the disc of each, where no more are needed.
const CAUSTIC_PHOTONS: f32 = 200_000.0;
const NEIGHBOURS: f32 = 60.0;
/// Most caustic photons a pixel at quality 1: beyond, they would take more time than all else. And most altogether: a million takes 140 MB while discs are made.
const PIXEL_PHOTONS: f32 = 32.0;
const MOST_PHOTONS: f32 = 4e6;
/// Most samples a pixel at quality 1, in the mean, where that cannot be had; half of them where each takes eight light samples.
const MOST_SPP: f32 = 48.0;

/// The power of two that is nearest, by ratio.
fn power_of_two(x: f32) -> u32 {
    1 << round(x.max(1.0).log2(), 0.0, 16.0)
}

fn round(x: f32, min: f32, max: f32) -> u32 {
    #[expect(clippy::cast_possible_truncation, reason = "clamped")]
    #[expect(clippy::cast_sign_loss, reason = "clamped")]
    let rounded = x.round().clamp(min, max) as u32;
    rounded
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use scene::{Description, PunctualLight};

    use super::*;
    use crate::secondary::tests::lamp_over_metal;

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

    #[test]
    fn one_point_of_light_is_asked_once() {
        let suns = |count: usize| {
            let sun = PunctualLight::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::ONE };
            Scene::new(Description { lights: vec![sun; count], ..Description::default() }).unwrap()
        };
        let samples = |scene: &Scene| Plan::new(scene, &Settings::default()).light_samples;
        assert_eq!([0, 1, 2, 8].map(|count| samples(&suns(count))), [1, 1, 4, 8]);
        assert_eq!(samples(&lamp_over_metal(0.1)), 4, "a lamp has many points");
    }
}
