//! Interval arithmetic with outward rounding: a range holds every value that exact arithmetic could give.
//!
//! Each result of the machine is at most half a step off, so one step outwards by `next_down` and `next_up` is enough.
//! NaN never decides anything: a range with NaN has no sign.

use std::ops::{Add, Mul, Neg, Sub};

use crate::psi::{Psi, Valued};

/// All numbers from `lo` to `hi`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Range {
    pub(crate) lo: f64,
    pub(crate) hi: f64,
}

impl Range {
    pub(crate) const ZERO: Self = Self { lo: 0.0, hi: 0.0 };

    /// Returns the range of one number.
    #[inline]
    pub(crate) fn exactly(x: f64) -> Self {
        Self { lo: x, hi: x }
    }

    /// Returns the range between two rounded numbers.
    #[inline]
    fn outwards(lo: f64, hi: f64) -> Self {
        Self { lo: lo.next_down(), hi: hi.next_up() }
    }

    /// Returns all numbers that differ from 0 by `radius` at most.
    #[inline]
    pub(crate) fn about_zero(radius: f64) -> Self {
        Self { lo: -radius, hi: radius }
    }

    #[inline]
    pub(crate) fn hull(self, other: Self) -> Self {
        Self { lo: self.lo.min(other.lo), hi: self.hi.max(other.hi) }
    }

    /// Returns what is in both; where rounding left them apart, the first.
    #[inline]
    pub(crate) fn common(self, other: Self) -> Self {
        let both = Self { lo: self.lo.max(other.lo), hi: self.hi.min(other.hi) };
        if both.lo <= both.hi { both } else { self }
    }

    /// Returns 1 or -1 where all numbers have that sign, else 0.
    #[inline]
    pub(crate) fn sign(self) -> f64 {
        if self.lo > 0.0 {
            1.0
        } else if self.hi < 0.0 {
            -1.0
        } else {
            0.0
        }
    }

    #[inline]
    pub(crate) fn width(self) -> f64 {
        self.hi - self.lo
    }

    #[inline]
    pub(crate) fn square(self) -> Self {
        let (a, b) = (self.lo * self.lo, self.hi * self.hi);
        let least = if self.lo <= 0.0 && self.hi >= 0.0 { 0.0 } else { a.min(b).next_down().max(0.0) };
        Self { lo: least, hi: a.max(b).next_up() }
    }

    #[inline]
    pub(crate) fn positive_part(self) -> Self {
        // What overflowed to no number may be anything.
        Self { lo: self.lo.max(0.0), hi: if self.hi.is_nan() { f64::INFINITY } else { self.hi.max(0.0) } }
    }

    #[inline]
    fn sqrt(self) -> Self {
        Self { lo: self.lo.max(0.0).sqrt().next_down().max(0.0), hi: self.hi.sqrt().next_up() }
    }

    /// Returns the quotient by a range of positive numbers.
    #[inline]
    fn over(self, d: Self) -> Self {
        let lo = (self.lo / d.lo).min(self.lo / d.hi);
        let hi = (self.hi / d.lo).max(self.hi / d.hi);
        Self::outwards(lo, hi)
    }

    #[inline]
    fn abs(self) -> Self {
        if self.lo >= 0.0 {
            self
        } else if self.hi <= 0.0 {
            -self
        } else {
            Self { lo: 0.0, hi: self.hi.max(-self.lo) }
        }
    }
}

impl Add for Range {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self::outwards(self.lo + other.lo, self.hi + other.hi)
    }
}

impl Sub for Range {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self::outwards(self.lo - other.hi, self.hi - other.lo)
    }
}

impl Neg for Range {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self { lo: -self.hi, hi: -self.lo }
    }
}

impl Mul for Range {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        let (a, b, c, d) = (self.lo * other.lo, self.lo * other.hi, self.hi * other.lo, self.hi * other.hi);
        Self::outwards(a.min(b).min(c).min(d), a.max(b).max(c).max(d))
    }
}

/// The values of a function of the ray parameter over a stretch, and those of its derivative.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RangeSlope {
    pub(crate) value: Range,
    pub(crate) slope: Range,
}

impl Valued for Range {
    fn union(psi: Psi, f: Self, g: Self) -> Self {
        // Psi grows with both arguments.
        Self { lo: psi_at(psi, f.lo, g.lo).lo, hi: psi_at(psi, f.hi, g.hi).hi }
    }

    fn complement(self) -> Self {
        -self
    }
}

impl Valued for RangeSlope {
    fn union(psi: Psi, f: Self, g: Self) -> Self {
        let value = Range::union(psi, f.value, g.value);
        let share = match psi {
            Psi::Maximum if f.value.lo >= g.value.hi => Range::exactly(1.0),
            Psi::Maximum if f.value.hi <= g.value.lo => Range::ZERO,
            Psi::Maximum => Range { lo: 0.0, hi: 1.0 },
            Psi::Blend { width } => {
                let apart = f.value - g.value;
                Range { lo: blend_share(apart.lo, width).lo, hi: blend_share(apart.hi, width).hi }
            }
            Psi::RFunction => {
                let one = Range::exactly(1.0);
                let slope = (one + cosine(f.value, g.value)) * f.slope + (one + cosine(g.value, f.value)) * g.slope;
                return Self { value, slope };
            }
        };
        // The slope is share f' + (1 - share) g': its extremes are at those of the share.
        let at = |share: f64| {
            let share = Range::exactly(share);
            share * f.slope + (Range::exactly(1.0) - share) * g.slope
        };
        let slope = match share {
            Range { lo: 1.0, .. } => f.slope,
            Range { hi: 0.0, .. } => g.slope,
            Range { lo: 0.0, hi: 1.0 } => f.slope.hull(g.slope),
            share => at(share.lo).hull(at(share.hi)),
        };
        Self { value, slope }
    }

    fn complement(self) -> Self {
        Self { value: -self.value, slope: -self.slope }
    }
}

/// Returns a range around psi(f, g).
fn psi_at(psi: Psi, f: f64, g: f64) -> Range {
    let (a, b) = (Range::exactly(f), Range::exactly(g));
    match psi {
        Psi::Maximum => Range::exactly(f.max(g)),
        Psi::RFunction => {
            let (sum, root) = (a + b, (a.square() + b.square()).sqrt());
            // As in `Psi::value`: the sum of two negative values cancels the root.
            if sum.hi < 0.0 { (Range::exactly(-2.0) * a * b).over(root - sum) } else { sum + root }
        }
        Psi::Blend { width } if (f - g).abs() > width.next_up() => Range::exactly(f.max(g)),
        Psi::Blend { width } => {
            let h = (Range::exactly(1.0) - (a - b).abs().over(Range::exactly(width))).positive_part();
            let sixth = Range::exactly(width).over(Range::exactly(6.0));
            Range::exactly(f.max(g)) + sixth * (h.square() * h)
        }
    }
}

/// Returns a range around the share of f in the slope of a blend where f - g is `apart`; it grows from 0 to 1.
fn blend_share(apart: f64, width: f64) -> Range {
    if apart.abs() >= width {
        return Range::exactly(if apart > 0.0 { 1.0 } else { 0.0 });
    }
    let apart_abs = Range::exactly(apart.abs());
    let h = (Range::exactly(1.0) - apart_abs.over(Range::exactly(width))).positive_part();
    let less = Range::exactly(0.5) * h.square();
    let share = if apart >= 0.0 { Range::exactly(1.0) - less } else { less };
    Range { lo: share.lo.max(0.0), hi: share.hi.min(1.0) }
}

/// Returns a range around f / sqrt(f^2 + g^2), which lies between -1 and 1.
fn cosine(f: Range, g: Range) -> Range {
    let g = g.abs();
    let all = Range { lo: -1.0, hi: 1.0 };
    // It grows with f; with |g| it shrinks towards 0.
    let at = |f: f64, g: f64| {
        let root = (Range::exactly(f).square() + Range::exactly(g).square()).sqrt();
        if root.lo > 0.0 { Range::exactly(f).over(root) } else { all }
    };
    let lo = if f.lo >= 0.0 { at(f.lo, g.hi).lo } else { at(f.lo, g.lo).lo };
    let hi = if f.hi >= 0.0 { at(f.hi, g.lo).hi } else { at(f.hi, g.hi).hi };
    Range { lo, hi }.common(all)
}

#[cfg(test)]
mod tests {
    use num_rational::BigRational;
    use num_traits::Signed;

    use super::*;

    /// Numbers in [-1, 1) that look random.
    fn numbers() -> impl Iterator<Item = f64> {
        let mut state = 1_u64;
        std::iter::repeat_with(move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            f64::from((state >> 33) as u32) / f64::from(1_u32 << 30) - 1.0
        })
    }

    #[test]
    fn ranges_hold_what_they_are_ranges_of() {
        let mut numbers = numbers();
        let mut next = || numbers.next().unwrap();
        for psi in [Psi::Maximum, Psi::RFunction, Psi::Blend { width: 0.6 }] {
            for k in 0..20_000_u32 {
                let size = 10_f64.powi(-5 * i32::from(k % 3 == 1) - 9 * i32::from(k % 3 == 2));
                let mut around = |x: f64| {
                    let (a, b) = (next().abs() * size, next().abs() * size);
                    (Range { lo: x - a, hi: x + b }, move |u: f64| x - a + u.abs() * (a + b) * (1.0 - 1e-15))
                };
                let (x, y) = (f64::from(k % 11) * 0.1 - 0.5, f64::from(k % 7) * 0.1 - 0.3);
                let ((f, in_f), (g, in_g)) = (around(x), around(y));
                let ((df, in_df), (dg, in_dg)) = (around(y), around(-x));
                let joined =
                    RangeSlope::union(psi, RangeSlope { value: f, slope: df }, RangeSlope { value: g, slope: dg });
                let exact = psi.join(in_f(next()), in_g(next()));
                let slope = exact.shares[0] * in_df(next()) + exact.shares[1] * in_dg(next());
                let value = joined.value;
                assert!(value.lo <= exact.value && exact.value <= value.hi, "{psi:?}: {} in {value:?}", exact.value);
                // The slope was computed with a few roundings of its own.
                let (a, b) = (joined.slope.lo - 1e-14, joined.slope.hi + 1e-14);
                assert!(a <= slope && slope <= b, "{psi:?}: slope {slope} in {:?}", joined.slope);
            }
        }
    }

    /// The number itself.
    fn exact(x: f64) -> BigRational {
        BigRational::from_float(x).expect("finite")
    }

    #[test]
    fn joined_ranges_hold_the_exact_values() {
        let mut numbers = numbers();
        let (zero, one, two) = (exact(0.0), exact(1.0), exact(2.0));
        for k in 0..4000_u32 {
            let mut around = |x: f64| {
                let size = [0.0, 1e-15, 1e-7, 0.1][k as usize % 4];
                let (lo, hi) = (x - size * numbers.next().unwrap().abs(), x + size * numbers.next().unwrap().abs());
                (Range { lo, hi }, if k.is_multiple_of(3) { lo } else { hi })
            };
            let (x, y) = (f64::from(k % 11) * 0.1 - 0.5, f64::from(k % 7) * 0.1 - 0.3);
            let ((f, in_f), (g, in_g), (df, in_df), (dg, in_dg)) = (around(x), around(y), around(y), around(-x));
            let [in_f, in_g, in_df, in_dg] = [in_f, in_g, in_df, in_dg].map(exact);
            let join = |psi: Psi| {
                RangeSlope::union(psi, RangeSlope { value: f, slope: df }, RangeSlope { value: g, slope: dg })
            };
            // f + g + sqrt(f^2 + g^2): both ends less f + g, squared where they are positive, against f^2 + g^2.
            let value = join(Psi::RFunction).value;
            let (sum, sum_sq) = (&in_f + &in_g, &in_f * &in_f + &in_g * &in_g);
            let [lo, hi] = [value.lo, value.hi].map(|end| exact(end) - &sum);
            assert!(lo <= zero || &lo * &lo <= sum_sq, "{x} and {y}: below {value:?}");
            assert!(hi >= zero && &hi * &hi >= sum_sq, "{x} and {y}: above {value:?}");
            for width in [0.07, 0.6, 3.0] {
                let RangeSlope { value, slope } = join(Psi::Blend { width });
                let width = exact(width);
                let apart = &in_f - &in_g;
                let h = (&one - apart.abs() / &width).max(zero.clone());
                let exact_value = in_f.clone().max(in_g.clone()) + &width / exact(6.0) * &h * &h * &h;
                assert!(exact(value.lo) <= exact_value && exact_value <= exact(value.hi), "{x} and {y}: {value:?}");
                let less = &h * &h / &two;
                let share = if apart < zero { less } else { &one - less };
                let exact_slope = &share * &in_df + (&one - &share) * &in_dg;
                assert!(exact(slope.lo) <= exact_slope && exact_slope <= exact(slope.hi), "{x} and {y}: {slope:?}");
            }
        }
    }

    #[test]
    fn arithmetic_rounds_outwards() {
        let third = Range::exactly(1.0).over(Range::exactly(3.0));
        let one = third * Range::exactly(3.0);
        assert!(one.lo < 1.0 && one.hi > 1.0 && one.hi - one.lo < 4.0 * f64::EPSILON, "{one:?}");
        assert_eq!((one - one).sign(), 0.0, "nothing is decided about zero");
        assert_eq!(Range { lo: -2.0, hi: 1.0 }.square().lo, 0.0, "a square is not negative");
        assert_eq!(Range { lo: f64::NAN, hi: f64::NAN }.sign(), 0.0, "NaN has no sign");
    }
}
