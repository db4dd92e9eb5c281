//! Rays and what they hit.

use glam::{Vec2, Vec3A};

use crate::Media;

/// A half line in world space, valid for ray parameters in (`t_min`, `t_max`).
///
/// A ray whose direction is far from unit length (its square outside [0.5, 2], NaN included), or whose origin is not
/// finite, hits nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Where the ray starts, metres.
    pub origin: Vec3A,
    /// Unit direction.
    pub direction: Vec3A,
    /// Hits at or before this parameter do not count.
    pub t_min: f32,
    /// Hits at or beyond this parameter do not count.
    pub t_max: f32,
    /// The transparent bodies in which it starts.
    pub media: Media,
    /// Index of the triangle on which it starts and which it does not meet again, or [`Ray::NOWHERE`]. A free form may
    /// be met again.
    pub from: u32,
}

impl Ray {
    /// The ray starts on no triangle.
    pub const NOWHERE: u32 = u32::MAX;

    /// Returns the ray from `origin` along the unit vector `direction`, without an end and outside of transparent
    /// bodies.
    #[inline]
    #[must_use]
    pub fn new(origin: Vec3A, direction: Vec3A) -> Self {
        Self { origin, direction, t_min: 0.0, t_max: f32::INFINITY, media: Media::NONE, from: Self::NOWHERE }
    }

    /// Returns the point at parameter `t`.
    #[inline]
    #[must_use]
    pub fn at(&self, t: f32) -> Vec3A {
        self.origin + self.direction * t
    }

    /// Whether the ray can hit anything: finite, unit within a factor, and of a range that is not empty.
    #[inline]
    pub(crate) fn is_valid(&self) -> bool {
        let length_sq = self.direction.length_squared();
        (0.5..=2.0).contains(&length_sq) && self.origin.is_finite() && self.t_min < self.t_max
    }
}

/// The nearest thing on a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Ray parameter, metres for a unit direction.
    pub t: f32,
    /// Index of what was hit: the triangles of all meshes in their order, then the free forms.
    pub primitive: u32,
    /// Weights of the triangle's second and third corner. On a free form x is the number of the part that was hit.
    pub barycentrics: Vec2,
    /// The transparent bodies in which the ray arrives.
    pub media: Media,
}
