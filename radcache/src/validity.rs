//! How far a record reaches, and when it must not be used at all.

use glam::Vec3A;

use crate::{Record, Samples};

/// Rules for the reach of records. Lengths are metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Validity {
    /// Reach as a share of the harmonic mean distance (Ward, Rubinstein, Clear 1988).
    pub spacing: f32,
    /// Smallest reach that is of use, such as a part of a pixel: a record that would reach less, in a crease or a
    /// corner, reaches nobody. Stretching it instead lets it reach across things that are smaller than that, and light
    /// leaks into the crease.
    pub min_radius: f32,
    /// Largest reach. What sees nothing but the sky reaches so far, and nobody where this is infinite.
    pub max_radius: f32,
    /// Smallest cosine between the normals of record and point.
    pub min_normal_cos: f32,
    /// Texels nearer than this count as touching; 0 where none does.
    pub touching_distance: f32,
    /// Records with more than this share of touching texels start outside the geometry or in a seam and are refused;
    /// others reach no farther than the nearest of them.
    pub max_touching_share: f32,
}

impl Default for Validity {
    /// Spacing 0.3, normals within 26 degrees; no radius is too small or too large, and nothing touches. Good for a room
    /// alone: a renderer that has a sky or wide spaces starts from [`Self::for_scene`].
    fn default() -> Self {
        Self {
            spacing: 0.3,
            min_radius: 0.0,
            max_radius: f32::INFINITY,
            min_normal_cos: 0.9,
            touching_distance: 0.0,
            max_touching_share: 0.02,
        }
    }
}

impl Validity {
    /// Rules for a scene whose bounding box has a diagonal of `size` metres: as [`Self::default`], but reaches between a
    /// thousandth and a tenth of it, and 2 % of the texels may be nearer than 1e-5 of it.
    ///
    /// Without a largest reach, a record that sees hardly anything near would serve the floor under the roof on which it
    /// lies; without a smallest one, records in creases would take memory and serve nobody.
    ///
    /// # Panics
    /// If `size` is not a finite number above 0: of an endless ground, give the size of what is looked at.
    ///
    /// # Examples
    /// ```
    /// use radcache::glam::{Vec3, Vec3A};
    /// use radcache::{Samples, Validity};
    ///
    /// let sky = Samples::from_fn(8, |wi| (Vec3::ONE, f32::INFINITY, -wi));
    /// assert_eq!(Validity::for_scene(20.0).radius(&sky), 2.0);
    /// assert_eq!(Validity::default().radius(&sky), 0.0);
    /// ```
    #[must_use]
    pub fn for_scene(size: f32) -> Self {
        assert!(size > 0.0 && size.is_finite(), "a scene has a finite size above 0");
        let (min_radius, max_radius, touching_distance) = (1e-3 * size, 0.1 * size, 1e-5 * size);
        Self { min_radius, max_radius, touching_distance, ..Self::default() }
    }

    /// The reach of a record with these samples: 0 for one that must not serve anybody.
    ///
    /// It never exceeds the distance to the nearest hit, so that it cannot reach through a wall.
    #[must_use]
    pub fn radius(&self, samples: &Samples) -> f32 {
        // No share of an infinite distance is none of it, too.
        if self.spacing <= 0.0 || self.refuses(samples) {
            return 0.0;
        }
        /// Below 1, because the rays of the texels nearest to the horizon still rise a little above the tangent plane.
        const NEAREST_SHARE: f32 = 0.9;
        let nearest = NEAREST_SHARE * samples.nearest_distance();
        let reach = (self.spacing * samples.harmonic_distance()).min(nearest);
        let reach = if reach < self.min_radius { 0.0 } else { reach.min(self.max_radius) };
        // How far a sky is the same, no distance tells.
        if reach.is_finite() { reach } else { 0.0 }
    }

    /// Whether the samples started outside the geometry: too many rays ended at once.
    #[must_use]
    pub fn refuses(&self, samples: &Samples) -> bool {
        samples.share_nearer_than(self.touching_distance) > self.max_touching_share
    }

    /// How ill a record fits a point with unit normal `n`: 0 at the record itself, above 1 where it must not be used.
    #[must_use]
    pub fn misfit(&self, record: &Record, p: Vec3A, n: Vec3A) -> f32 {
        let cos = n.dot(record.frame().n);
        let d = p - record.centre();
        // Points above the tangent plane see past the horizon of the record, so height counts double; what lies below
        // it may be in the way of points that do so too, and nothing is known of it, so depth counts four times.
        let height = d.dot(record.frame().n);
        let weight = if height > 0.0 { 3.0 } else { 15.0 };
        let distance = (d.length_squared() + weight * height * height).sqrt();
        if cos.is_nan() || cos < self.min_normal_cos || record.radius() <= 0.0 {
            return f32::INFINITY;
        }
        // Where only equal normals may serve, their own term is not 0 / 0.
        let turn = (1.0 - cos) / (1.0 - self.min_normal_cos).max(f32::EPSILON);
        distance / record.radius() + 0.5 * turn.max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn radius_follows_the_geometry() {
        let ceiling = Samples::from_fn(16, |wi| (Vec3::ONE, 2.0 / wi.z, Vec3A::NEG_Z));
        let rules = Validity::default();
        assert!((rules.radius(&ceiling) - 0.9).abs() < 0.02, "0.3 times 1.5 times the height");
        let capped = Validity { max_radius: 0.5, ..rules };
        assert_eq!(capped.radius(&ceiling), 0.5, "capped");
        let sky = Samples::from_fn(16, |wi| (Vec3::ONE, f32::INFINITY, -wi));
        assert_eq!(capped.radius(&sky), 0.5, "an open sky reaches the cap");
        assert_eq!(Validity { spacing: 0.0, ..capped }.radius(&sky), 0.0, "but not without spacing");
        assert_eq!(rules.radius(&sky), 0.0, "nor without a cap");
    }

    #[test]
    fn a_normal_that_is_none_fits_nothing() {
        let samples = Samples::from_fn(8, |wi| (Vec3::ONE, 2.0 / wi.z, Vec3A::NEG_Z));
        let (frame, rules) = (hemimap::Frame::from_normal(Vec3A::Z), Validity::default());
        let record = Record::new(Vec3A::ZERO, frame, samples, &crate::RecordSettings::default(), &rules);
        assert_eq!(rules.misfit(&record, Vec3A::ZERO, Vec3A::Z), 0.0, "its own place");
        assert_eq!(rules.misfit(&record, Vec3A::ZERO, Vec3A::NAN), f32::INFINITY);
    }

    #[test]
    fn a_record_beside_a_wall_does_not_reach_through_it() {
        let wall = Samples::from_fn(32, |wi| (Vec3::ONE, if wi.x > 0.0 { 0.1 / wi.x } else { 50.0 }, Vec3A::NEG_X));
        let radius = Validity { spacing: 2.0, ..Validity::default() }.radius(&wall);
        assert!(radius <= 0.1, "{radius}");
    }

    #[test]
    fn a_record_in_a_crease_reaches_nobody() {
        let crease = Samples::from_fn(16, |wi| (Vec3::ONE, if wi.x > 0.0 { 0.01 / wi.x } else { 5.0 }, Vec3A::NEG_X));
        let rules = Validity { min_radius: 0.02, ..Validity::default() };
        assert_eq!(rules.radius(&crease), 0.0, "less than is of use");
        assert!(Validity { min_radius: 0.005, ..rules }.radius(&crease) > 0.0, "a finer picture has use for it");
    }

    #[test]
    fn records_that_start_outside_are_refused() {
        let seam = Samples::from_fn(16, |wi| (Vec3::ONE, if wi.x > 0.0 { 1e-7 } else { 5.0 }, -wi));
        let rules = Validity { touching_distance: 1e-5, min_radius: 0.2, ..Validity::default() };
        assert_eq!(rules.radius(&seam), 0.0, "refused");
    }
}
