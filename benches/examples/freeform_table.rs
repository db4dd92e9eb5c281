//! Free forms against meshes of them: rays a second, bytes, seconds to build and what the mesh gets wrong, as a table
//! in Markdown.
//!
//! `cargo run --release -p benches --example freeform_table [BODY]...`, on one thread; a body by its name in the table,
//! all without any.

use std::time::Instant;

use benches::bodies::{
    SIZE, TRIANGLES_MAX, body_name, bumpy, mesh_of_error, scene_of_form, scene_of_mesh, spiral, tree,
};
use benches::outlines::{DISTANCE, outline_error};
use freeform::{Psi, Solid};
use scene::{Ray, Scene};

const RAYS: u32 = 16_384;
/// Seconds for which a number is measured.
const SECONDS: f64 = 0.4;

fn rays() -> Vec<Ray> {
    (0..RAYS)
        .map(|k| {
            let origin = 3.0 * spiral(k, RAYS);
            let aim = 0.95 * spiral(k.wrapping_mul(6151) % RAYS, RAYS);
            Ray::new(origin.as_vec3().into(), (aim - origin).normalize().as_vec3().into())
        })
        .collect()
}

/// Returns rays a second of the best of three runs.
fn rate(scene: &Scene, rays: &[Ray]) -> f64 {
    let mut best = 0.0_f64;
    for _ in 0..3 {
        let (start, mut count, mut hits) = (Instant::now(), 0, 0);
        while start.elapsed().as_secs_f64() < SECONDS {
            hits += rays.iter().filter(|ray| scene.intersect(ray).is_some()).count();
            count += rays.len();
        }
        assert!(hits > count / 2, "most rays hit");
        best = best.max(count as f64 / start.elapsed().as_secs_f64());
    }
    best
}

/// How far the outline is off, as shares of the size of the body.
fn outline(solid: &Solid, scene: &Scene) -> String {
    let error = outline_error(solid, scene);
    let share = |angle: f64| angle * DISTANCE / SIZE;
    format!("{:.1e}, {:.1e}", share(error.median), share(error.most))
}

#[expect(clippy::print_stdout, reason = "the table is the result")]
fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    let rays = rays();
    println!(
        "| body | as | triangles | bytes | seconds to make | rays/s | rays that differ | outline off by, of the size: median, 99 in 100 |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let forms = [0, 1, 8, 64, 512].map(|n| (body_name(n), bumpy(n)));
    let trees = [2, 10, 100, 1000].map(|n| (format!("tree of {n} leaves"), tree(n, Psi::Maximum)));
    let blend = Psi::Blend { width: 0.2 };
    let blends = [2, 10, 100].map(|n| (format!("blend of {n} leaves"), tree(n, blend)));
    for (name, solid) in forms.into_iter().chain(trees).chain(blends) {
        if !(wanted.is_empty() || wanted.contains(&name)) {
            continue;
        }
        let scene = scene_of_form(&solid);
        let start = Instant::now();
        let again: Solid = solid.to_string().parse().expect("text is read back");
        let seconds = start.elapsed().as_secs_f64();
        let hits: Vec<Option<f32>> = rays.iter().map(|ray| scene.intersect(ray).map(|hit| hit.t)).collect();
        let (bytes, rate_of_form) = (again.memory_bytes(), rate(&scene, &rays));
        println!(
            "| {name} | form, {} bytes of text | - | {bytes} | {seconds:.1e} | {rate_of_form:.2e} | - | {} |",
            solid.to_string().len(),
            outline(&solid, &scene),
        );
        for share in [1e-3, 1e-4] {
            let Some((mesh, to_mesh)) = mesh_of_error(&solid, share) else {
                println!("| | mesh at {share:.0e} | over {TRIANGLES_MAX} | - | - | - | - | - |");
                continue;
            };
            let start = Instant::now();
            let scene = scene_of_mesh(&mesh);
            let seconds = to_mesh + start.elapsed().as_secs_f64();
            let differ =
                rays.iter().zip(&hits).filter(|(ray, hit)| scene.intersect(ray).is_some() != hit.is_some()).count();
            let rate = rate(&scene, &rays);
            println!(
                "| | mesh at {share:.0e} | {} | {} ({:.0} times) | {seconds:.2} | {rate:.2e} ({:.2} times) | {differ} of {RAYS} | {} |",
                mesh.triangles.len(),
                scene.memory_bytes(),
                scene.memory_bytes() as f64 / bytes as f64,
                rate / rate_of_form,
                outline(&solid, &scene),
            );
        }
    }
}
