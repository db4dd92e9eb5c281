//! What samples of lights say, measured.

use std::f32::consts::PI;

use glam::{DVec3, Vec2, Vec3, Vec3A};
use scene::freeform::{FreeForm, Quadric, Solid};
use scene::{Description, FormObject, Lights, Material, Mesh, Ray, Scene};

/// A stream of numbers in [0, 1) (PCG).
pub(crate) struct Random(pub(crate) u32);

impl Random {
    pub(crate) fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let word = ((self.0 >> ((self.0 >> 28) + 4)) ^ self.0).wrapping_mul(277_803_737);
        (((word >> 22) ^ word) >> 8) as f32 / 16_777_216.0
    }

    pub(crate) fn pair(&mut self) -> Vec2 {
        Vec2::new(self.next(), self.next())
    }

    pub(crate) fn direction(&mut self) -> Vec3A {
        self.direction_in_cone(2.0)
    }

    /// A direction that is uniform over a cone around z, `depth` being 1 less the cosine of its half-angle.
    pub(crate) fn direction_in_cone(&mut self, depth: f32) -> Vec3A {
        let z = 1.0 - depth * self.next();
        let (sin, cos) = (2.0 * PI * self.next()).sin_cos();
        let r = (1.0 - z * z).max(0.0).sqrt();
        Vec3A::new(r * cos, r * sin, z)
    }
}

pub(crate) fn emitter(radiance: f32) -> Material {
    Material { diffuse: Vec3::ZERO, emission: Vec3::splat(radiance), ..Material::default() }
}

pub(crate) fn ball(centre: DVec3, radius: f64) -> Solid {
    FreeForm::new(Quadric::sphere(centre, radius).expect("a sphere"), vec![]).expect("a form").into()
}

/// A solid where it stands.
pub(crate) fn form(solid: Solid, material: u32) -> FormObject {
    FormObject { name: String::new(), solid, material, projection: None, copies: vec![] }
}

/// A scene of a polygon, split into a fan, that shines with radiance 1 to the side of which its corners are
/// counter-clockwise.
pub(crate) fn polygon_light(corners: &[Vec3]) -> Scene {
    let triangles: Vec<[u32; 3]> = (2u32..).take(corners.len() - 2).map(|i| [0, i - 1, i]).collect();
    let materials = vec![0; triangles.len()];
    let mesh = Mesh { positions: corners.to_vec(), triangles, materials, ..Mesh::default() };
    Scene::new(Description { meshes: vec![mesh], materials: vec![emitter(1.0)], ..Description::default() })
        .expect("a right scene")
}

/// Mean and relative deviation of the irradiance that samples of the lights give at `p`.
pub(crate) fn irradiance(lights: &Lights, p: Vec3A, n: Vec3A, count: u32) -> (f64, f64) {
    let mut random = Random(1);
    let (mut sum, mut sum_sq) = (0.0, 0.0);
    let mut seen = lights.seen_from(p, n);
    for _ in 0..count {
        let (u_choice, u) = (random.next(), random.pair());
        let sample = lights.sample(p, n, u_choice, u);
        assert_eq!(seen.sample(u_choice, u), sample, "the same light as before or another one");
        let Some(s) = sample else { continue };
        if let Some((axis, half_angle)) = lights.cone(p) {
            let angle = axis.as_dvec3().angle_between(s.wi.as_dvec3());
            assert!(angle < f64::from(half_angle) + 1e-3, "{} is out of the cone of all lights, {half_angle}", s.wi);
        }
        let e = f64::from(s.radiance.x * n.dot(s.wi).max(0.0) / s.pdf);
        sum += e;
        sum_sq += e * e;
    }
    let mean = sum / f64::from(count);
    (mean, (sum_sq / f64::from(count) - mean * mean).max(0.0).sqrt() / mean)
}

/// Asserts the irradiance within five standard errors, and that these are small.
pub(crate) fn assert_irradiance(lights: &Lights, n: Vec3A, expected: f64, most_deviation: f64, what: &str) {
    const COUNT: u32 = 100_000;
    let (mean, deviation) = irradiance(lights, Vec3A::ZERO, n, COUNT);
    let error = deviation * mean / f64::from(COUNT).sqrt();
    assert!((mean - expected).abs() < 5.0 * error + 1e-5 * expected, "{what}: {mean} +- {error} is not {expected}");
    assert!(deviation < most_deviation, "{what}: the relative deviation is {deviation}");
}

/// Asserts that the density integrates to 1 over a cone that holds all lights, and that `sample` and rays that come by
/// chance agree upon it.
pub(crate) fn assert_densities_agree(scene: &Scene, depth: f32) {
    let p = Vec3A::ZERO;
    let lights = scene.lights();
    let mut random = Random(5);
    let (mut integral, mut sum_sq) = (0.0, 0.0);
    let count = 400_000;
    for _ in 0..count {
        let wi = random.direction_in_cone(depth);
        let ray = Ray::new(p, wi);
        let pdf = f64::from(match scene.intersect(&ray) {
            Some(hit) => lights.pdf_surface(p, wi, &scene.surface(&ray, &hit)),
            None => lights.pdf_environment(p, wi),
        });
        let share = pdf * f64::from(2.0 * PI * depth) / f64::from(count);
        integral += share;
        sum_sq += share * share;
    }
    // Five standard errors.
    assert!((integral - 1.0).abs() < 5.0 * sum_sq.sqrt() + 1e-3, "the density's integral is {integral}");
    assert!(sum_sq.sqrt() < 2e-2, "so many rays say something");
    let mut met = 0;
    for _ in 0..2000 {
        let (u_choice, u) = (random.next(), random.pair());
        let Some(s) = [Vec3A::Z, -Vec3A::Z].iter().find_map(|&n| lights.sample(p, n, u_choice, u)) else { continue };
        let ray = Ray::new(p, s.wi);
        let (pdf, radiance) = match scene.intersect(&ray) {
            Some(hit) => {
                let surface = scene.surface(&ray, &hit);
                assert!((surface.t - s.distance).abs() < 1e-4 * s.distance, "the distance is that to the light");
                (lights.pdf_surface(p, s.wi, &surface), scene.emission(&surface))
            }
            None => (lights.pdf_environment(p, s.wi), scene.background(s.wi)),
        };
        // A ray to the very edge may miss.
        if pdf > 0.0 {
            met += 1;
            assert!((pdf - s.pdf).abs() < 1e-3 * s.pdf, "{pdf} is not {}", s.pdf);
            assert!(
                (radiance - s.radiance).abs().max_element() <= 1e-4 * s.radiance.max_element(),
                "radiance is that of the light"
            );
        }
    }
    assert!(met > 1900, "samples meet their light: {met}");
}

/// Whether a ray starts somewhere and has a unit direction, as that of a photon must.
pub(crate) fn is_normal(ray: &Ray) -> bool {
    ray.origin.is_finite() && (ray.direction.length() - 1.0).abs() < 1e-5
}
