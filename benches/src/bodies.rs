//! Bodies of which the tables of free forms are made, and meshes of them.

use std::f64::consts::TAU;
use std::time::Instant;

use freeform::{FreeForm, Perturbation, Psi, Quadric, Solid, SurfaceMesh};
use glam::{DVec3, Vec3};
use scene::{Description, FormObject, Material, Mesh, Scene};

/// The bodies' size, metres.
pub const SIZE: f64 = 2.0;
/// Meshes of more triangles are not made.
pub const TRIANGLES_MAX: usize = 3_000_000;

/// Returns point k of a Fibonacci spiral on the unit sphere.
#[must_use]
pub fn spiral(k: u32, count: u32) -> DVec3 {
    let y = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(count);
    let angle = f64::from(k) * TAU * 0.618_033_988_749_894_9;
    let r = (1.0 - y * y).sqrt();
    DVec3::new(r * angle.cos(), y, r * angle.sin())
}

fn ball(center: DVec3, radius: f64) -> Quadric {
    Quadric::sphere(center, radius).expect("a ball")
}

/// Returns the name of [`bumpy`] in tables.
#[must_use]
pub fn body_name(count: u32) -> String {
    match count {
        0 => "sphere".to_owned(),
        1 => "1 perturbation".to_owned(),
        _ => format!("{count} perturbations"),
    }
}

/// Returns a ball with swellings and dents in turn all over it, as wide as leaves each place to about three.
///
/// # Panics
/// Never for sound arguments.
#[must_use]
pub fn bumpy(count: u32) -> Solid {
    let radius = (3.0 / f64::from(count.max(1)).sqrt()).min(0.5);
    let perturbation = |k| Perturbation {
        quadric: ball(spiral(k, count), radius),
        factor: if k.is_multiple_of(2) { 0.8 * radius } else { -0.6 * radius },
    };
    FreeForm::new(ball(DVec3::ZERO, 1.0), (0..count).map(perturbation).collect()).expect("sound").into()
}

/// Returns a ball out of which smaller ones are taken, alternately with a union of such.
///
/// # Panics
/// Never for sound arguments.
#[must_use]
pub fn tree(leaves: u32, psi: Psi) -> Solid {
    let radius = (1.6 / f64::from(leaves).sqrt()).min(0.5);
    let part = |k| -> Solid { FreeForm::new(ball(spiral(k, leaves), radius), vec![]).expect("sound").into() };
    let body: Solid = FreeForm::new(ball(DVec3::ZERO, 1.0), vec![]).expect("sound").into();
    let union = Solid::union(psi, std::iter::once(body).chain((1..leaves).step_by(2).map(part)).collect());
    let taken = (2..leaves).step_by(2).map(part);
    let parts = std::iter::once(union.expect("parts")).chain(taken).collect();
    Solid::difference(psi, parts).expect("parts")
}

/// Returns a scene of one free form.
///
/// # Panics
/// Never for sound arguments.
#[must_use]
pub fn scene_of_form(solid: &Solid) -> Scene {
    let form = FormObject { name: String::new(), solid: solid.clone(), material: 0, projection: None, copies: vec![] };
    Scene::new(Description { forms: vec![form], materials: vec![Material::default()], ..Description::default() })
        .expect("sound")
}

/// Returns a scene of one mesh.
///
/// # Panics
/// Never for sound arguments.
#[must_use]
pub fn scene_of_mesh(mesh: &SurfaceMesh) -> Scene {
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

/// Returns the coarsest mesh whose error is at most `share` of the size of the solid, and how long it took to make;
/// `None` where it grows too large.
///
/// # Panics
/// Never for sound arguments.
#[must_use]
pub fn mesh_of_error(solid: &Solid, share: f64) -> Option<(SurfaceMesh, f64)> {
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
