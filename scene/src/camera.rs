//! A pinhole camera.

use glam::{UVec2, Vec2, Vec3, Vec3A};

use crate::{Aabb, Ray};

/// A pinhole camera; the right of the picture is forward x up, film coordinates run right and down from the upper left
/// corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// The pinhole, metres.
    pub eye: Vec3,
    /// A point in the middle of the picture.
    pub at: Vec3,
    /// A direction that is upwards in the picture; need be neither unit nor at right angles to the view.
    pub up: Vec3,
    /// The whole vertical angle of view, degrees, in (0, 180).
    pub fov_y_degrees: f32,
}

/// Angle of view that nobody chose, degrees.
pub(crate) const DEFAULT_FOV: f32 = 40.0;

/// Below this sine between up and the view the sides of the picture would be rounding errors.
const LEAST_SINE: f32 = 1e-5;

/// Radii below it have no square in single precision.
const LEAST_RADIUS: f32 = 1e-15;

impl Camera {
    /// Returns the unit vector of the view; `None` where `eye` and `at` are the same point.
    pub(crate) fn forward(&self) -> Option<Vec3> {
        (self.at - self.eye).try_normalize()
    }

    /// Whether `up` is a direction that differs from `forward`.
    pub(crate) fn is_upright(&self, forward: Vec3) -> bool {
        self.up.try_normalize().is_some_and(|up| up.cross(forward).length() >= LEAST_SINE)
    }

    /// Returns a camera that sees all of `bounds`, from the front (+z), a little from above and from the right.
    #[must_use]
    pub fn framing(bounds: Aabb) -> Self {
        let centre = bounds.centre();
        // A view needs some distance, more than rounding takes from it far from the origin, also where there is nothing
        // or a point.
        let least = if bounds.radius() > 0.0 { LEAST_RADIUS } else { 1.0 };
        let radius = bounds.radius().max(least).max(1e-5 * centre.abs().max_element());
        let distance = radius / (0.5 * DEFAULT_FOV.to_radians()).sin();
        let towards = Vec3::new(0.35, 0.3, 1.0).normalize();
        Self { eye: centre + towards * distance, at: centre, up: Vec3::Y, fov_y_degrees: DEFAULT_FOV }
    }

    /// Returns the ray through a point of the film.
    ///
    /// `film` is in pixels from the upper left corner, y down; the middle of a pixel is at + 0.5. `size` is the
    /// picture's size in pixels, which are square.
    #[inline]
    #[must_use]
    pub fn ray(&self, film: Vec2, size: UVec2) -> Ray {
        View::new(self).ray(film, size)
    }

    /// Returns the angle of one pixel in the middle of the picture, radians (to first order: its width at distance 1).
    #[inline]
    #[must_use]
    pub fn pixel_angle(&self, size: UVec2) -> f32 {
        View::new(self).pixel_angle(size)
    }
}

/// What all rays of a camera have in common.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View {
    eye: Vec3A,
    /// Unit vectors.
    forward: Vec3A,
    right: Vec3A,
    up: Vec3A,
    /// The height of the picture at distance 1.
    height: f32,
}

impl View {
    #[inline]
    pub(crate) fn new(camera: &Camera) -> Self {
        let forward = Vec3A::from(camera.at - camera.eye).normalize();
        let right = forward.cross(camera.up.into()).normalize();
        let height = 2.0 * (0.5 * camera.fov_y_degrees.to_radians()).tan();
        Self { eye: camera.eye.into(), forward, right, up: right.cross(forward), height }
    }

    /// See [`Camera::ray`].
    #[inline]
    pub(crate) fn ray(&self, film: Vec2, size: UVec2) -> Ray {
        let plane = (film - 0.5 * size.as_vec2()) * self.pixel_angle(size);
        Ray::new(self.eye, (self.forward + self.right * plane.x - self.up * plane.y).normalize())
    }

    /// See [`Camera::pixel_angle`].
    #[inline]
    pub(crate) fn pixel_angle(&self, size: UVec2) -> f32 {
        self.height / size.as_vec2().y
    }
}
