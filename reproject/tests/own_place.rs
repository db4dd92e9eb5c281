//! What a record gives back at its own place, or where moving changes nothing.

mod rooms;

use std::panic::AssertUnwindSafe;

use glam::{Vec3, Vec3A};
use hemimap::Frame;
use proptest::prelude::*;
use radcache::{MergeSettings, Record, RecordSettings, Samples};
use reproject::{Coverage, Settings, Workspace};
use rooms::{Rays, Scene, every_setting, gather, record, record_in, weight_before_normalising};

const FLOOR: Vec3A = Vec3A::new(0.6, 0.55, -0.999);
const SIZES: [usize; 6] = [1, 7, 16, 32, 33, 64];
const FRAME: Frame = Frame { s: Vec3A::X, t: Vec3A::Y, n: Vec3A::Z };

fn unmerged() -> RecordSettings {
    RecordSettings { merge: MergeSettings { max_side: 1, ..MergeSettings::default() }, ..RecordSettings::default() }
}

/// Quads and rectangles both give back the texture.
#[test]
fn identity_reproduces_the_texture() {
    for scene in [Scene::cornell(), Scene::spheres(), Scene::yard()] {
        for n in SIZES {
            let whole = record(|p, wi| scene.look(p, wi), FLOOR, Vec3A::Z, n, &unmerged());
            let merged = record(|p, wi| scene.look(p, wi), FLOOR, Vec3A::Z, n, &RecordSettings::default());
            let mut workspace = Workspace::new();
            for settings in every_setting() {
                let shares = workspace.project(&whole, FLOOR, Vec3A::Z, &settings);
                assert_eq!((shares.filled, shares.unknown), (1.0, 0.0), "n = {n}, {settings:?}");
                let rays = workspace.trace_holes(1, 1, &mut Rays(FLOOR, |p, wi| scene.look(p, wi)));
                assert_eq!(rays, 0, "nothing to trace");
                assert_eq!(workspace.texture(&whole), whole.samples().radiance, "n = {n}, {settings:?}");
                let shares = workspace.project(&merged, FLOOR, Vec3A::Z, &settings);
                assert_eq!((shares.filled, shares.unknown), (1.0, 0.0), "merged, n = {n}, {settings:?}");
                let change = workspace.mean_radiance() / merged.mean_radiance() - Vec3::ONE;
                assert!(change.abs().max_element() < 2e-6, "merged, n = {n}, {settings:?}: {change}");
            }
        }
    }
}

#[test]
fn turning_the_frame_only_resamples() {
    let scene = Scene::cornell();
    let look = |p, wi| scene.look(p, wi);
    let n = 32;
    let turned = |angle: f32| {
        let (sin, cos) = angle.sin_cos();
        Frame { s: Vec3A::new(cos, sin, 0.0), t: Vec3A::new(-sin, cos, 0.0), n: Vec3A::Z }
    };
    let straight = record_in(look, FLOOR, FRAME, n, &unmerged());
    let quarter = Frame { s: Vec3A::Y, t: -Vec3A::X, n: Vec3A::Z };
    let side = record_in(look, FLOOR, quarter, n, &unmerged());
    let to = FLOOR + Vec3A::new(0.02, -0.03, 0.0);
    let (mut a, mut b) = (Workspace::new(), Workspace::new());
    for p in [FLOOR, to] {
        a.project(&straight, p, Vec3A::Z, &Settings::default());
        b.project(&side, p, Vec3A::Z, &Settings::default());
        a.trace_holes(1, 1, &mut Rays(p, look));
        b.trace_holes(1, 1, &mut Rays(p, look));
        let mut differing = 0;
        for j in 0..n {
            for i in 0..n {
                // Along s' = t and t' = -s, texel (i, j) of the turned frame looks where (n-1-j, i) of the straight one
                // does.
                let (x, y) = (a.texture(&straight)[i * n + n - 1 - j], b.texture(&side)[j * n + i]);
                differing += usize::from(x != y);
            }
        }
        // Moved, centres on edges and order of elements that meet on one texel may decide differently.
        assert!(differing <= if p == FLOOR { 0 } else { n * n / 100 }, "{differing} texels differ at {p}");
    }
    let reference = gather(look, to, &FRAME, 256);
    for angle in [0.3, 0.7, 1.1] {
        let record = record_in(look, FLOOR, turned(angle), n, &RecordSettings::default());
        a.project(&record, to, Vec3A::Z, &Settings::default());
        a.trace_holes(1, 1, &mut Rays(to, look));
        let error = (a.mean_radiance() / reference - Vec3::ONE).abs().max_element();
        assert!(error < 2.0 / n as f32, "angle {angle}: {error}");
    }
}

#[test]
fn infinite_background_does_not_move() {
    let look = |_, wi: Vec3A| (wi.abs().into(), f32::INFINITY, -wi);
    for n in SIZES {
        let record = record(look, Vec3A::ZERO, Vec3A::Z, n, &unmerged());
        let mut workspace = Workspace::new();
        for settings in every_setting() {
            for p in [Vec3A::ZERO, Vec3A::new(3.0, -4.0, 0.0), Vec3A::new(1e3, 1e5, -2e4)] {
                let shares = workspace.project(&record, p, Vec3A::Z, &settings);
                assert_eq!((shares.filled, shares.unknown), (1.0, 0.0), "{p}");
                assert_eq!(workspace.texture(&record), record.samples().radiance, "{p}");
                let [near, far] = workspace.mean_radiance_by_distance();
                assert_eq!(near, Vec3::ZERO, "nothing is near");
                assert!((far / record.mean_radiance() - Vec3::ONE).abs().max_element() < 2e-6, "{far}");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    /// A closed room of constant radiance shows pi L from everywhere, whether holes are traced or not.
    #[test]
    fn furnace_survives_translation(
        x in -0.9f32..0.9, y in -0.9f32..0.9, z in -0.3f32..0.3, tilt in -0.4f32..0.4, n in 4usize..=64, traced: bool,
    ) {
        let mut room = Scene::clutter(20);
        for (_, radiance) in &mut room.shapes { *radiance = Vec3::new(1.0, 2.0, 3.0); }
        let look = |p, wi| room.look(p, wi);
        let centre = Vec3A::new(0.1, 0.2, -0.4);
        let record = record(look, centre, Vec3A::Z, n, &RecordSettings::default());
        let p = centre + Vec3A::new(x, y, z) * 0.5;
        let mut workspace = Workspace::new();
        for settings in every_setting() {
            let shares = workspace.project(&record, p, Vec3A::new(tilt, 0.0, 1.0).normalize(), &settings);
            if traced { workspace.trace_holes(2, 1, &mut Rays(p, look)); }
            if traced || shares.filled > 0.0 {
                let error = workspace.mean_radiance() / Vec3::new(1.0, 2.0, 3.0) - Vec3::ONE;
                prop_assert!(error.abs().max_element() < 1e-5, "{}", error);
            }
            // Rectangles are too large. Of 6000 cases the worst was off by 5.2 %; coarser masks are by more.
            if settings.coverage == Coverage::Quad && n >= 16 && shares.holes > 0.0 {
                let sum = weight_before_normalising(&mut workspace, shares);
                prop_assert!((sum - 1.0).abs() < 0.08, "before normalising {}, {:?}", sum, settings);
            }
        }
    }
}

/// The same bits from a fresh workspace and from one that just did something else, in any thread.
#[test]
fn answers_do_not_depend_on_what_was_before() {
    let scene = Scene::clutter(30);
    let look = |p, wi| scene.look(p, wi);
    let records: Vec<Record> =
        [32, 64, 7].map(|n| record(look, FLOOR, Vec3A::Z, n, &RecordSettings::default())).into_iter().collect();
    let answer = |workspace: &mut Workspace, k: usize| {
        let p = FLOOR + Vec3A::new(0.01 * k as f32, -0.02, 0.0);
        let n = Vec3A::new(0.05 * k as f32, 0.0, 1.0).normalize();
        let record = &records[k % 3];
        workspace.project(record, p, n, &Settings::default());
        let verdict = workspace.verify(record, 3, 5, &mut Rays(p, look));
        workspace.trace_holes(2, k as u64, &mut Rays(p, look));
        (verdict, workspace.mean_radiance().to_array().map(f32::to_bits), workspace.texture(record).to_vec())
    };
    let mut used = Workspace::new();
    let one_after_another: Vec<_> = (0..9).map(|k| answer(&mut used, k)).collect();
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..9).map(|k| scope.spawn(move || answer(&mut Workspace::new(), k))).collect();
        for (thread, expected) in threads.into_iter().zip(&one_after_another) {
            assert_eq!(&thread.join().unwrap(), expected);
        }
    });
}

/// Results are told by the elements of the record that was projected last; with those of another they would be wrong.
#[test]
fn results_of_another_record_are_refused() {
    let scene = Scene::clutter(30);
    let look = |p, wi| scene.look(p, wi);
    let usual = RecordSettings::default();
    let whole = record(look, FLOOR, Vec3A::Z, 16, &unmerged());
    let others = [
        record(look, FLOOR, Vec3A::Z, 16, &usual),
        record(look, FLOOR + Vec3A::X * 0.01, Vec3A::Z, 16, &unmerged()),
        record(look, FLOOR, Vec3A::Z, 33, &unmerged()),
    ];
    let weights = vec![Vec3::ONE; 16 * 16];
    let bright = |_, wi: Vec3A| (Vec3::ONE, 1.0, -wi);
    type Call<'a> = &'a dyn Fn(&mut Workspace, &Record);
    let calls: [Call<'_>; 5] = [
        &|workspace, record| workspace.samples(record, &mut Samples::new(16)),
        &|workspace, record| _ = workspace.texture(record),
        &|workspace, record| _ = workspace.verify(record, 4, 1, &mut Rays(FLOOR, bright)),
        &|workspace, record| _ = workspace.weighted_sum(record, &weights),
        &|workspace, record| _ = workspace.weighted_sum_by_distance(record, &weights),
    ];
    for (number, call) in calls.into_iter().enumerate() {
        let mut workspace = Workspace::new();
        workspace.project(&whole, FLOOR, Vec3A::Z, &Settings::default());
        call(&mut workspace, &whole.clone());
        for (other, record) in others.iter().enumerate() {
            let refused = std::panic::catch_unwind(AssertUnwindSafe(|| call(&mut workspace, record))).unwrap_err();
            let message = refused.downcast_ref::<&str>();
            let expected = "the record must be the one that was projected last";
            assert_eq!(message, Some(&expected), "call {number}, record {other}");
        }
    }
}
