//! Rays from one point into its hemisphere: n x n for a record, and single ones for holes and verification.

mod divide;

use glam::{Vec2, Vec3, Vec3A};
use hemimap::Frame;
use radcache::Samples;
use reproject::{Traced, Tracer};
use scene::{Bsdf, Scene, Specular, Surface};

use crate::cells::brightness;
use crate::follower::Follower;
use crate::sampler::{Rng, Sampler, hash_pair, in_cell};
use crate::secondary::{Secondary, Shading};
use crate::sky::{SkySplit, soft_background};
use crate::statistics::RayCounts;

use divide::{divide_glints, divisions};

/// Answers rays from points of the picture: indirect radiance of what they hit, or the soft part of the sky.
#[derive(Debug)]
pub(crate) struct Gatherer<'a, S> {
    pub(crate) scene: &'a Scene,
    pub(crate) secondary: &'a S,
    pub(crate) sky: Option<&'a SkySplit>,
    /// Whether texels between bright and dark, and at the rim of the sky, are divided.
    pub(crate) divide: bool,
    /// Whether texels are marked that show highlights.
    pub(crate) highlights: bool,
    pub(crate) seed: u64,
}

impl<S: Secondary> Gatherer<'_, S> {
    /// Gathers `n x n` stratified samples at a surface; `key` names the point to the generator of random numbers.
    pub(crate) fn gather(&self, surface: &Surface, frame: &Frame, n: usize, key: u64, rays: &mut RayCounts) -> Samples {
        let mut samples = Samples::new(n);
        let mut jitter = Rng::new(self.seed, key);
        for texel in 0..n * n {
            samples.set_jitter(texel, jitter.next_2d());
        }
        let directions = samples.directions();
        for (texel, &wi) in directions.iter().enumerate() {
            let wi = frame.to_world(wi);
            let mut sampler = Sampler::alone(self.seed, hash_pair(key, texel as u64));
            let (traced, is_marked) = self.incident(surface, wi, &mut sampler, rays);
            samples.set(texel, traced.radiance, traced.distance, frame.to_local(traced.normal));
            samples.view_dependent[texel] = is_marked;
        }
        rays.gather += (n * n) as u64;
        self.refine(surface, frame, &mut samples, key, rays);
        settle_highlights(&mut samples);
        // Below its own surface a record saw nothing, but another point may.
        if surface.ng != frame.n {
            for texel in 0..n * n {
                samples.view_dependent[texel] |= is_below(surface, frame.to_world(samples.direction(texel)));
            }
        }
        samples
    }

    /// The mean radiance over the cosine-weighted hemisphere, of what stands at a distance and of what is infinitely
    /// far, by `n x n` stratified rays: for a place of which no record is made.
    pub(crate) fn mean_radiance(&self, surface: &Surface, n: usize, key: u64, rays: &mut RayCounts) -> [Vec3; 2] {
        let frame = Frame::from_normal(surface.n);
        let mut jitter = Rng::new(self.seed, key);
        let mut sum = [Vec3::ZERO; 2];
        for texel in 0..n * n {
            let place = Vec2::new((texel % n) as f32, (texel / n) as f32);
            let wi = frame.to_world(hemimap::square_to_cosine_hemisphere((place + jitter.next_2d()) / n as f32));
            let mut sampler = Sampler::alone(self.seed, hash_pair(key, texel as u64));
            let (traced, _) = self.incident(surface, wi, &mut sampler, rays);
            sum[usize::from(traced.distance.is_infinite())] += traced.radiance;
        }
        rays.gather += (n * n) as u64;
        sum.map(|part| part / (n * n) as f32)
    }

    /// Divides the texels where the sky ends, those between bright and dark, and those where glints are, and looks
    /// through each part: one ray a texel would measure the area of what is bright there too roughly.
    fn refine(&self, surface: &Surface, frame: &Frame, samples: &mut Samples, key: u64, rays: &mut RayCounts) {
        let n = samples.resolution();
        let mut sides = if self.divide { divisions(samples, self.sky.is_some()) } else { vec![1; n * n] };
        let glints = self.secondary.glints(surface);
        if !glints.is_empty() {
            divide_glints(&brightness(glints, surface.p, frame, n), &mut sides);
        }
        for (texel, side) in sides.into_iter().enumerate().filter(|(_, side)| *side > 1) {
            let place = Vec2::new((texel % n) as f32, (texel / n) as f32);
            let seen = (samples.jitter(texel) * side as f32).as_uvec2();
            let seen = seen.y * side + seen.x;
            let (first, shows_sky) = (samples.radiance[texel], samples.distance[texel].is_infinite());
            let mut parts = [Vec3::ZERO; 2];
            parts[usize::from(shows_sky)] += first;
            let stream = hash_pair(key, texel as u64);
            for part in (0..side * side).filter(|&part| part != seen) {
                let mut sampler = Sampler::new(self.seed ^ FURTHER_STREAM, stream, part);
                let jitter = in_cell(part, side, sampler.next_pair());
                let wi = frame.to_world(hemimap::square_to_cosine_hemisphere((place + jitter) / n as f32));
                let (traced, is_marked) = self.incident(surface, wi, &mut sampler, rays);
                let is_sky = traced.distance.is_infinite();
                parts[usize::from(is_sky)] += traced.radiance;
                samples.view_dependent[texel] |= is_marked;
                let stands = if shows_sky {
                    // What the sky ends at is in front of it, and moves over it when the place does.
                    traced.distance < samples.distance[texel]
                } else {
                    // Each as often as its share of the light, so that there is no more light at a distance than was
                    // found there.
                    !is_sky && sampler.next_1d() * parts[0].element_sum() < traced.radiance.element_sum()
                };
                if stands {
                    samples.set_jitter(texel, jitter);
                    samples.set(texel, first, traced.distance, frame.to_local(traced.normal));
                }
            }
            let count = side * side;
            rays.gather += u64::from(count - 1);
            let sum = parts[0] + parts[1];
            samples.radiance[texel] = sum / count as f32;
            let total = sum.element_sum();
            if total > 0.0 {
                samples.background_share[texel] = parts[1].element_sum() / total;
            }
        }
    }

    /// What arrives at a surface along `wi`, and whether the texel that shows it is to be marked. Directions below the
    /// geometric surface, which a shading normal may ask for, are black and infinitely far.
    fn incident(&self, surface: &Surface, wi: Vec3A, sampler: &mut Sampler, rays: &mut RayCounts) -> (Traced, bool) {
        let nothing = Traced { normal: -wi, ..Traced::default() };
        if is_below(surface, wi) {
            return (nothing, false);
        }
        let ray = surface.spawn(wi);
        let Some(hit) = self.scene.intersect(&ray) else {
            return (Traced { radiance: soft_background(self.scene, self.sky, wi), ..nothing }, false);
        };
        let found = self.scene.surface(&ray, &hit);
        let follower = Follower { scene: self.scene, secondary: self.secondary, spread: f32::INFINITY };
        let met = Shading::new(self.scene, found, wi);
        let radiance = follower.reflection(met, sampler, rays).radiance();
        let is_marked = self.highlights && has_highlight(&met.bsdf);
        (Traced { radiance, distance: found.t, normal: found.ng }, is_marked)
    }
}

/// Whether a direction points into a surface, as those that are above its shading normal's horizon alone.
fn is_below(surface: &Surface, wi: Vec3A) -> bool {
    wi.dot(surface.ng) <= 0.0
}

/// Whether what leaves a surface depends so much on the direction that another point sees something else: a narrow
/// lobe, a mirror or glass.
fn has_highlight(bsdf: &Bsdf) -> bool {
    /// Wider lobes change less over the reach of a record than the texture blurs.
    const WIDE: f32 = 0.5;
    bsdf.has_delta() || matches!(bsdf.specular, Specular::Ggx { alpha, .. } if alpha < WIDE)
}

/// A highlight is so many times brighter than the mean.
const BRIGHT: f32 = 3.0;

/// Keeps the marks of view-dependent texels only where one of them shines: without a highlight, reflections change
/// slowly.
///
/// All of them keep it then, the dark ones too, for a highlight moves from one to the other.
fn settle_highlights(samples: &mut Samples) {
    let limit = BRIGHT * samples.mean_radiance().max_element();
    let mut marked = samples.radiance.iter().zip(&samples.view_dependent).filter(|(_, marked)| **marked);
    if !marked.any(|(radiance, _)| radiance.max_element() > limit) {
        samples.view_dependent.fill(false);
    }
}

/// The [`Tracer`] of a point: hole rays with light, verification rays without.
#[derive(Debug)]
pub(crate) struct PointTracer<'a, S> {
    pub(crate) gatherer: &'a Gatherer<'a, S>,
    pub(crate) surface: Surface,
    pub(crate) key: u64,
    pub(crate) rays: RayCounts,
}

impl<S: Secondary> Tracer for PointTracer<'_, S> {
    fn trace(&mut self, wi: &[Vec3A], out: &mut [Traced]) {
        for (number, (wi, out)) in wi.iter().zip(out).enumerate() {
            let number = u32::try_from(number).expect("at most 64 x 64 rays");
            let mut sampler = Sampler::new(self.gatherer.seed ^ HOLE_STREAM, self.key, number);
            (*out, _) = self.gatherer.incident(&self.surface, *wi, &mut sampler, &mut self.rays);
        }
        self.rays.hole += wi.len() as u64;
    }

    fn probe(&mut self, wi: &[Vec3A], out: &mut [Traced]) {
        for (wi, out) in wi.iter().zip(out) {
            let hit = (wi.dot(self.surface.ng) > 0.0)
                .then(|| self.gatherer.scene.intersect(&self.surface.spawn(*wi)))
                .flatten();
            out.distance = hit.map_or(f32::INFINITY, |hit| hit.t);
        }
        self.rays.hole += wi.len() as u64;
    }
}

/// Keeps the random numbers of further rays apart from those of records.
const FURTHER_STREAM: u64 = 0x0072_696d;
/// Keeps the random numbers of hole rays apart from those of records.
const HOLE_STREAM: u64 = 0x686f_6c65;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Glint;
    use crate::secondary::tests::square;
    use crate::secondary::{Known, NoSecondary};
    use scene::{Description, Environment, Material, Mesh, Ray};

    /// The same light everywhere, so that a white surface has the radiance 1.
    struct Even;

    impl Secondary for Even {
        fn irradiance(&self, _: &Surface) -> Option<Known> {
            Some(Known { direct: Some(Vec3::ZERO), indirect: Vec3::splat(std::f32::consts::PI), resolution: 0.0 })
        }

        fn caustic_irradiance(&self, _: &Surface) -> Vec3 {
            Vec3::ZERO
        }
    }

    /// The same light, with a glint in the middle of a square of 0.1 m.
    struct Square;

    impl Secondary for Square {
        fn irradiance(&self, surface: &Surface) -> Option<Known> {
            Even.irradiance(surface)
        }

        fn caustic_irradiance(&self, _: &Surface) -> Vec3 {
            Vec3::ZERO
        }

        fn glints(&self, _: &Surface) -> &[Glint] {
            const MIDDLE: Glint = Glint { at: Vec3A::new(0.5, 1.0, 0.2), is_far: false, weight: 1e4 };
            &[MIDDLE]
        }
    }

    #[test]
    fn glints_are_looked_at_with_many_rays() {
        let at = Vec3::new(0.5, 0.0, 0.2);
        let mesh = Mesh {
            positions: [square(3.0, 0.0), square(0.05, 1.0).map(|corner| corner + at)].concat(),
            triangles: vec![[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]],
            materials: vec![0, 0, 1, 1],
            ..Mesh::default()
        };
        let black = Material { diffuse: Vec3::ZERO, ..Material::default() };
        let white = Material { diffuse: Vec3::ONE, ..Material::default() };
        let description = Description { meshes: vec![mesh], materials: vec![black, white], ..Description::default() };
        let scene = Scene::new(description).unwrap();
        let down = Ray::new(Vec3A::new(0.0, 0.5, 0.0), Vec3A::NEG_Y);
        let floor = scene.surface(&down, &scene.intersect(&down).unwrap());
        // cos^2 / (pi d^2) times the area, which is small.
        let distance_sq = 1.0 + at.length_squared();
        let exact = f64::from(0.01 / (std::f32::consts::PI * distance_sq * distance_sq));
        fn means(looks: impl Fn(u64) -> (f32, u64)) -> (f64, f64, u64) {
            let looks: Vec<(f32, u64)> = (0..256).map(looks).collect();
            let mean = looks.iter().map(|look| f64::from(look.0)).sum::<f64>() / 256.0;
            let square = looks.iter().map(|look| (f64::from(look.0) - mean).powi(2)).sum::<f64>() / 255.0;
            (mean, square, looks.iter().map(|look| look.1).sum::<u64>() / 256)
        }
        fn look<S: Secondary>(scene: &Scene, secondary: &S, floor: &Surface, key: u64) -> (f32, u64) {
            let gatherer = Gatherer { scene, secondary, sky: None, divide: false, highlights: true, seed: 5 };
            let mut rays = RayCounts::default();
            let samples = gatherer.gather(floor, &Frame::from_normal(floor.n), 16, key, &mut rays);
            (samples.mean_radiance().x, rays.gather)
        }
        let guided = means(|key| look(&scene, &Square, &floor, key));
        let even = means(|key| look(&scene, &Even, &floor, key));
        for (mean, variance, _) in [guided, even] {
            // Four standard errors, and a hundredth for the size of the square.
            let error = 4.0 * (variance / 256.0).sqrt() + 0.01 * exact;
            assert!((mean - exact).abs() < error, "{mean} instead of {exact} +- {error}");
        }
        assert_eq!(even.2, 256, "a ray a texel");
        assert!(guided.2 < 4 * 256, "{} rays", guided.2);
        assert!(guided.1 < 0.1 * even.1, "a variance of {} instead of {}", guided.1, even.1);
    }

    #[test]
    fn texels_that_show_the_sky_and_what_ends_it_stand_where_that_does() {
        // A dark roof 1 m above a floor, under an even sky.
        let mesh = Mesh {
            positions: [square(5.0, 0.0), square(0.5, 1.0)].concat(),
            triangles: vec![[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]],
            materials: vec![0; 4],
            ..Mesh::default()
        };
        let black = Material { diffuse: Vec3::ZERO, ..Material::default() };
        let environment = Some(Environment::from_pixels(4, 2, vec![Vec3::ONE; 8]));
        let description =
            Description { meshes: vec![mesh], materials: vec![black], environment, ..Description::default() };
        let scene = Scene::new(description).unwrap();
        let down = Ray::new(Vec3A::new(0.1, 0.5, -0.05), Vec3A::NEG_Y);
        let floor = scene.surface(&down, &scene.intersect(&down).unwrap());
        let sky = SkySplit::new(&scene);
        let gatherer = Gatherer {
            scene: &scene,
            secondary: &NoSecondary,
            sky: sky.as_ref(),
            divide: true,
            highlights: true,
            seed: 1,
        };
        let frame = Frame::from_normal(floor.n);
        let mut mixed = 0;
        for key in 0..8 {
            let samples = gatherer.gather(&floor, &frame, 16, key, &mut RayCounts::default());
            for (texel, point) in samples.points().into_iter().enumerate() {
                let radiance = samples.radiance[texel].x;
                if radiance > 0.0 && radiance < 1.0 {
                    mixed += 1;
                    assert!(
                        (point.z - 1.0).abs() < 1e-4,
                        "a texel of radiance {radiance} is at {point}, not on the roof"
                    );
                    assert_eq!(samples.background_share[texel], 1.0, "its light is that of the sky");
                }
            }
        }
        assert!(mixed > 8 * 16, "the rim of the roof goes through many texels: {mixed}");
    }

    #[test]
    fn divided_texels_have_the_light_of_many_rays_and_little_noise() {
        // A white wall, and a black one that covers its upper half, seen from below.
        let wall =
            |z: f32, low: f32| [(-3.0, low), (3.0, low), (3.0, 2.0), (-3.0, 2.0)].map(|(x, y)| Vec3::new(x, y, z));
        let mesh = Mesh {
            positions: [square(3.0, -1.0), wall(-1.0, -1.0), wall(-0.9, 0.3)].concat(),
            triangles: vec![[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [8, 9, 10], [8, 10, 11]],
            materials: vec![0, 0, 1, 1, 0, 0],
            ..Mesh::default()
        };
        let black = Material { diffuse: Vec3::ZERO, ..Material::default() };
        let white = Material { diffuse: Vec3::ONE, ..Material::default() };
        let description = Description { meshes: vec![mesh], materials: vec![black, white], ..Description::default() };
        let scene = Scene::new(description).unwrap();
        let down = Ray::new(Vec3A::new(0.1, 0.5, 0.2), Vec3A::NEG_Y);
        let floor = scene.surface(&down, &scene.intersect(&down).unwrap());
        let frame = Frame::from_normal(floor.n);
        let gatherer =
            |divide| Gatherer { scene: &scene, secondary: &Even, sky: None, divide, highlights: true, seed: 3 };
        let spread = |values: &[f64]| {
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            (mean, values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64)
        };
        let gathers = |n: usize, divide: bool, count: u64| {
            let mut rays = RayCounts::default();
            let mut look =
                |key| f64::from(gatherer(divide).gather(&floor, &frame, n, key, &mut rays).mean_radiance().x);
            let (mean, variance) = spread(&(0..count).map(&mut look).collect::<Vec<f64>>());
            (mean, variance, rays.gather / count)
        };
        // Four standard errors: once in 16,000 pictures by chance, and the seeds are fixed.
        let (exact, error_sq, _) = gathers(64, false, 16);
        let (mean, variance, rays) = gathers(16, true, 256);
        let error = (error_sq / 16.0 + variance / 256.0).sqrt();
        assert!((mean - exact).abs() < 4.0 * error, "{mean} instead of {exact} +- {error}");
        // At least as many rays, one for each texel; half of their noise leaves room for what is not at edges.
        let (_, undivided, as_many) = gathers(20, false, 256);
        assert!((257..=as_many).contains(&rays), "{rays} and {as_many} rays");
        assert!(variance < 0.5 * undivided, "a variance of {variance} instead of {undivided}");
    }
}
