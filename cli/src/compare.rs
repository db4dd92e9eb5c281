//! `freelux compare`: how far a picture is from its reference, as a table on stdout.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;

use integrator::metrics::{self, DEFAULT_PIXELS_PER_DEGREE, Flip, Image, RatioOfMeans, RelMse};
use scene::Picture;

use crate::encode::png_of_codes;
use crate::failure::{Failure, note, print};
use crate::files;

/// Measure how far a picture is from its reference: relMSE, FLIP and the ratio of their means.
///
/// Pictures are EXR, HDR, PNG or JPEG; codes of 8 bits are made linear by the sRGB curve. Pixels that are not finite
/// are counted, and left out of relMSE and the means.
#[derive(Debug, clap::Args)]
pub(crate) struct CompareArgs {
    /// The picture
    image: PathBuf,
    /// What it should be
    reference: PathBuf,
    /// Write a picture of the difference: red where the picture is brighter, blue where it is darker, full colour at
    /// half of the reference, yellow where a pixel is not finite
    #[arg(long, value_name = "FILE.png")]
    diff: Option<PathBuf>,
    /// End with exit code 1 when a measure is above this: relmse, robust, flip, or ratio (distance of the ratio of
    /// means from 1); may be given for several
    #[arg(long, value_name = "MEASURE=LIMIT")]
    max: Vec<Limit>,
}

/// The measures that `--max` knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Measure {
    RelMse,
    Robust,
    Flip,
    Ratio,
}

impl Measure {
    const ALL: [Self; 4] = [Self::RelMse, Self::Robust, Self::Flip, Self::Ratio];

    /// The name on the command line.
    fn name(self) -> &'static str {
        match self {
            Self::RelMse => "relmse",
            Self::Robust => "robust",
            Self::Flip => "flip",
            Self::Ratio => "ratio",
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Limit {
    measure: Measure,
    most: f64,
}

impl FromStr for Limit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parse = || {
            let (name, most) = text.split_once('=')?;
            let measure = Measure::ALL.into_iter().find(|measure| measure.name() == name)?;
            let most = most.parse().ok().filter(|most: &f64| *most >= 0.0)?;
            Some(Self { measure, most })
        };
        parse().ok_or_else(|| "write relmse=0.01, robust=0.003, flip=0.05 or ratio=0.01".to_owned())
    }
}

/// All that is found.
struct Comparison {
    rel_mse: RelMse,
    flip: Flip,
    flip_exposure: f32,
    ratio: RatioOfMeans,
}

/// Compares, prints the table, writes the difference and checks the limits.
pub(crate) fn run(args: &CompareArgs) -> Result<ExitCode, Failure> {
    if let Some(diff) = &args.diff {
        if diff.extension().is_none_or(|suffix| !suffix.eq_ignore_ascii_case("png")) {
            return Err(Failure::Input(format!("--diff {}: its suffix must be .png", diff.display())));
        }
        files::check_writable(diff)?;
        files::check_apart(&[diff], &[&args.image, &args.reference])?;
        files::await_files(&[diff]);
    }
    let read = |path: &Path| Picture::read(path).map_err(Failure::input);
    let (a, b) = (read(&args.image)?, read(&args.reference)?);
    let names = format!("{} and {}", args.image.display(), args.reference.display());
    let refuse =
        |error: metrics::MetricsError| Failure::Input(format!("{names}: {error}; compare pictures of one view"));
    let image = Image::new(a.size, &a.pixels).map_err(refuse)?;
    let reference = Image::new(b.size, &b.pixels).map_err(refuse)?;
    let found = measure(&image, &reference, &b).map_err(refuse)?;
    if let Some(diff) = &args.diff {
        let codes = metrics::signed_difference(&image, &reference).map_err(refuse)?;
        files::write_all(&[(diff, png_of_codes(a.size, &codes)?)])?;
    }
    // Whoever reads only a part of the table still asked for the limits.
    let printed = match print(&found.table()) {
        Err(Failure::ClosedPipe) => Ok(()),
        other => other,
    };
    printed?;
    let mut code = ExitCode::SUCCESS;
    for limit in args.max.iter().filter(|limit| !found.within(limit)) {
        note(&format!("{names}: {} is above {}, or pixels are not finite", limit.measure.name(), limit.most));
        code = ExitCode::FAILURE;
    }
    Ok(code)
}

fn measure(image: &Image, reference: &Image, decoded: &Picture) -> Result<Comparison, metrics::MetricsError> {
    let rel_mse = metrics::rel_mse(image, reference)?;
    // Codes for a display are exposed already.
    #[expect(clippy::cast_possible_truncation, reason = "an exposure needs no more digits")]
    let flip_exposure = if decoded.format.is_coded() { 1.0 } else { rel_mse.exposure as f32 };
    let flip = metrics::ldr_flip(image, reference, flip_exposure, DEFAULT_PIXELS_PER_DEGREE)?;
    Ok(Comparison { rel_mse, flip, flip_exposure, ratio: metrics::ratio_of_means(image, reference)? })
}

impl Comparison {
    /// Whether a measure keeps its limit. Pixels that are not finite keep none, and neither does NaN.
    fn within(&self, limit: &Limit) -> bool {
        let value = match limit.measure {
            Measure::RelMse => self.rel_mse.plain,
            Measure::Robust => self.rel_mse.robust,
            Measure::Flip => self.flip.mean,
            Measure::Ratio => (self.ratio.overall - 1.0).abs(),
        };
        value <= limit.most && self.rel_mse.not_finite == 0
    }

    fn table(&self) -> String {
        let [r, g, b] = self.ratio.channels;
        let rows = [
            ("relMSE", format!("{:.4e}", self.rel_mse.plain), format!("exposure {:.4}", self.rel_mse.exposure)),
            ("relMSE robust", format!("{:.4e}", self.rel_mse.robust), "without the worst 0.1 % of the pixels".into()),
            ("FLIP", format!("{:.4}", self.flip.mean), format!("exposure {:.4}, clamped", self.flip_exposure)),
            ("ratio of means", format!("{:.4}", self.ratio.overall), format!("red {r:.4}, green {g:.4}, blue {b:.4}")),
            ("not finite", self.rel_mse.not_finite.to_string(), "pixels".into()),
        ];
        rows.iter().fold(String::new(), |mut table, (name, value, remark)| {
            let _ = writeln!(table, "{name:<14}  {value:>10}  {remark}");
            table
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_read_and_others_refused() {
        let limit = |text: &str| text.parse::<Limit>();
        assert_eq!(limit("robust=3e-3"), Ok(Limit { measure: Measure::Robust, most: 3e-3 }), "as written");
        for text in ["robust", "robust=", "robust=-1", "robust=nan", "psnr=3", "=1", ""] {
            assert!(limit(text).is_err(), "{text:?}");
        }
    }
}
