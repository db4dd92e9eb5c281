//! The space between a flat part of a surface and a light: where nothing is in it, no shadow ray is needed.
//!
//! It is the convex hull of two polygons that face each other, as the half-spaces whose planes hold an edge of one and
//! a corner of the other, cut off at the planes of both.
//!
//! # Source
//! Haines, Wallace 1991: Shaft Culling for Efficient Ray-Cast Radiosity. We depart in two ways: the hull is that of
//! polygons and not of boxes, and what is in it is not kept for rays, which the tree serves as well.

use arrayvec::ArrayVec;
use glam::{Vec3, Vec3A, Vec4};

use crate::{Aabb, Patch};

/// A light as a shaft ends at it.
#[derive(Debug, Clone)]
pub(crate) enum Outline {
    /// A flat one: unit normal of the front, and corners, counter-clockwise as seen from there.
    Flat(Vec3A, ArrayVec<Vec3A, 4>),
    /// One without extent.
    Point(Vec3A),
    /// One at infinity: the unit vector towards it.
    Direction(Vec3A),
}

/// The hull of a patch and a light.
#[derive(Debug, Clone)]
pub(crate) struct Shaft {
    /// A point p is outside where n . p + w > 0 for any of them.
    pub(crate) planes: ArrayVec<Vec4, 10>,
    /// Corners, with w = 1; a corner at infinity is a direction with w = 0.
    pub(crate) corners: ArrayVec<Vec4, 8>,
}

/// Points may be rounded by this share of the largest coordinate.
pub(crate) const ROUNDING: f32 = 8.0 * f32::EPSILON;

impl Shaft {
    /// Returns the hull; `None` where the two do not lie in front of each other as wholes.
    pub(crate) fn new(patch: &Patch, light: &Outline) -> Option<Self> {
        let Patch { p, n, corners: near, tolerance, rounding } = *patch;
        let far: &[Vec3A] = match light {
            Outline::Flat(_, corners) => corners,
            Outline::Point(p) => std::slice::from_ref(p),
            Outline::Direction(_) => &[],
        };
        let mut shaft = Self { planes: ArrayVec::new(), corners: ArrayVec::new() };
        let points = || near.iter().chain(far);
        shaft.corners.extend(points().map(|p| p.extend(1.0)));
        let slack = points().fold(rounding, |slack, p| slack.max(ROUNDING * p.abs().max_element()));
        // What is in the plane of the patch hides nothing from it.
        shaft.planes.push((-n).extend(n.dot(p) + tolerance));
        let is_above = |far: &Vec3A| n.dot(*far - p) > 2.0 * tolerance + slack;
        let mut add = |normal: Vec3A| {
            let normal = normal.normalize();
            // That all corners are inside should be so by how the normal was found, but for rounding.
            let farthest = points().fold(f32::NEG_INFINITY, |farthest, p| farthest.max(normal.dot(*p)));
            shaft.planes.push(normal.extend(-farthest - slack));
        };
        match light {
            Outline::Flat(normal, corners) => {
                let is_before = |near: &Vec3A| normal.dot(*near - corners[0]) > slack;
                if !(corners.iter().all(is_above) && near.iter().all(is_before)) {
                    return None;
                }
                sides(&near, corners, &mut add);
                sides(corners, &near, &mut add);
                // Nor does the lamp hide itself.
                let rounding = ROUNDING * normal.abs().dot(corners[0].abs());
                shaft.planes.push((-*normal).extend(normal.dot(corners[0]) + rounding));
            }
            Outline::Point(p) => {
                if !is_above(p) {
                    return None;
                }
                sides(&near, &[*p], &mut add);
            }
            Outline::Direction(direction) => {
                if n.dot(*direction) <= ROUNDING {
                    return None;
                }
                edges(&near).for_each(|(a, b)| add((b - a).cross(*direction)));
                shaft.corners.push(direction.extend(0.0));
            }
        }
        // A patch without width has no planes.
        shaft.planes.iter().all(|plane| plane.is_finite()).then_some(shaft)
    }

    /// Whether a box is outside for sure.
    pub(crate) fn misses(&self, bounds: &Aabb) -> bool {
        let is_outside = |plane: &Vec4| {
            let n = plane.truncate();
            let nearest = Vec3::select(n.cmpgt(Vec3::ZERO), bounds.min, bounds.max);
            n.dot(nearest) + plane.w > 0.0
        };
        self.planes.iter().any(is_outside)
    }
}

/// The edges of a polygon.
fn edges(corners: &[Vec3A]) -> impl Iterator<Item = (Vec3A, Vec3A)> {
    corners.iter().copied().zip(corners.iter().copied().cycle().skip(1))
}

/// Calls `add` with the outward normal of each plane through an edge of a polygon and that corner of one in front of it
/// which leaves all of the other inside.
fn sides(polygon: &[Vec3A], other: &[Vec3A], add: &mut impl FnMut(Vec3A)) {
    for (a, b) in edges(polygon) {
        let mut normal = (b - a).cross(other[0] - a);
        for &corner in &other[1..] {
            if normal.dot(corner - a) > 0.0 {
                normal = (b - a).cross(corner - a);
            }
        }
        add(normal);
    }
}
