//! The five terms are a partition of the light.

use glam::{UVec2, Vec3};
use integrator::{Film, Method, Settings, render};
use scene::{Material, Scene};
use tests::{Builder, METHODS, Term, cuboid, glass, gloss, icosphere, lambert, lamp, mirror, print};

/// A floor under a sky with a lamp, a mirror, a ball of glass, a glossy box over a diffuse base and a ball of a free
/// form.
fn everything() -> Builder {
    let plastic = Material { diffuse: Vec3::new(0.6, 0.3, 0.2), ..gloss(0.3, 0.1) };
    Builder::default()
        .square(Vec3::ZERO, Vec3::Z, 3.0, lambert(0.6))
        .square(Vec3::new(0.0, 2.0, 1.0), Vec3::NEG_Y, 1.5, lambert(0.4))
        .square(Vec3::new(-1.6, 0.4, 0.8), Vec3::new(1.0, -0.3, 0.0), 0.8, mirror(0.9))
        .mesh(cuboid(Vec3::new(0.5, 0.3, 0.0), Vec3::new(1.3, 1.1, 0.9)), plastic)
        .mesh(icosphere(Vec3::new(-0.2, -0.5, 2.2), 0.3, 1), lamp(6.0))
        .ball(Vec3::new(-0.3, -0.3, 0.45), 0.45, glass(1.5, 0.0))
        .ball(Vec3::new(0.9, -0.5, 0.3), 0.3, lambert(0.7))
        .sky(0.3)
        .view(Vec3::new(0.3, -4.0, 2.2), Vec3::new(0.0, 0.3, 0.5), 45.0)
}

fn picture(scene: &Scene, method: Method, spp: u32, seed: u64) -> Film {
    let settings =
        Settings { method, size: UVec2::splat(48), spp: Some(spp), quality: 0.5, seed, ..Settings::default() };
    render(scene, &settings, &|_| ()).expect("valid settings").film
}

fn mean(radiance: &[Vec3]) -> f64 {
    radiance.iter().map(|l| f64::from(l.x + l.y + l.z) / 3.0).sum::<f64>() / radiance.len() as f64
}

#[test]
fn terms_sum_to_the_picture_bit_for_bit() {
    let scene = everything().build();
    for method in METHODS {
        let film = picture(&scene, method, 4, 1);
        for (pixel, radiance) in film.picture().iter().enumerate() {
            let sum = (((film.emitted[pixel] + film.direct[pixel]) + film.specular[pixel]) + film.caustic[pixel])
                + film.indirect[pixel];
            assert_eq!(sum.to_array().map(f32::to_bits), radiance.to_array().map(f32::to_bits), "{}", method.name());
        }
        let all = [&film.emitted, &film.direct, &film.specular, &film.caustic, &film.indirect];
        assert!(all.iter().all(|term| mean(term) > 1e-3), "{}: every term has light here", method.name());
    }
}

#[test]
fn terms_add_up_once() {
    assert_terms(&everything().build(), &[Term::Direct, Term::Specular, Term::Caustic, Term::Indirect, Term::All]);
}

#[test]
fn gloss_shows_lamps_in_mirrors_that_are_diffuse_too() {
    let coated = Material { diffuse: Vec3::splat(0.2), ..mirror(0.6) };
    let scene = Builder::default()
        .square(Vec3::ZERO, Vec3::Z, 3.0, Material { diffuse: Vec3::splat(0.3), ..gloss(0.1, 0.6) })
        .square(Vec3::new(0.0, 2.0, 1.5), Vec3::NEG_Y, 1.5, coated)
        .square(Vec3::new(0.0, -1.0, 2.5), Vec3::new(0.0, 0.5, -1.0), 0.4, lamp(6.0))
        .sky(0.1)
        .view(Vec3::new(0.3, -4.0, 2.0), Vec3::new(0.0, 0.6, 0.3), 40.0)
        .build();
    assert_terms(&scene, &[Term::Direct, Term::Specular, Term::All]);
}

/// Asserts that the other methods agree with the path tracer, term by term.
fn assert_terms(scene: &Scene, terms: &[Term]) {
    let path: Vec<Film> = (0..8).map(|seed| picture(scene, Method::Path, 160, seed)).collect();
    for method in [Method::Gather, Method::Reproject, Method::CacheOnly] {
        // One picture has so few records, or photons, that all of it may be a percent too bright.
        let films: Vec<Film> = (9..13).map(|seed| picture(scene, method, 16, seed)).collect();
        for &term in terms {
            let [(expected, path_error), (found, own_error)] = [&path, &films].map(|films| mean_of(films, term));
            let (ratio, error) = (found / expected, path_error.hypot(own_error));
            print(&format!("{term:?}, {}: {ratio:.5} of path's, +- {error:.5}", method.name()));
            assert!(path_error < 5e-3 && own_error < 0.03, "{term:?}: errors {path_error}, {own_error} say too little");
            assert!((ratio - 1.0).abs() < 0.01 + 3.5 * error, "{term:?}, {}: {ratio} of path's", method.name());
        }
    }
}

/// The mean of a term over pictures of other seeds, and its relative standard error.
fn mean_of(films: &[Film], term: Term) -> (f64, f64) {
    let means: Vec<f64> = films.iter().map(|film| mean(&term.of(film))).collect();
    let count = means.len() as f64;
    let whole = means.iter().sum::<f64>() / count;
    let spread = means.iter().map(|m| (m - whole).powi(2)).sum::<f64>() / (count - 1.0);
    (whole, (spread / count).sqrt() / whole)
}

#[test]
fn what_is_not_there_has_no_term() {
    let lit = |builder: Builder| builder.square(Vec3::Z * 2.0, Vec3::NEG_Z, 0.3, lamp(5.0));
    let view = |builder: Builder| builder.view(Vec3::new(0.3, -3.0, 1.0), Vec3::ZERO, 30.0);
    let floor = Builder::default().square(Vec3::ZERO, Vec3::Z, 3.0, lambert(0.6));
    let convex = view(lit(floor.clone())).build();
    let diffuse = view(lit(floor.cube_room(&lambert(0.3)))).build();
    let dark = view(Builder::default().square(Vec3::ZERO, Vec3::Z, 3.0, lambert(0.6))).build();
    for method in METHODS {
        let zero =
            |film: &Film, term: Term| assert!(term.of(film).iter().all(|&l| l == Vec3::ZERO), "{term:?}, {method:?}");
        let film = picture(&convex, method, 4, 2);
        [Term::Specular, Term::Caustic, Term::Indirect].into_iter().for_each(|term| zero(&film, term));
        let film = picture(&diffuse, method, 4, 2);
        [Term::Specular, Term::Caustic].into_iter().for_each(|term| zero(&film, term));
        zero(&picture(&dark, method, 4, 2), Term::All);
    }
}
