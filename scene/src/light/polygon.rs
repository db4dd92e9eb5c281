//! The irradiance that a polygon brings where nothing hides it, in closed form.
//!
//! # Source
//! Johann Heinrich Lambert, *Photometria*, 1760; as a sum over edges in Baum, Rushmeier, Winget, *Improving Radiosity
//! Solutions Through the Use of Analytically Determined Form-Factors*, 1989.

use glam::{DVec3, Vec3A};

use super::narrow;

/// Below it the edges of a small polygon leave few digits, even in f64.
const LEAST: f64 = 1e-9;

/// Returns the irradiance that a polygon of radiance 1 brings to a surface with the unit normal `n`; its corners are
/// offsets from there, in order. `None` where it is not above the horizon as a whole or brings next to nothing.
#[inline]
pub(super) fn irradiance<const N: usize>(n: Vec3A, corners: [DVec3; N]) -> Option<f32> {
    let n = n.as_dvec3();
    if !corners.iter().all(|corner| n.dot(*corner) > 0.0) {
        return None;
    }
    let corners = corners.map(DVec3::normalize);
    let of_edge = |i: usize| {
        let (a, b) = (corners[i], corners[(i + 1) % N]);
        n.dot(a.cross(b)) * angle_over_sine(a.dot(b))
    };
    let irradiance = 0.5 * (0..N).map(of_edge).sum::<f64>().abs();
    (irradiance > LEAST).then(|| narrow(irradiance))
}

/// Returns an angle over its sine, by its cosine.
#[inline]
fn angle_over_sine(cosine: f64) -> f64 {
    let sine = ((1.0 - cosine) * (1.0 + cosine)).max(0.0).sqrt();
    if sine > 0.0 { sine.atan2(cosine) / sine } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use super::*;

    /// The corners of a square of this half width, whose middle is at a height above the origin.
    fn square(half: f64, height: f64) -> [DVec3; 4] {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| DVec3::new(half * x, half * y, height))
    }

    #[test]
    fn squares_have_their_known_irradiance() {
        // Four rectangles whose corner is above the point: Howell's configuration factor C-11.
        let known = |half: f64, height: f64| {
            let hypotenuse = half.hypot(height);
            narrow(4.0 * half / hypotenuse * (half / hypotenuse).atan())
        };
        for (half, height) in [(1.0, 1.0), (0.01, 1.0), (1e-4, 3.0), (100.0, 0.5)] {
            let (found, known) = (irradiance(Vec3A::Z, square(half, height)).unwrap(), known(half, height));
            assert!((found / known - 1.0).abs() < 1e-6, "{half}, {height}: {found}, not {known}");
        }
        let sky = irradiance(Vec3A::Z, square(1e6, 1.0)).unwrap();
        assert!((sky / PI - 1.0).abs() < 1e-5, "{sky}");
    }

    #[test]
    fn corners_in_either_order_shine_alike() {
        let mut corners = square(0.7, 2.0).map(|corner| corner + DVec3::new(1.0, 0.5, 0.0));
        let one = irradiance(Vec3A::Z, corners);
        corners.reverse();
        assert_eq!(one, irradiance(Vec3A::Z, corners));
    }

    #[test]
    fn small_ones_are_as_bright_as_points() {
        // Tilted, and off the axis: cosines at both ends over the square of the distance, times the area.
        let (middle, normal) = (DVec3::new(3.0, -2.0, 5.0), DVec3::new(0.3, 0.4, -0.9).normalize());
        let (x, y) = normal.any_orthonormal_pair();
        for half in [1e-2, 1e-3, 2e-4] {
            let corners = square(half, 0.0).map(|corner| middle + corner.x * x + corner.y * y);
            let towards = middle.normalize();
            let known = towards.z * -normal.dot(towards) * 4.0 * half * half / middle.length_squared();
            let found = irradiance(Vec3A::Z, corners).unwrap();
            assert!((found / narrow(known) - 1.0).abs() < 1e-4, "{half}: {found}, not {known}");
        }
        assert_eq!(irradiance(Vec3A::Z, square(1e-5, 1.0)), None, "left to samples");
    }

    #[test]
    fn polygons_across_the_horizon_have_no_form() {
        let corners = square(1.0, 1.0);
        assert!(irradiance(Vec3A::new(1.0, 0.0, 0.1).normalize(), corners).is_none());
        assert!(irradiance(Vec3A::NEG_Z, corners).is_none());
    }
}
