//! Which points of a picture look for themselves, and what the others take from them.
//!
//! The points are asked on lattices of strides 64, 32, ... 1 pixels. One that no record is near enough to looks for itself and becomes a
//! record. When all are asked, every point takes its light from all records that reach it, those made after it was asked too. A
//! batch of records is made while the index is frozen, and points of one batch lie at least a stride apart, so they seldom serve
//! each other's place.

use rayon::prelude::*;

use super::index::Index;
use super::record::Place;
use crate::explain::Step;
use crate::lattice::{Lattice, STRIDES};
use crate::secondary::Secondary;
use crate::surface_points::SurfacePoint;
use crate::terms::glossy::needs_texture;
use crate::terms::indirect::{Counts, Incident, IndirectTerm, Look};

/// A point needs no record of its own where one is nearer than this share of its reach. Records overlap so that their weights are not
/// 0 where one takes over from another, and so that several share what noise each has.
const PLACE: f32 = 0.5;

/// Evaluates every point of a picture: `ask` lets points look, by their numbers and the stride of their lattice. Where gloss needs a texture each point looks for itself.
pub(crate) fn fill<S: Secondary>(
    term: &IndirectTerm<'_, S>,
    lattice: &Lattice,
    index: &mut Index,
    counts: &mut Counts,
    mut ask: impl FnMut(Vec<usize>, usize, &mut Counts) -> Vec<(usize, Look)>,
) -> Vec<Incident> {
    let points = lattice.points();
    let mut values: Vec<Option<Incident>> =
        points.iter().map(|point| (!term.asks(point)).then(Incident::default)).collect();
    let mut has_looked = vec![false; points.len()];
    let places: Vec<Place> =
        points.par_iter().zip(&values).map(|(point, value)| place(term, point, value.is_none())).collect();
    counts.rays.hole += values.iter().filter(|value| value.is_none()).count() as u64;
    for stride in STRIDES {
        let level = lattice.level(stride, &values);
        let takes_texture = |number: &usize| needs_texture(&points[*number].shading, term.plan);
        let (textures, others): (Vec<usize>, Vec<usize>) = level.into_iter().partition(takes_texture);
        for (number, look) in ask(textures, stride, counts) {
            values[number] = Some(look.incident);
        }
        // The middles of the cells first: what they reach the sides need not be asked for.
        let (middles, sides): (Vec<usize>, Vec<usize>) =
            others.into_iter().partition(|&number| lattice.is_middle(number, stride));
        for batch in [middles, sides] {
            let frozen = &*index;
            let alone = batch.into_par_iter().filter(|&number| !frozen.covers(&places[number], PLACE)).collect();
            for (number, look) in ask(alone, stride, counts) {
                has_looked[number] = true;
                index.extend(look.record);
            }
        }
    }
    let index = &*index;
    counts.interpolated +=
        values.iter().zip(&has_looked).filter(|(value, looked)| value.is_none() && !**looked).count() as u64;
    let own_place = |number: usize| {
        let surface = &points[number].shading.surface;
        Place { p: surface.p, n: surface.n, ..places[number] }
    };
    let rest = |number: usize| {
        values[number].unwrap_or_else(|| {
            // Where its samples are far apart, a point's own record may not reach their middle.
            let light = index.interpolate(&places[number]).or_else(|| index.interpolate(&own_place(number)));
            let ([near, sky], records) = light.expect("a point that no record reached has become one");
            if !has_looked[number] {
                term.tell(&points[number], || Step::Interpolated { records });
            }
            Incident { near, sky, ..Incident::default() }
        })
    };
    (0..points.len()).into_par_iter().map(rest).collect()
}

/// A point as one that asks records, in the middle of its samples: what stands above it is found by a ray, if it `asks` any.
fn place<S: Secondary>(term: &IndirectTerm<'_, S>, point: &SurfacePoint, asks: bool) -> Place {
    let surface = &point.shading.surface;
    let overhead = || term.gatherer.scene.intersect(&surface.spawn(surface.ng));
    let hit = if asks { overhead() } else { None };
    let (p, n) = point.middle();
    Place { p, n, clearance: hit.map_or(f32::INFINITY, |hit| hit.t) }
}
