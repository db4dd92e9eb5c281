//! Which lights reach a place, by samples that were taken around it.
//!
//! ```text
//! weight = FLOOR + sqrt((samples (x / mean)^2 + PRIOR) / (samples + PRIOR))
//! mean   = sum over all groups of sqrt(x^2) count / sum of all counts
//! ```
//!
//! x is what a sample of a group of lights counts, in the root mean square: what its light brings, over the density of
//! the sample; about mean in the mean. What each lamp may bring, times the root of the mean square of x, would leave the least noise of all
//! choices that know no more of a point. FLOOR keeps what the samples missed. A group is a lamp, a light at infinity,
//! or a branch of the tree; those branches whose lamps brought most are split until the lamps that matter are by
//! themselves.
//!
//! # Source
//! Vevoda, Kondapaneni, Krivanek 2018: Bayesian Online Regression for Adaptive Direct Illumination Sampling, for groups
//! of lights that are weighed by what their samples found. Rath et al. 2020: Variance-Aware Path Guiding, for the root
//! of the second moment. We depart from the first in that nothing is learnt while the picture is made, and the groups
//! of each place are its own.

use std::ops::Range;

use super::chances::{LightChoice, one};
use super::lamps::{LANES, MOST_GROUPS};
use super::{Lights, narrow};

/// Added to weights, whose mean is about 1. With less, what the samples missed is brighter, and there are outliers.
const FLOOR: f64 = 0.5;

/// Samples of each group that count as if they had found the mean.
const PRIOR: f64 = 1.0;

/// What samples of one light, chosen as [`Lights::seen_from`] does, have found around a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightLesson {
    /// Below [`Lights::count`].
    pub light: usize,
    /// Number of samples, less where they were taken some way off.
    pub samples: f32,
    /// The same where each is chosen by what it may bring; where some are chosen otherwise, the sum of their weights,
    /// which make up for that.
    pub count: f32,
    /// Sum over them of the square of what each counts, times its weight: what the light brought, 0 where something
    /// stood between, over the density of the sample. In any unit, the same for all lessons.
    pub moment: f32,
}

impl Lights {
    /// Returns how lights are to be chosen at a place, by what samples have found around it; `None` where none found
    /// any light, or more than numbers can tell. A light may have several lessons or none.
    ///
    /// # Panics
    /// If a lesson is of no light, or one of its numbers below 0 or NaN.
    ///
    /// # Example
    ///
    /// ```
    /// use scene::glam::{Vec3, Vec3A};
    /// use scene::{Description, LightLesson, PunctualLight, Scene};
    ///
    /// let lamps = [Vec3::Z, Vec3::NEG_Z].map(|position| PunctualLight::Point { position, intensity: Vec3::ONE });
    /// let scene = Scene::new(Description { lights: lamps.to_vec(), ..Description::default() })?;
    /// let lights = scene.lights();
    /// // Of the second one nothing was ever seen.
    /// let lessons = [(0, 4.0), (1, 0.0)].map(|(light, moment)| LightLesson { light, samples: 100.0, count: 100.0, moment });
    /// let choice = lights.learnt_choice(&lessons).expect("there is light");
    /// let seen = lights.seen_by(Vec3A::ZERO, Vec3A::Z, Some(&choice));
    /// assert!(seen.probability(0) > 0.7 && seen.probability(1) > 0.1);
    /// # Ok::<(), scene::BuildError>(())
    /// ```
    #[must_use]
    pub fn learnt_choice(&self, lessons: &[LightLesson]) -> Option<LightChoice> {
        let learnt = Learnt::new(self, lessons);
        let all = learnt.all();
        if all.moment == 0.0 {
            return None;
        }
        let mut branches = self.even.branches();
        if let Some(tree) = &self.tree {
            // Lamps and branches fill their last blocks each.
            tree.split(&mut branches, MOST_GROUPS - LANES, |node| narrow(learnt.of(node.places()).root));
        }
        let near = self.tree.iter().flat_map(|tree| branches.iter().map(|&branch| tree.node(branch).places()));
        let groups = near.chain(self.far_places().map(one));
        let roots: f64 = groups.map(|places| learnt.of(places).root_of_all()).sum();
        let mean = roots / all.count;
        (mean > 0.0 && mean.is_finite()).then(|| {
            LightChoice::weighted(self, &branches, |places| {
                let Sum { samples, count, moment, .. } = learnt.of(places);
                // A count may be lost beside much greater ones.
                let found = if count > 0.0 { samples * (moment / count) / (mean * mean) } else { 0.0 };
                narrow(FLOOR + ((found + PRIOR) / (samples + PRIOR)).sqrt())
            })
        })
    }
}

/// What is learnt of lights together.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    samples: f64,
    count: f64,
    moment: f64,
    /// Of the roots of each, times their counts.
    root: f64,
}

impl Sum {
    fn root_of_all(&self) -> f64 {
        (self.count * self.moment).sqrt()
    }
}

/// What is learnt of lights, in the order of their places.
struct Learnt {
    /// Those of which there are lessons.
    places: Vec<u32>,
    /// Before each of them, and of all.
    sums: Vec<Sum>,
}

impl Learnt {
    fn new(lights: &Lights, lessons: &[LightLesson]) -> Self {
        let mut lessons: Vec<(u32, &LightLesson)> =
            lessons.iter().map(|lesson| (lights.place(lesson.light), lesson)).collect();
        lessons.sort_by_key(|lesson| lesson.0);
        let (mut places, mut sum, mut sums) = (Vec::new(), Sum::default(), vec![Sum::default()]);
        for of_light in lessons.chunk_by(|a, b| a.0 == b.0) {
            let mut light = Sum::default();
            for (_, lesson) in of_light {
                let is_sound = lesson.samples >= 0.0 && lesson.count >= 0.0 && lesson.moment >= 0.0;
                assert!(is_sound, "sums are not negative: {lesson:?}");
                light.samples += f64::from(lesson.samples);
                light.count += f64::from(lesson.count);
                light.moment += f64::from(lesson.moment);
            }
            let root = sum.root + light.root_of_all();
            sum = Sum {
                samples: sum.samples + light.samples,
                count: sum.count + light.count,
                moment: sum.moment + light.moment,
                root,
            };
            places.push(of_light[0].0);
            sums.push(sum);
        }
        Self { places, sums }
    }

    /// Of all lights.
    fn all(&self) -> Sum {
        self.sums[self.places.len()]
    }

    /// Of the lights at some places.
    fn of(&self, places: Range<u32>) -> Sum {
        let before = |end: u32| self.sums[self.places.partition_point(|&place| place < end)];
        let (a, b) = (before(places.start), before(places.end));
        Sum {
            samples: b.samples - a.samples,
            count: b.count - a.count,
            moment: b.moment - a.moment,
            root: b.root - a.root,
        }
    }
}
