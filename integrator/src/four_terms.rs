//! The four-term integrator (eq. 7): the picture in bands, each from primary rays over surface points to the film.

use glam::UVec2;
use rayon::prelude::*;
use scene::Scene;

use crate::allocation::{Allocation, FirstSamples};
use crate::explain::Witness;
use crate::film::{Band, Film, Pixel, Terms};
use crate::gather::Gatherer;
use crate::irradiance_cache::{self, Recorder};
use crate::lattice::Lattice;
use crate::plan::Plan;
use crate::record_points::{RecordPoint, record_points};
use crate::rungs::Rungs;
use crate::sampler::hash_pair;
use crate::secondary::Secondary;
use crate::sky::SkySplit;
use crate::statistics::{Progress, RayCounts, Statistics};
use crate::surface_points::{PixelPoints, Primary};
use crate::terms::direct_fit::DirectFit;
use crate::terms::indirect::{Counts, Incident, IndirectTerm};
use crate::terms::reuse::{LobeAllocation, share_lobes};
use crate::{Method, Settings};

/// A band holds about so many pixels: enough for the lattice and for many cores, and a bound on the memory for surface
/// points.
const BAND_PIXELS: u32 = 1 << 17;

/// Renders with four terms, by the cache or by brute force. Returns the records too, where they are asked for.
pub(crate) fn render<S: Secondary>(
    scene: &Scene,
    settings: &Settings,
    plan: &Plan,
    secondary: &S,
    sky: Option<&SkySplit>,
    statistics: &mut Statistics,
    progress: &(dyn Fn(Progress) + Sync),
    witness: Option<&Witness>,
) -> (Film, Vec<RecordPoint>) {
    let mut film = Film::new(settings.size);
    film.rungs = settings.rungs.then(|| vec![Rungs::default(); film.pixel_count()]);
    let Settings { size, seed, .. } = *settings;
    let mut primary = Primary { scene, plan, secondary, sky, guide: None, light_guide: None, size, seed };
    statistics.time("direct", |statistics| primary.learn_guides(&mut statistics.rays));
    let has_cache = settings.method != Method::Gather;
    let indirect = IndirectTerm {
        gatherer: Gatherer {
            scene,
            secondary,
            sky,
            divide: plan.records.divide,
            highlights: plan.records.highlights,
            seed: settings.seed ^ GATHER_STREAM,
        },
        plan,
        recorder: has_cache.then(|| Recorder::new(&plan.records)),
        size,
        witness,
    };
    let mut index = radcache::Index::new(plan.records.validity(0.0));
    let mut irradiance = irradiance_cache::Index::new(plan.records.clamp);
    let mut counts = Counts::default();
    let mut samples = 0;
    let rows = (BAND_PIXELS / settings.size.x).max(1);
    let mut direct_fit = plan.samples.fits_direct.then(|| DirectFit::new(size.x as usize));
    let mut bands = film.bands_mut(rows);
    let count = bands.len();
    let whole = (count > 1).then(|| statistics.time("direct", |statistics| decide(&primary, &mut statistics.rays)));
    for number in 0..count {
        let band = &mut bands[number];
        let done = number as f32 / count as f32;
        if let Some(witness) = witness {
            witness.enter(band, settings.size.x);
        }
        progress(Progress { phase: "direct", done });
        let pixels = statistics.time("direct", |_| trace_primary(&primary, band, whole.as_ref()));
        for pixel in &pixels {
            samples += u64::from(pixel.samples);
            statistics.rays += pixel.rays;
            statistics.surface_points += pixel.points.len() as u64;
        }
        progress(Progress { phase: "indirect", done });
        let lattice = Lattice::new(settings.size.x as usize, &pixels);
        let values = statistics.time("indirect", |_| match settings.method {
            Method::Gather => indirect.gather_all(lattice.points(), &mut counts),
            Method::CacheOnly => {
                let ask = |todo, stride, counts: &mut Counts| indirect.gather_level(&lattice, todo, stride, counts);
                irradiance_cache::fill(&indirect, &lattice, &mut irradiance, &mut counts, ask)
            }
            Method::Reproject | Method::Path => {
                let ask =
                    |todo, stride, counts: &mut Counts| indirect.reproject(&lattice, todo, stride, &mut index, counts);
                irradiance_cache::fill(&indirect, &lattice, &mut irradiance, &mut counts, ask)
            }
        });
        if let Some(witness) = witness {
            witness.leave(&pixels, &lattice, &values);
        }
        statistics.time("film", |statistics| {
            develop(band, &pixels, &lattice, &values, secondary, statistics);
        });
        if let Some(direct_fit) = &mut direct_fit {
            let changes = statistics.time("direct", |_| direct_fit.fit(&pixels, number + 1 == count));
            let length = rows as usize * size.x as usize;
            for (pixel, change) in changes {
                bands[pixel / length].change_direct(pixel % length, change);
            }
        }
    }
    progress(Progress { phase: "indirect", done: 1.0 });
    add_counts(statistics, &counts);
    #[expect(clippy::cast_possible_truncation, reason = "a pixel takes fewer than 2^32 samples")]
    let mean_spp = samples.div_ceil(u64::from(settings.size.element_product())) as u32;
    statistics.spp = mean_spp;
    statistics.records = index.len() as u64;
    statistics.irradiance_records = irradiance.len() as u64;
    statistics.memory.records = index.memory_bytes() as u64;
    statistics.memory.irradiance_records = irradiance.memory_bytes() as u64;
    statistics.memory.film = film.memory_bytes();
    let records = if settings.records { record_points(&index, &irradiance) } else { Vec::new() };
    (film, records)
}

/// Keeps the random numbers of gathers apart from those of primary rays.
const GATHER_STREAM: u64 = 0x6761_7468_6572;

/// What is decided for the whole picture, so that its bands are all as good: where all of the noise is in one of them,
/// that alone would have to take as many more samples as there are bands.
struct Decisions {
    ambient: f32,
    allocation: Allocation,
    lobes: Option<LobeAllocation>,
}

/// Decides by the first samples of blocks from all over the picture.
fn decide<S: Secondary>(primary: &Primary<'_, S>, rays: &mut RayCounts) -> Decisions {
    /// Pixels along a side of a block; a multiple of the side of the tiles that share lobes.
    const SIDE: u32 = 8;
    /// One block for each square of so many pixels a side, or of more: at most about so many blocks.
    const STRIDE: u32 = 32;
    const BLOCKS: u32 = 1 << 10;
    /// Keeps the places of blocks apart from all else that is random.
    const STREAM: u64 = 0x626c_6f63_6b73;
    let Primary { plan, size, seed, .. } = *primary;
    let stride = (size.element_product() / BLOCKS).isqrt().max(STRIDE);
    let (squares, side) = (size.map(|length| length.div_ceil(stride)), UVec2::splat(SIDE).min(size));
    let block = (side.x as usize, side.y as usize);
    let corner = |number: u32| {
        let square = UVec2::new(number % squares.x, number / squares.x) * stride;
        let random = hash_pair(seed ^ STREAM, number.into());
        #[expect(clippy::cast_possible_truncation, reason = "both halves of a random number")]
        let offset = UVec2::new(random as u32, (random >> 32) as u32) % (stride - SIDE + 1);
        (square + offset).min(size - side)
    };
    let positions = (0..squares.element_product()).flat_map(|number| {
        let corner = corner(number);
        (0..side.element_product()).map(move |pixel| corner + UVec2::new(pixel % side.x, pixel / side.x))
    });
    let positions: Vec<(u32, UVec2)> = (0..).zip(positions).collect();
    let pixels: Vec<PixelPoints> = positions
        .into_par_iter()
        .map(|(number, position)| {
            let mut pixel = PixelPoints::default();
            primary.trace(position, number, plan.samples.first_spp, &mut pixel);
            pixel
        })
        .collect();
    pixels.iter().for_each(|pixel| *rays += pixel.rays);
    let ambient = ambient(&pixels, primary.secondary);
    let allocation =
        Allocation::new(block, plan.samples.first_spp, plan.samples.budget, &first_samples(&pixels), ambient);
    let direct = primary.direct_term();
    let lobes = LobeAllocation::new(&direct, block, &pixels, size, seed, ambient, rays);
    Decisions { ambient, allocation, lobes }
}

fn first_samples(pixels: &[PixelPoints]) -> Vec<FirstSamples> {
    pixels.par_iter().map(|pixel| FirstSamples { noise: pixel.noise, rays: pixel.rays.total() }).collect()
}

/// Traces the primary rays of a band: the first samples of all pixels, then more where there is noise. The band decides
/// for itself where that is, unless it was decided for the whole picture.
fn trace_primary<S: Secondary>(
    primary: &Primary<'_, S>,
    band: &Band<'_>,
    whole: Option<&Decisions>,
) -> Vec<PixelPoints> {
    let trace = |index: usize, samples: u32, pixel: &mut PixelPoints| {
        primary.trace(band.position(index), u32::try_from(index).expect("a band is small"), samples, pixel);
    };
    let Primary { plan, size, seed, .. } = *primary;
    let start = |index: usize| {
        let mut pixel = PixelPoints::default();
        trace(index, plan.samples.first_spp, &mut pixel);
        pixel
    };
    let mut pixels: Vec<PixelPoints> = (0..band.pixel_count()).into_par_iter().map(start).collect();
    let first = first_samples(&pixels);
    let width = size.x as usize;
    let ambient = whole.map_or_else(|| ambient(&pixels, primary.secondary), |whole| whole.ambient);
    let allocation = whole.map_or_else(
        || Allocation::new((width, pixels.len() / width), plan.samples.first_spp, plan.samples.budget, &first, ambient),
        |whole| whole.allocation,
    );
    pixels
        .par_iter_mut()
        .zip(allocation.factors(width, &first))
        .enumerate()
        .for_each(|(index, (pixel, factor))| trace(index, plan.samples.first_spp * factor, pixel));
    share_lobes(&primary.direct_term(), &mut pixels, size, seed, ambient, whole.and_then(|whole| whole.lobes));
    pixels
}

/// About the radiance of the indirect light on what is seen: the mean over some pixels, as far as the secondary
/// solution knows it.
fn ambient<S: Secondary>(pixels: &[PixelPoints], secondary: &S) -> f32 {
    const STEP: usize = 61;
    let points = pixels.iter().step_by(STEP).flat_map(|pixel| &pixel.points);
    let known = points.filter_map(|point| secondary.irradiance(&point.shading.surface));
    let (sum, count) =
        known.fold((0.0, 0.0f32), |(sum, count), known| (sum + known.indirect.element_sum() / 3.0, count + 1.0));
    sum / count.max(1.0) * std::f32::consts::FRAC_1_PI
}

/// Adds what the cache knows of each surface point, and its caustic, to the light of its pixel.
fn develop<S: Secondary>(
    band: &mut Band<'_>,
    pixels: &[PixelPoints],
    lattice: &Lattice<'_>,
    values: &[Incident],
    secondary: &S,
    statistics: &mut Statistics,
) {
    let points = lattice.points();
    let terms: Vec<Terms> = points
        .par_iter()
        .zip(values)
        .map(|(point, value)| {
            let glossy = point.specular_weight * value.glossy;
            let (direct, rest) = (point.diffuse_weight * value.sky, point.diffuse_weight * value.near);
            let caustic = point.caustic(secondary, point.lit.sum + direct + glossy + rest);
            if point.chain == 0 {
                Terms { direct, specular: glossy, caustic, indirect: rest, ..Terms::default() }
            } else {
                // Seen in mirrors or glass: all of it is what those reflect.
                Terms { specular: direct + glossy + caustic + rest, ..Terms::default() }
            }
        })
        .collect();
    let developed: Vec<(Pixel, Rungs, u64)> = pixels
        .par_iter()
        .enumerate()
        .map(|(index, pixel)| {
            let PixelPoints { mut sum, mut dropped, samples, .. } = *pixel;
            // The weights of points are sums over their samples, as the light of samples is.
            for terms in &terms[lattice.of_pixel(index)] {
                if terms.is_finite() {
                    sum.add_terms(terms);
                } else {
                    dropped += 1;
                }
            }
            let mut rungs = Rungs::default();
            for number in lattice.of_pixel(index) {
                rungs.add(values[number].rung, points[number].spread.count / samples as f32);
            }
            (sum.mean(samples), rungs, dropped)
        })
        .collect();
    for (index, (pixel, rungs, dropped)) in developed.iter().enumerate() {
        statistics.dropped_samples += dropped;
        band.set(index, pixel);
        band.set_rungs(index, *rungs);
    }
}

fn add_counts(statistics: &mut Statistics, counts: &Counts) {
    statistics.rays += counts.rays;
    statistics.reprojected = counts.reprojected;
    statistics.interpolated = counts.interpolated;
    statistics.gathered = counts.gathered;
    let mean = |sum: f64| if counts.reprojected > 0 { sum / counts.reprojected as f64 } else { 0.0 };
    statistics.share_filled = mean(counts.filled);
    statistics.share_unknown = mean(counts.unknown);
    statistics.share_holes = mean(counts.holes);
}
