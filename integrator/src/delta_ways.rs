//! Where light goes on at mirrors and glass.

use arrayvec::ArrayVec;
use glam::Vec3;
use scene::Ray;

use crate::sampler::Sampler;
use crate::secondary::Shading;

/// A way on from a mirror or from glass.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Way {
    /// 0 for reflection, 1 for refraction.
    pub(crate) number: u64,
    pub(crate) ray: Ray,
    /// Throughput, over the chance of this way.
    pub(crate) beta: Vec3,
    /// The part of it by which radiance changes in glass.
    pub(crate) radiance_scale: f32,
}

/// Returns the ways on from a surface that was reached with throughput `beta`, of which glass made `radiance_scale`: `both`, or one of them by its strength.
/// Roulette keeps each with the probability that `survival` gives.
pub(crate) fn delta_ways(
    shading: &Shading,
    beta: Vec3,
    radiance_scale: f32,
    both: bool,
    survival: impl Fn(&Way) -> f32,
    sampler: &mut Sampler,
) -> ArrayVec<Way, 2> {
    let mut ways = ArrayVec::new();
    let branches = shading.bsdf.delta_branches(shading.wo);
    let strength = branches.map(|branch| branch.map_or(0.0, |branch| (branch.weight * beta).max_element()));
    let total = strength[0] + strength[1];
    if total <= 0.0 {
        return ways;
    }
    let u = sampler.next_pair();
    let first = strength[0] / total;
    for (number, chance, is_chosen, u) in [(0, first, u.x < first, u.y), (1, 1.0 - first, u.x >= first, 1.0 - u.y)] {
        let Some(branch) = branches[number] else { continue };
        let chance = if both { 1.0 } else { chance };
        if !(both || is_chosen) || chance <= 0.0 {
            continue;
        }
        let wi = shading.frame.to_world(branch.wi);
        let mut way = Way {
            number: number as u64,
            ray: shading.surface.spawn(wi),
            beta: beta * branch.weight / chance,
            radiance_scale: radiance_scale * branch.radiance_scale,
        };
        let survival = survival(&way);
        if u < survival && shading.leaves(wi, branch.wi) {
            way.beta /= survival;
            ways.push(way);
        }
    }
    ways
}
