//! Up to eight primitives of a leaf, their triangles met by a ray at once and without gaps.
//!
//! # Source
//! Woop, Benthin, Wald 2013: Watertight Ray/Triangle Intersection. In the frame in which the ray is the z axis, the
//! edge functions U, V and W of a triangle's sheared corners have signs that two triangles agree upon along the edge
//! they share; where one is 0, it is computed again in f64, in which the products are exact. We depart in the hits that
//! lie close to the start of the ray: their t is computed again from the unsheared corners in f64, so that a ray that
//! starts a rounding error beyond a surface never meets it.

use fearless_simd::{Simd, SimdBase, SimdMask, f32x8};
use glam::{DVec3, Vec2, Vec3, Vec3A};

use super::LANES;
use super::lane_ray::LaneRay;
use crate::Ray;
use crate::bounds::narrow;

/// Up to eight triangles, a lane each; a lane may also hold a free form or nothing, whose corners are NaN.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
pub(super) struct Packet {
    /// `corners[corner][axis]`.
    pub(super) corners: [[[f32; LANES]; 3]; 3],
    /// The primitive of each lane, with flags in the two highest bits.
    pub(super) primitives: [u32; LANES],
}

/// The lane holds a free form (or, with `PRIMITIVE` all ones, nothing).
pub(super) const FORM: u32 = 1 << 31;
/// The lane's primitive has holes: a hit must be asked for.
pub(super) const CUT_OUT: u32 = 1 << 30;
/// The bits of the primitive's index.
pub(super) const PRIMITIVE: u32 = CUT_OUT - 1;

/// Half the distance from 1 to the next f32: the relative error of one rounding.
const UNIT_ROUNDOFF: f32 = 0.5 * f32::EPSILON;

/// Bounds the error of t times the determinant, in units of roundoff and of the cube of the largest translated
/// coordinate: 3 edge functions, each with 2 products of 2 sheared coordinates (each sum of three roundings), times a
/// depth: some 60 roundings; a larger bound costs only time.
const T_ERROR: f32 = 128.0 * UNIT_ROUNDOFF;

/// What a packet's lanes say of a ray.
pub(super) struct Lanes {
    /// Lanes whose triangle is met at t > 0 or too close to 0 to tell.
    pub(super) mask: u64,
    t: [f32; LANES],
    v: [f32; LANES],
    w: [f32; LANES],
    det_inv: [f32; LANES],
    /// Lanes where t needs a second look.
    doubt: u64,
}

impl Lanes {
    /// Nothing is met.
    const NONE: Self =
        Self { mask: 0, t: [0.0; LANES], v: [0.0; LANES], w: [0.0; LANES], det_inv: [0.0; LANES], doubt: 0 };
}

/// Returns the primitive of a lane that holds a free form.
pub(super) fn form_of(lane: u32) -> Option<u32> {
    let primitive = lane & PRIMITIVE;
    (lane & FORM != 0 && primitive != PRIMITIVE).then_some(primitive)
}

impl Packet {
    /// A packet of nothing.
    pub(super) const EMPTY: Self = Self { corners: [[[f32::NAN; LANES]; 3]; 3], primitives: [FORM | PRIMITIVE; LANES] };

    /// Meets all lanes with a ray and returns those whose triangle is hit before `t_max`.
    #[inline(always)]
    pub(super) fn meet<S: Simd>(&self, ray: &LaneRay<S>, t_max: f32) -> Lanes {
        let [ax, ay, az] = self.sheared(0, ray);
        let [bx, by, bz] = self.sheared(1, ray);
        let [cx, cy, cz] = self.sheared(2, ray);
        let mut u = cx * by - cy * bx;
        let mut v = ax * cy - ay * cx;
        let mut w = bx * ay - by * ax;
        let zero = u.simd_eq(0.0) | v.simd_eq(0.0) | w.simd_eq(0.0);
        if zero.any_true() {
            exact_edge(&cx, &by, &cy, &bx, &mut u);
            exact_edge(&ax, &cy, &ay, &cx, &mut v);
            exact_edge(&bx, &ay, &by, &ax, &mut w);
        }
        let outside = u.min(v).min(w).simd_lt(0.0) & u.max(v).max(w).simd_gt(0.0);
        let det = u + v + w;
        // NaN, of an empty lane or a triangle seen edge on (0 / 0), fails each comparison.
        let met = !outside & det.abs().simd_gt(0.0);
        if !met.any_true() {
            return Lanes::NONE;
        }
        let det_inv = f32x8::splat(ray.simd, 1.0) / det;
        let t = (u * az + v * bz + w * cz) * ray.shear[2] * det_inv;
        let inside = t.simd_lt(t_max) & met;
        if !inside.any_true() {
            return Lanes::NONE;
        }
        let size = self.reach(ray);
        let t_error = size * size * size * T_ERROR * det_inv.abs();
        let ahead = t.simd_gt(-t_error);
        let doubt = t.abs().simd_le(t_error);
        Lanes {
            mask: (inside & ahead).to_bitmask(),
            t: t.to_array(),
            v: v.to_array(),
            w: w.to_array(),
            det_inv: det_inv.to_array(),
            doubt: doubt.to_bitmask(),
        }
    }

    /// Returns the largest translated coordinate of each lane.
    #[inline(always)]
    fn reach<S: Simd>(&self, ray: &LaneRay<S>) -> f32x8<S> {
        let mut reach = f32x8::splat(ray.simd, 0.0);
        for corner in &self.corners {
            for (axis, coordinates) in corner.iter().enumerate() {
                reach = reach.max(ray.offset(coordinates, axis).abs());
            }
        }
        reach
    }

    /// Returns a corner in the frame of the ray; z still lacks its factor.
    #[inline(always)]
    fn sheared<S: Simd>(&self, corner: usize, ray: &LaneRay<S>) -> [f32x8<S>; 3] {
        let corner = &self.corners[corner];
        let [x, y, z] = ray.axes;
        let (x, y, z) = (ray.offset(&corner[x], x), ray.offset(&corner[y], y), ray.offset(&corner[z], z));
        [x - ray.shear[0] * z, y - ray.shear[1] * z, z]
    }

    /// Returns t and barycentrics of a lane of `lanes.mask`; t is exact to f32 where it is small.
    #[inline]
    pub(super) fn hit(&self, lane: usize, lanes: &Lanes, ray: &Ray) -> (f32, Vec2) {
        let barycentrics = Vec2::new(lanes.v[lane], lanes.w[lane]) * lanes.det_inv[lane];
        let t = if lanes.doubt & (1 << lane) == 0 { lanes.t[lane] } else { self.exact_t(lane, ray) };
        (t, barycentrics)
    }

    /// Returns where the ray meets the plane of a lane's triangle, computed in f64.
    #[cold]
    fn exact_t(&self, lane: usize, ray: &Ray) -> f32 {
        let corner = |i: usize| DVec3::from_array(self.corners[i].map(|axis| f64::from(axis[lane])));
        let (a, b, c) = (corner(0), corner(1), corner(2));
        let n = (b - a).cross(c - a);
        narrow(n.dot(a - ray.origin.as_dvec3()) / n.dot(ray.direction.as_dvec3()))
    }

    /// Puts a triangle in a lane.
    pub(super) fn set_triangle(&mut self, lane: usize, corners: [Vec3; 3]) {
        for (target, source) in self.corners.iter_mut().zip(corners) {
            for (axis, value) in target.iter_mut().zip(Vec3A::from(source).to_array()) {
                axis[lane] = value;
            }
        }
    }
}

/// Takes a b - c d from f64 where it was `rounded` to 0.
#[cold]
fn exact_edge(a: &[f32; LANES], b: &[f32; LANES], c: &[f32; LANES], d: &[f32; LANES], rounded: &mut [f32; LANES]) {
    for (i, rounded) in rounded.iter_mut().enumerate().filter(|(_, rounded)| **rounded == 0.0) {
        let exact = f64::from(a[i]) * f64::from(b[i]) - f64::from(c[i]) * f64::from(d[i]);
        // A difference below the least f32 must keep its sign.
        let sign = if exact > 0.0 { 1.0 } else { -1.0 };
        *rounded = if exact == 0.0 { 0.0 } else { sign * narrow(exact.abs()).max(f32::MIN_POSITIVE) };
    }
}
