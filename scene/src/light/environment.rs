//! Choosing directions to the surroundings by their radiance.
//!
//! The table is constant over each pixel of the picture. Between pixel centres the radiance is bilinear, so a bright
//! pixel also lights half of its neighbours: a cell's weight is the mean of the bilinear function over it, which is the
//! sum of 3 x 3 pixels with the weights 1/8, 3/4, 1/8 along each axis. Thus the density is never 0 where the radiance
//! is not. Within a cell, directions are uniform per solid angle, so that nothing diverges at the poles.

use std::f64::consts::TAU;

use glam::{DVec3, Vec2, Vec3, Vec3A};

use super::{Emission, LightSample, Target, narrow};
use crate::Environment;
use crate::environment::direction_to_uv;

/// The part of the sphere that a row of the picture covers.
///
/// A height is that of the cap around the nearer pole, 1 - |cos theta|: beside a pole cosines in single precision are
/// all 1, and the rows of a tall picture would have no solid angle.
#[derive(Debug, Clone, Copy)]
struct Band {
    /// Height at the border that is nearer to the pole.
    near: f32,
    /// What the height grows by to the other border.
    step: f32,
    /// Solid angle of each cell of the row, sr.
    cell_solid_angle: f32,
}

/// The surroundings with a table of where they are bright.
#[derive(Debug, Clone)]
pub(super) struct EnvironmentLight {
    environment: Environment,
    /// For each row the sums of its cells' shares.
    columns: Tables,
    /// The sums of the rows' shares.
    rows: Tables,
    /// Where the rows lie on the sphere.
    bands: Vec<Band>,
    /// Integral of the radiance over the sphere, W m^-2.
    integral: Vec3,
}

impl EnvironmentLight {
    /// Makes the table; `None` where everything is black.
    pub(super) fn new(environment: Environment) -> Option<Self> {
        let (width, height) = (environment.width as usize, environment.height as usize);
        let mut columns = Tables::with_capacity(width, height);
        let mut row_weights = Vec::with_capacity(height);
        let mut bands = Vec::with_capacity(height);
        let mut integral = DVec3::ZERO;
        for row in 0..height {
            let (near, step) = heights(row, height);
            let cell_solid_angle = TAU / width as f64 * step;
            bands.push(Band { near: narrow(near), step: narrow(step), cell_solid_angle: narrow(cell_solid_angle) });
            let means: Vec<DVec3> = (0..width).map(|column| mean_over_cell(&environment, column, row)).collect();
            let sum = means.iter().sum::<DVec3>();
            integral += sum * cell_solid_angle;
            row_weights.push(sum.element_sum() * cell_solid_angle);
            columns.append(means.iter().map(|mean| mean.element_sum()));
        }
        let mut rows = Tables::with_capacity(height, 1);
        rows.append(row_weights.into_iter());
        let integral = integral.as_vec3();
        (integral.max_element() > 0.0).then_some(Self { environment, columns, rows, bands, integral })
    }

    /// Returns the same surroundings with a table of where `weight` of their radiance is bright; `None` where it is
    /// black.
    ///
    /// Half of the samples go by that part of the radiance, the others by its root: where the sun is hidden and its
    /// halo is not, samples by the radiance alone would be rare and each as bright as the sun.
    pub(super) fn weighted(&self, weight: impl Fn(Vec3) -> Vec3) -> Option<Self> {
        let mut important = self.environment.clone();
        // Integrals over the sphere of the part, and of its root.
        let (mut integral, mut of_roots) = (DVec3::ZERO, 0.0);
        let rows = important.pixels.chunks_exact_mut(important.width as usize).zip(&self.bands);
        for (row, band) in rows {
            let solid_angle = f64::from(band.cell_solid_angle);
            for pixel in row {
                *pixel = weight(*pixel);
                integral += pixel.as_dvec3() * solid_angle;
                of_roots += f64::from(pixel.element_sum().sqrt()) * solid_angle;
            }
        }
        if of_roots <= 0.0 {
            return None;
        }
        // A third for each channel, as all three get it.
        let scale = narrow(integral.element_sum() / of_roots / 3.0);
        for pixel in &mut important.pixels {
            *pixel += scale * pixel.element_sum().sqrt();
        }
        let table = Self::new(important)?;
        Some(Self { environment: self.environment.clone(), integral: integral.as_vec3(), ..table })
    }

    #[inline]
    pub(super) fn radiance(&self, direction: Vec3A) -> Vec3 {
        self.environment.radiance(direction)
    }

    /// Returns the flux to the target, W.
    pub(super) fn flux(&self, target: &Target) -> Vec3 {
        self.integral * target.cross_section()
    }

    /// Returns the integral of the radiance over the sphere, W m^-2; where a part of it is sampled, of that part.
    pub(super) fn integral(&self) -> Vec3 {
        self.integral
    }

    /// Returns the direction that a pair of numbers chooses.
    #[inline]
    pub(super) fn direction(&self, u: Vec2) -> Vec3A {
        let (row, y) = self.rows.invert(0, u.y);
        let (column, x) = self.columns.invert(row, u.x);
        let Band { near, step, .. } = self.bands[row];
        let is_lower = 2 * row >= self.bands.len();
        let height = near + step * if is_lower { 1.0 - y } else { y };
        let cosine = if is_lower { height - 1.0 } else { 1.0 - height };
        let sine = (height * (2.0 - height)).sqrt();
        let (sin_phi, cos_phi) = hemimap::sin_cos_turn((column as f32 + x) / self.environment.width as f32);
        Vec3A::new(sine * sin_phi, cosine, -sine * cos_phi)
    }

    /// Returns what shines in a direction that was chosen; `None` where its density is 0.
    #[inline]
    pub(super) fn sample_at(&self, wi: Vec3A, probability: f32) -> Option<LightSample> {
        // Rounding may have moved wi to the next cell: the density is that of where it is, as for a ray that comes by
        // chance.
        let uv = direction_to_uv(wi);
        let pdf = self.pdf_at(uv) * probability;
        let radiance = || self.environment.radiance_at(uv);
        (pdf > 0.0).then(|| LightSample { wi, distance: f32::INFINITY, radiance: radiance(), pdf, delta: false })
    }

    /// Returns the density of a direction, per steradian.
    #[inline]
    pub(super) fn pdf(&self, wi: Vec3A) -> f32 {
        self.pdf_at(direction_to_uv(wi))
    }

    #[inline]
    fn pdf_at(&self, uv: Vec2) -> f32 {
        let row = cell(uv.y, self.environment.height);
        let column = cell(uv.x, self.environment.width);
        let share = self.rows.share(0, row) * self.columns.share(row, column);
        share / self.bands[row].cell_solid_angle
    }

    pub(super) fn emit(&self, target: &Target, u_sphere: f32, u_position: Vec2, u_direction: Vec2) -> Option<Emission> {
        let sample = self.sample_at(self.direction(u_direction), 1.0)?;
        target.emission(-sample.wi, sample.radiance / sample.pdf, u_sphere, u_position)
    }

    /// Returns the memory held, bytes.
    pub(super) fn memory_bytes(&self) -> usize {
        self.environment.memory_bytes()
            + self.columns.memory_bytes()
            + self.rows.memory_bytes()
            + self.bands.capacity() * size_of::<Band>()
    }
}

/// Returns the height of the border of a row that is nearer to its pole, and what it grows by to the other border. The
/// row in the middle, if there is one, goes by the upper pole, and beyond 1.
fn heights(row: usize, rows: usize) -> (f64, f64) {
    // 1 - cos theta = 2 sin^2(theta / 2), where half the angle is at most an eighth of a turn.
    let height = |border: usize| {
        let (sin, _) = hemimap::double::sin_cos_eighth_turn((2 * border) as f64 / rows as f64);
        2.0 * sin * sin
    };
    let from_pole = row.min(rows - 1 - row);
    let near = height(from_pole);
    let far = if 2 * from_pole + 1 == rows { 2.0 - near } else { height(from_pole + 1) };
    (near, far - near)
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

/// Tables of one length to choose a step by its share.
#[derive(Debug, Clone)]
struct Tables {
    steps: usize,
    /// For each table the sums of its shares, `steps + 1` numbers from 0 to 1.
    sums: Vec<f32>,
    /// For each table, of `guides` equal parts of [0, 1], how many sums lie at or below the start of each part, and all
    /// at the end: the sum that is looked for is among few then.
    guide: Vec<u32>,
    /// A power of two, so that the part of a number is exact.
    guides: usize,
}

impl Tables {
    fn with_capacity(steps: usize, tables: usize) -> Self {
        /// Sums in a part, if all shares are the same: a cache line of them has 16.
        const SUMS: usize = 8;
        let guides = steps.div_ceil(SUMS).next_power_of_two();
        let (sums, guide) = (Vec::with_capacity((steps + 1) * tables), Vec::with_capacity((guides + 1) * tables));
        Self { steps, sums, guide, guides }
    }

    /// Appends the table of `weights`; even steps where all weights are 0.
    fn append(&mut self, weights: impl ExactSizeIterator<Item = f64> + Clone) {
        let total: f64 = weights.clone().sum();
        let count = weights.len();
        let first = self.sums.len();
        self.sums.push(0.0);
        let mut sum = 0.0;
        for (i, weight) in weights.enumerate() {
            sum += weight;
            let share = if total > 0.0 { sum / total } else { (i + 1) as f64 / count as f64 };
            self.sums.push(if i + 1 == count { 1.0 } else { narrow(share) });
        }
        let sums = &self.sums[first..];
        let below = |part: usize| sums.partition_point(|&sum| sum <= part as f32 / self.guides as f32);
        let below = |part: usize| u32::try_from(below(part)).expect("no picture is so wide");
        self.guide.extend((0..=self.guides).map(below));
    }

    /// Returns the step of a table that holds `u`, in [0, 1), and where in it, in [0, 1].
    #[inline]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a part of [0, 1)")]
    fn invert(&self, table: usize, u: f32) -> (usize, f32) {
        let sums = &self.sums[table * (self.steps + 1)..][..=self.steps];
        let part = ((u * self.guides as f32) as usize).min(self.guides - 1);
        let guide = &self.guide[table * (self.guides + 1) + part..];
        let (from, to) = (guide[0] as usize, guide[1] as usize);
        let index = (from + sums[from..to].partition_point(|&sum| sum <= u)).clamp(1, self.steps) - 1;
        let (low, high) = (sums[index], sums[index + 1]);
        (index, if high > low { ((u - low) / (high - low)).clamp(0.0, 1.0) } else { 0.5 })
    }

    /// Returns the share of a step.
    #[inline]
    fn share(&self, table: usize, step: usize) -> f32 {
        let sums = &self.sums[table * (self.steps + 1) + step..];
        sums[1] - sums[0]
    }

    fn memory_bytes(&self) -> usize {
        self.sums.capacity() * size_of::<f32>() + self.guide.capacity() * size_of::<u32>()
    }
}

/// Returns the cell of a coordinate in [0, 1].
#[inline]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a number from 0 to the picture's size")]
fn cell(u: f32, size: u32) -> usize {
    ((u * size as f32) as usize).min(size as usize - 1)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn the_guide_finds_what_a_search_of_all_finds() {
        // Steps with nothing and steps with nearly all; lengths about powers of two; the first table is even.
        const WEIGHTS: [f64; 7] = [1.0, 0.0, 0.0, 1e6, 1e-3, 3.0, 0.0];
        for steps in [1, 2, 7, 8, 9, 64, 65, 1000] {
            let mut tables = Tables::with_capacity(steps, 2);
            tables.append(std::iter::repeat_n(0.0, steps));
            tables.append((0..steps).map(|i| WEIGHTS[i * 5 % 7]));
            for table in 0..2 {
                let sums = &tables.sums[table * (steps + 1)..][..=steps];
                let places = sums.iter().flat_map(|sum| [sum.next_down(), *sum, sum.next_up()]);
                let even = (0..4096).map(|i| i as f32 / 4096.0);
                for u in places.chain(even).filter(|u| (0.0..1.0).contains(u)) {
                    let expected = sums.partition_point(|&sum| sum <= u) - 1;
                    assert_eq!(tables.invert(table, u).0, expected, "{u} of table {table} of {steps} steps");
                }
            }
        }
    }

    /// Surroundings of one column with light 1 in some rows.
    fn lit_rows(height: usize, lit: &[usize]) -> EnvironmentLight {
        let mut pixels = vec![Vec3::ZERO; height];
        lit.iter().for_each(|&row| pixels[row] = Vec3::ONE);
        let height = u32::try_from(height).expect("a picture's height");
        EnvironmentLight::new(Environment::from_pixels(1, height, pixels)).expect("it shines")
    }

    /// Polar angle of a direction, in rows.
    fn rows_down(direction: Vec3A, height: usize) -> f64 {
        let [x, y, z] = direction.to_array();
        f64::from(x).hypot(f64::from(z)).atan2(f64::from(y)) * height as f64 / PI
    }

    #[test]
    fn density_times_solid_angle_is_one() {
        for height in [1, 2, 3, 4, 7, 1024, 16_384, 16_385] {
            // All but alike in flux, so that no share is lost to rounding.
            let lit = [0, 1, 100, height / 2, height.max(2) - 2, height - 1].map(|row: usize| row.min(height - 1));
            let light = lit_rows(height, if height == 1 { &lit[..1] } else { &lit });
            let mut sum = 0.0;
            for row in 0..height {
                let share = f64::from(light.rows.share(0, row));
                let (from, to) = (row as f64 * PI / height as f64, (row + 1) as f64 * PI / height as f64);
                let solid_angle = 2.0 * TAU * (0.5 * (from + to)).sin() * (0.5 * (to - from)).sin();
                let v = narrow((row as f64 + 0.5) / height as f64);
                let found = f64::from(light.pdf_at(Vec2::new(0.5, v))) * solid_angle;
                // Three roundings, and those of a sum of shares.
                assert!((found - share).abs() <= 4e-7 * share, "row {row} of {height}: {found} instead of {share}");
                sum += found;
            }
            assert!((sum - 1.0).abs() < 1e-5, "{height} rows: {sum}");
        }
    }

    #[test]
    fn directions_lie_in_their_row_in_proportion_to_its_solid_angle() {
        for height in [1, 2, 3, 5, 16, 1023, 16_384, 16_385] {
            for row in [0, 1, 100, height / 4, height / 2, height - height / 4, height.max(2) - 2, height - 1] {
                if row >= height {
                    continue;
                }
                let light = lit_rows(height, &[row]);
                let sums = &light.rows.sums;
                for i in 0..=16 {
                    let u = sums[row] + (sums[row + 1] - sums[row]) * i as f32 / 16.0;
                    let (found, y) = light.rows.invert(0, u);
                    let direction = light.direction(Vec2::new(0.3, u));
                    assert!((direction.length() - 1.0).abs() < 3e-7, "row {row} of {height}: {direction} is unit");
                    let (from, to) = (found as f64 * PI / height as f64, (found + 1) as f64 * PI / height as f64);
                    // The angle whose 2 sin^2 of its half is so far between those of the borders.
                    let half = |angle: f64| (0.5 * angle).sin().powi(2);
                    let exact = half(from) + (half(to) - half(from)) * f64::from(y);
                    let exact = 2.0 * exact.sqrt().asin() * height as f64 / PI;
                    let down = rows_down(direction, height);
                    // What single precision leaves of angles, at the equator and where 1 - y is rounded.
                    let tolerance = 1e-6 + 3e-7 * height as f64;
                    assert!((down - exact).abs() < tolerance, "row {row} of {height}, {y}: {down} instead of {exact}");
                }
            }
        }
    }

    #[test]
    fn light_at_the_poles_of_tall_pictures_is_found_without_bias() {
        for height in [64, 1024, 4096, 16_384] {
            for pole in [0, height - 1] {
                let light = lit_rows(height, &[pole]);
                // Radiance is 1 up to the middle of the row, and falls to 0 in the middle of the next.
                let exact: f64 = (0..3000)
                    .map(|i| {
                        let rows = (f64::from(i) + 0.5) / 2000.0;
                        let angle = rows * PI / height as f64;
                        (1.5 - rows).min(1.0) * TAU * angle.sin() * PI / height as f64 / 2000.0
                    })
                    .sum();
                let count = 1 << 16;
                let sum: f64 = (0..count)
                    .filter_map(|i| {
                        let u = Vec2::new(0.3, (i as f32 + 0.5) / count as f32);
                        light.sample_at(light.direction(u), 1.0)
                    })
                    .map(|sample| f64::from(sample.radiance.x / sample.pdf))
                    .sum();
                let found = sum / f64::from(count);
                assert!((found / exact - 1.0).abs() < 1e-3, "row {pole} of {height}: {found} instead of {exact}");
            }
        }
    }

    #[test]
    fn a_halo_has_its_samples_beside_the_sun() {
        // A sun of 1 pixel, a halo around it with a fiftieth of its light, and a sky that counts for nothing.
        let (width, height) = (64, 32);
        let mut pixels = vec![Vec3::ONE; width * height];
        for (index, pixel) in pixels.iter_mut().enumerate() {
            let (x, y) = ((index % width).abs_diff(20), (index / width).abs_diff(16));
            *pixel = Vec3::splat(match x.max(y) {
                0 => 1e5,
                1..=5 => 1.0 + 1e5 / 50.0 / 120.0,
                _ => 1.0,
            });
        }
        let environment = Environment::from_pixels(64, 32, pixels);
        let part = |radiance: Vec3| radiance - 1.0;
        let light = EnvironmentLight::new(environment).unwrap().weighted(part).unwrap();
        let (mut sum, mut of_halo, mut dimmest) = (0.0, 0.0, f32::INFINITY);
        let side = 256;
        for number in 0..side * side {
            let u = (Vec2::new((number % side) as f32, (number / side) as f32) + 0.5) / side as f32;
            let sample = light.sample_at(light.direction(u), 1.0).unwrap();
            let value = part(sample.radiance).x / sample.pdf / (side * side) as f32;
            sum += value;
            if sample.radiance.x < 20.0 {
                of_halo += 1.0 / (side * side) as f32;
                dimmest = dimmest.min(value);
            }
        }
        assert!((sum / light.integral.x - 1.0).abs() < 0.02, "{sum} instead of {}", light.integral.x);
        // By the light alone 0.02; the roots of the halo outweigh the sun's.
        assert!(of_halo > 0.1, "a share of {of_halo}");
        let even = light.integral.x / (side * side) as f32;
        assert!(dimmest < 0.2 * even, "and they are dim: {dimmest}, where all alike would be {even}");
    }
}
