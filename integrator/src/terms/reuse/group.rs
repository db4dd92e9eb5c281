//! Points of one surface, and how they share what the samples of their lobes find.

use std::iter::zip;

use glam::{Vec3, Vec3A};
use scene::{Bsdf, Lobes, Specular};

use crate::sampler::{Sampler, hash_pair};
use crate::secondary::{Secondary, Shading};
use crate::statistics::RayCounts;
use crate::surface_points::SurfacePoint;
use crate::terms::direct::{DirectTerm, Light, LobeWay, alpha, guided_way};
use crate::terms::guide::Guide;

/// Points of one surface in a tile.
pub(super) struct Group<'a> {
    pub(super) points: Vec<(usize, &'a SurfacePoint)>,
    pub(super) guide: Option<&'a Guide>,
    /// Samples of a batch for each point.
    pub(super) count: u32,
    /// See [`Plan::lobe_parallax`].
    pub(super) parallax: f32,
}

/// What a lobe's sample met that all points of its tile may see.
pub(super) struct Found {
    p: Vec3A,
    /// The geometric normal there.
    n: Vec3A,
    /// About the angle over which the light that it reflects is the same: 0 for mirrors and glass, 1 where it is diffuse.
    alpha: f32,
    /// What it reflects to the lobe.
    radiance: Vec3,
    /// The point whose sample it is, and what it counts there alone: f cos over the density by which it was chosen.
    from: usize,
    weight: Vec3,
}

/// Where a sample of a point found something.
pub(super) type Place = (Vec3A, usize);

impl Group<'_> {
    /// The numbers of the points.
    pub(super) fn members(&self) -> Vec<usize> {
        (0..self.points.len()).collect()
    }

    /// Takes one batch of samples of every point: adds the light that is for the point alone, and returns what all may share.
    pub(super) fn trace<S: Secondary>(
        &self,
        direct: &DirectTerm<'_, S>,
        batch: u32,
        seed: u64,
        lights: &mut [Light],
        rays: &mut RayCounts,
        dropped: &mut u64,
    ) -> Vec<Found> {
        let mut found = Vec::new();
        for (from, (_, point)) in self.points.iter().enumerate() {
            for index in batch * self.count..(batch + 1) * self.count {
                let Some((mut way, mut sampler)) = self.way(direct, point, index, seed) else { continue };
                way.weight /= self.count as f32;
                let (own, met) = direct.look_along(&point.shading, &way, &mut sampler, rays);
                let radiance = met.map_or(Vec3::ZERO, |met| met.radiance);
                if (own.direct + own.specular + radiance).is_finite() {
                    lights[from].add(&own);
                    found.extend(met.map(|met| Found {
                        p: met.surface.p,
                        n: met.surface.ng,
                        alpha: width(&direct.scene.bsdf(&met.surface)),
                        radiance,
                        from,
                        weight: way.weight,
                    }));
                } else {
                    *dropped += 1;
                }
            }
        }
        found
    }

    /// Chooses a direction for sample number `index` of a point, whose samples are a sequence of their own: half of them by the guide, if there is one.
    fn way<S: Secondary>(
        &self,
        direct: &DirectTerm<'_, S>,
        SurfacePoint { shading, key, .. }: &SurfacePoint,
        index: u32,
        seed: u64,
    ) -> Option<(LobeWay, Sampler)> {
        let Some(guide) = self.guide else {
            let mut sampler = Sampler::new(seed, *key, index);
            return Some((direct.lobe_way(shading, &mut sampler)?, sampler));
        };
        let by_guide = index % 2 == 1;
        let mut sampler = Sampler::new(seed, hash_pair(*key, u64::from(by_guide)), index / 2);
        let mut way =
            if by_guide { guided_way(guide, shading, &mut sampler) } else { direct.lobe_way(shading, &mut sampler) }?;
        way.weight *= way.pdf / self.density(way.pdf, way.wi);
        Some((way, sampler))
    }

    /// The density of a sample, by that of the lobe alone and the local direction.
    fn density(&self, pdf: f32, wi: Vec3A) -> f32 {
        self.guide.map_or(pdf, |guide| 0.5 * (pdf + guide.pdf(wi)))
    }

    /// Gives what samples of `members` found to all of them, or to fewer where much of what another batch found is near.
    pub(super) fn share(&self, members: &mut [usize], found: &mut [Found], others: &mut [Place], lights: &mut [Light]) {
        /// Nearer things than the lobe allows are at most so many of what was found.
        const NEAR_SHARE: f32 = 0.02;
        let place = |member: usize| self.points[member].1.shading.surface.p;
        let (low, high) = members
            .iter()
            .map(|&member| place(member))
            .fold((Vec3A::INFINITY, Vec3A::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        let (middle, extent) = (0.5 * (low + high), 0.5 * high.distance(low));
        let is_alone = extent <= 0.0;
        let width = alpha(&self.points[members[0]].1.shading);
        let is_near = |p: Vec3A, width: f32| p.distance(middle) * width * self.parallax < extent;
        let near = others.iter().filter(|(p, _)| is_near(*p, width)).count();
        if near as f32 > NEAR_SHARE * others.len() as f32 {
            let axis = (high - low).max_position();
            // Both parts have a member, however near these are.
            let is_high = |member: usize| place(member)[axis] - low[axis] > high[axis] - place(member)[axis];
            members.sort_by_key(|&member| is_high(member));
            found.sort_by_key(|found| is_high(found.from));
            let (low, high) = members.split_at_mut(members.partition_point(|&member| !is_high(member)));
            let (of_low, of_high) = found.split_at_mut(found.partition_point(|found| !is_high(found.from)));
            others.sort_by_key(|(_, from)| is_high(*from));
            let (by_low, by_high) = others.split_at_mut(others.partition_point(|(_, from)| !is_high(*from)));
            self.share(low, of_low, by_low, lights);
            self.share(high, of_high, by_high, lights);
            return;
        }
        let mut values = vec![Vec3::ZERO; members.len()];
        for found in found {
            if is_alone || is_near(found.p, width.min(found.alpha)) {
                lights[found.from].specular += found.weight * found.radiance;
            } else {
                self.give(found, members, &mut values, lights);
            }
        }
    }

    /// Gives what one sample found to all of `members`, by what their lobes make of it; `values` are for use meanwhile.
    fn give(&self, found: &Found, members: &[usize], values: &mut [Vec3], lights: &mut [Light]) {
        let mut total = 0.0;
        for (&member, value) in zip(members, &mut *values) {
            *value = Vec3::ZERO;
            let Shading { surface, frame, bsdf, wo } = &self.points[member].1.shading;
            let way = found.p - surface.p;
            let distance_sq = way.length_squared();
            let wi = way / distance_sq.sqrt();
            let local = frame.to_local(wi);
            let pdf = bsdf.pdf(Lobes::SPECULAR, *wo, local);
            // Written so that NaN, of no distance, is refused.
            if !(pdf > 0.0 && wi.dot(surface.ng) > 0.0) {
                continue;
            }
            // From solid angles to areas of the surface that was met.
            let area = found.n.dot(wi).abs() / distance_sq;
            total += self.density(pdf, local) * area;
            *value = bsdf.eval(Lobes::SPECULAR, *wo, local) * (local.z * area);
        }
        if total > 0.0 {
            let light = found.radiance / (total * self.count as f32);
            for (&member, value) in zip(members, values) {
                lights[member].specular += *value * light;
            }
        }
    }
}

/// About the angle over which the light that a surface reflects is the same.
fn width(bsdf: &Bsdf) -> f32 {
    match bsdf.specular {
        Specular::None => 1.0,
        Specular::Ggx { alpha, .. } => alpha,
        Specular::Mirror { .. } | Specular::Dielectric { .. } => 0.0,
    }
}

/// Where samples found something.
pub(super) fn places(found: &[Found]) -> Vec<Place> {
    found.iter().map(|found| (found.p, found.from)).collect()
}
