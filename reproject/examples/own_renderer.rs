//! A renderer of your own that takes up these crates one after the other. Its scene, its rays and its light know
//! nothing of them.
//!
//! `cargo run --release --example own_renderer`
//!
//! | way | crates | indirect light of a pixel |
//! |---|---|---|
//! | paths | hemimap, freeform | random directions |
//! | gather | and radcache, reproject | 32 x 32 stratified directions |
//! | reproject | as gather | what a record nearby saw, seen from here |
//!
//! A table on stdout tells the rays of each way and its error, against 48 x 48 directions.

use std::f32::consts::FRAC_1_PI;

use freeform::{FreeForm, Perturbation, Quadric, Ray, Solid};
use hemimap::glam::{DVec3, Vec2, Vec3, Vec3A, Vec3Swizzles};
use hemimap::{Frame, square_to_cosine_hemisphere};
use radcache::{Index, Record, RecordSettings, Validity};
use reproject::{Settings, Traced, Tracer, Workspace};

const SIZE: [usize; 2] = [144, 96];

/// A box with sides along the axes.
struct Block {
    min: Vec3A,
    max: Vec3A,
    albedo: Vec3,
}

/// A room of blocks, a free form in it, and a small lamp.
struct World {
    blocks: Vec<Block>,
    apple: Solid,
    lamp: Vec3A,
    rays: u64,
}

#[derive(Clone, Copy)]
struct Hit {
    p: Vec3A,
    n: Vec3A,
    albedo: Vec3,
    distance: f32,
}

impl World {
    /// Diagonal of the room, metres.
    const SIZE: f32 = 6.2;

    fn new() -> Result<Self, freeform::FormError> {
        let block = |min: [f32; 3], max: [f32; 3], albedo: [f32; 3]| Block {
            min: min.into(),
            max: max.into(),
            albedo: albedo.into(),
        };
        let (white, red, blue) = ([0.8; 3], [0.8, 0.2, 0.15], [0.2, 0.3, 0.8]);
        let blocks = vec![
            block([-2.1, -2.1, -0.1], [2.1, 2.1, 0.0], white),
            block([-2.1, -2.1, 2.5], [2.1, 2.1, 2.6], white),
            block([-2.1, -2.1, 0.0], [-2.0, 2.1, 2.5], red),
            block([2.0, -2.1, 0.0], [2.1, 2.1, 2.5], blue),
            block([-2.0, 2.0, 0.0], [2.0, 2.1, 2.5], white),
            block([-2.0, -2.1, 0.0], [2.0, -2.0, 2.5], white),
            block([-1.3, 0.4, 0.0], [-0.4, 1.2, 1.4], white),
        ];
        // A ball that is swollen above and dented in front (eqs. 2 and 3).
        let at = DVec3::new(0.7, 0.2, 0.6);
        let swelling = Perturbation { quadric: Quadric::sphere(at + 0.6 * DVec3::Z, 0.4)?, factor: 4.0 };
        let dent = Perturbation { quadric: Quadric::sphere(at - 0.6 * DVec3::Y, 0.4)?, factor: -8.0 };
        let apple = FreeForm::new(Quadric::sphere(at, 0.6)?, vec![swelling, dent])?.into();
        Ok(Self { blocks, apple, lamp: Vec3A::new(0.3, -0.6, 2.2), rays: 0 })
    }

    fn intersect(&mut self, origin: Vec3A, direction: Vec3A) -> Option<Hit> {
        self.rays += 1;
        let mut nearest: Option<Hit> = None;
        let mut keep = |distance: f32, n: Vec3A, albedo: Vec3| {
            if nearest.is_none_or(|hit| distance < hit.distance) {
                nearest = Some(Hit { p: origin + distance * direction, n, albedo, distance });
            }
        };
        for block in &self.blocks {
            let (a, b) = ((block.min - origin) / direction, (block.max - origin) / direction);
            let (near, far) = (a.min(b), a.max(b));
            let distance = near.max_element();
            if distance > 1e-4 && distance < far.min_element() {
                let n = Vec3A::select(near.cmpeq(Vec3A::splat(distance)), -direction.signum(), Vec3A::ZERO);
                keep(distance, n, block.albedo);
            }
        }
        let ray = Ray::new(origin.as_dvec3(), direction.as_dvec3());
        if let Some(hit) = self.apple.first_hit(&ray) {
            let n = self.apple.normal(ray.at(hit.t), ray.direction);
            let distance = (ray.at(hit.t) - ray.origin).as_vec3a().length();
            keep(distance, n.as_vec3a(), Vec3::new(0.6, 0.7, 0.3));
        }
        nearest.map(|hit| Hit { p: hit.p + 1e-4 * hit.n, ..hit })
    }

    /// Radiance that the surface reflects of the lamp.
    fn lit(&mut self, hit: &Hit) -> Vec3 {
        let to_lamp = self.lamp - hit.p;
        let distance = to_lamp.length();
        let wi = to_lamp / distance;
        let cos = wi.dot(hit.n);
        if cos <= 0.0 || self.intersect(hit.p, wi).is_some_and(|blocker| blocker.distance < distance) {
            return Vec3::ZERO;
        }
        hit.albedo * (FRAC_1_PI * 12.0 * cos / distance.powi(2))
    }

    /// Light that comes to `p` from the surface in this direction.
    fn incident(&mut self, p: Vec3A, wi: Vec3A) -> Traced {
        self.intersect(p, wi).map_or_else(Traced::default, |hit| Traced {
            radiance: self.lit(&hit),
            distance: hit.distance,
            normal: hit.n,
        })
    }
}

/// A random number in [0, 1) that depends on its names alone.
fn random(a: u64, b: u64) -> f32 {
    let mut x = a.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ b.wrapping_mul(0xd1b5_4a32_d192_ed03);
    for _ in 0..2 {
        x = (x ^ (x >> 32)).wrapping_mul(0xd6e8_feb8_6659_fd93);
    }
    (x >> 40) as f32 / (1 << 24) as f32
}

/// Mean incident radiance over the cosine-weighted hemisphere, irradiance / pi, by random directions.
fn paths(world: &mut World, hit: &Hit, count: u64, seed: u64) -> Vec3 {
    let frame = Frame::from_normal(hit.n);
    let sum: Vec3 = (0..count)
        .map(|k| {
            let square = Vec2::new(random(seed, 2 * k), random(seed, 2 * k + 1));
            world.incident(hit.p, frame.to_world(square_to_cosine_hemisphere(square))).radiance
        })
        .sum();
    sum / count as f32
}

/// The same by n x n stratified directions.
fn gather(world: &mut World, hit: &Hit, n: usize, seed: u64) -> Vec3 {
    reproject::gather(&Frame::from_normal(hit.n), n, seed, &mut Rays { world, p: hit.p }).mean_radiance()
}

/// Answers the rays that a gather or a reprojection asks for.
struct Rays<'a> {
    world: &'a mut World,
    p: Vec3A,
}

impl Tracer for Rays<'_> {
    fn trace(&mut self, wi: &[Vec3A], out: &mut [Traced]) {
        for (wi, out) in wi.iter().zip(out) {
            *out = self.world.incident(self.p, *wi);
        }
    }
}

/// The same by the best record, or by a new one where none serves.
fn reproject(world: &mut World, index: &mut Index, workspace: &mut Workspace, hit: &Hit, seed: u64) -> Vec3 {
    let mut rays = Rays { world, p: hit.p };
    if let Some(found) = index.best(hit.p, hit.n) {
        let record = index.record(found.record);
        workspace.project(record, hit.p, hit.n, &Settings::default());
        // Four rays see whether the record knows what stands around this point.
        if workspace.verify(record, 2, seed, &mut rays).holds() {
            workspace.trace_holes(2, seed, &mut rays);
            return workspace.mean_radiance();
        }
    }
    let frame = Frame::from_normal(hit.n);
    let samples = reproject::gather(&frame, 32, seed, &mut rays);
    let record = Record::new(hit.p, frame, samples, &RecordSettings::default(), index.validity());
    let mean = record.mean_radiance();
    if record.radius() > 0.0 {
        index.extend([record]);
    }
    mean
}

/// Makes a picture by one way to find the mean incident radiance, and tells the rays that it took.
fn render(world: &mut World, mut incident: impl FnMut(&mut World, &Hit, u64) -> Vec3) -> (Vec<Vec3>, u64) {
    world.rays = 0;
    let [width, height] = SIZE;
    let eye = Vec3A::new(0.0, -1.9, 1.2);
    let pixel = |number: usize| {
        let (x, y) = ((number % width) as f32 + 0.5, (number / width) as f32 + 0.5);
        let film = (Vec2::new(x, height as f32 - y) * 2.0 - Vec2::new(width as f32, height as f32)) / height as f32;
        let direction = Vec3A::from(film.extend(1.2).xzy()).normalize();
        let Some(hit) = world.intersect(eye, direction) else { return Vec3::ZERO };
        world.lit(&hit) + hit.albedo * incident(world, &hit, number as u64)
    };
    ((0..width * height).map(pixel).collect(), world.rays)
}

/// relMSE of a picture against the true one.
fn error(picture: &[Vec3], truth: &[Vec3]) -> f32 {
    let pixels = picture.iter().zip(truth);
    let sum: f32 = pixels.map(|(&a, &b)| ((a - b) * (a - b) / (b * b + 1e-2)).element_sum() / 3.0).sum();
    sum / truth.len() as f32
}

#[expect(clippy::print_stdout, reason = "the table is the result")]
fn main() -> Result<(), freeform::FormError> {
    let mut world = World::new()?;
    let (truth, _) = render(&mut world, |world, hit, seed| gather(world, hit, 48, seed ^ 1 << 40));
    let by_paths = render(&mut world, |world, hit, seed| paths(world, hit, 128, seed));
    let by_gathers = render(&mut world, |world, hit, seed| gather(world, hit, 32, seed));
    let (mut index, mut workspace) = (Index::new(Validity::for_scene(World::SIZE)), Workspace::new());
    let by_records = render(&mut world, |world, hit, seed| reproject(world, &mut index, &mut workspace, hit, seed));

    println!("{:10} {:>12} {:>9}", "way", "rays a pixel", "relMSE");
    for (name, (picture, rays)) in [("paths", &by_paths), ("gather", &by_gathers), ("reproject", &by_records)] {
        let rays = *rays as f64 / truth.len() as f64;
        println!("{name:10} {rays:12.1} {:9.1e}", error(picture, &truth));
    }
    println!("{} records", index.len());
    let [paths, gather, reproject] = [by_paths, by_gathers, by_records].map(|(picture, _)| error(&picture, &truth));
    assert!(reproject < 0.1 * paths && reproject < 3.0 * gather, "{reproject} against {paths} and {gather}");
    Ok(())
}
