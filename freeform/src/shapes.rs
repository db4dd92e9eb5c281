//! Quadrics by name.

use glam::{DMat3, DVec3};

use crate::{FormError, Quadric};

impl Quadric {
    /// Returns the ellipsoid `1 - sum ((p - center) / radii)^2`.
    ///
    /// # Errors
    /// The centre is not finite or a radius not positive.
    pub fn ellipsoid(center: DVec3, radii: DVec3) -> Result<Self, FormError> {
        lengths(radii, "a radius")?;
        about(center, DMat3::from_diagonal(-(radii * radii).recip()), DVec3::ZERO, 1.0)
    }

    /// Returns the ball `1 - |p - center|^2 / radius^2`.
    ///
    /// # Errors
    /// The centre is not finite or the radius not positive.
    pub fn sphere(center: DVec3, radius: f64) -> Result<Self, FormError> {
        Self::ellipsoid(center, DVec3::splat(radius))
    }

    /// Returns the endless cylinder about the line through `point` along `axis`: 1 on the axis, 0 at `radius`.
    ///
    /// # Errors
    /// The point is not finite, the axis zero or the radius not positive.
    pub fn cylinder(point: DVec3, axis: DVec3, radius: f64) -> Result<Self, FormError> {
        lengths(DVec3::splat(radius), "a radius")?;
        let axis = unit(axis)?;
        about(point, (outer(axis) - DMat3::IDENTITY) * (1.0 / (radius * radius)), DVec3::ZERO, 1.0)
    }

    /// Returns the double cone about the line through `apex` along `axis`: `(h slope)^2 - r^2` at height h and distance
    /// r from the axis.
    ///
    /// # Errors
    /// The apex is not finite, the axis zero or the slope (radius over height) not positive.
    pub fn cone(apex: DVec3, axis: DVec3, slope: f64) -> Result<Self, FormError> {
        lengths(DVec3::splat(slope), "the slope of a cone")?;
        let axis = unit(axis)?;
        about(apex, outer(axis) * (slope * slope + 1.0) - DMat3::IDENTITY, DVec3::ZERO, 0.0)
    }

    /// Returns the paraboloid that opens along `axis` from `vertex`: `4 focal_length h - r^2` at height h and distance
    /// r from the axis.
    ///
    /// # Errors
    /// The vertex is not finite, the axis zero or the focal length not positive.
    pub fn paraboloid(vertex: DVec3, axis: DVec3, focal_length: f64) -> Result<Self, FormError> {
        lengths(DVec3::splat(focal_length), "a focal length")?;
        let axis = unit(axis)?;
        about(vertex, outer(axis) - DMat3::IDENTITY, 4.0 * focal_length * axis, 0.0)
    }

    /// Returns the hyperboloid of one sheet about the line through `center` along `axis`: `1 + (h slope / radius)^2 -
    /// (r / radius)^2` at height h and distance r from the axis. At its waist it has the radius, far away the slope
    /// (radius over height) of a cone.
    ///
    /// # Errors
    /// The centre is not finite, the axis zero, or the radius or the slope not positive.
    pub fn one_sheet(center: DVec3, axis: DVec3, radius: f64, slope: f64) -> Result<Self, FormError> {
        lengths(DVec3::splat(radius), "a radius")?;
        lengths(DVec3::splat(slope), "the slope of a hyperboloid")?;
        let cone = outer(unit(axis)?) * (slope * slope + 1.0) - DMat3::IDENTITY;
        about(center, cone * (1.0 / (radius * radius)), DVec3::ZERO, 1.0)
    }

    /// Returns the hyperboloid of two sheets about the line through `center` along `axis`: `(h / height)^2 - (r /
    /// (height slope))^2 - 1` at height h and distance r from the axis. The sheets begin at `height` to both sides; far
    /// away they have the slope (radius over height) of a cone.
    ///
    /// # Errors
    /// The centre is not finite, the axis zero, or the height or the slope not positive.
    pub fn two_sheets(center: DVec3, axis: DVec3, height: f64, slope: f64) -> Result<Self, FormError> {
        lengths(DVec3::splat(height), "a height")?;
        lengths(DVec3::splat(slope), "the slope of a hyperboloid")?;
        let cone = outer(unit(axis)?) * (slope * slope + 1.0) - DMat3::IDENTITY;
        let radius = height * slope;
        about(center, cone * (1.0 / (radius * radius)), DVec3::ZERO, -1.0)
    }

    /// Returns what lies below the saddle at `point`: `rise x^2 - fall y^2 - h` at height h along `axis`, x along
    /// `along` (as far as that is across the axis) and y across both.
    ///
    /// # Errors
    /// The point is not finite, the two directions are zero or parallel, or the rise or the fall is not positive.
    pub fn saddle(point: DVec3, axis: DVec3, along: DVec3, rise: f64, fall: f64) -> Result<Self, FormError> {
        lengths(DVec3::new(rise, fall, 1.0), "the curvature of a saddle")?;
        let axis = unit(axis)?;
        let x = unit(along - along.dot(axis) * axis)?;
        let y = axis.cross(x);
        about(point, outer(x) * rise - outer(y) * fall, -axis, 0.0)
    }

    /// Returns the half-space behind the plane through `point` with the outward normal `normal`.
    ///
    /// # Errors
    /// The point is not finite or the normal zero.
    pub fn half_space(point: DVec3, normal: DVec3) -> Result<Self, FormError> {
        about(point, DMat3::ZERO, -unit(normal)?, 0.0)
    }

    /// Returns the slab about the plane through `point`: 1 in the middle, 0 at `half_thickness` to both sides along
    /// `normal`.
    ///
    /// # Errors
    /// The point is not finite, the normal zero or the thickness not positive.
    pub fn slab(point: DVec3, normal: DVec3, half_thickness: f64) -> Result<Self, FormError> {
        lengths(DVec3::splat(half_thickness), "a thickness")?;
        about(point, outer(unit(normal)?) * (-1.0 / (half_thickness * half_thickness)), DVec3::ZERO, 1.0)
    }

    /// Returns the quadric with the opposite sign: what was inside is outside, so that a ball becomes a room.
    pub fn complement(self) -> Self {
        Self { coefficients: self.coefficients.map(|a| -a) }
    }
}

/// Returns `v.matrix.v + linear.v + constant` with v = p - point.
fn about(point: DVec3, matrix: DMat3, linear: DVec3, constant: f64) -> Result<Quadric, FormError> {
    if !point.is_finite() {
        return Err(FormError::OutOfRange("a point"));
    }
    let pulled = matrix * point;
    let l = linear - 2.0 * pulled;
    let (x, y, z) = (matrix.x_axis, matrix.y_axis, matrix.z_axis);
    let constant = constant + pulled.dot(point) - linear.dot(point);
    Quadric::new([x.x, y.y, z.z, 2.0 * x.y, 2.0 * x.z, 2.0 * y.z, l.x, l.y, l.z, constant])
}

fn outer(v: DVec3) -> DMat3 {
    DMat3::from_cols(v * v.x, v * v.y, v * v.z)
}

fn unit(v: DVec3) -> Result<DVec3, FormError> {
    v.try_normalize().ok_or(FormError::OutOfRange("a direction"))
}

fn lengths(v: DVec3, what: &'static str) -> Result<(), FormError> {
    // NaN fails the comparison too.
    if v.min_element() > 0.0 && v.is_finite() { Ok(()) } else { Err(FormError::OutOfRange(what)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn named_quadrics_are_zero_where_they_should_be() {
        let (p, axis) = (DVec3::new(1.0, -2.0, 3.0), DVec3::new(1.0, 2.0, 2.0));
        let (n, across) = (axis / 3.0, DVec3::new(2.0, 1.0, -2.0) / 3.0);
        let cases = [
            (Quadric::ellipsoid(p, DVec3::new(1.0, 2.0, 3.0)), p, p + DVec3::new(0.0, 2.0, 0.0), "ellipsoid"),
            (Quadric::sphere(p, 2.0), p + across, p + 2.0 * n, "sphere"),
            (Quadric::cylinder(p, axis, 0.5), p + 7.0 * n, p + 7.0 * n + 0.5 * across, "cylinder"),
            (Quadric::cone(p, axis, 0.5), p - 2.0 * n, p - 2.0 * n + across, "cone"),
            (Quadric::paraboloid(p, axis, 0.25), p + n, p + 4.0 * n + 2.0 * across, "paraboloid"),
            (Quadric::one_sheet(p, axis, 0.5, 2.0), p + n, p + 0.5 * across, "one sheet"),
            (Quadric::one_sheet(p, axis, 3.0, 1.0), p + n, p + 4.0 * n + 5.0 * across, "one sheet far from its waist"),
            (Quadric::two_sheets(p, axis, 0.5, 2.0), p + n, p - 0.5 * n, "two sheets"),
            (Quadric::two_sheets(p, axis, 3.0, 1.0), p - 4.0 * n, p + 5.0 * n + 4.0 * across, "two sheets far away"),
            (Quadric::saddle(p, axis, across + n, 0.5, 2.0), p - n, p + 2.0 * n + 2.0 * across, "saddle, rising"),
            (
                Quadric::saddle(p, axis, across, 0.5, 2.0),
                p - 9.0 * n,
                p - 2.0 * n + axis.cross(across) / 3.0,
                "saddle, falling",
            ),
            (Quadric::half_space(p, axis), p - n, p + 5.0 * across, "half-space"),
            (Quadric::slab(p, axis, 0.5), p + 0.4 * n + across, p - 0.5 * n + across, "slab"),
        ];
        for (quadric, inside, on, name) in cases {
            let quadric = quadric.unwrap();
            assert!(quadric.value(inside) > 0.1, "{name}: inside is positive");
            assert!(quadric.value(on).abs() < 1e-13, "{name}: the surface is zero, not {}", quadric.value(on));
            assert!(quadric.complement().value(inside) < -0.1, "{name}: the complement turns the sign");
        }
    }

    #[test]
    fn lengths_that_are_no_lengths_are_refused() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(Quadric::sphere(DVec3::ZERO, bad).is_err(), "radius {bad}");
            assert!(Quadric::slab(DVec3::ZERO, DVec3::X, bad).is_err(), "thickness {bad}");
        }
        assert!(Quadric::half_space(DVec3::ZERO, DVec3::ZERO).is_err(), "no direction");
        assert!(Quadric::half_space(DVec3::NAN, DVec3::X).is_err(), "no point");
        assert!(Quadric::sphere(DVec3::ZERO, 1e-200).is_err(), "1/r^2 overflows");
    }
}
