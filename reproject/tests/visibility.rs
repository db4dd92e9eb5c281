//! What hides what: layers, masks, and elements in odd places, against a z-buffer and against rays.

mod rooms;

use glam::{Mat3A, Vec2, Vec3, Vec3A};
use hemimap::Frame;
use radcache::{Elements, Record, RecordSettings, Samples, Validity};
use reproject::{Coverage, Settings, Trails, Workspace, polygon_rows, project_corners};
use rooms::{Rays, Scene, record_in, uniform, weight_before_normalising};
use serde::{Deserialize, Serialize};

const FRAME: Frame = Frame { s: Vec3A::X, t: Vec3A::Y, n: Vec3A::Z };

/// The places of the elements' corners in the square, seen from `offset` in the frame of the record.
fn quads(elements: &Elements, offset: Vec3A) -> Vec<[Vec2; 4]> {
    let buffer = || [(); 4].map(|()| vec![0f32; elements.padded_len()]);
    let (mut u, mut v, mut z) = (buffer(), buffer(), buffer());
    project_corners(elements, &Mat3A::IDENTITY, offset, &mut u, &mut v, &mut z);
    (0..elements.len()).map(|e| [0, 1, 2, 3].map(|k| Vec2::new(u[k][e], v[k][e]))).collect()
}

/// Distance from `offset` along `wi` to the plane of an element.
fn plane_distance(elements: &Elements, e: usize, offset: Vec3A, wi: Vec3A) -> f32 {
    if elements.finite[e] == 0.0 {
        return f32::INFINITY;
    }
    let [a, b, c, d] = [0, 1, 2, 3].map(|k| elements.corner(e, k));
    let normal = (c - a).cross(d - b);
    normal.dot((a + b + c + d) / 4.0 - offset) / normal.dot(wi)
}

/// Least distance of a point from the edges of a quad.
fn edge_distance(quad: &[Vec2; 4], p: Vec2) -> f32 {
    let to_edge = |k: usize| {
        let (a, b) = (quad[k], quad[(k + 1) % 4]);
        let t = ((p - a).dot(b - a) / (b - a).length_squared().max(1e-20)).clamp(0.0, 1.0);
        p.distance(a + (b - a) * t)
    };
    (0..4).map(to_edge).fold(f32::INFINITY, f32::min)
}

fn centre(texel: usize, n: usize) -> Vec2 {
    Vec2::new((texel % n) as f32 + 0.5, (texel / n) as f32 + 0.5) / n as f32
}

/// Records on the floor of a room and points at half their radius.
fn moves(scene: &Scene, n: usize, count: u64) -> impl Iterator<Item = (Record, Vec3A)> {
    (0..count).map(move |k| {
        let from = Vec3A::new(1.6 * uniform(3 * k) - 0.8, 1.6 * uniform(3 * k + 1) - 0.8, -0.999);
        let record = record_in(|p, wi| scene.look(p, wi), from, FRAME, n, &RecordSettings::default());
        let (sin, cos) = (std::f32::consts::TAU * uniform(3 * k + 2)).sin_cos();
        let to = from + Vec3A::new(cos, sin, 0.0) * (0.5 * record.radius());
        (record, to)
    })
}

/// The layout of a record in bytes, so that a test may change its elements.
#[derive(Serialize, Deserialize)]
struct Opened {
    centre: Vec3,
    frame: [Vec3; 3],
    samples: Samples,
    elements: Elements,
    harmonic_distance: f32,
    radius: f32,
}

/// The record with the elements of each layer in another order.
fn shuffled(record: &Record, seed: usize) -> Record {
    let bytes = postcard::to_stdvec(record).expect("a record is bytes");
    let mut open: Opened = postcard::from_bytes(&bytes).expect("in this layout");
    let elements = &mut open.elements;
    for layer in 0..elements.layer_count() {
        let range = elements.layer(layer);
        for a in range.clone() {
            let b = range.start + (seed + 7919 * a) % range.len();
            let padded = elements.padded_len();
            for list in [&mut elements.x, &mut elements.y, &mut elements.z] {
                (0..4).for_each(|k| list.swap(k * padded + a, k * padded + b));
            }
            elements.radiance.iter_mut().chain([&mut elements.finite]).for_each(|list| list.swap(a, b));
            elements.start.swap(a, b);
            elements.size.swap(a, b);
            elements.sides.swap(a, b);
            elements.view_dependent.swap(a, b);
        }
    }
    let bytes = postcard::to_stdvec(&open).expect("bytes again");
    postcard::from_bytes(&bytes).expect("of the same layout")
}

#[test]
fn layer_order_decides_occlusion() {
    // Inside a layer order is nothing: any permutation gives the same masks.
    let scene = Scene::clutter(40);
    for n in [7, 32, 64] {
        for (record, to) in moves(&scene, n, 4) {
            for trails in [Trails::Uncovered, Trails::Silhouettes, Trails::All] {
                for coverage in [Coverage::Quad, Coverage::Rectangle] {
                    let settings = Settings { trails, coverage, ..Settings::default() };
                    let (mut a, mut b) = (Workspace::new(), Workspace::new());
                    let expected = a.project(&record, to, Vec3A::Z, &settings);
                    let other = shuffled(&record, 99);
                    assert!(n < 32 || other != record, "the order changed");
                    let found = b.project(&other, to, Vec3A::Z, &settings);
                    assert_eq!(found, expected, "n = {n}, {settings:?}");
                    assert_eq!(a.masks().fill, b.masks().fill, "n = {n}, {settings:?}");
                    assert_eq!(a.masks().unknown, b.masks().unknown, "n = {n}, {settings:?}");
                    let change = a.mean_radiance() - b.mean_radiance();
                    assert!(change.abs().max_element() < 1e-5, "sums in another order: {change}");
                }
            }
        }
    }
    // Between layers the nearer wins: a block at distance 1 before a wall at 2, whichever is written first.
    let look = |_: Vec3A, wi: Vec3A| {
        let near = wi.x.abs() < 0.3 && wi.y.abs() < 0.3;
        (Vec3::splat(if near { 1.0 } else { 0.0 }), if near { 1.0 } else { 2.0 } / wi.z, Vec3A::NEG_Z)
    };
    let record = record_in(look, Vec3A::ZERO, FRAME, 32, &RecordSettings::default());
    let offset = Vec3A::X * 0.2;
    let mut workspace = Workspace::new();
    workspace.project(&record, offset, Vec3A::Z, &Settings { margins: false, ..Settings::default() });
    let quads = quads(record.elements(), offset);
    let (mut covered, mut given_up) = (0, 0);
    for texel in 0..32 * 32 {
        let covered_by_near = (0..quads.len()).any(|e| {
            let mut rows = [0; 64];
            polygon_rows(&quads[e], 32, &mut rows);
            record.elements().radiance[0][e] > 0.0 && rows[texel / 32] >> (texel % 32) & 1 == 1
        });
        let owner = workspace.owner(texel).map(|e| record.elements().radiance[0][e]);
        assert!(!covered_by_near || owner != Some(0.0), "texel {texel} belongs to the near block, not to the wall");
        covered += usize::from(covered_by_near);
        given_up += usize::from(covered_by_near && owner.is_none());
    }
    // The block moved by three texels. Where its outline has steps, a side that moves along itself leaves a sliver that
    // reaches into its neighbours.
    assert!(given_up * 5 < covered, "{given_up} of {covered} texels of the block are unknown");
}

/// S14: front to back over masks against a z-buffer over texels.
#[test]
#[expect(clippy::print_stdout, reason = "the share that differs is a figure to report, with --nocapture")]
fn layers_equal_a_z_buffer() {
    let n = 32;
    for (name, scene) in [("cornell", Scene::cornell()), ("clutter", Scene::clutter(40)), ("spheres", Scene::spheres())]
    {
        let (mut compared, mut differing, mut inner) = (0, 0, 0);
        for (record, to) in moves(&scene, n, 12) {
            let (elements, offset) = (record.elements(), to - record.centre());
            let mut workspace = Workspace::new();
            workspace.project(&record, to, Vec3A::Z, &Settings::default());
            let quads = quads(elements, offset);
            let mut nearest = vec![(f32::INFINITY, usize::MAX); n * n];
            for (e, quad) in quads.iter().enumerate() {
                let turned = (quad[2] - quad[0]).perp_dot(quad[3] - quad[1]) <= 0.0;
                let mut rows = [0; 64];
                for j in polygon_rows(quad, n, &mut rows) {
                    for i in (0..n).filter(|&i| !turned && rows[j] >> i & 1 == 1) {
                        let wi = hemimap::square_to_cosine_hemisphere(centre(j * n + i, n));
                        let depth = plane_distance(elements, e, offset, wi);
                        if depth > 0.0 && depth < nearest[j * n + i].0 {
                            nearest[j * n + i] = (depth, e);
                        }
                    }
                }
            }
            for (texel, &(depth, e)) in nearest.iter().enumerate() {
                let Some(owner) = workspace.owner(texel) else { continue };
                let p = centre(texel, n);
                let found = plane_distance(elements, owner, offset, hemimap::square_to_cosine_hemisphere(p));
                compared += 1;
                // Two elements of one surface that meet on a texel are the same to the eye.
                if e != usize::MAX && (found / depth - 1.0).abs() > 0.05 {
                    differing += 1;
                    let rim = edge_distance(&quads[e], p).min(edge_distance(&quads[owner], p));
                    inner += usize::from(rim > 1.0 / n as f32);
                }
            }
        }
        let share = differing as f32 / compared as f32;
        println!("{name}: {:.3} % of {compared} bits differ, {inner} of them away from every rim", 100.0 * share);
        assert_eq!(inner, 0, "{name}: only rims differ");
        assert!(share < 0.02, "{name}: {share}");
    }
}

#[test]
#[expect(clippy::print_stdout, reason = "shares are figures to report, with --nocapture")]
fn filled_bits_are_truly_visible() {
    let n = 32;
    // Boxes of a texel's size in the clutter may lie between the rays of the record: nothing tells it of them. And
    // where a surface ends before another that is hardly farther, no silhouette tells that an element four texels wide
    // must not fill what it leaves.
    let scenes = [
        ("cornell", Scene::cornell(), 0.03, 2),
        ("clutter", Scene::clutter(40), 0.06, 4),
        ("spheres", Scene::spheres(), 0.03, 0),
    ];
    for (name, scene, quad_limit, inner_limit) in scenes {
        for (coverage, limit) in [(Coverage::Quad, quad_limit), (Coverage::Rectangle, 0.08)] {
            let (mut filled, mut wrong, mut inner) = (0, 0, 0);
            for (record, to) in moves(&scene, n, 24) {
                let (elements, offset) = (record.elements(), to - record.centre());
                let mut workspace = Workspace::new();
                workspace.project(&record, to, Vec3A::Z, &Settings { coverage, ..Settings::default() });
                let quads = quads(elements, offset);
                for texel in 0..n * n {
                    let Some(owner) = workspace.owner(texel) else { continue };
                    let p = centre(texel, n);
                    let wi = hemimap::square_to_cosine_hemisphere(p);
                    let (_, hit, _) = scene.look(to, wi);
                    let expected = plane_distance(elements, owner, offset, wi);
                    filled += 1;
                    if (hit / expected - 1.0).abs() > 0.05 {
                        wrong += 1;
                        let rim = quads.iter().map(|quad| edge_distance(quad, p)).fold(f32::INFINITY, f32::min);
                        inner += usize::from(rim > 1.0 / n as f32);
                    }
                }
            }
            let share = wrong as f32 / filled as f32;
            println!(
                "{name}, {coverage:?}: {:.2} % of {filled} filled bits are wrong, {inner} away from edges",
                100.0 * share
            );
            assert!(
                inner <= inner_limit + if coverage == Coverage::Quad { 0 } else { 4 },
                "{name}, {coverage:?}: {inner}"
            );
            assert!(share < limit, "{name}, {coverage:?}: {share}");
        }
    }
}

#[test]
fn union_is_covered_at_most_once() {
    for scene in [Scene::cornell(), Scene::spheres(), Scene::clutter(40)] {
        for (record, to) in moves(&scene, 32, 8) {
            let mut workspace = Workspace::new();
            workspace.project(&record, to, Vec3A::Z, &Settings::default());
            let owned = (0..32 * 32).filter(|&texel| workspace.owner(texel).is_some()).count();
            let filled: u32 = workspace.masks().count(&workspace.masks().fill);
            assert_eq!(owned, filled as usize, "each filled bit has one owner");
            let rays = workspace.trace_holes(1, 1, &mut Rays(to, |p, wi| scene.look(p, wi)));
            assert_eq!(rays, 32 * 32 - owned, "one ray for each hole at step 1");
        }
    }
}

/// What elements weigh, by their areas and what is visible of them, and the holes make one, before they are normalised.
#[test]
fn visible_areas_and_holes_make_one() {
    let light = Vec3::new(1.0, 2.0, 3.0);
    for (name, mut scene) in
        [("cornell", Scene::cornell()), ("spheres", Scene::spheres()), ("clutter", Scene::clutter(40))]
    {
        scene.shapes.iter_mut().for_each(|(_, radiance)| *radiance = light);
        for n in [16, 32, 64] {
            let mut sums = Vec::new();
            for (record, to) in moves(&scene, n, 12) {
                let mut workspace = Workspace::new();
                let shares = workspace.project(&record, to, Vec3A::Z, &Settings::default());
                if shares.holes > 0.0 {
                    sums.push(weight_before_normalising(&mut workspace, shares));
                }
                workspace.trace_holes(1, 1, &mut Rays(to, |p, wi| scene.look(p, wi)));
                let change = workspace.mean_radiance() / light - Vec3::ONE;
                assert!(change.abs().max_element() < 1e-5, "constant light comes back: {change}");
            }
            assert!(sums.len() >= 10, "{name}, n = {n}: a record that does not reach anybody leaves no holes");
            // Elements meet and end inside of texels, which belong to one of them: 3.2 % at most were seen, and 1.2 %
            // in the mean.
            assert!(sums.iter().all(|sum| (sum - 1.0).abs() < 0.05), "{name}, n = {n}: {sums:?}");
            let mean = sums.iter().sum::<f32>() / sums.len() as f32;
            assert!((mean - 1.0).abs() < 0.02, "{name}, n = {n}: {mean} in the mean of {sums:?}");
        }
    }
}

#[test]
fn elements_in_odd_places() {
    let n = 16;
    let settings = Settings { margins: false, ..Settings::default() };
    let sane = |look: &dyn Fn(Vec3A, Vec3A) -> rooms::Seen, p: Vec3A, normal: Vec3A| {
        let record = record_in(look, Vec3A::ZERO, FRAME, n, &RecordSettings::default());
        let mut workspace = Workspace::new();
        for (trails, margins) in [
            (Trails::Uncovered, true),
            (Trails::Uncovered, false),
            (Trails::Silhouettes, true),
            (Trails::Silhouettes, false),
            (Trails::All, true),
        ] {
            workspace.project(&record, p, normal, &Settings { trails, margins, ..settings });
            let masks = workspace.masks();
            let both = masks.fill.iter().zip(&masks.unknown).map(|(fill, unknown)| (fill & unknown).count_ones());
            assert_eq!(both.sum::<u32>(), 0, "what is filled is not unknown, at {p}");
            assert!(workspace.mean_radiance().is_finite(), "at {p}");
        }
        workspace
    };
    let flat = |h: f32| move |_: Vec3A, wi: Vec3A| (Vec3::ONE, h / wi.z, Vec3A::NEG_Z);
    // Wholly below: the point rose through the ceiling. No bits, no trace of them.
    let above = sane(&flat(0.5), Vec3A::Z, Vec3A::Z);
    assert_eq!(above.masks().count(&above.masks().fill), 0, "all is below");
    // In the plane of the elements, where their corners are on the horizon, and behind them.
    sane(&flat(0.5), Vec3A::Z * 0.5, Vec3A::Z);
    let behind = sane(&|_, wi| (Vec3::ONE, 0.5, -wi), Vec3A::Z * 2.0, Vec3A::NEG_Z);
    assert_eq!(behind.masks().count(&behind.masks().fill), 0, "seen from behind: unknown, not filled");
    // Distances of 0, tiny, huge and beyond all measure; a point at an element's corner; normals of zero.
    for distance in [0.0, 1e-38, 1e-7, 1e20, 1e30, f32::MAX] {
        for normal in [Vec3A::NEG_Z, Vec3A::ZERO] {
            let odd = move |_: Vec3A, wi: Vec3A| (Vec3::ONE, if wi.x > 0.2 { distance } else { 1.0 }, normal);
            sane(&odd, Vec3A::ZERO, Vec3A::Z);
            sane(&odd, Vec3A::new(0.1, 0.2, 0.0), Vec3A::Z);
            sane(&odd, Vec3A::new(0.1, 0.2, 0.3), Vec3A::new(0.6, 0.0, 0.8));
        }
    }
    let record = record_in(flat(1.0), Vec3A::ZERO, FRAME, n, &RecordSettings::default());
    sane(&flat(1.0), record.elements().corner(20, 2), Vec3A::Z);
    sane(&flat(1.0), record.elements().corner(20, 2) - Vec3A::Z * 1e-7, Vec3A::Z);
    // Across the centre, a diagonal and the horizon: bits are those whose centre's ray meets the element.
    let patch = |p: Vec3A, wi: Vec3A| {
        let t = (1.0 - p.z) / wi.z;
        let hit = p + wi * t;
        let on = (hit.x - 0.1).abs() < 0.6 && (hit.y - 0.1).abs() < 0.6;
        (Vec3::splat(if on { 1.0 } else { 0.0 }), if on { t } else { f32::INFINITY }, Vec3A::NEG_Z)
    };
    let record = record_in(patch, Vec3A::ZERO, FRAME, 64, &RecordSettings::default());
    let mut workspace = Workspace::new();
    for (p, normal) in [(Vec3A::new(0.1, 0.1, 0.0), Vec3A::Z), (Vec3A::new(-0.2, 0.1, 0.1), Vec3A::new(0.8, 0.0, 0.6))]
    {
        workspace.project(&record, p, normal, &settings);
        let frame = workspace.frame();
        let mut wrong = 0;
        for texel in 0..64 * 64 {
            let wi = frame.to_world(hemimap::square_to_cosine_hemisphere(centre(texel, 64)));
            let on = wi.z > 0.0 && patch(p, wi).0.x > 0.0;
            let owned = workspace.owner(texel).is_some_and(|e| record.elements().finite[e] == 1.0);
            wrong += usize::from(on != owned);
        }
        // The outline is about 4 * 30 texels long, and the texels of the record are as large as these.
        assert!(wrong < 120, "{wrong} texels differ at {p}");
    }
    // From its plane, beside it, a flat thing has no area.
    workspace.project(&record, Vec3A::new(2.0, 0.3, 1.0), Vec3A::Z, &settings);
    let flat = (0..64 * 64).filter(|&t| workspace.owner(t).is_some_and(|e| record.elements().finite[e] == 1.0)).count();
    assert_eq!(flat, 0, "texels of a patch seen edge on");
    // A record that saw nothing but what depends on the view fills nothing.
    let mut samples = record.samples().clone();
    samples.view_dependent.fill(true);
    let shy = Record::new(Vec3A::ZERO, FRAME, samples, &RecordSettings::default(), &Validity::default());
    let shares = workspace.project(&shy, Vec3A::ZERO, Vec3A::Z, &settings);
    assert_eq!((shares.filled, shares.unknown), (0.0, 1.0), "all must be looked at anew");
}

/// A record on top of a step cannot know the side of the step; a point at its foot sees it over half of its sky.
#[test]
fn what_lies_below_the_record_does_not_shine_through() {
    let mut scene = Scene::default();
    scene.add_box(Vec3A::ZERO, Vec3A::splat(3.0), 0.0, Vec3::ONE);
    let black = [
        (Vec3A::new(-1.5, 0.0, 0.0), Vec3A::X * 1.5, Vec3A::Y * 3.0),
        (Vec3A::new(0.0, 0.0, -0.05), Vec3A::Y * 3.0, Vec3A::Z * 0.05),
        (Vec3A::new(1.5, 0.0, -0.1), Vec3A::X * 1.5, Vec3A::Y * 3.0),
    ];
    scene.shapes.extend(black.map(|(centre, s, t)| (rooms::Shape::Rectangle(centre, s, t), Vec3::ZERO)));
    let look = |p, wi| scene.look(p, wi);
    let record = record_in(look, Vec3A::new(-0.1, 0.0, 1e-3), FRAME, 32, &RecordSettings::default());
    let mut workspace = Workspace::new();
    for x in [0.1, 0.2, 0.4] {
        let p = Vec3A::new(x, 0.0, -0.099);
        let truth = rooms::gather(look, p, &FRAME, 128).x;
        let shares = workspace.project(&record, p, Vec3A::Z, &Settings::default());
        workspace.trace_holes(1, 7, &mut Rays(p, look));
        let found = workspace.mean_radiance().x;
        assert!((found / truth - 1.0).abs() < 0.05, "at {x}: {found} instead of {truth}");
        assert!(shares.filled > 0.02, "what is far above the step is taken from the record: {shares:?}");
    }
}
