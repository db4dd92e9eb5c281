//! Where lights at infinity send photons.

use std::f32::consts::PI;

use glam::{Vec2, Vec3, Vec3A};

use super::Emission;
use super::choice::Choice;
use crate::{Aabb, Ray};

/// Boxes are put in halves so often at most, which makes no more than 64 spheres.
const MAX_HALVINGS: u32 = 6;
/// Spheres around parts take the place of one around all where their cross-sections together are less than this share of that one's.
const WORTH: f32 = 0.7;
/// What rounding may take from a radius is less than this share of it.
const MARGIN: f32 = 1e-5;

/// A sphere around something.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sphere {
    pub(super) centre: Vec3A,
    pub(super) radius: f32,
}

/// Spheres around what photons of lights at infinity are sent to: see [`Scene::target`](crate::Scene::target).
///
/// A photon goes through one of the cross-sections. Where its way crosses several, each of them might have sent it, and it carries so many times less.
#[derive(Debug, Clone)]
pub struct Target {
    spheres: Vec<Sphere>,
    /// Over the spheres, by cross-section.
    choice: Choice,
    /// All cross-sections together, m^2.
    cross_section: f32,
    /// Around all of the scene: photons start before it.
    scene: Sphere,
}

impl Target {
    /// Makes a target of the whole scene; of a unit sphere where there is nothing.
    pub(super) fn around(bounds: Aabb) -> Self {
        let radius = bounds.radius();
        let scene = Sphere { centre: bounds.centre().into(), radius: if radius > 0.0 { radius } else { 1.0 } };
        Self::new(vec![scene], scene)
    }

    /// Makes a target of a part of the scene from the boxes around it.
    pub(crate) fn narrowed(&self, mut boxes: Vec<Aabb>) -> Self {
        let mut spheres = Vec::new();
        if !boxes.is_empty() {
            cover(&mut boxes, MAX_HALVINGS, &mut spheres);
        }
        Self::new(spheres, self.scene)
    }

    fn new(spheres: Vec<Sphere>, scene: Sphere) -> Self {
        let choice = Choice::new(spheres.iter().map(|sphere| f64::from(sphere.radius).powi(2)));
        let cross_section = spheres.iter().map(Sphere::cross_section).sum();
        Self { spheres, choice, cross_section, scene }
    }

    /// Returns all cross-sections together, m^2.
    pub(super) fn cross_section(&self) -> f32 {
        self.cross_section
    }

    /// Returns a photon of light that comes from infinity along `direction`, from its irradiance on a surface at right angles to it.
    pub(super) fn emission(
        &self,
        direction: Vec3A,
        irradiance: Vec3,
        u_sphere: f32,
        u_position: Vec2,
    ) -> Option<Emission> {
        let (chosen, _) = self.choice.sample(u_sphere)?;
        let sphere = &self.spheres[chosen];
        let frame = hemimap::Frame::from_normal(-direction);
        let disk = hemimap::square_to_disk(u_position) * sphere.radius;
        let through = sphere.centre + frame.s * disk.x + frame.t * disk.y;
        let others =
            self.spheres.iter().enumerate().filter(|&(i, other)| i != chosen && other.is_crossed(through, direction));
        let flux = irradiance * (self.cross_section / (1 + others.count()) as f32);
        // As far before the middle of the scene as its sphere is wide: its front, and a little that rounding cannot use up.
        let back = (through - self.scene.centre).dot(direction) + 2.0 * self.scene.radius;
        Some(Emission { ray: Ray::new(through - direction * back, direction), flux })
    }
}

impl Sphere {
    fn around(boxes: &[Aabb]) -> Self {
        let all = boxes.iter().fold(Aabb::EMPTY, |all, &b| all.union(b));
        let centre = all.centre();
        let farthest = |b: &Aabb| (b.max - centre).max(centre - b.min).length();
        let radius = boxes.iter().map(farthest).fold(0.0, f32::max);
        let rounding = f32::EPSILON * centre.abs().max_element();
        Self { centre: centre.into(), radius: radius * (1.0 + MARGIN) + rounding }
    }

    fn cross_section(&self) -> f32 {
        PI * self.radius * self.radius
    }

    /// Whether a line crosses it.
    fn is_crossed(&self, p: Vec3A, direction: Vec3A) -> bool {
        let offset = p - self.centre;
        (offset - direction * offset.dot(direction)).length_squared() < self.radius * self.radius
    }
}

/// Puts spheres around boxes, as few as have small cross-sections.
fn cover(boxes: &mut [Aabb], halvings: u32, spheres: &mut Vec<Sphere>) {
    let whole = Sphere::around(boxes);
    let centres = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(Aabb::of_points(&[b.centre()])));
    let size = centres.max - centres.min;
    if halvings > 0 && size.max_element() > 0.0 {
        let axis = size.max_position();
        let middle = centres.centre()[axis];
        boxes.sort_unstable_by_key(|b| b.centre()[axis] >= middle);
        let (low, high) = boxes.split_at_mut(boxes.partition_point(|b| b.centre()[axis] < middle));
        let start = spheres.len();
        for half in [low, high] {
            if !half.is_empty() {
                cover(half, halvings - 1, spheres);
            }
        }
        let parts: f32 = spheres[start..].iter().map(Sphere::cross_section).sum();
        if parts < WORTH * whole.cross_section() {
            return;
        }
        spheres.truncate(start);
    }
    spheres.push(whole);
}
