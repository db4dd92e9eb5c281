//! Files that appear whole or not at all: written beside their place, then renamed. What is beside its place when the
//! program is interrupted is removed.

use std::fs::{self, File};
use std::io::{self, BufWriter, Cursor, IsTerminal, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tempfile::{Builder, NamedTempFile};

use crate::failure::{Failure, note};

/// Symbolic links followed, as Linux does.
const MAX_LINKS: usize = 40;

/// Checks that a file can be written to `path`, before any work is done for it.
pub(crate) fn check_writable(path: &Path) -> Result<(), Failure> {
    let refuse = |what: String| Err(Failure::Input(format!("{}: {what}", path.display())));
    let target = resolve(path);
    let is_folder = path.as_os_str().as_encoded_bytes().ends_with(b"/");
    match fs::metadata(&target) {
        Ok(found) if found.is_dir() => return refuse("is a folder; name a file".into()),
        _ if is_folder => return refuse("names a folder; name a file".into()),
        _ if is_stream(&target) => return Ok(()), // only writing will tell
        Ok(found) if found.permissions().readonly() => {
            return refuse("is write-protected; choose another name or allow writing".into());
        }
        Err(error) if error.kind() == io::ErrorKind::InvalidFilename => {
            return refuse(format!("cannot be written there: {error}; choose another name"));
        }
        _ => {}
    }
    let folder = folder_of(&target);
    if !folder.is_dir() {
        return refuse(format!("there is no folder {}; create it or choose another", folder.display()));
    }
    // Nobody interrupts between making the trial and deleting it.
    let _pending = pending();
    match beside(&target).map(drop) {
        Ok(()) => Ok(()),
        Err(error) => refuse(format!("cannot be written there: {error}; choose another folder")),
    }
}

/// Checks that no file is written twice, and that none of those that are read is replaced.
pub(crate) fn check_apart(written: &[&Path], read: &[impl AsRef<Path>]) -> Result<(), Failure> {
    // A device may be written any number of times.
    let place = |path: &Path| {
        let target = resolve(path);
        let target = fs::canonicalize(&target).or_else(|_| {
            Ok::<_, io::Error>(fs::canonicalize(folder_of(&target))?.join(target.file_name().unwrap_or_default()))
        });
        target.ok().filter(|target| !target.exists() || target.is_file())
    };
    for (number, path) in written.iter().enumerate() {
        let Some(here) = place(path) else { continue };
        let is_here = |other: &Path| place(other).is_some_and(|other| other == here);
        if read.iter().any(|other| is_here(other.as_ref())) {
            return Err(Failure::Input(format!("{}: would replace what is read; choose another name", path.display())));
        }
        if written[..number].iter().any(|other| is_here(other)) {
            return Err(Failure::Input(format!("{}: would be written twice; choose another name", path.display())));
        }
    }
    Ok(())
}

/// What a file's content can be written to.
pub(crate) trait Sink: Write + Seek {}

impl<T: Write + Seek> Sink for T {}

/// Files that are complete on the disk and wait for their names.
#[derive(Debug, Default)]
pub(crate) struct Staged {
    /// The name that was asked for, the file, and where it goes.
    files: Vec<(PathBuf, NamedTempFile, PathBuf)>,
}

impl Staged {
    /// Writes what `fill` gives beside `path`. A device or pipe cannot be replaced and is written at once.
    pub(crate) fn add(
        &mut self,
        path: &Path,
        fill: impl FnOnce(&mut dyn Sink) -> io::Result<()>,
    ) -> Result<(), Failure> {
        self.try_add(path, fill).map_err(|error| Failure::unwritable(path, &error))
    }

    fn try_add(&mut self, path: &Path, fill: impl FnOnce(&mut dyn Sink) -> io::Result<()>) -> io::Result<()> {
        let target = resolve(path);
        if is_stream(&target) {
            // They know no places to go back to; and what is in a file already to which the output of the program goes
            // stays there.
            let mut bytes = Cursor::new(Vec::new());
            fill(&mut bytes)?;
            let written = File::options().append(true).open(&target)?.write_all(bytes.get_ref());
            pending().awaited.retain(|awaited| awaited != path);
            // Whoever read it went away, which is their right.
            return written
                .or_else(|error| if error.kind() == io::ErrorKind::BrokenPipe { Ok(()) } else { Err(error) });
        }
        let old = fs::metadata(&target).ok();
        let file = {
            let mut pending = pending();
            let file = beside(&target)?;
            pending.begun.push(file.path().to_owned());
            file
        };
        let mut buffered = BufWriter::new(file.as_file());
        fill(&mut buffered)?;
        buffered.flush()?;
        drop(buffered);
        if let Some(old) = old {
            file.as_file().set_permissions(old.permissions())?;
        }
        file.as_file().sync_all()?;
        self.files.push((path.to_owned(), file, target));
        Ok(())
    }

    /// Gives all files their names.
    pub(crate) fn finish(self) -> Result<(), Failure> {
        let mut pending = pending();
        for (path, file, target) in self.files {
            file.persist(target).map_err(|failed| Failure::unwritable(&path, &failed.error))?;
            pending.awaited.retain(|awaited| *awaited != path);
        }
        pending.begun.clear();
        Ok(())
    }
}

/// Writes all files or none: every one is complete on the disk before the first takes its name.
pub(crate) fn write_all(files: &[(&Path, Vec<u8>)]) -> Result<(), Failure> {
    let mut staged = Staged::default();
    for (path, bytes) in files {
        staged.add(path, |out| out.write_all(bytes))?;
    }
    staged.finish()
}

/// What is not done when the program is interrupted.
struct Pending {
    /// Files that are to be written, by the names that were asked for.
    awaited: Vec<PathBuf>,
    /// Files beside their places, which nobody would remove if the program were ended.
    begun: Vec<PathBuf>,
}

/// The only state that is shared with the handler of signals; whoever holds it keeps that waiting.
static PENDING: Mutex<Pending> = Mutex::new(Pending { awaited: Vec::new(), begun: Vec::new() });

fn pending() -> MutexGuard<'static, Pending> {
    PENDING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Says which files are to be written, so that an interruption can name those that are not.
pub(crate) fn await_files(paths: &[&Path]) {
    pending().awaited = paths.iter().map(|&path| path.to_owned()).collect();
}

/// Removes what is not finished, names it and ends the program; to be called when it is interrupted.
pub(crate) fn abandon(code: i32) -> ! {
    // Held until the end, so that no file is renamed any more.
    let pending = pending();
    for path in &pending.begun {
        // It may have its name already.
        let _ = fs::remove_file(path);
    }
    if !pending.awaited.is_empty() {
        // Whoever should read this may not.
        std::thread::spawn(move || {
            std::thread::sleep(Duration::from_secs(1));
            std::process::exit(code)
        });
        let names: Vec<String> = pending.awaited.iter().map(|path| path.display().to_string()).collect();
        // Behind what shows how far it is.
        let _ = io::stderr().is_terminal().then(|| writeln!(io::stderr()));
        note(&format!("interrupted before it was written: {}", names.join(", ")));
    }
    std::process::exit(code)
}

/// A file in the folder of `target`, deleted when dropped; with the rights that a new file has, not a secret one's.
fn beside(target: &Path) -> io::Result<NamedTempFile> {
    let mut builder = Builder::new();
    builder.prefix(".freelux-");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder_of(target))
}

/// Where `path` leads: a symbolic link stays a link, and the file it names is replaced, whether it exists or not. What
/// is open already, such as `/dev/stdout`, is left by its number.
fn resolve(path: &Path) -> PathBuf {
    let mut target = path.to_owned();
    for _ in 0..MAX_LINKS {
        match fs::read_link(&target) {
            Ok(next) if !is_open(&target) => target = folder_of(&target).join(next),
            _ => break,
        }
    }
    target
}

/// Whether this names what a process has open, on Linux.
fn is_open(target: &Path) -> bool {
    target.starts_with("/proc") && target.is_symlink()
}

/// Whether this is written to rather than replaced: a device, a pipe, or what is open.
fn is_stream(target: &Path) -> bool {
    is_open(target) || fs::metadata(target).is_ok_and(|found| !found.is_file())
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_is_replaced_and_nothing_else_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        fs::write(&path, "old").unwrap();
        check_writable(&path).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"old", "the check leaves the old file");
        write_all(&[(&path, b"new".to_vec())]).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new", "replaced");
        assert_eq!(names(folder.path()), ["a.png"], "no leftovers");
    }

    #[test]
    fn when_one_file_fails_none_appears() {
        let folder = tempfile::tempdir().unwrap();
        let (good, bad) = (folder.path().join("a.png"), folder.path().join("missing/b.exr"));
        let failure = write_all(&[(&good, b"new".to_vec()), (&bad, b"new".to_vec())]).unwrap_err();
        assert!(matches!(&failure, Failure::Run(line) if line.contains("b.exr")), "{failure:?} names the file");
        assert_eq!(names(folder.path()), [""; 0], "neither the good one nor a part of it");
    }

    #[test]
    fn files_that_are_read_or_written_already_are_not_written() {
        let folder = tempfile::tempdir().unwrap();
        let [scene, out] = ["scene.toml", "out.exr"].map(|name| folder.path().join(name));
        fs::write(&scene, "").unwrap();
        let roundabout = folder.path().join(".").join("out.exr");
        assert!(check_apart(&[&out], &[&scene]).is_ok(), "apart");
        for (written, read) in [(vec![&*scene], vec![&*scene]), (vec![&*out, &*roundabout], vec![])] {
            assert!(matches!(check_apart(&written, &read), Err(Failure::Input(_))), "{written:?}, {read:?}");
        }
        if cfg!(unix) {
            let null = Path::new("/dev/null");
            assert!(check_apart(&[null, null], &[&scene]).is_ok(), "nothing is lost there");
        }
    }

    #[test]
    fn folders_and_missing_folders_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let long = "x".repeat(300);
        for path in [
            folder.path().to_owned(),
            folder.path().join("none/a.png"),
            folder.path().join("a.png/"),
            folder.path().join(long),
        ] {
            assert!(matches!(check_writable(&path), Err(Failure::Input(_))), "{}", path.display());
        }
        assert_eq!(names(folder.path()), [""; 0], "checking creates nothing");
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_and_its_target_is_written() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("real")).unwrap();
        let link = folder.path().join("link.png");
        std::os::unix::fs::symlink("real/a.png", &link).unwrap();
        check_writable(&link).unwrap();
        write_all(&[(&link, b"one".to_vec())]).unwrap();
        write_all(&[(&link, b"two".to_vec())]).unwrap();
        assert!(link.is_symlink(), "still a link");
        assert_eq!(fs::read(folder.path().join("real/a.png")).unwrap(), b"two", "its target is new");
        assert_eq!(names(folder.path()), ["link.png", "real"], "no leftovers");
    }

    #[cfg(unix)]
    #[test]
    fn new_files_have_usual_rights_and_old_ones_keep_theirs() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (plain, ours) = (folder.path().join("plain"), folder.path().join("ours"));
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        fs::write(&plain, "").unwrap();
        write_all(&[(&ours, Vec::new())]).unwrap();
        assert_eq!(mode(&ours), mode(&plain), "as any new file");
        fs::set_permissions(&ours, fs::Permissions::from_mode(0o640)).unwrap();
        write_all(&[(&ours, Vec::new())]).unwrap();
        assert_eq!(mode(&ours), 0o640, "kept when replaced");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn what_is_open_is_written_to_and_keeps_what_it_has() {
        use std::os::fd::AsRawFd;
        let folder = tempfile::tempdir().unwrap();
        let (path, link) = (folder.path().join("log"), folder.path().join("link.json"));
        fs::write(&path, "old ").unwrap();
        let open = File::options().append(true).open(&path).unwrap();
        let number = PathBuf::from(format!("/proc/self/fd/{}", open.as_raw_fd()));
        std::os::unix::fs::symlink(&number, &link).unwrap();
        for name in [&number, &link] {
            check_writable(name).unwrap();
            write_all(&[(name, b"new ".to_vec())]).unwrap();
        }
        assert_eq!(fs::read(&path).unwrap(), b"old new new ");
        assert_eq!(names(folder.path()), ["link.json", "log"], "no leftovers");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_device_is_an_error() {
        let failure = write_all(&[(Path::new("/dev/full"), vec![0; 10])]).unwrap_err();
        assert!(matches!(failure, Failure::Run(_)), "{failure:?}");
    }
}
