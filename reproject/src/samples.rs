//! What a point sees by a reprojection, as samples of its own.

use glam::{Mat3A, Vec2, Vec3, Vec3A};
use radcache::{Elements, Record, Samples};

use crate::Workspace;
use crate::kernel::NOBODY;
use crate::workspace::radiance;

/// The plane of an element as seen from the point, in the frame of the point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plane {
    /// Unit normal, turned to the point.
    normal: Vec3A,
    /// What the middle of the element has along the normal, and its distance.
    height: f32,
    far: f32,
}

impl Plane {
    /// The plane of element `e` for a point at `offset` from the record, whose frame `rotation` turns to that of the
    /// point.
    pub(crate) fn of(elements: &Elements, e: usize, offset: Vec3A, rotation: &Mat3A) -> Self {
        let [a, b, c, d] = std::array::from_fn(|k| elements.corner(e, k));
        let centre = (a + b + c + d) / 4.0 - offset;
        let normal = (c - a).cross(d - b).normalize_or(-centre.normalize_or(Vec3A::NEG_Z));
        let normal = if normal.dot(centre) > 0.0 { -normal } else { normal };
        Self { normal: *rotation * normal, height: normal.dot(centre), far: centre.length() }
    }

    /// Distance along a unit direction through the element. Where a grazing plane would be met far from the element, as
    /// its outline covers no more of the texel than the centre, the distance of its middle.
    pub(crate) fn distance(&self, wi: Vec3A) -> f32 {
        /// Times the distance of the middle.
        const RANGE: [f32; 2] = [0.5, 2.0];
        let distance = self.height / self.normal.dot(wi);
        let inside = distance >= RANGE[0] * self.far && distance <= RANGE[1] * self.far;
        if inside { distance } else { self.far }
    }
}

impl Workspace {
    /// Writes what the point sees, in the frame that [`Self::frame`] gives: as if its own rays had gone through the
    /// centres of all texels. Elements lie on the planes through their corners; all texels of a hole take what its ray
    /// met, and those below the surface (see [`Self::project_above`]) are black and infinitely far. To be called after
    /// [`Self::trace_holes`].
    ///
    /// The mean of these samples counts texels; [`Self::mean_radiance`] knows the areas of elements and is more exact.
    ///
    /// # Panics
    /// If `record` is not the one that was projected last, as far as place, frame and number of elements tell.
    pub fn samples(&mut self, record: &Record, samples: &mut Samples) {
        self.assert_projected(record);
        let n = self.n;
        if samples.resolution() != n {
            *samples = Samples::new(n);
        }
        // What samples of the same size held before.
        (0..n * n).for_each(|texel| samples.set_jitter(texel, Vec2::splat(0.5)));
        samples.view_dependent.fill(false);
        self.find_owners();
        let (elements, centres) = (record.elements(), self.centres.of(n));
        self.planes.clear();
        self.planes.resize(elements.len(), None);
        for (texel, &owner) in self.owners.iter().enumerate() {
            let e = usize::from(owner);
            if owner == NOBODY {
                samples.set(texel, Vec3::ZERO, f32::INFINITY, Vec3A::Z);
            } else if elements.finite[e] == 0.0 {
                samples.set(texel, radiance(elements, e), f32::INFINITY, Vec3A::Z);
                samples.background_share[texel] = elements.background_share[e];
            } else {
                let plane = self.planes[e].get_or_insert_with(|| Plane::of(elements, e, self.offset, &self.rotation));
                samples.set(texel, radiance(elements, e), plane.distance(centres.direction(texel)), plane.normal);
                samples.background_share[texel] = elements.background_share[e];
            }
        }
        for (hole, traced) in self.holes.iter().zip(&self.traced) {
            let normal = self.frame.to_local(traced.normal);
            hole.for_each_texel(n, &self.masks, |texel| samples.set(texel, traced.radiance, traced.distance, normal));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use radcache::{RecordSettings, Validity};

    proptest! {
        /// Under a slanting roof, from another place and turned.
        #[test]
        fn planes_are_met_where_they_are(
            e in 0usize..1000, offset in prop::array::uniform3(-0.3f32..0.3), angle in -1f32..1.0, along in prop::array::uniform3(-2f32..2.0),
        ) {
            let normal = Vec3A::new(0.36, -0.48, -0.8);
            let samples = Samples::from_fn(8, |wi| {
                let distance = normal.z / normal.dot(wi);
                (Vec3::ONE, if distance > 0.0 { distance.min(9.0) } else { 9.0 }, normal)
            });
            let frame = hemimap::Frame::from_normal(Vec3A::Z);
            let record = Record::new(Vec3A::ZERO, frame, samples, &RecordSettings::default(), &Validity::default());
            let elements = record.elements();
            let (e, offset, rotation) = (e % elements.len(), Vec3A::from(offset), Mat3A::from_rotation_y(angle));
            let plane = Plane::of(elements, e, offset, &rotation);
            let [a, b, c, d] = [0, 1, 2, 3].map(|k| elements.corner(e, k).as_dvec3());
            let centre = (a + b + c + d) / 4.0 - offset.as_dvec3();
            let expected = (c - a).cross(d - b).normalize();
            let expected = if expected.dot(centre) > 0.0 { -expected } else { expected };
            let turned = rotation.transpose() * plane.normal;
            prop_assert!(turned.as_dvec3().distance(expected) < 1e-4, "{} for {}", turned, expected);
            // A place on the plane, at some distance of the centre across.
            let across = Vec3A::from(along).as_dvec3();
            let place = centre + (across - expected * across.dot(expected)) * centre.length();
            let share = place.length() / centre.length();
            prop_assume!((share - 0.5).abs() > 1e-3 && (share - 2.0).abs() > 1e-3 && expected.dot(centre).abs() > 0.05);
            let found = plane.distance(rotation * place.normalize().as_vec3a());
            let distance = if (0.5..2.0).contains(&share) { place.length() } else { centre.length() };
            prop_assert!((f64::from(found) / distance - 1.0).abs() < 2e-3, "{} for {}", found, distance);
        }
    }
}
