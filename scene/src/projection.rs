//! How pictures are laid on free forms, which have no texture coordinates of their own.

use std::f64::consts::{PI, TAU};

use glam::{DAffine3, DMat3, DVec2, DVec3};

/// A way to give the points of a body texture coordinates.
///
/// The shape lies in a frame of its own, in which it is as [`ProjectionShape`] says, and `placement` carries that frame
/// into the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection {
    /// The shape from which pictures are projected.
    pub shape: ProjectionShape,
    /// From the shape's frame to the world, metres; not singular.
    pub placement: DAffine3,
}

/// The shape from which pictures are projected, with coordinates (u, v) that repeat and v upwards in the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProjectionShape {
    /// (u, v) = (x, y), the same for all z.
    Planar,
    /// As a globe: u is the right-handed angle about +y from -z over 2 pi, so that the picture's middle is at +z and
    /// not mirrored as seen from outside; v is the angle from -y over pi.
    Spherical,
    /// From the sides of a cube of edge 1 about the origin, each with one picture: that side whose normal is nearest to
    /// the body's. None is mirrored as seen from outside; the four sides around y stand upright.
    Box,
}

impl Projection {
    /// Returns planar coordinates: (u, v) is (a, b) at `origin + a right + b up`, and the same along the line across
    /// both. `None` where the two are parallel.
    #[must_use]
    pub fn planar(origin: DVec3, right: DVec3, up: DVec3) -> Option<Self> {
        let normal = right.cross(up).try_normalize()?;
        let placement = DAffine3::from_mat3_translation(DMat3::from_cols(right, up, normal), origin);
        Some(Self { shape: ProjectionShape::Planar, placement })
    }

    /// Returns the coordinates of a globe about `center` whose upper pole is towards `axis` and whose middle meridian
    /// is as near to `front` as it can be. `None` where the two are parallel.
    #[must_use]
    pub fn spherical(center: DVec3, axis: DVec3, front: DVec3) -> Option<Self> {
        let y = axis.try_normalize()?;
        let x = y.cross(front).try_normalize()?;
        let placement = DAffine3::from_mat3_translation(DMat3::from_cols(x, y, x.cross(y)), center);
        Some(Self { shape: ProjectionShape::Spherical, placement })
    }

    /// Returns the coordinates from the sides of a cube; each picture is `size` metres wide and high, one in the middle
    /// of each side.
    #[must_use]
    pub fn cube(center: DVec3, size: f64) -> Self {
        let placement = DAffine3::from_scale_rotation_translation(DVec3::splat(size), glam::DQuat::IDENTITY, center);
        Self { shape: ProjectionShape::Box, placement }
    }

    /// Returns the projection moved with its body.
    #[must_use]
    pub fn transformed(self, transform: &DAffine3) -> Self {
        Self { placement: *transform * self.placement, ..self }
    }

    /// Whether u is an angle over a whole turn, so that there is a seam.
    #[must_use]
    pub fn runs_round(&self) -> bool {
        self.shape == ProjectionShape::Spherical
    }

    /// Returns the function that gives the texture coordinates of a point and its outward normal, both of the world.
    pub fn coordinates(&self) -> impl Fn(DVec3, DVec3) -> DVec2 + use<> {
        let projector = Projector::new(self);
        move |p, n| projector.coordinates(p, n)
    }

    /// Whether every number is finite and the frame can be inverted.
    pub(crate) fn is_sound(&self) -> bool {
        self.placement.is_finite() && self.placement.inverse().is_finite()
    }
}

/// A [`Projection`] ready for points of the world.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Projector {
    shape: ProjectionShape,
    to_local: DAffine3,
    /// From normals of the world to normals of the shape's frame, of any length.
    normal_to_local: DMat3,
}

impl Projector {
    pub(crate) fn new(projection: &Projection) -> Self {
        let Projection { shape, placement } = projection;
        // A normal is moved by the transposed inverse of what moves points.
        Self { shape: *shape, to_local: placement.inverse(), normal_to_local: placement.matrix3.transpose() }
    }

    /// Returns the texture coordinates of a point with outward normal `n`, both of the world.
    pub(crate) fn coordinates(&self, p: DVec3, n: DVec3) -> DVec2 {
        let p = self.to_local.transform_point3(p);
        match self.shape {
            ProjectionShape::Planar => DVec2::new(p.x, p.y),
            ProjectionShape::Spherical => {
                let across = p.x.hypot(p.z);
                let turn = (-p.x).atan2(-p.z) / TAU;
                DVec2::new(if across > 0.0 { turn.rem_euclid(1.0) } else { 0.0 }, across.atan2(-p.y) / PI)
            }
            ProjectionShape::Box => {
                let n = self.normal_to_local * n;
                let size = n.abs();
                let uv = if size.x >= size.y && size.x >= size.z {
                    DVec2::new(if n.x >= 0.0 { -p.z } else { p.z }, p.y)
                } else if size.y >= size.z {
                    DVec2::new(p.x, if n.y >= 0.0 { -p.z } else { p.z })
                } else {
                    DVec2::new(if n.z >= 0.0 { p.x } else { -p.x }, p.y)
                };
                uv + 0.5
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn assert_near(found: DVec2, u: f64, v: f64, what: &str) {
        assert!((found - DVec2::new(u, v)).length() < 1e-12, "{what}: {found}, not ({u}, {v})");
    }

    #[test]
    fn planar_coordinates_span_the_two_vectors() {
        let (origin, right, up) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(2.0, 0.0, 1.0), DVec3::new(1.0, 4.0, 0.0));
        let projection = Projection::planar(origin, right, up).unwrap();
        for (a, b, c) in [(0.0, 0.0, 0.0), (1.0, 0.0, 5.0), (0.25, -3.5, -2.0)] {
            let p = origin + a * right + b * up + c * right.cross(up);
            assert_near(projection.coordinates()(p, DVec3::X), a, b, "anywhere along the normal");
        }
        assert!(Projection::planar(origin, right, -2.0 * right).is_none(), "parallel vectors span nothing");
    }

    #[test]
    fn a_globe_has_its_middle_in_front() {
        let projection = Projection::spherical(DVec3::Y, DVec3::Z, DVec3::new(3.0, 0.0, 7.0)).unwrap();
        let at = |d: DVec3| projection.coordinates()(DVec3::Y + 2.0 * d, DVec3::X);
        assert_near(at(DVec3::X), 0.5, 0.5, "front");
        assert_near(at(DVec3::Y), 0.75, 0.5, "to the right of the picture's middle as seen from outside");
        assert_near(at(-DVec3::Y), 0.25, 0.5, "to the left");
        assert_near(at(DVec3::Z), 0.0, 1.0, "upper pole");
        assert_near(at(-DVec3::Z), 0.0, 0.0, "lower pole");
        assert!(at(DVec3::ZERO).is_finite(), "the centre has coordinates, too");
        assert!(Projection::spherical(DVec3::ZERO, DVec3::Y, DVec3::Y).is_none(), "front along the axis");
    }

    #[test]
    fn the_sides_of_a_cube_are_upright_and_not_mirrored() {
        let projection = Projection::cube(DVec3::new(1.0, 1.0, 1.0), 2.0);
        // Over each side: its normal, and the direction to the right as seen from outside with y (with -z above, z
        // below) upwards.
        for (n, right, up) in [
            (DVec3::X, -DVec3::Z, DVec3::Y),
            (-DVec3::X, DVec3::Z, DVec3::Y),
            (DVec3::Y, DVec3::X, -DVec3::Z),
            (-DVec3::Y, DVec3::X, DVec3::Z),
            (DVec3::Z, DVec3::X, DVec3::Y),
            (-DVec3::Z, -DVec3::X, DVec3::Y),
        ] {
            assert_eq!(right.cross(up), n, "right-handed as seen from outside");
            let p = DVec3::ONE + 5.0 * n + 0.5 * right - 0.25 * up;
            let tilted = n + 0.3 * right + 0.2 * up;
            assert_near(projection.coordinates()(p, tilted), 0.75, 0.375, "the side is chosen by the normal");
        }
    }

    #[test]
    fn pictures_move_with_the_body() {
        let transform = DAffine3::from_scale_rotation_translation(
            DVec3::new(2.0, 1.0, 0.5),
            glam::DQuat::from_rotation_y(0.7) * glam::DQuat::from_rotation_x(-0.4),
            DVec3::new(10.0, -3.0, 4.0),
        );
        let (p, n) = (DVec3::new(0.4, 0.3, -0.2), DVec3::new(0.5, -0.9, 0.3));
        let moved_n = transform.matrix3.inverse().transpose() * n;
        for projection in [
            Projection::planar(DVec3::X, DVec3::Y, DVec3::Z).unwrap(),
            Projection::spherical(DVec3::ZERO, DVec3::Y, DVec3::Z).unwrap(),
            Projection::cube(DVec3::Y, 0.3),
        ] {
            let here = projection.coordinates()(p, n);
            let there = projection.transformed(&transform).coordinates()(transform.transform_point3(p), moved_n);
            assert_near(there, here.x, here.y, "the same place of the picture");
        }
    }
}
