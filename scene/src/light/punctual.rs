//! Lights without extent.

use std::f32::consts::PI;

use glam::{Vec2, Vec3, Vec3A};

use super::target::{Sphere, Target};
use super::{Emission, LightSample, is_over_horizon};
use crate::{PunctualLight, Ray};

/// Returns the light with a unit direction.
pub(super) fn normalised(light: PunctualLight) -> PunctualLight {
    match light {
        PunctualLight::Directional { direction, irradiance } => {
            PunctualLight::Directional { direction: direction.normalize(), irradiance }
        }
        PunctualLight::Point { .. } => light,
    }
}

/// Returns the flux, W; of a directional light that to the target.
pub(super) fn flux(light: &PunctualLight, target: &Target) -> Vec3 {
    match *light {
        PunctualLight::Point { intensity, .. } => intensity * (4.0 * PI),
        PunctualLight::Directional { irradiance, .. } => irradiance * target.cross_section(),
    }
}

#[inline]
pub(super) fn sample(light: &PunctualLight, p: Vec3A, n: Vec3A, probability: f32) -> Option<LightSample> {
    match *light {
        PunctualLight::Point { position, intensity } => {
            let offset = Vec3A::from(position) - p;
            let distance = offset.length();
            let (wi, radiance) = (offset / distance, intensity / (distance * distance));
            // At the light itself the irradiance has no bound.
            let is_sound = is_over_horizon(n, wi) && radiance.is_finite();
            is_sound.then_some(LightSample { wi, distance, radiance, pdf: probability, delta: true })
        }
        PunctualLight::Directional { direction, irradiance } => {
            let wi = -Vec3A::from(direction);
            let distance = f32::INFINITY;
            is_over_horizon(n, wi).then_some(LightSample {
                wi,
                distance,
                radiance: irradiance,
                pdf: probability,
                delta: true,
            })
        }
    }
}

#[inline]
pub(super) fn emit(
    light: &PunctualLight,
    target: &Target,
    u_sphere: f32,
    u_position: Vec2,
    u_direction: Vec2,
) -> Option<Emission> {
    match *light {
        PunctualLight::Point { position, .. } => {
            let (direction, share) = match target.cones(Sphere::point(position.into()), None) {
                None => (uniform_direction(u_direction), 1.0),
                Some(cones) => cones.direction(u_sphere, u_direction)?,
            };
            Some(Emission { ray: Ray::new(position.into(), direction), flux: flux(light, target) * share })
        }
        PunctualLight::Directional { direction, irradiance } => {
            target.emission(direction.into(), irradiance, u_sphere, u_position)
        }
    }
}

/// Returns a direction that is uniform over the sphere.
fn uniform_direction(u: Vec2) -> Vec3A {
    // The lower half of u.x goes below: both hemispheres keep an even map.
    let below = u.x < 0.5;
    let half = Vec2::new(if below { 2.0 * u.x } else { 2.0 * u.x - 1.0 }, u.y);
    let w = hemimap::square_to_uniform_hemisphere(half);
    if below { Vec3A::new(w.x, w.y, -w.z) } else { w }
}
