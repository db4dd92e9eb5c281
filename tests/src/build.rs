//! Scenes in a few lines: each piece of geometry brings its material.

use freeform::{FreeForm, Quadric, Solid};
use glam::{DVec3, Vec3};
use scene::{Camera, Description, Environment, FormObject, Material, Mesh, PunctualLight, Scene, SpecularKind};

/// Returns a grey Lambert surface.
#[must_use]
pub fn lambert(albedo: f32) -> Material {
    Material { diffuse: Vec3::splat(albedo), ..Material::default() }
}

/// Returns a surface that neither reflects nor shines.
#[must_use]
pub fn black() -> Material {
    lambert(0.0)
}

/// Returns a black surface whose front gives off `radiance`, W m^-2 sr^-1.
#[must_use]
pub fn lamp(radiance: f32) -> Material {
    Material { emission: Vec3::splat(radiance), ..black() }
}

/// Returns a perfect mirror.
#[must_use]
pub fn mirror(reflectance: f32) -> Material {
    Material { specular: SpecularKind::Mirror { reflectance: Vec3::splat(reflectance) }, ..black() }
}

/// Returns a GGX lobe without Fresnel term over black.
#[must_use]
pub fn gloss(alpha: f32, reflectance: f32) -> Material {
    let reflectance = Vec3::splat(reflectance);
    Material { specular: SpecularKind::Ggx { alpha, reflectance, schlick: false }, ..black() }
}

/// Returns smooth glass that absorbs `absorption` a metre.
#[must_use]
pub fn glass(ior: f32, absorption: f32) -> Material {
    glass_before(ior, absorption, 0)
}

/// Returns the same with a priority.
#[must_use]
pub fn glass_before(ior: f32, absorption: f32, priority: i32) -> Material {
    let absorption = Vec3::splat(absorption);
    Material { specular: SpecularKind::Dielectric { ior, tint: Vec3::ONE, absorption, priority }, ..black() }
}

/// A description under construction.
#[derive(Debug, Clone, Default)]
pub struct Builder {
    /// What was built so far.
    pub description: Description,
}

impl Builder {
    /// Adds a convex polygon; counter-clockwise is the front.
    ///
    /// # Panics
    /// If there are more than 2^32 corners.
    #[must_use]
    pub fn polygon(self, corners: &[Vec3], material: Material) -> Self {
        let count = u32::try_from(corners.len()).expect("a few corners");
        let triangles = (1..count - 1).map(|i| [0, i, i + 1]).collect();
        self.mesh((corners.to_vec(), triangles), material)
    }

    /// Adds a square of half width `half` around `centre` whose front looks along `normal`.
    #[must_use]
    pub fn square(self, centre: Vec3, normal: Vec3, half: f32, material: Material) -> Self {
        let frame = hemimap::Frame::from_normal(normal.normalize().into());
        let (s, t) = (Vec3::from(frame.s) * half, Vec3::from(frame.t) * half);
        self.polygon(&[centre - s - t, centre + s - t, centre + s + t, centre - s + t], material)
    }

    /// Adds the inside of the cube [-1, 1]^3.
    #[must_use]
    pub fn cube_room(mut self, material: &Material) -> Self {
        for normal in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
            self = self.square(-normal, normal, 1.0, material.clone());
        }
        self
    }

    /// Adds triangles: positions, and three indices into them each.
    #[must_use]
    pub fn mesh(mut self, (positions, triangles): (Vec<Vec3>, Vec<[u32; 3]>), material: Material) -> Self {
        let materials = vec![self.material(material); triangles.len()];
        self.description.meshes.push(Mesh { positions, triangles, materials, ..Mesh::default() });
        self
    }

    /// Adds a ball as a free form.
    ///
    /// # Panics
    /// If `radius` is not positive and finite.
    #[must_use]
    pub fn ball(self, centre: Vec3, radius: f64, material: Material) -> Self {
        self.form(Quadric::sphere(centre.as_dvec3(), radius).expect("a sphere"), material)
    }

    /// Adds a room that is all but a ball of radius 1 about the origin, as a free form.
    ///
    /// # Panics
    /// Never.
    #[must_use]
    pub fn ball_room(self, material: Material) -> Self {
        self.form(Quadric::sphere(DVec3::ZERO, 1.0).expect("a sphere").complement(), material)
    }

    fn form(self, base: Quadric, material: Material) -> Self {
        self.solid(FreeForm::new(base, Vec::new()).expect("a form without perturbations").into(), material)
    }

    /// Adds a solid as a free form.
    #[must_use]
    pub fn solid(mut self, solid: Solid, material: Material) -> Self {
        let material = self.material(material);
        self.description.forms.push(FormObject {
            name: String::new(),
            solid,
            material,
            projection: None,
            copies: vec![],
        });
        self
    }

    /// Adds a point light of `intensity` W sr^-1.
    #[must_use]
    pub fn point_light(mut self, position: Vec3, intensity: f32) -> Self {
        let intensity = Vec3::splat(intensity);
        self.description.lights.push(PunctualLight::Point { position, intensity });
        self
    }

    /// Adds parallel light that travels along `direction`, of normal irradiance `irradiance` W m^-2.
    #[must_use]
    pub fn sun(mut self, direction: Vec3, irradiance: f32) -> Self {
        let irradiance = Vec3::splat(irradiance);
        self.description.lights.push(PunctualLight::Directional { direction, irradiance });
        self
    }

    /// Surrounds all with a constant radiance.
    #[must_use]
    pub fn sky(mut self, radiance: f32) -> Self {
        self.description.environment = Some(Environment::constant(Vec3::splat(radiance)));
        self
    }

    /// Looks from `eye` to `at`; `fov` is the vertical angle in degrees.
    #[must_use]
    pub fn view(mut self, eye: Vec3, at: Vec3, fov: f32) -> Self {
        let forward = (at - eye).normalize();
        let up = if forward.z.abs() < 0.9 { Vec3::Z } else { Vec3::Y };
        self.description.camera = Some(Camera { eye, at, up, fov_y_degrees: fov });
        self
    }

    /// Builds the scene.
    ///
    /// # Panics
    /// If the description is not valid.
    #[must_use]
    pub fn build(self) -> Scene {
        Scene::new(self.description).expect("a valid scene")
    }

    fn material(&mut self, material: Material) -> u32 {
        self.description.materials.push(material);
        u32::try_from(self.description.materials.len() - 1).expect("a few materials")
    }
}
