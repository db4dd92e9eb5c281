//! Free forms as lights.

use std::f32::consts::PI;

use glam::{DAffine3, DQuat, DVec3, Vec2, Vec3, Vec3A};
use scene::freeform::{FreeForm, Psi, Quadric, Solid};
use scene::{Description, FormObject, Material, Mesh, Projection, Ray, Scene, Texture};

use crate::measure::{Random, assert_irradiance, ball, emitter, form, irradiance, is_normal};

/// A scene of free forms that shine with radiance 1.
fn form_lights(solids: Vec<Solid>) -> Scene {
    let forms = solids.into_iter().map(|solid| form(solid, 0)).collect();
    Scene::new(Description { forms, materials: vec![emitter(1.0)], ..Description::default() }).expect("a right scene")
}

/// A ball of radius 2 with a hollow of radius 1.
fn shell(centre: DVec3) -> Solid {
    Solid::difference(Psi::Maximum, vec![ball(centre, 2.0), ball(centre, 1.0)]).expect("two parts")
}

#[test]
fn irradiance_of_free_forms_is_known() {
    let scene = form_lights(vec![ball(DVec3::Z * 2.0, 1.0)]);
    assert!(scene.features().area_lights && !scene.features().emissive_unsampled, "it is sampled");
    let pi = f64::from(PI);
    // All of the cone of a ball is the ball: only the cosine varies, from 1 to cos 30 degrees.
    assert_irradiance(scene.lights(), Vec3A::Z, pi / 4.0, 0.05, "a ball overhead");
    // Half of it is below the horizon (the formula of irradiance from a sphere, h = 2, 90 degrees).
    assert_irradiance(scene.lights(), Vec3A::X, 0.028_834_442_8 * pi, 1.5, "a ball at the horizon");
    // Seen from below it is the square of Lambert's formula, and its box is itself.
    let cuboid = Solid::cuboid(DVec3::new(-1.0, -1.0, 1.0), DVec3::new(1.0, 1.0, 1.5)).expect("a box");
    let (sin, cos) = 60f32.to_radians().sin_cos();
    let scene = form_lights(vec![cuboid]);
    assert_irradiance(scene.lights(), Vec3A::Z, 1.740_839_502_734, 1.0, "a box overhead");
    assert_irradiance(scene.lights(), Vec3A::new(sin, 0.0, cos), 0.909_067_569_058, 1.5, "a box aslant");
    // Within a hollow of constant radiance everything receives pi, in the middle and on the shining wall itself, which
    // must not find itself at once.
    for (centre, n) in
        [(DVec3::ZERO, Vec3A::Z), (DVec3::Z, Vec3A::Z), (DVec3::new(0.48, -0.6, -0.64), Vec3A::new(0.48, -0.6, -0.64))]
    {
        let scene = form_lights(vec![shell(centre)]);
        assert_irradiance(scene.lights(), n, pi, 1.5, &format!("a hollow about {centre}"));
    }
    assert_eq!(
        irradiance(form_lights(vec![ball(DVec3::ZERO, 1.0)]).lights(), Vec3A::ZERO, Vec3A::Z, 1000).0,
        0.0,
        "its inside is dark"
    );
    // A copy is the same light elsewhere: an ellipsoid that a copy makes a ball, and the box, moved in from afar.
    let forms = |solid: &Solid, copy: DAffine3| FormObject {
        name: String::new(),
        solid: solid.clone(),
        material: 0,
        projection: None,
        copies: vec![copy],
    };
    let flat = FreeForm::new(Quadric::ellipsoid(DVec3::X, DVec3::new(1.0, 0.25, 1.0)).expect("sound"), vec![])
        .expect("sound")
        .into();
    let to_ball =
        DAffine3::from_translation(DVec3::new(-1.0, 0.0, 2.0)) * DAffine3::from_scale(DVec3::new(1.0, 4.0, 1.0));
    let turned = DAffine3::from_rotation_y(std::f64::consts::FRAC_PI_2);
    for (form, expected, what) in [
        (forms(&flat, to_ball), pi / 4.0, "ball"),
        (forms(scene.form(0).expect("the box"), turned.inverse() * turned), 1.740_839_502_734, "box"),
    ] {
        let scene =
            Scene::new(Description { forms: vec![form], materials: vec![emitter(1.0)], ..Description::default() })
                .unwrap();
        assert_irradiance(scene.lights(), Vec3A::Z, expected, 1.0, &format!("the copy of a {what}"));
    }
    // Several lights together.
    let scene =
        form_lights(vec![ball(DVec3::Z * 2.0, 1.0), ball(DVec3::Z * 20.0, 10.0), ball(DVec3::new(8.0, 0.0, 6.0), 2.0)]);
    let expected = pi / 4.0 + pi / 4.0 + pi * 0.6 / 25.0;
    assert_irradiance(
        scene.lights(),
        Vec3A::Z,
        expected,
        5.0,
        "three balls, one behind another that hides nothing here",
    );
}

#[test]
fn far_from_the_origin_free_forms_do_not_hide_themselves() {
    // Numbers are 6e-5 apart there: a ray that grazes the rod would meet it before the point to which it was sent.
    let far = DVec3::new(311.0, -523.0, 702.0);
    let rod = FreeForm::new(Quadric::cylinder(far, DVec3::X, 0.03).expect("sound"), vec![]).expect("sound");
    let ends = Solid::cuboid(far - DVec3::splat(0.5), far + DVec3::splat(0.5)).expect("a box");
    let rod = Solid::intersection(Psi::Maximum, vec![rod.into(), ends]).expect("two parts");
    let square = [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
    for (solid, distance) in [(ball(far, 0.3), 1.0), (rod, 0.15)] {
        let corner = |(x, z)| (far + DVec3::new(x, -distance, z)).as_vec3();
        let floor = Mesh {
            positions: square.map(corner).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            materials: vec![1; 2],
            ..Mesh::default()
        };
        let materials = vec![emitter(1.0), Material::default()];
        let description =
            Description { meshes: vec![floor], forms: vec![form(solid, 0)], materials, ..Description::default() };
        let scene = Scene::new(description).expect("a right scene");
        let mut random = Random(3);
        let (mut found, mut hidden) = (0, 0);
        for _ in 0..10_000 {
            let place = far + DVec3::new(0.1, -0.5 * distance, 0.05 * f64::from(random.next()));
            let ray = Ray::new(place.as_vec3a(), Vec3A::NEG_Y);
            let surface = scene.surface(&ray, &scene.intersect(&ray).expect("the floor"));
            let Some(light) = scene.lights().sample(surface.p, surface.n, random.next(), random.pair()) else {
                continue;
            };
            found += 1;
            hidden += i32::from(scene.occluded(&surface.shadow_ray(light.wi, light.distance)));
        }
        assert!(found > 2000, "{found} samples");
        assert_eq!(hidden, 0, "of {found} samples of a lamp {distance} m above the floor");
    }
}

#[test]
fn densities_of_free_forms_are_those_of_their_samples() {
    // A light that is only a part of its region: the density over the directions that meet it is the share of samples
    // that do.
    let bar = Solid::cuboid(DVec3::new(-1.0, -0.1, -0.1), DVec3::new(1.0, 0.1, 0.1)).expect("a box");
    let turned = DAffine3::from_axis_angle(DVec3::ONE.normalize(), 0.8);
    let bar = bar.transformed(&(DAffine3::from_translation(DVec3::Z * 2.0) * turned)).expect("not singular");
    let ellipsoid = Quadric::ellipsoid(DVec3::new(0.0, 1.0, 2.5), DVec3::new(0.2, 0.4, 0.9)).expect("sound");
    let ellipsoid = Solid::from(FreeForm::new(ellipsoid, vec![]).expect("sound"));
    for (solids, what) in [(vec![bar], "bar"), (vec![ellipsoid], "ellipsoid"), (vec![shell(DVec3::X * 0.5)], "shell")] {
        let scene = form_lights(solids);
        let lights = scene.lights();
        let (mut random, n) = (Random(11), 400_000);
        let (mut found, mut integral, mut sum_sq) = (0.0, 0.0, 0.0);
        for _ in 0..n {
            let wi = random.direction_in_cone(2.0);
            if let Some(sample) = lights.sample(Vec3A::ZERO, wi, random.next(), random.pair()) {
                // The normal is turned at random, so that half of all directions are above it.
                found += 2.0;
                let ray = Ray::new(Vec3A::ZERO, sample.wi);
                let hit = scene.intersect(&ray).expect("the light is there");
                assert!((hit.t / sample.distance - 1.0).abs() < 1e-4, "{what}: at its distance");
                let pdf = lights.pdf_surface(Vec3A::ZERO, sample.wi, &scene.surface(&ray, &hit));
                assert!((pdf / sample.pdf - 1.0).abs() < 1e-3, "{what}: density {pdf}, sampled with {}", sample.pdf);
            }
            let ray = Ray::new(Vec3A::ZERO, random.direction());
            if let Some(hit) = scene.intersect(&ray) {
                let pdf = lights.pdf_surface(Vec3A::ZERO, ray.direction, &scene.surface(&ray, &hit));
                let value = f64::from(4.0 * PI * pdf);
                integral += value;
                sum_sq += value * value;
            }
        }
        let n = f64::from(n);
        let (found, integral) = (found / n, integral / n);
        // Binomial for the samples (each counts 2), by its own spread for the integral.
        let error = ((2.0 * found + sum_sq / n - integral * integral) / n).sqrt();
        assert!(
            (found - integral).abs() < 5.0 * error,
            "{what}: {found} of the samples meet it, {integral} +- {error} of the density"
        );
    }
}

#[test]
fn photons_of_free_forms_carry_their_flux() {
    let pi = f64::from(PI);
    let bar = Solid::cuboid(DVec3::new(-1.0, 3.0, 2.0), DVec3::new(1.0, 3.5, 3.0)).expect("a box");
    for (solid, area, what) in [
        (ball(DVec3::new(3.0, 0.0, 1.0), 0.5), pi, "ball"),
        (bar, 7.0, "box"),
        (shell(DVec3::Y), 4.0 * pi * (4.0 + 1.0), "shell"),
    ] {
        let scene = form_lights(vec![ball(DVec3::X * 90.0, 1e-3), solid]);
        assert!((f64::from(scene.lights().total_flux().x) / (pi * area) - 1.0).abs() < 2e-2, "{what}: its flux");
        let (mut random, n) = (Random(3), 200_000);
        let (mut flux, mut moment) = (0.0, DVec3::ZERO);
        for _ in 0..n {
            let Some(emission) = scene.lights().emit(random.next(), random.pair(), random.pair()) else { continue };
            assert!(is_normal(&emission.ray), "{what}: {:?}", emission.ray);
            let weight = f64::from(emission.flux.x);
            flux += weight;
            moment += weight * emission.ray.direction.as_dvec3();
        }
        let flux = flux / f64::from(n);
        assert!((flux / (pi * area) - 1.0).abs() < 2e-2, "{what}: {flux} is not pi times the area {area}");
        assert!((moment / f64::from(n)).length() < 2e-2 * flux, "{what}: a closed body shines evenly to all sides");
    }
    // What leaves a shell: the hollow's light is caught again, all photons that get away are those of the outer ball.
    let scene = form_lights(vec![shell(DVec3::ZERO)]);
    let (mut random, mut away, n) = (Random(8), 0.0, 200_000);
    for _ in 0..n {
        let Some(emission) = scene.lights().emit(random.next(), random.pair(), random.pair()) else { continue };
        if scene.intersect(&emission.ray).is_none() {
            away += f64::from(emission.flux.x) / f64::from(n);
        }
    }
    assert!((away / (16.0 * pi * pi) - 1.0).abs() < 2e-2, "{away} gets away");
}

#[test]
fn photons_start_where_pictures_let_a_form_shine() {
    // Of a ball of radius 0.5 the half at y < 0 shines: a picture is laid through it along z, of which a quarter is
    // bright.
    let rows = [[Vec3::ZERO; 768].as_slice(), &[Vec3::splat(4.0); 256]].concat();
    let projection = Projection::planar(DVec3::Y * -1.0, DVec3::X, DVec3::Y * 4.0);
    let holes: Vec<Vec3> = rows.iter().map(|row| *row / 4.0).collect();
    let shining = Material { emission_texture: Some(0), ..emitter(0.25) };
    let pierced = Material { opacity_texture: Some(0), ..emitter(1.0) };
    for (material, rows, what) in [(shining, rows, "a picture of light"), (pierced, holes, "a mask")] {
        let solid = ball(DVec3::ZERO, 0.5);
        let form = FormObject { name: String::new(), solid, material: 0, projection, copies: vec![] };
        let textures = vec![Texture::from_linear(1, 1024, rows)];
        let description =
            Description { forms: vec![form], materials: vec![material], textures, ..Description::default() };
        let scene = Scene::new(description).expect("a right scene");
        let half = f64::from(PI) * f64::from(PI) / 2.0;
        assert!((f64::from(scene.lights().total_flux().x) / half - 1.0).abs() < 3e-2, "{what}: its flux");
        let (mut random, n) = (Random(5), 200_000);
        let mut flux = 0.0;
        for _ in 0..n {
            let Some(emission) = scene.lights().emit(random.next(), random.pair(), random.pair()) else { continue };
            let is_lit = emission.ray.origin.y < 4e-3;
            assert!(is_lit || emission.flux == Vec3::ZERO, "{what}: {emission:?}");
            flux += f64::from(emission.flux.x);
        }
        assert!((flux / f64::from(n) / half - 1.0).abs() < 1e-2, "{what}: {flux} of {n} photons");
    }
}

#[test]
fn samples_of_patterned_lights_carry_what_is_seen_there() {
    // A picture of many colours on a turned triangle, on a ball, and on copies of a box that are turned and stretched.
    let colors: Vec<Vec3> = (0..64u8).map(|i| Vec3::new(f32::from(i), f32::from(i % 8), 1.0) / 64.0).collect();
    let textures = vec![Texture::from_linear(8, 8, colors)];
    let material = Material { emission_texture: Some(0), ..emitter(3.0) };
    let triangle = Mesh {
        positions: vec![Vec3::new(-2.0, -1.0, 3.0), Vec3::new(-2.5, 1.0, 2.0), Vec3::new(-1.0, 0.5, 2.5)],
        triangles: vec![[0, 1, 2]],
        uvs: vec![Vec2::new(-0.3, 0.1), Vec2::new(1.7, 0.4), Vec2::new(0.5, 2.2)],
        uv_indices: vec![[0, 1, 2]],
        materials: vec![0],
        ..Mesh::default()
    };
    let bar = Solid::cuboid(DVec3::new(-0.5, -0.2, -0.3), DVec3::new(0.5, 0.2, 0.3)).expect("a box");
    let turn = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.7);
    let copy =
        |x: f64| DAffine3::from_scale_rotation_translation(DVec3::new(1.0, 2.0, 0.7), turn, DVec3::new(x, -1.0, 2.0));
    let form = |solid, projection, copies| FormObject { name: String::new(), solid, material: 0, projection, copies };
    let forms = vec![
        form(ball(DVec3::new(1.0, 1.0, 3.0), 0.7), None, vec![]),
        form(bar, Some(Projection::cube(DVec3::X * 0.1, 0.3)), vec![copy(0.0), copy(1.5)]),
    ];
    let description =
        Description { meshes: vec![triangle], forms, materials: vec![material], textures, ..Description::default() };
    let scene = Scene::new(description).expect("a right scene");
    assert_eq!(scene.lights().count(), 4, "all are sampled");
    let (mut random, mut counts) = (Random(11), [0; 4]);
    // Steps of the picture and of positions do not fall together: a few samples lie at the edge of a side.
    let mut off = 0;
    for _ in 0..20_000 {
        let Some(sample) = scene.lights().sample(Vec3A::ZERO, Vec3A::Z, random.next(), random.pair()) else { continue };
        let ray = Ray::new(Vec3A::ZERO, sample.wi);
        let Some(hit) = scene.intersect(&ray) else { continue };
        if (hit.t - sample.distance).abs() > 1e-4 {
            continue; // another one stands before it
        }
        counts[hit.primitive as usize] += 1;
        let seen = scene.emission(&scene.surface(&ray, &hit));
        off += u32::from((sample.radiance - seen).abs().max_element() > 0.01);
    }
    assert!(counts.iter().all(|count| *count > 500), "all are met: {counts:?}");
    assert!(off < 20, "{off} samples carry something else");
}
