//! Scenes with closed forms, and the test by which an unbiased estimate is compared with one.

#![allow(dead_code, unreachable_pub, reason = "each test file includes this module and uses its part")]

use freeform::{FreeForm, Quadric, Solid};
use glam::{DVec3, Vec3, Vec3A};
use integrator::{PathTracer, Sampler, Terms, hash_pair};
use scene::{Camera, Description, Environment, Material, Mesh, PunctualLight, Ray, Scene, SpecularKind};

/// Independent estimates in a test.
pub const SEEDS: u64 = 32;

/// A black, opaque, dark material.
pub fn black() -> Material {
    lambert(0.0)
}

/// A grey Lambert surface.
pub fn lambert(albedo: f32) -> Material {
    Material { diffuse: Vec3::splat(albedo), ..Material::default() }
}

/// A surface that reflects nothing and shines from its front.
pub fn lamp(radiance: f32) -> Material {
    Material { emission: Vec3::splat(radiance), ..black() }
}

/// A perfect mirror.
pub fn mirror(reflectance: f32) -> Material {
    Material { specular: SpecularKind::Mirror { reflectance: Vec3::splat(reflectance) }, ..black() }
}

/// Clear glass.
pub fn glass(ior: f32) -> Material {
    Material {
        specular: SpecularKind::Dielectric { ior, tint: Vec3::ONE, absorption: Vec3::ZERO, priority: 0 },
        ..black()
    }
}

/// A description under construction: each piece of geometry brings its material.
#[derive(Default)]
pub struct Builder {
    description: Description,
}

impl Builder {
    /// Adds a convex polygon; counter-clockwise is the front.
    pub fn polygon(mut self, corners: &[Vec3], material: Material) -> Self {
        let index = self.material(material);
        let count = u32::try_from(corners.len()).expect("a few corners");
        let triangles: Vec<_> = (1..count - 1).map(|i| [0, i, i + 1]).collect();
        let materials = vec![index; triangles.len()];
        self.description.meshes.push(Mesh { positions: corners.to_vec(), triangles, materials, ..Mesh::default() });
        self
    }

    /// Adds a square of half width `half` around `centre` whose front looks along `normal`.
    pub fn square(self, centre: Vec3, normal: Vec3, half: f32, material: Material) -> Self {
        let frame = hemimap::Frame::from_normal(normal.normalize().into());
        let (s, t) = (Vec3::from(frame.s) * half, Vec3::from(frame.t) * half);
        self.polygon(&[centre - s - t, centre + s - t, centre + s + t, centre - s + t], material)
    }

    /// Adds the inside of the cube [-1, 1]^3.
    pub fn cube_room(mut self, material: &Material) -> Self {
        for normal in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
            self = self.square(-normal, normal, 1.0, material.clone());
        }
        self
    }

    /// Adds a free form: the ball of radius 1 about the origin, or all but it.
    pub fn unit_ball(self, hollow: bool, material: Material) -> Self {
        let ball = Quadric::sphere(DVec3::ZERO, 1.0).expect("a sphere");
        self.form(if hollow { ball.complement() } else { ball }, material)
    }

    /// Adds a ball as a free form.
    pub fn ball(self, centre: Vec3, radius: f64, material: Material) -> Self {
        self.form(Quadric::sphere(centre.as_dvec3(), radius).expect("a sphere"), material)
    }

    fn form(mut self, base: Quadric, material: Material) -> Self {
        let solid = Solid::from(FreeForm::new(base, Vec::new()).expect("a form"));
        let material = self.material(material);
        self.description.forms.push(scene::FormObject {
            name: String::new(),
            solid,
            material,
            projection: None,
            copies: vec![],
        });
        self
    }

    pub fn point_light(mut self, position: Vec3, intensity: f32) -> Self {
        let intensity = Vec3::splat(intensity);
        self.description.lights.push(PunctualLight::Point { position, intensity });
        self
    }

    pub fn directional_light(mut self, direction: Vec3, irradiance: f32) -> Self {
        let irradiance = Vec3::splat(irradiance);
        self.description.lights.push(PunctualLight::Directional { direction, irradiance });
        self
    }

    pub fn sky(mut self, radiance: f32) -> Self {
        self.description.environment = Some(Environment::constant(Vec3::splat(radiance)));
        self
    }

    pub fn camera(mut self, eye: Vec3, at: Vec3, up: Vec3, fov_y_degrees: f32) -> Self {
        self.description.camera = Some(Camera { eye, at, up, fov_y_degrees });
        self
    }

    pub fn build(self) -> Scene {
        Scene::new(self.description).expect("a valid scene")
    }

    fn material(&mut self, material: Material) -> u32 {
        self.description.materials.push(material);
        u32::try_from(self.description.materials.len() - 1).expect("a few materials")
    }
}

/// Asserts that estimates of independent seeds have the mean `oracle`.
///
/// Limit 4.5 standard errors from the spread over the seeds (t with 31 degrees: p = 9e-5), which must be at most
/// `precision` of the oracle, or the test would say nothing.
pub fn assert_unbiased(estimates: &[f64], oracle: f64, precision: f64, what: &str) {
    let n = estimates.len() as f64;
    let mean = estimates.iter().sum::<f64>() / n;
    let variance = estimates.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    // Estimates without any noise are still rounded to f32 in their parts.
    let error = (variance / n).sqrt().max(1e-6 * oracle.abs());
    assert!(error <= precision * oracle.abs(), "{what}: standard error {error} of {mean} is too large to say anything");
    assert!((mean - oracle).abs() <= 4.5 * error, "{what}: {mean} instead of {oracle}, standard error {error}");
}

/// The first channel of each term and of the sum, as the path tracer estimates them for a ray: one mean of `samples`
/// for each seed.
pub struct Estimates {
    pub emitted: Vec<f64>,
    pub direct: Vec<f64>,
    pub specular: Vec<f64>,
    pub caustic: Vec<f64>,
    pub indirect: Vec<f64>,
    pub sum: Vec<f64>,
}

pub fn estimate(scene: &Scene, origin: Vec3A, direction: Vec3A, samples: u32) -> Estimates {
    let ray = Ray::new(origin, direction.normalize());
    let means: Vec<Vec<f64>> = (0..SEEDS)
        .map(|seed| {
            let mut tracer = PathTracer::new(scene);
            let mut sums = vec![0.0; 6];
            for sample in 0..samples {
                let mut sampler = Sampler::new(hash_pair(97, seed), 0, sample);
                let terms = tracer.trace(&ray, &mut sampler).terms;
                let Terms { emitted, direct, specular, caustic, indirect } = terms;
                for (sum, value) in sums.iter_mut().zip([emitted, direct, specular, caustic, indirect, terms.sum()]) {
                    *sum += f64::from(value.x) / f64::from(samples);
                }
            }
            assert_eq!((tracer.cut_paths, tracer.dropped_samples), (0, 0), "all samples count");
            sums
        })
        .collect();
    let column = |i: usize| means.iter().map(|sums| sums[i]).collect::<Vec<_>>();
    Estimates {
        emitted: column(0),
        direct: column(1),
        specular: column(2),
        caustic: column(3),
        indirect: column(4),
        sum: column(5),
    }
}

/// Lambert's formula: the irradiance at the origin, normal `n`, from a polygon of radiance 1 that lies wholly above the
/// horizon.
pub fn polygon_irradiance(corners: &[DVec3], n: DVec3) -> f64 {
    let edges = corners.iter().zip(corners.iter().cycle().skip(1));
    let sum: f64 = edges
        .map(|(a, b)| {
            let cross = a.cross(*b);
            let length = cross.length();
            length.atan2(a.dot(*b)) * n.dot(cross) / length
        })
        .sum();
    0.5 * sum.abs()
}
