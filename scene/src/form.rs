//! Free forms among the triangles: from f32 rays to f64 and back.

use std::borrow::Borrow;
use std::sync::Arc;

use freeform::Solid;
use glam::{DAffine3, Vec2};

use crate::body::Body;
use crate::projection::Projector;
use crate::surface::ShapePoint;
use crate::{Aabb, FormObject, Hit, Ray};

/// A free form with what a ray needs to know of it.
#[derive(Debug)]
pub(crate) struct Form {
    /// Shared with its light.
    pub(crate) body: Body,
    pub(crate) material: u32,
    /// `None` where it is unbounded.
    pub(crate) bounds: Option<Aabb>,
    pub(crate) cut_out: bool,
    /// In the frame of the solid, so that all copies share it.
    pub(crate) projector: Option<Arc<Projector>>,
}

/// Rounding of a position from f64 to f32, and a little for the root itself.
const POSITION_ERROR: f32 = f32::EPSILON;

/// After a crossing that is a hole the search goes on this share farther of t and of how far from the origin the ray
/// starts, whose rounding may cross the surface time and again; and twice as far as before where it is met at once, as
/// by a long ray that grazes it.
const STEP: f64 = 1e-9;

/// Returns the body of each copy; of the solid where it stands, if there is none.
fn bodies<P: Borrow<DAffine3>>(
    solid: Arc<Solid>,
    copies: impl IntoIterator<Item = P, IntoIter: ExactSizeIterator>,
) -> impl Iterator<Item = Body> {
    let copies = copies.into_iter();
    let alone = (copies.len() == 0).then(|| Body::new(solid.clone()));
    alone.into_iter().chain(copies.map(move |placement| Body::placed(solid.clone(), placement.borrow())))
}

/// Returns the box around a body; `None` where it has no end.
fn bounds(body: &Body) -> Option<Aabb> {
    let bounds = body.bounds().map(|(min, max)| Aabb::around(min, max));
    bounds.filter(|b| b.min.is_finite() && b.max.is_finite())
}

impl Form {
    /// Makes the form of each copy, all of one solid.
    pub(crate) fn all(object: FormObject, cut_out: bool) -> impl Iterator<Item = Self> {
        let FormObject { solid, material, projection, copies, .. } = object;
        let solid = Arc::new(solid);
        let projector = projection.as_ref().map(|projection| Arc::new(Projector::new(projection)));
        bodies(solid, copies).map(move |body| Self {
            bounds: bounds(&body),
            body,
            material,
            cut_out,
            projector: projector.clone(),
        })
    }

    /// Returns the box around each copy, as that of [`Self::all`].
    pub(crate) fn bounds_of(object: &FormObject) -> impl Iterator<Item = Option<Aabb>> {
        bodies(Arc::new(object.solid.clone()), &object.copies).map(|body| bounds(&body))
    }

    /// Returns where the ray first crosses the surface, where `keep` says that it is there.
    #[inline]
    pub(crate) fn first_hit(&self, primitive: u32, ray: &Ray, keep: impl Fn(&Hit) -> bool) -> Option<Hit> {
        let mut range = double_ray(ray);
        let mut step = 0.0;
        loop {
            let crossing = self.body.first_hit(&range)?;
            #[expect(clippy::cast_possible_truncation, reason = "rounds to the nearest f32")]
            let t = crossing.t as f32;
            let barycentrics = Vec2::new(crossing.part as f32, 0.0);
            let hit = Hit { t, primitive, barycentrics, media: ray.media };
            if t > ray.t_min && t < ray.t_max && (!self.cut_out || keep(&hit)) {
                return Some(hit);
            }
            let least = STEP * crossing.t.abs().max(range.origin.abs().max_element()).max(STEP);
            step = if crossing.t - range.t_min < step { 2.0 * step } else { least };
            range.t_min = crossing.t + step;
            if range.t_min >= range.t_max {
                return None;
            }
        }
    }

    /// Returns the point where a ray hit the form.
    pub(crate) fn point(&self, ray: &Ray, hit: &Hit) -> ShapePoint {
        let Self { body, projector, .. } = self;
        let solid = body.solid();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "the number of a part, from first_hit"
        )]
        let part = hit.barycentrics.x as u32;
        let line = double_ray(ray);
        let direction = body.local_vector(line.direction);
        let mut t = f64::from(hit.t);
        let mut local = body.local_point(line.at(t));
        // t was rounded: one step of Newton's method along the ray brings the point back to the surface.
        let (value, gradient) = solid.first_order(part, local);
        let step = -value / gradient.dot(direction);
        let reach = f64::from(f32::EPSILON) * t;
        if step.abs() <= reach {
            t += step;
            local += direction * step;
        }
        let n = solid.normal_at(part, local, direction);
        // What is still missing, to first order.
        let (value, gradient) = solid.first_order(part, local);
        let missed = (value / body.world_normal(gradient).length()).abs();
        #[expect(clippy::cast_possible_truncation, reason = "a bound is only rounded")]
        let missed = if missed <= reach { missed as f32 } else { (reach as f32).abs() };
        let uv = body.texture_coordinates(projector.as_deref(), local, n);
        let p = line.at(t).as_vec3a();
        let n = body.world_normal(n).as_vec3a().normalize_or(-ray.direction);
        let p_error = p.abs().dot(n.abs()) * POSITION_ERROR + missed;
        ShapePoint { p, ng: n, n, uv: uv.as_vec2(), p_error }
    }
}

fn double_ray(ray: &Ray) -> freeform::Ray {
    freeform::Ray {
        origin: ray.origin.as_dvec3(),
        direction: ray.direction.as_dvec3(),
        t_min: f64::from(ray.t_min),
        t_max: f64::from(ray.t_max),
    }
}
