//! The search for the record that serves a point best.

use glam::Vec3A;

use crate::{BallGrid, Record, Validity};

/// Records and where they reach. They are entered one after another and keep their numbers, so the answer depends on
/// the order of the calls alone.
///
/// It may be searched from many threads at once. Records that they make are entered when all are done, in an order that
/// does not hang on the threads. One of n = 32 takes 60 to 85 kB, also if it reaches nobody: those need not be entered.
#[derive(Debug, Default)]
pub struct Index {
    validity: Validity,
    records: Vec<Record>,
    grid: BallGrid,
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

    /// The rules that it searches by, for those who make the next record.
    ///
    /// ```
    /// use radcache::{Index, Validity};
    ///
    /// let index = Index::new(Validity::for_scene(8.0));
    /// assert_eq!(index.validity().max_radius, 0.8);
    /// ```
    #[must_use]
    pub const fn validity(&self) -> &Validity {
        &self.validity
    }

    /// Enters records in order.
    ///
    /// # Panics
    /// If there are 2^32 of them.
    pub fn extend(&mut self, records: impl IntoIterator<Item = Record>) {
        for record in records {
            let number = u32::try_from(self.records.len()).expect("memory ends before 2^32 records");
            self.grid.insert(number, record.centre(), record.radius());
            self.records.push(record);
        }
    }

    /// The record that fits `p` with unit normal `n` best, if any reaches it; the first entered among equals.
    #[must_use]
    pub fn best(&self, p: Vec3A, n: Vec3A) -> Option<Found> {
        let mut best: Option<Found> = None;
        for number in self.grid.near(p) {
            let record = number as usize;
            let misfit = self.validity.misfit(&self.records[record], p, n);
            let better = best.is_none_or(|b| misfit < b.misfit || (misfit == b.misfit && record < b.record));
            if misfit <= 1.0 && better {
                best = Some(Found { record, misfit });
            }
        }
        best
    }

    /// A record by its number.
    ///
    /// # Panics
    /// If there are fewer records.
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
        self.grid.memory_bytes() + self.records.iter().map(Record::memory_bytes).sum::<usize>()
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
    fn a_record_of_the_sky_alone_reaches_as_far_as_is_allowed() {
        for max_radius in [1.0, 1e15, f32::INFINITY] {
            let validity = Validity { min_normal_cos: 1.0, max_radius, ..Validity::default() };
            let mut index = Index::new(validity);
            index.extend([record(Vec3A::ZERO, Vec3A::Z, f32::INFINITY, &validity)]);
            let found = |p| index.best(p, Vec3A::Z).map(|found| (found.record, found.misfit));
            let half = found(Vec3A::new(0.5 * max_radius, 0.0, 0.0));
            assert_eq!(half, max_radius.is_finite().then_some((0, 0.5)), "nobody without a limit");
            assert_eq!(found(Vec3A::new(1.01 * max_radius, 0.0, 0.0)), None);
            assert_eq!(index.best(Vec3A::ZERO, Vec3A::Y), None, "only equal normals");
        }
    }

    #[test]
    fn what_lies_on_a_roof_does_not_serve_the_floor_below() {
        let validity = Validity::for_scene(10.0);
        let mut index = Index::new(validity);
        index.extend([record(3.0 * Vec3A::Z, Vec3A::Z, f32::INFINITY, &validity)]);
        assert!(index.best(Vec3A::new(0.3, 0.0, 3.0), Vec3A::Z).is_some(), "the roof");
        assert_eq!(index.best(Vec3A::ZERO, Vec3A::Z), None, "the floor");
    }

    #[test]
    fn the_nearer_of_two_fits_better() {
        let validity = Validity::default();
        let mut index = Index::new(validity);
        index.extend([record(Vec3A::ZERO, Vec3A::Z, 1.0, &validity), record(Vec3A::X * 0.1, Vec3A::Z, 1.0, &validity)]);
        for (x, nearer) in [(0.0, 0), (0.04, 0), (0.06, 1), (0.1, 1)] {
            assert_eq!(index.best(Vec3A::X * x, Vec3A::Z).map(|f| f.record), Some(nearer), "at {x}");
        }
        assert_eq!(index.best(Vec3A::ZERO, Vec3A::NEG_Z), None, "the other side of the surface");
    }
}
