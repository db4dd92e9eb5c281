//! Up to four primitives of a leaf, their triangles met by a ray at once and without gaps.
//!
//! # Source
//! Woop, Benthin, Wald 2013: Watertight Ray/Triangle Intersection. In the frame in which the ray is the z axis, the edge functions
//! U, V and W of a triangle's sheared corners have signs that two triangles agree upon along the edge they share; where one is 0,
//! it is computed again in f64, in which the products are exact. We depart in the hits that lie close to the start of the ray: their t is computed again
//! from the unsheared corners in f64, so that a ray that starts a rounding error beyond a surface never meets it.

use glam::{BVec4A, DVec3, Vec2, Vec3, Vec3A, Vec4};

use super::lane_ray::LaneRay;
use crate::Ray;

/// Up to four triangles, a lane each; a lane may also hold a free form or nothing, whose corners are NaN.
#[derive(Debug, Clone, Copy)]
pub(super) struct Packet {
    /// `corners[corner][axis]`.
    pub(super) corners: [[Vec4; 3]; 3],
    /// The primitive of each lane, with flags in the two highest bits.
    pub(super) primitives: [u32; 4],
}

/// The lane holds a free form (or, with `PRIMITIVE` all ones, nothing).
pub(super) const FORM: u32 = 1 << 31;
/// The lane's primitive has holes: a hit must be asked for.
pub(super) const CUT_OUT: u32 = 1 << 30;
/// The bits of the primitive's index.
pub(super) const PRIMITIVE: u32 = CUT_OUT - 1;

/// Half the distance from 1 to the next f32: the relative error of one rounding.
const UNIT_ROUNDOFF: f32 = 0.5 * f32::EPSILON;

/// Bounds the error of t times the determinant, in units of roundoff and of the cube of the largest translated coordinate: 3 edge functions, each with
/// 2 products of 2 sheared coordinates (each sum of three roundings), times a depth: some 60 roundings; a larger bound costs only time.
const T_ERROR: f32 = 128.0 * UNIT_ROUNDOFF;

/// What a packet's lanes say of a ray.
pub(super) struct Lanes {
    /// Lanes whose triangle is met at t > 0 or too close to 0 to tell.
    pub(super) mask: u32,
    t: [f32; 4],
    v: [f32; 4],
    w: [f32; 4],
    det_inv: [f32; 4],
    /// Lanes where t needs a second look.
    doubt: u32,
}

impl Lanes {
    /// Nothing is met.
    const NONE: Self = Self { mask: 0, t: [0.0; 4], v: [0.0; 4], w: [0.0; 4], det_inv: [0.0; 4], doubt: 0 };
}

impl Packet {
    /// A packet of nothing.
    pub(super) const EMPTY: Self = Self { corners: [[Vec4::NAN; 3]; 3], primitives: [FORM | PRIMITIVE; 4] };

    /// Meets all lanes with a ray and returns those whose triangle is hit before `t_max`.
    #[inline]
    pub(super) fn meet(&self, ray: &LaneRay, t_max: f32) -> Lanes {
        let [ax, ay, az] = self.sheared(0, ray);
        let [bx, by, bz] = self.sheared(1, ray);
        let [cx, cy, cz] = self.sheared(2, ray);
        let mut u = cx * by - cy * bx;
        let mut v = ax * cy - ay * cx;
        let mut w = bx * ay - by * ax;
        let zero = u.cmpeq(Vec4::ZERO) | v.cmpeq(Vec4::ZERO) | w.cmpeq(Vec4::ZERO);
        if zero.any() {
            u = exact_edge(cx, by, cy, bx, u);
            v = exact_edge(ax, cy, ay, cx, v);
            w = exact_edge(bx, ay, by, ax, w);
        }
        let outside = negative(u.min(v).min(w)) & positive(u.max(v).max(w));
        let det = u + v + w;
        // NaN, of an empty lane or a triangle seen edge on (0 / 0), fails each comparison.
        let met = !outside & det.abs().cmpgt(Vec4::ZERO);
        if !met.any() {
            return Lanes::NONE;
        }
        let det_inv = det.recip();
        let t = (u * az + v * bz + w * cz) * ray.shear[2] * det_inv;
        let inside = t.cmplt(Vec4::splat(t_max)) & met;
        if !inside.any() {
            return Lanes::NONE;
        }
        let largest = |a: Vec4, b: Vec4, c: Vec4| a.abs().max(b.abs()).max(c.abs());
        let size = self.reach(ray).max(largest(az, bz, cz));
        let t_error = size * size * size * T_ERROR * det_inv.abs();
        let ahead = t.cmpgt(-t_error);
        let doubt = t.abs().cmple(t_error);
        let [t, v, w, det_inv] = [t, v, w, det_inv].map(|lanes| lanes.to_array());
        Lanes { mask: (inside & ahead).bitmask(), t, v, w, det_inv, doubt: doubt.bitmask() }
    }

    /// Returns the largest translated coordinate of each lane.
    #[inline]
    fn reach(&self, ray: &LaneRay) -> Vec4 {
        let mut reach = Vec4::ZERO;
        for corner in &self.corners {
            for (c, o) in corner.iter().zip(&ray.origin) {
                reach = reach.max((*c - *o).abs());
            }
        }
        reach
    }

    /// Returns a corner in the frame of the ray; z still lacks its factor.
    #[inline]
    fn sheared(&self, corner: usize, ray: &LaneRay) -> [Vec4; 3] {
        let [x, y, z] = ray.axes;
        let corner = &self.corners[corner];
        let depth = corner[z] - ray.origin[z];
        [(corner[x] - ray.origin[x]) - ray.shear[0] * depth, (corner[y] - ray.origin[y]) - ray.shear[1] * depth, depth]
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

/// Returns a b - c d, taken from f64 where the f32 result `rounded` is 0.
#[cold]
fn exact_edge(a: Vec4, b: Vec4, c: Vec4, d: Vec4, rounded: Vec4) -> Vec4 {
    let lane = |i: usize| {
        if rounded[i] != 0.0 {
            return rounded[i];
        }
        let exact = f64::from(a[i]) * f64::from(b[i]) - f64::from(c[i]) * f64::from(d[i]);
        // A difference below the least f32 must keep its sign.
        let sign = if exact > 0.0 { 1.0 } else { -1.0 };
        if exact == 0.0 { 0.0 } else { sign * narrow(exact.abs()).max(f32::MIN_POSITIVE) }
    };
    Vec4::new(lane(0), lane(1), lane(2), lane(3))
}

#[expect(clippy::cast_possible_truncation, reason = "rounds to the nearest f32")]
fn narrow(x: f64) -> f32 {
    x as f32
}

#[inline]
fn negative(x: Vec4) -> BVec4A {
    x.cmplt(Vec4::ZERO)
}

#[inline]
fn positive(x: Vec4) -> BVec4A {
    x.cmpgt(Vec4::ZERO)
}
