//! Odd meshes and far places change nothing.

use glam::{UVec2, Vec3};
use integrator::{Method, Settings, render};
use scene::{Description, LoadOptions, Mesh, Scene, load};
use tests::{METHODS, data_folder};

/// The Cornell box of the study, 555 units wide, seen from its front.
fn cornell() -> Description {
    let path = data_folder().join("study/cornell/scene.obj");
    let mut description = load(&path, &LoadOptions::default()).expect("a sound scene").description;
    let eye = Vec3::new(278.0, 273.0, -800.0);
    description.camera = Some(scene::Camera { eye, at: eye + Vec3::Z, up: Vec3::Y, fov_y_degrees: 39.3 });
    description
}

fn picture(description: Description, method: Method) -> Vec<Vec3> {
    let spp = if method == Method::Path { 64 } else { 4 };
    let settings =
        Settings { method, size: UVec2::splat(32), quality: 0.1, spp: Some(spp), seed: 2, ..Settings::default() };
    let scene = Scene::new(description).expect("a valid scene");
    render(&scene, &settings, &|_| ()).expect("valid settings").film.picture()
}

#[test]
fn zero_area_triangles_change_nothing() {
    // Points, repeated corners and collinear ones, with the lamp's material among them.
    let mut odd = cornell();
    let materials = u32::try_from(odd.materials.len()).unwrap();
    let positions = vec![Vec3::splat(200.0), Vec3::new(300.0, 200.0, 200.0), Vec3::new(400.0, 200.0, 200.0)];
    let triangles: Vec<[u32; 3]> = (0..100).map(|i| [[0, 0, 0], [0, 1, 1], [0, 1, 2], [2, 0, 1]][i % 4]).collect();
    let materials = (0..100).map(|i| i % materials).collect();
    odd.meshes.push(Mesh { positions, triangles, materials, ..Mesh::default() });
    for method in METHODS {
        let (with, without) = (picture(odd.clone(), method), picture(cornell(), method));
        assert!(without.iter().any(|l| l.x > 0.1), "a lit picture");
        assert_eq!(with, without, "{}", method.name());
    }
}

#[test]
fn offset_does_not_change_the_picture() {
    // The same box far from the origin: at 1e4 of its units, f32 has steps of 1e-3, which acne would show. With the
    // same random numbers the path tracer changes by less than 0.1 %; the grid of the cells lies elsewhere, so that the
    // others have new noise, 0.2 %.
    let mean = |description, method| {
        let picture = picture(description, method);
        picture.iter().map(|l| l.as_dvec3()).sum::<glam::DVec3>() / picture.len() as f64
    };
    for method in METHODS {
        let here = mean(cornell(), method);
        for offset in [100.0, 1e4] {
            let mut moved = cornell();
            let offset = Vec3::splat(offset);
            moved.meshes.iter_mut().flat_map(|mesh| &mut mesh.positions).for_each(|p| *p += offset);
            let camera = moved.camera.as_mut().unwrap();
            camera.eye += offset;
            camera.at += offset;
            let ratio = mean(moved, method) / here;
            tests::print(&format!("moved by {offset}, {}: {ratio}", method.name()));
            let limit = if method == Method::Path { 1e-3 } else { 5e-3 };
            assert!((ratio - 1.0).abs().max_element() < limit, "moved by {offset}, {}: {ratio}", method.name());
        }
    }
}
