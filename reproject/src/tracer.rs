//! The one thing that a renderer must bring: something that answers rays.

use glam::{Vec3, Vec3A};

/// What a ray met.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Traced {
    /// Incident radiance along the ray, W m^-2 sr^-1.
    pub radiance: Vec3,
    /// Distance to the hit in metres, infinite for the surroundings.
    pub distance: f32,
    /// Unit normal of what it hit, turned to the point, world space; any value where the distance is infinite.
    /// [`Workspace::samples`] alone asks for it.
    ///
    /// [`Workspace::samples`]: crate::Workspace::samples
    pub normal: Vec3A,
}

impl Default for Traced {
    /// A black sky.
    fn default() -> Self {
        Self { radiance: Vec3::ZERO, distance: f32::INFINITY, normal: Vec3A::Z }
    }
}

/// Traces rays from the point to which a record is reprojected. The reprojection never traces one itself.
pub trait Tracer {
    /// Answers each unit direction `wi`, in world space and away from the point, in `out` of the same length.
    fn trace(&mut self, wi: &[Vec3A], out: &mut [Traced]);

    /// As [`Self::trace`], but only the distances count, so that a renderer may leave out the light.
    fn probe(&mut self, wi: &[Vec3A], out: &mut [Traced]) {
        self.trace(wi, out);
    }
}
