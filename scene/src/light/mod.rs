//! What shines, and how to find it: choosing a light for a point, and light for a photon.
//!
//! A light is chosen, then a direction to it: by what each may bring to the point, and where it was learnt by whether
//! it does. Of many lamps groups are chosen, and within them by a tree. Two triangles that make a rectangle are one
//! light. Everything that a ray can also meet by chance has a density that [`Lights::pdf_surface`] and
//! [`Lights::pdf_environment`] give for any direction, so that both ways combine (Veach 1997).

mod areas;
mod chances;
mod choice;
mod environment;
mod form;
mod lamps;
mod learnt;
mod pattern;
mod polygon;
mod punctual;
mod rectangle;
mod region;
mod seen;
mod spherical_rectangle;
mod target;
mod tree;
mod triangle;
mod unhidden;

use glam::{Vec2, Vec3, Vec3A};

use crate::bounds::narrow;
use crate::{Aabb, Environment, PunctualLight, Ray, Surface};
pub(crate) use areas::Areas;
use chances::Chances;
pub use chances::LightChoice;
use choice::Choice;
use environment::EnvironmentLight;
pub(crate) use form::FormLight;
pub use learnt::LightLesson;
pub(crate) use pattern::Pattern;
use rectangle::RectangleLight;
pub use seen::{LightDirection, SeenLights};
use target::Sphere;
pub use target::Target;
use tree::{Emitter, LightTree};
pub(crate) use triangle::TriangleLight;

/// All lights of a scene.
#[derive(Debug, Clone)]
pub struct Lights {
    /// In the order of their primitives, as are triangles and forms.
    rectangles: Vec<RectangleLight>,
    triangles: Vec<TriangleLight>,
    forms: Vec<FormLight>,
    /// Point lights, then directional ones.
    punctual: Vec<PunctualLight>,
    environment: Option<EnvironmentLight>,
    /// Over rectangles, then triangles, forms, punctual lights and the environment, by flux: for photons.
    choice: Choice,
    /// Of what is not at infinity, if there is anything.
    tree: Option<LightTree>,
    /// Over all, for a point, where nothing was learnt.
    even: LightChoice,
    /// Number of lights that are not at infinity: the first ones.
    near_count: usize,
    /// Whether it matters to the choice of a light from where it is made.
    place_matters: bool,
    total_flux: Vec3,
    /// The whole scene: lights at infinity shine on its cross-section.
    everything: Target,
    /// Around all of them, where none is at infinity.
    extent: Option<Sphere>,
}

/// One of the lights.
enum Light<'a> {
    Rectangle(&'a RectangleLight),
    Triangle(&'a TriangleLight),
    Form(&'a FormLight),
    Punctual(&'a PunctualLight),
    Environment(&'a EnvironmentLight),
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

impl LightSample {
    /// A sample of a light that has a surface; `None` where density or distance are no use, as for a light that is seen
    /// edge on, or nothing comes from there.
    #[inline]
    fn of_surface(wi: Vec3A, distance: f32, radiance: Vec3, pdf: f32) -> Option<Self> {
        let is_sound = pdf > 0.0 && pdf.is_finite() && distance > 0.0 && radiance != Vec3::ZERO;
        is_sound.then_some(Self { wi, distance, radiance, pdf, delta: false })
    }
}

/// Whether a direction is above the horizon of a surface with normal `n`.
#[inline]
fn is_over_horizon(n: Vec3A, wi: Vec3A) -> bool {
    n.dot(wi) > 0.0
}

/// Density per steradian of a point that was chosen uniformly on an area and is seen at the cosine to its normal; 0
/// where that is no number or the point is seen from behind.
#[inline]
fn pdf_by_area(cosine: f32, area: f32, distance_sq: f32) -> f32 {
    let pdf = distance_sq / (cosine * area);
    if pdf > 0.0 && pdf.is_finite() { pdf } else { 0.0 }
}

/// The start of a photon, chosen by [`Lights::emit`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Emission {
    /// Where it starts and how it travels.
    pub ray: Ray,
    /// Flux of this photon, W, already divided by its density: the mean over photons is the lights' flux.
    pub flux: Vec3,
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
        let (rectangles, triangles) = join_rectangles(triangles);
        let is_point = |light: &PunctualLight| matches!(light, PunctualLight::Point { .. });
        let (points, others): (Vec<_>, Vec<_>) = punctual.into_iter().map(punctual::normalised).partition(is_point);
        let near_count = rectangles.len() + triangles.len() + forms.len() + points.len();
        let mut lights = Self {
            rectangles,
            triangles,
            forms,
            punctual: points.into_iter().chain(others).collect(),
            environment: environment.and_then(EnvironmentLight::new),
            choice: Choice::default(),
            tree: None,
            even: LightChoice::empty(),
            near_count,
            place_matters: false,
            total_flux: Vec3::ZERO,
            everything: Target::around(bounds),
            extent: None,
        };
        let emitters: Vec<Emitter> = (0..near_count).map(|index| lights.light(index).emitter()).collect();
        if near_count > 0 && near_count == lights.count() {
            let bounds = emitters.iter().fold(Aabb::EMPTY, |bounds, emitter| bounds.union(emitter.bounds));
            lights.extent = Some(Sphere::of_box(bounds));
        }
        lights.tree = (near_count > 0).then(|| LightTree::new(&emitters));
        lights.weigh();
        lights
    }

    /// Sets what follows from how bright the lights are.
    fn weigh(&mut self) {
        let fluxes: Vec<_> =
            (0..self.count()).map(|light| self.light(light).flux(&self.everything).as_dvec3()).collect();
        self.choice = Choice::new(fluxes.iter().map(|flux| flux.element_sum()));
        self.even = LightChoice::even(self);
        self.place_matters = self.near_count > 0 && self.has_choice();
        self.total_flux = fluxes.into_iter().sum::<glam::DVec3>().as_vec3();
    }

    /// Whether nothing shines that could be chosen.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.choice.is_empty()
    }

    /// Returns the same lights with the environment chosen, and directions to it, by `weight` of its radiance instead
    /// of all of it.
    ///
    /// What [`Lights::sample`] gives is still the whole radiance: this is for who takes only a part of it, such as the
    /// sun. Where the weight is 0 no direction is sampled.
    #[must_use]
    pub fn with_environment_weight(&self, weight: impl Fn(Vec3) -> Vec3) -> Self {
        let mut lights = self.clone();
        lights.environment = self.environment.as_ref().and_then(|light| light.weighted(weight));
        lights.weigh();
        lights
    }

    /// Returns the number of lights: emissive triangles (two that make a rectangle are one) and free forms, point and
    /// directional lights, and the environment.
    #[must_use]
    pub fn count(&self) -> usize {
        self.near_count + self.punctual.len() - self.point_count() + usize::from(self.environment.is_some())
    }

    /// Whether there are several, so that a number is needed to choose one.
    #[must_use]
    pub fn has_choice(&self) -> bool {
        self.count() > 1
    }

    /// Whether none has any extent: only point and directional lights.
    ///
    /// ```
    /// use glam::Vec3;
    /// use scene::{Description, PunctualLight, Scene};
    ///
    /// let sun = PunctualLight::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::ONE };
    /// let scene = Scene::new(Description { lights: vec![sun], ..Description::default() })?;
    /// assert!(scene.lights().are_punctual() && !scene.lights().has_choice());
    /// # Ok::<(), scene::BuildError>(())
    /// ```
    #[must_use]
    pub fn are_punctual(&self) -> bool {
        self.count() == self.punctual.len()
    }

    /// Returns the flux of all lights, W; of those at infinity what enters the sphere around the scene. Where pictures
    /// say how a light shines that is an estimate, by which lights are chosen.
    #[must_use]
    pub fn total_flux(&self) -> Vec3 {
        self.total_flux
    }

    /// Chooses a light and a direction to it from `p`; `None` where the chosen one cannot light a surface there with
    /// normal `n`.
    ///
    /// Nothing is said of what stands between. `u_choice` chooses the light, `u` the direction. A sample that is `None`
    /// counts as 0.
    #[inline]
    #[must_use]
    pub fn sample(&self, p: Vec3A, n: Vec3A, u_choice: f32, u: Vec2) -> Option<LightSample> {
        self.seen_from(p, n).sample(u_choice, u)
    }

    /// Returns the lights as a surface at `p` with normal `n` sees them, for whoever wants many directions to them.
    #[inline]
    #[must_use]
    pub fn seen_from(&self, p: Vec3A, n: Vec3A) -> SeenLights<'_> {
        SeenLights::new(self, p, n, None)
    }

    /// As [`Lights::seen_from`], but they are chosen by what was learnt of them, if anything was. Densities are those
    /// of [`SeenLights::pdf_surface`] and [`SeenLights::pdf_environment`] then.
    ///
    /// # Panics
    /// If the choice is one of another number of lights. It must be of these.
    #[inline]
    #[must_use]
    pub fn seen_by<'a>(&'a self, p: Vec3A, n: Vec3A, choice: Option<&'a LightChoice>) -> SeenLights<'a> {
        SeenLights::new(self, p, n, choice)
    }

    /// Returns the cone in which all lights lie as seen from `p`: its axis, a unit vector, and its half angle in
    /// radians; `None` where there is no such cone, as among the lights, under a sky or without any light.
    #[inline]
    #[must_use]
    pub fn cone(&self, p: Vec3A) -> Option<(Vec3A, f32)> {
        let Sphere { centre, radius } = self.extent?;
        let (offset, radius) = (centre.as_vec3a() - p, narrow(radius));
        let distance = offset.length();
        (distance > radius).then(|| (offset / distance, (radius / distance).asin()))
    }

    /// Returns the density of [`Lights::sample`] at `p` for the direction `wi` in which a ray from `p` met `surface`,
    /// per steradian.
    ///
    /// 0 where the surface does not shine to that side or is not among the lights that are sampled, and where `p` is so
    /// near to the plane of a flat light that rounding may have moved it there.
    #[inline]
    #[must_use]
    pub fn pdf_surface(&self, p: Vec3A, wi: Vec3A, surface: &Surface) -> f32 {
        SeenLights::new(self, p, Vec3A::ZERO, None).pdf_surface(wi, surface)
    }

    /// Returns the density of [`Lights::sample`] at `p` for a direction in which a ray from there met nothing, per
    /// steradian; 0 without an environment.
    #[inline]
    #[must_use]
    pub fn pdf_environment(&self, p: Vec3A, wi: Vec3A) -> f32 {
        SeenLights::new(self, p, Vec3A::ZERO, None).pdf_environment(wi)
    }

    /// Returns, for each light in turn, below which `u_choice` [`Lights::emit`] chooses it or one before it; the last
    /// is 1. None where nothing shines.
    ///
    /// ```
    /// use glam::Vec3;
    /// use scene::{Description, PunctualLight, Scene};
    ///
    /// let lamp = |watts| PunctualLight::Point { position: Vec3::ZERO, intensity: Vec3::splat(watts) };
    /// let scene = Scene::new(Description { lights: vec![lamp(1.0), lamp(3.0)], ..Description::default() })?;
    /// let ends = scene.lights().choice_ends();
    /// assert!(ends.len() == 2 && (ends[0] - 0.25).abs() < 1e-6 && ends[1] == 1.0);
    /// # Ok::<(), scene::BuildError>(())
    /// ```
    #[must_use]
    pub fn choice_ends(&self) -> &[f64] {
        self.choice.ends()
    }

    /// Chooses a light and a photon from it; `None` counts as a photon without flux.
    #[inline]
    #[must_use]
    pub fn emit(&self, u_choice: f32, u_position: Vec2, u_direction: Vec2) -> Option<Emission> {
        self.emit_to(&self.everything, u_choice, u_position, u_direction)
    }

    /// As [`Self::emit`], but lights at infinity, and lamps as far as that is of use, send photons to a target only:
    /// for what meets that first, the mean over photons is the same. The probabilities of the lights are those of
    /// [`Self::choice_ends`] all the same. [`Scene::target`](crate::Scene::target) has an example.
    #[inline]
    #[must_use]
    pub fn emit_to(&self, target: &Target, u_choice: f32, u_position: Vec2, u_direction: Vec2) -> Option<Emission> {
        let (index, probability) = self.choice.sample(f64::from(u_choice))?;
        // Of one among very many lights it has few digits left: what that chooses is right in the mean over these
        // lights.
        let rest = || self.choice.rest(u_choice, index);
        let mut emission = match self.light(index) {
            Light::Rectangle(light) => light.emit(target, rest(), u_position, u_direction)?,
            Light::Triangle(light) => light.emit(target, rest(), u_position, u_direction)?,
            Light::Form(light) => light.emit(target, rest(), u_position, u_direction)?,
            Light::Punctual(light) => punctual::emit(light, target, rest(), u_position, u_direction)?,
            Light::Environment(light) => light.emit(target, rest(), u_position, u_direction)?,
        };
        emission.flux /= probability;
        Some(emission)
    }

    /// Returns the light that `u` in [0, 1) chooses for a point that sees them like this, and its probability.
    #[inline]
    fn choose(&self, chances: Option<&Chances>, u: f32) -> Option<(usize, f32)> {
        match chances {
            Some(chances) => chances.choose(self, u),
            None if self.near_count > 0 => Some((0, 1.0)),
            None => self.even.far.sample(f64::from(u)),
        }
    }

    /// Returns the probability with which [`Lights::choose`] takes a light.
    #[inline]
    fn probability(&self, chances: Option<&Chances>, index: usize) -> f32 {
        match chances {
            Some(chances) => chances.probability(self, index),
            None if self.near_count > 0 => 1.0,
            None => self.even.far.probability(index),
        }
    }

    /// Returns the light of an index below [`Lights::count`].
    #[inline]
    fn light(&self, index: usize) -> Light<'_> {
        if let Some(light) = self.rectangles.get(index) {
            return Light::Rectangle(light);
        }
        let index = index - self.rectangles.len();
        if let Some(light) = self.triangles.get(index) {
            return Light::Triangle(light);
        }
        let index = index - self.triangles.len();
        if let Some(light) = self.forms.get(index) {
            return Light::Form(light);
        }
        match self.punctual.get(index - self.forms.len()) {
            Some(light) => Light::Punctual(light),
            None => Light::Environment(self.environment.as_ref().expect("what is no other light is the environment")),
        }
    }

    fn point_count(&self) -> usize {
        self.near_count - self.rectangles.len() - self.triangles.len() - self.forms.len()
    }

    /// Returns the whole scene as a target of [`Self::emit_to`]: that of [`Self::emit`].
    #[must_use]
    pub fn everything(&self) -> &Target {
        &self.everything
    }

    /// Returns the radiance of the surroundings.
    #[inline]
    pub(crate) fn background(&self, direction: Vec3A) -> Vec3 {
        self.environment.as_ref().map_or(Vec3::ZERO, |light| light.radiance(direction))
    }

    /// Returns the memory held, bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        self.rectangles.capacity() * size_of::<RectangleLight>()
            + self.triangles.capacity() * size_of::<TriangleLight>()
            + self.forms.capacity() * size_of::<FormLight>()
            + self.punctual.capacity() * size_of::<PunctualLight>()
            + self.environment.as_ref().map_or(0, EnvironmentLight::memory_bytes)
            + self.choice.memory_bytes()
            + self.tree.as_ref().map_or(0, LightTree::memory_bytes)
            + self.even.memory_bytes()
    }

    pub(crate) fn has_environment(&self) -> bool {
        self.environment.is_some()
    }

    pub(crate) fn has_punctual(&self) -> bool {
        !self.punctual.is_empty()
    }

    pub(crate) fn has_area(&self) -> bool {
        !(self.rectangles.is_empty() && self.triangles.is_empty() && self.forms.is_empty())
    }
}

impl Light<'_> {
    fn flux(&self, target: &Target) -> Vec3 {
        match self {
            Self::Rectangle(light) => light.flux(),
            Self::Triangle(light) => light.flux(),
            Self::Form(light) => light.flux(),
            Self::Punctual(light) => punctual::flux(light, target),
            Self::Environment(light) => light.flux(target),
        }
    }

    /// Returns what the choice of a light that is not at infinity must know of it.
    fn emitter(&self) -> Emitter {
        let (bounds, centre, area, flux, normal) = match self {
            Self::Rectangle(light) => {
                (light.bounds(), light.point(Vec2::splat(0.5)), light.area(), light.flux(), Some(light.normal()))
            }
            Self::Triangle(light) => {
                let centre = light.corners.map(Vec3A::from).iter().sum::<Vec3A>() / 3.0;
                (Aabb::of_points(&light.corners), centre, light.area, light.flux(), Some(light.normal))
            }
            Self::Form(light) => {
                (light.bounds(), light.sphere.centre.as_vec3a(), narrow(light.area), light.flux(), None)
            }
            Self::Punctual(PunctualLight::Point { position, intensity }) => {
                let flux = *intensity * (4.0 * std::f32::consts::PI);
                (Aabb { min: *position, max: *position }, (*position).into(), 0.0, flux, None)
            }
            Self::Punctual(PunctualLight::Directional { .. }) | Self::Environment(_) => {
                unreachable!("lights at infinity are everywhere")
            }
        };
        let flux = flux.element_sum() * if normal.is_some() { 1.0 } else { 0.25 };
        Emitter { bounds, centre, area, flux, normal }
    }
}

/// Joins neighbours that make a rectangle; the rest stays as it is. Both are in the order of their primitives.
fn join_rectangles(triangles: Vec<TriangleLight>) -> (Vec<RectangleLight>, Vec<TriangleLight>) {
    let (mut rectangles, mut single) = (Vec::new(), Vec::new());
    let mut rest = triangles.into_iter().peekable();
    while let Some(triangle) = rest.next() {
        match rest.peek().and_then(|next| RectangleLight::join(&triangle, next)) {
            Some(rectangle) => {
                rest.next();
                rectangles.push(rectangle);
            }
            None => single.push(triangle),
        }
    }
    (rectangles, single)
}
