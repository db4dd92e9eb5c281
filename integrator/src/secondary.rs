//! The light at a surface: what a photon map or any other solution knows of it, and what comes straight from lights, by
//! light samples.

use glam::{Vec2, Vec3, Vec3A};
use hemimap::Frame;
use scene::{Bsdf, LightChoice, LightDirection, LightSample, Lights, Lobes, Ray, Scene, SeenLights, Specular, Surface};

use crate::shadows::{Plane, is_hidden};
use crate::sky::SkySplit;
use crate::statistics::RayCounts;
use crate::{Glint, Irradiance};

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

    /// One of two parts of [`Self::caustic_irradiance`], which is this over [`Self::caustic_coverage`]: what can be
    /// asked for many places of a pixel. Its radius is about the least length, metres, over which caustics change on
    /// any place of the surface that is at most `reach` away, or any that is at most `fine`; 0 where that is not known.
    fn covered_caustic_irradiance(&self, surface: &Surface, _reach: f32, _fine: f32) -> Irradiance {
        Irradiance { irradiance: self.caustic_irradiance(surface), radius: 0.0 }
    }

    /// The other part, which takes longer and changes little from one place to the next: the share of the surroundings
    /// over which caustics were blurred that is surface, in (0, 1]; as exactly as one sees it in the picture if it is to
    /// be `_precise`.
    fn caustic_coverage(&self, _: &Surface, _precise: bool) -> f32 {
        1.0
    }

    /// The same at surfaces that gather rays meet, where it need not be as exact; by a quicker way if there is one.
    fn quick_caustic_irradiance(&self, surface: &Surface) -> Vec3 {
        self.caustic_irradiance(surface)
    }

    /// What is so bright around a surface that much of its indirect light comes by few directions: gathers look there
    /// with more rays. Empty where light comes from everywhere.
    fn glints(&self, _: &Surface) -> &[Glint] {
        &[]
    }

    /// How lights of the scene are chosen at surfaces that gather rays meet, where something was learnt of that.
    fn light_choice(&self) -> Option<&LightChoice> {
        None
    }
}

/// Knows nothing: every path goes on by itself. Caustics, which no path looks for, are black.
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

    /// Whether a world direction really leaves on the side to which the local one points: a shading normal may say
    /// otherwise.
    pub(crate) fn leaves(&self, wi: Vec3A, wi_local: Vec3A) -> bool {
        wi.dot(self.surface.ng) * wi_local.z > 0.0
    }

    /// The roughness of the glossy lobe, which is about its width in radians; 0 where there is none.
    pub(crate) fn lobe_alpha(&self) -> f32 {
        if let Specular::Ggx { alpha, .. } = self.bsdf.specular { alpha } else { 0.0 }
    }

    /// A ray from the surface with a density of cos(theta) / pi; `None` where it would leave on the wrong side.
    pub(crate) fn cosine_ray(&self, u: Vec2) -> Option<Ray> {
        let wi_local = hemimap::square_to_cosine_hemisphere(u);
        let wi = self.frame.to_world(wi_local);
        self.leaves(wi, wi_local).then(|| self.surface.spawn(wi))
    }
}

/// Returns from how many directions to lights [`direct_light`] should choose for a surface behind the first: several
/// where a lamp may lie in a lobe so narrow that one says little of it, and so wide that the lobe's own samples say
/// little either.
pub(crate) fn light_candidates(scene: &Scene, shading: &Shading) -> u32 {
    /// For a surface that reflects by this lobe alone.
    const CANDIDATES: f32 = 8.0;
    const ALPHAS: std::ops::Range<f32> = 0.02..0.5;
    /// So many alphas from the mirrored direction a lobe has about a tenth of its peak.
    const LOBE_END: f32 = 3.0;
    let Shading { surface, frame, bsdf, wo } = shading;
    let Specular::Ggx { alpha, .. } = bsdf.specular else { return 1 };
    let features = scene.features();
    let has_extent = features.area_lights || features.environment;
    if !has_extent || !ALPHAS.contains(&alpha) {
        return 1;
    }
    if let Some((axis, half_angle)) = scene.lights().cone(surface.p) {
        let mirrored = frame.to_world(Vec3A::new(-wo.x, -wo.y, wo.z));
        if mirrored.dot(axis).clamp(-1.0, 1.0).acos() > half_angle + LOBE_END * alpha {
            return 1;
        }
    }
    let share = bsdf.specular_probability(Lobes::ALL, *wo);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most CANDIDATES")]
    let count = (CANDIDATES * share).ceil() as u32;
    count.max(1)
}

/// How [`direct_light`] looks for lights.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LightWays<'a> {
    /// Directions to weigh.
    pub(crate) count: u32,
    /// What is known of the lights around there.
    pub(crate) choice: Option<&'a LightChoice>,
    /// With it, only the hard part of the surroundings counts for the diffuse part.
    pub(crate) sky: Option<&'a SkySplit>,
}

/// The lights to sample for a surface. Where the glossy part is wanted too, their density must be that of the other
/// technique's weight.
pub(crate) fn lights_of<'a>(scene: &'a Scene, shading: &Shading, sky: Option<&'a SkySplit>) -> &'a Lights {
    sky.filter(|_| !shading.bsdf.has_glossy()).map_or(scene.lights(), SkySplit::lights)
}

/// Light that arrives straight from the sources and is reflected to the viewer: by the diffuse part, and by the glossy
/// part under the power heuristic with sampling of that lobe.
///
/// Of several directions to lights one is traced, chosen by what it would bring. All of them count against the samples
/// of the lobe, whose weight must be taken against their number times the density of the lights. The four numbers `u`
/// choose the light, the direction, and which of them is traced.
///
/// # Source
/// Talbot, Cline, Egbert 2005: Importance Resampling for Global Illumination.
pub(crate) fn direct_light(
    scene: &Scene,
    shading: &Shading,
    lobes: Lobes,
    ways: LightWays<'_>,
    u: [f32; 4],
    rays: &mut RayCounts,
) -> Vec3 {
    DirectLight::new(scene, shading, lobes, ways).sample(u, rays)
}

/// [`direct_light`] for whoever takes several samples of one point.
#[derive(Debug)]
pub(crate) struct DirectLight<'a> {
    scene: &'a Scene,
    shading: &'a Shading,
    lobes: Lobes,
    ways: LightWays<'a>,
    lights: SeenLights<'a>,
    plane: Option<&'a mut Plane>,
}

/// A sample of direct light.
#[derive(Debug)]
pub(crate) struct LightWay<'a> {
    pub(crate) light: LightDirection<'a>,
    /// Local frame.
    pub(crate) wi: Vec3A,
    /// What it brings.
    pub(crate) value: Vec3,
    /// Whether that is nothing because something stands between.
    pub(crate) is_hidden: bool,
}

impl<'a> DirectLight<'a> {
    pub(crate) fn new(scene: &'a Scene, shading: &'a Shading, lobes: Lobes, ways: LightWays<'a>) -> Self {
        let Surface { p, n, .. } = shading.surface;
        let lights = lights_of(scene, shading, ways.sky);
        let lights = lights.seen_by(p, n, ways.choice);
        Self { scene, shading, lobes, ways, lights, plane: None }
    }

    /// Tells in which plane the surface lies.
    pub(crate) fn on(self, plane: Option<&'a mut Plane>) -> Self {
        Self { plane, ..self }
    }

    /// Returns the light of an only lamp in closed form, if it is known.
    #[inline]
    pub(crate) fn exact(&self) -> Option<Vec3> {
        let Self { scene, shading: Shading { surface, bsdf, .. }, lobes, plane, .. } = self;
        debug_assert!(lobes.contains(Lobes::DIFFUSE), "that is what has a closed form");
        let plane = plane.as_ref().filter(|_| !bsdf.has_glossy())?;
        Some(bsdf.diffuse * (plane.irradiance(scene, surface)? * std::f32::consts::FRAC_1_PI))
    }

    /// Takes one sample.
    #[inline]
    pub(crate) fn sample(&mut self, u: [f32; 4], rays: &mut RayCounts) -> Vec3 {
        self.sample_way(u, rays).map_or(Vec3::ZERO, |way| way.value)
    }

    /// The lights as the point sees them.
    pub(crate) const fn lights(&self) -> &SeenLights<'a> {
        &self.lights
    }

    /// Takes one sample, and returns how, too.
    #[inline]
    pub(crate) fn sample_way(&mut self, u: [f32; 4], rays: &mut RayCounts) -> Option<LightWay<'a>> {
        if !self.shading.bsdf.scatters(self.lobes) {
            return None;
        }
        let (light, wi, value) = if self.ways.count > 1 {
            let (light, wi, value) = self.pick(u)?;
            (light, wi, Some(value))
        } else {
            let (light, wi) = self.choose(u[0], Vec2::new(u[1], u[2]))?;
            (light, wi, None)
        };
        let surface = &self.shading.surface;
        let plane = self.plane.as_deref_mut();
        if is_hidden(self.scene, surface, &light, plane, rays) {
            return Some(LightWay { light, wi, value: Vec3::ZERO, is_hidden: true });
        }
        let value = value.unwrap_or_else(|| self.value(&light, wi));
        let value = value * self.scene.transmittance_within(surface.media, light.distance());
        Some(LightWay { light, wi, value, is_hidden: false })
    }

    /// Chooses one of several directions by what they would bring.
    fn pick(&mut self, u: [f32; 4]) -> Option<(LightDirection<'a>, Vec3A, Vec3)> {
        /// A sequence of low discrepancy (Roberts 2018).
        const STEP: Vec2 = Vec2::new(0.754_877_7, 0.569_840_3);
        let count = self.ways.count;
        let mut total = 0.0;
        let mut u_pick = u[3];
        let mut picked = None;
        for number in 0..count {
            let number = number as f32;
            let u_choice = (u[0] + number / count as f32).fract();
            let u_direction = (Vec2::new(u[1], u[2]) + number * STEP).fract();
            let Some((light, wi)) = self.choose(u_choice, u_direction) else { continue };
            let value = self.value(&light, wi);
            let weight = value.max_element();
            if weight == 0.0 {
                continue;
            }
            total += weight;
            // What is left of the number is uniform again.
            let share = weight / total;
            if u_pick < share {
                picked = Some((light, wi, value, weight));
                u_pick /= share;
            } else {
                u_pick = (u_pick - share) / (1.0 - share);
            }
        }
        picked.map(|(light, wi, value, weight)| (light, wi, value * (total / weight)))
    }

    /// Returns a direction to a light, local too; `None` where nothing can come from there.
    #[inline]
    fn choose(&mut self, u_choice: f32, u_direction: Vec2) -> Option<(LightDirection<'a>, Vec3A)> {
        let light = self.lights.direction(u_choice, u_direction)?;
        let wi = self.shading.frame.to_local(light.wi());
        (wi.z > 0.0 && self.shading.leaves(light.wi(), wi)).then_some((light, wi))
    }

    /// Returns what a direction would bring as one of `ways.count` where nothing stands between.
    #[inline]
    fn value(&self, light: &LightDirection<'_>, wi: Vec3A) -> Vec3 {
        let Shading { bsdf, wo, .. } = self.shading;
        let LightWays { count, sky, .. } = self.ways;
        let Some(light) = light.sample() else { return Vec3::ZERO };
        let one_of_all = LightSample { pdf: light.pdf * count as f32, ..light };
        let value = unshadowed(bsdf, self.lobes, *wo, wi, &one_of_all, sky);
        let weight = value.max_element();
        if weight > 0.0 && weight.is_finite() { value } else { Vec3::ZERO }
    }
}

/// Direct light of sources that light sampling does not know, which are free forms without bounds, reflected by the
/// diffuse part: by one cosine-distributed ray.
pub(crate) fn unsampled_emission(scene: &Scene, shading: &Shading, u: Vec2, rays: &mut RayCounts) -> Vec3 {
    let Some(ray) = shading.cosine_ray(u) else { return Vec3::ZERO };
    rays.path += 1;
    let Some(hit) = scene.intersect(&ray) else { return Vec3::ZERO };
    let surface = scene.surface(&ray, &hit);
    let emission = scene.emission(&surface);
    let known = emission == Vec3::ZERO || scene.lights().pdf_surface(shading.surface.p, ray.direction, &surface) > 0.0;
    if known { Vec3::ZERO } else { shading.bsdf.diffuse * emission * scene.transmittance(&surface) }
}

/// Light of a sample that the lobes reflect where nothing stands between.
pub(crate) fn unshadowed(
    bsdf: &Bsdf,
    lobes: Lobes,
    wo: Vec3A,
    wi: Vec3A,
    light: &LightSample,
    sky: Option<&SkySplit>,
) -> Vec3 {
    let factor = wi.z / light.pdf;
    let is_sky = light.distance.is_infinite() && !light.delta;
    let mut value = Vec3::ZERO;
    if lobes.contains(Lobes::DIFFUSE) && bsdf.has_diffuse() {
        let radiance = match sky {
            Some(sky) if is_sky => sky.hard(light.radiance),
            _ => light.radiance,
        };
        value = bsdf.eval(Lobes::DIFFUSE, wo, wi) * radiance * factor;
    }
    if lobes.contains(Lobes::SPECULAR) && bsdf.has_glossy() {
        let (f, pdf) = bsdf.eval_pdf(Lobes::SPECULAR, wo, wi);
        let weight = if light.delta { 1.0 } else { mis_weight(light.pdf, pdf) };
        value += f * light.radiance * (factor * weight);
    }
    value
}

/// Power heuristic for a sample of density `taken` that the other technique would take with density `other` (Veach
/// 1997); 1 for a delta direction, whose density is given as 0, and which no other technique can take.
pub(crate) fn mis_weight(taken: f32, other: f32) -> f32 {
    if taken == 0.0 || other == 0.0 {
        return 1.0;
    }
    let ratio = other / taken;
    1.0 / (1.0 + ratio * ratio)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::Rng;
    use scene::{Description, Material, Mesh, SpecularKind};

    /// The corners of a level square, from its middle over or under the origin half a side to each side.
    pub(crate) fn square(half: f32, y: f32) -> [Vec3; 4] {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, z)| Vec3::new(half * x, y, half * z))
    }

    /// A lamp of 0.4 m x 0.4 m at a height of 1 m over a floor of metal.
    pub(crate) fn lamp_over_metal(alpha: f32) -> Scene {
        let mesh = Mesh {
            positions: [square(5.0, 0.0), square(0.2, 1.0)].concat(),
            triangles: vec![[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]],
            materials: vec![0, 0, 1, 1],
            ..Mesh::default()
        };
        let specular = SpecularKind::Ggx { alpha, reflectance: Vec3::ONE, schlick: false };
        let metal = Material { diffuse: Vec3::ZERO, specular, ..Material::default() };
        let lamp = Material { diffuse: Vec3::ZERO, emission: Vec3::ONE, ..Material::default() };
        Scene::new(Description { meshes: vec![mesh], materials: vec![metal, lamp], ..Description::default() }).unwrap()
    }

    /// Mean and variance of the light that the floor reflects to an eye, by directions to lights and by the lobe
    /// together.
    fn reflected(scene: &Scene, shading: &Shading, count: u32) -> (f64, f64) {
        const SAMPLES: u32 = 40_000;
        let mut rng = Rng::new(1, u64::from(count));
        let (mut sum, mut sum_sq) = (0.0, 0.0);
        for _ in 0..SAMPLES {
            let u = [0; 4].map(|_| rng.next_1d());
            let mut rays = RayCounts::default();
            let mut light = direct_light(
                scene,
                shading,
                Lobes::SPECULAR,
                LightWays { count, choice: None, sky: None },
                u,
                &mut rays,
            )
            .x;
            assert!(rays.shadow <= 1, "one ray at most");
            if let Some(sample) = shading.bsdf.sample(Lobes::SPECULAR, shading.wo, 0.5, rng.next_2d()) {
                let wi = shading.frame.to_world(sample.wi);
                let ray = shading.surface.spawn(wi);
                if let Some(hit) = scene.intersect(&ray) {
                    let lamp = scene.surface(&ray, &hit);
                    let pdf = scene.lights().pdf_surface(shading.surface.p, wi, &lamp);
                    light += mis_weight(sample.pdf / count as f32, pdf) * (sample.weight * scene.emission(&lamp)).x;
                }
            }
            let light = f64::from(light);
            sum += light;
            sum_sq += light * light;
        }
        let mean = sum / f64::from(SAMPLES);
        (mean, sum_sq / f64::from(SAMPLES) - mean * mean)
    }

    #[test]
    fn candidates_save_noise_and_lose_no_light() {
        for (alpha, eye) in [(0.1, Vec3A::new(-1.0, 1.0, 0.1)), (0.3, Vec3A::new(-1.0, 0.7, 0.0)), (0.1, Vec3A::Y)] {
            let scene = lamp_over_metal(alpha);
            let ray = Ray::new(eye, (Vec3A::new(0.3, 0.0, 0.2) - eye).normalize());
            let hit = scene.intersect(&ray).unwrap();
            let shading = Shading::new(&scene, scene.surface(&ray, &hit), ray.direction);
            let [(one, noise_of_one), (eight, noise_of_eight)] = [1, 8].map(|count| reflected(&scene, &shading, count));
            let error = ((noise_of_one + noise_of_eight) / 40_000.0).sqrt();
            assert!((one - eight).abs() < 4.0 * error, "alpha {alpha}: {one} and {eight} +- {error}");
            assert!(noise_of_eight < 0.6 * noise_of_one, "alpha {alpha}: {noise_of_eight} of {noise_of_one}");
        }
    }

    #[test]
    fn candidates_are_for_lamps_in_a_lobe() {
        let scene = lamp_over_metal(0.1);
        let count = |x: f32| {
            let ray = Ray::new(Vec3A::new(x - 1.0, 1.0, 0.0), Vec3A::new(1.0, -1.0, 0.0).normalize());
            let hit = scene.intersect(&ray).unwrap();
            light_candidates(&scene, &Shading::new(&scene, scene.surface(&ray, &hit), ray.direction))
        };
        // From 1 m to the left of the lamp's middle the mirrored ray meets it.
        assert_eq!([-1.0, 1.0].map(count), [8, 1], "towards the lamp and away from it");
        let scene = lamp_over_metal(0.6);
        let ray = Ray::new(Vec3A::new(-2.0, 1.0, 0.0), Vec3A::new(1.0, -1.0, 0.0).normalize());
        let hit = scene.intersect(&ray).unwrap();
        let shading = Shading::new(&scene, scene.surface(&ray, &hit), ray.direction);
        assert_eq!(light_candidates(&scene, &shading), 1, "a wide lobe");
    }
}
