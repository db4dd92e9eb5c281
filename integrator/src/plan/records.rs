//! How points look for indirect light, and how far what they see serves others.

use radcache::{MergeSettings, RecordSettings, Validity};
use scene::Scene;

use super::{round, wanted_texture_alpha};
use crate::{Method, Settings};

/// What gathers and their records take.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RecordPlan {
    /// Resolution of a gather that becomes a record, and of one that does not, see [`Self::look_n_for`].
    pub(crate) n: usize,
    pub(crate) look_n: usize,
    /// Side of a square picture of as many pixels.
    side: f32,
    /// Size of the scene, metres.
    scene_size: f32,
    /// How records are made.
    pub(crate) record: RecordSettings,
    /// Reach of records, as a share of the harmonic mean distance.
    spacing: f32,
    /// Error that a record of irradiance may sum to over its ellipse, relative to its irradiance and to the picture: 1
    /// is an error of 100 % on all of it. Of one that is gathered, and of one that is reprojected.
    pub(crate) error: f32,
    pub(crate) reprojected_error: f32,
    /// Whether records of irradiance reach as far as the Hessian says.
    pub(crate) by_hessian: bool,
    /// Whether they know the gradients, stop at walls, reach little farther than their neighbours and leave gaps to
    /// others.
    pub(crate) gradients: bool,
    pub(crate) walls: bool,
    pub(crate) clamp: bool,
    pub(crate) gaps: bool,
    /// How far any record reaches, as a share of the scene, and of what the picture shows there.
    max_share: f32,
    /// How far one of irradiance reaches at least, unless its light comes by highlights or neighbours limit it, as a share
    /// of what the picture shows there: by the fourth root of the error that is allowed, as radii do.
    min_share: f32,
    /// How far one of irradiance reaches by the Hessian at most, as a share of the harmonic mean distance. In corners
    /// that limits nearly all of them: it rises with the error that is allowed as radii do, by the fourth root.
    pub(crate) max_share_of_distance: f32,
    /// Whether texels between bright and dark, and at the rim of the sky, are divided.
    pub(crate) divide: bool,
    /// Whether highlights are traced anew.
    pub(crate) highlights: bool,
    /// Whether reprojections tell apart what stayed and what moved.
    pub(crate) tells_parts: bool,
    /// How reprojections are made.
    pub(crate) reproject: reproject::Settings,
    /// Texels along a side of the largest blocks of holes for which one ray stands.
    pub(crate) hole_step: u32,
    /// Verification rays along a side.
    pub(crate) verify_side: u32,
}

/// Texels along a side of a gather that serves its own point alone, at quality 1.
const GATHER_RESOLUTION: f32 = 16.0;
/// Records reach at least so many pixels for each time that their side is longer than that of a look: what reaches less
/// serves fewer points than could be gathered for its rays.
const MIN_PIXELS: f32 = 1.0;
/// Records of irradiance reach at least so many pixels.
const MIN_IRRADIANCE_PIXELS: f32 = 1.5;
/// And at least this share of what the picture shows there, at quality 1: in corners and on reliefs, where less would be
/// right, most would serve few pixels each. With half as much again sponza lost half a percent at quality 0.1.
const MIN_SHARE: f32 = 1.0 / 128.0;
/// All reach at most this share of the scene, and of what the picture shows of it there: farther than that, things that a
/// gather has missed come between, and a record far out on a wide floor has no texel for the bodies of a close-up.
const MAX_SHARE: f32 = 0.25;
/// Error of records of irradiance at quality 1, and how many times as much lets them reach past the harmonic mean
/// distance, see [`RecordPlan::max_share_of_distance`]: to that of quality 0.02, by which a Cornell box takes 0.92 of the
/// time for 1.03 times the noise.
const ERROR: f32 = 1e-4;
const MAX_LENIENCE: f32 = 50.0;
/// Texels along a side of looks, for each of a full one.
const LOOK_STEPS: [f32; 5] = [1.0, 5.0 / 6.0, 2.0 / 3.0, 0.5, 1.0 / 3.0];
/// So many late points that ask at once, for each pixel of the picture, take full looks, and so many in any picture; more
/// of them share the rays of so many.
const CROWD: f32 = 0.015;
const SMALL_CROWD: f32 = 1000.0;
/// Points of this lattice and finer ones are asked late.
const LATEST_STRIDE: usize = 2;
/// Hits nearer than this share of the scene mean that a point lies in a seam.
const TOUCHING_SHARE: f32 = 1e-5;

impl RecordPlan {
    pub(super) fn new(scene: &Scene, settings: &Settings) -> Self {
        let features = scene.features();
        let Settings { quality, study, method, .. } = settings;
        let has_textures = features.widest_metal >= wanted_texture_alpha(settings).max(f32::MIN_POSITIVE);
        // The rim of a window in the sky and a lobe need more texels than irradiance does. Where a point may look for
        // itself instead, by which it sees more for the same time, records of radiance reach less far: least where a
        // look is cheap, as it is not with the rim of a sky in it. Without sky and textures reprojection takes no less
        // time than the rays of a look, so that only points close to a record ask it.
        let (record_n, look_n, spacing) = match (features.environment, has_textures) {
            (true, _) => (48.0, 24.0, 0.12),
            (false, true) => (40.0, 20.0, 0.2),
            (false, false) => (32.0, 20.0, 0.03),
        };
        // With a cache, twice the time is shared by the number of records and by their rays.
        let with_cache = |base: f32| round(base * quality.sqrt().sqrt(), 8.0, 64.0);
        let alone = round(GATHER_RESOLUTION * quality.sqrt(), 4.0, 64.0);
        let (n, look_n) = match method {
            Method::Reproject => (with_cache(record_n), with_cache(look_n)),
            Method::CacheOnly => (with_cache(look_n), with_cache(look_n)),
            Method::Gather | Method::Path => (alone, alone),
        };
        let n = study.resolution.unwrap_or(n);
        let error = study.error.unwrap_or(ERROR / quality);
        let lenience = (error / ERROR).min(MAX_LENIENCE).sqrt().sqrt();
        // A glossy lobe sees single elements, so these must not blur light; irradiance does not care.
        let max_contrast = if has_textures { 0.1 } else { 2.0 };
        Self {
            n: n as usize,
            look_n: if *method == Method::CacheOnly { n } else { look_n.min(n) } as usize,
            side: (settings.size.element_product() as f32).sqrt(),
            scene_size: 2.0 * scene.bounds().radius(),
            record: RecordSettings {
                layers: study.layers.unwrap_or(16) as usize,
                merge: MergeSettings { max_contrast, ..study.merge_settings() },
            },
            spacing: study.spacing.unwrap_or(spacing),
            // The sky between near things ends more sharply than the Hessian of so few texels tells.
            error: if *method == Method::Reproject && features.environment { 0.5 * error } else { error },
            // They cost less, so there are more of them.
            reprojected_error: 0.5 * error,
            by_hessian: study.by_distance != Some(true),
            gradients: study.gradients != Some(false),
            walls: study.walls != Some(false),
            clamp: study.clamp != Some(false),
            gaps: study.gaps != Some(false),
            max_share_of_distance: lenience.max(1.0),
            max_share: if study.limit == Some(false) { f32::MAX } else { MAX_SHARE },
            min_share: MIN_SHARE * lenience,
            divide: study.divide != Some(false),
            highlights: study.highlights != Some(false),
            tells_parts: settings.rungs,
            reproject: reproject::Settings {
                coverage: study.coverage(),
                trails: study.trails.unwrap_or_default(),
                weights: study.weights(),
                margins: study.margins != Some(false),
                doubt: study.doubt != Some(false),
            },
            // One lobe sees so few holes that the noise of each ray counts, and a ray that meets gloss may find a
            // highlight.
            hole_step: study.step.unwrap_or(if features.glossy { 1 } else { 2 }),
            verify_side: study.verify.unwrap_or(2),
        }
    }

    /// Whether points of the lattice of this stride are asked so late that they serve few others: those that have no
    /// record by then lie in reliefs, corners and leaves.
    pub(crate) fn is_late(stride: usize) -> bool {
        stride <= LATEST_STRIDE
    }

    /// The share of the rays of a full look that each of so many late points takes that ask at once, in a band of the
    /// picture that has so many of its pixels.
    pub(crate) fn crowd_rays(points: usize, band: usize, picture: u32) -> f32 {
        let full = (CROWD * picture as f32).max(SMALL_CROWD) * band as f32 / picture as f32;
        (full / points.max(1) as f32).min(1.0)
    }

    /// The same of a late point that has this share of its pixel.
    pub(crate) fn thin_rays(share: f32) -> f32 {
        (2.0 * share).clamp(0.25, 1.0)
    }

    /// Resolution of the coarsest look that takes about this share of the rays of a full one, or more.
    pub(crate) fn look_n_for(&self, rays: f32) -> usize {
        let step = LOOK_STEPS.iter().rposition(|step| step * step >= rays).unwrap_or(0);
        self.look_n_at(LOOK_STEPS[step])
    }

    /// The resolutions of all gathers of which records are made.
    pub(crate) fn resolutions(&self) -> Vec<usize> {
        let mut resolutions = vec![self.n];
        resolutions.extend(LOOK_STEPS.map(|step| self.look_n_at(step)));
        resolutions.dedup();
        resolutions
    }

    fn look_n_at(&self, step: f32) -> usize {
        round(self.look_n as f32 * step, 1.0, 64.0) as usize
    }

    /// The width of the whole picture where a pixel is `footprint` metres wide at the surface.
    pub(crate) fn picture_width(&self, footprint: f32) -> f32 {
        footprint * self.side
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

    /// The least that records of irradiance reach there, but those by highlights, before neighbours limit them; metres,
    /// above 0.
    pub(crate) fn min_reach(&self, footprint: f32) -> f32 {
        let share = self.min_share * self.picture_width(footprint);
        Self::shortest_reach(footprint).max(share.min(self.max_reach(footprint)))
    }

    /// The reach of those by highlights, which are elsewhere for each point: none reaches less by itself; metres, above 0.
    pub(crate) fn shortest_reach(footprint: f32) -> f32 {
        /// A camera whose pixels are points still needs records that reach themselves.
        const SHORTEST: f32 = 1e-30;
        (MIN_IRRADIANCE_PIXELS * footprint).max(SHORTEST)
    }

    /// The farthest that any record reaches there, metres.
    pub(crate) fn max_reach(&self, footprint: f32) -> f32 {
        self.max_share * self.scene_size.min(self.picture_width(footprint))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::secondary::tests::lamp_over_metal;
    use glam::UVec2;
    use scene::Description;

    #[test]
    fn crowds_share_their_rays() {
        let of_whole = |points, pixels: u32| RecordPlan::crowd_rays(points, pixels as usize, pixels);
        assert_eq!(of_whole(0, 1_000_000), 1.0);
        assert_eq!(of_whole(10_000, 1_000_000), 1.0, "a hundredth of the picture");
        assert_eq!(of_whole(1000, 1000), 1.0, "all of a small one");
        for points in [100_000, 1_000_000] {
            let rays = of_whole(points, 1_000_000) * points as f32;
            assert!((rays - 15_000.0).abs() < 10.0, "{points} points take as many rays as {rays} full looks");
            let of_band = RecordPlan::crowd_rays(points / 100, 10_000, 1_000_000);
            assert!((of_band - of_whole(points, 1_000_000)).abs() < 1e-6, "a band is like the whole: {of_band}");
        }
    }

    #[test]
    fn looks_take_about_the_rays_that_they_are_to() {
        let scene = Scene::new(Description::default()).unwrap();
        let plan = RecordPlan::new(&scene, &Settings::default());
        let full = (plan.look_n * plan.look_n) as f32;
        for rays in [1.0, 0.9, 0.6, 0.3, 0.2, 0.12] {
            let n = plan.look_n_for(rays);
            let share = (n * n) as f32 / full;
            assert!((0.95 * rays..2.1 * rays).contains(&share), "{share} of the rays instead of {rays}");
            assert!(plan.resolutions().contains(&n));
        }
        assert_eq!(plan.look_n_for(1.0), plan.look_n);
        assert_eq!(plan.look_n_for(0.0), plan.look_n_for(0.1), "no look has fewer than a ninth");
        assert!(plan.resolutions().contains(&plan.n));
    }

    #[test]
    fn records_of_low_qualities_reach_farther() {
        let scene = Scene::new(Description::default()).unwrap();
        let share =
            |quality| RecordPlan::new(&scene, &Settings { quality, ..Settings::default() }).max_share_of_distance;
        assert_eq!([0.0625, 1.0, 16.0].map(share), [2.0, 1.0, 1.0]);
        assert!((share(1e-3) / 2.659 - 1.0).abs() < 1e-3, "no farther than at quality 0.02");
    }

    #[test]
    fn the_least_reach_is_a_share_of_the_picture_and_some_pixels() {
        let scene = lamp_over_metal(0.1);
        const PIXEL: f32 = 1.0 / 1024.0;
        let least = |quality, size| {
            let settings = Settings { quality, size: UVec2::splat(size), ..Settings::default() };
            RecordPlan::new(&scene, &settings).min_reach(PIXEL) / PIXEL
        };
        assert_eq!(
            [(1.0, 256), (1.0, 1024), (0.0625, 256)].map(|(quality, size)| least(quality, size)),
            [2.0, 8.0, 4.0]
        );
        assert_eq!([(1.0, 64), (16.0, 256)].map(|(quality, size)| least(quality, size)), [1.5; 2], "in pixels");
        assert!(RecordPlan::new(&scene, &Settings::default()).min_reach(0.0) > 0.0, "where pixels are points");
    }

    #[test]
    fn slivers_take_fewer_rays() {
        assert_eq!([0.0, 0.1, 0.25, 0.5, 1.0].map(RecordPlan::thin_rays), [0.25, 0.25, 0.5, 1.0, 1.0]);
        assert_eq!([1, 2, 4, 64].map(RecordPlan::is_late), [true, true, false, false]);
    }
}
