//! How much of the disc around a point is really surface.
//!
//! A photon estimate divides by the area of a disc. Beside an edge or in a corner a part of it hangs in the air or lies
//! behind a wall, and the estimate would be too dark: by a half at a straight edge, by three quarters in a corner. So
//! the disc is tested: short rays from a point above its middle must meet the surface where the disc is.

use glam::{Vec2, Vec3A};
use hemimap::{Frame, square_to_disk};
use scene::{Ray, Scene, Surface};

use super::map::{SAME_NORMAL, SAME_PLANE};
use crate::Rng;

/// Tested points in a row of the square that is mapped to the disc.
const ROW: u32 = 4;
/// The same where more is asked for and an edge is near.
const FINE_ROW: u32 = 8;
/// Rays that a test takes that is not precise, the one to its apex included.
pub(super) const RAYS: usize = (ROW * ROW) as usize + 1;

/// Rounding of places, as a share of the largest coordinate.
const ROUNDING: f32 = 8.0 * f32::EPSILON;

/// How photons inside a disc count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kernel {
    /// All alike.
    Constant,
    /// By 2 (1 - d^2 / r^2) (Epanechnikov), which blurs less at equal noise where the irradiance changes.
    Epanechnikov,
}

impl Kernel {
    /// What a photon counts at this square of its distance, as a share of the radius: 1 in the mean.
    pub(super) fn weight(self, distance_sq: f32) -> f32 {
        match self {
            Self::Constant => 1.0,
            Self::Epanechnikov => 2.0 * (1.0 - distance_sq),
        }
    }
}

/// Returns the share of the disc around `p`, in the plane of the unit normal `n`, that is surface of the same kind as
/// photons must lie on to count, and visible from above; in [1/16, 1], for the point itself is there. Places count as
/// much as the kernel lets photons count there.
///
/// By [`Kernel::Constant`] its deviation is at most 0.06, beside a straight edge about 0.03 (16 stratified points). By
/// [`Kernel::Epanechnikov`] it is up to 0.1 there, by which corners would be dotted in the picture; so where it is to be
/// `precise` there are 64 points, which leave 0.025. Whether an edge is near tell four points of the rim that do not
/// count themselves, so that the mean is right.
pub(super) fn covered_share(
    scene: &Scene,
    p: Vec3A,
    n: Vec3A,
    radius: f32,
    kernel: Kernel,
    precise: bool,
    seed: u64,
) -> f32 {
    let frame = Frame::from_normal(n);
    let mut rng = Rng::new(seed, 0);
    // The apex stands as high as the disc is wide, or half way below what is in the way. Its ray starts a little above
    // the point, which is rounded and may lie behind the surface.
    let rounding = ROUNDING * p.abs().max_element();
    let start = (1e-3 * radius).max(rounding);
    let up = Ray { t_max: radius, ..Ray::new(p + n * start, n) };
    let height = start + scene.intersect(&up).map_or(radius, |hit| 0.5 * hit.t);
    let apex = p + n * height;

    let counts = |surface: Surface| {
        surface.ng.dot(n) > SAME_NORMAL
            && (surface.p - p).dot(n).abs() < SAME_PLANE * radius + rounding
            && scene.materials()[surface.material as usize].is_diffuse()
    };
    let is_there = |unit_disk: Vec2| {
        let disk = unit_disk * radius;
        let way = frame.s * disk.x + frame.t * disk.y - n * height;
        let distance = way.length();
        let ray = Ray::new(apex, way / distance);
        let hit = scene.intersect(&ray);
        hit.is_some_and(|hit| counts(scene.surface(&ray, &hit)))
            || scene.holes(&ray, hit.map_or(ray.t_max, |hit| hit.t)).any(counts)
    };
    let mut has_edge = || {
        let rim = Vec2::from_angle(std::f32::consts::TAU * rng.next_1d());
        [rim, rim.perp(), -rim, -rim.perp()].into_iter().any(|place| !is_there(place))
    };
    let row = if precise && has_edge() { FINE_ROW } else { ROW };

    let (mut covered, mut total) = (0.0, 0.0);
    for cell in 0..row * row {
        let corner = Vec2::new((cell % row) as f32, (cell / row) as f32);
        let unit_disk = square_to_disk((corner + rng.next_2d()) / row as f32);
        let weight = kernel.weight(unit_disk.length_squared());
        total += weight;
        if is_there(unit_disk) {
            covered += weight;
        }
    }
    (covered / total).max(1.0 / (ROW * ROW) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use scene::{Description, Material, Mesh};

    /// A scene of rectangles, each by a corner and two sides.
    fn scene(rectangles: &[[Vec3; 3]]) -> Scene {
        let meshes = rectangles.iter().map(|&[corner, s, t]| Mesh {
            positions: vec![corner, corner + s, corner + s + t, corner + t],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            materials: vec![0, 0],
            ..Mesh::default()
        });
        let materials = vec![Material::default()];
        Scene::new(Description { meshes: meshes.collect(), materials, ..Description::default() }).unwrap()
    }

    fn mean(scene: &Scene, p: Vec3A, radius: f32) -> f32 {
        mean_and_deviation(scene, p, radius, Kernel::Constant, false).0
    }

    fn mean_and_deviation(scene: &Scene, p: Vec3A, radius: f32, kernel: Kernel, precise: bool) -> (f32, f32) {
        let share = |seed| covered_share(scene, p, Vec3A::Z, radius, kernel, precise, seed);
        let shares: Vec<f32> = (0..200).map(share).collect();
        let mean = shares.iter().sum::<f32>() / 200.0;
        (mean, (shares.iter().map(|share| (share - mean).powi(2)).sum::<f32>() / 199.0).sqrt())
    }

    const FLOOR: [Vec3; 3] = [Vec3::ZERO, Vec3::X, Vec3::Y];

    #[test]
    fn a_disc_loses_what_an_edge_cuts() {
        let scene = scene(&[FLOOR]);
        let edge = [(0.0, 0.5), (0.25, 0.657_481), (0.5, 0.804_499), (0.75, 0.927_853), (1.01, 1.0)];
        for (t, share) in edge {
            let found = mean(&scene, Vec3A::new(0.1 * t, 0.5, 0.0), 0.1);
            // A single test deviates by at most 0.06, 200 by 0.004.
            assert!((found - share).abs() < 0.02, "t = {t}: {found} instead of {share}");
        }
        let corner = mean(&scene, Vec3A::ZERO, 0.1);
        assert!((corner - 0.25).abs() < 0.02, "corner {corner}");
    }

    #[test]
    fn edges_in_the_picture_are_smooth() {
        let scene = scene(&[FLOOR]);
        // What Epanechnikov's kernel has of a disc whose middle lies t radii from a straight edge, by integration.
        for t in [0.0f32, 0.2, 0.4, 0.6, 0.8] {
            const STEPS: u16 = 1000;
            let strip = |step: u16| {
                let x = -t + (1.0 + t) * (f32::from(step) + 0.5) / f32::from(STEPS);
                (1.0 - x * x).powf(1.5) * 4.0 / 3.0 * (1.0 + t) / f32::from(STEPS)
            };
            let expected = (0..STEPS).map(strip).sum::<f32>() * 2.0 / std::f32::consts::PI;
            let p = Vec3A::new(0.1 * t, 0.5, 0.0);
            let (mean, deviation) = mean_and_deviation(&scene, p, 0.1, Kernel::Epanechnikov, true);
            assert!((mean - expected).abs() < 0.004, "t = {t}: {mean} instead of {expected}");
            assert!(deviation < 0.033, "t = {t}: {mean} +- {deviation}");
        }
    }

    #[test]
    fn walls_steps_and_low_ceilings_do_not_count() {
        let wall = [Vec3::X * 0.5, Vec3::Y, Vec3::Z];
        let through_wall = mean(&scene(&[FLOOR, wall]), Vec3A::new(0.55, 0.5, 0.0), 0.1);
        assert!((through_wall - 0.804_499).abs() < 0.02, "the floor behind a wall: {through_wall}");
        let upper = [Vec3::new(0.5, 0.0, 0.05), Vec3::X, Vec3::Y];
        let low = [Vec3::ZERO, Vec3::X * 0.5, Vec3::Y];
        let step = mean(&scene(&[low, upper]), Vec3A::new(0.5, 0.5, 0.0), 0.1);
        assert!((step - 0.5).abs() < 0.02, "a step of half the radius: {step}");
        let ceiling = [Vec3::Z * 0.01, Vec3::X, Vec3::Y];
        let beneath = mean(&scene(&[FLOOR, ceiling]), Vec3A::new(0.5, 0.5, 0.0), 0.1);
        assert_eq!(beneath, 1.0, "a ceiling near the floor is not in the way");
    }

    #[test]
    fn rounding_far_from_the_origin_covers_nothing_up() {
        // Neighbouring numbers are 6e-5 apart there, and points lie as much behind the floor.
        const HEIGHT: f32 = 855.67;
        let corner = Vec3::new(317.3, 699.1, HEIGHT);
        let scene = scene(&[[corner, 2.2 * Vec3::X, 3.5 * Vec3::Y]]);
        for below in [0.0, 6e-5, 1.2e-4] {
            let p = Vec3A::new(318.2, 700.7, HEIGHT - below);
            for radius in [2e-3, 0.1] {
                assert_eq!(mean(&scene, p, radius), 1.0, "a disc of {radius} m, its middle {below} m below the floor");
            }
        }
    }
}
