//! The buffers of a reprojection, and what another point sees at its end.

use glam::{Mat3A, Vec3, Vec3A};
use hemimap::Frame;
use radcache::{Elements, Record};
use serde::{Deserialize, Serialize};

use crate::holes::Hole;
use crate::horizon::TexelCentres;
use crate::kernel::{Board, Kernel, NOBODY};
use crate::masks::Masks;
use crate::samples::Plane;
use crate::{Traced, Tracer};

/// What of the square an element covers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Coverage {
    /// The rectangle that encloses its four corners, as the paper has it: quick, and too large where an element is
    /// turned.
    Rectangle,
    /// The quadrilateral of its corners.
    #[default]
    Quad,
}

/// Which elements leave a trail in which something unknown may have come into view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Trails {
    /// All: the rectangle that encloses the old and the new place, as the paper has it. Flags far too much: a floor
    /// that runs through several layers sweeps over itself.
    All,
    /// Sides that are silhouettes against something farther and retreat from it: what lies between the old and the new
    /// edge. Those that advance cover that themselves.
    Silhouettes,
    /// The same, less what the background keeps covered as it follows: by its distance it goes a part of the way that
    /// the silhouette goes. So what is unknown is what nobody saw, and hardly more.
    #[default]
    Uncovered,
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
    /// Whether the last texel of a surface that retreats from behind its silhouette is unknown: one ray a texel does
    /// not tell where in it the surface ends. Of no effect where all elements leave trails.
    pub margins: bool,
    /// Whether what stands above a point, but below the tangent plane of the record, makes texels unknown: the record
    /// could not see it.
    pub doubt: bool,
}

impl Default for Settings {
    /// Exact quads, trails of what is uncovered, analytic weights, margins, doubt.
    fn default() -> Self {
        Self {
            coverage: Coverage::Quad,
            trails: Trails::Uncovered,
            weights: AreaWeights::Analytic,
            margins: true,
            doubt: true,
        }
    }
}

/// Shares of the hemisphere, weighted by the cosine: `filled + holes` is 1 and `unknown` is a part of `holes`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Shares {
    /// Seen by the record.
    pub filled: f32,
    /// Behind silhouettes that retreated, and what else the record could not see.
    pub unknown: f32,
    /// Not filled, whatever the reason.
    pub holes: f32,
}

/// Buffers of a reprojection, and its result; kept by a thread and used again, so that no call allocates.
///
/// The order of calls: [`Self::project`], perhaps [`Self::verify`], then [`Self::trace_holes`] or
/// [`Self::trace_holes_under`], then any of the results. Those that ask for a record want the one that was projected
/// last, for texels know its elements by number. Texels are indexed as in [`radcache::Samples`], in the frame that
/// [`Self::frame`] gives.
#[derive(Debug)]
pub struct Workspace {
    /// The record that was projected last.
    pub(crate) projected: Option<Mark>,
    pub(crate) n: usize,
    pub(crate) frame: Frame,
    /// Record's frame to this point's, and the point in the record's frame.
    pub(crate) rotation: Mat3A,
    pub(crate) offset: Vec3A,
    pub(crate) masks: Masks,
    pub(crate) centres: TexelCentres,
    pub(crate) kernel: Kernel,
    /// The board that the kernel uses up to 32 texels along a side, and the one beyond.
    pub(crate) narrow: Board<u32>,
    pub(crate) wide: Board<u64>,
    /// The planes of elements that were found while samples were written.
    pub(crate) planes: Vec<Option<Plane>>,
    /// The element that fills each texel, if that was asked.
    pub(crate) owners: Vec<u16>,
    pub(crate) has_owners: bool,
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
    /// Empty buffers, and the widest kernel that the processor has.
    #[must_use]
    pub fn new() -> Self {
        Self::with_kernel(Kernel::detect())
    }

    /// Empty buffers, and a kernel of choice: all give the same bits.
    ///
    /// # Panics
    /// If the processor does not have it.
    #[must_use]
    pub fn with_kernel(kernel: Kernel) -> Self {
        assert!(kernel.is_supported(), "{kernel:?} is not for this processor");
        Self {
            projected: None,
            n: 1,
            frame: Frame::from_normal(Vec3A::Z),
            rotation: Mat3A::IDENTITY,
            offset: Vec3A::ZERO,
            masks: Masks::new(1),
            centres: TexelCentres::default(),
            kernel,
            narrow: Board::default(),
            wide: Board::default(),
            planes: Vec::new(),
            owners: Vec::new(),
            has_owners: false,
            holes: Vec::new(),
            directions: Vec::new(),
            traced: Vec::new(),
            texture: Vec::new(),
            filled_sum: [Vec3::ZERO; 2],
            filled_weight: 0.0,
        }
    }

    /// Traces one ray for each block of `step x step` texels with a gap, through a random unfilled texel of it, and
    /// gives the number of rays. The same seed gives the same rays. `step` is k of the paper, where 2 is a good choice;
    /// 0 counts as 1.
    pub fn trace_holes(&mut self, step: u32, seed: u64, tracer: &mut (impl Tracer + ?Sized)) -> usize {
        self.find_holes(step, seed, |_| true);
        self.trace_found(tracer)
    }

    /// As [`Self::trace_holes`], but only where a texel of the block has a weight. Of the results,
    /// [`Self::weighted_sum`] with these weights alone holds then, and what is derived from it.
    ///
    /// # Panics
    /// If there are not n x n weights.
    pub fn trace_holes_under(
        &mut self,
        weights: &[Vec3],
        step: u32,
        seed: u64,
        tracer: &mut (impl Tracer + ?Sized),
    ) -> usize {
        assert_eq!(weights.len(), self.n * self.n, "a weight for each texel");
        self.find_holes(step, seed, |texel| weights[texel] != Vec3::ZERO);
        self.trace_found(tracer)
    }

    fn trace_found(&mut self, tracer: &mut (impl Tracer + ?Sized)) -> usize {
        self.traced.clear();
        self.traced.resize(self.holes.len(), Traced::default());
        tracer.trace(&self.directions, &mut self.traced);
        self.holes.len()
    }

    /// Mean of the incident radiance over the cosine-weighted hemisphere, irradiance / pi: elements by their share,
    /// holes by their texels, normalised to one.
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

    /// The texture that the point sees: each texel has the radiance of the element that fills it, or of its block's
    /// ray.
    ///
    /// # Panics
    /// If `record` is not the one that was projected last, as far as place, frame and number of elements tell.
    pub fn texture(&mut self, record: &Record) -> &[Vec3] {
        self.assert_projected(record);
        let elements = record.elements();
        self.find_owners();
        self.texture.clear();
        self.texture.extend(
            self.owners
                .iter()
                .map(|&owner| if owner == NOBODY { Vec3::ZERO } else { radiance(elements, usize::from(owner)) }),
        );
        for (hole, traced) in self.holes.iter().zip(&self.traced) {
            hole.for_each_texel(self.n, &self.masks, |texel| self.texture[texel] = traced.radiance);
        }
        &self.texture
    }

    /// Sum over the texels of [`Self::texture`] times `weights`, n x n: with f cos / pdf / n^2 as weights, the light
    /// that a BRDF f reflects.
    ///
    /// # Panics
    /// If there are not n x n weights, or `record` is not the one that was projected last, as far as place, frame and
    /// number of elements tell.
    #[must_use]
    pub fn weighted_sum(&mut self, record: &Record, weights: &[Vec3]) -> Vec3 {
        let [near, far] = self.weighted_sum_by_distance(record, weights);
        near + far
    }

    /// [`Self::weighted_sum`] in two parts: what comes from a distance, and what comes from infinity.
    ///
    /// # Panics
    /// As [`Self::weighted_sum`].
    #[must_use]
    pub fn weighted_sum_by_distance(&mut self, record: &Record, weights: &[Vec3]) -> [Vec3; 2] {
        self.assert_projected(record);
        assert_eq!(weights.len(), self.n * self.n, "a weight for each texel");
        self.find_owners();
        let elements = record.elements();
        let mut sum = [Vec3::ZERO; 2];
        for (&owner, &weight) in self.owners.iter().zip(weights) {
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

    /// The kernel that it uses.
    #[must_use]
    pub fn kernel(&self) -> Kernel {
        self.kernel
    }

    /// The element that fills a texel, below n x n, if any does.
    #[must_use]
    pub fn owner(&self, texel: usize) -> Option<usize> {
        let (i, j) = (texel % self.n, texel / self.n);
        if self.is_narrow() { self.narrow.owner(i, j) } else { self.wide.owner(i, j) }
    }

    /// Sees to it that results are asked of the record that they belong to: with another one they would be wrong, or
    /// have elements that it has not.
    #[track_caller]
    pub(crate) fn assert_projected(&self, record: &Record) {
        assert!(self.projected == Some(Mark::of(record)), "the record must be the one that was projected last");
    }

    /// Whether rows are words of 32 bits.
    pub(crate) fn is_narrow(&self) -> bool {
        self.n <= 32
    }

    /// Finds the owners of all texels, unless that was done.
    pub(crate) fn find_owners(&mut self) {
        if !self.has_owners {
            self.has_owners = true;
            if self.is_narrow() {
                self.narrow.owners(self.n, &mut self.owners);
            } else {
                self.wide.owners(self.n, &mut self.owners);
            }
        }
    }
}

/// What tells a record from others: its place and frame in bits, its resolution and the number of its elements. To
/// compare all of it would cost as much as a result does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Mark {
    centre: [u32; 3],
    frame: [[u32; 3]; 2],
    resolution: usize,
    elements: usize,
}

impl Mark {
    pub(crate) fn of(record: &Record) -> Self {
        let bits = |v: Vec3A| v.to_array().map(f32::to_bits);
        let Frame { s, n, .. } = record.frame();
        Self {
            centre: bits(record.centre()),
            frame: [bits(s), bits(n)],
            resolution: record.samples().resolution(),
            elements: record.elements().len(),
        }
    }
}

pub(crate) fn radiance(elements: &Elements, e: usize) -> Vec3 {
    Vec3::new(elements.radiance[0][e], elements.radiance[1][e], elements.radiance[2][e])
}
