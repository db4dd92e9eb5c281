//! The directions from a point towards an ellipsoid or a box, uniform per solid angle: where to look for a body within.
//!
//! An ellipsoid is a ball after an affine map A, and directions to it are those of a cone: chosen uniformly in the cone
//! of the ball and mapped back, their density is that of the cone times |det A| / |A w|^3. Of a box the sides that face
//! the point cover its directions without overlap; each is a spherical rectangle. A point within a box looks
//! everywhere.

use std::f64::consts::TAU;

use glam::{DAffine3, DMat3, DVec2, DVec3, Vec2};
use hemimap::double::Frame;

use super::spherical_rectangle::SphericalRectangle;

/// A closed region of space in which a body lies.
#[derive(Debug, Clone, Copy)]
pub(super) enum Region {
    /// An ellipsoid that is the body itself; this maps it to the unit ball.
    Ellipsoid(DAffine3),
    /// A box around the body.
    Box { min: DVec3, max: DVec3 },
}

/// A box whose half diagonal is a smaller share of its distance is taken as a ball: the angles of its sides would lose
/// their digits.
const FAR: f64 = 1e-3;

impl Region {
    /// Chooses a unit direction from `p` into the region; with its density per steradian. `None` within the ellipsoid.
    pub(super) fn sample(&self, p: DVec3, u: Vec2) -> Option<(DVec3, f64)> {
        let u = u.as_dvec2();
        match self {
            Self::Ellipsoid(to_unit) => {
                let towards = -to_unit.transform_point3(p);
                let cone = Cone::new(towards.length())?;
                let local = cone.sample(u.x, u.y);
                let in_unit = Frame::from_normal(towards.normalize()).to_world(local);
                let wi = (to_unit.matrix3.inverse() * in_unit).normalize();
                Some((wi, cone.pdf() * stretch(to_unit.matrix3, wi)))
            }
            Self::Box { min, max } => match BoxView::new(p, *min, *max) {
                BoxView::Within => Some((uniform_direction(u.x, u.y), 1.0 / (2.0 * TAU))),
                BoxView::Far { towards, cone } => {
                    let frame = Frame::from_normal(towards);
                    Some((frame.to_world(cone.sample(u.x, u.y)), cone.pdf()))
                }
                BoxView::Sides(sides) => {
                    let total = solid_angle(&sides);
                    let mut area = u.x * total;
                    // The last side also takes what rounding leaves of the sum.
                    let last = sides.iter().rposition(Option::is_some)?;
                    for (index, side) in sides.iter().enumerate() {
                        let Some(side) = side else { continue };
                        if area < side.rectangle.solid_angle || index == last {
                            let wi = side.sample((area / side.rectangle.solid_angle).min(1.0), u.y);
                            return Some((wi, 1.0 / total));
                        }
                        area -= side.rectangle.solid_angle;
                    }
                    None
                }
            },
        }
    }

    /// Returns the density of [`Region::sample`] for a direction from `p` that meets the region, per steradian.
    pub(super) fn pdf(&self, p: DVec3, wi: DVec3) -> f64 {
        match self {
            Self::Ellipsoid(to_unit) => {
                let cone = Cone::new(to_unit.transform_point3(p).length());
                cone.map_or(0.0, |cone| cone.pdf() * stretch(to_unit.matrix3, wi))
            }
            Self::Box { min, max } => match BoxView::new(p, *min, *max) {
                BoxView::Within => 1.0 / (2.0 * TAU),
                BoxView::Far { cone, .. } => cone.pdf(),
                BoxView::Sides(sides) => 1.0 / solid_angle(&sides),
            },
        }
    }
}

/// Returns by how much the linear map `m` stretches solid angles at the unit vector `w`.
fn stretch(m: DMat3, w: DVec3) -> f64 {
    m.determinant().abs() / (m * w).length().powi(3)
}

fn uniform_direction(u: f64, v: f64) -> DVec3 {
    let z = 1.0 - 2.0 * u;
    let (sin, cos) = (TAU * v).sin_cos();
    let r = (1.0 - z * z).max(0.0).sqrt();
    DVec3::new(r * cos, r * sin, z)
}

/// The cone of directions to a ball, around z.
pub(super) struct Cone {
    /// 1 less the cosine of its half-angle.
    pub(super) depth: f64,
}

impl Cone {
    /// All directions.
    pub(super) const WHOLE: Self = Self { depth: 2.0 };

    /// To a ball of radius 1; `None` within it.
    fn new(distance: f64) -> Option<Self> {
        Self::of_sine(distance.powi(-2))
    }

    /// By the square of the sine of the half-angle; `None` where that is from 1 on.
    pub(super) fn of_sine(sin_sq: f64) -> Option<Self> {
        // 1 - cos, without cancellation for far balls.
        (sin_sq < 1.0).then(|| Self { depth: sin_sq / (1.0 + (1.0 - sin_sq).sqrt()) })
    }

    /// Returns the direction to which a point of the unit disk is mapped; equal areas become equal solid angles.
    pub(super) fn at(&self, disk: DVec2) -> DVec3 {
        let below = disk.length_squared() * self.depth;
        let across = disk * (self.depth * (2.0 - below)).sqrt();
        DVec3::new(across.x, across.y, 1.0 - below)
    }

    fn pdf(&self) -> f64 {
        1.0 / (TAU * self.depth)
    }

    fn sample(&self, u: f64, v: f64) -> DVec3 {
        let below = u * self.depth;
        let r = (below * (2.0 - below)).sqrt();
        let (sin, cos) = (TAU * v).sin_cos();
        DVec3::new(r * cos, r * sin, 1.0 - below)
    }
}

/// A box as a point sees it.
#[expect(clippy::large_enum_variant, reason = "it lives on the stack for one sample")]
enum BoxView {
    Within,
    Far { towards: DVec3, cone: Cone },
    Sides([Option<Side>; 3]),
}

impl BoxView {
    fn new(p: DVec3, min: DVec3, max: DVec3) -> Self {
        let (lo, hi) = (min - p, max - p);
        if lo.cmple(DVec3::ZERO).all() && hi.cmpge(DVec3::ZERO).all() {
            return Self::Within;
        }
        let towards = 0.5 * (lo + hi);
        let (distance, radius) = (towards.length(), 0.5 * (hi - lo).length());
        if radius < FAR * distance
            && let Some(cone) = Cone::new(distance / radius)
        {
            return Self::Far { towards: towards / distance, cone };
        }
        Self::Sides(std::array::from_fn(|axis| {
            let z = if lo[axis] > 0.0 {
                lo[axis]
            } else if hi[axis] < 0.0 {
                hi[axis]
            } else {
                return None;
            };
            let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
            let (low, high) = (DVec2::new(lo[a], lo[b]), DVec2::new(hi[a], hi[b]));
            // The formulas look along -z; a mirrored rectangle has the same angles.
            SphericalRectangle::new(low, high, z.abs()).map(|rectangle| Side { axis, z, rectangle })
        }))
    }
}

fn solid_angle(sides: &[Option<Side>; 3]) -> f64 {
    sides.iter().flatten().map(|side| side.rectangle.solid_angle).sum()
}

/// A side of a box that faces the origin. Local x and y are the two axes after that at right angles to it, in their
/// cyclic order.
struct Side {
    axis: usize,
    /// Height over the origin along the axis, of either sign.
    z: f64,
    rectangle: SphericalRectangle,
}

impl Side {
    /// Returns a unit direction that is uniform per solid angle.
    fn sample(&self, u: f64, v: f64) -> DVec3 {
        let place = self.rectangle.sample(u, v);
        let mut wi = DVec3::ZERO;
        wi[self.axis] = self.z;
        wi[(self.axis + 1) % 3] = place.x;
        wi[(self.axis + 2) % 3] = place.y;
        wi.normalize()
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    /// Asserts that samples lie in the region, have the density that `pdf` says, and are uniform: the mean of any
    /// function of direction is its integral over the density.
    fn assert_uniform(region: &Region, p: DVec3, is_met: impl Fn(DVec3) -> bool, what: &str) {
        // Stratified in both numbers; the error of the mean of a smooth function is then far below 1/n.
        let n = 200u32;
        let (mut count, mut sum, mut moments) = (0.0, DVec3::ZERO, 0.0);
        for i in 0..n * n {
            let u = Vec2::new((i % n) as f32 + 0.5, (i / n) as f32 + 0.5) / n as f32;
            let (wi, pdf) = region.sample(p, u).expect("outside");
            assert!(wi.is_normalized() && is_met(wi), "{what}: {wi} at {u}");
            let again = region.pdf(p, wi);
            assert!((pdf / again - 1.0).abs() < 1e-6, "{what}: density {pdf}, again {again}");
            count += 1.0 / pdf;
            sum += wi / pdf;
            moments += wi.x * wi.y / pdf;
        }
        // The same integrals over a grid of directions.
        let m = 2000u32;
        let (mut grid_count, mut grid_sum, mut grid_moments) = (0.0, DVec3::ZERO, 0.0);
        for i in 0..m * m {
            let wi =
                uniform_direction((f64::from(i % m) + 0.5) / f64::from(m), (f64::from(i / m) + 0.5) / f64::from(m));
            if is_met(wi) {
                grid_count += 1.0;
                grid_sum += wi;
                grid_moments += wi.x * wi.y;
            }
        }
        let cell = 4.0 * PI / f64::from(m * m);
        let (count, sum, moments) = (count / f64::from(n * n), sum / f64::from(n * n), moments / f64::from(n * n));
        let tolerance = 2e-3 * (grid_count * cell).max(1e-2);
        assert!((count - grid_count * cell).abs() < tolerance, "{what}: {count} sr, not {}", grid_count * cell);
        assert!((sum - grid_sum * cell).length() < tolerance, "{what}: {sum}, not {}", grid_sum * cell);
        assert!((moments - grid_moments * cell).abs() < tolerance, "{what}: {moments}, not {}", grid_moments * cell);
    }

    #[test]
    fn ellipsoids_are_seen_whole_and_uniformly_in_their_own_space() {
        let to_world = DAffine3::from_scale_rotation_translation(
            DVec3::new(0.2, 1.0, 0.5),
            glam::DQuat::from_rotation_z(0.6) * glam::DQuat::from_rotation_x(1.1),
            DVec3::new(0.3, -0.2, 0.5),
        );
        let to_unit = to_world.inverse();
        let region = Region::Ellipsoid(to_unit);
        for p in [DVec3::new(1.5, 0.5, 2.0), DVec3::new(0.3, -0.2, 2.2), DVec3::new(-4.0, 3.0, 1.0)] {
            let is_met = |wi: DVec3| {
                let (o, d) = (to_unit.transform_point3(p), to_unit.transform_vector3(wi));
                let along = o.dot(d);
                along < 0.0 && along * along >= d.length_squared() * (o.length_squared() - 1.0) * (1.0 - 1e-9)
            };
            assert_uniform(&region, p, is_met, "ellipsoid");
        }
        assert!(region.sample(DVec3::new(0.3, -0.2, 0.5), Vec2::splat(0.5)).is_none(), "not from within");
        assert_eq!(region.pdf(DVec3::new(0.3, -0.2, 0.5), DVec3::X), 0.0, "nor by chance");
    }

    #[test]
    fn boxes_are_seen_whole_and_uniformly() {
        let (min, max) = (DVec3::new(-1.0, -0.5, 0.0), DVec3::new(1.0, 0.25, 0.125));
        let region = Region::Box { min, max };
        for (p, what) in [
            (DVec3::new(0.2, 0.1, -1.0), "one side"),
            (DVec3::new(3.0, 0.1, -1.0), "two sides"),
            (DVec3::new(-1.5, -0.7, 0.3), "three sides"),
            (DVec3::new(0.3, 0.2, 0.1251), "just over a side"),
            (DVec3::new(1.2, 0.2, 0.0), "in the plane of a side"),
        ] {
            let is_met = |wi: DVec3| {
                let (a, b) = ((min - p) / wi, (max - p) / wi);
                a.min(b).max_element() <= a.max(b).min_element() + 1e-9 && a.max(b).min_element() >= 0.0
            };
            assert_uniform(&region, p, is_met, what);
        }
        assert_uniform(&region, DVec3::new(0.5, 0.0, 0.1), |_| true, "within");
    }

    #[test]
    fn far_boxes_keep_their_solid_angle() {
        let region = Region::Box { min: DVec3::splat(-0.5), max: DVec3::splat(0.5) };
        // Just within FAR the sides are seen, just beyond the ball around them.
        let near = 1.0 / region.pdf(DVec3::Z * 860.0, -DVec3::Z);
        assert!((near * 859.5_f64.powi(2) - 1.0).abs() < 1e-5, "a square at its distance: {near}");
        let far = 1.0 / region.pdf(DVec3::Z * 1e6, -DVec3::Z);
        assert!((far * 1e12 / (PI * 0.75) - 1.0).abs() < 1e-6, "the disc of a ball of radius sqrt(3)/2: {far}");
    }
}
