//! What is told of single pixels is what happened: it adds up to the picture and to its statistics.

mod common;

use common::{Builder, lambert, lamp};
use glam::{UVec2, Vec3};
use integrator::{
    Explanation, Method, RecordKind, Rungs, SecondaryKind, Settings, SettingsError, Step, Study, estimate_pixel,
    explain, render,
};
use scene::{Ray, Scene};

/// A closed room with a lamp under its ceiling, and a camera in it.
fn room() -> Scene {
    let room = Builder::default().cube_room(&lambert(0.6));
    room.square(Vec3::new(0.0, 0.95, 0.0), Vec3::NEG_Y, 0.3, lamp(5.0))
        .camera(Vec3::new(0.0, 0.1, 0.9), Vec3::new(0.1, -0.1, 0.0), Vec3::Y, 70.0)
        .build()
}

fn settings(method: Method) -> Settings {
    // Few photons in the place of cells, as a picture is made for each of its pixels; and records that reach over
    // several of these.
    let secondary = Some(SecondaryKind::Photons);
    let study = Study { secondary, photons: Some(500), spacing: Some(0.8), ..Study::default() };
    Settings { method, quality: 0.05, size: UVec2::new(14, 9), study, ..Settings::default() }
}

fn all(scene: &Scene, settings: &Settings) -> Vec<Explanation> {
    let pixels = (0..settings.size.y).flat_map(|y| (0..settings.size.x).map(move |x| UVec2::new(x, y)));
    pixels.map(|pixel| explain(scene, settings, pixel, &|_| ()).expect("a pixel of the picture")).collect()
}

#[test]
fn stories_of_all_pixels_add_up_to_picture_and_statistics() {
    let scene = room();
    for method in [Method::Reproject, Method::Gather] {
        let settings = settings(method);
        let whole = render(&scene, &settings, &|_| ()).unwrap();
        let told = all(&scene, &settings);
        let (mut interpolated, mut reprojected, mut gathered, mut records) = (0, 0, 0, 0);
        for (pixel, explanation) in told.iter().enumerate() {
            assert_eq!(explanation.terms.indirect, whole.film.indirect[pixel], "the looker-on changes nothing");
            assert_eq!(explanation.terms.sum(), whole.film.picture()[pixel], "all terms");
            let sum: Vec3 = explanation.points.iter().map(|point| point.diffuse_weight * point.near).sum();
            let indirect = explanation.terms.indirect;
            assert!((sum - indirect).length() <= 1e-4 * indirect.length(), "points of {pixel}: {sum} of {indirect}");
            for point in &explanation.points {
                // A point that looked from several places in the end counts by how it looked before, if it did.
                let is_spread = |step: &&Step| matches!(step, Step::Spread { .. });
                let mut steps = point.steps.iter().rev();
                match steps.clone().find(|step| !is_spread(step)).or(steps.next()) {
                    Some(Step::Spread { .. }) => gathered += 1,
                    Some(Step::Interpolated { records }) => {
                        interpolated += 1;
                        let mean: Vec3 = records.iter().map(|record| record.share * record.radiance).sum();
                        assert!(mean.abs_diff_eq(point.near + point.sky, 1e-5), "{records:?} of {point:?}");
                        assert!(records.iter().all(|record| record.distance <= record.reach), "{records:?}");
                    }
                    Some(Step::Reprojected { record, shares, .. }) => {
                        reprojected += 1;
                        assert!(record.distance <= record.radius && record.elements > 0, "within reach: {record:?}");
                        assert!((shares.filled + shares.holes - 1.0).abs() < 1e-3, "the whole hemisphere: {shares:?}");
                    }
                    Some(Step::Gathered { record, .. }) => {
                        gathered += 1;
                        records += u64::from(record.is_some());
                    }
                    other => panic!("pixel {pixel} ends with {other:?}"),
                }
            }
        }
        let counted = &whole.statistics;
        assert_eq!(
            (interpolated, reprojected, gathered, records),
            (counted.interpolated, counted.reprojected, counted.gathered, counted.records),
            "{method:?}"
        );
        let points: usize = told.iter().map(|explanation| explanation.points.len()).sum();
        assert_eq!(points as u64, counted.surface_points, "every point is told of once");
        assert!(
            method == Method::Gather || (interpolated > 0 && reprojected > 0 && records > 0),
            "all kinds: {counted:?}"
        );
    }
}

#[test]
fn rungs_of_all_pixels_add_up_to_the_statistics() {
    let scene = room();
    for method in [Method::Reproject, Method::Gather, Method::CacheOnly] {
        // With one sample, each pixel is one point of one surface.
        let Settings { study, .. } = settings(method);
        let study = Study { even_samples: Some(true), ..study };
        let plain = Settings { spp: Some(1), size: UVec2::new(48, 32), study, ..settings(method) };
        let told = render(&scene, &Settings { rungs: true, ..plain.clone() }, &|_| ()).unwrap();
        let without = render(&scene, &plain, &|_| ()).unwrap();
        assert_eq!((without.film.picture(), without.film.rungs), (told.film.picture(), None), "the same picture");
        let (counted, rungs) = (&told.statistics, told.film.rungs.expect("they were asked for"));
        let sum = |number: fn(&Rungs) -> f32| rungs.iter().map(|rungs| f64::from(number(rungs))).sum::<f64>();
        let ways = [sum(|r| r.interpolated), sum(|r| r.reprojected), sum(|r| r.gathered)];
        let expected = [counted.interpolated, counted.reprojected, counted.gathered];
        assert_eq!(ways, expected.map(|count| count as f64), "{method:?}: points by their ways");
        assert_eq!(ways.iter().sum::<f64>(), counted.surface_points as f64, "{method:?}: every point has one");
        assert_eq!(ways[1] > 0.0, method == Method::Reproject, "{method:?}: {expected:?}");
        for (share, mean) in [(sum(|r| r.filled), counted.share_filled), (sum(|r| r.unknown), counted.share_unknown)] {
            assert!((share - ways[1] * mean).abs() <= 0.002 * ways[1], "{method:?}: shares of hemispheres");
        }
        // Nothing lies below these surfaces that are flat.
        let parts = sum(|r| r.unchanged) + sum(|r| r.moved) + sum(|r| r.bared);
        assert!((parts - sum(|r| r.filled)).abs() <= 0.006 * ways[1], "{method:?}: parts of what records fill");
    }
}

#[test]
fn pixels_are_seldom_farther_off_than_estimated_and_paths_find_their_light() {
    let scene = room();
    let grey = |light: Vec3| light.element_sum() / 3.0;
    let size = settings(Method::Path).size;
    let converged = Settings { method: Method::Path, size, spp: Some(1 << 14), seed: 1, ..Settings::default() };
    let truth = render(&scene, &converged, &|_| ()).unwrap().film.picture();
    for method in [Method::Reproject, Method::Path] {
        let settings = Settings { quality: 0.2, ..settings(method) };
        let picture = render(&scene, &settings, &|_| ()).unwrap().film.picture();
        let pixels: Vec<u32> = (0..size.element_product()).step_by(4).collect();
        let (mut beyond, mut errors) = (0, 0.0);
        for &number in &pixels {
            let pixel = UVec2::new(number % size.x, number / size.x);
            let (truth, light) = (truth[number as usize], picture[number as usize]);
            let estimate = estimate_pixel(&scene, &settings, pixel, &|_| ()).unwrap();
            let off = |light: Vec3| (grey(light) - grey(truth)).abs() / estimate.scale;
            // The truth has half of the noise of these paths.
            assert!(off(estimate.reference) < 5.0 * estimate.reference_noise + 1e-5, "{pixel}: {estimate:?}");
            beyond += u32::from(off(light) > estimate.error);
            errors += estimate.error / pixels.len() as f32;
            assert_eq!(estimate.bias == 0.0, method == Method::Path, "paths have no bias: {estimate:?}");
        }
        assert!(errors < 0.15, "{method:?}: estimates tell something, {errors} in the mean");
        assert!(beyond <= 2, "{method:?}: {beyond} of {} beyond their estimate", pixels.len());
    }
}

#[test]
fn the_path_tracer_has_terms_and_no_points_and_other_pixels_are_refused() {
    let (scene, settings) = (room(), settings(Method::Path));
    let told = explain(&scene, &settings, UVec2::new(3, 4), &|_| ()).unwrap();
    assert_eq!(told.points, [], "none");
    assert!(told.terms.sum().min_element() > 0.0, "but light: {told:?}");
    let pixel = UVec2::new(14, 0);
    let refused = explain(&scene, &settings, pixel, &|_| ()).unwrap_err();
    assert_eq!(refused, SettingsError::Pixel { pixel, size: settings.size }, "a column too far");
    assert!(refused.to_string().contains("14 x 9"), "{refused}");
    assert_eq!(estimate_pixel(&scene, &settings, pixel, &|_| ()).unwrap_err(), refused, "nor is it estimated");
}

#[test]
fn a_picture_without_noise_is_estimated_too() {
    // The camera looks past the floor at a sky of one radiance, or of none.
    for radiance in [1.0, 0.0] {
        let scene = Builder::default()
            .square(Vec3::ZERO, Vec3::Y, 1.0, lambert(0.5))
            .sky(radiance)
            .camera(Vec3::Y * 2.0, Vec3::Y * 9.0, Vec3::Z, 40.0)
            .build();
        let estimate = estimate_pixel(&scene, &settings(Method::Reproject), UVec2::ONE, &|_| ()).unwrap();
        let errors = [estimate.error, estimate.noise, estimate.bias, estimate.bias_noise, estimate.reference_noise];
        assert!(errors.iter().all(|&error| (0.0..1e-5).contains(&error)), "radiance {radiance}: {estimate:?}");
        assert_eq!(estimate.reference, Vec3::splat(radiance));
    }
}

#[test]
fn records_lie_on_surfaces_and_are_told_where_they_are_asked_for() {
    let scene = room();
    for method in [Method::Reproject, Method::Gather, Method::CacheOnly, Method::Path] {
        let plain = Settings { spp: Some(4), size: UVec2::new(48, 32), ..settings(method) };
        let told = render(&scene, &Settings { records: true, ..plain.clone() }, &|_| ()).unwrap();
        let without = render(&scene, &plain, &|_| ()).unwrap();
        assert_eq!((without.film, without.records), (told.film, vec![]), "{method:?}: the same picture");
        let count = |kind| told.records.iter().filter(|record| record.kind == kind).count() as u64;
        let counted = [count(RecordKind::Radiance), count(RecordKind::Irradiance)];
        assert_eq!(counted, [told.statistics.records, told.statistics.irradiance_records], "{method:?}");
        for record in &told.records {
            let (above, down) = (record.p + 1e-3 * record.n, -record.n);
            let hit = scene.intersect(&Ray::new(above.into(), down.into())).expect("there is a surface beneath");
            assert!((hit.t - 1e-3).abs() < 1e-4, "{method:?}: {record:?}");
            assert!(record.reach >= 0.0 && record.radiance.min_element() >= 0.0, "{method:?}: {record:?}");
        }
    }
}
