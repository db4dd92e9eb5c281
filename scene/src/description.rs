//! What a scene holds before it is built: plain data, as the readers give it and as a caller may write it.
//!
//! Everything is public and nothing is checked here; [`Scene::new`](crate::Scene::new) checks every number and index
//! once.

use freeform::Solid;
use glam::{DAffine3, Vec2, Vec3};

use crate::form::Form;
use crate::{Aabb, Camera, Environment, Noise, Projection, Texture};

/// A whole scene as data: indices in `meshes` and `forms` point into `materials`, those in `materials` into `textures`.
#[derive(Debug, Clone, Default)]
pub struct Description {
    /// Triangle meshes.
    pub meshes: Vec<Mesh>,
    /// Free forms.
    pub forms: Vec<FormObject>,
    /// Materials, referred to by index.
    pub materials: Vec<Material>,
    /// Textures, referred to by index from materials.
    pub textures: Vec<Texture>,
    /// Point and directional lights; triangles whose material emits are lights of their own.
    pub lights: Vec<PunctualLight>,
    /// The surroundings at infinity; black where there are none.
    pub environment: Option<Environment>,
    /// The camera; the whole scene is framed where there is none.
    pub camera: Option<Camera>,
}

impl Description {
    /// Returns the box around all that has an end, as [`Scene::bounds`](crate::Scene::bounds); empty where nothing has.
    /// Triangles of zero area do not count.
    ///
    /// ```
    /// use scene::{Description, Mesh, glam::Vec3};
    ///
    /// let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    /// let mesh = Mesh { positions, triangles: vec![[0, 1, 2]], materials: vec![0], ..Mesh::default() };
    /// let bounds = Description { meshes: vec![mesh], ..Description::default() }.bounds();
    /// assert_eq!((bounds.min, bounds.max), (Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0)));
    /// assert!(Description::default().bounds().is_empty());
    /// ```
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        let triangle = |mesh: &Mesh, indices: [u32; 3]| {
            let [a, b, c] = indices.map(|index| mesh.positions.get(index as usize).copied());
            let corners = [a?, b?, c?];
            let [a, b, c] = corners.map(|p| p.as_dvec3());
            ((b - a).cross(c - a).length_squared() > 0.0).then(|| Aabb::of_points(&corners))
        };
        let triangles = self
            .meshes
            .iter()
            .flat_map(|mesh| mesh.triangles.iter().filter_map(move |&indices| triangle(mesh, indices)));
        let forms = self.forms.iter().flat_map(Form::bounds_of).flatten();
        triangles.chain(forms).fold(Aabb::EMPTY, Aabb::union)
    }
}

/// Marks a corner of a [`Mesh`] without a normal or without texture coordinates.
pub const NO_INDEX: u32 = u32::MAX;

/// Triangles with separate index streams for positions, normals and texture coordinates, as OBJ has them.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// Name for messages.
    pub name: String,
    /// Positions in metres.
    pub positions: Vec<Vec3>,
    /// Normals, of any length but zero.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, v = 0 is the lowest row.
    pub uvs: Vec<Vec2>,
    /// Three indices into `positions` a triangle; counter-clockwise is the front.
    pub triangles: Vec<[u32; 3]>,
    /// Three indices into `normals` a triangle, [`NO_INDEX`] for a flat one. Empty, or as long as `triangles`.
    pub normal_indices: Vec<[u32; 3]>,
    /// Three indices into `uvs` a triangle, [`NO_INDEX`] for none. Empty, or as long as `triangles`.
    pub uv_indices: Vec<[u32; 3]>,
    /// The material of each triangle.
    pub materials: Vec<u32>,
}

/// A free form with its material, once or many times.
#[derive(Debug, Clone)]
pub struct FormObject {
    /// Name for messages.
    pub name: String,
    /// The body.
    pub solid: Solid,
    /// Index of its material.
    pub material: u32,
    /// How its texture coordinates are found; without it they are those of [`Solid::texture_coordinates`].
    pub projection: Option<Projection>,
    /// Where copies of it stand: each carries the solid and its projection into the world, and is not singular. They
    /// share all that is derived from the solid. Without any the solid stands once, where it is described.
    pub copies: Vec<DAffine3>,
}

/// A surface as the sum of a diffuse and a specular part (paper, eq. 5), with emission and cut-out.
#[derive(Debug, Clone)]
pub struct Material {
    /// Name for messages.
    pub name: String,
    /// Diffuse albedo, linear RGB in [0, 1], multiplied by `diffuse_texture` and `noise`.
    pub diffuse: Vec3,
    /// Index of a texture for `diffuse`.
    pub diffuse_texture: Option<u32>,
    /// Solid noise for `diffuse`.
    pub noise: Option<Noise>,
    /// The specular part.
    pub specular: SpecularKind,
    /// Index of a texture for the reflectance of gloss and mirrors.
    pub specular_texture: Option<u32>,
    /// Radiance that the front gives off, W m^-2 sr^-1; multiplied by `emission_texture`.
    pub emission: Vec3,
    /// Index of a texture for `emission`; its values may be above 1.
    pub emission_texture: Option<u32>,
    /// Share of the surface that is there, in [0, 1]; multiplied by `opacity_texture`.
    pub opacity: f32,
    /// Index of a texture (its mean of RGB, not made linear) for `opacity`.
    pub opacity_texture: Option<u32>,
}

/// The specular part of a [`Material`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SpecularKind {
    /// None: Lambert alone.
    None,
    /// A GGX lobe of width `alpha`. The diffuse part beneath is scaled by 1 - `reflectance`.
    Ggx {
        /// Microfacet width, in [1e-4, 1].
        alpha: f32,
        /// Constant factor, or reflectance at normal incidence where `schlick` is set.
        reflectance: Vec3,
        /// Whether Schlick's Fresnel term raises the reflectance at grazing angles, to what the diffuse part beneath
        /// leaves of 1.
        schlick: bool,
    },
    /// A perfect mirror.
    Mirror {
        /// Share of the light that is reflected.
        reflectance: Vec3,
    },
    /// A smooth dielectric body; `diffuse` is not used.
    Dielectric {
        /// Refractive index of the inside over that of the outside; over that of air, where priorities say that
        /// something else is outside.
        ior: f32,
        /// Factor for light that passes the surface.
        tint: Vec3,
        /// Absorption coefficient inside, per metre.
        absorption: Vec3,
        /// Which of overlapping bodies is there: the one of the highest. Where no material has another than 0, each
        /// boundary is taken for itself.
        priority: i32,
    },
}

/// A light without extent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PunctualLight {
    /// Shines from a point in all directions.
    Point {
        /// Position, metres.
        position: Vec3,
        /// Radiant intensity, W sr^-1.
        intensity: Vec3,
    },
    /// Shines from infinity.
    Directional {
        /// The direction in which the light travels, of any length but zero.
        direction: Vec3,
        /// Irradiance on a surface at right angles to it, W m^-2.
        irradiance: Vec3,
    },
}

impl Material {
    /// Whether some rays pass; a dielectric lets them pass by itself.
    pub(crate) fn is_cut_out(&self) -> bool {
        self.opacity < 1.0 || self.opacity_texture.is_some()
    }

    pub(crate) fn is_emissive(&self) -> bool {
        self.emission != Vec3::ZERO
    }

    /// Returns the indices of all its textures.
    ///
    /// ```
    /// use scene::Material;
    ///
    /// let screen = Material { emission_texture: Some(3), ..Material::default() };
    /// assert!(screen.textures().eq([3]) && Material::default().textures().next().is_none());
    /// ```
    pub fn textures(&self) -> impl Iterator<Item = u32> + use<> {
        [self.diffuse_texture, self.specular_texture, self.emission_texture, self.opacity_texture].into_iter().flatten()
    }

    /// Whether light goes on in single directions: on mirrors and glass.
    ///
    /// ```
    /// use scene::{Material, SpecularKind, glam::Vec3};
    ///
    /// let silver = SpecularKind::Mirror { reflectance: Vec3::ONE };
    /// assert!(Material { specular: silver, ..Material::default() }.has_delta());
    /// assert!(!Material::default().has_delta());
    /// ```
    #[must_use]
    pub fn has_delta(&self) -> bool {
        matches!(self.specular, SpecularKind::Mirror { .. } | SpecularKind::Dielectric { .. })
    }

    /// Whether there is a diffuse part: not on glass, nor where the specular part leaves nothing. Textures and noise do
    /// not matter, although they may be black in places; [`Bsdf::has_diffuse`](crate::Bsdf::has_diffuse) tells of one
    /// point.
    ///
    /// ```
    /// use scene::{Material, SpecularKind, glam::Vec3};
    ///
    /// let grey = Material { diffuse: Vec3::splat(0.5), ..Material::default() };
    /// assert!(grey.is_diffuse());
    /// let silver = SpecularKind::Mirror { reflectance: Vec3::ONE };
    /// assert!(!Material { specular: silver, ..grey }.is_diffuse());
    /// ```
    #[must_use]
    pub fn is_diffuse(&self) -> bool {
        match self.specular {
            SpecularKind::None => self.diffuse != Vec3::ZERO,
            SpecularKind::Ggx { .. } | SpecularKind::Mirror { .. } if self.specular_texture.is_some() => {
                self.diffuse != Vec3::ZERO
            }
            SpecularKind::Ggx { reflectance, .. } | SpecularKind::Mirror { reflectance } => {
                self.diffuse * (Vec3::ONE - reflectance) != Vec3::ZERO
            }
            SpecularKind::Dielectric { .. } => false,
        }
    }
}

impl Default for Material {
    /// Grey Lambert of albedo 0.5, opaque and dark.
    fn default() -> Self {
        Self {
            name: String::new(),
            diffuse: Vec3::splat(0.5),
            diffuse_texture: None,
            noise: None,
            specular: SpecularKind::None,
            specular_texture: None,
            emission: Vec3::ZERO,
            emission_texture: None,
            opacity: 1.0,
            opacity_texture: None,
        }
    }
}
