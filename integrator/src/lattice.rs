//! The lattice of the points of a picture: which are asked first, and when the others need not be asked.

use glam::Vec3;

use crate::surface_points::{SurfacePoint, same_surface};
use crate::terms::indirect::Incident;

/// Distances of the lattice in pixels, coarse to fine; each level halves the one before.
pub(crate) const STRIDES: [usize; 4] = [8, 4, 2, 1];

/// A point is interpolated only from corners within this share of their reach.
const REACH_SHARE: f32 = 0.25;

/// Off the plane of a neighbour by at most this share of the distance between them, a point is on the same surface.
const PLANE_TOLERANCE: f32 = 0.05;

/// The surface points of a band of the picture, by pixels.
#[derive(Debug)]
pub(crate) struct Lattice {
    width: usize,
    height: usize,
    points: Vec<SurfacePoint>,
    /// First point of each pixel, and the number of points at the end.
    starts: Vec<u32>,
}

impl Lattice {
    /// Arranges points, sorted by pixel, of a band of `width` x `height` pixels.
    pub(crate) fn new(width: usize, height: usize, points: Vec<SurfacePoint>) -> Self {
        let mut starts = vec![0; width * height + 1];
        for point in &points {
            starts[point.pixel as usize + 1] += 1;
        }
        for pixel in 0..width * height {
            starts[pixel + 1] += starts[pixel];
        }
        Self { width, height, points, starts }
    }

    /// Whether a point of the lattice of this stride lies in the middle of a cell of the coarser one, and not on a side of it.
    pub(crate) fn is_middle(&self, number: usize, stride: usize) -> bool {
        let pixel = self.points[number].pixel as usize;
        let is_coarse = |x: usize, len: usize| on_lattice(x, 2 * stride, len);
        !is_coarse(pixel % self.width, self.width) && !is_coarse(pixel / self.width, self.height)
    }

    pub(crate) fn points(&self) -> &[SurfacePoint] {
        &self.points
    }

    /// The points of the pixels on the lattice of this stride that have no value yet, in order.
    pub(crate) fn level(&self, stride: usize, values: &[Option<Incident>]) -> Vec<usize> {
        let mut level = Vec::new();
        for y in (0..self.height).filter(|&y| on_lattice(y, stride, self.height)) {
            for x in (0..self.width).filter(|&x| on_lattice(x, stride, self.width)) {
                level.extend(self.of_pixel(x, y).filter(|&number| values[number].is_none()));
            }
        }
        level
    }

    /// The value of a point between the corners of its cell in the level before, if all of them show its surface, have a reach
    /// that takes it in, and agree within `agreement` of their mean.
    pub(crate) fn interpolate(
        &self,
        number: usize,
        stride: usize,
        values: &[Option<Incident>],
        agreement: f32,
    ) -> Option<Incident> {
        let coarse = 2 * stride;
        if coarse > STRIDES[0] {
            return None;
        }
        let point = &self.points[number];
        let pixel = point.pixel as usize;
        let (x, y) = (pixel % self.width, pixel / self.width);
        let (x0, x1, tx) = cell(x, coarse, self.width);
        let (y0, y1, ty) = cell(y, coarse, self.height);
        let corners = [
            (x0, y0, (1.0 - tx) * (1.0 - ty)),
            (x1, y0, tx * (1.0 - ty)),
            (x0, y1, (1.0 - tx) * ty),
            (x1, y1, tx * ty),
        ];
        let mut sum = Incident { reach: f32::INFINITY, ..Incident::default() };
        let (mut low, mut high) = (Vec3::splat(f32::INFINITY), Vec3::ZERO);
        for (x, y, weight) in corners {
            if weight == 0.0 {
                continue;
            }
            let value = self.corner_value(x, y, point, values)?;
            sum.near += weight * value.near;
            sum.sky += weight * value.sky;
            sum.reach = sum.reach.min(value.reach);
            low = low.min(value.near + value.sky);
            high = high.max(value.near + value.sky);
        }
        let limit = agreement * (sum.near + sum.sky).max_element();
        ((high - low).max_element() <= limit).then_some(sum)
    }

    /// The value of the point of a pixel that lies on the surface of `point`, if its reach takes that in.
    fn corner_value(&self, x: usize, y: usize, point: &SurfacePoint, values: &[Option<Incident>]) -> Option<Incident> {
        self.of_pixel(x, y).find_map(|other| {
            let corner = &self.points[other];
            let distance = corner.shading.surface.p.distance(point.shading.surface.p);
            // A pixel's width of slack: on curved surfaces points side by side are that far off each other's planes.
            let tolerance = PLANE_TOLERANCE * distance + 0.1 * point.footprint;
            let value = values[other].filter(|value| distance <= REACH_SHARE * value.reach)?;
            same_surface(corner, point, tolerance).then_some(value)
        })
    }

    fn of_pixel(&self, x: usize, y: usize) -> std::ops::Range<usize> {
        let pixel = y * self.width + x;
        self.starts[pixel] as usize..self.starts[pixel + 1] as usize
    }
}

/// Whether a column or row is on the lattice: the last one is on each.
fn on_lattice(x: usize, stride: usize, len: usize) -> bool {
    x.is_multiple_of(stride) || x + 1 == len
}

/// The cell of width `stride` around a place: its ends, and how far the place is from the first, 0 to 1.
fn cell(x: usize, stride: usize, len: usize) -> (usize, usize, f32) {
    if on_lattice(x, stride, len) {
        return (x, x, 0.0);
    }
    let first = x / stride * stride;
    let last = (first + stride).min(len - 1);
    (first, last, (x - first) as f32 / (last - first) as f32)
}
