//! Which part of the surroundings comes from textures, and which from light sampling.
//!
//! Every record sees the sky through the texels that escape, so what is about evenly bright needs no light sampling at
//! all. A sun would be met by few texels or none. The surroundings are therefore cut at a radiance T:
//!
//! ```text
//! L = L_soft + L_hard,   L_soft = L min(1, T / luminance(L))
//! ```
//!
//! The soft part is taken from textures, the hard one by light sampling; their sum is the light, so nothing is lost or
//! doubled.

use glam::{Vec2, Vec3, Vec3A};
use scene::{Lights, Scene};

/// The cut between the soft and the hard part of the surroundings.
#[derive(Debug)]
pub(crate) struct SkySplit {
    /// Luminance above which light is hard, W m^-2 sr^-1.
    threshold: f32,
    /// The lights of the scene with the surroundings sampled by their hard part alone.
    lights: Lights,
}

impl SkySplit {
    /// The cut for the surroundings of a scene; `None` where they are black.
    ///
    /// T is four times the power mean of exponent 1/2 of the luminance over the sphere: peaks hardly raise it, and
    /// black parts do not bring it to zero as they would a median.
    pub(crate) fn new(scene: &Scene) -> Option<Self> {
        const SIDE: usize = 64;
        const FACTOR: f64 = 4.0;
        let mut sum = 0.0;
        for cell in 0..SIDE * SIDE {
            let u = (Vec2::new((cell % SIDE) as f32, (cell / SIDE) as f32) + 0.5) / SIDE as f32;
            let up = hemimap::square_to_uniform_hemisphere(u);
            for w in [up, -up] {
                sum += f64::from(luminance(scene.background(w))).sqrt();
            }
        }
        let mean = sum / (2 * SIDE * SIDE) as f64;
        #[expect(clippy::cast_possible_truncation, reason = "a radiance of f32 range")]
        let threshold = (FACTOR * mean * mean) as f32;
        if threshold <= 0.0 {
            return None;
        }
        let lights = scene.lights().with_environment_weight(|radiance| radiance - soft(radiance, threshold));
        Some(Self { threshold, lights })
    }

    /// The lights that are left when textures carry the soft part.
    pub(crate) fn lights(&self) -> &Lights {
        &self.lights
    }

    /// The part of the radiance that textures carry.
    pub(crate) fn soft(&self, radiance: Vec3) -> Vec3 {
        soft(radiance, self.threshold)
    }

    /// The rest, for light sampling.
    pub(crate) fn hard(&self, radiance: Vec3) -> Vec3 {
        radiance - self.soft(radiance)
    }
}

fn soft(radiance: Vec3, threshold: f32) -> Vec3 {
    let luminance = luminance(radiance);
    if luminance > threshold { radiance * (threshold / luminance) } else { radiance }
}

/// Luminance of linear Rec. 709 RGB.
pub(crate) fn luminance(rgb: Vec3) -> f32 {
    rgb.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// The radiance of the surroundings in the soft part, 0 without a split.
pub(crate) fn soft_background(scene: &Scene, sky: Option<&SkySplit>, direction: Vec3A) -> Vec3 {
    sky.map_or(Vec3::ZERO, |sky| sky.soft(scene.background(direction)))
}
