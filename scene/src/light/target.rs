//! Where lights send photons that only a part of the scene has a use for.

use std::f64::consts::PI;

use arrayvec::ArrayVec;
use glam::{DVec2, DVec3, Vec2, Vec3, Vec3A};
use hemimap::double;

use super::Emission;
use super::choice::Choice;
use super::region::Cone;
use crate::bounds::narrow;
use crate::{Aabb, Ray};

/// Boxes are put in halves so often at most.
const MAX_HALVINGS: u32 = 6;
const MAX_SPHERES: usize = 1 << MAX_HALVINGS;
/// Spheres around parts take the place of one around all where their cross-sections together are less than this share
/// of that one's.
const WORTH: f64 = 0.7;
/// What rounding may take from a radius is less than this share of it, and this share of the coordinates.
const MARGIN: f64 = 1e-5;
const ROUNDING: f64 = 8.0 * f32::EPSILON as f64;
/// Lamps send photons into cones where these are no more than this share of all directions. From 0.1 to 0.6 the noise
/// of caustics is about the same.
const MOST_DIRECTIONS: f64 = 0.3;
/// So much of all photons is dealt by the size of spheres, the rest evenly: what is small gets enough to be noticed,
/// and photons of the large ones carry about alike.
const BY_SIZE: f64 = 0.9;

/// A sphere around something.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sphere {
    pub(super) centre: DVec3,
    pub(super) radius: f64,
}

/// Spheres around what photons are sent to: see [`Scene::target`](crate::Scene::target).
///
/// A photon from infinity goes through one of the cross-sections; one from a lamp into one of the cones in which the
/// lamp sees the spheres, where these are narrow. Where its way crosses several spheres, each of them might have sent
/// it: its density is the sum of theirs.
#[derive(Debug, Clone)]
pub struct Target {
    /// For lamps.
    spheres: Vec<Sphere>,
    /// For light from infinity: a little wider, for its photons start where the coordinates of the whole scene are
    /// rounded.
    wide: Vec<Sphere>,
    /// Over the wide ones.
    choice: Choice,
    /// All of their cross-sections together, m^2.
    cross_section: f64,
    /// Around all of the scene that has bounds: photons from infinity start before it.
    scene: Sphere,
    /// Whether all of the scene is meant, also what has no bounds.
    is_everything: bool,
}

impl Target {
    /// Makes a target of the whole scene; its sphere is a unit sphere where nothing has bounds.
    pub(super) fn around(bounds: Aabb) -> Self {
        let Sphere { centre, radius } = Sphere::of_box(bounds);
        let scene = Sphere { centre, radius: if radius > 0.0 { radius } else { 1.0 } };
        Self::new(vec![scene], scene, true)
    }

    /// Makes a target of a part of the scene from the boxes around it.
    pub(crate) fn narrowed(&self, mut boxes: Vec<Aabb>) -> Self {
        let mut spheres = Vec::new();
        if !boxes.is_empty() {
            cover(&mut boxes, MAX_HALVINGS, &mut spheres);
        }
        Self::new(spheres, self.scene, false)
    }

    fn new(spheres: Vec<Sphere>, scene: Sphere, is_everything: bool) -> Self {
        let rounding = ROUNDING * (scene.centre.abs().max_element() + scene.radius);
        let wide: Vec<Sphere> =
            spheres.iter().map(|sphere| Sphere { radius: sphere.radius + rounding, ..*sphere }).collect();
        let cross_section = wide.iter().map(Sphere::cross_section).sum();
        let chance = |sphere: &Sphere| chance(sphere.cross_section(), cross_section, wide.len());
        let choice = Choice::new(wide.iter().map(chance));
        Self { spheres, wide, choice, cross_section, scene, is_everything }
    }

    /// Returns all cross-sections together, m^2.
    pub(super) fn cross_section(&self) -> f32 {
        narrow(self.cross_section)
    }

    /// Returns a photon of light that comes from infinity along `direction`, from its irradiance on a surface at right
    /// angles to it.
    pub(super) fn emission(
        &self,
        direction: Vec3A,
        irradiance: Vec3,
        u_sphere: f32,
        u_position: Vec2,
    ) -> Option<Emission> {
        let (chosen, _) = self.choice.sample(f64::from(u_sphere))?;
        let way = direction.as_dvec3();
        let through = self.wide[chosen].cross(way, u_position.as_dvec2());
        let density = |(i, sphere): (usize, &Sphere)| {
            let may_send = i == chosen || sphere.is_crossed(through, way);
            if may_send { f64::from(self.choice.probability(i)) / sphere.cross_section() } else { 0.0 }
        };
        let density: f64 = self.wide.iter().enumerate().map(density).sum();
        // As far before the middle of the scene as its sphere is wide: its front, and a little that rounding cannot use
        // up.
        let back = (through - self.scene.centre).dot(way) + 2.0 * self.scene.radius;
        let ray = Ray::new((through - way * back).as_vec3a(), direction);
        Some(Emission { ray, flux: irradiance / narrow(density) })
    }

    /// Returns the cones in which light goes from a lamp to the spheres, a sphere around it or a point; to those alone
    /// that are not all below the horizon of `normal` if there is one. `None` where all of the scene is meant, and
    /// where the cones are so wide together that light which goes everywhere is as good.
    pub(super) fn cones(&self, lamp: Sphere, normal: Option<DVec3>) -> Option<Cones<'_>> {
        if self.is_everything {
            return None;
        }
        let (mut total, mut shares) = (0.0, ArrayVec::<f64, MAX_SPHERES>::new());
        for sphere in &self.spheres {
            let offset = sphere.centre - lamp.centre;
            let is_below = normal.is_some_and(|normal| offset.dot(normal) <= -sphere.radius);
            let share = if is_below {
                0.0
            } else {
                // Of the directions to the sphere, and of the lamp's cross-section.
                let directions = 0.5 * cone(offset, sphere.radius + lamp.radius).depth;
                directions * (sphere.radius / lamp.radius).min(1.0).powi(2)
            };
            total += share;
            if total > MOST_DIRECTIONS {
                return None;
            }
            shares.push(share);
        }
        let seen = shares.iter().filter(|share| **share > 0.0).count();
        Some(Cones { target: self, lamp, shares, total, seen })
    }
}

/// Returns the probability of a sphere of this size.
fn chance(size: f64, total: f64, count: usize) -> f64 {
    if size > 0.0 { BY_SIZE * size / total + (1.0 - BY_SIZE) / count as f64 } else { 0.0 }
}

/// Where light goes from a lamp to a target.
#[derive(Debug)]
pub(super) struct Cones<'a> {
    target: &'a Target,
    lamp: Sphere,
    /// What part the cone of each sphere is of all lines through the lamp, or of all directions from a point; 0 below
    /// the horizon.
    shares: ArrayVec<f64, MAX_SPHERES>,
    /// Their sum.
    total: f64,
    /// Number of those that are not 0.
    seen: usize,
}

/// A directed line from a lamp to a target.
#[derive(Debug, Clone, Copy)]
pub(super) struct Aimed {
    /// A point on it; the lamp itself if that is one.
    pub(super) through: DVec3,
    pub(super) direction: DVec3,
    /// The reciprocal of its density, over that of lines that are spread evenly over all.
    pub(super) share: f64,
    /// What is left of the number that chose a sphere, uniform in [0, 1) again.
    pub(super) rest: f64,
}

impl Cones<'_> {
    /// Chooses a line that crosses one of the spheres; `u_position` matters to a lamp with extent alone. `None` counts
    /// as one that meets nothing.
    pub(super) fn line(&self, u_sphere: f64, u_position: DVec2, u_direction: DVec2) -> Option<Aimed> {
        let Self { target, lamp, .. } = self;
        let (chosen, rest) = self.choose(u_sphere)?;
        let sphere = &target.spheres[chosen];
        let offset = sphere.centre - lamp.centre;
        let local = cone(offset, sphere.radius + lamp.radius).at(double::square_to_disk(u_direction));
        let direction =
            double::Frame::from_normal(offset.try_normalize().unwrap_or(DVec3::Z)).to_world(local).normalize();

        // Through the smaller one; it may miss the other.
        let is_smaller = sphere.radius < lamp.radius;
        let (small, large) = if is_smaller { (sphere, lamp) } else { (lamp, sphere) };
        let through = small.cross(direction, u_position);
        if !large.is_crossed(through, direction) {
            return None;
        }
        let density = |(i, sphere): (usize, &Sphere)| {
            let offset = sphere.centre - lamp.centre;
            let is_before = offset.dot(direction) > 0.0 || offset.length() <= sphere.radius + lamp.radius;
            let may_send = i == chosen || is_before && sphere.is_crossed(through, direction);
            if may_send && self.shares[i] > 0.0 { self.chance(i) / self.shares[i] } else { 0.0 }
        };
        let density: f64 = target.spheres.iter().enumerate().map(density).sum();
        Some(Aimed { through, direction, share: 1.0 / density, rest })
    }

    /// Chooses a direction from a point, as [`Self::line`]; and its share.
    pub(super) fn direction(&self, u_sphere: f32, u: Vec2) -> Option<(Vec3A, f32)> {
        let Aimed { direction, share, .. } = self.line(u_sphere.into(), DVec2::ZERO, u.as_dvec2())?;
        Some((direction.as_vec3a(), narrow(share)))
    }

    /// Returns the sphere that `u` in [0, 1) chooses, and what is left of it.
    fn choose(&self, mut u: f64) -> Option<(usize, f64)> {
        for i in 0..self.shares.len() {
            let chance = self.chance(i);
            if u < chance {
                return Some((i, u / chance));
            }
            u -= chance;
        }
        None
    }

    fn chance(&self, i: usize) -> f64 {
        chance(self.shares[i], self.total, self.seen)
    }
}

impl Sphere {
    /// Returns a sphere without extent.
    pub(super) fn point(centre: Vec3A) -> Self {
        Self { centre: centre.as_dvec3(), radius: 0.0 }
    }

    pub(super) fn of_box(bounds: Aabb) -> Self {
        Self { centre: bounds.centre().as_dvec3(), radius: bounds.radius().into() }
    }

    fn around(boxes: &[Aabb]) -> Self {
        let all = boxes.iter().fold(Aabb::EMPTY, |all, &b| all.union(b));
        let centre = all.centre();
        let farthest = |b: &Aabb| (b.max - centre).max(centre - b.min).length();
        let radius = boxes.iter().map(farthest).fold(0.0, f32::max);
        let rounding = ROUNDING * f64::from(centre.abs().max_element());
        Self { centre: centre.as_dvec3(), radius: f64::from(radius) * (1.0 + MARGIN) + rounding }
    }

    fn cross_section(&self) -> f64 {
        PI * self.radius * self.radius
    }

    /// Returns a point of its cross-section at right angles to a direction.
    pub(super) fn cross(&self, direction: DVec3, u: DVec2) -> DVec3 {
        let frame = double::Frame::from_normal(direction);
        let disk = double::square_to_disk(u) * self.radius;
        self.centre + frame.s * disk.x + frame.t * disk.y
    }

    /// Whether a line crosses it.
    fn is_crossed(&self, p: DVec3, direction: DVec3) -> bool {
        let offset = p - self.centre;
        (offset - direction * offset.dot(direction)).length_squared() < self.radius * self.radius
    }
}

/// Returns the cone around a sphere at `offset`; all directions from within.
fn cone(offset: DVec3, radius: f64) -> Cone {
    Cone::of_sine(radius * radius / offset.length_squared()).unwrap_or(Cone::WHOLE)
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
        let parts: f64 = spheres[start..].iter().map(Sphere::cross_section).sum();
        if parts < WORTH * whole.cross_section() {
            return;
        }
        spheres.truncate(start);
    }
    spheres.push(whole);
}
