//! The rays that link cells to each other.

use glam::{Vec2, Vec3};
use scene::{LightChoice, Surface};

use super::guide::{Guide, LinkEnd, brightness};
use super::lamps::LampSamples;
use super::probe::{FoundCell, spread};
use super::solve::Row;
use super::{CellBuilder, Cells, white};
use crate::sampler::{Sampler, hash_pair};
use crate::secondary::{Secondary, Shading, unsampled_emission};
use crate::sky::{luminance, soft_background};
use crate::statistics::RayCounts;
use crate::walk::{Taken, Visitor, walk};

/// Points of a cell that caustics are looked up at: each look-up averages over many photons already.
const CAUSTIC_POINTS: usize = 4;

/// Points of a cell that links start from where they are guided, and cells along a side of what each sees.
const GUIDED_POINTS: usize = 16;
const GUIDED_SIDE_U32: u32 = 16;
const GUIDED_SIDE: usize = GUIDED_SIDE_U32 as usize;
/// At least so many rays of each, so that none brings more light than was sent, see [`MAX_THROUGHPUT`].
const GUIDED_RAYS: usize = 32;
/// Share of their rays that go anywhere, so that none stands for more than twice what an even one does.
const UNGUIDED: f32 = 0.5;

/// Light that roulette kept long inside of glass is so rare and so strong that a link of all of it would feed its own
/// cell; no link has more throughput. Radiance that leaves a medium rises by the square of its refractive index, 5.9 in
/// diamond, so hardly anything else comes to this bound: what is within a body of a higher index gets too little of the
/// light outside. And of the eight rays of a cell or more one cannot bring more light than the cell sent.
const MAX_THROUGHPUT: f32 = 6.0;

impl CellBuilder<'_> {
    /// The links of a cell and its light, but for that of lamps, which is what samples tell.
    pub(super) fn row(
        &self,
        cells: &Cells,
        choice: Option<&LightChoice>,
        cell: u64,
        points: &[Surface],
        ray_count: usize,
    ) -> (Row, LampSamples) {
        let points: Vec<Shading> = spread(points, ray_count).map(white).collect();
        // Samples of one point tell no more of the rest of the cell than one does.
        let mut at_points = vec![Vec3::ZERO; points.len()];
        let mut row = Row::with_capacity(ray_count);
        let share = 1.0 / ray_count as f32;
        for number in 0..ray_count {
            let at = number % points.len();
            let point = &points[at];
            let mut sampler = self.link_sampler(hash_pair(cell, 1), number);
            at_points[at] += self.lamp_light(choice, point, &mut sampler, &mut row.rays);
            self.add_unsampled(point, share, &mut sampler, &mut row);
            let u = sampler.next_pair();
            self.add_link(cells, point, u, share, &mut sampler, &mut row);
        }
        let mut lamps = LampSamples::default();
        for (at, light) in at_points.into_iter().enumerate() {
            lamps.add(light / (ray_count - at).div_ceil(points.len()) as f32);
        }
        let caustic = |point: &Shading| self.photons.caustic_irradiance(&point.surface);
        let caustics: Vec<Vec3> = spread(&points, CAUSTIC_POINTS).map(caustic).collect();
        row.caustic = caustics.iter().sum::<Vec3>() / caustics.len() as f32;
        (row, lamps)
    }

    /// Makes the links of a cell anew, half of them to where its light comes from, if that is from few directions, and
    /// returns the rays of that.
    pub(super) fn guide_links(
        &self,
        cells: &Cells,
        guide: &Guide,
        stream: u64,
        cell: &FoundCell,
        ray_count: usize,
        row: &mut Row,
    ) -> RayCounts {
        let Surface { p, ng, .. } = cell.points[0];
        let Some(glints) = guide.glints_for_links(p, ng) else { return RayCounts::default() };
        let ray_count = ray_count.max(GUIDED_RAYS);
        let points: Vec<(Shading, Directions)> = spread(&cell.points, GUIDED_POINTS.min(ray_count))
            .map(white)
            .map(|point| {
                let brightness = brightness(glints, point.surface.p, &point.frame, GUIDED_SIDE);
                (point, Directions::new(brightness))
            })
            .collect();
        let mut guided = Row { lamps: row.lamps, caustic: row.caustic, ..Row::with_capacity(ray_count) };
        let mut unsampled = Row::default();
        let even = 1.0 / ray_count as f32;
        let mut shares = 0.0;
        for number in 0..ray_count {
            let (point, directions) = &points[number % points.len()];
            let mut sampler = self.link_sampler(stream, number);
            let [u_way, u, v, _] = sampler.next_4d_for(true);
            self.add_unsampled(point, even, &mut sampler, &mut unsampled);
            let (place, density) = directions.sample(u_way, Vec2::new(u, v));
            shares += even / density;
            self.add_link(cells, point, place, even / density, &mut sampler, &mut guided);
        }
        guided.scale_links(1.0 / shares);
        guided.direct += unsampled.direct;
        guided.rays += unsampled.rays;
        *row = guided;
        row.rays
    }

    fn link_sampler(&self, stream: u64, number: usize) -> Sampler {
        Sampler::new(self.seed, stream, u32::try_from(number).expect("at most 1024"))
    }

    /// Adds light of sources that light sampling does not know, by one ray of its own.
    fn add_unsampled(&self, point: &Shading, share: f32, sampler: &mut Sampler, row: &mut Row) {
        if self.scene.features().emissive_unsampled {
            // A white surface reflects irradiance / pi.
            let pi = std::f32::consts::PI * share;
            row.direct += unsampled_emission(self.scene, point, sampler.next_pair(), &mut row.rays) * pi;
        }
    }

    /// Follows one ray of a cell, through this place of the square, which stands for this share of what the cell sees.
    fn add_link(&self, cells: &Cells, point: &Shading, u: Vec2, share: f32, sampler: &mut Sampler, row: &mut Row) {
        let Some(ray) = point.cosine_ray(u) else { return };
        row.rays.path += 1;
        let first = row.links.len();
        let (mut at, mut distance) = (ray.direction, f32::INFINITY);
        let mut light = Vec3::ZERO;
        if let Some(hit) = self.scene.intersect(&ray) {
            let surface = self.scene.surface(&ray, &hit);
            (at, distance) = (surface.p, surface.t);
            let mut rays = RayCounts::default();
            let mut link = LinkWalk { builder: self, cells, row, share, light };
            walk(self.scene, Shading::new(self.scene, surface, ray.direction), sampler, &mut rays, &mut link);
            light = link.light;
            row.rays += rays;
            row.source += light;
        } else {
            light += std::f32::consts::PI * share * soft_background(self.scene, self.sky, ray.direction);
            row.direct += light;
        }
        let number = |links: usize| u32::try_from(links).expect("a ray brings a few");
        let links = number(first)..number(row.links.len());
        let cos = ray.direction.dot(point.frame.n);
        row.ends.push(LinkEnd { at: at.into(), distance, cos, share, links, source: luminance(light) });
    }
}

/// The walk of one link: the cell at its end becomes a link, and the light on its way a source.
struct LinkWalk<'a> {
    builder: &'a CellBuilder<'a>,
    cells: &'a Cells,
    row: &'a mut Row,
    /// Share of the ray in the mean of its cell, so that radiance along it counts pi times as much in the irradiance.
    share: f32,
    /// Irradiance by the light on its way.
    light: Vec3,
}

impl Visitor for LinkWalk<'_> {
    fn visit(&mut self, shading: &Shading, beta: Vec3, _: f32) -> Taken {
        let Some(cell) = self.cells.cell_of(&shading.surface) else { return Taken::Nothing };
        let beta = beta.min(Vec3::splat(MAX_THROUGHPUT));
        self.row.links.push((cell, self.share * beta * shading.bsdf.diffuse));
        Taken::All
    }

    fn add(&mut self, radiance: Vec3) {
        self.light += self.share * std::f32::consts::PI * radiance;
    }

    fn light_choice(&self) -> Option<&LightChoice> {
        self.cells.light_choice.as_ref()
    }

    fn caustic_irradiance(&self, surface: &Surface) -> Vec3 {
        self.builder.photons.quick_caustic_irradiance(surface)
    }
}

/// Directions of which some are chosen more often.
struct Directions {
    /// Sums over the cells of the square up to each, in rows.
    sums: Vec<f32>,
}

impl Directions {
    /// Chooses cells by these weights.
    fn new(weights: Vec<f32>) -> Self {
        let mut sums = weights;
        let mut sum = 0.0;
        for weight in &mut sums {
            sum += *weight;
            *weight = sum;
        }
        Self { sums }
    }

    /// A place of the square, by a number that chooses the way and two for the place, and its density.
    fn sample(&self, u_way: f32, u: Vec2) -> (Vec2, f32) {
        let side = GUIDED_SIDE as f32;
        let last = self.sums.len() - 1;
        let total = self.sums[last];
        if total <= 0.0 {
            return (u, 1.0);
        }
        let place = if u_way < UNGUIDED {
            u
        } else {
            let chosen = (u_way - UNGUIDED) / (1.0 - UNGUIDED) * total;
            let cell = self.sums.partition_point(|&sum| sum <= chosen).min(last);
            (Vec2::new((cell % GUIDED_SIDE) as f32, (cell / GUIDED_SIDE) as f32) + u) / side
        };
        (place, UNGUIDED + (1.0 - UNGUIDED) * self.weight(place) / total * side * side)
    }

    /// The weight of the cell that holds a place.
    fn weight(&self, place: Vec2) -> f32 {
        let [x, y] = place.to_array().map(|x| hemimap::texel_index(x, GUIDED_SIDE_U32) as usize);
        let cell = y * GUIDED_SIDE + x;
        self.sums[cell] - if cell == 0 { 0.0 } else { self.sums[cell - 1] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rng;

    #[test]
    fn guided_directions_have_their_density() {
        let weights: Vec<f32> = (0..GUIDED_SIDE * GUIDED_SIDE).map(|cell| ((cell * 7) % 5) as f32).collect();
        let directions = Directions::new(weights);
        let mut random = Rng::new(1, 2);
        // The mean of f / density is the mean of f: of 1, of u and of what is 1 in one cell alone.
        let f = |place: Vec2| [1.0, place.x, if directions.weight(place) == 0.0 { 1.0 } else { 0.0 }];
        let dark = (0..GUIDED_SIDE * GUIDED_SIDE).filter(|cell| (cell * 7) % 5 == 0).count();
        let expected = [1.0, 0.5, dark as f64 / (GUIDED_SIDE * GUIDED_SIDE) as f64];
        const COUNT: usize = 100_000;
        let mut sums = [0.0; 3];
        for _ in 0..COUNT {
            let (place, density) = directions.sample(random.next_1d(), random.next_2d());
            for (sum, f) in sums.iter_mut().zip(f(place)) {
                *sum += f64::from(f / density);
            }
        }
        for (sum, expected) in sums.into_iter().zip(expected) {
            let mean = sum / COUNT as f64;
            // No f / density is above 2, so four standard errors are at most this.
            assert!((mean - expected).abs() < 4.0 * 2.0 / (COUNT as f64).sqrt(), "{mean} instead of {expected}");
        }
    }

    #[test]
    fn nothing_bright_is_met_evenly() {
        let u = Vec2::new(0.2, 0.7);
        assert_eq!(Directions::new(vec![0.0; GUIDED_SIDE * GUIDED_SIDE]).sample(0.9, u), (u, 1.0));
    }
}
