//! A point of a surface as a ray met it, and the rays that leave it.
//!
//! A hit point is rounded, so a ray that starts there may hit the very surface it leaves. `p` is therefore interpolated
//! from the corners (not taken from `t`), its distance from the true surface is bounded, and rays start beyond that
//! bound on the side to which they go.
//!
//! # Source
//! Pharr, Jakob, Humphreys 2023: Physically Based Rendering, 4th edition, 6.8.4 to 6.8.6.

use glam::{Vec2, Vec3A};

use crate::{Media, Ray};

/// A point of a surface, seen from the side that the ray came from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Position, metres.
    pub p: Vec3A,
    /// Geometric unit normal, on the side that the ray came from.
    pub ng: Vec3A,
    /// Shading unit normal: in the hemisphere of `ng`, and never turned from the viewer (see
    /// [`Scene::surface`](crate::Scene::surface)).
    pub n: Vec3A,
    /// Whether the ray met the front: the side from which a triangle's corners are counter-clockwise, the outside of a
    /// free form.
    pub front: bool,
    /// Texture coordinates.
    pub uv: Vec2,
    /// Ray parameter.
    pub t: f32,
    /// Index of the material.
    pub material: u32,
    /// Index of the triangle or free form, as in [`Hit`](crate::Hit).
    pub primitive: u32,
    /// Bound of the distance from the true surface along `ng`, metres.
    pub p_error: f32,
    /// The transparent bodies on the side that the ray came from.
    pub media: Media,
    /// Number of the transparent body that has its boundary here; 0 for none, and where no body of the scene has a
    /// priority or absorbs.
    pub medium: u8,
}

/// A point of a triangle or a free form, for rays from any side.
pub(crate) struct ShapePoint {
    pub(crate) p: Vec3A,
    /// Unit, on the front.
    pub(crate) ng: Vec3A,
    /// Unit, as interpolated, on the side of `ng`.
    pub(crate) n: Vec3A,
    pub(crate) uv: Vec2,
    pub(crate) p_error: f32,
}

/// A shadow ray stops this share before its end, so that the light's own surface is not in its way.
pub(crate) const SHADOW_MARGIN: f32 = 1e-4;

/// Least cosine between the shading normal and the viewer.
const MIN_COSINE: f32 = 1e-3;

impl Surface {
    /// Returns a ray from this point along the unit vector `direction`, started on the side of the surface to which it
    /// goes. It does not meet the triangle that it leaves.
    #[inline]
    #[must_use]
    pub fn spawn(&self, direction: Vec3A) -> Ray {
        let media = self.media_towards(direction);
        Ray { media, from: self.primitive, ..Ray::new(self.offset(direction), direction) }
    }

    /// Returns a ray from this point that ends just before `p`: a shadow ray to a point of a light.
    ///
    /// A point that coincides with this one gives a ray that hits nothing.
    #[inline]
    #[must_use]
    pub fn spawn_to(&self, p: Vec3A) -> Ray {
        let origin = self.offset(p - self.p);
        let offset = p - origin;
        let distance = offset.length();
        let direction = offset / distance;
        let t_max = distance * (1.0 - SHADOW_MARGIN);
        let media = self.media_towards(direction);
        Ray { origin, direction, t_min: 0.0, t_max, media, from: self.primitive }
    }

    /// Returns a ray towards what [`Lights::sample`](crate::Lights::sample) chose: it ends just before `distance`,
    /// which may be infinite.
    #[inline]
    #[must_use]
    pub fn shadow_ray(&self, wi: Vec3A, distance: f32) -> Ray {
        if distance.is_finite() { self.spawn_to(self.p + wi * distance) } else { self.spawn(wi) }
    }

    /// Whether `direction` leaves to the side that the ray came from, by the geometric normal.
    #[inline]
    #[must_use]
    pub fn is_above(&self, direction: Vec3A) -> bool {
        direction.dot(self.ng) > 0.0
    }

    /// Returns the transparent bodies on the side to which `direction` points.
    #[inline]
    fn media_towards(&self, direction: Vec3A) -> Media {
        if self.medium != 0 && direction.dot(self.ng) < 0.0 {
            self.media.beyond(self.medium, self.front)
        } else {
            self.media
        }
    }

    #[inline]
    fn offset(&self, direction: Vec3A) -> Vec3A {
        offset(self.p, self.ng, self.p_error, direction)
    }

    /// Turns the shading normal just enough that the viewer at `wo` (unit, on the side of `ng`) sees its front.
    ///
    /// Interpolated normals may point away from a viewer who looks along the surface. The normal then becomes the
    /// nearest one whose cosine with `wo` is `MIN_COSINE`; it changes continuously as the viewer moves.
    #[inline]
    pub(crate) fn face(n: Vec3A, ng: Vec3A, wo: Vec3A) -> Vec3A {
        let cosine = n.dot(wo);
        if cosine >= MIN_COSINE {
            return n;
        }
        let across = (n - wo * cosine).try_normalize();
        let Some(across) = across else { return ng };
        wo * MIN_COSINE + across * (1.0 - MIN_COSINE * MIN_COSINE).sqrt()
    }
}

/// Returns `p` moved along the normal to the side to which `direction` points, by just more than its error along the
/// normal.
#[inline]
pub(crate) fn offset(p: Vec3A, ng: Vec3A, p_error: f32, direction: Vec3A) -> Vec3A {
    let offset = if direction.dot(ng) < 0.0 { -ng } else { ng } * p_error;
    let moved = p + offset;
    // The sum is rounded once more: away from the surface.
    Vec3A::new(away(moved.x, offset.x), away(moved.y, offset.y), away(moved.z, offset.z))
}

/// Rounds `x` one step in the direction of `offset`.
#[inline]
fn away(x: f32, offset: f32) -> f32 {
    if offset > 0.0 {
        x.next_up()
    } else if offset < 0.0 {
        x.next_down()
    } else {
        x
    }
}
