//! A quadric along a ray with bounds of all roundings: the range of its values and of its slopes on any stretch.
//!
//! # Source
//! Higham 2002, Accuracy and stability of numerical algorithms, section 3.1.

use glam::DVec3;

use crate::{
    Quadric, Ray,
    psi::Slope,
    quadratic::Quadratic,
    range::{Range, RangeSlope},
};

/// A quadric along the ray, `a s^2 + b s + c`, and what its coefficients may be off at most.
///
/// Ranges of quadratics are what a ray asks most. So they have no interval arithmetic of their own but one bound of all
/// roundings together: no branch, and an eighth of the time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Along {
    quadratic: Quadratic,
    /// Errors of the coefficients, and room for the roundings of one evaluation.
    error: Quadratic,
}

/// A coefficient, after at most 16 roundings of half a step, is off by at most this share of its absolute terms.
const SUM_ROUNDING: f64 = 8.0 * f64::EPSILON;
/// The same of the few operations between coefficients and a range.
const EVALUATION_ROUNDING: f64 = 4.0 * f64::EPSILON;

impl Along {
    /// Takes the quadric along `p + s d`, where each coordinate of `p` may be off by that of `error`.
    #[inline]
    pub(crate) fn new(quadric: &Quadric, p: DVec3, error: DVec3, d: DVec3) -> Self {
        let quadratic = quadric.along(p, d);
        let weight = quadric.weight_along(p.abs() + error, d);
        // Of an error e of p, b takes (H d) e and c the gradient times e, H the second derivatives.
        let moved = quadric.weight_moved(p.abs() + error, d, error);
        let share = SUM_ROUNDING + EVALUATION_ROUNDING;
        let error = Quadratic { a: share * weight.a, b: share * weight.b + moved.b, c: share * weight.c + moved.c };
        Self { quadratic, error }
    }

    /// Returns the values and slopes within `radius` of `m`.
    #[inline]
    pub(crate) fn about(&self, m: f64, radius: f64) -> RangeSlope {
        let (a, value, slope) = (self.quadratic.a, self.quadratic.at(m), self.quadratic.slope(m));
        let (value_error, slope_error) = (self.error.at(m.abs()), self.error.slope(m.abs()));
        // value + slope h + a h^2 and slope + 2 a h, for |h| up to the radius.
        let (linear, square) = ((slope.abs() + slope_error) * radius, (a.abs() + self.error.a) * radius * radius);
        let error =
            value_error + EVALUATION_ROUNDING * (value.abs() + linear + square) + self.error.a * radius * radius;
        let down = linear + error + if a < 0.0 { square } else { 0.0 };
        let up = linear + error + if a > 0.0 { square } else { 0.0 };
        let turn = 2.0 * (a.abs() + self.error.a) * radius;
        let turn = turn + slope_error + EVALUATION_ROUNDING * (slope.abs() + turn);
        RangeSlope {
            value: Range { lo: value - down, hi: value + up },
            slope: Range { lo: slope - turn, hi: slope + turn },
        }
    }

    /// Returns value and slope at `s`, rounded.
    #[inline]
    pub(crate) fn at(&self, s: f64) -> Slope {
        Slope { value: self.quadratic.at(s), slope: self.quadratic.slope(s) }
    }
}

/// Returns the point of the ray at `t` as seen from `home`, and how far each of its coordinates may be off.
pub(crate) fn seen_from(home: DVec3, ray: &Ray, t: f64) -> (DVec3, DVec3) {
    let (origin, step) = (ray.origin - home, t * ray.direction);
    let p = origin + step;
    (p, f64::EPSILON * (origin.abs() + step.abs() + p.abs()))
}

#[cfg(test)]
#[expect(clippy::cast_possible_truncation, reason = "floats that are whole and fit")]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_quadratics_hold_what_integers_say() {
        let mut state = 1_u64;
        // Whole numbers below 2^bits.
        let mut whole = |bits: u32| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            i128::from((state as i64) >> (63 - bits))
        };
        let number = |x: i128| x as f64;
        for k in 0..100_000_u32 {
            // So many bits that most sums and products round, and that exact ones fit 128. Some rays pass close by, so
            // that all digits of a place cancel.
            let bits = 19 + k % 10;
            let mut vector = |bits: u32| [whole(bits), whole(bits), whole(bits)];
            let (home, d, t, s) =
                (vector(53), vector(bits), vector(bits)[0], vector(if k % 2 == 0 { 1 } else { bits })[0]);
            let near = [0, 1, 2].map(|i| number(home[i] - t * d[i]) as i128);
            let origin = if k % 3 == 0 { near } else { vector(53) };
            let float = |x: [i128; 3]| DVec3::from_array(x.map(number));
            let coefficients: [i128; 10] = std::array::from_fn(|i| vector(if i < 6 { 8 } else { 40 })[0]);
            let ray = Ray::new(float(origin), float(d));
            let (p, error) = seen_from(float(home), &ray, number(t));
            let quadric = Quadric { coefficients: coefficients.map(number) };
            let along = Along::new(&quadric, p, error, ray.direction);

            let [x, y, z] = [0, 1, 2].map(|i| origin[i] - home[i] + (t + s) * d[i]);
            let [a, b, c, d12, d13, d23, l1, l2, l3, rest] = coefficients;
            let value = a * x * x + b * y * y + c * z * z + d12 * x * y + d13 * x * z + d23 * y * z;
            let value = value + l1 * x + l2 * y + l3 * z + rest;
            let slope = (2 * a * x + d12 * y + d13 * z + l1) * d[0]
                + (d12 * x + 2 * b * y + d23 * z + l2) * d[1]
                + (d13 * x + d23 * y + 2 * c * z + l3) * d[2];
            let holds = |range: Range, x: i128| range.lo.floor() as i128 <= x && x <= range.hi.ceil() as i128;
            for radius in [0.0, 1.0, number(whole(bits)).abs()] {
                let middle = number(s) + radius * if k % 2 == 0 { 1.0 } else { -1.0 };
                let range = along.about(middle, radius);
                assert!(holds(range.value, value), "ray {k}, {radius}: {value} in {:?}", range.value);
                assert!(holds(range.slope, slope), "ray {k}, {radius}: slope {slope} in {:?}", range.slope);
                let far = p.abs() + error;
                let weight = quadric.weight_along(far, ray.direction).at(number(s).abs());
                let moved = quadric.weight_moved(far, ray.direction, error).at(number(s).abs());
                let rounding = 64.0 * f64::EPSILON * weight + 4.0 * moved;
                assert!(
                    radius > 0.0 || range.value.hi - range.value.lo < rounding,
                    "ray {k}: no wider than rounding asks"
                );
            }
        }
    }
}
