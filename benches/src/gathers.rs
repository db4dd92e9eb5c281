//! Records of real scenes, gathered by path tracing: what the reprojection meets in a picture.

use std::path::Path;

use glam::{UVec2, Vec2, Vec3, Vec3A};
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

/// Gathers of `n x n` texels seen by the cameras of the Cornell box, matt and glossy, of the atrium under its sky, of
/// the scene that is embedded in the program, and of a cow on a floor; then on the floor of a box with 60 others in it,
/// in the Cornell box with normals that turn, as those of curved surfaces do, and there with elements that keep
/// contrasts, as where lobes read them.
///
/// # Panics
/// If a scene is not there.
#[must_use]
pub fn gathers(n: usize) -> Vec<Gathers> {
    let merge = MergeSettings::default();
    // Where wide lobes read textures, elements must not blur light.
    let keeps_contrast = MergeSettings { max_contrast: 0.1, ..merge };
    let cornell = View::load("tests/data/study/cornell/scene.toml");
    let glossy = View::load("tests/data/study/cornell-glossy/scene.toml");
    vec![
        seen(&cornell, "cornell", n, merge, 0.0),
        seen(&glossy, "cornell-glossy", n, merge, 0.0),
        seen(&View::load("tests/data/study/atrium-env/scene.toml"), "atrium-env", n, merge, 0.0),
        seen(&View::load("cli/scenes/default.toml"), "embedded", n, merge, 0.0),
        seen(&View::load("tests/data/spot/floor.toml"), "spot", n, merge, 0.0),
        cluttered(n),
        seen(&cornell, "cornell-turned", n, merge, 0.2),
        seen(&glossy, "cornell-contrast", n, keeps_contrast, 0.0),
    ]
}

/// A scene and the size of its picture.
struct View {
    scene: Scene,
    size: UVec2,
}

impl View {
    /// Loads a scene file by its path from the root of the workspace.
    fn load(path: &str) -> Self {
        let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
        let loaded = scene::load(&root.join(path), &LoadOptions::default()).expect("the scene is there");
        let size = loaded.settings.size.unwrap_or(UVec2::ONE);
        Self { scene: Scene::new(loaded.description).expect("a loaded scene is right"), size }
    }
}

/// Records at what a camera sees, each used away from it in the plane, its normal turned by up to `turn`.
fn seen(view: &View, name: &'static str, n: usize, merge: MergeSettings, turn: f32) -> Gathers {
    let scene = &view.scene;
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
        let ray = scene.camera_ray(film * view.size.as_vec2(), view.size);
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
