//! Records of irradiance of the points of a picture.

use glam::Vec3;
use hemimap::Frame;
use radcache::Samples;

use super::edges::TexelEdges;
use super::record::{Record, RecordRules};
use crate::plan::RecordPlan;
use crate::surface_points::SurfacePoint;

/// Makes records of what points see.
#[derive(Debug)]
pub(crate) struct Recorder<'a> {
    /// The edges of textures of the resolutions that points see by.
    edges: Vec<TexelEdges>,
    plan: &'a RecordPlan,
}

/// Derivatives need no more than about so many blocks of texels along a side.
const BLOCKS: usize = 16;

impl<'a> Recorder<'a> {
    /// Makes records as the plan has them.
    pub(crate) fn new(plan: &'a RecordPlan) -> Self {
        let step = |n: usize| (n / BLOCKS).max(1);
        let edges = plan.resolutions().into_iter().map(|n| TexelEdges::new(n, step(n))).collect();
        Self { edges, plan }
    }

    /// The record of a point that sees `samples` in `frame`, of the mean radiance `mean`, which may sum to that
    /// `error`.
    ///
    /// # Panics
    /// If the samples have none of the resolutions of the plan.
    pub(crate) fn record(
        &self,
        point: &SurfacePoint,
        frame: Frame,
        samples: &Samples,
        mean: [Vec3; 2],
        error: f32,
    ) -> Record {
        let of_resolution = |edges: &&TexelEdges| edges.resolution() == samples.resolution();
        let edges = self.edges.iter().find(of_resolution).expect("a resolution of the plan");
        Record::new(point.shading.surface.p, frame, samples, mean, edges, &self.rules(point.footprint, error))
    }

    /// The rules for a record where a pixel is `footprint` metres wide. An error counts by the share of the picture
    /// that it takes: that makes the number of records the same for any number of pixels, and for any unit of length.
    fn rules(&self, footprint: f32, error: f32) -> RecordRules {
        let plan = self.plan;
        let width = plan.picture_width(footprint);
        let min_radius = plan.min_reach(footprint);
        RecordRules {
            total_error: error * width * width,
            min_radius,
            highlight_radius: RecordPlan::shortest_reach(footprint),
            max_radius: plan.max_reach(footprint).max(min_radius),
            max_share_of_distance: plan.max_share_of_distance,
            by_hessian: plan.by_hessian,
            gradients: plan.gradients,
            walls: plan.walls,
            gaps: plan.gaps,
        }
    }
}
