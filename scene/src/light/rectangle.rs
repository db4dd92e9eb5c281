//! A rectangle that shines from its front: two triangles of a lamp, sampled as one light.
//!
//! Directions are uniform per solid angle where it is near, points uniform per area where it is far or seen edge on;
//! which of them depends on the point alone, so that the density is known for any direction. As one light, neighbouring
//! numbers give neighbouring directions over the whole lamp, so that stratified numbers serve it better than two
//! triangles.

use std::f32::consts::PI;

use glam::{Vec2, Vec3, Vec3A};

use super::polygon;
use super::spherical_rectangle::SphericalRectangle;
use super::target::Target;
use super::triangle::{TriangleLight, leave};
use super::{Emission, LightSample, is_over_horizon, narrow, pdf_by_area};
use crate::{Aabb, Surface};

/// An emissive rectangle.
#[derive(Debug, Clone)]
pub(crate) struct RectangleLight {
    corner: Vec3A,
    /// Unit vectors along the two edges that leave the corner.
    axes: [Vec3A; 2],
    /// Lengths of these edges.
    lengths: Vec2,
    /// Unit normal of the front.
    normal: Vec3A,
    /// Points are seen from so far in front, as with triangles, metres.
    clearance: f32,
    /// Radiance, W m^-2 sr^-1.
    radiance: Vec3,
    /// The first of its two triangles among the scene's primitives; the second one follows it.
    pub(super) primitive: u32,
}

/// The rectangle is far if the squares of its distances differ by at most this factor. By area, the density per solid
/// angle is as the cube of the distance; by solid angle there is a little less noise, for a fifth more time of direct
/// light in a scene that is mostly lit by it.
const FAR_RATIO_SQ: f32 = 4.0;

/// Slivers of a smaller solid angle are sampled by area: the angle of the product that gives it would lose its digits
/// in f64.
const LEAST_SOLID_ANGLE: f64 = 1e-9;

/// Corners may be so many units in the last place of the largest coordinate off their rectangle.
const TOLERANCE: f32 = 4.0 * f32::EPSILON;

impl RectangleLight {
    /// Joins two triangles; `None` where they are no rectangle, or do not shine as one.
    pub(crate) fn join(first: &TriangleLight, second: &TriangleLight) -> Option<Self> {
        let is_alike = first.primitive + 1 == second.primitive
            && first.radiance == second.radiance
            && first.pattern.is_none()
            && second.pattern.is_none()
            && first.normal.dot(second.normal) > 0.0;
        if !is_alike {
            return None;
        }
        // The corners that each has for itself face each other; the shared ones lie between.
        let own = |a: &TriangleLight, b: &TriangleLight| {
            let mut own = (0..3).filter(|&i| !b.corners.contains(&a.corners[i]));
            let only = own.next();
            only.filter(|_| own.next().is_none())
        };
        let (i, j) = (own(first, second)?, own(second, first)?);
        let [corner, b, d] = [0, 1, 2].map(|k| first.corners[(i + k) % 3]);
        let c = second.corners[j];
        let (x, y) = (b - corner, d - corner);
        let lengths = Vec2::new(x.length(), y.length());
        let tolerance = TOLERANCE * [corner, b, c, d].into_iter().fold(Vec3::ZERO, |m, p| m.max(p.abs())).max_element();
        let is_flat = (corner + x + y).distance(c) <= tolerance;
        let is_right = x.dot(y).abs() <= tolerance * lengths.element_sum();
        (is_flat && is_right).then(|| Self {
            corner: corner.into(),
            axes: [Vec3A::from(x) / lengths.x, Vec3A::from(y) / lengths.y],
            lengths,
            normal: first.normal,
            clearance: first.clearance.max(second.clearance) + tolerance,
            radiance: first.radiance,
            primitive: first.primitive,
        })
    }

    pub(super) fn area(&self) -> f32 {
        self.lengths.element_product()
    }

    /// Returns the flux, W.
    pub(super) fn flux(&self) -> Vec3 {
        self.radiance * (PI * self.area())
    }

    /// Returns the unit normal of the front.
    pub(super) fn normal(&self) -> Vec3A {
        self.normal
    }

    /// Returns the corners, counter-clockwise as seen from the front.
    pub(super) fn corners(&self) -> [Vec3A; 4] {
        let mut corners = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y].map(|u| self.point(u));
        if self.axes[0].cross(self.axes[1]).dot(self.normal) < 0.0 {
            corners.reverse();
        }
        corners
    }

    /// Returns the box around it.
    pub(super) fn bounds(&self) -> Aabb {
        Aabb::of_points(&self.corners().map(Vec3::from))
    }

    /// Returns the point at a share of each edge.
    #[inline]
    pub(super) fn point(&self, u: Vec2) -> Vec3A {
        let along = u * self.lengths;
        self.corner + self.axes[0] * along.x + self.axes[1] * along.y
    }

    /// Returns the rectangle as `p` sees it; `None` from behind.
    #[inline]
    pub(super) fn seen_from(&self, p: Vec3A) -> Option<SeenRectangle<'_>> {
        self.is_seen_from(p).then(|| SeenRectangle { light: self, p, near: self.near(p) })
    }

    #[inline]
    fn is_seen_from(&self, p: Vec3A) -> bool {
        self.normal.dot(p - self.corner) > self.clearance
    }

    /// Returns the irradiance of a surface at `p` with normal `n` where nothing hides any of the lamp, W m^-2; `None` if
    /// that is not above the horizon as a whole or too small, and from behind.
    #[inline]
    pub(super) fn irradiance(&self, p: Vec3A, n: Vec3A) -> Option<Vec3> {
        if !self.is_seen_from(p) {
            return None;
        }
        let corner = self.corner.as_dvec3() - p.as_dvec3();
        let [x, y] = self.axes.map(Vec3A::as_dvec3);
        let (x, y) = (x * f64::from(self.lengths.x), y * f64::from(self.lengths.y));
        let irradiance = polygon::irradiance(n, [corner, corner + x, corner + x + y, corner + y])?;
        Some(self.radiance * irradiance)
    }

    /// Returns the density of a direction in which a ray from `p` met this rectangle at `surface`, per steradian.
    #[inline]
    pub(super) fn pdf(&self, p: Vec3A, wi: Vec3A, surface: &Surface) -> f32 {
        self.seen_from(p).map_or(0.0, |seen| seen.pdf(wi, surface.p.distance_squared(p)))
    }

    pub(super) fn emit(&self, target: &Target, u_sphere: f32, u_position: Vec2, u_direction: Vec2) -> Option<Emission> {
        let Aabb { min, max } = self.bounds();
        let largest = min.abs().max(max.abs()).into();
        leave(self.point(u_position), self.normal, largest, target, u_sphere, u_direction, self.flux())
    }

    /// Returns the rectangle as seen from `p` where it is to be sampled by solid angle.
    #[inline]
    fn near(&self, p: Vec3A) -> Option<SphericalRectangle> {
        let offset = self.corner - p;
        let low = Vec2::new(offset.dot(self.axes[0]), offset.dot(self.axes[1]));
        let high = low + self.lengths;
        let height = -offset.dot(self.normal);
        let height_sq = height * height;
        let nearest_sq = Vec2::ZERO.clamp(low, high).length_squared() + height_sq;
        let farthest_sq = low.abs().max(high.abs()).length_squared() + height_sq;
        if farthest_sq <= FAR_RATIO_SQ * nearest_sq {
            return None;
        }
        let near = SphericalRectangle::new(low.as_dvec2(), high.as_dvec2(), f64::from(height))?;
        (near.solid_angle > LEAST_SOLID_ANGLE).then_some(near)
    }

    /// Returns the vector from `p` to the point x, y of the rectangle's own frame, whose origin is the foot of `p`.
    #[inline]
    fn towards(&self, place: Vec2, p: Vec3A) -> Vec3A {
        self.axes[0] * place.x + self.axes[1] * place.y + self.normal * self.normal.dot(self.corner - p)
    }
}

/// A rectangle and who sees it.
#[derive(Debug)]
pub(super) struct SeenRectangle<'a> {
    light: &'a RectangleLight,
    p: Vec3A,
    near: Option<SphericalRectangle>,
}

impl SeenRectangle<'_> {
    /// Returns a direction to it; `None` below the horizon of the normal `n`.
    #[inline]
    pub(super) fn sample(&self, n: Vec3A, u: Vec2, probability: f32) -> Option<LightSample> {
        let Self { light, p, near } = self;
        let offset = match near {
            Some(near) => light.towards(near.sample(f64::from(u.x), f64::from(u.y)).as_vec2(), *p),
            None => light.point(u) - *p,
        };
        let distance_sq = offset.length_squared();
        let distance = distance_sq.sqrt();
        let wi = offset / distance;
        if !is_over_horizon(n, wi) {
            return None;
        }
        LightSample::of_surface(wi, distance, light.radiance, self.pdf(wi, distance_sq) * probability)
    }

    /// Returns the density of a direction to it, per steradian.
    #[inline]
    fn pdf(&self, wi: Vec3A, distance_sq: f32) -> f32 {
        match &self.near {
            Some(near) => narrow(1.0 / near.solid_angle),
            None => pdf_by_area(-self.light.normal.dot(wi), self.light.area(), distance_sq),
        }
    }
}
