//! What one pixel of a picture is off by: the estimate of [`render_to_error`](crate::render_to_error) after its first
//! round, beside the pixel's own light by paths.

use glam::{DVec3, UVec2, Vec3};
use rayon::prelude::*;
use scene::Scene;

use super::bias::{Bias, ClassBias};
use super::controls::{CONTROL_SHARE, Controls, GROUP, group_mean};
use super::passes::Passes;
use super::{CERTAINTY, PASSES};
use crate::path::learn_lights;
use crate::sampler::hash_pair;
use crate::{Method, PathTracer, Progress, QUALITY_RANGE, RayCounts, Settings, SettingsError, Statistics};

/// Groups of paths through the pixel: 4096 paths.
const GROUPS: u32 = 256;
/// Keeps the random numbers of these paths apart from those of pictures.
const REFERENCE_STREAM: u64 = 0x0070_6978_656c;

/// How far off a pixel of a picture may be.
///
/// Errors are relative: differences of the mean of R, G and B over [`scale`](Self::scale), the denominator of relMSE.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PixelEstimate {
    /// The error that one of 20 such pixels exceeds, by noise and bias together.
    pub error: f32,
    /// Standard deviation by noise, averaged over 3 x 3 pixels.
    pub noise: f32,
    /// Root mean square of the bias of pixels that are about as noisy, as paths through 256 pixels of the whole picture
    /// found it; 0 for [`Method::Path`], which has none.
    pub bias: f32,
    /// What the noise of those paths can feign: the root of the standard error of the square of [`Self::bias`].
    pub bias_noise: f32,
    /// The radiance to which errors are relative, W m^-2 sr^-1: sqrt(m^2 + 0.01 (b / 0.8)^2), for the pixel's radiance
    /// m and the 90th percentile b of the picture.
    pub scale: f32,
    /// The pixel's radiance by paths, W m^-2 sr^-1.
    pub reference: Vec3,
    /// Standard error of that.
    pub reference_noise: f32,
    /// As many paths.
    pub paths: u32,
}

/// Estimates the error of one pixel of the picture that [`render`](crate::render) makes with these settings. Takes
/// about the time of two pictures: four of a quarter of the quality, whose mean is about as good as that picture, tell
/// the noise, paths through some of their pixels the bias. Deterministic, as `render`.
///
/// # Errors
///
/// When a setting is out of its range, or the pixel is outside of the picture.
///
/// ```
/// use integrator::{Settings, estimate_pixel};
/// use scene::glam::{UVec2, Vec3};
/// use scene::{Description, Environment, Material, Mesh, Scene};
///
/// let floor = Mesh {
///     positions: vec![Vec3::new(-9.0, 0.0, 9.0), Vec3::new(9.0, 0.0, 9.0), Vec3::new(0.0, 0.0, -9.0)],
///     triangles: vec![[0, 1, 2]],
///     materials: vec![0],
///     ..Mesh::default()
/// };
/// let scene = Scene::new(Description {
///     meshes: vec![floor],
///     materials: vec![Material { diffuse: Vec3::splat(0.5), ..Material::default() }],
///     environment: Some(Environment::constant(Vec3::ONE)),
///     ..Description::default()
/// })?;
/// let settings = Settings { size: UVec2::splat(16), quality: 4.0, ..Settings::default() };
/// let estimate = estimate_pixel(&scene, &settings, UVec2::splat(8), &|_| ())?;
/// // The sky alone lights the floor: half of it comes back.
/// assert!((estimate.reference - 0.5).abs().max_element() < 0.01 && estimate.error < 0.01);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn estimate_pixel(
    scene: &Scene,
    settings: &Settings,
    pixel: UVec2,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<PixelEstimate, SettingsError> {
    settings.validate()?;
    let Settings { size, seed, .. } = *settings;
    if pixel.cmpge(size).any() {
        return Err(SettingsError::Pixel { pixel, size });
    }
    let quality = (settings.quality / PASSES as f32).max(QUALITY_RANGE.0);
    let pass = Settings { spp: settings.spp.map(|spp| spp.div_ceil(PASSES)), ..settings.clone() };
    let mut passes = Passes::new(size);
    let mut statistics = Statistics::default();
    passes.add_round(scene, &pass, quality, &mut statistics, progress)?;
    let measure = passes.measure();
    let number = pixel.y as usize * size.x as usize + pixel.x as usize;
    let noise_sq = measure.noise_sq[number];
    let bias = match settings.method {
        Method::Path => Bias::default(),
        _ => {
            let worth = |bias: &Bias| if bias.of(noise_sq).error < CERTAINTY * noise_sq { 0.0 } else { CONTROL_SHARE };
            Controls::new(settings).verify(scene, &measure, &mut statistics, worth)
        }
    };
    let ClassBias { sq: bias_sq, error: bias_noise_sq } = bias.of(noise_sq);
    let scale = measure.scale[number];
    let (reference, reference_noise) = trace_reference(scene, settings, pixel, hash_pair(seed, REFERENCE_STREAM));
    Ok(PixelEstimate {
        error: measure.estimate(&bias, 1.0, passes.count).relative[number],
        noise: noise_sq.sqrt(),
        bias: bias_sq.sqrt(),
        bias_noise: bias_noise_sq.sqrt(),
        scale,
        reference,
        reference_noise: reference_noise / scale,
        paths: GROUPS * GROUP,
    })
}

/// A pixel's light by paths, and the standard error of the mean of R, G and B.
fn trace_reference(scene: &Scene, settings: &Settings, pixel: UVec2, seed: u64) -> (Vec3, f32) {
    let light_choice = learn_lights(scene, settings, seed, &mut RayCounts::default());
    let tracer = || PathTracer::new(scene).with_light_choice(light_choice.as_ref());
    let means: Vec<DVec3> = (0..GROUPS)
        .into_par_iter()
        .map_init(tracer, |tracer, group| group_mean(tracer, scene, settings.size, pixel, seed, group.into()))
        .collect();
    let groups = f64::from(GROUPS);
    let mean = means.iter().sum::<DVec3>() / groups;
    let spread: f64 = means.iter().map(|group| ((*group - mean).element_sum() / 3.0).powi(2)).sum();
    #[expect(clippy::cast_possible_truncation, reason = "the film is f32")]
    let noise = (spread / (groups * (groups - 1.0))).sqrt() as f32;
    (mean.as_vec3(), noise)
}
