//! The lights as one point sees them.

use glam::{Vec2, Vec3, Vec3A};

use super::chances::{Chances, LightChoice};
use super::environment::EnvironmentLight;
use super::form::FormLight;
use super::rectangle::SeenRectangle;
use super::triangle::SeenTriangle;
use super::{Light, LightSample, Lights, is_over_horizon, punctual};
use crate::{PunctualLight, Surface};

/// The lights as one point sees them: what directions to the same light have in common is found once.
///
/// # Example
///
/// ```
/// use scene::glam::{Vec2, Vec3, Vec3A};
/// use scene::{Description, PunctualLight, Scene};
///
/// let lamps = [Vec3::Z, Vec3::X + Vec3::Z].map(|position| PunctualLight::Point { position, intensity: Vec3::ONE });
/// let scene = Scene::new(Description { lights: lamps.to_vec(), ..Description::default() })?;
/// let mut seen = scene.lights().seen_from(Vec3A::ZERO, Vec3A::Z);
/// for (u_choice, chance) in [(0.6, 2.0 / 3.0), (0.7, 1.0 / 3.0), (0.2, 2.0 / 3.0)] {
///     let lamp = seen.sample(u_choice, Vec2::ZERO).expect("both lamps are above");
///     assert_eq!(lamp.pdf, chance, "the square of the distance of the second one is twice as large");
/// }
/// # Ok::<(), scene::BuildError>(())
/// ```
#[derive(Debug)]
pub struct SeenLights<'a> {
    lights: &'a Lights,
    p: Vec3A,
    n: Vec3A,
    /// By which lights are chosen, if it matters from where or anything was learnt.
    chances: Option<Chances<'a>>,
    /// The light of the last direction and its index.
    last: Option<(usize, SeenLight<'a>)>,
}

/// One of the lights as a point sees it.
#[derive(Debug)]
enum SeenLight<'a> {
    Rectangle(SeenRectangle<'a>),
    Triangle(SeenTriangle<'a>),
    Form(&'a FormLight),
    Punctual(&'a PunctualLight),
    Environment(&'a EnvironmentLight),
    /// From behind.
    Dark,
}

impl<'a> SeenLights<'a> {
    #[inline]
    pub(super) fn new(lights: &'a Lights, p: Vec3A, n: Vec3A, choice: Option<&'a LightChoice>) -> Self {
        assert!(choice.is_none_or(|choice| choice.is_of(lights)), "this choice is of other lights");
        let choice = choice.or(lights.place_matters.then_some(&lights.even));
        Self { lights, p, n, chances: choice.map(|choice| Chances::new(choice, p)), last: None }
    }

    /// Chooses a light and a direction to it, as [`Lights::sample`] does where nothing was learnt.
    #[inline]
    #[must_use]
    pub fn sample(&mut self, u_choice: f32, u: Vec2) -> Option<LightSample> {
        self.direction(u_choice, u)?.sample()
    }

    /// Returns the light, below [`Lights::count`], that `u_choice` in [0, 1) chooses, and its probability; `None` where
    /// none shines to the point.
    #[inline]
    #[must_use]
    pub fn choose(&self, u_choice: f32) -> Option<(usize, f32)> {
        self.lights.choose(self.chances.as_ref(), u_choice)
    }

    /// Returns the probability with which [`SeenLights::choose`] takes a light.
    #[inline]
    #[must_use]
    pub fn probability(&self, light: usize) -> f32 {
        self.lights.probability(self.chances.as_ref(), light)
    }

    /// Returns the density of [`SeenLights::sample`] for the direction `wi` in which a ray from the point met
    /// `surface`, per steradian: that of [`Lights::pdf_surface`] by this choice of lights.
    #[inline]
    #[must_use]
    pub fn pdf_surface(&self, wi: Vec3A, surface: &Surface) -> f32 {
        self.light_at(wi, surface).map_or(0.0, |(_, pdf)| pdf)
    }

    /// Returns the same and which light it is, below [`Lights::count`]; `None` where the surface is no light that is
    /// sampled, or is seen from behind.
    ///
    /// ```
    /// use glam::{Vec2, Vec3, Vec3A};
    /// use scene::{Description, Material, Mesh, Ray, Scene};
    ///
    /// let lamp = Mesh {
    ///     positions: vec![Vec3::new(0.0, 1.0, 0.0), Vec3::new(1.0, 1.0, 0.0), Vec3::new(0.0, 1.0, 1.0)],
    ///     triangles: vec![[0, 1, 2]],
    ///     materials: vec![0],
    ///     ..Mesh::default()
    /// };
    /// let shines = Material { emission: Vec3::ONE, ..Material::default() };
    /// let scene = Scene::new(Description { meshes: vec![lamp], materials: vec![shines], ..Description::default() })?;
    /// let mut lights = scene.lights().seen_from(Vec3A::ZERO, Vec3A::Y);
    /// let sample = lights.direction(0.5, Vec2::new(0.3, 0.4)).expect("it is above");
    /// let ray = Ray::new(Vec3A::ZERO, sample.wi());
    /// let surface = scene.surface(&ray, &scene.intersect(&ray).expect("nothing stands between"));
    /// let (light, pdf) = lights.light_at(sample.wi(), &surface).expect("the lamp");
    /// assert_eq!(light, sample.light());
    /// assert!((pdf / sample.sample().expect("it shines").pdf - 1.0).abs() < 1e-4);
    /// # Ok::<(), scene::BuildError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn light_at(&self, wi: Vec3A, surface: &Surface) -> Option<(usize, f32)> {
        let Self { lights, p, .. } = *self;
        if !surface.front {
            return None;
        }
        let primitive = surface.primitive;
        let rectangle = lights.rectangles.partition_point(|light| light.primitive <= primitive).wrapping_sub(1);
        if let Some(light) = lights.rectangles.get(rectangle)
            && primitive - light.primitive < 2
        {
            return Some((rectangle, light.pdf(p, wi, surface) * self.probability(rectangle)));
        }
        let triangles = lights.rectangles.len();
        if let Ok(index) = lights.triangles.binary_search_by_key(&primitive, |light| light.primitive) {
            let light = triangles + index;
            return Some((light, lights.triangles[index].pdf(p, wi, surface) * self.probability(light)));
        }
        let forms = triangles + lights.triangles.len();
        let index = lights.forms.binary_search_by_key(&primitive, |light| light.primitive).ok()?;
        let light = forms + index;
        Some((light, lights.forms[index].pdf(p, wi) * self.probability(light)))
    }

    /// Returns the density of [`SeenLights::sample`] for a direction in which a ray from the point met nothing, per
    /// steradian: that of [`Lights::pdf_environment`] by this choice of lights.
    #[inline]
    #[must_use]
    pub fn pdf_environment(&self, wi: Vec3A) -> f32 {
        match &self.lights.environment {
            Some(light) => light.pdf(wi) * self.probability(self.lights.count() - 1),
            None => 0.0,
        }
    }

    /// As [`SeenLights::sample`], but what the light sends is not looked up yet.
    ///
    /// ```
    /// use glam::{Vec2, Vec3A};
    /// use scene::{Description, Environment, Ray, Scene};
    ///
    /// let sky = Some(Environment::sky());
    /// let scene = Scene::new(Description { environment: sky, ..Description::default() })?;
    /// let mut lights = scene.lights().seen_from(Vec3A::ZERO, Vec3A::Y);
    /// let up = lights.direction(0.5, Vec2::new(0.5, 0.1)).expect("above the horizon");
    /// assert!(!scene.occluded(&Ray::new(Vec3A::ZERO, up.wi())));
    /// assert_eq!(up.sample(), lights.sample(0.5, Vec2::new(0.5, 0.1)));
    /// # Ok::<(), scene::BuildError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn direction(&mut self, u_choice: f32, u: Vec2) -> Option<LightDirection<'a>> {
        let (light, probability) = self.choose(u_choice)?;
        self.direction_to_one(light, probability, u)
    }

    /// Chooses a direction to one light, which was chosen with a `probability` that the density is to contain; what the
    /// light sends is not looked up yet. `None` where it cannot light the surface.
    ///
    /// # Panics
    /// If there is no such light.
    #[inline]
    #[must_use]
    pub fn direction_to_one(&mut self, light: usize, probability: f32, u: Vec2) -> Option<LightDirection<'a>> {
        let Self { lights, p, n, .. } = *self;
        if self.last.as_ref().is_none_or(|last| last.0 != light) {
            let seen = match lights.light(light) {
                Light::Rectangle(light) => light.seen_from(p).map_or(SeenLight::Dark, SeenLight::Rectangle),
                Light::Triangle(light) => light.seen_from(p).map_or(SeenLight::Dark, SeenLight::Triangle),
                Light::Form(light) => SeenLight::Form(light),
                Light::Punctual(light) => SeenLight::Punctual(light),
                Light::Environment(light) => SeenLight::Environment(light),
            };
            self.last = Some((light, seen));
        }
        let mut surroundings = None;
        let sample = match &self.last.as_ref()?.1 {
            SeenLight::Rectangle(light) => light.sample(n, u, probability),
            SeenLight::Triangle(light) => light.sample(n, u, probability),
            SeenLight::Form(light) => light.sample(p, n, u, probability),
            SeenLight::Punctual(light) => punctual::sample(light, p, n, probability),
            SeenLight::Environment(light) => {
                let wi = light.direction(u);
                surroundings = Some(*light);
                let unseen =
                    LightSample { wi, distance: f32::INFINITY, radiance: Vec3::ZERO, pdf: probability, delta: false };
                is_over_horizon(n, wi).then_some(unseen)
            }
            SeenLight::Dark => None,
        }?;
        Some(LightDirection { sample, light, surroundings })
    }
}

/// A direction to a light, chosen by [`SeenLights::direction`]. What comes from there may wait until it is known that
/// nothing stands between: to look up surroundings may take longer than a ray.
#[derive(Debug, Clone, Copy)]
pub struct LightDirection<'a> {
    /// Of surroundings only the direction is known, and in the place of the density the probability of their choice.
    sample: LightSample,
    light: usize,
    surroundings: Option<&'a EnvironmentLight>,
}

impl LightDirection<'_> {
    /// Returns which light it is, below [`Lights::count`].
    #[inline]
    #[must_use]
    pub fn light(&self) -> usize {
        self.light
    }

    /// Returns the unit direction from the point to the light.
    #[inline]
    #[must_use]
    pub fn wi(&self) -> Vec3A {
        self.sample.wi
    }

    /// Returns the distance to the light, metres; infinite for environment and directional lights.
    #[inline]
    #[must_use]
    pub fn distance(&self) -> f32 {
        self.sample.distance
    }

    /// Returns all of the sample; `None` where its density is 0.
    #[inline]
    #[must_use]
    pub fn sample(&self) -> Option<LightSample> {
        match self.surroundings {
            None => Some(self.sample),
            Some(light) => light.sample_at(self.sample.wi, self.sample.pdf),
        }
    }
}
