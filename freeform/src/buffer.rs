//! Lists that live on the stack while they are short, so that a ray seldom allocates.

/// A list of which the first `N` entries need no heap.
#[derive(Debug, Clone)]
pub(crate) struct Buffer<T, const N: usize> {
    few: [T; N],
    count: usize,
    /// All entries, once there are more than `N`.
    many: Vec<T>,
}

impl<T: Copy, const N: usize> Buffer<T, N> {
    /// Returns an empty list; `filler` is what unused places hold.
    #[inline]
    pub(crate) fn new(filler: T) -> Self {
        Self { few: [filler; N], count: 0, many: Vec::new() }
    }

    /// Adds an entry.
    #[inline]
    pub(crate) fn push(&mut self, entry: T) {
        if self.count < N {
            self.few[self.count] = entry;
        } else {
            if self.count == N {
                self.many.extend_from_slice(&self.few);
            }
            self.many.push(entry);
        }
        self.count += 1;
    }

    /// Removes the last entry.
    #[inline]
    pub(crate) fn pop(&mut self) -> Option<T> {
        let last = *self.entries().last()?;
        self.count -= 1;
        if self.count == N {
            self.few.copy_from_slice(&self.many[..N]);
            self.many.clear();
        } else if self.count > N {
            self.many.pop();
        }
        Some(last)
    }

    /// Adds an entry before the first one that `is_less` than it, in a list that is kept from large to small.
    pub(crate) fn insert_descending(&mut self, entry: T, is_less: impl Fn(&T, &T) -> bool) {
        self.push(entry);
        let entries = self.entries_mut();
        let mut k = entries.len() - 1;
        while k > 0 && is_less(&entries[k - 1], &entry) {
            entries[k] = entries[k - 1];
            k -= 1;
        }
        entries[k] = entry;
    }

    #[inline]
    pub(crate) fn entries(&self) -> &[T] {
        if self.count <= N { &self.few[..self.count] } else { &self.many }
    }

    #[inline]
    pub(crate) fn entries_mut(&mut self) -> &mut [T] {
        if self.count <= N { &mut self.few[..self.count] } else { &mut self.many }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_and_long_lists_are_alike() {
        let mut list = Buffer::<u32, 4>::new(0);
        let mut plain = Vec::new();
        for k in 0..40_u32 {
            let entry = k * 17 % 23;
            list.insert_descending(entry, |a, b| a < b);
            plain.push(entry);
            plain.sort_unstable_by(|a, b| b.cmp(a));
            assert_eq!(list.entries(), plain, "{k} entries");
            if k % 3 == 2 {
                assert_eq!(list.pop(), plain.pop(), "the smallest, of {k}");
            }
        }
        while let Some(last) = plain.pop() {
            assert_eq!(list.pop(), Some(last), "{} left", plain.len());
        }
        assert_eq!(list.pop(), None, "nothing is left");
        list.push(5);
        assert_eq!(list.entries(), [5], "and it can be used again");
    }
}
