//! Solid noise: colours that fill space, so that a body of any shape has them without texture coordinates.
//!
//! At the point p, with q = p / size for each axis and n the fractal sum of gradient noise at q, in [-1, 1]:
//!
//! ```text
//! clouds   s = 1/2 + 3/2 n
//! marble   s = 1/2 + 1/2 sin(2 pi (q.x + distortion n))                    sheets across x
//! wood     s = 1/2 + 1/2 sin(2 pi (|(q.x, q.z)| + distortion n))           rings about y
//! ```
//!
//! The factor for the diffuse albedo is low + (high - low) s with s cut to [0, 1].
//!
//! # Source
//! Perlin 1985, An Image Synthesizer (solid noise and marble); 2002, Improving Noise (the quintic, as the crate
//! `noise-functions` has it).

use std::f32::consts::TAU;

use glam::{Vec2, Vec3, Vec3A};
use noise_functions::{Noise as _, Perlin, Sample as _};

/// Colours by a function of the place in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// What is made of the noise.
    pub pattern: Pattern,
    /// Size of the largest features along x, y and z, metres: the lattice of the first octave and the distance of
    /// sheets and rings.
    pub size: Vec3,
    /// Octaves, from 1 to [`Noise::MAX_OCTAVES`]; each is half as large and half as strong as the one before.
    pub octaves: u32,
    /// How far the noise moves sheets and rings, in their distances; clouds do not use it.
    pub distortion: f32,
    /// Factor for the albedo where the pattern is least, in [0, 1].
    pub low: Vec3,
    /// Factor for the albedo where it is most, in [0, 1].
    pub high: Vec3,
    /// Another seed gives another pattern.
    pub seed: i32,
}

/// What [`Noise`] makes of gradient noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pattern {
    /// The noise itself.
    Clouds,
    /// Sheets across x that the noise bends.
    Marble,
    /// Rings about y that the noise bends.
    Wood,
}

/// Cells from the origin beyond which a place counts as this far: f32 then has three digits left within a cell, and
/// after ten octaves the lattice still has numbers in i32.
const MAX_CELL: f32 = 1_048_576.0;

impl Noise {
    /// Octaves at most.
    pub const MAX_OCTAVES: u32 = 10;

    /// Returns the factor for the diffuse albedo at a point of the world; always finite and between `low` and `high`.
    #[inline]
    #[must_use]
    pub fn color(&self, p: Vec3A) -> Vec3 {
        let cell = Vec3A::splat(MAX_CELL);
        let q = (p / Vec3A::from(self.size)).clamp(-cell, cell);
        let noise = Perlin.fbm(self.octaves, 0.5, 2.0).sample_with_seed(q.to_array(), self.seed);
        let wave = |distance: f32| 0.5 + 0.5 * (TAU * (distance + self.distortion * noise)).sin();
        let share = match self.pattern {
            // 3 % of space is beyond a third.
            Pattern::Clouds => 0.5 + 1.5 * noise,
            Pattern::Marble => wave(q.x),
            Pattern::Wood => wave(Vec2::new(q.x, q.z).length()),
        };
        self.low.lerp(self.high, share.clamp(0.0, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(pattern: Pattern) -> Noise {
        let (low, high) = (Vec3::new(0.2, 0.4, 0.0), Vec3::ONE);
        Noise { pattern, size: Vec3::splat(0.5), octaves: 4, distortion: 0.5, low, high, seed: 0 }
    }

    /// A few thousand points in a box of 25 cells.
    fn points() -> impl Iterator<Item = Vec3A> {
        (0..8000u32).map(|i| Vec3A::new((i % 20) as f32, (i / 20 % 20) as f32, (i / 400) as f32) * 0.637 - 6.0)
    }

    #[test]
    fn colors_stay_between_and_reach_both_ends() {
        for pattern in [Pattern::Clouds, Pattern::Marble, Pattern::Wood] {
            let noise = noise(pattern);
            let (mut least, mut most, mut sum) = (f32::INFINITY, 0.0_f32, 0.0);
            for p in points() {
                let color = noise.color(p);
                assert!(color.cmpge(noise.low).all() && color.cmple(noise.high).all(), "{pattern:?} at {p}: {color}");
                (least, most, sum) = (least.min(color.x), most.max(color.x), sum + color.x);
            }
            assert!(least < 0.3 && most > 0.9, "{pattern:?}: from {least} to {most}");
            assert!((sum / 8000.0 - 0.6).abs() < 0.02, "{pattern:?}: the mean is in the middle, {}", sum / 8000.0);
        }
    }

    #[test]
    fn colors_change_gently_within_a_cell() {
        // The noise rises by 3.1 a cell along an axis (tried at 10^6 points), so by 5.4 at most; clouds by 1.5 times,
        // waves by pi (1 + 0.5 5.4) = 12 a cell. The step is 3.5e-4 cells.
        for pattern in [Pattern::Clouds, Pattern::Marble, Pattern::Wood] {
            let noise = Noise { low: Vec3::ZERO, high: Vec3::ONE, ..noise(pattern) };
            for p in points() {
                let step = noise.color(p + Vec3A::new(1e-4, -1e-4, 1e-4)) - noise.color(p);
                assert!(step.abs().max_element() < 12.0 * 3.5e-4, "{pattern:?} at {p}: {step}");
            }
        }
    }

    #[test]
    fn patterns_lie_as_they_are_described() {
        let plain = |pattern| Noise { distortion: 0.0, low: Vec3::ZERO, high: Vec3::ONE, ..noise(pattern) };
        let marble = plain(Pattern::Marble);
        assert_eq!(marble.color(Vec3A::new(0.125, 7.0, -3.0)), Vec3::ONE, "a quarter of the way to the next sheet");
        assert!(marble.color(Vec3A::new(0.375, 1.0, 2.0)).max_element() < 1e-6, "three quarters");
        let wood = plain(Pattern::Wood);
        let ring = Vec3A::new(0.6, 9.0, 0.8) * 0.125;
        assert!((wood.color(ring) - 1.0).abs().max_element() < 1e-5, "a ring, at any height");
        let other = Noise { seed: 1, ..noise(Pattern::Clouds) };
        let differ = points().filter(|&p| other.color(p) != noise(Pattern::Clouds).color(p)).count();
        assert!(differ > 7000, "another seed, another pattern: {differ}");
        let long = Noise { size: Vec3::new(0.5, 500.0, 0.5), ..noise(Pattern::Clouds) };
        let p = Vec3A::new(0.3, 0.1, 0.2);
        assert!((long.color(p) - long.color(p + Vec3A::Y * 0.05)).abs().max_element() < 1e-3, "stretched along y");
    }

    #[test]
    fn far_points_have_a_color() {
        for pattern in [Pattern::Clouds, Pattern::Marble, Pattern::Wood] {
            let noise = Noise { octaves: Noise::MAX_OCTAVES, ..noise(pattern) };
            for p in [Vec3A::splat(1e30), Vec3A::new(-1e12, 1e12, 3.0), Vec3A::splat(5e5)] {
                let color = noise.color(p);
                assert!(color.cmpge(noise.low).all() && color.cmple(noise.high).all(), "{pattern:?} at {p}: {color}");
            }
        }
    }
}
