//! A scene that rays can ask.

use std::sync::Arc;
use std::time::Instant;

use freeform::Solid;
use glam::{UVec2, Vec2, Vec3, Vec3A};

use crate::bvh::Bvh;
use crate::camera::View;
use crate::check;
use crate::form::Form;
use crate::holes::{behind, ray_hash};
use crate::media::MediumTable;
use crate::primitives::{boxes, form_lights, primitives, triangle_lights};
use crate::shaft::Shaft;
use crate::surface::ShapePoint;
use crate::triangles::Triangles;
use crate::{
    Aabb, Bsdf, BuildError, Camera, Description, Features, Hit, Lights, Material, Media, Ray, Specular, SpecularKind,
    Surface, Target, Texture,
};

/// A scene, checked and ready: geometry in a tree, materials, lights and camera. It never changes, so threads share it
/// freely.
#[derive(Debug)]
pub struct Scene {
    triangles: Triangles,
    forms: Vec<Form>,
    /// Forms without finite bounds, which stand beside the tree.
    unbounded: Vec<u32>,
    bvh: Bvh,
    materials: Vec<Material>,
    mediums: MediumTable,
    textures: Vec<Arc<Texture>>,
    lights: Lights,
    camera: Camera,
    view: View,
    /// The transparent bodies in which the eye lies.
    eye_media: Media,
    bounds: Aabb,
    features: Features,
    light_seconds: f64,
}

impl Scene {
    /// Checks a description and builds the scene.
    ///
    /// Triangles of zero area stay in the numbering of primitives but are never hit. Without a camera the whole scene
    /// is framed.
    ///
    /// # Errors
    /// If a number is not finite or out of its range, an index does not exist, or there is more than can be numbered;
    /// the message names the mesh or material and the index.
    pub fn new(description: Description) -> Result<Self, BuildError> {
        check::check(&description)?;
        let Description { meshes, forms, materials, textures, lights, environment, camera } = description;
        let triangles = Triangles::new(meshes);
        let forms: Vec<Form> = forms
            .into_iter()
            .flat_map(|form| {
                let cut_out = materials[form.material as usize].is_cut_out();
                Form::all(form, cut_out)
            })
            .collect();
        let textures: Vec<Arc<Texture>> = textures.into_iter().map(Arc::new).collect();
        let primitives = primitives(&triangles, &forms, &materials);
        let bvh = Bvh::new(&primitives);
        let unbounded = (0u32..).zip(&forms).filter(|(_, form)| form.bounds.is_none()).map(|(i, _)| i).collect();
        let bounds = primitives.iter().fold(Aabb::EMPTY, |all, primitive| all.union(primitive.bounds()));
        drop(primitives);
        let start = Instant::now();
        let lights = Lights::new(
            triangle_lights(&triangles, &materials, &textures),
            form_lights(&triangles, &forms, &materials, &textures),
            lights,
            environment,
            bounds,
        );
        if !lights.total_flux().is_finite() {
            return Err(BuildError::Lights("their flux is beyond single precision, so bright or large are they"));
        }
        let light_seconds = start.elapsed().as_secs_f64();
        let features = Features::find(&triangles, &forms, &materials, &lights);
        let camera = camera.unwrap_or_else(|| Camera::framing(bounds));
        let mut scene = Self {
            triangles,
            forms,
            unbounded,
            bvh,
            mediums: MediumTable::new(&materials),
            materials,
            textures,
            lights,
            camera,
            view: View::new(&camera),
            eye_media: Media::NONE,
            bounds,
            features,
            light_seconds,
        };
        scene.eye_media = scene.media_at(camera.eye.into());
        Ok(scene)
    }

    /// Returns the nearest hit in the ray's range; boundaries within a transparent body of higher priority are passed.
    ///
    /// Where a surface is there in part only (`opacity`, masks), a hash of the ray and the place decides, so that the
    /// same ray always gives the same answer.
    #[inline]
    #[must_use]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let hit = self.nearest(ray)?;
        let hit = if ray.media.is_empty() { hit } else { self.unhidden(ray, hit)? };
        Some(if self.features.transmissive && self.is_glass(&hit) { self.touched(ray, hit) } else { hit })
    }

    /// Whether light passes what was hit by itself.
    #[inline]
    pub(crate) fn is_glass(&self, hit: &Hit) -> bool {
        let index = hit.primitive as usize;
        let material = match index.checked_sub(self.triangles.len()) {
            None => self.triangles.material(index),
            Some(form) => self.forms[form].material,
        };
        matches!(self.materials[material as usize].specular, SpecularKind::Dielectric { .. })
    }

    /// Returns the nearest hit, whether or not something is hidden there.
    #[inline]
    pub(crate) fn nearest(&self, ray: &Ray) -> Option<Hit> {
        self.nearest_where(ray, |hit| self.is_there(ray, hit))
    }

    /// Returns the nearest hit, where `keep` says of surfaces with holes that they are there.
    #[inline]
    pub(crate) fn nearest_where(&self, ray: &Ray, keep: impl Fn(&Hit) -> bool) -> Option<Hit> {
        let mut nearest = self.bvh.closest(ray, |form, range| self.meet_form(form, range, &keep), &keep);
        if !self.unbounded.is_empty() && ray.is_valid() {
            let mut range = *ray;
            for &form in &self.unbounded {
                range.t_max = nearest.map_or(ray.t_max, |hit| hit.t);
                let primitive = self.form_primitive(form);
                nearest = self.meet_form(primitive, &range, &keep).or(nearest);
            }
        }
        nearest
    }

    /// Passes boundaries of transparent bodies that are none, for a stronger body is there.
    #[cold]
    fn unhidden(&self, ray: &Ray, mut hit: Hit) -> Option<Hit> {
        let mut ray = *ray;
        loop {
            let surface = self.surface(&ray, &hit);
            if surface.medium == 0 || !self.mediums.hides(surface.media, surface.medium) {
                return Some(hit);
            }
            ray.media = surface.media.beyond(surface.medium, surface.front);
            ray.t_min = behind(hit.t);
            hit = self.nearest(&ray)?;
        }
    }

    /// Returns the transparent bodies in which a point lies, the outermost first: those that a ray from there leaves
    /// and has not entered. None where no material has a priority or absorbs.
    #[must_use]
    pub fn media_at(&self, p: Vec3A) -> Media {
        let mut media = Media::NONE;
        if self.mediums.is_empty() {
            return media;
        }
        // Along no axis, or it might run in a face.
        let mut ray = Ray::new(p, Vec3A::new(0.267_261, 0.534_523, 0.801_784));
        while let Some(hit) = self.nearest(&ray) {
            let surface = self.surface(&ray, &hit);
            let medium = surface.medium;
            if medium != 0 && !surface.front && !ray.media.contains(medium) {
                media = media.within(medium);
            } else if medium != 0 {
                ray.media = ray.media.beyond(medium, surface.front);
            }
            ray.t_min = behind(hit.t);
        }
        media
    }

    /// Whether anything stands in the ray's range; glass does, holes do not.
    #[inline]
    #[must_use]
    pub fn occluded(&self, ray: &Ray) -> bool {
        if !ray.media.is_empty() {
            return self.intersect(ray).is_some();
        }
        let keep = |hit: &Hit| self.is_there(ray, hit);
        self.bvh.any(ray, |form, range| self.meet_form(form, range, keep), keep)
            || (!self.unbounded.is_empty()
                && ray.is_valid()
                && self.unbounded.iter().any(|&form| self.meet_form(self.form_primitive(form), ray, keep).is_some()))
    }

    /// Whether nothing is within a shaft, as far as a quick search can tell.
    pub(crate) fn is_empty_within(&self, shaft: &Shaft) -> bool {
        let misses = |form: u32| {
            let bounds = self.forms[form as usize - self.triangles.len()].bounds;
            bounds.is_some_and(|bounds| shaft.misses(&bounds))
        };
        self.unbounded.is_empty() && self.bvh.is_clear(shaft, misses)
    }

    /// Returns the point that a ray met.
    ///
    /// Both normals are turned to the side that the ray came from. An interpolated normal that would still point away
    /// from the viewer is tilted until it just does not, so that the cosine with the viewer is always positive.
    /// Directions that a [`Bsdf`] gives are above the shading normal's horizon and may yet be below the geometric one:
    /// [`Surface::spawn`] then starts inside the body, and the ray ends in the dark. [`Surface::is_above`] tells so
    /// before.
    #[inline]
    #[must_use]
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> Surface {
        let index = hit.primitive as usize;
        let (ShapePoint { p, ng, n, uv, p_error }, material) = match index.checked_sub(self.triangles.len()) {
            None => (self.triangles.point(index, hit.barycentrics), self.triangles.material(index)),
            Some(form) => (self.forms[form].point(ray, hit), self.forms[form].material),
        };
        let wo = -ray.direction;
        let front = ng.dot(wo) >= 0.0;
        let (ng, n) = if front { (ng, n) } else { (-ng, -n) };
        Surface {
            p,
            ng,
            n: Surface::face(n, ng, wo),
            front,
            uv,
            t: hit.t,
            material,
            primitive: hit.primitive,
            p_error,
            media: hit.media,
            medium: self.mediums.number(material),
        }
    }

    /// Returns how a surface reflects, in the local frame of its shading normal `surface.n`; textures are looked up.
    #[inline]
    #[must_use]
    pub fn bsdf(&self, surface: &Surface) -> Bsdf {
        let material = &self.materials[surface.material as usize];
        let textured = |color: Vec3, texture: Option<u32>| match texture {
            Some(texture) => color * self.textures[texture as usize].color(surface.uv),
            None => color,
        };
        let mut diffuse = textured(material.diffuse, material.diffuse_texture);
        if let Some(noise) = &material.noise {
            diffuse *= noise.color(surface.p);
        }
        let coated = |reflectance: Vec3, specular: Specular, always_reflects: bool| {
            // Where a texture is black there is nothing to look after.
            let reflects = always_reflects || reflectance != Vec3::ZERO;
            let specular = if reflects { specular } else { Specular::None };
            Bsdf { diffuse: diffuse * (Vec3::ONE - reflectance), specular }
        };
        match material.specular {
            SpecularKind::None => Bsdf { diffuse, specular: Specular::None },
            SpecularKind::Ggx { alpha, reflectance, schlick } => {
                let reflectance = textured(reflectance, material.specular_texture);
                coated(reflectance, Specular::Ggx { alpha, reflectance, schlick }, schlick)
            }
            SpecularKind::Mirror { reflectance } => {
                let reflectance = textured(reflectance, material.specular_texture);
                coated(reflectance, Specular::Mirror { reflectance }, false)
            }
            SpecularKind::Dielectric { ior, tint, .. } => {
                let eta = match surface.medium {
                    0 if surface.front => ior,
                    0 => 1.0 / ior,
                    medium => self.mediums.eta(surface.media, medium, surface.front),
                };
                Bsdf { diffuse: Vec3::ZERO, specular: Specular::Dielectric { eta, tint } }
            }
        }
    }

    /// Returns the radiance that a surface gives off to the side the ray came from, W m^-2 sr^-1: fronts alone shine.
    #[inline]
    #[must_use]
    pub fn emission(&self, surface: &Surface) -> Vec3 {
        if !surface.front {
            return Vec3::ZERO;
        }
        let material = &self.materials[surface.material as usize];
        match material.emission_texture {
            Some(texture) => material.emission * self.textures[texture as usize].color(surface.uv),
            None => material.emission,
        }
    }

    /// Returns the share of the light that is left after the way to `surface`, by Beer's law: less than 1 where the ray
    /// was within an absorbing dielectric. (In scenes of more than 255 dielectrics without priorities that is known
    /// where it ended at a face of one from within.)
    #[inline]
    #[must_use]
    pub fn transmittance(&self, surface: &Surface) -> Vec3 {
        if self.features.absorbing { self.transmittance_to(surface) } else { Vec3::ONE }
    }

    fn transmittance_to(&self, surface: &Surface) -> Vec3 {
        if !self.mediums.is_empty() {
            let media = self.mediums.before(surface.media, surface.medium, surface.front);
            return self.transmittance_within(media, surface.t);
        }
        match self.materials[surface.material as usize].specular {
            SpecularKind::Dielectric { absorption, .. } if !surface.front && absorption != Vec3::ZERO => {
                (-absorption * surface.t).exp()
            }
            _ => Vec3::ONE,
        }
    }

    /// Returns the share of the light that is left after `distance` metres within transparent bodies; all of it after
    /// an infinite distance, for what is seen there is the sky.
    #[inline]
    #[must_use]
    pub fn transmittance_within(&self, media: Media, distance: f32) -> Vec3 {
        if media.is_empty() || distance.is_infinite() {
            return Vec3::ONE;
        }
        self.mediums.filling(media).map_or(Vec3::ONE, |medium| (-medium.absorption * distance).exp())
    }

    /// Returns the radiance that arrives from the unit vector `direction` where nothing stands, W m^-2 sr^-1.
    #[inline]
    #[must_use]
    pub fn background(&self, direction: Vec3A) -> Vec3 {
        self.lights.background(direction)
    }

    /// Returns the lights.
    #[must_use]
    pub fn lights(&self) -> &Lights {
        &self.lights
    }

    /// Returns spheres around all surfaces of the materials that are wanted, for photons to be sent there; around the
    /// whole scene where one of these surfaces has no bounds.
    ///
    /// # Example
    ///
    /// ```
    /// use glam::{Vec2, Vec3};
    /// use scene::{Description, Environment, Material, Mesh, Scene, SpecularKind};
    ///
    /// let triangle = |size: f32, height: f32, material| Mesh {
    ///     positions: vec![Vec3::new(0.0, 0.0, height), Vec3::new(size, 0.0, height), Vec3::new(0.0, size, height)],
    ///     triangles: vec![[0, 1, 2]],
    ///     materials: vec![material],
    ///     ..Mesh::default()
    /// };
    /// let silver = SpecularKind::Mirror { reflectance: Vec3::ONE };
    /// let scene = Scene::new(Description {
    ///     meshes: vec![triangle(100.0, 0.0, 0), triangle(0.1, 1.0, 1)],
    ///     materials: vec![Material::default(), Material { specular: silver, ..Material::default() }],
    ///     environment: Some(Environment::constant(Vec3::ONE)),
    ///     ..Description::default()
    /// })?;
    /// let mirrors = scene.target(Material::has_delta);
    /// let photon = scene.lights().emit_to(&mirrors, 0.5, Vec2::splat(0.3), Vec2::splat(0.7)).expect("the sky shines");
    /// let (offset, way) = (photon.ray.origin - Vec3::Z.to_vec3a(), photon.ray.direction);
    /// assert!((offset - way * offset.dot(way)).length() < 0.2, "it passes the small triangle");
    /// # Ok::<(), scene::BuildError>(())
    /// ```
    #[must_use]
    pub fn target(&self, is_wanted: impl Fn(&Material) -> bool) -> Target {
        let boxes = boxes(&self.triangles, &self.forms, &self.materials, is_wanted);
        boxes.map_or_else(|| self.lights.everything().clone(), |boxes| self.lights.everything().narrowed(boxes))
    }

    /// Returns the camera.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Returns the camera's ray through a point of the film (see [`Camera::ray`]), in the transparent bodies in which
    /// the eye lies.
    #[inline]
    #[must_use]
    pub fn camera_ray(&self, film: Vec2, size: UVec2) -> Ray {
        Ray { media: self.eye_media, ..self.view.ray(film, size) }
    }

    /// Returns the angle of one pixel of a picture of this size, as [`Camera::pixel_angle`] of the scene's camera.
    ///
    /// ```
    /// # use scene::{Description, Scene, glam::UVec2};
    /// let scene = Scene::new(Description::default())?;
    /// let size = UVec2::new(640, 360);
    /// assert_eq!(scene.pixel_angle(size), scene.camera().pixel_angle(size));
    /// # Ok::<(), scene::BuildError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn pixel_angle(&self, size: UVec2) -> f32 {
        self.view.pixel_angle(size)
    }

    /// Returns the box around all triangles and bounded free forms, metres.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Returns what the scene has.
    #[must_use]
    pub fn features(&self) -> Features {
        self.features
    }

    /// Returns the number of triangles.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// Returns the number of free forms, each copy counted.
    #[must_use]
    pub fn form_count(&self) -> usize {
        self.forms.len()
    }

    /// Returns the free form of a primitive as it was described, `None` for a triangle. A copy of it stands elsewhere.
    #[must_use]
    pub fn form(&self, primitive: u32) -> Option<&Solid> {
        let index = (primitive as usize).checked_sub(self.triangles.len())?;
        self.forms.get(index).map(|form| &**form.body.solid())
    }

    /// Returns the materials.
    #[must_use]
    pub fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// Time that the tables for choosing lights took, seconds: a part of rendering that is done here, once for all
    /// pictures.
    #[must_use]
    pub fn light_seconds(&self) -> f64 {
        self.light_seconds
    }

    /// Returns the memory held by geometry, tree, textures and lights, bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        self.triangles.memory_bytes()
            + self.forms.capacity() * size_of::<Form>()
            + self.forms.iter().map(|form| form.body.memory_bytes()).sum::<usize>()
            + self.solids().map(Solid::memory_bytes).sum::<usize>()
            + self.bvh.memory_bytes()
            + self.materials.capacity() * size_of::<Material>()
            + self.textures.iter().map(|texture| texture.memory_bytes()).sum::<usize>()
            + self.lights.memory_bytes()
    }

    /// The solids of the free forms, each once: copies stand one after the other.
    fn solids(&self) -> impl Iterator<Item = &Solid> {
        self.forms.chunk_by(|a, b| Arc::ptr_eq(a.body.solid(), b.body.solid())).map(|copies| &**copies[0].body.solid())
    }

    fn form_primitive(&self, form: u32) -> u32 {
        u32::try_from(self.triangles.len()).unwrap_or(u32::MAX) + form
    }

    /// Returns where a ray of shortened range meets a free form, where `keep` says that it is there.
    #[inline]
    fn meet_form(&self, primitive: u32, range: &Ray, keep: impl Fn(&Hit) -> bool) -> Option<Hit> {
        self.forms[primitive as usize - self.triangles.len()].first_hit(primitive, range, keep)
    }

    /// Whether a surface that may have holes is there for this ray.
    #[cold]
    fn is_there(&self, ray: &Ray, hit: &Hit) -> bool {
        let index = hit.primitive as usize;
        // A ray may meet a form more than once, and each of these places has its own chance, as triangles have.
        let (material, uv, place) = match index.checked_sub(self.triangles.len()) {
            None => (self.triangles.material(index), self.triangles.uv(index, hit.barycentrics), 0),
            Some(form) => (self.forms[form].material, self.forms[form].point(ray, hit).uv, hit.t.to_bits()),
        };
        let material = &self.materials[material as usize];
        let mask = material.opacity_texture.map_or(1.0, |texture| self.textures[texture as usize].mask(uv));
        ray_hash(ray, hit.primitive, place) < material.opacity * mask
    }
}
