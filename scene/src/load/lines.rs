//! Lines of OBJ and MTL files: counted, continued lines joined, without byte order mark, as UTF-8, of bounded length.

use std::borrow::Cow;
use std::io::{BufRead, Read};
use std::path::Path;

use super::error::{LoadError, Place};
use super::{files, limits};

/// A reader of logical lines that knows where it is.
pub(super) struct Lines<'a> {
    file: &'a Path,
    reader: Box<dyn BufRead + 'a>,
    bytes: Vec<u8>,
    /// Number of the first line of the logical line read last.
    number: usize,
    /// Lines of the file read so far.
    count: usize,
}

impl<'a> Lines<'a> {
    pub(super) fn new(file: &'a Path, reader: Box<dyn BufRead + 'a>) -> Self {
        Self { file, reader, bytes: Vec::new(), number: 0, count: 0 }
    }

    /// The place of the line read last.
    pub(super) fn place(&self) -> Place<'a> {
        Place::line(self.file, self.number)
    }

    /// Reads the next logical line, without its end; `None` at the end of the file.
    pub(super) fn next(&mut self) -> Result<Option<Cow<'_, str>>, LoadError> {
        self.bytes.clear();
        self.number = self.count + 1;
        if !self.append()? {
            return Ok(None);
        }
        if self.number == 1 && self.bytes.starts_with(b"\xef\xbb\xbf") {
            self.bytes.drain(..3);
        }
        // A comment may end in the backslash of a Windows folder; it is not continued. What was read before is known
        // to hold none.
        let mut known = 0;
        while self.bytes.last() == Some(&b'\\') && !has_comment(&self.bytes[known..]) {
            self.bytes.pop();
            known = self.bytes.len();
            self.bytes.push(b' ');
            if !self.append()? {
                break;
            }
        }
        if self.bytes.contains(&0) {
            return Err(self.place().invalid("it is not text", "give an OBJ or MTL file in UTF-8 or Latin-1"));
        }
        Ok(Some(match std::str::from_utf8(&self.bytes) {
            Ok(text) => Cow::Borrowed(text),
            // Latin-1 is the first 256 characters of Unicode.
            Err(_) => Cow::Owned(self.bytes.iter().map(|&byte| char::from(byte)).collect()),
        }))
    }

    /// Appends one line of the file without its end; returns whether there was one.
    fn append(&mut self) -> Result<bool, LoadError> {
        let room = (limits::LINE_BYTES - self.bytes.len().min(limits::LINE_BYTES)) as u64;
        let before = self.bytes.len();
        let read = self.reader.by_ref().take(room + 1).read_until(b'\n', &mut self.bytes);
        let read = read.map_err(|error| files::cannot_open(Place::file(self.file), self.file, &error))?;
        self.count += usize::from(read > 0);
        if self.bytes.len() > limits::LINE_BYTES {
            let what = format!("the line is longer than the limit of {} bytes", limits::LINE_BYTES);
            return Err(self.place().too_large(what, "check that this is a text file, or split the line"));
        }
        while self.bytes.len() > before && matches!(self.bytes.last(), Some(b'\n' | b'\r')) {
            self.bytes.pop();
        }
        Ok(read > 0)
    }
}

/// The text before a comment. `1.#INF`, as some compilers write what is no number, is no comment.
pub(super) fn uncommented(text: &str) -> &str {
    let start = text.match_indices('#').find(|(start, _)| !text[..*start].ends_with('.'));
    start.map_or(text, |(start, _)| &text[..start])
}

/// Whether the rest of a line is a comment, from some word on.
fn has_comment(line: &[u8]) -> bool {
    line.first() == Some(&b'#') || line.windows(2).any(|pair| pair[0].is_ascii_whitespace() && pair[1] == b'#')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(bytes: &[u8]) -> Vec<(usize, String)> {
        let mut lines = Lines::new(Path::new("x"), Box::new(bytes));
        let mut all = Vec::new();
        while let Some(text) = lines.next().expect("the text is valid").map(Cow::into_owned) {
            all.push((lines.number, text));
        }
        all
    }

    #[test]
    fn numbers_count_lines_of_the_file() {
        let found = lines(b"\xef\xbb\xbfv 1\\\r\n 2 3\r\nf\n# C:\\dir\\\nv 1 # C:\\\nlast");
        let expected = [(1, "v 1  2 3"), (3, "f"), (4, "# C:\\dir\\"), (5, "v 1 # C:\\"), (6, "last")];
        assert_eq!(found, expected.map(|(n, text)| (n, text.to_owned())), "BOM, CRLF, continuation, comment");
    }

    #[test]
    fn latin_1_becomes_utf_8() {
        assert_eq!(lines(b"usemtl gr\xfcn"), [(1, "usemtl gr\u{fc}n".to_owned())], "u with dots");
    }

    #[test]
    fn zero_bytes_are_not_text() {
        let error = Lines::new(Path::new("x"), Box::new(&b"v 1\n\0\0"[..]));
        let mut lines = error;
        assert!(lines.next().is_ok(), "the first line is fine");
        assert!(lines.next().expect_err("zero bytes").to_string().starts_with("x:2: it is not text"), "line 2");
    }
}
