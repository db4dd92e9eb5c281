//! The walk of light behind a gather ray: through mirrors, glass and gloss, and from diffuse surfaces of which nothing
//! is known, until roulette ends it. One loop for all who ask, and none that branches, so that no scene can outgrow the
//! stack of a thread.

use glam::{Vec2, Vec3, Vec3A};
use scene::{LightChoice, Lobes, Scene, SeenLights, Specular, Surface};

use crate::sampler::Sampler;
use crate::secondary::{DirectLight, LightWay, LightWays, Shading, light_candidates, mis_weight, unsampled_emission};
use crate::statistics::RayCounts;

/// From this bounce on, walks are ended by roulette, and from the other on even if nothing is absorbed, as inside of
/// glass: each time that such a walk is kept it counts more, so those that come out late are bright dots.
const ROULETTE_START: u32 = 3;
const LONG_WALK: u32 = 48;

/// No walk is longer, whatever the materials say.
const MAX_BOUNCES: u32 = 1000;

/// What a visitor knows of the light on the diffuse part of a surface, and has taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Taken {
    /// All of it.
    All,
    /// What was reflected or refracted before: direct light is still to be sampled.
    Indirect,
    /// Nothing.
    Nothing,
}

/// Who asks for the light at the end of a walk.
pub(crate) trait Visitor {
    /// Comes to a surface with a diffuse part, with throughput `beta`, and takes what is known of its light. `near` is
    /// the length of the way in metres, for what is known may be too coarse for a short one; infinite behind gloss and
    /// diffuse surfaces, where nothing is.
    fn visit(&mut self, shading: &Shading, beta: Vec3, near: f32) -> Taken;

    /// Says that what is added from now on came to the first surface along this local direction and was reflected there
    /// by these lobes, or `None` that it is sent everywhere alike.
    fn turn(&mut self, _way: Option<(Lobes, Vec3A)>) {}

    /// Adds radiance that reaches the start of the walk.
    fn add(&mut self, radiance: Vec3);

    /// Irradiance by caustics at a surface.
    fn caustic_irradiance(&self, surface: &Surface) -> Vec3;

    /// How lights of the scene are chosen, where something was learnt of that.
    fn light_choice(&self) -> Option<&LightChoice>;
}

/// Walks on from a surface that a ray met. Emission there is not counted, and neither is light that came to the surface
/// by mirrors or glass alone: that is the caustic of the point where the ray started.
pub(crate) fn walk(
    scene: &Scene,
    mut shading: Shading,
    sampler: &mut Sampler,
    rays: &mut RayCounts,
    visitor: &mut impl Visitor,
) {
    let mut beta = scene.transmittance(&shading.surface);
    let mut near = shading.surface.t;
    // Where the last glossy bounce was, and its density for each direction to lights there: what it meets counts beside
    // what these found.
    let mut glossy: Option<(Vec3A, f32)> = None;
    for bounce in 1..MAX_BOUNCES {
        let Shading { bsdf, .. } = shading;
        let taken = if bsdf.has_diffuse() { visitor.visit(&shading, beta, near) } else { Taken::All };
        if taken == Taken::All && bsdf.specular == Specular::None {
            break;
        }
        sampler.start_bounce(bounce);
        let candidates = light_candidates(scene, &shading);
        if taken != Taken::All || bsdf.has_glossy() {
            let lobes = if taken == Taken::All { Lobes::SPECULAR } else { Lobes::ALL };
            let ways = LightWays { count: candidates, choice: visitor.light_choice(), sky: None };
            let u = sampler.next_4d_for(candidates > 1 || scene.lights().has_choice());
            if let Some(LightWay { wi, value, .. }) = DirectLight::new(scene, &shading, lobes, ways).sample_way(u, rays)
            {
                if bounce == 1 {
                    visitor.turn(Some((lobes, wi)));
                }
                visitor.add(beta * value);
                if bounce == 1 {
                    visitor.turn(None);
                }
            }
        }
        if taken != Taken::All && scene.features().emissive_unsampled {
            visitor.add(beta * unsampled_emission(scene, &shading, sampler.next_pair(), rays));
        }
        let has_choice = bounce >= ROULETTE_START || bsdf.has_choice();
        let [mut u_lobe, u, v, u_roulette] = sampler.next_4d_for(has_choice);
        let mut lobe = Lobes::SPECULAR;
        if taken == Taken::Nothing {
            let caustic = visitor.caustic_irradiance(&shading.surface) * std::f32::consts::FRAC_1_PI;
            visitor.add(beta * bsdf.diffuse * caustic);
            // Only one way goes on where there are two, and the number that chose it is used again.
            let specular = bsdf.specular_probability(Lobes::ALL, shading.wo);
            if u_lobe < specular {
                u_lobe /= specular;
                beta /= specular;
            } else {
                lobe = Lobes::DIFFUSE;
                beta /= 1.0 - specular;
            }
        }
        let Some(sample) = bsdf.sample(lobe, shading.wo, u_lobe, Vec2::new(u, v)) else { break };
        beta *= sample.weight;
        if bounce >= ROULETTE_START {
            let limit = if bounce < LONG_WALK { 1.0 } else { 0.95 };
            let survival = beta.max_element().min(limit);
            if u_roulette >= survival {
                break;
            }
            beta /= survival;
        }
        if bounce == 1 && !sample.delta {
            visitor.turn(Some((lobe, sample.wi)));
        }
        let wi = shading.frame.to_world(sample.wi);
        if beta == Vec3::ZERO || !shading.leaves(wi, sample.wi) {
            break;
        }
        glossy = match (glossy, sample.delta) {
            // Light sampling and the caustics found all that the diffuse part sees by itself.
            _ if lobe == Lobes::DIFFUSE => None,
            (_, false) => Some((shading.surface.p, sample.pdf / candidates as f32)),
            // Behind a mirror nothing else could have found the light.
            (Some(_), true) => Some((shading.surface.p, 0.0)),
            (None, true) => None,
        };
        let next = shading.surface.spawn(wi);
        rays.path += 1;
        let Some(hit) = scene.intersect(&next) else {
            if let Some((from, pdf)) = glossy {
                let weight = mis_weight(pdf, lights_from(scene, from, visitor).pdf_environment(wi));
                visitor.add(beta * weight * scene.background(wi));
            }
            break;
        };
        let surface = scene.surface(&next, &hit);
        beta *= scene.transmittance(&surface);
        near = if sample.delta { near + surface.t } else { f32::INFINITY };
        if let Some((from, pdf)) = glossy {
            let emission = scene.emission(&surface);
            if emission != Vec3::ZERO {
                let weight = mis_weight(pdf, lights_from(scene, from, visitor).pdf_surface(wi, &surface));
                visitor.add(beta * weight * emission);
            }
        }
        shading = Shading::new(scene, surface, wi);
    }
}

/// The lights as gloss at a point chose them, for the density of what a ray from there met by chance.
fn lights_from<'a>(scene: &'a Scene, from: Vec3A, visitor: &'a impl Visitor) -> SeenLights<'a> {
    // The normal has no say in a density.
    scene.lights().seen_by(from, Vec3A::ZERO, visitor.light_choice())
}
