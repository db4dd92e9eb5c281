//! Surfaces as rays meet them: offsets, sides, normals, holes, free forms.

use glam::{DAffine3, DQuat, DVec3, Vec2, Vec3, Vec3A};
use scene::freeform::{FreeForm, Psi, Quadric, Solid};
use scene::{
    Description, FormObject, Material, Mesh, NO_INDEX, Noise, Pattern, Projection, Ray, Scene, Specular, SpecularKind,
    Surface, Texture,
};

/// A stream of numbers in [0, 1) (PCG).
struct Random(u32);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let word = ((self.0 >> ((self.0 >> 28) + 4)) ^ self.0).wrapping_mul(277_803_737);
        (((word >> 22) ^ word) >> 8) as f32 / 16_777_216.0
    }

    fn pair(&mut self) -> Vec2 {
        Vec2::new(self.next(), self.next())
    }
}

/// A parallelogram.
fn quad(corner: Vec3, u: Vec3, v: Vec3) -> Mesh {
    Mesh {
        name: "quad".into(),
        positions: vec![corner, corner + u, corner + u + v, corner + v],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        materials: vec![0; 2],
        ..Mesh::default()
    }
}

fn built(meshes: Vec<Mesh>, material: Material) -> Scene {
    Scene::new(Description { meshes, materials: vec![material], ..Description::default() }).expect("a right scene")
}

fn sphere(centre: DVec3, radius: f64, material: Material) -> Scene {
    let solid = Solid::from(FreeForm::new(Quadric::sphere(centre, radius).expect("a sphere"), vec![]).expect("a form"));
    let forms = vec![FormObject { name: "ball".into(), solid, material: 0, projection: None, copies: vec![] }];
    Scene::new(Description { forms, materials: vec![material], ..Description::default() }).expect("a right scene")
}

fn met(scene: &Scene, ray: &Ray) -> Surface {
    scene.surface(ray, &scene.intersect(ray).expect("something is met"))
}

#[test]
fn offset_does_not_change_the_picture() {
    // A slope of ten squares that do not lie on f32 numbers, moved ever farther: no ray to the open sky is stopped by
    // what it leaves.
    let normal = Vec3::new(0.3, 0.9, -0.2).normalize();
    let u = normal.any_orthonormal_vector() * 10.0;
    let v = normal.cross(u);
    for centre in [Vec3::ZERO, Vec3::splat(1e2), Vec3::new(1e4, -1e4, 1e4)] {
        let scene = built(vec![quad(centre - 0.5 * (u + v), u, v)], Material::default());
        let mut random = Random(1);
        for _ in 0..100_000 {
            let target = centre + u * (0.9 * (random.next() - 0.5)) + v * (0.9 * (random.next() - 0.5));
            let side = if random.next() < 0.5 { normal } else { -normal };
            let origin = Vec3A::from(target + side * 3.0 + u * (random.next() - 0.5));
            let ray = Ray::new(origin, (Vec3A::from(target) - origin).normalize());
            let Some(hit) = scene.intersect(&ray) else { continue };
            let surface = scene.surface(&ray, &hit);
            let frame = hemimap::Frame::from_normal(surface.ng);
            let up = frame.to_world(hemimap::square_to_cosine_hemisphere(random.pair()));
            for (way, name) in [(up, "towards"), (-up, "through to")] {
                let ray = surface.spawn(way);
                assert!(!scene.occluded(&Ray { from: Ray::NOWHERE, ..ray }), "blocked at {} {name} {way}", surface.p);
                assert_eq!(ray.from, hit.primitive, "which it passes over besides");
            }
            let above = surface.spawn(surface.ng).origin + 0.1 * surface.ng;
            assert!(scene.occluded(&Ray::new(above, -surface.ng)), "it does block others");
        }
    }
}

#[test]
fn grazing_rays_neither_leak_nor_hit_what_they_leave() {
    let scene = built(vec![quad(Vec3::new(-50.0, 0.1, -50.0), Vec3::Z * 100.0, Vec3::X * 100.0)], Material::default());
    let mut random = Random(2);
    for angle in [1e-2, 1e-3, 1e-4, 1e-5, 1e-6f32] {
        for _ in 0..2000 {
            let (sin, cos) = (std::f32::consts::TAU * random.next()).sin_cos();
            let down = Vec3A::new(cos, -angle, sin).normalize();
            // From so low that the floor is met within it; at 1e-6 a height of 1e-5 is some hundred units in the last
            // place.
            let height = 10.0 * angle;
            let origin = Vec3A::new(20.0 * (random.next() - 0.5), 0.1 + height, 20.0 * (random.next() - 0.5));
            let ray = Ray::new(origin, down);
            let surface = met(&scene, &ray);
            assert!(surface.front, "from above");
            let up = Vec3A::new(down.x, -down.y, down.z);
            // By its offset alone.
            let spawn = |way| Ray { from: Ray::NOWHERE, ..surface.spawn(way) };
            assert!(!scene.occluded(&spawn(up)), "reflected at {angle}");
            assert!(!scene.occluded(&spawn(down)), "through at {angle}");
        }
    }
}

#[test]
fn shadow_rays_end_before_their_light() {
    let (floor, lamp) = (quad(Vec3::ZERO, Vec3::Z, Vec3::X), quad(Vec3::Y, Vec3::X, Vec3::Z));
    let scene = built(vec![floor, lamp], Material::default());
    let mut random = Random(3);
    for _ in 0..20_000 {
        let ray = Ray::new(Vec3A::new(random.next(), 0.5, random.next()), -Vec3A::Y);
        let surface = met(&scene, &ray);
        let light = Vec3A::new(random.next(), 1.0, random.next());
        assert!(!scene.occluded(&surface.spawn_to(light)), "{} to {light}", surface.p);
        assert_eq!(surface.spawn_to(light).from, surface.primitive, "which it passes over");
        assert!(
            scene.occluded(&surface.spawn_to(light + (light - surface.p))),
            "something stands before what is farther"
        );
        let wi = (light - surface.p).normalize();
        assert!(!scene.occluded(&surface.shadow_ray(wi, light.distance(surface.p))), "by distance");
        assert!(scene.occluded(&surface.shadow_ray(wi, f32::INFINITY)), "to the sky");
    }
    let surface = met(&scene, &Ray::new(Vec3A::splat(0.5), -Vec3A::Y));
    assert!(!scene.occluded(&surface.spawn_to(surface.p)), "to itself");
}

#[test]
fn sides_and_normals_are_those_of_the_viewer() {
    let mut mesh = quad(Vec3::ZERO, Vec3::X, Vec3::Y);
    mesh.normals = vec![Vec3::new(1.0, 0.0, 0.2), Vec3::Z];
    mesh.normal_indices = vec![[0; 3], [1, 1, NO_INDEX]];
    let scene = built(vec![mesh], Material::default());
    let lower = Vec3A::new(0.7, 0.3, 0.0);
    let above = met(&scene, &Ray::new(lower + Vec3A::Z, -Vec3A::Z));
    assert!(above.front && (above.ng - Vec3A::Z).length() < 1e-6, "the front is where corners are counter-clockwise");
    assert!((above.n - Vec3A::new(1.0, 0.0, 0.2).normalize()).length() < 1e-6, "an interpolated normal: {}", above.n);
    let below = met(&scene, &Ray::new(lower - Vec3A::Z, Vec3A::Z));
    assert!(
        !below.front && (below.ng + above.ng).length() < 1e-6 && (below.n + above.n).length() < 1e-6,
        "turned to the viewer"
    );
    assert_eq!(
        met(&scene, &Ray::new(Vec3A::new(0.3, 0.7, 1.0), -Vec3A::Z)).n,
        Vec3A::Z,
        "flat where a corner has none"
    );
    // From -x the interpolated normal points away: it is tilted to the viewer and stays in the plane of both.
    let direction = Vec3A::new(1.0, 0.0, -0.5).normalize();
    let tilted = met(&scene, &Ray::new(lower - direction, direction));
    let cosine = -tilted.n.dot(direction);
    assert!(cosine > 0.0 && cosine < 0.01 && (tilted.n.length() - 1.0).abs() < 1e-6, "{}", tilted.n);
}

#[test]
fn fronts_alone_shine() {
    let material = Material { emission: Vec3::splat(3.0), ..Material::default() };
    let scene = built(vec![quad(Vec3::ZERO, Vec3::X, Vec3::Y)], material);
    let middle = Vec3A::new(0.5, 0.4, 0.0);
    assert_eq!(scene.emission(&met(&scene, &Ray::new(middle + Vec3A::Z, -Vec3A::Z))), Vec3::splat(3.0), "the front");
    assert_eq!(scene.emission(&met(&scene, &Ray::new(middle - Vec3A::Z, Vec3A::Z))), Vec3::ZERO, "the back");
    assert!(scene.features().area_lights && !scene.features().emissive_unsampled, "it is sampled");
}

#[test]
fn holes_let_their_share_pass() {
    // Half there, in front of nothing.
    let scene = built(vec![quad(Vec3::ZERO, Vec3::X, Vec3::Y)], Material { opacity: 0.25, ..Material::default() });
    let mut random = Random(4);
    let mut stopped = 0;
    for _ in 0..40_000 {
        let ray = Ray::new(Vec3A::new(random.next(), random.next(), 1.0), -Vec3A::Z);
        let hit = scene.intersect(&ray);
        assert_eq!(hit.is_some(), scene.occluded(&ray), "both agree");
        assert_eq!(hit, scene.intersect(&ray), "and repeat");
        stopped += u32::from(hit.is_some());
    }
    // Five binomial deviations.
    assert!((f64::from(stopped) - 10_000.0).abs() < 5.0 * (40_000.0f64 * 0.25 * 0.75).sqrt(), "{stopped} of 40000");
    // A mask: left black, right white, with coordinates across the square.
    let mut mesh = quad(Vec3::ZERO, Vec3::X, Vec3::Y);
    mesh.uvs = vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    mesh.uv_indices = mesh.triangles.clone();
    let textures = vec![Texture::from_srgb8(4, 1, vec![[0; 3], [0; 3], [255; 3], [255; 3]])];
    let materials = vec![Material { opacity_texture: Some(0), ..Material::default() }];
    let scene = Scene::new(Description { meshes: vec![mesh], materials, textures, ..Description::default() }).unwrap();
    let passes = |x: f32| scene.intersect(&Ray::new(Vec3A::new(x, 0.5, 1.0), -Vec3A::Z)).is_none();
    assert!(passes(0.2) && passes(0.3) && !passes(0.7) && !passes(0.8), "by the mask");
}

#[test]
fn textures_color_surfaces() {
    let mut mesh = quad(Vec3::ZERO, Vec3::X, Vec3::Y);
    mesh.uvs = vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    mesh.uv_indices = mesh.triangles.clone();
    let textures = vec![Texture::from_linear(1, 2, vec![Vec3::X, Vec3::Y])];
    let reflectance = Vec3::splat(0.25);
    let specular = SpecularKind::Ggx { alpha: 0.2, reflectance, schlick: false };
    let materials =
        vec![Material { diffuse: Vec3::splat(0.8), diffuse_texture: Some(0), specular, ..Material::default() }];
    let scene = Scene::new(Description { meshes: vec![mesh], materials, textures, ..Description::default() }).unwrap();
    let at = |y: f32| scene.bsdf(&met(&scene, &Ray::new(Vec3A::new(0.5, y, 1.0), -Vec3A::Z))).diffuse;
    assert!(
        (at(0.25) - 0.6 * Vec3::Y).length() < 1e-5,
        "the lowest row at v = 0, scaled by what gloss leaves: {}",
        at(0.25)
    );
    assert!((at(0.75) - 0.6 * Vec3::X).length() < 1e-5, "the first row on top: {}", at(0.75));
}

#[test]
fn textures_color_what_reflects() {
    let mut mesh = quad(Vec3::ZERO, Vec3::X, Vec3::Y);
    mesh.uvs = vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    mesh.uv_indices = mesh.triangles.clone();
    let reflectance = Vec3::splat(0.5);
    for specular in
        [SpecularKind::Ggx { alpha: 0.2, reflectance, schlick: false }, SpecularKind::Mirror { reflectance }]
    {
        let material =
            Material { diffuse: Vec3::splat(0.8), specular, specular_texture: Some(0), ..Material::default() };
        assert!(material.is_diffuse() && Material { diffuse: Vec3::ONE, ..material.clone() }.is_diffuse());
        let textures = vec![Texture::from_linear(1, 2, vec![Vec3::X, Vec3::Y])];
        let materials = vec![material];
        let scene =
            Scene::new(Description { meshes: vec![mesh.clone()], materials, textures, ..Description::default() })
                .unwrap();
        let bsdf = scene.bsdf(&met(&scene, &Ray::new(Vec3A::new(0.5, 0.25, 1.0), -Vec3A::Z)));
        let (Specular::Ggx { reflectance, .. } | Specular::Mirror { reflectance }) = bsdf.specular else {
            panic!("it reflects: {bsdf:?}")
        };
        assert!((reflectance - 0.5 * Vec3::Y).length() < 1e-5, "the lowest row: {reflectance}");
        assert!((bsdf.diffuse - Vec3::new(0.8, 0.4, 0.8)).length() < 1e-5, "what that leaves: {}", bsdf.diffuse);
        let black = Material { specular_texture: Some(1), ..scene.materials()[0].clone() };
        let textures = vec![Texture::from_linear(1, 1, vec![Vec3::ONE]), Texture::from_linear(1, 1, vec![Vec3::ZERO])];
        let description =
            Description { meshes: vec![mesh.clone()], materials: vec![black], textures, ..Description::default() };
        let scene = Scene::new(description).unwrap();
        let bsdf = scene.bsdf(&met(&scene, &Ray::new(Vec3A::new(0.5, 0.25, 1.0), -Vec3A::Z)));
        assert_eq!((bsdf.specular, bsdf.diffuse), (Specular::None, Vec3::splat(0.8)), "nothing where it is black");
    }
}

#[test]
fn projections_and_noise_color_free_forms() {
    // From 0.25 at a quarter of its width to 0.75 at three quarters: between them the colour is u.
    let textures = vec![Texture::from_linear(2, 1, vec![Vec3::splat(0.25), Vec3::splat(0.75)])];
    let noise = Noise {
        pattern: Pattern::Clouds,
        size: Vec3::splat(0.3),
        octaves: 3,
        distortion: 0.0,
        low: Vec3::ZERO,
        high: Vec3::ONE,
        seed: 0,
    };
    let materials = vec![
        Material { diffuse: Vec3::ONE, diffuse_texture: Some(0), ..Material::default() },
        Material { diffuse: Vec3::splat(0.5), noise: Some(noise), ..Material::default() },
        Material { opacity_texture: Some(0), opacity: 0.0, ..Material::default() },
    ];
    let ball = |x: f64, material, projection| {
        let quadric = Quadric::sphere(DVec3::X * x, 0.5).expect("a sphere");
        let solid = Solid::from(FreeForm::new(quadric, vec![]).expect("a form"));
        FormObject { name: String::new(), solid, material, projection, copies: vec![] }
    };
    let forms = vec![
        ball(0.0, 0, Projection::planar(DVec3::X * -0.5, DVec3::X, DVec3::Y)),
        ball(2.0, 0, Projection::spherical(DVec3::X * 2.0, DVec3::Y, DVec3::X)),
        ball(4.0, 0, Some(Projection::cube(DVec3::X * 4.0, 0.5))),
        ball(6.0, 1, None),
        ball(8.0, 2, Some(Projection::cube(DVec3::X * 8.0, 0.5))),
    ];
    let scene = Scene::new(Description { forms, materials, textures, ..Description::default() }).unwrap();
    let ray = |x: f32, z: f32| Ray::new(Vec3A::new(x, 0.0, 3.0 * z), -Vec3A::Z * z);
    let at = |x, z| scene.bsdf(&met(&scene, &ray(x, z))).diffuse.x;
    for (x, z, expected, what) in [
        (-0.25, 1.0, 0.25, "planar, left"),
        (0.25, 1.0, 0.75, "planar, right"),
        (0.25, -1.0, 0.75, "planar, the same behind"),
        (2.3, 1.0, 0.352, "a globe with its front at +x: as seen from there +z is to the left, by asin(4/5) / 2 pi"),
        (2.3, -1.0, 0.648, "and -z to the right"),
        (4.125, 1.0, 0.75, "box, right of the middle"),
        (4.125, -1.0, 0.25, "box, not mirrored from behind"),
    ] {
        assert!((at(x, z) - expected).abs() < 1e-3, "{what}: {}", at(x, z));
    }
    let surface = met(&scene, &ray(6.1, 1.0));
    assert_eq!(scene.bsdf(&surface).diffuse, 0.5 * noise.color(surface.p), "noise at the point itself");
    assert!(scene.intersect(&ray(8.0, 1.0)).is_none(), "masks see through");
    let mut singular = ball(0.0, 0, Some(Projection::cube(DVec3::ZERO, 0.0)));
    singular.name = "flat".into();
    let description =
        Description { forms: vec![singular], materials: vec![Material::default()], ..Description::default() };
    let error = Scene::new(description).map(|_| ()).unwrap_err().to_string();
    assert_eq!(error, "free form \"flat\" (0): its projection is singular or not finite", "no size");
}

#[test]
fn free_forms_are_met_exactly_and_left_safely() {
    let centre = DVec3::new(100.0, -30.0, 7.0);
    let glass =
        SpecularKind::Dielectric { ior: 1.5, tint: Vec3::ONE, absorption: Vec3::new(0.0, 0.5, 1.0), priority: 0 };
    let scene = sphere(centre, 2.0, Material { specular: glass, ..Material::default() });
    assert!(scene.features().absorbing && scene.features().delta && scene.form_count() == 1, "its features");
    let mut random = Random(5);
    for _ in 0..20_000 {
        let outward = hemimap::square_to_uniform_hemisphere(random.pair());
        let aim = centre.as_vec3a() + 1.9 * Vec3A::new(random.next() - 0.5, random.next() - 0.5, 0.0);
        let origin = aim + outward * 20.0;
        let ray = Ray::new(origin, -outward);
        let enter = met(&scene, &ray);
        let radius = (enter.p.as_dvec3() - centre).length();
        assert!((radius - 2.0).abs() < 1e-5 && enter.front, "on the sphere: {radius}");
        assert!((enter.ng.as_dvec3() - (enter.p.as_dvec3() - centre) / 2.0).length() < 1e-5, "the outward normal");
        assert_eq!(scene.transmittance(&enter), Vec3::ONE, "outside nothing absorbs");
        assert!(!scene.occluded(&enter.spawn(enter.ng)), "outwards is free");
        let inside = enter.spawn(-enter.ng);
        let leave = met(&scene, &inside);
        assert!(!leave.front && (leave.t - 4.0).abs() < 1e-3, "through the middle: {}", leave.t);
        let expected = (-Vec3::new(0.0, 0.5, 1.0) * leave.t).exp();
        assert!((scene.transmittance(&leave) - expected).abs().max_element() < 1e-6, "Beer's law");
        assert!(!scene.occluded(&leave.spawn(-leave.ng)), "out again is free");
        assert!(scene.occluded(&leave.spawn(leave.ng)), "back again is not");
    }
}

#[test]
fn copies_are_met_like_solids_that_were_moved() {
    let ball = |x: f64, radius: f64| -> Solid {
        FreeForm::new(Quadric::sphere(DVec3::X * x, radius).expect("a sphere"), vec![]).expect("a form").into()
    };
    let apple =
        Solid::difference(Psi::Maximum, vec![ball(0.0, 1.0), ball(1.2, 0.5), ball(-0.9, 0.3)]).expect("three parts");
    let copies: Vec<DAffine3> = (0..40)
        .map(|i| {
            let i = f64::from(i);
            let turn = DQuat::from_rotation_y(i) * DQuat::from_rotation_x(0.7 * i);
            // Some are mirrored, some flat, and all stand 10 km away.
            let size = DVec3::new(
                0.5 + 0.02 * i,
                if i % 3.0 == 0.0 { -1.0 } else { 1.0 },
                if i % 4.0 == 0.0 { 0.2 } else { 1.0 },
            );
            let place = DVec3::new(1e4 + 2.0 * (i % 7.0), 3.0 * (i / 7.0).floor(), i.sin());
            DAffine3::from_scale_rotation_translation(size, turn, place)
        })
        .collect();
    let projection = Some(Projection::cube(DVec3::ZERO, 0.4));
    let object =
        |solid: Solid, projection, copies| FormObject { name: String::new(), solid, material: 0, projection, copies };
    let scene_of = |forms| {
        Scene::new(Description { forms, materials: vec![Material::default()], ..Description::default() }).unwrap()
    };
    let moved = copies.iter().map(|copy| {
        let solid = apple.transformed(copy).expect("not singular");
        object(solid, projection.map(|projection: Projection| projection.transformed(copy)), vec![])
    });
    let moved = scene_of(moved.collect());
    let scene = scene_of(vec![object(apple, projection, copies)]);
    assert_eq!((scene.form_count(), scene.triangle_count()), (40, 0), "each copy counts");
    let held = (
        scene.bounds().min.cmple(moved.bounds().min + 1e-3).all(),
        scene.bounds().max.cmpge(moved.bounds().max - 1e-3).all(),
    );
    assert_eq!(held, (true, true), "the box holds them");
    let (mut random, mut hits) = (Random(21), 0);
    for _ in 0..20_000 {
        let aim = Vec3A::new(1e4 + 14.0 * random.next(), 18.0 * random.next(), 2.0 * random.next() - 1.0);
        let outward = hemimap::square_to_uniform_hemisphere(random.pair());
        let ray = Ray::new(aim + outward * 30.0, -outward);
        let (Some(a), Some(b)) = (scene.intersect(&ray), moved.intersect(&ray)) else {
            // Only a graze may differ.
            let graze = scene.intersect(&ray).or(moved.intersect(&ray));
            if let Some(hit) = graze {
                let surface =
                    if scene.intersect(&ray).is_some() { scene.surface(&ray, &hit) } else { moved.surface(&ray, &hit) };
                assert!(surface.ng.dot(ray.direction).abs() < 1e-2, "a hit that only one of them has");
            }
            continue;
        };
        let (a, b) = (scene.surface(&ray, &a), moved.surface(&ray, &b));
        hits += 1;
        assert_eq!(a.primitive, b.primitive, "the same copy");
        assert!((a.t - b.t).abs() < 1e-3 * (1.0 + 1.0 / a.ng.dot(ray.direction).abs()), "{} and {}", a.t, b.t);
        // Where two parts meet, rounding may choose the other one.
        if a.ng.dot(b.ng) > 0.999 {
            assert!(a.front == b.front && (a.p - b.p).length() < 2e-2, "{} and {}", a.p, b.p);
            assert!((a.uv - b.uv).abs().max_element() < 2e-2 || a.ng.dot(b.ng) < 0.99999, "{} and {}", a.uv, b.uv);
        }
        assert!(!scene.occluded(&Ray { t_max: 1e-2, ..a.spawn(a.ng) }), "rays leave it");
    }
    assert!(hits > 4000, "enough of them hit: {hits}");
    let flat = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
    let description = Description {
        forms: vec![object(ball(0.0, 1.0), None, vec![flat])],
        materials: vec![Material::default()],
        ..Description::default()
    };
    let error = Scene::new(description).map(|_| ()).unwrap_err().to_string();
    assert_eq!(error, "free form \"\" (0): a copy is singular or not finite", "no thickness");
}

#[test]
fn unbounded_forms_stand_beside_the_tree() {
    let ground = Solid::from(FreeForm::new(Quadric::half_space(DVec3::ZERO, DVec3::Y).unwrap(), vec![]).unwrap());
    let forms =
        vec![FormObject { name: "ground".into(), solid: ground, material: 0, projection: None, copies: vec![] }];
    let meshes = vec![quad(Vec3::Y, Vec3::Z, Vec3::X)];
    let scene =
        Scene::new(Description { forms, meshes, materials: vec![Material::default()], ..Description::default() })
            .unwrap();
    let at = |x: f32| met(&scene, &Ray::new(Vec3A::new(x, 2.0, 0.5), -Vec3A::Y));
    assert_eq!((at(0.3).primitive, at(5.0).primitive), (0, 2), "the square before the ground, the ground beside it");
    assert!((at(5.0).p.y).abs() < 1e-5 && at(5.0).front, "on the ground");
    assert!(scene.occluded(&Ray::new(Vec3A::new(9.0, 1.0, 9.0), -Vec3A::Y)), "the ground blocks");
    assert!(scene.bounds().max.x < 2.0, "bounds are those of what is bounded");
}

#[test]
fn triangles_of_no_area_keep_the_numbering() {
    let mut mesh = quad(Vec3::ZERO, Vec3::X, Vec3::Y);
    mesh.triangles.insert(0, [1, 1, 2]);
    mesh.materials.push(0);
    let scene = built(vec![mesh], Material::default());
    let hit = scene.intersect(&Ray::new(Vec3A::new(0.7, 0.3, 1.0), -Vec3A::Z)).unwrap();
    assert_eq!((hit.primitive, scene.triangle_count()), (1, 3), "the second triangle");
}

#[test]
fn glass_ball_vanishes_in_a_furnace() {
    let glass = SpecularKind::Dielectric { ior: 1.5, tint: Vec3::ONE, absorption: Vec3::ZERO, priority: 0 };
    let scene = sphere(DVec3::ZERO, 1.0, Material { specular: glass, ..Material::default() });
    for height in [0.0, 0.3, 0.8, 0.99] {
        let mut sum = 0.0;
        let mut todo = vec![(Ray::new(Vec3A::new(-3.0, height, 0.0), Vec3A::X), 1.0f64)];
        while let Some((ray, weight)) = todo.pop() {
            let Some(hit) = scene.intersect(&ray) else {
                sum += weight;
                continue;
            };
            let surface = scene.surface(&ray, &hit);
            let frame = hemimap::Frame::from_normal(surface.n);
            let branches = scene.bsdf(&surface).delta_branches(frame.to_local(-ray.direction));
            for branch in branches.into_iter().flatten().filter(|_| weight > 1e-7) {
                todo.push((surface.spawn(frame.to_world(branch.wi)), weight * f64::from(branch.weight.x)));
            }
        }
        assert!((sum - 1.0).abs() < 1e-5, "a ray at height {height} brings {sum}");
    }
}
