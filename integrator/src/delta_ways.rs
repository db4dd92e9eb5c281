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
    pub(crate) number: usize,
    pub(crate) ray: Ray,
    /// Throughput, over the chance of this way and, as it is returned, that of roulette.
    pub(crate) beta: Vec3,
    /// The part of it by which radiance changes in glass.
    pub(crate) radiance_scale: f32,
}

impl Way {
    /// The part of the flux that comes by this way.
    pub(crate) fn flux(&self) -> f32 {
        self.beta.max_element() / self.radiance_scale
    }
}

/// Returns the ways on from a surface that was reached with throughput `beta`, of which glass made `radiance_scale`:
/// `both`, or one of them by its flux, for radiance alone grows on the way out of glass. Roulette keeps each with the
/// probability that `survival` gives.
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
    let flux = branches.map(|branch| branch.map_or(0.0, |b| (b.weight * beta).max_element() / b.radiance_scale));
    let total = flux[0] + flux[1];
    if total <= 0.0 {
        return ways;
    }
    let u = sampler.next_pair();
    let first = flux[0] / total;
    for (number, chance, is_chosen, u) in [(0, first, u.x < first, u.y), (1, 1.0 - first, u.x >= first, 1.0 - u.y)] {
        let Some(branch) = branches[number] else { continue };
        let chance = if both { 1.0 } else { chance };
        if !(both || is_chosen) || chance <= 0.0 {
            continue;
        }
        let wi = shading.frame.to_world(branch.wi);
        let mut way = Way {
            number,
            ray: shading.surface.spawn(wi),
            beta: beta * branch.weight / chance,
            radiance_scale: radiance_scale * branch.radiance_scale,
        };
        let survival = survival(&way);
        if survival < 1.0 {
            if u >= survival {
                continue;
            }
            way.beta /= survival;
        }
        if shading.leaves(wi, branch.wi) {
            ways.push(way);
        }
    }
    ways
}

#[cfg(test)]
mod tests {
    use glam::Vec3A;
    use scene::{Description, Material, Mesh, Scene, SpecularKind};

    use super::*;
    use crate::secondary::tests::square;

    #[test]
    fn one_way_out_of_glass_carries_all_of_the_flux() {
        let kind = SpecularKind::Dielectric { ior: 1.5, tint: Vec3::ONE, absorption: Vec3::ZERO, priority: 0 };
        let glass = Material { diffuse: Vec3::ZERO, specular: kind, ..Material::default() };
        let mesh = Mesh {
            positions: square(1.0, 0.0).to_vec(),
            triangles: vec![[0, 2, 1], [0, 3, 2]],
            materials: vec![0; 2],
            ..Mesh::default()
        };
        let scene =
            Scene::new(Description { meshes: vec![mesh], materials: vec![glass], ..Description::default() }).unwrap();
        let ray = Ray::new(Vec3A::new(0.1, -1.0, 0.2), Vec3A::new(0.3, 1.0, 0.0).normalize());
        let shading = Shading::new(&scene, scene.surface(&ray, &scene.intersect(&ray).unwrap()), ray.direction);
        assert!(!shading.surface.front, "from within");
        let mut counts = [0; 2];
        for number in 0..4096 {
            let mut sampler = Sampler::new(1, 0, number);
            let ways = delta_ways(&shading, Vec3::ONE, 1.0, false, |_| 1.0, &mut sampler);
            assert!(ways.len() == 1 && (ways[0].flux() - 1.0).abs() < 1e-5, "{ways:?}");
            counts[ways[0].number] += 1;
        }
        let both = delta_ways(&shading, Vec3::ONE, 1.0, true, |_| 1.0, &mut Sampler::new(1, 0, 0));
        let share = f64::from(counts[0]) / 4096.0;
        assert!((share - f64::from(both[0].flux())).abs() < 0.002, "{share} is reflected, not {}", both[0].flux());
        assert!((both[0].flux() + both[1].flux() - 1.0).abs() < 1e-5, "{both:?}");
        // Ways of which roulette keeps a quarter count four times.
        let kept: Vec<f32> = (0..4096)
            .flat_map(|number| delta_ways(&shading, Vec3::ONE, 1.0, true, |_| 0.25, &mut Sampler::new(1, 0, number)))
            .map(|way| way.flux())
            .collect();
        let mean = kept.iter().sum::<f32>() / 4096.0;
        assert!((mean - 1.0).abs() < 0.01 && kept.len() < 4096, "{mean} by {} ways", kept.len());
    }
}
