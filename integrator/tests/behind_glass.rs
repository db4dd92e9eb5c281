//! A lamp behind glass over gloss, in whole pictures.

mod common;

use common::{Builder, black, glass, lambert, lamp};
use glam::{UVec2, Vec3};
use integrator::{Settings, Study, render};
use scene::{Material, Scene, SpecularKind};

const SIDE: u32 = 24;
const SEEDS: u64 = 4;

/// A floor of lacquer with a lamp of 10 cm over it, below which a pane hangs.
fn lacquer_under_lamp() -> Scene {
    let gloss = SpecularKind::Ggx { alpha: 0.2, reflectance: Vec3::splat(0.05), schlick: true };
    Builder::default()
        .square(Vec3::ZERO, Vec3::Y, 2.0, Material { specular: gloss, ..lambert(0.3) })
        .square(0.996 * Vec3::Y, Vec3::NEG_Y, 1.0, glass(1.5))
        .square(Vec3::Y, Vec3::Y, 1.0, glass(1.5))
        .square(1.2 * Vec3::Y, Vec3::NEG_Y, 0.05, lamp(100.0))
        .square(1.21 * Vec3::Y, Vec3::Y, 0.05, black())
        .camera(Vec3::new(0.0, 0.6, 1.0), Vec3::new(0.0, 0.0, 0.2), Vec3::Y, 40.0)
        .build()
}

/// The specular term of each pixel, for each seed.
fn pictures(scene: &Scene, reuse: bool) -> Vec<Vec<f64>> {
    let picture = |seed| {
        let study = Study { lobe_reuse: Some(reuse), ..Study::default() };
        let settings = Settings { size: UVec2::splat(SIDE), quality: 0.3, seed, study, ..Settings::default() };
        let film = render(scene, &settings, &|_| ()).expect("valid settings").film;
        film.specular.iter().map(|light| f64::from(light.element_sum()) / 3.0).collect()
    };
    (0..SEEDS).map(picture).collect()
}

#[test]
fn the_highlight_of_a_lamp_behind_glass_is_smooth_and_as_bright_by_shared_lobes() {
    let scene = lacquer_under_lamp();
    let count = SEEDS as f64;
    let means = [false, true].map(|reuse| {
        let pictures = pictures(&scene, reuse);
        let median = |pixel: usize| {
            let mut lights: Vec<f64> = pictures.iter().map(|picture| picture[pixel]).collect();
            lights.sort_by(f64::total_cmp);
            0.5 * (lights[lights.len() / 2 - 1] + lights[lights.len() / 2])
        };
        let medians: Vec<f64> = (0..pictures[0].len()).map(median).collect();
        let brightest = medians.iter().fold(0.0, |most: f64, light| most.max(*light));
        // Where each dot holds the light of a hundred pixels, most have none.
        let lit = pictures.iter().flat_map(|picture| picture.iter().zip(&medians));
        let lit: Vec<_> = lit.filter(|(_, median)| **median > 0.2 * brightest).collect();
        let near = lit.iter().filter(|(light, median)| (*light - *median).abs() < 0.3 * *median).count();
        assert!(near * 20 > lit.len() * 19, "reuse {reuse}: {near} of {} near their medians", lit.len());
        let (all, all_medians): (f64, f64) = (pictures.iter().flatten().sum(), medians.iter().sum());
        assert!(count * all_medians > 0.9 * all, "reuse {reuse}: {all_medians} in medians of {all}");
        let sums: Vec<f64> = pictures.iter().map(|picture| picture.iter().sum()).collect();
        let all = sums.iter().sum::<f64>() / count;
        let variance = sums.iter().map(|sum| (sum - all).powi(2)).sum::<f64>() / (count - 1.0);
        assert!(variance.sqrt() < 0.06 * all, "reuse {reuse}: {all} +- {}", variance.sqrt());
        (all, variance / count)
    });
    let [(each, each_variance), (shared, shared_variance)] = means;
    let error = (each_variance + shared_variance).sqrt();
    assert!((each - shared).abs() < 4.5 * error + 1e-3 * each, "{each} by each, {shared} shared, +- {error}");
}
