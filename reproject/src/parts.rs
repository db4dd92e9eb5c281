//! The four parts of the hemisphere that the paper tells apart (section 3): what stayed, what moved, what came from
//! behind something, and what opened.

use radcache::Record;

use crate::Workspace;
use crate::kernel::NOBODY;
use crate::samples::Plane;
use crate::verify::texel_at;

/// What became of the hemisphere on the way from a record to a point, as shares weighted by the cosine. Together they
/// are 1, less what lies below the surface of the point.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Parts {
    /// The background that remained: seen in the same direction by the record, in the same element.
    pub unchanged: f32,
    /// What the record saw in another direction, before all else that it knows here: objects that moved, and surfaces
    /// that slid along themselves.
    pub moved: f32,
    /// The background that was closed: what the record saw in another direction, while something nearer that is gone
    /// from here stood before it.
    pub bared: f32,
    /// What nobody has seen: all holes.
    pub opened: f32,
}

impl Workspace {
    /// Tells the parts of the hemisphere apart, texel by texel.
    ///
    /// A thing at a distance d from the record is at most d + |p| away from a point at p: what fills a texel farther
    /// than that was behind what the record saw there.
    ///
    /// # Panics
    /// If `record` is not the one that was projected last, as far as place, frame and number of elements tell.
    ///
    /// # Example
    /// ```
    /// use glam::{Vec3, Vec3A};
    /// use radcache::{Record, RecordSettings, Samples, Validity};
    /// use reproject::{Settings, Workspace};
    ///
    /// // A lamp 1 m away under a ceiling at 2 m.
    /// let lamp = |wi: Vec3A| wi.z > 0.9;
    /// let samples = Samples::from_fn(32, |wi| (Vec3::ONE, if lamp(wi) { 1.0 } else { 2.0 } / wi.z, Vec3A::NEG_Z));
    /// let frame = hemimap::Frame::from_normal(Vec3A::Z);
    /// let record = Record::new(Vec3A::ZERO, frame, samples, &RecordSettings::default(), &Validity::default());
    /// let mut workspace = Workspace::new();
    ///
    /// workspace.project(&record, Vec3A::ZERO, Vec3A::Z, &Settings::default());
    /// assert_eq!(workspace.parts(&record).unchanged, 1.0);
    ///
    /// workspace.project(&record, Vec3A::X * 0.2, Vec3A::Z, &Settings::default());
    /// let parts = workspace.parts(&record);
    /// assert!(parts.moved > 0.0 && parts.bared > 0.0 && parts.opened > 0.0);
    /// ```
    ///
    /// # Source
    /// The paper, sections 3 and 8. It names the parts and no rule: that of distances is ours.
    #[must_use]
    pub fn parts(&mut self, record: &Record) -> Parts {
        /// The planes of elements keep to a tenth of what rays found.
        const EXACT: f32 = 0.9;
        self.assert_projected(record);
        self.find_owners();
        let (n, step) = (self.n, self.offset.length());
        let (elements, samples) = (record.elements(), record.samples());
        let centres = self.centres.of(n);
        let is_turned = self.frame.n != record.frame().n;
        self.planes.clear();
        self.planes.resize(elements.len(), None);
        let mut counts = [0u32; 4];
        for (texel, &owner) in self.owners.iter().enumerate() {
            let e = usize::from(owner);
            if owner == NOBODY {
                counts[3] += u32::from(self.masks.holes(texel / n) >> (texel % n) & 1 == 1);
                continue;
            }
            let wi = centres.direction(texel);
            // The texel through which the record looked that way; what lies below its horizon it has seen from the side
            // alone.
            let seen_before = if is_turned {
                let wi = self.rotation.transpose() * wi;
                (wi.z > 0.0).then(|| texel_at(hemimap::cosine_hemisphere_to_square(wi), n))
            } else {
                Some(texel)
            };
            let kind = match seen_before {
                Some(before) if elements.covers(e, [before % n, before / n]) => 0,
                Some(before) => {
                    let plane =
                        self.planes[e].get_or_insert_with(|| Plane::of(elements, e, self.offset, &self.rotation));
                    let now = if elements.finite[e] == 0.0 { f32::INFINITY } else { plane.distance(wi) };
                    1 + usize::from(EXACT * now > samples.distance[before] + step)
                }
                None => 1,
            };
            counts[kind] += 1;
        }
        let [unchanged, moved, bared, opened] = counts.map(|count| count as f32 / (n * n) as f32);
        Parts { unchanged, moved, bared, opened }
    }
}
