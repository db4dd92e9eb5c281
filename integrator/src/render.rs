//! From a scene and settings to a picture: which method, and how long it took.

use std::time::Instant;

use scene::Scene;

use crate::caustic_need::CausticNeed;
use crate::cells::{CellBuilder, CellSource, Cells};
use crate::explain::Witness;
use crate::plan::{CausticBudget, Plan};
use crate::sky::SkySplit;
use crate::{
    Film, Method, PhotonMaps, PhotonSettings, PhotonSource, Progress, RecordPoint, Secondary, SecondaryKind, Settings,
    SettingsError, Statistics, four_terms, hash_pair, path,
};

/// A finished picture and what it took.
#[derive(Debug, Clone, PartialEq)]
pub struct Rendering {
    /// The picture in its terms.
    pub film: Film,
    /// What was counted.
    pub statistics: Statistics,
    /// The records of the cache, where [`Settings::records`] asks for them; of several passes those of the last one.
    pub records: Vec<RecordPoint>,
}

/// Makes a picture of `scene` on all threads of the current rayon pool. The result depends on the scene and the
/// settings alone, never on the number of threads.
///
/// `progress` is called at the start and the end of phases and with each band of the picture, by the path tracer with
/// each row, from any thread; calls may overtake each other by a step.
///
/// # Errors
///
/// When a setting is out of its range, see [`Settings::validate`].
pub fn render(
    scene: &Scene,
    settings: &Settings,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Rendering, SettingsError> {
    render_watched(scene, settings, progress, None)
}

/// As [`render`], with somebody who looks on.
pub(crate) fn render_watched(
    scene: &Scene,
    settings: &Settings,
    progress: &(dyn Fn(Progress) + Sync),
    witness: Option<&Witness>,
) -> Result<Rendering, SettingsError> {
    measured(scene, settings, |statistics| match settings.method {
        Method::Path => (path::render(scene, settings, progress, statistics), Vec::new()),
        Method::Reproject | Method::Gather | Method::CacheOnly => {
            let plan = Plan::new(scene, settings);
            let sky = statistics.time("lights", |_| SkySplit::new(scene));
            let sky = sky.as_ref();
            let mut maps = statistics.time("photons", |_| shoot(scene, settings, &plan, progress));
            let cells = statistics.time("cells", |statistics| {
                solve_cells(scene, settings, &plan, sky, PhotonSource { maps: &maps, scene }, statistics, progress)
            });
            statistics.time("photons", |statistics| refine(scene, settings, &plan, &cells, &mut maps, statistics));
            let photons = PhotonSource { maps: &maps, scene };
            if plan.secondary == SecondaryKind::Photons {
                four_terms::render(scene, settings, &plan, &photons, sky, statistics, progress, witness)
            } else {
                let source = CellSource { cells: &cells, photons };
                four_terms::render(scene, settings, &plan, &source, sky, statistics, progress, witness)
            }
        }
    })
}

/// As [`render`] by any other method than [`Method::Path`], with the caller's own solution for the light at the
/// surfaces that gather rays meet, such as a radiosity solution; it must hold all light there but what it leaves to
/// light sampling (see [`Secondary`]). [`Method::Path`] takes none and ignores it.
///
/// # Examples
///
/// In a box whose walls all shine with 0.5 and reflect half, the radiance is 1 everywhere: a solution in one line.
///
/// ```
/// use std::f32::consts::PI;
///
/// use integrator::{Known, Secondary, Settings, render_with};
/// use scene::glam::{UVec2, Vec3};
/// use scene::{Camera, Description, Material, Mesh, Scene, Surface};
///
/// struct Even;
///
/// impl Secondary for Even {
///     fn irradiance(&self, _: &Surface) -> Option<Known> {
///         let half = Vec3::splat(0.5 * PI); // what shines, and what was reflected at least once
///         Some(Known { direct: Some(half), indirect: half, resolution: 0.0 })
///     }
///
///     fn caustic_irradiance(&self, _: &Surface) -> Vec3 {
///         Vec3::ZERO
///     }
/// }
///
/// // Corner i of the box has x, y and z by its bits; triangles are counter-clockwise as seen from within.
/// let sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
/// let walls = Mesh {
///     positions: (0..8).map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32)).collect(),
///     triangles: sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
///     materials: vec![0; 12],
///     ..Mesh::default()
/// };
/// let half = Vec3::splat(0.5);
/// let scene = Scene::new(Description {
///     meshes: vec![walls],
///     materials: vec![Material { diffuse: half, emission: half, ..Material::default() }],
///     camera: Some(Camera { eye: half, at: Vec3::ONE, up: Vec3::Y, fov_y_degrees: 60.0 }),
///     ..Description::default()
/// })?;
/// let settings = Settings { size: UVec2::new(8, 8), ..Settings::default() };
/// let film = render_with(&scene, &settings, &Even, &|_| ())?.film;
/// assert!(film.picture().iter().all(|pixel| (*pixel - 1.0).abs().max_element() < 0.1)); // light samples have noise
/// assert!(film.indirect.iter().all(|pixel| (*pixel - 0.25).abs().max_element() < 1e-3));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// As [`render`].
pub fn render_with(
    scene: &Scene,
    settings: &Settings,
    secondary: &impl Secondary,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Rendering, SettingsError> {
    if settings.method == Method::Path {
        return render(scene, settings, progress);
    }
    measured(scene, settings, |statistics| {
        let plan = Plan::new(scene, settings);
        let sky = statistics.time("lights", |_| SkySplit::new(scene));
        four_terms::render(scene, settings, &plan, secondary, sky.as_ref(), statistics, progress, None)
    })
}

/// Makes a film, and the records that are asked for, by settings that hold, and tells what it took.
fn measured(
    scene: &Scene,
    settings: &Settings,
    make: impl FnOnce(&mut Statistics) -> (Film, Vec<RecordPoint>),
) -> Result<Rendering, SettingsError> {
    settings.validate()?;
    let start = Instant::now();
    let mut statistics = Statistics::default();
    statistics.memory.scene = scene.memory_bytes() as u64;
    let (film, records) = make(&mut statistics);
    statistics.render_seconds = start.elapsed().as_secs_f64();
    Ok(Rendering { film, statistics, records })
}

/// Solves for the light at secondary hits, if the plan asks for it; no cells otherwise.
fn solve_cells(
    scene: &Scene,
    settings: &Settings,
    plan: &Plan,
    sky: Option<&SkySplit>,
    photons: PhotonSource<'_>,
    statistics: &mut Statistics,
    progress: &(dyn Fn(Progress) + Sync),
) -> Cells {
    if plan.cell_rays == 0 {
        return Cells::default();
    }
    progress(Progress { phase: "cells", done: 0.0 });
    let seed = hash_pair(settings.seed, CELL_STREAM);
    let builder = CellBuilder {
        scene,
        sky,
        photons,
        seed,
        probe_rays: plan.probe_rays,
        ray_budget: plan.cell_rays,
        learns_lights: plan.samples.light_learners > 0,
        guides_gathers: settings.study.gather_guide != Some(false),
    };
    let cells = builder.build(settings.size, &mut statistics.rays);
    statistics.memory.cells = cells.memory_bytes() as u64;
    progress(Progress { phase: "cells", done: 1.0 });
    cells
}

/// Shoots the photons that the plan asks for.
fn shoot(scene: &Scene, settings: &Settings, plan: &Plan, progress: &(dyn Fn(Progress) + Sync)) -> PhotonMaps {
    progress(Progress { phase: "photons", done: 0.0 });
    let maps = PhotonMaps::shoot(scene, &photon_settings(settings, plan));
    progress(Progress { phase: "photons", done: 1.0 });
    maps
}

fn photon_settings(settings: &Settings, plan: &Plan) -> PhotonSettings {
    PhotonSettings {
        global: plan.photons.global > 0,
        caustic: plan.photons.caustic > 0,
        count: plan.photons.global,
        caustic_count: plan.photons.caustic,
        caustic_neighbours: plan.photons.neighbours,
        seed: hash_pair(settings.seed, PHOTON_STREAM),
        ..PhotonSettings::default()
    }
}

/// Shoots more photons where the picture needs them.
fn refine(
    scene: &Scene,
    settings: &Settings,
    plan: &Plan,
    cells: &Cells,
    maps: &mut PhotonMaps,
    statistics: &mut Statistics,
) {
    if let Some(budget) = plan.photons.need
        && maps.has_caustics()
    {
        let Settings { size, seed, .. } = *settings;
        let source = CellSource { cells, photons: PhotonSource { maps, scene } };
        let need = CausticNeed::new(scene, &source, size, budget.side, seed, &mut statistics.rays);
        let refined = |noise: f32| budget.refined(plan.photons.caustic, plan.photons.neighbours, noise);
        if refined(need.most_noise(maps, plan.photons.neighbours)).0 > plan.photons.caustic {
            let photons = photon_settings(settings, plan);
            let twin = maps.caustic_twin(scene, &photons);
            let noise = need.noise(maps, &twin);
            // What was shot already is not thrown away.
            let both = CausticBudget::times(plan.photons.caustic, plan.photons.neighbours, 2.0);
            let (caustic_count, caustic_neighbours) = refined(noise).max(both);
            maps.join_caustics(twin, scene, &PhotonSettings { caustic_count, caustic_neighbours, ..photons });
        }
    }
    statistics.rays += maps.rays;
    statistics.photons_shot = maps.global_counts.shot + maps.caustic_counts.shot;
    statistics.photons_global = maps.global_counts.stored;
    statistics.photons_caustic = maps.caustic_counts.stored;
    statistics.memory.photons = maps.memory_bytes();
}

/// Keep the random numbers of cells and of photons apart from those of everything else.
const CELL_STREAM: u64 = 0x6365_6c6c;
const PHOTON_STREAM: u64 = 0x7068_6f74_6f6e;
