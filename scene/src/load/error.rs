//! What can be wrong with a file, always told in one line: `file:line: what; do this`.

use std::fmt;
use std::path::{Path, PathBuf};

/// Why a scene was not loaded; its text is one line, `file:line: what; do this`.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// A file is not there, is not a regular file, may not be read or ends too early.
    #[error("{0}")]
    Unreadable(Problem),
    /// Something in a file has no meaning: syntax, a number out of its domain, a name that nothing has.
    #[error("{0}")]
    Invalid(Problem),
    /// Something is larger than the limits of [`limits`](crate::limits).
    #[error("{0}")]
    TooLarge(Problem),
    /// Something is right and not supported.
    #[error("{0}")]
    Unsupported(Problem),
}

/// The four parts of a [`LoadError`]'s line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// The file at fault.
    pub file: PathBuf,
    /// The line in it, counted from 1, where it has lines.
    pub line: Option<usize>,
    /// What is wrong.
    pub what: String,
    /// What to do about it.
    pub advice: String,
}

impl LoadError {
    /// Returns the place, the fault and the advice.
    pub fn problem(&self) -> &Problem {
        match self {
            Self::Unreadable(p) | Self::Invalid(p) | Self::TooLarge(p) | Self::Unsupported(p) => p,
        }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let file = self.file.display().to_string();
        let line = self.line.map(|line| format!(":{line}")).unwrap_or_default();
        write!(f, "{}{line}: {}; {}", printable(&file), printable(&self.what), printable(&self.advice))
    }
}

/// Text without control characters: names in hostile files must not break the line or colour the terminal.
pub(super) fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { '?' } else { c }).collect()
}

/// A file and perhaps a line in it, from which errors are made.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place<'a> {
    pub(super) file: &'a Path,
    pub(super) line: Option<usize>,
}

impl<'a> Place<'a> {
    pub(super) fn file(file: &'a Path) -> Self {
        Self { file, line: None }
    }

    pub(super) fn line(file: &'a Path, line: usize) -> Self {
        Self { file, line: Some(line) }
    }

    pub(super) fn unreadable(self, what: impl Into<String>, advice: impl Into<String>) -> LoadError {
        LoadError::Unreadable(self.problem(what, advice))
    }

    pub(super) fn invalid(self, what: impl Into<String>, advice: impl Into<String>) -> LoadError {
        LoadError::Invalid(self.problem(what, advice))
    }

    pub(super) fn too_large(self, what: impl Into<String>, advice: impl Into<String>) -> LoadError {
        LoadError::TooLarge(self.problem(what, advice))
    }

    pub(super) fn unsupported(self, what: impl Into<String>, advice: impl Into<String>) -> LoadError {
        LoadError::Unsupported(self.problem(what, advice))
    }

    fn problem(self, what: impl Into<String>, advice: impl Into<String>) -> Problem {
        Problem { file: self.file.to_owned(), line: self.line, what: what.into(), advice: advice.into() }
    }
}

impl fmt::Display for Place<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", printable(&self.file.display().to_string()))?;
        self.line.map_or(Ok(()), |line| write!(f, ":{line}"))
    }
}

/// A name from a file in quotes, cut where it is long.
pub(super) fn quoted(name: &str) -> String {
    const SHOWN: usize = 100;
    match name.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("'{}...'", &name[..end]),
        None => format!("'{name}'"),
    }
}

/// The candidate closest to `word` by insertions, deletions and replacements of letters, where one is close at all.
pub(super) fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    const LONGEST: usize = 200;
    let limit = word.chars().count() / 2 + 1;
    candidates
        .into_iter()
        .filter(|candidate| candidate.len() <= LONGEST && word.len() <= LONGEST)
        .map(|candidate| (edit_distance(word, candidate), candidate))
        .filter(|&(distance, _)| distance <= limit)
        .min_by_key(|&(distance, _)| distance)
        .map(|(_, candidate)| candidate)
}

/// Levenshtein distance by rows.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &cb) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(ca != cb);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_finds_a_slip_of_the_finger() {
        assert_eq!(nearest("fovv", ["eye", "at", "fov"]), Some("fov"), "one letter too many");
        assert_eq!(nearest("difuse", ["diffuse", "mirror"]), Some("diffuse"), "one letter missing");
        assert_eq!(nearest("zebra", ["eye", "quadric"]), None, "nothing is near");
        assert_eq!(edit_distance("kitten", "sitting"), 3, "the textbook case");
    }

    #[test]
    fn error_is_one_line_whatever_the_names_hold() {
        let error = Place::line(Path::new("a\nb.obj"), 3).invalid("bad \u{1b}[31mname\r\n", "mend it");
        let text = error.to_string();
        assert_eq!(text, "a?b.obj:3: bad ?[31mname??; mend it", "control characters are replaced");
    }
}
