//! Photon maps against closed forms, through the public interface.

mod common;

use std::f32::consts::{FRAC_1_PI, PI};

use common::{Builder, black, glass, lambert, lamp, mirror};
use glam::{DVec3, Vec3, Vec3A};
use integrator::{FluxBalance, PhotonMaps, PhotonSettings, Rng};
use scene::Material;

fn settings(count: u32) -> PhotonSettings {
    PhotonSettings { count, caustic_count: count, seed: 3, ..PhotonSettings::default() }
}

/// Asserts that no flux was lost: to 1e-9 by the books, and within 4.5 deviations of the count for what roulette added
/// or took.
fn assert_balanced(balance: &FluxBalance, shot: u64, what: &str) {
    let FluxBalance { emitted, absorbed, escaped, stopped, roulette } = *balance;
    let difference = (emitted - absorbed - escaped - stopped - roulette).abs().max_element();
    assert!(difference <= 1e-9 * emitted.max_element(), "{what}: {balance:?}");
    // A photon that lives through many bounces gains or loses about its own flux at each: deviation some 3 photons.
    let limit = 4.5 * 3.0 * emitted.max_element() / (shot as f64).sqrt();
    assert!(roulette.abs().max_element() < limit, "{what}: roulette {roulette}");
}

#[test]
fn flux_is_conserved() {
    let room = |albedo| Material { diffuse: Vec3::new(albedo, 0.5 * albedo, 0.2), ..Material::default() };
    let closed = Builder::default()
        .cube_room(&room(0.8))
        .square(Vec3::Z * 0.9, Vec3::NEG_Z, 0.2, lamp(3.0))
        .ball(Vec3::new(0.3, 0.2, -0.5), 0.3, glass(1.5))
        .build();
    let maps = PhotonMaps::shoot(&closed, &settings(50_000));
    let balance = maps.global_counts.balance;
    assert_balanced(&balance, 50_000, "closed room");
    assert_eq!(balance.escaped, DVec3::ZERO, "nothing leaves a closed room");
    // pi L A = pi 3 0.16; the emitted flux is that of the photons that were shot, aimed by their density.
    let emitted = balance.emitted.x / (3.0 * 0.16 * std::f64::consts::PI);
    assert!((emitted - 1.0).abs() < 0.01, "emitted {emitted}");

    let open = Builder::default()
        .square(Vec3::ZERO, Vec3::Z, 1.0, room(0.8))
        .square(Vec3::X, Vec3::NEG_X, 1.0, mirror(0.9))
        .point_light(Vec3::new(0.2, 0.0, 0.5), 1.0)
        .build();
    let maps = PhotonMaps::shoot(&open, &settings(50_000));
    let balance = maps.global_counts.balance;
    assert_balanced(&balance, 50_000, "open scene");
    assert!(balance.escaped.x > 0.3 * balance.emitted.x, "half of the light goes up");
    assert_eq!(balance.stopped, DVec3::ZERO, "no photon reaches the limit");
}

#[test]
fn integrating_sphere_is_uniform() {
    // rho = 0.5, R = 1, I = 1: E = rho / (1 - rho) I / R^2 = 1 everywhere, without the direct light.
    let scene = Builder::default().unit_ball(true, lambert(0.5)).point_light(Vec3::new(0.0, 0.0, 0.6), 1.0).build();
    let maps = PhotonMaps::shoot(&scene, &settings(200_000));
    let mut rng = Rng::new(1, 0);
    let (mut sum, mut worst, count) = (0.0, 0f32, 2000);
    for _ in 0..count {
        let p = Vec3A::new(rng.next_1d() - 0.5, rng.next_1d() - 0.5, rng.next_1d() - 0.5).normalize();
        let found = maps.global_irradiance(p, -p).expect("photons are everywhere");
        sum += found.irradiance.x / count as f32;
        worst = worst.max((found.irradiance.x - 1.0).abs());
    }
    // 100,000 bounces of equal flux make the mean good to 0.5 %; 50 photons have a deviation of 0.144, and its upper
    // tail is long: of 2000 the worst may be 6 off.
    assert!((sum - 1.0).abs() < 0.01, "mean {sum}");
    assert!(worst < 1.0, "worst {worst}");
    assert!(maps.global_irradiance(Vec3A::Z, Vec3A::Z).is_none(), "no photon is on the outside");
    assert_eq!(maps.caustic_counts.shot, 0, "no mirror, no glass");
}

#[test]
fn corners_are_as_bright_as_the_middle() {
    // A closed room of emitters, a = 0.5: E = pi (2 - 1) of light that is not straight, at every point. Uncorrected it
    // would be a half at an edge and a quarter in a corner.
    let scene = Builder::default().cube_room(&Material { diffuse: Vec3::splat(0.5), ..lamp(1.0) }).build();
    // One map's mean over an edge or the corners has a deviation of 3 %: of eight, 5 % are 4.5 of them.
    let maps: Vec<PhotonMaps> =
        (0..8).map(|seed| PhotonMaps::shoot(&scene, &PhotonSettings { seed, ..settings(400_000) })).collect();
    let mean = |make: &dyn Fn(f32) -> (f32, f32)| {
        let values = (0..400).flat_map(|i| {
            let (x, y) = make(i as f32 / 400.0);
            let at = Vec3A::new(x, y, -1.0);
            maps.iter().map(move |maps| maps.global_irradiance(at, Vec3A::Z).map_or(0.0, |found| found.irradiance.x))
        });
        values.sum::<f32>() / (400.0 * 8.0) * FRAC_1_PI
    };
    let middle = mean(&|t| (t - 0.5, (17.0 * t).fract() - 0.5));
    let edge = mean(&|t| (0.99, 1.8 * t - 0.9));
    // All four corners, so that more than one estimate is seen.
    let corner = mean(&|t| {
        let (sx, sy) = (if t < 0.5 { 1.0 } else { -1.0 }, if (2.0 * t).fract() < 0.5 { 1.0 } else { -1.0 });
        (sx * (1.0 - 0.1 * (7.0 * t).fract()), sy * (1.0 - 0.1 * (13.0 * t).fract()))
    });
    assert!((middle - 1.0).abs() < 0.03, "middle {middle}");
    assert!((edge - 1.0).abs() < 0.05, "edge {edge}");
    assert!((corner - 1.0).abs() < 0.05, "corner {corner}");
}

#[test]
fn mirror_equals_virtual_image() {
    // Floor z = 0, mirror x = 0, light I = 1 at (1, 0, 1): the mirror adds r 10^-1.5 at (2, 0, 0).
    let scene = Builder::default()
        .square(Vec3::ZERO, Vec3::Z, 4.0, lambert(0.5))
        .square(Vec3::ZERO, Vec3::X, 20.0, mirror(0.8))
        .point_light(Vec3::new(1.0, 0.0, 1.0), 1.0)
        .build();
    let maps = PhotonMaps::shoot(&scene, &settings(400_000));
    let (mut sum, mut quick) = (0.0, 0.0);
    for i in 0..100 {
        // The closed form elsewhere: distance^2 is (1 + x)^2 + y^2 + 1.
        let (x, y) = (1.5 + 0.01 * i as f32, 0.04 * ((7 * i) % 100) as f32 - 2.0);
        let expected = 0.8 * ((1.0 + x).powi(2) + y * y + 1.0).powf(-1.5);
        let p = Vec3A::new(x, y, 0.0);
        sum += maps.caustic_irradiance(&scene, p, Vec3A::Z).x / expected / 100.0;
        quick += maps.quick_caustic_irradiance(p, Vec3A::Z).x / expected / 100.0;
    }
    // 100 estimates of 80 photons, about half of them independent: 0.13 / sqrt(50) = 0.018.
    assert!((sum - 1.0).abs() < 0.06, "ratio {sum}");
    assert!((quick - 1.0).abs() < 0.06, "ratio {quick} without the test of edges");
    assert_eq!(
        maps.caustic_irradiance(&scene, Vec3A::new(2.0, 0.0, 0.0), Vec3A::NEG_Z),
        Vec3::ZERO,
        "the floor's other side"
    );
}

#[test]
fn two_mirrors_make_a_row() {
    // Mirrors x = 0 and 1, light (0.5, 0, 1), r = 0.9: E(0.5, 0, 0) = sum of r^|k| (1 + k^2)^-1.5 = 1.8675305, of it 1
    // straight.
    let scene = Builder::default()
        .square(Vec3::ZERO, Vec3::Z, 3.0, lambert(0.5))
        .square(Vec3::ZERO, Vec3::X, 60.0, mirror(0.9))
        .square(Vec3::X, Vec3::NEG_X, 60.0, mirror(0.9))
        .point_light(Vec3::new(0.5, 0.0, 1.0), 1.0)
        .build();
    let maps = PhotonMaps::shoot(&scene, &settings(400_000));
    let values = (0..50).map(|i| {
        let p = Vec3A::new(0.5, 0.1 * (i as f32 / 25.0 - 1.0), 0.0);
        maps.caustic_irradiance(&scene, p, Vec3A::Z).x
    });
    let mean = values.sum::<f32>() / 50.0;
    // The segment of 0.2 holds some 20 independent estimates; the curvature over it changes E by 0.3 %.
    assert!((mean / 0.867_530 - 1.0).abs() < 0.08, "mean {mean}");
}

#[test]
fn refined_caustics_are_those_of_as_many_photons() {
    let scene = Builder::default()
        .cube_room(&lambert(0.5))
        .square(Vec3::Z * 0.9, Vec3::NEG_Z, 0.1, lamp(10.0))
        .square(Vec3::X * 0.9, Vec3::NEG_X, 0.5, mirror(0.9))
        .build();
    let caustic = |count| PhotonSettings { global: false, ..settings(count) };
    let mut maps = PhotonMaps::shoot(&scene, &caustic(50_000));
    let few = maps.caustic_counts;
    maps.refine_caustics(&scene, &caustic(40_000));
    assert_eq!(maps.caustic_counts, few, "there are more already");
    maps.refine_caustics(&scene, &PhotonSettings { caustic_neighbours: 300, ..caustic(400_000) });
    let counts = maps.caustic_counts;
    assert_eq!(counts.shot, 400_000);
    assert_balanced(&counts.balance, counts.shot, "both shots together");
    let at_once = PhotonMaps::shoot(&scene, &PhotonSettings { caustic_neighbours: 300, seed: 4, ..caustic(400_000) });
    let stored = counts.stored as f64 / at_once.caustic_counts.stored as f64;
    assert!((stored - 1.0).abs() < 0.05, "aimed as well: {stored} times as many");
    let emitted = counts.balance.emitted.x / at_once.caustic_counts.balance.emitted.x;
    assert!((emitted - 1.0).abs() < 0.02, "the flux of the lamp, not twice: {emitted}");
    let (mut sum, mut worst) = ([0.0; 2], 0f32);
    for i in 0..400 {
        let p = Vec3A::new(0.4 - 0.002 * i as f32, 0.002 * ((37 * i) % 400) as f32 - 0.4, -1.0);
        let found = [&maps, &at_once].map(|maps| maps.caustic_irradiance(&scene, p, Vec3A::Z).x);
        sum = [sum[0] + found[0], sum[1] + found[1]];
        worst = worst.max((found[0] / found[1] - 1.0).abs());
    }
    assert!((sum[0] / sum[1] - 1.0).abs() < 0.02, "the same light: {sum:?}");
    // Each is good to (4 / 3 / 300)^0.5 = 7 %.
    assert!(worst < 4.5 * 0.07 * 2f32.sqrt(), "no speck: {worst}");
}

#[test]
fn caustic_photons_are_aimed_at_small_glass() {
    // A bead far from the lamp that covers 1 in 2 million of its light.
    let (middle, radius) = (Vec3::new(0.7, 0.5, -0.9), 0.0016f32);
    let scene = Builder::default()
        .cube_room(&lambert(0.5))
        .square(Vec3::Z * 0.99, Vec3::NEG_Z, 0.02, lamp(100.0))
        .ball(middle, f64::from(radius), glass(1.5))
        .build();
    let counts = PhotonMaps::shoot(&scene, &settings(100_000)).caustic_counts;
    let share = counts.useful as f64 / counts.shot as f64;
    assert!(share > 0.5, "share of use {share}");
    assert_balanced(&counts.balance, counts.shot, "caustic photons");
    // What goes to the sphere around the ball's box, which has three times its cross-section.
    let offset = Vec3::Z * 0.99 - middle;
    let solid_angle = 3.0 * PI * radius * radius / offset.length_squared();
    let expected = f64::from(100.0 * 0.0016 * offset.normalize().z * solid_angle);
    let emitted = counts.balance.emitted.x / expected;
    assert!((emitted - 1.0).abs() < 0.01, "emitted {emitted}");
}

#[test]
fn mirrors_in_a_wide_landscape_are_met() {
    // Two mirrors of 20 cm, far apart, that stand at (0, y, 0.5) on 4 km of floor, each 10^-9 of what the sun sees of
    // it. It comes from 45 degrees and goes on with 0.8 of its light to x = 0.4 to 0.6 on the floor.
    let apart = Vec3::Y * 400.0;
    let scene = Builder::default()
        .square(Vec3::ZERO, Vec3::Z, 2000.0, lambert(0.5))
        .square(Vec3::Z * 0.5, Vec3::X, 0.1, mirror(0.8))
        .square(Vec3::Z * 0.5 + apart, Vec3::X, 0.1, mirror(0.8))
        .directional_light(Vec3::new(-1.0, 0.0, -1.0), 1.0)
        .build();
    let maps = PhotonMaps::shoot(&scene, &settings(100_000));
    let counts = maps.caustic_counts;
    let share = counts.useful as f64 / counts.shot as f64;
    assert!(share > 0.5, "share of use {share}");
    assert_balanced(&counts.balance, counts.shot, "caustic photons");
    for centre in [Vec3A::X * 0.5, Vec3A::X * 0.5 + Vec3A::from(apart)] {
        let places = (0..100).map(|i| Vec3A::new(0.01 * (i % 10) as f32 - 0.045, 0.01 * (i / 10) as f32 - 0.045, 0.0));
        let mean = places.map(|p| maps.caustic_irradiance(&scene, centre + p, Vec3A::Z).x / 100.0).sum::<f32>();
        // Photons are stratified; the disc's noise is some 2 %.
        assert!((mean / (0.8 * 0.5f32.sqrt()) - 1.0).abs() < 0.05, "{mean} at {centre}");
    }
}

#[test]
fn no_photons_gives_zero_and_not_nan() {
    let scene = Builder::default()
        .cube_room(&black())
        .ball(Vec3::ZERO, 0.1, mirror(1.0))
        .point_light(Vec3::Z * 0.5, 1.0)
        .build();
    let maps = PhotonMaps::shoot(&scene, &settings(20_000));
    assert_eq!((maps.global_counts.stored, maps.caustic_counts.stored), (0, 0), "black keeps nothing");
    assert!(maps.global_irradiance(Vec3A::NEG_Z, Vec3A::Z).is_none(), "no estimate");
    assert_eq!(maps.caustic_irradiance(&scene, Vec3A::NEG_Z, Vec3A::Z), Vec3::ZERO, "no caustic");

    let dark = Builder::default().cube_room(&lambert(0.5)).build();
    let maps = PhotonMaps::shoot(&dark, &settings(20_000));
    assert_eq!((maps.global_counts.shot, maps.rays.photon), (0, 0), "no light, no photon, no pilot");

    // Fewer photons than an estimate wants: it takes those that there are.
    let lit = Builder::default().cube_room(&lambert(0.5)).point_light(Vec3::Z * 0.5, 1.0).build();
    for count in [1, 2, 20] {
        let maps = PhotonMaps::shoot(&lit, &settings(count));
        let value = maps.global_irradiance(Vec3A::NEG_Z, Vec3A::Z).map_or(Vec3::ZERO, |found| found.irradiance);
        assert!(value.is_finite() && value.cmpge(Vec3::ZERO).all(), "{count}: {value}");
    }
}

#[test]
fn both_maps_of_light_that_only_a_mirror_brings_agree() {
    // A black box but for one white wall and a mirror: all that is stored came by the mirror, once in each map.
    let scene = Builder::default()
        .cube_room(&black())
        .square(Vec3::Z * -0.99, Vec3::Z, 0.9, lambert(0.5))
        .square(Vec3::Z * 0.99, Vec3::NEG_Z, 0.5, mirror(1.0))
        .point_light(Vec3::Z * 0.5, 1.0)
        .build();
    let maps = PhotonMaps::shoot(&scene, &settings(200_000));
    let (mut global, mut caustic) = (0.0, 0.0);
    for i in 0..400 {
        let p = Vec3A::new(0.002 * i as f32 - 0.4, 0.002 * ((37 * i) % 400) as f32 - 0.4, -0.99);
        global += maps.global_irradiance(p, Vec3A::Z).map_or(0.0, |found| found.irradiance.x);
        caustic += maps.caustic_irradiance(&scene, p, Vec3A::Z).x;
    }
    // The global map also has floor-mirror-floor light, about albedo x share seen x ... of it: bounded by a tenth.
    assert!(caustic > 0.0 && global >= 0.95 * caustic && global < 1.2 * caustic, "{global} and {caustic}");
}

#[test]
fn threads_do_not_matter() {
    let scene = Builder::default()
        .cube_room(&lambert(0.7))
        .square(Vec3::Z * 0.9, Vec3::NEG_Z, 0.2, lamp(3.0))
        .ball(Vec3::new(0.3, 0.2, -0.5), 0.3, glass(1.5))
        .build();
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut maps = pool.install(|| PhotonMaps::shoot(&scene, &settings(30_000)));
        maps.global_counts.seconds = 0.0;
        maps.caustic_counts.seconds = 0.0;
        let mut rng = Rng::new(9, 0);
        let lookups: Vec<_> = (0..500)
            .map(|_| {
                let p = Vec3A::new(2.0 * rng.next_1d() - 1.0, 2.0 * rng.next_1d() - 1.0, -1.0);
                (maps.global_irradiance(p, Vec3A::Z), maps.caustic_irradiance(&scene, p, Vec3A::Z))
            })
            .collect();
        (maps.global_counts, maps.caustic_counts, lookups)
    };
    let one = with_threads(1);
    assert!(one.2.iter().any(|(_, caustic)| caustic.x > 0.1 * PI), "the ball throws a caustic");
    assert_eq!(one, with_threads(2), "two threads");
    assert_eq!(one, with_threads(3), "three threads");
}
