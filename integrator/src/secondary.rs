//! What a gather ray finds: the light that a surface sends back, by direct light there and one look into a photon map or any
//! other solution for the rest.

use glam::{Vec2, Vec3, Vec3A};
use hemimap::Frame;
use scene::{Bsdf, LightSample, Lobes, Ray, Scene, Surface};

use crate::sampler::Sampler;
use crate::sky::SkySplit;
use crate::statistics::RayCounts;
use crate::walk::{Taken, Visitor, walk};

/// What is known of the light at a surface, apart from what path tracing would find.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Known {
    /// Irradiance straight from the sources, W m^-2; `None` where light must be sampled.
    pub direct: Option<Vec3>,
    /// Irradiance by light that was reflected or refracted at least once, caustics included, W m^-2.
    pub indirect: Vec3,
    /// Length in metres below which the light is blurred: hits nearer than that go one bounce further.
    pub resolution: f32,
}

/// Light at surfaces that gather rays meet: a photon map, a radiosity solution, or whatever else the caller has.
pub trait Secondary: Sync {
    /// The light at a surface, `None` where this solution knows nothing and the path goes on instead.
    fn irradiance(&self, surface: &Surface) -> Option<Known>;

    /// Irradiance that came by mirrors or glass alone: the caustics. Zero in a scene without them.
    fn caustic_irradiance(&self, surface: &Surface) -> Vec3;

    /// The same at surfaces that gather rays meet, where it need not be as exact; by a quicker way if there is one.
    fn quick_caustic_irradiance(&self, surface: &Surface) -> Vec3 {
        self.caustic_irradiance(surface)
    }
}

/// Knows nothing: every path goes on by itself.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoSecondary;

impl Secondary for NoSecondary {
    fn irradiance(&self, _: &Surface) -> Option<Known> {
        None
    }

    fn caustic_irradiance(&self, _: &Surface) -> Vec3 {
        Vec3::ZERO
    }
}

/// A point being shaded: surface, local frame and direction to the viewer.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shading {
    pub(crate) surface: Surface,
    pub(crate) frame: Frame,
    pub(crate) bsdf: Bsdf,
    /// To the viewer, local frame.
    pub(crate) wo: Vec3A,
}

impl Shading {
    pub(crate) fn new(scene: &Scene, surface: Surface, direction: Vec3A) -> Self {
        let frame = Frame::from_normal(surface.n);
        Self { frame, bsdf: scene.bsdf(&surface), wo: frame.to_local(-direction), surface }
    }

    /// Whether a world direction really leaves on the side to which the local one points: a shading normal may say otherwise.
    pub(crate) fn leaves(&self, wi: Vec3A, wi_local: Vec3A) -> bool {
        wi.dot(self.surface.ng) * wi_local.z > 0.0
    }

    /// A ray from the surface with a density of cos(theta) / pi; `None` where it would leave on the wrong side.
    pub(crate) fn cosine_ray(&self, u: Vec2) -> Option<Ray> {
        let wi_local = hemimap::square_to_cosine_hemisphere(u);
        let wi = self.frame.to_world(wi_local);
        self.leaves(wi, wi_local).then(|| self.surface.spawn(wi))
    }
}

/// Follows light at secondary hits.
#[derive(Debug)]
pub(crate) struct Follower<'a, S> {
    pub(crate) scene: &'a Scene,
    pub(crate) secondary: &'a S,
    /// Width in radians of the lobe that asks: where it is narrower than what the solution resolves, direct light is sampled even if the solution
    /// knows it, so that shadows in reflections are sharp. Infinite for the rays of a hemisphere.
    pub(crate) spread: f32,
}

impl<S: Secondary> Follower<'_, S> {
    /// Radiance that the surface met by `ray` sends back along it, without what it emits, and without light that came there by
    /// mirrors or glass alone: that is the caustic of the point that gathers.
    pub(crate) fn reflected(&self, ray: &Ray, surface: Surface, sampler: &mut Sampler, rays: &mut RayCounts) -> Vec3 {
        let mut answer = Answer { follower: self, radiance: Vec3::ZERO };
        walk(self.scene, ray.direction, surface, sampler, rays, &mut answer);
        answer.radiance
    }
}

/// The light that a walk finds with the help of a secondary solution.
struct Answer<'a, S> {
    follower: &'a Follower<'a, S>,
    radiance: Vec3,
}

impl<S: Secondary> Visitor for Answer<'_, S> {
    fn visit(&mut self, shading: &Shading, beta: Vec3, near: f32) -> Taken {
        let known = self.follower.secondary.irradiance(&shading.surface).filter(|known| near >= known.resolution);
        let Some(known) = known else { return Taken::Nothing };
        let direct = known.direct.filter(|_| self.follower.spread * near >= known.resolution);
        let irradiance = direct.unwrap_or_default() + known.indirect;
        self.radiance += beta * shading.bsdf.diffuse * irradiance * std::f32::consts::FRAC_1_PI;
        if direct.is_some() { Taken::All } else { Taken::Indirect }
    }

    fn add(&mut self, radiance: Vec3) {
        self.radiance += radiance;
    }

    fn caustic_irradiance(&self, surface: &Surface) -> Vec3 {
        self.follower.secondary.quick_caustic_irradiance(surface)
    }
}

/// Light that arrives straight from the sources and is reflected to the viewer: by the diffuse part, and by the glossy part under
/// the power heuristic with sampling of that lobe. One light is sampled with the four numbers `u`.
///
/// With `sky`, only the hard part of the surroundings counts for the diffuse part.
pub(crate) fn direct_light(
    scene: &Scene,
    shading: &Shading,
    u: [f32; 4],
    sky: Option<&SkySplit>,
    rays: &mut RayCounts,
) -> (Vec3, Vec3) {
    let Shading { surface, frame, bsdf, wo } = shading;
    let nothing = (Vec3::ZERO, Vec3::ZERO);
    // Where the glossy part is wanted too, its density must be that of the other technique's weight.
    let lights = sky.filter(|_| !bsdf.has_glossy()).map_or(scene.lights(), SkySplit::lights);
    let Some(light) = lights.sample(surface.p, surface.n, u[0], Vec2::new(u[1], u[2])) else {
        return nothing;
    };
    let wi = frame.to_local(light.wi);
    if wi.z <= 0.0 || !shading.leaves(light.wi, wi) {
        return nothing;
    }
    let (diffuse, specular) = unshadowed(bsdf, *wo, wi, &light, sky);
    if diffuse == Vec3::ZERO && specular == Vec3::ZERO {
        return nothing;
    }
    rays.shadow += 1;
    if scene.occluded(&surface.shadow_ray(light.wi, light.distance)) {
        return nothing;
    }
    let through = scene.transmittance_within(surface.media, light.distance);
    (diffuse * through, specular * through)
}

/// Direct light of sources that light sampling does not know, such as surfaces whose holes a mask draws, reflected by the diffuse part: by one
/// cosine-distributed ray.
pub(crate) fn unsampled_emission(scene: &Scene, shading: &Shading, u: Vec2, rays: &mut RayCounts) -> Vec3 {
    let Some(ray) = shading.cosine_ray(u) else { return Vec3::ZERO };
    rays.path += 1;
    let Some(hit) = scene.intersect(&ray) else { return Vec3::ZERO };
    let surface = scene.surface(&ray, &hit);
    let emission = scene.emission(&surface);
    let known = emission == Vec3::ZERO || scene.lights().pdf_surface(shading.surface.p, ray.direction, &surface) > 0.0;
    if known { Vec3::ZERO } else { shading.bsdf.diffuse * emission * scene.transmittance(&surface) }
}

fn unshadowed(bsdf: &Bsdf, wo: Vec3A, wi: Vec3A, light: &LightSample, sky: Option<&SkySplit>) -> (Vec3, Vec3) {
    let factor = wi.z / light.pdf;
    let is_sky = light.distance.is_infinite() && !light.delta;
    let mut diffuse = Vec3::ZERO;
    if bsdf.has_diffuse() {
        let radiance = match sky {
            Some(sky) if is_sky => sky.hard(light.radiance),
            _ => light.radiance,
        };
        diffuse = bsdf.eval(Lobes::DIFFUSE, wo, wi) * radiance * factor;
    }
    let mut specular = Vec3::ZERO;
    if bsdf.has_glossy() {
        let weight = if light.delta { 1.0 } else { mis_weight(light.pdf, bsdf.pdf(Lobes::SPECULAR, wo, wi)) };
        specular = bsdf.eval(Lobes::SPECULAR, wo, wi) * light.radiance * (factor * weight);
    }
    (diffuse, specular)
}

/// Power heuristic for a sample of density `taken` that the other technique would take with density `other` (Veach 1997); 1 for
/// a delta direction, whose density is given as 0, and which no other technique can take.
pub(crate) fn mis_weight(taken: f32, other: f32) -> f32 {
    if taken == 0.0 || other == 0.0 {
        return 1.0;
    }
    let ratio = other / taken;
    1.0 / (1.0 + ratio * ratio)
}
