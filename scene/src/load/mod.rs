//! Reads scenes from files: TOML scene files and OBJ meshes, their materials and pictures.
//!
//! Files are hostile until proved otherwise: every number is checked where it stands, every size before memory is taken
//! for it.

mod error;
mod files;
pub mod limits;
mod lines;
mod loader;
mod mtl;
mod mtl_meaning;
mod obj;
mod obj_reader;
mod picture;
mod picture_exr;
mod polygon;
mod scene_file;
mod warnings;

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use glam::UVec2;

pub use error::{LoadError, Problem};
pub use picture::{Picture, PictureFormat};

use crate::description::Description;
use error::Place;
use files::Files;
use loader::Loader;

/// What the caller adds to a file.
#[derive(Debug, Clone, PartialEq)]
pub struct LoadOptions {
    /// An EXR or HDR picture of the surroundings, in place of the file's own.
    pub environment: Option<PathBuf>,
    /// Factor for the surroundings, whoever chose them.
    pub environment_scale: f32,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self { environment: None, environment_scale: 1.0 }
    }
}

/// A scene as read.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// What is there, ready for [`Scene::new`](crate::Scene::new).
    pub description: Description,
    /// What the file asks of the picture.
    pub settings: FileSettings,
    /// What was left out or mended, one line each.
    pub warnings: Vec<String>,
    /// The files that were read, this one and all that it names, in the order of reading; none that is embedded.
    pub files: Vec<PathBuf>,
}

/// What a scene file asks of the picture; the caller's own wishes come first.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FileSettings {
    /// Width and height, pixels.
    pub size: Option<UVec2>,
    /// Stops by which the picture is brightened for the eye.
    pub exposure: Option<f32>,
    /// Quality, 1 is ordinary.
    pub quality: Option<f32>,
    /// Samples a pixel.
    pub spp: Option<u32>,
    /// Seed of the random numbers.
    pub seed: Option<u64>,
}

/// Loads a scene from a `.toml` or `.obj` file.
///
/// A scene without any light gets [`Environment::sky`](crate::Environment::sky); one without a camera keeps `None`.
///
/// # Errors
/// The first thing wrong in any of its files.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Loaded, LoadError> {
    let opened = RefCell::default();
    let mut loader = Loader::new(Files::Disk(&opened));
    let place = Place::file(path);
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let settings = match extension.as_str() {
        "toml" => scene_file::read(&mut loader, path)?,
        "obj" => {
            loader.add_obj(path, None, place)?;
            FileSettings::default()
        }
        _ => return Err(place.unsupported("not a scene by its name", "give a .toml or .obj file")),
    };
    finish(loader, settings, options, place, &opened)
}

/// Reads a whole regular file of at most [`limits::FILE_BYTES`].
///
/// # Errors
/// It is not there, is larger, may not be read, or is a folder, pipe or device.
///
/// # Example
///
/// ```
/// let error = scene::read_file(std::path::Path::new("no such file")).unwrap_err();
/// assert!(error.to_string().starts_with("no such file: the file cannot be read"));
/// ```
pub fn read_file(path: &Path) -> Result<Vec<u8>, LoadError> {
    Files::Disk(&RefCell::default()).read(path, Place::file(path), limits::FILE_BYTES)
}

/// Loads a scene file that is part of the program, with the files it names: `files` holds their names and contents.
///
/// # Errors
/// As [`load`]; the scene can reach nothing but `files`.
pub fn load_embedded(scene: &str, files: &[(&str, &[u8])], options: &LoadOptions) -> Result<Loaded, LoadError> {
    let path = Path::new("embedded.toml");
    let mut all = vec![("embedded.toml", scene.as_bytes())];
    all.extend_from_slice(files);
    let mut loader = Loader::new(Files::Embedded(&all));
    let settings = scene_file::read(&mut loader, path)?;
    finish(loader, settings, options, Place::file(path), &RefCell::default())
}

/// Adds what the caller does.
fn finish(
    mut loader: Loader<'_>,
    settings: FileSettings,
    options: &LoadOptions,
    place: Place<'_>,
    opened: &RefCell<Vec<PathBuf>>,
) -> Result<Loaded, LoadError> {
    if let Some(path) = &options.environment {
        let environment = loader.environment(Files::Disk(opened), path, Place::file(path))?;
        loader.description.environment = Some(environment);
    }
    let loaded = loader.finish(settings, options.environment_scale, place)?;
    Ok(Loaded { files: opened.take(), ..loaded })
}
