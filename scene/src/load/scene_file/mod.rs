//! Scene files in TOML.

mod build;
mod forms;
mod line_numbers;
mod message;
mod repeat;
mod schema;
mod values;

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use super::FileSettings;
use super::error::{LoadError, Place, quoted};
use super::files::check_name;
use super::limits;
use super::loader::Loader;
use line_numbers::LineNumbers;
use schema::SceneFile;

/// A scene file with its text, for the lines of errors.
struct Source {
    path: PathBuf,
    text: String,
    lines: LineNumbers,
    scene: SceneFile,
}

impl Source {
    /// The place of a byte of the text.
    fn place(&self, span: std::ops::Range<usize>) -> Place<'_> {
        Place::line(&self.path, self.lines.line(&self.text, span.start))
    }
}

/// A file to read: its path, who includes it, and where.
struct Wanted {
    path: PathBuf,
    parent: Option<(usize, std::ops::Range<usize>)>,
}

/// Reads the scene file `path` and all it includes into `loader`.
pub(super) fn read(loader: &mut Loader<'_>, path: &Path) -> Result<FileSettings, LoadError> {
    let mut sources: Vec<Source> = Vec::new();
    let mut parents: Vec<Option<usize>> = Vec::new();
    let mut identities: Vec<PathBuf> = Vec::new();
    let mut seen = HashSet::new();
    let mut meshes = 0;
    let mut wanted = vec![Wanted { path: path.to_owned(), parent: None }];
    // A list in place of recursion: a chain of a thousand files must not fill the stack.
    while let Some(Wanted { path, parent }) = wanted.pop() {
        let place = match &parent {
            Some((source, span)) => sources[*source].place(span.clone()),
            None => Place::file(&path),
        };
        let identity = loader.files.identity(&path);
        let mut ancestor = parent.as_ref().map(|(source, _)| *source);
        while let Some(source) = ancestor {
            if identities[source] == identity {
                return Err(place
                    .invalid(format!("{} includes itself", quoted(&path.display().to_string())), "break the circle"));
            }
            ancestor = parents[source];
        }
        if parent.is_some() && path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("obj")) {
            loader.add_obj(&path, None, place)?;
            meshes += 1;
            continue;
        }
        if !seen.insert(identity.clone()) {
            continue;
        }
        let source = parse(loader, path.clone(), place)?;
        let index = sources.len();
        for name in source.scene.include.iter().rev() {
            check_name(name.as_ref(), source.place(name.span()))?;
            let path = loader.files.resolve(&source.path, name.as_ref());
            wanted.push(Wanted { path, parent: Some((index, name.span())) });
            if wanted.len() + sources.len() + meshes > limits::INCLUDES {
                return Err(source
                    .place(name.span())
                    .too_large(format!("more than {} files", limits::INCLUDES), "join them"));
            }
        }
        parents.push(parent.map(|(source, _)| source));
        identities.push(identity);
        sources.push(source);
    }
    build::build(loader, &sources)
}

fn parse(loader: &Loader<'_>, path: PathBuf, place: Place<'_>) -> Result<Source, LoadError> {
    let bytes = loader.files.read(&path, place, limits::SCENE_FILE_BYTES)?;
    let text = String::from_utf8(bytes).map_err(|error| {
        let valid = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = valid.iter().filter(|&&byte| byte == b'\n').count() + 1;
        Place::line(&path, line).invalid("it is not text in UTF-8", "save the scene file in UTF-8")
    })?;
    let text = text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text);
    let scene: SceneFile =
        toml::from_str(&text).map_err(|error| message::translate(&error, &text, Place::file(&path)))?;
    let source = Source { path, lines: LineNumbers::new(&text), text, scene };
    if let Some(version) = source.scene.version.as_ref().filter(|version| *version.get_ref() != 1) {
        let what = format!("version {} of the scene file, only 1 is known", version.get_ref());
        return Err(source.place(version.span()).unsupported(what, "use a newer program, or write version = 1"));
    }
    Ok(source)
}
