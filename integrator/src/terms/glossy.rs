//! The second term of eq. 7 for rough surfaces: indirect light reflected by the glossy lobe, from the texture that a
//! point sees.

use glam::{Vec2, Vec3};
use hemimap::Frame;
use reproject::Masks;
use scene::Lobes;

use crate::sampler::{Rng, Sampler};
use crate::secondary::Shading;

/// The glossy lobe of a point as weights over the texels of a texture in `frame`, n x n: of each texel the integral of
/// f cos. With the texture they sum to the reflected radiance.
///
/// A direction in each texel, or in each block of them where the lobe is much wider, suits wide lobes, and some chosen
/// by the lobe suit those that are narrow or graze the surface; both are weighted by the balance heuristic (Veach 1997,
/// 9.2.2). By the lobe alone, few samples decide on the weight of a bright texel.
pub(crate) fn lobe_weights(shading: &Shading, frame: &Frame, n: usize, key: u64, weights: &mut Vec<Vec3>) {
    weights.clear();
    weights.resize(n * n, Vec3::ZERO);
    let side = block_side(shading.lobe_alpha(), n);
    // Texels along a block from its first one on: those at the end of the square may be narrower.
    let length = |first: usize| side.min(n - first);
    // Of all directions that are chosen, around one of this density by the lobe, in a block of so many texels.
    let density = |local, block_texels: usize, pdf_of_lobe: f32| {
        let blocks = (n * n) as f32 / block_texels as f32;
        blocks * hemimap::square_to_cosine_hemisphere_pdf(local) + LOBE_SAMPLES as f32 * pdf_of_lobe
    };

    let mut jitter = Rng::new(key, LOBE_STREAM);
    for y in (0..n).step_by(side) {
        for x in (0..n).step_by(side) {
            let (width, height) = (length(x), length(y));
            let in_block = jitter.next_2d() * Vec2::new(width as f32, height as f32);
            let place = (Vec2::new(x as f32, y as f32) + in_block) / n as f32;
            let local = hemimap::square_to_cosine_hemisphere(place);
            let world = frame.to_world(local);
            let wi = shading.frame.to_local(world);
            if wi.z <= 0.0 || !shading.leaves(world, wi) {
                continue;
            }
            let (f, pdf) = shading.bsdf.eval_pdf(Lobes::SPECULAR, shading.wo, wi);
            let block_texels = width * height;
            let share = f * (wi.z / (density(local, block_texels, pdf) * block_texels as f32));
            for row in weights[y * n..(y + height) * n].chunks_exact_mut(n) {
                row[x..x + width].iter_mut().for_each(|weight| *weight += share);
            }
        }
    }
    for number in 0..LOBE_SAMPLES {
        let u = Sampler::new(LOBE_STREAM, key, number).next_4d();
        let sample = shading.bsdf.sample(Lobes::SPECULAR, shading.wo, u[0], Vec2::new(u[1], u[2]));
        let Some(sample) = sample.filter(|sample| !sample.delta && sample.wi.z > 0.0) else { continue };
        let world = shading.frame.to_world(sample.wi);
        if !shading.leaves(world, sample.wi) {
            continue;
        }
        let local = frame.to_local(world);
        let place = hemimap::cosine_hemisphere_to_square(local);
        #[expect(clippy::cast_possible_truncation, reason = "n <= 64")]
        let [x, y] = place.to_array().map(|u| hemimap::texel_index(u, n as u32) as usize);
        let block_texels = length(x - x % side) * length(y - y % side);
        weights[y * n + x] += sample.weight * (sample.pdf / density(local, block_texels, sample.pdf));
    }
}

/// Directions that are chosen by the lobe.
const LOBE_SAMPLES: u32 = 8;
/// Keeps these random numbers apart from the others of a point.
const LOBE_STREAM: u64 = 0x6c6f_6265;
const HOLE_STREAM: u64 = 0x686f_6c65;

/// Leaves few of the small weights of texels that nothing fills, by roulette, so that no rays are spent on them.
pub(crate) fn thin_holes(weights: &mut [Vec3], masks: &Masks, n: usize, key: u64) {
    /// A ray is worth so much of the lobe.
    const WORTH: f32 = 1.0 / 400.0;
    let least = WORTH * weights.iter().map(|weight| weight.max_element()).sum::<f32>();
    let mut roulette = Rng::new(key, HOLE_STREAM);
    for (y, row) in weights.chunks_exact_mut(n).enumerate() {
        let mut holes = masks.holes(y);
        while holes != 0 {
            let weight = &mut row[holes.trailing_zeros() as usize];
            let survival = weight.max_element() / least;
            if survival < 1.0 {
                *weight = if roulette.next_1d() < survival { *weight / survival } else { Vec3::ZERO };
            }
            holes &= holes - 1;
        }
    }
}

/// Texels along a side of a block, of which there are so many across a lobe that it changes little in each.
fn block_side(alpha: f32, n: usize) -> usize {
    /// Blocks across the hemisphere for a lobe of alpha = 1.
    const BLOCKS: f32 = 10.0;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
    let side = (alpha * n as f32 / BLOCKS).clamp(1.0, 3.0) as usize;
    side
}

#[cfg(test)]
mod tests {
    use glam::Vec3A;
    use scene::{Description, Material, Mesh, Ray, Scene, SpecularKind};

    use super::*;

    /// A point of a white metal, seen from where the angle with the normal has this cosine.
    fn metal(alpha: f32, cosine: f32) -> Shading {
        let specular = SpecularKind::Ggx { alpha, reflectance: Vec3::ONE, schlick: false };
        let scene = Scene::new(Description {
            meshes: vec![Mesh {
                positions: vec![Vec3::new(-1.0, 0.0, 1.0), Vec3::new(1.0, 0.0, 1.0), Vec3::new(0.0, 0.0, -1.0)],
                triangles: vec![[0, 1, 2]],
                materials: vec![0],
                ..Mesh::default()
            }],
            materials: vec![Material { diffuse: Vec3::ZERO, specular, ..Material::default() }],
            ..Description::default()
        });
        let scene = scene.expect("a triangle");
        let to_viewer = Vec3A::new((1.0 - cosine * cosine).sqrt(), cosine, 0.0);
        let ray = Ray::new(to_viewer, -to_viewer);
        let hit = scene.intersect(&ray).expect("it is met");
        Shading::new(&scene, scene.surface(&ray, &hit), -to_viewer)
    }

    /// The place of a texel's middle.
    fn middle(texel: usize, n: usize) -> Vec2 {
        (Vec2::new((texel % n) as f32, (texel / n) as f32) + 0.5) / n as f32
    }

    #[test]
    fn weights_are_those_of_the_lobe() {
        const KEYS: u64 = 100;
        const SAMPLES: u32 = 1 << 15;
        /// Some light that is smooth over the hemisphere.
        fn light(wi: Vec3A) -> f32 {
            1.0 + 0.8 * wi.x - 0.3 * wi.z
        }
        for alpha in [0.09, 0.3, 0.5, 1.0] {
            for (cosine, n) in [(0.05, 32), (0.3, 41), (0.7, 20), (0.99, 8)] {
                let shading = metal(alpha, cosine);
                // As of a record: turned about the normal.
                let frame = Frame::from_normal(-shading.surface.n).transported_to(shading.surface.n);
                let mut weights = Vec::new();
                let (mut all, mut lit) = (0.0, 0.0);
                for key in 0..KEYS {
                    lobe_weights(&shading, &frame, n, key, &mut weights);
                    for (texel, weight) in weights.iter().enumerate() {
                        let local = hemimap::square_to_cosine_hemisphere(middle(texel, n));
                        all += weight.x / KEYS as f32;
                        lit += weight.x * light(frame.to_world(local)) / KEYS as f32;
                    }
                }
                let (mut all_sampled, mut lit_sampled) = (0.0, 0.0);
                for number in 0..SAMPLES {
                    let u = Sampler::new(7, 1, number).next_4d();
                    if let Some(sample) = shading.bsdf.sample(Lobes::SPECULAR, shading.wo, u[0], Vec2::new(u[1], u[2]))
                        && sample.wi.z > 0.0
                    {
                        let weight = sample.weight.x / SAMPLES as f32;
                        all_sampled += weight;
                        lit_sampled += weight * light(shading.frame.to_world(sample.wi));
                    }
                }
                let case = format!("alpha {alpha}, cosine {cosine}, {n} texels");
                assert!((all / all_sampled - 1.0).abs() < 0.01, "{case}: {all} for {all_sampled}");
                // The middle stands for a texel, which is wide at the horizon.
                assert!((lit / lit_sampled - 1.0).abs() < 0.03, "{case}: {lit} for {lit_sampled}");
            }
        }
    }

    /// Of what one bright texel gives, wherever it is. By 128 samples of the lobe alone it would be 1.2 to 2.3 for the
    /// wide ones.
    #[test]
    fn weight_of_a_texel_is_no_matter_of_chance() {
        const KEYS: u64 = 200;
        for (alpha, n, most) in [(0.5, 20, 0.25), (0.5, 40, 0.45), (1.0, 40, 0.6), (0.1, 32, 0.45)] {
            let shading = metal(alpha, 0.7);
            let frame = Frame::from_normal(shading.surface.n);
            let mut weights = Vec::new();
            let mut sums = vec![[0.0; 2]; n * n];
            for key in 0..KEYS {
                lobe_weights(&shading, &frame, n, key, &mut weights);
                for (sum, weight) in sums.iter_mut().zip(&weights) {
                    sum[0] += weight.x / KEYS as f32;
                    sum[1] += weight.x * weight.x / KEYS as f32;
                }
            }
            let variance: f32 = sums.iter().map(|[mean, square]| (square - mean * mean).max(0.0)).sum();
            let deviation = (variance / sums.iter().map(|[mean, _]| mean * mean).sum::<f32>()).sqrt();
            assert!(deviation < most, "alpha {alpha}, {n} texels: {deviation}");
        }
    }

    #[test]
    fn thinning_keeps_the_light_of_holes() {
        const KEYS: u64 = 4000;
        let n = 40;
        let mut masks = Masks::new(n);
        // The upper half is filled.
        masks.fill[n / 2..n].fill((1 << n) - 1);
        let weights: Vec<Vec3> = (0..n * n).map(|texel| Vec3::new(1.0 + (texel % 7) as f32, 1.0, 0.5)).collect();
        let (mut sum, mut left) = (vec![Vec3::ZERO; n * n], 0);
        for key in 0..KEYS {
            let mut thinned = weights.clone();
            thin_holes(&mut thinned, &masks, n, key);
            assert_eq!(thinned[n * n / 2..], weights[n * n / 2..], "what is filled takes no rays");
            left += thinned[..n * n / 2].iter().filter(|weight| **weight != Vec3::ZERO).count();
            sum.iter_mut().zip(thinned).for_each(|(sum, weight)| *sum += weight / KEYS as f32);
        }
        // Half of the light at most, in rays that are worth 1/400 each.
        let rays = left as f32 / KEYS as f32;
        assert!((190.0..210.0).contains(&rays), "{rays} rays a point");
        for (texel, (sum, weight)) in sum.iter().zip(&weights).enumerate().take(n * n / 2) {
            // Five standard errors of the least likely ones.
            assert!((sum.x / weight.x - 1.0).abs() < 0.3, "texel {texel}: {sum} for {weight}");
        }
    }
}
