//! Renders one scene by every method at every quality, and measures each picture against the reference.

use std::path::Path;
use std::time::Instant;

use glam::UVec2;
use integrator::metrics::{self, DEFAULT_PIXELS_PER_DEGREE, Image, Reference, RelMse};
use integrator::{Method, Rendering, Settings, Statistics};
use scene::{LoadOptions, Scene};

use super::record::Record;
use crate::args::Variant;
use crate::failure::{Failure, note};
use crate::machine;

/// A scene that is ready, and how long that took.
pub(crate) struct Subject {
    /// As the chart names it.
    pub(crate) name: String,
    pub(crate) scene: Scene,
    /// The size that its file asks for.
    pub(crate) size: Option<UVec2>,
    load_seconds: f64,
    build_seconds: f64,
}

/// What is rendered of a scene.
pub(crate) struct Sweep<'a> {
    pub(crate) methods: &'a [Variant],
    /// Rising.
    pub(crate) qualities: &'a [f32],
    pub(crate) repeats: u32,
    pub(crate) size: UVec2,
    pub(crate) seed: u64,
    /// A method that takes longer is not asked for higher qualities.
    pub(crate) max_seconds: f64,
}

impl Subject {
    /// Loads and builds a scene.
    pub(crate) fn load(path: &Path, name: String) -> Result<Self, Failure> {
        let start = Instant::now();
        let loaded = scene::load(path, &LoadOptions::default()).map_err(Failure::input)?;
        let load_seconds = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let scene = Scene::new(loaded.description)
            .map_err(|error| Failure::Input(format!("{}: {error}; mend the scene", path.display())))?;
        let build_seconds = start.elapsed().as_secs_f64() - scene.light_seconds();
        for warning in &loaded.warnings {
            note(&format!("warning: {warning}"));
        }
        Ok(Self { name, scene, size: loaded.settings.size, load_seconds, build_seconds })
    }

    /// Renders all of a sweep. `keep` gets the record of each picture as soon as there is one.
    ///
    /// Methods take turns at each quality, so that a machine that is slower for a while is so for all of them.
    pub(crate) fn sweep(
        &self,
        sweep: &Sweep,
        reference: &Reference,
        reference_name: &str,
        keep: &mut dyn FnMut(Record) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let own = reference.own_rel_mse().map_err(|error| self.refuse(&error))?;
        self.warm_up(sweep.size)?;
        let mut is_slow = vec![false; sweep.methods.len()];
        for &quality in sweep.qualities {
            for repeat in 0..sweep.repeats {
                for (variant, is_slow) in sweep.methods.iter().zip(&mut is_slow) {
                    if *is_slow {
                        if repeat == 0 {
                            note(&format!("{} {} at quality {quality}: left out as too slow", self.name, variant.name));
                        }
                        continue;
                    }
                    let settings = Settings {
                        method: variant.method,
                        quality,
                        size: sweep.size,
                        seed: sweep.seed.wrapping_add(repeat.into()),
                        study: variant.study,
                        ..Settings::default()
                    };
                    let mut record = self.measure(&settings, reference, own)?;
                    record.method.clone_from(&variant.name);
                    record.repeat = repeat;
                    reference_name.clone_into(&mut record.reference);
                    note(&format!(
                        "{} {} at quality {quality}: {:.3} s, relMSE {:.2e}, robust {:.2e}",
                        self.name, variant.name, record.seconds, record.relmse, record.robust
                    ));
                    // Decided by the last repetition, that all of them are made.
                    *is_slow = repeat + 1 == sweep.repeats && record.seconds > sweep.max_seconds;
                    keep(record)?;
                }
            }
        }
        Ok(())
    }

    /// Renders once and leaves it: whoever came first would pay for cold caches and sleeping cores.
    fn warm_up(&self, size: UVec2) -> Result<(), Failure> {
        let settings = Settings { method: Method::Path, spp: Some(1), size, ..Settings::default() };
        integrator::render(&self.scene, &settings, &|_| ()).map(|_| ()).map_err(Failure::input)
    }

    /// Renders a picture and measures its error.
    fn measure(&self, settings: &Settings, reference: &Reference, own: Option<RelMse>) -> Result<Record, Failure> {
        let knows_peak = machine::forget_peak();
        let Rendering { film, statistics, .. } =
            integrator::render(&self.scene, settings, &|_| ()).map_err(Failure::input)?;
        let peak = machine::peak_bytes().filter(|_| knows_peak);
        let picture = film.picture();
        let image = Image::new(film.size, &picture).map_err(|error| self.refuse(&error))?;
        let against = reference.image();
        let rel_mse = metrics::rel_mse(&image, &against).map_err(|error| self.refuse(&error))?;
        #[expect(clippy::cast_possible_truncation, reason = "an exposure needs no more digits")]
        let flip = metrics::ldr_flip(&image, &against, rel_mse.exposure as f32, DEFAULT_PIXELS_PER_DEGREE)
            .map_err(|error| self.refuse(&error))?;
        let ratio = metrics::ratio_of_means(&image, &against).map_err(|error| self.refuse(&error))?;
        Ok(Record {
            scene: self.name.clone(),
            quality: short(settings.quality),
            // Every method uses the tables of lights, which the scene brings along.
            seconds: statistics.render_seconds + self.scene.light_seconds(),
            relmse: rel_mse.plain,
            robust: rel_mse.robust,
            reference_relmse: own.map(|own| own.plain),
            reference_robust: own.map(|own| own.robust),
            flip: Some(flip.mean),
            ratio_of_means: Some(ratio.overall).filter(|ratio| ratio.is_finite()),
            not_finite: rel_mse.not_finite as u64,
            width: settings.size.x,
            height: settings.size.y,
            phases: self.phases(&statistics),
            load_seconds: Some(self.load_seconds),
            build_seconds: Some(self.build_seconds),
            rays: statistics.rays.total(),
            records: statistics.records + statistics.irradiance_records,
            memory_bytes: Some(statistics.memory.total()),
            peak_memory_bytes: peak,
            threads: u32::try_from(rayon::current_num_threads()).unwrap_or(u32::MAX),
            cpu: machine::processor(),
            version: machine::VERSION.to_owned(),
            ..Record::default()
        })
    }

    fn phases(&self, statistics: &Statistics) -> String {
        let lights = ("light tables", self.scene.light_seconds());
        let phases = statistics.phases.iter().map(|phase| (phase.name.as_str(), phase.seconds));
        let words: Vec<String> =
            std::iter::once(lights).chain(phases).map(|(name, seconds)| format!("{name}={seconds:.6}")).collect();
        words.join(";")
    }

    fn refuse(&self, error: &metrics::MetricsError) -> Failure {
        Failure::Input(format!("{}: {error}; give a reference of the same view", self.name))
    }
}

/// A quality as it was written: 0.3 and not 0.30000001.
fn short(quality: f32) -> f64 {
    quality.to_string().parse().unwrap_or_else(|_| quality.into())
}
