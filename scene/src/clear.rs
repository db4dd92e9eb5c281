//! Whether a part of a surface sees all of a light: found once, for many shadow rays that are not needed then.

use glam::{UVec2, Vec2, Vec3A};

use crate::shaft::{ROUNDING, Shaft};
use crate::{Scene, Surface};

/// A part of the plane of a surface, as the camera sees it through a rectangle of the film: [`Scene::patch`] makes it,
/// and [`Scene::is_clear`] tells whether all of it sees all of a light.
#[derive(Debug, Clone, Copy)]
pub struct Patch {
    /// A point of the plane, and its unit normal on the side of the viewer.
    pub(crate) p: Vec3A,
    pub(crate) n: Vec3A,
    /// In the plane, counter-clockwise as seen from that side.
    pub(crate) corners: [Vec3A; 4],
    /// Points of the surface may be so far off the plane, metres.
    pub(crate) tolerance: f32,
    /// What is seen through the film may be rounded by so much, metres.
    pub(crate) rounding: f32,
}

impl Patch {
    /// Returns the part of the plane of `surface` that rays from `eye` meet along these directions, which go around it;
    /// `None` where one does not meet it.
    fn new(surface: &Surface, eye: Vec3A, directions: [Vec3A; 4]) -> Option<Self> {
        /// Nearer to the horizon little is known of where they meet it.
        const MIN_COSINE: f32 = 1e-5;
        let Surface { p, ng: n, p_error, .. } = *surface;
        let depth = n.dot(p - eye);
        if depth >= 0.0 || directions.iter().any(|direction| n.dot(*direction) > -MIN_COSINE) {
            return None;
        }
        let mut corners = directions.map(|direction| {
            let corner = eye + direction * (depth / n.dot(direction));
            corner - n * n.dot(corner - p)
        });
        if (corners[2] - corners[0]).cross(corners[3] - corners[1]).dot(n) < 0.0 {
            corners.reverse();
        }
        let rounding = ROUNDING * p.abs().max(eye.abs()).max_element();
        Some(Self { p, n, corners, tolerance: 2.0 * p_error, rounding })
    }

    /// Whether a surface that was met through the same rectangle of the film lies in the plane of the patch.
    #[inline]
    #[must_use]
    pub fn holds(&self, surface: &Surface) -> bool {
        /// Least cosine between the normals.
        const SAME_NORMAL: f32 = 0.999_9;
        self.n.dot(surface.p - self.p).abs() <= self.tolerance && self.n.dot(surface.ng) >= SAME_NORMAL
    }
}

impl Scene {
    /// Returns the part of the plane of `surface`, which a ray of the camera met, that the camera would see through a
    /// rectangle of the film if nothing stood before it.
    ///
    /// `film` holds two opposite corners of the rectangle, `size` is that of the picture, both in pixels as for
    /// [`Scene::camera_ray`]. `None` of a free form, and where the plane ends at the horizon within the rectangle.
    #[inline]
    #[must_use]
    pub fn patch(&self, surface: &Surface, film: [Vec2; 2], size: UVec2) -> Option<Patch> {
        if surface.primitive as usize >= self.triangle_count() {
            return None;
        }
        let [a, b] = film;
        let corners = [a, Vec2::new(b.x, a.y), b, Vec2::new(a.x, b.y)];
        Patch::new(surface, self.camera().eye.into(), corners.map(|corner| self.camera_ray(corner, size).direction))
    }

    /// Whether nothing stands between any point of a patch and any point of a light: then [`Scene::occluded`] is false
    /// for all shadow rays from one to the other.
    ///
    /// False also where that is not known: if either does not lie in front of the other as a whole, where too much is
    /// near, and of free forms that shine and surroundings. What is no farther from the plane of the patch or from the
    /// lamp than their points are rounded hides nothing.
    ///
    /// # Panics
    /// If there is no such light.
    ///
    /// # Example
    ///
    /// ```
    /// use scene::glam::{UVec2, Vec2, Vec3};
    /// use scene::{Camera, Description, Material, Mesh, PunctualLight, Scene};
    ///
    /// // A floor of 10 m, 1 m above it a plate of 2 m, and a lamp at 3 m.
    /// let square = |half: f32, y: f32| {
    ///     [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)].map(|(x, z)| Vec3::new(half * x, y, half * z))
    /// };
    /// let mesh = Mesh {
    ///     positions: [square(5.0, 0.0), square(1.0, 1.0)].concat(),
    ///     triangles: vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
    ///     materials: vec![0; 4],
    ///     ..Mesh::default()
    /// };
    /// let lamp = PunctualLight::Point { position: Vec3::Y * 3.0, intensity: Vec3::ONE };
    /// let camera = Camera { eye: Vec3::new(8.0, 2.0, 0.0), at: Vec3::ZERO, up: Vec3::Y, fov_y_degrees: 40.0 };
    /// let scene = Scene::new(Description {
    ///     meshes: vec![mesh],
    ///     materials: vec![Material::default()],
    ///     lights: vec![lamp],
    ///     camera: Some(camera),
    ///     ..Description::default()
    /// })?;
    /// // What a pixel shows of the floor, in front of the plate and below it.
    /// let size = UVec2::splat(64);
    /// let is_clear = |pixel: Vec2| {
    ///     let ray = scene.camera_ray(pixel + 0.5, size);
    ///     let surface = scene.surface(&ray, &scene.intersect(&ray).expect("there is a floor"));
    ///     let patch = scene.patch(&surface, [pixel, pixel + 1.0], size).expect("of a triangle");
    ///     assert!(patch.holds(&surface));
    ///     scene.is_clear(&patch, 0)
    /// };
    /// assert!(is_clear(Vec2::new(32.0, 60.0)) && !is_clear(Vec2::new(32.0, 32.0)));
    /// # Ok::<(), scene::BuildError>(())
    /// ```
    #[must_use]
    pub fn is_clear(&self, patch: &Patch, light: usize) -> bool {
        let shaft = self.lights().outline(light).and_then(|outline| Shaft::new(patch, &outline));
        shaft.is_some_and(|shaft| self.is_empty_within(&shaft))
    }
}

#[cfg(test)]
mod tests;
