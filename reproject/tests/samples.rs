//! What a point sees by a reprojection, told as samples, is what its own rays would tell.

mod rooms;

use glam::{Vec2, Vec3A};
use hemimap::Frame;
use radcache::{MergeSettings, RecordSettings, Samples};
use reproject::{Settings, Workspace};
use rooms::{Rays, Scene, record_in, uniform};

const FRAME: Frame = Frame { s: Vec3A::X, t: Vec3A::Y, n: Vec3A::Z };

fn unmerged() -> RecordSettings {
    RecordSettings { merge: MergeSettings { max_side: 1, ..MergeSettings::default() }, ..RecordSettings::default() }
}

#[test]
fn at_its_own_place_a_record_gives_back_its_samples() {
    for scene in [Scene::clutter(60), Scene::yard()] {
        let look = |p, wi| scene.look(p, wi);
        let from = Vec3A::new(0.1, -0.2, -0.999);
        let record = record_in(look, from, FRAME, 32, &unmerged());
        let (mut workspace, mut samples) = (Workspace::new(), Samples::new(1));
        workspace.project(&record, from, Vec3A::Z, &Settings::default());
        workspace.trace_holes(1, 0, &mut Rays(from, look));
        workspace.samples(&record, &mut samples);
        let own = record.samples();
        assert_eq!(samples.radiance, own.radiance, "radiance");
        assert_eq!(samples.background_share, own.background_share, "what is infinitely far");
        // Corners of elements keep to within a tenth of the distances that rays found, which bends elements at edges.
        let grazing = |texel: usize| own.direction(texel).dot(own.normal[texel].into()).abs() < 0.2;
        for texel in (0..32 * 32).filter(|&texel| !grazing(texel)) {
            let (found, known) = (samples.distance[texel], own.distance[texel]);
            let same = found == known || (found / known - 1.0).abs() < 0.1;
            assert!(same, "texel {texel} lies at {found} instead of {known}");
        }
    }
}

#[test]
fn nothing_is_left_of_what_the_buffer_held() {
    let scene = Scene::clutter(60);
    let look = |p, wi| scene.look(p, wi);
    let from = Vec3A::new(0.1, -0.2, -0.999);
    let record = record_in(look, from, FRAME, 16, &RecordSettings::default());
    let p = from + Vec3A::X * (0.5 * record.radius());
    let mut workspace = Workspace::new();
    workspace.project(&record, p, Vec3A::Z, &Settings::default());
    workspace.trace_holes(1, 0, &mut Rays(p, look));
    let (mut fresh, mut used) = (Samples::new(16), Samples::new(16));
    for texel in 0..16 * 16 {
        used.set_jitter(texel, Vec2::new(0.1, 0.9));
        used.view_dependent[texel] = true;
    }
    workspace.samples(&record, &mut fresh);
    workspace.samples(&record, &mut used);
    assert_eq!(used, fresh, "rays through the centres of texels, and light that others may take");
    let usual = Samples::new(16);
    assert!((0..16 * 16).all(|texel| used.direction(texel) == usual.direction(texel)), "through the centres");
    assert!(!used.view_dependent.contains(&true), "what others may take");
}

#[test]
fn elsewhere_distances_and_normals_are_those_of_rays() {
    for (name, scene, least) in [("cornell", Scene::cornell(), 0.95), ("clutter", Scene::clutter(60), 0.85)] {
        let look = |p, wi| scene.look(p, wi);
        let (mut right, mut all) = (0.0, 0.0);
        for k in 0..8u64 {
            let from = Vec3A::new(uniform(3 * k) - 0.5, uniform(3 * k + 1) - 0.5, -0.999);
            let record = record_in(look, from, FRAME, 32, &RecordSettings::default());
            let p = from + Vec3A::new(0.6, -0.8, 0.0) * (0.3 * record.radius());
            let n = Vec3A::new(0.1, 0.05, 1.0).normalize();
            let (mut workspace, mut samples) = (Workspace::new(), Samples::new(32));
            workspace.project(&record, p, n, &Settings::default());
            workspace.trace_holes(1, k, &mut Rays(p, look));
            workspace.samples(&record, &mut samples);
            for texel in 0..32 * 32 {
                let (radiance, distance, normal) = look(p, workspace.frame().to_world(samples.direction(texel)));
                let found = (samples.radiance[texel], samples.distance[texel], samples.normal[texel]);
                let known = workspace.frame().to_local(normal);
                let same = (found.1 / distance - 1.0).abs() < 0.1 && found.2.dot(known.into()) > 0.95;
                // Texels at edges may show either side; the light of merged ones is a mean.
                right += f32::from(same && (found.0 - radiance).abs().max_element() < 0.3);
                all += 1.0;
            }
        }
        assert!(right / all > least, "{name}: {} of the texels are right", right / all);
    }
}
