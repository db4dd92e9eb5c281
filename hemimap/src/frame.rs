//! Right-handed orthonormal frames: one for any normal, and the one that a neighbour's frame becomes.

use glam::Vec3A;

/// Below this squared length of n + n' (16 eps, squared) the direction of the sum is rounding noise.
const OPPOSITE_SQ: f32 = 256.0 * f32::EPSILON * f32::EPSILON;

/// A right-handed orthonormal frame: `s` x `t` = `n`. Its local coordinates are those of the hemisphere maps.
///
/// ```
/// use hemimap::{Frame, glam::Vec3A};
/// let frame = Frame::from_normal(Vec3A::new(0.6, 0.0, 0.8));
/// assert!((frame.to_world(Vec3A::Z) - frame.n).length() < 1e-6);
/// assert!((frame.to_local(frame.n) - Vec3A::Z).length() < 1e-6);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// First tangent, unit, the local x axis.
    pub s: Vec3A,
    /// Second tangent, unit, the local y axis.
    pub t: Vec3A,
    /// Normal, unit, the local z axis.
    pub n: Vec3A,
}

impl Frame {
    /// Returns a frame around the unit normal `n`.
    ///
    /// It is continuous in `n` except where n.z changes sign; where neighbours must agree, use
    /// [`transported_to`](Self::transported_to). A normal that is unit within rounding gives axes that are unit and at
    /// right angles within 4 `f32::EPSILON`, for every direction.
    ///
    /// # Source
    /// Duff, Burgess, Christensen, Hery, Kensler, Liani and Villemin 2017, "Building an Orthonormal Basis, Revisited",
    /// listing 3.
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
    ///
    /// It is continuous in `n` except at the opposite normal, where no rotation is the shortest and
    /// [`from_normal`](Self::from_normal) answers. Orthonormal as that is, however long the chain of transports.
    ///
    /// ```text
    /// h = n + n',   s' = s - 2 (h.s)/(h.h) h,   then made orthogonal to n' once more
    /// ```
    ///
    /// The rotation of a tangent is its reflection in the plane across `h`. The second step matters near the opposite
    /// normal, where `h` has lost its digits, and stops the drift of a long chain.
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
        Self { s, t: n.cross(s), n }
    }
}
