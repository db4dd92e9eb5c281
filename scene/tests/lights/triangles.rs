//! Triangles and polygons as lights.

use glam::{Vec3, Vec3A};

use crate::measure::{assert_densities_agree, assert_irradiance, irradiance, polygon_light};

#[test]
fn irradiance_of_polygon_is_lamberts_formula() {
    // Values of Lambert's formula, checked by area sampling.
    let square =
        [Vec3::new(-1.0, -1.0, 1.0), Vec3::new(-1.0, 1.0, 1.0), Vec3::new(1.0, 1.0, 1.0), Vec3::new(1.0, -1.0, 1.0)];
    let scene = polygon_light(&square);
    let (sin, cos) = 60f32.to_radians().sin_cos();
    assert_irradiance(scene.lights(), Vec3A::Z, 1.740_839_502_734, 1.0, "a square overhead");
    assert_irradiance(scene.lights(), Vec3A::new(sin, 0.0, cos), 0.909_067_569_058, 1.5, "a square aslant");
    assert_irradiance(scene.lights(), Vec3A::X, 0.350_188_287_714, 2.0, "a square half below the horizon");
    let triangle = polygon_light(&[Vec3::new(1.0, 0.0, 1.0), Vec3::new(-1.0, -1.0, 2.0), Vec3::new(0.0, 1.0, 1.0)]);
    assert_irradiance(triangle.lights(), Vec3A::Z, 0.687_617_388_735, 1.0, "a triangle");
    let behind: Vec<Vec3> = square.into_iter().rev().collect();
    let (mean, _) = irradiance(polygon_light(&behind).lights(), Vec3A::ZERO, Vec3A::Z, 1000);
    assert_eq!(mean, 0.0, "nothing from the back");
}

#[test]
fn light_touching_a_wall_keeps_its_deviation() {
    for (s, expected) in [(1.0, 0.223_346_63), (0.1, 1.327_463_84), (0.01, 1.546_162_95), (0.001, 1.568_332_68)] {
        let corners =
            [Vec3::new(0.0, -0.5, s), Vec3::new(0.0, 0.5, s), Vec3::new(1.0, 0.5, s), Vec3::new(1.0, -0.5, s)];
        let scene = polygon_light(&corners);
        assert_irradiance(scene.lights(), Vec3A::X, expected, 1.5, &format!("a light {s} above"));
    }
}

#[test]
fn far_small_and_thin_lights_are_exact() {
    let tiny = 1e-6;
    let height = tiny * 3f32.sqrt() / 2.0;
    let triangle = [Vec3::new(0.0, 0.0, 1.0), Vec3::new(0.5 * tiny, height, 1.0), Vec3::new(tiny, 0.0, 1.0)];
    assert_irradiance(
        polygon_light(&triangle).lights(),
        Vec3A::Z,
        3f64.sqrt() / 4.0 * 1e-12,
        1e-3,
        "an edge of a micrometre",
    );
    // A strip 1e-4 wide from below the horizon to near the zenith: L times the integral of z dw, by quadrature along
    // it.
    let strip =
        [Vec3::new(-1.0, 0.0, 0.1), Vec3::new(-1.0, 1e-4, 0.1), Vec3::new(1.0, 1e-4, 0.1), Vec3::new(1.0, 0.0, 0.1)];
    let n = 100_000;
    let sum: f64 = (0..n)
        .map(|i| -1.0 + 2.0 * (f64::from(i) + 0.5) / f64::from(n))
        .map(|x| 0.01 / (x * x + 0.01f64).powi(2))
        .sum();
    assert_irradiance(polygon_light(&strip).lights(), Vec3A::Z, 1e-4 * sum * 2.0 / f64::from(n), 1.5, "a strip");
}

#[test]
fn densities_agree_for_triangles_near_and_far() {
    for (size, height, depth) in [(3.0, 1.0, 1.0), (3.0, 3.5, 1.0), (0.3, 30.0, 2e-4)] {
        let corners = [
            Vec3::new(-1.0, -1.0, 1.0),
            Vec3::new(-1.0, 1.0, 1.0),
            Vec3::new(1.0, 1.0, 1.4),
            Vec3::new(1.0, -1.0, 1.4),
        ];
        let scene = polygon_light(&corners.map(|c| c * Vec3::new(size, size, height)));
        assert_densities_agree(&scene, depth);
    }
}
