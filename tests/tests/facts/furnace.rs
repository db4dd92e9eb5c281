//! White furnaces: where as much comes from everywhere, everything is known.

use glam::Vec3;
use scene::{Material, Scene};
use tests::graded::glowing_room;
use tests::{Builder, Effort, METHODS, Pictures, Term, gloss, icosphere, lambert, lamp, measure, mirror};

/// A wall that shines with radiance 1 and reflects.
fn wall(albedo: f32) -> Material {
    Material { diffuse: Vec3::splat(albedo), ..lamp(1.0) }
}

/// Every point and direction has L = Le / (1 - a), of it Le emitted, a Le direct and a^2 Le / (1 - a) indirect.
fn assert_room(scene: &Scene, albedo: f64, effort: &Effort, what: &str) {
    for method in METHODS {
        let what = format!("{what}, a = {albedo:.2}");
        let pictures = Pictures::new(scene, method, effort);
        pictures.relative(Term::All, |_| 1.0 / (1.0 - albedo)).assert_holds(&what);
        if albedo > 0.0 {
            let indirect = albedo * albedo / (1.0 - albedo);
            pictures.relative(Term::Direct, |_| albedo).assert_holds(&format!("{what}, direct"));
            pictures.relative(Term::Indirect, |_| indirect).assert_holds(&format!("{what}, indirect"));
        }
    }
}

#[test]
fn closed_room_of_emitters_has_radiance_le_over_one_minus_a() {
    for albedo in [0.0, 0.5, 0.9, 0.99] {
        let effort = Effort { path_spp: 64, spp: 64, seeds: 2, ..Effort::default() };
        assert_room(&glowing_room(albedo).scene, f64::from(albedo), &effort, "cube");
    }
}

#[test]
fn round_rooms_of_emitters_are_as_the_cube() {
    let (positions, mut triangles) = icosphere(Vec3::ZERO, 1.0, 2);
    triangles.iter_mut().for_each(|triangle| triangle.reverse());
    let mesh = Builder::default().mesh((positions, triangles), wall(0.5));
    let form = Builder::default().ball_room(wall(0.5));
    for (room, what) in [(mesh, "sphere of triangles"), (form, "free form")] {
        let scene = room.view(Vec3::new(0.1, 0.2, -0.3), Vec3::new(0.4, -0.3, 0.5), 60.0).build();
        let effort = Effort { path_spp: 128, spp: 64, seeds: 2, ..Effort::default() };
        assert_room(&scene, 0.5, &effort, what);
    }
}

#[test]
fn furnace_returns_the_albedo() {
    // Nothing but a convex body under a sky of 1: a white mirror and glass vanish, Lambert shows its albedo.
    for (material, expected, what) in [(lambert(0.7), 0.7, "Lambert"), (mirror(0.9), 0.9, "mirror")] {
        let mesh = Builder::default().mesh(icosphere(Vec3::ZERO, 1.0, 2), material.clone());
        let form = Builder::default().ball(Vec3::ZERO, 1.0, material);
        for (body, kind) in [(mesh, "mesh"), (form, "form")] {
            // The ball fills 39 degrees.
            let scene = body.sky(1.0).view(Vec3::new(0.3, -3.0, 0.2), Vec3::ZERO, 24.0).build();
            let effort = Effort { path_spp: 32, spp: 4, seeds: 1, ..Effort::default() };
            for method in METHODS {
                let measured = measure(&scene, method, &effort, |_| expected);
                measured.assert_holds(&format!("{what} {kind}"));
            }
        }
    }
}

#[test]
fn furnace_returns_the_energy_of_single_scattering() {
    // GGX with separable Smith masking and F = 1: the table of directional albedos at cosines 1 and 0.5.
    for (alpha, expected) in [(0.1, [0.9883, 0.9691]), (0.2, [0.9477, 0.8941]), (0.5, [0.6878, 0.6860])] {
        for (mu, expected) in [1.0f32, 0.5].into_iter().zip(expected) {
            let eye = Vec3::new((1.0 - mu * mu).sqrt(), 0.0, mu) * 10.0;
            let plate = Builder::default().square(Vec3::ZERO, Vec3::Z, 1.0, gloss(alpha, 1.0));
            let scene = plate.sky(1.0).view(eye, Vec3::ZERO, 1.0).build();
            let effort = Effort { path_spp: 64, spp: 64, seeds: 2, ..Effort::default() };
            for method in METHODS {
                let measured = measure(&scene, method, &effort, |_| expected);
                // The sky in gloss is direct light, sampled by every method. The table has four digits.
                measured.assert_unbiased(&format!("alpha = {alpha}, mu = {mu}"));
            }
        }
    }
}

#[test]
fn free_form_in_a_glowing_room_keeps_its_furnace() {
    // A small ball of radius 0.05 inside the room: its curvature must not spoil what it takes from records.
    let scene = Builder::default()
        .cube_room(&lamp(1.0))
        .ball(Vec3::new(0.2, 0.1, 0.0), 0.05, lambert(0.6))
        .view(Vec3::new(0.2, -0.3, 0.1), Vec3::new(0.2, 0.1, 0.0), 8.0)
        .build();
    let effort = Effort { path_spp: 64, spp: 64, ..Effort::default() };
    for method in METHODS {
        measure(&scene, method, &effort, |_| 0.6).assert_holds("ball in a room");
    }
}
