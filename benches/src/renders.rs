//! Renderings that tables are made of: their time, memory and errors.

use std::fs;

use integrator::metrics::{self, Image, MetricsError, Reference};
use integrator::{Rendering, Settings};
use scene::Scene;

/// The scenes in `tests/data/study`, which have converged references.
pub const STUDY_SCENES: [&str; 3] = ["cornell", "cornell-glossy", "atrium-env"];

/// Errors below this share of the reference's own are not told from it: no figure is quoted there.
const FLOOR_SHARE: f64 = 1.0 / 3.0;

/// Renders on as many threads as the present pool has.
///
/// # Panics
/// If a setting is out of its range.
#[must_use]
pub fn render(scene: &Scene, settings: &Settings) -> Rendering {
    integrator::render(scene, settings, &|_| ()).expect("settings in their ranges")
}

/// Runs `work` on `threads` threads.
///
/// # Panics
/// If the system gives no more threads.
pub fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a few threads").install(work)
}

/// Renderings of one kind, each with a seed of its own.
#[derive(Debug, Default)]
pub struct Runs {
    seconds: Vec<f64>,
    plain: Vec<f64>,
    robust: Vec<f64>,
    ratios: Vec<f64>,
}

impl Runs {
    /// Renders, and measures time and error.
    ///
    /// # Panics
    /// If a setting is out of its range, or the reference is of another size.
    pub fn add(&mut self, scene: &Scene, settings: &Settings, reference: &Reference) {
        let Rendering { film, statistics, .. } = render(scene, settings);
        let picture = film.picture();
        let image = Image::new(film.size, &picture).expect("a full picture");
        let against = reference.image();
        let error = metrics::rel_mse(&image, &against).expect("a picture of the reference's size");
        let ratio = metrics::ratio_of_means(&image, &against).expect("the same picture");
        self.seconds.push(statistics.render_seconds);
        self.plain.push(error.plain);
        self.robust.push(error.robust);
        self.ratios.push(ratio.overall);
    }

    /// Returns the median of the times.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        median(self.seconds.clone())
    }

    /// Returns the mean ratio of means.
    #[must_use]
    pub fn ratio(&self) -> f64 {
        mean(&self.ratios)
    }

    /// Returns the mean relMSE, plain and robust, without the reference's own.
    ///
    /// # Errors
    /// When no pixel of the reference is finite.
    pub fn errors(&self, reference: &Reference) -> Result<[Net; 2], MetricsError> {
        let own = reference.own_rel_mse()?;
        let own = own.map_or([0.0; 2], |own| [own.plain, own.robust]);
        Ok([Net::new(mean(&self.plain), own[0]), Net::new(mean(&self.robust), own[1])])
    }
}

/// An error without the reference's own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Net {
    /// Not less than a third of the reference's own.
    pub error: f64,
    /// Whether it is lost in the reference's noise, so that `error` is that third.
    pub is_floor: bool,
}

impl Net {
    fn new(measured: f64, own: f64) -> Self {
        let (net, floor) = (measured - own, FLOOR_SHARE * own);
        if net > floor { Self { error: net, is_floor: false } } else { Self { error: floor, is_floor: true } }
    }
}

impl std::fmt::Display for Net {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}{:.1e}", if self.is_floor { "< " } else { "" }, self.error)
    }
}

/// Returns the middle of the values; of an even number the mean of the two in the middle, of none NaN.
#[must_use]
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => f64::NAN,
        count => 0.5 * (values[(count - 1) / 2] + values[count / 2]),
    }
}

/// Returns the mean; of no values NaN.
#[must_use]
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Returns the power of x with which y grows: the slope of the line through the points where both axes are logarithmic,
/// by least squares.
#[must_use]
pub fn exponent(points: &[(f64, f64)]) -> f64 {
    let logs: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let count = logs.len() as f64;
    let (x, y) = logs.iter().fold((0.0, 0.0), |sum, log| (sum.0 + log.0 / count, sum.1 + log.1 / count));
    let (above, below) =
        logs.iter().fold((0.0, 0.0), |sum, log| (sum.0 + (log.0 - x) * (log.1 - y), sum.1 + (log.0 - x) * (log.0 - x)));
    above / below
}

/// Begins anew to look for the largest resident size of the process; does nothing where the system has no such file
/// (all but Linux).
pub fn forget_peak() {
    // 5: see proc_pid_clear_refs(5). Where it fails, the peak is that of the whole process so far.
    let _ = fs::write("/proc/self/clear_refs", "5");
}

/// Returns the largest resident size in bytes since [`forget_peak`]; `None` where the system does not tell (all but
/// Linux).
#[must_use]
pub fn peak_bytes() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let kib: u64 =
        status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}

/// Returns the processor's name, or its architecture where the system does not tell (all but Linux).
#[must_use]
pub fn processor() -> String {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name =
        text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':').map(|(_, name)| name.trim()));
    name.unwrap_or(std::env::consts::ARCH).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_is_found_from_its_points() {
        let points = [1.0, 4.0, 16.0, 64.0_f64].map(|x| (x, 3.0 * x.powf(0.4)));
        assert!((exponent(&points) - 0.4).abs() < 1e-12, "{}", exponent(&points));
    }

    #[test]
    fn nothing_is_quoted_far_below_the_reference() {
        assert_eq!(Net::new(3e-3, 1e-3), Net { error: 2e-3, is_floor: false }, "above");
        assert_eq!(Net::new(1.1e-3, 9e-4).to_string(), "< 3.0e-4", "lost in its noise");
    }
}
