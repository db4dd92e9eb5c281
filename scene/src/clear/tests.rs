use freeform::{FreeForm, Quadric};
use glam::{Affine3A, DVec3, Quat, UVec2, Vec2, Vec3};

use super::*;
use crate::bvh::tests::Random;
use crate::{Camera, Description, FormObject, Material, Mesh, PunctualLight};

const SIZE: UVec2 = UVec2::splat(64);

/// A floor, a lamp above it and things between, seen by a camera at 6 m, all of it moved.
struct World {
    mesh: Mesh,
    lights: Vec<PunctualLight>,
    forms: Vec<FormObject>,
    place: Affine3A,
}

impl World {
    fn new() -> Self {
        Self::on_floor(4.0)
    }

    fn on_floor(half: f32) -> Self {
        let place = Affine3A::IDENTITY;
        let mut world = Self { mesh: Mesh::default(), lights: Vec::new(), forms: Vec::new(), place };
        world.square(Vec3::ZERO, half, 0);
        world
    }

    fn triangle(&mut self, corners: [Vec3; 3], material: u32) {
        let first = u32::try_from(self.mesh.positions.len()).unwrap();
        self.mesh.positions.extend(corners);
        self.mesh.triangles.push([first, first + 1, first + 2]);
        self.mesh.materials.push(material);
    }

    /// A level square that faces up, or down where it shines.
    fn square(&mut self, centre: Vec3, half: f32, material: u32) {
        let corner = |x: f32, z: f32| centre + half * Vec3::new(x, 0.0, if material == 1 { -z } else { z });
        let corners = [corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
        self.triangle([corners[0], corners[1], corners[2]], material);
        self.triangle([corners[0], corners[2], corners[3]], material);
    }

    fn scene(self) -> Scene {
        self.seen_from(Vec3::new(0.5, 4.0, 6.0), Vec3::ZERO)
    }

    fn seen_from(mut self, eye: Vec3, at: Vec3) -> Scene {
        let place = self.place;
        self.mesh.positions.iter_mut().for_each(|p| *p = place.transform_point3(*p));
        for light in &mut self.lights {
            match light {
                PunctualLight::Point { position, .. } => *position = place.transform_point3(*position),
                PunctualLight::Directional { direction, .. } => *direction = place.transform_vector3(*direction),
            }
        }
        let lamp = Material { emission: Vec3::ONE, ..Material::default() };
        let [eye, at] = [eye, at].map(|p| place.transform_point3(p));
        let camera = Camera { eye, at, up: place.transform_vector3(Vec3::Y), fov_y_degrees: 60.0 };
        Scene::new(Description {
            meshes: vec![self.mesh],
            materials: vec![Material::default(), lamp],
            lights: self.lights,
            forms: self.forms,
            camera: Some(camera),
            ..Description::default()
        })
        .unwrap()
    }
}

/// What a pixel shows, and the patch of it.
fn seen(scene: &Scene, pixel: Vec2, place: Vec2) -> Option<Surface> {
    let ray = scene.camera_ray(pixel + place, SIZE);
    scene.intersect(&ray).map(|hit| scene.surface(&ray, &hit))
}

fn patch(scene: &Scene, pixel: Vec2) -> Option<Patch> {
    scene.patch(&seen(scene, pixel, Vec2::splat(0.5))?, [pixel, pixel + 1.0], SIZE)
}

/// Whether shadow rays from the patch of a pixel to a light are all free.
fn is_free(scene: &Scene, pixel: Vec2, patch: &Patch, light: usize, random: &mut Random) -> bool {
    (0..64).all(|_| {
        let Some(surface) = seen(scene, pixel, Vec2::new(random.next(), random.next())) else { return true };
        if !patch.holds(&surface) {
            return true;
        }
        let mut lights = scene.lights().seen_from(surface.p, surface.n);
        let sample = lights.direction_to_one(light, 1.0, Vec2::new(random.next(), random.next()));
        sample.is_none_or(|light| {
            let ray = surface.shadow_ray(light.wi(), light.distance());
            // Far from the origin a ray may meet a lamp that it passes along before its end.
            scene.intersect(&ray).is_none_or(|hit| hit.t > 0.999 * light.distance())
        })
    })
}

/// Counts the pixels whose patches are clear, and those whose shadow rays are free; a clear one must be free.
fn count(scene: &Scene, light: usize, random: &mut Random) -> [u32; 2] {
    let (mut clear, mut free) = (0, 0);
    for pixel in (0..SIZE.element_product()).step_by(7) {
        let pixel = UVec2::new(pixel % SIZE.x, pixel / SIZE.x).as_vec2();
        let Some(patch) = patch(scene, pixel) else { continue };
        let (is_clear, is_free) = (scene.is_clear(&patch, light), is_free(scene, pixel, &patch, light, random));
        assert!(is_free || !is_clear, "pixel {pixel}: something hides light {light}");
        clear += u32::from(is_clear);
        free += u32::from(is_free);
    }
    [clear, free]
}

#[test]
fn clear_patches_have_no_shadows() {
    let mut random = Random(5);
    let mut sums = [0; 2];
    let turned = Affine3A::from_quat(Quat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.7));
    let far = Affine3A::from_translation(Vec3::new(100.0, -200.0, 300.0));
    let places = [Affine3A::IDENTITY, turned, far * turned, Affine3A::from_scale(Vec3::splat(1e-4)) * turned];
    for round in 0..120 {
        let place = places[round / 3 % 4];
        let mut world = World { place, ..World::new() };
        let size = [0.05, 0.5, 3.0][round % 3];
        for _ in 0..[1, 8, 40, 300][round / 12 % 4] {
            let p = random.vector() * Vec3::new(6.0, 2.0, 6.0) - Vec3::new(3.0, 0.0, 3.0);
            let corners = [(); 3].map(|()| p + size * (random.vector() - 0.5));
            world.triangle(corners, 0);
        }
        world.square(Vec3::new(random.next() - 0.5, 3.0, random.next() - 0.5), 0.05 + random.next(), 1);
        let hanging = [(); 3].map(|()| random.vector() + Vec3::Y * 2.5);
        world.triangle(hanging, 1);
        world.lights.push(PunctualLight::Point { position: random.vector() + Vec3::Y, intensity: Vec3::ONE });
        let direction = random.vector() - Vec3::new(0.5, 1.5, 0.5);
        world.lights.push(PunctualLight::Directional { direction, irradiance: Vec3::ONE });
        let scene = world.scene();
        for light in 0..scene.lights().count() {
            let found = count(&scene, light, &mut random);
            sums = [sums[0] + found[0], sums[1] + found[1]];
        }
    }
    // Random rays miss much of what hides little, so more patches are free than clear.
    assert!(2 * sums[0] > sums[1], "{} clear of {} without shadows", sums[0], sums[1]);
}

#[test]
fn a_ground_without_end_hides_what_is_sunk_in_it() {
    // A lamp of 0.4 m that stands three eighths deep in ground of 200 km, before a wall.
    let mut random = Random(3);
    let mut world = World::on_floor(1e5);
    let lamp = [(-1.0, -0.15), (1.0, -0.15), (1.0, 0.25), (-1.0, 0.25)].map(|(x, y)| Vec3::new(x, y, -2.0));
    world.triangle([lamp[0], lamp[1], lamp[2]], 1);
    world.triangle([lamp[0], lamp[2], lamp[3]], 1);
    let wall = [(-2.0, 0.0), (-2.0, 2.0), (2.0, 2.0), (2.0, 0.0)].map(|(x, y)| Vec3::new(x, y, 2.0));
    world.triangle([wall[0], wall[1], wall[2]], 0);
    world.triangle([wall[0], wall[2], wall[3]], 0);
    let scene = world.seen_from(Vec3::new(0.0, 1.0, -1.0), Vec3::new(0.0, 0.8, 2.0));
    assert_eq!(count(&scene, 0, &mut random)[0], 0, "the ground hides a part of the lamp from all");
}

#[test]
fn bodies_without_bounds_may_be_anywhere() {
    let mut random = Random(6);
    let plane = FreeForm::new(Quadric::half_space(DVec3::Y * -9.0, DVec3::Y).unwrap(), vec![]).unwrap().into();
    let mut world = World::new();
    world.square(Vec3::Y * 3.0, 0.5, 1);
    world.forms.push(FormObject {
        name: String::new(),
        solid: plane,
        material: 0,
        projection: None,
        copies: Vec::new(),
    });
    let [clear, free] = count(&world.scene(), 0, &mut random);
    assert!(clear == 0 && free > 350, "{clear} of {free}");
}

#[test]
fn an_empty_room_is_clear_and_the_shadow_of_a_plate_is_not() {
    let lamp = |world: &mut World| world.square(Vec3::Y * 3.0, 0.5, 1);
    let mut random = Random(2);
    // However it is turned, and far from the origin.
    let turned = Affine3A::from_quat(Quat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.7));
    let far = Affine3A::from_translation(Vec3::new(100.0, -200.0, 300.0));
    let mut clear = 0;
    for place in [far * turned, turned, Affine3A::IDENTITY] {
        let mut world = World { place, ..World::new() };
        lamp(&mut world);
        let [found, free] = count(&world.scene(), 0, &mut random);
        assert!(found > 350 && free - found < 20, "{found} of {free}");
        clear = found;
    }

    let mut world = World::new();
    lamp(&mut world);
    world.square(Vec3::Y, 0.5, 0);
    let [with_plate, _] = count(&world.scene(), 0, &mut random);
    assert!(with_plate < clear - 10 && with_plate > clear / 2, "{with_plate}, {clear} without");
}

#[test]
fn free_forms_and_things_just_above_the_plane_hide_lights() {
    let mut random = Random(4);
    // A ball of 0.5 m beside the middle.
    let ball = Quadric::sphere(DVec3::new(1.0, 1.0, 0.0), 0.5).unwrap();
    let solid = FreeForm::new(ball, vec![]).unwrap().into();
    let mut world = World::new();
    world.square(Vec3::Y * 3.0, 0.5, 1);
    world.forms.push(FormObject { name: String::new(), solid, material: 0, projection: None, copies: Vec::new() });
    let scene = world.scene();
    let [clear, free] = count(&scene, 0, &mut random);
    assert!(clear > 300 && clear < free, "{clear} of {free}");

    // A sheet of 2 m, 0.1 mm above the floor.
    let mut world = World::new();
    world.square(Vec3::Y * 1e-4, 1.0, 0);
    world.square(Vec3::Y * 3.0, 0.5, 1);
    let scene = world.scene();
    let [clear, free] = count(&scene, 0, &mut random);
    assert!(clear > 300 && clear <= free, "{clear} of {free}");
}
