//! Photons that are sent to a part of the scene.

use std::f32::consts::PI;

use glam::{DVec3, Vec3, Vec3A};
use scene::freeform::{FreeForm, Quadric};
use scene::{Description, Environment, FormObject, Material, Mesh, PunctualLight, Ray, Scene, SpecularKind, Target};

use crate::measure::{Random, emitter};

fn silver() -> Material {
    Material { specular: SpecularKind::Mirror { reflectance: Vec3::ONE }, ..Material::default() }
}

/// A square that lies, its front above.
fn square(middle: Vec3, size: f32, material: u32) -> Mesh {
    Mesh {
        positions: [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
            .map(|(x, z)| middle + size * Vec3::new(z, 0.0, x))
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

#[test]
fn photons_of_lamps_for_mirrors_bring_what_all_would() {
    // Under a lamp at the origin: one mirror behind the other, one that is beside the lamp and above the horizon of most of it, one over it.
    let mirrors = [(0.3, -2.0, 0.0, 0.6), (0.5, -3.0, 0.0, 0.9), (-3.0, 0.05, 0.0, 0.8), (0.0, 3.0, 0.5, 0.7)];
    let mirrors = mirrors.map(|(x, y, z, size)| square(Vec3::new(x, y, z), size, 1));
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
    let rectangle = with_mesh(square(Vec3::ZERO, 0.5, 2));
    let half = square(Vec3::ZERO, 0.8, 2);
    let triangle = with_mesh(Mesh { triangles: vec![[0, 1, 2]], materials: vec![2], ..half });
    let point = PunctualLight::Point { position: Vec3::ZERO, intensity: Vec3::ONE };
    let ball = |radius| {
        let solid = FreeForm::new(Quadric::sphere(DVec3::ZERO, radius).unwrap(), vec![]).unwrap().into();
        let form = FormObject { name: String::new(), solid, material: 2, projection: None, copies: vec![] };
        Description { forms: vec![form], ..common.clone() }
    };
    let scenes = [
        ("a rectangle", rectangle),
        ("a triangle", triangle),
        ("a point", Description { lights: vec![point], ..common.clone() }),
        ("a small ball", ball(0.2)),
        ("a large ball", ball(0.7)),
    ];
    let n = 400_000;
    for (name, description) in scenes {
        let scene = Scene::new(description).unwrap();
        // The flux to each mirror, and the photons that met it.
        let to_mirrors = |target: &Target| {
            let (mut random, mut flux, mut hits) = (Random(7), [0.0; 4], [0u32; 4]);
            for _ in 0..n {
                let (u, position, direction) = (random.next(), random.pair(), random.pair());
                let Some(emission) = scene.lights().emit_to(target, u, position, direction) else { continue };
                if let Some(hit) = scene.intersect(&emission.ray).filter(|hit| (2..10).contains(&hit.primitive)) {
                    let mirror = hit.primitive as usize / 2 - 1;
                    flux[mirror] += f64::from(emission.flux.x) / f64::from(n);
                    hits[mirror] += 1;
                }
            }
            (flux, hits)
        };
        let (all, met) = to_mirrors(scene.lights().everything());
        let (sent, sent_met) = to_mirrors(&scene.target(Material::has_delta));
        for i in 0..4 {
            // Cosines and the numbers of spheres vary: twice the deviation of equal photons at most.
            let deviation = 2.0 * (1.0 / f64::from(met[i].max(1)) + 1.0 / f64::from(sent_met[i].max(1))).sqrt();
            let difference = (sent[i] - all[i]).abs();
            assert!(difference <= 3.0 * deviation * all[i], "{name}, mirror {i}: {} instead of {}", sent[i], all[i]);
        }
        let (met, sent_met): (u32, u32) = (met.iter().sum(), sent_met.iter().sum());
        assert!(
            sent_met > 4 * met && met > 4000,
            "{name}: {sent_met} of {n} meet a mirror, {met} of those sent anywhere"
        );
    }
}

#[test]
fn lamps_send_photons_everywhere_where_mirrors_are_all_around() {
    // A lamp in a glass ball.
    let solid = FreeForm::new(Quadric::sphere(DVec3::ZERO, 1.0).unwrap(), vec![]).unwrap().into();
    let scene = Scene::new(Description {
        meshes: vec![square(Vec3::ZERO, 0.5, 1)],
        forms: vec![FormObject { name: String::new(), solid, material: 0, projection: None, copies: vec![] }],
        materials: vec![silver(), emitter(1.0)],
        ..Description::default()
    })
    .unwrap();
    let target = scene.target(Material::has_delta);
    let mut random = Random(1);
    for _ in 0..1000 {
        let (u, position, direction) = (random.next(), random.pair(), random.pair());
        let sent = scene.lights().emit_to(&target, u, position, direction);
        assert!(sent.is_some() && sent == scene.lights().emit(u, position, direction));
    }
}
