//! The records that may reach a point, each of which has its say.

use glam::{Vec3, Vec3A};
use radcache::BallGrid;

use super::record::{MIN_NORMAL_COS, Place, Record};
use crate::explain::IrradianceFacts;

/// Records of irradiance and where they reach. They are entered one after another, and all answers depend on that order
/// alone.
#[derive(Debug, Default)]
pub(crate) struct Index {
    records: Vec<Record>,
    /// What tells quickly that a record is too far off, for each.
    balls: Vec<Ball>,
    grid: BallGrid,
    /// Wider balls, in which records limit each other; none where they do not.
    neighbours: Option<BallGrid>,
    /// The square of the radius of each of these.
    neighbourhoods_sq: Vec<f32>,
}

/// Records limit those that are nearer than so many times their own reach: as those between do so too, that is enough.
const NEIGHBOURHOOD: f32 = 3.0;

/// What the records around a place tell of it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Told {
    /// The light, as all records tell that reach the place, weighted by how near they are: mean radiance of what stands
    /// at a distance, and of the soft sky. `None` where there is none.
    pub(crate) light: Option<[Vec3; 2]>,
    /// The shortest reach of the records around, metres; `None` where there is none.
    pub(crate) least_reach: Option<f32>,
}

/// Where a record reaches at most.
#[derive(Debug, Clone, Copy)]
struct Ball {
    centre: Vec3A,
    /// The square of its reach.
    reach_sq: f32,
    normal: Vec3,
}

impl Index {
    /// Returns an index without records, in which neighbours limit each other's reach or do not.
    pub(crate) fn new(clamps: bool) -> Self {
        Self { neighbours: clamps.then(BallGrid::default), ..Self::default() }
    }

    /// Enters records in order.
    pub(crate) fn extend(&mut self, records: impl IntoIterator<Item = Record>) {
        for mut record in records {
            self.clamp_to_neighbours(&mut record);
            let number = u32::try_from(self.records.len()).expect("memory ends before 2^32 records");
            self.grid.insert(number, record.centre(), record.reach());
            let reach_sq = record.reach() * record.reach();
            self.balls.push(Ball { centre: record.centre(), reach_sq, normal: record.normal().into() });
            self.records.push(record);
        }
    }

    /// Limits the reach of a new record by that of its neighbours, and theirs by its own: none reaches farther than
    /// another and the way to that (neighbour clamping, Krivanek et al. 2006, *Making radiance and irradiance caching
    /// practical*). Else those that by chance see little of what is bright would reach farthest and have the greatest
    /// say.
    fn clamp_to_neighbours(&mut self, record: &mut Record) {
        let Some(neighbours) = &mut self.neighbours else { return };
        let (centre, normal) = (record.centre(), Vec3::from(record.normal()));
        let way = |other: &Record| other.centre().distance(centre);
        // The grid's answer holds some that are farther off, by where its cells lie.
        let is_neighbour = |&number: &usize| {
            let ball = &self.balls[number];
            ball.centre.distance_squared(centre) <= self.neighbourhoods_sq[number]
                && ball.normal.dot(normal) >= MIN_NORMAL_COS
        };
        let around: Vec<usize> = neighbours.near(centre).map(|number| number as usize).filter(is_neighbour).collect();
        let others = around.iter().map(|&number| &self.records[number]);
        let limit = others.map(|other| other.least_reach() + way(other)).fold(f32::INFINITY, f32::min);
        let reach = record.least_reach().min(limit);
        for number in around {
            let other = &mut self.records[number];
            other.clamp_reach(reach + way(other));
            self.balls[number].reach_sq = other.reach() * other.reach();
        }
        let number = u32::try_from(self.records.len()).expect("memory ends before 2^32 records");
        neighbours.insert(number, centre, NEIGHBOURHOOD * reach);
        self.neighbourhoods_sq.push((NEIGHBOURHOOD * reach).powi(2));
        record.clamp_reach(limit);
    }

    /// Whether some record is within `distance` of a place, see [`Record::distance`].
    pub(crate) fn covers(&self, place: &Place, distance: f32) -> bool {
        self.near(place, distance).any(|record| record.distance(place) <= distance)
    }

    /// What the records around a place tell of it.
    pub(crate) fn look_up(&self, place: &Place) -> Told {
        let mut sum = [Vec3::ZERO; 2];
        let mut total = 0.0;
        let mut least_reach: Option<f32> = None;
        for (record, weight) in self.weighed(place) {
            let reach = record.least_reach();
            least_reach = Some(least_reach.map_or(reach, |least| least.min(reach)));
            if weight > 0.0 {
                let light = record.light(place.p, place.n);
                total += weight;
                sum[0] += weight * light[0];
                sum[1] += weight * light[1];
            }
        }
        // Where gradients overshoot, in the darkest corners, light is not negative.
        Told { light: (total > 0.0).then(|| sum.map(|part| (part / total).max(Vec3::ZERO))), least_reach }
    }

    /// The records by which [`Self::look_up`] finds the light at a place, those that weigh most first.
    pub(crate) fn facts(&self, place: &Place) -> Vec<IrradianceFacts> {
        let reaching: Vec<(&Record, f32)> = self.weighed(place).filter(|(_, weight)| *weight > 0.0).collect();
        let total: f32 = reaching.iter().map(|(_, weight)| weight).sum();
        let fact = |(record, weight): (&Record, f32)| IrradianceFacts {
            centre: record.centre(),
            distance: record.centre().distance(place.p),
            reach: record.reach(),
            share: weight / total,
            radiance: record.light(place.p, place.n).into_iter().sum(),
        };
        let mut facts: Vec<IrradianceFacts> = reaching.into_iter().map(fact).collect();
        facts.sort_by(|a, b| b.share.total_cmp(&a.share));
        facts
    }

    /// The records around a place, and what they weigh there: more than 0 if they reach it.
    fn weighed(&self, place: &Place) -> impl Iterator<Item = (&Record, f32)> {
        self.near(place, 1.0).map(|record| (record, 1.0 - record.distance(place)))
    }

    /// All records in the order in which they were entered.
    pub(crate) fn records(&self) -> &[Record] {
        &self.records
    }

    /// Number of records.
    pub(crate) fn len(&self) -> usize {
        self.records.len()
    }

    /// Bytes that records and cells take, about.
    pub(crate) fn memory_bytes(&self) -> usize {
        self.grid.memory_bytes()
            + self.neighbours.as_ref().map_or(0, BallGrid::memory_bytes)
            + self.balls.len() * size_of::<Ball>()
            + self.neighbourhoods_sq.len() * size_of::<f32>()
            + self.records.iter().map(Record::memory_bytes).sum::<usize>()
    }

    /// The records in whose balls a place lies, shrunk to this share of their reach: all that are within that
    /// `distance`, see [`Record::distance`], and some that are not.
    fn near(&self, place: &Place, distance: f32) -> impl Iterator<Item = &Record> {
        let (p, n) = (place.p, Vec3::from(place.n));
        let share_sq = distance * distance;
        self.grid.near(p).map(|number| number as usize).filter_map(move |number| {
            let ball = &self.balls[number];
            let is_near =
                p.distance_squared(ball.centre) <= share_sq * ball.reach_sq && n.dot(ball.normal) >= MIN_NORMAL_COS;
            is_near.then(|| &self.records[number])
        })
    }
}

#[cfg(test)]
mod tests {
    use hemimap::Frame;
    use proptest::prelude::*;
    use radcache::Samples;

    use super::*;
    use crate::irradiance_cache::edges::TexelEdges;
    use crate::irradiance_cache::record::RecordRules;

    fn record(centre: Vec3A, tilt: f32, min_radius: f32, radiance: f32) -> Record {
        let frame = Frame::from_normal(Vec3A::new(tilt, 0.0, 1.0).normalize());
        let samples = Samples::from_fn(4, |wi| (Vec3::splat(radiance), 1.0 / wi.z, Vec3A::NEG_Z));
        let rules = RecordRules {
            total_error: 1e-3,
            min_radius,
            highlight_radius: min_radius,
            max_radius: min_radius,
            max_share_of_distance: 1.0,
            by_hessian: true,
            gradients: true,
            walls: true,
            gaps: true,
        };
        Record::new(centre, frame, &samples, samples.mean_radiance_by_distance(), &TexelEdges::new(4, 1), &rules)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn all_records_that_reach_a_point_have_their_say(
            places in prop::collection::vec((-5.0f32..5.0, -5.0f32..5.0, -0.1f32..0.1, 0.01f32..4.0, 0.0f32..0.4), 1..60),
            queries in prop::collection::vec((-6.0f32..6.0, -6.0f32..6.0, -0.1f32..0.1, 0.0f32..0.4), 1..20),
            clamps in any::<bool>(),
        ) {
            let records: Vec<Record> = (1u16..).zip(&places)
                .map(|(number, &(x, y, z, radius, tilt))| record(Vec3A::new(x, y, z), tilt, radius, f32::from(number)))
                .collect();
            let mut index = Index::new(clamps);
            index.extend(records.iter().cloned());
            let records = index.records.clone();
            for (x, y, z, tilt) in queries {
                let (p, n) = (Vec3A::new(x, y, z), Vec3A::new(0.0, tilt, 1.0).normalize());
                let place = Place { p, n, clearance: f32::INFINITY };
                let distances = records.iter().map(|record| record.distance(&place));
                let weights: Vec<f32> = distances.clone().map(|distance| (1.0 - distance).max(0.0)).collect();
                let total: f32 = weights.iter().sum();
                let naive: f32 = weights.iter().zip(&records).map(|(w, r)| w * r.light(p, n)[0].x).sum::<f32>() / total;
                let Told { light: found, least_reach } = index.look_up(&place);
                let around = records.iter().filter(|r| r.centre().distance(p) <= r.reach() && n.dot(r.normal()) >= MIN_NORMAL_COS);
                prop_assert_eq!(least_reach, around.map(Record::least_reach).reduce(f32::min));
                prop_assert_eq!(found.is_some(), total > 0.0);
                if let Some([near, _]) = found {
                    // The sums run in another order: rounding of f32.
                    prop_assert!((near.x - naive).abs() <= 1e-5 * naive, "{} instead of {naive}", near.x);
                }
                let nearest = distances.fold(f32::INFINITY, f32::min);
                prop_assert_eq!(index.covers(&place, 0.5), nearest <= 0.5);
            }
        }
    }

    #[test]
    fn neighbours_limit_each_other_whichever_comes_first() {
        let (small, large) = (record(Vec3A::ZERO, 0.0, 0.2, 1.0), record(Vec3A::X * 0.5, 0.0, 4.0, 1.0));
        let turned = record(Vec3A::X * 0.5, 1.0, 4.0, 1.0);
        for order in [[&small, &large], [&large, &small]] {
            let mut index = Index::new(true);
            index.extend(order.into_iter().cloned());
            let reaches = index.records.iter().map(Record::least_reach);
            let [least, most] = [reaches.clone().fold(4.0, f32::min), reaches.fold(0.0, f32::max)];
            assert!(least == 0.2 && (most - 0.7).abs() < 1e-6, "{least} and {most}");
            let place = |x: f32| Place { p: Vec3A::X * x, n: Vec3A::Z, clearance: f32::INFINITY };
            assert!(index.covers(&place(1.1), 1.0) && !index.covers(&place(1.3), 1.0), "that is where it ends");
        }
        let mut index = Index::new(true);
        index.extend([small.clone(), turned]);
        assert_eq!(index.records[1].least_reach(), 4.0, "another surface");
        let mut index = Index::new(false);
        index.extend([small, large]);
        assert_eq!(index.records[1].least_reach(), 4.0, "nobody is clamped");
    }

    #[test]
    fn nobody_is_served_by_nothing() {
        let place = Place { p: Vec3A::ZERO, n: Vec3A::Z, clearance: f32::INFINITY };
        assert_eq!(Index::default().look_up(&place), Told::default(), "no record");
        assert!(!Index::default().covers(&place, 1.0), "nor near one");
    }
}
