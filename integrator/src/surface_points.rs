//! Points of the picture: primary rays through mirrors and glass to the surfaces that they show, one entry for each distinct
//! surface in a pixel, so that antialiasing costs no gathers.

use glam::{UVec2, Vec2, Vec3, Vec3A};
use scene::{Hit, Ray, Scene, Surface};

use crate::allocation::SampleNoise;
use crate::delta_ways::{Way, delta_ways};
use crate::film::{FirstHit, PixelSum, Terms, guide_albedo};
use crate::plan::Plan;
use crate::sampler::{Sampler, hash_pair};
use crate::secondary::{Secondary, Shading};
use crate::sky::SkySplit;
use crate::statistics::RayCounts;
use crate::terms::direct::DirectTerm;
use crate::terms::guide::LobeGuide;
use crate::terms::light_guide::LightGuide;

/// A distinct surface in a pixel: that of its samples which is nearest to the middle of the pixel stands for all.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SurfacePoint {
    /// Pixel within the band.
    pub(crate) pixel: u32,
    /// The sequence of mirrors and glass before it: 0 for what is seen directly.
    pub(crate) chain: u64,
    /// The sample that stands for the others.
    pub(crate) shading: Shading,
    /// Sum over the pixel's samples of throughput times albedo.
    pub(crate) diffuse_weight: Vec3,
    /// Sum of throughput, for the glossy part.
    pub(crate) specular_weight: Vec3,
    /// The same of the samples whose lobes are shared.
    pub(crate) lobe_weight: Vec3,
    /// Sum of the irradiance by caustics at some of the samples, over their coverage, and the number of these samples.
    pub(crate) caustic: Vec3,
    pub(crate) caustic_looks: u32,
    /// About the least length over which they change there, metres.
    caustic_detail: f32,
    /// Distance of that sample from the middle of the pixel, in pixels, by squares.
    pub(crate) off_middle: f32,
    /// The pixel in the picture.
    pub(crate) position: UVec2,
    /// Number of samples, and sums over them of how far they are off the one that stands for them, of the squares of that, and of how their normals
    /// differ from its.
    pub(crate) count: f32,
    pub(crate) offset: Vec3A,
    pub(crate) offset_sq: f32,
    pub(crate) turn: Vec3A,
    /// Width of the pixel at the surface, metres.
    pub(crate) footprint: f32,
    /// Names the point to the generators of random numbers.
    pub(crate) key: u64,
}

impl SurfacePoint {
    /// The mean place and normal of the samples. The place may lie off the surface, so no ray may start there, but what light there is at a small distance from a
    /// point, a record knows.
    pub(crate) fn middle(&self) -> (Vec3A, Vec3A) {
        let surface = &self.shading.surface;
        let n = if self.turn == Vec3A::ZERO { surface.n } else { (surface.n + self.turn / self.count).normalize() };
        (surface.p + self.offset / self.count, n)
    }

    /// The distance of the ends of the point from its middle, metres: half the length over which its samples lie, if they lie evenly along a line.
    pub(crate) fn half_length(&self) -> f32 {
        let variance = (self.offset_sq - self.offset.length_squared() / self.count) / self.count;
        (3.0 * variance.max(0.0)).sqrt()
    }

    /// Asks for caustics where one of the samples lies, unless there are enough: as many as are needed where the samples lie so far apart.
    fn look_for_caustics(&mut self, secondary: &impl Secondary, surface: &Surface) {
        let is_first = self.caustic_looks == 0;
        // Waves may spread a pixel over more than its width.
        let width = self.footprint.max(2.0 * self.half_length());
        let wanted = CAUSTIC_LOOKS_PER_RADIUS * width / self.caustic_detail;
        if !is_first && self.caustic_looks as f32 >= wanted.clamp(1.0, MAX_CAUSTIC_LOOKS) {
            return;
        }
        // By all that a pixel may see, or the number would depend on what was found, and means be wrong.
        let reach = if is_first { self.footprint } else { 0.0 };
        let found = secondary.covered_caustic_irradiance(surface, reach);
        self.caustic += found.irradiance;
        self.caustic_looks += 1;
        self.caustic_detail = self.caustic_detail.min(found.radius);
    }

    /// Joins a sample of the same surface.
    fn join(&mut self, sample: &Self) {
        self.diffuse_weight += sample.diffuse_weight;
        self.specular_weight += sample.specular_weight;
        self.lobe_weight += sample.lobe_weight;
        self.count += 1.0;
        let (stands, joins) = (&self.shading.surface, &sample.shading.surface);
        let (offset, turn) = (joins.p - stands.p, joins.n - stands.n);
        self.offset += offset;
        self.offset_sq += offset.length_squared();
        self.turn += turn;
        if sample.off_middle < self.off_middle {
            self.offset_sq += offset.length_squared() * self.count - 2.0 * offset.dot(self.offset);
            self.offset -= offset * self.count;
            self.turn -= turn * self.count;
            (self.shading, self.footprint, self.off_middle) = (sample.shading, sample.footprint, sample.off_middle);
        }
    }
}

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
/// From so many mirrors and boundaries on, roulette ends a primary ray even if it carries much; and it passes at most so many.
const LONG_CHAIN: u32 = 16;
const MAX_CHAIN: u32 = 1000;
/// Branches that carry less than this are ended by roulette.
const MIN_THROUGHPUT: f32 = 0.01;
/// So many samples of a pixel ask for caustics for each time that it is wider than the least of the discs by which they are blurred, up to a number.
const CAUSTIC_LOOKS_PER_RADIUS: f32 = 4.0;
const MAX_CAUSTIC_LOOKS: f32 = 8.0;
/// Samples whose normals differ by more are different surfaces.
const MIN_NORMAL_COS: f32 = 0.95;
/// Samples farther from the plane of a surface than this share of its distance from the eye are different surfaces.
const PLANE_TOLERANCE: f32 = 0.01;

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

/// What a primary sample finds by itself.
#[derive(Default)]
struct Sample {
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
    /// Learns which of several lights reach what the picture shows, and from where glossy lobes take their light, if there are any.
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

    /// Traces samples of the pixel at `position`, which is number `pixel` of its band, until it has as many as `samples`: adds its light that needs
    /// no cache, and its surface points.
    pub(crate) fn trace(&self, position: UVec2, pixel: u32, samples: u32, found: &mut PixelPoints) {
        let key = u64::from(position.y) * u64::from(self.size.x) + u64::from(position.x);
        let mut stack = Vec::new();
        for number in found.samples..samples {
            let mut sampler = Sampler::new(self.seed, key, number);
            let place = sampler.next_pair();
            let film = position.as_vec2() + place;
            let mut sample = Sample::default();
            stack.push(Branch {
                ray: self.scene.camera_ray(film, self.size),
                beta: Vec3::ONE,
                radiance_scale: 1.0,
                chain: 0,
                bounces: 0,
                length: 0.0,
                off_middle: place.distance_squared(Vec2::splat(0.5)),
            });
            found.rays.camera += 1;
            let mut branch_number = 0;
            while let Some(branch) = stack.pop() {
                branch_number += 1;
                sampler.start_bounce(branch_number);
                self.step(branch, position, pixel, key, &mut sampler, &mut stack, &mut sample, found);
            }
            if sample.terms.is_finite() {
                found.sum.add_terms(&sample.terms);
                found.noise.add(sample.terms.sum(), sample.diffuse, sample.variance);
            } else {
                found.dropped += 1;
            }
        }
        found.samples = samples;
    }

    fn step(
        &self,
        branch: Branch,
        position: UVec2,
        pixel: u32,
        key: u64,
        sampler: &mut Sampler,
        stack: &mut Vec<Branch>,
        sample: &mut Sample,
        found: &mut PixelPoints,
    ) {
        let terms = &mut sample.terms;
        let Branch { ray, chain, bounces, .. } = branch;
        let Some(hit) = self.scene.intersect(&ray) else {
            add_emission(terms, bounces, branch.beta * self.scene.background(ray.direction));
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
        add_emission(terms, bounces, beta * self.scene.emission(&surface));
        if bsdf.has_diffuse() || bsdf.has_glossy() {
            let shares_lobe = bounces == 0 && self.plan.lobes.shares(&shading);
            // What little light comes by, as by reflection in glass, needs few rays.
            let lobe_share = (!shares_lobe).then(|| beta.max_element() / branch.radiance_scale);
            let (light, variance) = self.direct_term().sample(&shading, position, lobe_share, sampler, &mut found.rays);
            if bounces == 0 {
                terms.direct += beta * light.direct;
            } else {
                terms.specular += beta * light.direct;
            }
            terms.specular += beta * light.specular;
            sample.variance += (beta.element_sum() / 3.0).powi(2) * variance;
            let footprint = length * self.scene.camera().pixel_angle(self.size);
            let point = SurfacePoint {
                pixel,
                chain,
                shading: off_seams(self.scene, shading, &ray, &hit, footprint),
                diffuse_weight: beta * bsdf.diffuse,
                specular_weight: beta,
                lobe_weight: if shares_lobe { beta } else { Vec3::ZERO },
                caustic: Vec3::ZERO,
                caustic_looks: 0,
                caustic_detail: f32::INFINITY,
                off_middle: branch.off_middle,
                position,
                count: 1.0,
                offset: Vec3A::ZERO,
                offset_sq: 0.0,
                turn: Vec3A::ZERO,
                footprint,
                key: hash_pair(key, found.points.len() as u64),
            };
            // Light that the sample itself does not know.
            sample.diffuse += if shares_lobe { beta * guide_albedo(bsdf) } else { point.diffuse_weight };
            let point = add_point(&mut found.points, point, length);
            if self.plan.photons.caustic > 0 && bsdf.has_diffuse() {
                point.look_for_caustics(self.secondary, &shading.surface);
            }
        }
        if bounces < MAX_CHAIN {
            self.branch(&shading, beta, Branch { length, ..branch }, sampler, stack, &mut found.rays);
        }
    }

    /// Goes on through mirrors and glass: both ways at first, then one of them.
    fn branch(
        &self,
        shading: &Shading,
        beta: Vec3,
        from: Branch,
        sampler: &mut Sampler,
        stack: &mut Vec<Branch>,
        rays: &mut RayCounts,
    ) {
        let limit = if from.bounces < LONG_CHAIN { 1.0 } else { 0.95 };
        let survival = |way: &Way| (way.flux() / MIN_THROUGHPUT).min(limit);
        let both = from.bounces < MAX_SPLITS;
        for way in delta_ways(shading, beta, from.radiance_scale, both, survival, sampler) {
            rays.path += 1;
            stack.push(Branch {
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

/// Moves a point that lies on an edge of its triangle, inwards by less than a pixel: from a seam rays slip through the neighbour and see
/// what is behind, and whoever takes light from there would be misled.
fn off_seams(scene: &Scene, shading: Shading, ray: &Ray, hit: &Hit, footprint: f32) -> Shading {
    /// As a barycentric coordinate, it is nearer to an edge than this.
    const SEAM: f32 = 1e-5;
    let Hit { barycentrics, .. } = *hit;
    let margin = barycentrics.min_element().min(1.0 - barycentrics.element_sum());
    if margin >= SEAM || hit.primitive as usize >= scene.triangle_count() {
        return shading;
    }
    let middle = Hit { barycentrics: Vec2::splat(1.0 / 3.0), ..*hit };
    let inwards = scene.surface(ray, &middle).p - shading.surface.p;
    let surface = Surface { p: shading.surface.p + inwards.clamp_length_max(0.25 * footprint), ..shading.surface };
    Shading { surface, ..shading }
}

/// Light that a primary ray met by itself: seen, seen in one mirror, or in several.
fn add_emission(terms: &mut Terms, bounces: u32, radiance: Vec3) {
    match bounces {
        0 => terms.emitted += radiance,
        1 => terms.direct += radiance,
        _ => terms.specular += radiance,
    }
}

/// Adds a sample to the point of its surface, or starts one; returns it.
fn add_point(points: &mut Vec<SurfacePoint>, point: SurfacePoint, length: f32) -> &mut SurfacePoint {
    // Where a picture is black there is no diffuse part, which decides what becomes of gloss: such samples go ways of their own.
    let same = points.iter().position(|other| {
        other.chain == point.chain
            && other.shading.bsdf.has_diffuse() == point.shading.bsdf.has_diffuse()
            && same_surface(&other.shading.surface, &point.shading.surface, length)
    });
    let number = same.unwrap_or(points.len());
    if same.is_some() {
        points[number].join(&point);
    } else {
        points.push(point);
    }
    &mut points[number]
}

/// Whether two places that are seen `length` metres away are of one surface: like normals, and each near the plane of the other.
pub(crate) fn same_surface(a: &Surface, b: &Surface, length: f32) -> bool {
    let tolerance = PLANE_TOLERANCE * length;
    let apart = b.p - a.p;
    a.material == b.material
        && a.n.dot(b.n) >= MIN_NORMAL_COS
        && a.n.dot(apart).abs() <= tolerance
        && b.n.dot(apart).abs() <= tolerance
}

#[cfg(test)]
mod tests {
    use scene::{Description, Material, Mesh};

    use super::*;

    /// A wall that stands on the floor y = 0.
    fn wall() -> Scene {
        let mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X * 4.0, Vec3::Y * 3.0],
            triangles: vec![[0, 1, 2]],
            materials: vec![0],
            ..Mesh::default()
        };
        let materials = vec![Material::default()];
        Scene::new(Description { meshes: vec![mesh], materials, ..Description::default() }).unwrap()
    }

    /// One sample of the wall.
    fn sample(scene: &Scene, x: f32, off_middle: f32) -> SurfacePoint {
        let ray = Ray::new(Vec3A::new(x, 0.5, 5.0), Vec3A::NEG_Z);
        let surface = scene.surface(&ray, &scene.intersect(&ray).unwrap());
        SurfacePoint {
            pixel: 0,
            chain: 0,
            shading: Shading::new(scene, surface, ray.direction),
            diffuse_weight: Vec3::ONE,
            specular_weight: Vec3::ONE,
            lobe_weight: Vec3::ZERO,
            caustic: Vec3::ZERO,
            caustic_looks: 0,
            caustic_detail: f32::INFINITY,
            off_middle,
            position: UVec2::ZERO,
            count: 1.0,
            offset: Vec3A::ZERO,
            offset_sq: 0.0,
            turn: Vec3A::ZERO,
            footprint: 0.01,
            key: 0,
        }
    }

    /// Caustics that are as bright as their place is far along x, and change over a length.
    struct Ramp(f32);

    impl Secondary for Ramp {
        fn irradiance(&self, _: &Surface) -> Option<crate::Known> {
            None
        }

        fn caustic_irradiance(&self, surface: &Surface) -> Vec3 {
            Vec3::splat(surface.p.x)
        }

        fn covered_caustic_irradiance(&self, surface: &Surface, reach: f32) -> crate::Irradiance {
            assert!(reach == 0.0 || reach == 0.01, "the width of the pixel, or nothing: {reach}");
            crate::Irradiance { irradiance: self.caustic_irradiance(surface), radius: self.0 }
        }
    }

    #[test]
    fn caustics_are_asked_for_as_often_as_they_change_within_a_pixel() {
        let scene = wall();
        // Samples that lie within the width of a pixel, and some that waves spread over 20 of them.
        for (spread, detail, expected) in [
            (0.01, f32::INFINITY, 1),
            (0.01, 0.1, 1),
            (0.01, 0.02, 3),
            (0.01, 0.001, 8),
            (0.01, 0.0, 8),
            (0.2, 0.23, 4),
            (0.2, 0.01, 8),
        ] {
            let places = (0..16u8).map(|i| 1.0 + spread * f32::from((7 * i) % 16) / 16.0);
            let mut samples = places.map(|x| sample(&scene, x, 0.0));
            let mut point = samples.next().unwrap();
            let surface = point.shading.surface;
            point.look_for_caustics(&Ramp(detail), &surface);
            for next in samples {
                point.join(&next);
                point.look_for_caustics(&Ramp(detail), &next.shading.surface);
            }
            assert_eq!(point.caustic_looks, expected, "{spread} wide, {detail}");
            let mean = point.caustic.x / point.caustic_looks as f32;
            assert!((1.0..=1.0 + spread).contains(&mean), "a mean of places: {mean}");
        }
    }

    #[test]
    fn ends_of_a_point_are_as_far_off_as_its_samples_lie() {
        // Evenly from 1 to 2, whatever sample stands for them.
        let scene = wall();
        for nearest in [0u8, 13, 63] {
            let samples = (0..64u8).map(|i| {
                let off_middle = (f32::from(i) - f32::from(nearest)).abs();
                sample(&scene, 1.0 + (f32::from(i) + 0.5) / 64.0, off_middle)
            });
            let point = samples.reduce(|mut point, sample| {
                point.join(&sample);
                point
            });
            let point = point.unwrap();
            let (middle, half) = (point.middle().0, point.half_length());
            assert!((middle.x - 1.5).abs() < 1e-4, "{nearest}: middle {middle}");
            assert!((half - 0.5).abs() < 1e-3, "{nearest}: {half}");
        }
    }

    #[test]
    fn points_in_a_seam_move_inwards_and_others_stay() {
        let scene = wall();
        let ray = Ray::new(Vec3A::new(1.0, 0.0, 5.0), Vec3A::NEG_Z);
        let moved = |barycentrics| {
            let hit = Hit { t: 5.0, primitive: 0, barycentrics, media: ray.media };
            let shading = Shading::new(&scene, scene.surface(&ray, &hit), ray.direction);
            let after = off_seams(&scene, shading, &ray, &hit, 0.01);
            (shading.surface.p, after.surface.p)
        };
        let (before, after) = moved(Vec2::new(0.25, 0.0));
        assert_eq!(before.y, 0.0, "in the plane of the floor");
        assert!(after.y > 1e-4 && after.distance(before) < 0.005 && after.z == 0.0, "in the wall: {after}");
        let (before, after) = moved(Vec2::new(0.25, 1e-3));
        assert_eq!(before, after, "not in the seam");
    }
}
