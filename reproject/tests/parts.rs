//! The four parts of the hemisphere: a block before a wall, seen from beside, against what rays between both places
//! tell.

mod rooms;

use glam::{Vec2, Vec3, Vec3A};
use hemimap::Frame;
use radcache::{MergeSettings, RecordSettings};
use reproject::{Settings, Workspace};
use rooms::{Scene, Seen, Shape, record_in, uniform};

const FRAME: Frame = Frame { s: Vec3A::X, t: Vec3A::Y, n: Vec3A::Z };
const N: usize = 64;

/// A plate at a height of 1 before another at 2 that is all there is.
fn plates() -> Scene {
    let plate = |z, size| Shape::Rectangle(Vec3A::Z * z, Vec3A::X * size, Vec3A::Y * size);
    Scene { shapes: vec![(plate(1.0, 0.5), Vec3::ONE), (plate(2.0, 1e4), Vec3::splat(0.5))], sky: Vec3::ZERO }
}

#[test]
fn parts_are_those_that_rays_tell() {
    let scene = plates();
    let look = |p: Vec3A, wi: Vec3A| -> Seen { scene.look(p, wi) };
    let settings = RecordSettings {
        merge: MergeSettings { max_side: 1, ..MergeSettings::default() },
        ..RecordSettings::default()
    };
    let record = record_in(look, Vec3A::ZERO, FRAME, N, &settings);
    let mut workspace = Workspace::new();
    for (to, n) in [(Vec3A::X * 0.6, Vec3A::Z), (Vec3A::new(-0.4, 0.4, 0.0), Vec3A::new(0.3, 0.1, 1.0).normalize())] {
        workspace.project(&record, to, n, &Settings { margins: false, ..Settings::default() });
        let parts = workspace.parts(&record);
        // What stands before what: the near plate seen where the far one was, the far one where the near one was, and
        // what hides the far one from the record.
        let (mut near_moved, mut bared, mut opened) = (0.0, 0.0, 0.0);
        const SIDE: usize = 512;
        for k in 0..SIDE * SIDE {
            let place = (Vec2::new((k % SIDE) as f32, (k / SIDE) as f32) + 0.5) / SIDE as f32;
            let wi = workspace.frame().to_world(hemimap::square_to_cosine_hemisphere(place));
            let is_near = |(_, distance, _): Seen, wi: Vec3A| (distance * wi.z - 1.0).abs() < 0.1;
            if wi.z <= 0.0 {
                continue;
            }
            let now = look(to, wi);
            let (is_near_now, was_near) = (is_near(now, wi), is_near(look(Vec3A::ZERO, wi), wi));
            let from_record = (to + wi * now.1).normalize();
            let was_seen = is_near(look(Vec3A::ZERO, from_record), from_record) == is_near_now;
            let weight = 1.0 / (SIDE * SIDE) as f32;
            near_moved += if is_near_now && !was_near { weight } else { 0.0 };
            opened += if was_seen { 0.0 } else { weight };
            bared += if was_seen && !is_near_now && was_near { weight } else { 0.0 };
        }
        // Both are strips of a texel's width more or less along outlines that are four sides long, half of which
        // matter.
        let rim = 2.0 * 0.25 / N as f32;
        assert!((parts.bared - bared).abs() < rim, "{parts:?}, but bared {bared}");
        assert!(parts.opened > opened - rim && parts.opened < opened + 0.08, "{parts:?}, but opened {opened}");
        assert!(parts.moved > near_moved - rim, "{parts:?}, but the near one moved over {near_moved}");
        assert!(bared > 4.0 * rim && near_moved > 4.0 * rim, "the test says nothing of {bared} and {near_moved}");
        let sum = parts.unchanged + parts.moved + parts.bared + parts.opened;
        assert!((sum - 1.0).abs() < 1e-5, "{sum}");
    }
}

#[test]
fn the_sky_stays_and_a_record_in_place_is_unchanged() {
    let sky = |_: Vec3A, wi: Vec3A| (Vec3::ONE, f32::INFINITY, -wi);
    let record = record_in(sky, Vec3A::ZERO, FRAME, 16, &RecordSettings::default());
    let mut workspace = Workspace::new();
    workspace.project(&record, Vec3A::new(3.0, -4.0, 1.0), Vec3A::Z, &Settings::default());
    assert_eq!(workspace.parts(&record).unchanged, 1.0, "from afar");
    let scene = Scene::clutter(40);
    for k in 0..4 {
        let from = Vec3A::new(uniform(2 * k) - 0.5, uniform(2 * k + 1) - 0.5, -0.999);
        let record = record_in(|p, wi| scene.look(p, wi), from, FRAME, 33, &RecordSettings::default());
        workspace.project(&record, from, Vec3A::Z, &Settings::default());
        assert_eq!(workspace.parts(&record).unchanged, 1.0, "in place");
        // What lies below a slanting surface belongs to no part.
        let ng = Vec3A::new(0.3, 0.0, 1.0).normalize();
        let shares = workspace.project_above(&record, from, Vec3A::Z, ng, &Settings::default());
        let parts = workspace.parts(&record);
        let above = 0.5 * (1.0 + ng.z);
        assert_eq!(shares.filled, 1.0, "nobody fills what is below");
        assert!((parts.unchanged - above).abs() < 0.01, "{parts:?}, but {above} is above");
        assert_eq!((parts.moved, parts.bared, parts.opened), (0.0, 0.0, 0.0), "{parts:?}");
    }
}
