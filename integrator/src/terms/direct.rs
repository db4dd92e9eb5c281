//! The first term of eq. 7: light that comes straight from the sources, by light sampling with MIS; and with the same ray through
//! the glossy lobe, the caustics and, where the lobe is too narrow for a texture, the indirect light that it reflects.

use glam::{Vec2, Vec3};
use scene::{Lobes, Ray, Scene, Specular, Surface};

use crate::plan::Plan;
use crate::sampler::Sampler;
use crate::secondary::{Follower, Secondary, Shading, direct_light, mis_weight, unsampled_emission};
use crate::sky::SkySplit;
use crate::statistics::RayCounts;

/// Shades primary samples.
#[derive(Debug)]
pub(crate) struct DirectTerm<'a, S> {
    pub(crate) scene: &'a Scene,
    pub(crate) plan: &'a Plan,
    pub(crate) secondary: &'a S,
    pub(crate) sky: Option<&'a SkySplit>,
}

/// Light of a primary sample.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Light {
    /// f L_d.
    pub(crate) direct: Vec3,
    /// f_s L_c, and f_s L_i where the lobe is traced.
    pub(crate) specular: Vec3,
}

impl<S: Secondary> DirectTerm<'_, S> {
    /// Samples the light at a point. The soft part of the sky is left to textures for the diffuse lobe, not for the glossy one.
    pub(crate) fn sample(&self, shading: &Shading, sampler: &mut Sampler, rays: &mut RayCounts) -> Light {
        let mut light = Light::default();
        let count = self.plan.light_samples;
        let has_many_lights = self.scene.lights().count() > 1;
        for mut sampler in sampler.split_into(count) {
            // The best stratified pair is for the point of the light.
            let point = sampler.next_pair();
            let choice = if has_many_lights { sampler.next_1d() } else { 0.5 };
            let u = [choice, point.x, point.y, 0.0];
            let (diffuse, specular) = direct_light(self.scene, shading, u, self.sky, rays);
            light.direct += (diffuse + specular) / count as f32;
        }
        if self.scene.features().emissive_unsampled && shading.bsdf.has_diffuse() {
            light.direct += unsampled_emission(self.scene, shading, sampler.next_2d(), rays);
        }
        if shading.bsdf.has_glossy() {
            let count = lobe_rays(shading, self.plan);
            for mut sampler in sampler.split_into(count) {
                self.add_lobe(shading, 1.0 / count as f32, &mut sampler, rays, &mut light);
            }
        }
        light
    }

    /// Follows one sample of the glossy lobe, which counts for a share of the light.
    fn add_lobe(&self, shading: &Shading, share: f32, sampler: &mut Sampler, rays: &mut RayCounts, light: &mut Light) {
        // A number is needed only where reflection and refraction could be chosen from.
        let Some(mut sample) = shading.bsdf.sample(Lobes::SPECULAR, shading.wo, 0.5, sampler.next_pair()) else {
            return;
        };
        sample.weight *= share;
        let wi = shading.frame.to_world(sample.wi);
        if sample.delta || !shading.leaves(wi, sample.wi) {
            return;
        }
        let ray = shading.surface.spawn(wi);
        rays.path += 1;
        let Some(hit) = self.scene.intersect(&ray) else {
            let weight = mis_weight(sample.pdf, self.scene.lights().pdf_environment(wi));
            light.direct += sample.weight * weight * self.scene.background(wi);
            return;
        };
        let surface = self.scene.surface(&ray, &hit);
        let emission = self.scene.emission(&surface);
        if emission != Vec3::ZERO {
            let light_pdf = self.scene.lights().pdf_surface(shading.surface.p, wi, &surface);
            let through = self.scene.transmittance(&surface);
            light.direct += sample.weight * through * mis_weight(sample.pdf, light_pdf) * emission;
        }
        if self.scene.features().delta {
            light.specular += sample.weight * self.caustic_along(ray, surface, sampler, rays);
        }
        if is_traced(shading, self.plan) {
            let follower = Follower { scene: self.scene, secondary: self.secondary, spread: alpha(shading) };
            light.specular += sample.weight * follower.reflected(&ray, surface, sampler, rays);
        }
    }

    /// Radiance of the source at the end of a chain of mirrors and glass that starts at `surface`: L_c along the ray. Black where it
    /// starts at anything else.
    fn caustic_along(&self, ray: Ray, surface: Surface, sampler: &mut Sampler, rays: &mut RayCounts) -> Vec3 {
        const MAX_CHAIN: usize = 64;
        let mut sampler = sampler.split();
        let mut beta = self.scene.transmittance(&surface);
        let mut shading = Shading::new(self.scene, surface, ray.direction);
        for _ in 0..MAX_CHAIN {
            let u = sampler.next_1d();
            if !shading.bsdf.is_delta() {
                break;
            }
            let Some(sample) = shading.bsdf.sample(Lobes::SPECULAR, shading.wo, u, Vec2::splat(0.5)) else { break };
            let wi = shading.frame.to_world(sample.wi);
            beta *= sample.weight;
            let ray = shading.surface.spawn(wi);
            rays.path += 1;
            let Some(hit) = self.scene.intersect(&ray) else { return beta * self.scene.background(wi) };
            let surface = self.scene.surface(&ray, &hit);
            beta *= self.scene.transmittance(&surface);
            let emission = self.scene.emission(&surface);
            if emission != Vec3::ZERO {
                return beta * emission;
            }
            shading = Shading::new(self.scene, surface, wi);
        }
        Vec3::ZERO
    }
}

/// Whether the glossy lobe of a point is traced, not read from a texture. Where there is a diffuse part too, a texture would serve the lobe alone, for
/// that part is interpolated.
pub(crate) fn is_traced(shading: &Shading, plan: &Plan) -> bool {
    shading.bsdf.has_glossy() && (shading.bsdf.has_diffuse() || alpha(shading) < plan.texture_alpha)
}

/// How many rays a primary sample traces through its glossy lobe: fewer where the lobe is a small part of the reflected light, or so narrow that it
/// sees about the same everywhere; one for the lamps alone where a texture has the rest.
fn lobe_rays(shading: &Shading, plan: &Plan) -> u32 {
    /// From this width on a lobe takes its full number.
    const FULL_ALPHA: f32 = 0.1;
    if !is_traced(shading, plan) {
        return 1;
    }
    let share = shading.bsdf.specular_probability(Lobes::ALL, shading.wo) * (alpha(shading) / FULL_ALPHA).min(1.0);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most the plan's number")]
    let count = (plan.lobe_rays as f32 * share).ceil() as u32;
    count.max(1)
}

/// The roughness of a glossy lobe, which is about its width in radians; 0 where there is none.
fn alpha(shading: &Shading) -> f32 {
    if let Specular::Ggx { alpha, .. } = shading.bsdf.specular { alpha } else { 0.0 }
}
