//! Cameras, and what they frame where a scene has none.

use glam::{DAffine3, DVec3, UVec2, Vec2, Vec3, Vec3A};
use scene::freeform::{FreeForm, Quadric, Solid};
use scene::{Camera, Description, FormObject, Material, Mesh, Scene};

/// A parallelogram.
fn quad(corner: Vec3, u: Vec3, v: Vec3) -> Mesh {
    Mesh {
        positions: vec![corner, corner + u, corner + u + v, corner + v],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        materials: vec![0; 2],
        ..Mesh::default()
    }
}

fn of_mesh(mesh: Mesh) -> Description {
    Description { meshes: vec![mesh], materials: vec![Material::default()], ..Description::default() }
}

#[test]
fn camera_sees_right_and_up() {
    let camera = Camera { eye: Vec3::ZERO, at: -Vec3::Z, up: Vec3::new(0.0, 2.0, 0.5), fov_y_degrees: 90.0 };
    let size = UVec2::new(200, 100);
    let close = |a: Vec3A, b: Vec3| (a - Vec3A::from(b.normalize())).length() < 1e-6;
    assert!(close(camera.ray(Vec2::new(100.0, 50.0), size).direction, -Vec3::Z), "the middle");
    assert!(
        close(camera.ray(Vec2::new(100.0, 0.0), size).direction, Vec3::new(0.0, 1.0, -1.0)),
        "the upper edge, half of 90 degrees"
    );
    assert!(
        close(camera.ray(Vec2::new(200.0, 50.0), size).direction, Vec3::new(2.0, 0.0, -1.0)),
        "the right edge: forward x up"
    );
    assert!((camera.pixel_angle(size) - 0.02).abs() < 1e-6, "a hundredth of the height at distance 1");
    // A framed scene is in the picture as a whole.
    let scene = Scene::new(of_mesh(quad(Vec3::splat(3.0), Vec3::X * 8.0, Vec3::Y))).unwrap();
    let camera = *scene.camera();
    let forward = (camera.at - camera.eye).normalize();
    for corner in [Vec3::splat(3.0), Vec3::new(11.0, 4.0, 3.0)] {
        let cosine = (corner - camera.eye).normalize().dot(forward);
        assert!(cosine >= (0.5 * camera.fov_y_degrees).to_radians().cos() - 1e-5, "{corner} is in the picture");
    }
}

#[test]
fn whatever_is_framed_has_rays() {
    let ground = Solid::from(FreeForm::new(Quadric::half_space(DVec3::ZERO, DVec3::Y).unwrap(), vec![]).unwrap());
    let form = FormObject { name: String::new(), solid: ground, material: 0, projection: None, copies: vec![] };
    let endless = Description { forms: vec![form], materials: vec![Material::default()], ..Description::default() };
    let point = |p: Vec3, size: f32| of_mesh(quad(p, Vec3::X * size, Vec3::Y * size));
    let all = [endless, point(Vec3::ONE, 0.0), point(Vec3::ZERO, 1e-22), point(Vec3::splat(1e6), 0.01)];
    for (i, description) in all.into_iter().enumerate() {
        let scene = Scene::new(description).unwrap();
        let ray = scene.camera_ray(Vec2::splat(5.0), UVec2::splat(10));
        assert!((ray.direction.length() - 1.0).abs() < 1e-3, "scene {i}: {ray:?}");
        let of_camera = scene.camera().ray(Vec2::splat(5.0), UVec2::splat(10));
        assert_eq!((ray.origin, ray.direction), (of_camera.origin, of_camera.direction), "scene {i}");
    }
}

#[test]
fn bounds_of_a_description_are_those_of_its_scene() {
    let ball = Solid::from(FreeForm::new(Quadric::sphere(DVec3::ZERO, 0.5).unwrap(), vec![]).unwrap());
    let copies = (0..4).map(|i| DAffine3::from_translation(DVec3::X * f64::from(i * i))).collect();
    let form = FormObject { name: String::new(), solid: ball, material: 0, projection: None, copies };
    // What has no area does not count.
    let mut mesh = quad(Vec3::Y * 3.0, Vec3::X, Vec3::Y);
    mesh.positions.push(Vec3::splat(100.0));
    mesh.triangles.push([0, 4, 4]);
    mesh.materials.push(0);
    let description = Description {
        meshes: vec![mesh],
        forms: vec![form],
        materials: vec![Material::default()],
        ..Description::default()
    };
    let bounds = description.bounds();
    assert!((bounds.max.x - 9.5).abs() < 1e-5 && bounds.max.y == 4.0, "{bounds:?}");
    assert_eq!(bounds, Scene::new(description).unwrap().bounds());
}
