//! The first term of eq. 7: light that comes straight from the sources, by light sampling with MIS; and with the same
//! ray through the glossy lobe, the caustics and, where the lobe is too narrow for a texture, the indirect light that
//! it reflects.

use arrayvec::ArrayVec;
use glam::{UVec2, Vec3, Vec3A};
use scene::{LightChoice, Lobes, Scene, SeenLights, Specular, Surface};

use crate::delta_ways::{Way, delta_ways};
use crate::follower::{Follower, Reflection};
use crate::plan::Plan;
use crate::sampler::Sampler;
use crate::secondary::{DirectLight, LightWay, LightWays, Secondary, Shading, mis_weight, unsampled_emission};
use crate::shadows::Plane;
use crate::sky::SkySplit;
use crate::statistics::RayCounts;
use crate::terms::behind_glass::{LampBehind, lobe_share};
use crate::terms::guide::{Guide, LobeGuide};
use crate::terms::light_guide::{LightGuide, takes_guide};

/// Shades primary samples.
#[derive(Debug)]
pub(crate) struct DirectTerm<'a, S> {
    pub(crate) scene: &'a Scene,
    pub(crate) plan: &'a Plan,
    pub(crate) secondary: &'a S,
    pub(crate) sky: Option<&'a SkySplit>,
    /// From where glossy lobes are known to take their light.
    pub(crate) guide: Option<&'a LobeGuide>,
    /// Which lights are known to reach what the picture shows.
    pub(crate) light_guide: Option<&'a LightGuide>,
}

/// A direction in which a glossy lobe looks.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LobeWay {
    /// Local frame.
    pub(crate) wi: Vec3A,
    /// f cos over the density with which the direction was chosen; as long as nobody says else, by the lobe alone.
    pub(crate) weight: Vec3,
    /// Density with which the lobe alone chooses it, per steradian: what its light counts beside light sampling.
    pub(crate) pdf: f32,
}

/// Light of a primary sample.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Light {
    /// f L_d.
    pub(crate) direct: Vec3,
    /// f_s L_c, and f_s L_i where the lobe is traced.
    pub(crate) specular: Vec3,
}

/// What a lobe's sample sees: radiance along it, by the way that the light took.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sight {
    /// World frame.
    pub(crate) wi: Vec3A,
    /// `None` for the surroundings.
    pub(crate) met: Option<Shading>,
    /// Straight from a source.
    pub(crate) emitted: Vec3,
    /// From one by way of mirrors and glass alone.
    pub(crate) caustic: Caustic,
    /// All else that is reflected, where the lobe is traced.
    pub(crate) reflection: Reflection,
}

/// Radiance of the sources at the ends of chains of mirrors and glass.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Caustic {
    /// Of surfaces that shine.
    pub(crate) lamps: Vec3,
    pub(crate) surroundings: Vec3,
}

impl Sight {
    /// Radiance that is reflected to the lobe that looked.
    pub(crate) fn reflected(&self) -> Vec3 {
        self.caustic.lamps + self.caustic.surroundings + self.reflection.radiance()
    }

    /// Returns the radiance that is reflected to lobes that look here along other unit vectors, where this is not by way
    /// of mirrors or glass.
    pub(crate) fn reflected_along(&self) -> impl Fn(Vec3A) -> Vec3 {
        let towards = self.met.as_ref().map(|met| self.reflection.towards(met));
        move |wi| towards.as_ref().map_or(Vec3::ZERO, |towards| towards(-wi))
    }

    /// Returns what the lobe of `shading` that looked, with density `pdf`, counts of the light of lamps at the ends of
    /// chains, beside light samples that look for them.
    fn lamps<'a>(
        &self,
        scene: &Scene,
        shading: &Shading,
        lights: impl FnOnce() -> SeenLights<'a>,
        pdf: f32,
        rays: &mut RayCounts,
    ) -> Vec3 {
        let Caustic { lamps, .. } = self.caustic;
        let is_glass = self.met.is_some_and(|met| matches!(met.bsdf.specular, Specular::Dielectric { .. }));
        if lamps == Vec3::ZERO || !is_glass || !LampBehind::is_wanted(scene, shading) {
            return lamps;
        }
        lamps * lobe_share(LampBehind::new(scene, &shading.surface, self.wi, &lights(), rays), pdf)
    }

    /// Returns what a lobe that sees this too, along the unit vector `wi` which it takes with density `pdf`, counts of
    /// the light straight from the source beside samples of the `lights` that it sees.
    pub(crate) fn emitted_to<'a>(&self, lights: impl FnOnce() -> SeenLights<'a>, wi: Vec3A, pdf: f32) -> Vec3 {
        if self.emitted == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let light_pdf = match &self.met {
            Some(met) => lights().pdf_surface(wi, &met.surface),
            None => lights().pdf_environment(wi),
        };
        mis_weight(pdf, light_pdf) * self.emitted
    }
}

impl Light {
    pub(crate) fn add(&mut self, other: &Self) {
        self.direct += other.direct;
        self.specular += other.specular;
    }
}

impl<S: Secondary> DirectTerm<'_, S> {
    /// Samples the light at a point that the pixel at `position` sees. The soft part of the sky is left to textures for
    /// the diffuse lobe, not for the glossy one, which takes a share of its usual rays, up to 1, or is left to
    /// neighbours. Returns also the variance of the mean of the light samples, of R, G and B together: 0 of a single
    /// one, `None` where the light is known in closed form.
    pub(crate) fn sample(
        &self,
        shading: &Shading,
        position: UVec2,
        lobe_share: Option<f32>,
        plane: Option<&mut Plane>,
        sampler: &mut Sampler,
        rays: &mut RayCounts,
    ) -> (Light, Option<f32>) {
        let mut light = Light::default();
        let count = self.plan.samples.light_samples;
        let has_light_choice = self.scene.lights().has_choice();
        let ways = LightWays { count: 1, choice: self.light_choice(shading, position), sky: self.sky };
        let mut lights = DirectLight::new(self.scene, shading, Lobes::ALL, ways).on(plane);
        let (mut sum_sq, mut is_exact) = (0.0, false);
        let looks_on = LampBehind::is_wanted(self.scene, shading);
        for mut sampler in sampler.split_into(count) {
            if let Some(exact) = lights.exact() {
                (light.direct, sum_sq, is_exact) = (exact, 0.0, true);
                break;
            }
            // The light and the point on it from one block, so that samples are stratified on each light too.
            let Some(way) = lights.sample_way(sampler.next_4d_for(has_light_choice), rays) else { continue };
            light.direct += way.value / count as f32;
            sum_sq += (way.value.element_sum() / 3.0).powi(2);
            if way.is_hidden && looks_on {
                let behind = self.behind_glass(shading, &way, lights.lights(), &mut sampler, rays);
                light.specular += behind / count as f32;
            }
        }
        let mean = light.direct.element_sum() / 3.0;
        let variance = (sum_sq / count as f32 - mean * mean).max(0.0) / (count.max(2) - 1) as f32;
        if self.scene.features().emissive_unsampled && shading.bsdf.has_diffuse() {
            light.direct += unsampled_emission(self.scene, shading, sampler.next_pair(), rays);
            is_exact = false;
        }
        if let Some(share) = lobe_share.filter(|_| shading.bsdf.has_glossy()) {
            self.add_lobe(shading, position, share, sampler, rays, &mut light);
        }
        (light, (!is_exact).then_some(variance))
    }

    /// What is known of the lights at a surface that the pixel at `position` shows.
    fn light_choice(&self, shading: &Shading, position: UVec2) -> Option<&LightChoice> {
        self.light_guide.filter(|_| takes_guide(shading, self.sky))?.at(position, shading)
    }

    /// Returns the lights as a glossy surface that the pixel at `position` shows sees them when it samples them.
    pub(crate) fn lights_of_gloss(&self, shading: &Shading, position: UVec2) -> SeenLights<'_> {
        let Surface { p, n, .. } = shading.surface;
        self.scene.lights().seen_by(p, n, self.light_choice(shading, position))
    }

    /// Adds what the glossy lobe finds by its samples, of which half follow a guide if there is one.
    fn add_lobe(
        &self,
        shading: &Shading,
        position: UVec2,
        share: f32,
        sampler: &mut Sampler,
        rays: &mut RayCounts,
        light: &mut Light,
    ) {
        let count = self.plan.lobes.rays(shading, share);
        let guide = self.guide.filter(|_| self.plan.lobes.guides(shading, count));
        let guide = guide.and_then(|guide| guide.at(position, shading.surface.n));
        let guided = if guide.is_some() { count / 2 } else { 0 };
        // Density of all samples together.
        let density = |way: &LobeWay| {
            let by_guide = guide.map_or(0.0, |guide| guided as f32 * guide.pdf(way.wi));
            (count - guided) as f32 * way.pdf + by_guide
        };
        for mut sampler in sampler.split_into(count - guided) {
            let Some(mut way) = self.lobe_way(shading, &mut sampler) else { continue };
            way.weight *= if guided == 0 { 1.0 / count as f32 } else { way.pdf / density(&way) };
            light.add(&self.along_lobe(shading, position, &way, &mut sampler, rays));
        }
        let Some(guide) = guide else { return };
        for mut sampler in sampler.split_into(guided) {
            let Some(mut way) = guided_way(guide, shading, &mut sampler) else { continue };
            way.weight *= way.pdf / density(&way);
            light.add(&self.along_lobe(shading, position, &way, &mut sampler, rays));
        }
    }

    /// Samples the glossy lobe.
    pub(crate) fn lobe_way(&self, shading: &Shading, sampler: &mut Sampler) -> Option<LobeWay> {
        // A number is needed only where reflection and refraction could be chosen from.
        let sample = shading.bsdf.sample(Lobes::SPECULAR, shading.wo, 0.5, sampler.next_pair())?;
        let leaves = !sample.delta && shading.leaves(shading.frame.to_world(sample.wi), sample.wi);
        leaves.then_some(LobeWay { wi: sample.wi, weight: sample.weight, pdf: sample.pdf })
    }

    /// Returns the light that comes to a glossy lobe of the pixel at `position` along a direction.
    pub(crate) fn along_lobe(
        &self,
        shading: &Shading,
        position: UVec2,
        way: &LobeWay,
        sampler: &mut Sampler,
        rays: &mut RayCounts,
    ) -> Light {
        let sight = self.look_along(shading, way.wi, sampler, rays);
        self.light_of(shading, position, way, &sight, rays)
    }

    /// Returns the light by what a sample of the lobe sees.
    pub(crate) fn light_of(
        &self,
        shading: &Shading,
        position: UVec2,
        way: &LobeWay,
        sight: &Sight,
        rays: &mut RayCounts,
    ) -> Light {
        let lights = || self.lights_of_gloss(shading, position);
        let emitted = sight.emitted_to(lights, sight.wi, way.pdf);
        let lamps = sight.lamps(self.scene, shading, lights, way.pdf, rays);
        let reflected = lamps + sight.caustic.surroundings + sight.reflection.radiance();
        Light { direct: way.weight * emitted, specular: way.weight * reflected }
    }

    /// Returns what the glossy lobe reflects of a lamp towards which a light sample met glass.
    fn behind_glass(
        &self,
        shading: &Shading,
        way: &LightWay<'_>,
        lights: &SeenLights<'_>,
        sampler: &mut Sampler,
        rays: &mut RayCounts,
    ) -> Vec3 {
        /// Where gloss reflects a smaller share of what comes from there, it is looked for as seldom as that is less.
        const WORTH: f32 = 0.5;
        let Shading { bsdf, wo, .. } = shading;
        let (f, lobe_pdf) = bsdf.eval_pdf(Lobes::SPECULAR, *wo, way.wi);
        let all = f + bsdf.eval(Lobes::DIFFUSE, *wo, way.wi);
        let survival = (f.max_element() / (WORTH * all.max_element())).min(1.0);
        if f == Vec3::ZERO || sampler.next_pair().x >= survival {
            return Vec3::ZERO;
        }
        let wi = way.light.wi();
        let lamp = LampBehind::new(self.scene, &shading.surface, wi, lights, rays);
        let Some(lamp) = lamp.filter(|lamp| lamp.light == way.light.light()) else { return Vec3::ZERO };
        let met = Shading::new(self.scene, lamp.glass, wi);
        let lamps = self.caustic_from(met, sampler, rays).lamps;
        f * lamps * (way.wi.z * mis_weight(lamp.pdf, lobe_pdf) / (lamp.pdf * survival))
    }

    /// Returns what a glossy lobe sees along the local direction `wi`.
    pub(crate) fn look_along(
        &self,
        shading: &Shading,
        wi: Vec3A,
        sampler: &mut Sampler,
        rays: &mut RayCounts,
    ) -> Sight {
        let wi = shading.frame.to_world(wi);
        let ray = shading.surface.spawn(wi);
        rays.path += 1;
        let Some(hit) = self.scene.intersect(&ray) else {
            let emitted = self.scene.background(wi);
            return Sight { wi, met: None, emitted, caustic: Caustic::default(), reflection: Reflection::DARK };
        };
        let met = Shading::new(self.scene, self.scene.surface(&ray, &hit), wi);
        let emitted = self.scene.emission(&met.surface) * self.scene.transmittance(&met.surface);
        let has_caustic = self.scene.features().delta;
        let caustic = if has_caustic { self.caustic_from(met, sampler, rays) } else { Caustic::default() };
        let reflection = if self.plan.lobes.traces(shading) {
            let follower = Follower { scene: self.scene, secondary: self.secondary, spread: shading.lobe_alpha() };
            follower.reflection(met, sampler, rays)
        } else {
            Reflection::DARK
        };
        Sight { wi, met: Some(met), emitted, caustic, reflection }
    }

    /// Radiance of the sources at the ends of chains of mirrors and glass that start at a surface that a ray met: L_c
    /// along the ray. Black where it is anything else.
    fn caustic_from(&self, met: Shading, sampler: &mut Sampler, rays: &mut RayCounts) -> Caustic {
        /// Surfaces of a chain from which both ways are followed: one chosen by its share would find a lamp that glass
        /// mirrors seldom, and then all of it.
        const SPLITS: usize = 2;
        /// Ways behind the first surface that carry less are followed as seldom as they carry less, for glass may keep
        /// them long.
        const MIN_THROUGHPUT: f32 = 0.2;
        const MAX_CHAIN: usize = 64;
        if !met.bsdf.has_delta() {
            return Caustic::default();
        }
        let mut sampler = sampler.split();
        let mut sum = Caustic::default();
        // Where chains go on: the throughput, the part of it by which radiance changes in glass, the number of
        // surfaces.
        let mut stack = ArrayVec::<(Shading, Vec3, f32, usize), { SPLITS + 1 }>::new();
        stack.push((met, self.scene.transmittance(&met.surface), 1.0, 0));
        while let Some((shading, beta, radiance_scale, length)) = stack.pop() {
            let survival = |way: &Way| if length > 0 { (way.flux() / MIN_THROUGHPUT).min(1.0) } else { 1.0 };
            for way in delta_ways(&shading, beta, radiance_scale, length < SPLITS, survival, &mut sampler) {
                let Way { ray, mut beta, radiance_scale, .. } = way;
                rays.path += 1;
                let Some(hit) = self.scene.intersect(&ray) else {
                    sum.surroundings += beta * self.scene.background(ray.direction);
                    continue;
                };
                let surface = self.scene.surface(&ray, &hit);
                beta *= self.scene.transmittance(&surface);
                sum.lamps += beta * self.scene.emission(&surface);
                let next = Shading::new(self.scene, surface, ray.direction);
                if next.bsdf.has_delta() && length + 1 < MAX_CHAIN {
                    stack.push((next, beta, radiance_scale, length + 1));
                }
            }
        }
        sum
    }
}

/// Chooses a direction of the lobe by a guide.
pub(crate) fn guided_way(guide: &Guide, shading: &Shading, sampler: &mut Sampler) -> Option<LobeWay> {
    let wi = guide.sample(sampler.next_pair());
    let (f, pdf) = shading.bsdf.eval_pdf(Lobes::SPECULAR, shading.wo, wi);
    let leaves = pdf > 0.0 && shading.leaves(shading.frame.to_world(wi), wi);
    leaves.then(|| LobeWay { wi, weight: f * (wi.z / pdf), pdf })
}

#[cfg(test)]
pub(crate) mod tests {
    use glam::{UVec2, Vec3, Vec3A};
    use scene::{Description, Material, Mesh, Ray, SpecularKind, fresnel_dielectric};

    use super::*;
    use crate::secondary::tests::{lamp_over_metal, square};
    use crate::terms::reuse::tests::{mean, variance};
    use crate::{NoSecondary, Settings};

    pub(crate) fn term<'a>(scene: &'a Scene, plan: &'a Plan) -> DirectTerm<'a, NoSecondary> {
        DirectTerm { scene, plan, secondary: &NoSecondary, sky: None, guide: None, light_guide: None }
    }

    #[test]
    fn a_share_of_a_lobes_rays_finds_its_light() {
        let scene = lamp_over_metal(0.1);
        let plan = Plan::new(&scene, &Settings::default());
        let term = term(&scene, &plan);
        // Its mirrored ray meets the lamp.
        let ray = Ray::new(Vec3A::new(1.5, 1.0, 0.0), Vec3A::new(-0.6, -0.8, 0.0));
        let shading = Shading::new(&scene, scene.surface(&ray, &scene.intersect(&ray).unwrap()), ray.direction);
        // Mean and the variance of it, and rays.
        let found = |share: f32| {
            let mut rays = RayCounts::default();
            let values: Vec<f64> = (0..2000)
                .map(|pixel| {
                    let mut sampler = Sampler::new(1, pixel, 0);
                    let (light, _) = term.sample(&shading, UVec2::ZERO, Some(share), None, &mut sampler, &mut rays);
                    f64::from(light.direct.x)
                })
                .collect();
            (mean(&values), variance(&values) / 2000.0, rays.path)
        };
        let (usual, few) = (found(1.0), found(0.1));
        assert!((usual.0 - few.0).abs() < 4.0 * (usual.1 + few.1).sqrt(), "{} instead of {}", few.0, usual.0);
        assert!(5 * few.2 < usual.2, "{} rays, {} usually", few.2, usual.2);
    }

    #[test]
    fn gloss_sees_a_lamp_mirrored_in_glass() {
        // A look straight down at glass, of one face or of two, over which a lamp hangs.
        let kind = SpecularKind::Dielectric { ior: 1.5, tint: Vec3::ONE, absorption: Vec3::ZERO, priority: 0 };
        let glass = Material { diffuse: Vec3::ZERO, specular: kind, ..Material::default() };
        let lit = Material { diffuse: Vec3::ZERO, emission: Vec3::ONE, ..Material::default() };
        let seen = |faces: usize| -> Vec<f32> {
            // The lamp and the lower face look down.
            let mut triangles = vec![[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6], [8, 9, 10], [8, 10, 11]];
            triangles.truncate(2 + 2 * faces);
            let mesh = Mesh {
                positions: [square(0.2, 1.0), square(5.0, 0.0), square(5.0, -0.1)].concat(),
                materials: [vec![1, 1], vec![0; 2 * faces]].concat(),
                triangles,
                ..Mesh::default()
            };
            let materials = vec![glass.clone(), lit.clone()];
            let scene = Scene::new(Description { meshes: vec![mesh], materials, ..Description::default() }).unwrap();
            let plan = Plan::new(&scene, &Settings::default());
            let term = term(&scene, &plan);
            let ray = Ray::new(Vec3A::new(0.0, 0.9, 0.0), Vec3A::NEG_Y);
            let met = Shading::new(&scene, scene.surface(&ray, &scene.intersect(&ray).unwrap()), ray.direction);
            let sample =
                |number| term.caustic_from(met, &mut Sampler::new(1, number, 0), &mut RayCounts::default()).lamps.x;
            (0..4000).map(sample).collect()
        };
        let r = fresnel_dielectric(1.0, 1.5);
        assert!(seen(1).into_iter().all(|light| (light - r).abs() < 1e-6), "one face in every sample");
        // All orders between the two faces.
        let pane = seen(2);
        let mean = pane.iter().sum::<f32>() / 4000.0;
        let expected = 2.0 * r / (1.0 + r);
        assert!((mean / expected - 1.0).abs() < 0.05, "{mean} by two, not {expected}");
        let brightest = pane.into_iter().fold(0.0, f32::max);
        assert!(brightest < 8.0 * r, "no dots: {brightest}");
    }

    #[test]
    fn samples_are_stratified_on_each_of_several_lamps() {
        // Two lamps over a floor, each half hidden behind a plate.
        let lamp = |x: f32| square(0.2, 1.0).map(|p| p + x * Vec3::X);
        let plate = |x: f32| [(0.0, -1.0), (0.4, -1.0), (0.4, 1.0), (0.0, 1.0)].map(|(w, z)| Vec3::new(x + w, 0.9, z));
        let corners = [0u32, 4, 8, 12, 16];
        let mesh = Mesh {
            positions: [square(5.0, 0.0), lamp(-1.0), lamp(1.0), plate(-0.9), plate(0.5)].concat(),
            triangles: corners.iter().flat_map(|i| [[*i, i + 1, i + 2], [*i, i + 2, i + 3]]).collect(),
            materials: vec![0, 0, 1, 1, 1, 1, 0, 0, 0, 0],
            ..Mesh::default()
        };
        let grey = Material { diffuse: Vec3::splat(0.5), ..Material::default() };
        let lit = Material { diffuse: Vec3::ZERO, emission: Vec3::ONE, ..Material::default() };
        let scene =
            Scene::new(Description { meshes: vec![mesh], materials: vec![grey, lit], ..Description::default() })
                .unwrap();
        let ray = Ray::new(Vec3A::new(0.0, 0.5, 0.0), Vec3A::NEG_Y);
        let shading = Shading::new(&scene, scene.surface(&ray, &scene.intersect(&ray).unwrap()), ray.direction);
        let noise = |count: u32| {
            let mut plan = Plan::new(&scene, &Settings::default());
            plan.samples.light_samples = count;
            let term = term(&scene, &plan);
            let values: Vec<f64> = (0..400)
                .map(|pixel| {
                    let mut sampler = Sampler::new(1, pixel, 0);
                    let (light, _) =
                        term.sample(&shading, UVec2::ZERO, Some(1.0), None, &mut sampler, &mut RayCounts::default());
                    f64::from(light.direct.x)
                })
                .collect();
            let mean = mean(&values);
            assert!(mean > 0.0, "half of the lamps is seen");
            variance(&values) / (mean * mean)
        };
        // The noise of the choice alone falls with the square of the number. Points that are independent on each lamp
        // would still have the variance of half a lamp, 1 relative, over 64.
        assert!(noise(1) > 0.5, "one sample sees a lamp or does not");
        assert!(noise(64) < 0.25 / 64.0, "{}", noise(64));
    }
}
