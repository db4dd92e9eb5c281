//! Glass that stands on something: two surfaces in one place, of which rounding would choose by chance.
//!
//! A ray that leaves the glass there and is taken to have met the glass starts beyond what it stands on, and is lost;
//! one that comes from below starts within the glass. So light would pass one way and not the other. What is opaque
//! wins instead, as if it reached a little into the glass.

use crate::{Aabb, Hit, Ray, Scene};

/// Transparent surfaces that are passed in search for an opaque one: two triangles of one face meet in an edge, and so
/// may two faces.
const MOST_PASSED: usize = 4;
/// Rounding of distances along rays, as a share of the largest coordinate: corners may lie so far away.
const ROUNDING: f32 = 8.0 * f32::EPSILON;
/// Least cosine by which an error along the normal becomes one along the ray.
const LEAST_COSINE: f32 = 0.01;

impl Scene {
    /// Returns the opaque surface in the place of the glass that a ray leaves by `hit`, or `hit` where there is none or
    /// the ray enters.
    #[cold]
    pub(crate) fn touched(&self, ray: &Ray, hit: Hit) -> Hit {
        let glass = self.surface(ray, &hit);
        if glass.front {
            return hit;
        }
        let Aabb { min, max } = self.bounds();
        let reach =
            ROUNDING * min.abs().max(max.abs()).max_element() / glass.ng.dot(ray.direction).abs().max(LEAST_COSINE);
        let mut rest =
            Ray { t_min: hit.t.next_down(), t_max: ray.t_max.min(hit.t + reach), from: hit.primitive, ..*ray };
        for _ in 0..MOST_PASSED {
            let Some(next) = self.nearest(&rest) else { break };
            if self.is_glass(&next) {
                (rest.t_min, rest.from) = (next.t, next.primitive);
                continue;
            }
            // Points are known better than distances.
            let opaque = self.surface(ray, &next);
            let gap = (opaque.p - glass.p).dot(opaque.ng).abs();
            let is_one_place = gap <= opaque.p_error + glass.p_error && next.primitive != ray.from;
            return if is_one_place { Hit { media: hit.media, ..next } } else { hit };
        }
        hit
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Description, Material, Mesh, SpecularKind};
    use glam::{Vec3, Vec3A};

    #[test]
    fn rays_within_glass_meet_what_it_stands_on() {
        let glass = SpecularKind::Dielectric { ior: 1.5, tint: Vec3::ONE, absorption: Vec3::splat(0.7), priority: 0 };
        let square = |half: f32, turn: f32, y: f32| {
            let corner = |(x, z): (f32, f32)| {
                let (sin, cos) = turn.sin_cos();
                half * Vec3::new(cos * x - sin * z, y / half, sin * x + cos * z)
            };
            [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)].map(corner).to_vec()
        };
        let mesh = |positions, triangles, material| Mesh {
            positions,
            triangles,
            materials: vec![material; 2],
            ..Mesh::default()
        };
        let up = vec![[0, 1, 2], [0, 2, 3]];
        let down = vec![[0, 2, 1], [0, 3, 2]];
        for y in [0.0, 0.7, 103.3] {
            let floor = mesh(square(300.0, 0.0, y), up.clone(), 0);
            let base = mesh(square(0.4, 0.52, y), down.clone(), 1);
            let lid = mesh(square(0.4, 0.52, y + 0.5), up.clone(), 1);
            let materials =
                vec![Material::default(), Material { diffuse: Vec3::ZERO, specular: glass, ..Material::default() }];
            let scene = Scene::new(Description { meshes: vec![base, floor, lid], materials, ..Description::default() })
                .unwrap();
            for number in 0..800u16 {
                let origin = Vec3A::new(0.03, y + if number % 2 == 0 { 0.4 } else { 0.003 }, -0.02);
                let (sin, cos) = (0.37 * f32::from(number)).sin_cos();
                let slope = f32::from(number) / 2400.0;
                let direction = Vec3A::new(slope * cos, -1.0, slope * sin).normalize();
                let hit = scene.intersect(&Ray::new(origin, direction)).expect("the floor");
                assert!(!scene.is_glass(&hit), "ray {number} at a height of {y} leaves by the base");
            }
            let from_above = Ray::new(Vec3A::new(0.03, y + 1.0, -0.02), Vec3A::NEG_Y);
            let lid = scene.surface(&from_above, &scene.intersect(&from_above).expect("the lid"));
            let within = lid.spawn(Vec3A::NEG_Y);
            let left = scene.transmittance(&scene.surface(&within, &scene.intersect(&within).expect("the floor"))).x;
            assert!((left - (-0.5f32 * 0.7).exp()).abs() < 1e-4, "{left} is left of the way through the glass");
        }
    }
}
