//! The same maps, formulas and names in `f64`, one at a time: for references, finite differences and whatever needs
//! more digits. Domains and edges are those of the `f32` forms; the measured errors are the same numbers of `EPSILON`
//! or less.

use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_1_PI, FRAC_PI_4};

// Minimax fits (Remez) of the forms in `atan.rs` and `sincos.rs`, from the constant term upwards.

/// Relative error 7.7e-19.
const ATAN: [f64; 21] = [
    -0.333_333_333_333_332_87,
    0.199_999_999_999_902_78,
    -0.142_857_142_850_254_53,
    0.111_111_110_860_715_05,
    -0.090_909_085_396_531_6,
    0.076_922_996_101_653_91,
    -0.066_665_827_699_667_77,
    0.058_817_096_261_473_176,
    -0.052_594_001_741_032_07,
    0.047_447_933_950_356_805,
    -0.042_859_836_086_209_496,
    0.038_200_265_949_800_576,
    -0.032_766_883_775_211_135,
    0.026_124_071_102_229_255,
    -0.018_582_103_363_602_63,
    0.011_288_823_391_054_116,
    -0.005_592_803_071_294_059_6,
    0.002_141_863_547_776_34,
    -0.000_589_565_508_710_222_2,
    0.000_103_170_726_010_078_73,
    -8.585_667_677_424_315e-6,
];

/// Relative error 2.2e-21.
const SIN: [f64; 7] = [
    -0.080_745_512_188_280_79,
    0.002_490_394_570_192_716_8,
    -3.657_620_418_214_815e-5,
    3.133_616_889_205_590_4e-7,
    -1.757_247_420_478_384_8e-9,
    6.948_153_032_885_35e-12,
    -2.022_533_847_152_247_7e-14,
];

/// Relative error 4.2e-20.
const COS: [f64; 7] = [
    -0.308_425_137_534_042_44,
    0.015_854_344_243_815_422,
    -0.000_325_991_886_926_728_3,
    3.590_860_445_961_440_6e-6,
    -2.461_136_389_473_476_3e-8,
    1.150_049_960_037_314_4e-10,
    -3.857_779_361_744_241_5e-13,
];

/// Below this squared length of n + n' (16 eps, squared) the direction of the sum is rounding noise.
const OPPOSITE_SQ: f64 = 256.0 * f64::EPSILON * f64::EPSILON;

/// Returns the arctangent of `x`, in radians, for |`x`| <= 1, within 2.3e-16. See [`crate::atan_unit`].
#[inline]
#[must_use]
pub fn atan_unit(x: f64) -> f64 {
    let s = x * x;
    x + x * (s * horner(&ATAN, s))
}

/// Returns (sin, cos) of the angle `t` pi/4, for |`t`| <= 1, each within 2.3e-16; near 0 the sine keeps its digits. No
/// function of the platform is called.
///
/// ```
/// let (sin, cos) = hemimap::double::sin_cos_eighth_turn(1.0);
/// assert!(sin == cos && (sin * sin - 0.5).abs() < 1e-15);
/// ```
#[inline]
#[must_use]
pub fn sin_cos_eighth_turn(t: f64) -> (f64, f64) {
    let s = t * t;
    (t * (s * horner(&SIN, s) + FRAC_PI_4), 1.0 + s * horner(&COS, s))
}

/// Returns the point of the unit disk that belongs to the point `u` of the unit square. See [`crate::square_to_disk`].
#[inline]
#[must_use]
pub fn square_to_disk(u: DVec2) -> DVec2 {
    let [x, y, _] = to_disk(u);
    DVec2::new(x, y)
}

/// Returns the point of the unit square that belongs to the point `p` of the unit disk. See [`crate::disk_to_square`].
#[inline]
#[must_use]
pub fn disk_to_square(p: DVec2) -> DVec2 {
    let lies = p.x.abs() > p.y.abs();
    let (along, across) = if lies { (p.x, p.y) } else { (p.y, p.x) };
    let length = (p.x * p.x + p.y * p.y).sqrt();
    let r = if length < 1.0 { length } else { 1.0 }.copysign(along);
    let q = r * (atan_unit(across / nonzero(along)) * (1.0 / FRAC_PI_4));
    let (a, b) = if lies { (r, q) } else { (q, r) };
    DVec2::new(0.5 * a + 0.5, 0.5 * b + 0.5)
}

/// Returns the direction that belongs to the point `u` of the unit square, with density cos(theta)/pi. See
/// [`crate::square_to_cosine_hemisphere`].
#[inline]
#[must_use]
pub fn square_to_cosine_hemisphere(u: DVec2) -> DVec3 {
    let [x, y, _] = to_disk(u);
    DVec3::new(x, y, rim_factor(u).sqrt())
}

/// Returns the point of the unit square that belongs to the unit direction `w`. See
/// [`crate::cosine_hemisphere_to_square`].
#[inline]
#[must_use]
pub fn cosine_hemisphere_to_square(w: DVec3) -> DVec2 {
    disk_to_square(w.truncate())
}

/// Returns the density of [`square_to_cosine_hemisphere`] at `w`, per steradian.
#[inline]
#[must_use]
pub fn square_to_cosine_hemisphere_pdf(w: DVec3) -> f64 {
    w.z.max(0.0) * FRAC_1_PI
}

/// Returns the direction that belongs to the point `u` of the unit square, with density 1/(2 pi). See
/// [`crate::square_to_uniform_hemisphere`].
#[inline]
#[must_use]
pub fn square_to_uniform_hemisphere(u: DVec2) -> DVec3 {
    let [x, y, r] = to_disk(u);
    let stretch = (2.0 - r * r).sqrt();
    DVec3::new(x * stretch, y * stretch, rim_factor(u))
}

/// (1 - r)(1 + r), where 1 - r is twice the distance to the edge of the square, which is not rounded as r is.
#[inline]
fn rim_factor(u: DVec2) -> f64 {
    let rim = 2.0 * u.min(1.0 - u).min_element();
    rim * (2.0 - rim)
}

/// Returns the point of the unit square that belongs to the unit direction `w`. See
/// [`crate::uniform_hemisphere_to_square`].
#[inline]
#[must_use]
pub fn uniform_hemisphere_to_square(w: DVec3) -> DVec2 {
    disk_to_square(w.truncate() / (1.0 + w.z.abs()).sqrt())
}

/// Returns the density of [`square_to_uniform_hemisphere`] at `w`, per steradian.
#[inline]
#[must_use]
pub fn square_to_uniform_hemisphere_pdf(w: DVec3) -> f64 {
    if w.z >= 0.0 { 0.5 * FRAC_1_PI } else { 0.0 }
}

/// A right-handed orthonormal frame: `s` x `t` = `n`. See [`crate::Frame`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// First tangent, unit, the local x axis.
    pub s: DVec3,
    /// Second tangent, unit, the local y axis.
    pub t: DVec3,
    /// Normal, unit, the local z axis.
    pub n: DVec3,
}

impl Frame {
    /// Returns a frame around the unit normal `n`. See [`crate::Frame::from_normal`].
    #[inline]
    #[must_use]
    pub fn from_normal(n: DVec3) -> Self {
        let sign = 1f64.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Self {
            s: DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            t: DVec3::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    /// Returns the components of the world-space vector `v` in this frame.
    #[inline]
    #[must_use]
    pub fn to_local(&self, v: DVec3) -> DVec3 {
        DVec3::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }

    /// Returns the world-space vector whose components in this frame are `v`.
    #[inline]
    #[must_use]
    pub fn to_world(&self, v: DVec3) -> DVec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }

    /// Returns this frame turned by the shortest rotation that takes its normal to the unit normal `n`. See
    /// [`crate::Frame::transported_to`].
    #[inline]
    #[must_use]
    pub fn transported_to(&self, n: DVec3) -> Self {
        let h = self.n + n;
        let h_sq = h.length_squared();
        if h_sq < OPPOSITE_SQ {
            return Self::from_normal(n);
        }
        let s = self.s - h * (2.0 * h.dot(self.s) / h_sq);
        let s = (s - n * n.dot(s)).normalize();
        Self { s, t: n.cross(s), n }
    }
}

/// x, y and the radius.
#[inline]
fn to_disk(u: DVec2) -> [f64; 3] {
    let (a, b) = (2.0 * u.x - 1.0, 2.0 * u.y - 1.0);
    let lies = a.abs() > b.abs();
    let (r, q) = if lies { (a, b) } else { (b, a) };
    let (sin, cos) = sin_cos_eighth_turn(q / nonzero(r));
    let (along, across) = (r * cos, r * sin);
    let (x, y) = if lies { (along, across) } else { (across, along) };
    [x, y, r.abs()]
}

/// The polynomial with the coefficients `c`, constant term first, at `s`.
#[inline]
fn horner<const N: usize>(c: &[f64; N], s: f64) -> f64 {
    c.iter().rev().fold(0.0, |p, c| p * s + c)
}

/// A divisor that keeps the centre from 0/0: there the dividend is 0 as well, and any angle is right.
#[inline]
fn nonzero(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { x }
}

#[cfg(test)]
#[expect(clippy::disallowed_methods, reason = "the platform's functions are the oracle")]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_1_SQRT_2;

    #[test]
    fn polynomials_stay_within_rounding() {
        for i in 0..=1_000_000_u32 {
            let t = f64::from(i) * 1e-6;
            let (sin, cos) = sin_cos_eighth_turn(t);
            let off = [atan_unit(t) - t.atan(), sin - (t * FRAC_PI_4).sin(), cos - (t * FRAC_PI_4).cos()].map(f64::abs);
            // The oracle's own rounding (half a unit, 0.6e-16) is in these.
            assert!(off.iter().all(|off| *off <= 2.3e-16), "at {t}: {off:?}");
        }
    }

    #[test]
    fn ends_are_exact() {
        assert_eq!(atan_unit(1.0), FRAC_PI_4, "arctangent of 1");
        let (sin, cos) = sin_cos_eighth_turn(1.0);
        assert!((sin - FRAC_1_SQRT_2).abs() <= f64::EPSILON, "sine: {sin}");
        assert!((cos - FRAC_1_SQRT_2).abs() <= f64::EPSILON, "cosine: {cos}");
        assert_eq!(sin, cos, "both halves of the map meet in the same bits");
    }
}
