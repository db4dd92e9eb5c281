//! Second derivatives in the tangent plane, and how far they let a record reach.
//!
//! A record that is carried by its gradient errs at the offset d by d H d / 2, to second order. Summed over an ellipse
//! along the axes of H, where each half axis is that of the disc on which its eigenvalue alone would give the error
//! allowed (Schwarzhaupt et al. 2012, eq. 6):
//!
//! ```text
//! integral over a disc of radius R of |k| r^2 / 2  =  pi |k| R^4 / 4  =  eps     =>     R = (4 eps / (pi |k|))^(1/4)
//! ```

use std::ops::AddAssign;

use glam::Vec2;

/// A symmetric matrix of the tangent plane.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Symmetric {
    pub(crate) xx: f32,
    pub(crate) xy: f32,
    pub(crate) yy: f32,
}

impl Symmetric {
    /// `a b' + b a'`.
    pub(crate) fn mixed(a: Vec2, b: Vec2) -> Self {
        Self { xx: 2.0 * a.x * b.x, xy: a.x * b.y + a.y * b.x, yy: 2.0 * a.y * b.y }
    }

    pub(crate) fn scaled(self, factor: f32) -> Self {
        Self { xx: factor * self.xx, xy: factor * self.xy, yy: factor * self.yy }
    }

    /// The eigenvalues, that of the larger magnitude first, and the unit eigenvector of the first; the other is at
    /// right angles.
    pub(crate) fn eigen(self) -> ([f32; 2], Vec2) {
        let middle = 0.5 * (self.xx + self.yy);
        let half = 0.5 * (self.xx - self.yy);
        let spread = half.hypot(self.xy);
        let first = if middle < 0.0 { middle - spread } else { middle + spread };
        let second = 2.0 * middle - first;
        // The longer of the two rows that give the vector: the other one may have lost its digits.
        let signed = if middle < 0.0 { -spread } else { spread };
        let axis = if (half < 0.0) == (signed < 0.0) {
            Vec2::new(half + signed, self.xy)
        } else {
            Vec2::new(self.xy, signed - half)
        };
        ([first, second], axis.try_normalize().unwrap_or(Vec2::X))
    }
}

impl AddAssign for Symmetric {
    fn add_assign(&mut self, other: Self) {
        self.xx += other.xx;
        self.xy += other.xy;
        self.yy += other.yy;
    }
}

/// The radius at which a second derivative `curvature` sums to the error `total` over its disc; infinite where it is 0.
pub(crate) fn radius(curvature: f32, total: f32) -> f32 {
    (4.0 * total / (std::f32::consts::PI * curvature.abs())).sqrt().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvectors_are_turned_into_multiples_of_themselves() {
        for (xx, xy, yy) in [(1.0, 0.0, 2.0), (-3.0, 1.0, 0.5), (1.0, 1e-4, 1.0), (0.0, 2.0, 0.0), (-1.0, -5.0, 4.0)] {
            let matrix = Symmetric { xx, xy, yy };
            let ([first, second], axis) = matrix.eigen();
            let turned = Vec2::new(xx * axis.x + xy * axis.y, xy * axis.x + yy * axis.y);
            // Rounding of f32, a few times.
            assert!((turned - first * axis).length() < 4e-7 * first.abs(), "{matrix:?}: {first} along {axis}");
            let other = axis.perp();
            let turned = Vec2::new(xx * other.x + xy * other.y, xy * other.x + yy * other.y);
            assert!((turned - second * other).length() < 4e-7 * first.abs(), "{matrix:?}: {second} along {other}");
            assert!(first.abs() >= second.abs() && (axis.length() - 1.0).abs() < 1e-6, "{matrix:?}");
        }
    }

    #[test]
    fn nothing_curved_reaches_everywhere() {
        let ([first, second], axis) = Symmetric::default().eigen();
        assert_eq!((first, second, axis), (0.0, 0.0, Vec2::X), "any axis is right");
        assert_eq!(radius(first, 1.0), f32::INFINITY, "no limit");
    }

    #[test]
    fn error_of_a_disc_is_what_is_allowed() {
        let (curvature, total) = (-3.0f32, 0.2f32);
        let radius = f64::from(radius(curvature, total));
        // Rings of the disc, by the midpoint rule: error 1e-6 of the sum.
        let rings = 1000;
        let sum: f64 = (0..rings)
            .map(|ring| {
                let r = radius * (f64::from(ring) + 0.5) / f64::from(rings);
                0.5 * 3.0 * r * r * std::f64::consts::TAU * r * radius / f64::from(rings)
            })
            .sum();
        assert!((sum - 0.2).abs() < 1e-5, "{sum}");
    }
}
