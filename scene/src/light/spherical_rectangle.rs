//! A rectangle on the unit sphere around a point: its solid angle, and directions to it that are uniform per solid
//! angle.
//!
//! Two planes through the origin and two edges that meet at the corner (x, y) of a rectangle at height h enclose an
//! angle whose cosine and sine are as x y to h (x^2 + y^2 + h^2)^(1/2), with the sign by the corner. As complex numbers
//! the four need no arc cosines: their product has the angle 2 pi + the solid angle.
//!
//! # Source
//! Ureña, Fajardo, King 2013: An Area-Preserving Parametrization for Spherical Rectangles. The product instead of four
//! arc cosines is ours, and so is x without the cosine that the paper takes it from.

use std::f64::consts::TAU;

use glam::DVec2;

/// A rectangle seen from the origin of a frame whose x and y are its edges; it lies at z = -`height`.
#[derive(Debug)]
pub(super) struct SphericalRectangle {
    low: DVec2,
    high: DVec2,
    height: f64,
    pub(super) solid_angle: f64,
    /// Cosine and sine of 2 pi less the two angles at `low.x`.
    rest: DVec2,
    /// z of the normals of the planes through the origin and the edges at `low.y` and `high.y`.
    normals: [f64; 2],
    /// Square of the sine where that of `normals[0]` is the cosine.
    sin_sq: f64,
}

/// More than the angle of a product may be off by.
const ROUNDING: f64 = 1e-12;

impl SphericalRectangle {
    /// Returns the rectangle from the corner `low` to the corner `high` at a distance of `height` > 0; `None` where
    /// nothing is seen of it, and where the point is nearer to it than f64 can tell (10^-12 of its size).
    #[inline]
    pub(super) fn new(low: DVec2, high: DVec2, height: f64) -> Option<Self> {
        debug_assert!(height > 0.0, "seen from the front");
        let height_sq = height * height;
        let (low_sq, high_sq) = (low * low + height_sq, high * high + height_sq);
        let corner = |x: f64, y: f64, product: f64| DVec2::new(product, height * (x * x + y * y + height_sq).sqrt());
        let at_high = corner(high.x, low.y, high.x * low.y).rotate(corner(high.x, high.y, -(high.x * high.y)));
        let at_low = corner(low.x, high.y, low.x * high.y).rotate(corner(low.x, low.y, -(low.x * low.y)));
        let angle = at_high.rotate(at_low).to_angle();
        let solid_angle = if angle < -ROUNDING { angle + TAU } else { angle };
        let (low_y, high_y) = (low_sq.y.sqrt(), high_sq.y.sqrt());
        (solid_angle > 0.0).then(|| Self {
            low,
            high,
            height,
            solid_angle,
            rest: DVec2::new(at_low.x, -at_low.y) / (low_sq.x * low_y * high_y),
            normals: [-low.y / low_y, high.y / high_y],
            sin_sq: height_sq / low_sq.y,
        })
    }

    /// Returns the point x, y of the rectangle in whose direction it is uniform per solid angle.
    #[inline]
    pub(super) fn sample(&self, u: f64, v: f64) -> DVec2 {
        let Self { low, high, height, solid_angle, rest, normals, sin_sq } = *self;
        // A plane x = const cuts off the share u of the solid angle.
        let DVec2 { x: cosine, y: sine } = DVec2::from_angle(u * solid_angle).rotate(rest);
        let f = cosine * normals[0] - normals[1];
        let x = height * sine.copysign(sine * f) / (f * f - sin_sq * sine * sine).max(0.0).sqrt();
        let x = if x.is_nan() { high.x } else { x.clamp(low.x, high.x) };
        // Along it, the height on the sphere is uniform.
        let depth_sq = x * x + height * height;
        let along = |y: f64| y / (depth_sq + y * y).sqrt();
        let (from, to) = (along(low.y), along(high.y));
        let share = from + v * (to - from);
        let y = share * (depth_sq / ((1.0 - share) * (1.0 + share))).sqrt();
        DVec2::new(x, if y.is_nan() { high.y } else { y.clamp(low.y, high.y) })
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// Rectangles beside, over and around the foot of the point, near and far, wide and thin.
    fn rectangles() -> impl Iterator<Item = (DVec2, DVec2, f64)> {
        let lows = [-3.0, -1.0, -0.2, 0.0, 0.4, 5.0];
        let lengths = [1e-3, 0.2, 2.0, 40.0];
        let heights = [1e-4, 0.01, 1.0, 30.0];
        let sides = move || lows.into_iter().flat_map(move |low| lengths.map(|length| (low, low + length)));
        sides().flat_map(move |x| {
            sides().flat_map(move |y| heights.map(|h| (DVec2::new(x.0, y.0), DVec2::new(x.1, y.1), h)))
        })
    }

    /// The same by four arc tangents, one for the quadrant of each corner.
    fn by_quadrants(low: DVec2, high: DVec2, height: f64) -> f64 {
        let quadrant = |x: f64, y: f64| (x * y / (height * DVec3::new(x, y, height).length())).atan();
        quadrant(high.x, high.y) - quadrant(low.x, high.y) - quadrant(high.x, low.y) + quadrant(low.x, low.y)
    }

    #[test]
    fn solid_angle_is_that_of_four_quadrants() {
        for (low, high, height) in rectangles() {
            let expected = by_quadrants(low, high, height);
            let found = SphericalRectangle::new(low, high, height).map_or(0.0, |rectangle| rectangle.solid_angle);
            assert!(
                (found - expected).abs() < 1e-9 * expected + 1e-14,
                "{low} to {high} at {height}: {found} sr, not {expected}"
            );
        }
    }

    #[test]
    fn shares_of_the_solid_angle_are_those_of_the_numbers() {
        let (mut tested, mut all) = (0, 0);
        for (low, high, height) in rectangles() {
            let Some(rectangle) = SphericalRectangle::new(low, high, height).filter(|r| r.solid_angle > 1e-9) else {
                continue;
            };
            for i in 0..81 {
                let (u, v) = (f64::from(i % 9) / 8.0, f64::from(i / 9) / 8.0);
                let place = rectangle.sample(u, v);
                assert!(place.cmpge(low).all() && place.cmple(high).all(), "{place} between {low} and {high}");
                // Digits are lost by the cube of the distance in heights.
                let far = place.abs().max_element();
                let tolerance = 1e-6 + 1e-14 * (far / height).powi(3) * far / (high - low).min_element();
                all += 1;
                if tolerance > 1e-3 {
                    continue;
                }
                tested += 1;
                // What lies at smaller x is the share u; of a thin strip along y, what lies at smaller y.
                let below = by_quadrants(low, DVec2::new(place.x, high.y), height) / rectangle.solid_angle;
                assert!((below - u).abs() < tolerance, "{low} to {high} at {height}: {below} below x, not {u}");
                let depth = place.x.hypot(height);
                let along = |y: f64| y / y.hypot(depth);
                let below = (along(place.y) - along(low.y)) / (along(high.y) - along(low.y));
                assert!((below - v).abs() < tolerance, "{low} to {high} at {height}: {below} below y, not {v}");
            }
        }
        assert!(2 * tested > all, "{tested} of {all}");
    }
}
