//! A metal floor from rough to smooth: error and time, across the roughness from which on a lobe is traced and reads no
//! texture, as a table in Markdown.
//!
//! `cargo run --release -p benches --example roughness [ALPHA]...`, from rough to smooth, 14 of them without any; five
//! minutes on two cores, most of them for the references by the path tracer.

use benches::renders::{Runs, processor, render};
use glam::{UVec2, Vec3};
use integrator::metrics::{Batches, Image, Reference};
use integrator::{Method, Settings};
use scene::{Material, Scene, SpecularKind};
use tests::{Builder, cuboid, icosphere, lambert, lamp};

const SIDE: u32 = 96;
/// Pictures of each kind, with seeds of their own.
const SEEDS: u64 = 3;
/// Independent pictures of a reference, whose spread is its noise, and samples a pixel of each.
const BATCHES: u64 = 16;
const REFERENCE_SPP: u32 = 64;
/// Seeds of references, apart from those of pictures.
const REFERENCE_SEED: u64 = 1 << 32;

const METHODS: [Method; 2] = [Method::Reproject, Method::Gather];

/// Narrower lobes are traced by default.
const CROSSOVER: f32 = 0.5;
/// Just above and just below it, and what is around.
const ALPHAS: [f32; 14] = [1.0, 0.7, 0.51, 0.49, 0.4, 0.3, 0.2, 0.12, 0.09, 0.06, 0.03, 0.01, 0.003, 0.001];

/// A closed room with a box and a ball on its floor, which is glossy.
fn scene(alpha: f32) -> Scene {
    let coloured = |r, g, b| Material { diffuse: Vec3::new(r, g, b), ..lambert(0.0) };
    let specular = SpecularKind::Ggx { alpha, reflectance: Vec3::splat(0.6), schlick: false };
    Builder::default()
        .square(Vec3::NEG_Z, Vec3::Z, 1.0, Material { specular, ..lambert(0.0) })
        .square(Vec3::Z, Vec3::NEG_Z, 1.0, lambert(0.7))
        .square(Vec3::Y, Vec3::NEG_Y, 1.0, lambert(0.7))
        .square(Vec3::NEG_Y, Vec3::Y, 1.0, lambert(0.7))
        .square(Vec3::NEG_X, Vec3::X, 1.0, coloured(0.6, 0.1, 0.1))
        .square(Vec3::X, Vec3::NEG_X, 1.0, coloured(0.1, 0.5, 0.1))
        .square(Vec3::new(0.0, 0.0, 0.99), Vec3::NEG_Z, 0.5, lamp(4.0))
        .mesh(cuboid(Vec3::new(-0.7, 0.2, -1.0), Vec3::new(-0.2, 0.7, -0.1)), coloured(0.7, 0.6, 0.2))
        .mesh(icosphere(Vec3::new(0.4, 0.3, -0.65), 0.35, 4), coloured(0.2, 0.4, 0.7))
        .view(Vec3::new(0.0, -0.95, 0.2), Vec3::new(0.0, 0.3, -0.65), 70.0)
        .build()
}

fn reference(scene: &Scene) -> Reference {
    let size = UVec2::splat(SIDE);
    let mut batches = Batches::new(size);
    for batch in 0..BATCHES {
        let seed = REFERENCE_SEED + batch;
        let settings = Settings { method: Method::Path, spp: Some(REFERENCE_SPP), size, seed, ..Settings::default() };
        let picture = render(scene, &settings).film.picture();
        batches.add(&Image::new(size, &picture).expect("a full picture")).expect("pictures of one size");
    }
    batches.mean().expect("some pictures")
}

#[expect(clippy::print_stdout, reason = "the table is the result")]
fn main() {
    let wanted: Vec<f32> = std::env::args().skip(1).map(|alpha| alpha.parse().expect("a number")).collect();
    let alphas = if wanted.is_empty() { ALPHAS.to_vec() } else { wanted };
    println!("{}, {} threads, {SIDE} x {SIDE}\n", processor(), rayon::current_num_threads());
    println!(
        "| alpha | reference's own | reproject s | relMSE | robust | ratio of means | gather s | relMSE | robust | ratio of means |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for (number, alpha) in alphas.iter().copied().enumerate() {
        let scene = scene(alpha);
        let reference = reference(&scene);
        let own = reference.own_rel_mse().expect("a finite picture").expect("there are several batches");
        print!("| {alpha} | {:.1e} |", own.robust);
        for method in METHODS {
            let mut runs = Runs::default();
            for seed in 0..SEEDS {
                let settings = Settings { method, size: UVec2::splat(SIDE), seed, ..Settings::default() };
                runs.add(&scene, &settings, &reference);
            }
            let [plain, robust] = runs.errors(&reference).expect("a finite reference");
            // The first that is traced instead of looked up in the texture.
            let is_first = number > 0 && alpha < CROSSOVER && alphas[number - 1] >= CROSSOVER;
            let mark = if is_first { " (traced)" } else { "" };
            print!(" {:.3}{mark} | {plain} | {robust} | {:.4} |", runs.seconds(), runs.ratio());
        }
        println!();
    }
}
