//! Warnings, each once with a count.

use std::collections::HashMap;

use super::error::printable;

/// Warnings in the order of their first appearance, each with its number of appearances.
#[derive(Debug, Default)]
pub(super) struct Warnings {
    order: Vec<(String, usize)>,
    index: HashMap<String, usize>,
}

impl Warnings {
    /// Different warnings kept; a file with a million faults must not fill the memory with them.
    const KEPT: usize = 200;

    /// Counts one more `text`.
    pub(super) fn add(&mut self, text: impl Into<String>) {
        self.add_times(text, 1);
    }

    /// Counts `times` more of `text`; nothing where `times` is 0.
    pub(super) fn add_times(&mut self, text: impl Into<String>, times: usize) {
        let text = text.into();
        if times == 0 {
        } else if let Some(&i) = self.index.get(&text) {
            self.order[i].1 += times;
        } else if self.order.len() < Self::KEPT {
            self.index.insert(text.clone(), self.order.len());
            self.order.push((text, times));
        }
    }

    /// Returns one line for each warning, with its count where it is more than one.
    pub(super) fn into_lines(self) -> Vec<String> {
        self.order
            .into_iter()
            .map(|(text, times)| if times == 1 { text } else { format!("{text} ({times} times)") })
            .map(|line| printable(&line))
            .collect()
    }
}
