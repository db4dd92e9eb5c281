//! Photons that are sent to a part of the scene.

use std::f32::consts::PI;

use glam::{DVec3, Vec3, Vec3A};
use scene::freeform::{FreeForm, Psi, Quadric, Solid};
use scene::{Description, Environment, Material, Mesh, PunctualLight, Ray, Scene, SpecularKind, Target};

use crate::measure::{Random, ball, emitter, form};

fn silver() -> Material {
    Material { specular: SpecularKind::Mirror { reflectance: Vec3::ONE }, ..Material::default() }
}

/// A square that lies, its front above.
fn square(middle: Vec3, size: f32, material: u32) -> Mesh {
    across(middle, [Vec3::Z * size, Vec3::X * size], material)
}

/// A parallelogram about its middle.
fn across(middle: Vec3, edges: [Vec3; 2], material: u32) -> Mesh {
    Mesh {
        positions: [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
            .map(|(x, y)| middle + edges[0] * x + edges[1] * y)
            .to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        materials: vec![material; 2],
        ..Mesh::default()
    }
}

#[test]
fn photons_of_the_sky_for_mirrors_bring_what_all_would() {
    // A wide floor, a row of mirrors in which the sky sees one behind the other, and a small one elsewhere.
    let mirrors: [(Vec3, f32); 6] = std::array::from_fn(|i| match i {
        0 => (Vec3::new(-100.0, 50.0, 80.0), 0.5),
        i => (Vec3::new(3.0 * i as f32, 2.0 + i as f32, 0.0), 1.0),
    });
    let squares = mirrors.iter().map(|&(middle, size)| square(middle, size, 1));
    let description = Description {
        meshes: std::iter::once(square(Vec3::ZERO, 1000.0, 0)).chain(squares).collect(),
        materials: vec![Material::default(), silver()],
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
    // A sixth of the spheres' cross-section is that of the squares, seen at a mean cosine of a half; 4 km^2 of floor
    // would have nearly all.
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

#[test]
fn photons_of_lamps_for_mirrors_bring_what_all_would() {
    // Under a lamp at the origin one mirror behind the other; beside it one across its plane, and a small one so near
    // that the spheres around it and around the largest lamp meet.
    let mirrors = [
        square(Vec3::new(0.3, -2.0, 0.0), 0.6, 1),
        square(Vec3::new(0.5, -3.0, 0.0), 0.9, 1),
        across(Vec3::new(-2.0, 0.0, 0.0), [Vec3::Y * 0.8, Vec3::Z * 0.8], 1),
        across(Vec3::new(0.75, -0.1, 0.0), [Vec3::Y * 0.1, Vec3::Z * 0.1], 1),
    ];
    let floor = square(Vec3::new(0.0, -4.0, 0.0), 20.0, 0);
    let common = Description {
        meshes: std::iter::once(floor).chain(mirrors).collect(),
        materials: vec![Material::default(), silver(), emitter(2.0)],
        ..Description::default()
    };
    let with_mesh = |lamp: Mesh| {
        // Its front below.
        let triangles = lamp.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
        let meshes = common.meshes.iter().cloned().chain([Mesh { triangles, ..lamp }]).collect();
        Description { meshes, ..common.clone() }
    };
    let triangle = Mesh { triangles: vec![[0, 1, 2]], materials: vec![2], ..square(Vec3::ZERO, 0.8, 2) };
    // Lines may leave it twice.
    let pair = Solid::union(Psi::Maximum, vec![ball(DVec3::X * -0.25, 0.2), ball(DVec3::X * 0.25, 0.2)]).unwrap();
    let point = PunctualLight::Point { position: Vec3::ZERO, intensity: Vec3::ONE };
    let scenes = [
        ("a rectangle", with_mesh(square(Vec3::ZERO, 0.5, 2))),
        ("a triangle", with_mesh(triangle)),
        ("a point", Description { lights: vec![point], ..common.clone() }),
        ("a small ball", Description { forms: vec![form(ball(DVec3::ZERO, 0.2), 2)], ..common.clone() }),
        ("a large ball", Description { forms: vec![form(ball(DVec3::ZERO, 0.7), 2)], ..common.clone() }),
        ("two balls", Description { forms: vec![form(pair, 2)], ..common.clone() }),
    ];
    let n = 800_000;
    for (name, description) in scenes {
        let scene = Scene::new(description).unwrap();
        // The flux to each mirror, its variance, and the photons that met one.
        let to_mirrors = |target: &Target| {
            let (mut random, mut flux, mut squares, mut met) = (Random(7), [0.0; 4], [0.0; 4], 0);
            for _ in 0..n {
                let (u, position, direction) = (random.next(), random.pair(), random.pair());
                let Some(emission) = scene.lights().emit_to(target, u, position, direction) else { continue };
                if let Some(hit) = scene.intersect(&emission.ray).filter(|hit| (2..10).contains(&hit.primitive)) {
                    let (mirror, value) = (hit.primitive as usize / 2 - 1, f64::from(emission.flux.x) / f64::from(n));
                    flux[mirror] += value;
                    squares[mirror] += value * value;
                    met += 1;
                }
            }
            (flux, squares, met)
        };
        let (all, all_variance, met) = to_mirrors(scene.lights().everything());
        let (sent, sent_variance, sent_met) = to_mirrors(&scene.target(Material::has_delta));
        for i in 0..4 {
            let deviation = (all_variance[i] + sent_variance[i]).sqrt();
            let (found, expected) = (sent[i], all[i]);
            assert!((found - expected).abs() < 4.5 * deviation, "{name}, mirror {i}: {found} instead of {expected}");
            assert!(deviation < 0.065 * expected, "{name}, mirror {i}: {expected} +- {deviation}");
        }
        assert!(sent_met > 4 * met, "{name}: {sent_met} of {n} meet a mirror, {met} of those sent anywhere");
    }
}

#[test]
fn lamps_send_photons_everywhere_where_mirrors_are_all_around_or_endless() {
    // A lamp in a silver ball; over an endless mirror, and a lamp of that above a small thing.
    let inside = Description {
        forms: vec![form(ball(DVec3::ZERO, 1.0), 0), form(ball(DVec3::ZERO, 0.2), 1)],
        materials: vec![silver(), emitter(1.0)],
        ..Description::default()
    };
    let half_space = FreeForm::new(Quadric::half_space(DVec3::NEG_Y, DVec3::Y).unwrap(), vec![]).unwrap();
    let over = Description {
        forms: vec![form(ball(DVec3::ZERO, 0.5), 1), form(half_space.into(), 0)],
        lights: vec![PunctualLight::Point { position: Vec3::Y * 9.0, intensity: Vec3::ONE }],
        materials: vec![silver(), Material::default()],
        ..Description::default()
    };
    for (name, description) in [("inside", inside), ("over an endless mirror", over)] {
        let scene = Scene::new(description).unwrap();
        let target = scene.target(Material::has_delta);
        let (mut random, mut downwards) = (Random(1), 0);
        for _ in 0..1000 {
            let (u, position, direction) = (random.next(), random.pair(), random.pair());
            let sent = scene.lights().emit_to(&target, u, position, direction);
            assert!(sent.is_some() && sent == scene.lights().emit(u, position, direction), "{name}");
            downwards += u32::from(sent.is_some_and(|sent| sent.ray.direction.y < 0.0));
        }
        assert!((400..600).contains(&downwards), "{name}: {downwards} of 1000 go down");
    }
}

#[test]
fn flat_lamps_send_no_photon_to_what_is_behind_them() {
    let scene = Scene::new(Description {
        meshes: vec![square(Vec3::ZERO, 1.0, 1), square(Vec3::NEG_Y * 2.0, 0.5, 0)],
        materials: vec![silver(), emitter(1.0)],
        ..Description::default()
    })
    .unwrap();
    let target = scene.target(Material::has_delta);
    let mut random = Random(3);
    let mut sent = || scene.lights().emit_to(&target, random.next(), random.pair(), random.pair());
    assert!((0..1000).all(|_| sent().is_none()));
}
