//! Exact numbers m 2^e: every f64 is one, and sums, differences and products stay among them.

use std::cmp::Ordering;
use std::ops::{Add, Mul, Sub};

use num_bigint::BigInt;
use num_traits::{Signed, Zero};

#[derive(Debug, Clone)]
pub(crate) struct Dyadic {
    pub(crate) mantissa: BigInt,
    pub(crate) exponent: i64,
}

impl Dyadic {
    pub(crate) fn zero() -> Self {
        Self { mantissa: BigInt::zero(), exponent: 0 }
    }

    pub(crate) fn sign(&self) -> i32 {
        match self.mantissa.sign() {
            num_bigint::Sign::Minus => -1,
            num_bigint::Sign::NoSign => 0,
            num_bigint::Sign::Plus => 1,
        }
    }

    pub(crate) fn power_of_two(exponent: i64) -> Self {
        Self { mantissa: BigInt::from(1), exponent }
    }

    pub(crate) fn half(mut self) -> Self {
        self.exponent -= 1;
        self
    }

    /// Returns the mantissa at a lower exponent.
    pub(crate) fn at_exponent(&self, exponent: i64) -> BigInt {
        &self.mantissa << usize::try_from(self.exponent - exponent).expect("the exponent is lower")
    }

    pub(crate) fn compare(&self, other: &Self) -> Ordering {
        (self - other).sign().cmp(&0)
    }
}

impl From<f64> for Dyadic {
    fn from(x: f64) -> Self {
        assert!(x.is_finite(), "{x} is a number");
        let bits = x.to_bits();
        let (raw, fraction) = ((bits >> 52) & 0x7ff, bits & ((1 << 52) - 1));
        let mantissa = BigInt::from(if raw == 0 { fraction } else { fraction | 1 << 52 });
        let exponent = i64::try_from(raw.max(1)).expect("eleven bits") - 1075;
        Self { mantissa: if x < 0.0 { -mantissa } else { mantissa }, exponent }
    }
}

impl Add for &Dyadic {
    type Output = Dyadic;

    fn add(self, other: Self) -> Dyadic {
        if self.mantissa.is_zero() {
            return other.clone();
        }
        if other.mantissa.is_zero() {
            return self.clone();
        }
        let exponent = self.exponent.min(other.exponent);
        Dyadic { mantissa: self.at_exponent(exponent) + other.at_exponent(exponent), exponent }
    }
}

impl Sub for &Dyadic {
    type Output = Dyadic;

    fn sub(self, other: Self) -> Dyadic {
        self + &Dyadic { mantissa: -&other.mantissa, exponent: other.exponent }
    }
}

impl Mul for &Dyadic {
    type Output = Dyadic;

    fn mul(self, other: Self) -> Dyadic {
        Dyadic { mantissa: &self.mantissa * &other.mantissa, exponent: self.exponent + other.exponent }
    }
}

/// A polynomial, constant first.
pub(crate) type Polynomial = Vec<Dyadic>;

pub(crate) fn add(a: &[Dyadic], b: &[Dyadic]) -> Polynomial {
    let zero = Dyadic::zero();
    (0..a.len().max(b.len())).map(|k| a.get(k).unwrap_or(&zero) + b.get(k).unwrap_or(&zero)).collect()
}

pub(crate) fn multiply(a: &[Dyadic], b: &[Dyadic]) -> Polynomial {
    let mut product = vec![Dyadic::zero(); a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            product[i + j] = &product[i + j] + &(x * y);
        }
    }
    product
}

pub(crate) fn value(p: &[Dyadic], t: &Dyadic) -> Dyadic {
    p.iter().rev().fold(Dyadic::zero(), |sum, c| &(&sum * t) + c)
}

/// Returns the polynomial times a power of two, with integer coefficients and without leading zeros.
pub(crate) fn to_integers(p: &[Dyadic]) -> Vec<BigInt> {
    let nonzero = || p.iter().filter(|c| c.sign() != 0);
    let Some(exponent) = nonzero().map(|c| c.exponent).min() else { return Vec::new() };
    let length = p.iter().rposition(|c| c.sign() != 0).map_or(0, |k| k + 1);
    let zero = |c: &Dyadic| c.mantissa.is_zero();
    p[..length].iter().map(|c| if zero(c) { BigInt::zero() } else { c.at_exponent(exponent) }).collect()
}

/// The chain of Sturm of a polynomial: the number of distinct real roots in (a, b] is the loss of sign variations from
/// a to b.
pub(crate) struct Sturm(Vec<Vec<BigInt>>);

impl Sturm {
    pub(crate) fn new(p: &[Dyadic]) -> Self {
        let first = primitive(to_integers(p));
        let derivative = first.iter().enumerate().skip(1).map(|(k, c)| c * BigInt::from(k)).collect();
        let mut chain = vec![first, primitive(derivative)];
        while chain.last().is_some_and(|last| last.len() > 1) {
            let remainder = negated_remainder(&chain[chain.len() - 2], &chain[chain.len() - 1]);
            chain.push(primitive(remainder));
        }
        chain.retain(|p| !p.is_empty());
        Self(chain)
    }

    pub(crate) fn variations(&self, t: &Dyadic) -> i32 {
        let (mut count, mut last) = (0, 0);
        for p in &self.0 {
            // Sign of sum c_k (m 2^e)^k, times 2^(-e n) where e is negative.
            let value = p
                .iter()
                .rev()
                .fold(Dyadic::zero(), |sum, c| &(&sum * t) + &Dyadic { mantissa: c.clone(), exponent: 0 });
            let sign = value.sign();
            if sign != 0 {
                count += i32::from(last == -sign);
                last = sign;
            }
        }
        count
    }
}

/// Divides by the largest common power of two.
fn primitive(p: Vec<BigInt>) -> Vec<BigInt> {
    let twos = p.iter().filter_map(BigInt::trailing_zeros).min().unwrap_or(0);
    p.into_iter().map(|c| c >> twos).collect()
}

/// Returns minus the remainder of a / b, times a positive number.
fn negated_remainder(a: &[BigInt], b: &[BigInt]) -> Vec<BigInt> {
    let mut rest = a.to_vec();
    let Some(lead) = b.last() else { return Vec::new() };
    while rest.len() >= b.len() {
        let top = rest.pop().expect("not empty");
        let shift = rest.len() + 1 - b.len();
        // rest * |lead| - sign(lead) top x^shift b: the factor is positive, so signs stay.
        let factor = if lead.is_negative() { -&top } else { top };
        for c in &mut rest {
            *c *= lead.abs();
        }
        for (k, c) in b[..b.len() - 1].iter().enumerate() {
            rest[shift + k] -= &factor * c;
        }
    }
    while rest.last().is_some_and(BigInt::is_zero) {
        rest.pop();
    }
    rest.into_iter().map(|c| -c).collect()
}
