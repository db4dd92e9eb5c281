//! From records to lines of a chart: error over time, and the time that a method takes to an error.

use super::record::Record;

/// Errors below this share of the reference's own are not told from it: no figure is quoted there.
const FLOOR_SHARE: f64 = 1.0 / 3.0;

/// Which error: of all pixels, or without the worst 0.1 % of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Measure {
    Plain,
    Robust,
}

/// relMSE, the reference's own subtracted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Net {
    /// Not less than the floor.
    pub(crate) error: f64,
    /// Whether the error is lost in the reference's noise, so that `error` is the floor.
    pub(crate) is_floor: bool,
}

impl Net {
    fn new(measured: f64, own: f64) -> Self {
        let (net, floor) = (measured - own, FLOOR_SHARE * own);
        if net > floor { Self { error: net, is_floor: false } } else { Self { error: floor, is_floor: true } }
    }
}

/// All renderings of a method at one quality.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Point {
    pub(crate) quality: f64,
    /// Median.
    pub(crate) seconds: f64,
    /// From the mean of the errors, for relMSE is itself a mean.
    pub(crate) plain: Net,
    pub(crate) robust: Net,
    pub(crate) flip: Option<f64>,
    pub(crate) ratio_of_means: Option<f64>,
}

impl Point {
    pub(crate) fn net(&self, measure: Measure) -> Net {
        match measure {
            Measure::Plain => self.plain,
            Measure::Robust => self.robust,
        }
    }
}

/// A method in one scene.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Line {
    pub(crate) method: String,
    /// By rising time.
    pub(crate) points: Vec<Point>,
    /// The least errors that the reference allows to quote, plain and robust.
    floors: [f64; 2],
}

/// When a line comes down to an error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Reached {
    /// After so many seconds, between two measured points. `stays` is false where a later point lies above the error
    /// again.
    At { seconds: f64, stays: bool },
    /// The cheapest picture is better already.
    Before { seconds: f64 },
    /// Later than measured, if the error goes on to fall as one over time.
    Extrapolated { seconds: f64 },
    /// Never in what was measured; the least error of all.
    Never { least: Net },
    /// The error is too small for the reference to tell.
    Unknowable,
}

impl Reached {
    /// The seconds, where they are known at all.
    pub(crate) fn seconds(self) -> Option<f64> {
        match self {
            Self::At { seconds, .. } | Self::Before { seconds } | Self::Extrapolated { seconds } => Some(seconds),
            Self::Never { .. } | Self::Unknowable => None,
        }
    }
}

/// Returns the lines of one scene, in the order in which their methods first come.
pub(crate) fn lines(records: &[Record], scene: &str) -> Vec<Line> {
    let mut lines: Vec<(&str, Vec<&Record>)> = Vec::new();
    for record in records.iter().filter(|record| record.scene == scene) {
        match lines.iter_mut().find(|(method, _)| *method == record.method) {
            Some((_, of_method)) => of_method.push(record),
            None => lines.push((&record.method, vec![record])),
        }
    }
    lines.into_iter().map(|(method, of_method)| line(method, of_method)).collect()
}

fn line(method: &str, mut records: Vec<&Record>) -> Line {
    let floor = |own: fn(&Record) -> Option<f64>| {
        FLOOR_SHARE * records.iter().filter_map(|record| own(record)).fold(0.0, f64::max)
    };
    let floors = [floor(|record| record.reference_relmse), floor(|record| record.reference_robust)];
    records.sort_by(|a, b| a.quality.total_cmp(&b.quality));
    let mut points: Vec<Point> = records.chunk_by(|a, b| a.quality == b.quality).map(point).collect();
    points.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
    Line { method: method.to_owned(), points, floors }
}

/// Joins the renderings at one quality, of which there is at least one.
fn point(records: &[&Record]) -> Point {
    let mean = |value: &dyn Fn(&Record) -> Option<f64>| {
        let values: Vec<f64> = records.iter().filter_map(|record| value(record)).collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    };
    let net = |measured: &dyn Fn(&Record) -> Option<f64>, own: &dyn Fn(&Record) -> Option<f64>| {
        Net::new(mean(measured).expect("every record has it"), mean(own).unwrap_or(0.0))
    };
    Point {
        quality: records[0].quality,
        seconds: median(records.iter().map(|record| record.seconds).collect()),
        plain: net(&|record| Some(record.relmse), &|record| record.reference_relmse),
        robust: net(&|record| Some(record.robust), &|record| record.reference_robust),
        flip: mean(&|record| record.flip),
        ratio_of_means: mean(&|record| record.ratio_of_means),
    }
}

/// The middle of the values, of which there is at least one; of an even number the mean of the two in the middle.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let (low, high) = ((values.len() - 1) / 2, values.len() / 2);
    0.5 * (values[low] + values[high])
}

impl Line {
    /// Returns when the line first comes down to `error`: straight between measured points where both axes are
    /// logarithmic.
    ///
    /// What `path` would take is extrapolated, as the error of independent samples falls as one over their number;
    /// nobody knows that of a method with a bias.
    pub(crate) fn reach(&self, error: f64, measure: Measure) -> Reached {
        // A point at its floor has at most that error: it shows that a larger one was reached, and nothing of a smaller
        // one.
        if error < self.floors[usize::from(measure == Measure::Robust)] {
            return Reached::Unknowable;
        }
        let errors: Vec<f64> = self.points.iter().map(|point| point.net(measure).error).collect();
        let Some(first) = errors.iter().position(|&e| e <= error) else {
            return self.beyond(error, measure);
        };
        if first == 0 {
            return Reached::Before { seconds: self.points[0].seconds };
        }
        let (before, after) = (&self.points[first - 1], &self.points[first]);
        let seconds = log_interpolate((errors[first - 1], before.seconds), (errors[first], after.seconds), error);
        Reached::At { seconds, stays: errors[first..].iter().all(|&e| e <= error) }
    }

    /// An error that no point has.
    fn beyond(&self, error: f64, measure: Measure) -> Reached {
        let Some(last) = self.points.last() else { return Reached::Unknowable };
        if samples_are_independent(&self.method) {
            return Reached::Extrapolated { seconds: last.seconds * last.net(measure).error / error };
        }
        let nets = self.points.iter().map(|point| point.net(measure));
        let least = nets.min_by(|a, b| a.error.total_cmp(&b.error)).expect("there is a last one");
        Reached::Never { least }
    }
}

/// Whether a line is that of a path tracer, by its name: `path`, or another program's, `mitsuba-path`.
fn samples_are_independent(method: &str) -> bool {
    let path = integrator::Method::Path.name();
    method.strip_suffix(path).is_some_and(|program| program.is_empty() || program.ends_with('-'))
}

/// y at `x` on the line through two points of positive coordinates, straight where both axes are logarithmic.
fn log_interpolate((x0, y0): (f64, f64), (x1, y1): (f64, f64), x: f64) -> f64 {
    let share = if x0 == x1 { 1.0 } else { (x / x0).ln() / (x1 / x0).ln() };
    y0 * (share * (y1 / y0).ln()).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(quality: f64, seconds: f64, error: f64) -> Record {
        let (scene, method) = ("a".to_owned(), "gather".to_owned());
        Record { scene, method, quality, seconds, relmse: 2.0 * error, robust: error, ..Record::default() }
    }

    fn robust(records: &[Record], error: f64) -> Reached {
        lines(records, "a")[0].reach(error, Measure::Robust)
    }

    #[test]
    fn between_points_the_line_is_straight_in_logarithms() {
        // Error 1/t^2: at 1e-3 between (1, 1e-2) and (10, 1e-4) that is sqrt(10) seconds.
        let records = [record(10.0, 10.0, 1e-4), record(1.0, 1.0, 1e-2)];
        let Reached::At { seconds, stays: true } = robust(&records, 1e-3) else { panic!("reached and kept") };
        assert!((seconds - 10_f64.sqrt()).abs() < 1e-9, "{seconds}");
        let plain = lines(&records, "a")[0].reach(2e-3, Measure::Plain);
        assert!((plain.seconds().unwrap() - 10_f64.sqrt()).abs() < 1e-9, "twice the error is the plain one: {plain:?}");
        // The reference's own is subtracted: 2.1e-3 - 1e-4 at the first point.
        let own = |error: f64| Record { reference_robust: Some(1e-4), ..record(error, 2e-3 / error, error + 1e-4) };
        let seconds = robust(&[own(2e-3), own(2e-4)], 1e-3).seconds().unwrap();
        assert!((seconds - 2.0).abs() < 1e-9, "{seconds}");
    }

    #[test]
    fn what_is_not_between_points_is_told_apart() {
        let records = [record(1.0, 1.0, 1e-2), record(2.0, 2.0, 4e-3)];
        assert_eq!(robust(&records, 2e-2), Reached::Before { seconds: 1.0 }, "the first point is better");
        let least = Net { error: 4e-3, is_floor: false };
        assert_eq!(robust(&records, 1e-3), Reached::Never { least }, "nobody knows when");
        let named = |method: &str| records.clone().map(|record| Record { method: method.into(), ..record });
        for path in ["path", "mitsuba-path"] {
            let found = robust(&named(path), 1e-3);
            assert_eq!(
                found,
                Reached::Extrapolated { seconds: 8.0 },
                "{path}: a quarter of the error, four times the time"
            );
        }
        let denoised = robust(&named("mitsuba-path-oidn"), 1e-3);
        assert_eq!(denoised, Reached::Never { least }, "a denoised picture keeps its bias");
        assert!(lines(&records, "b").is_empty(), "another scene");
    }

    #[test]
    fn an_error_that_comes_back_is_marked() {
        let records = [record(1.0, 1.0, 1e-2), record(2.0, 2.0, 1e-3), record(3.0, 4.0, 5e-3)];
        assert_eq!(robust(&records, 1e-3), Reached::At { seconds: 2.0, stays: false }, "reached by chance");
    }

    #[test]
    fn nothing_is_quoted_far_below_the_reference() {
        let noisy = |record: Record| Record { reference_robust: Some(3e-3), ..record };
        let records = [noisy(record(1.0, 1.0, 5e-2)), noisy(record(2.0, 2.0, 2.9e-3))];
        let line = &lines(&records, "a")[0];
        assert_eq!(line.points[1].robust, Net { error: 1e-3, is_floor: true }, "lost in the noise: the floor");
        assert_eq!(robust(&records, 0.9e-3), Reached::Unknowable, "below the floor");
        assert!(matches!(robust(&records, 2e-3), Reached::At { .. }), "above it");
    }

    #[test]
    fn repetitions_join_by_median_and_mean() {
        let records = [record(1.0, 1.0, 1e-3), record(1.0, 9.0, 2e-3), record(1.0, 2.0, 3e-3)];
        let line = &lines(&records, "a")[0];
        assert_eq!(line.points.len(), 1, "one quality");
        assert_eq!(line.points[0].seconds, 2.0, "the median");
        assert!((line.points[0].robust.error - 2e-3).abs() < 1e-12, "the mean");
        assert_eq!(median(vec![1.0, 4.0]), 2.5, "of an even number");
    }
}
