//! Which points of a picture become records, and what the others take from them.
//!
//! The points are asked on lattices of strides 64, 32, ... 1 pixels. One that no record is near enough to is gathered and becomes a record.
//! When all are asked, every point takes its light from all records that reach it, those made after it was asked too. A batch
//! of records is made while the index is frozen, and points of one batch lie at least a stride apart, so they seldom serve each
//! other's place.

use rayon::prelude::*;

use super::edges::TexelEdges;
use super::index::Index;
use super::record::{Record, RecordRules};
use crate::lattice::Lattice;
use crate::plan::CachePlan;
use crate::secondary::{Secondary, Shading};
use crate::statistics::RayCounts;
use crate::surface_points::SurfacePoint;
use crate::terms::glossy::needs_texture;
use crate::terms::indirect::{Counts, Incident, IndirectTerm};

/// Evaluates points of the picture by the irradiance cache.
#[derive(Debug)]
pub(crate) struct CacheTerm<'a, S> {
    indirect: &'a IndirectTerm<'a, S>,
    plan: &'a CachePlan,
    edges: TexelEdges,
    /// Side of a square picture of as many pixels.
    side: f32,
}

/// Distances of the lattices in pixels, coarse to fine.
const STRIDES: [usize; 7] = [64, 32, 16, 8, 4, 2, 1];

/// A point needs no record of its own where one is nearer than this share of its reach. Records overlap so that their weights are not
/// 0 where one takes over from another, and so that several share what noise each has.
const PLACE: f32 = 0.5;

impl<'a, S: Secondary> CacheTerm<'a, S> {
    /// Makes the term of a picture of `pixels` pixels.
    pub(crate) fn new(indirect: &'a IndirectTerm<'a, S>, plan: &'a CachePlan, pixels: u32) -> Self {
        Self { indirect, plan, edges: TexelEdges::new(plan.n), side: (pixels as f32).sqrt() }
    }

    /// Evaluates every point, making records where they are missing. Where gloss needs a texture, that point is gathered alone, as
    /// without a cache.
    pub(crate) fn evaluate(&self, lattice: &Lattice, index: &mut Index, counts: &mut Counts) -> Vec<Incident> {
        let points = lattice.points();
        let mut values: Vec<Option<Incident>> = vec![None; points.len()];
        self.gather_textures(points, &mut values, counts);
        for stride in STRIDES {
            let level = lattice.level(stride, &values);
            // The middles of the cells first: what they reach the sides need not be asked for.
            let (middles, sides): (Vec<usize>, Vec<usize>) =
                level.into_iter().partition(|&number| lattice.is_middle(number, stride));
            for batch in [middles, sides] {
                self.fill(points, batch, index, counts);
            }
        }
        let index = &*index;
        let rest = |(value, point): (Option<Incident>, &SurfacePoint)| {
            value.unwrap_or_else(|| {
                let surface = &point.shading.surface;
                let light = index.interpolate(surface.p, surface.n);
                let [near, sky] = light.expect("a point that no record reached has become one");
                Incident { near, sky, ..Incident::default() }
            })
        };
        counts.interpolated += values.iter().filter(|value| value.is_none()).count() as u64;
        values.into_par_iter().zip(points).map(rest).collect()
    }

    /// Settles the points that take nothing from the cache: those with gloss that needs a texture, and those without a diffuse lobe.
    fn gather_textures(&self, points: &[SurfacePoint], values: &mut [Option<Incident>], counts: &mut Counts) {
        let takes_texture = |point: &SurfacePoint| needs_texture(&point.shading, self.indirect.plan);
        let glossy: Vec<usize> = (0..points.len()).filter(|&number| takes_texture(&points[number])).collect();
        let alone: Vec<SurfacePoint> = glossy.iter().map(|&number| points[number]).collect();
        for (number, incident) in glossy.into_iter().zip(self.indirect.gather_all(&alone, counts)) {
            values[number] = Some(incident);
        }
        for (value, point) in values.iter_mut().zip(points) {
            if !point.shading.bsdf.has_diffuse() {
                value.get_or_insert_default();
            }
        }
    }

    /// Makes records at those points of a batch that none is near enough to.
    fn fill(&self, points: &[SurfacePoint], batch: Vec<usize>, index: &mut Index, counts: &mut Counts) {
        let frozen = &*index;
        let made: Vec<(Record, RayCounts)> = batch
            .into_par_iter()
            .filter(|&number| {
                let surface = &points[number].shading.surface;
                !frozen.covers(surface.p, surface.n, PLACE)
            })
            .map(|number| self.make_record(&points[number]))
            .collect();
        for (record, rays) in made {
            index.extend([record]);
            counts.rays += rays;
            counts.gathered += 1;
        }
    }

    fn make_record(&self, point: &SurfacePoint) -> (Record, RayCounts) {
        let Shading { surface, frame, .. } = &point.shading;
        let mut rays = RayCounts::default();
        let samples = self.indirect.gatherer.gather(surface, frame, self.plan.n, point.key, &mut rays);
        (Record::new(surface.p, *frame, &samples, &self.edges, &self.rules(point.footprint)), rays)
    }

    /// The rules for a record where a pixel is `footprint` metres wide. An error counts by the share of the picture that it takes: that
    /// makes the number of records the same for any number of pixels, and for any unit of length.
    fn rules(&self, footprint: f32) -> RecordRules {
        let width = footprint * self.side;
        let min_radius = self.plan.min_pixels * footprint;
        RecordRules {
            total_error: self.plan.error * width * width,
            min_radius,
            max_radius: (MAX_SHARE * self.indirect.scene_size).max(min_radius),
        }
    }
}

/// Records reach at most this share of the scene: farther than that, things that a gather has missed come between.
const MAX_SHARE: f32 = 0.25;
