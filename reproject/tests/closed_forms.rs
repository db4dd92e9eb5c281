//! Reprojections whose answer has a closed form.

mod rooms;

use glam::{Mat3A, Vec2, Vec3, Vec3A};
use hemimap::Frame;
use radcache::{MergeSettings, Record, RecordSettings, Samples, Validity};
use reproject::{AreaWeights, Settings, Trails, Workspace, project_corners};
use rooms::{Rays, Scene, Seen, Shape, gather, record_in};
use std::f32::consts::PI;

const FRAME: Frame = Frame { s: Vec3A::X, t: Vec3A::Y, n: Vec3A::Z };

/// g(t) = t / sqrt(1 + t^2).
fn g(t: f32) -> f32 {
    if t.is_infinite() { t.signum() } else { t / (1.0 + t * t).sqrt() }
}

fn at_origin(look: impl Fn(Vec3A, Vec3A) -> Seen, n: usize, settings: &RecordSettings) -> Record {
    record_in(look, Vec3A::ZERO, FRAME, n, settings)
}

/// An infinite ceiling at height 1, bright where x > 0.
fn half_lit(p: Vec3A, wi: Vec3A) -> Seen {
    let t = (1.0 - p.z) / wi.z;
    (Vec3::splat(if p.x + wi.x * t > 0.0 { 1.0 } else { 0.0 }), t, Vec3A::NEG_Z)
}

#[test]
fn half_lit_ceiling_follows_its_formula() {
    for n in [16, 32, 64] {
        let record = at_origin(half_lit, n, &RecordSettings::default());
        let mut workspace = Workspace::new();
        for s in [0.0, 0.1, 0.3, 1.0] {
            let p = Vec3A::X * s;
            workspace.project(&record, p, Vec3A::Z, &Settings::default());
            workspace.trace_holes(1, 1, &mut Rays(p, half_lit));
            let expected = (1.0 + g(s)) / 2.0;
            let found = workspace.mean_radiance().x;
            assert!((found - expected).abs() < 2.0 / n as f32, "n = {n}, s = {s}: {found} for {expected}");
            // The record's irradiance as it is stays at one half.
            let plain = (record.mean_radiance().x - expected).abs();
            assert!((plain - g(s) / 2.0).abs() < 1e-3, "n = {n}, s = {s}: {plain}");
            if s >= 0.1 && n >= 32 {
                assert!((found - expected).abs() < 0.5 * plain, "n = {n}, s = {s}: better than the record itself");
            }
        }
    }
}

#[test]
fn ceiling_moves_by_its_parallax() {
    let n = 32;
    let record = at_origin(half_lit, n, &RecordSettings { layers: 16, merge: MergeSettings::default() });
    let elements = record.elements();
    let s = 0.2;
    let buffer = || [(); 4].map(|()| vec![0f32; elements.padded_len()]);
    let (mut u, mut v, mut z) = (buffer(), buffer(), buffer());
    project_corners(elements, &Mat3A::IDENTITY, Vec3A::X * s, &mut u, &mut v, &mut z);
    let mut checked = 0;
    for e in 0..elements.len() {
        let [i, j] = elements.start[e].map(f32::from);
        let [w, h] = elements.size[e].map(f32::from);
        for (k, (i, j)) in [(i, j), (i + w, j), (i + w, j + h), (i, j + h)].into_iter().enumerate() {
            let wi = hemimap::square_to_cosine_hemisphere(Vec2::new(i, j) / n as f32);
            // Next to the horizon, corners are held back.
            if wi.z > 0.3 {
                let moved = Vec3A::new(wi.x / wi.z - s, wi.y / wi.z, 1.0).normalize();
                let expected = hemimap::cosine_hemisphere_to_square(moved);
                let found = Vec2::new(u[k][e], v[k][e]);
                assert!((found - expected).abs().max_element() < 1e-6, "{found} for {expected}");
                assert!((z[k][e] - 1.0).abs() < 1e-5, "as high as the ceiling: {}", z[k][e]);
                checked += 1;
            }
        }
    }
    assert!(checked > 200, "{checked} corners away from the horizon");
    let mut workspace = Workspace::new();
    let shares = workspace.project(&record, Vec3A::X * s, Vec3A::Z, &Settings::default());
    assert_eq!(shares.unknown, 0.0, "a plane has no silhouette");
    // Slivers open where the straight edge of a large block meets those of small ones on a curve: they cost rays, not
    // error.
    assert!(shares.holes < 0.06, "{shares:?}");
    let single = RecordSettings { merge: MergeSettings { max_side: 1, ..MergeSettings::default() }, layers: 16 };
    let shares = workspace.project(&at_origin(half_lit, n, &single), Vec3A::X * s, Vec3A::Z, &Settings::default());
    assert_eq!((shares.filled, shares.unknown), (1.0, 0.0), "texels alone leave no gap");
}

/// Bits that no neighbour of an unset bit has.
fn eroded(rows: &[u64], n: usize) -> Vec<u64> {
    let inner = |row: u64| row & row << 1 & row >> 1;
    (0..n)
        .map(|j| if j == 0 || j + 1 == n { 0 } else { inner(rows[j - 1]) & inner(rows[j]) & inner(rows[j + 1]) })
        .collect()
}

#[test]
#[expect(clippy::print_stdout, reason = "the ratios are figures to report, with --nocapture")]
fn unknown_zone_of_two_planes() {
    for (e, h1, h2, s, expected) in
        [(0.0, 1.0, 2.0, 0.1, 0.024783), (0.5, 1.0, 4.0, 0.2, 0.061508), (0.0, 1.0, f32::INFINITY, 0.1, 0.049752)]
    {
        // A near half-plane x < e at h1 before a far plane at h2, or the sky.
        let look = |p: Vec3A, wi: Vec3A| {
            let (near, far) = (h1 / wi.z, h2 / wi.z);
            if p.x + wi.x * near < e { (Vec3::X, near, Vec3A::NEG_Z) } else { (Vec3::Y, far, Vec3A::NEG_Z) }
        };
        // The far plane, seen from s, has come into view up to what the edge at e left open for the record.
        let open_far = |wi: Vec3A| {
            let edge = if h2.is_finite() { (e * h2 / h1 - s) / h2 } else { e / h1 };
            wi.x / wi.z < edge && wi.x / wi.z >= (e - s) / h1
        };
        let edge = if h2.is_finite() { (e * h2 / h1 - s) / h2 } else { e / h1 };
        assert!(((g(edge) - g((e - s) / h1)) / 2.0 - expected).abs() < 1e-5, "the formula gives {expected}");
        for (trails, margins, limit) in [
            (Trails::Uncovered, false, 1.0),
            (Trails::Uncovered, true, 2.0),
            (Trails::Silhouettes, false, 2.0),
            (Trails::Silhouettes, true, 4.0),
            (Trails::All, false, 6.0),
        ] {
            for n in [32, 64] {
                let record = at_origin(look, n, &RecordSettings::default());
                let mut workspace = Workspace::new();
                let settings = Settings { trails, margins, ..Settings::default() };
                let shares = workspace.project(&record, Vec3A::X * s, Vec3A::Z, &settings);
                let newly: Vec<u64> = (0..n)
                    .map(|j| {
                        (0..n).fold(0, |row, i| {
                            let place = Vec2::new(i as f32 + 0.5, j as f32 + 0.5) / n as f32;
                            row | u64::from(open_far(hemimap::square_to_cosine_hemisphere(place))) << i
                        })
                    })
                    .collect();
                let count = newly.iter().map(|row| row.count_ones()).sum::<u32>() as f32 / (n * n) as f32;
                assert!((count - expected).abs() < 1.5 / n as f32, "as many bits as the formula says: {count}");
                // Trails alone know it: elements leave it open here, but would fill it if there were anything more to
                // see.
                let missed: u32 = eroded(&newly, n)
                    .into_iter()
                    .zip(&workspace.masks().unknown)
                    .map(|(row, unknown)| (row & !unknown).count_ones())
                    .sum();
                // Straight edges bend where they cross a diagonal of the square: there a bit may be lost.
                assert!(
                    missed as usize <= n / 32,
                    "{trails:?}, n = {n}: {missed} bits that it cannot know are not unknown"
                );
                let [unknown, holes] = [shares.unknown, shares.holes].map(|share| share / expected);
                println!(
                    "{trails:?}, margins {margins}, h2 = {h2}, n = {n}: unknown {unknown:.2}, holes {holes:.2} times the new; {missed} missed"
                );
                // The zone is a texel wide, and texels at its rim go to it whole. The whole way of a silhouette is, as
                // the background follows it, h2 / (h2 - h1) times the new, which is 2, 1.33 and 1 here; a margin is as
                // wide again at most.
                assert!(
                    shares.unknown <= limit * expected + 1.0 / n as f32,
                    "{trails:?}, h2 = {h2}, n = {n}: {unknown}"
                );
            }
        }
    }
}

/// One ray a texel does not tell where in it a silhouette lies. Margins see to it that a surface which retreats is not
/// too large for that.
#[test]
#[expect(clippy::print_stdout, reason = "the errors are figures to report, with --nocapture")]
fn retreating_edges_leave_no_bias() {
    let (n, h1, h2, count) = (32, 1.0, 3.0, 400);
    for reach in [0.1, 0.3, 0.8] {
        let mut errors = [[0.0; 2]; 2];
        for k in 0..count {
            let s = reach * rooms::uniform(k + 5000);
            // A bright near half-plane x < e before a dark far plane.
            let e = 0.4 * rooms::uniform(k) - 0.1;
            let look = |p: Vec3A, wi: Vec3A| {
                let (near, far) = (h1 / wi.z, h2 / wi.z);
                if p.x + wi.x * near < e { (Vec3::ONE, near, Vec3A::NEG_Z) } else { (Vec3::ZERO, far, Vec3A::NEG_Z) }
            };
            let mut samples = Samples::new(n);
            for texel in 0..n * n {
                let number = 10_000 * (k + 1) + 2 * texel as u64;
                samples.set_jitter(texel, Vec2::new(rooms::uniform(number), rooms::uniform(number + 1)));
            }
            for (texel, wi) in samples.directions().into_iter().enumerate() {
                let (radiance, distance, normal) = look(Vec3A::ZERO, wi);
                samples.set(texel, radiance, distance, normal);
            }
            let record = Record::new(Vec3A::ZERO, FRAME, samples, &RecordSettings::default(), &Validity::default());
            let expected = f64::midpoint(1.0, g((e - s) / h1).into());
            let mut workspace = Workspace::new();
            for (margins, errors) in [true, false].into_iter().zip(&mut errors) {
                for (weights, error) in [AreaWeights::Analytic, AreaWeights::Bits].into_iter().zip(errors) {
                    let settings = Settings { margins, weights, ..Settings::default() };
                    workspace.project(&record, Vec3A::X * s, Vec3A::Z, &settings);
                    workspace.trace_holes(1, k, &mut Rays(Vec3A::X * s, look));
                    *error += (f64::from(workspace.mean_radiance().x) - expected) / count as f64;
                }
            }
        }
        // In texels along the edge, which is about n of them long.
        let [with, without] = errors.map(|errors: [f64; 2]| errors.map(|error| error * n as f64));
        println!("moved by up to {reach}: {with:.3?} of a texel with margins, {without:.3?} without");
        assert!(with[0].abs() < 0.1 && with[1].abs() < 0.15, "moved by up to {reach}: {with:?} of a texel too much");
        assert!(without[1].abs() > with[1].abs() + 0.1, "without margins they are more: {without:?}");
    }
}

#[test]
fn turning_normal_loses_a_lune() {
    let look = |_, wi: Vec3A| (Vec3::ONE, 2.0, -wi);
    for n in [16, 32, 33, 64] {
        let record = at_origin(look, n, &RecordSettings::default());
        let mut workspace = Workspace::new();
        for degrees in [10.0f32, 45.0, 90.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            for azimuth in [0.0f32, 0.4, 1.9] {
                let normal = Vec3A::new(sin * azimuth.cos(), sin * azimuth.sin(), cos);
                let shares = workspace.project(&record, Vec3A::ZERO, normal, &Settings::default());
                let expected = (1.0 - cos) / 2.0;
                let tolerance = 4.0 / n as f32;
                assert!((shares.holes - expected).abs() < tolerance, "n = {n}, {degrees}: {shares:?} for {expected}");
                // Clipped at the horizon, elements end where the record's did: nothing folds back into the disk.
                let frame = workspace.frame();
                for texel in 0..n * n {
                    let place = Vec2::new((texel % n) as f32 + 0.5, (texel / n) as f32 + 0.5) / n as f32;
                    let wi = frame.to_world(hemimap::square_to_cosine_hemisphere(place));
                    if wi.z < -4.0 / n as f32 {
                        assert_eq!(workspace.owner(texel), None, "n = {n}, {degrees}: {wi} was below the horizon");
                    }
                }
            }
        }
    }
}

/// Share of the cosine-weighted hemisphere over `p` that the polygon covers, by Lambert's formula.
fn lambert(corners: &[Vec3A], p: Vec3A) -> f64 {
    let directions: Vec<glam::DVec3> = corners.iter().map(|c| c.as_dvec3() - p.as_dvec3()).collect();
    let sum: f64 = (0..directions.len())
        .map(|k| {
            let (a, b) = (directions[k].normalize(), directions[(k + 1) % directions.len()].normalize());
            let cross = a.cross(b);
            if cross.length() > 0.0 { cross.z / cross.length() * a.angle_between(b) } else { 0.0 }
        })
        .sum();
    sum.abs() / (2.0 * std::f64::consts::PI)
}

#[test]
fn near_things_are_magnified() {
    let n = 32;
    for h in [0.1f32, 0.03, 0.01] {
        let radius = 0.5 * h;
        let sky = Scene { shapes: vec![(Shape::Disc(Vec3A::Z * h, Vec3A::Z, radius), Vec3::ZERO)], sky: Vec3::ONE };
        let look = |p, wi| sky.look(p, wi);
        let record = at_origin(look, n, &RecordSettings::default());
        let below = 1.0 - record.mean_radiance().x;
        assert!((below - 0.2).abs() < 2.0 / n as f32, "a^2 / (a^2 + h^2): {below}");
        assert!(record.radius() < h, "the reach falls with the height: {}", record.radius());
        let ring: Vec<Vec3A> = (0..64)
            .map(|k| {
                let (sin, cos) = (k as f32 * PI / 32.0).sin_cos();
                Vec3A::new(radius * cos, radius * sin, h)
            })
            .collect();
        let mut workspace = Workspace::new();
        for step in [0.2, 0.5, 1.0] {
            let p = Vec3A::new(0.8, 0.6, 0.0) * (step * h);
            workspace.project(&record, p, Vec3A::Z, &Settings::default());
            workspace.trace_holes(1, 1, &mut Rays(p, look));
            let expected = 1.0 - lambert(&ring, p);
            let found = f64::from(workspace.mean_radiance().x);
            assert!((found / expected - 1.0).abs() < 0.05, "h = {h}, moved {step} h: {found} for {expected}");
        }
    }
}

/// Elements that become smaller than a texel on the way seldom cover the centre of one, and yet their light counts.
#[test]
fn far_things_keep_their_light() {
    let (height, half) = (0.2, 0.1);
    let patch =
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3A::new(half * x, half * y, height));
    // On a ceiling, so that nothing uncovers anything.
    let look = |p: Vec3A, wi: Vec3A| {
        let at = p + wi * ((height - p.z) / wi.z);
        (Vec3::splat(f32::from(at.x.abs() < half && at.y.abs() < half)), (at - p).length(), Vec3A::NEG_Z)
    };
    for (max_side, limit) in [(1, 0.05), (4, 0.1)] {
        let merge = MergeSettings { max_side, ..MergeSettings::default() };
        let record = at_origin(look, 32, &RecordSettings { merge, ..RecordSettings::default() });
        let seen = f64::from(record.mean_radiance().x) / lambert(&patch, Vec3A::ZERO);
        let mut workspace = Workspace::new();
        let (mut found, mut expected) = (0.0, 0.0);
        for k in 0..64 {
            let (sin, cos) = (k as f32 * PI / 32.0).sin_cos();
            let p = Vec3A::new(cos, sin, 0.0) * (3.0 * height);
            workspace.project(&record, p, Vec3A::Z, &Settings::default());
            workspace.trace_holes(1, k, &mut Rays(p, look));
            found += f64::from(workspace.mean_radiance().x);
            expected += lambert(&patch, p);
        }
        let kept = found / expected / seen;
        assert!((kept - 1.0).abs() < limit, "{max_side} texels wide: {kept}, {seen} of it seen");
    }
}

#[test]
#[expect(clippy::print_stdout, reason = "the errors are figures to report, with --nocapture")]
fn uv_area_is_the_form_factor() {
    // Elements on a sphere of radius 1 around the record, moved by 0.1. Medians are those of random elements, measured
    // before.
    let look = |_, wi: Vec3A| (Vec3::ONE, 1.0, -wi);
    for (max_side, merge_all, median_limit, tail_limit) in
        [(1, false, 1.3e-3 * 1.2, 0.12), (4, true, 1.9e-2 * 1.2, 0.25)]
    {
        let merge = if merge_all {
            MergeSettings { max_side, min_normal_cos: 0.5, plane_tolerance: 0.5, ..MergeSettings::default() }
        } else {
            MergeSettings { max_side, ..MergeSettings::default() }
        };
        let record = at_origin(look, 32, &RecordSettings { layers: 2, merge });
        let elements = record.elements();
        let buffer = || [(); 4].map(|()| vec![0f32; elements.padded_len()]);
        let (mut u, mut v, mut z) = (buffer(), buffer(), buffer());
        let mut errors = Vec::new();
        for turn in 0..8 {
            let (sin, cos) = (turn as f32 * 0.77).sin_cos();
            let p = Vec3A::new(cos, sin, 0.0) * 0.1;
            project_corners(elements, &Mat3A::IDENTITY, p, &mut u, &mut v, &mut z);
            for e in 0..elements.len() {
                let corner = |k: usize| Vec2::new(u[k][e], v[k][e]);
                let area = 0.5 * (corner(2) - corner(0)).perp_dot(corner(3) - corner(1));
                let expected = lambert(&[0, 1, 2, 3].map(|k| elements.corner(e, k)), p);
                // Nothing but the edges bends: the horizon is left out, where corners are seen at a grazing angle.
                if (0..4).all(|k| elements.corner(e, k).z > 0.2) {
                    errors.push((f64::from(area) / expected - 1.0).abs());
                }
            }
        }
        errors.sort_by(f64::total_cmp);
        let (median, tail) = (errors[errors.len() / 2], errors[errors.len() * 99 / 100]);
        println!("{max_side} texels wide: median {median:.2e}, 99 % below {tail:.2e}");
        assert!(median < median_limit && tail < tail_limit, "{max_side} texels wide: {median}, {tail}");
    }
}

/// With all holes traced, irradiance is that of 256 x 256 rays.
#[test]
fn moved_light_agrees_with_a_gather() {
    // In the yard half of the light comes through gaps between columns, a few texels wide.
    let scenes = [
        ("cornell", Scene::cornell(), 0.03),
        ("spheres", Scene::spheres(), 0.03),
        ("yard", Scene::yard(), 0.06),
        ("clutter", Scene::clutter(60), 0.04),
    ];
    for (name, scene, limit) in scenes {
        let look = |p, wi| scene.look(p, wi);
        let mut errors = Vec::new();
        for k in 0..6u64 {
            let from = Vec3A::new(rooms::uniform(3 * k) - 0.5, rooms::uniform(3 * k + 1) - 0.5, -0.999);
            let record = record_in(look, from, FRAME, 32, &RecordSettings::default());
            let p = from + Vec3A::new(0.6, -0.8, 0.0) * (0.5 * record.radius());
            let mut workspace = Workspace::new();
            workspace.project(&record, p, Vec3A::Z, &Settings::default());
            workspace.trace_holes(1, k, &mut Rays(p, look));
            let expected = gather(look, p, &FRAME, 256);
            errors.push((workspace.mean_radiance() / expected - Vec3::ONE).element_sum() / 3.0);
        }
        let mean = errors.iter().map(|e| e.abs()).sum::<f32>() / errors.len() as f32;
        assert!(mean < limit, "{name}: mean error {mean} of {errors:?}");
    }
}
