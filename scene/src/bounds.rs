//! Axis-aligned boxes.

use glam::{DVec3, Vec3};

/// An axis-aligned box, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aabb {
    /// The lowest corner.
    pub min: Vec3,
    /// The highest corner.
    pub max: Vec3,
}

impl Aabb {
    /// The box that holds nothing: whatever it is united with stays as it is.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// Returns the smallest box that holds both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Returns the smallest box that holds the points.
    #[must_use]
    pub fn of_points(points: &[Vec3]) -> Self {
        points.iter().fold(Self::EMPTY, |bounds, &p| Self { min: bounds.min.min(p), max: bounds.max.max(p) })
    }

    /// Returns a box of `f32` that holds the box of `f64` between the two corners.
    pub(crate) fn around(min: DVec3, max: DVec3) -> Self {
        let down = |x: f64| {
            let y = narrow(x);
            if f64::from(y) > x { y.next_down() } else { y }
        };
        let up = |x: f64| {
            let y = narrow(x);
            if f64::from(y) < x { y.next_up() } else { y }
        };
        Self { min: Vec3::new(down(min.x), down(min.y), down(min.z)), max: Vec3::new(up(max.x), up(max.y), up(max.z)) }
    }

    /// Whether the box holds nothing.
    #[must_use]
    pub fn is_empty(self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// Returns the middle; the origin for an empty box.
    #[must_use]
    pub fn centre(self) -> Vec3 {
        if self.is_empty() { Vec3::ZERO } else { self.min + 0.5 * (self.max - self.min) }
    }

    /// Returns half the diagonal: the radius of the sphere around the box; 0 for an empty box.
    #[must_use]
    pub fn radius(self) -> f32 {
        if self.is_empty() { 0.0 } else { 0.5 * (self.max - self.min).length() }
    }
}

/// Rounds to the nearest f32.
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "rounds to the nearest f32")]
pub(crate) fn narrow(x: f64) -> f32 {
    x as f32
}
