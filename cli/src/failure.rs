//! How a command ends when it cannot do what was asked: one line on stderr and an exit code.

use std::fmt::Display;
use std::io::{self, Write};
use std::path::Path;
use std::process::ExitCode;

/// Why a command ends early.
#[derive(Debug)]
pub(crate) enum Failure {
    /// Arguments or files are wrong: exit code 2.
    Input(String),
    /// Something failed while running, such as a full disk: exit code 1.
    Run(String),
    /// The reader of stdout went away, which is its right: quiet, exit code 0.
    ClosedPipe,
}

impl Failure {
    /// Wrong input, told by any error whose text is one line.
    pub(crate) fn input(what: impl Display) -> Self {
        Self::Input(what.to_string())
    }

    /// A file that could not be written.
    pub(crate) fn unwritable(path: &Path, error: &io::Error) -> Self {
        Self::Run(format!("{}: cannot be written: {error}; free space or choose another place", path.display()))
    }

    /// Tells the user, and returns the exit code.
    pub(crate) fn report(&self) -> ExitCode {
        let (message, code) = match self {
            Self::Input(message) => (message, 2),
            Self::Run(message) => (message, 1),
            Self::ClosedPipe => return ExitCode::SUCCESS,
        };
        note(message);
        ExitCode::from(code)
    }
}

/// Text without control characters: names, which files may choose, must neither break a line nor colour the terminal.
pub(crate) fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { '?' } else { c }).collect()
}

/// Writes one line to stderr.
pub(crate) fn note(message: &str) {
    // Nobody is left to be told when stderr is closed.
    let _ = writeln!(io::stderr(), "freelux: {}", printable(message));
}

/// Writes what was asked for to stdout.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    let mut stdout = io::stdout().lock();
    let written = stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush());
    written.map_err(|error| match error.kind() {
        io::ErrorKind::BrokenPipe => Failure::ClosedPipe,
        _ => Failure::Run(format!("stdout: cannot be written: {error}")),
    })
}
