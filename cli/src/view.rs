//! What is looked at and how: the arguments that decide a picture, for every subcommand that makes one.

use std::path::{Path, PathBuf};

use glam::{UVec2, Vec3};
use integrator::{Method, Settings};
use scene::{Camera, Description, FileSettings, LoadOptions, Loaded};

use crate::args;
use crate::failure::Failure;

/// The scene that is rendered when none is named, and the files that it includes.
const DEFAULT_SCENE: &str = include_str!("../scenes/default.toml");
const DEFAULT_FILES: &[(&str, &[u8])] = &[("vase.obj", include_bytes!("../scenes/vase.obj"))];

/// The method, its settings, the camera and the surroundings.
#[derive(Debug, clap::Args)]
pub(crate) struct ViewArgs {
    /// How to render: the cache of reprojected radiance, the same without a cache, an irradiance cache, or the
    /// reference path tracer
    #[arg(long, value_parser = args::method())]
    method: Option<Method>,
    /// Speed against accuracy: four times the quality takes about three times the time, below 1 twice, by path four
    /// times [default: the scene's, or 1]
    #[arg(long, value_name = "Q", allow_hyphen_values = true)]
    quality: Option<f32>,
    /// Samples a pixel, instead of what the quality gives
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    spp: Option<u32>,
    /// Single setting for study, instead of what the quality gives: resolution, spacing, error, layers, merge, sides
    /// (even, adaptive), depth (layer, parallax), step, verify, light-samples, light-guide, clear-lights, direct-fit,
    /// gather-guide, lobe-rays, lobe-guide, lobe-reuse, texture-alpha, photons, coverage (rect, quad), trail (all,
    /// silhouettes, uncovered), weights (bits, areas), reach (distance, hessian), gradients, walls, clamp, gaps, limit,
    /// divide, highlights, margins, doubt (on, off), samples (even, adaptive), secondary (cells, photons, paths); may be
    /// given several times
    #[arg(long, value_name = "NAME=VALUE", value_parser = args::study)]
    set: Vec<args::StudySetting>,
    /// What of a texture a reprojected element covers: its quadrilateral, or the rectangle around that, as in the paper
    /// [default: quad]
    #[arg(long, value_name = "KIND", value_parser = args::choice("coverage", ["quad", "rect"]))]
    coverage: Option<args::StudySetting>,
    /// What leaves a trail of texels about which nothing is known: silhouettes as far as they uncover something, as far
    /// as they move, or all elements, as in the paper [default: uncovered]
    #[arg(long, value_name = "KIND", value_parser = args::choice("trail", ["uncovered", "silhouettes", "all"]))]
    trail: Option<args::StudySetting>,
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
}

impl ViewArgs {
    /// The picture of the surroundings, if one is named.
    pub(crate) fn env(&self) -> Option<&Path> {
        self.env.as_deref()
    }

    /// Checks what can be checked before anything is loaded.
    pub(crate) fn check(&self) -> Result<(), Failure> {
        self.settings(&FileSettings::default()).validate().map_err(|error| Failure::Input(format!("--{error}")))?;
        if let (Some(eye), Some(at)) = (self.eye, self.at) {
            check_view(eye, at, self.up)?;
        }
        Ok(())
    }

    /// The threads asked for.
    pub(crate) fn pool(&self) -> Result<rayon::ThreadPool, Failure> {
        pool(self.threads)
    }

    /// Reads the scene and its files; the embedded scene where none is named.
    pub(crate) fn load(&self, scene: Option<&Path>) -> Result<Loaded, Failure> {
        let options = LoadOptions { environment: self.env.clone(), environment_scale: self.env_scale.unwrap_or(1.0) };
        let loaded = match scene {
            Some(path) => scene::load(path, &options),
            None => scene::load_embedded(DEFAULT_SCENE, DEFAULT_FILES, &options),
        };
        loaded.map_err(Failure::input)
    }

    /// The settings of the scene's file, overruled by the arguments.
    pub(crate) fn settings(&self, file: &FileSettings) -> Settings {
        let default = Settings::default();
        Settings {
            method: self.method.unwrap_or(default.method),
            quality: self.quality.or(file.quality).unwrap_or(default.quality),
            spp: self.spp.or(file.spp),
            size: self.size.or(file.size).unwrap_or(default.size),
            seed: self.seed.or(file.seed).unwrap_or(default.seed),
            study: args::all_studies(self.study()),
            ..default
        }
    }

    /// All settings for study; those that are arguments of their own come last.
    fn study(&self) -> impl Iterator<Item = &args::StudySetting> {
        self.set.iter().chain(&self.coverage).chain(&self.trail)
    }

    /// The scene's camera, overruled by the arguments. Where there is none, the whole scene is framed first.
    pub(crate) fn camera(&self, description: &Description) -> Result<Option<Camera>, Failure> {
        if self.eye.is_none() && self.at.is_none() && self.up.is_none() && self.fov.is_none() {
            return Ok(description.camera);
        }
        let mut camera = description.camera.unwrap_or_else(|| Camera::framing(description.bounds()));
        camera.eye = self.eye.unwrap_or(camera.eye);
        camera.at = self.at.unwrap_or(camera.at);
        camera.up = self.up.unwrap_or(camera.up);
        camera.fov_y_degrees = self.fov.unwrap_or(camera.fov_y_degrees);
        check_view(camera.eye, camera.at, Some(camera.up))?;
        Ok(Some(camera))
    }

    /// All that was given, as names and values of the command line, with method, quality, size and seed in any case.
    /// Threads are left out: the picture does not depend on them.
    pub(crate) fn words(&self, settings: &Settings) -> Vec<(&'static str, Option<String>)> {
        let vector = |v: Vec3| format!("{},{},{}", v.x, v.y, v.z);
        let mut words = Vec::new();
        let mut add = |name, value| words.push((name, value));
        add("method", Some(settings.method.name().to_owned()));
        add("quality", Some(settings.quality.to_string()));
        add("spp", settings.spp.map(|spp| spp.to_string()));
        for setting in self.study() {
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
        words
    }
}

/// As many threads as were asked for, or one for each processor.
pub(crate) fn pool(threads: Option<u16>) -> Result<rayon::ThreadPool, Failure> {
    let mut pool = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = threads {
        pool = pool.num_threads(threads.into());
    }
    pool.build().map_err(|error| Failure::Run(format!("the threads cannot be started: {error}")))
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
