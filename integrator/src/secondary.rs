//! What a gather ray finds: the light that a surface sends back, by direct light there and one look into a photon map or any
//! other solution for the rest.

use glam::{Vec2, Vec3, Vec3A};
use hemimap::Frame;
use scene::{Bsdf, LightSample, Lobes, Ray, Scene, Surface};

use crate::sampler::Sampler;
use crate::sky::SkySplit;
use crate::statistics::RayCounts;

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

/// From this bounce on, paths are ended by roulette.
const ROULETTE_START: u32 = 2;

/// Most that roulette lets a bounce survive which follows paths because nothing is known: these recurse, and white surfaces would take
/// them deeper than the stack of a thread.
const MAX_SURVIVAL: f32 = 0.75;

/// No path branches off at its surfaces more often than this: a stack of a thread holds them.
const MAX_DEPTH: u32 = 100;

/// No path is longer, whatever the materials say.
const MAX_BOUNCES: u32 = 1000;

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
}

/// Follows light at secondary hits.
#[derive(Debug)]
pub(crate) struct Follower<'a, S> {
    pub(crate) scene: &'a Scene,
    pub(crate) secondary: &'a S,
    /// Whether direct light is sampled even where the secondary solution knows it: what a narrow lobe shows must have sharp shadows.
    pub(crate) samples_light: bool,
}

impl<S: Secondary> Follower<'_, S> {
    /// Radiance that the surface met by `ray` sends back along it, without what it emits, and without light that came there by
    /// mirrors or glass alone: that is the caustic of the point that gathers.
    pub(crate) fn reflected(&self, ray: &Ray, surface: Surface, sampler: &mut Sampler, rays: &mut RayCounts) -> Vec3 {
        self.follow(ray, surface, sampler, rays, 0)
    }

    fn follow(&self, ray: &Ray, surface: Surface, sampler: &mut Sampler, rays: &mut RayCounts, depth: u32) -> Vec3 {
        let mut shading = Shading::new(self.scene, surface, ray.direction);
        let mut beta = self.scene.transmittance(&shading.surface);
        let mut radiance = Vec3::ZERO;
        let mut path_length = shading.surface.t;
        // Only resolvable from afar: the first hit, or one seen through mirrors.
        let mut may_refine = depth == 0;
        // How the last glossy bounce may count what it meets by itself: its density, and from where.
        let mut glossy: Option<(Surface, f32)> = None;
        for bounce in 1..MAX_BOUNCES {
            sampler.start_bounce(bounce);
            let Shading { bsdf, .. } = shading;
            let known = self.known(&shading, path_length, may_refine);
            let needs_light = bsdf.has_diffuse() && known.is_none_or(|known| known.direct.is_none());
            if needs_light || bsdf.has_glossy() {
                let (diffuse, specular) = direct_light(self.scene, &shading, sampler.next_4d(), None, rays);
                radiance += beta * specular;
                if needs_light {
                    radiance += beta * diffuse;
                }
            }
            if needs_light && self.scene.features().emissive_unsampled {
                radiance += beta * unsampled_emission(self.scene, &shading, sampler.next_2d(), rays);
            }
            if let Some(known) = known {
                let irradiance = known.direct.unwrap_or_default() + known.indirect;
                radiance += beta * bsdf.diffuse * irradiance * std::f32::consts::FRAC_1_PI;
            } else if bsdf.has_diffuse() {
                radiance += beta * self.diffuse_bounce(&shading, beta, may_refine, depth, sampler, rays);
            }
            // The specular part goes on as a path.
            let u = sampler.next_4d();
            let Some(sample) = bsdf.sample(Lobes::SPECULAR, shading.wo, u[0], Vec2::new(u[1], u[2])) else {
                break;
            };
            beta *= sample.weight;
            if bounce >= ROULETTE_START {
                let survival = beta.max_element().min(0.95);
                if u[3] >= survival {
                    break;
                }
                beta /= survival;
            }
            let wi = shading.frame.to_world(sample.wi);
            if beta == Vec3::ZERO || !shading.leaves(wi, sample.wi) {
                break;
            }
            if !sample.delta {
                glossy = Some((shading.surface, sample.pdf));
                may_refine = false;
            } else if glossy.is_some() {
                // After a mirror nothing else could have found the light.
                glossy = Some((shading.surface, 0.0));
            }
            let next = shading.surface.spawn(wi);
            rays.path += 1;
            let Some(hit) = self.scene.intersect(&next) else {
                if let Some((_, pdf)) = glossy {
                    let weight = mis_weight(pdf, self.scene.lights().pdf_environment(wi));
                    radiance += beta * weight * self.scene.background(wi);
                }
                break;
            };
            let surface = self.scene.surface(&next, &hit);
            beta *= self.scene.transmittance(&surface);
            path_length = if sample.delta { path_length + surface.t } else { f32::INFINITY };
            if let Some((from, pdf)) = &glossy {
                let emission = self.scene.emission(&surface);
                if emission != Vec3::ZERO {
                    let light_pdf = self.scene.lights().pdf_surface(from.p, wi, &surface);
                    radiance += beta * mis_weight(*pdf, light_pdf) * emission;
                }
            }
            shading = Shading::new(self.scene, surface, wi);
        }
        radiance
    }

    /// What is known of the light on the diffuse part of a surface, if that is far enough to take it.
    fn known(&self, shading: &Shading, distance: f32, may_refine: bool) -> Option<Known> {
        if !shading.bsdf.has_diffuse() {
            return None;
        }
        let mut known = self.secondary.irradiance(&shading.surface)?;
        if self.samples_light {
            known.direct = None;
        }
        (!may_refine || distance >= known.resolution).then_some(known)
    }

    /// What the diffuse part reflects of light that was reflected before, one bounce further. `refines` says that the bounce was
    /// chosen for its resolution, so that the next one may be looked up; else nothing is known and roulette decides by what the path
    /// carries, `beta`: every lobe goes on, and only so the branches stay fewer than one for each.
    fn diffuse_bounce(
        &self,
        shading: &Shading,
        beta: Vec3,
        refines: bool,
        depth: u32,
        sampler: &mut Sampler,
        rays: &mut RayCounts,
    ) -> Vec3 {
        if depth >= MAX_DEPTH {
            return Vec3::ZERO;
        }
        let albedo = shading.bsdf.diffuse;
        let u = sampler.next_4d();
        let survival = if refines { 1.0 } else { (beta * albedo).max_element().min(MAX_SURVIVAL) };
        if u[2] >= survival {
            return Vec3::ZERO;
        }
        let caustic = self.secondary.caustic_irradiance(&shading.surface) * std::f32::consts::FRAC_1_PI;
        let wi_local = hemimap::square_to_cosine_hemisphere(Vec2::new(u[0], u[1]));
        let wi = shading.frame.to_world(wi_local);
        let mut incident = Vec3::ZERO;
        if shading.leaves(wi, wi_local) {
            let next = shading.surface.spawn(wi);
            rays.path += 1;
            if let Some(hit) = self.scene.intersect(&next) {
                let surface = self.scene.surface(&next, &hit);
                // A bounce of its own, so its numbers must not be those of this one.
                let mut own = sampler.split();
                incident = self.follow(&next, surface, &mut own, rays, depth + 1);
            }
        }
        albedo * (incident + caustic) / survival
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
    if scene.occluded(&surface.shadow_ray(light.wi, light.distance)) { nothing } else { (diffuse, specular) }
}

/// Direct light of sources that light sampling does not know, such as free forms that shine, reflected by the diffuse part: by one
/// cosine-distributed ray.
pub(crate) fn unsampled_emission(scene: &Scene, shading: &Shading, u: Vec2, rays: &mut RayCounts) -> Vec3 {
    let wi_local = hemimap::square_to_cosine_hemisphere(u);
    let wi = shading.frame.to_world(wi_local);
    if !shading.leaves(wi, wi_local) {
        return Vec3::ZERO;
    }
    let ray = shading.surface.spawn(wi);
    rays.path += 1;
    let Some(hit) = scene.intersect(&ray) else { return Vec3::ZERO };
    let surface = scene.surface(&ray, &hit);
    let emission = scene.emission(&surface);
    let known = emission == Vec3::ZERO || scene.lights().pdf_surface(shading.surface.p, wi, &surface) > 0.0;
    if known { Vec3::ZERO } else { shading.bsdf.diffuse * emission }
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
