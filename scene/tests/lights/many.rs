//! Many lights at once, and the photons that lights send out.

use std::f32::consts::PI;

use glam::{DVec3, Vec2, Vec3, Vec3A};
use scene::{Description, Environment, Material, Mesh, PunctualLight, Ray, Scene};

use crate::measure::{Random, assert_irradiance, emitter, irradiance, is_normal};

#[test]
fn lights_add_up_in_proportion_to_their_flux() {
    // Ten thousand point lights of I = i on a ring of radius 3 at height 4: E = N (N + 1) / 2 times 4 / 125, and hardly
    // a sample deviates.
    let n = 10_000;
    let light = |i: u32| {
        let (sin, cos) = (i as f32).sin_cos();
        PunctualLight::Point { position: Vec3::new(3.0 * cos, 3.0 * sin, 4.0), intensity: Vec3::splat(i as f32) }
    };
    let scene = Scene::new(Description { lights: (1..=n).map(light).collect(), ..Description::default() }).unwrap();
    let (mean, deviation) = irradiance(scene.lights(), Vec3A::ZERO, Vec3A::Z, 10_000);
    assert!((mean / 1_600_160.0 - 1.0).abs() < 0.05 * deviation + 1e-5 && deviation < 2e-2, "{mean}, {deviation}");
    let sun = PunctualLight::Directional { direction: Vec3::new(0.0, -3.0, -4.0), irradiance: Vec3::ONE };
    let scene = Scene::new(Description { lights: vec![sun], ..Description::default() }).unwrap();
    assert!(
        (irradiance(scene.lights(), Vec3A::ZERO, Vec3A::Z, 10).0 - 0.8).abs() < 1e-6,
        "cosine of a directional light"
    );
}

/// Irradiance at the origin, with normal z, of a triangle above it of radiance 1, by Lambert's formula.
fn lambert(corners: [DVec3; 3]) -> f64 {
    let [a, b, c] = corners;
    if (b - a).cross(c - a).dot(a) >= 0.0 {
        return 0.0;
    }
    let edge = |v: DVec3, w: DVec3| {
        let normal = v.cross(w);
        v.angle_between(w) * normal.z / normal.length()
    };
    0.5 * (edge(a, b) + edge(b, c) + edge(c, a)).abs()
}

#[test]
fn ten_thousand_lights_are_sampled_without_bias_and_with_little_deviation() {
    let mut random = Random(3);
    let mut corners = Vec::new();
    for _ in 0..10_000 {
        let place = Vec3::new(20.0 * random.next() - 10.0, 20.0 * random.next() - 10.0, 1.0 + 3.0 * random.next());
        let mut edge = || Vec3::new(random.next() - 0.5, random.next() - 0.5, random.next() - 0.5) * 0.1;
        corners.push([place, place + edge(), place + edge()]);
    }
    let expected: f64 = corners.iter().map(|lamp| lambert(lamp.map(|p| p.as_dvec3()))).sum();
    let mesh = Mesh {
        positions: corners.as_flattened().to_vec(),
        triangles: (0..10_000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        materials: vec![0; 10_000],
        ..Mesh::default()
    };
    let scene = Scene::new(Description { meshes: vec![mesh], materials: vec![emitter(1.0)], ..Description::default() })
        .expect("a right scene");
    let lights = scene.lights();
    assert_irradiance(lights, Vec3A::Z, expected, 1.3, "10,000 small triangles");
    let mut met = 0;
    for _ in 0..2000 {
        let Some(s) = lights.sample(Vec3A::ZERO, Vec3A::Z, random.next(), random.pair()) else { continue };
        let ray = Ray::new(Vec3A::ZERO, s.wi);
        let Some(hit) = scene.intersect(&ray) else { continue };
        // Others may stand before the one that was chosen.
        if (hit.t - s.distance).abs() < 1e-4 * s.distance {
            met += 1;
            let pdf = lights.pdf_surface(Vec3A::ZERO, s.wi, &scene.surface(&ray, &hit));
            assert!((pdf - s.pdf).abs() < 1e-3 * s.pdf, "{pdf} is not {}", s.pdf);
        }
    }
    assert!(met > 1000, "samples meet their light: {met}");
}

#[test]
fn photons_carry_the_flux_of_the_lights() {
    // A shell around everything counts what arrives, by the formula of each light: here a lamp and a point light in a
    // dark ball.
    let square =
        [Vec3::new(-1.0, -1.0, 1.0), Vec3::new(-1.0, 1.0, 1.0), Vec3::new(1.0, 1.0, 1.0), Vec3::new(1.0, -1.0, 1.0)];
    let mesh = Mesh {
        positions: square.to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        materials: vec![0; 2],
        ..Mesh::default()
    };
    let lights = vec![
        PunctualLight::Point { position: Vec3::ZERO, intensity: Vec3::new(1.0, 2.0, 0.0) },
        PunctualLight::Directional { direction: -Vec3::Z, irradiance: Vec3::splat(0.3) },
    ];
    let description = Description {
        meshes: vec![mesh],
        materials: vec![emitter(1.0)],
        lights,
        environment: Some(Environment::constant(Vec3::splat(0.1))),
        ..Description::default()
    };
    let scene = Scene::new(description).unwrap();
    // The sphere around the square has radius sqrt 2, the cross-section 2 pi.
    let cross_section = 2.0 * PI;
    let expected = Vec3::splat(4.0 * PI)
        + 4.0 * PI * Vec3::new(1.0, 2.0, 0.0)
        + 0.3 * cross_section
        + 0.1 * 4.0 * PI * cross_section;
    assert!(
        (scene.lights().total_flux() - expected).abs().max_element() < 1e-3,
        "{} is not {expected}",
        scene.lights().total_flux()
    );
    let mut random = Random(9);
    let (mut flux, mut down, n) = (DVec3::ZERO, 0.0, 100_000);
    for _ in 0..n {
        let emission = scene.lights().emit(random.next(), random.pair(), random.pair()).unwrap();
        flux += emission.flux.as_dvec3();
        assert!(is_normal(&emission.ray), "{:?}", emission.ray);
        // What leaves the lamp goes down, and never meets the lamp.
        if scene.intersect(&emission.ray).is_none() {
            down += f64::from(emission.flux.x);
        }
    }
    let mean = (flux / f64::from(n)).as_vec3();
    assert!(((mean - expected) / expected).abs().max_element() < 2e-2, "{mean} is not {expected}");
    assert!(down > 0.0, "photons leave");
}

#[test]
fn photons_of_a_lamp_and_of_the_sky_light_a_square_as_they_should() {
    // Density of photons on a unit square under each light: E A.
    let floor = |material| Mesh {
        positions: [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| Vec3::new(x, y, 0.0)).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        materials: vec![material; 2],
        ..Mesh::default()
    };
    let sky = Environment::constant(Vec3::splat(0.5));
    let sun = PunctualLight::Directional { direction: Vec3::new(0.0, -3.0, -4.0), irradiance: Vec3::ONE };
    for (name, lights, environment, expected) in [("sky", vec![], Some(sky), 0.5 * PI), ("sun", vec![sun], None, 0.8)] {
        let description = Description {
            meshes: vec![floor(0)],
            materials: vec![Material::default()],
            lights,
            environment,
            ..Description::default()
        };
        let scene = Scene::new(description).unwrap();
        let mut random = Random(4);
        let (mut front, n) = (0.0, 100_000);
        for _ in 0..n {
            let Some(emission) = scene.lights().emit(random.next(), random.pair(), random.pair()) else { continue };
            if let Some(hit) = scene.intersect(&emission.ray)
                && scene.surface(&emission.ray, &hit).front
            {
                front += f64::from(emission.flux.x);
            }
        }
        let found = front / f64::from(n);
        assert!((found / f64::from(expected) - 1.0).abs() < 2e-2, "{name}: {found} is not {expected}");
    }
}

#[test]
fn what_does_not_shine_is_not_a_light() {
    let dark = Scene::new(Description::default()).unwrap();
    assert!(
        dark.lights().is_empty() && dark.lights().sample(Vec3A::ZERO, Vec3A::Z, 0.5, Vec2::splat(0.5)).is_none(),
        "no lights"
    );
    assert!(dark.lights().emit(0.5, Vec2::ZERO, Vec2::ZERO).is_none(), "no photons");
    // A lamp of no area, and black surroundings.
    let mesh = Mesh {
        positions: vec![Vec3::ZERO, Vec3::X, 2.0 * Vec3::X],
        triangles: vec![[0, 1, 2]],
        materials: vec![0],
        ..Mesh::default()
    };
    let environment = Some(Environment::constant(Vec3::ZERO));
    let scene = Scene::new(Description {
        meshes: vec![mesh],
        materials: vec![emitter(1.0)],
        environment,
        ..Description::default()
    })
    .unwrap();
    assert!(
        scene.lights().is_empty() && scene.lights().pdf_environment(Vec3A::ZERO, Vec3A::X) == 0.0,
        "nothing to choose"
    );
    // A light of which p is the very place gives no irradiance without bound.
    let point = PunctualLight::Point { position: Vec3::ONE, intensity: Vec3::ONE };
    let scene = Scene::new(Description { lights: vec![point], ..Description::default() }).unwrap();
    assert!(scene.lights().sample(Vec3A::ONE, Vec3A::Z, 0.5, Vec2::ZERO).is_none(), "at the light itself");
}
