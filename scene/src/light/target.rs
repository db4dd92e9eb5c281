//! Where lights send photons that only a part of the scene has a use for.

use std::f64::consts::PI;

use arrayvec::ArrayVec;
use glam::{DVec2, DVec3, Vec2, Vec3, Vec3A};
use hemimap::double;

use super::Emission;
use super::choice::Choice;
use crate::bounds::narrow;
use crate::{Aabb, Ray};

/// Boxes are put in halves so often at most.
const MAX_HALVINGS: u32 = 6;
const MAX_SPHERES: usize = 1 << MAX_HALVINGS;
/// Spheres around parts take the place of one around all where their cross-sections together are less than this share of that one's.
const WORTH: f64 = 0.7;
/// What rounding may take from a radius is less than this share of it.
const MARGIN: f64 = 1e-5;
/// Lamps send photons into cones where these are no more than this share of all directions.
const MOST_DIRECTIONS: f64 = 0.3;

/// A sphere around something.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sphere {
    pub(super) centre: DVec3,
    pub(super) radius: f64,
}

/// Spheres around what photons are sent to: see [`Scene::target`](crate::Scene::target).
///
/// A photon from infinity goes through one of the cross-sections; one from a lamp into one of the cones in which the lamp sees the spheres, where these are narrow. Where
/// its way crosses several spheres, each of them might have sent it, and it carries so many times less.
#[derive(Debug, Clone)]
pub struct Target {
    spheres: Vec<Sphere>,
    /// Over the spheres, by cross-section.
    choice: Choice,
    /// All cross-sections together, m^2.
    cross_section: f64,
    /// Around all of the scene: photons from infinity start before it.
    scene: Sphere,
}

impl Target {
    /// Makes a target of the whole scene; of a unit sphere where there is nothing.
    pub(super) fn around(bounds: Aabb) -> Self {
        let Sphere { centre, radius } = Sphere::of_box(bounds);
        let scene = Sphere { centre, radius: if radius > 0.0 { radius } else { 1.0 } };
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
        let choice = Choice::new(spheres.iter().map(|sphere| sphere.radius * sphere.radius));
        let cross_section = spheres.iter().map(Sphere::cross_section).sum();
        Self { spheres, choice, cross_section, scene }
    }

    /// Returns all cross-sections together, m^2.
    pub(super) fn cross_section(&self) -> f32 {
        narrow(self.cross_section)
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
        let way = direction.as_dvec3();
        let through = self.spheres[chosen].cross(way, u_position.as_dvec2());
        let count = self.count(chosen, |sphere| sphere.is_crossed(through, way));
        let flux = irradiance * narrow(self.cross_section / count);
        // As far before the middle of the scene as its sphere is wide: its front, and a little that rounding cannot use up.
        let back = (through - self.scene.centre).dot(way) + 2.0 * self.scene.radius;
        Some(Emission { ray: Ray::new((through - way * back).as_vec3a(), direction), flux })
    }

    /// Returns in how many spheres a photon might have been sent to, as it was to the `chosen` one.
    fn count(&self, chosen: usize, may_send: impl Fn(&Sphere) -> bool) -> f64 {
        let might = self.spheres.iter().enumerate().filter(|&(i, sphere)| i == chosen || may_send(sphere));
        might.count() as f64
    }

    /// Returns the cones in which light goes from a lamp to the spheres, a sphere around it or a point; to those alone that are not all below the horizon of `normal` if
    /// there is one. `None` where together they are so wide that light which goes everywhere is as good.
    pub(super) fn cones(&self, lamp: Sphere, normal: Option<DVec3>) -> Option<Cones<'_>> {
        let (mut sum, mut sums) = (0.0, ArrayVec::new());
        for sphere in &self.spheres {
            let offset = sphere.centre - lamp.centre;
            if normal.is_none_or(|normal| offset.dot(normal) > -sphere.radius) {
                // Of the directions to the sphere, and of the lamp's cross-section.
                let directions = 0.5 * cone_height(offset, sphere.radius + lamp.radius);
                sum += directions * (sphere.radius / lamp.radius).min(1.0).powi(2);
            }
            if sum > MOST_DIRECTIONS {
                return None;
            }
            sums.push(sum);
        }
        Some(Cones { target: self, lamp, sums })
    }
}

/// Where light goes from a lamp to a target.
#[derive(Debug)]
pub(super) struct Cones<'a> {
    target: &'a Target,
    lamp: Sphere,
    /// Running sums of the shares that the cones have of all lines through the lamp, or of all directions from a point.
    sums: ArrayVec<f64, MAX_SPHERES>,
}

/// A directed line from a lamp to a target.
#[derive(Debug, Clone, Copy)]
pub(super) struct Aimed {
    /// A point on it; the lamp itself if that is one.
    pub(super) through: DVec3,
    pub(super) direction: DVec3,
    /// The reciprocal of its density, over that of lines that are spread evenly over all.
    pub(super) share: f64,
}

impl Cones<'_> {
    /// Chooses a line, evenly from those that cross a sphere, but that what several send comes more often. `None` counts as one that meets nothing.
    pub(super) fn line(&self, u_position: DVec2, u_direction: DVec2) -> Option<Aimed> {
        let Self { target, lamp, sums } = self;
        let total = *sums.last()?;
        let place = u_direction.x * total;
        let chosen = sums.partition_point(|&sum| sum <= place);
        let before = chosen.checked_sub(1).map_or(0.0, |before| sums[before]);
        let u = DVec2::new((place - before) / (sums.get(chosen)? - before), u_direction.y);
        let sphere = &target.spheres[chosen];
        let direction = in_cone(sphere.centre - lamp.centre, sphere.radius + lamp.radius, u);

        // Through the smaller one; it may miss the other.
        let is_smaller = sphere.radius < lamp.radius;
        let (small, large) = if is_smaller { (sphere, lamp) } else { (lamp, sphere) };
        let through = small.cross(direction, u_position);
        if !large.is_crossed(through, direction) {
            return None;
        }
        let may_send = |sphere: &Sphere| {
            let offset = sphere.centre - lamp.centre;
            let is_before = offset.dot(direction) > 0.0 || offset.length() <= sphere.radius + lamp.radius;
            is_before && sphere.is_crossed(through, direction)
        };
        Some(Aimed { through, direction, share: total / target.count(chosen, may_send) })
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
        let rounding = f32::EPSILON * centre.abs().max_element();
        Self { centre: centre.as_dvec3(), radius: f64::from(radius) * (1.0 + MARGIN) + f64::from(rounding) }
    }

    fn cross_section(&self) -> f64 {
        PI * self.radius * self.radius
    }

    /// Returns a point of its cross-section at right angles to a direction.
    fn cross(&self, direction: DVec3, u: DVec2) -> DVec3 {
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

/// Returns 1 - cos of half the angle of the cone around a sphere at `offset`; 2 from within.
fn cone_height(offset: DVec3, radius: f64) -> f64 {
    let sin_sq = radius * radius / offset.length_squared();
    if sin_sq < 1.0 { sin_sq / (1.0 + (1.0 - sin_sq).sqrt()) } else { 2.0 }
}

/// Returns a direction that is uniform over this cone.
fn in_cone(offset: DVec3, radius: f64, u: DVec2) -> DVec3 {
    let disk = double::square_to_disk(u);
    // 1 - cos(theta) is uniform, and a narrow cone loses no digits.
    let height = cone_height(offset, radius);
    let fall = disk.length_squared() * height;
    let frame = double::Frame::from_normal(offset.try_normalize().unwrap_or(DVec3::Z));
    let across = (frame.s * disk.x + frame.t * disk.y) * (height * (2.0 - fall)).sqrt();
    (across + frame.n * (1.0 - fall)).normalize()
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
