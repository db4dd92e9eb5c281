//! A room of rough stone with three boulders in it, of as many triangles as are asked for: always the same look, ever
//! finer.

use glam::{Vec3, Vec3A};
use hemimap::Frame;
use integrator::Rng;
use scene::{Camera, Description, Material, Mesh, Scene};

/// Half the width of the room, metres.
const HALF: f32 = 2.0;
/// Radius of a boulder, metres.
const RADIUS: f32 = 0.6;
/// Greatest swelling, as a share of a body's radius.
const HEIGHT: f32 = 0.1;
/// Waves of the relief, from two to forty across a radius, and what is left of the height from one to twice as many.
const WAVES: u32 = 40;
const FREQUENCIES: (f32, f32) = (2.0, 40.0);
const ROUGHNESS: f32 = 0.45;

/// The six sides of four bodies, two triangles a cell.
const TRIANGLES_OF_CELLS: usize = 4 * 6 * 2;

/// A sum of waves that go anyhow, the shorter the lower.
struct Relief(Vec<(Vec3, f32, f32)>);

impl Relief {
    fn new(seed: u64) -> Self {
        let mut rng = Rng::new(seed, 0);
        let wave = |number| {
            let octaves = (FREQUENCIES.1 / FREQUENCIES.0).log2() * number as f32 / (WAVES - 1) as f32;
            let z = 2.0 * rng.next_1d() - 1.0;
            let (sin, cos) = (std::f32::consts::TAU * rng.next_1d()).sin_cos();
            let direction = Vec3::new(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z);
            let phase = std::f32::consts::TAU * rng.next_1d();
            (direction * (FREQUENCIES.0 * octaves.exp2()), phase, ROUGHNESS.powf(octaves))
        };
        let mut waves: Vec<_> = (0..WAVES).map(wave).collect();
        let sum: f32 = waves.iter().map(|wave| wave.2).sum();
        for wave in &mut waves {
            wave.2 /= sum;
        }
        Self(waves)
    }

    /// In [-1, 1].
    fn at(&self, p: Vec3) -> f32 {
        self.0.iter().map(|(k, phase, height)| height * (k.dot(p) + phase).sin()).sum()
    }
}

/// A cube whose sides have `cells` times `cells` cells, moved to `place`; its front is inside where `is_room`.
fn body(cells: u32, place: Vec3, is_room: bool, relief: &Relief) -> Mesh {
    let side = cells + 1;
    let mut mesh = Mesh::default();
    for normal in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
        let frame = Frame::from_normal(Vec3A::from(normal));
        let first = u32::try_from(mesh.positions.len()).expect("few enough to number");
        for row in 0..side {
            for column in 0..side {
                let [x, y] = [column, row].map(|k| 2.0 * k as f32 / cells as f32 - 1.0);
                let on_cube = normal + Vec3::from(frame.s) * x + Vec3::from(frame.t) * y;
                let height = 1.0 + HEIGHT * relief.at(on_cube);
                let p = if is_room { HALF * on_cube * height } else { RADIUS * on_cube.normalize() * height };
                mesh.positions.push(place + p);
            }
        }
        for row in 0..cells {
            for column in 0..cells {
                let a = first + row * side + column;
                let [a, b, c, d] = [a, a + 1, a + 1 + side, a + side];
                let cell = if is_room { [[a, c, b], [a, d, c]] } else { [[a, b, c], [a, c, d]] };
                mesh.triangles.extend(cell);
            }
        }
    }
    mesh
}

/// Returns the room with about `triangles` triangles, and their number.
pub(super) fn description(triangles: usize) -> (Description, usize) {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few thousand")]
    let cells = (triangles as f64 / TRIANGLES_OF_CELLS as f64).sqrt().round() as u32;
    let places = [Vec3::ZERO, Vec3::new(-0.8, 0.5, -1.1), Vec3::new(0.8, 0.8, -1.1), Vec3::new(0.1, -0.5, -1.3)];
    let stone = |r, g, b| Material { diffuse: Vec3::new(r, g, b), ..Material::default() };
    let lamp = Material { emission: Vec3::splat(12.0), diffuse: Vec3::ZERO, ..Material::default() };
    let materials = vec![stone(0.7, 0.7, 0.7), stone(0.7, 0.3, 0.2), stone(0.3, 0.6, 0.3), stone(0.3, 0.4, 0.7), lamp];
    let mut meshes = Vec::new();
    for (number, place) in (0u32..).zip(places) {
        let mut mesh = body(cells, place, number == 0, &Relief::new(number.into()));
        mesh.materials = vec![number; mesh.triangles.len()];
        meshes.push(mesh);
    }
    let at = |x: f32, y: f32| Vec3::new(0.5 * x, 0.5 * y, 1.6);
    meshes.push(Mesh {
        positions: vec![at(-1.0, -1.0), at(-1.0, 1.0), at(1.0, 1.0), at(1.0, -1.0)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        materials: vec![4; 2],
        ..Mesh::default()
    });
    let count = meshes.iter().map(|mesh| mesh.triangles.len()).sum();
    let camera =
        Camera { eye: Vec3::new(0.0, -1.6, 0.2), at: Vec3::new(0.0, 0.6, -0.5), up: Vec3::Z, fov_y_degrees: 75.0 };
    (Description { meshes, materials, camera: Some(camera), ..Description::default() }, count)
}

/// Builds the room.
pub(super) fn scene(description: Description) -> Scene {
    Scene::new(description).expect("a right scene")
}
