//! What a rendering counted and how long it took, as the summary table and `--stats` show it.

use std::ops::AddAssign;
use std::time::Instant;

use rayon::iter::{IndexedParallelIterator, ParallelIterator};
use serde::{Deserialize, Serialize};

use crate::PathTracer;

/// Rays by what they were traced for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct RayCounts {
    /// From the eye.
    pub camera: u64,
    /// To a light, to see whether something is in the way.
    pub shadow: u64,
    /// Followed from a surface: by the path tracer, through mirrors and glass, through glossy lobes, and to link cells.
    pub path: u64,
    /// From a gathered point into its hemisphere.
    pub gather: u64,
    /// Through the holes of a reprojected texture, to verify a record, and to see what stands above a point.
    pub hole: u64,
    /// From a light, for the photon maps. The short ones that test how much of a disc is surface are not counted.
    pub photon: u64,
}

impl RayCounts {
    /// Returns the number of all rays.
    #[must_use]
    pub const fn total(&self) -> u64 {
        self.camera + self.shadow + self.path + self.gather + self.hole + self.photon
    }
}

impl AddAssign for RayCounts {
    fn add_assign(&mut self, other: Self) {
        self.camera += other.camera;
        self.shadow += other.shadow;
        self.path += other.path;
        self.gather += other.gather;
        self.hole += other.hole;
        self.photon += other.photon;
    }
}

/// Maps in parallel and in order, while each item counts its rays for itself; all are added to `rays`.
pub(crate) fn map_counting<T: IndexedParallelIterator, R: Send>(
    items: T,
    rays: &mut RayCounts,
    map: impl Fn(T::Item, &mut RayCounts) -> R + Send + Sync,
) -> Vec<R> {
    let counted = |item| {
        let mut rays = RayCounts::default();
        (map(item, &mut rays), rays)
    };
    let found: Vec<(R, RayCounts)> = items.map(counted).collect();
    let sum = |(found, counted)| {
        *rays += counted;
        found
    };
    found.into_iter().map(sum).collect()
}

/// Memory at the end of a rendering by what it holds, bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Memory {
    /// Geometry with its tree, materials, textures and lights.
    pub scene: u64,
    /// Photon maps.
    pub photons: u64,
    /// The solution for the light at secondary hits.
    pub cells: u64,
    /// Records of radiance with their index.
    pub records: u64,
    /// Records of irradiance with their index.
    pub irradiance_records: u64,
    /// The picture.
    pub film: u64,
}

impl Memory {
    /// Returns the sum of all.
    #[must_use]
    pub const fn total(&self) -> u64 {
        self.scene + self.photons + self.cells + self.records + self.irradiance_records + self.film
    }
}

/// The time of one phase.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Phase {
    /// Its name.
    pub name: String,
    /// Wall-clock time, seconds.
    pub seconds: f64,
}

/// Everything that a rendering counted. Counts that do not apply to the method are 0.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Statistics {
    /// From the built scene to the finished film, seconds.
    pub render_seconds: f64,
    /// Time by phase, in the order in which they ran.
    pub phases: Vec<Phase>,
    /// Rays by kind.
    pub rays: RayCounts,
    /// Primary samples a pixel.
    pub spp: u32,
    /// Samples dropped because they were not finite. They count as black.
    pub dropped_samples: u64,
    /// Paths that were cut at the hard limit of their length.
    pub cut_paths: u64,
    /// Distinct surfaces seen in the pixels.
    pub surface_points: u64,
    /// Records of radiance, which are reprojected.
    pub records: u64,
    /// Records of irradiance, which are interpolated.
    pub irradiance_records: u64,
    /// Points whose indirect light was reprojected.
    pub reprojected: u64,
    /// Points whose indirect light was interpolated.
    pub interpolated: u64,
    /// Points whose indirect light was gathered.
    pub gathered: u64,
    /// Mean share of the hemisphere that reprojected elements fill, in [0, 1].
    pub share_filled: f64,
    /// Mean share that no element may fill, because something may have come into view, in [0, 1].
    pub share_unknown: f64,
    /// Mean share of holes, in [0, 1]: what no element fills, and rays see.
    pub share_holes: f64,
    /// Photons shot, for both maps.
    pub photons_shot: u64,
    /// Photons in the global map.
    pub photons_global: u64,
    /// Photons in the caustic map.
    pub photons_caustic: u64,
    /// Memory by what it holds.
    pub memory: Memory,
}

impl Statistics {
    /// Runs `work` and adds its time to the phase `name`, which is appended when it is new.
    pub fn time<T>(&mut self, name: &str, work: impl FnOnce(&mut Self) -> T) -> T {
        let start = Instant::now();
        let result = work(self);
        self.add_seconds(name, start.elapsed().as_secs_f64());
        result
    }

    fn add_seconds(&mut self, name: &str, seconds: f64) {
        match self.phases.iter_mut().find(|phase| phase.name == name) {
            Some(phase) => phase.seconds += seconds,
            None => self.phases.push(Phase { name: name.to_owned(), seconds }),
        }
    }

    /// Adds what a path tracer counted.
    pub(crate) fn add_paths(&mut self, tracer: &PathTracer<'_>) {
        self.rays += tracer.rays;
        self.cut_paths += tracer.cut_paths;
        self.dropped_samples += tracer.dropped_samples;
    }

    /// Adds what one of several pictures of the same scene took, memory apart: of that the largest counts.
    pub(crate) fn add_pass(&mut self, pass: &Self) {
        let (before, of_pass) = (self.reprojected as f64, pass.reprojected as f64);
        let all = (before + of_pass).max(1.0);
        let mixed = |share: f64, of_share: f64| (share * before + of_share * of_pass) / all;
        self.share_filled = mixed(self.share_filled, pass.share_filled);
        self.share_unknown = mixed(self.share_unknown, pass.share_unknown);
        self.share_holes = mixed(self.share_holes, pass.share_holes);
        for phase in &pass.phases {
            self.add_seconds(&phase.name, phase.seconds);
        }
        self.rays += pass.rays;
        self.spp += pass.spp;
        self.dropped_samples += pass.dropped_samples;
        self.cut_paths += pass.cut_paths;
        self.surface_points += pass.surface_points;
        self.records += pass.records;
        self.irradiance_records += pass.irradiance_records;
        self.reprojected += pass.reprojected;
        self.interpolated += pass.interpolated;
        self.gathered += pass.gathered;
        self.photons_shot += pass.photons_shot;
        self.photons_global += pass.photons_global;
        self.photons_caustic += pass.photons_caustic;
        if pass.memory.total() > self.memory.total() {
            self.memory = pass.memory;
        }
    }

    /// Returns the time of the phase `name`, seconds; 0 where it did not run.
    #[must_use]
    pub fn seconds(&self, name: &str) -> f64 {
        self.phases.iter().find(|phase| phase.name == name).map_or(0.0, |phase| phase.seconds)
    }
}

/// How far a rendering is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// What is being done.
    pub phase: &'static str,
    /// The share of the phase that is done, in [0, 1].
    pub done: f32,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_phase_that_runs_twice_is_listed_once() {
        let mut statistics = Statistics::default();
        let sum = statistics.time("photons", |s| {
            s.rays.photon += 2;
            s.rays.total() + 1
        });
        statistics.time("film", |_| ());
        statistics.time("photons", |_| ());
        assert_eq!(sum, 3, "the closure's value");
        let names: Vec<_> = statistics.phases.iter().map(|phase| phase.name.as_str()).collect();
        assert_eq!(names, ["photons", "film"], "in the order of their first run");
        assert_eq!(statistics.seconds("none"), 0.0, "a phase that did not run");
    }

    #[test]
    fn counts_add_up_by_kind() {
        let one = RayCounts { camera: 1, shadow: 2, path: 3, gather: 4, hole: 5, photon: 6 };
        let mut sum = one;
        sum += one;
        assert_eq!(sum.total(), 42, "twice 1 + ... + 6");
        assert_eq!((sum.camera, sum.hole), (2, 10), "by kind");
    }
}
