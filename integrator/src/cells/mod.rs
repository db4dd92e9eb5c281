//! A radiosity solution on cells of the surfaces that gather rays meet: all the light of a diffuse surface by one
//! look-up.
//!
//! Probe paths from the picture find the surfaces that count. They are divided into cells, cubes of a grid times six
//! directions of the normal. Each cell holds a few points; from these, light sampling gives its direct light, and
//! cosine-distributed rays link it to the cells that they meet, through mirrors, glass and gloss. The system of the
//! links,
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

mod solve;
mod table;

use glam::{IVec3, UVec2, Vec2, Vec3, Vec3A};
use rayon::prelude::*;
use scene::{Bsdf, Lobes, Ray, Scene, Specular, Surface};

use self::solve::{CellLight, Row, solve};
use self::table::Table;
use crate::Irradiance;
use crate::photons::PhotonSource;
use crate::sampler::{Sampler, hash, hash_pair, in_cell};
use crate::secondary::{Known, LightWays, Secondary, Shading, direct_light, unsampled_emission};
use crate::sky::{SkySplit, soft_background};
use crate::statistics::{RayCounts, map_counting};
use crate::walk::{Taken, Visitor, walk};

/// Probe rays along a side of the picture, and bounces of each of their gather rays.
const PROBE_SIDE: u32 = 48;
const PROBE_BOUNCES: u32 = 3;

/// Width of a cell as a share of the median distance of what gather rays meet.
const WIDTH_SHARE: f32 = 0.06;

/// Points that stand for a cell, and those that must see each other for it to hold one light; the two outermost come on
/// top.
const MAX_POINTS: usize = 4;
const MAX_WITNESSES: usize = 12;

/// Most mirrors, panes and glossy surfaces that a probe goes through on its way to a diffuse one.
const MAX_WALK: u32 = 64;

/// Light that roulette kept long inside of glass is so rare and so strong that a link of all of it would feed its own
/// cell; no link has more throughput. Radiance that leaves a medium rises by the square of its refractive index, 5.9 in
/// diamond, so hardly anything else comes to this bound: what is within a body of a higher index gets too little of the
/// light outside. And of the eight rays of a cell or more one cannot bring more light than the cell sent.
const MAX_THROUGHPUT: f32 = 6.0;

/// How far a surface may be out of what the probes met of its cell, along the normal, as a share of the width.
const SLAB_MARGIN: f32 = 0.1;

/// Hits nearer than this many widths of a cell are not looked up.
const RESOLUTION_FACTOR: f32 = 2.0;

/// The cells and their light.
#[derive(Debug, Default)]
pub(crate) struct Cells {
    width: f32,
    table: Table,
    /// By the numbers of the table.
    cells: Vec<Cell>,
}

#[derive(Debug)]
struct Cell {
    slab: Slab,
    light: CellLight,
}

/// The layer of space that the surface of a cell lies in. Behind it there may be another sheet of the same key, with
/// quite other light.
#[derive(Debug, Clone, Copy)]
struct Slab {
    normal: Vec3,
    /// Of the middle along the normal, metres.
    offset: f32,
    /// Half of the thickness, metres.
    reach: f32,
}

impl Slab {
    /// Returns the slab that holds surfaces and `margin` metres beyond them, and the numbers of the lowest and the
    /// highest surface along its normal.
    fn around<'a>(surfaces: impl Iterator<Item = &'a Surface> + Clone, margin: f32) -> (Self, [usize; 2]) {
        let normal: Vec3 = surfaces.clone().map(|surface| surface.ng).sum::<Vec3A>().normalize_or(Vec3A::Y).into();
        let mut range = [(f32::INFINITY, 0), (f32::NEG_INFINITY, 0)];
        for (number, surface) in surfaces.enumerate() {
            let height = normal.dot(surface.p.into());
            if height < range[0].0 {
                range[0] = (height, number);
            }
            if height > range[1].0 {
                range[1] = (height, number);
            }
        }
        let [(low, lowest), (high, highest)] = range;
        (Self { normal, offset: 0.5 * (low + high), reach: 0.5 * (high - low) + margin }, [lowest, highest])
    }

    #[inline]
    fn holds(&self, p: Vec3A) -> bool {
        (self.normal.dot(p.into()) - self.offset).abs() <= self.reach
    }
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
    /// Number of rays to spend on links, and on shadow rays.
    pub(crate) ray_budget: u32,
}

impl CellBuilder<'_> {
    /// Finds the cells and solves for their light.
    pub(crate) fn build(&self, size: UVec2, rays: &mut RayCounts) -> Cells {
        let hits = self.probe(size, rays);
        let mut distances: Vec<f32> =
            hits.par_iter().flatten_iter().filter(|hit| hit.1).map(|hit| hit.0.surface.t).collect();
        if distances.is_empty() {
            return Cells::default();
        }
        let middle = distances.len() / 2;
        let width = WIDTH_SHARE * *distances.select_nth_unstable_by(middle, f32::total_cmp).1;
        // A cell that something divides is left out: its mean light would be that of neither side.
        let found: Vec<Found> = sort_into_cells(&hits, width)
            .into_par_iter()
            .filter(|found| !self.is_divided(&found.witnesses, width))
            .collect();
        let table = Table::new(found.iter().map(|found| found.key));
        let dark = |found: &Found| Cell { slab: found.slab, light: CellLight::default() };
        let mut cells = Cells { width, table, cells: found.iter().map(dark).collect() };
        let ray_count = (self.ray_budget as usize / found.len().max(1)).clamp(8, 256);
        let rows: Vec<Row> = found
            .par_iter()
            .enumerate()
            .map(|(cell, found)| self.row(&cells, cell as u64, &found.witnesses, ray_count))
            .collect();
        for row in &rows {
            *rays += row.rays;
        }
        for (cell, light) in cells.cells.iter_mut().zip(solve(&rows)) {
            cell.light = light;
        }
        cells
    }

    /// Diffuse surfaces that paths from the picture meet, those of each probe by themselves; with each, whether it is
    /// the first of its path.
    fn probe(&self, size: UVec2, rays: &mut RayCounts) -> Vec<Vec<(Shading, bool)>> {
        map_counting((0..PROBE_SIDE * PROBE_SIDE).into_par_iter(), rays, |number, rays| {
            let mut found = Vec::new();
            let mut sampler = Sampler::new(self.seed, u64::from(number), 0);
            let film = in_cell(number, PROBE_SIDE, sampler.next_pair()) * size.as_vec2();
            let ray = self.scene.camera_ray(film, size);
            rays.camera += 1;
            if let Some(seen) = self.to_diffuse(ray, &mut sampler, rays) {
                for way in 0..self.probe_rays {
                    let mut sampler = Sampler::new(self.seed, hash(u64::from(number)), way);
                    self.probe_path(seen, &mut sampler, &mut found, rays);
                }
            }
            found
        })
    }

    fn probe_path(&self, from: Shading, sampler: &mut Sampler, found: &mut Vec<(Shading, bool)>, rays: &mut RayCounts) {
        let mut at = from;
        for bounce in 0..PROBE_BOUNCES {
            sampler.start_bounce(bounce + 1);
            let Some(ray) = at.cosine_ray(sampler.next_pair()) else { return };
            rays.path += 1;
            let Some(next) = self.to_diffuse(ray, sampler, rays) else { return };
            found.push((next, bounce == 0));
            at = next;
        }
    }

    /// Follows a ray through mirrors, glass and gloss to the first surface with a diffuse part, as long as some light
    /// comes along.
    fn to_diffuse(&self, mut ray: Ray, sampler: &mut Sampler, rays: &mut RayCounts) -> Option<Shading> {
        let mut beta = Vec3::ONE;
        for _ in 0..MAX_WALK {
            let hit = self.scene.intersect(&ray)?;
            let surface = self.scene.surface(&ray, &hit);
            beta *= self.scene.transmittance(&surface);
            let shading = Shading::new(self.scene, surface, ray.direction);
            if shading.bsdf.has_diffuse() {
                return Some(shading);
            }
            let u = sampler.next_4d();
            let sample = shading.bsdf.sample(Lobes::SPECULAR, shading.wo, u[0], Vec2::new(u[1], u[2]))?;
            beta *= sample.weight;
            let wi = shading.frame.to_world(sample.wi);
            if !shading.leaves(wi, sample.wi) || beta.max_element() < 1e-4 {
                return None;
            }
            rays.path += 1;
            ray = shading.surface.spawn(wi);
        }
        None
    }

    fn row(&self, cells: &Cells, cell: u64, points: &[Shading], ray_count: usize) -> Row {
        let points = &points[..points.len().min(MAX_POINTS)];
        let mut row = Row {
            direct: Vec3::ZERO,
            source: Vec3::ZERO,
            caustic: Vec3::ZERO,
            links: Vec::with_capacity(ray_count),
            rays: RayCounts::default(),
        };
        let share = 1.0 / ray_count as f32;
        for number in 0..ray_count {
            let point = &white(&points[number % points.len()]);
            let number = u32::try_from(number).expect("at most 256");
            let mut sampler = Sampler::new(self.seed, hash_pair(cell, 1), number);
            // A white surface reflects irradiance / pi.
            let pi = std::f32::consts::PI * share;
            let ways = LightWays { count: 1, choice: None, sky: self.sky };
            let u = sampler.next_4d_for(self.scene.lights().has_choice());
            row.direct += direct_light(self.scene, point, Lobes::DIFFUSE, ways, u, &mut row.rays) * pi;
            if self.scene.features().emissive_unsampled {
                row.direct += unsampled_emission(self.scene, point, sampler.next_pair(), &mut row.rays) * pi;
            }
            let Some(ray) = point.cosine_ray(sampler.next_pair()) else { continue };
            row.rays.path += 1;
            if let Some(hit) = self.scene.intersect(&ray) {
                let surface = self.scene.surface(&ray, &hit);
                let mut rays = RayCounts::default();
                let mut link = LinkWalk { builder: self, cells, row: &mut row, share };
                let shading = Shading::new(self.scene, surface, ray.direction);
                walk(self.scene, shading, &mut sampler, &mut rays, &mut link);
                row.rays += rays;
            } else {
                row.direct += pi * soft_background(self.scene, self.sky, ray.direction);
            }
        }
        for point in points {
            row.caustic += self.photons.caustic_irradiance(&point.surface) / points.len() as f32;
        }
        row.source += row.caustic;
        row
    }

    /// Whether some neighbours among the points of a cell do not see each other just above the surface: a wall stands
    /// on it.
    fn is_divided(&self, witnesses: &[Shading], width: f32) -> bool {
        /// Height of the lines of sight as a share of the width of the cell.
        const HEIGHT: f32 = 0.1;
        witnesses.windows(2).any(|pair| {
            let lifted = |point: &Shading| point.surface.p + HEIGHT * width * point.surface.ng;
            let (from, to) = (lifted(&pair[0]), lifted(&pair[1]));
            let ray = Ray { t_max: from.distance(to), ..Ray::new(from, (to - from).normalize_or(Vec3A::Z)) };
            self.scene.occluded(&ray)
        })
    }
}

/// What is known of a cell before its light.
struct Found {
    key: u64,
    /// The first hits in it, then the two that are farthest apart along its normal where that is more than two margins
    /// of its slab.
    witnesses: Vec<Shading>,
    slab: Slab,
}

/// Finds the cells of hits.
fn sort_into_cells(hits: &[Vec<(Shading, bool)>], width: f32) -> Vec<Found> {
    // Keys with the numbers of their hits, so that sorting is the same for any number of threads.
    let mut keys: Vec<(u64, u32, u32)> = hits
        .par_iter()
        .enumerate()
        .flat_map_iter(|(probe, found)| {
            let number = |i: usize| u32::try_from(i).expect("there are fewer hits than 2^32");
            found.iter().enumerate().map(move |(i, (hit, _))| (key(&hit.surface, width), number(probe), number(i)))
        })
        .collect();
    keys.par_sort_unstable();
    let hit = |&(_, probe, i): &(u64, u32, u32)| &hits[probe as usize][i as usize].0;
    let find = |cell: &[(u64, u32, u32)]| {
        let margin = SLAB_MARGIN * width;
        let (slab, outermost) = Slab::around(cell.iter().map(|of_hit| &hit(of_hit).surface), margin);
        let mut witnesses: Vec<Shading> = cell.iter().take(MAX_WITNESSES).map(hit).copied().collect();
        if slab.reach > 2.0 * margin {
            witnesses.extend(outermost.map(|number| *hit(&cell[number])));
        }
        Found { key: cell[0].0, witnesses, slab }
    };
    let cells: Vec<&[(u64, u32, u32)]> = keys.chunk_by(|a, b| a.0 == b.0).collect();
    cells.into_par_iter().map(find).collect()
}

/// The walk of one link: the cell at its end becomes a link, and the light on its way a source.
struct LinkWalk<'a> {
    builder: &'a CellBuilder<'a>,
    cells: &'a Cells,
    row: &'a mut Row,
    /// Share of the ray in the mean of its cell, so that radiance along it counts pi times as much in the irradiance.
    share: f32,
}

impl Visitor for LinkWalk<'_> {
    fn visit(&mut self, shading: &Shading, beta: Vec3, _: f32) -> Taken {
        let Some(cell) = self.cells.cell_of(&shading.surface) else { return Taken::Nothing };
        let beta = beta.min(Vec3::splat(MAX_THROUGHPUT));
        self.row.links.push((cell, self.share * beta * shading.bsdf.diffuse));
        Taken::All
    }

    fn add(&mut self, radiance: Vec3) {
        self.row.source += self.share * std::f32::consts::PI * radiance;
    }

    fn caustic_irradiance(&self, surface: &Surface) -> Vec3 {
        self.builder.photons.quick_caustic_irradiance(surface)
    }
}

impl Cells {
    /// Bytes that cells take.
    pub(crate) fn memory_bytes(&self) -> usize {
        self.cells.len() * size_of::<Cell>() + self.table.slots.len() * size_of::<u64>()
    }

    /// The light of the cell of a surface; `None` where there is no cell, one that something divides, or one of another
    /// sheet.
    pub(crate) fn look_up(&self, surface: &Surface) -> Option<Known> {
        let CellLight { direct, indirect, .. } = self.cells[self.cell_of(surface)? as usize].light;
        Some(Known { direct: Some(direct), indirect, resolution: RESOLUTION_FACTOR * self.width })
    }

    fn cell_of(&self, surface: &Surface) -> Option<u32> {
        let cell = self.table.find(key(surface, self.width))?;
        self.cells[cell as usize].slab.holds(surface.p).then_some(cell)
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

    fn covered_caustic_irradiance(&self, surface: &Surface, reach: f32) -> Irradiance {
        self.photons.covered_caustic_irradiance(surface, reach)
    }

    fn caustic_coverage(&self, surface: &Surface) -> f32 {
        self.photons.caustic_coverage(surface)
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
fn white(point: &Shading) -> Shading {
    Shading { bsdf: Bsdf { diffuse: Vec3::ONE, specular: Specular::None }, ..*point }
}

/// The cell of a place on a surface: the cube of the grid, and the axis nearest to the normal. Its upper bits are
/// never 0.
fn key(surface: &Surface, width: f32) -> u64 {
    let cube: IVec3 = (surface.p / width).floor().as_ivec3();
    let side = side_of(surface.ng) as u64;
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
