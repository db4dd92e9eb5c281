//! Transparent bodies that overlap, with the priorities that say which of them is there.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use integrator::Method;
use scene::Scene;
use scene::freeform::{FreeForm, Psi, Quadric, Solid};
use tests::{Builder, Effort, METHODS, Pictures, Term, cuboid, film, glass, glass_before, lambert, lamp, measure};

/// Glass from 0 to 1 and water from -1 to 0.3, seen from above at 60 degrees from the normal.
fn slabs(glass_priority: i32) -> Scene {
    let slab = |bottom, top| cuboid(Vec3::new(-1e3, -1e3, bottom), Vec3::new(1e3, 1e3, top));
    let (sin, cos) = 60.0_f32.to_radians().sin_cos();
    Builder::default()
        .mesh(slab(0.0, 1.0), glass_before(1.5, 0.4, glass_priority))
        .mesh(slab(-1.0, 0.3), glass(1.33, 0.9))
        .sky(1.0)
        .view(Vec3::new(10.0 * sin, 0.0, 10.0 * cos), Vec3::ZERO, 1.0)
        .build()
}

/// What 60 degrees see of a sky of 1 through glass on water, both 1 thick, that absorb 0.4 and 0.9 a metre: transmitted
/// and reflected share, by the series of the reflections at three faces of (0.089185, 0.004895, 0.061192).
fn glass_on_water() -> f64 {
    let sin = 60.0_f64.to_radians().sin();
    let cos = |n: f64| (1.0 - (sin / n).powi(2)).sqrt();
    let face = |a: f64, b: f64| {
        let (ca, cb) = (cos(a), cos(b));
        let (across, along) = ((a * ca - b * cb) / (a * ca + b * cb), (b * ca - a * cb) / (b * ca + a * cb));
        0.5 * (across * across + along * along)
    };
    let (r1, r2, r3) = (face(1.0, 1.5), face(1.5, 1.33), face(1.33, 1.0));
    let (glass, water) = ((-0.4 / cos(1.5)).exp(), (-0.9 / cos(1.33)).exp());
    let inner = 1.0 / (1.0 - r2 * r3 * water * water);
    let below = r2 + (1.0 - r2).powi(2) * r3 * water * water * inner;
    let outer = 1.0 / (1.0 - r1 * below * glass * glass);
    let back = r1 + (1.0 - r1).powi(2) * below * glass * glass * outer;
    let through = (1.0 - r1) * glass * outer * (1.0 - r2) * (1.0 - r3) * water * inner;
    through + back
}

#[test]
fn water_that_overlaps_its_glass_has_three_faces() {
    let effort = Effort { path_spp: 64, spp: 64, seeds: 2, ..Effort::default() };
    for method in METHODS {
        measure(&slabs(1), method, &effort, |_| glass_on_water()).assert_unbiased("glass on water");
        let without = measure(&slabs(0), method, &effort, |_| glass_on_water());
        assert!((without.mean - 1.0).abs() > 0.02, "without priorities it is another: {}", without.mean);
    }
}

/// A ball of water in a shell of glass above a floor, under a lamp.
fn drop_in_a_shell(balls: impl FnOnce(Builder) -> Builder) -> Scene {
    let scene = Builder::default().square(Vec3::ZERO, Vec3::Z, 6.0, lambert(0.6)).sky(0.2);
    let scene = scene.square(Vec3::new(1.0, -1.0, 5.0), Vec3::NEG_Z, 0.7, lamp(10.0));
    balls(scene).view(Vec3::new(0.0, -5.0, 3.5), Vec3::new(0.0, 0.0, 0.9), 38.0).build()
}

#[test]
fn a_drop_that_reaches_into_its_shell_is_as_one_modelled_by_its_faces() {
    let centre = Vec3::Z * 1.2;
    let ball = |radius| {
        let quadric = Quadric::sphere(centre.as_dvec3(), radius).expect("a sphere");
        Solid::from(FreeForm::new(quadric, vec![]).expect("a ball"))
    };
    // Glass that is full, and in it water whose index is that over glass: one face between the two.
    let exact =
        drop_in_a_shell(|scene| scene.ball(centre, 1.0, glass(1.5, 0.0)).ball(centre, 0.8, glass(1.33 / 1.5, 0.7)));
    // A shell, and water that reaches half way into it.
    let overlapping = |priority| {
        let shell = Solid::difference(Psi::Maximum, vec![ball(1.0), ball(0.8)]).expect("a shell");
        drop_in_a_shell(|scene| {
            scene.solid(shell, glass_before(1.5, 0.0, priority)).ball(centre, 0.9, glass(1.33, 0.7))
        })
    };
    let effort = Effort { side: 24, seeds: 2, path_spp: 256, spp: 32, quality: 0.25, direct_fit: true };
    let sum = |scene: &Scene, method, seed| -> Vec<f64> {
        film(scene, method, &effort, seed).picture().iter().map(|radiance| f64::from(radiance.y)).collect()
    };
    for method in [Method::Path, Method::Reproject] {
        let pictures =
            |scene: &Scene| -> Vec<Vec<f64>> { (0..effort.seeds).map(|seed| sum(scene, method, seed)).collect() };
        let (expected, found) = (pictures(&exact), pictures(&overlapping(1)));
        let mean = |pictures: &[Vec<f64>]| pictures.iter().flatten().sum::<f64>();
        let ratio = mean(&found) / mean(&expected);
        tests::print(&format!("{}: {ratio:.5}", method.name()));
        // Pictures of the same seeds differ by rounding, and by what that makes of random choices.
        assert!((ratio - 1.0).abs() < 5e-3, "{}: {ratio} times what faces give", method.name());
        let share_off = |picture: &[f64]| {
            let off = picture.iter().zip(&expected[1]).filter(|(a, b)| (*a - *b).abs() > 0.1 * *b).count();
            off as f64 / picture.len() as f64
        };
        let (with, without) = (share_off(&found[1]), share_off(&sum(&overlapping(0), method, 1)));
        tests::print(&format!("{}: pixels off by a tenth: {with:.3} and {without:.3}", method.name()));
        assert!(with < 0.02 && without > 0.03, "{}: {with} with, {without} without priorities", method.name());
    }
}

#[test]
fn light_under_water_is_absorbed_on_all_its_ways() {
    // A round room full of water, which a ball of it around the room says: with L = Le + a g L at the wall, where g = 2
    // int exp(-2 s m) m dm is what is left of an even radiance across a ball of radius 1, and exp(-s) of it in the
    // middle.
    let (absorption, albedo) = (0.5_f64, 0.6);
    let twice = 2.0 * absorption;
    let g = 2.0 * (1.0 - (-twice).exp() * (1.0 + twice)) / (twice * twice);
    let wall = scene::Material { diffuse: Vec3::splat(0.6), ..lamp(1.0) };
    let scene = Builder::default()
        .ball_room(wall)
        .ball(Vec3::ZERO, 2.0, glass_before(1.33, 0.5, 1))
        .view(Vec3::ZERO, Vec3::new(0.4, -0.3, 0.5), 60.0)
        .build();
    let left = (-absorption).exp();
    let effort = Effort { path_spp: 128, spp: 64, seeds: 2, ..Effort::default() };
    for method in METHODS {
        let pictures = Pictures::new(&scene, method, &effort);
        pictures.relative(Term::All, |_| left / (1.0 - albedo * g)).assert_holds("a room of water");
        pictures.relative(Term::Direct, |_| left * albedo * g).assert_holds("direct");
        let indirect = left * (albedo * g).powi(2) / (1.0 - albedo * g);
        pictures.relative(Term::Indirect, |_| indirect).assert_holds("indirect");
    }
}

#[test]
fn shadow_rays_under_water_are_absorbed() {
    // A point light 1 m over the floor, the eye beside it; the surface of the water is too far away to send anything
    // back.
    let eye = Vec3::new(1.0, 0.0, 1.0);
    let scene = Builder::default()
        .square(Vec3::ZERO, Vec3::Z, 10.0, lambert(1.0))
        .point_light(Vec3::Z, 1.0)
        .mesh(cuboid(Vec3::splat(-50.0), Vec3::splat(50.0)), glass_before(1.33, 0.8, 1))
        .view(eye, Vec3::new(1.0, 0.0, 0.0), 3.0)
        .build();
    let known = |p: DVec3| {
        let distance = (p - DVec3::Z).length();
        (-0.8 * (distance + p.distance(eye.as_dvec3()))).exp() / (distance.powi(3) * PI)
    };
    let effort = Effort { seeds: 1, ..Effort::default() };
    for method in METHODS {
        let measured = measure(&scene, method, &effort, known);
        measured.assert_unbiased("under water");
        assert!((measured.mean - 1.0).abs() < 1e-4 && measured.worst < 5e-3, "no noise but that of the pixel");
    }
}
