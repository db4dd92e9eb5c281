//! Records of analytic scenes: elements, layers, reach and refusal.

use glam::{Vec3, Vec3A};
use hemimap::Frame;
use proptest::prelude::*;
use radcache::{
    DepthRange, Index, MergeSettings, Record, RecordSettings, Samples, Sides, Validity, from_bytes, to_bytes,
};
use serde::Deserialize;
use serde_json::{Value, json};

const FRAME: Frame = Frame { s: Vec3A::X, t: Vec3A::Y, n: Vec3A::Z };

/// A room 2 x 2 x 2 around the origin with a ball in it: radiance, distance, normal.
fn room(p: Vec3A, wi: Vec3A) -> (Vec3, f32, Vec3A) {
    let to_wall = |p: f32, w: f32| if w == 0.0 { f32::INFINITY } else { (w.signum() - p) / w };
    let walls = [to_wall(p.x, wi.x), to_wall(p.y, wi.y), to_wall(p.z, wi.z)];
    let axis = (0..3).min_by(|&a, &b| walls[a].total_cmp(&walls[b])).expect("three axes");
    let mut normal = Vec3A::ZERO;
    normal[axis] = -wi[axis].signum();
    let (ball, radius) = (Vec3A::new(0.4, 0.1, -0.4), 0.3);
    let b = (p - ball).dot(wi);
    let root = (b * b - (p - ball).length_squared() + radius * radius).sqrt();
    if -b - root > 0.0 {
        let t = -b - root;
        return (Vec3::new(0.2, 0.5, 0.9), t, (p + wi * t - ball) / radius);
    }
    (Vec3::splat(0.1 + 0.3 * axis as f32) + (p + wi * walls[axis]).abs().max_element() * 0.1, walls[axis], normal)
}

fn record(p: Vec3A, frame: Frame, n: usize, settings: &RecordSettings, validity: &Validity) -> Record {
    let samples = Samples::from_fn(n, |wi| {
        let (radiance, distance, normal) = room(p, frame.to_world(wi));
        (radiance, distance, frame.to_local(normal))
    });
    Record::new(p, frame, samples, settings, validity)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// Every texel is in one element, elements are in the layers of their nearest texels, and they keep the sum of
    /// radiance.
    #[test]
    fn elements_tile_the_texture(
        x in -0.9f32..0.9, y in -0.9f32..0.9, z in -0.99f32..-0.8, n in 1usize..=64,
        layers in prop_oneof![Just(1usize), Just(2), Just(16), Just(256)], max_side in 0u8..=64, adaptive: bool,
        max_contrast in 0.0f32..2.0,
        depth in prop_oneof![Just(DepthRange::Layer), (0.0f32..2.0).prop_map(DepthRange::Parallax)],
    ) {
        let merge = MergeSettings { max_side, adaptive, max_contrast, depth, ..MergeSettings::default() };
        let record = record(Vec3A::new(x, y, z), FRAME, n, &RecordSettings { layers, merge }, &Validity::default());
        let (elements, samples) = (record.elements(), record.samples());
        let mut owner = vec![None; n * n];
        let mut sum = glam::DVec3::ZERO;
        for e in 0..elements.len() {
            let [i0, j0] = elements.start[e].map(usize::from);
            let [w, h] = elements.size[e].map(usize::from);
            prop_assert!(w <= usize::from(max_side).max(1) && h <= usize::from(max_side).max(1), "{} x {}", w, h);
            for j in j0..j0 + h {
                for i in i0..i0 + w {
                    prop_assert_eq!(owner[j * n + i].replace(e), None, "texel {} {} is in two elements", i, j);
                }
            }
            let mean = Vec3::from_array(std::array::from_fn(|c| elements.radiance[c][e]));
            sum += mean.as_dvec3() * (w * h) as f64;
        }
        prop_assert!(owner.iter().all(Option::is_some), "every texel is in an element");
        let whole: glam::DVec3 = samples.radiance.iter().map(|l| l.as_dvec3()).sum();
        prop_assert!((sum / whole - 1.0).abs().max_element() < 1e-6, "{} for {}", sum, whole);
        // Layers are ordered: of what a farther one holds, the nearest ends are not nearer than those of a nearer one,
        // and the farthest neither where no element runs through several.
        let mut ends = vec![[f32::INFINITY, 0.0]; elements.len()];
        for (e, &distance) in owner.iter().zip(&samples.distance) {
            let [near, far] = &mut ends[e.unwrap()];
            (*near, *far) = (near.min(distance), far.max(distance));
        }
        let last = if depth == DepthRange::Layer { 1 } else { 0 };
        let mut farthest_before = 0.0f32;
        for layer in 0..elements.layer_count() {
            let ends = &ends[elements.layer(layer)];
            let nearest = ends.iter().fold(f32::INFINITY, |low, end| low.min(end[0]));
            prop_assert!(nearest >= farthest_before, "layer {}: {} after {}", layer, nearest, farthest_before);
            farthest_before = ends.iter().fold(farthest_before, |high, end| high.max(end[last]));
        }
        // What is written comes back.
        prop_assert_eq!(&from_bytes(&to_bytes(std::slice::from_ref(&record)).unwrap()).unwrap()[0], &record);
    }
}

/// Whatever the format, what is read is checked, so that nothing panics later.
#[test]
fn every_format_refuses_numbers_that_make_no_sense() {
    let record = record(Vec3A::new(0.1, 0.2, -0.9), FRAME, 8, &RecordSettings::default(), &Validity::default());
    let whole = serde_json::to_value(&record).unwrap();
    assert_eq!(serde_json::from_value::<Record>(whole.clone()).unwrap(), record, "what is sound comes back");
    assert_eq!(&serde_json::from_value::<Samples>(whole["samples"].clone()).unwrap(), record.samples());
    let changes: [(&str, Value, &str); 7] = [
        ("/samples/n", json!(1000), "its resolution is not in 1..=64"),
        ("/samples/n", json!(0), "its resolution is not in 1..=64"),
        ("/samples/n", json!(7), "a texture is not n x n"),
        ("/samples/distance/3", json!(-1.0), "a texel is not finite"),
        ("/samples/background_share/3", json!(1.5), "a share is not in [0, 1]"),
        ("/radius", json!(-1.0), "its radius is negative or not a number"),
        ("/elements/start/0", json!([60, 0]), "an element is outside the texture"),
    ];
    for (place, value, what) in changes {
        let mut changed = whole.clone();
        *changed.pointer_mut(place).unwrap() = value;
        if place.starts_with("/samples") {
            // By the name of the type, too, where what is derived on it would come first.
            let error = Samples::deserialize(&changed["samples"]).unwrap_err().to_string();
            assert_eq!(error, what, "{place} of samples");
        }
        let error = Record::deserialize(changed).unwrap_err().to_string();
        assert_eq!(error, what, "{place} of a record");
    }
}

/// The fields of samples may be written without `set`, so records are the place where that is found.
#[test]
fn records_tell_what_is_wrong_with_their_samples() {
    let message = |layers: usize, change: fn(&mut Samples)| {
        let mut samples = Samples::from_fn(4, |wi| (Vec3::ONE, 1.0 / wi.z, Vec3A::NEG_Z));
        change(&mut samples);
        let settings = RecordSettings { layers, ..RecordSettings::default() };
        let made =
            std::panic::catch_unwind(|| Record::new(Vec3A::ZERO, FRAME, samples, &settings, &Validity::default()));
        made.map(drop).map_err(|panic| panic.downcast_ref::<&str>().map_or_else(String::new, |text| (*text).to_owned()))
    };
    assert_eq!(message(16, |_| ()), Ok(()), "nothing is wrong");
    for layers in [0, 257] {
        assert_eq!(message(layers, |_| ()).unwrap_err(), "records have 1 to 256 layers", "{layers} layers");
    }
    let changes: [fn(&mut Samples); 3] =
        [|s| s.distance[5] = f32::NAN, |s| s.distance.fill(-1.0), |s| s.distance[5] = f32::NEG_INFINITY];
    for change in changes {
        assert_eq!(message(16, change).unwrap_err(), "distances of samples must be 0 or more, not NaN");
    }
    let changes: [fn(&mut Samples); 5] = [
        |s| s.radiance.truncate(15),
        |s| s.distance.push(1.0),
        |s| s.normal.clear(),
        |s| s.background_share.truncate(3),
        |s| s.view_dependent.truncate(3),
    ];
    for change in changes {
        assert_eq!(message(16, change).unwrap_err(), "textures of samples must be n x n");
    }
}

#[test]
fn turning_the_frame_by_a_right_angle_permutes_texels() {
    let p = Vec3A::new(0.1, -0.2, -0.9);
    for n in [1, 7, 16, 32, 33, 64] {
        let straight = record(p, FRAME, n, &RecordSettings::default(), &Validity::default());
        let quarter = Frame { s: Vec3A::Y, t: -Vec3A::X, n: Vec3A::Z };
        let turned = record(p, quarter, n, &RecordSettings::default(), &Validity::default());
        for j in 0..n {
            for i in 0..n {
                let (a, b) = (i * n + n - 1 - j, j * n + i);
                let (wi, turned_wi) = (straight.samples().direction(a), turned.samples().direction(b));
                assert!((wi - quarter.to_world(turned_wi)).abs().max_element() < 1e-6, "n = {n}, texel {i} {j}");
                // Up to the rounding of the room's own sums, which run along other axes.
                let (l, d) = (straight.samples().radiance[a], straight.samples().distance[a]);
                assert!((l - turned.samples().radiance[b]).abs().max_element() < 1e-5, "n = {n}, texel {i} {j}");
                assert!((d / turned.samples().distance[b] - 1.0).abs() < 1e-5, "n = {n}, texel {i} {j}");
            }
        }
        let change = straight.mean_radiance() / turned.mean_radiance() - Vec3::ONE;
        assert!(change.abs().max_element() < 1e-6, "n = {n}: {change}");
        assert!((straight.radius() / turned.radius() - 1.0).abs() < 1e-5, "n = {n}");
    }
}

/// Centres on and off the floor of a closed room, at a wall's foot too: those behind it see the floor at once.
#[test]
fn record_outside_the_geometry_is_refused() {
    // Floor and walls as single sheets: a point below the floor sees its back right above it.
    let sheets = |p: Vec3A, wi: Vec3A| {
        let floor = if p.z < 0.0 { -p.z / wi.z } else { f32::INFINITY };
        let wall = if wi.x > 0.0 && p.x < 1.0 { (1.0 - p.x) / wi.x } else { f32::INFINITY };
        let distance = floor.min(wall).min(2.0 / wi.z);
        (Vec3::ONE, distance, -wi)
    };
    let validity = Validity { touching_distance: 1e-3, min_radius: 0.01, ..Validity::default() };
    let radius = |p: Vec3A| {
        let samples = Samples::from_fn(32, |wi| sheets(p, wi));
        Record::new(p, FRAME, samples, &RecordSettings::default(), &validity).radius()
    };
    for height in [0.0, 1e-7, 1e-5] {
        assert!(radius(Vec3A::Z * height) > 0.1, "{height} above the floor it is kept");
    }
    for depth in [1e-7, 1e-5, 1e-4] {
        assert_eq!(radius(-Vec3A::Z * depth), 0.0, "{depth} below the floor it is refused");
    }
    assert_eq!(radius(Vec3A::new(1.0 - 1e-7, 0.0, 0.0)), 0.0, "in the seam of floor and wall it is refused");
    assert!(radius(Vec3A::new(0.9, 0.0, 0.0)) >= 0.01, "beside the wall it is kept");
    // A refused record serves nobody, not even its own place.
    let samples = Samples::from_fn(8, |wi| sheets(-Vec3A::Z * 1e-5, wi));
    let mut index = Index::new(validity);
    index.extend([Record::new(Vec3A::ZERO, FRAME, samples, &RecordSettings::default(), &validity)]);
    assert_eq!(index.best(Vec3A::ZERO, Vec3A::Z), None);
    assert_eq!(index.len(), 1, "but it is counted");
}

/// Records along a floor towards a wall: their reach shrinks with the distance and never passes the wall; nearer than
/// is of use they reach nobody, so the strip of pixels beside the seam does without them instead of crowding it.
#[test]
fn records_do_not_cluster_in_corners() {
    let radius = |x: f32, validity: &Validity| {
        let wall = |wi: Vec3A| (Vec3::ONE, if wi.x > 0.0 { x / wi.x } else { f32::INFINITY }, Vec3A::NEG_X);
        Record::new(Vec3A::ZERO, FRAME, Samples::from_fn(32, wall), &RecordSettings::default(), validity).radius()
    };
    let rules = Validity { min_radius: 0.01, max_radius: 1.0, ..Validity::default() };
    let mut last = f32::INFINITY;
    for x in [1.0, 0.3, 0.1, 0.03, 0.01, 1e-3, 1e-4, 1e-6] {
        let found = radius(x, &rules);
        assert!(found <= last && (found >= 0.01 || found == 0.0), "{x} from the wall: {found}");
        assert!(found <= x, "{x} from the wall it does not reach through: {found}");
        assert_eq!(found == 0.0, x <= 0.01, "{x} from the wall: {found}");
        last = found;
    }
    let (mut x, mut count) = (0.012f32, 0);
    while x < 0.1 && count < 100 {
        x += 2.0 * radius(x, &rules);
        count += 1;
    }
    assert!(count <= 6, "{count} records in the last 10 cm, where 0.01 everywhere would take 5");
}

#[test]
fn silhouettes_lie_where_the_ball_ends() {
    let record = record(Vec3A::new(-0.3, -0.2, -0.95), FRAME, 32, &RecordSettings::default(), &Validity::default());
    let elements = record.elements();
    let ball = |e: usize| elements.radiance[2][e] > 0.85 && elements.radiance[0][e] < 0.25;
    let marked = (0..elements.len()).filter(|&e| elements.sides[e] != Sides::NONE);
    let (on_ball, elsewhere): (Vec<_>, Vec<_>) = marked.partition(|&e| ball(e));
    assert!(on_ball.len() > 8, "the outline of the ball: {}", on_ball.len());
    // Walls meet in creases, which hide nothing; where both are seen at a grazing angle, a texel may take one for an
    // edge.
    assert!(elsewhere.len() * 50 < 32 * 32, "{} of {} elements", elsewhere.len(), elements.len());
}

#[test]
fn misfit_grows_with_distance_height_and_turn() {
    let validity = Validity::default();
    let record = record(Vec3A::new(0.0, 0.0, -0.9), FRAME, 16, &RecordSettings::default(), &validity);
    let at = |d: Vec3A, n: Vec3A| validity.misfit(&record, record.centre() + d, n);
    let r = record.radius();
    assert_eq!(at(Vec3A::ZERO, Vec3A::Z), 0.0, "itself");
    assert!((at(Vec3A::X * r, Vec3A::Z) - 1.0).abs() < 1e-5, "the end of its reach");
    assert!((at(Vec3A::Z * 0.5 * r, Vec3A::Z) - 1.0).abs() < 1e-5, "height counts double");
    let tilted = |cos: f32| Vec3A::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    assert!((at(Vec3A::ZERO, tilted(0.95)) - 0.25).abs() < 1e-3, "half of the turn that is allowed");
    assert_eq!(at(Vec3A::ZERO, tilted(0.89)), f32::INFINITY, "turned too far");
}
