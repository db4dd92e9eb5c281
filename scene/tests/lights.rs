//! Lights against their closed forms: samples of each kind, their densities, and photons.

use std::f32::consts::PI;

use glam::{DAffine3, DVec3, Vec2, Vec3, Vec3A};
use scene::freeform::{FreeForm, Psi, Quadric, Solid};
use scene::{Description, Environment, FormObject, Lights, Material, Mesh, PunctualLight, Ray, Scene};

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

    fn direction(&mut self) -> Vec3A {
        self.direction_in_cone(2.0)
    }

    /// A direction that is uniform over a cone around z, `depth` being 1 less the cosine of its half-angle.
    fn direction_in_cone(&mut self, depth: f32) -> Vec3A {
        let z = 1.0 - depth * self.next();
        let (sin, cos) = (2.0 * PI * self.next()).sin_cos();
        let r = (1.0 - z * z).max(0.0).sqrt();
        Vec3A::new(r * cos, r * sin, z)
    }
}

fn emitter(radiance: f32) -> Material {
    Material { diffuse: Vec3::ZERO, emission: Vec3::splat(radiance), ..Material::default() }
}

/// A scene of a polygon, split into a fan, that shines with radiance 1 to the side of which its corners are counter-clockwise.
fn polygon_light(corners: &[Vec3]) -> Scene {
    let triangles: Vec<[u32; 3]> = (2u32..).take(corners.len() - 2).map(|i| [0, i - 1, i]).collect();
    let materials = vec![0; triangles.len()];
    let mesh = Mesh { positions: corners.to_vec(), triangles, materials, ..Mesh::default() };
    Scene::new(Description { meshes: vec![mesh], materials: vec![emitter(1.0)], ..Description::default() })
        .expect("a right scene")
}

/// Mean and relative deviation of the irradiance that samples of the lights give at `p`.
fn irradiance(lights: &Lights, p: Vec3A, n: Vec3A, count: u32) -> (f64, f64) {
    let mut random = Random(1);
    let (mut sum, mut sum_sq) = (0.0, 0.0);
    for _ in 0..count {
        let (u_choice, u) = (random.next(), random.pair());
        let Some(s) = lights.sample(p, n, u_choice, u) else { continue };
        let e = f64::from(s.radiance.x * n.dot(s.wi).max(0.0) / s.pdf);
        sum += e;
        sum_sq += e * e;
    }
    let mean = sum / f64::from(count);
    (mean, (sum_sq / f64::from(count) - mean * mean).max(0.0).sqrt() / mean)
}

/// Asserts the irradiance within five standard errors, and that these are small.
fn assert_irradiance(lights: &Lights, n: Vec3A, expected: f64, most_deviation: f64, what: &str) {
    const COUNT: u32 = 100_000;
    let (mean, deviation) = irradiance(lights, Vec3A::ZERO, n, COUNT);
    let error = deviation * mean / f64::from(COUNT).sqrt();
    assert!((mean - expected).abs() < 5.0 * error + 1e-5 * expected, "{what}: {mean} +- {error} is not {expected}");
    assert!(deviation < most_deviation, "{what}: the relative deviation is {deviation}");
}

#[test]
fn irradiance_of_polygon_is_lamberts_formula() {
    // Values of Lambert's formula, checked by area sampling.
    let square =
        [Vec3::new(-1.0, -1.0, 1.0), Vec3::new(-1.0, 1.0, 1.0), Vec3::new(1.0, 1.0, 1.0), Vec3::new(1.0, -1.0, 1.0)];
    let scene = polygon_light(&square);
    let (sin, cos) = 60f32.to_radians().sin_cos();
    assert_irradiance(scene.lights(), Vec3A::Z, 1.740_839_502_734, 1.0, "a square overhead");
    assert_irradiance(scene.lights(), Vec3A::new(sin, 0.0, cos), 0.909_067_569_058, 1.5, "a square aslant");
    assert_irradiance(scene.lights(), Vec3A::X, 0.350_188_287_714, 2.0, "a square half below the horizon");
    let triangle = polygon_light(&[Vec3::new(1.0, 0.0, 1.0), Vec3::new(-1.0, -1.0, 2.0), Vec3::new(0.0, 1.0, 1.0)]);
    assert_irradiance(triangle.lights(), Vec3A::Z, 0.687_617_388_735, 1.0, "a triangle");
    let behind: Vec<Vec3> = square.into_iter().rev().collect();
    let (mean, _) = irradiance(polygon_light(&behind).lights(), Vec3A::ZERO, Vec3A::Z, 1000);
    assert_eq!(mean, 0.0, "nothing from the back");
}

#[test]
fn light_touching_a_wall_keeps_its_deviation() {
    for (s, expected) in [(1.0, 0.223_346_63), (0.1, 1.327_463_84), (0.01, 1.546_162_95), (0.001, 1.568_332_68)] {
        let corners =
            [Vec3::new(0.0, -0.5, s), Vec3::new(0.0, 0.5, s), Vec3::new(1.0, 0.5, s), Vec3::new(1.0, -0.5, s)];
        let scene = polygon_light(&corners);
        assert_irradiance(scene.lights(), Vec3A::X, expected, 1.5, &format!("a light {s} above"));
    }
}

#[test]
fn far_small_and_thin_lights_are_exact() {
    let tiny = 1e-6;
    let height = tiny * 3f32.sqrt() / 2.0;
    let triangle = [Vec3::new(0.0, 0.0, 1.0), Vec3::new(0.5 * tiny, height, 1.0), Vec3::new(tiny, 0.0, 1.0)];
    assert_irradiance(
        polygon_light(&triangle).lights(),
        Vec3A::Z,
        3f64.sqrt() / 4.0 * 1e-12,
        1e-3,
        "an edge of a micrometre",
    );
    // A strip 1e-4 wide from below the horizon to near the zenith: L times the integral of z dw, by quadrature along it.
    let strip =
        [Vec3::new(-1.0, 0.0, 0.1), Vec3::new(-1.0, 1e-4, 0.1), Vec3::new(1.0, 1e-4, 0.1), Vec3::new(1.0, 0.0, 0.1)];
    let n = 100_000;
    let sum: f64 = (0..n)
        .map(|i| -1.0 + 2.0 * (f64::from(i) + 0.5) / f64::from(n))
        .map(|x| 0.01 / (x * x + 0.01f64).powi(2))
        .sum();
    assert_irradiance(polygon_light(&strip).lights(), Vec3A::Z, 1e-4 * sum * 2.0 / f64::from(n), 1.5, "a strip");
}

/// A scene of free forms that shine with radiance 1.
fn form_lights(solids: Vec<Solid>) -> Scene {
    let form = |solid| FormObject { name: String::new(), solid, material: 0, projection: None, copies: vec![] };
    let forms = solids.into_iter().map(form).collect();
    Scene::new(Description { forms, materials: vec![emitter(1.0)], ..Description::default() }).expect("a right scene")
}

fn ball(centre: DVec3, radius: f64) -> Solid {
    FreeForm::new(Quadric::sphere(centre, radius).expect("a sphere"), vec![]).expect("a form").into()
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
    // Within a hollow of constant radiance everything receives pi, in the middle and on the shining wall itself, which must not find itself at once.
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
fn densities_of_free_forms_are_those_of_their_samples() {
    // A light that is only a part of its region: the density over the directions that meet it is the share of samples that do.
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
            assert!(emission.ray.is_normal(), "{what}: {:?}", emission.ray);
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

/// Asserts that the density integrates to 1 over a cone that holds all lights, and that `sample` and rays that come by chance agree upon it.
fn assert_densities_agree(scene: &Scene, depth: f32) {
    let p = Vec3A::ZERO;
    let lights = scene.lights();
    let mut random = Random(5);
    let (mut integral, mut sum_sq) = (0.0, 0.0);
    let count = 400_000;
    for _ in 0..count {
        let wi = random.direction_in_cone(depth);
        let ray = Ray::new(p, wi);
        let pdf = f64::from(match scene.intersect(&ray) {
            Some(hit) => lights.pdf_surface(p, wi, &scene.surface(&ray, &hit)),
            None => lights.pdf_environment(wi),
        });
        let share = pdf * f64::from(2.0 * PI * depth) / f64::from(count);
        integral += share;
        sum_sq += share * share;
    }
    // Five standard errors.
    assert!((integral - 1.0).abs() < 5.0 * sum_sq.sqrt() + 1e-3, "the density's integral is {integral}");
    assert!(sum_sq.sqrt() < 2e-2, "so many rays say something");
    let mut met = 0;
    for _ in 0..2000 {
        let (u_choice, u) = (random.next(), random.pair());
        let Some(s) = [Vec3A::Z, -Vec3A::Z].iter().find_map(|&n| lights.sample(p, n, u_choice, u)) else { continue };
        let ray = Ray::new(p, s.wi);
        let (pdf, radiance) = match scene.intersect(&ray) {
            Some(hit) => {
                let surface = scene.surface(&ray, &hit);
                assert!((surface.t - s.distance).abs() < 1e-4 * s.distance, "the distance is that to the light");
                (lights.pdf_surface(p, s.wi, &surface), scene.emission(&surface))
            }
            None => (lights.pdf_environment(s.wi), scene.background(s.wi)),
        };
        // A ray to the very edge may miss.
        if pdf > 0.0 {
            met += 1;
            assert!((pdf - s.pdf).abs() < 1e-3 * s.pdf, "{pdf} is not {}", s.pdf);
            assert!(
                (radiance - s.radiance).abs().max_element() <= 1e-4 * s.radiance.max_element(),
                "radiance is that of the light"
            );
        }
    }
    assert!(met > 1900, "samples meet their light: {met}");
}

#[test]
fn densities_agree_for_triangles_near_and_far() {
    for (size, height, depth) in [(3.0, 3.5, 1.0), (0.3, 30.0, 2e-4)] {
        let corners = [
            Vec3::new(-1.0, -1.0, 1.0),
            Vec3::new(-1.0, 1.0, 1.0),
            Vec3::new(1.0, 1.0, 1.4),
            Vec3::new(1.0, -1.0, 1.4),
        ];
        let scene = polygon_light(&corners.map(|c| c * Vec3::new(size, size, height)));
        assert_densities_agree(&scene, depth);
    }
}

/// A dark picture with a few bright pixels, at its edge and poles too.
fn spotted(width: u32, height: u32) -> Environment {
    let mut pixels = vec![Vec3::ZERO; (width * height) as usize];
    for (i, value) in [
        (0, 3.0),
        (width as usize - 1, 1.0),
        (5 * width as usize + 7, 100.0),
        (pixels.len() - 2, 10.0),
        (9 * width as usize, 7.0),
    ] {
        pixels[i] = Vec3::new(value, 0.5 * value, 0.0);
    }
    Environment::from_pixels(width, height, pixels)
}

fn sky_scene(environment: Environment) -> Scene {
    Scene::new(Description { environment: Some(environment), ..Description::default() }).expect("a right scene")
}

#[test]
fn densities_agree_for_surroundings() {
    assert_densities_agree(&sky_scene(Environment::constant(Vec3::ONE)), 2.0);
    assert_densities_agree(&sky_scene(Environment::sky()), 2.0);
    assert_densities_agree(&sky_scene(spotted(16, 12)), 2.0);
}

#[test]
fn surroundings_are_sampled_wherever_they_shine() {
    let scene = sky_scene(spotted(16, 12));
    let mut random = Random(2);
    let mut lit = 0;
    for _ in 0..100_000 {
        let wi = random.direction();
        if scene.background(wi) != Vec3::ZERO {
            lit += 1;
            assert!(scene.lights().pdf_environment(wi) > 0.0, "{wi} shines and is never chosen");
        }
    }
    assert!(lit > 1000, "some directions shine: {lit}");
    // The irradiance by samples and by uniform directions.
    let (mean, deviation) = irradiance(scene.lights(), Vec3A::ZERO, Vec3A::Y, 200_000);
    let n = 2_000_000;
    let uniform =
        (0..n).map(|_| random.direction()).map(|w| f64::from(scene.background(w).x * w.y.max(0.0))).sum::<f64>()
            * f64::from(4.0 * PI)
            / f64::from(n);
    assert!((mean / uniform - 1.0).abs() < 2e-2 && deviation < 2.0, "{mean} (deviation {deviation}) is not {uniform}");
}

#[test]
fn surroundings_lie_as_documented() {
    // One bright pixel in each of the four directions, a quarter of the picture apart.
    let (width, height) = (8u32, 5u32);
    for (column, direction) in [(0, -Vec3A::Z), (2, Vec3A::X), (4, Vec3A::Z), (6, -Vec3A::X)] {
        let mut pixels = vec![Vec3::ZERO; (width * height) as usize];
        // The direction lies on the border between two texels: both shine.
        for i in [(column + width - 1) % width, column] {
            pixels[(2 * width + i) as usize] = Vec3::ONE;
        }
        let environment = Environment::from_pixels(width, height, pixels);
        assert!((environment.radiance(direction) - 1.0).abs().max_element() < 1e-5, "column {column}");
        assert!(environment.radiance(-direction).max_element() < 1e-5, "opposite of column {column}");
    }
    let mut pixels = vec![Vec3::ZERO; (width * height) as usize];
    pixels[..width as usize].fill(Vec3::ONE);
    let environment = Environment::from_pixels(width, height, pixels);
    assert_eq!(environment.radiance(Vec3A::Y), Vec3::ONE, "the first row is up");
    assert_eq!(environment.radiance(-Vec3A::Y), Vec3::ZERO, "the last row is down");
}

#[test]
fn lights_add_up_in_proportion_to_their_flux() {
    // Ten thousand point lights of I = i on a ring of radius 3 at height 4: E = N (N + 1) / 2 times 4 / 125, and hardly a sample deviates.
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
    // A shell around everything counts what arrives, by the formula of each light: here a lamp and a point light in a dark ball.
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
        assert!(emission.ray.is_normal(), "{:?}", emission.ray);
        // What leaves the lamp goes down, and never meets the lamp.
        if scene.intersect(&emission.ray).is_none() {
            down += f64::from(emission.flux.x);
        }
    }
    let mean = (flux / f64::from(n)).as_vec3();
    assert!(((mean - expected) / expected).abs().max_element() < 2e-2, "{mean} is not {expected}");
    assert!(down > 0.0, "photons leave");
}

/// What a ray of a photon must be.
trait IsNormal {
    fn is_normal(&self) -> bool;
}

impl IsNormal for Ray {
    fn is_normal(&self) -> bool {
        self.origin.is_finite() && (self.direction.length() - 1.0).abs() < 1e-5
    }
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
    assert!(scene.lights().is_empty() && scene.lights().pdf_environment(Vec3A::X) == 0.0, "nothing to choose");
    // A light of which p is the very place gives no irradiance without bound.
    let point = PunctualLight::Point { position: Vec3::ONE, intensity: Vec3::ONE };
    let scene = Scene::new(Description { lights: vec![point], ..Description::default() }).unwrap();
    assert!(scene.lights().sample(Vec3A::ONE, Vec3A::Z, 0.5, Vec2::ZERO).is_none(), "at the light itself");
}
