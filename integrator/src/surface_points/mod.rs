//! Points of the picture: primary rays through mirrors and glass to the surfaces that they show, one entry for each
//! distinct surface in a pixel, so that antialiasing costs no gathers.

mod point;

use glam::{UVec2, Vec2, Vec3};
use scene::{Ray, Scene};

use crate::allocation::SampleNoise;
use crate::delta_ways::{Way, delta_ways};
use crate::film::{FirstHit, PixelSum, Terms, guide_albedo};
use crate::plan::Plan;
use crate::sampler::{Sampler, hash_pair};
use crate::secondary::{Secondary, Shading};
use crate::shadows::Shadows;
use crate::sky::SkySplit;
use crate::statistics::RayCounts;
use crate::terms::direct::DirectTerm;
use crate::terms::direct_fit::Lit;
use crate::terms::guide::LobeGuide;
use crate::terms::light_guide::LightGuide;

use point::{CausticLooks, Spread, off_seams};
pub(crate) use point::{MIN_NORMAL_COS, SurfacePoint, same_surface};

/// What the primary rays of one pixel found.
#[derive(Debug, Default)]
pub(crate) struct PixelPoints {
    pub(crate) sum: PixelSum,
    pub(crate) points: Vec<SurfacePoint>,
    pub(crate) rays: RayCounts,
    pub(crate) dropped: u64,
    /// Number of samples.
    pub(crate) samples: u32,
    /// What the samples up to now tell of the noise.
    pub(crate) noise: SampleNoise,
}

/// Mirrors and glass seen by a primary ray split it in both branches so often; beyond, one is chosen.
const MAX_SPLITS: u32 = 2;
/// From so many mirrors and boundaries on, roulette ends a primary ray even if it carries much; and it passes at most
/// so many.
const LONG_CHAIN: u32 = 16;
const MAX_CHAIN: u32 = 1000;
/// Branches that carry less than this are ended by roulette.
const MIN_THROUGHPUT: f32 = 0.01;

/// A primary ray on its way.
struct Branch {
    ray: Ray,
    beta: Vec3,
    /// The part of `beta` by which radiance changes in glass.
    radiance_scale: f32,
    chain: u64,
    /// Mirrors and boundaries passed.
    bounces: u32,
    /// Distance from the eye so far.
    length: f32,
    /// See [`SurfacePoint::off_middle`].
    off_middle: f32,
}

/// A pixel that is traced.
struct Pixel<'a> {
    position: UVec2,
    /// Its number in the band.
    number: u32,
    /// Names it to the generators of random numbers.
    key: u64,
    shadows: Option<Shadows<'a>>,
    /// Whether the sample is one of the first half of all that there will be for now.
    is_first_half: bool,
}

/// A primary sample that is traced.
struct Sample<'a> {
    sampler: Sampler,
    light: SampleLight,
    /// What is still to be followed.
    branches: &'a mut Vec<Branch>,
}

/// What a primary sample finds by itself.
#[derive(Default)]
struct SampleLight {
    terms: Terms,
    /// The albedo by which it will reflect what it does not know yet.
    diffuse: Vec3,
    /// Variance of its light by the light samples, mean of R, G and B.
    variance: f32,
}

/// Traces primary rays.
#[derive(Debug)]
pub(crate) struct Primary<'a, S> {
    pub(crate) scene: &'a Scene,
    pub(crate) plan: &'a Plan,
    pub(crate) secondary: &'a S,
    pub(crate) sky: Option<&'a SkySplit>,
    pub(crate) guide: Option<LobeGuide>,
    pub(crate) light_guide: Option<LightGuide>,
    pub(crate) size: UVec2,
    pub(crate) seed: u64,
}

impl<S: Secondary> Primary<'_, S> {
    /// Learns which of several lights reach what the picture shows, and from where glossy lobes take their light, if
    /// there are any.
    pub(crate) fn learn_guides(&mut self, rays: &mut RayCounts) {
        let Self { scene, plan, sky, size, seed, .. } = *self;
        if plan.samples.light_learners > 0 {
            self.light_guide = LightGuide::learn(scene, sky, plan.samples.light_learners, size, seed, rays);
        }
        if self.plan.lobes.learners > 0 {
            self.guide = LobeGuide::learn(&self.direct_term(), self.size, self.seed, rays);
        }
    }

    /// What shades primary samples.
    pub(crate) fn direct_term(&self) -> DirectTerm<'_, S> {
        let Self { scene, plan, secondary, sky, .. } = *self;
        DirectTerm { scene, plan, secondary, sky, guide: self.guide.as_ref(), light_guide: self.light_guide.as_ref() }
    }

    /// Traces samples of the pixel at `position`, which is number `pixel` of its band, until it has as many as
    /// `samples`: adds its light that needs no cache, and its surface points.
    pub(crate) fn trace(&self, position: UVec2, pixel: u32, samples: u32, found: &mut PixelPoints) {
        let key = u64::from(position.y) * u64::from(self.size.x) + u64::from(position.x);
        let asks = self.plan.samples.clear_lights;
        let shadows = asks.then(|| Shadows::new(self.scene, position, self.size)).flatten();
        let mut pixel = Pixel { position, number: pixel, key, shadows, is_first_half: true };
        let mut branches = Vec::new();
        if samples > found.samples {
            found.points.iter_mut().for_each(|point| point.lit.expect_more(point.diffuse_weight, point.spread.count));
        }
        for number in found.samples..samples {
            pixel.is_first_half = 2 * number < samples;
            let mut sampler = Sampler::new(self.seed, key, number);
            let place = sampler.next_pair();
            let film = position.as_vec2() + place;
            let eye = Branch {
                ray: self.scene.camera_ray(film, self.size),
                beta: Vec3::ONE,
                radiance_scale: 1.0,
                chain: 0,
                bounces: 0,
                length: 0.0,
                off_middle: place.distance_squared(Vec2::splat(0.5)),
            };
            found.rays.camera += 1;
            branches.push(eye);
            let mut sample = Sample { sampler, light: SampleLight::default(), branches: &mut branches };
            let mut branch_number = 0;
            while let Some(branch) = sample.branches.pop() {
                branch_number += 1;
                sample.sampler.start_bounce(branch_number);
                self.step(branch, &mut pixel, &mut sample, found);
            }
            let light = sample.light;
            if light.terms.is_finite() {
                found.sum.add_terms(&light.terms);
                found.noise.add(light.terms.sum(), light.diffuse, light.variance);
            } else {
                found.dropped += 1;
            }
        }
        found.samples = samples;
    }

    /// Follows a branch of a sample to the next surface.
    fn step(&self, branch: Branch, pixel: &mut Pixel<'_>, sample: &mut Sample<'_>, found: &mut PixelPoints) {
        let Branch { ray, chain, bounces, off_middle, .. } = branch;
        let light = &mut sample.light;
        let Some(hit) = self.scene.intersect(&ray) else {
            add_emission(&mut light.terms, bounces, branch.beta * self.scene.background(ray.direction));
            return;
        };
        let surface = self.scene.surface(&ray, &hit);
        let beta = branch.beta * self.scene.transmittance(&surface);
        let length = branch.length + surface.t;
        let shading = Shading::new(self.scene, surface, ray.direction);
        let bsdf = &shading.bsdf;
        if bounces == 0 {
            let hit = FirstHit { albedo: guide_albedo(bsdf), normal: surface.n, depth: surface.t };
            found.sum.add_hit(&hit);
        }
        add_emission(&mut light.terms, bounces, beta * self.scene.emission(&surface));
        if bsdf.has_diffuse() || bsdf.has_glossy() {
            let shares_lobe = bounces == 0 && self.plan.lobes.shares(&shading);
            // What little light comes by, as by reflection in glass, needs few rays.
            let lobe_share = (!shares_lobe).then(|| beta.max_element() / branch.radiance_scale);
            let shadows = pixel.shadows.as_mut().filter(|_| bounces == 0);
            let plane = shadows.and_then(|shadows| shadows.plane(&shading.surface));
            let (known, variance) = self.direct_term().sample(
                &shading,
                pixel.position,
                lobe_share,
                plane,
                &mut sample.sampler,
                &mut found.rays,
            );
            if bounces == 0 {
                light.terms.direct += beta * known.direct;
            } else {
                light.terms.specular += beta * known.direct;
            }
            light.terms.specular += beta * known.specular;
            light.variance += (beta.element_sum() / 3.0).powi(2) * variance.unwrap_or(0.0);
            let footprint = length * self.scene.pixel_angle(self.size);
            let point = SurfacePoint {
                pixel: pixel.number,
                position: pixel.position,
                key: hash_pair(pixel.key, found.points.len() as u64),
                chain,
                shading: off_seams(self.scene, shading, &ray, &hit, footprint),
                off_middle,
                footprint,
                diffuse_weight: beta * bsdf.diffuse,
                specular_weight: beta,
                lobe_weight: if shares_lobe { beta } else { Vec3::ZERO },
                lit: Lit::new(beta * known.direct, beta * bsdf.diffuse, pixel.is_first_half, variance.is_some()),
                caustics: CausticLooks::default(),
                spread: Spread::default(),
            };
            // Light that the sample itself does not know.
            light.diffuse += if shares_lobe { beta * guide_albedo(bsdf) } else { point.diffuse_weight };
            let point = point.add_to(&mut found.points, length);
            if self.plan.photons.caustic > 0 && bsdf.has_diffuse() {
                point.look_for_caustics(self.secondary, &shading.surface);
            }
        }
        if bounces < MAX_CHAIN {
            self.branch(&shading, beta, Branch { length, ..branch }, sample, &mut found.rays);
        }
    }

    /// Goes on through mirrors and glass: both ways at first, then one of them.
    fn branch(&self, shading: &Shading, beta: Vec3, from: Branch, sample: &mut Sample<'_>, rays: &mut RayCounts) {
        let Sample { sampler, branches, .. } = sample;
        let limit = if from.bounces < LONG_CHAIN { 1.0 } else { 0.95 };
        let survival = |way: &Way| (way.flux() / MIN_THROUGHPUT).min(limit);
        let both = from.bounces < MAX_SPLITS;
        for way in delta_ways(shading, beta, from.radiance_scale, both, survival, sampler) {
            rays.path += 1;
            branches.push(Branch {
                ray: way.ray,
                beta: way.beta,
                radiance_scale: way.radiance_scale,
                chain: hash_pair(from.chain, 1 + way.number as u64),
                bounces: from.bounces + 1,
                ..from
            });
        }
    }
}

/// Light that a primary ray met by itself: seen, seen in one mirror, or in several.
fn add_emission(terms: &mut Terms, bounces: u32, radiance: Vec3) {
    match bounces {
        0 => terms.emitted += radiance,
        1 => terms.direct += radiance,
        _ => terms.specular += radiance,
    }
}
