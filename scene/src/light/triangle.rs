//! A triangle that shines from its front.
//!
//! Seen from near, directions are chosen uniformly per solid angle; from far, points uniformly per area, which is
//! cheaper and there as good: distance and cosine hardly vary. Which of them depends on the point alone, so that the
//! density is known for any direction.
//!
//! # Source
//! Arvo 1995: Stratified Sampling of Spherical Triangles. Van Oosterom, Strackee 1983: The Solid Angle of a Plane
//! Triangle.

use std::f32::consts::PI;

use glam::{DVec3, Vec2, Vec3, Vec3A, swizzles::Vec3Swizzles};

use super::pattern::Pattern;
use super::polygon;
use super::target::{Sphere, Target};
use super::{Emission, LightSample, is_over_horizon, narrow, pdf_by_area};
use crate::{Ray, Surface, surface};

/// An emissive triangle.
#[derive(Debug, Clone)]
pub(crate) struct TriangleLight {
    pub(super) corners: [Vec3; 3],
    /// Unit normal of the front.
    pub(super) normal: Vec3A,
    pub(super) area: f32,
    /// Points are seen from so far in front, metres: nearer ones may be rounded points of the plane itself, or of the
    /// back.
    pub(super) clearance: f32,
    /// Length of the longest edge, squared.
    size_sq: f32,
    /// Radiance, W m^-2 sr^-1; what it is multiplied by where there is a pattern.
    pub(super) radiance: Vec3,
    /// Its index among the scene's primitives.
    pub(super) primitive: u32,
    /// What differs from place to place.
    pub(super) pattern: Option<Box<TrianglePattern>>,
}

/// A pattern as it lies on a triangle.
#[derive(Debug, Clone)]
pub(super) struct TrianglePattern {
    pattern: Pattern,
    /// Texture coordinates of the corners.
    uvs: [Vec2; 3],
    /// About the mean factor.
    mean: Vec3,
}

/// A triangle is far if its squared distance is at least this many times its longest edge's square: distances then
/// differ by a tenth.
const FAR_SQ: f32 = 100.0;

/// Slivers of a smaller solid angle are sampled by area: Arvo's formula would lose its digits in f64.
const LEAST_SOLID_ANGLE: f64 = 1e-9;

/// Rounding of a point interpolated from corners, as in [`Surface::p_error`].
const POSITION_ERROR: f32 = 7.0 * f32::EPSILON;

impl TriangleLight {
    /// Makes a light; `None` where the triangle has no area or no radiance.
    pub(crate) fn new(corners: [Vec3; 3], radiance: Vec3, primitive: u32) -> Option<Self> {
        let [a, b, c] = corners.map(|p| p.as_dvec3());
        let area_normal = (b - a).cross(c - a);
        let normal = area_normal.try_normalize()?.as_vec3a();
        let area = 0.5 * area_normal.length();
        let size_sq = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
        let (area, size_sq) = (narrow(area), narrow(size_sq));
        let clearance = clearance(normal, largest(&corners));
        let light = Self { corners, normal, area, clearance, size_sq, radiance, primitive, pattern: None };
        (light.area > 0.0 && radiance.max_element() > 0.0).then_some(light)
    }

    /// Draws light and holes into it; `None` where nothing is left.
    pub(crate) fn with_pattern(self, pattern: Pattern, uvs: [Vec2; 3]) -> Option<Self> {
        let is_black = pattern.is_black_between(&uvs);
        (!is_black).then(|| Self { pattern: Some(Box::new(TrianglePattern::new(pattern, uvs))), ..self })
    }

    /// Returns the flux, W; with a pattern about that.
    pub(super) fn flux(&self) -> Vec3 {
        self.radiance * (PI * self.area) * self.pattern.as_ref().map_or(Vec3::ONE, |pattern| pattern.mean)
    }

    /// Returns the radiance of a point of it, which is given by the barycentrics of the second and the third corner,
    /// where it matters: of all rays that meet it there, some pass.
    #[inline]
    fn radiance_at(&self, barycentrics: impl FnOnce() -> Vec2) -> Vec3 {
        match &self.pattern {
            None => self.radiance,
            Some(it) => self.radiance * it.pattern.at(interpolated(it.uvs, barycentrics())),
        }
    }

    /// Returns the triangle as `p` sees it; `None` from behind.
    #[inline]
    pub(super) fn seen_from(&self, p: Vec3A) -> Option<SeenTriangle<'_>> {
        self.is_seen_from(p).then(|| SeenTriangle { light: self, p, near: self.near(p) })
    }

    #[inline]
    fn is_seen_from(&self, p: Vec3A) -> bool {
        self.normal.dot(p - Vec3A::from(self.corners[0])) > self.clearance
    }

    /// Returns the irradiance of a surface at `p` with normal `n` where nothing hides any of the lamp, W m^-2; `None` if
    /// that is not above the horizon as a whole or too small, from behind, and where there is a pattern.
    #[inline]
    pub(super) fn irradiance(&self, p: Vec3A, n: Vec3A) -> Option<Vec3> {
        if self.pattern.is_some() || !self.is_seen_from(p) {
            return None;
        }
        let irradiance = polygon::irradiance(n, self.corners.map(|corner| corner.as_dvec3() - p.as_dvec3()))?;
        Some(self.radiance * irradiance)
    }

    /// Returns the density of a direction in which a ray from `p` met this triangle at `surface`, per steradian.
    #[inline]
    pub(super) fn pdf(&self, p: Vec3A, wi: Vec3A, surface: &Surface) -> f32 {
        if !self.is_seen_from(p) {
            return 0.0;
        }
        match self.near(p) {
            Some(triangle) => narrow(1.0 / triangle.solid_angle),
            None => pdf_by_area(-self.normal.dot(wi), self.area, surface.p.distance_squared(p)),
        }
    }

    pub(super) fn emit(&self, target: &Target, u_sphere: f32, u_position: Vec2, u_direction: Vec2) -> Option<Emission> {
        let radiance = self.radiance_at(|| barycentrics(u_position));
        let p = self.point(u_position);
        leave(p, self.normal, largest(&self.corners), target, u_sphere, u_direction, radiance * (PI * self.area))
    }

    /// Returns a point that is uniform over the area.
    #[inline]
    fn point(&self, u: Vec2) -> Vec3A {
        let root = u.x.sqrt();
        let [a, b, c] = self.corners.map(Vec3A::from);
        a * (1.0 - root) + b * (root * (1.0 - u.y)) + c * (root * u.y)
    }

    /// Returns the triangle on the unit sphere around `p` where it is to be sampled by solid angle.
    #[inline]
    fn near(&self, p: Vec3A) -> Option<SphericalTriangle> {
        let [a, b, c] = self.corners.map(|corner| Vec3A::from(corner) - p);
        let distance_sq = a.length_squared().min(b.length_squared()).min(c.length_squared());
        if distance_sq >= FAR_SQ * self.size_sq {
            return None;
        }
        SphericalTriangle::new(self.corners.map(|corner| corner.as_dvec3() - p.as_dvec3()))
    }
}

impl TrianglePattern {
    fn new(pattern: Pattern, uvs: [Vec2; 3]) -> Self {
        /// Places along an edge.
        const SIDE: u16 = 16;
        let places = (0..SIDE)
            .flat_map(|i| (0..SIDE - i).map(move |j| (Vec2::new(i.into(), j.into()) + 1.0 / 3.0) / f32::from(SIDE)));
        let mean = pattern.mean(places.map(|place| interpolated(uvs, place)));
        Self { pattern, uvs, mean }
    }
}

/// Returns the barycentrics of the second and the third corner of a point that is uniform over the area, see
/// [`TriangleLight::point`].
fn barycentrics(u: Vec2) -> Vec2 {
    u.x.sqrt() * Vec2::new(1.0 - u.y, u.y)
}

/// Returns those of a point in the plane of the corners, or of one within the triangle near it.
fn barycentrics_of(p: DVec3, [a, b, c]: [DVec3; 3]) -> Vec2 {
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let area = |edge: DVec3, other: DVec3| edge.cross(other).dot(normal).max(0.0);
    let shares = DVec3::new(area(b - p, c - p), area(c - p, a - p), area(a - p, b - p));
    (shares / shares.element_sum().max(f64::MIN_POSITIVE)).yz().as_vec2()
}

/// Returns what has these values at the corners of a triangle at a point of it, given by the barycentrics of the second
/// and the third one.
fn interpolated([a, b, c]: [Vec2; 3], barycentrics: Vec2) -> Vec2 {
    a * (1.0 - barycentrics.element_sum()) + b * barycentrics.x + c * barycentrics.y
}

/// Returns the largest coordinates of points, by magnitude.
fn largest(points: &[Vec3]) -> Vec3A {
    points.iter().fold(Vec3::ZERO, |largest, p| largest.max(p.abs())).into()
}

/// Returns how far from the plane of a flat light, whose coordinates are at most `largest`, points may be that are
/// meant to lie in it.
fn clearance(normal: Vec3A, largest: Vec3A) -> f32 {
    // The point is rounded, and so is the way from it to the plane.
    2.0 * position_error(normal, largest)
}

/// Returns how far from a plane interpolated points of it may be where coordinates are at most `largest`.
fn position_error(normal: Vec3A, largest: Vec3A) -> f32 {
    largest.dot(normal.abs()) * POSITION_ERROR
}

/// Starts a photon of a flat light, whose coordinates are at most `largest`, at its point `p`: towards the target, or
/// in a direction of density cos(theta) / pi. The flux is what all photons carry that go anywhere.
pub(super) fn leave(
    p: Vec3A,
    normal: Vec3A,
    largest: Vec3A,
    target: &Target,
    u_sphere: f32,
    u_direction: Vec2,
    flux: Vec3,
) -> Option<Emission> {
    let origin = surface::offset(p, normal, position_error(normal, largest), normal);
    let (direction, share) = match target.cones(Sphere::point(origin), Some(normal.as_dvec3())) {
        None => {
            let frame = hemimap::Frame::from_normal(normal);
            (frame.to_world(hemimap::square_to_cosine_hemisphere(u_direction)), 1.0)
        }
        Some(cones) => {
            let (direction, share) = cones.direction(u_sphere, u_direction)?;
            // Of cos(theta) / pi and of 1 / 4 pi the former is so many times the latter.
            (direction, 4.0 * normal.dot(direction) * share)
        }
    };
    (share > 0.0).then(|| Emission { ray: Ray::new(origin, direction), flux: flux * share })
}

/// A triangle and who sees it.
#[derive(Debug)]
pub(super) struct SeenTriangle<'a> {
    light: &'a TriangleLight,
    p: Vec3A,
    near: Option<SphericalTriangle>,
}

impl SeenTriangle<'_> {
    /// Returns a direction to it; `None` below the horizon of the normal `n`.
    #[inline]
    pub(super) fn sample(&self, n: Vec3A, u: Vec2, probability: f32) -> Option<LightSample> {
        let Self { light, p, near } = self;
        match near {
            Some(triangle) => {
                let direction = triangle.sample(u);
                let wi = direction.as_vec3a();
                if !is_over_horizon(n, wi) {
                    return None;
                }
                let corners = light.corners.map(|corner| corner.as_dvec3());
                let ([a, b, c], p) = (corners, p.as_dvec3());
                let normal = (b - a).cross(c - a);
                let distance = normal.dot(a - p) / normal.dot(direction);
                let pdf = narrow(1.0 / triangle.solid_angle) * probability;
                let radiance = light.radiance_at(|| barycentrics_of(p + direction * distance, corners));
                LightSample::of_surface(wi, narrow(distance), radiance, pdf)
            }
            None => {
                let point = light.point(u);
                let offset = point - *p;
                let distance_sq = offset.length_squared();
                let distance = distance_sq.sqrt();
                let wi = offset / distance;
                if !is_over_horizon(n, wi) {
                    return None;
                }
                let pdf = pdf_by_area(-light.normal.dot(wi), light.area, distance_sq) * probability;
                LightSample::of_surface(wi, distance, light.radiance_at(|| barycentrics(u)), pdf)
            }
        }
    }
}

/// A triangle on the unit sphere.
#[derive(Debug)]
struct SphericalTriangle {
    /// Unit vectors.
    a: DVec3,
    b: DVec3,
    c: DVec3,
    /// a . (b x c), positive.
    volume: f64,
    solid_angle: f64,
}

impl SphericalTriangle {
    #[inline]
    fn new(corners: [DVec3; 3]) -> Option<Self> {
        let [a, b, c] = corners.map(|v| v.normalize_or_zero());
        let volume = a.dot(b.cross(c)).abs();
        let solid_angle = 2.0 * volume.atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a));
        (solid_angle > LEAST_SOLID_ANGLE).then_some(Self { a, b, c, volume, solid_angle })
    }

    /// Returns a direction that is uniform per solid angle.
    #[inline]
    fn sample(&self, u: Vec2) -> DVec3 {
        let Self { a, b, c, volume, solid_angle } = *self;
        // The corner's angle, whose sine and cosine need no trigonometry: the planes' normals are a x b and a x c.
        let (ab, ac) = (a.cross(b), a.cross(c));
        let lengths = ab.length() * ac.length();
        let (cosine, sine) = (ab.dot(ac) / lengths, volume / lengths);
        // A plane through b cuts off the share u.x of the area; it meets the arc from a to c at `foot`.
        let (sin_area, cos_area) = (f64::from(u.x) * solid_angle).sin_cos();
        let s = sin_area * cosine - cos_area * sine;
        let t = cos_area * cosine + sin_area * sine;
        let x = t - cosine;
        let y = s + sine * a.dot(b);
        let q = ((y * t - x * s) * cosine - y) / ((y * s + x * t) * sine);
        let q = if q.is_finite() { q.clamp(-1.0, 1.0) } else { 1.0 };
        let foot = a * q + across(c, a) * ((1.0 - q) * (1.0 + q)).sqrt();
        // Along the arc from b to it, the height is uniform.
        let z = 1.0 - f64::from(u.y) * (1.0 - foot.dot(b));
        b * z + across(foot, b) * ((1.0 - z) * (1.0 + z)).max(0.0).sqrt()
    }
}

/// Returns the unit vector in the plane of `v` and `axis` that is at right angles to the unit vector `axis`.
#[inline]
fn across(v: DVec3, axis: DVec3) -> DVec3 {
    (v - axis * v.dot(axis)).normalize_or_zero()
}
