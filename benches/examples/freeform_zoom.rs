//! What a zoom onto the outline of a body shows of it as a form and as meshes: the error of the silhouette in pixels, as a table in Markdown.
//!
//! `cargo run --release -p benches --example freeform_zoom`. The camera stands 3 metres from points of the outline, and 512 pixels show 45 degrees over the zoom: by how many pixels
//! the last ray that hits is off. Rays are those of the renderer, whose directions are rounded to single precision; the truth is found in f64, for the
//! directions that were meant.

use benches::bodies::{bumpy, mesh_of_error, scene_of_form, scene_of_mesh, spiral};
use freeform::Solid;
use glam::DVec3;
use scene::{Ray, Scene};

/// Distance of the camera, metres.
const DISTANCE: f64 = 3.0;
/// Radians across a pixel without zoom.
const PIXEL: f64 = std::f64::consts::FRAC_PI_4 / 512.0;
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

/// Returns the median and the largest error of the outline, in pixels, and how many were compared.
fn errors(solid: &Solid, scene: &Scene, zoom: f64) -> (f64, f64, usize) {
    let error = |k: u32| {
        let view = View::new(solid, k)?;
        let truth = view.outline(|d| solid.any_hit(&freeform::Ray::new(view.eye, d)))?;
        let found = view.outline(|d| scene.occluded(&Ray::new(view.eye.as_vec3().into(), d.as_vec3().into())))?;
        Some((found - truth).abs() / PIXEL * zoom)
    };
    let mut errors: Vec<f64> = (0..POINTS).filter_map(error).collect();
    errors.sort_by(f64::total_cmp);
    (errors[errors.len() / 2], errors[errors.len() - 1], errors.len())
}

#[expect(clippy::print_stdout, reason = "the table is the result")]
fn main() {
    println!(
        "| body | zoom | outlines | form, median | largest | mesh at 1e-3, median | largest | mesh at 1e-4, median | largest |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for (name, count) in [("sphere", 0), ("8 perturbations", 8)] {
        let solid = bumpy(count);
        let form = scene_of_form(&solid);
        let meshes = [1e-3, 1e-4].map(|share| scene_of_mesh(&mesh_of_error(&solid, share).expect("small enough").0));
        for zoom in [1.0, 10.0, 100.0, 1e3, 1e4] {
            let (median, most, outlines) = errors(&solid, &form, zoom);
            let [coarse, fine] = meshes.each_ref().map(|mesh| errors(&solid, mesh, zoom));
            println!(
                "| {name} | {zoom} | {outlines} | {median:.1e} | {most:.1e} | {:.2} | {:.2} | {:.2} | {:.2} |",
                coarse.0, coarse.1, fine.0, fine.1
            );
        }
    }
}
