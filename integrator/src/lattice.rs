//! The lattice of the points of a picture: which are asked first.

use crate::surface_points::{PixelPoints, SurfacePoint};
use crate::terms::indirect::Incident;

/// Distances of the lattices in pixels, coarse to fine; each level halves the one before.
pub(crate) const STRIDES: [usize; 7] = [64, 32, 16, 8, 4, 2, 1];

/// The surface points of a band of the picture, by pixels.
#[derive(Debug)]
pub(crate) struct Lattice<'a> {
    width: usize,
    height: usize,
    points: Vec<&'a SurfacePoint>,
    /// First point of each pixel, and the number of points at the end.
    starts: Vec<usize>,
}

impl<'a> Lattice<'a> {
    /// Arranges the points of a band of `pixels`, row by row of `width`, each of which knows its number. They stay where
    /// they are.
    ///
    /// # Panics
    /// If the last row is not full.
    pub(crate) fn new(width: usize, pixels: &'a [PixelPoints]) -> Self {
        assert!(pixels.len().is_multiple_of(width), "whole rows");
        let mut points = Vec::with_capacity(pixels.len());
        let mut starts = Vec::with_capacity(pixels.len() + 1);
        for pixel in pixels {
            starts.push(points.len());
            points.extend(&pixel.points);
        }
        starts.push(points.len());
        Self { width, height: pixels.len() / width, points, starts }
    }

    /// Whether a point of the lattice of this stride lies in the middle of a cell of the coarser one, and not on a side
    /// of it.
    pub(crate) fn is_middle(&self, number: usize, stride: usize) -> bool {
        let pixel = self.points[number].pixel as usize;
        let is_coarse = |x: usize, len: usize| on_lattice(x, 2 * stride, len);
        !is_coarse(pixel % self.width, self.width) && !is_coarse(pixel / self.width, self.height)
    }

    pub(crate) fn points(&self) -> &[&'a SurfacePoint] {
        &self.points
    }

    pub(crate) fn pixel_count(&self) -> usize {
        self.width * self.height
    }

    /// The points of the pixels on the lattice of this stride that have no value yet, in order.
    pub(crate) fn level(&self, stride: usize, values: &[Option<Incident>]) -> Vec<usize> {
        let mut level = Vec::new();
        for y in (0..self.height).filter(|&y| on_lattice(y, stride, self.height)) {
            for x in (0..self.width).filter(|&x| on_lattice(x, stride, self.width)) {
                level.extend(self.of_pixel(y * self.width + x).filter(|&number| values[number].is_none()));
            }
        }
        level
    }

    /// The share of a point in what its pixel shows of all surfaces.
    pub(crate) fn share(&self, number: usize) -> f32 {
        let weight = |number: usize| self.points[number].specular_weight.max_element();
        let all = self.of_pixel(self.points[number].pixel as usize).map(weight).sum::<f32>();
        weight(number) / all.max(f32::MIN_POSITIVE)
    }

    /// The numbers of the points of a pixel of the band.
    pub(crate) fn of_pixel(&self, pixel: usize) -> std::ops::Range<usize> {
        self.starts[pixel]..self.starts[pixel + 1]
    }
}

/// Whether a column or row is on the lattice: the last one is on each.
fn on_lattice(x: usize, stride: usize, len: usize) -> bool {
    x.is_multiple_of(stride) || x + 1 == len
}
