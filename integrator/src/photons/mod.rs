//! Photon maps: light that came to surfaces by other ways than straight, as irradiance.
//!
//! The global map holds every photon that met a diffuse surface after at least one bounce of any kind; gather rays read
//! it at their hits. Light that comes straight is not in it: that is sampled. The caustic map holds photons that came
//! by mirrors and glass alone (light S+ diffuse); it is what the eye sees of caustics. Each is shot only where the
//! scene has something for it. The global map includes caustics, so the two must never be added.

mod caustic;
mod coverage;
mod discs;
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
use shoot::{Kind, Photons, Shooter};

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

/// Photons, and what became of all that were shot.
type Shots = (Photons, PhotonCounts);

/// Joins what was shot in two parts, each as if there were no others.
fn merge((mut a, counts_a): Shots, (mut b, counts_b): Shots) -> Shots {
    let shot = counts_a.shot + counts_b.shot;
    let shares = [counts_a, counts_b].map(|counts| counts.shot as f64 / shot as f64);
    #[expect(clippy::cast_possible_truncation, reason = "flux is f32")]
    let [share_a, share_b] = shares.map(|share| share as f32);
    a.scale(share_a);
    b.scale(share_b);
    a.append(&mut b);
    let mut balance = counts_a.balance.scaled(shares[0]);
    balance.add(&counts_b.balance.scaled(shares[1]));
    let counts = PhotonCounts {
        shot,
        useful: counts_a.useful + counts_b.useful,
        stored: counts_a.stored + counts_b.stored,
        balance,
        seconds: counts_a.seconds + counts_b.seconds,
    };
    (a, counts)
}

/// The share of the disc of an estimate by caustics that is surface; 1 where there is no light.
fn coverage(scene: &Scene, p: Vec3A, n: Vec3A, estimate: &Irradiance, precise: bool) -> f32 {
    if estimate.irradiance == Vec3::ZERO {
        return 1.0;
    }
    let bits = p.to_array().map(|x| u64::from(x.to_bits()));
    let seed = hash_pair(hash_pair(bits[0], bits[1]), bits[2]);
    covered_share(scene, p, n, estimate.radius, Kernel::Epanechnikov, precise, seed)
}

/// The number of photons of one map.
fn count(number: u64) -> u32 {
    u32::try_from(number).expect("counts are of 32 bits")
}

/// The photon maps of a scene, frozen.
#[derive(Debug)]
pub struct PhotonMaps {
    global: Option<IrradianceMap>,
    caustic: Option<CausticMap>,
    /// How the photons of the caustic map were aimed.
    caustic_shooter: Option<Shooter>,
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
        let mut maps = Self::empty();
        if settings.global && features.diffuse && settings.count > 0 {
            let start = Instant::now();
            let seed = hash_pair(settings.seed, 1);
            let shooter = maps.learn(scene, Kind::Global, seed);
            let (photons, counts) = maps.shoot_by(&shooter, scene, settings.count, seed);
            maps.global_counts = counts;
            let map = PhotonMap::new(photons, settings.neighbours, settings.max_radius);
            maps.global = map.and_then(|map| maps.precompute(scene, &map, settings.seed));
            maps.global_counts.seconds = start.elapsed().as_secs_f64();
        }
        maps.refine_caustics(scene, settings);
        maps
    }

    fn empty() -> Self {
        Self {
            global: None,
            caustic: None,
            caustic_shooter: None,
            global_counts: PhotonCounts::default(),
            caustic_counts: PhotonCounts::default(),
            rays: RayCounts::default(),
        }
    }

    /// Shoots more photons for the caustic map, aimed as those before, until it is by [`PhotonSettings::caustic_count`]
    /// altogether, and spreads all of them anew, over discs of [`PhotonSettings::caustic_neighbours`]. Does nothing
    /// where there are as many already, or where [`PhotonMaps::shoot`] found no use for the map.
    ///
    /// # Example
    ///
    /// ```
    /// use glam::{Vec3, Vec3A};
    /// use integrator::{PhotonMaps, PhotonSettings};
    /// use scene::{Description, Material, Mesh, PunctualLight, Scene, SpecularKind};
    ///
    /// // A mirror stands beside a floor.
    /// let square = |corners: [Vec3; 4], material| Mesh {
    ///     positions: corners.to_vec(),
    ///     triangles: vec![[0, 1, 2], [0, 2, 3]],
    ///     materials: vec![material; 2],
    ///     ..Mesh::default()
    /// };
    /// let floor = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
    /// let wall = [Vec3::ZERO, Vec3::Y, Vec3::new(0.0, 1.0, 1.0), Vec3::Z];
    /// let mirror = Material { diffuse: Vec3::ZERO, specular: SpecularKind::Mirror { reflectance: Vec3::ONE }, ..Material::default() };
    /// let scene = Scene::new(Description {
    ///     meshes: vec![square(floor, 0), square(wall, 1)],
    ///     materials: vec![Material::default(), mirror],
    ///     lights: vec![PunctualLight::Point { position: Vec3::new(0.5, 0.5, 1.0), intensity: Vec3::ONE }],
    ///     ..Description::default()
    /// })?;
    /// let few = PhotonSettings { global: false, caustic_count: 10_000, ..PhotonSettings::default() };
    /// let mut maps = PhotonMaps::shoot(&scene, &few);
    /// maps.refine_caustics(&scene, &PhotonSettings { caustic_count: 40_000, caustic_neighbours: 200, ..few });
    /// assert_eq!(maps.caustic_counts.shot, 40_000);
    /// // As from a lamp at (-0.5, 0.5, 1), the mirrored one.
    /// let p = Vec3A::new(0.25, 0.5, 0.0);
    /// let expected = 1.0 / (0.75f32.powi(2) + 1.0).powf(1.5);
    /// assert!((maps.caustic_irradiance(&scene, p, Vec3A::Z).x / expected - 1.0).abs() < 0.2);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn refine_caustics(&mut self, scene: &Scene, settings: &PhotonSettings) {
        let features = scene.features();
        let has_use = settings.caustic && features.delta && features.diffuse;
        if has_use && u64::from(settings.caustic_count) > self.caustic_counts.shot {
            let start = Instant::now();
            let known = self.take_caustics();
            self.complete(known, scene, settings, start);
        }
    }

    /// Shoots as many photons for caustics again, aimed alike, to compare both or to add them by
    /// [`Self::join_caustics`].
    pub(crate) fn caustic_twin(&mut self, scene: &Scene, settings: &PhotonSettings) -> Self {
        let start = Instant::now();
        let shot = self.caustic_counts.shot;
        let photons = self.shoot_caustics(scene, settings, shot, count(2 * shot));
        let mut twin = Self::empty();
        twin.spread(photons, settings, start);
        twin
    }

    /// As [`Self::refine_caustics`], by way of what its twin has shot.
    pub(crate) fn join_caustics(&mut self, mut twin: Self, scene: &Scene, settings: &PhotonSettings) {
        let start = Instant::now();
        let known = self.take_caustics().into_iter().chain(twin.take_caustics()).reduce(merge);
        self.complete(known, scene, settings, start);
    }

    /// Makes the caustic map of what is known, and of what is shot until there is as much as the settings ask for.
    fn complete(&mut self, known: Option<Shots>, scene: &Scene, settings: &PhotonSettings, start: Instant) {
        let shot = known.as_ref().map_or(0, |(_, counts)| counts.shot);
        let is_short = u64::from(settings.caustic_count) > shot;
        let more = is_short.then(|| self.shoot_caustics(scene, settings, shot, settings.caustic_count));
        if let Some(all) = known.into_iter().chain(more).reduce(merge) {
            self.spread(all, settings, start);
        }
    }

    /// Shoots photons from number `from` to number `to`.
    fn shoot_caustics(&mut self, scene: &Scene, settings: &PhotonSettings, from: u64, to: u32) -> Shots {
        let seed = hash_pair(settings.seed, 2);
        let shooter = self.caustic_shooter.take().unwrap_or_else(|| self.learn(scene, Kind::Caustic, seed));
        let shots = self.shoot_by(&shooter, scene, to - count(from), hash_pair(seed, from));
        self.caustic_shooter = Some(shooter);
        shots
    }

    /// The photons of the caustic map, which is gone then; `None` if none were shot.
    fn take_caustics(&mut self) -> Option<Shots> {
        let photons = self.caustic.take().map(CausticMap::into_photons).unwrap_or_default();
        let counts = std::mem::take(&mut self.caustic_counts);
        (counts.shot > 0).then_some((photons, counts))
    }

    /// Makes the caustic map of what was shot.
    fn spread(&mut self, (photons, counts): Shots, settings: &PhotonSettings, start: Instant) {
        self.caustic = CausticMap::new(&photons, settings.caustic_neighbours, settings.max_radius);
        self.caustic_counts = PhotonCounts { seconds: counts.seconds + start.elapsed().as_secs_f64(), ..counts };
    }

    /// Returns the irradiance of all light that is not straight, at `p` on the side of the unit geometric normal `n`.
    ///
    /// It is the estimate at the nearest of some points, so it is constant in cells; its radius is what it can resolve:
    /// what is nearer to the surface than that is blurred away. `None` where no estimate is near on the same surface,
    /// which is where hardly any photon came: its light is then nearly 0.
    #[must_use]
    pub fn global_irradiance(&self, p: Vec3A, n: Vec3A) -> Option<Irradiance> {
        self.global.as_ref()?.lookup(p, n)
    }

    /// Returns the irradiance of light that came by mirrors and glass alone, at `p` on the side of the unit geometric
    /// normal `n`.
    ///
    /// Each photon spreads its flux over a disc of its own, so that caustics are blurred but neither gain nor lose
    /// light; the sum is divided by the share of the discs that is surface, found with a few short rays: beside edges
    /// it would be too dark.
    #[must_use]
    pub fn caustic_irradiance(&self, scene: &Scene, p: Vec3A, n: Vec3A) -> Vec3 {
        let estimate = self.caustic_estimate(p, n);
        estimate.irradiance / coverage(scene, p, n, &estimate, true)
    }

    /// Returns the share of the discs of photons around `p` that is surface, in [1/16, 1]: 1 where there is none. Its
    /// deviation beside an edge is up to 0.1, or 0.025 where it is asked to be `precise`, by four times as many rays.
    #[must_use]
    pub fn caustic_coverage(&self, scene: &Scene, p: Vec3A, n: Vec3A, precise: bool) -> f32 {
        coverage(scene, p, n, &self.caustic_estimate(p, n), precise)
    }

    /// The same without the test of edges, which takes most of the time: for surfaces that only gather rays meet. Too
    /// dark within the radius of a disc of edges, by a half at most beside a straight one.
    #[must_use]
    pub fn quick_caustic_irradiance(&self, p: Vec3A, n: Vec3A) -> Vec3 {
        self.caustic_estimate(p, n).irradiance
    }

    fn caustic_estimate(&self, p: Vec3A, n: Vec3A) -> Irradiance {
        self.caustic.as_ref().map_or(Irradiance::DARK, |map| map.irradiance(p, n))
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

    fn learn(&mut self, scene: &Scene, kind: Kind, seed: u64) -> Shooter {
        let (shooter, rays) = Shooter::learn(scene, kind, seed);
        self.rays.photon += rays;
        shooter
    }

    /// Shoots photons; the counts lack the time.
    fn shoot_by(&mut self, shooter: &Shooter, scene: &Scene, count: u32, seed: u64) -> Shots {
        let shot = shooter.shoot(scene, count, seed);
        self.rays.photon += shot.rays;
        let counts = PhotonCounts {
            shot: if scene.lights().is_empty() { 0 } else { u64::from(count) },
            useful: shot.useful,
            stored: shot.photons.len() as u64,
            balance: shot.balance,
            seconds: 0.0,
        };
        (shot.photons, counts)
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
                    estimate.irradiance /=
                        covered_share(scene, p, normal, estimate.radius, Kernel::Constant, false, stream);
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

    fn covered_caustic_irradiance(&self, surface: &Surface, reach: f32, fine: f32) -> Irradiance {
        let map = self.maps.caustic.as_ref();
        map.map_or(Irradiance::DARK, |map| map.irradiance_and_detail(surface.p, surface.ng, reach, fine))
    }

    fn caustic_coverage(&self, surface: &Surface, precise: bool) -> f32 {
        self.maps.caustic_coverage(self.scene, surface.p, surface.ng, precise)
    }

    fn quick_caustic_irradiance(&self, surface: &Surface) -> Vec3 {
        self.maps.quick_caustic_irradiance(surface.p, surface.ng)
    }
}
