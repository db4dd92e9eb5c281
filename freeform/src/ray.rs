//! Rays and what a solid does to them.

use glam::DVec3;

/// A ray `origin + t direction` for `t_min <= t <= t_max`.
///
/// The direction need not be unit; `t` is counted in its length. The ends may be infinite: `Ray::line` is the whole
/// line. A ray with a zero or non-finite direction or origin meets nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Point at `t = 0`.
    pub origin: DVec3,
    /// Direction, of any length but zero.
    pub direction: DVec3,
    /// Start of the ray.
    pub t_min: f64,
    /// End of the ray.
    pub t_max: f64,
}

impl Ray {
    /// Returns the half line `t >= 0`.
    pub fn new(origin: DVec3, direction: DVec3) -> Self {
        Self { origin, direction, t_min: 0.0, t_max: f64::INFINITY }
    }

    /// Returns the whole line, `t` from minus to plus infinity.
    pub fn line(origin: DVec3, direction: DVec3) -> Self {
        Self { origin, direction, t_min: f64::NEG_INFINITY, t_max: f64::INFINITY }
    }

    /// Returns the part of the ray between two parameters.
    pub fn between(self, t_min: f64, t_max: f64) -> Self {
        Self { t_min, t_max, ..self }
    }

    /// Returns the point at `t`.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + t * self.direction
    }

    /// Says whether there is anything to trace.
    pub(crate) fn is_sound(&self) -> bool {
        self.origin.is_finite()
            && self.direction.is_finite()
            && self.direction != DVec3::ZERO
            && self.t_min < self.t_max
    }
}

/// A place where a ray passes through the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Ray parameter.
    pub t: f64,
    /// Whether the ray is inside beyond it.
    pub entering: bool,
    /// Which part of the solid was crossed: a free form or a blend of several, counted in the order of the description;
    /// 0 in a single form.
    pub part: u32,
}
