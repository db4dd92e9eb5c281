//! A scene that adds one thing at a time: what each costs, and that what is not there costs nothing, as tables in
//! Markdown.
//!
//! `cargo run --release -p benches --example one_by_one`; a minute on two cores. All bodies stand there from the start,
//! only what they are made of changes.

use benches::renders::{median, processor, render};
use glam::{UVec2, Vec3};
use integrator::{Settings, Statistics};
use scene::{Material, Scene, SpecularKind};
use tests::{Builder, black, cuboid, glass, icosphere, lambert, lamp, mirror};

/// Renderings of each scene; the medians of their times count.
const REPEATS: usize = 3;

/// What there is, each with all before it.
const STEPS: [&str; 6] = ["diffuse", "+ gloss", "+ mirror", "+ glass", "+ second lamp", "+ sky"];

/// All phases that there are, in their order.
const PHASES: [&str; 6] = ["lights", "photons", "cells", "direct", "indirect", "film"];

/// A room without its wall behind the eye; `has` tells what is there of [`STEPS`].
fn scene(has: impl Fn(&str) -> bool) -> Scene {
    let or = |thing: &str, material: Material, albedo: f32| if has(thing) { material } else { lambert(albedo) };
    let coloured = |r, g, b| Material { diffuse: Vec3::new(r, g, b), ..lambert(0.0) };
    let glossy = Material {
        specular: SpecularKind::Ggx { alpha: 0.2, reflectance: Vec3::splat(0.4), schlick: false },
        ..lambert(0.5)
    };
    let second = if has("+ second lamp") { lamp(12.0) } else { black() };
    let room = Builder::default()
        .square(Vec3::NEG_Z, Vec3::Z, 1.0, or("+ gloss", glossy, 0.5))
        .square(Vec3::Z, Vec3::NEG_Z, 1.0, lambert(0.7))
        .square(Vec3::Y, Vec3::NEG_Y, 1.0, lambert(0.7))
        .square(Vec3::NEG_X, Vec3::X, 1.0, coloured(0.6, 0.1, 0.1))
        .square(Vec3::X, Vec3::NEG_X, 1.0, coloured(0.1, 0.5, 0.1))
        .square(Vec3::new(-0.3, 0.2, 0.99), Vec3::NEG_Z, 0.2, lamp(12.0))
        .square(Vec3::new(0.4, -0.3, 0.99), Vec3::NEG_Z, 0.15, second)
        .mesh(cuboid(Vec3::new(-0.8, 0.1, -1.0), Vec3::new(-0.2, 0.7, 0.3)), or("+ mirror", mirror(0.9), 0.7))
        .mesh(cuboid(Vec3::new(0.3, 0.3, -1.0), Vec3::new(0.8, 0.8, -0.4)), lambert(0.7))
        .mesh(icosphere(Vec3::new(0.3, -0.2, -0.65), 0.35, 4), or("+ glass", glass(1.5, 0.0), 0.7))
        .view(Vec3::new(0.0, -3.4, 0.0), Vec3::ZERO, 39.0);
    if has("+ sky") { room.sky(0.5) } else { room }.build()
}

/// One table: a row a step, a column for each of `names`.
#[expect(clippy::print_stdout, reason = "the table is the result")]
fn table(what: &str, names: &[&str], rows: &[Vec<String>]) {
    println!("\n| {what} | {} |", names.join(" | "));
    println!("{}|", "|---".repeat(names.len() + 1));
    for (step, row) in STEPS.iter().zip(rows) {
        println!("| {step} | {} |", row.join(" | "));
    }
}

/// A number in thousands; `-` for nothing at all.
fn thousands(number: u64) -> String {
    if number == 0 { "-".to_owned() } else { format!("{:.1}", number as f64 / 1e3) }
}

#[expect(clippy::print_stdout, reason = "the tables are the result")]
fn main() {
    println!("{}, {} threads", processor(), rayon::current_num_threads());
    let settings = Settings { size: UVec2::splat(256), ..Settings::default() };
    let (mut seconds, mut rays, mut bytes) = (Vec::new(), Vec::new(), Vec::new());
    for step in 0..STEPS.len() {
        let scene = scene(|thing| STEPS[..=step].contains(&thing));
        let runs: Vec<Statistics> = (0..REPEATS).map(|_| render(&scene, &settings).statistics).collect();
        let middle = |time: &dyn Fn(&Statistics) -> f64| format!("{:.3}", median(runs.iter().map(time).collect()));
        let phases = PHASES.iter().map(|phase| middle(&|s| s.seconds(phase)));
        seconds.push(std::iter::once(middle(&|s| s.render_seconds)).chain(phases).collect());
        let (r, m) = (runs[0].rays, runs[0].memory);
        rays.push([r.total(), r.camera, r.shadow, r.path, r.gather, r.hole, r.photon].map(thousands).to_vec());
        let kinds = [m.total(), m.scene, m.photons, m.cells, m.records, m.irradiance_records, m.film];
        bytes.push(kinds.map(thousands).to_vec());
    }
    table("seconds", &[&["all"], PHASES.as_slice()].concat(), &seconds);
    table("thousand rays", &["all", "camera", "shadow", "path", "gather", "hole", "photon"], &rays);
    table("kB", &["all", "scene", "photons", "cells", "records", "of irradiance", "film"], &bytes);
}
