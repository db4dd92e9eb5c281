//! Which light is chosen for a point.

use std::f32::consts::PI;

use glam::{DVec3, Vec3, Vec3A};
use scene::{Description, Environment, LightLesson, Mesh, PunctualLight, Ray, Scene, SeenLights};

use crate::measure::{Random, ball, emitter, form, irradiance};

/// Two triangles for each square of a half side at a height, which shine down.
fn squares(squares: &[(Vec3, f32)]) -> Mesh {
    let corner = |centre: Vec3, x: f32, y: f32| centre + Vec3::new(x, y, 0.0);
    let corners = |&(centre, a): &(Vec3, f32)| {
        [corner(centre, -a, -a), corner(centre, -a, a), corner(centre, a, a), corner(centre, a, -a)]
    };
    let faces = |i: u32| [[4 * i, 4 * i + 1, 4 * i + 2], [4 * i, 4 * i + 2, 4 * i + 3]];
    let count = u32::try_from(squares.len()).expect("a few");
    Mesh {
        positions: squares.iter().flat_map(corners).collect(),
        triangles: (0..count).flat_map(faces).collect(),
        materials: vec![0; 2 * squares.len()],
        ..Mesh::default()
    }
}

/// Lamps of radiance 1: squares, then a ball of radius 0.5 at (3, 0, 4); a point light, if it has an intensity; and a
/// sky.
fn mixed(lamps: &[(Vec3, f32)], intensity: f32, sky: f32) -> Scene {
    let point = PunctualLight::Point { position: Vec3::new(0.0, -2.0, 0.0), intensity: Vec3::splat(intensity) };
    let description = Description {
        meshes: vec![squares(lamps)],
        forms: vec![form(ball(DVec3::new(3.0, 0.0, 4.0), 0.5), 0)],
        materials: vec![emitter(1.0)],
        lights: if intensity > 0.0 { vec![point] } else { vec![] },
        environment: Some(Environment::constant(Vec3::splat(sky))),
        ..Description::default()
    };
    Scene::new(description).expect("a right scene")
}

#[test]
fn lights_are_chosen_by_what_they_may_bring() {
    let near = |height: f32| (Vec3::new(0.0, 0.0, height), 1.0);
    // One is seen from behind.
    let scene = mixed(&[near(2.0), near(-2.0), near(100.0)], 1.0, 0.25);
    let lights = scene.lights().seen_from(Vec3A::ZERO, Vec3A::Z);
    // The solid angle of a square of half side 1 over its middle.
    let omega = |height: f32| 4.0 * (1.0 / (1.0 + height * height)).asin();
    let by_square = |height: f32| omega(height) * (1.0 - omega(height) / (4.0 * PI));
    let by_ball = PI * 0.25 / 25.0;
    let expected = [by_square(2.0), 0.0, by_square(100.0), by_ball, 0.25, 0.25 * PI];
    let sum: f32 = expected.iter().sum();
    for (light, irradiance) in expected.into_iter().enumerate() {
        let (chance, expected) = (lights.probability(light), irradiance / sum);
        // Squares are about as bright as discs of their area.
        assert!((chance - expected).abs() <= 0.02 * expected, "light {light}: {chance} instead of {expected}");
    }
}

#[test]
fn nothing_that_a_wide_lamp_brings_is_taken_for_little() {
    let scene = mixed(&[(Vec3::ZERO, 1.0)], 0.0, 1.0);
    // The solid angle of the lamp from a place x, y of it and so far below: of the quarter to each corner.
    let omega = |x: f32, y: f32, depth: f32| -> f32 {
        let quarter = |x: f32, y: f32| (x * y).atan2(depth * (x * x + y * y + depth * depth).sqrt());
        [-x, x].map(|x| [-y, y].map(|y| quarter(1.0 + x, 1.0 + y))).as_flattened().iter().sum()
    };
    for (x, y) in [(0.0, 0.0), (0.5, 0.0), (0.3, 0.7), (0.9, 0.9)] {
        for depth in [1e-3, 0.03, 0.3, 1.0, 3.0] {
            let lights = scene.lights().seen_from(Vec3A::new(x, y, -depth), Vec3A::Z);
            // The second light is the ball, the third the sky.
            let brings = PI * lights.probability(0) / lights.probability(2);
            let omega = omega(x, y, depth);
            let share = brings / (omega * (1.0 - omega / (4.0 * PI)));
            assert!(0.12 < share && share < 1.1, "at {x}, {y}, {depth}: {share}");
        }
    }
}

/// Small lamps in a cube, and a large one.
fn many(count: usize) -> Vec<(Vec3, f32)> {
    let mut random = Random(2);
    let mut place = || Vec3::new(8.0 * random.next() - 4.0, 8.0 * random.next() - 4.0, 1.0 + 4.0 * random.next());
    (0..count).map(|i| (place(), if i == 2 { 20.0 } else { 0.1 })).collect()
}

/// Chooses by numbers all over the interval, and checks what is told of each light against how often it is found.
fn tells_what_it_chooses(lights: &SeenLights<'_>, count: usize, name: &str) {
    let mut found = vec![0.0f64; count];
    for i in 0u16..4096 {
        let Some((light, probability)) = lights.choose((f32::from(i) + 0.5) / 4096.0) else { continue };
        let told = lights.probability(light);
        assert!((probability - told).abs() <= 1e-5 * told, "{name}: {probability} is not {told}");
        found[light] += 1.0 / 4096.0;
    }
    let told = |light: usize| f64::from(lights.probability(light));
    for (light, &found) in found.iter().enumerate() {
        // A stretch of the numbers has two ends.
        assert!((found - told(light)).abs() < 2.0 / 4096.0, "{name}, {light}: {found}, {}", told(light));
    }
    // Of many each has less than that. What is told and not found would be lost.
    let (told, found) = ((0..count).map(told).sum::<f64>(), found.iter().sum::<f64>());
    assert!(told < 1.0 + 1e-5 && (told - found).abs() < 0.01, "{name}: {told} is told, {found} found");
}

#[test]
fn whatever_is_chosen_has_the_probability_that_is_told() {
    // Each by itself, up to 128 with the ball and the point; and in groups.
    for count in [5, 100, 126, 127, 200, 1000] {
        let scene = mixed(&many(count), 1.0, 0.1);
        let lights = scene.lights();
        let lessons: Vec<LightLesson> = (0..lights.count())
            .map(|light| LightLesson {
                light,
                samples: 10.0,
                count: 10.0,
                moment: if light % 3 == 0 { 10.0 } else { 0.0 },
            })
            .collect();
        let learnt = lights.learnt_choice(&lessons).expect("there is light");
        for p in [Vec3A::ZERO, Vec3A::new(3.0, 1.0, 2.0), Vec3A::new(-30.0, 5.0, 9.0)] {
            tells_what_it_chooses(&lights.seen_from(p, Vec3A::Z), lights.count(), &format!("{count} lamps at {p}"));
            let seen = lights.seen_by(p, Vec3A::Z, Some(&learnt));
            tells_what_it_chooses(&seen, lights.count(), &format!("{count} learnt at {p}"));
        }
    }
}

#[test]
fn what_was_seen_is_chosen_and_nothing_is_left_out() {
    // Few are weighed one by one; those of many that were seen are found in their groups.
    for count in [20, 3000] {
        let scene = mixed(&many(count), 1.0, 0.1);
        let (lights, p) = (scene.lights(), Vec3A::new(1.0, 1.0, -2.0));
        let blind = lights.seen_from(p, Vec3A::Z);
        let sky = lights.count() - 1;
        // Each lamp was asked for as often as it is chosen, and only these three were seen.
        let seen = [4, 9, 15];
        let lesson = |light: usize| {
            let times = 1e4 * blind.probability(light);
            LightLesson { light, samples: times, count: times, moment: if seen.contains(&light) { times } else { 0.0 } }
        };
        let lessons: Vec<LightLesson> = (0..=sky).map(lesson).collect();
        let choice = lights.learnt_choice(&lessons).expect("three lamps are seen");
        let learnt = lights.seen_by(p, Vec3A::Z, Some(&choice));
        let of = |lights: &SeenLights<'_>| seen.into_iter().map(|light| lights.probability(light)).sum::<f32>();
        let (before, after) = (of(&blind), of(&learnt));
        assert!(before < 0.3 && after > 0.6, "{count} lamps: {before}, then {after}");
        for light in 0..=sky {
            let (before, after) = (blind.probability(light), learnt.probability(light));
            // Where there are many the density within a group may have been another.
            assert!(before == 0.0 || after > 0.0, "{count} lamps: {light} is lost");
        }
        let (before, after) = (blind.probability(sky), learnt.probability(sky));
        assert!(after > 0.1 * before && after < before, "the sky, with {count} lamps: {before}, then {after}");
    }
}

#[test]
fn a_sun_that_is_hidden_is_seldom_chosen() {
    let sun = |x: f32| PunctualLight::Directional { direction: Vec3::new(x, 0.0, -1.0), irradiance: Vec3::ONE };
    let description = Description {
        meshes: vec![squares(&[(Vec3::Z, 0.5)])],
        materials: vec![emitter(1.0)],
        lights: vec![sun(0.0), sun(1.0)],
        environment: Some(Environment::constant(Vec3::splat(0.3))),
        ..Description::default()
    };
    let scene = Scene::new(description).expect("a right scene");
    let (lights, p) = (scene.lights(), Vec3A::ZERO);
    // The lamp, both suns, the sky: of the second sun nothing was seen.
    let lessons: Vec<LightLesson> = (0..4)
        .map(|light| LightLesson { light, samples: 100.0, count: 100.0, moment: if light == 2 { 0.0 } else { 100.0 } })
        .collect();
    let choice = lights.learnt_choice(&lessons).expect("there is light");
    let (blind, learnt) = (lights.seen_from(p, Vec3A::Z), lights.seen_by(p, Vec3A::Z, Some(&choice)));
    tells_what_it_chooses(&learnt, 4, "suns");
    assert!(learnt.probability(2) < 0.6 * blind.probability(2), "the hidden sun");
    for light in [0, 1, 3] {
        assert!(learnt.probability(light) > blind.probability(light), "{light} is seen");
    }
}

#[test]
#[should_panic(expected = "of other lights")]
fn a_choice_of_other_lights_is_refused() {
    let (few, more) = (mixed(&many(20), 1.0, 0.1), mixed(&many(30), 1.0, 0.1));
    let choice = few.lights().learnt_choice(&[LightLesson { light: 0, samples: 1.0, count: 1.0, moment: 1.0 }]);
    let _ = more.lights().seen_by(Vec3A::ZERO, Vec3A::Z, choice.as_ref());
}

#[test]
fn nothing_is_learnt_of_darkness() {
    let scene = mixed(&many(20), 1.0, 0.1);
    let lights = scene.lights();
    assert!(lights.learnt_choice(&[]).is_none(), "no lesson");
    let dark = LightLesson { light: 3, samples: 10.0, count: 10.0, moment: 0.0 };
    assert!(lights.learnt_choice(&[dark]).is_none(), "no light");
    assert!(lights.learnt_choice(&[LightLesson { moment: f32::INFINITY, ..dark }]).is_none(), "no number");
}

#[test]
fn equal_lessons_change_nothing() {
    let scene = mixed(&many(20), 1.0, 0.1);
    let lights = scene.lights();
    let all: Vec<LightLesson> =
        (0..lights.count()).map(|light| LightLesson { light, samples: 1.0, count: 1.0, moment: 2.0 }).collect();
    let choice = lights.learnt_choice(&all).expect("there is light");
    let (p, n) = (Vec3A::ZERO, Vec3A::Z);
    let (before, after) = (lights.seen_from(p, n), lights.seen_by(p, n, Some(&choice)));
    for light in 0..lights.count() {
        let (before, after) = (before.probability(light), after.probability(light));
        assert!((before - after).abs() <= 1e-5 * before, "light {light}: {before}, then {after}");
    }
}

#[test]
fn rays_that_meet_a_light_know_its_density() {
    let scene = mixed(&[(Vec3::new(0.5, 0.0, 1.0), 1.0), (Vec3::new(-2.0, 0.0, 3.0), 0.7)], 0.0, 0.25);
    let lights = scene.lights();
    let (p, mut random) = (Vec3A::new(-0.3, 0.2, 0.1), Random(4));
    let lesson = LightLesson { light: 1, samples: 10.0, count: 10.0, moment: 10.0 };
    let learnt = lights.learnt_choice(&[lesson]).expect("there is light");
    let (mut lamps, mut skies) = (0, 0);
    for number in 0..4000 {
        let choice = Some(&learnt).filter(|_| number % 2 == 0);
        let mut seen = lights.seen_by(p, Vec3A::Z, choice);
        let Some(s) = seen.sample(random.next(), random.pair()) else { continue };
        let ray = Ray::new(p, s.wi);
        let (pdf, distance) = match scene.intersect(&ray) {
            Some(hit) => (seen.pdf_surface(s.wi, &scene.surface(&ray, &hit)), hit.t),
            None => (seen.pdf_environment(s.wi), f32::INFINITY),
        };
        // Others may stand before the one that was chosen, and a ray to the very edge may miss.
        if distance == s.distance || (distance - s.distance).abs() < 1e-4 * distance {
            *if distance.is_finite() { &mut lamps } else { &mut skies } += 1;
            assert!((pdf - s.pdf).abs() < 1e-3 * s.pdf, "{pdf} is not {}", s.pdf);
        }
    }
    assert!(lamps > 500 && skies > 100, "{lamps} samples meet lamps, {skies} the sky");
}

#[test]
fn a_lamp_on_a_wide_ground_is_found_under_the_night_sky() {
    // The sky sends 10^4 times the flux of the lamp to the ground, and a twentieth of its light to the place beneath.
    let ground = (Vec3::new(0.0, 0.0, -10.0), 500.0);
    let lamp = (Vec3::new(0.0, 0.0, 1.0), 0.1);
    let dim = Environment::constant(Vec3::splat(6e-4));
    let description = Description {
        meshes: vec![squares(&[lamp]), Mesh { materials: vec![1; 2], ..squares(&[ground]) }],
        materials: vec![emitter(1.0), emitter(0.0)],
        environment: Some(dim),
        ..Description::default()
    };
    let scene = Scene::new(description).expect("a right scene");
    let (mean, deviation) = irradiance(scene.lights(), Vec3A::ZERO, Vec3A::Z, 10_000);
    // Cosines hardly vary: by the area, 0.04, and by half of the sky.
    let expected = 0.04 + 6e-4 * f64::from(PI);
    assert!((mean / expected - 1.0).abs() < 0.03, "{mean} instead of {expected}");
    assert!(deviation < 0.5, "by flux it would deviate 100 times as much as it brings: {deviation}");
}
