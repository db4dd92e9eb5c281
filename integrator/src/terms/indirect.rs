//! The fourth term of eq. 7, indirect light on diffuse surfaces, and with it the soft sky and the gloss that textures
//! carry: from the cache of records, or gathered at every point.
//!
//! A point that looks for itself has a record of radiance reprojected to it; one that no record serves, or whose
//! verification rays disagree with what they meet, gathers, and becomes a record of radiance itself where that may serve
//! others. Records are made in batches of fixed order and frozen while they are read, so the result does not depend on
//! the number of threads.
//!
//! Diffuse points need not all look for themselves: what one sees, by reprojection or by a gather, makes it a record of
//! irradiance with derivatives, and those around it take their light from that ([`irradiance_cache`]).

use glam::{UVec2, Vec3};
use hemimap::Frame;
use radcache::{Index, Record, Samples, Validity};
use rayon::prelude::*;
use reproject::{Parts, Shares, Verdict, Workspace};

use super::glossy::{lobe_weights, thin_holes};
use crate::explain::{RecordFacts, Step, Witness};
use crate::gather::{Gatherer, PointTracer};
use crate::irradiance_cache::{self, Recorder};
use crate::lattice::Lattice;
use crate::plan::{Plan, RecordPlan};
use crate::rungs::Rung;
use crate::sampler::{hash, hash_pair};
use crate::secondary::Secondary;
use crate::statistics::{RayCounts, map_counting};
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
    /// How it was found.
    pub(crate) rung: Rung,
}

/// What a point found by looking for itself.
#[derive(Debug)]
pub(crate) struct Look {
    pub(crate) incident: Incident,
    /// What others may take of it: nothing where gloss needs a texture, or where no cache is kept.
    pub(crate) record: Option<irradiance_cache::Record>,
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
    pub(crate) holes: f64,
}

impl Look {
    /// The same, found in this way.
    fn by(mut self, rung: Rung) -> Self {
        self.incident.rung = rung;
        self
    }
}

/// Evaluates points of the picture.
#[derive(Debug)]
pub(crate) struct IndirectTerm<'a, S> {
    pub(crate) gatherer: Gatherer<'a, S>,
    pub(crate) plan: &'a Plan,
    /// Makes records of irradiance, where there is a cache.
    pub(crate) recorder: Option<Recorder<'a>>,
    /// The size of the picture, pixels.
    pub(crate) size: UVec2,
    /// Who writes down what happens at the points of one pixel, if anybody does.
    pub(crate) witness: Option<&'a Witness>,
}

/// Smallest batch of records, and the share of the missing ones that a batch takes: a batch must leave room for its
/// records to serve the rest.
const MIN_BATCH: usize = 64;
const BATCH_SHARE: usize = 4;

/// What became of a point that asked the cache.
enum Answer {
    /// A record served it.
    Served(Look, Shares, RayCounts),
    /// It looked for itself: that took fewer rays than a record left to it, or it was asked so late that none is made.
    Looked(Look, RayCounts),
    /// It must become a record.
    Missing(RayCounts),
}

/// How a point looks for itself where no record serves it.
#[derive(Clone, Copy)]
struct OwnLook {
    /// Texels along a side.
    n: usize,
    /// Whether it serves this point alone: no record of radiance comes of it.
    is_last: bool,
}

/// Buffers of a thread.
struct Buffers {
    workspace: Workspace,
    weights: Vec<Vec3>,
    samples: Samples,
}

impl Default for Buffers {
    fn default() -> Self {
        Self { workspace: Workspace::new(), weights: Vec::new(), samples: Samples::new(1) }
    }
}

impl<S: Secondary> IndirectTerm<'_, S> {
    /// Gathers at every point, without a cache.
    pub(crate) fn gather_all(&self, points: &[&SurfacePoint], counts: &mut Counts) -> Vec<Incident> {
        let mut values = vec![Incident::default(); points.len()];
        let todo = (0..points.len()).filter(|&number| self.asks(points[number])).collect();
        let RecordPlan { n, look_n, .. } = self.plan.records;
        // A lobe is seen by its own point alone.
        let reads_texture = |number: usize| self.plan.lobes.reads_texture(&points[number].shading);
        let resolution = |number| if reads_texture(number) { look_n } else { n };
        for (number, look) in self.gather(points, todo, resolution, counts) {
            values[number] = look.incident;
        }
        values
    }

    /// Gathers at the points `todo`, which a lattice of this `stride` asks.
    pub(crate) fn gather_level(
        &self,
        lattice: &Lattice<'_>,
        todo: Vec<usize>,
        stride: usize,
        counts: &mut Counts,
    ) -> Vec<(usize, Look)> {
        let crowd_rays = self.crowd_rays(lattice, todo.len());
        let resolution = |number| self.own_look(lattice, number, stride, crowd_rays).n;
        self.gather(lattice.points(), todo, resolution, counts)
    }

    /// Gathers at the points `todo`, with the resolution that each has.
    fn gather(
        &self,
        points: &[&SurfacePoint],
        todo: Vec<usize>,
        resolution: impl Fn(usize) -> usize + Sync,
        counts: &mut Counts,
    ) -> Vec<(usize, Look)> {
        counts.gathered += todo.len() as u64;
        map_counting(todo.into_par_iter(), &mut counts.rays, |number, rays| {
            let point = points[number];
            let n = resolution(number);
            let frame = Frame::from_normal(point.shading.surface.n);
            let samples = self.gatherer.gather(&point.shading.surface, &frame, n, point.key, rays);
            self.tell(point, || Step::Gathered { resolution: n, record: None });
            (number, self.look_of(&samples, &frame, point, &mut Vec::new()).by(Rung::Gathered))
        })
    }

    /// Whether anything of a point is lit by a texture: a narrow lobe alone is traced.
    pub(crate) fn asks(&self, point: &SurfacePoint) -> bool {
        point.shading.bsdf.has_diffuse() || self.plan.lobes.reads_texture(&point.shading)
    }

    /// Reprojects to the points `todo`, which a lattice of this `stride` asks, in passes: what the records can serve is
    /// served, a batch of the others becomes records, and the rest asks again.
    pub(crate) fn reproject(
        &self,
        lattice: &Lattice<'_>,
        mut todo: Vec<usize>,
        stride: usize,
        index: &mut Index,
        counts: &mut Counts,
    ) -> Vec<(usize, Look)> {
        let mut looks = Vec::with_capacity(todo.len());
        let points = lattice.points();
        let crowd_rays = self.crowd_rays(lattice, todo.len());
        let look = |number| self.own_look(lattice, number, stride, crowd_rays);
        while !todo.is_empty() {
            let frozen = &*index;
            let answers: Vec<Answer> = todo
                .par_iter()
                .map_init(Buffers::default, |buffers, &number| self.ask(frozen, points[number], look(number), buffers))
                .collect();
            let mut missing = Vec::new();
            for (&number, answer) in todo.iter().zip(answers) {
                match answer {
                    Answer::Served(look, shares, rays) => {
                        looks.push((number, look));
                        counts.rays += rays;
                        counts.reprojected += 1;
                        counts.filled += f64::from(shares.filled);
                        counts.unknown += f64::from(shares.unknown);
                        counts.holes += f64::from(shares.holes);
                    }
                    Answer::Looked(look, rays) => {
                        looks.push((number, look.by(Rung::Gathered)));
                        counts.rays += rays;
                        counts.gathered += 1;
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
            let made: Vec<(Option<Record>, Look, RayCounts)> = missing[..batch]
                .par_iter()
                .map_init(Vec::new, |weights, &number| self.make_record(points[number], look(number).n, weights))
                .collect();
            for (&number, (record, look, rays)) in missing.iter().zip(made) {
                index.extend(record);
                looks.push((number, look.by(Rung::Gathered)));
                counts.rays += rays;
                counts.gathered += 1;
            }
            todo = missing.split_off(batch);
            todo.sort_unstable();
        }
        looks
    }

    /// [`RecordPlan::crowd_rays`] of so many points of a band.
    fn crowd_rays(&self, lattice: &Lattice<'_>, points: usize) -> f32 {
        RecordPlan::crowd_rays(points, lattice.pixel_count(), self.size.element_product())
    }

    /// How a point that a lattice of this `stride` asks looks for itself, if each of those that ask at once may take this
    /// share of the rays of a full look.
    fn own_look(&self, lattice: &Lattice<'_>, number: usize, stride: usize, crowd_rays: f32) -> OwnLook {
        let records = &self.plan.records;
        if !RecordPlan::is_late(stride) || self.plan.lobes.reads_texture(&lattice.points()[number].shading) {
            return OwnLook { n: records.look_n, is_last: false };
        }
        let rays = crowd_rays * RecordPlan::thin_rays(lattice.share(number));
        OwnLook { n: records.look_n_for(rays), is_last: true }
    }

    /// Asks the cache for a point.
    fn ask(&self, index: &Index, point: &SurfacePoint, own: OwnLook, buffers: &mut Buffers) -> Answer {
        let surface = &point.shading.surface;
        let mut tracer =
            PointTracer { gatherer: &self.gatherer, surface: *surface, key: point.key, rays: RayCounts::default() };
        let look = |mut rays: RayCounts| {
            let (_, _, look) = self.look_for_itself(point, own.n, &mut Vec::new(), &mut rays);
            self.tell(point, || Step::Gathered { resolution: own.n, record: None });
            Answer::Looked(look, rays)
        };
        let miss = |rays: RayCounts| if own.is_last { look(rays) } else { Answer::Missing(rays) };
        let Some(found) = index.best(surface.p, surface.n) else {
            self.tell(point, || Step::NoRecord);
            return miss(tracer.rays);
        };
        let record = index.record(found.record);
        let Buffers { workspace, weights, samples } = buffers;
        let shares = workspace.project_above(record, surface.p, surface.n, surface.ng, &self.plan.records.reproject);
        let takes_texture = self.plan.lobes.reads_texture(&point.shading);
        let hole_step = self.hole_step(shares.holes, workspace.resolution(), own.n);
        if !takes_texture && hole_step.is_none() {
            return look(tracer.rays);
        }
        let seed = self.seed(point);
        let (holds, verdict, second_verdict) = self.verify(workspace, record, seed, &mut tracer);
        if !holds {
            let verdict = second_verdict.unwrap_or(verdict);
            self.tell(point, || Step::Refused { record: RecordFacts::new(record, surface.p), verdict });
            return miss(tracer.rays);
        }
        let frame = workspace.frame();
        let step = hole_step.unwrap_or(self.plan.records.hole_step);
        let hole_rays = if takes_texture {
            self.weigh(point, &frame, workspace.resolution(), weights);
            thin_holes(weights, workspace.masks(), workspace.resolution(), seed);
            workspace.trace_holes_under(weights, step, seed, &mut tracer)
        } else {
            workspace.trace_holes(step, seed, &mut tracer)
        };
        let parts = if self.plan.records.tells_parts { workspace.parts(record) } else { Parts::default() };
        self.tell(point, || {
            let (record, parts) = (RecordFacts::new(record, surface.p), workspace.parts(record));
            Step::Reprojected { record, verdict, second_verdict, shares, parts, hole_rays }
        });
        let [near, sky] = workspace.mean_radiance_by_distance();
        let mut incident = Incident { near, sky, rung: Rung::reprojected(&shares, &parts), ..Incident::default() };
        if takes_texture {
            // What is infinitely far is the sky: direct light, which the glossy lobe has by sampling.
            [incident.glossy, _] = workspace.weighted_sum_by_distance(record, weights);
            return Answer::Served(Look { incident, record: None }, shares, tracer.rays);
        }
        workspace.samples(record, samples);
        let record = self
            .recorder
            .as_ref()
            .map(|recorder| recorder.record(point, frame, samples, [near, sky], self.plan.records.reprojected_error));
        Answer::Served(Look { incident, record }, shares, tracer.rays)
    }

    /// Asks four rays whether the elements are where the record says, and sixteen more where two of them disagree or
    /// all fell into holes. Whether the record holds, and what the first and the second rays found.
    fn verify(
        &self,
        workspace: &mut Workspace,
        record: &Record,
        seed: u64,
        tracer: &mut PointTracer<'_, S>,
    ) -> (bool, Verdict, Option<Verdict>) {
        /// Where half of the first rays are wrong, a fifth of the second ones refuse the record: four rays alone would
        /// refuse good ones at their silhouettes.
        const REFUSED: f32 = 0.2;
        let side = self.plan.records.verify_side;
        if side == 0 {
            return (true, Verdict::default(), None);
        }
        let share = |verdict: Verdict| verdict.wrong as f32 / verdict.asked.max(1) as f32;
        let first = workspace.verify(record, side, seed, tracer);
        if first.holds() {
            return (true, first, None);
        }
        let second = workspace.verify(record, 2 * side, seed, tracer);
        (share(second) < REFUSED, first, Some(second))
    }

    /// What a point sees by a gather of `look_n x look_n` rays, and the record of radiance that comes of it, if that
    /// would repay its rays.
    fn make_record(
        &self,
        point: &SurfacePoint,
        look_n: usize,
        weights: &mut Vec<Vec3>,
    ) -> (Option<Record>, Look, RayCounts) {
        /// A record must reach at least so many times as far as one of irradiance that the first look makes.
        const REPAID: f32 = 0.7;
        /// And so many times the half length of its point: one that hardly reaches the next pixel serves nobody.
        const LONG: f32 = 3.0;
        let surface = &point.shading.surface;
        let mut rays = RayCounts::default();
        let validity: Validity = self.plan.records.validity(point.footprint);
        let (samples, frame, look) = self.look_for_itself(point, look_n, weights, &mut rays);
        let beside = LONG * point.half_length();
        let enough = look.record.as_ref().map_or(0.0, |record| (REPAID * record.reach()).max(beside));
        // Highlights are traced anew wherever the record is reprojected.
        let marked = samples.view_dependent.iter().filter(|marked| **marked).count() as f32;
        let holes = marked / samples.view_dependent.len() as f32;
        let is_worth = self.plan.lobes.reads_texture(&point.shading)
            || self.hole_step(holes, self.plan.records.n, look_n).is_some();
        // What one texel shows or not, elements cannot carry to other places.
        if !is_worth || validity.radius(&samples) <= enough || irradiance_cache::is_lit_by_few(&samples) {
            self.tell(point, || Step::Gathered { resolution: samples.resolution(), record: None });
            return (None, look, rays);
        }
        let samples = self.gatherer.gather(surface, &frame, self.plan.records.n, point.key, &mut rays);
        let look = self.look_of(&samples, &frame, point, weights);
        // More rays may have met what is so near that the record would serve nobody.
        let record = (validity.radius(&samples) > 0.0)
            .then(|| Record::new(surface.p, frame, samples, &self.plan.records.record, &validity));
        self.tell(point, || Step::Gathered {
            resolution: self.plan.records.n,
            record: record.as_ref().map(|record| RecordFacts::new(record, surface.p)),
        });
        (record, look, rays)
    }

    /// [`hole_step`] of a reprojection of n x n texels, against a ray for each texel of a look: more, where texels are
    /// divided, tell it more too.
    fn hole_step(&self, holes: f32, n: usize, look_n: usize) -> Option<u32> {
        hole_step(holes * (n * n) as f32, (look_n * look_n) as f32, self.plan.records.hole_step)
    }

    /// What a point sees through `look_n x look_n` texels of its own, in which frame, and what it has of that.
    fn look_for_itself(
        &self,
        point: &SurfacePoint,
        look_n: usize,
        weights: &mut Vec<Vec3>,
        rays: &mut RayCounts,
    ) -> (Samples, Frame, Look) {
        let surface = &point.shading.surface;
        let frame = Frame::from_normal(surface.n);
        let samples = self.gatherer.gather(surface, &frame, look_n, hash(point.key), rays);
        let look = self.look_of(&samples, &frame, point, weights);
        (samples, frame, look)
    }

    /// What a point has of samples of its own.
    fn look_of(&self, samples: &Samples, frame: &Frame, point: &SurfacePoint, weights: &mut Vec<Vec3>) -> Look {
        let mean = samples.mean_radiance_by_distance();
        let [near, sky] = mean;
        let mut incident = Incident { near, sky, ..Incident::default() };
        if self.plan.lobes.reads_texture(&point.shading) {
            self.weigh(point, frame, samples.resolution(), weights);
            let texels = samples.radiance.iter().zip(&samples.background_share).zip(weights.iter());
            // What is infinitely far is the sky: direct light, which the glossy lobe has by sampling.
            incident.glossy = texels.map(|((&l, &share), &w)| l * (1.0 - share) * w).sum();
            return Look { incident, record: None };
        }
        let record = self
            .recorder
            .as_ref()
            .map(|recorder| recorder.record(point, *frame, samples, mean, self.plan.records.error));
        Look { incident, record }
    }

    /// Tells the witness, if there is one.
    #[inline]
    pub(crate) fn tell(&self, point: &SurfacePoint, step: impl FnOnce() -> Step) {
        if let Some(witness) = self.witness {
            witness.tell(point, step);
        }
    }

    /// Names a point to generators of random numbers.
    fn seed(&self, point: &SurfacePoint) -> u64 {
        hash_pair(self.gatherer.seed, point.key)
    }

    fn weigh(&self, point: &SurfacePoint, frame: &Frame, n: usize, weights: &mut Vec<Vec3>) {
        lobe_weights(&point.shading, frame, n, self.seed(point), weights);
    }
}

/// The side of the smallest blocks of texels, up to `most`, for which a ray a block through so many texels of holes is
/// a better use of rays than a look of so many; `None` where the look is.
fn hole_step(texels: f32, look_rays: f32, most: u32) -> Option<u32> {
    /// The rays that holes may take, as a share of those of a look: what so few rays see of the holes has the noise of
    /// a look.
    const WORTH: f32 = 0.5;
    (1..=most).find(|step| texels / (step * step) as f32 <= WORTH * look_rays)
}

#[cfg(test)]
mod tests {
    use super::hole_step;

    #[test]
    fn holes_are_looked_through_as_finely_as_half_of_a_look_allows() {
        for (texels, most, expected) in [
            (0.0, 2, Some(1)),
            (200.0, 2, Some(1)),
            (201.0, 2, Some(2)),
            (800.0, 2, Some(2)),
            (801.0, 2, None),
            (801.0, 3, Some(3)),
            (201.0, 1, None),
        ] {
            assert_eq!(hole_step(texels, 400.0, most), expected, "{texels} texels, blocks of up to {most}");
        }
    }
}
