//! A quadric along a ray: a polynomial of degree two in the ray parameter, and its roots without cancellation.

/// The polynomial `a s^2 + b s + c`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Quadratic {
    pub(crate) a: f64,
    pub(crate) b: f64,
    pub(crate) c: f64,
}

/// Real roots in ascending order. A double root counts as none: nothing changes sign there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Roots {
    None,
    One(f64),
    Two(f64, f64),
}

impl Quadratic {
    pub(crate) const ZERO: Self = Self { a: 0.0, b: 0.0, c: 0.0 };

    /// Returns the value at `s`.
    #[inline]
    pub(crate) fn at(self, s: f64) -> f64 {
        (self.a * s + self.b) * s + self.c
    }

    /// Returns the derivative at `s`.
    #[inline]
    pub(crate) fn slope(self, s: f64) -> f64 {
        2.0 * self.a * s + self.b
    }

    /// Returns the roots where the sign changes.
    ///
    /// One root comes from `q = -(b + sign(b) sqrt(b^2 - 4ac)) / 2` as `q / a`, the other as `c / q`: no difference of
    /// nearly equal numbers, and a vanishing `a` sends one root to infinity and leaves the other right.
    #[inline]
    pub(crate) fn roots(self) -> Roots {
        let Self { a, b, c } = self;
        if a == 0.0 {
            return if b == 0.0 { Roots::None } else { Roots::One(-c / b) };
        }
        let discriminant = b * b - 4.0 * a * c;
        if discriminant <= 0.0 || discriminant.is_nan() {
            return Roots::None;
        }
        let q = -0.5 * (b + discriminant.sqrt().copysign(b));
        let (r, s) = (q / a, c / q);
        if r < s { Roots::Two(r, s) } else { Roots::Two(s, r) }
    }

    /// Returns the sign of the polynomial far below all of its roots: that of the leading coefficient, turned for odd
    /// degree.
    #[inline]
    pub(crate) fn sign_at_minus_infinity(self) -> f64 {
        if self.a != 0.0 {
            self.a
        } else if self.b != 0.0 {
            -self.b
        } else {
            self.c
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_keep_their_digits() {
        // (s - 1e-9)(s - 1e9): the textbook formula gives 0 for the small root.
        let Roots::Two(small, large) = (Quadratic { a: 1.0, b: -(1e9 + 1e-9), c: 1.0 }).roots() else {
            panic!("two roots")
        };
        assert!((small * 1e9 - 1.0).abs() < 1e-15, "small root {small}");
        assert!((large * 1e-9 - 1.0).abs() < 1e-15, "large root {large}");
    }

    #[test]
    fn degenerate_polynomials_have_their_roots() {
        let roots = |a, b, c| Quadratic { a, b, c }.roots();
        assert_eq!(roots(0.0, 2.0, -1.0), Roots::One(0.5), "a line");
        assert_eq!(roots(0.0, 0.0, 1.0), Roots::None, "a constant");
        assert_eq!(roots(1.0, 0.0, 0.0), Roots::None, "a double root changes no sign");
        assert_eq!(roots(1.0, 0.0, -4.0), Roots::Two(-2.0, 2.0), "no linear term");
        assert_eq!(roots(-1.0, 1.0, 0.0), Roots::Two(0.0, 1.0), "ascending for either sign of a");
        assert_eq!(roots(f64::NAN, 1.0, 0.0), Roots::None, "NaN has no roots");
    }
}
