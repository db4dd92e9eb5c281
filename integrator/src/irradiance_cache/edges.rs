//! Derivatives of irradiance from the texels of one gather.
//!
//! When the point of view moves, texels gain and lose light over the edges between them, and what one gains the other
//! loses: only the difference of their radiances matters, and where that is 0 nothing does. An edge belongs to the
//! nearer of the two surfaces, which hides the other: it lies in the tangent plane of what that texel's ray met, and
//! stays there. What a movement in the tangent plane sweeps of it, weighted by the cosine, is
//!
//! ```text
//! (E / pi)'   =  sum over edges of (L_left - L_right) f',     f'  = c / pi  integral of (n . r) / |r|^4
//! (E / pi)''  =  sum over edges of (L_left - L_right) f'',    f'' = 2 / pi  (c m + m c),   m = integral of (n . r) r / |r|^6
//! ```
//!
//! with r = r0 + t (r1 - r0) and c = r0 x r1, tangential parts of both, t from 0 to 1. f'' is the symmetric part of the
//! derivative of f': in a sum around a polygon the rest cancels. Lambert's sum over edges has the same derivatives
//! around a polygon, but not edge by edge: its terms at the ends of edges cancel only if all edges that meet there move
//! as one, which they do not where a near texel adjoins a far one, nor on the horizon. Here edges on the horizon give
//! nothing, as n . r is 0.
//!
//! The vector irradiance is half the sum of the edges' angles times their unit normals; its tangential part is the
//! derivative by turning.
//!
//! # Source
//!
//! Ward and Heckbert 1992 for the nearer surface; Schwarzhaupt et al. 2012 for the Hessian by edges. They span
//! triangles between the points that rays met, whose mesh ends before the horizon and makes what hides smaller by half
//! a texel; here the edges are those of the texels themselves, or of blocks of them. Their closed forms lose digits
//! where an edge is short, which all edges of texels are: three points of Gauss' quadrature have an error of the order
//! of the sixth power of the edge's angle.

use std::f32::consts::{FRAC_1_PI, TAU};

use glam::{Vec2, Vec3, Vec3A};
use radcache::Samples;

use super::hessian::Symmetric;
use crate::sky::luminance;

/// First derivatives of the mean radiance over the cosine-weighted hemisphere, by two tangents.
pub(crate) type Gradient = [Vec3; 2];

/// Derivatives of the mean radiance over the cosine-weighted hemisphere (irradiance / pi), in the frame of the gather.
/// Of what stands at a distance, and of the soft sky.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Derivatives {
    /// By moving in the tangent plane, per metre.
    pub(crate) translation: [Gradient; 2],
    /// By the tangential part of another unit normal.
    pub(crate) rotation: [Gradient; 2],
    /// Second derivatives by moving, of the luminance of both, per square metre.
    pub(crate) hessian: Symmetric,
}

/// The edges between the texels of a gather, or between blocks of them.
#[derive(Debug)]
pub(crate) struct TexelEdges {
    n: usize,
    /// Texels along a side of a block.
    step: usize,
    edges: Vec<Edge>,
}

/// The edge between two blocks: as seen from outside the hemisphere, the first lies at the left.
#[derive(Debug)]
struct Edge {
    blocks: [u32; 2],
    ends: [Vec3A; 2],
    /// The tangential part of its vector irradiance, divided by pi.
    circle: Vec2,
}

impl TexelEdges {
    /// The edges of gathers of `n x n` texels, between blocks of `step x step` of them.
    pub(crate) fn new(n: usize, step: usize) -> Self {
        let side = n.div_ceil(step);
        let place = |i: usize| (i * step).min(n) as f32 / n as f32;
        let corner = |i: usize, j: usize| hemimap::square_to_cosine_hemisphere(Vec2::new(place(i), place(j)));
        let block = |i: usize, j: usize| u32::try_from(j * side + i).expect("at most 64 x 64 texels");
        let mut edges = Vec::with_capacity(2 * side * (side - 1));
        for j in 0..side {
            for i in 0..side {
                if i + 1 < side {
                    edges.push(Edge::new([block(i, j), block(i + 1, j)], [corner(i + 1, j), corner(i + 1, j + 1)]));
                }
                if j + 1 < side {
                    edges.push(Edge::new([block(i, j), block(i, j + 1)], [corner(i + 1, j + 1), corner(i, j + 1)]));
                }
            }
        }
        Self { n, step, edges }
    }

    /// Texels along a side.
    pub(crate) fn resolution(&self) -> usize {
        self.n
    }

    /// The derivatives of the light of a gather, whose rays have the given `directions`. What is nearer than `nearest`
    /// metres, above 0, counts as if it were there: its derivatives have no bound otherwise.
    ///
    /// # Panics
    /// If the gather has another resolution.
    pub(crate) fn derivatives(&self, samples: &Samples, directions: &[Vec3A], nearest: f32) -> Derivatives {
        assert_eq!(samples.resolution(), self.n, "edges of this resolution");
        let blocks = self.blocks(samples);
        let mut sum = Derivatives::default();
        for edge in &self.edges {
            let [left, right] = edge.blocks.map(|block| blocks[block as usize]);
            let difference = [left.parts[0] - right.parts[0], left.parts[1] - right.parts[1]];
            if difference == [Vec3::ZERO; 2] {
                continue;
            }
            for (rotation, difference) in sum.rotation.iter_mut().zip(difference) {
                add(rotation, edge.circle, difference);
            }
            let [left, right] = [left.nearest, right.nearest];
            let nearer = if samples.distance[left] <= samples.distance[right] { left } else { right };
            let distance = samples.distance[nearer];
            if distance.is_infinite() {
                continue;
            }
            // In units of the distance, so that no power of it leaves the range of f32.
            let [r0, r1] = edge.on_plane(directions[nearer], samples.normal[nearer].into());
            let (gradient, hessian) = edge_derivatives(r0, r1);
            let unit = 1.0 / distance.max(nearest);
            for (translation, difference) in sum.translation.iter_mut().zip(difference) {
                add(translation, gradient * unit, difference);
            }
            sum.hessian += hessian.scaled(unit * unit * luminance(difference[0] + difference[1]));
        }
        sum
    }

    /// The blocks of a gather, row by row.
    fn blocks(&self, samples: &Samples) -> Vec<Block> {
        let Self { n, step, .. } = *self;
        let starts = || (0..n).step_by(step);
        let corners = starts().flat_map(|j| starts().map(move |i| (i, j)));
        corners
            .map(|(i, j)| {
                let rows = j..n.min(j + step);
                let texels = rows.flat_map(|y| y * n + i..y * n + n.min(i + step));
                let mut block = Block { parts: [Vec3::ZERO; 2], nearest: j * n + i };
                let mut count = 0.0;
                for texel in texels {
                    let (radiance, share) = (samples.radiance[texel], samples.background_share[texel]);
                    block.parts[0] += radiance * (1.0 - share);
                    block.parts[1] += radiance * share;
                    count += 1.0;
                    if samples.distance[texel] < samples.distance[block.nearest] {
                        block.nearest = texel;
                    }
                }
                block.parts = block.parts.map(|part| part / count);
                block
            })
            .collect()
    }
}

/// What edges know of the texels on one side of them.
#[derive(Debug, Clone, Copy)]
struct Block {
    /// Mean radiance of what stands at a distance, and of the soft sky.
    parts: [Vec3; 2],
    /// The texel whose hit the edges lie on, if that is the nearer one of both sides.
    nearest: usize,
}

impl Edge {
    fn new(blocks: [u32; 2], ends: [Vec3A; 2]) -> Self {
        let normal = ends[0].cross(ends[1]);
        let angle = normal.length().atan2(ends[0].dot(ends[1]));
        let vector = normal.normalize() * (angle / TAU);
        Self { blocks, ends, circle: vector.truncate() }
    }

    /// The ends of the edge on the plane through the unit direction `wi` with the given normal.
    fn on_plane(&self, wi: Vec3A, normal: Vec3A) -> [Vec3A; 2] {
        /// A plane seen at a grazing angle, or one that does not go on so far, puts the ends no farther off than this.
        const MOST: f32 = 2.0;
        let height = wi.dot(normal);
        self.ends.map(|end| {
            let share = height / end.dot(normal);
            // Written so that 0 / 0 takes the sphere, and an end beyond the plane's horizon the farthest place.
            let distance = if share > 0.0 {
                share.clamp(1.0 / MOST, MOST)
            } else if share < 0.0 {
                MOST
            } else {
                1.0
            };
            end * distance
        })
    }
}

/// Adds the outer product of a derivative and a difference of radiances.
fn add(gradient: &mut Gradient, derivative: Vec2, difference: Vec3) {
    gradient[0] += derivative.x * difference;
    gradient[1] += derivative.y * difference;
}

/// First and second derivative, f' and f'', by the place in the tangent plane from which the edge from `r0` to `r1` is
/// seen.
fn edge_derivatives(r0: Vec3A, r1: Vec3A) -> (Vec2, Symmetric) {
    /// Places and weights of Gauss' quadrature on [0, 1]: half of 1 -+ sqrt(3/5), and 5/18, 8/18.
    const GAUSS: [(f32, f32); 3] = [(0.112_701_67, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_33, 5.0 / 18.0)];
    let swept = r0.cross(r1).truncate() * FRAC_1_PI;
    let (mut first, mut second) = (0.0, Vec2::ZERO);
    for (t, weight) in GAUSS {
        let r = r0.lerp(r1, t);
        let inv = 1.0 / r.length_squared();
        let of_first = weight * r.z * inv * inv;
        first += of_first;
        second += of_first * inv * r.truncate();
    }
    (swept * first, Symmetric::mixed(swept, second).scaled(2.0))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI as PI64;

    use glam::{DMat2, DVec2, DVec3};

    use super::*;

    /// A square at height 1, counter-clockwise seen from above, off the middle so that no derivative is 0 by symmetry.
    const SQUARE: [DVec3; 4] =
        [DVec3::new(0.1, -0.4, 1.0), DVec3::new(1.3, -0.4, 1.0), DVec3::new(1.3, 0.5, 1.0), DVec3::new(0.1, 0.5, 1.0)];

    /// Lambert's formula for the square, divided by pi.
    fn form_factor(p: DVec3, n: DVec3) -> f64 {
        let corners = SQUARE.map(|corner| (corner - p).normalize());
        let sum: f64 = (0..4)
            .map(|i| {
                let (a, b) = (corners[i], corners[(i + 1) % 4]);
                n.dot(a.cross(b).normalize()) * a.dot(b).acos()
            })
            .sum();
        sum / (2.0 * PI64)
    }

    fn at(x: f64, y: f64) -> f64 {
        form_factor(DVec3::new(x, y, 0.0), DVec3::Z)
    }

    /// Gradient and Hessian of a function by central differences at 0, with a step of 1e-3: error 1e-6.
    fn differences(f: impl Fn(f64, f64) -> f64) -> (DVec2, DMat2) {
        let h = 1e-3;
        let gradient = DVec2::new(f(h, 0.0) - f(-h, 0.0), f(0.0, h) - f(0.0, -h)) / (2.0 * h);
        let mixed = (f(h, h) - f(h, -h) - f(-h, h) + f(-h, -h)) / 4.0;
        let (xx, yy) = (f(h, 0.0) - 2.0 * f(0.0, 0.0) + f(-h, 0.0), f(0.0, h) - 2.0 * f(0.0, 0.0) + f(0.0, -h));
        (gradient, DMat2::from_cols_array(&[xx, mixed, mixed, yy]) / (h * h))
    }

    fn matrix(symmetric: Symmetric) -> DMat2 {
        let Symmetric { xx, xy, yy } = symmetric;
        DMat2::from_cols_array(&[xx, xy, xy, yy].map(f64::from))
    }

    fn assert_matrix(found: Symmetric, expected: DMat2, tolerance: f64) {
        let off = (matrix(found) - expected).to_cols_array().into_iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        assert!(off < tolerance, "{found:?} is off by {off} from {expected}");
    }

    /// What a point in the plane z = 0 sees: the first part of a gradient, and the Hessian.
    fn seen(n: usize, look: impl FnMut(Vec3A) -> (Vec3, f32, Vec3A)) -> Derivatives {
        let samples = Samples::from_fn(n, look);
        TexelEdges::new(n, 1).derivatives(&samples, &samples.directions(), 1e-6)
    }

    fn reds(gradient: Gradient) -> DVec2 {
        DVec2::new(gradient[0].x.into(), gradient[1].x.into())
    }

    fn is_in_square(wi: Vec3A) -> bool {
        let place = wi / wi.z;
        (0.1..1.3).contains(&place.x) && (-0.4..0.5).contains(&place.y)
    }

    #[test]
    fn derivatives_of_edges_are_those_of_lamberts_formula() {
        let (expected, curved) = differences(at);
        let (mut gradient, mut hessian) = (Vec2::ZERO, Symmetric::default());
        // In pieces of some 5 degrees, as texels have them.
        for side in 0..4 {
            let (a, b) = (SQUARE[side], SQUARE[(side + 1) % 4]);
            let place = |i: i32| a.lerp(b, f64::from(i) / 10.0).as_vec3a();
            for i in 0..10 {
                let (first, second) = edge_derivatives(place(i), place(i + 1));
                gradient += first;
                hessian += second;
            }
        }
        assert!((gradient.as_dvec2() - expected).length() < 1e-5, "{gradient} instead of {expected}");
        assert_matrix(hessian, curved, 1e-5);
    }

    #[test]
    fn lamp_has_the_derivatives_of_its_form_factor() {
        let lamp = |wi: Vec3A| {
            if is_in_square(wi) { (Vec3::ONE, 1.0 / wi.z, Vec3A::NEG_Z) } else { (Vec3::ZERO, f32::INFINITY, -wi) }
        };
        let found = seen(64, lamp);
        let (gradient, curved) = differences(at);
        // The lamp's rim is made of texels of 1/64: a few of them are half in and half out.
        let off = (reds(found.translation[0]) - gradient).length();
        assert!(off < 0.02 * gradient.length(), "{} instead of {gradient}", reds(found.translation[0]));
        assert_matrix(found.hessian, curved, 0.02 * curved.col(1).length());
        let turn = differences(|x, y| form_factor(DVec3::ZERO, DVec3::new(x, y, 1.0))).0;
        let off = (reds(found.rotation[0]) - turn).length();
        assert!(off < 0.02 * turn.length(), "{} instead of {turn}", reds(found.rotation[0]));
    }

    #[test]
    fn occluder_moves_and_not_what_it_hides() {
        // A black square under a white ceiling at height 3: E / pi is 1 less its form factor. If the edges were on the
        // ceiling, the gradient would be a third of it.
        let hidden = |wi: Vec3A| {
            if is_in_square(wi) {
                (Vec3::ZERO, 1.0 / wi.z, Vec3A::NEG_Z)
            } else {
                (Vec3::ONE, 3.0 / wi.z, Vec3A::NEG_Z)
            }
        };
        let found = seen(64, hidden);
        let (gradient, curved) = differences(|x, y| 1.0 - at(x, y));
        let off = (reds(found.translation[0]) - gradient).length();
        assert!(off < 0.02 * gradient.length(), "{} instead of {gradient}", reds(found.translation[0]));
        assert_matrix(found.hessian, curved, 0.02 * curved.col(1).length());
    }

    #[test]
    fn smooth_light_on_a_ceiling_has_its_derivatives() {
        // A ceiling at height 1 with L = exp(-|q - c|^2), summed over its square of half width 4.5 in steps of 0.05, by
        // the rule of middles: beyond is less than 1e-6 of the light, and a smooth function that vanishes at the border
        // leaves no error of the rule.
        let centre = DVec2::new(0.4, -0.2);
        let radiance = |q: DVec2| (-(q - centre).length_squared()).exp();
        let mean = |x: f64, y: f64| {
            let places = (0..180).flat_map(|i| (0..180).map(move |j| DVec2::new(f64::from(i), f64::from(j))));
            let sum = places.map(|place| {
                let q = (place - 89.5) * 0.05;
                let distance_sq = 1.0 + (q - DVec2::new(x, y)).length_squared();
                radiance(q) / (PI64 * distance_sq * distance_sq) * 0.05 * 0.05
            });
            sum.sum::<f64>()
        };
        let found = seen(32, |wi| {
            let q = (wi / wi.z).truncate().as_dvec2();
            (DVec3::splat(radiance(q)).as_vec3(), 1.0 / wi.z, Vec3A::NEG_Z)
        });
        let (gradient, curved) = differences(mean);
        let off = (reds(found.translation[0]) - gradient).length();
        // Steps between texels in place of a slope: an error of second order in 1/32, times the light's own curvature.
        assert!(off < 0.01 * gradient.length(), "{} instead of {gradient}", reds(found.translation[0]));
        assert_matrix(found.hessian, curved, 0.02 * curved.col(0).length());
    }

    #[test]
    fn blocks_of_texels_have_nearly_the_same_derivatives() {
        // The light on the ceiling and a black square under it, at 36 x 36 texels as a reprojected point has them, and
        // 37 that no block divides.
        let look = |wi: Vec3A| {
            let q = (wi / wi.z).truncate();
            if is_in_square(wi) {
                (Vec3::ZERO, 1.0 / wi.z, Vec3A::NEG_Z)
            } else {
                (Vec3::splat((-0.1 * q.length_squared()).exp()), 3.0 / wi.z, Vec3A::NEG_Z)
            }
        };
        for n in [36, 37] {
            let samples = Samples::from_fn(n, look);
            let [fine, coarse] =
                [1, 2].map(|step| TexelEdges::new(n, step).derivatives(&samples, &samples.directions(), 1e-6));
            let [of_fine, of_coarse] = [fine, coarse].map(|found| reds(found.translation[0]));
            assert!((of_fine - of_coarse).length() < 0.05 * of_fine.length(), "{n}: {of_fine}, {of_coarse}");
            let off = (matrix(fine.hessian) - matrix(coarse.hessian)).to_cols_array().map(f64::abs);
            let size = matrix(fine.hessian).to_cols_array().map(f64::abs);
            assert!(
                off.iter().sum::<f64>() < 0.1 * size.iter().sum::<f64>(),
                "{n}: {:?}, {:?}",
                fine.hessian,
                coarse.hessian
            );
        }
    }

    #[test]
    fn nothing_changes_where_all_is_alike() {
        let found = seen(16, |wi| (Vec3::new(0.5, 1.0, 2.0), 0.1 + wi.x * wi.x, -wi));
        assert_eq!(found, Derivatives::default(), "a furnace");
    }

    #[test]
    fn sky_moves_with_the_frame_that_shows_it() {
        // A hole in a black roof, with the sky behind: the edges are those of the roof, also where a texel at the rim
        // shows both.
        let n = 64;
        let mut window = Samples::from_fn(n, |wi| {
            if is_in_square(wi) { (Vec3::ONE, f32::INFINITY, -wi) } else { (Vec3::ZERO, 1.0 / wi.z, Vec3A::NEG_Z) }
        });
        let (gradient, _) = differences(at);
        let derivatives = |samples: &Samples| TexelEdges::new(n, 1).derivatives(samples, &samples.directions(), 1e-6);
        let sharp = derivatives(&window).translation;
        assert_eq!(sharp[0], [Vec3::ZERO; 2], "none of it stands at a distance");
        assert!((reds(sharp[1]) - gradient).length() < 0.02 * gradient.length(), "{:?}", sharp[1]);
        // The rim as several rays a texel find it: half of its light, all of that from infinity, and the roof before
        // it.
        let is_sky: Vec<bool> = window.distance.iter().map(|d| d.is_infinite()).collect();
        for texel in n..n * n - n {
            if is_sky[texel] && !(is_sky[texel + 1] && is_sky[texel - 1] && is_sky[texel + n] && is_sky[texel - n]) {
                window.set(texel, Vec3::splat(0.5), 1.0 / window.direction(texel).z, Vec3A::NEG_Z);
                window.background_share[texel] = 1.0;
            }
        }
        let soft = derivatives(&window).translation;
        let sum = reds(soft[0]) + reds(soft[1]);
        // Half a texel of 64 less on each side of a hole of some 20 texels.
        assert!((sum - gradient).length() < 0.08 * gradient.length(), "{sum} instead of {gradient}");
    }
}
