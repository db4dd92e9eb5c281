//! `freelux render`: load, render, write, tell.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use glam::{UVec2, Vec3};
use integrator::metrics::{self, Image};
use integrator::{Method, Rendering, Settings};
use scene::freeform::Bounds;
use scene::{Aabb, Camera, Description, Environment, FileSettings, LoadOptions, Loaded, Mesh, Scene};

use crate::args::{self, Output, OutputKind};
use crate::encode::{self, Origin, Term};
use crate::failure::{Failure, print};
use crate::files;
use crate::images::{self, Picture};
use crate::machine;
use crate::progress::Reporter;
use crate::summary::Summary;

/// The scene that is rendered when none is named, and the files that it includes.
const DEFAULT_SCENE: &str = include_str!("../scenes/default.toml");
const DEFAULT_FILES: &[(&str, &[u8])] = &[("vase.obj", include_bytes!("../scenes/vase.obj"))];
const DEFAULT_NAME: &str = "the embedded scene";

/// Render a scene to EXR and PNG.
///
/// The EXR holds linear radiance, unclamped, with the terms and albedo, normal and depth as further channels. The PNG is
/// multiplied by 2^EV, clamped and encoded as sRGB. Existing files are replaced, and only by whole ones.
#[derive(Debug, clap::Args)]
pub(crate) struct RenderArgs {
    /// Scene to render (.toml or .obj); an embedded one where none is named
    #[arg(value_name = "SCENE")]
    scene: Option<PathBuf>,
    /// How to render: the cache of reprojected radiance, the same without a cache, an irradiance cache, or the reference path tracer
    #[arg(long, value_parser = args::method())]
    method: Option<Method>,
    /// Speed against accuracy: twice the quality takes about twice the time [default: the scene's, or 1]
    #[arg(long, value_name = "Q", allow_hyphen_values = true)]
    quality: Option<f32>,
    /// Samples a pixel, instead of what the quality gives
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    spp: Option<u32>,
    /// Single setting for study, instead of what the quality gives: resolution, spacing, error, layers, merge, step, agreement,
    /// verify, light-samples, photons, coverage (rect, quad), trail (all, silhouettes), weights (bits, areas), secondary (cells, photons,
    /// paths); may be given several times
    #[arg(long, value_name = "NAME=VALUE", value_parser = args::study)]
    set: Vec<args::StudySetting>,
    /// Width and height in pixels [default: the scene's, or 640x360]
    #[arg(long, value_name = "WxH", value_parser = args::size, allow_hyphen_values = true)]
    size: Option<UVec2>,
    /// Another seed gives another noise [default: the scene's, or 0]
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    seed: Option<u64>,
    /// Threads; the picture does not depend on them [default: one for each processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), allow_hyphen_values = true)]
    threads: Option<u16>,
    /// Where the camera stands, in metres
    #[arg(long, value_name = "x,y,z", value_parser = args::vector, allow_hyphen_values = true)]
    eye: Option<Vec3>,
    /// A point in the middle of the picture
    #[arg(long, value_name = "x,y,z", value_parser = args::vector, allow_hyphen_values = true)]
    at: Option<Vec3>,
    /// The direction that is up in the picture
    #[arg(long, value_name = "x,y,z", value_parser = args::vector, allow_hyphen_values = true)]
    up: Option<Vec3>,
    /// The whole vertical angle of view in degrees
    #[arg(long, value_name = "DEG", value_parser = args::angle, allow_hyphen_values = true)]
    fov: Option<f32>,
    /// Surroundings in longitude and latitude (EXR or HDR), instead of the scene's
    #[arg(long, value_name = "FILE")]
    env: Option<PathBuf>,
    /// Factor for the radiance of the surroundings
    #[arg(long, value_name = "S", value_parser = args::not_negative, allow_hyphen_values = true)]
    env_scale: Option<f32>,
    /// Picture to write, .exr or .png; may be given twice [default: freelux.exr and freelux.png]
    #[arg(long, value_name = "FILE.exr|.png")]
    out: Vec<Output>,
    /// Write this term of the picture alone
    #[arg(long, value_enum)]
    term: Option<Term>,
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
    pool(args.threads)?.install(|| args.render(&outputs))?;
    Ok(ExitCode::SUCCESS)
}

/// As many threads as were asked for, or one for each processor.
pub(crate) fn pool(threads: Option<u16>) -> Result<rayon::ThreadPool, Failure> {
    let mut pool = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = threads {
        pool = pool.num_threads(threads.into());
    }
    pool.build().map_err(|error| Failure::Run(format!("the threads cannot be started: {error}")))
}

impl RenderArgs {
    /// Checks what can be checked before anything is loaded; returns the pictures to write.
    fn check(&self) -> Result<Vec<Output>, Failure> {
        self.settings(&FileSettings::default()).validate().map_err(|error| Failure::Input(format!("--{error}")))?;
        if let (Some(eye), Some(at)) = (self.eye, self.at) {
            check_view(eye, at, self.up)?;
        }
        let outputs = match &self.out[..] {
            [] => ["freelux.exr", "freelux.png"].map(|name| name.parse().expect("a known suffix")).to_vec(),
            given => given.to_vec(),
        };
        let stats = self.stats.as_deref().filter(|path| *path != Path::new("-"));
        for path in outputs.iter().map(|output| output.path.as_path()).chain(stats) {
            files::check_writable(path)?;
        }
        Ok(outputs)
    }

    fn render(&self, outputs: &[Output]) -> Result<(), Failure> {
        let reporter = Reporter::new(self.quiet);
        let name = self.scene.as_ref().map_or(DEFAULT_NAME.to_owned(), |path| path.display().to_string());
        let start = Instant::now();
        let loaded = self.load()?;
        let load_seconds = start.elapsed().as_secs_f64();

        let start = Instant::now();
        let mut description = loaded.description;
        description.camera = self.camera(&description)?;
        let scene =
            Scene::new(description).map_err(|error| Failure::Input(format!("{name}: {error}; mend the scene")))?;
        let settings = self.settings(&loaded.settings);
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

        let result = integrator::render(&scene, &settings, &|progress| reporter.update(progress));
        reporter.finish();
        let Rendering { film, statistics } = result.map_err(Failure::input)?;

        let start = Instant::now();
        let whole = film.picture();
        let exposure =
            self.exposure.or(loaded.settings.exposure).unwrap_or_else(|| automatic_exposure(film.size, &whole));
        let picture = self.term.map_or(&whole[..], |term| term.of(&film));
        let origin = Origin { command: &self.command(&settings), seed: settings.seed };
        let mut written = Vec::new();
        for Output { path, kind } in outputs {
            let bytes = match kind {
                OutputKind::Exr => encode::exr(&film, picture, self.term, &origin)?,
                OutputKind::Png => encode::png(film.size, picture, exposure)?,
            };
            written.push((path.as_path(), bytes));
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
            statistics: &statistics,
        };
        let to_stdout = self.stats.as_deref() == Some(Path::new("-"));
        if let Some(path) = self.stats.as_deref().filter(|_| !to_stdout) {
            written.push((path, summary.json().into_bytes()));
        }
        files::write_all(&written)?;
        for line in summary.table().lines() {
            reporter.line(line);
        }
        let names: Vec<String> = written.iter().map(|(path, _)| path.display().to_string()).collect();
        reporter.note(&format!("wrote {}", names.join(", ")));
        if to_stdout {
            print(&summary.json())?;
        }
        Ok(())
    }

    /// Reads the scene and its files.
    fn load(&self) -> Result<Loaded, Failure> {
        let scale = self.env_scale.unwrap_or(1.0);
        if let Some(path) = &self.scene {
            let options = LoadOptions { environment: self.env.clone(), environment_scale: scale };
            return scene::load(path, &options).map_err(Failure::input);
        }
        let mut loaded = scene::load_embedded(DEFAULT_SCENE, DEFAULT_FILES).map_err(Failure::input)?;
        if let Some(path) = &self.env {
            let Picture { size, pixels, format } = images::read(path)?;
            if format.is_coded() {
                let what = "holds codes for a display and not radiance; give an EXR or HDR picture";
                return Err(Failure::Input(format!("{}: {what}", path.display())));
            }
            loaded.description.environment = Some(Environment::from_pixels(size.x, size.y, pixels));
        }
        let environment = loaded.description.environment.take();
        loaded.description.environment = environment.map(|environment| environment.scaled(scale));
        Ok(loaded)
    }

    /// The settings of the scene's file, overruled by the arguments.
    fn settings(&self, file: &FileSettings) -> Settings {
        let default = Settings::default();
        Settings {
            method: self.method.unwrap_or(default.method),
            quality: self.quality.or(file.quality).unwrap_or(default.quality),
            spp: self.spp.or(file.spp),
            size: self.size.or(file.size).unwrap_or(default.size),
            seed: self.seed.or(file.seed).unwrap_or(default.seed),
            study: args::all_studies(&self.set),
        }
    }

    /// The scene's camera, overruled by the arguments. Where there is none, the whole scene is framed first.
    fn camera(&self, description: &Description) -> Result<Option<Camera>, Failure> {
        if self.eye.is_none() && self.at.is_none() && self.up.is_none() && self.fov.is_none() {
            return Ok(description.camera);
        }
        let mut camera = description.camera.unwrap_or_else(|| Camera::framing(bounds(description)));
        camera.eye = self.eye.unwrap_or(camera.eye);
        camera.at = self.at.unwrap_or(camera.at);
        camera.up = self.up.unwrap_or(camera.up);
        camera.fov_y_degrees = self.fov.unwrap_or(camera.fov_y_degrees);
        check_view(camera.eye, camera.at, Some(camera.up))?;
        Ok(Some(camera))
    }

    /// The command with all that changes the picture: threads, names of outputs and the like are left out, so that the
    /// same picture has the same bytes.
    fn command(&self, settings: &Settings) -> String {
        let mut words = vec!["freelux render".to_owned()];
        let mut add = |name: &str, value: Option<String>| {
            words.extend(value.map(|value| format!("--{name}={value}")));
        };
        let vector = |v: Vec3| format!("{},{},{}", v.x, v.y, v.z);
        add("method", Some(settings.method.name().to_owned()));
        add("quality", Some(settings.quality.to_string()));
        add("spp", settings.spp.map(|spp| spp.to_string()));
        for setting in &self.set {
            add("set", Some(format!("{}={}", setting.name, setting.value)));
        }
        add("size", Some(format!("{}x{}", settings.size.x, settings.size.y)));
        add("seed", Some(settings.seed.to_string()));
        add("eye", self.eye.map(vector));
        add("at", self.at.map(vector));
        add("up", self.up.map(vector));
        add("fov", self.fov.map(|fov| fov.to_string()));
        add("env", self.env.as_ref().map(|path| path.display().to_string()));
        add("env-scale", self.env_scale.map(|scale| scale.to_string()));
        add("term", self.term.map(|term| term.name().to_owned()));
        words.extend(self.scene.as_ref().map(|path| path.display().to_string()));
        words.join(" ")
    }
}

/// Refuses a camera that looks at itself or straight along its own `up`.
fn check_view(eye: Vec3, at: Vec3, up: Option<Vec3>) -> Result<(), Failure> {
    let Some(forward) = (at - eye).try_normalize() else {
        return Err(Failure::Input("--eye and --at are the same point; move one of them".into()));
    };
    match up.map(|up| up.try_normalize().map_or(0.0, |up| up.cross(forward).length())) {
        Some(sine) if sine < 1e-5 => {
            Err(Failure::Input("--up is 0 or parallel to the view; choose another direction".into()))
        }
        _ => Ok(()),
    }
}

/// The box around all that is finite in a scene.
fn bounds(description: &Description) -> Aabb {
    let corners = |mesh: &Mesh| {
        let points = mesh.triangles.iter().flatten().filter_map(|&index| mesh.positions.get(index as usize).copied());
        Aabb::of_points(&points.collect::<Vec<_>>())
    };
    let meshes = description.meshes.iter().map(corners);
    let forms = description.forms.iter().filter_map(|form| match form.solid.bounds() {
        Bounds::Finite { min, max } => Some(Aabb { min: min.as_vec3(), max: max.as_vec3() }),
        Bounds::Unbounded => None,
    });
    meshes.chain(forms).fold(Aabb::EMPTY, Aabb::union)
}

/// The exposure that brings nine tenths of the pixels below a half, in quarters of a stop: the brightest tenth has one stop
/// before it is clamped.
fn automatic_exposure(size: UVec2, picture: &[Vec3]) -> f32 {
    // That of relMSE brings them below 0.8.
    let factor =
        Image::new(size, picture).and_then(|picture| metrics::exposure(&picture)).map_or(1.0, |e| e * 0.5 / 0.8);
    #[expect(clippy::cast_possible_truncation, reason = "a few stops")]
    let stops = (4.0 * factor.log2()).round() as f32 / 4.0;
    stops.clamp(-32.0, 32.0)
}
