//! LDR-FLIP: how different two pictures look when a viewer flips between them, 0 (the same) to 1, for each pixel.
//!
//! ```text
//! colour:  both pictures in YCxCz, filtered by what the eye resolves, in L*a*b* after Hunt; HyAB distance, remapped
//! feature: edges and points of the luminance Y by first and second derivatives of a Gaussian; the larger difference
//! FLIP   = colour ^ (1 - feature)
//! ```
//!
//! # Source
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and Fairchild 2020, "FLIP: A Difference Evaluator for
//! Alternating Images". Checked against the authors' flip-evaluator 1.7; its two-dimensional filters are products of
//! rows and columns, and are applied so.

use glam::{Mat3, UVec2, Vec3};
use rayon::prelude::*;

use super::{Image, MetricsError, same_size};

/// Pixels in a degree of the visual field: 0.7 m before a screen 0.7 m and 3840 pixels wide, the authors' choice.
pub const DEFAULT_PIXELS_PER_DEGREE: f32 = 67.020_64;

/// Exponent of the colour difference, its knee, and where the knee is mapped to (section 4.1.3 of the paper).
const COLOUR_EXPONENT: f32 = 0.7;
const KNEE: f32 = 0.4;
const KNEE_TARGET: f32 = 0.95;
/// Width in degrees of the eye's edge and point detectors, and the exponent of their difference (section 4.2).
const FEATURE_WIDTH: f32 = 0.082;
const FEATURE_EXPONENT: f32 = 0.5;

/// The result of [`ldr_flip`].
#[derive(Debug, Clone)]
pub struct Flip {
    /// Mean over all pixels, in [0, 1].
    pub mean: f64,
    /// The error of each pixel, in [0, 1], rows from the top.
    pub map: Vec<f32>,
}

/// Returns LDR-FLIP of two linear pictures, shown as a plain viewer would: multiplied by `exposure` and clamped to
/// [0, 1]. The sRGB curve is not rounded to 8 bits in between. Pixels that are not finite count as black to their
/// neighbours and have the error 1 themselves. Fewer than one pixel per degree count as one.
///
/// # Errors
/// When the sizes differ, or `exposure` or `pixels_per_degree` is not positive and finite.
pub fn ldr_flip(image: &Image, reference: &Image, exposure: f32, pixels_per_degree: f32) -> Result<Flip, MetricsError> {
    same_size(image, reference)?;
    for (name, value) in [("the exposure", exposure), ("the number of pixels per degree", pixels_per_degree)] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(MetricsError::NotPositive(name));
        }
    }
    let filters = Filters::new(pixels_per_degree.max(1.0));
    let a = Seen::new(image, exposure, &filters);
    let b = Seen::new(reference, exposure, &filters);
    let widest = colour_distance(hunt_lab(Vec3::Y), hunt_lab(Vec3::Z)).powf(COLOUR_EXPONENT);
    let map: Vec<f32> = (0..a.lab.len())
        .into_par_iter()
        .map(|k| {
            if !(image.pixels()[k].is_finite() && reference.pixels()[k].is_finite()) {
                return 1.0;
            }
            let colour = remap(colour_distance(a.lab[k], b.lab[k]).powf(COLOUR_EXPONENT), widest);
            let feature = (a.edges[k] - b.edges[k]).abs().max((a.points[k] - b.points[k]).abs());
            let feature = (feature / std::f32::consts::SQRT_2).powf(FEATURE_EXPONENT);
            colour.powf(1.0 - feature)
        })
        .collect();
    let mean = map.iter().map(|&error| f64::from(error)).sum::<f64>() / map.len() as f64;
    Ok(Flip { mean, map })
}

/// One picture as the eye takes it in.
struct Seen {
    /// L*a*b* after filtering, chroma scaled by lightness (Hunt).
    lab: Vec<Vec3>,
    /// Strength of edges.
    edges: Vec<f32>,
    /// Strength of points and lines.
    points: Vec<f32>,
}

impl Seen {
    fn new(image: &Image, exposure: f32, filters: &Filters) -> Self {
        let size = image.size();
        let opponent: Vec<Vec3> = image
            .pixels()
            .par_iter()
            .map(|&pixel| {
                let shown = if pixel.is_finite() { pixel * exposure } else { Vec3::ZERO };
                ycxcz(shown.clamp(Vec3::ZERO, Vec3::ONE))
            })
            .collect();
        let plane = |channel: usize| -> Vec<f32> { opponent.par_iter().map(|pixel| pixel[channel]).collect() };
        let (y, cx, cz) = (plane(0), plane(1), plane(2));

        let blurred = |plane: &[f32], kernel: &[f32]| separable(plane, size, kernel, kernel);
        let (blurred_y, blurred_cx) = (blurred(&y, &filters.achromatic), blurred(&cx, &filters.red_green));
        let [narrow, wide] = filters.blue_yellow.each_ref().map(|(weight, kernel)| (*weight, blurred(&cz, kernel)));
        let lab = (0..y.len())
            .into_par_iter()
            .map(|k| {
                let blurred_cz = narrow.0 * narrow.1[k] + wide.0 * wide.1[k];
                let rgb = rgb_from_ycxcz(Vec3::new(blurred_y[k], blurred_cx[k], blurred_cz));
                hunt_lab(rgb.clamp(Vec3::ZERO, Vec3::ONE))
            })
            .collect();

        // Detectors work on Y in [0, 1]; they blur across and differentiate along each axis.
        let luminance: Vec<f32> = y.par_iter().map(|y| (y + 16.0) / 116.0).collect();
        let strength = |kernel: &[f32]| -> Vec<f32> {
            let along_x = separable(&luminance, size, kernel, &filters.detector);
            let along_y = separable(&luminance, size, &filters.detector, kernel);
            along_x.par_iter().zip(&along_y).map(|(x, y)| x.hypot(*y)).collect()
        };
        Self { lab, edges: strength(&filters.edge), points: strength(&filters.point) }
    }
}

/// The one-dimensional kernels, all of odd length; those of the eye's contrast sensitivity sum to 1.
struct Filters {
    achromatic: Vec<f32>,
    red_green: Vec<f32>,
    /// Two Gaussians, weights summing to 1.
    blue_yellow: [(f32, Vec<f32>); 2],
    /// Gaussian of the feature detectors and its derivatives, whose positive and negative parts each sum to 1.
    detector: Vec<f32>,
    edge: Vec<f32>,
    point: Vec<f32>,
}

impl Filters {
    fn new(pixels_per_degree: f32) -> Self {
        use std::f32::consts::PI;
        // Table 1 of the paper: a sum of a * sqrt(pi / b) * exp(-pi^2 x^2 / b), x in degrees.
        let (achromatic, red_green, narrow, wide) = (0.0047, 0.0053, (34.1, 0.04), (13.5, 0.025));
        let radius = reach(3.0 * (narrow.1 / (2.0 * PI * PI)).sqrt() * pixels_per_degree);
        let kernel =
            |b: f32| -> (f32, Vec<f32>) { normalised(radius, |x| (-(PI * x / pixels_per_degree).powi(2) / b).exp()) };
        // In two dimensions a kernel holds the square of its row's sum; the two are normalised together.
        let mixed = [narrow, wide].map(|(a, b): (f32, f32)| {
            let (sum, kernel) = kernel(b);
            (a * (PI / b).sqrt() * sum * sum, kernel)
        });
        let total = mixed[0].0 + mixed[1].0;

        let sigma = 0.5 * FEATURE_WIDTH * pixels_per_degree;
        let gaussian = |x: f32| (-x * x / (2.0 * sigma * sigma)).exp();
        let radius = reach(3.0 * sigma);
        Self {
            achromatic: kernel(achromatic).1,
            red_green: kernel(red_green).1,
            blue_yellow: mixed.map(|(weight, kernel)| (weight / total, kernel)),
            detector: normalised(radius, gaussian).1,
            edge: balanced(radius, |x| -x * gaussian(x)),
            point: balanced(radius, |x| (x * x / (sigma * sigma) - 1.0) * gaussian(x)),
        }
    }
}

/// A kernel's radius in pixels; beyond 2^15 it is wider than any picture.
fn reach(radius: f32) -> i16 {
    #[expect(clippy::cast_possible_truncation, reason = "the cast saturates")]
    let reach = radius.ceil() as i16;
    reach
}

fn sampled(radius: i16, f: impl Fn(f32) -> f32) -> Vec<f32> {
    (-i32::from(radius)..=i32::from(radius)).map(|x| f(x as f32)).collect()
}

/// Samples of `f` divided by their sum, and the sum.
fn normalised(radius: i16, f: impl Fn(f32) -> f32) -> (f32, Vec<f32>) {
    let kernel = sampled(radius, f);
    let sum: f32 = kernel.iter().sum();
    (sum, kernel.iter().map(|value| value / sum).collect())
}

/// Samples of `f` with the positive ones summing to 1 and the negative ones to -1.
fn balanced(radius: i16, f: impl Fn(f32) -> f32) -> Vec<f32> {
    let kernel = sampled(radius, f);
    let positive: f32 = kernel.iter().filter(|value| **value > 0.0).sum();
    let negative: f32 = kernel.iter().filter(|value| **value < 0.0).sum();
    let share = |value: f32| match value {
        v if v > 0.0 => v / positive,
        v if v < 0.0 => -v / negative,
        zero => zero,
    };
    kernel.into_iter().map(share).collect()
}

/// Correlates `plane` with `row` along x and `column` along y; the border pixels repeat outside.
fn separable(plane: &[f32], size: UVec2, row: &[f32], column: &[f32]) -> Vec<f32> {
    let (width, height) = (size.x as usize, size.y as usize);
    let mut rows = vec![0.0; plane.len()];
    rows.par_chunks_mut(width).zip(plane.par_chunks(width)).for_each(|(out, line)| {
        for (x, out) in out.iter_mut().enumerate() {
            *out = (row.iter().zip(taps(x, row.len(), width))).map(|(weight, x)| weight * line[x]).sum();
        }
    });
    let mut out = vec![0.0; plane.len()];
    out.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        for (weight, y) in column.iter().zip(taps(y, column.len(), height)) {
            for (out, value) in out.iter_mut().zip(&rows[y * width..][..width]) {
                *out += weight * value;
            }
        }
    });
    out
}

/// Positions under a kernel of odd `length` centred at `at`, clamped to `[0, end)`.
fn taps(at: usize, length: usize, end: usize) -> impl Iterator<Item = usize> {
    let radius = length / 2;
    (at..at + length).map(move |x| x.saturating_sub(radius).min(end - 1))
}

/// CIE XYZ of linear sRGB, rows X, Y, Z, to the digits of the authors' program.
const XYZ_FROM_RGB: Mat3 = Mat3::from_cols(
    Vec3::new(0.412_386_56, 0.212_636_82, 0.019_330_62),
    Vec3::new(0.357_591_5, 0.715_183, 0.119_197_17),
    Vec3::new(0.180_450_49, 0.072_180_2, 0.950_372_6),
);
/// XYZ of white, (1, 1, 1) in RGB.
const WHITE: Vec3 = Vec3::new(0.950_428_55, 1.0, 1.088_900_4);

/// The linear opponent space YCxCz of linear sRGB.
fn ycxcz(rgb: Vec3) -> Vec3 {
    let v = XYZ_FROM_RGB * rgb / WHITE;
    Vec3::new(116.0 * v.y - 16.0, 500.0 * (v.x - v.y), 200.0 * (v.y - v.z))
}

fn rgb_from_ycxcz(opponent: Vec3) -> Vec3 {
    let y = (opponent.x + 16.0) / 116.0;
    let v = Vec3::new(y + opponent.y / 500.0, y, y - opponent.z / 200.0);
    XYZ_FROM_RGB.inverse() * (v * WHITE)
}

/// CIE L*a*b* of linear sRGB with a* and b* scaled by L*/100 (Hunt: colours look fainter in the dark).
fn hunt_lab(rgb: Vec3) -> Vec3 {
    const DELTA: f32 = 6.0 / 29.0;
    let f = |t: f32| {
        if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    };
    let v = XYZ_FROM_RGB * rgb / WHITE;
    let (x, y, z) = (f(v.x), f(v.y), f(v.z));
    let lightness = 116.0 * y - 16.0;
    Vec3::new(lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z))
}

/// HyAB: city blocks between lightness and chroma, Euclidean within chroma.
fn colour_distance(a: Vec3, b: Vec3) -> f32 {
    let d = a - b;
    d.x.abs() + d.y.hypot(d.z)
}

/// Maps [0, knee] to [0, 0.95] and the rest up to `widest` to [0.95, 1]: large differences are all alike.
fn remap(distance: f32, widest: f32) -> f32 {
    let knee = KNEE * widest;
    if distance < knee {
        distance * KNEE_TARGET / knee
    } else {
        KNEE_TARGET + (distance - knee) / (widest - knee) * (1.0 - KNEE_TARGET)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: UVec2 = UVec2::new(40, 24);

    /// Stripes in red, a chequered green, a ramp in blue; the test is darker in red, has a plain patch in green and a
    /// flatter ramp.
    fn pictures() -> (Vec<Vec3>, Vec<Vec3>) {
        let (mut image, mut reference) = (Vec::new(), Vec::new());
        for y in 0..SIZE.y {
            for x in 0..SIZE.x {
                let red = ((x * 7 + y * 3) % 16) as f32 / 15.0;
                let green = ((x / 4 + y / 4) % 2) as f32 * 0.8;
                let blue = (x + y) as f32 / (SIZE.x + SIZE.y - 2) as f32;
                let patch = (10..20).contains(&x) && (5..9).contains(&y);
                reference.push(Vec3::new(red, green, blue));
                image.push(Vec3::new(red * 0.9, if patch { 0.3 } else { green }, 1.0 - 0.75 * (1.0 - blue)));
            }
        }
        (image, reference)
    }

    /// Values of the authors' flip-evaluator 1.7 (`evaluate(..., "LDR", inputsRGB=False, applyMagma=False)`).
    fn expect(pixels_per_degree: f32, mean: f64, points: &[(u32, u32, f32)]) {
        let (image, reference) = pictures();
        let (image, reference) = (Image::new(SIZE, &image).unwrap(), Image::new(SIZE, &reference).unwrap());
        let found = ldr_flip(&image, &reference, 1.0, pixels_per_degree).unwrap();
        assert!((found.mean - mean).abs() < 2e-5, "mean {} is not {mean}", found.mean);
        for &(x, y, expected) in points {
            let at = found.map[(y * SIZE.x + x) as usize];
            assert!((at - expected).abs() < 1e-4, "{at} at ({x}, {y}) is not {expected}");
        }
    }

    #[test]
    fn agrees_with_the_authors_at_the_usual_distance() {
        let points = [
            (0, 0, 0.514_734),
            (39, 23, 0.126_420),
            (12, 6, 0.494_479),
            (20, 12, 0.282_291),
            (9, 5, 0.541_885),
            (31, 2, 0.240_711),
        ];
        expect(DEFAULT_PIXELS_PER_DEGREE, 0.309_486, &points);
    }

    #[test]
    fn agrees_with_the_authors_from_near() {
        let points = [
            (0, 0, 0.553_743),
            (39, 23, 0.135_100),
            (12, 6, 0.928_907),
            (20, 12, 0.280_643),
            (9, 5, 0.577_979),
            (31, 2, 0.273_127),
        ];
        expect(20.0, 0.313_771, &points);
    }

    #[test]
    fn equal_pictures_have_no_error_and_opposite_ones_nearly_all() {
        let (image, _) = pictures();
        let image = Image::new(SIZE, &image).unwrap();
        let same = ldr_flip(&image, &image, 1.0, DEFAULT_PIXELS_PER_DEGREE).unwrap();
        assert_eq!(same.mean, 0.0, "nothing differs");
        let (green, blue) = (vec![Vec3::Y; 960], vec![Vec3::Z; 960]);
        let far = ldr_flip(
            &Image::new(SIZE, &green).unwrap(),
            &Image::new(SIZE, &blue).unwrap(),
            1.0,
            DEFAULT_PIXELS_PER_DEGREE,
        );
        let far = far.unwrap().mean;
        assert!((far - 1.0).abs() < 1e-4, "green against blue is the widest distance: {far}");
    }

    #[test]
    fn bright_pixels_are_clamped_and_bad_ones_count_in_full() {
        let reference = vec![Vec3::ONE; 960];
        let mut image = vec![Vec3::splat(7.0); 960];
        image[0] = Vec3::NAN;
        let (image, reference) = (Image::new(SIZE, &image).unwrap(), Image::new(SIZE, &reference).unwrap());
        let found = ldr_flip(&image, &reference, 1.0, DEFAULT_PIXELS_PER_DEGREE).unwrap();
        assert_eq!(found.map[0], 1.0, "not a number");
        assert_eq!(found.map[959], 0.0, "7 is shown as 1, far from the bad pixel");
        assert!(found.map.iter().all(|error| (0.0..=1.0).contains(error)), "all within [0, 1]");
    }

    #[test]
    fn exposure_and_distance_must_be_positive() {
        let (image, _) = pictures();
        let image = Image::new(SIZE, &image).unwrap();
        for (exposure, degree) in [(0.0, 67.0), (-1.0, 67.0), (f32::NAN, 67.0), (1.0, 0.0), (1.0, f32::INFINITY)] {
            assert!(ldr_flip(&image, &image, exposure, degree).is_err(), "exposure {exposure}, {degree} per degree");
        }
        assert!(ldr_flip(&image, &image, 1.0, 1e-30).is_ok(), "very few pixels a degree count as one");
    }
}
