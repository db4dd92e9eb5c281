//! `freelux explain`: why one pixel looks as it does, on stdout.

use std::fmt::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use glam::{UVec2, Vec3, Vec3A};
use integrator::{Explanation, IrradianceFacts, PixelEstimate, PointExplanation, RecordFacts, Settings, Step, Verdict};
use scene::{Material, Scene};

use crate::failure::{Failure, note, print, printable};
use crate::progress::Reporter;
use crate::view::ViewArgs;

/// Tell what became of one pixel while the whole picture is made.
///
/// Its light by terms, beside what paths find there and how far off it may be; and for each surface in it the records,
/// verification, holes and incident light. Takes about the time of three pictures.
#[derive(Debug, clap::Args)]
pub(crate) struct ExplainArgs {
    /// Scene (.toml or .obj)
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Column of the pixel, from 0 at the left
    #[arg(value_name = "X")]
    x: u32,
    /// Row of the pixel, from 0 at the top
    #[arg(value_name = "Y")]
    y: u32,
    #[command(flatten)]
    view: ViewArgs,
    /// Show no progress
    #[arg(long, short)]
    quiet: bool,
}

/// Renders with an eye on the pixel, and prints what it saw.
pub(crate) fn run(args: &ExplainArgs) -> Result<ExitCode, Failure> {
    args.view.check()?;
    args.view.pool()?.install(|| args.explain())?;
    Ok(ExitCode::SUCCESS)
}

impl ExplainArgs {
    fn explain(&self) -> Result<(), Failure> {
        let name = self.scene.display();
        let loaded = self.view.load(Some(&self.scene))?;
        let mut description = loaded.description;
        description.camera = self.view.camera(&description)?;
        let scene =
            Scene::new(description).map_err(|error| Failure::Input(format!("{name}: {error}; mend the scene")))?;
        let settings = self.view.settings(&loaded.settings);
        let reporter = Reporter::new(self.quiet);
        let pixel = UVec2::new(self.x, self.y);
        let progress = |progress| reporter.update(progress);
        let found = integrator::explain(&scene, &settings, pixel, &progress).and_then(|explanation| {
            Ok((explanation, integrator::estimate_pixel(&scene, &settings, pixel, &progress)?))
        });
        reporter.finish();
        let (explanation, estimate) =
            found.map_err(|error| Failure::Input(format!("{name}: {error}; name another")))?;
        if !self.quiet {
            for warning in &loaded.warnings {
                note(&format!("warning: {warning}"));
            }
        }
        print(&text(pixel, &settings, &explanation, &estimate, scene.materials()))
    }
}

/// The whole answer.
fn text(
    pixel: UVec2,
    settings: &Settings,
    found: &Explanation,
    estimate: &PixelEstimate,
    materials: &[Material],
) -> String {
    let mut text = String::new();
    row(
        &mut text,
        0,
        "pixel",
        &format!(
            "{}, {} of {} x {}, {} at quality {}, seed {}, {} samples",
            pixel.x,
            pixel.y,
            settings.size.x,
            settings.size.y,
            settings.method.name(),
            settings.quality,
            settings.seed,
            found.statistics.spp
        ),
    );
    let terms = &found.terms;
    for (name, value) in [
        ("emitted", terms.emitted),
        ("direct", terms.direct),
        ("specular", terms.specular),
        ("caustic", terms.caustic),
        ("indirect", terms.indirect),
        ("sum", terms.sum()),
    ] {
        row(&mut text, 0, name, &rgb(value));
    }
    explain_error(&mut text, terms.sum(), estimate);
    for (number, point) in found.points.iter().enumerate() {
        let material = materials.get(point.material as usize).map_or("", |material| material.name.as_str());
        explain_point(&mut text, number, point, material);
    }
    text
}

/// What paths find in the pixel, and how far off it may be.
fn explain_error(text: &mut String, sum: Vec3, estimate: &PixelEstimate) {
    let percent = |share: f32| 100.0 * share;
    let difference = (sum - estimate.reference).element_sum() / (3.0 * estimate.scale);
    let reference = format!(
        "{} by {} paths, to {:.2} % (standard error); the picture differs by {:+.2} %",
        rgb(estimate.reference),
        estimate.paths,
        percent(estimate.reference_noise),
        percent(difference)
    );
    row(text, 0, "paths", &reference);
    let error = format!(
        "{:.2} % is exceeded by one such pixel of 20: noise {:.2} %, bias {:.2} % (of which noise of its paths can feign {:.2} %)",
        percent(estimate.error),
        percent(estimate.noise),
        percent(estimate.bias),
        percent(estimate.bias_noise)
    );
    row(text, 0, "error", &error);
}

fn explain_point(text: &mut String, number: usize, point: &PointExplanation, material: &str) {
    let seen = if point.behind_mirror { ", seen in a mirror or through glass" } else { "" };
    row(text, 0, &format!("surface {number}"), &format!("at {}, normal {}{seen}", place(point.p), place(point.n)));
    row(text, 1, "material", &printable(material));
    row(text, 1, "footprint", &format!("{:.3e} m a pixel", point.footprint));
    row(text, 1, "weight", &format!("{} of the pixel for unit incident light", rgb(point.diffuse_weight)));
    for step in &point.steps {
        explain_step(text, step);
    }
    row(text, 1, "incident", &format!("{} from surfaces, {} from the soft sky", rgb(point.near), rgb(point.sky)));
    row(text, 1, "gloss", &format!("{} from the texture under the lobe", rgb(point.glossy)));
    row(
        text,
        1,
        "gives",
        &format!(
            "{} indirect, {} direct",
            rgb(point.diffuse_weight * point.near),
            rgb(point.diffuse_weight * point.sky)
        ),
    );
}

fn explain_step(text: &mut String, step: &Step) {
    match step {
        Step::Interpolated { records } => {
            row(text, 1, "interpolated", &format!("{} records of irradiance reach it", records.len()));
            for record in records {
                row(text, 2, "record", &irradiance_words(record));
            }
        }
        Step::NoRecord => row(text, 1, "asked", "no record reaches it"),
        Step::Refused { record, verdict } => {
            row(text, 1, "refused", &format!("the record {}: {}", record_words(record), verdict_words(*verdict)));
        }
        Step::Reprojected { record, verdict, second_verdict, shares, parts, hole_rays } => {
            row(text, 1, "reprojected", &format!("the record {}", record_words(record)));
            row(text, 2, "verified", &verdict_words(*verdict));
            if let Some(verdict) = second_verdict {
                row(text, 2, "again", &verdict_words(*verdict));
            }
            let percent = |share: f32| 100.0 * share;
            let shares = format!(
                "filled {:.1} %, holes {:.1} % ({:.1} % behind silhouettes that moved), {hole_rays} hole rays",
                percent(shares.filled),
                percent(shares.holes),
                percent(shares.unknown)
            );
            row(text, 2, "hemisphere", &shares);
            let parts = format!(
                "unchanged {:.1} %, moved {:.1} %, bared {:.1} %, opened {:.1} %",
                percent(parts.unchanged),
                percent(parts.moved),
                percent(parts.bared),
                percent(parts.opened)
            );
            row(text, 2, "parts", &parts);
        }
        Step::Gathered { resolution, record } => {
            row(text, 1, "gathered", &format!("{resolution} x {resolution} texels"));
            match record {
                Some(record) => row(text, 2, "record", &format!("made of them, {}", record_words(record))),
                None => row(text, 2, "record", "none: made of none, or it would reach nobody"),
            }
        }
        Step::Spread { places, resolution } => {
            row(
                text,
                1,
                "spread",
                &format!("{resolution} x {resolution} texels from each of {places} places of the pixel"),
            );
        }
    }
}

fn record_words(record: &RecordFacts) -> String {
    format!(
        "at {}, {:.3e} m away, reach {:.3e} m, {} elements in {} layers",
        place(record.centre),
        record.distance,
        record.radius,
        record.elements,
        record.layers
    )
}

fn irradiance_words(record: &IrradianceFacts) -> String {
    format!(
        "{:.0} % by that at {}, {:.3e} m away, reach {:.3e} m: {}",
        100.0 * record.share,
        place(record.centre),
        record.distance,
        record.reach,
        rgb(record.radiance)
    )
}

fn verdict_words(verdict: Verdict) -> String {
    format!("{} of {} rays met something else", verdict.wrong, verdict.asked)
}

fn row(text: &mut String, depth: usize, name: &str, value: &str) {
    let _ = writeln!(text, "{:indent$}{name:<14}  {value}", "", indent = 2 * depth);
}

fn rgb(light: Vec3) -> String {
    format!("{:.4e} {:.4e} {:.4e}", light.x, light.y, light.z)
}

fn place(v: Vec3A) -> String {
    format!("({}, {}, {})", v.x, v.y, v.z)
}
