//! Irradiances in closed form, in f64.

use std::f64::consts::PI;

use glam::DVec3;

/// Returns the irradiance at `p` with unit normal `n` from a convex polygon of radiance 1, W m^-2, whichever way that
/// looks.
///
/// What lies below the horizon is clipped away first. Angles come from `atan2`, so short edges lose no digits.
///
/// # Source
/// Lambert 1760, *Photometria*; Arvo 1994, "The irradiance Jacobian for partially occluded polyhedral sources".
#[must_use]
pub fn polygon_irradiance(corners: &[DVec3], p: DVec3, n: DVec3) -> f64 {
    let corners = above_horizon(corners.iter().map(|&corner| corner - p).collect(), n);
    let edges = corners.iter().zip(corners.iter().cycle().skip(1));
    let sum: f64 = edges
        .map(|(a, b)| {
            let cross = a.cross(*b);
            let length = cross.length();
            if length < 1e-15 { 0.0 } else { length.atan2(a.dot(*b)) * n.dot(cross) / length }
        })
        .sum();
    0.5 * sum.abs()
}

/// Sutherland and Hodgman's clipping against the plane through the origin with normal `n`.
fn above_horizon(corners: Vec<DVec3>, n: DVec3) -> Vec<DVec3> {
    let mut clipped = Vec::with_capacity(corners.len() + 1);
    for (&a, &b) in corners.iter().zip(corners.iter().cycle().skip(1)) {
        let (ha, hb) = (n.dot(a), n.dot(b));
        if ha >= 0.0 {
            clipped.push(a);
        }
        if (ha < 0.0) != (hb < 0.0) {
            clipped.push(a.lerp(b, ha / (ha - hb)));
        }
    }
    clipped
}

/// Returns the irradiance at `p` with unit normal `n` from a sphere of radiance 1 that does not contain `p`, W m^-2.
#[must_use]
pub fn sphere_irradiance(centre: DVec3, radius: f64, p: DVec3, n: DVec3) -> f64 {
    let offset = centre - p;
    let h = offset.length() / radius;
    let cos_w = n.dot(offset) / offset.length();
    if h * cos_w >= 1.0 {
        return PI * cos_w / (h * h);
    }
    if h * cos_w <= -1.0 {
        return 0.0;
    }
    let sin_w = (1.0 - cos_w * cos_w).sqrt();
    let x = (h * h - 1.0).sqrt();
    let y = -x * cos_w / sin_w;
    let s = sin_w * (1.0 - y * y).sqrt();
    (cos_w * y.acos() - x * s) / (h * h) + (s / x).atan()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_have_their_known_values() {
        let square = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| DVec3::new(x, y, 1.0));
        let upright = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(y, z)| DVec3::new(0.5, y, z));
        let tilted = DVec3::new(0.75f64.sqrt(), 0.0, 0.5);
        let cases = [
            (square, DVec3::Z, 1.740_839_502_734),
            (square, tilted, 0.909_067_569_058),
            (square, DVec3::X, 0.350_188_287_714),
            (upright, DVec3::Z, 0.780_804_588_917),
            (square, DVec3::NEG_Z, 0.0),
        ];
        for (corners, n, expected) in cases {
            let found = polygon_irradiance(&corners, DVec3::ZERO, n);
            assert!((found - expected).abs() < 1e-12, "{found} instead of {expected}");
        }
    }

    #[test]
    fn spheres_have_their_known_values() {
        let cases = [
            (2.0, 45.0f64, 0.176_776_695_3),
            (2.0, 60.0, 0.125),
            (2.0, 75.0, 0.070_410_427_0),
            (2.0, 90.0, 0.028_834_442_8),
            (2.0, 119.0, 7.283_675e-6),
            (1.1, 120.0, 0.068_184_490_8),
            (2.0, 121.0, 0.0),
        ];
        for (h, degrees, expected) in cases {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let found = sphere_irradiance(DVec3::new(sin, 0.0, cos) * h, 1.0, DVec3::ZERO, DVec3::Z) / PI;
            assert!((found - expected).abs() < 1e-10, "h = {h}, {degrees} degrees: {found} instead of {expected}");
        }
    }
}
