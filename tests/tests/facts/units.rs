//! Nothing depends on the units: what is bright, small or far is so beside the rest of the scene alone. Powers of two
//! change no digit of any number, so that pictures are the same to the bit.

use glam::{DAffine3, DVec3, UVec2, Vec3};
use integrator::{Film, Method, Settings, render};
use scene::{Description, Environment, PunctualLight, Scene};
use tests::{Builder, METHODS, cuboid, glass, gloss, lambert, lamp, mirror};

/// A room with a lamp, a shining ball, a point of light, gloss and a window to the sky.
fn room() -> Builder {
    let walls = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::Z, Vec3::NEG_Z];
    walls
        .into_iter()
        .fold(Builder::default(), |room, normal| room.square(-normal, normal, 1.0, lambert(0.6)))
        .square(Vec3::Z * 0.99, Vec3::NEG_Z, 0.3, lamp(8.0))
        .mesh(cuboid(Vec3::new(0.2, -0.1, -1.0), Vec3::new(0.7, 0.5, -0.2)), gloss(0.3, 0.8))
        .ball(Vec3::new(-0.3, 0.2, -0.6), 0.4, lambert(0.3))
        .ball(Vec3::new(-0.6, -0.4, 0.3), 0.1, lamp(3.0))
        .point_light(Vec3::new(0.1, -0.2, 0.6), 0.5)
        .sun(Vec3::new(0.1, 0.4, -0.9), 0.4)
        .sky(0.2)
        .view(Vec3::new(0.5, -0.9, 0.1), Vec3::new(0.0, 1.0, -0.3), 70.0)
}

fn film(description: Description, method: Method) -> Film {
    let settings = Settings { method, size: UVec2::new(24, 16), quality: 0.02, seed: 5, ..Settings::default() };
    let scene = Scene::new(description).expect("a valid scene");
    let film = render(&scene, &settings, &|_| ()).expect("valid settings").film;
    assert!(film.direct.iter().chain(&film.indirect).any(|&l| l != Vec3::ZERO), "a lit picture");
    film
}

#[test]
fn the_unit_of_light_does_not_matter() {
    let description = room()
        .square(Vec3::new(-0.9, 0.0, 0.0), Vec3::X, 0.4, mirror(0.9))
        .ball(Vec3::new(0.4, 0.2, 0.3), 0.2, glass(1.5, 0.3))
        .description;
    for method in METHODS {
        let usual = film(description.clone(), method).picture();
        for factor in [2.0_f32.powi(-30), 2.0_f32.powi(30)] {
            let mut other = description.clone();
            other.materials.iter_mut().for_each(|material| material.emission *= factor);
            other.environment = Some(Environment::constant(Vec3::splat(0.2 * factor)));
            for light in &mut other.lights {
                match light {
                    PunctualLight::Point { intensity, .. } => *intensity *= factor,
                    PunctualLight::Directional { irradiance, .. } => *irradiance *= factor,
                }
            }
            let picture: Vec<Vec3> = film(other, method).picture().iter().map(|&l| l / factor).collect();
            assert!(usual == picture, "{}, light times {factor}", method.name());
        }
    }
}

#[test]
fn the_unit_of_length_does_not_matter() {
    // Without mirrors and glass: what photons take for a random number are digits of their places.
    let description = room().description;
    for method in METHODS {
        let usual = film(description.clone(), method);
        for factor in [2.0_f32.powi(-12), 2.0_f32.powi(12)] {
            let mut other = description.clone();
            other.meshes.iter_mut().flat_map(|mesh| &mut mesh.positions).for_each(|p| *p *= factor);
            let place = DAffine3::from_scale(DVec3::splat(factor.into()));
            other.forms.iter_mut().for_each(|form| form.solid = form.solid.transformed(&place).expect("not singular"));
            for light in &mut other.lights {
                if let PunctualLight::Point { position, intensity } = light {
                    *position *= factor;
                    *intensity *= factor * factor;
                }
            }
            let camera = other.camera.as_mut().expect("a camera");
            camera.eye *= factor;
            camera.at *= factor;
            let mut film = film(other, method);
            film.depth.iter_mut().for_each(|depth| *depth /= factor);
            assert!(usual == film, "{}, lengths times {factor}", method.name());
        }
    }
}
