//! The path tracer against closed forms, term by term.

mod common;

use std::f64::consts::PI;

use common::{Builder, assert_unbiased, black, estimate, glass, lambert, lamp, mirror, polygon_irradiance};
use glam::{DVec3, UVec2, Vec3, Vec3A};
use integrator::{Method, PathTracer, Sampler, Settings, render};
use scene::{Material, Ray, SpecularKind};

#[test]
fn closed_room_of_emitters_has_radiance_le_over_one_minus_a() {
    // L = Le / (1 - a), of it Le emitted, a Le direct and a^2 Le / (1 - a) indirect.
    for (albedo, samples) in [(0.0, 1), (0.5, 1000), (0.9, 4000)] {
        let scene = Builder::default().cube_room(&Material { diffuse: Vec3::splat(albedo), ..lamp(1.0) }).build();
        let result = estimate(&scene, Vec3A::new(0.1, 0.2, -0.3), Vec3A::new(0.3, -0.5, 0.8), samples);
        let a = f64::from(albedo);
        assert_unbiased(&result.emitted, 1.0, 1e-5, "emitted");
        assert_unbiased(&result.sum, 1.0 / (1.0 - a), 5e-3, &format!("sum, a = {a}"));
        if a > 0.0 {
            assert_unbiased(&result.direct, a, 5e-3, &format!("direct, a = {a}"));
            assert_unbiased(&result.indirect, a * a / (1.0 - a), 5e-3, &format!("indirect, a = {a}"));
        }
        assert!(result.specular.iter().chain(&result.caustic).all(|&x| x == 0.0), "no mirror, no glass");
    }
}

#[test]
fn free_form_room_shines_as_the_cube_does() {
    // Its light is never sampled, only met; with a = 0.9 roulette decides for most paths.
    for (albedo, samples) in [(0.5, 1000), (0.9, 8000)] {
        let wall = Material { diffuse: Vec3::splat(albedo), ..lamp(1.0) };
        let scene = Builder::default().unit_ball(true, wall).build();
        let result = estimate(&scene, Vec3A::new(0.1, 0.2, -0.3), Vec3A::new(0.3, -0.5, 0.8), samples);
        let a = f64::from(albedo);
        assert_unbiased(&result.sum, 1.0 / (1.0 - a), 5e-3, &format!("sum, a = {a}"));
    }
}

#[test]
fn integrating_sphere_is_uniform() {
    // rho = 0.5, R = 1, I = 1: all bounces together add E = rho / (1 - rho) I / R^2 = 1 at every point.
    let scene = Builder::default().unit_ball(true, lambert(0.5)).point_light(Vec3::new(0.0, 0.0, 0.6), 1.0).build();
    for direction in [Vec3A::Z, Vec3A::X, Vec3A::new(0.5, 0.2, -1.0)] {
        let result = estimate(&scene, Vec3A::ZERO, direction, 2000);
        let to_light = DVec3::Z * 0.6 - direction.as_dvec3().normalize();
        let distance_sq = to_light.length_squared();
        let cosine = -to_light.dot(direction.as_dvec3().normalize()) / distance_sq.sqrt();
        assert_unbiased(&result.direct, 0.5 / PI * cosine / distance_sq, 1e-4, "direct, without noise");
        assert_unbiased(&result.indirect, 0.5 / PI, 5e-3, "indirect");
    }
}

#[test]
fn irradiance_of_polygon_is_lamberts_formula() {
    // A white Lambert floor of radiance E / pi, seen from the side so that the viewer is not in the light's way.
    let square = |x, y| Vec3::new(x, y, 1.0);
    let above = [square(-1.0, -1.0), square(-1.0, 1.0), square(1.0, 1.0), square(1.0, -1.0)];
    let upright = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(y, z)| Vec3::new(0.5, -y, z));
    let tilted = Vec3::new(3f32.sqrt() / 2.0, 0.0, 0.5);
    let cases: [(&[Vec3], Vec3, f64); 4] = [
        (&above, Vec3::Z, 1.740_839_502_734),
        (&above, tilted, 0.909_067_569_058),
        (&above, Vec3::X, 0.350_188_287_714),
        (&upright, Vec3::Z, 0.780_804_588_917),
    ];
    for (corners, normal, irradiance) in cases {
        // The floor is small, so that it does not cut the light.
        let scene =
            Builder::default().square(Vec3::ZERO, normal, 1e-3, lambert(1.0)).polygon(corners, lamp(1.0)).build();
        let eye = normal * 0.1 + Vec3::Y * 0.3;
        let result = estimate(&scene, eye.into(), (-eye).into(), 2000);
        assert_unbiased(&result.direct, irradiance / PI, 5e-3, &format!("{irradiance}"));
        assert_eq!(result.direct, result.sum, "nothing but direct light");
    }
}

#[test]
fn plane_under_sun_and_sky() {
    // Lo = (rho / pi) (S cos theta + pi L).
    let scene = Builder::default()
        .square(Vec3::ZERO, Vec3::Z, 10.0, lambert(0.5))
        .directional_light(Vec3::new(-3f32.sqrt() / 2.0, 0.0, -0.5), 3.0)
        .sky(0.2)
        .build();
    for direction in [Vec3A::NEG_Z, Vec3A::new(1.0, 0.0, -0.01)] {
        let result = estimate(&scene, -direction * 2.0, direction, 1000);
        assert_unbiased(&result.direct, 0.338_732, 5e-3, "direct");
        assert_eq!(result.direct, result.sum, "one bounce is all there is");
    }
}

#[test]
fn mirror_equals_virtual_image() {
    // A lamp above a floor and beside a large mirror x = 0: its image is a second lamp of 0.8 times the radiance, whose
    // light is a caustic.
    let corner = |x, y| Vec3::new(x, y, 1.0);
    let corners = [corner(0.5, -0.5), corner(0.5, 0.5), corner(1.5, 0.5), corner(1.5, -0.5)];
    let scene = Builder::default()
        .square(Vec3::ZERO, Vec3::X, 1e3, mirror(0.8))
        .square(Vec3::X * 2.0, Vec3::Z, 1e-2, lambert(0.6))
        .polygon(&corners, lamp(1.0))
        .build();
    let seen_from = |image: f64| {
        let corners = corners.map(|c| DVec3::new(f64::from(c.x) * image - 2.0, f64::from(c.y), 1.0));
        polygon_irradiance(&corners, DVec3::Z)
    };
    let result = estimate(&scene, Vec3A::new(2.0, 1.0, 0.5), Vec3A::new(0.0, -1.0, -0.5), 24_000);
    assert_unbiased(&result.direct, 0.6 / PI * seen_from(1.0), 5e-3, "the lamp");
    assert_unbiased(&result.caustic, 0.6 / PI * 0.8 * seen_from(-1.0), 5e-3, "its image");
    assert!(result.indirect.iter().chain(&result.specular).all(|&x| x == 0.0), "nothing else");

    // The lamp seen in the mirror is direct; the floor seen in it is specular, whatever lit it.
    let lamp_in_mirror = estimate(&scene, Vec3A::new(1.0, 0.0, 0.5), Vec3A::new(-2.0, 0.0, 0.5), 1);
    assert_unbiased(&lamp_in_mirror.direct, 0.8, 1e-5, "the lamp in the mirror");
    let floor_in_mirror = estimate(&scene, Vec3A::new(0.6, 0.0, 0.65), Vec3A::new(-2.6, 0.0, -0.65), 8000);
    let floor = 0.6 / PI * (seen_from(1.0) + 0.8 * seen_from(-1.0));
    assert_unbiased(&floor_in_mirror.specular, 0.8 * floor, 5e-3, "the floor in the mirror");
    assert_eq!(floor_in_mirror.specular, floor_in_mirror.sum, "the floor in the mirror is specular alone");
}

#[test]
fn clear_glass_vanishes_in_a_white_furnace() {
    // Refraction in and out cancels, and Fresnel's choice is by its own share: but for roulette every path weighs 1.
    let scene = Builder::default().unit_ball(false, glass(1.5)).sky(1.0).build();
    for offset in [0.0, 0.5, 0.9, 0.999] {
        let result = estimate(&scene, Vec3A::new(offset, 0.0, 3.0), Vec3A::NEG_Z, 1000);
        // Deaths by roulette are too rare for a spread: at most 1 in 50 paths meets it, and then changes by 1 in 100.
        let mean = result.sum.iter().sum::<f64>() / result.sum.len() as f64;
        assert!((mean - 1.0).abs() < 1e-3, "offset {offset}: {mean}");
        assert!(result.emitted.iter().chain(&result.caustic).chain(&result.indirect).all(|&x| x == 0.0), "terms");
    }
}

#[test]
fn light_through_a_pane_is_caustic_below_and_specular_above() {
    // Solid glass between z = 1 and 2 over a floor so small that its own image does not count. Under a sky of 1 on both
    // sides the floor receives pi, all of it by glass.
    let scene = Builder::default()
        .square(Vec3::Z, Vec3::NEG_Z, 1e4, glass(1.5))
        .square(Vec3::Z * 2.0, Vec3::Z, 1e4, glass(1.5))
        .square(Vec3::ZERO, Vec3::Z, 1e-3, lambert(0.5))
        .sky(1.0)
        .build();
    let below = estimate(&scene, Vec3A::new(0.3, 0.0, 0.5), Vec3A::new(-0.3, 0.0, -0.5), 1000);
    assert_unbiased(&below.caustic, 0.5, 5e-3, "the floor from below the pane");
    // Straight down through the pane: R = 0.04 a face, T = (1 - R)^2 / (1 - R^2) = 0.923077, 1 - T mirrored.
    let above = estimate(&scene, Vec3A::new(0.0, 0.0, 3.0), Vec3A::NEG_Z, 4000);
    assert_unbiased(&above.direct, 0.04, 2e-2, "the sky in the upper face");
    assert_unbiased(&above.sum, 0.923_077 * 0.5 + 0.076_923, 5e-3, "the floor and the sky in both faces");
    assert!(above.caustic.iter().chain(&above.indirect).all(|&x| x == 0.0), "glass has no diffuse part");
}

#[test]
fn light_that_overflows_is_dropped_and_counted() {
    // Two sheets so small that their flux is within single precision, though not the light that they send each other.
    let bright = Material { diffuse: Vec3::splat(0.9), ..lamp(3e38) };
    let scene = Builder::default()
        .square(Vec3::X * 0.01, Vec3::NEG_X, 0.1, bright.clone())
        .square(Vec3::NEG_X * 0.01, Vec3::X, 0.1, bright)
        .build();
    let mut tracer = PathTracer::new(&scene);
    let sample = tracer.trace(&Ray::new(Vec3A::ZERO, Vec3A::X), &mut Sampler::new(0, 0, 0));
    assert_eq!(tracer.dropped_samples, 1, "3e38 and more on top is infinite");
    assert_eq!(sample.terms.sum(), Vec3::ZERO, "and counts as black");
}

#[test]
fn albedo_one_in_a_closed_room_ends() {
    let scene = Builder::default().cube_room(&Material { diffuse: Vec3::ONE, ..lamp(1.0) }).build();
    let mut tracer = PathTracer::new(&scene);
    for sample in 0..1000 {
        tracer.trace(&Ray::new(Vec3A::ZERO, Vec3A::X), &mut Sampler::new(3, 0, sample));
    }
    // Survival 0.99: a path has 103 vertices on average, deviation 100; 4.5 of 100 / sqrt(1000).
    let length = tracer.rays.path as f64 / 1000.0;
    assert!((length - 103.0).abs() < 15.0, "mean length {length}");
    assert_eq!(tracer.cut_paths, 0, "none reaches the hard limit");
}

#[test]
fn a_lamp_is_found_where_walls_hide_the_sun() {
    let gloss = SpecularKind::Ggx { alpha: 0.3, reflectance: Vec3::splat(0.4), schlick: false };
    let plastic = Material { specular: gloss, ..lambert(0.5) };
    let mean = |room: Builder| {
        let scene = room.camera(Vec3::new(0.5, -0.9, 0.1), Vec3::new(0.0, 1.0, -0.3), Vec3::Z, 70.0).build();
        let settings = Settings { method: Method::Path, size: UVec2::splat(32), spp: Some(64), ..Settings::default() };
        let film = render(&scene, &settings, &|_| ()).unwrap().film;
        film.picture().iter().map(|radiance| f64::from(radiance.x)).sum::<f64>() / 1024.0
    };
    for material in [lambert(0.5), plastic] {
        // A point that no path meets, and a lamp that lobes meet as often as light samples.
        let lit: [fn(Builder) -> Builder; 2] = [
            |room| room.point_light(Vec3::Z * 0.5, 1.0),
            |room| room.square(Vec3::Z * 0.9, Vec3::NEG_Z, 0.2, lamp(5.0)),
        ];
        for lit in lit {
            let room = || lit(Builder::default().cube_room(&material));
            let [alone, both] = [mean(room()), mean(room().directional_light(Vec3::new(0.2, 0.1, -1.0), 1e5))];
            assert!((both / alone - 1.0).abs() < 0.02, "{both} instead of {alone}");
        }
    }
}

#[test]
fn every_pixel_has_its_samples_and_the_threads_do_not_matter() {
    let scene = Builder::default()
        .cube_room(&lambert(0.7))
        .square(Vec3::Z * 0.99, Vec3::NEG_Z, 0.3, lamp(5.0))
        .square(Vec3::new(-0.9, 0.0, 0.0), Vec3::X, 0.4, mirror(0.9))
        .square(Vec3::new(0.4, 0.2, -0.3), Vec3::new(-1.0, 0.2, 0.5), 0.3, black())
        .camera(Vec3::new(0.5, -0.9, 0.1), Vec3::new(0.0, 1.0, 0.0), Vec3::Z, 70.0)
        .build();
    let settings =
        Settings { method: Method::Path, size: UVec2::new(23, 17), spp: Some(3), seed: 5, ..Settings::default() };
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut rendering = pool.install(|| render(&scene, &settings, &|_| ())).unwrap();
        rendering.statistics.render_seconds = 0.0;
        rendering.statistics.phases.clear();
        rendering
    };
    let one = with_threads(1);
    assert_eq!(one.statistics.rays.camera, 23 * 17 * 3, "exactly 3 a pixel");
    assert_eq!(one, with_threads(2), "two threads");
    assert_eq!(one, with_threads(3), "three threads");
    assert!(one.film.alpha.iter().all(|&alpha| alpha == 1.0), "a closed room fills every pixel");
}
