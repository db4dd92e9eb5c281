//! The sky as a light.

use std::f32::consts::PI;

use glam::{Vec3, Vec3A};
use scene::{Description, Environment, Material, Mesh, Ray, Scene, SpecularKind};

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
            assert!(scene.lights().pdf_environment(wi) > 0.0, "{wi} shines and is never chosen");
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

#[test]
fn photons_for_mirrors_bring_what_all_photons_bring() {
    // A wide floor, a row of mirrors in which the sky sees one behind the other, and a small one elsewhere.
    let square = |middle: Vec3, size: f32, material| Mesh {
        positions: [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
            .map(|(x, z)| middle + size * Vec3::new(z, 0.0, x))
            .to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        materials: vec![material; 2],
        ..Mesh::default()
    };
    let silver = SpecularKind::Mirror { reflectance: Vec3::ONE };
    let mirrors: [(Vec3, f32); 6] = std::array::from_fn(|i| match i {
        0 => (Vec3::new(-100.0, 50.0, 80.0), 0.5),
        i => (Vec3::new(3.0 * i as f32, 2.0 + i as f32, 0.0), 1.0),
    });
    let squares = mirrors.iter().map(|&(middle, size)| square(middle, size, 1));
    let description = Description {
        meshes: std::iter::once(square(Vec3::ZERO, 1000.0, 0)).chain(squares).collect(),
        materials: vec![Material::default(), Material { specular: silver, ..Material::default() }],
        environment: Some(Environment::constant(Vec3::splat(0.5))),
        ..Description::default()
    };
    let scene = Scene::new(description).unwrap();
    let target = scene.target(Material::has_delta);
    let (mut random, n) = (Random(7), 400_000);
    let (mut tops, mut hits, mut met) = ([0.0; 6], [0u32; 6], 0);
    for _ in 0..n {
        let emission = scene.lights().emit_to(&target, random.next(), random.pair(), random.pair()).expect("a sky");
        let Some(hit) = scene.intersect(&emission.ray) else { continue };
        if hit.primitive >= 2 {
            met += 1;
            if emission.ray.direction.y < 0.0 {
                let mirror = hit.primitive as usize / 2 - 1;
                tops[mirror] += f64::from(emission.flux.x) / f64::from(n);
                hits[mirror] += 1;
            }
        }
    }
    // A sixth of the spheres' cross-section is that of the squares, seen at a mean cosine of a half; 4 km^2 of floor would have nearly all.
    assert!(met > n / 10, "{met} of {n}");
    // How much of the sky each sees: uniform on its top, and over the hemisphere by cosine.
    let mut open = [0.0; 6];
    for _ in 0..n {
        let u = random.pair();
        let w = hemimap::square_to_cosine_hemisphere(random.pair());
        for (open, (middle, size)) in open.iter_mut().zip(mirrors) {
            let p = middle + size * Vec3::new(u.x - 0.5, 1e-4, u.y - 0.5);
            let ray = Ray::new(p.into(), Vec3A::new(w.y, w.z, w.x));
            *open += f64::from(u8::from(!scene.occluded(&ray))) / f64::from(n);
        }
    }
    for (i, (middle, size)) in mirrors.into_iter().enumerate() {
        let expected = f64::from(0.5 * PI * size * size) * open[i];
        // Five deviations of the photons that it met, and the share of the sky is known to a thousandth.
        let tolerance = 5.0 / f64::from(hits[i]).sqrt() + 0.005;
        assert!((tops[i] / expected - 1.0).abs() < tolerance, "the mirror at {middle} has {}, not {expected}", tops[i]);
    }
}
