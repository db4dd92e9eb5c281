//! The buffers of a reprojection, and what another point sees at its end.

use glam::{Mat3A, Vec3, Vec3A};
use hemimap::Frame;
use radcache::{Elements, MAX_RESOLUTION, Record};

use crate::holes::Hole;
use crate::horizon::TexelCentres;
use crate::masks::{Masks, Rows};
use crate::{Traced, Tracer};

/// What of the square an element covers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Coverage {
    /// The rectangle that encloses its four corners, as the paper has it: quick, and too large where an element is turned.
    Rectangle,
    /// The quadrilateral of its corners.
    #[default]
    Quad,
}

/// Which elements leave a trail in which something unknown may have come into view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Trails {
    /// All: the rectangle that encloses the old and the new place, as the paper has it. Flags far too much: a floor that runs
    /// through several layers sweeps over itself.
    All,
    /// Sides that are silhouettes against something farther: what lies between the old and the new edge.
    #[default]
    Silhouettes,
}

/// How the share of an element in the integral is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum AreaWeights {
    /// By the bits that it fills.
    Bits,
    /// By its area in the square, which the map preserves, times the visible share of its bits.
    #[default]
    Analytic,
}

/// How a record is reprojected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// What an element covers.
    pub coverage: Coverage,
    /// Who leaves trails.
    pub trails: Trails,
    /// How shares are measured.
    pub weights: AreaWeights,
    /// One hole ray for each block of `step x step` texels with a gap, k of the paper; at least 1.
    pub step: u32,
}

impl Default for Settings {
    /// Exact quads, silhouette trails, analytic weights, a hole ray for every 2 x 2 texels.
    fn default() -> Self {
        Self { coverage: Coverage::Quad, trails: Trails::Silhouettes, weights: AreaWeights::Analytic, step: 2 }
    }
}

/// Shares of the hemisphere, weighted by the cosine: `filled + holes` is 1 and `unknown` is a part of `holes`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Shares {
    /// Seen by the record.
    pub filled: f32,
    /// Behind silhouettes that moved.
    pub unknown: f32,
    /// Not filled, whatever the reason.
    pub holes: f32,
}

/// No element.
pub(crate) const NOBODY: u16 = u16::MAX;

/// Buffers of a reprojection, and its result; kept by a thread and used again, so that no call allocates.
///
/// The order of calls: [`Self::project`], perhaps [`Self::verify`], then [`Self::trace_holes`], then any of the results. Texels are indexed as in
/// [`radcache::Samples`], in the frame that [`Self::frame`] gives.
#[derive(Debug)]
pub struct Workspace {
    pub(crate) n: usize,
    pub(crate) frame: Frame,
    /// Record's frame to this point's, and the point in the record's frame.
    pub(crate) rotation: Mat3A,
    pub(crate) offset: Vec3A,
    pub(crate) masks: Masks,
    pub(crate) centres: TexelCentres,
    /// Corners of the elements in the square, and their heights.
    pub(crate) u: [Vec<f32>; 4],
    pub(crate) v: [Vec<f32>; 4],
    pub(crate) z: [Vec<f32>; 4],
    /// Share of the integral of each element, padded as they are.
    pub(crate) weight: Vec<f32>,
    /// The element that fills each texel, with room for a whole run after the last.
    pub(crate) owner: Vec<u16>,
    /// Bits of one polygon.
    pub(crate) bits: Rows,
    pub(crate) layer_fill: Rows,
    pub(crate) trail: Rows,
    pub(crate) holes: Vec<Hole>,
    pub(crate) directions: Vec<Vec3A>,
    pub(crate) traced: Vec<Traced>,
    texture: Vec<Vec3>,
    /// Sums over elements by their shares: those at a distance, and those at infinity.
    pub(crate) filled_sum: [Vec3; 2],
    pub(crate) filled_weight: f32,
}

impl Default for Workspace {
    fn default() -> Self {
        Self::new()
    }
}

impl Workspace {
    /// Empty buffers.
    #[must_use]
    pub fn new() -> Self {
        Self {
            n: 1,
            frame: Frame::from_normal(Vec3A::Z),
            rotation: Mat3A::IDENTITY,
            offset: Vec3A::ZERO,
            masks: Masks::new(1),
            centres: TexelCentres::default(),
            u: Default::default(),
            v: Default::default(),
            z: Default::default(),
            weight: Vec::new(),
            owner: Vec::new(),
            bits: [0; MAX_RESOLUTION],
            layer_fill: [0; MAX_RESOLUTION],
            trail: [0; MAX_RESOLUTION],
            holes: Vec::new(),
            directions: Vec::new(),
            traced: Vec::new(),
            texture: Vec::new(),
            filled_sum: [Vec3::ZERO; 2],
            filled_weight: 0.0,
        }
    }

    /// Traces one ray for each block of `step x step` texels with a gap, through a random unfilled texel of it, and gives the
    /// number of rays. The same seed gives the same rays.
    pub fn trace_holes(&mut self, step: u32, seed: u64, tracer: &mut impl Tracer) -> usize {
        self.find_holes(step, seed);
        self.traced.clear();
        self.traced.resize(self.holes.len(), Traced::default());
        tracer.trace(&self.directions, &mut self.traced);
        self.holes.len()
    }

    /// Mean of the incident radiance over the cosine-weighted hemisphere, irradiance / pi: elements by their share, holes by
    /// their texels, normalised to one.
    #[must_use]
    pub fn mean_radiance(&self) -> Vec3 {
        let [near, far] = self.mean_radiance_by_distance();
        near + far
    }

    /// [`Self::mean_radiance`] in two parts: what comes from a distance, and what comes from infinity.
    #[must_use]
    pub fn mean_radiance_by_distance(&self) -> [Vec3; 2] {
        let texels = (self.n * self.n) as f64;
        let mut sum = self.filled_sum.map(|part| part.as_dvec3());
        let mut weight = f64::from(self.filled_weight);
        for (hole, traced) in self.holes.iter().zip(&self.traced) {
            let share = f64::from(hole.texels) / texels;
            sum[usize::from(traced.distance.is_infinite())] += share * traced.radiance.as_dvec3();
            weight += share;
        }
        if weight > 0.0 { sum.map(|part| (part / weight).as_vec3()) } else { [Vec3::ZERO; 2] }
    }

    /// The texture that the point sees: each texel has the radiance of the element that fills it, or of its block's ray.
    pub fn texture(&mut self, record: &Record) -> &[Vec3] {
        let elements = record.elements();
        self.texture.clear();
        self.texture.extend(
            self.owner[..self.n * self.n]
                .iter()
                .map(|&owner| if owner == NOBODY { Vec3::ZERO } else { radiance(elements, usize::from(owner)) }),
        );
        for (hole, traced) in self.holes.iter().zip(&self.traced) {
            hole.for_each_texel(self.n, &self.masks, |texel| self.texture[texel] = traced.radiance);
        }
        &self.texture
    }

    /// Sum over the texels of [`Self::texture`] times `weights`, n x n: with f cos / pdf / n^2 as weights, the light that a
    /// BRDF f reflects.
    ///
    /// # Panics
    /// If there are not n x n weights.
    #[must_use]
    pub fn weighted_sum(&self, record: &Record, weights: &[Vec3]) -> Vec3 {
        let [near, far] = self.weighted_sum_by_distance(record, weights);
        near + far
    }

    /// [`Self::weighted_sum`] in two parts: what comes from a distance, and what comes from infinity.
    ///
    /// # Panics
    /// If there are not n x n weights.
    #[must_use]
    pub fn weighted_sum_by_distance(&self, record: &Record, weights: &[Vec3]) -> [Vec3; 2] {
        assert_eq!(weights.len(), self.n * self.n, "a weight for each texel");
        let elements = record.elements();
        let mut sum = [Vec3::ZERO; 2];
        for (&owner, &weight) in self.owner.iter().zip(weights) {
            if owner != NOBODY && weight != Vec3::ZERO {
                let e = usize::from(owner);
                let light = radiance(elements, e) * weight;
                let far = light * elements.background_share[e];
                sum[0] += light - far;
                sum[1] += far;
            }
        }
        for (hole, traced) in self.holes.iter().zip(&self.traced) {
            let part = &mut sum[usize::from(traced.distance.is_infinite())];
            hole.for_each_texel(self.n, &self.masks, |texel| *part += traced.radiance * weights[texel]);
        }
        sum
    }

    /// The frame of the point: that of the record, turned to the normal by the shortest rotation.
    #[must_use]
    pub fn frame(&self) -> Frame {
        self.frame
    }

    /// Texels along a side.
    #[must_use]
    pub fn resolution(&self) -> usize {
        self.n
    }

    /// The masks as the last projection left them.
    #[must_use]
    pub fn masks(&self) -> &Masks {
        &self.masks
    }

    /// The element that fills a texel, if any does.
    #[must_use]
    pub fn owner(&self, texel: usize) -> Option<usize> {
        let owner = self.owner[texel];
        (owner != NOBODY).then_some(usize::from(owner))
    }
}

pub(crate) fn radiance(elements: &Elements, e: usize) -> Vec3 {
    Vec3::new(elements.radiance[0][e], elements.radiance[1][e], elements.radiance[2][e])
}
