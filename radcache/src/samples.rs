//! What a gather brings home: n x n texels of radiance, distance and normal over the hemisphere.

use glam::{Vec2, Vec3, Vec3A};
use serde::Serialize;

/// The largest resolution of a record: a row of a bit mask is one machine word.
pub const MAX_RESOLUTION: usize = 64;

/// `n x n` samples of incident radiance, texel `(i, j)` at index `j * n + i`; u runs with i, v with j.
///
/// Directions and normals are in the frame of the record, z along its normal. A texel covers the square `[i, i+1) x [j,
/// j+1)` divided by n, of solid angle pi / (n^2 cos theta): the map preserves area, so the plain mean of `radiance` is
/// irradiance / pi.
///
/// Textures may be written texel by texel, without [`Self::set`]; then what is said of each is for the writer to keep,
/// and none may change its length. [`Record::new`](crate::Record::new) panics where a length or a distance is wrong.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Samples {
    pub(crate) n: u32,
    /// Where in its texel each ray went, in [0, 1) along u and v.
    pub(crate) jitter: Vec<Vec2>,
    /// Incident radiance, W m^-2 sr^-1; finite.
    pub radiance: Vec<Vec3>,
    /// Distance to the hit in metres; infinite for the surroundings, never negative or NaN.
    pub distance: Vec<f32>,
    /// Unit normal of the hit, turned to the record; any value where the distance is infinite.
    pub normal: Vec<Vec3>,
    /// Share of the radiance that comes from infinity, by the mean of the channels, in [0, 1]: 1 for the surroundings,
    /// 0 for what stands at a distance, and between for a texel of several rays at the rim of a window.
    pub background_share: Vec<f32>,
    /// Whether the radiance is that of this direction only, as a highlight is, so that another point must look for
    /// itself: the element then hides what is behind it, and is traced anew.
    pub view_dependent: Vec<bool>,
}

impl Samples {
    /// Black texels at infinity, to be filled by the caller; rays go through the centres of the texels.
    ///
    /// # Panics
    /// If `n` is 0 or above [`MAX_RESOLUTION`].
    #[must_use]
    pub fn new(n: usize) -> Self {
        assert!((1..=MAX_RESOLUTION).contains(&n), "resolution must lie in 1..=64");
        let count = n * n;
        Self {
            n: u32::try_from(n).expect("n <= 64"),
            jitter: vec![Vec2::splat(0.5); count],
            radiance: vec![Vec3::ZERO; count],
            background_share: vec![1.0; count],
            distance: vec![f32::INFINITY; count],
            normal: vec![Vec3::Z; count],
            view_dependent: vec![false; count],
        }
    }

    /// Evaluates `look(wi) -> (radiance, distance, normal)` through the centre of each texel, all in the frame of the
    /// record.
    ///
    /// # Panics
    /// As [`Self::new`].
    #[must_use]
    pub fn from_fn(n: usize, mut look: impl FnMut(Vec3A) -> (Vec3, f32, Vec3A)) -> Self {
        let mut samples = Self::new(n);
        for texel in 0..n * n {
            let (radiance, distance, normal) = look(samples.direction(texel));
            samples.set(texel, radiance, distance, normal);
        }
        samples
    }

    /// Moves the ray of a texel to `jitter` in [0, 1)^2 of the texel: [`Self::direction`] follows.
    pub fn set_jitter(&mut self, texel: usize, jitter: Vec2) {
        self.jitter[texel] = jitter;
    }

    /// Returns where the ray of a texel goes through it, in [0, 1)^2.
    #[must_use]
    pub fn jitter(&self, texel: usize) -> Vec2 {
        self.jitter[texel]
    }

    /// Stores what the ray of a texel met. A distance that is not a number counts as infinite, a negative one as zero.
    pub fn set(&mut self, texel: usize, radiance: Vec3, distance: f32, normal: Vec3A) {
        self.radiance[texel] = radiance;
        self.distance[texel] = if distance.is_nan() { f32::INFINITY } else { distance.max(0.0) };
        self.normal[texel] = normal.into();
        self.background_share[texel] = if self.distance[texel].is_infinite() { 1.0 } else { 0.0 };
    }

    /// Texels along a side.
    #[must_use]
    pub fn resolution(&self) -> usize {
        self.n as usize
    }

    /// Whether all textures are n x n.
    pub(crate) fn has_all_texels(&self) -> bool {
        let lengths = [
            self.jitter.len(),
            self.radiance.len(),
            self.distance.len(),
            self.normal.len(),
            self.background_share.len(),
            self.view_dependent.len(),
        ];
        lengths.into_iter().all(|length| length == self.resolution().pow(2))
    }

    /// The unit direction of a texel's ray, in the frame of the record.
    #[must_use]
    pub fn direction(&self, texel: usize) -> Vec3A {
        let n = self.n as usize;
        let corner = Vec2::new((texel % n) as f32, (texel / n) as f32);
        hemimap::square_to_cosine_hemisphere((corner + self.jitter[texel]) / n as f32)
    }

    /// [`Self::direction`] of all texels, in a fraction of the time.
    #[must_use]
    pub fn directions(&self) -> Vec<Vec3A> {
        let n = self.n as usize;
        let mut directions = Vec::with_capacity(n * n);
        let [mut u, mut v] = [[0.0; MAX_RESOLUTION]; 2];
        for (j, row) in self.jitter.chunks_exact(n).enumerate() {
            for (i, jitter) in row.iter().enumerate() {
                u[i] = (i as f32 + jitter.x) / n as f32;
                v[i] = (j as f32 + jitter.y) / n as f32;
            }
            append_directions(&mut directions, &u[..n], &v[..n]);
        }
        directions
    }

    /// The points that the texels' rays met, relative to the record, in its frame; the bare direction where that is
    /// infinitely far.
    #[must_use]
    pub fn points(&self) -> Vec<Vec3A> {
        let mut points = self.directions();
        for (point, distance) in points.iter_mut().zip(&self.distance) {
            *point *= if distance.is_finite() { *distance } else { 1.0 };
        }
        points
    }

    /// Mean of the texels: irradiance / pi.
    #[must_use]
    pub fn mean_radiance(&self) -> Vec3 {
        let sum: glam::DVec3 = self.radiance.iter().map(|l| l.as_dvec3()).sum();
        (sum / self.radiance.len() as f64).as_vec3()
    }

    /// [`Self::mean_radiance`] in two parts: what comes from a distance, and what comes from infinity.
    #[must_use]
    pub fn mean_radiance_by_distance(&self) -> [Vec3; 2] {
        let mut sum = [glam::DVec3::ZERO; 2];
        for (radiance, &share) in self.radiance.iter().zip(&self.background_share) {
            let far = radiance.as_dvec3() * f64::from(share);
            sum[0] += radiance.as_dvec3() - far;
            sum[1] += far;
        }
        sum.map(|part| (part / self.radiance.len() as f64).as_vec3())
    }

    /// Harmonic mean of the distances in metres, infinite if nothing is near; the directions are cosine-distributed.
    #[must_use]
    pub fn harmonic_distance(&self) -> f32 {
        let sum: f64 = self.distance.iter().map(|&d| 1.0 / f64::from(d.max(1e-30))).sum();
        #[expect(clippy::cast_possible_truncation, reason = "a distance of f32 range")]
        let mean = (self.distance.len() as f64 / sum) as f32;
        mean
    }

    /// The smallest distance of any texel, metres.
    #[must_use]
    pub fn nearest_distance(&self) -> f32 {
        self.distance.iter().copied().fold(f32::INFINITY, f32::min)
    }

    /// Share of the texels nearer than `limit` metres.
    #[must_use]
    pub fn share_nearer_than(&self, limit: f32) -> f32 {
        self.distance.iter().filter(|&&d| d < limit).count() as f32 / self.distance.len() as f32
    }
}

/// Appends the directions to a row of points of the square, at most one more than a side has texels.
pub(crate) fn append_directions(directions: &mut Vec<Vec3A>, u: &[f32], v: &[f32]) {
    let n = u.len();
    let [mut x, mut y, mut z] = [[0.0; MAX_RESOLUTION + 1]; 3];
    hemimap::square_to_cosine_hemisphere_slice(u, v, &mut x[..n], &mut y[..n], &mut z[..n]);
    directions.extend((0..n).map(|i| Vec3A::new(x[i], y[i], z[i])));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn harmonic_mean_distance_is_known() {
        // Under an infinite ceiling at height h: 1.5 h with cosine-distributed directions.
        let ceiling = Samples::from_fn(64, |wi| (Vec3::ONE, 1.0 / wi.z, Vec3A::NEG_Z));
        assert!((ceiling.harmonic_distance() - 1.5).abs() < 5e-3, "{}", ceiling.harmonic_distance());
        let sphere = Samples::from_fn(8, |wi| (Vec3::ONE, 3.0, -wi));
        assert!((sphere.harmonic_distance() - 3.0).abs() < 1e-6, "centre of a sphere");
        let sky = Samples::from_fn(8, |wi| (Vec3::ONE, f32::INFINITY, -wi));
        assert_eq!(sky.harmonic_distance(), f32::INFINITY, "open sky");
    }

    #[test]
    fn directions_are_those_of_single_texels() {
        let mut samples = Samples::new(7);
        samples.set_jitter(9, Vec2::new(0.1, 0.9));
        let directions = samples.directions();
        assert_eq!(directions.len(), 49, "all texels");
        for (texel, direction) in directions.into_iter().enumerate() {
            assert!(direction.abs_diff_eq(samples.direction(texel), 1e-6), "texel {texel}");
        }
    }

    #[test]
    fn odd_distances_are_made_sane() {
        let mut samples = Samples::new(2);
        samples.set(0, Vec3::ONE, f32::NAN, Vec3A::Z);
        samples.set(1, Vec3::ONE, -1.0, Vec3A::Z);
        assert_eq!(samples.distance[0], f32::INFINITY, "NaN is the surroundings");
        assert_eq!(samples.distance[1], 0.0, "negative is touching");
        assert!(samples.harmonic_distance() > 0.0, "never zero or NaN");
    }
}
