//! Rays from one point into its hemisphere: n x n for a record, and single ones for holes and verification.

use glam::{Vec2, Vec3, Vec3A};
use hemimap::Frame;
use radcache::Samples;
use reproject::{Traced, Tracer};
use scene::{Bsdf, Scene, Specular, Surface};

use crate::allocation::neighbours;
use crate::sampler::{Rng, Sampler, hash_pair};
use crate::secondary::{Follower, Secondary};
use crate::sky::{SkySplit, soft_background};
use crate::statistics::RayCounts;

/// Answers rays from points of the picture: indirect radiance of what they hit, or the soft part of the sky.
#[derive(Debug)]
pub(crate) struct Gatherer<'a, S> {
    pub(crate) scene: &'a Scene,
    pub(crate) secondary: &'a S,
    pub(crate) sky: Option<&'a SkySplit>,
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
            let (traced, found) = self.incident(surface, wi, &mut sampler, rays);
            let normal = found.map_or(-wi, |found| found.ng);
            samples.set(texel, traced.radiance, traced.distance, frame.to_local(normal));
            samples.view_dependent[texel] = found.is_some_and(|found| has_highlight(&self.scene.bsdf(&found)));
        }
        let is_glossy = samples.view_dependent.clone();
        settle_highlights(&mut samples);
        // Below its own surface a record saw nothing, but another point may.
        if surface.ng != frame.n {
            for (is_marked, wi) in samples.view_dependent.iter_mut().zip(directions) {
                *is_marked |= frame.to_world(wi).dot(surface.ng) <= 0.0;
            }
        }
        rays.gather += (n * n) as u64;
        if self.sky.is_some() || is_glossy.contains(&true) {
            self.refine(surface, frame, &mut samples, &is_glossy, key, rays);
        }
        samples
    }

    /// Looks again, with several rays, through the texels where the sky ends and where what `is_glossy` shines: a window is so bright beside its frame, and a
    /// highlight beside what else is reflected, that one ray a texel would measure its area too roughly.
    fn refine(
        &self,
        surface: &Surface,
        frame: &Frame,
        samples: &mut Samples,
        is_glossy: &[bool],
        key: u64,
        rays: &mut RayCounts,
    ) {
        let n = samples.resolution();
        let counts = further_rays(samples, is_glossy, self.sky.is_some());
        for (texel, count) in counts.into_iter().enumerate().filter(|(_, count)| *count > 0) {
            let place = Vec2::new((texel % n) as f32, (texel / n) as f32);
            let mut parts = [Vec3::ZERO; 2];
            let (first, shows_sky) = (samples.radiance[texel], samples.distance[texel].is_infinite());
            parts[usize::from(shows_sky)] += first;
            for number in 0..count {
                let stream = hash_pair(key, texel as u64);
                let mut sampler = Sampler::new(self.seed ^ FURTHER_STREAM, stream, number);
                let jitter = sampler.next_pair();
                let wi = frame.to_world(hemimap::square_to_cosine_hemisphere((place + jitter) / n as f32));
                let (traced, _) = self.incident(surface, wi, &mut sampler, rays);
                parts[usize::from(traced.distance.is_infinite())] += traced.radiance;
                // What the sky ends at is in front of it, and moves over it when the place does.
                if shows_sky && traced.distance < samples.distance[texel] {
                    samples.set_jitter(texel, jitter);
                    samples.set(texel, first, traced.distance, frame.to_local(traced.normal));
                }
            }
            rays.gather += u64::from(count);
            let sum = parts[0] + parts[1];
            samples.radiance[texel] = sum / (count + 1) as f32;
            let total = sum.element_sum();
            if total > 0.0 {
                samples.background_share[texel] = parts[1].element_sum() / total;
            }
        }
    }

    /// What arrives at a surface along `wi`, and the surface that is there. Directions below the geometric surface, which a
    /// shading normal may ask for, are black and infinitely far.
    fn incident(
        &self,
        surface: &Surface,
        wi: Vec3A,
        sampler: &mut Sampler,
        rays: &mut RayCounts,
    ) -> (Traced, Option<Surface>) {
        let nothing = Traced::default();
        if wi.dot(surface.ng) <= 0.0 {
            return (nothing, None);
        }
        let ray = surface.spawn(wi);
        let Some(hit) = self.scene.intersect(&ray) else {
            return (Traced { radiance: soft_background(self.scene, self.sky, wi), ..nothing }, None);
        };
        let found = self.scene.surface(&ray, &hit);
        let follower = Follower { scene: self.scene, secondary: self.secondary, spread: f32::INFINITY };
        let radiance = follower.reflected(&ray, found, sampler, rays);
        (Traced { radiance, distance: found.t, normal: found.ng }, Some(found))
    }
}

/// Whether what leaves a surface depends so much on the direction that another point sees something else: a narrow lobe.
fn has_highlight(bsdf: &Bsdf) -> bool {
    /// Wider lobes change less over the reach of a record than the texture blurs.
    const WIDE: f32 = 0.5;
    matches!(bsdf.specular, Specular::Ggx { alpha, .. } if alpha < WIDE)
}

/// A highlight is so many times brighter than the mean.
const BRIGHT: f32 = 3.0;

/// Keeps the marks of view-dependent texels only where one of them shines: without a highlight, reflections change slowly.
///
/// All of them keep it then, the dark ones too, for a highlight moves from one to the other.
fn settle_highlights(samples: &mut Samples) {
    let limit = BRIGHT * samples.mean_radiance().max_element();
    let mut marked = samples.radiance.iter().zip(&samples.view_dependent).filter(|(_, marked)| **marked);
    if !marked.any(|(radiance, _)| radiance.max_element() > limit) {
        samples.view_dependent.fill(false);
    }
}

/// Returns how many rays more each texel takes: where the sky ends, if there is one, and beside glossy texels that shine. By the other texels alone: if its own ray had
/// a say, the mean would be biased.
fn further_rays(samples: &Samples, is_glossy: &[bool], has_sky: bool) -> Vec<u32> {
    let n = samples.resolution();
    let around = |texel: usize| neighbours(texel, n, n * n);
    let sum: Vec3 = samples.radiance.iter().sum();
    let shines_beside = |texel: usize| {
        let mean = (sum - samples.radiance[texel]).max_element() / (n * n - 1) as f32;
        around(texel).any(|other| is_glossy[other] && samples.radiance[other].max_element() > BRIGHT * mean)
    };
    let is_sky = |texel: usize| samples.distance[texel].is_infinite();
    let is_rim = |texel: usize| {
        let mut others = around(texel).map(is_sky);
        let first = others.next();
        others.any(|sky| Some(sky) != first)
    };
    let has_gloss = is_glossy.contains(&true);
    let count = |texel: usize| {
        if has_sky && is_rim(texel) {
            RIM_RAYS
        } else if has_gloss && shines_beside(texel) {
            HIGHLIGHT_RAYS
        } else {
            0
        }
    };
    (0..n * n).map(count).collect()
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

/// Rays through a texel at the rim of the sky, and through one beside a highlight, besides the first.
const RIM_RAYS: u32 = 8;
const HIGHLIGHT_RAYS: u32 = 2;
/// Keeps the random numbers of further rays apart from those of records.
const FURTHER_STREAM: u64 = 0x0072_696d;
/// Keeps the random numbers of hole rays apart from those of records.
const HOLE_STREAM: u64 = 0x686f_6c65;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::secondary::NoSecondary;
    use crate::secondary::tests::square;
    use scene::{Description, Environment, Material, Mesh, Ray};

    const N: usize = 6;

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
        let gatherer = Gatherer { scene: &scene, secondary: &NoSecondary, sky: sky.as_ref(), seed: 1 };
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

    fn even() -> Samples {
        let mut samples = Samples::new(N);
        for texel in 0..N * N {
            samples.set(texel, Vec3::ONE, 1.0, Vec3A::NEG_Z);
        }
        samples
    }

    #[test]
    fn texels_beside_a_highlight_take_more_rays_and_it_has_no_say_in_its_own() {
        let mut samples = even();
        let shining = 2 * N + 3;
        samples.radiance[shining] = Vec3::splat(50.0);
        let mut is_glossy = vec![false; N * N];
        assert!(further_rays(&samples, &is_glossy, false).iter().all(|&count| count == 0), "bright, but not glossy");
        is_glossy[shining] = true;
        let counts = further_rays(&samples, &is_glossy, false);
        assert_eq!(counts[shining], 0, "its neighbours do not shine");
        for beside in [shining - 1, shining + 1, shining - N, shining + N + 1] {
            assert_eq!(counts[beside], HIGHLIGHT_RAYS, "texel {beside}");
        }
        assert_eq!(counts.iter().filter(|count| **count > 0).count(), 8);
        // However bright a texel is, it does not outshine the one beside it in the limit of its own count.
        samples.radiance[shining + 1] = Vec3::splat(1e6);
        is_glossy[shining + 1] = true;
        assert_eq!(further_rays(&samples, &is_glossy, false)[shining + 1], HIGHLIGHT_RAYS);
    }

    #[test]
    fn rims_are_those_of_a_sky() {
        let mut samples = even();
        samples.distance[0] = f32::INFINITY;
        let no_gloss = [false; N * N];
        assert!(further_rays(&samples, &no_gloss, false).iter().all(|&count| count == 0), "black void has no rim");
        let counts = further_rays(&samples, &no_gloss, true);
        assert_eq!([counts[0], counts[1], counts[N + 1], counts[2]], [0, RIM_RAYS, RIM_RAYS, 0]);
    }
}
