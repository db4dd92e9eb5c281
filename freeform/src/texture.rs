//! Texture coordinates: where on the surface a picture's points go.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use crate::Solid;

impl Solid {
    /// Returns texture coordinates (u, v) of a point.
    ///
    /// A bounded solid takes them from the direction in which the centre of its box sees the point: u in [0, 1) is the
    /// right-handed angle about +y from -z over 2 pi, v in [0, 1] the angle from -y over pi, so that a picture stands
    /// upright and is not mirrored as seen from outside (poles and centre give u = 0). An unbounded one is mapped from
    /// above: (x, -z) in units of length, relative to the origin of its first form, to be repeated.
    pub fn texture_coordinates(&self, p: DVec3) -> DVec2 {
        let extent = self.extent();
        if extent.is_empty() || !extent.is_finite() {
            let v = p - self.home();
            return DVec2::new(v.x, -v.z);
        }
        let v = p - 0.5 * (extent.min + extent.max);
        let turn = (-v.x).atan2(-v.z) / TAU;
        // A tiny negative angle plus one rounds to one, which is the same place as zero.
        let u = if turn < 0.0 { turn + 1.0 } else { turn.abs() };
        let height = v.x.hypot(v.z).atan2(-v.y) / PI;
        DVec2::new(if u < 1.0 && v.x.hypot(v.z) > 0.0 { u } else { 0.0 }, height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FreeForm, Quadric};

    #[test]
    fn a_globe_is_not_mirrored_as_seen_from_outside() {
        let ball = Quadric::sphere(DVec3::ONE, 2.0).unwrap();
        let ball = Solid::from(FreeForm::new(ball, vec![]).unwrap());
        for (direction, u, v) in [
            (DVec3::Z, 0.5, 0.5),
            (DVec3::X, 0.75, 0.5),
            (-DVec3::X, 0.25, 0.5),
            (DVec3::Y, 0.0, 1.0),
            (-DVec3::Y, 0.0, 0.0),
            (DVec3::Y + DVec3::Z, 0.5, 0.75),
        ] {
            let uv = ball.texture_coordinates(DVec3::ONE + 2.0 * direction);
            let is_pole = direction.x == 0.0 && direction.z == 0.0;
            assert!((uv.x - u).abs() < 1e-8 || is_pole, "towards {direction}: {uv}");
            assert!((uv.y - v).abs() < 1e-8, "towards {direction}: {uv}");
        }
    }
}
