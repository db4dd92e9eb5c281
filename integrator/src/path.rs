//! The reference: a path tracer that shares nothing with the cache but the scene, and how it is learnt which lights reach
//! a place. It splits its estimate into the same five terms.
//!
//! At every vertex light is sampled, and a direction by the material; both meet by multiple importance sampling with
//! the power heuristic. Which of up to 256 lights is sampled is decided by what some paths found beforehand. The length
//! of a path is unlimited: from the fourth bounce on it survives Russian roulette with a probability that follows the
//! root of its throughput. There is no clamping, so each term of each pixel is unbiased.
//!
//! The two parts of the first surface's f = f_d + f_s keep a throughput of their own along the path, and the path
//! remembers whether it met only mirrors and glass since: so every sample is split exactly as [`Terms`] defines it.
//!
//! What it cannot see: a point or directional light through mirrors or glass, for no path finds it by chance. Such
//! light is in the caustic photon map alone.
//!
//! # Source
//!
//! James Kajiya, *The Rendering Equation*, 1986. Eric Veach, *Robust Monte Carlo Methods for Light Transport
//! Simulation*, 1997, 9.2 (power heuristic) and 10.2.

use std::sync::atomic::{AtomicU32, Ordering};

use glam::{Vec2, Vec3, Vec3A};
use hemimap::Frame;
use rayon::prelude::*;
use scene::{Bsdf, BsdfSample, LightChoice, LightLesson, Lobes, Ray, Scene, SeenLights, Specular, Surface};

use crate::film::{Band, Film, FirstHit, PixelSum, Terms, guide_albedo};
use crate::light_lessons::{few, lessons};
use crate::sampler::{hash_pair, in_cell};
use crate::secondary::Shading;
use crate::statistics::map_counting;
use crate::{Progress, RayCounts, Sampler, Settings, Statistics};

/// The first vertex after which a path may be ended by chance.
const ROULETTE_START: u32 = 4;
/// A path survives with at most this probability, so that it ends even where nothing absorbs.
const MAX_SURVIVAL: f32 = 0.99;
/// No path has more vertices. With a survival of 0.99 one in 10^43 would; the limit is there for scenes that break
/// every rule.
pub const MAX_PATH_VERTICES: u32 = 10_000;
/// Keeps the random numbers of what is learnt apart from those of the picture.
const LEARNING_STREAM: u64 = 0x7061_7468_6c69_6768;

/// One sample of the light that comes along a ray.
#[derive(Debug, Clone, Copy)]
pub struct PathSample {
    /// Its radiance by terms.
    pub terms: Terms,
    /// The surface that the ray met.
    pub first_hit: Option<FirstHit>,
}

/// Follows paths through a scene and counts what it does. Each thread has its own.
#[derive(Debug)]
pub struct PathTracer<'a> {
    scene: &'a Scene,
    has_light_choice: bool,
    light_choice: Option<&'a LightChoice>,
    /// Rays traced, those of kind `camera`, `path` and `shadow`.
    pub rays: RayCounts,
    /// Paths cut at [`MAX_PATH_VERTICES`].
    pub cut_paths: u64,
    /// Samples that were not finite and count as black.
    pub dropped_samples: u64,
}

/// How the ray in flight came from the eye: this decides the term to which a light on it belongs.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Flight {
    /// Left the eye.
    Eye,
    /// Left the first surface.
    Straight,
    /// Has met only mirrors and glass since the first surface.
    Focused,
    /// All others.
    Scattered,
}

impl Flight {
    /// Returns the state behind a vertex, by whether that was a mirror or glass.
    const fn after(self, delta: bool) -> Self {
        match self {
            Self::Eye => Self::Straight,
            Self::Straight | Self::Focused if delta => Self::Focused,
            _ => Self::Scattered,
        }
    }
}

/// What radiance at the path's end counts in the pixel, by the lobe of the first surface; before that all is
/// `specular`.
#[derive(Debug, Clone, Copy)]
struct Throughput {
    diffuse: Vec3,
    specular: Vec3,
}

impl Throughput {
    fn scaled(self, factor: Vec3) -> Self {
        Self { diffuse: self.diffuse * factor, specular: self.specular * factor }
    }

    fn sum(self) -> Vec3 {
        self.diffuse + self.specular
    }
}

/// The direction in which a path goes on, with the density of that choice.
struct Step {
    wi: Vec3A,
    /// 0 for mirrors and glass: light sampling could not have found this direction.
    pdf: f32,
}

impl<'a> PathTracer<'a> {
    /// Returns a tracer that has counted nothing yet.
    #[must_use]
    pub fn new(scene: &'a Scene) -> Self {
        let has_light_choice = scene.lights().has_choice();
        let rays = RayCounts::default();
        Self { scene, has_light_choice, light_choice: None, rays, cut_paths: 0, dropped_samples: 0 }
    }

    /// Chooses lights as was learnt of the scene's lights, if anything was: by
    /// [`Lights::learnt_choice`](scene::Lights::learnt_choice).
    #[must_use]
    pub(crate) fn with_light_choice(self, light_choice: Option<&'a LightChoice>) -> Self {
        Self { light_choice, ..self }
    }

    /// Returns an unbiased estimate of the radiance that comes along `ray` to its origin. A sample that is not finite
    /// is dropped: it counts as black, in [`PathTracer::dropped_samples`] too.
    pub fn trace(&mut self, ray: &Ray, sampler: &mut Sampler) -> PathSample {
        let mut sample = PathSample { terms: Terms::default(), first_hit: None };
        self.follow(ray, sampler, &mut sample);
        if !sample.terms.is_finite() {
            self.dropped_samples += 1;
            sample.terms = Terms::default();
        }
        sample
    }

    fn follow(&mut self, ray: &Ray, sampler: &mut Sampler, sample: &mut PathSample) {
        let scene = self.scene;
        let mut ray = *ray;
        let mut flight = Flight::Eye;
        let mut throughput = Throughput { diffuse: Vec3::ZERO, specular: Vec3::ONE };
        // Refraction scales radiance, but not the power that a path still carries: roulette looks at the latter.
        let mut radiance_scale = 1.0;
        // The vertex behind the ray in flight, and the density of its direction.
        let mut from: Option<(Vec3A, Step)> = None;

        self.rays.camera += 1;
        for vertex in 1..=MAX_PATH_VERTICES {
            // By reference: to move a hit is to wait for the stores of its parts.
            let Some(hit) = &scene.intersect(&ray) else {
                let weight = from.as_ref().map_or(1.0, |(p, step)| {
                    material_weight(step.pdf, || self.lights_from(*p).pdf_environment(step.wi))
                });
                add(&mut sample.terms, flight, throughput, scene.background(ray.direction) * weight);
                return;
            };
            let surface = scene.surface(&ray, hit);
            throughput = throughput.scaled(scene.transmittance(&surface));

            let emission = scene.emission(&surface);
            if emission != Vec3::ZERO {
                let weight = from.as_ref().map_or(1.0, |(p, step)| {
                    material_weight(step.pdf, || self.lights_from(*p).pdf_surface(step.wi, &surface))
                });
                add(&mut sample.terms, flight, throughput, emission * weight);
            }

            let bsdf = scene.bsdf(&surface);
            if vertex == 1 {
                sample.first_hit = Some(FirstHit { albedo: guide_albedo(&bsdf), normal: surface.n, depth: surface.t });
            }
            let frame = Frame::from_normal(surface.n);
            let wo = frame.to_local(-ray.direction);
            sampler.start_bounce(vertex);

            // The choice of a light and the point on it come from one block, and so do that of a lobe and its
            // direction: samples are stratified on each light and in each lobe. Every bounce takes the same blocks, so
            // that they keep their meaning over the samples.
            let u_light = sampler.next_4d_for(self.has_light_choice);
            let [u_lobe, u, v, _] = sampler.next_4d_for(bsdf.has_choice());
            let u_roulette = if vertex >= ROULETTE_START { sampler.next_pair().x } else { 0.0 };
            if bsdf.scatters(Lobes::ALL)
                && let Some(reflected) = self.sample_light(&surface, &bsdf, &frame, wo, u_light)
            {
                add(&mut sample.terms, flight.after(false), throughput, reflected);
            }

            let Some(next) = bsdf.sample(Lobes::ALL, wo, u_lobe, Vec2::new(u, v)) else { return };
            let wi = frame.to_world(next.wi);
            if !is_on_side(&surface, wi, next.transmitted) {
                return;
            }
            throughput =
                if vertex == 1 { split(&bsdf, wo, &next, throughput.specular) } else { throughput.scaled(next.weight) };
            radiance_scale *= next.radiance_scale;

            if vertex >= ROULETTE_START {
                // The root lets twice as many paths live as the throughput itself would: a tenth less error for the
                // same time.
                let survival = (throughput.sum().max_element() / radiance_scale).sqrt().min(MAX_SURVIVAL);
                if u_roulette >= survival {
                    return;
                }
                throughput = throughput.scaled(Vec3::splat(1.0 / survival));
            }

            flight = flight.after(next.delta);
            from = Some((surface.p, Step { wi, pdf: next.pdf }));
            ray = surface.spawn(wi);
            self.rays.path += 1;
        }
        self.cut_paths += 1;
    }
}

impl PathTracer<'_> {
    /// The lights as a vertex at `p` chose them, for the density of what a ray from there met by chance, in which the
    /// normal has no say.
    fn lights_from(&self, p: Vec3A) -> SeenLights<'_> {
        self.scene.lights().seen_by(p, Vec3A::ZERO, self.light_choice)
    }

    /// Returns the light that one chosen direction to a light sends by way of `surface` to the viewer, weighted against
    /// the chance that the material's own choice finds that light.
    fn sample_light(
        &mut self,
        surface: &Surface,
        bsdf: &Bsdf,
        frame: &Frame,
        wo: Vec3A,
        [u_choice, u, v, _]: [f32; 4],
    ) -> Option<Vec3> {
        let mut lights = self.scene.lights().seen_by(surface.p, surface.n, self.light_choice);
        let light = lights.direction(u_choice, Vec2::new(u, v))?;
        if !is_on_side(surface, light.wi(), false) {
            return None;
        }
        self.rays.shadow += 1;
        if self.scene.occluded(&surface.shadow_ray(light.wi(), light.distance())) {
            return None;
        }
        let light = light.sample()?;
        let wi = frame.to_local(light.wi);
        let (f, pdf) = bsdf.eval_pdf(Lobes::ALL, wo, wi);
        let value = f * light.radiance * (wi.z / light.pdf);
        let weight = if light.delta { 1.0 } else { power_heuristic(light.pdf, pdf) };
        Some(value * weight * self.scene.transmittance_within(surface.media, light.distance))
    }
}

/// Returns the throughput behind the first surface by its lobes, after `next` was chosen there.
fn split(bsdf: &Bsdf, wo: Vec3A, next: &BsdfSample, throughput: Vec3) -> Throughput {
    let diffuse = if next.delta || !bsdf.has_diffuse() {
        Vec3::ZERO
    } else if matches!(bsdf.specular, Specular::Ggx { .. }) {
        bsdf.eval(Lobes::DIFFUSE, wo, next.wi) * (next.wi.z / next.pdf)
    } else {
        next.weight
    };
    // Where one lobe is all there is, the other is exactly 0: so its term is too.
    let specular = (next.weight - diffuse).max(Vec3::ZERO);
    Throughput { diffuse: throughput * diffuse, specular: throughput * specular }
}

/// Adds light at the end of a path to the term to which it belongs.
fn add(terms: &mut Terms, flight: Flight, throughput: Throughput, radiance: Vec3) {
    match flight {
        Flight::Eye => terms.emitted += throughput.sum() * radiance,
        Flight::Straight => terms.direct += throughput.sum() * radiance,
        Flight::Focused => {
            terms.caustic += throughput.diffuse * radiance;
            terms.specular += throughput.specular * radiance;
        }
        Flight::Scattered => {
            terms.indirect += throughput.diffuse * radiance;
            terms.specular += throughput.specular * radiance;
        }
    }
}

/// Whether `wi` leaves on the side of the true surface on which the material thinks it does. With interpolated normals
/// it may not; then the surface is black, or light would leak through it.
fn is_on_side(surface: &Surface, wi: Vec3A, transmitted: bool) -> bool {
    let cosine = surface.ng.dot(wi);
    if transmitted { cosine < 0.0 } else { cosine > 0.0 }
}

/// Returns the weight of a light that the material's choice of density `pdf` met, against `light_pdf` of light
/// sampling. A mirror's choice (`pdf` 0) has no rival.
fn material_weight(pdf: f32, light_pdf: impl FnOnce() -> f32) -> f32 {
    if pdf > 0.0 { power_heuristic(pdf, light_pdf()) } else { 1.0 }
}

/// Returns the weight of the choice of density `a` against that of density `b`: a^2 / (a^2 + b^2), written so that
/// nothing overflows.
fn power_heuristic(a: f32, b: f32) -> f32 {
    let ratio = b / a;
    1.0 / (1.0 + ratio * ratio)
}

/// Makes a picture by the reference path tracer: exactly [`Settings::path_spp`] samples a pixel, uniform over it (a box
/// filter of one pixel). The settings must be valid.
pub(crate) fn render(
    scene: &Scene,
    settings: &Settings,
    progress: &(dyn Fn(Progress) + Sync),
    statistics: &mut Statistics,
) -> Film {
    let mut film = Film::new(settings.size);
    statistics.spp = settings.path_spp();
    statistics.memory.film = film.memory_bytes();
    statistics.time("path", |statistics| {
        let light_choice = learn_lights(scene, settings, settings.seed, &mut statistics.rays);
        let finished = AtomicU32::new(0);
        let tracers: Vec<PathTracer<'_>> = film
            .bands_mut(1)
            .into_par_iter()
            .map(|band| {
                let mut tracer = PathTracer::new(scene).with_light_choice(light_choice.as_ref());
                tracer.fill(band, settings);
                // Relaxed: nothing but the bar depends on it.
                let finished = finished.fetch_add(1, Ordering::Relaxed) + 1;
                progress(Progress { phase: "path", done: finished as f32 / settings.size.y as f32 });
                tracer
            })
            .collect();
        for tracer in &tracers {
            statistics.add_paths(tracer);
        }
    });
    film
}

/// Learns which of a few lights reach the vertices of the paths of a picture: light that comes through a roof by no
/// way would be chosen as often as if there were none. `None` where there is nothing to learn.
pub(crate) fn learn_lights(scene: &Scene, settings: &Settings, seed: u64, rays: &mut RayCounts) -> Option<LightChoice> {
    /// Paths along a side of the picture, and the most vertices of each.
    const SIDE: u32 = 32;
    const VERTICES: u32 = 4;
    let lights = scene.lights();
    if !lights.has_choice() || few(lights).is_none() || settings.study.light_guide == Some(false) {
        return None;
    }
    let (size, seed) = (settings.size, hash_pair(seed, LEARNING_STREAM));
    let learn = |number: u32, rays: &mut RayCounts| {
        let mut sampler = Sampler::new(seed, number.into(), 0);
        let mut ray = scene.camera_ray(in_cell(number, SIDE, sampler.next_pair()) * size.as_vec2(), size);
        rays.camera += 1;
        let mut learnt: Vec<LightLesson> = Vec::new();
        for _ in 0..VERTICES {
            let Some(hit) = scene.intersect(&ray) else { break };
            let shading = Shading::new(scene, scene.surface(&ray, &hit), ray.direction);
            if shading.bsdf.scatters(Lobes::ALL) {
                learnt.extend(lessons(scene, None, &shading, false, &mut sampler, rays));
            }
            let [u_lobe, u, v, _] = sampler.next_4d();
            let Some(next) = shading.bsdf.sample(Lobes::ALL, shading.wo, u_lobe, Vec2::new(u, v)) else { break };
            let wi = shading.frame.to_world(next.wi);
            if !shading.leaves(wi, next.wi) {
                break;
            }
            ray = shading.surface.spawn(wi);
            rays.path += 1;
        }
        learnt
    };
    let learnt = map_counting((0..SIDE * SIDE).into_par_iter(), rays, learn);
    lights.learnt_choice(&learnt.concat())
}

impl PathTracer<'_> {
    fn fill(&mut self, mut band: Band<'_>, settings: &Settings) {
        let spp = settings.path_spp();
        for index in 0..band.pixel_count() {
            let corner = band.position(index).as_vec2();
            let mut sum = PixelSum::default();
            for number in 0..spp {
                let mut sampler = Sampler::new(settings.seed, band.film_index(index) as u64, number);
                let ray = self.scene.camera_ray(corner + sampler.next_pair(), settings.size);
                let sample = self.trace(&ray, &mut sampler);
                sum.add_terms(&sample.terms);
                if let Some(hit) = &sample.first_hit {
                    sum.add_hit(hit);
                }
            }
            band.set(index, &sum.mean(spp));
        }
    }
}
