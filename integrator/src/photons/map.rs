//! Irradiance from photons of all ways of light: the flux of the nearest ones over the area on which they lie.
//!
//! ```text
//! E = sum of the flux of the k - 1 nearest photons that lie on this surface / (pi r^2)
//! ```
//! where r is the distance of the k-th nearest photon on any surface. Given r, the others are spread evenly inside, so
//! with k - 1 (not k) the estimate is unbiased where the irradiance does not change within r, whatever share of the
//! photons lies on other surfaces. Its relative deviation is 1 / sqrt(k - 2). r is limited; where fewer than k photons
//! lie within the limit, all of them count.
//!
//! # Source
//!
//! Henrik Wann Jensen, *Realistic Image Synthesis Using Photon Mapping*, 2001, chapter 7; the k - 1 is that of
//! Loftsgaarden and Quesenberry, *A Nonparametric Estimate of a Multivariate Density Function*, 1965.

use std::f32::consts::PI;
use std::num::NonZero;

use glam::{Vec3, Vec3A};
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use super::shoot::Photons;

/// Photons whose normals have a smaller cosine lie on another surface.
pub(super) const SAME_NORMAL: f32 = 0.9;
/// So do those farther from the tangent plane than this share of the search radius; a sphere of normals within
/// `SAME_NORMAL` stays within it.
pub(super) const SAME_PLANE: f32 = 0.25;
/// The limit of the search radius, in medians of the distance to the k-th photon: the density may fall to 1/16 before
/// photons get fewer.
const RADIUS_LIMIT: f32 = 4.0;
/// Distances from which the median is taken, at most.
const RADIUS_SAMPLES: usize = 512;

/// An irradiance estimated from photons.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Irradiance {
    /// W m^-2.
    pub irradiance: Vec3,
    /// The radius of the disc over which photons were counted, metres: what the estimate can resolve.
    pub radius: f32,
}

impl Irradiance {
    /// None, everywhere.
    pub(super) const DARK: Self = Self { irradiance: Vec3::ZERO, radius: f32::INFINITY };
}

/// Photons in a tree.
#[derive(Debug)]
pub(super) struct PhotonMap {
    photons: Photons,
    tree: ImmutableKdTree<f32, 3>,
    neighbours: usize,
    max_radius: f32,
}

impl PhotonMap {
    /// Builds the map of estimates by `neighbours` photons within `max_radius`, or within a limit taken from the
    /// photons' density. `None` where there is no photon.
    pub(super) fn new(photons: Photons, neighbours: u32, max_radius: Option<f32>) -> Option<Self> {
        let tree = tree(&photons.positions)?;
        let mut map = Self { photons, tree, neighbours: neighbours.max(2) as usize, max_radius: f32::INFINITY };
        map.max_radius = max_radius.unwrap_or_else(|| map.usual_radius() * RADIUS_LIMIT);
        Some(map)
    }

    pub(super) fn photons(&self) -> &Photons {
        &self.photons
    }

    /// Returns the irradiance at `p` on the side of the unit normal `n`; 0, with the limit as its radius, where no
    /// photon is near.
    pub(super) fn irradiance(&self, p: Vec3A, n: Vec3A) -> Irradiance {
        let near = nearest(&self.tree, p, self.neighbours, self.max_radius);
        // The search ends at the k-th photon, which then does not count itself, or at the limit.
        let (counted, radius_sq) = match near.split_last() {
            Some((last, others)) if near.len() == self.neighbours => (others, last.distance),
            _ => (near.as_slice(), self.max_radius * self.max_radius),
        };
        let radius = radius_sq.sqrt();
        let mut flux = Vec3::ZERO;
        for photon in counted {
            let index = photon.item as usize;
            let offset = Vec3A::from(self.photons.positions[index]) - p;
            let is_here = self.photons.normals[index].dot(n) > SAME_NORMAL && offset.dot(n).abs() < SAME_PLANE * radius;
            if is_here {
                flux += self.photons.flux[index];
            }
        }
        let area = PI * radius_sq;
        let irradiance = if area > 0.0 && area.is_finite() { flux / area } else { Vec3::ZERO };
        Irradiance { irradiance, radius }
    }

    /// Returns the median distance from a photon to the k-th next.
    fn usual_radius(&self) -> f32 {
        let count = self.photons.len();
        let step = count.div_ceil(RADIUS_SAMPLES);
        let mut distances: Vec<f32> = (0..count)
            .step_by(step)
            .filter_map(|index| {
                let p = Vec3A::from(self.photons.positions[index]);
                nearest(&self.tree, p, self.neighbours + 1, f32::INFINITY).last().map(|last| last.distance.sqrt())
            })
            .collect();
        distances.sort_by(f32::total_cmp);
        distances.get(distances.len() / 2).copied().unwrap_or(0.0)
    }
}

/// Irradiance at some of the photons, estimated beforehand: a lookup is a search for one point instead of many.
///
/// Each of these photons counts in its own estimate, which is then too high by 1 / k. But a place that by chance holds
/// few photons is far from the next of them, so low estimates serve larger cells than high ones: by area the mean is
/// too low by the variance of an estimate, which is 1 / k too. The two cancel (measured in a sphere, k = 50: 0.979
/// without the photon itself, 1.000 with it).
///
/// # Source
///
/// Per H. Christensen, *Faster Photon Map Global Illumination*, 1999.
#[derive(Debug)]
pub(super) struct IrradianceMap {
    positions: Vec<[f32; 3]>,
    normals: Vec<Vec3A>,
    estimates: Vec<Irradiance>,
    tree: ImmutableKdTree<f32, 3>,
}

/// Candidates of a lookup whose nearest point lies on another surface.
const CANDIDATES: usize = 16;

impl IrradianceMap {
    /// Builds the map of estimates at points with their normals; `None` where there are none.
    pub(super) fn new(points: Vec<(Vec3A, Vec3A, Irradiance)>) -> Option<Self> {
        let positions: Vec<[f32; 3]> = points.iter().map(|point| point.0.to_array()).collect();
        let tree = tree(&positions)?;
        let (normals, estimates) = points.into_iter().map(|(_, normal, estimate)| (normal, estimate)).unzip();
        Some(Self { positions, normals, estimates, tree })
    }

    pub(super) fn memory_bytes(&self) -> u64 {
        let point = size_of::<[f32; 3]>() + size_of::<Vec3A>() + size_of::<Irradiance>() + 2 * size_of::<[f32; 4]>();
        (self.positions.len() * point) as u64
    }

    /// Returns the estimate nearest to `p` that is of the same surface and whose disc holds `p`.
    pub(super) fn lookup(&self, p: Vec3A, n: Vec3A) -> Option<Irradiance> {
        let first = self.tree.query(&p.to_array()).nearest_one::<SquaredEuclidean<f32>>().execute();
        if let Some(estimate) = self.fitting(first.item, p, n) {
            return Some(estimate);
        }
        let near = nearest(&self.tree, p, CANDIDATES, f32::INFINITY);
        near.iter().find_map(|candidate| self.fitting(candidate.item, p, n))
    }

    fn fitting(&self, item: u32, p: Vec3A, n: Vec3A) -> Option<Irradiance> {
        let index = item as usize;
        let estimate = self.estimates[index];
        let offset = Vec3A::from(self.positions[index]) - p;
        let fits = self.normals[index].dot(n) > SAME_NORMAL
            && offset.dot(n).abs() < SAME_PLANE * estimate.radius
            && offset.length_squared() < estimate.radius * estimate.radius;
        fits.then_some(estimate)
    }
}

fn tree(positions: &[[f32; 3]]) -> Option<ImmutableKdTree<f32, 3>> {
    if positions.is_empty() {
        return None;
    }
    ImmutableKdTree::new_from_slice(positions).ok()
}

type Found = kiddo::QueryResultItem<(), u32, f32>;

/// Returns the nearest points by distance, which is squared.
fn nearest(tree: &ImmutableKdTree<f32, 3>, p: Vec3A, count: usize, radius: f32) -> Vec<Found> {
    let Some(count) = NonZero::new(count) else { return Vec::new() };
    let query = p.to_array();
    if radius.is_finite() {
        tree.query(&query).nearest_n::<SquaredEuclidean<f32>>(count).within(radius * radius).execute()
    } else {
        tree.query(&query).nearest_n::<SquaredEuclidean<f32>>(count).execute()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rng;

    /// What a disc of radius 1 keeps beside a straight edge at distance t, `1 - (acos t - t sqrt(1 - t^2)) / pi`, and
    /// t.
    const EDGE: [(f32, f32); 4] = [(0.0, 0.5), (0.25, 0.657_481), (0.5, 0.804_499), (0.75, 0.927_853)];

    const COUNT: u16 = 50_000;

    /// Returns photons on the floor [0, 1]^2 that make an irradiance of 1.
    fn floor() -> Photons {
        let mut rng = Rng::new(4, 0);
        let mut photons = Photons::default();
        for _ in 0..COUNT {
            photons.positions.push([rng.next_1d(), rng.next_1d(), 0.0]);
            photons.normals.push(Vec3A::Z);
            photons.flux.push(Vec3::splat(1.0 / f32::from(COUNT)));
        }
        photons
    }

    #[test]
    fn density_is_unbiased_inside() {
        // r is about sqrt(50 / (pi 50,000)) = 0.018: 24 x 24 points, 0.036 apart, are nearly independent.
        let map = PhotonMap::new(floor(), 50, None).unwrap();
        let deviation = 0.1443;
        let values: Vec<f32> = (0..576u16)
            .map(|i| {
                let (x, y) = (f32::from(i % 24), f32::from(i / 24));
                let p = Vec3A::new(0.08 + 0.036 * x, 0.08 + 0.036 * y, 0.0);
                map.irradiance(p, Vec3A::Z).irradiance.x
            })
            .collect();
        let mean = values.iter().sum::<f32>() / 576.0;
        let spread = (values.iter().map(|x| (x - mean).powi(2)).sum::<f32>() / 575.0).sqrt();
        // 4.5 of 0.1443 / 24, and of 1 / sqrt(2 * 575) for the deviation; k instead of k - 1 would be off by 3.3
        // deviations.
        assert!((mean - 1.0).abs() < 4.5 * deviation / 24.0, "mean {mean}");
        assert!((spread / deviation - 1.0).abs() < 0.135, "deviation {spread} for {deviation}");
    }

    #[test]
    fn edge_bias_is_known() {
        // More neighbours than there are photons: the limit 0.1 is the radius. Some 1,600 photons in a disc, several
        // discs.
        let map = PhotonMap::new(floor(), 1 << 20, Some(0.1)).unwrap();
        let mean = |x: f32| {
            let along = (0..16u8).map(|i| Vec3A::new(x, 0.15 + 0.045 * f32::from(i), 0.0));
            along.map(|p| map.irradiance(p, Vec3A::Z).irradiance.x).sum::<f32>() / 16.0
        };
        for (t, share) in EDGE {
            let found = mean(0.1 * t);
            assert!((found / share - 1.0).abs() < 0.05, "t = {t}: {found} instead of {share}");
        }
        let corner = map.irradiance(Vec3A::ZERO, Vec3A::Z).irradiance.x;
        // Some 390 photons: 5 %, 4.5 deviations.
        assert!((corner - 0.25).abs() < 0.06, "corner {corner}");
    }

    #[test]
    fn floor_takes_no_photons_of_the_wall() {
        let alone = PhotonMap::new(floor(), 1 << 20, Some(0.1)).unwrap();
        let mut photons = floor();
        let mut rng = Rng::new(5, 0);
        for _ in 0..COUNT {
            photons.positions.push([0.0, rng.next_1d(), rng.next_1d()]);
            photons.normals.push(Vec3A::X);
            photons.flux.push(Vec3::splat(1e3));
            // And another floor a little higher, whose normal is the same.
            photons.positions.push([rng.next_1d(), rng.next_1d(), 0.05]);
            photons.normals.push(Vec3A::Z);
            photons.flux.push(Vec3::splat(1e3));
        }
        let among = PhotonMap::new(photons, 1 << 20, Some(0.1)).unwrap();
        for x in [0.0, 0.01, 0.05, 0.3] {
            let p = Vec3A::new(x, 0.4, 0.0);
            let value = |map: &PhotonMap| map.irradiance(p, Vec3A::Z).irradiance.x;
            let (alone, among) = (value(&alone), value(&among));
            assert!((among / alone - 1.0).abs() < 1e-5, "x = {x}: {among} and alone {alone}");
        }
    }

    #[test]
    fn few_photons_count_over_the_limit() {
        for count in [1, 2, 49] {
            let mut photons = floor();
            photons.positions.truncate(count);
            photons.normals.truncate(count);
            photons.flux.truncate(count);
            photons.flux.fill(Vec3::ONE);
            let map = PhotonMap::new(photons, 50, Some(2.0)).unwrap();
            let found = map.irradiance(Vec3A::new(0.5, 0.5, 0.0), Vec3A::Z);
            let expected = count as f32 / (PI * 4.0);
            assert!((found.irradiance.x / expected - 1.0).abs() < 1e-5, "{count}: {found:?}");
        }
        assert!(PhotonMap::new(Photons::default(), 50, None).is_none(), "none at all");
    }

    #[test]
    fn coincident_photons_have_no_density() {
        let mut photons = floor();
        photons.positions.fill([0.5, 0.5, 0.0]);
        let map = PhotonMap::new(photons, 50, None).unwrap();
        let found = map.irradiance(Vec3A::new(0.5, 0.5, 0.0), Vec3A::Z);
        assert_eq!(found.irradiance, Vec3::ZERO, "a beam without width is not a number, nor infinite");
    }

    #[test]
    fn tree_agrees_with_brute_force_on_walls_and_lattices() {
        // Equal coordinates in masses broke the k-d tree's earlier versions.
        let mut rng = Rng::new(6, 0);
        let mut wall = |lattice: f32| -> Vec<[f32; 3]> {
            let mut coordinate = || (rng.next_1d() * lattice).round() / lattice;
            (0..5000).map(|_| [coordinate(), 0.25, coordinate()]).collect()
        };
        for positions in [wall(1e6), wall(20.0), wall(2.0)] {
            let tree = tree(&positions).unwrap();
            for i in 0..40u16 {
                let p = Vec3A::new(f32::from(i) / 40.0, 0.25, f32::from(i * 7 % 40) / 40.0);
                let mut all: Vec<f32> = positions.iter().map(|&q| (Vec3A::from(q) - p).length_squared()).collect();
                all.sort_by(f32::total_cmp);
                let found = nearest(&tree, p, 50, f32::INFINITY);
                assert_eq!(found.len(), 50, "as many as were asked for");
                for (found, expected) in found.iter().zip(all) {
                    assert!((found.distance - expected).abs() <= 1e-6 * expected.max(1e-6), "{found:?} {expected}");
                }
            }
        }
    }
}
