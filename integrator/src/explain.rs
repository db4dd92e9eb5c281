//! Why one pixel looks as it does: what became of each of its surface points while the whole picture was made.
//!
//! A [`Witness`] stands beside a normal rendering and writes down what is decided at the points of one pixel. Where
//! nobody asks, there is none, and each point costs a comparison.

use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, PoisonError};

use glam::{UVec2, Vec3, Vec3A};
use radcache::Record;
use reproject::{Parts, Shares, Verdict};
use scene::Scene;

use crate::film::{Band, Terms};
use crate::lattice::Lattice;
use crate::render::render_watched;
use crate::surface_points::{PixelPoints, SurfacePoint};
use crate::terms::indirect::Incident;
use crate::{Progress, Settings, SettingsError, Statistics};

/// What is known of one pixel after its picture was made.
#[derive(Debug, Clone, PartialEq)]
pub struct Explanation {
    /// Its light by terms, as the film has it.
    pub terms: Terms,
    /// The distinct surfaces that it shows; none by [`Method::Path`](crate::Method::Path).
    pub points: Vec<PointExplanation>,
    /// What the whole picture took.
    pub statistics: Statistics,
}

/// One surface in the pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct PointExplanation {
    /// The point that stands for the surface, world space.
    pub p: Vec3A,
    /// Its shading normal.
    pub n: Vec3A,
    /// Index of its material in the scene.
    pub material: u32,
    /// Whether it is seen in a mirror or through glass.
    pub behind_mirror: bool,
    /// Width of the pixel there, metres.
    pub footprint: f32,
    /// The pixel's light for one unit of mean incident radiance: share of the pixel times what reflects there and on
    /// the way.
    pub diffuse_weight: Vec3,
    /// What was done, in order.
    pub steps: Vec<Step>,
    /// Mean incident radiance over the cosine-weighted hemisphere from what stands at a distance: L_i, of the term
    /// `indirect`.
    pub near: Vec3,
    /// The same from the soft part of the sky, of the term `direct`.
    pub sky: Vec3,
    /// Radiance that the glossy lobe reflects from a texture, of the term `specular`; 0 where there is no such lobe.
    pub glossy: Vec3,
}

/// What was done for a point.
#[derive(Debug, Clone, PartialEq)]
pub enum Step {
    /// Records of irradiance reach it, and it takes the weighted mean of what they say.
    Interpolated {
        /// Those that reach it, the weightiest first.
        records: Vec<IrradianceFacts>,
    },
    /// No record serves its place and normal.
    NoRecord,
    /// Verification rays met something else than a record says.
    Refused {
        /// The record.
        record: RecordFacts,
        /// What the rays found, those of the second look in their place where there was one.
        verdict: Verdict,
    },
    /// A record was reprojected to it.
    Reprojected {
        /// The record.
        record: RecordFacts,
        /// What the first verification rays found.
        verdict: Verdict,
        /// What the second found, where the first were in doubt.
        second_verdict: Option<Verdict>,
        /// How much of its hemisphere came from the record.
        shares: Shares,
        /// What became of its hemisphere on the way from there.
        parts: Parts,
        /// Rays traced through what the record does not fill.
        hole_rays: usize,
    },
    /// Rays were traced into its hemisphere.
    Gathered {
        /// Through so many texels along a side, several where one is divided.
        resolution: usize,
        /// The record that was made of it, unless it would serve nobody.
        record: Option<RecordFacts>,
    },
    /// Light changes within it more than records can tell, or none reaches its ends: rays were traced from several of
    /// its places.
    Spread {
        /// As many.
        places: usize,
        /// Texels of each along a side.
        resolution: usize,
    },
}

/// A record of irradiance, as seen from a point that it reaches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IrradianceFacts {
    /// Where it was made.
    pub centre: Vec3A,
    /// Distance of the point from there, metres.
    pub distance: f32,
    /// How far it serves where it serves farthest, metres.
    pub reach: f32,
    /// Its part in the mean.
    pub share: f32,
    /// Mean incident radiance at the point by what it tells, its gradients included, from surfaces and the soft sky.
    pub radiance: Vec3,
}

/// A record of radiance, as seen from a point that asks it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordFacts {
    /// Where it was made.
    pub centre: Vec3A,
    /// Distance of the point from there, metres.
    pub distance: f32,
    /// How far it serves, metres.
    pub radius: f32,
    /// Elements that it holds, in all layers.
    pub elements: usize,
    /// Layers of them.
    pub layers: usize,
}

impl RecordFacts {
    pub(crate) fn new(record: &Record, p: Vec3A) -> Self {
        let (centre, elements) = (record.centre(), record.elements());
        let distance = centre.distance(p);
        Self { centre, distance, radius: record.radius(), elements: elements.len(), layers: elements.layer_count() }
    }
}

/// Makes the picture as [`render`](crate::render) does, and tells what happened at one pixel.
///
/// # Errors
///
/// When a setting is out of its range, or the pixel is outside of the picture.
pub fn explain(
    scene: &Scene,
    settings: &Settings,
    pixel: UVec2,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Explanation, SettingsError> {
    settings.validate()?;
    if pixel.cmpge(settings.size).any() {
        return Err(SettingsError::Pixel { pixel, size: settings.size });
    }
    let witness = Witness::new(pixel);
    let rendering = render_watched(scene, settings, progress, Some(&witness))?;
    let points = witness.points.into_inner().unwrap_or_else(PoisonError::into_inner);
    let terms = rendering.film.terms(pixel.y as usize * settings.size.x as usize + pixel.x as usize);
    Ok(Explanation { terms, points, statistics: rendering.statistics })
}

/// Writes down what happens at the points of one pixel.
#[derive(Debug)]
pub(crate) struct Witness {
    pixel: UVec2,
    /// The pixel's number in the band that is being made; [`ELSEWHERE`] in all other bands.
    number: AtomicU32,
    /// What happened, by the keys of points.
    steps: Mutex<Vec<(u64, Step)>>,
    points: Mutex<Vec<PointExplanation>>,
}

/// No pixel of a band: bands are smaller.
const ELSEWHERE: u32 = u32::MAX;

impl Witness {
    fn new(pixel: UVec2) -> Self {
        Self { pixel, number: AtomicU32::new(ELSEWHERE), steps: Mutex::default(), points: Mutex::default() }
    }

    /// Begins a band of whole rows.
    pub(crate) fn enter(&self, band: &Band<'_>, width: u32) {
        let first_row = band.position(0).y;
        let rows = u32::try_from(band.pixel_count()).expect("a band is small") / width;
        let inside = (first_row..first_row + rows).contains(&self.pixel.y);
        let number = if inside { (self.pixel.y - first_row) * width + self.pixel.x } else { ELSEWHERE };
        self.number.store(number, Ordering::Relaxed);
    }

    /// Writes down a step, if the point is of the pixel. Steps of one point come in their order: no two threads have
    /// one point.
    #[inline]
    pub(crate) fn tell(&self, point: &SurfacePoint, step: impl FnOnce() -> Step) {
        if point.pixel == self.number.load(Ordering::Relaxed) {
            self.steps.lock().unwrap_or_else(PoisonError::into_inner).push((point.key, step()));
        }
    }

    /// Ends a band of `pixels`, whose points have got their light.
    pub(crate) fn leave(&self, pixels: &[PixelPoints], lattice: &Lattice<'_>, values: &[Incident]) {
        let number = self.number.load(Ordering::Relaxed);
        let Some(pixel) = pixels.get(number as usize) else { return };
        let steps = self.steps.lock().unwrap_or_else(PoisonError::into_inner);
        let of_pixel = lattice.points().iter().zip(values).filter(|(point, _)| point.pixel == number);
        let explained = of_pixel.map(|(point, value)| {
            let surface = &point.shading.surface;
            PointExplanation {
                p: surface.p,
                n: surface.n,
                material: surface.material,
                behind_mirror: point.chain != 0,
                footprint: point.footprint,
                diffuse_weight: point.diffuse_weight / pixel.samples as f32,
                steps: steps.iter().filter(|(key, _)| *key == point.key).map(|(_, step)| step.clone()).collect(),
                near: value.near,
                sky: value.sky,
                glossy: value.glossy,
            }
        });
        self.points.lock().unwrap_or_else(PoisonError::into_inner).extend(explained);
    }
}
