//! The search for the record that serves a point best: a grid of cells for each power of two of the radius.

use std::collections::HashMap;

use glam::{IVec3, Vec3A};

use crate::{Record, Validity};

/// Records and where they reach.
///
/// A record of radius r is entered at the level whose cells are at least 2 r wide, in the up to eight cells that its ball
/// touches, so a search looks at one cell a level: with radii spread over a factor of 1000 that is ten look-ups at most. Records
/// are entered one after another and keep their numbers, so the answer depends on the order of the calls alone.
#[derive(Debug, Default)]
pub struct Index {
    validity: Validity,
    records: Vec<Record>,
    /// Largest cells first.
    levels: Vec<Level>,
}

/// The records of about one radius.
#[derive(Debug)]
struct Level {
    /// Exponent of the cell width.
    exponent: i32,
    /// The records that reach into each cell.
    cells: HashMap<IVec3, Vec<u32>, CellHasher>,
}

/// What [`Index::best`] found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// Number of the record, for [`Index::record`].
    pub record: usize,
    /// How ill it fits, 0 to 1 (see [`Validity::misfit`]).
    pub misfit: f32,
}

impl Index {
    /// An empty index with rules for what may serve whom.
    #[must_use]
    pub fn new(validity: Validity) -> Self {
        Self { validity, ..Self::default() }
    }

    /// Enters records in order.
    ///
    /// # Panics
    /// If there are 2^32 of them.
    pub fn extend(&mut self, records: impl IntoIterator<Item = Record>) {
        for record in records {
            let number = u32::try_from(self.records.len()).expect("memory ends before 2^32 records");
            let radius = record.radius();
            if radius > 0.0 {
                // Under an open sky a record may reach everywhere.
                let radius = radius.min(WIDEST);
                let exponent = level_exponent(radius);
                let level = self.level(exponent);
                let width = cell_width(exponent);
                let low = cell(record.centre() - radius, width);
                let high = cell(record.centre() + radius, width);
                for x in low.x..=high.x {
                    for y in low.y..=high.y {
                        for z in low.z..=high.z {
                            self.levels[level].cells.entry(IVec3::new(x, y, z)).or_default().push(number);
                        }
                    }
                }
            }
            self.records.push(record);
        }
    }

    /// The record that fits `p` with unit normal `n` best, if any reaches it; the first entered among equals.
    #[must_use]
    pub fn best(&self, p: Vec3A, n: Vec3A) -> Option<Found> {
        self.best_but(p, n, &[])
    }

    /// The best record that is not in `refused`.
    #[must_use]
    pub fn best_but(&self, p: Vec3A, n: Vec3A, refused: &[usize]) -> Option<Found> {
        let mut best: Option<Found> = None;
        for level in &self.levels {
            let Some(candidates) = level.cells.get(&cell(p, cell_width(level.exponent))) else {
                continue;
            };
            for &number in candidates {
                let record = number as usize;
                let misfit = self.validity.misfit(&self.records[record], p, n);
                let better = best.is_none_or(|b| misfit < b.misfit || (misfit == b.misfit && record < b.record));
                if misfit <= 1.0 && better && !refused.contains(&record) {
                    best = Some(Found { record, misfit });
                }
            }
        }
        best
    }

    /// A record by its number.
    #[must_use]
    pub fn record(&self, number: usize) -> &Record {
        &self.records[number]
    }

    /// All records in the order in which they were entered.
    #[must_use]
    pub fn records(&self) -> &[Record] {
        &self.records
    }

    /// Number of records.
    #[must_use]
    pub fn len(&self) -> usize {
        self.records.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// Bytes that records and cells take, about.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        let cells: usize =
            self.levels.iter().flat_map(|level| level.cells.values()).map(|v| 40 + v.capacity() * 4).sum();
        cells + self.records.iter().map(Record::memory_bytes).sum::<usize>()
    }

    fn level(&mut self, exponent: i32) -> usize {
        match self.levels.binary_search_by(|level| exponent.cmp(&level.exponent)) {
            Ok(found) => found,
            Err(place) => {
                self.levels.insert(place, Level { exponent, cells: HashMap::default() });
                place
            }
        }
    }
}

/// Metres beyond which no scene goes.
const WIDEST: f32 = 1e30;

/// Smallest exponent e with 2^e >= 2 radius.
fn level_exponent(radius: f32) -> i32 {
    #[expect(clippy::cast_possible_truncation, reason = "an f32 exponent")]
    let exponent = (2.0 * radius).log2().ceil() as i32;
    exponent
}

fn cell_width(exponent: i32) -> f32 {
    2f32.powi(exponent)
}

/// The cell of a point. Very far points share the outermost cell: the cast saturates.
fn cell(p: Vec3A, width: f32) -> IVec3 {
    (p / width).floor().as_ivec3()
}

/// A multiplicative hash of three cell numbers; the default one costs more than the search.
#[derive(Debug, Clone, Copy, Default)]
struct CellHasher;

impl std::hash::BuildHasher for CellHasher {
    type Hasher = CellHash;
    fn build_hasher(&self) -> CellHash {
        CellHash(0)
    }
}

#[derive(Debug)]
struct CellHash(u64);

impl std::hash::Hasher for CellHash {
    fn finish(&self) -> u64 {
        self.0 ^ self.0 >> 32
    }
    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.write_i32(i32::from(byte));
        }
    }
    fn write_i32(&mut self, value: i32) {
        // The golden ratio in 64 bits, as in Fibonacci hashing.
        self.0 = (self.0.rotate_left(21) ^ u64::from(value.cast_unsigned())).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{RecordSettings, Samples};
    use glam::Vec3;
    use proptest::prelude::*;

    fn record(centre: Vec3A, n: Vec3A, height: f32, validity: &Validity) -> Record {
        let samples = Samples::from_fn(4, |wi| (Vec3::ONE, height / wi.z, Vec3A::NEG_Z));
        Record::new(centre, hemimap::Frame::from_normal(n), samples, &RecordSettings::default(), validity)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn finds_what_a_plain_search_finds(
            places in prop::collection::vec((-5.0f32..5.0, -5.0f32..5.0, -1.0f32..1.0, 0.01f32..4.0, 0.0f32..0.6), 1..60),
            queries in prop::collection::vec((-6.0f32..6.0, -6.0f32..6.0, -1.0f32..1.0, 0.0f32..0.6), 1..20),
        ) {
            let validity = Validity::default();
            let mut index = Index::new(validity);
            index.extend(places.iter().map(|&(x, y, z, height, tilt)| {
                record(Vec3A::new(x, y, z), Vec3A::new(tilt, 0.0, 1.0).normalize(), height, &validity)
            }));
            for (x, y, z, tilt) in queries {
                let (p, n) = (Vec3A::new(x, y, z), Vec3A::new(0.0, tilt, 1.0).normalize());
                let naive = (0..index.len())
                    .map(|i| (validity.misfit(index.record(i), p, n), i))
                    .filter(|(misfit, _)| *misfit <= 1.0)
                    .min_by(|a, b| a.partial_cmp(b).unwrap());
                prop_assert_eq!(index.best(p, n).map(|f| (f.misfit, f.record)), naive);
            }
        }
    }

    #[test]
    fn a_record_without_limit_reaches_everywhere() {
        let validity = Validity { min_normal_cos: 1.0, ..Validity::default() };
        let sky = record(Vec3A::ONE, Vec3A::Z, f32::INFINITY, &validity);
        assert_eq!(sky.radius(), f32::INFINITY, "no limit was set");
        let mut index = Index::new(validity);
        index.extend([sky, record(Vec3A::ZERO, Vec3A::Z, 1.0, &validity)]);
        for p in [Vec3A::ONE, Vec3A::splat(-1e6), Vec3A::new(1e15, -3.0, 0.0)] {
            assert_eq!(index.best(p, Vec3A::Z).map(|f| (f.record, f.misfit)), Some((0, 0.0)), "at {p}");
        }
        assert_eq!(index.best(Vec3A::ZERO, Vec3A::Y), None, "only equal normals");
    }

    #[test]
    fn refused_records_are_passed_over() {
        let validity = Validity::default();
        let mut index = Index::new(validity);
        index.extend([record(Vec3A::ZERO, Vec3A::Z, 1.0, &validity), record(Vec3A::X * 0.1, Vec3A::Z, 1.0, &validity)]);
        assert_eq!(index.best(Vec3A::ZERO, Vec3A::Z).map(|f| f.record), Some(0));
        assert_eq!(index.best_but(Vec3A::ZERO, Vec3A::Z, &[0]).map(|f| f.record), Some(1));
        assert_eq!(index.best_but(Vec3A::ZERO, Vec3A::Z, &[0, 1]), None);
        assert_eq!(index.best(Vec3A::ZERO, Vec3A::NEG_Z), None, "the other side of the surface");
    }
}
