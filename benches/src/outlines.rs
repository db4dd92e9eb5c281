//! Outlines of bodies, and how far off those are that a scene shows of them.
//!
//! Rays are those of the renderer, whose directions are rounded to single precision; the truth is found in f64, for the
//! directions that were meant.

use freeform::Solid;
use glam::DVec3;
use scene::{Ray, Scene};

use crate::bodies::spiral;

/// Distance of the camera, metres.
pub const DISTANCE: f64 = 3.0;
/// Outlines that are looked at.
const POINTS: u32 = 400;

/// A camera before a point of the outline.
struct View {
    eye: DVec3,
    forward: DVec3,
    /// At right angles to it, out of the body.
    up: DVec3,
}

impl View {
    /// Looks at point k of the outline; `None` where the surface is hollow along the view, so that there is no outline.
    fn new(solid: &Solid, k: u32) -> Option<Self> {
        let direction = -spiral(k, POINTS);
        let hit = solid.first_hit(&freeform::Ray::new(-3.0 * direction, direction))?;
        let p = -3.0 * direction + hit.t * direction;
        let up = solid.normal(p, direction);
        let forward = up.any_orthonormal_vector();
        const ASIDE: f64 = 0.02;
        let is_outline = [ASIDE, -ASIDE].into_iter().all(|aside| solid.value(p + aside * forward) < 0.0);
        // Cameras stand in f32.
        let eye = (p - DISTANCE * forward).as_vec3().as_dvec3();
        (is_outline && solid.value(eye) < 0.0).then_some(Self { eye, forward, up })
    }

    fn direction(&self, angle: f64) -> DVec3 {
        self.forward * angle.cos() + self.up * angle.sin()
    }

    /// Returns the largest angle at which `hits` says so; by bisection.
    fn outline(&self, hits: impl Fn(DVec3) -> bool) -> Option<f64> {
        let is_met = |angle: f64| hits(self.direction(angle));
        const REACH: f64 = 0.3;
        let (mut low, mut high) = (-REACH, REACH);
        if !is_met(low) || is_met(high) {
            return None;
        }
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if is_met(middle) { low = middle } else { high = middle }
        }
        Some(low)
    }
}

/// How far an outline is off at points around a body, radians seen from the camera.
#[derive(Debug, Clone, Copy)]
pub struct OutlineError {
    /// The median.
    pub median: f64,
    /// What all but a hundredth keep. Where ridges stand before each other there are several outlines, and the search
    /// may end at another one.
    pub most: f64,
    /// Points that were compared.
    pub points: usize,
}

/// Returns how far the outline that a scene shows is off from that of the solid.
///
/// # Panics
/// If the solid has no outline that both show.
#[must_use]
pub fn outline_error(solid: &Solid, scene: &Scene) -> OutlineError {
    let error = |k: u32| {
        let view = View::new(solid, k)?;
        let truth = view.outline(|d| solid.any_hit(&freeform::Ray::new(view.eye, d)))?;
        let found = view.outline(|d| scene.occluded(&Ray::new(view.eye.as_vec3().into(), d.as_vec3().into())))?;
        Some((found - truth).abs())
    };
    let mut errors: Vec<f64> = (0..POINTS).filter_map(error).collect();
    errors.sort_by(f64::total_cmp);
    OutlineError { median: errors[errors.len() / 2], most: errors[errors.len() * 99 / 100], points: errors.len() }
}
