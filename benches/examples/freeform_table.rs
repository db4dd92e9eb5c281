//! Free forms against meshes of them: rays a second, bytes, seconds to build and what the mesh gets wrong, as a table in Markdown.
//!
//! `cargo run --release -p benches --example freeform_table [LARGEST_PERTURBATIONS]`, on one thread.

use std::f64::consts::TAU;
use std::time::Instant;

use freeform::{FreeForm, Perturbation, Psi, Quadric, Solid, SurfaceMesh};
use glam::{DVec3, Vec3};
use scene::{Description, FormObject, Material, Mesh, Ray, Scene};

const RAYS: u32 = 16_384;
/// Seconds for which a number is measured.
const SECONDS: f64 = 0.4;
/// Meshes beyond are not made.
const TRIANGLES_MAX: usize = 3_000_000;

/// Point k of a Fibonacci spiral on the unit sphere.
fn spiral(k: u32, count: u32) -> DVec3 {
    let y = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(count);
    let angle = f64::from(k) * TAU * 0.618_033_988_749_894_9;
    let r = (1.0 - y * y).sqrt();
    DVec3::new(r * angle.cos(), y, r * angle.sin())
}

fn ball(center: DVec3, radius: f64) -> Quadric {
    Quadric::sphere(center, radius).expect("a ball")
}

/// A ball with swellings and dents in turn all over it, as wide as leaves each place to about three.
fn bumpy(count: u32) -> Solid {
    let radius = (3.0 / f64::from(count.max(1)).sqrt()).min(0.5);
    let perturbation = |k| Perturbation {
        quadric: ball(spiral(k, count), radius),
        factor: if k.is_multiple_of(2) { 0.8 * radius } else { -0.6 * radius },
    };
    FreeForm::new(ball(DVec3::ZERO, 1.0), (0..count).map(perturbation).collect()).expect("sound").into()
}

/// A ball out of which smaller ones are taken, alternately with a union of such.
fn tree(leaves: u32) -> Solid {
    let radius = (1.6 / f64::from(leaves).sqrt()).min(0.5);
    let part = |k| -> Solid { FreeForm::new(ball(spiral(k, leaves), radius), vec![]).expect("sound").into() };
    let body: Solid = FreeForm::new(ball(DVec3::ZERO, 1.0), vec![]).expect("sound").into();
    let union = Solid::union(Psi::Maximum, std::iter::once(body).chain((1..leaves).step_by(2).map(part)).collect());
    let taken = (2..leaves).step_by(2).map(part);
    let parts = std::iter::once(union.expect("parts")).chain(taken).collect();
    Solid::difference(Psi::Maximum, parts).expect("parts")
}

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

fn scene_of_form(solid: &Solid) -> Scene {
    let form = FormObject { name: String::new(), solid: solid.clone(), material: 0, projection: None, copies: vec![] };
    Scene::new(Description { forms: vec![form], materials: vec![Material::default()], ..Description::default() })
        .expect("sound")
}

fn scene_of_mesh(mesh: &SurfaceMesh) -> Scene {
    let mesh = Mesh {
        positions: mesh.positions.iter().map(|p| p.as_vec3()).collect::<Vec<Vec3>>(),
        triangles: mesh.triangles.clone(),
        materials: vec![0; mesh.triangles.len()],
        ..Mesh::default()
    };
    Scene::new(Description { meshes: vec![mesh], materials: vec![Material::default()], ..Description::default() })
        .expect("sound")
}

/// Returns the distance from the surface that all but a hundredth of the middles of edges keep.
fn error(solid: &Solid, mesh: &SurfaceMesh) -> f64 {
    let step = (mesh.triangles.len() / 20_000).max(1);
    let mut distances: Vec<f64> = mesh
        .triangles
        .iter()
        .step_by(step)
        .flat_map(|t| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])])
        .map(|(a, b)| {
            let p = 0.5 * (mesh.positions[a as usize] + mesh.positions[b as usize]);
            (solid.value(p) / solid.gradient(p).length()).abs()
        })
        .collect();
    distances.sort_by(f64::total_cmp);
    distances[distances.len() * 99 / 100]
}

/// Returns the coarsest mesh whose error is at most `share` of the size of the solid, and how long it took to make; `None` where it grows too large.
fn mesh_of_error(solid: &Solid, share: f64) -> Option<(SurfaceMesh, f64)> {
    const SIZE: f64 = 2.0;
    let mut cell = 4.0 * SIZE * share.sqrt();
    loop {
        let start = Instant::now();
        let mesh = solid.to_mesh(cell).expect("a bounded solid");
        let seconds = start.elapsed().as_secs_f64();
        if mesh.triangles.len() > TRIANGLES_MAX {
            return None;
        }
        let found = error(solid, &mesh);
        if found <= share * SIZE {
            return Some((mesh, seconds));
        }
        // The error falls with the square of the cell; a little beyond, to be done next time.
        cell *= (0.9 * (share * SIZE / found).sqrt()).clamp(0.4, 0.9);
    }
}

#[expect(clippy::print_stdout, reason = "the table is the result")]
fn main() {
    let largest: u32 = std::env::args().nth(1).and_then(|n| n.parse().ok()).unwrap_or(512);
    let rays = rays();
    println!("| body | as | triangles | bytes | seconds to make | rays/s | rays that differ |");
    println!("|---|---|---|---|---|---|---|");
    let forms = [0, 1, 8, 64, 512].into_iter().filter(|n| *n <= largest);
    let forms = forms.map(|n| {
        (
            if n == 0 { "sphere".to_owned() } else { format!("{n} perturbation{}", if n == 1 { "" } else { "s" }) },
            bumpy(n),
        )
    });
    let trees = [2, 10, 100, 1000].map(|n| (format!("tree of {n} leaves"), tree(n)));
    for (name, solid) in forms.chain(trees) {
        let scene = scene_of_form(&solid);
        let start = Instant::now();
        let again: Solid = solid.to_string().parse().expect("text is read back");
        let seconds = start.elapsed().as_secs_f64();
        let hits: Vec<Option<f32>> = rays.iter().map(|ray| scene.intersect(ray).map(|hit| hit.t)).collect();
        let (bytes, rate_of_form) = (again.memory_bytes(), rate(&scene, &rays));
        println!(
            "| {name} | form, {} bytes of text | - | {bytes} | {seconds:.1e} | {rate_of_form:.2e} | - |",
            solid.to_string().len()
        );
        for share in [1e-3, 1e-4] {
            let Some((mesh, to_mesh)) = mesh_of_error(&solid, share) else {
                println!("| | mesh at {share:.0e} | over {TRIANGLES_MAX} | - | - | - | - |");
                continue;
            };
            let start = Instant::now();
            let scene = scene_of_mesh(&mesh);
            let seconds = to_mesh + start.elapsed().as_secs_f64();
            let differ =
                rays.iter().zip(&hits).filter(|(ray, hit)| scene.intersect(ray).is_some() != hit.is_some()).count();
            let rate = rate(&scene, &rays);
            println!(
                "| | mesh at {share:.0e} | {} | {} ({:.0} times) | {seconds:.2} | {rate:.2e} ({:.2} times) | {differ} of {RAYS} |",
                mesh.triangles.len(),
                scene.memory_bytes(),
                scene.memory_bytes() as f64 / bytes as f64,
                rate / rate_of_form,
            );
        }
    }
}
