//! From the keys of cells to their numbers.

/// Keys to numbers in their order, by open addressing.
#[derive(Debug, Default)]
pub(super) struct Table {
    /// The upper 40 bits of a key above its number, so that a cache line has eight; 0 is a free slot. For one picture
    /// in some 100,000 a place without a cell is taken for one that has the same bits and slot.
    pub(super) slots: Vec<u64>,
}

impl Table {
    /// The lower bits, which hold the number.
    const NUMBERS: u64 = Self::CUT as u64;

    /// The number of all keys whose cells are cut.
    pub(super) const CUT: u32 = (1 << 24) - 1;

    /// Numbers keys, each of which comes once and none among those that are `cut`; there are fewer than 2^24.
    pub(super) fn new(keys: impl ExactSizeIterator<Item = u64>, cut: &[u64]) -> Self {
        assert!((keys.len() as u64) < Self::NUMBERS, "probes find fewer cells");
        let mut table = Self { slots: vec![0; (2 * (keys.len() + cut.len()) + 1).next_power_of_two()] };
        let cut = cut.iter().map(|&key| (key, Self::NUMBERS));
        for (key, number) in keys.zip(0u64..).chain(cut) {
            let slot = table.slot(key);
            table.slots[slot] = key & !Self::NUMBERS | number;
        }
        table
    }

    #[inline]
    pub(super) fn find(&self, key: u64) -> Option<u32> {
        let found = *self.slots.get(self.slot(key))?;
        (found != 0).then_some((found & Self::NUMBERS) as u32)
    }

    /// The slot of a key, or the free one where it belongs.
    fn slot(&self, key: u64) -> usize {
        let mask = self.slots.len().wrapping_sub(1);
        let mut slot = usize::try_from(key & mask as u64).expect("masked to an index");
        while let Some(&found) = self.slots.get(slot)
            && found != 0
            && (found ^ key) > Self::NUMBERS
        {
            slot = (slot + 1) & mask;
        }
        slot
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::hash;

    #[test]
    fn table_finds_the_keys_that_it_has() {
        assert_eq!(Table::default().find(1 << 63), None, "no slots");
        // Unrelated keys, and keys whose slots are the same and wrap round the end.
        let unrelated = |i: u64| hash(i) | 1 << 63;
        let crowded = |i: u64| i << 40 | 1 << 63 | 0xff_ffff;
        for key in [&unrelated as &dyn Fn(u64) -> u64, &crowded] {
            for count in [0, 1, 2, 7, 8, 1000] {
                let cut: Vec<u64> = (count..count + 5).map(key).collect();
                let table = Table::new((0..count).map(key).collect::<Vec<u64>>().into_iter(), &cut);
                for i in 0..count + 100 {
                    let number = if i < count { u32::try_from(i).unwrap() } else { Table::CUT };
                    let expected = (i < count + 5).then_some(number);
                    assert_eq!(table.find(key(i)), expected, "key {i} of {count}");
                }
            }
        }
    }
}
