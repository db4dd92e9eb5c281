//! Indirect light of points that are wider than records reach: where a surface is seen so flatly that light changes
//! within the pixel, as in the gap above a lamp or along the foot of a wall.
//!
//! What one place of such a point sees is no more than a sample of its light, and a poor one. So it is looked at from
//! several of its places, as primary rays find them, and with about as many rays in all as one look takes.

use glam::Vec3;
use rayon::prelude::*;
use scene::Surface;

use super::indirect::{Counts, Incident, IndirectTerm};
use crate::explain::Step;
use crate::rungs::Rung;
use crate::sampler::{Rng, hash_pair, in_cell};
use crate::secondary::Secondary;
use crate::statistics::{RayCounts, map_counting};
use crate::surface_points::{SurfacePoint, same_surface};

/// Primary rays along a side of a pixel.
const SIDE: u32 = 4;
/// Keeps the random numbers of places apart from those of gathers.
const PLACES_STREAM: u64 = 0x7769_6465;

impl<S: Secondary> IndirectTerm<'_, S> {
    /// The mean light of the points `todo`, all of them seen directly, over what the pixel shows of their surfaces.
    pub(crate) fn look_over(
        &self,
        points: &[&SurfacePoint],
        todo: Vec<usize>,
        counts: &mut Counts,
    ) -> Vec<(usize, Incident)> {
        map_counting(todo.into_par_iter(), &mut counts.rays, |number, rays| (number, self.over(points[number], rays)))
    }

    fn over(&self, point: &SurfacePoint, rays: &mut RayCounts) -> Incident {
        let places = self.places(point, rays);
        let share = 1.0 / places.len() as f32;
        let n = round_up(self.plan.records.look_n as f32 * share.sqrt());
        let mut sum = [Vec3::ZERO; 2];
        for (place, key) in places.iter().zip(0..) {
            let light = self.gatherer.mean_radiance(place, n, hash_pair(point.key, key), rays);
            sum[0] += light[0];
            sum[1] += light[1];
        }
        self.tell(point, || Step::Spread { places: places.len(), resolution: n });
        let [near, sky] = sum.map(|part| part * share);
        Incident { near, sky, rung: Rung::Gathered, ..Incident::default() }
    }

    /// Places of a point's surface, evenly over the pixel: at least the one that stands for it.
    fn places(&self, point: &SurfacePoint, rays: &mut RayCounts) -> Vec<Surface> {
        let surface = &point.shading.surface;
        let scene = self.gatherer.scene;
        let mut jitter = Rng::new(self.gatherer.seed ^ PLACES_STREAM, point.key);
        rays.camera += u64::from(SIDE * SIDE);
        let seen = (0..SIDE * SIDE).filter_map(|number| {
            let film = point.position.as_vec2() + in_cell(number, SIDE, jitter.next_2d());
            let ray = scene.camera_ray(film, self.size);
            let found = scene.surface(&ray, &scene.intersect(&ray)?);
            same_surface(surface, &found, found.t).then_some(found)
        });
        let places: Vec<Surface> = seen.collect();
        if places.is_empty() { vec![*surface] } else { places }
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most the resolution of a look")]
fn round_up(n: f32) -> usize {
    n.ceil() as usize
}
