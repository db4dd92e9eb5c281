//! A picture of an error that is asked for: passes are added until the error that they tell of themselves is small
//! enough.
//!
//! Each pass is a whole picture with records, cells and photons of its own. So the passes are independent, and their
//! spread holds all noise, that of a record which a whole patch of the picture shares included. What they have in
//! common, the bias of caches and of photons, no number of passes shows; it is measured by paths at some pixels, which
//! verify the picture without sharing anything with it.
//!
//! With weights w of the passes, x a pixel's value in each, m their mean, and B^2 the mean square of the relative bias
//! of pixels about as noisy, and one standard error of that (or a quarter of what may be, if that is less),
//!
//! ```text
//! s^2 = sum of w^2 (x - m)^2 / (sum of w)^2 * n / (n - 1)
//! error = sqrt(t^2 s^2 / D^2 + z^2 B^2),     D^2 = m^2 + 0.01 (bright / 0.8)^2
//! ```
//! where n = (sum of w)^2 / sum of w^2 is the number of passes if they counted alike, s^2 / D^2 is averaged over 3 x 3
//! pixels, `bright` is the 90th percentile of the picture, and t and z the quantiles of Student's and of the normal
//! distribution that are exceeded in one of 20 cases. D is the denominator of relMSE.

mod bias;
mod controls;
mod passes;
mod pixel;

use std::time::Instant;

use scene::Scene;

use self::bias::Bias;
use self::controls::{CONTROL_SHARE, Controls, OPEN_SHARE};
use self::passes::{Measure, Passes};
pub use self::pixel::{PixelEstimate, estimate_pixel};
use crate::{Method, Progress, QUALITY_RANGE, Rendering, Settings, SettingsError, Statistics};

/// Least and greatest relative error that may be asked for.
pub const ERROR_RANGE: (f32, f32) = (0.001, 1.0);

/// Of the pixels, whose error must be as small as was asked.
const WANTED_PERCENT: usize = 95;
/// Passes of one quality: four make a round. The first round takes about the time of a picture of the quality of the
/// settings.
const PASSES: u32 = 4;
/// The square of the quantile of the normal distribution that is exceeded in one of 20 cases, either way.
const Z_SQ: f32 = 1.96 * 1.96;
/// A round has at most so many times the quality of the one before, for what few passes tell of their error is rough;
/// and at least that part of it.
const GROWTH: f32 = 4.0;
/// What is hardly known of the bias counts as no more than this share of what may be.
const CAUTION: f32 = 0.25;
/// A round brings so many times what is missing, as the next estimate may say that a little more is.
const MARGIN: f32 = 1.1;
const MAX_ROUNDS: u32 = 12;
/// Paths verify until the standard error of the square of the bias is this share of what it may be, or of the noise
/// beside which it stands.
const CERTAINTY: f32 = 0.1;
/// Where the bias alone is about as large as what was asked, so many times it, and passes of [`GROWTH`] times the
/// quality leave more than this share of it, in so many rounds one after the other, more of them are in vain: it is
/// light that paths or caches do not see at all, such as that of a point lamp behind glass.
const HOPELESS: f32 = 0.85;
const STALLED: f32 = 0.8;
const MAX_STALLED: u32 = 2;

/// What a picture tells of its own error.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorEstimate {
    /// For each pixel, row by row, the relative error of the mean of R, G and B that one pixel of 20 exceeds.
    pub relative: Vec<f32>,
    /// Share of the pixels where that is at most what was asked for.
    pub share: f32,
    /// Root mean square of the relative bias over the picture, as paths found it; 0 for [`Method::Path`], which has
    /// none.
    pub bias: f32,
    /// Pictures that were averaged.
    pub passes: u32,
    /// Whether the share is 95 %.
    pub is_reached: bool,
}

impl ErrorEstimate {
    /// The relative error that 95 % of the pixels are estimated to be within.
    #[must_use]
    pub fn reached(&self) -> f32 {
        at_wanted_share(self.relative.clone())
    }
}

/// Makes a picture whose relative error is at most `error` in 95 % of the pixels, as far as it can tell: see
/// [`ErrorEstimate`]. The settings' quality is that of the first round of passes; `spp` is ignored. Deterministic, as
/// [`render`](crate::render). `progress` tells of each pass as that does; `tell` hears the estimate after each round, the
/// last one included.
///
/// # Errors
///
/// When a setting or the error is out of its range, see [`Settings::validate`] and [`ERROR_RANGE`].
///
/// ```
/// use integrator::{ErrorEstimate, Settings, render_to_error};
/// use scene::glam::{UVec2, Vec3};
/// use scene::{Description, Environment, Material, Mesh, Scene};
///
/// let floor = Mesh {
///     positions: vec![Vec3::new(-1.0, 0.0, 1.0), Vec3::new(1.0, 0.0, 1.0), Vec3::new(0.0, 0.0, -1.0)],
///     triangles: vec![[0, 1, 2]],
///     materials: vec![0],
///     ..Mesh::default()
/// };
/// let scene = Scene::new(Description {
///     meshes: vec![floor],
///     materials: vec![Material::default()],
///     environment: Some(Environment::constant(Vec3::ONE)),
///     ..Description::default()
/// })?;
/// let settings = Settings { size: UVec2::splat(16), ..Settings::default() };
/// let tell = |so_far: &ErrorEstimate| println!("{} passes: {} in 95 % of the pixels", so_far.passes, so_far.reached());
/// let (rendering, estimate) = render_to_error(&scene, &settings, 0.05, &|_| (), &tell)?;
/// assert!(estimate.is_reached && estimate.share >= 0.95 && estimate.reached() <= 0.05);
/// assert_eq!(estimate.relative.len(), rendering.film.pixel_count());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn render_to_error(
    scene: &Scene,
    settings: &Settings,
    error: f32,
    progress: &(dyn Fn(Progress) + Sync),
    tell: &dyn Fn(&ErrorEstimate),
) -> Result<(Rendering, ErrorEstimate), SettingsError> {
    settings.validate()?;
    // Written so that NaN is refused.
    if !(ERROR_RANGE.0..=ERROR_RANGE.1).contains(&error) {
        return Err(SettingsError::Error(error));
    }
    let start = Instant::now();
    let pass = Settings { spp: None, ..settings.clone() };
    let mut passes = Passes::new(settings.size);
    let mut controls = Controls::new(settings);
    let mut statistics = Statistics::default();
    let (least, most) = QUALITY_RANGE;
    let mut quality = (settings.quality / PASSES as f32).max(least);
    let (mut round, mut stalled, mut has_grown, mut last_bias) = (0, 0, false, f32::INFINITY);
    loop {
        round += 1;
        passes.add_round(scene, &pass, quality, &mut statistics, progress)?;
        let measure = passes.measure();
        let mut bias = Bias::default();
        if settings.method != Method::Path {
            progress(Progress { phase: "verify", done: 0.0 });
            let well = CERTAINTY * error * error / Z_SQ;
            let worth = |bias: &Bias| {
                if bias.error() < well {
                    0.0
                } else if measure.is_open(bias, error) {
                    OPEN_SHARE
                } else {
                    CONTROL_SHARE
                }
            };
            bias = statistics.time("verify", |statistics| controls.verify(scene, &measure, statistics, worth));
            progress(Progress { phase: "verify", done: 1.0 });
        }
        let estimate = measure.estimate(&bias, error, passes.count);
        tell(&estimate);
        let is_hopeless = measure.excess(|noise_sq| bias.of(noise_sq).least(), HOPELESS * error).is_infinite();
        if !is_hopeless || estimate.bias <= STALLED * last_bias {
            stalled = 0;
        } else if has_grown {
            stalled += 1;
        }
        last_bias = estimate.bias;
        if estimate.is_reached || round == MAX_ROUNDS || quality >= most || stalled == MAX_STALLED {
            statistics.render_seconds = start.elapsed().as_secs_f64();
            let Passes { film, records, .. } = passes;
            return Ok((Rendering { film, statistics, records }, estimate));
        }
        let next = next_quality(&measure, &bias, error, passes.weight / PASSES as f32, quality);
        has_grown = next >= GROWTH * quality;
        quality = next.clamp(least, most);
    }
}

/// The quality of the round after one of quality `last`, where all rounds have `so_far` together. Noise is averaged away,
/// and bias only better passes take away. But what is not known of the bias paths tell, of which there may be twice as
/// many once the passes have taken twice the rays.
fn next_quality(measure: &Measure, bias: &Bias, asked: f32, so_far: f32, last: f32) -> f32 {
    /// Noise is planned for what paths may find where what they do not know makes more work than this.
    const UNKNOWN: f32 = 2.0;
    let most = measure.excess(|noise_sq| bias.of(noise_sq).most(asked), asked);
    let hoped = measure.excess(|noise_sq| bias.of(noise_sq).least(), asked) / (1.0 - CAUTION);
    let missing = |excess: f32| so_far * (MARGIN * excess - 1.0);
    let wanted = if most <= UNKNOWN * hoped { missing(most) } else { missing(hoped).max(so_far) };
    wanted.clamp(last / GROWTH, GROWTH * last)
}

/// The least value that 95 % of these do not exceed.
fn at_wanted_share(mut values: Vec<f32>) -> f32 {
    let place = (values.len() * WANTED_PERCENT).div_ceil(100) - 1;
    *values.select_nth_unstable_by(place, f32::total_cmp).1
}

/// The quantile of Student's distribution that is exceeded in one of 20 cases, either way (Cornish and Fisher's
/// expansion; 2 % too small for 4 degrees of freedom).
fn student(degrees: f32) -> f32 {
    1.96 + (2.372 + 2.822 / degrees) / degrees
}

#[cfg(test)]
mod tests {
    use glam::{UVec2, Vec3};

    use super::bias::Term;
    use super::*;
    use crate::{Film, Rng};

    /// Passes of a picture of radiance 1 with noise of a relative deviation of 0.1 at weight 1.
    fn noisy(size: UVec2, weights: &[f32]) -> Passes {
        let mut rng = Rng::new(3, 1);
        let mut passes = Passes::new(size);
        for &weight in weights {
            let mut film = Film::new(size);
            for pixel in &mut film.direct {
                // The sum of 12 uniform numbers has the variance 1.
                let normal = (0..12).map(|_| rng.next_1d()).sum::<f32>() - 6.0;
                *pixel = Vec3::splat(1.0 + 0.1 * normal / weight.sqrt());
            }
            passes.add(&film, weight);
        }
        passes
    }

    /// A bias with this mean square and this standard error of that, as shares of what is `asked`.
    fn bias(asked: f32, sq: f64, error: f64) -> Bias {
        let asked_sq = f64::from(asked * asked / Z_SQ);
        let term = |number: u32| {
            // The standard error is 1/sqrt(255) of the deviation.
            let deviation = if number.is_multiple_of(2) { 255f64.sqrt() } else { -(255f64.sqrt()) };
            Term { noise_sq: 1e-3, bias_sq: asked_sq * (sq + error * deviation) }
        };
        Bias::new((0..256).map(term).collect())
    }

    #[test]
    fn one_pixel_of_twenty_is_farther_off_than_it_says() {
        for weights in [&[1.0; 4][..], &[1.0; 16], &[1.0, 1.0, 1.0, 1.0, 4.0, 4.0, 4.0, 4.0]] {
            let passes = noisy(UVec2::splat(100), weights);
            let measure = passes.measure();
            let estimate = measure.estimate(&Bias::default(), 0.1, passes.count);
            let is_off = |(mean, relative): (&f32, &f32)| (mean - 1.0).abs() > relative * (1.0f32 + 0.016).sqrt();
            let off = measure.mean.iter().zip(&estimate.relative).filter(|&pair| is_off(pair)).count();
            // Of 10,000 pixels 500; the neighbours' noise is known too, so that fewer are off than Student's t allows.
            assert!((100..560).contains(&off), "{} passes: {off}", weights.len());
        }
    }

    #[test]
    fn excess_tells_what_more_passes_bring() {
        let [few, many] = [&[1.0; 8][..], &[1.0; 32]].map(|weights| noisy(UVec2::splat(64), weights).measure());
        let ratio = few.excess(|_| 0.0, 0.02) / many.excess(|_| 0.0, 0.02);
        assert!((3.6..6.8).contains(&ratio), "four times the passes: {ratio}");
        let half = many.excess(|_| 0.5 * 0.02 * 0.02 / Z_SQ, 0.02) / many.excess(|_| 0.0, 0.02);
        assert!((half - 2.0).abs() < 1e-3, "a bias that takes half: {half}");
        assert!(many.excess(|_| 0.01, 0.02).is_infinite(), "a bias of 0.1 stays");
    }

    #[test]
    fn paths_decide_only_where_they_know_too_little() {
        let measure = noisy(UVec2::splat(64), &[1.0; 16]).measure();
        let is_open = |asked: f32, sq, error| measure.is_open(&bias(asked, sq, error), asked);
        assert!(is_open(0.1, 0.9, 0.5), "it may be well below");
        assert!(!is_open(0.1, 0.1, 0.5), "it is reached");
        assert!(!is_open(0.1, 1.5, 0.1), "there is too much");
        assert!(!is_open(0.02, 0.9, 0.5), "there is too much noise");
    }

    #[test]
    fn the_next_round_brings_what_is_missing() {
        let measure = noisy(UVec2::splat(64), &[1.0; 16]).measure();
        // So much noise that half as many passes would do, and four times as many would.
        let [half, four] = [0.5f32, 4.0].map(|times| measure.excess(|_| 0.0, 0.1).sqrt() * 0.1 / times.sqrt());
        let next = |asked: f32, sq, error| next_quality(&measure, &bias(asked, sq, error), asked, 4.0, 2.0);
        let is_about = |quality: f32, known: f32| (quality / known - 1.0).abs() < 0.01;
        assert!(is_about(next(four, 0.0, 0.0), 8.0), "{}: 13.6, but at most four times the last", next(four, 0.0, 0.0));
        assert!(is_about(next(half, 0.45, 0.0), 0.5), "{}: nothing, but a quarter", next(half, 0.45, 0.0));
        assert!(is_about(next(half, 1.5, 0.1), 8.0), "{}: only better ones help", next(half, 1.5, 0.1));
        assert!(is_about(next(half, 0.9, 0.8), 4.0), "{}: as much again, for paths", next(half, 0.9, 0.8));
        let certain = next(half, 0.74, 0.0);
        assert!(
            is_about(certain, 4.0 * (1.1 * 0.5 / 0.26 - 1.0)),
            "{certain}: the noise that the bias leaves room for"
        );
        let cliff = [0.99, 1.01].map(|most| next(half, most - 0.25, 0.5));
        assert!(is_about(cliff[0], cliff[1]), "{cliff:?}: nothing hangs on whether there is hope by a hair");
    }

    #[test]
    fn of_twenty_pixels_one_may_exceed() {
        for (count, place) in [(1u16, 0u16), (19, 18), (20, 18), (21, 19), (400, 379)] {
            let values = (0..count).map(|value| f32::from(count - 1 - value)).collect();
            assert_eq!(at_wanted_share(values), f32::from(place), "of {count}");
        }
    }

    #[test]
    fn student_is_known() {
        for (degrees, known) in [(6.0, 2.447), (10.0, 2.228), (30.0, 2.042), (1e6, 1.960)] {
            assert!((student(degrees) / known - 1.0).abs() < 0.01, "{degrees}: {}", student(degrees));
        }
    }
}
