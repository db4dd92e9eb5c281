//! What a zoom onto the outline of a body shows of it as a form and as meshes: the error of the silhouette in pixels,
//! as a table in Markdown.
//!
//! `cargo run --release -p benches --example freeform_zoom`. The camera stands 3 metres from points of the outline, and
//! 512 pixels show 45 degrees over the zoom: by how many pixels the last ray that hits is off.

use benches::bodies::{bumpy, mesh_of_error, scene_of_form, scene_of_mesh, tree};
use benches::outlines::outline_error;
use freeform::Psi;

/// Radians across a pixel without zoom.
const PIXEL: f64 = std::f64::consts::FRAC_PI_4 / 512.0;

#[expect(clippy::print_stdout, reason = "the table is the result")]
fn main() {
    println!(
        "| body | zoom | outlines | form, median | 99 in 100 | mesh at 1e-3, median | 99 in 100 | mesh at 1e-4, median | 99 in 100 |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for (name, solid) in [
        ("sphere", bumpy(0)),
        ("8 perturbations", bumpy(8)),
        ("tree of 10 leaves", tree(10, Psi::Maximum)),
        ("blend of 10 leaves", tree(10, Psi::Blend { width: 0.2 })),
    ] {
        let form = outline_error(&solid, &scene_of_form(&solid));
        let [coarse, fine] = [1e-3, 1e-4]
            .map(|share| outline_error(&solid, &scene_of_mesh(&mesh_of_error(&solid, share).expect("small enough").0)));
        for zoom in [1.0, 10.0, 100.0, 1e3, 1e4] {
            let pixels = |angle: f64| angle / PIXEL * zoom;
            println!(
                "| {name} | {zoom} | {} | {:.1e} | {:.1e} | {:.2} | {:.2} | {:.2} | {:.2} |",
                form.points,
                pixels(form.median),
                pixels(form.most),
                pixels(coarse.median),
                pixels(coarse.most),
                pixels(fine.median),
                pixels(fine.most)
            );
        }
    }
}
