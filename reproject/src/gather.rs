//! A gather: the rays by which a record is made.

use glam::{Vec2, Vec3A};
use hemimap::Frame;
use radcache::Samples;

use crate::holes::hash;
use crate::verify::unit;
use crate::{Traced, Tracer};

/// Keeps the random numbers of gathers apart from those of hole rays with the same seed.
const STREAM: u64 = 0x6761_7468_6572;

/// Traces one ray through a random place of each of the `n x n` texels of the hemisphere over `frame`, whose z axis is
/// the normal of the point that `tracer` looks from, for a [`radcache::Record`] there. The same seed gives the same
/// rays. Distances are metres; what is infinite is the surroundings, as [`Traced`] says.
///
/// # Panics
/// If `n` is 0 or above 64.
///
/// # Examples
/// ```
/// use reproject::glam::{Vec3, Vec3A};
/// use reproject::{Traced, Tracer, gather};
///
/// struct Ceiling(f32);
/// impl Tracer for Ceiling {
///     fn trace(&mut self, wi: &[Vec3A], out: &mut [Traced]) {
///         for (wi, out) in wi.iter().zip(out) {
///             *out = Traced { radiance: Vec3::ONE, distance: self.0 / wi.y, normal: Vec3A::NEG_Y };
///         }
///     }
/// }
/// let frame = hemimap::Frame::from_normal(Vec3A::Y);
/// let samples = gather(&frame, 16, 1, &mut Ceiling(2.0));
/// assert!((samples.mean_radiance() - Vec3::ONE).length() < 1e-5);
/// ```
pub fn gather(frame: &Frame, n: usize, seed: u64, tracer: &mut (impl Tracer + ?Sized)) -> Samples {
    let mut samples = Samples::new(n);
    for texel in 0..n * n {
        let random = hash(seed ^ STREAM, texel as u64);
        samples.set_jitter(texel, Vec2::new(unit(random >> 40), unit(random >> 16)));
    }
    let directions: Vec<Vec3A> = samples.directions().into_iter().map(|wi| frame.to_world(wi)).collect();
    let mut traced = vec![Traced::default(); n * n];
    tracer.trace(&directions, &mut traced);
    for (texel, Traced { radiance, distance, normal }) in traced.into_iter().enumerate() {
        samples.set(texel, radiance, distance, frame.to_local(normal));
    }
    samples
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// A wall at x = 1 that gets brighter upwards, before a sky.
    struct Wall(Vec<Vec3A>);

    impl Tracer for Wall {
        fn trace(&mut self, wi: &[Vec3A], out: &mut [Traced]) {
            self.0.extend(wi);
            for (wi, out) in wi.iter().zip(out) {
                let distance = if wi.x > 0.0 { 1.0 / wi.x } else { f32::INFINITY };
                let radiance = Vec3::splat(if wi.x > 0.0 { 1.0 + wi.y } else { 0.25 });
                *out = Traced { radiance, distance, normal: Vec3A::NEG_X };
            }
        }
    }

    #[test]
    fn texels_hold_what_their_rays_met() {
        let frame = Frame::from_normal(Vec3A::new(0.6, 0.8, 0.0));
        let mut wall = Wall(Vec::new());
        let samples = gather(&frame, 16, 5, &mut wall as &mut dyn Tracer);
        for (texel, &wi) in wall.0.iter().enumerate() {
            let local = samples.direction(texel);
            assert!((frame.to_world(local) - wi).length() < 1e-6, "texel {texel}");
            let is_wall = wi.x > 0.0;
            assert_eq!(samples.distance[texel].is_finite(), is_wall);
            assert!(!is_wall || (frame.to_world(samples.normal[texel].into()) - Vec3A::NEG_X).length() < 1e-6);
        }
        let again = gather(&frame, 16, 5, &mut Wall(Vec::new()));
        assert_eq!(again, samples, "the same seed");
        assert_ne!(gather(&frame, 16, 6, &mut Wall(Vec::new())), samples, "another seed");
    }
}
