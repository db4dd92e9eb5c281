//! The lines in which bytes of a text lie, for many of them.
//!
//! Every table and face has its place at hand for errors: counted from the beginning of the file each time, they took a
//! minute in a file of 200,000 faces. Line ends are counted once up to the start of each block of the text, and a place
//! counts those in its own block. A list of the lines themselves would take half a gigabyte for a file of empty ones.

/// Line ends before each block of a text.
#[derive(Debug)]
pub(super) struct LineNumbers(Vec<usize>);

/// Bytes in a block.
const BLOCK: usize = 1024;

impl LineNumbers {
    pub(super) fn new(text: &str) -> Self {
        let mut before = 0;
        let count = |block: &[u8]| {
            let here = before;
            before += line_ends(block);
            here
        };
        Self(text.as_bytes().chunks(BLOCK).map(count).collect())
    }

    /// Returns the number of the line, from 1, that holds the byte `at` of the same text; of the last one for what lies
    /// behind.
    pub(super) fn line(&self, text: &str, at: usize) -> usize {
        let at = at.min(text.len());
        let block = (at / BLOCK).min(self.0.len().saturating_sub(1));
        self.0.get(block).map_or(0, |before| before + line_ends(&text.as_bytes()[block * BLOCK..at])) + 1
    }
}

fn line_ends(bytes: &[u8]) -> usize {
    bytes.iter().filter(|&&byte| byte == b'\n').count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_those_counted_from_the_beginning() {
        for length in [0, 1, 2, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK, 5 * BLOCK + 7] {
            for every in [1, 2, 7, BLOCK, BLOCK + 1] {
                let text: String = (0..length).map(|i| if i % every == every - 1 { '\n' } else { 'x' }).collect();
                let lines = LineNumbers::new(&text);
                for at in 0..=length + 2 {
                    let expected = text.as_bytes()[..at.min(length)].iter().filter(|&&byte| byte == b'\n').count() + 1;
                    assert_eq!(lines.line(&text, at), expected, "byte {at} of {length}, a line end every {every}");
                }
            }
        }
    }
}
