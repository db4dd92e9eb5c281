//! Which cells there are: what probe paths from the picture meet, sorted into cubes.
//!
//! Probes go on until hardly any hit is the only one of its cell: what share of the hits that is, is about the chance
//! that the next one will be in none (Good 1953, "The population frequencies of species"). Where something stands in a
//! cell its mean light would be that of neither side, so it is cut into cells of half the width, and these again. What is
//! still divided then, or was met too seldom to know, is no cell.

use std::iter::zip;
use std::ops::Range;

use glam::{UVec2, Vec2, Vec3, Vec3A};
use rayon::prelude::*;
use scene::{Lobes, Ray, Scene, Surface};

use super::key;
use crate::sampler::{Sampler, hash, in_cell};
use crate::secondary::Shading;
use crate::statistics::{RayCounts, map_counting};

/// Probe rays along a side of the picture, and bounces of each of their gather rays.
const PROBE_SIDE: u32 = 48;
const PROBE_BOUNCES: u32 = 3;
/// Gather rays are doubled so often at most, until so small a share of what they meet is alone in its cell.
const MAX_DOUBLINGS: u32 = 2;
const ALONE: f32 = 0.05;

/// Width of a cell as a share of the median distance of what gather rays meet.
const WIDTH_SHARE: f32 = 0.06;
/// How often that is halved for cells that something divides, plus one.
pub(super) const LEVELS: u32 = 3;

/// Hits that stand for a cell. A patch of sun covers few of them, so few would tell its light badly.
const MAX_POINTS: usize = 64;
/// Points of a cell that must see each other for it to hold one light; the two outermost come on top.
const MAX_WITNESSES: usize = 12;
/// Where something was found to stand, fewer hits than this tell too little to say that it does not stand between them.
const MIN_WITNESSES: usize = 3;

/// Height of lines of sight over the surface of a cell, as a share of its width.
pub(super) const SIGHT_HEIGHT: f32 = 0.1;

/// Most mirrors, panes and glossy surfaces that a probe goes through on its way to a diffuse one.
const MAX_WALK: u32 = 64;

/// How far a surface may be out of what the probes met of its cell, along the normal, as a share of the width.
const SLAB_MARGIN: f32 = 0.1;

/// The probes of a picture.
pub(super) struct Probes<'a> {
    pub(super) scene: &'a Scene,
    pub(super) seed: u64,
    /// Gather rays of each, at first.
    pub(super) rays: u32,
}

/// The cells that probes met.
pub(super) struct Found {
    /// Width of a cell, metres, before it is cut.
    pub(super) width: f32,
    pub(super) cells: Vec<FoundCell>,
    /// Keys of the cells that were cut.
    pub(super) cut: Vec<u64>,
}

/// What is known of a cell before its light.
pub(super) struct FoundCell {
    pub(super) key: u64,
    pub(super) width: f32,
    pub(super) slab: Slab,
    /// How many hits are in it.
    pub(super) hits: usize,
    /// Some of these, evenly chosen.
    pub(super) points: Vec<Surface>,
}

/// The layer of space that the surface of a cell lies in. Behind it there may be another sheet of the same key, with
/// quite other light.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slab {
    normal: Vec3,
    /// Of the middle along the normal, metres.
    offset: f32,
    /// Half of the thickness, metres.
    reach: f32,
}

/// A diffuse surface that a probe met.
struct Hit {
    surface: Surface,
    /// Whether it is what a gather ray met, and not what its path met further on.
    is_first: bool,
}

/// Where a hit is: the key of its cell, the number of its probe, and its own number among the hits of that.
type Place = (u64, u32, u32);

impl Probes<'_> {
    /// Sends the probes; `None` where they meet nothing.
    pub(super) fn find(&self, size: UVec2, rays: &mut RayCounts) -> Option<Found> {
        let numbers = (0..PROBE_SIDE * PROBE_SIDE).into_par_iter();
        let seen = map_counting(numbers, rays, |number, rays| Some((number, self.seen(number, size, rays)?)));
        let probes: Vec<(u32, Shading)> = seen.into_iter().flatten().collect();
        let mut hits = self.paths(&probes, 0..self.rays, rays);
        let width = WIDTH_SHARE * median_distance(&hits)?;
        let mut places = places_of(&hits, width);
        let mut ways = self.rays;
        while ways < self.rays << MAX_DOUBLINGS && share_alone(&places) > ALONE {
            for (hits, more) in zip(&mut hits, self.paths(&probes, ways..2 * ways, rays)) {
                hits.extend(more);
            }
            places = places_of(&hits, width);
            ways *= 2;
        }
        Some(self.cells(&hits, places, width))
    }

    /// What each probe meets by the gather rays of these numbers.
    fn paths(&self, probes: &[(u32, Shading)], ways: Range<u32>, rays: &mut RayCounts) -> Vec<Vec<Hit>> {
        map_counting(probes.par_iter(), rays, |&(number, seen), rays| {
            let mut hits = Vec::new();
            for way in ways.clone() {
                let mut sampler = Sampler::new(self.seed, hash(u64::from(number)), way);
                self.path(seen, &mut sampler, &mut hits, rays);
            }
            hits
        })
    }

    /// Divides hits into cells.
    fn cells(&self, hits: &[Vec<Hit>], mut places: Vec<Place>, mut width: f32) -> Found {
        let mut found = Found { width, cells: Vec::new(), cut: Vec::new() };
        for level in 0..LEVELS {
            if level > 0 {
                width *= 0.5;
                sort(&mut places, hits, width, level);
            }
            let groups: Vec<&[Place]> = places.chunk_by(|a, b| a.0 == b.0).collect();
            let with_division = |group: &&[Place]| {
                let (cell, outermost) = FoundCell::new(group, hits, width);
                let witnesses = spread(&cell.points, MAX_WITNESSES).chain(outermost.iter().flatten());
                let is_divided = self.is_divided(&witnesses.collect::<Vec<_>>(), width);
                (cell, is_divided)
            };
            let of_level: Vec<(FoundCell, bool)> = groups.par_iter().map(with_division).collect();
            let mut rest = Vec::new();
            for (group, (cell, is_divided)) in zip(groups, of_level) {
                if is_divided {
                    found.cut.push(cell.key);
                    rest.extend_from_slice(group);
                } else if level == 0 || group.len() >= MIN_WITNESSES {
                    found.cells.push(cell);
                }
            }
            places = rest;
        }
        found
    }

    /// The diffuse surface that a probe shows.
    fn seen(&self, number: u32, size: UVec2, rays: &mut RayCounts) -> Option<Shading> {
        let mut sampler = Sampler::new(self.seed, u64::from(number), 0);
        let film = in_cell(number, PROBE_SIDE, sampler.next_pair()) * size.as_vec2();
        rays.camera += 1;
        self.to_diffuse(self.scene.camera_ray(film, size), &mut sampler, rays)
    }

    /// Adds the diffuse surfaces that one gather ray and its path meet.
    fn path(&self, from: Shading, sampler: &mut Sampler, hits: &mut Vec<Hit>, rays: &mut RayCounts) {
        let mut at = from;
        for bounce in 0..PROBE_BOUNCES {
            sampler.start_bounce(bounce + 1);
            let Some(ray) = at.cosine_ray(sampler.next_pair()) else { return };
            rays.path += 1;
            let Some(next) = self.to_diffuse(ray, sampler, rays) else { return };
            hits.push(Hit { surface: next.surface, is_first: bounce == 0 });
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

    /// Whether some neighbours among the points of a cell do not see each other just above the surface: a wall stands
    /// on it.
    fn is_divided(&self, witnesses: &[&Surface], width: f32) -> bool {
        let lifted = |surface: &Surface| surface.p + SIGHT_HEIGHT * width * surface.ng;
        witnesses.windows(2).any(|pair| self.scene.occluded(&sight(lifted(pair[0]), lifted(pair[1]))))
    }
}

impl FoundCell {
    /// The cell of a group of hits, and the two that are farthest apart along its normal where that is more than two
    /// margins of its slab.
    fn new(group: &[Place], hits: &[Vec<Hit>], width: f32) -> (Self, Option<[Surface; 2]>) {
        let margin = SLAB_MARGIN * width;
        let surface = |&(_, probe, i): &Place| &hits[probe as usize][i as usize].surface;
        let (slab, outermost) = Slab::around(group.iter().map(surface), margin);
        let points = spread(group, MAX_POINTS).map(surface).copied().collect();
        let outermost = (slab.reach > 2.0 * margin).then(|| outermost.map(|number| *surface(&group[number])));
        (Self { key: group[0].0, width, slab, hits: group.len(), points }, outermost)
    }
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
    pub(super) fn holds(&self, p: Vec3A) -> bool {
        (self.normal.dot(p.into()) - self.offset).abs() <= self.reach
    }
}

/// The ray from one place to another.
pub(super) fn sight(from: Vec3A, to: Vec3A) -> Ray {
    Ray { t_max: from.distance(to), ..Ray::new(from, (to - from).normalize_or(Vec3A::Z)) }
}

/// At most so many of some items, evenly chosen.
pub(super) fn spread<T>(items: &[T], count: usize) -> impl Iterator<Item = &T> {
    let count = count.min(items.len());
    (0..count).map(move |i| &items[i * items.len() / count])
}

/// The median distance of what gather rays met; `None` if that was nothing.
fn median_distance(hits: &[Vec<Hit>]) -> Option<f32> {
    let first = hits.iter().flatten().filter(|hit| hit.is_first);
    let mut distances: Vec<f32> = first.map(|hit| hit.surface.t).collect();
    let middle = distances.len() / 2;
    (!distances.is_empty()).then(|| *distances.select_nth_unstable_by(middle, f32::total_cmp).1)
}

/// The places of all hits in cells that are not cut, sorted.
fn places_of(hits: &[Vec<Hit>], width: f32) -> Vec<Place> {
    let number = |i: usize| u32::try_from(i).expect("there are fewer hits than 2^32");
    let of_probe = |probe: usize| (0..hits[probe].len()).map(move |i| (0, number(probe), number(i)));
    let mut places: Vec<Place> = (0..hits.len()).flat_map(of_probe).collect();
    sort(&mut places, hits, width, 0);
    places
}

/// Sorts places by the keys of their cells, which are so wide on this level. What is sorted is the same for any number
/// of threads.
fn sort(places: &mut [Place], hits: &[Vec<Hit>], width: f32, level: u32) {
    let surface = |probe: u32, i: u32| &hits[probe as usize][i as usize].surface;
    places.par_iter_mut().for_each(|place| place.0 = key(surface(place.1, place.2), width, level));
    places.par_sort_unstable();
}

/// The share of hits that are the only ones of their cells.
fn share_alone(places: &[Place]) -> f32 {
    let cells = places.chunk_by(|a, b| a.0 == b.0);
    cells.filter(|cell| cell.len() == 1).count() as f32 / places.len() as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::secondary::tests::square;
    use scene::{Camera, Description, Material, Mesh};

    /// A box of 4 m x 4 m x 2 m, and level leaves of 4 cm at these places; seen from one corner.
    fn strewn(leaves: impl Iterator<Item = Vec3>) -> Scene {
        let mut mesh = Mesh::default();
        let mut add = |corners: [Vec3; 4]| {
            let first = u32::try_from(mesh.positions.len()).unwrap();
            mesh.positions.extend(corners);
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            mesh.materials.extend([0, 0]);
        };
        [0.0, 2.0].into_iter().for_each(|y| add(square(2.0, y)));
        for (x, z) in [(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0)] {
            let out = Vec3::new(2.0 * x, 0.0, 2.0 * z);
            let along = Vec3::new(2.0 * z, 0.0, 2.0 * x);
            add([out - along, out + along, out + along + 2.0 * Vec3::Y, out - along + 2.0 * Vec3::Y]);
        }
        leaves.for_each(|leaf| add(square(0.02, 0.0).map(|corner| corner + leaf)));
        let camera = Camera { eye: Vec3::new(1.9, 1.0, 1.9), at: Vec3::Y, up: Vec3::Y, fov_y_degrees: 90.0 };
        Scene::new(Description {
            meshes: vec![mesh],
            materials: vec![Material::default()],
            camera: Some(camera),
            ..Description::default()
        })
        .unwrap()
    }

    /// The cells of a scene, and how many rays its probes took after those of the camera.
    fn probed(scene: &Scene) -> (Found, u64) {
        let mut rays = RayCounts::default();
        let probes = Probes { scene, seed: 1, rays: 8 };
        let found = probes.find(UVec2::splat(16), &mut rays).expect("a closed box");
        assert_eq!(rays.camera, u64::from(PROBE_SIDE * PROBE_SIDE));
        (found, rays.path)
    }

    #[test]
    fn probes_go_on_where_much_is_met_once() {
        let one_round = u64::from(PROBE_SIDE * PROBE_SIDE * 8 * PROBE_BOUNCES);
        let (found, rays) = probed(&strewn(std::iter::empty()));
        assert_eq!(rays, one_round, "walls are met often");
        assert!(found.cut.is_empty(), "nothing stands in the box");
        let leaf = |i: u32| Vec3::new((i % 128) as f32, 0.0, (i / 128) as f32) / 32.0 - Vec3::new(1.98, 0.0, 1.98);
        let leaves = (0..128 * 128).map(|i| leaf(i) + 0.1 * Vec3::Y * (1 + i % 17) as f32);
        let (_, rays) = probed(&strewn(leaves));
        assert!(rays > 2 * one_round, "{rays} of {one_round}");
    }
}
