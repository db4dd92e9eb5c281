//! Sine and cosine of an eighth turn, as polynomials.

/// Returns (sin, cos) of `t` pi/4.
#[inline]
#[must_use]
pub(crate) fn sin_cos_eighth_turn(t: f32) -> (f32, f32) {
    const S: [f32; 4] = [
        std::f32::consts::FRAC_PI_4,
        -0.080_745_444,
        0.002_490_015_5,
        -3.595_118_7e-5,
    ];
    const C: [f32; 4] = [
        -0.308_425_13,
        0.015_854_325,
        -0.000_325_937_52,
        3.528_875e-6,
    ];
    let s = t * t;
    let sin = t * (((S[3] * s + S[2]) * s + S[1]) * s + S[0]);
    let cos = 1.0 + s * (((C[3] * s + C[2]) * s + C[1]) * s + C[0]);
    (sin, cos)
}
