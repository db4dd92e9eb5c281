//! Quadrics (eq. 1 of the paper): polynomials of degree two in space, positive inside.

use glam::{DAffine3, DMat3, DVec3};
use serde::{Deserialize, Serialize};

use crate::{FormError, quadratic::Quadratic, range::Range};

/// A polynomial of degree two whose inside is where it is not negative:
///
/// ```text
/// Q(x, y, z) = A11 x^2 + A22 y^2 + A33 z^2 + A12 xy + A13 xz + A23 yz + A14 x + A24 y + A34 z + A44 >= 0
/// ```
///
/// The outward normal is minus the gradient. Written to a file it is the list of its ten coefficients.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "[f64; 10]", into = "[f64; 10]")]
pub struct Quadric {
    /// A11 A22 A33 A12 A13 A23 A14 A24 A34 A44.
    pub coefficients: [f64; 10],
}

impl Quadric {
    /// Returns the quadric with these coefficients.
    ///
    /// # Errors
    /// A coefficient is not finite, or all are zero.
    pub fn new(coefficients: [f64; 10]) -> Result<Self, FormError> {
        Self { coefficients }.checked()
    }

    /// Passes the quadric on if its numbers are sound; its field is public, so a form asks again.
    pub(crate) fn checked(self) -> Result<Self, FormError> {
        if let Some(index) = self.coefficients.iter().position(|a| !a.is_finite()) {
            return Err(FormError::CoefficientNotFinite { index });
        }
        if self.coefficients == [0.0; 10] { Err(FormError::AllZero) } else { Ok(self) }
    }

    /// Returns Q(p).
    pub fn value(&self, p: DVec3) -> f64 {
        let [a11, a22, a33, a12, a13, a23, a14, a24, a34, a44] = self.coefficients;
        (a11 * p.x + a12 * p.y + a13 * p.z + a14) * p.x
            + (a22 * p.y + a23 * p.z + a24) * p.y
            + (a33 * p.z + a34) * p.z
            + a44
    }

    /// Returns the gradient of Q at `p`; it points inwards on the surface.
    pub fn gradient(&self, p: DVec3) -> DVec3 {
        self.pull(p) + self.linear()
    }

    /// Returns the matrix of second derivatives, which is the same everywhere.
    pub fn hessian(&self) -> DMat3 {
        let [a11, a22, a33, a12, a13, a23, ..] = self.coefficients;
        DMat3::from_cols(
            DVec3::new(2.0 * a11, a12, a13),
            DVec3::new(a12, 2.0 * a22, a23),
            DVec3::new(a13, a23, 2.0 * a33),
        )
    }

    /// Returns the linear part (A14, A24, A34).
    pub(crate) fn linear(&self) -> DVec3 {
        DVec3::new(self.coefficients[6], self.coefficients[7], self.coefficients[8])
    }

    /// Returns the second derivatives times `v`: the gradient of the quadratic part at `v`.
    #[inline]
    fn pull(&self, v: DVec3) -> DVec3 {
        let [a11, a22, a33, a12, a13, a23, ..] = self.coefficients;
        DVec3::new(
            2.0 * a11 * v.x + a12 * v.y + a13 * v.z,
            a12 * v.x + 2.0 * a22 * v.y + a23 * v.z,
            a13 * v.x + a23 * v.y + 2.0 * a33 * v.z,
        )
    }

    /// Returns Q(p + s d) as a polynomial in s.
    #[inline]
    pub(crate) fn along(&self, p: DVec3, d: DVec3) -> Quadratic {
        let [a11, a22, a33, a12, a13, a23, ..] = self.coefficients;
        Quadratic {
            a: (a11 * d.x + a12 * d.y + a13 * d.z) * d.x + (a22 * d.y + a23 * d.z) * d.y + a33 * d.z * d.z,
            b: self.pull(d).dot(p) + self.linear().dot(d),
            c: self.value(p),
        }
    }

    /// Returns the quadric of the absolute coefficients: at absolute places it sums absolute terms.
    #[inline]
    fn weights(&self) -> Self {
        Self { coefficients: self.coefficients.map(f64::abs) }
    }

    /// Returns the sum of the absolute terms of Q(p + s d) as a polynomial in |s|; rounding errors of the value are
    /// shares of it.
    #[inline]
    pub(crate) fn weight_along(&self, p: DVec3, d: DVec3) -> Quadratic {
        self.weights().along(p.abs(), d.abs())
    }

    /// Returns by how much the coefficients of Q(p + s d) change where p moves by `step`, at most: the sums of the
    /// absolute terms. `a` does not change.
    #[inline]
    pub(crate) fn weight_moved(&self, p: DVec3, d: DVec3, step: DVec3) -> Quadratic {
        let (weights, step) = (self.weights(), step.abs());
        Quadratic { a: 0.0, b: weights.pull(d.abs()).dot(step), c: weights.gradient(p.abs()).dot(step) }
    }

    /// Returns the range of Q within `h` of `p` along each axis, with room for all roundings.
    pub(crate) fn over_box(&self, p: DVec3, h: DVec3) -> Range {
        /// At most 32 roundings of half a step, in sums of absolute terms that add up to less than four times the
        /// weight.
        const ROUNDING: f64 = 64.0 * f64::EPSILON;
        let [a11, a22, a33, a12, a13, a23, ..] = self.coefficients;
        let weight = self.weights().value(p.abs() + h);
        let (squares, diagonal) = (h * h, DVec3::new(a11, a22, a33));
        let mixed = (a12 * h.x * h.y).abs() + (a13 * h.x * h.z).abs() + (a23 * h.y * h.z).abs();
        let (value, linear) = (self.value(p), self.gradient(p).abs().dot(h));
        let around = linear + mixed + ROUNDING * weight;
        Range {
            lo: value - around + diagonal.min(DVec3::ZERO).dot(squares),
            hi: value + around + diagonal.max(DVec3::ZERO).dot(squares),
        }
    }

    /// Returns the sums of the absolute terms of the three derivatives at `p`.
    pub(crate) fn gradient_weight(&self, p: DVec3) -> DVec3 {
        self.weights().gradient(p.abs())
    }

    /// Returns the quadric of the solid moved by `transform`: Q'(x) = Q(inverse(transform) x).
    ///
    /// Far translations lose digits in the coefficients; `FreeForm` keeps an origin apart for that reason.
    ///
    /// # Errors
    /// The transformation is singular or not finite, or the moved coefficients overflow.
    pub fn transformed(&self, transform: &DAffine3) -> Result<Self, FormError> {
        let inverse = inverse(transform)?;
        let (m, t) = (inverse.matrix3, inverse.translation);
        let h = m.transpose() * self.hessian() * m;
        let l = m.transpose() * self.gradient(t);
        Self::new([
            0.5 * h.x_axis.x,
            0.5 * h.y_axis.y,
            0.5 * h.z_axis.z,
            h.y_axis.x,
            h.z_axis.x,
            h.z_axis.y,
            l.x,
            l.y,
            l.z,
            self.value(t),
        ])
    }
}

/// Returns the inverse of a transformation that has one.
pub(crate) fn inverse(transform: &DAffine3) -> Result<DAffine3, FormError> {
    let inverse = transform.inverse();
    let sound = transform.is_finite() && inverse.is_finite() && transform.matrix3.determinant() != 0.0;
    if sound { Ok(inverse) } else { Err(FormError::Singular) }
}

impl TryFrom<[f64; 10]> for Quadric {
    type Error = FormError;

    fn try_from(coefficients: [f64; 10]) -> Result<Self, FormError> {
        Self::new(coefficients)
    }
}

impl From<Quadric> for [f64; 10] {
    fn from(quadric: Quadric) -> Self {
        quadric.coefficients
    }
}
