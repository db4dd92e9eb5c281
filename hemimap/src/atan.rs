//! The arctangent on [-1, 1] as one odd polynomial, so that a loop over it vectorises and every width gives the same bits.
//!
//! ```text
//! atan(x) = x + x s P(s),   s = x^2,   P of degree 7
//! ```
//!
//! P is the minimax fit of (atan(x)/x - 1)/s in the relative error of atan, held to the exact value at s = 1 (Remez).

/// P from the constant term upwards; before rounding to `f32` its relative error is 1.8e-8.
const P: [f32; 8] = [
    -0.333_331_44,
    0.199_935_42,
    -0.142_088_62,
    0.106_562_06,
    -0.075_289_845,
    0.042_911_19,
    -0.016_167_367,
    0.002_866_769,
];

/// Returns the arctangent of `x` in radians.
#[inline]
#[must_use]
pub fn atan_unit(x: f32) -> f32 {
    let s = x * x;
    let mut p = P[7];
    p = p * s + P[6];
    p = p * s + P[5];
    p = p * s + P[4];
    p = p * s + P[3];
    p = p * s + P[2];
    p = p * s + P[1];
    p = p * s + P[0];
    x + x * (s * p)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::FRAC_PI_4;

    #[test]
    fn one_gives_an_eighth_turn() {
        assert_eq!(atan_unit(1.0), FRAC_PI_4, "the edge of the domain");
    }
}
