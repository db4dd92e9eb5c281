//! Right-handed orthonormal frames for normals.

use glam::Vec3A;

/// A right-handed orthonormal frame: `s` x `t` = `n`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// First tangent, unit.
    pub s: Vec3A,
    /// Second tangent, unit.
    pub t: Vec3A,
    /// Normal, unit: the local z axis.
    pub n: Vec3A,
}

/// Below this squared length of n + n' (16 eps, squared) the direction of the sum is rounding noise.
const OPPOSITE_SQ: f32 = 256.0 * f32::EPSILON * f32::EPSILON;

impl Frame {
    /// Returns a frame around the unit normal `n`.
    #[inline]
    #[must_use]
    pub fn from_normal(n: Vec3A) -> Self {
        let sign = 1f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Self {
            s: Vec3A::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            t: Vec3A::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    /// Returns the components of the world-space vector `v` in this frame.
    #[inline]
    #[must_use]
    pub fn to_local(&self, v: Vec3A) -> Vec3A {
        Vec3A::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }

    /// Returns the world-space vector whose components in this frame are `v`.
    #[inline]
    #[must_use]
    pub fn to_world(&self, v: Vec3A) -> Vec3A {
        self.s * v.x + self.t * v.y + self.n * v.z
    }

    /// Returns this frame turned by the shortest rotation that takes its normal to the unit normal `n`.
    #[inline]
    #[must_use]
    pub fn transported_to(&self, n: Vec3A) -> Self {
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
