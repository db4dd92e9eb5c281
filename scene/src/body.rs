//! A solid where it stands: many copies share one description, and rays are carried into its frame.

use std::sync::Arc;

use freeform::{Bounds, Crossing, Ray, Solid};
use glam::{DAffine3, DVec2, DVec3};

use crate::projection::Projector;

/// A solid, or a copy of one at another place.
#[derive(Debug, Clone)]
pub(crate) struct Body {
    solid: Arc<Solid>,
    /// `None` where the solid stands as it is described: no bit is lost by a detour.
    from_world: Option<Box<DAffine3>>,
}

/// Solids of so few forms and perturbations are moved as a whole to find the box of a copy, which is then tight; of
/// others the box is moved.
const FEW: usize = 16;

impl Body {
    /// Returns the solid where it is described.
    pub(crate) fn new(solid: Arc<Solid>) -> Self {
        Self { solid, from_world: None }
    }

    /// Returns the solid moved by `placement`, which is not singular.
    pub(crate) fn placed(solid: Arc<Solid>, placement: &DAffine3) -> Self {
        Self { solid, from_world: Some(Box::new(placement.inverse())) }
    }

    /// Returns the memory that it holds beside itself and the solid, bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        self.from_world.as_deref().map_or(0, size_of_val)
    }

    pub(crate) fn solid(&self) -> &Arc<Solid> {
        &self.solid
    }

    /// Returns the map from the world to the frame in which the solid is described.
    pub(crate) fn world_to_local(&self) -> Option<&DAffine3> {
        self.from_world.as_deref()
    }

    /// Returns a point of the world in the frame of the solid.
    #[inline]
    pub(crate) fn local_point(&self, p: DVec3) -> DVec3 {
        self.from_world.as_ref().map_or(p, |m| m.transform_point3(p))
    }

    /// Returns a vector of the world in the frame of the solid.
    #[inline]
    pub(crate) fn local_vector(&self, v: DVec3) -> DVec3 {
        self.from_world.as_ref().map_or(v, |m| m.transform_vector3(v))
    }

    /// Returns a normal or a gradient of the solid's frame in the world, of any length.
    #[inline]
    pub(crate) fn world_normal(&self, n: DVec3) -> DVec3 {
        self.from_world.as_ref().map_or(n, |m| m.matrix3.transpose() * n)
    }

    /// Returns where a ray of the world first crosses the surface; ray parameters are the same in both frames.
    #[inline]
    pub(crate) fn first_hit(&self, ray: &Ray) -> Option<Crossing> {
        match &self.from_world {
            None => self.solid.first_hit(ray),
            Some(m) => {
                let (origin, direction) = (m.transform_point3(ray.origin), m.transform_vector3(ray.direction));
                self.solid.first_hit(&Ray { origin, direction, ..*ray })
            }
        }
    }

    /// Returns the outward unit normal where a ray of this `direction` met a part at `p`.
    pub(crate) fn normal_at(&self, part: u32, p: DVec3, direction: DVec3) -> DVec3 {
        let n = self.solid.normal_at(part, self.local_point(p), self.local_vector(direction));
        self.from_world.as_ref().map_or(n, |m| (m.matrix3.transpose() * n).normalize_or(-direction))
    }

    /// Returns the texture coordinates of a point with outward normal `n`, both in the frame of the solid.
    pub(crate) fn texture_coordinates(&self, projector: Option<&Projector>, p: DVec3, n: DVec3) -> DVec2 {
        projector.map_or_else(|| self.solid.texture_coordinates(p), |projector| projector.coordinates(p, n))
    }

    /// Returns a box of the world that holds the body; `None` where it may have no end.
    pub(crate) fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let Bounds::Finite { min, max } = self.solid.bounds() else { return None };
        let Some(from_world) = &self.from_world else { return Some((min, max)) };
        let to_world = from_world.inverse();
        let size: usize = self.solid.forms().iter().map(|form| 1 + form.perturbations().len()).sum();
        if size <= FEW
            && let Ok(moved) = self.solid.transformed(&to_world)
            && let Bounds::Finite { min, max } = moved.bounds()
        {
            return Some((min, max));
        }
        let corner = |k: u32| {
            let at = |axis: usize| if k >> axis & 1 == 0 { min[axis] } else { max[axis] };
            to_world.transform_point3(DVec3::new(at(0), at(1), at(2)))
        };
        let corners = (0..8).map(corner);
        Some(corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p))))
    }
}
