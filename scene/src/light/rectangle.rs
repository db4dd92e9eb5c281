//! A rectangle that shines from its front: two triangles of a lamp, sampled as one light.
//!
//! Directions are uniform per solid angle where it is near, points uniform per area where it is far or seen edge on; which of
//! them depends on the point alone, so that the density is known for any direction. As one light, neighbouring numbers give neighbouring
//! directions over the whole lamp, so that stratified numbers serve it better than two triangles.
//!
//! # Source
//! Ureña, Fajardo, King 2013: An Area-Preserving Parametrization for Spherical Rectangles.

use std::f32::consts::PI;
use std::f64::consts::TAU;

use glam::{DVec2, Vec2, Vec3, Vec3A};

use super::triangle::{TriangleLight, leave};
use super::{Emission, LightSample, pdf_by_area};
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
    /// Radiance, W m^-2 sr^-1.
    radiance: Vec3,
    /// The first of its two triangles among the scene's primitives; the second one follows it.
    pub(super) primitive: u32,
}

/// The rectangle is far if its centre is at least so many diagonals away, by squares: distances then differ by a sixth at most.
const FAR_SQ: f32 = 9.0;

/// Slivers of a smaller solid angle are sampled by area: the sum of angles that gives it would lose its digits in f64.
const LEAST_SOLID_ANGLE: f64 = 1e-9;

/// Corners may be so many units in the last place of the largest coordinate off their rectangle.
const TOLERANCE: f32 = 4.0 * f32::EPSILON;

impl RectangleLight {
    /// Joins two triangles; `None` where they are no rectangle, or do not shine as one.
    pub(crate) fn join(first: &TriangleLight, second: &TriangleLight) -> Option<Self> {
        let is_alike = first.primitive + 1 == second.primitive
            && first.radiance == second.radiance
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
            radiance: first.radiance,
            primitive: first.primitive,
        })
    }

    fn area(&self) -> f32 {
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

    /// Returns the box around it.
    pub(super) fn bounds(&self) -> Aabb {
        Aabb::of_points(&[Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE].map(|u| Vec3::from(self.point(u))))
    }

    /// Returns the point at a share of each edge.
    #[inline]
    fn point(&self, u: Vec2) -> Vec3A {
        let along = u * self.lengths;
        self.corner + self.axes[0] * along.x + self.axes[1] * along.y
    }

    /// Returns the rectangle as `p` sees it; `None` from behind.
    #[inline]
    pub(super) fn seen_from(&self, p: Vec3A) -> Option<SeenRectangle<'_>> {
        (self.normal.dot(self.corner - p) < 0.0).then(|| SeenRectangle { light: self, p, near: self.near(p) })
    }

    /// Returns the density of a direction in which a ray from `p` met this rectangle at `surface`, per steradian.
    #[inline]
    pub(super) fn pdf(&self, p: Vec3A, wi: Vec3A, surface: &Surface) -> f32 {
        let by_area = || self.pdf_by_area(wi, surface.p.distance_squared(p));
        self.near(p).map_or_else(by_area, |near| near.pdf())
    }

    fn pdf_by_area(&self, wi: Vec3A, distance_sq: f32) -> f32 {
        pdf_by_area(-self.normal.dot(wi), self.area(), distance_sq)
    }

    pub(super) fn emit(&self, u_position: Vec2, u_direction: Vec2) -> Emission {
        let Aabb { min, max } = self.bounds();
        let largest = min.abs().max(max.abs()).into();
        leave(self.point(u_position), self.normal, largest, u_direction, self.flux())
    }

    /// Returns the rectangle as seen from `p` where it is to be sampled by solid angle.
    #[inline]
    fn near(&self, p: Vec3A) -> Option<SphericalRectangle> {
        let offset = self.corner - p;
        let centre = offset + (self.axes[0] * self.lengths.x + self.axes[1] * self.lengths.y) * 0.5;
        if centre.length_squared() >= FAR_SQ * self.lengths.length_squared() {
            return None;
        }
        let low = Vec2::new(offset.dot(self.axes[0]), offset.dot(self.axes[1]));
        SphericalRectangle::new(low, low + self.lengths, -offset.dot(self.normal))
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
    /// Returns a direction to it.
    #[inline]
    pub(super) fn sample(&self, u: Vec2, probability: f32) -> Option<LightSample> {
        let Self { light, p, near } = self;
        let offset =
            near.as_ref().map_or_else(|| light.point(u) - *p, |near| near.sample(u, &light.axes, light.normal));
        let distance_sq = offset.length_squared();
        let distance = distance_sq.sqrt();
        let wi = offset / distance;
        let pdf = near.as_ref().map_or_else(|| light.pdf_by_area(wi, distance_sq), |near| near.pdf()) * probability;
        LightSample::of_surface(wi, distance, light.radiance, pdf)
    }
}

/// A rectangle seen from the origin of a frame whose x and y are its edges; it lies at z = -`height`.
#[derive(Debug)]
struct SphericalRectangle {
    low: DVec2,
    high: DVec2,
    height: f64,
    /// z of the normals of the planes through the origin and the edges at `low.y` and `high.y`.
    normals: [f64; 2],
    /// 2 pi less the two angles at `low.x`.
    rest: f64,
    solid_angle: f64,
}

impl SphericalRectangle {
    #[inline]
    fn new(low: Vec2, high: Vec2, height: f32) -> Option<Self> {
        let (low, high, height) = (low.as_dvec2(), high.as_dvec2(), f64::from(height));
        let across = |x: f64| x / (x * x + height * height).sqrt();
        let z = [-across(low.y), across(high.x), across(high.y), -across(low.x)];
        let angle = |i: usize| (-z[i] * z[(i + 1) % 4]).clamp(-1.0, 1.0).acos();
        let angles = [angle(0), angle(1), angle(2), angle(3)];
        let rest = TAU - angles[2] - angles[3];
        let solid_angle = angles[0] + angles[1] - rest;
        let normals = [z[0], z[2]];
        (solid_angle > LEAST_SOLID_ANGLE).then_some(Self { low, high, height, normals, rest, solid_angle })
    }

    /// Returns the density of a direction, per steradian.
    #[inline]
    #[expect(clippy::cast_possible_truncation, reason = "rounds to the nearest f32")]
    fn pdf(&self) -> f32 {
        (1.0 / self.solid_angle) as f32
    }

    /// Returns a vector to the rectangle whose direction is uniform per solid angle.
    #[inline]
    fn sample(&self, u: Vec2, axes: &[Vec3A; 2], normal: Vec3A) -> Vec3A {
        // A plane x = const cuts off the share u.x of the solid angle.
        let (sine, cosine) = (f64::from(u.x) * self.solid_angle + self.rest).sin_cos();
        let f = (cosine * self.normals[0] - self.normals[1]) / sine;
        let share = (f * f + self.normals[0] * self.normals[0]).sqrt().recip().copysign(f).clamp(-1.0, 1.0);
        let x = share * self.height / ((1.0 - share) * (1.0 + share)).sqrt();
        let x = if x.is_finite() { x.clamp(self.low.x, self.high.x) } else { self.high.x };
        // Along it, the height on the sphere is uniform.
        let depth_sq = x * x + self.height * self.height;
        let along = |y: f64| y / (depth_sq + y * y).sqrt();
        let (from, to) = (along(self.low.y), along(self.high.y));
        let s = from + f64::from(u.y) * (to - from);
        let y = (s * depth_sq.sqrt() / ((1.0 - s) * (1.0 + s)).sqrt()).clamp(self.low.y, self.high.y);
        let place = DVec2::new(x, y).as_vec2();
        #[expect(clippy::cast_possible_truncation, reason = "rounds to the nearest f32")]
        let height = self.height as f32;
        axes[0] * place.x + axes[1] * place.y - normal * height
    }
}
