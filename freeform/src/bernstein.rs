//! The function along one piece of a ray in Bernstein form, where signs of coefficients bound the number of roots.
//!
//! On a piece the function is F(s) + sum f_i Q_i(s)^3 with F and Q_i quadratic in the ray parameter s. Each quadratic
//! has three Bernstein coefficients on a span: its values at the ends and its polar form between them. Products stay in
//! Bernstein form, so the sextic is never expanded in powers, and a sub-span gets its coefficients afresh from the
//! quadratics: nothing is inherited from a wider span but the quadratics themselves.
//!
//! A span with an infinite end, s = s0 + w u/(1-u), has the same coefficients after multiplication by (1-u)^6.
//!
//! # Source
//! Descartes' rule in Bernstein form: Lane and Riesenfeld 1981, Bounds on a polynomial. Product: Farouki and Rajan
//! 1988, Algorithms for polynomials in Bernstein form.

use crate::quadratic::Quadratic;

/// Part of a ray: finite, or infinite at one end. `step` is where an infinite span is cut: so far from its finite end.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Span {
    pub(crate) lo: f64,
    pub(crate) hi: f64,
    pub(crate) step: f64,
}

/// An infinite span that was cut moves its next cut so many times farther: 60 cuts reach 1e72 steps.
const STRIDE: f64 = 16.0;

impl Span {
    /// Cuts the span in two.
    pub(crate) fn halves(self) -> (Self, Self) {
        let middle = if self.lo == f64::NEG_INFINITY {
            self.hi - self.step
        } else if self.hi == f64::INFINITY {
            self.lo + self.step
        } else {
            0.5 * (self.lo + self.hi)
        };
        let step = self.step * STRIDE;
        (Self { hi: middle, step, ..self }, Self { lo: middle, step, ..self })
    }

    /// Returns the largest |s| at which rounding in the span is judged.
    pub(crate) fn reach(self) -> f64 {
        let finite = |s: f64| if s.is_finite() { s.abs() } else { 0.0 };
        let reach = finite(self.lo).max(finite(self.hi));
        if self.lo.is_finite() && self.hi.is_finite() { reach } else { reach + self.step }
    }
}

/// Returns the three Bernstein coefficients of a quadratic on a span.
#[inline]
fn quadratic_on(q: Quadratic, span: Span) -> [f64; 3] {
    let Span { lo, hi, step } = span;
    if lo == f64::NEG_INFINITY {
        [q.a * step * step, -0.5 * step * q.slope(hi), q.at(hi)]
    } else if hi == f64::INFINITY {
        [q.at(lo), 0.5 * step * q.slope(lo), q.a * step * step]
    } else {
        [q.at(lo), q.c + 0.5 * q.b * (lo + hi) + q.a * lo * hi, q.at(hi)]
    }
}

/// Number of coefficients of a sextic.
pub(crate) const COUNT: usize = 7;
/// Binomials of 6.
const BINOMIAL: [f64; COUNT] = [1.0, 6.0, 15.0, 20.0, 15.0, 6.0, 1.0];

/// A quadratic that is cubed, times a factor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cube {
    pub(crate) quadratic: Quadratic,
    pub(crate) factor: f64,
    /// Sum of the absolute terms of the quadratic, as a polynomial in |s|.
    pub(crate) weight: Quadratic,
}

impl Cube {
    pub(crate) const ZERO: Self = Self { quadratic: Quadratic::ZERO, factor: 0.0, weight: Quadratic::ZERO };

    /// Returns what a relative error of the terms of the quadratic, where it is `q`, brings into factor times cube.
    #[inline]
    pub(crate) fn error(&self, q: f64, weight: f64) -> f64 {
        3.0 * self.factor.abs() * (q * q) * weight
    }
}

/// Returns the Bernstein coefficients of `base + sum of cubes` on a span where every quadratic is positive, and the
/// weights of the terms of the first, of those between and of the last: rounding is a share of them.
pub(crate) fn sextic_on(
    base: Quadratic,
    base_weight: Quadratic,
    cubes: &[Cube],
    span: Span,
) -> ([f64; COUNT], [f64; 3]) {
    let reach = span.reach();
    let ends = [
        if span.lo.is_finite() { span.lo.abs() } else { reach },
        reach,
        if span.hi.is_finite() { span.hi.abs() } else { reach },
    ];
    let mut weights = ends.map(|s| base_weight.at(s));
    let [f0, f1, f2] = quadratic_on(base, span);
    // Sum in scaled coefficients (binomial times Bernstein), which multiply like powers. The base times (1, 4, 6, 4,
    // 1), cut off where the span is infinite.
    let f1 = 2.0 * f1;
    let mut sum = if span.lo == f64::NEG_INFINITY {
        [0.0, 0.0, 0.0, 0.0, f0, f1, f2]
    } else if span.hi == f64::INFINITY {
        [f0, f1, f2, 0.0, 0.0, 0.0, 0.0]
    } else {
        [
            f0,
            4.0 * f0 + f1,
            6.0 * f0 + 4.0 * f1 + f2,
            4.0 * (f0 + f2) + 6.0 * f1,
            6.0 * f2 + 4.0 * f1 + f0,
            4.0 * f2 + f1,
            f2,
        ]
    };
    for cube in cubes {
        let factor = cube.factor;
        let [q0, q1, q2] = quadratic_on(cube.quadratic, span);
        // The ends may be roots of q: what rounding makes negative there is zero.
        let (q0, q2) = (q0.max(0.0), q2.max(0.0));
        for ((sum, q), s) in weights.iter_mut().zip([q0, q0.max(q1.abs()).max(q2), q2]).zip(ends) {
            *sum += cube.error(q, cube.weight.at(s));
        }
        let q1 = 2.0 * q1;
        let (p0, p1, p2) = (q0 * q0, q1 * q1, q2 * q2);
        let q02 = q0 * q2;
        sum[0] += factor * (p0 * q0);
        sum[1] += factor * (3.0 * p0 * q1);
        sum[2] += factor * (3.0 * q0 * (p1 + q02));
        sum[3] += factor * (q1 * (p1 + 6.0 * q02));
        sum[4] += factor * (3.0 * q2 * (p1 + q02));
        sum[5] += factor * (3.0 * p2 * q1);
        sum[6] += factor * (p2 * q2);
    }
    for (sum, binomial) in sum.iter_mut().zip(BINOMIAL) {
        *sum /= binomial;
    }
    (sum, weights)
}

/// Signs of a list of coefficients of which those within rounding count as unknown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Signs {
    /// Changes of sign: the number of roots inside is this or less by an even number.
    pub(crate) variations: u32,
    /// First sign that is known: -1, 1, or 0 where none is.
    pub(crate) first: f64,
    /// Last sign that is known.
    pub(crate) last: f64,
    /// Unknown signs may hide more changes: between known ones two, and one where more than the coefficient of an end
    /// is unknown.
    pub(crate) doubtful: bool,
}

/// Returns the signs of Bernstein coefficients; `noise` is the rounding of the first, of those between and of the last.
pub(crate) fn signs(coefficients: &[f64; COUNT], noise: [f64; 3]) -> Signs {
    let mut signs = Signs { variations: 0, first: 0.0, last: 0.0, doubtful: false };
    let mut unknown = 0;
    for (k, &c) in coefficients.iter().enumerate() {
        let noise = match k {
            0 => noise[0],
            k if k == COUNT - 1 => noise[2],
            _ => noise[1],
        };
        // NaN is neither: it counts as unknown.
        let sign = if c > noise {
            1.0
        } else if c < -noise {
            -1.0
        } else {
            unknown += 1;
            continue;
        };
        if signs.first == 0.0 {
            // The first coefficient alone could only hide a root at the very end; two could hide one anywhere.
            signs.doubtful |= unknown > 1;
            signs.first = sign;
        } else {
            // One unknown between different signs changes nothing.
            signs.doubtful |= unknown > 1 || (unknown == 1 && signs.last == sign);
        }
        signs.variations += u32::from(signs.last == -sign);
        signs.last = sign;
        unknown = 0;
    }
    signs.doubtful |= signs.first != 0.0 && unknown > 1;
    signs
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Value at u of Bernstein coefficients, by de Casteljau.
    fn evaluate(mut c: [f64; COUNT], u: f64) -> f64 {
        for n in (1..COUNT).rev() {
            for k in 0..n {
                c[k] += u * (c[k + 1] - c[k]);
            }
        }
        c[0]
    }

    #[test]
    fn bernstein_form_equals_the_function() {
        let base = Quadratic { a: 0.3, b: -1.0, c: 0.2 };
        let cube = |a, b, c, factor| Cube { quadratic: Quadratic { a, b, c }, factor, weight: Quadratic::ZERO };
        let cubes = [cube(-1.0, 0.5, 3.0, 0.7), cube(0.25, 0.1, 1.0, -0.2)];
        let sum =
            |cubes: &[Cube], s| base.at(s) + cubes.iter().map(|c| c.factor * c.quadratic.at(s).powi(3)).sum::<f64>();
        let on = |cubes, lo, hi, step| sextic_on(base, Quadratic::ZERO, cubes, Span { lo, hi, step }).0;
        let finite = on(&cubes, -0.5, 1.5, 1.0);
        let f = |s| sum(&cubes, s);
        // On infinite spans a quadratic must be positive at infinity to take part.
        let up = on(&cubes[1..], -0.5, f64::INFINITY, 2.0);
        let down = on(&cubes[1..], f64::NEG_INFINITY, 0.5, 2.0);
        let g = |s| sum(&cubes[1..], s);
        for k in 0..=10 {
            let u = f64::from(k) / 10.0;
            assert!((evaluate(finite, u) - f(-0.5 + 2.0 * u)).abs() < 1e-13, "finite span at {u}");
            if k < 10 {
                let expected = g(-0.5 + 2.0 * u / (1.0 - u)) * (1.0 - u).powi(6);
                assert!((evaluate(up, u) - expected).abs() < 1e-13, "upward span at {u}");
                let expected = g(0.5 - 2.0 * u / (1.0 - u)) * (1.0 - u).powi(6);
                assert!((evaluate(down, 1.0 - u) - expected).abs() < 1e-13, "downward span at {u}");
            }
        }
    }

    #[test]
    fn signs_skip_noise_and_nan() {
        let s = signs(&[1e-17, 1.0, -1e-17, f64::NAN, 2.0, -1.0, 0.0], [1e-16; 3]);
        assert_eq!(s, Signs { variations: 1, first: 1.0, last: -1.0, doubtful: true }, "one change among the known");
        let s = signs(&[1e-17, 1.0, 1e-17, -1.0, -1.0, -1.0, 1e-17], [0.0, 1e-16, 1e-16]);
        assert_eq!(s, Signs { variations: 1, first: 1.0, last: -1.0, doubtful: false }, "one unknown at a change");
        let s = signs(&[1e-17, -1.0, -1.0, -1.0, -1.0, -1.0, 1e-17], [1e-16; 3]);
        assert_eq!(s, Signs { variations: 0, first: -1.0, last: -1.0, doubtful: false }, "one unknown at each end");
        for coefficients in [[1e-17, 1e-17, -1.0, -1.0, -1.0, -1.0, -1.0], [-1.0, -1.0, -1.0, -1.0, -1.0, 1e-17, 1e-17]]
        {
            let s = signs(&coefficients, [1e-16; 3]);
            assert_eq!(s, Signs { variations: 0, first: -1.0, last: -1.0, doubtful: true }, "two at one end");
        }
        let s = signs(&[0.0; COUNT], [0.0; 3]);
        assert_eq!(s, Signs { variations: 0, first: 0.0, last: 0.0, doubtful: false }, "nothing known");
    }
}
