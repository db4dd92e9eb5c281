//! Surfaces that are there in part: holes that rays pass.

use crate::{Ray, Scene, Surface, mix};

impl Scene {
    /// Returns the surfaces that a ray passes by their holes (`opacity`, masks) before `end`, which is where
    /// [`intersect`](Self::intersect) met something or infinite; the nearest first. Without surfaces with holes this is
    /// free.
    ///
    /// What arrives at a surface arrives at its holes, too.
    ///
    /// ```
    /// use scene::glam::{Vec3, Vec3A};
    /// use scene::{Description, Material, Mesh, Ray, Scene};
    ///
    /// let veil = Mesh {
    ///     positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
    ///     triangles: vec![[0, 1, 2]],
    ///     materials: vec![0],
    ///     ..Mesh::default()
    /// };
    /// let materials = vec![Material { opacity: 0.0, ..Material::default() }];
    /// let scene = Scene::new(Description { meshes: vec![veil], materials, ..Description::default() })?;
    /// let ray = Ray::new(Vec3A::new(0.2, 0.2, 1.0), Vec3A::NEG_Z);
    /// assert!(scene.intersect(&ray).is_none());
    /// assert_eq!(scene.holes(&ray, f32::INFINITY).map(|hole| hole.t).collect::<Vec<_>>(), [1.0]);
    /// # Ok::<(), scene::BuildError>(())
    /// ```
    pub fn holes(&self, ray: &Ray, end: f32) -> impl Iterator<Item = Surface> {
        let mut rest = Ray { t_max: end.min(ray.t_max), ..*ray };
        let mut step = 0.0;
        let next = move || {
            let hit = self.nearest_where(&rest, |_| true)?;
            let surface = self.surface(&rest, &hit);
            // A surface may be met time and again within the rounding of its place, and of a long ray that grazes it.
            step = if hit.t - rest.t_min < step { 2.0 * step } else { surface.p_error };
            rest.t_min = behind(hit.t).max(hit.t + step);
            Some(surface)
        };
        let has_holes = |surface: &Surface| self.materials()[surface.material as usize].is_cut_out();
        std::iter::from_fn(next).take(if self.features().cut_outs { usize::MAX } else { 0 }).filter(has_holes)
    }
}

/// Returns the ray parameter from which on a ray that passes a surface at `t` looks for the next. The margin is for
/// rays through the edge of two triangles, which may meet both; what is nearer behind one another than a millionth of
/// `t` is passed together.
pub(crate) fn behind(t: f32) -> f32 {
    const MARGIN: f32 = 8.0 * f32::EPSILON;
    (t * (1.0 + MARGIN)).max(t.next_up())
}

/// Returns a number in [0, 1) that looks random and depends on the ray's origin and direction, on the primitive, and on
/// the place on it.
pub(crate) fn ray_hash(ray: &Ray, primitive: u32, place: u32) -> f32 {
    let [ox, oy, oz] = ray.origin.to_array().map(|x| u64::from(x.to_bits()));
    let [dx, dy, dz] = ray.direction.to_array().map(|x| u64::from(x.to_bits()));
    let mut hash = 0u64;
    for word in [ox << 32 | oy, oz << 32 | dx, dy << 32 | dz, u64::from(place) << 32 | u64::from(primitive)] {
        hash = mix::mixed((hash ^ word).wrapping_add(mix::STEP));
    }
    (hash >> 40) as f32 / (1u64 << 24) as f32
}
