//! Areas of free forms that shine, and what their pictures let through in the mean, each solid's measured once.
//!
//! A copy of a solid that is turned and scaled alike along all axes has its area times the square of the factor. Other
//! copies are measured for themselves.

use std::sync::Arc;

use freeform::Solid;
use glam::Vec3;

use super::form::{FormLight, ball_radius};
use super::pattern::Pattern;
use crate::body::Body;
use crate::projection::Projector;

/// Lines by which an area is found, unless it is known: their count of exits is then good to about a hundredth. It only
/// steers the choice of lights.
const LINES: u32 = 4096;
/// The same for all areas together, so that ten thousand lamps take no longer to set up than a few hundred; each has 64
/// at least.
const LINES_TOTAL: usize = 1 << 20;

/// See the head of the file.
#[derive(Debug)]
pub(crate) struct Areas {
    /// Lines for each area.
    lines: u32,
    /// The solid measured last, with the area of a body and how many times as large that is; copies of a solid come one
    /// after the other.
    last: Option<(Arc<Solid>, (f64, f64))>,
    /// The same for the mean factor of its pictures.
    last_mean: Option<(Arc<Solid>, Vec3)>,
}

impl Areas {
    /// Plans the areas of the `bodies` that shine.
    pub(crate) fn new<'a>(bodies: impl Iterator<Item = &'a Body>) -> Self {
        let mut last: Option<&Arc<Solid>> = None;
        let is_measured = |body: &&'a Body| {
            let before = last.replace(body.solid());
            factor(body).is_none() || before.is_none_or(|before| !Arc::ptr_eq(before, body.solid()))
        };
        let count = bodies.filter(is_measured).count();
        let lines = u32::try_from(LINES_TOTAL / count.max(1)).map_or(LINES, |lines| lines.clamp(64, LINES));
        Self { lines, last: None, last_mean: None }
    }

    /// Returns the area of a light, m^2.
    pub(super) fn of(&mut self, light: &FormLight) -> f64 {
        let measure = || light.measured_area(self.lines);
        let Some(factor) = factor(&light.body) else { return measure() };
        let (area, of_factor) = once(&mut self.last, light.body.solid(), || (measure(), factor));
        area * (factor / of_factor).powi(2)
    }

    /// Returns the mean factor of the pictures of a light. Copies of a solid have the same pictures; those that are
    /// stretched show them in about the same shares.
    pub(super) fn mean_of(&mut self, light: &FormLight, pattern: &Pattern, projector: Option<&Projector>) -> Vec3 {
        once(&mut self.last_mean, light.body.solid(), || light.measured_mean(pattern, projector, self.lines))
    }
}

/// Returns what was measured of the `last` solid if it is this one, else measures this one.
fn once<T: Copy>(last: &mut Option<(Arc<Solid>, T)>, solid: &Arc<Solid>, measure: impl FnOnce() -> T) -> T {
    match last {
        Some((last, value)) if Arc::ptr_eq(last, solid) => *value,
        _ => {
            let value = measure();
            *last = Some((solid.clone(), value));
            value
        }
    }
}

/// Returns how many times as large as its solid a body is; `None` where it is stretched.
fn factor(body: &Body) -> Option<f64> {
    body.world_to_local().map_or(Some(1.0), |m| ball_radius(m.matrix3))
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DQuat, DVec3, Vec3};

    use super::*;

    #[test]
    fn copies_have_the_area_of_their_solid_times_the_square_of_their_factor() {
        let bar = Arc::new(Solid::cuboid(DVec3::ZERO, DVec3::new(3.0, 1.0, 0.5)).unwrap());
        let place = |scale: DVec3, angle: f64| {
            let turn = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), angle);
            let to_world = DAffine3::from_scale_rotation_translation(scale, turn, DVec3::new(5.0, -2.0, 1.0));
            Body::placed(bar.clone(), &to_world)
        };
        let alike = [(2.0, 0.0), (1.0, 0.7), (0.25, 2.0), (30.0, -1.0)];
        let mut bodies: Vec<Body> = alike.map(|(factor, angle)| place(DVec3::splat(factor), angle)).into();
        bodies.push(place(DVec3::new(2.0, 1.0, 1.0), 0.3));
        bodies.push(Body::new(bar.clone()));
        let mut areas = Areas::new(bodies.iter());
        assert_eq!(areas.lines, LINES, "few are measured");
        let mut area = |body| FormLight::new(body, Vec3::ONE, 1.0, 0, &mut areas).expect("it shines").area;
        let found: Vec<f64> = bodies.iter().map(&mut area).collect();
        let exact = 2.0 * (3.0 + 1.5 + 0.5);
        assert!((found[0] / (4.0 * exact) - 1.0).abs() < 0.02, "the first is measured: {}", found[0]);
        for ((factor, _), area) in alike.into_iter().zip(&found) {
            assert!((area / (found[0] / 4.0 * factor * factor) - 1.0).abs() < 1e-9, "{factor} times: {area}");
        }
        let stretched = 2.0 * (6.0 + 3.0 + 0.5);
        assert!((found[4] / stretched - 1.0).abs() < 0.02, "stretched, by itself: {}", found[4]);
        assert!((found[5] / (0.25 * found[0]) - 1.0).abs() < 1e-9, "as it is described: {}", found[5]);
        // A hundred thousand copies leave one solid all of its lines.
        let crowd = vec![bodies[1].clone(); 100_000];
        assert_eq!(Areas::new(crowd.iter()).lines, LINES, "one solid");
        let stretched = vec![bodies[4].clone(); 100_000];
        assert_eq!(Areas::new(stretched.iter()).lines, 64, "each for itself");
    }
}
