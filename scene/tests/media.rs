//! Transparent bodies: slabs one behind the other, and slabs that overlap, against the series of their internal
//! reflections.

use glam::{UVec2, Vec2, Vec3, Vec3A};
use scene::{BuildError, Camera, Description, Hit, Material, Media, Mesh, Ray, Scene, SpecularKind};

fn glass(ior: f32, absorption: f32, priority: i32) -> Material {
    let specular = SpecularKind::Dielectric { ior, tint: Vec3::ONE, absorption: Vec3::splat(absorption), priority };
    Material { specular, ..Material::default() }
}

/// The faces of a wide slab, of the material with this number.
fn slab(bottom: f32, top: f32, material: u32) -> Mesh {
    const HALF: f32 = 1e3;
    let corner = |x: f32, y: f32, z: f32| Vec3::new(x * HALF, y * HALF, z);
    let square = |z| [corner(-1.0, -1.0, z), corner(1.0, -1.0, z), corner(1.0, 1.0, z), corner(-1.0, 1.0, z)];
    Mesh {
        positions: [square(top), square(bottom)].concat(),
        triangles: vec![[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]],
        materials: vec![material; 4],
        ..Mesh::default()
    }
}

fn built(slabs: &[(f32, f32)], materials: Vec<Material>) -> Scene {
    let meshes = (0..).zip(slabs).map(|(material, &(bottom, top))| slab(bottom, top, material)).collect();
    let camera = Camera { eye: Vec3::new(0.0, 0.0, -0.5), at: Vec3::Z, up: Vec3::Y, fov_y_degrees: 40.0 };
    Scene::new(Description { meshes, materials, camera: Some(camera), ..Description::default() })
        .expect("a right scene")
}

/// Follows all branches of the tree of reflections until they carry nothing; returns the shares of the flux that leave
/// downwards and upwards.
fn shares(scene: &Scene, ray: Ray) -> [f64; 2] {
    let mut found = [0.0f64; 2];
    let mut todo = vec![(ray, 1.0)];
    while let Some((ray, flux)) = todo.pop() {
        let Some(hit) = scene.intersect(&ray) else {
            found[usize::from(ray.direction.z > 0.0)] += flux;
            continue;
        };
        let surface = scene.surface(&ray, &hit);
        let flux = flux * f64::from(scene.transmittance(&surface).x);
        if flux < 1e-9 {
            continue;
        }
        let frame = hemimap::Frame::from_normal(surface.n);
        for branch in scene.bsdf(&surface).delta_branches(frame.to_local(-ray.direction)).into_iter().flatten() {
            let flux = flux * f64::from(branch.weight.x / branch.radiance_scale);
            todo.push((surface.spawn(frame.to_world(branch.wi)), flux));
        }
    }
    found
}

/// Returns the ray from above that meets the plane z = 0 in the origin.
fn from_above(degrees: f32) -> Ray {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let direction = Vec3A::new(sin, 0.0, -cos);
    Ray::new(-4.0 * direction / cos, direction)
}

/// Returns the shares that pass through layers and that they send back. A layer is its index and its absorption times
/// thickness; light comes from `index` at the sine `sin` times 1, and leaves into air.
fn through_layers(index: f64, sin: f64, layers: &[(f64, f64)]) -> [f64; 2] {
    let cos = |n: f64| (1.0 - (sin / n).powi(2)).sqrt();
    let reflectance = |a: f64, b: f64| {
        let (ca, cb) = (cos(a), cos(b));
        let (across, along) = ((a * ca - b * cb) / (a * ca + b * cb), (b * ca - a * cb) / (b * ca + a * cb));
        0.5 * (across * across + along * along)
    };
    // From the last face upwards: what is below a layer is one face with these shares.
    let before_last = layers.last().map_or(index, |&(n, _)| n);
    let mut back = reflectance(before_last, 1.0);
    let mut through = 1.0 - back;
    for (number, &(n, depth)) in layers.iter().enumerate().rev() {
        let above = if number == 0 { index } else { layers[number - 1].0 };
        let (r, e) = (reflectance(above, n), (-depth / cos(n)).exp());
        let series = 1.0 / (1.0 - r * back * e * e);
        through *= (1.0 - r) * e * series;
        back = r + (1.0 - r) * (1.0 - r) * back * e * e * series;
    }
    [through, back]
}

fn assert_near(found: [f64; 2], expected: [f64; 2], what: &str) {
    let near = (0..2).all(|way| (found[way] - expected[way]).abs() < 2e-5);
    assert!(near, "{what}: {found:?} through and back, not {expected:?}");
}

#[test]
fn slab_with_absorption_sums_its_internal_reflections() {
    // Index, angle, absorption times thickness; transmitted and reflected share by the geometric series.
    for (n, degrees, sd, through, back) in [
        (1.5, 0.0f32, 0.0, 0.923_077, 0.076_923),
        (1.5, 0.0, 1.0, 0.339_111, 0.044_990),
        (1.5, 60.0, 0.5, 0.450_739, 0.110_978),
        (1.8, 45.0, 0.2, 0.664_855, 0.143_549),
    ] {
        let sin = f64::from(degrees).to_radians().sin();
        assert_near(through_layers(1.0, sin, &[(f64::from(n), f64::from(sd))]), [through, back], "the formula");
        for priority in [0, 1] {
            let scene = built(&[(-1.0, 0.0)], vec![glass(n, sd, priority)]);
            let what = format!("n {n}, {degrees} degrees, priority {priority}");
            assert_near(shares(&scene, from_above(degrees)), [through, back], &what);
        }
    }
}

#[test]
fn overlapping_slabs_are_layers_by_priority() {
    // Glass from 0 to 1 and water from -1 to 0.3.
    let scene = |glass_priority, water_priority| {
        built(&[(0.0, 1.0), (-1.0, 0.3)], vec![glass(1.5, 0.4, glass_priority), glass(1.33, 0.9, water_priority)])
    };
    for degrees in [0.0f32, 40.0, 75.0] {
        let ray = from_above(degrees);
        let sin = f64::from(degrees).to_radians().sin();
        let glass_wins = through_layers(1.0, sin, &[(1.5, 0.4), (1.33, 0.9)]);
        let water_wins = through_layers(1.0, sin, &[(1.5, 0.7 * 0.4), (1.33, 1.3 * 0.9)]);
        assert_near(shares(&scene(1, 0), ray), glass_wins, "glass over water");
        assert_near(shares(&scene(0, -7), ray), glass_wins, "glass over what is below the default");
        assert_near(shares(&scene(2, 3), ray), water_wins, "water over glass");
        // Without priorities each face is one to air, and the overlap absorbs as what was entered last.
        let off = |priority| (shares(&scene(priority, priority), ray)[0] - glass_wins[0]).abs();
        assert!(off(0) > 0.015, "without priorities: {}", off(0));
    }
}

#[test]
fn rays_that_start_within_bodies_know_them() {
    // The eye is in the water, and so is half of a plate of glass above it; below is a basin of glass into which the
    // water reaches.
    let scene = built(
        &[(-2.0, 0.0), (-0.2, 0.3), (-9.0, -1.0)],
        vec![glass(1.33, 0.5, 0), glass(1.5, 0.8, 1), glass(1.5, 0.8, 1)],
    );
    let ray = scene.camera_ray(Vec2::new(70.0, 50.0), UVec2::splat(100));
    let sin = 1.33 * f64::from(ray.direction.x.hypot(ray.direction.y));
    assert!(sin > 0.1, "askew: {sin}");
    let cos = (1.0 - (sin / 1.33).powi(2)).sqrt();
    let surface = scene.surface(&ray, &scene.intersect(&ray).expect("the plate"));
    let expected = (-0.5 * 0.3 / cos).exp();
    let found = f64::from(scene.transmittance(&surface).x);
    assert!((found - expected).abs() < 1e-5, "0.3 m of water to the plate: {found}, not {expected}");
    let wo = hemimap::Frame::from_normal(surface.n).to_local(-ray.direction);
    let branches = scene.bsdf(&surface).delta_branches(wo);
    let refracted = branches[1].expect("it passes").wi;
    assert!((f64::from(refracted.x.hypot(refracted.y)) - sin / 1.5).abs() < 1e-6, "water to glass");

    let media = |z: f32| scene.media_at(Vec3A::new(0.1, 0.2, z));
    assert!(media(1.0).is_empty() && media(-10.0).is_empty(), "air");
    let within = |z| scene.transmittance_within(media(z), 1.0).x;
    assert_eq!(within(-0.5), (-0.5f32).exp(), "water");
    assert_eq!(within(-0.1), (-0.8f32).exp(), "glass in water");
    assert_eq!(within(0.2), (-0.8f32).exp(), "glass");
    assert_eq!(within(-1.5), (-0.8f32).exp(), "the basin");
}

#[test]
fn hidden_faces_neither_stop_rays_nor_shadows() {
    let scene = built(&[(0.0, 1.0), (-1.0, 0.3)], vec![glass(1.5, 0.0, 1), glass(1.33, 0.0, 0)]);
    let start = Vec3A::new(0.0, 0.0, 0.9);
    let ray = Ray { media: scene.media_at(start), t_max: 0.85, ..Ray::new(start, -Vec3A::Z) };
    assert!(!scene.occluded(&ray), "the face of the water at 0.3 is none");
    assert!(scene.occluded(&Ray { media: Media::NONE, ..ray }), "but to one who does not know the glass");
    let Hit { t, .. } = scene.intersect(&Ray { t_max: 2.0, ..ray }).expect("the face of the glass");
    assert!((t - 0.9).abs() < 1e-6, "at {t}, counted from the start");
}

#[test]
fn more_glasses_than_can_be_numbered_are_refused() {
    let materials = |count, priority| (0..count).map(|_| glass(1.5, 0.0, priority)).collect::<Vec<_>>();
    let made = |materials| Scene::new(Description { materials, ..Description::default() }).map(|_| ());
    assert_eq!(made(materials(300, 0)), Ok(()), "without priorities none is numbered");
    assert_eq!(made(materials(255, 1)), Ok(()), "255 can be");
    let problem = made(materials(256, 1));
    assert!(matches!(problem, Err(BuildError::TooMany { count: 256, limit: 255, .. })), "{problem:?}");
}
