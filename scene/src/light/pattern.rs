//! Pictures by which the light of a surface differs from place to place.

use std::sync::Arc;

use glam::{Vec2, Vec3};

use crate::{Material, Texture};

/// The pictures of a material that shines.
#[derive(Debug, Clone)]
pub(crate) struct Pattern {
    /// Factor for the radiance.
    emission: Option<Arc<Texture>>,
    /// Which share of the surface is there.
    opacity: Option<Arc<Texture>>,
}

impl Pattern {
    /// Returns what the pictures of a material draw; `None` where it has neither of the two.
    pub(crate) fn new(material: &Material, textures: &[Arc<Texture>]) -> Option<Self> {
        let texture = |index: Option<u32>| index.map(|index| textures[index as usize].clone());
        let pattern = Self { emission: texture(material.emission_texture), opacity: texture(material.opacity_texture) };
        (pattern.emission.is_some() || pattern.opacity.is_some()).then_some(pattern)
    }

    /// Whether a part of the surface may not be there.
    pub(super) fn has_holes(&self) -> bool {
        self.opacity.is_some()
    }

    /// Returns the factor for the radiance, over all rays that meet the surface there: of these some pass.
    pub(super) fn at(&self, uv: Vec2) -> Vec3 {
        let color = self.emission.as_ref().map_or(Vec3::ONE, |texture| texture.color(uv));
        color * self.opacity.as_ref().map_or(1.0, |texture| texture.mask(uv))
    }

    /// Whether nothing shines where the texture coordinates lie within the box of some corners.
    pub(super) fn is_black_between(&self, corners: &[Vec2]) -> bool {
        let least = corners.iter().copied().fold(Vec2::INFINITY, Vec2::min);
        let most = corners.iter().copied().fold(Vec2::NEG_INFINITY, Vec2::max);
        [&self.emission, &self.opacity].into_iter().flatten().any(|texture| texture.is_black_between(least, most))
    }

    /// Returns the mean factor of some places, by which light is chosen: above 0, for there may be something that was
    /// not seen.
    pub(super) fn mean(&self, places: impl Iterator<Item = Vec2>) -> Vec3 {
        /// The least share of the brightest place.
        const LEAST: f32 = 1.0 / 64.0;
        let (mut sum, mut count, mut brightest) = (Vec3::ZERO, 0.0, 0.0f32);
        for uv in places {
            let factor = self.at(uv);
            sum += factor;
            count += 1.0;
            brightest = brightest.max(factor.max_element());
        }
        if brightest == 0.0 {
            brightest = self.emission.as_ref().map_or(1.0, |texture| texture.range().1);
        }
        (sum / f32::max(count, 1.0)).max(Vec3::splat(LEAST * brightest))
    }
}
