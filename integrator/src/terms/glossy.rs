//! The second term of eq. 7 for rough surfaces: indirect light reflected by the glossy lobe, from the texture that a point sees.

use glam::{UVec2, Vec2, Vec3};
use hemimap::Frame;
use scene::Lobes;

use crate::sampler::Sampler;
use crate::secondary::Shading;

/// The glossy lobe of a point as weights over the texels of a texture in `frame`, n x n: each is the sum of f cos / pdf over those
/// of [`SAMPLES`] that fall into the texel, divided by their number. With the texture they sum to the reflected radiance.
pub(crate) fn lobe_weights(shading: &Shading, frame: &Frame, n: usize, key: u64, weights: &mut Vec<Vec3>) {
    weights.clear();
    weights.resize(n * n, Vec3::ZERO);
    for number in 0..SAMPLES {
        let u = Sampler::new(LOBE_STREAM, key, number).next_4d();
        let sample = shading.bsdf.sample(Lobes::SPECULAR, shading.wo, u[0], Vec2::new(u[1], u[2]));
        let Some(sample) = sample.filter(|sample| !sample.delta && sample.wi.z > 0.0) else { continue };
        let wi = shading.frame.to_world(sample.wi);
        if !shading.leaves(wi, sample.wi) {
            continue;
        }
        let place = hemimap::cosine_hemisphere_to_square(frame.to_local(wi)) * n as f32;
        let cell = place.as_uvec2().min(UVec2::splat(u32::try_from(n - 1).expect("n <= 64")));
        weights[cell.y as usize * n + cell.x as usize] += sample.weight / SAMPLES as f32;
    }
}

/// Samples of a lobe.
const SAMPLES: u32 = 128;
/// Keeps these random numbers apart from the others of a point.
const LOBE_STREAM: u64 = 0x6c6f_6265;
