//! A picture of an error that is asked for: passes are added until the error that they tell of themselves is small enough.
//!
//! Each pass is a whole picture with records, cells and photons of its own. So the passes are independent, and their spread holds all noise, that of a
//! record which a whole patch of the picture shares included. What they have in common, the bias of caches and of photons, no number of
//! passes shows; it is measured by paths at some pixels, which verify the picture without sharing anything with it.
//!
//! With weights w of the passes, x a pixel's value in each, m their mean, and B the root mean square of the relative bias,
//!
//! ```text
//! s^2 = sum of w^2 (x - m)^2 / (sum of w)^2 * n / (n - 1)
//! error = t sqrt(s^2 / D^2 + B^2),     D^2 = m^2 + 0.01 (bright / 0.8)^2
//! ```
//! where n = (sum of w)^2 / sum of w^2 is the number of passes if they counted alike, s^2 / D^2 is averaged over 3 x 3 pixels, `bright` is the
//! 90th percentile of the picture, and t the quantile of Student's distribution that is exceeded in one of 20 cases. D is the denominator of relMSE.

use std::time::Instant;

use glam::{UVec2, Vec3};
use rayon::prelude::*;
use scene::Scene;

use crate::metrics;
use crate::sampler::{Sampler, hash_pair};
use crate::{
    Film, Method, PathTracer, Progress, QUALITY_RANGE, RayCounts, Rendering, Settings, SettingsError, Statistics,
    render,
};

/// Least and greatest relative error that may be asked for.
pub const ERROR_RANGE: (f32, f32) = (0.001, 1.0);

/// Share of the pixels whose error must be as small as was asked.
const WANTED_SHARE: f32 = 0.95;
/// Passes of one quality: four make a round. The first round takes about the time of a picture of the quality of the settings.
const PASSES: u32 = 4;
/// A round has at most so many times the quality of the one before, for what few passes tell of their error is rough; and at least that part of it.
const GROWTH: f32 = 4.0;
const MAX_ROUNDS: u32 = 12;
/// Where the bias alone is too large, and passes of [`GROWTH`] times the quality leave more than this share of it, in so many rounds one after the other, more of them are in
/// vain: it is light that paths or caches do not see at all, such as that of a point lamp behind glass.
const STALLED: f32 = 0.8;
const MAX_STALLED: u32 = 2;

/// Pixels along a side of the grid of those that paths verify.
const CONTROL_SIDE: u32 = 16;
/// Paths of one group, which are stratified; the spread of the groups tells the error of their mean.
const GROUP: u32 = 16;
/// Groups of a round, at least; more for the rays that the passes took: one ray of paths for so many of passes, at about so many rays a path.
const MIN_GROUPS: u64 = 4;
const CONTROL_SHARE: u64 = 8;
const RAYS_OF_PATH: u64 = 10;

/// What a picture tells of its own error.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorEstimate {
    /// For each pixel, row by row, the relative error of the mean of R, G and B that one pixel of 20 exceeds.
    pub relative: Vec<f32>,
    /// Share of the pixels where that is at most what was asked for.
    pub share: f32,
    /// Root mean square of the relative bias, as paths found it; 0 for [`Method::Path`], which has none.
    pub bias: f32,
    /// Pictures that were averaged.
    pub passes: u32,
    /// Whether the share is 95 %.
    pub is_reached: bool,
}

/// Makes a picture whose relative error is at most `error` in 95 % of the pixels, as far as it can tell: see [`ErrorEstimate`]. The settings' quality
/// is that of the first round of passes; `spp` is ignored. Deterministic, as [`render`].
///
/// # Errors
///
/// When a setting or the error is out of its range, see [`Settings::validate`] and [`ERROR_RANGE`].
///
/// ```
/// use integrator::{Settings, render_to_error};
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
/// let (rendering, estimate) = render_to_error(&scene, &settings, 0.05, &|_| ())?;
/// assert!(estimate.is_reached && estimate.share >= 0.95);
/// assert_eq!(estimate.relative.len(), rendering.film.pixel_count());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn render_to_error(
    scene: &Scene,
    settings: &Settings,
    error: f32,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<(Rendering, ErrorEstimate), SettingsError> {
    settings.validate()?;
    // Written so that NaN is refused.
    if !(ERROR_RANGE.0..=ERROR_RANGE.1).contains(&error) {
        return Err(SettingsError::Error(error));
    }
    let start = Instant::now();
    let mut passes = Passes::new(settings.size);
    let mut controls = Controls::new(settings);
    let mut statistics = Statistics::default();
    let (least, most) = QUALITY_RANGE;
    let mut quality = (settings.quality / PASSES as f32).max(least);
    let (mut round, mut stalled, mut last_bias) = (0, 0, f32::INFINITY);
    loop {
        round += 1;
        for _ in 0..PASSES {
            let seed = hash_pair(settings.seed, u64::from(passes.count));
            let pass = Settings { quality, seed, spp: None, ..settings.clone() };
            let Rendering { film, statistics: of_pass } = render(scene, &pass, progress)?;
            passes.add(&film, quality);
            statistics.add_pass(&of_pass);
        }
        let mut bias_sq = 0.0;
        let measure = passes.measure();
        if settings.method != Method::Path {
            bias_sq = statistics.time("verify", |statistics| {
                controls.trace(scene, settings.size, &mut statistics.rays);
                controls.bias_sq(&measure, error)
            });
        }
        let estimate = measure.estimate(bias_sq, error, passes.count);
        let is_hopeless = student(f32::INFINITY) * estimate.bias > error;
        stalled = if is_hopeless && estimate.bias > STALLED * last_bias { stalled + 1 } else { 0 };
        last_bias = estimate.bias;
        if estimate.is_reached || round == MAX_ROUNDS || quality >= most || stalled == MAX_STALLED {
            statistics.render_seconds = start.elapsed().as_secs_f64();
            return Ok((Rendering { film: passes.film, statistics }, estimate));
        }
        let excess = estimate.excess(error);
        // What bias is left only better passes take away.
        let missing = if is_hopeless { f32::INFINITY } else { passes.weight * (excess * excess - 1.0) / PASSES as f32 };
        quality = missing.clamp(quality / GROWTH, GROWTH * quality).clamp(least, most);
    }
}

/// The passes so far.
struct Passes {
    film: Film,
    count: u32,
    weight: f32,
    /// Sums over the passes of w^2, and for each pixel of w^2 x and w^2 x^2.
    weight_sq: f64,
    value: Vec<f64>,
    value_sq: Vec<f64>,
}

/// What the passes tell.
struct Measure {
    size: UVec2,
    mean: Vec<f32>,
    /// The scale D of each pixel's relative error, and the variance of its mean divided by D^2.
    scale: Vec<f32>,
    variance: Vec<f32>,
    /// Number of passes if they counted alike.
    alike: f32,
}

fn grey(value: Vec3) -> f32 {
    value.element_sum() / 3.0
}

impl Passes {
    fn new(size: UVec2) -> Self {
        let film = Film::new(size);
        let zeros = vec![0.0; film.pixel_count()];
        Self { film, count: 0, weight: 0.0, weight_sq: 0.0, value: zeros.clone(), value_sq: zeros }
    }

    fn add(&mut self, film: &Film, weight: f32) {
        self.count += 1;
        self.weight += weight;
        self.film.mix(film, weight / self.weight);
        let weight_sq = f64::from(weight) * f64::from(weight);
        self.weight_sq += weight_sq;
        for (pixel, (value, value_sq)) in self.value.iter_mut().zip(&mut self.value_sq).enumerate() {
            let x = f64::from(grey(film.terms(pixel).sum()));
            *value += weight_sq * x;
            *value_sq += weight_sq * x * x;
        }
    }

    fn measure(&self) -> Measure {
        let picture = self.film.picture();
        let size = self.film.size;
        let floor_sq = metrics::floor_sq(metrics::finite_means(&picture));
        let weight = f64::from(self.weight);
        let alike = weight * weight / self.weight_sq;
        let mean: Vec<f32> = picture.into_iter().map(grey).collect();
        let measured = mean.iter().zip(self.value.iter().zip(&self.value_sq)).map(|(&mean, (value, value_sq))| {
            let m = f64::from(mean);
            let scale_sq = m * m + floor_sq;
            let spread = (value_sq - 2.0 * m * value + m * m * self.weight_sq).max(0.0);
            let variance = spread / (weight * weight) * alike / (alike - 1.0);
            #[expect(clippy::cast_possible_truncation, reason = "an estimate")]
            let single = (scale_sq.sqrt() as f32, (variance / scale_sq) as f32);
            single
        });
        let (scale, variance) = measured.unzip();
        #[expect(clippy::cast_possible_truncation, reason = "at most the number of passes")]
        let alike = alike as f32;
        Measure { size, mean, scale, variance, alike }
    }
}

impl Measure {
    /// The error with this mean square of the relative bias.
    fn estimate(&self, bias_sq: f32, asked: f32, passes: u32) -> ErrorEstimate {
        // Two of the nine pixels that are averaged count as independent: neighbours share records.
        let t = student(2.0 * (self.alike - 1.0));
        let relative: Vec<f32> =
            (0..self.mean.len()).into_par_iter().map(|pixel| t * (self.around(pixel) + bias_sq).sqrt()).collect();
        let within = relative.iter().filter(|&&relative| relative <= asked).count();
        let share = within as f32 / relative.len() as f32;
        ErrorEstimate { relative, share, bias: bias_sq.sqrt(), passes, is_reached: share >= WANTED_SHARE }
    }

    /// The relative variance around a pixel, the mean of 3 x 3.
    fn around(&self, pixel: usize) -> f32 {
        let (width, height) = (self.size.x as usize, self.size.y as usize);
        let (x, y) = (pixel % width, pixel / width);
        let (mut sum, mut count) = (0.0, 0.0);
        for row in y.saturating_sub(1)..(y + 2).min(height) {
            for column in x.saturating_sub(1)..(x + 2).min(width) {
                sum += self.variance[row * width + column];
                count += 1.0;
            }
        }
        sum / count
    }
}

impl ErrorEstimate {
    /// How many times the error asked for is exceeded by all but 5 % of the pixels.
    fn excess(&self, asked: f32) -> f32 {
        let mut sorted = self.relative.clone();
        sorted.sort_unstable_by(f32::total_cmp);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below the length")]
        let place = (WANTED_SHARE * (sorted.len() - 1) as f32).ceil() as usize;
        sorted[place] / asked
    }
}

/// The quantile of Student's distribution that is exceeded in one of 20 cases, either way (Cornish and Fisher's expansion; 2 % too small for 4 degrees
/// of freedom).
fn student(degrees: f32) -> f32 {
    1.96 + (2.372 + 2.822 / degrees) / degrees
}

/// Pixels at which paths verify the picture.
struct Controls {
    seed: u64,
    groups: u64,
    pixels: Vec<Control>,
}

/// One of them: its place, and sums over the groups of paths.
#[derive(Clone, Copy)]
struct Control {
    position: UVec2,
    sum: f64,
    sum_sq: f64,
}

impl Controls {
    fn new(settings: &Settings) -> Self {
        let seed = hash_pair(settings.seed, CONTROL_STREAM);
        let cells = (0..CONTROL_SIDE * CONTROL_SIDE).map(|cell| UVec2::new(cell % CONTROL_SIDE, cell / CONTROL_SIDE));
        let pixels = cells.map(|cell| {
            let mut sampler = Sampler::new(seed, u64::from(cell.x), cell.y);
            let place = (cell.as_vec2() + sampler.next_pair()) / CONTROL_SIDE as f32 * settings.size.as_vec2();
            Control { position: place.as_uvec2().min(settings.size - 1), sum: 0.0, sum_sq: 0.0 }
        });
        Self { seed, groups: 0, pixels: pixels.collect() }
    }

    /// Traces more paths, as many as the rays so far allow.
    fn trace(&mut self, scene: &Scene, size: UVec2, rays: &mut RayCounts) {
        let allowed = rays.total() / (CONTROL_SHARE * RAYS_OF_PATH * self.pixels.len() as u64 * u64::from(GROUP));
        let groups = self.groups..allowed.max(self.groups + MIN_GROUPS);
        let (seed, first) = (self.seed, groups.start);
        self.groups = groups.end;
        let counts: Vec<RayCounts> = self
            .pixels
            .par_iter_mut()
            .enumerate()
            .map(|(number, control)| {
                let mut tracer = PathTracer::new(scene);
                for group in first..groups.end {
                    let key = hash_pair(group, number as u64);
                    let paths = (0..GROUP).map(|path| {
                        let mut sampler = Sampler::new(seed, key, path);
                        let film = control.position.as_vec2() + sampler.next_pair();
                        let ray = scene.camera_ray(film, size);
                        f64::from(grey(tracer.trace(&ray, &mut sampler).terms.sum()))
                    });
                    let mean = paths.sum::<f64>() / f64::from(GROUP);
                    control.sum += mean;
                    control.sum_sq += mean * mean;
                }
                tracer.rays
            })
            .collect();
        for count in counts {
            *rays += count;
        }
    }

    /// The mean square of the picture's relative bias: what the difference from the paths has beyond the noise of both. Pixels where that noise is large
    /// beside the error asked for count little.
    fn bias_sq(&self, measure: &Measure, asked: f32) -> f32 {
        let groups = self.groups as f64;
        let (mut sum, mut total) = (0.0, 0.0);
        for control in &self.pixels {
            let pixel = (control.position.y * measure.size.x + control.position.x) as usize;
            let scale_sq = f64::from(measure.scale[pixel]).powi(2);
            let mean = control.sum / groups;
            let of_paths = (control.sum_sq / groups - mean * mean).max(0.0) / (groups - 1.0) / scale_sq;
            let noise = of_paths + f64::from(measure.around(pixel));
            let difference_sq = (mean - f64::from(measure.mean[pixel])).powi(2) / scale_sq;
            let weight = (noise + f64::from(0.25 * asked * asked)).powi(-2);
            sum += weight * (difference_sq - noise);
            total += weight;
        }
        #[expect(clippy::cast_possible_truncation, reason = "an estimate")]
        let bias_sq = (sum / total).max(0.0) as f32;
        bias_sq
    }
}

/// Keeps the random numbers of controls apart from those of pictures.
const CONTROL_STREAM: u64 = 0x0063_6f6e_7472_6f6c;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rng;

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

    #[test]
    fn one_pixel_of_twenty_is_farther_off_than_it_says() {
        for weights in [&[1.0; 4][..], &[1.0; 16], &[1.0, 1.0, 1.0, 1.0, 4.0, 4.0, 4.0, 4.0]] {
            let passes = noisy(UVec2::splat(100), weights);
            let measure = passes.measure();
            let estimate = measure.estimate(0.0, 0.1, passes.count);
            let is_off = |(mean, relative): (&f32, &f32)| (mean - 1.0).abs() > relative * (1.0f32 + 0.016).sqrt();
            let off = measure.mean.iter().zip(&estimate.relative).filter(|&pair| is_off(pair)).count();
            // Of 10,000 pixels 500; the neighbours' noise is known too, so that fewer are off than Student's t allows.
            assert!((100..560).contains(&off), "{} passes: {off}", weights.len());
        }
    }

    #[test]
    fn excess_tells_what_more_passes_bring() {
        let few = noisy(UVec2::splat(64), &[1.0; 8]).measure().estimate(0.0, 0.02, 8);
        let many = noisy(UVec2::splat(64), &[1.0; 32]).measure().estimate(0.0, 0.02, 32);
        let ratio = few.excess(0.02) / many.excess(0.02);
        assert!(!few.is_reached && (1.9..2.6).contains(&ratio), "four times the passes: {ratio}");
        let biased = noisy(UVec2::splat(64), &[1.0; 32]).measure().estimate(0.01, 0.02, 32);
        assert!(biased.excess(0.02) > 0.2 / 0.02, "a bias of 0.1 stays");
    }

    #[test]
    fn student_is_known() {
        for (degrees, known) in [(6.0, 2.447), (10.0, 2.228), (30.0, 2.042), (1e6, 1.960)] {
            assert!((student(degrees) / known - 1.0).abs() < 0.01, "{degrees}: {}", student(degrees));
        }
    }
}
