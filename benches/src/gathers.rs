//! Records of real scenes, gathered by path tracing: what the reprojection meets in a picture.

use std::path::Path;

use glam::{Vec2, Vec3, Vec3A};
use hemimap::Frame;
use integrator::{PathTracer, Sampler, hash_pair};
use radcache::{MergeSettings, Record, RecordSettings, Samples, Validity};
use scene::{LoadOptions, Scene, Surface};

use crate::rooms;

/// A record, and a point within its reach to which it is reprojected.
#[derive(Debug)]
pub struct Pair {
    /// The record.
    pub record: Record,
    /// The point.
    pub to: Vec3A,
    /// Unit normal there.
    pub normal: Vec3A,
}

/// The pairs of a scene.
#[derive(Debug)]
pub struct Gathers {
    /// Name for ids.
    pub name: &'static str,
    /// Several, so that no branch predictor learns one by heart.
    pub pairs: Vec<Pair>,
}

/// Pairs of record and point a scene.
const PAIRS: usize = 12;
/// Paths through each texel, for a radiance about as smooth as that of a photon map.
const PATHS: u32 = 32;

/// Gathers of `n x n` texels seen by the cameras of the Cornell box, matt and glossy, and of the atrium under its sky, and on the
/// floor of a box with 60 others in it; then the Cornell box with normals that turn, as those of curved surfaces do, and with elements that
/// keep contrasts, as where lobes read them.
///
/// # Panics
/// If a scene of the tests is not there.
#[must_use]
pub fn gathers(n: usize) -> Vec<Gathers> {
    let study = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/data/study"));
    let load = |name: &str, environment: Option<&str>| {
        let options = LoadOptions { environment: environment.map(|file| study.join(file)), environment_scale: 1.0 };
        let loaded = scene::load(&study.join(name).join("scene.obj"), &options).expect("the study scenes are there");
        Scene::new(loaded.description).expect("a loaded scene is right")
    };
    let box_camera = Camera { eye: Vec3A::new(278.0, 273.0, -800.0), at: Vec3A::new(278.0, 273.0, -799.0), fov: 39.3 };
    let atrium_camera = Camera { eye: Vec3A::new(-3.6, 1.6, 2.4), at: Vec3A::new(2.2, 1.25, -1.0), fov: 60.0 };
    let merge = MergeSettings::default();
    // Where wide lobes read textures, elements must not blur light.
    let keeps_contrast = MergeSettings { max_contrast: 0.1, ..merge };
    let cornell = load("cornell", None);
    let glossy = load("cornell-glossy", None);
    vec![
        seen(&cornell, "cornell", &box_camera, n, merge, 0.0),
        seen(&glossy, "cornell-glossy", &box_camera, n, merge, 0.0),
        seen(&load("atrium-env", Some("atrium-env/env.exr")), "atrium-env", &atrium_camera, n, merge, 0.0),
        cluttered(n),
        seen(&cornell, "cornell-turned", &box_camera, n, merge, 0.2),
        seen(&glossy, "cornell-contrast", &box_camera, n, keeps_contrast, 0.0),
    ]
}

struct Camera {
    eye: Vec3A,
    at: Vec3A,
    /// Vertical, degrees.
    fov: f32,
}

impl Camera {
    fn direction(&self, film: Vec2) -> Vec3A {
        let forward = (self.at - self.eye).normalize();
        let right = forward.cross(Vec3A::Y).normalize();
        let size = 2.0 * (0.5 * self.fov.to_radians()).tan();
        let place = (film - 0.5) * size;
        (forward + right * place.x + right.cross(forward) * place.y).normalize()
    }
}

/// Records at what a camera sees, each used away from it in the plane, its normal turned by up to `turn`.
fn seen(scene: &Scene, name: &'static str, camera: &Camera, n: usize, merge: MergeSettings, turn: f32) -> Gathers {
    let size = (scene.bounds().max - scene.bounds().min).length();
    let validity = Validity {
        min_radius: 1e-3 * size,
        max_radius: 0.25 * size,
        touching_distance: 1e-5 * size,
        ..Validity::default()
    };
    let mut pairs = Vec::new();
    for number in 0.. {
        assert!(number < 1000, "{name}: most places have a record");
        // The plastic sequence (Roberts 2018): even over the square.
        let film = (number as f32 * Vec2::new(0.754_877_7, 0.569_840_3)).fract();
        let ray = scene::Ray::new(camera.eye, camera.direction(film));
        let Some(hit) = scene.intersect(&ray) else { continue };
        let surface = scene.surface(&ray, &hit);
        let frame = Frame::from_normal(surface.n);
        let samples = gather(scene, &surface, &frame, n, number);
        let record = Record::new(surface.p, frame, samples, &RecordSettings { layers: 16, merge }, &validity);
        if record.radius() <= 0.0 || surface.n.dot(surface.ng) < 0.99 {
            continue;
        }
        let (sin, cos) = (2.4 * number as f32).sin_cos();
        let way = frame.s * cos + frame.t * sin;
        let to = surface.p + way * (0.5 * record.radius());
        let normal = if turn > 0.0 { (surface.n + frame.s * (turn * sin)).normalize() } else { surface.n };
        pairs.push(Pair { record, to, normal });
        if pairs.len() == PAIRS {
            break;
        }
    }
    Gathers { name, pairs }
}

fn gather(scene: &Scene, surface: &Surface, frame: &Frame, n: usize, key: u32) -> Samples {
    let mut tracer = PathTracer::new(scene);
    let mut samples = Samples::new(n);
    for texel in 0..n * n {
        let stream = hash_pair(u64::from(key), texel as u64);
        samples.set_jitter(texel, Sampler::new(1, stream, PATHS).next_pair());
        let wi = frame.to_world(samples.direction(texel));
        let ray = surface.spawn(wi);
        let found = scene.intersect(&ray).map(|hit| scene.surface(&ray, &hit));
        let light: Vec3 =
            (0..PATHS).map(|path| tracer.trace(&ray, &mut Sampler::new(0, stream, path)).terms.sum()).sum();
        let (distance, normal) = found.map_or((f32::INFINITY, -wi), |found| (found.t, found.ng));
        samples.set(texel, light / PATHS as f32, distance, frame.to_local(normal));
    }
    samples
}

fn cluttered(n: usize) -> Gathers {
    let scene = rooms::Scene::clutter(60);
    let mut pairs = Vec::new();
    for number in 0..1000u64 {
        let place = Vec2::new(rooms::uniform(2 * number), rooms::uniform(2 * number + 1)) * 1.8 - 0.9;
        let from = place.extend(-0.999).into();
        let record = rooms::record(|p, wi| scene.look(p, wi), from, Vec3A::Z, n, &RecordSettings::default());
        if record.radius() > 0.02 && pairs.len() < PAIRS {
            let (sin, cos) = (2.4 * number as f32).sin_cos();
            let to = from + Vec3A::new(cos, sin, 0.0) * (0.5 * record.radius());
            pairs.push(Pair { record, to, normal: Vec3A::Z });
        }
    }
    assert_eq!(pairs.len(), PAIRS, "clutter leaves room on the floor");
    Gathers { name: "clutter", pairs }
}
