//! Where files come from: the disk, or a list of names and bytes built into the program.

use std::cell::RefCell;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use super::error::{LoadError, Place, quoted};
use super::limits;

/// A source of files.
#[derive(Debug, Clone, Copy)]
pub(super) enum Files<'a> {
    /// The file system, and the paths of all files that were opened.
    Disk(&'a RefCell<Vec<PathBuf>>),
    /// Names and contents; nothing else can be reached.
    Embedded(&'a [(&'a str, &'a [u8])]),
}

impl<'a> Files<'a> {
    /// Opens a regular file of at most `limit` bytes, asked for at `place`; returns it with its size.
    pub(super) fn open(
        self,
        path: &Path,
        place: Place<'_>,
        limit: u64,
    ) -> Result<(Box<dyn BufRead + 'a>, u64), LoadError> {
        let (reader, size): (Box<dyn BufRead + 'a>, u64) = match self {
            Self::Disk(opened) => {
                let failed = |error| cannot_open(place, path, &error);
                // The kind is asked before opening: opening a pipe would wait for its writer.
                let metadata = fs::metadata(path).map_err(failed)?;
                if !metadata.is_file() {
                    let what = format!("{} is not a regular file", shown(place, path));
                    return Err(place.unreadable(what, "name a file, not a folder, pipe or device"));
                }
                let file = File::open(path).map_err(failed)?;
                opened.borrow_mut().push(path.to_owned());
                (Box::new(BufReader::with_capacity(1 << 16, file)), metadata.len())
            }
            Self::Embedded(list) => {
                let Some(&(_, bytes)) = list.iter().find(|(name, _)| Path::new(name) == path) else {
                    let what = format!("{} is not among the embedded files", shown(place, path));
                    return Err(place.unreadable(what, "correct the name"));
                };
                (Box::new(bytes), bytes.len() as u64)
            }
        };
        if size > limit {
            let what = format!("{} has {size} bytes, more than the limit of {limit}", shown(place, path));
            return Err(place.too_large(what, "split or shrink it"));
        }
        Ok((reader, size))
    }

    /// Reads a whole file; see [`Files::open`].
    pub(super) fn read(self, path: &Path, place: Place<'_>, limit: u64) -> Result<Vec<u8>, LoadError> {
        let (reader, _) = self.open(path, place, limit)?;
        let mut bytes = Vec::new();
        // A file that grows while it is read still stops at the limit.
        reader.take(limit).read_to_end(&mut bytes).map_err(|error| cannot_open(place, path, &error))?;
        Ok(bytes)
    }

    /// Whether there is such a file, of whatever kind.
    pub(super) fn exists(self, path: &Path) -> bool {
        match self {
            Self::Disk(_) => path.exists(),
            Self::Embedded(list) => list.iter().any(|(name, _)| Path::new(name) == path),
        }
    }

    /// Returns the path that `name` in the file `from` means: relative to its folder, with `\` for `/` where only that
    /// exists. Where an absolute path leads to nothing, as on another machine than that which wrote it, the file of the
    /// same name in the folder is meant.
    pub(super) fn resolve(self, from: &Path, name: &str) -> PathBuf {
        let folder = from.parent().unwrap_or(Path::new(""));
        let turned = name.replace('\\', "/");
        let is_absolute = turned.starts_with('/') || turned.get(1..3) == Some(":/");
        let last = turned.rsplit('/').next().filter(|last| is_absolute && !last.is_empty());
        let mut ways = [Some(name), Some(&turned), last].into_iter().flatten().map(|name| folder.join(name));
        ways.find(|path| self.exists(path)).unwrap_or_else(|| folder.join(name))
    }

    /// A path that is the same for all names of one file, for caches and cycles.
    pub(super) fn identity(self, path: &Path) -> PathBuf {
        match self {
            Self::Disk(_) => fs::canonicalize(path).unwrap_or_else(|_| path.to_owned()),
            Self::Embedded(_) => path.to_owned(),
        }
    }
}

/// Tells that a file could not be opened or read.
pub(super) fn cannot_open(place: Place<'_>, path: &Path, error: &std::io::Error) -> LoadError {
    place.unreadable(format!("{} cannot be read: {error}", shown(place, path)), "correct the name or the rights")
}

/// The path in quotes, or "it" where the place names it already.
fn shown(place: Place<'_>, path: &Path) -> String {
    if place.file == path { "the file".to_owned() } else { quoted(&path.display().to_string()) }
}

/// Checks the length of a name.
pub(super) fn check_name(name: &str, place: Place<'_>) -> Result<(), LoadError> {
    if name.len() > limits::NAME_BYTES {
        let what = format!("a name of {} bytes, more than the limit of {}", name.len(), limits::NAME_BYTES);
        return Err(place.too_large(what, "shorten it"));
    }
    Ok(())
}
