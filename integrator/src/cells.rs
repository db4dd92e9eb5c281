//! A radiosity solution on cells of the surfaces that gather rays meet: all the light of a diffuse surface by one look-up.
//!
//! Probe paths from the picture find the surfaces that count. They are divided into cells, cubes of a grid times six directions of
//! the normal. Each cell holds a few points; from these, light sampling gives its direct light, and cosine-distributed rays link
//! it to the cells that they meet, through mirrors, glass and gloss. The system of the links,
//!
//! ```text
//! E_i = D_i + sum_j W_ij E_j,     W_ij = throughput x albedo_j / number of rays of i
//! ```
//!
//! is solved by iteration. A ray that meets no cell goes on as a path, so no light is lost. Unlike a density of photons this has no
//! edges to be dark at, and costs no photon that does not reach the picture.
//!
//! # Source
//! Cohen, Greenberg 1985 for the system; Binder, Fricke, Keller 2018, "Fast path space filtering by jittered spatial hashing", for
//! the cells. The look-up is not jittered as theirs: gather rays average over cells, and a jittered one may fall behind a wall.

use glam::{IVec3, UVec2, Vec2, Vec3, Vec3A};
use rayon::prelude::*;
use scene::{Bsdf, Lobes, Ray, Scene, Specular, Surface};

use crate::photons::PhotonSource;
use crate::sampler::{Sampler, hash, hash_pair, in_cell};
use crate::secondary::{Known, LightWays, Secondary, Shading, direct_light, unsampled_emission};
use crate::sky::{SkySplit, soft_background};
use crate::statistics::RayCounts;
use crate::walk::{Taken, Visitor, walk};

/// Probe rays along a side of the picture, and bounces of each of their gather rays.
const PROBE_SIDE: u32 = 48;
const PROBE_BOUNCES: u32 = 3;

/// Width of a cell as a share of the median distance of what gather rays meet.
const WIDTH_SHARE: f32 = 0.06;

/// Points that stand for a cell, and those that must see each other for it to hold one light.
const MAX_POINTS: usize = 4;
const MAX_WITNESSES: usize = 12;

/// Estimated error of the iteration at its end, relative to the sum over the cells.
const PRECISION: f64 = 1e-5;
const MAX_ITERATIONS: usize = 500;
/// After so many steps, when the changes have become geometric, the rest of their series is added at once.
const EXTRAPOLATION: usize = 8;

/// Most mirrors, panes and glossy surfaces that a probe goes through on its way to a diffuse one.
const MAX_WALK: u32 = 64;

/// Light that roulette kept long inside of glass is so rare and so strong that a link of all of it would feed its own cell; no link has more throughput. Radiance that
/// leaves a medium rises by the square of its refractive index, 5.9 in diamond, so nothing else comes to this bound; and of the eight rays of a cell or more one
/// cannot bring more light than the cell sent.
const MAX_THROUGHPUT: f32 = 6.0;

/// Hits nearer than this many widths of a cell are not looked up.
const RESOLUTION_FACTOR: f32 = 2.0;

/// The cells and their light.
#[derive(Debug, Default)]
pub(crate) struct Cells {
    width: f32,
    table: Table,
    /// By the numbers of the table.
    light: Vec<CellLight>,
}

/// Irradiance of a cell, W m^-2.
#[derive(Debug, Clone, Copy, Default)]
struct CellLight {
    /// Straight from the sources.
    direct: Vec3,
    /// By reflections, caustics included.
    indirect: Vec3,
    /// The part of that which came by caustics.
    caustic: Vec3,
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

/// A cell's sources and links.
struct Row {
    direct: Vec3,
    /// Light of walks that met no cell, and caustics.
    source: Vec3,
    /// The caustics in it.
    caustic: Vec3,
    links: Vec<(u32, Vec3)>,
    rays: RayCounts,
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
        let found: Vec<(u64, Vec<Shading>)> = sort_into_cells(&hits, width)
            .into_par_iter()
            .filter(|(_, points)| !self.is_divided(points, width))
            .collect();
        let table = Table::new(found.iter().map(|&(key, _)| key));
        let mut cells = Cells { width, table, light: Vec::new() };
        let ray_count = (self.ray_budget as usize / found.len().max(1)).clamp(8, 256);
        let rows: Vec<Row> = found
            .par_iter()
            .enumerate()
            .map(|(cell, (_, points))| self.row(&cells, cell as u64, points, ray_count))
            .collect();
        for row in &rows {
            *rays += row.rays;
        }
        cells.light = solve(&rows);
        cells
    }

    /// Diffuse surfaces that paths from the picture meet, those of each probe by themselves; with each, whether it is the first of its path.
    fn probe(&self, size: UVec2, rays: &mut RayCounts) -> Vec<Vec<(Shading, bool)>> {
        let found: Vec<(Vec<(Shading, bool)>, RayCounts)> = (0..PROBE_SIDE * PROBE_SIDE)
            .into_par_iter()
            .map(|number| {
                let mut found = Vec::new();
                let mut rays = RayCounts::default();
                let mut sampler = Sampler::new(self.seed, u64::from(number), 0);
                let film = in_cell(number, PROBE_SIDE, sampler.next_pair()) * size.as_vec2();
                let ray = self.scene.camera_ray(film, size);
                rays.camera += 1;
                if let Some((seen, _)) = self.to_diffuse(ray, Vec3::ONE, &mut sampler, &mut rays) {
                    for way in 0..self.probe_rays {
                        let mut sampler = Sampler::new(self.seed, hash(u64::from(number)), way);
                        self.probe_path(seen, &mut sampler, &mut found, &mut rays);
                    }
                }
                (found, rays)
            })
            .collect();
        found
            .into_iter()
            .map(|(found, counted)| {
                *rays += counted;
                found
            })
            .collect()
    }

    fn probe_path(&self, from: Shading, sampler: &mut Sampler, found: &mut Vec<(Shading, bool)>, rays: &mut RayCounts) {
        let mut at = from;
        for bounce in 0..PROBE_BOUNCES {
            sampler.start_bounce(bounce + 1);
            let Some(ray) = at.cosine_ray(sampler.next_pair()) else { return };
            rays.path += 1;
            let Some((next, _)) = self.to_diffuse(ray, Vec3::ONE, sampler, rays) else { return };
            found.push((next, bounce == 0));
            at = next;
        }
    }

    /// Follows a ray through mirrors, glass and gloss to the first surface with a diffuse part; with the throughput.
    fn to_diffuse(&self, ray: Ray, beta: Vec3, sampler: &mut Sampler, rays: &mut RayCounts) -> Option<(Shading, Vec3)> {
        let mut ray = ray;
        let mut beta = beta;
        for _ in 0..MAX_WALK {
            let hit = self.scene.intersect(&ray)?;
            let surface = self.scene.surface(&ray, &hit);
            beta *= self.scene.transmittance(&surface);
            let shading = Shading::new(self.scene, surface, ray.direction);
            if shading.bsdf.has_diffuse() {
                return Some((shading, beta));
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
                walk(self.scene, ray.direction, surface, &mut sampler, &mut rays, &mut link);
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

    /// Whether some neighbours among the points of a cell do not see each other just above the surface: a wall stands on it.
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

/// Finds the cells of hits: their keys, and the first hits in each.
fn sort_into_cells(hits: &[Vec<(Shading, bool)>], width: f32) -> Vec<(u64, Vec<Shading>)> {
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
    let cells: Vec<&[(u64, u32, u32)]> = keys.chunk_by(|a, b| a.0 == b.0).collect();
    let hit = |&(_, probe, i): &(u64, u32, u32)| hits[probe as usize][i as usize].0;
    cells.into_par_iter().map(|cell| (cell[0].0, cell.iter().take(MAX_WITNESSES).map(hit).collect())).collect()
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

/// Iterates E = D + W E from the sources up. The changes soon become geometric, and their ratio tells what is still to come, unless light goes to
/// and fro between two sides: there, what is added at once takes the iteration away from its end, and so is given up as soon as it has not helped.
fn solve(rows: &[Row]) -> Vec<CellLight> {
    let mut indirect: Vec<Vec3> = vec![Vec3::ZERO; rows.len()];
    let mut last_change = f64::INFINITY;
    // At the last extrapolation; none is made where this is 0.
    let mut extrapolated_change = f64::INFINITY;
    for step in 1..=MAX_ITERATIONS {
        let mut next: Vec<Vec3> = rows
            .par_iter()
            .map(|row| {
                let all = |cell: u32| rows[cell as usize].direct + indirect[cell as usize];
                row.source + row.links.iter().map(|&(cell, weight)| weight * all(cell)).sum::<Vec3>()
            })
            .collect();
        let sum = |values: &mut dyn Iterator<Item = Vec3>| values.map(|v| f64::from(v.element_sum())).sum::<f64>();
        let change = sum(&mut next.iter().zip(&indirect).map(|(a, b)| (*a - *b).abs()));
        let ratio = (change / last_change).min(0.9999);
        let rest = ratio / (1.0 - ratio);
        last_change = change;
        if step % EXTRAPOLATION == 0 {
            extrapolated_change = if change < 0.5 * extrapolated_change { change } else { 0.0 };
        }
        if step % EXTRAPOLATION == 0 && extrapolated_change > 0.0 {
            #[expect(clippy::cast_possible_truncation, reason = "below 10^4")]
            let rest = rest as f32;
            for (new, old) in next.iter_mut().zip(&indirect) {
                *new = (*new + (*new - *old) * rest).max(Vec3::ZERO);
            }
            last_change = f64::INFINITY;
        }
        indirect = next;
        if change * rest <= PRECISION * sum(&mut indirect.iter().copied()) && step % EXTRAPOLATION != 1 {
            break;
        }
    }
    let light = |(row, indirect): (&Row, Vec3)| CellLight { direct: row.direct, indirect, caustic: row.caustic };
    rows.iter().zip(indirect).map(light).collect()
}

impl Cells {
    /// Bytes that cells take.
    pub(crate) fn memory_bytes(&self) -> usize {
        self.light.len() * size_of::<CellLight>() + self.table.slots.len() * size_of::<u64>()
    }

    /// The light of the cell of a surface; `None` where there is no cell, or one that something divides.
    pub(crate) fn look_up(&self, surface: &Surface) -> Option<Known> {
        let CellLight { direct, indirect, .. } = self.light[self.cell_of(surface)? as usize];
        Some(Known { direct: Some(direct), indirect, resolution: RESOLUTION_FACTOR * self.width })
    }

    fn cell_of(&self, surface: &Surface) -> Option<u32> {
        self.table.find(key(surface, self.width))
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

    fn quick_caustic_irradiance(&self, surface: &Surface) -> Vec3 {
        let cell = self.cells.cell_of(surface);
        cell.map_or_else(
            || self.photons.quick_caustic_irradiance(surface),
            |cell| self.cells.light[cell as usize].caustic,
        )
    }
}

/// A point with a white diffuse surface, to measure irradiance.
fn white(point: &Shading) -> Shading {
    Shading { bsdf: Bsdf { diffuse: Vec3::ONE, specular: Specular::None }, ..*point }
}

/// The cell of a place on a surface: the cube of the grid, and the axis nearest to the normal. Its upper bits are never 0.
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

/// Keys to numbers in their order, by open addressing.
#[derive(Debug, Default)]
struct Table {
    /// The upper 40 bits of a key above its number, so that a cache line has eight; 0 is a free slot. For one picture in some 100,000 a place without a cell
    /// is taken for one that has the same bits and slot.
    slots: Vec<u64>,
}

impl Table {
    /// The lower bits, which hold the number.
    const NUMBERS: u64 = (1 << 24) - 1;

    /// Numbers keys, each of which comes once; there are fewer than 2^24.
    fn new(keys: impl ExactSizeIterator<Item = u64>) -> Self {
        assert!(keys.len() as u64 <= Self::NUMBERS, "probes find fewer cells");
        let mut table = Self { slots: vec![0; (2 * keys.len() + 1).next_power_of_two()] };
        for (key, number) in keys.zip(0u64..) {
            let slot = table.slot(key);
            table.slots[slot] = key & !Self::NUMBERS | number;
        }
        table
    }

    #[inline]
    fn find(&self, key: u64) -> Option<u32> {
        let found = *self.slots.get(self.slot(key))?;
        (found != 0).then_some((found & Self::NUMBERS) as u32)
    }

    /// The slot of a key, or the free one where it belongs.
    fn slot(&self, key: u64) -> usize {
        let mask = self.slots.len().wrapping_sub(1);
        let mut slot = usize::try_from(key & mask as u64).expect("masked to an index");
        while let Some(&found) = self.slots.get(slot)
            && found != 0
            && (found ^ key) > Self::NUMBERS
        {
            slot = (slot + 1) & mask;
        }
        slot
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solved(rows: Vec<(f32, Vec<(u32, f32)>)>) -> Vec<f32> {
        let rows: Vec<Row> = rows
            .into_iter()
            .map(|(direct, links)| Row {
                direct: Vec3::splat(direct),
                source: Vec3::ZERO,
                caustic: Vec3::ZERO,
                links: links.into_iter().map(|(cell, weight)| (cell, Vec3::splat(weight))).collect(),
                rays: RayCounts::default(),
            })
            .collect();
        solve(&rows).iter().map(|light| (light.indirect + light.direct).x).collect()
    }

    #[test]
    fn light_between_two_sides_is_solved() {
        // Two walls that see each other alone, one of them lit: E0 = 1 + w E1, E1 = w E0. The eigenvalues are w and -w.
        for w in [0.3, 0.8, 0.95_f32] {
            let lit = 1.0 / (1.0 - w * w);
            let found = solved(vec![(1.0, vec![(1, w)]), (0.0, vec![(0, w)])]);
            assert!((found[0] / lit - 1.0).abs() < 1e-3 && (found[1] / (w * lit) - 1.0).abs() < 1e-3, "{w}: {found:?}");
        }
    }

    #[test]
    fn light_in_a_white_room_is_solved() {
        // Eight cells that see each other evenly: E = D + w mean(E).
        for w in [0.5, 0.98_f32] {
            let links: Vec<(u32, f32)> = (0..8).map(|cell| (cell, w / 8.0)).collect();
            let rows = (0..8).map(|cell| (cell as f32, links.clone())).collect();
            let mean = 3.5 / (1.0 - w);
            for (cell, found) in solved(rows).into_iter().enumerate() {
                let expected = cell as f32 + w * mean;
                assert!((found / expected - 1.0).abs() < 1e-3, "{w}: {found} is not {expected}");
            }
        }
    }

    #[test]
    fn table_finds_the_keys_that_it_has() {
        assert_eq!(Table::default().find(1 << 63), None, "no slots");
        // Unrelated keys, and keys whose slots are the same and wrap round the end.
        let unrelated = |i: u64| hash(i) | 1 << 63;
        let crowded = |i: u64| i << 40 | 1 << 63 | 0xff_ffff;
        for key in [&unrelated as &dyn Fn(u64) -> u64, &crowded] {
            for count in [0, 1, 2, 7, 8, 1000] {
                let table = Table::new((0..count).map(key).collect::<Vec<u64>>().into_iter());
                for i in 0..count + 100 {
                    let expected = (i < count).then(|| u32::try_from(i).unwrap());
                    assert_eq!(table.find(key(i)), expected, "key {i} of {count}");
                }
            }
        }
    }
}
