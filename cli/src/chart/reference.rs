//! The reference of a chart: given, or made once by the path tracer and kept beside the chart.

use std::path::{Path, PathBuf};

use glam::UVec2;
use integrator::metrics::{Batches, Image, MetricsError, Reference};
use integrator::{Method, Settings};
use scene::{Picture, Scene};

use crate::encode;
use crate::failure::{Failure, note};
use crate::files::{self, Staged};

/// Pictures that a reference is joined of, each with random numbers of its own: their spread is its noise.
const BATCHES: u32 = 16;
/// Far from the seeds of the pictures that are measured, so that no noise is shared.
const FIRST_SEED: u64 = 1 << 40;

/// Finds the variance of `reference.exr` in `variance.exr`, and that of any other `x.exr` in `x.variance.exr`.
fn variance_path(reference: &Path) -> PathBuf {
    if reference.file_name().is_some_and(|name| name == "reference.exr") {
        return reference.with_file_name("variance.exr");
    }
    reference.with_extension("variance.exr")
}

/// Reads a reference with its variance, if that is there, and shrinks it to `size`.
pub(crate) fn read(path: &Path, size: UVec2) -> Result<Reference, Failure> {
    let read = |path: &Path| Picture::read(path).map_err(Failure::input);
    let picture = read(path)?;
    let refuse = |what: String| Failure::Input(format!("{}: {what}", path.display()));
    let variance_path = variance_path(path);
    let variance = if variance_path.exists() { Some(read(&variance_path)?) } else { None };
    if variance.is_none() {
        note(&format!(
            "warning: {}: its noise is not known, as there is no {}",
            path.display(),
            variance_path.display()
        ));
    }
    if let Some(variance) = &variance {
        let refuse = |what: &str| {
            Failure::Input(format!("{}: {what}; give the variance of {}", variance_path.display(), path.display()))
        };
        if variance.size != picture.size {
            return Err(refuse("is of another size than its reference"));
        }
        if variance.pixels.iter().any(|pixel| !pixel.is_finite() || pixel.min_element() < 0.0) {
            return Err(refuse("holds numbers that are negative or not finite"));
        }
    }
    let reference = Reference::new(picture.size, picture.pixels, variance.map(|variance| variance.pixels))
        .map_err(|error| refuse(error.to_string()))?;
    reference.shrunk(size).ok_or_else(|| {
        let own = reference.size();
        refuse(format!(
            "has {} x {} pixels, which are not blocks of {} x {}; choose another --size or reference",
            own.x, own.y, size.x, size.y
        ))
    })
}

/// Checks that a reference can be left at `path`, with its variance.
pub(crate) fn check_writable(path: &Path) -> Result<(), Failure> {
    files::check_writable(path)?;
    files::check_writable(&variance_path(path))
}

/// Renders a reference with `spp` samples a pixel and leaves it at `path`, with its variance.
pub(crate) fn make(path: &Path, scene: &Scene, name: &str, size: UVec2, spp: u32) -> Result<Reference, Failure> {
    note(&format!("{name}: rendering the reference by path, {spp} samples a pixel"));
    let refuse = |error: MetricsError| Failure::Run(format!("{name}: {error}"));
    let mut batches = Batches::new(size);
    for batch in 0..BATCHES {
        let settings = Settings {
            method: Method::Path,
            spp: Some(spp.div_ceil(BATCHES)),
            size,
            seed: FIRST_SEED + u64::from(batch),
            ..Settings::default()
        };
        let film = integrator::render(scene, &settings, &|_| ()).map_err(Failure::input)?.film;
        batches.add(&Image::new(size, &film.picture()).map_err(refuse)?).map_err(refuse)?;
        note(&format!("{name}: reference {} of {BATCHES}", batch + 1));
    }
    let reference = batches.mean().map_err(refuse)?;
    let variance = reference.variance().expect("there are several batches");
    let mut staged = Staged::default();
    for (path, pixels) in [(path, reference.image().pixels()), (&variance_path(path), variance)] {
        staged.add(path, |out| encode::plain_exr(size, pixels, out))?;
    }
    staged.finish()?;
    Ok(reference)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_variance_lies_beside_the_reference() {
        let path = |name: &str| variance_path(Path::new(name)).display().to_string();
        assert_eq!(path("a/reference.exr"), "a/variance.exr", "as the study has them");
        assert_eq!(path("a/b.64spp.exr"), "a/b.64spp.variance.exr", "others");
    }
}
