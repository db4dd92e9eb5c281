//! The fourth term of eq. 7, indirect light on diffuse surfaces, and with it the soft sky and the gloss that textures carry: from
//! the cache of records, or gathered at every point.
//!
//! Points of the picture form a lattice. Level by level, coarse to fine, a point is interpolated where its neighbours of the
//! coarser level lie on one surface and agree, and evaluated where they do not. To evaluate, a record is reprojected; a point
//! that no record serves, or whose verification rays disagree with what they meet, becomes a record itself. Records are made in
//! batches of fixed order and frozen while they are read, so the result does not depend on the number of threads.

use glam::Vec3;
use hemimap::Frame;
use radcache::{Index, Record, Samples, Validity};
use rayon::prelude::*;
use reproject::{Shares, Verdict, Workspace};

use super::glossy::{lobe_weights, needs_texture};
use crate::explain::{RecordFacts, Step, Witness};
use crate::gather::{Gatherer, PointTracer};
use crate::lattice::{Lattice, STRIDES};
use crate::plan::Plan;
use crate::sampler::hash;
use crate::secondary::{Secondary, Shading};
use crate::statistics::RayCounts;
use crate::surface_points::SurfacePoint;

/// Light of a point that comes through its hemisphere.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Incident {
    /// Mean radiance over the cosine-weighted hemisphere, irradiance / pi, of what stands at a distance: L_i.
    pub(crate) near: Vec3,
    /// The same of the soft sky: a part of L_d.
    pub(crate) sky: Vec3,
    /// Indirect light that the glossy part reflects, where a texture carries it.
    pub(crate) glossy: Vec3,
    /// Within this distance the light is about the same, metres.
    pub(crate) reach: f32,
}

/// What the evaluation of points counted.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Counts {
    pub(crate) rays: RayCounts,
    pub(crate) reprojected: u64,
    pub(crate) interpolated: u64,
    pub(crate) gathered: u64,
    /// Sums over the reprojected points.
    pub(crate) filled: f64,
    pub(crate) unknown: f64,
    pub(crate) traced: f64,
}

/// Evaluates points of the picture.
#[derive(Debug)]
pub(crate) struct IndirectTerm<'a, S> {
    pub(crate) gatherer: Gatherer<'a, S>,
    pub(crate) plan: &'a Plan,
    /// Who writes down what happens at the points of one pixel, if anybody does.
    pub(crate) witness: Option<&'a Witness>,
    /// Size of the scene, metres.
    pub(crate) scene_size: f32,
}

/// Smallest batch of records, and the share of the missing ones that a batch takes: a batch must leave room for its records to
/// serve the rest.
const MIN_BATCH: usize = 64;
const BATCH_SHARE: usize = 4;

/// What became of a point that asked the cache.
enum Answer {
    /// A record served it.
    Served(Incident, Shares, RayCounts),
    /// It must become a record.
    Missing(RayCounts),
}

/// Buffers of a thread.
#[derive(Default)]
struct Buffers {
    workspace: Workspace,
    weights: Vec<Vec3>,
}

impl<S: Secondary> IndirectTerm<'_, S> {
    /// Gathers at every point, without a cache.
    pub(crate) fn gather_all(&self, points: &[SurfacePoint], counts: &mut Counts) -> Vec<Incident> {
        let found: Vec<(Incident, RayCounts)> = points
            .par_iter()
            .map_init(Vec::new, |weights, point| {
                let mut rays = RayCounts::default();
                if !self.asks(point) {
                    return (Incident::default(), rays);
                }
                let frame = Frame::from_normal(point.shading.surface.n);
                let samples = self.gatherer.gather(&point.shading.surface, &frame, self.plan.n, point.key, &mut rays);
                self.tell(point, || Step::Gathered { resolution: self.plan.n, record: None });
                (self.of_samples(&samples, &frame, point, weights), rays)
            })
            .collect();
        counts.gathered += points.iter().filter(|point| self.asks(point)).count() as u64;
        found
            .into_iter()
            .map(|(incident, rays)| {
                counts.rays += rays;
                incident
            })
            .collect()
    }

    /// Whether anything of a point is lit by a texture: a narrow lobe alone is traced.
    fn asks(&self, point: &SurfacePoint) -> bool {
        point.shading.bsdf.has_diffuse() || needs_texture(&point.shading, self.plan)
    }

    /// Evaluates or interpolates every point, making records where they are missing.
    pub(crate) fn reproject_all(&self, lattice: &Lattice, index: &mut Index, counts: &mut Counts) -> Vec<Incident> {
        let points = lattice.points();
        let mut values: Vec<Option<Incident>> =
            points.iter().map(|point| (!self.asks(point)).then(Incident::default)).collect();
        for stride in STRIDES {
            let level = lattice.level(stride, &values);
            let interpolated: Vec<Option<Incident>> = level
                .par_iter()
                .map(|&number| {
                    let takes_texture = needs_texture(&points[number].shading, self.plan);
                    if takes_texture { None } else { lattice.interpolate(number, stride, &values, self.plan.agreement) }
                })
                .collect();
            let mut rest = Vec::new();
            for (&number, value) in level.iter().zip(interpolated) {
                match value {
                    Some(value) => {
                        values[number] = Some(value);
                        counts.interpolated += 1;
                        self.tell(&points[number], || Step::Interpolated { stride });
                    }
                    None => rest.push(number),
                }
            }
            self.evaluate(points, rest, index, &mut values, counts);
        }
        values.into_iter().map(|value| value.expect("the last level holds every point")).collect()
    }

    /// Evaluates the points `todo` in passes: what the cache can serve is served, a batch of the others becomes records, and the
    /// rest asks again.
    fn evaluate(
        &self,
        points: &[SurfacePoint],
        mut todo: Vec<usize>,
        index: &mut Index,
        values: &mut [Option<Incident>],
        counts: &mut Counts,
    ) {
        while !todo.is_empty() {
            let frozen = &*index;
            let answers: Vec<Answer> = todo
                .par_iter()
                .map_init(Buffers::default, |buffers, &number| self.ask(frozen, &points[number], buffers))
                .collect();
            let mut missing = Vec::new();
            for (&number, answer) in todo.iter().zip(answers) {
                match answer {
                    Answer::Served(incident, shares, rays) => {
                        values[number] = Some(incident);
                        counts.rays += rays;
                        counts.reprojected += 1;
                        counts.filled += f64::from(shares.filled);
                        counts.unknown += f64::from(shares.unknown);
                        counts.traced += f64::from(shares.holes);
                    }
                    Answer::Missing(rays) => {
                        counts.rays += rays;
                        missing.push(number);
                    }
                }
            }
            // Spread over the picture, so that the records of a batch seldom serve each other's place.
            missing.sort_by_key(|&number| hash(points[number].key));
            let batch = missing.len().min((missing.len() / BATCH_SHARE).max(MIN_BATCH));
            let made: Vec<(Option<Record>, Incident, RayCounts)> = missing[..batch]
                .par_iter()
                .map_init(Vec::new, |weights, &number| self.make_record(&points[number], weights))
                .collect();
            for (&number, (record, incident, rays)) in missing.iter().zip(made) {
                index.extend(record);
                values[number] = Some(incident);
                counts.rays += rays;
                counts.gathered += 1;
            }
            todo = missing.split_off(batch);
            todo.sort_unstable();
        }
    }

    /// Asks the cache for a point.
    fn ask(&self, index: &Index, point: &SurfacePoint, buffers: &mut Buffers) -> Answer {
        let surface = &point.shading.surface;
        let mut tracer =
            PointTracer { gatherer: &self.gatherer, surface: *surface, key: point.key, rays: RayCounts::default() };
        let Some(found) = index.best(surface.p, surface.n) else {
            self.tell(point, || Step::NoRecord);
            return Answer::Missing(tracer.rays);
        };
        let record = index.record(found.record);
        let Buffers { workspace, weights } = buffers;
        let shares = workspace.project_above(record, surface.p, surface.n, surface.ng, &self.plan.reproject);
        let (holds, verdict, second_verdict) = self.verify(workspace, record, point, &mut tracer);
        if !holds {
            let verdict = second_verdict.unwrap_or(verdict);
            self.tell(point, || Step::Refused { record: RecordFacts::new(record, surface.p), verdict });
            return Answer::Missing(tracer.rays);
        }
        let hole_rays = workspace.trace_holes(self.plan.reproject.step, point.key, &mut tracer);
        self.tell(point, || {
            let record = RecordFacts::new(record, surface.p);
            Step::Reprojected { record, verdict, second_verdict, shares, hole_rays }
        });
        let [near, sky] = workspace.mean_radiance_by_distance();
        let mut incident = Incident { near, sky, glossy: Vec3::ZERO, reach: record.harmonic_distance() };
        if needs_texture(&point.shading, self.plan) {
            let frame = workspace.frame();
            self.weigh(&point.shading, &frame, workspace.resolution(), point.key, weights);
            // What is infinitely far is the sky: direct light, which the glossy lobe has by sampling.
            [incident.glossy, _] = workspace.weighted_sum_by_distance(record, weights);
        }
        Answer::Served(incident, shares, tracer.rays)
    }

    /// Asks four rays whether the elements are where the record says, and sixteen more where two of them disagree. Whether the
    /// record holds, and what the first and the second rays found.
    fn verify(
        &self,
        workspace: &mut Workspace,
        record: &Record,
        point: &SurfacePoint,
        tracer: &mut PointTracer<'_, S>,
    ) -> (bool, Verdict, Option<Verdict>) {
        /// Half of the first rays are in doubt...
        const DOUBT: f32 = 0.5;
        /// ... and a fifth of the second ones refuse the record (study, findings 12 and 16).
        const REFUSED: f32 = 0.2;
        let side = self.plan.verify_side;
        if side == 0 {
            return (true, Verdict::default(), None);
        }
        let share = |verdict: Verdict| verdict.wrong as f32 / verdict.asked.max(1) as f32;
        let first = workspace.verify(record, side, point.key, tracer);
        if share(first) < DOUBT {
            return (true, first, None);
        }
        let second = workspace.verify(record, 2 * side, point.key, tracer);
        (share(second) < REFUSED, first, Some(second))
    }

    /// The light of a point by a gather, and the record that comes of it, if that would reach anybody.
    fn make_record(&self, point: &SurfacePoint, weights: &mut Vec<Vec3>) -> (Option<Record>, Incident, RayCounts) {
        let surface = &point.shading.surface;
        let frame = Frame::from_normal(surface.n);
        let mut rays = RayCounts::default();
        let validity: Validity = self.plan.validity(point.footprint, self.scene_size);
        // A first look with fewer rays is enough for a point in a crease, whose record would serve nobody.
        let look = self.gatherer.gather(surface, &frame, self.plan.look_n, hash(point.key), &mut rays);
        if validity.radius(&look) <= 0.0 {
            let incident = self.of_samples(&look, &frame, point, weights);
            self.tell(point, || Step::Gathered { resolution: look.resolution(), record: None });
            return (None, incident, rays);
        }
        let samples = self.gatherer.gather(surface, &frame, self.plan.n, point.key, &mut rays);
        let incident = self.of_samples(&samples, &frame, point, weights);
        let record = Record::new(surface.p, frame, samples, &self.plan.record, &validity);
        self.tell(point, || Step::Gathered {
            resolution: self.plan.n,
            record: Some(RecordFacts::new(&record, surface.p)),
        });
        (Some(record), incident, rays)
    }

    /// The light of a point that has samples of its own.
    fn of_samples(&self, samples: &Samples, frame: &Frame, point: &SurfacePoint, weights: &mut Vec<Vec3>) -> Incident {
        let [near, sky] = samples.mean_radiance_by_distance();
        let mut glossy = Vec3::ZERO;
        if needs_texture(&point.shading, self.plan) {
            self.weigh(&point.shading, frame, samples.resolution(), point.key, weights);
            let texels = samples.radiance.iter().zip(&samples.background_share).zip(weights.iter());
            // What is infinitely far is the sky: direct light, which the glossy lobe has by sampling.
            glossy = texels.map(|((&l, &share), &w)| l * (1.0 - share) * w).sum();
        }
        Incident { near, sky, glossy, reach: samples.harmonic_distance() }
    }

    /// Tells the witness, if there is one.
    #[inline]
    fn tell(&self, point: &SurfacePoint, step: impl FnOnce() -> Step) {
        if let Some(witness) = self.witness {
            witness.tell(point, step);
        }
    }

    fn weigh(&self, shading: &Shading, frame: &Frame, n: usize, key: u64, weights: &mut Vec<Vec3>) {
        lobe_weights(shading, frame, n, self.plan.lobe_samples, key, weights);
    }
}
