//! Direct light that is fitted over neighbouring pixels, in whole pictures.

mod common;

use common::{Builder, black, lambert, lamp};
use glam::{UVec2, Vec3};
use integrator::{Settings, Study, render};
use scene::Scene;

const SIDE: u32 = 48;
const SEEDS: u64 = 6;

/// Direct light of each pixel, the mean of R, G and B, for each seed.
fn pictures(scene: &Scene, fit: bool) -> Vec<Vec<f64>> {
    let picture = |seed| {
        let study = Study { direct_fit: Some(fit), ..Study::default() };
        let settings = Settings { size: UVec2::splat(SIDE), quality: 0.3, seed, study, ..Settings::default() };
        let film = render(scene, &settings, &|_| ()).expect("valid settings").film;
        film.direct.iter().map(|light| f64::from(light.element_sum()) / 3.0).collect()
    };
    (0..SEEDS).map(picture).collect()
}

/// Mean of each pixel, and the mean over the pixels of the variance of one picture.
fn mean_and_noise(pictures: &[Vec<f64>]) -> (Vec<f64>, f64) {
    let count = pictures.len() as f64;
    let mean = |pixel: usize| pictures.iter().map(|picture| picture[pixel]).sum::<f64>() / count;
    let means: Vec<f64> = (0..pictures[0].len()).map(mean).collect();
    let off = |picture: &Vec<f64>| picture.iter().zip(&means).map(|(light, mean)| (light - mean).powi(2)).sum::<f64>();
    let noise = pictures.iter().map(off).sum::<f64>() / (count - 1.0) / means.len() as f64;
    (means, noise)
}

/// A floor, seen from above, beside the edge of a cover 1.5 m above it, which is not seen.
fn covered_floor() -> Builder {
    Builder::default()
        .square(Vec3::ZERO, Vec3::Z, 4.0, lambert(0.6))
        .square(Vec3::new(-0.7, 0.0, 1.5), Vec3::Z, 0.7, black())
        .camera(Vec3::new(1.0, 0.0, 3.9), Vec3::new(0.5, 0.0, 0.0), Vec3::Y, 28.0)
}

#[test]
fn half_shadows_lose_noise_and_keep_their_light() {
    let scene = covered_floor().square(Vec3::new(0.0, 0.0, 4.0), Vec3::NEG_Z, 0.5, lamp(10.0)).build();
    let [(plain, noise), (fitted, left)] = [false, true].map(|fit| mean_and_noise(&pictures(&scene, fit)));
    assert!(left < 0.3 * noise, "noise {noise:e}, {left:e} fitted");
    // Squares of what the means are apart by, less what noise explains.
    let apart = plain.iter().zip(&fitted).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / plain.len() as f64;
    let bias = apart - (noise + left) / SEEDS as f64;
    assert!(bias < 0.1 * noise, "noise {noise:e}, bias {bias:e} by squares");
    let [all, all_fitted] = [plain, fitted].map(|means| means.iter().sum::<f64>());
    assert!((all_fitted / all - 1.0).abs() < 2e-4, "{all} and {all_fitted} altogether");
}

#[test]
fn sharp_shadows_stay_sharp() {
    // A point: all of the noise is that of the edge in the pixels that it crosses.
    let scene = covered_floor().point_light(Vec3::new(0.0, 0.0, 4.0), 40.0).build();
    let [(plain, noise), (fitted, left)] = [false, true].map(|fit| mean_and_noise(&pictures(&scene, fit)));
    assert!(left < 1.1 * noise, "noise {noise:e}, {left:e} fitted");
    let bright = plain.iter().fold(0.0, |most: f64, light| most.max(*light));
    for (pixel, (a, b)) in plain.iter().zip(&fitted).enumerate() {
        assert!((a - b).abs() < 0.01 * bright, "pixel {pixel}: {a}, {b} fitted, where the brightest has {bright}");
    }
}
