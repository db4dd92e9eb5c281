//! Whether `--error` keeps its word in scenes on which nothing was fitted: what is stated and what is true, as a table
//! in Markdown.
//!
//! `cargo run --release -p benches --example asked_error`; ten minutes on two cores, half of them for the references by
//! the path tracer.

use benches::renders::{processor, render};
use glam::{UVec2, Vec3};
use integrator::metrics::{Batches, Image, Reference};
use integrator::{Method, Settings, render_to_error};
use scene::{Material, Scene};
use tests::{Builder, Exceeded, cuboid, glass, gloss, icosphere, lambert, lamp, mirror};

const SIZE: UVec2 = UVec2::splat(128);
/// Independent pictures of a reference, whose spread is its noise, and samples a pixel of each.
const BATCHES: u64 = 16;
const REFERENCE_SPP: u32 = 512;
/// Seeds of references, apart from those of pictures.
const REFERENCE_SEED: u64 = 1 << 32;
/// Relative errors that are asked for.
const ASKED: [f32; 3] = [0.1, 0.05, 0.02];

fn coloured(r: f32, g: f32, b: f32) -> Material {
    Material { diffuse: Vec3::new(r, g, b), ..lambert(0.0) }
}

/// A corridor of 2 m by 2 m with pillars along one side, and two lamps of which one is behind the last pillar.
fn corridor() -> Scene {
    let pillar = |y: f32| cuboid(Vec3::new(0.4, y, -1.0), Vec3::new(0.7, y + 0.3, 1.0));
    let mut corridor = Builder::default()
        .mesh(cuboid(Vec3::new(-1.1, -3.0, -1.1), Vec3::new(1.1, 5.0, -1.0)), coloured(0.5, 0.45, 0.4))
        .mesh(cuboid(Vec3::new(-1.1, -3.0, 1.0), Vec3::new(1.1, 5.0, 1.1)), lambert(0.8))
        .mesh(cuboid(Vec3::new(-1.1, -3.0, -1.0), Vec3::new(-1.0, 5.0, 1.0)), coloured(0.7, 0.3, 0.2))
        .mesh(cuboid(Vec3::new(1.0, -3.0, -1.0), Vec3::new(1.1, 5.0, 1.0)), lambert(0.7))
        .mesh(cuboid(Vec3::new(-1.1, 5.0, -1.1), Vec3::new(1.1, 5.1, 1.1)), coloured(0.3, 0.4, 0.6))
        .square(Vec3::new(-0.2, -0.5, 0.99), Vec3::NEG_Z, 0.25, lamp(8.0))
        .square(Vec3::new(0.8, 4.6, 0.2), Vec3::NEG_X, 0.2, lamp(12.0));
    for number in 0..4u8 {
        corridor = corridor.mesh(pillar(0.2 + 1.2 * f32::from(number)), lambert(0.6));
    }
    corridor.view(Vec3::new(-0.3, -2.8, 0.1), Vec3::new(0.0, 3.0, -0.1), 50.0).build()
}

/// A room whose lamp shines at the ceiling alone, from behind a ledge.
fn wash() -> Scene {
    Builder::default()
        .cube_room(&lambert(0.75))
        .mesh(cuboid(Vec3::new(-1.0, 0.6, 0.5), Vec3::new(1.0, 1.0, 0.55)), lambert(0.75))
        .square(Vec3::new(0.0, 0.85, 0.56), Vec3::Z, 0.1, lamp(60.0))
        .mesh(icosphere(Vec3::new(-0.4, 0.2, -0.7), 0.3, 4), coloured(0.8, 0.4, 0.1))
        .mesh(cuboid(Vec3::new(0.2, 0.1, -1.0), Vec3::new(0.6, 0.5, -0.2)), lambert(0.5))
        .view(Vec3::new(0.1, -0.95, 0.1), Vec3::new(0.0, 0.5, -0.2), 70.0)
        .build()
}

/// Bodies on a floor under an even sky, one of them of metal, and a wall behind them.
fn yard() -> Scene {
    Builder::default()
        .square(Vec3::ZERO, Vec3::Z, 4.0, lambert(0.4))
        .mesh(cuboid(Vec3::new(-2.0, 1.2, 0.0), Vec3::new(2.0, 1.4, 1.6)), coloured(0.6, 0.5, 0.4))
        .ball(Vec3::new(-0.7, 0.2, 0.45), 0.45, lambert(0.7))
        .mesh(icosphere(Vec3::new(0.5, 0.4, 0.5), 0.5, 4), gloss(0.25, 0.7))
        .mesh(cuboid(Vec3::new(-0.2, -0.7, 0.0), Vec3::new(0.4, -0.3, 0.25)), coloured(0.2, 0.4, 0.7))
        .sky(1.0)
        .view(Vec3::new(0.6, -3.2, 1.5), Vec3::new(0.0, 0.3, 0.4), 40.0)
        .build()
}

/// A ball of glass and a mirror in a room with a wide lamp.
fn glass_room() -> Scene {
    Builder::default()
        .cube_room(&lambert(0.6))
        .square(Vec3::Z * 0.99, Vec3::NEG_Z, 0.5, lamp(4.0))
        .ball(Vec3::new(-0.35, 0.1, -0.6), 0.35, glass(1.5, 0.0))
        .square(Vec3::new(0.5, 0.8, -0.2), Vec3::new(-0.4, -1.0, 0.0), 0.4, mirror(0.9))
        .view(Vec3::new(0.0, -0.95, 0.0), Vec3::new(0.0, 0.4, -0.4), 75.0)
        .build()
}

fn reference(scene: &Scene) -> Reference {
    let mut batches = Batches::new(SIZE);
    for batch in 0..BATCHES {
        let seed = REFERENCE_SEED + batch;
        let settings =
            Settings { method: Method::Path, spp: Some(REFERENCE_SPP), size: SIZE, seed, ..Settings::default() };
        let picture = render(scene, &settings).film.picture();
        batches.add(&Image::new(SIZE, &picture).expect("a full picture")).expect("pictures of one size");
    }
    batches.mean().expect("some pictures")
}

#[expect(clippy::print_stdout, reason = "the table is the result")]
fn main() {
    println!("{}, {} threads, {SIZE}\n", processor(), rayon::current_num_threads());
    println!(
        "| scene | reference's noise | asked | seconds | passes | bias found | reached | beyond their estimates: of 400 | of all |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let scenes = [("corridor", corridor()), ("wash", wash()), ("yard", yard()), ("glass room", glass_room())];
    for (name, scene) in scenes {
        let reference = reference(&scene);
        for asked in ASKED {
            let settings = Settings { size: SIZE, ..Settings::default() };
            let (rendering, estimate) =
                render_to_error(&scene, &settings, asked, &|_| (), &|_| ()).expect("valid settings");
            let exceeded = Exceeded::new(&rendering.film.picture(), &estimate, &reference);
            println!(
                "| {name} | {:.1} % | {} % | {:.1} | {} | {:.1} % | {} | {} | {:.1} % |",
                100.0 * exceeded.reference_noise,
                100.0 * asked,
                rendering.statistics.render_seconds,
                estimate.passes,
                100.0 * estimate.bias,
                if estimate.is_reached { "yes" } else { "no" },
                exceeded.of_400(),
                100.0 * exceeded.share(),
            );
        }
    }
}
