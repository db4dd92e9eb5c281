//! What pictures cost: large ones are rendered in bands, which nobody is to notice, and flat views take no more rays
//! than gathers would.

use glam::{UVec2, Vec3};
use integrator::{Method, Settings, render};
use tests::graded::wedge;
use tests::{Builder, black, gloss, lamp};

/// A floor of metal with a lamp and a half shadow on it, all in the lower half of the picture; above it is nothing.
#[test]
fn a_pixel_takes_as_many_rays_whatever_the_size_of_the_picture() {
    let scene = Builder::default()
        .square(Vec3::ZERO, Vec3::Z, 6.0, gloss(0.2, 0.8))
        .square(Vec3::Z * 1.1, Vec3::NEG_Z, 0.5, lamp(4.0))
        .square(Vec3::Z * 0.4, Vec3::NEG_Z, 0.4, black())
        .view(Vec3::new(0.0, -4.0, 1.2), Vec3::new(0.0, 0.0, 1.2), 50.0)
        .build();
    // One band, and four.
    let [one, four] = [UVec2::splat(360), UVec2::splat(720)].map(|size| {
        let settings = Settings { method: Method::Reproject, quality: 0.3, size, ..Settings::default() };
        let statistics = render(&scene, &settings, &|_| ()).expect("the settings are valid").statistics;
        let per_pixel = |rays: u64| rays as f64 / f64::from(size.element_product());
        [per_pixel(statistics.rays.camera), per_pixel(statistics.rays.shadow), per_pixel(statistics.rays.path)]
    });
    for (one, four) in one.into_iter().zip(four) {
        assert!(four < 1.15 * one, "{four} rays a pixel in four bands, {one} in one");
    }
}

/// Where the eye looks along a floor, no record reaches the next row of pixels: then each point is looked at, as by a
/// gather, and nothing is cached in vain.
#[test]
fn flat_views_take_hardly_more_rays_than_gathers() {
    for elevation in [60.0, 3.0, 0.3, 0.03] {
        let scene = wedge(90.0, 0.5, 1e4, 1.0, elevation).scene;
        let rays = |method| {
            let settings = Settings { method, size: UVec2::splat(32), ..Settings::default() };
            let rays = render(&scene, &settings, &|_| ()).expect("the settings are valid").statistics.rays;
            rays.gather + rays.hole
        };
        let gathered = rays(Method::Gather);
        for method in [Method::Reproject, Method::CacheOnly] {
            let share = rays(method) as f64 / gathered as f64;
            tests::print(&format!("{elevation} degrees, {}: {share:.2} of the rays of a gather", method.name()));
            assert!(share < 1.5, "{elevation} degrees, {}: {share} times the rays of a gather", method.name());
        }
    }
}
