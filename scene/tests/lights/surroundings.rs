//! The sky as a light.

use std::f32::consts::PI;

use glam::{Vec3, Vec3A};
use scene::{Description, Environment, Scene};

use crate::measure::{Random, assert_densities_agree, irradiance};

/// A dark picture with a few bright pixels, at its edge and poles too.
fn spotted(width: u32, height: u32) -> Environment {
    let mut pixels = vec![Vec3::ZERO; (width * height) as usize];
    for (i, value) in [
        (0, 3.0),
        (width as usize - 1, 1.0),
        (5 * width as usize + 7, 100.0),
        (pixels.len() - 2, 10.0),
        (9 * width as usize, 7.0),
    ] {
        pixels[i] = Vec3::new(value, 0.5 * value, 0.0);
    }
    Environment::from_pixels(width, height, pixels)
}

fn sky_scene(environment: Environment) -> Scene {
    Scene::new(Description { environment: Some(environment), ..Description::default() }).expect("a right scene")
}

#[test]
fn densities_agree_for_surroundings() {
    assert_densities_agree(&sky_scene(Environment::constant(Vec3::ONE)), 2.0);
    assert_densities_agree(&sky_scene(Environment::sky()), 2.0);
    assert_densities_agree(&sky_scene(spotted(16, 12)), 2.0);
}

#[test]
fn surroundings_are_sampled_wherever_they_shine() {
    let scene = sky_scene(spotted(16, 12));
    let mut random = Random(2);
    let mut lit = 0;
    for _ in 0..100_000 {
        let wi = random.direction();
        if scene.background(wi) != Vec3::ZERO {
            lit += 1;
            assert!(scene.lights().pdf_environment(Vec3A::ZERO, wi) > 0.0, "{wi} shines and is never chosen");
        }
    }
    assert!(lit > 1000, "some directions shine: {lit}");
    // The irradiance by samples and by uniform directions.
    let (mean, deviation) = irradiance(scene.lights(), Vec3A::ZERO, Vec3A::Y, 200_000);
    let n = 2_000_000;
    let uniform =
        (0..n).map(|_| random.direction()).map(|w| f64::from(scene.background(w).x * w.y.max(0.0))).sum::<f64>()
            * f64::from(4.0 * PI)
            / f64::from(n);
    assert!((mean / uniform - 1.0).abs() < 2e-2 && deviation < 2.0, "{mean} (deviation {deviation}) is not {uniform}");
}

#[test]
fn surroundings_lie_as_documented() {
    // One bright pixel in each of the four directions, a quarter of the picture apart.
    let (width, height) = (8u32, 5u32);
    for (column, direction) in [(0, -Vec3A::Z), (2, Vec3A::X), (4, Vec3A::Z), (6, -Vec3A::X)] {
        let mut pixels = vec![Vec3::ZERO; (width * height) as usize];
        // The direction lies on the border between two texels: both shine.
        for i in [(column + width - 1) % width, column] {
            pixels[(2 * width + i) as usize] = Vec3::ONE;
        }
        let environment = Environment::from_pixels(width, height, pixels);
        assert!((environment.radiance(direction) - 1.0).abs().max_element() < 1e-5, "column {column}");
        assert!(environment.radiance(-direction).max_element() < 1e-5, "opposite of column {column}");
    }
    let mut pixels = vec![Vec3::ZERO; (width * height) as usize];
    pixels[..width as usize].fill(Vec3::ONE);
    let environment = Environment::from_pixels(width, height, pixels);
    assert_eq!(environment.radiance(Vec3A::Y), Vec3::ONE, "the first row is up");
    assert_eq!(environment.radiance(-Vec3A::Y), Vec3::ZERO, "the last row is down");
}
