//! Irradiance by caustics: each photon spreads its flux over a disc of its own.
//!
//! ```text
//! E(p) = sum over photons i with |p - x_i| < r_i of  2 flux_i / (pi r_i^2) (1 - |p - x_i|^2 / r_i^2)
//! ```
//! where r_i is about the distance from x_i to the k-th photon next to it, so that discs are small in a focus and wide
//! where photons are few. No flux is lost or won, however the irradiance changes: all discs together hold what all
//! photons carry, but for what hangs over an edge, which is left to the caller. An estimate by the photons nearest to p
//! does not have this property: beside a focus its radius ends at the focus, and a pool's caustic was 2 % too bright in
//! the mean.
//!
//! # Source
//!
//! Ian S. Abramson, *On Bandwidth Variation in Kernel Estimates*, 1982, for a bandwidth by the square root of the
//! density, which in two dimensions is the distance to the k-th neighbour; the kernel is Epanechnikov's.

use std::f32::consts::PI;

use glam::{Vec3, Vec3A};

use super::discs::{Disc, LEAF, Node, Tree};
use super::map::{Irradiance, SAME_NORMAL, SAME_PLANE};
use super::shoot::Photons;

/// Something of each disc of a leaf.
type Lanes = [f32; LEAF];

/// Photons with their discs, in a tree over them.
#[derive(Debug)]
pub(super) struct CausticMap {
    leaves: Vec<Leaf>,
    nodes: Vec<Node>,
    /// Number of photons.
    len: usize,
}

/// The discs of a leaf, in lanes that are looked at together.
#[derive(Debug, Clone)]
struct Leaf {
    center: [Lanes; 3],
    normal: [Lanes; 3],
    /// Irradiance at the center, W m^-2.
    peak: [Lanes; 3],
    radius: Lanes,
    /// Infinite where there is no disc: a photon is missing, or its beam has no width.
    inverse_radius_sq: Lanes,
}

/// What leaves give to a point, lane by lane.
struct Sums {
    irradiance: [Lanes; 3],
    /// The greatest of the three of each disc, and that times its radius.
    most: Lanes,
    radius: Lanes,
    /// The least radius of those that are near.
    least: Lanes,
}

impl CausticMap {
    /// Builds the map of estimates by about `neighbours` photons within `max_radius`, or within a limit taken from the
    /// photons' density. `None` where there is no photon.
    pub(super) fn new(photons: &Photons, neighbours: u32, max_radius: Option<f32>) -> Option<Self> {
        let Tree { discs, nodes } = Tree::new(photons, neighbours, max_radius)?;
        Some(Self { leaves: discs.chunks(LEAF).map(Leaf::new).collect(), nodes, len: discs.len() })
    }

    pub(super) fn memory_bytes(&self) -> u64 {
        (self.leaves.len() * size_of::<Leaf>() + self.nodes.len() * size_of::<Node>()) as u64
    }

    /// Returns the photons, in the order of the tree.
    pub(super) fn into_photons(self) -> Photons {
        let mut photons = Photons::default();
        for leaf in self.leaves {
            for lane in 0..LEAF.min(self.len - photons.len()) {
                let [center, normal, peak] =
                    [&leaf.center, &leaf.normal, &leaf.peak].map(|axes| axes.map(|axis| axis[lane]));
                photons.positions.push(center);
                photons.normals.push(normal.into());
                photons.flux.push(Vec3::from(peak) / peak_by_flux(leaf.radius[lane]).unwrap_or(1.0));
            }
        }
        photons
    }

    /// Returns the irradiance at `p` on the side of the unit normal `n`, with the mean radius of the discs by what they
    /// give; 0 where there is none.
    pub(super) fn irradiance(&self, p: Vec3A, n: Vec3A) -> Irradiance {
        let sums = self.add_all::<false>(p, n, 0.0, 0.0);
        let most = sums.most.iter().sum::<f32>();
        let radius = if most > 0.0 { sums.radius.iter().sum::<f32>() / most } else { 0.0 };
        Irradiance { radius, ..sums.total() }
    }

    /// The same with the least radius of the discs that give light to any place of the surface up to `reach` from `p`,
    /// or one of at most `fine` if there is any; infinite where none does.
    pub(super) fn irradiance_and_detail(&self, p: Vec3A, n: Vec3A, reach: f32, fine: f32) -> Irradiance {
        self.add_all::<true>(p, n, reach, fine).total()
    }

    /// Adds up all discs; `DETAIL` asks for the least of those within `reach`, until one is as `fine`.
    fn add_all<const DETAIL: bool>(&self, p: Vec3A, n: Vec3A, mut reach: f32, fine: f32) -> Sums {
        let mut sums = Sums::default();
        let (p, n) = (Vec3::from(p), Vec3::from(n));
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            if !(p.cmpge(node.min - reach) & p.cmple(node.max + reach)).all() {
                at += node.size as usize;
                continue;
            }
            at += 1;
            if node.size == 1 {
                self.leaves[node.leaf as usize].add::<DETAIL>(p, n, reach, &mut sums);
                if DETAIL && reach > 0.0 && sums.least.iter().any(|least| *least <= fine) {
                    reach = 0.0;
                }
            }
        }
        sums
    }
}

impl Default for Sums {
    fn default() -> Self {
        Self { irradiance: [[0.0; LEAF]; 3], most: [0.0; LEAF], radius: [0.0; LEAF], least: [f32::INFINITY; LEAF] }
    }
}

impl Sums {
    /// The irradiance, and the least radius.
    fn total(&self) -> Irradiance {
        Irradiance {
            irradiance: self.irradiance.each_ref().map(|lanes| lanes.iter().sum::<f32>()).into(),
            radius: self.least.iter().copied().fold(f32::INFINITY, f32::min),
        }
    }
}

impl Leaf {
    fn new(discs: &[Disc]) -> Self {
        let mut leaf = Self {
            center: [[0.0; LEAF]; 3],
            normal: [[0.0; LEAF]; 3],
            peak: [[0.0; LEAF]; 3],
            radius: [0.0; LEAF],
            inverse_radius_sq: [f32::INFINITY; LEAF],
        };
        for (lane, disc) in discs.iter().enumerate() {
            let scale = peak_by_flux(disc.radius);
            let peak = disc.flux * scale.unwrap_or(1.0);
            for axis in 0..3 {
                leaf.center[axis][lane] = disc.center[axis];
                leaf.normal[axis][lane] = disc.normal[axis];
                leaf.peak[axis][lane] = peak[axis];
            }
            leaf.radius[lane] = disc.radius;
            if scale.is_some() {
                leaf.inverse_radius_sq[lane] = 1.0 / (disc.radius * disc.radius);
            }
        }
        leaf
    }

    /// Adds what the discs give to `p`.
    #[inline]
    #[expect(clippy::needless_range_loop, reason = "one index for many arrays")]
    fn add<const DETAIL: bool>(&self, p: Vec3, n: Vec3, reach: f32, sums: &mut Sums) {
        let Self { center: [cx, cy, cz], normal: [nx, ny, nz], peak, radius, inverse_radius_sq } = self;
        for lane in 0..LEAF {
            let (x, y, z) = (p.x - cx[lane], p.y - cy[lane], p.z - cz[lane]);
            let distance_sq = x * x + y * y + z * z;
            let share = 1.0 - distance_sq * inverse_radius_sq[lane];
            let cosine = n.x * nx[lane] + n.y * ny[lane] + n.z * nz[lane];
            let height = (n.x * x + n.y * y + n.z * z).abs();
            // Not for what is not a number either.
            let is_here = (share > 0.0) & (cosine > SAME_NORMAL) & (height < SAME_PLANE * radius[lane]);
            let share = if is_here { share } else { 0.0 };
            let part = [peak[0][lane] * share, peak[1][lane] * share, peak[2][lane] * share];
            for axis in 0..3 {
                sums.irradiance[axis][lane] += part[axis];
            }
            if DETAIL {
                let (radius, within) = (radius[lane], radius[lane] + reach);
                let is_near = (distance_sq < within * within) & (cosine > SAME_NORMAL) & (radius < sums.least[lane]);
                sums.least[lane] = if is_near { radius } else { sums.least[lane] };
                continue;
            }
            let red_green = if part[0] > part[1] { part[0] } else { part[1] };
            let most = if red_green > part[2] { red_green } else { part[2] };
            sums.most[lane] += most;
            sums.radius[lane] += most * radius[lane];
        }
    }
}

/// Irradiance at the center of a disc with a flux of 1; `None` where a beam has no width, and so no irradiance.
fn peak_by_flux(radius: f32) -> Option<f32> {
    /// No flux makes more than a number of that.
    const MOST: f32 = 1e30;
    let peak = 2.0 / (PI * radius * radius);
    (peak < MOST).then_some(peak)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rng;

    /// Photons on the plane z = 0, each of the same flux, 1 W in all.
    fn photons(positions: Vec<[f32; 3]>) -> Photons {
        let flux = Vec3::splat(1.0 / positions.len() as f32);
        Photons { normals: vec![Vec3A::Z; positions.len()], flux: vec![flux; positions.len()], positions }
    }

    /// A wide square and, of the same flux, a focus a thousandth as wide and a line in it.
    fn focused() -> Photons {
        let mut rng = Rng::new(8, 0);
        let mut u = || rng.next_1d() - 0.5;
        photons(
            (0..60_000)
                .map(|i| match i % 3 {
                    0 => [u(), u(), 0.0],
                    1 => [1e-3 * u(), 1e-3 * u(), 0.0],
                    _ => [u(), 0.2 + 1e-4 * u(), 0.0],
                })
                .collect(),
        )
    }

    /// Flux on the square of side 2 around the origin by a jittered grid that is finer in the focus and on the line.
    fn integral(irradiance: impl Fn(Vec3A) -> f32 + Sync) -> f64 {
        // Intervals that divide -1 to 1 and how many points each has.
        let across = [(-1.0, -0.01, 200), (-0.01, 0.01, 400), (0.01, 1.0, 200)];
        let along = [(-1.0, -0.01, 200), (-0.01, 0.01, 400), (0.01, 0.19, 60), (0.19, 0.21, 400), (0.21, 1.0, 160)];
        let mut rng = Rng::new(9, 0);
        let mut sum = 0.0;
        for (x0, x1, nx) in across {
            for (y0, y1, ny) in along {
                let (dx, dy) = ((x1 - x0) / nx as f32, (y1 - y0) / ny as f32);
                for i in 0..nx * ny {
                    let x = x0 + dx * ((i % nx) as f32 + rng.next_1d());
                    let y = y0 + dy * ((i / nx) as f32 + rng.next_1d());
                    sum += f64::from(irradiance(Vec3A::new(x, y, 0.0)) * dx * dy);
                }
            }
        }
        sum
    }

    #[test]
    fn a_focus_neither_gains_nor_loses_light() {
        let photons = focused();
        let map = CausticMap::new(&photons, 80, None).unwrap();
        let found = integral(|p| map.irradiance(p, Vec3A::Z).irradiance.x);
        // The grid is good to half a percent. An estimate by the nearest 80 photons has far more.
        assert!((found - 1.0).abs() < 0.015, "{found} of 1 W");
        let focus = map.irradiance(Vec3A::ZERO, Vec3A::Z).irradiance.x;
        assert!((focus / (1e6 / 3.0) - 1.0).abs() < 0.3, "{focus} in the focus");
        // No sparse photon beside it has a disc of its size: such a speck would be as bright as the focus.
        let tree = Tree::new(&photons, 80, None).unwrap();
        let beside = tree.discs.iter().filter(|disc| disc.center.length() > 0.01 && disc.center.y < 0.15);
        let brightest = beside.map(|disc| disc.flux.x * peak_by_flux(disc.radius).unwrap()).fold(0.0, f32::max);
        assert!(brightest < 1.0, "{brightest} where the irradiance is 1/3");
    }

    #[test]
    fn even_light_has_the_noise_of_its_photons() {
        let mut rng = Rng::new(4, 0);
        let photons = photons((0..50_000).map(|_| [rng.next_1d(), rng.next_1d(), 0.0]).collect());
        for neighbours in [50u16, 400] {
            let map = CausticMap::new(&photons, u32::from(neighbours), None).unwrap();
            let values: Vec<f32> = (0..400u16)
                .map(|i| {
                    let p = Vec3A::new(0.1 + 0.042 * f32::from(i % 20), 0.1 + 0.042 * f32::from(i / 20), 0.0);
                    map.irradiance(p, Vec3A::Z).irradiance.x
                })
                .collect();
            let mean = values.iter().sum::<f32>() / 400.0;
            let spread = (values.iter().map(|x| (x - mean).powi(2)).sum::<f32>() / 399.0).sqrt();
            // By Epanechnikov's kernel, for discs of one size; the mean is good to a twentieth of that.
            let expected = (4.0 / 3.0 / f32::from(neighbours)).sqrt();
            assert!((mean - 1.0).abs() < 4.5 * expected / 20.0, "mean {mean} by {neighbours}");
            assert!((0.8..1.3).contains(&(spread / expected)), "deviation {spread} by {neighbours}");
        }
    }

    #[test]
    fn tree_agrees_with_the_sum_over_all_discs() {
        for count in [1, 7, 8, 9, 100, 1000] {
            let photons = photons(focused().positions[..count].to_vec());
            let map = CausticMap::new(&photons, 20, Some(0.3)).unwrap();
            let tree = Tree::new(&photons, 20, Some(0.3)).unwrap();
            let mut rng = Rng::new(10, 0);
            for _ in 0..200 {
                let p = Vec3A::new(1.2 * rng.next_1d() - 0.6, 1.2 * rng.next_1d() - 0.6, 0.0);
                let near = |disc: &&Disc| disc.center.distance(p) < disc.radius;
                let part = |disc: &Disc| {
                    let share = 1.0 - (disc.center.distance(p) / disc.radius).powi(2);
                    disc.flux.x * share * peak_by_flux(disc.radius).unwrap()
                };
                let all: f32 = tree.discs.iter().filter(near).map(part).sum();
                let found = map.irradiance(p, Vec3A::Z).irradiance.x;
                assert!((found - all).abs() <= 1e-4 * all, "{count} photons: {found}, {all}");
            }
            assert_eq!(map.irradiance(Vec3A::ZERO, Vec3A::NEG_Z).irradiance, Vec3::ZERO, "the other side");
        }
    }

    #[test]
    fn the_search_for_detail_ends_where_it_is_fine_enough() {
        let photons = focused();
        let map = CausticMap::new(&photons, 80, None).unwrap();
        let tree = Tree::new(&photons, 80, None).unwrap();
        // Beside the focus and the line, so that both are within some of the reaches.
        let p = Vec3A::new(0.02, 0.1, 0.0);
        let mut ended_early = false;
        for reach in [0.0, 0.01, 0.15, 1.0] {
            let within = tree.discs.iter().filter(|disc| disc.center.distance(p) < disc.radius + reach);
            let least = within.map(|disc| disc.radius).fold(f32::INFINITY, f32::min);
            for fine in [0.0, 0.5 * least, 2.0 * least, 1e3 * least] {
                let found = map.irradiance_and_detail(p, Vec3A::Z, reach, fine);
                assert_eq!(found.irradiance, map.irradiance(p, Vec3A::Z).irradiance, "reach {reach}, fine {fine}");
                let is_right = if fine < least { found.radius == least } else { found.radius <= fine };
                assert!(is_right, "{} for a least radius of {least}, reach {reach}, fine {fine}", found.radius);
                ended_early |= found.radius > least;
            }
        }
        assert!(ended_early, "not all of them were looked at");
    }

    #[test]
    fn photons_are_given_back() {
        let mut photons = photons(focused().positions[..1003].to_vec());
        // Beams without width too.
        photons.positions[..200].fill([0.5, 0.25, 0.0]);
        for (i, flux) in (0u16..).zip(&mut photons.flux) {
            *flux *= 1.0 + f32::from(i);
        }
        let sorted = |photons: &Photons| {
            let mut all: Vec<_> = photons.positions.iter().zip(&photons.flux).map(|(p, flux)| (flux.x, *p)).collect();
            all.sort_by(|a, b| a.0.total_cmp(&b.0));
            all
        };
        let given = CausticMap::new(&photons, 20, None).unwrap().into_photons();
        assert_eq!(given.normals, photons.normals);
        for (given, photon) in sorted(&given).into_iter().zip(sorted(&photons)) {
            assert!(given.1 == photon.1 && (given.0 / photon.0 - 1.0).abs() < 1e-6, "{given:?} of {photon:?}");
        }
    }

    #[test]
    fn few_and_coincident_photons_have_an_answer() {
        let at = [0.5, 0.5, 0.0];
        for count in [1, 2, 15] {
            let map = CausticMap::new(&photons(vec![at; count]), 80, Some(2.0)).unwrap();
            let found = map.irradiance(Vec3A::from(at), Vec3A::Z).irradiance.x;
            assert!((found * PI * 4.0 / 2.0 - 1.0).abs() < 1e-5, "{count} over the limit: {found}");
        }
        let map = CausticMap::new(&photons(vec![at; 1000]), 80, None).unwrap();
        let found = map.irradiance(Vec3A::from(at), Vec3A::Z);
        assert_eq!(found.irradiance, Vec3::ZERO, "a beam without width is not a number, nor infinite");
        assert!(CausticMap::new(&Photons::default(), 80, None).is_none(), "none at all");
    }
}
