//! Irradiance from photons: the flux of the nearest ones over the area on which they lie.
//!
//! ```text
//! E = sum of the flux of the k - 1 nearest photons that lie on this surface / (pi r^2)
//! ```
//! where r is the distance of the k-th nearest photon on any surface. Given r, the others are spread evenly inside, so with k - 1 (not k)
//! the estimate is unbiased where the irradiance does not change within r, whatever share of the photons lies on other surfaces. Its relative
//! deviation is 1 / sqrt(k - 2). r is limited; where fewer than k photons lie within the limit, all of them count.
//!
//! # Source
//!
//! Henrik Wann Jensen, *Realistic Image Synthesis Using Photon Mapping*, 2001, chapter 7; the k - 1 is that of Loftsgaarden and Quesenberry,
//! *A Nonparametric Estimate of a Multivariate Density Function*, 1965.

use std::f32::consts::PI;
use std::num::NonZero;

use glam::{Vec3, Vec3A};
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use super::shoot::Photons;

/// Photons whose normals have a smaller cosine lie on another surface.
pub(super) const SAME_NORMAL: f32 = 0.9;
/// So do those farther from the tangent plane than this share of the search radius; a sphere of normals within `SAME_NORMAL` stays within it.
pub(super) const SAME_PLANE: f32 = 0.25;
/// The limit of the search radius, in medians of the distance to the k-th photon: the density may fall to 1/16 before photons get fewer.
const RADIUS_LIMIT: f32 = 4.0;
/// Distances from which the median is taken, at most.
const RADIUS_SAMPLES: usize = 512;

/// How photons inside the search radius count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kernel {
    /// All alike.
    Constant,
    /// By 2 (1 - d^2 / r^2) (Epanechnikov), which blurs less at equal noise where the irradiance changes.
    Epanechnikov,
}

/// An irradiance estimated from photons.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Irradiance {
    /// W m^-2.
    pub irradiance: Vec3,
    /// The radius of the disc over which photons were counted, metres: what the estimate can resolve.
    pub radius: f32,
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
    /// Builds the map of estimates by `neighbours` photons within `max_radius`, or within a limit taken from the photons' density.
    /// `None` where there is no photon.
    pub(super) fn new(photons: Photons, neighbours: u32, max_radius: Option<f32>) -> Option<Self> {
        let tree = tree(&photons.positions)?;
        let mut map = Self { photons, tree, neighbours: neighbours.max(2) as usize, max_radius: f32::INFINITY };
        map.max_radius = max_radius.unwrap_or_else(|| map.usual_radius() * RADIUS_LIMIT);
        Some(map)
    }

    pub(super) fn photons(&self) -> &Photons {
        &self.photons
    }

    pub(super) fn memory_bytes(&self) -> u64 {
        // The tree holds positions and indices once more.
        self.photons.memory_bytes() + (self.photons.len() * 2 * size_of::<[f32; 4]>()) as u64
    }

    /// Returns the irradiance at `p` on the side of the unit normal `n`; 0, with the limit as its radius, where no photon is near.
    /// A photon that is asked about itself names itself as `except` and does not count.
    pub(super) fn irradiance(&self, p: Vec3A, n: Vec3A, kernel: Kernel, except: Option<usize>) -> Irradiance {
        let wanted = self.neighbours + usize::from(except.is_some());
        let near = nearest(&self.tree, p, wanted, self.max_radius);
        // The search ends at the k-th photon, which then does not count itself, or at the limit.
        let (counted, radius_sq) = match near.split_last() {
            Some((last, others)) if near.len() == wanted => (others, last.distance),
            _ => (near.as_slice(), self.max_radius * self.max_radius),
        };
        let radius = radius_sq.sqrt();
        let mut flux = Vec3::ZERO;
        for photon in counted {
            let index = photon.item as usize;
            let offset = Vec3A::from(self.photons.positions[index]) - p;
            let is_here = self.photons.normals[index].dot(n) > SAME_NORMAL
                && offset.dot(n).abs() < SAME_PLANE * radius
                && except != Some(index);
            if is_here {
                let weight = match kernel {
                    Kernel::Constant => 1.0,
                    Kernel::Epanechnikov => 2.0 * (1.0 - photon.distance / radius_sq),
                };
                flux += self.photons.flux[index] * weight;
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
    pub(super) fn new(points: Vec<([f32; 3], Vec3A, Irradiance)>) -> Option<Self> {
        let positions: Vec<[f32; 3]> = points.iter().map(|point| point.0).collect();
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
