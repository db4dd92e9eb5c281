//! Shooting photons: from the lights, through the scene, into arrays.
//!
//! Photons carry flux, W. Two things differ from paths that carry radiance (Veach 1997, chapter 5): refraction does not
//! scale flux by the square of the index, and where the shading normal is not the geometric one, a surface scatters by
//!
//! ```text
//! f |cos(wi, n)| / pdf * (|cos(in, n)| |cos(out, ng)|) / (|cos(in, ng)| |cos(out, n)|)
//! ```
//!
//! The ratio has no bound at grazing angles; it is cut at 4, which loses a little light on coarse smoothed meshes
//! and nothing where the normals agree.
//!
//! All is done in blocks of fixed size, whose results are joined in their order: so the number of threads does not
//! matter.

use std::ops::Range;

use glam::{DVec3, Vec2, Vec3, Vec3A};
use hemimap::Frame;
use rayon::prelude::*;
use scene::{Emission, Lobes, Material, Ray, Scene, Surface, Target};
use serde::{Deserialize, Serialize};

use super::guide::{Aim, DIMENSIONS, Guide, Pilot, parts, useful};
use crate::{Rng, hash_pair};

/// Photons of one task.
const BLOCK: u32 = 4096;
/// A photon that has scattered so often is stopped, and its flux counted.
const MAX_BOUNCES: u32 = 1000;
/// From here on a photon survives with at most `MAX_SURVIVAL`, so that it ends between perfect mirrors too.
const CAPPED_FROM: u32 = 8;
const MAX_SURVIVAL: f32 = 0.99;
/// Greatest correction for a shading normal.
const MAX_CORRECTION: f32 = 4.0;

/// Pilots of one round, and the rounds of learning; a round that finds less than `ENOUGH_USEFUL` is shot up to
/// `MAX_REPEATS` times.
const PILOTS: u32 = 1 << 15;
const ROUNDS: u64 = 3;
const ENOUGH_USEFUL: usize = 4096;
const MAX_REPEATS: u64 = 16;

/// Which photons are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// At diffuse surfaces after at least one bounce of any kind: all light but that which comes straight.
    Global,
    /// At diffuse surfaces after at least one mirror or glass and nothing else; the photon ends at the first other
    /// surface.
    Caustic,
}

/// Photons at surfaces, as arrays.
#[derive(Debug, Clone, Default)]
pub(super) struct Photons {
    /// Metres, world space.
    pub(super) positions: Vec<[f32; 3]>,
    /// Geometric normals on the side from which the photons came.
    pub(super) normals: Vec<Vec3A>,
    /// W.
    pub(super) flux: Vec<Vec3>,
}

impl Photons {
    /// Gives each photon this share of its flux.
    pub(super) fn scale(&mut self, share: f32) {
        self.flux.iter_mut().for_each(|flux| *flux *= share);
    }

    pub(super) fn len(&self) -> usize {
        self.flux.len()
    }

    fn push(&mut self, surface: &Surface, flux: Vec3) {
        self.positions.push(surface.p.to_array());
        self.normals.push(surface.ng);
        self.flux.push(flux);
    }

    pub(super) fn append(&mut self, other: &mut Self) {
        self.positions.append(&mut other.positions);
        self.normals.append(&mut other.normals);
        self.flux.append(&mut other.flux);
    }
}

/// Where the flux went, W by channel: emitted = absorbed + escaped + stopped + roulette, but for rounding.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct FluxBalance {
    /// Sent out by the lights; for caustics only to the spheres around mirrors and glass, where lights aim at these.
    pub emitted: DVec3,
    /// Lost at surfaces and in glass.
    pub absorbed: DVec3,
    /// Left the scene.
    pub escaped: DVec3,
    /// Ended at the limit of bounces, or (caustic photons) at the surface that keeps them.
    pub stopped: DVec3,
    /// Ended by chance, less what the survivors gained for it: 0 in expectation.
    pub roulette: DVec3,
}

impl FluxBalance {
    /// Returns the balance of photons that carry this share of their flux.
    pub(super) fn scaled(&self, share: f64) -> Self {
        let Self { emitted, absorbed, escaped, stopped, roulette } = *self;
        let [emitted, absorbed, escaped, stopped, roulette] =
            [emitted, absorbed, escaped, stopped, roulette].map(|flux| flux * share);
        Self { emitted, absorbed, escaped, stopped, roulette }
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.emitted += other.emitted;
        self.absorbed += other.absorbed;
        self.escaped += other.escaped;
        self.stopped += other.stopped;
        self.roulette += other.roulette;
    }
}

/// What was shot.
#[derive(Debug, Default)]
pub(super) struct Shot {
    pub(super) photons: Photons,
    pub(super) balance: FluxBalance,
    /// Photons that were kept at least once.
    pub(super) useful: u64,
    pub(super) rays: u64,
}

/// How photons of one kind are aimed.
#[derive(Debug)]
pub(super) struct Shooter {
    kind: Kind,
    /// Where lights send them: a glass on a wide floor is met by none of a million that go everywhere.
    target: Target,
    guide: Guide,
}

impl Shooter {
    /// Learns in a few rounds where to aim, each aimed by the one before; returns the rays that it took too.
    pub(super) fn learn(scene: &Scene, kind: Kind, seed: u64) -> (Self, u64) {
        let parts = parts(scene.lights().choice_ends());
        let target = match kind {
            Kind::Global => scene.lights().everything().clone(),
            // Nothing else can be met first.
            Kind::Caustic => scene.target(Material::has_delta),
        };
        let mut shooter = Self { kind, target, guide: Guide::even(&parts) };
        let mut rays = 0;
        if scene.lights().is_empty() {
            return (shooter, rays);
        }
        for round in 1..=ROUNDS {
            let mut pilots = Vec::new();
            for repeat in 0..MAX_REPEATS {
                let stream = hash_pair(seed, hash_pair(round, repeat));
                let aim = shooter.guide.aim(PILOTS, stream);
                for (found, traced) in blocks(PILOTS, |indices| shooter.pilots(scene, &aim, stream, indices)) {
                    pilots.extend(found);
                    rays += traced;
                }
                if useful(&pilots).count() >= ENOUGH_USEFUL {
                    break;
                }
            }
            if useful(&pilots).next().is_none() {
                break;
            }
            shooter.guide = Guide::learn(&parts, &mut pilots);
        }
        (shooter, rays)
    }

    /// Shoots pilots; returns them and the number of rays.
    fn pilots(&self, scene: &Scene, aim: &Aim<'_>, seed: u64, indices: Range<u32>) -> (Vec<Pilot>, u64) {
        let mut shot = Shot::default();
        let mut pilots = Vec::new();
        for index in indices {
            let Start { u, density, photon } = self.start(scene, aim, index, 1.0);
            let score = photon.map_or(0.0, |(ray, flux)| {
                let kept = shot.follow(scene, self.kind, ray, flux, &mut Rng::new(seed, u64::from(index)));
                f64::from(flux.max_element()) * f64::from(kept)
            });
            pilots.push(Pilot { u, density, score });
        }
        (pilots, shot.rays)
    }

    /// Shoots `count` photons; none where the scene has no light that could shoot.
    pub(super) fn shoot(&self, scene: &Scene, count: u32, seed: u64) -> Shot {
        if scene.lights().is_empty() || count == 0 {
            return Shot::default();
        }
        let aim = self.guide.aim(count, seed);
        let scale = 1.0 / count as f32;
        let shots = blocks(count, |indices| {
            let mut shot = Shot::default();
            for index in indices {
                if let Some((ray, flux)) = self.start(scene, &aim, index, scale).photon {
                    let kept = shot.follow(scene, self.kind, ray, flux, &mut Rng::new(seed, u64::from(index)));
                    shot.useful += u64::from(kept > 0);
                }
            }
            shot
        });
        let mut all = Shot::default();
        for mut shot in shots {
            all.photons.append(&mut shot.photons);
            all.balance.add(&shot.balance);
            all.useful += shot.useful;
            all.rays += shot.rays;
        }
        all
    }

    /// Starts photon number `index`, its flux times `scale`.
    fn start(&self, scene: &Scene, aim: &Aim<'_>, index: u32, scale: f32) -> Start {
        let (u, density) = aim.numbers(index);
        let [choice, x, y, z, w] = u;
        let emission = scene.lights().emit_to(&self.target, choice, Vec2::new(x, y), Vec2::new(z, w));
        let photon = emission
            .map(|Emission { ray, flux }| (Ray { media: scene.media_at(ray.origin), ..ray }, flux * (scale / density)));
        Start { u, density, photon: photon.filter(|(_, flux)| flux.is_finite() && *flux != Vec3::ZERO) }
    }
}

/// Runs `work` over blocks of photons in parallel and returns the results in the order of the blocks.
fn blocks<T: Send>(count: u32, work: impl Fn(Range<u32>) -> T + Sync) -> Vec<T> {
    (0..count.div_ceil(BLOCK))
        .into_par_iter()
        .map(|block| work(block * BLOCK..count.min(block * BLOCK + BLOCK)))
        .collect()
}

/// A photon about to leave its light.
struct Start {
    /// The numbers that made it.
    u: [f32; DIMENSIONS],
    /// Their density.
    density: f32,
    /// `None` where they make none.
    photon: Option<(Ray, Vec3)>,
}

impl Shot {
    /// Follows a photon to its end and keeps it where its kind says so. Returns how often it was kept.
    fn follow(&mut self, scene: &Scene, kind: Kind, mut ray: Ray, mut flux: Vec3, rng: &mut Rng) -> u32 {
        let balance = &mut self.balance;
        balance.emitted += flux.as_dvec3();
        let mut kept = 0;
        for bounce in 0..MAX_BOUNCES {
            self.rays += 1;
            let hit = scene.intersect(&ray);
            let end = hit.map_or(ray.t_max, |hit| hit.t);
            // What arrives at a surface that is there in part arrives at its holes, too.
            for hole in scene.holes(&ray, end).filter(|hole| bounce > 0 && is_kept(scene, hole)) {
                self.photons.push(&hole, flux * (scene.transmittance(&hole) * received(&hole, ray.direction)));
                kept += 1;
            }
            let Some(hit) = hit else {
                balance.escaped += flux.as_dvec3();
                return kept;
            };
            let surface = scene.surface(&ray, &hit);
            let arrived = flux * scene.transmittance(&surface);
            balance.absorbed += flux.as_dvec3() - arrived.as_dvec3();
            flux = arrived;

            let bsdf = scene.bsdf(&surface);
            let towards_source = -ray.direction;
            if bounce > 0 && is_kept(scene, &surface) {
                self.photons.push(&surface, flux * received(&surface, ray.direction));
                kept += 1;
            }
            if kind == Kind::Caustic && !bsdf.has_delta() {
                balance.stopped += flux.as_dvec3();
                return kept;
            }

            let frame = Frame::from_normal(surface.n);
            let sample = bsdf.sample(Lobes::ALL, frame.to_local(towards_source), rng.next_1d(), rng.next_2d());
            let Some(sample) = sample else {
                balance.absorbed += flux.as_dvec3();
                return kept;
            };
            let direction = frame.to_world(sample.wi);
            let is_through = surface.ng.dot(direction) < 0.0;
            if is_through != sample.transmitted {
                balance.absorbed += flux.as_dvec3();
                return kept;
            }
            if kind == Kind::Caustic && !sample.delta {
                balance.stopped += flux.as_dvec3();
                return kept;
            }
            let correction = if surface.n == surface.ng {
                1.0
            } else {
                (cosine_ratio(&surface, towards_source) / cosine_ratio(&surface, direction)).min(MAX_CORRECTION)
            };
            let scattered = flux * sample.weight * (correction / sample.radiance_scale);
            balance.absorbed += flux.as_dvec3() - scattered.as_dvec3();

            // The photon goes on with about the flux it had, or not at all.
            let most = if bounce < CAPPED_FROM { 1.0 } else { MAX_SURVIVAL };
            let survival = (scattered.max_element() / flux.max_element()).min(most);
            flux = if rng.next_1d() < survival { scattered / survival } else { Vec3::ZERO };
            balance.roulette += scattered.as_dvec3() - flux.as_dvec3();
            if flux == Vec3::ZERO {
                return kept;
            }
            ray = surface.spawn(direction);
        }
        balance.stopped += flux.as_dvec3();
        kept
    }
}

/// Whether photons count on a surface. They do where a texture is black, too: places beside it, where it is not, count
/// the photons around them.
fn is_kept(scene: &Scene, surface: &Surface) -> bool {
    scene.materials()[surface.material as usize].is_diffuse()
}

/// Returns what a flux is worth on a surface with interpolated normals.
fn received(surface: &Surface, direction: Vec3A) -> f32 {
    cosine_ratio(surface, direction).min(MAX_CORRECTION)
}

/// Returns |cos(w, n)| / |cos(w, ng)|: how much more light the shading normal makes of a flux than the surface
/// receives.
fn cosine_ratio(surface: &Surface, w: Vec3A) -> f32 {
    surface.n.dot(w).abs() / surface.ng.dot(w).abs().max(f32::MIN_POSITIVE)
}
