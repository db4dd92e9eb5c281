//! What it saves to choose lights by the point: deviation and time of one light sample with its shadow ray, by flux
//! alone and by what lamps may bring there, as a table in Markdown.
//!
//! `cargo run --release -p benches --example lights_table`, on one thread.

use std::hint::black_box;
use std::time::Instant;

use glam::{Vec2, Vec3, Vec3A};
use integrator::Rng;
use scene::{Description, Material, Mesh, Ray, Scene};

/// Points on the floor at which light is sampled.
const POINTS: u32 = 400;
/// Samples at each.
const SAMPLES: u32 = 1000;
/// The hall in metres.
const HALL: Vec3 = Vec3::new(40.0, 4.0, 40.0);
/// Legs of a lamp.
const SIZE: f32 = 0.05;

/// Small triangles of equal flux between knee and ceiling, turned anyhow but mostly down.
fn lamps(count: u32) -> Vec<[Vec3; 3]> {
    let mut rng = Rng::new(1, 0);
    let lamp = |_| {
        let place = HALL * Vec3::new(rng.next_1d(), 0.2 + 0.8 * rng.next_1d(), rng.next_1d());
        let tilt = hemimap::square_to_cosine_hemisphere(rng.next_2d());
        let frame = hemimap::Frame::from_normal(Vec3A::new(tilt.x, -tilt.z, tilt.y));
        let at = |x: f32, y: f32| place + Vec3::from(frame.s * (x * SIZE) + frame.t * (y * SIZE));
        [at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0)]
    };
    (0..count).map(lamp).collect()
}

fn scene(lamps: &[[Vec3; 3]]) -> Scene {
    let count = u32::try_from(lamps.len()).expect("few enough to number");
    let mesh = Mesh {
        positions: lamps.as_flattened().to_vec(),
        triangles: (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        materials: vec![0; lamps.len()],
        ..Mesh::default()
    };
    let shining = Material { emission: Vec3::splat(100.0), ..Material::default() };
    Scene::new(Description { meshes: vec![mesh], materials: vec![shining], ..Description::default() })
        .expect("a right scene")
}

/// The irradiance on a floor at `p` by one point of a lamp, where nothing stands between.
fn irradiance(scene: &Scene, lamp: &[Vec3; 3], u: Vec2, p: Vec3A) -> f64 {
    let [a, b, c] = lamp.map(Vec3A::from);
    let normal = (b - a).cross(c - a);
    let root = u.x.sqrt();
    let offset = a * (1.0 - root) + b * (root * (1.0 - u.y)) + c * (root * u.y) - p;
    let cosines = (-normal.dot(offset)).max(0.0) * offset.y.max(0.0);
    let distance = offset.length();
    if cosines == 0.0 || shadowed(scene, p, offset / distance, distance) {
        return 0.0;
    }
    f64::from(100.0 * 0.5 * cosines) / f64::from(distance).powi(4)
}

fn shadowed(scene: &Scene, p: Vec3A, wi: Vec3A, distance: f32) -> bool {
    scene.occluded(&Ray { t_max: distance * (1.0 - 1e-4), ..Ray::new(p, wi) })
}

/// Mean over the points of the relative deviation of one sample, its mean, and nanoseconds a sample.
fn measure(mut sample: impl FnMut(Vec3A, &mut Rng) -> f64) -> (f64, f64, f64) {
    let (mut deviation, mut mean) = (0.0, 0.0);
    let start = Instant::now();
    for point in 0..POINTS {
        let mut rng = Rng::new(2, u64::from(point));
        let u = rng.next_2d();
        let p = Vec3A::from(HALL * Vec3::new(u.x, 0.0, u.y));
        let (mut sum, mut sum_sq) = (0.0, 0.0);
        for _ in 0..SAMPLES {
            let e = sample(p, &mut rng);
            sum += e;
            sum_sq += e * e;
        }
        let count = f64::from(SAMPLES);
        deviation += (count * sum_sq / (sum * sum) - 1.0).max(0.0).sqrt() / f64::from(POINTS);
        mean += sum / count / f64::from(POINTS);
    }
    let samples = f64::from(POINTS * SAMPLES);
    (deviation, mean, start.elapsed().as_secs_f64() * 1e9 / samples)
}

#[expect(clippy::print_stdout, reason = "the table is the result")]
fn main() {
    println!("| lamps | build ms | by flux: deviation | ns | by the point: deviation | ns | time for equal noise |");
    println!("|---|---|---|---|---|---|---|");
    for count in [1, 10, 100, 1000, 10_000, 100_000] {
        let lamps = lamps(count);
        let scene = scene(&lamps);
        let lights = scene.lights();
        let (flux_deviation, flux_mean, flux_ns) = measure(|p, rng| {
            let u = f64::from(rng.next_1d());
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of the lamps")]
            let lamp = (u * lamps.len() as f64) as usize;
            black_box(irradiance(&scene, &lamps[lamp], rng.next_2d(), p)) * lamps.len() as f64
        });
        let (deviation, mean, ns) = measure(|p, rng| {
            let (u_choice, u) = (rng.next_1d(), rng.next_2d());
            let Some(light) = lights.sample(p, Vec3A::Y, u_choice, u) else { return 0.0 };
            let visible = !shadowed(&scene, p, light.wi, light.distance);
            black_box(if visible { f64::from(light.radiance.x * light.wi.y / light.pdf) } else { 0.0 })
        });
        // Both see the same lamps. By flux alone, that shows within its noise.
        let noise = flux_deviation / f64::from(SAMPLES * POINTS).sqrt();
        assert!((flux_mean / mean - 1.0).abs() < 6.0 * noise + 0.01, "{flux_mean} is not {mean}");
        let gain = (flux_deviation / deviation).powi(2) * flux_ns / ns;
        let (gain, than) = if gain < 1.0 { (gain.recip(), "more") } else { (gain, "less") };
        let build = scene.light_seconds() * 1e3;
        println!(
            "| {count} | {build:.2} | {flux_deviation:.2} | {flux_ns:.0} | {deviation:.2} | {ns:.0} | {gain:.1} times {than} |"
        );
    }
}
