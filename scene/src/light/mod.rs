//! What shines, and how to find it: choosing a light for a point, and light for a photon.
//!
//! A light is chosen in proportion to its flux, then a direction to it. Everything that a ray can also meet by chance has a density that
//! [`Lights::pdf_surface`] and [`Lights::pdf_environment`] give for any direction, so that both ways combine (Veach 1997).

mod choice;
mod environment;
mod form;
mod punctual;
mod region;
mod triangle;

use glam::{Vec2, Vec3, Vec3A};

use crate::{Aabb, Environment, PunctualLight, Ray, Surface};
use choice::Choice;
use environment::EnvironmentLight;
pub(crate) use form::FormLight;
pub(crate) use triangle::TriangleLight;

/// All lights of a scene.
#[derive(Debug, Clone)]
pub struct Lights {
    /// In the order of their primitives.
    triangles: Vec<TriangleLight>,
    /// In the order of their primitives, too.
    forms: Vec<FormLight>,
    punctual: Vec<PunctualLight>,
    environment: Option<EnvironmentLight>,
    /// Over triangles, then forms, then punctual lights, then the environment.
    choice: Choice,
    total_flux: Vec3,
    surroundings: Sphere,
}

/// A direction to a light, chosen by [`Lights::sample`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightSample {
    /// Unit direction from the point to the light.
    pub wi: Vec3A,
    /// Distance to the light, metres; infinite for environment and directional lights.
    pub distance: f32,
    /// Radiance from there, W m^-2 sr^-1; for a delta light the irradiance on a surface at right angles to it.
    pub radiance: Vec3,
    /// Density per steradian, the choice of the light included; for a delta light the probability of the choice.
    pub pdf: f32,
    /// Whether the light has no extent, so that no ray meets it by chance.
    pub delta: bool,
}

/// The start of a photon, chosen by [`Lights::emit`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Emission {
    /// Where it starts and how it travels.
    pub ray: Ray,
    /// Flux of this photon, W, already divided by its density: the mean over photons is the lights' total flux.
    pub flux: Vec3,
}

/// The sphere around all bounded things: lights at infinity shine on its cross-section.
#[derive(Debug, Clone, Copy)]
struct Sphere {
    centre: Vec3A,
    radius: f32,
}

impl Lights {
    /// Makes the lights of a scene; triangles and forms are in the order of their primitives.
    pub(crate) fn new(
        triangles: Vec<TriangleLight>,
        forms: Vec<FormLight>,
        punctual: Vec<PunctualLight>,
        environment: Option<Environment>,
        bounds: Aabb,
    ) -> Self {
        let radius = bounds.radius();
        let surroundings = Sphere { centre: bounds.centre().into(), radius: if radius > 0.0 { radius } else { 1.0 } };
        let punctual: Vec<_> = punctual.into_iter().map(punctual::normalised).collect();
        let environment = environment.and_then(EnvironmentLight::new);
        Self::from_parts(triangles, forms, punctual, environment, surroundings)
    }

    fn from_parts(
        triangles: Vec<TriangleLight>,
        forms: Vec<FormLight>,
        punctual: Vec<PunctualLight>,
        environment: Option<EnvironmentLight>,
        surroundings: Sphere,
    ) -> Self {
        let fluxes = (triangles.iter().map(TriangleLight::flux))
            .chain(forms.iter().map(FormLight::flux))
            .chain(punctual.iter().map(|light| punctual::flux(light, &surroundings)))
            .chain(environment.iter().map(|light| light.flux(&surroundings)));
        let fluxes: Vec<Vec3> = fluxes.collect();
        let choice = Choice::new(fluxes.iter().map(|flux| flux.as_dvec3().element_sum()));
        let total_flux = fluxes.iter().map(|flux| flux.as_dvec3()).sum::<glam::DVec3>().as_vec3();
        Self { triangles, forms, punctual, environment, choice, total_flux, surroundings }
    }

    /// Whether nothing shines that could be chosen.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.choice.is_empty()
    }

    /// Returns the same lights with the environment chosen, and directions to it, by `weight` of its radiance instead of all of it.
    ///
    /// What [`Lights::sample`] gives is still the whole radiance: this is for who takes only a part of it, such as the sun. Where the
    /// weight is 0 no direction is sampled.
    #[must_use]
    pub fn with_environment_weight(&self, weight: impl Fn(Vec3) -> Vec3) -> Self {
        let environment = self.environment.as_ref().and_then(|light| light.weighted(weight));
        let (triangles, forms) = (self.triangles.clone(), self.forms.clone());
        Self::from_parts(triangles, forms, self.punctual.clone(), environment, self.surroundings)
    }

    /// Returns the number of lights: emissive triangles and free forms, point and directional lights, and the environment.
    #[must_use]
    pub fn count(&self) -> usize {
        self.triangles.len() + self.forms.len() + self.punctual.len() + usize::from(self.environment.is_some())
    }

    /// Returns the flux of all lights, W; of those at infinity what enters the sphere around the scene.
    #[must_use]
    pub fn total_flux(&self) -> Vec3 {
        self.total_flux
    }

    /// Chooses a light and a direction to it from `p`; `None` where the chosen one cannot light a surface there with normal `n`.
    ///
    /// Nothing is said of what stands between. `u_choice` chooses the light, `u` the direction. A sample that is `None` counts as 0.
    #[inline]
    #[must_use]
    pub fn sample(&self, p: Vec3A, n: Vec3A, u_choice: f32, u: Vec2) -> Option<LightSample> {
        let (index, probability) = self.choice.sample(u_choice)?;
        let sample = if let Some(light) = self.triangles.get(index) {
            light.sample(p, u, probability)?
        } else if let Some(light) = self.forms.get(index - self.triangles.len()) {
            light.sample(p, n, u, probability)?
        } else if let Some(light) = self.punctual.get(index - self.triangles.len() - self.forms.len()) {
            punctual::sample(light, p, probability)?
        } else {
            self.environment.as_ref()?.sample(u, probability)?
        };
        (n.dot(sample.wi) > 0.0).then_some(sample)
    }

    /// Returns the density of [`Lights::sample`] at `p` for the direction `wi` in which a ray from `p` met `surface`, per steradian.
    ///
    /// 0 where the surface does not shine to that side or is not among the lights that are sampled.
    #[inline]
    #[must_use]
    pub fn pdf_surface(&self, p: Vec3A, wi: Vec3A, surface: &Surface) -> f32 {
        if !surface.front {
            return 0.0;
        }
        match self.triangles.binary_search_by_key(&surface.primitive, |light| light.primitive) {
            Ok(index) => self.triangles[index].pdf(p, wi, surface) * self.choice.probability(index),
            Err(_) => match self.forms.binary_search_by_key(&surface.primitive, |light| light.primitive) {
                Ok(index) => self.forms[index].pdf(p, wi) * self.choice.probability(self.triangles.len() + index),
                Err(_) => 0.0,
            },
        }
    }

    /// Returns the density of [`Lights::sample`] for a direction in which a ray met nothing, per steradian; 0 without an environment.
    #[inline]
    #[must_use]
    pub fn pdf_environment(&self, wi: Vec3A) -> f32 {
        match &self.environment {
            Some(light) => light.pdf(wi) * self.choice.probability(self.count() - 1),
            None => 0.0,
        }
    }

    /// Chooses a light and a photon from it; `None` counts as a photon without flux.
    #[inline]
    #[must_use]
    pub fn emit(&self, u_choice: f32, u_position: Vec2, u_direction: Vec2) -> Option<Emission> {
        let (index, probability) = self.choice.sample(u_choice)?;
        let mut emission = if let Some(light) = self.triangles.get(index) {
            light.emit(u_position, u_direction)
        } else if let Some(light) = self.forms.get(index - self.triangles.len()) {
            light.emit(self.choice.rest(u_choice, index), u_position, u_direction)?
        } else if let Some(light) = self.punctual.get(index - self.triangles.len() - self.forms.len()) {
            punctual::emit(light, &self.surroundings, u_position, u_direction)
        } else {
            self.environment.as_ref()?.emit(&self.surroundings, u_position, u_direction)?
        };
        emission.flux /= probability;
        Some(emission)
    }

    /// Returns the radiance of the surroundings.
    #[inline]
    pub(crate) fn background(&self, direction: Vec3A) -> Vec3 {
        self.environment.as_ref().map_or(Vec3::ZERO, |light| light.radiance(direction))
    }

    /// Returns the memory held, bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        self.triangles.capacity() * size_of::<TriangleLight>()
            + self.forms.capacity() * size_of::<FormLight>()
            + self.punctual.capacity() * size_of::<PunctualLight>()
            + self.environment.as_ref().map_or(0, EnvironmentLight::memory_bytes)
            + self.choice.memory_bytes()
    }

    pub(crate) fn has_environment(&self) -> bool {
        self.environment.is_some()
    }

    pub(crate) fn has_punctual(&self) -> bool {
        !self.punctual.is_empty()
    }

    pub(crate) fn has_area(&self) -> bool {
        !(self.triangles.is_empty() && self.forms.is_empty())
    }
}

impl Sphere {
    /// Returns the area of the cross-section.
    fn cross_section(&self) -> f32 {
        std::f32::consts::PI * self.radius * self.radius
    }

    /// Returns a ray that comes from infinity along `direction` and through a point of the cross-section.
    fn ray(&self, direction: Vec3A, u: Vec2) -> Ray {
        let frame = hemimap::Frame::from_normal(-direction);
        let disk = hemimap::square_to_disk(u) * self.radius;
        // Twice the radius away: the sphere's front, and a little that rounding cannot use up.
        Ray::new(self.centre + frame.s * disk.x + frame.t * disk.y - direction * (2.0 * self.radius), direction)
    }
}
