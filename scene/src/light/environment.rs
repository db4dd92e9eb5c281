//! Choosing directions to the surroundings by their radiance.
//!
//! The table is constant over each pixel of the picture. Between pixel centres the radiance is bilinear, so a bright pixel also lights half of its
//! neighbours: a cell's weight is the mean of the bilinear function over it, which is the sum of 3 x 3 pixels with the weights 1/8, 3/4, 1/8 along each axis. Thus the density
//! is never 0 where the radiance is not. Within a cell, directions are uniform per solid angle, so that nothing diverges at the poles.

use std::f32::consts::TAU;

use glam::{DVec3, Vec2, Vec3, Vec3A};

use super::{Emission, LightSample, Sphere};
use crate::Environment;
use crate::environment::direction_to_uv;

/// The surroundings with a table of where they are bright.
#[derive(Debug, Clone)]
pub(super) struct EnvironmentLight {
    environment: Environment,
    /// For each row the sums of its cells' shares, `width + 1` numbers from 0 to 1.
    columns: Vec<f32>,
    /// Sums of the rows' shares, `height + 1` numbers from 0 to 1.
    rows: Vec<f32>,
    /// Cosine of the polar angle at the rows' borders, from 1 to -1.
    cosines: Vec<f32>,
    /// Integral of the radiance over the sphere, W m^-2.
    integral: Vec3,
}

impl EnvironmentLight {
    /// Makes the table; `None` where everything is black.
    pub(super) fn new(environment: Environment) -> Option<Self> {
        let (width, height) = (environment.width as usize, environment.height as usize);
        let mut columns = Vec::with_capacity((width + 1) * height);
        let mut row_weights = Vec::with_capacity(height);
        let cosines: Vec<f64> =
            (0..=height).map(|row| (std::f64::consts::PI * row as f64 / height as f64).cos()).collect();
        let mut integral = DVec3::ZERO;
        for row in 0..height {
            let cell_solid_angle = std::f64::consts::TAU / width as f64 * (cosines[row] - cosines[row + 1]);
            let means: Vec<DVec3> = (0..width).map(|column| mean_over_cell(&environment, column, row)).collect();
            let sum = means.iter().sum::<DVec3>();
            integral += sum * cell_solid_angle;
            row_weights.push(sum.element_sum() * cell_solid_angle);
            append_sums(&mut columns, means.iter().map(|mean| mean.element_sum()));
        }
        let mut rows = Vec::with_capacity(height + 1);
        append_sums(&mut rows, row_weights.into_iter());
        let integral = integral.as_vec3();
        let cosines = cosines.into_iter().map(narrow).collect();
        (integral.max_element() > 0.0).then_some(Self { environment, columns, rows, cosines, integral })
    }

    /// Returns the same surroundings with a table of where `weight` of their radiance is bright; `None` where it is black.
    pub(super) fn weighted(&self, weight: impl Fn(Vec3) -> Vec3) -> Option<Self> {
        let mut important = self.environment.clone();
        for pixel in &mut important.pixels {
            *pixel = weight(*pixel);
        }
        let table = Self::new(important)?;
        Some(Self { environment: self.environment.clone(), ..table })
    }

    #[inline]
    pub(super) fn radiance(&self, direction: Vec3A) -> Vec3 {
        self.environment.radiance(direction)
    }

    /// Returns the flux that enters the sphere around the scene, W.
    pub(super) fn flux(&self, surroundings: &Sphere) -> Vec3 {
        self.integral * surroundings.cross_section()
    }

    #[inline]
    pub(super) fn sample(&self, u: Vec2, probability: f32) -> Option<LightSample> {
        let (row, y) = invert(&self.rows, u.y);
        let (column, x) = invert(self.row(row), u.x);
        let cosine = self.cosines[row] + (self.cosines[row + 1] - self.cosines[row]) * y;
        let sine = ((1.0 - cosine) * (1.0 + cosine)).max(0.0).sqrt();
        let (sin_phi, cos_phi) = (TAU * (column as f32 + x) / self.environment.width as f32).sin_cos();
        let wi = Vec3A::new(sine * sin_phi, cosine, -sine * cos_phi);
        // Rounding may have moved wi to the next cell: the density is that of where it is, as for a ray that comes by chance.
        let pdf = self.pdf(wi) * probability;
        (pdf > 0.0).then(|| LightSample { wi, distance: f32::INFINITY, radiance: self.radiance(wi), pdf, delta: false })
    }

    /// Returns the density of a direction, per steradian.
    #[inline]
    pub(super) fn pdf(&self, wi: Vec3A) -> f32 {
        let uv = direction_to_uv(wi);
        let row = cell(uv.y, self.environment.height);
        let column = cell(uv.x, self.environment.width);
        let sums = self.row(row);
        let share = (self.rows[row + 1] - self.rows[row]) * (sums[column + 1] - sums[column]);
        let solid_angle = TAU / self.environment.width as f32 * (self.cosines[row] - self.cosines[row + 1]);
        share / solid_angle
    }

    pub(super) fn emit(&self, surroundings: &Sphere, u_position: Vec2, u_direction: Vec2) -> Option<Emission> {
        let sample = self.sample(u_direction, 1.0)?;
        let flux = sample.radiance * (surroundings.cross_section() / sample.pdf);
        Some(Emission { ray: surroundings.ray(-sample.wi, u_position), flux })
    }

    fn row(&self, row: usize) -> &[f32] {
        let length = self.environment.width as usize + 1;
        &self.columns[row * length..(row + 1) * length]
    }

    /// Returns the memory held, bytes.
    pub(super) fn memory_bytes(&self) -> usize {
        self.environment.memory_bytes()
            + (self.columns.capacity() + self.rows.capacity() + self.cosines.capacity()) * size_of::<f32>()
    }
}

/// Returns the mean of the bilinear radiance over a pixel.
fn mean_over_cell(environment: &Environment, column: usize, row: usize) -> DVec3 {
    const WEIGHTS: [f64; 3] = [0.125, 0.75, 0.125];
    let (width, height) = (environment.width as usize, environment.height as usize);
    let mut mean = DVec3::ZERO;
    for (j, wy) in WEIGHTS.iter().enumerate() {
        let y = (row + j).clamp(1, height) - 1;
        for (i, wx) in WEIGHTS.iter().enumerate() {
            let x = (column + width + i - 1) % width;
            mean += environment.pixels[y * width + x].as_dvec3() * (wx * wy);
        }
    }
    mean
}

/// Appends the sums of `weights` divided by the last of them, from 0 to exactly 1; even steps where all weights are 0.
fn append_sums(sums: &mut Vec<f32>, weights: impl ExactSizeIterator<Item = f64> + Clone) {
    let total: f64 = weights.clone().sum();
    let count = weights.len();
    sums.push(0.0);
    let mut sum = 0.0;
    for (i, weight) in weights.enumerate() {
        sum += weight;
        let share = if total > 0.0 { sum / total } else { (i + 1) as f64 / count as f64 };
        sums.push(if i + 1 == count { 1.0 } else { narrow(share) });
    }
}

/// Returns the step of `sums` that holds `u` and where in it, in [0, 1].
#[inline]
fn invert(sums: &[f32], u: f32) -> (usize, f32) {
    let index = sums.partition_point(|&sum| sum <= u).clamp(1, sums.len() - 1) - 1;
    let (low, high) = (sums[index], sums[index + 1]);
    (index, if high > low { ((u - low) / (high - low)).clamp(0.0, 1.0) } else { 0.5 })
}

/// Returns the cell of a coordinate in [0, 1].
#[inline]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a number from 0 to the picture's size")]
fn cell(u: f32, size: u32) -> usize {
    ((u * size as f32) as usize).min(size as usize - 1)
}

#[expect(clippy::cast_possible_truncation, reason = "rounds to the nearest f32")]
fn narrow(x: f64) -> f32 {
    x as f32
}
