//! One surface in one pixel, joined from its samples.

use glam::{UVec2, Vec2, Vec3, Vec3A};
use scene::{Hit, Ray, Scene, Surface};

use crate::secondary::{Secondary, Shading};
use crate::terms::direct_fit::Lit;

/// A distinct surface in a pixel: that of its samples which is nearest to the middle of the pixel stands for all.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SurfacePoint {
    /// Pixel within the band.
    pub(crate) pixel: u32,
    /// The pixel in the picture.
    pub(crate) position: UVec2,
    /// Names the point to the generators of random numbers.
    pub(crate) key: u64,
    /// The sequence of mirrors and glass before it: 0 for what is seen directly.
    pub(crate) chain: u64,
    /// The sample that stands for the others.
    pub(crate) shading: Shading,
    /// Distance of that sample from the middle of the pixel, in pixels, by squares.
    pub(crate) off_middle: f32,
    /// Width of the pixel at the surface, metres.
    pub(crate) footprint: f32,
    /// Sum over the pixel's samples of throughput times albedo.
    pub(crate) diffuse_weight: Vec3,
    /// Sum of throughput, for the glossy part.
    pub(crate) specular_weight: Vec3,
    /// The same of the samples whose lobes are shared.
    pub(crate) lobe_weight: Vec3,
    /// Its direct light.
    pub(crate) lit: Lit,
    /// Irradiance by caustics.
    pub(crate) caustics: CausticLooks,
    /// Where the samples lie.
    pub(crate) spread: Spread,
}

/// Irradiance by caustics at some of the samples of a point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CausticLooks {
    /// Sum over these samples, times the coverage around them, and the sum of their places.
    sum: Vec3,
    places: Vec3A,
    sum_count: u32,
    /// The same of samples whose own coverage is known.
    covered: Vec3,
    /// Number of these samples.
    count: u32,
    /// About the least length over which they change there, metres.
    detail: f32,
}

/// How the samples of a point lie about the one that stands for them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spread {
    /// Number of samples.
    pub(crate) count: f32,
    /// Sum of how far they are off that one.
    offset: Vec3A,
    /// Sum of the squares of that.
    offset_sq: f32,
    /// Sum of how their normals differ from its.
    turn: Vec3A,
}

/// So many samples of a pixel ask for caustics for each time that it is wider than the least of the discs by which they
/// are blurred, up to a number.
const LOOKS_PER_RADIUS: f32 = 4.0;
/// A pixel is taken for no longer than its width over this cosine.
const MIN_COS: f32 = 0.1;
const MAX_LOOKS: f32 = 8.0;
/// Samples whose normals differ by more are different surfaces.
pub(crate) const MIN_NORMAL_COS: f32 = 0.95;
/// Samples farther from the plane of a surface than this share of its distance from the eye are different surfaces.
const PLANE_TOLERANCE: f32 = 0.01;

impl SurfacePoint {
    /// The mean place and normal of the samples. The place may lie off the surface, so no ray may start there, but what
    /// light there is at a small distance from a point, a record knows.
    pub(crate) fn middle(&self) -> (Vec3A, Vec3A) {
        let (surface, spread) = (&self.shading.surface, &self.spread);
        let n = if self.is_flat() { surface.n } else { (surface.n + spread.turn / spread.count).normalize() };
        (surface.p + spread.offset / spread.count, n)
    }

    fn is_flat(&self) -> bool {
        self.spread.turn == Vec3A::ZERO
    }

    /// The light by caustics, beside all `other` light.
    pub(crate) fn caustic(&self, secondary: &impl Secondary, other: Vec3) -> Vec3 {
        /// Share of the other light from which on one sees how exact it is.
        const VISIBLE: f32 = 0.1;
        let uncovered = self.diffuse_weight * self.caustics.radiance(|_| 1.0);
        let precise = uncovered.max_element() > VISIBLE * other.max_element();
        let coverage = |middle| {
            let surface = self.shading.surface;
            // On what is curved the middle lies off the surface.
            let p = if self.is_flat() { middle } else { surface.p };
            secondary.caustic_coverage(&Surface { p, ..surface }, precise)
        };
        self.diffuse_weight * self.caustics.radiance(coverage)
    }

    /// The distance of the ends of the point from its middle, metres: half the length over which its samples lie, if
    /// they lie evenly along a line.
    pub(crate) fn half_length(&self) -> f32 {
        let Spread { count, offset, offset_sq, .. } = self.spread;
        let variance = (offset_sq - offset.length_squared() / count) / count;
        (3.0 * variance.max(0.0)).sqrt()
    }

    /// Asks for caustics where one of the samples lies, unless there are enough: as many as are needed where the
    /// samples lie so far apart.
    pub(super) fn look_for_caustics(&mut self, secondary: &impl Secondary, surface: &Surface) {
        let is_first = self.caustics.count == 0;
        // Waves may spread a pixel over more than its width.
        let width = self.footprint.max(2.0 * self.half_length());
        let wanted = LOOKS_PER_RADIUS * width / self.caustics.detail;
        if !is_first && self.caustics.count as f32 >= wanted.clamp(1.0, MAX_LOOKS) {
            return;
        }
        // By all that a pixel may see, as long as it lies on the surface, or the number would depend on what was found,
        // and means be wrong.
        let reach = if is_first { self.footprint / self.shading.wo.z.max(MIN_COS) } else { 0.0 };
        // Where they are as fine, there are as many as ever; a pixel that is wide beside them would see thousands of
        // photons.
        let fine = self.footprint * (LOOKS_PER_RADIUS / MAX_LOOKS);
        let found = secondary.covered_caustic_irradiance(surface, reach, fine);
        if self.footprint > found.radius && found.irradiance != Vec3::ZERO {
            // The edges of what photons lie on are within the pixel, not around all of it.
            self.caustics.covered += found.irradiance / secondary.caustic_coverage(surface, false);
        } else {
            self.caustics.sum += found.irradiance;
            self.caustics.places += surface.p;
            self.caustics.sum_count += 1;
        }
        self.caustics.count += 1;
        let detail = if found.radius > fine { found.radius } else { 0.0 };
        self.caustics.detail = self.caustics.detail.min(detail);
    }

    /// Adds a sample to the point of its surface, which is seen `length` metres away, or starts one; returns it.
    pub(super) fn add_to(self, points: &mut Vec<Self>, length: f32) -> &mut Self {
        // Where a picture is black there is no diffuse part, which decides what becomes of gloss, or no gloss, of which
        // one sample then speaks for all: such samples go ways of their own.
        let same = points.iter().position(|other| {
            other.chain == self.chain
                && other.shading.bsdf.has_diffuse() == self.shading.bsdf.has_diffuse()
                && other.shading.bsdf.has_glossy() == self.shading.bsdf.has_glossy()
                && same_surface(&other.shading.surface, &self.shading.surface, length)
        });
        let number = same.unwrap_or(points.len());
        if same.is_some() {
            points[number].join(&self);
        } else {
            if points.is_empty() {
                // Most pixels show one surface. A list that grows by itself starts with four places, which would be
                // half of all memory.
                points.reserve_exact(1);
            }
            points.push(self);
        }
        &mut points[number]
    }

    /// Joins a sample of the same surface.
    fn join(&mut self, sample: &Self) {
        self.diffuse_weight += sample.diffuse_weight;
        self.specular_weight += sample.specular_weight;
        self.lobe_weight += sample.lobe_weight;
        self.lit.join(&sample.lit);
        let (stands, joins) = (&self.shading.surface, &sample.shading.surface);
        let (offset, turn) = (joins.p - stands.p, joins.n - stands.n);
        self.spread.add(offset, turn);
        if sample.off_middle < self.off_middle {
            self.spread.refer_to(offset, turn);
            (self.shading, self.footprint, self.off_middle) = (sample.shading, sample.footprint, sample.off_middle);
        }
    }
}

impl CausticLooks {
    /// Returns the mean radiance that they give a white surface, W m^-2 sr^-1. `coverage` tells of a place on what share
    /// of the discs that were searched photons can be; it is asked where it matters, of the middle of the samples:
    /// beside an edge it changes within a pixel.
    fn radiance(&self, coverage: impl FnOnce(Vec3A) -> f32) -> Vec3 {
        if self.count == 0 {
            return Vec3::ZERO;
        }
        let middle = self.places / self.sum_count as f32;
        let sum = if self.sum == Vec3::ZERO { Vec3::ZERO } else { self.sum / coverage(middle) };
        (sum + self.covered) * (std::f32::consts::FRAC_1_PI / self.count as f32)
    }
}

impl Default for CausticLooks {
    /// None asked yet.
    fn default() -> Self {
        let (sum, places) = (Vec3::ZERO, Vec3A::ZERO);
        Self { sum, places, sum_count: 0, covered: Vec3::ZERO, count: 0, detail: f32::INFINITY }
    }
}

impl Spread {
    /// Adds a sample.
    fn add(&mut self, offset: Vec3A, turn: Vec3A) {
        self.count += 1.0;
        self.offset += offset;
        self.offset_sq += offset.length_squared();
        self.turn += turn;
    }

    /// Lets another sample, `offset` away and with a normal that differs by `turn`, stand for all.
    fn refer_to(&mut self, offset: Vec3A, turn: Vec3A) {
        self.offset_sq += offset.length_squared() * self.count - 2.0 * offset.dot(self.offset);
        self.offset -= offset * self.count;
        self.turn -= turn * self.count;
    }
}

impl Default for Spread {
    /// One sample.
    fn default() -> Self {
        Self { count: 1.0, offset: Vec3A::ZERO, offset_sq: 0.0, turn: Vec3A::ZERO }
    }
}

/// Moves a point that lies on an edge of its triangle, inwards by less than a pixel: from a seam rays slip through the
/// neighbour and see what is behind, and whoever takes light from there would be misled.
pub(super) fn off_seams(scene: &Scene, shading: Shading, ray: &Ray, hit: &Hit, footprint: f32) -> Shading {
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

/// Whether two places that are seen `length` metres away are of one surface: like normals, and each near the plane of
/// the other.
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

    /// One sample of the wall, seen straight on.
    fn sample(scene: &Scene, x: f32, off_middle: f32) -> SurfacePoint {
        sample_along(scene, x, off_middle, Vec3A::NEG_Z)
    }

    /// One seen along this direction.
    fn sample_along(scene: &Scene, x: f32, off_middle: f32, direction: Vec3A) -> SurfacePoint {
        let ray = Ray::new(Vec3A::new(x, 0.5, 0.0) - direction, direction);
        let surface = scene.surface(&ray, &scene.intersect(&ray).unwrap());
        SurfacePoint {
            pixel: 0,
            position: UVec2::ZERO,
            key: 0,
            chain: 0,
            shading: Shading::new(scene, surface, ray.direction),
            off_middle,
            footprint: 0.01,
            diffuse_weight: Vec3::ONE,
            specular_weight: Vec3::ONE,
            lobe_weight: Vec3::ZERO,
            lit: Lit::default(),
            caustics: CausticLooks::default(),
            spread: Spread::default(),
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

        fn covered_caustic_irradiance(&self, surface: &Surface, reach: f32, _: f32) -> crate::Irradiance {
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
            assert_eq!(point.caustics.count, expected, "{spread} wide, {detail}");
            let mean = point.caustics.radiance(|_| 1.0).x * std::f32::consts::PI;
            assert!((1.0..=1.0 + spread).contains(&mean), "a mean of places: {mean}");
        }
    }

    /// A line of 2 cm in each 25 cm, and blur of 2 mm in its edges.
    struct Lines;

    impl Secondary for Lines {
        fn irradiance(&self, _: &Surface) -> Option<crate::Known> {
            None
        }

        fn caustic_irradiance(&self, surface: &Surface) -> Vec3 {
            Vec3::splat(if surface.p.x.rem_euclid(0.25) < 0.02 { 1.0 } else { 0.0 })
        }

        fn covered_caustic_irradiance(&self, surface: &Surface, reach: f32, _: f32) -> crate::Irradiance {
            let x = surface.p.x.rem_euclid(0.25);
            let radius = if x < 0.02 + reach || x > 0.25 - reach { 0.002 } else { f32::INFINITY };
            crate::Irradiance { irradiance: self.caustic_irradiance(surface), radius }
        }
    }

    #[test]
    fn caustics_on_pixels_that_are_long_keep_their_light() {
        // Pixels of 1 cm, seen at so flat an angle that they are 6 cm long.
        let scene = wall();
        let direction = Vec3A::new((1.0f32 - 1.0 / 36.0).sqrt(), 0.0, -1.0 / 6.0);
        let (mut rng, mut sum) = (crate::Rng::new(1, 0), 0.0);
        const PIXELS: u16 = 2000;
        for _ in 0..PIXELS {
            let start = 0.5 + rng.next_1d();
            let mut place = || sample_along(&scene, start + 0.06 * rng.next_1d(), 0.0, direction);
            let mut point = place();
            let surface = point.shading.surface;
            point.look_for_caustics(&Lines, &surface);
            for next in (0..15).map(|_| place()) {
                point.join(&next);
                point.look_for_caustics(&Lines, &next.shading.surface);
            }
            sum += point.caustics.radiance(|_| 1.0).x * std::f32::consts::PI;
        }
        let mean = sum / f32::from(PIXELS);
        // 8 places of each pixel: a standard error of 0.004.
        assert!((mean - 0.08).abs() < 0.012, "{mean}");
    }

    #[test]
    fn samples_with_gloss_and_without_make_two_points() {
        let scene = wall();
        let bare = sample(&scene, 1.0, 0.0);
        let mut glossy = sample(&scene, 1.001, 0.0);
        glossy.shading.bsdf.specular = scene::Specular::Ggx { alpha: 0.2, reflectance: Vec3::ONE, schlick: false };
        let mut points = Vec::new();
        for point in [bare, glossy, sample(&scene, 1.002, 0.0)] {
            point.add_to(&mut points, 5.0);
        }
        assert_eq!(points.len(), 2, "what one sample says of gloss would be said of all");
        assert_eq!(points.iter().filter(|point| point.shading.bsdf.has_glossy()).count(), 1);
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
