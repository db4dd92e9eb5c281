//! `freelux render`: load, render, write, tell.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use glam::{UVec2, Vec3};
use integrator::metrics::{self, Image};
use integrator::{ErrorEstimate, Method, Rendering, Settings};
use scene::{FileSettings, Scene};

use crate::args::{self, Output, OutputKind};
use crate::encode::{self, Origin, Term};
use crate::failure::{Failure, print};
use crate::files::{self, Staged};
use crate::machine;
use crate::ply;
use crate::progress::Reporter;
use crate::summary::{self, ErrorSummary, Summary};
use crate::view::ViewArgs;

/// What messages call the scene when none is named.
const DEFAULT_NAME: &str = "the embedded scene";

/// Render a scene to EXR and PNG.
///
/// The EXR holds linear radiance, unclamped, with the terms and albedo, normal and depth as further channels. The PNG
/// is multiplied by 2^EV, clamped and encoded as sRGB. Existing files are replaced, and only by whole ones.
#[derive(Debug, clap::Args)]
pub(crate) struct RenderArgs {
    /// Scene to render (.toml or .obj); an embedded one where none is named
    #[arg(value_name = "SCENE")]
    scene: Option<PathBuf>,
    #[command(flatten)]
    view: ViewArgs,
    /// Render until the relative error is at most E in 95 % of the pixels, by the picture's own estimate, which becomes
    /// a channel of the EXR; the quality is that of the first round
    #[arg(long, value_name = "E", value_parser = args::error, allow_hyphen_values = true, conflicts_with = "spp")]
    error: Option<f32>,
    /// Picture to write, .exr or .png; may be given twice [default: freelux.exr and freelux.png]
    #[arg(long, short, value_name = "FILE.exr|.png", value_parser = args::output())]
    out: Vec<Output>,
    /// Write this term of the picture alone
    #[arg(long, value_enum)]
    term: Option<Term>,
    /// Tell in channels of the EXR how each pixel got its indirect light: interpolated, reprojected or gathered, and
    /// what records knew of its hemisphere
    #[arg(long)]
    rungs: bool,
    /// Write where the records of the cache are, how far they reach and how much light they have, as a cloud of points
    #[arg(long, value_name = "FILE.ply", value_parser = args::ply())]
    records: Option<PathBuf>,
    /// Exposure of the PNG in stops: 0 shows radiance 1 as white [default: the
    /// scene's, or what brings nine tenths of the picture below a half]
    #[arg(long, value_name = "EV", value_parser = args::stops, allow_hyphen_values = true)]
    exposure: Option<f32>,
    /// Tell errors only
    #[arg(long, short)]
    quiet: bool,
    /// Write what was counted and how long it took as JSON; - is stdout
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
}

/// Checks all arguments, then renders in a pool of the threads asked for.
pub(crate) fn run(args: &RenderArgs) -> Result<ExitCode, Failure> {
    let outputs = args.check()?;
    args.view.pool()?.install(|| args.render(&outputs))?;
    Ok(ExitCode::SUCCESS)
}

impl RenderArgs {
    /// Checks what can be checked before anything is loaded; returns the pictures to write.
    fn check(&self) -> Result<Vec<Output>, Failure> {
        self.view.check()?;
        let method = self.view.settings(&FileSettings::default()).method;
        if self.records.is_some() && matches!(method, Method::Path | Method::Gather) {
            let what =
                format!("--records: {} keeps no records; choose --method reproject or cache-only", method.name());
            return Err(Failure::Input(what));
        }
        let outputs = match &self.out[..] {
            [] => ["freelux.exr", "freelux.png"]
                .map(|name| Output::try_from(PathBuf::from(name)).expect("a known suffix"))
                .to_vec(),
            given => given.to_vec(),
        };
        let written = self.written(&outputs);
        for path in &written {
            files::check_writable(path)?;
        }
        let read: Vec<&Path> = self.scene.as_deref().into_iter().chain(self.view.env()).collect();
        files::check_apart(&written, &read)?;
        files::await_files(&written);
        Ok(outputs)
    }

    /// All files that will be written.
    fn written<'a>(&'a self, outputs: &'a [Output]) -> Vec<&'a Path> {
        let stats = self.stats.as_deref().filter(|path| *path != Path::new("-"));
        let records = self.records.as_deref();
        outputs.iter().map(|output| output.path.as_path()).chain(records).chain(stats).collect()
    }

    fn render(&self, outputs: &[Output]) -> Result<(), Failure> {
        let reporter = Reporter::new(self.quiet);
        let name = self.scene.as_ref().map_or(DEFAULT_NAME.to_owned(), |path| path.display().to_string());
        let start = Instant::now();
        let loaded = self.view.load(self.scene.as_deref())?;
        files::check_apart(&self.written(outputs), &loaded.files)?;
        let load_seconds = start.elapsed().as_secs_f64();

        let start = Instant::now();
        let mut description = loaded.description;
        description.camera = self.view.camera(&description)?;
        let scene =
            Scene::new(description).map_err(|error| Failure::Input(format!("{name}: {error}; mend the scene")))?;
        let (rungs, records) = (self.rungs, self.records.is_some());
        let mut settings = Settings { rungs, records, ..self.view.settings(&loaded.settings) };
        // The error says how many samples there are, whatever the scene says.
        settings.spp = settings.spp.filter(|_| self.error.is_none());
        settings.validate().map_err(|error| Failure::Input(format!("{name}: {error}; mend the scene")))?;
        let build_seconds = start.elapsed().as_secs_f64();
        // Told only now, so that a scene that is refused gives one line.
        for warning in &loaded.warnings {
            reporter.note(&format!("warning: {warning}"));
        }
        reporter.note(&format!(
            "loaded {name}: {} triangles, {} free forms",
            scene.triangle_count(),
            scene.form_count()
        ));

        let progress = |progress| reporter.update(progress);
        let result = match self.error {
            Some(error) => {
                let tell = |so_far: &ErrorEstimate| reporter.note(&summary::error_so_far(error, so_far));
                integrator::render_to_error(&scene, &settings, error, &progress, &tell)
                    .map(|(rendering, estimate)| (rendering, Some(estimate)))
            }
            None => integrator::render(&scene, &settings, &progress).map(|rendering| (rendering, None)),
        };
        reporter.finish();
        let (Rendering { film, statistics, records }, estimate) = result.map_err(Failure::input)?;

        let start = Instant::now();
        let whole = film.picture();
        let exposure =
            self.exposure.or(loaded.settings.exposure).unwrap_or_else(|| automatic_exposure(film.size, &whole));
        let picture = self.term.map_or(&whole[..], |term| term.of(&film));
        let origin = Origin { command: &self.command(&settings), seed: settings.seed };
        let mut staged = Staged::default();
        let mut written = Vec::new();
        for Output { path, kind } in outputs {
            match kind {
                OutputKind::Exr => {
                    let error = estimate.as_ref().map(|estimate| &estimate.relative[..]);
                    staged.add(path, |out| encode::exr(&film, picture, self.term, error, &origin, out))?;
                }
                OutputKind::Png => {
                    let bytes = encode::png(film.size, picture, exposure)?;
                    staged.add(path, |out| out.write_all(&bytes))?;
                }
            }
            written.push(path.display().to_string());
        }
        if let Some(path) = &self.records {
            staged.add(path, |out| ply::write(&records, exposure, out))?;
            written.push(path.display().to_string());
        }

        let summary = Summary {
            version: Summary::VERSION,
            freelux: env!("CARGO_PKG_VERSION"),
            command: origin.command,
            scene: &name,
            method: settings.method,
            quality: settings.quality,
            size: settings.size.to_array(),
            seed: settings.seed,
            threads: rayon::current_num_threads(),
            exposure,
            load_seconds,
            build_seconds: build_seconds - scene.light_seconds(),
            light_seconds: scene.light_seconds(),
            encode_seconds: start.elapsed().as_secs_f64(),
            peak_memory_bytes: machine::peak_bytes(),
            error: self.error.zip(estimate.as_ref()).map(|(asked, estimate)| ErrorSummary::new(asked, estimate)),
            statistics: &statistics,
        };
        let to_stdout = self.stats.as_deref() == Some(Path::new("-"));
        if let Some(path) = self.stats.as_deref().filter(|_| !to_stdout) {
            staged.add(path, |out| out.write_all(summary.json().as_bytes()))?;
            written.push(path.display().to_string());
        }
        staged.finish()?;
        for line in summary.table().lines() {
            reporter.line(line);
        }
        reporter.note(&format!("wrote {}", written.join(", ")));
        if to_stdout {
            print(&summary.json())?;
        }
        Ok(())
    }

    /// The command with all that decides the picture, as it was given: threads, names of outputs and the like are left
    /// out, so that they do not change the bytes.
    fn command(&self, settings: &Settings) -> String {
        let mut words = vec!["freelux render".to_owned()];
        let mut add = |name: &str, value: Option<String>| {
            words.extend(value.map(|value| format!("--{name}={value}")));
        };
        for (name, value) in self.view.words(settings) {
            add(name, value);
        }
        add("error", self.error.map(|error| error.to_string()));
        add("term", self.term.map(|term| term.name().to_owned()));
        words.extend(self.scene.as_ref().map(|path| path.display().to_string()));
        words.join(" ")
    }
}

/// The exposure that brings nine tenths of the pixels below a half, in quarters of a stop: the brightest tenth has one
/// stop before it is clamped.
fn automatic_exposure(size: UVec2, picture: &[Vec3]) -> f32 {
    // That of relMSE brings them below 0.8.
    let factor =
        Image::new(size, picture).and_then(|picture| metrics::exposure(&picture)).map_or(1.0, |e| e * 0.5 / 0.8);
    #[expect(clippy::cast_possible_truncation, reason = "a few stops")]
    let stops = (4.0 * factor.log2()).round() as f32 / 4.0;
    // Without the sign that a 0 may have.
    stops.clamp(-32.0, 32.0) + 0.0
}
