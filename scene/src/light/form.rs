//! A free form that shines.
//!
//! A direction is chosen in the solid angle of an ellipsoid that is the form itself, else of the box around it, and the
//! form's own first crossing along it is the point of the light; directions that miss it count as 0. So what is sampled
//! is the form and no mesh of it, and the density is known for any direction.
//!
//! Photons start where random lines leave the form. The flux that leaves a surface of radiance L is L times the measure
//! of the lines that cross it outwards,
//!
//! ```text
//! flux = L (measure of lines through a sphere, 4 pi * pi R^2) (mean number of exits on such a line),
//! ```
//!
//! which is Cauchy's and Crofton's way to the area, too: flux = pi L area.

use std::f64::consts::PI;
use std::sync::Arc;

use freeform::{Crossing, Ray as LineRay, Solid};
use glam::{DAffine3, DMat3, DVec2, DVec3, Vec2, Vec3, Vec3A};

use super::areas::Areas;
use super::pattern::Pattern;
use super::region::Region;
use super::target::{Aimed, Sphere, Target};
use super::{Emission, LightSample, is_over_horizon, narrow};
use crate::body::Body;
use crate::mix::mixed;
use crate::projection::Projector;
use crate::{Aabb, Ray, surface};

/// An emissive free form.
#[derive(Debug, Clone)]
pub(crate) struct FormLight {
    pub(super) body: Body,
    region: Region,
    /// Around the form.
    pub(super) sphere: Sphere,
    /// m^2; of what is no ball right to about a hundredth.
    pub(super) area: f64,
    /// Radiance, W m^-2 sr^-1; of a form that is there in part, the mean; what it is multiplied by where there is a
    /// pattern.
    radiance: Vec3,
    /// Whether it is there in part, so that rays may see what is behind its front.
    is_pierced: bool,
    /// What differs from place to place.
    pattern: Option<Box<FormPattern>>,
    /// Its index among the scene's primitives.
    pub(super) primitive: u32,
}

/// A pattern as it lies on a free form.
#[derive(Debug, Clone)]
struct FormPattern {
    pattern: Pattern,
    projector: Option<Arc<Projector>>,
    /// About the mean factor.
    mean: Vec3,
}

/// Rounding of an f32 position, as a share of its coordinates: a light is looked for from a point so much above the
/// surface, or a form would find itself.
const POSITION_ERROR: f64 = 4.0 * f32::EPSILON as f64;

/// Rounding of the end of a shadow ray, as a share of its coordinates: of the point itself, and of the direction to it.
const END_ERROR: f64 = 2.0 * f32::EPSILON as f64;

/// Behind a crossing the search on a line goes on this share of the radius farther.
const STEP: f64 = 1e-9;

impl FormLight {
    /// Makes a light; `None` where the form has no bounds, no area or no radiance. `opacity` is the share of it that is
    /// there.
    pub(crate) fn new(body: &Body, emission: Vec3, opacity: f32, primitive: u32, areas: &mut Areas) -> Option<Self> {
        let (min, max) = body.bounds()?;
        let ellipsoid = ellipsoid(body.solid()).map(|to_unit| body.world_to_local().map_or(to_unit, |m| to_unit * *m));
        let ball = ellipsoid.and_then(|to_unit| ball_radius(to_unit.matrix3));
        let mut light = Self {
            body: body.clone(),
            region: ellipsoid.map_or(Region::Box { min, max }, Region::Ellipsoid),
            sphere: Sphere {
                centre: 0.5 * (min + max),
                // A little more than the ball, for what rounding takes.
                radius: ball.map_or(0.5 * (max - min).length(), |radius| radius * (1.0 + 1e-9)),
            },
            area: 0.0,
            radiance: emission * opacity,
            is_pierced: opacity < 1.0,
            pattern: None,
            primitive,
        };
        light.area = ball.map_or_else(|| areas.of(&light), |radius| 4.0 * PI * radius * radius);
        (light.area > 0.0 && light.area.is_finite() && light.radiance.max_element() > 0.0).then_some(light)
    }

    /// Draws light and holes into it, where `projector` lays the pictures.
    pub(crate) fn with_pattern(self, pattern: Pattern, projector: Option<Arc<Projector>>, areas: &mut Areas) -> Self {
        let is_pierced = self.is_pierced || pattern.has_holes();
        let mean = areas.mean_of(&self, &pattern, projector.as_deref());
        Self { is_pierced, pattern: Some(Box::new(FormPattern { pattern, projector, mean })), ..self }
    }

    /// Returns the flux, W; of what is no ball right to about a hundredth, with a pattern about that.
    pub(super) fn flux(&self) -> Vec3 {
        let mean = self.pattern.as_ref().map_or(Vec3::ONE, |it| it.mean);
        self.radiance * (std::f32::consts::PI * narrow(self.area)) * mean
    }

    /// Returns the radiance of the point where a line crosses the surface: of all rays that meet it there, some pass.
    #[inline]
    fn radiance_at(&self, line: &LineRay, t: f64, part: u32) -> Vec3 {
        match &self.pattern {
            None => self.radiance,
            Some(it) => self.radiance * it.pattern.at(self.texture_coordinates(it.projector.as_deref(), line, t, part)),
        }
    }

    fn texture_coordinates(&self, projector: Option<&Projector>, line: &LineRay, t: f64, part: u32) -> Vec2 {
        let local = self.body.local_point(line.at(t));
        let n = self.body.solid().normal_at(part, local, self.body.local_vector(line.direction));
        self.body.texture_coordinates(projector, local, n).as_vec2()
    }

    /// Returns a box around it.
    pub(super) fn bounds(&self) -> Aabb {
        let Sphere { centre, radius } = self.sphere;
        Aabb::around(centre - radius, centre + radius)
    }

    #[inline]
    pub(super) fn sample(&self, p: Vec3A, n: Vec3A, u: Vec2, probability: f32) -> Option<LightSample> {
        let (p, up) = (p.as_dvec3(), n.as_dvec3());
        let (wi, pdf) = self.region.sample(p, u)?;
        if up.dot(wi) <= 0.0 {
            return None;
        }
        let ray = LineRay::new(p + up * (p.abs().max_element() * POSITION_ERROR), wi);
        let (entry, count) = if self.is_pierced { self.any_entry(ray)? } else { (self.first_entry(&ray)?, 1.0) };
        let offset = ray.at(entry.t) - p;
        let distance = offset.length();
        let wi = (offset / distance).as_vec3a();
        // The ray starts above the point, so that this direction is a little lower.
        if !is_over_horizon(n, wi) {
            return None;
        }
        let radiance = self.radiance_at(&ray, entry.t, entry.part) * count;
        let distance = distance - self.rounding_along(&ray, &entry).min(0.5 * distance);
        LightSample::of_surface(wi, narrow(distance), radiance, narrow(pdf) * probability)
    }

    /// Returns by how much sooner a shadow ray to the point where `ray` enters the form may meet it, as its end is
    /// rounded: more the more the ray grazes it.
    fn rounding_along(&self, ray: &LineRay, entry: &Crossing) -> f64 {
        /// Rays of smaller cosines hardly bring light.
        const LEAST_COSINE: f64 = 0.01;
        let point = ray.at(entry.t);
        let rounding = END_ERROR * point.abs().max_element();
        // Shadow rays end sooner anyway.
        if rounding < LEAST_COSINE * f64::from(surface::SHADOW_MARGIN) * entry.t {
            return 0.0;
        }
        rounding / self.body.normal_at(entry.part, point, ray.direction).dot(ray.direction).abs()
    }

    /// Returns where the ray first meets the form; `None` where it starts within, for the back is dark.
    fn first_entry(&self, ray: &LineRay) -> Option<Crossing> {
        self.body.first_hit(ray).filter(|crossing| crossing.entering)
    }

    /// Returns one of the places where the ray enters the form, each with the same chance, and their number. The way to
    /// it is not judged here: a shadow ray passes what is before it with the chance that it is not there.
    fn any_entry(&self, mut ray: LineRay) -> Option<(Crossing, f32)> {
        let direction = ray.direction;
        let (mut count, mut chosen, mut bits) = (0u32, None, 0u64);
        while let Some(crossing) = self.body.first_hit(&ray) {
            if crossing.entering {
                count += 1;
                if count == 2 {
                    // Most lines enter once and need no number; the last bits of a direction are as good as random.
                    bits = mixed(direction.x.to_bits() ^ mixed(direction.y.to_bits() ^ mixed(direction.z.to_bits())));
                }
                // The i-th takes the place of those before it with the chance 1/i.
                if bits % u64::from(count) == 0 {
                    chosen = Some(crossing);
                }
                bits = mixed(bits);
            }
            ray.t_min = crossing.t + STEP * self.sphere.radius;
        }
        chosen.map(|crossing| (crossing, count as f32))
    }

    /// Returns the density of a direction in which a ray from `p` met this form, per steradian.
    #[inline]
    pub(super) fn pdf(&self, p: Vec3A, wi: Vec3A) -> f32 {
        let pdf = narrow(self.region.pdf(p.as_dvec3(), wi.as_dvec3()));
        if pdf.is_finite() { pdf } else { 0.0 }
    }

    /// Starts a photon where a random line leaves the form: towards the target. `u` chooses a sphere of that, and one
    /// of the exits. `None` where the line misses.
    pub(super) fn emit(&self, target: &Target, u: f32, u_position: Vec2, u_direction: Vec2) -> Option<Emission> {
        let (u, u_position, u_direction) = (f64::from(u), u_position.as_dvec2(), u_direction.as_dvec2());
        let (line, share, mut u) = match target.cones(self.sphere, None) {
            None => (self.line(u_position, u_direction), 1.0, u),
            Some(cones) => {
                let Aimed { through, direction, share, rest } = cones.line(u, u_position, u_direction)?;
                (self.line_through(through, direction), share, rest)
            }
        };
        let (mut count, mut chosen) = (0.0, None);
        self.exits(line, |t, part| {
            // Of n exits each is kept with the probability 1/n: the i-th takes the place of those before it with 1/i,
            // and the number is used again.
            count += 1.0;
            if u * count < 1.0 {
                chosen = Some((t, part));
                u *= count;
            } else {
                u = (u * count - 1.0) / (count - 1.0);
            }
        });
        let (t, part) = chosen?;
        let p = line.at(t);
        let normal = self.body.normal_at(part, p, line.direction).as_vec3a();
        let direction = line.direction.as_vec3a();
        // A rounded normal may lie across the line's direction, but the line leaves.
        let normal = if normal.dot(direction) < 0.0 { direction } else { normal };
        let rounded = p.as_vec3a();
        #[expect(clippy::cast_possible_truncation, reason = "a bound is only rounded")]
        let p_error = (p.abs().max_element() * POSITION_ERROR) as f32;
        let origin = surface::offset(rounded, normal, p_error, direction);
        let measure = narrow(self.line_measure() * share * count);
        Some(Emission { ray: Ray::new(origin, direction), flux: self.radiance_at(&line, t, part) * measure })
    }

    /// Measure of the lines through the sphere, m^2 sr.
    fn line_measure(&self) -> f64 {
        4.0 * PI * PI * self.sphere.radius * self.sphere.radius
    }

    /// Returns a random line through the sphere around the form.
    fn line(&self, u_position: DVec2, u_direction: DVec2) -> LineRay {
        // The lower half of u.x goes down: both hemispheres keep an even map.
        let below = u_direction.x < 0.5;
        let half = DVec2::new(2.0 * u_direction.x - if below { 0.0 } else { 1.0 }, u_direction.y);
        let mut direction = hemimap::double::square_to_uniform_hemisphere(half);
        if below {
            direction.z = -direction.z;
        }
        self.line_through(self.sphere.cross(direction, u_position), direction)
    }

    /// Returns a line through `p`, begun before the sphere.
    fn line_through(&self, p: DVec3, direction: DVec3) -> LineRay {
        let back = (p - self.sphere.centre).dot(direction) + 2.0 * self.sphere.radius;
        LineRay::new(p - direction * back, direction)
    }

    /// Shows the places where the line leaves the form: parameter and part.
    fn exits(&self, mut line: LineRay, mut visit: impl FnMut(f64, u32)) {
        while let Some(crossing) = self.body.first_hit(&line) {
            if !crossing.entering {
                visit(crossing.t, crossing.part);
            }
            line.t_min = crossing.t + STEP * self.sphere.radius;
        }
    }

    /// Returns the area, m^2, by the exits of so many lines: above 0, for what is thin may be missed by all.
    pub(super) fn measured_area(&self, lines: u32) -> f64 {
        let mut exits = 0.0;
        self.even_lines(lines).for_each(|line| self.exits(line, |_, _| exits += 1.0));
        self.line_measure() * f64::max(exits, 0.5) / f64::from(lines) / PI
    }

    /// Returns the mean factor of a pattern on it, by the exits of so many lines.
    pub(super) fn measured_mean(&self, pattern: &Pattern, projector: Option<&Projector>, lines: u32) -> Vec3 {
        let mut places = Vec::new();
        for line in self.even_lines(lines) {
            self.exits(line, |t, part| places.push(self.texture_coordinates(projector, &line, t, part)));
        }
        pattern.mean(places.into_iter())
    }

    /// Returns lines that are spread evenly over all that pass the sphere.
    fn even_lines(&self, count: u32) -> impl Iterator<Item = LineRay> {
        (0..count).map(|i| {
            // Roberts' sequence in four dimensions: powers of the root of x^5 = x + 1.
            let u = |power: i32| (0.5 + f64::from(i) * 1.167_303_978_261_418_7_f64.powi(-power)).fract();
            self.line(DVec2::new(u(1), u(2)), DVec2::new(u(3), u(4)))
        })
    }
}

/// Returns the map from a solid that is one ellipsoid to the unit ball.
fn ellipsoid(solid: &Solid) -> Option<DAffine3> {
    let [form] = solid.forms() else { return None };
    if solid.operation().is_some() || !form.perturbations().is_empty() {
        return None;
    }
    // Q(c + v) = k - v.Sv k: with S = L L^T, |L^T v| = 1 is the surface.
    let hessian = form.base().hessian();
    let middle = -(hessian.inverse() * form.base().gradient(DVec3::ZERO));
    let k = form.base().value(middle);
    let s = hessian * (-0.5 / k);
    let a = s.x_axis.x.sqrt();
    let (b, c) = (s.x_axis.y / a, s.x_axis.z / a);
    let d = (s.y_axis.y - b * b).sqrt();
    let e = (s.y_axis.z - b * c) / d;
    let f = (s.z_axis.z - c * c - e * e).sqrt();
    let upper = DMat3::from_cols(DVec3::new(a, 0.0, 0.0), DVec3::new(b, d, 0.0), DVec3::new(c, e, f));
    let centre = form.origin() + middle;
    // A root of what is negative was no ellipsoid's.
    let sound = k > 0.0 && centre.is_finite() && upper.is_finite() && upper.inverse().is_finite();
    sound.then(|| DAffine3 { matrix3: upper, translation: -(upper * centre) })
}

/// Returns the radius of a ball that `to_unit` maps to the unit ball; `None` where it is no ball in the first nine
/// digits.
pub(super) fn ball_radius(to_unit: DMat3) -> Option<f64> {
    let s = to_unit.transpose() * to_unit;
    let size = s.x_axis.x;
    let rest = s - DMat3::from_diagonal(DVec3::splat(size));
    let largest = rest.to_cols_array().into_iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
    (largest < 1e-9 * size).then(|| size.sqrt().recip())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use freeform::{FreeForm, Perturbation, Psi, Quadric};

    fn light(solid: Solid) -> FormLight {
        let body = Body::new(Arc::new(solid));
        FormLight::new(&body, Vec3::ONE, 1.0, 0, &mut Areas::new([&body].into_iter())).expect("it shines")
    }

    #[test]
    fn ellipsoids_are_found_and_nothing_else() {
        let place = DAffine3::from_scale_rotation_translation(
            DVec3::new(2.0, 0.5, 1.0),
            glam::DQuat::from_rotation_y(0.4) * glam::DQuat::from_rotation_z(1.0),
            DVec3::new(5.0, -3.0, 100.0),
        );
        let ball = FreeForm::new(Quadric::sphere(DVec3::ONE, 2.0).unwrap(), vec![]).unwrap();
        let moved = Solid::from(ball.transformed(&place).unwrap());
        let to_unit = ellipsoid(&moved).unwrap();
        for v in [DVec3::X, DVec3::new(0.6, 0.0, -0.8), -DVec3::Y] {
            let on_surface = place.transform_point3(DVec3::ONE + 2.0 * v);
            assert!((to_unit.transform_point3(on_surface).length() - 1.0).abs() < 1e-9, "at {on_surface}");
        }
        assert_eq!(ball_radius(to_unit.matrix3), None, "which is no ball");
        let radius = ball_radius(ellipsoid(&Solid::from(ball.clone())).unwrap().matrix3).unwrap();
        assert!((radius - 2.0).abs() < 1e-12, "but this is: {radius}");
        let cylinder = FreeForm::new(Quadric::cylinder(DVec3::ZERO, DVec3::Y, 1.0).unwrap(), vec![]).unwrap();
        let outside = FreeForm::new(Quadric::sphere(DVec3::ONE, 2.0).unwrap().complement(), vec![]).unwrap();
        let sheets = Quadric::one_sheet(DVec3::ZERO, DVec3::Y, 1.0, 1.0).unwrap();
        let bump = Perturbation { quadric: Quadric::sphere(DVec3::X, 1.0).unwrap(), factor: 0.1 };
        let bumpy = FreeForm::new(*ball.base(), vec![bump]).unwrap();
        let sheets = FreeForm::new(sheets, vec![]).unwrap();
        for (form, what) in [(cylinder, "cylinder"), (outside, "room"), (bumpy, "bumps"), (sheets, "hyperboloid")] {
            assert!(ellipsoid(&Solid::from(form)).is_none(), "a {what} is none");
        }
        let union = Solid::union(Psi::Maximum, vec![ball.into()]).unwrap();
        assert!(ellipsoid(&union).is_none(), "nor is a union");
    }

    #[test]
    fn area_is_that_of_cauchy_and_crofton() {
        let cuboid = Solid::cuboid(DVec3::new(-1.0, 0.0, 2.0), DVec3::new(1.0, 0.5, 3.0)).unwrap();
        assert!((light(cuboid.clone()).area / 7.0 - 1.0).abs() < 0.02, "2 (1 + 2 + 0.5): {}", light(cuboid).area);
        // A hollow ball shines into its hollow, too.
        let ball = |radius| Solid::from(FreeForm::new(Quadric::sphere(DVec3::X, radius).unwrap(), vec![]).unwrap());
        let shell = Solid::difference(Psi::Maximum, vec![ball(1.0), ball(0.5)]).unwrap();
        let area = light(shell).area;
        assert!((area / (5.0 * PI) - 1.0).abs() < 0.02, "4 pi (1 + 1/4): {area}");
        assert!((light(ball(0.5)).area / PI - 1.0).abs() < 1e-12, "a ball by its formula");
    }
}
