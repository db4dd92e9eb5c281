//! The maps and the frame in `f64`: the same formulas and names, for references and for work that needs more digits.

use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_1_PI, FRAC_PI_4};

const ATAN: [f64; 21] = [
    -0.33333333333333287,
    0.19999999999990278,
    -0.14285714285025453,
    0.11111111086071505,
    -0.0909090853965316,
    0.07692299610165391,
    -0.06666582769966777,
    0.058817096261473176,
    -0.05259400174103207,
    0.047447933950356805,
    -0.042859836086209496,
    0.038200265949800576,
    -0.032766883775211135,
    0.026124071102229255,
    -0.01858210336360263,
    0.011288823391054116,
    -0.0055928030712940596,
    0.00214186354777634,
    -0.0005895655087102222,
    0.00010317072601007873,
    -8.585667677424315e-06,
];

const SIN: [f64; 7] = [
    -0.08074551218828079,
    0.0024903945701927168,
    -3.657620418214815e-05,
    3.1336168892055904e-07,
    -1.7572474204783848e-09,
    6.94815303288535e-12,
    -2.0225338471522477e-14,
];

const COS: [f64; 7] = [
    -0.30842513753404244,
    0.015854344243815422,
    -0.0003259918869267283,
    3.5908604459614406e-06,
    -2.4611363894734763e-08,
    1.1500499600373144e-10,
    -3.8577793617442415e-13,
];

/// Returns the arctangent of `x` in radians.
#[inline]
#[must_use]
pub fn atan_unit(x: f64) -> f64 {
    let s = x * x;
    x + x * (s * horner(&ATAN, s))
}

fn sin_cos_eighth_turn(t: f64) -> (f64, f64) {
    let s = t * t;
    (
        t * (s * horner(&SIN, s) + FRAC_PI_4),
        1.0 + s * horner(&COS, s),
    )
}

#[inline]
fn horner<const N: usize>(c: &[f64; N], s: f64) -> f64 {
    c.iter().rev().fold(0.0, |p, c| p * s + c)
}

/// Returns the point of the unit disk that belongs to the point `u` of the unit square.
#[inline]
#[must_use]
pub fn square_to_disk(u: DVec2) -> DVec2 {
    let [x, y, _] = to_disk(u.x, u.y);
    DVec2::new(x, y)
}

/// Returns the point of the unit square that belongs to the point `p` of the unit disk.
#[inline]
#[must_use]
pub fn disk_to_square(p: DVec2) -> DVec2 {
    DVec2::from_array(from_disk(p.x, p.y))
}

/// x, y and the radius.
#[inline]
fn to_disk(u: f64, v: f64) -> [f64; 3] {
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    let horizontal = a.abs() > b.abs();
    let (r, q) = if horizontal { (a, b) } else { (b, a) };
    let (sin, cos) = sin_cos_eighth_turn(q / nonzero(r));
    let (major, minor) = (r * cos, r * sin);
    let (x, y) = if horizontal {
        (major, minor)
    } else {
        (minor, major)
    };
    [x, y, r.abs()]
}

/// u and v.
#[inline]
fn from_disk(x: f64, y: f64) -> [f64; 2] {
    let horizontal = x.abs() > y.abs();
    let (major, minor) = if horizontal { (x, y) } else { (y, x) };
    let r = (x * x + y * y).sqrt();
    let r = if r < 1.0 { r } else { 1.0 };
    let r = r.copysign(major);
    let q = r * (atan_unit(minor / nonzero(major)) * (1.0 / FRAC_PI_4));
    let (a, b) = if horizontal { (r, q) } else { (q, r) };
    [0.5 * a + 0.5, 0.5 * b + 0.5]
}

/// A divisor that is safe at the centre.
#[inline]
fn nonzero(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { x }
}

/// Returns the direction that belongs to the point `u` of the unit square, with density cos(theta)/pi.
#[inline]
#[must_use]
pub fn square_to_cosine_hemisphere(u: DVec2) -> DVec3 {
    DVec3::from_array(to_cosine(u.x, u.y))
}

/// Returns the point of the unit square that belongs to the unit direction `w`.
#[inline]
#[must_use]
pub fn cosine_hemisphere_to_square(w: DVec3) -> DVec2 {
    DVec2::from_array(from_disk(w.x, w.y))
}

/// Returns the density of [`square_to_cosine_hemisphere`] at `w`, per steradian.
#[inline]
#[must_use]
pub fn square_to_cosine_hemisphere_pdf(w: DVec3) -> f64 {
    w.z.max(0.0) * FRAC_1_PI
}

/// Returns the direction that belongs to the point `u` of the unit square, with density 1/(2 pi).
#[inline]
#[must_use]
pub fn square_to_uniform_hemisphere(u: DVec2) -> DVec3 {
    DVec3::from_array(to_uniform(u.x, u.y))
}

/// Returns the point of the unit square that belongs to the unit direction `w`.
#[inline]
#[must_use]
pub fn uniform_hemisphere_to_square(w: DVec3) -> DVec2 {
    DVec2::from_array(from_uniform(w.x, w.y, w.z))
}

/// Returns the density of [`square_to_uniform_hemisphere`] at `w`, per steradian.
#[inline]
#[must_use]
pub fn square_to_uniform_hemisphere_pdf(w: DVec3) -> f64 {
    if w.z >= 0.0 { 0.5 * FRAC_1_PI } else { 0.0 }
}

#[inline]
fn to_cosine(u: f64, v: f64) -> [f64; 3] {
    let [x, y, r] = to_disk(u, v);
    [x, y, ((1.0 - r) * (1.0 + r)).sqrt()]
}

#[inline]
fn to_uniform(u: f64, v: f64) -> [f64; 3] {
    let [x, y, r] = to_disk(u, v);
    let s = (2.0 - r * r).sqrt();
    [x * s, y * s, (1.0 - r) * (1.0 + r)]
}

#[inline]
fn from_uniform(x: f64, y: f64, z: f64) -> [f64; 2] {
    let z = if z > 0.0 { z } else { 0.0 };
    let s = (1.0 + z).sqrt();
    from_disk(x / s, y / s)
}

/// A right-handed orthonormal frame: `s` x `t` = `n`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// First tangent, unit.
    pub s: DVec3,
    /// Second tangent, unit.
    pub t: DVec3,
    /// Normal, unit: the local z axis.
    pub n: DVec3,
}

/// Below this squared length of n + n' (16 eps, squared) the direction of the sum is rounding noise.
const OPPOSITE_SQ: f64 = 256.0 * f64::EPSILON * f64::EPSILON;

impl Frame {
    /// Returns a frame around the unit normal `n`.
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

    /// Returns this frame turned by the shortest rotation that takes its normal to the unit normal `n`.
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
        Self {
            s,
            t: n.cross(s),
            n,
        }
    }
}
