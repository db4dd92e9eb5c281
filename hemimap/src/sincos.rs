//! Sine and cosine of angles up to an eighth turn, as polynomials: all that the concentric map needs, and, turned by
//! quarters, of any.
//!
//! ```text
//! sin(t pi/4) = t (pi/4 + s S(s)),   cos(t pi/4) = 1 + s C(s),   s = t^2
//! ```
//!
//! S (degree 2) and C (degree 3) are minimax fits in the relative error of the result, held to the exact value at s = 1
//! (Remez; errors 4.4e-9 and 7.2e-11). Rounded to `f32`, their last digits were then chosen among the neighbours so
//! that at t = 1 both are the `f32` next to sqrt(1/2): the two halves of the concentric map then meet in the same bits.

use std::f32::consts::FRAC_PI_4;

/// S from the constant term upwards.
const S: [f32; 3] = [-0.080_745_47, 0.002_490_009_6, -3.595_118_7e-5];
/// C from the constant term upwards.
const C: [f32; 4] = [-0.308_425_1, 0.015_854_284, -0.000_325_934_6, 3.528_875e-6];

/// Returns (sin, cos) of the angle `t` pi/4, for |t| <= 1.
///
/// Measured over all `f32` in [2^-8, 1]: sin within 7.9e-8 (1.7 units in the last place) and cos within 6.9e-8 of the
/// exact values, sin^2 + cos^2 within 1.9e-7 of 1. sin(-t) = -sin(t) and cos(-t) = cos(t) hold for the bits.
#[inline]
#[must_use]
pub(crate) fn sin_cos_eighth_turn(t: f32) -> (f32, f32) {
    let s = t * t;
    let sin = t * (((S[2] * s + S[1]) * s + S[0]) * s + FRAC_PI_4);
    let cos = 1.0 + s * (((C[3] * s + C[2]) * s + C[1]) * s + C[0]);
    (sin, cos)
}

/// Returns (sin, cos) of an angle given in whole turns, which is how a uniform number chooses an azimuth.
///
/// No function of the platform is called, so that all systems have the same bits. Each is within 1.2e-7 of the exact
/// value for turns in [-1, 1]; beyond, the rounding of the angle itself is more, and from 2^20 turns on neither means
/// anything. What is not finite gives NaN.
///
/// ```
/// let (sin, cos) = hemimap::sin_cos_turn(0.25);
/// assert_eq!((sin, cos.abs()), (1.0, 0.0));
/// ```
#[inline]
#[must_use]
pub fn sin_cos_turn(turns: f32) -> (f32, f32) {
    /// From 2^23 to 2^24 neighbouring numbers are 1 apart, so adding a number amid them rounds to a whole number, also
    /// below 0, and leaves that in the low bits.
    const ROUND: f32 = 12_582_912.0;
    let quarters = 4.0 * turns;
    let shifted = quarters + ROUND;
    let (sin, cos) = sin_cos_eighth_turn(2.0 * (quarters - (shifted - ROUND)));
    let whole = shifted.to_bits();
    let (sin, cos) = if whole & 1 == 0 { (sin, cos) } else { (cos, -sin) };
    if whole & 2 == 0 { (sin, cos) } else { (-sin, -cos) }
}

#[cfg(test)]
#[expect(clippy::disallowed_methods, reason = "the platform's f64 functions are the oracle")]
mod tests {
    use super::*;
    use std::f32::consts::FRAC_1_SQRT_2;

    #[test]
    fn turns_agree_with_the_platform() {
        for i in -20_000..=20_000i16 {
            let turns = f32::from(i) / 20_000.0;
            let (sin, cos) = sin_cos_turn(turns);
            let (exact_sin, exact_cos) = (f64::from(turns) * std::f64::consts::TAU).sin_cos();
            let off = (f64::from(sin) - exact_sin).abs().max((f64::from(cos) - exact_cos).abs());
            assert!(off < 1.2e-7, "{turns}: off by {off}");
        }
        let quarters = [0.0f32, 0.25, 0.5, 0.75, 1.0].map(sin_cos_turn);
        assert_eq!(quarters, [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0), (0.0, 1.0)], "exact at quarters");
    }

    #[test]
    fn error_stays_below_the_stated_bound() {
        let one = 1f32.to_bits();
        for bits in (one - (26 << 23)..=one).step_by(61) {
            let t = f32::from_bits(bits);
            let angle = f64::from(t) * std::f64::consts::FRAC_PI_4;
            let (sin, cos) = sin_cos_eighth_turn(t);
            let (sin, cos) = (f64::from(sin), f64::from(cos));
            let off = [(sin - angle.sin()).abs(), (cos - angle.cos()).abs()];
            assert!(off[0] <= 7.9e-8 && off[1] <= 6.9e-8, "at {t}: {off:?}");
            assert!(off[0] <= 2e-7 * angle.sin(), "relative error of the sine at {t}");
            assert!((sin * sin + cos * cos - 1.0).abs() <= 1.9e-7, "length at {t}");
        }
    }

    #[test]
    fn both_are_the_root_of_a_half_at_the_end() {
        assert_eq!(sin_cos_eighth_turn(1.0), (FRAC_1_SQRT_2, FRAC_1_SQRT_2), "at +1");
        assert_eq!(sin_cos_eighth_turn(-1.0), (-FRAC_1_SQRT_2, FRAC_1_SQRT_2), "at -1");
        assert_eq!(sin_cos_eighth_turn(0.0), (0.0, 1.0), "at 0");
    }
}
