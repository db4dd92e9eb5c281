//! The light that a surface sends back along a ray that met it, by a walk that ends where a secondary solution knows
//! the light.

use std::iter::zip;

use glam::{Vec3, Vec3A};
use scene::{LightChoice, Lobes, Scene, Surface};

use crate::sampler::Sampler;
use crate::secondary::{Secondary, Shading};
use crate::statistics::RayCounts;
use crate::walk::{Taken, Visitor, walk};

/// Follows light at secondary hits.
#[derive(Debug)]
pub(crate) struct Follower<'a, S> {
    pub(crate) scene: &'a Scene,
    pub(crate) secondary: &'a S,
    /// Width in radians of the lobe that asks: where it is narrower than what the solution resolves, direct light is
    /// sampled even if the solution knows it, so that shadows in reflections are sharp. Infinite for the rays of a
    /// hemisphere.
    pub(crate) spread: f32,
}

impl<S: Secondary> Follower<'_, S> {
    /// What a surface that was met sends back, without what it emits, and without light that came there by
    /// mirrors or glass alone: that is the caustic of the point that gathers.
    pub(crate) fn reflection(&self, met: Shading, sampler: &mut Sampler, rays: &mut RayCounts) -> Reflection {
        let mut answer = Answer { follower: self, reflection: Reflection::DARK, turns: 0, is_turned: false };
        walk(self.scene, met, sampler, rays, &mut answer);
        answer.reflection
    }
}

/// The light that a walk finds with the help of a secondary solution.
struct Answer<'a, S> {
    follower: &'a Follower<'a, S>,
    reflection: Reflection,
    /// Directions so far, and whether what is found is for the last of them.
    turns: usize,
    is_turned: bool,
}

impl<S: Secondary> Visitor for Answer<'_, S> {
    fn visit(&mut self, shading: &Shading, beta: Vec3, near: f32) -> Taken {
        let known = self.follower.secondary.irradiance(&shading.surface).filter(|known| near >= known.resolution);
        let Some(known) = known else { return Taken::Nothing };
        let direct = known.direct.filter(|_| self.follower.spread * near >= known.resolution);
        let irradiance = direct.unwrap_or_default() + known.indirect;
        self.add(beta * shading.bsdf.diffuse * irradiance * std::f32::consts::FRAC_1_PI);
        if direct.is_some() { Taken::All } else { Taken::Indirect }
    }

    fn turn(&mut self, way: Option<(Lobes, Vec3A)>) {
        self.is_turned = way.is_some();
        if let Some((lobes, wi)) = way {
            let turned = &mut self.reflection.turned[self.turns];
            (turned.lobes, turned.wi) = (lobes, wi);
            self.turns += 1;
        }
    }

    fn add(&mut self, radiance: Vec3) {
        let reflection = &mut self.reflection;
        let sum = if self.is_turned { &mut reflection.turned[self.turns - 1].radiance } else { &mut reflection.even };
        *sum += radiance;
    }

    fn light_choice(&self) -> Option<&LightChoice> {
        self.follower.secondary.light_choice()
    }

    fn caustic_irradiance(&self, surface: &Surface) -> Vec3 {
        self.follower.secondary.quick_caustic_irradiance(surface)
    }
}

/// What a surface sends back along a ray that met it, apart from what it gives off.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Reflection {
    /// What it sends everywhere.
    even: Vec3,
    /// What it sends along the ray of light that came to it along one direction or the other.
    turned: [Turned; 2],
}

/// Light that came along a local direction and is reflected by some of the lobes.
#[derive(Debug, Clone, Copy)]
struct Turned {
    lobes: Lobes,
    wi: Vec3A,
    radiance: Vec3,
}

impl Reflection {
    /// No light.
    pub(crate) const DARK: Self =
        Self { even: Vec3::ZERO, turned: [Turned { lobes: Lobes::ALL, wi: Vec3A::Z, radiance: Vec3::ZERO }; 2] };

    /// All that is sent along the ray.
    pub(crate) fn radiance(&self) -> Vec3 {
        self.turned.iter().fold(self.even, |sum, turned| sum + turned.radiance)
    }

    /// Returns what the surface `met` sends along other unit vectors, as far as what came along the ray tells.
    pub(crate) fn towards(&self, met: &Shading) -> impl Fn(Vec3A) -> Vec3 {
        let Self { even, turned } = *self;
        let Shading { frame, bsdf, wo, .. } = *met;
        let irradiances = turned.map(|Turned { lobes, wi, radiance }| {
            if radiance == Vec3::ZERO {
                return Vec3::ZERO;
            }
            let f = bsdf.eval(lobes, wo, wi);
            Vec3::select(f.cmpgt(Vec3::ZERO), radiance / f, Vec3::ZERO)
        });
        move |wo| {
            let wo = frame.to_local(wo);
            zip(turned, irradiances).fold(even, |sum, (Turned { lobes, wi, .. }, irradiance)| {
                if irradiance == Vec3::ZERO { sum } else { sum + bsdf.eval(lobes, wo, wi) * irradiance }
            })
        }
    }
}
