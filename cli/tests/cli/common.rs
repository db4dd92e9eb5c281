//! Starts the binary in a folder of its own and looks at what it did.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// What a run of the binary left.
#[derive(Debug)]
pub(crate) struct Run {
    /// Exit code; `None` after a signal.
    pub(crate) code: Option<i32>,
    /// What it wrote to stdout.
    pub(crate) stdout: String,
    /// What it wrote to stderr.
    pub(crate) stderr: String,
}

impl Run {
    /// Checks that the run was refused with this code, in one line that holds `words` and nothing on stdout.
    pub(crate) fn expect_refused(&self, code: i32, words: &str) {
        assert_eq!(self.code, Some(code), "exit code, {self:?}");
        assert_eq!(self.stderr.lines().count(), 1, "one line, {self:?}");
        assert!(self.stderr.starts_with("freelux: ") && self.stderr.contains(words), "{words:?} is named, {self:?}");
        assert!(self.stdout.is_empty(), "nothing on stdout, {self:?}");
    }

    /// Checks that the run did what was asked.
    pub(crate) fn expect_done(&self) -> &Self {
        assert_eq!(self.code, Some(0), "{self:?}");
        self
    }
}

/// The binary, to be run in `folder`.
pub(crate) fn command(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_freelux"));
    command.current_dir(folder).stdin(Stdio::null());
    command
}

/// Runs the binary in `folder`.
pub(crate) fn freelux<S: AsRef<OsStr>>(folder: &Path, args: &[S]) -> Run {
    let output = command(folder).args(args).output().expect("the binary starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    Run { code: output.status.code(), stdout: text(&output.stdout), stderr: text(&output.stderr) }
}

/// Runs the binary in `folder` with the words of one line.
pub(crate) fn freelux_words(folder: &Path, words: &str) -> Run {
    freelux(folder, &words.split(' ').collect::<Vec<_>>())
}

/// An empty folder, removed when dropped.
pub(crate) fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder can be made")
}

/// The names in a folder, sorted.
pub(crate) fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("the folder can be read");
    let mut names: Vec<String> =
        entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// A file or folder of the test data.
pub(crate) fn data(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data").join(name);
    assert!(path.exists(), "{} is part of the repository", path.display());
    path
}
