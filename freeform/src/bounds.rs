//! Boxes around forms, in closed form and never too small.
//!
//! Where all Q_i < 0 a form is its base, so its inside lies in the base or in a swelling (f_i > 0) where Q_i >= 0.
//! There moreover F >= -K with K = sum over swellings of f_i (max Q_i)^3, for the sum of the perturbations is at most
//! K:
//!
//! ```text
//! inside  is in  {F >= 0}  or  union over f_i > 0 of ({Q_i >= 0} and {F + K >= 0})
//! ```
//!
//! Each set is where one quadric is not negative. With v the variables that occur in it, Q = c - (v - m)^T S (v - m)
//! and S positive definite, that is an ellipsoid of half-widths sqrt(c (S^-1)_kk) about m: tight, and endless along the
//! variables that do not occur.

use glam::DVec3;

use crate::{Perturbation, Quadric};

/// A box that holds every inside point of a solid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bounds {
    /// The inside lies between two corners. A solid without inside gives its origin twice.
    Finite {
        /// Corner of the smallest coordinates.
        min: DVec3,
        /// Corner of the largest coordinates.
        max: DVec3,
    },
    /// No box was found: the solid reaches, or may reach, to infinity.
    Unbounded,
}

/// A box that may be empty (min > max) or infinite along some axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Extent {
    pub(crate) min: DVec3,
    pub(crate) max: DVec3,
}

/// Smallest pivot, after scaling to a unit diagonal, with which a quadric still counts as an ellipsoid: below it
/// rounding decides about the box.
const PIVOT_MIN: f64 = 1e-6;
/// Rounding of centre and widths, times the largest coordinate and over the smallest pivot: 64 steps, where some 20
/// operations are done.
const PADDING: f64 = 64.0 * f64::EPSILON;
/// The box is widened by this share at least, so that a ray in a tangent plane of the solid starts clearly outside.
const MARGIN: f64 = 1e-9;

impl Extent {
    pub(crate) const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };
    pub(crate) const ALL: Self = Self { min: DVec3::NEG_INFINITY, max: DVec3::INFINITY };

    /// Returns a box around the places where a form is `-depth` or more.
    pub(crate) fn of_form(base: &Quadric, perturbations: &[Perturbation], depth: f64) -> Self {
        let swellings = || perturbations.iter().filter(|p| p.factor > 0.0);
        let height: f64 = swellings().map(|p| p.factor * peak(&p.quadric).max(0.0).powi(3)).sum();
        let raised = |height: f64| {
            let mut raised = *base;
            raised.coefficients[9] += height;
            if height < f64::INFINITY { Self::of_quadric(&raised) } else { Self::ALL }
        };
        let reach = raised(depth + height);
        swellings().fold(raised(depth), |sum, p| sum.union(&reach.intersection(&Self::of_quadric(&p.quadric))))
    }

    /// Returns a box around {Q >= 0}.
    pub(crate) fn of_quadric(quadric: &Quadric) -> Self {
        match Ellipsoid::of(quadric) {
            Some(e) if e.peak + e.peak_error < 0.0 => Self::EMPTY,
            Some(e) => {
                let widths = (e.widths_sq * (e.peak + e.peak_error)).map(f64::sqrt);
                let pad = widths * MARGIN + e.center.abs() * e.error + widths * e.error;
                Self { min: e.center - widths - pad, max: e.center + widths + pad }
            }
            None => Self::ALL,
        }
    }

    /// Whether a point is in the box.
    pub(crate) fn holds(&self, p: DVec3) -> bool {
        self.min.cmple(p).all() && p.cmple(self.max).all()
    }

    pub(crate) fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.min.is_finite() && self.max.is_finite()
    }

    pub(crate) fn union(&self, other: &Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Returns the common part; `EMPTY` itself where there is none, so that later unions stay tight.
    pub(crate) fn intersection(&self, other: &Self) -> Self {
        let common = Self { min: self.min.max(other.min), max: self.max.min(other.max) };
        if common.is_empty() { Self::EMPTY } else { common }
    }

    /// Returns the longest finite side, 0 where there is none.
    pub(crate) fn longest_side(&self) -> f64 {
        let sides = self.max - self.min;
        DVec3::select(sides.is_finite_mask(), sides, DVec3::ZERO).max_element()
    }

    /// Returns the box moved by `offset`, widened by the rounding of the move.
    pub(crate) fn moved(&self, offset: DVec3) -> Self {
        let pad = offset.abs() * f64::EPSILON;
        Self { min: self.min + offset - pad, max: self.max + offset + pad }
    }

    /// Returns the public form of the box; an empty one is the point `home`.
    pub(crate) fn to_bounds(self, home: DVec3) -> Bounds {
        if self.is_empty() {
            Bounds::Finite { min: home, max: home }
        } else if self.is_finite() {
            Bounds::Finite { min: self.min, max: self.max }
        } else {
            Bounds::Unbounded
        }
    }

    /// Returns the part of `o + t d`, `t_min <= t <= t_max`, inside the box.
    #[inline]
    pub(crate) fn clip(&self, o: DVec3, d: DVec3, t_min: f64, t_max: f64) -> Option<(f64, f64)> {
        let (mut near, mut far) = (t_min, t_max);
        for axis in 0..3 {
            let (lo, hi) = (self.min[axis] - o[axis], self.max[axis] - o[axis]);
            if d[axis] == 0.0 {
                // A ray in a face is kept.
                if lo > 0.0 || hi < 0.0 {
                    return None;
                }
            } else {
                let inverse = 1.0 / d[axis];
                let (a, b) = (lo * inverse, hi * inverse);
                near = near.max(a.min(b));
                far = far.min(a.max(b));
            }
        }
        (near < far).then_some((near, far))
    }
}

/// A quadric with a largest value, over the variables that occur in it.
struct Ellipsoid {
    center: DVec3,
    /// Largest value and its rounding error.
    peak: f64,
    peak_error: f64,
    /// Squared half-width per unit of the peak, infinite along variables that do not occur.
    widths_sq: DVec3,
    /// Relative error of centre and widths.
    error: f64,
    /// Power of two that peak and error are to be multiplied with.
    unit: f64,
}

/// Returns the largest value of a quadric, rounded up; infinite where it has none.
fn peak(quadric: &Quadric) -> f64 {
    Ellipsoid::of(quadric).map_or(f64::INFINITY, |e| (e.peak + e.peak_error) * e.unit)
}

impl Ellipsoid {
    /// Completes the square; `None` where the quadratic part is not clearly negative definite in the variables that
    /// occur.
    fn of(quadric: &Quadric) -> Option<Self> {
        // With the largest coefficient between 1 and 2, a common factor of 2^k changes no bit of the box.
        let largest = quadric.coefficients.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
        let unit = f64::from_bits(largest.to_bits() & f64::INFINITY.to_bits());
        let quadric = Quadric { coefficients: quadric.coefficients.map(|c| c / unit) };
        let hessian = quadric.hessian();
        let linear = quadric.linear();
        let occurs = |k: usize| hessian.col(k) != DVec3::ZERO || linear[k] != 0.0;
        // Scaling to a unit diagonal makes pivots comparable; a variable that does not occur becomes an independent one
        // with its centre at 0.
        let mut scale = DVec3::ONE;
        for k in (0..3).filter(|&k| occurs(k)) {
            if hessian.col(k)[k] >= 0.0 {
                return None;
            }
            scale[k] = (-0.5 * hessian.col(k)[k]).sqrt().recip();
        }
        let s = |i: usize, j: usize| if i == j { 1.0 } else { -0.5 * hessian.col(i)[j] * scale[i] * scale[j] };
        let g = 0.5 * linear * scale;

        // Inverse of the scaled matrix by cofactors; its pivots are 1, 1 - s01^2 and determinant / pivot.
        let (s01, s02, s12) = (s(0, 1), s(0, 2), s(1, 2));
        let minor = 1.0 - s01 * s01;
        let determinant = minor - s02 * s02 - s12 * s12 + 2.0 * s01 * s02 * s12;
        let pivot = minor.min(determinant / minor);
        if pivot.is_nan() || pivot < PIVOT_MIN {
            return None;
        }
        let diagonal = DVec3::new(1.0 - s12 * s12, 1.0 - s02 * s02, minor) / determinant;
        let (i01, i02, i12) =
            ((s02 * s12 - s01) / determinant, (s01 * s12 - s02) / determinant, (s01 * s02 - s12) / determinant);
        let v = DVec3::new(
            diagonal.x * g.x + i01 * g.y + i02 * g.z,
            i01 * g.x + diagonal.y * g.y + i12 * g.z,
            i02 * g.x + i12 * g.y + diagonal.z * g.z,
        );

        let error = PADDING / pivot;
        let constant = quadric.coefficients[9];
        let peak = constant + g.dot(v);
        let peak_error =
            error * (constant.abs() + g.abs().dot(v.abs())) + 3.0 * error * error * g.length_squared() / pivot;
        let center = v * scale;
        let mut widths_sq = diagonal * scale * scale;
        for k in (0..3).filter(|&k| !occurs(k)) {
            widths_sq[k] = f64::INFINITY;
        }
        let sound = center.is_finite() && peak.is_finite() && !widths_sq.is_nan();
        sound.then_some(Self { center, peak, peak_error, widths_sq, error, unit })
    }
}
