//! A radiosity solution on cells of the surfaces that gather rays meet: all the light of a diffuse surface by one
//! look-up.
//!
//! Probe paths from the picture find the surfaces that count. They are divided into cells, cubes of a grid times six
//! directions of the normal; smaller ones where something stands in them. Each cell holds a few points; from these,
//! light sampling gives its direct light, and cosine-distributed rays link it to the cells that they meet, through
//! mirrors, glass and gloss. The system of the links,
//!
//! ```text
//! E_i = D_i + sum_j W_ij E_j,     W_ij = throughput x albedo_j / number of rays of i
//! ```
//!
//! is solved by iteration. A ray that meets no cell goes on as a path, so no light is lost. Unlike a density of photons
//! this has no edges to be dark at, and costs no photon that does not reach the picture.
//!
//! # Source
//! Cohen, Greenberg 1985 for the system; Binder, Fricke, Keller 2018, "Fast path space filtering by jittered spatial
//! hashing", for the cells. The look-up is not jittered as theirs: gather rays average over cells, and a jittered one
//! may fall behind a wall.

mod guide;
mod lamps;
mod links;
mod probe;
mod solve;
mod table;

use glam::{IVec3, UVec2, Vec3, Vec3A};
use hemimap::Frame;
use rayon::prelude::*;
use scene::{Bsdf, LightChoice, Scene, Specular, Surface};

pub use self::guide::Glint;
use self::guide::Guide;
pub(crate) use self::guide::brightness;
use self::lamps::LampSamples;
use self::probe::{FoundCell, LEVELS, Probes, Slab};
use self::solve::{CellLight, Row, solve};
use self::table::Table;

use crate::Irradiance;
use crate::photons::PhotonSource;
use crate::sampler::{hash, hash_pair};
use crate::secondary::{Known, Secondary, Shading};
use crate::sky::SkySplit;
use crate::statistics::{RayCounts, map_counting};

/// Links are made anew so often where they are guided: those of the second round know more of what is bright.
const GUIDED_ROUNDS: u64 = 2;
/// Keeps the random numbers of these apart.
const GUIDED_STREAM: u64 = 5;

/// Hits nearer than this many widths of a cell are not looked up.
const RESOLUTION_FACTOR: f32 = 2.0;

/// The cells and their light.
#[derive(Debug, Default)]
pub(crate) struct Cells {
    width: f32,
    table: Table,
    /// By the numbers of the table.
    cells: Vec<Cell>,
    /// How lights of the scene are chosen where rays go on from what they met.
    light_choice: Option<LightChoice>,
    /// Where light comes from, where that is from few directions.
    guide: Option<Guide>,
}

#[derive(Debug, Clone, Copy)]
struct Cell {
    /// Metres.
    width: f32,
    slab: Slab,
    light: CellLight,
}

/// What cells are made from.
pub(crate) struct CellBuilder<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) sky: Option<&'a SkySplit>,
    /// For the irradiance by caustics.
    pub(crate) photons: PhotonSource<'a>,
    pub(crate) seed: u64,
    /// Gather rays of each probe: what they meet becomes cells.
    pub(crate) probe_rays: u32,
    /// Number of rays to spend on links, and as many shadow rays; more of these where few cells decide.
    pub(crate) ray_budget: u32,
    /// Whether it is learnt which lights reach the cells.
    pub(crate) learns_lights: bool,
    /// Whether rays go more often to where light was found to come from.
    pub(crate) guides_gathers: bool,
}

impl CellBuilder<'_> {
    /// Finds the cells and solves for their light.
    pub(crate) fn build(&self, size: UVec2, rays: &mut RayCounts) -> Cells {
        let probes = Probes { scene: self.scene, seed: self.seed, rays: self.probe_rays };
        let Some(found) = probes.find(size, rays) else { return Cells::default() };
        let table = Table::new(found.cells.iter().map(|cell| cell.key), &found.cut);
        let dark = |cell: &FoundCell| Cell { width: cell.width, slab: cell.slab, light: CellLight::default() };
        let light_choice = self.light_choice(None, &found.cells, rays);
        let cells = found.cells.iter().map(dark).collect();
        let mut cells = Cells { width: found.width, table, cells, light_choice, guide: None };
        let found = found.cells;
        let under_sky = self.sky.and_then(|sky| self.light_choice(Some(sky), &found, rays));
        let choice = if self.sky.is_some() { under_sky.as_ref() } else { cells.light_choice.as_ref() };
        // What is met more often gets more rays: the noise of its links counts more often.
        let hits: usize = found.iter().map(|cell| cell.hits).sum();
        let budget = self.ray_budget as usize;
        let ray_count =
            |cell: &FoundCell| (budget / (2 * found.len()) + budget * cell.hits / (2 * hits)).clamp(8, 1024);
        let (mut rows, mut lamps): (Vec<Row>, Vec<LampSamples>) = found
            .par_iter()
            .enumerate()
            .map(|(cell, found)| self.row(&cells, choice, cell as u64, &found.points, ray_count(found)))
            .unzip();
        self.add_lamp_samples(&cells, &found, choice, &rows, &mut lamps, rays);
        for (row, lamps) in rows.iter_mut().zip(lamps) {
            row.lamps = lamps.mean();
            *rays += row.rays;
        }
        let mut light = solve(&rows);
        cells.guide = self.guide(&found, &rows, &light);
        for round in 0..GUIDED_ROUNDS {
            let Some(guide) = cells.guide.as_ref().filter(|guide| guide.helps_links()) else { break };
            map_counting(rows.par_iter_mut().zip(&found), rays, |(row, cell), rays| {
                let stream = hash_pair(cell.key, GUIDED_STREAM + round);
                *rays += self.guide_links(&cells, guide, stream, cell, ray_count(cell), row);
            });
            light = solve(&rows);
            cells.guide = self.guide(&found, &rows, &light);
        }
        for (cell, light) in cells.cells.iter_mut().zip(light) {
            cell.light = light;
        }
        cells
    }

    /// What links tell of where light comes from.
    fn guide(&self, found: &[FoundCell], rows: &[Row], light: &[CellLight]) -> Option<Guide> {
        self.guides_gathers.then(|| Guide::new(found, rows, light)).flatten()
    }
}

impl Cells {
    /// Bytes that cells take.
    pub(crate) fn memory_bytes(&self) -> usize {
        let guide = self.guide.as_ref().map_or(0, Guide::memory_bytes);
        self.cells.len() * size_of::<Cell>() + self.table.slots.len() * size_of::<u64>() + guide
    }

    /// The light of the cell of a surface; `None` where there is no cell, one that something divides, or one of another
    /// sheet.
    pub(crate) fn look_up(&self, surface: &Surface) -> Option<Known> {
        let Cell { width, light: CellLight { direct, indirect, .. }, .. } = self.cells[self.cell_of(surface)? as usize];
        Some(Known { direct: Some(direct), indirect, resolution: RESOLUTION_FACTOR * width })
    }

    fn cell_of(&self, surface: &Surface) -> Option<u32> {
        let mut width = self.width;
        for level in 0..LEVELS {
            let cell = self.table.find(key(surface, width, level))?;
            if cell != Table::CUT {
                return self.cells[cell as usize].slab.holds(surface.p).then_some(cell);
            }
            width *= 0.5;
        }
        None
    }
}

/// Cells together with the caustics of photon maps.
pub(crate) struct CellSource<'a> {
    pub(crate) cells: &'a Cells,
    pub(crate) photons: PhotonSource<'a>,
}

impl Secondary for CellSource<'_> {
    fn irradiance(&self, surface: &Surface) -> Option<Known> {
        self.cells.look_up(surface)
    }

    fn caustic_irradiance(&self, surface: &Surface) -> Vec3 {
        self.photons.caustic_irradiance(surface)
    }

    fn covered_caustic_irradiance(&self, surface: &Surface, reach: f32, fine: f32) -> Irradiance {
        self.photons.covered_caustic_irradiance(surface, reach, fine)
    }

    fn caustic_coverage(&self, surface: &Surface, precise: bool) -> f32 {
        self.photons.caustic_coverage(surface, precise)
    }

    fn light_choice(&self) -> Option<&LightChoice> {
        self.cells.light_choice.as_ref()
    }

    fn glints(&self, surface: &Surface) -> &[Glint] {
        self.cells.guide.as_ref().map_or(&[], |guide| guide.glints(surface.p, surface.ng))
    }

    fn quick_caustic_irradiance(&self, surface: &Surface) -> Vec3 {
        let cell = self.cells.cell_of(surface);
        cell.map_or_else(
            || self.photons.quick_caustic_irradiance(surface),
            |cell| self.cells.cells[cell as usize].light.caustic,
        )
    }
}

/// A point with a white diffuse surface, to measure irradiance.
fn white(surface: &Surface) -> Shading {
    let bsdf = Bsdf { diffuse: Vec3::ONE, specular: Specular::None };
    Shading { surface: *surface, frame: Frame::from_normal(surface.n), bsdf, wo: Vec3A::Z }
}

/// The cell of a place on a surface: the level, the cube of its grid, and the axis nearest to the normal. Its upper bits
/// are never 0.
fn key(surface: &Surface, width: f32, level: u32) -> u64 {
    let cube: IVec3 = (surface.p / width).floor().as_ivec3();
    let side = side_of(surface.ng) as u64 | u64::from(level) << 3;
    let bits = |x: i32| u64::from(x.cast_unsigned()) & 0x1f_ffff;
    hash(hash(bits(cube.x) | bits(cube.y) << 21 | bits(cube.z) << 42) ^ side) | 1 << 63
}

/// The axis nearest to a normal and its direction along it, below 6.
pub(crate) fn side_of(n: Vec3A) -> usize {
    let a = n.abs();
    let (axis, along) = if a.x >= a.y && a.x >= a.z {
        (0, n.x)
    } else if a.y >= a.z {
        (1, n.y)
    } else {
        (2, n.z)
    };
    axis * 2 + usize::from(along > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ops::RangeInclusive;

    use crate::secondary::tests::square;
    use crate::{PhotonMaps, PhotonSettings};
    use scene::{Camera, Description, Material, Mesh, PunctualLight, Ray};

    /// A scene and the cells that its picture makes.
    fn cells_of(description: Description, seed: u64) -> (Scene, Cells) {
        guided_cells_of(description, seed, true)
    }

    /// The same with links that go where light comes from, or do not.
    fn guided_cells_of(description: Description, seed: u64, guides_gathers: bool) -> (Scene, Cells) {
        let scene = Scene::new(description).unwrap();
        let maps = PhotonMaps::shoot(&scene, &PhotonSettings { global: false, caustic: false, ..Default::default() });
        let photons = PhotonSource { maps: &maps, scene: &scene };
        let builder = CellBuilder {
            scene: &scene,
            sky: None,
            photons,
            seed,
            probe_rays: 24,
            ray_budget: 200_000,
            learns_lights: true,
            guides_gathers,
        };
        let cells = builder.build(UVec2::splat(16), &mut RayCounts::default());
        (scene, cells)
    }

    /// Triangles of squares of four corners each, and their materials.
    fn squares(corners: Vec<Vec3>, material: impl Fn(u32) -> u32) -> Mesh {
        let squares = 0..u32::try_from(corners.len() / 4).unwrap();
        Mesh {
            positions: corners,
            triangles: squares
                .clone()
                .flat_map(|i| [[4 * i, 4 * i + 1, 4 * i + 2], [4 * i, 4 * i + 2, 4 * i + 3]])
                .collect(),
            materials: squares.flat_map(|i| [material(i); 2]).collect(),
            ..Mesh::default()
        }
    }

    /// Red light that lamps send to the floor at x, z; `None` where there is no cell.
    fn direct_at(scene: &Scene, cells: &Cells, x: f32, z: f32) -> Option<f32> {
        let ray = Ray::new(Vec3A::new(x, 0.2, z), Vec3A::NEG_Y);
        Some(cells.look_up(&scene.surface(&ray, &scene.intersect(&ray).unwrap()))?.direct?.x)
    }

    /// A look down into a corner of the squares.
    fn camera() -> Option<Camera> {
        let eye = Vec3::new(0.0, 0.9, 1.9);
        Some(Camera { eye, at: Vec3::Y * 0.2, up: Vec3::Y, fov_y_degrees: 90.0 })
    }

    /// The four walls of a room of 4 m x 4 m, 1 m high.
    fn walls() -> [[Vec3; 4]; 4] {
        let wall = |x: f32| [(0.0, -2.0), (0.0, 2.0), (1.0, 2.0), (1.0, -2.0)].map(|(y, z)| Vec3::new(x, y, z));
        let turned = |corners: [Vec3; 4]| corners.map(|p| Vec3::new(p.z, p.y, p.x));
        [wall(-2.0), wall(2.0), turned(wall(-2.0)), turned(wall(2.0))]
    }

    /// Its roof, with a hole from the middle `half` to each side.
    fn roof(half: f32) -> [[Vec3; 4]; 4] {
        let strip = |x: [f32; 2], z: [f32; 2]| {
            [(x[0], z[0]), (x[1], z[0]), (x[1], z[1]), (x[0], z[1])].map(|(x, z)| Vec3::new(x, 1.0, z))
        };
        [
            strip([-2.0, 2.0], [-2.0, -half]),
            strip([-2.0, 2.0], [half, 2.0]),
            strip([-2.0, -half], [-half, half]),
            strip([half, 2.0], [-half, half]),
        ]
    }

    #[test]
    fn each_side_of_a_wall_has_its_own_light() {
        // A low wall of paper on a floor under a ceiling, and a lamp on one side of it.
        let wall = |x: f32| [(0.0, -2.0), (0.0, 2.0), (0.3, 2.0), (0.3, -2.0)].map(|(y, z)| Vec3::new(x, y, z));
        let lamp = square(0.3, 0.3).map(|corner| corner + 1.5 * Vec3::NEG_X);
        let lit = Material { diffuse: Vec3::ZERO, emission: Vec3::ONE, ..Material::default() };
        let description = Description {
            meshes: vec![squares([square(2.0, 0.0), square(2.0, 1.0), wall(0.01), lamp].concat(), |i| i / 3)],
            materials: vec![Material::default(), lit],
            camera: camera(),
            ..Description::default()
        };
        let (scene, cells) = cells_of(description, 1);
        // Light on the floor up to a cell away from the wall.
        let direct = |side: f32| -> Vec<f32> {
            let x = |i: u16| 0.01 + side * cells.width * (0.1 + 0.8 * f32::from(i % 8) / 7.0);
            (0..128).filter_map(|i| direct_at(&scene, &cells, x(i), f32::from(i / 8) / 8.0 - 1.0)).collect()
        };
        let (lit, dark) = (direct(-1.0), direct(1.0));
        // Before cells were cut, none that the wall stands in was one.
        assert!(lit.len() > 100 && dark.len() > 70, "{} and {} of 128", lit.len(), dark.len());
        let mean = |values: &[f32]| values.iter().sum::<f32>() / values.len() as f32;
        assert!(mean(&dark) < 0.05 * mean(&lit), "{} and {}", mean(&dark), mean(&lit));
    }

    #[test]
    fn a_lamp_is_found_where_a_roof_hides_the_sun() {
        let room = [&[square(2.0, 0.0), square(2.0, 1.0)], &walls()[..]].concat().concat();
        let lamp = PunctualLight::Point { position: 0.9 * Vec3::Y, intensity: Vec3::ONE };
        let sun = PunctualLight::Directional { direction: Vec3::new(0.2, -1.0, 0.1), irradiance: Vec3::splat(1e5) };
        let mean = |lights: Vec<PunctualLight>| {
            let description = Description {
                meshes: vec![squares(room.clone(), |_| 0)],
                materials: vec![Material::default()],
                lights,
                camera: camera(),
                ..Description::default()
            };
            let (scene, cells) = cells_of(description, 1);
            let place = |i: u16| (f32::from(i) + 0.5) / 10.0 - 1.6;
            let places = (0..32).flat_map(|x| (0..32).map(move |z| (place(x), place(z))));
            let light: Vec<f32> = places.filter_map(|(x, z)| direct_at(&scene, &cells, x, z)).collect();
            assert!(light.len() > 900, "{} of 1024", light.len());
            light.iter().sum::<f32>() / light.len() as f32
        };
        let (alone, both) = (mean(vec![lamp]), mean(vec![lamp, sun]));
        assert!((both / alone - 1.0).abs() < 0.05, "{both} instead of {alone}");
    }

    /// How far the light of a patch of sun is off in the cells of a floor, relatively, by seeds: below a hole in a roof,
    /// from its middle `half` to each side.
    fn errors_of_patch(half: f32, seeds: RangeInclusive<u64>) -> Vec<f32> {
        let sun = PunctualLight::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::ONE };
        let error = |seed| {
            let description = Description {
                meshes: vec![squares([&[square(2.0, 0.0)], &roof(half)[..]].concat().concat(), |_| 0)],
                materials: vec![Material::default()],
                lights: vec![sun],
                camera: camera(),
                ..Description::default()
            };
            let (scene, cells) = cells_of(description, seed);
            // The light that cells hold around the patch, against what comes through the hole.
            let reach = 2.0 * cells.width;
            let place = |i: u16| reach * ((f32::from(i) + 0.5) / 32.0 - 1.0);
            let places = (0..64).flat_map(|x| (0..64).map(move |z| (place(x), place(z))));
            let light = |(x, z)| direct_at(&scene, &cells, x, z).expect("the floor is in cells");
            places.map(light).sum::<f32>() * (reach / 32.0).powi(2) / (4.0 * half * half) - 1.0
        };
        seeds.map(error).collect()
    }

    #[test]
    fn a_patch_of_sun_has_its_light() {
        // About as wide as a cell.
        let errors = errors_of_patch(0.06, 1..=16);
        let rms = (errors.iter().map(|error| error * error).sum::<f32>() / errors.len() as f32).sqrt();
        // 0.15 with four points a cell, 0.12 with 64 alone.
        assert!(rms < 0.08, "{rms}: {errors:?}");
    }

    #[test]
    fn light_that_is_often_missed_is_not_lost() {
        // A twentieth of a cell. By seed it is off by as much as there is of it: the mean by an eighth.
        let errors = errors_of_patch(0.008, 1..=64);
        let mean = errors.iter().sum::<f32>() / errors.len() as f32;
        assert!(mean.abs() < 0.3, "{mean}: {errors:?}");
    }

    #[test]
    fn links_find_the_patch_that_lights_a_room() {
        let sun = PunctualLight::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::ONE };
        // What is reflected onto all cells, by seeds.
        let light = |guides_gathers: bool| -> Vec<f64> {
            let of_seed = |seed| {
                let description = Description {
                    meshes: vec![squares([&[square(2.0, 0.0)], &roof(0.06)[..], &walls()].concat().concat(), |_| 0)],
                    materials: vec![Material::default()],
                    lights: vec![sun],
                    camera: camera(),
                    ..Description::default()
                };
                let (_, cells) = guided_cells_of(description, seed, guides_gathers);
                assert_eq!(cells.guide.is_some(), guides_gathers);
                cells.cells.iter().map(|cell| f64::from(cell.light.indirect.x)).sum::<f64>() / cells.cells.len() as f64
            };
            (1..=12).map(of_seed).collect()
        };
        let spread = |values: Vec<f64>| {
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64;
            (mean, variance, variance / values.len() as f64)
        };
        let (guided, even) = (spread(light(true)), spread(light(false)));
        // Four standard errors; the seeds are fixed.
        let error = (guided.2 + even.2).sqrt();
        assert!((guided.0 - even.0).abs() < 4.0 * error, "{} and {} +- {error}", guided.0, even.0);
        assert!(guided.1 < 0.5 * even.1, "a variance of {} and {}", guided.1, even.1);
    }
}
