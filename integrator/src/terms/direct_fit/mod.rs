//! Direct light in half shadows, fitted over the pixels around.
//!
//! What is left of the noise of direct light is in half shadows, and most of these are many pixels wide: what comes from
//! the sources changes there from pixel to pixel by less than it is off. So the irradiance of each surface point, direct
//! light over albedo, is that of the quadratic polynomial of the place in the picture which comes nearest to the points
//! of the same surface around it, in the least squares (Savitzky and Golay 1964). In the middle of 7 x 7 points a
//! thirteenth of the variance is left.
//!
//! A fit is taken only where it explains all but noise. Each point knows its noise by the two halves of its samples; if
//! about as much is left between polynomial and points, it is noise. Else the window is made smaller, or the point keeps
//! what it found. So what a fit is off by is of the order of the noise that it takes away or less, and falls with the
//! number of samples as that does.
//!
//! Surfaces that lie in each other's planes are one here, whatever they are made of, for light over albedo does not know
//! that. What is known in closed form is not fitted, but tells what is around it.
//!
//! # Source
//!
//! Abraham Savitzky, Marcel Golay, *Smoothing and Differentiation of Data by Simplified Least Squares Procedures*,
//! 1964, which has neither masks nor the test. Toshiya Hachisuka et al., *Multidimensional Adaptive Sampling and
//! Reconstruction for Ray Tracing*, 2008; Bochang Moon, Nathan Carr, Sung-Eui Yoon, *Adaptive Rendering Based on
//! Weighted Local Regression*, 2014, whose windows the error decides.

mod lit;
mod polynomials;

use std::iter::zip;

use glam::Vec3;
use rayon::prelude::*;

use crate::surface_points::{MIN_NORMAL_COS, PixelPoints, SurfacePoint};

pub(crate) use lit::Lit;
use polynomials::{INSIDE, LANES, Polynomials, RADII, RADIUS, SIDE, Window, count, dot, product};

/// Relative noise, by squares, summed over a window, that is not worth the time.
const CLEAN: f32 = 5e-5;
/// Surfaces have nothing in common that lie off each other's planes by more than this share of their distance, about what
/// [`MIN_NORMAL_COS`] allows.
const MAX_OFF_PLANE: f32 = 0.2;
/// Nor those that lie off them by more than so many widths of a pixel: at a flat angle all of a table's top lies near the
/// plane of the floor behind, by the first measure.
const MAX_DEPTH: f32 = 3.0;
/// A channel of which a surface reflects a smaller share of what it reflects of the brightest tells nothing of light.
const MIN_CHANNEL: f32 = 1e-2;

/// The surface that takes most of a pixel, if its direct light may be fitted.
fn fitted_point(pixel: &PixelPoints) -> Option<&SurfacePoint> {
    let most = pixel.points.iter().max_by(|a, b| a.spread.count.total_cmp(&b.spread.count))?;
    let (weight, bsdf) = (most.diffuse_weight, &most.shading.bsdf);
    let tells = weight.min_element() > MIN_CHANNEL * weight.max_element();
    let may_be = most.chain == 0 && bsdf.has_diffuse() && !bsdf.has_glossy() && tells && most.lit.sum.is_finite();
    may_be.then_some(most)
}

/// What is known of the points of pixels.
#[derive(Debug, Clone, Copy)]
enum Plane {
    /// Share of the pixel that the surface takes: 0 where nothing is fitted.
    Share,
    /// Direct light over albedo: the first of three channels.
    Light,
    /// The variances of these.
    Variance = Self::Light as isize + 3,
    /// Normal: the first of three axes.
    Normal = Self::Variance as isize + 3,
    /// Place, metres.
    Place = Self::Normal as isize + 3,
    /// How far others may lie off its plane, metres; 0 where its own light is not to be fitted.
    Depth = Self::Place as isize + 3,
    /// What its light over albedo counts in the pixel: the first of three channels.
    Scale = Self::Depth as isize + 1,
}

/// Number of numbers that [`Plane`] names.
const PLANES: usize = Plane::Scale as usize + 3;

/// What a pixel tells of the surface that takes most of it, in the order of [`Plane`], if that may be fitted.
fn planes_of(pixel: &PixelPoints) -> Option<[f32; PLANES]> {
    let point = fitted_point(pixel)?;
    let (count, weight, samples) = (point.spread.count, point.diffuse_weight, pixel.samples as f32);
    let (light, variance) = (point.lit.sum / weight, point.lit.variance(weight, count)?);
    let (p, n) = point.middle();
    let depth = if point.lit.is_sampled { MAX_DEPTH * point.footprint } else { 0.0 };
    let share = count / samples;
    let [l, v, n, p, s] = [light.into(), variance.into(), n.to_array(), p.to_array(), (weight / samples).into()];
    Some([share, l[0], l[1], l[2], v[0], v[1], v[2], n[0], n[1], n[2], p[0], p[1], p[2], depth, s[0], s[1], s[2]])
}

/// Fits the direct light of a picture, band after band from the top. The last rows of a band wait for the next one, so
/// that their windows end no earlier than those of others.
pub(crate) struct DirectFit {
    /// Pixels in a row, and length of a row of a plane.
    width: usize,
    stride: usize,
    /// The planes, row by row: as many rows above the first that waits as a window reaches, the rows that wait, and as
    /// many dark ones below, or one more as windows have a lane too many. A margin at both sides.
    rows: Vec<f32>,
    /// Number of the first pixel that waits.
    first: usize,
    /// Least squares over windows of each of [`RADII`] in which all points count alike, and what each point there
    /// counts in the middle.
    whole: [(Polynomials, Window); RADII.len()],
}

impl DirectFit {
    /// Starts a picture of rows of `width` pixels.
    pub(crate) fn new(width: usize) -> Self {
        let stride = width + LANES;
        let whole = INSIDE.each_ref().map(|inside| {
            let polynomials = Polynomials::new(inside).expect("points all over the window");
            let shares = polynomials.shares(inside);
            (polynomials, shares)
        });
        Self { width, stride, rows: vec![0.0; stride * PLANES * SIDE], first: 0, whole }
    }

    /// Takes the `pixels` of the next band, whole rows of them, and returns the numbers of pixels that can be fitted
    /// now, up to this band's, and by how much each changes the direct light of the picture. After the last band none
    /// waits.
    pub(crate) fn fit(&mut self, pixels: &[PixelPoints], is_last: bool) -> Vec<(usize, Vec3)> {
        self.append(pixels.len(), |number| planes_of(&pixels[number]));
        self.take_changes(is_last)
    }

    /// Fits the pixels whose windows are there, and lets them go.
    fn take_changes(&mut self, is_last: bool) -> Vec<(usize, Vec3)> {
        let waits = if is_last { 0 } else { RADIUS };
        let ready = self.height().saturating_sub(waits);
        let changes = (0..ready * self.width).into_par_iter().filter_map(|pixel| {
            let change = self.at(Plane::Scale, pixel) * self.change(pixel)?;
            change.is_finite().then_some((self.first + pixel, change))
        });
        let changes = changes.collect();
        self.rows.drain(..ready * self.row_length());
        self.first += ready * self.width;
        changes
    }

    /// Takes what is known of so many more pixels.
    fn append(&mut self, pixel_count: usize, planes: impl Fn(usize) -> Option<[f32; PLANES]> + Sync) {
        let (above, height) = (RADIUS + self.height(), pixel_count / self.width);
        let Self { width, stride, .. } = *self;
        self.rows.resize(self.rows.len() + height * self.row_length(), 0.0);
        let rows = self.rows.par_chunks_mut(stride * PLANES).skip(above).take(height);
        rows.enumerate().for_each(|(y, row)| {
            for x in 0..width {
                let Some(planes) = planes(y * width + x) else { continue };
                for (plane, number) in planes.into_iter().enumerate() {
                    row[plane * stride + RADIUS + x] = number;
                }
            }
        });
    }

    /// Length of a row of all planes.
    const fn row_length(&self) -> usize {
        self.stride * PLANES
    }

    /// Number of rows that wait.
    const fn height(&self) -> usize {
        self.rows.len() / self.row_length() - SIDE
    }

    /// Where the window of a plane around a pixel begins, by its number among those that wait.
    const fn corner(&self, plane: usize, pixel: usize) -> usize {
        pixel / self.width * self.row_length() + plane * self.stride + pixel % self.width
    }

    /// What a pixel has in three planes, of which this is the first.
    fn at(&self, plane: Plane, pixel: usize) -> Vec3 {
        [0, 1, 2].map(|more| self.rows[self.corner(plane as usize + more, pixel) + self.middle()]).into()
    }

    /// From the beginning of a window to the middle of it.
    const fn middle(&self) -> usize {
        RADIUS * (self.row_length() + 1)
    }

    /// How far others may lie off the plane of a pixel's surface, see [`Plane::Depth`].
    fn depth(&self, pixel: usize) -> f32 {
        self.rows[self.corner(Plane::Depth as usize, pixel) + self.middle()]
    }

    /// The window of a plane around a pixel.
    fn window(&self, plane: usize, pixel: usize) -> Window {
        let corner = self.corner(plane, pixel);
        let mut window = [[0.0; LANES]; SIDE];
        for (row, lanes) in window.iter_mut().enumerate() {
            lanes.copy_from_slice(&self.rows[corner + row * self.row_length()..][..LANES]);
        }
        window
    }

    /// The windows of three planes, of which this is the first.
    fn windows(&self, plane: Plane, pixel: usize) -> [Window; 3] {
        [0, 1, 2].map(|more| self.window(plane as usize + more, pixel))
    }

    /// How much each point around a pixel counts: its share of its pixel, and nothing if it is of another surface.
    fn weights(&self, pixel: usize) -> Window {
        let mut weights = self.window(Plane::Share as usize, pixel);
        let (normals, places) = (self.windows(Plane::Normal, pixel), self.windows(Plane::Place, pixel));
        let [n, p] = [&normals, &places].map(|axes| [0, 1, 2].map(|axis: usize| axes[axis][RADIUS][RADIUS]));
        let depth = self.depth(pixel);
        for row in 0..SIDE {
            for lane in 0..LANES {
                // How far each lies off the plane of the other.
                let (mut cosine, mut off, mut own_off, mut apart_sq) = (0.0, 0.0, 0.0, 0.0);
                for axis in 0..3 {
                    let apart = places[axis][row][lane] - p[axis];
                    cosine += normals[axis][row][lane] * n[axis];
                    off += apart * n[axis];
                    own_off += apart * normals[axis][row][lane];
                    apart_sq += apart * apart;
                }
                let limit_sq = (MAX_OFF_PLANE * MAX_OFF_PLANE * apart_sq).min(depth * depth);
                let same = (cosine >= MIN_NORMAL_COS) & (off * off <= limit_sq) & (own_off * own_off <= limit_sq);
                weights[row][lane] = if same { weights[row][lane] } else { 0.0 };
            }
        }
        weights
    }

    /// By how much the points around a pixel would change its direct light over albedo; `None` where nothing may be
    /// fitted, there is no noise, or noise does not explain what a polynomial leaves.
    fn change(&self, pixel: usize) -> Option<Vec3> {
        if self.depth(pixel) == 0.0 {
            return None;
        }
        let (mut lights, mut variances) = (self.windows(Plane::Light, pixel), self.windows(Plane::Variance, pixel));
        let own = [0, 1, 2].map(|channel: usize| lights[channel][RADIUS][RADIUS]);
        let is_clean = |channel: usize| dot(&variances[channel], &INSIDE[0]) <= CLEAN * own[channel] * own[channel];
        if (0..3).all(is_clean) {
            return None;
        }
        let weights = self.weights(pixel);
        for (channel, (light, variance)) in zip(&mut lights, &mut variances).enumerate() {
            light.as_flattened_mut().iter_mut().for_each(|other| *other -= own[channel]);
            *variance = product(&weights, variance);
        }
        zip(&INSIDE, &self.whole).find_map(|(inside, (polynomials, shares))| {
            let weights = product(&weights, inside);
            let is_whole = weights == *inside;
            let polynomials = if is_whole { *polynomials } else { Polynomials::new(&weights)? };
            let explains = zip(&lights, &variances).all(|(light, variance)| {
                // Variances are those of the share of the pixel, so each times that is what a whole pixel would have.
                let noise = dot(variance, inside) / count(&weights);
                polynomials.explain(&weights, light, noise)
            });
            let shares = explains.then(|| if is_whole { *shares } else { polynomials.shares(&weights) })?;
            let change = Vec3::from(lights.each_ref().map(|light| dot(&shares, light)));
            Some(change.max(-Vec3::from(own)))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rng;

    const WIDTH: usize = 24;
    const HEIGHT: usize = 20;

    impl DirectFit {
        /// A picture in one band that waits.
        fn of(width: usize, height: usize, planes: impl Fn(usize) -> Option<[f32; PLANES]> + Sync) -> Self {
            let mut fit = Self::new(width);
            fit.append(width * height, planes);
            fit
        }

        /// The light over albedo of a pixel by those around.
        fn fitted(&self, pixel: usize) -> Option<Vec3> {
            Some(self.at(Plane::Light, pixel) + self.change(pixel)?)
        }
    }

    /// A floor of grey light, of which each pixel knows the variance: its light by the column and the row.
    fn floor(variance: f32, light: impl Fn(f32, f32) -> f32 + Sync) -> DirectFit {
        stairs(variance, light, |_| 0.0)
    }

    /// The same where the height of the floor depends on the column.
    fn stairs(
        variance: f32,
        light: impl Fn(f32, f32) -> f32 + Sync,
        height: impl Fn(usize) -> f32 + Sync,
    ) -> DirectFit {
        DirectFit::of(WIDTH, HEIGHT, |pixel| {
            let (x, y) = ((pixel % WIDTH) as f32, (pixel / WIDTH) as f32);
            Some(site(1.0, light(x, y), variance, [0.01 * x, height(pixel % WIDTH), 0.01 * y]))
        })
    }

    /// What is known of a pixel that looks down, of grey light.
    fn site(share: f32, l: f32, v: f32, [x, y, z]: [f32; 3]) -> [f32; PLANES] {
        [share, l, l, l, v, v, v, 0.0, 1.0, 0.0, x, y, z, 0.03, share, share, share]
    }

    /// Unrelated numbers of mean 0 and variance 1, by place.
    fn noise(seed: u64, x: f32, y: f32) -> f32 {
        12f32.sqrt() * (Rng::new(seed, u64::from(x.to_bits()) << 32 | u64::from(y.to_bits())).next_1d() - 0.5)
    }

    fn pixels() -> impl Iterator<Item = (usize, f32, f32)> {
        (0..WIDTH * HEIGHT).map(|pixel| (pixel, (pixel % WIDTH) as f32, (pixel / WIDTH) as f32))
    }

    #[test]
    fn a_smooth_half_shadow_loses_most_of_its_noise() {
        const DEVIATION: f32 = 0.01;
        let light = |x: f32, y: f32| 1.0 + 0.02 * x - 0.001 * x * x + 0.0005 * x * y;
        // Sums of squares of what is off, inside of the picture and at its rim.
        let (mut inner, mut rim) = ((0.0, 0), (0.0, 0));
        for seed in 0..20 {
            let sites = floor(DEVIATION * DEVIATION, |x, y| light(x, y) + DEVIATION * noise(seed, x, y));
            for (pixel, x, y) in pixels() {
                let Some(found) = sites.fitted(pixel) else { continue };
                let is_inner = x.min(y) >= 3.0 && x.max(y + 4.0) <= 20.0;
                let (sum, count) = if is_inner { &mut inner } else { &mut rim };
                *sum += (found.x - light(x, y)).powi(2) / (DEVIATION * DEVIATION);
                *count += 1;
            }
        }
        let [inner, rim] = [inner, rim].map(|(sum, count)| (sum / count as f32, count as f32 / 20.0));
        // Of 18 x 14 and of 228 pixels; by chance some have less than the whole window, or none.
        assert!(inner.1 > 0.9 * 252.0 && (0.06..0.11).contains(&inner.0), "{inner:?}");
        assert!(rim.1 > 0.8 * 228.0 && rim.0 < 0.25, "windows that end early: {rim:?}");
    }

    #[test]
    fn no_window_crosses_the_edge_of_a_shadow() {
        let sites = floor(1e-4, |x, y| if x < 12.0 { 1.0 } else { 0.0 } + 0.01 * noise(3, x, y));
        for (pixel, x, _) in pixels() {
            let Some(found) = sites.fitted(pixel) else { continue };
            assert!(!(10.0..14.0).contains(&x), "column {x}: {found}");
            assert!((found.x - if x < 12.0 { 1.0 } else { 0.0 }).abs() < 0.04, "column {x}: {found}");
        }
        let far = pixels().filter(|(_, x, _)| *x < 8.0).filter(|(pixel, ..)| sites.fitted(*pixel).is_some()).count();
        assert!(far > 8 * HEIGHT * 9 / 10, "{far} of {} away from it", 8 * HEIGHT);
    }

    #[test]
    fn surfaces_that_meet_in_the_picture_keep_apart() {
        let step = |x: f32| if x < 12.0 { 1.0 } else { 0.2 };
        let sites = stairs(1e-4, |x, y| step(x) + 0.01 * noise(5, x, y), |x| if x < 12 { 0.0 } else { 0.5 });
        let found = pixels().filter_map(|(pixel, x, _)| sites.fitted(pixel).map(|found| (found.x - step(x)).abs()));
        let (count, worst) = found.fold((0, 0.0f32), |(count, worst), off| (count + 1, worst.max(off)));
        assert!(count > WIDTH * HEIGHT * 9 / 10 && worst < 0.03, "{count} fitted, off by {worst}");
    }

    #[test]
    fn what_has_no_noise_and_what_takes_no_part_stays() {
        let clean = floor(0.0, |x, _| 1.0 + 0.1 * x);
        assert!(pixels().all(|(pixel, ..)| clean.fitted(pixel).is_none()), "no noise");
        let alone = DirectFit::of(WIDTH, HEIGHT, |pixel| {
            let place = [(pixel % WIDTH) as f32, 0.0, (pixel / WIDTH) as f32];
            // Every fifth pixel of every fifth row.
            let is_there = (pixel % WIDTH).is_multiple_of(5) && (pixel / WIDTH).is_multiple_of(5);
            is_there.then_some(site(1.0, 1.0, 0.1, place))
        });
        assert!(pixels().all(|(pixel, ..)| alone.fitted(pixel).is_none()), "too few");
    }

    #[test]
    fn what_is_left_is_judged_as_strictly_where_surfaces_take_a_part_of_pixels() {
        for share in [1.0, 0.5, 0.25] {
            // Columns that are brighter and darker in turn, by 2 deviations.
            let variance: f32 = 1e-4 / share;
            let column = |x: usize| if x.is_multiple_of(2) { 1.0 } else { -1.0 };
            let saw = |times: f32| {
                DirectFit::of(WIDTH, HEIGHT, move |pixel| {
                    let (column, x, y) = (column(pixel % WIDTH), (pixel % WIDTH) as f32, (pixel / WIDTH) as f32);
                    let off = times * column + if times > 0.0 { 0.0 } else { noise(1, x, y) };
                    Some(site(share, 1.0 + variance.sqrt() * off, variance, [0.01 * x, 0.0, 0.01 * y]))
                })
            };
            // At the rim three columns are left of a window, through which some polynomial goes.
            let inner = || pixels().filter(|(_, x, _)| (2.0..22.0).contains(x));
            let fitted = |sites: &DirectFit| inner().filter(|(pixel, ..)| sites.fitted(*pixel).is_some()).count();
            assert_eq!(fitted(&saw(2.0)), 0, "{share}: no noise");
            assert!(fitted(&saw(0.0)) > WIDTH * HEIGHT / 2, "{share}: noise");
        }
    }

    #[test]
    fn what_is_known_exactly_stays_and_tells_others() {
        let sites = DirectFit::of(WIDTH, HEIGHT, |pixel| {
            let (x, y) = ((pixel % WIDTH) as f32, (pixel / WIDTH) as f32);
            let is_exact = x < 12.0;
            let (noise, variance) = if is_exact { (0.0, 0.0) } else { (0.01 * noise(7, x, y), 1e-4) };
            let mut known = site(1.0, 1.0 + noise, variance, [0.01 * x, 0.0, 0.01 * y]);
            known[Plane::Depth as usize] = if is_exact { 0.0 } else { 0.03 };
            Some(known)
        });
        for (pixel, x, _) in pixels() {
            assert!(x >= 12.0 || sites.fitted(pixel).is_none(), "column {x}");
        }
        let found = (0..HEIGHT).filter_map(|row| sites.fitted(row * WIDTH + 12)).map(|found| (found.x - 1.0).powi(2));
        let (count, sum) = found.fold((0, 0.0), |(count, sum), off| (count + 1, sum + off));
        assert!(count > HEIGHT / 2 && sum < 0.2 * 1e-4 * count as f32, "beside it: {count}, {sum:e}");
    }

    #[test]
    fn a_floor_behind_a_table_is_no_part_of_it() {
        // Seen at 5 degrees, from row to row a metre farther; the table's top is 0.5 m higher.
        let sites = DirectFit::of(WIDTH, HEIGHT, |pixel| {
            let (x, y) = ((pixel % WIDTH) as f32, (pixel / WIDTH) as f32);
            let (is_table, value) = if y < 10.0 { (0.0, 1.0) } else { (1.0, 0.2) };
            let mut known = site(1.0, value + 0.01 * noise(9, x, y), 1e-4, [0.1 * x, 0.5 * is_table, -y]);
            known[Plane::Depth as usize] = 0.3;
            Some(known)
        });
        for (pixel, _, y) in pixels() {
            let value = if y < 10.0 { 1.0 } else { 0.2 };
            let Some(found) = sites.fitted(pixel) else { continue };
            assert!((found.x - value).abs() < 0.03, "row {y}: {found}");
        }
        let beside = pixels().filter(|(pixel, _, y)| [9.0, 10.0].contains(y) && sites.fitted(*pixel).is_some()).count();
        assert!(beside > WIDTH, "{beside} of {} beside the edge", 2 * WIDTH);
    }

    #[test]
    fn pictures_smaller_than_a_window_have_what_they_can() {
        for (width, height) in [(1, 1), (1, 30), (30, 1), (2, 7), (4, 4), (6, 6)] {
            let sites = DirectFit::of(width, height, |pixel| {
                let (x, y) = ((pixel % width) as f32, (pixel / width) as f32);
                Some(site(1.0, 1.0 + 0.01 * noise(2, x, y), 1e-4, [0.01 * x, 0.0, 0.01 * y]))
            });
            let fitted = (0..width * height).filter(|&pixel| sites.fitted(pixel).is_some()).count();
            assert_eq!(fitted > 0, width.min(height) >= 4, "{width} x {height}: {fitted}");
        }
    }

    #[test]
    fn bands_are_fitted_as_one_picture_is() {
        let planes = |pixel: usize| {
            let (x, y) = ((pixel % WIDTH) as f32, (pixel / WIDTH) as f32);
            let light = 1.0 + 0.02 * x - 0.03 * y + 0.01 * noise(4, x, y);
            Some(site(0.5, light, 1e-4, [0.01 * x, 0.0, 0.01 * y]))
        };
        let whole = DirectFit::of(WIDTH, HEIGHT, planes).take_changes(true);
        assert!(whole.len() > WIDTH * HEIGHT * 9 / 10, "{} fitted", whole.len());
        for heights in [&[10, 10][..], &[1; HEIGHT], &[2, 3, 7, 8], &[18, 1, 1]] {
            let (mut fit, mut changes, mut above) = (DirectFit::new(WIDTH), Vec::new(), 0);
            for height in heights {
                fit.append(WIDTH * height, |pixel| planes(WIDTH * above + pixel));
                above += height;
                changes.extend(fit.take_changes(above == HEIGHT));
                let waiting = if above == HEIGHT { 0 } else { RADIUS.min(above) };
                assert_eq!(fit.height(), waiting, "rows wait after {above} rows");
            }
            assert_eq!(changes, whole, "{heights:?}");
        }
    }
}
