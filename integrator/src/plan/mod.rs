//! What this scene needs, and what each method spends at a given quality. What is absent is never allocated or traced.

mod lobes;
mod photons;
mod records;
mod samples;

use scene::Scene;

pub(crate) use self::lobes::LobePlan;
pub(crate) use self::photons::{CausticBudget, PhotonPlan};
pub(crate) use self::records::RecordPlan;
pub(crate) use self::samples::SamplePlan;
use crate::{SecondaryKind, Settings};

/// The decisions of a rendering by the four-term methods.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Plan {
    /// Where gather rays take their light from.
    pub(crate) secondary: SecondaryKind,
    pub(crate) samples: SamplePlan,
    pub(crate) records: RecordPlan,
    pub(crate) lobes: LobePlan,
    pub(crate) photons: PhotonPlan,
    /// Rays to spend on the links of cells, 0 where there are none.
    pub(crate) cell_rays: u32,
    /// Gather rays of each probe that finds cells.
    pub(crate) probe_rays: u32,
}

impl Plan {
    pub(crate) fn new(scene: &Scene, settings: &Settings) -> Self {
        let features = scene.features();
        let quality = settings.quality;
        let secondary = settings.study.secondary.unwrap_or_default();
        let records = RecordPlan::new(scene, settings);
        // Links that end in a window, or at a lamp by way of gloss, are few and bright.
        let links = if features.glossy || features.environment { 800_000.0 } else { 400_000.0 };
        // What few of them leave to chance, all points around a cell have in common.
        let links = links * quality.powf(if quality < 1.0 { 0.5 } else { 0.75 });
        let has_cells = features.diffuse && secondary == SecondaryKind::Cells;
        Self {
            secondary,
            samples: SamplePlan::new(scene, settings),
            lobes: LobePlan::new(scene, settings, records.n),
            records,
            photons: PhotonPlan::new(scene, settings, secondary),
            cell_rays: if has_cells { round(links, 100_000.0, 50_000_000.0) } else { 0 },
            probe_rays: round(24.0 * quality.sqrt(), 8.0, 96.0),
        }
    }
}

/// Primary rays along a side of the picture by which something is learnt before.
fn learners(settings: &Settings) -> u32 {
    round(128.0 * settings.quality.sqrt().sqrt(), 48.0, 256.0).min(settings.size.max_element())
}

/// About the quality that takes as many samples as were asked for.
fn sample_quality(settings: &Settings) -> f32 {
    settings.spp.map_or(settings.quality, |spp| spp as f32 / 16.0)
}

/// Narrowest glossy lobe that is to be read from a texture, if its texels are fine enough: none for high qualities, for
/// the noise of traced lobes falls with the number of their rays, and a texture has 64 x 64 texels at most.
fn wanted_texture_alpha(settings: &Settings) -> f32 {
    /// From this quality on all lobes are traced.
    const TRACED: f32 = 4.0;
    settings.study.texture_alpha.unwrap_or(if settings.quality < TRACED { 0.5 } else { f32::INFINITY })
}

/// Mean square of the relative error of primary samples, as if they were independent. The noise of samples falls faster
/// than their number rises, that of records more slowly, most of all where samples are few: so this balances both.
fn noise(quality: f32) -> f32 {
    /// At quality 1; stratified samples have a twentieth to a half of it.
    const NOISE: f32 = 6e-4;
    NOISE * quality.powf(if quality < 1.0 { -0.55 } else { -0.75 })
}

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
