//! Points of one surface, and how they share what the samples of their lobes find.

use std::iter::zip;

use glam::{UVec2, Vec3, Vec3A};
use scene::{Bsdf, Lobes, Scene, Specular, Surface};

use crate::sampler::{Sampler, hash_pair};
use crate::secondary::{Secondary, Shading};
use crate::statistics::RayCounts;
use crate::surface_points::{SurfacePoint, same_surface};
use crate::terms::direct::{DirectTerm, Light, LobeWay, Sight, guided_way};
use crate::terms::guide::Guide;

/// Points of one surface in a tile.
pub(super) struct Group<'a> {
    pub(super) points: Vec<(usize, &'a SurfacePoint)>,
    /// How many of them, the first, lie at the corners of the tile.
    pub(super) corners: usize,
    pub(super) guide: Option<&'a Guide>,
    /// Samples of a batch for each point.
    pub(super) count: u32,
    /// See [`LobePlan::parallax`](crate::plan::LobePlan::parallax).
    pub(super) parallax: f32,
}

/// What a lobe's sample found.
pub(super) struct Found {
    sight: Sight,
    /// The point whose sample it is, and the way, its weight over the number of samples.
    from: usize,
    way: LobeWay,
}

/// Samples of all points of a group.
pub(super) struct Batch {
    /// What stands for each point.
    shadings: Vec<Shading>,
    found: Vec<Found>,
}

impl Batch {
    /// Where samples met something.
    pub(super) fn hits(&self) -> Vec<Vec3A> {
        self.found.iter().filter_map(|found| Some(found.sight.met.as_ref()?.surface.p)).collect()
    }
}

impl Group<'_> {
    /// Takes one batch of samples of every point.
    pub(super) fn trace<S: Secondary>(
        &self,
        direct: &DirectTerm<'_, S>,
        size: UVec2,
        batch: u32,
        seed: u64,
        rays: &mut RayCounts,
        dropped: &mut u64,
    ) -> Batch {
        let mut found = Vec::new();
        let shadings: Vec<Shading> =
            self.points.iter().map(|(_, point)| self.shade(direct, point, size, batch, seed, rays)).collect();
        for (from, ((_, point), shading)) in zip(&self.points, &shadings).enumerate() {
            for index in batch * self.count..(batch + 1) * self.count {
                let Some((mut way, mut sampler)) = self.way(direct, shading, point.key, index, seed) else { continue };
                way.weight /= self.count as f32;
                let sight = direct.look_along(shading, way.wi, &mut sampler, rays);
                if (way.weight * (sight.emitted + sight.reflected())).is_finite() {
                    found.push(Found { sight, from, way });
                } else {
                    *dropped += 1;
                }
            }
        }
        Batch { shadings, found }
    }

    /// Shades some place of a point within its pixel.
    fn shade<S: Secondary>(
        &self,
        direct: &DirectTerm<'_, S>,
        point: &SurfacePoint,
        size: UVec2,
        batch: u32,
        seed: u64,
        rays: &mut RayCounts,
    ) -> Shading {
        /// Places that are tried; where something else is seen at all of them, the point stands for itself.
        const TRIALS: u32 = 4;
        /// Keeps these random numbers apart from those of lobes.
        const STREAM: u64 = 0x70_6c61_6365;
        let mut sampler = Sampler::new(seed, hash_pair(point.key, STREAM), batch);
        let Surface { t, .. } = point.shading.surface;
        let mut trial = || {
            let ray = direct.scene.camera_ray(point.position.as_vec2() + sampler.next_pair(), size);
            rays.camera += 1;
            let surface = direct.scene.surface(&ray, &direct.scene.intersect(&ray)?);
            let shading = Shading::new(direct.scene, surface, ray.direction);
            // A texture may make the lobe of one place traced and not that of the other.
            let is_like = same_surface(&point.shading.surface, &surface, t)
                && direct.plan.lobes.traces(&shading) == direct.plan.lobes.traces(&point.shading);
            is_like.then_some(shading)
        };
        (0..TRIALS).find_map(|_| trial()).unwrap_or(point.shading)
    }

    /// Chooses a direction for sample number `index` of a point, whose samples are a sequence of their own: half of
    /// them by the guide, if there is one.
    fn way<S: Secondary>(
        &self,
        direct: &DirectTerm<'_, S>,
        shading: &Shading,
        key: u64,
        index: u32,
        seed: u64,
    ) -> Option<(LobeWay, Sampler)> {
        let Some(guide) = self.guide else {
            let mut sampler = Sampler::new(seed, key, index);
            return Some((direct.lobe_way(shading, &mut sampler)?, sampler));
        };
        let by_guide = index % 2 == 1;
        let mut sampler = Sampler::new(seed, hash_pair(key, u64::from(by_guide)), index / 2);
        let mut way =
            if by_guide { guided_way(guide, shading, &mut sampler) } else { direct.lobe_way(shading, &mut sampler) }?;
        way.weight *= way.pdf / self.density(way.pdf, way.wi);
        Some((way, sampler))
    }

    /// The density of a sample, by that of the lobe alone and the local direction.
    fn density(&self, pdf: f32, wi: Vec3A) -> f32 {
        self.guide.map_or(pdf, |guide| 0.5 * (pdf + guide.pdf(wi)))
    }

    /// Gives what samples found to all points. Where that is near, or much of what another batch met, it is for those
    /// points that see it.
    pub(super) fn share<S: Secondary>(
        &self,
        direct: &DirectTerm<'_, S>,
        Batch { shadings, found }: &Batch,
        other_hits: &[Vec3A],
        lights: &mut [Light],
        rays: &mut RayCounts,
    ) {
        /// What is met on gloss is shared as long as that moves within its own lobe by less than so many widths: else
        /// some point might see in bright light what another's lobe hardly found.
        const GLOSS: f32 = 3.0;
        /// Where nothing is taken to be hidden, at most so many of what was met are near.
        const NEAR_SHARE: f32 = 0.02;
        let points = shadings.iter().map(|shading| shading.surface.p);
        let (low, high) =
            points.fold((Vec3A::INFINITY, Vec3A::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        let (middle, extent) = (0.5 * (low + high), 0.5 * high.distance(low));
        let is_alone = shadings.len() == 1;
        let hiding = self.parallax * shadings[0].lobe_alpha();
        let is_near = |p: Vec3A, width: f32| p.distance(middle) * width <= extent;
        let near = other_hits.iter().filter(|&&p| is_near(p, hiding)).count();
        let is_hiding = near as f32 > NEAR_SHARE * other_hits.len() as f32;
        let mut values = vec![Value::default(); shadings.len()];
        for found in found {
            let met = found.sight.met.as_ref();
            let is_met_near = |width: f32| met.is_some_and(|met| is_near(met.surface.p, width));
            let gloss = met.and_then(|met| width(&met.bsdf));
            if is_alone || gloss.is_some_and(|width| is_met_near(GLOSS * width)) {
                let position = self.points[found.from].1.position;
                let light = direct.light_of(&shadings[found.from], position, &found.way, &found.sight, rays);
                lights[found.from].add(&light);
            } else if found.sight.emitted + found.sight.reflected() != Vec3::ZERO {
                self.weigh(direct, shadings, &found.sight, &mut values);
                if is_hiding || is_met_near(hiding) {
                    self.hide(direct.scene, shadings, found, &mut values, rays);
                }
                self.give(&values, lights);
            }
        }
    }

    /// Finds what each point makes of what one sample saw.
    fn weigh<S: Secondary>(
        &self,
        direct: &DirectTerm<'_, S>,
        shadings: &[Shading],
        sight: &Sight,
        values: &mut [Value],
    ) {
        let reflected_along = sight.reflected_along();
        for ((_, point), (shading, value)) in zip(&self.points, zip(shadings, values)) {
            let Shading { surface, frame, bsdf, wo } = shading;
            *value = Value::default();
            // From solid angles to areas of the surface that was met; the surroundings are met in the same direction.
            let (wi, area) = sight.met.as_ref().map_or((sight.wi, 1.0), |met| {
                let way = met.surface.p - surface.p;
                let distance_sq = way.length_squared();
                let wi = way / distance_sq.sqrt();
                (wi, -met.surface.ng.dot(wi) / distance_sq)
            });
            let local = frame.to_local(wi);
            let (f, pdf) = bsdf.eval_pdf(Lobes::SPECULAR, *wo, local);
            // Written so that NaN, of no distance, is refused, and points that see its other side.
            if !(pdf > 0.0 && area > 0.0 && wi.dot(surface.ng) > 0.0) {
                continue;
            }
            let weight = f * (local.z * area);
            let emitted = sight.emitted_to(|| direct.lights_of_gloss(shading, point.position), wi, pdf);
            let light = Light { direct: weight * emitted, specular: weight * reflected_along(wi) };
            *value = Value { density: self.density(pdf, local) * area, light };
        }
    }

    /// Takes what was found from the points that do not see it. Where those at the corners of the tile do, so do all.
    fn hide(&self, scene: &Scene, shadings: &[Shading], found: &Found, values: &mut [Value], rays: &mut RayCounts) {
        let Found { sight, from, .. } = found;
        let (mut asked, mut hidden) = (0, 0);
        for (member, (Shading { surface, .. }, value)) in zip(shadings, values).enumerate() {
            if member == self.corners && asked > 0 && hidden == 0 {
                return;
            }
            if member == *from || value.density == 0.0 {
                continue;
            }
            // It ends where a ray from there would start.
            let ray = match &sight.met {
                Some(met) => surface.spawn_to(met.surface.spawn(met.surface.ng).origin),
                None => surface.spawn(sight.wi),
            };
            rays.shadow += 1;
            asked += 1;
            if scene.occluded(&ray) {
                hidden += 1;
                *value = Value::default();
            }
        }
    }

    /// Gives it to the points.
    fn give(&self, values: &[Value], lights: &mut [Light]) {
        let total: f32 = values.iter().map(|value| value.density).sum();
        if total <= 0.0 {
            return;
        }
        let share = 1.0 / (total * self.count as f32);
        for (value, light) in zip(values, lights) {
            light.direct += value.light.direct * share;
            light.specular += value.light.specular * share;
        }
    }
}

/// What a point makes of a sight.
#[derive(Debug, Clone, Copy, Default)]
struct Value {
    /// The density there of the point's own samples.
    density: f32,
    /// What it reflects, not yet over the density of all.
    light: Light,
}

/// About the angle over which the light that a surface reflects is the same; `None` where it is diffuse.
fn width(bsdf: &Bsdf) -> Option<f32> {
    match bsdf.specular {
        Specular::None => None,
        Specular::Ggx { alpha, .. } => Some(alpha),
        Specular::Mirror { .. } | Specular::Dielectric { .. } => Some(0.0),
    }
}
