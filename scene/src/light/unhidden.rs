//! Lights that nothing hides: their irradiance, and the outline at which a shaft ends.

use glam::{Vec3, Vec3A};

use super::{Light, Lights};
use crate::PunctualLight;
use crate::shaft::Outline;

impl Lights {
    /// Returns the irradiance of a surface at `p` with the unit normal `n` by a flat lamp of which nothing is hidden,
    /// W m^-2, in closed form.
    ///
    /// `None` where the lamp is not above the horizon of `n` as a whole, seen from behind or too small for a sum over
    /// its edges, and of lights that have no such form: lamps with pictures, free forms, surroundings, and those
    /// without extent.
    ///
    /// # Panics
    /// If there is no such light.
    ///
    /// # Example
    ///
    /// ```
    /// use scene::glam::{Vec3, Vec3A};
    /// use scene::{Description, Material, Mesh, Scene};
    ///
    /// // 2 m x 2 m, 1 m above the origin.
    /// let lamp = Mesh {
    ///     positions: [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)].map(|(x, y)| Vec3::new(x, y, 1.0)).to_vec(),
    ///     triangles: vec![[0, 1, 2], [0, 2, 3]],
    ///     materials: vec![0; 2],
    ///     ..Mesh::default()
    /// };
    /// let white = Material { emission: Vec3::ONE, ..Material::default() };
    /// let scene = Scene::new(Description { meshes: vec![lamp], materials: vec![white], ..Description::default() })?;
    /// let irradiance = scene.lights().irradiance(0, Vec3A::ZERO, Vec3A::Z).expect("all of it is above");
    /// // Howell's configuration factor of it is 0.5541.
    /// assert!((irradiance.x / std::f32::consts::PI - 0.5541).abs() < 1e-4);
    /// assert_eq!(scene.lights().irradiance(0, Vec3A::ZERO, Vec3A::X), None);
    /// # Ok::<(), scene::BuildError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn irradiance(&self, light: usize, p: Vec3A, n: Vec3A) -> Option<Vec3> {
        match self.light(light) {
            Light::Rectangle(light) => light.irradiance(p, n),
            Light::Triangle(light) => light.irradiance(p, n),
            Light::Form(_) | Light::Punctual(_) | Light::Environment(_) => None,
        }
    }

    /// Returns where a light is, for a shaft to end there; `None` of a free form and of surroundings.
    pub(crate) fn outline(&self, light: usize) -> Option<Outline> {
        Some(match self.light(light) {
            Light::Rectangle(light) => Outline::Flat(light.normal(), light.corners().into()),
            Light::Triangle(light) => Outline::Flat(light.normal, light.corners.into_iter().map(Vec3A::from).collect()),
            Light::Punctual(PunctualLight::Point { position, .. }) => Outline::Point((*position).into()),
            Light::Punctual(PunctualLight::Directional { direction, .. }) => {
                Outline::Direction(-Vec3A::from(*direction))
            }
            Light::Form(_) | Light::Environment(_) => return None,
        })
    }
}
