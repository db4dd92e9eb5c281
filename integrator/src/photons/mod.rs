//! Photon maps: light that came to surfaces by other ways than straight, as irradiance.
//!
//! The global map holds every photon that met a diffuse surface after at least one bounce of any kind; gather rays read it at
//! their hits. Light that comes straight is not in it: that is sampled. The caustic map holds photons that came by mirrors and glass
//! alone (light S+ diffuse); it is what the eye sees of caustics. Each is shot only where the scene has something for it. The
//! global map includes caustics, so the two must never be added.

mod caustic;
mod coverage;
mod guide;
mod map;
mod shoot;

use std::time::Instant;

use glam::{Vec3, Vec3A};
use rayon::prelude::*;
use scene::{Scene, Surface};
use serde::{Deserialize, Serialize};

use crate::{Known, RayCounts, Secondary, hash_pair};
use caustic::CausticMap;
use coverage::{Kernel, covered_share};
pub use map::Irradiance;
use map::{IrradianceMap, PhotonMap};
pub use shoot::FluxBalance;
use shoot::{Kind, shoot};

/// Irradiance of the global map is estimated beforehand at one photon of so many.
const PRECOMPUTED_SHARE: usize = 4;
/// With fewer photons than this it is estimated at all of them.
const FEW_PHOTONS: usize = 4096;

/// How many photons are shot, and how they are read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PhotonSettings {
    /// Whether to make the global map.
    pub global: bool,
    /// Whether to make the caustic map; it is empty all the same where the scene has no mirror or glass.
    pub caustic: bool,
    /// Photons shot for the global map.
    pub count: u32,
    /// Photons shot for the caustic map.
    pub caustic_count: u32,
    /// Photons in an estimate of the global map: its noise is 1 / sqrt(neighbours - 2).
    pub neighbours: u32,
    /// Photons in a disc over which a photon of the caustic map spreads its flux.
    pub caustic_neighbours: u32,
    /// Greatest radius of an estimate, and of a disc, metres. `None`: 4 times the usual one, and 64 times for a disc.
    pub max_radius: Option<f32>,
    /// Any number; another seed gives independent maps.
    pub seed: u64,
}

impl Default for PhotonSettings {
    fn default() -> Self {
        Self {
            global: true,
            caustic: true,
            count: 200_000,
            caustic_count: 400_000,
            neighbours: 50,
            caustic_neighbours: 80,
            max_radius: None,
            seed: 0,
        }
    }
}

/// What became of the photons of one map.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct PhotonCounts {
    /// Photons shot; pilots not counted.
    pub shot: u64,
    /// Photons shot that were kept at least once.
    pub useful: u64,
    /// Photons in the map.
    pub stored: u64,
    /// Where their flux went.
    pub balance: FluxBalance,
    /// Time to shoot them and build the map, seconds.
    pub seconds: f64,
}

/// The photon maps of a scene, frozen.
#[derive(Debug)]
pub struct PhotonMaps {
    global: Option<IrradianceMap>,
    caustic: Option<CausticMap>,
    /// Counts of the global map; all 0 where it was not made.
    pub global_counts: PhotonCounts,
    /// Counts of the caustic map; all 0 where it was not made.
    pub caustic_counts: PhotonCounts,
    /// Rays traced, all of kind `photon`.
    pub rays: RayCounts,
}

impl PhotonMaps {
    /// Shoots photons and builds the maps that the settings ask for and the scene has use for.
    #[must_use]
    pub fn shoot(scene: &Scene, settings: &PhotonSettings) -> Self {
        let features = scene.features();
        let mut maps = Self {
            global: None,
            caustic: None,
            global_counts: PhotonCounts::default(),
            caustic_counts: PhotonCounts::default(),
            rays: RayCounts::default(),
        };
        if settings.global && features.diffuse {
            let start = Instant::now();
            let photons = maps.shoot_kind(scene, Kind::Global, settings);
            let map = PhotonMap::new(photons, settings.neighbours, settings.max_radius);
            maps.global = map.and_then(|map| maps.precompute(scene, &map, settings.seed));
            maps.global_counts.seconds = start.elapsed().as_secs_f64();
        }
        if settings.caustic && features.delta && features.diffuse {
            let start = Instant::now();
            let photons = maps.shoot_kind(scene, Kind::Caustic, settings);
            maps.caustic = CausticMap::new(&photons, settings.caustic_neighbours, settings.max_radius);
            maps.caustic_counts.seconds = start.elapsed().as_secs_f64();
        }
        maps
    }

    /// Returns the irradiance of all light that is not straight, at `p` on the side of the unit geometric normal `n`.
    ///
    /// It is the estimate at the nearest of some points, so it is constant in cells; its radius is what it can resolve: what
    /// is nearer to the surface than that is blurred away. `None` where no estimate is near on the same surface, which is
    /// where hardly any photon came: its light is then nearly 0.
    #[must_use]
    pub fn global_irradiance(&self, p: Vec3A, n: Vec3A) -> Option<Irradiance> {
        self.global.as_ref()?.lookup(p, n)
    }

    /// Returns the irradiance of light that came by mirrors and glass alone, at `p` on the side of the unit geometric normal `n`.
    ///
    /// Each photon spreads its flux over a disc of its own, so that caustics are blurred but neither gain nor lose light; the sum is divided by the share of
    /// the discs that is surface, found with a few short rays: beside edges it would be too dark.
    #[must_use]
    pub fn caustic_irradiance(&self, scene: &Scene, p: Vec3A, n: Vec3A) -> Vec3 {
        let Some(map) = &self.caustic else { return Vec3::ZERO };
        let estimate = map.irradiance(p, n);
        if estimate.irradiance == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let bits = p.to_array().map(|x| u64::from(x.to_bits()));
        let seed = hash_pair(hash_pair(bits[0], bits[1]), bits[2]);
        estimate.irradiance / covered_share(scene, p, n, estimate.radius, Kernel::Epanechnikov, seed)
    }

    /// The same without the test of edges, which takes most of the time: for surfaces that only gather rays meet. Too dark within the radius of a disc of
    /// edges, by a half at most beside a straight one.
    #[must_use]
    pub fn quick_caustic_irradiance(&self, p: Vec3A, n: Vec3A) -> Vec3 {
        self.caustic.as_ref().map_or(Vec3::ZERO, |map| map.irradiance(p, n).irradiance)
    }

    /// Whether there is any caustic light to look up.
    #[must_use]
    pub fn has_caustics(&self) -> bool {
        self.caustic.is_some()
    }

    /// Returns the memory held, bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> u64 {
        self.global.as_ref().map_or(0, IrradianceMap::memory_bytes)
            + self.caustic.as_ref().map_or(0, CausticMap::memory_bytes)
    }

    fn shoot_kind(&mut self, scene: &Scene, kind: Kind, settings: &PhotonSettings) -> shoot::Photons {
        let (count, counts, stream) = match kind {
            Kind::Global => (settings.count, &mut self.global_counts, 1),
            Kind::Caustic => (settings.caustic_count, &mut self.caustic_counts, 2),
        };
        let shot = shoot(scene, kind, count, hash_pair(settings.seed, stream));
        counts.shot = if scene.lights().is_empty() { 0 } else { u64::from(count) };
        counts.useful = shot.useful;
        counts.stored = shot.photons.len() as u64;
        counts.balance = shot.balance;
        self.rays.photon += shot.rays;
        shot.photons
    }

    /// Estimates irradiance at a share of the photons, corrected for the part of each disc that is surface.
    fn precompute(&mut self, scene: &Scene, map: &PhotonMap, seed: u64) -> Option<IrradianceMap> {
        let photons = map.photons();
        let step = if photons.len() < FEW_PHOTONS { 1 } else { PRECOMPUTED_SHARE };
        let indices: Vec<usize> = (0..photons.len()).step_by(step).collect();
        let points: Vec<_> = indices
            .into_par_iter()
            .map(|index| {
                let (position, normal) = (photons.positions[index], photons.normals[index]);
                let p = Vec3A::from(position);
                let mut estimate = map.irradiance(p, normal);
                if estimate.irradiance != Vec3::ZERO {
                    let stream = hash_pair(seed, index as u64);
                    estimate.irradiance /= covered_share(scene, p, normal, estimate.radius, Kernel::Constant, stream);
                }
                (p, normal, estimate)
            })
            .collect();
        self.rays.photon += (points.len() * coverage::RAYS) as u64;
        IrradianceMap::new(points)
    }
}

/// Photon maps as the light at secondary hits.
#[derive(Debug, Clone, Copy)]
pub struct PhotonSource<'a> {
    /// The maps.
    pub maps: &'a PhotonMaps,
    /// The scene in which they were shot.
    pub scene: &'a Scene,
}

impl Secondary for PhotonSource<'_> {
    fn irradiance(&self, surface: &Surface) -> Option<Known> {
        let found = self.maps.global_irradiance(surface.p, surface.ng)?;
        Some(Known { direct: None, indirect: found.irradiance, resolution: found.radius })
    }

    fn caustic_irradiance(&self, surface: &Surface) -> Vec3 {
        self.maps.caustic_irradiance(self.scene, surface.p, surface.ng)
    }

    fn quick_caustic_irradiance(&self, surface: &Surface) -> Vec3 {
        self.maps.quick_caustic_irradiance(surface.p, surface.ng)
    }
}
