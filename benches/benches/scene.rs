//! Rays and trees: `scene/{closest,any}/SCENE/RAYS` in rays per second, `scene/build/SHAPE/TRIANGLES`.

use std::hint::black_box;
use std::path::Path;

use criterion::{BenchmarkId, Criterion, Throughput};
use glam::{UVec2, Vec2, Vec3, Vec3A};
use hemimap::Frame;
use scene::{Description, LoadOptions, Material, Mesh, Ray, Scene};

const SIZE: UVec2 = UVec2::new(64, 64);

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    rays(&mut criterion);
    builds(&mut criterion);
    criterion.final_summary();
}

/// Camera rays, and from where they hit one cosine-distributed ray each: what gathering asks for.
fn paths(scene: &Scene) -> [(&'static str, Vec<Ray>); 2] {
    let pixels = (0..SIZE.y).flat_map(|y| (0..SIZE.x).map(move |x| UVec2::new(x, y).as_vec2() + 0.5));
    let camera: Vec<Ray> = pixels.map(|film| scene.camera().ray(film, SIZE)).collect();
    let mut diffuse = Vec::new();
    for (i, ray) in camera.iter().enumerate() {
        let Some(hit) = scene.intersect(ray) else { continue };
        let surface = scene.surface(ray, &hit);
        // The plastic sequence (Roberts 2018): even over the square.
        let u = (i as f32 * Vec2::new(0.754_877_7, 0.569_840_3)).fract();
        diffuse.push(surface.spawn(Frame::from_normal(surface.n).to_world(hemimap::square_to_cosine_hemisphere(u))));
    }
    [("camera", camera), ("diffuse", diffuse)]
}

fn rays(criterion: &mut Criterion) {
    for name in ["cornell-box/cornell-box.obj", "water-caustic/water-caustic.obj", "spot/spot.obj"] {
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/data")).join(name);
        let loaded = scene::load(&path, &LoadOptions::default()).expect("a scene of the repository");
        let scene = Scene::new(loaded.description).expect("a loaded scene is right");
        let label = name.split('/').next().unwrap_or(name);
        for (kind, rays) in paths(&scene) {
            for ray in &rays {
                assert_eq!(scene.intersect(ray).is_some(), scene.occluded(ray), "both searches agree about {ray:?}");
            }
            let mut group = criterion.benchmark_group("scene");
            group.throughput(Throughput::Elements(rays.len() as u64));
            group.bench_function(format!("closest/{label}/{kind}"), |bencher| {
                bencher.iter(|| rays.iter().filter(|ray| scene.intersect(black_box(ray)).is_some()).count());
            });
            group.bench_function(format!("any/{label}/{kind}"), |bencher| {
                bencher.iter(|| rays.iter().filter(|ray| scene.occluded(black_box(ray))).count());
            });
        }
    }
}

/// A scene of `count` equal triangles, the i-th moved by `offset(i)`.
fn copies(count: u32, offset: impl Fn(f32) -> Vec3) -> Description {
    let corners = [Vec3::ZERO, Vec3::X, Vec3::Y + Vec3::Z];
    let mesh = Mesh {
        positions: (0..count).flat_map(|i| corners.map(|c| c + offset(i as f32))).collect(),
        triangles: (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        materials: vec![0; count as usize],
        ..Mesh::default()
    };
    Description { meshes: vec![mesh], materials: vec![Material::default()], ..Description::default() }
}

/// Shapes that make trees deep and builders slow where boxes tie or nest.
fn builds(criterion: &mut Criterion) {
    let scattered = |i: f32| 100.0 * (i * Vec3::new(0.819_172_5, 0.671_043_6, 0.549_700_5)).fract();
    let shapes = [
        ("scattered", copies(20_000, scattered)),
        ("row", copies(20_000, |i| Vec3::X * (2.0 * i))),
        ("stairs", copies(20_000, Vec3::splat)),
        ("coincident", copies(100_000, |_| Vec3::ZERO)),
    ];
    let mut group = criterion.benchmark_group("scene/build");
    group.sample_size(10);
    for (name, description) in shapes {
        let count = description.meshes[0].triangles.len();
        let built = Scene::new(description.clone()).expect("a right scene");
        let p = description.meshes[0].positions[3 * (count / 2)] + Vec3::new(0.3, 0.2, 0.2);
        let ray = Ray::new(Vec3A::from(p) + Vec3A::Z * 0.5, -Vec3A::Z);
        assert!(built.intersect(&ray).is_some(), "the middle one is met");
        group.bench_with_input(BenchmarkId::new(name, count), &description, |bencher, description| {
            bencher.iter(|| Scene::new(description.clone()));
        });
    }
}
