//! The reprojection itself: layers from front to back, masks, weights, and what another point sees at the end.

use glam::{Mat3A, Vec2, Vec3, Vec3A};
use hemimap::Frame;
use radcache::{Elements, MAX_RESOLUTION, Record};

use crate::holes::Hole;
use crate::kernel::{direction_to_square, project_corners};
use crate::masks::{Masks, Rows, polygon_rows, rectangle_rows};
use crate::trail::{sweep_all, sweep_silhouettes};
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
/// The order of calls: [`Self::project`], then [`Self::trace_holes`], then any of the results. Texels are indexed as in
/// [`radcache::Samples`], in the frame that [`Self::frame`] gives.
#[derive(Debug)]
pub struct Workspace {
    pub(crate) n: usize,
    pub(crate) frame: Frame,
    /// Record's frame to this point's, and the point in the record's frame.
    pub(crate) rotation: Mat3A,
    pub(crate) offset: Vec3A,
    pub(crate) masks: Masks,
    u: [Vec<f32>; 4],
    v: [Vec<f32>; 4],
    z: [Vec<f32>; 4],
    /// Share of the integral of each element.
    weight: Vec<f32>,
    /// The element that fills each texel.
    pub(crate) owner: Vec<u16>,
    layer_fill: Rows,
    trail: Rows,
    pub(crate) holes: Vec<Hole>,
    pub(crate) directions: Vec<Vec3A>,
    pub(crate) traced: Vec<Traced>,
    texture: Vec<Vec3>,
    /// Sums over elements by their shares: those at a distance, and those at infinity.
    filled_sum: [Vec3; 2],
    filled_weight: f32,
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
            u: Default::default(),
            v: Default::default(),
            z: Default::default(),
            weight: Vec::new(),
            owner: Vec::new(),
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

    /// Projects the elements of a record to a point `p` with unit normal `n` in world space, nearest layer first.
    ///
    /// Bits that an element of a nearer layer filled, or that a nearer layer made unknown, are closed to it; what its own layer
    /// made unknown counts from the next layer on (paper, section 5.3). An element that is seen from behind, or whose radiance
    /// depends on the view, fills nothing and makes unknown what it covers: the record knows only its front, from its own place.
    pub fn project(&mut self, record: &Record, p: Vec3A, n: Vec3A, settings: &Settings) -> Shares {
        self.place(record, p, n);
        let elements = record.elements();
        let padded = elements.padded_len();
        for corner in self.u.iter_mut().chain(&mut self.v).chain(&mut self.z) {
            corner.resize(padded, 0.0);
        }
        self.weight.clear();
        self.weight.resize(elements.len(), 0.0);
        self.owner.clear();
        self.owner.resize(self.n * self.n, NOBODY);
        self.masks.reset(self.n);
        project_corners(elements, &self.rotation, self.offset, &mut self.u, &mut self.v, &mut self.z);
        for layer in 0..elements.layer_count() {
            for e in elements.layer(layer) {
                self.fill_element(elements, e, settings);
                match settings.trails {
                    Trails::Silhouettes => {
                        sweep_silhouettes(elements, e, &self.rotation, self.n, &self.u, &self.v, &mut self.trail)
                    }
                    Trails::All => sweep_all(elements, e, &self.rotation, self.n, &self.u, &self.v, &mut self.trail),
                }
            }
            self.masks.end_layer(&mut self.layer_fill, &mut self.trail);
        }
        self.sum_elements(elements);
        self.holes.clear();
        let texels = (self.n * self.n) as f32;
        let filled = self.masks.count(&self.masks.fill) as f32 / texels;
        let unknown = self.masks.count(&self.masks.unknown) as f32 / texels;
        Shares { filled, unknown, holes: 1.0 - filled }
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
        let texels = (self.n * self.n) as f32;
        let mut sum = self.filled_sum;
        let mut weight = self.filled_weight;
        for (hole, traced) in self.holes.iter().zip(&self.traced) {
            let share = f32::from(hole.texels) / texels;
            sum[usize::from(traced.distance.is_infinite())] += share * traced.radiance;
            weight += share;
        }
        if weight > 0.0 { sum.map(|part| part / weight) } else { [Vec3::ZERO; 2] }
    }

    /// The texture that the point sees: each texel has the radiance of the element that fills it, or of its block's ray.
    pub fn texture(&mut self, record: &Record) -> &[Vec3] {
        let elements = record.elements();
        self.texture.clear();
        self.texture.extend(
            self.owner.iter().map(
                |&owner| {
                    if owner == NOBODY { Vec3::ZERO } else { radiance(elements, usize::from(owner)) }
                },
            ),
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
                sum[usize::from(elements.finite[e] == 0.0)] += radiance(elements, e) * weight;
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

    fn place(&mut self, record: &Record, p: Vec3A, n: Vec3A) {
        let frame = record.frame();
        self.n = record.samples().resolution();
        self.offset = frame.to_local(p - record.centre());
        if n == frame.n {
            // Exactly, so that a record gives itself back bit for bit.
            self.frame = frame;
            self.rotation = Mat3A::IDENTITY;
        } else {
            self.frame = frame.transported_to(n);
            let column = |axis| self.frame.to_local(axis);
            self.rotation = Mat3A::from_cols(column(frame.s), column(frame.t), column(frame.n));
        }
    }

    /// Sets the bits of one element and finds its weight.
    fn fill_element(&mut self, elements: &Elements, e: usize, settings: &Settings) {
        let z: [f32; 4] = std::array::from_fn(|k| self.z[k][e]);
        let mut polygon = [Vec2::ZERO; MAX_CLIPPED];
        let corners = if z.iter().all(|&z| z >= -HORIZON) {
            for (k, corner) in polygon[..4].iter_mut().enumerate() {
                *corner = Vec2::new(self.u[k][e], self.v[k][e]);
            }
            4
        } else if z.iter().all(|&z| z < -HORIZON) {
            return;
        } else {
            let space =
                std::array::from_fn(|k| self.rotation * (elements.corner(e, k) - self.offset * elements.finite[e]));
            clip_at_horizon(&space, &mut polygon)
        };
        let polygon = &polygon[..corners];
        let area = signed_area(polygon);
        let hides_only = area <= 0.0 || elements.view_dependent[e];
        let owner = u16::try_from(e).expect("at most 64 x 64 elements");
        let (mut covered, mut visible) = (0, 0);
        let n = self.n;
        let set = |j: usize, bits: u64| {
            if hides_only {
                self.trail[j] |= bits;
                return;
            }
            let open = bits & !(self.masks.fill[j] | self.masks.unknown[j]);
            covered += bits.count_ones();
            visible += open.count_ones();
            // Where two elements of a layer meet on a texel, the first keeps it.
            let mut fresh = open & !self.layer_fill[j];
            self.layer_fill[j] |= open;
            while fresh != 0 {
                self.owner[j * n + fresh.trailing_zeros() as usize] = owner;
                fresh &= fresh - 1;
            }
        };
        match settings.coverage {
            Coverage::Quad => polygon_rows(polygon, n, set),
            Coverage::Rectangle => rectangle_rows(polygon, n, set),
        }
        if visible > 0 {
            self.weight[e] = match settings.weights {
                AreaWeights::Analytic => area * visible as f32 / covered as f32,
                AreaWeights::Bits => visible as f32 / (n * n) as f32,
            };
        }
    }

    fn sum_elements(&mut self, elements: &Elements) {
        let mut sum = [Vec3::ZERO; 2];
        let mut total = 0.0;
        for (e, &weight) in self.weight.iter().enumerate() {
            sum[usize::from(elements.finite[e] == 0.0)] += weight * radiance(elements, e);
            total += weight;
        }
        self.filled_sum = sum;
        self.filled_weight = total;
    }
}

/// Corners whose cosine is this little below the horizon are on it: rounding of a rotation moves those of the rim so far.
const HORIZON: f32 = 1e-6;

/// A quadrilateral that need not be convex, clipped by a plane, has at most 6 corners.
const MAX_CLIPPED: usize = 6;

/// Clips a quadrilateral in space at z = 0 and maps it to the square; gives the number of corners. Unclipped corners below the
/// horizon would fold back into the disk.
fn clip_at_horizon(space: &[Vec3A; 4], polygon: &mut [Vec2; MAX_CLIPPED]) -> usize {
    let mut count = 0;
    for k in 0..4 {
        let (a, b) = (space[k], space[(k + 1) % 4]);
        if a.z >= 0.0 {
            polygon[count] = direction_to_square(a);
            count += 1;
        }
        if (a.z >= 0.0) != (b.z >= 0.0) {
            let mut at = a + (b - a) * (a.z / (a.z - b.z));
            at.z = 0.0;
            polygon[count] = direction_to_square(at);
            count += 1;
        }
    }
    count
}

/// Area of a polygon, positive if it runs counter-clockwise.
fn signed_area(polygon: &[Vec2]) -> f32 {
    let Some(&origin) = polygon.first() else {
        return 0.0;
    };
    let twice: f32 = polygon.windows(2).map(|edge| (edge[0] - origin).perp_dot(edge[1] - origin)).sum();
    0.5 * twice
}

fn radiance(elements: &Elements, e: usize) -> Vec3 {
    Vec3::new(elements.radiance[0][e], elements.radiance[1][e], elements.radiance[2][e])
}
