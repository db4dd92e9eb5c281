//! Records of irradiance of the points of a picture.

use glam::Vec3;
use hemimap::Frame;
use radcache::Samples;

use super::edges::TexelEdges;
use super::record::{Record, RecordRules};
use crate::plan::{Plan, max_reach};
use crate::surface_points::SurfacePoint;

/// Makes records of what points see.
#[derive(Debug)]
pub(crate) struct Recorder {
    /// The edges of textures of the resolutions that points see by.
    edges: Vec<TexelEdges>,
    /// See [`Plan::error`].
    error: f32,
    by_hessian: bool,
    gradients: bool,
    /// Side of a square picture of as many pixels.
    side: f32,
    /// Size of the scene, metres.
    scene_size: f32,
}

/// Smallest radius of a record, pixels.
const MIN_PIXELS: f32 = 1.5;

impl Recorder {
    /// Makes records for a picture of as many pixels as a square one of the given `side`, in a scene of `scene_size` metres.
    pub(crate) fn new(plan: &Plan, side: f32, scene_size: f32) -> Self {
        let mut resolutions = vec![plan.n, plan.look_n];
        resolutions.dedup();
        let edges = resolutions.into_iter().map(TexelEdges::new).collect();
        let Plan { error, by_hessian, gradients, .. } = *plan;
        Self { edges, error, by_hessian, gradients, side, scene_size }
    }

    /// The record of a point that sees `samples` in `frame`, of the mean radiance `mean`.
    ///
    /// # Panics
    /// If the samples have neither of the resolutions of the plan.
    pub(crate) fn record(&self, point: &SurfacePoint, frame: Frame, samples: &Samples, mean: [Vec3; 2]) -> Record {
        let of_resolution = |edges: &&TexelEdges| edges.resolution() == samples.resolution();
        let edges = self.edges.iter().find(of_resolution).expect("a resolution of the plan");
        Record::new(point.shading.surface.p, frame, samples, mean, edges, &self.rules(point.footprint))
    }

    /// The rules for a record where a pixel is `footprint` metres wide. An error counts by the share of the picture that it takes: that
    /// makes the number of records the same for any number of pixels, and for any unit of length.
    fn rules(&self, footprint: f32) -> RecordRules {
        let width = footprint * self.side;
        let min_radius = MIN_PIXELS * footprint;
        RecordRules {
            total_error: self.error * width * width,
            min_radius,
            max_radius: max_reach(footprint, self.side, self.scene_size).max(min_radius),
            by_hessian: self.by_hessian,
            gradients: self.gradients,
        }
    }
}
